"""A disk that can be full, for what writes recordings."""

from __future__ import annotations

import errno
import io
import os
from pathlib import Path
from typing import IO, Any

import pytest

from surveillance_operator.recording import bag


class Disk:
    """The disk of all recordings of a test.

    Attributes:
        full: Whether it takes no more bytes.
    """

    def __init__(self) -> None:
        self.full = False

    def open(self, path: Path, mode: str = 'r', **options: Any) -> IO[Any]:
        """Open a file as `open` does."""
        if mode != 'wb':
            return open(path, mode, **options)
        return io.BufferedWriter(_File(self, path))


class _File(io.FileIO):
    def __init__(self, disk: Disk, path: Path) -> None:
        super().__init__(path, 'wb')
        self._disk = disk

    def write(self, data: Any, /) -> int:
        if self._disk.full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    """Return the disk that recordings are written to."""
    made = Disk()
    monkeypatch.setattr(bag, 'open', made.open, raising=False)
    return made
