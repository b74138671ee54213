"""What people say of alarms: the states of ISA-18.2, shelves, mutes, and what is refused."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import pytest

from surveillance_operator.desk.handling import (
    VERBS,
    AlarmState,
    Handled,
    Handling,
    parsed,
)
from surveillance_operator.notify.incident_keeper import IncidentKeeper
from surveillance_runtime.event_log import RECORD, read
from surveillance_runtime.incidents import (
    FIRST_AGAIN,
    SETTLED,
    Cause,
    IncidentCall,
    IncidentPhase,
    IncidentUpdate,
    SeenThing,
    Severity,
)

pytestmark = pytest.mark.unit
NIGHT = datetime(2026, 3, 4, 23, 0).timestamp()


class Night:
    """A run with an observer, whose time passes by hand."""

    def __init__(self, folder: Path, escalations: tuple[float, ...] = ()) -> None:
        self.folder, self.now, self.escalations = folder, 5000.0, escalations
        self.calls: list[IncidentCall] = []
        self.keeper = self.start()

    def start(self) -> IncidentKeeper:
        return IncidentKeeper(
            self.calls.append,
            self.folder,
            lambda: self.now,
            lambda: self.now,
            lambda: NIGHT - 5000.0 + self.now,
            escalations=self.escalations,
        )

    def tell(self, number: int = 3, phase: IncidentPhase = IncidentPhase.BEGIN) -> None:
        self.keeper.hear(
            IncidentUpdate(
                *(phase, Cause('event', str(number)), Severity.ALARM, f'{number}: door D1 is ajar'),
                id=f'{number:04}ab',
                node='observer',
                place='R1',
                finding=SeenThing(number, 'door', 'ajar', 'D1', None, 1.0, 'front door'),
            )
        )

    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.keeper.advance()

    def state(self, number: int = 3, *, goes_on: bool = True) -> AlarmState:
        desk = self.keeper.desk
        return desk.of(f'{number:04}ab').state(goes_on=goes_on, now=NIGHT - 5000.0 + self.now)


def test_acknowledged_is_not_over(tmp_path: Path) -> None:
    night = Night(tmp_path)
    night.tell()
    assert night.state() is AlarmState.UNACKNOWLEDGED
    said = night.keeper.carry_out('acknowledge 3 by Anna: I go there')
    assert said == 'acknowledge: I go there, by Anna: 3: door D1 is ajar'
    night.wait(10 * FIRST_AGAIN)
    assert len(night.calls) == 1
    assert night.state() is AlarmState.ACKNOWLEDGED
    night.tell(phase=IncidentPhase.END)
    night.wait(SETTLED)
    assert [each.over for each in night.calls] == [False, True]
    assert night.state(goes_on=False) is AlarmState.OVER
    (kept,) = [each for each in read(tmp_path / RECORD) if each.name == 'handling']
    assert (kept.text('by'), kept.text('note'), kept.text('id')) == ('Anna', 'I go there', '0003ab')


def test_what_returned_by_itself_waits_for_somebody(tmp_path: Path) -> None:
    night = Night(tmp_path)
    night.tell()
    night.tell(phase=IncidentPhase.END)
    night.wait(SETTLED)
    assert night.state(goes_on=False) is AlarmState.RETURNED
    night.keeper = night.start()
    night.keeper.carry_out('acknowledge 0003ab by Ben')
    assert night.state(goes_on=False) is AlarmState.OVER


def test_a_shelf_holds_over_a_restart_and_for_the_same_thing_that_comes_again(
    tmp_path: Path,
) -> None:
    night = Night(tmp_path)
    night.tell()
    night.keeper.carry_out('shelve 3 2 h by Anna')
    night.wait(FIRST_AGAIN)
    assert len(night.calls) == 1
    night.keeper = night.start()
    night.tell()
    night.tell(phase=IncidentPhase.END)
    night.wait(SETTLED)
    night.calls.clear()
    night.tell(4)
    assert night.state(4) is AlarmState.SHELVED
    assert night.calls == []
    night.wait(7200.0 - FIRST_AGAIN)
    assert night.state(4) is AlarmState.UNACKNOWLEDGED
    assert [each.over for each in night.calls] == [False]


def test_a_kind_is_muted_in_its_hours(tmp_path: Path) -> None:
    night = Night(tmp_path)
    night.keeper.carry_out('mute door 22:00-23:30 by Anna: the painters')
    night.keeper = night.start()
    night.tell()
    assert night.calls == []
    assert night.keeper.desk.mutes.listed()[0]['note'] == 'the painters'
    night.wait(1801.0)
    assert len(night.calls) == 1
    night.keeper.carry_out('unmute door')
    assert not night.keeper.desk.mutes


def test_what_nobody_acknowledges_is_escalated_once(tmp_path: Path) -> None:
    night = Night(tmp_path, escalations=(60.0, 600.0))
    night.tell()
    night.wait(60.0)
    assert [(each.only, each.reached) for each in night.calls] == [(None, 0.0), (60.0, 60.0)]
    assert night.calls[-1].text == 'not acknowledged for 60 s: 3: door D1 is ajar'
    night.keeper = night.start()
    night.tell()
    night.wait(100.0)
    assert len(night.calls) == 2
    night.keeper.carry_out('acknowledge 3')
    night.wait(600.0)
    assert len(night.calls) == 2
    night.tell(phase=IncidentPhase.END)
    night.wait(SETTLED)
    assert (night.calls[-1].over, night.calls[-1].reached) == (True, 60.0)


@pytest.mark.parametrize(
    ('line', 'expected'),
    [
        ('acknowlege 3', "expected 'acknowledge'"),
        ('acknowledge', "expected the alarm's number"),
        ('acknowledge 9', "there is no alarm '9'"),
        ('acknowledge 3 now', "'now' is too much"),
        ('shelve 3 2 weeks', "expected such as '2 h'"),
        ('shelve 3 25 h', 'expected up to 24 h'),
        ('assign 3', 'expected whom'),
        ('note 3', 'expected a remark'),
        ('mute person 8-18', 'expected'),
    ],
)
def test_a_wrong_line_says_what_was_expected(tmp_path: Path, line: str, expected: str) -> None:
    night = Night(tmp_path)
    night.tell()
    with pytest.raises(ValueError, match=expected):
        night.keeper.carry_out(line)
    assert night.state() is AlarmState.UNACKNOWLEDGED


def test_each_verb_comes_back_from_the_log_as_it_was_said() -> None:
    more = {'shelve': ' 30 min', 'assign': ' to Ben', 'mute': ' daily 08:00-18:00'}
    for verb in VERBS:
        done = parsed(f'{verb} 4f2a{more.get(verb, "")} by Anna: a note', NIGHT)
        assert Handled.from_fields(done.to_fields(), NIGHT) == done
        assert (done.by, done.note) == ('Anna', 'a note')


def test_who_answers_normal_or_false_has_acknowledged_it() -> None:
    done = Handling().after(parsed('false 3 by Anna', NIGHT))
    assert (done.acknowledged_by, done.answer) == ('Anna', 'false')
    assert done.state(goes_on=False, now=NIGHT) is AlarmState.OVER
