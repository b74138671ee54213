"""What is known of a mission is one state: each fact comes from one source, for all views."""

from __future__ import annotations

from dataclasses import replace

import pytest

from patrol_policy.idleness_bounds import IdlenessBound
from surveillance_interfaces.msg import MissionStatus, RobotPlace
from surveillance_operator.console_node import status_line
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_state import (
    RECORD_OF,
    RECORDS,
    MissionState,
)
from surveillance_operator.mission_words import doing
from surveillance_operator.page_state import PatchMaker
from surveillance_operator.topics import TOPICS, read_message
from surveillance_operator.watch.view import place_lines, state_lines

TOPIC = {topic.name: topic for topic in TOPICS}
RUNS = MissionState(now=5.0).having(
    nodes={'robot_behavior': frozenset({'1'})}, visited_at={'E': 1.0, 'C2': 1.0}
)


def on_its_way() -> MissionState:
    """Return a mission whose robot was in E at the last transition, and is in C2 by now."""
    status = MissionStatus(machine='surveillance', state='MOVE', place='E', heading_to='C2')
    state = read_message(RUNS, TOPIC['mission_status'], status)
    return read_message(state, TOPIC['robot_place'], RobotPlace(place='C2'))


def test_every_view_has_the_robot_where_it_is_localised() -> None:
    state = on_its_way()
    assert state.whereabouts == 'in C2'
    assert state_lines(state)[1].plain == 'in C2'
    assert 'C2 0:04  ●' in place_lines(state, 60)[0].plain
    assert ' in C2 ' in status_line(state)
    assert fleet_lines({'anna': state})[0].split()[1] == 'C2'
    assert doing(state) == 'move'
    status = PatchMaker().patch(state)['status']
    assert (status['place'], status['whereabouts']) == ('C2', 'in C2')


def test_a_robot_that_nobody_localises_is_where_its_behaviour_has_it() -> None:
    state = read_message(on_its_way(), TOPIC['robot_place'], RobotPlace(place=''))
    assert state.whereabouts == 'in E, heading for C2'


def test_that_the_robot_is_in_another_place_is_a_line_of_the_log() -> None:
    before = read_message(on_its_way(), TOPIC['robot_place'], RobotPlace(place='C1'))
    _, told = follow(before, on_its_way(), 1.0)
    assert [each.text for each in told] == ['surveillance MOVE: in C2']


def test_a_place_that_was_removed_is_late_for_nobody() -> None:
    bounds = tuple(IdlenessBound(name, 'never', 60.0, 90.0, f'{name} is late') for name in 'AB')
    state = RUNS.having(idleness_bounds=bounds, positions={'A': (0.0, 0.0), 'B': (1.0, 0.0)})
    patches = PatchMaker()
    assert patches.patch(state)['idleness_bounds'].keys() == {'A', 'B'}
    left = patches.patch(state.having(positions={'A': (0.0, 0.0)}))
    assert left['idleness_bounds'].keys() == {'A'}
    assert 'B' not in left['kept']


def test_a_field_that_there_is_not_cannot_be_set() -> None:
    with pytest.raises(KeyError, match='batery'):
        MissionState().having(batery=5.0)
    state = MissionState(where='here').having(battery=5.0, now=1.0)
    assert (state.field('battery'), state.field('now'), state.where) == (5.0, 1.0, 'here')
    assert replace(state, now=2.0).task is state.task


"""The fields that no view shows by themselves, with what they are for."""


def test_no_two_records_of_a_state_have_a_field_of_the_same_name() -> None:
    assert len(RECORD_OF) == sum(len(each.__dataclass_fields__) for each in RECORDS.values())
