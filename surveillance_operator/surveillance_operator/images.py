"""The robot's images: on which topics they come, and each as JPEG."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image
from sensor_msgs.msg import CompressedImage
from sensor_msgs.msg import Image as ImageMessage

ANNOTATED, PLAIN = 'aruco_detector/annotated', 'camera/rgb/image_raw'
"""The image with the markers drawn in, which a detector publishes while it looks; the plain one."""
SUFFIX = '/compressed'
"""Ends the name of a topic of compressed images, as image_transport has it."""
COMPRESSED = 'sensor_msgs/msg/CompressedImage'
KINDS = {'sensor_msgs/msg/Image': ImageMessage, COMPRESSED: CompressedImage}
"""The types of images by their names."""
MOST_PIXELS = 20_000_000
JPEG_QUALITY = 75
JPEG_START = b'\xff\xd8'


def jpeg_from(message: ImageMessage | CompressedImage) -> bytes | None:
    """Return an image as JPEG; None when its encoding or its size cannot be used."""
    if isinstance(message, CompressedImage):
        data = bytes(message.data)
        return data if data.startswith(JPEG_START) else None
    channels = {'rgb8': 3, 'bgr8': 3, 'mono8': 1}.get(message.encoding)
    if channels is None or not 0 < message.width * message.height <= MOST_PIXELS:
        return None
    pixels = np.frombuffer(bytes(message.data), np.uint8)
    if message.step < message.width * channels or pixels.size < message.step * message.height:
        return None
    rows = pixels[: message.step * message.height].reshape(message.height, message.step)
    image = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
    if message.encoding == 'bgr8':
        image = image[:, :, ::-1]
    file = io.BytesIO()
    Image.fromarray(image if channels == 3 else image[:, :, 0]).save(
        file, 'JPEG', quality=JPEG_QUALITY
    )
    return file.getvalue()
