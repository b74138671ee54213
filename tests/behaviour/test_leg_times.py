"""What is learned about the legs of a map."""

from __future__ import annotations

import pytest

from surveillance_behaviour.experience import LegTimes


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
