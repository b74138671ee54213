"""The same world gives the same mission, on every machine and in every version.

Whoever compares two logs, or replays one, relies on it. The missions were recorded on 27 November
2026. A change of the search that is meant may give others: then the waits below may not get longer,
and `python -m tests.test_simulation` in this library's folder prints the new ones.
"""

from __future__ import annotations

import pytest

from patrol_policy import plan as plan_module
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol, SimulatedBattery

from .test_cycle_search import one_way
from .test_plan import EQUAL_LEGS, LONG_LEG, chain, grid, town
from .worlds import seven_rooms


def patrols() -> dict[str, Patrol]:
    """Return patrols that have not begun: rules, thresholds, charging, and larger maps."""
    rooms = seven_rooms()
    tour = rooms.tour.length
    station = SimulatedBattery(draw=0.35, charge=1.5)
    return {
        'rooms': Patrol(rooms, Priorities(), 'tour', 0.75 * tour, 'E'),
        'own': Patrol(
            rooms,
            Priorities(),
            'tour',
            tour,
            'E',
            own_thresholds={'R3': 0.4 * tour, 'C1': 0.5 * tour},
        ),
        'any': Patrol(one_way(5, 11), Priorities(()), 'tour', 40.0, 'P0'),
        'held': Patrol(chain(6), Priorities(), 'tour', 2.0 * chain(6).tour.length, 'P0'),
        'equal': Patrol(EQUAL_LEGS, Priorities(), 'tour', EQUAL_LEGS.tour.length, 'P0'),
        'long': Patrol(LONG_LEG, Priorities(), 'tour', 0.5 * LONG_LEG.tour.length, 'P0'),
        'grid': Patrol(grid(4, 4), Priorities(), 'tour', 0.6 * grid(4, 4).tour.length, 'P00'),
        'town': Patrol(town(20, 5), Priorities(), 'tour', 0.5 * town(20, 5).tour.length, 'P00'),
        'charging': Patrol(rooms, Priorities(), 'tour', tour, 'E', station),
        'charging town': Patrol(town(14, 3), Priorities(), 'tour', 200.0, 'P00', station),
    }


MOVES = 60


def walked(patrol: Patrol) -> tuple[float, float, str]:
    """Return the longest wait of a mission's first moves, when they ended, and their places."""
    names: list[str] = []
    for _ in range(MOVES):
        decision = patrol.step()
        names.append(('+' if decision.rule == 'recharge' else '') + decision.place)
    return round(patrol.run.longest, 3), round(patrol.now, 3), ' '.join(names)


RECORDED = {
    'rooms': (
        101.723,
        387.415,
        """
        C1 C2 E C1 C2 E C1 R1 C1 R2 C1 C2 R3 C2 R4 C2 E C1 R1 C1 R2 C1 C2 R3 C2 R4 C2 E C1 R1 C1
        R2 C1 C2 R3 C2 R4 C2 E C1 R1 C1 R2 C1 C2 R3 C2 R4 C2 E C1 R1 C1 R2 C1 C2 R3 C2 R4 C2
        """,
    ),
    'own': (
        123.723,
        377.568,
        """
        C2 C1 C2 C1 C2 R3 C2 E C1 E C1 R2 C1 R1 C1 C2 R3 C2 R4 C2 E C1 C2 R3 C2 C1 R2 C1 R1 C1
        C2 R3 C2 R4 C2 E C1 C2 R3 C2 C1 R2 C1 R1 C1 C2 R3 C2 R4 C2 E C1 C2 R3 C2 C1 R2 C1 R1 C1
        """,
    ),
    'any': (
        99.828,
        543.613,
        """
        P10 P2 P5 P4 P1 P9 P8 P7 P6 P3 P0 P10 P2 P5 P4 P1 P9 P8 P7 P6 P3 P0 P10 P2 P5 P4 P1 P9
        P8 P7 P6 P3 P0 P10 P2 P5 P4 P1 P9 P8 P7 P6 P3 P0 P10 P2 P5 P4 P1 P9 P8 P7 P6 P3 P0 P10
        P2 P5 P4 P1
        """,
    ),
    'held': (
        189.0,
        420.0,
        """
        P1 P2 P3 P4 P3 P2 P1 P2 P3 P4 P3 P2 P1 P2 P3 P4 P3 P2 P1 P2 P1 P0 P1 P2 P3 P4 P5 P4 P3
        P2 P1 P2 P3 P4 P3 P2 P1 P2 P3 P4 P3 P2 P1 P0 P1 P2 P3 P4 P5 P4 P3 P2 P1 P2 P3 P4 P3 P2
        P1 P2
        """,
    ),
    'equal': (
        144.667,
        620.0,
        """
        P4 P0 P2 P3 P2 P0 P4 P3 P4 P1 P4 P0 P2 P5 P2 P3 P2 P0 P4 P1 P4 P0 P2 P5 P2 P3 P2 P0 P4
        P1 P4 P0 P2 P5 P2 P3 P2 P0 P4 P1 P4 P0 P2 P5 P2 P3 P2 P0 P4 P1 P4 P0 P2 P5 P2 P3 P2 P0
        P4 P1
        """,
    ),
    'long': (
        76.0,
        632.0,
        """
        P4 P1 P3 P1 P0 P2 P0 P4 P1 P3 P1 P0 P2 P0 P4 P1 P3 P1 P0 P2 P0 P4 P1 P3 P1 P0 P2 P0 P4
        P1 P3 P1 P0 P2 P0 P4 P1 P3 P1 P0 P2 P0 P4 P1 P3 P1 P0 P2 P0 P4 P1 P3 P1 P0 P2 P0 P4 P1
        P3 P1
        """,
    ),
    'grid': (
        112.0,
        420.0,
        """
        P01 P02 P03 P13 P23 P33 P32 P31 P30 P20 P21 P22 P12 P11 P10 P00 P01 P02 P03 P13 P23 P33
        P32 P31 P30 P20 P21 P22 P12 P11 P10 P00 P01 P02 P03 P13 P23 P33 P32 P31 P30 P20 P21 P22
        P12 P11 P10 P00 P01 P02 P03 P13 P23 P33 P32 P31 P30 P20 P21 P22
        """,
    ),
    'town': (
        580.84,
        946.734,
        """
        P17 P00 P01 P02 P01 P04 P05 P10 P11 P12 P10 P05 P04 P15 P01 P00 P09 P18 P09 P16 P13 P03
        P08 P14 P08 P03 P00 P07 P17 P00 P01 P02 P19 P02 P01 P04 P05 P06 P05 P10 P11 P12 P10 P05
        P04 P15 P01 P00 P09 P18 P09 P16 P13 P03 P08 P14 P08 P03 P00 P07
        """,
    ),
    'charging': (
        131.213,
        487.184,
        """
        C2 C1 C2 C1 +E C2 +E C1 +E C2 R4 C2 R3 C2 C1 R2 C1 R1 +E C2 R4 C2 R3 C2 C1 R2 C1 R1 +E
        C2 R4 C2 R3 C2 C1 R2 C1 R1 +E C2 R4 C2 R3 C2 C1 R2 C1 R1 +E C2 R4 C2 R3 C2 C1 R2 C1 R1
        +E C2
        """,
    ),
    'charging town': (
        545.768,
        1506.639,
        """
        P01 P02 P05 +P00 P04 P12 P04 P00 P03 P01 P08 P09 +P00 P01 P02 P10 P02 P07 P06 P13 P06
        P11 P06 P05 +P00 P04 P12 P04 P00 P03 P01 P08 P09 +P00 P01 P02 P10 P02 P07 P06 P13 P06
        P11 P06 P05 +P00 P04 P12 P04 P00 P03 P01 P08 P09 +P00 P01 P02 P10 P02 P07
        """,
    ),
}
"""The longest wait, the end, and the places; before a charge stands a plus."""


@pytest.mark.parametrize('name', RECORDED)
def test_a_recorded_mission_comes_again(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    # Far from the time at which a slow machine would end the search.
    monkeypatch.setattr(plan_module, 'FIRST_WORK', 40_000.0)
    longest, end, places = RECORDED[name]
    assert walked(patrols()[name]) == (longest, end, ' '.join(places.split()))


if __name__ == '__main__':
    plan_module.FIRST_WORK = 40_000.0
    for each, patrol in patrols().items():
        print(f'    {each!r}: {walked(patrol)},')
