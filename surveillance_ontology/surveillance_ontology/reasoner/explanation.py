"""Why a fact holds: a tree of facts, each with what it follows from, that reads as English."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Explanation:
    """One fact and why it holds.

    Attributes:
        fact_text: The fact in words, 'R3 is URGENT'.
        kind: 'asserted', 'rule' (a SWRL rule) or 'axiom' (a class or property axiom).
        because: The rule or axiom in words, '' for an asserted fact.
        premises: What the fact follows from by that rule or axiom; empty for an asserted fact.
        reason: A calculation that replaces the listing of premises in the sentence, '' where none
            is needed.
    """

    fact_text: str
    kind: str
    because: str = ''
    premises: tuple[Explanation, ...] = ()
    reason: str = ''

    def tree(self) -> str:
        """The whole derivation, one fact a line, premises indented below what follows from them."""
        return '\n'.join(self._lines(0))

    def _lines(self, depth: int) -> Iterator[str]:
        note = 'asserted' if self.kind == 'asserted' else f'by {self.because}'
        detail = f' ({self.reason})' if self.reason else ''
        yield f'{"  " * depth}{self.fact_text}{detail}  [{note}]'
        for premise in self.premises:
            yield from premise._lines(depth + 1)

    def sentence(self) -> str:
        """The fact and its immediate reason in one sentence without a full stop."""
        if self.kind == 'asserted':
            return f'{self.fact_text} because it is asserted'
        if self.reason:
            return f'{self.fact_text} because {self.reason}'
        texts = list(dict.fromkeys(premise.fact_text for premise in self.premises))
        if not texts:
            return f'{self.fact_text} because {self.because}'
        listed = texts[0] if len(texts) == 1 else ', '.join(texts[:-1]) + ' and ' + texts[-1]
        return f'{self.fact_text} because {listed} ({self.because})'
