"""RDF triples to OWL axioms and SWRL rules.

Follows OWL 2 Mapping to RDF Graphs (https://www.w3.org/TR/owl2-mapping-to-rdf/), section 3, and the
SWRL submission's RDF syntax. What is not understood is reported with its line, never dropped in
silence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, TypeAlias, TypeVar

from owl_reasoner.documents.rdf_xml import Graph, Node, Triple
from owl_reasoner.documents.xml_reading import DEEPEST, IllFormedError
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import (
    BOTTOM,
    BOTTOM_DATA,
    NOTHING,
    OWL,
    RDF,
    RDFS,
    SWRL,
    THING,
    TOP,
    TOP_DATA,
    XSD,
    local_name,
)

_TYPE = RDF + 'type'
T = TypeVar('T')
_ReadNode: TypeAlias = 'Callable[[RdfMapper, str, dict[str, list[Node]]], None]'
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
    OWL + 'Datatype': 'datatype',
}
CHARACTERISTICS: dict[str, Callable[[ex.PropertyExpression], Axiom]] = {
    OWL + 'InverseFunctionalProperty': ax.InverseFunctionalObjectProperty,
    OWL + 'ReflexiveProperty': ax.ReflexiveObjectProperty,
    OWL + 'IrreflexiveProperty': ax.IrreflexiveObjectProperty,
    OWL + 'SymmetricProperty': ax.SymmetricObjectProperty,
    OWL + 'AsymmetricProperty': ax.AsymmetricObjectProperty,
    OWL + 'TransitiveProperty': ax.TransitiveObjectProperty,
}
_FUNCTIONAL = OWL + 'FunctionalProperty'
_CHAIN = OWL + 'propertyChain'
"""The chain below a property, of a node without a name: a draft of OWL 2 had it so."""
_WITH_AXIOMS = {THING, NOTHING, TOP, BOTTOM, TOP_DATA, BOTTOM_DATA}
"""What is OWL's own and may have axioms."""
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
_ONE, _TWO = (SWRL + 'argument1', 'first'), (SWRL + 'argument2', 'second')
_PROPERTY, _ARGUMENT = (SWRL + 'propertyPredicate', 'prop'), (SWRL + 'argument1', 'argument')
ATOMS: dict[str, tuple[Any, *tuple[tuple[str, str], ...]]] = {
    SWRL + 'ClassAtom': (ex.ClassAtom, (SWRL + 'classPredicate', 'cls'), _ARGUMENT),
    SWRL + 'DataRangeAtom': (ex.DataRangeAtom, (SWRL + 'dataRange', 'range'), _ARGUMENT),
    SWRL + 'IndividualPropertyAtom': (ex.ObjectPropertyAtom, _PROPERTY, _ONE, _TWO),
    SWRL + 'DatavaluedPropertyAtom': (ex.DataPropertyAtom, _PROPERTY, _ONE, _TWO),
    SWRL + 'SameIndividualAtom': (ex.SameIndividualAtom, _ONE, _TWO),
    SWRL + 'DifferentIndividualsAtom': (ex.DifferentIndividualsAtom, _ONE, _TWO),
    SWRL + 'BuiltinAtom': (
        ex.BuiltinAtom,
        (SWRL + 'builtin', 'builtin'),
        (SWRL + 'arguments', 'arguments'),
    ),
}
"""The atoms of rules: the node's type, the record, and each predicate with the field behind it."""
_CONSTRUCTORS = ('intersectionOf', 'unionOf', 'complementOf', 'oneOf', 'onProperty')
_CONSTRUCTED = tuple(OWL + name for name in _CONSTRUCTORS[:-1])
_RESTRICTIONS = (
    *('someValuesFrom', 'allValuesFrom', 'hasValue', 'hasSelf'),
    *(name for row in CARDINALITIES for name in row[:2]),
)
BUILT_IN = (OWL, RDF, RDFS, XSD, SWRL)
_VALUES: tuple[tuple[str, type, Callable[..., Axiom]], ...] = (
    ('object_property', str, ax.ObjectPropertyAssertion),
    ('data_property', Literal, ax.DataPropertyAssertion),
)
"""What a property of one kind takes, and what a statement with it is."""


_TRUE = Literal('true', XSD + 'boolean')
_MARKS = {
    *(OWL + name for name in ('Ontology', 'Restriction')),
    RDF + 'List',
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


class _Statements:
    """A graph's statements by subject, and what kind of entity each name is.

    Attributes:
        nodes: The values of each predicate of each subject.
        kinds: What each name is declared or guessed to be.
        header: The node of the ontology itself; '' without one.
        variables: Nodes that are variables of rules.
        subject_read: Whose statements are being read; its line is told where a node has none.
    """

    def __init__(self, graph: Graph) -> None:
        self.nodes: dict[str, dict[str, list[Node]]] = {}
        self.kinds: dict[str, set[str]] = {}
        self.header = ''
        self.variables: set[str] = set()
        self.subject_read = ''
        self._places = graph.places
        characterised: list[str] = []
        for subject, predicate, value in graph.triples:
            self.nodes.setdefault(subject, {}).setdefault(predicate, []).append(value)
            if predicate == _TYPE and isinstance(value, str):
                kind = DECLARATIONS.get(value)
                if kind is not None:
                    self.kinds.setdefault(subject, set()).add(kind)
                elif value == OWL + 'Ontology' and not self.header:
                    self.header = subject
                elif value in CHARACTERISTICS:
                    characterised.append(subject)
                elif value == SWRL + 'Variable':
                    self.variables.add(subject)
        for subject in characterised:
            kinds = self.kinds.setdefault(subject, set())
            if 'data_property' not in kinds:
                kinds.add('object_property')

    def where(self, node: str) -> str:
        """Return a node's line for the beginning of a message."""
        place = self._places.get(node)
        return f'line {place[0]}: ' if place else ''

    def ill_formed(self, node: str, message: str) -> IllFormedError:
        """Return the error that a node is not as it should be, at its line."""
        place = self._places.get(node) or self._places.get(self.subject_read, (0, 0))
        return IllFormedError(message, *place)

    def one(self, node: str, predicate: str) -> Node | None:
        """Return the first value of a predicate, if there is one."""
        values = self.nodes.get(node, {}).get(predicate)
        return values[0] if values else None

    def resource(self, node: str, predicate: str) -> str:
        value = self.one(node, predicate)
        if not isinstance(value, str):
            raise self.ill_formed(
                node, f'expected a resource as {local_name(predicate)}, got {value!r}'
            )
        return value

    def list_of(self, head: Node) -> list[Node]:
        """Return the items of an RDF list."""
        items: list[Node] = []
        seen: set[str] = set()
        node = head
        while node != RDF + 'nil':
            if not isinstance(node, str) or node in seen:
                raise self.ill_formed(str(head), 'expected a list that ends in rdf:nil')
            seen.add(node)
            properties = self.nodes.get(node, {})
            firsts = set(properties.get(RDF + 'first', ()))
            rests = set(properties.get(RDF + 'rest', ()))
            if len(firsts) != 1 or len(rests) != 1:
                raise self.ill_formed(node, 'expected one rdf:first and one rdf:rest in a list')
            items.append(firsts.pop())
            node = rests.pop()
        return items

    def resources(self, head: Node) -> list[str]:
        items = self.list_of(head)
        for item in items:
            if not isinstance(item, str):
                raise self.ill_formed(
                    str(head), f'expected resources in a list, got the literal {item.lexical!r}'
                )
        return items  # type: ignore[return-value]

    def number(self, node: str, predicate: str) -> int | None:
        value = self.one(node, predicate)
        if value is None:
            return None
        try:
            number = int(value.lexical) if isinstance(value, Literal) else -1
        except ValueError:
            number = -1
        if number < 0:
            shown = value.lexical if isinstance(value, Literal) else value
            raise self.ill_formed(
                node, f'expected a whole number as {local_name(predicate)}, got {shown[:40]!r}'
            )
        return number

    def check_one(self, node: str, names: Iterable[str], what: str) -> None:
        """Check that a node has one of some properties at most, and one value of it."""
        properties = self.nodes.get(node, {})
        said = [name for name in names if OWL + name in properties]
        if len(said) > 1 or any(len(set(properties[OWL + name])) > 1 for name in said):
            several = ', '.join(said)
            raise self.ill_formed(node, f'{what} says several things at once: {several}')

    def literals(self, node: str, values: Iterable[Node]) -> tuple[Literal, ...]:
        """Return values of a data range, which must be literals."""
        found = []
        for value in values:
            if not isinstance(value, Literal):
                raise self.ill_formed(node, f'expected a literal in a data range, got {value}')
            found.append(value)
        return tuple(found)

    def value_kinds(self, prop: Node) -> set[str]:
        """Return which of object and data property a name is, as far as is known."""
        return self.kinds.get(str(prop), set()) & {'object_property', 'data_property'}

    def only_annotates(self, name: str) -> bool:
        """Tell whether a name is an annotation property, and no other kind of property or class;
        it may be an individual as well, of which something is said.
        """
        return self.kinds.get(name, set()) - {'individual'} == {'annotation_property'}

    def is_data(self, prop: str, range_node: Node | None = None) -> bool:
        kinds = self.value_kinds(prop)
        if len(kinds) == 1:
            return 'data_property' in kinds
        return isinstance(range_node, str) and self.is_data_range(range_node)

    def is_data_range(self, node: str) -> bool:
        if 'datatype' in self.kinds.get(node, ()) or node == RDFS + 'Literal':
            return True
        return node.startswith(XSD)

    def guess_kinds(self) -> None:
        """Give undeclared properties the kinds of their values, ranges and superproperties.

        rdf:Property tells no kind: without any of these it is an object property. Nor does the
        header: what is used there alone annotates the ontology.
        """
        guessed: dict[str, set[str]] = {}
        below: dict[str, list[str]] = {}

        def guess(name: str, are_data: Iterable[bool]) -> None:
            if name not in self.kinds and not name.startswith(BUILT_IN):
                kinds = ('data_property' if is_data else 'object_property' for is_data in are_data)
                guessed.setdefault(name, set()).update(kinds)

        for subject, properties in self.nodes.items():
            if RDF + 'Property' in properties.get(_TYPE, ()):
                guess(subject, ())
            for predicate, values in properties.items():
                if predicate == RDFS + 'range':
                    guess(subject, (isinstance(v, str) and self.is_data_range(v) for v in values))
                elif predicate == RDFS + 'subPropertyOf':
                    if subject not in self.kinds and not subject.startswith(BUILT_IN):
                        for value in values:
                            below.setdefault(str(value), []).append(subject)
                elif predicate not in self.kinds and subject != self.header:
                    guess(predicate, (isinstance(value, Literal) for value in values))
        self.kinds.update((name, kinds) for name, kinds in guessed.items() if kinds)
        # A superproperty may have its kind from its own superproperty.
        above = list(below)
        while above:
            name = above.pop()
            kinds = self.value_kinds(name)
            for sub in below.get(name, ()):
                if not kinds <= self.kinds.get(sub, set()):
                    self.kinds.setdefault(sub, set()).update(kinds)
                    above.append(sub)
        for name in guessed:
            self.kinds.setdefault(name, {'object_property'})


class _Terms:
    """Reads what nodes stand for: properties, data ranges and class expressions."""

    def __init__(self, graph: _Statements) -> None:
        self._graph = graph
        self._known: dict[str, ex.ClassExpression] = {}
        self._open: set[str] = set()

    def property(self, node: str) -> ex.PropertyExpression:
        if not node.startswith('_:'):
            return node
        inverse = self._graph.one(node, OWL + 'inverseOf')
        if not isinstance(inverse, str):
            raise self._graph.ill_formed(node, 'expected a property, got a node without a name')
        inner = self._inside(node, lambda _: self.property(inverse))
        return inner.prop if isinstance(inner, ex.ObjectInverseOf) else ex.ObjectInverseOf(inner)

    def data_range(self, node: Node) -> ex.DataRange:
        """Return the data range a node stands for."""
        if not isinstance(node, str):
            raise self._graph.ill_formed(
                self._graph.subject_read, f'expected a data range, got the literal {node.lexical!r}'
            )
        return self._inside(node, self._data_range) if node.startswith('_:') else node

    def _data_range(self, node: str) -> ex.DataRange:
        properties = self._graph.nodes.get(node, {})
        if OWL + 'oneOf' in properties:
            items = self._graph.list_of(properties[OWL + 'oneOf'][0])
            return ex.DataOneOf(self._graph.literals(node, items))
        for predicate, record in (
            (OWL + 'intersectionOf', ex.DataIntersectionOf),
            (OWL + 'unionOf', ex.DataUnionOf),
        ):
            if predicate in properties:
                return record(
                    tuple(map(self.data_range, self._graph.list_of(properties[predicate][0])))
                )
        if OWL + 'datatypeComplementOf' in properties:
            return ex.DataComplementOf(self.data_range(properties[OWL + 'datatypeComplementOf'][0]))
        if OWL + 'onDatatype' in properties:
            facets = []
            for facet in self._graph.resources(
                self._graph.one(node, OWL + 'withRestrictions') or RDF + 'nil'
            ):
                for name, values in self._graph.nodes.get(facet, {}).items():
                    if name != _TYPE:
                        facets += [(name, value) for value in self._graph.literals(node, values)]
            return ex.DatatypeRestriction(
                self._graph.resource(node, OWL + 'onDatatype'), tuple(facets)
            )
        raise self._graph.ill_formed(node, 'expected a data range')

    def expression(self, node: Node) -> ex.ClassExpression:
        """Return the class expression a node stands for."""
        if not isinstance(node, str):
            raise self._graph.ill_formed(
                self._graph.subject_read, f'expected a class, got the literal {node.lexical!r}'
            )
        if not node.startswith('_:'):
            return node
        known = self._known.get(node)
        if known is not None:
            return known
        expression = self._known[node] = self._inside(node, self._expression)
        return expression

    def _inside(self, node: str, read: Callable[[str], T]) -> T:
        """Read an anonymous node that may hold others of its kind."""
        if node in self._open:
            raise self._graph.ill_formed(node, 'an expression contains itself')
        if len(self._open) >= DEEPEST:
            raise self._graph.ill_formed(node, f'expressions nest deeper than {DEEPEST}')
        self._open.add(node)
        try:
            return read(node)
        finally:
            self._open.discard(node)

    def _expression(self, node: str) -> ex.ClassExpression:
        properties = self._graph.nodes.get(node, {})
        self._graph.check_one(node, _CONSTRUCTORS, 'a class expression')
        for predicate in _CONSTRUCTED:
            if predicate in properties:
                return self.constructed(predicate, properties[predicate][0])
        if OWL + 'onProperty' in properties:
            return self.restriction(node, properties)
        raise self._graph.ill_formed(node, 'expected a class expression')

    def constructed(self, predicate: str, value: Node) -> ex.ClassExpression:
        if predicate == OWL + 'complementOf':
            return ex.ObjectComplementOf(self.expression(value))
        if predicate == OWL + 'oneOf':
            individuals = tuple(self._graph.resources(value))
            return ex.ObjectOneOf(individuals) if individuals else NOTHING
        # Of none and of one, as OWL 1 has them (OWL 2 mapping to RDF, table 14).
        is_union = predicate == OWL + 'unionOf'
        operands = tuple(map(self.expression, self._graph.list_of(value)))
        if len(operands) < 2:
            return operands[0] if operands else NOTHING if is_union else THING
        return (ex.ObjectUnionOf if is_union else ex.ObjectIntersectionOf)(operands)

    def restriction(self, node: str, properties: dict[str, list[Node]]) -> ex.ClassExpression:
        on = self._graph.resource(node, OWL + 'onProperty')
        prop = self.property(on)
        self._graph.check_one(node, _RESTRICTIONS, f'restriction on {local_name(on)}')
        filler = self._graph.one(node, OWL + 'someValuesFrom') or self._graph.one(
            node, OWL + 'allValuesFrom'
        )
        if OWL + 'hasValue' in properties:
            value = properties[OWL + 'hasValue'][0]
            if isinstance(value, Literal):
                return ex.DataHasValue(on, value)
            return ex.ObjectHasValue(prop, value)
        if OWL + 'hasSelf' in properties:
            self_value = properties[OWL + 'hasSelf'][0]
            if isinstance(self_value, Literal) and self_value.lexical in ('true', '1'):
                return ex.ObjectHasSelf(prop)
            raise self._graph.ill_formed(
                node, f'restriction on {local_name(on)}: hasSelf is not true'
            )
        if filler is not None:
            some = OWL + 'someValuesFrom' in properties
            if self._graph.is_data(on, filler):
                data = ex.DataSomeValuesFrom if some else ex.DataAllValuesFrom
                return data(on, self.data_range(filler))
            quantified = ex.ObjectSomeValuesFrom if some else ex.ObjectAllValuesFrom
            return quantified(prop, self.expression(filler))
        on_class = self._graph.one(node, OWL + 'onClass')
        on_range = self._graph.one(node, OWL + 'onDataRange')
        counts_values = on_range is not None or (on_class is None and self._graph.is_data(on))
        for plain, qualified, of_objects, of_data in CARDINALITIES:
            number = self._graph.number(node, OWL + plain)
            if number is None:
                number = self._graph.number(node, OWL + qualified)
            if number is None:
                continue
            if counts_values:
                return of_data(number, on, self.data_range(on_range or RDFS + 'Literal'))
            return of_objects(number, prop, self.expression(on_class or OWL + 'Thing'))
        raise self._graph.ill_formed(
            node, f'restriction on {local_name(on)} states nothing that is understood'
        )


class RdfMapper:
    """Turns one graph into axioms.

    Large because it has one method for each row of the mapping's tables.

    Args:
        graph: The graph.
        base: What the ontology is called where its header has no name; '': nothing is kept then.

    Attributes:
        axioms: In document order; there after `read`.
        sources: What each of them was read from, but for plain facts of individuals: the node
            that stands for it, or (subject, predicate, value); several where it is stated again.
        unsupported: One sentence for each statement that was not understood.
        prefixes: The prefixes that the document declares.
    """

    def __init__(self, graph: Graph, base: str = '') -> None:
        self.axioms: dict[Axiom, None] = {}
        self.sources: dict[Axiom, list[str | Triple]] = {}
        self._source: str | Triple = ''
        self._base = base
        self.unsupported = graph.unsupported.copy()
        self.prefixes = graph.prefixes
        self._graph = _Statements(graph)
        self._terms = _Terms(self._graph)
        self._plain: dict[str, tuple[type, Callable[..., Axiom]]] = {}
        self._added: list[Axiom] = []
        self._used: set[str] = set()

    @property
    def iri(self) -> str:
        """The IRI in the header; '' without one."""
        return '' if self._graph.header.startswith('_:') else self._graph.header

    @property
    def declared(self) -> Iterator[tuple[str, str]]:
        """Pairs (kind, IRI) of what the graph declares."""
        return ((kind, name) for name, kinds in self._graph.kinds.items() for kind in kinds)

    @property
    def imports(self) -> Iterator[str]:
        """The IRIs of the ontologies that the graph imports."""
        found = (nodes.get(OWL + 'imports', ()) for nodes in self._graph.nodes.values())
        return (value for values in found for value in values if isinstance(value, str))

    def read(self, declared: Iterable[tuple[str, str]] = ()) -> None:
        """Read the axioms.

        Args:
            declared: Pairs (kind, IRI) of what is declared in documents that are read with this.
        """
        for kind, name in declared:
            self._graph.kinds.setdefault(name, set()).add(kind)
        self._graph.guess_kinds()
        for kind, value, record in _VALUES:
            for name, kinds in self._graph.kinds.items():
                if kinds == {kind} and not name.startswith(BUILT_IN):
                    self._plain[name] = value, record
        for subject, properties in self._graph.nodes.items():
            self._subject(subject, properties)

    # --- reporting ---

    def _report(self, node: str, what: str) -> None:
        self.unsupported.append(self._graph.where(node) + what)

    # --- axioms ---

    def _add(self, axiom: Axiom) -> None:
        self.axioms[axiom] = None
        self.sources.setdefault(axiom, []).append(self._source)
        self._added.append(axiom)

    def _subject(self, subject: str, properties: dict[str, list[Node]]) -> None:
        self._graph.subject_read = self._source = subject
        self._added = []
        types = [value for value in properties.get(_TYPE, ()) if isinstance(value, str)]
        special = next((_SPECIAL[name] for name in types if name in _SPECIAL), None)
        if special is None and OWL + 'sourceIndividual' in properties:
            special = _SPECIAL[
                OWL + 'NegativePropertyAssertion'
            ]  # Its type is missing; nothing else has a source.
        if special is not None:
            self._attempt(subject, special, self, subject, properties)
            return
        for value in properties.get(_TYPE, ()):
            self._source = (subject, _TYPE, value)
            self._attempt(subject, self._type, subject, value)
        self._source = subject
        if OWL + 'onProperty' in properties and not subject.startswith('_:'):
            self._attempt(subject, self._named_restriction, subject, properties)
        if subject.startswith(BUILT_IN[:3]) and subject not in _WITH_AXIOMS:
            self._attempt(subject, self._reserved, subject, properties)
        for predicate, values in properties.items():
            if predicate == _TYPE or predicate in _STRUCTURE:
                continue
            of_value, record = self._plain.get(predicate, (None, None))
            for value in values:
                if record is not None and type(value) is of_value:
                    self.axioms[record(predicate, subject, value)] = None
                else:
                    self._source = (subject, predicate, value)
                    self._attempt(subject, self._triple, subject, predicate, value)

    def _reserved(self, subject: str, properties: dict[str, list[Node]]) -> None:
        """Report what is said of a word of OWL's own, which means what OWL says."""
        types = {value for value in properties.get(_TYPE, ()) if isinstance(value, str)}
        said = properties.keys() & _OF_PROPERTIES or types & {*CHARACTERISTICS, _FUNCTIONAL}
        if said and not self._graph.only_annotates(subject):
            told = ', '.join(sorted(map(local_name, said)))
            self._report(subject, f'{told} of {local_name(subject)}, a word of OWL, has no effect')

    def _named_restriction(self, subject: str, properties: dict[str, list[Node]]) -> None:
        self._add(ax.EquivalentClasses((subject, self._terms.restriction(subject, properties))))

    def _attempt(self, subject: str, read: Callable[..., None], *arguments: object) -> None:
        """Read one statement; what is ill-formed in it costs the statement alone."""
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
            is_annotation = self._graph.only_annotates(subject)
            if is_annotation and predicate in _OF_PROPERTIES:
                self._add(ax.AnnotationAssertion(predicate, subject, value))
            elif axiom := handler(self, subject, value):
                self._add(axiom)
        else:
            raise self._graph.ill_formed(
                subject,
                f'{local_name(predicate)} of {local_name(subject)} has the literal'
                f' {value.lexical!r}, expected a resource',
            )

    def _type(self, subject: str, name: Node) -> None:
        if isinstance(name, Literal):
            raise self._graph.ill_formed(subject, f'its type is the literal {name.lexical!r}')
        kind = DECLARATIONS.get(name)
        if kind is not None:
            if not subject.startswith('_:'):
                self._add(ax.Declaration(kind, subject))
        elif name in CHARACTERISTICS:
            if self._graph.is_data(subject):
                raise self._graph.ill_formed(
                    subject, f'a data property cannot be of type {local_name(name)}'
                )
            if not subject.startswith('_:'):
                self._add(ax.Declaration('object_property', subject))
            self._add(CHARACTERISTICS[name](self._terms.property(subject)))
        elif name == _FUNCTIONAL:
            if self._graph.is_data(subject):
                self._add(ax.FunctionalDataProperty(subject))
            else:
                self._add(ax.FunctionalObjectProperty(self._terms.property(subject)))
        elif name == RDF + 'Property':
            for kind in sorted(self._graph.kinds.get(subject, ())):
                self._add(ax.Declaration(kind, subject))
        elif name in (OWL + 'DeprecatedClass', OWL + 'DeprecatedProperty'):
            self._add(ax.AnnotationAssertion(OWL + 'deprecated', subject, _TRUE))
        elif name in _MARKS or (name.startswith(SWRL) and name.endswith('Atom')):
            pass  # Read where the node is used.
        elif name.startswith(BUILT_IN[:3]) and name not in (THING, NOTHING):
            self._report(subject, f'type {name} of {subject} is not understood')
        else:
            self._add(ax.ClassAssertion(self._terms.expression(name), subject))

    def _statement(self, subject: str, predicate: str, value: Node) -> None:
        kinds = self._graph.kinds.get(predicate, set())
        fitting = 'data_property' if isinstance(value, Literal) else 'object_property'
        annotates = 'annotation_property' in kinds or predicate in ANNOTATIONS
        is_header = subject == self._graph.header
        if annotates or (is_header and fitting not in kinds):
            if is_header and subject.startswith('_:'):
                subject = self._base or subject
            if subject.startswith('_:') and self._is_construct(subject):
                self._report(subject, f'{local_name(predicate)} of what has no name is not kept')
            else:
                self._add(ax.AnnotationAssertion(predicate, subject, value))
        elif predicate.startswith(SWRL):
            pass
        elif predicate.startswith(XSD) and subject.startswith('_:'):
            pass  # A facet of a datatype restriction.
        elif predicate.startswith(BUILT_IN[:3]):
            self._report(subject, f'{predicate} on {subject} is not understood')
        elif isinstance(value, Literal):
            if 'object_property' in kinds and 'data_property' not in kinds:
                raise self._graph.ill_formed(
                    subject,
                    f'object property {local_name(predicate)} of {local_name(subject)}'
                    f' has the literal {value.lexical!r}, expected an individual',
                )
            self._add(ax.DataPropertyAssertion(predicate, subject, value))
        elif 'data_property' in kinds and 'object_property' not in kinds:
            raise self._graph.ill_formed(
                subject,
                f'data property {local_name(predicate)} of {local_name(subject)}'
                f' has the resource {value}, expected a literal',
            )
        else:
            self._add(ax.ObjectPropertyAssertion(predicate, subject, value))

    def _is_construct(self, node: str) -> bool:
        """Tell whether a blank node is part of OWL's own syntax, and no individual."""
        properties = self._graph.nodes[node]
        types = {value for value in properties.get(_TYPE, ()) if isinstance(value, str)}
        if any(name.startswith((OWL, SWRL)) for name in types - {THING, OWL + 'NamedIndividual'}):
            return True
        return not {*_STRUCTURE, *_CONSTRUCTED, OWL + 'inverseOf'}.isdisjoint(properties)

    def _equivalent_class(self, subject: str, value: str) -> Axiom:
        if self._graph.is_data_range(subject):
            self._check_named(subject)
            return ax.DatatypeDefinition(subject, self._terms.data_range(value))
        return ax.EquivalentClasses(
            (self._terms.expression(subject), self._terms.expression(value))
        )

    def _check_named(self, subject: str) -> None:
        if subject.startswith('_:'):
            raise self._graph.ill_formed(subject, 'a node without a name cannot be defined')

    def _disjoint_union(self, subject: str, value: str) -> Axiom:
        self._check_named(subject)
        return ax.DisjointUnion(
            subject, tuple(map(self._terms.expression, self._graph.list_of(value)))
        )

    def _defined(self, subject: str, value: str, predicate: str) -> Axiom | None:
        """Read a named class that carries the expression itself (OWL 1 style): an equivalence."""
        if subject.startswith('_:'):
            return None
        if predicate == OWL + 'oneOf' and self._graph.is_data_range(subject):
            values = ex.DataOneOf(self._graph.literals(subject, self._graph.list_of(value)))
            return ax.DatatypeDefinition(subject, values)
        return ax.EquivalentClasses((subject, self._terms.constructed(predicate, value)))

    def _between(self, subject: str, value: str, predicate: str) -> Axiom:
        """Read a relation of two properties."""
        of_objects, of_data = _BETWEEN[predicate]
        chain = self._graph.one(subject, _CHAIN) if subject.startswith('_:') else None
        if chain is not None and predicate == RDFS + 'subPropertyOf':
            return self._chain(value, chain)
        kinds, others = self._graph.value_kinds(subject), self._graph.value_kinds(value)
        if kinds and others and kinds.isdisjoint(others):
            raise self._graph.ill_formed(
                subject,
                f'{local_name(predicate)} of an object property and a data property,'
                f' {local_name(subject)} and {local_name(value)}',
            )
        if self._graph.is_data(subject) or self._graph.is_data(value):
            if subject.startswith('_:') or value.startswith('_:'):
                raise self._graph.ill_formed(subject, 'expected the name of a data property')
            return of_data(subject, value)
        return of_objects(self._terms.property(subject), self._terms.property(value))

    def _chain(self, subject: str, value: Node) -> Axiom:
        chain = tuple(self._terms.property(item) for item in self._graph.resources(value))
        return ax.SubPropertyChainOf(chain, self._terms.property(subject))

    def _inverse(self, subject: str, value: str) -> Axiom | None:
        if subject.startswith('_:'):
            return None
        return ax.InverseObjectProperties(subject, self._terms.property(value))

    def _domain(self, subject: str, value: str) -> Axiom:
        if self._graph.is_data(subject):
            return ax.DataPropertyDomain(subject, self._terms.expression(value))
        return ax.ObjectPropertyDomain(self._terms.property(subject), self._terms.expression(value))

    def _range(self, subject: str, value: str) -> Axiom:
        if self._graph.is_data(subject, value):
            return ax.DataPropertyRange(subject, self._terms.data_range(value))
        return ax.ObjectPropertyRange(self._terms.property(subject), self._terms.expression(value))

    def _same(self, subject: str, value: str) -> Axiom:
        if not self._used:
            self._used = {name for properties in self._graph.nodes.values() for name in properties}
        for name in (subject, value):
            kinds = self._graph.kinds.get(name, set())
            known = [kind for kind in ('class', 'datatype') if kind in kinds]
            for kind in ['property'] * (name in self._used) + known:
                self._report(subject, f'owl:sameAs says nothing of {local_name(name)} as {kind}')
        return ax.SameIndividual(frozenset((subject, value)))

    def _key(self, subject: str, value: str) -> Axiom:
        props = self._graph.resources(value)
        data = tuple(prop for prop in props if self._graph.is_data(prop))
        objects = tuple(
            self._terms.property(prop) for prop in props if not self._graph.is_data(prop)
        )
        return ax.HasKey(self._terms.expression(subject), objects, data)

    # --- nodes with a shape of their own ---

    def _group(self, node: str, properties: dict[str, list[Node]], read: _ReadNode) -> None:
        """Read a node that stands for axioms, and what it says of them."""
        read(self, node, properties)
        self._note(tuple(self._added), node, properties)

    def _all_different(self, node: str, properties: dict[str, list[Node]]) -> None:
        for predicate in (OWL + 'members', OWL + 'distinctMembers'):
            for head in properties.get(predicate, ()):
                members = frozenset(self._graph.resources(head))
                if len(members) > 1:
                    self._add(ax.DifferentIndividuals(members))

    def _all_disjoint_classes(self, node: str, properties: dict[str, list[Node]]) -> None:
        for head in properties.get(OWL + 'members', ()):
            self._add(
                ax.DisjointClasses(tuple(map(self._terms.expression, self._graph.list_of(head))))
            )

    def _all_disjoint_properties(self, node: str, properties: dict[str, list[Node]]) -> None:
        for head in properties.get(OWL + 'members', ()):
            props = self._graph.resources(head)
            if any(self._graph.is_data(prop) for prop in props):
                self._add(ax.DisjointDataProperties(tuple(props)))
            else:
                self._add(ax.DisjointObjectProperties(tuple(map(self._terms.property, props))))

    def _negative(self, node: str, properties: dict[str, list[Node]]) -> None:
        source = self._graph.resource(node, OWL + 'sourceIndividual')
        prop = self._graph.resource(node, OWL + 'assertionProperty')
        value = self._graph.one(node, OWL + 'targetValue')
        if isinstance(value, Literal):
            self._add(ax.NegativeDataPropertyAssertion(prop, source, value))
        else:
            target = self._graph.resource(node, OWL + 'targetIndividual')
            expression = self._terms.property(prop)
            if isinstance(expression, ex.ObjectInverseOf):
                source, target, prop = target, source, expression.prop
            self._add(ax.NegativeObjectPropertyAssertion(prop, source, target))

    def _annotated(self, node: str, properties: dict[str, list[Node]]) -> None:
        source, predicate, target = (
            self._graph.one(node, OWL + name)
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
        body, head = (
            tuple(
                map(
                    self._atom,
                    self._graph.resources(self._graph.one(node, SWRL + side) or RDF + 'nil'),
                )
            )
            for side in ('body', 'head')
        )
        annotations = tuple(
            (predicate, value)
            for predicate, values in properties.items()
            if predicate not in (_TYPE, SWRL + 'body', SWRL + 'head')
            for value in values
        )
        kept = tuple(note for note in annotations if str(note[1])[:2] != '_:')
        if kept != annotations:
            self._report(node, 'an annotation on a rule is not kept')
        self._add(ax.Rule(body, head, kept))

    def _atom(self, node: str) -> ex.Atom:
        kind = self._graph.one(node, _TYPE)
        if not isinstance(kind, str) or kind not in ATOMS:
            raise self._graph.ill_formed(node, f'rule atom of type {kind} is not understood')
        record, *statements = ATOMS[kind]
        atom: ex.Atom = record(*(self._atom_part(node, predicate) for predicate, _ in statements))
        return atom

    def _atom_part(self, node: str, predicate: str) -> Any:
        if predicate == SWRL + 'arguments':
            items = self._graph.list_of(self._graph.one(node, predicate) or RDF + 'nil')
            return tuple(self._argument(item) for item in items)
        if predicate in (SWRL + 'argument1', SWRL + 'argument2'):
            value = self._graph.one(node, predicate)
            if value is None:
                raise self._graph.ill_formed(node, 'a rule atom lacks an argument')
            return self._argument(value)
        part = self._graph.resource(node, predicate)
        if predicate == SWRL + 'classPredicate':
            return self._terms.expression(part)
        if predicate == SWRL + 'dataRange':
            return self._terms.data_range(part)
        return self._terms.property(part) if predicate == SWRL + 'propertyPredicate' else part

    def _argument(self, value: Node) -> Node | ex.Variable:
        is_variable = isinstance(value, str) and value in self._graph.variables
        return ex.Variable(value) if is_variable else value  # type: ignore[arg-type]


_BETWEEN: dict[str, tuple[Callable[..., Axiom], Callable[..., Axiom]]] = {
    RDFS + 'subPropertyOf': (ax.SubObjectPropertyOf, ax.SubDataPropertyOf),
    OWL + 'equivalentProperty': (
        lambda *pair: ax.EquivalentObjectProperties(pair),
        lambda *pair: ax.EquivalentDataProperties(pair),
    ),
    OWL + 'propertyDisjointWith': (
        lambda *pair: ax.DisjointObjectProperties(pair),
        lambda *pair: ax.DisjointDataProperties(pair),
    ),
}
"""The relations of two properties: as axioms of object properties, and of data properties."""
_OF_PROPERTIES = {*_BETWEEN, RDFS + 'domain', RDFS + 'range'}
"""What is a mere annotation where it is said of an annotation property."""
_PREDICATES: dict[str, Callable[[RdfMapper, str, str], Axiom | None]] = {
    OWL + 'imports': lambda m, s, v: ax.Import(v),
    RDFS + 'subClassOf': lambda m, s, v: ax.SubClassOf(
        m._terms.expression(s), m._terms.expression(v)
    ),
    OWL + 'equivalentClass': RdfMapper._equivalent_class,
    OWL + 'disjointWith': lambda m, s, v: ax.DisjointClasses(
        (m._terms.expression(s), m._terms.expression(v))
    ),
    OWL + 'disjointUnionOf': RdfMapper._disjoint_union,
    OWL + 'propertyChainAxiom': RdfMapper._chain,
    OWL + 'inverseOf': RdfMapper._inverse,
    RDFS + 'domain': RdfMapper._domain,
    RDFS + 'range': RdfMapper._range,
    OWL + 'sameAs': RdfMapper._same,
    OWL + 'differentFrom': lambda m, s, v: ax.DifferentIndividuals(frozenset((s, v))),
    OWL + 'hasKey': RdfMapper._key,
    OWL + 'datatypeComplementOf': lambda *_: None,
    _CHAIN: lambda *_: None,
    **{name: partial(RdfMapper._between, predicate=name) for name in _BETWEEN},
    **{name: partial(RdfMapper._defined, predicate=name) for name in _CONSTRUCTED},
}

_SPECIAL: dict[str, _ReadNode] = {
    OWL + name: partial(RdfMapper._group, read=read)
    for name, read in (
        ('AllDifferent', RdfMapper._all_different),
        ('AllDisjointClasses', RdfMapper._all_disjoint_classes),
        ('AllDisjointProperties', RdfMapper._all_disjoint_properties),
        ('NegativePropertyAssertion', RdfMapper._negative),
    )
} | {
    OWL + 'Axiom': RdfMapper._annotated,
    OWL + 'Annotation': RdfMapper._annotated_annotation,
    SWRL + 'Imp': RdfMapper._rule,
}
