"""Rules that compare a moving value with many others, by a sorted index.

A rule such as

    now(?r, ?t), urgencyThreshold(?r, ?h), visitedAt(?l, ?v), subtract(?d, ?t, ?v), greaterThan(?d,
    ?h) -> URGENT(?l)

is split into two parts that share no variable, linked by one linear comparison: here v < t - h. The
part with the head's variables is kept sorted by its side of the comparison, its *key* (v); of the
other part only the greatest side, its *reach* (t - h), matters. Heads of keys below the reach hold.
When the reach moves, the keys between its old and its new place are all that is looked at.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from owl_reasoner.reasoner.clauses import (
    BodyAtom,
    Clause,
    ComputedAtom,
    Constant,
    Fact,
    PredicateAtom,
    Premises,
    Term,
)
from owl_reasoner.reasoner.joins import JoinContext, compile_call, compile_support

_COMPARISONS = {
    'greaterThan': (1, True),
    'greaterThanOrEqual': (1, False),
    'lessThan': (-1, True),
    'lessThanOrEqual': (-1, False),
}
Linear = dict[Term | None, Fraction]


@dataclass(frozen=True)
class ComparisonSplit:
    """A clause taken apart: its head holds where key < reach (or <=, when not `strict`)."""

    keyed: tuple[BodyAtom, ...]
    reaching: tuple[BodyAtom, ...]
    key: Linear
    reach: Linear
    strict: bool
    computed: tuple[ComputedAtom, ...]


def _linear(term: Term, forms: dict[Term, Linear]) -> Linear:
    if isinstance(term, Constant):
        value = term.value
        if isinstance(value, (int, Fraction)):
            return {None: Fraction(value)}
        raise ValueError
    return forms.get(term, {term: Fraction(1)})


def _sum(parts: list[tuple[int, Linear]]) -> Linear:
    total: Linear = {}
    for sign, part in parts:
        for term, factor in part.items():
            total[term] = total.get(term, Fraction(0)) + sign * factor
    return {term: factor for term, factor in total.items() if factor}


def split_rule(clause: Clause) -> ComparisonSplit | None:
    """Take a clause apart; None where it is not of this kind."""
    head = clause.head
    computed = tuple(atom for atom in clause.body if isinstance(atom, ComputedAtom))
    facts = tuple(atom for atom in clause.body if not isinstance(atom, ComputedAtom))
    comparisons = [atom for atom in computed if atom.builtin in _COMPARISONS]
    if len(comparisons) != 1 or not isinstance(head, PredicateAtom):
        return None
    bound = {
        term
        for atom in facts
        if isinstance(atom, PredicateAtom)
        for term in atom.terms
        if isinstance(term, int)
    }
    forms: dict[Term, Linear] = {}
    try:
        pending = [atom for atom in computed if atom is not comparisons[0]]
        for _ in range(len(pending) + 1):
            for atom in tuple(pending):
                if all(isinstance(t, Constant) or t in bound or t in forms for t in atom.terms[1:]):
                    form = _form(atom, forms)
                    if form is None or atom.terms[0] in bound or atom.terms[0] in forms:
                        return None
                    forms[atom.terms[0]] = form
                    pending.remove(atom)
        if pending:
            return None
        comparison = comparisons[0]
        sign, strict = _COMPARISONS[comparison.builtin]
        left, right = (_linear(term, forms) for term in comparison.terms)
    except ValueError:
        return None
    # Exact fractions, as the built-ins compare: floats would put keys at the limit on the wrong
    # side.
    difference = _sum([(sign, left), (-sign, right)])  # holds where this is > 0 (or >= 0)
    components = _components(facts)
    linked = [
        part
        for part in components
        if any(term in difference for atom in part for term in atom.terms)
    ]
    outputs = {term for term in head.terms if isinstance(term, int)}
    keyed_parts = [
        part for part in components if outputs & {term for atom in part for term in atom.terms}
    ]
    # With three parts, or a head over both, the heads depend on pairs of rows: that is an ordinary
    # join.
    if len(components) != 2 or len(linked) != 2 or len(keyed_parts) != 1:
        return None
    keyed = keyed_parts[0]
    reaching = next(part for part in components if part is not keyed)
    own = {term for atom in keyed for term in atom.terms if isinstance(term, int)}
    values = {
        atom.terms[1]
        for atom in keyed
        if isinstance(atom, PredicateAtom) and atom.predicate.kind == 'data'
    }
    if not outputs or not outputs <= own or outputs & values - set(difference):
        return None
    key: Linear = {term: -factor for term, factor in difference.items() if term in own}
    reach: Linear = {term: factor for term, factor in difference.items() if term not in own}
    return ComparisonSplit(tuple(keyed), tuple(reaching), key, reach, strict, computed)


def _form(atom: ComputedAtom, forms: dict[Term, Linear]) -> Linear | None:
    rest = [_linear(term, forms) for term in atom.terms[1:]]
    if atom.builtin == 'add':
        return _sum([(1, part) for part in rest])
    if atom.builtin == 'subtract':
        return _sum([(1, rest[0]), (-1, rest[1])])
    if atom.builtin in ('unaryMinus', 'unaryPlus'):
        return _sum([(-1 if atom.builtin == 'unaryMinus' else 1, rest[0])])
    return None


def _components(atoms: tuple[BodyAtom, ...]) -> list[list[BodyAtom]]:
    parts: list[tuple[set[Term], list[BodyAtom]]] = []
    for atom in atoms:
        terms: set[Term] = {term for term in atom.terms if isinstance(term, int)}
        members = [atom]
        for part in [part for part in parts if part[0] & terms]:
            parts.remove(part)
            terms |= part[0]
            members = part[1] + members
        parts.append((terms, members))
    return [members for _, members in parts]


Row = tuple[Any, ...]


class _Highest:
    """Above every row of arguments."""

    def __lt__(self, other: object) -> bool:
        return False

    def __gt__(self, other: object) -> bool:
        return True


_HIGHEST = _Highest()


class ThresholdIndex:
    """Runs one clause that `split_rule` took apart.

    Many attributes because it keeps one rule compiled: its terms, its sorted lists and its hooks.
    """

    def __init__(
        self,
        clause: Clause,
        split: ComparisonSplit,
        context: JoinContext,
        enqueue: Callable[[Fact], None],
        overdelete: Callable[[Fact], None],
    ) -> None:
        head = clause.head
        assert isinstance(head, PredicateAtom)
        self._predicate, self._terms = head.predicate, head.terms
        self._enqueue, self._overdelete = enqueue, overdelete
        self._strict = split.strict
        outputs = [term for term in head.terms if isinstance(term, int)]
        self._key_terms = tuple(dict.fromkeys([*outputs, *_variables(split.key)]))
        self._reach_terms = _variables(split.reach)
        self._key_of = _evaluator(split.key, self._key_terms)
        self._reach_of = _evaluator(split.reach, self._reach_terms)
        self._keys: list[tuple[Any, Row]] = []
        self._keyed: dict[Row, Any] = {}
        self._reaches: list[tuple[Any, Row]] = []
        self._reaching: dict[Row, Any] = {}
        # Rows with a value that is no exact number (a double, say): compared one by one, as the
        # built-ins do, since a sorted list needs a total order.
        self._odd_keys: set[Row] = set()
        self._odd_reaches: set[Row] = set()
        # New keys are put in their places when a reach asks for them: at a start all come at once,
        # and one sort serves them.
        self._unsorted: list[tuple[Any, Row]] = []
        self._fresh_reaches: list[Row] = []
        self._lost: set[tuple[bool, Row]] = set()
        self._emitted: Any = None
        origin = clause.origin
        for atom in split.keyed:
            if isinstance(atom, PredicateAtom):
                predicate, body = atom.predicate, split.keyed
                arguments = (context, body, atom, atom.terms, self._key_terms)
                predicate.on_insert.append(compile_call(*arguments, self._gain_key, origin))
                predicate.on_delete.append(compile_call(*arguments, self._lose_key, origin))
        for atom in split.reaching:
            if isinstance(atom, PredicateAtom):
                predicate, body = atom.predicate, split.reaching
                arguments = (context, body, atom, atom.terms, self._reach_terms)
                gain = compile_call(*arguments, self._gain_reach, origin)
                predicate.on_insert.append(gain)
                # The new reach is known before the old one goes: a clock that moves on retracts one
                # time and asserts another, and heads below both never go.
                predicate.early.append(gain)
                predicate.on_delete.append(compile_call(*arguments, self._lose_reach, origin))
        self._key_support = compile_support(context, split.keyed, head.terms, self._key_terms)
        self._key_exists = compile_support(context, split.keyed, self._key_terms)
        self._reach_exists = compile_support(context, split.reaching, self._reach_terms)
        both = (*self._key_terms, *self._reach_terms)
        self._comparisons = compile_support(context, split.computed, both)
        self.proves: Callable[[Fact], bool] = lambda fact: True
        head.predicate.supports.append((self.supports, clause.origin))

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
        # Compared by `flush` alone: it is known early, when keys may still be about to go.
        self._fresh_reaches.append(row)
        reach = self._reach_of(row)
        if reach is None:
            self._odd_reaches.add(row)
            return
        self._reaching[row] = reach
        insort(self._reaches, (reach, row))

    def flush(self) -> None:
        """Emit what the greatest reach, and each new one that is compared by itself, covers."""
        for row in self._fresh_reaches:
            if row in self._odd_reaches:
                others: tuple[Row, ...] = (*self._keyed, *self._odd_keys)
            else:
                others = tuple(self._odd_keys) if row in self._reaching else ()
            for keyed in others:
                if self._satisfied(keyed, row):
                    self._emit(keyed)
        self._fresh_reaches.clear()
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
        """Return how many keys are below a reach."""
        return bisect_left(self._keys, (reach,) if self._strict else (reach, _HIGHEST))

    def _sort(self) -> None:
        fresh = self._unsorted
        if fresh:
            # Inserting moves half of the list in memory, which is fast; sorting looks at all of it.
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
            self._enqueue(fact)

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
        self._overdelete_head(row)

    def _lose_reach(self, *row: Any) -> None:
        reach = self._reaching.pop(row, None)
        if reach is None:
            if row in self._odd_reaches:
                self._odd_reaches.discard(row)
                self._lost.add((False, row))
                for keyed in (*self._keyed, *self._odd_keys):
                    self._overdelete_head(keyed)
            return
        del self._reaches[bisect_left(self._reaches, (reach, row))]
        self._lost.add((False, row))
        for keyed in self._odd_keys:
            self._overdelete_head(keyed)
        if self._emitted is None:
            return
        # Only what lies between the old reach and the best one that is sure to stay may have to go;
        # the rest is not looked at.
        left = self._proven_reach()
        if left is None or left < self._emitted:
            self._sort()
            start = 0 if left is None else self._place(left)
            rows = self._keys[start : self._place(self._emitted)]
            self._emitted = left
            for _, keyed in rows:
                self._overdelete_head(keyed)

    def _proven_reach(self) -> Any:
        """Return the greatest remaining reach whose facts have a proof, and so stay whatever
        goes.
        """
        for reach, row in reversed(self._reaches):
            for premises in self._reach_exists(*row):
                if all(map(self.proves, premises)):
                    return reach
        return None

    def _overdelete_head(self, row: Row) -> None:
        fact = self._head(row)
        if self._predicate.holds(fact):
            self._overdelete(fact)

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
        """Return the comparison as the built-ins define it, for values that are not exact
        numbers.
        """
        return any(True for _ in self._comparisons(*key_row, *reach_row))


def _variables(form: Linear) -> tuple[int, ...]:
    return tuple(sorted(term for term in form if isinstance(term, int)))


def _evaluator(form: Linear, terms: tuple[int, ...]) -> Callable[[Row], Any]:
    """Return the linear form's value for a row, exact; None where a value is not an exact
    number.
    """
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
