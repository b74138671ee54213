"""Which floor a picture shows; the cameras and rooms are drawn ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from floor_plans import Grid
from indoor_watch.camera_floor import CameraFloor
from indoor_watch.hung_markers import CameraView

from .marked_walls import camera_pose

SIZE = 240, 320
LENS = np.array([[277.0, 0.0, 160.0], [0.0, 277.0, 120.0], [0.0, 0.0, 1.0]])
"""A field of view of 60 degrees."""


def camera(x: float, y: float, yaw: float, pitch: float = 0.0) -> CameraView:
    """Return a camera that looks along the floor, or downwards by a pitch, rad."""
    return CameraView(camera_pose(x, y, yaw, pitch=pitch), LENS, 0.02, 0.01)


def hall() -> Grid:
    """Return a hall of 10 by 10 metres."""
    cells = np.zeros((200, 200), np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    return Grid(cells, 0.05)


def shown(view: CameraView, things: np.ndarray | None = None) -> CameraFloor:
    floor = CameraFloor(hall())
    floor.add(view, SIZE, things)
    return floor


def at(floor: CameraFloor, x: float, y: float) -> bool:
    return bool(floor.seen[round(y / 0.05), round(x / 0.05)])


def test_floor_is_shown_within_the_field_of_view_and_so_far_as_persons_are_found():
    floor = shown(camera(2.0, 5.0, 0.0))
    assert at(floor, 4.0, 5.0)
    for degrees, is_in in ((-35, False), (-25, True), (25, True), (35, False), (180, False)):
        turn = math.radians(degrees)
        where = 2.0 + 1.9 * math.cos(turn), 5.0 + 1.9 * math.sin(turn)
        assert at(floor, *where) is is_in, degrees
    assert at(floor, 7.8, 5.0)
    assert not at(floor, 8.3, 5.0)
    # All of the sector of a sixth of a circle of 6 m but what is too near.
    area = float(floor.seen.sum()) * 0.05**2
    assert 0.9 * math.pi * 36.0 / 6.0 < area < math.pi * 36.0 / 6.0


def test_a_camera_that_looks_down_a_little_shows_what_is_nearer():
    nearest = {pitch: shown(camera(2.0, 5.0, 0.0, pitch=pitch)) for pitch in (0.0, 0.3, 0.5)}
    assert [at(floor, 3.1, 5.0) for floor in nearest.values()] == [False, True, False]
    assert [at(floor, 2.8, 5.0) for floor in nearest.values()] == [False, False, True]


def test_of_one_who_stands_too_near_only_a_part_is_in_the_picture():
    floor = shown(camera(2.0, 5.0, 0.0))
    assert not at(floor, 2.6, 5.0)
    assert at(floor, 3.4, 5.0)


@pytest.mark.parametrize('pitch', [1.5, -1.5, 0.9])
def test_a_camera_that_looks_up_or_down_shows_nobody_at_the_other_end(pitch: float):
    floor = shown(camera(2.0, 5.0, 0.0, pitch=pitch))
    assert not floor.seen[:, 120:].any()


def test_walls_and_things_hide_the_floor_behind_them():
    things = np.zeros((200, 200), np.bool_)
    things[90:110, 80] = True
    floor = shown(camera(2.0, 5.0, 0.0), things)
    assert at(floor, 3.8, 5.0)
    assert not at(floor, 4.5, 5.0)
    assert not at(floor, 6.0, 5.0)
    assert at(floor, 6.0, 7.0)


def test_several_pictures_show_together_what_each_of_them_shows():
    floor = CameraFloor(hall())
    for turn in range(6):
        floor.add(camera(5.0, 5.0, turn * math.pi / 3), SIZE)
    inner = [
        at(floor, 5.0 + 2.0 * math.cos(angle), 5.0 + 2.0 * math.sin(angle))
        for angle in np.linspace(0.0, math.tau, 60)
    ]
    assert np.mean(inner) > 0.95


def test_a_camera_off_the_map_shows_nothing():
    assert not shown(camera(-50.0, 5.0, math.pi)).seen.any()
