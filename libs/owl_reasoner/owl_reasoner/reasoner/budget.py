"""What one reasoning may use: time, steps and memory, and the wish to end it.

Every loop of the reasoner that can be long calls `Budget.tick`, which looks at the limits now and
then. The error that ends a reasoning names the axiom or rule that was at work.
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from itertools import cycle
from typing import NamedTuple, TypeAlias

Cancel: TypeAlias = 'threading.Event | Callable[[], bool]'

_TICKS = 32
"""Steps between two looks at the clock; one look costs as much as some ten steps."""
_MEMORY_EVERY = 0.02
"""Seconds between two looks at the memory, which take a file of the system to be read."""
_PROGRESS_EVERY = 0.1
"""Seconds between two reports of progress."""


class ReasoningBudgetError(Exception):
    """A reasoning used up what it may use, or was cancelled.

    Attributes:
        limit: 'seconds', 'steps', 'memory' or 'cancelled'.
        at_work: The axiom or rule whose consequences were being drawn, or a description of the
            work; '' where nothing is known.
    """

    def __init__(self, limit: str, message: str, at_work: str = '') -> None:
        super().__init__(message + (f' while it was at {at_work}' if at_work else ''))
        self.limit, self.at_work = limit, at_work


class Progress(NamedTuple):
    """How far a reasoning is.

    Attributes:
        stage: What is being done ('reading axioms', 'classifying', 'deriving facts', 'reasoning by
            cases').
        steps: How many steps were taken since the reasoning began.
        seconds: Since then.
    """

    stage: str
    steps: int
    seconds: float


class Budget:
    """The limits of the reasoning that runs, shared by all parts of one reasoner.

    Args:
        clock: A steady clock, in seconds.

    Attributes:
        stage: What is being done.
        at_work: Names the axiom or rule at work; asked only when a limit is passed.
        due: Tells with each call whether it is time for `count_due`; the two are `tick` for code
            in which a call of a Python function would be felt.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self.stage = ''
        self.at_work: Callable[[], str] = str
        self.due = cycle([False] * (_TICKS - 1) + [True]).__next__
        self._unlimited()

    def _unlimited(self) -> None:
        self._began = 0.0
        self._until = self._most_steps = self._most_memory = math.inf
        self._seconds = math.inf
        self._cancel: Callable[[], bool] | None = None
        self._progress: Callable[[Progress], None] | None = None
        self._steps = 0
        self._memory_at = self._progress_at = self._memory_before = 0.0
        self._looks = False

    def begin(
        self,
        timeout: float = math.inf,
        cancel: Cancel | None = None,
        progress: Callable[[Progress], None] | None = None,
        memory: float = math.inf,
        steps: float = math.inf,
    ) -> None:
        """Apply limits until `finish`.

        Args:
            timeout: Seconds.
            cancel: An event, or what tells whether to end.
            progress: Called about ten times a second.
            memory: Bytes by which the process may grow.
            steps: Units of work, of about a microsecond each.

        Raises:
            ReasoningBudgetError: A limit is passed already.
        """
        limited = timeout < math.inf or steps < math.inf or memory < math.inf
        if not limited and cancel is None and progress is None:
            return
        self._cancel = cancel.is_set if isinstance(cancel, threading.Event) else cancel
        now = self._clock()
        self._began, self._until, self._seconds = now, now + timeout, timeout
        self._most_steps, self._most_memory, self._progress = steps, memory, progress
        self._steps = 0
        self._memory_at, self._progress_at = now, now + _PROGRESS_EVERY
        self._memory_before = _resident() if memory < math.inf else 0.0
        self._looks = True
        try:
            self.look()
        except ReasoningBudgetError:
            self._unlimited()
            raise

    def finish(self) -> None:
        """Apply no limits any more."""
        if self._looks:
            self._unlimited()
        self.stage, self.at_work = '', str

    def now(self) -> float:
        """Return the time of the clock, in seconds."""
        return self._clock()

    def tick(self) -> None:
        """Count a step, and look at the limits now and then.

        Raises:
            ReasoningBudgetError: A limit is passed.
        """
        if self.due():
            self.count_due()

    def count(self, steps: int) -> None:
        """Count steps that were taken, and look at the limits.

        Raises:
            ReasoningBudgetError: A limit is passed.
        """
        if self._looks:
            self._steps += steps
            self.look()

    def count_due(self) -> None:
        """Count the steps since `due` was last true."""
        self.count(_TICKS)

    def look(self) -> None:
        """Look at the limits.

        Raises:
            ReasoningBudgetError: A limit is passed.
        """
        if not self._looks:
            return
        now = self._clock()
        if now > self._until:
            self.end('seconds', f'reasoning took more than {self._seconds:g} s')
        if self._steps > self._most_steps:
            self.end('steps', f'reasoning took more than {self._most_steps:g} steps')
        if self._cancel is not None and self._cancel():
            self.end('cancelled', 'reasoning was cancelled')
        if self._most_memory < math.inf and now >= self._memory_at:
            self._memory_at = now + _MEMORY_EVERY
            if _resident() - self._memory_before > self._most_memory:
                self.end('memory', f'reasoning took more than {self._most_memory:,.0f} bytes')
        if self._progress is not None and now >= self._progress_at:
            self._progress_at = now + _PROGRESS_EVERY
            self._progress(Progress(self.stage, self._steps, now - self._began))

    def end(self, limit: str, message: str) -> None:
        """End the reasoning.

        Raises:
            ReasoningBudgetError: Always.
        """
        raise ReasoningBudgetError(limit, message, self.at_work() or self.stage)


def _resident() -> float:
    """Return the bytes of memory that the process holds; 0 where the system does not tell."""
    with suppress(OSError, ValueError, IndexError), open('/proc/self/statm') as file:
        return float(file.read().split()[1]) * os.sysconf('SC_PAGE_SIZE')
    return 0.0
