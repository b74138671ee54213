"""N-Triples to triples (https://www.w3.org/TR/n-triples/), and Turtle and JSON-LD by way of them.

pyoxigraph reads the latter two; what it writes is read here, so that datatypes stay exact.
"""

from __future__ import annotations

import re

from surveillance_ontology.documents.rdf_xml import Graph, Node
from surveillance_ontology.documents.xml_reading import OntologyFileError
from surveillance_ontology.owl.expressions import Literal
from surveillance_ontology.owl.vocabulary import RDF, XSD

_IRI = (
    r'<([A-Za-z][A-Za-z0-9+.\-]*:(?:[^\x00-\x20<>"{}|^`\\]|\\u[0-9A-Fa-f]{4}|\\U[0-9A-Fa-f]{8})*)>'
)
_BLANK = r'(_:[\w.\-]*[\w\-])'
_TEXT = r'"((?:[^"\\\r\n]++|\\.)*+)"(?:\^\^' + _IRI + r'|@([A-Za-z]+(?:-[A-Za-z0-9]+)*))?'
_STATEMENT = re.compile(
    rf'\s*(?:{_IRI}|{_BLANK})\s*{_IRI}\s*(?:{_IRI}|{_BLANK}|{_TEXT})\s*\.\s*(?:#.*)?$'
)
_ESCAPE = re.compile(r'\\(?:u([0-9A-Fa-f]{4})|U([0-9A-Fa-f]{8})|(.))')
_SIMPLE = {'t': '\t', 'b': '\b', 'n': '\n', 'r': '\r', 'f': '\f', '"': '"', "'": "'", '\\': '\\'}


def _unescape(text: str) -> str:
    if '\\' not in text:
        return text

    def plain(found: re.Match[str]) -> str:
        code = found[1] or found[2]
        if code:
            if 0xD800 <= int(code, 16) < 0xE000:
                raise ValueError(f'escape \\u{code} is no character')
            return chr(int(code, 16))
        if found[3] not in _SIMPLE:
            raise ValueError(f'escape \\{found[3]} is not one of N-Triples')
        return _SIMPLE[found[3]]

    return _ESCAPE.sub(plain, text)


def parse_ntriples(data: bytes) -> Graph:
    """Parse a document.

    Raises:
        OntologyFileError: With line and column, for a line that is no triple or bytes that are not
            UTF-8.
    """
    try:
        text = data.decode('utf-8-sig')
    except UnicodeDecodeError as error:
        line = data.count(b'\n', 0, error.start) + 1
        raise OntologyFileError(f'not UTF-8: {error.reason}', line, 1) from None
    graph = Graph()
    for number, statement in enumerate(text.split('\n'), 1):
        if not statement.strip() or statement.lstrip().startswith('#'):
            continue
        found = _STATEMENT.match(statement.rstrip('\r'))
        if found is None:
            column = len(statement) - len(statement.lstrip()) + 1
            raise OntologyFileError(
                'expected an N-Triples statement `<subject> <predicate> object .`'
                f', got {statement.strip()[:60]!r}',
                number,
                column,
            )
        try:
            subject = _unescape(found[1]) if found[1] is not None else found[2]
            value: Node
            if found[6] is not None:
                if found[8]:
                    value = Literal(_unescape(found[6]), RDF + 'langString', found[8].lower())
                else:
                    datatype = _unescape(found[7]) if found[7] is not None else XSD + 'string'
                    value = Literal(_unescape(found[6]), datatype)
            else:
                value = _unescape(found[4]) if found[4] is not None else found[5]
        except (ValueError, OverflowError) as error:
            raise OntologyFileError(str(error), number, 1) from None
        graph.places.setdefault(subject, (number, 1))
        graph.triples.append((subject, _unescape(found[3]), value))
    return graph


_PARSER_PLACE = re.compile(r'Parser error (?:at|between) line [\w ]*: ')


def parse_by_library(data: bytes, iri: str, form: str) -> Graph:
    """Parse a document in another format; the graph knows no places.

    Args:
        data: The document.
        iri: Base for relative IRIs where the document gives none.
        form: 'turtle' or 'json-ld'.

    Raises:
        OntologyFileError: Not of that format, or with statements that are no plain triples.
    """
    import pyoxigraph

    name, source = {
        'turtle': ('Turtle', pyoxigraph.RdfFormat.TURTLE),
        'json-ld': ('JSON-LD', pyoxigraph.RdfFormat.JSON_LD),
    }[form]
    try:
        quads = list(pyoxigraph.parse(data, format=source, base_iri=iri))
    except SyntaxError as error:
        message = _PARSER_PLACE.sub('', str(error.msg), count=1)
        place = error.lineno or 0, error.offset or 0
        raise OntologyFileError(f'not {name}: {message}', *place) from None
    if not quads:
        raise OntologyFileError(f'not {name}: it states nothing')
    if any(quad.graph_name != pyoxigraph.DefaultGraph() for quad in quads):
        raise OntologyFileError('named graphs are not read')
    if any(isinstance(quad.object, pyoxigraph.Triple) for quad in quads):
        raise OntologyFileError('triples about triples (RDF 1.2) are not read')
    graph = parse_ntriples(
        pyoxigraph.serialize(quads, format=pyoxigraph.RdfFormat.N_TRIPLES) or b''
    )
    graph.places.clear()
    return graph
