"""Files that nodes and commands leave: their names in a run, their errors, two ways to write."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

RECORD, PLACE = 'mission.jsonl', 'place.yaml'
RECORDING, TIMELINE = 'recording', 'timeline.jsonl'
"""In the folder of a run: the mission's record, the place, the recording and its time line."""


_KINDS = {
    stat.S_IFDIR: 'a folder',
    stat.S_IFIFO: 'a pipe',
    stat.S_IFCHR: 'a device',
    stat.S_IFBLK: 'a device',
    stat.S_IFSOCK: 'a socket',
}


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
        # Not blocking: a pipe would be waited for.
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        try:
            found = os.fstat(descriptor)
            if problem := _no_file(found):
                raise FileError(f'{path}: {problem}')
            if found.st_size > most:
                raise FileError(f'{path}: {found.st_size} bytes, at most {most} are read')
            with open(descriptor, 'rb', closefd=False) as file:
                return file.read(most)  # files of /proc say that they are empty
        finally:
            os.close(descriptor)
    except OSError as error:
        raise FileError(f'{path}: {error.strerror or error}') from None


def _no_file(found: os.stat_result) -> str:
    """Return what is wrong with something that is no regular file, empty for one that is."""
    if stat.S_ISREG(found.st_mode):
        return ''
    return f'expected a file, got {_KINDS[stat.S_IFMT(found.st_mode)]}'


def _check_place(path: Path) -> None:
    """Make sure that nothing but a file is written or replaced; for root that may be a device.

    Raises:
        OSError: Something else is there.
    """
    if path.exists() and (problem := _no_file(path.stat())):
        raise OSError(errno.EINVAL, problem, str(path))


def replace_text(path: Path, text: str) -> None:
    """Write a file so that whoever reads it finds all of the old text or all of the new one.

    Args:
        path: The file; its folder is there.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written; the error has its name, and the old file is whole.
    """
    _check_place(path)
    draft = path.with_name(path.name + '.new')
    try:
        draft.write_text(text, encoding='utf-8')
        os.replace(draft, path)
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
        _check_place(path)
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
