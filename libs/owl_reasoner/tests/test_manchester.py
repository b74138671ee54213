"""Manchester syntax: what is read, what is written, and where a text is wrong."""
# ruff: noqa: E501 - tables of cases, a message one line each

from __future__ import annotations

import pytest

from owl_reasoner import KnowledgeBase, OntologyFileError, read_ontology
from owl_reasoner.documents.manchester import ManchesterParser, ManchesterWriter
from owl_reasoner.documents.writing import ontology_bytes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import RDF, RDFS, SWRLB, XSD

from .random_ontologies import RandomOntology

N = 'urn:o#'
DOCUMENT = """
Prefix: : <urn:o#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
# As Protege writes it.
Ontology: <urn:o>
Annotations: rdfs:comment "of \\"rooms\\""@en

ObjectProperty: hasDoor
    Domain: Room
    Characteristics: Irreflexive, Asymmetric
    InverseOf: doorOf
ObjectProperty: doorOf
ObjectProperty: near SubPropertyChain: hasDoor o doorOf
DataProperty: area
    Characteristics: Functional
    Range: decimal[> 0.0]
Datatype: Level EquivalentTo: {"low", "high"}
Class: Room
    Annotations: rdfs:label "room"
    SubClassOf: hasDoor min 1 Door, not Door
    HasKey: area
Class: Door
Class: DeadEnd EquivalentTo: Room and (hasDoor exactly 1)
Class: Large EquivalentTo: Room that area some decimal[>= 20.0]
Class: Room and DeadEnd SubClassOf: inverse (near) some Room
Individual: r
    Types: Room, hasDoor max 1
    Facts: hasDoor d, area 21.5, not near d
    DifferentFrom: d
Individual: d Types: Door
DisjointClasses: Room, Door
Rule: Room(?r), area(?r, ?a), greaterThan(?a, 20.0) -> Hall(?r)
"""


def test_a_document_is_read_and_reasoned_over() -> None:
    document = read_ontology(DOCUMENT.encode(), 'urn:base')
    assert (document.format, document.iri, document.unsupported) == ('manchester', 'urn:o', [])
    kb = KnowledgeBase('urn:o', document.axioms)
    assert kb.reason()
    assert kb.types(f'{N}r') == {f'{N}{name}' for name in ('Room', 'DeadEnd', 'Large', 'Hall')}
    assert ax.DataPropertyAssertion(f'{N}area', f'{N}r', Literal('21.5', XSD + 'decimal')) in set(
        document.axioms
    )
    assert ax.HasKey(f'{N}Room', (), (f'{N}area',)) in set(document.axioms)


def test_what_is_written_is_read_back() -> None:
    axioms = read_ontology(DOCUMENT.encode(), 'urn:base').axioms
    written = ontology_bytes(axioms, 'urn:o', 'manchester', {'': N})
    assert b'EquivalentClasses: :DeadEnd, (:Room and (:hasDoor exactly 1 owl:Thing))' in written
    assert set(read_ontology(written, 'urn:o').axioms) == set(axioms)


@pytest.mark.parametrize('seed', range(20))
def test_random_axioms_are_read_back(seed: int) -> None:
    axioms = list(dict.fromkeys(RandomOntology(seed).ontology(10, 10)))
    found = read_ontology(ontology_bytes(axioms, 'urn:o', 'manchester'), 'urn:o').axioms
    assert [axiom for axiom in axioms if axiom not in set(found)] == []


@pytest.mark.parametrize(
    ('text', 'line', 'expected'),
    [
        ('Ontology: <urn:o>\nClass: A SubClassOf:\n', 3, 'expected a class'),
        ('Ontology: <urn:o>\nClass: A SubClassOf: p some\n', 3, 'expected'),
        ('Ontology: <urn:o>\nClass: A Domain: B\n', 2, 'a section of this frame, not Domain:'),
        ('Ontology: <urn:o>\nClas: A\n', 2, 'a frame such as Class:'),
        ('Ontology: <urn:o>\nClass: x:A\n', 2, 'the prefix of .x:A. is not declared'),
        ('Ontology: <urn:o>\nClass: A SubClassOf: p min x\n', 2, 'a whole number'),
        ('Ontology: <urn:o>\nIndividual: i Facts: p "a\n', 2, 'expected a'),
        ('Ontology: <urn:o>\nRule: A(?x) B(?x)\n', 2, "expected '->'"),
        ('Ontology: <urn:o>\nClass: A SubClassOf: ' + 'not (' * 300 + 'B', 2, 'nest'),
    ],
)
def test_a_wrong_text_names_its_place(text: str, line: int, expected: str) -> None:
    with pytest.raises(OntologyFileError, match=expected) as error:
        read_ontology(text.encode(), 'urn:base')
    assert error.value.line == line


@pytest.mark.parametrize(
    'text',
    [
        'A and (p some (B or C)) and not D',
        'p only {a, b}',
        '(inverse (p)) min 2 A',
        'd some integer[>= 1, < 5]',
        'd max 1 xsd:string',
        'p Self',
        'd value "x"@en',
        'p exactly 3',
    ],
)
def test_an_expression_comes_back_as_it_was(text: str) -> None:
    def named(name: str) -> str:
        return name.replace('xsd:', XSD) if name.startswith('xsd:') else N + name

    def read(text: str) -> ex.ClassExpression:
        parser = ManchesterParser(text, named, [('data_property', f'{N}d')])
        found: ex.ClassExpression = parser.whole(parser.class_expression)
        return found

    first = read(text)
    written = ManchesterWriter({}).expression(first).replace('owl:Thing', 'Thing')
    again = read(written.replace('Thing', '<http://www.w3.org/2002/07/owl#Thing>'))
    assert again == first


ANNOTATED = """
Prefix: : <urn:o#>
Ontology: <urn:o>
Annotations: Annotations: rdfs:comment "of the label" rdfs:label "o", rdfs:comment "two"
ObjectProperty: p
    Characteristics: Annotations: rdfs:comment "f" Functional, Irreflexive
    Domain: Annotations: rdfs:comment "d" A
    InverseOf: Annotations: rdfs:comment "i" q
    SubPropertyChain: Annotations: rdfs:comment "ch" p o q
ObjectProperty: q
DataProperty: d
    Characteristics: Annotations: rdfs:comment "df" Functional
    Range: Annotations: rdfs:comment "dr" xsd:int
    SubPropertyOf: Annotations: rdfs:comment "ds" e
DataProperty: e
Datatype: T EquivalentTo: Annotations: rdfs:comment "t" {"low"}
Class: A
    Annotations: Annotations: rdfs:comment "n" rdfs:label "a"@en, rdfs:seeAlso <urn:x>
    SubClassOf: Annotations: rdfs:comment "one", rdfs:label "two" p some B, B
    EquivalentTo: Annotations: rdfs:comment "e" (p only B)
    HasKey: Annotations: rdfs:comment "k" p d
    DisjointUnionOf: Annotations: rdfs:comment "u" B, C
Class: B
Class: C
Individual: a
    Types: Annotations: rdfs:comment "ty" A, B
    Facts: Annotations: rdfs:comment "p" p b, d 5, Annotations: rdfs:comment "n" not q b
    SameAs: Annotations: rdfs:comment "s" c
Individual: b
DisjointClasses: Annotations: rdfs:comment "dc" A, B, C
DifferentIndividuals: Annotations: rdfs:comment "di" a, b
Rule: Annotations: rdfs:label "R" A(?x) -> B(?x)
"""


def test_what_is_said_of_axioms_is_read_and_written() -> None:
    document = read_ontology(ANNOTATED.encode(), 'urn:base')
    assert document.unsupported == []
    notes = {a.axiom: a.annotations for a in document.axioms if isinstance(a, ax.AxiomAnnotation)}
    assert len(notes) == 20
    comment, label = (f'http://www.w3.org/2000/01/rdf-schema#{n}' for n in ('comment', 'label'))
    some = ax.SubClassOf(f'{N}A', ex.ObjectSomeValuesFrom(f'{N}p', f'{N}B'))
    assert notes[some] == ((comment, Literal('one')), (label, Literal('two')))
    assert ax.SubClassOf(f'{N}A', f'{N}B') not in notes
    rule = next(axiom for axiom in document.axioms if isinstance(axiom, ax.Rule))
    assert rule.label == 'R'
    for form in ('manchester', 'rdfxml'):
        written = ontology_bytes(document.axioms, 'urn:o', form, {'': N})
        again = read_ontology(written, 'urn:base')
        assert (again.unsupported, set(again.axioms)) == ([], set(document.axioms))
        assert next(axiom for axiom in again.axioms if isinstance(axiom, ax.Rule)).label == 'R'


@pytest.mark.parametrize(
    ('frame', 'report'),
    [
        (
            'Class: A SubClassOf:\n Annotations: Annotations: rdfs:label "x" rdfs:label "y" B',
            'line 3: an annotation on an annotation is not kept',
        ),
        (
            'Class: A and B\n Annotations: rdfs:label "x"',
            'line 3: annotations of what has no name are not kept',
        ),
    ],
)
def test_what_no_axiom_holds_is_reported(frame: str, report: str) -> None:
    document = read_ontology(f'Ontology: <urn:o>\n{frame}'.encode(), 'urn:base')
    assert document.unsupported == [report]


def test_annotations_nest_no_deeper_than_expressions() -> None:
    text = 'Ontology: <urn:o> Class: A ' + 'Annotations: ' * 5000 + 'rdfs:label "x"'
    with pytest.raises(OntologyFileError, match='nest no deeper'):
        read_ontology(text.encode(), 'urn:base')


def test_a_declaration_is_annotated_in_other_formats_only() -> None:
    declared = ax.Declaration('class', f'{N}A')
    said = ax.AxiomAnnotation(declared, ((f'{N}n', Literal('x')),))
    with pytest.raises(OntologyFileError, match='annotate the declaration of <urn:o#A>; save it'):
        ontology_bytes([declared, said], 'urn:o', 'manchester')


def test_what_nobody_declared_keeps_its_kind() -> None:
    """The functional syntax needs no declarations; a reader of Manchester syntax does."""
    text = 'Ontology(<urn:o> SubClassOf(<urn:A> DataSomeValuesFrom(<urn:d> <urn:T>)))'
    axioms = read_ontology(text.encode(), 'urn:base').axioms
    again = read_ontology(ontology_bytes(axioms, 'urn:o', 'manchester'), 'urn:base')
    assert [axiom for axiom in axioms if axiom not in again.axioms] == []


def full(name: str) -> str:
    """Return the IRI of a name; of one behind an unknown prefix there is none."""
    prefix, _, local = name.rpartition(':')
    if prefix not in ('', 'xsd'):
        raise ValueError(f'the prefix of {name!r} is not declared')
    return XSD + local if prefix else N + local


def parser(text: str) -> ManchesterParser:
    kinds = [('data_property', f'{N}d'), ('object_property', f'{N}o'), ('datatype', f'{N}T')]
    return ManchesterParser(text, full, kinds)


A, B, C, ONE, TWO, P, D, OBJ, T = (f'{N}{name}' for name in 'ABCijpdoT')
INT = XSD + 'integer'


def expression_of(text: str) -> ex.ClassExpression:
    read = parser(text)
    found: ex.ClassExpression = read.whole(read.class_expression)
    return found


@pytest.mark.parametrize(
    ('text', 'expression'),
    [
        ('A', A),
        ('<urn:x>', 'urn:x'),
        ('not not A', ex.ObjectComplementOf(ex.ObjectComplementOf(A))),
        ('A and B or C', ex.ObjectUnionOf((ex.ObjectIntersectionOf((A, B)), C))),
        ('A that B and C', ex.ObjectIntersectionOf((A, B, C))),
        ('A and (B or C)', ex.ObjectIntersectionOf((A, ex.ObjectUnionOf((B, C))))),
        ('not A and B', ex.ObjectIntersectionOf((ex.ObjectComplementOf(A), B))),
        ('{i}', ex.ObjectOneOf((ONE,))),
        ('{i, j}', ex.ObjectOneOf((ONE, TWO))),
        ('p some A and B', ex.ObjectIntersectionOf((ex.ObjectSomeValuesFrom(P, A), B))),
        ('p some not A', ex.ObjectSomeValuesFrom(P, ex.ObjectComplementOf(A))),
        ('p some p only A', ex.ObjectSomeValuesFrom(P, ex.ObjectAllValuesFrom(P, A))),
        ('p only {i}', ex.ObjectAllValuesFrom(P, ex.ObjectOneOf((ONE,)))),
        ('p some {5}', ex.DataSomeValuesFrom(P, ex.DataOneOf((Literal('5', INT),)))),
        (
            'p some {true}',
            ex.DataSomeValuesFrom(P, ex.DataOneOf((Literal('true', XSD + 'boolean'),))),
        ),
        ('o some {i}', ex.ObjectSomeValuesFrom(OBJ, ex.ObjectOneOf((ONE,)))),
        ('o some xsd:int', ex.ObjectSomeValuesFrom(OBJ, XSD + 'int')),
        ('p some xsd:int', ex.DataSomeValuesFrom(P, XSD + 'int')),
        ('p some T', ex.DataSomeValuesFrom(P, T)),
        ('p only integer', ex.DataAllValuesFrom(P, INT)),
        ('p some (A)', ex.ObjectSomeValuesFrom(P, A)),
        ('d some (T or xsd:int)', ex.DataSomeValuesFrom(D, ex.DataUnionOf((T, XSD + 'int')))),
        (
            'd only (T and not {1, 2})',
            ex.DataAllValuesFrom(
                D,
                ex.DataIntersectionOf(
                    (T, ex.DataComplementOf(ex.DataOneOf((Literal('1', INT), Literal('2', INT)))))
                ),
            ),
        ),
        ('inverse p some A', ex.ObjectSomeValuesFrom(ex.ObjectInverseOf(P), A)),
        ('inverse (p) some A', ex.ObjectSomeValuesFrom(ex.ObjectInverseOf(P), A)),
        ('(inverse p) Self', ex.ObjectHasSelf(ex.ObjectInverseOf(P))),
        ('(inverse (p)) value i', ex.ObjectHasValue(ex.ObjectInverseOf(P), ONE)),
        ('p value i', ex.ObjectHasValue(P, ONE)),
        ('p value 5', ex.DataHasValue(P, Literal('5', INT))),
        ('p value -5.0', ex.DataHasValue(P, Literal('-5.0', XSD + 'decimal'))),
        ('p value 5e1', ex.DataHasValue(P, Literal('5e1', XSD + 'double'))),
        ('p value 5.5f', ex.DataHasValue(P, Literal('5.5', XSD + 'float'))),
        ('p value 5F', ex.DataHasValue(P, Literal('5', XSD + 'float'))),
        ('p value false', ex.DataHasValue(P, Literal('false', XSD + 'boolean'))),
        (r'p value "a\"b\\c"', ex.DataHasValue(P, Literal('a"b\\c'))),
        ('p value "a"@en-GB', ex.DataHasValue(P, Literal('a', RDF + 'langString', 'en-gb'))),
        ('p value "5"^^integer', ex.DataHasValue(P, Literal('5', INT))),
        ('p value "5"^^xsd:long', ex.DataHasValue(P, Literal('5', XSD + 'long'))),
        ('p min 2', ex.ObjectMinCardinality(2, P)),
        ('p min 0 A', ex.ObjectMinCardinality(0, P, A)),
        ('p max 1 and A', ex.ObjectIntersectionOf((ex.ObjectMaxCardinality(1, P), A))),
        ('p exactly 3 (A or B)', ex.ObjectExactCardinality(3, P, ex.ObjectUnionOf((A, B)))),
        ('p min 2 not A', ex.ObjectMinCardinality(2, P, ex.ObjectComplementOf(A))),
        ('d min 2', ex.DataMinCardinality(2, D)),
        ('d max 1 or A', ex.ObjectUnionOf((ex.DataMaxCardinality(1, D), A))),
        ('d exactly 1 {5}', ex.DataExactCardinality(1, D, ex.DataOneOf((Literal('5', INT),)))),
        ('p exactly 1 xsd:int', ex.DataExactCardinality(1, P, XSD + 'int')),
        *(
            (
                f'd some integer[{sign} 5]',
                ex.DataSomeValuesFrom(
                    D, ex.DatatypeRestriction(INT, ((XSD + facet, Literal('5', INT)),))
                ),
            )
            for sign, facet in (
                ('>=', 'minInclusive'),
                ('<=', 'maxInclusive'),
                ('>', 'minExclusive'),
                ('<', 'maxExclusive'),
                ('length', 'length'),
                ('minLength', 'minLength'),
                ('maxLength', 'maxLength'),
                ('pattern', 'pattern'),
            )
        ),
        (
            'd some string[langRange "en", length 2]',
            ex.DataSomeValuesFrom(
                D,
                ex.DatatypeRestriction(
                    XSD + 'string',
                    ((RDF + 'langRange', Literal('en')), (XSD + 'length', Literal('2', INT))),
                ),
            ),
        ),
    ],
)
def test_an_expression_is_read_as_the_specification_has_it(
    text: str, expression: ex.ClassExpression
) -> None:
    assert expression_of(text) == expression


@pytest.mark.parametrize(
    ('text', 'column', 'message'),
    [
        ('A B', 3, "expected the end, got 'B'"),
        ('A and', 6, "expected a class, got 'the end'"),
        ('(A', 3, "expected ')', got 'the end'"),
        ('{i j}', 4, "expected '}', got 'j}'"),
        ('{}', 2, "expected a name, got '}'"),
        ('y:A', 1, "expected a class (the prefix of 'y:A' is not declared), got 'y:A'"),
        ('<A>', 1, "expected a full IRI, got '<A>'"),
        ('p min A', 7, "expected a whole number, got 'A'"),
        ('p min 1.5', 7, "expected a whole number, got '1.5'"),
        ('p min 1234567890123456789', 7, "expected a whole number, got '1234567890123456789'"),
        ('p value (', 9, "expected an individual, got '('"),
        ('p value "a"^^(', 14, "expected a datatype, got '('"),
        (
            'd some integer[5]',
            16,
            "expected '>=' or '<=' or '>' or '<' or 'length' or 'minLength' or 'maxLength' or 'pattern' or 'langRange', got '5]'",
        ),
        ('d some integer[> A]', 18, "expected a value, got 'A]'"),
        ('d some {5, A}', 12, "expected a value, got 'A}'"),
        ('d some integer[> 5', 19, "expected ']', got 'the end'"),
        (
            'inverse p',
            10,
            "expected 'some' or 'only' or 'value' or 'Self' or 'min' or 'max' or 'exactly', got 'the end'",
        ),
        ('A and "', 7, """expected a name, got '"'"""),
        ('A or\n  "text" or', 3, """expected a class, got '"text" or'"""),
    ],
)
def test_a_wrong_expression_names_what_was_expected(text: str, column: int, message: str) -> None:
    with pytest.raises(OntologyFileError) as error:
        expression_of(text)
    assert (error.value.message, error.value.column) == (message, column)
    assert error.value.line == text.count('\n') + 1


def atoms(text: str) -> tuple[tuple[ex.Atom, ...], tuple[ex.Atom, ...]]:
    rule = parser(text).rule()
    return rule.body, rule.head


x, y = (ex.Variable(f'urn:swrl:var#{name}') for name in 'xy')


@pytest.mark.parametrize(
    ('text', 'body', 'head'),
    [
        ('A(?x) -> B(?x)', [ex.ClassAtom(A, x)], [ex.ClassAtom(B, x)]),
        ('A(i), p(?x, j) ->', [ex.ClassAtom(A, ONE), ex.ObjectPropertyAtom(P, x, TWO)], []),
        ('-> p(i, j)', [], [ex.ObjectPropertyAtom(P, ONE, TWO)]),
        ('-> d(i, ?x)', [], [ex.DataPropertyAtom(D, ONE, x)]),
        ('-> p(i, 5)', [], [ex.DataPropertyAtom(P, ONE, Literal('5', INT))]),
        ('-> T(?x), xsd:int(?y)', [], [ex.DataRangeAtom(T, x), ex.DataRangeAtom(XSD + 'int', y)]),
        ('(p some A)(?x) ->', [ex.ClassAtom(ex.ObjectSomeValuesFrom(P, A), x)], []),
        ('<urn:x>(?<urn:v>) ->', [ex.ClassAtom('urn:x', ex.Variable('urn:v'))], []),
        (
            'sameAs(?x, i), DifferentFrom(?x, ?y) ->',
            [ex.SameIndividualAtom(x, ONE), ex.DifferentIndividualsAtom(x, y)],
            [],
        ),
        (
            'SameAs(?x, i), differentFrom(?x, ?y) ->',
            [ex.SameIndividualAtom(x, ONE), ex.DifferentIndividualsAtom(x, y)],
            [],
        ),
        (
            'swrlb:add(?x, 1, ?y) ->',
            [ex.BuiltinAtom(SWRLB + 'add', (x, Literal('1', INT), y))],
            [],
        ),
        ('lessThan(?x, ?y) ->', [ex.BuiltinAtom(SWRLB + 'lessThan', (x, y))], []),
        (f'<{SWRLB}add>(?x, ?y, ?y) ->', [ex.BuiltinAtom(SWRLB + 'add', (x, y, y))], []),
    ],
)
def test_a_rule_is_read(text: str, body: list[ex.Atom], head: list[ex.Atom]) -> None:
    assert atoms(text) == (tuple(body), tuple(head))


@pytest.mark.parametrize(
    ('text', 'column', 'message'),
    [
        ('sameAs(?x) ->', 10, "expected 2 arguments, got ') ->'"),
        ('p(?x, ?y, ?x) ->', 1, "expected one or two arguments, got 'p(?x, ?y, ?x) ->'"),
        ('(p some A)(?x, ?y) ->', 1, "expected one or two arguments, got '(p some A)(?x, ?y) -'"),
        ('A(?x)', 6, "expected '->', got 'the end'"),
        (
            'A(y:i) ->',
            3,
            "expected an individual (the prefix of 'y:i' is not declared), got 'y:i) ->'",
        ),
        (
            'y:A(?x) ->',
            1,
            "expected a class, property or built-in (the prefix of 'y:A' is not declared), got 'y:A(?x) ->'",
        ),
    ],
)
def test_a_wrong_rule_names_what_was_expected(text: str, column: int, message: str) -> None:
    with pytest.raises(OntologyFileError) as error:
        atoms(text)
    assert (error.value.message, error.value.column) == (message, column)


def test_a_class_that_is_called_like_a_built_in_is_a_class() -> None:
    known = ManchesterParser('add(?x) ->', full, [('class', f'{N}add')])
    assert known.rule().body == (ex.ClassAtom(f'{N}add', x),)


@pytest.mark.parametrize(
    ('frame', 'axioms'),
    [
        ('Class: A DisjointWith: B, C', [ax.DisjointClasses((A, B)), ax.DisjointClasses((A, C))]),
        (
            'Class: A EquivalentTo: B SubClassOf: C',
            [ax.EquivalentClasses((A, B)), ax.SubClassOf(A, C)],
        ),
        ('Class: A HasKey: p d, inverse o', [ax.HasKey(A, (P, ex.ObjectInverseOf(OBJ)), (D,))]),
        ('Class: A HasKey: (inverse o)', [ax.HasKey(A, (ex.ObjectInverseOf(OBJ),), ())]),
        *(
            (
                f'ObjectProperty: p {word}: o, inverse o',
                [record(P, OBJ), record(P, ex.ObjectInverseOf(OBJ))],
            )
            for word, record in (
                ('SubPropertyOf', ax.SubObjectPropertyOf),
                ('InverseOf', ax.InverseObjectProperties),
                ('EquivalentTo', lambda a, b: ax.EquivalentObjectProperties((a, b))),
                ('DisjointWith', lambda a, b: ax.DisjointObjectProperties((a, b))),
            )
        ),
        *(
            (f'DataProperty: d {word}: e', [record(D, f'{N}e')])
            for word, record in (
                ('SubPropertyOf', ax.SubDataPropertyOf),
                ('EquivalentTo', lambda a, b: ax.EquivalentDataProperties((a, b))),
                ('DisjointWith', lambda a, b: ax.DisjointDataProperties((a, b))),
            )
        ),
        *(
            (
                f'ObjectProperty: p Characteristics: {word}',
                [getattr(ax, f'{word}ObjectProperty')(P)],
            )
            for word in (
                'Functional',
                'InverseFunctional',
                'Reflexive',
                'Irreflexive',
                'Symmetric',
                'Asymmetric',
                'Transitive',
            )
        ),
        (
            'ObjectProperty: p Range: A Domain: B, C',
            [
                ax.ObjectPropertyRange(P, A),
                ax.ObjectPropertyDomain(P, B),
                ax.ObjectPropertyDomain(P, C),
            ],
        ),
        (
            'ObjectProperty: inverse p SubPropertyOf: o',
            [ax.SubObjectPropertyOf(ex.ObjectInverseOf(P), OBJ)],
        ),
        (
            'DataProperty: d Domain: A Range: xsd:int or {1}',
            [
                ax.DataPropertyDomain(D, A),
                ax.DataPropertyRange(
                    D, ex.DataUnionOf((XSD + 'int', ex.DataOneOf((Literal('1', INT),))))
                ),
            ],
        ),
        *(
            (f'AnnotationProperty: p {word}: o', [ax.AnnotationAssertion(RDFS + name, P, OBJ)])
            for word, name in (
                ('SubPropertyOf', 'subPropertyOf'),
                ('Domain', 'domain'),
                ('Range', 'range'),
            )
        ),
        (
            'Individual: i SameAs: j DifferentFrom: k',
            [
                ax.SameIndividual(frozenset((ONE, TWO))),
                ax.DifferentIndividuals(frozenset((ONE, f'{N}k'))),
            ],
        ),
        (
            'Individual: i Type: A Facts: inverse p j, not inverse p j',
            [
                ax.ClassAssertion(A, ONE),
                ax.ObjectPropertyAssertion(P, TWO, ONE),
                ax.NegativeObjectPropertyAssertion(P, TWO, ONE),
            ],
        ),
        (
            'Individual: i Facts: not d 5, p 5',
            [
                ax.NegativeDataPropertyAssertion(D, ONE, Literal('5', INT)),
                ax.DataPropertyAssertion(P, ONE, Literal('5', INT)),
            ],
        ),
        ('Individual: _:i Types: A', [ax.ClassAssertion(A, '_:i')]),
        ('EquivalentClasses: A, B', [ax.EquivalentClasses((A, B))]),
        ('EquivalentProperties: d, d', [ax.EquivalentDataProperties((D, D))]),
        ('EquivalentProperties: d, o', [ax.EquivalentObjectProperties((D, OBJ))]),
        (
            'DisjointProperties: o, inverse p',
            [ax.DisjointObjectProperties((OBJ, ex.ObjectInverseOf(P)))],
        ),
        ('SameIndividual: i, j', [ax.SameIndividual(frozenset((ONE, TWO)))]),
        ('DifferentIndividuals: i, j', [ax.DifferentIndividuals(frozenset((ONE, TWO)))]),
        ('DLSafeRule: A(?x) -> B(?x)', [ax.Rule((ex.ClassAtom(A, x),), (ex.ClassAtom(B, x),))]),
    ],
)
def test_a_frame_is_read_as_its_axioms(frame: str, axioms: list[ax.Axiom]) -> None:
    head = 'Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>\nOntology: <urn:o>\n'
    head += 'DataProperty: d ObjectProperty: o\n'
    document = read_ontology((head + frame).encode(), 'urn:base')
    found = [axiom for axiom in document.axioms if not isinstance(axiom, ax.Declaration)]
    assert found == axioms
    written = ontology_bytes(document.axioms, 'urn:o', 'manchester', {'': N})
    assert set(read_ontology(written, 'urn:base').axioms) >= set(axioms)


@pytest.mark.parametrize(
    ('frame', 'expected'),
    [
        ('ObjectProperty: p HasKey: A', 'expected a section of this frame, not HasKey:'),
        ('DataProperty: d InverseOf: e', 'expected a section of this frame, not InverseOf:'),
        ('AnnotationProperty: a Types: A', 'expected a section of this frame, not Types:'),
        ('Datatype: T SubClassOf: A', 'expected a section of this frame, not SubClassOf:'),
        ('Individual: i Domain: A', 'expected a section of this frame, not Domain:'),
        ('DataProperty: d Characteristics: Transitive', "expected 'Functional', got 'Transitive'"),
        ('Class: A Ontology: <urn:x>', 'expected no Ontology: here'),
        ('A', 'expected a frame such as Class: or Individual:'),
    ],
)
def test_a_wrong_frame_names_what_was_expected(frame: str, expected: str) -> None:
    with pytest.raises(OntologyFileError) as error:
        read_ontology(f'Ontology: <urn:o>\n{frame}'.encode(), 'urn:base')
    assert error.value.message.startswith(expected)
    assert error.value.line == 2


def test_only_what_needs_brackets_is_written_in_brackets() -> None:
    writer = ManchesterWriter({'': N})
    ones = ex.ObjectOneOf((f'{N}i', f'{N}j'))
    assert writer.expression(ones) == '{:i, :j}'
    some = ex.ObjectSomeValuesFrom(f'{N}p', ones)
    assert writer.expression(some) == '(:p some {:i, :j})'
    assert writer.expression(some, inner=False) == ':p some {:i, :j}'


def test_names_are_written_with_the_longest_prefix_or_in_full() -> None:
    prefixes = {'': N, 'n': f'{N}deep/', 'e': ''}
    writer, bare = ManchesterWriter(prefixes), ManchesterWriter(prefixes, bare=True)
    for iri, written, shortest in (
        (A, ':A', 'A'),
        (f'{N}deep/B', 'n:B', 'n:B'),
        (f'{N}some', ':some', '<urn:o#some>'),
        (f'{N}2', '<urn:o#2>', '<urn:o#2>'),
        (N, '<urn:o#>', '<urn:o#>'),
        ('_:b', '_:b', '_:b'),
        ('urn:x', '<urn:x>', '<urn:x>'),
        (XSD + 'int', 'xsd:int', 'xsd:int'),
    ):
        assert (writer.name(iri), bare.name(iri)) == (written, shortest)
    texts = [
        writer.literal(Literal(*each)) for each in (('a"\\',), ('a', RDF + 'langString', 'en'))
    ]
    assert texts == [r'"a\"\\"', '"a"@en']
    assert writer.literal(Literal('5', INT)) == '"5"^^xsd:integer'
