"""When a process that died is started again, and when somebody is called.

The pauses between restarts grow, so that a program which cannot run leaves the machine to the
others. How far they grow depends on how the process died. One that dies before it was ready will
most likely do so again, and its start is what costs most: up to `PAUSES[-1]`. One that worked was
ended from outside, or by something rare: others wait for it, so it is back after
`LONGEST_AFTER_WORK` at most. More than `MOST_HITS` such deaths, each soon after its start, are the
program's own, and the pauses grow as if it had not been ready.

Somebody is called when there are `TROUBLE_DEATHS` in a period, however the processes died: the
restart intensity of Erlang's supervisors. Nothing is given up: nobody may be near the robot.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

PAUSES = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 15.0, 30.0)
"""Seconds before the first, second, ... restart in a row; the last one is kept."""
LONGEST_AFTER_WORK = 2.0
"""Longest pause, in seconds, before the restart of a process that had been ready."""
MOST_HITS = 10
"""So many deaths in a row of a process that had been ready are taken for hits from outside."""
STEADY_AFTER = 20.0
"""A process that ran this long, in seconds, starts again from the first pause."""
TROUBLE_DEATHS, TROUBLE_PERIOD = 5, 600.0
"""So many deaths in so many seconds are said; again after a period without any. As many starts that
hang (`process_watch.SILENT_START`) fall into a period."""
REMIND_AFTER = 4 * 3600.0
"""It is said again after so many seconds while it goes on: the first call may have been missed."""


class Restarts:
    """The deaths of one program.

    Args:
        pauses: See `PAUSES`.
    """

    def __init__(self, pauses: Sequence[float] = PAUSES) -> None:
        self._pauses = tuple(pauses)
        self._in_row = self._failed_starts = 0
        self._deaths: deque[float] = deque()
        self._told_at: float | None = None

    def died(self, now: float, lived: float, *, worked: bool) -> float:
        """Note a death and return the pause before the restart, seconds.

        Args:
            now: Steady time, seconds.
            lived: How long the process ran, seconds.
            worked: Whether it had been ready.
        """
        self._in_row = 1 if lived >= STEADY_AFTER else self._in_row + 1
        self._failed_starts = 0 if worked else self._failed_starts + 1
        self._forget(now)
        self._deaths.append(now)
        if not worked:
            return self._pause(self._failed_starts)
        if self._in_row <= MOST_HITS:
            return min(self._pause(self._in_row), LONGEST_AFTER_WORK)
        return max(self._pause(self._in_row - MOST_HITS), LONGEST_AFTER_WORK)

    def trouble(self, now: float) -> str:
        """Return what somebody is to be told after a death, empty where that is nothing new."""
        self._forget(now)
        told = self._told_at is not None and now < self._told_at + REMIND_AFTER
        if told or len(self._deaths) < TROUBLE_DEATHS:
            return ''
        self._told_at = now
        return f'died {len(self._deaths)} times in {now - self._deaths[0]:.0f} s'

    def _pause(self, number: int) -> float:
        return self._pauses[min(number, len(self._pauses)) - 1]

    def _forget(self, now: float) -> None:
        while self._deaths and self._deaths[0] <= now - TROUBLE_PERIOD:
            self._deaths.popleft()
        if not self._deaths:
            self._told_at = None
