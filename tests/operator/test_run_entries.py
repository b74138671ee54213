"""What reports read of a run: its log, and what runs of earlier versions kept beside it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from launcher.run import Run
from launcher.run_configuration import configuration
from launcher.run_mission import summary
from surveillance_behaviour.mission.mission_log import MissionRecord
from surveillance_operator.recording.runs import robots_of
from surveillance_operator.report import write_report
from surveillance_operator.run_entries import entries_of_run, incidents_of, marks_of
from surveillance_runtime.event_log import MARKS, RECORD, EventLog, read, record_in

OLD = [
    {'event': 'start', 'time': 0.0, 'machine': 'patrol', 'place': 'E', 'places': ['C1', 'E']},
    {'event': 'decision', 'time': 1.0, 'place': 'C1', 'rule': 'URGENT', 'reason': 'it waits'},
    {'event': 'visit', 'time': 9.0, 'place': 'C1', 'distance': 5.0},
]
DOOR = {'node': 'robot_behavior', 'kind': 'door', 'name': 'D1', 'severity': 'alarm', 'text': 'shut'}


@pytest.fixture
def old_run(tmp_path: Path) -> Path:
    """Make the folder of a run as an earlier version left it."""
    (tmp_path / 'mission.jsonl').write_text(''.join(f'{json.dumps(each)}\n' for each in OLD))
    told = [{**DOOR, 'at': 1.7e9, 'seconds': None}, {**DOOR, 'at': 1.7e9 + 60, 'seconds': 55.0}]
    (tmp_path / 'incidents.jsonl').write_text(''.join(f'{json.dumps(each)}\n' for each in told))
    return tmp_path


def test_a_run_of_an_earlier_version_is_reported_and_gone_on_with(old_run: Path) -> None:
    page = write_report(old_run).read_text('utf-8')
    assert '<h2>Failures (0)</h2>' in page
    assert 'Visits (1)' in page
    assert '<td>door D1</td><td>alarm</td><td>55 s</td><td>shut</td>' in page
    with MissionRecord(record_in(old_run)) as record:
        assert record.is_begun
        record.write('visit', 20.0, place='E', distance=5.0)
    assert not (old_run / RECORD).exists(), 'one run has one log'
    assert '2 of 2 places visited, 2 visits' in summary(record_in(old_run))


def test_incidents_of_the_log_are_told_with_what_was_called(tmp_path: Path) -> None:
    with EventLog(tmp_path / RECORD) as log:
        log.write('incident', 1.0, id='a1', phase='begin', **DOOR)
        log.write('incident', 1.0, id='a1', phase='call', **DOOR)
        log.write('incident', 1.0, id='b2', phase='begin', **DOOR | {'name': 'D2'})
        log.write('incident', 31.0, id='a1', phase='end', seconds=30.0, **DOOR)
        log.write('incident', 31.0, id='c3', phase='end', seconds=30.0, **DOOR)
    found = incidents_of(entries_of_run(tmp_path).entries)
    assert [(each.cause, each.lasted, each.calls) for each in found] == [
        ('door D1', 30.0, 1),
        ('door D2', None, 0),
    ]


def test_what_is_passed_over_is_told_in_the_report(tmp_path: Path) -> None:
    later = {'event': 'of a later version', 'time': 2.0}
    lines = [*OLD, later, later]
    (tmp_path / RECORD).write_text(''.join(f'{json.dumps(each)}\n' for each in lines))
    page = write_report(tmp_path).read_text('utf-8')
    assert '2 lines of the record passed over, which this version does not know' in page


def test_what_a_fleet_shares_is_no_robot(tmp_path: Path) -> None:
    (tmp_path / 'place.yaml').touch()
    for folder in (tmp_path, tmp_path / 'anna'):
        folder.mkdir(exist_ok=True)
        with EventLog(folder / RECORD) as log:
            log.write('restart', node='armor_server', why='killed by SIGKILL')
    assert robots_of(tmp_path) == {'anna': tmp_path / 'anna'}
    assert read(tmp_path / RECORD)


def test_a_replay_jumps_to_what_the_log_tells(tmp_path: Path) -> None:
    with EventLog(tmp_path / RECORD) as log:
        log.write('decision', 1.0, place='C1', rule='URGENT', reason='it waits')
        log.write('incident', 2.0, id='a1', phase='begin', **DOOR)
        log.write('incident', 9.0, id='a1', phase='end', seconds=7.0, **DOOR)
        log.write('restart', node='observer', why='exit code 1')
    written = read(tmp_path / RECORD)
    assert marks_of(tmp_path / RECORD) == {
        'decision': [written[0].at],
        'incident': [written[1].at],
    }
    assert marks_of(tmp_path / 'nothing') == {}


def test_the_page_has_a_button_for_each_mark() -> None:
    page = Path(__file__).parents[2] / 'surveillance_operator/surveillance_operator/page/static'
    buttons = re.findall(r'data-jump="(\w+)"', (page / 'index.html').read_text('utf-8'))
    assert sorted(buttons) == sorted(MARKS)


def test_a_resumed_run_of_an_earlier_version_writes_where_it_wrote(old_run: Path) -> None:
    config = Path(__file__).parents[2] / 'config'
    merged = configuration(config, Run(), old_run)
    for node in ('robot_behavior', 'reasoner', 'observer'):
        assert merged.resolve(node, f'/{node}')['record'].value == str(old_run / 'mission.jsonl')
