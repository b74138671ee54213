"""What is drawn into an image lies where it was detected, in its colours."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from marker_detection.annotation import annotated
from marker_detection.detector import Detection

GREEN, ORANGE, CORNER = (60, 220, 60), (0, 165, 255), (255, 80, 40)


def square(marker_id, left, top, side=60):
    corners = np.array(
        [[left, top], [left + side, top], [left + side, top + side], [left, top + side]]
    )
    return Detection(marker_id, corners.astype(float), 0.925, True)


def drawn_in(image, color):
    """Return where an image has a colour: left, top, right, bottom."""
    rows, columns = np.nonzero((image == color).all(axis=2))
    return columns.min(), rows.min(), columns.max(), rows.max()


@pytest.mark.parametrize('shape', [(300, 400), (300, 400, 3)])
def test_outlines_are_drawn_where_the_corners_are(shape):
    image = np.full(shape, 128, np.uint8)
    drawn = annotated(image, [square(7, 100, 120)])
    assert drawn.shape == (300, 400, 3)
    assert (image == 128).all()
    for x, y in ((130, 180), (160, 150), (100, 160)):
        assert drawn[y, x].astype(int) == pytest.approx(GREEN, abs=25)
    assert tuple(drawn[120, 100]) == CORNER
    left, top, right, bottom = drawn_in(drawn, CORNER)
    assert (left + right, top + bottom) == pytest.approx((200, 240), abs=1)
    assert 2 <= right - left <= 6
    assert tuple(drawn[150, 130]) == (128, 128, 128)
    # above the outline stands its id on a dark ground
    dark_left, dark_top, _, dark_bottom = drawn_in(drawn, (20, 20, 20))
    assert dark_left == 98
    assert 95 < dark_top < dark_bottom < 120


def test_ids_that_are_not_confirmed_have_another_colour():
    image = np.zeros((300, 400), np.uint8)
    both = [square(7, 50, 120), square(8, 250, 120)]
    for confirmed, colors in (
        (None, (GREEN, GREEN)),
        ([7], (GREEN, ORANGE)),
        (iter([8]), (ORANGE, GREEN)),
        ([], (ORANGE, ORANGE)),
    ):
        drawn = annotated(image, both, confirmed)
        assert drawn[180, [80, 280]].astype(int) == pytest.approx(np.array(colors), abs=25)


def test_a_marker_at_the_upper_or_left_edge_has_its_id_where_it_can_be_read():
    image = np.zeros((300, 400), np.uint8)
    low = drawn_in(annotated(image, [square(7, -20, 10)]), (20, 20, 20))
    assert low[0] == 0
    # It is drawn whole: as of a marker whose left side is the image's.
    assert low == drawn_in(annotated(image, [square(7, 0, 10)]), (20, 20, 20))
    assert low[1] >= 70
    above = drawn_in(annotated(image, [square(7, 30, 18)]), (20, 20, 20))
    assert above[3] < 18


def test_large_images_have_thick_lines():
    def thickness(height):
        image = annotated(np.zeros((height, 2 * height), np.uint8), [square(1, 100, 200, 100)])
        return int((image[250, 90:110] != 0).any(axis=1).sum())

    assert thickness(400) <= 4
    assert thickness(2400) >= thickness(400) + 2


@pytest.mark.parametrize(
    ('shape', 'thickness'),
    [((300, 400), 1), ((900, 640), 1), ((1200, 900), 1), ((1200, 1100), 2), ((2000, 3000), 3)],
)
def test_what_is_drawn_grows_with_the_shorter_side_of_the_image(shape, thickness):
    side = 20 * thickness
    found = Detection(3, side * np.array([[2.0, 2], [3, 2], [3, 3], [2, 3]]), 0.5, True)
    drawn = annotated(np.zeros(shape, np.uint8), [found])
    expected = np.zeros((*shape, 3), np.uint8)
    scale = max(0.45, min(shape) / 1100.0)
    outline = np.rint(found.corners * 16).astype(np.int32)
    cv2.polylines(expected, [outline], True, GREEN, thickness, cv2.LINE_AA, shift=4)
    at = 2 * side
    cv2.circle(expected, (16 * at, 16 * at), 32 * thickness, CORNER, -1, cv2.LINE_AA, shift=4)
    (width, height), _ = cv2.getTextSize('3 0.50', 0, scale, thickness)
    left, low = at, at - 5
    cv2.rectangle(
        expected, (left - 2, low - height - 2), (left + width + 2, low + 3), (20,) * 3, -1
    )
    cv2.putText(expected, '3 0.50', (left, low), 0, scale, GREEN, thickness, cv2.LINE_AA)
    assert (drawn == expected).all()
