"""Files: read with a bound, and written where a file is or can be, never over something else.

A pipe or a device may have no end, and to replace one takes it away from everybody.
"""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

_KINDS = {
    stat.S_IFDIR: 'a folder',
    stat.S_IFIFO: 'a pipe',
    stat.S_IFCHR: 'a device',
    stat.S_IFBLK: 'a device',
    stat.S_IFSOCK: 'a socket',
}


def read_file(path: str | Path, most: int) -> bytes:
    """Return what a file holds.

    Raises:
        OSError: It cannot be read, is no regular file, or holds more than `most` bytes; the error
            has the file's name.
    """
    # Not blocking: a pipe would be waited for.
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    try:
        found = os.fstat(descriptor)
        _expect_file(found, path)
        if found.st_size > most:
            problem = f'{found.st_size} bytes, at most {most} are read'
            raise OSError(errno.EFBIG, problem, str(path))
        with open(descriptor, 'rb', closefd=False) as file:
            return file.read(most)  # files of /proc say that they are empty
    finally:
        os.close(descriptor)


def file_to_write(path: str | Path) -> Path:
    """Return the file that a path stands for, where links lead; it may not be there yet.

    Raises:
        OSError: Something that is no file is there; the error has the path's name.
    """
    target = Path(os.path.realpath(path))
    if target.exists():
        _expect_file(target.stat(), path)
    return target


def _expect_file(found: os.stat_result, path: str | Path) -> None:
    kind = stat.S_IFMT(found.st_mode)
    if kind != stat.S_IFREG:
        raise OSError(errno.EINVAL, f'expected a file, got {_KINDS[kind]}', str(path))
