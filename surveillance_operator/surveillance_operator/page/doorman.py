"""Takes connections in, and leads those that ask for what cannot wait past all others.

A thousand viewers keep an event loop busy, and whoever comes then waits behind them. So a thread of
its own accepts, waits for the first bytes of a request, and hands the connection to one of two
loops by them. A connection that asks for nothing never reaches a loop.
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Callable

AT_ONCE = 32
"""Connections that are accepted before others are looked at again."""
LOOK_PERIOD = 0.5
"""Seconds between two looks for connections that have asked for nothing."""
FIRST_BYTES = 64
"""Bytes of a request by which it is judged."""


class Doorman:
    """A thread that accepts the connections of a listening socket.

    Args:
        listening: The socket; it is closed at the end.
        urgent: Tells by the first bytes of a request whether it cannot wait.
        hand: Given each connection that asks for something, and whether it is urgent.
        most: How many that ask for nothing are kept at a time.
        patience: How long each is kept, seconds.
        crowded: Called with True when one of these makes room for another.
    """

    def __init__(
        self,
        listening: socket.socket,
        urgent: Callable[[bytes], bool],
        hand: Callable[[socket.socket, bool], object],
        most: int,
        patience: float,
        crowded: Callable[[bool], object] = lambda _is: None,
    ) -> None:
        self._listening = listening
        self._urgent, self._hand, self._crowded = urgent, hand, crowded
        self._most, self._patience = most, patience
        self._waiting: dict[socket.socket, float] = {}
        self._selector = selectors.DefaultSelector()
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name='page door', daemon=True)

    def start(self) -> None:
        """Begin to accept; nothing where it was stopped before, or is meanwhile."""
        try:
            self._listening.listen(1024)
            self._listening.setblocking(False)
            self._selector.register(self._listening, selectors.EVENT_READ)
        except (OSError, ValueError):  # a closed socket is no file for a selector
            return
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._thread.start()

    def stop(self) -> None:
        """Accept no more, and end what has asked for nothing; from any thread."""
        with contextlib.suppress(OSError):
            self._wake.send(b'\0')
        if self._thread.is_alive():
            self._thread.join(3.0)
        self._listening.close()

    def _run(self) -> None:
        looked = time.monotonic()
        while True:
            for key, _ in self._selector.select(LOOK_PERIOD):
                if key.fileobj is self._woken:
                    for each in [*self._waiting]:
                        self._close(each)
                    return
                if key.fileobj is self._listening:
                    self._accept()
                elif key.fileobj in self._waiting:
                    assert isinstance(key.fileobj, socket.socket)
                    self._lead(key.fileobj)
            now = time.monotonic()
            if now >= looked + LOOK_PERIOD:
                looked = now
                for each, since in [*self._waiting.items()]:
                    if now >= since + self._patience:
                        self._close(each)

    def _accept(self) -> None:
        for _ in range(AT_ONCE):
            try:
                came, _ = self._listening.accept()
            except BlockingIOError:
                return
            except OSError:  # no descriptor is left, or the peer has gone
                if self._waiting:
                    self._make_room()
                else:
                    time.sleep(0.02)
                return
            came.setblocking(False)
            self._waiting[came] = time.monotonic()
            self._selector.register(came, selectors.EVENT_READ)
            if len(self._waiting) > self._most:
                self._make_room()

    def _make_room(self) -> None:
        self._close(next(iter(self._waiting)))
        self._crowded(True)

    def _lead(self, peer: socket.socket) -> None:
        try:
            begun = peer.recv(FIRST_BYTES, socket.MSG_PEEK)
        except BlockingIOError:
            return
        except OSError:
            begun = b''
        if not begun:
            self._close(peer)
            return
        self._forget(peer)
        self._hand(peer, self._urgent(begun))

    def _close(self, peer: socket.socket) -> None:
        self._forget(peer)
        peer.close()

    def _forget(self, peer: socket.socket) -> None:
        del self._waiting[peer]
        self._selector.unregister(peer)
