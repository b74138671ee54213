"""Why a fact holds and why an ontology is inconsistent, in words."""

from __future__ import annotations

from collections.abc import Iterable

from owl_reasoner import KnowledgeBase, Unknown
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    DisjointClasses,
    FunctionalObjectProperty,
    InverseFunctionalObjectProperty,
    ObjectPropertyAssertion,
    SameIndividual,
    SubClassOf,
    SubDataPropertyOf,
    SubObjectPropertyOf,
)
from owl_reasoner.owl.expressions import Literal, ObjectSomeValuesFrom, ObjectUnionOf

from .patrol_map import (
    IRI,
    NOW,
    PLACES_DIFFER,
    VISITS,
    link,
    n,
    seven_rooms,
    value,
)
from .small_ontologies import (
    A,
    B,
    C,
    P,
    Q,
    S,
    T,
    base,
    differ,
    has,
    i,
    is_a,
    j,
    k,
    m,
    num,
    rel,
    same,
)


def test_urgency_is_explained_by_its_calculation() -> None:
    kb = seven_rooms()
    kb.change([value('now', 'Robot1', NOW + 20)], [value('now', 'Robot1', NOW)])
    kb.change([value('visitedAt', 'R3', NOW)], [axiom for axiom in VISITS if 'R3' in repr(axiom)])
    kb.reason()
    explanation = kb.explain(ClassAssertion(n('URGENT'), n('R3')))
    assert explanation is not None
    assert explanation.sentence() == (
        f'R3 is URGENT because now {NOW + 20} - visitedAt {NOW} = 20 > urgencyThreshold 7'
    )
    assert explanation.kind == 'rule'
    assert explanation.because == 'the rule Urgency'
    assert {premise.fact_text for premise in explanation.premises} == {
        f'Robot1 now {NOW + 20}',
        f'R3 visitedAt {NOW}',
        'Robot1 urgencyThreshold 7',
    }
    assert all(premise.kind == 'asserted' for premise in explanation.premises)


def test_reachability_is_explained_down_to_the_assertions() -> None:
    explanation = seven_rooms().explain(link('canReach', 'Robot1', 'C1'))
    assert explanation is not None
    lines = explanation.tree().splitlines()
    assert lines[:7] == [
        'Robot1 canReach C1  [by the rule Reachability]',
        '  E is different from C1  [by C1, C2, E, R1, R2, 2 more are all different]',
        '  Robot1 isIn E  [asserted]',
        '  E connectedTo C1  [by the rule Connectability]',
        '    C1 hasDoor D6  [asserted]',
        '    E hasDoor D6  [asserted]',
        '    E is different from C1  [by C1, C2, E, R1, R2, 2 more are all different]',
    ]
    # The rules ask for classes that other axioms imply: those stand at the end.
    assert '  range of hasDoor is DOOR  [asserted]' in lines[7:]
    assert holds_in(explanation.sources(), link('canReach', 'Robot1', 'C1'))


def test_membership_is_explained_by_its_definition() -> None:
    explanation = seven_rooms().explain(ClassAssertion(n('CORRIDOR'), n('E')))
    assert explanation is not None
    assert explanation.sentence() == (
        'E is CORRIDOR because E hasDoor D6, E hasDoor D7 and D6 is different from D7'
        ' (CORRIDOR EquivalentTo (LOCATION and hasDoor min 2 DOOR))'
    )


def test_difference_is_explained() -> None:
    kb = seven_rooms(without=[PLACES_DIFFER])
    explanation = kb.explain(DifferentIndividuals(frozenset((n('E'), n('C1')))))
    assert explanation is not None
    assert f'E visitedAt {NOW}' in explanation.tree()
    assert f'C1 visitedAt {NOW - 1}' in explanation.tree()


def test_sameness_is_explained() -> None:
    kb = seven_rooms(link('isIn', 'Robot1', 'C1'), without=[PLACES_DIFFER, *VISITS])
    explanation = kb.explain(SameIndividual(frozenset((n('E'), n('C1')))))
    assert explanation is not None
    assert explanation.because == 'isIn is functional'
    shared = kb.explain(link('hasDoor', 'E', 'D1'))
    assert shared is not None
    assert 'C1 hasDoor D1  [asserted]' in shared.tree()
    assert 'is the same as' in shared.tree()


def test_what_is_asserted_and_what_does_not_hold() -> None:
    kb = seven_rooms()
    asserted = kb.explain(link('isIn', 'Robot1', 'E'))
    assert asserted is not None
    assert asserted.sentence() == 'Robot1 isIn E because it is asserted'
    assert kb.explain(link('isIn', 'Robot1', 'C1')) is None
    assert kb.explain(ClassAssertion(n('URGENT'), n('R1'))) is None
    assert kb.explain(ClassAssertion(n('NOSUCH'), n('R1'))) is None
    assert kb.explain(SubClassOf(n('CORRIDOR'), n('ROOM'))) is not None
    assert kb.explain(SubClassOf(n('ROOM'), n('CORRIDOR'))) is None
    assert kb.explain_inconsistency() is None


def test_two_places_at_once_are_explained() -> None:
    explanation = seven_rooms(link('isIn', 'Robot1', 'C1')).explain_inconsistency()
    assert explanation is not None
    assert explanation.sentence() == (
        'the ontology is inconsistent because Robot1 isIn C1, Robot1 isIn E'
        ' and C1 is different from E (isIn is functional)'
    )


def test_two_visits_are_explained() -> None:
    kb = seven_rooms(value('visitedAt', 'R4', 5))
    explanation = kb.explain_inconsistency()
    assert explanation is not None
    assert 'R4 visitedAt 5' in explanation.sentence()
    assert f'R4 visitedAt {NOW - 6}' in explanation.sentence()
    assert 'visitedAt exactly 1 long' in explanation.sentence()


def test_disjoint_classes_are_explained() -> None:
    explanation = seven_rooms(link('hasDoor', 'R1', 'C2')).explain_inconsistency()
    assert explanation is not None
    assert 'these classes are disjoint' in explanation.sentence()
    assert 'C2 is DOOR' in explanation.tree()


def test_a_subclass_fact_is_explained_by_its_axioms() -> None:
    kb = KnowledgeBase(
        IRI,
        [
            SubClassOf(n('A'), ObjectSomeValuesFrom(n('p'), n('B'))),
            SubClassOf(n('B'), n('C')),
            SubClassOf(n('B'), n('E')),
            SubClassOf(ObjectSomeValuesFrom(n('p'), n('C')), n('D')),
            SubClassOf(n('D'), n('E')),
            ClassAssertion(n('A'), n('i')),
        ],
    )
    kb.reason()
    fact = SubClassOf(n('A'), n('D'))
    explanation = kb.explain(fact)
    assert explanation is not None
    texts = {premise.fact_text for premise in explanation.premises}
    assert texts == {'A SubClassOf p some B', 'B SubClassOf C', 'p some C SubClassOf D'}
    assert set(kb.justification(fact)) == set(explanation.sources())
    why = kb.explain(ClassAssertion(n('D'), n('i')))
    assert why is not None
    assert all(text in why.tree() for text in texts)


def test_a_justification_is_enough_and_no_axiom_of_it_is_spare() -> None:
    kb = seven_rooms(link('isIn', 'Robot1', 'C1'), without=[PLACES_DIFFER, *VISITS])
    facts = [
        *(ClassAssertion(n(cls), n('E')) for cls in ('ROOM', 'CORRIDOR', 'LOCATION')),
        SameIndividual(frozenset((n('E'), n('C1')))),
        link('hasDoor', 'E', 'D1'),
        SubClassOf(n('CORRIDOR'), n('LOCATION')),
    ]
    for fact in facts:
        axioms = kb.justification(fact)
        assert axioms
        assert holds_in(axioms, fact)
        for spare in axioms:
            assert not holds_in([axiom for axiom in axioms if axiom != spare], fact)


def test_an_explanation_that_took_too_long_to_shorten_says_so() -> None:
    kb = seven_rooms()
    fact = SubClassOf(n('CORRIDOR'), n('LOCATION'))
    short = kb.explain(fact)
    kb.patience = -1.0
    long = kb.explain(fact)
    assert short is not None
    assert long is not None
    assert short.because == 'these axioms together'
    assert long.because == 'these axioms together, perhaps not all of them'
    assert set(long.sources()) > set(short.sources())
    assert holds_in(long.sources(), fact)


def test_a_contradiction_has_a_justification() -> None:
    kb = seven_rooms(link('isIn', 'Robot1', 'C1'))
    axioms = kb.justification(None)
    assert set(axioms) >= {link('isIn', 'Robot1', 'C1'), link('isIn', 'Robot1', 'E')}
    assert len(axioms) == 4
    assert not KnowledgeBase(IRI, axioms).reason()
    assert seven_rooms().justification(None) == ()


def holds_in(axioms: Iterable[Axiom], fact: Axiom) -> bool:
    kb = KnowledgeBase(IRI, axioms)
    return kb.reason() and kb.holds(fact)


def test_a_fact_about_an_anonymous_individual_is_explained() -> None:
    """Foreign ontologies (SOSA's mapping to O&M) have blank nodes, and facts about them follow."""
    some, same = '_:b1', SameIndividual(frozenset((n('k'), '_:b1')))
    kb = KnowledgeBase(
        IRI,
        [
            SubClassOf(n('A'), ObjectUnionOf((n('B'), n('C')))),
            SubClassOf(n('B'), n('D')),
            SubClassOf(n('C'), n('D')),
            ClassAssertion(n('A'), some),
            InverseFunctionalObjectProperty(n('r')),
            link('r', 'k', 'j'),
            ObjectPropertyAssertion(n('r'), some, n('j')),
            SubObjectPropertyOf(n('r'), n('s')),
        ],
    )
    kb.reason()
    for fact in (same, ClassAssertion(n('D'), some), ObjectPropertyAssertion(n('s'), some, n('j'))):
        explanation = kb.explain(fact)
        assert explanation is not None
        needed = set(kb.justification(fact))
        assert needed == set(explanation.sources())
        assert holds_in(needed, fact)
        assert not any(holds_in(needed - {axiom}, fact) for axiom in needed)


def test_a_text_with_the_mark_of_anonymous_individuals_is_a_text() -> None:
    stated, above = (DataPropertyAssertion(n(prop), n('i'), Literal('a_:b')) for prop in ('d', 'e'))
    kb = KnowledgeBase(IRI, [stated, SubDataPropertyOf(n('d'), n('e'))])
    kb.reason()
    assert kb.explain(above) is not None
    assert kb.entails(DataPropertyAssertion(n('e'), n('j'), Literal('a_:b'))) is False


def test_the_difference_of_two_is_explained_itself_and_that_of_more_by_pairs() -> None:
    kb = base(
        DisjointClasses((A, B)), is_a(A, i), is_a(B, j), differ(i, k), differ(j, k), is_a(C, m)
    )
    explanation = kb.explain(differ(i, j))
    assert explanation is not None
    assert explanation.tree().splitlines() == [
        'x:i is different from x:j  [by x:A DisjointWith x:B]',
        '  x:i is x:A  [asserted]',
        '  x:j is x:B  [asserted]',
    ]
    explanation = kb.explain(differ(i, j, k))
    assert explanation is not None
    assert explanation.tree().splitlines() == [
        'x:i, x:j, x:k are all different  [by each differs from each other one]',
        '  x:i is different from x:j  [by x:A DisjointWith x:B]',
        '    x:i is x:A  [asserted]',
        '    x:j is x:B  [asserted]',
        '  x:i is different from x:k  [by x:i, x:k are all different]',
        '  x:j is different from x:k  [by x:j, x:k are all different]',
    ]
    assert kb.explain(differ(i, m)) is None
    assert kb.explain(differ(i, j, m)) is None


def test_the_sameness_of_two_is_explained_itself_and_that_over_others_by_steps() -> None:
    kb = base(same(i, j), same(j, k), is_a(C, m))
    explanation = kb.explain(same(i, k))
    assert explanation is not None
    assert explanation.tree().splitlines() == [
        'x:i, x:k are the same  [by the same individual under another name]',
        '  x:i is the same as x:j  [asserted]',
        '  x:j is the same as x:k  [asserted]',
    ]
    assert kb.explain(same(i, m)) is None
    assert kb.explain(same(i, j, m)) is None
    kb = base(FunctionalObjectProperty(P), rel(P, i, j), rel(P, i, k))
    explanation = kb.explain(same(j, k))
    assert explanation is not None
    assert (explanation.fact_text, explanation.because) == (
        'x:j is the same as x:k',
        'x:p is functional',
    )


def test_what_makes_both_ends_of_a_link_the_same_is_told_once() -> None:
    kb = base(same(i, j), rel(P, j, j))
    explanation = kb.explain(rel(P, i, i))
    assert explanation is not None
    assert explanation.tree().splitlines() == [
        'x:i x:p x:i  [by the same individual under another name]',
        '  x:j x:p x:j  [asserted]',
        '  x:i is the same as x:j  [asserted]',
    ]


def test_one_premise_that_makes_two_the_same_is_told_once() -> None:
    kb = base(
        FunctionalObjectProperty(P),
        SubObjectPropertyOf(Q, P),
        rel(P, i, i),
        rel(Q, i, j),
        is_a(A, j),
    )
    explanation = kb.explain(is_a(A, i))
    assert explanation is not None
    lines = explanation.tree().splitlines()
    assert len(set(lines)) == len(lines)


def test_a_value_is_told_as_it_is_asserted_of_the_same_individual() -> None:
    """Another individual has the same number as a value of another datatype."""
    one, other = num(5, 'unsignedInt'), num(5, 'long')
    for first, second in ((j, i), (i, j)):
        kb = base(
            has(S, first, one if first == j else other),
            has(S, second, other if second == i else one),
            SubDataPropertyOf(S, T),
        )
        for individual, literal, text in ((i, other, '5'), (j, one, '"5"^^unsignedInt')):
            explanation = kb.explain(has(T, individual, num(5)))
            assert explanation is not None
            assert explanation.tree().splitlines() == [
                f'{individual} x:t {text}  [by x:s SubPropertyOf x:t]',
                f'  {individual} x:s {text}  [asserted]',
            ]
            assert explanation.sources()[1:] == (has(S, individual, literal),)


def test_of_somebody_without_a_name_it_is_unknown_what_follows() -> None:
    kb = KnowledgeBase(n('o'), [ClassAssertion(n('A'), '_:x')])
    kb.reason()
    assert kb.entails(ClassAssertion(n('A'), '_:x')) is True, 'it is asserted'
    answer = kb.entails(ClassAssertion(n('B'), '_:x'))
    assert isinstance(answer, Unknown)
    assert 'somebody without a name' in str(answer)
