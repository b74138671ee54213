"""Pixels of the encodings that cameras send, as the 8-bit grey or BGR images that detectors read.

Where an encoding carries brightness apart (YUV) or has to be interpolated anyway (Bayer), the
image becomes grey: nothing here needs its colour.

The names are those of `sensor_msgs/image_encodings.hpp`.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from surveillance_perception.stream.image_files import ImageArray, ImageError, Values, eight_bits

_LONGEST_NAME = 40


@dataclass(frozen=True)
class _Encoding:
    """How pixels lie in memory.

    Attributes:
        channels: Values of a pixel; for YUV 4:2:2 two.
        wide: Whether a value has 16 bits.
        conversion: OpenCV's conversion to grey or BGR; None takes the values as they are.
        brightness: Which value of a pixel is its brightness, where the others are left out.
        planes: Rows of data for each row of pixels, times two (3: 4:2:0 with its colour behind,
            6: 4:4:4).
    """

    channels: int
    wide: bool = False
    conversion: int | None = None
    brightness: int | None = None
    planes: int = 2


def _table() -> dict[str, _Encoding]:
    rgb, rgba, bgra = cv2.COLOR_RGB2BGR, cv2.COLOR_RGBA2BGR, cv2.COLOR_BGRA2BGR
    table: dict[str, _Encoding] = {}
    for bits, wide in (('8', False), ('16', True)):
        kind = f'{bits}UC'
        table |= {
            f'mono{bits}': _Encoding(1, wide),
            f'{kind}1': _Encoding(1, wide),
            f'rgb{bits}': _Encoding(3, wide, rgb),
            f'bgr{bits}': _Encoding(3, wide),
            f'{kind}3': _Encoding(3, wide),
            f'rgba{bits}': _Encoding(4, wide, rgba),
            f'bgra{bits}': _Encoding(4, wide, bgra),
            f'{kind}4': _Encoding(4, wide, bgra),
        }
        for pattern in ('RGGB', 'BGGR', 'GBRG', 'GRBG'):
            conversion = getattr(cv2, f'COLOR_Bayer{pattern}2GRAY')
            table[f'bayer_{pattern.lower()}{bits}'] = _Encoding(1, wide, conversion)
    for name in ('yuv422', 'uyvy'):
        table[name] = _Encoding(2, brightness=1)
    for name in ('yuv422_yuy2', 'yuyv'):
        table[name] = _Encoding(2, brightness=0)
    for name in ('nv12', 'nv21'):
        # the rows of brightness come first, those of colour are not looked at
        table[name] = _Encoding(1, planes=3)
    table['nv24'] = _Encoding(1, planes=6)
    return table


_ENCODINGS = _table()

ENCODING_NAMES: tuple[str, ...] = tuple(_ENCODINGS)
"""What `image_of_pixels` reads."""


def image_of_pixels(
    encoding: str,
    width: int,
    height: int,
    step: int,
    data: bytes,
    *,
    big_endian: bool = False,
    max_pixels: int,
) -> ImageArray:
    """Return a grey (height, width) or BGR (height, width, 3) image from raw pixels.

    Args:
        encoding: One of `ENCODING_NAMES`.
        width: Pixels.
        height: Pixels.
        step: Bytes of a row of data.
        data: The rows, or any buffer of bytes.
        big_endian: Order of the bytes of 16-bit values.
        max_pixels: The largest image that is taken.

    Raises:
        ImageError: The encoding is not known, or size, step and data do not fit.
    """
    how = _ENCODINGS.get(encoding)
    if how is None:
        raise ImageError(
            f'image encoded as {printable(encoding)}, expected one of {", ".join(_ENCODINGS)}'
        )
    size = f'{width}x{height}'
    if width <= 0 or height <= 0:
        raise ImageError(f'image of {size} pixels is empty')
    if width * height > max_pixels:
        raise ImageError(f'image of {size} pixels is larger than {max_pixels} pixels')
    row = width * how.channels * (2 if how.wide else 1)
    if step < row:
        raise ImageError(
            f'image has rows of {step} bytes, expected at least {row} '
            f'for {width} pixels of {encoding}'
        )
    rows = height * how.planes // 2
    # the last row may come without its padding
    expected = step * (rows - 1) + row
    if len(data) < expected:
        raise ImageError(f'image of {size} pixels has {len(data)} bytes, expected {expected}')
    whole = np.frombuffer(data, np.uint8, step * (rows - 1)).reshape(rows - 1, step)
    last = np.frombuffer(data, np.uint8, row, step * (rows - 1))
    used = np.concatenate([whole[:, :row], last[None]])[:height]
    values = used.view('>u2' if big_endian else '<u2') if how.wide else used
    # OpenCV takes the machine's own order of bytes only
    values = values.astype(values.dtype.newbyteorder('='), copy=False)
    if how.channels > 1:
        values = values.reshape(height, width, how.channels)
    if how.brightness is not None:
        values = values[..., how.brightness]
    return eight_bits(_converted(np.ascontiguousarray(values), how.conversion, encoding))


def printable(text: str) -> str:
    """Return a text from outside in quotes, without control characters, shortened: fit for a log
    line.
    """
    shown = text if len(text) <= _LONGEST_NAME else text[:_LONGEST_NAME] + '...'
    return repr(shown)


def _converted(values: Values, conversion: int | None, encoding: str) -> Values:
    if conversion is None:
        return values
    try:
        return np.asarray(cv2.cvtColor(values, conversion))
    except cv2.error as error:
        shape = f'{values.shape[1]}x{values.shape[0]}'
        raise ImageError(f'image of {shape} pixels of {encoding} cannot be converted') from error
