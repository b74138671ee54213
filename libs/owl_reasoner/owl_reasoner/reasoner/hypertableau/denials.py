"""What must hold where an axiom does not: the other side of a refutation."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import TypeAlias

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.reasoner.clauses import UnsupportedError, turned
from owl_reasoner.reasoner.hypertableau.dl_clauses import FRESH
from owl_reasoner.reasoner.inclusions import class_inclusions, directed, property_inclusions
from owl_reasoner.reasoner.property_chains import AnyRole

_A, _B = FRESH + 'someone', FRESH + 'another'
Denial: TypeAlias = tuple[Axiom, ...]
_INCLUSIONS = (
    ax.SubObjectPropertyOf,
    ax.EquivalentObjectProperties,
    ax.InverseObjectProperties,
    ax.SymmetricObjectProperty,
)


def denials(goal: Axiom) -> Iterator[Denial]:
    """Yield sets of assertions, all of one of which hold where an axiom does not.

    Raises:
        UnsupportedError: The axiom is a key, a rule or a datatype definition, or compares data
            properties.
    """
    if isinstance(goal, ax.ClassAssertion):
        yield (ax.ClassAssertion(ex.ObjectComplementOf(goal.cls), goal.individual),)
    elif isinstance(goal, ax.SameIndividual):
        for pair in combinations(sorted(goal.individuals), 2):
            yield (ax.DifferentIndividuals(frozenset(pair)),)
    elif isinstance(goal, ax.DifferentIndividuals):
        for pair in combinations(sorted(goal.individuals), 2):
            yield (ax.SameIndividual(frozenset(pair)),)
    elif isinstance(goal, ax.ObjectPropertyAssertion):
        yield (ax.NegativeObjectPropertyAssertion(goal.prop, goal.subject, goal.object),)
    elif isinstance(goal, ax.NegativeObjectPropertyAssertion):
        yield (ax.ObjectPropertyAssertion(goal.prop, goal.subject, goal.object),)
    elif isinstance(goal, ax.DataPropertyAssertion):
        yield (ax.NegativeDataPropertyAssertion(goal.prop, goal.subject, goal.literal),)
    elif isinstance(goal, ax.NegativeDataPropertyAssertion):
        yield (ax.DataPropertyAssertion(goal.prop, goal.subject, goal.literal),)
    else:
        yield from _property_denials(goal)


def _property_denials(goal: Axiom) -> Iterator[Denial]:
    if isinstance(goal, _INCLUSIONS):
        for sub, sup in property_inclusions(goal):
            yield _holds(sub), _fails(sup)
    elif isinstance(goal, ax.AsymmetricObjectProperty):
        role = directed(goal.prop)
        yield _holds(role), _holds(turned(role))
    elif isinstance(goal, ax.TransitiveObjectProperty):
        yield from _property_denials(ax.SubPropertyChainOf((goal.prop, goal.prop), goal.prop))
    elif isinstance(goal, ax.SubPropertyChainOf):
        places = [f'{_A}{place}' for place in range(len(goal.chain) + 1)]
        steps = zip(map(directed, goal.chain), places, places[1:], strict=False)
        links = (_holds(role, one, other) for role, one, other in steps)
        yield (*links, _fails(directed(goal.sup), places[0], places[-1]))
    elif isinstance(goal, ax.DisjointObjectProperties):
        for one, other in ax.pairs_of(goal.props):
            yield _holds(directed(one)), _holds(directed(other))
    else:
        included = list(class_inclusions(goal))
        if not included and not isinstance(goal, ax.EquivalentClasses | ax.DisjointClasses):
            raise UnsupportedError(f'an axiom of the kind {type(goal).__name__}')
        for low, high in included:
            both = ex.ObjectIntersectionOf((low, ex.ObjectComplementOf(high)))
            yield (ax.ClassAssertion(both, _A),)


def _holds(role: AnyRole, one: str = _A, other: str = _B) -> Axiom:
    iri, inverted = role
    pair = (other, one) if inverted else (one, other)
    return ax.ObjectPropertyAssertion(iri, *pair)


def _fails(role: AnyRole, one: str = _A, other: str = _B) -> Axiom:
    iri, inverted = role
    pair = (other, one) if inverted else (one, other)
    return ax.NegativeObjectPropertyAssertion(iri, *pair)
