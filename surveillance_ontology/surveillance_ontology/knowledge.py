"""What an ontology says: what is asserted now, and what was derived from it.

Reading alone; `knowledge_base` changes and reasons.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeAlias

from surveillance_ontology.knowledge_changes import visible
from surveillance_ontology.owl.assertions import Assertions
from surveillance_ontology.owl.axiom_text import axiom_text
from surveillance_ontology.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    EquivalentClasses,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
)
from surveillance_ontology.owl.entities import entities_of
from surveillance_ontology.owl.expressions import ClassExpression, Literal
from surveillance_ontology.owl.vocabulary import THING
from surveillance_ontology.reasoner.clauses import Predicate
from surveillance_ontology.reasoner.engine import Engine
from surveillance_ontology.reasoner.explanation import Explanation
from surveillance_ontology.reasoner.reasons import Reasons
from surveillance_ontology.reasoner.schema import Schema
from surveillance_ontology.reasoner.view import FactView

Fact: TypeAlias = ClassAssertion | ObjectPropertyAssertion | DataPropertyAssertion | SameIndividual


class Knowledge:
    """The questions that the assertions of one ontology and the facts derived from them answer.

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
        self._told = Assertions()
        self._schema: Schema | None = None
        self._engine: Engine | None = None
        self._consistent = True
        self._snapshots: dict[str, frozenset[str]] = {}
        self._watched: set[Predicate] = set()
        for axiom in axioms:
            self._told.insert(axiom)

    # --- asserted axioms ---

    def axioms(self) -> Iterator[Axiom]:
        """The asserted axioms, oldest first."""
        return iter(tuple(self._told.axioms))

    def __contains__(self, axiom: object) -> bool:
        return axiom in self._told.axioms

    def __len__(self) -> int:
        return len(self._told.axioms)

    def axioms_about(self, entity: str) -> Iterator[Axiom]:
        """The asserted axioms that mention an entity in any role."""
        return iter(tuple(self._told.about.get(entity, ())))

    def asserted_values(self, prop: str, individual: str) -> Iterable[Literal]:
        """The values asserted now for a data property of an individual, as they are written."""
        return tuple(self._told.literals.get((prop, individual), ()))

    def asserted_objects(self, prop: str, individual: str) -> Iterable[str]:
        """What an individual is asserted to be related to by an object property."""
        return tuple(
            axiom.object
            for axiom in self._told.about.get(individual, ())
            if type(axiom) is ObjectPropertyAssertion
            and axiom.prop == prop
            and axiom.subject == individual
        )

    def is_known(self, kind: str, iri: str) -> bool:
        """Whether an asserted axiom declares or uses the entity as this kind."""
        return any((kind, iri) in entities_of(axiom) for axiom in self._told.about.get(iri, ()))

    # --- the last reasoning ---

    @property
    def consistent(self) -> bool:
        """Whether the last `reason` found no contradiction."""
        return self._consistent

    @property
    def stale(self) -> bool:
        """Whether assertions changed since the last `reason`."""
        return bool(self._told.added or self._told.removed or self._told.schema_changed)

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
        pending = self._told.added or self._told.removed
        if not pending and cls in self._snapshots and self._consistent:
            return self._snapshots[cls]
        engine = self._usable
        if engine is None:
            return frozenset(
                axiom.individual
                for axiom in self._told.about.get(cls, ())
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
        about = [a for a in self._told.about.get(individual, ()) if isinstance(a, ClassAssertion)]
        found = {a.cls for a in about if isinstance(a.cls, str) and a.individual == individual}
        engine = self._usable
        if engine is not None:
            representative = engine.equality.find(individual)
            gone = {a.cls for a in self._told.removed if isinstance(a, ClassAssertion)} & {
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
        """Values of a data property: asserted ones as written, derived ones in one form for each
        value.
        """
        engine = self._usable
        if engine is None:
            return set(self._told.literals.get((prop, individual), ()))
        found: set[Literal] = set()
        for name in engine.equality.same(individual):
            found.update(self._told.literals.get((prop, name), ()))
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
            for axiom in self._told.about.get(individual, ())
            if isinstance(axiom, ObjectPropertyAssertion)
        }
        if self._engine is not None:
            names.update(self._engine.program.objects)
        return {name for name in names if self.object_values(name, individual)}

    def data_properties_of(self, individual: str) -> set[str]:
        """Data properties with at least one value for the individual."""
        names = {
            axiom.prop
            for axiom in self._told.about.get(individual, ())
            if isinstance(axiom, DataPropertyAssertion)
        }
        if self._engine is not None:
            names.update(self._engine.program.datas)
        return {name for name in names if self.data_values(name, individual)}

    def equivalents(self, cls: str) -> list[ClassExpression]:
        """The other sides of the asserted equivalences that have the class as one side."""
        return [
            other
            for axiom in self._told.about.get(cls, ())
            if isinstance(axiom, EquivalentClasses) and cls in axiom.classes
            for other in axiom.classes
            if other != cls
        ]

    def facts(self, derived: bool = True) -> Iterator[Fact]:
        """Every fact about individuals; the asserted ones alone when `derived` is False."""
        stated = (ClassAssertion, ObjectPropertyAssertion, DataPropertyAssertion, SameIndividual)
        for axiom in tuple(self._told.axioms):
            if isinstance(axiom, stated):
                yield axiom
        if derived:
            for axiom in visible(self._engine):
                if axiom not in self._told.removed and axiom not in self._told.axioms:
                    yield axiom  # type: ignore[misc]

    def explain(self, fact: Axiom) -> Explanation | None:
        """Why a fact holds; None when it is neither asserted nor derived.

        A fact is a class, property, same- or different-individuals assertion, or a subclass axiom
        between named classes.
        """
        if fact in self._told.axioms:
            return Explanation(axiom_text(fact), 'asserted')
        engine = self._usable
        if engine is None or fact in self._told.removed:
            return None
        if isinstance(fact, SubClassOf):
            if fact.sup in self.superclasses(str(fact.sub)):
                return Explanation(axiom_text(fact), 'axiom', 'the class hierarchy')
            return None
        if not engine.understands(fact):
            return None
        return Reasons(engine).of_fact(fact)

    def explain_inconsistency(self) -> Explanation | None:
        """Why the ontology contradicts itself; None where the last `reason` found it does not."""
        if self._engine is None or self._consistent:
            return None
        return Reasons(self._engine).of_inconsistency()
