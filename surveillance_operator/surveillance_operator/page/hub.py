"""Passes snapshots on to any number of viewers, each as fast as it reads and no faster.

Of each part only the newest value is kept, as text that is made once for all viewers. A viewer that
comes gets everything; later what changed since it was served last. Nothing is queued.
"""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator

from surveillance_operator.frames import PARTS, Framer, Parts, lengthen
from surveillance_operator.snapshot import Snapshot

LEAST_PERIOD = 0.015
"""Seconds between two messages to one viewer."""
HEARTBEAT = 2.0
"""Seconds after which a viewer is told the time at least."""


class Hub:
    """The newest parts, for all viewers."""

    def __init__(self) -> None:
        self._framer = Framer()
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: set[asyncio.Event] = set()
        self._texts: dict[str, tuple[int, str]] = {}
        self._version = 0
        self._trail: list[list[float]] = []
        self._snapshot: Snapshot | None = None
        self._now = 0.0
        self.closed = False

    @property
    def viewers(self) -> int:
        """How many there are."""
        return len(self._waiting)

    def show(self, snapshot: Snapshot) -> None:
        """Take a new snapshot; from any thread."""
        with self._lock:
            self._snapshot, self._now = snapshot, snapshot.now
            if not self._waiting:
                return  # Nobody looks: what is new is computed when somebody does.
            self._accept(self._framer.patch(snapshot))
        self._rouse()

    def show_parts(self, parts: Parts, now: float | None, *, whole: bool) -> None:
        """Take parts that are known already, as a replay does; from any thread.

        Args:
            parts: What changed, or everything.
            now: The mission's time; None for no other than before.
            whole: Whether it is everything: what is not in it is not known.
        """
        with self._lock:
            self._now = self._now if now is None else now
            self._accept({**dict.fromkeys(PARTS), 'trail': [], **parts} if whole else parts)
        self._rouse()

    def close(self) -> None:
        """End all streams; from any thread."""
        self.closed = True
        self._rouse()

    async def stream(self) -> AsyncIterator[str]:
        """Yield what a new viewer is to see, as server-sent events."""
        self._loop = asyncio.get_running_loop()
        changed = asyncio.Event()
        with self._lock:
            self._waiting.add(changed)
            if self._snapshot is not None:
                patch = self._framer.patch(self._snapshot)
                self._accept({**patch, 'trail': self._framer.whole()['trail']})
        try:
            seen = -1
            yield 'retry: 1000\n\n'
            while not self.closed:
                changed.clear()
                with self._lock:
                    first = seen < 0
                    parts = {name: text for name, (at, text) in self._texts.items() if at > seen}
                    seen, now = self._version, self._now
                    if first:
                        parts['trail'] = json.dumps(self._trail)
                body = ','.join(f'"{name}":{text}' for name, text in parts.items())
                yield f'data: {{"now":{now:.2f},"whole":{int(first)},"p":{{{body}}}}}\n\n'
                await asyncio.sleep(LEAST_PERIOD)
                try:
                    await asyncio.wait_for(changed.wait(), HEARTBEAT)
                except TimeoutError:
                    continue
        finally:
            with self._lock:
                self._waiting.discard(changed)

    def _accept(self, parts: Parts) -> None:
        # Viewers lengthen the trail themselves, unless they are given one.
        if 'trail' in parts:
            self._trail = list(parts['trail'])
        elif parts.get('pose'):
            lengthen(self._trail, parts['pose'])
        if parts:
            self._version += 1
            for name, value in parts.items():
                text = json.dumps(value, separators=(',', ':'), allow_nan=False)
                self._texts[name] = self._version, text

    def _rouse(self) -> None:
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        with self._lock:
            waiting = list(self._waiting)
        for each in waiting:
            loop.call_soon_threadsafe(each.set)
