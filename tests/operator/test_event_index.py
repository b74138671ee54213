"""The index of events: what the logs hold, to be searched, and what is open."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from surveillance_operator.desk.event_index import EventIndex, LogFollower, read_run
from surveillance_runtime.event_log import RECORD, Clocks, EventLog

pytestmark = pytest.mark.unit
NIGHT = 1_772_660_000.0


class Run:
    """A run's log, written at times that the test gives."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.now = folder, NIGHT
        self.log = EventLog(folder / RECORD, Clocks(lambda: self.now, lambda: self.now))

    def incident(self, number: str, phase: str, /, **more: Any) -> None:
        fields = {
            'id': number, 'phase': phase, 'node': 'observer', 'kind': 'event', 'name': '3',
            'severity': 'alarm', 'text': '3: door D6 is open', 'place': 'R3',
            'finding': {
                'number': 3, 'kind': 'door', 'seen': 'open', 'subject': 'D6',
                'position': [1.0, 2.0], 'confidence': 0.97, 'rule': 'front door',
            },
        }  # fmt: skip
        self.log.write('incident', self.now, **{**fields, **more})

    def finding(self, number: int, state: str = 'open', **more: Any) -> None:
        fields = {
            'number': number, 'kind': 'door', 'seen': 'open', 'subject': 'D6', 'place': 'R3',
            'state': state, 'severity': 3, 'began': self.now, 'last': self.now, 'looks': 1,
            'confidence': 0.9, 'position': None, 'rule': 'front door', 'evidence': ['1_2.jpg'],
        }  # fmt: skip
        self.log.write('finding', self.now, **{**fields, **more})

    def say(self, verb: str, number: str, by: str = 'Anna', **more: Any) -> None:
        self.log.write('handling', self.now, id=number, verb=verb, by=by, text=verb, **more)


def states(index: EventIndex, now: float) -> list[str]:
    return [each.state(now, index.mutes) for each in index.open_at(now)]


def test_a_finding_its_incident_and_what_was_said_are_one_event(tmp_path: Path) -> None:
    run, index = Run(tmp_path), EventIndex()
    follower = LogFollower(tmp_path, lambda lines: index.read(lines, 'run', live=True))
    run.finding(3)
    run.incident('abc', 'begin')
    run.incident('abc', 'call', number=1)
    assert follower.look()
    (event,) = index.search(run.now)['events']
    assert (event['text'], event['rule'], event['place']) == ('door D6 is open', 'front door', 'R3')
    assert (event['state'], event['calls'], event['level']) == ('unacknowledged', 1, 'alert')
    run.now += 60
    run.say('acknowledge', 'abc', note='I go there')
    run.finding(3, 'acknowledged')
    follower.look()
    assert states(index, run.now) == ['acknowledged']
    run.now += 60
    run.incident('abc', 'end', seconds=120.0)
    follower.look()
    assert states(index, run.now) == []
    (event,) = index.search(run.now, text='go there')['events']
    assert (event['state'], event['by'], event['ended']) == ('over', 'Anna', run.now)
    assert not follower.look()


def test_what_returned_is_open_until_somebody_acknowledges_it(tmp_path: Path) -> None:
    run, index = Run(tmp_path), EventIndex()
    follower = LogFollower(tmp_path, lambda lines: index.read(lines, 'run', live=True))
    run.incident('abc', 'begin')
    run.incident('abc', 'end')
    follower.look()
    assert states(index, run.now) == ['returned']
    run.say('acknowledge', 'abc')
    follower.look()
    assert states(index, run.now) == []


def test_the_past_is_told_as_it_was(tmp_path: Path) -> None:
    run, index = Run(tmp_path), EventIndex()
    run.incident('abc', 'begin')
    run.now += 100
    run.say('acknowledge', 'abc')
    run.now += 100
    run.incident('abc', 'end')
    read_run(index, tmp_path)
    assert [each.state(NIGHT + 50, later=True) for each in index.were_open_at(NIGHT + 50)] == [
        'unacknowledged'
    ]
    assert [each.state(NIGHT + 150, later=True) for each in index.were_open_at(NIGHT + 150)] == [
        'acknowledged'
    ]
    assert index.were_open_at(NIGHT + 250) == []
    assert index.were_open_at(NIGHT - 1) == []
    assert index.search(run.now, until=NIGHT - 1)['count'] == 0
    assert index.open_at(run.now) == []  # a run that is over has nothing open


def test_a_log_is_followed_while_it_is_packed_away(tmp_path: Path) -> None:
    run, index = Run(tmp_path), EventIndex()
    follower = LogFollower(tmp_path, lambda lines: index.read(lines, 'run', live=True))
    run.finding(1)
    follower.look()
    run.finding(2)
    run.log.begin_segment(run.log.entry('snapshot', run.now, account={}))
    run.finding(3)
    follower.look()
    run.log.begin_segment(run.log.entry('snapshot', run.now, account={}))
    run.finding(4)
    follower.look()
    assert {each['number'] for each in index.search(run.now)['events']} == {1, 2, 3, 4}
    anew = EventIndex()
    read_run(anew, tmp_path)
    assert len(anew) == len(index) == 4


def test_what_is_no_entry_costs_nothing_but_itself(tmp_path: Path) -> None:
    index = EventIndex()
    lines = [
        b'{"event": "incident", "at": "x"}',
        b'{"event": "finding", "at": 1.0, "number": "n"}',
        b'{"event": "handling", "at": 1.0, "id": "a", "verb": "eat", "by": "b", "text": ""}',
        b'{"event": "incident"',
        b'\xff' * 40,
        json.dumps({'event': 'restart', 'at': NIGHT, 'node': 'observer', 'why': 'killed'}).encode(),
    ]
    assert index.read(lines, 'run') == 1
    assert index.search(NIGHT)['events'][0]['text'] == 'observer: killed'
