"""Ontologies in OWL/XML and Turtle say the same as in RDF/XML."""

from __future__ import annotations

import pytest

from surveillance_ontology.documents.rdf_xml import OntologyFileError
from surveillance_ontology.documents.reading import read_ontology
from surveillance_ontology.owl import axioms as ax
from surveillance_ontology.owl import expressions as ex

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
        (OWL_XML[:300], 5, 'not well-formed OWL/XML'),
        (
            OWL_XML.replace('?>', '?>\n<!DOCTYPE o [<!ENTITY a "b">]>', 1),
            2,
            'entities are not read',
        ),
        (OWL_XML.replace('<Decl', '<Import>http://example.org/no</Import><Decl', 1), 0, 'not read'),
        (TURTLE.replace('"5"', ';;'), 7, 'not Turtle'),
        ('@prefix : <a\nb> .\n', 1, 'not Turtle: Invalid IRI'),
    ],
)
def test_broken_document_names_its_place(text, line, complaint, capfd):
    with pytest.raises(OntologyFileError, match=complaint) as error:
        read_ontology(text.encode(), IRI)
    assert error.value.line == line
    assert '\n' not in str(error.value)
    assert capfd.readouterr().err == ''
