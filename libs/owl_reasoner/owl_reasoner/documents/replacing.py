"""Files written so that whoever reads them finds all of the old content or all of the new one."""

from __future__ import annotations

import errno
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path


def replace_file(path: str | Path, data: bytes, *, durable: bool = False) -> None:
    """Write a file in one piece; a link stays a link, and the file keeps its rights.

    Args:
        path: The file, or a link to it.
        data: What it is to hold.
        durable: On return it is on the disk, and outlives a failure of power.

    Raises:
        OSError: It cannot be written, or is no regular file; the old one is whole.
    """
    target = Path(os.path.realpath(path))
    mode = target.stat().st_mode if target.exists() else None
    if mode is not None and not stat.S_ISREG(mode):
        # Replacing a pipe or a device would take it away from everybody.
        raise OSError(errno.EINVAL, 'expected a regular file', str(path))
    if mode is not None and not os.access(target, os.W_OK, effective_ids=True):
        raise OSError(errno.EACCES, os.strerror(errno.EACCES), str(path))
    draft = target.with_name(f'.{target.name[:100]}.{secrets.token_hex(4)}.draft')
    try:
        with open(draft, 'xb') as file:
            if mode is not None:
                with suppress(OSError):  # there are file systems without rights
                    os.fchmod(file.fileno(), stat.S_IMODE(mode))
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        os.replace(draft, target)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        with suppress(OSError):
            draft.unlink()
    if durable:
        with suppress(OSError):
            _sync_folder(target.parent)


def _sync_folder(folder: Path) -> None:
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
