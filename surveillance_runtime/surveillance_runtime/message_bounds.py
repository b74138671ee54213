"""How long the arrays of a message may be that a callback is called with.

What a callback costs must not depend on what a stranger sends. Each message or text in an array
costs microseconds; arrays of numbers cost next to nothing, and whoever copies them checks them.
"""

from __future__ import annotations

from collections.abc import Hashable
from functools import cache
from typing import Any

MOST_ELEMENTS = 2000
"""Messages or texts in an array on a topic: nobody honest sends more. Paths are goals of actions,
which a thread of their own takes."""
MOST_ASKED = 500
"""Parameters that one request asks for or sets."""
MOST_VALUES = 20_000
"""Elements of all the values together that one request sets."""
MOST_BYTES = 131_072
"""Bytes of such a message before it is taken apart, which costs the most."""
_MAY_BE_LONG = ('FactChanges',)
"""What one reasoning run changes is as long as it is."""
_NUMBERS = ('double', 'float', 'int', 'uint', 'char', 'byte', 'octet', 'boolean')


def _fields(kind: Any) -> dict[str, str]:
    return dict(kind.get_fields_and_field_types())


@cache
def lists_of(kind: Hashable) -> tuple[str, ...]:
    """Return the fields of a kind of message that are arrays of messages or texts."""
    if getattr(kind, '__name__', '') in _MAY_BE_LONG:
        return ()
    return tuple(
        name
        for name, field in _fields(kind).items()
        if field.startswith('sequence<') and not field[9:].startswith(_NUMBERS)
    )


@cache
def _has_numbers(kind: Hashable) -> bool:
    fields = _fields(kind).values()
    return any(each.startswith('sequence<') and each[9:].startswith(_NUMBERS) for each in fields)


def check_bytes(serialized: bytes, kind: Any) -> None:
    """Look at a serialized message before it is taken apart.

    Raises:
        ValueError: It has arrays of messages or texts, and they must be too long.
    """
    if len(serialized) <= MOST_BYTES:
        return
    if lists_of(kind) and not _has_numbers(kind):
        raise ValueError(f'it has {len(serialized)} bytes: expected at most {MOST_BYTES}')


def check_length(message: Any, most: int = MOST_ELEMENTS) -> None:
    """Look at a message before it is worked on.

    Raises:
        ValueError: An array of it is too long.
    """
    kind: Any = type(message)
    for name in lists_of(kind):
        count = len(getattr(message, name))
        if count > most:
            raise ValueError(f'{name} has {count} elements: expected at most {most}')


def check_asked(request: Any) -> None:
    """Look at a request to a service of parameters before it is worked on.

    Raises:
        ValueError: It asks for too many, or sets values that are too long.
    """
    check_length(request, MOST_ASKED)
    values = [each.value for each in getattr(request, 'parameters', ())]
    arrays = (
        [name for name in _fields(values[0]) if name.endswith('_array_value')] if values else ()
    )
    count = sum(len(getattr(value, name)) for value in values for name in arrays)
    if count > MOST_VALUES:
        raise ValueError(f'its values have {count} elements: expected at most {MOST_VALUES}')
