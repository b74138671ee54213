"""The node `reasoner` answers whoever asks, however slow its ontology is."""

from __future__ import annotations

import json
import threading
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from patrol_policy.idleness_bounds import WITHIN, IdlenessBound
from patrol_policy.situation import Decision
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.conversions import idleness_bounds_from
from surveillance_behaviour.reasoner_node import Reasoner
from surveillance_interfaces.srv import Reason
from surveillance_runtime.qos import STATE_QOS


def test_requests_that_come_while_a_choice_is_made_share_the_next_one(
    graph: Any, monkeypatch: Any
) -> None:
    reasoner = graph.add(Reasoner)
    looks: list[threading.Event] = []

    def look(*_: Any) -> None:
        done = threading.Event()
        looks.append(done)
        assert done.wait(60.0)
        raise CallError('armor: away')

    monkeypatch.setattr(reasoner.decision_maker, 'decide', look)
    client = graph.node.create_client(Reason, 'reason')
    graph.until(client.service_is_ready)
    answers = [client.call_async(Reason.Request())]
    graph.until(lambda: len(looks) == 1)
    answers += [client.call_async(Reason.Request()) for _ in range(3)]
    taken = client.call_async(Reason.Request())
    graph.until(lambda: reasoner._next is not None)
    looks[0].set()
    graph.until(lambda: len(looks) == 2)

    def answered() -> bool:
        for look_goes_on in looks:  # a request that was taken late has a third one
            look_goes_on.set()
        return all(answer.done() for answer in [*answers, taken])

    graph.until(answered)
    assert {answer.result().point for answer in answers} == {''}
    assert len(looks) <= 3, 'one choice for each request'


def test_a_choice_that_begins_at_once_is_given_once(graph: Any, monkeypatch: Any) -> None:
    reasoner = graph.add(Reasoner)
    answers = iter(['C1', 'C2'])
    begun = threading.Event()

    def choose_now(*_: Any) -> Any:
        return Decision(0.0, 'E', next(answers), 'E', 'ROOM', 'tour', '', {})

    put = reasoner._work.run

    def run_and_wait(work: Any) -> Any:
        future = put(lambda: (begun.set(), work())[1])
        assert begun.wait(60.0)
        # The worker goes on while the request that asked is still on its way.
        graph_pause.wait(0.05)
        return future

    graph_pause = threading.Event()
    monkeypatch.setattr(reasoner.decision_maker, 'decide', choose_now)
    monkeypatch.setattr(reasoner._work, 'run', run_and_wait)
    client = graph.node.create_client(Reason, 'reason')
    graph.until(client.service_is_ready)
    for place in ('C1', 'C2'):
        answer = client.call_async(Reason.Request())
        graph.until(answer.done)
        assert answer.result().point == place


def test_a_choice_that_ends_with_its_node_is_no_failure(graph: Any, monkeypatch: Any) -> None:
    reasoner = graph.add(Reasoner)
    warned: list[str] = []

    def interrupted(*_: Any) -> None:
        raise CallInterruptedError

    monkeypatch.setattr(reasoner.get_logger(), 'warn', warned.append)
    monkeypatch.setattr(reasoner.decision_maker, 'decide', interrupted)
    assert reasoner._choose() == ''
    assert not warned


def test_the_hours_of_a_place_that_was_changed_are_told_with_the_bounds(
    graph: Any,
) -> None:
    reasoner = graph.add(Reasoner)
    model, told = reasoner.decision_maker, list[DiagnosticArray]()
    graph.node.create_subscription(DiagnosticArray, 'idleness_bounds', told.append, STATE_QOS)
    places = graph.node.create_publisher(String, 'place', STATE_QOS)
    described = {'room_positions': {'R1': [1.0, 1.0]}, 'hours': {'R1': 'mon-fri 08:00-18:00'}}
    places.publish(String(data=json.dumps(described)))
    graph.until(lambda: 'R1' in model.rules.calendar.hours)
    model.idleness.publish((IdlenessBound('R1', WITHIN, 60.0, 30.0, 'R1: visited'),))
    graph.until(lambda: bool(told))
    assert idleness_bounds_from(told[-1])[1] == {'R1': 'mon-fri 08:00-18:00'}


def test_a_robot_of_a_fleet_keeps_its_dock_when_the_place_is_changed(graph: Any) -> None:
    docks = {'stations.E.pose': [5.0, 10.0, 0.0], 'stations.R4.pose': [15.0, 15.0, 0.0]}
    own = {'fleet': True, 'recharge_rooms': ['E'], **docks}
    reasoner = graph.add(Reasoner, parameters=own)
    places = graph.node.create_publisher(String, 'place', STATE_QOS)
    described = {
        'room_positions': {'E': [5.0, 10.0], 'R4': [15.0, 15.0]},
        'recharge_rooms': ['E', 'R4'],
        'stations': {'E': {'pose': [5.0, 10.0, 0.0]}, 'R4': {'pose': [15.0, 15.0, 0.0]}},
        'hours': {'R4': 'mon-fri 08:00-18:00'},
    }
    places.publish(String(data=json.dumps(described)))
    graph.until(lambda: 'R4' in reasoner.decision_maker.rules.calendar.hours)
    graph.until(lambda: set(reasoner.decision_maker.stations) == {'E', 'R4'})
    assert reasoner.get_parameter('recharge_rooms').value == ['E']
