"""Checks of parameter values, with errors that say what was wrong, where, and what was expected.

A parameter's type is that of its default. An integer is accepted where a float is declared, since
people write `speed:=1` and mean 1.0.

The fields of a record are declared together, from a table beside its defaults:

FIELDS = {
    'speed': Described('Top speed, m/s.', 0.01, 20.0),
    'turn': Described('Top turning speed, rad/s.', 0.01, 20.0),
}
drive = declare_fields(node, DriveParameters(), FIELDS, prefix='drive.')
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Record = TypeVar('Record', bound=DataclassInstance)

Check = Callable[[Any], str | None]
"""Looks at a valid value further; returns what was expected instead, or None when it is good."""

_TYPE_NAMES = {bool: 'true or false', int: 'an integer', float: 'a number', str: 'a text'}
_LIST_NAMES = {bool: 'booleans', int: 'integers', float: 'numbers', str: 'texts'}


class ParameterError(ValueError):
    """A parameter has a value that the node cannot work with; the message is one line."""


@dataclass(frozen=True)
class ParameterSpec:
    """What values a parameter takes.

    Attributes:
        name: The parameter's name.
        default: Its default; fixes the type.
        element: Type of a list's elements; None for a single value.
        minimum: Least value, for numbers and for the numbers in a list.
        maximum: Greatest value, likewise.
        choices: The only values allowed; empty for any.
        check: Looks at the value after everything else.
    """

    name: str
    default: Any
    element: type | None = None
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    check: Check | None = None

    def accept(self, value: Any) -> Any:
        """Return the value as the node works with it: numbers as declared, arrays as lists.

        Raises:
            ParameterError: The value has the wrong type or is out of range.
        """
        if self.element is None:
            return self._checked(self._element(value, type(self.default), value), value)
        if isinstance(value, str | bytes) or not isinstance(value, Sequence | array):
            raise self.error(value)
        return self._checked([self._element(v, self.element, value) for v in value], value)

    def error(self, value: Any, expected: str | None = None) -> ParameterError:
        """Build the error for a value that does not fit."""
        return ParameterError(
            f'parameter {self.name}: got {_shown(value)}, expected {expected or self.expected()}'
        )

    def expected(self) -> str:
        """Say in words what values are allowed."""
        if self.choices:
            return 'one of ' + ', '.join(_shown(choice) for choice in self.choices)
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
        if kind is float and isinstance(element, int) and not isinstance(element, bool):
            element = float(element)
        if kind is float:
            fits = isinstance(element, float)
        else:
            fits = type(element) is kind
        if not fits:
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
        """Return a default that is not finite says that such values make sense."""
        defaults = self.default if isinstance(self.default, list | tuple) else [self.default]
        return next((d for d in defaults if isinstance(d, float) and not math.isfinite(d)), 0.0)

    def _checked(self, accepted: Any, value: Any) -> Any:
        if self.check is not None:
            expected = self.check(accepted)
            if expected is not None:
                raise self.error(value, expected)
        return accepted


def element_type(name: str, default: Any, of: type | None) -> type | None:
    """Find the type of a list parameter's elements; None when the default is a single value.

    Raises:
        TypeError: The default is an empty list and `of` is not given.
    """
    if not isinstance(default, list | tuple):
        return None
    if of is not None:
        return of
    if not default:
        raise TypeError(f'parameter {name}: an empty default needs of=<element type>')
    return type(default[0])


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return repr(value)
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, Sequence | array) and not isinstance(value, bytes):
        return '[' + ', '.join(_shown(element) for element in value) + ']'
    return str(value)


@dataclass(frozen=True)
class Described:
    """How a field is declared; its default and type are those of the record.

    Attributes:
        text: One sentence with the unit.
        minimum: Least value of a number (or of a list's numbers).
        maximum: Greatest value, likewise.
        choices: The only values allowed.
        of: Element type of a list whose default is empty.
        check: Looks at the value last; returns what was expected, or None when it is good.
        name: The parameter's name where it is not the field's behind the prefix.
    """

    text: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    of: type | None = None
    check: Check | None = None
    name: str = ''


class Declaring(Protocol):
    """A node that declares parameters; see `PatrolNode.parameter`."""

    @property
    def parameter(self) -> Callable[..., Any]:
        """Declare a parameter and return its value."""


def declare_fields(
    node: Declaring,
    record: Record,
    described: Mapping[str, Described],
    *,
    prefix: str = '',
    on_change: Callable[[str, Any], None] | None = None,
) -> Record:
    """Declare fields of a record as parameters.

    Args:
        node: The node.
        record: The defaults; a tuple among them is declared as a list.
        described: The fields that are parameters; the others stay as they are.
        prefix: Stands before the fields' names, with its dot.
        on_change: Called with a field's name and its new value after each change at run time;
            without it the parameters are read-only.

    Returns:
        The record with the parameters' values.

    Raises:
        ParameterError: A value given at the start is not allowed, alone or beside the others: then
            the record raised a ValueError that begins with the field's name.
    """
    values: dict[str, Any] = {}
    for field, how in described.items():
        default = getattr(record, field)
        kind = tuple if isinstance(default, tuple) else None
        value = node.parameter(
            how.name or prefix + field,
            list(default) if kind else default,
            how.text,
            minimum=how.minimum,
            maximum=how.maximum,
            choices=how.choices,
            of=how.of,
            check=how.check,
            read_only=on_change is None,
            on_change=None if on_change is None else partial(_tell, on_change, field, kind),
        )
        values[field] = kind(value) if kind else value
    try:
        return replace(record, **values)
    except ValueError as error:
        raise ParameterError(f'parameter {prefix}{error}') from None


def _tell(
    told: Callable[[str, Any], None], field: str, kind: Callable[[Any], Any] | None, value: Any
) -> None:
    told(field, kind(value) if kind else value)
