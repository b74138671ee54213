"""Which process keeps others from writing an SQLite file, on Linux."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

WRITE_BYTE = 120
"""The byte of the shared-memory file that who writes in write-ahead mode has locked
(https://sqlite.org/walformat.html, "WAL locks")."""
_PENDING_BYTE = 0x40000000


def lock_holder(path: Path) -> str:
    """Return who has a file locked, as ``python3 (process 123)``; '' where it cannot be told."""
    places: dict[str, tuple[int, int]] = {}
    for name, first, last in (
        (f'{path}-shm', WRITE_BYTE, WRITE_BYTE),
        (str(path), _PENDING_BYTE, _PENDING_BYTE + 511),
    ):
        with suppress(OSError):
            found = os.stat(name)
            device = f'{os.major(found.st_dev):02x}:{os.minor(found.st_dev):02x}'
            places[f'{device}:{found.st_ino}'] = first, last
    with suppress(OSError, ValueError, IndexError):
        for line in Path('/proc/locks').read_text().splitlines():
            words = line.split()
            if '->' in words or 'WRITE' not in words:
                continue
            _, kind, _, _, process, file, begin, end = words[:8]
            first, last = places.get(file, (0, -1))
            upto = 2**63 if end == 'EOF' else int(end)
            if kind in ('POSIX', 'OFDLCK') and int(begin) <= last and upto >= first:
                if int(process) == os.getpid():
                    continue
                command = Path(f'/proc/{process}/comm').read_text().strip()
                return f'{command} (process {process})'
    return ''
