"""An ontology in memory: what is asserted, what follows from it, and why.

The asserted axioms change at once with `add` and `remove`; what follows is brought up to date by `reason`,
which touches only what depends on the changes. Asserted and derived facts are kept apart: a derived fact never
becomes an assertion. Nothing here is thread-safe; a caller that shares a `KnowledgeBase` locks it.

    kb = KnowledgeBase(iri, read_ontology(path, iri).axioms)
    kb.reason()
    kb.instances(iri + '#URGENT')
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias

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
from surveillance_ontology.reasoner.engine import Engine

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

    Queries answer from what is asserted now together with what was derived by the last `reason`; a value whose
    assertion was retracted is never returned. When the last `reason` found a contradiction, queries answer
    from the assertions alone. Individuals, classes and properties are full IRIs.

    Args:
        iri: The ontology's IRI.
        axioms: The first assertions.
    """

    def __init__(self, iri: str, axioms: Iterable[Axiom] = ()) -> None:
        self.iri = iri
        self._axioms: dict[Axiom, None] = {}
        self._about: dict[str, dict[Axiom, None]] = {}
        self._added: dict[Assertion, None] = {}
        self._removed: dict[Assertion, None] = {}
        self._engine: Engine | None = None
        self._schema_changed = True
        self._consistent = True
        self._subscribers: list[Callable[[Changes], None]] = []
        self._sequence = 0
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
        """Retracts `removed`, then asserts `added`, as one batch; the number of axioms that changed."""
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
        if isinstance(axiom, Assertion):
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
        if isinstance(axiom, Assertion):
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
        affected = [axiom for axiom in self.axioms_about(old) if (kind, old) in entities_of(axiom)]
        self.change([renamed(axiom, kind, old, new) for axiom in affected], affected)
        return len(affected)

    def remove_entity(self, kind: str, iri: str) -> int:
        """Retracts every axiom that mentions the entity; a set of (different, same) individuals shrinks instead.

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
        raise NotImplementedError

    def recompute(self) -> bool:
        """Forgets what is derived and derives it again from nothing; whether the ontology is consistent."""
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
        """One sentence for each asserted axiom (or part) that the reasoner does not use."""
        raise NotImplementedError

    # --- queries ---

    def instances(self, cls: str) -> set[str]:
        """Individuals of a class, direct and indirect."""
        raise NotImplementedError

    def types(self, individual: str) -> set[str]:
        """Named classes of an individual, direct and indirect, without owl:Thing."""
        raise NotImplementedError

    def subclasses(self, cls: str) -> set[str]:
        """Named classes strictly below, direct and indirect, as of the last `reason`."""
        raise NotImplementedError

    def superclasses(self, cls: str) -> set[str]:
        """Named classes strictly above, direct and indirect, as of the last `reason`."""
        raise NotImplementedError

    def object_values(self, prop: str, individual: str) -> set[str]:
        """What an individual is related to by an object property."""
        raise NotImplementedError

    def data_values(self, prop: str, individual: str) -> set[Literal]:
        """Values of a data property: asserted ones as written, derived ones in one form for each value."""
        raise NotImplementedError

    def object_properties_of(self, individual: str) -> set[str]:
        """Object properties with at least one value for the individual."""
        raise NotImplementedError

    def data_properties_of(self, individual: str) -> set[str]:
        """Data properties with at least one value for the individual."""
        raise NotImplementedError

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
        raise NotImplementedError

    def explain(self, fact: Axiom) -> Explanation | None:
        """Why a fact holds; None when it is neither asserted nor derived."""
        raise NotImplementedError

    def explain_inconsistency(self) -> Explanation | None:
        """Why the ontology contradicts itself; None when the last `reason` found no contradiction."""
        raise NotImplementedError

    # --- changes ---

    def subscribe(self, callback: Callable[[Changes], None]) -> Callable[[], None]:
        """Calls back once per batch of assertions and once per `reason` that changed derived facts.

        Returns:
            A function that ends the subscription.
        """
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
