"""Documents in further formats, read by libraries: OWL/XML by owlready2, Turtle by pyoxigraph.

Both become N-Triples, which this package reads itself, so that datatypes stay exact. RDF/XML, the
format of ARMOR's ontologies, has a reader of its own (`rdf_xml`): errors in it shall name their
place, also where the XML is good and the OWL is not.
"""

from __future__ import annotations

import io
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from surveillance_ontology.documents.rdf_xml import OntologyFileError

_OWL_XML = re.compile(rb'<(?:\w+:)?Ontology\b[^>]*\bhttp://www\.w3\.org/2002/07/owl#', re.DOTALL)
_TURTLE = re.compile(rb'\s*(?:@prefix|@base|prefix|base)\s', re.IGNORECASE)
_PLACE = re.compile(r'line (\d+), column (\d+)')
_HEAD = 4096
_one_at_a_time = threading.Lock()
"""owlready2 keeps state of its own while it parses."""


def is_owl_xml(data: bytes) -> bool:
    """Tell whether a document's root is OWL/XML's (https://www.w3.org/TR/owl2-xml-serialization/)."""
    return _OWL_XML.search(data[:_HEAD]) is not None


def is_turtle(data: bytes) -> bool:
    """Tell whether a document begins as Turtle does and N-Triples cannot."""
    return any(_TURTLE.match(line) for line in data[:_HEAD].splitlines())


def owl_xml_to_ntriples(data: bytes, iri: str) -> bytes:
    """Read OWL/XML.

    Args:
        data: The document.
        iri: The ontology's IRI where the document names none.

    Raises:
        OntologyFileError: Not well-formed, declares entities, or imports another document.
    """
    import owlready2

    entity = data.find(b'<!ENTITY')
    if entity >= 0:
        line = data.count(b'\n', 0, entity) + 1
        raise OntologyFileError('entities are not read in OWL/XML; write the IRIs out', line, 1)
    with _one_at_a_time, _untold():
        world = owlready2.World()
        try:
            ontology = world.get_ontology(iri)
            ontology.load(only_local=True, fileobj=io.BytesIO(data))
            triples = io.BytesIO()
            ontology.save(triples, format='ntriples')
        except owlready2.OwlReadyOntologyParsingError as error:
            place = _PLACE.search(str(error))
            if place is None:
                reason = str(error).splitlines()[0]
                raise OntologyFileError(f'not read as OWL/XML: {reason}') from None
            line, column = int(place[1]), int(place[2]) + 1
            raise OntologyFileError(
                f'not well-formed OWL/XML: {error.__cause__}', line, column
            ) from None
        except (FileNotFoundError, ValueError, TypeError) as error:
            raise OntologyFileError(f'not read as OWL/XML: {error}') from None
        finally:
            world.close()
    return triples.getvalue()


@contextmanager
def _untold() -> Iterator[None]:
    """Keep owlready2 from printing a traceback of what it raises besides."""
    hook = sys.excepthook
    sys.excepthook = lambda *_: None
    try:
        yield
    finally:
        sys.excepthook = hook


def turtle_to_ntriples(data: bytes, iri: str) -> bytes:
    """Read Turtle; arguments and errors as for OWL/XML."""
    import pyoxigraph

    try:
        quads = pyoxigraph.parse(data, format=pyoxigraph.RdfFormat.TURTLE, base_iri=iri)
        return bytes(pyoxigraph.serialize(quads, format=pyoxigraph.RdfFormat.N_TRIPLES) or b'')
    except SyntaxError as error:
        message = str(error.msg).rpartition(': ')[2]
        raise OntologyFileError(
            f'not Turtle: {message}', error.lineno or 0, error.offset or 0
        ) from None
