"""Images one after the other: from a webcam, a video file or a folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from surveillance_perception.stream.image_files import (
    IMAGE_SUFFIXES,
    ImageArray,
    ImageError,
    read_image,
)
from surveillance_runtime.files import like_file


class FrameSource(Protocol):
    """Where images come from.

    Attributes:
        rate: Images a second that the source itself has; 0 when it has none.
    """

    rate: float

    def frames(self) -> Iterator[ImageArray | ImageError]:
        """Return each image (height, width, 3) BGR in turn, or why one cannot be read."""

    def close(self) -> None:
        """Let go of the source."""


def open_source(source: str) -> FrameSource:
    """Open a webcam by its number, a video file, an image or a folder of images.

    Raises:
        ImageError: There is no such thing, or it holds no images.
    """
    if source.isdigit():
        return _Capture(int(source), f'camera {source}')
    path = Path(source)
    if path.is_dir():
        files = sorted(each for each in path.iterdir() if each.suffix.lower() in IMAGE_SUFFIXES)
        if not files:
            raise ImageError(f'{path} holds no images ({", ".join(IMAGE_SUFFIXES)})')
        return _Files(files)
    if not path.exists():
        likely = like_file(path)
        expected = f", expected '{likely}'" if likely else ''
        raise ImageError(f'{source}: no such video file or folder of images{expected}')
    if path.suffix.lower() in IMAGE_SUFFIXES:
        return _Files([path])
    return _Capture(str(path), f'video {path}')


class _Files:
    rate = 0.0

    def __init__(self, files: list[Path]) -> None:
        self._files = files

    def frames(self) -> Iterator[ImageArray | ImageError]:
        for path in self._files:
            try:
                yield read_image(path)
            except ImageError as error:
                yield error

    def close(self) -> None:
        """Nothing is held open."""


class _Capture:
    def __init__(self, source: int | str, what: str) -> None:
        self._capture = cv2.VideoCapture(source)
        if not self._capture.isOpened():
            raise ImageError(f'{what} cannot be opened')
        self.rate = float(self._capture.get(cv2.CAP_PROP_FPS))
        if not 0.0 < self.rate < 1000.0:
            self.rate = 0.0
        if isinstance(source, int):
            # a camera keeps its own time: reading blocks until the next image
            self.rate = 0.0

    def frames(self) -> Iterator[ImageArray | ImageError]:
        while True:
            good, frame = self._capture.read()
            if not good:
                return
            yield np.asarray(frame, dtype=np.uint8)

    def close(self) -> None:
        self._capture.release()
