"""The robot's images as JPEG, and what is none."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image as Picture
from sensor_msgs.msg import CompressedImage, Image

from surveillance_operator.images import jpeg_from


@pytest.mark.parametrize('encoding', ['rgb8', 'bgr8', 'mono8'])
def test_an_image_has_its_colours_and_no_padding(encoding: str) -> None:
    channels = 1 if encoding == 'mono8' else 3
    pixel = {'rgb8': (250, 10, 20), 'bgr8': (20, 10, 250), 'mono8': (90,)}[encoding]
    rows = np.zeros((16, 24 * channels + 5), np.uint8)
    rows[:, : 24 * channels] = np.tile(pixel, 24)
    message = Image(height=16, width=24, step=rows.shape[1], encoding=encoding)
    message.data = rows.tobytes()
    jpeg = jpeg_from(message)
    assert jpeg is not None
    found = Picture.open(io.BytesIO(jpeg)).convert('RGB')
    assert found.size == (24, 16)
    expected = (250, 10, 20) if channels == 3 else (90, 90, 90)
    assert np.abs(np.asarray(found)[8, 20].astype(int) - expected).max() < 12


def test_what_is_no_image_is_none() -> None:
    assert jpeg_from(Image(height=2, width=2, step=6, encoding='32FC1')) is None
    assert jpeg_from(Image(height=2, width=2, step=6, encoding='rgb8', data=b'1234')) is None
    assert jpeg_from(Image(height=2, width=2, step=1, encoding='rgb8', data=b'1' * 12)) is None
    assert jpeg_from(CompressedImage(data=b'PNG')) is None
    assert jpeg_from(CompressedImage(data=b'\xff\xd8rest')) == b'\xff\xd8rest'
