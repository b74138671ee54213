"""What the page may ask of the events."""

from __future__ import annotations

from pathlib import Path

import pytest

from surveillance_operator.desk.event_index import EventIndex, read_run
from surveillance_operator.desk.questions import EventQuestions
from tests.operator.test_event_index import NIGHT, Run

pytestmark = pytest.mark.unit


def test_a_search_finds_by_time_place_kind_severity_and_state(tmp_path: Path) -> None:
    run, index = Run(tmp_path), EventIndex()
    for number in range(1, 11):
        run.now = NIGHT + 3600 * number
        kind = 'door' if number % 2 else 'person'
        run.finding(number, kind=kind, seen='seen', place=f'R{number % 3}', severity=number % 4)
    read_run(index, tmp_path)
    ask = EventQuestions(index, lambda: run.now).search
    numbers = lambda found: [each['number'] for each in found['events']]  # noqa: E731
    assert numbers(ask(kind='person')) == [10, 8, 6, 4, 2]
    assert numbers(ask(severity='alert')) == [7, 3]
    assert numbers(ask(place='R1', most='2')) == [10, 7]
    assert numbers(ask(begin=str(NIGHT + 3600 * 9), kind='door', severity='notice'))[0] == 9
    assert numbers(ask(text='PERSON r1')) == [10, 4]
    assert numbers(ask(state='open', severity='warning')) == [10, 7, 6, 3, 2]
    assert ask(skip='9')['count'] == 10
    for wrong, expected in (
        ({'severity': 'alrt'}, "expected 'alert'"),
        ({'begin': 'yesterday'}, 'expected such as 2026-03-01T22:00'),
        ({'most': '-1'}, 'expected a number'),
        ({'state': 'acked'}, 'expected'),
    ):
        with pytest.raises(ValueError, match=expected):
            ask(**wrong)
