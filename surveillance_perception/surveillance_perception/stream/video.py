"""Images one after the other: from a webcam, a video file or a folder."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from strict_files.files import like_file
from surveillance_perception.stream.image_files import (
    IMAGE_SUFFIXES,
    ImageArray,
    ImageError,
    read_image,
)


@dataclass(frozen=True)
class FrameSource:
    """Where images come from.

    Attributes:
        frames: Each image (height, width, 3) BGR in turn, or why one cannot be read; its `close`
            lets go of the source.
        rate: Images a second that the source itself has; 0 when it has none.
    """

    frames: Generator[ImageArray | ImageError]
    rate: float = 0.0


def open_source(source: str) -> FrameSource:
    """Open a webcam by its number, a video file, an image or a folder of images.

    Raises:
        ImageError: There is no such thing, or it holds no images.
    """
    if source.isdigit():
        # a camera keeps its own time: reading blocks until the next image
        return FrameSource(_captured(_opened(int(source), f'camera {source}')))
    path = Path(source)
    if path.is_dir():
        files = sorted(each for each in path.iterdir() if each.suffix.lower() in IMAGE_SUFFIXES)
        if not files:
            raise ImageError(f'{path} holds no images ({", ".join(IMAGE_SUFFIXES)})')
        return FrameSource(_images_in(files))
    if not path.exists():
        likely = like_file(path)
        expected = f", expected '{likely}'" if likely else ''
        raise ImageError(f'{source}: no such video file or folder of images{expected}')
    if path.suffix.lower() in IMAGE_SUFFIXES:
        return FrameSource(_images_in([path]))
    capture = _opened(str(path), f'video {path}')
    rate = float(capture.get(cv2.CAP_PROP_FPS))
    return FrameSource(_captured(capture), rate if 0.0 < rate < 1000.0 else 0.0)


def _images_in(files: list[Path]) -> Generator[ImageArray | ImageError]:
    for path in files:
        try:
            yield read_image(path)
        except ImageError as error:
            yield error


def _opened(source: int | str, what: str) -> cv2.VideoCapture:
    capture = cv2.VideoCapture(source)
    if not capture.isOpened():
        raise ImageError(f'{what} cannot be opened')
    return capture


def _captured(capture: cv2.VideoCapture) -> Generator[ImageArray | ImageError]:
    try:
        while True:
            good, frame = capture.read()
            if not good:
                return
            yield np.asarray(frame, dtype=np.uint8)
    finally:
        capture.release()
