"""A place as the parameters of a node describe it: declared, read and checked.

What the parameters mean is said by `floor_plans`; errors name the node.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from floor_plans import Door, PatrolRules, Place, PlaceError, Station, Zones
from floor_plans.parameters import (
    PATROL_TABLES,
    ZONE_TABLES,
    make_place,
    nested,
    patrol_rules,
    stations_of,
    zones_from,
)
from floor_plans.shapes import Segment
from lidar_navigation.geometry import Points
from strict_files.settings import parameter
from surveillance_runtime import parameter_checks
from surveillance_runtime.parameters import ParameterError, ParameterHost


@dataclass(frozen=True)
class PlaceSettings:
    """Parameters of the place that describe no room."""

    map_source: str = parameter(
        'configuration',
        'Where the map comes from: the parameters, or the markers that the robot finds.',
        choices=('configuration', 'markers'),
    )
    robot_room: str = parameter(
        '', 'Room in which the robot starts; empty with markers: the one nearest to it.'
    )
    recharge_rooms: tuple[str, ...] = parameter(
        (), 'Rooms with a charging station; they are never removed.', of=str
    )


def described_place(
    node: ParameterHost, source: str = 'configuration', *, required: bool = False
) -> Place | None:
    """Declare where the map comes from, and make the place that the parameters describe.

    Args:
        node: The node.
        source: Default of the parameter `map_source`.
        required: Whether the parameters must describe one if that is where the map comes from.

    Returns:
        None when the map comes from markers, or when none is described and none required.

    Raises:
        ParameterError: A parameter is of the wrong type, or what is described is not a place.
    """
    settings = node.declare_fields(PlaceSettings(source))
    if settings.map_source == 'markers':
        return None
    rooms, positions = node.parameters_under('map'), node.parameters_under('room_positions')
    if not rooms and not positions and not required:
        return None
    try:
        return make_place(rooms, positions, settings.robot_room, settings.recharge_rooms)
    except PlaceError as error:
        raise ParameterError(f'{node.get_name()}: parameter {error}') from None


@dataclass(frozen=True)
class CalendarSettings:
    """Parameters of the place's calendar that are no table."""

    keep_out: tuple[str, ...] = parameter((), 'Places that the robot never enters.', of=str)
    quiet_hours: str = parameter(
        '', 'When the robot stays at its station, such as `daily 22:00-06:00`; empty: never.'
    )
    time_zone: str = parameter(
        '', 'Time zone of the hours, such as `Europe/Rome`; empty: that of the machine.'
    )


def described_patrol_rules(node: ParameterHost) -> PatrolRules:
    """Declare what holds for single places, and read it.

    Raises:
        ParameterError: What is described is wrong.
    """
    settings = node.declare_fields(CalendarSettings())
    described: dict[str, Any] = {key: node.parameters_under(key) for key in PATROL_TABLES}
    described |= {
        'keep_out': settings.keep_out,
        'quiet_hours': settings.quiet_hours,
        'time_zone': settings.time_zone,
    }
    try:
        return patrol_rules(described)
    except PlaceError as error:
        raise ParameterError(f'{node.get_name()}: parameter {error}') from None


@dataclass(frozen=True)
class _Single:
    station: tuple[float, ...] = parameter(
        (),
        'Pose of the station of the only recharge room: x, y in metres, yaw in rad, world frame; '
        'empty: at the point of that room. Several stand in `stations.ROOM.pose`, with '
        '`stations.ROOM.rate` (percent a minute) and `stations.ROOM.dock` beside it.',
        of=float,
        check=parameter_checks.pose_or_none,
    )


@dataclass(frozen=True)
class _RechargeRooms:
    recharge_rooms: tuple[str, ...] = parameter((), 'Places with a charging station.', of=str)


def described_stations(
    node: ParameterHost, recharge_rooms: Sequence[str] | None = None
) -> dict[str, Station]:
    """Declare the stations of the place, and read them.

    Args:
        node: The node.
        recharge_rooms: The rooms with a station, where the node has declared them; None: it has
            not.

    Returns:
        The station of each room that has one; of a room without a name where the pose alone is
        given. Empty where the parameters say nothing of any.

    Raises:
        ParameterError: What is described is wrong.
    """
    if recharge_rooms is None:
        recharge_rooms = node.declare_fields(_RechargeRooms()).recharge_rooms
    described = {
        'recharge_rooms': recharge_rooms,
        'station': list(node.declare_fields(_Single()).station),
        'stations': nested(node.parameters_under('stations')),
    }
    try:
        return stations_of(described, node.parameters_under('room_positions'))
    except PlaceError as error:
        raise ParameterError(f'{node.get_name()}: parameter {error}') from None


def door_segments(node: ParameterHost) -> dict[str, Segment]:
    """Declare and read the doors of the place, `doors.NAME: [x, y, yaw, width]`.

    Raises:
        ParameterError: A door is not four numbers.
    """
    try:
        return door_segments_of({'doors': node.parameters_under('doors')})
    except ValueError as error:
        raise ParameterError(f'parameter {error}') from None


def place_positions(node: ParameterHost) -> dict[str, Points]:
    """Declare and read the places' points, `room_positions.NAME: [x, y]`.

    Raises:
        ParameterError: A position is not two or three numbers.
    """
    try:
        return positions_of({'room_positions': node.parameters_under('room_positions')})
    except ValueError as error:
        raise ParameterError(f'parameter {error}') from None


def place_zones(node: ParameterHost) -> Zones:
    """Declare and read the zones of the place.

    Raises:
        ParameterError: A zone is none.
    """
    try:
        return zones_from({table: node.parameters_under(table) for table in ZONE_TABLES})
    except PlaceError as error:
        raise ParameterError(f'parameter {error}') from None


def door_segments_of(described: Mapping[str, Any]) -> dict[str, Segment]:
    """Return where the doors are that a place's parameters describe.

    Raises:
        ValueError: A door is not four numbers.
    """
    doors = described.get('doors') or {}
    for name, values in doors.items():
        if not _are_numbers(values, 4):
            raise ValueError(f'doors.{name}: got {values}, expected [x, y, yaw, width]')
    return {name: Door(name, *values).segment for name, values in doors.items()}


def positions_of(described: Mapping[str, Any]) -> dict[str, Points]:
    """Return the places' points that a place's parameters describe.

    Raises:
        ValueError: A position is not two or three numbers.
    """
    points = described.get('room_positions') or {}
    for name, values in points.items():
        if not (_are_numbers(values, 2) or _are_numbers(values, 3)):
            raise ValueError(f'room_positions.{name}: got {values}, expected [x, y]')
    return {name: np.array([*at, 0.0][:3], dtype=float) for name, at in points.items()}


def _are_numbers(values: object, count: int) -> bool:
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(v, int | float) and math.isfinite(v) for v in values)
    )
