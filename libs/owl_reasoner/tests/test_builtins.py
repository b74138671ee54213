"""Each SWRL built-in over right and wrong arguments of every type: an answer, never an error."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import pytest

from owl_reasoner import KnowledgeBase
from owl_reasoner.owl.axioms import ClassAssertion, DataPropertyAssertion, Rule
from owl_reasoner.owl.expressions import (
    BuiltinAtom,
    ClassAtom,
    DataPropertyAtom,
    Literal,
    Variable,
)
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.reasoner import swrl_builtins
from owl_reasoner.reasoner.datatypes import value_of
from owl_reasoner.reasoner.datetimes import DIGITS

SWRLB = 'http://www.w3.org/2003/11/swrlb#'
NAMES = (*swrl_builtins._TESTS, *swrl_builtins._COMPUTATIONS)
GRID = [
    *(Literal(text, XSD + 'integer') for text in ('0', '-3', '2', '1' + '0' * 40)),
    *(Literal(text, XSD + 'decimal') for text in ('0.5', '-2.25')),
    *(Literal(text, XSD + 'double') for text in ('1.5', '-0.0', 'NaN', 'INF')),
    Literal('2.5', XSD + 'float'),
    *(Literal(text, XSD + 'string') for text in ('', 'ab', '(ab)|(a)', '[', 'http://x/y', '1')),
    Literal('true', XSD + 'boolean'),
    Literal('2020-02-29', XSD + 'date'),
    Literal('2020-02-29T12:00:00Z', XSD + 'dateTime'),
    Literal('P1D', XSD + 'duration'),
    Literal('ab', 'http://www.w3.org/1999/02/22-rdf-syntax-ns#langString', 'en'),
    Literal('ff', XSD + 'hexBinary'),
    Literal('http://x/z', XSD + 'anyURI'),
    Literal('what', 'http://example.org/unknown'),
]
TYPED = ('integer', 'string', 'boolean', 'double')


@pytest.mark.parametrize('name', NAMES)
def test_every_argument_of_every_type_has_an_answer(name: str) -> None:
    values = [value_of(literal) for literal in GRID]
    some = values[::3]
    for count in range(1, 5):
        found = swrl_builtins.builtin(name, count)
        if found is None:
            continue
        holds, solve = found
        for arguments in (
            product(values, repeat=count) if count < 3 else product(some, repeat=count)
        ):
            held = holds(*arguments)
            assert isinstance(held, bool), (name, arguments)
            if solve is not None:
                solved = tuple(solve(*arguments[1:]))
                assert len(solved) == len(set(map(repr, solved)))


def solved(name: str, *arguments: Literal) -> list[str]:
    """Return what a rule with the built-in derives as its first argument."""
    kb = KnowledgeBase('urn:x')
    x, y = Variable('urn:x#x'), Variable('urn:x#y')
    head = (DataPropertyAtom('urn:p', x, y),)
    body = (ClassAtom('urn:C', x), BuiltinAtom(SWRLB + name, (y, *arguments)))
    kb.change([ClassAssertion('urn:C', 'urn:i'), Rule(body, head)])
    assert kb.reason()
    return sorted(literal.lexical for literal in kb.data_values('urn:p', 'urn:i'))


def text(value: str) -> Literal:
    return Literal(value, XSD + 'string')


def uri(value: str) -> Literal:
    return Literal(value, XSD + 'anyURI')


@pytest.mark.parametrize(
    ('name', 'arguments', 'expected'),
    [
        ('tokenize', (text('xabyaz'), text('(ab)|(a)')), ['x', 'y', 'z']),
        ('tokenize', (text('a b'), text(' ')), ['a', 'b']),
        ('tokenize', (text('ab'), text('x*')), []),
        ('substringBefore', (Literal('15', XSD + 'integer'), text('5')), []),
        ('substringBefore', (text('a-b'), text('-')), ['a']),
        ('substringBefore', (text('ab'), text('-')), ['']),
        ('substringAfter', (Literal('15', XSD + 'integer'), text('5')), []),
        ('resolveURI', (text('../c'), text('http://x/a/b/d')), ['http://x/a/c']),
        ('resolveURI', (text('c'), text('no base')), []),
        ('resolveURI', (uri('../c'), uri('http://x/a/b/d')), ['http://x/a/c']),
        ('resolveURI', (Literal('2020-02-29', XSD + 'date'), uri('http://x/a')), []),
        ('divide', (Literal('1', XSD + 'integer'), Literal('4', XSD + 'integer')), ['0.25']),
        ('divide', (Literal('1', XSD + 'integer'), Literal('0', XSD + 'integer')), []),
    ],
)
def test_what_a_built_in_makes(
    name: str, arguments: tuple[Literal, ...], expected: list[str]
) -> None:
    assert solved(name, *arguments) == expected


@pytest.mark.parametrize(
    ('name', 'counts'),
    [
        ('add', range(3, 9)),
        ('subtract', [3]),
        ('unaryMinus', [2]),
        ('stringLength', [2]),
        ('translate', [4]),
        ('substringBefore', [3]),
        ('replace', [4]),
        ('tokenize', [3]),
        ('resolveURI', [3]),
        ('lessThan', [2]),
    ],
)
def test_a_built_in_has_as_many_arguments_as_the_submission_says(
    name: str, counts: Sequence[int]
) -> None:
    taken = [count for count in range(9) if swrl_builtins.builtin(name, count) is not None]
    assert taken == list(counts)


def test_a_quotient_that_no_decimal_is_equal_to_is_rounded_to_one() -> None:
    (quotient,) = solved('divide', Literal('1', XSD + 'integer'), Literal('3', XSD + 'integer'))
    assert quotient == '0.' + '3' * DIGITS
    kb = KnowledgeBase(
        'urn:x', [DataPropertyAssertion('urn:p', 'urn:i', Literal(quotient, XSD + 'decimal'))]
    )
    assert kb.reason()
