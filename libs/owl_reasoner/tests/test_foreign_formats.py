"""Documents as other tools write them: read right, or refused in one line, in every format."""

from __future__ import annotations

import pytest

from owl_reasoner.documents.reading import FORMATS, read_ontology
from owl_reasoner.documents.writing import ontology_bytes
from owl_reasoner.documents.xml_reading import OntologyFileError
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex

IRI = 'http://example.org/place'
XSD = 'http://www.w3.org/2001/XMLSchema#'
OWL_XML = f"""<?xml version="1.0"?>
<Ontology xmlns="http://www.w3.org/2002/07/owl#" xml:base="{IRI}" ontologyIRI="{IRI}">
  <Declaration><Class IRI="#ROOM"/></Declaration>
  <Declaration><DataProperty IRI="#visitedAt"/></Declaration>
  <SubClassOf><Class IRI="#ROOM"/><Class IRI="#LOCATION"/></SubClassOf>
  <ClassAssertion><Class IRI="#ROOM"/><NamedIndividual IRI="#R1"/></ClassAssertion>
  <DataPropertyAssertion>
    <DataProperty IRI="#visitedAt"/><NamedIndividual IRI="#R1"/>
    <Literal datatypeIRI="{XSD}long">5</Literal>
  </DataPropertyAssertion>
</Ontology>
"""
TURTLE = f"""# a place
@prefix : <{IRI}#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .
@prefix rdfs: <http://www.w3.org/2000/01/rdf-schema#> . @prefix xsd: <{XSD}> .
<{IRI}> a owl:Ontology .
:ROOM a owl:Class ; rdfs:subClassOf :LOCATION . :LOCATION a owl:Class .
:visitedAt a owl:DatatypeProperty .
:R1 a owl:NamedIndividual , :ROOM ; :visitedAt "5"^^xsd:long .
"""


@pytest.mark.parametrize(('text', 'form'), [(OWL_XML, 'owlxml'), (TURTLE, 'turtle')])
def test_axioms_are_read_with_exact_datatypes(text, form):
    document = read_ontology(text.encode(), IRI)
    assert (document.format, document.iri, document.unsupported) == (form, IRI, [])
    assert ax.SubClassOf(f'{IRI}#ROOM', f'{IRI}#LOCATION') in document.axioms
    assert ax.ClassAssertion(f'{IRI}#ROOM', f'{IRI}#R1') in document.axioms
    five = ex.Literal('5', f'{XSD}long')
    assert ax.DataPropertyAssertion(f'{IRI}#visitedAt', f'{IRI}#R1', five) in document.axioms


@pytest.mark.parametrize(
    ('text', 'line', 'complaint'),
    [
        (OWL_XML[:300], 5, 'not well-formed XML'),
        (
            OWL_XML.replace('?>', '?>\n<!DOCTYPE o [<!ENTITY a "&#38;b;">]>', 1),
            2,
            "entity 'a' is refused",
        ),
        (OWL_XML.replace('Class IRI="#ROOM"', 'Class abbreviatedIRI="x:R"', 1), 3, "of 'x:R'"),
        (OWL_XML.replace('IRI="#LOCATION"', ''), 5, 'Class lacks its attribute IRI'),
        (OWL_XML.replace('<Decl', '<x xmlns="http://x/"/><Decl', 1), 3, 'is not of OWL/XML'),
        (TURTLE.replace('"5"', ';;'), 7, 'not Turtle'),
        ('@prefix : <a\nb .\n', 1, 'not Turtle: Unexpected end of file'),
    ],
)
def test_broken_document_names_its_place(text, line, complaint, capfd):
    with pytest.raises(OntologyFileError, match=complaint) as error:
        read_ontology(text.encode(), IRI)
    assert error.value.line == line
    assert '\n' not in str(error.value)
    assert capfd.readouterr().err == ''


HEAD = f"""<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xml:base="{IRI}"
 xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#" xmlns:owl="http://www.w3.org/2002/07/owl#"
 xmlns="{IRI}#">"""


def rdf(body):
    return f'{HEAD}\n{body}</rdf:RDF>'


def owl_xml(body):
    return OWL_XML.replace('</Ontology>', body + '</Ontology>')


A, B = f'{IRI}#A', f'{IRI}#B'
SAID = (
    '<owl:Class rdf:about="#A"><rdfs:subClassOf><owl:{0}>{1}</owl:{0}></rdfs:subClassOf>'
    '</owl:Class>'
)
ON_P = '<owl:onProperty rdf:resource="#p"/>'


@pytest.mark.parametrize(
    ('text', 'axiom'),
    [
        (
            rdf('<owl:Class rdf:about="#Größe"/>').encode('utf-16'),
            ax.Declaration('class', f'{IRI}#Größe'),
        ),
        (
            b'<?xml version="1.0" encoding="gbk"?>'
            + rdf(
                '<A rdf:about="#i"><rdfs:label rdf:parseType="Literal">日<b/></rdfs:label></A>'
            ).encode('gbk'),
            ax.AnnotationAssertion(
                'http://www.w3.org/2000/01/rdf-schema#label',
                f'{IRI}#i',
                ex.Literal('日<b/>', 'http://www.w3.org/1999/02/22-rdf-syntax-ns#XMLLiteral'),
            ),
        ),
        (
            rdf(
                SAID.format(
                    'Restriction',
                    '<owl:onProperty><rdf:Description><owl:inverseOf>'
                    '<rdf:Description><owl:inverseOf rdf:resource="#p"/></rdf:Description>'
                    '</owl:inverseOf></rdf:Description></owl:onProperty>'
                    '<owl:someValuesFrom rdf:resource="#B"/>',
                )
            ),
            ax.SubClassOf(A, ex.ObjectSomeValuesFrom(f'{IRI}#p', B)),
        ),
        (f'<{A}> a <http://www.w3.org/2002/07/owl#Class> .', ax.Declaration('class', A)),
        ('# x\n' * 2000 + TURTLE, ax.SubClassOf(f'{IRI}#ROOM', f'{IRI}#LOCATION')),
        (TURTLE.encode('utf-16'), ax.SubClassOf(f'{IRI}#ROOM', f'{IRI}#LOCATION')),
        (
            f'{{"@id": "{A}", "@type": "http://www.w3.org/2002/07/owl#Class"}}',
            ax.Declaration('class', A),
        ),
        (f'<{A}><{B}>"x".\n', ax.DataPropertyAssertion(B, A, ex.Literal('x'))),
        (
            OWL_XML.replace('?>', '?><!--' + 'x' * 5000 + '-->', 1),
            ax.ClassAssertion(f'{IRI}#ROOM', f'{IRI}#R1'),
        ),
        (
            OWL_XML.replace('<', '<o:')
            .replace('<o:/', '</o:')
            .replace('<o:?', '<?')
            .replace('xmlns=', 'xmlns:o='),
            ax.ClassAssertion(f'{IRI}#ROOM', f'{IRI}#R1'),
        ),
        (
            owl_xml(
                '<HasKey><Class IRI="#A"/><ObjectProperty IRI="#p"/>'
                '<DataProperty IRI="#q"/></HasKey>'
            ),
            ax.HasKey(A, (f'{IRI}#p',), (f'{IRI}#q',)),
        ),
        (
            owl_xml(
                '<NegativeObjectPropertyAssertion><ObjectProperty IRI="#p"/>'
                '<NamedIndividual IRI="#i"/><AnonymousIndividual nodeID="_:j"/>'
                '</NegativeObjectPropertyAssertion>'
            ),
            ax.NegativeObjectPropertyAssertion(f'{IRI}#p', f'{IRI}#i', '_:j'),
        ),
        (
            f'Ontology(<{IRI}> Annotation(<{IRI}#n> <_:genid7>))',
            ax.AnnotationAssertion(f'{IRI}#n', IRI, '_:genid7'),
        ),
        (
            owl_xml(
                '<AnnotationAssertion><AnnotationProperty IRI="#n"/>'
                '<IRI>#i</IRI><IRI>_:genid7</IRI></AnnotationAssertion>'
            ),
            ax.AnnotationAssertion(f'{IRI}#n', f'{IRI}#i', '_:genid7'),
        ),
        (
            rdf(
                f'<owl:AnnotationProperty rdf:about="{IRI}#n"/>'
                '<rdf:Description rdf:about="#i"><n rdf:resource="_:genid7"/></rdf:Description>'
            ),
            ax.AnnotationAssertion(f'{IRI}#n', f'{IRI}#i', '_:ngenid7'),
        ),
        (
            owl_xml(
                '<DLSafeRule><Body><ClassAtom><Class IRI="#A"/>'
                '<Variable IRI="#x"/></ClassAtom></Body>'
                '<Head><ClassAtom><Class IRI="#B"/>'
                '<Variable IRI="#x"/></ClassAtom></Head></DLSafeRule>'
            ),
            ax.Rule(
                (ex.ClassAtom(A, ex.Variable(f'{IRI}#x')),),
                (ex.ClassAtom(B, ex.Variable(f'{IRI}#x')),),
            ),
        ),
        (
            owl_xml(
                '<SubClassOf><Annotation><AnnotationProperty IRI="#n"/>'
                '<Literal xml:lang="en">x</Literal>'
                '</Annotation><Class IRI="#A"/><ObjectMinCardinality cardinality="2">'
                '<ObjectInverseOf><ObjectProperty IRI="#p"/></ObjectInverseOf>'
                '</ObjectMinCardinality>'
                '</SubClassOf>'
            ),
            ax.AxiomAnnotation(
                ax.SubClassOf(A, ex.ObjectMinCardinality(2, ex.ObjectInverseOf(f'{IRI}#p'))),
                (
                    (
                        f'{IRI}#n',
                        ex.Literal(
                            'x', 'http://www.w3.org/1999/02/22-rdf-syntax-ns#langString', 'en'
                        ),
                    ),
                ),
            ),
        ),
        (
            owl_xml(
                '<DatatypeDefinition><Datatype IRI="#d"/><DatatypeRestriction>'
                '<Datatype abbreviatedIRI="xsd:integer"/>'
                f'<FacetRestriction facet="{XSD}minInclusive">'
                f'<Literal datatypeIRI="{XSD}integer">5</Literal></FacetRestriction>'
                '</DatatypeRestriction></DatatypeDefinition>'
            ),
            ax.DatatypeDefinition(
                f'{IRI}#d',
                ex.DatatypeRestriction(
                    f'{XSD}integer', ((f'{XSD}minInclusive', ex.Literal('5', f'{XSD}integer')),)
                ),
            ),
        ),
    ],
)
def test_what_other_tools_write_is_read_right(text, axiom):
    document = read_ontology(text if isinstance(text, bytes) else text.encode(), IRI)
    assert axiom in document.axioms
    assert document.unsupported == []


@pytest.mark.parametrize(
    ('text', 'report'),
    [
        (
            rdf(
                SAID.format(
                    'Restriction',
                    f'{ON_P}<owl:someValuesFrom rdf:resource="#B"/>'
                    '<owl:allValuesFrom rdf:resource="#B"/>',
                )
            ),
            'restriction on p says several things at once: someValuesFrom, allValuesFrom',
        ),
        (
            rdf(
                SAID.format(
                    'Restriction',
                    f'{ON_P}<owl:onProperty rdf:resource="#q"/><owl:hasSelf>true</owl:hasSelf>',
                )
            ),
            'says several things at once: onProperty',
        ),
        (
            rdf(SAID.format('Restriction', f'{ON_P}<owl:hasSelf>false</owl:hasSelf>')),
            'hasSelf is not true',
        ),
        (
            rdf(
                '<owl:Class rdf:about="#A"><owl:unionOf rdf:parseType="Resource">'
                '<rdf:first>x</rdf:first>'
                '<rdf:rest rdf:resource="http://www.w3.org/1999/02/22-rdf-syntax-ns#nil"/>'
                '</owl:unionOf></owl:Class>'
            ),
            "line 4: a statement about A is left out: expected a class, got the literal 'x'",
        ),
        (
            owl_xml('<SubClassOf><Class IRI="#A"/></SubClassOf>'),
            'line 11: SubClassOf is not understood',
        ),
        (
            rdf(
                '<owl:DatatypeProperty rdf:about="#p"><rdf:type'
                ' rdf:resource="http://www.w3.org/2002/07/owl#InverseFunctionalProperty"/>'
                '</owl:DatatypeProperty>'
            ),
            'about p is left out: a data property cannot be of type InverseFunctionalProperty',
        ),
        (
            rdf(
                '<owl:Class rdf:about="#A"><owl:equivalentClass><owl:Class>'
                '<owl:disjointUnionOf rdf:parseType="Collection"><owl:Class rdf:about="#B"/>'
                '<owl:Class rdf:about="#C"/></owl:disjointUnionOf></owl:Class>'
                '</owl:equivalentClass></owl:Class>'
            ),
            'a node without a name cannot be defined',
        ),
        (
            rdf(
                '<rdf:Description><rdf:type'
                ' rdf:resource="http://www.w3.org/2002/07/owl#TransitiveProperty"/>'
                '</rdf:Description>'
            ),
            'expected a property, got a node without a name',
        ),
        (
            rdf('<owl:Class rdf:about="#A"><owl:sameAs rdf:resource="#i"/></owl:Class>'),
            'owl:sameAs says nothing of A as class',
        ),
        (
            rdf(
                '<rdf:Description'
                ' rdf:about="http://www.w3.org/1999/02/22-rdf-syntax-ns#type">'
                '<rdfs:domain rdf:resource="#A"/></rdf:Description>'
            ),
            'domain of type, a word of OWL, has no effect',
        ),
        (owl_xml('<Nonsense><Class IRI="#A"/></Nonsense>'), 'line 11: Nonsense is not understood'),
    ],
)
def test_what_says_nothing_is_left_out_and_reported(text, report):
    document = read_ontology(text.encode(), IRI)
    assert [report in told for told in document.unsupported].count(True) == 1
    assert not any('_:' in repr(axiom) for axiom in document.axioms)


@pytest.mark.parametrize(
    ('text', 'complaint'),
    [
        ('Prefixes: none', f"expected {FORMATS}, got 'Prefixes: none'"),
        (b'\x1f\x8b\x08\x00', f'expected {FORMATS}'),
        ('{"a": 1}', 'not JSON-LD: it states nothing'),
        (
            '{"@context": "https://schema.org/", "@id": "http://x/A", "@type": "B"}',
            'remote contexts',
        ),
        (f'<{A}> a <{B}> .\n<{A}> <{B}> \n', 'not Turtle: Unexpected end'),
        ('@prefix : <http://x/> .\n<< :a :b :c >> :d :e .', 'triples about triples'),
        (f'<{A}> <{B}> "\\uD800" .\n', 'D800'),
        (rdf('<A rdf:about="#i" rdf:ID="j"/>'), 'expected one of rdf:about, rdf:ID and rdf:nodeID'),
        (rdf('<A><p rdf:resource="#i" rdf:datatype="#d"/></A>'), 'exclude each other'),
        (
            '<!DOCTYPE a SYSTEM "x.dtd">' + rdf('<A rdf:about="&x;i"/>'),
            "entity 'x' is not declared",
        ),
        (f'Ontology(<{IRI}>)\nOntology(<{A}>)', 'Ontology after the end'),
        (
            f'Ontology(SubClassOf(<{A}> ObjectMinCardinality({"9" * 5000} <{B}>)))',
            'a number of 5000 digits',
        ),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(text, complaint):
    with pytest.raises(OntologyFileError) as error:
        read_ontology(text if isinstance(text, bytes) else text.encode(), IRI)
    assert complaint in str(error.value)
    assert len(str(error.value).splitlines()) == 1


def test_a_data_property_of_another_type_is_a_data_property_all_the_same():
    """FOAF has properties of values that are inverse functional, which OWL 2 DL does not have."""
    document = read_ontology(
        rdf(
            '<owl:InverseFunctionalProperty rdf:about="#p">'
            '<rdf:type rdf:resource="http://www.w3.org/2002/07/owl#DatatypeProperty"/>'
            '<rdfs:domain rdf:resource="#A"/><rdfs:subPropertyOf rdf:resource="#q"/>'
            '<rdf:type rdf:resource="http://www.w3.org/2002/07/owl#FunctionalProperty"/>'
            '</owl:InverseFunctionalProperty>'
        ).encode(),
        IRI,
    )
    p, q = f'{IRI}#p', f'{IRI}#q'
    for axiom in (
        ax.DataPropertyDomain(p, A),
        ax.SubDataPropertyOf(p, q),
        ax.FunctionalDataProperty(p),
    ):
        assert axiom in document.axioms
    assert ax.Declaration('object_property', p) not in document.axioms


@pytest.mark.parametrize(
    ('text', 'axiom'),
    [
        (
            '<rdf:Description><owl:propertyChain rdf:parseType="Collection">'
            '<rdf:Description rdf:about="#p"/><rdf:Description rdf:about="#q"/>'
            '</owl:propertyChain><rdfs:subPropertyOf rdf:resource="#r"/></rdf:Description>',
            ax.SubPropertyChainOf((f'{IRI}#p', f'{IRI}#q'), f'{IRI}#r'),
        ),
        (
            '<owl:Class rdf:about="#A"><owl:intersectionOf rdf:parseType="Collection">'
            '<owl:Class rdf:about="#B"/></owl:intersectionOf></owl:Class>',
            ax.EquivalentClasses((A, B)),
        ),
        (
            '<owl:Class rdf:about="#A"><owl:unionOf'
            ' rdf:resource="http://www.w3.org/1999/02/22-rdf-syntax-ns#nil"/></owl:Class>',
            ax.EquivalentClasses((A, 'http://www.w3.org/2002/07/owl#Nothing')),
        ),
        (
            '<owl:Class rdf:about="#A"><owl:oneOf'
            ' rdf:resource="http://www.w3.org/1999/02/22-rdf-syntax-ns#nil"/></owl:Class>',
            ax.EquivalentClasses((A, 'http://www.w3.org/2002/07/owl#Nothing')),
        ),
    ],
)
def test_what_older_documents_say_is_read(text, axiom):
    """Chains of a draft of OWL 2, and classes of OWL 1 that are made of fewer than two."""
    document = read_ontology(rdf(text).encode(), IRI)
    assert axiom in document.axioms
    assert document.unsupported == []


@pytest.mark.parametrize(
    'text',
    [
        'Ontology(Annotation(<urn:n> "x"))',
        '<Ontology xmlns="http://www.w3.org/2002/07/owl#"><Annotation>'
        '<AnnotationProperty IRI="urn:n"/><Literal>x</Literal></Annotation></Ontology>',
        'Ontology: Annotations: <urn:n> "x"',
        '@prefix owl: <http://www.w3.org/2002/07/owl#> . [] a owl:Ontology ; <urn:n> "x" .',
    ],
)
@pytest.mark.parametrize('form', ['rdfxml', 'ntriples', 'nquads', 'manchester'])
def test_what_is_said_of_an_ontology_without_a_name_stays_said_of_it(text, form):
    said = ax.AnnotationAssertion('urn:n', IRI, ex.Literal('x'))
    document = read_ontology(text.encode(), IRI)
    assert (document.iri, said in document.axioms) == ('', True)
    again = read_ontology(ontology_bytes(document.axioms, IRI, form), 'urn:base')
    assert (again.iri, again.unsupported) == (IRI, [])
    assert [axiom for axiom in again.axioms if not isinstance(axiom, ax.Declaration)] == [said]
