"""Message types by name, and their definitions as text (ros2msg), for recordings."""

from __future__ import annotations

import importlib
import re
from functools import cache
from pathlib import Path
from typing import Any

SEPARATOR = '=' * 80
_BASIC = {'boolean': 'bool', 'octet': 'byte', 'float': 'float32', 'double': 'float64'}
_SLOT = re.compile(r'(?:sequence<)?([\w/]+)')


@cache
def message_class(name: str) -> Any:
    """Return the class of a type such as `std_msgs/msg/Bool`.

    Raises:
        ValueError: It is not installed here.
    """
    try:
        package, kind, short = name.split('/')
        module = importlib.import_module(f'{package}.{kind}')
        if hasattr(module, short):
            return getattr(module, short)
        # What an action generates stands in a module of its own.
        action, _, part = short.partition('_')
        owner = getattr(module, action)
        return getattr(owner if hasattr(owner, part) else owner.Impl, part)
    except (ImportError, ValueError, AttributeError):
        raise ValueError(f'type {name} is not installed here') from None


@cache
def definition(name: str) -> str:
    """Return a type's definition, followed by those of the types that it uses.

    Raises:
        ValueError: It, or one that it uses, is not installed here.
    """
    found: dict[str, str] = {}

    def collect(each: str) -> None:
        if each in found:
            return
        found[each] = _text(each)
        for slot in message_class(each).get_fields_and_field_types().values():
            if (inner := _inner(slot)) is not None:
                collect(inner)

    collect(name)
    first, *others = found.items()
    parts = [first[1]]
    parts += [f'{SEPARATOR}\nMSG: {each.replace("/msg/", "/")}\n{text}' for each, text in others]
    return '\n'.join(parts)


def _text(name: str) -> str:
    """Return the type's own file where it is installed, with its comments and constants."""
    package, kind, short = name.split('/')
    home = Path(str(importlib.import_module(package).__file__))
    for parent in home.parents:
        file = parent / 'share' / package / kind / f'{short}.msg'
        if file.is_file():
            return file.read_text(encoding='utf-8').strip()
    fields = message_class(name).get_fields_and_field_types()
    return '\n'.join(f'{_type(slot)} {field}' for field, slot in fields.items())


def _inner(slot: str) -> str | None:
    """Return the full name of the message that a field holds, or None."""
    match = _SLOT.match(slot)
    if match is None or '/' not in match.group(1):
        return None
    package, short = match.group(1).rsplit('/', 1)
    for kind in ('msg', 'action', 'srv'):
        try:
            message_class(f'{package}/{kind}/{short}')
        except ValueError:
            continue
        return f'{package}/{kind}/{short}'
    raise ValueError(f'type {match.group(1)} is not installed here')


def _type(slot: str) -> str:
    """Return a field's type as definitions spell it: `sequence<double, 3>` is `float64[<=3]`."""
    bounded = re.fullmatch(r'sequence<([\w/<>]+)(?:, (\d+))?>', slot)
    if bounded:
        limit = f'<={bounded.group(2)}' if bounded.group(2) else ''
        return f'{_type(bounded.group(1))}[{limit}]'
    array = re.fullmatch(r'([\w/]+)\[(\d+)\]', slot)
    if array:
        return f'{_type(array.group(1))}[{array.group(2)}]'
    text = re.fullmatch(r'(w?string)<(\d+)>', slot)
    if text:
        return f'{text.group(1)}<={text.group(2)}'
    # Only messages may be named without their kind.
    inner = _inner(slot)
    if inner is not None and '/msg/' not in inner:
        return inner
    return _BASIC.get(slot, slot)
