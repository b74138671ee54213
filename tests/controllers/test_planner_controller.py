"""The node `planner_controller` in MANUAL and RANDOM mode, with real goals and a scripted
operator."""

from __future__ import annotations

from typing import Any

import pytest
from geometry_msgs.msg import Point
from std_msgs.msg import String

from state_machines import Interrupt
from state_machines.ros import CallInterruptedError, GoalCaller, ServiceCaller
from surveillance_controllers.planner_controller_node import PlannerController
from surveillance_interfaces.action import ComputePath
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_runtime.qos import STATE_QOS

START, GOAL = Point(x=5.0, y=10.0), Point(x=10.0, y=5.0)


def coordinates(points: list[Point]) -> list[tuple[float, float, float]]:
    return [(p.x, p.y, p.z) for p in points]


def compute(graph: Any, **options: Any) -> Any:
    caller = GoalCaller(graph.node, ComputePath, 'compute_path')
    goal = ComputePath.Goal(start=START, goal=GOAL)
    return caller.run(goal, accept_timeout=60.0, **options)


def test_manual_requests_wait_for_the_operator(
    graph: Any, in_background: Any, operator: Any, capfd: Any
) -> None:
    settings = {'execution_mode': 'MANUAL'}
    node = graph.add(PlannerController, settings, console_source=operator.source)
    told = graph.listen(String, 'planner_controller/announcement', STATE_QOS)
    end = in_background(lambda: compute(graph))
    graph.until(lambda: told)
    assert told[0].data.splitlines()[:2] == [
        'New request: compute a path',
        '  start (5, 10, 0), goal (10, 5, 0), 7.07 m apart',
    ]
    operator.type('plan set [[1, 2]]')
    operator.type('plan put')
    operator.type('plan set [[6, 8, 0], [8.5, 6, 0]]')
    end = end()
    assert end.status == 'succeeded'
    assert coordinates(end.result.path) == [(5, 10, 0), (6, 8, 0), (8.5, 6, 0), (10, 5, 0)]
    node.stop()
    shown = capfd.readouterr().out
    assert "(']' in point 1, where ',' belongs)" in shown
    assert "'put' after 'plan' is no command: expected 'set'" in shown


def test_a_command_without_a_request_is_refused(graph: Any) -> None:
    graph.add(PlannerController, {'execution_mode': 'MANUAL', 'console': False})
    caller = ServiceCaller(graph.node, ConsoleCommand, 'planner_controller/command')
    answer = caller.call(ConsoleCommand.Request(line='plan set []'), 60.0)
    assert (answer.accepted, answer.answer) == (
        False,
        'no request is waiting: expected one before this command',
    )
    answer = caller.call(ConsoleCommand.Request(line='status'), 60.0)
    assert (answer.accepted, answer.answer) == (True, 'No request is waiting.')


def test_a_goal_can_be_cancelled_while_it_waits_for_the_operator(
    graph: Any, in_background: Any
) -> None:
    graph.add(PlannerController, {'execution_mode': 'MANUAL', 'console': False})
    told = graph.listen(String, 'planner_controller/announcement', STATE_QOS)
    cancel = Interrupt()
    end = in_background(lambda: compute(graph, interrupt=cancel))
    graph.until(lambda: told)
    cancel.set()
    with pytest.raises(CallInterruptedError):
        end()
    graph.until(lambda: told[-1].data.startswith('The request was withdrawn'))


def test_a_new_goal_takes_the_place_of_the_one_that_waits(graph: Any, in_background: Any) -> None:
    graph.add(PlannerController, {'execution_mode': 'MANUAL', 'console': False})
    told = graph.listen(String, 'planner_controller/announcement', STATE_QOS)
    first = in_background(lambda: compute(graph))
    graph.until(lambda: told)
    second = in_background(lambda: compute(graph))
    assert first().status == 'aborted'
    graph.until(lambda: sum(t.data.startswith('New request') for t in told) == 2)
    caller = ServiceCaller(graph.node, ConsoleCommand, 'planner_controller/command')
    assert caller.call(ConsoleCommand.Request(line='plan set []'), 60.0).accepted
    assert second().status == 'succeeded'


def test_random_paths_keep_the_ends_and_the_range_and_repeat_with_the_seed(graph: Any) -> None:
    paths = []
    for _ in range(2):
        node = graph.add(PlannerController, {'execution_mode': 'RANDOM', 'random_seed': 4})
        for _ in range(4):
            path = coordinates(compute(graph).result.path)
            assert (path[0], path[-1]) == ((5, 10, 0), (10, 5, 0))
            assert len(path) <= 6
            assert all(abs(c) <= 10 for point in path[1:-1] for c in point)
            paths.append(path)
        graph.remove(node)
    assert paths[:4] == paths[4:]
    assert len({len(path) for path in paths}) > 1


def test_a_start_that_is_no_number_is_aborted(graph: Any) -> None:
    graph.add(PlannerController, {'execution_mode': 'RANDOM'})
    caller = GoalCaller(graph.node, ComputePath, 'compute_path')
    goal = ComputePath.Goal(start=Point(x=float('nan')), goal=GOAL)
    assert caller.run(goal, accept_timeout=60.0).status == 'aborted'
