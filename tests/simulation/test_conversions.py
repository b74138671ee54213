"""Messages and core types carry the same values both ways."""

from __future__ import annotations

import math

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_controllers import conversions as received
from surveillance_interfaces.srv import SetMarker
from surveillance_runtime.conversions import map_message, pose_from, pose_message, seconds_of
from surveillance_runtime.sensing.conversions import scan_from
from surveillance_simulation import conversions
from surveillance_simulation.camera.model import Camera
from surveillance_simulation.robot.lidar import LidarModel
from tests.places import two_rooms

STAMP = Time(sec=3, nanosec=5)


@settings(max_examples=50)
@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-math.pi, math.pi))
def test_a_pose_comes_back(x: float, y: float, yaw: float) -> None:
    back = pose_from(pose_message((x, y, yaw)))
    assert back[:2] == (x, y)
    assert math.cos(back[2] - yaw) == pytest.approx(1.0)


@settings(max_examples=50)
@given(st.integers(0, 2**31 * 1000 - 1))
def test_a_time_comes_back_to_the_millisecond(milliseconds: int) -> None:
    message = conversions.time_to_ros(milliseconds / 1000)
    assert message.sec * 1000 + round(message.nanosec / 1e6) == milliseconds


def test_a_duration_is_its_seconds() -> None:
    assert seconds_of(Duration(sec=2, nanosec=500_000_000)) == 2.5


def test_a_scan_comes_back_with_its_infinities() -> None:
    ranges = np.array([1.0, np.inf, 2.5, 0.1], np.float32)
    message = conversions.scan_to_ros(ranges, LidarModel(rays=4), 'base_link', STAMP)
    assert (scan_from(message).ranges == ranges).all()
    last = message.angle_min + 3 * message.angle_increment
    assert last == pytest.approx(message.angle_max)
    assert message.header.stamp == STAMP


def test_a_map_comes_back() -> None:
    grid = two_rooms().plan.grid()
    back = received.grid_from(map_message(grid, 'map', STAMP))
    assert (back.cells == grid.cells).all()
    assert back.resolution == pytest.approx(grid.resolution)
    assert back.origin == pytest.approx(grid.origin)


def test_odometry_carries_pose_and_velocity() -> None:
    message = conversions.odometry_message('odom', 'base_link')
    conversions.set_odometry(message, (1.0, 2.0, 0.5), 0.3, -0.2, STAMP)
    assert pose_from(message.pose.pose) == pytest.approx((1.0, 2.0, 0.5))
    assert (message.twist.twist.linear.x, message.twist.twist.angular.z) == (0.3, -0.2)
    assert (message.header.frame_id, message.child_frame_id) == ('odom', 'base_link')


def test_a_transform_carries_the_pose() -> None:
    message = conversions.transform_to_ros((1.0, 2.0, 0.5), 'odom', 'base_link', STAMP)
    assert (message.transform.translation.x, message.transform.translation.y) == (1.0, 2.0)
    assert message.transform.rotation.z == pytest.approx(math.sin(0.25))


def test_an_uncertain_pose_carries_its_variances() -> None:
    message = conversions.uncertain_pose_to_ros((1.0, 2.0, 0.5), 'map', STAMP, 0.1, 0.2)
    assert message.pose.covariance[0] == pytest.approx(0.01)
    assert message.pose.covariance[35] == pytest.approx(0.04)


def test_a_picture_and_its_camera_keep_size_and_pixels() -> None:
    picture = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)
    message = conversions.image_to_ros(picture, 'camera', STAMP)
    assert (message.height, message.width, message.step, message.encoding) == (2, 3, 9, 'rgb8')
    assert bytes(message.data) == picture.tobytes()
    info = conversions.camera_info_to_ros(Camera(3, 2, 50.0), 'camera', STAMP)
    assert list(info.k) == [50.0, 0.0, 1.0, 0.0, 50.0, 0.5, 0.0, 0.0, 1.0]
    assert list(info.p[:3]) == [50.0, 0.0, 1.0]


def test_doors_are_told_apart() -> None:
    world = two_rooms()
    assert list(conversions.doors_to_ros(world).open) == ['D']
    world.set_door('D', False)
    message = conversions.doors_to_ros(world)
    assert (list(message.open), list(message.closed)) == ([], ['D'])


def test_a_marker_request_keeps_its_pose() -> None:
    request = SetMarker.Request(name='m', id=4, x=1.0, y=2.0, z=3.0, yaw=0.5)
    marker = conversions.marker_from_ros(request, 0.15)
    assert (marker.id, marker.x, marker.y, marker.z, marker.yaw, marker.size) == (
        4,
        1.0,
        2.0,
        3.0,
        0.5,
        0.15,
    )
