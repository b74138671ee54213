"""The facts that hold, and the single steps of putting one in or taking one out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.reasoner.clauses import Fact, Predicate, Premises, Program
from surveillance_ontology.reasoner.difference import Difference
from surveillance_ontology.reasoner.equality import Merge
from surveillance_ontology.reasoner.network import Network
from surveillance_ontology.reasoner.proofs import ProofSearch
from surveillance_ontology.reasoner.translation import Translation

Conflict = tuple[str, str]


class FactState(Translation):
    """Everything the engine remembers between two updates.

    Attributes:
        asserted: How many assertions state each fact.
        difference: Who is known to be different.
        conflicts: Pairs that must be the same, and are different.
        proofs: Searches why a fact holds.
        changed: Where a log of one update is wanted: facts that came, went or changed their
            standing, with whether they were derived (and not asserted) before.
        renamed: Whether an individual came to stand for another, or ceased to, since this was
            reset.
    """

    def __init__(self, program: Program, about: Callable[[str], Iterable[Axiom]]) -> None:
        super().__init__(program, about)
        self.difference = Difference(program)
        self.asserted: dict[Fact, int] = {}
        self._queue: list[Fact] = []
        self._doomed: list[Fact] = []
        self._requests: dict[Merge, None] = {}
        self.conflicts: dict[Conflict, Merge] = {}
        self._touched: dict[str, None] = {}
        self._removed: dict[Fact, None] = {}
        self._split_happened = False
        self.proofs = ProofSearch(self.asserted)
        self.changed: dict[Fact, bool] | None = None
        self.renamed = False
        self._network = Network(
            program,
            self.equality.representative,
            self.difference,
            self._queue.append,
            self._doomed.append,
            self._request,
        )
        self._nothing = program.nothing
        self._nothing.supports.append((self._conflict_supports, 'one individual, yet different'))
        program.same.supports.append((self._same_supports, None))
        for index in self._network.thresholds:
            index.proves = self.proofs.proves
        self._flushes = [index.flush for index in self._network.thresholds]
        for predicate in dict.fromkeys(program.predicates()):
            self._attach_touching(predicate)

    @property
    def consistent(self) -> bool:
        """Whether no contradiction is derived."""
        return not self._nothing.members

    # --- touching ---

    def _attach_touching(self, predicate: Predicate) -> None:
        if not predicate.touching:
            return
        touch = self._touched.setdefault
        forget = self._touch_before_removal
        if predicate.kind == 'class':
            predicate.on_insert.append(lambda x: touch(x))
            predicate.on_delete.append(forget)
            return
        if 1 in predicate.touching:
            predicate.on_insert.append(lambda x, y: touch(x))
            predicate.on_delete.append(lambda x, y: forget(x))
        if 2 in predicate.touching:
            predicate.on_insert.append(lambda x, y: touch(y))
            predicate.on_delete.append(lambda x, y: forget(y))

    def _related_by_difference(self, individual: str) -> list[str]:
        """The individual and those whose difference from others may rest on its own."""
        found = [individual]
        if self._network.touch_related:
            for one in found:
                for related in self._network.touch_related:
                    found += [other for other in related(one) if other not in found]
        return found

    def _touch_before_removal(self, individual: str) -> None:
        for one in self._related_by_difference(individual):
            for touch in self._network.touch_delete:
                touch(one)
            if self.conflicts:
                for pair in [pair for pair in self.conflicts if one in pair]:
                    self._withdraw_conflict(pair)

    # --- single facts ---

    def _assert(self, fact: Fact, fresh: list[Fact]) -> None:
        asserted = self.asserted
        count = asserted.get(fact)
        if count is not None:
            asserted[fact] = count + 1
            return
        asserted[fact] = 1
        if self.changed is not None:
            self.changed.setdefault(fact, fact[0].holds(fact))
        if not fact[0].holds(fact):
            fact[0].insert(fact)
            fresh.append(fact)

    def _unassert(self, fact: Fact) -> None:
        count = self.asserted.get(fact, 0)
        if count > 1:
            self.asserted[fact] = count - 1
        elif count:
            del self.asserted[fact]
            if self.changed is not None:
                self.changed.setdefault(fact, False)
            self._doomed.append(fact)

    def _take(self, fact: Fact) -> None:
        predicate, arguments = fact[0], fact[1:]
        for fire in predicate.on_delete:
            fire(*arguments)
        predicate.discard(fact)
        self._removed[fact] = None
        if self.changed is not None:
            self.changed.setdefault(fact, True)
        if self.conflicts:
            for pair in [p for p, merge in self.conflicts.items() if fact in merge.premises]:
                self._withdraw_conflict(pair)

    def _follows(self, fact: Fact) -> bool:
        """Whether one step derives a fact from what holds."""
        for support, _ in fact[0].supports:
            for premises in support(*fact[1:]):
                if all(self._holds(premise) for premise in premises):
                    return True
        return False

    def _holds(self, fact: Fact) -> bool:
        if fact[0] is self.program.different:
            return self.difference.different(fact[1], fact[2])
        if fact[0] is self.program.same:
            return (fact[1], fact[2]) in self.conflicts
        holds: bool = fact[0].holds(fact)
        return holds

    def _facts_about(self, individual: str) -> Iterator[Fact]:
        for predicate in dict.fromkeys(self.program.predicates()):
            if predicate.kind == 'class':
                if individual in predicate.members:
                    yield predicate, individual
                continue
            for y in predicate.succ.get(individual, ()):
                yield predicate, individual, y
            if predicate.kind != 'data':
                for x in predicate.pred.get(individual, ()):
                    if x != individual:
                        yield predicate, x, individual

    # --- individuals that must be the same ---

    def _request(self, x: str, y: str, origin: Axiom | None, premises: Premises) -> None:
        self._requests[Merge(x, y, origin, premises)] = None

    def _withdraw_conflict(self, pair: Conflict, again: bool = True) -> None:
        merge = self.conflicts.pop(pair)
        self._doomed.append((self._nothing, self.equality.find(pair[0])))
        if again:
            self._requests[merge] = None

    def _conflict_supports(self, x: str) -> Iterator[Premises]:
        find = self.equality.find
        for first, second in self.conflicts:
            if find(first) == x:
                different = (self.program.different, x, find(second))
                yield ((self.program.same, first, second), different)

    def _same_supports(self, first: str, second: str) -> Iterator[Premises]:
        merge = self.conflicts.get((first, second))
        if merge is not None:
            yield tuple(map(self.current, merge.premises))
