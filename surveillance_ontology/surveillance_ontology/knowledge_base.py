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

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

from surveillance_ontology.axiom_text import axiom_text
from surveillance_ontology.axioms import (
    THING,
    Assertion,
    Axiom,
    ClassAssertion,
    ClassExpression,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    EquivalentClasses,
    Literal,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
    entities_of,
    roles_of,
)
from surveillance_ontology.explanation import Explanation
from surveillance_ontology.reasoner.clauses import Fact as StoredFact
from surveillance_ontology.reasoner.clauses import Predicate
from surveillance_ontology.reasoner.engine import Engine
from surveillance_ontology.reasoner.reasons import Reasons
from surveillance_ontology.reasoner.schema import Schema
from surveillance_ontology.reasoner.view import FactView, is_public

Fact: TypeAlias = ClassAssertion | ObjectPropertyAssertion | DataPropertyAssertion | SameIndividual


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


class KnowledgeBase:
    """Asserted axioms of one ontology and the facts derived from them.

    Queries answer from what is asserted now together with what was derived by the last `reason`; a
    value whose assertion was retracted is never returned. When the last `reason` found a
    contradiction, queries answer from the assertions alone. Individuals, classes and properties are
    full IRIs.

    Args:
        iri: The ontology's IRI.
        axioms: The first assertions.
    """

    def __init__(self, iri: str, axioms: Iterable[Axiom] = ()) -> None:
        self.iri = iri
        self._axioms: dict[Axiom, None] = {}
        self._about: dict[str, dict[Axiom, None]] = {}
        self._added: dict[Axiom, None] = {}
        self._removed: dict[Axiom, None] = {}
        self._engine: Engine | None = None
        self._schema_changed = True
        self._consistent = True
        self._subscribers: list[Callable[[Changes], None]] = []
        self._sequence = 0
        self._schema: Schema | None = None
        self._told_consistent = True
        self._shown: set[Axiom] | None = None
        self._snapshots: dict[str, frozenset[str]] = {}
        self._watched: set[Predicate] = set()
        self._literals: dict[tuple[str, str], dict[Literal, None]] = {}
        for axiom in axioms:
            self._assert(axiom)

    # --- asserted axioms ---

    def add(self, axiom: Axiom) -> bool:
        """Asserts an axiom; False when it was asserted already."""
        if not self._assert(axiom):
            return False
        if self._subscribers:
            self._publish(((axiom, False),), ())
        return True

    def remove(self, axiom: Axiom) -> bool:
        """Retracts an axiom; False when it was not asserted."""
        if not self._retract(axiom):
            return False
        if self._subscribers:
            self._publish((), ((axiom, False),))
        return True

    def change(self, added: Iterable[Axiom] = (), removed: Iterable[Axiom] = ()) -> int:
        """Retracts `removed`, then asserts `added`, as one batch; the number of axioms that
        changed.
        """
        gone = [(axiom, False) for axiom in removed if self._retract(axiom)]
        come = [(axiom, False) for axiom in added if self._assert(axiom)]
        if self._subscribers and (gone or come):
            self._publish(tuple(come), tuple(gone))
        return len(gone) + len(come)

    def _assert(self, axiom: Axiom) -> bool:
        if axiom in self._axioms:
            return False
        self._axioms[axiom] = None
        for entity in _mentioned(axiom):
            mentions = self._about.get(entity)
            if mentions is None:
                self._about[entity] = {axiom: None}
            else:
                mentions[axiom] = None
        if type(axiom) is DataPropertyAssertion:
            self._literals.setdefault((axiom.prop, axiom.subject), {})[axiom.literal] = None
        if _is_assertion(axiom):
            if axiom in self._removed:
                del self._removed[axiom]
            else:
                self._added[axiom] = None
        elif _is_schema(axiom):
            self._schema_changed = True
        return True

    def _retract(self, axiom: Axiom) -> bool:
        if axiom not in self._axioms:
            return False
        del self._axioms[axiom]
        for entity in _mentioned(axiom):
            mentions = self._about.get(entity)
            if mentions is not None:
                mentions.pop(axiom, None)
                if not mentions:
                    del self._about[entity]
        if type(axiom) is DataPropertyAssertion:
            written = self._literals[axiom.prop, axiom.subject]
            del written[axiom.literal]
            if not written:
                del self._literals[axiom.prop, axiom.subject]
        if _is_assertion(axiom):
            if axiom in self._added:
                del self._added[axiom]
            else:
                self._removed[axiom] = None
        elif _is_schema(axiom):
            self._schema_changed = True
        return True

    def axioms(self) -> Iterator[Axiom]:
        """The asserted axioms, oldest first."""
        return iter(tuple(self._axioms))

    def __contains__(self, axiom: object) -> bool:
        return axiom in self._axioms

    def __len__(self) -> int:
        return len(self._axioms)

    def axioms_about(self, entity: str) -> Iterator[Axiom]:
        """The asserted axioms that mention an entity in any role."""
        return iter(tuple(self._about.get(entity, ())))

    def is_known(self, kind: str, iri: str) -> bool:
        """Whether an asserted axiom declares or uses the entity as this kind."""
        return any((kind, iri) in entities_of(axiom) for axiom in self._about.get(iri, ()))

    def rename(self, kind: str, old: str, new: str) -> int:
        """Gives an entity another IRI in every asserted axiom; merges with `new` where that exists.

        Returns:
            The number of axioms rewritten.
        """
        roles = {(kind, old), ('annotated', old)}
        affected = [axiom for axiom in self.axioms_about(old) if roles & set(entities_of(axiom))]
        self.change([renamed(axiom, kind, old, new) for axiom in affected], affected)
        return len(affected)

    def remove_entity(self, kind: str, iri: str) -> int:
        """Retracts every axiom that mentions the entity; a set of (different, same) individuals
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

    def reason(self) -> bool:
        """Brings what is derived up to date; whether the ontology is consistent."""
        engine = self._engine
        if engine is None or self._schema_changed or not self._fits(engine):
            before = self._shown if self._shown is not None else set[Axiom]()
            if self._subscribers and self._shown is None:
                before = set(self._visible())
            self._rebuild()
            if self._subscribers:
                after = self._show()
                self._report(after - before, before - after)
        elif self._added or self._removed:
            self._update(engine)
        return self._consistent

    def _fits(self, engine: Engine) -> bool:
        """Whether the program knows every complex class and negated property that was added."""
        return all(engine.understands(axiom) for axiom in self._added)

    def _rebuild(self) -> Engine:
        axioms = tuple(self._axioms)
        assertions = [axiom for axiom in axioms if _is_assertion(axiom)]
        self._schema = Schema(axioms, *Engine.needs_of(assertions))
        engine = Engine(self._schema.program, lambda name: self._about.get(name, ()))
        if self._engine is not None:
            engine.take_spelling(self._engine)
        self._engine = engine
        self._schema_changed = False
        self._added.clear()
        self._removed.clear()
        engine.update(assertions, ())
        self._consistent = engine.consistent
        self._snapshots.clear()
        self._watched.clear()
        return engine

    def _update(self, engine: Engine) -> None:
        added, removed = tuple(self._added), tuple(self._removed)
        self._added.clear()
        self._removed.clear()
        if not self._subscribers:
            engine.update(added, removed)
            self._consistent = engine.consistent
            return
        view = FactView(engine)
        before = self._shown
        log: dict[StoredFact, bool] = {}
        engine.changed, engine.renamed = log, False
        engine.update(added, removed)
        engine.changed = None
        self._consistent = engine.consistent
        if before is not None or engine.renamed or not engine.consistent:
            if before is None:
                before = self._before(engine, view, log)
            after = self._show()
            self._report(after - before, before - after)
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
        self._report(come, gone)

    def _visible(self) -> Iterator[Axiom]:
        """Derived facts that queries show."""
        if self._engine is not None and self._consistent:
            yield from FactView(self._engine).derived()

    def _show(self) -> set[Axiom]:
        """The derived facts now; kept where the next change cannot be told from the engine's log
        alone.
        """
        visible = set(self._visible())
        engine = self._engine
        special = engine is not None and (not self._consistent or bool(engine.equality.members))
        self._shown = visible if special else None
        return visible

    def _before(self, engine: Engine, view: FactView, log: dict[StoredFact, bool]) -> set[Axiom]:
        """The derived facts before an update that began with every individual under its own name."""
        now = {fact for fact in view.stored() if fact not in engine.asserted and fact not in log}
        now.update(fact for fact, was_derived in log.items() if was_derived)
        return {axiom for fact in now if is_public(fact[0]) for axiom in view.public(fact, {})}

    def _report(self, come: Iterable[Axiom], gone: Iterable[Axiom]) -> None:
        added = tuple((axiom, True) for axiom in come)
        removed = tuple((axiom, True) for axiom in gone)
        if added or removed or self._told_consistent != self._consistent:
            self._told_consistent = self._consistent
            self._publish(added, removed)

    def recompute(self) -> bool:
        """Forgets what is derived and derives it again from nothing; whether the ontology is
        consistent.
        """
        self._schema_changed = True
        return self.reason()

    @property
    def consistent(self) -> bool:
        """Whether the last `reason` found no contradiction."""
        return self._consistent

    @property
    def stale(self) -> bool:
        """Whether assertions changed since the last `reason`."""
        return bool(self._added or self._removed or self._schema_changed)

    @property
    def unsupported(self) -> tuple[str, ...]:
        """One sentence for each asserted axiom (or part) that the reasoner does not use, as of
        `reason`.
        """
        return () if self._schema is None else tuple(self._schema.program.unsupported)

    # --- queries ---

    @property
    def _usable(self) -> Engine | None:
        """The engine, where what it derived may be shown."""
        return self._engine if self._consistent else None

    def instances(self, cls: str) -> frozenset[str]:
        """Individuals of a class, direct and indirect."""
        pending = self._added or self._removed
        if not pending and cls in self._snapshots and self._consistent:
            return self._snapshots[cls]
        engine = self._usable
        if engine is None:
            return frozenset(
                axiom.individual
                for axiom in self._about.get(cls, ())
                if isinstance(axiom, ClassAssertion) and axiom.cls == cls
            )
        if cls == THING:
            return frozenset(name for name in self._about if self.is_known('individual', name))
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
            a.individual for a in self._removed if isinstance(a, ClassAssertion) and a.cls == cls
        }
        come = {a.individual for a in self._added if isinstance(a, ClassAssertion) and a.cls == cls}
        return (found - gone) | come

    def _keep_snapshot(self, predicate: Predicate, members: frozenset[str]) -> None:
        """Remembers the instances until one comes or goes."""
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
        about = [a for a in self._about.get(individual, ()) if isinstance(a, ClassAssertion)]
        found = {a.cls for a in about if isinstance(a.cls, str) and a.individual == individual}
        engine = self._usable
        if engine is not None:
            representative = engine.equality.find(individual)
            gone = {a.cls for a in self._removed if isinstance(a, ClassAssertion)} & {
                a.cls
                for a in self._removed
                if isinstance(a, ClassAssertion) and a.individual == individual
            }
            for cls, predicate in engine.program.classes.items():
                if representative in predicate.members and cls not in gone:
                    found.add(cls)
        found.discard(THING)
        return found

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, direct and indirect, as of the last `reason`."""
        if self._schema is None:
            return set()
        if cls == THING:
            return self._schema.classes()
        return self._schema.subclasses(cls)

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above, direct and indirect, as of the last `reason`."""
        return set() if self._schema is None else self._schema.superclasses(cls)

    def object_values(self, prop: str, individual: str) -> set[str]:
        """What an individual is related to by an object property."""
        engine = self._usable
        known = None if engine is None else engine.program.objects.get(prop)
        if engine is None or known is None or self._added:
            found = {
                axiom.object
                for axiom in self._about.get(individual, ())
                if type(axiom) is ObjectPropertyAssertion
                and axiom.prop == prop
                and axiom.subject == individual
            }
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
        for axiom in self._removed:
            if type(axiom) is ObjectPropertyAssertion and axiom.prop == prop:
                if axiom.subject == individual:
                    found.discard(axiom.object)
        return found

    def data_values(self, prop: str, individual: str) -> set[Literal]:
        """Values of a data property: asserted ones as written, derived ones in one form for each
        value.
        """
        engine = self._usable
        if engine is None:
            return set(self._literals.get((prop, individual), ()))
        found: set[Literal] = set()
        for name in engine.equality.same(individual):
            found.update(self._literals.get((prop, name), ()))
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
        """Object properties with at least one value for the individual."""
        names = {
            axiom.prop
            for axiom in self._about.get(individual, ())
            if isinstance(axiom, ObjectPropertyAssertion)
        }
        if self._engine is not None:
            names.update(self._engine.program.objects)
        return {name for name in names if self.object_values(name, individual)}

    def data_properties_of(self, individual: str) -> set[str]:
        """Data properties with at least one value for the individual."""
        names = {
            axiom.prop
            for axiom in self._about.get(individual, ())
            if isinstance(axiom, DataPropertyAssertion)
        }
        if self._engine is not None:
            names.update(self._engine.program.datas)
        return {name for name in names if self.data_values(name, individual)}

    def equivalents(self, cls: str) -> list[ClassExpression]:
        """The other sides of the asserted equivalences that have the class as one side."""
        return [
            other
            for axiom in self._about.get(cls, ())
            if isinstance(axiom, EquivalentClasses) and cls in axiom.classes
            for other in axiom.classes
            if other != cls
        ]

    def facts(self, derived: bool = True) -> Iterator[Fact]:
        """Every fact about individuals; the asserted ones alone when `derived` is False."""
        stated = (ClassAssertion, ObjectPropertyAssertion, DataPropertyAssertion, SameIndividual)
        for axiom in tuple(self._axioms):
            if isinstance(axiom, stated):
                yield axiom
        if derived:
            for axiom in self._visible():
                if axiom not in self._removed and axiom not in self._axioms:
                    yield axiom  # type: ignore[misc]

    def explain(self, fact: Axiom) -> Explanation | None:
        """Why a fact holds; None when it is neither asserted nor derived.

        A fact is a class, property, same- or different-individuals assertion, or a subclass axiom
        between named classes.
        """
        if fact in self._axioms:
            return Explanation(axiom_text(fact), 'asserted')
        engine = self._usable
        if engine is None or fact in self._removed:
            return None
        if isinstance(fact, SubClassOf):
            if fact.sup in self.superclasses(str(fact.sub)):
                return Explanation(axiom_text(fact), 'axiom', 'the class hierarchy')
            return None
        if not engine.understands(fact):
            return None
        return Reasons(engine).of_fact(fact)

    def explain_inconsistency(self) -> Explanation | None:
        """Why the ontology contradicts itself; None when the last `reason` found no contradiction."""
        if self._engine is None or self._consistent:
            return None
        return Reasons(self._engine).of_inconsistency()

    # --- changes ---

    def subscribe(self, callback: Callable[[Changes], None]) -> Callable[[], None]:
        """Calls back once per batch of assertions and once per `reason` that changed derived facts.

        Returns:
            A function that ends the subscription.
        """
        if not self._subscribers:
            self._show()
        self._subscribers.append(callback)

        def unsubscribe() -> None:
            if callback in self._subscribers:
                self._subscribers.remove(callback)

        return unsubscribe

    def _publish(
        self, added: tuple[tuple[Axiom, bool], ...], removed: tuple[tuple[Axiom, bool], ...]
    ) -> None:
        self._sequence += 1
        changes = Changes(self._sequence, added, removed, self._consistent)
        for callback in tuple(self._subscribers):
            callback(changes)

    def copy(self) -> KnowledgeBase:
        """Another knowledge base with the same assertions, nothing derived yet and no subscribers."""
        return KnowledgeBase(self.iri, self._axioms)


def _mentioned(axiom: Axiom) -> Iterable[str]:
    kind = type(axiom)
    if kind is DataPropertyAssertion:
        return (axiom.prop, axiom.subject)  # type: ignore[attr-defined]
    if kind is ObjectPropertyAssertion:
        return (axiom.prop, axiom.subject, axiom.object)  # type: ignore[attr-defined]
    if kind is DifferentIndividuals or kind is SameIndividual:
        return axiom.individuals  # type: ignore[attr-defined, no-any-return]
    return {iri for _, iri in entities_of(axiom)}


def _is_assertion(axiom: Axiom) -> bool:
    """Whether an axiom is about individuals; the declaration of one is."""
    if isinstance(axiom, Declaration):
        return axiom.kind == 'individual'
    return isinstance(axiom, Assertion)


def _is_schema(axiom: Axiom) -> bool:
    if isinstance(axiom, SubClassOf):
        return axiom.sup != THING
    return not isinstance(axiom, Declaration)


def renamed(axiom: Axiom, kind: str, old: str, new: str) -> Axiom:
    """The axiom with an entity's IRI replaced wherever it stands for an entity of that kind."""
    rewritten = _renamed(axiom, kind, old, new)
    assert isinstance(rewritten, Axiom)
    return rewritten


def _renamed(record: object, kind: str, old: str, new: str) -> object:
    if isinstance(record, Declaration):
        return Declaration(kind, new) if (record.kind, record.iri) == (kind, old) else record
    fields: dict[str, object] = {}
    for name, role in roles_of(type(record)):
        value = getattr(record, name)
        accepted = role in (kind, 'annotated')
        if isinstance(value, str):
            changed: object = new if value == old and accepted else value
        elif isinstance(value, frozenset):
            changed = frozenset(new if part == old and accepted else part for part in value)
        elif isinstance(value, tuple) and name not in ('annotations', 'facets'):
            changed = tuple(_renamed_part(part, accepted, kind, old, new) for part in value)
        else:
            changed = _renamed_part(value, False, kind, old, new)
        if changed is not value:
            fields[name] = changed
    return replace(record, **fields) if fields else record  # type: ignore[type-var]


def _renamed_part(part: object, accepted: bool, kind: str, old: str, new: str) -> object:
    if isinstance(part, str):
        return new if part == old and accepted else part
    if hasattr(type(part), '__dataclass_fields__') and type(part).__name__ not in (
        'Literal',
        'Variable',
    ):
        return _renamed(part, kind, old, new)
    return part
