"""Whether the last pictures agree: one alone is no reason to say anything."""

from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

AGREED_PICTURES = 3
"""A dark or covered view, and an unknown marker, must be seen in so many pictures in a row."""
AGREED_SECONDS = 4.0
"""Or in two of one visit that are as far apart as so many usually are, seconds: a busy machine
looks at few of them."""

_Value = TypeVar('_Value')


class Agreement(Generic[_Value]):
    """What the last pictures say, and whether they agree on it."""

    def __init__(self) -> None:
        self._last: deque[tuple[_Value, int, float]] = deque(maxlen=AGREED_PICTURES)

    def take(self, value: _Value, visit: int, stamp: float) -> bool:
        """Take what a picture of a visit says; tell whether that is settled."""
        self._last.append((value, visit, stamp))
        if len(self._last) == AGREED_PICTURES and all(each[0] == value for each in self._last):
            return True
        return any(
            before == value and earlier == visit and stamp - taken >= AGREED_SECONDS
            for before, earlier, taken in list(self._last)[-2:-1]
        )
