"""Files: read with a bound, and written where a file is or can be, never over something else.

A pipe or a device may have no end, and to replace one takes it away from everybody.
"""

from __future__ import annotations

import errno
import fcntl
import glob
import json
import os
import secrets
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

_KINDS = {
    stat.S_IFDIR: 'a folder',
    stat.S_IFIFO: 'a pipe',
    stat.S_IFCHR: 'a device',
    stat.S_IFBLK: 'a device',
    stat.S_IFSOCK: 'a socket',
}

_DRAFT = '.draft'
"""Ends the name of a file that is being written; nobody else's hidden file ends so."""


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
    except OSError as error:  # one that was only read has no name yet
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.close(descriptor)


def parse_json(text: str | bytes, **options: Any) -> Any:
    """Return what a text of JSON holds; `options` are those of `json.loads`.

    Raises:
        ValueError: It is none, or is nested too deep.
    """
    try:
        return json.loads(text, **options)
    except RecursionError:
        raise ValueError('damaged: nested too deep') from None


def file_to_write(path: str | Path) -> Path:
    """Return the file that a path stands for, where links lead; it may not be there yet.

    Raises:
        OSError: Something that is no file is there; the error has the path's name.
    """
    target = Path(os.path.realpath(path))
    if target.exists():
        _expect_file(target.stat(), path)
    return target


ABANDONED = 3600.0
"""Seconds after which a draft that nobody writes to is one of a process that was killed."""


def replace_file(path: str | Path, data: bytes, *, durable: bool = False) -> None:
    """Write a file so that whoever reads it finds all of the old content or all of the new one.

    Args:
        path: The file, or a link to it, which stays, with its rights, and its owner where who
            writes may give it one; its folder is there.
        data: What it is to hold.
        durable: On return it is on the disk, and outlives a failure of power.

    Raises:
        OSError: It cannot be written, or is none; the error has its name, and the old one is whole.
    """
    target = file_to_write(path)
    before = target.stat() if target.exists() else None
    if before is not None and not os.access(target, os.W_OK, effective_ids=True):
        # Its folder would let it be replaced all the same.
        raise OSError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    _remove_abandoned(target)
    draft = target.with_name(f'{_drafts(target)}{secrets.token_hex(4)}{_DRAFT}')
    try:
        # Not by tempfile: to give its file the usual rights, all threads' umask would change.
        handle = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        with open(handle, 'wb') as file:
            if before is not None:
                _take_rights(handle, before)
            file.write(data)
            file.flush()
            if durable:
                os.fsync(handle)
        os.replace(draft, target)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with suppress(OSError):
            draft.unlink()
    if durable:
        with suppress(OSError):
            sync_folder(target.parent)


def _take_rights(handle: int, before: os.stat_result) -> None:
    """Give a new file the owner, group and rights of the one that it replaces."""
    own = os.fstat(handle)
    # Each for itself: whoever may not give a file away may give it to a group.
    for user, group in ((before.st_uid, -1), (-1, before.st_gid)):
        if (user, group) not in ((own.st_uid, -1), (-1, own.st_gid)):
            with suppress(OSError):
                os.fchown(handle, user, group)
    with suppress(OSError):  # There are file systems without rights.
        os.fchmod(handle, stat.S_IMODE(before.st_mode))


@contextmanager
def alone_in(folder: str | Path) -> Iterator[None]:
    """Wait until nobody else works in a folder, and keep others out (flock; nothing is left there).

    It keeps out those who do the same.

    Raises:
        OSError: The folder cannot be opened.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _remove_abandoned(target: Path) -> None:
    """Remove drafts of a file whose writers were killed: each has a name of its own."""
    names = f'{glob.escape(_drafts(target))}{"[0-9a-f]" * 8}{_DRAFT}'
    for draft in target.parent.glob(names):
        with suppress(OSError):
            found = draft.lstat()
            if stat.S_ISREG(found.st_mode) and time.time() - found.st_mtime > ABANDONED:
                draft.unlink()


def _drafts(target: Path) -> str:
    """Return what the names of a file's drafts begin with; most file systems take 255 bytes."""
    return f'.{os.fsdecode(os.fsencode(target.name)[:200])}.'


def sync_folder(folder: Path) -> None:
    """Wait until the disk has what was made, renamed or removed in a folder.

    Raises:
        OSError: There is no such folder, or the disk fails.
    """
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _expect_file(found: os.stat_result, path: str | Path) -> None:
    kind = stat.S_IFMT(found.st_mode)
    if kind != stat.S_IFREG:
        raise OSError(errno.EINVAL, f'expected a file, got {_KINDS[kind]}', str(path))
