"""A node's logger for input of any kind: lines of bounded length, without control characters.

What arrives from the network ends up in log lines. A text with line breaks could write lines that
look like another node's, a megabyte would fill the disk. Lines have a rate, too: what a peer sends
a thousand times a second is said a few times, with a count of the rest. Warnings and errors have a
rate of their own, so that no flood of other lines hides them; what ends a node is always said, and
whoever asks for debug lines gets all of them.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy.impl.rcutils_logger as rcutils
from rclpy.logging import LoggingSeverity, get_logger_effective_level, set_logger_level

from strict_files.one_line import clean

LINES_PER_SECOND, LINES_AT_ONCE = 7.0, 40.0
"""Lines of a node for each second in the long run, and after a pause."""
WARNINGS_PER_SECOND, WARNINGS_AT_ONCE = 2.0, 20.0
"""The same for its warnings and errors: 600 lines of both kinds in any minute."""

# rclpy takes the first frame outside of these files for the caller: it names it in its log, and
# keeps its throttles.
rcutils._internal_callers.append(os.path.realpath(__file__))


def print_lines(text: str) -> None:
    """Print a text and its line end on standard output, in one write.

    `print` writes the two apart: a line that another thread prints gets between them.
    """
    sys.stdout.write(text + '\n')
    sys.stdout.flush()


@contextmanager
def log_level(severity: LoggingSeverity) -> Iterator[None]:
    """Give all loggers of this process another level for a while.

    The level is the process's, not a node's: whoever only sets it silences all that comes later.
    """
    before = get_logger_effective_level('')
    set_logger_level('', severity)
    try:
        yield
    finally:
        set_logger_level('', before)


class Allowance:
    """So many lines a second, and a burst after a pause.

    Args:
        rate: Lines a second in the long run.
        burst: Lines after a pause.
        now: Steady time, seconds.
    """

    def __init__(
        self, rate: float, burst: float, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._rate = rate
        self._now = now
        self._most = self._left = burst
        self._at = now()

    def take(self) -> bool:
        """Tell whether one more line may be written, and count it."""
        now = self._now()
        self._left = min(self._most, self._left + (now - self._at) * self._rate)
        self._at = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True


class CleanLogger(rcutils.RcutilsLogger):
    """A logger whose lines cannot be forged, grow without bound, or come without end.

    Attributes:
        lines: How much of what is no warning may be said; what a node prints past its logger is
            counted here, too.
    """

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._lock = threading.Lock()
        self.lines = Allowance(LINES_PER_SECOND, LINES_AT_ONCE)
        self._warnings = Allowance(WARNINGS_PER_SECOND, WARNINGS_AT_ONCE)
        self._left_out = 0

    def log(self, message: Any, severity: Any, **options: Any) -> bool:
        """Log a message, as rclpy does, if the node has lines left."""
        if not self.is_enabled_for(severity):
            return False
        with self._lock:
            allowance = self._warnings if severity >= LoggingSeverity.WARN else self.lines
            limited = LoggingSeverity.DEBUG < severity < LoggingSeverity.FATAL
            if limited and not allowance.take():
                self._left_out += 1
                return False
            left_out, self._left_out = self._left_out, 0
        text = clean(str(message))
        if left_out:
            text += f' ({left_out} lines left out before this one)'
        return bool(super().log(text, severity, **options))

    def always(self, message: str, severity: LoggingSeverity) -> None:
        """Log a line that must not be left out; whoever calls this bounds how often."""
        super().log(clean(message), severity)
