"""What is learned about the legs of a map."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from surveillance_behaviour.learned_times import (
    HUBER,
    PRIOR_SPREAD,
    LegTimes,
    is_drive,
    robust_mean,
    spread_of,
)


def test_leg_times_are_learned_for_each_direction() -> None:
    times = LegTimes(0.5)
    assert times.expected('A', 'B', 10.0) == pytest.approx(20.0)
    for _ in range(15):
        times.observe('A', 'B', 30.0, 10.0, 12.0)
    assert times.expected('A', 'B', 10.0) == pytest.approx(30.0, rel=0.05)
    assert times.expected('B', 'A', 10.0) == pytest.approx(30.0, rel=0.05)
    for _ in range(15):
        times.observe('B', 'A', 24.0, 10.0, 12.0)
    assert times.expected('B', 'A', 10.0) == pytest.approx(24.0, rel=0.05)
    assert times.expected('A', 'B', 10.0) == pytest.approx(30.0, rel=0.05)
    # A leg that was never driven follows from its length.
    assert 20.0 < times.expected('A', 'C', 10.0) < 32.0


def test_what_was_learned_outlives_its_process() -> None:
    times = LegTimes(0.5)
    for seconds in (20.0, 22.0, 21.0, 40.0):
        times.observe('A', 'B', seconds, 8.0)
    again = LegTimes(0.5)
    again.restore(times.to_json())
    assert again.expected('A', 'B', 8.0) == times.expected('A', 'B', 8.0)
    assert again.spread == times.spread
    with pytest.raises(ValueError, match='times of A to B: expected finite and positive'):
        again.restore({'legs': [['A', 'B', 8.0, [-1.0]]], 'errors': []})


def learned() -> LegTimes:
    """Return the times of a small map, driven five times in 10 s a leg."""
    times = LegTimes(0.6)
    for _ in range(5):
        times.observe('A', 'B', 10.0, 6.0)
        times.observe('B', 'C', 12.0, 7.0)
    return times


def test_one_absurd_drive_changes_next_to_nothing_anywhere() -> None:
    times, twin = learned(), learned()
    times.observe('A', 'B', 560.0, 6.0)
    twin.observe('A', 'B', 10.0, 6.0)
    for leg, metres in ((('A', 'B'), 6.0), (('B', 'C'), 7.0), (('C', 'D'), 5.0)):
        assert times.expected(*leg, metres) == pytest.approx(twin.expected(*leg, metres), rel=0.1)
    assert times.spread < 1.5 * twin.spread


def test_the_first_drive_of_all_may_be_the_absurd_one() -> None:
    times = LegTimes(0.6)
    times.observe('A', 'B', 3600.0, 6.0)
    assert times.expected('A', 'B', 6.0) < 18.0
    assert times.expected('C', 'D', 6.0) < 15.0


def test_a_leg_that_became_slow_is_believed_when_drives_agree() -> None:
    times = learned()
    for _ in range(8):
        times.observe('A', 'B', 30.0, 6.0)
    assert times.expected('A', 'B', 6.0) > 20.0


def test_what_no_robot_can_drive_is_not_learned_and_not_read_back() -> None:
    times = learned()
    before = times.expected('A', 'B', 6.0)
    for seconds in (0.1, 1e6, -5.0, float('nan'), float('inf')):
        times.observe('A', 'B', seconds, 6.0)
    assert times.expected('A', 'B', 6.0) == before
    again = LegTimes(0.6)
    kept = times.to_json()
    kept['legs'][0][3].append(1e6)
    assert again.restore(kept) == 1
    assert again.expected('A', 'B', 6.0) == before


def fixed_point(values: list[float], start: float, prior: float) -> float:
    """Return where the pulls of all values are in balance, by bisection: Huber's own equation."""

    def pull(at: float) -> float:
        most = HUBER * PRIOR_SPREAD * at
        return sum(min(max(each - at, -most), most) for each in values) + prior * min(
            max(start - at, -most), most
        )

    low, high = 1e-9, 2.0 * max(*values, start)
    for _ in range(100):
        middle = (low + high) / 2.0
        low, high = (middle, high) if pull(middle) > 0.0 else (low, middle)
    return low


def test_an_estimate_is_the_point_at_which_all_drives_pull_alike() -> None:
    chance = random.Random(5)
    for _ in range(60):
        values = [chance.gauss(20.0, 2.0) for _ in range(chance.randint(1, 12))]
        values += [chance.uniform(30.0, 90.0)] * (len(values) > 5)
        start, prior = chance.uniform(15.0, 25.0), float(chance.choice((0, 1, 3)))
        expected = fixed_point(values, start, prior)
        assert robust_mean(values, start, prior=prior) == pytest.approx(expected, rel=2e-3)
    usual = [19.0, 20.0, 21.0, 22.0]
    assert robust_mean(usual, 20.0) == pytest.approx(20.5), 'a mean of what is usual'
    assert robust_mean(usual, 18.0, prior=1.0) == pytest.approx(20.0)


def test_the_line_through_all_drives_is_that_of_least_squares_where_all_are_usual() -> None:
    speed, usual = 0.5, 5.0
    times = LegTimes(speed)
    legs = {('A', 'B'): (4.0, 11.0), ('B', 'C'): (8.0, 19.5), ('C', 'D'): (6.0, 15.2)}
    for (start, goal), (metres, seconds) in legs.items():
        for _ in range(3):
            times.observe(start, goal, seconds, metres)
    # The prior is one drive: points about 5 m on the line of the configured speed.
    spread = math.sqrt(0.25) * usual
    points = [(usual - spread, (usual - spread) / speed, 0.5)]
    points += [(usual + spread, (usual + spread) / speed, 0.5)]
    points += [(metres, seconds, 3.0) for metres, seconds in legs.values()]
    weights = np.sqrt([each[2] for each in points])
    x, y = (np.array([each[n] for each in points]) for n in (0, 1))
    overhead, pace = np.linalg.lstsq(
        np.column_stack([weights, weights * x]), weights * y, rcond=None
    )[0]
    for metres in (0.0, 3.0, 10.0):
        found = times.expected('X', 'Y', metres)
        assert found == pytest.approx(overhead + pace * metres, rel=1e-3)
    slower = LegTimes(0.25)
    slower.restore(times.to_json())
    assert slower.expected('X', 'Y', 6.0) > times.expected('X', 'Y', 6.0)
    slower.forget_fit(0.5)
    assert slower.expected('X', 'Y', 6.0) == pytest.approx(times.expected('X', 'Y', 6.0))


def test_a_line_has_no_overhead_below_nothing_and_no_pace_that_gains_time() -> None:
    times = LegTimes(1.0)
    for start, metres, seconds in (('A', 2.0, 1.8), ('B', 10.0, 20.0)):
        for _ in range(10):
            times.observe(start, 'Z', seconds, metres)
    assert times.expected('X', 'Y', 0.0) == pytest.approx(1e-3), 'no negative overhead'
    assert times.expected('X', 'Y', 8.0) == pytest.approx(2 * times.expected('X', 'Y', 4.0))
    short = LegTimes(1.0)
    for start, metres, seconds in (('A', 2.0, 10.0), ('B', 10.0, 5.0)):
        for _ in range(20):
            short.observe(start, 'Z', seconds, metres)
    assert short.expected('X', 'Y', 8.0) > short.expected('X', 'Y', 4.0) > 0.0


@pytest.mark.parametrize(
    ('ratios', 'squares'),
    [
        ([], 0.0),
        ([1.0] * 10, 0.0),
        ([1.1, 0.9], 2 * 0.1**2),
        ([3.0], 0.15**2),  # one alone counts as the prior
        ([1.4, 1.0], 0.15**2),  # and the furthest as the next, or as that
        ([1.4, 1.3], 2 * 0.3**2),
        ([9.0, 9.0, 9.0], 3 * 2.0**2),
        ([1.5, 1.5] + [1.2] * 17, 2 * 0.5**2 + 17 * 0.2**2),
        ([1.5, 1.5] + [1.2] * 18, 20 * 0.2**2),  # one in twenty more
    ],
)
def test_the_spread_is_pooled_with_its_prior_and_few_odd_ones_count_as_the_next(
    ratios: list[float], squares: float
) -> None:
    expected = math.sqrt((5.0 * 0.15**2 + squares) / (5.0 + len(ratios)))
    assert spread_of(ratios) == pytest.approx(expected)


def test_lengths_and_errors_are_those_of_the_drives() -> None:
    times = LegTimes(0.5)
    times.observe('A', 'A', 5.0, 1.0)
    assert (times.drives, len(times.errors)) == ({}, 0), 'no leg'
    times.observe('A', 'B', 25.0, 10.0)
    assert times.metres == {('A', 'B'): 10.0}
    assert list(times.errors) == [25.0 / 20.0]
    times.observe('A', 'B', 25.0, 10.0, 12.5)
    times.observe('A', 'B', 25.0, 10.0)
    assert times.metres == {('A', 'B'): 12.5}, 'a planned length stands'
    for _ in range(30):
        times.observe('A', 'B', 25.0, 10.0)
    assert len(times.drives['A', 'B']) == 20
    assert times.expected('A', 'B', 10.0) == pytest.approx(25.0, rel=0.02)
    assert times.to_json()['legs'] == [['A', 'B', 12.5, [25.0] * 20]]


@pytest.mark.parametrize(
    ('seconds', 'metres', 'likely'),
    [
        (1.0, 10.0, True),
        (1.0, 10.001, False),
        (0.0, 0.0, False),
        (86_400.0, 5.0, True),
        (86_400.5, 5.0, False),
        (0.5, 1.0, True),
    ],
)
def test_what_a_robot_can_drive(seconds: float, metres: float, likely: bool) -> None:
    assert is_drive(seconds, metres) is likely


def test_maps_follow_what_is_expected_in_steps_of_three_percent() -> None:
    times = LegTimes(1.0)
    assert times.used('A', 'B', 12.3456) == 12.3
    times.forget_fit(1.02)
    assert times.used('A', 'B', 12.3456) == 12.3
    times.forget_fit(1.05)
    assert times.used('A', 'B', 12.3456) == 11.8
    assert times.used('B', 'A', 12.3456) == 11.8, 'each direction for itself'


def test_kept_times_that_are_none_are_refused_and_unlikely_ones_counted() -> None:
    times = LegTimes(0.5)
    for wrong in (
        {'legs': [['A', 'B', 0.0, [5.0]]], 'errors': []},
        {'legs': [['A', 'B', math.inf, [5.0]]], 'errors': []},
        {'legs': [['A', 'B', 5.0, [math.nan]]], 'errors': []},
        {'legs': [], 'errors': [0.0]},
        {'legs': [], 'errors': [math.inf]},
    ):
        with pytest.raises(ValueError, match='expected finite and positive'):
            times.restore(wrong)
    kept = {'legs': [['A', 'B', 5.0, [86_400.0, 90_000.0]], ['B', 'C', 5.0, [90_000.0]]]}
    assert times.restore({**kept, 'errors': [1.1]}) == 2
    assert list(times.drives) == [('A', 'B')]
    assert list(times.errors) == [1.1]
