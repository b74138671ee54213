"""Fixtures for the controllers' tests: an operator who types into a pipe, a flat with a lidar."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, ClassVar, TextIO

import numpy as np
import pytest
import yaml

from floor_plans import Grid
from floor_plans.occupancy_grid import with_walls
from lidar_navigation.geometry import Scan
from surveillance_simulation.world.simulated_place import SimulatedPlace, read_simulated_place


class Operator:
    """Types lines into a controller's pipe."""

    def __init__(self) -> None:
        read, write = os.pipe()
        self.source: TextIO = os.fdopen(read)
        self._keyboard: TextIO = os.fdopen(write, 'w')

    def type(self, line: str) -> None:
        """Types one line."""
        print(line, file=self._keyboard, flush=True)

    def hang_up(self) -> None:
        """End the input."""
        self._keyboard.close()

    def close(self) -> None:
        """Close both ends."""
        self.source.close()
        self._keyboard.close()


@pytest.fixture
def operator() -> Iterator[Operator]:
    """Provide an operator at a pipe; hand `operator.source` to a controller as its
    `console_source`.
    """
    operator = Operator()
    yield operator
    operator.close()


@pytest.fixture
def in_background() -> Iterator[Callable[[Callable[[], Any]], Callable[[], Any]]]:
    """Run work on a thread; give a function that waits for what the work returned or raised."""
    with ThreadPoolExecutor() as pool:

        def start(work: Callable[[], Any]) -> Callable[[], Any]:
            future = pool.submit(work)
            return lambda: future.result(60.0)

        yield start


class Flat:
    """A flat of two different rooms, as a map, with rays cast against its walls by brute force.

    Room A is 4 m x 3 m with a pillar, room B 3 m x 3 m with a niche; a door of 1 m joins them.
    """

    RESOLUTION = 0.05
    DOOR = (4.05, 1.0, 4.05, 2.0)
    POSITIONS: ClassVar[dict[str, tuple[float, float]]] = {'A': (2.0, 1.5), 'B': (5.5, 1.5)}

    def __init__(self) -> None:
        cells = np.full((66, 146), 100, np.int8)
        cells[1:61, 1:81] = 0
        cells[1:61, 82:142] = 0
        cells[20:40, 81] = 0
        cells[44:50, 20:26] = 100
        cells[61:65, 100:110] = 0
        self.grid = Grid(cells, self.RESOLUTION, (0.0, 0.0))
        self.noise = np.random.default_rng(5)

    def scan(
        self,
        pose: tuple[float, float, float],
        obstacles: Sequence[tuple[float, float, float]] = (),
        closed: bool = False,
    ) -> Scan:
        """Return what a lidar of 8 m sees: x, y and radius of obstacles in metres, the door closed
        or not.
        """
        grid = with_walls(self.grid, [self.DOOR]) if closed else self.grid
        angles = np.linspace(-math.pi, math.pi, 180, endpoint=False)
        way = np.arange(0, 8, 0.02)
        x = pose[0] + np.cos(angles + pose[2])[:, None] * way
        y = pose[1] + np.sin(angles + pose[2])[:, None] * way
        cells = grid.cells_of(np.stack([x.ravel(), y.ravel()], axis=1))
        cells = np.clip(cells, 0, np.array(grid.cells.shape) - 1)
        hit = grid.occupied[cells[:, 0], cells[:, 1]].reshape(x.shape)
        for at_x, at_y, radius in obstacles:
            hit |= np.hypot(x - at_x, y - at_y) <= radius
        first = way[hit.argmax(axis=1)] + self.noise.normal(0, 0.01, len(angles))
        return Scan(angles, np.where(hit.any(axis=1), first, np.inf), 8.0)


@pytest.fixture
def seven_rooms() -> dict[str, Any]:
    """Provide the seven rooms' file as flat parameter overrides."""
    file = Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml'
    flat: dict[str, Any] = {}
    for name, value in yaml.safe_load(file.read_text())['/**']['ros__parameters'].items():
        if isinstance(value, dict):
            flat.update({f'{name}.{key}': entry for key, entry in value.items()})
        else:
            flat[name] = value
    return flat


@pytest.fixture
def flat() -> Flat:
    """Two rooms and a lidar in them."""
    return Flat()


@pytest.fixture
def seven_rooms_world() -> SimulatedPlace:
    """Provide the seven rooms, as simulated."""
    return read_simulated_place(Path(__file__).parents[2] / 'config' / 'seven_rooms.yaml')
