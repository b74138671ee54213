"""Sightings become events: joined, ended, acknowledged, normal; kept within bounds."""

from __future__ import annotations

import json

import pytest

from indoor_watch import Event, EventBook, EventState, Kind, Observation
from indoor_watch.answers import answered


def seen(kind=Kind.OBJECT, state='appeared', **more) -> Observation:
    given = {
        'place': 'R1',
        'position': (1.0, 2.0),
        'confidence': 0.8,
        'stamp': 100.0,
        'robot': 'Robot1',
        **more,
    }
    return Observation(kind, state, **given)


def take(book: EventBook, observation: Observation, severity: int = 2, look: int = 1):
    return book.take(observation, severity=severity, rule='no boxes here', visit=look)


def test_sightings_of_one_thing_are_one_event():
    told: list[Event] = []
    book = EventBook(told=lambda event, _: told.append(event))
    take(book, seen(evidence='a.jpg'))
    take(book, seen(position=(1.3, 2.2), stamp=101.0, evidence='b.jpg'))
    event = take(book, seen(stamp=160.0, robot='robot2', evidence='c.jpg'), look=2)
    assert event is not None
    assert (event.sightings, event.looks, event.robots) == (3, 2, ('Robot1', 'robot2'))
    assert event.evidence == ('a.jpg', 'c.jpg')
    assert event.confidence == pytest.approx(1 - 0.2**2), 'of one visit the surest counts'
    assert len(book.events) == len(told) == 1
    take(book, seen(position=(4.0, 2.0)))
    assert len(book.events) == 2


def test_what_no_rule_cares_for_begins_nothing_and_ends_what_it_contradicts():
    book = EventBook()
    door = {'kind': Kind.DOOR, 'subject': 'D1', 'position': None}
    take(book, seen(state='open', **door))
    assert take(book, seen(state='ajar', stamp=50.0, **door), severity=0) is None
    assert book.events[0].state == EventState.OPEN, 'what was seen before does not end it'
    take(book, seen(state='closed', stamp=190.0, **door), severity=0)
    assert book.events[0].state == EventState.OPEN, 'one look may be wrong'
    take(book, seen(state='closed', stamp=200.0, **door), severity=0)
    assert [each.state for each in book.events] == [EventState.OVER]
    assert book.events[0].last == 200.0


@pytest.mark.parametrize(
    ('more', 'look', 'is_over'),
    [
        ({'stamp': 209.9}, 1, False),
        ({'stamp': 210.0}, 1, True),
        ({'stamp': 180.0}, 1, True),  # the clock was set back
        ({'stamp': 201.0}, 2, True),
        ({'stamp': 201.0, 'seen_from': (0.6, 0.0)}, 1, True),
        ({'stamp': 201.0, 'seen_from': (0.4, 0.0)}, 1, False),
    ],
)
def test_an_event_of_a_door_is_over_once_two_looks_that_err_apart_say_so(more, look, is_over):
    told: list[Event] = []
    book = EventBook(told=lambda event, _: told.append(event))
    door = {'kind': Kind.DOOR, 'subject': 'D3', 'position': None, 'seen_from': (0.0, 0.0)}
    take(book, seen(state='ajar', **door))
    # A look that is wrong, and the door as before: nobody is told a second time.
    for stamp, state, severity in ((150.0, 'open', 0), (155.0, 'ajar', 2), (200.0, 'open', 0)):
        take(book, seen(state=state, stamp=stamp, **door), severity=severity)
    assert [(each.number, each.state) for each in told] == [(1, EventState.OPEN)]
    take(book, seen(state='open', **{**door, **more}), severity=0, look=look)
    assert (book.find(1).state == EventState.OVER) == is_over


def test_what_a_person_called_false_stays_quiet_when_one_look_shows_it_otherwise():
    book = EventBook()
    door = {'kind': Kind.DOOR, 'subject': 'D3', 'position': None}
    take(book, seen(state='ajar', **door))
    book.answer(1, EventState.FALSE)
    take(book, seen(state='open', stamp=150.0, **door), severity=0)
    take(book, seen(state='ajar', stamp=155.0, **door))
    assert len(book.events) == 1


def test_a_door_that_breaks_its_rule_in_another_way_is_one_event_until_it_is_acknowledged():
    book = EventBook()
    door = {'kind': Kind.DOOR, 'subject': 'D3', 'position': None}
    take(book, seen(state='ajar', **door))
    event = take(book, seen(state='closed', stamp=173.0, **door))
    assert [each.state for each in book.events] == [EventState.OPEN]
    assert (event.number, event.seen, event.began, event.sightings) == (1, 'closed', 100.0, 2)
    book.answer(1, EventState.ACKNOWLEDGED)
    take(book, seen(state='ajar', stamp=400.0, **door))
    assert [book.find(each).state for each in (1, 2)] == [EventState.OVER, EventState.OPEN]
    take(book, seen(state='open', stamp=500.0, **door), severity=0)
    take(book, seen(state='open', stamp=510.0, **door), severity=0)
    assert {each.state for each in book.events} == {EventState.OVER}


def test_a_thing_that_was_moved_there_is_the_one_that_appeared_there():
    book = EventBook()
    take(book, seen())
    take(book, seen(state='moved', position=(1.2, 2.1), stamp=110.0))
    take(book, seen(stamp=120.0))
    (event,) = book.events
    assert (event.seen, event.state, event.sightings) == ('appeared', EventState.OPEN, 3)
    take(book, seen(state='removed', stamp=130.0), severity=0)
    assert event.number == 1
    assert [each.state for each in book.events] == [EventState.OVER]


def test_a_person_calls_it_normal_and_it_stays_so():
    book = EventBook()
    event = take(book, seen())
    book.answer(event.number, EventState.NORMAL)
    assert take(book, seen(stamp=900.0), look=2) is None
    again = EventBook()
    again.restore(json.loads(json.dumps(book.state())))
    assert take(again, seen(stamp=950.0), look=3) is None
    assert again.events == book.events
    with pytest.raises(ValueError, match='by hand'):
        book.answer(event.number, EventState.OVER)
    with pytest.raises(KeyError):
        book.answer(99, EventState.NORMAL)


def test_false_alarms_are_counted():
    book = EventBook()
    for number in range(4):
        event = take(book, seen(position=(3.0 * number, 0.0), stamp=float(number)))
    book.answer(event.number, EventState.FALSE)
    assert book.false_rate(0.0) == 0.25
    assert book.false_rate(3.0) == 1.0


def test_a_month_of_events_is_bounded_and_open_ones_stay():
    book = EventBook(most=50)
    for number in range(500):
        event = take(book, seen(position=(2.0 * number, 0.0), stamp=float(number)), 1 + number % 3)
        if number % 10:
            book.answer(event.number, EventState.ACKNOWLEDGED)
    assert len(book.events) <= 55
    assert sum(each.state == EventState.OPEN for each in book.events) == 50


def test_a_state_or_number_that_is_none_is_refused():
    with pytest.raises(ValueError, match="door 'opn': expected one of open, closed, ajar"):
        Observation(Kind.DOOR, 'opn', 'R1')
    with pytest.raises(ValueError, match='finite'):
        Observation(Kind.DOOR, 'open', 'R1', confidence=float('nan'))
    observation = seen(evidence='a.jpg')
    assert Observation.from_json(json.loads(json.dumps(observation.to_json()))) == observation


def test_a_person_answers_with_one_line():
    book = EventBook()
    take(book, seen())
    assert answered(book, 'events') == '1: object has appeared in R1 at 1.0, 2.0 (open)'
    assert answered(book, 'acknowledge 1').endswith('is acknowledged')
    assert answered(book, 'normal 1').endswith('is normal')
    assert answered(book, 'events') == 'no event is open'
    for line, wrong in (
        ('norml 1', "got 'norml', expected 'normal'"),
        ('', "got '', expected one of"),
        ('normal', "an event's number"),
        ('normal one', "an event's number"),
        ('normal 7', 'there is no event 7, the newest are: 1'),
    ):
        with pytest.raises(ValueError, match=wrong):
            answered(book, line)


def test_what_was_called_false_is_not_told_again_while_it_is_seen():
    book = EventBook()
    event = take(book, seen())
    book.answer(event.number, EventState.FALSE)
    take(book, seen(stamp=200.0), look=2)
    assert [each.state for each in book.events] == [EventState.FALSE]
    book.end(event.number, 300.0)
    take(book, seen(stamp=400.0), look=3)
    assert {each.state for each in book.events} == {EventState.FALSE, EventState.OPEN}


def test_what_goes_on_is_found_among_a_month_of_what_is_over_and_after_a_restart():
    book = EventBook(most=300)
    for number in range(1500):
        event = take(book, seen(position=(0.0, 2.0 * number), stamp=float(number)), 1)
        if number != 7:
            book.end(event.number, float(number))
    assert len(book.events) == 300
    assert [each.number for each in book.current] == [8]
    again = EventBook(most=300)
    again.restore(json.loads(json.dumps(book.state())))
    for each in (book, again):
        assert take(each, seen(position=(0.0, 14.0), stamp=2000.0), 1, 3).number == 8
        new = take(each, seen(position=(0.0, 90.0), stamp=2001.0), 1, 3)
        assert new.number == 1501
        each.answer(new.number, EventState.ACKNOWLEDGED)
        for number in range(3000):
            take(each, seen(position=(0.0, 90.0), stamp=2002.0 + number), 1, 3)
    assert book.current == again.current
