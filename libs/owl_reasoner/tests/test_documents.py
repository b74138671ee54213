"""Functional syntax, documents with ill-formed parts, and imports."""

from __future__ import annotations

from pathlib import Path

import pytest

from owl_reasoner import KnowledgeBase, OntologyFileError, read_ontology
from owl_reasoner.documents.catalogs import catalog_entries
from owl_reasoner.documents.reading import OntologyDocument
from owl_reasoner.documents.writing import ontology_bytes
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.expressions import Literal, Variable
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, THING, XSD

IRI = 'http://x/'
FUNCTIONAL = """
# A comment.
Prefix(:=<http://x/#>)
Prefix(xsd:=<http://www.w3.org/2001/XMLSchema#>)
Ontology(<http://x/> <http://x/1>
Declaration(Class(:A))
SubClassOf(Annotation(rdfs:comment "why \\"so\\""@EN) :A ObjectSomeValuesFrom(:p ObjectOneOf(:i)))
EquivalentClasses(:B ObjectIntersectionOf(:A ObjectMinCardinality(2 ObjectInverseOf(:p) :C)))
SubObjectPropertyOf(ObjectPropertyChain(:p :q) :r)
TransitiveObjectProperty(:r)
DataPropertyRange(:d DatatypeRestriction(xsd:integer xsd:minInclusive "1"^^xsd:integer))
HasKey(:A (:p) (:d))
NegativeDataPropertyAssertion(:d :i "5"^^xsd:long)
ObjectPropertyAssertion(ObjectInverseOf(:p) :i :j)
ClassAssertion(DataHasValue(:d "5"^^xsd:long) _:someone)
DifferentIndividuals(:i :j :k)
DLSafeRule(Body(ClassAtom(:A Variable(:x)) DataPropertyAtom(:d Variable(:x) Variable(:v)))
           Head(DataPropertyAtom(:e Variable(:x) Variable(:v))))
Nonsense(:A :B)
SubClassOf(:A ObjectSomeValuesFrom(:p))
)
"""


def test_functional_syntax_is_read() -> None:
    document = read_ontology(FUNCTIONAL.encode(), IRI)
    x = 'http://x/#'
    some = ax.SubClassOf(x + 'A', ex.ObjectSomeValuesFrom(x + 'p', ex.ObjectOneOf((x + 'i',))))
    note = Literal('why "so"', RDF + 'langString', 'en')
    counted = ex.ObjectMinCardinality(2, ex.ObjectInverseOf(x + 'p'), x + 'C')
    bound = (XSD + 'minInclusive', Literal('1', XSD + 'integer'))
    five = Literal('5', XSD + 'long')
    body = (
        ex.ClassAtom(x + 'A', Variable(x + 'x')),
        ex.DataPropertyAtom(x + 'd', Variable(x + 'x'), Variable(x + 'v')),
    )
    assert (document.format, document.iri) == ('functional', IRI)
    assert document.axioms == [
        ax.AnnotationAssertion(OWL + 'versionIRI', IRI, 'http://x/1'),
        ax.Declaration('class', x + 'A'),
        some,
        ax.AxiomAnnotation(some, ((RDFS + 'comment', note),)),
        ax.EquivalentClasses((x + 'B', ex.ObjectIntersectionOf((x + 'A', counted)))),
        ax.SubPropertyChainOf((x + 'p', x + 'q'), x + 'r'),
        ax.TransitiveObjectProperty(x + 'r'),
        ax.DataPropertyRange(x + 'd', ex.DatatypeRestriction(XSD + 'integer', (bound,))),
        ax.HasKey(x + 'A', (x + 'p',), (x + 'd',)),
        ax.NegativeDataPropertyAssertion(x + 'd', x + 'i', five),
        ax.ObjectPropertyAssertion(x + 'p', x + 'j', x + 'i'),
        ax.ClassAssertion(ex.DataHasValue(x + 'd', five), '_:someone'),
        ax.DifferentIndividuals(frozenset((x + 'i', x + 'j', x + 'k'))),
        ax.Rule(body, (ex.DataPropertyAtom(x + 'e', Variable(x + 'x'), Variable(x + 'v')),)),
    ]
    unknown, incomplete = document.unsupported
    assert unknown == 'line 19: Nonsense is not understood'
    assert incomplete.startswith('line 20: SubClassOf is not understood: expected 2 parts')


@pytest.mark.parametrize(
    ('text', 'place', 'words'),
    [
        ('Ontology(<x> SubClassOf(:A :B))', (1, 25), "prefix of ':A' is not declared"),
        ('Prefix(:=<x>)\nOntology(<x> SubClassOf(:A', (2, 27), 'ends inside'),
        ('Ontology(<x> SubClassOf(] :A))', (1, 25), 'prefix of'),
        ('Ontology(<x> "text)', (1, 14), 'unexpected'),
    ],
)
def test_errors_in_functional_syntax_name_their_place(
    text: str, place: tuple[int, int], words: str
) -> None:
    with pytest.raises(OntologyFileError) as caught:
        read_ontology(text.encode(), IRI)
    assert (caught.value.line, caught.value.column) == place
    assert words in str(caught.value)


HEAD = (
    '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"'
    ' xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"'
    ' xmlns:owl="http://www.w3.org/2002/07/owl#" xml:base="http://x/">\n'
)


def test_an_ill_formed_restriction_costs_its_axiom_alone() -> None:
    text = (
        HEAD + '<owl:Class rdf:ID="A"><rdfs:subClassOf rdf:resource="#B"/>\n'
        '<rdfs:subClassOf><owl:Restriction><owl:onProperty rdf:resource="#p"/>\n'
        '</owl:Restriction></rdfs:subClassOf></owl:Class></rdf:RDF>'
    )
    document = read_ontology(text.encode(), IRI)
    assert ax.SubClassOf('http://x/#A', 'http://x/#B') in document.axioms
    (sentence,) = document.unsupported
    assert 'line 3: a statement about A is left out: restriction on p states nothing' in sentence


def test_a_negative_assertion_needs_no_type() -> None:
    text = (
        HEAD + '<rdf:Description><owl:sourceIndividual rdf:resource="#i"/>\n'
        '<owl:assertionProperty rdf:resource="#p"/>'
        '<owl:targetIndividual rdf:resource="#j"/></rdf:Description></rdf:RDF>'
    )
    document = read_ontology(text.encode(), IRI)
    x = 'http://x/#'
    assert document.axioms == [ax.NegativeObjectPropertyAssertion(x + 'p', x + 'i', x + 'j')]


def test_a_restriction_with_a_name_defines_it() -> None:
    text = (
        HEAD + '<owl:Class rdf:ID="A"><owl:onProperty rdf:resource="#p"/>'
        '<owl:someValuesFrom rdf:resource="http://www.w3.org/2002/07/owl#Thing"/></owl:Class>'
        '</rdf:RDF>'
    )
    document = read_ontology(text.encode(), IRI)
    definition = ex.ObjectSomeValuesFrom('http://x/#p', THING)
    assert ax.EquivalentClasses(('http://x/#A', definition)) in document.axioms


def test_imports_of_files_beside_the_document_are_followed(tmp_path: Path) -> None:
    def written(name: str, body: str) -> Path:
        path = tmp_path / name
        path.write_text(f'Prefix(:=<http://x/#>)\nOntology(<http://x/{name}>\n{body})')
        return path

    written('upper.ofn', 'Import(<http://x/main>) SubClassOf(:B :C)')
    main = written('main.ofn', 'Import(<http://x/upper>) Import(<http://y/away>) SubClassOf(:A :B)')
    document = read_ontology(main, IRI)
    assert document.unsupported == [
        'owl:imports <http://y/away> is not followed: no such file beside the document'
    ]
    kb = KnowledgeBase(IRI, document.axioms)
    kb.reason()
    assert kb.superclasses('http://x/#A') == {'http://x/#B', 'http://x/#C'}


@pytest.mark.parametrize('axiom', ['Declaration(:A)', 'DLSafeRule(Body(:A) Head())'])
def test_an_axiom_with_a_name_for_a_construct_costs_itself_alone(axiom: str) -> None:
    text = f'Prefix(:=<http://x/#>)\nOntology(<http://x/>\n{axiom}\nSubClassOf(:A :B))'
    document = read_ontology(text.encode(), IRI)
    assert document.axioms == [ax.SubClassOf('http://x/#A', 'http://x/#B')]
    assert ['line 3: ' in sentence for sentence in document.unsupported] == [True]


TURTLE = """@prefix : <http://x/#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdf: <http://www.w3.org/1999/02/22-rdf-syntax-ns#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> .
@prefix xsd: <http://www.w3.org/2001/XMLSchema#> . <http://x/> a owl:Ontology .
"""


def read_turtle(text: str) -> OntologyDocument:
    return read_ontology((TURTLE + text).encode(), IRI)


def test_an_undeclared_property_is_what_its_values_and_ranges_say() -> None:
    document = read_turtle(
        ':place a rdf:Property ; rdfs:range :Room , xsd:string . :near a rdf:Property .\n'
        ':width a rdf:Property ; rdfs:range xsd:integer .\n'
        ':deep a rdf:Property ; rdfs:subPropertyOf :depth .\n'
        ':size a owl:DatatypeProperty . :depth a rdf:Property ; rdfs:subPropertyOf :size .\n'
        ':i :place :hall , "the hall" ; :said "yes" , :j .'
    )
    x = 'http://x/#'
    assert document.unsupported == []
    kinds = {(a.iri, a.kind) for a in document.axioms if isinstance(a, ax.Declaration)}
    assert kinds == {
        (x + 'place', 'data_property'),
        (x + 'place', 'object_property'),
        (x + 'near', 'object_property'),
        (x + 'width', 'data_property'),
        (x + 'size', 'data_property'),
        (x + 'depth', 'data_property'),
        (x + 'deep', 'data_property'),
    }
    for axiom in (
        ax.ObjectPropertyRange(x + 'place', x + 'Room'),
        ax.DataPropertyRange(x + 'place', XSD + 'string'),
        ax.ObjectPropertyAssertion(x + 'place', x + 'i', x + 'hall'),
        ax.SubDataPropertyOf(x + 'depth', x + 'size'),
        ax.SubDataPropertyOf(x + 'deep', x + 'depth'),
        ax.DataPropertyAssertion(x + 'said', x + 'i', Literal('yes')),
        ax.ObjectPropertyAssertion(x + 'said', x + 'i', x + 'j'),
    ):
        assert axiom in document.axioms


def test_an_object_property_is_below_no_data_property_and_stays_what_it_is() -> None:
    text = (
        '<http://x/> a owl:Ontology ; :license "free" .\n'
        ':license a owl:ObjectProperty ; rdfs:subPropertyOf :about .\n'
        ':about a owl:DatatypeProperty .'
    )
    document = read_turtle(text)
    assert document.unsupported == [
        'a statement about license is left out: subPropertyOf of an object property and a data'
        ' property, license and about'
    ]
    again = read_ontology(ontology_bytes(document.axioms, 'http://x/'), IRI)
    assert set(again.axioms) == set(document.axioms)
    assert again.unsupported == []


def test_what_has_no_name_keeps_its_annotations_or_says_so() -> None:
    document = read_turtle(
        '[] a :Robot ; rdfs:label "someone" .\n'
        ':A rdfs:subClassOf [ owl:unionOf ( :B :C ) ; rdfs:comment "either" ] .\n'
        ':old a owl:DeprecatedClass . :i a "5"^^xsd:int .'
    )
    notes = {a.prop: a.value for a in document.axioms if isinstance(a, ax.AnnotationAssertion)}
    assert notes == {
        RDFS + 'label': Literal('someone'),
        'http://www.w3.org/2002/07/owl#deprecated': Literal('true', XSD + 'boolean'),
    }
    assert document.unsupported == [
        'comment of what has no name is not kept',
        "a statement about i is left out: its type is the literal '5'",
    ]


def test_a_header_without_a_name_is_no_name() -> None:
    text = '@prefix owl: <http://www.w3.org/2002/07/owl#> . [] a owl:Ontology ; owl:versionInfo 2 .'
    document = read_ontology(text.encode(), IRI)
    assert (document.iri, document.unsupported) == ('', [])
    (said,) = document.axioms
    assert isinstance(said, ax.AnnotationAssertion)
    assert said.subject == IRI


@pytest.mark.parametrize(
    'text',
    [
        '<http://x/##i> <http://x/##p> <http://x/##j> .\n<http://x/##i> <http://x/##q> 1 ;\n'
        ' <http://x/##q> 2 .',
        '@prefix : <http://x/##> . :i :p :j ; :q 1 , 2 .',
    ],
)
def test_turtle_that_begins_as_n_triples_do_and_names_that_are_no_iris(text: str) -> None:
    document = read_ontology(text.encode(), IRI)
    x, integer = 'http://x/##', XSD + 'integer'
    assert document.format == 'turtle'
    assert document.axioms == [
        ax.ObjectPropertyAssertion(x + 'p', x + 'i', x + 'j'),
        ax.DataPropertyAssertion(x + 'q', x + 'i', Literal('1', integer)),
        ax.DataPropertyAssertion(x + 'q', x + 'i', Literal('2', integer)),
    ]


def test_a_header_has_values_of_declared_properties() -> None:
    document = read_turtle(
        ':about a owl:ObjectProperty ; rdfs:range :Place . :since a owl:DatatypeProperty .\n'
        '<http://x/> :about :Hall , "rooms" ; :since 2020 , :now ; :by "me" .'
    )
    x = 'http://x/#'
    assert [axiom for axiom in document.axioms if hasattr(axiom, 'subject')] == [
        ax.ObjectPropertyAssertion(x + 'about', 'http://x/', x + 'Hall'),
        ax.AnnotationAssertion(x + 'about', 'http://x/', Literal('rooms')),
        ax.DataPropertyAssertion(x + 'since', 'http://x/', Literal('2020', XSD + 'integer')),
        ax.AnnotationAssertion(x + 'since', 'http://x/', x + 'now'),
        ax.AnnotationAssertion(x + 'by', 'http://x/', Literal('me')),
    ]
    assert document.unsupported == []
    kb = KnowledgeBase(IRI, document.axioms)
    kb.reason()
    assert kb.instances(x + 'Place') == {x + 'Hall'}
    again = read_ontology(ontology_bytes(document.axioms, 'http://x/', 'rdfxml'), 'http://x/')
    assert set(again.axioms) >= set(document.axioms)


@pytest.mark.parametrize('form', ['rdfxml', 'ntriples', 'nquads'])
def test_a_value_stays_one_where_the_header_has_its_property_too(form: str) -> None:
    text = '<http://x/> :title "Rooms" . :i :title "Hall" .'
    axioms = read_turtle(text).axioms
    again = read_ontology(ontology_bytes(axioms, IRI, form), IRI).axioms
    assert set(axioms) <= set(again)
    assert ax.DataPropertyAssertion('http://x/#title', 'http://x/#i', Literal('Hall')) in again


def test_what_an_import_declares_holds_in_the_document_that_imports_it(tmp_path: Path) -> None:
    main, upper = tmp_path / 'main.ttl', tmp_path / 'upper.ttl'
    upper.write_text(
        TURTLE.replace('<http://x/>', '<http://x/upper>')
        + ':size a owl:DatatypeProperty . :note a owl:AnnotationProperty .\n'
        '_:b a :Wheel .'
    )
    main.write_text(
        TURTLE + '<http://x/> owl:imports <http://x/upper> . :height rdfs:subPropertyOf :size .\n'
        ':A rdfs:subClassOf [ owl:onProperty :size ; owl:maxCardinality 1 ] .\n'
        ':i :note "new" . _:b a :Door .'
    )
    document = read_ontology(main, IRI)
    x = 'http://x/#'
    for axiom in (
        ax.SubDataPropertyOf(x + 'height', x + 'size'),
        ax.SubClassOf(x + 'A', ex.DataMaxCardinality(1, x + 'size', RDFS + 'Literal')),
        ax.AnnotationAssertion(x + 'note', x + 'i', Literal('new')),
    ):
        assert axiom in document.axioms
    assert document.unsupported == []


def test_individuals_without_a_name_of_two_documents_are_two(tmp_path: Path) -> None:
    def written(name: str, body: str) -> Path:
        path = tmp_path / name
        path.write_text(f'Prefix(:=<http://x/#>)\nOntology(<http://x/{name}>\n{body})')
        return path

    written('upper.ofn', 'ClassAssertion(:Wheel _:b)')
    main = written('main.ofn', 'Import(<http://x/upper>) ClassAssertion(:Door _:b)')
    kinds = [a for a in read_ontology(main, IRI).axioms if isinstance(a, ax.ClassAssertion)]
    assert len({axiom.individual for axiom in kinds}) == len(kinds) == 2


@pytest.mark.parametrize(
    ('base', 'reference', 'iri'),
    [
        ('http://x/onto', '#A', 'http://x/onto#A'),
        ('http://x/onto#', 'A', 'http://x/onto#A'),
        ('http://x/onto#', '#A', 'http://x/onto#A'),
        ('http://x/onto', '/A', 'http://x/onto/A'),
        ('http://x/onto/', 'A', 'http://x/onto/A'),
        ('http://x/onto/', '../A', 'http://x/A'),
        ('http://x/onto#', 'urn:a:A', 'urn:a:A'),
    ],
)
def test_names_in_owl_xml_are_those_that_the_owl_api_shortened(
    base: str, reference: str, iri: str
) -> None:
    text = (
        f'<Ontology xmlns="http://www.w3.org/2002/07/owl#" xml:base="{base}" ontologyIRI="{base}">'
        f'<SubClassOf><Class IRI="{reference}"/><Class IRI="http://x/B"/></SubClassOf></Ontology>'
    )
    assert read_ontology(text.encode(), IRI).axioms == [ax.SubClassOf(iri, 'http://x/B')]


ENTITY = """<?xml version="1.0"?>
<!DOCTYPE rdf:RDF [ <!ENTITY q "http://ex.org/o#a&amp;b/" > ]>
<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"
  xmlns:owl="http://www.w3.org/2002/07/owl#"><owl:Class rdf:about="&q;X"/></rdf:RDF>"""


def test_an_entity_may_hold_an_escaped_ampersand_and_no_other_entity() -> None:
    found = read_ontology(ENTITY.encode(), 'urn:o').axioms
    assert list(found) == [ax.Declaration('class', 'http://ex.org/o#a&b/X')]
    for value in ('&r;', '&amp;&r;', '&#x26;r;', '&lt;&r;'):
        bomb = ENTITY.replace('http://ex.org/o#a&amp;b/', value)
        with pytest.raises(OntologyFileError, match='entity'):
            read_ontology(bomb.replace('[ ', '[ <!ENTITY r "x"> ').encode(), 'urn:o')


def test_a_datatype_of_owl_1_is_declared() -> None:
    text = ENTITY.replace(
        '<owl:Class rdf:about="&q;X"/>',
        '<owl:Datatype rdf:about="http://www.w3.org/2001/XMLSchema#double"/>'
        '<owl:Datatype rdf:about="http://ex.org/o#level"/>',
    )
    document = read_ontology(text.encode(), 'urn:o')
    assert document.unsupported == []
    assert ax.Declaration('datatype', 'http://ex.org/o#level') in document.axioms


CATALOG_TEXT = """<?xml version="1.0" encoding="UTF-8" standalone="no"?>
<catalog prefer="public" xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog">
  <uri id="User Entered" name="http://ex.org/away" uri="elsewhere/near%20by.ofn"/>
  <group id="Folder Repository" prefer="public" xml:base="elsewhere">
    <uri id="x" name="http://ex.org/grouped" uri="grouped.ofn"/>
    <uri id="y" name="http://ex.org/web" uri="http://ex.org/web.owl"/>
  </group>
</catalog>"""


def test_imports_are_found_in_a_catalog_and_in_packages(tmp_path: Path) -> None:
    folder = tmp_path / 'maps' / 'owl'
    (folder / 'elsewhere').mkdir(parents=True)
    (tmp_path / 'upper' / 'owl').mkdir(parents=True)
    (folder / 'catalog-v001.xml').write_text(CATALOG_TEXT)
    imported = {
        'http://ex.org/away': folder / 'elsewhere' / 'near by.ofn',
        'http://ex.org/grouped': folder / 'elsewhere' / 'grouped.ofn',
        'package://maps/owl/own.ofn': folder / 'own.ofn',
        'package://upper/owl/top.ofn': tmp_path / 'upper' / 'owl' / 'top.ofn',
    }
    for number, path in enumerate(imported.values()):
        path.write_text(f'Ontology(Declaration(Class(<urn:c{number}>)))')
    imports = ' '.join(f'Import(<{iri}>)' for iri in (*imported, 'http://ex.org/web'))
    (folder / 'map.ofn').write_text(f'Ontology(<urn:map> {imports})')
    document = read_ontology(folder / 'map.ofn', 'urn:map')
    declared = {axiom.iri for axiom in document.axioms if isinstance(axiom, ax.Declaration)}
    assert declared == {f'urn:c{number}' for number in range(len(imported))}
    (note,) = document.unsupported
    assert note.startswith('owl:imports <http://ex.org/web> is not followed')
    (folder / 'catalog-v001.xml').write_text('no XML')
    assert len(read_ontology(folder / 'map.ofn', 'urn:map').unsupported) == 3


@pytest.mark.parametrize(('depth', 'is_found'), [(0, True), (6, True), (7, False)])
def test_a_package_is_looked_for_so_many_folders_above(
    tmp_path: Path, depth: int, is_found: bool
) -> None:
    folder = tmp_path.joinpath(*'abcdefg'[:depth])
    folder.mkdir(parents=True, exist_ok=True)
    (tmp_path / 'maps').mkdir()
    (tmp_path / 'maps' / 'upper.ofn').write_text('Ontology(Declaration(Class(<urn:c>)))')
    (folder / 'map.ofn').write_text('Ontology(<urn:map> Import(<package://maps/upper.ofn>))')
    document = read_ontology(folder / 'map.ofn', 'urn:map')
    assert any(isinstance(axiom, ax.Declaration) for axiom in document.axioms) is is_found
    assert bool(document.unsupported) is not is_found


def test_a_catalog_leads_to_files_by_its_uri_entries_alone(tmp_path: Path) -> None:
    catalog = tmp_path / 'catalog-v001.xml'
    catalog.write_text(
        '<catalog xmlns="urn:oasis:names:tc:entity:xmlns:xml:catalog" xmlns:o="urn:other">'
        '<uri uri="lost.ofn"/><uri name="empty"/>'
        '<uri name="twice" uri="first.ofn"/><uri name="twice" uri="second.ofn"/>'
        '<o:uri name="other" uri="o.ofn"/><public name="public" uri="p.ofn"/>'
        '<group xml:base="in/"><uri name="grouped" uri="g%20g.ofn"/>'
        '<group xml:base="er"><uri name="deeper" uri="d.ofn" xml:base="own/"/></group>'
        '<uri name="after" uri="a.ofn"/></group>'
        '<group xml:base="http://y/"><uri name="of the web" uri="w.ofn"/>'
        '<uri name="of the disk" uri="file:///z/d.ofn"/></group>'
        '<uri name="last" uri="l.ofn"/><uri name="away" uri="http://y/a.ofn"/></catalog>'
    )
    assert catalog_entries(catalog) == {
        'twice': tmp_path / 'first.ofn',
        'grouped': tmp_path / 'in' / 'g g.ofn',
        'deeper': tmp_path / 'in' / 'er' / 'own' / 'd.ofn',
        'after': tmp_path / 'in' / 'a.ofn',
        'of the disk': Path('/z/d.ofn'),
        'last': tmp_path / 'l.ofn',
    }


def test_a_catalog_has_a_largest_size(tmp_path: Path) -> None:
    catalog = tmp_path / 'catalog-v001.xml'
    catalog.write_bytes(b'<a/>'.ljust(1 << 20))
    assert catalog_entries(catalog) == {}
    catalog.write_bytes(b'<a/>'.ljust((1 << 20) + 1))
    with pytest.raises(OntologyFileError, match='larger than 1048576 bytes'):
        catalog_entries(catalog)


def read_functional(*lines: str) -> OntologyDocument:
    head = f'Prefix(:=<x:>)\nPrefix(xsd:=<{XSD}>)\nPrefix(rdfs:=<{RDFS}>)\nOntology(<{IRI}>\n'
    return read_ontology((head + '\n'.join(lines) + ')').encode(), IRI)


@pytest.mark.parametrize(
    ('text', 'axiom'),
    [
        (
            'SubClassOf(:A ObjectMinCardinality(2 :p))',
            ax.SubClassOf('x:A', ex.ObjectMinCardinality(2, 'x:p', THING)),
        ),
        (
            'SubClassOf(ObjectMaxCardinality(0 :p :B) DataExactCardinality(1 :d xsd:int))',
            ax.SubClassOf(
                ex.ObjectMaxCardinality(0, 'x:p', 'x:B'),
                ex.DataExactCardinality(1, 'x:d', XSD + 'int'),
            ),
        ),
        ('SubClassOf(:A ObjectOneOf(:i))', ax.SubClassOf('x:A', ex.ObjectOneOf(('x:i',)))),
        (
            'SubClassOf(:A DataSomeValuesFrom(:d DataOneOf("1")))',
            ax.SubClassOf('x:A', ex.DataSomeValuesFrom('x:d', ex.DataOneOf((Literal('1'),)))),
        ),
        ('DisjointUnion(:A :B :C)', ax.DisjointUnion('x:A', ('x:B', 'x:C'))),
        (
            'SubObjectPropertyOf(ObjectPropertyChain(:p ObjectInverseOf(:q)) :r)',
            ax.SubPropertyChainOf(('x:p', ex.ObjectInverseOf('x:q')), 'x:r'),
        ),
        (
            'SubObjectPropertyOf(ObjectInverseOf(:p) :q)',
            ax.SubObjectPropertyOf(ex.ObjectInverseOf('x:p'), 'x:q'),
        ),
        (
            'ObjectPropertyAssertion(ObjectInverseOf(ObjectInverseOf(:p)) :i :j)',
            ax.ObjectPropertyAssertion('x:p', 'x:i', 'x:j'),
        ),
        (
            'NegativeObjectPropertyAssertion(ObjectInverseOf(:p) :i :j)',
            ax.NegativeObjectPropertyAssertion('x:p', 'x:j', 'x:i'),
        ),
        (
            'HasKey(:A (:p ObjectInverseOf(:q)) (:d :e))',
            ax.HasKey('x:A', ('x:p', ex.ObjectInverseOf('x:q')), ('x:d', 'x:e')),
        ),
        (
            'SubAnnotationPropertyOf(:n :m)',
            ax.AnnotationAssertion(RDFS + 'subPropertyOf', 'x:n', 'x:m'),
        ),
        (
            'Annotation(rdfs:comment "c")',
            ax.AnnotationAssertion(RDFS + 'comment', IRI, Literal('c')),
        ),
        (
            'DataPropertyRange(:d DatatypeRestriction(xsd:int xsd:minInclusive "1"^^xsd:int'
            ' xsd:maxExclusive "3"^^xsd:int))',
            ax.DataPropertyRange(
                'x:d',
                ex.DatatypeRestriction(
                    XSD + 'int',
                    (
                        (XSD + 'minInclusive', Literal('1', XSD + 'int')),
                        (XSD + 'maxExclusive', Literal('3', XSD + 'int')),
                    ),
                ),
            ),
        ),
        (
            'DLSafeRule(Annotation(rdfs:label "r") Body(BuiltInAtom(:add Variable(:x) "1"))'
            ' Head(DifferentIndividualsAtom(Variable(:x) :i)))',
            ax.Rule(
                (ex.BuiltinAtom('x:add', (Variable('x:x'), Literal('1'))),),
                (ex.DifferentIndividualsAtom(Variable('x:x'), 'x:i'),),
                ((RDFS + 'label', Literal('r')),),
            ),
        ),
    ],
)
def test_a_construct_of_functional_syntax_is_one_axiom(text: str, axiom: ax.Axiom) -> None:
    document = read_functional(text)
    assert document.axioms == [axiom]
    assert document.unsupported == []


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('SubClassOf(:A ObjectMinCardinality(2))', 'expected 2 or 3 parts, got 1'),
        ('SubClassOf(:A ObjectMinCardinality(2 :p :B :C))', 'expected 2 or 3 parts, got 4'),
        ('SubClassOf(:A ObjectSomeValuesFrom(:p))', 'expected 2 parts, got 1'),
        ('SubClassOf(:A)', 'expected 2 parts, got 1'),
        ('SubClassOf(:A ObjectIntersectionOf(:B))', 'expected at least 2 parts, got 1'),
        ('SubClassOf(:A ObjectOneOf())', 'expected at least 1 parts, got 0'),
        ('EquivalentClasses(:A)', 'expected at least 2 parts, got 1'),
        ('DisjointUnion(:A :B)', 'expected at least 2 parts, got 1'),
        ('SubObjectPropertyOf(ObjectPropertyChain(:p) :q)', 'expected at least 2 parts, got 1'),
        ('Declaration(Class(:A :B))', 'expected 1 parts, got 2'),
        ('ObjectPropertyAssertion(:p :i)', 'expected 3 parts, got 2'),
        ('SubClassOf(:A DataHasValue(:d :i))', 'expected a literal, got x:i'),
        ('SubClassOf(:A ObjectUnionOf(:B DataOneOf("1")))', 'DataOneOf is no class'),
        ('SubClassOf(:A ObjectSomeValuesFrom("p" :B))', "expected an IRI, got Literal(lexical='p'"),
        ('SubClassOf(:A DataMinCardinality("2" :d))', "expected a number, got Literal(lexical='2'"),
        ('DataPropertyRange(:d DatatypeRestriction(xsd:int xsd:minInclusive))', 'its parts'),
    ],
)
def test_an_ill_formed_construct_of_functional_syntax_says_what_was_expected(
    text: str, reason: str
) -> None:
    document = read_functional(text, 'SubClassOf(:A :B)')
    assert document.axioms == [ax.SubClassOf('x:A', 'x:B')]
    (said,) = document.unsupported
    assert said.startswith(f'line 5: {text.split("(")[0]} is not understood: {reason}')


def test_an_annotation_on_an_annotation_is_reported_and_the_outer_one_kept() -> None:
    document = read_functional('SubClassOf(Annotation(Annotation(:n "y") rdfs:label "r") :A :B)')
    axiom = ax.SubClassOf('x:A', 'x:B')
    note = ax.AxiomAnnotation(axiom, ((RDFS + 'label', Literal('r')),))
    assert document.axioms == [axiom, note]
    assert document.unsupported == ['line 5: an annotation on an annotation is not kept']


@pytest.mark.parametrize(
    ('statement', 'report'),
    [
        (':d rdfs:subPropertyOf [ owl:inverseOf :e ]', 'expected the name of a data property'),
        ('[ owl:inverseOf :e ] rdfs:subPropertyOf :d', 'expected the name of a data property'),
        (':d owl:equivalentProperty [ owl:inverseOf :e ]', 'expected the name of a data property'),
        ('[] owl:disjointUnionOf (:A :B)', 'a node without a name cannot be defined'),
    ],
)
def test_what_needs_a_name_and_has_none_is_left_out_and_reported(
    statement: str, report: str
) -> None:
    document = read_turtle(f':d a owl:DatatypeProperty . {statement} .')
    assert document.axioms == [ax.Declaration('data_property', 'http://x/#d')]
    (said,) = document.unsupported
    assert said.startswith('a statement about ')
    assert said.endswith(f' is left out: {report}')


@pytest.mark.parametrize(
    ('text', 'axiom'),
    [
        (
            '[ owl:inverseOf :q ] owl:propertyDisjointWith :p',
            ax.DisjointObjectProperties((ex.ObjectInverseOf('http://x/#q'), 'http://x/#p')),
        ),
        (
            ':U owl:disjointUnionOf (:A :B)',
            ax.DisjointUnion('http://x/#U', ('http://x/#A', 'http://x/#B')),
        ),
        (
            ':K owl:oneOf (:i :j)',
            ax.EquivalentClasses(
                ('http://x/#K', ex.ObjectOneOf(('http://x/#i', 'http://x/#j'))),
            ),
        ),
        (
            ':N a rdfs:Datatype ; owl:oneOf (1 2)',
            ax.DatatypeDefinition(
                'http://x/#N',
                ex.DataOneOf((Literal('1', XSD + 'integer'), Literal('2', XSD + 'integer'))),
            ),
        ),
        (':p rdfs:domain :A', ax.ObjectPropertyDomain('http://x/#p', 'http://x/#A')),
        (':p rdfs:range :A', ax.ObjectPropertyRange('http://x/#p', 'http://x/#A')),
        (':d rdfs:domain :A', ax.DataPropertyDomain('http://x/#d', 'http://x/#A')),
        (':d rdfs:range xsd:int', ax.DataPropertyRange('http://x/#d', XSD + 'int')),
        (':d rdfs:subPropertyOf :e', ax.SubDataPropertyOf('http://x/#d', 'http://x/#e')),
        (':p rdfs:subPropertyOf :q', ax.SubObjectPropertyOf('http://x/#p', 'http://x/#q')),
        (
            ':p owl:propertyChainAxiom ( :p [ owl:inverseOf :q ] )',
            ax.SubPropertyChainOf(
                ('http://x/#p', ex.ObjectInverseOf('http://x/#q')), 'http://x/#p'
            ),
        ),
        (
            '[ owl:propertyChain (:p :q) ] rdfs:subPropertyOf :p',
            ax.SubPropertyChainOf(('http://x/#p', 'http://x/#q'), 'http://x/#p'),
        ),
        (':p owl:inverseOf :q', ax.InverseObjectProperties('http://x/#p', 'http://x/#q')),
    ],
)
def test_a_statement_of_rdf_is_one_axiom(text: str, axiom: ax.Axiom) -> None:
    kinds = ':d a owl:DatatypeProperty . :p a owl:ObjectProperty . :q a owl:ObjectProperty .\n'
    document = read_turtle(f'{kinds}{text} .')
    stated = [each for each in document.axioms if not isinstance(each, ax.Declaration)]
    assert stated == [axiom]
    assert document.unsupported == []
