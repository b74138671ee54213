"""Names that OWL 2, RDF, XML Schema and SWRL give, and the short form of any IRI."""

from __future__ import annotations

OWL = 'http://www.w3.org/2002/07/owl#'
RDF = 'http://www.w3.org/1999/02/22-rdf-syntax-ns#'
RDFS = 'http://www.w3.org/2000/01/rdf-schema#'
XSD = 'http://www.w3.org/2001/XMLSchema#'
SWRL = 'http://www.w3.org/2003/11/swrl#'
SWRLB = 'http://www.w3.org/2003/11/swrlb#'

THING = OWL + 'Thing'
NOTHING = OWL + 'Nothing'
TOP, BOTTOM = OWL + 'topObjectProperty', OWL + 'bottomObjectProperty'
TOP_DATA, BOTTOM_DATA = OWL + 'topDataProperty', OWL + 'bottomDataProperty'
TOP_LITERAL = RDFS + 'Literal'


def is_anonymous(individual: str) -> bool:
    """Tell whether an individual has no IRI."""
    return individual.startswith('_:')


def local_name(iri: str) -> str:
    """Return what follows the last `#`, else the last `/`, else the whole."""
    for mark in ('#', '/'):
        _, found, name = iri.rpartition(mark)
        if found and name:
            return name
    return iri
