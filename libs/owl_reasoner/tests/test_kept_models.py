"""Reasoning by cases from change to change: what is kept may never be seen in an answer."""

from __future__ import annotations

import math
import random

import pytest

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom, SubClassOf
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.budget import ReasoningBudgetError
from owl_reasoner.reasoner.datatypes import value_of
from owl_reasoner.reasoner.hypertableau.incremental import is_plain

from .patrol_map import NOW, n, seven_rooms, value
from .small_ontologies import A, B, C, D, P, base, differ, i, is_a, j, k, rel
from .wide_ontologies import DenseOntology, WideOntology

DEAD_END = ax.EquivalentClasses(
    (
        n('DeadEnd'),
        ex.ObjectIntersectionOf((n('LOCATION'), ex.ObjectExactCardinality(1, n('hasDoor')))),
    )
)


def test_what_an_axiom_that_takes_cases_does_not_ask_for_changes_without_a_new_search() -> None:
    kb = seven_rooms(DEAD_END)
    assert kb.cost
    for later in range(3):
        assert kb.change([value('now', 'Robot1', NOW + later + 1)], kb_now(kb))
        kb.reason()
    kb.change([value('now', 'Robot1', NOW + 1000)], kb_now(kb))
    kb.reason(steps=800)  # From nothing it takes thousands.
    assert n('R3') in kb.instances(n('URGENT'))
    with pytest.raises(ReasoningBudgetError):
        kb.copy().reason(steps=800)


def values_of(kb: KnowledgeBase, prop: str, name: str) -> list[Axiom]:
    """Return what gives an individual values of a property."""
    return [
        axiom
        for axiom in kb.axioms_about(n(name))
        if isinstance(axiom, ax.DataPropertyAssertion) and axiom.prop == n(prop)
    ]


def kb_now(kb: KnowledgeBase) -> list[Axiom]:
    """Return what says what time it is."""
    return values_of(kb, 'now', 'Robot1')


def test_visits_of_one_place_after_the_other_take_no_new_search() -> None:
    kb = seven_rooms(DEAD_END)
    places = ('R1', 'R2', 'C1', 'R3', 'C2', 'R4')
    for turn, place in enumerate(places * 2):
        gone = [*kb_now(kb), *values_of(kb, 'visitedAt', place)]
        later = NOW + turn + 1
        kb.change([value('now', 'Robot1', later), value('visitedAt', place, later)], gone)
        kb.reason(steps=1500 if turn > 5 else math.inf)
        if turn in (3, 6, 11):
            assert facts_of(kb) == facts_of(fresh_of(kb))
    # A place must have a time of visit: one that is not told anew has an unknown one.
    kb.change((), values_of(kb, 'visitedAt', 'R1'))
    kb.reason()
    assert facts_of(kb) == facts_of(fresh_of(kb))
    kb.change([value('visitedAt', 'R1', NOW), value('visitedAt', 'R1', NOW + 1)])
    assert not kb.reason()


def fresh_of(kb: KnowledgeBase) -> KnowledgeBase:
    """Return another one with the same assertions, reasoned over from nothing."""
    fresh = kb.copy()
    fresh.reason()
    return fresh


@pytest.mark.parametrize('seed', range(12))
def test_values_that_come_and_go_leave_what_a_fresh_start_finds(seed: int) -> None:
    draw = random.Random(seed)
    at, size = 'x:at', 'x:size'
    axioms: list[Axiom] = [
        ax.FunctionalDataProperty(at),
        SubClassOf(A, ex.ObjectUnionOf((B, C))),
        SubClassOf(B, ex.DataMinCardinality(draw.randint(1, 2), size, XSD + 'integer')),
        SubClassOf(A, ex.DataSomeValuesFrom(at, XSD + 'integer')),
        SubClassOf(ex.DataSomeValuesFrom(at, ex.DataOneOf((Literal('1', XSD + 'integer'),))), D),
        SubClassOf(ex.DataHasValue(size, Literal('2', XSD + 'integer')), C),
        SubClassOf(ex.ObjectIntersectionOf((B, D)), ex.DataAllValuesFrom(size, XSD + 'integer')),
        ax.DisjointClasses((C, D))
        if draw.random() < 0.5
        else SubClassOf(ex.DataSomeValuesFrom(at, XSD + 'integer'), A),
        *(is_a(A, one) for one in (i, j, k)),
        rel(P, i, j),
        SubClassOf(ex.ObjectSomeValuesFrom(P, D), C),
    ]
    told = [
        ax.DataPropertyAssertion(prop, one, Literal(str(number), XSD + 'integer'))
        for prop in (at, size)
        for one in (i, j, k)
        for number in (1, 2, 3)
    ]
    kb = KnowledgeBase('x:', [*axioms, *draw.sample(told, 4)])
    kb.reason()
    for _ in range(25):
        present = [axiom for axiom in told if axiom in kb]
        come = draw.sample(told, draw.randint(0, 1))
        kb.change(come, draw.sample(present, min(len(present), draw.randint(0, 2))))
        consistent = kb.reason()
        fresh = kb.copy()
        assert fresh.reason() == consistent
        assert facts_of(kb) == facts_of(fresh)


def test_a_change_against_a_choice_that_was_kept() -> None:
    kb = base(
        SubClassOf(A, ex.ObjectUnionOf((B, C))),
        ax.DisjointClasses((B, D)),
        SubClassOf('x:E', C),
        *(is_a(A, one) for one in (i, j, k)),
        is_a(D, i),
        is_a(D, j),
        differ(i, j, k),
    )
    for one in (i, j, i, i, j, j, k, k, i):
        change = is_a(D, one)
        _ = kb.remove(change) if change in kb else kb.add(change)
        assert kb.reason()
        for other in (i, j, k):
            assert kb.types(other) == ({A, C, D} if is_a(D, other) in kb else {A})


def test_a_change_that_contradicts_everything_is_taken_back() -> None:
    kb = base(
        SubClassOf(A, ex.ObjectUnionOf((B, C))),
        ax.DisjointClasses((B, C, D)),
        SubClassOf(ex.ObjectSomeValuesFrom(P, D), D),
        is_a(A, i),
        is_a(D, j),
        is_a('x:E', i),
    )
    for _ in range(3):
        kb.remove(is_a('x:E', i))
        assert kb.reason()
        kb.add(is_a('x:E', i))
        kb.add(rel(P, i, j))
        assert not kb.reason()
        kb.remove(rel(P, i, j))
        assert kb.reason()
        assert kb.types(i) == {A, 'x:E'}


def facts_of(kb: KnowledgeBase) -> set[object]:
    """Return all facts, values whatever their spelling."""
    return {
        (fact.prop, fact.subject, value_of(fact.literal))
        if isinstance(fact, ax.DataPropertyAssertion)
        else fact
        for fact in kb.facts()
    }


@pytest.mark.parametrize('kind', [WideOntology, DenseOntology])
@pytest.mark.parametrize('seed', range(8))
def test_assertions_that_come_and_go_leave_what_a_fresh_start_finds(
    kind: type[WideOntology], seed: int
) -> None:
    drawn = kind(seed)
    axioms = drawn.ontology(6, 10)
    kb = KnowledgeBase('x:', axioms)
    shown: set[Axiom] = set()

    def listen(changes: object) -> None:
        shown.difference_update(axiom for axiom, derived in changes.removed if derived)  # type: ignore[attr-defined]
        shown.update(axiom for axiom, derived in changes.added if derived)  # type: ignore[attr-defined]

    kb.subscribe(listen)
    kb.reason()
    changing = [
        axiom for axiom in (*axioms, drawn.assertion(), drawn.assertion()) if is_plain((axiom,))
    ][-6:]
    if not changing:
        return
    for _ in range(5):
        axiom = drawn.random.choice(changing)
        _ = kb.remove(axiom) if axiom in kb else kb.add(axiom)
        consistent = kb.reason()
        fresh = KnowledgeBase('x:', kb.axioms())
        assert fresh.reason() == consistent
        if kb.unsupported or fresh.unsupported:
            continue
        assert facts_of(kb) == facts_of(fresh)
        assert len(shown) == (len(list(kb.derived_facts())) if consistent else 0)
        for cls in drawn.classes:
            assert kb.superclasses(cls) == fresh.superclasses(cls)
