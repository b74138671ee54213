"""A place and a lidar without a simulator: for tests, examples and the demo."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from floor_plans import Grid
from floor_plans.occupancy_grid import with_walls
from lidar_navigation.geometry import Scan


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
