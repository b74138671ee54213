"""Rules that compare a moving value with many others, by a sorted index.

A rule such as

    now(?r, ?t), urgencyThreshold(?r, ?h), visitedAt(?l, ?v), subtract(?d, ?t, ?v), greaterThan(?d,
    ?h) -> URGENT(?l)

falls into two halves that share no variable, linked by one linear comparison: here v < t - h. The
half with the head's variables is kept sorted by its side of the comparison, its *key* (v); of the
other half only the greatest side, its *reach* (t - h), matters. Heads of keys below the reach hold.
When the reach moves, the keys between its old and its new place are all that is looked at.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

from surveillance_ontology.reasoner.clauses import (
    Clause,
    Constant,
    Fact,
    PredicateAtom,
    Premises,
    Term,
)
from surveillance_ontology.reasoner.joins import JoinContext, compile_call, compile_support
from surveillance_ontology.reasoner.rule_halves import Halves, Linear

Row = tuple[Any, ...]


class _Highest:
    """Above every row of arguments."""

    def __lt__(self, other: object) -> bool:
        return False

    def __gt__(self, other: object) -> bool:
        return True


_HIGHEST = _Highest()


class ThresholdIndex:
    """Runs one clause that `split_rule` took apart."""

    def __init__(
        self,
        clause: Clause,
        halves: Halves,
        context: JoinContext,
        push: Callable[[Fact], None],
        doom: Callable[[Fact], None],
    ) -> None:
        head = clause.head
        assert isinstance(head, PredicateAtom)
        self.clause, self._halves = clause, halves
        self._predicate, self._terms = head.predicate, head.terms
        self._push, self._doom = push, doom
        self._strict = halves.strict
        outputs = [term for term in head.terms if isinstance(term, int)]
        self._key_terms = tuple(dict.fromkeys([*outputs, *_variables(halves.key)]))
        self._reach_terms = _variables(halves.reach)
        self._key_of = _evaluator(halves.key, self._key_terms)
        self._reach_of = _evaluator(halves.reach, self._reach_terms)
        self._keys: list[tuple[Any, Row]] = []
        self._keyed: dict[Row, Any] = {}
        self._reaches: list[tuple[Any, Row]] = []
        self._reaching: dict[Row, Any] = {}
        self._odd_keys: set[Row] = set()
        self._odd_reaches: set[Row] = set()
        self._unsorted: list[tuple[Any, Row]] = []
        self._lost: set[tuple[bool, Row]] = set()
        self._emitted: Any = None
        for atom in halves.keyed:
            if isinstance(atom, PredicateAtom):
                predicate, body = atom.predicate, halves.keyed
                arguments = (context, body, atom, atom.terms, self._key_terms)
                predicate.on_insert.append(compile_call(*arguments, self._gain_key))
                predicate.on_delete.append(compile_call(*arguments, self._lose_key))
        for atom in halves.reaching:
            if isinstance(atom, PredicateAtom):
                predicate, body = atom.predicate, halves.reaching
                arguments = (context, body, atom, atom.terms, self._reach_terms)
                gain = compile_call(*arguments, self._gain_reach)
                predicate.on_insert.append(gain)
                predicate.early.append(gain)
                predicate.on_delete.append(compile_call(*arguments, self._lose_reach))
        self._key_support = compile_support(context, halves.keyed, head.terms, self._key_terms)
        self._key_exists = compile_support(context, halves.keyed, self._key_terms)
        self._reach_exists = compile_support(context, halves.reaching, self._reach_terms)
        self.proves: Callable[[Fact], bool] = lambda fact: True
        head.predicate.supports.append((self.supports, clause.origin))

    def clear(self) -> None:
        """Forgets every row."""
        for container in (self._keyed, self._reaching, self._odd_keys, self._odd_reaches):
            container.clear()
        self._keys.clear()
        self._reaches.clear()
        self._unsorted.clear()
        self._lost.clear()
        self._emitted = None

    # --- rows come ---

    def _gain_key(self, *row: Any) -> None:
        if row in self._keyed or row in self._odd_keys:
            return
        key = self._key_of(row)
        if key is None:
            self._odd_keys.add(row)
            for reaching in (*self._reaching, *self._odd_reaches):
                if self._satisfied(row, reaching):
                    self._emit(row)
            return
        self._keyed[row] = key
        self._unsorted.append((key, row))
        if self._emitted is not None and self._below(key, self._emitted):
            self._emit(row)
        for reaching in self._odd_reaches:
            if self._satisfied(row, reaching):
                self._emit(row)

    def _gain_reach(self, *row: Any) -> None:
        if row in self._reaching or row in self._odd_reaches:
            return
        reach = self._reach_of(row)
        if reach is None:
            self._odd_reaches.add(row)
            for keyed in (*self._keyed, *self._odd_keys):
                if self._satisfied(keyed, row):
                    self._emit(keyed)
            return
        self._reaching[row] = reach
        insort(self._reaches, (reach, row))
        for keyed in self._odd_keys:
            if self._satisfied(keyed, row):
                self._emit(keyed)

    def flush(self) -> None:
        """Emits what the greatest reach newly covers."""
        if not self._reaches:
            return
        reach = self._reaches[-1][0]
        if self._emitted is None or reach > self._emitted:
            self._sort()
            start = 0 if self._emitted is None else self._place(self._emitted)
            self._emitted = reach
            for _, row in self._keys[start : self._place(reach)]:
                self._emit(row)

    def _below(self, key: Any, reach: Any) -> bool:
        return bool(key < reach if self._strict else key <= reach)

    def _place(self, reach: Any) -> int:
        """How many keys are below a reach."""
        return bisect_left(self._keys, (reach,) if self._strict else (reach, _HIGHEST))

    def _sort(self) -> None:
        fresh = self._unsorted
        if fresh:
            if len(fresh) > 16:
                self._keys += fresh
                self._keys.sort()
            else:
                for entry in fresh:
                    insort(self._keys, entry)
            fresh.clear()

    def _head(self, row: Row) -> Fact:
        values = dict(zip(self._key_terms, row, strict=True))
        return (
            self._predicate,
            *(term.value if isinstance(term, Constant) else values[term] for term in self._terms),
        )

    def _emit(self, row: Row) -> None:
        fact = self._head(row)
        if not self._predicate.holds(fact):
            self._push(fact)

    # --- rows go ---

    def _lose_key(self, *row: Any) -> None:
        key = self._keyed.pop(row, None)
        if key is None:
            if row not in self._odd_keys:
                return
            self._odd_keys.discard(row)
        else:
            self._sort()
            place = bisect_left(self._keys, (key, row))
            del self._keys[place]
        self._lost.add((True, row))
        self._doom_head(row)

    def _lose_reach(self, *row: Any) -> None:
        reach = self._reaching.pop(row, None)
        if reach is None:
            if row in self._odd_reaches:
                self._odd_reaches.discard(row)
                self._lost.add((False, row))
                for keyed in (*self._keyed, *self._odd_keys):
                    self._doom_head(keyed)
            return
        del self._reaches[bisect_left(self._reaches, (reach, row))]
        self._lost.add((False, row))
        for keyed in self._odd_keys:
            self._doom_head(keyed)
        if self._emitted is None:
            return
        left = self._proven_reach()
        if left is None or left < self._emitted:
            self._sort()
            start = 0 if left is None else self._place(left)
            rows = self._keys[start : self._place(self._emitted)]
            self._emitted = left
            for _, keyed in rows:
                self._doom_head(keyed)

    def _proven_reach(self) -> Any:
        """The greatest remaining reach whose facts have a proof, and so stay whatever goes."""
        for reach, row in reversed(self._reaches):
            for premises in self._reach_exists(*row):
                if all(map(self.proves, premises)):
                    return reach
        return None

    def _doom_head(self, row: Row) -> None:
        fact = self._head(row)
        if self._predicate.holds(fact):
            self._doom(fact)

    def settle(self) -> None:
        """After facts went: rows that still have an instance come back."""
        for is_key, row in tuple(self._lost):
            exists = self._key_exists if is_key else self._reach_exists
            for _ in exists(*row):
                (self._gain_key if is_key else self._gain_reach)(*row)
                break
        self._lost.clear()

    # --- reasons ---

    def supports(self, *arguments: Any) -> Iterator[Premises]:
        """Premises of a head with the given arguments."""
        for row, premises in self._key_support(*arguments):
            key = self._key_of(row)
            regular = () if key is None else reversed(self._reaches)
            for reach, reaching in regular:
                if not self._below(key, reach):
                    break
                for others in self._reach_exists(*reaching):
                    yield premises + others
            rest = self._odd_reaches if key is not None else (*self._reaching, *self._odd_reaches)
            for reaching in rest:
                if self._satisfied(row, reaching):
                    for others in self._reach_exists(*reaching):
                        yield premises + others

    def _satisfied(self, key_row: Row, reach_row: Row) -> bool:
        """The comparison as the built-ins define it, for values that are not exact numbers."""
        values: dict[Term, Any] = dict(zip(self._key_terms, key_row, strict=True))
        values.update(zip(self._reach_terms, reach_row, strict=True))
        pending = list(self._halves.computed)

        def value(term: Term) -> Any:
            return term.value if isinstance(term, Constant) else values[term]

        while pending:
            for atom in tuple(pending):
                rest = atom.terms[1:]
                if not all(isinstance(term, Constant) or term in values for term in rest):
                    continue
                pending.remove(atom)
                first = atom.terms[0]
                if isinstance(first, Constant) or first in values:
                    if not atom.holds(*map(value, atom.terms)):
                        return False
                    continue
                assert atom.solve is not None
                results = tuple(atom.solve(*map(value, rest)))
                if not results:
                    return False
                values[first] = results[0]
        return True


def _variables(form: Linear) -> tuple[int, ...]:
    return tuple(sorted(term for term in form if isinstance(term, int)))


def _evaluator(form: Linear, terms: tuple[int, ...]) -> Callable[[Row], Any]:
    """The linear form's value for a row, exact; None where a value is not an exact number."""
    constant = form.get(None, Fraction(0))
    factors = [
        (terms.index(term), factor) for term, factor in form.items() if isinstance(term, int)
    ]
    whole = all(factor.denominator == 1 for _, factor in factors) and constant.denominator == 1
    scaled = [(place, int(factor) if whole else factor) for place, factor in factors]
    base = int(constant) if whole else constant

    def evaluate(row: Row) -> Any:
        total: Any = base
        for place, factor in scaled:
            value = row[place]
            if not isinstance(value, (int, Fraction)):
                return None
            total += factor * value
        return total

    return evaluate
