"""The log of what happened: several processes append to it, and a reader knows what it knows."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import MissionRecord, summarize
from surveillance_runtime import event_log
from surveillance_runtime.event_log import (
    KINDS,
    EventLog,
    RecordEntry,
    UnreadLines,
    check,
    gaps,
    read,
    read_all,
)

pytestmark = pytest.mark.unit

RESERVED = {'event', 'time', 'at', 'steady', 'boot'}
VISIT = {'event': 'visit', 'time': 2.0, 'place': 'E', 'distance': 1.0}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / 'events.jsonl'


@pytest.mark.parametrize(
    'line',
    [
        {'event': 'incident', 'time': 1.0},
        {'event': 'of a later version', 'time': 1.0, 'what': [1, 2]},
        {'event': 'restart', 'node': 'observer'},
    ],
)
def test_a_line_that_is_not_known_is_passed_over_and_counted(
    path: Path, line: dict[str, object]
) -> None:
    path.write_text(f'{json.dumps(VISIT)}\n{json.dumps(line)}\n{json.dumps(VISIT)}\n')
    unread = UnreadLines()
    assert [each.name for each in read(path, unread)] == ['visit', 'visit']
    assert unread.unknown == {line['event']: 1}
    with MissionRecord(path) as record:
        assert not record.problem
        record.write('visit', 3.0, place='E', distance=1.0)
    assert summarize(read(path)).visits == {'E': 3}


def test_a_line_of_the_mission_that_lacks_something_is_named_and_left_out(path: Path) -> None:
    path.write_text(f'{{"event": "visit", "time": 1.0}}\n{json.dumps(VISIT)}\n')
    unread = UnreadLines()
    assert [each.time for each in read(path, unread)] == [2.0]
    (line,) = unread.damaged
    assert line == f"{path}:1: event 'visit' lacks place, distance"
    with MissionRecord(path) as record:
        assert record.is_begun


def test_a_gap_is_its_writer_s_own(path: Path) -> None:
    def gap(time: float, phase: str, writer: str, lost: bool = False) -> RecordEntry:
        return RecordEntry('gap', time, {'phase': phase, 'writer': writer, 'lost': lost})

    start = RecordEntry('start', 30.0, {})
    begun = [gap(10.0, 'begin', 'behaviour'), gap(12.0, 'begin', 'alarm')]
    assert gaps([*begun, gap(20.0, 'end', 'alarm'), start]) == [(10.0, 30.0)]
    both = [*begun, start, gap(40.0, 'end', 'alarm', lost=True)]
    assert gaps(both) == [(10.0, 30.0), (12.0, 40.0)]


def test_processes_that_append_at_once_lose_no_line_over_many_files(path: Path) -> None:
    program = (
        'import sys\n'
        'from surveillance_runtime.event_log import EventLog\n'
        'log = EventLog(sys.argv[1])\n'
        'for turn in range(300):\n'
        '    try:\n'
        '        log.write("restart", node=sys.argv[2], why=str(turn))\n'
        '    except ValueError:\n'
        '        pass  # it waits\n'
        'while True:\n'
        '    try:\n'
        '        log.write("answer", line="over", answer=sys.argv[2])\n'
        '        break\n'
        '    except ValueError:\n'
        '        pass\n'
    )
    writers = [
        subprocess.Popen([sys.executable, '-c', program, str(path), str(number)])
        for number in range(3)
    ]
    with MissionRecord(path, segment_bytes=10_000) as record:
        record.write('start', 0.0, machine='patrol', place='E', places=['E'])
        turn = 0
        while any(each.poll() is None for each in writers) or turn < 300:
            turn += 1
            try:
                record.write('visit', float(turn), place='E', distance=1.0)
            except FileError:
                continue  # it waits
        record.write('end', float(turn + 1))
    assert [each.wait() for each in writers] == [0, 0, 0]
    found = list(read_all(path))
    told = Counter(each.text('node') for each in found if each.name == 'restart')
    assert told == {'0': 300, '1': 300, '2': 300}
    assert sum(each.name == 'visit' for each in found) == turn
    assert summarize(read(path)).visits == {'E': turn}
    assert len(event_log.segments(path)) > 1


def test_a_writer_without_a_clock_takes_the_mission_s_time(path: Path) -> None:
    with EventLog(path) as mission, EventLog(path) as launcher:
        mission.write('start', 7.5, machine='patrol', place='E', places=['E'])
        launcher.write('restart', node='observer', why='killed by SIGKILL')
    assert [(each.name, each.time) for each in read(path)] == [('start', 7.5), ('restart', 7.5)]


def test_a_torn_line_is_cut_off_by_whoever_writes_next(path: Path) -> None:
    with EventLog(path) as first, EventLog(path) as second:
        first.write('restart', node='a', why='x')
        os.truncate(path, path.stat().st_size - 3)
        second.write('restart', node='b', why='x')
        first.write('restart', node='c', why='x')
    assert [each.text('node') for each in read(path)] == ['b', 'c']


@contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold a log in another process, as one does that was stopped while it wrote."""
    holder = (
        'import fcntl, os, sys\n'
        'descriptor = os.open(sys.argv[1], os.O_RDWR | os.O_CREAT)\n'
        'fcntl.flock(descriptor, fcntl.LOCK_EX)\n'
        'print("held", flush=True)\n'
        'sys.stdin.read()\n'
    )
    with subprocess.Popen(
        [sys.executable, '-c', holder, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'held\n'
        yield


def test_what_another_process_holds_is_written_later(path: Path) -> None:
    with EventLog(path) as log:
        with held(path), pytest.raises(FileError, match='Resource temporarily unavailable'):
            log.write('restart', node='a', why='x')
        log.write('restart', node='b', why='x')
    assert [each.text('node') for each in read(path)] == ['a', 'b']


def test_a_log_that_another_process_holds_can_be_opened_and_gets_at_the_end_what_waited(
    path: Path,
) -> None:
    with held(path):
        log = EventLog(path)
        with pytest.raises(FileError):
            log.write('restart', node='a', why='x')
    log.close()
    assert [each.text('node') for each in read(path)] == ['a']


@pytest.mark.parametrize('name', KINDS)
def test_each_kind_of_the_table_is_complete(name: str) -> None:
    kind = KINDS[name]
    assert not RESERVED & set(kind.fields)
    assert kind.numbers <= set(kind.fields)
    assert set(kind.words) <= set(kind.fields)
    assert kind.section is None or set(kind.section.columns) <= set(kind.fields)
    if kind.fields:
        with pytest.raises(FileError, match='lacks'):
            check(name, {}, 'here')


class FullDisk:
    """A disk that gives a log nothing more than it has taken already."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.is_full = False
        self._allocate = event_log.allocate
        monkeypatch.setattr(event_log, 'allocate', self.allocate)

    def allocate(self, *args: int) -> None:
        if self.is_full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        self._allocate(*args)


def until_it_waits(record: MissionRecord) -> int:
    """Visit until the log takes no more; return how many visits it took."""
    for number in range(10_000):
        try:
            record.write('visit', 10.0 + number, place='E', distance=1.0)
        except FileError:
            return number
    raise AssertionError('it takes all')


def test_a_full_disk_costs_no_visit_for_long_and_then_the_log_says_so(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FullDisk(monkeypatch)
    record = MissionRecord(path)
    record.write('start', 0.0, machine='patrol', place='E', places=['E'])
    disk.is_full = True
    kept = until_it_waits(record)
    assert kept > 300
    for _ in range(9):
        with pytest.raises(FileError):
            record.write('visit', 20_000.0, place='E', distance=1.0)
    # It is killed, and started again when there is space.
    assert summarize(read(path)).visits == {'E': kept}
    disk.is_full = False
    with MissionRecord(path) as again:
        again.write('start', 30_000.0, machine='patrol', place='E', places=['E'])
    (gap,) = gaps(read(path))
    assert gap.begin == pytest.approx(10.0 + kept, abs=2.0)
    assert gap.end == 30_000.0


def test_nothing_is_missing_where_what_waited_was_written(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FullDisk(monkeypatch)
    with MissionRecord(path) as record:
        record.write('start', 0.0, machine='patrol', place='E', places=['E'])
        disk.is_full = True
        kept = until_it_waits(record)
        disk.is_full = False
        record.write('visit', 20_000.0, place='E', distance=1.0)
    assert summarize(read(path)).visits == {'E': kept + 2}
    assert gaps(read(path)) == []


@pytest.mark.parametrize('how', ['packed', 'cut short', 'torn'])
def test_a_full_disk_has_room_also_after_the_file_has_changed(
    path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    disk = FullDisk(monkeypatch)
    with EventLog(path) as log, EventLog(path) as other:
        for _ in range(2000):
            log.write('restart', node='a', why='x' * 100)
        if how == 'packed':
            other.begin_segment(other.entry('snapshot', 1.0, account={}))
        elif how == 'cut short':
            os.truncate(path, 0)
        else:
            with open(path, 'ab') as file:
                file.write(b'{"event": "rest')
            other.write('restart', node='b', why='x')
        log.write('restart', node='c', why='x')
        disk.is_full = True
        room = 512 * path.stat().st_blocks - path.stat().st_size
        assert room >= event_log.RESERVE / 2
