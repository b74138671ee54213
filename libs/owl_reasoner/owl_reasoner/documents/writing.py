"""Writing an ontology to a file: whole or not at all."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from itertools import count
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from owl_reasoner.documents.rdf_xml import Node, Triple
from owl_reasoner.documents.triples import triples_of
from owl_reasoner.documents.xml_reading import FORBIDDEN, OntologyFileError
from owl_reasoner.gc_control import collected
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, SWRL, XSD
from strict_files.regular_files import replace_file
from strict_files.suggestions import nearest

FORMATS = ('rdfxml', 'ntriples', 'nquads', 'manchester')
_XML = ('http://www.w3.org/XML/1998/namespace', 'http://www.w3.org/2000/xmlns/')
_PREFIXES = {'rdf': RDF, 'rdfs': RDFS, 'owl': OWL, 'xsd': XSD, 'swrl': SWRL}
_LOCAL = re.compile(r'[^\W\d][\w.\-]*')
_NOT_XML = re.compile('[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')


def write_ontology(
    axioms: Iterable[Axiom],
    iri: str,
    path: str | Path,
    format: str = 'rdfxml',
    prefixes: Mapping[str, str] | None = None,
) -> None:
    """Write a document through a temporary file beside it, so that the old one stays until the new
    is whole.

    Args:
        axioms: What the document states, in this order.
        iri: The ontology's IRI.
        path: The file; its directory must exist.
        format: One of `FORMATS`.
        prefixes: Further namespace prefixes for RDF/XML.

    Raises:
        OntologyFileError: The directory is not writable, the format is unknown, or RDF/XML cannot
            hold a property IRI or a character.
    """
    data = ontology_bytes(axioms, iri, format, prefixes)
    try:
        with collected():
            replace_file(path, data, durable=True)
    except OSError as error:
        raise OntologyFileError(error.strerror or str(error), path=str(path)) from None


def ontology_bytes(
    axioms: Iterable[Axiom],
    iri: str,
    format: str = 'rdfxml',
    prefixes: Mapping[str, str] | None = None,
) -> bytes:
    """Return the document as bytes; arguments and errors as in `write_ontology`."""
    if format == 'manchester':
        from owl_reasoner.documents.manchester import ManchesterWriter

        return ManchesterWriter(prefixes or {}).document(axioms, iri).encode()
    triples = triples_of(axioms, iri)
    if format == 'ntriples':
        return ''.join(map(_ntriple, triples)).encode()
    if format == 'nquads':
        return ''.join(f'{_ntriple(triple)[:-2]}<{iri}> .\n' for triple in triples).encode()
    if format == 'rdfxml':
        return _RdfXml(list(triples), iri, prefixes or {}).document().encode()
    raise OntologyFileError(f'format {format!r}: expected {nearest(format, FORMATS)}')


# --- N-Triples ---


def _escaped(text: str) -> str:
    if text.isalnum():
        return text
    for plain, escaped in (('\\', '\\\\'), ('"', '\\"'), ('\n', '\\n'), ('\r', '\\r')):
        text = text.replace(plain, escaped)
    return text


def _term(node: Node) -> str:
    if isinstance(node, str):
        return node if node.startswith('_:') else f'<{node}>'
    if node.language:
        return f'"{_escaped(node.lexical)}"@{node.language}'
    return f'"{_escaped(node.lexical)}"^^<{node.datatype}>'


def _ntriple(triple: Triple) -> str:
    return f'{_term(triple[0])} <{triple[1]}> {_term(triple[2])} .\n'


def fact_line(axiom: Axiom) -> str:
    """Return an axiom that is one triple as a line of N-Triples; empty for any other axiom.

    `ontology_bytes` writes these too, three times slower, and what annotates them.
    """
    kind = type(axiom)
    if kind is ObjectPropertyAssertion:
        subject, target = _term(axiom.subject), _term(axiom.object)  # type: ignore[attr-defined]
        return f'{subject} <{axiom.prop}> {target} .\n'  # type: ignore[attr-defined]
    if kind is DataPropertyAssertion:
        subject, target = _term(axiom.subject), _term(axiom.literal)  # type: ignore[attr-defined]
        return f'{subject} <{axiom.prop}> {target} .\n'  # type: ignore[attr-defined]
    if isinstance(axiom, ClassAssertion) and isinstance(axiom.cls, str):
        return f'{_term(axiom.individual)} <{RDF}type> <{axiom.cls}> .\n'
    if isinstance(axiom, SubClassOf) and isinstance(axiom.sub, str) and isinstance(axiom.sup, str):
        return f'<{axiom.sub}> <{RDFS}subClassOf> <{axiom.sup}> .\n'
    return ''


# --- RDF/XML ---


class _RdfXml:
    """One element for each subject; anonymous nodes used once stand inside what uses them."""

    def __init__(self, triples: list[Triple], iri: str, prefixes: Mapping[str, str]) -> None:
        self._iri = iri
        self._nodes: dict[str, list[tuple[str, Node]]] = {}
        uses: dict[str, int] = {}
        for subject, predicate, value in triples:
            self._nodes.setdefault(subject, []).append((predicate, value))
            if isinstance(value, str) and value.startswith('_:'):
                uses[value] = uses.get(value, 0) + 1
        self._inner = {
            node for node, number in uses.items() if number == 1 and node in self._nodes
        } - self._on_cycles()
        self._names: dict[str, str] = {}
        self._namespaces: dict[str, str] = {}
        named = {prefix: iri for prefix, iri in prefixes.items() if _is_prefix(prefix)}
        named = {**_PREFIXES, **named, **_PREFIXES, '': iri.rstrip('#/') + '#'}
        for prefix, namespace in named.items():
            if namespace and not namespace.startswith(_XML) and not FORBIDDEN.search(namespace):
                self._namespaces.setdefault(namespace, prefix)
        self._further = (p for number in count(1) if (p := f'ns{number}') not in named)
        self._lines: list[str] = []

    def _on_cycles(self) -> set[str]:
        """Anonymous nodes that no named node or unused anonymous node leads to."""
        targets = {
            value
            for values in self._nodes.values()
            for _, value in values
            if isinstance(value, str) and value.startswith('_:')
        }
        pending = [node for node in self._nodes if node not in targets]
        reached = set(pending)
        while pending:
            for _, value in self._nodes.get(pending.pop(), ()):
                if isinstance(value, str) and value.startswith('_:') and value not in reached:
                    reached.add(value)
                    pending.append(value)
        return set(self._nodes) - reached

    def document(self) -> str:
        for subject in self._nodes:
            if subject not in self._inner:
                self._node(subject, 1)
                self._lines.append('')
        header = ['<?xml version="1.0" encoding="utf-8"?>', '<rdf:RDF']
        for namespace, prefix in sorted(self._namespaces.items(), key=lambda item: item[1]):
            name = f'xmlns:{prefix}' if prefix else 'xmlns'
            header.append(f'     {name}={quoteattr(namespace)}')
        header.append(f'     xml:base={quoteattr(self._iri)}>')
        return '\n'.join([*header, '', *self._lines, '</rdf:RDF>', ''])

    def _name(self, iri: str) -> str:
        known = self._names.get(iri)
        if known is not None:
            return known
        cut = max(iri.rfind('#'), iri.rfind('/'), iri.rfind(':')) + 1
        local = next((iri[at:] for at in range(cut, len(iri)) if _is_name(iri[at:])), '')
        namespace = iri[: len(iri) - len(local)]
        if not local or not namespace:
            raise OntologyFileError(f'RDF/XML cannot name <{iri}>; save it as N-Triples (.nt)')
        prefix = self._namespaces.get(namespace)
        if prefix is None:
            prefix = self._namespaces[namespace] = next(self._further)
        name = self._names[iri] = f'{prefix}:{local}' if prefix else local
        return name

    def _identity(self, node: str) -> str:
        if node in self._inner:
            return ''
        if node.startswith('_:'):
            return f' rdf:nodeID={quoteattr(node[2:])}'
        return f' rdf:about={quoteattr(_checked(node))}'

    def _node(self, node: str, depth: int) -> None:
        statements = self._nodes.get(node, [])
        kind = next(
            (
                value
                for predicate, value in statements
                if predicate == RDF + 'type' and isinstance(value, str) and _nameable(value)
            ),
            None,
        )
        name = 'rdf:Description' if kind is None else self._name(kind)
        rest = list(statements)
        if kind is not None:
            rest.remove((RDF + 'type', kind))
        margin = '    ' * depth
        if not rest:
            self._lines.append(f'{margin}<{name}{self._identity(node)}/>')
            return
        self._lines.append(f'{margin}<{name}{self._identity(node)}>')
        for predicate, value in rest:
            self._statement(predicate, value, depth + 1)
        self._lines.append(f'{margin}</{name}>')

    def _statement(self, predicate: str, value: Node, depth: int) -> None:
        margin, name = '    ' * depth, self._name(predicate)
        if isinstance(value, Literal):
            note = ''
            if value.language:
                note = f' xml:lang={quoteattr(value.language)}'
            elif value.datatype != XSD + 'string':
                note = f' rdf:datatype={quoteattr(value.datatype)}'
            text = escape(_checked(value.lexical), {'\r': '&#13;'})
            self._lines.append(f'{margin}<{name}{note}>{text}</{name}>')
            return
        items = self._items(value)
        if items:
            self._lines.append(f'{margin}<{name} rdf:parseType="Collection">')
            for item in items:
                if item in self._inner:
                    self._node(item, depth + 1)
                else:
                    self._lines.append(f'{margin}    <rdf:Description{self._identity(item)}/>')
            self._lines.append(f'{margin}</{name}>')
        elif value in self._inner:
            self._lines.append(f'{margin}<{name}>')
            self._node(value, depth + 1)
            self._lines.append(f'{margin}</{name}>')
        elif value.startswith('_:'):
            self._lines.append(f'{margin}<{name} rdf:nodeID={quoteattr(value[2:])}/>')
        else:
            self._lines.append(f'{margin}<{name} rdf:resource={quoteattr(_checked(value))}/>')

    def _items(self, head: str) -> list[str]:
        """Return the items of a plain list of resources; empty for anything else."""
        items: list[str] = []
        while head != RDF + 'nil':
            cell = dict(self._nodes.get(head, ()))
            first = cell.get(RDF + 'first')
            rest = cell.get(RDF + 'rest')
            if head not in self._inner or not isinstance(first, str) or not isinstance(rest, str):
                return []
            if set(cell) != {RDF + 'first', RDF + 'rest'}:
                return []
            items.append(first)
            head = rest
        return items


def _nameable(iri: str) -> bool:
    return not iri.startswith('_:') and _is_name(re.split('[#/:]', iri)[-1])


def _is_prefix(text: str) -> bool:
    return _is_name(text) and not text.lower().startswith('xml')


def _is_name(text: str) -> bool:
    """Tell whether a text is a name for XML, without a colon.

    Not all that are letters for Python are letters for XML's parsers, so one of these is asked.
    """
    if not _LOCAL.fullmatch(text):
        return False
    if text.isascii():
        return True
    try:
        expat.ParserCreate().Parse(f'<{text}/>', True)
    except expat.ExpatError:
        return False
    return True


def _checked(text: str) -> str:
    found = _NOT_XML.search(text)
    if found:
        raise OntologyFileError(
            f'RDF/XML cannot hold the character {found.group()!r} in {text[:40]!r};'
            ' save it as N-Triples (.nt)'
        )
    return text
