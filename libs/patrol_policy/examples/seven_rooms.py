"""Patrol one map with several policies, and compare how long places go unvisited. No ROS."""

from __future__ import annotations

from patrol_policy.graph import graph_of_places
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol

POSITIONS = {
    'E': (5.0, 10.0),
    'C1': (10.0, 8.0),
    'C2': (10.0, 14.0),
    'R1': (10.0, 5.0),
    'R2': (15.0, 5.0),
    'R3': (10.0, 15.0),
    'R4': (15.0, 15.0),
}
WAYS = {
    'E': ['C1', 'C2'],
    'C1': ['E', 'C2', 'R1', 'R2'],
    'C2': ['E', 'C1', 'R3', 'R4'],
    'R1': ['C1'],
    'R2': ['C1'],
    'R3': ['C2'],
    'R4': ['C2'],
}
HOURS = 1.0


def main() -> None:
    """Print the longest time from visit to visit under each policy, for two thresholds."""
    graph = graph_of_places(WAYS, POSITIONS, speed=0.6, exploration_seconds=2.0)
    tour = graph.tour.length
    print(f'{len(graph.places)} places, shortest tour {tour:.1f} s: {" - ".join(graph.walk)}')
    for factor in (0.5, 1.0):
        threshold = factor * tour
        print(f'\nurgency threshold {threshold:.1f} s')
        for policy in ('tour', 'lookahead', 'oldest', 'seed'):
            patrol = Patrol(graph, Priorities(), policy, threshold, station='E')
            first = patrol.step()
            for _ in patrol.until(HOURS * 3600.0):
                pass
            print(f'  {policy:<10} {patrol.run.settled:7.1f} s   first: {first.reason}')


if __name__ == '__main__':
    main()
