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

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial

from surveillance_ontology.bulk_building import uncollected
from surveillance_ontology.knowledge import Knowledge
from surveillance_ontology.knowledge_changes import Changes, Feed
from surveillance_ontology.owl.assertions import is_assertion
from surveillance_ontology.owl.axioms import (
    Axiom,
    DifferentIndividuals,
    SameIndividual,
)
from surveillance_ontology.owl.entities import entities_of
from surveillance_ontology.reasoner.engine import Engine
from surveillance_ontology.reasoner.schema import Schema
from surveillance_ontology.renaming import renamed


class KnowledgeBase(Knowledge):
    """Knowledge that can be changed, reasoned over and watched.

    Args:
        iri: The ontology's IRI.
        axioms: The first assertions.
    """

    def __init__(self, iri: str, axioms: Iterable[Axiom] = ()) -> None:
        super().__init__(iri, axioms)
        self._feed = Feed()

    # --- asserted axioms ---

    def add(self, axiom: Axiom) -> bool:
        """Asserts an axiom; False when it was asserted already."""
        if not self._told.insert(axiom):
            return False
        if self._feed:
            self._feed.asserted((axiom,), ())
        return True

    def remove(self, axiom: Axiom) -> bool:
        """Retracts an axiom; False when it was not asserted."""
        if not self._told.discard(axiom):
            return False
        if self._feed:
            self._feed.asserted((), (axiom,))
        return True

    def change(self, added: Iterable[Axiom] = (), removed: Iterable[Axiom] = ()) -> int:
        """Retracts `removed`, then asserts `added`, as one batch; the number of axioms that
        changed.
        """
        gone = [axiom for axiom in removed if self._told.discard(axiom)]
        come = [axiom for axiom in added if self._told.insert(axiom)]
        if self._feed and (gone or come):
            self._feed.asserted(come, gone)
        return len(gone) + len(come)

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
        engine, told = self._engine, self._told
        if engine is None or told.schema_changed or not self._fits(engine):
            before = self._feed.shown_by(engine) if self._feed else set()
            engine = self._rebuild(engine)
            if self._feed:
                self._feed.replaced(before, engine)
        elif told.added or told.removed:
            changes = told.settle()
            if self._feed:
                self._feed.updating(engine, partial(engine.update, *changes))
            else:
                engine.update(*changes)
            self._consistent = engine.consistent
        return self._consistent

    def _fits(self, engine: Engine) -> bool:
        """Whether the program knows every complex class and negated property that was added."""
        return all(engine.understands(axiom) for axiom in self._told.added)

    def _rebuild(self, old: Engine | None) -> Engine:
        axioms = tuple(self._told.axioms)
        assertions = [axiom for axiom in axioms if is_assertion(axiom)]
        self._schema = Schema(axioms, *Engine.needs_of(assertions))
        engine = self._engine = Engine(self._schema.program, self._told.mentioning)
        if old is not None:
            engine.take_spelling(old)
        self._told.settle()
        with uncollected():
            engine.update(assertions, ())
        self._consistent = engine.consistent
        self._snapshots.clear()
        self._watched.clear()
        return engine

    def recompute(self) -> bool:
        """Forgets what is derived and derives it again from nothing; whether the ontology is
        consistent.
        """
        self._told.schema_changed = True
        return self.reason()

    # --- whoever listens ---

    def subscribe(self, callback: Callable[[Changes], None]) -> Callable[[], None]:
        """Calls back once per batch of assertions and once per `reason` that changed derived facts.

        Returns:
            A function that ends the subscription.
        """
        return self._feed.subscribe(callback, self._engine)

    def copy(self) -> KnowledgeBase:
        """Another knowledge base with the same assertions, nothing derived and no subscribers."""
        return KnowledgeBase(self.iri, self._told.axioms)
