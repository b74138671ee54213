"""What the lidar sees and the map does not have, remembered until it is seen to be gone.

A point counts when it lies well away from everything the map has occupied. It is forgotten when a
ray goes through where it was, or when it has not been seen for a long time. After `settle` seconds
in one place it is taken to be furniture, and stays; before that it may be a person who walks on.
Points beside each other are one thing, which has stood for as long as its oldest point. An
exception is a point through which a ray went meanwhile: there somebody new has come.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from lidar_navigation.geometry import Points, Pose, Scan, composed, in_map

_Cell = tuple[int, int]
"""Column and row."""
_BESIDE = tuple(itertools.product(range(-2, 3), repeat=2))
"""Steps to the cells of the same thing: rays that meet it far away leave gaps."""


@dataclass(frozen=True)
class _Sight:
    """When a point was seen first and last, seconds."""

    since: float
    last: float


class ObstacleMemory:
    """The obstacles seen so far.

    Args:
        grid: The map.
        cell: Points closer together than this are one, metres.
        apart: Nearer than this to what the map has, a point is the map's, metres.
        reach: Points further from the robot than this are not taken, metres.
        keep: How long an obstacle that is not seen again is remembered, seconds.
        settle: What was seen to stand for this long stays, seconds.
        gap: What was not seen for this long may be another one that stands there, seconds.
    """

    def __init__(
        self,
        grid: Grid,
        cell: float = 0.05,
        apart: float = 0.25,
        reach: float = 4.0,
        keep: float = 120.0,
        settle: float = 30.0,
        gap: float = 5.0,
    ) -> None:
        self._cell = cell
        self._apart = apart
        self._reach = reach
        self._keep = keep
        self._settle = settle
        self._gap = gap
        self._seen: dict[_Cell, _Sight] = {}
        # Of the cells beside what is seen: when a ray went through last, seconds.
        self._free: dict[_Cell, float] = {}
        self.set_map(grid)

    def set_map(self, grid: Grid) -> None:
        """Replace the map; obstacles that it has are the map's from now on."""
        self._grid = grid
        self._known = distance_to(grid.occupied, grid.resolution)
        # A frame of what is off the map.
        self._framed = np.pad(self._known, 1, constant_values=-np.inf)
        for cell in list(self._seen):
            at = (np.array(cell, dtype=float) + 0.5) * self._cell
            if grid.interpolated(self._known, at)[0] <= self._apart:
                del self._seen[cell]

    @property
    def points(self) -> Points:
        """The obstacles, points of shape (n, 2), metres, map frame."""
        cells = np.array(sorted(self._seen), dtype=float).reshape(-1, 2)
        return (cells + 0.5) * self._cell

    @property
    def stay(self) -> NDArray[np.bool_]:
        """Which of the obstacles stay, shape (n,); the others may be people."""
        return np.array([self._stays(self._seen[cell]) for cell in sorted(self._seen)], np.bool_)

    def _stays(self, sight: _Sight) -> bool:
        return sight.last - sight.since >= self._settle

    def is_unknown(self, points: Points, apart: float) -> NDArray[np.bool_]:
        """Tell which points, shape (n, 2), lie on the map and further than `apart` metres from
        what it has."""
        # Most points are the map's: within a cell the distance is less than a cell's side greater
        # than at its centre.
        row, column = self._grid.cells_of(points).T
        rows, columns = self._framed.shape
        row, column = np.minimum(row + 1, rows - 1), np.minimum(column + 1, columns - 1)
        near = self._framed.ravel().take(row * columns + column)
        unknown: NDArray[np.bool_] = near > apart - self._grid.resolution
        if unknown.any():
            unknown[unknown] = self._grid.interpolated(self._known, points[unknown]) > apart
        return unknown

    def update(
        self,
        pose: Pose,
        scan: Scan,
        now: float,
        may_move: Callable[[Points], NDArray[np.bool_]] | None = None,
    ) -> bool:
        """Take a scan made at a pose that is to be trusted.

        Args:
            pose: Where the robot is.
            scan: What it sees.
            now: The scan's time, seconds.
            may_move: Tells which points are not remembered, for what they belong to may move.

        Returns:
            Whether the obstacles changed, or one of them stays from now on.
        """
        before = self._standing()
        self._forget(pose, scan, now)
        local = scan.points
        local = local[(local**2).sum(axis=1) <= self._reach**2]
        points = in_map(pose, local)
        new = points[self.is_unknown(points, self._apart)]
        if may_move is not None:
            new = new[~may_move(new)]
        for column, row in np.floor(new / self._cell).astype(int).tolist():
            cell = column, row
            sight = self._seen.get(cell)
            if sight is None:
                for beside in _beside(cell):
                    self._free.setdefault(beside, -math.inf)
            if sight is not None and self._is_same(sight, now):
                since = sight.since
            else:
                since = self._stood_since(cell, now)
            self._seen[cell] = _Sight(since, now)
        return self._standing() != before

    def _is_same(self, sight: _Sight, now: float) -> bool:
        """Tell whether what was seen then has certainly stood there until now."""
        return now - sight.last <= self._gap or self._stays(sight)

    def _stood_since(self, cell: _Cell, now: float) -> float:
        """Return since when the thing that is now seen for the first time in a cell has stood
        there, seconds."""
        beside = (self._seen.get(each) for each in _beside(cell))
        known = (each.since for each in beside if each is not None and self._is_same(each, now))
        return max(min(known, default=now), self._free[cell])

    def _standing(self) -> dict[_Cell, bool]:
        return {cell: self._stays(sight) for cell, sight in self._seen.items()}

    def _forget(self, pose: Pose, scan: Scan, now: float) -> None:
        if not self._seen:
            return
        pose = composed(pose, scan.mount)
        away = (np.array(list(self._free), dtype=float) + 0.5) * self._cell - pose[:2]
        distance = np.hypot(away[:, 0], away[:, 1])
        bearing = np.arctan2(away[:, 1], away[:, 0]) - pose[2]
        count = len(scan.angles)
        step = float(np.median(np.diff(scan.angles))) if count > 1 else math.tau
        first = scan.angles[0] - step / 2
        towards = np.mod(bearing - first, math.tau) + first
        ray = np.searchsorted((scan.angles[1:] + scan.angles[:-1]) / 2, towards)
        ray[towards > scan.angles[-1] + step / 2] = count
        beyond = np.minimum(scan.ranges, scan.range_max)
        # The neighbours too: a thin obstacle between two rays is not gone.
        around = [beyond[np.clip(ray + offset, 0, count - 1)] for offset in (-1, 0, 1)]
        free = (ray < count) & (np.minimum.reduce(around) > distance + 2 * self._cell)
        self._free |= dict.fromkeys(itertools.compress(self._free, free), now)
        kept = {
            cell: sight
            for cell, sight in self._seen.items()
            if self._free[cell] < now and now - sight.last <= self._keep
        }
        if len(kept) < len(self._seen):
            self._seen = kept
            near = {beside for cell in kept for beside in _beside(cell)}
            self._free = {cell: at for cell, at in self._free.items() if cell in near}


def _beside(cell: _Cell) -> Iterator[_Cell]:
    """Yield the cells that belong to the same thing, the cell itself included."""
    return ((cell[0] + right, cell[1] + up) for right, up in _BESIDE)
