"""Graphs of other programs as places: patrolling_sim's `.graph`, Nav2's route graph, Open-RMF's.

A vertex becomes a room with its point, an edge, in whichever direction it leads, a door that joins
two rooms and has no position. A name that the other program gave is kept where a room can have it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from floor_plans.imports.rmf_building import level_of
from floor_plans.parameters import problem_in_name
from patrol_policy import GraphError
from patrol_policy.patrolling_sim import read_patrolling_sim
from strict_files.files import FileError, read_file

MOST_BYTES = 20_000_000
SUFFIXES = ('.graph', '.geojson', '.json')
Vertices = dict[str, tuple[str, float, float]]
"""By their id: a name, which may be empty, and x and y in metres."""


def read_graph(path: Path, rmf: Any = None, level: str = '') -> dict[str, Any]:
    """Return the parameters of the place that a graph file describes.

    Args:
        path: A `.graph` of patrolling_sim, a GeoJSON of Nav2's route server, or a navigation graph
            of Open-RMF.
        rmf: What the graph of Open-RMF says; None: it is one of the others.
        level: The level that is meant, where there are several.

    Raises:
        FileError: It cannot be read or is of none of these; one line.
    """
    try:
        if rmf is not None:
            vertices, edges = _rmf(path, rmf, level)
        elif level:
            raise FileError(f'{path}: has no levels: expected no --level')
        elif path.suffix == '.graph':
            vertices, edges = _patrolling_sim(path)
        else:
            vertices, edges = _route_graph(json.loads(read_file(path, MOST_BYTES)))
    except FileError:
        raise
    except GraphError as error:
        raise FileError(str(error)) from None
    except (ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
        said = f'{error!r}' if isinstance(error, KeyError) else str(error).splitlines()[0]
        raise FileError(f'{path}: not the graph that was expected: {said}') from None
    return _place(path, vertices, edges)


def _patrolling_sim(path: Path) -> tuple[Vertices, list[tuple[str, str]]]:
    legs = read_patrolling_sim(path).leg_seconds  # with all checks of the format
    words = path.read_text('utf-8').split()
    rest = sum(4 + 3 * len(ways) for ways in legs.values())
    at = len(words) - rest
    scale = float(words[3])
    west, south = (float(words[4]), float(words[5])) if at == 6 else (0.0, 0.0)
    vertices: Vertices = {}
    for _ in legs:
        name, x, y, ways = words[at], float(words[at + 1]), float(words[at + 2]), words[at + 3]
        vertices[str(int(name))] = '', west + scale * x, south + scale * y
        at += 4 + 3 * int(ways)
    return vertices, [(first, other) for first, ways_ in legs.items() for other in ways_]


def _route_graph(document: Any) -> tuple[Vertices, list[tuple[str, str]]]:
    vertices: Vertices = {}
    edges = []
    for feature in document['features']:
        properties, geometry = feature['properties'], feature['geometry']
        if geometry['type'] == 'Point':
            x, y = geometry['coordinates'][:2]
            name = str((properties.get('metadata') or {}).get('name', ''))
            vertices[str(properties['id'])] = name, float(x), float(y)
        else:
            edges.append((str(properties['startid']), str(properties['endid'])))
    return vertices, edges


def _rmf(path: Path, document: Any, name: str) -> tuple[Vertices, list[tuple[str, str]]]:
    levels = {str(each): level for each, level in document['levels'].items()}
    level = levels[level_of(path, levels, name)]
    vertices: Vertices = {}
    for index, (x, y, *more) in enumerate(level['vertices']):
        name = str(more[0].get('name', '')) if more else ''
        vertices[str(index)] = name, float(x), float(y)
    return vertices, [(str(lane[0]), str(lane[1])) for lane in level['lanes']]


def _place(path: Path, vertices: Vertices, edges: Iterable[tuple[str, str]]) -> dict[str, Any]:
    if not vertices:
        raise FileError(f'{path}: has no vertices, expected at least two')
    names: dict[str, str] = {}
    for index, (vertex, (name, x, y)) in enumerate(vertices.items(), start=1):
        if not (math.isfinite(x) and math.isfinite(y)):
            raise FileError(f'{path}: vertex {vertex} is at ({x}, {y}), expected finite metres')
        usable = name and not problem_in_name('room', name) and name not in names.values()
        names[vertex] = name if usable else f'R{index}'
    if len(set(names.values())) < len(names):  # a name that looks like one of ours
        names = {vertex: f'R{index}' for index, vertex in enumerate(vertices, start=1)}
    rooms: dict[str, list[str]] = {name: [] for name in names.values()}
    joined: set[frozenset[str]] = set()
    for first, second in edges:
        for end in (first, second):
            if end not in names:
                raise FileError(f'{path}: an edge leads to vertex {end}, which is not there')
        pair = frozenset((first, second))
        if len(pair) == 2 and pair not in joined:
            joined.add(pair)
            for end in (first, second):
                rooms[names[end]].append(f'D{len(joined)}')
    start = next(iter(rooms))
    return {
        'map': rooms,
        'room_positions': {
            names[v]: [round(x, 3), round(y, 3)] for v, (_, x, y) in vertices.items()
        },
        'robot_room': start,
        'recharge_rooms': [start],
    }
