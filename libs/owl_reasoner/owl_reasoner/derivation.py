"""What follows from an ontology's assertions, kept up to date as they change.

The assertions are the caller's, who changes them; here is what was derived from them, and the order
of work that brings it up to date.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from owl_reasoner.gc_control import uncollected
from owl_reasoner.notifier import Notifier
from owl_reasoner.owl.assertions import Assertions, Unsettled, is_assertion
from owl_reasoner.owl.axioms import (
    Annotation,
    Axiom,
    ClassAssertion,
    Declaration,
    DifferentIndividuals,
    Import,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import ClassExpression
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.assertion_reader import needs_of
from owl_reasoner.reasoner.budget import Budget, ReasoningBudgetError
from owl_reasoner.reasoner.case_completion import CaseCompletion
from owl_reasoner.reasoner.clauses import Predicate
from owl_reasoner.reasoner.consequence_based.classification import Classification
from owl_reasoner.reasoner.engine import Engine
from owl_reasoner.reasoner.program_change import ProgramChange, program_change


class Derivation:
    """What follows from the assertions of one ontology, as of the last `reason`.

    Three layers that build on each other: the classification (classes, consequence-based), the
    engine (facts about named individuals, forward chaining) and the completion (what needs
    individuals without names, or cases). A change of facts goes through the last two; a change of
    classes makes a new classification, and the engine takes the difference where it can.

    Args:
        told: The assertions; their changes since the last time are taken with them.
        budget: What reasoning may use.

    Attributes:
        budget: What reasoning may use.
        notifier: Who is told of changes.
        consistent: Whether no contradiction was found.
        engine, completion, classification: The layers; None: nothing was reasoned yet.
        interrupted: The last reasoning did not come to its end.
        costly: The axiom since which reasoning takes cases, where one alone was added.
        classified: How often the classes were put in order.
        snapshots: Instances of classes that were asked for, until one comes or goes.
    """

    def __init__(self, told: Assertions, budget: Budget) -> None:
        self._told, self.budget = told, budget
        self.notifier = Notifier()
        self.consistent = True
        self.engine: Engine | None = None
        self.completion: CaseCompletion | None = None
        self.classification: Classification | None = None
        self.interrupted = False
        self.costly: Axiom | None = None
        self.classified = 0
        self.snapshots: dict[str, frozenset[str]] = {}
        self._watched: set[Predicate] = set()

    @property
    def usable(self) -> Engine | None:
        """The engine, where what it derived may be shown."""
        return self.engine if self.consistent else None

    def keep_snapshot(self, predicate: Predicate, members: frozenset[str]) -> None:
        """Remember the instances until one comes or goes."""
        cls, snapshots = predicate.name, self.snapshots

        def forget(_: str) -> None:
            snapshots.pop(cls, None)

        # One hook a class, however often it is asked for: hooks stay as long as the engine.
        if predicate not in self._watched:
            self._watched.add(predicate)
            predicate.on_insert.append(forget)
            predicate.on_delete.append(forget)
        snapshots[cls] = members

    def holds(self, fact: Axiom) -> bool:
        """Tell whether a fact is asserted or was derived: what `explain` explains."""
        if fact in self._told.axioms:
            return True
        engine = self.usable
        if engine is None or fact in self._told.removed:
            return False
        if isinstance(fact, SubClassOf):
            if isinstance(fact.sub, str) and isinstance(fact.sup, str):
                return self._is_below(fact.sub, fact.sup)
            return False
        if isinstance(fact, ClassAssertion) and fact.cls == THING:
            return self._told.is_known('individual', fact.individual)
        if engine.reader.understands(fact) and engine.holds(fact):
            return True
        if isinstance(fact, DifferentIndividuals) and self.completion is not None:
            return self.completion.entails(self._told.axioms, fact)
        return False

    def _is_below(self, sub: str, sup: str) -> bool:
        known = self.classification
        if known is not None and known.is_impossible(sub):
            return True
        return sup in (sub, THING, *self.superclasses(sub))

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above, direct and indirect, as of the last `reason`."""
        known, engine = self.classification, self.usable
        if known is None:
            return set()
        if known.is_impossible(cls):
            return self._classes() - {cls, THING}
        found = known.superclasses(cls)
        if engine is not None:
            # What is one individual at most is below all that the individual belongs to.
            for name in known.within.get(cls, ()):
                representative = engine.equality.find(name)
                found.update(
                    iri
                    for iri, predicate in engine.program.classes.items()
                    if representative in predicate.members
                )
        return found - {cls}

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, direct and indirect: as of the last `reason`, and what is
        asserted now to be below those.
        """
        known = self.classification
        if known is None:
            return set()
        is_above_all = cls == THING or cls in known.superclasses(THING)
        found = self._classes() if is_above_all else known.subclasses(cls)
        if known.within and cls != THING:
            found.update(name for name in known.within if cls in self.superclasses(name))
        if self._told.schema_changed or cls == THING:
            found |= self._asserted_below(found | {cls})
        return found - {cls}

    def _classes(self) -> set[str]:
        """Named classes in the hierarchy, and those that only individuals are said to be of."""
        assert self.classification is not None
        found = set(self.classification.classes())
        # The engine knows every class that was asserted when it last reasoned.
        named = {*(self.engine.program.classes if self.engine else ())}
        named.update(
            a.cls
            for a in self._told.added
            if isinstance(a, ClassAssertion) and isinstance(a.cls, str)
        )
        for name in named - found:
            about = self._told.mentioning(name)
            if any(isinstance(a, ClassAssertion) and a.cls == name for a in about):
                found.add(name)
        for axiom in self._told.complex:
            found.update(name for kind, name in entities_of(axiom) if kind == 'class')
        return found - {NOTHING}

    def _asserted_below(self, classes: set[str]) -> set[str]:
        below: dict[ClassExpression, list[str]] = {}
        for axiom in self._told.schema:
            if isinstance(axiom, SubClassOf) and isinstance(axiom.sub, str):
                below.setdefault(axiom.sup, []).append(axiom.sub)
        found = dict.fromkeys(classes)
        pending = list(classes)
        while pending:
            for sub in below.get(pending.pop(), ()):
                if sub not in found:
                    found[sub] = None
                    pending.append(sub)
        return set(found)

    def reason(self, tell: bool = True) -> bool:
        """Bring what is derived up to date; return whether the ontology is consistent.

        Args:
            tell: Tell subscribers what a new engine shows.

        Raises:
            ReasoningBudgetError: See `KnowledgeBase.reason`; nothing is derived then.
        """
        changes, before, budget = self._told.unsettled(), self.engine, self.budget
        took_cases = self.completion is not None and self.completion.seconds > 0
        try:
            self.bring_up_to_date(tell)
        except BaseException as error:
            where = budget.at_work() or budget.stage
            self._give_up(before, changes)
            if isinstance(error, MemoryError):
                message = 'reasoning took all memory that there is'
                raise ReasoningBudgetError('memory', message, where) from None
            raise
        self._note_cost(changes, took_cases)
        self._told.settle()
        self.interrupted = False
        return self.consistent

    def bring_up_to_date(self, tell: bool = True) -> None:
        """Derive what follows now, with as little work as the change allows."""
        engine, told = self.engine, self._told
        # A change of classes is a new classification: it takes a second where the ontology is
        # large, and tells which clauses the engine's program lacks or has too many of. The facts
        # stay.
        if engine is None or told.schema_changed or not self._fits(engine):
            self._classify()
            change = self._change_of(engine)
            if engine is not None and change is not None:
                self.completion = self._completion_of(engine)
                self._update(engine, partial(self._adopt, engine, change))
            else:
                self._rebuild(engine, tell)
        elif told.added or told.removed:
            added, removed = told.settle()
            if self.completion is not None:
                self.completion.expect(added, removed)
            self._update(engine, partial(engine.update, added, removed))

    def _fits(self, engine: Engine) -> bool:
        """Tell whether the program was made for every complex class and negated property that was
        added, and for none that went.
        """
        told = self._told
        if not all(map(engine.reader.takes, told.added)):
            return False
        classes, negated = needs_of(told.removed)
        if not classes and not negated:
            return True
        left = needs_of(told.complex)
        return set(classes) <= set(left[0]) and set(negated) <= set(left[1])

    def _classify(self) -> None:
        self.classified += 1
        needs = needs_of(self._told.complex)
        self.classification = Classification(self._told.schema, *needs, self.budget)

    def _change_of(self, engine: Engine | None) -> ProgramChange | None:
        """Return what an engine needs for the new classification; None: it must be made anew."""
        if engine is None or not engine.consistent or engine.equality.members:
            return None
        assert self.classification is not None
        return program_change(engine.program, self.classification.program)

    def _update(self, engine: Engine, update: Callable[[], None]) -> None:
        assert self.completion is not None
        completion = self.completion

        def complete() -> None:
            update()
            completion.run(self._told.axioms)

        if self.notifier:
            self.notifier.updating(engine, complete)
        else:
            complete()
        self.consistent = engine.consistent

    def _completion_of(self, engine: Engine) -> CaseCompletion:
        assert self.classification is not None
        return CaseCompletion(self.classification, engine, tuple(self._told.schema))

    def _adopt(self, engine: Engine, change: ProgramChange) -> None:
        added, removed = self._told.settle()
        engine.update((), removed)
        engine.adopt(change)
        engine.update(added, ())
        self.snapshots.clear()

    def _rebuild(self, old: Engine | None, tell: bool) -> None:
        before = self.notifier.shown_by(old) if self.notifier and tell else set()
        assert self.classification is not None
        engine = self.engine = Engine(self.classification.program, self._told, self.budget)
        if old is not None:
            # A derived value keeps the form in which users saw it.
            engine.reader.take_spelling(old.reader)
        self._told.settle()
        assertions = [axiom for axiom in self._told.axioms if is_assertion(axiom)]
        self.completion = self._completion_of(engine)
        # Millions of facts come, none of them garbage: the collector would walk them again and
        # again.
        with uncollected():
            engine.update(assertions, ())
            self.completion.run(self._told.axioms)
        self.consistent = engine.consistent
        self.snapshots.clear()
        self._watched.clear()
        if not tell:
            self.notifier.began(engine)
        elif self.notifier:
            self.notifier.replaced(before, engine)

    def _give_up(self, before: Engine | None, changes: Unsettled) -> None:
        """Forget an engine that an error left in the middle of its work."""
        if self.notifier:
            self.notifier.given_up(before)
        self.engine = self.completion = self.classification = None
        self.interrupted = True
        self.snapshots.clear()
        self._watched.clear()
        self._told.unsettle(changes)

    def _note_cost(self, changes: Unsettled, took_cases: bool) -> None:
        """Note the axiom by which reasoning came to take cases."""
        if self.completion is None or not self.completion.seconds:
            self.costly = None
        elif not took_cases and self.completion.seconds:
            silent = Declaration | Import | Annotation
            said = [one for one in changes.schema_added if not isinstance(one, silent)]
            self.costly = said[0] if len(said) == 1 else None
