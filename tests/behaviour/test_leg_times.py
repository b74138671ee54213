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
