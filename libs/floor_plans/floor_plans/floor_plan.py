"""The unchanging geometry of a place: walls, doors, markers, stations, as its file says.

Walls and doors are boxes around a centre line. A wall runs through; each door cuts its opening out
of the wall it lies on. A place may refer to a map instead of walls, or besides, and may have
neither. Everything is checked when it is read: a `PlaceError` is one line that names
the entry, its value and what was expected.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from floor_plans.occupancy_grid import UNKNOWN, Grid, empty_around, outlines, walled_off
from floor_plans.rooms import Place, PlaceError, place_from
from floor_plans.shapes import WALL_HEIGHT, WALL_THICKNESS, Point, Pose, Segment
from floor_plans.stations import Station, stations_of
from floor_plans.zones import NO_ZONES, Zones, zones_from
from strict_files.files import FileError
from strict_files.yaml_file import KeyPath

if TYPE_CHECKING:
    from floor_plans.occupancy_map import OccupancyMap

FURTHEST = 1000.0
"""How far from the origin a wall may reach, metres."""
LARGEST = 100_000.0
"""Area of the largest place, square metres: its map is held in memory cell by cell."""
_ON_WALL = 0.03
_AROUND = 2.0
"""Of a place without walls and map, so much is taken around its points, metres."""


@dataclass(frozen=True)
class Wall:
    """A straight wall by the ends of its centre line, metres."""

    name: str
    start: Point
    end: Point

    @property
    def length(self) -> float:
        """Length of the centre line, metres."""
        return math.dist(self.start, self.end)


@dataclass(frozen=True)
class Door:
    """An opening in a wall: centre (metres), direction along the wall (rad), width (metres)."""

    name: str
    x: float
    y: float
    yaw: float
    width: float

    @property
    def ends(self) -> tuple[Point, Point]:
        """The two jambs, metres."""
        dx = math.cos(self.yaw) * self.width / 2
        dy = math.sin(self.yaw) * self.width / 2
        return (self.x - dx, self.y - dy), (self.x + dx, self.y + dy)

    @property
    def segment(self) -> Segment:
        """The opening, from jamb to jamb."""
        start, end = self.ends
        return *start, *end


@dataclass(frozen=True)
class Marker:
    """A square ArUco panel: id, centre and side in metres, direction its picture faces in rad."""

    name: str
    id: int
    x: float
    y: float
    z: float
    yaw: float
    size: float


@dataclass(frozen=True)
class FloorPlan:
    """Everything about a place that its file says.

    Attributes:
        place: The rooms, which doors join them, a point in each.
        walls: Walls by name, uncut; may be empty.
        doors: Doors by name; all of them where there are walls.
        markers: Markers by name.
        marker_size: Side of a marker's black square, metres.
        marker_dictionary: OpenCV's name of the markers' dictionary.
        stations: The charging station of each room that has one; where the file names none, one at
            the point of the recharge room.
        map: The map that the file refers to.
        zones: Where the robot never drives, and where it drives slowly.
    """

    place: Place
    walls: Mapping[str, Wall]
    doors: Mapping[str, Door]
    markers: Mapping[str, Marker]
    marker_size: float
    marker_dictionary: str
    stations: Mapping[str, Station]
    map: OccupancyMap | None = None
    zones: Zones = NO_ZONES

    @classmethod
    def from_parameters(
        cls, parameters: Mapping[str, Any], building: OccupancyMap | None = None
    ) -> FloorPlan:
        """Return the plan that a place's parameters describe.

        Args:
            parameters: The mapping below `ros__parameters` in the place's file; the name of its
                map's file is absolute or relative to the working directory.
            building: That map, where it has been read already.

        Raises:
            PlaceError: An entry is of the wrong shape, contradicts another, or its map cannot be
                read.
        """
        place = place_from(parameters)
        walls = {}
        for name, (x1, y1, x2, y2) in _rows(parameters, 'walls', ('x1', 'y1', 'x2', 'y2')).items():
            walls[name] = Wall(name, (x1, y1), (x2, y2))
        doors = {
            name: Door(name, *row)
            for name, row in _rows(parameters, 'doors', ('x', 'y', 'yaw', 'width')).items()
        }
        size = _number(parameters.get('marker_size', 0.2), 'marker_size')
        markers = {}
        columns = ('id', 'x', 'y', 'z', 'yaw')
        for name, row in _rows(parameters, 'markers', columns).items():
            if row[0] != int(row[0]) or row[0] < 0:
                raise PlaceError(
                    ('markers', name), f'id {row[0]:g}: expected a whole number from 0'
                )
            markers[name] = Marker(name, int(row[0]), row[1], row[2], row[3], row[4], size)
        plan = cls(
            place=place,
            walls=walls,
            doors=doors,
            markers=markers,
            marker_size=size,
            marker_dictionary=_name(
                parameters.get('marker_dictionary', 'DICT_5X5_100'), 'marker_dictionary'
            ),
            stations=stations_of(parameters, place.positions, place.start),
            map=building or _map_of(parameters),
            zones=zones_from(parameters),
        )
        plan._check()
        return plan

    @property
    def start(self) -> Pose:
        """Where the robot starts: the station if that is in its room, else the room's point."""
        if self.place.start in self.place.recharge_rooms:
            return self.stations[self.place.start].pose
        x, y, _ = self.place.positions[self.place.start]
        return x, y, 0.0

    def grid(self, resolution: float = 0.05, margin: float = 0.5) -> Grid:
        """Return the place's occupancy grid, its doors open.

        A cell is occupied when its centre lies within half a cell of a wall, unknown when no place
        reaches it, else free. A place with a map has the map's cells, with its own walls added; one
        with neither is free all over.

        Args:
            resolution: Side of a cell, metres; that of a map is the map's own.
            margin: Width of the unknown border around the walls, metres.
        """
        solid = self.walled(self.wall_pieces(), resolution, margin)
        if self.map is not None or not self.walls:
            return solid
        import cv2

        reached = cv2.connectedComponents(solid.free.astype(np.uint8), connectivity=4)[1]
        inside = {reached[solid.cell_of(x, y)] for x, y, _ in self.place.positions.values()} - {0}
        solid.cells[solid.free & ~np.isin(reached, list(inside))] = UNKNOWN
        return solid

    def walled(
        self, lines: Sequence[tuple[Point, Point]], resolution: float = 0.05, margin: float = 0.5
    ) -> Grid:
        """Return a grid of the place on which walls stand along these lines alone.

        All else is free, or as the place's map has it.
        """
        if self.map is not None:
            return walled_off(self.map.grid, lines)
        return walled_off(empty_around(self.bounds, resolution, margin), lines)

    def solid_lines(self) -> list[tuple[Point, Point]]:
        """Return the centre lines of all that stands in the place with its doors open, metres.

        The walls' pieces, and the outlines of what its map shows.
        """
        lines = list(self.wall_pieces())
        if self.map is not None:
            for outline in outlines(self.map.grid, self.map.resolution):
                for (x1, y1), (x2, y2) in pairwise(outline.tolist()):
                    if (x1, y1) != (x2, y2):
                        lines.append(((x1, y1), (x2, y2)))
        return lines

    @property
    def is_enclosed(self) -> bool:
        """Whether anything is known of what stands in the place: walls, or a map."""
        return bool(self.walls) or self.map is not None

    def _check(self) -> None:
        for wall in self.walls.values():
            if (furthest := max(map(abs, (*wall.start, *wall.end)))) > FURTHEST:
                raise PlaceError(
                    ('walls', wall.name),
                    f'reaches to {furthest:g} m: expected at most {FURTHEST:g} m',
                )
            if wall.length < WALL_THICKNESS:
                raise PlaceError(
                    ('walls', wall.name),
                    f'length {wall.length:g} m: expected at least the thickness of a wall, '
                    f'{WALL_THICKNESS:g} m',
                )
        west, south, east, north = self.bounds
        if self.map is None and (east - west) * (north - south) > LARGEST:
            raise PlaceError(
                ('walls' if self.walls else 'room_positions',),
                f'the place is {east - west:g} m by {north - south:g} m: expected at most '
                f'{LARGEST:g} square metres',
            )
        for door in self.doors.values():
            if not 0.3 <= door.width <= 20.0:
                raise PlaceError(
                    ('doors', door.name), f'width {door.width:g} m: expected 0.3 to 20 m'
                )
            if self.walls and self.map is None and not self.walls_of(door):
                raise PlaceError(
                    ('doors', door.name),
                    f'({door.x:g}, {door.y:g}) with width {door.width:g} m lies on no wall: '
                    f'expected both its jambs on the centre line of one wall',
                )
        for name, (first, *_) in self.place.doors.items():
            if name not in self.doors and self.walls and self.map is None:
                raise PlaceError(
                    ('map', first), f"door '{name}' has no position: expected an entry doors.{name}"
                )
        for name in self.doors.keys() - self.place.doors.keys():
            raise PlaceError(('doors', name), 'leads into no place: expected it in the map')
        self._check_markers()
        self._check_zones()

    def _check_markers(self) -> None:
        if self.marker_size <= 0:
            raise PlaceError(('marker_size',), f'{self.marker_size:g} m: expected more than 0')
        # two panels may have one id: the fault is staged so, and perception reports it
        for name, marker in self.markers.items():
            if not 0.0 <= marker.z <= WALL_HEIGHT:
                raise PlaceError(
                    ('markers', name),
                    f'height {marker.z:g} m: expected 0 to {WALL_HEIGHT:g} m, as high as the walls',
                )

    def _check_zones(self) -> None:
        points: list[tuple[KeyPath, Pose]] = [
            (each.where, each.pose) for each in self.stations.values()
        ]
        points += [(('room_positions', room), at) for room, at in self.place.positions.items()]
        for where, (x, y, _) in points:
            if zone := self.zones.barred((x, y)):
                raise PlaceError(
                    where,
                    f'({x:g}, {y:g}) lies in the keep-out zone {zone.name}: expected it outside',
                )

    def walls_of(self, door: Door) -> list[Wall]:
        """Return the walls that a door cuts through."""
        return [
            wall
            for wall in self.walls.values()
            if all(_distance_to_line(end, wall) < _ON_WALL for end in door.ends)
        ]

    def wall_pieces(self) -> list[tuple[Point, Point]]:
        """Return the centre lines of the walls with the doors' openings cut out, metres."""
        cuts: dict[str, list[tuple[float, float]]] = {name: [] for name in self.walls}
        for door in self.doors.values():
            for wall in self.walls_of(door):
                low, high = sorted(_along(end, wall) for end in door.ends)
                cuts[wall.name].append((low, high))
        pieces = []
        for wall in self.walls.values():
            reached = 0.0
            for low, high in [*sorted(cuts[wall.name]), (wall.length, wall.length)]:
                if low - reached > 1e-6:
                    pieces.append((_at(wall, reached), _at(wall, low)))
                reached = max(reached, high)
        return pieces

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north edge of what is known of the place, metres.

        The walls' centre lines and what its map knows; with neither, some metres around its points.
        """
        ends = [end for wall in self.walls.values() for end in (wall.start, wall.end)]
        if self.map is not None:
            west, south, east, north = self.map.grid.known
            ends += [(west, south), (east, north)]
        if not ends:
            ends = [(x, y) for x, y, _ in self.place.positions.values()]
            ends += [end for door in self.doors.values() for end in door.ends]
            ends = [(x + d, y + d) for x, y in ends for d in (-_AROUND, _AROUND)]
        corners = np.array(ends)
        (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
        return float(west), float(south), float(east), float(north)


def _along(point: Point, wall: Wall) -> float:
    dx, dy = wall.end[0] - wall.start[0], wall.end[1] - wall.start[1]
    return ((point[0] - wall.start[0]) * dx + (point[1] - wall.start[1]) * dy) / wall.length


def _at(wall: Wall, along: float) -> Point:
    share = along / wall.length
    return (
        wall.start[0] + share * (wall.end[0] - wall.start[0]),
        wall.start[1] + share * (wall.end[1] - wall.start[1]),
    )


def _distance_to_line(point: Point, wall: Wall) -> float:
    along = min(max(_along(point, wall), 0.0), wall.length)
    return math.dist(point, _at(wall, along))


def _number(value: object, *where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise PlaceError(where, f'{value!r}: expected a number')
    return float(value)


def _row(value: object, columns: Sequence[str], *where: str) -> list[float]:
    expected = f'expected [{", ".join(columns)}]'
    if value is None:
        raise PlaceError(where, f'missing: {expected}')
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != len(columns):
        raise PlaceError(where, f'{value!r}: {expected}')
    return [_number(entry, *where) for entry in value]


def _map_of(parameters: Mapping[str, Any]) -> OccupancyMap | None:
    """Read the map that a place refers to; a node has '', 0 and [] for what is not given."""
    name = parameters.get('map_file') or ''
    resolution = parameters.get('map_file_resolution') or None
    origin = parameters.get('map_file_origin') or []
    if not isinstance(name, str):
        raise PlaceError(('map_file',), f"{name!r}: expected the name of a map's file")
    if not name:
        if resolution or origin:
            which = 'map_file_resolution' if resolution else 'map_file_origin'
            raise PlaceError((which,), 'is of no map: expected map_file, too')
        return None
    if resolution is not None:
        resolution = _number(resolution, 'map_file_resolution')
    if origin:
        origin = _row(origin, ('x', 'y', 'yaw'), 'map_file_origin')
    from floor_plans.occupancy_map import read_map

    try:
        return read_map(name, resolution=resolution, origin=origin).as_saved()
    except FileError as error:
        raise PlaceError(('map_file',), str(error)) from None


def _rows(
    parameters: Mapping[str, Any], section: str, columns: Sequence[str]
) -> dict[str, list[float]]:
    entries = parameters.get(section)
    if entries is None:
        return {}
    if not isinstance(entries, Mapping) or not entries:
        expected = f'expected NAME: [{", ".join(columns)}] for each'
        raise PlaceError((section,), f'empty: {expected}')
    return {str(name): _row(row, columns, section, str(name)) for name, row in entries.items()}


def _name(value: object, *where: str) -> str:
    if not isinstance(value, str) or not value:
        raise PlaceError(where, f'{value!r}: expected a name')
    return value
