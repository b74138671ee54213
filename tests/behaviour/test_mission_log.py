"""The mission record survives what kills its writer, and its summary counts right."""

from __future__ import annotations

import errno
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import (
    CutOff,
    MissionRecord,
    account_of,
    cut_off,
    summarize,
    summary_in,
)
from surveillance_runtime import event_log
from surveillance_runtime.event_log import (
    Clocks,
    UnreadLines,
    on_one_clock,
    read,
    read_all,
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'runs' / 'events.jsonl'


def test_what_was_written_is_read_back(path: Path) -> None:
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E', 'C1'])
        record.write(
            'decision', 1.0, place='C1', rule='URGENT', reason='C1 went unvisited for 9.0 s'
        )
        record.write('visit', 6.5, place='C1', distance=5.4)
    events = read(path)
    assert [(event.name, event.time) for event in events] == [
        ('start', 0.0),
        ('decision', 1.0),
        ('visit', 6.5),
    ]
    assert events[1].text('reason') == 'C1 went unvisited for 9.0 s'
    assert events[2].number('distance') == 5.4


def test_a_killed_writer_loses_nothing(path: Path) -> None:
    program = (
        'import os, signal, sys\n'
        'from surveillance_behaviour.mission.mission_log import MissionRecord\n'
        'record = MissionRecord(sys.argv[1])\n'
        'record.write("start", 0.0, machine="surveillance", place="E", places=["E"])\n'
        'for turn in range(50):\n'
        '    record.write("visit", float(turn), place="E", distance=1.0)\n'
        'os.kill(os.getpid(), signal.SIGKILL)\n'
    )
    code = subprocess.run([sys.executable, '-c', program, str(path)], check=False).returncode
    assert code == -9
    assert summarize(read(path)).visits == {'E': 50}


@pytest.mark.parametrize('kept', [0, 1, 20])
def test_a_torn_last_line_is_skipped_and_then_cut_off(path: Path, kept: int) -> None:
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='patrol', place='E', places=['E'])
        record.write('visit', 1.0, place='E', distance=0.0)
    whole = path.read_bytes()
    first = whole.index(b'\n') + 1
    os.truncate(path, first + kept)
    assert [event.name for event in read(path)] == ['start']
    with MissionRecord(path) as record:
        record.write('visit', 2.0, place='E', distance=0.0)
    assert [(event.name, event.time) for event in read(path)] == [('start', 0.0), ('visit', 2.0)]


@pytest.mark.parametrize(
    'line',
    [
        'not json',
        '[' * 100_000,
        '{"event": "end", "time": NaN}',
        f'{{"time": {"9" * 400}, "event": ""}}',
    ],
)
def test_a_broken_line_is_named(path: Path, line: str) -> None:
    path.parent.mkdir()
    path.write_text(f'{{"event": "end", "time": 1}}\n{line}\n')
    shown, unread = re.escape(line[:60]), UnreadLines()
    assert [each.name for each in read(path, unread)] == ['end']
    (told,) = unread.damaged
    assert re.search(rf'events\.jsonl:2: expected a JSON object .*{shown}', told)


def test_files_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r'cannot read the mission record .*missing\.jsonl'):
        read(tmp_path / 'missing.jsonl')
    with pytest.raises(FileError, match='cannot write the mission record'):
        MissionRecord(tmp_path)


def test_the_summary_counts_everything(path: Path) -> None:
    with MissionRecord(path) as record:
        record.write('start', 100.0, machine='surveillance', place='E', places=['E', 'C1', 'R1'])
        record.write('decision', 101.0, place='C1', rule='CORRIDOR', reason='why')
        record.write('visit', 110.0, place='C1', distance=5.0)
        record.write('decision', 111.0, place='E', rule='recharge', reason='why')
        record.write('failure', 112.0, what='MOVE_TO_NEXT_ROOM', reason='a door is closed')
        record.write('visit', 130.0, place='E', distance=5.5)
        record.write('recharge', 150.0, place='E', seconds=20.0)
        record.write('visit', 160.0, place='C1', distance=5.0)
        record.write('end', 200.0)
    summary = summarize(read(path))
    assert summary.seconds == 100.0
    assert summary.visits == {'E': 1, 'C1': 2, 'R1': 0}
    assert summary.unvisited == {'E': 70.0, 'C1': 50.0, 'R1': 100.0}
    assert summary.distance == 15.5
    text = str(summary)
    assert '1 min 40 s, 2 of 3 places visited, 3 visits, 15.5 m' in text
    rows = [line.split() for line in text.splitlines()[1:5]]
    assert rows == [
        ['place', 'visits', 'longest', 'unvisited'],
        ['C1', '2', '50.0', 's'],
        ['E', '1', '70.0', 's'],
        ['R1', '0', '100.0', 's'],
    ]
    assert len({len(line) for line in text.splitlines()[1:5]}) == 1, 'a table'
    assert 'recharges: 1 (0 min 20 s)' in text
    assert 'decisions by rule: CORRIDOR 1, recharge 1' in text
    assert 'failures: MOVE_TO_NEXT_ROOM 1' in text


def test_a_restart_goes_on_and_another_clock_starts_anew(path: Path) -> None:
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E', 'C1'])
        record.write('visit', 10.0, place='C1', distance=0.0)
        record.write('start', 30.0, machine='surveillance', place='C1', places=['E', 'C1'])
        record.write('visit', 40.0, place='E', distance=0.0)
    assert summarize(read(path)).unvisited == {'E': 40.0, 'C1': 30.0}
    assert summarize(read(path)).restarts == 1
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E', 'C1'])
        record.write('visit', 5.0, place='C1', distance=0.0)
    assert summarize(read(path)).unvisited == {'E': 40.0, 'C1': 30.0}
    assert summarize(read(path)).seconds == 45.0


START = ('start', {'machine': 'surveillance', 'place': 'E', 'places': ['E', 'C1']})
DECISION = ('decision', {'place': 'C1', 'rule': 'URGENT', 'reason': 'why'})
TO_CHARGE = ('decision', {'place': 'E', 'rule': 'recharge', 'reason': 'it is low'})
VISIT = ('visit', {'place': 'C1', 'distance': 5.0})
EXPLORING = ('exploring', {'place': 'C1', 'seconds': 3.5})
RECHARGE = ('recharge', {'place': 'E', 'seconds': 9.0})


@pytest.mark.parametrize(
    ('events', 'expected'),
    [
        ([], None),
        ([START], CutOff(0.0, 'E')),
        ([START, VISIT, EXPLORING], CutOff(2.0, 'C1', 3.5)),
        ([START, DECISION], CutOff(1.0, 'E', math.inf, left=True)),
        ([START, DECISION, VISIT], CutOff(2.0, 'C1')),
        ([START, TO_CHARGE], CutOff(1.0, 'E', math.inf, left=True, charging='it is low')),
        ([START, TO_CHARGE, VISIT], CutOff(2.0, 'C1', charging='it is low')),
        ([START, TO_CHARGE, RECHARGE], CutOff(2.0, 'E', math.inf)),
        ([START, DECISION, START], CutOff(2.0, 'E', math.inf, left=True)),
        ([START, DECISION, ('end', {})], None),
    ],
)
def test_a_record_tells_where_its_mission_was_cut_off(
    path: Path, events: list[tuple[str, dict[str, object]]], expected: CutOff | None
) -> None:
    with MissionRecord(path) as record:
        for time, (name, fields) in enumerate(events):
            record.write(name, float(time), **fields)
    assert cut_off(read(path)) == expected


def test_what_a_full_disk_did_not_take_is_written_when_it_does(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_log, 'MOST_WAITING', 420)
    write, full = os.write, [False]

    def write_unless_full(descriptor: int, data: bytes) -> int:
        if full[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data)

    monkeypatch.setattr(event_log.os, 'write', write_unless_full)
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='surveillance', place='E', places=['E', 'C1'])
        for seconds in (10, 20):  # one, then more than may wait
            full[0] = True
            for each in range(1 if seconds == 10 else 9):
                lost = '; the oldest .* are lost' if each > 2 else ''
                with pytest.raises(FileError, match=f'No space left on device{lost}$'):
                    record.write('visit', float(seconds + each), place='C1', distance=5.0)
            full[0] = False
            record.write('visit', seconds + 9.5, place='E', distance=5.0)
    *first, last = [(event.time, event.text('place')) for event in read(path)]
    assert first[:3] == [(0.0, 'E'), (10.0, 'C1'), (19.5, 'E')]
    assert first[3:] == [(26.0, 'C1'), (27.0, 'C1'), (28.0, 'C1')]
    assert last == (29.5, 'E')


def test_what_another_simulation_wrote_says_nothing(path: Path) -> None:
    with MissionRecord(path) as record:
        record.write('decision', 50.0, place='C1', rule='URGENT', reason='why')
        record.write('start', 60.0, machine='surveillance', place='E', places=['E'])
        record.write('decision', 61.0, place='C1', rule='URGENT', reason='why')
        record.write('start', 1.0, machine='surveillance', place='C1', places=['E', 'C1'])
    assert cut_off(read(path)) == CutOff(1.0, 'C1')


DATE = 1.7e9


@pytest.mark.parametrize('step', [-3600.0, 3600.0])
def test_a_clock_that_is_set_changes_no_visit_and_no_wait(path: Path, step: float) -> None:
    wall, steady = DATE, 500.0

    def pass_by(seconds: float, set_by: float = 0.0) -> float:
        nonlocal wall, steady
        steady += seconds
        wall += seconds + set_by
        return wall

    with MissionRecord(path, clocks=Clocks(lambda: wall, lambda: steady)) as record:
        record.write('start', wall, **START[1])
        record.write('visit', pass_by(10.0), place='C1', distance=0.0)
        record.write('visit', pass_by(20.0), place='E', distance=0.0)
        now = pass_by(30.0, step)
        record.write('decision', now, **DECISION[1])
    account = account_of(read(path))
    assert account.visits == {'C1': now - 50.0, 'E': now - 30.0}
    assert cut_off(read(path)) == CutOff(now, 'E', math.inf, left=True)
    summary = summarize(read(path))
    assert summary.seconds == 60.0
    assert summary.unvisited == {'C1': 50.0, 'E': 30.0}
    times = [each.time for each in on_one_clock(read(path))]
    assert [time - times[0] for time in times] == [0.0, 10.0, 30.0, 60.0]


def when(seconds: float, steady: float, boot: str) -> dict[str, object]:
    """Return the times of an entry so long after `DATE`, seconds."""
    return {'time': DATE + seconds, 'at': DATE + seconds, 'steady': steady, 'boot': boot}


def test_a_machine_that_was_started_anew_counts_by_its_date(path: Path) -> None:
    lines = [
        {'event': 'start', **when(0.0, 900.0, 'a'), **START[1]},
        {'event': 'visit', **when(5000.0, 950.0, 'b'), **VISIT[1]},
    ]
    path.parent.mkdir()
    path.write_text(''.join(json.dumps(each) + '\n' for each in lines))
    assert summarize(read(path)).seconds == 5000.0


def test_an_old_record_whose_clock_went_back_is_counted_without_the_steady_one(path: Path) -> None:
    lines = [
        {'event': 'start', 'time': DATE, **START[1]},
        {'event': 'visit', 'time': DATE + 10.0, 'place': 'C1', 'distance': 0.0},
        {'event': 'visit', 'time': DATE + 30.0, 'place': 'E', 'distance': 0.0},
        {'event': 'decision', 'time': DATE - 3570.0, **DECISION[1]},
    ]
    path.parent.mkdir()
    path.write_text(''.join(json.dumps(each) + '\n' for each in lines))
    account = account_of(read(path))
    assert account.visits == {'C1': DATE - 3590.0, 'E': DATE - 3570.0}
    assert summarize(read(path)).seconds == 30.0
    assert summarize(read(path)).unvisited == {'C1': 20.0, 'E': 30.0}


def test_a_long_record_is_read_from_its_last_file_and_sums_up_all(path: Path) -> None:
    whole = path.with_name('whole.jsonl')
    with MissionRecord(path, segment_bytes=3000) as record, MissionRecord(whole) as other:
        for each in (record, other):
            each.write('start', 0.0, machine='patrol', place='E', places=['E', 'C1', 'R1'])
            for turn in range(300):
                rule = 'ROOM' if turn % 3 else 'recharge'
                each.write('decision', 2.0 * turn, place='C1', rule=rule, reason='because')
                place = 'C1' if turn % 2 else 'R1'
                each.write('visit', 2.0 * turn + 1.0, place=place, distance=1.5)
            each.write('failure', 700.0, what='moving', reason='a door is closed')
    packed = sorted(path.parent.glob('events.jsonl.*.gz'))
    assert len(packed) >= 8
    assert path.stat().st_size < 6000
    assert str(summarize(read(path))) == str(summarize(read(whole)))
    assert cut_off(read(path)) == cut_off(read(whole))
    assert account_of(read(path)).visits == account_of(read(whole)).visits
    told = [[(e.name, e.time, e.fields) for e in some] for some in (read_all(path), read(whole))]
    assert told[0] == told[1]
    with MissionRecord(path, segment_bytes=3000) as record:
        record.write('visit', 800.0, place='E', distance=0.0)
    assert summarize(read(path)).visits['E'] == 1


def test_a_writer_that_was_killed_between_two_files_loses_nothing(path: Path) -> None:
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='patrol', place='E', places=['E'])
    os.rename(path, path.with_name('events.jsonl.next'))
    with MissionRecord(path) as record:
        record.write('visit', 1.0, place='E', distance=0.0)
    assert [event.name for event in read(path)] == ['start', 'visit']


def test_a_damaged_snapshot_is_named(path: Path) -> None:
    path.parent.mkdir()
    path.write_text('{"event": "snapshot", "time": 1, "account": {"summary": {}}}\n')
    with pytest.raises(FileError, match='a snapshot of the mission record is damaged'):
        summarize(read(path))


@pytest.mark.parametrize('value', ['x', None, [], {'A': []}, 10**400], ids=range(5))
@pytest.mark.parametrize('where', ['last_seen', 'visits', 'seconds', 'distance', 'unvisited'])
def test_a_snapshot_whose_numbers_are_none_is_named(path: Path, where: str, value: object) -> None:
    with MissionRecord(path) as record:
        record.write('visit', 1.0, place='A', distance=2.0)
        account: Any = record._account.to_json()
    part = account if where in account else account['summary']
    part[where] = value
    line = json.dumps({'event': 'snapshot', 'time': 2.0, 'account': account})
    path.write_text(f'{line}\n{{"event": "end", "time": 3.0}}\n')
    with pytest.raises(FileError, match='a snapshot of the mission record is damaged'):
        summarize(read(path))
    MissionRecord(path).close()


@pytest.mark.parametrize('value', ['null', '"far"', '[]', 'NaN'])
def test_a_number_that_is_none_is_named_and_a_mission_goes_on(path: Path, value: str) -> None:
    path.parent.mkdir()
    path.write_text(f'{{"event": "visit", "time": 1, "place": "E", "distance": {value}}}\n')
    with MissionRecord(path) as record:
        assert "jsonl:1: event 'visit': distance is" in record.left_out.words()
        record.write('visit', 2.0, place='E', distance=0.0)
    assert summarize(read(path)).visits == {'E': 1}


@pytest.mark.parametrize('how', ['gone', 'no account'])
def test_what_a_damaged_snapshot_counted_is_counted_again(path: Path, how: str) -> None:
    with MissionRecord(path, segment_bytes=3000) as record:
        for turn in range(100):
            record.write('visit', 2.0 * turn, place='C1', distance=1.5)
    first, _, rest = path.read_bytes().partition(b'\n')
    first = b'{' if how == 'gone' else first.replace(b'"left_at"', b'"left"')
    path.write_bytes(first + b'\n' + rest)
    with MissionRecord(path) as again:
        assert again.left_at is not None
        assert str(path) in again.left_out.words()
        again.write('visit', 300.0, place='C1', distance=1.5)
    assert summary_in(path).visits == {'C1': 101}


def test_an_empty_record_says_so(path: Path) -> None:
    MissionRecord(path).close()
    assert str(summarize(read(path))) == 'Mission: nothing was recorded.'


@settings(max_examples=60)
@given(
    legs=st.lists(st.tuples(st.floats(0.0, 1e4), st.sampled_from('ABCD')), max_size=30),
    cut=st.integers(0, 200),
)
def test_no_finished_line_is_ever_lost(
    tmp_path_factory: pytest.TempPathFactory, legs: list[tuple[float, str]], cut: int
) -> None:
    path = tmp_path_factory.mktemp('record') / 'events.jsonl'
    with MissionRecord(path) as record:
        for seconds, place in legs:
            record.write('visit', seconds, place=place, distance=0.0)
    content = path.read_bytes()
    path.write_bytes(content[: max(0, len(content) - cut)])
    finished = path.read_bytes().count(b'\n')
    assert [event.text('place') for event in read(path)] == [p for _, p in legs][:finished]
