"""Maps and worlds to decide in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hypothesis import strategies as st

from patrol_policy.battery import Energy
from patrol_policy.graph import PatrolGraph, graph_of_places
from patrol_policy.lower_bounds import default_table
from patrol_policy.rule_graph import RuleGraph
from patrol_policy.rule_table import URGENT, RuleTable
from patrol_policy.situation import Situation

SEVEN_ROOMS = {
    'R1': ['D1'],
    'R2': ['D2'],
    'R3': ['D3'],
    'R4': ['D4'],
    'E': ['D6', 'D7'],
    'C1': ['D1', 'D2', 'D5', 'D6'],
    'C2': ['D3', 'D4', 'D5', 'D7'],
}
POSITIONS = {
    'R1': (10.0, 5.0, 0.0),
    'R2': (15.0, 5.0, 0.0),
    'R3': (10.0, 15.0, 0.0),
    'R4': (15.0, 15.0, 0.0),
    'E': (5.0, 10.0, 0.0),
    'C1': (10.0, 8.0, 0.0),
    'C2': (10.0, 14.0, 0.0),
}


def seven_rooms(exploration_seconds: float = 2.0) -> PatrolGraph:
    neighbours = {
        room: [
            other
            for other, theirs in SEVEN_ROOMS.items()
            if other != room and set(theirs) & set(doors)
        ]
        for room, doors in SEVEN_ROOMS.items()
    }
    return graph_of_places(neighbours, POSITIONS, 1.0, exploration_seconds)


def world(**changes: object) -> Situation:
    values: dict[str, object] = {
        'place': 'C1',
        'now': 100.0,
        'reachable': ('C2', 'E', 'R1', 'R2'),
        'classes': {
            'C2': frozenset({'CORRIDOR', 'ROOM'}),
            'E': frozenset({'CORRIDOR', 'ROOM'}),
            'R1': frozenset({'ROOM', 'URGENT'}),
            'R2': frozenset({'ROOM', 'URGENT'}),
        },
        'visited_at': {'C1': 100.0, 'C2': 80.0, 'E': 90.0, 'R1': 20.0, 'R2': 10.0, 'R3': 50.0},
        'graph': seven_rooms(),
        'threshold': 60.0,
    }
    classes = {**values, **changes}['classes']
    assert isinstance(classes, dict)
    return Situation(**{**values, 'said': said_in(classes), **changes})  # type: ignore[arg-type]


def said_in(classes: Mapping[str, frozenset[str]]) -> dict[str, bool]:
    """Return what an ontology says that holds places to be of these classes."""
    return {place: URGENT in kinds for place, kinds in classes.items()}


def default_ranks(graph: PatrolGraph) -> list[int]:
    return list(default_table(graph, 1.0).base)


def table_of(
    ranks: Sequence[int],
    threshold: float,
    urgent: int | None = 0,
    own: Mapping[int, float] | None = None,
) -> RuleTable:
    """Return rules by which each place has a rank, and URGENT another one; None: it has none."""
    order = [f'K{rank}' for rank in range(max(ranks) + 1)]
    if urgent is not None:
        order.insert(urgent, URGENT)
    due = [rank if urgent is None else min(urgent, rank) for rank in ranks]
    limits = [(own or {}).get(place, threshold) for place in range(len(ranks))]
    return RuleTable(tuple(order), list(ranks), due, limits)


def rule_graph_of(
    graph: PatrolGraph,
    threshold: float,
    ranks: Sequence[int] | None = None,
    urgent: int | None = 0,
    own: Mapping[int, float] | None = None,
    energy: Energy | None = None,
    windows: Mapping[int, Sequence[tuple[float, float]]] | None = None,
    slower: float = 1.0,
) -> RuleGraph:
    """Return a map with rules; default: places with several ways come before those with one."""
    table = table_of(ranks or default_ranks(graph), threshold, urgent, own)
    return RuleGraph(graph, table, energy, windows, slower)


@st.composite
def graphs(draw: st.DrawFn, most: int = 8) -> PatrolGraph:
    """Draw connected graphs: a random tree with some edges more."""
    count = draw(st.integers(2, most))
    legs: dict[str, dict[str, float]] = {f'P{number}': {} for number in range(count)}
    extra = draw(st.lists(st.tuples(st.integers(0, count - 1), st.integers(0, count - 1))))
    parents = [(child, draw(st.integers(0, child - 1))) for child in range(1, count)]
    for first, second in [*parents, *extra]:
        if first != second:
            seconds = float(draw(st.integers(1, 30)))
            legs[f'P{first}'][f'P{second}'] = legs[f'P{second}'][f'P{first}'] = seconds
    return PatrolGraph(legs, float(draw(st.integers(0, 5))))
