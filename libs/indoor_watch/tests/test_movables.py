"""What moves often is told no more: a chair over days, two chairs, another thing beside them."""

from __future__ import annotations

import math
import random

import pytest

from indoor_watch.answers import answered
from indoor_watch.events import EventBook
from indoor_watch.floor import Change, ObjectChange
from indoor_watch.movables import FEWEST_SPOTS, Movables

DAY = 86_400.0


def thing(x: float, y: float, extent: float = 0.4, change: Change = Change.MOVED) -> ObjectChange:
    return ObjectChange(change, (x, y), extent, 0.9)


def test_a_chair_that_moves_each_day_is_told_three_times_and_learned() -> None:
    seed = random.randrange(10**6)
    rng, movables = random.Random(seed), Movables()
    told = []
    turn = rng.uniform(0.0, math.tau)
    for day in range(20):
        turn += rng.uniform(0.5, math.tau - 0.5)  # so far that it is another spot
        x, y = 3.0 + 0.9 * math.cos(turn), 2.0 + 0.9 * math.sin(turn)
        extent = rng.uniform(0.36, 0.48)
        for second in range(3):
            now = [('R1', thing(x, y, extent))]
            news, learned = movables.take(now, day * DAY + second)
            told.append((day, len(news), len(learned)))
    days = sorted({day for day, news, _ in told if news})
    assert days == [*range(FEWEST_SPOTS - 1)], f'seed {seed}'
    assert sum(learned for _, _, learned in told) == 1, f'seed {seed}'


def moved(movables: Movables, spots: int = FEWEST_SPOTS) -> None:
    for day in range(spots):
        movables.take([('R1', thing(2.0 + 0.6 * day, 2.0))], day * DAY)


def test_what_is_not_the_chair_is_told() -> None:
    movables = Movables()
    moved(movables)
    (chair,) = movables.listed()
    others = {
        'larger': ('R1', thing(3.0, 2.0, extent=1.2)),
        'far': ('R1', thing(3.0, 9.0)),
        'elsewhere': ('R2', thing(3.0, 2.0)),
    }
    for name, each in others.items():
        news, _ = movables.take([each], 9 * DAY)
        assert news, name
    both = [('R1', thing(3.0, 2.0)), ('R1', thing(2.0, 3.0))]
    news, _ = movables.take(both, 9 * DAY)
    assert len(news) == 1, 'a second one of its size at the same time'
    assert chair.number == 1


def test_moved_within_an_hour_is_not_often() -> None:
    movables = Movables()
    for minute in range(20):
        news, learned = movables.take([('R1', thing(1.0 + 0.5 * (minute % 4), 2.0))], 60.0 * minute)
        assert news
        assert not learned


def test_a_person_lists_it_and_undoes_it_over_a_restart() -> None:
    movables = Movables()
    moved(movables)
    after = Movables()
    after.restore(movables.state())
    book = EventBook()
    assert answered(book, 'movable', None, after).startswith('1: a thing of 0.4 m in R1, 4 spots')
    assert answered(book, 'movable undo 1', None, after).startswith('told again when it moves: 1')
    for day in range(10, 20):
        news, learned = after.take([('R1', thing(2.0 + 0.5 * (day % 3), 2.0))], day * DAY)
        assert news
        assert not learned
    for line in ('movable undo 7', 'movable undo', 'movable undo x', 'movable drop 1'):
        with pytest.raises(ValueError, match=r'expected|there is no'):
            answered(book, line, None, after)


def test_a_state_that_is_none_is_refused_and_changes_nothing() -> None:
    movables = Movables()
    moved(movables)
    before = movables.state()
    for wrong in ({}, {'things': [[1, 'R1', 0.4, [], True, False]], 'next': 2}, {'things': 3}):
        with pytest.raises((ValueError, KeyError, TypeError)):
            movables.restore(wrong)
    assert movables.state() == before
