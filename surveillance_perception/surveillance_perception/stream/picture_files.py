"""Reading pictures from files and bytes, with one-line errors."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]

PICTURE_SUFFIXES = ('.png', '.jpg', '.jpeg', '.bmp', '.pgm', '.ppm', '.tif', '.tiff', '.webp')


class PictureError(ValueError):
    """A picture cannot be read; the message is one line."""


def decode_picture(data: bytes, what: str) -> Picture:
    """A BGR picture (height, width, 3) from an encoded one, such as a JPEG.

    Raises:
        PictureError: `data` is empty or no picture.
    """
    if not data:
        raise PictureError(f'{what} is empty, expected an encoded picture')
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    except cv2.error as error:
        raise PictureError(f'{what} cannot be decoded: {_reason(error)}') from error
    if picture is None:
        raise PictureError(f'{what} is no picture that OpenCV can decode')
    return np.asarray(picture, dtype=np.uint8)


def read_picture(path: Path) -> Picture:
    """A BGR picture (height, width, 3) from a file.

    Raises:
        PictureError: The file cannot be read or is no picture.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PictureError(f'{path}: {error.strerror or error}') from error
    return decode_picture(data, str(path))


def _reason(error: cv2.error) -> str:
    return ' '.join(str(getattr(error, 'err', error)).split())
