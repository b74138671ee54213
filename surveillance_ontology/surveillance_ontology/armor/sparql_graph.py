"""The RDF graph that queries see, and what changed in it since a process got it.

A whole graph of 100,000 axioms takes seconds to write and to read. Most changes are of single
facts; for these a process that has an older graph gets the difference.
"""

from __future__ import annotations

import itertools
from collections import deque
from dataclasses import dataclass, field

from surveillance_ontology.armor.reference import Reference
from surveillance_ontology.knowledge_base import Changes, KnowledgeBase
from surveillance_ontology.owl.axioms import (
    Axiom,
    AxiomAnnotation,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    ObjectPropertyAssertion,
    SubClassOf,
)
from surveillance_ontology.owl.entities import entities_of
from surveillance_ontology.owl.vocabulary import NOTHING, THING

KEPT = 5000
"""Facts that changed and are kept; a process whose graph is older gets the whole one."""

_BUILT_IN = (THING, NOTHING)

Fact = ClassAssertion | ObjectPropertyAssertion | DataPropertyAssertion | SubClassOf


@dataclass(frozen=True)
class Version:
    """Which graph a process has.

    Attributes:
        epoch: Tells a loaded ontology from any other.
        derived: Whether derived facts are in it.
        sequence: Counts the changes within an epoch.
        classified: Counts the times that the classes were put in order.
    """

    epoch: int
    derived: bool
    sequence: int
    classified: int = 0


@dataclass(frozen=True)
class GraphUpdate:
    """What brings a process to a version.

    Attributes:
        version: The version.
        whole: Whether `added` is the whole graph, in the place of the one before.
        iri: The ontology's IRI.
        added: Axioms that come.
        removed: Facts that go, before the others come.
    """

    version: Version
    whole: bool
    iri: str
    added: list[Axiom]
    removed: list[Axiom] = field(default_factory=list)

    def triples(self) -> tuple[bytes, bytes]:
        """Return what goes and what comes as N-Triples; needs no lock, and may take long."""
        from surveillance_ontology.documents.writing import fact_line, ontology_bytes

        removed = ''.join(map(fact_line, self.removed)).encode()
        annotated = {axiom.axiom for axiom in self.added if isinstance(axiom, AxiomAnnotation)}
        lines: list[str] = []
        rest: list[Axiom] = []
        named: dict[tuple[str, str], None] = {}
        for axiom in self.added:
            line = '' if annotated and axiom in annotated else fact_line(axiom)
            # Labels are all written in one place, which may give others.
            if line and '_:' not in line:
                lines.append(line)
                kind = type(axiom)
                if kind is ClassAssertion:
                    named['class', axiom.cls] = None  # type: ignore[attr-defined]
                elif kind is ObjectPropertyAssertion:
                    named['object_property', axiom.prop] = None  # type: ignore[attr-defined]
                elif kind is DataPropertyAssertion:
                    named['data_property', axiom.prop] = None  # type: ignore[attr-defined]
                else:
                    named.update((entity, None) for entity in entities_of(axiom))
            else:
                rest.append(axiom)
        rest += (Declaration(*entity) for entity in named if entity[1] not in _BUILT_IN)
        return removed, ''.join(lines).encode() + ontology_bytes(rest, self.iri, 'ntriples')


@dataclass
class _Log:
    epoch: int
    sequence: int = 0
    oldest: int = 0
    """A graph of this sequence or a later one can be brought up to date by differences."""
    touched: deque[tuple[int, Fact]] = field(default_factory=deque)


class GraphChanges:
    """What changed in the graphs of references; call it with the references' locks held."""

    def __init__(self) -> None:
        self._epochs = itertools.count()
        self._logs: dict[str, _Log] = {}

    def note(self, name: str, changes: Changes | None) -> None:
        """Take in a change of a reference; None: it was loaded or dropped."""
        log = self._logs.get(name)
        if log is None:
            return  # Nobody has asked about it yet.
        if changes is None:
            del self._logs[name]
            return
        log.sequence += 1
        for axiom, _ in (*changes.added, *changes.removed):
            if not _is_plain(axiom) or len(log.touched) >= KEPT:
                log.oldest = log.sequence
                log.touched.clear()
                return
            log.touched.append((log.sequence, axiom))  # type: ignore[arg-type]

    def version(self, ref: Reference, derived: bool) -> Version:
        """Return the version of a reference's graph as it is now."""
        log = self._log(ref)
        # What a Java reasoner derives is not told fact by fact.
        sequence = ref.revision if ref.origin.reasoner else log.sequence
        return Version(log.epoch, derived, sequence, ref.kb.classified)

    def update(self, ref: Reference, derived: bool, known: Version | None) -> GraphUpdate:
        """Return what brings a process that has a graph, or none, up to date."""
        log, now = self._log(ref), self.version(ref, derived)
        found = None
        if known is not None and (known.epoch, known.derived) == (now.epoch, derived):
            found = self._difference(ref, log, known, now)
        if found is not None:
            return GraphUpdate(now, False, ref.kb.iri, *found)
        axioms: list[Axiom] = list(ref.kb.axioms())
        if derived:
            axioms += ref.kb.derived_facts()
            classes = ref.kb.subclasses(THING) | {THING}
            axioms += (SubClassOf(sub, cls) for cls in classes for sub in ref.kb.subclasses(cls))
        return GraphUpdate(now, True, ref.kb.iri, axioms)

    def _difference(
        self, ref: Reference, log: _Log, known: Version, now: Version
    ) -> tuple[list[Axiom], list[Axiom]] | None:
        """Return what came and what went since a version; None where only all of it will do."""
        if ref.origin.reasoner or known.sequence < log.oldest:
            return None
        touched = dict.fromkeys(fact for at, fact in log.touched if at > known.sequence)
        if now.derived:
            if now.classified != known.classified or any(
                isinstance(fact, SubClassOf) for fact in touched
            ):
                return None  # Many classes may have come to be below others.
            # A class that assertions alone name is below owl:Thing as long as they do.
            named = {str(f.cls) for f in touched if isinstance(f, ClassAssertion)} - {THING}
            touched.update((SubClassOf(cls, THING), None) for cls in named)
        added: list[Axiom] = []
        removed: list[Axiom] = []
        for fact in touched:
            (added if _holds(ref.kb, fact, now.derived) else removed).append(fact)
        gone = (iri for fact in removed for kind, iri in entities_of(fact) if kind != 'individual')
        if any(next(ref.kb.axioms_about(iri), None) is None for iri in gone):
            return None  # The declaration of a class or property goes with its last axiom.
        return added, removed

    def _log(self, ref: Reference) -> _Log:
        log = self._logs.get(ref.name)
        if log is None:
            log = self._logs[ref.name] = _Log(next(self._epochs))
        return log


def _is_plain(axiom: Axiom) -> bool:
    """Tell whether an axiom is one triple."""
    if isinstance(axiom, ClassAssertion):
        return isinstance(axiom.cls, str) and not axiom.individual.startswith('_:')
    if isinstance(axiom, ObjectPropertyAssertion):
        names = (axiom.prop, axiom.subject, axiom.object)
        return all(isinstance(name, str) and not name.startswith('_:') for name in names)
    if isinstance(axiom, SubClassOf):
        return isinstance(axiom.sup, str) and isinstance(axiom.sub, str)
    return isinstance(axiom, DataPropertyAssertion) and not axiom.subject.startswith('_:')


def _holds(kb: KnowledgeBase, fact: Fact, derived: bool) -> bool:
    if fact in kb:
        return True
    if not derived:
        return False
    if isinstance(fact, SubClassOf):
        return fact.sub in kb.subclasses(str(fact.sup))
    if isinstance(fact, ClassAssertion):
        return fact.cls in kb.types(fact.individual)
    if isinstance(fact, ObjectPropertyAssertion):
        return fact.object in kb.object_values(str(fact.prop), fact.subject)
    return fact.literal in kb.data_values(fact.prop, fact.subject)
