"""Camera messages as a broken or hostile driver sends them."""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from marker_detection import CameraModel, MarkerDetector, pose_of
from marker_detection.image_sampling import Array
from surveillance_perception.conversions import camera_from_ros, camera_to_ros, image_from_any
from surveillance_perception.stream.encodings import ENCODING_NAMES

MAX_PIXELS = 100_000
_NUMBERS = (0.0, -1.0, 1e-300, 1e300, float('nan'), float('inf'), 0.5, 3.0)
_LENGTHS = (0, 1, 3, 4, 5, 6, 8, 12, 14)


def damaged(generator: np.random.Generator) -> Any:
    """Return an Image, CompressedImage or CameraInfo with some of its fields made wrong."""
    return (_image, _compressed, _camera_info)[int(generator.integers(3))](generator)


def taken(message: Any, detector: MarkerDetector) -> bool:
    """Return whether a message was of use; False where it was refused with one line.

    Raises:
        Exception: What is no refusal but a defect.
    """
    try:
        if isinstance(message, CameraInfo):
            camera = camera_from_ros(message)
            pose_of(_OUTLINE, 0.2, camera)
            camera.scaled_to(320, 240)
        else:
            detector.detect(image_from_any(message, MAX_PIXELS))
    except ValueError as error:
        if not str(error).isprintable():
            raise RuntimeError(f'not fit for a log line: {error!r}') from error
        return False
    return True


_OUTLINE: Array = np.array([[50.0, 50.0], [90.0, 52.0], [88.0, 95.0], [51.0, 90.0]])


def _image(generator: np.random.Generator) -> Image:
    width, height = (int(each) for each in generator.integers(0, 70, 2))
    message = Image(width=width, height=height)
    message.encoding = str(generator.choice(ENCODING_NAMES))
    if generator.random() < 0.1:
        message.encoding = 'x\n[ERROR] forged\x1b[2J' * int(generator.integers(1, 50))
    message.step = width * int(generator.integers(1, 9)) + int(generator.integers(0, 4))
    size = message.step * height * 3 // 2
    message.is_bigendian = int(generator.integers(2))
    damage = generator.random()
    if damage < 0.1:
        message.width = int(generator.integers(2**32))
    elif damage < 0.2:
        message.height = int(generator.integers(2**32))
    elif damage < 0.3:
        message.step = int(generator.integers(2**32))
    elif damage < 0.4:
        size = int(generator.integers(0, max(1, size)))
    message.data.frombytes(generator.bytes(size))
    return message


def _compressed(generator: np.random.Generator) -> CompressedImage:
    kind = str(generator.choice(['.png', '.jpg', '.bmp', '.webp', '.tiff', '.ppm']))
    pixels = generator.integers(0, 256, (24, 32, 3), dtype=np.uint8)
    data = bytearray(cv2.imencode(kind, pixels)[1].tobytes())
    for _ in range(int(generator.integers(0, 6))):
        data[int(generator.integers(min(len(data), 200)))] = int(generator.integers(256))
    if generator.random() < 0.3:
        del data[int(generator.integers(len(data))) :]
    if kind == '.png' and len(data) > 24 and generator.random() < 0.3:
        data[16:24] = struct.pack('>II', *generator.integers(1, 2**31, 2).tolist())
    return CompressedImage(format=kind[1:], data=bytes(data))


def _camera_info(generator: np.random.Generator) -> CameraInfo:
    message = camera_to_ros(CameraModel.from_field_of_view(640, 480, 1.0), Image().header)
    message.distortion_model = str(
        generator.choice(['plumb_bob', 'rational_polynomial', 'equidistant', '', 'mei', 'a\nb'])
    )
    length = int(generator.choice(_LENGTHS))
    message.d = generator.normal(0.0, 0.3, length).tolist()
    if length and generator.random() < 0.3:
        message.d[int(generator.integers(length))] = float(generator.choice(_NUMBERS))
    for _ in range(int(generator.integers(0, 3))):
        message.k[int(generator.integers(9))] = float(generator.choice(_NUMBERS))
    if generator.random() < 0.3:
        message.width = int(generator.integers(2**32))
    if generator.random() < 0.3:
        message.binning_x = int(generator.integers(2**32))
        message.roi.x_offset = int(generator.integers(2**32))
        message.roi.height = int(generator.integers(2**32))
    return message
