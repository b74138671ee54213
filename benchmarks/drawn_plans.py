"""Floor plans drawn from a seed, as a robot would map them, with the rooms and doors they have.

A plan is an office along a corridor with bends, or a flat or a floor of rooms cut from a
rectangle; some of its rooms are L-shaped. Walls have 0.05 to 0.4 m, doors 0.7 to 2 m. Furniture
leaves the ways between doors free. The map has frayed walls, shifts of some centimetres, specks
and cells that no ray met; it may be turned, and its cells have 0.02 to 0.1 m. Nothing in here is
known to what finds the rooms.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

FINE = 0.02
"""Side of the cells that a plan is drawn on, metres."""
COARSE = 0.1
"""Side of the cells that rooms are laid out on, metres."""
SMALLEST = 3.0
"""Of a room, m^2."""
ROBOT = 0.3
"""Clearance that furniture leaves on the ways between doors, metres."""
Image = NDArray[np.uint8]
Labels = NDArray[np.int32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Plan:
    """A map and its truth, rows from the north.

    Attributes:
        image: Grey: 254 free, 205 unknown, 0 occupied.
        resolution: Metres a cell.
        truth: The room of each cell, 0 in none.
        doors: The cells on the line of each door, column and row.
    """

    image: Image
    resolution: float
    truth: Labels
    doors: list[NDArray[np.float64]]


def drawn_plan(seed: int, furnished: bool) -> Plan:
    """Return the plan of a seed; furnished or empty, it is the same building."""
    random = np.random.default_rng(seed)
    rooms = _merged(_laid_out(random), random)
    labels = np.kron(rooms, np.ones((round(COARSE / FINE),) * 2, np.int32)).astype(np.int32)
    labels = np.pad(labels, round(1.0 / FINE))
    walls = _walls(labels, random)
    doors = _doors(labels, rooms, random)
    lines = np.zeros(labels.shape, np.int32)
    for number, (opening, line) in enumerate(doors, start=1):
        walls[opening] = False
        lines[line] = number
    furniture = _furniture(labels, walls, doors, np.random.default_rng((seed, 1)))
    solid = walls | furniture if furnished else walls
    return _mapped(labels, walls, solid, lines, np.random.default_rng((seed, 2)))


def _laid_out(random: np.random.Generator) -> Labels:
    """Return rooms on coarse cells; a corridor is number 1 where there is one."""
    if random.random() < 0.6:
        return _office(random)
    size = random.uniform(9.0, 26.0, 2)
    rooms = np.zeros(tuple(np.rint(size / COARSE).astype(int)), np.int32)
    _cut(rooms, (0, 0, *rooms.shape), random, random.uniform(2.5, 4.5))
    return rooms


def _cut(rooms: Labels, box: tuple[int, ...], random: np.random.Generator, least: float) -> None:
    """Cut a rectangle in two until its parts are rooms."""
    top, left, bottom, right = box
    size = np.array([bottom - top, right - left]) * COARSE
    axis = int(random.random() < size[1] ** 2 / (size**2).sum())
    if size[axis] < 2 * least or (size.prod() < 40 and random.random() < 0.25):
        rooms[top:bottom, left:right] = rooms.max() + 1
        return
    at = box[axis] + round(random.uniform(least, size[axis] - least) / COARSE)
    for part in (
        ((top, left, at, right), (at, left, bottom, right))
        if axis == 0
        else (
            (top, left, bottom, at),
            (top, at, bottom, right),
        )
    ):
        _cut(rooms, part, random, least)


def _office(random: np.random.Generator) -> Labels:
    """Return rooms on both sides of a corridor that bends up to twice."""
    width = random.uniform(1.4, 3.0)
    at, heading = np.array([0.0, 0.0]), 0
    legs = []
    for _ in range(int(random.integers(1, 4))):
        length = random.uniform(12.0, 26.0)
        step = np.array([(0.0, 1.0), (1.0, 0.0), (0.0, -1.0)][heading]) * length
        legs.append((at, at + step))
        at = at + step
        heading = int(random.choice([0, 2])) if heading == 1 else 1
    depths = random.uniform(3.0, 7.0, 2)
    corners = np.array([corner for leg in legs for corner in leg])
    low = corners.min(axis=0) - depths.max() - width
    high = corners.max(axis=0) + depths.max() + width
    rooms = np.zeros(tuple(np.rint((high - low) / COARSE).astype(int)), np.int32)
    for start, end in legs:
        (r1, c1), (r2, c2) = np.sort([start, end], axis=0) - low
        half = width / 2
        rooms[_box(r1 - half, c1 - half, r2 + half, c2 + half)] = 1
    number = 1
    for start, end in legs:
        (r1, c1), (r2, c2) = np.sort([start, end], axis=0) - low
        across = r1 == r2  # the leg runs along a row
        for side, depth in zip((-1, 1), depths, strict=True):
            first, last = (c1, c2) if across else (r1, r2)
            first, last = first - width / 2, last + width / 2
            while first < last - 0.5:
                long = min(random.uniform(2.4, 8.0), last - first)
                long = last - first if last - first - long < 2.0 else long
                near = (r1 if across else c1) + side * width / 2
                far = near + side * depth
                ends = (min(near, far), first, max(near, far), first + long)
                box = _box(*(ends if across else (ends[1], ends[0], ends[3], ends[2])))
                number += 1
                rooms[box] = np.where(rooms[box] == 0, number, rooms[box])
                first += long
    return rooms


def _box(top: float, left: float, bottom: float, right: float) -> tuple[slice, slice]:
    low, west, high, east = (round(each / COARSE) for each in (top, left, bottom, right))
    return np.s_[max(low, 0) : high, max(west, 0) : east]


def _merged(rooms: Labels, random: np.random.Generator) -> Labels:
    """Return rooms of one piece each, none too small, some of them joined to an L."""
    pieces = np.zeros_like(rooms)
    for number in np.unique(rooms[rooms > 0]).tolist():
        count, own = cv2.connectedComponents((rooms == number).astype(np.uint8), connectivity=4)
        pieces[own > 0] = own[own > 0] + pieces.max()
        assert count > 1
    wishes = random.random(int(pieces.max()) + 1) < 0.08
    for _ in range(2 * len(wishes)):
        areas = np.bincount(pieces.ravel(), minlength=len(wishes)) * COARSE**2
        narrow = [
            number
            for number in range(1, len(wishes))
            if areas[number] and (areas[number] < SMALLEST or _width(pieces == number) < 1.3)
        ]
        chosen = narrow or [n for n in np.flatnonzero(wishes).tolist() if n > 1 and areas[n]]
        if not chosen:
            break
        wishes[chosen[0]] = False
        borders = _borders(pieces, chosen[0])
        if not narrow:
            borders = {n: size for n, size in borders.items() if n > 1 and areas[n] < 40}
        if borders:
            pieces[pieces == chosen[0]] = max(borders, key=borders.__getitem__)
    numbers = np.unique(pieces)
    return np.searchsorted(numbers, pieces).astype(np.int32)


def _width(mask: Mask) -> float:
    away = cv2.distanceTransform(np.pad(mask, 1).astype(np.uint8), cv2.DIST_C, 3)
    return float(2 * away.max() * COARSE)


def _borders(pieces: Labels, number: int) -> dict[int, int]:
    around = cv2.dilate((pieces == number).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    found, sizes = np.unique(pieces[around & (pieces > 0)], return_counts=True)
    table = dict(zip(found.tolist(), sizes.tolist(), strict=True))
    table.pop(number, None)
    return table


def _walls(labels: Labels, random: np.random.Generator) -> Mask:
    """Return the walls: outer ones of 0.2 to 0.4 m, inner ones of 0.05 to 0.25 m."""
    outer, inner = random.uniform(0.2, 0.4), random.uniform(0.05, 0.25)
    edges = np.zeros(labels.shape, np.uint8)
    for here, there in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        one, other = labels[here], labels[there]
        edges[here] |= np.where(one != other, np.where((one > 0) & (other > 0), 1, 2), 0).astype(
            np.uint8
        )
    thick = [np.ones((max(1, round(each / FINE)),) * 2, np.uint8) for each in (inner, outer)]
    return np.asarray(
        (cv2.dilate((edges > 0).astype(np.uint8), thick[0]) > 0)
        | (cv2.dilate((edges == 2).astype(np.uint8), thick[1]) > 0)
    )


Opening = tuple[tuple[slice, slice], tuple[slice, slice]]


def _doors(labels: Labels, rooms: Labels, random: np.random.Generator) -> list[Opening]:
    """Return openings, and the line of each, that join all rooms; a few more than are needed."""
    runs = _runs(labels)
    pairs = list(runs)
    random.shuffle(pairs)
    pairs.sort(key=lambda pair: 1 not in pair)  # to the corridor first
    into = list(range(int(rooms.max()) + 1))

    def root(each: int) -> int:
        return each if into[each] == each else root(into[each])

    found: list[Opening] = []
    for first, second in pairs:
        tree = root(first) != root(second)
        if not tree and random.random() > 0.12:
            continue
        width = random.uniform(1.4, 2.0) if random.random() < 0.15 else random.uniform(0.7, 1.1)
        long = [run for run in runs[first, second] if (run[3] - run[2]) * FINE > width + 0.9]
        if not long:
            long = [run for run in runs[first, second] if (run[3] - run[2]) * FINE > 1.4]
            width = 0.75
        if not long:
            continue
        into[root(first)] = root(second)
        level, at, low, high = long[int(random.integers(len(long)))]
        cells = round(width / FINE)
        free = high - low - cells
        edge = min(free // 2, round(0.35 / FINE))
        begin = low + int(random.integers(edge, max(edge + 1, free - edge)))
        span, deep = slice(begin, begin + cells), round(0.26 / FINE)
        across, line = slice(at - deep, at + deep), slice(at, at + 1)
        if level:
            found.append(((across, span), (line, span)))
        else:
            found.append(((span, across), (span, line)))
    return found


def _runs(labels: Labels) -> dict[tuple[int, int], list[tuple[bool, int, int, int]]]:
    """Return the straight borders between rooms: level or upright, where, first and last cell."""
    found: dict[tuple[int, int], list[tuple[bool, int, int, int]]] = {}
    for level, table in ((True, labels), (False, labels.T)):
        one, other = table[:-1], table[1:]
        for row in np.flatnonzero(((one != other) & (one > 0) & (other > 0)).any(axis=1)).tolist():
            key = one[row].astype(np.int64) * 100_000 + other[row]
            key[(one[row] == other[row]) | (one[row] == 0) | (other[row] == 0)] = 0
            edges = np.flatnonzero(np.diff(key, prepend=0, append=0))
            for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
                if key[low]:
                    first, second = sorted(divmod(int(key[low]), 100_000))
                    found.setdefault((first, second), []).append((level, row, low, high))
    return found


KINDS = (
    # Depth and width in metres, whether it stands at a wall, whether legs alone are seen.
    ((0.4, 0.6), (0.8, 2.4), True, False),  # cupboards and shelves
    ((0.7, 0.9), (1.2, 1.8), True, False),  # desks with drawers
    ((0.7, 0.9), (1.2, 1.8), True, True),  # desks
    ((1.4, 1.8), (1.9, 2.1), True, False),  # beds, sofas
    ((0.8, 1.2), (1.2, 2.6), False, True),  # tables
    ((0.8, 1.2), (1.2, 2.6), False, False),  # counters
    ((0.3, 0.5), (0.3, 0.5), False, False),  # bins, plants
    ((0.4, 0.45), (0.4, 0.45), False, True),  # chairs
)


def _furniture(
    labels: Labels, walls: Mask, doors: list[Opening], random: np.random.Generator
) -> Mask:
    """Return furniture that leaves each door, and the ways between doors, free."""
    solid = np.zeros(labels.shape, np.bool_)
    kept = np.zeros(labels.shape, np.uint8)  # where nothing may stand
    for opening, _ in doors:
        kept[opening] = 1
    kept = cv2.dilate(kept, np.ones((round(1.2 / FINE),) * 2, np.uint8))
    numbers = range(1, int(labels.max()) + 1)
    for number in numbers:
        rows, columns = np.nonzero(labels == number)
        box = np.s_[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
        floor = (labels[box] == number) & ~walls[box]
        area = floor.sum() * FINE**2
        own = np.zeros(floor.shape, np.bool_)
        crowd = random.uniform(0.0, 0.45) * (0.3 if number == 1 else 1.0)
        ends = kept[box] > 0
        for _ in range(int(area * crowd)):
            piece = _piece(floor & ~own & ~ends, floor, random)
            if piece is None:
                continue
            tried = own | piece
            if _ways_free(floor & ~tried, ends & floor):
                own = tried
        solid[box] |= own
    return solid


def _beside_wall(floor: Mask, size: list[int]) -> Mask:
    """Return the first cells of boxes of a size whose longer side lies along a wall."""
    wall = (~np.pad(floor, 1)).astype(np.float32)
    found = np.zeros(floor.shape, np.bool_)
    for axis in (0, 1):
        if size[1 - axis] < size[axis]:
            continue
        long = size[1 - axis]
        kernel = (long, 1) if axis == 0 else (1, long)
        along = cv2.boxFilter(wall, -1, kernel, anchor=(0, 0)) > 1 - 0.3
        here = [slice(1, -1), slice(1, -1)]
        for step in (0, size[axis] + 1):
            here[axis] = slice(step, step + floor.shape[axis])
            part = along[tuple(here)]
            found[: part.shape[0], : part.shape[1]] |= part
    return found


def _piece(free: Mask, floor: Mask, random: np.random.Generator) -> Mask | None:
    """Return the cells of a piece of furniture somewhere on free floor, None: it has no room."""
    depths, widths, at_wall, legs = KINDS[int(random.integers(len(KINDS)))]
    size = [round(random.uniform(*each) / FINE) for each in (depths, widths)]
    if random.random() < 0.5:
        size.reverse()
    if free.shape[0] <= size[0] + 2 or free.shape[1] <= size[1] + 2:
        return None
    filled = cv2.boxFilter(free.astype(np.float32), -1, (size[1], size[0]), anchor=(0, 0))
    fits = filled > 1 - 0.5 / (size[0] * size[1])
    fits[-size[0] :] = fits[:, -size[1] :] = False
    if at_wall:
        # Its longer side stands at a wall, or a centimetre off it.
        beside = _beside_wall(floor, size)
        fits &= beside
    places = np.argwhere(fits)
    if not len(places):
        return None
    row, column = places[int(random.integers(len(places)))]
    piece = np.zeros(free.shape, np.bool_)
    if not legs:
        piece[row : row + size[0], column : column + size[1]] = True
        return piece
    foot = round(0.06 / FINE)
    for y in (row, row + size[0] - foot):
        for x in (column, column + size[1] - foot):
            piece[y : y + foot, x : x + foot] = True
    return piece


def _ways_free(free: Mask, ends: Mask) -> bool:
    """Return whether a robot gets from each door of a room to each other one."""
    padded = np.pad(free | ends, 1)
    away = cv2.distanceTransform(padded.astype(np.uint8), cv2.DIST_L2, 3)[1:-1, 1:-1] * FINE
    count, pieces = cv2.connectedComponents((away > ROBOT).astype(np.uint8), connectivity=8)
    if count < 2:
        return False
    doors = cv2.connectedComponents(ends.astype(np.uint8), connectivity=8)
    own = [set(np.unique(pieces[doors[1] == n]).tolist()) - {0} for n in range(1, doors[0])]
    largest = 1 + int(np.argmax(np.bincount(pieces.ravel())[1:]))
    return all(not each or largest in each for each in own) and count == 2


def _mapped(
    labels: Labels, walls: Mask, solid: Mask, lines: Labels, random: np.random.Generator
) -> Plan:
    """Return what a robot maps of a building: turned, shifted, frayed, at its own resolution."""
    side = float(random.choice([0.02, 0.025, 0.03, 0.05, 0.05, 0.05, 0.05, 0.1]))
    degrees = float(random.uniform(3.0, 30.0)) if random.random() < 0.5 else 0.0
    rows, columns = labels.shape
    turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), degrees, 1.0)
    width, height = (
        abs(turn[0, 0]) * columns + abs(turn[0, 1]) * rows,
        abs(turn[0, 0]) * rows + abs(turn[0, 1]) * columns,
    )
    turn[:, 2] += ((width - columns) / 2, (height - rows) / 2)
    size = (math.ceil(width), math.ceil(height))

    def turned(table: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(
            cv2.warpAffine(table.astype(np.float32), turn, size, flags=cv2.INTER_NEAREST)
        )

    # Poses that drift bend the walls by some centimetres.
    shape = (size[1], size[0])
    coarse = random.normal(
        0.0, 0.03 / FINE, (2, math.ceil(shape[0] / 150), math.ceil(shape[1] / 150))
    )
    drift = [
        cv2.resize(each.astype(np.float32), size, interpolation=cv2.INTER_CUBIC) for each in coarse
    ]
    grid = np.mgrid[: shape[0], : shape[1]].astype(np.float32)

    def bent(table: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(
            cv2.remap(turned(table), grid[1] + drift[1], grid[0] + drift[0], cv2.INTER_NEAREST)
        )

    stands = bent(solid) > 0
    inside = bent((labels > 0) | walls) > 0
    open_ = inside & ~stands
    # The laser meets the face of what stands there; what is behind stays unknown.
    face = stands & (cv2.dilate(open_.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
    face &= random.random(shape) > 0.03
    specks = open_ & (random.random(shape) < 1e-5)
    cells = (math.floor(size[0] * FINE / side), math.floor(size[1] * FINE / side))
    column = np.minimum(((np.arange(cells[0]) + 0.5) * side / FINE).astype(int), size[0] - 1)
    row = np.minimum(((np.arange(cells[1]) + 0.5) * side / FINE).astype(int), size[1] - 1)

    def at(table: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(table[row[:, None], column[None, :]])

    reach = np.ones((max(1, round(side / FINE)),) * 2, np.uint8)
    met = at(cv2.dilate((face | specks).astype(np.uint8), reach) > 0)
    image = np.where(met, 0, np.where(at(open_), 254, 205)).astype(np.uint8)
    truth = at(np.where(bent(walls) > 0, 0, bent(labels))).astype(np.int32)
    wide = cv2.dilate(bent(lines), np.ones((round(max(side, 0.04) / FINE) + 1,) * 2, np.uint8))
    truth[at(wide) > 0] = 0
    drawn = at(wide).astype(np.int32)
    doors = [
        np.argwhere((drawn == number) & (image == 254))[:, ::-1].astype(float)
        for number in range(1, int(lines.max()) + 1)
    ]
    return Plan(image, side, truth, [each for each in doors if len(each)])
