"""Stamps of a camera whose clock is not the node's."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from surveillance_runtime.stamp_offset import StampOffset

PERIOD, DELAY = 0.1, 0.03
BEGIN = 1.7e9


def judged(stamp_at: Callable[[float], float], count: int = 100) -> tuple[StampOffset, list[float]]:
    """Follow images taken each 0.1 s; how long after it was taken each is said to be."""
    stamps = StampOffset('images')
    late = []
    for index in range(count):
        taken = BEGIN + index * PERIOD
        late.append(stamps.time_of(stamp_at(taken), taken + DELAY) - taken)
    return stamps, late


CLOCKS: dict[str, Callable[[float], float]] = {
    'all 0': lambda _now: 0.0,
    '60 s behind': lambda now: now - 60.0,
    '60 s ahead': lambda now: now + 60.0,
    '1 s ahead': lambda now: now + 1.0,
    'since its start': lambda now: now - BEGIN,
    'stands still': lambda _now: BEGIN - 30.0,
    'set back and forth': lambda now: now + (60.0 if int(now) % 2 else -60.0),
    'at random': lambda now: now + (60.0 if round(10.0 * now) % 2 else -60.0),
    'set back once': lambda now: now - (60.0 if now > BEGIN + 5.0 else 0.0),
    'set ahead once': lambda now: now + (60.0 if now > BEGIN + 5.0 else 0.0),
    'half as fast': lambda now: BEGIN / 2 + (now - BEGIN) / 2,
    'ten times as fast': lambda now: 10.0 * (now - BEGIN),
}


@pytest.mark.parametrize('clock', CLOCKS)
def test_each_image_is_placed_near_when_it_was_taken_and_one_warning_is_given(clock: str) -> None:
    stamps, late = judged(CLOCKS[clock])
    # a clock that is half as fast is behind by half of the window
    assert min(late) > (-3.0 if clock == 'half as fast' else -0.01)
    assert max(late) < 0.05
    if clock != 'ten times as fast':
        warning = stamps.warning()
        assert warning is not None
        assert '\n' not in warning
        assert warning.startswith('stamps of images ')
        assert stamps.warning() is None


@pytest.mark.parametrize(
    ('clock', 'words'),
    [
        ('all 0', 'do not advance (are 1.7e+09 s behind'),
        ('60 s behind', 'are 60.0 s behind this'),
        ('60 s ahead', 'are 60.0 s ahead of this'),
        ('1 s ahead', 'are 1.0 s ahead of this'),
        ('since its start', 'use_sim_time set on one side only'),
        ('at random', 'jump'),
    ],
)
def test_finding_names_what_is_wrong(clock: str, words: str) -> None:
    stamps, _ = judged(CLOCKS[clock], 10)
    finding = stamps.finding()
    assert finding is not None
    assert words in finding


def test_good_stamps_are_taken_as_they_are_also_of_a_delayed_image() -> None:
    stamps = StampOffset('images')
    for index, delay in enumerate([0.02, 0.5, 0.02, 3.0, 2.9, 0.02] * 5):
        stamp = BEGIN + index
        assert stamps.time_of(stamp, stamp + delay) == stamp
    assert stamps.finding() is None


def test_repeated_image_of_a_good_clock_is_no_finding() -> None:
    stamps, late = judged(lambda now: now - (now - BEGIN) % 0.2)
    assert stamps.finding() is None
    assert max(late) <= 0.0


def test_finding_ends_when_the_clocks_agree_again() -> None:
    stamps, _ = judged(lambda now: now - 60.0 * (now < BEGIN + 3.0), 100)
    assert stamps.finding() is None


def test_clock_of_the_node_that_stands_still_blinds_nobody() -> None:
    """With use_sim_time and no clock, now is 0 for ever."""
    stamps = StampOffset('images')
    assert all(stamps.time_of(BEGIN + index, 0.0) >= 0.0 for index in range(20))


def test_messages_that_are_all_late_may_be_as_old_as_they_say() -> None:
    """At speed 10 a camera of a busy machine was 2.4 s behind, and not its clock."""
    stamps = StampOffset('images')
    for index in range(20):
        taken = BEGIN + index * PERIOD
        first, last = stamps.span_of(taken, taken + 2.4)
        assert first <= taken <= last


def test_another_clock_leaves_two_seconds_and_a_good_one_none() -> None:
    stamps = StampOffset('images')
    for index in range(20):
        taken = BEGIN + index * PERIOD
        first, last = stamps.span_of(index * PERIOD, taken + DELAY)
    assert taken - 2.1 < first < taken < last < taken + 0.1
    stamps = StampOffset('images')
    assert stamps.span_of(BEGIN, BEGIN + DELAY) == (BEGIN, BEGIN)


def test_no_message_was_stamped_after_it_came():
    stamps = StampOffset('images')
    for index in range(20):
        taken = BEGIN + index * PERIOD
        first, last = stamps.span_of(taken + 0.7, taken + DELAY)
        assert first <= taken <= last <= taken + DELAY
    # Machines that are in step are so to some milliseconds.
    stamps = StampOffset('images')
    assert stamps.span_of(BEGIN, BEGIN - 0.005) == (BEGIN, BEGIN)


def test_in_simulated_time_a_message_that_is_seconds_behind_is_late() -> None:
    """At speed 10 a camera of a busy machine was 2.4 s behind: a quarter of a second."""
    stamps = StampOffset('images', simulated=True)
    for index, delay in enumerate((2.4, 9.0, 0.1, -5.0, 5.0, 2.4) * 4):
        stamp = 100.0 + index
        assert stamps.span_of(stamp, stamp + delay) == (stamp, stamp)
    assert stamps.finding() is None
    # But no camera of the machine's own clock is believed.
    assert StampOffset('images', simulated=True).time_of(BEGIN, 100.0) <= 100.0
