"""What is learned about the battery's draw."""

from __future__ import annotations

import math
import random

import pytest

from patrol_policy.battery import Draw
from surveillance_behaviour.experience import DrawEstimate


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
