"""What of the sensors' news was of no use, and why.

What is left out without a word looks like a place in which nothing happens.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from typing import NamedTuple

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
