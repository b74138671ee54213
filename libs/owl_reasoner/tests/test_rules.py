"""Rules (SWRL) and their built-ins, each in a small ontology."""
# ruff: noqa: E501 - tables of cases, one line each

from __future__ import annotations

import itertools
import operator
from fractions import Fraction

import pytest

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    Axiom,
    DataPropertyAssertion,
    EquivalentClasses,
    FunctionalObjectProperty,
    HasKey,
    Rule,
    SubClassOf,
)
from owl_reasoner.owl.expressions import (
    Atom,
    BuiltinAtom,
    ClassAtom,
    ClassExpression,
    DataOneOf,
    DataPropertyAtom,
    DataRange,
    DataRangeAtom,
    DataSomeValuesFrom,
    DatatypeRestriction,
    DifferentIndividualsAtom,
    Literal,
    ObjectAllValuesFrom,
    ObjectHasSelf,
    ObjectIntersectionOf,
    ObjectMaxCardinality,
    ObjectPropertyAtom,
    ObjectSomeValuesFrom,
    ObjectUnionOf,
    SameIndividualAtom,
    Variable,
)
from owl_reasoner.owl.vocabulary import THING, XSD
from owl_reasoner.reasoner.clauses import ComputedAtom, Constant, Term
from owl_reasoner.reasoner.datatypes import value_of
from owl_reasoner.reasoner.hypertableau.rule_joins import compared
from owl_reasoner.reasoner.swrl_builtins import builtin
from owl_reasoner.reasoner.value_sets import point

from .small_ontologies import (
    A,
    B,
    C,
    D,
    P,
    Q,
    R,
    S,
    T,
    U,
    V,
    W,
    X,
    Y,
    Z,
    base,
    computed,
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

TRUE, FALSE = Literal('true', XSD + 'boolean'), Literal('false', XSD + 'boolean')


@pytest.mark.parametrize(
    ('given', 'atoms', 'result'),
    [
        (7, [computed('add', W, V, 2, 1)], num(10)),
        (7, [computed('subtract', W, V, 9)], num(-2)),
        (7, [computed('multiply', W, V, V)], num(49)),
        (7, [computed('divide', W, V, 2)], num('3.5', 'decimal')),
        (7, [computed('integerDivide', W, V, 2)], num(3)),
        (-7, [computed('mod', W, V, 2)], num(-1)),
        (7, [computed('pow', W, V, 2)], num(49)),
        (7, [computed('unaryMinus', W, V)], num(-7)),
        (-7, [computed('abs', W, V)], num(7)),
        (num('2.5', 'decimal'), [computed('round', W, V)], num(3)),
        (num('2.5', 'decimal'), [computed('roundHalfToEven', W, V)], num(2)),
        (num('499.015', 'float'), [computed('roundHalfToEven', W, V, 2)], num('499.02', 'float')),
        (num('35612.25', 'decimal'), [computed('roundHalfToEven', W, V, -2)], num(35600)),
        (num('1001.125', 'float'), [computed('integerDivide', W, V, 2)], num(500)),
        (num('0.49999999999999994', 'double'), [computed('round', W, V)], num('0', 'double')),
        (num('-0.3', 'double'), [computed('round', W, V)], num('-0', 'double')),
        (num('-INF', 'double'), [computed('ceiling', W, V)], num('-INF', 'double')),
        (num('-42', 'double'), [computed('substring', W, '12345', V, num('INF', 'double'))], Literal('12345')),
        (num('1.5', 'decimal'), [computed('substring', W, '12345', V, num('2.6', 'decimal'))], Literal('234')),
        (num('NaN', 'double'), [computed('substring', W, '12345', V, 3)], Literal('')),
        (num('2.5', 'decimal'), [computed('ceiling', W, V)], num(3)),
        (num('2.5', 'decimal'), [computed('floor', W, V)], num(2)),
        (num('2.5', 'double'), [computed('add', W, V, 1)], num('3.5', 'double')),
        (7, [computed('subtract', U, V, 2), computed('multiply', W, U, U)], num(25)),
        (TRUE, [computed('booleanNot', W, V)], FALSE),
        (Literal('ab'), [computed('stringConcat', W, V, 'c')], Literal('abc')),
        (Literal('hello'), [computed('substring', W, V, 2, 3)], Literal('ell')),
        (Literal('hello'), [computed('stringLength', W, V)], num(5)),
        (Literal(' a  b '), [computed('normalizeSpace', W, V)], Literal('a b')),
        (Literal('Ab'), [computed('upperCase', W, V)], Literal('AB')),
        (Literal('Ab'), [computed('lowerCase', W, V)], Literal('ab')),
        (Literal('bar'), [computed('translate', W, V, 'abc', 'AB')], Literal('BAr')),
        (Literal('a=b'), [computed('substringBefore', W, V, '=')], Literal('a')),
        (Literal('a=b'), [computed('substringAfter', W, V, '=')], Literal('b')),
        (Literal('aab'), [computed('replace', W, V, 'a', 'x')], Literal('xxb')),
        (Literal('abab'), [computed('replace', W, V, '(a)b', '$1x')], Literal('axax')),
        (Literal('abab'), [computed('replace', W, V, '(a)b', '$3')], Literal('')),
        (Literal('a,b'), [computed('tokenize', W, V, ','), computed('startsWith', W, 'b')], Literal('b')),
        (7, [computed('equal', W, V), computed('greaterThan', V, 6)], num(7)),
        (7, [computed('equal', W, V), computed('greaterThan', V, 7)], None),
        (7, [computed('equal', W, V), computed('greaterThanOrEqual', V, 7)], num(7)),
        (7, [computed('equal', W, V), computed('lessThan', V, 8)], num(7)),
        (7, [computed('equal', W, V), computed('lessThanOrEqual', V, 6)], None),
        (7, [computed('equal', W, V), computed('notEqual', V, 7)], None),
        (num('0.1', 'decimal'), [computed('equal', W, V), computed('equal', V, num('0.1', 'float'))], num('0.1', 'decimal')),
        (num('2004-10-01', 'date'), [computed('equal', W, V), computed('lessThan', V, num('2004-10-02', 'date'))], num('2004-10-01', 'date')),
        (num('2004-10-01', 'date'), [computed('equal', W, V), computed('lessThan', V, num('2004-10-01Z', 'date'))], None),
        (num('24:00:00', 'time'), [computed('equal', W, V), computed('lessThan', V, num('12:00:00', 'time'))], num('24:00:00', 'time')),
        (num('--02-29', 'gMonthDay'), [computed('equal', W, V), computed('greaterThan', V, num('--02-28', 'gMonthDay'))], num('--02-29', 'gMonthDay')),
        (num('P1Y', 'duration'), [computed('equal', W, V), computed('equal', V, num('P12M', 'yearMonthDuration'))], num('P1Y', 'duration')),
        (num('P1M', 'duration'), [computed('equal', W, V), computed('lessThan', V, num('P30D', 'duration'))], None),
        (num('next week', 'date'), [computed('equal', W, V), computed('lessThan', V, num('2004-10-02', 'date'))], None),
        (7, [computed('divide', W, V, 0)], None),
        (Literal('7'), [computed('add', W, V, 1)], None),
        (Literal('AbC'), [computed('equal', W, V), computed('stringEqualIgnoreCase', V, 'aBc')], Literal('AbC')),
        (Literal('abc'), [computed('equal', W, V), computed('contains', V, 'bc')], Literal('abc')),
        (Literal('abc'), [computed('equal', W, V), computed('containsIgnoreCase', V, 'BC')], Literal('abc')),
        (Literal('abc'), [computed('equal', W, V), computed('endsWith', V, 'bc')], Literal('abc')),
        (Literal('abc'), [computed('equal', W, V), computed('matches', V, '^a.c$')], Literal('abc')),
    ],
)  # fmt: skip
def test_builtins(given: object, atoms: list[BuiltinAtom], result: Literal | None) -> None:
    rule = Rule((DataPropertyAtom(S, X, V), *atoms), (DataPropertyAtom(T, X, W),))
    kb = base(rule, has(S, i, given))
    found = {value_of(literal) for literal in kb.data_values(T, i)}
    assert found == (set() if result is None else {value_of(result)})
    kb.remove(has(S, i, given))
    kb.reason()
    assert kb.data_values(T, i) == set()


def test_values_of_two_spaces_are_equal_whichever_comes_first() -> None:
    values = (DataPropertyAtom(S, X, V), DataPropertyAtom(T, X, W))
    rule = Rule((*values, computed('add', W, V, 1)), (ClassAtom(A, X),))
    facts = [has(S, i, 2), has(T, i, num('3.0', 'float'))]
    for fact in facts:
        kb = base(rule, *facts)
        assert kb.instances(A) == {i}
        kb.remove(fact)
        kb.reason()
        assert kb.instances(A) == set()
        kb.add(fact)
        kb.reason()
        assert kb.instances(A) == {i}


def test_an_equal_value_of_another_space_is_not_what_a_rule_computed() -> None:
    rule = Rule((DataPropertyAtom(S, X, V), computed('add', W, V, 1)), (DataPropertyAtom(T, X, W),))
    kb = base(rule, has(S, i, 2), has(T, i, num('3.0', 'float')))
    kb.remove(has(T, i, num('3.0', 'float')))
    kb.reason()
    assert kb.data_values(T, i) == {num(3)}


def test_rules_speak_of_named_individuals_only() -> None:
    rule = Rule((ObjectPropertyAtom(P, X, Y), ClassAtom(B, Y)), (ClassAtom(C, X),))
    kb = base(SubClassOf(A, ObjectSomeValuesFrom(P, B)), rule, is_a(A, i))
    assert kb.instances(C) == set()


def test_rules_with_same_and_different_atoms() -> None:
    twins = Rule((ObjectPropertyAtom(P, X, Y), ClassAtom(A, X)), (SameIndividualAtom(X, Y),))
    apart = Rule(
        (ObjectPropertyAtom(Q, Z, X), ObjectPropertyAtom(Q, Z, Y), DifferentIndividualsAtom(X, Y)),
        (ObjectPropertyAtom(R, X, Y),),
    )
    kb = base(twins, apart, rel(P, i, j), is_a(A, i), rel(Q, k, i), rel(Q, k, m), differ(j, m))
    assert same(i, j) in set(kb.facts())
    assert kb.object_values(R, i) == {m}
    kb.remove(is_a(A, i))
    kb.reason()
    assert same(i, j) not in set(kb.facts())
    assert kb.object_values(R, i) == set()


def test_a_rule_that_makes_values_without_end_is_stopped_and_reported() -> None:
    counting = Rule(
        (DataPropertyAtom(S, X, V), computed('add', W, V, 1)), (DataPropertyAtom(S, X, W),)
    )
    kb = KnowledgeBase('x:', [counting, has(S, i, 1)])
    assert kb.reason()
    assert 'make values without end: stopped after' in kb.unsupported[0]
    assert num(2) in kb.data_values(S, i)


def test_a_rule_makes_individuals_different() -> None:
    # Were they one, it would be in both classes, which the rule forbids.
    rule = Rule((ClassAtom(A, X), ClassAtom(B, X)), ())
    kb = KnowledgeBase('x:', [rule, is_a(A, i), is_a(B, j), is_a(A, k)])
    assert kb.reason()
    assert kb.holds(differ(i, j))
    assert kb.holds(differ(j, k))
    assert not kb.holds(differ(i, k))
    assert not kb.holds(differ(i, j, k))


_NUMBER = XSD + 'integer'
_AT_LEAST_18 = DatatypeRestriction(_NUMBER, ((XSD + 'minInclusive', num(18)),))


@pytest.mark.parametrize(
    ('member', 'cls'),
    [
        (ObjectSomeValuesFrom(P, ObjectIntersectionOf((A, C))), ObjectSomeValuesFrom(P, A)),
        (
            ObjectSomeValuesFrom(P, ObjectSomeValuesFrom(Q, A)),
            ObjectSomeValuesFrom(P, ObjectSomeValuesFrom(Q, THING)),
        ),
        (DataSomeValuesFrom(S, _AT_LEAST_18), DataSomeValuesFrom(S, _NUMBER)),
        (
            ObjectIntersectionOf((A, ObjectSomeValuesFrom(P, C))),
            ObjectIntersectionOf((A, ObjectSomeValuesFrom(P, C))),
        ),
    ],
)
def test_whom_a_class_of_a_rule_relates_to_needs_no_name(
    member: ClassExpression, cls: ClassExpression
) -> None:
    kb = base(Rule((ClassAtom(cls, X),), (ClassAtom(B, X),)), is_a(member, i))
    assert kb.reason()
    assert kb.instances(B) == {i}
    assert not kb.unsupported


@pytest.mark.parametrize(
    ('values', 'tests', 'follows', 'witness'),
    [
        (DataOneOf((num(1), num(2))), [num(1), num(2)], True, num(2)),
        (DataOneOf((num(1), num(2), num(3))), [num(1), num(2)], False, num(2)),
        (XSD + 'boolean', [TRUE, FALSE], True, TRUE),
        (_NUMBER, [V], True, num(5)),
        (_AT_LEAST_18, [('greaterThan', 17)], True, num(20)),
        (_NUMBER, [('greaterThan', 17)], False, num(20)),
        (_NUMBER, [('greaterThan', 17), ('lessThanOrEqual', 17)], True, num(20)),
        (XSD + 'double', [('greaterThan', 17), ('lessThanOrEqual', 17)], False, num(20, 'double')),
    ],
)
def test_rules_apply_by_a_value_that_is_not_known(
    values: DataRange,
    tests: list[Literal | Variable | tuple[str, int]],
    follows: bool,
    witness: Literal,
) -> None:
    kb = base(SubClassOf(A, DataSomeValuesFrom(S, values)), is_a(A, i))
    for test in tests:
        more = [computed(test[0], V, test[1])] if isinstance(test, tuple) else []
        value = V if isinstance(test, tuple) else test
        kb.add(Rule((DataPropertyAtom(S, X, value), *more), (ClassAtom(B, X),)))
    assert kb.reason()
    assert kb.instances(B) == ({i} if follows else set())
    assert kb.unsupported == ()
    assert kb.justification(is_a(B, i)) == () or follows
    kb.add(has(S, i, witness))
    assert kb.reason()
    assert kb.instances(B) == {i}
    assert kb.unsupported == ()


def test_keys_apply_by_values_that_are_not_known() -> None:
    few = SubClassOf(A, DataSomeValuesFrom(S, DataOneOf((num(1), num(2)))))
    key = HasKey(A, (), (S,))
    apart = differ(i, j, k)
    kb = base(few, key, apart, is_a(A, i), is_a(A, j), has(S, j, 1))
    assert kb.data_values(S, i) == {num(2)}
    kb.add(is_a(A, k))
    assert not kb.reason()
    assert set(kb.justification(None)) == {few, key, apart, *(is_a(A, one) for one in (i, j, k))}


@pytest.mark.parametrize('by_cases', [False, True])
def test_keys_leave_anonymous_individuals_alone(by_cases: bool) -> None:
    someone = '_:b0'
    also = [is_a(ObjectUnionOf((C, D)), someone)] if by_cases else []
    facts = [is_a(A, one) for one in (i, someone)] + [has(S, one, 1) for one in (i, someone)]
    kb = base(HasKey(A, (), (S,)), *facts, rel(P, k, someone), *also)
    assert not kb.holds(rel(P, k, i))
    named = same(someone, j)
    kb.add(named)
    kb.reason()
    assert kb.holds(same(i, j))
    assert kb.object_values(P, k) == {i, j, someone}
    kb.remove(named)
    kb.reason()
    assert not kb.holds(rel(P, k, i))


def test_a_rule_hands_on_a_value_that_is_not_known() -> None:
    member = is_a(DataSomeValuesFrom(S, _AT_LEAST_18), i)
    given = Rule((DataPropertyAtom(S, X, V),), (DataPropertyAtom(T, X, V),))
    asked = EquivalentClasses((B, DataSomeValuesFrom(T, _AT_LEAST_18)))
    kb = base(member, given, asked)
    assert kb.instances(B) == {i}


def test_a_rule_about_different_individuals_looks_at_both_cases() -> None:
    body = (ObjectPropertyAtom(P, X, Y), DifferentIndividualsAtom(X, Y))
    needed = [Rule(body, (ClassAtom(B, X),)), SubClassOf(ObjectHasSelf(P), B), rel(P, i, j)]
    kb = base(*needed, is_a(ObjectUnionOf((C, D)), i))
    assert kb.instances(B) == {i}
    assert set(kb.justification(is_a(B, i))) == set(needed)


def test_what_one_value_of_several_implies_is_no_consequence() -> None:
    def one_of(prop: str, *values: int) -> DataSomeValuesFrom:
        return DataSomeValuesFrom(prop, DataOneOf(tuple(map(num, values))))

    pass_on = Rule(
        (DataPropertyAtom(S, X, V), ObjectPropertyAtom(P, X, Y)), (DataPropertyAtom(S, Y, V),)
    )
    cases = [
        Rule((DataPropertyAtom(S, X, num(n)), ObjectPropertyAtom(P, Y, X)), (ClassAtom(A, Y),))
        for n in (1, 2)
    ]
    kb = base(is_a(one_of(S, 1, 2), i), rel(P, i, j), pass_on, cases[0])
    assert kb.instances(A) == set()
    assert kb.data_values(S, j) == set()
    kb.add(cases[1])
    assert kb.reason()
    assert kb.instances(A) == {i}
    assert {pass_on, *cases} <= set(kb.justification(is_a(A, i)))

    less = (DataPropertyAtom(S, X, V), DataPropertyAtom(T, X, W), computed('lessThan', V, W))
    kb = base(is_a(one_of(S, 1, 5), i), is_a(one_of(T, 2, 3), i), Rule(less, (ClassAtom(A, X),)))
    assert kb.instances(A) == set()
    kb = base(is_a(one_of(S, 1, 0), i), is_a(one_of(T, 2, 3), i), Rule(less, (ClassAtom(A, X),)))
    assert kb.instances(A) == {i}


@pytest.mark.parametrize('by_cases', [False, True])
@pytest.mark.parametrize('known', [False, True])
def test_the_order_of_a_rules_atoms_makes_no_difference(by_cases: bool, known: bool) -> None:
    minus_one_or_one = DataSomeValuesFrom(S, DataOneOf((num(1), num(-1))))
    facts = [has(S, i, -1) if known else is_a(minus_one_or_one, i)]
    facts += [is_a(ObjectUnionOf((C, D)), i)] if by_cases else []
    atoms: tuple[Atom, ...] = (
        DataPropertyAtom(S, X, V),
        computed('abs', W, V),
        computed('add', U, W, 1),
        DataRangeAtom(XSD + 'integer', U),
    )
    for body in itertools.permutations(atoms):
        for tested, follows in (
            (computed('lessThan', W, U), True),
            (computed('greaterThan', 2, U), False),
        ):
            kb = base(Rule((tested, *body), (ClassAtom(A, X),)), *facts)
            assert kb.instances(A) == ({i} if follows else set())


def test_a_rule_hands_on_what_it_computes_from_each_value_that_is_possible() -> None:
    rule = Rule((DataPropertyAtom(S, X, V), computed('abs', W, V)), (DataPropertyAtom(T, X, W),))

    def one_of(*values: int) -> Axiom:
        return is_a(DataSomeValuesFrom(S, DataOneOf(tuple(map(num, values)))), i)

    assert base(rule, one_of(3, -3)).data_values(T, i) == {num(3)}
    assert base(rule, one_of(3, -4)).data_values(T, i) == set()


@pytest.mark.parametrize('swapped', [False, True])
def test_each_individual_that_a_rule_asks_for_has_to_be_recognised(swapped: bool) -> None:
    only = ObjectAllValuesFrom(P, D)
    asked = [ClassAtom(only, X), ClassAtom(only, Y)]
    body: tuple[Atom, ...] = (
        ObjectPropertyAtom(P, X, Z),
        ObjectPropertyAtom(R, X, Y),
        *asked[:: -1 if swapped else 1],
    )
    facts = [rel(P, i, k), is_a(D, k), rel(R, i, j), is_a(ObjectMaxCardinality(0, P, THING), j)]
    kb = base(FunctionalObjectProperty(P), Rule(body, (ClassAtom(A, X),)), *facts)
    assert kb.instances(A) == {i}


_NUMBERS = [
    num(value, datatype)
    for datatype in ('decimal', 'float', 'double')
    for value in ('-1', '-0.0', '0', '0.1', '0.5', '0.50000001', '7', '16777217')
] + [num(value, datatype) for datatype in ('float', 'double') for value in ('INF', '-INF', 'NaN')]


@pytest.mark.parametrize(
    'name', ['lessThan', 'lessThanOrEqual', 'greaterThan', 'greaterThanOrEqual']
)
def test_the_values_that_a_comparison_admits_are_those_of_which_it_holds(name: str) -> None:
    known = builtin(name, 2)
    assert known is not None
    holds, _ = known
    values = [value_of(one) for one in _NUMBERS]
    for bound in values:
        for first in (False, True):
            terms: tuple[Term, Term] = (0, Constant(bound, True))
            found = compared(ComputedAtom(name, holds, None, terms[:: -1 if first else 1]), 0)
            if not isinstance(bound, int | Fraction):
                assert found is None
                continue
            assert found is not None
            for value in values:
                pair = (bound, value) if first else (value, bound)
                assert point(value).within(found) is holds(*pair), (name, pair)
            assert (found & point('0')).is_empty


def test_a_comparison_with_no_number_admits_no_set_of_values() -> None:
    for name, bound in (('lessThan', 'a'), ('contains', 'a'), ('notEqual', 1)):
        known = builtin(name, 2)
        assert known is not None
        assert compared(ComputedAtom(name, known[0], None, (0, Constant(bound, True))), 0) is None
    assert compared(ComputedAtom('lessThan', operator.lt, None, (0, 1)), 0) is None
    assert (
        compared(ComputedAtom('lessThan', operator.lt, None, (0, Constant(10**400, True))), 0)
        is None
    )


def test_a_place_that_nobody_visited_since_yesterday() -> None:
    swrlb = 'http://www.w3.org/2003/11/swrlb#'
    r, now, p, seen, gap = map(Variable, ('r', 'now', 'p', 'seen', 'gap'))
    day = Literal('P1D', XSD + 'dayTimeDuration')
    rule = Rule(
        (
            DataPropertyAtom('x:now', r, now),
            DataPropertyAtom('x:seen', p, seen),
            BuiltinAtom(swrlb + 'subtractDateTimesYieldingDayTimeDuration', (gap, now, seen)),
            BuiltinAtom(swrlb + 'greaterThan', (gap, day)),
        ),
        (ClassAtom('x:Stale', p),),
    )

    def at(prop: str, name: str, text: str) -> DataPropertyAssertion:
        return DataPropertyAssertion(prop, name, Literal(text, XSD + 'dateTime'))

    kb = KnowledgeBase(
        'x:',
        [
            rule,
            at('x:now', 'x:robot', '2026-11-29T08:00:00+01:00'),
            at('x:seen', 'x:hall', '2026-11-28T06:59:59Z'),
            at('x:seen', 'x:lab', '2026-11-28T07:00:00Z'),
            at('x:seen', 'x:attic', '2026-11-20T07:00:00'),
        ],
    )
    assert kb.reason()
    assert kb.instances('x:Stale') == {'x:hall'}, 'the attic was visited in a zone that is not told'
    assert kb.unsupported == ()
