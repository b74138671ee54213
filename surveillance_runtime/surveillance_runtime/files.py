"""Files that nodes and commands leave: their names in a run, their errors, two ways to write."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from surveillance_fsm import files

RECORD, PLACE = 'mission.jsonl', 'place.yaml'
RECORDING, TIMELINE = 'recording', 'timeline.jsonl'
"""In the folder of a run: the mission's record, the place, the recording and its time line."""


class FileError(ValueError):
    """A file cannot be read, written or understood; one line that says which, and often where."""


def in_one_line(error: OSError) -> str:
    """Return one line for a user: the file, where it is known, and what is wrong with it."""
    what = f'{error.filename}: ' if error.filename else ''
    return f'{what}{error.strerror or error}'


def read_file(path: Path, most: int) -> bytes:
    """Return what a file holds; a pipe or a device is never read: it may have no end.

    Raises:
        FileError: It cannot be read, is no regular file, or holds more than `most` bytes.
    """
    try:
        return files.read_file(path, most)
    except OSError as error:
        raise FileError(f'{path}: {error.strerror or error}') from None


def replace_text(path: Path, text: str) -> None:
    """Write a file so that whoever reads it finds all of the old text or all of the new one.

    Args:
        path: The file, or a link to it, which stays; its folder is there.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written; the error has its name, and the old file is whole.
    """
    target = files.file_to_write(path)
    draft = target.with_name(target.name + '.new')
    try:
        draft.write_text(text, encoding='utf-8')
        os.replace(draft, target)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


class LineFile:
    """Appends lines to a file, each whole or not at all.

    Args:
        path: The file, made when missing. An unfinished last line is dropped.

    Raises:
        OSError: It cannot be opened for writing.
    """

    def __init__(self, path: Path) -> None:
        files.file_to_write(path)
        self._path = path
        content = path.read_bytes() if path.exists() else b''
        whole = content.rfind(b'\n') + 1
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
        self._descriptor = os.open(path, flags, 0o644)
        if whole != len(content):
            os.ftruncate(self._descriptor, whole)

    def append(self, line: bytes) -> int:
        """Write a line, with its line break; return the size of the file.

        Raises:
            OSError: The file takes no more; the error has its name.
        """
        try:
            written = os.write(self._descriptor, line)
            size = os.fstat(self._descriptor).st_size
            if written != len(line):
                os.ftruncate(self._descriptor, size - written)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        return size

    def close(self) -> None:
        """Close the file; nothing is lost without it."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
