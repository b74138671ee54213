"""Images, poses and trajectories there and back."""

from __future__ import annotations

import io
import math
import resource
import struct
import zlib

import cv2
import numpy as np
import PIL.Image
import pytest
from geometry_msgs.msg import PoseWithCovariance
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from marker_detection.camera_model import CameraModel
from marker_detection.pose import pose_of
from marker_detection.testing.marker_scene import (
    Panel,
    corners_in_camera,
    corners_in_image,
)
from surveillance_interfaces.msg import MarkerDetection
from surveillance_perception import conversions
from surveillance_perception.arm.trajectory import ArmState, motion_to
from surveillance_perception.stream.image_files import ImageError, decode_image
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
        (wrong(encoding='32FC1'), "encoded as '32FC1', expected one of mono8"),
        (wrong(encoding='a\nb'), r"encoded as 'a\\nb', expected one of mono8"),
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


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'d': [0.1, 0.2, 0.3]}, '3 distortion coefficients'),
        ({'d': [0.1] * 6}, '6 distortion coefficients'),
        ({'d': [float('nan')] * 5}, 'must be finite'),
        ({'k': [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 0.0]}, 'must have the form'),
        ({'distortion_model': 'thin\nprism'}, r"distortion model 'thin\\nprism', expected one of"),
        ({'d': [0.1] * 5, 'distortion_model': 'equidistant'}, 'expected 4 for equidistant'),
        ({'width': 0}, 'no area'),
    ],
)
def test_camera_info_that_fits_no_camera_is_refused_in_one_line(changes, reason):
    message = conversions.camera_to_ros(CAMERA, Header())
    for name, value in changes.items():
        setattr(message, name, value)
    with pytest.raises(ValueError, match=reason) as error:
        conversions.camera_from_ros(message)
    assert '\n' not in str(error.value)


def test_camera_info_of_a_binned_region_describes_the_image_that_comes():
    message = conversions.camera_to_ros(CAMERA, Header())
    message.binning_x = message.binning_y = 2
    message.roi.x_offset, message.roi.width = 100, 400
    camera = conversions.camera_from_ros(message)
    assert (camera.width, camera.height) == (200, 240)
    assert camera.matrix[0, 0] == pytest.approx(CAMERA.matrix[0, 0] / 2)
    assert camera.matrix[0, 2] == pytest.approx((CAMERA.matrix[0, 2] - 100) / 2)


def test_a_compressed_image_is_as_the_sensor_has_it_whatever_its_orientation_says():
    taken = np.zeros((40, 60, 3), np.uint8)
    taken[:10, :10] = 255
    image, exif = PIL.Image.fromarray(taken), PIL.Image.Exif()
    exif[0x0112] = 6  # to be turned a quarter
    file = io.BytesIO()
    image.save(file, 'JPEG', exif=exif, quality=95)
    message = CompressedImage(data=file.getvalue())
    read = conversions.image_from_compressed(message, LIMIT)
    assert read.shape == taken.shape
    assert read[5, 5].min() > 200
    upright = decode_image(file.getvalue(), 'photograph')
    assert upright.shape == (60, 40, 3)


def test_compressed_image_that_says_it_is_huge_is_refused_before_it_is_decoded():
    def chunk(kind, body):
        check = struct.pack('>I', zlib.crc32(kind + body))
        return struct.pack('>I', len(body)) + kind + body + check

    head = struct.pack('>IIBBBBB', 30_000, 30_000, 8, 0, 0, 0, 0)
    packer = zlib.compressobj(9)
    # After a full flush each block is packed like the one before.
    first, block = (
        packer.compress(bytes(30_001 * 100)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2)
    )
    rows = first + 299 * block + packer.flush()
    data = b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', head) + chunk(b'IDAT', rows) + chunk(b'IEND', b'')
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(ImageError, match='far more than 1000000 pixels'):
        conversions.image_from_compressed(CompressedImage(data=data), LIMIT)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000


def test_odometry_that_is_no_number_is_refused():
    message = Odometry()
    with pytest.raises(ValueError, match='not zero'):
        conversions.base_pose_from_ros(Odometry(pose=no_turn()))
    message.pose.pose.position.x = math.nan
    with pytest.raises(ValueError, match='finite'):
        conversions.base_pose_from_ros(message)


def no_turn():
    pose = PoseWithCovariance()
    pose.pose.orientation.w = 0.0
    return pose


@settings(max_examples=50)
@given(st.floats(0.5, 8.0), st.floats(-1.2, 1.2), st.floats(-3.1, 3.1), st.floats(-100, 100))
def test_pose_of_exact_corners_is_exact(distance, turn, roll, offset):
    panel = Panel(0, distance, turn, roll=roll, offset=(offset, -offset / 2))
    pose = pose_of(corners_in_image(panel, CAMERA), panel.size, CAMERA)
    truth = corners_in_camera(panel, CAMERA)
    # the marker's frame: x right, y up, z out of the paper, towards the camera
    seen = np.array([[-0.1, 0.1, 0], [0.1, 0.1, 0], [0.1, -0.1, 0], [-0.1, -0.1, 0]])
    assert pose is not None
    assert np.allclose(seen @ pose.rotation.T + pose.position, truth, atol=2e-3 * distance)
    assert pose.reprojection_error < 0.05
    assert pose.rotation[2, 2] < 0
    message = conversions.pose_to_ros(pose)
    x, y, z, w = (getattr(message.orientation, axis) for axis in 'xyzw')
    assert math.isclose(x * x + y * y + z * z + w * w, 1.0, rel_tol=1e-9)


def test_trajectory_keeps_names_times_and_values():
    home = np.array(ARM.home)
    motion = motion_to(ARM, ArmState.resting(home), home + np.array([0.5, 0, 0, 0, 0]))
    message = conversions.trajectory_to_ros(motion, ARM.names)
    assert list(message.joint_names) == list(ARM.names)
    times = [p.time_from_start.sec + p.time_from_start.nanosec / 1e9 for p in message.points]
    assert np.allclose(times, motion.times, atol=1e-6)
    assert np.allclose([p.positions for p in message.points], motion.positions)
    assert np.allclose([p.velocities for p in message.points], motion.speeds)


def test_a_detection_without_a_measurement_is_a_marker_without_a_position():
    told = MarkerDetection(id=7, size=0.15)
    told.pose.position.z = 2.0
    assert conversions.seen_marker_from_ros(told).position is None
    told.pose_covariance = (np.eye(6) * 1e-4).ravel()
    told.pose.orientation.x, told.pose.orientation.w = 2.0, 0.0  # turned half around x
    seen = conversions.seen_marker_from_ros(told)
    assert seen.position is not None
    assert (seen.number, seen.side, seen.position.tolist()) == (7, 0.15, [0.0, 0.0, 2.0])
    assert np.allclose(seen.rotation, np.diag([1.0, -1.0, -1.0]))
    told.size = math.nan
    assert conversions.seen_marker_from_ros(told).position is None
