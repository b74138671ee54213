"""Routes over doors: which doors lead from one place to another, by the shortest way.

Places are the nodes of a graph; a door that leads into two places joins them, unless it is closed.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from itertools import combinations, pairwise

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
    import networkx as nx  # takes 0.1 s, which a node's start does without

    def doors_through(doors: Iterable[str]) -> list[str] | None:
        graph = nx.Graph()
        graph.add_nodes_from([start, goal])
        for door in sorted(doors):
            for first, second in combinations(sorted(rooms_of[door]), 2):
                length = _distance(positions, first, second)
                if length < graph.get_edge_data(first, second, {}).get('length', math.inf):
                    graph.add_edge(first, second, length=length, door=door)
        try:
            places = nx.shortest_path(graph, start, goal, weight='length')
        except nx.NetworkXNoPath:
            return None
        return [graph[first][second]['door'] for first, second in pairwise(places)]

    doors = doors_through(door for door in rooms_of if door not in closed)
    if doors is not None:
        return doors
    shut = [door for door in doors_through(rooms_of) or () if door in closed]
    if not shut:
        raise NoPathError(f'no route from {start} to {goal}: no doors lead there')
    which = f'doors {", ".join(shut)} are' if len(shut) > 1 else f'door {shut[0]} is'
    raise NoPathError(f'no route from {start} to {goal}: the {which} closed')


def _distance(positions: Mapping[str, ArrayLike], first: str, second: str) -> float:
    if first not in positions or second not in positions:
        return 1.0
    a, b = np.asarray(positions[first], float), np.asarray(positions[second], float)
    return math.dist(a[:2], b[:2])
