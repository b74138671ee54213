"""What a person can do, against scripted and real services."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from floor_plans.parameters import make_place
from patrol_policy.decision import DecisionSettings
from state_machines.exceptions import CallError
from surveillance_behaviour.reasoner_node import Reasoner
from surveillance_interfaces.srv import (
    ForceOutcome,
    GoTo,
    MarkerRoutine,
    PlaceObstacle,
    SetAutonomy,
    SetDoor,
    WhyNot,
)
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_operator.console_commands import answer
from surveillance_operator.mission_actions import MissionActions
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.waiting import AwaitedEvent
from tests.operator.prompt import Prompt

PLACE = {
    'map.A': ['D'],
    'map.B': ['D'],
    'room_positions.A': [1.0, 1.0],
    'room_positions.B': [5.0, 1.0],
    'robot_room': 'A',
    'recharge_rooms': ['A'],
}


@pytest.fixture
def actions(graph: Any) -> MissionActions:
    return MissionActions(graph.add(PatrolNode, name='hands'), timeout=60.0)


def serve(graph: Any, kind: Any, name: str, **answer: Any) -> list[Any]:
    requests: list[Any] = []

    def on_request(request: Any, response: Any) -> Any:
        requests.append(request)
        for field, value in answer.items():
            setattr(response, field, value)
        return response

    graph.node.create_service(kind, name, on_request)
    return requests


def test_a_door_of_a_simulation_is_moved_and_else_told_to_the_map(
    graph: Any, actions: MissionActions
) -> None:
    told = serve(graph, SetDoor, 'ontology_map/set_door', success=True, message='known')
    graph.until(lambda: actions._callers['ontology_map/set_door'].is_ready())
    assert actions.set_door('D1', False) == 'known'
    moved = serve(graph, SetDoor, 'simulation/set_door', success=True, message='moved')
    graph.until(lambda: actions._callers['simulation/set_door'].is_ready())
    assert actions.set_door('D1', True) == 'moved'
    assert (told[0].door, told[0].open, moved[0].open) == ('D1', False, True)


def test_a_simulated_door_is_moved_by_whoever_has_just_started(
    graph: Any, actions: MissionActions
) -> None:
    told = serve(graph, SetDoor, 'ontology_map/set_door', success=True, message='known')
    graph.until(lambda: actions._callers['ontology_map/set_door'].is_ready())
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(actions.set_door, 'D1', True)
        serve(graph, SetDoor, 'simulation/set_door', success=True, message='moved')
        assert answer.result(60.0) == 'moved'
    assert told == []


def test_a_movement_of_the_arm_is_waited_for(graph: Any) -> None:
    moves, moved = AwaitedEvent(graph.node), threading.Event()

    async def move(_request: Any, response: Any) -> Any:
        await moves.wait_for(moved.is_set)
        response.success, response.message = True, 'at pose left'
        return response

    def arrive() -> None:
        moved.set()
        moves.happen()

    graph.node.create_service(MarkerRoutine, 'move_arm', move)
    hurried = MissionActions(graph.add(PatrolNode, name='hurried'), timeout=0.2)
    graph.until(lambda: hurried._callers['move_arm'].is_ready())
    timer = threading.Timer(0.5, arrive)
    timer.start()
    assert hurried.move_arm('left') == 'at pose left'
    timer.join()


def test_a_call_that_the_end_of_the_program_cuts_short_says_so(
    graph: Any, actions: MissionActions
) -> None:
    actions._node.stopping.set()
    with pytest.raises(CallError, match=r'^robot_behavior is not running$'):
        actions.go_to('R3')
    moves = AwaitedEvent(graph.node)

    async def move(_request: Any, response: Any) -> Any:
        await moves.wait_for(lambda: False)
        return response

    graph.node.create_service(MarkerRoutine, 'move_arm', move)
    graph.add(PatrolNode, name='arm_controller')
    graph.until(lambda: actions._callers['move_arm'].is_ready() and not actions._away('move_arm'))
    with pytest.raises(CallError, match=r'^this program ends before move_arm has answered$'):
        actions.move_arm('left')


def test_a_refusal_is_said_in_the_words_of_the_node(graph: Any, actions: MissionActions) -> None:
    serve(graph, GoTo, 'go_to', success=False, message='no place is called R9')
    serve(graph, WhyNot, 'why_not', success=True, message='R3 can wait', premises=['URGENT(R3)'])
    serve(graph, Trigger, 'robot_behavior/fsm/pause', success=True)
    with pytest.raises(ValueError, match='no place is called R9'):
        actions.go_to('R9')
    assert actions.why_not('R3') == ('R3 can wait', ['URGENT(R3)'])
    assert actions.machine('pause') == 'state machine: paused'


def test_a_person_approves_and_sets_the_autonomy(graph: Any, actions: MissionActions) -> None:
    approved = serve(graph, ForceOutcome, 'robot_behavior/fsm/approve', success=True)
    levels = serve(graph, SetAutonomy, 'robot_behavior/fsm/set_autonomy', success=True)
    assert actions.machine('approve') == 'approved'
    assert actions.approve('failed') == 'going on with failed'
    assert [request.outcome for request in approved] == ['', 'failed']
    assert actions.set_autonomy('low') == 'autonomy: low'
    assert levels[0].level == 1
    with pytest.raises(ValueError, match=r"'hihg': expected .*high"):
        actions.set_autonomy('hihg')


def test_a_parameter_is_set_or_the_reason_told(graph: Any, actions: MissionActions) -> None:
    results = [SetParametersResult(successful=True)]
    asked = serve(graph, SetParameters, 'robot_behavior/set_parameters', results=results)
    assert actions.set_threshold('90') == 'urgency_threshold of robot_behavior is 90'
    assert asked[0].parameters[0].value.integer_value == 90
    results[0] = SetParametersResult(successful=False, reason='not now')
    with pytest.raises(ValueError, match='not now'):
        actions.set_policy('tour')


def test_any_parameter_of_a_running_node_is_looked_at_and_set(
    graph: Any, actions: MissionActions
) -> None:
    reasoner = graph.add(Reasoner, parameters={'urgency_threshold': 240})

    def said(line: str) -> str:
        (told,) = answer(line, actions, Prompt())
        return told.text

    assert '* urgency_threshold' in said('param list reasoner')
    assert said('param get reasoner urgency_threshold').splitlines() == [
        'urgency_threshold is 240',
        '  Seconds without a visit after which a place is URGENT.',
        '  expected: an integer from 0 to 1000000000',
        '  change it: param set reasoner urgency_threshold VALUE',
    ]
    assert said('param set reasoner robot_speed 2') == 'robot_speed of reasoner is 2.0'
    assert said('param set reasoner policy OLDEST') == "policy of reasoner is 'oldest'"
    assert said("param set reasoner recharge_rooms [E, '1']").endswith("is ['E', '1']")
    values = [reasoner.get_parameter(name).value for name in ('robot_speed', 'policy')]
    assert [*values, reasoner.get_parameter('recharge_rooms').value] == [2.0, 'oldest', ['E', '1']]
    for line, words in (
        ('param set reasoner policy fast', "parameter policy: got 'fast', expected one of 'tour'"),
        ('param set reasoner robot_sped 2', "no parameter robot_sped: expected 'robot_speed'"),
        ('param list resoner', "there is no node resoner: expected 'reasoner'"),
        ('param set reasoner random_seed 7', 'read once, when reasoner starts: give it there, as'),
        ('param set reasoner use_sim_time true', 'use_sim_time is read once, when reasoner'),
        ('param set reasoner robot_speed [', 'the value is not valid YAML'),
    ):
        assert words in said(line)
        assert '\n' not in said(line)
    assert said('param get reasoner random_seed').endswith(
        'only when reasoner starts, as launch.py -p reasoner:random_seed:=VALUE'
    )


def test_what_a_person_sets_reaches_the_node_that_decides(
    graph: Any, actions: MissionActions
) -> None:
    behaviour = graph.add(PatrolNode, name='robot_behavior')
    owned = behaviour.declare_live(DecisionSettings())
    reasoner = graph.add(Reasoner, parameters={'robot_speed': 2.0})
    follows = reasoner.decision_maker.settings
    graph.until(lambda: behaviour.count_subscribers('/parameter_events'))
    assert actions.set_threshold('90') == 'urgency_threshold of robot_behavior is 90'
    assert actions.set_policy('oldest') == "policy of robot_behavior is 'oldest'"
    graph.until(lambda: (follows.urgency_threshold, follows.policy) == (90, 'oldest'))
    actions.set_parameter('robot_behavior', 'rooms_priority', '[ROOM]')
    graph.until(lambda: follows.priorities.classes == ('ROOM',))
    levels = {'battery_require_recharge': 92, 'battery_stop_recharge': 95}
    together = [Parameter(name, value=value) for name, value in levels.items()]
    assert behaviour.set_parameters_atomically(together).successful
    graph.until(lambda: follows.battery == owned.battery)
    assert (owned.urgency_threshold, owned.policy) == (90, 'oldest')
    assert follows.speed == 2.0, 'what nobody changed stays as it was given'


@pytest.mark.parametrize(
    ('call', 'words'),
    [
        (lambda a: a.set_door('D 1', True), "name 'D 1': expected letters"),
        (lambda a: a.place_obstacle('box', 'x', 0, 1), "'x': expected a finite number"),
        (lambda a: a.place_obstacle('box', float('nan'), 0, 1), 'expected a finite number'),
        (
            lambda a: a.set_threshold('1.5'),
            'threshold: got 1.5, expected an integer from 0',
        ),
        (lambda a: a.set_threshold('-5'), 'got -5, expected an integer from 0 to 1000000000'),
        (lambda a: a.set_policy('fast'), "got 'fast', expected one of 'tour'"),
        (lambda a: a.machine('stop'), 'expected pause, step, resume or approve'),
        (lambda a: a.move_arm('up'), 'expected left, home, right, back or stop'),
        (lambda a: a.command('simulator', 'x'), 'expected one of battery_controller'),
        (lambda a: a.explain('URGENT'), 'expected CLASS'),
    ],
)
def test_what_cannot_be_asked_for_is_refused_before_it_is_asked(
    call: Any, words: str, actions: MissionActions
) -> None:
    with pytest.raises(ValueError, match=words):
        call(actions)


def test_a_service_that_is_not_there_is_said_at_once(actions: MissionActions) -> None:
    with pytest.raises(CallError, match=r'^simulator is not running$'):
        actions.remove_obstacle('box')


def test_a_node_that_is_away_is_named(graph: Any) -> None:
    actions = MissionActions(graph.add(PatrolNode, name='hands'), timeout=0.1)
    for call, node in (
        (lambda: actions.set_policy('tour'), 'robot_behavior'),
        (lambda: actions.parameters('armor_server'), 'armor_server'),
        (lambda: actions.facts('R1'), 'ontology_map_builder'),
        (lambda: actions.command('motion_controller', 'move 1 1'), 'motion_controller'),
        (lambda: actions.go_to('R1'), 'robot_behavior'),
    ):
        with pytest.raises(CallError, match=rf'^{node} is not running$'):
            call()
    graph.add(PatrolNode, name='robot_behavior')
    graph.until(lambda: 'robot_behavior' in actions._node.get_node_names())
    with pytest.raises(CallError, match=r'^reasoner is not running$'):
        actions.go_to('R1')


def test_a_service_that_each_mission_has_is_waited_for(graph: Any) -> None:
    actions = MissionActions(graph.add(PatrolNode, name='hands'), timeout=60.0)
    actions._found_by = 0.0  # it started long ago
    with ThreadPoolExecutor() as pool:
        asked = pool.submit(actions.why_not, 'R1')
        with pytest.raises(TimeoutError):
            asked.result(1.0)
        serve(graph, WhyNot, 'why_not', success=True, message='too far')
        assert asked.result(60.0) == ('too far', [])


def test_facts_and_their_proofs_come_from_the_ontology(graph: Any, actions: MissionActions) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, parameters=PLACE)
    graph.until(lambda: actions._callers['ontology_map/reference_name'].is_ready())
    facts = dict(actions.facts('A'))
    assert facts['hasDoor(A, D)'] is True
    assert facts['connectedTo(A, B)'] is False
    (depth, first), *premises = actions.explain('connectedTo(A, B)')
    assert depth == 0
    assert 'connectedTo' in first
    assert {depth for depth, _ in premises} >= {1}
    with pytest.raises(ValueError, match=r"^nothing is known of AA: expected 'A'$"):
        actions.facts('AA')
    with pytest.raises(ValueError, match='does not hold'):
        actions.explain('connectedTo(A, A)')


@pytest.mark.parametrize('name', ['R-1', '_1', 'r' * 80])
def test_every_name_that_a_place_may_have_can_be_used(
    graph: Any, actions: MissionActions, name: str
) -> None:
    told = serve(graph, GoTo, 'go_to', success=True, message='it goes there')
    make_place({name: ['D'], 'B': ['D']}, {name: [0.0, 0.0], 'B': [1.0, 0.0]}, name, [])
    assert actions.go_to(name) == 'it goes there'
    assert told[0].place == name


def test_several_people_may_act_at_once(graph: Any, actions: MissionActions) -> None:
    serve(graph, PlaceObstacle, 'simulation/place_obstacle', success=True, message='there')
    with ThreadPoolExecutor(4) as pool:
        answers = pool.map(lambda n: actions.place_obstacle(f'box{n}', n, 0, 0.3), range(12))
    assert list(answers) == ['there'] * 12
