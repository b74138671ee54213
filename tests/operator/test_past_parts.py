"""What the page showed at an earlier time."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator.desk.past_parts import PastParts
from tests.operator.test_timeline import record

pytestmark = pytest.mark.unit


def test_the_past_is_shown_as_it_was_also_of_a_line_that_grows(tmp_path: Path) -> None:
    record(tmp_path / 'timeline.jsonl', 50)
    past = PastParts(tmp_path)
    assert past.past('1040.5')['parts']['pose'] == [4.0, 0.0, 0.0]
    assert past.past('1040.5')['now'] == 40.0
    for wrong, expected in (('5', 'nothing is recorded'), ('noon', 'could not convert')):
        with pytest.raises(ValueError, match=expected):
            past.past(wrong)
    with pytest.raises(ValueError, match='no robot'):
        past.past('1040', '../other')
    with pytest.raises(ValueError, match='start with --record'):
        past.past('1040', 'bob')
    past.close()
