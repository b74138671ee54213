"""The asserted axioms of a knowledge base, by what they mention, and which changed since when."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import count
from typing import NamedTuple

from owl_reasoner.owl.axioms import (
    Annotation,
    Assertion,
    Axiom,
    AxiomAnnotation,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    NegativeDataPropertyAssertion,
    NegativeObjectPropertyAssertion,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.vocabulary import THING

_PLAIN = (DataPropertyAssertion, ObjectPropertyAssertion)
"""Most axioms of a large ontology; nothing but `axioms` and `about` says something of them."""


class Unsettled(NamedTuple):
    """What changed since `Assertions.settle`, as it names it."""

    added: dict[Axiom, None]
    removed: dict[Axiom, None]
    schema_added: dict[Axiom, None]
    schema_removed: dict[Axiom, None]
    schema_changed: bool


class Assertions:
    """A set of axioms.

    Args:
        axioms: The first ones; they count as settled, except that nothing was made of `schema` yet.

    Attributes:
        axioms: All of them, oldest first, each with its number.
        about: The axioms that mention an entity, by their numbers.
        schema: Those that are not about individuals, oldest first.
        complex: Those about individuals that a program must be made for: memberships of complex
            classes, and negative ones.
        added, removed: What changed about individuals since `settle`.
        schema_changed: Whether anything else that matters to a reasoner changed since `settle`.
        schema_added, schema_removed: What changed since `settle` and is not about individuals.
    """

    def __init__(self, axioms: Iterable[Axiom] = ()) -> None:
        self.axioms: dict[Axiom, int] = {}
        self.about: dict[str, dict[int, Axiom]] = {}
        self.schema: dict[Axiom, None] = {}
        self.complex: dict[Axiom, None] = {}
        self.added: dict[Axiom, None] = {}
        self.removed: dict[Axiom, None] = {}
        self.schema_changed = True
        self.schema_added: dict[Axiom, None] = {}
        self.schema_removed: dict[Axiom, None] = {}
        self._numbers = count(1)
        self._notes: dict[Axiom, dict[AxiomAnnotation, None]] = {}
        for axiom in axioms:
            if type(axiom) in _PLAIN:
                self._enter(axiom)
            else:
                self.insert(axiom)
        self.settle()
        self.schema_changed = True

    def settle(self) -> tuple[tuple[Axiom, ...], tuple[Axiom, ...]]:
        """Take what was added and removed; from here on, nothing changed."""
        changes = tuple(self.added), tuple(self.removed)
        # New ones: `unsettled` gave the old ones away.
        self.added, self.removed = {}, {}
        self.schema_added, self.schema_removed = {}, {}
        self.schema_changed = False
        return changes

    def unsettled(self) -> Unsettled:
        """Return what changed since `settle`."""
        return Unsettled(
            self.added,
            self.removed,
            self.schema_added,
            self.schema_removed,
            self.schema_changed,
        )

    def unsettle(self, changes: Unsettled) -> None:
        """Take `settle` back: what changed before it counts as changed since."""
        self.added, self.removed = dict(changes.added), dict(changes.removed)
        self.schema_added = dict(changes.schema_added)
        self.schema_removed = dict(changes.schema_removed)
        self.schema_changed = changes.schema_changed

    def mentioning(self, entity: str) -> Iterable[Axiom]:
        """Return the axioms that mention an entity, oldest first."""
        mentions = self.about.get(entity)
        return () if mentions is None else mentions.values()

    def is_known(self, kind: str, iri: str) -> bool:
        """Tell whether an axiom declares or uses the entity as this kind."""
        return any((kind, iri) in entities_of(axiom) for axiom in self.mentioning(iri))

    def insert(self, axiom: Axiom) -> bool:
        """Assert an axiom; return False when it was asserted already."""
        if not self._enter(axiom):
            return False
        if is_assertion(axiom):
            if self.removed and axiom in self.removed:
                del self.removed[axiom]
            else:
                self.added[axiom] = None
            if _is_complex(axiom):
                self.complex[axiom] = None
            return True
        self.schema[axiom] = None
        if axiom in self.schema_removed:
            del self.schema_removed[axiom]
        else:
            self.schema_added[axiom] = None
        if isinstance(axiom, AxiomAnnotation):
            self._notes.setdefault(axiom.axiom, {})[axiom] = None
        elif _is_schema(axiom):
            self.schema_changed = True
        return True

    def _enter(self, axiom: Axiom) -> bool:
        """Take an axiom among all and to what it mentions; return False when it is there."""
        number = next(self._numbers)
        if self.axioms.setdefault(axiom, number) != number:
            return False
        about = self.about
        for entity in _mentioned(axiom):
            mentions = about.get(entity)
            if mentions is None:
                about[entity] = {number: axiom}
            else:
                mentions[number] = axiom
        return True

    def discard(self, axiom: Axiom) -> bool:
        """Retract an axiom and what annotates it; return False when it was not asserted."""
        number = self.axioms.pop(axiom, None)
        if number is None:
            return False
        if self._notes:
            for note in tuple(self._notes.get(axiom, ())):
                self.discard(note)
        for entity in _mentioned(axiom):
            mentions = self.about.get(entity)
            if mentions is not None:
                mentions.pop(number, None)
                if not mentions:
                    del self.about[entity]
        if is_assertion(axiom):
            if axiom in self.added:
                del self.added[axiom]
            else:
                self.removed[axiom] = None
            self.complex.pop(axiom, None)
            return True
        del self.schema[axiom]
        if axiom in self.schema_added:
            del self.schema_added[axiom]
        else:
            self.schema_removed[axiom] = None
        if isinstance(axiom, AxiomAnnotation):
            notes = self._notes[axiom.axiom]
            del notes[axiom]
            if not notes:
                del self._notes[axiom.axiom]
        elif _is_schema(axiom):
            self.schema_changed = True
        return True


def _mentioned(axiom: Axiom) -> Iterable[str]:
    kind = type(axiom)
    if kind is DataPropertyAssertion:
        return (axiom.prop, axiom.subject)  # type: ignore[attr-defined]
    if kind is ObjectPropertyAssertion:
        return (axiom.prop, axiom.subject, axiom.object)  # type: ignore[attr-defined]
    if kind is ClassAssertion and isinstance(axiom.cls, str):  # type: ignore[attr-defined]
        return (axiom.cls, axiom.individual)  # type: ignore[attr-defined]
    if kind is DifferentIndividuals or kind is SameIndividual:
        return axiom.individuals  # type: ignore[attr-defined, no-any-return]
    return {iri for _, iri in entities_of(axiom)}


def is_assertion(axiom: Axiom) -> bool:
    """Tell whether an axiom is about individuals; the declaration of one is."""
    if isinstance(axiom, Declaration):
        return axiom.kind == 'individual'
    return isinstance(axiom, Assertion)


def _is_complex(axiom: Axiom) -> bool:
    kind = type(axiom)
    if kind is ClassAssertion:
        return not isinstance(axiom.cls, str)  # type: ignore[attr-defined]
    return kind is NegativeObjectPropertyAssertion or kind is NegativeDataPropertyAssertion


def _is_schema(axiom: Axiom) -> bool:
    if isinstance(axiom, SubClassOf):
        return axiom.sup != THING
    return not isinstance(axiom, Declaration | Annotation)
