"""Whole missions of real nodes: hundreds of moves in seconds, with everything that goes wrong."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from std_srvs.srv import Empty

from surveillance_behaviour.mission.recovery import Failure
from surveillance_interfaces.msg import Decision, FsmTransition, MissionStatus
from surveillance_interfaces.srv import GoTo, WhyNot
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS

from .robot import Robot, mission, place_parameters
from .scripted_peers import (
    ABORTED,
    ELSEWHERE,
    EMPTY,
    GOOD,
    NOT_FINITE,
    REJECTED,
    SHORT,
    SILENT,
    ScriptedMotion,
)
from .simulated_time import START

PLACES = {'C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4'}
BEHAVIOURS = ['surveillance', 'patrol']


@pytest.fixture(params=BEHAVIOURS)
def robot(
    request: pytest.FixtureRequest, graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[Robot]:
    with mission(graph, monkeypatch, request.param, tmp_path / 'events.jsonl') as robot:
        yield robot


def test_a_mission_reaches_all_places_and_charges(robot: Robot, graph: Any) -> None:
    decisions = graph.listen(Decision, 'decision', STATE_QOS)
    rules = {'URGENT', 'CORRIDOR', 'recharge'}

    def is_all_done() -> bool:
        done = robot.summary()
        often = set(done.visits) == PLACES and min(done.visits.values()) >= 2
        many = sum(done.visits.values()) >= 25
        return often and many and done.recharges >= 1 and rules <= set(done.rules)

    robot.begin()
    robot.until_true(is_all_done, since=0.0, latest=500.0)
    assert is_all_done(), robot.summary()
    assert not robot.summary().failures
    assert all(message.place in PLACES and message.reason for message in decisions)
    assert all(len(message.candidates) == len(message.scores) for message in decisions)


def test_every_node_may_leave_and_come_back(robot: Robot, graph: Any) -> None:
    status = graph.listen(MissionStatus, 'mission_status', STATE_QOS)
    robot.be_impatient()
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    moment = 40.0
    for name in [*robot.nodes]:
        robot.time.at(moment, lambda name=name: robot.leave(name))
        robot.time.at(moment + 8.0, lambda name=name: robot.arrive(name))
        moment += 30.0
    robot.until_visited(PLACES, since=moment, latest=moment + 300.0)
    assert any(message.waiting_for_help for message in status)
    assert robot.summary().restarts == 1


def test_an_initial_state_that_dies_while_it_looks_around_is_missed_at_once(
    graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = threading.Event()

    async def look_around(_request: Any, _response: Any) -> Any:
        asked.set()
        await Future()

    first = graph.add(PatrolNode, name='initial_state')
    first.create_service(Empty, 'start', look_around)
    with mission(graph, monkeypatch, 'patrol', tmp_path / 'events.jsonl') as robot:
        robot.begin('initial_state')
        graph.until(asked.is_set)
        graph.drop(first)
        graph.until(lambda: any(event.name == 'failure' for event in robot.events()))
        assert 'start: the server went away' in robot.events()[0].text('reason')
        robot.arrive('initial_state')
        robot.until(80.0)
        assert robot.visited()


def test_whatever_planner_and_controller_answer_the_mission_goes_on(
    robot: Robot, graph: Any
) -> None:
    parameters = place_parameters()
    positions = {
        key.partition('.')[2]: value
        for key, value in parameters.items()
        if key.startswith('room_positions.')
    }
    robot.configure('robot_behavior', deadline__plan=1.0, deadline__move=2.0)
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin('planner_controller', 'motion_controller')
    motion = graph.add(ScriptedMotion, {'use_sim_time': True}, positions=positions)
    robot.nodes['scripted_motion'] = motion
    motion.planning.extend([GOOD, REJECTED, GOOD, ABORTED, SILENT, EMPTY, ELSEWHERE, NOT_FINITE])
    motion.moving.extend([GOOD, SHORT, GOOD, ABORTED, SILENT, GOOD, REJECTED])
    robot.until_true(lambda: not (motion.planning or motion.moving), since=0.0, latest=300.0)
    assert not motion.planning
    assert not motion.moving
    since = robot.time.now - START
    robot.until_visited(PLACES, since=since, latest=since + 300.0)
    reasons = ' '.join(event.text('reason') for event in robot.events() if event.name == 'failure')
    for words in (
        'the goal was rejected',
        'the goal was aborted',
        'no result within',
        'the path has no points',
        'from the goal, expected at most 1 m',
        'a point that is not finite',
        'short, expected at most 1 m',
    ):
        assert words in reasons


def test_parameters_may_change_while_the_mission_runs(robot: Robot) -> None:
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    robot.until(40.0)
    chooser = 'reasoner' if 'reasoner' in robot.nodes else 'robot_behavior'
    node = robot.nodes[chooser]
    refused = robot.set_parameter(node, 'rooms_priority', ['URGENT', 'URGENT'])
    assert 'rooms_priority' in refused
    assert 'URGENT stands twice' in refused
    assert robot.set_parameter(node, 'rooms_priority', ['CORRIDOR']) == ''
    assert robot.set_parameter(node, 'policy', 'oldest') == ''
    robot.until(110.0)
    rules = [rule for _, rule in robot.decisions()][-5:]
    assert set(rules) == {'CORRIDOR'}


def test_a_stopped_node_ends_its_mission_cleanly(robot: Robot, graph: Any) -> None:
    latched = QoSProfile(
        depth=1000,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )
    transitions = graph.listen(FsmTransition, 'robot_behavior/fsm/transition', latched)
    robot.begin()
    robot.until(20.0)
    root = robot.nodes['robot_behavior'].machine.get_name()
    robot.leave('robot_behavior')
    assert robot.events()[-1].name == 'end'
    graph.until(lambda: (transitions[-1].path, transitions[-1].kind) == (root, 'exit'))
    assert transitions[-1].to_state == 'preempted'


def test_a_machine_that_breaks_is_started_again_and_does_not_cry_on(
    robot: Robot, graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    status = graph.listen(MissionStatus, 'mission_status', STATE_QOS)
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    robot.until(20.0)
    mission = robot.nodes['robot_behavior'].mission
    places, announcer = mission.ports.places, mission.ports.announcer
    right, broken = places.position, threading.Event()
    say_wait, failures = announcer.waiting_for_help, []

    def waiting_for_help(reason: str) -> None:
        failures.append(mission.failure)
        say_wait(reason)

    monkeypatch.setattr(announcer, 'waiting_for_help', waiting_for_help)

    def position(*arguments: Any) -> Any:
        if not broken.is_set():
            broken.set()
            mission.failure = Failure('moving', 'no path', 'R2')  # as of a step before
            raise RuntimeError('a mistake')
        return right(*arguments)

    monkeypatch.setattr(places, 'position', position)
    health = robot.nodes['robot_behavior'].health
    errors, note_error = [], health.error
    monkeypatch.setattr(
        health, 'error', lambda *said: (errors.append(said[1]), note_error(*said))[1]
    )
    robot.until(90.0)
    assert broken.is_set()
    assert failures[0] is None, 'no other cause'
    cries = [message.waiting_for_help for message in status]
    assert any('a mistake' in message.text for message in status)
    assert cries.count(True) < len(cries) / 2
    assert not cries[-1]
    assert [each for each in errors if 'a mistake' in each]
    # Whoever looks once a second of real time may have seen it wait.
    graph.until(lambda: not health.findings())
    assert len(robot.visited(since=30.0)) > 2


def test_an_operator_asks_why_not_and_sends_the_robot_to_a_place(robot: Robot, graph: Any) -> None:
    asked = graph.node.create_client(WhyNot, 'why_not')
    sent = graph.node.create_client(GoTo, 'go_to')
    robot.configure('battery_controller', random_battery_time=[5000.0, 6000.0])
    robot.begin()
    robot.until(20.0)
    graph.until(lambda: asked.service_is_ready() and sent.service_is_ready())

    def answer(client: Any, request: Any) -> Any:
        future = client.call_async(request)
        graph.until(future.done)
        return future.result()

    told = answer(asked, WhyNot.Request(place='R4'))
    assert told.success
    assert told.message
    wrong = answer(sent, GoTo.Request(place='R44'))
    assert not wrong.success
    assert "expected 'R4'" in wrong.message
    mission = robot.nodes['robot_behavior'].mission
    taken = {mission.place, mission.heading_to}
    place = next(room for room in ('R4', 'R3', 'R2') if room not in taken)
    assert answer(sent, GoTo.Request(place=place)).success
    robot.until_true(lambda: place in robot.visited(since=20.0), since=20.0, latest=120.0)
    assert (place, 'request') in robot.decisions()
    assert place in robot.visited(since=20.0)
    home = answer(sent, GoTo.Request())
    assert home.success
    assert 'E' in home.message
