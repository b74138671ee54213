"""A change of classes and properties leaves what a knowledge base made from nothing would have."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.assertions import is_assertion
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    Declaration,
    DifferentIndividuals,
    DisjointClasses,
    EquivalentClasses,
    FunctionalObjectProperty,
    InverseObjectProperties,
    ObjectPropertyAssertion,
    ObjectPropertyDomain,
    SubClassOf,
    SubObjectPropertyOf,
)
from owl_reasoner.owl.expressions import ObjectHasValue, ObjectSomeValuesFrom
from owl_reasoner.reasoner.engine import Engine

from .random_ontologies import CLASSES, RandomOntology
from .test_incremental import by_value, derived

IRI = 'http://example.org/schema#'
A, B, C, P, Q = (IRI + name for name in 'ABCpq')


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Engine]:
    """Provide the engines that are made during the test."""
    engines: list[Engine] = []
    init = Engine.__init__

    def noted(self: Engine, *args: object) -> None:
        engines.append(self)
        init(self, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(Engine, '__init__', noted)
    return engines


def schema_of(kb: KnowledgeBase) -> list[Axiom]:
    return [axiom for axiom in kb.axioms() if not is_assertion(axiom)]


def sentence_of(text: str) -> str:
    """Return a sentence of `unsupported` without the individual that it names as an example."""
    return text.partition(': for ')[0]


def walk(seed: int) -> None:
    """Draw a random ontology, whose schema and assertions change at random; the feed too."""
    drawn = RandomOntology(seed)
    rng = drawn.random
    kb = KnowledgeBase('http://example.org/random', drawn.ontology(rng.randrange(1, 6), 12))
    kb.reason()
    shown = derived(kb) if kb.consistent else set()
    feed: list[Changes] = []
    kb.subscribe(feed.append)
    for _ in range(4):
        feed.clear()
        for _ in range(rng.choice([1, 2, 3])):
            action, pool = rng.random(), schema_of(kb)
            if pool and action < 0.3:
                kb.remove(rng.choice(pool))
            elif action < 0.5:
                kb.add(SubClassOf(rng.choice(CLASSES), rng.choice(CLASSES)))
            elif action < 0.7:
                kb.add(drawn.schema_axiom())
            elif action < 0.8:
                kb.rename('class', rng.choice(CLASSES), rng.choice(CLASSES))
            else:
                kb.add(drawn.assertion())
        kb.reason()
        fresh = KnowledgeBase(kb.iri, kb.axioms())
        assert fresh.reason() == kb.consistent
        assert derived(kb) == derived(fresh)
        assert {sentence_of(text) for text in kb.unsupported} == {
            sentence_of(text) for text in fresh.unsupported
        }
        # A class that can have no members is below all that are declared.
        named = [cls for cls in CLASSES if Declaration('class', cls) in kb]
        for cls in named:
            assert kb.instances(cls) == fresh.instances(cls)
            assert kb.superclasses(cls) & {*named} == fresh.superclasses(cls) & {*named}
        for changes in feed:
            shown -= {by_value(axiom) for axiom, is_derived in changes.removed if is_derived}
            shown |= {by_value(axiom) for axiom, is_derived in changes.added if is_derived}
        assert shown - {by_value(a) for a in kb.facts(False)} == derived(kb)
        for fact in list(kb.facts())[:10]:
            explanation = kb.explain(fact)
            assert explanation is not None
            assert explanation.tree()


@settings(max_examples=60, database=None)
@given(st.integers(min_value=0, max_value=2**32))
def test_random_changes_of_the_schema(seed: int) -> None:
    walk(seed)


@pytest.mark.long
@pytest.mark.timeout(0)
def test_random_changes_of_the_schema_for_long() -> None:
    for seed in range(3000):
        walk(seed)


def test_classes_come_and_go_below_others_on_the_facts_that_are_there(made: list[Engine]) -> None:
    kb = KnowledgeBase(IRI, [ClassAssertion(A, IRI + 'x'), ClassAssertion(C, IRI + 'y')])
    kb.reason()
    kb.add(SubClassOf(A, B))
    kb.add(SubClassOf(B, C))
    kb.reason()
    assert kb.instances(B) == {IRI + 'x'}
    assert kb.instances(C) == {IRI + 'x', IRI + 'y'}
    assert kb.superclasses(A) == {B, C}
    kb.rename('class', B, IRI + 'D')
    kb.reason()
    assert kb.instances(IRI + 'D') == {IRI + 'x'}
    assert kb.instances(B) == frozenset()
    kb.remove(SubClassOf(IRI + 'D', C))
    kb.reason()
    assert kb.instances(C) == {IRI + 'y'}
    assert len(made) == 1
    explanation = kb.explain(ClassAssertion(IRI + 'D', IRI + 'x'))
    assert explanation is not None
    assert SubClassOf(A, IRI + 'D') in explanation.sources()


def test_a_named_class_follows_from_an_equal_expression_that_is_asserted_later() -> None:
    some = ObjectSomeValuesFrom(P, B)
    kb = KnowledgeBase(IRI, [EquivalentClasses((A, some))])
    kb.reason()
    kb.add(ClassAssertion(some, IRI + 'x'))
    kb.reason()
    assert set(kb.derived_facts()) == {ClassAssertion(A, IRI + 'x')}


def test_a_fact_of_a_property_without_axioms_outlives_a_change(made: list[Engine]) -> None:
    kb = KnowledgeBase(IRI, [ObjectPropertyAssertion(P, IRI + 'x', IRI + 'y')])
    kb.reason()
    kb.add(SubObjectPropertyOf(P, Q))
    kb.add(ObjectPropertyDomain(Q, A))
    kb.reason()
    assert kb.object_values(Q, IRI + 'x') == {IRI + 'y'}
    assert kb.instances(A) == {IRI + 'x'}
    kb.remove(ObjectPropertyDomain(Q, A))
    kb.remove(SubObjectPropertyOf(P, Q))
    kb.reason()
    assert (kb.object_values(P, IRI + 'x'), kb.object_values(Q, IRI + 'x')) == ({IRI + 'y'}, set())
    assert kb.instances(A) == frozenset()
    assert len(made) == 1


def test_an_explanation_names_the_axiom_that_is_left() -> None:
    twice = [SubClassOf(A, B), EquivalentClasses((A, B))]
    kb = KnowledgeBase(IRI, [Declaration('class', A), *twice, ClassAssertion(A, IRI + 'x')])
    kb.reason()
    kb.remove(twice[0])
    kb.reason()
    explanation = kb.explain(ClassAssertion(B, IRI + 'x'))
    assert explanation is not None
    assert twice[1] in explanation.sources()
    assert twice[0] not in explanation.sources()


def test_a_definition_recognises_those_that_are_there(made: list[Engine]) -> None:
    kb = KnowledgeBase(
        IRI, [ObjectPropertyAssertion(P, IRI + 'x', IRI + 'y'), ClassAssertion(B, IRI + 'y')]
    )
    kb.reason()
    kb.add(EquivalentClasses((A, ObjectSomeValuesFrom(P, B))))
    kb.reason()
    assert kb.instances(A) == {IRI + 'x'}
    kb.remove(ClassAssertion(B, IRI + 'y'))
    kb.reason()
    assert kb.instances(A) == frozenset()
    assert len(made) == 1


def test_classes_become_disjoint_on_the_facts_that_are_there(made: list[Engine]) -> None:
    kb = KnowledgeBase(IRI, [ClassAssertion(A, IRI + 'x'), ClassAssertion(B, IRI + 'y')])
    kb.reason()
    differ = DifferentIndividuals(frozenset((IRI + 'x', IRI + 'y')))
    assert not kb.holds(differ)
    kb.add(DisjointClasses((A, B)))
    assert kb.reason()
    assert kb.holds(differ)
    kb.remove(DisjointClasses((A, B)))
    kb.reason()
    assert not kb.holds(differ)
    assert len(made) == 1
    kb.add(ClassAssertion(B, IRI + 'x'))
    kb.reason()
    kb.add(DisjointClasses((A, B)))
    assert not kb.reason()


def test_a_property_becomes_functional_on_the_facts_that_are_there(made: list[Engine]) -> None:
    links = [ObjectPropertyAssertion(P, IRI + 'x', IRI + name) for name in 'yz']
    kb = KnowledgeBase(IRI, [*links, ClassAssertion(A, IRI + 'y')])
    kb.reason()
    kb.add(FunctionalObjectProperty(P))
    kb.reason()
    assert kb.instances(A) == {IRI + 'y', IRI + 'z'}
    assert len(made) == 1
    kb.remove(links[1])
    kb.reason()
    kb.remove(FunctionalObjectProperty(P))
    kb.add(links[1])
    kb.reason()
    assert kb.instances(A) == {IRI + 'y'}
    assert len(made) == 1


def test_what_an_axiom_says_twice_goes_with_it() -> None:
    twice = InverseObjectProperties(P, P)
    kb = KnowledgeBase(IRI, [twice, ObjectPropertyAssertion(P, IRI + 'x', IRI + 'y')])
    for change in (SubClassOf(A, B), SubClassOf(B, C)):
        kb.add(change)
        kb.reason()
        assert kb.object_values(P, IRI + 'y') == {IRI + 'x'}
    kb.remove(twice)
    kb.reason()
    assert kb.object_values(P, IRI + 'y') == set()


def test_what_a_class_implies_is_found_though_rules_only_recognised_it_before() -> None:
    leads_to_x = ObjectHasValue(P, IRI + 'x')
    kb = KnowledgeBase(IRI, [SubClassOf(ObjectSomeValuesFrom(P, leads_to_x), A)])
    kb.reason()
    kb.add(ClassAssertion(leads_to_x, IRI + 'x'))
    kb.reason()
    assert kb.object_values(P, IRI + 'x') == {IRI + 'x'}
    assert kb.instances(A) == {IRI + 'x'}
