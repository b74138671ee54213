"""Axioms in words, for explanations and reports: class expressions in Manchester syntax, facts as
sentences.
"""

from __future__ import annotations

from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import XSD, local_name

_FACETS = {'minInclusive': '>=', 'maxInclusive': '<=', 'minExclusive': '>', 'maxExclusive': '<'}
_PLAIN = {
    XSD + name
    for name in ('string', 'integer', 'int', 'long', 'short', 'byte', 'decimal', 'boolean')
}
_CHARACTERISTICS = {
    'FunctionalObjectProperty': 'functional',
    'FunctionalDataProperty': 'functional',
    'InverseFunctionalObjectProperty': 'inverse functional',
    'ReflexiveObjectProperty': 'reflexive',
    'IrreflexiveObjectProperty': 'irreflexive',
    'SymmetricObjectProperty': 'symmetric',
    'AsymmetricObjectProperty': 'asymmetric',
    'TransitiveObjectProperty': 'transitive',
}


def literal_text(literal: Literal) -> str:
    """Return a literal's lexical form, with its datatype where that is not plain from the form."""
    if literal.language:
        return f'"{literal.lexical}"@{literal.language}'
    if literal.datatype in _PLAIN:
        return literal.lexical if literal.datatype != XSD + 'string' else f'"{literal.lexical}"'
    return f'"{literal.lexical}"^^{local_name(literal.datatype)}'


def expression_text(expression: object) -> str:
    """Return a class expression, property expression, data range, individual or literal by local
    names.
    """
    if isinstance(expression, str):
        return local_name(expression)
    if isinstance(expression, Literal):
        return literal_text(expression)
    if isinstance(expression, ex.ObjectInverseOf):
        return f'inverse {local_name(expression.prop)}'
    if isinstance(expression, (ex.ObjectIntersectionOf, ex.DataIntersectionOf)):
        return '(' + ' and '.join(map(expression_text, expression.operands)) + ')'
    if isinstance(expression, (ex.ObjectUnionOf, ex.DataUnionOf)):
        return '(' + ' or '.join(map(expression_text, expression.operands)) + ')'
    if isinstance(expression, (ex.ObjectComplementOf, ex.DataComplementOf)):
        return 'not ' + expression_text(expression.operand)
    if isinstance(expression, ex.ObjectOneOf):
        return '{' + ', '.join(map(local_name, expression.individuals)) + '}'
    if isinstance(expression, ex.DataOneOf):
        return '{' + ', '.join(map(literal_text, expression.literals)) + '}'
    if isinstance(expression, ex.DatatypeRestriction):
        facets = ', '.join(
            f'{_FACETS.get(local_name(name), local_name(name))} {literal_text(bound)}'
            for name, bound in expression.facets
        )
        return f'{local_name(expression.datatype)}[{facets}]'
    if isinstance(expression, ex.ObjectHasValue):
        return f'{expression_text(expression.prop)} value {local_name(expression.individual)}'
    if isinstance(expression, ex.DataHasValue):
        return f'{local_name(expression.prop)} value {literal_text(expression.literal)}'
    if isinstance(expression, ex.ObjectHasSelf):
        return f'{expression_text(expression.prop)} Self'
    word = {'Some': 'some', 'AllV': 'only', 'MinC': 'min', 'MaxC': 'max', 'Exac': 'exactly'}.get(
        type(expression).__name__.removeprefix('Object').removeprefix('Data')[:4]
    )
    if word is None:
        return str(expression)
    prop = expression_text(expression.prop)  # type: ignore[attr-defined]
    filler = getattr(expression, 'filler', None) or getattr(expression, 'range', '')
    number = f' {expression.n}' if hasattr(expression, 'n') else ''
    return f'{prop} {word}{number} {expression_text(filler)}'


def _argument(argument: object) -> str:
    if isinstance(argument, ex.Variable):
        name = local_name(argument.name).rpartition(':')[2]
        return f'?{name}'
    return expression_text(argument)


def _atom_text(atom: ex.Atom) -> str:
    if isinstance(atom, ex.ClassAtom):
        return f'{expression_text(atom.cls)}({_argument(atom.argument)})'
    if isinstance(atom, ex.DataRangeAtom):
        return f'{expression_text(atom.range)}({_argument(atom.argument)})'
    if isinstance(atom, ex.BuiltinAtom):
        return f'{local_name(atom.builtin)}({", ".join(map(_argument, atom.arguments))})'
    if isinstance(atom, (ex.ObjectPropertyAtom, ex.DataPropertyAtom)):
        name = expression_text(atom.prop)
    else:
        name = 'sameAs' if isinstance(atom, ex.SameIndividualAtom) else 'differentFrom'
    return f'{name}({_argument(atom.first)}, {_argument(atom.second)})'


def axiom_text(axiom: ax.Axiom) -> str:
    """Return an axiom in one line."""
    if isinstance(axiom, ax.Rule):
        body = ', '.join(map(_atom_text, axiom.body))
        head = ', '.join(map(_atom_text, axiom.head))
        text = f'{body} -> {head}'
        return f'{axiom.label}: {text}' if axiom.label else text
    if isinstance(axiom, ax.ClassAssertion):
        return f'{local_name(axiom.individual)} is {expression_text(axiom.cls)}'
    if isinstance(axiom, (ax.ObjectPropertyAssertion, ax.DataPropertyAssertion)):
        value = axiom.object if isinstance(axiom, ax.ObjectPropertyAssertion) else axiom.literal
        names = (local_name(axiom.subject), local_name(axiom.prop), expression_text(value))
        return ' '.join(names)
    if isinstance(axiom, (ax.NegativeObjectPropertyAssertion, ax.NegativeDataPropertyAssertion)):
        target: object = (
            axiom.object if isinstance(axiom, ax.NegativeObjectPropertyAssertion) else axiom.literal
        )
        names = (local_name(axiom.subject), local_name(axiom.prop), expression_text(target))
        return 'not: ' + ' '.join(names)
    if isinstance(axiom, (ax.SameIndividual, ax.DifferentIndividuals)):
        listed = sorted(map(local_name, axiom.individuals))
        shown = listed if len(listed) <= 6 else [*listed[:5], f'{len(listed) - 5} more']
        relation = 'the same' if isinstance(axiom, ax.SameIndividual) else 'all different'
        return f'{", ".join(shown)} are {relation}'
    if isinstance(axiom, ax.SubClassOf):
        return f'{expression_text(axiom.sub)} SubClassOf {expression_text(axiom.sup)}'
    if isinstance(axiom, (ax.EquivalentClasses, ax.DisjointClasses)):
        word = 'EquivalentTo' if isinstance(axiom, ax.EquivalentClasses) else 'DisjointWith'
        return f' {word} '.join(map(expression_text, axiom.classes))
    if isinstance(axiom, ax.DisjointUnion):
        parts = ', '.join(map(expression_text, axiom.classes))
        return f'{local_name(axiom.cls)} DisjointUnionOf {parts}'
    if isinstance(axiom, (ax.SubObjectPropertyOf, ax.SubDataPropertyOf)):
        return f'{expression_text(axiom.sub)} SubPropertyOf {expression_text(axiom.sup)}'
    if isinstance(axiom, ax.SubPropertyChainOf):
        chain = ' o '.join(map(expression_text, axiom.chain))
        return f'{chain} SubPropertyOf {expression_text(axiom.sup)}'
    if isinstance(axiom, ax.InverseObjectProperties):
        return f'{expression_text(axiom.first)} InverseOf {expression_text(axiom.second)}'
    if isinstance(axiom, (ax.ObjectPropertyDomain, ax.DataPropertyDomain)):
        return f'domain of {expression_text(axiom.prop)} is {expression_text(axiom.domain)}'
    if isinstance(axiom, (ax.ObjectPropertyRange, ax.DataPropertyRange)):
        return f'range of {expression_text(axiom.prop)} is {expression_text(axiom.range)}'
    name = type(axiom).__name__
    if name in _CHARACTERISTICS:
        return f'{expression_text(axiom.prop)} is {_CHARACTERISTICS[name]}'  # type: ignore[attr-defined]
    if isinstance(axiom, ax.HasKey):
        keys = (*axiom.object_props, *axiom.data_props)
        return f'{expression_text(axiom.cls)} HasKey {", ".join(map(expression_text, keys))}'
    if name.startswith(('Equivalent', 'Disjoint')):
        word = 'EquivalentTo' if name.startswith('Equivalent') else 'DisjointWith'
        return f' {word} '.join(map(expression_text, axiom.props))  # type: ignore[attr-defined]
    return str(axiom)
