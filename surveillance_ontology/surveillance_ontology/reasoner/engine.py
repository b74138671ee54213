"""The incremental engine: facts come in, what follows is added; facts go, what no longer follows is
taken away.

Additions run semi-naively: every new fact is joined with what is there. Removals run backwards and
forwards: what a vanished fact supported is a candidate; a candidate with another proof from the
assertions stays; the rest goes, and what can be derived again from what is left comes back. So a
fact derived in several ways survives the loss of one, and a change is followed no further than it
reaches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from surveillance_ontology.owl.axioms import (
    Axiom,
    DifferentIndividuals,
    SameIndividual,
)
from surveillance_ontology.owl.vocabulary import local_name
from surveillance_ontology.reasoner.clauses import Fact, Predicate, Program
from surveillance_ontology.reasoner.identification import Identification
from surveillance_ontology.reasoner.translation import individuals_of

_MOST_VALUES = 20_000


class Engine(Identification):
    """Keeps the consequences of a program and a changing set of assertions.

    Args:
        program: What to run; its predicates hold the facts and belong to this engine.
        about: Gives the assertions that mention an individual (as of the current `update`).
    """

    def __init__(self, program: Program, about: Callable[[str], Iterable[Axiom]]) -> None:
        super().__init__(program, about)
        self._start()

    def _start(self) -> None:
        for fire in self._network.initial:
            fire()

    def restart(self, facts: Iterable[Fact]) -> None:
        """Forgets everything, then takes these facts for asserted."""
        for predicate in self.program.predicates():
            predicate.clear()
        for index in self._network.thresholds:
            index.clear()
        for container in (self.asserted, self.conflicts, self._touched, self._requests):
            container.clear()
        self.equality.clear()
        self.difference.clear()
        self._start()
        self.supply(facts)

    def supply(self, facts: Iterable[Fact]) -> None:
        """Takes more facts for asserted."""
        self.proofs.reset()
        for fact in facts:
            fact = self.current(fact)
            self.asserted[fact] = self.asserted.get(fact, 0) + 1
            self._queue.append(fact)
        self._propagate()

    # --- updates ---

    def update(self, added: Iterable[Axiom], removed: Iterable[Axiom]) -> None:
        """Applies changed assertions and brings what follows up to date."""
        equality, uses_thing = self.equality, self.program.uses_thing
        fresh: list[Fact] = []
        splitting: set[str] = set()
        self.proofs.reset()
        added, removed = list(added), list(removed)
        self._restate_differences(added, removed, splitting)
        for axiom in removed:
            if equality.members:
                splitting.update(self._classes_of(axiom))
            if self.conflicts and isinstance(axiom, SameIndividual):
                for pair in [p for p, merge in self.conflicts.items() if merge.origin == axiom]:
                    self._withdraw_conflict(pair, again=False)
            fact = self.fact_of(axiom)
            if fact is not None:
                self._unassert(fact)
            if uses_thing:
                for individual in individuals_of(axiom):
                    self._unassert((self.program.thing, equality.find(individual)))
        for axiom in added:
            if type(axiom) is SameIndividual:
                self._state_same(axiom)
            fact = self.fact_of(axiom)
            if fact is not None:
                self._assert(fact, fresh)
            if uses_thing:
                for individual in individuals_of(axiom):
                    self._assert((self.program.thing, equality.find(individual)), fresh)
        for representative in splitting:
            self._split(representative, fresh)
        for fact in fresh:
            for early in fact[0].early:
                early(*fact[1:])
        if self._doomed or self._removed:
            self._remove_doomed(fresh)
        for fact in fresh:
            if fact[0].holds(fact):
                for fire in fact[0].on_insert:
                    fire(*fact[1:])
        self._propagate()

    def _classes_of(self, axiom: Axiom) -> set[str]:
        found = {self.equality.find(name) for name in individuals_of(axiom)}
        return {name for name in found if name in self.equality.members}

    def _restate_differences(
        self, added: list[Axiom], removed: list[Axiom], splitting: set[str]
    ) -> None:
        gone = [axiom for axiom in removed if isinstance(axiom, DifferentIndividuals)]
        come = [axiom for axiom in added if isinstance(axiom, DifferentIndividuals)]
        if not gone and not come:
            return
        difference, equality = self.difference, self.equality
        touched: dict[str, None] = {}
        for axiom in gone:
            # A set that comes back a little larger or smaller changes only for those who joined
            # or left.
            heirs = [other.individuals for other in come]
            best = max(heirs, key=lambda heir: len(heir & axiom.individuals), default=frozenset())
            for individual in sorted(axiom.individuals - best):
                touched[equality.find(individual)] = None
        for individual in touched:
            self._touch_before_removal(individual)
        for axiom in gone:
            difference.withdraw(axiom)
        for axiom in come:
            heirs = [other.individuals for other in gone]
            known = max(heirs, key=lambda heir: len(heir & axiom.individuals), default=frozenset())
            difference.state(axiom)
            for individual in axiom.individuals - known:
                self._touched[equality.find(individual)] = None
        if equality.members:
            for axiom in (*gone, *come):
                splitting.update(self._classes_of(axiom))

    # --- removal ---

    def _remove_doomed(self, fresh: list[Fact]) -> None:
        doomed, asserted, proves = self._doomed, self.asserted, self.proofs.proves
        while doomed:
            fact = doomed.pop()
            if not fact[0].holds(fact):
                continue
            if self.equality.members:
                for representative in self.equality.dependents(fact):
                    self._split(representative, fresh)
                if not fact[0].holds(fact):
                    continue
            if fact in asserted or proves(fact):
                continue
            self._take(fact)
            if self.equality.members:
                for representative in self.equality.dependents(fact):
                    self._split(representative, fresh)
        self._settle()

    def _settle(self) -> None:
        """Brings back what still follows, and lets the counters look again."""
        for index in self._network.thresholds:
            index.settle()
        queue, names = self._queue, self.equality.representative
        for fact in self._removed:
            if names and self.current(fact) != fact:
                continue
            if self._follows(fact):
                queue.append(fact)
        self._removed.clear()
        if self._split_happened:
            self._split_happened = False
            for run in self._network.naming:
                run()
        for counter in self._network.counters:
            recheck = tuple(counter.recheck)
            counter.recheck.clear()
            for individual in recheck:
                counter.gain(self.equality.find(individual))

    # --- addition ---

    def _propagate(self) -> None:
        queue, touched, flushes = self._queue, self._touched, self._flushes
        changed = self.changed
        values_left = _MOST_VALUES + 4 * len(self.asserted)
        while True:
            for fact in queue:
                predicate = fact[0]
                if len(fact) == 2:
                    x = fact[1]
                    if x in predicate.members:
                        continue
                    predicate.members.add(x)
                    if changed is not None:
                        changed.setdefault(fact, False)
                    for fire in predicate.on_insert:
                        fire(x)
                    continue
                _, x, y = fact
                succ = predicate.succ
                values = succ.get(x)
                if values is None:
                    succ[x] = {y}
                elif y in values:
                    continue
                else:
                    values.add(y)
                pred = predicate.pred
                subjects = pred.get(y)
                if subjects is None:
                    pred[y] = {x}
                else:
                    subjects.add(x)
                if changed is not None:
                    changed.setdefault(fact, False)
                for fire in predicate.on_insert:
                    fire(x, y)
                if predicate.kind == 'data':
                    values_left -= 1
                    if values_left < 0:
                        self._stop_generating(predicate)
                        break
            queue.clear()
            if self._requests:
                self._run_requests()
            elif touched:
                self._run_touched()
            else:
                for flush in flushes:
                    flush()
                if not queue:
                    return

    def _stop_generating(self, predicate: Predicate) -> None:
        """Ends a rule that makes a new value of every value; what it made so far stays."""
        text = (
            f'the rules on {local_name(predicate.name)} make values without end:'
            f' stopped after {_MOST_VALUES} in one step'
        )
        if text not in self.program.unsupported:
            self.program.unsupported.append(text)

    def _run_touched(self) -> None:
        pending = tuple(self._touched)
        self._touched.clear()
        done: set[str] = set()
        touch_insert = self._network.touch_insert
        for individual in pending:
            for one in self._related_by_difference(individual):
                if one not in done:
                    done.add(one)
                    for touch in touch_insert:
                        touch(one)
