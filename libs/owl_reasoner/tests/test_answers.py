"""Answers are yes, no or unknown with a reason; nothing is left out in silence."""

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase, Unknown
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import ClassAssertion, SubClassOf
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner.datatypes import digits_of, integer_of, literal_of, parse_value

A, B, C, P, Q, R, V, one = 'x:A', 'x:B', 'x:C', 'x:p', 'x:q', 'x:r', 'x:v', 'x:i'


def sums(n: int) -> KnowledgeBase:
    """Return whoever is in A has n members of B and n of C, which differ, by one property."""
    both = ex.ObjectMinCardinality(n, P, B), ex.ObjectMinCardinality(n, Q, C)
    axioms = [SubClassOf(A, ex.ObjectIntersectionOf(both)), ax.DisjointClasses((B, C))]
    kb = KnowledgeBase('x:', [*axioms, *(ax.SubObjectPropertyOf(sub, R) for sub in (P, Q))])
    assert kb.reason()
    return kb


@pytest.mark.parametrize('n', [1, 2, 20, 60])
def test_numbers_are_added(n: int) -> None:
    kb = sums(n)
    assert kb.entails(SubClassOf(A, ex.ObjectMinCardinality(2 * n, R))) is True
    assert kb.entails(SubClassOf(A, ex.ObjectMinCardinality(2 * n + 1, R))) is False


def test_a_number_that_is_not_counted_is_unknown() -> None:
    answer = sums(200).entails(SubClassOf(A, ex.ObjectMinCardinality(400, R)))
    assert isinstance(answer, Unknown)
    assert 'numbers above 300 are not counted' in str(answer)
    with pytest.raises(TypeError, match='the answer is unknown'):
        assert answer


def test_consistency_is_unknown_where_something_is_left_out() -> None:
    kb = KnowledgeBase('x:', [SubClassOf(A, B)])
    assert isinstance(kb.consistency, Unknown)
    kb.reason()
    assert kb.consistency is True
    many = ex.ObjectUnionOf((ex.ObjectMinCardinality(5000, R), ex.ObjectMaxCardinality(2000, R)))
    kb.add(ClassAssertion(many, one))
    kb.reason()
    assert isinstance(kb.consistency, Unknown)
    assert kb.consistency.because == kb.unsupported
    kb.change([ClassAssertion(ex.ObjectComplementOf(B), one), ClassAssertion(A, one)])
    kb.reason()
    assert kb.consistency is False


@pytest.mark.parametrize(
    'counting',
    [
        SubClassOf(A, ex.ObjectMaxCardinality(1, R)),
        SubClassOf(ex.ObjectMinCardinality(2, R), A),
        ax.FunctionalObjectProperty(R),
        ax.InverseFunctionalObjectProperty(R),
    ],
)
@pytest.mark.parametrize(
    'chain', [ax.TransitiveObjectProperty(R), ax.SubPropertyChainOf((P, Q), R)]
)
def test_counting_by_a_property_with_chains_is_named(counting: ax.Axiom, chain: ax.Axiom) -> None:
    kb = KnowledgeBase('x:', [counting, chain, ax.ObjectPropertyAssertion(R, one, 'x:j')])
    kb.reason()
    assert any('chains' in sentence for sentence in kb.unsupported)
    assert isinstance(kb.consistency, Unknown)


def number(text: str, datatype: str = 'integer') -> Literal:
    return Literal(text, XSD + datatype)


@pytest.mark.parametrize('digits', [4000, 4001, 5000, 20_001])
def test_a_number_may_have_many_digits(digits: int) -> None:
    text = '9' * digits
    kb = KnowledgeBase(
        'x:', [ax.FunctionalDataProperty(V), ax.DataPropertyRange(V, XSD + 'integer')]
    )
    same = number(f'+{text}'), number(f'{text}.00', 'decimal')
    kb.change([ax.DataPropertyAssertion(V, one, literal) for literal in same])
    assert kb.reason()
    assert kb.unsupported == ()
    kb.add(ax.DataPropertyAssertion(V, one, number('8' + text[1:])))
    assert not kb.reason()


@pytest.mark.parametrize('text', ['0', '-1', '7' * 3999, '-' + '123' * 4000, '1' + '0' * 9000])
def test_digits_are_read_and_written(text: str) -> None:
    assert digits_of(integer_of(text)) == text
    assert literal_of(parse_value(number(text))) == number(text)
    fraction = parse_value(number(text + '.5', 'decimal'))
    assert literal_of(fraction) == number(text + '.5', 'decimal')


def test_a_number_beyond_all_doubles_is_compared() -> None:
    rule = ax.Rule(
        (
            ex.DataPropertyAtom(V, ex.Variable('x'), ex.Variable('y')),
            ex.BuiltinAtom(
                'http://www.w3.org/2003/11/swrlb#greaterThan',
                (ex.Variable('y'), number('1e300', 'double')),
            ),
        ),
        (ex.ClassAtom(A, ex.Variable('x')),),
    )
    kb = KnowledgeBase('x:', [rule, ax.DataPropertyAssertion(V, one, number('9' * 400))])
    assert kb.reason()
    assert kb.instances(A) == {one}


def test_what_makes_a_change_cost_a_search_is_named() -> None:
    kb = KnowledgeBase('x:', [SubClassOf(A, B), ClassAssertion(A, one)])
    kb.reason()
    assert kb.cost == ''
    union = SubClassOf(B, ex.ObjectUnionOf((C, 'x:D')))
    kb.add(union)
    kb.reason()
    assert kb.cost.startswith('reasoning by cases takes ')
    assert kb.cost.endswith('s with each change since there is x:B SubClassOf (x:C or x:D)')
    kb.add(ClassAssertion(A, 'x:j'))
    kb.reason()
    assert 'since there is x:B SubClassOf' in kb.cost
    assert 'by x:B SubClassOf' in at_once(kb).cost
    kb.remove(union)
    kb.reason()
    assert kb.cost == ''


def at_once(kb: KnowledgeBase) -> KnowledgeBase:
    """Return the same, reasoned over at once."""
    other = kb.copy()
    other.reason()
    return other
