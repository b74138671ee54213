"""The page's connections: bounded in number, in the time of a request, and in how slowly one reads.

Anybody who reaches the port may open connections, send half a request, or never read what comes.
None of that may keep a person from the Stop: a connection without a whole request ends after a
while, a viewer that reads nothing is cut off, and where there are too many, the least useful one
makes room for a new one. Viewers that are cut off come back by themselves (`EventSource`).
"""

from __future__ import annotations

import asyncio
import resource
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from surveillance_runtime.alarms import CONNECTIONS_WELL

HEADER_TIME = 5.0
"""Seconds within which the head of a request has to be there."""
GRACE = 1.0
"""Seconds for which a connection without a whole request counts as one that is about to ask."""
BODY_SILENCE = 10.0
"""Seconds after which a body that does not go on is given up."""
UNREAD_TIME = 10.0
"""Seconds after which a viewer that takes nothing of what waits for it is cut off."""
SEND_BUFFER = 65_536
"""Bytes that the kernel keeps for a viewer: one that does not read is noticed after these."""
MOST = 512
"""Connections at one time, where the process may have twice as many files open."""


def most_connections() -> int:
    """Return how many connections there may be: half of the files that the process may open."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST if soft == resource.RLIM_INFINITY else max(8, min(MOST, soft // 2))


class BoundedConnection(H11Protocol):
    """One connection of the page."""

    most = MOST
    """How many there may be at a time."""
    crowded: Callable[[bool], object] = staticmethod(lambda _is: None)
    """Called with True when one makes room for another, with False when there are fewer again."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a new connection; another one goes where there are too many."""
        super().connection_made(transport)
        self._since = self.loop.time()
        self._deadline: asyncio.TimerHandle | None = None
        self._unread: asyncio.TimerHandle | None = None
        self._end_in(HEADER_TIME)
        if len(self.connections) > self.most:
            self._make_room()

    def data_received(self, data: bytes) -> None:
        """Take what came; a request that is whole may take its time to be answered."""
        super().data_received(data)
        if self.cycle is None:
            return
        if self.cycle.more_body:
            self._end_in(BODY_SILENCE)
        elif not self.cycle.response_complete:
            self._end_in(None)
        elif self._deadline is None:
            # The last request is answered: this is half the head of another.
            self._end_in(HEADER_TIME)

    @property
    def is_whole(self) -> bool:
        """Whether the last request has come as a whole."""
        return self.cycle is not None and not self.cycle.more_body

    def pause_writing(self) -> None:
        """Begin to wait for a viewer that reads more slowly than it is told."""
        super().pause_writing()
        if self._unread is None:
            self._unread = self.loop.call_later(UNREAD_TIME, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on with a viewer that has read."""
        super().resume_writing()
        if self._unread is not None:
            self._unread.cancel()
            self._unread = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._end_in(None)
        super().connection_lost(exc)
        if len(self.connections) < CONNECTIONS_WELL * self.most:
            self.crowded(False)
        if self._unread is not None:
            self._unread.cancel()

    def _end_in(self, seconds: float | None) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        wait = None if seconds is None else self.loop.call_later(seconds, self.transport.abort)
        self._deadline = wait

    @property
    def use(self) -> int:
        """How much somebody waits for this connection: the least useful one makes room."""
        if self.cycle is not None and self.cycle.response_complete:
            return 0  # it only stays open for a next request
        if not self.is_whole:
            return 1 if self.loop.time() - self._since > GRACE else 3
        return 2 if self.cycle.response_started else 4  # a viewer's stream, which it asks for again

    def _make_room(self) -> None:
        """End the least useful of the other connections, the oldest of those."""
        self.crowded(True)
        others: list[Any] = [each for each in self.connections if each is not self]
        min(others, key=lambda each: (each.use, each._since)).transport.abort()
