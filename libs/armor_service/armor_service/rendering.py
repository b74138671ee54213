"""How entities, literals and facts are written in directives and answers, and read back.

The forms are those of the OWL API's ``toString``, which clients of ARMOR split by hand:
``<http://example.org/place#R1>``, ``owl:Thing``, ``"1665579740"^^xsd:long``, ``"x"@en``.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence
from decimal import Decimal
from functools import lru_cache

from armor_service.facts import SAME_AS, ShortFact
from armor_service.protocol import RENDERED, DirectiveError, ExitCode, unescaped
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SameIndividual,
)
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS, XSD, local_name
from owl_reasoner.reasoner.datatypes import parse_value

MAX_NAME = 2048
PREFIXES = {'owl': OWL, 'xsd': XSD, 'rdf': RDF, 'rdfs': RDFS}
_FORBIDDEN_IN_IRI = re.compile(r'[\x00-\x20<>"{}|\\^`\x7f-\x9f\ud800-\udfff]')
_BARE_PERCENT = re.compile(r'%(?![0-9A-Fa-f]{2})')
_FORBIDDEN_IN_TEXT = re.compile(r'[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]')
_ABSOLUTE_IRI = re.compile(r'[A-Za-z][A-Za-z0-9+.-]*:[^\s]+\Z')
_INTEGER = re.compile(r'[+-]?[0-9]+\Z')
_MAX_DIGITS = 4000
_NUMBERS = frozenset(
    XSD + name
    for name in (
        *('integer', 'long', 'int', 'short', 'byte', 'decimal', 'float', 'double'),
        *('nonNegativeInteger', 'positiveInteger', 'nonPositiveInteger', 'negativeInteger'),
        *('unsignedLong', 'unsignedInt', 'unsignedShort', 'unsignedByte'),
    )
)
_INTEGER_RANGES = {'integer': 31, 'long': 63}

TYPES = {
    'STRING': 'string',
    'INT': 'integer',
    'INTEGER': 'integer',
    'LONG': 'long',
    'FLOAT': 'float',
    'DOUBLE': 'double',
    'BOOLEAN': 'boolean',
    'BOOL': 'boolean',
}
"""Type words of directives (any letter case) and the XML Schema datatype each is stored as."""


def render_entity(iri: str) -> str:
    """``<iri>``, the abbreviated name of a built-in such as ``owl:Thing``, or ``_:label``."""
    if iri.startswith('_:'):
        return iri
    if iri.startswith(OWL):
        return 'owl:' + iri[len(OWL) :]
    return f'<{iri}>'


def render_literal(literal: Literal) -> str:
    """``"lexical"^^xsd:type`` or ``"text"@language``, quotes and backslashes escaped."""
    text = literal.lexical
    if '"' in text or '\\' in text:
        text = text.replace('\\', '\\\\').replace('"', '\\"')
    if literal.language:
        return f'"{text}"@{literal.language}'
    return f'"{text}"^^{render_datatype(literal.datatype)}'


def render_datatype(iri: str) -> str:
    """``xsd:long`` for a built-in datatype, ``<iri>`` for any other."""
    if iri.startswith(XSD):
        return 'xsd:' + iri[len(XSD) :]
    for prefix, namespace in PREFIXES.items():
        if iri.startswith(namespace):
            return f'{prefix}:{iri[len(namespace) :]}'
    return f'<{iri}>'


def short_facts(axiom: Axiom) -> Sequence[ShortFact]:
    """Return the short forms of an assertion; empty for any other axiom."""
    if isinstance(axiom, ClassAssertion):
        if isinstance(axiom.cls, str):
            return (ShortFact(local_name(axiom.cls), (local_name(axiom.individual),)),)
    elif isinstance(axiom, ObjectPropertyAssertion):
        names = (local_name(axiom.subject), local_name(axiom.object))
        return (ShortFact(local_name(axiom.prop), names),)
    elif isinstance(axiom, DataPropertyAssertion):
        value = render_literal(axiom.literal)
        return (ShortFact(local_name(axiom.prop), (local_name(axiom.subject), value)),)
    elif isinstance(axiom, SameIndividual):
        first, *others = sorted(map(local_name, axiom.individuals))
        return tuple(ShortFact(SAME_AS, (first, other)) for other in others)
    return ()


@lru_cache(maxsize=65536)
def parse_entity(text: str, base: str) -> str:
    """Read an entity argument: a local name, ``<iri>``, a full IRI, ``owl:Thing`` or ``_:label``.

    Args:
        text: The argument.
        base: IRI of the ontology; a local name stands for ``base#name``.

    Raises:
        ValueError: The name is empty, too long, or has characters an IRI cannot hold.
    """
    if not text:
        raise ValueError('is empty, expected a name')
    if len(text) > MAX_NAME:
        raise ValueError(f'has {len(text)} characters, expected at most {MAX_NAME}')
    name = text
    full = False
    if name[0] == '<' and name[-1] == '>':
        name, full = name[1:-1], True
    if _BARE_PERCENT.search(name):
        raise ValueError(f"{shown(text)} has a bare '%', in an IRI written %25")
    if found := _FORBIDDEN_IN_IRI.search(name):
        raise ValueError(
            f'{shown(text)} has the character {found.group()!r}, not allowed in an IRI'
        )
    prefix, colon, rest = name.partition(':')
    if prefix == '_' and rest:
        return name
    if not full and colon and prefix in PREFIXES and rest:
        return PREFIXES[prefix] + rest
    if full or '://' in name or prefix == 'urn':
        if not _ABSOLUTE_IRI.match(name):
            raise ValueError(f'{shown(text)} is not a full IRI')
        return name
    if '#' in name:
        raise ValueError(f"{shown(text)} has the character '#', expected a local name or <iri>")
    return f'{base}#{name}'


def parse_literal(
    type_word: str, text: str, *, narrow_doubles: bool = False, stored: bool = False
) -> Literal:
    """Read a value argument: its bare lexical form, or the form that answers have.

    Args:
        type_word: A key of `TYPES`, in capitals.
        text: ``10`` or ``"10"^^xsd:long`` or ``"10"^^<http://www.w3.org/2001/XMLSchema#long>``.
        narrow_doubles: Store DOUBLE as xsd:float, as ARMOR 2.2 does.
        stored: The value is one that an answer showed, to be retracted: whatever was shown is read.

    Raises:
        ValueError: The text is not a value of the type.
    """
    if found := _FORBIDDEN_IN_TEXT.search(text):
        raise ValueError(
            f'{shown(text)} has the character {found.group()!r}, which XML cannot hold'
        )
    wanted = TYPES[type_word]
    if wanted == 'double' and narrow_doubles:
        wanted = 'float'
    if text[:1] == '"' and (match := RENDERED.match(text)):
        rendered = _rendered_literal(match)
        typed = bool(match['iri'] or match['name'] or match['language'])
        if rendered is not None and not typed and wanted != 'string':
            text = rendered.lexical
        elif rendered is not None and typed and (stored or _is_of(wanted, rendered)):
            return rendered
        elif wanted != 'string':
            raise ValueError(f'{shown(text)} is not a value of {type_word}')
    return Literal(_lexical(wanted, text, type_word), XSD + wanted)


def parse_rendered(text: str) -> Literal:
    """Read a literal as answers have it, ``"10"^^xsd:long``.

    Raises:
        ValueError: Not of that form.
    """
    match = RENDERED.match(text)
    literal = _rendered_literal(match) if match else None
    if literal is None:
        raise ValueError(f'{shown(text)} is not a literal, expected "text"^^xsd:type')
    return literal


def _rendered_literal(match: re.Match[str]) -> Literal | None:
    text = unescaped(match['text'])
    if match['language']:
        # Language tags mean the same in any case (RDF 1.1); files are read in lower case.
        return Literal(text, RDF + 'langString', match['language'].lower())
    if match['iri']:
        return Literal(text, match['iri'])
    if not match['name']:
        return Literal(text, XSD + 'string')
    prefix, colon, rest = match['name'].partition(':')
    if colon and prefix in PREFIXES:
        return Literal(text, PREFIXES[prefix] + rest)
    return Literal(text, match['name']) if '://' in match['name'] else None


def _is_of(wanted: str, literal: Literal) -> bool:
    """Tell whether a literal with its own datatype is a value of the kind that is wanted."""
    if wanted == 'string':
        return literal.datatype == XSD + 'string' or bool(literal.language)
    try:
        parse_value(literal)
    except ValueError:
        return False
    return literal.datatype in ((XSD + 'boolean',) if wanted == 'boolean' else _NUMBERS)


def _lexical(wanted: str, text: str, type_word: str) -> str:
    if wanted == 'string':
        return text
    if wanted == 'boolean':
        return 'true' if text.lower() == 'true' else 'false'
    if wanted in _INTEGER_RANGES:
        bits = _INTEGER_RANGES[wanted]
        if not _INTEGER.match(text) or len(text) > _MAX_DIGITS:
            raise ValueError(f'{shown(text)} is not a whole number, expected {type_word}')
        number = int(text)
        if not -(1 << bits) <= number < 1 << bits:
            raise ValueError(f'{shown(text)} is out of range, {type_word} has {bits + 1} bits')
        return str(number)
    return _java_float(_number(text, type_word), single=wanted == 'float')


def _number(text: str, type_word: str) -> float:
    word = text.strip()
    special = {'INF': math.inf, '+INF': math.inf, '-INF': -math.inf}
    special |= {'Infinity': math.inf, '-Infinity': -math.inf, 'NaN': math.nan}
    if word in special:
        return special[word]
    if not re.match(r'[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z', word):
        raise ValueError(f'{shown(text)} is not a number, expected {type_word}')
    return float(word)


def _java_float(number: float, *, single: bool) -> str:
    """Shortest decimal form that reads back as the same number, written as Java writes it."""
    if math.isnan(number):
        return 'NaN'
    if single and math.isfinite(number):
        try:
            number = struct.unpack('f', struct.pack('f', number))[0]
        except OverflowError:
            number = math.copysign(math.inf, number)
    if math.isinf(number):
        return 'INF' if number > 0 else '-INF'
    digits = Decimal(_shortest(number) if single else repr(number))
    if number == 0 or 1e-3 <= abs(number) < 1e7:
        plain = f'{digits:f}'
        return plain if '.' in plain else plain + '.0'
    mantissa, _, exponent = f'{digits.normalize():e}'.partition('e')
    return f'{mantissa if "." in mantissa else mantissa + ".0"}E{int(exponent)}'


def _shortest(number: float) -> str:
    packed = struct.pack('f', number)
    for precision in range(1, 10):
        digits = f'{number:.{precision}g}'
        if struct.pack('f', float(digits)) == packed:
            return digits
    return repr(number)


def one_line(text: str, limit: int = 2000) -> str:
    """Return a text for a log: control characters escaped, cut when it is long.

    Without it a client could write lines of its own into a log, or commands to a terminal.
    """
    if len(text) > limit:
        text = text[: limit - 3] + '...'
    if text.isprintable():
        return text
    return ''.join(char if char.isprintable() else repr(char)[1:-1] for char in text)


def shown(text: str, limit: int = 80) -> str:
    """Return a text in quotes for a message, cut when it is long."""
    return repr(text) if len(text) <= limit else repr(text[: limit - 3]) + '...'


def unsupported_type(word: str, prop: str, verb: str, ind: str, *, success: bool) -> DirectiveError:
    """ARMOR's answer to a value type outside `TYPES`, with its own words (and missing space)."""
    word, prop, ind = (text if text.isprintable() else shown(text) for text in (word, prop, ind))
    return DirectiveError(
        f'Value type {word} not supported. {prop}not {verb} {ind}.',
        ExitCode.UNSUPPORTED_TYPE,
        success=success,
    )
