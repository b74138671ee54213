"""OWL 2 functional-style syntax to axioms (https://www.w3.org/TR/owl2-syntax/)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from owl_reasoner.documents.structural import MOST_DIGITS, Axioms, Call, blank_label
from owl_reasoner.documents.xml_reading import (
    DEEPEST,
    OntologyFileError,
    legal,
    resolve,
)
from owl_reasoner.owl.expressions import Literal, language_tag
from owl_reasoner.owl.vocabulary import RDF

_START = re.compile(rb'(?:\s++|#[^\n]*+\n)*+(?:Prefix|Ontology)\s*\(')
_TOKEN = re.compile(
    r'(?P<space>\s+|#[^\n]*)|<(?P<iri>[^<>"\r\n]*)>|"(?P<text>[^"\\]*+(?:\\.[^"\\]*+)*+)"'
    r'|(?P<mark>\^\^|[()=])'
    r'|@(?P<language>[A-Za-z0-9-]+)|(?P<name>[^\s()<>"=^@]+)',
    re.DOTALL,
)


def is_functional(data: bytes) -> bool:
    """Tell whether a document begins as functional syntax does."""
    return _START.match(data) is not None


def parse_functional(text: str, base: str) -> Axioms:
    """Parse a document.

    Args:
        text: The document.
        base: For relative IRIs, where the ontology names none.

    Raises:
        OntologyFileError: With line and column.
    """
    return _Parser(text, base).stated


class _Parser:
    def __init__(self, text: str, base: str) -> None:
        self._text, self._base = text, base
        self._iris: dict[str, str] = {}
        self._tokens = self._read_tokens()
        self.stated = Axioms(self._line, base)
        self._ended = False
        self._next = next(self._tokens)
        while self._next[0] != 'end':
            self._top()

    def _line(self, place: int) -> int:
        return self._text.count('\n', 0, place) + 1

    # --- tokens ---

    def _fail(self, message: str, place: int) -> OntologyFileError:
        column = place - self._text.rfind('\n', 0, place)
        return OntologyFileError(message, self._line(place), column)

    def _read_tokens(self) -> Iterator[tuple[str, str, int]]:
        text, place = self._text, 0
        while place < len(text):
            found = _TOKEN.match(text, place)
            if found is None:
                raise self._fail(f'unexpected {text[place : place + 20]!r}', place)
            kind = found.lastgroup or ''
            if kind != 'space':
                yield kind, found[kind], place
            place = found.end()
        yield 'end', '', len(text)

    def _take(self, mark: str = '') -> tuple[str, str, int]:
        token = self._next
        if mark and (token[0] != 'mark' or token[1] != mark):
            raise self._fail(f'expected {mark!r}, got {token[1] or "the end"!r}', token[2])
        if token[0] == 'end':
            raise self._fail('the document ends inside a construct', token[2])
        self._next = next(self._tokens)
        return token

    # --- structure ---

    def _top(self) -> None:
        kind, name, place = self._take()
        if kind != 'name' or name not in ('Prefix', 'Ontology'):
            raise self._fail(f'expected Prefix( or Ontology(, got {name!r}', place)
        if self._ended:
            raise self._fail(f'{name} after the end of the ontology', place)
        self._take('(')
        if name == 'Prefix':
            _, prefix, _ = self._next if self._next[1] == '=' else self._take()
            self._take('=')
            _, iri, _ = self._take()
            self.stated.prefixes[('' if prefix == '=' else prefix).removesuffix(':')] = iri
            self._take(')')
            return
        if self._next[0] == 'iri':
            _, iri, place = self._take()
            self.stated.iri = self._base = self._iri(iri, place)
            if self._next[0] == 'iri':
                _, iri, place = self._take()
                self.stated.version(self._iri(iri, place))
        while self._next[:2] != ('mark', ')'):
            place = self._next[2]
            axiom = self._part(0)
            if not isinstance(axiom, Call):
                raise self._fail(f'expected an axiom, got {axiom!r}', place)
            self.stated.add(axiom)
        self._take(')')
        self._ended = True

    def _part(self, depth: int) -> Any:
        kind, value, place = self._take()
        if depth > DEEPEST:
            raise self._fail(f'constructs nest deeper than {DEEPEST}', place)
        if kind == 'iri':
            # The OWL API writes <_:a> as the value of an annotation.
            unnamed = value.startswith('_:')
            return self._named(value, place) if unnamed else self._iri(value, place)
        if kind == 'text':
            return self._literal(re.sub(r'\\(.)', r'\1', value, flags=re.DOTALL))
        if (kind, value) == ('mark', '('):
            group = []
            while self._next[:2] != ('mark', ')'):
                group.append(self._part(depth + 1))
            self._take(')')
            return tuple(group)
        if kind != 'name':
            raise self._fail(f'unexpected {value!r}', place)
        if ':' in value or self._next[:2] != ('mark', '('):
            return self._named(value, place)
        self._take('(')
        parts = []
        while self._next[:2] != ('mark', ')'):
            parts.append(self._part(depth + 1))
        self._take(')')
        return Call(value, tuple(parts), place)

    def _literal(self, text: str) -> Literal:
        if self._next[0] == 'language':
            _, tag, place = self._take()
            try:
                return Literal(text, RDF + 'langString', language_tag(tag))
            except ValueError as error:
                self.stated.unsupported.append(f'line {self._line(place)}: {error}')
                return Literal(text)
        if self._next[:2] == ('mark', '^^'):
            self._take()
            kind, value, place = self._take()
            datatype = self._iri(value, place) if kind == 'iri' else self._named(value, place)
            return Literal(text, str(datatype))
        return Literal(text)

    def _named(self, name: str, place: int) -> str | int:
        if name.isascii() and name.isdigit():
            if len(name) > MOST_DIGITS:
                raise self._fail(f'a number of {len(name)} digits', place)
            return int(name)
        if name.startswith('_:'):
            try:
                return blank_label(name)
            except OntologyFileError as error:
                raise self._fail(error.message, place) from None
        iri = self.stated.named(name)
        if iri is None:
            raise self._fail(f'the prefix of {name!r} is not declared', place)
        return self._iri(iri, place)

    def _iri(self, reference: str, place: int) -> str:
        iri = self._iris.get(reference)
        if iri is None:
            try:
                iri = resolve(self._base, legal(reference, {}, self.stated.unsupported))
                self._iris[reference] = iri
            except OntologyFileError as error:
                raise self._fail(error.message, place) from None
        return iri
