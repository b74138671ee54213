"""The incremental engine: facts come in, what follows is added; facts go, what no longer follows is
taken away.

Additions run semi-naively: every new fact is joined with what is there. Removals run backwards and
forwards: what a vanished fact supported is a candidate; a candidate with another proof from the
assertions stays; the rest goes, and what can be derived again from what is left comes back. So a
fact derived in several ways survives the loss of one, and a change is followed no further than it
reaches.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from functools import partial
from itertools import combinations

from owl_reasoner.owl.assertions import Assertions, is_assertion
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    ObjectPropertyAssertion,
    SameIndividual,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import NOTHING, local_name
from owl_reasoner.reasoner.assertion_reader import AssertionReader
from owl_reasoner.reasoner.budget import Budget
from owl_reasoner.reasoner.clauses import AtMost, Fact, Predicate, Premises, Program
from owl_reasoner.reasoner.datatypes import Value, literal_of
from owl_reasoner.reasoner.equality import Conflicts, Equality, Merge, individuals_in
from owl_reasoner.reasoner.inequality import Inequality
from owl_reasoner.reasoner.join_network import JoinNetwork
from owl_reasoner.reasoner.program_change import ProgramChange
from owl_reasoner.reasoner.proofs import ProofSearch

Classes = Mapping[str, Iterable[str]]
_MOST_VALUES = 20_000
_FACTS_A_LOOK = 64
"""Facts between two looks at the limits."""
LONGEST = 100_000
"""The characters or digits of the longest value that rules make."""
_LONGEST_BITS = LONGEST * 10 // 3
BY_CASES = 'every case leads to it'
"""The origin of facts that reasoning by cases found."""


class _CaseFacts:
    """Facts that reasoning by cases found: they rest on no premise, but hold for a time alone."""

    def __init__(self) -> None:
        # Until the next update, and until `release`.
        self.passing: set[Fact] = set()
        self.lasting: set[Fact] = set()
        self._released: list[Fact] = []
        self._supported: set[Predicate] = set()
        self.mark = Predicate('class', 'found by cases'), NOTHING
        """The premise of every merge that cases found: when it goes, the merges go."""

    def take(self, facts: Iterable[Fact], lasting: bool = False) -> None:
        """Have facts hold without a premise."""
        for fact in facts:
            if fact[0] not in self._supported:
                self._supported.add(fact[0])
                fact[0].supports.append((self._supports(fact[0]), BY_CASES))
            (self.lasting if lasting else self.passing).add(fact)

    def release(self) -> None:
        """Have the next update take back what lasts."""
        self._released += self.lasting
        self.lasting.clear()

    def over(self) -> list[Fact]:
        """Take the facts whose time is over."""
        found = [*self.passing, *self._released]
        self.passing.clear()
        self._released.clear()
        return found

    def _supports(self, predicate: Predicate) -> Callable[..., Iterator[Premises]]:
        def supports(*arguments: object) -> Iterator[Premises]:
            fact = (predicate, *arguments)
            if fact in self.passing or fact in self.lasting:
                yield ()

        return supports


class Engine:
    """Keeps the consequences of a program and a changing set of assertions.

    Large because insertion, deletion and merging of individuals share one queue and its order.

    Facts are stored under the name of the individual that represents all individuals known to be
    the same. A class of equal individuals is split as soon as anything that could have justified
    it goes; its members' assertions are then stated again under their own names, and what still
    makes them equal merges them again.

    Args:
        program: What to run; its predicates hold the facts and belong to this engine.
        told: The axioms that are asserted (as of the current `update`).
        budget: What an update may use. The error by which it ends an update leaves the engine
            unusable.

    Attributes:
        equality: Who stands for whom.
        inequality: Who is known to be different.
        reader: Reads assertions as facts.
        asserted: How many assertions state each fact.
        conflicts: Merges of individuals that are different.
        proofs: Searches why a fact holds.
        cases: What reasoning by cases found.
        changed: Where a log of one update is wanted: facts that came, went or changed their
            standing, with whether they were derived (and not asserted) before.
        renamed: Whether an individual came to stand for another, or ceased to, since this was
            reset.
    """

    def __init__(self, program: Program, told: Assertions, budget: Budget | None = None) -> None:
        self.program = program
        self.budget = budget or Budget()
        self.told = told
        self.equality = Equality()
        self.reader = AssertionReader(program, self.equality)
        self.inequality = Inequality(program)
        self.asserted: dict[Fact, int] = {}
        # What is still to be added, and candidates for removal. The hooks of predicates append to
        # both.
        self._queue: list[Fact] = []
        self._overdeleted: list[Fact] = []
        self._requests: dict[Merge, None] = {}
        self.conflicts = Conflicts()
        # Individuals whose difference from others may have changed: looked at after the facts, as
        # several facts of one change touch the same ones.
        self._touched: dict[str, None] = {}
        # Who stands for individuals that are the same because others differ, which may be over.
        self._doubtful: dict[str, None] = {}
        self._removed: dict[Fact, None] = {}
        self._split_happened = False
        # The forward part of backward/forward deletion (Motik, Nenov, Piro and Horrocks,
        # "Incremental update of datalog materialisation", AAAI 2015): a candidate with a proof is
        # not taken away, and nothing that rests on it is looked at.
        self.proofs = ProofSearch(self.asserted)
        self.cases = _CaseFacts()
        self.changed: dict[Fact, bool] | None = None
        self.renamed = False
        self._network = JoinNetwork(
            program,
            self.equality.representative,
            self.inequality,
            self._queue.append,
            self._overdeleted.append,
            self._insert_now,
            self._request,
            self.budget.due,
            partial(_looker, self.budget),
        )
        self._nothing = program.nothing
        self._nothing.supports.append((self._conflict_supports, 'one individual, yet different'))
        program.same.supports.append((self._same_supports, None))
        for index in self._network.thresholds:
            index.proves = self.proofs.proves
        self._flushes = [index.flush for index in self._network.thresholds]
        for predicate in dict.fromkeys(program.predicates()):
            self._attach_touching(predicate)
        for fire in self._network.initial:
            fire()

    @property
    def consistent(self) -> bool:
        """Whether no contradiction is derived."""
        return not self._nothing.members

    def holds(self, axiom: Axiom) -> bool:
        """Tell whether an assertion was derived or is asserted."""
        if isinstance(axiom, SameIndividual):
            return len({self.equality.find(name) for name in axiom.individuals}) == 1
        if isinstance(axiom, DifferentIndividuals):
            names = sorted(self.equality.find(name) for name in axiom.individuals)
            return all(self.inequality.different(*pair) for pair in combinations(names, 2))
        fact = self.reader.fact_of(axiom)
        return fact is not None and bool(fact[0].holds(fact))

    @property
    def network(self) -> JoinNetwork:
        """What runs the program."""
        return self._network

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

    def _related_by_difference(self, individuals: Iterable[str]) -> dict[str, None]:
        """Return the individuals and those whose difference from others may rest on theirs."""
        found = dict.fromkeys(individuals)
        pending = list(found) if self._network.touch_related else []
        while pending:
            one = pending.pop()
            for related in self._network.touch_related:
                for other in related(one):
                    if other not in found:
                        found[other] = None
                        pending.append(other)
        return found

    def _touch_before_removal(self, *individuals: str) -> None:
        related = self._related_by_difference(individuals)
        for one in related:
            for touch in self._network.touch_delete:
                touch(one)
            self._doubtful.update(dict.fromkeys(self.equality.resting_on_difference(one)))
        for merge in self._conflicts_about(related):
            self._withdraw_conflict(merge)

    # --- single facts ---

    def _assert(self, fact: Fact) -> None:
        asserted = self.asserted
        count = asserted.get(fact, 0)
        asserted[fact] = count + 1
        if not count:
            if self.changed is not None:
                self.changed.setdefault(fact, fact[0].holds(fact))
            self._queue.append(fact)

    def _enter(self) -> list[Fact]:
        """Have the queued facts hold, so that what they support stays when others go.

        Returns:
            Those that did not hold; nothing was derived from them yet.
        """
        fresh = []
        for fact in self._queue:
            if not fact[0].holds(fact):
                fact[0].insert(fact)
                fresh.append(fact)
        self._queue.clear()
        return fresh

    def _unassert(self, fact: Fact) -> None:
        count = self.asserted.get(fact, 0)
        if count > 1:
            self.asserted[fact] = count - 1
        elif count:
            del self.asserted[fact]
            if self.changed is not None:
                self.changed.setdefault(fact, False)
            self._overdeleted.append(fact)

    def _take(self, fact: Fact) -> None:
        predicate, arguments = fact[0], fact[1:]
        for fire in predicate.on_delete:
            fire(*arguments)
        predicate.discard(fact)
        self._removed[fact] = None
        if self.changed is not None:
            self.changed.setdefault(fact, True)
        for merge in self._conflicts_about(individuals_in(fact)):
            if fact in map(self.equality.current, merge.premises):
                self._withdraw_conflict(merge)

    def _follows(self, fact: Fact) -> bool:
        """Tell whether one step derives a fact from what holds."""
        for support, _ in fact[0].supports:
            for premises in support(*fact[1:]):
                if all(self._holds(premise) for premise in premises):
                    return True
        return False

    def _holds(self, fact: Fact) -> bool:
        if fact[0] is self.program.different:
            return self.inequality.different(fact[1], fact[2])
        if fact[0] is self.program.same:
            return bool(self.conflicts.between(fact[1], fact[2]))
        holds: bool = fact[0].holds(fact)
        return holds

    # --- individuals that must be the same ---

    def _request(self, x: str, y: str, origin: Axiom | None, premises: Premises) -> None:
        self._requests[Merge(x, y, origin, premises)] = None

    def _conflicts_about(self, individuals: Iterable[str]) -> list[Merge]:
        """Return the conflicts that mention individuals under one of their names."""
        if not self.conflicts:
            return []
        members = self.equality.members
        return self.conflicts.mentioning(
            name for one in individuals for name in (one, *members.get(one, ()))
        )

    def _withdraw_conflict(self, merge: Merge, again: bool = True) -> None:
        self.conflicts.discard(merge)
        self._overdeleted.append((self._nothing, self.equality.find(merge.first)))
        if again:
            self._requests[merge] = None

    def _conflict_supports(self, x: str) -> Iterator[Premises]:
        find = self.equality.find
        for merge in self._conflicts_about((x,)):
            if find(merge.first) == x:
                different = (self.program.different, x, find(merge.second))
                yield ((self.program.same, merge.first, merge.second), different)

    def _same_supports(self, first: str, second: str) -> Iterator[Premises]:
        for merge in self.conflicts.between(first, second):
            yield tuple(map(self.equality.current, merge.premises))

    def _state_same(self, axiom: SameIndividual) -> None:
        first, *others = sorted(axiom.individuals)
        for other in others:
            self._requests[Merge(first, other, axiom, ())] = None

    def _run_requests(self) -> None:
        pending = tuple(self._requests)
        self._requests.clear()
        equality, merged = self.equality, False
        filled = _filled(self.program) if pending else []  # Merging takes facts away and adds none.
        for merge in pending:
            self.budget.tick()
            origin = merge.origin
            if isinstance(origin, SameIndividual) and origin not in self.told.axioms:
                continue
            x, y = equality.find(merge.first), equality.find(merge.second)
            if x == y:
                continue
            if not all(self._holds(self.equality.current(fact)) for fact in merge.premises):
                for ask in self._network.merging:  # By other premises they may still be.
                    ask(x, y)
                continue
            if self.inequality.different(x, y):
                self.conflicts.add(merge)
                self._queue.append((self._nothing, x))
                continue
            self._merge(merge, filled)
            merged = True
        if merged:
            self._after_merges()

    def _merge(self, merge: Merge, filled: list[Predicate]) -> None:
        self.renamed = True
        kept, gone = self.equality.join(merge)
        self.inequality.merge(kept, self.equality.members[kept])
        self.inequality.denied.add(kept)
        moved = list(_facts_about(gone, filled))
        for fact in moved:
            for fire in fact[0].on_delete:
                fire(*fact[1:])
            fact[0].discard(fact)
            if self.changed is not None:
                self.changed.setdefault(fact, fact not in self.asserted)
            self._queue.append(fact)
        self._touched[kept] = None

    def _after_merges(self) -> None:
        """Put the queued facts under the names of the representatives."""
        # Nothing ceased to hold: what the removal hooks named holds of the representative.
        self._overdeleted.clear()
        self._doubtful.clear()
        for place, fact in enumerate(self._queue):
            current = self.equality.current(fact)
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

    def _split(self, representative: str, fresh: list[Fact]) -> None:
        """Take away everything about a class of individuals, and state its members' assertions
        again.
        """
        if representative not in self.equality.members:
            return
        self.renamed = self._split_happened = True
        self._touch_before_removal(representative)
        facts = list(_facts_about(representative, _filled(self.program)))
        for fact in facts:
            if self.asserted.pop(fact, None) and self.changed is not None:
                self.changed.setdefault(fact, False)
        others: dict[str, None] = {}
        for fact in facts:
            others.update(dict.fromkeys(self.equality.dependents(fact)))
            self._take(fact)
        members = self.equality.split(representative)
        self.inequality.split(representative)
        self.inequality.denied |= members
        for merge in self.conflicts.mentioning(members):
            self._overdeleted.append((self._nothing, representative))
            self._withdraw_conflict(merge)
        self.proofs.reset()
        axioms: dict[Axiom, None] = {}
        for member in sorted(members):
            self._touched[member] = None
            for axiom in self.told.mentioning(member):
                if is_assertion(axiom):
                    axioms[axiom] = None
        for axiom in axioms:
            if isinstance(axiom, SameIndividual):
                self._state_same(axiom)
            stated = self.reader.fact_of(axiom)
            if stated is not None and not members.isdisjoint(individuals_in(stated)):
                self._assert(stated)
            if self.program.uses_thing:
                for individual in individuals_of(axiom) & members:
                    self._assert((self.program.thing, individual))
        fresh += self._enter()
        for other in others:
            self._split(other, fresh)

    # --- updates ---

    def update(self, added: Iterable[Axiom], removed: Iterable[Axiom]) -> None:
        """Apply changed assertions and bring what follows up to date."""
        equality, uses_thing = self.equality, self.program.uses_thing
        splitting: set[str] = set()
        self.proofs.reset()
        added, removed = list(added), list(removed)
        # What cases found rests on no facts that could be followed: all of it goes, and comes back
        # where the next search finds it again.
        self._overdeleted += map(equality.current, self.cases.over())
        self._restate_differences(added, removed, splitting)
        for axiom in removed:
            if equality.members:
                splitting.update(self._classes_of(axiom))
            if isinstance(axiom, SameIndividual):
                for merge in self.conflicts.mentioning(axiom.individuals):
                    if merge.origin == axiom:
                        self._withdraw_conflict(merge, again=False)
            fact = self.reader.fact_of(axiom)
            if fact is not None:
                self._unassert(fact)
            if uses_thing:
                for individual in individuals_of(axiom):
                    self._unassert((self.program.thing, equality.find(individual)))
        for axiom in added:
            if type(axiom) is SameIndividual:
                self._state_same(axiom)
            fact = self.reader.fact_of(axiom)
            if fact is not None:
                self._assert(fact)
            if uses_thing:
                for individual in individuals_of(axiom):
                    self._assert((self.program.thing, equality.find(individual)))
        # Removal comes before addition, but the new assertions hold by then (`_enter`): a clock
        # that is set retracts one value and asserts another, and what both support never goes.
        if self._overdeleted or splitting or self._doubtful:
            self._replace(splitting)
        # It is worked off from its end: in the order of the assertions, then.
        self._queue.reverse()
        self._propagate()
        if removed:
            self.reader.forget_values(self.asserted)
        else:
            self.reader.keep_values()

    def _replace(self, splitting: Iterable[str]) -> None:
        """Take away what went, and split classes of equal individuals, once new assertions hold."""
        fresh = self._enter()
        for representative in splitting:
            self._split(representative, fresh)
        for fact in fresh:
            for early in fact[0].early:
                early(*fact[1:])
        self._overdelete(fresh)
        for fact in fresh:
            if fact[0].holds(fact):
                for fire in fact[0].on_insert:
                    fire(*fact[1:])

    def adopt(self, change: ProgramChange) -> None:
        """Run another program on the facts that are there; nobody may be the same as another."""
        program, network = self.program, self._network
        self.proofs.reset()
        for clause in change.removed:
            network.instances(clause, holding=True)
        for clause in change.removed:
            network.detach(clause)
        for clause in change.added:
            network.attach(clause)
        kept = {id(limit) for limit in change.limits}
        for counter in [one for one in network.counters if id(one.condition) not in kept]:
            network.counters.remove(counter)
            self._touch_before_removal(*counter.succ)
            counter.detach()
        for first, second in change.joined:
            self._touch_before_removal(*first.members, *second.members)
            first.disjoint.discard(second)
            second.disjoint.discard(first)
        self._overdelete([])
        change.apply(program)
        for pair in change.parted:
            self._part(*pair)
        known = {id(one.condition) for one in network.counters}
        for limit in change.limits:
            if id(limit) not in known:
                self._limit(limit)
        for clause in change.added:
            network.instances(clause, holding=False)
        self._propagate()

    def _limit(self, condition: AtMost) -> None:
        """Run an upper bound on the facts that are there."""
        counter = self._network.limit(condition)
        for predicate in (counter.prop, counter.label, counter.filler):
            if predicate is not None:
                self._attach_touching(predicate)
        self._touched.update(dict.fromkeys(counter.succ))
        for x in tuple(counter.succ):
            counter.gain(x)

    def _part(self, first: Predicate, second: Predicate) -> None:
        """Run the disjointness of two classes on the facts that are there."""
        first.disjoint.add(second)
        second.disjoint.add(first)
        for one in (first, second):
            if self._network.watch_disjoint(one):
                self._attach_touching(one)
            self._touched.update(dict.fromkeys(one.members))
        self._queue += [(self._nothing, x) for x in first.members if x in second.members]

    def take_from_cases(self, facts: Iterable[Axiom] | None, lasting: bool = False) -> None:
        """Add facts that reasoning by cases found; they hold until the next `update`.

        Args:
            facts: Class and property assertions and who is the same; None for a contradiction.
            lasting: They hold until the update after `cases.release`; none says who is the same.
        """
        found: list[Fact] = []
        if facts is None:
            found.append((self._nothing, NOTHING))
            facts = ()
        axioms = list(facts)
        sames = [axiom for axiom in axioms if isinstance(axiom, SameIndividual)]
        if sames:
            mark = self.cases.mark
            self.cases.take((mark,))
            self._queue.append(mark)
            self._propagate()
        for same in sames:
            first, *others = sorted(same.individuals)
            for other in others:
                self._requests[Merge(first, other, None, (mark,))] = None
        self._propagate()
        # Who is the same is settled now: what else was found stands under the representatives.
        found += filter(None, map(self.reader.fact_of, axioms))
        self.cases.take(found, lasting)
        self._queue += found
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
        inequality, equality = self.inequality, self.equality
        if not gone and self._is_blank():
            # The facts come after: who is different is known when they do.
            for axiom in come:
                inequality.state(axiom)
            return
        touched: dict[str, None] = {}
        for axiom in gone:
            # A set that comes back a little larger or smaller changes only for those who joined
            # or left.
            heirs = [other.individuals for other in come]
            best = max(heirs, key=lambda heir: len(heir & axiom.individuals), default=frozenset())
            for individual in sorted(axiom.individuals - best):
                touched[equality.find(individual)] = None
        self._touch_before_removal(*touched)
        for axiom in gone:
            inequality.withdraw(axiom)
        for axiom in come:
            heirs = [other.individuals for other in gone]
            known = max(heirs, key=lambda heir: len(heir & axiom.individuals), default=frozenset())
            inequality.state(axiom)
            for individual in axiom.individuals - known:
                self._touched[equality.find(individual)] = None
        if equality.members:
            for axiom in (*gone, *come):
                splitting.update(self._classes_of(axiom))

    def _is_blank(self) -> bool:
        """Tell whether nothing holds yet, and nothing follows from differences alone."""
        held = (one.members or one.succ for one in self.program.predicates())
        return not (self.equality.members or self._network.initial or any(held))

    # --- removal ---

    def _overdelete(self, fresh: list[Fact]) -> None:
        overdeleted, asserted, proves = self._overdeleted, self.asserted, self.proofs.proves
        due = self.budget.due
        while overdeleted or self._doubtful:
            while self._doubtful:
                self._split(self._doubtful.popitem()[0], fresh)
            if not overdeleted:
                break
            fact = overdeleted.pop()
            if due():
                self.budget.count_due()
            if not fact[0].holds(fact):
                continue
            if self.equality.members:
                for representative in self.equality.dependents(fact):
                    self._split(representative, fresh)
                if not fact[0].holds(fact):
                    continue
            # DRed (Gupta, Mumick and Subrahmanian, SIGMOD 1993) would take it away with all that it
            # leads to, and derive most of that again. The proof is searched to a small depth: where
            # that is too little the fact goes, and `_settle` brings it back.
            if fact in asserted or proves(fact):
                continue
            self._take(fact)
            if self.equality.members:
                for representative in self.equality.dependents(fact):
                    self._split(representative, fresh)
        self._settle()

    def _settle(self) -> None:
        """Bring back what still follows, and let the counters look again."""
        for index in self._network.thresholds:
            index.settle()
        queue, names = self._queue, self.equality.representative
        for fact in self._removed:
            self.budget.tick()
            if names and self.equality.current(fact) != fact:
                continue
            # One step from what is left is enough: whatever needs more steps is reached by
            # propagation from those that need one.
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
        budget, left = self.budget, _FACTS_A_LOOK
        budget.stage = 'deriving facts'
        changed = self.changed
        # A built-in can make a new value of each value for ever; classes and individuals are
        # finitely many, so values are all that needs a bound.
        values_left = _MOST_VALUES + 4 * len(self.asserted)
        while True:
            while queue:
                fact = queue.pop()
                predicate = fact[0]
                left -= 1
                if left < 0:
                    left = _FACTS_A_LOOK
                    budget.at_work = partial(_reason_of, fact)
                    budget.count(_FACTS_A_LOOK)
                if len(fact) == 2:
                    x = fact[1]
                    if x in predicate.members:
                        continue
                    predicate.members[x] = None
                    if changed is not None:
                        changed.setdefault(fact, False)
                    for fire in predicate.on_insert:
                        fire(x)
                    continue
                _, x, y = fact
                succ = predicate.succ
                values = succ.get(x)
                if values is not None and y in values:
                    continue
                if predicate.kind == 'data':
                    values_left -= 1
                    if (values_left < 0 or _is_long(y)) and fact not in self.asserted:
                        self._stop_generating(predicate, values_left >= 0)
                        continue
                if values is None:
                    succ[x] = {y: None}
                else:
                    values[y] = None
                pred = predicate.pred
                subjects = pred.get(y)
                if subjects is None:
                    pred[y] = {x: None}
                else:
                    subjects[x] = None
                if changed is not None:
                    changed.setdefault(fact, False)
                for fire in predicate.on_insert:
                    fire(x, y)
            # Facts first, then merges, then differences: a merge walks all facts of an individual,
            # so it is done once for all that is known of it.
            if self._requests:
                self._run_requests()
            elif touched:
                self._run_touched()
            else:
                # Last the sorted indexes of thresholds (`threshold_rules`): they take a change of
                # many values as one.
                for flush in flushes:
                    flush()
                if not queue:
                    return

    def _insert_now(self, fact: Fact) -> None:
        """Add a fact of a property that is not there, while another fact is being added."""
        predicate, *arguments = fact
        predicate.insert(fact)
        if self.changed is not None:
            self.changed.setdefault(fact, False)
        for fire in predicate.on_insert:
            fire(*arguments)

    def _stop_generating(self, predicate: Predicate, is_long: bool) -> None:
        """End a rule that makes a new value of every value; what it made so far stays."""
        text = (
            f'the rules on {local_name(predicate.name)} make values without end:'
            f' stopped after {_MOST_VALUES} in one step'
        )
        if is_long:
            text = (
                f'the rules on {local_name(predicate.name)} make values that grow without end:'
                f' none above {LONGEST} characters or digits is kept'
            )
        if text not in self.program.unsupported:
            self.program.unsupported.append(text)

    def _run_touched(self) -> None:
        denied = self.inequality.denied
        # A map states of all its places that they differ: nobody was denied that, and nobody asks
        # again when 100,000 places come.
        pending = self._related_by_difference(self._touched) if denied else {}
        self._touched.clear()
        for one in pending:
            if one in denied:
                self.budget.tick()
                for touch in self._network.touch_insert:
                    touch(one)


def _looker(budget: Budget, origin: Axiom | None) -> Callable[[], None]:
    """Return what the joins of an axiom's clauses call to look at the limits."""
    if origin is None:
        return budget.count_due
    text = partial(axiom_text, origin)

    def look() -> None:
        budget.at_work = text
        budget.count_due()

    return look


def _reason_of(fact: Fact) -> str:
    """Return the axiom by which a fact was derived, for an error that ends its consequences."""
    for support, origin in fact[0].supports:
        if isinstance(origin, Axiom) and next(iter(support(*fact[1:])), None) is not None:
            return axiom_text(origin)
    return f'the facts of {local_name(fact[0].name)}'


def _filled(program: Program) -> list[Predicate]:
    """Return the predicates that hold of somebody."""
    predicates = dict.fromkeys(program.predicates())
    return [one for one in predicates if one.members or one.succ]


def _facts_about(individual: str, predicates: Iterable[Predicate]) -> Iterator[Fact]:
    for predicate in predicates:
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


def individuals_of(axiom: Axiom) -> set[str]:
    """Return the individuals that an axiom mentions."""
    return {name for kind, name in entities_of(axiom) if kind == 'individual'}


def _is_long(value: Value) -> bool:
    """Tell whether rules may not make a value: one that they grow would fill the memory."""
    if isinstance(value, str):
        return len(value) > LONGEST
    if isinstance(value, int):
        return value.bit_length() > _LONGEST_BITS
    if isinstance(value, Fraction):
        return value.denominator.bit_length() + value.numerator.bit_length() > _LONGEST_BITS
    return False


class FactView:
    """Reads an engine's facts."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def literal(self, value: Value) -> Literal:
        """Return a literal for a value: as some assertion writes it, else in its most general
        datatype.
        """
        return self._engine.reader.spelling.get(value) or literal_of(value)

    def public(self, fact: Fact, classes: Classes) -> Iterator[Axiom]:
        """Yield a stored fact as assertions, one for each combination of names."""
        predicate = fact[0]
        name = predicate.expression
        subjects = classes.get(fact[1]) or (fact[1],)
        if predicate.kind == 'class':
            for subject in subjects:
                yield ClassAssertion(name, subject)
        elif predicate.kind == 'data':
            for subject in subjects:
                yield DataPropertyAssertion(name, subject, self.literal(fact[2]))
        else:
            for subject in subjects:
                for target in classes.get(fact[2]) or (fact[2],):
                    yield ObjectPropertyAssertion(name, subject, target)

    def stored(self) -> Iterator[Fact]:
        """Yield every stored fact of a named class or property."""
        program = self._engine.program
        for table in (program.classes, program.objects, program.datas):
            for predicate in table.values():
                yield from predicate.facts()

    def derived(self) -> Iterator[Axiom]:
        """Yield every fact that holds and is not asserted, equality of individuals included."""
        engine = self._engine
        classes, stated = engine.equality.members, engine.told.axioms
        if not classes:
            asserted = engine.asserted
            for fact in self.stored():
                if fact not in asserted:
                    yield from self.public(fact, classes)
            return
        for fact in self.stored():
            if fact[0].kind == 'data':
                yield from self._derived_values(fact)
                continue
            for axiom in self.public(fact, classes):
                if axiom not in stated:
                    yield axiom
        for members in classes.values():
            same = SameIndividual(frozenset(members))
            if same not in stated:
                yield same

    def _derived_values(self, fact: Fact) -> Iterator[Axiom]:
        """Yield assertions of a value for the names under which no assertion gives it."""
        engine = self._engine
        predicate, representative, value = fact
        for subject in engine.equality.same(representative):
            for axiom in engine.told.mentioning(subject):
                if (
                    isinstance(axiom, DataPropertyAssertion)
                    and axiom.prop == predicate.expression
                    and axiom.subject == subject
                    and engine.reader.value(axiom.literal) == value
                ):
                    break
            else:
                yield DataPropertyAssertion(predicate.expression, subject, self.literal(value))
