"""Where somebody stands whom a picture shows, by what a lidar meets there."""

from __future__ import annotations

import numpy as np
import pytest

from indoor_watch.person_places import is_passed, place_of
from indoor_watch.persons import Person

from .marked_walls import camera

ONE = Person((130, 45, 60, 181), 0.9)
"""1.7 m tall, three metres ahead."""


def legs(x: float, y: float) -> np.ndarray:
    """Return where the beams of a lidar end at two legs, in their order."""
    return np.array([[x, y + aside] for aside in (-0.12, -0.1, -0.08, 0.08, 0.1, 0.12)])


@pytest.mark.parametrize('first', range(6))
def test_a_person_is_where_the_legs_are_wherever_the_lidar_begins_its_turn(first: int):
    """It may begin between the legs, and a chair stands beside them."""
    met = np.concatenate([legs(3.0, 0.0), [[9.0, 0.3], [9.1, 0.3]]])
    place = place_of(ONE, camera(), np.roll(met, -first, axis=0))
    assert place == pytest.approx((3.0, 0.0), abs=0.01)


def test_nobody_is_where_what_is_met_would_be_a_giant_or_a_dwarf():
    assert place_of(ONE, camera(), legs(9.0, 0.0)) is None
    assert place_of(ONE, camera(), legs(0.5, 0.0)) is None
    assert place_of(ONE, camera(), legs(3.0, 2.0)) is None, 'it is in another direction'
    assert place_of(ONE, camera(), np.zeros((0, 2))) is None


def test_who_stands_where_beams_go_through_is_doubted() -> None:
    """Somebody on a poster: the feet would stand 3 m away, and the lidar sees the wall at 8 m."""
    angles = np.linspace(-0.4, 0.4, 61)
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    wall = 8.0 * rays
    assert is_passed(ONE, camera(), wall, 240)
    standing = np.where((np.abs(angles) < 0.06)[:, None], 3.0 * rays, wall)
    assert not is_passed(ONE, camera(), standing, 240)
    assert not is_passed(ONE, camera(), 1.0 * rays, 240), 'what is nearer may hide the legs'
    assert not is_passed(ONE, camera(), wall[:0], 240)
    assert not is_passed(ONE, camera(), wall, 226), 'cut off at the edge: where are the feet?'
