"""Every reasoning can be ended: by time, steps, memory or from outside, and all is as before."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from itertools import count, pairwise
from typing import Any

import pytest

from owl_reasoner import KnowledgeBase, ReasoningBudgetError
from owl_reasoner.notifier import Changes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, SubClassOf
from owl_reasoner.owl.expressions import Literal, Variable
from owl_reasoner.owl.vocabulary import SWRLB
from owl_reasoner.reasoner.budget import Progress

from .patrol_map import n, seven_rooms

A, B, N, T, R, LOG, J = 'x:A', 'x:B', 'x:N', 'x:T', 'x:r', 'x:log', 'x:i'
_V = [Variable(f'urn:v{number}') for number in range(5)]


def product(size: int) -> list[Axiom]:
    """Return a rule that joins four individuals with four others, for whoever is a T."""
    members = [f'x:n{number}' for number in range(size)]
    body: list[ex.Atom] = [ex.ClassAtom(T, _V[0])]
    body += [ex.ClassAtom(N, variable) for variable in _V[1:]]
    body += [ex.DifferentIndividualsAtom(*pair) for pair in pairwise(_V[1:])]
    return [
        ax.Rule(tuple(body), (ex.ObjectPropertyAtom(R, _V[1], _V[4]),)),
        ax.DifferentIndividuals(frozenset(members)),
        *(ClassAssertion(N, name) for name in members),
    ]


def pairs(size: int) -> list[Axiom]:
    """Return a rule that relates everybody to everybody."""
    body = (ex.ClassAtom(T, _V[0]), ex.ClassAtom(N, _V[1]), ex.ClassAtom(N, _V[2]))
    return [
        ax.Rule(body, (ex.ObjectPropertyAtom(R, _V[1], _V[2]),)),
        *(ClassAssertion(N, f'x:n{number}') for number in range(size)),
    ]


def growing() -> list[Axiom]:
    """Return a rule that doubles a text."""
    body = (
        ex.DataPropertyAtom(LOG, _V[0], _V[1]),
        ex.BuiltinAtom(SWRLB + 'stringConcat', (_V[2], _V[1], _V[1])),
    )
    return [ax.Rule(body, (ex.DataPropertyAtom(LOG, _V[0], _V[2]),))]


def pigeons(size: int) -> list[Axiom]:
    """Return classes by which so many find no places for themselves, which takes all cases."""
    places = [f'x:p{number}' for number in range(size - 1)]
    return [
        ax.DisjointClasses((*places,)),
        SubClassOf(A, ex.ObjectMinCardinality(size, R, ex.ObjectUnionOf((*places,)))),
        *(SubClassOf(A, ex.ObjectMaxCardinality(1, R, place)) for place in places),
        ax.Declaration('individual', J),
        SubClassOf('x:C', ex.ObjectUnionOf((A, B))),
        ClassAssertion('x:C', J),
    ]


def ticking() -> Callable[[], float]:
    """Return a clock that goes on a second with each look."""
    seconds = count()
    return lambda: float(next(seconds))


def expect_as_before(kb: KnowledgeBase, before: set[Axiom]) -> None:
    kb.revert()
    assert kb.reason()
    assert set(kb.facts()) == before
    assert not kb.stale


@pytest.mark.parametrize(
    ('axioms', 'change', 'named'),
    [
        (product(40), ClassAssertion(T, 'x:t'), 'Rule'),
        (pairs(60), ClassAssertion(T, 'x:t'), 'Rule'),
        (pigeons(6)[:-1], pigeons(6)[-1], ''),
    ],
    ids=['product', 'pairs', 'cases'],
)
@pytest.mark.parametrize('limit', ['seconds', 'steps', 'cancelled'])
def test_a_reasoning_ends_and_leaves_what_was_before(
    axioms: list[Axiom], change: Axiom, named: str, limit: str
) -> None:
    kb = KnowledgeBase('x:', axioms, clock=ticking())
    assert kb.reason()
    before: set[Axiom] = set(kb.facts())
    assert kb.add(change)
    asked = count()
    limits: dict[str, Any] = {
        'seconds': {'timeout': 5},
        'steps': {'steps': 300},
        'cancelled': {'cancel': lambda: next(asked) > 3},
    }
    with pytest.raises(ReasoningBudgetError) as caught:
        kb.reason(**limits[limit])
    assert caught.value.limit == limit
    assert caught.value.at_work
    assert named in str(caught.value) or caught.value.at_work in str(caught.value)
    assert change in kb
    assert kb.stale
    expect_as_before(kb, before)


def test_every_step_count_ends_cleanly_or_completes() -> None:
    axioms = [*pigeons(4), *pairs(5), ClassAssertion(T, 'x:t')]
    whole = KnowledgeBase('x:', axioms)
    assert whole.reason()
    for steps in range(0, 4_000, 130):
        kb = KnowledgeBase('x:', axioms)
        try:
            kb.reason(steps=steps)
        except ReasoningBudgetError:
            kb.reason()
        assert set(kb.facts()) == set(whole.facts())


def test_memory_is_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = count(0, 10_000_000)
    monkeypatch.setattr('owl_reasoner.reasoner.budget._resident', lambda: float(next(sizes)))
    kb = KnowledgeBase('x:', [*pairs(60), ClassAssertion(T, 'x:t')], clock=ticking())
    with pytest.raises(ReasoningBudgetError, match='more than 50,000,000 bytes') as caught:
        kb.reason(memory=50_000_000)
    assert caught.value.limit == 'memory'


def test_an_event_cancels() -> None:
    event = threading.Event()
    kb = KnowledgeBase('x:', [*pairs(20), ClassAssertion(T, 'x:t')])
    assert kb.reason(cancel=event)
    event.set()
    kb.add(ClassAssertion(T, 'x:u'))
    with pytest.raises(ReasoningBudgetError, match='cancelled'):
        kb.reason(cancel=event)


def test_progress_is_told() -> None:
    told: list[Progress] = []
    kb = KnowledgeBase('x:', [*pairs(30), ClassAssertion(T, 'x:t')], clock=ticking())
    assert kb.reason(progress=told.append)
    assert {one.stage for one in told} >= {'deriving facts'}
    assert [one.steps for one in told] == sorted(one.steps for one in told)


def test_a_text_that_a_rule_grows_is_reported() -> None:
    kb = KnowledgeBase('x:', [*growing(), ax.DataPropertyAssertion(LOG, J, Literal('a'))])
    assert kb.reason()
    assert any('grow without end' in one for one in kb.unsupported)
    assert max(len(one.lexical) for one in kb.data_values(LOG, J)) < 200_000


def test_the_first_reasoning_can_be_ended() -> None:
    kb = KnowledgeBase('x:', [*pairs(30), ClassAssertion(T, 'x:t')])
    with pytest.raises(ReasoningBudgetError):
        kb.reason(steps=50)
    assert kb.instances(N) == {f'x:n{number}' for number in range(30)}
    assert kb.stale
    assert kb.reason()
    assert len(list(kb.derived_facts())) == 900


def test_subscribers_hear_of_an_ended_reasoning_nothing() -> None:
    told: list[Changes] = []
    kb = KnowledgeBase('x:', [*pairs(30), ClassAssertion(B, J), SubClassOf(B, A)])
    kb.reason()
    kb.subscribe(told.append)
    kb.add(ClassAssertion(T, 'x:t'))
    del told[:]
    with pytest.raises(ReasoningBudgetError):
        kb.reason(steps=100)
    assert told == []
    kb.reason()
    (changes,) = told
    assert len(changes.added) == 900
    assert changes.removed == ()


def test_revert_takes_back_axioms_of_every_kind() -> None:
    axioms = [SubClassOf(A, B), ClassAssertion(A, J), ax.Declaration('class', A)]
    kb = KnowledgeBase('x:', axioms)
    kb.reason()
    kb.change([SubClassOf(B, N), ClassAssertion(T, J)], axioms[:2])
    assert kb.revert() == 4
    assert set(kb.axioms()) == set(axioms)
    assert kb.reason()
    assert kb.types(J) == {A, B}
    assert kb.revert() == 0


def test_an_error_of_another_kind_leaves_it_usable(monkeypatch: pytest.MonkeyPatch) -> None:
    kb = KnowledgeBase('x:', [SubClassOf(A, B), ClassAssertion(A, J)])
    kb.reason()

    def fail(*_: object) -> Iterator[None]:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr('owl_reasoner.reasoner.engine.Engine.update', fail)
        kb.add(ClassAssertion(N, J))
        with pytest.raises(ReasoningBudgetError, match='all memory'):
            kb.reason()
    assert kb.reason()
    assert kb.types(J) == {A, B, N}


def test_an_explanation_ends_at_its_limits_and_leaves_what_is_derived() -> None:
    kb = seven_rooms()
    fact = ClassAssertion(n('CORRIDOR'), n('C1'))
    for ask in (kb.explain, kb.justification):
        with pytest.raises(ReasoningBudgetError) as told:
            ask(fact, steps=100)
        assert told.value.limit == 'steps'
        with pytest.raises(ReasoningBudgetError):
            ask(fact, cancel=lambda: True)
        assert kb.holds(fact)
        assert not kb.stale
        assert ask(fact)
