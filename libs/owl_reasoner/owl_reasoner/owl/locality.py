"""Which axioms can matter to what is asked: modules by syntactic locality.

An axiom is local to some names if it holds whatever the other classes and properties are, once
these are taken to be empty. What is local says nothing about the names, so that a goal follows from
all axioms where it follows from those that are not, with the names that these bring in (bottom
locality; Cuenca Grau, Horrocks, Kazakov and Sattler, "Modular reuse of ontologies: theory and
practice", JAIR 2008). So a module holds every justification of the goal.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.vocabulary import BOTTOM, BOTTOM_DATA, NOTHING, OWL, THING

_KINDS = ('class', 'object_property', 'data_property')
_SOME = (
    *(ex.ObjectSomeValuesFrom, ex.ObjectHasValue, ex.ObjectHasSelf),
    *(ex.DataSomeValuesFrom, ex.DataHasValue),
)
_OF_ONE_PROPERTY = (
    *(ax.FunctionalObjectProperty, ax.InverseFunctionalObjectProperty),
    *(ax.IrreflexiveObjectProperty, ax.SymmetricObjectProperty, ax.AsymmetricObjectProperty),
    *(ax.TransitiveObjectProperty, ax.FunctionalDataProperty, ax.DataPropertyRange),
    *(ax.NegativeObjectPropertyAssertion, ax.NegativeDataPropertyAssertion),
)
_INCLUSIONS = (ax.SubObjectPropertyOf, ax.SubDataPropertyOf)
_EQUIVALENCES = (ax.EquivalentObjectProperties, ax.EquivalentDataProperties)
_DISJOINT = (ax.DisjointObjectProperties, ax.DisjointDataProperties)
_DOMAINS = (ax.ObjectPropertyDomain, ax.DataPropertyDomain)


def locality_module(axioms: Iterable[Axiom], goals: Iterable[Axiom]) -> list[Axiom]:
    """Return the axioms that can matter to whether goals follow, in their order.

    Declarations and annotations are left out; rules, keys and definitions of datatypes are taken to
    matter always.
    """
    axioms = [a for a in axioms if not isinstance(a, ax.Declaration | ax.Annotation | ax.Import)]
    names = _Signature(name for goal in goals for name in _mentioned(goal))
    about: dict[str, list[int]] = {}
    for number, axiom in enumerate(axioms):
        for name in _mentioned(axiom):
            about.setdefault(name, []).append(number)
    taken: set[int] = set()
    pending = list(range(len(axioms)))
    while pending:
        number = pending.pop()
        if number in taken or names.is_local(axioms[number]):
            continue
        taken.add(number)
        for name in names.add(_mentioned(axioms[number])):
            pending += about.get(name, ())
    return [axioms[number] for number in sorted(taken)]


def _mentioned(axiom: Axiom) -> set[str]:
    return {iri for kind, iri in entities_of(axiom) if kind in _KINDS}


class _Signature:
    """The classes and properties that may have members; all others are taken to have none."""

    def __init__(self, names: Iterable[str]) -> None:
        self._names = set(names)

    def add(self, names: Iterable[str]) -> set[str]:
        """Take in names; return those that are new."""
        new = set(names) - self._names
        self._names |= new
        return new

    def is_local(self, axiom: Axiom) -> bool:
        """Tell whether an axiom holds whatever the names stand for."""
        empty, full, none = self._is_empty, self._is_full, self._relates_none
        if isinstance(axiom, ax.SubClassOf):
            return empty(axiom.sub) or full(axiom.sup)
        if isinstance(axiom, ax.EquivalentClasses):
            return all(map(empty, axiom.classes)) or all(map(full, axiom.classes))
        if isinstance(axiom, ax.DisjointClasses):
            return _but_one(list(map(empty, axiom.classes)))
        if isinstance(axiom, ax.DisjointUnion):
            return empty(axiom.cls) and all(map(empty, axiom.classes))
        if isinstance(axiom, ax.ClassAssertion):
            return full(axiom.cls)
        if isinstance(axiom, _INCLUSIONS):
            return none(axiom.sub)
        if isinstance(axiom, ax.SubPropertyChainOf):
            return any(map(none, axiom.chain))
        if isinstance(axiom, _EQUIVALENCES):
            return all(map(none, axiom.props))
        if isinstance(axiom, _DISJOINT):
            return _but_one(list(map(none, axiom.props)))
        if isinstance(axiom, ax.InverseObjectProperties):
            return none(axiom.first) and none(axiom.second)
        if isinstance(axiom, _DOMAINS):
            return none(axiom.prop) or full(axiom.domain)
        if isinstance(axiom, ax.ObjectPropertyRange):
            return none(axiom.prop) or full(axiom.range)
        return isinstance(axiom, _OF_ONE_PROPERTY) and none(axiom.prop)

    def _relates_none(self, prop: ex.PropertyExpression) -> bool:
        iri = prop if isinstance(prop, str) else prop.prop
        if iri.startswith(OWL):
            return iri in (BOTTOM, BOTTOM_DATA)
        return iri not in self._names

    def _is_empty(self, part: ex.ClassExpression) -> bool:
        """Tell whether an expression has no members for sure."""
        empty = self._is_empty
        if isinstance(part, str):
            return part == NOTHING or (part != THING and part not in self._names)
        if isinstance(part, ex.ObjectIntersectionOf):
            return any(map(empty, part.operands))
        if isinstance(part, ex.ObjectUnionOf):
            return all(map(empty, part.operands))
        if isinstance(part, ex.ObjectComplementOf):
            return self._is_full(part.operand)
        if isinstance(part, _SOME) and self._relates_none(part.prop):
            return True
        if isinstance(part, ex.ObjectSomeValuesFrom):
            return empty(part.filler)
        if isinstance(part, ex.ObjectMinCardinality | ex.ObjectExactCardinality):
            return part.n > 0 and (self._relates_none(part.prop) or empty(part.filler))
        if isinstance(part, ex.DataMinCardinality | ex.DataExactCardinality):
            return part.n > 0 and self._relates_none(part.prop)
        return False

    def _is_full(self, part: ex.ClassExpression) -> bool:
        """Tell whether everything belongs to an expression for sure."""
        full, none = self._is_full, self._relates_none
        if isinstance(part, str):
            return part == THING
        if isinstance(part, ex.ObjectIntersectionOf):
            return all(map(full, part.operands))
        if isinstance(part, ex.ObjectUnionOf):
            return any(map(full, part.operands))
        if isinstance(part, ex.ObjectComplementOf):
            return self._is_empty(part.operand)
        if isinstance(part, ex.ObjectAllValuesFrom):
            return none(part.prop) or full(part.filler)
        if isinstance(part, ex.ObjectMaxCardinality):
            return none(part.prop) or self._is_empty(part.filler)
        if isinstance(part, ex.ObjectExactCardinality):
            return part.n == 0 and (none(part.prop) or self._is_empty(part.filler))
        if isinstance(part, ex.ObjectMinCardinality | ex.DataMinCardinality):
            return part.n == 0
        if isinstance(part, ex.DataAllValuesFrom | ex.DataMaxCardinality):
            return none(part.prop)
        return isinstance(part, ex.DataExactCardinality) and part.n == 0 and none(part.prop)


def _but_one(are_empty: Collection[bool]) -> bool:
    """Tell whether all are empty but one at most."""
    return sum(are_empty) >= len(are_empty) - 1
