"""Pictures that leave the machine: whoever may be a person in them cannot be recognised.

Persons are looked for with the network of `persons`, faces with the cascade of scikit-image (local
binary patterns). Where that network is not installed, nobody can say where persons are: then the
whole picture is sent coarse. Maps with a sweep of the lidar show nobody and are sent as they are,
and so is a picture that was blurred when it was kept.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from indoor_watch.evidence import shows_nobody
from indoor_watch.persons import load_finder

Picture = NDArray[np.uint8]
Box = tuple[int, int, int, int]
"""Left, top, width, height, pixels."""
Find = Callable[[Picture], list[Box]]

WIDEST = 800
"""A picture that is sent is at most so wide, pixels."""
LEFT_PIXELS = 6
"""What is blurred is shrunk to so many pixels across before it is drawn again."""
COARSE = 48
"""Of a whole picture that is sent coarse so many pixels across are left."""
MARGIN = 0.15
"""So much is blurred around what was found, as a part of its sides."""


class PictureError(Exception):
    """A picture cannot be read."""


def shareable(path: Path, *, blur: bool = True, find: Find | None = None) -> bytes:
    """Return a picture as JPEG that may leave the machine.

    Args:
        path: The picture.
        blur: Whether people in it are blurred.
        find: Finds persons; None: the network of `persons`, where it is installed.

    Raises:
        PictureError: It cannot be read.
    """
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR) if len(data) else None
    except (OSError, cv2.error) as error:
        why = error.strerror if isinstance(error, OSError) else 'no picture'
        raise PictureError(f'{path.name}: {why}') from None
    if picture is None:
        raise PictureError(f'{path.name}: no picture')
    shown = np.asarray(picture, np.uint8)
    if blur and not shows_nobody(path.name):
        shown = blurred(shown, find or installed_finder())
    if shown.shape[1] > WIDEST:
        size = WIDEST, round(shown.shape[0] * WIDEST / shown.shape[1])
        shown = np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_AREA), np.uint8)
    return bytes(cv2.imencode('.jpg', shown, [cv2.IMWRITE_JPEG_QUALITY, 80])[1])


def blurred(picture: Picture, find: Find | None) -> Picture:
    """Return a picture (rows, columns, 3) in which nobody can be recognised.

    Args:
        picture: BGR.
        find: Finds persons; None: all of it becomes coarse.
    """
    result = picture.copy()
    rows, columns = picture.shape[:2]
    if find is None:
        _coarsen(result, (0, 0, columns, rows), COARSE)
        return result
    for box in (*find(picture), *faces_in(picture)):
        _coarsen(result, _inside(box, rows, columns), LEFT_PIXELS)
    return result


def blurred_at_rest(picture: Picture) -> tuple[Picture, bool]:
    """Return a picture as it is kept: people blurred, as far as they are found, and faces.

    And whether persons were looked for: then it may leave the machine as it is.

    Args:
        picture: Grey or BGR.
    """
    colour = picture
    if picture.ndim == 2:
        colour = np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), np.uint8)
    finder = installed_finder()
    # It stays on the machine: where no network finds persons, their faces alone are blurred.
    return blurred(colour, finder or (lambda _: [])), finder is not None


def faces_in(picture: Picture) -> list[Box]:
    """Return where faces may be that look at the camera."""
    shrink = max(1.0, picture.shape[1] / 640.0)
    small = cv2.resize(picture, None, fx=1 / shrink, fy=1 / shrink, interpolation=cv2.INTER_AREA)
    largest = min(small.shape[:2])
    found = _cascade().detect_multi_scale(
        img=cv2.cvtColor(small, cv2.COLOR_BGR2RGB),
        scale_factor=1.2,
        step_ratio=1,
        min_size=(24, 24),
        max_size=(largest, largest),
    )
    return [
        (
            round(each['c'] * shrink),
            round(each['r'] * shrink),
            round(each['width'] * shrink),
            round(each['height'] * shrink),
        )
        for each in found
    ]


@cache
def installed_finder() -> Find | None:
    """Return what finds persons; None where its network is not installed."""
    try:
        finder = load_finder(anybody=True)
    except ValueError:
        return None
    return lambda picture: [each.box for each in finder.find(picture)]


def _coarsen(picture: Picture, box: Box, left_over: int) -> None:
    left, top, width, height = box
    if min(width, height) < 1:
        return
    part = picture[top : top + height, left : left + width]
    size = min(left_over, width), max(1, min(height, round(left_over * height / width)))
    few = cv2.resize(part, size, interpolation=cv2.INTER_AREA)
    part[:] = cv2.resize(few, (width, height), interpolation=cv2.INTER_LINEAR).reshape(part.shape)


def _inside(box: Box, rows: int, columns: int) -> Box:
    """Return a box with a margin around it, cut off where the picture ends."""
    x, y, wide, high = box
    left, top = max(0, round(x - MARGIN * wide)), max(0, round(y - MARGIN * high))
    right = min(columns, round(x + (1 + MARGIN) * wide))
    bottom = min(rows, round(y + (1 + MARGIN) * high))
    return left, top, max(0, right - left), max(0, bottom - top)


@cache
def _cascade() -> Any:
    from skimage import data, feature  # takes its time, and most runs send no picture

    return feature.Cascade(data.lbp_frontal_face_cascade_filename())
