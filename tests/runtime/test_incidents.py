"""Incidents: told once, repeated at growing distance, ended with an all-clear."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from surveillance_runtime.incidents import (
    FIRST_AGAIN,
    MOST_OPEN,
    SETTLED,
    TOLD_AGAIN,
    Cause,
    Incident,
    IncidentBook,
    IncidentPhase,
    Incidents,
    IncidentUpdate,
    SeenThing,
    Severity,
)

pytestmark = pytest.mark.unit

D1 = Cause('door', 'D1')


def alarm(
    cause: Cause = D1,
    text: str = 'D1 is closed',
    *,
    over: bool = False,
    node: str = 'robot_behavior',
    severity: Severity = Severity.ALARM,
    **more: Any,
) -> IncidentUpdate:
    phase = IncidentPhase.END if over else IncidentPhase.BEGIN
    return IncidentUpdate(phase, cause, severity, text, node=node, **more)


def book() -> tuple[IncidentBook, list[str], list[Incident]]:
    calls: list[str] = []
    notes: list[Incident] = []
    return IncidentBook(lambda call: calls.append(call.text), notes.append), calls, notes


def test_an_hour_long_incident_calls_five_times_and_once_that_all_is_well() -> None:
    incidents, calls, notes = book()
    for minute in range(61):
        now = 60.0 * minute
        # The robot says it again with each try.
        incidents.hear(alarm(), now)
        incidents.advance(now + 30.0)
    incidents.hear(alarm(over=True), 3660.0)
    incidents.advance(3660.0 + SETTLED)
    assert len(calls) == 6
    assert calls[0] == 'D1 is closed'
    assert calls[1] == 'D1 is closed (for 4 min now)'
    assert calls[-1] == 'all clear after 61 min: D1 is closed'
    assert [each.ended is None for each in notes] == [True, False]


def test_an_incident_that_comes_and_goes_is_one() -> None:
    incidents, calls, notes = book()
    for step in range(50):
        incidents.hear(alarm(over=bool(step % 2)), step * 1.0)
    assert calls == ['D1 is closed']
    assert len(notes) == 1


def test_nobody_is_called_for_a_warning_nor_told_that_it_is_over() -> None:
    incidents, calls, notes = book()
    incidents.hear(alarm(text='odd', severity=Severity.WARNING), 0.0)
    incidents.hear(alarm(text='odd', severity=Severity.WARNING, over=True), 1.0)
    incidents.advance(100.0)
    assert not calls
    assert len(notes) == 2


def test_who_waits_for_a_cause_that_is_told_is_no_second_call() -> None:
    incidents, calls, _ = book()
    scan = Cause('topic', 'scan')
    incidents.hear(alarm(scan, 'nothing is published on scan', node='m'), 0.0)
    incidents.hear(alarm(Cause('robot', 'help'), 'waits for help'), 2.0)
    assert calls == ['nothing is published on scan']
    incidents.hear(alarm(scan, '', over=True, node='m'), 10.0)
    incidents.advance(10.0 + SETTLED)
    assert calls[1].startswith('all clear')
    # It may end as well within moments; when it does not, somebody is called.
    incidents.advance(10.0 + SETTLED + TOLD_AGAIN)
    assert calls[2:] == ['waits for help']


def test_what_a_node_told_ends_after_its_restart_unless_it_tells_it_again() -> None:
    incidents, calls, _ = book()
    incidents.hear(alarm(node='a'), 0.0)
    incidents.restarted('a', 10.0)
    incidents.advance(200.0)
    assert calls[-1].endswith('a was started again')


def test_an_owner_tells_of_a_beginning_each_change_and_the_end_once() -> None:
    told: list[IncidentUpdate] = []
    incidents = Incidents(told.append, 'battery_controller', 'anna', lambda: 7.0)
    cause = ('topic', 'battery_level')
    incidents.begin(cause, 'two publishers', Severity.ALARM, place='E')
    incidents.begin(cause, 'two publishers', Severity.ALARM, place='E')
    incidents.begin(cause, 'three publishers', Severity.ALARM)
    incidents.end(cause, 'one is left')
    incidents.end(cause)
    assert [each.words() for each in told] == [
        'incident [topic battery_level, alarm]: two publishers',
        'incident [topic battery_level, alarm]: three publishers',
        'incident [topic battery_level, over]: one is left',
    ]
    assert [each.phase for each in told] == [
        IncidentPhase.BEGIN,
        IncidentPhase.UPDATE,
        IncidentPhase.END,
    ]
    assert len({each.id for each in told}) == 1
    assert {(each.owner, each.since, each.place) for each in told} == {
        ('anna/battery_controller', 7.0, 'E')
    }


def test_a_line_for_the_alarm_carries_all() -> None:
    seen = SeenThing(3, 'door', 'ajar', 'D1', (1.0, 2.0), 0.9, 'D1 is shut at night')
    told = IncidentUpdate(
        *(
            IncidentPhase.BEGIN,
            D1,
            Severity.ALARM,
            'D1 is ajar',
            'a1',
            5.0,
            'anna',
            'observer',
            'C1',
        ),
        action='shut it',
        evidence=('3_1_a.jpg',),
        finding=seen,
    )
    assert IncidentUpdate.from_line(told.to_line()) == told


@pytest.mark.parametrize('line', ['', '[]', '{}', '{"cause": 3}', 'incident [door D1]: x'])
def test_other_lines_are_no_incidents(line: str) -> None:
    with pytest.raises(ValueError, match='xpect'):
        IncidentUpdate.from_line(line)


def test_who_takes_care_is_not_called_again_and_told_when_it_is_over() -> None:
    incidents, calls, _ = book()
    incidents.hear(alarm(), 0.0)
    incidents.hear(alarm(acknowledged_by='a person'), 10.0)
    incidents.advance(10.0 + 2 * FIRST_AGAIN)
    assert calls == ['D1 is closed']
    incidents.hear(alarm(over=True), 1000.0)
    incidents.advance(1000.0 + SETTLED)
    assert calls[1:] == ['all clear after 17 min: D1 is closed']


def test_what_is_over_is_told_at_the_end_of_the_run() -> None:
    incidents, calls, notes = book()
    incidents.hear(alarm(), 0.0)
    incidents.hear(alarm(over=True), 30.0)
    incidents.close(32.0)
    assert calls == ['D1 is closed', 'all clear after 30 s: D1 is closed']
    assert notes[-1].ended == 30.0


def test_an_incident_of_before_a_restart_is_not_called_twice_and_ends() -> None:
    incidents, calls, notes = book()
    incidents.restore(alarm(), 0.0, calls=1, called=0.0, now=100.0)
    incidents.hear(alarm(), 101.0)
    incidents.advance(FIRST_AGAIN - 1.0)
    assert not calls
    assert not notes
    incidents.advance(FIRST_AGAIN)
    assert calls == ['D1 is closed (for 4 min now)']
    other, calls, _ = book()
    other.restore(alarm(), 0.0, calls=1, called=0.0, now=100.0)
    other.advance(100.0 + TOLD_AGAIN)
    assert len(calls) == 1
    assert calls[0].startswith('all clear')


def test_causes_without_end_are_bounded() -> None:
    incidents, _, _ = book()
    for number in range(MOST_OPEN + 10):
        told = alarm(Cause('robot', str(number)), severity=Severity.WARNING)
        incidents.hear(told, 0.0)
    assert len(incidents.open()) == MOST_OPEN


def test_an_end_is_told_after_the_change_that_came_before_it() -> None:
    told: list[IncidentPhase] = []
    ending: list[threading.Thread] = []

    def tell(update: IncidentUpdate) -> None:
        if update.phase is IncidentPhase.UPDATE:
            ending.append(threading.Thread(target=incidents.end, args=(D1,)))
            ending[0].start()
            ending[0].join(0.1)  # where it does not wait, it has ended by then
            incidents.updates()
        told.append(update.phase)

    incidents = Incidents(tell)
    incidents.begin(D1, 'D1 is closed')
    incidents.begin(D1, 'D1 is locked')
    ending[0].join()
    assert told == [IncidentPhase.BEGIN, IncidentPhase.UPDATE, IncidentPhase.END]


def seen_door(name: str = 'D3', **more: Any) -> IncidentUpdate:
    seen = SeenThing(1, 'door', 'closed', name)
    text = f'1: door {name} is closed in R3'
    return alarm(Cause('event', '1'), text, node='observer', finding=seen, **more)


def test_a_shut_door_with_its_consequences_is_one_incident() -> None:
    """The observer sees it, the mission waits at it, and the robot gets no further."""
    incidents, calls, _ = book()
    waits = alarm(Cause('door', 'D3'), 'the robot waits for help in R3: D3 is closed')
    stuck = alarm(Cause('robot', 'purpose'), 'nothing has happened for 60 s')
    incidents.hear(seen_door(), 0.0)
    incidents.hear(waits, 5.0)
    incidents.hear(stuck, 9.0)
    incidents.advance(FIRST_AGAIN)
    assert calls[0] == '1: door D3 is closed in R3'
    assert calls[1:] == [
        '1: door D3 is closed in R3 (for 4 min now); so: the robot waits for help in R3: '
        'D3 is closed; nothing has happened for 60 s'
    ]
    incidents.hear(seen_door(over=True), 300.0)
    incidents.advance(300.0 + SETTLED)

    assert len(calls) == 3, 'the all-clear, and no call for what ends with it'
    assert calls[-1].startswith('all clear after 5 min')
    for cause, text in ((Cause('door', 'D3'), 'it goes on'), (Cause('robot', 'purpose'), 'moves')):
        incidents.hear(alarm(cause, text, over=True), 310.0)
    incidents.advance(310.0 + 2 * TOLD_AGAIN)
    assert len(calls) == 3


def test_another_door_or_another_robot_is_an_incident_of_its_own() -> None:
    incidents, calls, _ = book()
    incidents.hear(seen_door(), 0.0)
    incidents.hear(alarm(Cause('door', 'D4'), 'D4 is closed'), 1.0)
    incidents.hear(alarm(Cause('door', 'D3'), 'D3 is closed', robot='robot_2'), 2.0)
    assert calls == ['1: door D3 is closed in R3', 'D4 is closed', 'D3 is closed']


def test_a_consequence_that_outlives_its_cause_is_called_for() -> None:
    incidents, calls, _ = book()
    incidents.hear(seen_door(), 0.0)
    incidents.hear(alarm(Cause('door', 'D3'), 'the robot waits for help'), 5.0)
    incidents.hear(seen_door(over=True), 100.0)
    incidents.advance(100.0 + SETTLED)
    incidents.advance(100.0 + SETTLED + TOLD_AGAIN)
    assert calls[-1] == 'the robot waits for help'


WAITS = Cause('door', 'D3'), 'the robot waits for help'
STUCK = Cause('robot', 'purpose'), 'nothing has happened for 60 s'


def test_while_an_acknowledged_alarm_stands_another_of_the_same_thing_is_the_same() -> None:
    incidents, calls, _ = book()
    incidents.hear(seen_door(), 0.0)
    incidents.hear(seen_door(acknowledged_by='Anna'), 10.0)
    incidents.hear(alarm(*WAITS), 20.0)
    incidents.advance(10 * FIRST_AGAIN)
    assert calls == ['1: door D3 is closed in R3']


@pytest.mark.parametrize('pause', [0.5, SETTLED + 1.0])
def test_an_acknowledged_alarm_that_returned_and_comes_again_is_new(pause: float) -> None:
    """At once, also when the first one's end is not told yet."""
    incidents, calls, _ = book()
    incidents.hear(seen_door(), 0.0)
    incidents.hear(seen_door(acknowledged_by='Anna'), 10.0)
    incidents.hear(seen_door(over=True), 100.0)
    incidents.advance(100.0 + pause)
    again = SeenThing(2, 'door', 'closed', 'D3')
    told = alarm(Cause('event', '2'), '2: D3 is closed', node='observer', finding=again)
    incidents.hear(told, 100.0 + pause)
    assert calls[-1] == '2: D3 is closed'
    incidents.advance(100.0 + SETTLED)
    assert sum(each.startswith('all clear') for each in calls) == 1


def test_how_a_robot_fares_follows_from_what_is_wrong_with_that_robot() -> None:
    """Who takes care of a stranger, or of another robot's door, is called for a stuck robot."""
    incidents, calls, _ = book()
    person = SeenThing(1, 'person', 'there')
    incidents.hear(alarm(Cause('event', '1'), 'a person', finding=person, robot='r1'), 0.0)
    incidents.hear(alarm(*WAITS, robot='r2'), 0.0)
    for cause, robot in ((Cause('event', '1'), 'r1'), (WAITS[0], 'r2')):
        incidents.hear(alarm(cause, 'seen', robot=robot, acknowledged_by='Anna'), 1.0)
    del calls[:]
    incidents.hear(alarm(*STUCK, robot='r2'), 2.0)
    assert not calls
    incidents.hear(alarm(*STUCK, robot='r1'), 3.0)
    assert calls == [STUCK[1]]


def test_an_alarm_that_nobody_was_called_for_speaks_for_no_other() -> None:
    """The doors are muted for the night, and the robot waits at one."""
    calls: list[str] = []
    muted = IncidentBook(
        lambda call: calls.append(call.text),
        is_quiet=lambda incident: incident.told.cause.kind == 'event',
    )
    muted.hear(seen_door(), 0.0)
    muted.hear(alarm(*STUCK), 1.0)
    muted.hear(alarm(*WAITS), 2.0)
    assert calls == [STUCK[1], f'{WAITS[1]}; so: {STUCK[1]}']


def test_a_false_alarm_two_seconds_before_the_end_is_told() -> None:
    incidents, calls, _ = book()
    incidents.hear(seen_door(), 0.0)
    incidents.hear(seen_door(over=True), 98.0)
    incidents.close(100.0)
    assert calls[-1].startswith('all clear after')
