"""The hand-over of a shift: what is open, who acknowledged what, what was not visited, as CSV."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import pytest

from surveillance_operator.desk.event_index import EventIndex, read_run
from surveillance_operator.desk.hand_over import Shift, as_csv, as_html, shift_of
from tests.operator.browser import CHROMIUM, DESK, DRIVER, MISSING, PHONE, Viewer
from tests.operator.test_event_index import NIGHT, Run

HOUR = 3600.0


@pytest.fixture
def night(tmp_path: Path) -> EventIndex:
    run = Run(tmp_path / '20260304-200000')
    run.log.write('start', 0.0, machine='surveillance', place='E', places=['R1', 'R2', 'E'])
    run.now += HOUR
    run.log.write('visit', 1.0, place='R1', distance=5.0)
    run.incident('aaa', 'begin')
    run.incident('aaa', 'call', number=1)
    run.now += 600
    run.say('acknowledge', 'aaa', note='<b>the cleaner</b>')
    run.now += HOUR
    run.incident('aaa', 'end')
    run.log.write('failure', 2.0, what='MOVE', reason='D2 is closed')
    seen = {
        'number': 4, 'kind': 'person', 'seen': 'seen', 'subject': '', 'position': None,
        'confidence': 0.9, 'rule': '=cmd',
    }  # fmt: skip
    run.incident('bbb', 'begin', name='4', finding=seen, place='R2')
    run.log.write('press', 3.0, by='Anna', role='guard', action='stop', answer='stopped')
    index = EventIndex()
    read_run(index, run.folder, live=True)
    return index


def shift(index: EventIndex, folder: Path) -> Shift:
    return shift_of(index, sorted(folder.glob('2026*')), NIGHT, NIGHT + 8 * HOUR)


def test_a_shift_tells_what_is_open_and_what_was_not_visited(
    night: EventIndex, tmp_path: Path
) -> None:
    found = shift(night, tmp_path)
    assert [each.text for each in found.open_ones] == ['person was seen']
    assert found.minutes_to_acknowledge == [10.0]
    assert {place: each.visits for (_, place), each in found.places.items()} == {
        'R1': 1, 'R2': 0, 'E': 0,
    }  # fmt: skip
    assert found.places['', 'R1'].longest == 7 * HOUR
    assert [each[3] for each in found.failures] == ['D2 is closed']
    page = as_html(found, 'shift')
    for words in ('1 open at its end', 'Anna', 'D2 is closed', 'after 10 min in the median'):
        assert words in page
    assert '<b>the cleaner' not in page
    assert 'Day by day' not in page
    # What happened later is not of this shift.
    early = shift_of(night, sorted(tmp_path.glob('2026*')), NIGHT, NIGHT + HOUR + 60)
    assert [each.state(early.end, later=True) for each in early.open_ones] == ['unacknowledged']


def test_the_csv_has_a_row_for_each_alarm_and_no_formula(night: EventIndex, tmp_path: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(as_csv(shift(night, tmp_path)))))
    assert [row['what'] for row in rows] == ['door D6 is open', 'person was seen']
    assert (rows[0]['acknowledged_by'], rows[0]['minutes_to_acknowledge']) == ('Anna', '10.0')
    assert rows[1]['rule'] == "'=cmd"
    assert rows[1]['state'] == 'unacknowledged'


@pytest.mark.skipif(not (CHROMIUM and DRIVER), reason=MISSING)
def test_everybody_can_read_it_on_a_phone(
    night: EventIndex, tmp_path: Path, browser: Viewer
) -> None:
    found = shift_of(night, sorted(tmp_path.glob('2026*')), NIGHT - 48 * HOUR, NIGHT + 8 * HOUR)
    path = tmp_path / 'shift.html'
    path.write_text(as_html(found, 'week'), encoding='utf-8')
    browser.driver.get(path.as_uri())
    for size in (PHONE, DESK):
        for dark in (False, True):
            browser.size(*size, dark=dark)
            assert browser.axe() == []
            assert browser.js('return document.documentElement.scrollWidth') <= size[0]
            overlap = browser.js(
                'const cells = [...document.querySelectorAll("td")].map((e) =>'
                ' e.getBoundingClientRect()).filter((b) => b.width && b.height);'
                'return cells.some((a, i) => cells.slice(i + 1).some((b) => a.left < b.right - 1 &&'
                ' b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1))'
            )
            assert not overlap
    browser.size(*DESK)
