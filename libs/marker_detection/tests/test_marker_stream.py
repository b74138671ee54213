"""A marker is believed once enough images agree."""

from __future__ import annotations

import random
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from marker_detection.camera_model import CameraModel
from marker_detection.detector import DetectorSettings
from marker_detection.dictionaries import dictionary_named
from marker_detection.marker_stream import (
    Confirmation,
    MarkerStream,
    Statistics,
    StreamSettings,
    sizes_expected,
    sizes_from,
)


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


@pytest.mark.parametrize('needed', [1, 2, 5])
def test_ids_are_confirmed_by_so_many_of_twice_as_many_images(needed):
    generator = random.Random(needed)
    confirmation = Confirmation(needed, needed + 1, confirmed=[99])
    shown: list[dict[int, bool]] = []
    confirmed = {99}
    for _ in range(300):
        image = {one: one < 3 for one in range(6) if generator.random() < 0.15 * needed}
        shown.append(image)
        expected = []
        for one, known in image.items():
            least = needed if known else needed + 1
            if (
                sum(one in earlier for earlier in shown[-2 * least :]) >= least
                and one not in confirmed
            ):
                expected.append(one)
        confirmed.update(expected)
        assert confirmation.image(image.items()) == expected
        assert confirmation.confirmed == confirmed


@pytest.mark.parametrize(
    ('entry', 'words'),
    [
        ('14', "'14' is not 'id:size in metres', such as '14:0.3'"),
        ('x:0.3', "'x:0.3' is not 'id:size in metres', such as '14:0.3'"),
        ('14:', "'14:' is not 'id:size in metres', such as '14:0.3'"),
        ('14:0', "'14:0': a size must be positive"),
        ('14:100', "'14:100': a size must be positive"),
        ('14:nan', "'14:nan': a size must be positive"),
    ],
)
def test_sizes_that_are_none_are_refused(entry, words):
    with pytest.raises(ValueError, match=f'^{re.escape(words)}$'):
        sizes_from(['1:99.9', entry])
    assert sizes_expected(['1:1', entry]) == words
    assert sizes_expected(['1:1']) is None


def test_settings_that_do_not_fit_name_the_parameter():
    with pytest.raises(ValueError, match=r"^marker_dictionary: unknown marker dictionary 'DICT'"):
        StreamSettings(DetectorSettings('DICT'))
    with pytest.raises(ValueError, match=r'^known_ids: known id 100 is not in the dictionary'):
        StreamSettings(DetectorSettings(known_ids=frozenset([3, 100])))


def page(*codes, size=(240, 320)):
    """Return an image of markers, (dictionary, id, left, top) each, drawn by OpenCV."""
    image = np.full(size, 200, np.uint8)
    for name, marker_id, left, top in codes:
        marker = cv2.aruco.generateImageMarker(dictionary_named(name), marker_id, 56)
        image[top : top + 56, left : left + 56] = np.where(marker > 0, 200, 40)
    return image


def test_a_stream_tells_markers_with_size_pose_and_confirmation():
    camera = CameraModel.from_field_of_view(320, 240, 1.0)
    detector = DetectorSettings('DICT_4X4_50', known_ids=frozenset([5]))
    settings = StreamSettings(detector, 0.2, {6: 0.4}, known_frames=1, unknown_frames=2)
    stream = MarkerStream(settings)
    image = page(('DICT_4X4_50', 5, 40, 40), ('DICT_4X4_50', 6, 200, 120))
    first, new = stream.look(image, camera)
    assert (new, stream.confirmed) == ([5], {5})
    sightings = {each.detection.marker_id: each for each in first}
    assert {one: (each.size, each.confirmed) for one, each in sightings.items()} == {
        5: (0.2, True),
        6: (0.4, False),
    }
    distance = camera.matrix[0, 0] * 0.2 / 56
    for one, factor in ((5, 1.0), (6, 2.0)):
        pose = sightings[one].pose
        assert pose is not None
        assert pose.position[2] == pytest.approx(factor * distance, rel=0.02)
    second, new = stream.look(image, None)
    assert new == [6]
    assert {(each.pose, each.confirmed) for each in second} == {(None, True)}
    stream.refuse()
    taken = stream.take_statistics()
    assert (taken.images, taken.refused, taken.left_out, stream.left_out) == (2, 1, 0, 0)
    assert taken.mean_milliseconds == pytest.approx(500.0 * taken.seconds)
    assert 0.0 < taken.seconds < 60.0
    assert stream.take_statistics() == Statistics()
    assert Statistics().mean_milliseconds == 0.0
    stream.adopt(replace(settings, unknown_frames=3))
    assert stream.confirmed == {5, 6}
    stream.adopt(replace(settings, detector=DetectorSettings('DICT_5X5_50')))
    assert stream.confirmed == frozenset()


def test_the_bound_of_an_images_work_is_counted():
    settings = StreamSettings(DetectorSettings('DICT_4X4_50', max_candidates=1))
    stream = MarkerStream(settings)
    image = page(('DICT_4X4_50', 5, 40, 40), ('DICT_4X4_50', 6, 200, 120))
    stream.look(image, None)
    left = stream.left_out
    assert left >= 1
    stream.look(np.full((240, 320), 200, np.uint8), None)
    assert stream.left_out == 0
    assert stream.take_statistics().left_out == left


def test_other_families_are_looked_for_after_some_images_without_a_marker():
    stream = MarkerStream(StreamSettings(DetectorSettings('DICT_4X4_50')))
    blank, ours = page(), page(('DICT_4X4_50', 5, 40, 40))
    others = page(('DICT_6X6_50', 1, 40, 40), ('DICT_6X6_50', 2, 200, 120))
    one = page(('DICT_6X6_50', 1, 40, 40))
    for _ in range(4):
        stream.look(others, None)
    stream.look(ours, None)
    for _ in range(4):
        stream.look(others, None)
        assert stream.other_family is None
    stream.look(others, None)
    assert stream.other_family == 'DICT_6X6_50'
    stream.look(blank, None)
    assert stream.other_family == 'DICT_6X6_50'
    stream.look(ours, None)
    assert stream.other_family is None
    # the first look sees one alone, which may hang anywhere; the next is far off
    for image in (*[one] * 5, *[others] * 44):
        stream.look(image, None)
        assert stream.other_family is None
    stream.look(others, None)
    assert stream.other_family == 'DICT_6X6_50'
