"""What is usual at an hour: a door of office hours and a state without habits, over a month."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta

import numpy as np

from indoor_watch import Kind, Observation, rule_from
from indoor_watch.habits import Habits, PeriodicState

MONDAY = datetime(2026, 3, 2, tzinfo=UTC)


def is_open(moment: datetime) -> bool:
    return moment.weekday() < 5 and 8 <= moment.hour < 18


def door(moment: datetime, state: str) -> Observation:
    return Observation(Kind.DOOR, state, 'R1', 'D1', stamp=moment.timestamp())


def month_of_visits(habits: Habits) -> None:
    random = np.random.default_rng(5)
    for number in range(800):
        moment = MONDAY + timedelta(hours=float(random.uniform(0, 28 * 24)))
        habits.learn(door(moment, 'open' if is_open(moment) else 'closed'), number)


def likely(habits: Habits, seen: Observation) -> float:
    found = habits.usual(seen)
    assert found is not None
    return found


def likely_or(habits: Habits, seen: Observation, unknown: float = 1.0) -> float:
    found = habits.usual(seen)
    return unknown if found is None else found


def test_a_door_of_office_hours_is_unusual_when_it_is_open_at_night():
    habits = Habits()
    month_of_visits(habits)
    week = MONDAY + timedelta(weeks=5)
    night, noon = week + timedelta(hours=26), week + timedelta(hours=36)
    assert likely(habits, door(night, 'open')) < 0.1
    assert likely(habits, door(night, 'closed')) > 0.9
    assert likely(habits, door(noon, 'open')) > 0.7
    sunday_noon = week + timedelta(days=6, hours=12)
    assert likely(habits, door(sunday_noon, 'open')) < 0.35
    hours = [week + timedelta(hours=each + 0.5) for each in range(168)]
    wrong = [
        each
        for each in hours
        if likely(habits, door(each, 'open' if is_open(each) else 'closed')) < 0.1
    ]
    assert len(wrong) <= 2, 'what is as always is not unusual'


def test_a_rule_is_broken_by_what_is_unusual_alone():
    habits = Habits()
    rule = rule_from({'door': 'D1', 'is': 'usual', 'severity': 'notice'})
    night = MONDAY + timedelta(weeks=5, hours=26)
    seen = door(night, 'open')
    assert not rule.broken_by(seen, night), 'nothing was learned yet'
    month_of_visits(habits)
    known = Observation(Kind.DOOR, 'open', 'R1', 'D1', stamp=seen.stamp, usual=habits.usual(seen))
    assert rule.broken_by(known, night)
    assert rule.words() == 'always door D1 as is unusual for the hour is a NOTICE'


def test_what_has_no_habit_is_never_unusual():
    random, state = np.random.default_rng(2), PeriodicState()
    for _ in range(400):
        state.learn(bool(random.random() < 0.5), float(random.uniform(0, 28 * 86400)))
    found = [state.probability(3600.0 * hour) for hour in range(168)]
    assert 0.2 < min(found) <= max(found) < 0.8


def test_what_changes_at_another_minute_each_day_is_not_unusual_there():
    """A door is looked at four times a day, and each eighth day it is opened a little later."""
    habits, called, number = Habits(), [], 0
    for day in range(40):
        for hour in (2, 8, 14, 20):
            state = 'open' if hour == 14 or (hour == 8 and day % 8 != 6) else 'closed'
            for minute in (0, 5, 10):
                number += 1
                seen = door(MONDAY + timedelta(days=day, hours=hour, minutes=minute), state)
                usual = habits.usual(seen)
                habits.learn(seen, number)
                if usual is not None and usual < 0.1:
                    called.append((day, hour))
    assert called == []
    night = door(MONDAY + timedelta(days=40, hours=2), 'open')
    assert likely(habits, night) < 0.1


def test_a_state_is_unusual_after_thirteen_days_however_often_a_day_it_is_looked_at():
    for minutes in (60, 5):
        habits, number = Habits(), 0
        for day in range(13):
            assert likely_or(habits, door(MONDAY + timedelta(days=day, hours=2), 'open')) >= 0.1
            for minute in range(0, 24 * 60, minutes):
                number += 1
                moment = MONDAY + timedelta(days=day, minutes=minute)
                habits.learn(door(moment, 'closed'), number)
        assert likely(habits, door(MONDAY + timedelta(days=13, hours=2), 'open')) < 0.1


def test_what_is_so_on_one_weekday_alone_is_usual_on_that_day():
    habits = Habits()
    for day in range(14 * 7):
        moment = MONDAY + timedelta(days=day, hours=12)
        habits.learn(door(moment, 'closed' if moment.weekday() == 6 else 'open'), day)
    sunday, monday = (MONDAY + timedelta(days=each, hours=12) for each in (14 * 7 - 1, 14 * 7))
    assert likely(habits, door(sunday, 'closed')) > 0.5
    assert likely(habits, door(sunday, 'open')) < 0.1 > likely(habits, door(monday, 'closed'))


def test_what_was_learned_outlives_a_restart():
    habits, again = Habits(), Habits()
    assert habits.usual(door(MONDAY, 'open')) is None
    month_of_visits(habits)
    again.restore(json.loads(json.dumps(habits.state())))
    moment = MONDAY + timedelta(weeks=5, hours=26)
    assert again.usual(door(moment, 'open')) == habits.usual(door(moment, 'open'))


def test_what_an_earlier_version_learned_is_read_and_its_days_begin_anew():
    model = PeriodicState()
    for day in range(5):
        model.learn(day != 3, 86_400.0 * day + 3600.0)
    numbers = model.to_json()
    waves_end = len(numbers) - len(model.days.to_json())
    earlier = [numbers[0], 3600.0, 86_400.0 * 4 + 3600.0, *numbers[1:waves_end]]
    found = PeriodicState.from_json(earlier)
    assert (found.count, found.total, found.values) == (5, 4.0, model.values)
    assert found.at_most(False, 3600.0) > 0.9, 'no day is known near that hour'
