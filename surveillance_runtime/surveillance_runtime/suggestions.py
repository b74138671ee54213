"""The nearest known name of a mistyped one, for errors that say what was expected."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_MOST = 12


def nearest(name: str, known: Iterable[str]) -> str:
    """Return what to expect instead of an unknown name.

    Args:
        name: What was given.
        known: The names there are.

    Returns:
        The nearest name, in quotes, where one is like it; else the names, at most twelve of them.
    """
    names = list(dict.fromkeys(known))
    alike = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if alike:
        return f"'{alike[0]}'"
    more = f' and {len(names) - _MOST} more' if len(names) > _MOST else ''
    return f'one of {", ".join(names[:_MOST])}{more}'
