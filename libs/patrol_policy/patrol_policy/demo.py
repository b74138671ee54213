"""A robot patrols seven rooms, and says at each move why: ``python -m patrol_policy.demo``.

Nothing is needed but this library. `--help` lists what can be changed: the threshold, the rules
and the policy. With ``--rules 'LAB&URGENT' URGENT CORRIDOR`` the room R4, which is a laboratory
here, is seen to before the others that wait too long.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from patrol_policy.graph import PatrolGraph, graph_of_places
from patrol_policy.idleness_bounds import idleness_bounds, lines
from patrol_policy.lower_bounds import rule_bound
from patrol_policy.policies import DEFAULT_POLICY, POLICIES
from patrol_policy.rule_table import DEFAULT_PRIORITIES, Priorities
from patrol_policy.simulation import CORRIDOR, ROOM, Patrol
from patrol_policy.situation import Situation

WAYS = {
    'E': ['C1', 'C2'],
    'C1': ['E', 'C2', 'R1', 'R2'],
    'C2': ['E', 'C1', 'R3', 'R4'],
    'R1': ['C1'],
    'R2': ['C1'],
    'R3': ['C2'],
    'R4': ['C2'],
}
POINTS = {
    'R1': (10.0, 5.0), 'R2': (15.0, 5.0), 'R3': (10.0, 15.0), 'R4': (15.0, 15.0),
    'E': (5.0, 10.0), 'C1': (10.0, 8.0), 'C2': (10.0, 14.0),
}  # fmt: skip
PICTURE = """
              R3    R4          E is the station, C1 and C2 are corridors,
               \\   /            R1 to R4 rooms; R4 is a LAB, too.
        E ----- C2
         \\      |
          `---- C1
               /  \\
             R1    R2
"""
BAR = 24
"""Columns of a bar that is as long as the threshold."""


def rooms() -> PatrolGraph:
    """Return the map: 0.6 m/s, and 2 s to look around in each place."""
    return graph_of_places(WAYS, POINTS, speed=0.6, exploration_seconds=2.0)


def waits_drawn(known: Situation) -> list[str]:
    """Return a bar for each place: how long it has waited; ``|`` is its threshold."""
    drawn = []
    for place in sorted(known.graph.places):
        waited, limit = known.idleness_of(place), known.threshold_of(place)
        bar = ('#' * min(2 * BAR, round(BAR * waited / limit))).ljust(BAR)
        bar = bar[:BAR] + '|' + bar[BAR:]
        urgent = ' URGENT' if known.is_urgent(place) else ''
        drawn.append(f'      {place:3} {bar} {waited:5.0f} s{urgent}')
    return drawn


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the demonstration."""
    parser = argparse.ArgumentParser('patrol_policy.demo', description=__doc__.split('\n')[0])
    parser.add_argument('--moves', type=int, default=14, help='how many (default 14)')
    parser.add_argument('--threshold', type=float, default=120.0, help='seconds (default 120)')
    parser.add_argument('--policy', choices=sorted(POLICIES), default=DEFAULT_POLICY)
    parser.add_argument('--rules', nargs='*', default=DEFAULT_PRIORITIES, help='by priority')
    options = parser.parse_args(arguments)
    try:
        priorities = Priorities(tuple(options.rules))
    except ValueError as error:
        parser.error(f'--rules: {error}')
    graph = rooms()
    classes = {
        place: frozenset({ROOM, *[CORRIDOR] * (len(ways) > 1), *['LAB'] * (place == 'R4')})
        for place, ways in WAYS.items()
    }
    patrol = Patrol(graph, priorities, options.policy, options.threshold, 'E', classes=classes)
    print(PICTURE)
    begin = patrol.world()
    bound = rule_bound(graph, begin.table)
    print(f'the shortest tour takes {graph.tour.length:.0f} s; under these rules no robot can keep')
    print(f'all waits below {bound.low:.0f} s, and the threshold is {options.threshold:g} s.')
    for line in lines(idleness_bounds(begin, patrol.known_battery(), patrol.settings)):
        print(f'- {line}')
    for number in range(1, options.moves + 1):
        before, now = patrol.place, patrol.now
        decision = patrol.step()
        print(f'\n{now:5.0f} s  {before} -> {decision.place} [{decision.rule}] {decision.reason}')
        if number == options.moves:
            print(f'\nafter {number} moves the places have waited:')
            print('\n'.join(waits_drawn(patrol.world())))
    return 0


if __name__ == '__main__':
    sys.exit(main())
