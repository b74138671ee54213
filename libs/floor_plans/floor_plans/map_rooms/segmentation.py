"""Cutting a map into rooms.

What stands free and is small (legs of tables and chairs, plants, bins) is taken away first. Then
the map is cut along every line that walls suggest, and the parts that are no rooms of their own are
joined again (`openings`, `joining`). Floor below furniture and small closed parts, as the inside of
a cupboard, belong to the room beside them.

All works at 0.05 m a cell, to which finer maps are reduced and coarser ones divided, and on
distances, so that neither the resolution nor the direction of a map matters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans.map_rooms import joining, openings
from floor_plans.occupancy_grid import Grid, boxes, distance_to, looked_up, spread, totals

Labels = NDArray[np.int32]
Mask = NDArray[np.bool_]
Line = tuple[tuple[float, float], tuple[float, float]]
"""Two ends, metres."""

CELL = 0.05
"""Side of the cells that rooms are found on, metres."""
SMALLEST_ROOM = 3.0
"""A closed part of the floor with less area is no room of its own, m^2."""
_FURNITURE = 0.9
"""What stands free and is smaller from corner to corner is no wall, metres."""
_WALL = 0.6
"""A strip of unknown cells up to this width is taken for the inside of a wall, metres."""
_THICK = 0.15
"""Half the thickness from which on what stands there may be furniture, metres."""
_BLOCK = 0.45
"""Thickness from which on what is compact is no wall, if it stands at one, metres."""
_ISLAND = 0.25
"""The same of what stands free."""
_TABLE = 1.1
"""What stands free and is shorter may be a column, metres."""
_FILLED = 0.8
"""A block fills so much of the rectangle around it."""
_LONGEST = 3.0
"""Furniture is at most so long, metres."""
_SLENDER = 4.5
"""What is so many times longer than thick is a wall."""
_BENEATH = 0.9
"""Floor that lies deeper below furniture is not given to the room beside it, metres."""
_NARROW = 0.7
"""Clearance in a passage, as a share of that beyond it, below which it is a cut."""
_BEHIND_WALL = 0.08
"""Squares with less clearance may lie on both sides of a wall of one cell, metres."""
_LOWEST, _STEP = 0.15, 1.08
"""Clearances at which the wide parts of the floor are looked for: the lowest, and the ratio."""


@dataclass(frozen=True, eq=False)
class Segmentation:
    """The rooms of a map.

    Attributes:
        labels: The room of each cell of the map, from 1; 0 in none. Shape of the map's cells.
        rooms: How many there are.
        corridors: The numbers of those that are long.
        working: The map that the rooms were found on.
        working_labels: The same as `labels` on that map.
    """

    labels: Labels
    rooms: int
    corridors: frozenset[int]
    working: Grid
    working_labels: Labels

    def joined(self, first: int, second: int) -> Segmentation:
        """Return the rooms with two of them made one, numbered without a gap."""
        return self.all_joined([(first, second)])

    def all_joined(self, pairs: Sequence[tuple[int, int]]) -> Segmentation:
        """Return the rooms with those of each pair made one; the numbers are those of now."""
        areas = totals(self.working_labels, self.rooms + 1)
        into, long = list(range(self.rooms + 1)), set(self.corridors)
        for pair in pairs:
            keeps, goes = sorted(_root(into, each) for each in pair)
            if keeps != goes:
                # Both are what the larger one is.
                larger = keeps if areas[keeps] >= areas[goes] else goes
                long = long - {keeps} | ({keeps} if larger in long else set())
                areas[keeps] += areas[goes]
                into[goes] = keeps
        roots = sorted({_root(into, each) for each in into})
        numbers = np.array([roots.index(_root(into, each)) for each in into], np.int32)
        working_labels = looked_up(numbers, self.working_labels)
        same = self.labels is self.working_labels
        return replace(
            self,
            labels=working_labels if same else looked_up(numbers, self.labels),
            rooms=len(roots) - 1,
            corridors=frozenset(int(numbers[each]) for each in long if into[each] == each),
            working_labels=working_labels,
        )


def _root(into: list[int], each: int) -> int:
    while into[each] != each:
        into[each] = into[into[each]]
        each = into[each]
    return each


def segment(grid: Grid, shut: Sequence[Line] = ()) -> Segmentation:
    """Return the rooms of a map.

    Args:
        grid: The map; row 0 in the south, as ever.
        shut: Lines that are known to part two rooms, as doors on a plan: metres from the corner of
            the map.
    """
    working = _at_working_resolution(grid)
    free = working.free
    known = _drawn(shut, free.shape, grid.cells.shape[1] * grid.resolution / free.shape[1])
    cleared = _without_small_things(free) & ~known
    furniture = _furniture(cleared)
    clearance = distance_to(~cleared, CELL)
    found = openings.wall_cuts(cleared, _walls(working), furniture) + openings.saddle_cuts(
        cleared, _saddles(cleared, clearance)
    )
    kept = openings.narrowing(openings.without_doubles(found), cleared | furniture)
    cuts = openings.drawn(kept, cleared.shape)
    parts = np.asarray(
        cv2.connectedComponents((cleared & (cuts == 0)).astype(np.uint8), connectivity=4)[1],
        dtype=np.int32,
    )
    into = joining.joined(parts, cuts, clearance, CELL)
    # Whatever has been used goes: each such field of a large map takes 64 MB.
    del cuts, kept, found
    labels = spread(looked_up(into, parts, out=parts))
    del parts
    labels[~cleared] = 0
    labels = _with_floor_below_furniture(labels, cleared)
    if known.any():
        np.copyto(labels, spread(labels.copy()), where=known & free & (labels == 0))
    labels = _numbered(labels)
    count = int(labels.max())
    area = totals(labels, count + 1) * CELL**2
    depth = totals(labels, count + 1, clearance) * CELL**2
    corridors = frozenset(
        number
        for number in range(1, count + 1)
        if depth[number] > 0 and joining.elongation(area[number], depth[number]) > joining.LONG
    )
    return Segmentation(_at_resolution_of(labels, grid, working), count, corridors, working, labels)


def _drawn(lines: Sequence[Line], shape: tuple[int, ...], side: float) -> Mask:
    """Return the cells below lines, two wide: no way leads through at their corners."""
    drawn = np.zeros(shape, np.uint8)
    for line in lines:
        (left, low), (right, high) = np.rint(np.array(line) / side - 0.5).astype(int).tolist()
        cv2.line(drawn, (left, low), (right, high), 1, 2)
    return drawn > 0


def _at_working_resolution(grid: Grid) -> Grid:
    factor = CELL / grid.resolution
    if 0.8 < factor < 1.25:
        return Grid(grid.cells, CELL, (0.0, 0.0))
    rows, columns = (max(1, round(size / factor)) for size in grid.cells.shape)
    if factor < 1:
        row = np.minimum((np.arange(rows) * factor).astype(np.intp), grid.cells.shape[0] - 1)
        column = np.minimum((np.arange(columns) * factor).astype(np.intp), grid.cells.shape[1] - 1)
        return Grid(grid.cells[row[:, None], column[None, :]], CELL)
    # A cell is free where most of it is, and not where a thin wall runs through it.
    size = (columns, rows)
    free = cv2.resize(grid.free.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    occupied = cv2.resize(grid.occupied.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    cells = np.full((rows, columns), -1, np.int8)
    cells[free > 0.45] = 0
    cells[occupied >= min(0.45, 0.9 / factor)] = 100
    return Grid(cells, CELL)


def _at_resolution_of(labels: Labels, grid: Grid, working: Grid) -> Labels:
    rows, columns = grid.cells.shape
    if labels.shape == (rows, columns):
        return labels
    up, right = labels.shape[0] / rows, labels.shape[1] / columns
    row = np.minimum(((np.arange(rows) + 0.5) * up).astype(np.intp), labels.shape[0] - 1)
    column = np.minimum(((np.arange(columns) + 0.5) * right).astype(np.intp), labels.shape[1] - 1)
    return np.asarray(labels[row[:, None], column[None, :]])


def _walls(grid: Grid) -> Mask:
    """Return what is occupied, and what is unknown in strips as thin as walls are.

    Where the floor ends at a wider unknown area, nobody has seen a wall.
    """
    unknown = (grid.cells < 0).astype(np.uint8)
    side = 2 * round(_WALL / 2 / CELL) + 1
    square = np.ones((side, side), np.uint8)
    wide = cv2.morphologyEx(
        unknown, cv2.MORPH_OPEN, square, borderType=cv2.BORDER_CONSTANT, borderValue=1
    )
    return np.asarray(grid.occupied | ((unknown > 0) & (wide == 0)))


def _without_small_things(free: Mask) -> Mask:
    _, pieces, stats, _ = cv2.connectedComponentsWithStats((~free).astype(np.uint8), connectivity=8)
    sizes = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * CELL
    small = (sizes < _FURNITURE) & ~_at_edge(stats, free.shape)
    small[0] = False
    return np.asarray(free | looked_up(small, pieces))


def _furniture(free: Mask) -> Mask:
    """Return what stands there and is furniture by its shape: a compact block, thicker than walls.

    It stands free, or at a wall; of that, what is behind it is taken, too.
    """
    side = 2 * round(_BLOCK / 2 / CELL) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    solid = (~free | _closed(free)).astype(np.uint8)
    thick = cv2.morphologyEx(
        solid, cv2.MORPH_OPEN, disc, borderType=cv2.BORDER_CONSTANT, borderValue=1
    )
    found = np.zeros(free.shape, np.bool_)
    for mask, thinnest, shortest in ((thick, _BLOCK, _BLOCK), (solid, _ISLAND, _TABLE)):
        pieces, stats = cv2.connectedComponentsWithStats(mask, connectivity=8)[1:3]
        spans = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * CELL
        small = (spans >= shortest) & (spans < 1.42 * _LONGEST) & ~_at_edge(stats, free.shape)
        small[0] = False
        for piece in np.flatnonzero(small).tolist():
            left, top, width, height = stats[piece, :4].tolist()
            box = np.s_[top : top + height, left : left + width]
            own = pieces[box] == piece
            short, long = _sides(own)
            if short >= thinnest and shortest <= long <= _LONGEST and long < _SLENDER * short:
                found[box] |= own
        del pieces  # four bytes of each cell
    return found


def _closed(free: Mask) -> Mask:
    """Return the closed parts of the floor that are too small for rooms; none: all are small."""
    pieces, stats = cv2.connectedComponentsWithStats(free.astype(np.uint8), connectivity=4)[1:3]
    tiny = stats[:, cv2.CC_STAT_AREA] * CELL**2 < SMALLEST_ROOM
    if tiny[1:].all():
        return np.zeros_like(free)
    tiny[0] = False
    return looked_up(tiny, pieces)


def _sides(piece: Mask) -> tuple[float, float]:
    """Return the shorter and the longer side of a block, metres; 0, 0: it is none."""
    outlines = cv2.findContours(piece.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines[0], key=len)
    short, long = sorted((each + 1) * CELL for each in cv2.minAreaRect(outline)[1])
    # The outline runs through the middles of its cells.
    area = (cv2.contourArea(outline) + len(outline) / 2 + 1) * CELL**2
    return (short, long) if area >= _FILLED * short * long else (0.0, 0.0)


def _at_edge(stats: NDArray[Any], shape: tuple[int, ...]) -> Mask:
    left, top = stats[:, cv2.CC_STAT_LEFT], stats[:, cv2.CC_STAT_TOP]
    right, bottom = left + stats[:, cv2.CC_STAT_WIDTH], top + stats[:, cv2.CC_STAT_HEIGHT]
    return np.asarray((left == 0) | (top == 0) | (right == shape[1]) | (bottom == shape[0]))


def _saddles(free: Mask, clearance: NDArray[np.float32]) -> list[tuple[int, int, float]]:
    """Return where passages are narrowest: row, column and clearance in cells.

    The floor is divided into basins around its widest places (watershed of the clearance); where
    two basins meet with much less clearance than both have, there is a saddle. That is looked for
    in squares of two by two cells, each as clear as its clearest cell.
    """
    if not free.any():
        return []
    from skimage.segmentation import watershed  # takes 0.3 s: most only show a place

    squares = clearance[::2, ::2].copy()
    for shifted in (clearance[1::2, ::2], clearance[::2, 1::2], clearance[1::2, 1::2]):
        inside = squares[: shifted.shape[0], : shifted.shape[1]]
        np.maximum(inside, shifted, out=inside)
    basins = watershed(-squares, _widest_places(squares), mask=squares > 0)
    peaks = np.zeros(int(basins.max()) + 1, np.float32)
    np.maximum.at(peaks, basins.ravel(), squares.ravel())
    meeting = _meeting(basins, squares)
    into = list(range(len(peaks)))
    narrow = []
    for (first, second), (level, cell) in sorted(meeting.items(), key=lambda each: -each[1][0]):
        one, other = _root(into, first), _root(into, second)
        if one == other:
            continue
        if level >= _NARROW * min(peaks[one], peaks[other]):
            into[other] = one
            peaks[one] = max(peaks[one], peaks[other])
        elif level > _BEHIND_WALL:
            narrow.append((first, second, cell))
    found = []
    for first, second, cell in narrow:
        if _root(into, first) != _root(into, second):
            row, column = (2 * each for each in divmod(cell, squares.shape[1]))
            square = clearance[row : row + 2, column : column + 2]
            up, right = divmod(int(np.argmax(square)), square.shape[1])
            found.append((row + up, column + right, float(square[up, right]) / CELL))
    return found


def _widest_places(clearance: NDArray[np.float32]) -> Labels:
    """Return a number at each place that is wider than what is around it, shape of the map."""
    places: Labels = np.zeros(clearance.shape, np.int32)
    # A cell of each place that was found: what is wide around it grows from level to level.
    rows, columns = np.zeros(0, np.intp), np.zeros(0, np.intp)
    highest = float(clearance[np.isfinite(clearance)].max(initial=0.0))
    levels = max(1, math.ceil(math.log(max(highest / _LOWEST, 1.0), _STEP)) + 1)
    for power in reversed(range(levels)):
        count, pieces = cv2.connectedComponents(
            (clearance >= _LOWEST * _STEP**power).astype(np.uint8), connectivity=8
        )
        new = np.ones(count, np.bool_)
        new[pieces[rows, columns]] = False
        new[0] = False
        if new.any():
            numbers = np.zeros(count, np.int32)
            numbers[new] = len(rows) + 1 + np.arange(int(new.sum()))
            here = np.nonzero(new[pieces])
            which = pieces[here]
            places[here] = numbers[which]
            first = np.unique(which, return_index=True)[1]
            rows = np.concatenate([rows, here[0][first]])
            columns = np.concatenate([columns, here[1][first]])
    return places


def _meeting(
    basins: NDArray[Any], clearance: NDArray[np.float32]
) -> dict[tuple[int, int], tuple[float, int]]:
    """Return for each pair of basins the highest clearance where they meet, and its cell."""
    found: dict[tuple[int, int], tuple[float, int]] = {}
    index = np.arange(basins.size).reshape(basins.shape)
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        one, other = basins[here], basins[there]
        differ = (one != other) & (one > 0) & (other > 0)
        low, high = np.minimum(one, other)[differ], np.maximum(one, other)[differ]
        level = np.minimum(clearance[here], clearance[there])[differ]
        cells = index[here][differ]
        order = np.lexsort((-level, high, low))
        low, high, level, cells = low[order], high[order], level[order], cells[order]
        first = np.ones(len(low), np.bool_)
        first[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
        for a, b, value, cell in zip(
            low[first].tolist(),
            high[first].tolist(),
            level[first].tolist(),
            cells[first].tolist(),
            strict=True,
        ):
            if value > found.get((a, b), (0.0, 0))[0]:
                found[a, b] = value, cell
    return found


def _with_floor_below_furniture(labels: Labels, free: Mask) -> Labels:
    """Return labels that cover furniture and the small closed parts of the floor, too."""
    closed = _closed(free)
    labels[closed] = 0
    side = 2 * int(_THICK / CELL) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    solid = (~free | closed).astype(np.uint8)
    thick = cv2.morphologyEx(
        solid, cv2.MORPH_OPEN, disc, borderType=cv2.BORDER_CONSTANT, borderValue=1
    )
    blocks, sizes = cv2.connectedComponentsWithStats(thick, connectivity=4)[1:3]
    furniture = sizes[:, cv2.CC_STAT_AREA] * CELL**2 < SMALLEST_ROOM + 1
    furniture &= ~_at_edge(sizes, free.shape)
    furniture[0] = False
    below = (looked_up(furniture, blocks) | closed) & (labels == 0)
    if not below.any():
        return labels
    del blocks, closed, thick, solid
    below &= distance_to(labels > 0, CELL) <= _BENEATH
    elsewhere = (labels == 0) & ~below
    labels = spread(labels)
    labels[elsewhere] = 0
    return labels


def _numbered(labels: Labels) -> Labels:
    """Return labels from 1 on without gaps, in reading order: from the north, then the west."""
    upright = labels[::-1]
    first = []
    for number, (rows, _) in boxes(upright).items():
        first.append((rows.start, int(np.argmax(upright[rows.start] == number)), number))
    numbers = np.zeros(int(labels.max()) + 1, np.int32)
    numbers[[number for _, _, number in sorted(first)]] = np.arange(1, len(first) + 1)
    return looked_up(numbers, labels)
