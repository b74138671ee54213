"""Weekly hours: what they come to, when a clock is set, and in a simulated month."""

from __future__ import annotations

from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

import pytest

from patrol_policy.decision import QUIET, Rules
from patrol_policy.hours import MAY, MUST, NOT, Calendar, WeeklyHours
from patrol_policy.simulation import Patrol

from .worlds import seven_rooms

ROME = ZoneInfo('Europe/Rome')


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
    patrol = Patrol(seven_rooms(60.0), Rules(), 'tour', 900.0, 'E', calendar=calendar, began=begin)
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
