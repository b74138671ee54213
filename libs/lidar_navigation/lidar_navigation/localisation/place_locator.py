"""Which place a point of the map belongs to.

The map is divided along its doors as a floor plan is (`floor_plans.occupancy_grid.divided`): what
is connected without going through a door is one room, that of the place whose point lies in it.
Where a map shows several places in one (no door drawn between them), the nearest one is taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from floor_plans import Grid
from floor_plans.occupancy_grid import divided, with_walls
from floor_plans.shapes import Segment
from lidar_navigation.geometry import Points

BESIDE = 0.3
"""How far beside a door one is in one of its two rooms, metres."""


class PlaceRegions:
    """The places of a map.

    Args:
        grid: The map, with its doors open.
        doors: Segments of all doors, metres.
        positions: A point in each place: x, y in metres.
    """

    def __init__(
        self,
        grid: Grid,
        doors: Iterable[Segment],
        positions: Mapping[str, ArrayLike],
    ) -> None:
        self._grid = grid
        doors = list(doors)
        self._points = {
            name: np.asarray(point, dtype=float)[:2] for name, point in positions.items()
        }
        # A little longer than the opening, so that no gap remains beside the frame.
        lines = [_stretched(door, 2 * grid.resolution) for door in doors]
        names = list(self._points)
        self._names = dict(enumerate(names, start=1))
        self._rooms = divided(
            with_walls(grid, lines), [(float(x), float(y)) for x, y in self._points.values()]
        )
        self._beside: dict[int, set[int]] = {}
        for door in doors:
            first, second = (self._room(*point) for point in _sides(door))
            if first is not None and second is not None and first != second:
                self._beside.setdefault(first, set()).add(second)
                self._beside.setdefault(second, set()).add(first)

    def place_at(self, point: Sequence[float] | Points) -> str | None:
        """Return the place that a point (x, y in metres) belongs to; None off the map.

        A room without a place (it was taken from the map, or never entered) belongs to the place
        that one comes into through its doors.
        """
        xy = float(point[0]), float(point[1])
        room = self._room(*xy)
        if room is None:
            return None
        seen, front = {room}, {room}
        while front:
            names = [self._names[each] for each in front if each in self._names]
            if names:
                return min(names, key=lambda name: math.dist(self._points[name], xy))
            front = {other for each in front for other in self._beside.get(each, ())} - seen
            seen |= front
        return None

    def cells_of(self, place: str) -> NDArray[np.bool_] | None:
        """Return the free cells of a place, shape as the map's; None where it has none."""
        number = next((each for each, name in self._names.items() if name == place), None)
        cells = np.asarray((self._rooms == number) & self._grid.free)
        return cells if number is not None and cells.any() else None

    def _room(self, x: float, y: float) -> int | None:
        room: int | None = self._grid.at(self._rooms, x, y)
        return room


class PlaceLocator:
    """Which place a point belongs to, while the map and the places may change.

    Args:
        doors: Segments of all doors, metres.
    """

    def __init__(self, doors: Iterable[Segment]) -> None:
        self._doors = tuple(doors)
        self._grid: Grid | None = None
        self._positions: Mapping[str, ArrayLike] = {}
        self._regions: PlaceRegions | None = None

    @property
    def is_known(self) -> bool:
        """Whether there are a map and places."""
        return self._regions is not None

    def set_map(self, grid: Grid) -> None:
        """Take the map, or another one, with its doors open."""
        self._grid = grid
        self._divide()

    def set_positions(self, positions: Mapping[str, ArrayLike]) -> None:
        """Take the places: a point in each, metres."""
        self._positions = dict(positions)
        self._divide()

    def place_at(self, point: Sequence[float] | Points) -> str | None:
        """Return the place that a point (x, y in metres) belongs to; None: in none."""
        return None if self._regions is None else self._regions.place_at(point)

    def cells_of(self, place: str) -> NDArray[np.bool_] | None:
        """Return the free cells of a place, shape as the map's; None where it has none."""
        return None if self._regions is None else self._regions.cells_of(place)

    def _divide(self) -> None:
        if self._grid is not None and self._positions:
            self._regions = PlaceRegions(self._grid, self._doors, self._positions)


def _sides(door: Segment) -> tuple[np.ndarray, np.ndarray]:
    """Return a point on each side of a door, metres."""
    x1, y1, x2, y2 = door
    middle = np.array([(x1 + x2) / 2, (y1 + y2) / 2])
    across = np.array([y1 - y2, x2 - x1]) / max(math.hypot(x2 - x1, y2 - y1), 1e-9)
    return middle + BESIDE * across, middle - BESIDE * across


def _stretched(line: Segment, by: float) -> Segment:
    x1, y1, x2, y2 = line
    length = math.hypot(x2 - x1, y2 - y1)
    if length == 0:
        return line
    dx, dy = (x2 - x1) / length * by, (y2 - y1) / length * by
    return x1 - dx, y1 - dy, x2 + dx, y2 + dy
