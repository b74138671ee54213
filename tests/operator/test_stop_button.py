"""The Stop as it is pressed: who is asked, what is said, and what stands when nobody answers."""

from __future__ import annotations

from typing import Any

import pytest
from std_srvs.srv import SetBool, Trigger

from state_machines.exceptions import CallError
from surveillance_interfaces.msg import StopRequest
from surveillance_operator.stop_button import StopButton
from surveillance_runtime.node import PatrolNode


def answering(graph: Any, name: str, message: str, *, success: bool = True) -> list[bool]:
    """Offer a service that answers a press; return what it was asked."""
    asked: list[bool] = []

    def answer(request: Any, response: Any) -> Any:
        asked.append(request.data)
        response.success, response.message = success, message
        return response

    graph.node.create_service(SetBool, name, answer)
    return asked


def button_of(graph: Any, robot: str = '', owner: str = '') -> StopButton:
    return StopButton(graph.add(PatrolNode, name='console'), robot, owner)


@pytest.mark.parametrize(('owner', 'told'), [('the guard', 'the guard'), ('', 'console')])
def test_a_press_tells_who_stops_the_robot_and_what_the_monitor_says(
    graph: Any, owner: str, told: str
) -> None:
    asked = answering(graph, 'stop', 'done')
    requests = graph.listen(StopRequest, 'stop_requested', 10)
    button = button_of(graph, owner=owner)
    assert button.press(True) == 'done'
    graph.until(lambda: requests)
    assert requests[0].owner == told
    assert button.press(False) == 'done'
    assert asked == [True, False]


def test_a_robot_of_a_fleet_is_stopped_alone(graph: Any) -> None:
    own, other = answering(graph, 'anna/stop', 'anna'), answering(graph, 'bert/stop', 'bert')
    assert button_of(graph, 'anna').press(True) == 'anna'
    assert (own, other) == ([True], [])


def test_what_the_monitor_refuses_is_said(graph: Any) -> None:
    answering(graph, 'stop', 'the disk is on fire', success=False)
    with pytest.raises(CallError, match='the disk is on fire'):
        button_of(graph).press(False)


def test_without_monitor_and_driver_the_mission_is_paused(graph: Any) -> None:
    def answer(_request: Any, response: Any) -> Any:
        response.success = True
        return response

    for name in ('pause', 'resume'):
        graph.node.create_service(Trigger, f'robot_behavior/fsm/{name}', answer)
    button = button_of(graph)
    assert button.press(True).endswith('the state machine is paused instead')
    assert button.press(False).endswith('the state machine is going on instead')
