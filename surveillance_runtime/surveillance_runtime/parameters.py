"""Declared parameters: what values each takes, with errors that say what was expected instead.

A parameter's type is that of its default. An integer is accepted where a float is declared, since
people write `speed:=1` and mean 1.0.

A record of settings declares its fields where it defines them, and a node declares them all:

    @dataclass(frozen=True)
    class DriveSettings:
        speed: float = parameter(0.6, 'Top speed, m/s.', 0.01, 20.0)
        turn: float = parameter(1.5, 'Top turning speed, rad/s.', 0.01, 20.0)
        latency: float = 0.3  # no parameter

    drive = node.declare_fields(DriveSettings(), prefix='drive.')

The records of the libraries in `libs/` declare theirs in the same way, as plain metadata of their
fields, without knowing of nodes: `marker_detection.settings` says what stands there.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Record = TypeVar('Record', bound=DataclassInstance)
T = TypeVar('T')

Check = Callable[[Any], str | None]
"""Looks at a valid value further; returns what was expected instead, or None when it is good."""

_TYPE_NAMES = {bool: 'true or false', int: 'an integer', float: 'a number', str: 'a text'}
_LIST_NAMES = {bool: 'booleans', int: 'integers', float: 'numbers', str: 'texts'}


class ParameterError(ValueError):
    """A node cannot work with what a parameter says; the message is one line."""


class ParameterHost(Protocol):
    """Who declares parameters: a node, as the modules see it that describe what they need."""

    def get_name(self) -> str:
        """Return the node's name, for errors."""

    def declare_fields(self, record: Record) -> Record:
        """Declare the fields of a record; return it with the parameters' values."""

    def parameters_under(self, prefix: str) -> dict[str, Any]:
        """Declare and return all parameters that were given below a prefix."""


@dataclass(frozen=True)
class ParameterSpec:
    """One declared parameter.

    Attributes:
        name: The parameter's name.
        default: Its default; fixes the type.
        description: One sentence with the unit.
        minimum: Least value, for numbers and for the numbers in a list.
        maximum: Greatest value, likewise.
        choices: The only values allowed; empty for any.
        of: Element type of a list; needed where the default is empty.
        check: Looks at the value last; returns what was expected, or None when it is good.
        read_only: Whether changes at run time are refused.

    Raises:
        TypeError: The default is an empty list and `of` is not given.
    """

    name: str
    default: Any
    description: str = ''
    minimum: float | None = None
    maximum: float | None = None
    choices: Sequence[Any] = ()
    of: type | None = None
    check: Check | None = None
    read_only: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.default, list | tuple) and not self.default and self.of is None:
            raise TypeError(f'parameter {self.name}: an empty default needs of=<element type>')

    @property
    def element(self) -> type | None:
        """Type of a list's elements; None for a single value."""
        if isinstance(self.default, list | tuple):
            return self.of or type(self.default[0])
        return None

    def accept(self, value: Any) -> Any:
        """Return the value as the node works with it: numbers as declared, arrays as lists.

        Raises:
            ParameterError: The value has the wrong type or is out of range.
        """
        element = self.element
        if element is None:
            return self._checked(self._element(value, type(self.default), value), value)
        if isinstance(value, str | bytes) or not isinstance(value, Sequence | array):
            raise self.error(value)
        return self._checked([self._element(v, element, value) for v in value], value)

    def error(self, value: Any, expected: str | None = None) -> ParameterError:
        """Build the error for a value that does not fit."""
        return ParameterError(
            f'parameter {self.name}: got {shown(value)}, expected {expected or self.expected()}'
        )

    def expected(self) -> str:
        """Say in words what values are allowed."""
        if self.choices:
            return 'one of ' + ', '.join(shown(choice) for choice in self.choices)
        if self.element is None:
            text = _TYPE_NAMES[type(self.default)]
        else:
            text = f'a list of {_LIST_NAMES[self.element]}'
        if self.minimum is not None and self.maximum is not None:
            return f'{text} from {self.minimum} to {self.maximum}'
        if self.minimum is not None:
            return f'{text}, at least {self.minimum}'
        if self.maximum is not None:
            return f'{text}, at most {self.maximum}'
        return text

    def _element(self, element: Any, kind: type, whole: Any) -> Any:
        if kind is float and type(element) is int:
            element = float(element)
        if not isinstance(element, kind) or (kind is int and isinstance(element, bool)):
            raise self.error(whole)
        if self.choices:
            element = self._choice(element, whole)
        if kind is float and math.isfinite(self._usual()) and not math.isfinite(element):
            raise self.error(whole)
        if kind in (int, float) and (
            (self.minimum is not None and not element >= self.minimum)
            or (self.maximum is not None and not element <= self.maximum)
        ):
            raise self.error(whole)
        return element

    def _choice(self, element: Any, whole: Any) -> Any:
        """Return the choice that is meant: of texts also one in other letters, as `manual`."""
        if element in self.choices:
            return element
        if isinstance(element, str):
            for choice in self.choices:
                if isinstance(choice, str) and choice.casefold() == element.casefold():
                    return choice
        raise self.error(whole)

    def _usual(self) -> float:
        """Return the infinite default, if there is one: then infinite values make sense; else 0."""
        defaults = self.default if isinstance(self.default, list | tuple) else [self.default]
        return next((d for d in defaults if isinstance(d, float) and not math.isfinite(d)), 0.0)

    def _checked(self, accepted: Any, value: Any) -> Any:
        if self.check is not None:
            expected = self.check(accepted)
            if expected is not None:
                raise self.error(value, expected)
        return accepted


def shown(value: Any) -> str:
    """Return a value as a person writes it."""
    if isinstance(value, str):
        return repr(value)
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, Sequence | array) and not isinstance(value, bytes):
        return '[' + ', '.join(shown(element) for element in value) + ']'
    return str(value)


def specs_of(
    record: DataclassInstance, prefix: str = '', without: Container[str] = ()
) -> Iterator[ParameterSpec]:
    """Yield the parameters of a record; the defaults are the record's values.

    Args:
        record: The record.
        prefix: Stands before the fields' names, with its dot.
        without: Names of fields that are not declared.
    """
    for each in fields(record):
        value = getattr(record, each.name)
        if each.name in without:
            continue
        if (inner := each.metadata.get('parameters')) is not None:
            yield from specs_of(value, prefix + inner, without)
        elif spec := each.metadata.get('parameter'):
            default = spec['default'] if 'make' in each.metadata else value
            default = list(default) if isinstance(default, tuple) else default
            name = spec.get('name') or prefix + each.name
            yield ParameterSpec(**{**spec, 'name': name, 'default': default})


def with_values(record: Record, values: Mapping[str, Any], prefix: str = '') -> Record:
    """Return a record with new values of its parameters.

    Args:
        record: The record.
        values: By the parameters' names; others may be among them.
        prefix: Stands before the fields' names, with its dot.

    Raises:
        ParameterError: The values do not go together: the record raised a ValueError, which begins
            with a field's name.
    """
    changed = {}
    for each in fields(record):
        spec = each.metadata.get('parameter')
        if (inner := each.metadata.get('parameters')) is not None:
            changed[each.name] = with_values(getattr(record, each.name), values, prefix + inner)
        elif spec and (name := spec.get('name') or prefix + each.name) in values:
            value = values[name]
            make = each.metadata.get('make') or (tuple if isinstance(value, list) else None)
            changed[each.name] = make(value) if make else value
    try:
        return replace(record, **changed)
    except ValueError as error:
        raise ParameterError(f'parameter {prefix}{error}') from None
