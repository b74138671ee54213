"""Which of several publishers of a state topic a reader believes.

Each publisher numbers its messages, and its middleware tells the number with each one. Messages
whose numbers go on from the last one that was believed are of the same publisher. Any other message
is of somebody else, or of an owner that was started again, and waits: as long as the publisher that
is believed speaks, what waits is dropped; when that stays silent, what waits is believed.
"""

from __future__ import annotations

from collections.abc import Callable

REACH = 50
"""A number that is larger by more than this goes not on from the last one."""
SILENT = 1.5
"""An owner that repeats its state each second and says nothing for this long is gone, seconds."""
PATIENCE = 0.3
"""How long another publisher's message waits for the word of an owner that was silent, seconds:
one that repeats nothing still answers."""
LONGEST = 2.0
"""How long it waits at most, seconds."""
UNKNOWN = 2**64 - 1
"""The number that a middleware gives which numbers nothing."""


class Belief:
    """The state that a reader believes, as bytes.

    Attributes:
        value: What is believed; None: nothing came yet.
        due: When `settle` is to be called, seconds; None: nothing waits.
    """

    def __init__(self) -> None:
        self.value: bytes | None = None
        self.due: float | None = None
        self._number = 0
        self._heard = 0.0
        self._held: tuple[bytes, int] = b'', 0

    def hear(self, value: bytes, number: int, now: float, alone: Callable[[], bool]) -> bool:
        """Take a message; return whether it is believed at once.

        Args:
            value: The message.
            number: The number that its publisher gave it.
            now: Steady time, seconds.
            alone: Whether there is one publisher only; asked where the number alone does not tell.
        """
        first = self.value is None
        follows = self._number < number <= self._number + REACH
        if first or follows or ((number > self._number or number == UNKNOWN) and alone()):
            self._believe(value, number, now)
            return True
        if self.due is None:
            gone = now - self._heard > SILENT
            self.due = now + (PATIENCE if gone else LONGEST)
        self._held = value, number
        return False

    def settle(self, now: float) -> bool:
        """Believe what has waited long enough; return whether there was such a message."""
        if self.due is None or now < self.due:
            return False
        self._believe(*self._held, now)
        return True

    def _believe(self, value: bytes, number: int, now: float) -> None:
        self.value, self._number, self._heard = value, number, now
        self.due = None
