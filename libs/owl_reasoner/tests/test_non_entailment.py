"""Why a fact does not hold: what the nearest rule or definition lacks."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, EquivalentClasses, SubClassOf
from owl_reasoner.owl.expressions import ObjectIntersectionOf, ObjectSomeValuesFrom
from owl_reasoner.reasoner.non_entailment import Absence

from .patrol_map import NOW, VISITS, link, n, seven_rooms, value
from .small_ontologies import A, B, C, D, P, i, is_a, j, k, rel
from .wide_ontologies import CLASSES, INDIVIDUALS, OBJECTS, WideOntology


def absence(kb: KnowledgeBase, fact: Axiom) -> Absence:
    found = kb.explain_absence(fact)
    assert found is not None
    return found


def test_a_rule_whose_calculation_fails() -> None:
    kb = seven_rooms()
    kb.change([value('visitedAt', 'R3', NOW)], [axiom for axiom in VISITS if 'R3' in repr(axiom)])
    kb.reason()
    found = absence(kb, ClassAssertion(n('URGENT'), n('R3')))
    lacking = f'now {NOW} - visitedAt {NOW} = 0 > urgencyThreshold 7'
    assert found.because == 'the rule Urgency'
    assert found.missing == (lacking,)
    assert found.sentence() == (
        f'R3 is URGENT would follow from the rule Urgency, which lacks: {lacking}'
    )


def test_the_robot_is_named_where_there_are_two() -> None:
    # Each robot has a clock of its own.
    kb = seven_rooms()
    kb.change(
        [
            value('visitedAt', 'R3', NOW),
            value('now', 'Robot2', NOW + 20),
            value('urgencyThreshold', 'Robot2', 50),
        ],
        [axiom for axiom in VISITS if 'R3' in repr(axiom)],
    )
    kb.reason()
    fact = ClassAssertion(n('URGENT'), n('R3'))
    assert any('Robot' in text and 'now' in text for text in absence(kb, fact).missing)
    kb.change([value('urgencyThreshold', 'Robot2', 5)], [value('urgencyThreshold', 'Robot2', 50)])
    kb.reason()
    explanation = kb.explain(fact)
    assert explanation is not None
    assert explanation.sentence() == (
        f'R3 is URGENT because Robot2 now {NOW + 20} - visitedAt {NOW} = 20'
        ' > Robot2 urgencyThreshold 5'
    )


def test_a_missing_connection() -> None:
    found = absence(seven_rooms(), link('canReach', 'Robot1', 'R3'))
    assert found.missing == ('E connectedTo R3',)
    assert found.facts == (link('connectedTo', 'E', 'R3'),)


def test_a_bound_says_how_many_are_known() -> None:
    found = absence(seven_rooms(), ClassAssertion(n('CORRIDOR'), n('R1')))
    assert found.missing == ('R1 hasDoor at least 2 different ones (1 is known)',)


def test_unnamed_classes_give_way_to_what_would_fill_them() -> None:
    both = ObjectIntersectionOf((B, ObjectSomeValuesFrom(P, ObjectIntersectionOf((C, D)))))
    kb = KnowledgeBase('x:', [EquivalentClasses((A, both)), is_a(B, i), rel(P, i, j), is_a(C, j)])
    kb.reason()
    found = absence(kb, is_a(A, i))
    assert found.missing == ('x:j is x:D',)
    assert found.facts == (is_a(D, j),)
    assert absence(kb, is_a(A, k)).missing[0] == 'x:k is x:B'


def test_what_holds_or_cannot_follow() -> None:
    kb = KnowledgeBase('x:', [SubClassOf(A, B), is_a(A, i)])
    assert kb.explain_absence(is_a(B, i)) is None
    kb.reason()
    assert kb.explain_absence(is_a(B, i)) is None
    assert absence(kb, is_a(B, j)).missing == ('x:j is x:A',)
    assert absence(kb, is_a(C, j)).sentence() == (
        'x:j is x:C does not follow: no rule or axiom could derive it'
    )


@pytest.mark.parametrize('seed', range(60))
def test_with_what_is_missing_the_fact_holds(seed: int) -> None:
    drawn = WideOntology(seed, cases=0.0)
    kb = KnowledgeBase('x:', drawn.ontology(6, 8))
    if not kb.reason():
        return
    facts = [ClassAssertion(cls, one) for cls in CLASSES for one in INDIVIDUALS]
    facts += [rel(prop, INDIVIDUALS[0], one) for prop in OBJECTS for one in INDIVIDUALS]
    for fact in facts:
        found = kb.explain_absence(fact)
        assert (found is None) == kb.holds(fact)
        if found is not None and found.because and len(found.facts) == len(found.missing):
            fuller = KnowledgeBase('x:', [*kb.axioms(), *found.facts])
            assert not fuller.reason() or fuller.holds(fact), found
