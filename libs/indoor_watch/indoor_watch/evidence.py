"""Pictures and sweeps that show what was seen, in a folder that does not grow beyond its bounds.

What no event needs that goes on goes first, of that the least severe, and of like severity the
oldest: a file's name says both. Its owner alone reads them.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Collection
from itertools import chain, count
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid

Points = NDArray[np.float64]

AROUND = 3.0
"""A sweep's picture shows so much on either side of what it is about, metres."""
SCALE = 60.0
"""Pixels for a metre."""
_NAME = re.compile(r'(\d)_(\d{13})_.*')
DAY = 86400.0


SWEEP, BLURRED = 'sweep-', 'blurred-'
"""So begins what a picture is of: a map with a sweep of the lidar; a camera's picture in which
persons and faces were looked for, and are blurred."""


def shows_nobody(name: str) -> bool:
    """Tell whether nobody can be recognised in a file: in a sweep, or where all are blurred."""
    match = _NAME.fullmatch(name)
    return match is not None and name[len('0_0000000000000_') :].startswith((SWEEP, BLURRED))


class EvidenceStore:
    """Keeps pictures.

    Args:
        folder: Made when missing.
        most_bytes: What all files may take together.
        most_days: What is older is deleted, days.

    Raises:
        OSError: The folder cannot be made or read.
    """

    def __init__(
        self, folder: Path, most_bytes: int = 300_000_000, most_days: float = 30.0
    ) -> None:
        self._folder = folder
        self._days = most_days
        self._most = most_bytes
        private_folder(folder)
        self._sizes = {
            each.name: each.stat().st_size for each in folder.iterdir() if _NAME.match(each.name)
        }

    def keep(
        self,
        picture: NDArray[np.uint8],
        what: str,
        severity: int,
        stamp: float,
        needed: Collection[str] = (),
    ) -> str:
        """Write a picture and return its name; empty where it cannot be written.

        Args:
            picture: Grey or BGR.
            what: Part of the name, of letters, digits and dashes.
            severity: 0 to 9; higher is kept longer.
            stamp: Seconds since 1970.
            needed: What shows what goes on: it goes last.
        """
        what = re.sub(r'[^A-Za-z0-9-]', '-', what)[:40]
        stem = f'{min(max(severity, 0), 9)}_{max(0, round(1000 * stamp)):013d}_{what}'
        # Two things are noticed in one comparison: each keeps its picture.
        names = chain([f'{stem}.jpg'], (f'{stem}-{number}.jpg' for number in count(2)))
        name = next(each for each in names if each not in self._sizes)
        good, data = cv2.imencode('.jpg', picture, [cv2.IMWRITE_JPEG_QUALITY, 85])
        if not good:
            return ''
        try:
            write_private(self._folder / name, data.tobytes())
        except OSError:
            self._delete(name)
            return ''  # the disk is full: what was seen counts without a picture
        self._sizes[name] = len(data)
        self._prune(stamp, needed)
        return name if name in self._sizes else ''

    @property
    def total(self) -> int:
        """Bytes of all files."""
        return sum(self._sizes.values())

    def forget_old(self, stamp: float) -> None:
        """Delete what is older than it may become.

        Args:
            stamp: Now, seconds since 1970.
        """
        for name in [each for each in self._sizes if int(each[2:15]) < oldest(stamp, self._days)]:
            del self._sizes[name]
            self._delete(name)

    def _delete(self, name: str) -> None:
        # The disk may have become one to read from alone.
        with contextlib.suppress(OSError):
            (self._folder / name).unlink(missing_ok=True)

    def delete(self, name: str) -> None:
        """Delete a picture, if it is there."""
        if self._sizes.pop(name, None) is not None:
            self._delete(name)

    def _prune(self, stamp: float, needed: Collection[str]) -> None:
        self.forget_old(stamp)
        total = self.total
        for name in sorted(self._sizes, key=lambda each: (each in needed, each[0], each[2:15])):
            if total <= self._most:
                return
            total -= self._sizes.pop(name)
            self._delete(name)


def private_folder(folder: Path) -> None:
    """Make a folder, if it is missing, that its owner alone reads: faces are in its pictures.

    Raises:
        OSError: It cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    # One that is another user's is as it is.
    with contextlib.suppress(PermissionError):
        folder.chmod(0o700)


def write_private(path: Path, data: bytes) -> None:
    """Write a file that its owner alone reads.

    Raises:
        OSError: It cannot be written.
    """
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), 'wb') as file:
        file.write(data)


def oldest(stamp: float, days: float) -> int:
    """Return the time of the oldest file that is kept, milliseconds since 1970."""
    return round(1000.0 * (stamp - days * DAY))


def side_by_side(before: NDArray[np.uint8], now: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return two pictures beside each other, of the height of the second, with their names on them.

    Args:
        before: Grey or BGR: how it looks normally.
        now: Grey or BGR.
    """
    rows = now.shape[0]
    shown = []
    for picture, word in ((before, 'before'), (now, 'now')):
        colour = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture.copy()
        size = max(1, round(colour.shape[1] * rows / colour.shape[0])), rows
        colour = cv2.resize(colour, size, interpolation=cv2.INTER_AREA)
        for thick, value in ((4, 255), (1, 0)):
            cv2.putText(colour, word, (8, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (value,) * 3, thick)
        shown.append(colour)
    line = np.full((rows, 4, 3), 255, np.uint8)
    return np.asarray(np.hstack([shown[0], line, shown[1]]), np.uint8)


def sweep_picture(
    grid: Grid, middle: tuple[float, float], sensor: tuple[float, float], ends: Points
) -> NDArray[np.uint8]:
    """Return a map around a point with what a sweep met: walls black, beams' ends red, the robot
    blue, a green ring around the point. North is up.

    Args:
        grid: The map.
        middle: What it is about, map frame, metres.
        sensor: Where the lidar was, same frame.
        ends: What was met, (n, 2), same frame.
    """
    side = round(2 * AROUND * SCALE)
    offsets = (np.arange(side) + 0.5) / SCALE - AROUND
    x, y = np.meshgrid(middle[0] + offsets, middle[1] - offsets)
    cells = grid.cells_of(np.stack([x.ravel(), y.ravel()], axis=1))
    inside = grid.contains(cells)
    values = np.full(len(cells), -1, np.int16)
    values[inside] = grid.cells[cells[inside, 0], cells[inside, 1]]
    grey = np.where(values < 0, 200, np.where(values >= 65, 0, 255)).astype(np.uint8)
    picture = np.repeat(grey.reshape(side, side, 1), 3, axis=2)

    def pixel(point: tuple[float, float]) -> tuple[int, int]:
        return (
            round((point[0] - middle[0] + AROUND) * SCALE),
            round((middle[1] - point[1] + AROUND) * SCALE),
        )

    for end in ends.tolist():
        if max(abs(end[0] - middle[0]), abs(end[1] - middle[1])) < AROUND:
            cv2.circle(picture, pixel((end[0], end[1])), 2, (0, 0, 220), -1)
    if max(abs(sensor[0] - middle[0]), abs(sensor[1] - middle[1])) < AROUND:
        cv2.circle(picture, pixel(sensor), 8, (220, 90, 0), 2)
    cv2.circle(picture, pixel(middle), 24, (0, 150, 0), 2)
    return np.asarray(picture, np.uint8)
