"""RDF/XML to triples, with exact datatypes and the place of every error.

Follows RDF 1.1 XML Syntax (https://www.w3.org/TR/rdf-syntax-grammar/).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TypeAlias

from owl_reasoner.documents.xml_reading import (
    XML,
    OntologyFileError,
    XmlReader,
    legal,
    percent_encoded,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import RDF, XSD

Node: TypeAlias = str | Literal
Triple: TypeAlias = tuple[str, str, Node]

_TYPE, _DESCRIPTION = RDF + 'type', RDF + 'Description'
_ABOUT, _ID, _NODE_ID, _RESOURCE = (RDF + name for name in ('about', 'ID', 'nodeID', 'resource'))
_DATATYPE, _PARSE_TYPE = RDF + 'datatype', RDF + 'parseType'
_SYNTAX = {_ABOUT, _ID, _NODE_ID, _RESOURCE, _DATATYPE, _PARSE_TYPE, RDF + 'bagID'}
_BASE = XML + 'base'


@dataclass
class Graph:
    """Triples of one document in document order.

    `places` holds (line, column) of the first statement about each subject, `unsupported` one
    sentence for each part that was not understood.
    """

    triples: list[Triple] = field(default_factory=list)
    prefixes: dict[str, str] = field(default_factory=dict)
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    unsupported: list[str] = field(default_factory=list)


@dataclass(slots=True)
class _Frame:
    kind: str  # 'root', 'node', 'property', 'collection', 'empty', 'xml'
    subject: str = ''
    predicate: str = ''
    object: Node | None = None
    datatype: str = ''
    text: list[str] = field(default_factory=list)
    base: str = ''
    language: str = ''
    items: list[str] = field(default_factory=list)
    counter: int = 0
    reified: str = ''


_NAME = re.compile(r'[^\W\d][\w.\-]*')
_TAG = re.compile(rb'<(?:[^"\'>]++|"[^"]*"|\'[^\']*\')*+>')


class _RdfXmlReader(XmlReader):
    def __init__(self, base: str, data: bytes) -> None:
        super().__init__(data)
        self.graph = Graph(unsupported=self.unsupported)
        self.stack = [_Frame('root', base=base)]
        self.blank = 0
        self.ids: set[str] = set()
        self.seen_root = False
        self.odd_names = False

    def namespace(self, prefix: str | None, iri: str | None) -> None:
        namespace = legal(iri or '', self._legal, self.unsupported)
        self.odd_names |= namespace != (iri or '')
        self.graph.prefixes.setdefault(prefix or '', namespace)

    def new_blank(self) -> str:
        self.blank += 1
        return f'_:g{self.blank}'

    def emit(self, subject: str, predicate: str, value: Node, reified: str = '') -> None:
        graph = self.graph
        if subject not in graph.places:
            parser = self.parser
            graph.places[subject] = (parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)
        graph.triples.append((subject, predicate, value))
        if reified:
            graph.triples += [
                (reified, RDF + 'type', RDF + 'Statement'),
                (reified, RDF + 'subject', subject),
                (reified, RDF + 'predicate', predicate),
                (reified, RDF + 'object', value),
            ]

    def named(self, base: str, name: str) -> str:
        iri = self.resolve(base, '#' + name)
        if iri in self.ids:
            raise self.fail(f'rdf:ID {name!r} stands twice in the document')
        self.ids.add(iri)
        return iri

    def blank_named(self, name: str) -> str:
        if not _NAME.fullmatch(name):
            raise self.fail(f'rdf:nodeID {name!r} is no name')
        return '_:n' + name

    def referred(self, base: str, reference: str) -> str:
        """Return what an IRI reference names; `_:a`, which is none, is a nodeID to the OWL API."""
        unnamed = reference.startswith('_:')
        return self.blank_named(reference[2:]) if unnamed else self.resolve(base, reference)

    def start(self, name: str, attributes: dict[str, str]) -> None:
        parent = self.stack[-1]
        if parent.kind == 'xml':
            literal = next(frame for frame in reversed(self.stack) if frame.predicate)
            literal.items = ['markup']
            self.stack.append(_Frame('xml'))
            return
        base, language = parent.base, parent.language
        if self.odd_names:
            name = percent_encoded(name)
            attributes = {percent_encoded(key): value for key, value in attributes.items()}
        if attributes:
            if _BASE in attributes:
                base = self.resolve(base, attributes.pop(_BASE))
            language = self.language(attributes, language)
        if parent.kind == 'root':
            if name == RDF + 'RDF' and not self.seen_root:
                self.seen_root = True
                self.stack.append(_Frame('root', base=base, language=language))
                return
            if not self.seen_root and ':' not in name:
                raise self.fail(f'expected rdf:RDF, got element {name!r} without a namespace')
            self.seen_root = True
            self.node(name, attributes, base, language)
        elif parent.kind == 'node':
            self.property(name, attributes, base, language, parent)
        elif parent.kind == 'collection':
            parent.items.append(self.node(name, attributes, base, language))
        elif parent.kind == 'property':
            if parent.object is not None:
                raise self.fail(f'second value {name!r} inside one property element')
            parent.object = self.node(name, attributes, base, language)
        else:
            raise self.fail(f'element {name!r} inside a property that has its value already')

    def node(self, name: str, attributes: dict[str, str], base: str, language: str) -> str:
        if ':' not in name:
            raise self.fail(f'element {name!r} has no namespace')
        about = attributes.pop(_ABOUT, None)
        ident = attributes.pop(_ID, None)
        node_id = attributes.pop(_NODE_ID, None)
        if [about, ident, node_id].count(None) < 2:
            raise self.fail('expected one of rdf:about, rdf:ID and rdf:nodeID')
        if about is not None:
            subject = self.referred(base, about)
        elif ident is not None:
            subject = self.named(base, ident)
        elif node_id is not None:
            subject = self.blank_named(node_id)
        else:
            subject = self.new_blank()
        if name != _DESCRIPTION:
            self.emit(subject, _TYPE, name)
        for key, value in attributes.items():
            self.attribute(subject, key, value, base, language)
        self.stack.append(_Frame('node', subject, base=base, language=language))
        return subject

    def attribute(self, subject: str, key: str, value: str, base: str, language: str) -> None:
        if key == _TYPE:
            self.emit(subject, key, self.resolve(base, value))
        elif ':' not in key:
            raise self.fail(f'attribute {key!r} has no namespace')
        elif key in _SYNTAX:
            raise self.fail(f'attribute {key!r} does not belong here')
        else:
            self.emit(subject, key, _text(value, '', language))

    def property(
        self, name: str, attributes: dict[str, str], base: str, language: str, parent: _Frame
    ) -> None:
        if ':' not in name:
            raise self.fail(f'property element {name!r} has no namespace')
        if name == RDF + 'li':
            parent.counter += 1
            name = f'{RDF}_{parent.counter}'
        frame = _Frame('property', parent.subject, name, base=base, language=language)
        self.stack.append(frame)
        if not attributes:
            return
        if len(attributes) == 1 and _RESOURCE in attributes:
            frame.kind, frame.object = 'empty', self.referred(base, attributes[_RESOURCE])
            return
        ident = attributes.pop(_ID, None)
        if ident is not None:
            frame.reified = self.named(base, ident)
        parse_type = attributes.pop(_PARSE_TYPE, None)
        frame.datatype = attributes.pop(_DATATYPE, '')
        if frame.datatype:
            frame.datatype = self.resolve(base, frame.datatype)
        resource = attributes.pop(_RESOURCE, None)
        node_id = attributes.pop(_NODE_ID, None)
        kinds = (parse_type, frame.datatype or None, resource, node_id)
        if kinds.count(None) < 3 or (attributes and (parse_type or frame.datatype)):
            raise self.fail(f'property {name!r} has attributes that exclude each other')
        if parse_type == 'Collection':
            frame.kind = 'collection'
        elif parse_type == 'Resource':
            frame.kind = 'node'
            self.emit(frame.subject, name, blank := self.new_blank(), frame.reified)
            frame.subject, frame.predicate = blank, ''
        elif parse_type is not None:
            frame.kind, frame.datatype = 'xml', RDF + 'XMLLiteral'
            tag = _TAG.match(self.data, self.parser.CurrentByteIndex)
            frame.counter = tag.end() if tag else self.parser.CurrentByteIndex
        elif resource is not None:
            frame.kind, frame.object = 'empty', self.referred(base, resource)
        elif node_id is not None:
            frame.kind, frame.object = 'empty', self.blank_named(node_id)
        elif attributes:
            frame.kind, frame.object = 'empty', self.new_blank()
        if attributes:
            assert isinstance(frame.object, str)
            for key, value in attributes.items():
                self.attribute(frame.object, key, value, base, language)

    def characters(self, text: str) -> None:
        frame = self.stack[-1]
        if frame.kind == 'property' or frame.kind == 'xml':
            frame.text.append(text)
        elif text.strip():
            raise self.fail(f'text {text.strip()[:40]!r} where an element is expected')

    def end(self, name: str) -> None:
        frame = self.stack.pop()
        if frame.kind == 'property':
            value = frame.object
            text = ''.join(frame.text)
            if value is not None and frame.datatype:
                raise self.fail('an element where rdf:datatype announces text')
            if value is None:
                value = _text(text, frame.datatype, frame.language)
            elif text.strip():
                raise self.fail(f'text {text.strip()[:40]!r} beside an element')
            self.emit(frame.subject, frame.predicate, value, frame.reified)
        elif frame.kind == 'empty':
            assert frame.object is not None
            self.emit(frame.subject, frame.predicate, frame.object, frame.reified)
        elif frame.kind == 'collection':
            head = RDF + 'nil'
            for item in reversed(frame.items):
                cell = self.new_blank()
                self.emit(cell, RDF + 'first', item)
                self.emit(cell, RDF + 'rest', head)
                head = cell
            self.emit(frame.subject, frame.predicate, head, frame.reified)
        elif frame.kind == 'xml' and frame.predicate:
            text = ''.join(frame.text)
            if frame.items:  # With elements inside, the literal is what is written.
                inside = self.data[frame.counter : self.parser.CurrentByteIndex]
                text = inside.decode()
            value = Literal(text, frame.datatype)
            self.emit(frame.subject, frame.predicate, value, frame.reified)


def _text(text: str, datatype: str, language: str) -> Literal:
    if datatype:
        return Literal(text, datatype)
    if language:
        return Literal(text, RDF + 'langString', language)
    return Literal(text, XSD + 'string')


def parse_rdf_xml(data: bytes, base: str) -> Graph:
    """Parse a document.

    Raises:
        OntologyFileError: With line and column, for anything that is not RDF/XML or would expand
            entities.
    """
    reader = _RdfXmlReader(base, data)
    reader.read()
    if not reader.seen_root:
        raise OntologyFileError('the document holds no element', 1, 1)
    return reader.graph
