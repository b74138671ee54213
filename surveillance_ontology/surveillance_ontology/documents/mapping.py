"""RDF triples to OWL axioms and SWRL rules.

Follows OWL 2 Mapping to RDF Graphs (https://www.w3.org/TR/owl2-mapping-to-rdf/), section 3, and the
SWRL submission's RDF syntax. What is not understood is reported with its line, never dropped in
silence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from surveillance_ontology.documents.nodes import (
    ANNOTATIONS,
    BUILT_IN,
    CHARACTERISTICS,
    DECLARATIONS,
    IllFormedError,
    NodeReader,
)
from surveillance_ontology.documents.rdf_xml import Graph, Node
from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import (
    NOTHING,
    OWL,
    RDF,
    RDFS,
    SWRL,
    THING,
    XSD,
    local_name,
)

_TYPE = RDF + 'type'
_MARKS = {
    *(OWL + name for name in ('Ontology', 'Restriction')),
    *(RDF + name for name in ('List', 'Property')),
    *(SWRL + name for name in ('Variable', 'AtomList', 'Builtin')),
}
_STRUCTURE = {RDF + 'first', RDF + 'rest'} | {
    OWL + name
    for name in (  # noqa: SIM905 - a list of so many words is read better as text
        'onProperty onClass onDataRange onDatatype withRestrictions onProperties someValuesFrom '
        'allValuesFrom hasValue hasSelf cardinality minCardinality maxCardinality '
        'qualifiedCardinality minQualifiedCardinality maxQualifiedCardinality members '
        'distinctMembers annotatedSource annotatedProperty annotatedTarget sourceIndividual '
        'assertionProperty targetIndividual targetValue'
    ).split()
}


class Mapping(NodeReader):
    """Turns one graph into `axioms` (document order) and `unsupported` (sentences)."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph)
        self.axioms: dict[Axiom, None] = {}
        self._added: list[Axiom] = []
        self._used: set[str] = set()
        for subject, properties in self._nodes.items():
            self._subject(subject, properties)

    # --- axioms ---

    def _add(self, axiom: Axiom) -> None:
        self.axioms[axiom] = None
        self._added.append(axiom)

    def _subject(self, subject: str, properties: dict[str, list[Node]]) -> None:
        self._subject_read = subject
        self._added = []
        types = [value for value in properties.get(_TYPE, ()) if isinstance(value, str)]
        special = next((_SPECIAL[name] for name in types if name in _SPECIAL), None)
        if special is None and OWL + 'sourceIndividual' in properties:
            special = Mapping._negative  # Its type is missing; nothing else has a source.
        if special is not None:
            self._attempt(subject, special, self, subject, properties)
            return
        for name in types:
            self._attempt(subject, self._type, subject, name)
        if OWL + 'onProperty' in properties and not subject.startswith('_:'):
            self._attempt(subject, self._named_restriction, subject, properties)
        for predicate, values in properties.items():
            if predicate == _TYPE or predicate in _STRUCTURE:
                continue
            for value in values:
                self._attempt(subject, self._triple, subject, predicate, value)

    def _named_restriction(self, subject: str, properties: dict[str, list[Node]]) -> None:
        self._add(ax.EquivalentClasses((subject, self._restriction(subject, properties))))

    def _attempt(self, subject: str, read: Callable[..., None], *arguments: object) -> None:
        """Read one statement; an ill-formed class in it costs the statement alone."""
        try:
            read(*arguments)
        except IllFormedError as error:
            text = f'a statement about {local_name(subject)} is left out: {error.message}'
            self.unsupported.append(f'line {error.line}: {text}' if error.line else text)

    def _triple(self, subject: str, predicate: str, value: Node) -> None:
        handler = _PREDICATES.get(predicate)
        if handler is None:
            self._statement(subject, predicate, value)
        elif isinstance(value, str):
            handler(self, subject, value)
        else:
            raise self._fail(
                subject,
                f'{local_name(predicate)} of {local_name(subject)} has the literal'
                f' {value.lexical!r}, expected a resource',
            )

    def _type(self, subject: str, name: str) -> None:
        kind = DECLARATIONS.get(name)
        if kind is not None:
            if not subject.startswith('_:'):
                self._add(ax.Declaration(kind, subject))
        elif name in CHARACTERISTICS:
            if not subject.startswith('_:'):
                self._add(ax.Declaration('object_property', subject))
            self._add(CHARACTERISTICS[name](self._property(subject)))
        elif name == OWL + 'FunctionalProperty':
            if self._is_data(subject):
                self._add(ax.FunctionalDataProperty(subject))
            else:
                self._add(ax.FunctionalObjectProperty(self._property(subject)))
        elif name in _MARKS or (name.startswith(SWRL) and name.endswith('Atom')):
            pass  # Read where the node is used.
        elif name.startswith(BUILT_IN[:3]) and name not in (THING, NOTHING):
            self._report(subject, f'type {name} of {subject} is not understood')
        else:
            self._add(ax.ClassAssertion(self.expression(name), subject))

    def _statement(self, subject: str, predicate: str, value: Node) -> None:
        kinds = self._kinds.get(predicate, set())
        if 'annotation_property' in kinds or predicate in ANNOTATIONS or subject == self.iri:
            if not subject.startswith('_:'):
                self._add(ax.AnnotationAssertion(predicate, subject, value))
        elif predicate.startswith(SWRL):
            pass
        elif predicate.startswith(XSD) and subject.startswith('_:'):
            pass  # A facet of a datatype restriction.
        elif predicate.startswith(BUILT_IN[:3]):
            self._report(subject, f'{predicate} on {subject} is not understood')
        elif isinstance(value, Literal):
            if 'object_property' in kinds and 'data_property' not in kinds:
                raise self._fail(
                    subject,
                    f'object property {local_name(predicate)} of {local_name(subject)}'
                    f' has the literal {value.lexical!r}, expected an individual',
                )
            self._add(ax.DataPropertyAssertion(predicate, subject, value))
        elif 'data_property' in kinds and 'object_property' not in kinds:
            raise self._fail(
                subject,
                f'data property {local_name(predicate)} of {local_name(subject)}'
                f' has the resource {value}, expected a literal',
            )
        else:
            self._add(ax.ObjectPropertyAssertion(predicate, subject, value))

    def _imports(self, subject: str, value: str) -> None:
        self._add(ax.Import(value))

    def _sub_class(self, subject: str, value: str) -> None:
        self._add(ax.SubClassOf(self.expression(subject), self.expression(value)))

    def _equivalent_class(self, subject: str, value: str) -> None:
        if self._is_data_range(subject):
            self._add(ax.DatatypeDefinition(subject, self.data_range(value)))
        else:
            self._add(ax.EquivalentClasses((self.expression(subject), self.expression(value))))

    def _disjoint_classes(self, subject: str, value: str) -> None:
        self._add(ax.DisjointClasses((self.expression(subject), self.expression(value))))

    def _disjoint_union(self, subject: str, value: str) -> None:
        self._add(ax.DisjointUnion(subject, tuple(map(self.expression, self._list(value)))))

    def _defined(self, subject: str, predicate: str, value: str) -> None:
        """Read a named class that carries the expression itself (OWL 1 style): an equivalence."""
        if subject.startswith('_:'):
            return
        operands = [value] if predicate == OWL + 'complementOf' else self._list(value)
        if predicate == OWL + 'complementOf':
            other: ex.ClassExpression = ex.ObjectComplementOf(self.expression(operands[0]))
        elif predicate == OWL + 'oneOf':
            if self._is_data_range(subject):
                values = ex.DataOneOf(self._literals(subject, operands))
                self._add(ax.DatatypeDefinition(subject, values))
                return
            other = ex.ObjectOneOf(tuple(self._resources(value)))
        elif predicate == OWL + 'unionOf':
            other = ex.ObjectUnionOf(tuple(map(self.expression, operands)))
        else:
            other = ex.ObjectIntersectionOf(tuple(map(self.expression, operands)))
        self._add(ax.EquivalentClasses((subject, other)))

    def _sub_property(self, subject: str, value: str) -> None:
        if self._is_data(subject) or self._is_data(value):
            self._add(ax.SubDataPropertyOf(subject, value))
        elif self._is_annotation(subject):
            self._add(ax.AnnotationAssertion(RDFS + 'subPropertyOf', subject, value))
        else:
            self._add(ax.SubObjectPropertyOf(self._property(subject), self._property(value)))

    def _chain(self, subject: str, value: str) -> None:
        chain = tuple(self._property(item) for item in self._resources(value))
        self._add(ax.SubPropertyChainOf(chain, self._property(subject)))

    def _equivalent_property(self, subject: str, value: str) -> None:
        if self._is_data(subject) or self._is_data(value):
            self._add(ax.EquivalentDataProperties((subject, value)))
        else:
            pair = (self._property(subject), self._property(value))
            self._add(ax.EquivalentObjectProperties(pair))

    def _disjoint_property(self, subject: str, value: str) -> None:
        if self._is_data(subject) or self._is_data(value):
            self._add(ax.DisjointDataProperties((subject, value)))
        else:
            pair = (self._property(subject), self._property(value))
            self._add(ax.DisjointObjectProperties(pair))

    def _inverse(self, subject: str, value: str) -> None:
        if not subject.startswith('_:'):
            self._add(ax.InverseObjectProperties(subject, self._property(value)))

    def _domain(self, subject: str, value: str) -> None:
        if self._is_data(subject):
            self._add(ax.DataPropertyDomain(subject, self.expression(value)))
        elif self._is_annotation(subject):
            self._add(ax.AnnotationAssertion(RDFS + 'domain', subject, value))
        else:
            self._add(ax.ObjectPropertyDomain(self._property(subject), self.expression(value)))

    def _range(self, subject: str, value: str) -> None:
        if self._is_annotation(subject):
            self._add(ax.AnnotationAssertion(RDFS + 'range', subject, value))
        elif self._is_data(subject, value):
            self._add(ax.DataPropertyRange(subject, self.data_range(value)))
        else:
            self._add(ax.ObjectPropertyRange(self._property(subject), self.expression(value)))

    def _is_annotation(self, prop: str) -> bool:
        return self._kinds.get(prop) == {'annotation_property'}

    def _same(self, subject: str, value: str) -> None:
        if not self._used:
            self._used = {name for properties in self._nodes.values() for name in properties}
        for name in (subject, value):
            if name in self._used:
                self._report(subject, f'owl:sameAs says nothing of {local_name(name)} as property')
        self._add(ax.SameIndividual(frozenset((subject, value))))

    def _different(self, subject: str, value: str) -> None:
        self._add(ax.DifferentIndividuals(frozenset((subject, value))))

    def _key(self, subject: str, value: str) -> None:
        props = self._resources(value)
        data = tuple(prop for prop in props if self._is_data(prop))
        objects = tuple(self._property(prop) for prop in props if not self._is_data(prop))
        self._add(ax.HasKey(self.expression(subject), objects, data))

    # --- nodes with a shape of their own ---

    def _all_different(self, node: str, properties: dict[str, list[Node]]) -> None:
        for predicate in (OWL + 'members', OWL + 'distinctMembers'):
            for head in properties.get(predicate, ()):
                members = frozenset(self._resources(head))
                if len(members) > 1:
                    self._add(ax.DifferentIndividuals(members))
        self._note(tuple(self._added), node, properties)

    def _all_disjoint_classes(self, node: str, properties: dict[str, list[Node]]) -> None:
        for head in properties.get(OWL + 'members', ()):
            self._add(ax.DisjointClasses(tuple(map(self.expression, self._list(head)))))
        self._note(tuple(self._added), node, properties)

    def _all_disjoint_properties(self, node: str, properties: dict[str, list[Node]]) -> None:
        for head in properties.get(OWL + 'members', ()):
            props = self._resources(head)
            if any(self._is_data(prop) for prop in props):
                self._add(ax.DisjointDataProperties(tuple(props)))
            else:
                self._add(ax.DisjointObjectProperties(tuple(map(self._property, props))))
        self._note(tuple(self._added), node, properties)

    def _negative(self, node: str, properties: dict[str, list[Node]]) -> None:
        source = self._resource(node, OWL + 'sourceIndividual')
        prop = self._resource(node, OWL + 'assertionProperty')
        value = self._one(node, OWL + 'targetValue')
        if isinstance(value, Literal):
            self._add(ax.NegativeDataPropertyAssertion(prop, source, value))
        else:
            target = self._resource(node, OWL + 'targetIndividual')
            expression = self._property(prop)
            if isinstance(expression, ex.ObjectInverseOf):
                source, target, prop = target, source, expression.prop
            self._add(ax.NegativeObjectPropertyAssertion(prop, source, target))
        self._note(tuple(self._added), node, properties)

    def _annotated(self, node: str, properties: dict[str, list[Node]]) -> None:
        source, predicate, target = (
            self._one(node, OWL + name)
            for name in ('annotatedSource', 'annotatedProperty', 'annotatedTarget')
        )
        if not isinstance(source, str) or not isinstance(predicate, str) or target is None:
            self._report(node, 'an annotation names no axiom')
            return
        found: list[Axiom] = []
        self._added = found
        if predicate == _TYPE and isinstance(target, str):
            self._type(source, target)
        else:
            self._triple(source, predicate, target)
        self._note(found[-1:], node, properties)

    def _note(self, axioms: Sequence[Axiom], node: str, properties: dict[str, list[Node]]) -> None:
        """Keep what a node says besides the axioms that it stands for."""
        notes = tuple(
            (predicate, value)
            for predicate, values in properties.items()
            if predicate != _TYPE and predicate not in _STRUCTURE
            for value in values
        )
        if not notes:
            return
        if not axioms or any(isinstance(value, str) and value[:2] == '_:' for _, value in notes):
            self._report(node, 'an annotation on an axiom is not kept')
            return
        for axiom in axioms:
            self._add(ax.AxiomAnnotation(axiom, notes))

    def _annotated_annotation(self, node: str, properties: dict[str, list[Node]]) -> None:
        self._report(node, 'an annotation on an annotation is not kept')

    def _rule(self, node: str, properties: dict[str, list[Node]]) -> None:
        body = tuple(
            map(self._atom, self._resources(self._one(node, SWRL + 'body') or RDF + 'nil'))
        )
        head = tuple(
            map(self._atom, self._resources(self._one(node, SWRL + 'head') or RDF + 'nil'))
        )
        annotations = tuple(
            (predicate, value)
            for predicate, values in properties.items()
            if predicate not in (_TYPE, SWRL + 'body', SWRL + 'head')
            for value in values
        )
        self._add(ax.Rule(body, head, annotations))

    def _argument(self, value: Node | None, atom: str) -> str | ex.Variable | Literal:
        if value is None:
            raise self._fail(atom, 'a rule atom lacks an argument')
        if isinstance(value, str) and value in self._variables:
            return ex.Variable(value)
        return value

    def _atom(self, node: str) -> ex.Atom:
        kind = self._one(node, _TYPE)
        first = self._one(node, SWRL + 'argument1')
        second = self._one(node, SWRL + 'argument2')
        if kind == SWRL + 'BuiltinAtom':
            head = self._one(node, SWRL + 'arguments') or RDF + 'nil'
            arguments = tuple(self._argument(item, node) for item in self._list(head))
            return ex.BuiltinAtom(self._resource(node, SWRL + 'builtin'), arguments)  # type: ignore[arg-type]
        one = self._argument(first, node)
        if kind == SWRL + 'ClassAtom':
            cls = self.expression(self._resource(node, SWRL + 'classPredicate'))
            return ex.ClassAtom(cls, one)  # type: ignore[arg-type]
        if kind == SWRL + 'DataRangeAtom':
            return ex.DataRangeAtom(self.data_range(self._resource(node, SWRL + 'dataRange')), one)  # type: ignore[arg-type]
        two = self._argument(second, node)
        if kind == SWRL + 'IndividualPropertyAtom':
            prop = self._property(self._resource(node, SWRL + 'propertyPredicate'))
            return ex.ObjectPropertyAtom(prop, one, two)  # type: ignore[arg-type]
        if kind == SWRL + 'DatavaluedPropertyAtom':
            name = self._resource(node, SWRL + 'propertyPredicate')
            return ex.DataPropertyAtom(name, one, two)  # type: ignore[arg-type]
        if kind == SWRL + 'SameIndividualAtom':
            return ex.SameIndividualAtom(one, two)  # type: ignore[arg-type]
        if kind == SWRL + 'DifferentIndividualsAtom':
            return ex.DifferentIndividualsAtom(one, two)  # type: ignore[arg-type]
        raise self._fail(node, f'rule atom of type {kind} is not understood')


_PREDICATES: dict[str, Callable[[Mapping, str, str], None]] = {
    OWL + 'imports': Mapping._imports,
    RDFS + 'subClassOf': Mapping._sub_class,
    OWL + 'equivalentClass': Mapping._equivalent_class,
    OWL + 'disjointWith': Mapping._disjoint_classes,
    OWL + 'disjointUnionOf': Mapping._disjoint_union,
    RDFS + 'subPropertyOf': Mapping._sub_property,
    OWL + 'propertyChainAxiom': Mapping._chain,
    OWL + 'equivalentProperty': Mapping._equivalent_property,
    OWL + 'propertyDisjointWith': Mapping._disjoint_property,
    OWL + 'inverseOf': Mapping._inverse,
    RDFS + 'domain': Mapping._domain,
    RDFS + 'range': Mapping._range,
    OWL + 'sameAs': Mapping._same,
    OWL + 'differentFrom': Mapping._different,
    OWL + 'hasKey': Mapping._key,
    OWL + 'datatypeComplementOf': lambda *_: None,
}
for _name in ('intersectionOf', 'unionOf', 'complementOf', 'oneOf'):
    _PREDICATES[OWL + _name] = lambda mapping, subject, value, predicate=OWL + _name: (  # type: ignore[misc]
        mapping._defined(subject, predicate, value)
    )

_SPECIAL: dict[str, Callable[[Mapping, str, dict[str, list[Node]]], None]] = {
    OWL + 'AllDifferent': Mapping._all_different,
    OWL + 'AllDisjointClasses': Mapping._all_disjoint_classes,
    OWL + 'AllDisjointProperties': Mapping._all_disjoint_properties,
    OWL + 'NegativePropertyAssertion': Mapping._negative,
    OWL + 'Axiom': Mapping._annotated,
    OWL + 'Annotation': Mapping._annotated_annotation,
    SWRL + 'Imp': Mapping._rule,
}
