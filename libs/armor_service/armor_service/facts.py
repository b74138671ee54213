"""Facts in short form, as people write them: ``URGENT(R3)``, ``visitedAt(R3, "5"^^xsd:long)``.

The same form with ``?`` for any argument is a pattern: ``URGENT(?)``, ``canReach(Robot1, ?)``. A
name may stand as ``<iri>``; one that would be misread otherwise does: ``ROOM(<A,B>)``. A `FactSet`
is the facts that match one pattern, followed through the server's numbered change messages.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from owl_reasoner.owl.vocabulary import local_name

SAME_AS = 'owl:sameAs'
ANY = '?'
_FORM = re.compile(r'\s*(<[^<>]+>|[^\s(),"<>]+)\s*\((.*)\)\s*\Z', re.DOTALL)
_PART = re.compile(r'\s*("[^"\\]*+(?:\\.[^"\\]*+)*+"[^\s,]*|<[^<>]+>|[^\s,"]+)\s*', re.DOTALL)
_PLAIN = re.compile(r'[^\s(),"<>?]+')


@dataclass(frozen=True, slots=True)
class ShortFact:
    """A fact by local names, or a pattern of facts.

    Attributes:
        predicate: Local name of the class or property, or `SAME_AS`.
        arguments: Local names of individuals, a rendered literal, or `ANY` in a pattern.
    """

    predicate: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        return f'{_shown(self.predicate)}({", ".join(map(_shown, self.arguments))})'

    def matches(self, fact: ShortFact) -> bool:
        """Tell whether a fact fits this pattern."""
        return (
            self.predicate in (ANY, fact.predicate)
            and len(self.arguments) == len(fact.arguments)
            and all(
                wanted in (ANY, argument)
                for wanted, argument in zip(self.arguments, fact.arguments, strict=True)
            )
        )


def parse_fact(text: str) -> ShortFact:
    """Read ``predicate(argument)`` or ``predicate(argument, argument)``; ``?`` stands for any.

    Raises:
        ValueError: The text has another form.
    """
    written = parse_names(text)
    return ShortFact(short_name(written.predicate), tuple(map(short_name, written.arguments)))


def parse_names(text: str) -> ShortFact:
    """Read as `parse_fact` does, and leave the names as they are written, ``<iri>`` or not."""
    expected = f'{text[:80]!r}: expected CLASS(individual) or property(individual, value)'
    match = _FORM.match(text)
    if match is None:
        raise ValueError(expected)
    first = _PART.match(text, match.start(2), match.end(2))
    if first is None:
        raise ValueError(expected)
    if first.end() == match.end(2):
        return ShortFact(match[1], (first[1],))
    second = _PART.match(text, first.end() + 1, match.end(2))
    if text[first.end()] != ',' or second is None or second.end() != match.end(2):
        raise ValueError(expected)
    return ShortFact(match[1], (first[1], second[1]))


def short_name(name: str) -> str:
    """Return the local name of an entity that is written ``<iri>`` or as a full IRI; else as it
    is.
    """
    bracketed = name[0] == '<' and name[-1] == '>'
    if name[0] == '"' or not (bracketed or '://' in name):
        return name
    return local_name(name[1:-1] if bracketed else name)


def _shown(name: str) -> str:
    plain = name == ANY or name[:1] == '"' or _PLAIN.fullmatch(name)
    return name if plain else f'<{name}>'


FactChange = tuple[ShortFact, bool, bool]
"""A fact, whether it came (or went), whether it is derived (or asserted)."""


class FactSet:
    """Facts of one reference that match one pattern.

    A fact is asserted, or derived, or both; it holds until the last of the two is gone.

    Args:
        pattern: See `parse_fact`.

    Raises:
        ValueError: The pattern cannot be read.
    """

    def __init__(self, pattern: str) -> None:
        self.pattern = parse_fact(pattern)
        self._held: set[tuple[ShortFact, bool]] = set()
        self._sequence: int | None = None

    @property
    def facts(self) -> frozenset[ShortFact]:
        """The facts that match, as far as is known."""
        return frozenset(fact for fact, _ in self._held)

    def concerns(self, changes: Iterable[FactChange]) -> bool:
        """Tell whether any of the changes is one of the pattern's facts."""
        return any(self.pattern.matches(fact) for fact, _, _ in changes)

    def forget_sequence(self) -> None:
        """Have the next message count as one before which others were missed."""
        self._sequence = None

    def follow(
        self, sequence: int, changes: Sequence[FactChange]
    ) -> list[tuple[ShortFact, bool]] | None:
        """Take in one message.

        Args:
            sequence: The message's number.
            changes: What it says.

        Returns:
            The facts of the pattern that came (True) or went (False); None when messages were
            missed: then the server must be asked, and `replace` called.
        """
        known, self._sequence = self._sequence, sequence
        if known is None or sequence != known + 1:
            return None
        matching = [change for change in changes if self.pattern.matches(change[0])]
        before = {fact for fact, _, _ in matching if self._holds(fact)}
        for fact, came, derived in matching:
            (self._held.add if came else self._held.discard)((fact, derived))
        touched = dict.fromkeys(fact for fact, _, _ in matching)
        return [
            (fact, self._holds(fact)) for fact in touched if self._holds(fact) != (fact in before)
        ]

    def replace(
        self, facts: Iterable[ShortFact], asserted: Iterable[ShortFact]
    ) -> list[tuple[ShortFact, bool]]:
        """Take the facts as the server has them.

        Args:
            facts: All that match.
            asserted: Those of them that are asserted.

        Returns:
            What came (True) and went (False) by that.
        """
        before = self.facts
        every, told = set(facts), set(asserted)
        self._held = {(fact, False) for fact in told} | {(fact, True) for fact in every - told}
        gone, come = before - self.facts, self.facts - before
        return [(fact, False) for fact in sorted(gone, key=str)] + [
            (fact, True) for fact in sorted(come, key=str)
        ]

    def _holds(self, fact: ShortFact) -> bool:
        return (fact, False) in self._held or (fact, True) in self._held
