"""Images, poses and trajectories there and back."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from surveillance_perception import conversions
from surveillance_perception.arm.trajectory import ArmState, motion_to
from surveillance_perception.detection.camera_model import CameraModel
from surveillance_perception.detection.pose import pose_of, quaternion_of
from surveillance_perception.stream.image_files import ImageError
from surveillance_perception.testing.marker_scene import (
    Panel,
    corners_in_camera,
    corners_in_image,
)
from surveillance_runtime.robot_arm import ARM

CAMERA = CameraModel.from_field_of_view(640, 480, math.radians(60))
LIMIT = 1_000_000
RED = np.zeros((3, 5, 3), np.uint8)
RED[..., 2] = 200


def image(encoding, pixels, padding=0):
    height, width = pixels.shape[:2]
    rows = pixels.reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)))
    message = Image(width=width, height=height, encoding=encoding, step=rows.shape[1])
    message.data.frombytes(rows.tobytes())
    return message


@pytest.mark.parametrize('padding', [0, 3])
@pytest.mark.parametrize(
    ('encoding', 'order'),
    [('bgr8', [0, 1, 2]), ('rgb8', [2, 1, 0]), ('bgra8', [0, 1, 2, 0]), ('rgba8', [2, 1, 0, 0])],
)
def test_every_encoding_becomes_bgr(encoding, order, padding):
    message = image(encoding, RED[..., order], padding)
    assert (conversions.image_from_ros(message, LIMIT) == RED).all()


def test_mono_stays_grey():
    grey = np.arange(15, dtype=np.uint8).reshape(3, 5)
    assert (conversions.image_from_ros(image('mono8', grey, 1), LIMIT) == grey).all()


@pytest.mark.parametrize('image', [RED, RED[..., 2]])
def test_image_there_and_back(image):
    header = Header(frame_id='camera')
    message = conversions.image_to_ros(np.ascontiguousarray(image), header)
    assert (conversions.image_from_ros(message, LIMIT) == image).all()
    assert message.header.frame_id == 'camera'


def wrong(**fields):
    message = image('bgr8', RED)
    for name, value in fields.items():
        setattr(message, name, value)
    return message


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (Image(), "encoded as ''"),
        (wrong(encoding='16UC1'), "encoded as '16UC1', expected one of mono8"),
        (wrong(width=0), '0x3 pixels is empty'),
        (wrong(height=2**31), 'is larger than'),
        (wrong(height=4), 'has 45 bytes, expected 60'),
        (wrong(step=2), 'rows of 2 bytes, expected at least 15'),
        (wrong(data=[]), 'has 0 bytes, expected 45'),
    ],
)
def test_wrong_images_are_refused_in_one_line(message, reason):
    with pytest.raises(ImageError, match=reason):
        conversions.image_from_ros(message, LIMIT)


def test_compressed_image_is_decoded_or_refused():
    data = cv2.imencode('.png', RED)[1].tobytes()
    assert (conversions.image_from_compressed(CompressedImage(data=data), LIMIT) == RED).all()
    with pytest.raises(ImageError, match='larger than 2 pixels'):
        conversions.image_from_compressed(CompressedImage(data=data), 2)
    with pytest.raises(ImageError, match='no image'):
        conversions.image_from_compressed(CompressedImage(data=b'\x00\x01'), LIMIT)


def test_camera_there_and_back():
    message = conversions.camera_to_ros(CAMERA, Header())
    back = conversions.camera_from_ros(message)
    assert (back.matrix == CAMERA.matrix).all()
    assert (back.width, back.height) == (640, 480)
    message.k = [0.0] * 9
    with pytest.raises(ValueError, match='not calibrated'):
        conversions.camera_from_ros(message)


@settings(max_examples=50, derandomize=True, deadline=None)
@given(st.floats(0.5, 8.0), st.floats(-1.2, 1.2), st.floats(-3.1, 3.1), st.floats(-100, 100))
def test_pose_of_exact_corners_is_exact(distance, turn, roll, offset):
    panel = Panel(0, distance, turn, roll=roll, offset=(offset, -offset / 2))
    pose = pose_of(corners_in_image(panel, CAMERA), panel.size, CAMERA)
    truth = corners_in_camera(panel, CAMERA)
    # the marker's frame: x right, y up, z out of the paper, towards the camera
    seen = np.array([[-0.1, 0.1, 0], [0.1, 0.1, 0], [0.1, -0.1, 0], [-0.1, -0.1, 0]])
    assert np.allclose(seen @ pose.rotation.T + pose.position, truth, atol=2e-3 * distance)
    assert pose.reprojection_error < 0.05
    assert pose.rotation[2, 2] < 0
    message = conversions.pose_to_ros(pose)
    x, y, z, w = (getattr(message.orientation, axis) for axis in 'xyzw')
    assert math.isclose(x * x + y * y + z * z + w * w, 1.0, rel_tol=1e-9)


@settings(max_examples=50, derandomize=True, deadline=None)
@given(st.tuples(*(st.floats(-3.1, 3.1) for _ in range(3))))
def test_quaternion_turns_as_the_matrix_does(vector):
    rotation = cv2.Rodrigues(np.array(vector))[0]
    x, y, z, w = quaternion_of(rotation)
    turned = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    assert np.allclose(turned, rotation, atol=1e-6)


def test_trajectory_keeps_names_times_and_values():
    home = np.array(ARM.home)
    motion = motion_to(ARM, ArmState.resting(home), home + np.array([0.5, 0, 0, 0, 0]))
    message = conversions.trajectory_to_ros(motion, ARM.names)
    assert list(message.joint_names) == list(ARM.names)
    times = [p.time_from_start.sec + p.time_from_start.nanosec / 1e9 for p in message.points]
    assert np.allclose(times, motion.times, atol=1e-6)
    assert np.allclose([p.positions for p in message.points], motion.positions)
    assert np.allclose([p.velocities for p in message.points], motion.speeds)
