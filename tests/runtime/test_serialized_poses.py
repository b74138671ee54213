"""Serialized messages: what is read of them is what rclpy reads, and bad bytes cost a line."""

from __future__ import annotations

import math
import struct

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu

from surveillance_runtime.conversions import (
    frames_of_serialized,
    pose_from,
    pose_message,
    pose_of_serialized,
    seconds_of,
    stamp_of_serialized,
    turn_rate_of_serialized,
)

NAMES = st.text(st.characters(blacklist_characters='\0', blacklist_categories=['Cs']), max_size=20)
METRES = st.floats(-1e7, 1e7)


@given(NAMES, NAMES, METRES, METRES, st.floats(-math.pi, math.pi), st.integers(0, 2**31 - 1))
def test_pose_and_stamp_are_those_that_rclpy_reads(
    frame: str, child: str, x: float, y: float, yaw: float, seconds: int
) -> None:
    odometry, estimate = Odometry(child_frame_id=child), PoseWithCovarianceStamped()
    for message in (odometry, estimate):
        message.header.frame_id = frame
        message.header.stamp.sec, message.header.stamp.nanosec = seconds, 123_456_789
        message.pose.pose = pose_message((x, y, yaw))
    expected = pose_from(odometry.pose.pose)
    assert pose_of_serialized(serialize_message(odometry), texts=1) == expected
    assert pose_of_serialized(serialize_message(estimate)) == expected
    assert stamp_of_serialized(serialize_message(estimate)) == seconds_of(estimate.header.stamp)


def test_a_writer_with_the_other_byte_order_is_understood() -> None:
    numbers = struct.pack('>iI', 7, 500_000_000) + struct.pack('>I', 4) + b'map\0'
    data = b'\0\0\0\0' + numbers + struct.pack('>7d', 1.0, 2.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert stamp_of_serialized(data) == 7.5
    assert pose_of_serialized(data) == (1.0, 2.0, 0.0)


@pytest.mark.parametrize('length', [0, 1, 4, 11, 15, 20, 60])
def test_a_message_that_is_cut_off_is_refused(length: int) -> None:
    data = serialize_message(PoseWithCovarianceStamped())[:length]
    with pytest.raises(ValueError, match='expected'):
        pose_of_serialized(data)


def test_another_encoding_is_refused() -> None:
    data = b'\0\7' + serialize_message(PoseWithCovarianceStamped())[2:]
    with pytest.raises(ValueError, match='serialized as 0007: expected plain CDR'):
        stamp_of_serialized(data)


def test_a_pose_that_is_none_is_refused() -> None:
    message = Odometry()
    message.pose.pose.position.x = math.nan
    with pytest.raises(ValueError, match='not finite'):
        pose_of_serialized(serialize_message(message), texts=1)


@given(NAMES, st.floats(-1e3, 1e3))
def test_the_turn_rate_of_a_gyroscope_is_that_which_rclpy_reads(frame: str, rate: float) -> None:
    message = Imu()
    message.header.frame_id = frame
    message.angular_velocity.x, message.angular_velocity.z = 9.0, rate
    assert turn_rate_of_serialized(serialize_message(message)) == rate


@pytest.mark.parametrize(('rate', 'covariance'), [(math.nan, 0.0), (0.1, -1.0)])
def test_a_turn_rate_that_is_not_known_is_refused(rate: float, covariance: float) -> None:
    message = Imu()
    message.angular_velocity.z, message.angular_velocity_covariance[0] = rate, covariance
    with pytest.raises(ValueError, match='expected rad/s about z'):
        turn_rate_of_serialized(serialize_message(message))


@given(NAMES, NAMES, st.floats(-5.0, 5.0))
def test_frames_differ_where_their_names_do(child: str, other: str, x: float) -> None:
    first, second = Odometry(child_frame_id=child), Odometry(child_frame_id=other)
    second.pose.pose.position.x = x
    names = [frames_of_serialized(serialize_message(each), texts=1) for each in (first, second)]
    assert (names[0] == names[1]) is (child == other)
