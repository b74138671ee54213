"""Short names and ways to state an axiom, for ontologies of a few of them."""

from __future__ import annotations

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    DifferentIndividuals,
    ObjectPropertyAssertion,
    SameIndividual,
)
from owl_reasoner.owl.expressions import (
    BuiltinAtom,
    ClassExpression,
    Literal,
    Variable,
)
from owl_reasoner.owl.vocabulary import SWRLB, XSD

A, B, C, D = 'x:A', 'x:B', 'x:C', 'x:D'
P, Q, R, S, T = 'x:p', 'x:q', 'x:r', 'x:s', 'x:t'
i, j, k, m = 'x:i', 'x:j', 'x:k', 'x:m'
X, Y, Z, V, W, U = (Variable(name) for name in 'xyzvwu')


def num(value: object, datatype: str = 'integer') -> Literal:
    return Literal(str(value), XSD + datatype)


def base(*axioms: Axiom, consistent: bool = True) -> KnowledgeBase:
    kb = KnowledgeBase('x:', axioms)
    assert kb.reason() is consistent
    assert kb.unsupported == ()
    return kb


def is_a(cls: ClassExpression, individual: str) -> Axiom:
    return ClassAssertion(cls, individual)


def rel(prop: str, one: str, other: str) -> Axiom:
    return ObjectPropertyAssertion(prop, one, other)


def has(prop: str, one: str, value: object) -> Axiom:
    return DataPropertyAssertion(prop, one, value if isinstance(value, Literal) else num(value))


def differ(*individuals: str) -> Axiom:
    return DifferentIndividuals(frozenset(individuals))


def same(*individuals: str) -> SameIndividual:
    return SameIndividual(frozenset(individuals))


def computed(name: str, *arguments: object) -> BuiltinAtom:
    terms = [
        a if isinstance(a, (Variable, Literal)) else Literal(a) if isinstance(a, str) else num(a)
        for a in arguments
    ]
    return BuiltinAtom(SWRLB + name, tuple(terms))
