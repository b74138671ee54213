"""Work that waits for one thread, bounded by its kind.

Sweeps come ten times a second, pictures every two seconds. In one queue with one bound a machine
that is too busy for the sweeps never looks at a picture: whenever a place is free, a sweep has
taken it. So each kind has its own bound, and beyond it the oldest of the least worth goes.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass

Work = Callable[[], object]


@dataclass(frozen=True, eq=False)
class _Waiting:
    work: Work | None
    kind: str
    worth: int


class WorkQueue:
    """Work in the order in which it came, for one thread.

    Args:
        most: How much of a kind may wait; of kinds that are not named, any number.
        dropped: Called with the kind of each work that is left out; must not block.
    """

    def __init__(
        self, most: Mapping[str, int], dropped: Callable[[str], object] = lambda _: None
    ) -> None:
        self._most = dict(most)
        self._dropped = dropped
        self._waiting: deque[_Waiting] = deque()
        self._come = threading.Condition()

    def put(self, work: Work, kind: str = '', worth: int = 0) -> None:
        """Add work; where too much of its kind waits, the oldest of the least worth is left out.

        Args:
            work: To be called by the thread.
            kind: What is bounded together.
            worth: Work of less worth is left out first.
        """
        with self._come:
            self._waiting.append(_Waiting(work, kind, worth))
            same = [each for each in self._waiting if each.kind == kind]
            is_full = len(same) > self._most.get(kind, len(same))
            if is_full:
                self._waiting.remove(min(same, key=lambda each: each.worth))
            self._come.notify()
        if is_full:
            self._dropped(kind)

    def put_once(self, work: Work, kind: str) -> None:
        """Add work that is done again and again, unless the last of it still waits."""
        with self._come:
            if all(each.kind != kind for each in self._waiting):
                self._waiting.append(_Waiting(work, kind, 0))
                self._come.notify()

    def end(self) -> None:
        """Have `take` return None once all before is done."""
        with self._come:
            self._waiting.append(_Waiting(None, '', 0))
            self._come.notify()

    def take(self) -> Work | None:
        """Wait for the next work, and return it; None: it is the end."""
        with self._come:
            self._come.wait_for(lambda: self._waiting)
            return self._waiting.popleft().work
