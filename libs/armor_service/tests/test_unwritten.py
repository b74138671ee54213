"""What a file lacks: it follows the reference, and what others wrote comes before it."""

from __future__ import annotations

from armor_service.changes import AddAxiom, apply_all
from armor_service.quarantine import Submission
from armor_service.reference import Buffering, Effort, Origin, Reference, knowledge_base
from armor_service.store.unwritten import Unwritten
from owl_reasoner.owl.axioms import ClassAssertion

IRI = 'http://example.org/o'
FIRST, SECOND = (ClassAssertion(f'{IRI}#Room', f'{IRI}#r{n}') for n in (1, 2))


def reference() -> Reference:
    kb = knowledge_base(IRI, [])
    return Reference('o', kb, Origin('', 'rdfxml', {}), Buffering(False, True), effort=Effort())


def test_what_came_and_went_again_is_not_lacking() -> None:
    ref, lacking = reference(), Unwritten()
    lacking.follow(ref)
    assert not lacking
    ref.kb.change([FIRST])
    assert lacking.net == {FIRST: 1}
    ref.kb.change([], [FIRST])
    assert not lacking


def test_what_the_file_has_already_is_not_lacking() -> None:
    ref, lacking = reference(), Unwritten()
    lacking.follow(ref)
    with lacking.already_written():
        ref.kb.change([FIRST])
    assert not lacking


def test_a_directive_that_waits_is_done_again_after_what_others_wrote() -> None:
    ref, lacking = reference(), Unwritten()
    lacking.follow(ref)
    told = Submission('c', 0.0, (AddAxiom(SECOND),))
    apply_all(ref.kb, told.changes)
    lacking.applied([told])
    delta = lacking.merge(ref.kb, [AddAxiom(FIRST)], [])
    assert delta == {FIRST: 1}
    assert set(ref.kb.axioms()) >= {FIRST, SECOND}
    assert lacking.net == {SECOND: 1}
    assert lacking.groups == [([told], {SECOND: 1})]
    lacking.written(ref)
    assert not lacking
