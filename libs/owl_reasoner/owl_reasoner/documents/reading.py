"""Reading an ontology document into axioms, with exact datatypes and the place of every error.

pyoxigraph reads Turtle, N-Triples, N-Quads and JSON-LD. What XML and the functional syntax say is
read by this package, so that errors name their place also where the syntax is good and the OWL is
not.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit

from owl_reasoner.documents.catalogs import CATALOG, catalog_entries
from owl_reasoner.documents.functional_syntax import is_functional, parse_functional
from owl_reasoner.documents.manchester import ManchesterDocument
from owl_reasoner.documents.mapping import RdfMapper
from owl_reasoner.documents.owl_xml import is_owl_xml, parse_owl_xml
from owl_reasoner.documents.rdf_xml import Graph, Node, Triple, parse_rdf_xml
from owl_reasoner.documents.structural import Axioms
from owl_reasoner.documents.xml_reading import OntologyFileError, is_absolute, legal
from owl_reasoner.gc_control import collected, uncollected
from owl_reasoner.owl.axioms import Axiom, Import
from owl_reasoner.owl.entities import entities_of, renamed
from owl_reasoner.owl.expressions import Literal, language_tag
from owl_reasoner.owl.vocabulary import RDF, local_name

_BOMS = {
    codecs.BOM_UTF32_LE: 'utf-32',
    codecs.BOM_UTF32_BE: 'utf-32',
    codecs.BOM_UTF16_LE: 'utf-16',
    codecs.BOM_UTF16_BE: 'utf-16',
    b'<\0': 'utf-16-le',
    b'\0<': 'utf-16-be',
}
_DECLARED = re.compile(rb'<\?xml[^>]*?\sencoding\s*=\s*["\']([\w.:-]+)')
_COMMENTS = re.compile(rb'(?:\s++|#[^\n]*+)*+')
# A prefix is declared by an attribute: without one, <urn:a> is a name in Turtle.
_XML = re.compile(rb'<(?:[?!]|[A-Za-z_][\w.-]*(?:[\s/>]|\Z|:[A-Za-z_][\w.-]*(?:\s|\Z)))')
_JSON = re.compile(rb'\{\s*["}]|\[\s*\{')
_TRIPLE = re.compile(
    rb'(?:<[^\s<>]*>|_:[^\s<]+)\s*<[^\s<>]*>[^\n]*\.[ \t\r]*(?:#.*)?$', re.MULTILINE
)
_TURTLE = re.compile(rb'@(?:prefix|base)\b|(?:prefix|base)\s|<|_:|\[|\(', re.IGNORECASE)
_MANCHESTER = re.compile(rb'(?:Prefix|Namespace|Ontology|Import|Class|Individual|\w+Property):\s')
_PARSER_PLACE = re.compile(r'Parser error (?:at|between) line [\w ]*: ')
_NAMES = {
    'turtle': 'Turtle',
    'ntriples': 'N-Triples',
    'nquads': 'N-Quads',
    'jsonld': 'JSON-LD',
}
FORMATS = (
    'RDF/XML, OWL/XML, Turtle, N-Triples, N-Quads, JSON-LD, OWL functional syntax or Manchester '
    'syntax'
)
PACKAGE_DEPTH = 6
"""Folders above a document in which a package is looked for."""
_ENDINGS = ('.owl', '.rdf', '.ttl', '.ofn', '.owx', '.xml', '.nt', '.nq', '.jsonld', '.omn')
DEFAULT_SIZE_LIMIT = 256 * 1024 * 1024


@dataclass(frozen=True)
class OntologyDocument:
    """What a document states.

    Attributes:
        axioms: In document order, without repeats.
        unsupported: One sentence for each statement that was not understood.
        format: 'rdfxml', 'ntriples', 'nquads', 'owlxml', 'turtle', 'jsonld', 'functional' or
            'manchester'.
        iri: The IRI in the document's owl:Ontology header, '' without one.
        prefixes: Namespace prefixes declared by the document.
    """

    axioms: list[Axiom]
    unsupported: list[str]
    format: str
    iri: str
    prefixes: dict[str, str]


@uncollected()
def read_ontology(
    source: str | Path | bytes,
    iri: str,
    *,
    size_limit: int = DEFAULT_SIZE_LIMIT,
    may_read: Callable[[Path], bool] = Path.exists,
) -> OntologyDocument:
    """Read a document and the documents beside it that it imports.

    Its format is told by how it begins: RDF/XML, OWL/XML, Turtle, N-Triples, N-Quads, JSON-LD, OWL
    functional syntax or Manchester syntax. Of N-Quads the graph that `iri` names is read, or the
    only one, and what is in no graph. An import is followed where a file of its name (with any
    ending) lies in the folder of the document, where a catalog says where it is (`catalogs`), or
    where it is a file
    IRI; its axioms then take the place of the import.
    Any other import is reported.

    Args:
        source: A path, or the document itself as bytes.
        iri: Base for relative IRIs where the document gives none.
        size_limit: Largest document accepted, bytes.
        may_read: Whether a document may import a file that is there; all may be unless given.

    Raises:
        OntologyFileError: Not readable, too large, or not an ontology; nothing is half-read.
    """
    folder = None if isinstance(source, bytes) else Path(source).parent
    with collected():
        seen = set() if isinstance(source, bytes) else {Path(source).resolve()}
    form, main = _read(source, iri, size_limit)
    documents: list[tuple[str, RdfMapper | Axioms, Path | None]] = [('', main, folder)]
    missing: dict[str, str] = {}
    for _, document, place in documents:
        for name in document.imports:
            with collected():
                path = _imported(name, place, may_read)
                if path is None:
                    missing[name] = 'no such file beside the document'
                elif not may_read(path):
                    missing[name] = f'{path} may not be read'
                elif path.resolve() not in seen:
                    seen.add(path.resolve())
                    _, other = _read(path, name, size_limit)
                    documents.append((f'{path.name}: ', other, path.parent))
    several = len(documents) > 1
    declared = [pair for _, document, _ in documents if several for pair in document.declared]
    axioms: dict[Axiom, None] = {}
    blanks: set[str] = set()
    unsupported: list[str] = []
    for number, (prefix, document, _) in enumerate(documents):
        document.read(declared)
        if several:
            axioms.update(dict.fromkeys(_apart(document.axioms, blanks, f'_:d{number}.')))
        else:
            axioms = document.axioms
        unsupported += (prefix + text for text in document.unsupported)
    unsupported += (f'owl:imports <{name}> is not followed: {why}' for name, why in missing.items())
    kept = [axiom for axiom in axioms if not isinstance(axiom, Import) or axiom.iri in missing]
    return OntologyDocument(kept, unsupported, form, main.iri, main.prefixes)


def _apart(axioms: Iterable[Axiom], taken: set[str], prefix: str) -> Iterator[Axiom]:
    """Yield axioms whose individuals without a name have labels that no earlier document took."""
    own: set[str] = set()
    for axiom in axioms:
        for name in {name for _, name in entities_of(axiom) if name.startswith('_:')}:
            own.add(name)
            if name in taken:
                axiom = renamed(axiom, 'individual', name, prefix + name[2:])
        yield axiom
    taken |= own


def _imported(iri: str, folder: Path | None, may_read: Callable[[Path], bool]) -> Path | None:
    """Return the local file that an import names: itself, in a catalog, or beside the document."""
    if iri.startswith('file:'):
        path = Path(unquote(urlsplit(iri).path))
        return path if path.is_file() else None
    if folder is None:
        return None
    for catalog in (folder / CATALOG, folder.parent / CATALOG):
        if catalog.is_file() and may_read(catalog):
            with suppress(OntologyFileError, OSError):
                found = catalog_entries(catalog).get(iri)
                if found is not None and found.is_file():
                    return found
    if iri.startswith('package://') and (found := _in_package(iri, folder)) is not None:
        return found
    name = local_name(iri.rstrip('/#')).rpartition('/')[2]
    if not name or name.startswith('.'):
        return None
    for candidate in (folder / name, *(folder / (name + ending) for ending in _ENDINGS)):
        if candidate.is_file():
            return candidate
    return None


def _in_package(iri: str, folder: Path) -> Path | None:
    """Return the file of a ROS package that lies around a document or beside its package."""
    parts = [unquote(part) for part in iri.removeprefix('package://').split('/') if part]
    if '..' in parts:
        return None
    for above in (folder, *folder.parents[:PACKAGE_DEPTH]):
        candidates = [above.joinpath(*parts)]
        if parts and above.name == parts[0]:
            candidates.append(above.joinpath(*parts[1:]))
        for candidate in candidates:
            if candidate.is_file():
                return candidate
    return None


def _read(source: str | Path | bytes, iri: str, size_limit: int) -> tuple[str, RdfMapper | Axioms]:
    """Parse one document; return its format and what it states."""
    if isinstance(source, bytes):
        name, data = '<document>', source
    else:
        name = str(source)
        try:
            with collected(), open(source, 'rb') as file:
                data = file.read(size_limit + 1)
        except OSError as error:
            raise OntologyFileError(error.strerror or str(error), path=name) from None
    if len(data) > size_limit:
        raise OntologyFileError(f'larger than the limit of {size_limit} bytes', path=name)
    try:
        with uncollected():
            return _parsed(_utf8(data), iri)
    except OntologyFileError as error:
        error.path = name
        raise


def _utf8(data: bytes) -> bytes:
    """Return a document in UTF-8, without a byte order mark."""
    coding = next((_BOMS[mark] for mark in _BOMS if data.startswith(mark)), None)
    if coding is None:
        data = data.removeprefix(codecs.BOM_UTF8)
        declared = _DECLARED.match(data)
        coding = declared[1].decode() if declared else 'utf-8'
        if coding.lower() in ('utf-8', 'us-ascii'):
            return data
    try:
        return data.decode(coding).removeprefix('\ufeff').encode()
    except (LookupError, ValueError) as error:
        raise OntologyFileError(f'its encoding cannot be read: {error}', 1, 1) from None


def _parsed(data: bytes, iri: str) -> tuple[str, RdfMapper | Axioms]:
    """Parse a document in UTF-8 by the format that it begins with."""
    begin = _COMMENTS.match(data)
    place = begin.end() if begin else 0
    if place == len(data):
        raise OntologyFileError('the document is empty', 1, 1)
    if is_functional(data):
        return 'functional', parse_functional(_text(data), iri)
    if _TRIPLE.match(data, place):
        # All three can begin so; what came farthest tells what is wrong.
        errors: list[OntologyFileError] = []
        for form in ('ntriples', 'nquads', 'turtle'):
            try:
                return form, RdfMapper(_rdf_text(data, iri, form), iri)
            except OntologyFileError as error:
                errors.append(error)
        raise next((e for e in errors if not e.line), max(errors, key=lambda e: e.line)) from None
    if _XML.match(data, place):
        if is_owl_xml(data):
            return 'owlxml', parse_owl_xml(data, iri)
        return 'rdfxml', RdfMapper(parse_rdf_xml(data, iri), iri)
    if _JSON.match(data, place):
        return 'jsonld', RdfMapper(_rdf_text(data, iri, 'jsonld'), iri)
    if _TURTLE.match(data, place):
        return 'turtle', RdfMapper(_rdf_text(data, iri, 'turtle'), iri)
    if _MANCHESTER.match(data, place):
        return 'manchester', ManchesterDocument(_text(data), iri)
    shown = data[place : place + 40].decode('latin-1')
    raise OntologyFileError(
        f'expected {FORMATS}, got {shown!r}',
        data.count(b'\n', 0, place) + 1,
        1,
    )


def _text(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b'\n', 0, error.start) + 1
        raise OntologyFileError(f'not UTF-8: {error.reason}', line, 1) from None


class _NodeNames(dict[str, str]):
    """The names of nodes, by the nodes as N-Triples has them.

    Args:
        reports: Where names that are no IRIs are reported.
    """

    def __init__(self, reports: list[str]) -> None:
        super().__init__()
        self._known: dict[str, str] = {}
        self._reports = reports

    def __missing__(self, node: str) -> str:
        is_blank = node.startswith('_:')
        name = node if is_blank else legal(node[1:-1], self._known, self._reports)
        self[node] = name
        return name


def _rdf_text(data: bytes, iri: str, form: str) -> Graph:
    """Parse a document; the graph knows no places.

    Args:
        data: The document.
        iri: Base for relative IRIs where the document gives none.
        form: 'turtle', 'ntriples', 'nquads' or 'jsonld'.

    Raises:
        OntologyFileError: Not of that format, or with statements that are no plain triples.
    """
    # Late: a server that starts again is to be back at once.
    import pyoxigraph

    source = {
        'turtle': pyoxigraph.RdfFormat.TURTLE,
        'ntriples': pyoxigraph.RdfFormat.N_TRIPLES,
        'nquads': pyoxigraph.RdfFormat.N_QUADS,
        'jsonld': pyoxigraph.RdfFormat.JSON_LD,
    }[form]
    graph = Graph()
    graphs: dict[str, list[Triple]] = {}
    names = _NodeNames(graph.unsupported)
    properties: set[str] = set()
    default = pyoxigraph.DefaultGraph()
    literal, triple = pyoxigraph.Literal, pyoxigraph.Triple
    try:
        base = None if form in ('ntriples', 'nquads') else iri
        # Lenient: names that are no IRIs, which JSON-LD would drop in silence, come as they are.
        for quad in pyoxigraph.parse(data, format=source, base_iri=base, lenient=True):
            subject, predicate, node, of_graph = quad
            triples = graph.triples
            if of_graph != default:
                if form != 'nquads':
                    raise OntologyFileError('named graphs are not read')
                triples = graphs.setdefault(names[str(of_graph)], [])
            value: Node
            if isinstance(node, literal):
                language = node.language
                if not language:
                    value = Literal(node.value, names[str(node.datatype)])
                else:
                    try:
                        value = Literal(node.value, RDF + 'langString', language_tag(language))
                    except ValueError as error:
                        graph.unsupported.append(str(error))
                        value = Literal(node.value)
            elif isinstance(node, triple):
                raise OntologyFileError('triples about triples (RDF 1.2) are not read')
            else:
                value = names[str(node)]
            about, says = names[str(subject)], names[str(predicate)]
            if says not in properties:
                if not is_absolute(says):
                    what = f'a statement about {local_name(about)} is left out'
                    graph.unsupported.append(f'{what}: its property {says!r} is no IRI')
                    continue
                properties.add(says)
            triples.append((about, says, value))
    except SyntaxError as error:
        message = _PARSER_PLACE.sub('', str(error.msg), count=1)
        place = error.lineno or 0, error.offset or 0
        raise OntologyFileError(f'not {_NAMES[form]}: {message}', *place) from None
    if graphs:
        graph.triples += graphs[_graph_of(iri, graphs)]
    if not graph.triples:
        raise OntologyFileError(f'not {_NAMES[form]}: it states nothing')
    return graph


def _graph_of(iri: str, graphs: Iterable[str]) -> str:
    """Return the named graph that an ontology is; owlready2 names it with what ends its IRI.

    Raises:
        OntologyFileError: There are several, and none is named so.
    """
    named = [name for name in graphs if name.rstrip('#/') == iri.rstrip('#/')]
    found = named or [*graphs]
    if len(found) > 1:
        shown = ', '.join(f'<{name}>' for name in found[:5])
        raise OntologyFileError(f'expected one graph, or one named <{iri}>, got {shown}')
    return found[0]
