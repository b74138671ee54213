"""People who walk a given way, there and back, until they are taken out of the place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from floor_plans import PlaceError
from floor_plans.shapes import Point
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.simulated_place import SimulatedPlace

SPEED = 1.0
"""How fast they walk, m/s."""
_KEPT = 0.8
"""They stop so far from the robot's middle, metres."""
_BODY = 0.2
"""Half of what a person needs to pass, metres."""
_STEP = 0.1


@dataclass
class _Walk:
    points: tuple[Point, ...]
    done: float = 0.0

    def at(self) -> tuple[float, float, float]:
        """Return where the person is, metres, and the direction of the way, rad."""
        points = np.array(self.points)
        legs = np.diff(points, axis=0)
        passed = np.concatenate([[0.0], np.cumsum(np.hypot(*legs.T))])
        total = float(passed[-1])
        # There and back again.
        phase = self.done % (2.0 * total)
        left, turn = (phase, 0.0) if phase <= total else (2.0 * total - phase, math.pi)
        x, y = (float(np.interp(left, passed, each)) for each in points.T)
        dx, dy = legs[int(np.searchsorted(passed[1:-1], left))]
        return x, y, math.atan2(dy, dx) + turn


class Walks:
    """The people of a world who walk a given way."""

    def __init__(self, world: SimulatedPlace) -> None:
        self._world = world
        self._walks: dict[str, _Walk] = {}

    def __len__(self) -> int:
        return len(self._walks)

    def begin(self, name: str, points: tuple[Point, ...]) -> None:
        """Let a person of this name walk from the first point to the last, and back.

        Raises:
            PlaceError: There are fewer than two points, or a wall is in the way.
        """
        if len(points) < 2 or any(a == b for a, b in pairwise(points)):
            raise PlaceError((), f"person '{name}': expected two different points or more")
        them = person(name, *points[0], 0.0)
        for (x1, y1), (x2, y2) in pairwise(points):
            steps = max(1, math.ceil(math.dist((x1, y1), (x2, y2)) / _STEP))
            for each in range(steps + 1):
                x, y = x1 + (x2 - x1) * each / steps, y1 + (y2 - y1) * each / steps
                if self._world.wall_clearance(x, y) < _BODY:
                    raise PlaceError(
                        (),
                        f"person '{name}': a wall or a leaf is in the way at ({x:.1f}, {y:.1f})",
                    )
        self._walks[name] = _Walk(points)
        self._world.put(them)

    def end(self, name: str) -> None:
        """Let a person of this name walk no more; nothing happens when they did not."""
        self._walks.pop(name, None)

    def step(self, dt: float, robots: Sequence[Point]) -> None:
        """Let everybody walk on for `dt` seconds, but not into a robot."""
        for name, walk in self._walks.items():
            before = walk.done
            x, y, _ = walk.at()
            walk.done += SPEED * dt
            there = walk.at()
            if any(
                math.dist(there[:2], robot) < min(_KEPT, math.dist((x, y), robot))
                for robot in robots
            ):
                walk.done = before
                continue
            self._world.put(person(name, *there))
