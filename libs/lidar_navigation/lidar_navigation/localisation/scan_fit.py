"""How well a scan fits a map from a pose, and where close by it fits best.

Two models of the same rays. To correct a pose, the points that were met are drawn onto the edges of
what the map has occupied: Gauss-Newton on the signed distance to those edges (a likelihood field;
Thrun, Burgard, Fox, "Probabilistic Robotics", 6.4). To judge a pose, the rays are cast into the map
(the beam model, 6.3), and each one says one of three things. It goes as far as it should: a hit. It
ends before: something new stands there, which may always be. It goes on through a wall: that cannot
be, unless the map is wrong.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from lidar_navigation.geometry import Points, Pose, Scan, angle_between, composed

HIT = 0.15
"""A ray agrees with the map when it is off by at most this, metres, beside half a cell."""
SHORT = 0.5
"""What a ray counts that ends before the map has anything, beside one that agrees.

With as little as one that goes through a wall, a robot before a shut door took itself for one in
another room. With as much as one that agrees, one that was carried into a smaller room would not
notice it.
"""
REFUTING = 0.05
"""A pose is refuted when a greater part of the rays goes on through what the map has occupied,"""
SUPPORT = 0.2
"""or a smaller one goes as far as it should."""
SPREAD = 0.2
"""Points further than about this from any edge lose their weight, metres."""
SHORT_NATS, LONG_NATS = 6.0, 24.0
"""By how much a scan is less likely all of whose rays are too short, or too long, nats.

Neighbouring rays meet the same thing, so that a scan counts as a dozen of them.
"""
BODY = 0.15
"""Radius within which a robot cannot overlap anything, metres."""


class Evidence(NamedTuple):
    """What a scan's rays say of a pose: parts of those that tell anything, which sum up to 1.

    Attributes:
        hit: They go as far as the map says.
        short: They end before: something stands there that the map does not have.
        long: They go on through what the map has occupied.
    """

    hit: float
    short: float
    long: float

    @property
    def fit(self) -> float:
        """How well the pose explains the scan, 0 to 1.

        What is new excuses no pose from which rays go through walls.
        """
        if self.long > REFUTING:
            return self.hit
        return self.hit + SHORT * self.short

    @property
    def log_likelihood(self) -> float:
        """How likely the scan is from the pose, nats below one that goes as far as it should."""
        return -SHORT_NATS * self.short - LONG_NATS * self.long

    @property
    def blank_likelihood(self) -> float:
        """The same of a robot that may be anywhere, for which nothing has changed before it."""
        return -(SHORT_NATS + LONG_NATS) / 2 * (self.short + self.long)

    @property
    def refutes(self) -> bool:
        """Whether the robot cannot be there, whatever stands around it: what is new explains the
        rest, such as a door that was shut.
        """
        return self.long > REFUTING or self.hit < SUPPORT


NOTHING = Evidence(0.0, 0.0, 0.0)
"""Of a scan that tells nothing."""


class ScanFit:
    """One map, as scans are compared with it.

    Args:
        grid: The map.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        half = np.float32(grid.resolution / 2)
        occupied = grid.occupied
        outside = distance_to(occupied, grid.resolution)
        inside = distance_to(~occupied, grid.resolution)
        signed = np.where(occupied, half - inside, outside - half)
        # With nothing or everything occupied nothing is to match: one finite value, no slope.
        self.edges: NDArray[np.float32] = np.clip(signed, -10.0, 10.0)
        # A slope needs two cells.
        short = [(0, max(0, 2 - count)) for count in signed.shape]
        self.edges = np.pad(self.edges, short, mode='edge')
        self._occupied = occupied
        self.standable = grid.free & (outside - half >= BODY)

    def _beyond(self, pose: Pose, scan: Scan) -> Points:
        """Return by how much each ray goes farther than it should, metres; NaN: it tells nothing.

        One that met nothing within the lidar's reach went at least that far.
        """
        expected = self.cast(composed(pose, scan.mount), scan.angles, scan.range_max)
        return np.asarray(np.minimum(scan.ranges, scan.range_max) - expected)

    def mapped(self, pose: Pose, scan: Scan, slack: float) -> Scan:
        """Return a scan without what ends before the map has anything, as seen from a pose.

        What is new tells nothing of where the robot is, and would draw it along (the distance
        filter of Fox, Burgard, Thrun, "Markov localization for mobile robots in dynamic
        environments", JAIR 1999).

        Args:
            pose: Where the robot is about.
            scan: The scan.
            slack: A ray may be so much shorter because the pose is off, metres.
        """
        new = self._beyond(pose, scan) < -(HIT + slack)
        return replace(scan, ranges=np.where(new, np.nan, scan.ranges)) if new.any() else scan

    def evidence(self, pose: Pose, scan: Scan) -> Evidence:
        """Return what a scan's rays say of a pose."""
        off = self._beyond(pose, scan)
        off = off[~np.isnan(off)]
        if not len(off):
            return NOTHING
        slack = HIT + self.grid.resolution / 2
        short, long = float((off < -slack).mean()), float((off > slack).mean())
        return Evidence(1.0 - short - long, short, long)

    def cast(self, pose: Pose, angles: Points, range_max: float) -> Points:
        """Return how far rays go in the map from a pose until they meet something occupied.

        Returns:
            Shape of `angles`, metres, at most `range_max`; to half a cell.
        """
        step = self.grid.resolution / 2
        # Nothing of the map is farther away than its diagonal is long.
        rows, columns = self._occupied.shape
        diagonal = math.hypot(rows, columns) * self.grid.resolution
        way = np.arange(0.0, min(range_max, diagonal) + step, step)
        heading = angles + pose[2]
        x = pose[0] + np.cos(heading)[:, None] * way
        y = pose[1] + np.sin(heading)[:, None] * way
        column = ((x - self.grid.origin[0]) * (1 / self.grid.resolution)).astype(np.int32)
        row = ((y - self.grid.origin[1]) * (1 / self.grid.resolution)).astype(np.int32)
        np.clip(column, 0, columns - 1, out=column)
        np.clip(row, 0, rows - 1, out=row)
        hit = self._occupied.ravel().take(row * columns + column)
        first = hit.argmax(axis=1)
        met = hit[np.arange(len(angles)), first]
        return np.where(met, np.minimum(way[first], range_max), range_max)

    def matched(self, pose: Pose, points: Points, moved: tuple[float, float]) -> Pose:
        """Return the pose near `pose` at which points (robot's frame) lie on the map's edges."""
        if len(points) < 8:
            return pose
        estimate = np.array(pose)
        # Pull towards the odometry: a standard deviation per direction, beside 3 cm of a point.
        deviation = np.array([0.05 + 0.2 * moved[0]] * 2 + [0.04 + 0.1 * moved[0] + 0.2 * moved[1]])
        pull = (0.03 / deviation) ** 2
        for _ in range(8):
            cos, sin = math.cos(estimate[2]), math.sin(estimate[2])
            x = estimate[0] + cos * points[:, 0] - sin * points[:, 1]
            y = estimate[1] + sin * points[:, 0] + cos * points[:, 1]
            error, slope_x, slope_y = self.edge_at(x, y)
            weight = 1.0 / (1.0 + (error / SPREAD) ** 2) ** 2
            slope_turn = slope_y * (x - estimate[0]) - slope_x * (y - estimate[1])
            jacobian = np.array([slope_x, slope_y, slope_turn])
            weighted = jacobian * weight
            back = estimate - pose
            back[2] = angle_between(pose[2], estimate[2])
            change = np.linalg.solve(
                weighted @ jacobian.T + np.diag(pull + 1e-9), -(weighted @ error + pull * back)
            )
            estimate += np.minimum(np.maximum(change, -0.15), 0.15)
            if np.abs(change).max() < 1e-4:
                break
        return float(estimate[0]), float(estimate[1]), math.remainder(estimate[2], math.tau)

    def edge_at(self, x: Points, y: Points) -> tuple[Points, Points, Points]:
        """Signed distance to the nearest edge and its slope along x and y, bilinear."""
        column = (x - self.grid.origin[0]) / self.grid.resolution - 0.5
        row = (y - self.grid.origin[1]) / self.grid.resolution - 0.5
        rows, columns = self.edges.shape
        column = np.minimum(np.maximum(column, 0), columns - 1.001)
        row = np.minimum(np.maximum(row, 0), rows - 1.001)
        c, r = column.astype(np.intp), row.astype(np.intp)
        u, v = column - c, row - r
        flat = self.edges.ravel()
        base = r * columns + c
        sw, se, nw, ne = flat[base], flat[base + 1], flat[base + columns], flat[base + columns + 1]
        south, north = sw + (se - sw) * u, nw + (ne - nw) * u
        slope_x = ((se - sw) * (1 - v) + (ne - nw) * v) / self.grid.resolution
        slope_y = (north - south) / self.grid.resolution
        return south + (north - south) * v, slope_x, slope_y

    def can_stand(self, pose: Pose) -> bool:
        """Tell whether a robot can be there: on free floor, beside everything occupied."""
        return bool(self.grid.at(self.standable, *pose[:2]))
