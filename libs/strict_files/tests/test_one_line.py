"""Texts from the network become one line of bounded length."""

from __future__ import annotations

import pytest

from strict_files.one_line import LONGEST, clean, without_controls

pytestmark = pytest.mark.unit


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('a\nb', r'a\nb'),
        ('a\u2028b', r'a\u2028b'),
        ('a\ud800b', r'a\ud800b'),
        ('\x1b[31mred', r'\x1b[31mred'),
        ('Tür 3', 'Tür 3'),
    ],
)
def test_a_text_is_one_line_that_any_mail_and_terminal_can_hold(text: str, line: str) -> None:
    assert clean(text) == line
    clean(text).encode('utf-8')


def test_a_long_text_loses_its_middle() -> None:
    text = clean('x' * 10**6)
    assert len(text) < LONGEST + 60
    assert 'left out' in text


def test_line_breaks_may_be_kept() -> None:
    assert without_controls('a\n\tb\x07') == 'a\n\tb\\x07'
