"""Reading an ontology document into axioms, with exact datatypes and the place of every error."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import unquote, urlsplit

from surveillance_ontology.documents import foreign_formats
from surveillance_ontology.documents.functional_syntax import FunctionalSyntax, is_functional
from surveillance_ontology.documents.mapping import Mapping
from surveillance_ontology.documents.ntriples import parse_ntriples
from surveillance_ontology.documents.rdf_xml import Graph, OntologyFileError, parse_rdf_xml
from surveillance_ontology.memory import uncollected
from surveillance_ontology.owl.axioms import Axiom, Import
from surveillance_ontology.owl.vocabulary import local_name

_NTRIPLES = re.compile(rb'<[^\s<>]*>\s+[<_]')
_ENDINGS = ('.owl', '.rdf', '.ttl', '.ofn', '.owx', '.xml', '.nt')
DEFAULT_SIZE_LIMIT = 256 * 1024 * 1024


@dataclass(frozen=True)
class OntologyDocument:
    """What a document states.

    Attributes:
        axioms: In document order, without repeats.
        unsupported: One sentence for each statement that was not understood.
        format: 'rdfxml', 'ntriples', 'owlxml', 'turtle' or 'functional'.
        iri: The IRI in the document's owl:Ontology header, '' without one.
        prefixes: Namespace prefixes declared by the document.
    """

    axioms: list[Axiom]
    unsupported: list[str]
    format: str
    iri: str
    prefixes: dict[str, str]


def read_ontology(
    source: str | Path | bytes, iri: str, *, size_limit: int = DEFAULT_SIZE_LIMIT
) -> OntologyDocument:
    """Read a document and the documents beside it that it imports.

    Its format is told by how it begins: RDF/XML, OWL/XML, Turtle, N-Triples, or OWL functional
    syntax. An import is followed where a file of its name (with any ending) lies in the folder of
    the document, or where it is a file IRI; its axioms then take the place of the import. Any other
    import is reported.

    Args:
        source: A path, or the document itself as bytes.
        iri: Base for relative IRIs where the document gives none.
        size_limit: Largest document accepted, bytes.

    Raises:
        OntologyFileError: Not readable, too large, or not an ontology; nothing is half-read.
    """
    folder = None if isinstance(source, bytes) else Path(source).parent
    seen = set() if isinstance(source, bytes) else {Path(source).resolve()}
    document = _read(source, iri, size_limit)
    axioms: dict[Axiom, None] = {}
    unsupported = list(document.unsupported)
    pending = [(document, folder)]
    for read, place in pending:
        for axiom in read.axioms:
            if not isinstance(axiom, Import):
                axioms[axiom] = None
                continue
            path = _imported(axiom.iri, place)
            if path is None:
                axioms[axiom] = None
                unsupported.append(f'owl:imports <{axiom.iri}> is not followed: no file beside it')
            elif path.resolve() not in seen:
                seen.add(path.resolve())
                other = _read(path, axiom.iri, size_limit)
                unsupported += (f'{path.name}: {text}' for text in other.unsupported)
                pending.append((other, path.parent))
    return replace(document, axioms=list(axioms), unsupported=unsupported)


def _imported(iri: str, folder: Path | None) -> Path | None:
    """Return the local file that an import names."""
    if iri.startswith('file:'):
        path = Path(unquote(urlsplit(iri).path))
        return path if path.is_file() else None
    name = local_name(iri.rstrip('/#')).rpartition('/')[2]
    if folder is None or not name or name.startswith('.'):
        return None
    for candidate in (folder / name, *(folder / (name + ending) for ending in _ENDINGS)):
        if candidate.is_file():
            return candidate
    return None


def _read(source: str | Path | bytes, iri: str, size_limit: int) -> OntologyDocument:
    """Read one document."""
    if isinstance(source, bytes):
        name, data = '<document>', source
    else:
        name = str(source)
        try:
            with open(source, 'rb') as file:
                data = file.read(size_limit + 1)
        except OSError as error:
            raise OntologyFileError(error.strerror or str(error), path=name) from None
    if len(data) > size_limit:
        raise OntologyFileError(f'larger than the limit of {size_limit} bytes', path=name)
    start = data.lstrip(b'\xef\xbb\xbf \t\r\n')
    if is_functional(start):
        return _functional(name, data)
    try:
        with uncollected():
            graph, form = _parsed(data, start, iri)
            mapping = Mapping(graph)
    except OntologyFileError as error:
        error.path = name
        raise
    except RecursionError:
        raise OntologyFileError('class expressions nest too deeply', path=name) from None
    return OntologyDocument(
        list(mapping.axioms), mapping.unsupported, form, mapping.iri, graph.prefixes
    )


def _functional(name: str, data: bytes) -> OntologyDocument:
    try:
        read = FunctionalSyntax(data.decode('utf-8-sig'))
    except OntologyFileError as error:
        error.path = name
        raise
    except UnicodeDecodeError as error:
        raise OntologyFileError(f'its encoding cannot be read: {error}', path=name) from None
    return OntologyDocument(
        list(read.axioms), read.unsupported, 'functional', read.iri, read.prefixes
    )


def _parsed(data: bytes, start: bytes, iri: str) -> tuple[Graph, str]:
    """Return the document as triples, and its format."""
    if not start:
        raise OntologyFileError('the document is empty', 1, 1)
    if foreign_formats.is_owl_xml(start):
        return parse_ntriples(foreign_formats.owl_xml_to_ntriples(data, iri)), 'owlxml'
    if start[:1] != b'<' and foreign_formats.is_turtle(start):
        return parse_ntriples(foreign_formats.turtle_to_ntriples(data, iri)), 'turtle'
    if not _NTRIPLES.match(start) and start[:1] in (b'<', b'\xff', b'\xfe'):
        return parse_rdf_xml(data, iri), 'rdfxml'
    return parse_ntriples(data), 'ntriples'
