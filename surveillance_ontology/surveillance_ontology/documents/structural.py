"""OWL 2's structural specification: constructs by name, and the axioms that they make.

The functional syntax and OWL/XML both write these constructs; an axiom that is not understood costs
itself alone and is reported with its line (https://www.w3.org/TR/owl2-syntax/, with SWRL rules).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from surveillance_ontology.documents.nodes import IllFormedError
from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import OWL, RDF, RDFS, SWRL, SWRLB, XSD

DEEPEST = 200
"""How deep constructs may nest."""
PREFIXES = {'owl': OWL, 'rdf': RDF, 'rdfs': RDFS, 'xsd': XSD, 'swrl': SWRL, 'swrlb': SWRLB}
"""What a document need not declare."""
MOST_DIGITS = 18
"""Of a number in a cardinality."""


@dataclass(frozen=True, slots=True)
class Call:
    """A construct: its name, its parts, and where it begins.

    A part is an IRI, a literal, a number, a construct, or a tuple of parts.
    """

    name: str
    parts: tuple[Any, ...]
    place: int


class Axioms:
    """Collects what constructs state.

    Args:
        line_of: Gives the line of a place.

    Attributes:
        axioms: In document order.
        unsupported: One sentence for each axiom that was not understood.
        iri: The ontology's IRI, '' without one.
        prefixes: The prefixes that the document declares.
    """

    def __init__(self, line_of: Callable[[int], int]) -> None:
        self._line_of = line_of
        self.axioms: dict[Axiom, None] = {}
        self.unsupported: list[str] = []
        self.iri = ''
        self.prefixes: dict[str, str] = {}

    def named(self, name: str) -> str | None:
        """Return the IRI of a prefixed name; None where its prefix is not declared."""
        prefix, colon, local = name.partition(':')
        base = self.prefixes.get(prefix, PREFIXES.get(prefix))
        return base + local if colon and base is not None else None

    def add(self, call: Call) -> None:
        """Take in an axiom, or report it."""
        parts = [p for p in call.parts if not (isinstance(p, Call) and p.name == 'Annotation')]
        notes = [p for p in call.parts if isinstance(p, Call) and p.name == 'Annotation']
        try:
            if call.name == 'Annotation':
                prop, value = call.parts[-2:]
                axiom: Axiom = ax.AnnotationAssertion(prop, self.iri, value)
            else:
                axiom = _AXIOMS[call.name](parts)
            hash(axiom)
        except KeyError as error:
            self._report(call, f'{error.args[0]} is not understood')
            return
        except (ValueError, TypeError, IndexError) as error:
            reason = str(error) if isinstance(error, IllFormedError) else 'its parts'
            self._report(call, f'{call.name} is not understood: {reason}')
            return
        self.axioms[axiom] = None
        if isinstance(axiom, ax.Import):
            return
        if any(not isinstance(part, str | Literal) for note in notes for part in note.parts):
            self._report(call, 'an annotation on an annotation is not kept')
        pairs = tuple(
            (note.parts[-2], note.parts[-1])
            for note in notes
            if len(note.parts) > 1 and all(isinstance(p, str | Literal) for p in note.parts[-2:])
        )
        if pairs and isinstance(axiom, ax.Rule):
            del self.axioms[axiom]
            self.axioms[ax.Rule(axiom.body, axiom.head, pairs)] = None
        elif pairs:
            self.axioms[ax.AxiomAnnotation(axiom, pairs)] = None

    def _report(self, call: Call, what: str) -> None:
        self.unsupported.append(f'line {self._line_of(call.place)}: {what}')


def _need(value: Any, kind: type, what: str) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool):
        raise IllFormedError(f'expected {what}, got {value}')
    return value


def _iri(value: Any) -> str:
    iri: str = _need(value, str, 'an IRI')
    return iri


def _lit(value: Any) -> Literal:
    literal: Literal = _need(value, Literal, 'a literal')
    return literal


def _prop(value: Any) -> ex.PropertyExpression:
    if isinstance(value, Call) and value.name == 'ObjectInverseOf' and len(value.parts) == 1:
        inner = _prop(value.parts[0])
        return inner.prop if isinstance(inner, ex.ObjectInverseOf) else ex.ObjectInverseOf(inner)
    return _iri(value)


def _made(value: Any, makers: Mapping[str, Callable[[Any], Any]], what: str) -> Any:
    """Return what a name stands for, or a call of one of the makers."""
    if isinstance(value, str):
        return value
    call = _need(value, Call, f'a {what}')
    make = makers.get(call.name)
    if make is None:
        raise IllFormedError(f'{call.name} is no {what}')
    return make(call.parts)


def _cls(value: Any) -> ex.ClassExpression:
    made: ex.ClassExpression = _made(value, _CLASSES, 'class')
    return made


def _range(value: Any) -> ex.DataRange:
    made: ex.DataRange = _made(value, _RANGES, 'data range')
    return made


def _all(read: Callable[[Any], Any], values: Any, fewest: int = 2) -> tuple[Any, ...]:
    if len(values) < fewest:
        raise IllFormedError(f'expected at least {fewest} parts, got {len(values)}')
    return tuple(map(read, values))


def _exactly(values: Any, *reads: Callable[[Any], Any]) -> list[Any]:
    if len(values) != len(reads):
        raise IllFormedError(f'expected {len(reads)} parts, got {len(values)}')
    return [read(value) for read, value in zip(reads, values, strict=True)]


def _of(record: Callable[..., Any], *reads: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda values: record(*_exactly(values, *reads))


def _group(record: Callable[..., Any], read: Callable[[Any], Any], fewest: int = 2) -> Any:
    return lambda values: record(_all(read, values, fewest))


def _counted(record: Callable[..., Any], prop: Any, filler: Any) -> Callable[[Any], Any]:
    def make(values: Any) -> Any:
        if len(values) not in (2, 3):
            raise IllFormedError(f'expected 2 or 3 parts, got {len(values)}')
        number = _need(values[0], int, 'a number')
        rest = [filler(values[2])] if len(values) == 3 else []
        return record(number, prop(values[1]), *rest)

    return make


def _facets(values: Any) -> ex.DatatypeRestriction:
    names, bounds = values[1::2], values[2::2]
    pairs = zip(map(_iri, names), map(_lit, bounds), strict=True)
    return ex.DatatypeRestriction(_iri(values[0]), tuple(pairs))


_CLASSES: dict[str, Callable[[Any], Any]] = {
    'ObjectIntersectionOf': _group(ex.ObjectIntersectionOf, _cls),
    'ObjectUnionOf': _group(ex.ObjectUnionOf, _cls),
    'ObjectComplementOf': _of(ex.ObjectComplementOf, _cls),
    'ObjectOneOf': _group(ex.ObjectOneOf, _iri, 1),
    'ObjectSomeValuesFrom': _of(ex.ObjectSomeValuesFrom, _prop, _cls),
    'ObjectAllValuesFrom': _of(ex.ObjectAllValuesFrom, _prop, _cls),
    'ObjectHasValue': _of(ex.ObjectHasValue, _prop, _iri),
    'ObjectHasSelf': _of(ex.ObjectHasSelf, _prop),
    'ObjectMinCardinality': _counted(ex.ObjectMinCardinality, _prop, _cls),
    'ObjectMaxCardinality': _counted(ex.ObjectMaxCardinality, _prop, _cls),
    'ObjectExactCardinality': _counted(ex.ObjectExactCardinality, _prop, _cls),
    'DataSomeValuesFrom': _of(ex.DataSomeValuesFrom, _iri, _range),
    'DataAllValuesFrom': _of(ex.DataAllValuesFrom, _iri, _range),
    'DataHasValue': _of(ex.DataHasValue, _iri, _lit),
    'DataMinCardinality': _counted(ex.DataMinCardinality, _iri, _range),
    'DataMaxCardinality': _counted(ex.DataMaxCardinality, _iri, _range),
    'DataExactCardinality': _counted(ex.DataExactCardinality, _iri, _range),
}
_RANGES: dict[str, Callable[[Any], Any]] = {
    'DataIntersectionOf': _group(ex.DataIntersectionOf, _range),
    'DataUnionOf': _group(ex.DataUnionOf, _range),
    'DataComplementOf': _of(ex.DataComplementOf, _range),
    'DataOneOf': _group(ex.DataOneOf, _lit, 1),
    'DatatypeRestriction': _facets,
}


def _argument(value: Any) -> Any:
    if isinstance(value, Call) and value.name == 'Variable' and len(value.parts) == 1:
        return ex.Variable(_iri(value.parts[0]))
    return _need(value, str | Literal, 'a variable, an individual or a literal')  # type: ignore[arg-type]


_ATOMS: dict[str, Callable[[Any], Any]] = {
    'ClassAtom': _of(ex.ClassAtom, _cls, _argument),
    'DataRangeAtom': _of(ex.DataRangeAtom, _range, _argument),
    'ObjectPropertyAtom': _of(ex.ObjectPropertyAtom, _prop, _argument, _argument),
    'DataPropertyAtom': _of(ex.DataPropertyAtom, _iri, _argument, _argument),
    'SameIndividualAtom': _of(ex.SameIndividualAtom, _argument, _argument),
    'DifferentIndividualsAtom': _of(ex.DifferentIndividualsAtom, _argument, _argument),
    'BuiltInAtom': lambda values: ex.BuiltinAtom(
        _iri(values[0]), tuple(map(_argument, values[1:]))
    ),
}


def _rule(values: Any) -> ax.Rule:
    body, head = _exactly(values, *(lambda part: _need(part, Call, 'atoms') for _ in range(2)))
    return ax.Rule(
        tuple(_ATOMS[atom.name](atom.parts) for atom in body.parts),
        tuple(_ATOMS[atom.name](atom.parts) for atom in head.parts),
    )


def _sub_property(values: Any) -> Axiom:
    sub, sup = _exactly(values, lambda part: part, _prop)
    if isinstance(sub, Call) and sub.name == 'ObjectPropertyChain':
        return ax.SubPropertyChainOf(_all(_prop, sub.parts), sup)
    return ax.SubObjectPropertyOf(_prop(sub), sup)


def _declaration(values: Any) -> Axiom:
    (call,) = values
    return ax.Declaration(_KINDS[call.name], _exactly(call.parts, _iri)[0])


def _individual_assertion(negative: bool) -> Callable[[Any], Axiom]:
    def make(values: Any) -> Axiom:
        prop, subject, target = _exactly(values, _prop, _iri, _iri)
        if isinstance(prop, ex.ObjectInverseOf):
            prop, subject, target = prop.prop, target, subject
        if negative:
            return ax.NegativeObjectPropertyAssertion(prop, subject, target)
        return ax.ObjectPropertyAssertion(prop, subject, target)

    return make


def _key(values: Any) -> Axiom:
    cls, objects, datas = _exactly(values, _cls, tuple, tuple)
    return ax.HasKey(cls, tuple(map(_prop, objects)), tuple(map(_iri, datas)))


def _about_property(name: str) -> Callable[[Any], Any]:
    """Return an axiom of annotation properties, as an annotation of the property."""
    return lambda values: ax.AnnotationAssertion(RDFS + name, *_exactly(values, _iri, _iri))


_KINDS = {
    'Class': 'class',
    'ObjectProperty': 'object_property',
    'DataProperty': 'data_property',
    'NamedIndividual': 'individual',
    'AnnotationProperty': 'annotation_property',
    'Datatype': 'datatype',
}
_AXIOMS: dict[str, Callable[[Any], Axiom]] = {
    'Declaration': _declaration,
    'Import': _of(ax.Import, _iri),
    'SubClassOf': _of(ax.SubClassOf, _cls, _cls),
    'EquivalentClasses': _group(ax.EquivalentClasses, _cls),
    'DisjointClasses': _group(ax.DisjointClasses, _cls),
    'DisjointUnion': lambda v: ax.DisjointUnion(_iri(v[0]), _all(_cls, v[1:])),
    'SubObjectPropertyOf': _sub_property,
    'EquivalentObjectProperties': _group(ax.EquivalentObjectProperties, _prop),
    'DisjointObjectProperties': _group(ax.DisjointObjectProperties, _prop),
    'InverseObjectProperties': _of(ax.InverseObjectProperties, _prop, _prop),
    'ObjectPropertyDomain': _of(ax.ObjectPropertyDomain, _prop, _cls),
    'ObjectPropertyRange': _of(ax.ObjectPropertyRange, _prop, _cls),
    'FunctionalObjectProperty': _of(ax.FunctionalObjectProperty, _prop),
    'InverseFunctionalObjectProperty': _of(ax.InverseFunctionalObjectProperty, _prop),
    'ReflexiveObjectProperty': _of(ax.ReflexiveObjectProperty, _prop),
    'IrreflexiveObjectProperty': _of(ax.IrreflexiveObjectProperty, _prop),
    'SymmetricObjectProperty': _of(ax.SymmetricObjectProperty, _prop),
    'AsymmetricObjectProperty': _of(ax.AsymmetricObjectProperty, _prop),
    'TransitiveObjectProperty': _of(ax.TransitiveObjectProperty, _prop),
    'SubDataPropertyOf': _of(ax.SubDataPropertyOf, _iri, _iri),
    'EquivalentDataProperties': _group(ax.EquivalentDataProperties, _iri),
    'DisjointDataProperties': _group(ax.DisjointDataProperties, _iri),
    'DataPropertyDomain': _of(ax.DataPropertyDomain, _iri, _cls),
    'DataPropertyRange': _of(ax.DataPropertyRange, _iri, _range),
    'FunctionalDataProperty': _of(ax.FunctionalDataProperty, _iri),
    'DatatypeDefinition': _of(ax.DatatypeDefinition, _iri, _range),
    'HasKey': _key,
    'SameIndividual': lambda v: ax.SameIndividual(frozenset(_all(_iri, v))),
    'DifferentIndividuals': lambda v: ax.DifferentIndividuals(frozenset(_all(_iri, v))),
    'ClassAssertion': _of(ax.ClassAssertion, _cls, _iri),
    'ObjectPropertyAssertion': _individual_assertion(False),
    'NegativeObjectPropertyAssertion': _individual_assertion(True),
    'DataPropertyAssertion': _of(ax.DataPropertyAssertion, _iri, _iri, _lit),
    'NegativeDataPropertyAssertion': _of(ax.NegativeDataPropertyAssertion, _iri, _iri, _lit),
    'AnnotationAssertion': lambda v: ax.AnnotationAssertion(*_exactly(v, _iri, _iri, _value)),
    'SubAnnotationPropertyOf': _about_property('subPropertyOf'),
    'AnnotationPropertyDomain': _about_property('domain'),
    'AnnotationPropertyRange': _about_property('range'),
    'DLSafeRule': _rule,
}


def _value(value: Any) -> str | Literal:
    found: str | Literal = _need(value, str | Literal, 'an IRI or a literal')  # type: ignore[arg-type]
    return found
