"""The nearest known name of a mistyped one, for errors that say what was expected."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_MOST = 16


def closest_name(name: str, known: Iterable[str]) -> str:
    """Return the known name that is most like ``name``, in quotes; else the names, at most 16."""
    names = list(dict.fromkeys(known))
    folded = {each.casefold(): each for each in names}
    if alike := difflib.get_close_matches(name.casefold(), folded, 1):
        return f"'{folded[alike[0]]}'"
    if len(names) == 1:
        return f"'{names[0]}'"
    more = f' and {len(names) - _MOST} more' if len(names) > _MOST else ''
    return f'one of {", ".join(names[:_MOST])}{more}'
