"""A map that grows with what scans show, and from which a scan can be taken away again.

Each scan votes once for each cell: that something is there, or that its rays passed. The votes are
summed as log-odds (Moravec, Elfes, "High resolution maps from wide angle sonar", ICRA 1985) without
a limit, so that a scan whose pose was corrected is taken away and added anew, and all others stay.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from lidar_navigation.geometry import Points, Pose, Scan, composed

HIT, PASSED = 17, -8
"""What a vote adds to a cell's log-odds, in units of 0.05: probabilities of 0.7 and 0.4."""
_STEP = 32
"""By a multiple of so many cells the map grows."""
_MOST_BETWEEN = 8
"""Between two rays at most so many are drawn that were not measured."""


class EvidenceGrid:
    """The sum of what scans show.

    Args:
        resolution: Side of a cell, metres.
    """

    def __init__(self, resolution: float = 0.05) -> None:
        self.resolution = resolution
        self._corner = (0, 0)  # row and column of the first cell, counted from the frame's origin
        self._odds: NDArray[np.int32] = np.zeros((_STEP, _STEP), np.int32)
        self._votes: NDArray[np.int32] = np.zeros((_STEP, _STEP), np.int32)

    def add(self, pose: Pose, scan: Scan) -> None:
        """Add what a scan shows that was made at a pose of the robot."""
        self._vote(pose, scan, 1)

    def remove(self, pose: Pose, scan: Scan) -> None:
        """Take a scan away that was added with this pose."""
        self._vote(pose, scan, -1)

    def grid(self) -> Grid:
        """Return the map as it is now."""
        cells = np.full(self._odds.shape, UNKNOWN, np.int8)
        known = self._votes > 0
        cells[known] = np.where(self._odds[known] > 0, np.int8(OCCUPIED), np.int8(FREE))
        row, column = self._corner
        return Grid(cells, self.resolution, (column * self.resolution, row * self.resolution))

    def _vote(self, pose: Pose, scan: Scan, times: int) -> None:
        x, y, yaw = composed(pose, scan.mount)
        passed, met = self._rays(scan)
        ends = np.concatenate([passed[1], met[1]])
        if not len(ends):
            return
        reach = math.ceil(float(ends.max()) / self.resolution) + 2
        column, row = math.floor(x / self.resolution), math.floor(y / self.resolution)
        corner = row - reach, column - reach
        side = 2 * reach + 1
        window = self._window(corner, side)
        free = np.zeros((side, side), np.bool_)
        for rows, columns in self._ways(x, y, yaw, passed, met, corner):
            free[rows, columns] = True
        taken = np.zeros((side, side), np.bool_)
        rows, columns = self._cells(x, y, met[0] + yaw, met[1], corner)
        taken[rows, columns] = True
        free &= ~taken
        self._odds[window] += times * (HIT * taken + PASSED * free)
        self._votes[window] += times * (taken | free)

    def _rays(self, scan: Scan) -> tuple[tuple[Points, Points], tuple[Points, Points]]:
        """Return direction and length of rays that passed, and of those that met something.

        Between two neighbours more are drawn, as long as the shorter of both, so that no cells are
        left between rays far away.
        """
        known = ~np.isnan(scan.ranges)
        angles = scan.angles[known]
        ranges = np.minimum(scan.ranges[known], scan.range_max)
        met = scan.ranges[known] < scan.range_max
        all_angles, lengths = [angles], [ranges - np.where(met, self.resolution, 0.0)]
        if len(angles) > 1:
            gaps = np.diff(angles)
            between = np.minimum(ranges[1:], ranges[:-1]) - 1.5 * self.resolution
            count = np.ceil(np.abs(gaps) * between / self.resolution).clip(1, _MOST_BETWEEN)
            usual = float(np.median(np.abs(gaps)))
            for part in range(1, int(count.max())):
                # Where rays are left out, nothing is known between.
                more = (count > part) & (np.abs(gaps) < 1.5 * usual)
                all_angles.append(angles[:-1][more] + gaps[more] * part / count[more])
                lengths.append(between[more])
        passed = np.concatenate(all_angles), np.maximum(np.concatenate(lengths), 0.0)
        return passed, (angles[met], ranges[met])

    def _ways(
        self,
        x: float,
        y: float,
        yaw: float,
        passed: tuple[Points, Points],
        met: tuple[Points, Points],
        corner: tuple[int, int],
    ) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Return the cells on the way of the rays."""
        directions, lengths = passed[0] + yaw, passed[1]
        # Steps of at most a cell; long rays alone are followed far.
        steps = (
            0.9
            * self.resolution
            * np.arange(math.ceil(float(lengths.max()) / self.resolution * 1.2) + 1)
        )
        order = np.argsort(lengths)
        directions, lengths = directions[order], lengths[order]
        cells = []
        for part in np.array_split(np.arange(len(order)), 8):
            if not len(part):
                continue
            way = steps[steps <= lengths[part[-1]]]
            distance = np.minimum(way, lengths[part, None])
            cells.append(self._cells(x, y, directions[part, None], distance, corner))
        return cells

    def _cells(
        self, x: float, y: float, directions: Points, distance: Points, corner: tuple[int, int]
    ) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        columns = np.floor((x + distance * np.cos(directions)) / self.resolution).astype(np.intp)
        rows = np.floor((y + distance * np.sin(directions)) / self.resolution).astype(np.intp)
        return (rows - corner[0]).ravel(), (columns - corner[1]).ravel()

    def _window(self, corner: tuple[int, int], side: int) -> tuple[slice, slice]:
        """Return where a square of cells lies on the map, which grows as needed."""
        bottom, left = self._corner
        rows, columns = self._odds.shape
        before = [max(0, -((corner[i] - self._corner[i]) // _STEP) * _STEP) for i in range(2)]
        after = [
            max(0, math.ceil((corner[i] + side - self._corner[i] - count) / _STEP) * _STEP)
            for i, count in enumerate((rows, columns))
        ]
        if any(before) or any(after):
            grow = list(zip(before, after, strict=True))
            self._odds, self._votes = np.pad(self._odds, grow), np.pad(self._votes, grow)
            self._corner = bottom, left = bottom - before[0], left - before[1]
        row, column = corner[0] - bottom, corner[1] - left
        return slice(row, row + side), slice(column, column + side)
