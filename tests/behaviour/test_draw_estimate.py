"""What is learned about the battery's draw."""

from __future__ import annotations

import math
import random

import pytest

from patrol_policy.battery import LEARNED_FALL, Draw
from surveillance_behaviour.learned_times import DrawEstimate


def learnt(rates: list[float], level: float = 100.0) -> Draw:
    """Return the draw learned from a level in whole percents, told each second of its rate."""
    estimate = DrawEstimate()
    for time, rate in enumerate(rates):
        if level <= 20.0:
            level = 100.0
        level -= rate
        estimate.observe(float(time), math.floor(level))
    return estimate.draw


def test_a_steady_draw_is_learnt_without_a_margin_for_whole_percents() -> None:
    assert learnt([0.1] * 3000).rate == pytest.approx(0.1, rel=0.05)
    assert learnt([0.1] * 3000).spread < 0.1
    assert learnt([]).rate == 0.0


def test_99_of_100_ways_need_no_more_and_not_much_less() -> None:
    """A robot that stands a third of the time, on ways whose times vary by a tenth."""
    chance = random.Random(7)

    def rates(seconds: float) -> list[float]:
        found: list[float] = []
        while len(found) < seconds:
            found += [chance.choice((0.04, 0.1, 0.12))] * 10
        return found[: round(seconds)]

    draw = learnt(rates(3000))
    falls = sorted(sum(rates(chance.gauss(300.0, 30.0))) for _ in range(2000))
    most = draw.most(300.0, 0.1)
    assert sum(fall > most for fall in falls) <= 0.02 * len(falls)
    assert most < 1.1 * falls[int(0.99 * len(falls))]


def test_one_jump_of_the_level_is_no_draw() -> None:
    jump = DrawEstimate()
    for time, level in [(0.0, 100.0), (9.0, 97.0), (20.0, 94.0), (30.0, 91.0), (40.0, 88.0)]:
        jump.observe(time, level)
    jump.observe(41.0, 60.0)
    assert jump.draw.rate == pytest.approx(0.3, rel=0.1)
    jump.observe(60.0, 100.0)
    jump.observe(70.0, 99.0)
    assert jump.draw.rate == pytest.approx(0.3, rel=0.1), 'charging is no fall'


def test_what_no_battery_can_draw_is_not_learned_and_not_read_back() -> None:
    estimate = DrawEstimate()
    estimate.observe(0.0, 90.0)
    estimate.observe(0.1, 0.0)
    assert estimate.draw.rate == 0.0
    assert estimate.restore([0.1, 754.0, float('nan'), -1.0]) == 3
    assert estimate.draw.rate == pytest.approx(0.1)


def test_rates_are_exact_between_falls_and_the_last_fifty_count() -> None:
    estimate = DrawEstimate()
    for time, level in ((0.0, 90.0), (5.0, 89.9), (10.0, 89.0), (20.0, 88.0), (25.0, 95.0)):
        estimate.observe(time, level)
    kept = estimate.to_json()
    fallen = LEARNED_FALL
    steps = DrawEstimate()
    steps.observe(0.0, 90.0)
    steps.observe(10.0, 90.0 - fallen + 0.001)
    assert steps.to_json() == []
    steps.observe(20.0, 90.0 - fallen)
    assert steps.to_json() == [fallen / 20.0]
    steps.observe(20.0, 10.0)
    assert steps.to_json() == [fallen / 20.0], 'no time has passed'
    steps.observe(30.0, 10.0 - fallen)
    assert steps.to_json() == [fallen / 20.0, fallen / 10.0], 'from there on'
    estimate.observe(35.0, 95.0 - fallen)
    assert estimate.to_json() == [*kept, fallen / 10.0], 'charging begins anew'
    fast = DrawEstimate()
    fast.observe(0.0, 100.0)
    fast.observe(10.0, 50.0)
    fast.observe(18.0, 9.9)
    assert fast.to_json() == [5.0], 'faster than that none falls'
    fast.restore([0.1] * 60)
    assert fast.to_json() == [0.1] * 50


def test_the_mean_takes_no_rate_as_further_off_than_its_bound() -> None:
    estimate = DrawEstimate()
    estimate.restore([0.08, 0.1, 0.12, 0.1, 0.1, 4.0])
    # The median is .1; .15 of it is the least spread, and 2.69 of that the bound.
    bound = 0.1 + 2.0 * 1.345 * 0.15 * 0.1
    expected = (0.08 + 0.1 + 0.12 + 0.1 + 0.1 + bound) / 6
    assert estimate.draw.rate == pytest.approx(expected)
    wide = DrawEstimate()
    wide.restore([0.04, 0.06, 0.1, 0.14, 0.16, 4.0, 4.0])
    middle, spread = 0.14, 1.4826 * 0.08
    bound = middle + 2.0 * 1.345 * spread
    assert wide.draw.rate == pytest.approx((0.04 + 0.06 + 0.1 + 0.14 + 0.16 + 2 * bound) / 7)
