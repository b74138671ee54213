"""Doors that are seen shut are told where nobody else tells them, also where Nav2 drives."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import LaserScan
from tf2_msgs.msg import TFMessage

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
    message = TFMessage(transforms=[moved('map', 'odom', *at), moved('odom', 'base_link', 0, 0, 0)])
    seen = flat.scan(at, closed=closed)
    scan = LaserScan(
        angle_min=-np.pi,
        angle_increment=2 * np.pi / 180,
        angle_max=np.pi - 2 * np.pi / 180,
        range_max=8.0,
        ranges=seen.ranges.astype(np.float32).tolist(),
    )

    def drive() -> bool:
        frames.publish(message)
        scan.header.stamp = graph.node.get_clock().now().to_msg()
        scans.publish(scan)
        return bool(told) if closed else len(reads) >= 30

    graph.until(drive)
    assert [each.closed for each in told[-1:]] == ([['D']] if closed else [])
