"""OWL axioms and SWRL rules to RDF triples (https://www.w3.org/TR/owl2-mapping-to-rdf/)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import count

from surveillance_ontology.documents.rdf_xml import Node, Triple
from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.entities import entities_of
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import OWL, RDF, RDFS, SWRL, THING, TOP_LITERAL, XSD

_TYPE = RDF + 'type'
_KIND_TYPES = {
    'class': OWL + 'Class',
    'object_property': OWL + 'ObjectProperty',
    'data_property': OWL + 'DatatypeProperty',
    'annotation_property': OWL + 'AnnotationProperty',
    'individual': OWL + 'NamedIndividual',
    'datatype': RDFS + 'Datatype',
}
_GROUPS = {
    OWL + name
    for name in (
        'AllDifferent',
        'AllDisjointClasses',
        'AllDisjointProperties',
        'NegativePropertyAssertion',
    )
}
"""Types of the nodes that stand for one axiom."""
_CARDINALITIES = {
    'MinCardinality': ('minCardinality', 'minQualifiedCardinality'),
    'MaxCardinality': ('maxCardinality', 'maxQualifiedCardinality'),
    'ExactCardinality': ('cardinality', 'qualifiedCardinality'),
}


class _Mapping:
    def __init__(self, iri: str) -> None:
        self.iri = iri
        self.triples: list[Triple] = []
        self._numbers = count(1)
        self._variables: dict[str, None] = {}

    def blank(self, *types: str) -> str:
        node = f'_:w{next(self._numbers)}'
        for name in types:
            self.add(node, _TYPE, name)
        return node

    def add(self, subject: str, predicate: str, value: Node) -> None:
        self.triples.append((subject, predicate, value))

    def sequence(self, items: Sequence[Node], kind: str = '') -> str:
        head = RDF + 'nil'
        for item in reversed(items):
            cell = self.blank(*([kind] if kind else []))
            self.add(cell, RDF + 'first', item)
            self.add(cell, RDF + 'rest', head)
            head = cell
        return head

    # --- parts ---

    def prop(self, prop: ex.PropertyExpression) -> str:
        if isinstance(prop, str):
            return prop
        node = self.blank()
        self.add(node, OWL + 'inverseOf', prop.prop)
        return node

    def data_range(self, data_range: ex.DataRange) -> str:
        if isinstance(data_range, str):
            return data_range
        node = self.blank(RDFS + 'Datatype')
        if isinstance(data_range, ex.DataOneOf):
            self.add(node, OWL + 'oneOf', self.sequence(data_range.literals))
        elif isinstance(data_range, ex.DataComplementOf):
            self.add(node, OWL + 'datatypeComplementOf', self.data_range(data_range.operand))
        elif isinstance(data_range, ex.DatatypeRestriction):
            self.add(node, OWL + 'onDatatype', data_range.datatype)
            facets = []
            for name, bound in data_range.facets:
                facet = self.blank()
                self.add(facet, name, bound)
                facets.append(facet)
            self.add(node, OWL + 'withRestrictions', self.sequence(facets))
        else:
            union = isinstance(data_range, ex.DataUnionOf)
            operands = [self.data_range(operand) for operand in data_range.operands]
            self.add(
                node, OWL + ('unionOf' if union else 'intersectionOf'), self.sequence(operands)
            )
        return node

    def cls(self, expression: ex.ClassExpression) -> str:
        if isinstance(expression, str):
            return expression
        if isinstance(expression, (ex.ObjectIntersectionOf, ex.ObjectUnionOf)):
            union = isinstance(expression, ex.ObjectUnionOf)
            operands = [self.cls(operand) for operand in expression.operands]
            node = self.blank(OWL + 'Class')
            self.add(
                node, OWL + ('unionOf' if union else 'intersectionOf'), self.sequence(operands)
            )
            return node
        if isinstance(expression, ex.ObjectComplementOf):
            node = self.blank(OWL + 'Class')
            self.add(node, OWL + 'complementOf', self.cls(expression.operand))
            return node
        if isinstance(expression, ex.ObjectOneOf):
            node = self.blank(OWL + 'Class')
            self.add(node, OWL + 'oneOf', self.sequence(expression.individuals))
            return node
        node = self.blank(OWL + 'Restriction')
        self.add(node, OWL + 'onProperty', self.prop(expression.prop))
        if isinstance(expression, ex.ObjectHasValue):
            self.add(node, OWL + 'hasValue', expression.individual)
        elif isinstance(expression, ex.DataHasValue):
            self.add(node, OWL + 'hasValue', expression.literal)
        elif isinstance(expression, ex.ObjectHasSelf):
            self.add(node, OWL + 'hasSelf', Literal('true', XSD + 'boolean'))
        elif isinstance(expression, ex.ObjectSomeValuesFrom):
            self.add(node, OWL + 'someValuesFrom', self.cls(expression.filler))
        elif isinstance(expression, ex.ObjectAllValuesFrom):
            self.add(node, OWL + 'allValuesFrom', self.cls(expression.filler))
        elif isinstance(expression, ex.DataSomeValuesFrom):
            self.add(node, OWL + 'someValuesFrom', self.data_range(expression.range))
        elif isinstance(expression, ex.DataAllValuesFrom):
            self.add(node, OWL + 'allValuesFrom', self.data_range(expression.range))
        else:
            self.cardinality(node, expression)
        return node

    def cardinality(
        self,
        node: str,
        expression: ex.ObjectMinCardinality
        | ex.ObjectMaxCardinality
        | ex.ObjectExactCardinality
        | ex.DataMinCardinality
        | ex.DataMaxCardinality
        | ex.DataExactCardinality,
    ) -> None:
        name = type(expression).__name__
        number = Literal(str(expression.n), XSD + 'nonNegativeInteger')
        plain, qualified = _CARDINALITIES[name.removeprefix('Object').removeprefix('Data')]
        if isinstance(
            expression,
            (ex.ObjectMinCardinality, ex.ObjectMaxCardinality, ex.ObjectExactCardinality),
        ):
            unqualified = expression.filler == THING
            filler, on = expression.filler, OWL + 'onClass'
            named = '' if unqualified else self.cls(filler)
        else:
            unqualified = expression.range == TOP_LITERAL
            on = OWL + 'onDataRange'
            named = self.data_range(expression.range)
        self.add(node, OWL + (plain if unqualified and on.endswith('Class') else qualified), number)
        if not (unqualified and on.endswith('Class')):
            self.add(node, on, named)

    # --- axioms ---

    def axiom(self, axiom: Axiom) -> None:
        add, cls, prop = self.add, self.cls, self.prop
        if isinstance(axiom, ax.Declaration):
            add(axiom.iri, _TYPE, _KIND_TYPES[axiom.kind])
        elif isinstance(axiom, ax.Import):
            add(self.iri, OWL + 'imports', axiom.iri)
        elif isinstance(axiom, ax.AnnotationAssertion):
            add(axiom.subject, axiom.prop, axiom.value)
        elif isinstance(axiom, ax.ClassAssertion):
            add(axiom.individual, _TYPE, cls(axiom.cls))
        elif isinstance(axiom, ax.ObjectPropertyAssertion):
            add(axiom.subject, axiom.prop, axiom.object)
        elif isinstance(axiom, ax.DataPropertyAssertion):
            add(axiom.subject, axiom.prop, axiom.literal)
        elif isinstance(axiom, ax.SubClassOf):
            add(cls(axiom.sub), RDFS + 'subClassOf', cls(axiom.sup))
        elif isinstance(axiom, ax.EquivalentClasses):
            classes = sorted(axiom.classes, key=lambda part: not isinstance(part, str))
            first, *others = [cls(part) for part in classes]
            for other in others:
                add(first, OWL + 'equivalentClass', other)
        elif isinstance(axiom, (ax.SameIndividual, ax.DifferentIndividuals)):
            self.individuals(axiom)
        elif isinstance(axiom, ax.Rule):
            self.rule(axiom)
        elif isinstance(
            axiom, (ax.NegativeObjectPropertyAssertion, ax.NegativeDataPropertyAssertion)
        ):
            node = self.blank(OWL + 'NegativePropertyAssertion')
            add(node, OWL + 'sourceIndividual', axiom.subject)
            add(node, OWL + 'assertionProperty', axiom.prop)
            if isinstance(axiom, ax.NegativeObjectPropertyAssertion):
                add(node, OWL + 'targetIndividual', axiom.object)
            else:
                add(node, OWL + 'targetValue', axiom.literal)
        elif isinstance(axiom, ax.DisjointClasses):
            self.disjoint(
                [cls(part) for part in axiom.classes], 'disjointWith', 'AllDisjointClasses'
            )
        elif isinstance(axiom, ax.DisjointObjectProperties):
            nodes = [prop(part) for part in axiom.props]
            self.disjoint(nodes, 'propertyDisjointWith', 'AllDisjointProperties')
        elif isinstance(axiom, ax.DisjointDataProperties):
            self.disjoint(list(axiom.props), 'propertyDisjointWith', 'AllDisjointProperties')
        elif isinstance(axiom, ax.DisjointUnion):
            parts = self.sequence([cls(part) for part in axiom.classes])
            add(axiom.cls, OWL + 'disjointUnionOf', parts)
        elif isinstance(axiom, ax.DatatypeDefinition):
            add(axiom.datatype, OWL + 'equivalentClass', self.data_range(axiom.range))
        elif isinstance(axiom, ax.HasKey):
            keys = [*map(prop, axiom.object_props), *axiom.data_props]
            add(cls(axiom.cls), OWL + 'hasKey', self.sequence(keys))
        else:
            self.property_axiom(axiom)

    def property_axiom(self, axiom: Axiom) -> None:
        add, prop = self.add, self.prop
        if isinstance(axiom, (ax.SubObjectPropertyOf, ax.SubDataPropertyOf)):
            add(prop(axiom.sub), RDFS + 'subPropertyOf', prop(axiom.sup))
        elif isinstance(axiom, ax.SubPropertyChainOf):
            chain = self.sequence([prop(part) for part in axiom.chain])
            add(prop(axiom.sup), OWL + 'propertyChainAxiom', chain)
        elif isinstance(axiom, (ax.EquivalentObjectProperties, ax.EquivalentDataProperties)):
            first, *others = [prop(part) for part in axiom.props]
            for other in others:
                add(first, OWL + 'equivalentProperty', other)
        elif isinstance(axiom, ax.InverseObjectProperties):
            add(prop(axiom.first), OWL + 'inverseOf', prop(axiom.second))
        elif isinstance(axiom, ax.ObjectPropertyDomain):
            add(prop(axiom.prop), RDFS + 'domain', self.cls(axiom.domain))
        elif isinstance(axiom, ax.DataPropertyDomain):
            add(axiom.prop, RDFS + 'domain', self.cls(axiom.domain))
        elif isinstance(axiom, ax.ObjectPropertyRange):
            add(prop(axiom.prop), RDFS + 'range', self.cls(axiom.range))
        elif isinstance(axiom, ax.DataPropertyRange):
            add(axiom.prop, RDFS + 'range', self.data_range(axiom.range))
        else:
            name = type(axiom).__name__.replace('Object', '').replace('Data', '')
            add(prop(axiom.prop), _TYPE, OWL + name)  # type: ignore[attr-defined]

    def individuals(self, axiom: ax.SameIndividual | ax.DifferentIndividuals) -> None:
        names = sorted(axiom.individuals)
        if isinstance(axiom, ax.SameIndividual):
            for other in names[1:]:
                self.add(names[0], OWL + 'sameAs', other)
        elif len(names) == 2:
            self.add(names[0], OWL + 'differentFrom', names[1])
        else:
            node = self.blank(OWL + 'AllDifferent')
            self.add(node, OWL + 'members', self.sequence(names))

    def disjoint(self, nodes: list[str], pair: str, group: str) -> None:
        if len(nodes) == 2:
            self.add(nodes[0], OWL + pair, nodes[1])
        else:
            self.add(self.blank(OWL + group), OWL + 'members', self.sequence(nodes))

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

    # --- rules ---

    def variable(self, variable: ex.Variable) -> str:
        name = variable.name if ':' in variable.name else f'urn:swrl:var#{variable.name}'
        if name not in self._variables:
            self._variables[name] = None
            self.add(name, _TYPE, SWRL + 'Variable')
        return name

    def argument(self, argument: str | ex.Variable | Literal) -> Node:
        return self.variable(argument) if isinstance(argument, ex.Variable) else argument

    def atom(self, atom: ex.Atom) -> str:
        add = self.add
        if isinstance(atom, ex.BuiltinAtom):
            node = self.blank(SWRL + 'BuiltinAtom')
            add(node, SWRL + 'builtin', atom.builtin)
            arguments = [self.argument(argument) for argument in atom.arguments]
            add(node, SWRL + 'arguments', self.sequence(arguments))
            return node
        if isinstance(atom, ex.ClassAtom):
            node = self.blank(SWRL + 'ClassAtom')
            add(node, SWRL + 'classPredicate', self.cls(atom.cls))
            add(node, SWRL + 'argument1', self.argument(atom.argument))
            return node
        if isinstance(atom, ex.DataRangeAtom):
            node = self.blank(SWRL + 'DataRangeAtom')
            add(node, SWRL + 'dataRange', self.data_range(atom.range))
            add(node, SWRL + 'argument1', self.argument(atom.argument))
            return node
        if isinstance(atom, ex.ObjectPropertyAtom):
            node = self.blank(SWRL + 'IndividualPropertyAtom')
            add(node, SWRL + 'propertyPredicate', self.prop(atom.prop))
        elif isinstance(atom, ex.DataPropertyAtom):
            node = self.blank(SWRL + 'DatavaluedPropertyAtom')
            add(node, SWRL + 'propertyPredicate', atom.prop)
        else:
            node = self.blank(SWRL + type(atom).__name__)
        add(node, SWRL + 'argument1', self.argument(atom.first))
        add(node, SWRL + 'argument2', self.argument(atom.second))
        return node

    def rule(self, rule: ax.Rule) -> None:
        node = self.blank(SWRL + 'Imp')
        for predicate, value in rule.annotations:
            self.add(node, predicate, value)
        for predicate, atoms in ((SWRL + 'body', rule.body), (SWRL + 'head', rule.head)):
            nodes = [self.atom(atom) for atom in atoms]
            self.add(node, predicate, self.sequence(nodes, SWRL + 'AtomList'))


def triples_of(axioms: Iterable[Axiom], iri: str) -> Iterator[Triple]:
    """Return the triples of an ontology, its header first.

    Classes, properties and datatypes that are used but not declared are declared: without, a reader
    could not tell an object property from a data property.
    """
    mapping = _Mapping(iri)
    mapping.add(iri, _TYPE, OWL + 'Ontology')
    declared: set[tuple[str, str]] = set()
    used: dict[tuple[str, str], None] = {}
    axioms = tuple(dict.fromkeys(axioms))
    notes: dict[Axiom, list[ax.AxiomAnnotation]] = {}
    for axiom in axioms:
        if isinstance(axiom, ax.AxiomAnnotation):
            notes.setdefault(axiom.axiom, []).append(axiom)
    for axiom in axioms:
        if axiom in notes:
            mapping.annotated(axiom, notes[axiom])
        elif isinstance(axiom, ax.AxiomAnnotation):
            used.update((('annotation_property', prop), None) for prop, _ in axiom.annotations)
        else:
            mapping.axiom(axiom)
        if isinstance(axiom, ax.Declaration):
            declared.add((axiom.kind, axiom.iri))
        elif not isinstance(axiom, (ax.SameIndividual, ax.DifferentIndividuals)):
            for kind, name in entities_of(axiom):
                if kind not in ('individual', 'annotated'):
                    used[kind, name] = None
    for kind, name in used:
        if (kind, name) not in declared and not name.startswith((OWL, RDF, RDFS, XSD)):
            mapping.add(name, _TYPE, _KIND_TYPES[kind])
    return iter(mapping.triples)
