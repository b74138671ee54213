"""The node `motion_controller` in MANUAL and RANDOM mode, with real goals and a scripted
operator."""

from __future__ import annotations

from typing import Any

import pytest
from geometry_msgs.msg import Point
from std_msgs.msg import String

from state_machines import Interrupt
from state_machines.ros import CallInterruptedError, GoalCaller, ServiceCaller
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_interfaces.action import Control, FollowPath
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_runtime.qos import STATE_QOS

PATH = [Point(x=0.0, y=0.0), Point(x=4.0, y=0.0), Point(x=4.0, y=3.0)]


def follow(graph: Any, path: list[Point], **options: Any) -> Any:
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    return caller.run(FollowPath.Goal(path=path), accept_timeout=60.0, **options)


def test_manual_moves_take_the_given_time_and_error(
    graph: Any, in_background: Any, operator: Any
) -> None:
    graph.add(
        MotionController,
        {'execution_mode': 'MANUAL', 'feedback_period': 0.02},
        console_source=operator.source,
    )
    told = graph.listen(String, 'motion_controller/announcement', STATE_QOS)
    seen: list[tuple[float, float]] = []
    end = in_background(
        lambda: follow(graph, PATH, on_feedback=lambda f: seen.append((f.position.x, f.position.y)))
    )
    graph.until(lambda: told)
    assert 'start (0, 0, 0), goal (4, 3, 0), 7.00 m along 3 points' in told[0].data
    assert 'path (0, 0, 0) (4, 0, 0) (4, 3, 0)' in told[0].data
    operator.type('move 0.2 0.05')
    end = end()
    assert end.status == 'succeeded'
    position = end.result.position
    assert (position.x, position.y) == pytest.approx((4, 3), abs=0.05)
    assert all(y == 0 or x == pytest.approx(4) for x, y in seen[:-1])
    assert seen[:-1] == sorted(seen[:-1])


def test_a_move_can_be_cancelled_on_its_way(graph: Any, in_background: Any) -> None:
    graph.add(
        MotionController,
        {'execution_mode': 'MANUAL', 'console': False, 'feedback_period': 0.01},
    )
    told = graph.listen(String, 'motion_controller/announcement', STATE_QOS)
    seen: list[Any] = []
    cancel = Interrupt()
    end = in_background(
        lambda: follow(graph, PATH, interrupt=cancel, on_feedback=seen.append),
    )
    graph.until(lambda: told)
    caller = ServiceCaller(graph.node, ConsoleCommand, 'motion_controller/command')
    assert caller.call(ConsoleCommand.Request(line='move 60 0'), 60.0).accepted
    graph.until(lambda: len(seen) > 2)
    cancel.set()
    with pytest.raises(CallInterruptedError):
        end()
    assert caller.call(ConsoleCommand.Request(line='status'), 60.0).answer.startswith('No request')


@pytest.mark.parametrize('path', [[], [Point(x=float('inf'))]])
def test_a_path_that_cannot_be_followed_is_aborted_with_the_reason(
    graph: Any, capfd: Any, path: list[Point]
) -> None:
    graph.add(MotionController, {'execution_mode': 'RANDOM'})
    assert follow(graph, path).status == 'aborted'
    caller = GoalCaller(graph.node, Control, 'motion/controller')
    assert caller.run(Control.Goal(point_set=path), accept_timeout=60.0).status == 'aborted'
    reason = 'point 1 is (inf, 0, 0)' if path else 'no points, expected at least one'
    logged = capfd.readouterr().err
    assert f'follow_path: follow_path: {reason}' not in logged
    assert f'follow_path: {reason}' in logged
    assert f'motion/controller: {reason}' in logged


def test_random_moves_take_seconds_of_the_range(graph: Any) -> None:
    from surveillance_controllers import stimuli

    draw = stimuli.generator(7)
    for _ in range(200):
        seconds, delta = stimuli.move(draw)
        assert seconds in range(5, 10)
        assert abs(delta) <= 0.2
        end = stimuli.reached(draw, (1.0, 2.0, 3.0), delta)
        assert end == pytest.approx([1, 2, 3], abs=0.2)
