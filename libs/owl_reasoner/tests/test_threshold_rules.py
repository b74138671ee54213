"""Rules that compare values by a sorted index, beside a look at every pair of values."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl.axioms import Axiom, Rule
from owl_reasoner.owl.expressions import (
    Atom,
    ClassAtom,
    DataPropertyAtom,
    Literal,
    ObjectPropertyAtom,
    SameIndividualAtom,
    Variable,
)
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.clauses import Clause
from owl_reasoner.reasoner.threshold_rules import split_rule
from owl_reasoner.reasoner.translation import Translation

from .all_models import COMPARISONS
from .small_ontologies import A, B, P, U, V, X, Y, base, computed, has, i, is_a, j, k, num, rel

NOW, LIMIT, SEEN = 'x:now', 'x:limit', 'x:seen'
R, L, T, H, D = (Variable(name) for name in 'rlthd')
FACTS: tuple[Atom, ...] = (
    DataPropertyAtom(NOW, R, T),
    DataPropertyAtom(LIMIT, R, H),
    DataPropertyAtom(SEEN, L, V),
)
LATE = ClassAtom(A, L)
ORDERS = ('greaterThan', 'greaterThanOrEqual', 'lessThan', 'lessThanOrEqual')
TEXTS = [
    *(('integer', str(number)) for number in range(-1, 5)),
    *(('decimal', text) for text in ('0.5', '1.5', '2.0')),
    *(('double', text) for text in ('1.5', '2', 'NaN', 'INF')),
]


class Shape(NamedTuple):
    """A rule that compares two values, and what these are of a time, a limit and what was seen."""

    body: tuple[Atom, ...]
    compared: tuple[Variable, Variable]
    sides: Callable[[float, float, float], tuple[float, float]]

    def rule(self, comparison: str) -> Rule:
        return Rule((*self.body, computed(comparison, *self.compared)), (LATE,))


SHAPES = {
    'subtract': Shape((*FACTS, computed('subtract', D, T, V)), (D, H), lambda t, h, v: (t - v, h)),
    'add': Shape((*FACTS, computed('add', D, V, H, 1)), (T, D), lambda t, h, v: (t, v + h + 1)),
    'minus': Shape(
        (*FACTS[1:], computed('unaryMinus', U, V), computed('unaryPlus', D, U)),
        (D, H),
        lambda t, h, v: (-v, h),
    ),
}


@pytest.mark.parametrize('name', ORDERS)
@pytest.mark.parametrize('shape', SHAPES)
def test_who_is_late_is_found_as_by_looking_at_each_pair(shape: str, name: str) -> None:
    rng = random.Random(f'{shape} {name}')
    body, _, sides = SHAPES[shape]
    has_time = FACTS[0] in body
    kb = KnowledgeBase('x:', [SHAPES[shape].rule(name)])
    kb.reason()
    said: list[Axiom] = []
    for _ in range(15):
        for _ in range(rng.choice([1, 2, 6, 24])):
            if said and rng.random() < 0.45:
                kb.remove(said.pop(rng.randrange(len(said))))
                continue
            kind, text = rng.choice(TEXTS[: rng.choice([6, 9, 13])])
            prop, who = rng.choice(
                [(NOW, i), (NOW, j), (LIMIT, i), (LIMIT, j), *((SEEN, f'x:l{n}') for n in range(6))]
            )
            axiom = has(prop, who, Literal(text, XSD + kind))
            if kb.add(axiom):
                said.append(axiom)
        kb.reason()
        values: dict[tuple[str, str], list[float]] = {}
        for one in said:
            values.setdefault((one.prop, one.subject), []).append(float(one.literal.lexical))  # type: ignore[attr-defined]
        late = {
            who
            for robot, who in product((i, j), (f'x:l{n}' for n in range(6)))
            for t in (values.get((NOW, robot), []) if has_time else [math.nan])
            for h in values.get((LIMIT, robot), [])
            for v in values.get((SEEN, who), [])
            if COMPARISONS[name](*sides(t, h, v))
        }
        assert kb.instances(A) == late
        for who in sorted(late)[:1]:
            explanation = kb.explain(is_a(A, who))
            assert explanation is not None
            assert set(explanation.sources()[1:]) <= set(said)
            assert len(explanation.premises) == (3 if has_time else 2)


def split(*body: Atom, head: Atom = LATE) -> bool:
    """Tell whether the one clause of a rule is run by an index."""
    (clause,) = (
        c
        for c in Translation([Rule(body, (head,))]).program.clauses
        if isinstance(c, Clause) and c.origin
    )
    return split_rule(clause) is not None


STEP = computed('subtract', D, T, V)
MORE = computed('greaterThan', D, H)


@pytest.mark.parametrize(
    ('body', 'head', 'is_split'),
    [
        ((*FACTS, STEP, MORE), LATE, True),
        ((*FACTS, STEP, computed('equal', D, H)), LATE, False),
        ((*FACTS, STEP, MORE, computed('lessThan', D, 9)), LATE, False),
        ((*FACTS, computed('multiply', D, T, V), MORE), LATE, False),
        ((*FACTS, STEP, MORE, ObjectPropertyAtom(P, R, L)), LATE, False),
        ((*FACTS, STEP, MORE), ObjectPropertyAtom(P, R, L), False),
        ((*FACTS, STEP, MORE), SameIndividualAtom(L, R), False),
        ((*FACTS, STEP, MORE, ClassAtom(B, X)), LATE, False),
        ((*FACTS, STEP, MORE, ClassAtom(B, X)), ClassAtom(A, X), False),
        ((*FACTS[:2], FACTS[2], computed('greaterThan', T, H)), LATE, False),
        ((FACTS[0], FACTS[2], computed('greaterThan', T, V)), LATE, True),
        ((FACTS[0], FACTS[2], computed('greaterThan', T, V)), DataPropertyAtom('x:e', L, V), True),
        ((FACTS[0], FACTS[2], computed('greaterThan', T, 'text')), LATE, False),
        ((FACTS[2], computed('greaterThan', V, 3)), LATE, False),
    ],
)
def test_which_rules_an_index_runs(body: tuple[Atom, ...], head: Atom, is_split: bool) -> None:
    assert split(*body, head=head) is is_split


def test_a_head_over_values_and_links_of_the_keyed_part() -> None:
    """A head may have the compared value, and the key two places."""
    body = (
        DataPropertyAtom(NOW, R, T),
        DataPropertyAtom(SEEN, X, V),
        ObjectPropertyAtom(P, X, Y),
        computed('lessThan', V, T),
    )
    kb = base(
        Rule(body, (DataPropertyAtom('x:e', Y, V),)),
        *(has(NOW, i, value) for value in (2, 4)),
        *(has(SEEN, k, value) for value in (1, 3, 4)),
        rel(P, k, j),
        rel(P, k, k),
    )
    for gone, expected in (
        (None, {1, 3}),
        (has(NOW, i, 4), {1}),
        (rel(P, k, j), set()),
        (has(NOW, i, 2), set()),
    ):
        if gone is not None:
            kb.remove(gone)
            kb.reason()
        assert {int(value.lexical) for value in kb.data_values('x:e', j)} == expected
    kb.change([has(NOW, j, num('3.5', 'decimal')), rel(P, k, j)])
    kb.reason()
    assert {int(value.lexical) for value in kb.data_values('x:e', j)} == {1, 3}
    assert {int(value.lexical) for value in kb.data_values('x:e', k)} == {1, 3}
