"""What follows for named individuals from individuals that must exist, kept up to date.

`contexts` says what an individual is that is in a set of classes; this index knows for each named
individual the classes that matter, and adds or withdraws what their context implies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.reasoner.clauses import (
    Constant,
    Fact,
    HeadAtom,
    Predicate,
    PredicateAtom,
    Premises,
    Program,
    SameAtom,
    Term,
)
from surveillance_ontology.reasoner.contexts import Contexts

Emit = Callable[[Fact], None]
MergeRequest = Callable[[str, str, Axiom | None, Premises], None]
_FEW = 12
_X = 0


class ContextIndex:
    """Runs the contexts of one program.

    Args:
        program: Whose predicates hold the facts.
        contexts: What classes together imply.
        representative: From an individual to the one that stands for it, where that is another.
        enqueue, overdelete: Called with facts that follow, or may follow no longer.
        merge: Called with individuals that must be the same.
    """

    def __init__(
        self,
        program: Program,
        contexts: Contexts,
        representative: dict[str, str],
        enqueue: Emit,
        overdelete: Emit,
        merge: MergeRequest,
    ) -> None:
        self._contexts, self._nothing = contexts, program.nothing
        self._representative = representative
        self._enqueue, self._overdelete, self._merge = enqueue, overdelete, merge
        self._labels: dict[str, set[Predicate]] = {}
        self._changed: dict[str, None] = {}
        self._about: dict[tuple[Predicate, str], dict[str, None]] = {}
        self._fewest: dict[tuple[frozenset[Predicate], HeadAtom | None], frozenset[Predicate]] = {}
        self._requiring = {existential.label for existential in program.existentials}
        for predicate in program.relevant:
            self._watch(predicate)
        for predicate in dict.fromkeys(program.predicates()):
            if predicate.kind in ('class', 'object', 'data'):
                predicate.supports.append((self._supports_of(predicate), None))

    def _watch(self, predicate: Predicate) -> None:
        labels, changed = self._labels, self._changed

        def gain(x: str) -> None:
            held = labels.get(x)
            if held is None:
                labels[x] = {predicate}
            else:
                held.add(predicate)
            changed[x] = None

        def lose(x: str) -> None:
            held = labels.get(x)
            if held is None or predicate not in held:
                return
            self._withdraw(x, frozenset(held))
            held.discard(predicate)
            if not held:
                del labels[x]
            changed[x] = None

        predicate.on_insert.append(gain)
        predicate.on_delete.append(lose)

    def rename(self) -> None:
        """Look again at everybody: an individual came to stand for another, or ceased to."""
        self._about.clear()
        self._changed.update(dict.fromkeys(self._labels))

    def flush(self) -> None:
        """Add what the changed individuals' classes imply."""
        for x in tuple(self._changed):
            held = self._labels.get(x)
            if held is not None and not self._requiring.isdisjoint(held):
                self._imply(x, frozenset(held))
        self._changed.clear()

    def _imply(self, x: str, labels: frozenset[Predicate]) -> None:
        heads = self._contexts.heads(labels)
        if heads is None:
            self._emit((self._nothing, x))
            return
        for head in heads:
            if isinstance(head, SameAtom):
                other = head.terms[1]
                assert isinstance(other, Constant)
                if x != other.value:
                    facts = tuple((one, x) for one in self._few(labels, head))
                    self._merge(x, str(other.value), None, facts)
                continue
            fact = self._fact(head, x)
            if len(fact) == 2 and fact[1] != x:
                self._about.setdefault((fact[0], fact[1]), {})[x] = None
            self._emit(fact)

    def _emit(self, fact: Fact) -> None:
        if not fact[0].holds(fact):
            self._enqueue(fact)

    def _withdraw(self, x: str, labels: frozenset[Predicate]) -> None:
        if self._requiring.isdisjoint(labels):
            return
        heads = self._contexts.heads(labels)
        facts = (
            [(self._nothing, x)]
            if heads is None
            else [self._fact(head, x) for head in heads if isinstance(head, PredicateAtom)]
        )
        for fact in facts:
            if fact[0].holds(fact):
                self._overdelete(fact)

    def gaps(self) -> Iterable[str]:
        """Return sentences about axioms whose consequences for the individuals may be
        incomplete.
        """
        return self._contexts.gaps({frozenset(held) for held in self._labels.values()})

    # --- reasons ---

    def _supports_of(self, predicate: Predicate) -> Callable[..., Iterator[Premises]]:
        if predicate.kind == 'class':
            return lambda x: self._class_supports(predicate, x)
        return lambda x, y: self._relation_supports(predicate, x, y)

    def _class_supports(self, predicate: Predicate, x: str) -> Iterator[Premises]:
        yield from self._premises(x, (predicate, x), predicate)
        for other in tuple(self._about.get((predicate, x), ())):
            yield from self._premises(other, (predicate, x), None)

    def _relation_supports(self, predicate: Predicate, x: str, y: Any) -> Iterator[Premises]:
        yield from self._premises(x, (predicate, x, y), None)
        if predicate.kind == 'object' and x != y:
            yield from self._premises(y, (predicate, x, y), None)

    def _premises(self, x: str, fact: Fact, itself: Predicate | None) -> Iterator[Premises]:
        """Yield the classes by which what an individual is implies a fact, without `itself`."""
        held = self._labels.get(x)
        if held is None or self._requiring.isdisjoint(held):
            return
        labels = frozenset(held) - {itself}
        heads = self._contexts.heads(labels)
        if fact[0] is self._nothing:
            if heads is None:
                yield tuple((one, x) for one in self._few(labels, None))
            return
        for head in heads or ():
            named = isinstance(head, PredicateAtom) and head.predicate is fact[0]
            if named and self._fact(head, x) == fact:  # type: ignore[arg-type]
                yield tuple((one, x) for one in self._few(labels, head))

    def _implies(self, labels: frozenset[Predicate], head: HeadAtom | None) -> bool:
        heads = self._contexts.heads(labels)
        if heads is None or head is None:
            return heads is None and head is None
        return head in heads

    def _few(self, labels: frozenset[Predicate], head: HeadAtom | None) -> frozenset[Predicate]:
        """Classes from which no more can be left out, where they are not too many to try."""
        if len(labels) > _FEW:
            return labels
        key = labels, head
        found = self._fewest.get(key)
        if found is None:
            found = labels
            for one in sorted(labels, key=lambda predicate: predicate.name):
                if self._implies(found - {one}, head):
                    found -= {one}
            self._fewest[key] = found
        return found

    def premises(self, x: str, y: str) -> Iterator[Premises]:
        """Yield the classes by which two individuals differ: none can be in all of them."""
        mine, theirs = self._labels.get(x), self._labels.get(y)
        if mine is None or theirs is None:
            return
        labels = frozenset(mine | theirs)
        if self._requiring.isdisjoint(labels) or self._contexts.heads(labels) is not None:
            return
        few = self._few(labels, None)
        yield tuple((one, x if one in mine else y) for one in few)

    def _fact(self, head: PredicateAtom, x: str) -> Fact:
        """Return the fact that a head states of an individual, in representatives."""
        names = self._representative

        def argument(term: Term) -> Any:
            if not isinstance(term, Constant):
                return x
            value: Any = term.value
            return value if term.is_value else names.get(value, value)

        return (head.predicate, *map(argument, head.terms))
