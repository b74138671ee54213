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
from dataclasses import replace
from typing import Any, TypeAlias

from owl_reasoner.derivation import Derivation
from owl_reasoner.gc_control import uncollected
from owl_reasoner.justification import Justifications
from owl_reasoner.notifier import Changes, visible
from owl_reasoner.owl.assertions import Assertions
from owl_reasoner.owl.axiom_text import axiom_text
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    EquivalentClasses,
    ObjectPropertyAssertion,
    SameIndividual,
)
from owl_reasoner.owl.entities import entities_of, renamed
from owl_reasoner.owl.expressions import ClassExpression, Literal
from owl_reasoner.owl.vocabulary import THING
from owl_reasoner.reasoner.answers import Unknown
from owl_reasoner.reasoner.budget import Budget, Cancel, Progress
from owl_reasoner.reasoner.engine import FactView
from owl_reasoner.reasoner.explanation import Explanation
from owl_reasoner.reasoner.hypertableau.entailment import entails
from owl_reasoner.reasoner.non_entailment import Absence, Absences

MOST_SEARCHED = 500
"""Axioms about classes and properties among which a name like a mistyped one is looked for."""

Fact: TypeAlias = ClassAssertion | ObjectPropertyAssertion | DataPropertyAssertion | SameIndividual


class KnowledgeBase:
    """The assertions of one ontology and the facts derived from them.

    Large because it is the public face: a method a question, each short.

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
        # 100,000 axioms are no garbage: the collector would walk them again and again.
        with uncollected():
            self._told = Assertions(axioms)
        self._derived = Derivation(self._told, self._budget)
        self._justifications = Justifications(self._told, self._derived)
        self.patience = math.inf

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
        return self._told.is_known(kind, iri)

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
        return self._derived.consistent

    @property
    def consistency(self) -> bool | Unknown:
        """What the last `reason` found out: False where there is a contradiction, True where
        there is none, Unknown where it found none and left out something.
        """
        if not self._derived.consistent:
            return False
        if self._derived.engine is None or self._derived.completion is None:
            return Unknown(('nothing was reasoned over',))
        left_out = self._derived.completion.unsupported
        return Unknown(left_out) if left_out else True

    @property
    def classified(self) -> int:
        """How often the classes were put in order: tells whether `subclasses` may have changed."""
        return self._derived.classified

    @property
    def cost(self) -> str:
        """One sentence on what makes each change cost a search by cases, and how long the last one
        took; '' where none is needed.
        """
        completion = self._derived.completion
        if completion is None or not completion.seconds:
            return ''
        takes = f'reasoning by cases takes {completion.seconds:.2g} s with each change'
        if self._derived.costly is None:
            return f'{takes}, by {completion.cause()}'
        return f'{takes} since there is {axiom_text(self._derived.costly)}'

    @property
    def stale(self) -> bool:
        """Whether assertions changed since the last `reason` that completed."""
        if self._derived.interrupted:
            return True
        return bool(self._told.added or self._told.removed or self._told.schema_changed)

    @property
    def starts_anew(self) -> bool:
        """Whether the next `reason` begins from nothing: the first, and one after an early end."""
        return self._derived.engine is None

    @property
    def unsupported(self) -> tuple[str, ...]:
        """One sentence for each asserted axiom (or part) that the reasoner does not fully use.

        As of the last `reason`: what is outside its fragment, and what depends on whether
        individuals are the same that are neither known to be the same nor to be different. None
        after a contradiction, from which everything follows.
        """
        if self._derived.completion is None or not self._derived.consistent:
            return ()
        return self._derived.completion.unsupported

    # --- queries ---

    def instances(self, cls: str) -> frozenset[str]:
        """Return individuals of a class, direct and indirect."""
        pending = self._told.added or self._told.removed
        engine = self._derived.usable
        if (
            not pending
            and cls in self._derived.snapshots
            and engine
            and not engine.equality.members
        ):
            return self._derived.snapshots[cls]
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
                self._derived.keep_snapshot(known, found)
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

    def types(self, individual: str) -> set[str]:
        """Named classes of an individual, direct and indirect, without owl:Thing."""
        about = [a for a in self._told.mentioning(individual) if isinstance(a, ClassAssertion)]
        found = {a.cls for a in about if isinstance(a.cls, str) and a.individual == individual}
        engine = self._derived.usable
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
        return self._derived.subclasses(cls)

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above, direct and indirect, as of the last `reason`."""
        return self._derived.superclasses(cls)

    def object_values(self, prop: str, individual: str) -> set[str]:
        """Return what an individual is related to by an object property."""
        engine = self._derived.usable
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
        engine = self._derived.usable
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
            covered = {engine.reader.value(literal) for literal in found}
            view = FactView(engine)
            for value in stored:
                if value not in covered and (known, representative, value) not in engine.asserted:
                    found.add(view.literal(value))
        return found

    def object_properties_of(self, individual: str) -> set[str]:
        """Return object properties with at least one value for the individual."""
        derived = self._derived.engine.program.objects if self._derived.engine else ()
        names = {*derived, *self._props(individual, ObjectPropertyAssertion)}
        return {name for name in names if self.object_values(name, individual)}

    def data_properties_of(self, individual: str) -> set[str]:
        """Return data properties with at least one value for the individual."""
        derived = self._derived.engine.program.datas if self._derived.engine else ()
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
        engine, told = self._derived.usable, self._told
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
        return self._derived.holds(fact)

    def entails(
        self, axiom: Axiom, timeout: float = math.inf, cancel: Cancel | None = None
    ) -> bool | Unknown:
        """Tell whether an axiom of any kind follows from what is asserted now.

        Unlike `holds` it searches a model without the axiom, which takes longer.

        Returns:
            Unknown, which has no truth value, where something is left out that the answer may
            depend on.

        Raises:
            UnsupportedError: The axiom is a key, a rule, a datatype definition, or compares data
                properties.
        """
        self._budget.begin(timeout, cancel)
        try:
            return self._derived.holds(axiom) or entails(self._told.axioms, axiom, self._budget)
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
            if self._derived.usable is None or not self._derived.holds(fact):
                return None
            return self._justifications.explained(fact, self._clock() + self.patience)

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
        if self._derived.engine is None or self._derived.consistent:
            return None
        with self._limited(timeout, cancel, memory, steps):
            return self._justifications.explained(None, self._clock() + self.patience)

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
        engine = self._derived.usable
        if engine is None or self._derived.holds(fact):
            return None
        return Absences(engine).of_fact(fact)

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
            holds = not self.consistent if fact is None else self._derived.holds(fact)
            if not holds or self._derived.engine is None:
                return ()
            return self._justifications.fewest(fact, self._clock() + self.patience)

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
        if self._derived.notifier and (gone or come):
            self._derived.notifier.asserted(come, gone)
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
        tell: bool = True,
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
            tell: Tell subscribers what is derived where it is derived from nothing; else they ask.

        Raises:
            ReasoningBudgetError: A limit was passed, or `cancel` said so; it names the axiom or
                rule at work. With `memory` as limit, also where the system gave none.
        """
        self._budget.begin(timeout, cancel, progress, memory, steps)
        try:
            return self._derived.reason(tell)
        finally:
            self._budget.finish()

    def revert(self) -> int:
        """Take back every change since the last `reason` that completed, or since this was made.

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

    def give_up(self, part: int = 500) -> Iterator[None]:
        """Let go of everything, some entries with each step; afterwards it can be used no more.

        The memory of a large ontology, given back at once, would stop all threads for long.
        """
        owners: list[Any] = [self._told]
        engine = self._derived.engine
        if engine is not None:
            owners += [engine, engine.reader, *engine.program.predicates()]
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
        return self._derived.notifier.subscribe(callback, self._derived.engine)

    def copy(self) -> KnowledgeBase:
        """Another knowledge base with the same assertions, nothing derived and no subscribers."""
        return KnowledgeBase(self.iri, self._told.axioms, self._clock)
