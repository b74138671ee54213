"""What was answered while a World's file could not be written: lines in a file beside it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from armor_service.store.records import entries, line_of


class Spill:
    """Records in the order in which they were answered; there only while something waits.

    Args:
        path: The file.
        synced: Have each record on the disk for certain, as a loss of power asks for.
    """

    def __init__(self, path: Path, *, synced: bool = False) -> None:
        self._path = path
        self._synced = synced
        self._descriptor = -1
        self._end = 0
        self._is_there = True

    def read(self) -> tuple[list[Any], int]:
        """Return the records that a process before left, and how many lines are damaged."""
        try:
            return entries(self._path.read_bytes())
        except FileNotFoundError:
            return [], 0

    def append(self, record: Any) -> None:
        """Write a record as a whole.

        Raises:
            OSError: It could not be written, and is not there.
        """
        self._is_there = True
        if self._descriptor < 0:
            flags = os.O_CREAT | os.O_RDWR | os.O_APPEND | os.O_CLOEXEC
            self._descriptor = os.open(self._path, flags, 0o644)
            self._end = os.fstat(self._descriptor).st_size
        rest = memoryview(line_of(record))
        size = len(rest)
        try:
            while rest:
                # A disk that is almost full takes a part without an error.
                rest = rest[os.write(self._descriptor, rest) :]
            if self._synced:
                os.fdatasync(self._descriptor)
        except OSError:
            os.ftruncate(self._descriptor, self._end)
            raise
        self._end += size

    def clear(self) -> None:
        """Remove the file: what it said is where it belongs."""
        if self._is_there:
            self.close()
            self._path.unlink(missing_ok=True)
            self._is_there = False

    def close(self) -> None:
        """Close the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
