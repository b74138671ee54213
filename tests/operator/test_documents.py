"""The files that the page makes when somebody asks."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator.desk.documents import DeskDocuments
from surveillance_operator.desk.event_index import EventIndex
from tests.operator.test_event_index import NIGHT
from tests.operator.test_hand_over import HOUR, night

__all__ = ['night']


def test_a_week_shows_how_it_went_day_by_day(night: EventIndex, tmp_path: Path) -> None:
    documents = DeskDocuments(night, tmp_path, lambda: NIGHT + 3 * HOUR)
    page = documents.report(begin=str(NIGHT - 6 * 24 * HOUR), of='week').content.decode()
    assert page.count('<div style="height') in (7, 8)  # by the time zone
    assert documents.report(form='csv').name.startswith('alarms_2026-03-0')
    for wrong, expected in (
        ({'of': 'weak'}, "expected 'week'"),
        ({'form': 'pdf'}, 'expected'),
        ({'begin': '2026-13-45'}, "time '2026-13-45': expected"),
        ({'begin': '5', 'end': '4'}, 'after the begin'),
    ):
        with pytest.raises(ValueError, match=expected):
            documents.report(**wrong)
    with pytest.raises(ValueError, match='no event'):
        documents.clip('nothing')
    key = night.search(NIGHT)['events'][0]['key']
    with pytest.raises(ValueError, match='nothing is recorded'):
        documents.clip(key)
