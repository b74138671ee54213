"""What a run did, in one HTML file."""

from __future__ import annotations

import errno
import os
import re
import resource
from pathlib import Path

import pytest

from floor_plans import read_place
from strict_files.files import FileError
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_operator import report
from surveillance_operator.map_command import run_of
from surveillance_operator.report import draw_picture, write_report
from surveillance_runtime.event_log import read


def test_the_report_is_one_file_that_tells_everything(run: Path) -> None:
    page = write_report(run).read_text()
    text, inside = re.subn(r'src="data:image/png;base64,[\w+/=]+"', '', page)
    assert inside == 1  # the way driven
    escaped = '&lt;b&gt;C1&lt;/b&gt; waits longest'
    for words in (escaped, 'no way', 'Recharges (1)', '· 1 recharge (', 'class="map"', 'below'):
        assert words in text
    assert '<b>C1' not in text  # what nodes wrote stays text
    assert 'src=' not in text
    assert 'http' not in text.replace('http://www.w3.org', '')
    picture = draw_picture(run)
    assert picture is not None
    assert picture.stat().st_size > 10_000


def test_a_report_that_a_full_disk_does_not_take_leaves_the_old_one(run: Path) -> None:
    before = write_report(run).read_text()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(FileError, match='File too large'):
            write_report(run)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert (run / 'report.html').read_text() == before


def test_what_failed_again_and_again_is_one_row_of_the_report(run: Path) -> None:
    with MissionRecord(run / 'events.jsonl') as mission:
        for second in range(100, 200):
            mission.write('failure', float(second), what='MOVE', reason='shut')
    text = write_report(run).read_text()
    assert text.count('shut') == 1
    assert 'shut (100 times until 0:03:19)' in text
    assert 'Failures (101)' in text


def test_the_report_of_a_long_mission_counts_all_and_says_what_it_lists(run: Path) -> None:
    with MissionRecord(run / 'events.jsonl', segment_bytes=4000) as mission:
        for second in range(3600, 8000, 20):
            mission.write('visit', float(second), place='C2', distance=5.0)
            mission.write('recharge', float(second) + 10.0, place='E', seconds=5.0)
        mission.write('failure', 8000.0, what='MOVE', reason='shut')
    assert list(run.glob('events.jsonl.*.gz'))
    text = write_report(run).read_text()
    assert 'Recharges (221)' in text
    assert 'Visits (221)' in text
    assert 'Failures (2)' in text
    since = re.search(r'lists begin at (\d:\d\d:\d\d)', text)
    assert since is not None
    assert '1:00:00' < since[1] < '2:13:20'
    assert '<td>2:13:20</td><td>MOVE</td><td>shut</td>' in text  # by the mission's own time
    plan = read_place(run / 'place.yaml').plan
    assert plan is not None
    assert 'the ways of the last 0.' in run_of(read(run / 'events.jsonl'), plan.place, '').summary


def test_a_recording_that_cannot_be_repaired_keeps_no_report_back(
    run: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def read_only(folder: Path) -> list[str]:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(folder / 'recording_0.mcap'))

    monkeypatch.setattr(report.bag, 'repair', read_only)
    assert report.main([str(run)]) == 0
    first, *written = capsys.readouterr().out.splitlines()
    assert first == f'report: {run}/recording: cannot be repaired: Read-only file system'
    assert written == [str(run / 'report.html'), str(run / 'report.png')]


def test_a_run_without_a_visit_has_no_report(run: Path) -> None:
    (run / 'events.jsonl').write_text('')
    with pytest.raises(FileError, match='no visit was recorded'):
        write_report(run)


def test_a_place_that_was_removed_waits_no_longer(run: Path) -> None:
    with MissionRecord(run / 'events.jsonl') as mission:
        mission.write('visit', 100.0, place='R1', distance=5.0)
        left = ['R1', 'R2', 'R3', 'R4', 'E', 'C2']
        mission.write('map', 200.0, places=left)
        mission.write('map', 300.0, places=[name for name in left if name != 'R1'])
        mission.write('map', 400.0, places=left)
        mission.write('end', 2000.0)
    text = write_report(run).read_text()
    assert '<td>C1 (removed)</td>' in text
    assert '<td>R1</td>' in text, 'it came back'
    assert '1 of 6 places visited' in text
    (row,) = re.findall(r'<tr><td>C1 \(removed\)</td>.*?</tr>', text)
    ends = [float(x) for x in re.findall(r'(\d+\.\d),30(?:\.0)?', row)]
    assert max(ends) == pytest.approx(600 * 200 / 2000, abs=0.2), 'the strip ends with it'
