"""The changes that a person makes to a place, each on what the place's file says.

An operation takes a draft, whose tables it may change, and its own fields; it returns one line that
says what was done, or raises a `ValueError` with one line. Whether the changed place is sound is
looked at by the editor, as the file is when it is read.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from floor_plans.editor.measures import (
    cut_of,
    door_on_wall,
    fitted_door,
    free_point,
    sides_of,
)
from floor_plans.floor_plan import Door, FloorPlan
from floor_plans.room_map import RoomMap
from floor_plans.rooms import PATROL_TABLES, ROOM_LISTS, problem_in_name
from strict_files.suggestions import nearest

_ROOM_TABLES = ('map', 'room_positions', 'stations', *PATROL_TABLES)
_NEW_DOOR = 0.9
"""Width of a new door in a wall, metres."""
ZONE_KINDS = {'keep_out': 'keep_out_zones', 'slow': 'slow_zones'}


@dataclass(frozen=True)
class Draft:
    """A place that is being changed.

    Attributes:
        described: What its file says below `ros__parameters`; may be changed.
        renamed: Entries that have another name now, by table and name: the one in the file.
        plan: The place before the change.
        regions: Its rooms.
        radius: Of the robot, metres.
    """

    described: dict[str, Any]
    renamed: dict[tuple[str, str], str]
    plan: FloorPlan
    regions: RoomMap
    radius: float

    def table(self, name: str) -> dict[str, Any]:
        """Return a table of the file, made if it is not there."""
        found: dict[str, Any] = self.described.setdefault(name, {})
        return found

    def put(self, key: str, value: Any) -> None:
        """Set a value that is no table; None or nothing takes it out."""
        if value in (None, '', []):
            self.described.pop(key, None)
        else:
            self.described[key] = value


def cut(
    draft: Draft,
    x1: float,
    y1: float,
    x2: float,
    y2: float,
    name: str = '',
    door: str = '',
    x: float | None = None,
    y: float | None = None,
) -> str:
    """Cut the room that a line runs through in two.

    The new part and the door get the next free names, unless they are given; a point x, y says
    which part is the new one.
    """
    if not draft.plan.is_enclosed:
        raise ValueError('a place with neither walls nor a map cannot be cut: add rooms by hand')
    found = cut_of(draft.plan, draft.regions, (x1, y1), (x2, y2), draft.radius)
    grid, room = draft.regions.grid, found.room
    name = name or _next_name('R', _names(draft))
    line = door or _next_name('D', {*_names(draft), name})
    for kind, new in (('room', name), ('door', line)):
        if new in _names(draft):
            raise ValueError(f"there is a '{new}' already")
        if problem := problem_in_name(kind, new):
            raise ValueError(problem)
    own, other = found.own, found.other
    if x is not None and y is not None and grid.at(own, x, y):
        own, other = other, own
    parts = {room: own, name: other}
    rooms, positions = draft.table('map'), draft.table('room_positions')
    doors: dict[str, list[str]] = {room: [], name: []}
    for each in draft.plan.place.rooms[room]:
        known = draft.plan.doors.get(each)
        side = room if known is None else sides_of(known, parts, grid)
        doors[side].append(each)
    if not grid.at(own, *draft.plan.place.positions[room][:2]):
        positions[room] = _rounded(*free_point(grid, own, draft.radius))
    positions[name] = _rounded(*free_point(grid, other, draft.radius))
    rooms[room], rooms[name] = [*doors[room], line], [*doors[name], line]
    draft.table('doors')[line] = _row(found.door)
    if draft.plan.walls and draft.plan.map is None:
        wall = _next_name('W', draft.plan.walls)
        start, end = found.door.ends
        draft.table('walls')[wall] = [*_rounded(*start), *_rounded(*end)]
        # So that the file's rounded ends are the door's.
        (x1, y1), (x2, y2) = (_rounded(*end) for end in (start, end))
        width = round(math.dist((x1, y1), (x2, y2)), 3)
        yaw = math.atan2(y2 - y1, x2 - x1)
        middle = [round((x1 + x2) / 2, 4), round((y1 + y2) / 2, 4)]
        draft.table('doors')[line] = [*middle, round(yaw, 6), width]
    _keep_station(draft, parts)
    return f'{room} is cut: the new part is {name}, joined by {line}'


def join(draft: Draft, first: str, second: str) -> str:
    """Make one room of two that a door joins; it keeps the name and the point of the first."""
    _member('room', first, draft.table('map'))
    _member('room', second, draft.table('map'))
    if first == second:
        raise ValueError(f'{first} and {second} are one room: expected two')
    rooms = draft.table('map')
    between = [door for door in rooms[first] if door in rooms[second]]
    if not between:
        beside = sorted(
            room for room in rooms if room != first and set(rooms[room]) & set(rooms[first])
        )
        raise ValueError(
            f'no door joins {first} and {second}: expected one of {", ".join(beside) or "none"}'
        )
    rooms[first] = [door for door in [*rooms[first], *rooms.pop(second)] if door not in between]
    for door in between:
        _open_for_good(draft, door)
        draft.table('doors').pop(door, None)
    if 'stations' in draft.described and second in (stations := draft.table('stations')):
        if first in stations:
            raise ValueError(f'{first} and {second} both have a charging station: remove one first')
        stations[first] = stations[second]
    for table in _ROOM_TABLES[1:]:
        draft.table(table).pop(second, None)
    if draft.described.get('robot_room') == second:
        draft.described['robot_room'] = first
    for key in ROOM_LISTS:
        if second in (listed := list(draft.described.get(key) or ())):
            draft.put(
                key, list(dict.fromkeys(first if each == second else each for each in listed))
            )
    return f'{second} is a part of {first}'


def join_at(draft: Draft, name: str) -> str:
    """Make one room of the two that a door joins; it keeps the larger one's name."""
    _member('door', name, draft.plan.place.doors)
    rooms = draft.plan.place.doors[name]
    if len(rooms) != 2:
        raise ValueError(f'{name} joins {", ".join(rooms) or "nothing"}: expected two rooms')
    size = {room: int(draft.regions.mask(room).sum()) for room in rooms}
    first, second = sorted(rooms, key=lambda room: -size[room])
    return join(draft, first, second)


def remove_room(draft: Draft, room: str) -> str:
    """Take a room out of the place, with its doors, which lead nowhere then; its floor stays."""
    draft.plan.place.without_room(room)  # which says why it cannot go
    rooms = draft.table('map')
    gone = rooms.pop(room)
    for other, doors in rooms.items():
        rooms[other] = [door for door in doors if door not in gone]
    for door in gone:
        draft.table('doors').pop(door, None)
    for table in _ROOM_TABLES[1:]:
        draft.table(table).pop(room, None)
    for key in ROOM_LISTS:
        draft.put(key, [each for each in draft.described.get(key) or () if each != room])
    if draft.described.get('robot_room') == room:
        draft.described['robot_room'] = next(iter(rooms))
    return f'{room} is removed'


def _open_for_good(draft: Draft, name: str) -> None:
    """Take a door's opening out of the walls: what remains of them stands on both sides."""
    door = draft.plan.doors.get(name)
    if door is None:
        return
    walls = draft.table('walls')
    for wall in draft.plan.walls_of(door):
        row = walls.pop(wall.name)
        length = wall.length
        dx, dy = (wall.end[0] - wall.start[0]) / length, (wall.end[1] - wall.start[1]) / length
        along = sorted(
            (end[0] - wall.start[0]) * dx + (end[1] - wall.start[1]) * dy for end in door.ends
        )
        pieces = []
        if along[0] > 0.15:
            pieces.append([*row[:2], *_rounded(row[0] + dx * along[0], row[1] + dy * along[0])])
        if length - along[1] > 0.15:
            pieces.append([*_rounded(row[0] + dx * along[1], row[1] + dy * along[1]), *row[2:]])
        for number, piece in enumerate(pieces):
            walls[wall.name if number == 0 else _next_name(f'{wall.name}_', walls)] = piece


def move_door(draft: Draft, name: str, x: float, y: float) -> str:
    """Move a door: it takes the opening of the map, or the wall, that is there."""
    _member('door', name, draft.table('doors'))
    door = _door_at(draft, x, y, float(draft.table('doors')[name][3]))
    draft.table('doors')[name] = _row(door)
    return f'{name} is at ({door.x:.2f}, {door.y:.2f}), {door.width:.2f} m wide'


def _door_at(draft: Draft, x: float, y: float, width: float) -> Door:
    if draft.plan.map is not None:
        return fitted_door(draft.plan.grid(), x, y)
    if draft.plan.walls:
        return door_on_wall(draft.plan, x, y, width)
    return Door('', x, y, 0.0, width)


def set_door(draft: Draft, name: str, x: float, y: float, yaw: float, width: float) -> str:
    """Give a door by its numbers."""
    _member('door', name, draft.plan.place.doors)
    draft.table('doors')[name] = [round(each, 4) for each in (x, y, yaw, width)]
    return f'{name} is {width:.2f} m wide'


def add_door(draft: Draft, x: float, y: float) -> str:
    """Put a door where two rooms meet."""
    door = _door_at(draft, x, y, _NEW_DOOR)
    across = (-math.sin(door.yaw), math.cos(door.yaw))
    sides: list[str] = []
    for towards in (-1.0, 1.0):
        found = [
            draft.regions.room_at(
                door.x + towards * away * across[0], door.y + towards * away * across[1]
            )
            for away in (0.12, 0.3, 0.5)
        ]
        sides.append(next((room for room in found if room), 'no room'))
    if 'no room' in sides or sides[0] == sides[1]:
        raise ValueError(f'between {" and ".join(sides)}: expected it between two rooms')
    name = _next_name('D', _names(draft))
    draft.table('doors')[name] = _row(door)
    for room in sides:
        draft.table('map')[room] = [*draft.table('map')[room], name]
    return f'{name} joins {sides[0]} and {sides[1]}'


def remove_door(draft: Draft, name: str) -> str:
    """Take a door away; what it joined needs another one."""
    _member('door', name, draft.plan.place.doors)
    for room, doors in draft.table('map').items():
        draft.table('map')[room] = [door for door in doors if door != name]
    draft.table('doors').pop(name, None)
    return f'{name} is removed'


def wall_off(draft: Draft, name: str) -> str:
    """Close a door by a wall; each of its rooms needs another one."""
    door = draft.plan.doors.get(name)
    if door is None:
        raise ValueError(f'{name} stands nowhere: expected a door with a position')
    remove_door(draft, name)
    # A little longer than the opening, so that no gap remains beside it.
    (x1, y1), (x2, y2) = door.ends
    more = min(1.0, 0.1 / max(door.width, 0.1))
    dx, dy = more * (x2 - x1), more * (y2 - y1)
    wall = _next_name('W', draft.table('walls'))
    draft.table('walls')[wall] = [*_rounded(x1 - dx, y1 - dy), *_rounded(x2 + dx, y2 + dy)]
    return f'{name} is a wall'


def take_part(draft: Draft, x: float, y: float) -> str:
    """Make a room of the part of the floor around a point; the walls that close it become doors."""
    grid, regions = draft.regions.grid, draft.regions
    parts = [each for each in regions.left_out() if grid.at(each.cells, x, y)]
    if not parts:
        there = regions.room_at(x, y) or 'no part of the floor'
        raise ValueError(f'({x:.2f}, {y:.2f}) lies in {there}: expected a part that is no room')
    part = parts[0]
    if not part.gaps:
        raise ValueError(f'{part.reason(draft.plan)}: the robot cannot get in from any room')
    point = free_point(grid, part.cells, draft.radius)
    room = _next_name('R', _names(draft))
    doors: list[str] = []
    for wall_name, beside in part.gaps.items():
        wall = draft.plan.walls[wall_name]
        (x1, y1), (x2, y2) = wall.start, wall.end
        name = _next_name('D', {*_names(draft), *doors})
        yaw = math.atan2(y2 - y1, x2 - x1)
        door = Door(name, (x1 + x2) / 2, (y1 + y2) / 2, yaw, wall.length)
        if door.width <= 2 * draft.radius and len(part.gaps) > 1:
            continue  # another way is wider
        del draft.table('walls')[wall_name]
        draft.table('doors')[name] = _row(door)
        draft.table('map')[beside] = [*draft.table('map')[beside], name]
        doors.append(name)
    draft.table('map')[room] = doors
    draft.table('room_positions')[room] = _rounded(*point)
    return f'{room} is a room, joined by {" and ".join(doors)}'


def rename(draft: Draft, kind: str, name: str, new: str) -> str:
    """Give a room, a door, a marker or a zone another name."""
    tables = {
        'room': _ROOM_TABLES,
        'door': ('doors',),
        'marker': ('markers',),
        'zone': tuple(ZONE_KINDS.values()),
    }
    _member('kind', kind, tables)
    known = [each for table in tables[kind] for each in draft.described.get(table, ())]
    if kind == 'door':
        known = list(draft.plan.place.doors)
    _member(kind, name, known)
    if problem := problem_in_name(kind, new):
        raise ValueError(problem)
    if new == name:
        raise ValueError(f'{name} has that name')
    taken = {*known, *(_names(draft) if kind in ('room', 'door') else ())}
    if new in taken:
        raise ValueError(f"there is a '{new}' already")
    for table in tables[kind]:
        entries = draft.described.get(table)
        if isinstance(entries, dict) and name in entries:
            draft.described[table] = {
                new if each == name else each: value for each, value in entries.items()
            }
            draft.renamed[table, new] = draft.renamed.pop((table, name), name)
    if kind == 'door':
        for room, doors in draft.table('map').items():
            draft.table('map')[room] = [new if door == name else door for door in doors]
    if kind == 'room':
        for key in ROOM_LISTS:
            if key in draft.described:
                listed = draft.described[key]
                draft.described[key] = [new if each == name else each for each in listed]
        if draft.described.get('robot_room') == name:
            draft.described['robot_room'] = new
    return f'{name} is {new}'


def move_point(draft: Draft, room: str, x: float, y: float) -> str:
    """Put the point of a room that the robot drives to."""
    _member('room', room, draft.table('map'))
    found = draft.regions.room_at(x, y) if draft.plan.is_enclosed else room
    if found != room:
        raise ValueError(f'({x:.2f}, {y:.2f}) lies in {found or "no room"}: expected {room}')
    draft.table('room_positions')[room] = _rounded(x, y)
    return f"{room}'s point is ({x:.2f}, {y:.2f})"


def move_station(draft: Draft, x: float, y: float, yaw: float = 0.0, room: str = '') -> str:
    """Move a charging station; the room that it then stands in becomes its recharge room.

    Args:
        draft: The draft.
        x, y, yaw: Where the robot stands when it charges, metres and rad.
        room: Whose station it is; needed where there are several.
    """
    stations = _stations(draft)
    there = _room_of_station(draft, x, y)
    before = room or (there if there in stations or len(stations) > 1 else next(iter(stations)))
    _member('station of a room', before, stations)
    if there != before and there in stations:
        raise ValueError(f'{there} has a charging station already')
    pose = [*_rounded(x, y), round(yaw, 4)]
    _put_stations(
        draft,
        {
            there if each == before else each: {**entry, 'pose': pose} if each == before else entry
            for each, entry in stations.items()
        },
    )
    if draft.described.get('robot_room') == before:
        draft.described['robot_room'] = there
    return f'the station is at ({x:.2f}, {y:.2f}), in {there}'


def add_station(draft: Draft, x: float, y: float, yaw: float = 0.0) -> str:
    """Put another charging station."""
    stations, there = _stations(draft), _room_of_station(draft, x, y)
    if there in stations:
        raise ValueError(f'{there} has a charging station already')
    _put_stations(draft, {**stations, there: {'pose': [*_rounded(x, y), round(yaw, 4)]}})
    return f'a station is at ({x:.2f}, {y:.2f}), in {there}'


def remove_station(draft: Draft, room: str) -> str:
    """Take a charging station away; one has to stay."""
    stations = _stations(draft)
    _member('station of a room', room, stations)
    if len(stations) == 1:
        raise ValueError(f'the station in {room} is the only one: move it, or add another first')
    _put_stations(draft, {each: entry for each, entry in stations.items() if each != room})
    return f'the station in {room} is removed'


def _room_of_station(draft: Draft, x: float, y: float) -> str:
    if not draft.plan.is_enclosed:
        positions = draft.plan.place.positions
        return min(positions, key=lambda room: math.dist(positions[room][:2], (x, y)))
    room = draft.regions.room_at(x, y)
    if room is None:
        raise ValueError(f'({x:.2f}, {y:.2f}) lies in no room')
    return room


def _stations(draft: Draft) -> dict[str, dict[str, Any]]:
    """Return the stations as the table `stations` of a file has them."""
    if 'stations' in draft.described:
        return dict(draft.described['stations'])
    return {room: {'pose': list(each.pose)} for room, each in draft.plan.stations.items()}


def _put_stations(draft: Draft, stations: Mapping[str, Mapping[str, Any]]) -> None:
    """Say where the stations are: as the single pose where the file does so, or as the table."""
    draft.described['recharge_rooms'] = list(stations)
    ((_, first), *others) = stations.items()
    if 'stations' not in draft.described and not others and list(first) == ['pose']:
        draft.described['station'] = first['pose']
        return
    draft.described.pop('station', None)
    draft.described['stations'] = {room: dict(entry) for room, entry in stations.items()}


def _keep_station(draft: Draft, parts: Mapping[str, Any]) -> None:
    """Have the station of a room that is cut belong to the part that it stands in."""
    room = next(iter(parts))
    if room not in draft.plan.stations or not {'station', 'stations'} & draft.described.keys():
        return
    x, y, _ = draft.plan.stations[room].pose
    grid = draft.regions.grid
    part = next((name for name, mask in parts.items() if grid.at(mask, x, y)), room)
    stations = _stations(draft)
    _put_stations(
        draft, {part if each == room else each: entry for each, entry in stations.items()}
    )
    if draft.described.get('robot_room') == room:
        draft.described['robot_room'] = part


def set_zone(
    draft: Draft,
    kind: str,
    corners: Sequence[Sequence[float]],
    name: str = '',
    speed: float | None = None,
) -> str:
    """Draw a zone anew, or another one.

    Args:
        draft: The draft.
        kind: keep_out or slow.
        corners: At least three points, metres.
        name: Of the zone; empty: the next one.
        speed: Top speed in a slow zone, m/s.
    """
    _member('kind', kind, ZONE_KINDS)
    taken = {each for table in ZONE_KINDS.values() for each in draft.described.get(table, ())}
    name = name or _next_name('K' if kind == 'keep_out' else 'S', taken)
    flat = [round(float(each), 3) for corner in corners for each in corner]
    for table in ZONE_KINDS.values():
        draft.table(table).pop(name, None)
    if kind == 'slow':
        if speed is None:
            raise ValueError('a slow zone needs a speed in m/s')
        flat = [float(speed), *flat]
    draft.table(ZONE_KINDS[kind])[name] = flat
    return f'zone {name}'


def remove_zone(draft: Draft, name: str) -> str:
    """Take a zone away."""
    tables = [draft.described.get(table, {}) for table in ZONE_KINDS.values()]
    _member('zone', name, [each for table in tables for each in table])
    for table in tables:
        table.pop(name, None)
    return f'{name} is removed'


def set_rule(draft: Draft, room: str, key: str, value: Any) -> str:
    """Set what holds for one room (thresholds, exploration, hours, classes); empty: no own."""
    _member('room', room, draft.table('map'))
    _member('key', key, PATROL_TABLES)
    if value in (None, ''):
        draft.table(key).pop(room, None)
        return f'{room}: {key} as everywhere'
    draft.table(key)[room] = _as_number(value) if key in ('thresholds', 'exploration') else value
    return f'{room}: {key} {value}'


def set_keep_out(draft: Draft, room: str, on: bool) -> str:
    """Have the robot never enter a room, or enter it again."""
    _member('room', room, draft.table('map'))
    listed = [each for each in draft.described.get('keep_out') or () if each != room]
    draft.put('keep_out', [*listed, room] if on else listed)
    return f'{room} is {"not " if on else ""}entered'


def set_sweep(draft: Draft, room: str, on: bool) -> str:
    """Have a visit of a room cover all of it, or only its point."""
    _member('room', room, draft.table('map'))
    listed = [each for each in draft.described.get('sweep') or () if each != room]
    draft.put('sweep', [*listed, room] if on else listed)
    return f'{room} is {"" if on else "not "}swept'


def set_text(draft: Draft, key: str, value: str) -> str:
    """Set `quiet_hours`, `time_zone` or `robot_room`."""
    _member('key', key, ('quiet_hours', 'time_zone', 'robot_room'))
    draft.put(key, value)
    return f'{key} {value or "as by default"}'


def set_marker(
    draft: Draft, id: int, x: float, y: float, z: float, yaw: float, name: str = ''
) -> str:
    """Put a marker on a wall, or move it."""
    name = name or _next_name('M', draft.described.get('markers', {}))
    if problem := problem_in_name('marker', name):
        raise ValueError(problem)
    draft.table('markers')[name] = [id, *(round(each, 4) for each in (x, y, z, yaw))]
    return f'marker {name} is at ({x:.2f}, {y:.2f})'


def remove_marker(draft: Draft, name: str) -> str:
    """Take a marker away."""
    _member('marker', name, draft.described.get('markers', {}))
    draft.table('markers').pop(name)
    return f'{name} is removed'


OPERATIONS: Mapping[str, Callable[..., str]] = {
    each.__name__: each
    for each in (
        *(cut, join, join_at, take_part, remove_room, rename, move_point),
        *(move_door, set_door, add_door, remove_door, wall_off),
        *(move_station, add_station, remove_station),
        *(
            set_zone,
            remove_zone,
            set_rule,
            set_keep_out,
            set_sweep,
            set_text,
            set_marker,
            remove_marker,
        ),
    )
}
"""Every change by its name."""
_TYPES: Mapping[str, type] = {
    **dict.fromkeys(('x', 'y', 'x1', 'y1', 'x2', 'y2', 'yaw', 'width', 'z', 'speed'), float),
    **dict.fromkeys(('name', 'new', 'room', 'first', 'second', 'kind', 'key', 'door'), str),
    'on': bool,
    'id': int,
}


def checked_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of an operation with numbers as numbers.

    Raises:
        ValueError: One is of another type, or not finite.
    """
    found: dict[str, Any] = {}
    for name, value in fields.items():
        kind = _TYPES.get(name)
        if kind is float and value is not None:
            value = _as_number(value, name)
        elif kind is int:
            number = _as_number(value, name)
            if number != int(number):
                raise ValueError(f'{name} {value!r}: expected a whole number')
            value = int(number)
        elif kind in (str, bool) and not isinstance(value, kind):
            raise ValueError(f'{name} {value!r:.60}: expected {kind.__name__}')
        elif name == 'corners':
            value = _as_corners(value)
        found[name] = value
    return found


def _as_corners(value: Any) -> list[list[float]]:
    if not isinstance(value, list) or not all(
        isinstance(corner, list) and len(corner) == 2 for corner in value
    ):
        raise ValueError('corners: expected [[x, y], ...] in metres')
    return [[_as_number(each, 'corners') for each in corner] for corner in value]


def _as_number(value: Any, name: str = '') -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if isinstance(value, bool) or not math.isfinite(number):
        raise ValueError(f'{name} {value!r:.60}: expected a number'.strip())
    return number


def _names(draft: Draft) -> set[str]:
    return {*draft.plan.place.rooms, *draft.plan.place.doors}


def _next_name(letter: str, taken: Any) -> str:
    number = 1
    while f'{letter}{number}' in taken:
        number += 1
    return f'{letter}{number}'


def _member(kind: str, name: str, known: Any) -> None:
    if name not in known:
        raise ValueError(f'no {kind} {name!r}: expected {nearest(str(name), list(known))}')


def _row(door: Door) -> list[float]:
    return [*_rounded(door.x, door.y), round(door.yaw, 4), round(door.width, 3)]


def _rounded(x: float, y: float) -> list[float]:
    return [round(float(x), 3), round(float(y), 3)]
