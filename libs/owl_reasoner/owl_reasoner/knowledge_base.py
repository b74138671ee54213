"""An ontology in memory: what is asserted, what follows from it, and why.

The asserted axioms change at once with `add` and `remove`; what follows is brought up to date by
`reason`, which touches only what depends on the changes. Asserted and derived facts are kept apart:
a derived fact never becomes an assertion. Nothing here is thread-safe; a caller that shares a
`KnowledgeBase` locks it.

    kb = KnowledgeBase(iri, read_ontology(path, iri).axioms)
    kb.reason()
    kb.instances(iri + '#URGENT')
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

from owl_reasoner.memory import uncollected
from owl_reasoner.owl.assertions import Assertions, Unsettled, is_assertion
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    Annotation,
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    EquivalentClasses,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of, renamed
from owl_reasoner.owl.expressions import ClassExpression, Literal
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.absence import Absence, Absences
from owl_reasoner.reasoner.answers import Unknown
from owl_reasoner.reasoner.budget import Budget, Cancel, Progress, ReasoningBudgetError
from owl_reasoner.reasoner.clauses import Fact as StoredFact
from owl_reasoner.reasoner.clauses import Predicate
from owl_reasoner.reasoner.consequence_based.classification import Classification
from owl_reasoner.reasoner.engine import BY_CASES, Engine, FactView, is_public
from owl_reasoner.reasoner.explanation import Explanation, Reasons
from owl_reasoner.reasoner.horn_completeness import Completion
from owl_reasoner.reasoner.hypertableau.entailment import entails
from owl_reasoner.reasoner.program_change import ProgramChange, program_change


@dataclass(frozen=True)
class Changes:
    """What one batch of assertions, or one `reason`, changed.

    Attributes:
        sequence: Number of this batch, counted from 1 without gaps.
        added: Pairs (axiom, derived).
        removed: Pairs (axiom, derived).
        consistent: Whether the ontology was consistent when last reasoned over.
    """

    sequence: int
    added: tuple[tuple[Axiom, bool], ...]
    removed: tuple[tuple[Axiom, bool], ...]
    consistent: bool


class Feed:
    """The subscribers, and what they were told last."""

    def __init__(self) -> None:
        self._subscribers: list[Callable[[Changes], None]] = []
        self._sequence = 0
        self._consistent = True
        # What is shown, kept only where the engine's log of an update cannot tell what was shown
        # before it: after a contradiction, and while individuals are known to be the same.
        self._shown: set[Axiom] | None = None

    def __bool__(self) -> bool:
        return bool(self._subscribers)

    def subscribe(
        self, callback: Callable[[Changes], None], engine: Engine | None
    ) -> Callable[[], None]:
        """Add a subscriber; return a function that takes it off again."""
        if not self._subscribers:
            self._show(engine)
        self._subscribers.append(callback)

        def unsubscribe() -> None:
            if callback in self._subscribers:
                self._subscribers.remove(callback)

        return unsubscribe

    def asserted(self, added: Iterable[Axiom], removed: Iterable[Axiom]) -> None:
        """Tell of one batch of assertions."""
        self._tell([(axiom, False) for axiom in added], [(axiom, False) for axiom in removed])

    def shown_by(self, engine: Engine | None) -> set[Axiom]:
        """Return what subscribers know of derived facts, before `engine` is given up."""
        return visible(engine) if self._shown is None else self._shown

    def given_up(self, engine: Engine | None) -> None:
        """Remember what subscribers know, where `engine` and what it shows is given up."""
        self._shown = self.shown_by(engine)

    def replaced(self, before: set[Axiom], engine: Engine) -> None:
        """Tell what a new engine shows that the old one did not, and the reverse."""
        after = self._show(engine)
        self._derived(engine, after - before, before - after)

    def updating(self, engine: Engine, update: Callable[[], None]) -> None:
        """Run an engine's update and tell what it changed.

        Where the update ends with an error nobody is told anything: what was shown before it is
        remembered until another engine shows something.
        """
        before = self._shown
        log: dict[StoredFact, bool] = {}
        engine.changed, engine.renamed = log, False
        view = FactView(engine)
        try:
            update()
        except BaseException:
            self._shown = _before(engine, view, log) if before is None else before
            raise
        finally:
            engine.changed = None
        if before is not None or engine.renamed or not engine.consistent:
            if before is None:
                before = _before(engine, view, log)
            self.replaced(before, engine)
            return
        come: list[Axiom] = []
        gone: list[Axiom] = []
        for fact, was_derived in log.items():
            if is_public(fact[0]):
                is_derived = fact[0].holds(fact) and fact not in engine.asserted
                if is_derived and not was_derived:
                    come += view.public(fact, {})
                elif was_derived and not is_derived:
                    gone += view.public(fact, {})
        self._derived(engine, come, gone)

    def _show(self, engine: Engine | None) -> set[Axiom]:
        shown = visible(engine)
        special = engine is not None and (not engine.consistent or bool(engine.equality.members))
        self._shown = shown if special else None
        return shown

    def _derived(self, engine: Engine, come: Iterable[Axiom], gone: Iterable[Axiom]) -> None:
        come, gone = dict.fromkeys(come), dict.fromkeys(gone)
        # Where a predicate was made anew, its facts went and came.
        added = [(axiom, True) for axiom in come if axiom not in gone]
        removed = [(axiom, True) for axiom in gone if axiom not in come]
        if added or removed or self._consistent != engine.consistent:
            self._consistent = engine.consistent
            self._tell(added, removed)

    def _tell(self, added: list[tuple[Axiom, bool]], removed: list[tuple[Axiom, bool]]) -> None:
        self._sequence += 1
        changes = Changes(self._sequence, tuple(added), tuple(removed), self._consistent)
        for callback in tuple(self._subscribers):
            callback(changes)


def justify(
    axioms: Iterable[Axiom],
    goal: Axiom | None,
    likely: Iterable[Axiom],
    schema: Iterable[Axiom],
    assumed: tuple[Axiom, ...] = (),
    until: float = math.inf,
    budget: Budget | None = None,
) -> tuple[Axiom, ...]:
    """Return a smallest set of axioms from which a goal follows (Junker, "QuickXplain", AAAI 2004).

    Args:
        axioms: Where to look.
        goal: A fact; None for a contradiction.
        likely: Axioms that a proof uses; with the schema they are tried first.
        schema: The axioms that are not about individuals.
        assumed: Axioms that are there in any case.
        until: Time by the budget's clock after which axioms that are not needed may be left in.
        budget: What all reasoning for it may use.

    Raises:
        ReasoningBudgetError: A limit of the budget was passed.
    """
    fixed, budget = list(assumed), budget or Budget()

    def enough(chosen: Iterable[Axiom]) -> bool:
        return follows((*fixed, *chosen), goal, budget)

    declared = [axiom for axiom in schema if isinstance(axiom, Declaration)]
    used = list(dict.fromkeys(axiom for axiom in likely if axiom not in fixed))
    fixed += declared
    choices = (used, list(dict.fromkeys([*used, *schema])), list(dict.fromkeys(axioms)))
    for choice in choices:
        candidates = [a for a in choice if not isinstance(a, Declaration | Annotation)]
        if enough(candidates):
            fixed = list(assumed)
            if not enough(candidates):
                candidates = [*declared, *candidates]
            return tuple(_fewest(candidates, enough, lambda: budget.now() > until))
    return ()


def follows(axioms: Iterable[Axiom], goal: Axiom | None, budget: Budget | None = None) -> bool:
    """Tell whether a fact, or with None a contradiction, follows from axioms.

    Raises:
        ReasoningBudgetError: A limit of the budget was passed.
    """
    axioms = list(axioms)
    found = entails(axioms, goal, budget)
    if not isinstance(found, Unknown):
        return found
    # What follows for everything follows for an individual that no axiom names.
    asked = () if goal is None else entities_of(goal)
    kb = KnowledgeBase('', [*axioms, *(Declaration(kind, name) for kind, name in asked)])
    consistent = kb._reason_within(budget or Budget())
    return not consistent if goal is None else consistent and kb.holds(goal)


def _fewest(
    candidates: list[Axiom],
    follows: Callable[[Iterable[Axiom]], bool],
    is_late: Callable[[], bool],
) -> list[Axiom]:
    """Return the candidates without those that are not needed, as far as the time allows."""

    def narrow(known: list[Axiom], changed: bool, rest: list[Axiom]) -> list[Axiom]:
        if changed and follows(known):
            return []
        if len(rest) == 1 or is_late():
            return rest
        middle = len(rest) // 2
        first, second = rest[:middle], rest[middle:]
        later = narrow([*known, *first], bool(first), second)
        earlier = narrow([*known, *later], bool(later), first)
        return [*earlier, *later]

    return narrow([], True, candidates) if candidates else []


def visible(engine: Engine | None) -> set[Axiom]:
    """Return the derived facts that queries show: none while there is a contradiction."""
    if engine is None or not engine.consistent:
        return set()
    return set(FactView(engine).derived())


def _before(engine: Engine, view: FactView, log: dict[StoredFact, bool]) -> set[Axiom]:
    """Return the derived facts before an update that began with every individual under its own
    name.
    """
    now = {fact for fact in view.stored() if fact not in engine.asserted and fact not in log}
    now.update(fact for fact, was_derived in log.items() if was_derived)
    return {axiom for fact in now if is_public(fact[0]) for axiom in view.public(fact, {})}


MOST_SEARCHED = 500
"""Axioms about classes and properties among which a name like a mistyped one is looked for."""

Fact: TypeAlias = ClassAssertion | ObjectPropertyAssertion | DataPropertyAssertion | SameIndividual


class KnowledgeBase:
    """The assertions of one ontology and the facts derived from them.

    Queries answer from what is asserted now together with what was derived by the last `reason`; a
    value whose assertion was retracted is never returned. When the last `reason` found a
    contradiction, queries answer from the assertions alone. Individuals, classes and properties are
    full IRIs.

    Args:
        iri: The ontology's IRI.
        axioms: The first assertions.
        clock: A steady clock, in seconds.

    Attributes:
        iri: The ontology's IRI.
        classified: How often the classes were put in order; tells whether `subclasses` may have
            changed.
        patience: Seconds after which `explain` looks no further for axioms that it can do without.
    """

    def __init__(
        self,
        iri: str,
        axioms: Iterable[Axiom] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.iri = iri
        self._clock, self._budget = clock, Budget(clock)
        self.classified = 0
        self.patience = math.inf
        self._told = Assertions()
        self._classification: Classification | None = None
        self._engine: Engine | None = None
        self._completion: Completion | None = None
        self._consistent = True
        self._snapshots: dict[str, frozenset[str]] = {}
        self._watched: set[Predicate] = set()
        self._feed = Feed()
        self._interrupted = False
        # The axiom since which reasoning takes cases, where one alone was added.
        self._costly: Axiom | None = None
        for axiom in axioms:
            self._told.insert(axiom)

    # --- asserted axioms ---

    def axioms(self) -> Iterator[Axiom]:
        """Return the asserted axioms, oldest first."""
        return iter(tuple(self._told.axioms))

    def __contains__(self, axiom: object) -> bool:
        return axiom in self._told.axioms

    def __len__(self) -> int:
        return len(self._told.axioms)

    def axioms_about(self, entity: str) -> Iterator[Axiom]:
        """Return the asserted axioms that mention an entity in any role."""
        return iter(tuple(self._told.mentioning(entity)))

    def asserted_values(self, prop: str, individual: str) -> Iterable[Literal]:
        """Return the values asserted now for a data property of an individual, as they are
        written.
        """
        return tuple(
            axiom.literal
            for axiom in self._told.mentioning(individual)
            if type(axiom) is DataPropertyAssertion
            and axiom.prop == prop
            and axiom.subject == individual
        )

    def asserted_objects(self, prop: str, individual: str) -> Iterable[str]:
        """Return what an individual is asserted to be related to by an object property."""
        return tuple(
            axiom.object
            for axiom in self._told.mentioning(individual)
            if type(axiom) is ObjectPropertyAssertion
            and axiom.prop == prop
            and axiom.subject == individual
        )

    def is_known(self, kind: str, iri: str) -> bool:
        """Tell whether an asserted axiom declares or uses the entity as this kind."""
        return any((kind, iri) in entities_of(axiom) for axiom in self._told.mentioning(iri))

    def schema_names(self, kind: str) -> list[str]:
        """Return the classes or properties of an ontology that has few; none of a large one."""
        schema = self._told.schema
        if len(schema) > MOST_SEARCHED:
            return []
        return list(
            dict.fromkeys(iri for axiom in schema for k, iri in entities_of(axiom) if k == kind)
        )

    # --- the last reasoning ---

    @property
    def consistent(self) -> bool:
        """Whether the last `reason` found no contradiction."""
        return self._consistent

    @property
    def consistency(self) -> bool | Unknown:
        """What the last `reason` found out: False where there is a contradiction, True where
        there is none, Unknown where it found none and left out something.
        """
        if not self._consistent:
            return False
        if self._engine is None or self._completion is None:
            return Unknown(('nothing was reasoned over',))
        left_out = self._completion.unsupported
        return Unknown(left_out) if left_out else True

    @property
    def cost(self) -> str:
        """One sentence on what makes each change cost a search by cases, and how long the last one
        took; '' where none is needed.
        """
        completion = self._completion
        if completion is None or not completion.seconds:
            return ''
        takes = f'reasoning by cases takes {completion.seconds:.2g} s with each change'
        if self._costly is None:
            return f'{takes}, by {completion.cause()}'
        return f'{takes} since there is {axiom_text(self._costly)}'

    @property
    def stale(self) -> bool:
        """Whether assertions changed since the last `reason` that completed."""
        if self._interrupted:
            return True
        return bool(self._told.added or self._told.removed or self._told.schema_changed)

    @property
    def unsupported(self) -> tuple[str, ...]:
        """One sentence for each asserted axiom (or part) that the reasoner does not fully use.

        As of the last `reason`: what is outside its fragment, and what depends on whether
        individuals are the same that are neither known to be the same nor to be different. None
        after a contradiction, from which everything follows.
        """
        if self._completion is None or not self._consistent:
            return ()
        return self._completion.unsupported

    # --- queries ---

    @property
    def _usable(self) -> Engine | None:
        """The engine, where what it derived may be shown."""
        return self._engine if self._consistent else None

    def instances(self, cls: str) -> frozenset[str]:
        """Return individuals of a class, direct and indirect."""
        pending = self._told.added or self._told.removed
        engine = self._usable
        if not pending and cls in self._snapshots and engine and not engine.equality.members:
            return self._snapshots[cls]
        if engine is None:
            return frozenset(
                axiom.individual
                for axiom in self._told.mentioning(cls)
                if isinstance(axiom, ClassAssertion) and axiom.cls == cls
            )
        if cls == THING:
            return frozenset(name for name in self._told.about if self.is_known('individual', name))
        known = engine.program.classes.get(cls)
        if known is None:
            found = frozenset[str]()
        else:
            found = frozenset(known.members)
            if engine.equality.members:
                found = frozenset(name for one in found for name in engine.equality.same(one))
        if not pending:
            if known is not None and not engine.equality.members:
                self._keep_snapshot(known, found)
            return found
        gone = {
            a.individual
            for a in self._told.removed
            if isinstance(a, ClassAssertion) and a.cls == cls
        }
        come = {
            a.individual for a in self._told.added if isinstance(a, ClassAssertion) and a.cls == cls
        }
        return (found - gone) | come

    def _keep_snapshot(self, predicate: Predicate, members: frozenset[str]) -> None:
        """Remember the instances until one comes or goes."""
        cls, snapshots = predicate.name, self._snapshots

        def forget(_: str) -> None:
            snapshots.pop(cls, None)

        if predicate not in self._watched:
            self._watched.add(predicate)
            predicate.on_insert.append(forget)
            predicate.on_delete.append(forget)
        snapshots[cls] = members

    def types(self, individual: str) -> set[str]:
        """Named classes of an individual, direct and indirect, without owl:Thing."""
        about = [a for a in self._told.mentioning(individual) if isinstance(a, ClassAssertion)]
        found = {a.cls for a in about if isinstance(a.cls, str) and a.individual == individual}
        engine = self._usable
        if engine is not None:
            representative = engine.equality.find(individual)
            gone = {
                a.cls
                for a in self._told.removed
                if isinstance(a, ClassAssertion) and a.individual == individual
            }
            for cls, predicate in engine.program.classes.items():
                if representative in predicate.members and cls not in gone:
                    found.add(cls)
        found.discard(THING)
        return found

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, direct and indirect: as of the last `reason`, and what is
        asserted now to be below those.
        """
        known = self._classification
        if known is None:
            return set()
        found = self._classes() if cls == THING else known.subclasses(cls)
        if known.within and cls != THING:
            found.update(name for name in known.within if cls in self.superclasses(name))
        if self._told.schema_changed or cls == THING:
            found |= self._asserted_below(found | {cls})
        return found - {cls}

    def _classes(self) -> set[str]:
        """Named classes in the hierarchy, and those that only individuals are said to be of."""
        assert self._classification is not None
        found = set(self._classification.classes())
        # The engine knows every class that was asserted when it last reasoned.
        named = {*(self._engine.program.classes if self._engine else ())}
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

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above, direct and indirect, as of the last `reason`."""
        known, engine = self._classification, self._usable
        if known is None:
            return set()
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

    def object_values(self, prop: str, individual: str) -> set[str]:
        """Return what an individual is related to by an object property."""
        engine = self._usable
        known = None if engine is None else engine.program.objects.get(prop)
        if engine is None or known is None or self._told.added:
            found = set(self.asserted_objects(prop, individual))
            if engine is None or known is None:
                return found
        else:
            found = set()
        if engine.equality.members:
            representative = engine.equality.find(individual)
            for value in known.succ.get(representative, ()):
                found.update(engine.equality.same(value))
        else:
            found.update(known.succ.get(individual, ()))
        for axiom in self._told.removed:
            if (
                type(axiom) is ObjectPropertyAssertion
                and axiom.prop == prop
                and axiom.subject == individual
            ):
                found.discard(axiom.object)
        return found

    def data_values(self, prop: str, individual: str) -> set[Literal]:
        """Return values of a data property: asserted ones as written, derived ones in one form for
        each value.
        """
        engine = self._usable
        if engine is None:
            return set(self.asserted_values(prop, individual))
        found: set[Literal] = set()
        for name in engine.equality.same(individual):
            found.update(self.asserted_values(prop, name))
        known = engine.program.datas.get(prop)
        if known is None:
            return found
        representative = engine.equality.find(individual)
        stored = known.succ.get(representative)
        if stored:
            covered = {engine.value(literal) for literal in found}
            view = FactView(engine)
            for value in stored:
                if value not in covered and (known, representative, value) not in engine.asserted:
                    found.add(view.literal(value))
        return found

    def object_properties_of(self, individual: str) -> set[str]:
        """Return object properties with at least one value for the individual."""
        derived = self._engine.program.objects if self._engine else ()
        names = {*derived, *self._props(individual, ObjectPropertyAssertion)}
        return {name for name in names if self.object_values(name, individual)}

    def data_properties_of(self, individual: str) -> set[str]:
        """Return data properties with at least one value for the individual."""
        derived = self._engine.program.datas if self._engine else ()
        names = {*derived, *self._props(individual, DataPropertyAssertion)}
        return {name for name in names if self.data_values(name, individual)}

    def _props(self, individual: str, kind: type[Any]) -> set[str]:
        return {a.prop for a in self._told.mentioning(individual) if isinstance(a, kind)}

    def equivalents(self, cls: str) -> list[ClassExpression]:
        """Return the other sides of the asserted equivalences that have the class as one side."""
        return [
            other
            for axiom in self._told.mentioning(cls)
            if isinstance(axiom, EquivalentClasses) and cls in axiom.classes
            for other in axiom.classes
            if other != cls
        ]

    def facts(self, derived: bool = True) -> Iterator[Fact]:
        """Yield every fact about individuals; the asserted ones alone when `derived` is False."""
        stated = (ClassAssertion, ObjectPropertyAssertion, DataPropertyAssertion, SameIndividual)
        for axiom in tuple(self._told.axioms):
            if isinstance(axiom, stated):
                yield axiom
        if derived:
            yield from self.derived_facts()

    def derived_facts(self) -> Iterator[Fact]:
        """Yield the facts about individuals that follow and are not asserted."""
        engine, told = self._usable, self._told
        if engine is None:
            return
        if not self.stale and not engine.equality.members:
            yield from FactView(engine).derived()  # type: ignore[misc]
            return
        for axiom in visible(engine):
            if axiom not in told.removed and axiom not in told.axioms:
                yield axiom  # type: ignore[misc]

    def holds(self, fact: Axiom) -> bool:
        """Tell whether a fact is asserted or was derived: what `explain` explains."""
        if fact in self._told.axioms:
            return True
        engine = self._usable
        if engine is None or fact in self._told.removed:
            return False
        if isinstance(fact, SubClassOf):
            if isinstance(fact.sub, str) and isinstance(fact.sup, str):
                return self._is_below(fact.sub, fact.sup)
            return False
        if isinstance(fact, ClassAssertion) and fact.cls == THING:
            return self.is_known('individual', fact.individual)
        if engine.understands(fact) and engine.holds(fact):
            return True
        if isinstance(fact, DifferentIndividuals) and self._completion is not None:
            return self._completion.entails(self._told.axioms, fact)
        return False

    def _is_below(self, sub: str, sup: str) -> bool:
        if sup == NOTHING:
            known = self._classification
            return known is not None and known.is_impossible(sub)
        return sup in (sub, THING, *self.superclasses(sub))

    def entails(
        self, axiom: Axiom, timeout: float = math.inf, cancel: Cancel | None = None
    ) -> bool | Unknown:
        """Tell whether an axiom of any kind follows from what is asserted now.

        Unlike `holds` it searches a model without the axiom, which takes longer.

        Returns:
            Unknown, which has no truth value, where something is left out that the answer may
            depend on.

        Raises:
            UnsupportedError: The axiom is a key, a rule, a datatype definition or about anonymous
                individuals, or compares data properties.
        """
        self._budget.begin(timeout, cancel)
        try:
            return self.holds(axiom) or entails(self._told.axioms, axiom, self._budget)
        finally:
            self._budget.finish()

    def explain(
        self,
        fact: Axiom,
        timeout: float = math.inf,
        cancel: Cancel | None = None,
        *,
        memory: float = math.inf,
        steps: float = math.inf,
    ) -> Explanation | None:
        """Return why a fact holds; None when it is neither asserted nor derived.

        A fact is a class, property, same- or different-individuals assertion, or a subclass axiom
        between named classes. The limits are those of `reason`; what is derived stays.

        Raises:
            ReasoningBudgetError: A limit was passed, or `cancel` said so.
        """
        if fact in self._told.axioms:
            return Explanation(axiom_text(fact), 'asserted', axioms=(fact,))
        with self._limited(timeout, cancel, memory, steps):
            if self._usable is None or not self.holds(fact):
                return None
            return self._explained(fact)

    def explain_inconsistency(
        self,
        timeout: float = math.inf,
        cancel: Cancel | None = None,
        *,
        memory: float = math.inf,
        steps: float = math.inf,
    ) -> Explanation | None:
        """Return why the ontology contradicts itself; None where the last `reason` found it does
        not.

        Raises:
            ReasoningBudgetError: A limit, as of `reason`, was passed, or `cancel` said so.
        """
        if self._engine is None or self._consistent:
            return None
        with self._limited(timeout, cancel, memory, steps):
            return self._explained(None)

    @contextmanager
    def _limited(
        self, timeout: float, cancel: Cancel | None, memory: float, steps: float
    ) -> Iterator[None]:
        """Apply limits to all that reasons inside of the context."""
        self._budget.begin(timeout, cancel, None, memory, steps)
        try:
            yield
        finally:
            self._budget.finish()

    def explain_absence(self, fact: Axiom) -> Absence | None:
        """Return what a class or property assertion that does not hold lacks; None where it holds,
        or nothing was reasoned yet.
        """
        engine = self._usable
        if engine is None or self.holds(fact):
            return None
        return Absences(engine).of_fact(fact)

    def _explained(self, goal: Axiom | None) -> Explanation:
        """Return an explanation that rests on no more axioms than it needs, and on all of them."""
        text = 'the ontology is inconsistent' if goal is None else axiom_text(goal)
        proof = self._proof(goal, self._schema_axioms)
        needed, fewest = self._justified(goal, proof)
        if proof is not None and not set(proof.sources()) <= set(needed):
            alone = KnowledgeBase(self.iri, needed)
            alone._reason_within(self._budget)
            proof = alone._proof(goal, alone._schema_axioms)
        if proof is None or proof.because == BY_CASES:
            return self._listed(text, needed, fewest)
        sources = proof.sources()
        return replace(proof, background=tuple(a for a in needed if a not in sources))

    def _proof(
        self, goal: Axiom | None, schema_axioms: Callable[..., tuple[Axiom, ...]]
    ) -> Explanation | None:
        """Return the steps by which the engine derived a fact; with None a contradiction."""
        assert self._engine is not None
        if isinstance(goal, SubClassOf):
            return None
        reasons = Reasons(self._engine, schema_axioms)
        return reasons.of_inconsistency() if goal is None else reasons.of_fact(goal)

    def justification(
        self,
        fact: Axiom | None,
        timeout: float = math.inf,
        cancel: Cancel | None = None,
        *,
        memory: float = math.inf,
        steps: float = math.inf,
    ) -> tuple[Axiom, ...]:
        """Return the fewest asserted axioms to which a fact is owed: without any of them it would
        not follow from the others.

        Args:
            fact: As for `explain`; None asks for a contradiction.
            timeout, cancel, memory, steps: The limits, as of `reason`.

        Returns:
            The axioms; none where the fact does not hold. Once `patience` has passed, there may be
            more than it needs.

        Raises:
            ReasoningBudgetError: A limit was passed, or `cancel` said so.
        """
        if fact in self._told.axioms:
            return (fact,)
        with self._limited(timeout, cancel, memory, steps):
            holds = not self.consistent if fact is None else self.holds(fact)
            if not holds or self._engine is None:
                return ()
            return self._justified(fact, self._proof(fact, lambda *_: ()))[0]

    def _justified(
        self, goal: Axiom | None, proof: Explanation | None
    ) -> tuple[tuple[Axiom, ...], bool]:
        """Return the axioms to which a fact is owed, and whether they are the fewest."""
        until = self._clock() + self.patience
        likely = proof.sources() if proof else ()
        needed = justify(
            self._told.axioms, goal, likely, self._told.schema, (), until, self._budget
        )
        return needed, self._clock() <= until

    def _schema_axioms(self, assumed: tuple[Axiom, ...], goal: Axiom | None) -> tuple[Axiom, ...]:
        """Return the axioms about classes and properties by which assumptions imply something."""
        schema = self._told.schema
        found = justify([*schema, *assumed], goal, (), schema, assumed, budget=self._budget)
        return tuple(axiom for axiom in found if axiom not in assumed)

    def _listed(self, text: str, axioms: tuple[Axiom, ...], fewest: bool) -> Explanation:
        because = 'these axioms together' + ('' if fewest else ', perhaps not all of them')
        parts = tuple(Explanation(axiom_text(a), 'asserted', axioms=(a,)) for a in axioms)
        return Explanation(text, 'axiom', because, parts, axioms=axioms)

    # --- changes ---

    def add(self, axiom: Axiom) -> bool:
        """Assert an axiom; return False when it was asserted already."""
        return bool(self.change((axiom,)))

    def remove(self, axiom: Axiom) -> bool:
        """Retract an axiom; return False when it was not asserted."""
        return bool(self.change((), (axiom,)))

    def change(self, added: Iterable[Axiom] = (), removed: Iterable[Axiom] = ()) -> int:
        """Retract `removed`, then assert `added`, as one batch; return the number of axioms that
        changed.
        """
        gone = [axiom for axiom in removed if self._told.discard(axiom)]
        come = [axiom for axiom in added if self._told.insert(axiom)]
        if self._feed and (gone or come):
            self._feed.asserted(come, gone)
        return len(gone) + len(come)

    def rename(self, kind: str, old: str, new: str) -> int:
        """Give an entity another IRI in every asserted axiom; merge with `new` where that exists.

        Returns:
            The number of axioms rewritten.
        """
        roles = {(kind, old), ('annotated', old)}
        affected = [axiom for axiom in self.axioms_about(old) if roles & set(entities_of(axiom))]
        self.change([renamed(axiom, kind, old, new) for axiom in affected], affected)
        return len(affected)

    def remove_entity(self, kind: str, iri: str) -> int:
        """Retract every axiom that mentions the entity; a set of (different, same) individuals
        shrinks instead.

        Returns:
            The number of axioms removed or shrunk.
        """
        affected = [axiom for axiom in self.axioms_about(iri) if (kind, iri) in entities_of(axiom)]
        shrunk: list[Axiom] = []
        for axiom in affected:
            if kind == 'individual' and isinstance(axiom, (DifferentIndividuals, SameIndividual)):
                rest = axiom.individuals - {iri}
                if len(rest) > 1:
                    shrunk.append(replace(axiom, individuals=rest))
        if kind == 'individual':
            affected += [
                axiom
                for axiom in self.axioms_about(iri)
                if ('annotated', iri) in entities_of(axiom) and axiom not in affected
            ]
        self.change(shrunk, affected)
        return len(affected)

    # --- reasoning ---

    def reason(
        self,
        timeout: float = math.inf,
        cancel: Cancel | None = None,
        progress: Callable[[Progress], None] | None = None,
        *,
        memory: float = math.inf,
        steps: float = math.inf,
    ) -> bool:
        """Bring what is derived up to date; return whether the ontology is consistent.

        A reasoning that ends early leaves the assertions as they are, what changed among them
        included, and gives up what had been derived: queries answer from the assertions alone
        until `reason` completes, and subscribers are told nothing. `revert` takes back what
        changed since the last `reason` that completed; the next one then takes as long as the
        ontology took when it was new.

        Args:
            timeout: Seconds after which to end, by the knowledge base's clock.
            cancel: An event, or a function, that tells whether to end; asked from this thread.
            progress: Called about ten times a second.
            memory: Bytes by which the process may grow; looked at on Linux alone.
            steps: Units of work after which to end, each of about a microsecond. The same work
                takes the same number on every machine.

        Raises:
            ReasoningBudgetError: A limit was passed, or `cancel` said so; it names the axiom or
                rule at work. With `memory` as limit, also where the system gave none.
        """
        changes, before = self._told.unsettled(), self._engine
        budget = self._budget
        budget.begin(timeout, cancel, progress, memory, steps)
        try:
            took_cases = self._completion is not None and self._completion.seconds > 0
            self._bring_up_to_date()
            self._note_cost(changes, took_cases)
            self._told.settle()
            self._interrupted = False
            return self._consistent
        except BaseException as error:
            where = budget.at_work() or budget.stage
            self._give_up_derived(before, changes)
            if isinstance(error, MemoryError):
                message = 'reasoning took all memory that there is'
                raise ReasoningBudgetError('memory', message, where) from None
            raise
        finally:
            budget.finish()

    def _reason_within(self, budget: Budget) -> bool:
        """Reason for the first time, within limits that somebody else applies."""
        self._budget = budget
        self._bring_up_to_date()
        return self._consistent

    def _give_up_derived(self, before: Engine | None, changes: Unsettled) -> None:
        """Forget an engine that an error left in the middle of its work."""
        if self._feed:
            self._feed.given_up(before)
        self._engine = self._completion = self._classification = None
        self._interrupted = True
        self._snapshots.clear()
        self._watched.clear()
        self._told.unsettle(changes)

    def _note_cost(self, changes: Unsettled, took_cases: bool) -> None:
        """Note the axiom by which reasoning came to take cases."""
        if self._completion is None or not self._completion.seconds:
            self._costly = None
        elif not took_cases and self._completion.seconds:
            said = [one for one in changes.schema_added if not isinstance(one, Declaration)]
            self._costly = said[0] if len(said) == 1 else None

    def revert(self) -> int:
        """Take back every change since the last `reason` that completed.

        Returns:
            The number of axioms that changed.
        """
        changes = self._told.unsettled()
        come, gone = (
            (*changes.schema_added, *changes.added),
            (
                *changes.schema_removed,
                *changes.removed,
            ),
        )
        return self.change(gone, come)

    def _bring_up_to_date(self) -> None:
        engine, told = self._engine, self._told
        if engine is None or told.schema_changed or not self._fits(engine):
            self._classify()
            change = self._change_of(engine)
            if engine is not None and change is not None:
                self._completion = self._completion_of(engine)
                self._update(engine, partial(self._adopt, engine, change))
            else:
                self._rebuild(engine)
        elif told.added or told.removed:
            added, removed = told.settle()
            if self._completion is not None:
                self._completion.expect(added, removed)
            self._update(engine, partial(engine.update, added, removed))

    def _fits(self, engine: Engine) -> bool:
        """Tell whether the program was made for every complex class and negated property that was
        added, and for none that went.
        """
        told = self._told
        if not all(map(engine.takes, told.added)):
            return False
        classes, negated = Engine.needs_of(told.removed)
        if not classes and not negated:
            return True
        left = Engine.needs_of(told.complex)
        return set(classes) <= set(left[0]) and set(negated) <= set(left[1])

    def _classify(self) -> None:
        self.classified += 1
        needs = Engine.needs_of(self._told.complex)
        self._classification = Classification(self._told.schema, *needs, self._budget)

    def _change_of(self, engine: Engine | None) -> ProgramChange | None:
        """Return what an engine needs for the new classification; None: it must be made anew."""
        if engine is None or not engine.consistent or engine.equality.members:
            return None
        assert self._classification is not None
        return program_change(engine.program, self._classification.program)

    def _update(self, engine: Engine, update: Callable[[], None]) -> None:
        assert self._completion is not None
        completion = self._completion

        def complete() -> None:
            update()
            completion.run(self._told.axioms)

        if self._feed:
            self._feed.updating(engine, complete)
        else:
            complete()
        self._consistent = engine.consistent

    def _completion_of(self, engine: Engine) -> Completion:
        assert self._classification is not None
        return Completion(self._classification, engine, tuple(self._told.schema))

    def _adopt(self, engine: Engine, change: ProgramChange) -> None:
        added, removed = self._told.settle()
        engine.update((), removed)
        engine.adopt(change)
        engine.update(added, ())
        self._snapshots.clear()

    def _rebuild(self, old: Engine | None) -> None:
        before = self._feed.shown_by(old) if self._feed else set()
        assert self._classification is not None
        engine = self._engine = Engine(self._classification.program, self._told, self._budget)
        if old is not None:
            engine.take_spelling(old)
        self._told.settle()
        assertions = [axiom for axiom in self._told.axioms if is_assertion(axiom)]
        self._completion = self._completion_of(engine)
        with uncollected():
            engine.update(assertions, ())
            self._completion.run(self._told.axioms)
        self._consistent = engine.consistent
        self._snapshots.clear()
        self._watched.clear()
        if self._feed:
            self._feed.replaced(before, engine)

    def give_up(self, part: int = 500) -> Iterator[None]:
        """Let go of everything, some entries with each step; afterwards it can be used no more.

        The memory of a large ontology, given back at once, would stop all threads for long.
        """
        owners: list[Any] = [self._told]
        if self._engine is not None:
            owners += [self._engine, *self._engine.program.predicates()]
        for owner in owners:
            names = getattr(owner, '__slots__', None) or vars(owner)
            for held in [getattr(owner, name) for name in names]:
                while isinstance(held, dict | set) and held:
                    take = held.popitem if isinstance(held, dict) else held.pop
                    for _ in range(min(part, len(held))):
                        take()
                    yield

    # --- whoever listens ---

    def subscribe(self, callback: Callable[[Changes], None]) -> Callable[[], None]:
        """Call back once per batch of assertions and once per `reason` that changed derived facts.

        Returns:
            A function that ends the subscription.
        """
        return self._feed.subscribe(callback, self._engine)

    def copy(self) -> KnowledgeBase:
        """Another knowledge base with the same assertions, nothing derived and no subscribers."""
        return KnowledgeBase(self.iri, self._told.axioms, self._clock)
