"""A marker is believed once enough images agree."""

from __future__ import annotations

import pytest

from marker_detection.marker_stream import Confirmation, Statistics, sizes_from


def test_known_id_is_confirmed_once_after_its_images():
    confirmation = Confirmation(known_frames=2, unknown_frames=4)
    assert [confirmation.image([(11, True)]) for _ in range(4)] == [[], [11], [], []]
    assert confirmation.confirmed == {11}


def test_other_ids_need_more_images():
    confirmation = Confirmation(known_frames=2, unknown_frames=4)
    assert [confirmation.image([(70, False)]) for _ in range(4)] == [[], [], [], [70]]


def test_half_of_the_images_may_miss_it():
    confirmation = Confirmation(known_frames=3, unknown_frames=3)
    shown = [[(11, True)], [], [(11, True)], [], [(11, True)]]
    assert [confirmation.image(each) for each in shown][-1] == [11]


def test_what_is_seen_too_rarely_is_never_confirmed():
    confirmation = Confirmation(known_frames=2, unknown_frames=2)
    for index in range(40):
        new = confirmation.image([(12, True)] if index % 5 == 0 else [])
        assert not new


def test_sizes_are_read_by_id():
    assert sizes_from(['14:0.3', '15:0.05']) == {14: 0.3, 15: 0.05}


@pytest.mark.parametrize(
    ('statistics', 'in_motion', 'silent'),
    [
        (Statistics(images=1), 0, False),
        (Statistics(), 5, False),
        (Statistics(), 0, True),
        (Statistics(refused=1), 0, False),
    ],
)
def test_an_arm_on_its_way_to_the_next_view_is_no_fault(statistics, in_motion, silent):
    assert statistics.is_silent(in_motion) == silent
