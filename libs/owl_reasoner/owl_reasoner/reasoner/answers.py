"""Answers that need not be yes or no."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Unknown:
    """Neither yes nor no: something was left out that the answer may depend on.

    It has no truth value, so that nobody takes it for no: compare with `is True` or `is False`.

    Attributes:
        because: One sentence for each axiom, or kind of reasoning, that was left out.
    """

    because: tuple[str, ...]

    def __bool__(self) -> bool:
        raise TypeError(f'the answer is unknown: {self}')

    def __str__(self) -> str:
        return '; '.join(self.because)
