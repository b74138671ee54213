"""Work that waits for one thread, bounded by its kind, and what of the sensors' news was of no use.

Sweeps come ten times a second, pictures every two seconds. In one queue with one bound a machine
that is too busy for the sweeps never looks at a picture: whenever a place is free, a sweep has
taken it. So each kind has its own bound, and beyond it the oldest of the least worth goes, which is
counted. What is left out without a word looks like a place in which nothing happens.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

Work = Callable[[], object]


@dataclass(frozen=True, eq=False)
class _Waiting:
    work: Work | None
    kind: str
    worth: int


class Backlog:
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


# --- what was of no use ---

WINDOW = 60.0
"""Seconds over which it is counted."""
FEWEST = 5
"""So many of a source must have come, over half that time, before it is judged."""
MUCH = 0.5
"""What costs such a part of a source is worth a word; less than half of that ends it."""
SILENT, STEADILY = 20.0, 1.0
"""Seconds without any of a source that is there, after which that is told; and it is over when one
came within the last second: one that comes now and then does not begin and end it each time."""

NONE_CAME = 'none came'
DROPPED = 'dropped'
NO_POSE = 'no pose'
UNREAD = 'unread'
LATE = 'late'

WORDS: Mapping[tuple[str, str], str] = {
    ('pictures', NONE_CAME): f'came for {SILENT:g} s or longer, although there is a camera',
    ('pictures', DROPPED): 'were left out: this machine is too busy to look at them',
    ('pictures', NO_POSE): (
        'count for little: nobody told where the camera was when they were taken '
        '(amcl_pose, odom, joint_states)'
    ),
    ('pictures', UNREAD): 'were not looked at by the marker detector in time',
    ('pictures', LATE): 'were looked at long after they were taken',
    ('sweeps', DROPPED): 'were left out: this machine is too busy to compare them',
    ('sweeps', NO_POSE): 'were left out: nobody told where the robot was then (amcl_pose, odom)',
}
"""Why pictures and sweeps were of no use, or of little."""


class _Taken(NamedTuple):
    at: float
    causes: frozenset[str]


class LostSight:
    """Of how much of what the sensors sent nothing came, and why; safe from any thread.

    Args:
        now: Steady time, seconds.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._lock = threading.Lock()
        self._taken: dict[str, deque[_Taken]] = {}
        self._said: set[tuple[str, str]] = set()
        # Since when a source that is there has sent nothing.
        self._since: dict[str, float] = {}
        self.lost: Counter[tuple[str, str]] = Counter()

    def expect(self, source: str, is_there: bool) -> None:
        """Take whether anybody is there who sends something of a source."""
        with self._lock:
            if is_there:
                self._since.setdefault(source, self._now())
            else:
                self._since.pop(source, None)

    def come(self, source: str) -> None:
        """Take that something of a source came, of use or not."""
        with self._lock:
            if source in self._since:
                self._since[source] = self._now()

    def count(self, source: str, *causes: str) -> None:
        """Take that a picture or a sweep came, and what was wrong with it; nothing: it was used."""
        with self._lock:
            self._taken.setdefault(source, deque()).append(_Taken(self._now(), frozenset(causes)))
            self.lost.update((source, each) for each in causes)

    def findings(self) -> dict[tuple[str, str], str]:
        """Return what goes on, by source and cause, in a sentence each that stays the same."""
        found = {}
        with self._lock:
            now = self._now()
            for source, since in self._since.items():
                key = source, NONE_CAME
                if now - since >= (STEADILY if key in self._said else SILENT):
                    found[key] = f'no {source} {WORDS[key]}'
            for source, taken in self._taken.items():
                while taken and now - taken[0].at > WINDOW:
                    taken.popleft()
                if len(taken) < FEWEST or now - taken[0].at < WINDOW / 2:
                    continue
                for cause in sorted({each for one in taken for each in one.causes}):
                    key = source, cause
                    much = MUCH / 2 if key in self._said else MUCH
                    if sum(cause in one.causes for one in taken) >= much * len(taken):
                        found[key] = f'many {source} {WORDS[key]}'
            self._said = set(found)
        return found
