"""ROS domains for whoever must not meet other nodes on this machine: tests and benchmarks.

Nodes of one domain hear each other. A claim is a locked file in the system's temporary folder, so
it ends with the process however that ends.
"""

from __future__ import annotations

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO

LAST_DOMAIN = 101
"""The highest ROS domain whose ports lie below those that Linux gives to clients."""

_held: list[IO[str]] = []


def claim_domain() -> int:
    """Take a ROS domain, from 1 to `LAST_DOMAIN`, that no other process has claimed.

    Raises:
        RuntimeError: All are claimed.
    """
    folder = Path(tempfile.gettempdir(), f'surveillance-domains-{os.getuid()}')
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.is_symlink() or folder.stat().st_uid != os.getuid():
        raise RuntimeError(f'{folder}: belongs to somebody else')
    for domain in range(1, LAST_DOMAIN + 1):
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW
        lock = open(os.open(folder / str(domain), flags, 0o600), 'w')  # noqa: SIM115 - held
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        _held.append(lock)
        return domain
    raise RuntimeError(f'all ROS domains from 1 to {LAST_DOMAIN} are claimed')
