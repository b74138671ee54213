"""ROS domains for whoever must not meet other nodes on this machine: tests and benchmarks.

Nodes of one domain hear each other. A claim is a locked file in the system's temporary folder, so
it ends with the process however that ends.
"""

from __future__ import annotations

import fcntl
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
    folder = Path(tempfile.gettempdir()) / 'surveillance-domains'
    folder.mkdir(mode=0o777, exist_ok=True)
    for domain in range(1, LAST_DOMAIN + 1):
        lock = (folder / str(domain)).open('w')
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            continue
        _held.append(lock)
        return domain
    raise RuntimeError(f'all ROS domains from 1 to {LAST_DOMAIN} are claimed')
