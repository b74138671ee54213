"""What the simulated sensors measure, on topics."""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, LaserScan
from std_msgs.msg import String

from lidar_navigation.geometry import Mount
from surveillance_runtime.conversions import pose_from, seconds_of
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.sensing.conversions import scan_from

from .simulators import simulator


def test_a_scan_is_measured_while_somebody_listens(graph: Any) -> None:
    simulator(graph)
    scans = graph.listen(LaserScan, 'scan', SENSOR_QOS)
    graph.until(lambda: scans)
    assert scan_from(scans[0]).ranges[0] == pytest.approx(0.95, abs=0.06)


def test_a_lidar_that_hangs_upside_down_tells_the_same_as_one_that_stands(graph: Any) -> None:
    mount = (0.1, -0.05, 0.5)
    node = simulator(graph, **{'lidar.noise': 0.0, 'lidar_mounts': [*mount, math.pi]})
    scans = graph.listen(LaserScan, 'scan', SENSOR_QOS)
    tf2 = pytest.importorskip('tf2_msgs.msg')
    frames = graph.listen(tf2.TFMessage, 'tf_static', STATE_QOS)
    graph.until(lambda: scans and frames)
    told = scan_from(scans[-1], Mount(mount, upside_down=True))
    assert told.points[:, 0].max() == pytest.approx(4.95, abs=0.03), 'through the door ahead'
    stands = node.robot.scan(mount)
    angles = node.robot.lidar.angles + mount[2]
    expected = np.stack([stands * np.cos(angles), stands * np.sin(angles)], 1) + mount[:2]
    away = np.linalg.norm(expected[:, None] - told.points, axis=2).min(axis=0)
    assert away.max() < 1e-3
    (lidar,) = (each for each in frames[-1].transforms if each.child_frame_id == 'base_scan')
    turned = lidar.transform.rotation
    assert abs(1.0 - 2.0 * (turned.x**2 + turned.y**2) + 1.0) < 1e-6, 'its z axis looks down'


def test_it_tells_a_localisation_where_it_starts(graph: Any) -> None:
    poses = graph.listen(PoseWithCovarianceStamped, 'initialpose', 10)
    simulator(graph, announce_pose=True)
    graph.until(lambda: poses)
    assert pose_from(poses[0].pose.pose) == (1.0, 1.0, 0.0)


def test_its_frames_are_one_tree_as_tf_wants_it(graph: Any) -> None:
    tf2 = pytest.importorskip('tf2_msgs.msg')
    simulator(graph, **{'robot.frames.base': 'base_footprint'})
    moving = graph.listen(tf2.TFMessage, 'tf', SENSOR_QOS)
    fixed = graph.listen(tf2.TFMessage, 'tf_static', STATE_QOS)
    described = graph.listen(String, 'robot_description', STATE_QOS)
    seen: list[Any] = [
        graph.listen(kind, topic, SENSOR_QOS)
        for kind, topic in (
            (Odometry, 'odom'),
            (LaserScan, 'scan'),
            (Image, 'camera/rgb/image_raw'),
        )
    ]
    graph.until(lambda: fixed and described and len(moving) > 3 and all(seen))
    transforms = [*fixed[0].transforms, *moving[0].transforms]
    parents = {each.child_frame_id: each.header.frame_id for each in transforms}
    # Each frame has one parent, and all lead to the odometry's.
    assert len(parents) == len(transforms)
    for message in seen:
        frame, passed = message[0].header.frame_id, 0
        while frame in parents and passed < 9:
            frame, passed = parents[frame], passed + 1
        assert frame == 'odom'
    assert parents['base_link'] == 'base_footprint'
    for each in transforms:
        q = each.transform.rotation
        assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(1.0)
        assert not each.child_frame_id.startswith('/')
    stamps = [seconds_of(message.transforms[0].header.stamp) for message in moving]
    assert stamps == sorted(stamps)
    # The camera looks forwards: its optical z axis is the robot's x axis.
    camera = next(each for each in transforms if 'camera' in each.child_frame_id)
    q = camera.transform.rotation
    assert 2 * (q.x * q.z + q.w * q.y) == pytest.approx(1.0, abs=0.2)
    urdf = ElementTree.fromstring(described[0].data)
    assert {link.attrib['name'] for link in urdf.iter('link')} >= set(parents) - {'base_footprint'}
