"""Tracks of persons: who walks keeps a number, two that cross are two, a coat fades."""

from __future__ import annotations

import math

import numpy as np
import pytest

from indoor_watch.person_tracks import FORGOTTEN, PersonTrack, PersonTracks


def test_who_walks_is_one_track_whose_place_and_speed_are_right() -> None:
    seed = int(np.random.default_rng().integers(10**6))
    rng, tracks = np.random.default_rng(seed), PersonTracks()
    track = PersonTrack(0, 0.0, None)
    for step in range(20):
        stamp = 0.5 * step
        # The speed is then off by .05 m/s (one sigma, 20,000 seeds): the bound is six of it.
        at = 1.0 + 0.8 * stamp + rng.normal(0.0, 0.05), 2.0 + rng.normal(0.0, 0.05)
        (track,) = tracks.take([(0.8, at)], stamp)
    assert track.number == 1, f'seed {seed}'
    assert track.position is not None
    assert math.dist(track.position, (1.0 + 0.8 * 9.5, 2.0)) < 0.4, f'seed {seed}'
    assert track.state is not None
    assert track.state[2] == pytest.approx(0.8, abs=0.3), f'seed {seed}'
    assert track.confidence > 0.95


def test_two_that_cross_stay_two() -> None:
    tracks = PersonTracks()
    numbers: list[list[int]] = []
    for step in range(21):
        stamp = 0.25 * step
        left, right = (1.0 + stamp, 2.0), (6.0 - stamp, 2.3)
        finds = [(0.9, left), (0.9, right)]
        if step % 2:
            finds.reverse()
        found = tracks.take(finds, stamp)
        by_height = sorted(found, key=lambda each: (each.position or (0, 0))[1])
        numbers.append([each.number for each in by_height])
    assert numbers[-1] == numbers[0]
    assert len({number for each in numbers for number in each}) == 2


def test_far_away_or_much_later_it_is_another_one() -> None:
    tracks = PersonTracks()
    (first,) = tracks.take([(0.9, (1.0, 1.0))], 0.0)
    (other,) = tracks.take([(0.9, (8.0, 8.0))], 0.5)
    assert other.number != first.number
    (later,) = tracks.take([(0.9, (1.0, 1.0))], 1.0 + FORGOTTEN)
    assert later.number not in (first.number, other.number)
    tracks.begin()
    (anew,) = tracks.take([(0.9, (1.0, 1.0))], 2.0 + FORGOTTEN)
    assert anew.number > later.number


def test_without_a_place_one_person_is_one_track_that_gets_its_place_later() -> None:
    tracks = PersonTracks()
    (first,) = tracks.take([(0.7, None)], 0.0)
    (again,) = tracks.take([(0.7, None)], 1.0)
    (placed,) = tracks.take([(0.7, (3.0, 4.0))], 2.0)
    assert first.number == again.number == placed.number
    assert placed.position == (3.0, 4.0)


def test_a_further_picture_of_the_moment_counts_less_and_a_miss_against() -> None:
    tracks = PersonTracks()
    (track,) = tracks.take([(0.8, (2.0, 2.0))], 0.0)
    assert track.confidence == pytest.approx(0.8)
    tracks.take([(0.8, (2.0, 2.0))], 1.0)
    assert 0.8 < track.confidence < 1.0 - 0.2 * 0.2
    before = track.confidence
    tracks.take([], 2.0, [True])
    assert track.confidence < before
    kept = track.confidence
    tracks.take([], 3.0, [False])
    assert track.confidence == kept


def test_a_clock_that_is_set_back_ends_tracks_and_raises_nothing() -> None:
    tracks = PersonTracks()
    (first,) = tracks.take([(0.9, (1.0, 1.0))], 1000.0)
    (second,) = tracks.take([(0.9, (1.0, 1.0))], 10.0)
    assert second.number != first.number
