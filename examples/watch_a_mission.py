"""Watch a mission: build states as a subscriber does, and show what changed and the last one.

No ROS is started. On a robot `MissionSubscriber` makes the states from topics; here a few lines
of Python play the robot. The terminal view, the page and the recording all show such states.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from rich.console import Console

from floor_plans import Grid
from patrol_policy.situation import Decision
from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_state import MissionState, Status
from surveillance_operator.page_state import PatchMaker
from surveillance_operator.watch.view import MissionView


def two_rooms() -> Grid:
    """Return a map of 6 x 3 m with a wall in the middle and a door in it."""
    cells = np.zeros((60, 120), np.int8)
    cells[[0, -1], :] = cells[:, [0, 60, -1]] = 100
    cells[20:40, 60] = 0
    return Grid(cells, 0.05)


def main() -> None:
    """Play a short mission and show it."""
    state = MissionState().having(
        where='an example',
        now=100.0,
        mode='SIMULATED',
        nodes={'robot_behavior': frozenset({'1'})},
        grid=two_rooms(),
        positions={'A': (1.5, 1.5), 'B': (4.5, 1.5)},
        doors={'D': True},
        door_lines={'D': (3.0, 1.0, 3.0, 2.0)},
        visited_at={'A': 98.0, 'B': 40.0},
        battery=82.0,
        threshold=50.0,
    )
    patches = PatchMaker()
    patches.patch(state)
    reason = 'B has waited 60 s, longer than the threshold of 50 s'
    decision = Decision(100.0, 'A', 'B', 'B', 'URGENT', 'tour', reason, {'B': 60.0, 'A': 2.0})
    moving = Status(100.0, 'surveillance', 'MOVE_TO_NEXT_ROOM', 'A', 'B', False, '', ())
    way = [(x, 1.5) for x in np.linspace(1.5, 4.5, 13)]
    steps = [
        {'decision': decision, 'decision_number': 1, 'status': moving, 'urgent': frozenset({'B'})},
        *({'pose': (*point, 0.0), 'trail': np.array(way[: n + 1])} for n, point in enumerate(way)),
        {
            'status': replace(moving, place='B', text='arrived in B'),
            'visited_at': {'A': 98.0, 'B': 112.0},
            'urgent': frozenset(),
        },
    ]
    start = time.time()
    for second, fields in enumerate(steps):
        new = state.having(now=100.0 + second, **fields)
        state, told = follow(state, new, at=start + second)
        for change in told:
            print(f'{second:3d} s      {change.text} {change.detail}'.rstrip())
        patch = patches.patch(state)
        print(f'          the page gets {", ".join(patch) or "nothing"}')
    console = Console(width=80, height=20, highlight=False)
    console.print(MissionView(state, whole=False))


if __name__ == '__main__':
    main()
