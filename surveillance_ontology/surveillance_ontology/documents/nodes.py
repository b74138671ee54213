"""The nodes of an RDF graph as what they stand for: lists, class expressions, data ranges."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from surveillance_ontology.documents.rdf_xml import Graph, Node
from surveillance_ontology.documents.xml_reading import OntologyFileError
from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex
from surveillance_ontology.owl.axioms import Axiom
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import OWL, RDF, RDFS, SWRL, XSD, local_name

_TYPE = RDF + 'type'
DECLARATIONS = {
    OWL + 'Class': 'class',
    RDFS + 'Class': 'class',
    OWL + 'ObjectProperty': 'object_property',
    OWL + 'DatatypeProperty': 'data_property',
    OWL + 'AnnotationProperty': 'annotation_property',
    OWL + 'OntologyProperty': 'annotation_property',
    OWL + 'NamedIndividual': 'individual',
    RDFS + 'Datatype': 'datatype',
    OWL + 'DataRange': 'datatype',
}
CHARACTERISTICS: dict[str, Callable[[ex.PropertyExpression], Axiom]] = {
    OWL + 'InverseFunctionalProperty': ax.InverseFunctionalObjectProperty,
    OWL + 'ReflexiveProperty': ax.ReflexiveObjectProperty,
    OWL + 'IrreflexiveProperty': ax.IrreflexiveObjectProperty,
    OWL + 'SymmetricProperty': ax.SymmetricObjectProperty,
    OWL + 'AsymmetricProperty': ax.AsymmetricObjectProperty,
    OWL + 'TransitiveProperty': ax.TransitiveObjectProperty,
}
ANNOTATIONS = {
    *(RDFS + name for name in ('label', 'comment', 'seeAlso', 'isDefinedBy')),
    *(OWL + name for name in ('versionInfo', 'versionIRI', 'deprecated', 'priorVersion')),
    *(OWL + name for name in ('backwardCompatibleWith', 'incompatibleWith')),
}
CARDINALITIES = (
    ('minCardinality', 'minQualifiedCardinality', ex.ObjectMinCardinality, ex.DataMinCardinality),
    ('maxCardinality', 'maxQualifiedCardinality', ex.ObjectMaxCardinality, ex.DataMaxCardinality),
    ('cardinality', 'qualifiedCardinality', ex.ObjectExactCardinality, ex.DataExactCardinality),
)
_CONSTRUCTORS = ('intersectionOf', 'unionOf', 'complementOf', 'oneOf', 'onProperty')
_RESTRICTIONS = (
    *('someValuesFrom', 'allValuesFrom', 'hasValue', 'hasSelf'),
    *(name for row in CARDINALITIES for name in row[:2]),
)
BUILT_IN = (OWL, RDF, RDFS, XSD, SWRL)


class IllFormedError(OntologyFileError):
    """A class expression or data range that says nothing: its axiom is left out, and reported."""


class NodeReader:
    """Indexes a graph by subject; reads lists, property and class expressions, data ranges."""

    def __init__(self, graph: Graph) -> None:
        self.unsupported: list[str] = []
        self.iri = ''
        self._places = graph.places
        self._subject_read = ''
        self._nodes: dict[str, dict[str, list[Node]]] = {}
        self._kinds: dict[str, set[str]] = {}
        self._expressions: dict[str, ex.ClassExpression] = {}
        self._open: set[str] = set()
        self._variables: set[str] = set()
        for subject, predicate, value in graph.triples:
            self._nodes.setdefault(subject, {}).setdefault(predicate, []).append(value)
            if predicate == _TYPE and isinstance(value, str):
                kind = DECLARATIONS.get(value)
                if kind is not None:
                    self._kinds.setdefault(subject, set()).add(kind)
                elif value == OWL + 'Ontology' and not self.iri:
                    self.iri = subject
                elif value in CHARACTERISTICS:
                    self._kinds.setdefault(subject, set()).add('object_property')
                elif value == SWRL + 'Variable':
                    self._variables.add(subject)
        self._guess_kinds()

    def _guess_kinds(self) -> None:
        """Undeclared properties with a datatype as range, or a literal as value, are data
        properties.
        """
        guessed: set[str] = set()
        for subject, properties in self._nodes.items():
            for predicate, values in properties.items():
                if predicate == RDFS + 'range':
                    if any(isinstance(v, str) and self._is_data_range(v) for v in values):
                        guessed.add(subject)
                elif any(isinstance(value, Literal) for value in values):
                    guessed.add(predicate)
        for name in guessed - ANNOTATIONS:
            if not name.startswith(BUILT_IN):
                self._kinds.setdefault(name, {'data_property'})

    # --- reporting ---

    def _where(self, node: str) -> str:
        place = self._places.get(node)
        return f'line {place[0]}: ' if place else ''

    def _report(self, node: str, what: str) -> None:
        self.unsupported.append(self._where(node) + what)

    def _fail(self, node: str, message: str) -> OntologyFileError:
        place = self._places.get(node) or self._places.get(self._subject_read, (0, 0))
        return OntologyFileError(message, *place)

    def _ill_formed(self, node: str, message: str) -> IllFormedError:
        self._open.clear()
        return IllFormedError(message, *self._places.get(node, (0, 0)))

    # --- reading parts ---

    def _one(self, node: str, predicate: str) -> Node | None:
        values = self._nodes.get(node, {}).get(predicate)
        return values[0] if values else None

    def _resource(self, node: str, predicate: str) -> str:
        value = self._one(node, predicate)
        if not isinstance(value, str):
            raise self._fail(node, f'expected a resource as {local_name(predicate)}, got {value!r}')
        return value

    def _list(self, head: Node) -> list[Node]:
        items: list[Node] = []
        seen: set[str] = set()
        node = head
        while node != RDF + 'nil':
            if not isinstance(node, str) or node in seen:
                raise self._fail(str(head), 'expected a list that ends in rdf:nil')
            seen.add(node)
            properties = self._nodes.get(node, {})
            firsts = set(properties.get(RDF + 'first', ()))
            rests = set(properties.get(RDF + 'rest', ()))
            if len(firsts) != 1 or len(rests) != 1:
                raise self._fail(node, 'expected one rdf:first and one rdf:rest in a list')
            items.append(firsts.pop())
            node = rests.pop()
        return items

    def _resources(self, head: Node) -> list[str]:
        items = self._list(head)
        for item in items:
            if not isinstance(item, str):
                raise self._fail(
                    str(head), f'expected resources in a list, got the literal {item.lexical!r}'
                )
        return items  # type: ignore[return-value]

    def _property(self, node: str) -> ex.PropertyExpression:
        inverse = self._one(node, OWL + 'inverseOf') if node.startswith('_:') else None
        if not isinstance(inverse, str):
            return node
        inner = self._property(inverse)
        return inner.prop if isinstance(inner, ex.ObjectInverseOf) else ex.ObjectInverseOf(inner)

    def _is_data(self, prop: str, range_node: Node | None = None) -> bool:
        kinds = self._kinds.get(prop, ())
        if 'object_property' in kinds:
            return False
        if 'data_property' in kinds:
            return True
        return isinstance(range_node, str) and self._is_data_range(range_node)

    def _is_data_range(self, node: str) -> bool:
        if 'datatype' in self._kinds.get(node, ()) or node == RDFS + 'Literal':
            return True
        return node.startswith(XSD)

    def _number(self, node: str, predicate: str) -> int | None:
        value = self._one(node, predicate)
        if value is None:
            return None
        try:
            number = int(value.lexical) if isinstance(value, Literal) else -1
        except ValueError:
            number = -1
        if number < 0:
            shown = value.lexical if isinstance(value, Literal) else value
            raise self._fail(
                node, f'expected a whole number as {local_name(predicate)}, got {shown[:40]!r}'
            )
        return number

    def data_range(self, node: Node) -> ex.DataRange:
        """Return the data range a node stands for."""
        if not isinstance(node, str):
            raise self._ill_formed(
                self._subject_read, f'expected a data range, got the literal {node.lexical!r}'
            )
        if not node.startswith('_:'):
            return node
        properties = self._nodes.get(node, {})
        if OWL + 'oneOf' in properties:
            items = self._list(properties[OWL + 'oneOf'][0])
            return ex.DataOneOf(self._literals(node, items))
        for predicate, record in (
            (OWL + 'intersectionOf', ex.DataIntersectionOf),
            (OWL + 'unionOf', ex.DataUnionOf),
        ):
            if predicate in properties:
                return record(tuple(map(self.data_range, self._list(properties[predicate][0]))))
        if OWL + 'datatypeComplementOf' in properties:
            return ex.DataComplementOf(self.data_range(properties[OWL + 'datatypeComplementOf'][0]))
        if OWL + 'onDatatype' in properties:
            facets = []
            for facet in self._resources(self._one(node, OWL + 'withRestrictions') or RDF + 'nil'):
                for name, values in self._nodes.get(facet, {}).items():
                    if name != _TYPE:
                        facets += [(name, value) for value in self._literals(node, values)]
            return ex.DatatypeRestriction(self._resource(node, OWL + 'onDatatype'), tuple(facets))
        raise self._ill_formed(node, 'expected a data range')

    def _literals(self, node: str, values: Iterable[Node]) -> tuple[Literal, ...]:
        """Return values of a data range, which must be literals."""
        found = []
        for value in values:
            if not isinstance(value, Literal):
                raise self._ill_formed(node, f'expected a literal in a data range, got {value}')
            found.append(value)
        return tuple(found)

    def _check_one(self, node: str, names: Iterable[str], what: str) -> None:
        """Check that a node has one of some properties at most, and one value of it."""
        properties = self._nodes.get(node, {})
        said = [name for name in names if OWL + name in properties]
        if len(said) > 1 or any(len(set(properties[OWL + name])) > 1 for name in said):
            several = ', '.join(said)
            raise self._ill_formed(node, f'{what} says several things at once: {several}')

    def expression(self, node: Node) -> ex.ClassExpression:
        """Return the class expression a node stands for."""
        if not isinstance(node, str):
            raise self._ill_formed(
                self._subject_read, f'expected a class, got the literal {node.lexical!r}'
            )
        if not node.startswith('_:'):
            return node
        known = self._expressions.get(node)
        if known is not None:
            return known
        if node in self._open:
            raise self._fail(node, 'a class expression contains itself')
        self._open.add(node)
        expression = self._expressions[node] = self._expression(node)
        self._open.discard(node)
        return expression

    def _expression(self, node: str) -> ex.ClassExpression:
        properties = self._nodes.get(node, {})
        self._check_one(node, _CONSTRUCTORS, 'a class expression')
        for predicate, record in (
            (OWL + 'intersectionOf', ex.ObjectIntersectionOf),
            (OWL + 'unionOf', ex.ObjectUnionOf),
        ):
            if predicate in properties:
                return record(tuple(map(self.expression, self._list(properties[predicate][0]))))
        if OWL + 'complementOf' in properties:
            return ex.ObjectComplementOf(self.expression(properties[OWL + 'complementOf'][0]))
        if OWL + 'oneOf' in properties:
            return ex.ObjectOneOf(tuple(self._resources(properties[OWL + 'oneOf'][0])))
        if OWL + 'onProperty' in properties:
            return self._restriction(node, properties)
        raise self._ill_formed(node, 'expected a class expression')

    def _restriction(self, node: str, properties: dict[str, list[Node]]) -> ex.ClassExpression:
        on = self._resource(node, OWL + 'onProperty')
        prop = self._property(on)
        self._check_one(node, _RESTRICTIONS, f'restriction on {local_name(on)}')
        filler = self._one(node, OWL + 'someValuesFrom') or self._one(node, OWL + 'allValuesFrom')
        if OWL + 'hasValue' in properties:
            value = properties[OWL + 'hasValue'][0]
            if isinstance(value, Literal):
                return ex.DataHasValue(on, value)
            return ex.ObjectHasValue(prop, value)
        if OWL + 'hasSelf' in properties:
            self_value = properties[OWL + 'hasSelf'][0]
            if isinstance(self_value, Literal) and self_value.lexical in ('true', '1'):
                return ex.ObjectHasSelf(prop)
            raise self._ill_formed(node, f'restriction on {local_name(on)}: hasSelf is not true')
        if filler is not None:
            some = OWL + 'someValuesFrom' in properties
            if self._is_data(on, filler):
                data = ex.DataSomeValuesFrom if some else ex.DataAllValuesFrom
                return data(on, self.data_range(filler))
            quantified = ex.ObjectSomeValuesFrom if some else ex.ObjectAllValuesFrom
            return quantified(prop, self.expression(filler))
        on_class = self._one(node, OWL + 'onClass')
        on_range = self._one(node, OWL + 'onDataRange')
        counts_values = on_range is not None or (on_class is None and self._is_data(on))
        for plain, qualified, of_objects, of_data in CARDINALITIES:
            number = self._number(node, OWL + plain)
            if number is None:
                number = self._number(node, OWL + qualified)
            if number is None:
                continue
            if counts_values:
                return of_data(number, on, self.data_range(on_range or RDFS + 'Literal'))
            return of_objects(number, prop, self.expression(on_class or OWL + 'Thing'))
        raise self._ill_formed(
            node, f'restriction on {local_name(on)} states nothing that is understood'
        )
