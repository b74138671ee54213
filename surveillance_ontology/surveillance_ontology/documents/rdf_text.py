"""Turtle, N-Triples and JSON-LD to triples; pyoxigraph reads them."""

from __future__ import annotations

import re

from surveillance_ontology.documents.rdf_xml import Graph, Node
from surveillance_ontology.documents.xml_reading import OntologyFileError
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import RDF

_PARSER_PLACE = re.compile(r'Parser error (?:at|between) line [\w ]*: ')
_NAMES = {'turtle': 'Turtle', 'ntriples': 'N-Triples', 'jsonld': 'JSON-LD'}


def parse_rdf_text(data: bytes, iri: str, form: str) -> Graph:
    """Parse a document; the graph knows no places.

    Args:
        data: The document.
        iri: Base for relative IRIs where the document gives none.
        form: 'turtle', 'ntriples' or 'jsonld'.

    Raises:
        OntologyFileError: Not of that format, or with statements that are no plain triples.
    """
    # Late: a server that starts again is to be back at once.
    import pyoxigraph

    source = {
        'turtle': pyoxigraph.RdfFormat.TURTLE,
        'ntriples': pyoxigraph.RdfFormat.N_TRIPLES,
        'jsonld': pyoxigraph.RdfFormat.JSON_LD,
    }[form]
    graph = Graph()
    try:
        # N-Triples hold what SAVE writes: names that are no IRIs, too.
        lenient = form == 'ntriples'
        base = None if lenient else iri
        for quad in pyoxigraph.parse(data, format=source, base_iri=base, lenient=lenient):
            if quad.graph_name != pyoxigraph.DefaultGraph():
                raise OntologyFileError('named graphs are not read')
            node = quad.object
            if isinstance(node, pyoxigraph.Triple):
                raise OntologyFileError('triples about triples (RDF 1.2) are not read')
            value: Node
            if not isinstance(node, pyoxigraph.Literal):
                value = _name(node)
            elif node.language:
                value = Literal(node.value, RDF + 'langString', node.language.lower())
            else:
                value = Literal(node.value, node.datatype.value)
            graph.triples.append((_name(quad.subject), quad.predicate.value, value))
    except SyntaxError as error:
        message = _PARSER_PLACE.sub('', str(error.msg), count=1)
        place = error.lineno or 0, error.offset or 0
        raise OntologyFileError(f'not {_NAMES[form]}: {message}', *place) from None
    if not graph.triples:
        raise OntologyFileError(f'not {_NAMES[form]}: it states nothing')
    return graph


def _name(node: object) -> str:
    text = str(node)
    return text if text.startswith('_:') else text[1:-1]
