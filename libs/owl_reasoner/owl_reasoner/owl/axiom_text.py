"""Axioms in words, for explanations and reports: class expressions in Manchester syntax, facts as
sentences.
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD, local_name

_FACETS = {'minInclusive': '>=', 'maxInclusive': '<=', 'minExclusive': '>', 'maxExclusive': '<'}
_PLAIN = {
    XSD + name
    for name in ('string', 'integer', 'int', 'long', 'short', 'byte', 'decimal', 'boolean')
}
_FORMS = {
    'InverseOf': 'inverse {0}',
    'IntersectionOf': '({0})',
    'UnionOf': '({0})',
    'ComplementOf': 'not {0}',
    'OneOf': '{{{0}}}',
    'SomeValuesFrom': '{0} some {1}',
    'AllValuesFrom': '{0} only {1}',
    'HasValue': '{0} value {1}',
    'HasSelf': '{0} Self',
    'MinCardinality': '{1} min {0} {2}',
    'MaxCardinality': '{1} max {0} {2}',
    'ExactCardinality': '{1} exactly {0} {2}',
    'ClassAtom': '{0}({1})',
    'RangeAtom': '{0}({1})',
    'PropertyAtom': '{0}({1}, {2})',
    'SameIndividualAtom': 'sameAs({0}, {1})',
    'DifferentIndividualsAtom': 'differentFrom({0}, {1})',
    'BuiltinAtom': '{0}({1})',
    'ClassAssertion': '{1} is {0}',
    'PropertyAssertion': '{1} {0} {2}',
    'NegativePropertyAssertion': 'not: {1} {0} {2}',
    'SubClassOf': '{0} SubClassOf {1}',
    'EquivalentClasses': '{0}',
    'DisjointClasses': '{0}',
    'DisjointUnion': '{0} DisjointUnionOf {1}',
    'SubPropertyOf': '{0} SubPropertyOf {1}',
    'SubPropertyChainOf': '{0} SubPropertyOf {1}',
    'EquivalentProperties': '{0}',
    'DisjointProperties': '{0}',
    'InverseProperties': '{0} InverseOf {1}',
    'PropertyDomain': 'domain of {0} is {1}',
    'PropertyRange': 'range of {0} is {1}',
    'FunctionalProperty': '{0} is functional',
    'InverseFunctionalProperty': '{0} is inverse functional',
    'ReflexiveProperty': '{0} is reflexive',
    'IrreflexiveProperty': '{0} is irreflexive',
    'SymmetricProperty': '{0} is symmetric',
    'AsymmetricProperty': '{0} is asymmetric',
    'TransitiveProperty': '{0} is transitive',
    'Rule': '{0} -> {1}',
}
"""The words for a construct, by its name without Object or Data, around its fields in order."""
_BETWEEN = {
    'IntersectionOf': ' and ',
    'UnionOf': ' or ',
    'EquivalentClasses': ' EquivalentTo ',
    'EquivalentProperties': ' EquivalentTo ',
    'DisjointClasses': ' DisjointWith ',
    'DisjointProperties': ' DisjointWith ',
    'SubPropertyChainOf': ' o ',
}
"""What stands between those that a construct lists, where that is no comma."""


def literal_text(literal: Literal) -> str:
    """Return a literal's lexical form, with its datatype where that is not plain from the form."""
    if literal.language:
        return f'"{literal.lexical}"@{literal.language}'
    if literal.datatype in _PLAIN:
        return literal.lexical if literal.datatype != XSD + 'string' else f'"{literal.lexical}"'
    return f'"{literal.lexical}"^^{local_name(literal.datatype)}'


def expression_text(expression: object) -> str:
    """Return a class expression, property expression, data range, atom, individual or literal by
    local names.
    """
    if isinstance(expression, str):
        return local_name(expression)
    if isinstance(expression, Literal):
        return literal_text(expression)
    if isinstance(expression, ex.Variable):
        return f'?{local_name(expression.name).rpartition(":")[2]}'
    if isinstance(expression, ex.DatatypeRestriction):
        facets = ', '.join(
            f'{_FACETS.get(local_name(name), local_name(name))} {literal_text(bound)}'
            for name, bound in expression.facets
        )
        return f'{local_name(expression.datatype)}[{facets}]'
    return _construct_text(expression)


def _construct_text(construct: Any) -> str:
    """Return a record of fields in the words of the table; as Python writes it, if it has none."""
    name = type(construct).__name__.replace('Object', '').replace('Data', '')
    form, between = _FORMS.get(name), _BETWEEN.get(name, ', ')
    if form is None:
        return str(construct)
    parts = (getattr(construct, entry.name) for entry in fields(construct))
    texts = (
        between.join(map(expression_text, part))
        if isinstance(part, tuple)
        else expression_text(part)
        for part in parts
    )
    return form.format(*texts)


def axiom_text(axiom: ax.Axiom) -> str:
    """Return an axiom in one line."""
    if isinstance(axiom, (ax.SameIndividual, ax.DifferentIndividuals)):
        listed = sorted(map(local_name, axiom.individuals))
        shown = listed if len(listed) <= 6 else [*listed[:5], f'{len(listed) - 5} more']
        relation = 'the same' if isinstance(axiom, ax.SameIndividual) else 'all different'
        return f'{", ".join(shown)} are {relation}'
    if isinstance(axiom, ax.HasKey):
        keys = (*axiom.object_props, *axiom.data_props)
        return f'{expression_text(axiom.cls)} HasKey {", ".join(map(expression_text, keys))}'
    label = axiom.label if isinstance(axiom, ax.Rule) else ''
    return f'{label}: {_construct_text(axiom)}' if label else _construct_text(axiom)
