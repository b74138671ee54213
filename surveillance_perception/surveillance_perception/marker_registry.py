"""What each marker stands for: a place, a point in it, and its doors, read from a YAML file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml


class RegistryError(ValueError):
    """A registry file is wrong; the message is one line that names the file and the place."""


@dataclass(frozen=True)
class MarkedPlace:
    """A place that a marker stands for.

    Attributes:
        room: Name of the place.
        x: A point inside it, metres, world frame.
        y: The same.
        connections: The place behind each door.
    """

    room: str
    x: float
    y: float
    connections: Mapping[str, str]


class _UniqueKeys(yaml.SafeLoader):
    """Refuses a mapping that has a key twice, which YAML itself forbids."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f'{key!r} is given twice', key_node.start_mark
                )
            seen.add(key)
        return super().construct_mapping(node, deep)


def read_registry(path: Path) -> dict[int, MarkedPlace]:
    """Read what the markers stand for.

    Args:
        path: A YAML file: `markers`, a mapping from id to `room`, `x`, `y` and `connections`, which
            is a mapping from door to place.

    Raises:
        RegistryError: The file cannot be read, or something in it is not as expected.
    """
    try:
        document = yaml.load(path.read_text(encoding='utf-8'), _UniqueKeys)
    except OSError as error:
        raise RegistryError(f'{path}: {error.strerror or error}') from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise RegistryError(f'{path}: {" ".join(str(error).split())}') from error
    if not isinstance(document, dict) or not isinstance(document.get('markers'), dict):
        raise RegistryError(f"{path}: expected a mapping 'markers' from id to place")
    markers = {}
    for marker_id, entry in document['markers'].items():
        where = f'{path}: marker {marker_id}'
        if not isinstance(marker_id, int) or isinstance(marker_id, bool) or marker_id < 0:
            raise RegistryError(f'{where}: an id must be a whole number from 0')
        markers[marker_id] = _place(entry, where)
    if not markers:
        raise RegistryError(f"{path}: 'markers' is empty")
    return markers


def _place(entry: Any, where: str) -> MarkedPlace:
    if not isinstance(entry, dict):
        raise RegistryError(f"{where}: expected 'room', 'x', 'y' and 'connections'")
    beyond = sorted(str(key) for key in entry.keys() - {'room', 'x', 'y', 'connections'})
    if beyond:
        raise RegistryError(
            f"{where}: unknown '{beyond[0]}', expected 'room', 'x', 'y' and 'connections'"
        )
    room = _name(entry.get('room'), f"{where}: 'room'")
    position = []
    for axis in ('x', 'y'):
        value = entry.get(axis)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise RegistryError(f"{where}: '{axis}' must be a number in metres, got {value!r}")
        if not math.isfinite(value):
            raise RegistryError(f"{where}: '{axis}' must be finite, got {value!r}")
        position.append(float(value))
    connections = entry.get('connections')
    if not isinstance(connections, dict) or not connections:
        raise RegistryError(f"{where}: 'connections' must be a mapping from door to place")
    behind = {}
    for door, place in connections.items():
        name = _name(door, f'{where}: a door')
        behind[name] = _name(place, f'{where}: the place behind {name}')
        if behind[name] == room:
            raise RegistryError(f'{where}: {name} leads from {room} to itself')
    return MarkedPlace(room, position[0], position[1], behind)


def _name(value: Any, what: str) -> str:
    if not isinstance(value, str) or not value.isidentifier():
        raise RegistryError(f'{what} must be a name of letters, digits and _, got {value!r}')
    return value
