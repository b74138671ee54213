"""Cardinalities: counting what is known, with inequality decided by `Inequality`.

`AtLeastCounter` derives membership in `min n`; `AtMostCounter` finds contradictions with `max n`
and functional properties, and the individuals that must be the same because only one is allowed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, product
from typing import Any

from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.vocabulary import is_anonymous
from owl_reasoner.reasoner.clauses import (
    AtLeast,
    AtMost,
    Fact,
    Key,
    Predicate,
    Premises,
)
from owl_reasoner.reasoner.inequality import Inequality, clique, cliques
from owl_reasoner.reasoner.value_sets import ValueSet

Emit = Callable[[Fact], None]
MergeRequest = Callable[[str, str, Axiom | None, Premises], None]


class _Counter:
    """What the two have in common: who is related to whom, and who is in the filler."""

    def __init__(self, condition: AtLeast | AtMost, inequality: Inequality) -> None:
        self.prop = condition.prop
        self.inverse = condition.inverse
        self.n = condition.n
        self.origin = condition.origin
        self.is_data = condition.prop.kind == 'data'
        self.inequality = inequality
        self.succ: dict[Any, dict[Any, None]] = self.prop.pred if self.inverse else self.prop.succ
        self.pred: dict[Any, dict[Any, None]] = self.prop.succ if self.inverse else self.prop.pred
        filler = condition.filler
        self.filler = filler if isinstance(filler, Predicate) else None
        self.values = filler if isinstance(filler, ValueSet) else None
        self._hooks: list[tuple[list[Any], Any]] = []

    def hook(self, place: list[Any], what: Any) -> None:
        """Add to a list what `detach` takes out of it."""
        place.append(what)
        self._hooks.append((place, what))

    def detach(self) -> None:
        """Count no more."""
        for place, what in self._hooks:
            place.remove(what)
        self._hooks.clear()

    def related(self, z: str) -> list[Any]:
        """Return what counts for `z`."""
        values = self.succ.get(z, ())
        if self.filler is not None:
            members = self.filler.members
            return [y for y in values if y in members]
        if self.values is not None:
            return list(filter(self.values.contains, values))
        return list(values)

    def facts(self, z: str, values: list[Any]) -> Premises:
        """Return the facts by which the values count for `z`."""
        prop, filler = self.prop, self.filler
        facts: list[Fact] = [(prop, y, z) if self.inverse else (prop, z, y) for y in values]
        if filler is not None:
            facts += [(filler, y) for y in values]
        return tuple(facts)

    def choices(self, values: list[Any], size: int) -> Iterator[list[Any]]:
        """Return the ways to choose `size` different ones, one after the other.

        There may be very many: whoever asks takes the first that serves.
        """
        if len(values) < size:
            return iter(())
        if self.is_data:
            return map(list, combinations(sorted(values, key=repr), size))
        return cliques(sorted(values), size, self.inequality.different)

    def differences(self, values: list[str]) -> Premises:
        """Return the facts by which the values are pairwise different; values of data just are."""
        if self.is_data:
            return ()
        predicate = self.inequality.predicate
        return tuple((predicate, *pair) for pair in combinations(values, 2))

    def _subjects(self, act: Callable[[str], None]) -> Callable[..., None]:
        return (lambda y, z: act(z)) if self.inverse else (lambda z, y: act(z))

    def _each_subject(self, act: Callable[[str], None]) -> Callable[[str], None]:
        pred = self.pred

        def visit(y: str) -> None:
            for z in tuple(pred.get(y, ())):
                act(z)

        return visit


class AtLeastCounter(_Counter):
    """Keeps the members of one `min n` expression."""

    def __init__(
        self, condition: AtLeast, inequality: Inequality, enqueue: Emit, overdelete: Emit
    ) -> None:
        super().__init__(condition, inequality)
        self.head = condition.head
        self._enqueue, self._overdelete = enqueue, overdelete
        self.prop.on_insert.append(self._subjects(self.gain))
        self.prop.on_delete.append(self._subjects(self.lose))
        if self.filler is not None:
            self.filler.on_insert.append(self._each_subject(self.gain))
            self.filler.on_delete.append(self._each_subject(self.lose))
        self.head.supports.append((self.supports, self.origin))
        self.touch_insert = self._each_subject(self.gain)
        self.touch_delete = self._each_subject(self.lose)

    def gain(self, z: str) -> None:
        """Count again after something came."""
        # Most calls end here: a count of all that is related, before who of it counts and who is
        # different.
        if z in self.head.members or len(self.succ.get(z, ())) < self.n:
            return
        values = self.related(z)
        if len(values) >= self.n and (
            # Individuals may be the same unless known to be different (no unique name assumption):
            # so many pairwise different ones are a clique in the graph of known differences.
            self.is_data or clique(values, self.n, self.inequality.different) is not None
        ):
            self._enqueue((self.head, z))

    def lose(self, z: str) -> None:
        """Something that counted is about to go."""
        if z in self.head.members:
            self._overdelete((self.head, z))

    def supports(self, z: str) -> Iterator[Premises]:
        """Yield facts by which `z` has enough."""
        for chosen in self.choices(self.related(z), self.n):
            yield self.facts(z, chosen) + self.differences(chosen)


class AtMostCounter(_Counter):
    """Watches one `max n` expression or functional property."""

    def __init__(
        self,
        condition: AtMost,
        inequality: Inequality,
        nothing: Predicate,
        enqueue: Emit,
        overdelete: Emit,
        merge: MergeRequest,
    ) -> None:
        super().__init__(condition, inequality)
        self.condition = condition
        self.label = condition.label
        self._nothing = nothing
        self._enqueue, self._overdelete, self._merge = enqueue, overdelete, merge
        self.recheck: set[str] = set()
        if self.n == 1:
            gain = self._gain_value
            self.hook(self.prop.on_insert, (lambda y, z: gain(z, y)) if self.inverse else gain)
        else:
            self.hook(self.prop.on_insert, self._subjects(self.gain))
        self.hook(self.prop.on_delete, self._subjects(self.lose))
        if self.label is not None:
            self.hook(self.label.on_insert, self.gain)
            self.hook(self.label.on_delete, self.lose)
        if self.filler is not None:
            self.hook(self.filler.on_insert, self._each_subject(self.gain))
            self.hook(self.filler.on_delete, self._each_subject(self.lose))
        self.hook(nothing.supports, (self.supports, self.origin))
        self.touch_insert = self._each_subject(self.gain)
        self.touch_delete = self._each_subject(self.lose)

    def gain(self, z: str) -> None:
        """Look again after something came."""
        values = self.succ.get(z)
        if values is None or len(values) <= self.n:
            return
        if self.label is not None and z not in self.label.members:
            return
        related = self.related(z)
        if len(related) <= self.n:
            return
        if self.n == 1:
            # Each with the first one, not each pair: equality is transitive.
            for other in related[1:]:
                self._only_one(z, related[0], other)
            return
        different = self.inequality.different
        if self.is_data or clique(related, self.n + 1, different) is not None:
            if z not in self._nothing.members:
                self._enqueue((self._nothing, z))
            return
        # One too many, and one pair alone that may be the same: then it is (a unit of the
        # disjunction over pairs). More than one such pair is left to reasoning by cases.
        facts = self._label_fact(z) + self.facts(z, related)
        for one, other in self._forced(related):
            apart = self.differences(related)
            rest = tuple(fact for fact in apart if {one, other} != {*fact[1:]})
            self._merge(one, other, self.origin, facts + rest)

    def _gain_value(self, z: Any, y: Any) -> None:
        """Compare a value that came with one that was there, where one is allowed.

        That is enough: the others are, or are about to be, the same as that one.
        """
        values = self.succ[z]
        if len(values) == 1 or (self.label is not None and z not in self.label.members):
            return
        if self._counts(y):
            first = next((one for one in values if one != y and self._counts(one)), None)
            if first is not None:
                self._only_one(z, first, y)

    def _only_one(self, z: str, first: Any, other: Any) -> None:
        if self.is_data or self.inequality.different(first, other):
            if z not in self._nothing.members:
                self._enqueue((self._nothing, z))
            return
        facts = self._label_fact(z) + self.facts(z, [first, other])
        one, another = sorted((first, other))
        self._merge(one, another, self.origin, facts)

    def _counts(self, y: Any) -> bool:
        if self.filler is not None:
            return y in self.filler.members
        return self.values is None or self.values.contains(y)

    def _forced(self, related: list[str]) -> Iterator[tuple[str, str]]:
        """Pairs that must be the same for the rest to fit."""
        different = self.inequality.different
        related = sorted(related)
        if len(related) == self.n + 1:
            pairs = [pair for pair in combinations(related, 2) if not different(*pair)]
            if len(pairs) == 1:
                yield pairs[0]

    def lose(self, z: str) -> None:
        """Something that counted is about to go."""
        if z in self._nothing.members:
            self._overdelete((self._nothing, z))
            # Its contradiction may hide that two are the same: looked at again when it is over.
            self.recheck.add(z)

    def _label_fact(self, z: str) -> Premises:
        return () if self.label is None else ((self.label, z),)

    def supports(self, z: str) -> Iterator[Premises]:
        """Yield facts by which `z` has too many."""
        values = self.succ.get(z)
        if values is None or len(values) <= self.n:
            return
        if self.label is not None and z not in self.label.members:
            return
        for chosen in self.choices(self.related(z), self.n + 1):
            yield self._label_fact(z) + self.facts(z, chosen) + self.differences(chosen)

    # --- as evidence that two individuals differ: together they would have too many ---

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        first, second = self.succ.get(x), self.succ.get(y)
        if not first or not second:
            return
        label = self.label
        marks: list[Premises] = [()]
        if label is not None:
            marks = [((label, z),) for z in (x, y) if z in label.members]
            if not marks:
                return
        if self.is_data:
            union = {*self.related(x), *self.related(y)}
            if len(union) <= self.n:
                return
            for chosen in self.choices(list(union), self.n + 1):
                mine = [value for value in chosen if value in first]
                rest = [value for value in chosen if value not in first]
                facts = self.facts(x, mine) + self.facts(y, rest)
                for mark in marks:
                    yield mark + facts
            return
        different = self.inequality.different
        for one, other in self.pairs(x, y):
            if different(one, other):
                facts = self.facts(x, [one]) + self.facts(y, [other])
                for mark in marks:
                    yield mark + facts + ((self.inequality.predicate, one, other),)

    def pairs(self, x: str, y: str) -> Iterator[tuple[str, str]]:
        """Yield where one is allowed: pairs of values that must be the same if `x` and `y` are."""
        if x not in self.succ or y not in self.succ or self.n != 1:
            return
        members = None if self.label is None else self.label.members
        if members is None or x in members or y in members:
            yield from product(self.related(x), self.related(y))


class KeyWatcher:
    """Finds named members of a class that share a value, a named one, of every key property."""

    def __init__(self, key: Key, merge: MergeRequest) -> None:
        self._key, self._merge = key, merge
        if key.cls is not None:
            key.cls.on_insert.append(self.gain)
        for prop, inverse in key.props:
            prop.on_insert.append(
                (lambda y, x: self.gain(x)) if inverse else (lambda x, y: self.gain(x))
            )

    def gain(self, x: str) -> None:
        """Look for individuals that `x` now shares its key with."""
        cls = self._key.cls
        # A key identifies named individuals only (OWL 2 Structural Specification, 9.5).
        if is_anonymous(x) or (cls is not None and x not in cls.members):
            return
        shared: dict[str, list[Fact]] | None = None
        for prop, inverse in self._key.props:
            succ, pred = (prop.pred, prop.succ) if inverse else (prop.succ, prop.pred)
            found: dict[str, list[Fact]] = {}
            for value in succ.get(x, ()):
                if prop.kind == 'object' and is_anonymous(value):
                    continue
                for y in pred.get(value, ()):
                    if y != x and not is_anonymous(y) and (shared is None or y in shared):
                        pair = [(prop, value, x), (prop, value, y)]
                        if not inverse:
                            pair = [(prop, x, value), (prop, y, value)]
                        found[y] = pair if shared is None else shared[y] + pair
            shared = found
            if not shared:
                return
        for y, facts in (shared or {}).items():
            if cls is None or y in cls.members:
                marks = [] if cls is None else [(cls, x), (cls, y)]
                self._merge(x, y, self._key.origin, tuple(marks + facts))
