"""What was answered while a World's file could not be written: lines in a file beside it."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from armor_service.quarantine import Submission
from armor_service.store.records import entries, line_of, submission_as_json


class Spill:
    """Records in the order in which they were answered; there only while something waits.

    Args:
        path: The file.
        synced: Have each record on the disk for certain, as a loss of power asks for.

    Attributes:
        path: The file.
        number: The number of the last record.
        kept: How many of the directives that wait to be written are in it.
    """

    def __init__(self, path: Path, *, synced: bool = False) -> None:
        self.path = path
        self.number = 0
        self.kept = 0
        self._synced = synced
        self._last: object = None
        self._descriptor = -1
        self._end = 0
        self._is_there = True

    def read(self, merged: int, notes: list[str]) -> Iterator[Any]:
        """Yield what a process before left: directives, settings, and directives that wait.

        Args:
            merged: The number of the last record that is elsewhere already.
            notes: Gets one line if it is damaged.
        """
        self.number = merged
        try:
            records, damaged = entries(self.path.read_bytes())
        except FileNotFoundError:
            return
        if damaged:
            notes.append(f'{self.path}: {damaged} damaged lines are left out')
        for number, *record in records:
            self.number = max(self.number, number)
            if number > merged:
                yield record

    def keep(
        self, told: Sequence[Submission], state: dict[str, str], waiting: Sequence[Submission]
    ) -> None:
        """Keep what is not in it yet.

        Args:
            told: All directives that wait to be written.
            state: The settings of the reference.
            waiting: Directives that wait in a buffer.
        """
        new = told[self.kept :]
        last = state, list(map(id, waiting))
        if new or last != self._last:
            parts = [[submission_as_json(one) for one in each] for each in (new, waiting)]
            try:
                self.append([self.number + 1, parts[0], state, parts[1]])
            except OSError:
                return
            self.number += 1
            self.kept, self._last = len(told), last

    def append(self, record: Any) -> None:
        """Write a record as a whole.

        Raises:
            OSError: It could not be written, and is not there.
        """
        self._is_there = True
        if self._descriptor < 0:
            flags = os.O_CREAT | os.O_RDWR | os.O_APPEND | os.O_CLOEXEC
            self._descriptor = os.open(self.path, flags, 0o644)
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

    def merged(self) -> None:
        """Take note that what it says is where it belongs; it can be removed."""
        self.kept, self._last = 0, None

    def clear(self) -> None:
        """Remove the file: what it said is where it belongs."""
        if self._is_there:
            self.close()
            self.path.unlink(missing_ok=True)
            self._is_there = False

    def close(self) -> None:
        """Close the file."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
