"""The node `arm_controller` with an arm that reports, and with one that does not."""

from __future__ import annotations

import math
from itertools import groupby
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

from state_machines import Interrupt
from state_machines.ros import CallInterruptedError, GoalCaller, ServiceCaller
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.srv import MarkerRoutine, PointCamera
from surveillance_perception.arm_controller_node import ArmController
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.robot_arm import ARM


class FollowingArm:
    """Reports joints that do what they are told."""

    def __init__(self, graph: Any) -> None:
        self.node = graph.node
        self.states = self.node.create_publisher(JointState, 'joint_states', SENSOR_QOS)
        self.motions: list[JointTrajectory] = []
        self._began = 0.0
        self._at = np.array(ARM.home)
        self.node.create_subscription(JointTrajectory, 'arm/joint_trajectory', self._take, 10)
        self._timer = self.node.create_timer(0.02, self._report)

    def _now(self) -> float:
        return float(self.node.get_clock().now().nanoseconds) / 1e9

    def _take(self, message: JointTrajectory) -> None:
        self.motions.append(message)
        self._began = self._now()

    def _report(self) -> None:
        speeds = np.zeros(5)
        if self.motions:
            points = self.motions[-1].points
            times = [p.time_from_start.sec + p.time_from_start.nanosec / 1e9 for p in points]
            now = self._now() - self._began
            columns = np.array([p.positions for p in points]).T
            self._at = np.array([np.interp(now, times, column) for column in columns])
            columns = np.array([p.velocities for p in points]).T
            speeds = np.array([np.interp(now, times, column) for column in columns])
        self.states.publish(
            JointState(name=list(ARM.names), position=self._at.tolist(), velocity=speeds.tolist())
        )

    def camera_direction(self) -> np.ndarray:
        return ARM.camera_frame(self._at)[:3, 2]


def test_arm_takes_its_poses_and_looks_at_points(graph: Any) -> None:
    arm = FollowingArm(graph)
    rests = graph.listen(Bool, 'arm/at_rest', STATE_QOS)
    graph.add(ArmController)
    move = ServiceCaller(graph.node, MarkerRoutine, 'move_arm')
    answer = move.call(MarkerRoutine.Request(pos=MarkerRoutine.Request.LEFT), 60.0)
    assert (answer.success, answer.message) == (True, 'at pose left')
    assert np.allclose(arm.camera_direction(), [0, 1, 0], atol=0.03)
    # A state is repeated each second, and may come later than the answer.
    graph.until(
        lambda: [rest for rest, _ in groupby(each.data for each in rests)][-2:] == [False, True]
    )
    wrong = move.call(MarkerRoutine.Request(pos=9), 60.0)
    assert (wrong.success, wrong.message) == (False, 'no pose 9, expected 1 to 5')
    assert move.call(MarkerRoutine.Request(pos=MarkerRoutine.Request.STOP), 60.0).success
    point = ServiceCaller(graph.node, PointCamera, 'point_camera')
    answer = point.call(PointCamera.Request(point=Point(x=1.0, y=3.0, z=1.5)), 60.0)
    assert answer.success
    lens = ARM.camera_frame(arm._at)[:3, 3]
    sight = np.array([1.0, 3.0, 1.5]) - lens
    assert arm.camera_direction() @ sight / np.linalg.norm(sight) > math.cos(math.radians(2))
    unknown = point.call(PointCamera.Request(point=Point(x=1.0), frame_id='moon'), 60.0)
    assert unknown.message == "frame 'moon' is not known, expected 'base_link'"


def test_scan_rests_at_each_view_and_can_be_cancelled(graph: Any) -> None:
    FollowingArm(graph)
    rests = graph.listen(Bool, 'arm/at_rest', STATE_QOS)
    graph.add(ArmController, parameters={'horizontal_field_of_view': 150.0, 'patience': 0.0})
    scan = GoalCaller(graph.node, ScanSurroundings, 'scan_surroundings')
    views = []
    goal = ScanSurroundings.Goal(lowest=-0.1, highest=0.1, dwell=0.01)
    end = scan.run(goal, accept_timeout=60.0, on_feedback=views.append)
    assert end.status == 'succeeded'
    assert end.result.views >= 3
    assert end.result.coverage == 1.0
    # Feedback may be lost before the two have met and just before the result, never out of order.
    steps = [(view.view, view.resting) for view in views]
    assert steps == sorted(set(steps))
    assert {view.views for view in views} == {end.result.views}
    graph.until(
        lambda: sum(rest for rest, _ in groupby(each.data for each in rests)) >= end.result.views
    )
    interrupt = Interrupt()
    with pytest.raises(CallInterruptedError):
        scan.run(
            goal, accept_timeout=60.0, interrupt=interrupt, on_feedback=lambda _: interrupt.set()
        )
    wrong = scan.run(ScanSurroundings.Goal(overlap=0.95), accept_timeout=60.0)
    assert wrong.status == 'aborted'


def test_an_arm_waits_no_longer_at_a_view_than_its_listeners(graph: Any) -> None:
    with pytest.raises(ParameterError, match='patience'):
        graph.add(ArmController, parameters={'patience': 36.0})


def test_arm_that_does_not_report_is_named(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = graph.add(ArmController)
    monkeypatch.setattr(node._driver, '_patience', 0.05)
    move = ServiceCaller(graph.node, MarkerRoutine, 'move_arm')
    answer = move.call(MarkerRoutine.Request(pos=1), 60.0)
    assert (answer.success, answer.message) == (False, 'the arm does not report its joints')
