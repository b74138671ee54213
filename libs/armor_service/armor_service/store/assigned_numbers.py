"""Numbers that an owlready2 program assigned in place of others.

owlready2 writes every whole number as xsd:integer and every other one as xsd:decimal, and removes
them so, too: where a value is of another type, such as xsd:long, an assignment leaves it there and
adds the new one. In the file that is the same as adding a second value. The ontology says which of
the two it is: where an individual may have one value of the property, the new one takes the place
of the old one, and its type; anywhere else both are values.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    Axiom,
    DataPropertyAssertion,
    EquivalentClasses,
    FunctionalDataProperty,
    SubClassOf,
)
from owl_reasoner.owl.expressions import (
    ClassExpression,
    DataExactCardinality,
    DataMaxCardinality,
    Literal,
    ObjectIntersectionOf,
)
from owl_reasoner.owl.vocabulary import XSD

_WRITTEN_AS = {
    XSD + 'integer': {
        XSD + name
        for name in (
            *('long', 'int', 'short', 'byte', 'unsignedLong', 'unsignedInt', 'unsignedShort'),
            *('unsignedByte', 'nonNegativeInteger', 'positiveInteger', 'nonPositiveInteger'),
            'negativeInteger',
        )
    },
    XSD + 'decimal': {XSD + 'double', XSD + 'float'},
}
"""The types that owlready2 writes numbers with, and those of which it does so as well."""


def assigned_numbers(
    kb: KnowledgeBase, come: Iterable[Axiom], gone: Iterable[Axiom]
) -> Iterator[tuple[DataPropertyAssertion, DataPropertyAssertion]]:
    """Yield what came in place of a number, each with what it is to be.

    Args:
        kb: The ontology before the change, reasoned over.
        come, gone: What another program wrote and removed.
    """
    removed = {(a.subject, a.prop) for a in gone if isinstance(a, DataPropertyAssertion)}
    new: dict[tuple[str, str], list[DataPropertyAssertion]] = {}
    for axiom in come:
        if isinstance(axiom, DataPropertyAssertion) and axiom.literal.datatype in _WRITTEN_AS:
            new.setdefault((axiom.subject, axiom.prop), []).append(axiom)
    for (subject, prop), found in new.items():
        old = list(kb.asserted_values(prop, subject))
        if len(found) != 1 or len(old) != 1 or (subject, prop) in removed:
            continue
        literal = found[0].literal
        if old[0].datatype in _WRITTEN_AS[literal.datatype] and has_one_value(kb, subject, prop):
            typed = Literal(literal.lexical, old[0].datatype)
            yield found[0], DataPropertyAssertion(prop, subject, typed)


def has_one_value(kb: KnowledgeBase, individual: str, prop: str) -> bool:
    """Tell whether the ontology says that an individual has at most one value of a property:
    it is functional, or a class of the individual allows one.
    """
    if FunctionalDataProperty(prop) in kb:
        return True
    for cls in kb.types(individual):
        for axiom in kb.axioms_about(cls):
            if isinstance(axiom, SubClassOf) and axiom.sub == cls:
                sides: tuple[ClassExpression, ...] = (axiom.sup,)
            elif isinstance(axiom, EquivalentClasses) and cls in axiom.classes:
                sides = axiom.classes
            else:
                continue
            if any(_allows_one(side, prop) for side in sides):
                return True
    return False


def _allows_one(expression: ClassExpression, prop: str) -> bool:
    if isinstance(expression, ObjectIntersectionOf):
        return any(_allows_one(operand, prop) for operand in expression.operands)
    if isinstance(expression, DataMaxCardinality | DataExactCardinality):
        return expression.prop == prop and expression.n <= 1
    return False
