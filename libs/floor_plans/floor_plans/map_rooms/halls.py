"""Halls: rooms too large to be seen from one point, and the aisles that shelves leave in them.

A hall is cut by a boustrophedon decomposition (Choset, "Coverage of known spaces: the boustrophedon
cellular decomposition", 2000): a line is moved along the shelves, and where the floor on it falls
apart or comes together, one part ends and others begin. Between shelves the parts are aisles,
before and behind them the cross aisles.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans.map_rooms.segmentation import CELL, Segmentation
from floor_plans.occupancy_grid import Grid, boxes, spread, totals
from floor_plans.visibility import in_view

Labels = NDArray[np.int32]
Mask = NDArray[np.bool_]

HALL = 60.0
"""A room of less is no hall, m^2."""
REACH = 6.0
"""So far a robot sees the floor, metres."""
SEEN = 0.6
"""A room of whose floor less is seen from its point is a hall."""
_SHELF = 2.0
"""What stands in a hall and is as long says which way the aisles run, metres."""
_SHORTEST = 3.0
"""Of an aisle, metres."""
_WIDEST = 6.0
"""A wider way is no aisle, metres."""
_LONG = 1.5
"""An aisle is so many times longer than wide."""
_CROSS = 0.6
"""A part that reaches less far along the shelves belongs to the one beside it, metres."""


@dataclass(frozen=True)
class Hall:
    """A room that is too large to be seen from its point.

    Attributes:
        area: Square metres.
        seen: Which part of its floor is seen from its point.
        aisles: How many aisles shelves leave in it.
    """

    area: float
    seen: float
    aisles: int


def halls(
    found: Segmentation, names: Mapping[int, str], points: Mapping[str, tuple[float, float]]
) -> dict[str, Hall]:
    """Return the halls among the rooms of a map, by name.

    A corridor is none, if there are other rooms and it has no aisles: a patrol goes through it.

    Args:
        found: The rooms.
        names: Of the rooms, by their numbers.
        points: Of the rooms, on the working map: x and y in metres from its corner.
    """
    labels, grid = found.working_labels, found.working
    areas = totals(labels, found.rooms + 1) * CELL**2
    result = {}
    for number, box in boxes(labels).items():
        if number not in names or areas[number] < HALL:
            continue
        # The room alone: a building has many, and is much larger.
        name, room = names[number], labels[box] == number
        own = Grid(grid.cells[box], CELL, (box[1].start * CELL, box[0].start * CELL))
        view = in_view(own, points[name], REACH) & room
        seen = float(view.sum() / max(1, int((room & own.free).sum())))
        if seen >= SEEN:
            continue
        aisles = aisles_of(room, own.free)[1]
        if aisles or number not in found.corridors or len(names) == 1:
            result[name] = Hall(round(float(areas[number]), 1), round(seen, 2), aisles)
    return result


def with_aisles(found: Segmentation) -> Segmentation:
    """Return the rooms of a map with each hall that has aisles cut into these."""
    areas = totals(found.working_labels, found.rooms + 1) * CELL**2
    for number in range(1, found.rooms + 1):
        if areas[number] < HALL:
            continue
        room = found.working_labels == number
        parts, aisles = aisles_of(room, found.working.free)
        if aisles < 2:
            continue
        # The first part keeps the hall's number, the others get new ones.
        numbers = np.where(parts > 1, found.rooms + parts - 1, number).astype(np.int32)
        labels = np.where(room, numbers, found.working_labels)
        rows, columns = found.labels.shape
        row, column = (
            np.minimum(((np.arange(size) + 0.5) * wide / size).astype(np.intp), wide - 1)
            for size, wide in zip((rows, columns), labels.shape, strict=True)
        )
        inside = found.labels == number
        own = np.where(inside, numbers[row[:, None], column[None, :]], found.labels)
        count = found.rooms + int(parts.max()) - 1
        new = frozenset({*(found.corridors - {number})})
        found = replace(found, labels=own, rooms=count, corridors=new, working_labels=labels)
    return found


def aisles_of(room: Mask, free: Mask) -> tuple[Labels, int]:
    """Return the aisles and cross aisles of a room, and how many aisles there are.

    Args:
        room: Its cells, of `CELL`.
        free: The cells in which nothing stands.

    Returns:
        A number from 1 for each cell of the room; all 1 where there are fewer than two aisles.
    """
    whole = room.astype(np.int32)
    rows, columns = (np.flatnonzero(room.any(axis=axis)) for axis in (1, 0))
    if not rows.size:
        return whole, 0
    box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    floor = (room & free)[box].astype(np.uint8)
    angle = _direction_of_shelves(room[box], floor > 0)
    if angle is None:
        return whole, 0
    height, width = floor.shape
    span = math.ceil(math.hypot(height, width)) + 2
    turn = cv2.getRotationMatrix2D((width / 2, height / 2), math.degrees(angle), 1.0)
    turn[:, 2] += ((span - width) / 2, (span - height) / 2)
    turned = cv2.warpAffine(floor, turn, (span, span), flags=cv2.INTER_NEAREST)
    side = 2 * round(0.1 / CELL) + 1  # specks and frayed edges
    turned = cv2.morphologyEx(turned, cv2.MORPH_CLOSE, np.ones((side, side), np.uint8))
    parts = _decomposed(turned > 0)
    sizes, aisles = _merged(parts)
    if len(aisles) < 2:
        return whole, 0
    back = cv2.warpAffine(
        sizes.astype(np.float32),
        turn,
        (width, height),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
    ).astype(np.int32)
    inner = room[box]
    seeds = np.where(inner & (floor > 0), back, 0)
    filled = np.where(inner, spread(seeds), 0)
    used = np.unique(filled[filled > 0])
    numbers = np.zeros(int(filled.max()) + 1, np.int32)
    numbers[used] = np.arange(1, len(used) + 1)
    result = np.zeros(room.shape, np.int32)
    result[box] = numbers[filled]
    return result, len(aisles)


def _direction_of_shelves(room: Mask, floor: Mask) -> float | None:
    """Return the direction of what stands in a room and is long, rad; None: nothing does."""
    # What is no floor and does not reach the outside of the room's box stands in it.
    solid = (~floor).astype(np.uint8)
    solid = np.pad(solid, 1, constant_values=1)
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(solid, connectivity=8)
    outer = pieces[0, 0]
    doubled, weight = 0j, 0.0
    for piece in range(1, count):
        if piece == outer or max(stats[piece, 2:4]) * CELL < _SHELF:
            continue
        points = np.argwhere(pieces == piece)[:, ::-1].astype(np.float32)
        _, (long, short), degrees = cv2.minAreaRect(points)
        if long < short:
            long, short, degrees = short, long, degrees + 90.0
        if long * CELL < _SHELF or long < 2 * short:
            continue
        doubled += long * np.exp(2j * math.radians(degrees))
        weight += long
    # Shelves that stand across each other have no direction in common.
    if not weight or abs(doubled) < 0.7 * weight:
        return None
    return float(np.angle(doubled) / 2)


def _decomposed(floor: Mask) -> Labels:
    """Return the parts of a boustrophedon decomposition whose line moves along the columns."""
    labels = np.zeros(floor.shape, np.int32)
    count = 0
    before: list[tuple[int, int, int]] = []
    for column in range(floor.shape[1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], floor[:, column].view(np.int8), [0]])))
        runs = [(int(low), int(high)) for low, high in edges.reshape(-1, 2)]
        beside = [[old for old in before if old[0] < high and low < old[1]] for low, high in runs]
        after = {old: sum(old in each for each in beside) for old in before}
        now = []
        for (low, high), olds in zip(runs, beside, strict=True):
            if len(olds) == 1 and after[olds[0]] == 1:
                number = olds[0][2]
            else:
                count += 1
                number = count
            labels[low:high, column] = number
            now.append((low, high, number))
        before = now
    return labels


def _merged(parts: Labels) -> tuple[Labels, set[int]]:
    """Return the parts with splinters given to those beside them, and the numbers of aisles."""
    parts = parts.copy()
    while True:
        count = int(parts.max())
        sizes = np.bincount(parts.ravel(), minlength=count + 1)
        cells = np.argwhere(parts > 0)
        which = parts[cells[:, 0], cells[:, 1]]
        first = np.full(count + 1, parts.shape[1])
        last = np.full(count + 1, -1)
        np.minimum.at(first, which, cells[:, 1])
        np.maximum.at(last, which, cells[:, 1])
        length = (last - first + 1) * CELL
        there = [n for n in range(1, count + 1) if sizes[n]]
        height = {n: sizes[n] * CELL**2 / max(length[n], CELL) for n in there}
        small = sorted((length[n], n) for n in there if length[n] < _CROSS)
        borders: dict[int, dict[int, int]] = {}
        for here, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
            one, two = parts[here], parts[other]
            differ = (one != two) & (one > 0) & (two > 0)
            for a, b in zip(one[differ].tolist(), two[differ].tolist(), strict=True):
                borders.setdefault(a, {})[b] = borders.setdefault(a, {}).get(b, 0) + 1
                borders.setdefault(b, {})[a] = borders.setdefault(b, {}).get(a, 0) + 1
        splinter = next((n for _, n in small if borders.get(n)), None)
        if splinter is None:
            break
        into = max(borders[splinter], key=lambda n: borders[splinter][n])
        parts[parts == splinter] = into
    aisles = {
        n for n in there if length[n] >= max(_SHORTEST, _LONG * height[n]) and height[n] <= _WIDEST
    }
    # An aisle has another one beside it.
    aisles = {
        n
        for n in aisles
        if any(
            min(last[n], last[m]) - max(first[n], first[m]) > 0.5 * (last[n] - first[n])
            for m in aisles - {n}
        )
    }
    return parts, aisles
