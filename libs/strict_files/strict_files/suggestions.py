"""The nearest known name of a mistyped one, for errors that say what was expected."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

_MOST = 16
_ALIKE = 0.65
_SHARED_WORD = 0.8
_BEGUN_WORD = 0.7
_SHORTEST_BEGINNING = 3
_LONGEST = 200
"""Letters of a given name that are looked at: a stranger's may have a million."""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return what to expect instead of an unknown name.

    Args:
        name: What was given.
        known: The names there are.

    Returns:
        The nearest name, in quotes, where one is like it, whatever the case of its letters, begins
        with it or has it as one of its words, and the only name; else the names, at most sixteen;
        where there are none, that.
    """
    names = list(dict.fromkeys(known))
    if not names:
        return 'none, for there is none'
    if len(names) == 1 or (likest := like(name, names)):
        return f"'{names[0] if len(names) == 1 else likest}'"
    more = f' and {len(names) - _MOST} more' if len(names) > _MOST else ''
    return f'one of {", ".join(names[:_MOST])}{more}'


def like(name: str, known: Iterable[str]) -> str:
    """Return the known name that is most like an unknown one; empty where none is like it."""
    likest = max(known, key=lambda each: _likeness(name, each), default='')
    return likest if _likeness(name, likest) >= _ALIKE else ''


def _likeness(given: str, name: str) -> float:
    """Return 0 to 1, whatever the case; a name with it as a word, or its beginning, is like it."""
    given = given[:_LONGEST]
    given, name = given.casefold().lstrip('-'), name.casefold().lstrip('-')
    ratio = difflib.SequenceMatcher(None, name, given).ratio()
    if given in re.split(r'[._/ -]', name):
        return max(ratio, _SHARED_WORD)
    if len(given) >= _SHORTEST_BEGINNING and name.startswith(given):
        return max(ratio, _BEGUN_WORD)
    return ratio
