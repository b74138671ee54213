"""The time line of a recording: written, torn, read back, jumped in."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from patrol_policy.situation import Decision
from strict_files.files import FileError
from surveillance_operator.mission_state import MissionState
from surveillance_operator.recording.timeline import Timeline, TimelineWriter

DECISION = Decision(0.0, 'A', 'B', 'B', 'URGENT', 'tour', 'why', {'B': 1.0})


def record(path: Path, seconds: int = 200) -> None:
    writer = TimelineWriter(path)
    for second in range(seconds):
        pose = (second / 10, 0.0, 0.0)
        writer.add(
            MissionState().having(
                now=float(second),
                battery=100.0 - second // 10,
                pose=pose,
                trail=np.array([(x / 10, 0.0) for x in range(second + 1)]),
                decision=DECISION,
                decision_number=1 + second // 50,
            ),
            1000.0 + second,
        )
    writer.close()


def test_any_time_shows_what_was_known_then(tmp_path: Path) -> None:
    record(tmp_path / 'timeline.jsonl')
    line = Timeline(tmp_path / 'timeline.jsonl')
    for time in (1000.0, 1059.9, 1060.0, 1150.5, 1199.0, 9999.0, 0.0):
        _, now, parts = line.at(time)
        second = int(min(max(time, 1000.0), 1199.0) - 1000)
        assert now == second
        assert parts['pose'] == [second / 10, 0.0, 0.0]
        assert parts['brief'] == f'battery {100 - second // 10} %'
        assert parts['trail'][-1] == [second / 10, 0.0]
        assert len(parts['trail']) == second + 1


def test_the_next_decision_is_found(tmp_path: Path) -> None:
    record(tmp_path / 'timeline.jsonl')
    line = Timeline(tmp_path / 'timeline.jsonl')
    assert line.next_mark('decision', 1000.0) == 1050.0
    assert line.next_mark('decision', 1050.0) == 1100.0
    assert line.next_mark('decision', 1150.0) is None
    assert line.next_mark('failure', 0.0) is None


def test_a_torn_last_line_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / 'timeline.jsonl'
    record(path, 5)
    path.write_bytes(path.read_bytes()[:-4])
    assert Timeline(path).times[-1] == 1003.0
    record(path, 1)  # a recorder that was started again
    line = Timeline(path)
    assert len(line.times) == 5
    assert line.line(4)[0] == 0.0


def test_a_full_disk_tears_no_line_that_others_follow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / 'timeline.jsonl'
    writer = TimelineWriter(path)
    writer.add(MissionState(now=0.0), 1000.0)
    write = os.write
    with monkeypatch.context() as full:
        full.setattr(os, 'write', lambda file, data: write(file, data[:20]))
        with pytest.raises(OSError, match=r'No space left.*timeline\.jsonl'):
            writer.add(MissionState().having(now=1.0, pose=(1.0, 0.0, 0.0)), 1001.0)
    writer.add(MissionState().having(now=2.0, pose=(1.0, 0.0, 0.0)), 1002.0)
    writer.close()
    line = Timeline(path)
    assert line.times == [1000.0, 1002.0]
    assert line.at(1002.0)[2]['pose'] == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    'body', [b'"now":!', b'"now":' + b'[' * 200_000, b'"p":{}}', b'"now":1,"p":3}']
)
def test_a_damaged_line_is_left_out_and_said_once(body: bytes, tmp_path: Path) -> None:
    path = tmp_path / 'timeline.jsonl'
    record(path, 4)
    lines = path.read_bytes().splitlines(keepends=True)
    head = lines[2].partition(b'"now"')[0]
    path.write_bytes(b''.join([*lines[:2], head + body + b'\n', lines[3]]))
    said: list[str] = []
    line = Timeline(path, said.append)
    assert line.line(2) == (None, {})
    assert line.at(1002.5)[:2] == (2, 1.0)
    _, now, parts = line.at(1003.0)
    assert (now, parts['pose']) == (3.0, [0.3, 0.0, 0.0])
    assert len(said) == 1
    assert f'{path}: a damaged line is left out' in said[0]
    line.close()


@pytest.mark.parametrize('content', [None, '', 'no time line\n'])
def test_what_is_no_time_line_is_said_in_one_line(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / 'timeline.jsonl'
    if content is not None:
        path.write_text(content)
    with pytest.raises(FileError, match=r'timeline\.jsonl: '):
        Timeline(path)
