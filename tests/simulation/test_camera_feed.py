"""The pictures of the simulated camera, on topics."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import CameraInfo, Image, JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from surveillance_runtime.qos import SENSOR_QOS

from .simulators import simulator


def test_the_camera_sees_and_the_arm_turns_it(graph: Any) -> None:
    simulator(graph)
    pictures = graph.listen(Image, 'camera/rgb/image_raw', SENSOR_QOS)
    infos = graph.listen(CameraInfo, 'camera/rgb/camera_info', SENSOR_QOS)
    joints = graph.listen(JointState, 'joint_states', SENSOR_QOS)
    graph.until(lambda: pictures and infos and joints)
    assert (pictures[0].width, pictures[0].height, pictures[0].encoding) == (640, 480, 'rgb8')
    assert infos[0].k[0] == pytest.approx(320 / math.tan(math.radians(30)))
    arm = graph.node.create_publisher(JointTrajectory, 'arm/joint_trajectory', 1)
    point = JointTrajectoryPoint(positions=[1.0], time_from_start=Duration(sec=1))
    graph.until(lambda: arm.get_subscription_count())
    arm.publish(JointTrajectory(joint_names=['arm_pan'], points=[point]))
    graph.until(lambda: joints[-1].position[0] == pytest.approx(1.0))
    assert tuple(joints[-1].name)[:1] == ('arm_pan',)


def test_light_can_be_changed_while_it_runs(graph: Any) -> None:
    node = simulator(graph)
    pictures = graph.listen(Image, 'camera/rgb/image_raw', SENSOR_QOS)
    graph.until(lambda: pictures)
    bright = np.mean(pictures[-1].data)
    from rclpy.parameter import Parameter

    assert node.set_parameters([Parameter('camera.light', value=0.2)])[0].successful
    graph.until(lambda: np.mean(pictures[-1].data) < 0.3 * bright)
    refused = node.set_parameters([Parameter('camera.light', value=-1.0)])[0]
    assert 'camera.light' in refused.reason
