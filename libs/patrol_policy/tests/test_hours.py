"""Weekly hours: what they come to, when a clock is set, and in a simulated month."""

from __future__ import annotations

from datetime import datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import pytest

from patrol_policy.decision import QUIET
from patrol_policy.hours import MAY, MUST, NOT, Calendar, WeeklyHours
from patrol_policy.idleness_bounds import CLOSED, LATER, WITHIN, idleness_bounds, lines
from patrol_policy.rule_table import Priorities
from patrol_policy.simulation import Patrol

from .worlds import seven_rooms

try:
    ROME = ZoneInfo('Europe/Rome')
except ZoneInfoNotFoundError:
    pytest.skip('this machine has no time zones', allow_module_level=True)


def test_hours_are_read_as_they_are_written() -> None:
    hours = WeeklyHours.parse('mon-fri 08:00-18:00; may sat 10:00-12:00, 14:00-16:00')
    assert hours.at(datetime(2024, 5, 6, 8, 0)) == MUST
    assert hours.at(datetime(2024, 5, 6, 18, 0)) == NOT
    assert hours.at(datetime(2024, 5, 11, 15, 0)) == MAY
    assert hours.at(datetime(2024, 5, 12, 15, 0)) == NOT
    night = WeeklyHours.parse('not sun 22:00-06:00')
    assert night.at(datetime(2024, 5, 13, 5, 59)) == NOT
    assert night.at(datetime(2024, 5, 13, 6, 0)) == MUST


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        ('', 'no hours, expected such as'),
        ('mno 08:00-18:00', "'mno' is no day, expected 'mon'"),
        ('mon 8-18', "'8-18' are no times, expected such as"),
        ('mon 08:00-25:00', 'expected 00:00 to 24:00'),
    ],
)
def test_hours_that_cannot_be_read_say_what_was_expected(text: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        WeeklyHours.parse(text)


def test_hours_follow_the_clock_on_the_wall_when_it_is_set() -> None:
    hours = WeeklyHours.parse('daily 02:00-04:00')
    day = timedelta(days=1)
    # Forward, on 31 March 2024: from 02:00 to 03:00. The stretch begins at 03:00 and lasts 1 h.
    before = datetime.fromtimestamp(datetime(2024, 3, 31, 1, 0, tzinfo=ROME).timestamp(), ROME)
    assert hours.until(before, frozenset({MUST}), day) == timedelta(hours=1)
    inside = datetime.fromtimestamp(before.timestamp() + 3600.0, ROME)
    assert (inside.hour, hours.at(inside)) == (3, MUST)
    assert hours.until(inside, frozenset({NOT}), day) == timedelta(hours=1)
    # Back, on 27 October 2024: from 03:00 to 02:00. It lasts 3 h.
    inside = datetime(2024, 10, 27, 2, 0, tzinfo=ROME)
    assert hours.until(inside, frozenset({NOT}), day) == timedelta(hours=3)


def test_hours_of_a_zone_that_differs_by_half_an_hour_end_when_they_do() -> None:
    zone = ZoneInfo('Asia/Kolkata')
    calendar = Calendar({'R3': WeeklyHours.parse('daily 08:00-18:00')}, zone=zone)
    now = datetime(2024, 5, 6, 17, 50, tzinfo=zone).timestamp()
    assert calendar.at(now).closes_in == {'R3': 600.0}
    assert calendar.at(now + 600.0).opens_in == {'R3': 14 * 3600.0}


def opened(text: str, stop: float, hour: int, days: float) -> Patrol:
    """Return a patrol that begins at an hour, where R3 has hours."""
    calendar = Calendar({'R3': WeeklyHours.parse(text)}, zone=ROME)
    begin = datetime(2024, 5, 6, hour, 0, tzinfo=ROME).timestamp()
    graph = seven_rooms(stop)
    threshold = 0.9 * graph.tour.length
    patrol = Patrol(graph, Priorities(), 'tour', threshold, 'E', calendar=calendar, began=begin)
    for decision in patrol.until(begin + 86_400.0 * days):
        if decision.place == 'R3':
            assert not calendar.at(patrol.now).closed
    return patrol


@pytest.mark.parametrize('hour', [6, 7])
def test_a_place_that_is_open_for_less_than_a_round_is_visited_before_it_closes(hour: int) -> None:
    # A round takes 2,248 s, and it is open for 900.
    patrol = opened('daily 08:00-08:15', 200.0, hour, 0.15)
    visited = datetime.fromtimestamp(patrol.visited_at['R3'], ROME)
    assert (visited.hour, visited.minute) < (8, 15)
    assert (visited.hour, visited.minute) >= (8, 0)


def test_what_opens_later_has_no_bound_before() -> None:
    patrol = opened('daily 08:00-08:15', 200.0, 5, 0.001)
    told = idleness_bounds(patrol.world(), patrol.known_battery(), patrol.settings)
    by_place = {each.place: each for each in told}
    assert by_place['R3'].verdict == CLOSED
    assert by_place['R3'].words == (
        'R3: not visited now, it is closed until Mon 08:00 (daily 08:00-08:15)'
    )
    assert 'R3' not in lines(told)[0]
    patrol.now += 3 * 3600.0
    told = idleness_bounds(patrol.world(), patrol.known_battery(), patrol.settings)
    by_place = {each.place: each for each in told}
    assert by_place['R3'].verdict in (WITHIN, LATER)
    assert ' while it is open' in by_place['R3'].words


def test_a_robot_behind_a_place_that_has_closed_waits_until_it_opens() -> None:
    calendar = Calendar({'C2': WeeklyHours.parse('daily 08:00-18:00')}, zone=ROME)
    begin = datetime(2024, 5, 6, 19, 0, tzinfo=ROME).timestamp()
    graph = seven_rooms(60.0)
    patrol = Patrol(graph, Priorities(), 'tour', 900.0, 'E', calendar=calendar, began=begin)
    patrol.place = 'R4'
    decision = patrol.step()
    assert (decision.rule, decision.place) == (QUIET, 'R4')
    assert 'nor any way to a station: the robot waits in R4' in decision.reason


def test_a_simulated_week_keeps_to_the_calendar() -> None:
    """Checked against the text of the hours alone, over the days on which the clock is set."""
    calendar = Calendar(
        {
            'R3': WeeklyHours.parse('mon-fri 08:00-18:00'),
            'R1': WeeklyHours.parse('may daily 09:00-12:00'),
        },
        quiet=WeeklyHours.parse('daily 22:00-06:00'),
        keep_out=frozenset({'R2'}),
        zone=ROME,
    )
    begin = datetime(2024, 3, 29, 7, 0, tzinfo=ROME).timestamp()
    patrol = Patrol(
        seven_rooms(60.0), Priorities(), 'tour', 900.0, 'E', calendar=calendar, began=begin
    )
    visits = []
    for decision in patrol.until(begin + 4 * 86_400.0):
        if decision.rule != QUIET:
            visits.append((patrol.place, datetime.fromtimestamp(patrol.now, ROME)))
    assert {'R3', 'C1', 'C2', 'R4'} <= {place for place, _ in visits}
    for place, when in visits:
        assert place != 'R2'
        assert 6 <= when.hour < 22 or (when.hour == 22 and when.minute < 10)
        if place == 'R3':
            assert when.weekday() < 5
            assert 8 <= when.hour < 18


@pytest.mark.parametrize(('before', 'after'), [('', '08:00-08:15'), ('08:00-08:15', '08:05-09:00')])
def test_hours_that_are_changed_during_a_patrol_change_the_plan(before: str, after: str) -> None:
    begin = datetime(2024, 5, 6, 7, 50, tzinfo=ROME).timestamp()

    def calendar(times: str) -> Calendar:
        hours = {'R3': WeeklyHours.parse(f'daily {times}')} if times else {}
        return Calendar(hours, zone=ROME)

    def patrol(times: str) -> Patrol:
        return Patrol(
            seven_rooms(200.0),
            Priorities(),
            'tour',
            900.0,
            'E',
            calendar=calendar(times),
            began=begin,
        )

    changed = patrol(before)
    idleness_bounds(changed.world(), changed.known_battery(), changed.settings)
    changed.calendar = calendar(after)
    told = idleness_bounds(changed.world(), changed.known_battery(), changed.settings)
    plan, fresh = changed.world().memory.planner, patrol(after)
    idleness_bounds(fresh.world(), fresh.known_battery(), fresh.settings)
    assert plan.rule_graph.windows == fresh.world().memory.planner.rule_graph.windows
    assert {each.place for each in told if each.verdict == CLOSED} == {'R3'}


def test_what_the_quiet_hours_come_before_is_said_to_end_with_them() -> None:
    begin = datetime(2024, 5, 6, 21, 59, tzinfo=ROME).timestamp()
    calendar = Calendar(
        {'R3': WeeklyHours.parse('daily 00:00-24:00')},
        quiet=WeeklyHours.parse('daily 22:00-06:00'),
        zone=ROME,
    )
    patrol = Patrol(
        seven_rooms(200.0), Priorities(), 'tour', 30.0, 'E', calendar=calendar, began=begin
    )
    told = idleness_bounds(patrol.world(), patrol.known_battery(), patrol.settings)
    words = {each.place: each.words for each in told}
    assert words['R3'] == 'R3: not visited before the quiet hours, which begin in 60 s'
