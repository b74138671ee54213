"""Motion without a robot: what is drawn by chance, and a glide along a path in its time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from surveillance_controllers import stimuli

PATH = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 4.0, 0.0]])
END = np.array([6.1, 3.9, 0.0])


class Pace:
    """A goal's time, which passes with each sleep, up to `until`."""

    def __init__(self, until: float = 1e9) -> None:
        self.time = 100.0
        self.until = 100.0 + until
        self.slept: list[float] = []

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> bool:
        self.slept.append(seconds)
        self.time += seconds
        return self.time < self.until


def glide(pace: Pace, stands: Callable[[], bool] = lambda: False) -> tuple[list[Any], Any]:
    """Glide along `PATH` in 4 s; return the x and y that were told, and where it ended."""
    told: list[Any] = []
    run: Any = pace
    end = stimuli.glide(PATH, 4.0, END, run, lambda at: told.append(at[:2].tolist()), 1.5, stands)
    return told, end


def test_a_glide_tells_where_it_is_each_period_and_ends_in_time() -> None:
    pace = Pace()
    told, end = glide(pace)
    assert told == [[0.0, 0.0], [3.75, 0.0], [6.0, 1.5], [6.1, 3.9]]
    assert pace.slept == [1.5, 1.5, 1.0]
    assert end.tolist() == END.tolist()


def test_a_glide_that_is_ended_early_says_where_it_was() -> None:
    told, end = glide(Pace(until=2.0))
    assert told == [[0.0, 0.0], [3.75, 0.0]]
    assert end.tolist() == [3.75, 0.0, 0.0]


def test_a_glide_that_rests_goes_on_from_there() -> None:
    rests = iter([False, True, True, False, False])
    pace = Pace()
    told, _ = glide(pace, lambda: next(rests))
    assert told == [[0.0, 0.0], [3.75, 0.0], [3.75, 0.0], [3.75, 0.0], [6.0, 1.5], [6.1, 3.9]]
    assert pace.time == 107.0


def test_what_is_drawn_covers_its_range_and_no_more() -> None:
    draw = stimuli.generator(5)
    moves = [stimuli.move(draw) for _ in range(300)]
    assert {seconds for seconds, _ in moves} == {5.0, 6.0, 7.0, 8.0, 9.0}
    errors = [error for _, error in moves]
    assert -0.2 <= min(errors) < -0.19
    assert 0.19 < max(errors) <= 0.2
    paths = [stimuli.via_points(draw) for _ in range(300)]
    assert {len(points) for points in paths} == {0, 1, 2, 3, 4}
    axes = np.concatenate([np.array(points) for points in paths if points]).T
    assert all(-10.0 <= axis.min() < -9.5 and 9.5 < axis.max() <= 10.0 for axis in axes)


@pytest.mark.parametrize('delta', [0.2, -0.2])
def test_a_move_ends_near_its_goal_on_each_axis(delta: float) -> None:
    draw = stimuli.generator(0)
    ends = np.array([stimuli.reached(draw, (1.0, -2.0, 0.5), delta) for _ in range(200)])
    off = ends - (1.0, -2.0, 0.5)
    assert np.abs(off).max() <= 0.2
    assert (off.max(axis=0) > 0.18).all()
    assert (off.min(axis=0) < -0.18).all()


def test_a_seed_repeats_what_is_drawn_and_a_negative_one_does_not() -> None:
    first, again, other = (stimuli.generator(seed).random() for seed in (0, 0, 1))
    assert first == again != other
    assert stimuli.generator(-1).random() != stimuli.generator(-1).random()
