"""What a place is: rooms, the doors that join them, a point in each, and where the robot starts.

A `Place` knows nothing of ontologies or ROS. It is checked once, when it is made, so that whoever
holds one may rely on it: every door joins two rooms, every room has a position, every room can be
reached from the start.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from floor_plans.shapes import Position
from strict_files.suggestions import nearest
from strict_files.yaml_file import KeyPath

PLACE_KEYS = ('map', 'room_positions', 'robot_room', 'recharge_rooms')
ZONE_TABLES = ('keep_out_zones', 'slow_zones')
GEOMETRY_KEYS = (
    *('walls', 'doors', 'markers', 'marker_size', 'marker_dictionary', 'station', 'stations'),
    *ZONE_TABLES,
    *('map_file', 'map_file_resolution', 'map_file_origin', 'robots'),
)
PATROL_TABLES = ('thresholds', 'exploration', 'hours', 'classes')
PATROL_KEYS = (*PATROL_TABLES, 'keep_out', 'sweep', 'quiet_hours', 'time_zone')
ROOM_LISTS = ('recharge_rooms', 'keep_out', 'sweep')
"""Those that list rooms."""
PLACE_TABLES = (
    *('map', 'room_positions', 'walls', 'doors', 'markers', 'stations', 'robots'),
    *ZONE_TABLES,
    *PATROL_TABLES,
)
"""Those that hold an entry for each room, wall, door, marker, ...: `map.R1`, `map.R2`, ..."""
_NAME = re.compile(r'[A-Za-z_][A-Za-z0-9_-]*\Z')


class PlaceError(ValueError):
    """A description, or a change to it, is no sound place; one line that begins with the parameter.

    Attributes:
        where: The parameter's path, e.g. ``('map', 'R1')``; may be empty.
        problem: What was found there and what was expected.
    """

    def __init__(self, where: KeyPath, problem: str) -> None:
        super().__init__(f'{".".join(where)}: {problem}' if where else problem)
        self.where = where
        self.problem = problem


@dataclass(frozen=True)
class Place:
    """Rooms joined by doors.

    Attributes:
        rooms: Doors of each room, in the order given.
        positions: For each room a point inside that the robot can reach: x, y, z in metres, world
            frame.
        start: The room in which the robot is at first.
        recharge_rooms: Rooms with a charging station.
        closed: Doors that are closed at present.
    """

    rooms: Mapping[str, tuple[str, ...]]
    positions: Mapping[str, Position]
    start: str
    recharge_rooms: tuple[str, ...] = ()
    closed: frozenset[str] = frozenset()
    _sides: dict[str, tuple[str, ...]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        sides: dict[str, tuple[str, ...]] = {}
        for room, doors in self.rooms.items():
            for door in doors:
                sides[door] = (*sides.get(door, ()), room)
        object.__setattr__(self, '_sides', sides)

    @property
    def doors(self) -> Mapping[str, tuple[str, ...]]:
        """The rooms on the sides of each door."""
        return self._sides

    def reachable(self, start: str) -> set[str]:
        """Return the rooms that doors join with ``start``, itself included, also closed doors."""
        seen = {start}
        queue = [start]
        while queue:
            beside = {other for door in self.rooms[queue.pop()] for other in self._sides[door]}
            queue += beside - seen
            seen |= beside
        return seen

    def with_room(self, name: str, position: Iterable[float], doors: Sequence[str]) -> Place:
        """Return the place with a new room, or with further doors for a room that exists.

        A new door joins two rooms once both have it, so it may lead nowhere for the moment.

        Raises:
            PlaceError: A name that cannot be used, a position that is no point, no doors.
        """
        where = ('map', name)
        _check_name(where, 'room', name)
        point = _position(('room_positions', name), list(position))
        if name in self._sides:
            raise PlaceError(where, 'already the name of a door')
        if not doors:
            raise PlaceError(where, 'has no doors, expected at least one')
        _check_doors(where, doors, self.rooms)
        if name in doors:
            raise PlaceError(where, f"'{name}' is the room itself, expected the names of doors")
        known = self.rooms.get(name, ())
        if name in self.rooms and all(door in known for door in doors):
            raise PlaceError(where, f'exists already with {_list("door", doors)}')
        rooms = {**self.rooms, name: tuple(dict.fromkeys((*known, *doors)))}
        place = replace(self, rooms=rooms, positions={**self.positions, name: point})
        for door in doors:
            if len(place._sides[door]) > 2:
                raise PlaceError(
                    where, f"door '{door}' already joins {' and '.join(self._sides[door])}"
                )
        return place

    def without_room(self, name: str) -> Place:
        """Return the place without a room; its doors stay where other rooms have them.

        Raises:
            PlaceError: The room is unknown, holds a charging station, or is the only way to others.
        """
        where = ('map', name)
        if name not in self.rooms:
            raise PlaceError(where, f'no such room, expected {nearest(name, self.rooms)}')
        if name in self.recharge_rooms:
            raise PlaceError(where, 'holds a charging station and cannot be removed')
        if len(self.rooms) == 1:
            raise PlaceError(where, 'is the only room and cannot be removed')
        rooms = {room: doors for room, doors in self.rooms.items() if room != name}
        positions = {room: point for room, point in self.positions.items() if room != name}
        anchor = self.start if self.start != name else next(iter(rooms))
        left = replace(self, rooms=rooms, positions=positions, start=anchor)
        before = self.reachable(anchor)
        cut_off = sorted(before - {name} - left.reachable(anchor))
        if cut_off:
            raise PlaceError(where, f'is the only way to {", ".join(cut_off)}')
        return replace(left, closed=left.closed & frozenset(left.doors))

    def with_door(self, door: str, *, is_open: bool) -> Place:
        """Return the place with a door opened or closed.

        Raises:
            PlaceError: No room has such a door.
        """
        if door not in self._sides:
            raise PlaceError(('door', door), f'no such door, expected {nearest(door, self._sides)}')
        closed = self.closed - {door} if is_open else self.closed | {door}
        return replace(self, closed=closed)


def make_place(rooms: Any, room_positions: Any, robot_room: Any, recharge_rooms: Any = ()) -> Place:
    """Check a description and make the `Place` of it.

    Args:
        rooms: Mapping of room to its list of doors.
        room_positions: Mapping of room to ``[x, y]`` or ``[x, y, z]``, metres, world frame.
        robot_room: Where the robot starts.
        recharge_rooms: Rooms with a charging station.

    Raises:
        PlaceError: The first thing that is wrong, with the parameter it stands in.
    """
    place = _unjoined_place(rooms, room_positions, robot_room, recharge_rooms)
    _check_graph(place)
    return place


def _unjoined_place(rooms: Any, room_positions: Any, robot_room: Any, recharge_rooms: Any) -> Place:
    """Make a place as `make_place`; whether its doors join its rooms is not looked at."""
    checked = _rooms(rooms)
    positions = _positions(room_positions, checked)
    start = _member(('robot_room',), robot_room, checked)
    stations = recharge_rooms
    if not isinstance(stations, list | tuple):
        raise PlaceError(('recharge_rooms',), f'expected a list of rooms, got {_shown(stations)}')
    for station in stations:
        _member(('recharge_rooms',), station, checked)
    if twice := _first_duplicate(stations):
        raise PlaceError(('recharge_rooms',), f"duplicate room '{twice}'")
    return Place(checked, positions, start, tuple(stations))


def description_of(place: Place) -> dict[str, Any]:
    """Return a place as its file says it, without the closed doors."""
    return {
        'map': {room: list(doors) for room, doors in place.rooms.items()},
        'room_positions': {room: list(point) for room, point in place.positions.items()},
        'robot_room': place.start,
        'recharge_rooms': list(place.recharge_rooms),
    }


def edited_place(description: Mapping[str, Any]) -> Place:
    """Make the place that `description_of` described, whose new doors may lead nowhere yet.

    Raises:
        PlaceError: A name, a position or a list is none.
    """
    return _unjoined_place(*_parts(description))


def place_from(parameters: Mapping[str, Any]) -> Place:
    """Check what a place's file says of its rooms, and make the `Place` of it; see `make_place`."""
    return make_place(*_parts(parameters))


def _parts(described: Mapping[str, Any]) -> tuple[Any, Any, Any, Any]:
    return (
        described.get('map'),
        described.get('room_positions'),
        described.get('robot_room'),
        described.get('recharge_rooms', ()),
    )


def tables_of(parameters: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """Return the parameters that describe a place with the entries of each table together.

    Raises:
        PlaceError: A table is given as a single value.
    """
    described: dict[str, Any] = {}
    for name, value in parameters:
        table, _, entry = name.partition('.')
        if table not in PLACE_TABLES:
            described[name] = value
        elif entry:
            described.setdefault(table, {})[entry] = value
        else:
            hint = "; a map's file is map_file: NAME" if table == 'map' else ''
            raise PlaceError((table,), f'got {_shown(value)}, expected NAME: [...] for each{hint}')
    if 'stations' in described:
        described['stations'] = nested(described['stations'])
    return described


def nested(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return entries like `E.pose` and `E.rate` together, by their first part."""
    found: dict[str, Any] = {}
    for name, value in entries.items():
        first, dot, rest = name.partition('.')
        if not dot:
            found[first] = value
        elif isinstance(inner := found.setdefault(first, {}), dict):
            inner[rest] = value
    return found


def _rooms(rooms: Any) -> dict[str, tuple[str, ...]]:
    if not isinstance(rooms, Mapping) or not rooms:
        raise PlaceError(('map',), f'expected rooms with their doors, got {_shown(rooms)}')
    checked: dict[str, tuple[str, ...]] = {}
    for room, doors in rooms.items():
        where = ('map', str(room))
        _check_name(where, 'room', room)
        if not isinstance(doors, list | tuple) or not doors:
            raise PlaceError(where, f'expected a list of at least one door, got {_shown(doors)}')
        _check_doors(where, doors, rooms)
        checked[room] = tuple(doors)
    return checked


def _check_doors(where: KeyPath, doors: Sequence[Any], rooms: Mapping[str, Any]) -> None:
    for door in doors:
        _check_name(where, 'door', door)
        if door in rooms:
            raise PlaceError(where, f"door '{door}' has the name of a room")
    if twice := _first_duplicate(doors):
        raise PlaceError(where, f"duplicate door '{twice}'")


def _positions(positions: Any, rooms: Mapping[str, Any]) -> dict[str, Position]:
    if not isinstance(positions, Mapping):
        raise PlaceError(('room_positions',), f'expected room: [x, y], got {_shown(positions)}')
    for room in positions:
        if room not in rooms:
            expected = nearest(str(room), rooms)
            raise PlaceError(('room_positions', str(room)), f'no such room, expected {expected}')
    checked: dict[str, Position] = {}
    for room in rooms:
        if room not in positions:
            raise PlaceError(('room_positions',), f"no position for room '{room}'")
        checked[room] = _position(('room_positions', room), positions[room])
    return checked


def _position(where: KeyPath, value: Any) -> Position:
    numbers = isinstance(value, list | tuple) and all(
        isinstance(part, int | float) and not isinstance(part, bool) and math.isfinite(part)
        for part in value
    )
    if not numbers or len(value) not in (2, 3):
        raise PlaceError(where, f'expected [x, y] in metres, got {_shown(value)}')
    x, y, z = (*map(float, value), 0.0)[:3]
    return x, y, z


def _check_graph(place: Place) -> None:
    for door, sides in place.doors.items():
        where = ('map', sides[0])
        if len(sides) == 1 and len(place.rooms) == 1:
            continue  # the door of the only room leads out of the place
        if len(sides) == 1:
            raise PlaceError(where, f"door '{door}' is in only one place, {sides[0]}; expected two")
        if len(sides) > 2:
            raise PlaceError(
                where, f"door '{door}' is in {len(sides)} places, {', '.join(sides)}; expected two"
            )
    missing = sorted(set(place.rooms) - place.reachable(place.start))
    if missing:
        raise PlaceError(('map', missing[0]), f"cannot be reached from the start '{place.start}'")


def _member(where: KeyPath, room: Any, rooms: Mapping[str, Any]) -> str:
    if not isinstance(room, str) or room not in rooms:
        raise PlaceError(where, f'no room {_shown(room)}, expected {nearest(str(room), rooms)}')
    return room


def problem_in_name(kind: str, name: Any) -> str:
    """Return what keeps a value from being the name of a room or a door; empty when nothing
    does.
    """
    if isinstance(name, str) and _NAME.match(name):
        return ''
    hint = '' if isinstance(name, str) else '; quote it'
    expected = 'expected letters, digits, _ and -, not a digit first'
    return f'{kind} name {_shown(name)}: {expected}{hint}'


def _check_name(where: KeyPath, kind: str, name: Any) -> None:
    if problem := problem_in_name(kind, name):
        raise PlaceError(where, problem)


def _first_duplicate(names: Sequence[str]) -> str | None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + '...'


def _list(what: str, names: Sequence[str]) -> str:
    return f'{what}{"s" if len(names) > 1 else ""} {", ".join(names)}'
