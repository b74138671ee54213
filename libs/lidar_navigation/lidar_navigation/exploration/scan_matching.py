"""From where a scan was made, by what others saw before.

Two steps. A correlative search tries all poses of a window: the scan's points are laid over a
picture in which what was seen before is bright, and the brightest sum wins (Olson, "Real-time
correlative scan matching", ICRA 2009). It cannot be caught by a bad guess. From the best pose the
points are then drawn onto the lines that were seen (point-to-line ICP; Censi, "An ICP variant using
a point-to-line metric", ICRA 2008), which is exact to a few millimetres, and says by its normal
equations in which direction the scan tells nothing, as along a corridor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lidar_navigation.geometry import Points, Pose, Scan, angle_between, composed, in_map

Matrix = NDArray[np.float64]

_SIDE = 7
"""Neighbours in a scan of which the line through a point is taken."""
_GAP = 0.3
"""Neighbours further apart than this, metres, belong to different things,"""
_GAP_TURN = 0.06
"""or this part of their distance from the lidar, if that is more."""
_SHARED = 4.0
"""Neighbouring points share the errors of their line: as many tell no more than one."""
_THIN = 0.15
"""Points whose spread across the line exceeds this part of that along it lie on none."""
_FEW = 1000
"""Up to so many points are compared one by one: quicker than a tree for those of one scan."""
_WIDE = 3
"""In the first rounds points further from their line keep their weight."""


@dataclass(frozen=True)
class MatchingParameters:
    """How a scan is matched.

    Attributes:
        points: Points of a scan that are matched.
        cell: Side of a pixel of the picture that is searched, metres.
        blur: How far beside what was seen a point still counts, metres.
        reach: A point further than this from every line belongs to none, metres.
        spread: Points further than about this from their line lose their weight, metres.
        noise: Standard deviation of a point's distance from its line, metres.
        agree: A point within this distance of a line agrees, metres.
        facing: What a difference of the normals counts beside one of the place, metres: so that
            the two sides of a wall are not taken for each other.
        through: A ray that goes on behind a line by more than this contradicts it, metres.
    """

    points: int = 180
    cell: float = 0.05
    blur: float = 0.08
    reach: float = 0.3
    spread: float = 0.06
    noise: float = 0.02
    agree: float = 0.08
    facing: float = 0.3
    through: float = 0.3


@dataclass(frozen=True, eq=False)
class Surface:
    """Points that were seen, with the direction that each one faces.

    Attributes:
        points: Shape (n, 2), metres.
        normals: Shape (n, 2), of length 1, towards the side from which it was seen.
    """

    points: Points
    normals: Points

    def moved(self, pose: Pose) -> Surface:
        """Return what is given in the frame of a pose in the frame of the map."""
        turn: Pose = (0.0, 0.0, pose[2])
        return Surface(in_map(pose, self.points), in_map(turn, self.normals))

    def thinned(self, count: int) -> Surface:
        """Return about `count` of the points, evenly taken."""
        step = max(1, len(self.points) // count)
        return Surface(self.points[::step], self.normals[::step])


def surface_of(scan: Scan) -> Surface:
    """Return the points of a scan that lie on lines, robot's frame."""
    met = scan.ranges < scan.range_max
    points, ranges = scan.points, scan.ranges[met]
    if len(points) < _SIDE:
        return Surface(np.zeros((0, 2)), np.zeros((0, 2)))
    # Neighbours, also over the end of a full turn; a gap in between shows in the distances.
    half = _SIDE // 2
    around = np.arange(len(points))[:, None] + np.arange(-half, half + 1)
    near = points[around % len(points)]
    gaps = np.hypot(*np.diff(near, axis=1).transpose(2, 0, 1)).max(axis=1)
    middle = near.mean(axis=1, keepdims=True)
    spread = np.einsum('nki,nkj->nij', near - middle, near - middle)
    values, vectors = np.linalg.eigh(spread)
    on_line = (gaps <= np.maximum(_GAP, _GAP_TURN * ranges)) & (
        values[:, 0] <= _THIN**2 * values[:, 1]
    )
    points, normals = points[on_line], vectors[on_line, :, 0]
    # Towards the lidar: the two sides of a thin wall are different lines.
    away = ((points - scan.mount[:2]) * normals).sum(axis=1) > 0.0
    return Surface(points, np.where(away[:, None], -normals, normals))


def joined(surfaces: Sequence[Surface]) -> Surface:
    """Return several surfaces of one frame as one."""
    return Surface(
        np.concatenate([each.points for each in surfaces]),
        np.concatenate([each.normals for each in surfaces]),
    )


@dataclass(frozen=True, eq=False)
class Match:
    """Where a scan fits.

    Attributes:
        pose: From where it was made.
        information: Inverse covariance of the pose in its own frame, shape (3, 3).
        agreement: The part of the scan's points that lie on lines seen before, 0 to 1.
        contradiction: The part of the lines in view that the scan's rays go through, 0 to 1.
    """

    pose: Pose
    information: Matrix
    agreement: float
    contradiction: float


class Matcher:
    """Matches scans with what was seen before.

    Args:
        seen: That, in the frame of the map; at least one point.
        parameters: How.
    """

    def __init__(self, seen: Surface, parameters: MatchingParameters | None = None) -> None:
        self._p = parameters or MatchingParameters()
        self._seen = seen
        p = self._p
        faced = self._faced(seen)
        self._few, self._tree = faced.astype(np.float32), None
        if len(faced) > _FEW:
            from scipy.spatial import cKDTree  # 0.7 s and 20 MB, which one scan does without

            self._tree = cKDTree(faced)
        margin = 4 * p.cell
        self._corner = seen.points.min(axis=0) - margin
        columns, rows = np.ceil((seen.points.max(axis=0) + margin - self._corner) / p.cell)
        empty = np.ones((int(rows) + 1, int(columns) + 1), np.uint8)
        at = ((seen.points - self._corner) / p.cell).astype(np.intp)
        empty[at[:, 1], at[:, 0]] = 0
        away = cv2.distanceTransform(empty, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * p.cell
        self._bright = np.exp(-0.5 * (away / p.blur) ** 2).astype(np.float32)

    def match(
        self,
        scan: Scan,
        surface: Surface,
        guess: Pose,
        window: tuple[float, float],
        prior: Matrix | None = None,
    ) -> Match | None:
        """Return where a scan fits best; None where it shows nothing to fit.

        Args:
            scan: The scan.
            surface: Its lines, robot's frame.
            guess: Where it is believed to have been made.
            window: How far from there it is looked for: metres and rad.
            prior: How sure the guess is: its inverse covariance in its own frame, shape (3, 3);
                None: it says nothing.
        """
        few = surface.thinned(self._p.points)
        if len(few.points) < 10:
            return None
        start = self._searched(few.points, guess, window) if max(window) > 0.0 else guess
        pose, information = self._refined(few, start, guess, prior)
        return Match(pose, information, self._agreement(few, pose), self.contradiction(scan, pose))

    def _searched(self, points: Points, guess: Pose, window: tuple[float, float]) -> Pose:
        """Return the pose of the window at which the points lie on the brightest pixels."""
        far = float(np.hypot(*points.T).max())
        # A step of the heading moves the farthest point by about one step of the place.
        coarse = max(2 * self._p.cell, window[0] / 12)
        turn = max(coarse / max(far, 1.0), 0.02)
        best = self._best(points, guess, window, coarse, turn)
        fine = (coarse, turn)
        return self._best(points, best, fine, self._p.cell / 2, turn / 4)

    def _best(
        self,
        points: Points,
        guess: Pose,
        window: tuple[float, float],
        step: float,
        turn_step: float,
    ) -> Pose:
        count, turns = math.ceil(window[0] / step), math.ceil(window[1] / turn_step)
        shifts = np.arange(-count, count + 1) * step
        dx, dy = (each.ravel() for each in np.meshgrid(shifts, shifts))
        # Of poses that fit as well, the one next to the guess.
        dear = 0.02 * np.hypot(dx, dy) / max(window[0], 1e-6)
        rows, columns = self._bright.shape
        flat = self._bright.ravel()
        best: tuple[float, Pose] = -1.0, guess
        for turn in (np.arange(-turns, turns + 1) * turn_step).tolist():
            x, y = in_map((*guess[:2], guess[2] + turn), points).T
            column = ((x - self._corner[0] + dx[:, None]) / self._p.cell).astype(np.int32)
            row = ((y - self._corner[1] + dy[:, None]) / self._p.cell).astype(np.int32)
            # What lies off the picture is dark, as its edge is.
            np.clip(column, 0, columns - 1, out=column)
            np.clip(row, 0, rows - 1, out=row)
            worth = flat.take(row * columns + column).mean(axis=1)
            worth = worth * (1.0 - dear - 0.02 * abs(turn) / max(window[1], 1e-6))
            top = int(worth.argmax())
            if worth[top] > best[0]:
                best = (
                    float(worth[top]),
                    (guess[0] + float(dx[top]), guess[1] + float(dy[top]), guess[2] + turn),
                )
        return best[1]

    def _faced(self, surface: Surface) -> Points:
        """Return points with what they face as two more coordinates, shape (n, 4)."""
        return np.hstack([surface.points, self._p.facing * surface.normals])

    def _nearest(self, placed: Surface) -> tuple[Points, NDArray[np.intp]]:
        """Return how far what was seen is from each point, infinite beyond `reach`, and which it
        is.
        """
        faced = self._faced(placed)
        if self._tree is not None:
            found = self._tree.query(faced, distance_upper_bound=self._p.reach)
            return np.asarray(found[0]), np.asarray(found[1])
        away, which = cv2.batchDistance(
            faced.astype(np.float32), self._few, cv2.CV_32F, normType=cv2.NORM_L2, K=1
        )
        near = away[:, 0] < self._p.reach
        return np.where(near, away[:, 0], np.inf), which[:, 0].astype(np.intp)

    def _refined(
        self, few: Surface, start: Pose, guess: Pose, prior: Matrix | None
    ) -> tuple[Pose, Matrix]:
        """Draw the points onto their lines; return the pose and its information."""
        p = self._p
        estimate = np.array(start)
        held = np.zeros((3, 3)) if prior is None else prior
        information = np.zeros((3, 3))
        for number in range(20):
            x, y, yaw = estimate.tolist()
            cos, sin = math.cos(yaw), math.sin(yaw)
            placed = few.moved((x, y, yaw))
            away, nearest = self._nearest(placed)
            near = np.isfinite(away)
            if near.sum() < 5:
                break
            at, normals = nearest[near], self._seen.normals[nearest[near]]
            error = ((placed.points[near] - self._seen.points[at]) * normals).sum(axis=1)
            turned = placed.points[near] - (x, y)
            spread = p.spread * (3.0 if number < _WIDE else 1.0)
            weight = 1.0 / (1.0 + (error / spread) ** 2) ** 2
            slope = np.column_stack(
                [normals, normals[:, 1] * turned[:, 0] - normals[:, 0] * turned[:, 1]]
            )
            # In the frame of the pose, as the prior is.
            own = np.eye(3)
            own[:2, :2] = [[cos, -sin], [sin, cos]]
            slope = slope @ own
            weighted = slope * (weight / p.noise**2)[:, None]
            information = slope.T @ weighted
            back = own.T @ (estimate - guess)
            back[2] = angle_between(guess[2], float(estimate[2]))
            change = np.linalg.solve(
                information + held + 1e-6 * np.eye(3), -(weighted.T @ error + held @ back)
            )
            change = np.clip(change, -0.1, 0.1)
            estimate += own @ change
            if number >= _WIDE and np.abs(change).max() < 1e-4:
                break
        x, y, yaw = estimate.tolist()
        return (x, y, math.remainder(yaw, math.tau)), information / _SHARED + held

    def _agreement(self, few: Surface, pose: Pose) -> float:
        placed = few.moved(pose)
        away, nearest = self._nearest(placed)
        near = np.isfinite(away)
        at = nearest[near]
        off = ((placed.points[near] - self._seen.points[at]) * self._seen.normals[at]).sum(axis=1)
        return float((np.abs(off) <= self._p.agree).sum()) / len(placed.points)

    def contradiction(self, scan: Scan, pose: Pose) -> float:
        """Return the part of the lines in view that the scan's rays go through, 0 to 1."""
        x, y, yaw = composed(pose, scan.mount)
        offset = self._seen.points - (x, y)
        distance = np.hypot(*offset.T)
        bearing = np.remainder(np.arctan2(offset[:, 1], offset[:, 0]) - yaw + math.pi, math.tau)
        angles = np.remainder(scan.angles + math.pi, math.tau)
        order = np.argsort(angles)
        sorted_angles = angles[order]
        place = np.clip(np.searchsorted(sorted_angles, bearing), 0, len(order) - 1)
        ray = order[place]
        in_view = np.abs(sorted_angles[place] - bearing) < 0.03
        ranges = np.minimum(scan.ranges, scan.range_max)
        # Both rays beside a line must go on behind it: an edge is seen past on one side.
        other = order[place - 1]
        seen = np.fmin(ranges[ray], ranges[other])
        counted = (
            in_view
            & (distance < scan.range_max)
            & np.isfinite(seen)
            & (seen > distance - self._p.through)
        )
        if not counted.any():
            return 0.0
        return float((seen[counted] > distance[counted] + self._p.through).mean())
