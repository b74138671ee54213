"""Where watching draws its lines: how near, how sure, how often, how late is one or the other."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch import DEFAULT_RULES, EventBook, EventState, Kind, Level, Observation, rule_from
from indoor_watch.answers import answered
from indoor_watch.day_book import DayBook, Seen
from indoor_watch.habits import HARMONICS, WEEK, Habits, PeriodicState
from indoor_watch.hung_markers import CameraView
from indoor_watch.other_robots import OtherRobots
from indoor_watch.passages import BlockedPassage, Passages
from indoor_watch.person_places import place_of
from indoor_watch.persons import Person
from indoor_watch.watch_rules import severity_of

from .marked_walls import camera_pose

THING = Observation(Kind.OBJECT, 'appeared', 'R1', position=(1.0, 2.0), confidence=0.8, stamp=100.0)
WALKER = Observation(Kind.PERSON, 'seen', 'R1', position=(1.0, 2.0), confidence=0.8, stamp=100.0)
NOON = datetime(2026, 11, 25, 12, 0)  # a Wednesday


def take(book: EventBook, seen: Observation, severity: int = 2, look: int = 1) -> Any:
    return book.take(seen, severity=severity, rule='a rule', visit=look)


# --- events ---


@pytest.mark.parametrize(
    ('first', 'second', 'events'),
    [
        (THING, replace(THING, position=(1.75, 2.0)), 1),
        (THING, replace(THING, position=(1.76, 2.0)), 2),
        (THING, replace(THING, position=(1.2, 2.0), place='R2'), 1),
        (THING, replace(THING, position=None), 1),
        (THING, replace(THING, position=None, place='R2'), 2),
        (WALKER, replace(WALKER, position=(9.0, 2.0)), 1),
        (WALKER, replace(WALKER, place='R2'), 2),
        (THING, WALKER, 2),
        (
            Observation(Kind.VIEW, 'blocked', 'R1', stamp=1.0),
            Observation(Kind.VIEW, 'blocked', 'R2', stamp=2.0),
            1,
        ),
        (
            Observation(Kind.DOOR, 'open', 'R1', 'D1', stamp=1.0),
            Observation(Kind.DOOR, 'open', 'R2', 'D1', stamp=2.0),
            1,
        ),
        (
            Observation(Kind.DOOR, 'open', 'R1', 'D1', stamp=1.0),
            Observation(Kind.DOOR, 'open', 'R1', 'D2', stamp=2.0),
            2,
        ),
    ],
)
def test_what_is_one_thing_is_one_event(
    first: Observation, second: Observation, events: int
) -> None:
    book = EventBook()
    take(book, first)
    take(book, second)
    assert len(book.events) == events


@pytest.mark.parametrize(
    ('first', 'second', 'look', 'confirmed'),
    [
        ({'confidence': 0.95}, None, 1, True),
        ({'confidence': 0.94}, None, 1, False),
        ({}, {}, 1, False),
        ({}, {}, 2, True),
        ({}, {'confidence': 0.95}, 1, True),
        ({'seen_from': (0.0, 0.0)}, {'seen_from': (0.3, 0.4)}, 1, True),
        ({'seen_from': (0.0, 0.0)}, {'seen_from': (0.3, 0.39)}, 1, False),
        ({}, {'seen_from': (5.0, 5.0)}, 1, False),
        ({'seen_from': (5.0, 5.0)}, {}, 1, False),
    ],
)
def test_an_event_is_confirmed_by_a_sure_look_another_look_or_from_elsewhere(
    first: dict[str, Any], second: dict[str, Any] | None, look: int, confirmed: bool
) -> None:
    book = EventBook()
    event = take(book, replace(THING, **first))
    if second is not None:
        event = take(book, replace(THING, **second), look=look)
    assert event.confirmed is confirmed
    if second is not None:
        assert (event.sightings, event.looks) == (2, look)


def test_an_event_keeps_its_worst_and_its_first_and_last() -> None:
    book = EventBook()
    first = replace(
        THING, evidence='a.jpg', sensor='camera', seen_from=(0.0, 0.0), robot='a', stamp=200.0
    )
    take(book, first, severity=2)
    late = replace(THING, stamp=150.0, robot='b', sensor='lidar', compared_with='old.jpg')
    event = take(book, late, severity=1)
    assert (event.severity, event.began, event.last) == (2, 150.0, 200.0)
    assert event.evidence == ('a.jpg',)
    assert event.sensors == ('camera', 'lidar')
    assert event.compared_with == 'old.jpg'
    event = take(book, replace(late, stamp=300.0, evidence='c.jpg', compared_with=''), severity=3)
    assert (event.severity, event.began, event.last) == (3, 150.0, 300.0)
    assert event.evidence == ('a.jpg', 'c.jpg')
    assert (event.robots, event.compared_with) == (('a', 'b'), 'old.jpg')
    assert event.words() == '1: object has appeared in R1 at 1.0, 2.0'
    assert book.find(1) == event
    assert book.find(2) is None


def test_whom_a_camera_saw_may_stand_there_when_nobody_walks() -> None:
    nobody = replace(WALKER, state='nobody walks', stamp=200.0)
    for sensor, state in (('camera', EventState.OPEN), ('lidar', EventState.OVER)):
        book = EventBook()
        take(book, replace(WALKER, sensor=sensor))
        take(book, nobody, severity=0)
        assert book.events[0].state == state
        take(book, replace(nobody, state='nobody', stamp=300.0), severity=0)
        assert book.events[0].state == EventState.OVER
    book = EventBook()
    take(book, WALKER)
    take(book, replace(nobody, stamp=100.0), severity=0)
    assert book.events[0].state == EventState.OPEN, 'of the same moment'


@pytest.mark.parametrize(
    ('seen', 'normal'),
    [
        (replace(THING, position=(1.75, 2.0)), True),
        (replace(THING, position=(1.76, 2.0)), False),
        (replace(THING, state='moved'), False),
        (replace(THING, position=None), True),
        (replace(THING, position=None, place='R2'), False),
    ],
)
def test_what_is_normal_is_so_at_its_place_and_in_its_state(
    seen: Observation, normal: bool
) -> None:
    book = EventBook()
    book.answer(take(book, THING).number, EventState.NORMAL)
    assert (take(book, replace(seen, stamp=200.0)) is None) is normal


def test_of_what_is_over_the_least_severe_and_oldest_goes_first() -> None:
    told: list[int] = []
    book = EventBook(most=3, told=lambda event, _: told.append(event.number))
    for number, severity in enumerate((3, 1, 2, 1, 3)):
        event = take(book, replace(THING, position=(9.0 * number, 0.0), stamp=number), severity)
        assert book.end(event.number, float(number)) is not None
    assert sorted(each.number for each in book.events) == [1, 3, 5]
    assert told == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]
    assert book.end(1, 99.0) is None, 'it was over'
    with pytest.raises(KeyError):
        book.end(2, 99.0)


def test_answers_are_told_word_by_word() -> None:
    book = EventBook()
    with pytest.raises(ValueError, match='there is no event 1, the newest are: none'):
        answered(book, 'normal 1')
    for number in range(22):
        take(book, replace(THING, position=(9.0 * number, 0.0), stamp=number))
    lines = answered(book, 'events').split('; ')
    assert len(lines) == 21
    assert lines[0] == '22: object has appeared in R1 at 189.0, 0.0 (open)'
    assert lines[-1] == 'and 2 more'
    assert answered(book, 'false 3') == (
        'event 3: object has appeared in R1 at 18.0, 0.0 is false alarm'
    )
    with pytest.raises(ValueError, match=r'the newest are: 22, 21, 20, 19, 18$'):
        answered(book, 'normal 99')
    for line in ('false 3 4', 'false ³', 'false -1', 'events 3'):
        with pytest.raises(ValueError, match='expected'):
            answered(book, line)


# --- rules ---


@pytest.mark.parametrize(
    ('entry', 'words'),
    [
        ({'door': 'all', 'is': 'open'}, 'always doors not open is an ALERT'),
        ({'door': 'D1', 'is': 'ajar', 'severity': 'notice'}, 'always door D1 not ajar is a NOTICE'),
        ({'marker': 14}, 'always marker 14 not where it hangs is an ALERT'),
        ({'marker': 'any'}, 'always markers not where it hangs is an ALERT'),
        (
            {'person': 'usual', 'places': 'R1'},
            'always a person, or nobody, as is unusual for the hour in R1 is an ALERT',
        ),
        ({'light': True}, 'always the light not on is an ALERT'),
        ({'light': 'usual'}, 'always the light as is unusual for the hour is an ALERT'),
        ({'view': 'clear'}, 'always a view that changed or is blocked is an ALERT'),
        (
            {'way': 'free', 'persistence': '5 s', 'severity': 'Warning'},
            'always a way that is not free, seen for 5 s is a WARNING',
        ),
        (
            {'object': 'none', 'places': ['R1', 'R2', 'C1'], 'persistence': '1 visit'},
            'always anything that was not there before in R1, R2 or C1 is an ALERT',
        ),
        (
            {'object': 'none', 'hours': '20:00-06:00'},
            'in the hours daily 20:00-06:00 anything that was not there before is an ALERT',
        ),
    ],
)
def test_every_kind_of_rule_is_said_back(entry: dict[str, Any], words: str) -> None:
    assert rule_from(entry).words() == words


def test_a_rule_counts_from_its_confidence_on_and_the_worst_one_counts() -> None:
    rules = [
        rule_from({'object': 'none', 'severity': 'notice', 'confidence': 0.5}),
        rule_from({'object': 'none', 'severity': 'warning', 'confidence': 0.7}),
        rule_from({'object': 'none', 'severity': 'notice', 'confidence': 0}),
    ]
    for confidence, level, rule in ((0.4, 1, 2), (0.5, 1, 0), (0.69, 1, 0), (0.7, 2, 1)):
        seen = replace(THING, confidence=confidence)
        assert severity_of(rules, seen, NOON) == (level, rules[rule])
    assert severity_of([], THING, NOON) == (0, None)
    assert rules[0].looks == 1
    assert [each.level for each in DEFAULT_RULES] == [Level.NOTICE, Level.NOTICE, Level.WARNING]


@pytest.mark.parametrize(('usual', 'broken'), [(None, False), (0.1, False), (0.09, True)])
def test_what_is_unusual_breaks_a_rule_that_wants_the_usual(
    usual: float | None, broken: bool
) -> None:
    rule = rule_from({'light': 'usual'})
    seen = Observation(Kind.LIGHT, 'on', 'R1', usual=usual)
    assert rule.broken_by(seen, NOON) is broken
    person = rule_from({'person': 'usual'})
    nobody = Observation(Kind.PERSON, 'nobody', 'R1', usual=0.01)
    assert person.broken_by(nobody, NOON)


@pytest.mark.parametrize(
    ('text', 'looks', 'seconds'),
    [('1 look', 1, 0.0), ('3looks', 3, 0.0), ('2 visits', 2, 0.0), ('0.5 s', 1, 0.5)],
)
def test_a_rule_waits_for_looks_or_seconds(text: str, looks: int, seconds: float) -> None:
    rule = rule_from({'object': 'none', 'persistence': text})
    assert (rule.looks, rule.seconds) == (looks, seconds)
    assert rule.lasting(looks, seconds)
    assert not rule.lasting(looks - 1, seconds)
    assert not rule.lasting(looks, seconds - 0.1)


@pytest.mark.parametrize(
    'entry',
    [
        {'object': 'none', 'persistence': '1.5 looks'},
        {'object': 'none', 'confidence': 1.01},
        {'object': 'none', 'confidence': -0.01},
        {'object': 'none', 'confidence': True},
        {'object': 'none', 'places': [1]},
        {'object': 'none', 'places': {'R1': 1}},
        {'marker': '1234567890'},
        {'object': 'none', 'door': 'D1'},
        {'door': {'D1': 1}, 'is': 'open'},
        {'light': 'dim'},
    ],
)
def test_what_no_rule_can_mean_is_refused(entry: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match='expected'):
        rule_from(entry)


# --- habits ---


def test_the_model_of_a_week_is_the_mean_and_the_strongest_waves() -> None:
    """Beside the sums written out with numpy, for visits at any time."""
    rng, state = np.random.default_rng(7), PeriodicState()
    stamps = 1.7e9 + rng.uniform(0.0, 4 * WEEK, 300)
    values = np.sin(math.tau * stamps / 86_400.0) + 0.5 * np.sin(math.tau * stamps / WEEK) > 0.2
    for stamp, value in zip(stamps.tolist(), values.tolist(), strict=True):
        state.learn(value, stamp)
    waves = np.exp(-1j * math.tau * np.outer(HARMONICS, stamps) / WEEK)
    amplitudes = (waves * (values - values.mean())).mean(axis=1)
    strongest = [n for n in np.argsort(-np.abs(amplitudes))[:4] if abs(amplitudes[n]) >= 0.05]
    assert len(strongest) > 1
    for stamp in 1.8e9 + np.arange(0.0, WEEK, 7000.0):
        expected = values.mean() + sum(
            2.0 * (amplitudes[n] * np.exp(1j * math.tau * HARMONICS[n] * stamp / WEEK)).real
            for n in strongest
        )
        assert state.probability(stamp) == pytest.approx(min(0.98, max(0.02, expected)), abs=1e-6)
    again = PeriodicState.from_json(state.to_json())
    assert again == state
    numbers = state.to_json()
    waves_end = 2 + 4 * len(HARMONICS)
    more_than_looks = [*numbers[:-3], 1.0, 2.0, 0.0]
    for wrong, words in (
        (numbers[:9], 'a periodic model of 9 numbers'),
        (numbers[:-1], 'the days of a state in 551 numbers'),
        ([*numbers, 0.0], 'the days of a state in 553 numbers'),
        ([*numbers[:-1], 0.5], 'the days of a state in 552 numbers'),
        (more_than_looks, 'seen on more days than it was looked at'),
        ([*numbers[: waves_end - 1], math.nan, *numbers[waves_end:]], 'that are not finite'),
        ([math.inf, *numbers[1:]], 'numbers that are not finite'),
    ):
        with pytest.raises(ValueError, match=words):
            PeriodicState.from_json(wrong)


def test_each_door_room_and_light_has_a_habit_of_its_own() -> None:
    habits = Habits()
    light = Observation(Kind.LIGHT, 'on', 'R1')
    for number in range(60):
        stamp = number * 86_400.0
        habits.learn(replace(light, stamp=stamp), number)
        habits.learn(replace(light, state='off', stamp=stamp), number)  # the same look
        habits.learn(Observation(Kind.PERSON, 'nobody', 'R1', stamp=stamp), number)
        habits.learn(Observation(Kind.PERSON, 'seen', 'R2', stamp=stamp), number)
        habits.learn(replace(THING, stamp=stamp), number)
    assert habits.usual(light) == pytest.approx(0.98, abs=0.02)
    assert habits.usual(replace(light, state='off')) == pytest.approx(0.02, abs=0.01)
    walks = Observation(Kind.PERSON, 'nobody walks', 'R1')
    assert habits.usual(walks) == pytest.approx(0.98, abs=0.02)
    assert habits.usual(Observation(Kind.PERSON, 'nobody', 'R2')) == pytest.approx(0.02, abs=0.01)
    assert habits.usual(replace(light, place='R2')) is None
    assert habits.usual(THING) is None


# --- days, other robots, where persons stand ---


def test_a_day_counts_each_thing_in_each_state() -> None:
    book = DayBook(lambda stamp: datetime.fromtimestamp(stamp, UTC))
    begin = datetime(2026, 3, 1, tzinfo=UTC)
    door = Observation(Kind.DOOR, 'open', 'R1', 'D1')
    for hours in (5, 2, 23.9, 24.0):
        book.take(replace(door, stamp=(begin + timedelta(hours=hours)).timestamp()))
    assert book.days() == ['2026-03-01', '2026-03-02']
    first = begin.timestamp()
    assert book.seen_on('2026-03-01') == [
        Seen('door', 'D1', 'R1', 'open', 3, first + 7200.0, first + 23.9 * 3600.0)
    ]
    assert book.seen_on('2026-02-28') == []
    for day in range(2, 70):
        book.take(replace(door, stamp=(begin + timedelta(days=day)).timestamp()))
    days = book.days()
    assert len(days) == 60
    assert days[-1] == '2026-05-09'
    again = DayBook(lambda stamp: datetime.fromtimestamp(stamp, UTC))
    again.restore(book.state())
    assert again.days() == days
    assert again.seen_on(days[0]) == book.seen_on(days[0])


def test_what_is_too_much_for_a_day_is_counted_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('indoor_watch.day_book.MOST_LINES', 2)
    book = DayBook(lambda stamp: datetime.fromtimestamp(stamp, UTC))
    for subject in ('D1', 'D2', 'D3', 'D4', 'D1'):
        book.take(Observation(Kind.DOOR, 'open', 'R1', subject, stamp=5.0))
    found = book.seen_on('1970-01-01')
    assert [(each.subject, each.place, each.count) for each in found] == [
        ('D1', 'R1', 2),
        ('D2', 'R1', 1),
        ('other', '', 2),
    ]


def test_what_is_met_at_another_robot_is_that_robot_for_three_seconds() -> None:
    others = OtherRobots(0.25)
    others.hear('b', 5.0, 1.0, 100.0)
    others.hear('b', 2.0, 1.0, 101.0)
    ends = np.array([[2.5, 1.0], [2.51, 1.0], [2.0, 0.5], [5.0, 1.0]])
    assert others.apart(ends, 104.0).tolist() == [False, True, False, True]
    assert others.apart(ends, 98.0).tolist() == [False, True, False, True]
    assert others.apart(ends, 104.1).all()
    assert list(others.at(104.0)) == [(2.0, 1.0)]
    assert others.may_be_seen((10.0, 1.0), 104.0)
    assert not others.may_be_seen((10.01, 1.0), 104.0)
    assert not others.may_be_seen((2.0, 1.0), 105.0)


LENS = np.array([[200.0, 0.0, 160.0], [0.0, 200.0, 120.0], [0.0, 0.0, 1.0]])


def view(pitch: float = 0.0) -> CameraView:
    """Return a camera at (1, 1) that looks along x, or downwards by a pitch."""
    return CameraView(camera_pose(1.0, 1.0, 0.0, pitch=pitch), LENS, 0.02, 0.01)


def box_of(distance: float, y: float, foot: float = 0.0, head: float = 1.7) -> tuple[int, ...]:
    """Return the box in the picture of who stands there, 0.5 m wide, to the pixel."""
    left, right = (160.0 - 200.0 * (y + side - 1.0) / distance for side in (0.25, -0.25))
    top, bottom = (120.0 - 200.0 * (height - 1.0) / distance for height in (head, foot))
    return round(left), round(top), round(right - left), round(bottom - top)


def thing(x: float, y: float, count: int = 5) -> np.ndarray:
    return np.column_stack([np.full(count, x), np.linspace(y - 0.1, y + 0.1, count)])


def person_at(met: np.ndarray, box: tuple[int, ...], **more: float) -> tuple[float, float] | None:
    left, top, width, height = box
    return place_of(Person((left, top, width, height), 0.9), view(**more), met)


def test_a_person_stands_where_the_lidar_meets_what_is_as_tall() -> None:
    box = box_of(4.0, 1.5)
    assert person_at(thing(5.0, 1.5), box) == pytest.approx((5.0, 1.5))
    nearer, farther = thing(1.9, 1.11), thing(8.0, 1.9)
    assert person_at(np.vstack([nearer, thing(5.0, 1.5), farther]), box) == pytest.approx(
        (5.0, 1.5)
    ), 'what is nearer would be 0.38 m tall'
    assert person_at(farther, box) is None
    assert person_at(thing(5.0, 0.5), box) is None, 'aside'
    assert person_at(thing(5.0, 1.5, 1), box) is None, 'one end is nothing'
    assert person_at(np.zeros((0, 2)), box) is None
    assert person_at(thing(5.0, 1.5), box, pitch=1.5) is None, 'it looks down'


def test_two_that_stand_apart_are_two_and_the_nearer_counts() -> None:
    box = box_of(4.0, 1.0)
    two = np.vstack([thing(4.6, 1.0), thing(5.2, 1.0)])
    assert person_at(two, box) == pytest.approx((4.6, 1.0))
    legs = np.vstack([thing(5.0, 0.95), thing(5.0, 1.05)])
    assert person_at(legs, box) == pytest.approx((5.0, 1.0))


@pytest.mark.parametrize(
    ('distance', 'foot', 'head', 'found'),
    [
        (4.0, 0.0, 0.45, True),
        (4.0, 0.0, 0.35, False),
        (4.0, 0.0, 2.35, True),
        (4.0, 0.0, 2.45, False),
        (4.0, 1.25, 1.9, True),
        (4.0, 1.35, 2.0, False),
    ],
)
def test_a_person_is_neither_too_small_nor_too_tall_nor_in_the_air(
    distance: float, foot: float, head: float, found: bool
) -> None:
    box = box_of(distance, 1.0, foot, head)
    assert (person_at(thing(1.0 + distance, 1.0), box) is not None) is found


# --- passages ---


def rooms() -> tuple[Grid, dict[str, Any], dict[str, Any]]:
    """Return two rooms of 3 m x 3 m beside each other, with a door of 1 m."""
    cells = np.zeros((60, 120), np.int8)
    cells[[0, -1]] = 100
    cells[:, [0, -1]] = 100
    cells[:, 60] = 100
    cells[20:40, 60] = 0
    doors = {'D': (3.025, 1.0, 3.025, 2.0)}
    return Grid(cells, 0.05), doors, {'A': (0.8, 1.5, 0.0), 'B': (5.2, 1.5, 0.0)}


def stood(*boxes: tuple[float, float, float, float]) -> np.ndarray:
    """Return the cells of boxes: west, south, east, north, metres."""
    things = np.zeros((60, 120), np.bool_)
    for west, south, east, north in boxes:
        things[
            round(south / 0.05) : round(north / 0.05), round(west / 0.05) : round(east / 0.05)
        ] = True
    return things


def test_a_way_is_blocked_by_what_leaves_no_room_for_the_robot() -> None:
    grid, doors, points = rooms()
    free = Passages(grid, 0.2, doors, points)
    assert free.blocked(stood()) == []
    assert free.blocked(stood((1.5, 0.5, 1.7, 2.5))) == [], 'there is a way around'
    (across,) = free.blocked(stood((1.5, 0.05, 1.7, 2.95)))
    assert (across.door, across.place) == ('D', 'A')
    assert across.position == pytest.approx((1.675, 1.475), abs=0.06)
    door = free.blocked(stood((2.9, 1.0, 3.2, 2.0)))
    assert BlockedPassage('D', '', door[0].position) == door[0]
    assert door[0].position == pytest.approx((3.0, 1.475), abs=0.06)
    other = free.blocked(stood((4.5, 0.05, 4.6, 2.95)))
    assert [(each.door, each.place) for each in other] == [('D', 'B')]


def test_what_the_map_does_not_allow_is_no_way_that_could_be_blocked() -> None:
    grid, doors, points = rooms()
    wide = Passages(grid, 0.55, doors, points)
    assert [each.place for each in wide.blocked(stood((2.9, 1.0, 3.2, 2.0)))] == []
