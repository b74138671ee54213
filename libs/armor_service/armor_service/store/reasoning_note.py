"""A file that says over what the process reasons, so that the next one knows what ended it."""

from __future__ import annotations

import json
import os
import threading
from contextlib import suppress
from pathlib import Path

from armor_service.quarantine import WHOLE
from armor_service.store.records import TO_JSON


class ReasoningNote:
    """A file that says over what the process reasons, so that the next one knows what ended it.

    It is not synced: it outlives the process, not the machine.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._running: dict[str, list[int]] = {}
        self._left: dict[str, list[int]] = {}
        with suppress(OSError, ValueError):
            found = json.loads(path.read_bytes())
            self._left = {str(name): [int(n) for n in value] for name, value in found.items()}
        self._file = path.open('wb', buffering=0)
        self._write()

    def left(self, name: str) -> tuple[int, int]:
        """Return how often processes ended while they reasoned over a reference, and where."""
        deaths, place = self._left.get(name, (0, WHOLE))
        return deaths, place

    def note(self, name: str, place: int | None) -> None:
        """Note over what is reasoned; None: no more."""
        with self._lock:
            deaths = self._left.get(name, (0,))[0]
            if place is None:
                self._running.pop(name, None)
            else:
                self._running[name] = [deaths + 1, place]
            self._write()

    def completed(self, name: str) -> None:
        """Forget the ends of before."""
        self._left.pop(name, None)

    def close(self) -> None:
        """Leave an empty file."""
        with self._lock:
            self._running, self._left = {}, {}
            self._write()
            self._file.close()

    def _write(self) -> None:
        # Those that were not opened yet are to be known to the next process as well.
        text = TO_JSON.encode({**self._left, **self._running}).encode()
        with suppress(OSError, ValueError):
            # Full, or closed while one still reasons.
            os.pwrite(self._file.fileno(), text, 0)
            os.ftruncate(self._file.fileno(), len(text))
