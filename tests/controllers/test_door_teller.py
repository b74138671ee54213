"""Doors that are seen shut are told where nobody else tells them, also where Nav2 drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rclpy.duration import Duration
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

from lidar_navigation.geometry import Pose, Scan
from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.qos import STATE_QOS
from tests.controllers.nav2_servers import Servers, nav2
from tests.controllers.test_nav2 import moved


@pytest.mark.parametrize('closed', [True, False])
def test_doors_that_the_robot_sees_shut_are_told_where_nav2_drives(
    graph: Any, servers: Servers, flat: Any, closed: bool
) -> None:
    told = graph.listen(DoorStates, 'door_states', STATE_QOS)
    motion = nav2(graph, flat=flat)
    reads: list[Any] = []
    look = motion._doors.see
    motion._doors.see = lambda *seen: (reads.append(seen), look(*seen))[1]  # type: ignore[assignment]
    frames = graph.node.create_publisher(TFMessage, 'tf', 10)
    scans = graph.node.create_publisher(LaserScan, 'scan', 10)
    at = 2.0, 1.5, 0.3
    scan = as_message(flat.scan(at, closed=closed))

    def drive() -> bool:
        scan.header.stamp = graph.node.get_clock().now().to_msg()
        frames.publish(frames_at(at, scan.header.stamp))
        scans.publish(scan)
        return bool(told) if closed else len(reads) >= 30

    graph.until(drive)
    assert [each.closed for each in told[-1:]] == ([['D']] if closed else [])


def test_a_scan_that_comes_late_is_read_from_where_it_was_made(
    graph: Any, servers: Servers, flat: Any
) -> None:
    motion = nav2(graph, flat=flat)
    reads: list[Any] = []
    motion._doors.see = lambda *seen: reads.append(seen)  # type: ignore[assignment]
    frames = graph.node.create_publisher(TFMessage, 'tf', 10)
    scans = graph.node.create_publisher(LaserScan, 'scan', 10)
    scan = as_message(flat.scan((2.0, 1.5, 0.3)))
    clock = graph.node.get_clock()
    begun = clock.now()

    def passed(seconds: float) -> Pose:
        return 2.0 + 0.5 * seconds, 1.5, 0.3 + 0.2 * seconds

    def drive() -> bool:
        now = clock.now()
        frames.publish(frames_at(passed(1e-9 * (now - begun).nanoseconds), now.to_msg()))
        scan.header.stamp = (now - Duration(seconds=0.3)).to_msg()
        scans.publish(scan)
        return len(reads) >= 5

    graph.until(drive)
    for pose, _, made in reads:
        assert pose == pytest.approx(passed(made - 1e-9 * begun.nanoseconds), abs=0.01)


def as_message(seen: Scan) -> LaserScan:
    """Return a scan as a lidar tells it."""
    return LaserScan(
        angle_min=-np.pi,
        angle_increment=2 * np.pi / 180,
        angle_max=np.pi - 2 * np.pi / 180,
        range_max=8.0,
        ranges=seen.ranges.astype(np.float32).tolist(),
    )


def frames_at(pose: Pose, stamp: Any) -> TFMessage:
    """Return where the robot is as `tf` tells it."""
    message = TFMessage(
        transforms=[moved('map', 'odom', *pose), moved('odom', 'base_link', 0, 0, 0)]
    )
    for each in message.transforms:
        each.header.stamp = stamp
    return message
