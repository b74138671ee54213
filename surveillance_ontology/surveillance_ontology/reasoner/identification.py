"""Individuals that come to be known as the same, or cease to be: facts follow to one name."""

from __future__ import annotations

from surveillance_ontology.owl.axioms import Axiom, SameIndividual
from surveillance_ontology.reasoner.clauses import Fact
from surveillance_ontology.reasoner.equality import Merge
from surveillance_ontology.reasoner.fact_state import FactState
from surveillance_ontology.reasoner.translation import individuals_of, is_about_individuals


class Identification(FactState):
    """Joins and splits classes of equal individuals.

    A class is split as soon as anything that could have justified it goes; its members' assertions
    are then stated again under their own names, and what still makes them equal joins them again.
    """

    def _state_same(self, axiom: SameIndividual) -> None:
        first, *others = sorted(axiom.individuals)
        for other in others:
            self._requests[Merge(first, other, axiom, ())] = None

    def _run_requests(self) -> None:
        pending = tuple(self._requests)
        self._requests.clear()
        equality = self.equality
        for merge in pending:
            origin = merge.origin
            if isinstance(origin, SameIndividual) and origin not in self.about(merge.first):
                continue
            x, y = equality.find(merge.first), equality.find(merge.second)
            if x == y or not all(self._holds(self.current(fact)) for fact in merge.premises):
                continue
            if self.difference.different(x, y):
                self.conflicts[merge.first, merge.second] = merge
                self._queue.append((self._nothing, x))
                continue
            self._merge(merge)

    def _merge(self, merge: Merge) -> None:
        self.renamed = True
        kept, gone = self.equality.join(merge)
        self.difference.merge(kept, self.equality.members[kept])
        moved = list(self._facts_about(gone))
        for fact in moved:
            for fire in fact[0].on_delete:
                fire(*fact[1:])
            fact[0].discard(fact)
            if self.changed is not None:
                self.changed.setdefault(fact, fact not in self.asserted)
            self._queue.append(fact)
        # Nothing ceased to hold: what the removal hooks named holds of the representative.
        self._doomed.clear()
        for place, fact in enumerate(self._queue):
            current = self.current(fact)
            if current != fact:
                self._queue[place] = current
                count = self.asserted.pop(fact, 0)
                if count:
                    known = self.asserted.get(current, 0)
                    if self.changed is not None and not known:
                        self.changed.setdefault(current, current[0].holds(current))
                    self.asserted[current] = known + count
        for index in self._network.thresholds:
            index.settle()
        for run in self._network.naming:
            run()
        self._touched[kept] = None

    def _split(self, representative: str, fresh: list[Fact]) -> None:
        """Takes away everything about a class of individuals, and states its members' assertions
        again.
        """
        if representative not in self.equality.members:
            return
        self.renamed = self._split_happened = True
        facts = list(self._facts_about(representative))
        for fact in facts:
            if self.asserted.pop(fact, None) and self.changed is not None:
                self.changed.setdefault(fact, False)
        others: dict[str, None] = {}
        for fact in facts:
            others.update(dict.fromkeys(self.equality.dependents(fact)))
            self._take(fact)
        members = self.equality.split(representative)
        self.difference.split(representative)
        for pair in [pair for pair in self.conflicts if not members.isdisjoint(pair)]:
            self._doomed.append((self._nothing, representative))
            self._withdraw_conflict(pair)
        self.proofs.reset()
        axioms: dict[Axiom, None] = {}
        for member in sorted(members):
            self._touched[member] = None
            for axiom in self.about(member):
                if is_about_individuals(axiom):
                    axioms[axiom] = None
        for axiom in axioms:
            if isinstance(axiom, SameIndividual):
                self._state_same(axiom)
            stated = self.fact_of(axiom)
            if stated is not None and not members.isdisjoint(_individuals_in(stated)):
                self._assert(stated, fresh)
            if self.program.uses_thing:
                for individual in individuals_of(axiom) & members:
                    self._assert((self.program.thing, individual), fresh)
        for other in others:
            self._split(other, fresh)


def _individuals_in(fact: Fact) -> tuple[str, ...]:
    return fact[1:2] if fact[0].kind == 'data' else fact[1:]
