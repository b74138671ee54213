"""The map that decisions are made on: the same object until something changes."""

from __future__ import annotations

import pytest

from floor_plans import Station
from patrol_policy.decision import DecisionSettings
from state_machines import Interrupt
from state_machines.exceptions import CallError
from surveillance_behaviour.learned_times import LegTimes
from surveillance_behaviour.patrol_map import PatrolMap
from surveillance_ontology.robot_ontology import Snapshot

from .scripted_world import World

NOBODY = Interrupt()


def snapshot(place: str = 'C1', **ways: list[str]) -> Snapshot:
    known = ways or {'C1': ['E', 'R1'], 'E': ['C1'], 'R1': ['C1'], 'R4': []}
    connections = {name: tuple(others) for name, others in known.items()}
    nothing = frozenset[str]()
    return Snapshot(place, 0, (), dict.fromkeys(connections, nothing), {}, connections)


def test_the_map_is_the_part_that_can_be_reached_and_stays_the_same_object() -> None:
    settings = DecisionSettings(speed=1.0, exploration_seconds=2.0)
    here = PatrolMap(World(), settings, LegTimes(1.0))
    graph = here.update(snapshot(), {}, NOBODY)
    assert set(graph.places) == {'C1', 'E', 'R1'}
    assert here.places == {'C1', 'E', 'R1', 'R4'}
    assert here.update(snapshot('R1'), {}, NOBODY) is graph
    assert here.with_straight_times() is here.with_straight_times()
    assert here.update(snapshot(), {'R1': 9.0}, NOBODY).own_exploration == {'R1': 9.0}
    assert here.metres('C1', 'R1') == 3.0
    assert here.metres('C1', 'R9') == 0.0
    assert here.detour('C1', 'R1') == ()
    station = Station((10.0, 6.0, 0.0))
    assert here.approaches({'R1': station, 'R9': station}) == {'R1': 1.0}


def test_all_robots_of_a_fleet_compute_with_straight_times_whatever_they_have_learned() -> None:
    times = LegTimes(1.0)
    here = PatrolMap(World(), DecisionSettings(speed=1.0), times)
    for _ in range(20):
        times.observe('C1', 'R1', 30.0, 3.0)
    here.update(snapshot(), {}, NOBODY)
    assert here.graph.leg_seconds['C1']['R1'] > 20.0
    assert here.with_straight_times().leg_seconds['C1']['R1'] == 3.0


def test_a_robot_that_is_not_on_the_map_is_named() -> None:
    here = PatrolMap(World(), DecisionSettings(), LegTimes(1.0))
    with pytest.raises(CallError, match='the robot is in R9, which is not on the map'):
        here.update(snapshot('R9'), {}, NOBODY)
