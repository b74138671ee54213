"""When a sensor measured, by the node's clock, whatever the clock of its driver says."""

from __future__ import annotations

import math
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, Quaternion, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from lidar_navigation import Navigator
from lidar_navigation.geometry import Pose
from surveillance_runtime.conversions import seconds_of, stamp_from
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.record import Frames
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing import sensors, silence
from surveillance_runtime.sensing.sensors import OdometryReader, SensorStream
from surveillance_runtime.sensing.transforms import TELL_WITHIN, ScanReader
from tests.controllers.test_navigation_topics import motion_of

tf2 = pytest.importorskip('tf2_msgs.msg')


def now_of(node: Any) -> float:
    return float(node.get_clock().now().nanoseconds) / 1e9


@pytest.mark.parametrize('off', [-86400.0, -3600.0, 0.0, 3600.0])
def test_a_stamp_counts_by_the_clock_of_the_node(graph: Any, capfd: Any, off: float) -> None:
    stream = SensorStream(graph.node, 'scan')
    for number in range(5):
        now = now_of(graph.node)
        measured = stream.come(now - 0.1 + off, bytes([number]))
        assert measured is not None
        assert measured - now == pytest.approx(0.0 if off else -0.1, abs=0.11)
    assert stream.offset == pytest.approx(-off, abs=0.11)
    assert capfd.readouterr().err.count('stamps of /scan are') == (1 if off else 0)


def test_what_was_measured_once_counts_once(graph: Any) -> None:
    stream = SensorStream(graph.node, 'odom')
    now = now_of(graph.node)
    assert stream.come(now, b'1') is not None
    assert stream.come(now, b'1') is None
    assert 'again and again' in stream.problem
    assert stream.come(now, b'2') is not None, 'a clock that stands still'
    assert stream.problem == ''
    # Who gives no stamps may stand still.
    assert stream.come(0.0, b'3') is not None
    assert stream.come(0.0, b'3') is not None


def test_simulated_time_is_taken_as_it_is(graph: Any) -> None:
    node = graph.add(PatrolNode, {'use_sim_time': True}, name='simulated')
    stream = SensorStream(node, 'scan')
    assert stream.come(500.0, b'1') == 500.0
    assert stream.offset == 0.0


def test_the_pose_of_a_robot_whose_clock_is_ahead_is_of_now(graph: Any, flat: Any) -> None:
    navigator = Navigator()
    navigator.set_map(flat.grid)
    node = graph.add(PatrolNode, {'lidar_mounts': [0.0] * 4}, name='driving')
    motion_of(node, navigator)
    true: Pose = (2.0, 1.5, 0.3)
    navigator.move(true)
    seen = flat.scan(true)
    poses = graph.listen(PoseWithCovarianceStamped, 'amcl_pose', 10)
    frames = graph.listen(tf2.TFMessage, 'tf', 10)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)

    def told() -> bool:
        message = LaserScan(
            angle_min=float(seen.angles[0]),
            angle_increment=float(seen.angles[1] - seen.angles[0]),
            range_max=float(seen.range_max),
            ranges=seen.ranges.astype('f4').tolist(),
        )
        message.header.stamp = stamp_from(graph.node.get_clock().now().nanoseconds + 3600 * 10**9)
        scans.publish(message)
        return bool(poses and frames)

    graph.until(told)
    assert abs(seconds_of(poses[-1].header.stamp) - now_of(graph.node)) < 1800.0


def test_odometry_that_comes_by_tf_alone_is_read(graph: Any, monkeypatch: Any) -> None:
    monkeypatch.setattr(sensors, 'BY_TF_AFTER', 0.05)
    took: list[Pose] = []
    node = graph.add(PatrolNode, name='reading')
    reader = OdometryReader(node, lambda pose, _at: took.append(pose), Frames(base='base_link'))
    frames = graph.node.create_publisher(tf2.TFMessage, 'tf', 10)
    step = TransformStamped(child_frame_id='base_footprint')
    step.header.frame_id = '/odom'
    step.transform.translation.x, step.transform.rotation = 1.5, Quaternion(z=1.0, w=0.0)
    other = TransformStamped(child_frame_id='odom')
    other.header.frame_id = 'map'

    def told() -> bool:
        step.header.stamp = graph.node.get_clock().now().to_msg()
        frames.publish(tf2.TFMessage(transforms=[other, step]))
        return bool(took)

    graph.until(told)
    assert took[-1][0] == 1.5
    assert abs(took[-1][2]) == pytest.approx(math.pi)
    assert reader.stream.heard_at is not None
    # A driver that begins later is heard, and tf is not any more.
    topic = graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)
    graph.until(lambda: reader._by_tf is None)
    took.clear()
    message = Odometry()
    message.pose.pose.position.x = 4.0

    def driven() -> bool:
        message.header.stamp = graph.node.get_clock().now().to_msg()
        topic.publish(message)
        return bool(took)

    graph.until(driven)
    assert took[-1] == (4.0, 0.0, 0.0)


def test_a_scan_waits_a_while_for_where_its_frame_is(graph: Any, monkeypatch: Any) -> None:
    said = graph.said()
    node = graph.add(PatrolNode, {'lidar_mounts': []}, name='reading')
    lidar = ScanReader(node, 0.2)
    mounts: list[Any] = []
    message = LaserScan(angle_increment=0.1, range_max=8.0, ranges=[1.0] * 20)
    message.header.frame_id = 'laser'

    def come() -> None:
        message.header.stamp = Time()
        lidar._take('scan', lambda _topic, scan, _message: mounts.append(scan.mount), message)

    come()
    assert mounts == []
    step = TransformStamped(child_frame_id='laser')
    step.header.frame_id = 'base_link'
    step.transform.translation.x = 0.3
    lidar.frames.hear_fixed(tf2.TFMessage(transforms=[step]))
    come()
    assert mounts == [pytest.approx((0.3, 0.0, 0.0))]
    # Where nobody tells, it is taken for the centre after a while, and that is said.
    message.header.frame_id = 'other'
    come()
    assert len(mounts) == 1
    lidar._waits_until['other'] -= TELL_WITHIN
    come()
    assert mounts[1:] == [(0.0, 0.0, 0.0)]
    graph.until(lambda: any("its frame 'other' is on the robot is not known" in e for e in said))


def test_odometry_of_another_frame_is_told_while_the_robot_drives(
    graph: Any, monkeypatch: Any
) -> None:
    monkeypatch.setattr(silence, 'DOUBT_PERIOD', 0.05)
    node = graph.add(PatrolNode, name='driving')
    frames = Frames(base='base_link')
    reader = OdometryReader(node, lambda _pose, _at: None)
    silence.SensorWatch(node, frames, {}, reader.stream, child=lambda: reader.child)
    topic = graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)

    def told() -> list[str]:
        topic.publish(Odometry(child_frame_id='base_footprint'))
        return [each.text for each in node.incidents.updates() if 'child_frame_id' in each.text]

    graph.until(told)
    assert "the profile says frames.base: 'base_link'" in told()[0]
