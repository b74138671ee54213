"""Open-RMF's `building.yaml`: a floor drawn by its walls becomes a map, with what has names in it.

The traffic editor draws each level over a picture: vertices in pixels (rows grow downwards), walls,
doors and floors between them, and measurements that say how many metres lie between two vertices.
Coordinates here are those of Open-RMF's own navigation graphs (`building_map/level.py`,
`building.py`): metres, y turned upwards, the levels laid over the reference level by their
fiducials.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans.occupancy_grid import FREE, OCCUPIED, UNKNOWN
from floor_plans.occupancy_map import MOST_CELLS, OccupancyMap
from strict_files.files import FileError
from strict_files.suggestions import nearest

RESOLUTION = 0.05
WALL_THICKNESS = 0.1
"""As Open-RMF builds its walls, metres."""
_AROUND = 0.5
"""Width of the unknown border around the floor, metres."""
_FRAMES = ('reference_image', 'cartesian_meters')
Points = NDArray[np.float64]
Line = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class RmfLevel:
    """One level of a building, in metres.

    Attributes:
        name: Of the level.
        map: Its floor and walls, every door open.
        doors: The opening of each door, by name.
        places: The points that have a name.
        chargers: The points at which a robot charges.
    """

    name: str
    map: OccupancyMap
    doors: Mapping[str, Line]
    places: Mapping[str, tuple[float, float]]
    chargers: Sequence[tuple[float, float]]


def is_rmf_building(document: Any) -> bool:
    """Tell whether a YAML document is a building of the traffic editor, not the graph made of it.

    In a building, a vertex is x, y, height and name; in a graph it is x, y and properties.
    """
    levels = document.get('levels') if isinstance(document, Mapping) else None
    if not isinstance(levels, Mapping):
        return False
    for level in levels.values():
        vertices = level.get('vertices') if isinstance(level, Mapping) else None
        if isinstance(vertices, list) and vertices:
            first = vertices[0]
            return isinstance(first, list) and len(first) >= 4
    return False


def level_of(path: Path, levels: Mapping[str, Any], name: str) -> str:
    """Return the level that is meant.

    Args:
        path: The building's file, for messages.
        levels: Its levels.
        name: What was asked for; empty: nothing was.

    Raises:
        FileError: There are several and none was named, or it is not there.
    """
    names = [str(each) for each in levels]
    if name:
        if name not in names:
            raise FileError(f'{path}: no level {name!r}: expected {nearest(name, names)}')
        return name
    if len(names) != 1:
        raise FileError(
            f'{path}: {len(names)} levels ({", ".join(names)}), and a place is one floor: expected '
            '--level with one of them, a place for each'
        )
    return names[0]


def read_rmf_building(path: Path, document: Mapping[str, Any], level: str = '') -> RmfLevel:
    """Return a level of a building as a map.

    Args:
        path: The building's file, for messages.
        document: What it says.
        level: The level's name; may be empty where there is one.

    Raises:
        FileError: It is not what was expected; one line.
    """
    levels = document['levels']
    name = level_of(path, levels, level)
    frame = document.get('coordinate_system', _FRAMES[0])
    if frame not in _FRAMES:
        raise FileError(
            f'{path}: coordinate_system {frame}: expected {" or ".join(_FRAMES)}, or the '
            'navigation graph that building_map_generator makes of it'
        )
    chosen = next(each for key, each in levels.items() if str(key) == name)
    try:
        place = _Level(chosen)
        points = place.points
        if frame == 'reference_image':
            reference = levels[document.get('reference_level_name', next(iter(levels)))]
            points = _in_metres(path, name, place, _Level(reference))
        return _drawn(path, name, place, points)
    except FileError:
        raise
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        said = repr(error) if isinstance(error, KeyError) else str(error).splitlines()[0]
        raise FileError(
            f'{path}: level {name}: not the building that was expected: {said}'
        ) from None


class _Level:
    """What the file says of a level: vertices in its own coordinates, and edges between them."""

    def __init__(self, described: Mapping[str, Any]) -> None:
        self.described = described
        vertices = described.get('vertices') or []
        self.points = np.array([[float(x), float(y)] for x, y, *_ in vertices]).reshape(-1, 2)
        if not np.isfinite(self.points).all():
            raise ValueError('a vertex that is not finite')
        self.names = [str(each[3]) for each in vertices]
        self.properties: list[Mapping[str, Any]] = [
            each[4] if len(each) > 4 and isinstance(each[4], Mapping) else {} for each in vertices
        ]
        self.fiducials = {
            str(each[2]): complex(float(each[0]), -float(each[1]))
            for each in described.get('fiducials') or []
        }

    def edges(self, kind: str) -> list[tuple[int, int, Mapping[str, Any]]]:
        """Return the walls, doors or measurements: two vertices, and properties by name."""
        found: list[tuple[int, int, Mapping[str, Any]]] = []
        for first, second, *more in self.described.get(kind) or []:
            for end in (first, second):
                if not 0 <= int(end) < len(self.points):
                    raise ValueError(f'{kind}: vertex {end} is not there')
            given = more[0] if more and isinstance(more[0], Mapping) else {}
            # Each value stands behind the number of its type.
            plain = {
                str(key): value[1] if isinstance(value, list) and len(value) == 2 else value
                for key, value in given.items()
            }
            found.append((int(first), int(second), plain))
        return found

    def polygons(self, kind: str) -> list[list[int]]:
        """Return the vertices of floors or holes."""
        return [
            [int(each) for each in entry.get('vertices') or []]
            for entry in self.described.get(kind) or []
        ]

    def scale(self) -> float | None:
        """Return the metres in a pixel by the mean of the measurements; None: there are none."""
        scales = []
        for first, second, given in self.edges('measurements'):
            pixels = math.dist(self.points[first], self.points[second])
            if pixels <= 0 or not float(given['distance']) > 0:
                raise ValueError('a measurement of no length')
            scales.append(float(given['distance']) / pixels)
        return sum(scales) / len(scales) if scales else None


def _in_metres(path: Path, name: str, level: _Level, reference: _Level) -> Points:
    """Return a level's vertices in metres in the frame of the reference level."""
    metres = reference.scale()
    if metres is None:
        raise FileError(f'{path}: no measurements: expected one, as a pixel has no size without it')
    own = level.points[:, 0] - 1j * level.points[:, 1]
    shared = sorted(reference.fiducials.keys() & level.fiducials.keys())
    if level.described is reference.described:
        turned = own * metres
    elif len(shared) >= 2:
        # The similarity that lays the level's fiducials over the reference level's.
        there = np.array([reference.fiducials[each] for each in shared])
        here = np.array([level.fiducials[each] for each in shared])
        spread = here - here.mean()
        if not np.abs(spread).max() > 0:
            raise FileError(f'{path}: level {name}: its fiducials lie in one point')
        ratio = np.vdot(spread, there - there.mean()) / np.vdot(spread, spread).real
        turned = ((own - here.mean()) * ratio + there.mean()) * metres
    else:
        turned = own * (level.scale() or metres)
    return np.stack([turned.real, turned.imag], axis=1)


def _drawn(path: Path, name: str, level: _Level, points: Points) -> RmfLevel:
    walls = level.edges('walls')
    if not walls:
        raise FileError(
            f'{path}: level {name} has no walls: expected some, or the navigation graph that '
            'building_map_generator makes of it'
        )
    doors: dict[str, Line] = {}
    for index, (first, second, given) in enumerate(level.edges('doors'), start=1):
        if not np.array_equal(points[first], points[second]):
            doors[str(given.get('name') or f'door_{index}')] = (
                _point(points[first]),
                _point(points[second]),
            )
    floors = [each for each in level.polygons('floors') if len(each) > 2]
    used = sorted({end for first, second, _ in walls for end in (first, second)}.union(*floors))
    low = np.floor((points[used].min(axis=0) - _AROUND) / RESOLUTION) * RESOLUTION
    columns, rows = np.ceil((points[used].max(axis=0) + _AROUND - low) / RESOLUTION).astype(int)
    if columns * rows > MOST_CELLS:
        raise FileError(
            f'{path}: level {name} is {columns * RESOLUTION:.0f} m by {rows * RESOLUTION:.0f} m: '
            'expected another measurement'
        )

    def cells(ends: Sequence[int] | Points) -> NDArray[np.int32]:
        # Sixteenths of a cell, which OpenCV draws exactly.
        at = points[ends] if not isinstance(ends, np.ndarray) else ends
        return np.asarray(np.rint(((at - low) / RESOLUTION - 0.5) * 16), np.int32)

    free = np.zeros((rows, columns), np.uint8)
    for outline in floors:
        cv2.fillPoly(free, [cells(outline)], 1, shift=4)
    if not floors:
        free[:] = 1
    for outline in level.polygons('holes'):
        if len(outline) > 2:
            cv2.fillPoly(free, [cells(outline)], 0, shift=4)
    solid = np.zeros_like(free)
    thick = max(1, round(WALL_THICKNESS / RESOLUTION))
    for first, second, _ in walls:
        start, end = (tuple(int(each) for each in at) for at in cells([first, second]))
        cv2.line(solid, start, end, 1, thick, cv2.LINE_8, 4)
    # A door is open from jamb to jamb, where walls go on behind it, too.
    for line in doors.values():
        start, end = (tuple(int(each) for each in at) for at in cells(np.array(line)))
        opening = np.zeros_like(free)
        cv2.line(opening, start, end, 1, thick + 2, cv2.LINE_8, 4)
        jambs = np.zeros_like(free)
        for at in (start, end):
            cv2.circle(jambs, at, 2 * 16, 1, -1, cv2.LINE_8, 4)
        solid[(opening > 0) & (jambs == 0)] = 0
        free[opening > 0] = 1
    if not floors:
        free[_outside(solid, [cells(np.array(line)) for line in doors.values()], thick)] = 0
    occupancy = np.full((rows, columns), UNKNOWN, np.int8)
    occupancy[free > 0] = FREE
    occupancy[solid > 0] = OCCUPIED
    building = OccupancyMap(
        path,
        np.ascontiguousarray(occupancy[::-1]),
        RESOLUTION,
        (float(low[0]), float(low[1]), 0.0),
    )
    places = {each: _point(points[index]) for index, each in enumerate(level.names) if each.strip()}
    chargers = [
        _point(points[index])
        for index, given in enumerate(level.properties)
        if 'is_charger' in given and given['is_charger'] not in (False, [4, False])
    ]
    return RmfLevel(name, building, doors, places, chargers)


def _outside(
    solid: NDArray[np.uint8], doors: list[NDArray[np.int32]], thick: int
) -> NDArray[np.bool_]:
    """Return the cells that are reached from the edge while every door is shut."""
    shut = solid.copy()
    for start, end in doors:
        ends = [tuple(int(each) for each in at) for at in (start, end)]
        cv2.line(shut, ends[0], ends[1], 1, thick, cv2.LINE_8, 4)
    pieces = cv2.connectedComponents((shut == 0).astype(np.uint8), connectivity=4)[1]
    return np.asarray((pieces == pieces[0, 0]) & (shut == 0))


def _point(at: NDArray[np.float64]) -> tuple[float, float]:
    return float(at[0]), float(at[1])
