"""Hours and calendars against looking at every minute."""

from __future__ import annotations

import itertools
from datetime import UTC, datetime, timedelta
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from patrol_policy.hours import DAYS, MAY, MUST, NOT, Calendar, WeeklyHours

try:
    ROME = ZoneInfo('Europe/Rome')
except ZoneInfoNotFoundError:
    pytest.skip('this machine has no time zones', allow_module_level=True)
MONDAY = datetime(2024, 5, 6, tzinfo=UTC).timestamp()
TIMES = ('00:00-24:00', '06:00-08:30', '08:15-18:00', '22:00-06:00', '23:45-00:15', '12:00-12:00')


@st.composite
def written_hours(draw: st.DrawFn) -> str:
    """Draw hours as people write them."""
    parts = []
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(['', 'must ', 'may ', 'not ']))
        days = draw(st.sampled_from(['daily', 'mon', 'mon-fri', 'sat-mon', 'tue,thu', 'sun']))
        times = draw(
            st.sampled_from(['', *(' ' + each for each in TIMES), ' 08:00-09:00, 10:00-11:00'])
        )
        parts.append(f'{kind}{days}{times}')
    return '; '.join(parts)


def plainly(text: str, day: int, minute: int) -> str:
    """Return what holds at a minute of a day, read from the text alone."""
    found, kinds = None, set()
    for part in text.split('; '):
        words = part.split(None, 1)
        kind = words[0] if words[0] in (MUST, MAY, NOT) else MUST
        rest = words[1] if words[0] in (MUST, MAY, NOT) else part
        days_text, _, times_text = rest.partition(' ')
        days = set()
        for each in days_text.split(','):
            if each == 'daily':
                days |= set(range(7))
            else:
                first, _, last = each.partition('-')
                at, end = DAYS.index(first), DAYS.index(last or first)
                days.add(at)
                while at != end:
                    at = (at + 1) % 7
                    days.add(at)
        kinds.add(kind)
        for times in times_text.replace(' ', '').split(','):
            begin, end = 0, 24 * 60
            if times:
                hours = [60 * int(each[:2]) + int(each[3:]) for each in times.split('-')]
                begin, end = hours[0], hours[1]
                if end <= begin:
                    end += 24 * 60
            for back in (0, 1):
                if (day - back) % 7 in days and begin <= minute + back * 24 * 60 < end:
                    found = kind
    if found is None:
        found = NOT if MUST in kinds else MUST
    return found


@settings(max_examples=60)
@given(written_hours())
def test_hours_hold_at_each_minute_as_they_are_written(text: str) -> None:
    hours = WeeklyHours.parse(text)
    for day, minute in itertools.product(range(7), range(0, 24 * 60, 15)):
        for shift in (0, 14):
            moment = datetime.fromtimestamp(MONDAY + 86_400 * day + 60 * (minute + shift), UTC)
            assert hours.at(moment) == plainly(text, day, minute + shift), (text, moment)


@settings(max_examples=40)
@given(written_hours(), st.integers(0, 7 * 24 * 4))
def test_a_schedule_has_each_stretch_of_the_time_once(text: str, quarter: int) -> None:
    hours = WeeklyHours.parse(text)
    begin = MONDAY + 900.0 * quarter + 7.5
    end = begin + 2 * 86_400.0
    found = hours.schedule(begin, end, UTC)
    assert found[0][0] == begin
    assert found[-1][1] == end
    for (_, one_end, kind), (other, _, after) in itertools.pairwise(found):
        assert one_end == other
        assert kind != after
        assert (other - MONDAY) % 900.0 == 0.0
    for first, last, kind in found:
        assert first < last or last == end
        for moment in (first, last - 1.0):
            assert hours.at(datetime.fromtimestamp(max(first, moment), UTC)) == kind
    # How long something does not hold.
    for kind in (MUST, MAY, NOT):
        starts = [max(0.0, first - begin) for first, _, each in found if each == kind]
        waited = hours.until(
            datetime.fromtimestamp(begin, UTC), frozenset({kind}), timedelta(days=2)
        )
        assert waited.total_seconds() == pytest.approx(starts[0] if starts else 2 * 86_400.0)


@settings(max_examples=30)
@given(written_hours(), written_hours(), st.integers(0, 7 * 24 * 4), st.integers(0, 5 * 96))
def test_a_calendar_says_what_the_hours_come_to(
    text: str, quiet: str, quarter: int, later: int
) -> None:
    hours, calm = WeeklyHours.parse(text), WeeklyHours.parse(quiet)
    calendar = Calendar({'A': hours, 'B': hours}, calm, frozenset({'B', 'C'}), UTC)
    # What is kept of one moment serves for others, however the clock is set.
    for now in (MONDAY + 900.0 * quarter + 60.0, MONDAY + 900.0 * (quarter + later), MONDAY):
        found = calendar.at(now)
        week = [datetime.fromtimestamp(now + 900.0 * step, UTC) for step in range(96 * 7)]
        kinds = [hours.at(moment) for moment in week]
        offset = (now - MONDAY) % 900.0
        assert found.closed['B'] == found.closed['C'] == 'it is a keep-out place'
        assert found.has_quiet
        assert (kinds[0] == NOT) == ('A' in found.closed)
        assert (kinds[0] == MAY) == (found.optional == {'A'})
        changes = [
            step for step in range(1, len(kinds)) if (kinds[step] == NOT) != (kinds[0] == NOT)
        ]
        if kinds[0] != NOT:
            assert 'A' not in found.opens_in
            left = 900.0 * changes[0] - offset if changes else float('inf')
            assert found.closes_in == ({'A': left} if left < 86_400.0 else {})
        else:
            assert found.closes_in == {}
            assert found.opens_in == ({'A': 900.0 * changes[0] - offset} if changes else {})
            words = f'({text})'
            assert found.closed['A'].endswith(words)
            assert ('until ' in found.closed['A']) == bool(changes)
        calms = [calm.at(moment) for moment in week]
        ends = [step for step in range(97) if calms[step] != MUST]
        assert found.quiet_for == (
            min(900.0 * ends[0] - offset, 86_400.0) if ends and ends[0] else 86_400.0 * (not ends)
        )
        for step in range(0, 96 * 7, 5):
            when = now + 900.0 * step
            inside = any(first <= when < last for first, last in found.windows['A'])
            assert inside == (kinds[step] != NOT and calms[step] != MUST)
        for (_, end), (begin, _) in itertools.pairwise(found.windows['A']):
            assert end < begin


def test_words_of_hours_and_what_is_wrong_with_them() -> None:
    calendar = Calendar({'A': WeeklyHours.parse('Mon 08:00-09:00')}, keep_out=frozenset({'B'}))
    assert calendar.in_words() == {'A': 'Mon 08:00-09:00', 'B': 'never: a keep-out place'}
    for text, problem in (
        ('must', "'must' has no days, expected such as"),
        ('mon 24:00-25:00', '24:00-25:00'),
        ('mon 08:60-09:00', 'expected 00:00 to 24:00'),
        ('mon 08:00-09:60', 'expected 00:00 to 24:00'),
        ('mon 24:00-08:00', 'expected 00:00 to 24:00'),
        ('mon-xyz 08:00-09:00', "'xyz' is no day, expected"),
        (' ; ', 'no hours, expected such as'),
    ):
        with pytest.raises(ValueError, match=problem):
            WeeklyHours.parse(text)
    assert WeeklyHours.parse('mon 23:59-24:00').at(datetime(2024, 5, 6, 23, 59)) == MUST
    assert WeeklyHours.parse('sun 22:00-02:00').at(datetime(2024, 5, 6, 1, 59)) == MUST
    assert WeeklyHours.parse('sun 22:00-02:00').at(datetime(2024, 5, 6, 2, 0)) == NOT
