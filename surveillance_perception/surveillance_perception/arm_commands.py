"""How motions reach the arm: on a topic, or as goals of ros2_control's FollowJointTrajectory.

Both are what a joint_trajectory_controller of ros2_control takes, as MoveIt uses it. Whether the
arm gets there is judged by its joint states, so nobody waits for the goal's end; a goal that is
refused or fails is told in the log. A new goal takes the place of the one before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from rclpy.action import ActionClient
from trajectory_msgs.msg import JointTrajectory

from strict_files.settings import parameter
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.profile.record import ARM_TYPES


@dataclass(frozen=True)
class ArmOutput:
    """Where the motions go."""

    kind: str = parameter(
        ARM_TYPES[0],
        'How the arm takes its motions: JointTrajectory on the topic arm/joint_trajectory, or '
        'goals of the action FollowJointTrajectory (needs control_msgs).',
        choices=ARM_TYPES,
        name='robot.arm_type',
    )
    action: str = parameter('arm/joint_trajectory', 'Name of that action.', name='robot.arm_action')


class ArmCommands:
    """Sends motions to the arm.

    Args:
        node: The arm's controller.

    Raises:
        ParameterError: The action is asked for, and control_msgs is not installed.
    """

    def __init__(self, node: PatrolNode) -> None:
        self._node = node
        output = node.declare_fields(ArmOutput())
        self._name = output.action
        self._topic = self._client = None
        if output.kind == ARM_TYPES[0]:
            self._topic = node.create_publisher(JointTrajectory, 'arm/joint_trajectory', 10)
            return
        try:
            from control_msgs.action import FollowJointTrajectory
        except ImportError:
            raise ParameterError(
                f'parameter robot.arm_type: got {output.kind}, but the Python package control_msgs '
                'is not installed: install ros-jazzy-control-msgs and source its workspace, or use '
                f'types.arm: {ARM_TYPES[0]} in the robot profile'
            ) from None
        self._goal_type = FollowJointTrajectory.Goal
        self._client = ActionClient(node, FollowJointTrajectory, output.action)

    def send(self, motion: JointTrajectory) -> None:
        """Send a motion; from any thread, without waiting."""
        if self._topic is not None:
            self._topic.publish(motion)
            return
        assert self._client is not None
        if not self._client.server_is_ready():
            self._warn('no action server is there: the arm does not move')
            return
        goal = self._goal_type()
        goal.trajectory = motion
        self._client.send_goal_async(goal).add_done_callback(self._on_answer)

    def _on_answer(self, future: Any) -> None:
        handle = future.result()
        if not handle.accepted:
            self._warn('the goal was refused')
            return
        handle.get_result_async().add_done_callback(self._on_end)

    def _on_end(self, future: Any) -> None:
        result = future.result().result
        if result.error_code:
            self._warn(f'the motion failed: {result.error_string or result.error_code}')

    def _warn(self, text: str) -> None:
        self._node.get_logger().warn(f'{self._name}: {text}', throttle_duration_sec=5.0)
