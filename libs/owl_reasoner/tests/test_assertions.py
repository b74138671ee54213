"""The asserted axioms after any changes are what they were had only the last ones been told."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from owl_reasoner.owl.assertions import Assertions, is_assertion
from owl_reasoner.owl.axioms import (
    Axiom,
    AxiomAnnotation,
    Declaration,
    NegativeObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.expressions import Literal, ObjectComplementOf
from owl_reasoner.owl.vocabulary import THING

from .small_ontologies import A, B, P, differ, has, i, is_a, j, rel, same

LABEL = 'http://www.w3.org/2000/01/rdf-schema#label'
PLAIN: list[Axiom] = [
    is_a(A, i),
    is_a(ObjectComplementOf(B), j),
    rel(P, i, j),
    has('x:age', i, 5),
    differ(i, j),
    same(i, 'x:k'),
    NegativeObjectPropertyAssertion(P, j, i),
    Declaration('individual', i),
    Declaration('class', B),
    SubClassOf(A, B),
    SubClassOf(B, THING),
]
NOTES: list[Axiom] = [
    AxiomAnnotation(axiom, ((LABEL, Literal(text)),))
    for axiom in (PLAIN[0], SubClassOf(A, B))
    for text in ('one', 'two')
]


def state(told: Assertions) -> object:
    return (
        [*told.axioms],
        {entity: [*axioms.values()] for entity, axioms in told.about.items()},
        [*told.schema],
        [*told.complex],
    )


@settings(max_examples=150)
@given(
    st.lists(st.tuples(st.booleans(), st.sampled_from([*PLAIN, *NOTES])), max_size=25),
    st.integers(0, 25),
)
def test_what_is_asserted_and_what_changed_follow_from_what_was_told(
    steps: list[tuple[bool, Axiom]], settled: int
) -> None:
    told, kept = Assertions(), dict[Axiom, None]()
    known = dict(kept)
    for number, (comes, axiom) in enumerate(steps):
        if number == settled:
            told.settle()
            known = dict(kept)
        assert (told.insert if comes else told.discard)(axiom) == (comes == (axiom not in kept))
        if comes:
            kept.setdefault(axiom)
        elif axiom in kept:
            del kept[axiom]
            for note in NOTES:
                if isinstance(note, AxiomAnnotation) and note.axiom == axiom:
                    kept.pop(note, None)
    fresh = Assertions()
    for axiom in kept:
        fresh.insert(axiom)
    assert state(told) == state(fresh)
    for entity in {iri for axiom in (*PLAIN, *NOTES) for _, iri in entities_of(axiom)}:
        mentioning = [axiom for axiom in kept if (entity in {e for _, e in entities_of(axiom)})]
        assert [*told.mentioning(entity)] == mentioning
        for kind in ('class', 'individual'):
            used = any((kind, entity) in entities_of(axiom) for axiom in kept)
            assert told.is_known(kind, entity) == used
    # What went and came again is no change.
    added = {axiom for axiom in kept if axiom not in known}
    removed = {axiom for axiom in known if axiom not in kept}
    assert set(told.added) == {axiom for axiom in added if is_assertion(axiom)}
    assert set(told.removed) == {axiom for axiom in removed if is_assertion(axiom)}
    assert set(told.schema_added) == {axiom for axiom in added if not is_assertion(axiom)}
    assert set(told.schema_removed) == {axiom for axiom in removed if not is_assertion(axiom)}
    before = told.unsettled()
    told.settle()
    assert told.unsettled()[:4] == ({}, {}, {}, {})
    assert not told.schema_changed
    told.unsettle(before)
    assert told.unsettled() == before


def test_only_what_a_reasoner_uses_changes_the_schema() -> None:
    for axiom, matters in (
        (SubClassOf(A, B), True),
        (SubClassOf(A, THING), False),
        (Declaration('class', A), False),
        (NOTES[0], False),
        (is_a(A, i), False),
    ):
        told = Assertions()
        told.settle()
        told.insert(axiom)
        assert told.schema_changed == matters
        told.settle()
        told.discard(axiom)
        assert told.schema_changed == matters
