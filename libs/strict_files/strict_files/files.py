"""Files for people and programs: errors in one line, bounded reading, three ways to write."""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from strict_files import regular_files
from strict_files.one_line import clean
from strict_files.suggestions import like


class FileError(ValueError):
    """A file cannot be read, written or understood; one line that says which, and often where.

    What a file holds may be anything: control characters in the line are written as escapes, and
    one that is very long loses its middle.
    """

    def __init__(self, problem: str) -> None:
        super().__init__(clean(problem))


def in_one_line(error: OSError) -> str:
    """Return one line for a user: the file, where it is known, and what is wrong with it.

    Of a file that is not there, the one that is most like it is named.
    """
    what = f'{error.filename}: ' if error.filename else ''
    there = ''
    if error.errno == errno.ENOENT and isinstance(error.filename, str | Path):
        there = like_file(Path(error.filename))
    return f'{what}{error.strerror or error}' + (f", expected '{there}'" if there else '')


def like_file(path: Path) -> str:
    """Return the path that is most like one that is not there; empty where none is like it."""
    # os.path says False for a name that is too long, where a Path raises.
    chain = reversed([path, *path.parents])
    missing = next((each for each in chain if not os.path.exists(each)), None)
    if missing is None:
        return ''
    with contextlib.suppress(OSError):
        # A link that leads nowhere is listed, too.
        there = set(os.listdir(missing.parent)) - {missing.name}
        # What the names have in common by their ending alone is no likeness.
        stems = {Path(each).stem: each for each in sorted(there)}
        stems |= {Path(each).stem: each for each in there if each.endswith(missing.suffix)}
        if name := stems.get(like(missing.stem, list(stems))):
            likely = missing.with_name(name)
            whole = likely / path.relative_to(missing)
            return str(whole if os.path.exists(whole) else likely)
    return ''


def read_file(path: Path, most: int) -> bytes:
    """Return what a file holds; a pipe or a device is never read: it may have no end.

    Raises:
        FileError: It cannot be read, is no regular file, or holds more than `most` bytes.
    """
    try:
        return regular_files.read_file(path, most)
    except OSError as error:
        raise FileError(in_one_line(error)) from None


def read_json(path: Path, most: int) -> Any:
    """Return what a small JSON file holds, whose numbers are finite; None where no file is.

    Raises:
        FileError: It cannot be read, holds more than `most` bytes or something else.
    """
    try:
        if not path.exists():
            return None
        data = read_file(path, most)
        found = regular_files.parse_json(
            data, parse_int=_whole, parse_float=_finite, parse_constant=_finite
        )
        if found is None:
            raise ValueError('holds nothing')
        return found
    except FileError:
        raise
    except OSError as error:  # a name that is too long, a folder that may not be entered
        raise FileError(in_one_line(error)) from None
    except (ValueError, OverflowError) as error:
        raise FileError(f'{path}: {error}') from None


def _finite(text: str) -> float:
    """Return a number of a file; one that is none would make every comparison false in silence."""
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f'got {text:.20}, expected a finite number')
    return number


def _whole(text: str) -> int:
    _finite(text)
    return int(text)


def replace_text(path: Path, text: str) -> None:
    """Write a file so that whoever reads it finds all of the old text or all of the new one.

    Args:
        path: The file, or a link to it, which stays; its folder is there.
        text: What it is to hold.

    Raises:
        OSError: It cannot be written; the error has its name, and the old file is whole.
    """
    regular_files.replace_file(path, text.encode('utf-8'))


class KeptFile:
    """A small JSON object that a node keeps for whoever comes after it.

    A file that could not be read is kept aside, as `NAME.unread`, before another is written.

    Args:
        path: The file; empty: nothing is kept.
        loss: Ends each line about a file that cannot be read: what that means.
    """

    LARGEST = 100_000_000
    """Bytes that are read at most."""

    def __init__(self, path: str = '', loss: str = '') -> None:
        self._path = Path(os.path.expanduser(path)) if path else None
        self._loss = loss
        self._written = ''
        self._is_unread = False

    @classmethod
    def of_record(cls, record: str, ending: str) -> KeptFile:
        """Return what was learned on the mission of a record, which stands beside the record."""
        if not record:
            return cls()
        path = Path(record + ending).absolute()
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
        return cls(str(path), 'what was learned before is not used')

    def __bool__(self) -> bool:
        """Tell whether anything is kept."""
        return self._path is not None

    def read(self, take: Callable[[dict[str, Any]], None]) -> str:
        """Give what the file holds; return what is wrong with it, empty when it is right.

        Args:
            take: Takes it, or raises any of the errors of a dictionary that holds something else,
                and has taken nothing then.
        """
        try:
            found = read_json(self._path, self.LARGEST) if self._path is not None else None
            if found is not None:
                take(found)
            return ''
        except FileError as error:
            problem = str(error)
        except KeyError as error:
            problem = f'{self._path}: expected {error} in it'
        except (ValueError, IndexError, TypeError, AttributeError) as error:
            problem = f'{self._path}: does not fit: {error}'
        self._is_unread = True
        return f'{problem}; {self._loss}'

    def write(self, content: Mapping[str, Any]) -> str:
        """Write the file in one piece if that changes it; return why it is not written, or ''."""
        text = json.dumps(content) + '\n'
        if self._path is not None and text != self._written:
            try:
                if self._is_unread:
                    keep_aside(self._path)
                    self._is_unread = False
                replace_text(self._path, text)
            except OSError as error:
                return in_one_line(error)
            self._written = text
        return ''


def keep_aside(path: Path) -> None:
    """Call a file `NAME.unread`, or the first of `.unread2`, `.unread3` ... that there is not.

    Args:
        path: The file, or a link to it, which stays. What is no regular file stays, too.

    Raises:
        OSError: It cannot be renamed.
    """
    file = Path(os.path.realpath(path))
    if file.is_file():
        endings = itertools.chain([''], itertools.count(2))
        names = (file.with_name(f'{file.name}.unread{each}') for each in endings)
        file.rename(next(name for name in names if not os.path.lexists(name)))


class LineFile:
    """Appends lines to a file, each whole or not at all.

    Args:
        path: The file, made when missing. An unfinished last line is dropped.

    Raises:
        OSError: It cannot be opened for writing.
    """

    def __init__(self, path: Path) -> None:
        regular_files.file_to_write(path)
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
