"""Which parts of a map, once it is cut, are one room.

Two parts that share a cut are joined where the opening is wide for the smaller one: a room behind a
door of 0.9 m has many times the area of a square on that door, a niche less than one. Parts of one
corridor are joined, too: a door narrows, and where the opening is as wide as the corridor behind
it, the corridor goes on. The least separate pair is joined first, and what is left is measured
anew.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from floor_plans.occupancy_grid import totals

SEPARATE = 0.9
"""Area of the smaller part, in squares of the opening's width, from which on two are rooms."""
_SMALL = 1.0
"""A part with less area is no room, m^2."""
_SHALLOW = 0.35
"""A part with less depth than this share of its openings' width is a niche."""
LONG = 4.0
"""From this area on, in squares of its mean width, a part is a corridor."""
_PIECE = 2.8
"""The same for a part that may be a piece of a corridor."""
_FULL_WIDTH = 0.9
"""An opening that has this share of the width behind it is no door: the corridor goes on."""


@dataclass
class _Border:
    """What two parts share: length of their cuts, and the clearance in the widest one, metres."""

    length: float
    clearance: float


def joined(
    parts: NDArray[np.int32],
    cuts: NDArray[np.float32],
    clearance: NDArray[np.float32],
    resolution: float,
) -> NDArray[np.int32]:
    """Return for each part the number of the one that it belongs to, shape (parts + 1,).

    Args:
        parts: The part of each cell from 1; 0 on cuts and in obstacles.
        cuts: The length of the cut that a cell stands for, cells; 0 where none is.
        clearance: Distance to what stands there, metres.
        resolution: Side of a cell, metres.
    """
    count = int(parts.max()) + 1
    cell = resolution**2
    area = totals(parts, count) * cell
    depth = totals(parts, count, clearance) * cell
    room = _Joining(area.tolist(), depth.tolist(), _borders(parts, cuts, clearance, resolution))
    return room.join()


def _borders(
    parts: NDArray[np.int32],
    cuts: NDArray[np.float32],
    clearance: NDArray[np.float32],
    resolution: float,
) -> dict[tuple[int, int], _Border]:
    rows, columns = np.nonzero((cuts > 0) & (clearance > 0))
    # Off the map, a cell is its own neighbour: it lies on a cut.
    last = np.array(parts.shape)[:, None] - 1
    beside = [
        np.clip((rows + up, columns + right), 0, last)
        for up, right in ((-1, 0), (1, 0), (0, -1), (0, 1))
    ]
    around = np.sort(np.stack([parts[row, column] for row, column in beside]), axis=0)
    found: dict[tuple[int, int], _Border] = {}
    mixed = np.flatnonzero(((around > 0) & (around != around[3])).any(axis=0))
    lengths, clear = cuts[rows, columns] * resolution, clearance[rows, columns]
    for index in mixed.tolist():
        names = [name for name in dict.fromkeys(around[:, index].tolist()) if name]
        for place, first in enumerate(names):
            for second in names[place + 1 :]:
                border = found.setdefault((first, second), _Border(0.0, 0.0))
                border.length += float(lengths[index])
                border.clearance = max(border.clearance, float(clear[index]))
    return found


class _Joining:
    def __init__(
        self,
        area: list[float],
        depth: list[float],
        borders: dict[tuple[int, int], _Border],
    ) -> None:
        self._area, self._depth = area, depth
        self._beside: list[dict[int, _Border]] = [{} for _ in area]
        for (first, second), border in borders.items():
            self._beside[first][second] = self._beside[second][first] = border
        self._into = list(range(len(area)))

    def join(self) -> NDArray[np.int32]:
        beside, into = self._beside, self._into
        waiting = [
            (self._separation(first, second), first, second)
            for first, others in enumerate(beside)
            for second in others
            if first < second
        ]
        heapq.heapify(waiting)
        while waiting:
            separation, first, second = heapq.heappop(waiting)
            if separation >= SEPARATE:
                break
            if into[first] != first or into[second] != second or second not in beside[first]:
                continue
            now = self._separation(first, second)
            if abs(now - separation) > 1e-9:
                heapq.heappush(waiting, (now, first, second))
                continue
            if self._area[second] > self._area[first]:
                first, second = second, first
            self._take(first, second)
            for other in beside[first]:
                heapq.heappush(waiting, (self._separation(first, other), first, other))
        return np.array([self._root(each) for each in range(len(into))], np.int32)

    def _take(self, first: int, second: int) -> None:
        """Make the second part one with the first."""
        self._into[second] = first
        self._area[first] += self._area[second]
        self._depth[first] += self._depth[second]
        beside = self._beside
        del beside[first][second]
        for other, border in beside[second].items():
            if other == first:
                continue
            del beside[other][second]
            old = beside[first].get(other, _Border(0.0, 0.0))
            grown = _Border(old.length + border.length, max(old.clearance, border.clearance))
            beside[first][other] = beside[other][first] = grown
        beside[second] = {}

    def _root(self, part: int) -> int:
        while self._into[part] != part:
            part = self._into[part]
        return part

    def _separation(self, first: int, second: int) -> float:
        border = self._beside[first][second]
        length = max(border.length, 0.05)
        width = max(min(length, 2 * border.clearance), 0.05)
        area = min(self._area[first], self._area[second])
        if area < _SMALL:
            return 0.01 * area / width**2
        if area / length**2 < _SHALLOW:
            return 0.3 * area / length**2
        shapes = [(self._area[each], self._depth[each]) for each in (first, second)]
        long = sorted(elongation(*shape) for shape in shapes)
        narrower = 2 * min(half_width(*shape) for shape in shapes)
        if long[0] > _PIECE and long[1] > LONG and width > _FULL_WIDTH * narrower:
            return 0.5
        return area / width**2


def half_width(area: float, depth: float) -> float:
    """Return half the width of a strip with this area, and this sum of clearance over its area."""
    return 2 * depth / area


def elongation(area: float, depth: float) -> float:
    """Return how many squares of its own width a part has; a square itself has 2.25."""
    return area / (2 * half_width(area, depth)) ** 2
