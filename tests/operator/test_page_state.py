"""The parts of the page, and patches of what changed."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np

from patrol_policy.idleness_bounds import IdlenessBound
from surveillance_operator.mission_changes import follow
from surveillance_operator.mission_state import (
    RECORD_OF,
    RECORDS,
    MissionState,
    NodeReport,
    Status,
)
from surveillance_operator.page import server
from surveillance_operator.page_state import PARTS, PatchMaker, health, merged_events, traced
from surveillance_operator.watch.view import node_page
from tests.operator.missions import DECISION, FLEET, whole


def test_a_node_that_reports_nothing_is_up_and_each_start_again_is_counted() -> None:
    def running(process: str, before: MissionState) -> MissionState:
        new = before.having(nodes={'robot_behavior': frozenset({process})})
        return follow(before, new, 0.0)[0]

    state = running('1', MissionState())
    assert [line.plain for line in node_page(state)] == ['● up    robot_behavior']
    state = running('3', running('2', state))
    (line,) = node_page(state)
    assert line.plain == '● up    robot_behavior, started again 2 times'


INNER = {
    'now': 'the time goes with each message',
    'namespace': 'the robot is chosen by its name',
    'measured': 'each figure reads its own of it',
    'pose_time': 'pairs scans with poses',
    'lidar': 'becomes the scan on the map',
    'camera': 'becomes the markers on the map',
    'stands': 'becomes the markers on the map',
    'localised': 'says whose pose counts',
    'trail': 'is lengthened by whoever follows the pose',
}


"""The fields that no view shows by themselves, with what they are for."""


def test_each_field_of_a_state_is_shown_by_some_part_or_said_to_be_inner() -> None:
    bound = IdlenessBound('A', 'within', 240.0, 60.0, 'A within 240 s')
    state = whole().having(idleness_bounds=(bound,))
    read = set(INNER) | set(RECORDS)
    for compute in PARTS.values():
        read |= traced(compute, state)[1].keys()
    assert RECORD_OF.keys() - read == set()
    assert INNER.keys() <= RECORD_OF.keys()


def test_the_page_draws_each_part_and_asks_for_no_other() -> None:
    text = (server.STATIC / 'main.js').read_text('utf-8')
    drawn = text[text.index('const MAP_PARTS') : text.index('function receive')]
    needs = set(re.findall(r"'(\w+)'", ''.join(re.findall(r'\[[^\[\]]*\]', drawn))))
    assert PARTS.keys() - needs == set(), 'a part that no section of the page draws'
    of_the_page = {'robots', 'trail'}
    of_old_recordings = {'battery'}
    assert needs - PARTS.keys() == of_the_page | of_old_recordings


def test_a_part_is_computed_anew_when_a_field_that_it_reads_changes() -> None:
    computed = []

    def part(state: MissionState) -> Any:
        computed.append(state)
        return [state.whereabouts, state.task.battery if state.task.stopped else None]

    maker = PatchMaker()
    maker._parts = {'part': part}
    state = MissionState().having(robot_place='A')
    assert maker.patch(state) == {'part': ['in A', None]}
    assert maker.patch(state.having(battery=5.0, policy='tour')) == {}
    assert len(computed) == 1, 'the battery was not read'
    assert maker.patch(state.having(robot_place='B')) == {'part': ['in B', None]}
    assert maker.patch(state.having(stopped=True, battery=5.0)) == {'part': ['in A', 5.0]}
    assert maker.patch(state.having(stopped=True, battery=6.0)) == {'part': ['in A', 6.0]}


def test_a_patch_holds_what_changed_alone() -> None:
    patches = PatchMaker()
    first = patches.patch(MissionState().having(battery=50.0, decision=DECISION, decision_number=1))
    assert first['brief'] == 'battery 50 %'
    assert (
        patches.patch(MissionState().having(battery=50.0, decision=DECISION, decision_number=1))
        == {}
    )
    after = patches.patch(MissionState().having(battery=49.0, decision=DECISION, decision_number=1))
    assert after.keys() == {'brief', 'figures'}
    assert after['brief'] == 'battery 49 %'


def test_a_robot_that_waits_for_help_has_no_plan() -> None:
    patches = PatchMaker()
    moving = Status(0.0, 'm', 'MOVE', 'A', 'B', False, '', ())
    state = MissionState().having(status=moving, plan=np.array([(0.0, 0.0), (1.0, 0.0)]))
    assert patches.patch(state)['plan'] == [[0.0, 0.0], [1.0, 0.0]]
    stuck = state.having(status=replace(moving, waiting_for_help=True))
    assert patches.patch(stuck)['plan'] == []


def test_one_time_line_names_each_robot_and_tells_of_the_place_once() -> None:
    told = {
        '': [[12.0, 'armor_server was started again']],
        'anna': [[10.0, 'arrived in A'], [11.0, 'door D closed', 1], [30.0, 'door D closed', 1]],
        'bert': [[9.0, 'arrived in A'], [11.4, 'door D closed', 1]],
    }
    assert merged_events(told) == [
        [9.0, 'bert', 'arrived in A'],
        [10.0, 'anna', 'arrived in A'],
        [11.0, '', 'door D closed'],
        [12.0, '', 'armor_server was started again'],
        [30.0, '', 'door D closed'],
    ]


def test_a_program_that_robots_share_stands_once_in_the_health_of_each() -> None:
    good = NodeReport(0, 'up', ())
    names = ('anna/planner_controller', 'anna/mission_markers', 'simulator', 'armor_server')
    anna = FLEET['anna'].having(
        nodes=dict.fromkeys(('simulator', 'planner_controller'), frozenset('1'))
    )
    found = health(anna.having(namespace='anna', reports=dict.fromkeys(names, good)))
    assert {name: len(node['reports']) for name, node in found['nodes'].items()} == {
        'planner_controller': 1,
        'simulator': 1,
    }
    assert found['others'].keys() == {'armor_server', 'mission_markers'}
