"""What a lidar saw of a floor during one visit, and what differs from before.

Each visit leaves three sets of cells: where beams ended, where they passed, and where both happened
at different times, which is what moves. What stood in no visit before and is no wall of the map has
appeared; what stood there and is passed through by beams now has gone. A thing that has gone here
and appeared near there in the same visit, of like size, has moved. What was not in view this time
is neither: it was not seen.

The grid is an occupancy grid of counts (Thrun, Burgard and Fox, Probabilistic Robotics, chapter 9),
kept for each visit alone, so that an old look never outvotes a new one.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_ENDS = 2
"""Beams that end in a cell that is taken for occupied: one may be a stray."""
LEAST_PASSES = 2
"""Beams that pass a cell that is taken for free."""
NEAR_WALL = 0.12
"""Ends so near to a wall of the map are the wall's, metres: noise and the error of the pose."""
YAW_SLACK = 0.025
"""An error of the heading moves an end by this times its distance, rad: 2.5 times the 0.6 degrees
that a localised robot is off. It has nothing to do with what `NEAR_WALL` allows for: as errors that
do not depend on each other do, their squares add up."""
DOUBTED = 2.5
"""An end is the wall's within so many standard deviations of what is left of the pose's doubt."""
NEAR_THING = 0.15
"""A thing so near to where one stood before is the same one, metres."""
LEAST_EXTENT = 0.08
"""A smaller cluster is no thing, metres."""
SAME_SIZE = 1.6
"""Extents of a thing that moved may differ by this factor: it is seen from another side."""
ROAMS = 3.0
"""A thing that was moved is so far from where it stood at most, metres: across a room of an
office. Farther away one has gone, and another has come."""
LEAF_SLACK = 0.13
"""How far from the line of a door's leaf its cells may lie, metres: a cell, noise, its depth."""
FAR_FROM_WALL, NEAR_END, PASSED_BEFORE = 0.25, 0.1, 3
"""Where all was free: so far from walls and from what is met there, metres; passed so often."""
HEADING_OFF = 0.035
"""And so many rad, where that is more: a heading is off by 2 degrees at times."""
LEAVES = 0.5
"""What is met at a spot longer ago than this is there still, or has left it, seconds."""
MOST_MET = 0.15
"""A spot is free again when something was met there in this part of the sweeps that passed it, at
most: the leg of a chair, which thin beams miss now and then, is met in more."""
_WITH_CORNERS = np.ones((3, 3), np.bool_)
_NEIGHBOURS = _WITH_CORNERS.view(np.uint8)


class Change(StrEnum):
    """What became of a thing."""

    APPEARED = 'appeared'
    REMOVED = 'removed'
    MOVED = 'moved'


@dataclass(frozen=True)
class ObjectChange:
    """A thing that is new, gone, or elsewhere.

    Attributes:
        change: What became of it.
        position: Its middle, map frame, metres; of one that moved, where it is now.
        extent: Its longer side as far as seen, metres.
        before: Where it stood before, of one that moved.
        confidence: 0 to 1, from how many cells say so.
        points: The middles of its cells as far as seen, (n, 2), map frame, metres.
    """

    change: Change
    position: tuple[float, float]
    extent: float
    confidence: float
    before: tuple[float, float] | None = None
    points: Points = field(default_factory=lambda: np.zeros((0, 2)), compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class FloorView:
    """What one visit saw.

    Attributes:
        grid: The map, whose cells these are.
        occupied: Where something stood that is no wall of the map.
        free: Where beams passed and none ended.
        moving: Where beams passed and ended at different times.
    """

    grid: Grid
    occupied: Mask
    free: Mask
    moving: Mask

    @property
    def seen(self) -> Mask:
        """Every cell of which something is known."""
        return np.asarray(self.occupied | self.free | self.moving)


class FloorVisit:
    """Gathers the sweeps of one visit.

    Args:
        grid: The map.
        farthest: Beams are followed so far, metres; farther away they are too far apart.
    """

    def __init__(self, grid: Grid, farthest: float = 8.0) -> None:
        self._grid = grid
        self._farthest = farthest
        shape = grid.cells.shape
        # A robot may stand at its dock for days: ten sweeps a second fill 16 bits in two hours.
        self._ends = np.zeros(shape, np.uint32)
        # Where beams ended at all, also at what may be a wall.
        self._met = np.zeros(shape, np.bool_)
        self._passes = np.zeros(shape, np.uint32)
        # Sweeps that met something near a cell, longer ago than `LEAVES`; and the later ones.
        self._met_near = np.zeros(shape, np.uint32)
        self._lately: deque[tuple[float, Mask]] = deque()
        self._walls = distance_to(grid.occupied, grid.resolution)
        self.sweeps = 0

    def add(
        self,
        sensor: tuple[float, float],
        ends: Points,
        met: Mask,
        stamp: float,
        doubt: Points | None = None,
    ) -> None:
        """Take one sweep.

        Args:
            sensor: Where the lidar was, map frame, metres.
            ends: Where beams ended, (n, 2), same frame.
            met: Whether something was met there, (n,); False for a beam at its greatest range.
            stamp: Seconds.
            doubt: By what each end may be off across what it met, (n,), metres; None: 0.
        """
        self.sweeps += 1
        origin = np.asarray(sensor, float)
        rays = ends - origin
        lengths = np.linalg.norm(rays, axis=1)
        good = np.isfinite(lengths) & (lengths > 1e-3)
        rays, lengths, met = rays[good] / lengths[good, None], lengths[good], met[good]
        doubt = None if doubt is None else doubt[good]
        ended = met & (lengths <= self._farthest)
        hits = origin + rays[ended] * lengths[ended, None]
        hit = self._cells(hits)
        off = None if doubt is None else doubt[ended]
        of_things = self._cells(hits[~self.of_wall(hits, lengths[ended], off)])
        # Every half cell along each beam, up to a cell and a half before its end.
        side = self._grid.resolution
        until = np.minimum(lengths, self._farthest) - np.where(ended, 1.5 * side, 0.0)
        counts = np.maximum(np.ceil(until / (side / 2)).astype(np.intp) - 1, 0)
        firsts = np.cumsum(counts) - counts
        steps = np.arange(1, counts.sum() + 1) - np.repeat(firsts, counts)
        # In cells, and coordinate by coordinate: a sweep has some ten thousand of these points.
        begin = (origin - self._grid.origin) / side
        columns, rows = (
            begin[axis] + np.repeat(rays[:, axis] / 2, counts) * steps for axis in (0, 1)
        )
        passed = self._marked(rows, columns)
        passed[hit] = False
        self._passes += passed
        self._ends += of_things
        self._met |= hit
        reach = max(1, round(NEAR_END / self._grid.resolution))
        around = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
        self._lately.append((stamp, cv2.dilate(hit.astype(np.uint8), around).astype(np.bool_)))
        # Later than now: the clock was set back, and what was met before counts as met long ago.
        while not 0.0 <= stamp - self._lately[0][0] <= LEAVES:
            self._met_near += self._lately.popleft()[1]

    def of_wall(self, hits: Points, lengths: Points, doubt: Points | None = None) -> Mask:
        """Tell of each end whether a wall of the map may be what was met.

        Args:
            hits: The ends, (n, 2), map frame, metres.
            lengths: How far from the lidar they are, (n,), metres.
            doubt: By what each may be off across what it met, (n,), metres; None: 0.
        """
        cells = self._grid.cells_of(hits)
        height, width = self._grid.cells.shape
        rows, columns = np.clip(cells[:, 0], 0, height - 1), np.clip(cells[:, 1], 0, width - 1)
        slack = np.hypot(NEAR_WALL, YAW_SLACK * lengths)
        if doubt is not None:
            slack = np.hypot(slack, DOUBTED * doubt)
        return np.asarray(self._walls[rows, columns] <= slack, np.bool_)

    def fresh(self, sensor: tuple[float, float], points: Points) -> Mask:
        """Tell of each point whether all was free there until now, as far as this visit knows.

        Where somebody went is free again after them. What was met there within `LEAVES` may be who
        is met there now.

        Args:
            sensor: Where the lidar was, map frame, metres.
            points: (n, 2), same frame.
        """
        cells = self._grid.cells_of(points)
        height, width = self._grid.cells.shape
        at = np.clip(cells[:, 0], 0, height - 1), np.clip(cells[:, 1], 0, width - 1)
        slack = HEADING_OFF * np.linalg.norm(points - np.asarray(sensor, float), axis=1)
        free = np.asarray(
            self._grid.contains(cells)
            & (self._walls[at] > np.maximum(FAR_FROM_WALL, slack))
            & (self._passes[at] >= PASSED_BEFORE),
            np.bool_,
        )
        kept = np.flatnonzero(free)
        if len(kept):
            # Cells about each point, (kept, cells), as far as an error of the heading may move it.
            reach = math.ceil(float(slack[kept].max()) / self._grid.resolution)
            down, right = (each.ravel() for each in np.indices((2 * reach + 1,) * 2) - reach)
            rows = np.clip(at[0][kept, None] + down, 0, height - 1)
            columns = np.clip(at[1][kept, None] + right, 0, width - 1)
            near = np.hypot(down, right) * self._grid.resolution <= slack[kept, None]
            passes, ends = self._passes[rows, columns], self._met_near[rows, columns]
            free[kept] = ~(near & (ends > MOST_MET * passes)).any(axis=1)
        return free

    def view(self) -> FloorView:
        """Return what was seen so far."""
        no_wall = self._walls > NEAR_WALL
        often = self._ends >= min(LEAST_ENDS, max(1, self.sweeps))
        # A cell at a thing's edge is passed by some beams of every sweep; a moving thing leaves.
        stays = self._ends >= 0.3 * (self._ends + self._passes)
        occupied = no_wall & often & stays
        moving = no_wall & (self._ends >= 1) & ~occupied & (self._passes > 3 * self._ends)
        free = (self._passes >= LEAST_PASSES) & ~self._met
        return FloorView(self._grid, occupied, free, moving)

    def _cells(self, points: Points) -> Mask:
        """Return which cells hold points."""
        columns_rows = (points - np.asarray(self._grid.origin)) / self._grid.resolution
        return self._marked(columns_rows[:, 1], columns_rows[:, 0])

    def _marked(self, rows: NDArray[np.float64], columns: NDArray[np.float64]) -> Mask:
        """Return which cells hold points, whose coordinates are in cells."""
        height, width = self._grid.cells.shape
        good = (rows >= 0) & (columns >= 0) & (rows < height) & (columns < width)
        inside = np.zeros((height, width), np.bool_)
        inside[rows[good].astype(np.intp), columns[good].astype(np.intp)] = True
        return inside


def changes(before: FloorView, now: FloorView) -> list[ObjectChange]:
    """Return what differs between two visits, the largest first.

    Args:
        before: What is normal: what one visit saw, or what a person has called normal.
        now: What was seen now.
    """
    grid = now.grid
    stood = distance_to(before.occupied, grid.resolution) <= NEAR_THING
    stands = distance_to(now.occupied, grid.resolution) <= NEAR_THING
    # It must have been seen free before: of what was never in view nobody knows.
    known_free = _grown(before.free)
    new = _things(grid, now.occupied & ~stood, known_free)
    # Passed through itself: beside a thing that is seen from another side now the floor is free.
    gone = _things(grid, before.occupied & ~stands, now.free)
    pairs = _pairs(gone, new)
    found = [
        replace(
            _changed(Change.MOVED, to),
            confidence=min(thing.confidence, to.confidence),
            before=thing.position,
        )
        for thing, to in pairs
    ]
    found += [
        _changed(Change.REMOVED, each) for each in gone if all(each is not a for a, _ in pairs)
    ]
    new = [each for each in new if all(each is not b for _, b in pairs)]
    found += [_changed(Change.APPEARED, each) for each in new]
    return sorted(found, key=lambda each: -each.extent)


def unmapped(view: FloorView, cells: Mask) -> list[ObjectChange]:
    """Return the things that a visit saw and the map does not show, the largest first.

    Args:
        view: What it saw.
        cells: Of its occupied cells those that are asked for.
    """
    found = _things(view.grid, cells, np.ones_like(cells))
    things = [_changed(Change.APPEARED, each) for each in found]
    return sorted(things, key=lambda each: -each.extent)


def is_leaf(points: Points, hinge: tuple[float, float], width: float) -> bool:
    """Tell whether a thing may be the leaf of a door, that swings about its hinge.

    Args:
        points: What was seen of the thing, (n, 2), metres.
        hinge: One of the door's jambs, metres.
        width: Of the leaf, metres.
    """
    if not len(points):
        return False
    offsets = np.asarray(points, float) - np.asarray(hinge, float)
    distances = np.linalg.norm(offsets, axis=1)
    if distances.max() > width + LEAF_SLACK:
        return False
    # A leaf is a line from its hinge outwards, as deep as a cell or two.
    tip = offsets[int(distances.argmax())] / max(float(distances.max()), 1e-9)
    beside = np.abs(offsets[:, 0] * tip[1] - offsets[:, 1] * tip[0])
    return bool(beside.max() <= LEAF_SLACK)


@dataclass(frozen=True)
class _Thing:
    position: tuple[float, float]
    extent: float
    confidence: float
    points: Points = field(compare=False)


def _changed(change: Change, thing: _Thing) -> ObjectChange:
    return ObjectChange(change, thing.position, thing.extent, thing.confidence, points=thing.points)


def _pairs(gone: Sequence[_Thing], new: Sequence[_Thing]) -> list[tuple[_Thing, _Thing]]:
    """Return what went and came elsewhere: as many as may be, over the least distance in all."""
    costs = np.array([[_way(one, to) for to in new] for one in gone]).reshape(len(gone), len(new))
    # One pair more is worth any distance.
    most = ROAMS * (1 + min(costs.shape))
    rows, columns = (each.tolist() for each in linear_sum_assignment(np.minimum(costs, most)))
    return [
        (gone[at], new[to]) for at, to in zip(rows, columns, strict=True) if costs[at, to] < most
    ]


def _way(one: _Thing, other: _Thing) -> float:
    """Return how far one thing would have moved to be another, metres; inf: it cannot be."""
    away = math.dist(one.position, other.position)
    return away if away <= ROAMS and _alike(one, other) else math.inf


def _alike(one: _Thing, other: _Thing) -> bool:
    longer, shorter = sorted((one.extent, other.extent), reverse=True)
    return longer <= SAME_SIZE * shorter + 0.1


def _grown(cells: Mask) -> Mask:
    """Return cells and their eight neighbours."""
    return cv2.dilate(cells.view(np.uint8), _NEIGHBOURS).astype(np.bool_)


def _things(grid: Grid, cells: Mask, decided: Mask) -> list[_Thing]:
    """Return clusters of cells, of which most were looked at in the other visit, too."""
    joined = _grown(_grown(cells))
    labels, count = ndimage.label(joined, _WITH_CORNERS)
    labels[~cells] = 0
    found = []
    for number, box in enumerate(ndimage.find_objects(labels, count), 1):
        if box is None:
            continue
        inside = labels[box] == number
        rows, columns = np.nonzero(inside)
        extent = grid.resolution * float(max(np.ptp(rows) + 1, np.ptp(columns) + 1))
        share = float(decided[box][inside].mean())
        if extent < max(LEAST_EXTENT, 1.5 * grid.resolution) or len(rows) < 2 or share < 0.5:
            continue
        bottom, left = (int(part.start) for part in box)
        middle = grid.centre_of(
            round(float(rows.mean())) + bottom, round(float(columns.mean())) + left
        )
        sure = share * (1.0 - math.exp(-len(rows) / 3.0))
        points = np.array(
            [
                grid.centre_of(row + bottom, column + left)
                for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
            ]
        )
        found.append(_Thing(middle, float(extent), sure, points))
    return found
