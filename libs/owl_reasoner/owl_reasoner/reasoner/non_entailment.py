"""Why a fact does not hold: what the rule or definition that is nearest to it still lacks.

Every clause and lower bound that could derive the fact is matched with the facts that hold, atom by
atom; an atom may be left out at the cost of one. The cheapest match shows what is missing. Unnamed
classes in between give way to what would make somebody a member.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from typing import Any

from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import Axiom, Rule
from owl_reasoner.owl.vocabulary import local_name
from owl_reasoner.reasoner.clauses import (
    AtLeast,
    BodyAtom,
    Clause,
    ComputedAtom,
    Constant,
    DifferentAtom,
    Fact,
    Predicate,
    PredicateAtom,
    RangeAtom,
    SameAtom,
    Term,
)
from owl_reasoner.reasoner.engine import Engine
from owl_reasoner.reasoner.explanation import Reasons
from owl_reasoner.reasoner.proofs import Proof

_MOST_MATCHES = 2_000
"""Partial matches that are looked at for one clause."""
_DEEPEST = 4
_UNKNOWN: Any = None
"""The argument of a missing fact that may be anybody."""


@dataclass(frozen=True)
class Absence:
    """Why a fact does not hold.

    Attributes:
        fact_text: The fact in words, 'R3 is URGENT'.
        because: The nearest rule or axiom, '' where none could derive the fact.
        missing: What it lacks, in words.
        facts: The missing facts that name whom they are about; with all of `missing` among them,
            the fact would hold if they did.
    """

    fact_text: str
    because: str
    missing: tuple[str, ...]
    facts: tuple[Axiom, ...] = ()

    def sentence(self) -> str:
        """Return what is missing in one sentence without a full stop."""
        if not self.because:
            return f'{self.fact_text} does not follow: no rule or axiom could derive it'
        listed = ' and '.join(self.missing)
        return f'{self.fact_text} would follow from {self.because}, which lacks: {listed}'


@dataclass(frozen=True)
class _Shortfall:
    """A match of one clause: what is missing, and which facts were matched."""

    origin: Axiom | None
    missing: tuple[str, ...]
    facts: tuple[Axiom, ...] = ()


class Absences:
    """Answers for one engine."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._reasons = Reasons(engine, lambda *_: ())

    def of_fact(self, axiom: Axiom) -> Absence | None:
        """Return what an assertion lacks; None where it is not about one class or property."""
        fact = self._engine.reader.fact_of(axiom)
        if fact is None:
            return None
        gap = self._nearest(fact, ())
        text = self._reasons.text(fact)
        if gap is None:
            return Absence(text, '', ())
        if isinstance(gap.origin, Rule) and gap.origin.label:
            because = f'the rule {gap.origin.label}'
        else:
            because = axiom_text(gap.origin) if gap.origin else 'the axioms about its classes'
        return Absence(text, because, gap.missing, gap.facts)

    def _nearest(self, fact: Fact, asked: tuple[Fact, ...]) -> _Shortfall | None:
        """Return the smallest gap of all clauses and bounds that could derive a fact.

        Args:
            fact: What does not hold.
            asked: For the sake of which facts; none of them helps.
        """
        asked = (*asked, fact)
        program = self._engine.program
        gaps = [
            gap
            for clause in program.clauses
            if isinstance(clause.head, PredicateAtom) and clause.head.predicate is fact[0]
            for gap in self._of_clause(clause, clause.head, asked)
        ]
        gaps += [
            self._of_bound(least, fact[1]) for least in program.at_least if least.head is fact[0]
        ]
        return min(gaps, key=lambda gap: len(gap.missing), default=None)

    def _of_bound(self, least: AtLeast, x: str) -> _Shortfall:
        """Return what a lower bound lacks."""
        related = (least.prop.pred if least.inverse else least.prop.succ).get(x, ())
        name = local_name(least.prop.name)
        found = f'{len(related)} {"is" if len(related) == 1 else "are"} known'
        what = ''
        if isinstance(least.filler, Predicate):
            what = f' in {local_name(least.filler.name)}'
        text = f'{local_name(x)} {name} at least {least.n} different ones{what} ({found})'
        return _Shortfall(least.origin, (text,))

    # --- clauses ---

    def _of_clause(
        self, clause: Clause, head: PredicateAtom, asked: tuple[Fact, ...]
    ) -> Iterator[_Shortfall]:
        """Yield the cheapest match of a clause's body, where its head can be the last fact."""
        fact = asked[-1]
        bound: dict[Term, Any] = {}
        for term, value in zip(head.terms, fact[1:], strict=True):
            if self._value(term, bound) not in (_UNKNOWN, value):
                return
            bound[term] = value
        numbers = count()
        pending: list[Any] = [(0, -0, next(numbers), bound, clause.body, (), ())]
        for _ in range(_MOST_MATCHES):
            if not pending:
                return
            _, _, _, bound, rest, missing, held = heapq.heappop(pending)
            if not rest:
                gap = self._gap(clause, bound, missing, Proof(fact, None, held), asked)
                if gap is not None:
                    yield gap
                    return
                continue
            atom = min(rest, key=lambda one: self._open_terms(one, bound))
            others = tuple(one for one in rest if one is not atom)
            for found, fits, fact_held in self._matches(atom, bound):
                lacking = missing if fits else (*missing, atom)
                known = (*held, Proof(fact_held)) if fact_held else held
                entry = (len(lacking), -len(known), next(numbers), found, others, lacking, known)
                heapq.heappush(pending, entry)

    def _open_terms(self, atom: BodyAtom, bound: dict[Term, Any]) -> tuple[bool, int]:
        """Return how late an atom is matched: facts first, and of those what is bound most."""
        open_terms = [t for t in atom.terms if self._value(t, bound) is _UNKNOWN]
        return not isinstance(atom, PredicateAtom), len(open_terms)

    def _value(self, term: Term, bound: dict[Term, Any]) -> Any:
        if isinstance(term, Constant):
            value: Any = term.value
            return value if term.is_value else self._engine.equality.find(value)
        return bound.get(term, _UNKNOWN)

    def _matches(
        self, atom: BodyAtom, bound: dict[Term, Any]
    ) -> Iterator[tuple[dict[Term, Any], bool, Fact | None]]:
        """Yield (terms bound, whether the atom holds, the fact that it matched)."""
        values = [self._value(term, bound) for term in atom.terms]
        if isinstance(atom, PredicateAtom):
            held = False
            for fact in self._facts(atom.predicate, values):
                held = True
                yield bound | dict(zip(atom.terms, fact[1:], strict=True)), True, fact
            if not held or _UNKNOWN in values:
                yield bound, False, None
        elif isinstance(atom, ComputedAtom):
            yield from self._computed(atom, values, bound)
        elif _UNKNOWN in values:
            yield bound, True, None  # It is about somebody who is missing already.
        elif isinstance(atom, DifferentAtom):
            yield bound, self._engine.inequality.different(*values), None
        elif isinstance(atom, SameAtom):
            yield bound, values[0] == values[1], None
        else:
            yield bound, atom.values.contains(values[0]), None

    def _computed(
        self, atom: ComputedAtom, values: list[Any], bound: dict[Term, Any]
    ) -> Iterator[tuple[dict[Term, Any], bool, Fact | None]]:
        if _UNKNOWN not in values:
            yield bound, atom.holds(*values), None
        elif values[0] is _UNKNOWN and _UNKNOWN not in values[1:] and atom.solve is not None:
            for result in atom.solve(*values[1:]):
                yield bound | {atom.terms[0]: result}, True, None
        else:
            yield bound, True, None

    def _facts(self, predicate: Predicate, values: list[Any]) -> Iterable[Fact]:
        if len(values) == 1:
            members = predicate.members
            if values[0] is _UNKNOWN:
                return [(predicate, x) for x in members]
            return [(predicate, values[0])] if values[0] in members else []
        x, y = values
        if x is not _UNKNOWN:
            found = predicate.succ.get(x, ())
            return [(predicate, x, z) for z in found if y is _UNKNOWN or z == y]
        if y is not _UNKNOWN:
            return [(predicate, z, y) for z in predicate.pred.get(y, ())]
        return predicate.facts()

    # --- words ---

    def _gap(
        self,
        clause: Clause,
        bound: dict[Term, Any],
        missing: tuple[BodyAtom, ...],
        match: Proof,
        asked: tuple[Fact, ...],
    ) -> _Shortfall | None:
        """Return the gap of a match; None where a fact is missing that was asked for."""
        texts: list[str] = []
        facts: list[Axiom] = []
        for atom in missing:
            if not isinstance(atom, PredicateAtom):
                texts.append(self._condition(atom, clause, bound, match))
                continue
            values = [self._value(term, bound) for term in atom.terms]
            fact = (atom.predicate, *values)
            if fact in asked:
                return None
            named = isinstance(atom.predicate.expression, str)
            if not named and len(asked) < _DEEPEST and _UNKNOWN not in values:
                deeper = self._nearest(fact, asked)
                if deeper is not None:
                    texts += deeper.missing
                    facts += deeper.facts
                    continue
            texts.append(self._text(atom.predicate, values))
            stated = None if _UNKNOWN in values else self._reasons.stated(fact)
            facts += [] if stated is None else [stated]
        return _Shortfall(clause.origin, tuple(dict.fromkeys(texts)), tuple(facts))

    def _text(self, predicate: Predicate, values: list[Any]) -> str:
        if _UNKNOWN not in values:
            return self._reasons.text((predicate, *values))
        some = 'some value' if predicate.kind == 'data' else 'somebody'
        subject = 'somebody' if values[0] is _UNKNOWN else local_name(values[0])
        if predicate.kind == 'class':
            return f'{subject} is {local_name(predicate.name)}'
        target = values[1]
        if target is not _UNKNOWN:
            return self._reasons.text((predicate, 'somebody', target))
        return f'{subject} {local_name(predicate.name)} {some}'

    def _condition(
        self, atom: BodyAtom, clause: Clause, bound: dict[Term, Any], match: Proof
    ) -> str:
        values = [self._value(term, bound) for term in atom.terms]
        if isinstance(atom, ComputedAtom) and isinstance(clause.origin, Rule):
            shown = self._reasons.calculation(clause.origin, match)
            return shown or atom.builtin
        if isinstance(atom, DifferentAtom | SameAtom):
            word = 'different from' if isinstance(atom, DifferentAtom) else 'the same as'
            return f'{local_name(values[0])} is {word} {local_name(values[1])}'
        assert isinstance(atom, RangeAtom)
        return f'{values[0]} is in the data range'
