"""Markers against the reference of a viewpoint: there, moved, gone, twice; else nothing is said."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from surveillance_perception.observation.marker_views import (
    AGREED,
    MarkerMemory,
    SeenMarker,
    compare_markers,
)

from .marked_walls import hang, wall


@pytest.fixture
def reference() -> tuple[np.ndarray, dict[int, SeenMarker]]:
    picture = wall()
    return picture, {14: hang(picture, 14, 120, 100)}


def states(found) -> dict[int, str]:
    assert found is not None
    return {each.number: each.state for each in found}


def test_a_marker_at_its_spot_is_there_also_from_a_little_aside(reference):
    picture, hung = reference
    shift = np.array([[1, 0, 6], [0, 1, -4]], float)
    aside = np.asarray(cv2.warpAffine(picture, shift, (320, 240), borderMode=cv2.BORDER_REFLECT))
    seen = SeenMarker(14, hung[14].corners + np.array([6, -4]), 0.15)
    assert states(compare_markers(picture, hung, aside, [seen])) == {14: 'here'}


@pytest.mark.parametrize('light', [1.0, 0.6])
def test_a_marker_is_missing_where_its_spot_shows_the_wall(reference, light):
    picture, hung = reference
    now = np.asarray(wall() * light, np.uint8)
    assert states(compare_markers(picture, hung, now, [])) == {14: 'missing'}


def test_nothing_is_said_of_a_marker_that_was_not_read_or_that_something_stands_before(reference):
    picture, hung = reference
    blurred = np.asarray(cv2.GaussianBlur(picture, (0, 0), 1.5), np.uint8)
    assert not compare_markers(picture, hung, blurred, [])
    hidden = picture.copy()
    hidden[60:, 70:200] = (60, 90, 150)
    assert not compare_markers(picture, hung, hidden, [])
    half = picture.copy()
    half[:, 110:128] = (60, 90, 150)
    assert not compare_markers(picture, hung, half, [])


def test_a_marker_is_moved_from_0_3_m_on_and_double_where_both_are_read(reference):
    picture, hung = reference
    now = wall()
    near = hang(now.copy(), 14, 120 + 30, 100)
    far = hang(now, 14, 120 + 52, 100)
    assert states(compare_markers(picture, hung, now, [near])) == {14: 'here'}
    assert states(compare_markers(picture, hung, now, [far])) == {14: 'moved'}
    both = picture.copy()
    second = hang(both, 14, 220, 60)
    assert states(compare_markers(picture, hung, both, [hung[14], second])) == {14: 'double'}


def test_a_marker_on_a_bare_wall_is_not_laid_over_its_old_spot():
    picture = np.full((240, 320, 3), 150, np.uint8)
    bare = picture.copy()
    hung = {14: replace(hang(picture, 14, 120, 100), distance=2.0)}
    seen = hang(bare, 14, 172, 100)
    assert states(compare_markers(picture, hung, bare, [seen], 0.0)) == {14: 'moved'}
    assert compare_markers(picture, hung, bare, [seen]) is None


def told(memory: MarkerMemory, view: str, found, hung, look: int) -> list[str]:
    said: list[str] = []
    for _ in range(AGREED):
        said = [each.state for each in memory.take(view, found or [], hung, look)]
    return said


def test_a_marker_that_hangs_in_another_view_too_is_double_and_moved_where_the_first_is_gone():
    first, second = wall(), wall(2)
    hung = {14: hang(first, 14, 120, 100)}
    fresh = second.copy()
    seen = hang(fresh, 14, 60, 60)
    here = compare_markers(first, hung, first, [hung[14]])
    new = compare_markers(second, {}, fresh, [seen])
    gone = compare_markers(first, hung, wall(), [])
    memory = MarkerMemory()
    assert told(memory, 'v1', here, hung, 1) == ['here']
    assert told(memory, 'v2', new, (), 2) == ['new']
    assert told(memory, 'v1', here, hung, 3) == ['double']
    assert told(memory, 'v2', [], (), 4) == []
    assert told(memory, 'v1', here, hung, 5) == ['here']
    assert told(memory, 'v1', gone, hung, 6) == ['missing']
    assert told(memory, 'v2', new, (), 7) == ['moved']
    assert told(memory, 'v1', here, hung, 8) == ['here']


def test_one_picture_alone_tells_nothing():
    picture = wall()
    hung = {14: hang(picture, 14, 120, 100)}
    gone = compare_markers(picture, hung, wall(), [])
    assert gone
    memory = MarkerMemory()
    assert not memory.take('v1', gone, hung, 1)
    assert not memory.take('v1', [], hung, 1)
    assert not memory.take('v1', gone, hung, 1)
