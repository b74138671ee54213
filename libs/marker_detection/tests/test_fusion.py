"""Positions of markers, fused over views."""

from __future__ import annotations

import numpy as np
import pytest

from marker_detection import FusedPositions, fusion

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


def test_fused_views_are_the_weighted_mean_of_all_of_them() -> None:
    fused, generator = FusedPositions(), np.random.default_rng(4)
    total, weighed = np.zeros((3, 3)), np.zeros(3)
    for count in range(1, 6):
        camera = from_side(float(generator.uniform(-90, 90)), 2.0)
        spread = np.diag(generator.uniform(1e-4, 1e-2, 3))
        seen = np.array([0.0, 0.0, 2.0]) + generator.normal(0.0, 0.01, 3)
        assert fused.add(3, camera, seen, spread, 0.95)
        turn = camera[:3, :3]
        information = np.linalg.inv(turn @ (spread + 4e-4 * np.eye(3)) @ turn.T)
        total, weighed = total + information, weighed + information @ (turn @ seen + camera[:3, 3])
        at = fused.position_of(3)
        assert at is not None
        assert at.views == count
        assert at.position == pytest.approx(np.linalg.solve(total, weighed))
        assert at.covariance == pytest.approx(np.linalg.inv(total) + 4e-4 * np.eye(3))
        apart = np.array([0.1, -0.2, 0.3])
        distance = np.sqrt(apart @ np.linalg.inv(at.covariance) @ apart)
        assert at.distance_to(at.position + apart) == pytest.approx(distance)
    assert not fused.add(3, np.eye(4), np.array([0.0, 0.0, 2.0]), EXACT, 0.951)
    assert fused.position_of(4) is None
    assert fused.two_places(4) is None


def test_a_view_belongs_to_a_place_within_four_deviations() -> None:
    # 16.27 is the 99.9 % of chi squared with three degrees of freedom
    for factor, same in ((0.99, True), (1.01, False)):
        fused = FusedPositions()
        fused.add(7, np.eye(4), HERE, EXACT, 0.0)
        at = fused.position_of(7)
        assert at is not None
        deviation = np.sqrt(at.covariance[0, 0] + 1e-4 + 4e-4)
        beside = HERE + np.array([factor * np.sqrt(16.27) * deviation, 0.0, 0.0])
        assert fused.add(7, np.eye(4), beside, EXACT, 0.0) is same


def test_a_marker_is_moved_after_five_views_in_a_row_at_one_other_place() -> None:
    third = np.array([0.0, 1.0, 2.0])
    fused = FusedPositions()
    looked(fused, HERE)
    for _ in range(4):
        looked(fused, THERE)
    # seen at the first place again: it begins anew
    looked(fused, HERE)
    for _ in range(4):
        looked(fused, THERE)
        assert fused.position_of(7).position == pytest.approx(HERE)
    looked(fused, third)
    looked(fused, THERE)
    assert fused.position_of(7).position == pytest.approx(THERE)
    assert fused.two_places(7) is None
    for _ in range(4):
        looked(fused, HERE)
    assert fused.two_places(7) is None
    looked(fused, HERE)
    # it was told there before: a marker that was moved does not come back
    assert np.allclose(both(fused), [THERE, HERE])


def test_the_least_seen_of_four_places_gives_way_to_a_fifth() -> None:
    def at(number: int) -> np.ndarray:
        return np.array([float(number), 0.0, 2.0])

    fused = FusedPositions()
    for number, views in ((0, 9), (1, 2), (2, 1), (3, 2)):
        for _ in range(views):
            looked(fused, at(number))
    looked(fused, at(4))  # in place of 2
    for _ in range(2):
        looked(fused, at(1))
    assert fused.position_of(7).position == pytest.approx(at(0))
    looked(fused, at(1))  # the fifth there without another at the first place
    assert fused.position_of(7).position == pytest.approx(at(1))


def test_without_images_nothing_is_seen_at_the_same_time() -> None:
    fused = FusedPositions()
    for _ in range(4):
        for place in (HERE, THERE):
            fused.add(7, np.eye(4), place, EXACT, 0.0)
    assert fused.twins == []


def test_a_stream_of_ever_new_ids_is_bounded_and_that_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fusion, 'MOST_MARKERS', 2)
    fused = FusedPositions()
    for number in (5, 6, 5):
        assert fused.add(number, np.eye(4), HERE, EXACT, 0.0)
    assert not fused.is_full
    assert not fused.add(7, np.eye(4), HERE, EXACT, 0.0)
    assert fused.is_full
    assert fused.position_of(7) is None
    assert fused.add(6, np.eye(4), HERE, EXACT, 0.0), 'those that are known go on'
