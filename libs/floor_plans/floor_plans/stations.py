"""The charging stations of a place: where each stands, what docks the robot, how fast it charges.

A place with one recharge room may give its pose alone, as `station`, or nothing: then the station
is at the room's point. Where there are several, `stations` has an entry for each room.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from floor_plans.rooms import PlaceError
from floor_plans.shapes import Pose
from strict_files.suggestions import nearest
from strict_files.yaml_file import KeyPath

AT_STATION = '/station'
"""Behind the name of a room: its charging station, where a place is asked for by its name."""
FASTEST = 6000.0
"""Percent a minute: a charge in a second."""
_FIELDS = ('pose', 'rate', 'dock')


@dataclass(frozen=True)
class Station:
    """A charging station.

    Attributes:
        pose: Where the robot stands when it charges.
        rate: Percent of the charge in a minute, while it charges at full power; None: not known.
        dock: Its name in the docking server's database; empty: it is docked at by its pose.
        where: The parameter that its pose stands in.
    """

    pose: Pose
    rate: float | None = None
    dock: str = ''
    where: KeyPath = field(default=('station',), compare=False)


def station_at(
    point: tuple[float, float], stations: Mapping[str, Station], reach: float
) -> Station | None:
    """Return the nearest station within so many metres of a point; None: there is none."""

    def away(station: Station) -> float:
        return math.dist(point, station.pose[:2])

    found = min(stations.values(), key=away, default=None)
    return found if found is not None and away(found) <= reach else None


def stations_of(
    described: Mapping[str, Any], positions: Mapping[str, Sequence[float]], start: str = ''
) -> dict[str, Station]:
    """Check what is said of the stations, and return the station of each room that has one.

    Args:
        described: The parameters `station`, `stations` and `recharge_rooms`; each may be missing.
        positions: A point in each room; empty: the rooms are not known.
        start: The room whose station is meant where there is no recharge room.

    Raises:
        PlaceError: What is said is wrong, or a recharge room has no station.
    """
    rooms: Sequence[str] = described.get('recharge_rooms') or ()
    table, single = described.get('stations') or {}, described.get('station')
    has_single = isinstance(single, int | float | str) or bool(single)  # a node's is [] for none
    if table:
        if has_single:
            raise PlaceError(
                ('station',), 'expected either this, of the only recharge room, or stations'
            )
        if not isinstance(table, Mapping):
            raise PlaceError(('stations',), f'got {table!r}, expected ROOM: {{pose: [x, y, yaw]}}')
        found = {str(room): _station(str(room), entry, positions) for room, entry in table.items()}
        for room in rooms:
            if room not in found:
                raise PlaceError(
                    ('recharge_rooms',),
                    f"room '{room}' has no station: expected an entry stations.{room}, as for "
                    f'{", ".join(found)}',
                )
        if not rooms:
            raise PlaceError(
                ('stations',), f'expected recharge_rooms, such as [{", ".join(found)}]'
            )
        return found
    for room in rooms[1:]:
        # `station` is the pose of one; at the point of any other room nothing charges the robot.
        raise PlaceError(
            ('recharge_rooms',),
            f"room '{room}' has no station: expected [{rooms[0]}] alone, or stations with an entry "
            'for each',
        )
    home = rooms[0] if rooms else start
    if has_single:
        return {home: Station(_pose(single, 'station'))}
    if home not in positions:
        return {}
    x, y = map(float, positions[home][:2])
    return {home: Station((x, y, 0.0))}


def stations_in(described: Mapping[str, Any]) -> dict[str, Station]:
    """Return the stations of all of a place's parameters.

    Raises:
        PlaceError: As `stations_of`.
    """
    positions = described.get('room_positions') or {}
    start = str(described.get('robot_room') or next(iter(positions), ''))
    return stations_of(described, positions, start)


def _station(room: str, entry: Any, positions: Mapping[str, Any]) -> Station:
    where = ('stations', room)
    if positions and room not in positions:
        raise PlaceError(where, f'no such room, expected {nearest(room, positions)}')
    if not isinstance(entry, Mapping):
        raise PlaceError(where, f'got {entry!r}, expected {{pose: [x, y, yaw]}}')
    for key in entry:
        if key not in _FIELDS:
            raise PlaceError((*where, str(key)), f'unknown, expected {nearest(str(key), _FIELDS)}')
    if 'pose' not in entry:
        raise PlaceError(where, 'has no pose: expected {pose: [x, y, yaw]}')
    rate, dock = entry.get('rate'), entry.get('dock', '')
    if rate is not None and not (_is_number(rate) and 0.0 < rate <= FASTEST):
        raise PlaceError(
            (*where, 'rate'), f'{rate!r}: expected percent a minute, above 0, at most {FASTEST:g}'
        )
    if not isinstance(dock, str):
        raise PlaceError((*where, 'dock'), f"{dock!r}: expected the dock's name")
    pose = _pose(entry['pose'], *where, 'pose')
    return Station(pose, None if rate is None else float(rate), dock, (*where, 'pose'))


def _pose(value: Any, *where: str) -> Pose:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise PlaceError(where, f'{value!r}: expected [x, y, yaw]')
    for part in value:
        if not _is_number(part):
            raise PlaceError(where, f'{part!r}: expected a number')
    x, y, yaw = map(float, value)
    return x, y, yaw


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
