"""Zones of a place: where the robot never drives, and where it drives slowly.

A zone is a polygon. In a place's file, `keep_out_zones` has its corners, `slow_zones` the top speed
in m/s and then the corners: `S1: [0.3, x1, y1, x2, y2, x3, y3]`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from floor_plans.occupancy_grid import Grid, drawn_lines
from floor_plans.rooms import ZONE_TABLES, PlaceError, problem_in_name

Corner = tuple[float, float]
Points = NDArray[np.float64]

MOST_CORNERS = 200
SLOWEST, FASTEST = 0.02, 20.0
"""Bounds of a slow zone's speed, m/s."""
_SMALLEST = 0.01
_FURTHEST = 100_000.0


@dataclass(frozen=True)
class Zone:
    """A polygon on the floor.

    Attributes:
        name: Its name.
        corners: In order, at least three, metres.
        speed: Top speed in it, m/s; None: the robot never enters it.
    """

    name: str
    corners: tuple[Corner, ...]
    speed: float | None = None

    @cached_property
    def _sides(self) -> tuple[Points, Points]:
        """Starts and ends of the sides, shape (n, 2)."""
        starts = np.array(self.corners, dtype=float)
        return starts, np.roll(starts, -1, axis=0)

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """West, south, east and north edge, metres."""
        starts = self._sides[0]
        (west, south), (east, north) = starts.min(axis=0), starts.max(axis=0)
        return float(west), float(south), float(east), float(north)

    @property
    def area(self) -> float:
        """Area of the polygon, square metres."""
        (x1, y1), (x2, y2) = (ends.T for ends in self._sides)
        return abs(float(np.sum(x1 * y2 - x2 * y1))) / 2

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return which points (n, 2), metres, lie inside, by the parity of the sides to the east
        of them; shape (n,).
        """
        x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
        (x1, y1), (x2, y2) = (ends.T for ends in self._sides)
        crosses = (y1 > y[:, None]) != (y2 > y[:, None])
        with np.errstate(divide='ignore', invalid='ignore'):
            at = x1 + (y[:, None] - y1) / (y2 - y1) * (x2 - x1)
        return np.asarray((crosses & (x[:, None] < at)).sum(axis=1) % 2 == 1)

    def distance(self, point: Sequence[float]) -> float:
        """Return how far a point is from the zone, metres; 0 inside."""
        if self.contains([point[:2]])[0]:
            return 0.0
        starts, ends = self._sides
        along = ends - starts
        share = ((np.array(point[:2]) - starts) * along).sum(axis=1)
        share = np.clip(share / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
        return float(np.hypot(*(starts + share[:, None] * along - point[:2]).T).min())

    def edge(self, spacing: float) -> Points:
        """Return points on the sides, at most `spacing` metres apart, shape (n, 2)."""
        found = []
        for start, end in zip(*self._sides, strict=True):
            steps = max(1, math.ceil(math.dist(start, end) / spacing))
            share = np.arange(steps)[:, None] / steps
            found.append((1 - share) * start + share * end)
        return np.concatenate(found)

    def cells_on(self, grid: Grid) -> NDArray[np.bool_]:
        """Return its cells on a map: those whose centre lies inside, and those on its edge."""
        corners = [*self.corners, self.corners[0]]
        cells = drawn_lines(grid, [(*start, *end) for start, end in pairwise(corners)])
        west, south, east, north = self.box
        bottom, left = np.maximum(grid.cell_of(west, south), 0)
        top, right = np.maximum(np.add(grid.cell_of(east, north), 1), 0)
        window = cells[bottom:top, left:right]
        if window.size:
            inside = np.argwhere(np.ones_like(window)) + np.array([bottom, left])
            window |= self.contains(grid.centres_of(inside)).reshape(window.shape)
        return cells


@dataclass(frozen=True)
class Zones:
    """All zones of a place, by name.

    Attributes:
        keep_out: Where the robot never drives.
        slow: Where it drives slowly.
    """

    keep_out: Mapping[str, Zone] = field(default_factory=dict)
    slow: Mapping[str, Zone] = field(default_factory=dict)

    def barred(self, point: Sequence[float] | Points) -> Zone | None:
        """Return the keep-out zone that a point lies in."""
        for zone in self.keep_out.values():
            if zone.contains(np.asarray(point)[:2])[0]:
                return zone
        return None

    def speed_limit(self, pose: Sequence[float], deceleration: float, ahead: float = 1.5) -> float:
        """Return the top speed at a pose, m/s; infinite outside of slow zones.

        Before a zone it is so high that the robot can brake to the zone's speed.

        Args:
            pose: x, y in metres and yaw in rad; where the robot drives backwards, turned round.
            deceleration: With which it slows down, m/s^2.
            ahead: How far ahead is looked, metres.
        """
        limit = math.inf
        reach = np.linspace(0.0, ahead, 31)
        for zone in self.slow.values():
            west, south, east, north = zone.box
            x, y, yaw = pose
            if not (west - ahead < x < east + ahead and south - ahead < y < north + ahead):
                continue
            way = np.stack([x + reach * math.cos(yaw), y + reach * math.sin(yaw)], axis=1)
            inside = zone.contains(way)
            if inside.any():
                before = float(reach[int(np.argmax(inside))])
                assert zone.speed is not None
                limit = min(limit, math.sqrt(zone.speed**2 + 2.0 * deceleration * before))
        return limit

    def edges_near(self, pose: Sequence[float], reach: float, spacing: float = 0.04) -> Points:
        """Return what a lidar would see if keep-out zones were solid, in the robot's frame.

        A zone that the robot is in does not count: it is to leave it.

        Args:
            pose: Of the robot: x, y in metres, yaw in rad.
            reach: How far away points count, metres.
            spacing: Greatest distance between two points of a side, metres.

        Returns:
            Shape (n, 2), metres.
        """
        x, y, yaw = pose
        found = [np.zeros((0, 2))]
        for zone in self.keep_out.values():
            west, south, east, north = zone.box
            if not (west - reach < x < east + reach and south - reach < y < north + reach):
                continue
            if zone.contains([(x, y)])[0]:
                continue
            found.append(zone.edge(spacing) - (x, y))
        points = np.concatenate(found)
        points = points[np.hypot(*points.T) <= reach]
        cos, sin = math.cos(yaw), math.sin(yaw)
        return np.asarray(points @ np.array([[cos, -sin], [sin, cos]]))


NO_ZONES = Zones()


def zones_from(described: Mapping[str, Any]) -> Zones:
    """Check what a place's parameters say of zones.

    Args:
        described: The parameters `ZONE_TABLES`; each may be missing.

    Raises:
        PlaceError: A zone is no polygon, or its speed none.
    """
    keep_out, slow = (_table(described, table) for table in ZONE_TABLES)
    return Zones(
        {name: _zone('keep_out_zones', name, value, None) for name, value in keep_out.items()},
        {name: _slow(name, value) for name, value in slow.items()},
    )


def _table(described: Mapping[str, Any], table: str) -> Mapping[str, Any]:
    entries = described.get(table)
    if entries is None:
        return {}
    if not isinstance(entries, Mapping):
        raise PlaceError((table,), f'{entries!r}: expected NAME: [...] for each')
    return {str(name): value for name, value in entries.items()}


def _slow(name: str, value: Any) -> Zone:
    where = ('slow_zones', name)
    if not _is_list_of_numbers(value) or len(value) % 2 == 0:
        raise PlaceError(where, f'{_shown(value)}: expected [speed, x1, y1, x2, y2, x3, y3, ...]')
    speed = float(value[0])
    if not SLOWEST <= speed <= FASTEST:
        raise PlaceError(where, f'speed {speed:g} m/s: expected {SLOWEST:g} to {FASTEST:g}')
    return _zone('slow_zones', name, value[1:], speed)


def _zone(table: str, name: str, value: Any, speed: float | None) -> Zone:
    where = (table, name)
    if problem := problem_in_name('zone', name):
        raise PlaceError(where, problem)
    if not _is_list_of_numbers(value) or len(value) % 2 or len(value) < 6:
        first = '' if speed is None else 'speed, '
        raise PlaceError(where, f'{_shown(value)}: expected [{first}x1, y1, x2, y2, x3, y3, ...]')
    if len(value) > 2 * MOST_CORNERS:
        raise PlaceError(where, f'{len(value) // 2} corners: expected at most {MOST_CORNERS}')
    if (furthest := max(map(abs, value))) > _FURTHEST:
        raise PlaceError(where, f'reaches to {furthest:g} m: expected at most {_FURTHEST:g} m')
    corners = tuple((float(x), float(y)) for x, y in zip(value[::2], value[1::2], strict=True))
    zone = Zone(name, corners, speed)
    if crossing := _crossing(corners):
        raise PlaceError(
            where,
            f'its sides from corner {crossing[0] + 1} and from corner {crossing[1] + 1} cross: '
            'expected the corners in turn around the zone',
        )
    if zone.area < _SMALLEST:
        raise PlaceError(where, f'{zone.area:.3g} square metres: expected at least {_SMALLEST:g}')
    return zone


def _crossing(corners: Sequence[Corner]) -> tuple[int, int] | None:
    """Return two sides, by the numbers of their first corners, that cross."""
    count = len(corners)
    for first, second in combinations(range(count), 2):
        if second - first in (1, count - 1):
            continue
        a, b = corners[first], corners[(first + 1) % count]
        c, d = corners[second], corners[(second + 1) % count]
        if _turn(a, b, c) * _turn(a, b, d) < 0 and _turn(c, d, a) * _turn(c, d, b) < 0:
            return first, second
    return None


def _turn(a: Corner, b: Corner, c: Corner) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _is_list_of_numbers(value: Any) -> bool:
    return (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and len(value) > 0
        and all(
            isinstance(each, int | float) and not isinstance(each, bool) and math.isfinite(each)
            for each in value
        )
    )


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + '...'
