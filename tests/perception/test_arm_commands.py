"""Motions as goals of ros2_control's action; its messages are no wheel, so classes stand in."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory

from surveillance_perception import arm_commands
from surveillance_perception.arm_commands import ArmCommands
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError

MOTION = JointTrajectory(joint_names=['arm_pan'])


class Server:
    """An action server that answers at once."""

    def __init__(self, *, accepted: bool = True, error_code: int = 0, ready: bool = True) -> None:
        self.goals: list[Any] = []
        self.ready = ready
        result = SimpleNamespace(error_code=error_code, error_string='path tolerance violated')
        self._handle = SimpleNamespace(
            accepted=accepted,
            get_result_async=lambda: done(SimpleNamespace(result=result)),
        )

    def server_is_ready(self) -> bool:
        return self.ready

    def send_goal_async(self, goal: Any) -> Future:
        self.goals.append(goal)
        return done(self._handle)


def done(result: Any) -> Future:
    future: Any = Future()
    future.set_result(result)
    return future


def commands(graph: Any, monkeypatch: pytest.MonkeyPatch, server: Server) -> ArmCommands:
    module = ModuleType('control_msgs.action')
    vars(module)['FollowJointTrajectory'] = SimpleNamespace(Goal=SimpleNamespace)
    monkeypatch.setitem(sys.modules, 'control_msgs', ModuleType('control_msgs'))
    monkeypatch.setitem(sys.modules, 'control_msgs.action', module)
    asked: list[str] = []

    def client(_node: Any, _type: Any, name: str) -> Server:
        asked.append(name)
        return server

    monkeypatch.setattr(arm_commands, 'ActionClient', client)
    given = {
        'robot.arm_type': 'FollowJointTrajectory',
        'robot.arm_action': 'arm_controller/follow_joint_trajectory',
    }
    made: list[ArmCommands] = []

    class Node(PatrolNode):
        def __init__(self, **options: Any) -> None:
            super().__init__('arm', **options)
            made.append(ArmCommands(self))

    graph.add(Node, given)
    assert asked == ['arm_controller/follow_joint_trajectory']
    return made[0]


def test_a_motion_is_a_goal(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    server = Server()
    commands(graph, monkeypatch, server).send(MOTION)
    assert [goal.trajectory for goal in server.goals] == [MOTION]


@pytest.mark.parametrize(
    ('server', 'said'),
    [
        (Server(ready=False), 'no action server is there: the arm does not move'),
        (Server(accepted=False), 'the goal was refused'),
        (Server(error_code=-4), 'the motion failed: path tolerance violated'),
    ],
)
def test_what_goes_wrong_is_told(
    graph: Any, monkeypatch: pytest.MonkeyPatch, server: Server, said: str
) -> None:
    lines = graph.said()
    arm = commands(graph, monkeypatch, server)
    arm.send(MOTION)
    graph.until(lambda: any(said in line for line in lines))


def test_without_control_msgs_one_line_says_what_is_missing(graph: Any) -> None:
    class Node(PatrolNode):
        def __init__(self, **options: Any) -> None:
            super().__init__('arm', **options)
            ArmCommands(self)

    with pytest.raises(ParameterError, match='control_msgs is not installed: install ros-jazzy'):
        graph.add(Node, {'robot.arm_type': 'FollowJointTrajectory'})
