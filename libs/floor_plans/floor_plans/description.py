"""A place as a file or the parameters of a node describe it, read and checked.

Rooms always; walls, doors and the map that the place refers to where they are given.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from floor_plans.fleet import FleetMember, members_of
from floor_plans.floor_plan import FloorPlan
from floor_plans.occupancy_map import is_map_description, is_picture
from floor_plans.patrol_rules import PatrolRules, patrol_rules
from floor_plans.room_map import ROBOT_RADIUS, RoomMap, check_passable
from floor_plans.rooms import (
    GEOMETRY_KEYS,
    PATROL_KEYS,
    PLACE_KEYS,
    Place,
    PlaceError,
    tables_of,
)
from strict_files.files import FileError
from strict_files.suggestions import nearest
from strict_files.yaml_file import YamlFile, parameters_of, read_yaml_file


@dataclass(frozen=True)
class PlaceFile:
    """What a place's file describes.

    Attributes:
        place: The rooms, which doors join them, a point in each.
        plan: Walls, map, doors and markers, as far as the file has them.
        rules: What holds for single places when they are patrolled.
        robots: The robots of the place, if it names them.
    """

    place: Place
    plan: FloorPlan
    rules: PatrolRules = field(default_factory=PatrolRules)
    robots: tuple[FleetMember, ...] = ()


def read_place(
    path: str | Path, *, radius: float = ROBOT_RADIUS, reserved: Collection[str] = ()
) -> PlaceFile:
    """Read a place's file and check all that it says, also that the robot fits through the doors.

    Args:
        path: A parameter file whose section `/**` describes a place.
        radius: Of the robot, metres.
        reserved: Names that no robot of the place may have.

    Raises:
        FileError: The file cannot be read, or what it describes is no sound place; one line
            with file and line number.
    """
    file, described = described_in(path)
    try:
        if isinstance(name := described.get('map_file'), str) and name:
            described['map_file'] = map_file_beside(file.path, name)
        plan = checked_plan(described, radius)
        rules = patrol_rules(described, plan.place.rooms)
        robots = members_of(described, plan, reserved)
    except PlaceError as error:
        raise file.error(error.where, error.problem) from None
    return PlaceFile(plan.place, plan, rules, robots)


def described_in(path: str | Path) -> tuple[YamlFile, dict[str, Any]]:
    """Return what a place's file has below `ros__parameters`, its tables as mappings.

    Only the names of the keys are checked. The file comes with it, for errors with a line.

    Raises:
        FileError: The file cannot be read or is none of a place.
    """
    if is_picture(path) and Path(path).exists():
        raise FileError(f'{path}: the picture of a map, and no place: {_importing(path)}')
    file = read_yaml_file(path)
    if is_map_description(file.values):
        raise FileError(f"{path}: a map in map_server's format, and no place: {_importing(path)}")
    if '/**' not in file.values:
        found = ', '.join(file.values) or 'nothing'
        raise file.error((), f"expected the top-level key '/**', got {found}")
    given = {name: value for _, name, value in parameters_of(file, '/**')}
    lines = {
        tuple('.'.join(where[2:]).split('.')) if where[2:] else (): line
        for where, line in file.lines.items()
        if where[:2] == ('/**', 'ros__parameters')
    }
    file = YamlFile(file.path, given, lines)
    try:
        described = tables_of(given.items())
        known = (*PLACE_KEYS, *GEOMETRY_KEYS, *PATROL_KEYS)
        for key in described:
            if key not in known:
                raise PlaceError(
                    tuple(key.split('.')), f'unknown parameter, expected {nearest(key, known)}'
                )
        for key in PLACE_KEYS[:3]:
            if key not in described:
                raise PlaceError((), f"parameter '{key}' is missing")
    except PlaceError as error:
        raise file.error(error.where, error.problem) from None
    return file, described


def map_file_beside(place: Path, name: str) -> str:
    """Return the path of the map's file that a place's file names relative to itself."""
    return str((place.parent / name).absolute())


def _importing(path: str | Path) -> str:
    return f'expected a place; the command `import {path}` makes one of it'


def checked_plan(parameters: Mapping[str, Any], radius: float = ROBOT_RADIUS) -> FloorPlan:
    """Make the floor plan that parameters describe, with all checks.

    Args:
        parameters: As a place's file has them, the name of the map's file as for
            `FloorPlan.from_parameters`.
        radius: Of the robot that has to get through the doors, metres.

    Raises:
        PlaceError: What is described is no sound place.
    """
    plan = FloorPlan.from_parameters(parameters)
    RoomMap(plan)
    check_passable(plan, radius)
    return plan
