"""OWL axioms and SWRL rules to RDF triples (https://www.w3.org/TR/owl2-mapping-to-rdf/)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import count
from typing import Any

from owl_reasoner.documents.mapping import ATOMS, CARDINALITIES
from owl_reasoner.documents.rdf_xml import Node, Triple
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.entities import entities_of, renamed
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, SWRL, THING, XSD

_TYPE = RDF + 'type'
KIND_TYPES = {
    'class': OWL + 'Class',
    'object_property': OWL + 'ObjectProperty',
    'data_property': OWL + 'DatatypeProperty',
    'annotation_property': OWL + 'AnnotationProperty',
    'individual': OWL + 'NamedIndividual',
    'datatype': RDFS + 'Datatype',
}
_CLASS, _RESTRICTION, _DATATYPE = OWL + 'Class', OWL + 'Restriction', RDFS + 'Datatype'
_ON = (OWL + 'onProperty', 'prop')
_NEGATIVE = (
    OWL + 'NegativePropertyAssertion',
    (OWL + 'sourceIndividual', 'subject'),
    (OWL + 'assertionProperty', 'prop'),
)
_NODES: dict[type, tuple[Any, ...]] = {
    ex.ObjectInverseOf: ('', (OWL + 'inverseOf', 'prop')),
    ex.ObjectIntersectionOf: (_CLASS, (OWL + 'intersectionOf', 'operands')),
    ex.ObjectUnionOf: (_CLASS, (OWL + 'unionOf', 'operands')),
    ex.ObjectComplementOf: (_CLASS, (OWL + 'complementOf', 'operand')),
    ex.ObjectOneOf: (_CLASS, (OWL + 'oneOf', 'individuals')),
    ex.ObjectSomeValuesFrom: (_RESTRICTION, _ON, (OWL + 'someValuesFrom', 'filler')),
    ex.ObjectAllValuesFrom: (_RESTRICTION, _ON, (OWL + 'allValuesFrom', 'filler')),
    ex.ObjectHasValue: (_RESTRICTION, _ON, (OWL + 'hasValue', 'individual')),
    ex.ObjectHasSelf: (_RESTRICTION, _ON),
    ex.DataSomeValuesFrom: (_RESTRICTION, _ON, (OWL + 'someValuesFrom', 'range')),
    ex.DataAllValuesFrom: (_RESTRICTION, _ON, (OWL + 'allValuesFrom', 'range')),
    ex.DataHasValue: (_RESTRICTION, _ON, (OWL + 'hasValue', 'literal')),
    **{record: (_RESTRICTION, _ON) for row in CARDINALITIES for record in row[2:]},
    ex.DataIntersectionOf: (_DATATYPE, (OWL + 'intersectionOf', 'operands')),
    ex.DataUnionOf: (_DATATYPE, (OWL + 'unionOf', 'operands')),
    ex.DataComplementOf: (_DATATYPE, (OWL + 'datatypeComplementOf', 'operand')),
    ex.DataOneOf: (_DATATYPE, (OWL + 'oneOf', 'literals')),
    ex.DatatypeRestriction: (_DATATYPE, (OWL + 'onDatatype', 'datatype')),
    **{record: (kind, *statements) for kind, (record, *statements) in ATOMS.items()},
    ax.NegativeObjectPropertyAssertion: (*_NEGATIVE, (OWL + 'targetIndividual', 'object')),
    ax.NegativeDataPropertyAssertion: (*_NEGATIVE, (OWL + 'targetValue', 'literal')),
}
"""What has a node of its own: the node's type, then each predicate with the field behind it."""
_PAIRS: dict[type, tuple[str, str, str]] = {
    ax.ClassAssertion: ('individual', _TYPE, 'cls'),
    ax.SubClassOf: ('sub', RDFS + 'subClassOf', 'sup'),
    ax.SubObjectPropertyOf: ('sub', RDFS + 'subPropertyOf', 'sup'),
    ax.SubDataPropertyOf: ('sub', RDFS + 'subPropertyOf', 'sup'),
    ax.SubPropertyChainOf: ('sup', OWL + 'propertyChainAxiom', 'chain'),
    ax.InverseObjectProperties: ('first', OWL + 'inverseOf', 'second'),
    ax.ObjectPropertyDomain: ('prop', RDFS + 'domain', 'domain'),
    ax.DataPropertyDomain: ('prop', RDFS + 'domain', 'domain'),
    ax.ObjectPropertyRange: ('prop', RDFS + 'range', 'range'),
    ax.DataPropertyRange: ('prop', RDFS + 'range', 'range'),
    ax.DatatypeDefinition: ('datatype', OWL + 'equivalentClass', 'range'),
    ax.DisjointUnion: ('cls', OWL + 'disjointUnionOf', 'classes'),
}
"""Axioms that are one triple: the field of its subject, its predicate, the field of its value."""
_EQUALS: dict[type, tuple[str, str]] = {
    ax.EquivalentClasses: ('classes', OWL + 'equivalentClass'),
    ax.EquivalentObjectProperties: ('props', OWL + 'equivalentProperty'),
    ax.EquivalentDataProperties: ('props', OWL + 'equivalentProperty'),
    ax.SameIndividual: ('individuals', OWL + 'sameAs'),
}
"""Axioms that are a triple for each member but one."""
_DISJOINT = (OWL + 'propertyDisjointWith', OWL + 'AllDisjointProperties')
_APART: dict[type, tuple[str, str, str]] = {
    ax.DisjointClasses: ('classes', OWL + 'disjointWith', OWL + 'AllDisjointClasses'),
    ax.DisjointObjectProperties: ('props', *_DISJOINT),
    ax.DisjointDataProperties: ('props', *_DISJOINT),
    ax.DifferentIndividuals: ('individuals', OWL + 'differentFrom', OWL + 'AllDifferent'),
}
"""Axioms that are a triple for two members, and a node for more."""
_GROUPS = {_NEGATIVE[0], *(group for _, _, group in _APART.values())}
"""Types of the nodes that stand for one axiom."""
_COUNTED = {record: row[:2] for row in CARDINALITIES for record in row[2:]}


class _TripleWriter:
    def __init__(self, iri: str, prefix: str = '_:w') -> None:
        self.iri = iri
        self.triples: list[Triple] = []
        self._prefix = prefix
        self._numbers = count(1)
        self._variables: dict[str, None] = {}

    def add(self, subject: Node, predicate: str, value: Node) -> None:
        assert isinstance(subject, str)
        self.triples.append((subject, predicate, value))

    def blank(self, kind: str = '') -> str:
        node = f'{self._prefix}{next(self._numbers)}'
        if kind:
            self.add(node, _TYPE, kind)
        return node

    def sequence(self, items: Sequence[Node], kind: str = '') -> str:
        head = RDF + 'nil'
        for item in reversed(items):
            cell = self.blank(kind)
            self.add(cell, RDF + 'first', item)
            self.add(cell, RDF + 'rest', head)
            head = cell
        return head

    # --- parts ---

    def part(self, part: Any) -> Node:
        """Return the node of whatever a field holds."""
        if isinstance(part, str | Literal):
            return part
        if isinstance(part, tuple):
            return self.sequence([self.part(one) for one in part])
        if isinstance(part, ex.Variable):
            return self.variable(part)
        kind, *statements = _NODES[type(part)]
        node = self.blank(kind)
        for predicate, field in statements:
            self.add(node, predicate, self.part(getattr(part, field)))
        if isinstance(part, ex.ObjectHasSelf):
            self.add(node, OWL + 'hasSelf', Literal('true', XSD + 'boolean'))
        elif isinstance(part, ex.DatatypeRestriction):
            facets = [self.blank() for _ in part.facets]
            for facet, (name, bound) in zip(facets, part.facets, strict=True):
                self.add(facet, name, bound)
            self.add(node, OWL + 'withRestrictions', self.sequence(facets))
        elif type(part) in _COUNTED:
            self.count(node, part)
        return node

    def count(self, node: str, part: Any) -> None:
        """Write a cardinality; an unqualified one only of objects, which OWL 1 knew."""
        plain, qualified = _COUNTED[type(part)]
        objects = hasattr(part, 'filler')
        is_plain = objects and part.filler == THING
        number = Literal(str(part.n), XSD + 'nonNegativeInteger')
        self.add(node, OWL + (plain if is_plain else qualified), number)
        if objects and not is_plain:
            self.add(node, OWL + 'onClass', self.part(part.filler))
        elif not objects:
            self.add(node, OWL + 'onDataRange', self.part(part.range))

    def variable(self, variable: ex.Variable) -> str:
        name = variable.name if ':' in variable.name else f'urn:swrl:var#{variable.name}'
        if name not in self._variables:
            self._variables[name] = None
            self.add(name, _TYPE, SWRL + 'Variable')
        return name

    # --- axioms ---

    def axiom(self, axiom: Axiom) -> None:
        kind: Any = type(axiom)
        if isinstance(axiom, ax.Declaration):
            self.add(axiom.iri, _TYPE, KIND_TYPES[axiom.kind])
        elif isinstance(axiom, ax.Import):
            self.add(self.iri, OWL + 'imports', axiom.iri)
        elif isinstance(axiom, ax.AnnotationAssertion):
            self.add(axiom.subject, axiom.prop, axiom.value)
        elif isinstance(axiom, ax.ObjectPropertyAssertion):
            self.add(axiom.subject, axiom.prop, axiom.object)
        elif isinstance(axiom, ax.DataPropertyAssertion):
            self.add(axiom.subject, axiom.prop, axiom.literal)
        elif kind in _PAIRS:
            subject, predicate, value = _PAIRS[kind]
            node = self.part(getattr(axiom, subject))
            self.add(node, predicate, self.part(getattr(axiom, value)))
        elif kind in _EQUALS:
            field, predicate = _EQUALS[kind]
            members = sorted(self.members(axiom, field), key=lambda node: node[:2] == '_:')
            for other in members[1:]:
                self.add(members[0], predicate, other)
        elif kind in _APART:
            field, predicate, group = _APART[kind]
            members = self.members(axiom, field)
            if len(members) == 2:
                self.add(members[0], predicate, members[1])
            else:
                self.add(self.blank(group), OWL + 'members', self.sequence(members))
        elif kind in _NODES:
            self.part(axiom)
        elif isinstance(axiom, ax.HasKey):
            keys = (*axiom.object_props, *axiom.data_props)
            self.add(self.part(axiom.cls), OWL + 'hasKey', self.part(keys))
        elif isinstance(axiom, ax.Rule):
            self.rule(axiom)
        else:
            name = kind.__name__.replace('Object', '').replace('Data', '')
            self.add(self.part(axiom.prop), _TYPE, OWL + name)  # type: ignore[attr-defined]

    def members(self, axiom: Axiom, field: str) -> list[str]:
        """Return the nodes of what an axiom lists; those of a set in one order."""
        listed = getattr(axiom, field)
        parts = sorted(listed) if isinstance(listed, frozenset) else listed
        if isinstance(listed, frozenset) and len(listed) == 1:
            parts *= 2  # Of itself: as a list of one it would say nothing.
        return [str(self.part(one)) for one in parts]

    def rule(self, rule: ax.Rule) -> None:
        node = self.blank(SWRL + 'Imp')
        for predicate, value in rule.annotations:
            self.add(node, predicate, value)
        for predicate, atoms in ((SWRL + 'body', rule.body), (SWRL + 'head', rule.head)):
            nodes = [self.part(atom) for atom in atoms]
            self.add(node, predicate, self.sequence(nodes, SWRL + 'AtomList'))

    def annotated(self, axiom: Axiom, notes: Sequence[ax.AxiomAnnotation]) -> None:
        """Write an axiom with what is said of it: on its node, where it has one, else on its
        triples.
        """
        start = len(self.triples)
        self.axiom(axiom)
        written = self.triples[start:]
        node, predicate, value = written[0]
        if predicate == _TYPE and value in _GROUPS:
            nodes = [node]
        else:
            main = [triple for triple in written if triple[:2] == written[-1][:2]]
            nodes = [self.reified(*triple) for triple in main]
        for node in nodes:
            for note in notes:
                for prop, what in note.annotations:
                    self.add(node, prop, what)

    def reified(self, subject: str, predicate: str, value: Node) -> str:
        node = self.blank(OWL + 'Axiom')
        self.add(node, OWL + 'annotatedSource', subject)
        self.add(node, OWL + 'annotatedProperty', predicate)
        self.add(node, OWL + 'annotatedTarget', value)
        return node


_LABEL = re.compile(r'_:(?!w\d+\Z)[A-Za-z](?:[\w.-]*\w)?', re.ASCII)
"""Labels that every format can hold, and that no node of an expression has."""


def _labelled(axioms: tuple[Axiom, ...], found: set[str]) -> tuple[Axiom, ...]:
    """Give individuals without a name labels that can be written, where they have others.

    Args:
        axioms: The axioms.
        found: The labels in them.
    """
    free = (label for number in count(1) if (label := f'_:i{number}') not in found)
    new = {old: next(free) for old in sorted(found) if not _LABEL.fullmatch(old)}
    return tuple(_relabelled(axiom, new) for axiom in axioms) if new else axioms


def _relabelled(axiom: Axiom, new: dict[str, str]) -> Axiom:
    for name in {name for _, name in entities_of(axiom) if name in new}:
        axiom = renamed(axiom, 'individual', name, new[name])
    return axiom


def _mentioned(axioms: Iterable[Axiom]) -> tuple[dict[tuple[str, str], None], set[str]]:
    """Return the classes, properties and datatypes that axioms use, in order, and the labels of
    individuals without a name.
    """
    used: dict[tuple[str, str], None] = {}
    labels: set[str] = set()
    for axiom in axioms:
        if isinstance(axiom, ax.Declaration):
            continue
        if isinstance(axiom, ax.AxiomAnnotation):
            used.update((('annotation_property', prop), None) for prop, _ in axiom.annotations)
        for entity in entities_of(axiom):
            if entity[0] not in ('individual', 'annotated'):
                used[entity] = None
            elif entity[1][:2] == '_:':
                labels.add(entity[1])
    return used, labels


NODE = '_:#'
"""How the nodes of expressions begin in `axiom_triples`; no individual has such a label."""


def axiom_triples(axiom: Axiom, iri: str) -> list[Triple]:
    """Return the triples of one axiom, without those that declare what it uses.

    Args:
        axiom: Of any kind; the annotation of an axiom comes with the axiom that it annotates.
        iri: The ontology's IRI, the subject of imports.
    """
    writer = _TripleWriter(iri, NODE)
    if isinstance(axiom, ax.AxiomAnnotation):
        writer.annotated(axiom.axiom, [axiom])
    else:
        writer.axiom(axiom)
    return writer.triples


_VALUED = ('object_property', 'data_property')


def triples_of(axioms: Iterable[Axiom], iri: str) -> Iterator[Triple]:
    """Return the triples of an ontology, its header first.

    Classes, properties and datatypes that are used but not declared are declared: without, a reader
    could not tell an object property from a data property. One that the header is annotated with
    is not declared for that where it has values, too: they would be read as annotations.
    """
    writer = _TripleWriter(iri)
    writer.add(iri, _TYPE, OWL + 'Ontology')
    axioms = tuple(dict.fromkeys(axioms))
    declared = {(axiom.kind, axiom.iri) for axiom in axioms if isinstance(axiom, ax.Declaration)}
    used, labels = _mentioned(axioms)
    axioms = _labelled(axioms, labels)
    notes: dict[Axiom, list[ax.AxiomAnnotation]] = {}
    for axiom in axioms:
        if isinstance(axiom, ax.AxiomAnnotation):
            notes.setdefault(axiom.axiom, []).append(axiom)
    for axiom in axioms:
        if axiom in notes:
            writer.annotated(axiom, notes[axiom])
        elif not isinstance(axiom, ax.AxiomAnnotation):
            writer.axiom(axiom)
    valued = {name for kind, name in used | dict.fromkeys(declared) if kind in _VALUED}
    for kind, name in used:
        if kind == 'annotation_property' and name in valued:
            continue
        if (kind, name) not in declared and not name.startswith((OWL, RDF, RDFS, XSD)):
            writer.add(name, _TYPE, KIND_TYPES[kind])
    return iter(writer.triples)
