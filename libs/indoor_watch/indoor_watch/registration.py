"""Registers each sweep to the place before anything is compared with it.

A localised robot is off by centimetres and by a fraction of a degree, mostly by the same for a
whole visit: errors do not average out, and at six metres one degree is ten centimetres. So each
sweep is moved onto what is known to stand there: the walls of the map, and what the visits before
have seen.

In the first sweep of a visit the best of a grid of corrections is taken (correlative scan matching:
Olson, "Real-Time Correlative Scan Matching", ICRA 2009), which no wrong side of a thin wall
misleads. From there on Gauss-Newton follows the signed distance to what stands there (a likelihood
field: Thrun, Burgard and Fox, Probabilistic Robotics, chapter 6.4), with Cauchy weights, so that
what is new does not pull. What the localisation says is the prior: along a bare corridor nothing
else holds the sweep, and what is left of the doubt there goes with the sweep, into the slack of
whoever compares. A camera on the robot has the same error, and is placed by the same correction:
so are the markers that it reads, and the persons that it finds. Whole views need none of it: they
are registered to each other in the picture (`views`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from floor_plans.occupancy_grid import Grid, distance_to
from indoor_watch.floor import FloorView
from indoor_watch.hung_markers import CameraView
from indoor_watch.visit import LidarSweep

Array = NDArray[np.float64]

DOUBT = (0.10, 0.035)
"""Standard deviation of a localisation's pose at least, metres and rad: its own 95 % are 0.10 to
0.14 m (benchmarks/navigation.py), and some tell less than they should."""
JITTER = (0.03, 0.015)
"""What the correction may change from one sweep to the next, metres and rad."""
NOISE = 0.05
"""Of an end from the surface that it met, metres: the lidar's noise and the map's cells."""
INDEPENDENT = 9.0
"""Neighbouring beams share the errors of the map: so many count as one."""
REACH = 0.3
"""An end farther from what stands there tells nothing of the pose, metres: it is a thing, or
people."""
LEAST_ENDS = 20
"""With fewer there is nothing to register by."""
LEFT = (0.01, 0.003)
"""So sure is no registration, metres and rad: half a map's cell, and that over its range."""
AROUND = 9.0
"""What stands so far from the lidar is compared, metres."""
FIELD_VALID = 2.0
"""The field is drawn anew when the lidar is so far from where it was drawn, metres."""
SEARCHED = 2.0
"""The grid of corrections goes to so many standard deviations."""
STEPS = (7, 13)
"""Of that grid, in each direction and in the heading: 7 cm and 0.7 degrees."""
SEARCH_BEAMS = 120
"""Of a sweep, for the grid: every third of 360, three degrees apart, which is less than a wall."""
ITERATIONS = 6
"""At most: a step below 0.1 mm and 0.1 mrad ends it sooner."""
CAMERA_AFTER = 2.0
"""A picture so long after a sweep, or before it, was taken with the same error, seconds: from one
sweep to the next that changes by `JITTER` at most, and a lidar turns twice a second or more."""


class Correction(NamedTuple):
    """By what a sweep was off.

    Attributes:
        x, y: To be added to where the lidar was, map frame, metres.
        yaw: To be added to the beams' directions, rad.
        covariance: Of these three that is left, (3, 3).
    """

    x: float
    y: float
    yaw: float
    covariance: Array


class _Field(NamedTuple):
    """Distances to what stands around a point, on cells.

    Attributes:
        centre: The point, metres.
        origin: Of the first cell, metres.
        resolution: Side of a cell, metres.
        distance: To the nearest surface, negative within what stands there, metres.
        slope: Its gradient along x and y, (2, rows, columns).
    """

    centre: Array
    origin: Array
    resolution: float
    distance: Array
    slope: Array

    def at(self, points: Array) -> tuple[Array, Array]:
        """Return distance (n,) and gradient (2, n) at points (n, 2); far away off the field."""
        columns, rows = ((points - self.origin) / self.resolution - 0.5).T
        at = np.stack([rows, columns])
        away = ndimage.map_coordinates(self.distance, at, order=1, cval=AROUND)
        slope = [ndimage.map_coordinates(each, at, order=1) for each in self.slope]
        return np.asarray(away), np.asarray(slope)


class Registration:
    """Registers the sweeps of visits; owned by whoever calls it, one thread."""

    def __init__(self) -> None:
        self._field: _Field | None = None
        self._last: Correction | None = None
        # Where the lidar was at the last correction, as the localisation said, and when.
        self._origin, self._stamp = np.zeros(2), -np.inf

    def begin(self) -> None:
        """Take that a visit begins: its pose is off by something else, and more is known."""
        self._field, self._last = None, None

    def registered(
        self,
        sweep: LidarSweep,
        grid: Grid,
        normal: FloorView | None,
        doubt: tuple[float, float] | None = None,
    ) -> LidarSweep:
        """Return a sweep where it fits, with what is left of its doubt.

        Args:
            sweep: As the localisation says.
            grid: The map.
            normal: What stands there besides; None: that is not known.
            doubt: Standard deviations of the pose as the localisation says, metres and rad.
        """
        told = doubt or DOUBT
        deviation, turn = max(told[0], DOUBT[0]), max(told[1], DOUBT[1])
        origin = np.asarray(sweep.sensor, float)
        field = self._field_at(origin, grid, normal)
        away = np.linalg.norm(sweep.points - origin, axis=1)
        rays = (sweep.points - origin)[(away < AROUND) & (away > 0.05)]
        found = self._correction(field, origin, rays, deviation, turn)
        if self._last is not None:
            self._origin, self._stamp = origin, sweep.stamp
        there, ends = moved(found, origin, sweep.ends)
        return sweep._replace(
            sensor=(float(there[0]), float(there[1])),
            ends=ends,
            doubt=_doubt_of(found, field, there, ends),
        )

    def placed(self, camera: CameraView, stamp: float) -> CameraView:
        """Return a camera where it is by the last sweep, with the doubt that it has.

        Localisation tells lidar and camera with one error. How the robot's joints turn the camera
        is in the doubt, which is not made less.

        Args:
            camera: As the localisation says.
            stamp: Of the picture, seconds since 1970.
        """
        found = self._last
        if found is None or abs(stamp - self._stamp) > CAMERA_AFTER:
            return camera
        pose = camera.pose.copy()
        pose[:2, :3] = _turn(found.yaw) @ pose[:2, :3]
        _, pose[:2, 3:] = (each.T for each in moved(found, self._origin, pose[:2, 3:].T))
        return replace(camera, pose=pose)

    def _correction(
        self, field: _Field, origin: Array, rays: Array, deviation: float, turn: float
    ) -> Correction:
        prior = np.diag([deviation**2, deviation**2, turn**2])
        if len(rays) < LEAST_ENDS:
            return Correction(0.0, 0.0, 0.0, prior)
        if self._last is None:
            start = _searched(field, origin, rays, SEARCHED * deviation, SEARCHED * turn)
            self._last = _refined(field, origin, rays, start, np.zeros(3), prior)
        else:
            before = np.array(self._last[:3])
            jitter = np.diag([JITTER[0] ** 2, JITTER[0] ** 2, JITTER[1] ** 2])
            doubt = self._last.covariance + jitter
            self._last = _refined(field, origin, rays, before, before, doubt)
        return self._last

    def _field_at(self, origin: Array, grid: Grid, normal: FloorView | None) -> _Field:
        known = self._field
        if known is None or float(np.hypot(*(known.centre - origin))) > FIELD_VALID:
            self._field = known = _drawn(origin, grid, normal)
        return known


def moved(correction: Correction, sensor: Array, points: Array) -> tuple[Array, Array]:
    """Return where the lidar was, (2,), and where its beams ended, (n, 2), once corrected."""
    there = sensor + np.array([correction.x, correction.y])
    return there, (points - sensor) @ _turn(correction.yaw).T + there


def _turn(yaw: float) -> Array:
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine], [sine, cosine]])


def _doubt_of(correction: Correction, field: _Field, sensor: Array, ends: Array) -> Array:
    """Return by what each end may be off across the surface next to it, (n,), metres."""
    _, normals = field.at(ends)
    arms = ends - sensor
    lever = normals[1] * arms[:, 0] - normals[0] * arms[:, 1]
    slopes = np.stack([normals[0], normals[1], lever], axis=1)
    variance = np.einsum('ni,ij,nj->n', slopes, correction.covariance, slopes)
    return np.asarray(np.sqrt(np.maximum(0.0, variance)))


def _drawn(centre: Array, grid: Grid, normal: FloorView | None) -> _Field:
    """Draw the distances around a point."""
    reach = AROUND + FIELD_VALID
    cells = int(reach / grid.resolution)
    (row, column), (height, width) = grid.cell_of(*centre), grid.cells.shape
    # Also of a pose off the map.
    row, column = min(max(row, 0), height - 1), min(max(column, 0), width - 1)
    top, left = max(0, row - cells), max(0, column - cells)
    part = np.s_[top : row + cells + 1, left : column + cells + 1]
    stands = np.array(grid.occupied[part])
    if normal is not None:
        stands |= normal.occupied[part]
    # From the middle of a cell to the surface of the nearest one of the other sort.
    outside, inside = (distance_to(each, grid.resolution) for each in (stands, ~stands))
    half = grid.resolution / 2
    distance = np.where(stands, half - inside, outside - half).astype(float)
    if stands.all() or not stands.any():
        distance = np.full(stands.shape, AROUND)
    slope = np.gradient(distance, grid.resolution) if min(stands.shape) > 1 else [distance * 0] * 2
    origin = np.asarray(grid.origin[:2]) + np.array([left, top]) * grid.resolution
    return _Field(centre, origin, grid.resolution, distance, np.asarray(slope[::-1]))


def _searched(field: _Field, origin: Array, rays: Array, far: float, turn: float) -> Array:
    """Return the best of a grid of corrections, (3,)."""
    some = rays[:: max(1, len(rays) // SEARCH_BEAMS)]
    shifts = np.linspace(-far, far, STEPS[0])
    across = np.stack([each.ravel() for each in np.meshgrid(shifts, shifts)], axis=1)
    best, found = -1.0, np.zeros(3)
    height, width = field.distance.shape
    for yaw in np.linspace(-turn, turn, STEPS[1]):
        turned = some @ _turn(yaw).T + origin - field.origin
        cells = ((turned[None] + across[:, None]) / field.resolution).astype(np.intp)
        columns, rows = np.clip(cells[..., 0], 0, width - 1), np.clip(cells[..., 1], 0, height - 1)
        away = field.distance[rows, columns]
        score = np.exp(-0.5 * np.square(away / (2 * NOISE))).sum(axis=1)
        # Of two that fit alike, the one that corrects less.
        score -= 0.02 * len(some) * ((across**2).sum(axis=1) / far**2 + (yaw / turn) ** 2)
        index = int(score.argmax())
        if score[index] > best:
            best, found = float(score[index]), np.array([*across[index], yaw])
    return found


def _refined(
    field: _Field, origin: Array, rays: Array, start: Array, mean: Array, covariance: Array
) -> Correction:
    """Return the correction that fits best from a start on, with a prior of it."""
    prior = np.linalg.inv(covariance)
    at, needed = start.copy(), prior
    for _ in range(ITERATIONS):
        turned = rays @ _turn(at[2]).T
        away, slope = field.at(origin + at[:2] + turned)
        near = np.abs(away) < REACH
        if near.sum() < LEAST_ENDS:
            break
        off, normals, arms = away[near], slope[:, near], turned[near]
        lever = normals[1] * arms[:, 0] - normals[0] * arms[:, 1]
        slopes = np.stack([normals[0], normals[1], lever], axis=1)
        weights = 1.0 / (1.0 + np.square(off / NOISE)) / NOISE**2 / INDEPENDENT
        needed = prior + slopes.T @ (weights[:, None] * slopes)
        step = np.linalg.solve(needed, -slopes.T @ (weights * off) - prior @ (at - mean))
        at = at + step
        if np.abs(step).max() < 1e-4:
            break
    left = np.linalg.inv(needed) + np.diag([LEFT[0] ** 2, LEFT[0] ** 2, LEFT[1] ** 2])
    return Correction(float(at[0]), float(at[1]), float(at[2]), left)
