"""What the observer found is an incident while it goes on, and in the log for ever."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from indoor_watch import Event, EventBook, EventState, Kind, Observation
from indoor_watch.events import OFF_DELAY
from surveillance_perception.finding_teller import PERSON, FindingTeller, findings_of
from surveillance_runtime.event_log import read
from surveillance_runtime.incidents import IncidentBook, Incidents, IncidentUpdate, Severity

pytestmark = pytest.mark.unit


class Told:
    """An observer's book, with what is told of it."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / 'events.jsonl'
        self.updates: list[IncidentUpdate] = []
        self.incidents = Incidents(self.updates.append, 'observer')
        self.teller = FindingTeller(
            self.incidents, str(self.path), lambda _: None, lambda _: None, lambda: 7.0
        )
        self.book = EventBook(told=self.teller.changed)

    def see_door(self, state: str, stamp: float, visit: int = 1) -> Event | None:
        """See the door D1; ajar matters, and two looks say that it is so no more."""
        if state != 'ajar':
            self.see_door_once(state, stamp - OFF_DELAY, visit)
        return self.see_door_once(state, stamp, visit)

    def see_door_once(self, state: str, stamp: float, visit: int) -> Event | None:
        seen = Observation(Kind.DOOR, state, 'C1', 'D1', stamp=stamp, evidence=f'3_{visit}_a.jpg')
        severity = 3 if state == 'ajar' else 0
        found = self.book.take(seen, severity=severity, rule='D1 is shut', visit=visit)
        if found is not None and severity:
            self.teller.alert(found)
        return found

    @property
    def phases(self) -> list[str]:
        return [each.phase.value for each in self.updates]


def test_an_alert_is_an_incident_with_what_was_seen(tmp_path: Path) -> None:
    told = Told(tmp_path)
    told.see_door('ajar', 10.0)
    told.see_door('ajar', 20.0, visit=2)
    (begun,) = told.updates
    assert begun.text == '1: door D1 is ajar in C1 (sure in one look, 1.00; D1 is shut)'
    assert (begun.place, begun.evidence) == ('C1', ('3_1_a.jpg',))
    assert begun.finding is not None
    assert (begun.finding.number, begun.finding.kind, begun.finding.subject) == (1, 'door', 'D1')
    told.see_door('closed', 31.0, visit=3)
    assert told.phases == ['begin', 'end']


def test_who_takes_care_is_noted_and_the_end_comes_when_it_is_over(tmp_path: Path) -> None:
    told = Told(tmp_path)
    told.see_door('ajar', 10.0)
    told.book.answer(1, EventState.ACKNOWLEDGED)
    assert told.phases == ['begin', 'update']
    assert told.updates[-1].acknowledged_by == PERSON
    told.see_door('closed', 30.0, visit=2)
    assert told.phases == ['begin', 'update', 'end']


def test_what_is_unverified_is_a_warning_until_a_second_look(tmp_path: Path) -> None:
    told = Told(tmp_path)
    seen = Observation(Kind.PERSON, 'seen', 'E', '', None, 0.82, 1.0)
    finding = told.book.take(seen, severity=3, rule='nobody in E', visit=1)
    assert finding is not None
    told.teller.warn(finding)
    told.teller.warn(finding)
    (warning,) = told.updates
    assert (warning.severity, 'unverified' in warning.text) == (Severity.WARNING, True)
    assert told.teller.kept(told.book.state())['alerted'] == [], 'nobody was called'
    again = told.book.take(replace(seen, stamp=13.0), severity=3, rule='nobody in E', visit=2)
    assert again is not None
    told.teller.alert(again)
    assert [each.severity for each in told.updates] == [Severity.WARNING, Severity.ALARM]
    assert 'first look 0.82, seen in another visit after 12 s, now 0.97' in told.updates[-1].text
    assert 'unverified' not in told.updates[-1].text


def test_the_all_clear_says_what_it_was_once(tmp_path: Path) -> None:
    """It read `1: door D1 is ajar in C1 (...): 1: door D1 is ajar in C1`."""
    calls: list[str] = []
    told, book = Told(tmp_path), IncidentBook(lambda call: calls.append(call.text), lambda _: None)
    told.see_door('ajar', 10.0)
    told.see_door('closed', 30.0, visit=2)
    for update, when in zip(told.updates, (0.0, 1320.0), strict=True):
        book.hear(update, when)
    book.close(2000.0)
    assert calls[0].startswith('1: door D1 is ajar in C1')
    assert calls[1] == 'all clear after 22 min: C1: door D1 is closed again (was ajar)'


@pytest.mark.parametrize('state', [EventState.NORMAL, EventState.FALSE])
def test_what_a_person_calls_normal_or_false_is_over(tmp_path: Path, state: EventState) -> None:
    told = Told(tmp_path)
    told.see_door('ajar', 10.0)
    told.book.answer(1, state)
    assert told.phases == ['begin', 'end']


def test_the_log_has_each_change_and_further_looks(tmp_path: Path) -> None:
    told = Told(tmp_path)
    found = told.see_door('ajar', 10.0)
    assert found is not None
    told.teller.keep([found])
    told.teller.keep([replace(found, looks=2, sightings=5)])
    told.see_door('closed', 30.0, visit=3)
    entries = read(told.path)
    assert [(e.name, e.text('state'), e.fields['looks']) for e in entries] == [
        ('finding', 'open', 1),
        ('finding', 'open', 2),
        ('finding', 'over', 1),
    ]
    assert findings_of(entries)[1].state == EventState.OVER


def test_after_a_restart_the_book_is_whole_and_what_goes_on_is_told(tmp_path: Path) -> None:
    told = Told(tmp_path)
    told.see_door('ajar', 10.0)
    told.see_door('closed', 30.0, visit=2)
    told.see_door('ajar', 40.0, visit=3)
    kept = told.teller.kept(told.book.state())
    assert [each['number'] for each in kept['events']] == [2], 'what is over is in the log'
    again = Told(tmp_path)
    again.book.restore(again.teller.restored(kept))
    again.teller.take_up(kept, again.book.find)
    assert [each.state for each in again.book.events] == ['open', 'over']
    assert [str(each) for each in again.incidents.open()] == ['event 2']
