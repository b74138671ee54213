"""Reading images from files and bytes, with one-line errors."""

from __future__ import annotations

import io
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from strict_files.files import FileError, read_file

# what OpenCV cannot decode is said once, by an ImageError
_set_level = cv2.setLogLevel if hasattr(cv2, 'setLogLevel') else cv2.utils.logging.setLogLevel
_set_level(0)

ImageArray = npt.NDArray[np.uint8]
Values = npt.NDArray[Any]
"""Pixels of 8 or 16 bits."""

IMAGE_SUFFIXES = ('.png', '.jpg', '.jpeg', '.bmp', '.pgm', '.ppm', '.tif', '.tiff', '.webp')


MAX_PIXELS = 100_000_000
"""The largest image that is decoded where nobody says otherwise."""

MAX_BYTES = 500_000_000
"""The largest image file that is read."""

_PNG = b'\x89PNG\r\n\x1a\n'
_FORMATS = ('PNG', 'JPEG', 'BMP', 'WEBP', 'TIFF', 'PPM')
# of 16-bit values: what is taken for white, and rows that are looked at to find it
_WHITE_PERCENTILE, _SAMPLED_ROWS = 99.7, 128


class ImageError(ValueError):
    """An image cannot be read; the message is one line."""


def decode_image(
    data: bytes, what: str, max_pixels: int = MAX_PIXELS, *, upright: bool = True
) -> ImageArray:
    """Return a BGR image (height, width, 3) from an encoded one, such as a JPEG.

    The size in the header is looked at first: a small file may say that it is huge.

    Args:
        data: The encoded image.
        what: Names it in an error.
        max_pixels: The largest image that is taken.
        upright: Whether it is turned as its EXIF orientation says.

    Raises:
        ImageError: `data` is empty, no image, or a larger one.
    """
    if not data:
        raise ImageError(f'{what} is empty, expected an encoded image')
    _check_size(_size_in_header(data, what, max_pixels), what, max_pixels)
    _check_chunks(data, what)
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
    if not upright:
        flags |= cv2.IMREAD_IGNORE_ORIENTATION
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:
        raise ImageError(f'{what} cannot be decoded: {_reason(error)}') from error
    if image is None:
        raise ImageError(f'{what} is no image that OpenCV can decode')
    _check_size((image.shape[1], image.shape[0]), what, max_pixels)
    return eight_bits(image)


def eight_bits(values: Values) -> ImageArray:
    """Return pixels with 8 bits a channel; those of 16 are scaled.

    Cameras fill between ten and sixteen of the bits. White is what a few pixels in a thousand
    exceed at most: single ones of a sensor are defective and always bright.
    """
    if values.dtype == np.uint8:
        return values
    every = 1 + min(values.shape[:2]) // _SAMPLED_ROWS
    white = float(np.percentile(values[::every, ::every], _WHITE_PERCENTILE))
    scaled = cv2.convertScaleAbs(values, alpha=255.0 / max(white, 255.0))
    return np.asarray(scaled, dtype=np.uint8)


def read_image(path: Path, max_pixels: int = MAX_PIXELS) -> ImageArray:
    """Return a BGR image (height, width, 3) from a file.

    Raises:
        ImageError: The file cannot be read, is no image, or a larger one than `max_pixels`.
    """
    try:
        data = read_file(path, MAX_BYTES)
    except FileError as error:
        raise ImageError(str(error)) from None
    return decode_image(data, str(path), max_pixels)


def _size_in_header(data: bytes, what: str, max_pixels: int) -> tuple[int, int]:
    """Width and height by the header alone, which Pillow reads without decoding."""
    # late: nodes that read raw images need no Pillow
    import PIL.Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            with PIL.Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                return image.size
    except PIL.Image.DecompressionBombError:
        raise ImageError(f'{what} has far more than {max_pixels} pixels') from None
    except Exception as error:
        # whatever Pillow raises on junk: OSError, SyntaxError, struct.error, EOFError, ...
        raise ImageError(f'{what} is no image that OpenCV can decode') from error


def _check_chunks(data: bytes, what: str) -> None:
    """Look at the lengths in a PNG first: OpenCV allocates what a damaged one says, up to 2 GB."""
    if not data.startswith(_PNG):
        return
    at = len(_PNG)
    while at + 8 <= len(data):
        length = int.from_bytes(data[at : at + 4], 'big')
        if length > len(data) - at - 12:
            raise ImageError(f'{what} is no whole PNG: a part of {length} bytes is cut off')
        at += 12 + length


def _check_size(size: tuple[int, int], what: str, max_pixels: int) -> None:
    width, height = size
    if width * height > max_pixels:
        raise ImageError(f'{what} of {width}x{height} pixels is larger than {max_pixels} pixels')


def _reason(error: cv2.error) -> str:
    return ' '.join(str(getattr(error, 'err', error)).split())
