"""Literals by value: value spaces, lexical forms, order (XML Schema 1.1 part 2, OWL 2 section 4).

A value is a hashable Python object that is equal to another exactly where the value spaces say so:
whole numbers of the decimal space are `int`, other decimals `Fraction`, plain strings `str`; any
other value is a tuple that begins with the name of its space. Values of xsd:float and xsd:double
are never equal to decimals.
"""

from __future__ import annotations

import base64
import contextlib
import math
import re
import struct
from fractions import Fraction
from functools import cache
from typing import Any, TypeAlias
from xml.etree import ElementTree

from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, XSD
from owl_reasoner.reasoner import datetimes
from owl_reasoner.reasoner.datetimes import moment_of, text_of

Value: TypeAlias = 'int | Fraction | str | tuple[Any, ...]'

_INTEGER = re.compile(r'[+-]?[0-9]+')
_DECIMAL = re.compile(r'[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)')
_FLOAT = re.compile(r'[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?')
_HEXADECIMAL = re.compile(r'(?:[0-9a-fA-F]{2})*')
_SPACES = ' \t\n\r'
_DIGITS_AT_ONCE = 4000
"""What Python converts, which has a limit of 4,300 digits (`sys.set_int_max_str_digits`)."""

BOUNDS: dict[str, tuple[int | None, int | None]] = {
    'integer': (None, None),
    'nonNegativeInteger': (0, None),
    'nonPositiveInteger': (None, 0),
    'positiveInteger': (1, None),
    'negativeInteger': (None, -1),
    'long': (-(2**63), 2**63 - 1),
    'int': (-(2**31), 2**31 - 1),
    'short': (-(2**15), 2**15 - 1),
    'byte': (-(2**7), 2**7 - 1),
    'unsignedLong': (0, 2**64 - 1),
    'unsignedInt': (0, 2**32 - 1),
    'unsignedShort': (0, 2**16 - 1),
    'unsignedByte': (0, 2**8 - 1),
}
STRING_PATTERNS = {
    'normalizedString': re.compile(r'[^\t\n\r]*'),
    'token': re.compile(r'(?:[^ \t\n\r]+(?: [^ \t\n\r]+)*)?'),
    'language': re.compile(r'[a-zA-Z]{1,8}(?:-[a-zA-Z0-9]{1,8})*'),
    'Name': re.compile(r'(?:[^\W\d]|:)[\w.:\-]*'),
    'NCName': re.compile(r'[^\W\d][\w.\-]*'),
    'NMTOKEN': re.compile(r'[\w.:\-]+'),
}
"""The types of strings but xsd:string itself, and what is in them."""


def integer_of(text: str) -> int:
    """Return a whole number of any number of decimal digits, with or without a sign."""
    if len(text) <= _DIGITS_AT_ONCE:
        return int(text)
    if text[0] in '+-':
        number = integer_of(text[1:])
        return -number if text[0] == '-' else number
    # By halves: the multiplication of large numbers is faster than digit by digit.
    low = len(text) // 2
    shifted: int = integer_of(text[:-low]) * 10**low
    return shifted + integer_of(text[-low:])


def digits_of(number: int) -> str:
    """Return the decimal digits of a whole number of any size."""
    if number.bit_length() < 3 * _DIGITS_AT_ONCE:
        return str(number)
    if number < 0:
        return '-' + digits_of(-number)
    low = number.bit_length() // 7  # Some half of the digits: a digit has 3.3 bits.
    high, rest = divmod(number, 10**low)
    return digits_of(high) + digits_of(rest).rjust(low, '0')


def _number(text: str) -> int | Fraction:
    if len(text) > _DIGITS_AT_ONCE:
        digits, _, behind = text.partition('.')
        whole = integer_of(digits + behind if digits + behind not in '+-' else '0')
        fraction = Fraction(whole, 10 ** len(behind))
    else:
        fraction = Fraction(text)
    return fraction.numerator if fraction.denominator == 1 else fraction


def _floating(space: str, text: str) -> Value:
    special = {'INF': math.inf, '+INF': math.inf, '-INF': -math.inf, 'NaN': math.nan}
    if text in special:
        number = special[text]
    elif _FLOAT.fullmatch(text):
        number = float(text)
    else:
        raise ValueError
    return floating_value(space, number)


def nearest_float(number: float | Fraction) -> float:
    """Return the nearest double; an infinite one where a number is beyond all."""
    try:
        return float(number)
    except OverflowError:
        return math.inf if number > 0 else -math.inf


def single(number: float) -> float:
    """Return the nearest number that xsd:float has."""
    try:
        return float(struct.unpack('f', struct.pack('f', number))[0])
    except OverflowError:
        return math.copysign(math.inf, number)


def floating_value(space: str, number: float) -> Value:
    """Return the value of a Python float in the space 'float' or 'double'."""
    if space == 'float':
        number = single(number)
    if math.isnan(number):
        return (space, 'NaN')
    if number == 0.0 and math.copysign(1.0, number) < 0:
        return (space, 0.0, '-')
    return (space, number)


def parse_value(literal: Literal) -> Value:
    """Return the value a literal denotes.

    Raises:
        ValueError: The lexical form is outside the datatype's lexical space.
    """
    datatype, text = literal.datatype, literal.lexical
    if datatype == RDF + 'langString' or literal.language:
        return ('langString', text, literal.language)
    if datatype == RDF + 'PlainLiteral':
        if '@' not in text:
            return text  # As many tools write a text without a language.
        plain, _, language = text.rpartition('@')
        return ('langString', plain, language.lower()) if language else plain
    if datatype.startswith(XSD):
        name = datatype[len(XSD) :]
        bounds = BOUNDS.get(name)
        if bounds is not None:
            text = text.strip(_SPACES)
            if not _INTEGER.fullmatch(text):
                raise ValueError
            number = integer_of(text)
            low, high = bounds
            if (low is not None and number < low) or (high is not None and number > high):
                raise ValueError
            return number
        if name == 'string' or name in STRING_PATTERNS:
            pattern = STRING_PATTERNS.get(name)
            if pattern is not None and not pattern.fullmatch(text):
                raise ValueError
            return text
        if name == 'decimal':
            if not _DECIMAL.fullmatch(text.strip(_SPACES)):
                raise ValueError
            return _number(text.strip(_SPACES))
        if name == 'boolean':
            if text.strip(_SPACES) not in ('true', 'false', '0', '1'):
                raise ValueError
            return ('boolean', text.strip(_SPACES) in ('true', '1'))
        if name in ('float', 'double'):
            return _floating(name, text.strip(_SPACES))
        if name in datetimes.CALENDAR:
            return datetimes.calendar_value(name, text.strip(_SPACES))
        if name in datetimes.DURATIONS:
            return datetimes.duration_of(name, text.strip(_SPACES))
        if name in ('dateTime', 'dateTimeStamp'):
            value = moment_of(text.strip(_SPACES))
            if name == 'dateTimeStamp' and value[1] != 'utc':
                raise ValueError
            return value
        if name == 'anyURI':
            return ('anyURI', text.strip(_SPACES))
        if name == 'hexBinary':
            if not _HEXADECIMAL.fullmatch(text.strip(_SPACES)):
                raise ValueError
            return (name, bytes.fromhex(text))
        if name == 'base64Binary':
            compact = ''.join(text.split())
            octets = base64.b64decode(compact, validate=True)
            if base64.b64encode(octets).decode() != compact:
                raise ValueError  # Bits behind the last octet are not zero.
            return (name, octets)
    elif datatype == RDF + 'XMLLiteral':
        with contextlib.suppress(ElementTree.ParseError):
            text = ElementTree.canonicalize(f'<x>{text}</x>')[len('<x>') : -len('</x>')]
    elif datatype == OWL + 'rational':
        numerator, _, denominator = text.partition('/')
        if not (_INTEGER.fullmatch(numerator.strip()) and _INTEGER.fullmatch(denominator.strip())):
            raise ValueError
        if integer_of(denominator.strip()) <= 0:
            raise ValueError
        fraction = Fraction(integer_of(numerator.strip()), integer_of(denominator.strip()))
        return fraction.numerator if fraction.denominator == 1 else fraction
    return ('other', datatype, text)


def value_of(literal: Literal) -> Value:
    """Return the value a literal denotes; an ill-formed literal denotes a value of its own, in no
    datatype.
    """
    try:
        return parse_value(literal)
    except (ValueError, ZeroDivisionError):
        return ('ill-formed', literal.datatype, literal.lexical)


def literal_of(value: Value) -> Literal:
    """Return a literal that denotes the value, in the most general datatype that suits it."""
    if isinstance(value, int):
        return Literal(digits_of(value), XSD + 'integer')
    if isinstance(value, str):
        return Literal(value)
    if isinstance(value, Fraction):
        digits = _terminating(value)
        if digits is not None:
            return Literal(digits, XSD + 'decimal')
        numerator, denominator = map(digits_of, (value.numerator, value.denominator))
        return Literal(f'{numerator}/{denominator}', OWL + 'rational')
    space = value[0]
    if space == 'langString':
        return Literal(value[1], RDF + 'langString', value[2])
    if space == 'boolean':
        return Literal('true' if value[1] else 'false', XSD + 'boolean')
    if space in ('float', 'double'):
        number = value[1]
        text = '-0.0' if len(value) == 3 else str(number)
        text = {'inf': 'INF', '-inf': '-INF'}.get(text, text)
        return Literal(text, XSD + space)
    if space == 'dateTime':
        return Literal(text_of(value), XSD + space)
    if space in datetimes.CALENDAR:
        return Literal(datetimes.calendar_text(value), XSD + space)
    if space == 'duration':
        return Literal(datetimes.duration_text(value), XSD + space)
    if space == 'anyURI':
        return Literal(value[1], XSD + space)
    if space == 'hexBinary':
        return Literal(value[1].hex().upper(), XSD + space)
    if space == 'base64Binary':
        return Literal(base64.b64encode(value[1]).decode(), XSD + space)
    return Literal(value[2], value[1])


def is_decimal(number: Fraction) -> bool:
    """Tell whether a number is a decimal: its digits end."""
    return _terminating(number) is not None


def _terminating(number: Fraction) -> str | None:
    twos = fives = 0
    rest = number.denominator
    while rest % 2 == 0:
        rest, twos = rest // 2, twos + 1
    while rest % 5 == 0:
        rest, fives = rest // 5, fives + 1
    if rest != 1:
        return None
    places = max(twos, fives)
    shifted = abs(number.numerator) * 10**places // number.denominator
    digits = digits_of(shifted).rjust(places + 1, '0')
    sign = '-' if number < 0 else ''
    return f'{sign}{digits[:-places]}.{digits[-places:]}' if places else sign + digits


# --- order and text ---


def comparable(value: Value) -> tuple[str, Any]:
    """Return a value as (kind, key): keys of one kind compare by order; numbers of all spaces are
    one kind.
    """
    if isinstance(value, (int, Fraction)):
        return 'number', value
    if isinstance(value, str):
        return 'string', value
    if value[0] in ('float', 'double'):
        return 'number', math.nan if value[1] == 'NaN' else value[1]
    return value[0], value[1:]


def order(first: Value, second: Value) -> int | None:
    """Return -1, 0 or 1 as `first` is below, equal to or above `second`; None: they have no order.

    Equal by order may be different values: 0.0 and -0.0, or one instant in two zones.
    """
    if isinstance(first, tuple) and isinstance(second, tuple) and first[0] == second[0]:
        if first[0] == 'dateTime' or first[0] in datetimes.CALENDAR:
            return datetimes.order(first, second)
        if first[0] == 'duration':
            return datetimes.duration_order(first, second)
        if first[0] in ('ill-formed', 'other'):
            return None
        if first[0] == 'langString' and first[2] != second[2]:
            return None
    (kind, key), (other, other_key) = comparable(first), comparable(second)
    if kind != other or key != key or other_key != other_key:
        return None
    return int(key > other_key) - int(key < other_key)


def lexical_of(value: Value) -> str:
    """Return the text of a value, as patterns and lengths see it."""
    return value if isinstance(value, str) else literal_of(value).lexical


@cache
def schema_pattern(text: str, *, whole: bool = True) -> Any:
    """Return a regular expression of XML Schema, compiled with the interface of `re`.

    It is matched by an automaton (RE2): no expression takes longer than its text is long.

    Args:
        text: The expression.
        whole: It is a facet, which all of a text must match; otherwise it is one of XPath, which
            may have anchors and lazy quantifiers.

    Raises:
        ValueError: It is none, or it has back references or counts above 1,000.
    """
    # The libraries take 80 ms to import, and few ontologies have a pattern.
    import re2
    from elementpath.regex import RegexError, translate_pattern

    options = re2.Options()
    options.log_errors = False
    try:
        translated = translate_pattern(
            _bracketed(text),
            xsd_version='1.1',
            back_references=not whole,
            lazy_quantifiers=not whole,
            anchors=not whole,
        )
        # What makes `$` of `re` the end of the text it is in RE2 already.
        return re2.compile(translated.replace(r'(?!\n\Z)', ''), options)
    except (RegexError, re2.error) as error:
        raise ValueError(f'{text!r} is no regular expression of XML Schema: {error}') from None


def _bracketed(pattern: str) -> str:
    """Put classes of characters into brackets, in which elementpath writes them out."""
    depth, parts = 0, []
    for part in re.findall(r'\\?.', pattern, re.DOTALL):
        depth += (part == '[') - (part == ']')
        parts.append(f'[{part}]' if not depth and re.fullmatch(r'\\[sSdDwWiIcC]', part) else part)
    return ''.join(parts)
