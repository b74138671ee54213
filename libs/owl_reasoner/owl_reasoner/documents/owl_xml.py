"""OWL/XML to axioms (https://www.w3.org/TR/owl2-xml-serialization/)."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from owl_reasoner.documents.structural import MOST_DIGITS, Axioms, Call, blank_label
from owl_reasoner.documents.xml_reading import (
    DEEPEST,
    XML,
    OntologyFileError,
    XmlReader,
    is_absolute,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF

_ROOT = re.compile(
    rb'(?>\s|<\?.*?\?>|<!--.*?-->|<!DOCTYPE[^\[>]*(?:\[.*?\]\s*)?>)*+'
    rb'<(?:[\w.-]+:)?Ontology\s[^>]*=\s*["\']http://www\.w3\.org/2002/07/owl#["\'][^>]*>',
    re.DOTALL,
)
_ENTITIES = {
    'Class',
    'Datatype',
    'ObjectProperty',
    'DataProperty',
    'AnnotationProperty',
    'NamedIndividual',
}
_TEXTS = {'Literal', 'IRI', 'AbbreviatedIRI', 'Import'}
_PLAIN = RDF + 'PlainLiteral'


def is_owl_xml(data: bytes) -> bool:
    """Tell whether a document's root is OWL/XML's, and no node of RDF/XML."""
    root = _ROOT.match(data)
    return root is not None and b'rdf:' not in root[0].rpartition(b'<')[2]


@dataclass(slots=True)
class _Element:
    name: str
    attributes: dict[str, str]
    line: int
    base: str
    language: str
    parts: list[Any] = field(default_factory=list)
    text: list[str] = field(default_factory=list)


class _OwlXmlReader(XmlReader):
    def __init__(self, data: bytes, base: str) -> None:
        super().__init__(data)
        self.stated = Axioms(lambda line: line, base)
        self.stated.unsupported = self.unsupported
        self._stack = [_Element('', {}, 0, base, '')]

    def start(self, name: str, attributes: dict[str, str]) -> None:
        above = self._stack[-1]
        if self.depth > DEEPEST:
            raise self.fail(f'constructs nest deeper than {DEEPEST}')
        if not name.startswith(OWL):
            raise self.fail(f'element {name!r} is not of OWL/XML')
        base = self.resolve(above.base, attributes.pop(XML + 'base', above.base))
        language = self.language(attributes, above.language)
        line = self.parser.CurrentLineNumber
        element = _Element(name.removeprefix(OWL), attributes, line, base, language)
        if self.depth == 1 and 'ontologyIRI' in attributes:
            self.stated.iri = self.named(base, attributes['ontologyIRI'])
            if 'versionIRI' in attributes:
                self.stated.version(self.named(base, attributes['versionIRI']))
        self._stack.append(element)

    def named(self, base: str, reference: str) -> str:
        """Return the IRI that a reference stands for.

        The OWL API leaves the base away where an IRI begins with it, and puts it before what is no
        whole IRI. For 'A' with a base ending in '#', and for '/A', that is not RFC 3986.
        """
        if reference[:1] in ('', '#', '.') or reference.startswith('//') or is_absolute(reference):
            return self.resolve(base, reference)
        return self.resolve(base, base + reference)

    def characters(self, text: str) -> None:
        element = self._stack[-1]
        if element.name in _TEXTS:
            element.text.append(text)
        elif text.strip():
            raise self.fail(f'text {text.strip()[:40]!r} where an element is expected')

    def end(self, name: str) -> None:
        element = self._stack.pop()
        if element.name == 'Prefix':
            self.stated.prefixes[self._attribute(element, 'name')] = self._attribute(element, 'IRI')
        elif self.depth == 1:
            self.stated.add(Call(element.name, self._parts(element), element.line))
        elif self.depth:
            self._stack[-1].parts.append(self._part(element))

    def _part(self, element: _Element) -> Any:
        name = element.name
        if name in _ENTITIES:
            iri = self._iri(element)
            # What they are matters where they stand, and is known there but for these two.
            if self._stack[-1].name in ('Declaration', 'HasKey'):
                return Call(name, (iri,), element.line)
            return iri
        if name == 'Literal':
            return self._literal(element)
        text = ''.join(element.text).strip()
        if name == 'IRI' and not text.startswith('_:'):
            return self.named(element.base, text)
        if name == 'AbbreviatedIRI':
            return self._named(text)
        if name in ('IRI', 'AnonymousIndividual'):
            # The OWL API writes an annotation's value without a name as an IRI.
            label = text or '_:' + self._attribute(element, 'nodeID').removeprefix('_:')
            try:
                return blank_label(label)
            except OntologyFileError as error:
                raise self.fail(error.message) from None
        if name == 'Variable':
            return Call(name, (self._iri(element),), element.line)
        return Call(name, self._parts(element), element.line)

    def _parts(self, element: _Element) -> tuple[Any, ...]:
        """Return an element's parts as the functional syntax has them."""
        name, parts = element.name, element.parts
        if name == 'Import':
            return (self.named(element.base, ''.join(element.text).strip()),)
        if 'cardinality' in element.attributes:
            number = element.attributes['cardinality']
            if not (number.isascii() and number.isdigit() and len(number) <= MOST_DIGITS):
                raise self.fail(f'expected a whole number as cardinality, got {number[:40]!r}')
            return (int(number), *parts)
        if name == 'BuiltInAtom':
            return (self._iri(element), *parts)
        if name == 'FacetRestriction':
            return (self.named(element.base, self._attribute(element, 'facet')), *parts)
        if name == 'DatatypeRestriction':
            facets = (part.parts if isinstance(part, Call) else (part,) for part in parts)
            return tuple(part for found in facets for part in found)
        if name == 'HasKey':
            return _key(parts)
        return tuple(parts)

    def _literal(self, element: _Element) -> Literal:
        text = ''.join(element.text)
        if 'datatypeIRI' in element.attributes:
            datatype = self.named(element.base, element.attributes['datatypeIRI'])
            if datatype not in (_PLAIN, RDF + 'langString'):
                return Literal(text, datatype)
        if element.language:
            return Literal(text, RDF + 'langString', element.language)
        return Literal(text)

    def _iri(self, element: _Element) -> str:
        if 'abbreviatedIRI' in element.attributes:
            return self._named(element.attributes['abbreviatedIRI'])
        return self.named(element.base, self._attribute(element, 'IRI'))

    def _named(self, name: str) -> str:
        iri = self.stated.named(name)
        if iri is None:
            raise self.fail(f'the prefix of {name!r} is not declared')
        return self.resolve('', iri)

    def _attribute(self, element: _Element, name: str) -> str:
        if name not in element.attributes:
            raise self.fail(f'{element.name} lacks its attribute {name}')
        return element.attributes[name]


def _key(parts: list[Any]) -> tuple[Any, ...]:
    """Return the class of a key, its object properties and its data properties."""
    notes = [part for part in parts if isinstance(part, Call) and part.name == 'Annotation']
    first, *rest = [part for part in parts if part not in notes] or ['']
    datas = [part for part in rest if isinstance(part, Call) and part.name == 'DataProperty']
    objects = tuple(_bare(part) for part in rest if part not in datas)
    return (*notes, _bare(first), objects, tuple(map(_bare, datas)))


def _bare(part: Any) -> Any:
    return part.parts[0] if isinstance(part, Call) and part.name in _ENTITIES else part


def parse_owl_xml(data: bytes, base: str) -> Axioms:
    """Parse a document.

    Raises:
        OntologyFileError: With line and column.
    """
    reader = _OwlXmlReader(data, base)
    reader.read()
    return reader.stated
