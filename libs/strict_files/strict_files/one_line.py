"""Texts of strangers as one line of bounded length, without control characters."""

from __future__ import annotations

LONGEST = 1000
"""Characters of a line; what is longer loses its middle."""


def clean(text: str) -> str:
    """Return a text as one line of bounded length: control characters are written as escapes."""
    if len(text) > LONGEST:
        left_out = len(text) - LONGEST
        half = LONGEST // 2
        text = f'{text[:half]} ... ({left_out} characters left out) ... {text[-half:]}'
    return without_controls(text, kept='')


def without_controls(text: str, kept: str = '\n\t') -> str:
    """Return a text with its control characters written as escapes, but for those to be kept."""
    if text.isprintable():
        return text
    return ''.join(
        each
        if each.isprintable() or each in kept
        else each.encode('unicode_escape').decode('ascii')
        for each in text
    )
