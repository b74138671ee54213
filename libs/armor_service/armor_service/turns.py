"""Whose turn it is: of several clients, and of work on several ontologies."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

Item = TypeVar('Item')
Work = Callable[[], object]


class Backlog(Generic[Item]):
    """What waits, taken in turn from each client that has some."""

    def __init__(self) -> None:
        self._clients: dict[str, deque[Item]] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def put(self, client: str, item: Item) -> None:
        """Add what a client wants."""
        self._clients.setdefault(client, deque()).append(item)
        self._count += 1

    def take(self) -> Item:
        """Take the oldest item of the client whose turn it is."""
        name = next(iter(self._clients))
        waiting = self._clients.pop(name)
        taken = waiting.popleft()
        if waiting:
            self._clients[name] = waiting
        self._count -= 1
        return taken


class Turns:
    """Work on ontologies that may take long: of each only so much at a time.

    An ontology that is used for long keeps some of the threads waiting for it, the others go on.

    Args:
        start: Has something done on another thread, in the order of the calls.
        each: How many pieces of work on one ontology are done at a time.
    """

    def __init__(self, start: Callable[[Work], None], each: int = 1) -> None:
        self._start = start
        self._each = each
        self._lock = threading.Lock()
        self._waiting: dict[str, Backlog[Work]] = {}
        self._running: Counter[str] = Counter()

    def waiting(self, name: str) -> int:
        """Return how many pieces of work wait for an ontology."""
        with self._lock:
            return len(self._waiting.get(name, ()))

    def put(self, name: str, client: str, work: Work) -> None:
        """Have work done on an ontology, in turn from each client; it must not raise."""
        with self._lock:
            self._waiting.setdefault(name, Backlog()).put(client, work)
            more = self._running[name] < self._each
            self._running[name] += more
        if more:
            self._start(partial(self._next, name))

    def _next(self, name: str) -> None:
        waiting = self._waiting[name]
        with self._lock:
            work = waiting.take() if waiting else None
        if work is not None:
            work()
        with self._lock:
            if not waiting:
                self._running[name] -= 1
                if not self._running[name]:
                    del self._waiting[name], self._running[name]
                return
        # Behind what waits for other ontologies.
        self._start(partial(self._next, name))
