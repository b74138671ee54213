"""What is derived step by step equals what is derived from nothing, on random ontologies and
changes.
"""

from __future__ import annotations

import gc
import random
from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import (
    Assertion,
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    Declaration,
    DifferentIndividuals,
    DisjointClasses,
    EquivalentClasses,
    FunctionalObjectProperty,
    ObjectPropertyAssertion,
    ObjectPropertyRange,
    Rule,
    SameIndividual,
    SubDataPropertyOf,
    SymmetricObjectProperty,
    TransitiveObjectProperty,
)
from owl_reasoner.owl.expressions import (
    ClassAtom,
    DataHasValue,
    DifferentIndividualsAtom,
    Literal,
    ObjectIntersectionOf,
    ObjectMaxCardinality,
    ObjectMinCardinality,
    ObjectPropertyAtom,
    ObjectUnionOf,
    SameIndividualAtom,
    Variable,
)
from owl_reasoner.reasoner import assertion_reader, engine, equality
from owl_reasoner.reasoner.datatypes import value_of

from .patrol_map import (
    DOOR_FACTS,
    DOORS_DIFFER,
    IRI,
    NOW,
    PLACES_DIFFER,
    ROBOT_FACTS,
    SCHEMA,
    SEVEN_ROOMS,
    VISITS,
    different,
    link,
    n,
    names,
    seven_rooms,
    value,
)
from .random_ontologies import RandomOntology


def by_value(axiom: Axiom) -> object:
    """Return an axiom, with a literal replaced by its value: derived values may be written in
    several ways.
    """
    if isinstance(axiom, DataPropertyAssertion):
        return axiom.prop, axiom.subject, value_of(axiom.literal)
    return axiom


def test_a_value_that_changes_for_ever_is_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assertion_reader, 'LEAST_VALUES', 50)
    xsd = 'http://www.w3.org/2001/XMLSchema#'
    written = Literal('007', xsd + 'int')
    kb = KnowledgeBase(IRI)
    kb.add(SubDataPropertyOf(n('p'), n('q')))
    kb.add(DataPropertyAssertion(n('p'), n('x'), written))

    def longs() -> int:
        gc.collect()
        return sum(type(o) is Literal and o.datatype == xsd + 'long' for o in gc.get_objects())

    of_other_tests = longs()
    before = [DataPropertyAssertion(n('p'), n('y'), Literal('0', xsd + 'long'))]
    for moment in range(1, 1000):
        after = [DataPropertyAssertion(n('p'), n('y'), Literal(str(moment), xsd + 'long'))]
        kb.change(after, before)
        assert kb.reason()
        before = after
    # One that is asserted is written as before, also where it is derived.
    assert DataPropertyAssertion(n('q'), n('x'), written) in set(kb.facts())
    assert longs() - of_other_tests < 200


def derived(kb: KnowledgeBase) -> set[object]:
    return {by_value(axiom) for axiom in kb.facts()} - {by_value(a) for a in kb.facts(False)}


def assert_as_from_nothing(kb: KnowledgeBase) -> None:
    fresh = KnowledgeBase(kb.iri, kb.axioms())
    assert fresh.reason() == kb.consistent
    assert derived(kb) == derived(fresh)


def changeable(kb: KnowledgeBase) -> list[Axiom]:
    return [
        axiom
        for axiom in kb.axioms()
        if isinstance(axiom, Assertion)
        or (isinstance(axiom, Declaration) and axiom.kind == 'individual')
    ]


def change_at_random(kb: KnowledgeBase, drawn: RandomOntology) -> None:
    """Retract or assert something; every fifth time an axiom about classes or properties."""
    rng = drawn.random
    if rng.random() < 0.2:
        pool = [a for a in kb.axioms() if not isinstance(a, Assertion | Declaration)]
        fresh = drawn.schema_axiom
    else:
        pool, fresh = changeable(kb), drawn.assertion
    if pool and rng.random() < 0.5:
        assert kb.remove(rng.choice(pool))
    else:
        kb.add(fresh())


def walk(seed: int) -> None:
    """Compare a random ontology and random changes after each `reason`; the feed too."""
    drawn = RandomOntology(seed)
    rng = drawn.random
    kb = KnowledgeBase('http://example.org/random', drawn.ontology(rng.randrange(1, 10), 12))
    kb.reason()
    shown = derived(kb) if kb.consistent else set()
    feed: list[Changes] = []
    kb.subscribe(feed.append)
    for _ in range(4):
        feed.clear()
        for _ in range(rng.choice([1, 2, 3])):
            change_at_random(kb, drawn)
        kb.reason()
        assert_as_from_nothing(kb)
        for changes in feed:
            shown -= {by_value(axiom) for axiom, is_derived in changes.removed if is_derived}
            shown |= {by_value(axiom) for axiom, is_derived in changes.added if is_derived}
        assert shown - {by_value(a) for a in kb.facts(False)} == derived(kb)
        for fact in list(kb.facts())[:25]:
            explanation = kb.explain(fact)
            assert explanation is not None
            assert explanation.tree()
            assert explanation.sentence()
        assert (kb.explain_inconsistency() is None) == kb.consistent


@settings(max_examples=50, database=None)
@given(st.integers(min_value=0, max_value=2**32))
def test_random_ontologies(seed: int) -> None:
    walk(seed)


@pytest.mark.long
@pytest.mark.timeout(0)
def test_random_ontologies_for_long() -> None:
    for seed in range(3000):
        walk(seed)


@settings(max_examples=12, database=None)
@given(st.integers(min_value=0, max_value=2**32))
def test_random_changes_of_the_patrol_map(seed: int) -> None:
    rng = random.Random(seed)
    facts: list[Axiom] = [*DOOR_FACTS, *ROBOT_FACTS, *VISITS, PLACES_DIFFER, DOORS_DIFFER]
    kb = KnowledgeBase(IRI, [*SCHEMA, *facts])
    kb.reason()
    extra: list[Axiom] = [
        different(['E', 'C1', 'C2']),
        different(['D1', 'D2', 'D5']),
        ClassAssertion(n('CORRIDOR'), n('R1')),
    ]
    extra += [link('isIn', 'Robot1', place) for place in SEVEN_ROOMS]
    extra += [value('now', 'Robot1', NOW + later) for later in (0, 3, 9, 20)]
    extra += [value('visitedAt', place, NOW + later) for place in SEVEN_ROOMS for later in (0, 8)]
    for _ in range(6):
        for _ in range(rng.choice([1, 2, 4])):
            axiom = rng.choice([*facts, *extra])
            if not kb.remove(axiom):
                kb.add(axiom)
        kb.reason()
        assert_as_from_nothing(kb)


def test_a_fact_derived_twice_survives_the_loss_of_one() -> None:
    kb = seven_rooms(link('hasDoor', 'R1', 'D2'), link('hasDoor', 'C1', 'D2'))
    assert n('C1') in kb.object_values(n('connectedTo'), n('R1'))
    kb.remove(link('hasDoor', 'R1', 'D1'))
    kb.reason()
    assert n('C1') in kb.object_values(n('connectedTo'), n('R1'))
    kb.remove(link('hasDoor', 'R1', 'D2'))
    kb.reason()
    assert n('C1') not in kb.object_values(n('connectedTo'), n('R1'))


def test_a_long_chain_of_functional_values_is_walked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who differs may rest on whom they are related to, and so on, round a ring."""
    walked: list[int] = []
    walk = engine.Engine._related_by_difference

    def counted(self: engine.Engine, individuals: Iterable[str]) -> dict[str, None]:
        found = walk(self, individuals)
        walked.append(len(found))
        return found

    monkeypatch.setattr(engine.Engine, '_related_by_difference', counted)
    ring = [link('p', f'r{place}', f'r{(place + 1) % 300}') for place in range(300)]
    kb = KnowledgeBase(IRI, [FunctionalObjectProperty(n('p')), *ring])
    assert kb.reason()
    assert sum(walked) <= 2 * len(ring)


def test_a_contradiction_with_two_reasons_outlives_one() -> None:
    kb = KnowledgeBase(
        IRI,
        [
            ObjectPropertyRange(n('q'), ObjectMaxCardinality(1, n('q'))),
            SymmetricObjectProperty(n('q')),
            SameIndividual(frozenset((n('j'), n('k')))),
            different(['i', 'j', 'l', 'm']),
            link('q', 'j', 'm'),
            link('q', 'm', 'k'),
            link('q', 'k', 'j'),
        ],
    )
    assert not kb.reason()
    kb.add(different(['j', 'k', 'm']))
    assert not kb.reason()
    for fact in (link('q', 'k', 'j'), link('q', 'm', 'k')):
        kb.remove(fact)
        assert not kb.reason()
    kb.remove(different(['j', 'k', 'm']))
    assert kb.reason()


@pytest.mark.parametrize(('stated', 'other'), [('a', 'b'), ('b', 'a')])
def test_a_contradiction_goes_when_its_reason_has_been_renamed(stated: str, other: str) -> None:
    x, y, z = (Variable(f'urn:swrl#{name}') for name in 'xyz')
    body = (ObjectPropertyAtom(n('p'), x, y), ObjectPropertyAtom(n('q'), x, z))
    reason = link('p', stated, 'c')
    kb = KnowledgeBase(IRI, [Rule(body, (SameIndividualAtom(y, z),)), different(['c', 'd'])])
    for axiom in (reason, link('q', stated, 'd'), SameIndividual(frozenset((n('a'), n('b'))))):
        kb.add(axiom)
        kb.reason()
    assert not kb.consistent
    kb.change([link('p', other, 'c')], [reason])
    assert not kb.reason()
    kb.remove(link('p', other, 'c'))
    assert kb.reason()


@pytest.mark.parametrize('by_classes', [True, False])
def test_the_same_because_others_differ_ends_with_the_difference(by_classes: bool) -> None:
    same = SameIndividual(frozenset((n('a'), n('b'))))
    apart: list[Axiom] = [different(pair) for pair in ('ac', 'ad', 'bc', 'bd')]
    ends: Axiom = different('cd')
    if by_classes:
        ends = ClassAssertion(n('C'), n('c'))
        apart += [DisjointClasses((n('C'), n('D'))), ClassAssertion(n('D'), n('d'))]
    bound = ClassAssertion(ObjectMaxCardinality(3, n('p')), n('x'))
    kb = KnowledgeBase(IRI, [*apart, ends, bound, *(link('p', 'x', name) for name in 'abcd')])
    kb.reason()
    assert kb.holds(same)
    kb.remove(ends)
    kb.reason()
    assert not kb.holds(same)
    kb.add(ends)
    kb.reason()
    assert kb.holds(same)


def test_the_same_by_a_rule_about_different_individuals_ends_with_the_difference() -> None:
    x, y, z, w = (Variable(f'urn:swrl#{name}') for name in 'xyzw')
    links = [ObjectPropertyAtom(n('q'), x, z), ObjectPropertyAtom(n('q'), y, w)]
    rule = Rule((DifferentIndividualsAtom(x, y), *links), (SameIndividualAtom(z, w),))
    kb = KnowledgeBase(IRI, [rule, link('q', 'a', 'c'), link('q', 'b', 'd'), different('ab')])
    kb.reason()
    assert kb.holds(SameIndividual(frozenset((n('c'), n('d')))))
    kb.remove(different('ab'))
    kb.reason()
    assert not kb.holds(SameIndividual(frozenset((n('c'), n('d')))))


def test_a_difference_that_a_rule_made_ends_with_the_rule_and_the_assertion() -> None:
    x, y = (Variable(f'urn:swrl#{name}') for name in 'xy')
    body = (ClassAtom(n('A'), x), ClassAtom(n('B'), y))
    rule = Rule(body, (DifferentIndividualsAtom(x, y),))
    facts = [ClassAssertion(n('A'), n('a')), ClassAssertion(n('B'), n('b'))]
    kb = KnowledgeBase(IRI, [rule, *facts])
    kb.reason()
    assert kb.holds(different('ab'))
    kb.add(different('ab'))
    kb.reason()
    kb.remove(facts[0])
    kb.reason()
    assert kb.holds(different('ab'))
    kb.remove(different('ab'))
    kb.reason()
    assert not kb.holds(different('ab'))


def test_many_individuals_become_the_same_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    renamed: list[object] = []
    current = equality.Equality.current

    def counted(self: equality.Equality, fact: equality.Fact) -> equality.Fact:
        renamed.append(fact)
        return current(self, fact)

    monkeypatch.setattr(equality.Equality, 'current', counted)
    links = [link('p', f's{one}', f'{end}{one}') for one in range(300) for end in 'xy']
    kb = KnowledgeBase(IRI, [FunctionalObjectProperty(n('p')), *links])
    assert kb.reason()
    assert kb.holds(SameIndividual(frozenset((n('x7'), n('y7')))))
    assert len(renamed) <= 20 * len(links)


def test_what_a_complex_class_left_open_ends_with_its_last_assertion() -> None:
    x = Variable('urn:swrl#x')
    either = ClassAssertion(ObjectUnionOf((n('C'), n('D'))), n('a'))
    kb = KnowledgeBase(
        IRI,
        [
            Rule((ClassAtom(n('A'), x),), (ClassAtom(n('B'), x),)),
            EquivalentClasses((n('E'), ObjectMinCardinality(2, n('p')))),
            link('p', 'x', 'a'),
            link('p', 'x', 'b'),
            either,
        ],
    )
    kb.reason()
    assert kb.unsupported == ()
    kb.remove(either)
    kb.reason()
    fresh = KnowledgeBase(IRI, kb.axioms())
    fresh.reason()
    assert kb.unsupported == fresh.unsupported != ()


def test_facts_that_support_each_other_go_together() -> None:
    kb = KnowledgeBase(
        IRI,
        [
            EquivalentClasses((n('A'), n('B'))),
            SymmetricObjectProperty(n('near')),
            TransitiveObjectProperty(n('near')),
            ClassAssertion(n('A'), n('x')),
            link('near', 'x', 'y'),
            link('near', 'y', 'z'),
        ],
    )
    kb.reason()
    assert kb.types(n('x')) == {n('A'), n('B')}
    assert names(kb.object_values(n('near'), n('z'))) == {'x', 'y', 'z'}
    kb.remove(ClassAssertion(n('A'), n('x')))
    kb.remove(link('near', 'y', 'z'))
    kb.reason()
    assert kb.types(n('x')) == set()
    assert kb.object_values(n('near'), n('z')) == set()
    assert names(kb.object_values(n('near'), n('x'))) == {'x', 'y'}


def test_a_fact_of_cases_that_stays_is_not_told_again() -> None:
    one = DataHasValue(n('p'), Literal('1'))
    sure = ClassAssertion(ObjectUnionOf((one, ObjectIntersectionOf((n('C'), one)))), n('x'))
    kb = KnowledgeBase(n(''), [sure])
    kb.reason()
    assert kb.data_values(n('p'), n('x')) == {Literal('1')}
    feed: list[Changes] = []
    kb.subscribe(feed.append)
    kb.add(ClassAssertion(ObjectUnionOf((n('C'), n('D'))), n('y')))
    feed.clear()
    kb.reason()
    assert feed == []


def test_the_clock_changes_only_the_places_that_cross_the_threshold() -> None:
    kb = seven_rooms()
    feed: list[Changes] = []
    kb.subscribe(feed.append)
    seen = {place: NOW - order for order, place in enumerate(SEVEN_ROOMS)}
    for now in range(NOW + 1, NOW + 12):
        kb.change([value('now', 'Robot1', now)], [value('now', 'Robot1', now - 1)])
        feed.clear()
        kb.reason()
        crossing = {place for place, visit in seen.items() if now - visit == 8}
        come = {axiom for changes in feed for axiom, _ in changes.added}
        assert come == {ClassAssertion(n('URGENT'), n(place)) for place in crossing}
        assert not any(changes.removed for changes in feed)
    kb.change([value('now', 'Robot1', NOW)], [value('now', 'Robot1', NOW + 11)])
    kb.reason()
    assert kb.instances(n('URGENT')) == set()


def test_a_conflict_stays_while_a_rule_has_other_premises_for_it() -> None:
    x, y = Variable('x:x'), Variable('x:y')
    rule = Rule((ObjectPropertyAtom('x:p', x, y),), (SameIndividualAtom(x, 'x:k'),))
    facts = [ObjectPropertyAssertion('x:p', 'x:i', f'x:{one}') for one in 'mn']
    kb = KnowledgeBase('x:', [rule, DifferentIndividuals(frozenset({'x:i', 'x:k'})), *facts])
    assert not kb.reason()
    kb.remove(facts[0])
    assert not kb.reason()
    kb.remove(facts[1])
    assert kb.reason()


def test_what_a_difference_gave_goes_with_the_sameness_it_rested_on() -> None:
    different = DifferentIndividuals(frozenset({'x:j', 'x:k'}))
    rule = Rule(
        (DifferentIndividualsAtom('x:m', Variable('x:y')),), (ClassAtom('x:B', Variable('x:y')),)
    )
    same = SameIndividual(frozenset({'x:k', 'x:m'}))
    kb = KnowledgeBase('x:', [rule, different])
    for _ in range(2):
        assert kb.reason()
        assert not kb.holds(ClassAssertion('x:B', 'x:j'))
        kb.add(same)
        assert kb.reason()
        assert kb.holds(ClassAssertion('x:B', 'x:j'))
        kb.remove(same)
    assert kb.reason()
    assert not kb.holds(ClassAssertion('x:B', 'x:j'))


@pytest.mark.parametrize('seed', range(12))
def test_a_transitive_property_step_by_step_is_as_at_once(seed: int) -> None:
    chosen = random.Random(seed)
    names = [f'x:n{number}' for number in range(9)]
    schema: list[Axiom] = [
        ax.TransitiveObjectProperty('x:p'),
        ax.SubObjectPropertyOf('x:q', 'x:p'),
        ax.SubObjectPropertyOf('x:p', 'x:r'),
        ax.SubObjectPropertyOf('x:r', 'x:s'),
        ax.TransitiveObjectProperty('x:s'),
        ax.InverseObjectProperties('x:s', 'x:t'),
        ax.FunctionalObjectProperty('x:f'),
        ax.SubClassOf('x:A', ex.ObjectHasValue('x:q', names[0])),
    ]
    kb = KnowledgeBase('x:', schema)
    possible: list[Axiom] = [
        ax.ObjectPropertyAssertion(prop, *chosen.sample(names, 2))
        for prop in ('x:p', 'x:q', 'x:q', 'x:s', 'x:f')
        for _ in range(6)
    ]
    possible += [ClassAssertion('x:A', chosen.choice(names)), schema[0], schema[4], schema[1]]
    for _ in range(60):
        changing = chosen.sample(possible, chosen.choice((1, 1, 2, 5)))
        kb.change(
            [axiom for axiom in changing if axiom not in kb],
            [axiom for axiom in changing if axiom in kb],
        )
        assert kb.reason()
        anew = kb.copy()
        anew.reason()
        assert set(kb.derived_facts()) == set(anew.derived_facts())
