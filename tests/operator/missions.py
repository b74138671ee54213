"""Missions as a view may have them before it: of one robot, and of a fleet."""

from __future__ import annotations

import math
import time

import numpy as np

from floor_plans import Grid
from patrol_policy.situation import Decision
from surveillance_operator.mission_state import (
    FleetReport,
    MissionState,
    Notice,
    Status,
)

STATUS = Status(95.0, 'surveillance', 'MOVE_TO_NEXT_ROOM', 'A', 'B', False, 'arrived in A', ())
DECISION = Decision(90.0, 'A', 'B', 'B', 'URGENT', 'tour', 'B waits longest', {})


def two_rooms() -> Grid:
    """Return a room of 4 x 2 m and one of 2 x 2 m, a wall of 5 cm with an opening of 1 m
    between.
    """
    cells = np.zeros((40, 120), np.int8)
    cells[[0, -1], :] = cells[:, [0, 80, -1]] = 100
    cells[10:30, 80] = 0
    return Grid(cells, 0.05, (-1.0, 2.0))


def whole() -> MissionState:
    return MissionState().having(
        where='ROS domain 7',
        now=100.0,
        mode='SIMULATED',
        nodes={'robot_behavior': frozenset({'1'})},
        status=STATUS,
        decision=DECISION,
        decision_number=3,
        battery=80.0,
        grid=two_rooms(),
        positions={'A': (1.0, 3.0), 'B': (4.0, 3.0)},
        doors={'D': False},
        door_lines={'D': (3.0, 2.5, 3.0, 3.5)},
        visited_at={'A': 98.0, 'B': 10.0},
        urgent=frozenset({'B'}),
        pose=(1.0, 3.0, math.pi / 2),
        trail=np.array([(0.0, 3.0), (1.0, 3.0)]),
        obstacles=np.array([(2.0, 3.5)]),
        notices=(Notice('arrived in A', at=time.mktime((2026, 1, 1, 12, 0, 0, 0, 0, -1))),),
    )


def robot(name: str, place: str = 'A', x: float = 1.0) -> MissionState:
    """Return a robot of a fleet on its way from a place."""
    cells = np.zeros((20, 60), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    return MissionState().having(
        where='ROS domain 5',
        namespace=name,
        now=100.0,
        threshold=240.0,
        nodes={'robot_behavior': frozenset('1')},
        status=Status(90.0, 'surveillance', 'MOVE', place, 'B', False, '', ()),
        decision=Decision(95.0, place, 'B', 'B', 'URGENT', 'tour', f'B is for {name}', {}),
        decision_number=1,
        battery=80.0,
        grid=Grid(cells, 0.1),
        positions={'A': (1.0, 1.0), 'B': (5.0, 1.0)},
        pose=(x, 1.0, 0.0),
        plan=np.array([(x, 1.0), (5.0, 1.0)]),
        fleet_report=FleetReport(('A', 'B'), 'B', heading_to='B', is_moving=True),
        notices=(
            Notice(f'{name} begins', at=1e9),
            Notice('door D closed', at=1e9 + 1.0, shared=True),
        ),
    )  # fmt: skip


FLEET = {
    '': MissionState(where='ROS domain 5').having(nodes={'armor_server': frozenset('1')}),
    'anna': robot('anna'),
    'bert': robot('bert', x=2.0),
    'carl': robot('carl', x=3.0),
}


# --- without ROS and without a browser ---
