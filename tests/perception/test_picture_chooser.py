"""Which picture is looked at next; the time is handed in."""

from __future__ import annotations

import numpy as np

from indoor_watch.hung_markers import SeenMarker
from indoor_watch.lost_sight import NO_POSE, UNREAD
from surveillance_perception.observing.base_history import BaseHistory
from surveillance_perception.observing.camera_tracker import CameraTracker
from surveillance_perception.observing.picture_chooser import (
    DETECTOR_PATIENCE,
    MOST_HELD_BYTES,
    PICTURE_PERIOD,
    STANDING_PATIENCE,
    HeldPicture,
    PictureChooser,
)

NOW = 100.0
NOWHERE = np.zeros((0, 0))


def chooser(stands: bool = True) -> PictureChooser:
    base = BaseHistory()
    for tick in range(101):
        base.take_pose(tick / 10, (1.0 if stands else tick / 10, 2.0, 0.0), tick / 10)
    return PictureChooser(CameraTracker(base, lambda: None))


def picture(stamp: float, data: bytes = b'') -> HeldPicture:
    return HeldPicture(data or str(stamp).encode(), stamp, stamp, stamp)


def test_nothing_is_chosen_where_nothing_waits():
    assert chooser().next(NOW, is_detected=False) is None


def test_the_newest_picture_of_a_camera_that_stands_is_looked_at_and_then_none_for_a_while():
    chooser_ = chooser()
    for stamp in (4.0, 5.0):
        chooser_.take(picture(stamp), NOW)
    chosen = chooser_.next(NOW, is_detected=False)
    assert (chosen.taken, chosen.viewpoint, chosen.markers) == (5.0, (1.0, 2.0, 0.0), None)
    assert chosen.causes == ()
    chooser_.take(picture(6.0), NOW + 0.5 * PICTURE_PERIOD)
    assert chooser_.next(NOW + 0.5 * PICTURE_PERIOD, is_detected=False) is None
    chooser_.take(picture(7.0), NOW + PICTURE_PERIOD)
    assert chooser_.next(NOW + PICTURE_PERIOD, is_detected=False).taken == 7.0


def test_what_was_read_in_a_picture_is_waited_for_but_not_for_ever():
    chooser_, seen = chooser(), SeenMarker(14, 0.2, None, NOWHERE, NOWHERE)
    chooser_.take(picture(4.0), NOW)
    assert chooser_.next(NOW, is_detected=True) is None
    chooser_.take_markers(4.0, (seen,))
    assert chooser_.next(NOW, is_detected=True).markers == (seen,)
    chooser_.take(picture(6.0), NOW + 10.0)
    late = chooser_.next(NOW + 10.0 + DETECTOR_PATIENCE, is_detected=True)
    assert (late.markers, late.causes) == (None, (UNREAD,))


def test_a_picture_in_passing_is_looked_at_when_none_of_a_camera_that_stands_comes():
    chooser_ = chooser(stands=False)
    chooser_.take(picture(5.0), NOW)
    assert chooser_.next(NOW, is_detected=False) is None
    chosen = chooser_.next(NOW + STANDING_PATIENCE, is_detected=False)
    assert (chosen.viewpoint, chosen.causes) == (None, ())
    chooser_.take(picture(50.0), NOW + 9.0)
    unknown = chooser_.next(NOW + 9.0 + STANDING_PATIENCE, is_detected=False)
    assert unknown.causes == (NO_POSE,), 'nobody told where the camera was then'


def test_a_picture_that_came_twice_counts_once_and_a_shared_stamp_tells_no_markers():
    chooser_, seen = chooser(), SeenMarker(14, 0.2, None, NOWHERE, NOWHERE)
    chooser_.take(picture(5.0, b'1'), NOW)
    chooser_.take(picture(5.0, b'1'), NOW)
    chooser_.take_markers(5.0, (seen,))
    assert chooser_.next(NOW, is_detected=False).markers == (seen,)
    chooser_.take(picture(5.0, b'2'), NOW + PICTURE_PERIOD)
    assert chooser_.next(NOW + PICTURE_PERIOD, is_detected=False).markers is None


def test_pictures_that_wait_are_bounded_by_their_bytes():
    chooser_ = chooser(stands=False)
    large = bytes(MOST_HELD_BYTES // 2 + 1)
    for number in range(3):
        chooser_.take(picture(5.0 + number, large + str(number).encode()), NOW)
    chosen = chooser_.next(NOW + STANDING_PATIENCE, is_detected=False)
    assert chosen.taken == 7.0
