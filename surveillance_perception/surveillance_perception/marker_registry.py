"""What each marker stands for: a place, a point in it, and its doors, read from a YAML file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from floor_plans.parameters import problem_in_name
from strict_files.yaml_file import KeyPath, YamlFile, read_yaml_file

_KEYS = ('room', 'x', 'y', 'connections', 'hangs_at')
_EXPECTED = "expected 'room', 'x', 'y' and 'connections' (and 'hangs_at', where that is known)"


@dataclass(frozen=True)
class MarkedPlace:
    """A place that a marker stands for.

    Attributes:
        room: Name of the place.
        x: A point inside it, metres, world frame.
        y: The same.
        connections: The place behind each door.
        hangs_at: Where the marker itself is: x, y, z in metres, world frame; None: not known.
    """

    room: str
    x: float
    y: float
    connections: Mapping[str, str]
    hangs_at: tuple[float, float, float] | None = None


def read_registry(path: Path) -> dict[int, MarkedPlace]:
    """Read what the markers stand for.

    Args:
        path: A YAML file: `markers`, a mapping from id to `room`, `x`, `y`, `connections`, which is
            a mapping from door to place, and perhaps `hangs_at`.

    Raises:
        FileError: The file cannot be read, or something in it is not as expected.
    """
    file = read_yaml_file(path)
    entries = file.values.get('markers')
    if not isinstance(entries, Mapping):
        raise file.error((), "expected a mapping 'markers' from id to place")
    if not entries:
        raise file.error_at(('markers',), "'markers' is empty")
    markers = {}
    for key, entry in entries.items():
        where = ('markers', key)
        if not (key.isascii() and key.isdigit()):
            raise file.error(where, 'an id must be a whole number from 0')
        if int(key) in markers:
            raise file.error(where, 'the id is given twice')
        markers[int(key)] = _place(entry, file, where)
    return markers


def _place(entry: Any, file: YamlFile, where: KeyPath) -> MarkedPlace:
    if not isinstance(entry, Mapping):
        raise file.error(where, _EXPECTED)
    for key in entry:
        if key not in _KEYS:
            raise file.error((*where, key), f'unknown, {_EXPECTED}')
    room = _name('place', entry.get('room'), file, (*where, 'room'))
    x, y = (_metres(entry.get(axis), file, (*where, axis)) for axis in ('x', 'y'))
    doors, at = entry.get('connections'), (*where, 'connections')
    if not isinstance(doors, Mapping) or not doors:
        raise file.error(at, 'expected a mapping from door to place')
    behind = {}
    for door, place in doors.items():
        _name('door', door, file, (*at, door))
        behind[door] = _name('place', place, file, (*at, door))
        if behind[door] == room:
            raise file.error((*at, door), f'leads from {room} to itself')
    hangs_at = None
    if 'hangs_at' in entry:
        hangs_at = _point(entry['hangs_at'], file, (*where, 'hangs_at'))
    return MarkedPlace(room, x, y, behind, hangs_at)


def _point(value: Any, file: YamlFile, where: KeyPath) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise file.error(where, f'expected [x, y, z] in metres, got {value!r}')
    x, y, z = (_metres(each, file, where) for each in value)
    return x, y, z


def _metres(value: Any, file: YamlFile, where: KeyPath) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise file.error(where, f'expected a number in metres, got {value!r}')
    return float(value)


def _name(kind: str, value: Any, file: YamlFile, where: KeyPath) -> str:
    if problem := problem_in_name(kind, value):
        raise file.error(where, problem)
    return str(value)
