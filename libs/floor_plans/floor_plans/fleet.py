"""The robots of a place: where each starts, where it charges, what it is.

A place's file may name them in the table `robots`; for a number of robots alone, names and starts
are made up: `robot1`, `robot2`, ... beside one another at the station, which they share.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from floor_plans.floor_plan import FloorPlan
from floor_plans.occupancy_grid import Grid, distance_to
from floor_plans.room_map import RoomMap
from floor_plans.rooms import PlaceError, nested
from floor_plans.shapes import Pose
from strict_files.suggestions import nearest

MOST_ROBOTS = 100
LONGEST_NAME = 60
"""Letters of a robot's name: it is a folder, and a part of each of its names in ROS."""
_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*\Z')
_KEYS = ('start', 'dock', 'profile')
_WORDS = ('all', 'shared')
"""What commands and options call several robots, and the programs that they share."""
_APART = 0.6
"""Metres between the bodies of two robots that start beside one another."""
_FROM_WALL = 0.3
"""Metres between such a robot and a wall."""
_PASSING = 0.2
"""Metres that two robots need between them and on both sides in order to pass."""


@dataclass(frozen=True)
class FleetMember:
    """One robot of a place.

    Attributes:
        name: Its name: its namespace, and its individual in the ontology.
        start: Where it starts: x, y in metres, yaw in rad, world frame.
        dock: The room in which it charges; empty: any with a station. Robots queue for a station.
        profile: The name or file of its profile; empty: that of the run.
    """

    name: str
    start: Pose
    dock: str = ''
    profile: str = ''


def problem_in_robot_name(name: str, reserved: Collection[str] = ()) -> str:
    """Return what is wrong with the name of a robot of a fleet; nothing: ''.

    Args:
        name: The name.
        reserved: Names that stand for other things, such as those of programs.
    """
    if not _NAME.match(name):
        return 'expected a name of letters, digits and _, like robot1'
    if len(name) > LONGEST_NAME:
        return f'has {len(name)} letters: expected at most {LONGEST_NAME}'
    if name in _WORDS or name in reserved:
        return f'stands for other things: expected another name than {name}'
    return ''


def members_of(
    described: Mapping[str, Any], plan: FloorPlan, reserved: Collection[str] = ()
) -> tuple[FleetMember, ...]:
    """Return the robots that a place's parameters name in the table `robots`; none: ().

    Args:
        described: The parameters, with `robots` as a table of `NAME.KEY`.
        plan: The place.
        reserved: Names that no robot may have.

    Raises:
        PlaceError: An entry is wrong.
    """
    tables = nested(dict(described.get('robots') or {}))
    members: list[FleetMember] = []
    for name, table in tables.items():
        where = ('robots', name)
        if problem := problem_in_robot_name(name, reserved):
            raise PlaceError(where, problem)
        if name in plan.place.rooms or name in plan.doors:
            raise PlaceError(where, 'is the name of a room or a door: expected another one')
        if not isinstance(table, Mapping):
            raise PlaceError(where, f'expected start: [x, y, yaw] below it, got {table!r}')
        for key in table:
            if key not in _KEYS:
                raise PlaceError((*where, key), f'unknown, expected {nearest(key, _KEYS)}')
        if 'start' not in table:
            raise PlaceError(where, 'has no start, expected start: [x, y, yaw]')
        start = _pose((*where, 'start'), table['start'], plan)
        dock = table.get('dock', '')
        if dock != '' and dock not in plan.place.recharge_rooms:
            expected = nearest(str(dock), plan.place.recharge_rooms)
            raise PlaceError((*where, 'dock'), f'no room with a station, expected {expected}')
        profile = table.get('profile', '')
        if not isinstance(profile, str):
            raise PlaceError((*where, 'profile'), f'expected a name or a file, got {profile!r}')
        for other in members:
            if math.dist(other.start[:2], start[:2]) < _APART:
                raise PlaceError((*where, 'start'), f'{other.name} starts there: expected it apart')
        members.append(FleetMember(name, start, dock, profile))
    return tuple(members)


def robots_in_a_row(plan: FloorPlan, count: int, radius: float) -> tuple[FleetMember, ...]:
    """Return so many robots at their starts: the first where the place has it, the others around.

    Raises:
        PlaceError: There is no room for so many.
    """
    regions = RoomMap(plan)
    grid, clearance = _clearance(plan)
    x0, y0, yaw = plan.start
    room, pitch = regions.room_at(x0, y0), 2.0 * radius + _APART
    steps = range(-MOST_ROBOTS, MOST_ROBOTS + 1)
    reach = 1 + math.ceil(math.sqrt(count)) * 4
    spots = sorted(
        (math.hypot(i, j), -i, j) for i in steps for j in steps if abs(i) < reach and abs(j) < reach
    )
    members: list[FleetMember] = []
    for _, minus_i, j in spots:
        x, y = x0 - pitch * minus_i, y0 + pitch * j
        if regions.room_at(x, y) != room:
            continue
        near_door = any(
            math.dist((x, y), (door.x, door.y)) < door.width / 2 + 2 * radius
            for door in plan.doors.values()
        )
        is_first = not members
        if is_first or (
            not near_door and float(clearance[grid.cell_of(x, y)]) >= radius + _FROM_WALL
        ):
            members.append(FleetMember(f'robot{len(members) + 1}', (x, y, yaw)))
        if len(members) == count:
            return tuple(members)
    raise PlaceError(
        (), f'{room} has room for {len(members)} robots beside one another, not for {count}'
    )


def _clearance(plan: FloorPlan) -> tuple[Grid, NDArray[np.float32]]:
    """Return the place as a grid, and the distance of each cell to the next wall, metres."""
    grid = plan.grid()
    return grid, distance_to(~grid.free, grid.resolution)


def _room_to_pass(radius: float) -> float:
    """Return the distance to walls at which two robots can pass: one at the point, the other beside
    it: a body, and gaps on both sides.
    """
    return 3.0 * radius + 2.0 * _PASSING


def wide_places(plan: FloorPlan, radius: float) -> tuple[str, ...]:
    """Return the places in which two robots of a radius can pass at the point of the place."""
    grid, clearance = _clearance(plan)
    needed = _room_to_pass(radius) - grid.resolution
    return tuple(
        name
        for name, (x, y, _) in plan.place.positions.items()
        if float(clearance[grid.cell_of(x, y)]) >= needed
    )


def points_to_pass(plan: FloorPlan, radius: float) -> dict[str, tuple[float, float]]:
    """Return other points for places at whose own point two robots cannot pass, as before a door.

    Each is the nearest point of the same place at which they can, and from which all its doors stay
    free; a place that has none, as a narrow corridor, is not named. Where no walls say what belongs
    to a place, none is.
    """
    wide = wide_places(plan, radius)
    if not plan.is_enclosed or len(wide) == len(plan.place.positions):
        return {}
    grid, clearance = _clearance(plan)
    regions = RoomMap(plan)
    found = {}
    for name, (x, y, _) in plan.place.positions.items():
        if name in wide:
            continue
        points = regions.grid.centres_of(np.argwhere(regions.mask(name)))
        cells = grid.cells_of(points)
        inside = grid.contains(cells)
        points, cells = points[inside], cells[inside]
        fits = clearance[cells[:, 0], cells[:, 1]] >= _room_to_pass(radius)
        for door in plan.place.rooms[name]:
            if (opening := plan.doors.get(door)) is not None:
                away = np.hypot(points[:, 0] - opening.x, points[:, 1] - opening.y)
                fits &= away >= opening.width / 2.0 + 2.0 * radius
        if fits.any():
            points = points[fits]
            nearest_one = points[np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y))]
            found[name] = (round(float(nearest_one[0]), 2), round(float(nearest_one[1]), 2))
    return found


def with_points(plan: FloorPlan, points: Mapping[str, tuple[float, float]]) -> FloorPlan:
    """Return a plan in which some places have other points, x, y in metres."""
    positions = {
        name: (*points[name], at[2]) if name in points else at
        for name, at in plan.place.positions.items()
    }
    return replace(plan, place=replace(plan.place, positions=positions))


def wide_passages(plan: FloorPlan, radius: float) -> tuple[str, ...]:
    """Return the pairs of places, as `A B`, between which two robots can pass in a door."""
    needed = 4.0 * radius + 3.0 * _PASSING
    return tuple(
        ' '.join(sorted(sides))
        for name, sides in plan.place.doors.items()
        if len(sides) == 2 and name in plan.doors and plan.doors[name].width >= needed
    )


def _pose(where: tuple[str, ...], value: Any, plan: FloorPlan) -> Pose:
    numbers = isinstance(value, list | tuple) and all(
        isinstance(part, int | float) and not isinstance(part, bool) and math.isfinite(part)
        for part in value
    )
    if not numbers or len(value) != 3:
        raise PlaceError(where, f'expected [x, y, yaw] in metres and rad, got {value!r}')
    x, y, yaw = map(float, value)
    if plan.is_enclosed and RoomMap(plan).room_at(x, y) is None:
        raise PlaceError(where, f'({x:g}, {y:g}) lies in no room: expected a point in one')
    return x, y, yaw
