"""Lines along which a building may be cut into rooms: candidates, and which of them go on.

A line is a cut from one obstacle to another through free cells. Three kinds are looked for: where
the face of a wall goes on straight beyond its end until it meets something; between the ends of two
walls that face each other side by side, as partitions do; and across the narrowest part of a
passage, where the clearance has a saddle between two wider parts (the critical lines of Thrun,
"Learning metric-topological maps for indoor mobile robot navigation", 1998). Directions come from
the outlines of what stands there, so that no building needs to stand along an axis.

Lengths in here are cells of 0.05 m (`segmentation.CELL`), points are column, row.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]

LONGEST = 50.0
"""Longest cut that follows a wall's direction; a wider opening is no door."""
_TOLERANCE = 1.6
"""How far an outline may run beside its straight edges."""
_SHORTEST_EDGE = 6.0
"""Edges that are shorter have no direction that could be trusted."""
_SHORTEST = 5.0
_SAME = 7.0
"""Two cuts whose ends are as near as this are one: the two faces of a wall."""
_BESIDE = (6.0, 10.0)
"""So far beside a cut it is looked how wide the floor is there."""
_ROUNDS = (
    *((0.85, 2.2, 0.9), (0.85, 2.2, 0.8), (0.85, 2.2, 0.72)),
    *((0.0, math.inf, level) for level in (0.9, 0.85, 0.8, 0.75, 0.72)),
)
"""Which cuts end the look to the side (their length as shares of the own one), and from which share
of the width on a cut is none. First those of about the own length end it, then all.
"""
_NARROWING_AT_SADDLE = 0.92


@dataclass(frozen=True, eq=False)
class Cut:
    """A line from obstacle to obstacle.

    Attributes:
        start: Column and row.
        end: The same.
        length: Of the opening, cells.
        narrow: Whether it crosses the narrowest part of a passage.
    """

    start: Floats
    end: Floats
    length: float
    narrow: bool = False


def wall_cuts(free: Mask, solid: Mask, furniture: Mask) -> list[Cut]:
    """Return the cuts that walls suggest.

    Args:
        free: Cells in which nothing stands, shape (rows, columns).
        solid: Cells in which something stands; others are unknown, and where the floor ends there
            it ends at no wall.
        furniture: Cells of what stands there and is no wall: no such cut begins or ends at it.
    """
    beside = cv2.dilate(furniture.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    points, directions = _edge_ends(free, solid)
    if not len(points):
        return []
    found = [*_continued(free, points, directions), *_facing(free, points, directions)]
    ends = np.array([(cut.start, cut.end) for cut in found]).reshape(-1, 2, 2)
    cells = np.clip(np.rint(ends).astype(int), 0, np.array(free.shape[::-1]) - 1)
    at_furniture = beside[cells[..., 1], cells[..., 0]].any(axis=1)
    return [cut for cut, drop in zip(found, at_furniture.tolist(), strict=True) if not drop]


def _edge_ends(free: Mask, solid: Mask) -> tuple[Floats, Floats]:
    """Return the ends of the outlines' edges (n, 2), and the directions out of them (n, 2)."""
    rows, columns = free.shape
    by_wall = cv2.dilate(solid.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    outlines = cv2.findContours(free.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)[0]
    points: list[Floats] = []
    directions: list[Floats] = []
    for outline in outlines:
        if len(outline) < _SHORTEST_EDGE:
            continue
        corners = cv2.approxPolyDP(outline, _TOLERANCE, True).reshape(-1, 2).astype(float)
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(*edges.T)
        long = lengths >= _SHORTEST_EDGE
        middle = np.rint(corners + edges / 2).astype(int)
        middle = np.clip(middle, 0, (columns - 1, rows - 1))
        long &= by_wall[middle[:, 1], middle[:, 0]]
        along = edges[long] / lengths[long, None]
        points += [np.roll(corners, -1, axis=0)[long], corners[long]]
        directions += [along, -along]
    if not points:
        return np.zeros((0, 2)), np.zeros((0, 2))
    return np.vstack(points), np.vstack(directions)


def _continued(free: Mask, points: Floats, directions: Floats) -> Iterable[Cut]:
    """Yield the way from each end straight on until it meets something, or runs along a wall."""
    rows, columns = free.shape
    steps = np.arange(0, LONGEST + 1, 0.5)
    column = np.rint(points[:, :1] + directions[:, :1] * steps).astype(int)
    row = np.rint(points[:, 1:] + directions[:, 1:] * steps).astype(int)
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    roomy = cv2.erode(free.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    is_free, is_roomy = np.zeros_like(inside), np.zeros_like(inside)
    is_free[inside] = free[row[inside], column[inside]]
    is_roomy[inside] = roomy[row[inside], column[inside]]
    # Beside its own wall, a way is not roomy at first.
    stops = ~is_free | (~is_roomy & (steps >= 8))
    reached = np.argmax(stops, axis=1)
    for index in np.flatnonzero(stops.any(axis=1)):
        length = float(steps[reached[index]])
        if length < _SHORTEST:
            continue
        end = points[index] + directions[index] * length
        touched = _obstacle_beside(free, end)
        if touched is not None:
            yield Cut(points[index], touched, length)


def _obstacle_beside(free: Mask, point: Floats) -> Floats | None:
    """Return the cell with an obstacle that is nearest to a point, None where none is near."""
    column, row = (int(each) for each in np.rint(point))
    top, left = max(0, row - 2), max(0, column - 2)
    found = np.argwhere(~free[top : row + 3, left : column + 3])
    if not len(found):
        return None
    cells = found[:, ::-1] + (left, top)
    nearest: Floats = cells[np.argmin(np.hypot(*(cells - point).T))].astype(float)
    return nearest


def _facing(free: Mask, points: Floats, directions: Floats) -> Iterable[Cut]:
    """Yield the lines between walls that end side by side, as those between boxes do."""
    rows, columns = free.shape
    ahead = np.rint(points[:, None] + directions[:, None] * np.arange(2, 6)[:, None]).astype(int)
    inside = ((ahead >= 0) & (ahead < (columns, rows))).all(axis=2)
    ahead = np.clip(ahead, 0, (columns - 1, rows - 1))
    ends = (inside & free[ahead[..., 1], ahead[..., 0]]).all(axis=1)
    points, directions = points[ends], directions[ends]
    if len(points) < 2:
        return
    from scipy.spatial import cKDTree  # takes 0.2 s: most only show a place

    pairs = cKDTree(points).query_pairs(LONGEST, output_type='ndarray')
    across = points[pairs[:, 1]] - points[pairs[:, 0]]
    lengths = np.hypot(*across.T)
    keep = lengths >= _SHORTEST_EDGE
    pairs, lengths = pairs[keep], lengths[keep]
    across = across[keep] / lengths[:, None]
    first, second = directions[pairs[:, 0]], directions[pairs[:, 1]]
    level = (np.abs((across * first).sum(1)) < 0.2) & (np.abs((across * second).sum(1)) < 0.2)
    level &= (first * second).sum(1) > 0.8
    for (begin, end), along, length in zip(
        points[pairs[level]], across[level], lengths[level], strict=True
    ):
        steps = np.arange(2.0, length - 1, 0.5)[:, None]
        cells = np.rint(begin + along * steps).astype(int)
        if free[cells[:, 1], cells[:, 0]].all():
            yield Cut(begin - 2 * along, end + 2 * along, float(length))


def saddle_cuts(free: Mask, saddles: Iterable[tuple[int, int, float]]) -> list[Cut]:
    """Return the cuts across the narrowest parts of passages.

    Args:
        free: Cells in which nothing stands.
        saddles: Row, column and clearance in cells.
    """
    found = []
    for row, column, clearance in saddles:
        reach = math.ceil(1.6 * clearance + 3)
        top, left = max(0, row - reach), max(0, column - reach)
        cells = np.argwhere(~free[top : row + reach + 1, left : column + reach + 1])[:, ::-1]
        if len(cells) < 2:
            continue
        away = cells + np.array((left - column, top - row))
        distance = np.hypot(*away.T)
        first = int(np.argmin(distance))
        opposite = away @ away[first] < -0.5 * distance * distance[first]
        if not opposite.any():
            continue
        second = int(np.argmin(np.where(opposite, distance, np.inf)))
        middle = np.array((column, row), float)
        start, end = middle + away[first], middle + away[second]
        found.append(Cut(start, end, float(math.dist(start, end)), narrow=True))
    return found


def without_doubles(cuts: Sequence[Cut]) -> list[Cut]:
    """Return the cuts without those whose ends lie at those of a shorter one."""
    ordered = sorted(cuts, key=lambda cut: cut.length)
    if not ordered:
        return []
    from scipy.spatial import cKDTree  # see above

    count = len(ordered)
    forth = np.array([(*cut.start, *cut.end) for cut in ordered])
    ends = np.vstack([forth, forth[:, [2, 3, 0, 1]]])
    tree, dropped = cKDTree(ends), np.zeros(count, np.bool_)
    for index in range(count):
        if dropped[index]:
            continue
        near = np.array(tree.query_ball_point(ends[index], 1.42 * _SAME))
        gaps = np.hypot(*(ends[near] - ends[index]).reshape(-1, 2, 2).transpose(2, 0, 1))
        others = near[(gaps <= _SAME).all(axis=1)] % count
        dropped[others[others > index]] = True
    return [cut for cut, drop in zip(ordered, dropped, strict=True) if not drop]


def narrowing(cuts: Sequence[Cut], free: Mask) -> list[Cut]:
    """Return the cuts at which the floor narrows, and not only goes on.

    Beside a cut, on both sides, it is measured how wide the floor is in the cut's direction, up to
    obstacles and other cuts. Where the cut is about as wide on both sides, it crosses a corridor
    or a room somewhere in the middle.
    """
    left = list(cuts)
    for shortest, longest, level in _ROUNDS:
        if not left:
            break
        lengths = _lengths(left, free)
        shares = _shares(left, lengths, shortest, longest)
        left = [
            cut
            for cut, share in zip(left, shares, strict=True)
            if share < (max(level, _NARROWING_AT_SADDLE) if cut.narrow else level)
        ]
    return left


def _lengths(cuts: Sequence[Cut], free: Mask) -> NDArray[np.float32]:
    """Return for each cell the length of the longest cut through it; infinite in obstacles."""
    drawn = np.zeros(free.shape, np.float32)
    for cut in sorted(cuts, key=lambda each: each.length):
        ends = [tuple(int(each) for each in np.rint(end)) for end in (cut.start, cut.end)]
        cv2.line(drawn, ends[0], ends[1], cut.length, 2)
    drawn[~free] = np.inf
    return drawn


def _shares(
    cuts: Sequence[Cut], lengths: NDArray[np.float32], shortest: float, longest: float
) -> Floats:
    """Return for each cut its length as a share of the wider floor beside it, shape (n,)."""
    rows, columns = lengths.shape
    begin = np.array([cut.start for cut in cuts])
    end = np.array([cut.end for cut in cuts])
    own = np.array([cut.length for cut in cuts])
    along = (end - begin) / np.maximum(np.hypot(*(end - begin).T), 1e-6)[:, None]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    steps = np.arange(0.0, 2 * LONGEST, 0.5)
    low, high = np.maximum(shortest * own, 0.1)[:, None], (longest * own)[:, None]

    def ends_at(points: Floats) -> Mask:
        cells = np.rint(points).astype(int)
        column, row = cells[..., 0], cells[..., 1]
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        value = np.full(inside.shape, np.inf, np.float32)
        value[inside] = lengths[row[inside], column[inside]]
        return np.asarray((value >= low) & ((value < high) | np.isinf(value)))

    narrowest = np.full(len(cuts), np.inf)
    for side in (1.0, -1.0):
        widest = np.zeros(len(cuts))
        for away in _BESIDE:
            middle = (begin + end) / 2 + side * away * across
            open_here = ~ends_at(middle[:, None])[:, 0]
            width = np.zeros(len(cuts))
            for direction in (along, -along):
                blocked = ends_at(middle[:, None] + direction[:, None] * steps[:, None])
                width += np.where(
                    blocked.any(axis=1), steps[np.argmax(blocked, axis=1)], 2 * LONGEST
                )
            widest = np.maximum(widest, np.where(open_here, width, 0.0))
        share = np.where(widest > 0, own / np.maximum(widest, 1e-9), 1.0)
        narrowest = np.minimum(narrowest, share)
    return narrowest


def drawn(cuts: Iterable[Cut], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Return cuts as lines without gaps: in each of their cells the part of the length, else 0."""
    weights = np.zeros(shape, np.float32)
    for cut in sorted(cuts, key=lambda each: -each.length):
        most = max(float(np.abs(cut.end - cut.start).max()), 1.0)
        share = np.linspace(0.0, 1.0, 2 * math.ceil(most) + 1)[:, None]
        cells = np.rint(cut.start + (cut.end - cut.start) * share).astype(int)
        inside = ((cells >= 0) & (cells < (shape[1], shape[0]))).all(axis=1)
        cells = cells[inside]
        weights[cells[:, 1], cells[:, 0]] = cut.length / (most + 1)
    return weights
