"""XML as ontology documents use it: the place of every error, and nothing that expands itself.

Document type declarations may define short plain-text entities (Protégé writes namespaces that
way); entities inside entities, external ones and parameter entities are refused.
"""

from __future__ import annotations

import re
from urllib.parse import quote, urljoin
from xml.parsers import expat

from owl_reasoner.owl.expressions import language_tag

_ABSOLUTE = re.compile(r'[A-Za-z][A-Za-z0-9+.\-]*:')
_EMPTY_END = re.compile(r'(?:\?#|[?#])\Z')
FORBIDDEN = re.compile(r'[\x00-\x20<>"{}|\\^`]')
_REFERENCE = re.compile(
    rb'<!--.*?-->|<!\[CDATA\[.*?\]\]>|<\?.*?\?>|&([^\s#&;<>"\'][^\s&;<>"\']*);', re.DOTALL
)
"""An entity in the text or an attribute, or what holds none whatever stands in it."""
_ESCAPED = re.compile(r'&(?:amp|lt|gt|quot|apos|#\d{1,7}|#x[0-9A-Fa-f]{1,6});')
_MAX_ENTITY = 512
_MAX_DEPTH = 20_000
DEEPEST = 100
"""How deep expressions may nest; what reads, derives and writes them is recursive."""
XML = 'http://www.w3.org/XML/1998/namespace'
_LANGUAGE = XML + 'lang'


class OntologyFileError(ValueError):
    """A document that cannot be read, or an ontology that cannot be written.

    Its text is one line: path, line and column where they are known, and what was expected.

    Attributes:
        message: What was wrong.
        line, column: From 1; 0 when not known.
        path: The document; '' when not known.
    """

    def __init__(self, message: str, line: int = 0, column: int = 0, path: str = '') -> None:
        super().__init__(message)
        self.message = ' '.join(message.split())
        self.line, self.column, self.path = line, column, path

    def __str__(self) -> str:
        place = f':{self.line}:{self.column}' if self.line else ''
        return f'{self.path}{place}: {self.message}' if self.path else self.message


class IllFormedError(OntologyFileError):
    """A statement that says nothing: it is left out, and reported."""


def is_absolute(reference: str) -> bool:
    """Tell whether an IRI reference names its scheme."""
    return _ABSOLUTE.match(reference) is not None


def percent_encoded(iri: str) -> str:
    """Return an IRI in which each character that none may hold is percent-encoded."""
    return FORBIDDEN.sub(lambda character: quote(character[0]), iri)


def legal(iri: str, known: dict[str, str], reports: list[str]) -> str:
    """Return an IRI as `percent_encoded` does, and report it.

    The OWL API takes such names as they are, and writes files that others cannot read.

    Args:
        iri: The IRI or relative reference.
        known: What was returned for those that were reported.
        reports: Where the first use of each is reported.
    """
    found = FORBIDDEN.search(iri)
    if found and iri not in known:
        known[iri] = percent_encoded(iri)
        reports.append(f'IRI {iri!r} contains {found[0]!r}, it is read as <{known[iri]}>')
    return known[iri] if found else iri


def resolve(base: str, reference: str) -> str:
    """Return an IRI reference against a base IRI (RFC 3986).

    Raises:
        OntologyFileError: It is none.
    """
    if is_absolute(reference):
        return reference
    stem = base.partition('#')[0]
    if not reference:
        return stem
    if reference[0] == '#':
        return stem + reference
    try:
        joined = urljoin(stem, reference)
        # Python leaves out a query or fragment that is empty, by which two names would be one.
        empty = _EMPTY_END.search(reference)
        return joined + empty[0] if empty and not joined.endswith(empty[0]) else joined
    except ValueError as error:
        raise OntologyFileError(f'IRI {reference!r} with base {stem!r}: {error}') from None


class XmlReader:
    """Goes through a document; `start`, `end` and `characters` are told what it holds.

    Names are namespace and local name in one.

    Args:
        data: The document, UTF-8 whatever it declares.

    Attributes:
        unsupported: One sentence for each language or IRI that is none.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.depth = 0
        self.unsupported: list[str] = []
        self._legal: dict[str, str] = {}
        self._absolute: dict[str, str] = {}
        self._entities = {b'amp', b'lt', b'gt', b'quot', b'apos'}
        parser = expat.ParserCreate('UTF-8', namespace_separator='')
        parser.buffer_text = True
        parser.namespace_prefixes = False
        parser.StartElementHandler = self._start
        parser.EndElementHandler = self._end
        parser.CharacterDataHandler = self.characters
        parser.StartNamespaceDeclHandler = self.namespace
        parser.EntityDeclHandler = self._entity
        parser.ExternalEntityRefHandler = self._external
        parser.StartDoctypeDeclHandler = self._doctype
        parser.EndDoctypeDeclHandler = self._end_doctype
        self._has_external = False
        self.parser = parser

    def read(self) -> None:
        """Go through the document.

        Raises:
            OntologyFileError: With line and column.
        """
        try:
            self.parser.Parse(self.data, True)
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            place = error.lineno, error.offset + 1
            raise OntologyFileError(f'not well-formed XML: {reason}', *place) from None

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Take in the start of an element."""
        raise NotImplementedError

    def end(self, name: str) -> None:
        """Take in the end of an element."""
        raise NotImplementedError

    def characters(self, text: str) -> None:
        """Take in text."""
        raise NotImplementedError

    def namespace(self, prefix: str | None, iri: str | None) -> None:
        """Take in the declaration of a namespace."""

    def fail(self, message: str) -> OntologyFileError:
        """Return an error with the place that is being read."""
        parser = self.parser
        return OntologyFileError(message, parser.CurrentLineNumber, parser.CurrentColumnNumber + 1)

    def language(self, attributes: dict[str, str], outer: str) -> str:
        """Take the language tag of an element; that of the one around it where it has none.

        What is no tag is reported, and the texts are kept without one.
        """
        if _LANGUAGE not in attributes:
            return outer
        try:
            return language_tag(attributes.pop(_LANGUAGE))
        except ValueError as error:
            self.unsupported.append(f'line {self.parser.CurrentLineNumber}: xml:lang {error}')
            return ''

    def resolve(self, base: str, reference: str) -> str:
        """Return an IRI reference against a base IRI; an absolute IRI is one text throughout."""
        known = self._absolute.get(reference)
        if known is not None:
            return known
        try:
            found = resolve(base, legal(reference, self._legal, self.unsupported))
        except OntologyFileError as error:
            raise self.fail(error.message) from None
        if found == reference and is_absolute(found):
            self._absolute[found] = found
        return found

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise self.fail(f'elements nest deeper than {_MAX_DEPTH}')
        self.start(name, attributes)

    def _end(self, name: str) -> None:
        self.depth -= 1
        self.end(name)

    def _external(self, *_: object) -> int:
        raise self.fail('external entities are refused')

    def _entity(self, name: str, is_parameter: bool, value: str | None, *_: object) -> None:
        if is_parameter or value is None:
            raise self.fail(f'entity {name!r} is refused: only plain text may stand in an entity')
        # A character that is escaped makes the text shorter; another entity could make it longer.
        if '&' in _ESCAPED.sub('', value) or '<' in value or len(value) > _MAX_ENTITY:
            expected = f'plain text of at most {_MAX_ENTITY} characters, no other entity'
            raise self.fail(f'entity {name!r} is refused: expected {expected}')
        self._entities.add(name.encode())

    def _doctype(self, _name: str, system: str | None, *_: object) -> None:
        self._has_external = system is not None

    def _end_doctype(self) -> None:
        # Without an external subset the parser refuses them itself; with one it leaves them out.
        for found in _REFERENCE.finditer(self.data) if self._has_external else ():
            if found[1] is not None and found[1] not in self._entities:
                line = self.data.count(b'\n', 0, found.start()) + 1
                name = found[1].decode(errors='replace')
                raise OntologyFileError(f'entity {name!r} is not declared here', line, 1)
