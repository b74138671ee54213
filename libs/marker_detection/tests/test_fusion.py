"""Positions of markers, fused over views."""

from __future__ import annotations

import numpy as np
import pytest

from marker_detection import FusedPositions

LONG_SIGHT = np.diag([1e-4, 1e-4, 0.09])


def from_side(degrees: float, distance: float) -> np.ndarray:
    """Return the camera's pose (4, 4) that sees the origin `distance` ahead, from a direction."""
    angle = np.radians(degrees)
    pose = np.eye(4)
    pose[:3, :3] = [
        [np.cos(angle), 0, np.sin(angle)],
        [0, 1, 0],
        [-np.sin(angle), 0, np.cos(angle)],
    ]
    pose[:3, 3] = -distance * pose[:3, 2]
    return pose


def test_views_from_two_sides_are_surer_than_each() -> None:
    fused = FusedPositions()
    for degrees, error in ((0.0, 0.3), (90.0, -0.3)):
        seen = np.array([0.0, 0.0, 3.0 + error])
        assert fused.add(7, from_side(degrees, 3.0), seen, LONG_SIGHT, 0.1)
    at = fused.position_of(7)
    assert at is not None
    assert at.views == 2
    assert np.linalg.norm(at.position) < 0.03
    assert np.sqrt(np.diag(at.covariance)).max() < 0.05
    assert at.distance_to(np.zeros(3)) < 1.0
    assert at.distance_to(np.array([0.5, 0.0, 0.0])) > 4.0


@pytest.mark.parametrize(
    ('position', 'covariance', 'ambiguity'),
    [
        ([0.0, 0.0, np.nan], LONG_SIGHT, 0.0),
        ([0.0, 0.0, 3.0], np.full((3, 3), np.inf), 0.0),
        ([0.0, 0.0, 3.0], LONG_SIGHT, 0.99),
        ([0.0, 0.0, 3.0], -np.eye(3), 0.0),
        ([0.0, 0.0, 3.0], -4e-4 * np.eye(3), 0.0),
    ],
)
def test_views_that_say_nothing_do_not_count(
    position: list[float], covariance: np.ndarray, ambiguity: float
) -> None:
    fused = FusedPositions()
    assert not fused.add(7, np.eye(4), np.array(position), covariance, ambiguity)
    assert fused.position_of(7) is None


def test_one_wrong_view_is_left_out_and_a_moved_marker_is_followed() -> None:
    fused = FusedPositions()
    here, there = np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 2.0])
    for _ in range(3):
        fused.add(7, np.eye(4), here, np.eye(3) * 1e-4, 0.0)
    assert not fused.add(7, np.eye(4), there, np.eye(3) * 1e-4, 0.0)
    assert fused.position_of(7).position == pytest.approx(here)
    for _ in range(5):
        fused.add(7, np.eye(4), there, np.eye(3) * 1e-4, 0.0)
    assert fused.position_of(7).position == pytest.approx(there)


HERE, THERE = np.array([0.0, 0.0, 2.0]), np.array([1.0, 0.0, 2.0])
EXACT = np.eye(3) * 1e-4


def looked(fused: FusedPositions, *places: np.ndarray) -> None:
    fused.next_image()
    for place in places:
        fused.add(7, np.eye(4), place, EXACT, 0.0)


def both(fused: FusedPositions) -> list[np.ndarray]:
    found = fused.two_places(7)
    assert found is not None
    return [each.position for each in found]


def test_two_panels_with_one_id_in_the_same_images_are_told_with_both_positions() -> None:
    fused = FusedPositions()
    for _ in range(2):
        looked(fused, HERE, THERE)
    assert fused.two_places(7) is None
    looked(fused, THERE, HERE)
    assert np.allclose(both(fused), [HERE, THERE])
    assert fused.twins == [7]


def test_two_panels_with_one_id_seen_in_turn_are_told_and_the_position_stays() -> None:
    fused = FusedPositions()
    positions = []
    for view in range(64):
        looked(fused, HERE if view // 8 % 2 == 0 else THERE)
        positions.append(fused.position_of(7).position)
    assert sorted(map(tuple, np.round(both(fused), 3).tolist())) == [tuple(HERE), tuple(THERE)]
    assert np.allclose(positions[24:], positions[24])


def test_moved_marker_and_a_wrong_view_are_no_second_panel() -> None:
    fused = FusedPositions()
    for _ in range(20):
        looked(fused, HERE)
    looked(fused, THERE, HERE)
    for _ in range(20):
        looked(fused, THERE)
    for _ in range(3):
        looked(fused, HERE)
    assert fused.two_places(7) is None
    assert fused.twins == []


def test_many_views_from_a_camera_that_is_not_sure_where_it_is_make_no_second_panel() -> None:
    fused = FusedPositions()
    exact, carrier = np.eye(3) * 1e-6, np.eye(3) * 0.1**2
    # From one stand all views are off alike, and from the next one otherwise.
    for off in (0.12, -0.13, 0.1):
        for _ in range(50):
            fused.next_image()
            seen = np.array([off, 0.0, 2.0])
            assert fused.add(7, np.eye(4), seen, exact, 0.0, carrier)
    at = fused.position_of(7)
    assert at is not None
    assert np.sqrt(at.covariance[0, 0]) > 0.09, 'their number makes it no surer'
    assert fused.twins == []
    for _ in range(10):
        fused.next_image()
        fused.add(7, np.eye(4), np.array([0.1, 0.0, 2.0]), exact, 0.0, carrier)
        fused.add(7, np.eye(4), np.array([1.1, 0.0, 2.0]), exact, 0.0, carrier)
    assert fused.twins == [7], 'one that hangs there'
