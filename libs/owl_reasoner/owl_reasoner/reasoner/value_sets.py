"""Sets of data values: the algebra of data ranges, with emptiness, inclusion and size.

Ordered spaces (numbers, floats, moments) are unions of intervals: numbers lie in four layers that
share no value (whole, other decimal, other rational, other real), moments in two (with a zone and
without), so that every boolean combination of XML Schema's ranges is again a union of intervals for
each layer. The other spaces hold finite sets, sets of all but finitely many, all values of some
lengths, and tests (patterns, string types) that are decided on single values only.

Source of the value spaces: OWL 2 Structural Specification, section 4, and XML Schema 1.1 part 2.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, NamedTuple, TypeAlias

from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axiom_text import expression_text
from owl_reasoner.owl.expressions import DataRange
from owl_reasoner.owl.vocabulary import OWL, RDF, TOP_LITERAL, XSD, local_name
from owl_reasoner.reasoner.datatypes import (
    BOUNDS,
    STRING_PATTERNS,
    Value,
    comparable,
    is_decimal,
    lexical_of,
    order,
    schema_pattern,
    value_of,
)
from owl_reasoner.reasoner.datetimes import CALENDAR, DURATIONS, LARGEST_OFFSET, is_duration

_NUMBERS = ('whole', 'decimal', 'rational', 'real')
_MOMENTS = ('utc', 'local')
_FLOATS = ('float', 'double')
_ORDERED = (*_NUMBERS, *_FLOATS, *_MOMENTS)
_OCTETS = ('hexBinary', 'base64Binary')
_WITH_LENGTH = ('string', 'langString', 'anyURI', *_OCTETS)
_CALENDAR = (*CALENDAR, 'duration')
_PLAIN = (*_WITH_LENGTH, *_CALENDAR, 'boolean', 'other')
_BOOLEANS = frozenset([('boolean', True), ('boolean', False)])


class _End(NamedTuple):
    """The place of an interval's end, in their order: below all keys, beside a key, above all."""

    beyond: int
    key: Any
    side: int


def _below(key: Any) -> _End:
    return _End(0, key, -1)


def _above(key: Any) -> _End:
    return _End(0, key, 1)


_LOW, _HIGH = _End(-1, 0, 0), _End(1, 0, 0)
_Intervals: TypeAlias = 'tuple[tuple[_End, _End], ...]'
_EVERY: _Intervals = ((_LOW, _HIGH),)
_LENGTHS: _Intervals = ((_below(0), _HIGH),)
"""All lengths of texts."""


def _union(parts: Iterable[tuple[_End, _End]]) -> _Intervals:
    joined: list[tuple[_End, _End]] = []
    for low, high in sorted(part for part in parts if part[0] < part[1]):
        if joined and low <= joined[-1][1]:
            joined[-1] = (joined[-1][0], max(joined[-1][1], high))
        else:
            joined.append((low, high))
    return tuple(joined)


def _common(first: _Intervals, second: _Intervals) -> _Intervals:
    found, i, j = [], 0, 0
    while i < len(first) and j < len(second):
        (a, b), (c, d) = first[i], second[j]
        low, high = max(a, c), min(b, d)
        if low < high:
            found.append((low, high))
        # The one that ends first has nothing in common with what follows.
        if b <= d:
            i += 1
        else:
            j += 1
    return tuple(found)


def _outside(parts: _Intervals) -> _Intervals:
    ends = [_LOW, *(end for part in parts for end in part), _HIGH]
    return _union(zip(ends[::2], ends[1::2], strict=True))


@dataclass(frozen=True, slots=True)
class _Conjunction:
    """Values of one plain space: listed (None: any), not excluded, that pass the tests and have
    one of the lengths.

    A test is (data range, whether values are in it). Where values are listed, nothing else is said.
    """

    listed: frozenset[Value] | None = None
    excluded: frozenset[Value] = frozenset()
    tests: frozenset[tuple[DataRange, bool]] = frozenset()
    lengths: _Intervals = _LENGTHS

    def admits(self, value: Value) -> bool:
        """Tell whether a value of the space is one of them."""
        if self.listed is not None:
            return value in self.listed
        if value in self.excluded or not _has_length(value, self.lengths):
            return False
        return not self.tests or _passes(value, self.tests)


_Part: TypeAlias = 'tuple[_Conjunction, ...]'
_ANY: _Part = (_Conjunction(),)


def _listed(values: Iterable[Value]) -> _Part:
    found = frozenset(values)
    return (_Conjunction(found),) if found else ()


def _tested(data_range: DataRange) -> _Part:
    return (_Conjunction(tests=frozenset([(data_range, True)])),)


def _of_length(space: str, lengths: _Intervals) -> frozenset[Value] | None:
    """Return the values of the given lengths; None where there are more than 257."""
    is_octets = space in _OCTETS
    # There is an empty text in every language.
    longest = -1 if space == 'langString' else int(is_octets)
    short = [length for length in range(longest + 1) if _is_in(length, lengths)]
    if sum(_count('whole', *each) for each in lengths) > len(short):
        return None
    if not is_octets:
        return frozenset('' if space == 'string' else (space, '') for _ in short)
    octets = [b'', *(bytes([octet]) for octet in range(256))]
    return frozenset((space, value) for value in octets if len(value) in short)


def _is_in(key: Any, intervals: _Intervals) -> bool:
    # Plain tuples compare as ends do, and are made four times as fast.
    before, behind = (0, key, -1), (0, key, 1)
    return any(low <= before and behind <= high for low, high in intervals)


def _both(space: str, first: _Part, second: _Part) -> _Part:
    if second is _ANY:
        return first
    found: dict[_Conjunction, None] = {}
    for one in first:
        for other in second:
            listed = one.listed
            if listed is None:
                listed = other.listed
            elif other.listed is not None:
                listed &= other.listed
            excluded, tests = one.excluded | other.excluded, one.tests | other.tests
            lengths = _common(one.lengths, other.lengths)
            if listed is None:
                listed = _of_length(space, lengths)
            if listed is None:
                found[_Conjunction(None, excluded, tests, lengths)] = None
                continue
            rest = _Conjunction(None, excluded, tests, lengths)
            found.update(dict.fromkeys(_listed(filter(rest.admits, listed))))
    return tuple(found)


def _has_length(value: Any, lengths: _Intervals) -> bool:
    text = value if isinstance(value, str) else value[1]
    return lengths == _LENGTHS or _is_in(len(text), lengths)


def _not(space: str, part: _Part) -> _Part:
    result = _ANY
    for one in part:
        choices: list[_Conjunction] = []
        if one.listed is not None:
            choices.append(_Conjunction(excluded=one.listed))
        choices += _listed(one.excluded)
        choices += [
            _Conjunction(tests=frozenset([(data_range, not inside)]))
            for data_range, inside in one.tests
        ]
        if one.lengths != _LENGTHS:
            choices.append(_Conjunction(lengths=_common(_outside(one.lengths), _LENGTHS)))
        result = _both(space, result, tuple(choices))
    return result


def _passes(value: Value, tests: Iterable[tuple[DataRange, bool]]) -> bool:
    return all(_test(data_range)(value) == inside for data_range, inside in tests)


@cache
def _test(data_range: DataRange) -> Callable[[Value], bool]:
    """Return the predicate of a type of strings or durations, or of the facet of a range."""
    if isinstance(data_range, str):
        name = data_range.removeprefix(XSD)
        if name in DURATIONS:
            return lambda value: is_duration(value, name)  # type: ignore[arg-type]
        types = STRING_PATTERNS[name]
        return lambda value: isinstance(value, str) and types.fullmatch(value) is not None
    assert isinstance(data_range, ex.DatatypeRestriction)
    ((facet, bound),) = data_range.facets
    if facet == XSD + 'pattern':
        pattern = schema_pattern(bound.lexical)
        return lambda value: pattern.match(lexical_of(value)) is not None
    orders, limit = _ORDERS[facet.removeprefix(XSD)], value_of(bound)
    return lambda value: order(value, limit) in orders


def _impossible(tests: frozenset[tuple[DataRange, bool]]) -> bool:
    inside = [data_range for data_range, wanted in tests if wanted]
    outside = [data_range for data_range, wanted in tests if not wanted]
    return any(_includes(outer, inner) for outer in outside for inner in inside)


_STRING_TYPES = ('string', 'normalizedString', 'token', 'NMTOKEN', 'Name', 'NCName')
"""Each is within all before it."""


def _includes(outer: DataRange, inner: DataRange) -> bool:
    """Tell whether all texts of a string type or a pattern are known to be in another."""
    if isinstance(inner, ex.DatatypeRestriction):
        return outer == inner or _includes(outer, inner.datatype)
    if isinstance(inner, str) and inner.removeprefix(XSD) in DURATIONS:
        return outer == inner
    wider = [XSD + name for name in _STRING_TYPES]
    if inner == XSD + 'language':
        return outer in (inner, *wider[: wider.index(XSD + 'Name')])
    return outer == inner or (inner in wider and outer in wider[: wider.index(inner)])


class ValueSet:
    """A set of values; where it has tests, `is_empty`, `within` and `size` err towards more."""

    def __init__(self, intervals: dict[str, _Intervals], parts: dict[str, _Part]) -> None:
        self.intervals = {name: found for name, found in intervals.items() if found}
        self.parts = {name: found for name, found in parts.items() if found}

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ValueSet):
            return NotImplemented
        return self.intervals == other.intervals and self.parts == other.parts

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        return hash((frozenset(self.intervals.items()), frozenset(self.parts.items())))

    # --- algebra ---

    def __and__(self, other: ValueSet) -> ValueSet:
        if other is self or other is EVERY:
            return self
        if self is EVERY:
            return other
        # Most sets that a search compares are of one value.
        for one, them in ((self, other), (other, self)):
            value = one.__dict__.get('only')
            if value is not None:
                return one if them.contains(value) else NONE
        return ValueSet(
            {
                name: _common(found, other.intervals[name])
                for name, found in self.intervals.items()
                if name in other.intervals
            },
            {
                name: _both(name, found, other.parts[name])
                for name, found in self.parts.items()
                if name in other.parts
            },
        )

    def __or__(self, other: ValueSet) -> ValueSet:
        return ValueSet(
            {
                name: _union((*self.intervals.get(name, ()), *other.intervals.get(name, ())))
                for name in _ORDERED
            },
            {
                name: tuple(dict.fromkeys((*self.parts.get(name, ()), *other.parts.get(name, ()))))
                for name in _PLAIN
            },
        )

    def __invert__(self) -> ValueSet:
        return self._complement

    @cached_property
    def _complement(self) -> ValueSet:
        parts = {name: _not(name, self.parts.get(name, ())) for name in _PLAIN}
        parts['boolean'] = _both('boolean', parts['boolean'], _listed(_BOOLEANS))
        intervals = {name: _outside(self.intervals.get(name, ())) for name in _ORDERED}
        return ValueSet(intervals, parts)

    # --- questions ---

    def contains(self, value: Value) -> bool:
        """Tell whether a value is in the set."""
        # Rules ask it of each value: at once where all of its space, or none, is in the set.
        space, key = _place(value)
        intervals = self.intervals.get(space)
        if intervals is not None:
            return intervals is _EVERY or _is_in(key, intervals)
        part = self.parts.get(space)
        return part is _ANY or (part is not None and any(one.admits(value) for one in part))

    @property
    def is_empty(self) -> bool:
        """Whether no value is in the set."""
        return not self.size

    @cached_property
    def decided(self) -> bool:
        """Whether the answers about the set are exact."""
        return not any(one.tests for part in self.parts.values() for one in part)

    @cached_property
    def only(self) -> Value | None:
        """The value of a set of one value; None of any other set."""
        return next(self.members()) if self.size == 1 else None

    def within(self, other: ValueSet) -> bool:
        """Tell whether every value is in another set."""
        return (self & ~other).is_empty

    def members(self) -> Iterator[Value]:
        """Return the values of a finite set."""
        for part in self.parts.values():
            for one in part:
                yield from one.listed or ()
        for layer, intervals in self.intervals.items():
            for low, high in intervals:
                yield from _between(layer, low, high)

    @cached_property
    def size(self) -> float:
        """The number of values."""
        total: float = 0
        listed: set[Value] = set()
        for part in self.parts.values():
            for one in part:
                if one.listed is not None:
                    listed |= one.listed
                elif not _impossible(one.tests):
                    return math.inf
        total += len(listed)
        for layer, intervals in self.intervals.items():
            for low, high in intervals:
                total += _count(layer, low, high)
        return total


def _count(layer: str, low: _End, high: _End) -> float:
    """Return how many values of a layer lie between two ends."""
    if layer in ('float', 'double'):
        return _count_floats(layer, max(low, _below(-math.inf)), min(high, _above(math.inf)))
    if low.beyond or high.beyond:
        return math.inf
    if layer == 'whole':
        first = math.ceil(low.key) + (low.side > 0 and math.ceil(low.key) == low.key)
        last = math.floor(high.key) - (high.side < 0 and math.floor(high.key) == high.key)
        return int(max(0, last - first + 1))
    if layer in _MOMENTS:
        return len(_zones(layer, low, high)) if low.key[0] == high.key[0] else math.inf
    if low.key != high.key:
        return math.inf
    return int(_layer_of(low.key) == layer)


def _between(layer: str, low: _End, high: _End) -> Iterator[Value]:
    """Return the finitely many values of a layer between two ends."""
    number = int(_count(layer, low, high))
    if layer == 'whole':
        first = math.ceil(low.key) + (low.side > 0 and math.ceil(low.key) == low.key)
        yield from range(first, first + number)
    elif layer in ('float', 'double'):
        key = -math.inf if low.beyond else float(low.key)
        if low.side > 0:
            key = _next_float(layer, key)
        for _ in range(number):
            yield layer, key
            key = _next_float(layer, key)
    elif layer == 'utc':
        for offset in _zones(layer, low, high):
            yield 'dateTime', layer, low.key[0], offset
    elif number and layer == 'local':
        yield 'dateTime', layer, low.key[0]
    elif number:
        yield low.key


def _zones(layer: str, low: _End, high: _End) -> range:
    """Return the offsets of the zones in which one instant lies between two ends; 0 without one."""
    most = LARGEST_OFFSET if layer == 'utc' else 0
    first = max(low.key[1] + 60 * (low.side > 0), -most)
    last = min(high.key[1] - 60 * (high.side < 0), most)
    return range(first, last + 1, 60) if first <= last else range(0)


def _next_float(layer: str, key: float) -> float:
    if layer == 'double':
        return math.nextafter(key, math.inf)
    bits: int = struct.unpack('<i', struct.pack('<f', key))[0]
    if key == 0.0:
        bits = 1
    else:
        bits += 1 if bits >= 0 else -1
    following: float = struct.unpack('<f', struct.pack('<i', bits))[0]
    return 0.0 if following == 0.0 else following


def _count_floats(layer: str, low: _End, high: _End) -> float:
    code, whole = ('<f', '<i') if layer == 'float' else ('<d', '<q')

    def number(key: float) -> int:
        bits: int = struct.unpack(whole, struct.pack(code, float(key)))[0]
        return bits if bits >= 0 else -(bits & (2 ** (8 * struct.calcsize(code) - 1) - 1))

    try:
        first, last = number(low.key), number(high.key)
    except OverflowError:
        return math.inf
    return max(0, last - first + 1 - (low.side > 0) - (high.side < 0))


def _layer_of(number: int | Fraction) -> str:
    if isinstance(number, int) or number.denominator == 1:
        return 'whole'
    return 'decimal' if is_decimal(number) else 'rational'


EVERY = ValueSet(
    dict.fromkeys(_ORDERED, _EVERY),
    {name: _listed(_BOOLEANS) if name == 'boolean' else _ANY for name in _PLAIN},
)
NONE = ValueSet({}, {})


def point(value: Value) -> ValueSet:
    """Return the set of one value."""
    space, key = _place(value)
    if space in _ORDERED:
        found = ValueSet({space: ((_below(key), _above(key)),)}, {})
    else:
        found = ValueSet({}, {space: _listed([value])})
    found.only, found.size = value, 1
    return found


def _place(value: Value) -> tuple[str, Any]:
    """Return the space, or the layer of it, that a value is in, and its key if that is ordered."""
    if isinstance(value, int):
        return 'whole', value
    if isinstance(value, str):
        return 'string', None
    if isinstance(value, Fraction):
        return _layer_of(value), value
    space = value[0]
    if space in ('float', 'double') and len(value) == 2 and value[1] != 'NaN':
        return space, value[1]
    if space == 'dateTime':
        _, layer, seconds, *zone = value
        return layer, (seconds, *(zone or [0]))
    return space if space in _PLAIN else 'other', None


def _datatype(datatype: str) -> ValueSet | None:
    if datatype in (TOP_LITERAL, OWL + 'topDataProperty'):
        return EVERY
    layers = {OWL + 'real': 4, OWL + 'rational': 3, XSD + 'decimal': 2}.get(datatype)
    if layers:
        return ValueSet(dict.fromkeys(_NUMBERS[:layers], _EVERY), {})
    if datatype in (RDF + 'langString', RDF + 'PlainLiteral'):
        parts = {'langString': _ANY}
        return ValueSet({}, parts if datatype == RDF + 'langString' else {**parts, 'string': _ANY})
    if not datatype.startswith(XSD):
        return None
    name = datatype.removeprefix(XSD)
    if name in BOUNDS:
        low, high = BOUNDS[name]
        ends = (_LOW if low is None else _below(low), _HIGH if high is None else _above(high))
        return ValueSet({'whole': (ends,)}, {})
    if name in ('float', 'double'):
        return ValueSet({name: _EVERY}, {'other': _listed([(name, 'NaN'), (name, 0.0, '-')])})
    if name in ('dateTime', 'dateTimeStamp'):
        layers_of_moments = _MOMENTS if name == 'dateTime' else _MOMENTS[:1]
        return ValueSet(dict.fromkeys(layers_of_moments, _EVERY), {})
    if name == 'boolean':
        return ValueSet({}, {'boolean': _listed(_BOOLEANS)})
    if name in ('string', 'anyURI', *_OCTETS, *_CALENDAR):
        return ValueSet({}, {name: _ANY})
    if name in DURATIONS:
        return ValueSet({}, {'duration': _tested(datatype)})
    return ValueSet({}, {'string': _tested(datatype)}) if name in STRING_PATTERNS else None


_ENDS: dict[str, Callable[[Any], tuple[_End, _End]]] = {
    'minInclusive': lambda key: (_below(key), _HIGH),
    'minExclusive': lambda key: (_above(key), _HIGH),
    'maxInclusive': lambda key: (_LOW, _above(key)),
    'maxExclusive': lambda key: (_LOW, _below(key)),
}


_ORDERS: dict[str, tuple[int, ...]] = {
    'minInclusive': (0, 1),
    'maxInclusive': (0, -1),
    'minExclusive': (1,),
    'maxExclusive': (-1,),
}
"""How a value may compare with the bound of a facet."""


def _facet(datatype: str, facet: str, bound: ex.Literal) -> ValueSet | None:
    name = facet.removeprefix(XSD)
    ends = _ENDS.get(name)
    if ends is not None:
        value = value_of(bound)
        kind, key = comparable(value)
        if kind == 'number':
            if key != key:
                return NONE
            # A bound of one type may be given for another: as `double[>= 2]` is often written.
            intervals: dict[str, _Intervals] = dict.fromkeys(_NUMBERS, (ends(key),))
            intervals.update((space, (_float_ends(space, name, key),)) for space in _FLOATS)
            zeros = [(space, 0.0, '-') for space in _FLOATS]
            others = [zero for zero in zeros if order(zero, value) in _ORDERS[name]]
            return ValueSet(intervals, {'other': _listed(others)})
        if kind == 'dateTime':
            return _moments(name, key)
    values = _datatype(datatype)
    if values is None or 'boolean' in values.parts:
        return None  # Truth values have no facets.
    if ends is None and (values.intervals or not values.parts.keys().isdisjoint(_CALENDAR)):
        return None  # Numbers, moments and dates have no patterns and lengths.
    if name in ('length', 'minLength', 'maxLength'):
        size = value_of(bound)
        if not isinstance(size, int):
            return None
        low = _below(size) if name != 'maxLength' else _LENGTHS[0][0]
        high = _above(size) if name != 'minLength' else _HIGH
        given = (_Conjunction(lengths=_common(((low, high),), _LENGTHS)),)
        return ValueSet({}, {space: _both(space, _ANY, given) for space in _WITH_LENGTH})
    if name == 'pattern':
        try:
            schema_pattern(bound.lexical)
        except ValueError:
            return None
    elif ends is None:
        return None
    tested = _tested(ex.DatatypeRestriction(datatype, ((XSD + name, bound),)))
    return ValueSet({}, {space: tested for space in _PLAIN if space != 'boolean'})


def _float_ends(space: str, facet: str, key: int | Fraction | float) -> tuple[_End, _End]:
    """Return the ends of an interval of floats, beside one of them also where the bound is none."""
    try:
        near: float = float(key)
        if space == 'float':
            near = struct.unpack('<f', struct.pack('<f', near))[0]
    except OverflowError:
        near = math.inf if key > 0 else -math.inf
    if near == key:
        return _ENDS[facet](near)
    end = _below(near) if near > key else _above(near)
    return (end, _HIGH) if facet.startswith('min') else (_LOW, end)


def _moments(facet: str, bound: tuple[Any, ...]) -> ValueSet:
    """Return the moments on one side of a bound.

    Their keys are (seconds, offset of the zone). Moments of the other layer are known to lie there
    only where they are further away than any zone could make up for.
    """
    layer, seconds = bound[:2]
    low, high = (
        end if end.beyond else _End(0, (end.key, end.side * math.inf), end.side)
        for end in _ENDS[facet](seconds)
    )
    if facet.startswith('min'):
        others = (_above((seconds + LARGEST_OFFSET, math.inf)), _HIGH)
    else:
        others = (_LOW, _below((seconds - LARGEST_OFFSET, -math.inf)))
    other_layer = 'local' if layer == 'utc' else 'utc'
    return ValueSet({layer: ((low, high),), other_layer: (others,)}, {})


@cache
def value_set(data_range: DataRange) -> ValueSet | None:
    """Return the values of a data range without defined datatypes; None where it is not
    supported.
    """
    if isinstance(data_range, str):
        return _datatype(data_range)
    if isinstance(data_range, ex.DataOneOf):
        found = NONE
        for literal in data_range.literals:
            found |= point(value_of(literal))
        return found
    if isinstance(data_range, ex.DataComplementOf):
        inner = value_set(data_range.operand)
        return None if inner is None else ~inner
    if isinstance(data_range, ex.DatatypeRestriction):
        parts = [_datatype(data_range.datatype)]
        parts += [_facet(data_range.datatype, facet, bound) for facet, bound in data_range.facets]
    else:
        parts = [value_set(operand) for operand in data_range.operands]
    known = [part for part in parts if part is not None]
    if len(known) != len(parts):
        return None
    return _combined(iter(known), isinstance(data_range, ex.DataUnionOf))


def _combined(sets: Iterator[ValueSet], any_of: bool) -> ValueSet:
    result = next(sets)
    for other in sets:
        result = result | other if any_of else result & other
    return result


def values_of(data_range: DataRange, definitions: Mapping[str, DataRange]) -> ValueSet:
    """Return the values of a data range, with the ranges of the datatypes that are defined.

    Raises:
        ValueError: A datatype is defined by itself, or the range is not supported.
    """
    data_range = unfolded(data_range, definitions)
    found = value_set(data_range)
    if found is None:
        raise ValueError(f'the data range {expression_text(data_range)} is not supported')
    return found


def unfolded(
    data_range: DataRange, definitions: Mapping[str, DataRange], seen: tuple[str, ...] = ()
) -> DataRange:
    """Return a data range with the ranges in place of the datatypes that are defined by them.

    Args:
        data_range: The range.
        definitions: The ranges of defined datatypes, by name.
        seen: The datatypes whose definitions it stands in.

    Raises:
        ValueError: A datatype is defined by itself.
    """
    if isinstance(data_range, str):
        if data_range not in definitions:
            return data_range
        if data_range in seen:
            raise ValueError(f'the datatype {local_name(data_range)} is defined by itself')
        return unfolded(definitions[data_range], definitions, (*seen, data_range))
    if isinstance(data_range, (ex.DataIntersectionOf, ex.DataUnionOf)):
        kind = type(data_range)
        return kind(tuple(unfolded(each, definitions, seen) for each in data_range.operands))
    if isinstance(data_range, ex.DataComplementOf):
        return ex.DataComplementOf(unfolded(data_range.operand, definitions, seen))
    return data_range
