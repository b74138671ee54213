"""The report of a day shows what was checked, what was seen, and what was not as it should be."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from indoor_watch import EventBook, EventState, EvidenceStore, Kind, Observation, day_book
from indoor_watch.day_book import DayBook
from strict_files.files import FileError
from surveillance_operator.day_report import write_day
from surveillance_operator.report import main
from surveillance_runtime.run_files import LAUNCH_LOG, TIMELINE


def at(day: int, hour: int) -> float:
    return datetime(2026, 3, day, hour).timestamp()


def door(state: str, stamp: float, evidence: str = '') -> Observation:
    return Observation(Kind.DOOR, state, 'C1', 'D1', (1.0, 2.0), 0.9, stamp, evidence=evidence)


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """Return a run in which a door was ajar on the second of March, and somebody was called."""
    store = EvidenceStore(tmp_path / 'evidence')
    shown = store.keep(np.full((40, 60, 3), 90, np.uint8), 'sweep-door-D1-ajar', 3, at(2, 21))
    book, days = EventBook(), DayBook(datetime.fromtimestamp)
    seen = [door('closed', at(2, 8)), door('closed', at(2, 9)), door('ajar', at(2, 21), shown)]
    for look, each in enumerate(seen):
        days.take(each)
        book.take(each, severity=3 if each.state == 'ajar' else 0, rule='<D1> shut', visit=look)
    days.take(door('closed', at(3, 8)))
    false = Observation(Kind.LIGHT, 'off', 'R1', stamp=at(2, 22))
    event = book.take(false, severity=2, rule='light', visit=9)
    assert event is not None
    book.answer(event.number, EventState.FALSE)
    state = {'book': book.state(), 'days': days.state()}
    (tmp_path / 'observer.json').write_text(json.dumps(state))
    entry = {'at': at(2, 21), 'kind': 'event', 'name': '1', 'severity': 'alarm', 'text': 'ajar!'}
    lines = [{**entry, 'seconds': None}, {**entry, 'seconds': 3.0}, {**entry, 'at': at(3, 1)}]
    text = '\n'.join(map(json.dumps, lines)) + '\n{"cut o'
    (tmp_path / 'incidents.jsonl').write_text(text)
    return tmp_path


def test_a_day_is_told_with_its_pictures(run: Path) -> None:
    text = write_day(run, '2026-03-02').read_text()
    assert '3 observations of 1 things; 2 events, 1 of them alerts, 1 false alarms' in text
    assert text.count('data:image/jpeg;base64,') == 1
    assert '&lt;D1&gt; shut' in text
    assert 'closed (2, last 09:00:00)' in text
    assert 'ajar (1, last 21:00:00)' in text
    assert text.index('Unusual') < text.index('1: door D1 is ajar') < text.index('Called normal')
    assert text.count('ajar!') == 1


def test_the_newest_day_is_found_and_one_without_anything_is_one_line(run: Path) -> None:
    assert write_day(run, 'last').name == 'day_2026-03-03.html'
    with pytest.raises(FileError, match=r'nothing was seen on 2026-03-05, the newest days are'):
        write_day(run, '2026-03-05')
    with pytest.raises(FileError, match=r"--day 'monday': expected such as 2026-03-01"):
        write_day(run, 'monday')
    (run / 'observer.json').write_text('{"book": 3}')
    with pytest.raises(FileError, match=r'observer.json: cannot be read'):
        write_day(run, 'last')
    (run / 'observer.json').unlink()
    with pytest.raises(FileError, match='nothing was watched, expected a run with --watch'):
        write_day(run, 'last')


def test_the_day_of_a_fleet_is_that_of_each_robot_that_watched(
    run: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    fleet = tmp_path_factory.mktemp('fleet')
    (fleet / LAUNCH_LOG).touch()
    for name in ('robot1', 'robot2', 'robot3'):
        (fleet / name).mkdir()
        (fleet / name / TIMELINE).touch()
    for name in ('robot2', 'robot3'):
        (fleet / name / 'observer.json').write_bytes((run / 'observer.json').read_bytes())
    assert main([str(fleet), '--day', '2026-03-02']) == 0
    told = capsys.readouterr()
    assert told.out.split() == [
        str(fleet / name / 'day_2026-03-02.html') for name in ('robot2', 'robot3')
    ]
    assert told.err.startswith(f'report: {fleet / "robot1"}: nothing was watched')
    assert main([str(fleet), '--day', 'monday']) == 2
    assert "--day 'monday': expected such as 2026-03-01" in capsys.readouterr().err


def test_the_book_of_days_is_bounded_and_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(day_book, 'MOST_DAYS', 3)
    monkeypatch.setattr(day_book, 'MOST_LINES', 2)
    days = DayBook(datetime.fromtimestamp)
    for day in range(1, 6):
        for number in range(4):
            days.take(Observation(Kind.MARKER, 'here', 'R1', str(number), stamp=at(day, 8)))
    assert days.days() == ['2026-03-03', '2026-03-04', '2026-03-05']
    assert [(each.subject, each.count) for each in days.seen_on('2026-03-05')] == [
        ('0', 1),
        ('1', 1),
        ('other', 2),
    ]
    again = DayBook(datetime.fromtimestamp)
    again.restore(json.loads(json.dumps(days.state())))
    assert again.state() == days.state()


def test_a_day_that_is_none_is_named_also_where_nothing_was_watched(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"--day '2026-13-45': expected such as 2026-03-01"):
        write_day(tmp_path, '2026-13-45')
    with pytest.raises(FileError, match='nothing was watched'):
        write_day(tmp_path, '2026-03-01')
