"""Reading images from files and bytes, with one-line errors."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

ImageArray = npt.NDArray[np.uint8]

IMAGE_SUFFIXES = ('.png', '.jpg', '.jpeg', '.bmp', '.pgm', '.ppm', '.tif', '.tiff', '.webp')


class ImageError(ValueError):
    """An image cannot be read; the message is one line."""


def decode_image(data: bytes, what: str) -> ImageArray:
    """A BGR image (height, width, 3) from an encoded one, such as a JPEG.

    Raises:
        ImageError: `data` is empty or no image.
    """
    if not data:
        raise ImageError(f'{what} is empty, expected an encoded image')
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise ImageError(f'{what} cannot be decoded: {_reason(error)}') from error
    if image is None:
        raise ImageError(f'{what} is no image that OpenCV can decode')
    return np.asarray(image, dtype=np.uint8)


def read_image(path: Path) -> ImageArray:
    """A BGR image (height, width, 3) from a file.

    Raises:
        ImageError: The file cannot be read or is no image.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ImageError(f'{path}: {error.strerror or error}') from error
    return decode_image(data, str(path))


def _reason(error: cv2.error) -> str:
    return ' '.join(str(getattr(error, 'err', error)).split())
