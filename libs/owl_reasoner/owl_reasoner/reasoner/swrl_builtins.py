"""SWRL built-ins over values (https://www.w3.org/Submission/SWRL/, section 8): comparisons,
arithmetic, booleans, strings and URIs; `calendar_builtins` has dates, times and durations. Those
that compute with lists are not supported and reported as such.

Each built-in is known by two functions of the values of its arguments: whether they satisfy it,
and, for those that compute, the values its first argument can take given the others. Arguments
outside the built-in's domain satisfy nothing. Numbers of the decimal space are exact; with an
xsd:double or xsd:float beside them both sides become floating-point, as XPath's numeric promotion
has it.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Iterator
from fractions import Fraction
from typing import Any
from urllib.parse import urljoin, urlsplit

from owl_reasoner.reasoner.calendar_builtins import CALENDAR_BUILTINS
from owl_reasoner.reasoner.datatypes import (
    Value,
    floating_value,
    lexical_of,
    nearest_float,
    order,
    schema_pattern,
    single,
)
from owl_reasoner.reasoner.datetimes import decimal

_Number = int | Fraction | float
_Solve = Callable[..., Iterable[Value]]


def _numbers(values: Iterable[Value]) -> tuple[str, list[_Number]] | None:
    """Return the common space ('exact', 'float', 'double') and the numbers promoted to it; None for
    a non-number.
    """
    space = 'exact'
    numbers: list[_Number] = []
    for value in values:
        if isinstance(value, (int, Fraction)):
            numbers.append(value)
        elif isinstance(value, tuple) and value[0] in ('float', 'double'):
            if space != 'double':
                space = value[0]
            numbers.append(math.nan if value[1] == 'NaN' else -0.0 if len(value) == 3 else value[1])
        else:
            return None
    if space == 'float':
        numbers = [single(nearest_float(number)) for number in numbers]
    elif space == 'double':
        numbers = [nearest_float(number) for number in numbers]
    return space, numbers


def _value(space: str, number: _Number) -> Value:
    if space == 'exact':
        assert isinstance(number, (int, Fraction))
        if isinstance(number, Fraction) and number.denominator == 1:
            return number.numerator
        return number
    return floating_value(space, float(number))


def _comparison(compare: Callable[[Any, Any], bool]) -> Callable[[Value, Value], bool]:
    def holds(first: Value, second: Value) -> bool:
        if isinstance(first, int) and isinstance(second, int):
            return compare(first, second)
        pair = _numbers((first, second))
        if pair is not None:
            return compare(*pair[1])
        sign = order(first, second)
        if sign is None:
            return compare in (operator.eq, operator.ne) and compare(first, second)
        return compare(sign, 0)

    return holds


def _arithmetic(compute: Callable[..., _Number]) -> _Solve:
    def solve(*arguments: Value) -> Iterable[Value]:
        promoted = _numbers(arguments)
        if promoted is None:
            return ()
        space, numbers = promoted
        try:
            return (_value(space, compute(*numbers)),)
        except (ArithmeticError, ValueError, TypeError):
            return ()

    return solve


def _divide(first: _Number, second: _Number) -> _Number:
    if isinstance(first, float) or isinstance(second, float):
        if second == 0.0:
            # As IEEE 754 has it; Python raises.
            sign = math.copysign(1.0, first) * math.copysign(1.0, second)
            return math.nan if first == 0.0 or math.isnan(first) else sign * math.inf
        return first / second
    # A quotient of decimals is a decimal (XPath, op 6.2.4).
    return decimal(Fraction(first) / Fraction(second))


def _modulo(first: _Number, second: _Number) -> _Number:
    if isinstance(first, float) or isinstance(second, float):
        try:
            return math.fmod(first, second)
        except ValueError:
            return math.nan  # By zero, or of an infinite number.
    return first - second * math.trunc(Fraction(first) / Fraction(second))


def _power(base: _Number, exponent: _Number) -> _Number:
    if isinstance(base, float) or isinstance(exponent, float):
        return _floating_power(float(base), float(exponent))
    if not isinstance(exponent, int) or abs(exponent) > 1024:
        raise ValueError
    return decimal(Fraction(base) ** exponent)


def _floating_power(base: float, exponent: float) -> float:
    """As IEEE 754 has it; Python raises for what is infinite or no number."""
    is_odd = math.isfinite(exponent) and math.fmod(exponent, 2.0) in (1.0, -1.0)
    try:
        return math.pow(base, exponent)
    except OverflowError:
        return -math.inf if base < 0.0 and is_odd else math.inf
    except ValueError:
        if base == 0.0 and exponent < 0.0:
            return math.copysign(math.inf, base) if is_odd else math.inf
        return math.nan


def _rounding(compute: Callable[[Fraction], int]) -> _Solve:
    """Round exactly, in the space of the number; a zero keeps its sign (XPath functions, 6.4)."""

    def solve(value: Value, places: Value = 0) -> Iterable[Value]:
        promoted = _numbers((value,))
        if promoted is None or not isinstance(places, int) or abs(places) > 1024:
            return ()
        space, (number,) = promoted
        if isinstance(number, float) and not math.isfinite(number):
            return (value,)
        scale = Fraction(10) ** places
        rounded = compute(Fraction(number) * scale) / scale
        if space == 'exact':
            return (_value(space, rounded),)
        return (floating_value(space, math.copysign(float(rounded), number)),)

    return solve


def _half_up(number: _Number) -> int:
    return math.floor(Fraction(number) + Fraction(1, 2))


def _integer_divide(*arguments: Value) -> Iterable[Value]:
    promoted = _numbers(arguments)
    if promoted is None:
        return ()
    first, second = promoted[1]
    try:
        if isinstance(first, float) or isinstance(second, float):
            if math.isinf(second) and math.isfinite(first):
                return (0,)
            return (math.trunc(Fraction(first) / Fraction(second)),)
        return (math.trunc(_divide(first, second)),)
    except (ArithmeticError, ValueError):
        return ()


def _floating(compute: Callable[[float], float]) -> _Solve:
    def solve(argument: Value) -> Iterable[Value]:
        promoted = _numbers((argument,))
        if promoted is None:
            return ()
        try:
            space = 'float' if promoted[0] == 'float' else 'double'
            return (floating_value(space, compute(float(promoted[1][0]))),)
        except (ArithmeticError, ValueError):
            return ()

    return solve


def _strings(compute: Callable[..., Value | None]) -> _Solve:
    def solve(*arguments: Value) -> Iterable[Value]:
        try:
            result = compute(*arguments)
        except (TypeError, ValueError, AttributeError, LookupError):
            return ()
        return () if result is None else (result,)

    return solve


def _calendar(compute: Callable[..., Value]) -> _Solve:
    def solve(*arguments: Value) -> Iterable[Value]:
        try:
            return (compute(*arguments),)
        except (ArithmeticError, ValueError):
            return ()

    return solve


def _text(*values: Value) -> bool:
    return all(isinstance(value, str) for value in values)


def _string_test(test: Callable[..., bool]) -> Callable[..., bool]:
    def holds(*arguments: Value) -> bool:
        try:
            return _text(*arguments) and test(*arguments)
        except ValueError:
            return False

    return holds


def _substring(text: Value, *bounds: Value) -> str | None:
    promoted = _numbers(bounds)
    if not isinstance(text, str) or promoted is None:
        return None
    start, *length = (
        number if isinstance(number, float) and not math.isfinite(number) else _half_up(number)
        for number in promoted[1]
    )
    end = start + length[0] if length else math.inf
    return ''.join(each for place, each in enumerate(text, 1) if start <= place < end)


def _translate(text: str, old: str, new: str) -> str | None:
    if not _text(text, old, new):
        return None
    table: dict[int, str | None] = {}
    for position, character in enumerate(old):
        table.setdefault(ord(character), new[position] if position < len(new) else None)
    return text.translate(table)


def _before(text: str, mark: str) -> str | None:
    if not _text(text, mark):
        return None
    return text.partition(mark)[0] if mark and mark in text else ''


def _after(text: str, mark: str) -> str | None:
    if not _text(text, mark):
        return None
    return text.partition(mark)[2] if mark else text


def _replace(text: str, pattern: str, new: str) -> str | None:
    if not _text(text, pattern, new):
        return None
    found = _pattern(pattern)
    if found.search(''):
        raise ValueError  # XPath functions, 5.6.4: an error where it matches no character.
    made = _replacement(new, found.groups)
    return ''.join(
        part
        for end, match in _with_ends(found, text)
        for part in (text[end : match.start() if match else None], made(match) if match else '')
    )


def _with_ends(pattern: Any, text: str) -> Iterator[tuple[int, Any]]:
    """Yield each match with the end of the one before, and None at last."""
    end = 0
    for match in pattern.finditer(text):
        yield end, match
        end = match.end()
    yield end, None


def _replacement(text: str, groups: int) -> Callable[[Any], str]:
    """Read a replacement: ``$N`` stands for a group, a backslash goes before ``$`` and itself.

    Raises:
        ValueError: Another character behind either.
    """
    parts: list[str | int] = []
    place = 0
    while place < len(text):
        each = text[place]
        place += 1
        if each == '\\':
            if text[place : place + 1] not in ('\\', '$'):
                raise ValueError
            parts.append(text[place : place + 1])
            place += 1
        elif each == '$':
            digits = re.match('[0-9]+', text[place:])
            if digits is None:
                raise ValueError
            number = digits[0]
            # As many digits as there are groups for; the rest is text.
            while len(number) > 1 and int(number) > groups:
                number = number[:-1]
            parts.append(int(number))
            place += len(number)
        else:
            parts.append(each)

    def made(match: Any) -> str:
        return ''.join(
            part if isinstance(part, str) else (match.group(part) or '') if part <= groups else ''
            for part in parts
        )

    return made


def _tokens(text: Value, pattern: Value) -> Iterable[Value]:
    if not isinstance(text, str) or not isinstance(pattern, str):
        return ()
    try:
        found = _pattern(pattern)
        if found.search('') or not text:
            # A separator of no characters is an error, and an empty text has no parts.
            return ()
        ends = [0, *(end for match in found.finditer(text) for end in match.span()), len(text)]
    except ValueError:
        return ()
    # Not `split`, which hands out what groups of the pattern matched as well.
    parts = (text[start:end] for start, end in zip(ends[::2], ends[1::2], strict=True))
    return tuple(dict.fromkeys(parts))


def _resolved(reference: Value, base: Value) -> Value | None:
    """Resolve a reference against an absolute base (RFC 3986, section 5); texts stand for URIs."""
    written, stem = _uri(reference), _uri(base)
    if written is None or stem is None or not urlsplit(stem).scheme:
        return None
    found = urljoin(stem, written)
    return found if isinstance(reference, str) else ('anyURI', found)


def _uri(value: Value) -> str | None:
    if isinstance(value, tuple) and value[0] == 'anyURI':
        return str(value[1])
    return value if isinstance(value, str) else None


def _negation(value: Value) -> Value | None:
    if isinstance(value, tuple) and value[0] == 'boolean':
        return ('boolean', not value[1])
    return None


def _matches(text: str, pattern: str) -> bool:
    return bool(_pattern(pattern).search(text))


def _pattern(text: str) -> Any:
    return schema_pattern(text, whole=False)


_TESTS: dict[str, tuple[int, Callable[..., bool]]] = {
    'notEqual': (2, _comparison(operator.ne)),
    'lessThan': (2, _comparison(operator.lt)),
    'lessThanOrEqual': (2, _comparison(operator.le)),
    'greaterThan': (2, _comparison(operator.gt)),
    'greaterThanOrEqual': (2, _comparison(operator.ge)),
    'stringEqualIgnoreCase': (2, _string_test(lambda a, b: a.casefold() == b.casefold())),
    'contains': (2, _string_test(lambda a, b: b in a)),
    'containsIgnoreCase': (2, _string_test(lambda a, b: b.casefold() in a.casefold())),
    'startsWith': (2, _string_test(str.startswith)),
    'endsWith': (2, _string_test(str.endswith)),
    'matches': (2, _string_test(_matches)),
}

# name -> (fewest, most arguments, solve)
_COMPUTATIONS: dict[str, tuple[int, int, _Solve]] = {
    'equal': (2, 2, lambda value: (value,)),
    'add': (3, 99, _arithmetic(lambda *numbers: sum(numbers[1:], numbers[0]))),
    'subtract': (3, 3, _arithmetic(operator.sub)),
    'multiply': (3, 99, _arithmetic(lambda *numbers: math.prod(numbers))),
    'divide': (3, 3, _arithmetic(_divide)),
    'integerDivide': (3, 3, _integer_divide),
    'mod': (3, 3, _arithmetic(_modulo)),
    'pow': (3, 3, _arithmetic(_power)),
    'unaryPlus': (2, 2, _arithmetic(operator.pos)),
    'unaryMinus': (2, 2, _arithmetic(operator.neg)),
    'abs': (2, 2, _arithmetic(abs)),
    'ceiling': (2, 2, _rounding(math.ceil)),
    'floor': (2, 2, _rounding(math.floor)),
    'round': (2, 2, _rounding(_half_up)),
    'roundHalfToEven': (2, 3, _rounding(round)),
    'sin': (2, 2, _floating(math.sin)),
    'cos': (2, 2, _floating(math.cos)),
    'tan': (2, 2, _floating(math.tan)),
    'booleanNot': (2, 2, _strings(_negation)),
    'stringConcat': (2, 99, _strings(lambda *parts: ''.join(map(lexical_of, parts)))),
    'substring': (3, 4, _strings(_substring)),
    'stringLength': (2, 2, _strings(lambda text: len(text) if _text(text) else None)),
    'normalizeSpace': (
        2,
        2,
        _strings(lambda text: ' '.join(text.split()) if _text(text) else None),
    ),
    'upperCase': (2, 2, _strings(lambda text: text.upper() if _text(text) else None)),
    'lowerCase': (2, 2, _strings(lambda text: text.lower() if _text(text) else None)),
    'translate': (4, 4, _strings(_translate)),
    'substringBefore': (3, 3, _strings(_before)),
    'substringAfter': (3, 3, _strings(_after)),
    'replace': (4, 4, _strings(_replace)),
    'tokenize': (3, 3, _tokens),
    'resolveURI': (3, 3, _strings(_resolved)),
    **{
        name: (fewest, most, _calendar(compute))
        for name, (fewest, most, compute) in CALENDAR_BUILTINS.items()
    },
}


def _checking(solve: _Solve) -> Callable[..., bool]:
    equal = _comparison(operator.eq)
    return lambda first, *rest: any(equal(first, value) for value in solve(*rest))


def builtin(name: str, arguments: int) -> tuple[Callable[..., bool], _Solve | None] | None:
    """Return the functions of a built-in, by its local name and number of arguments.

    Returns:
        (holds, solve), `solve` None where the built-in only tests; None when it is not supported.
    """
    if name in _TESTS:
        count, holds = _TESTS[name]
        return (holds, None) if arguments == count else None
    if name in _COMPUTATIONS:
        fewest, most, solve = _COMPUTATIONS[name]
        return (_checking(solve), solve) if fewest <= arguments <= most else None
    return None
