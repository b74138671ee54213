"""Routes over doors: which doors lead from one place to another, by the shortest way.

Places are the nodes of a graph; a door that leads into two places joins them, unless it is closed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from itertools import combinations, pairwise

import networkx as nx
import numpy as np
from numpy.typing import ArrayLike

from surveillance_controllers.planning.grid_planning import NoPathError


def route(
    rooms_of: Mapping[str, Collection[str]],
    closed: Collection[str],
    start: str,
    goal: str,
    positions: Mapping[str, ArrayLike],
) -> list[str]:
    """Return the doors to go through, in order; none when start and goal are one place.

    Args:
        rooms_of: The places that each door leads into.
        closed: Doors that are closed.
        start: A place.
        goal: A place.
        positions: A point in each place, metres; the way through a place is measured by them.

    Raises:
        NoPathError: No open doors lead there; the text names the closed doors that would.
    """
    graph = nx.Graph()
    graph.add_nodes_from([start, goal])
    blocked = nx.Graph()
    blocked.add_nodes_from([start, goal])
    for door, rooms in sorted(rooms_of.items()):
        for first, second in combinations(sorted(rooms), 2):
            length = _distance(positions, first, second)
            for edges in (blocked,) if door in closed else (graph, blocked):
                if not edges.has_edge(first, second) or edges[first][second]['length'] > length:
                    edges.add_edge(first, second, length=length, door=door)
    try:
        places = nx.shortest_path(graph, start, goal, weight='length')
    except nx.NetworkXNoPath:
        raise NoPathError(_why(blocked, closed, start, goal)) from None
    return [graph[first][second]['door'] for first, second in pairwise(places)]


def _distance(positions: Mapping[str, ArrayLike], first: str, second: str) -> float:
    if first not in positions or second not in positions:
        return 1.0
    a, b = np.asarray(positions[first], float), np.asarray(positions[second], float)
    return math.dist(a[:2], b[:2])


def _why(graph: nx.Graph, closed: Collection[str], start: str, goal: str) -> str:
    try:
        places = nx.shortest_path(graph, start, goal, weight='length')
    except nx.NetworkXNoPath:
        return f'no route from {start} to {goal}: no doors lead there'
    doors = [graph[a][b]['door'] for a, b in pairwise(places)]
    shut = [door for door in doors if door in closed]
    many = len(shut) > 1
    return (
        f'no route from {start} to {goal}: the door{"s" if many else ""} {", ".join(shut)} '
        f'{"are" if many else "is"} closed'
    )
