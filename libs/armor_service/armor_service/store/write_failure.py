"""What keeps a World's file from being written: since when, and what was told of it."""

from __future__ import annotations

import time
from collections.abc import Callable

TRIED_AFTER = 0.05
"""Seconds after which what could not be written is tried again."""
TOLD_AFTER = 5.0
"""Seconds for which another program may hold a file until somebody is told."""


class WriteFailure:
    """What keeps a file from being written; told of once, and when it is over.

    Args:
        tell: Told in one line.

    Attributes:
        text: What SQLite or the system said last; empty: the file can be written.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self.text = ''
        self._tell = tell
        self._since = self._tried = 0.0
        self._is_told = False

    def met(self, error: Exception) -> None:
        """Take note that a try failed."""
        self._tried = time.monotonic()
        if not self.text:
            self._since = self._tried
        self.text = str(error)

    def tell(self, what: str) -> None:
        """Say what follows from it, unless something was said before."""
        if not self._is_told:
            self._is_told = True
            self._tell(what)

    def over(self) -> None:
        """Take note that the file can be written again."""
        self.text = ''
        if self._is_told:
            self._is_told = False
            self._tell('can be written again, every change is kept')

    @property
    def may_be_tried(self) -> bool:
        """Whether it is time for the next try."""
        return time.monotonic() - self._tried >= TRIED_AFTER

    @property
    def is_to_be_told(self) -> bool:
        """Whether it lasts for long and nobody knows."""
        return not self._is_told and time.monotonic() - self._since >= TOLD_AFTER
