"""Incidents: told once, repeated at growing distance, ended with an all-clear."""

from __future__ import annotations

import pytest

from surveillance_runtime.incidents import (
    SETTLED,
    Cause,
    Incident,
    IncidentBook,
    Incidents,
    Severity,
    Told,
    read_line,
)

D1 = Cause('door', 'D1')


def alarm(cause: Cause = D1, text: str = 'D1 is closed', *, over: bool = False) -> Told:
    return Told(cause, Severity.ALARM, text, over)


def book() -> tuple[IncidentBook, list[str], list[Incident]]:
    calls: list[str] = []
    notes: list[Incident] = []
    return IncidentBook(lambda call: calls.append(call.text), notes.append), calls, notes


def test_an_hour_long_incident_calls_five_times_and_once_that_all_is_well() -> None:
    incidents, calls, notes = book()
    for minute in range(61):
        now = 60.0 * minute
        # The robot says it again with each try.
        incidents.hear('robot_behavior', alarm(), now)
        incidents.advance(now + 30.0)
    incidents.hear('robot_behavior', alarm(over=True), 3660.0)
    incidents.advance(3660.0 + SETTLED)
    assert len(calls) == 6
    assert calls[0] == 'D1 is closed'
    assert calls[1] == 'D1 is closed (for 4 min now)'
    assert calls[-1] == 'all clear after 61 min: D1 is closed'
    assert [each.ended is None for each in notes] == [True, False]


def test_an_incident_that_comes_and_goes_is_one() -> None:
    incidents, calls, notes = book()
    for step in range(50):
        incidents.hear('planner', alarm(over=bool(step % 2)), step * 1.0)
    assert calls == ['D1 is closed']
    assert len(notes) == 1


def test_nobody_is_called_for_a_warning_nor_told_that_it_is_over() -> None:
    incidents, calls, notes = book()
    incidents.hear('n', Told(D1, Severity.WARNING, 'odd', over=False), 0.0)
    incidents.hear('n', Told(D1, Severity.WARNING, 'odd', over=True), 1.0)
    incidents.advance(100.0)
    assert not calls
    assert len(notes) == 2


def test_who_waits_for_a_cause_that_is_told_is_no_second_call() -> None:
    incidents, calls, _ = book()
    scan = Cause('topic', 'scan')
    incidents.hear('motion_controller', alarm(scan, 'nothing is published on scan'), 0.0)
    incidents.hear('robot_behavior', alarm(Cause('robot', 'help'), 'waits for help'), 2.0)
    assert calls == ['nothing is published on scan']
    incidents.hear('motion_controller', alarm(scan, '', over=True), 10.0)
    incidents.advance(10.0 + SETTLED)
    assert calls[1].startswith('all clear')
    assert calls[2:] == ['waits for help']


def test_what_a_node_told_ends_after_its_restart_unless_it_tells_it_again() -> None:
    incidents, calls, _ = book()
    incidents.hear('a', alarm(), 0.0)
    incidents.restarted('a', 10.0)
    incidents.advance(200.0)
    assert calls[-1].endswith('a was started again')


def test_a_line_of_the_log_carries_all() -> None:
    lines: list[str] = []
    incidents = Incidents(lambda told: lines.append(told.line()))
    incidents.begin(('topic', 'battery_level'), 'two publishers', Severity.ALARM)
    incidents.begin(('topic', 'battery_level'), 'two publishers', Severity.ALARM)
    incidents.end(('topic', 'battery_level'), 'one is left')
    incidents.end(('topic', 'battery_level'))
    assert lines == [
        'incident [topic battery_level, alarm]: two publishers',
        'incident [topic battery_level, over]: one is left',
    ]
    begun, ended = map(read_line, lines)
    assert begun == Told(Cause('topic', 'battery_level'), Severity.ALARM, 'two publishers', False)
    assert ended is not None
    assert ended.over


@pytest.mark.parametrize('line', ['', 'incident', 'x incident [a b, alarm]: y', 'battery low'])
def test_other_lines_are_no_incidents(line: str) -> None:
    assert read_line(line) is None
