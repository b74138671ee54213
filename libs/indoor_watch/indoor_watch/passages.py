"""Whether the passages of the map are free: from each place's point to its doors, and through.

Cells nearer to a wall than the robot's radius are not passable; things that stand about take more
of them. A passage is looked at within its room, cut off at the doors: a detour through other rooms
is another passage. What the map alone does not allow is no passage that could be blocked.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to, drawn_lines
from indoor_watch.doors import Segment

Mask = NDArray[np.bool_]

AROUND_DOOR = 1.2
"""A doorway is looked at within this distance, metres."""
SNAP = 0.6
"""A passage begins at the passable cell nearest to its point, up to here, metres."""
_WITH_CORNERS = np.ones((3, 3), np.bool_)


@dataclass(frozen=True)
class BlockedPassage:
    """A passage that things block.

    Attributes:
        door: The door that it leads to.
        place: The place that it leads through; empty: the doorway itself is blocked.
        position: Where the nearest of the things is, map frame, metres.
    """

    door: str
    place: str
    position: tuple[float, float]


@dataclass(frozen=True)
class _Passage:
    door: str
    place: str
    start: tuple[float, float]
    end: tuple[float, float]
    within: Mask

    @cached_property
    def box(self) -> tuple[slice, slice]:
        """The rows and columns of what is within."""
        rows, columns = np.nonzero(self.within)
        return slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1)


class Passages:
    """The passages of a map.

    Args:
        grid: The map with its doors open.
        radius: Of the robot, metres.
        doors: Their openings by name, map frame, metres.
        points: A point in each place, x and y in metres.
    """

    def __init__(
        self,
        grid: Grid,
        radius: float,
        doors: Mapping[str, Segment],
        points: Mapping[str, ArrayLike],
    ) -> None:
        self._grid = grid
        self._radius = radius
        walls = distance_to(grid.occupied, grid.resolution)
        self._passable = np.asarray(grid.free & (walls > radius), np.bool_)
        self._rooms, _ = ndimage.label(grid.free & ~drawn_lines(grid, list(doors.values())))
        rooms = self._rooms
        passages = []
        for door, segment in doors.items():
            sides = _sides(segment, radius + 0.25)
            middle = (segment[0] + segment[2]) / 2, (segment[1] + segment[3]) / 2
            passages.append(_Passage(door, '', *sides, self._near(middle, AROUND_DOOR)))
            for side in sides:
                room = grid.at(rooms, *side)
                for place, point in points.items():
                    x, y = np.asarray(point, float)[:2].tolist()
                    xy = float(x), float(y)
                    if room and grid.at(rooms, *xy) == room:
                        passages.append(_Passage(door, place, xy, side, np.asarray(rooms == room)))
        self._passages = [each for each in passages if self._is_free(self._passable, each)]

    def blocked(self, things: Mask) -> list[BlockedPassage]:
        """Return the passages that things block.

        Args:
            things: The cells in which they stand, as the map's.
        """
        if not things.any():
            return []
        away = distance_to(things, self._grid.resolution)
        passable = np.asarray(self._passable & (away > self._radius), np.bool_)
        rows, columns = np.nonzero(things)
        found = []
        for each in self._passages:
            if self._is_free(passable, each):
                continue
            middle = (each.start[0] + each.end[0]) / 2, (each.start[1] + each.end[1]) / 2
            spots = [
                self._grid.centre_of(row, column)
                for row, column in zip(rows.tolist(), columns.tolist(), strict=True)
                if each.within[row, column]
            ]
            if spots:
                at = min(spots, key=lambda spot: math.dist(spot, middle))
                found.append(BlockedPassage(each.door, each.place, (float(at[0]), float(at[1]))))
        return found

    def _is_free(self, passable: Mask, passage: _Passage) -> bool:
        labels, _ = ndimage.label(
            passable[passage.box] & passage.within[passage.box], _WITH_CORNERS
        )
        corner = int(passage.box[0].start), int(passage.box[1].start)
        first, second = (
            self._labels_at(labels, corner, each) for each in (passage.start, passage.end)
        )
        return bool(first & second)

    def _labels_at(
        self, labels: NDArray[Any], corner: tuple[int, int], point: tuple[float, float]
    ) -> set[int]:
        """Return the areas within reach of a point, in its own room."""
        room = self._grid.at(self._rooms, *point)
        (row, column) = self._grid.cells_of(np.array([point]))[0].tolist()
        row, column = row - corner[0], column - corner[1]
        reach = round(SNAP / self._grid.resolution)
        down = slice(max(0, row - reach), max(0, row + reach + 1))
        right = slice(max(0, column - reach), max(0, column + reach + 1))
        height, width = labels.shape
        rooms = self._rooms[corner[0] : corner[0] + height, corner[1] : corner[1] + width]
        window = labels[down, right][rooms[down, right] == room]
        return {int(each) for each in np.unique(window) if each}

    def _near(self, point: tuple[float, float], distance: float) -> Mask:
        mask = np.zeros(self._grid.cells.shape, np.bool_)
        (row, column) = self._grid.cells_of(np.array([point]))[0].tolist()
        reach = round(distance / self._grid.resolution)
        mask[
            max(0, row - reach) : max(0, row + reach + 1),
            max(0, column - reach) : max(0, column + reach + 1),
        ] = True
        return mask


def _sides(door: Segment, away: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return a point on each side of a door, metres."""
    x1, y1, x2, y2 = door
    length = max(math.hypot(x2 - x1, y2 - y1), 1e-9)
    across = (y1 - y2) / length * away, (x2 - x1) / length * away
    middle = (x1 + x2) / 2, (y1 + y2) / 2
    return (
        (middle[0] + across[0], middle[1] + across[1]),
        (middle[0] - across[0], middle[1] - across[1]),
    )
