"""Known ids in rendered images, and images that are no images."""

from __future__ import annotations

import math
import tracemalloc
from typing import Any

import cv2
import numpy as np
import pytest

from marker_detection.camera_model import CameraModel
from marker_detection.candidates import Mask, distinct, quads_around
from marker_detection.detector import DetectorSettings, MarkerDetector
from marker_detection.dictionaries import DICTIONARY_NAMES, dictionary_named
from marker_detection.testing.marker_scene import (
    Degradation,
    Glare,
    Panel,
    Shadow,
    corners_in_image,
    image_of,
)

from .backdrops import BACKDROPS, backdrop_of
from .drawn_codes import SQUARE

CAMERA = CameraModel.from_field_of_view(640, 480, math.radians(60))
DICTIONARY = dictionary_named('DICT_5X5_100')
KNOWN = frozenset(range(11, 18))
DETECTOR = MarkerDetector(DetectorSettings(known_ids=KNOWN))
BUSY = ['letters', 'leaves', 'bricks', 'boards']
"""Backdrops that were once taken for markers, if unknown ones."""


def seen(panels, degradation=None, backdrop='clouds', seed=1, dictionary=DICTIONARY):
    generator = np.random.default_rng(seed)
    scene = backdrop_of(backdrop, CAMERA, generator)
    return image_of(
        panels, CAMERA, dictionary, scene, degradation or Degradation(blur=0.8), generator
    )


def found(detections):
    return {each.marker_id: each for each in detections}


@pytest.mark.parametrize(
    ('distance', 'degrees'),
    [
        (0.4, 20),
        (1, 60),
        (2, 0),
        (2, 70),
        (3, 75),
        (5, 45),
        (5, 65),
        (7, 0),
        (7, 45),
        (9, 0),
        (9, 30),
    ],
)
def test_marker_is_found_where_it_is(distance, degrees):
    panel = Panel(14, distance, math.radians(degrees), roll=0.05, offset=(12.3, -20.7))
    detections = found(DETECTOR.detect(seen([panel])))
    assert set(detections) == {14}
    truth = corners_in_image(panel, CAMERA)
    assert np.abs(detections[14].corners - truth).max() < 0.6
    assert 0.0 < detections[14].confidence <= 1.0


def test_marker_whose_border_is_thinner_than_a_pixel_is_found():
    panel = Panel(14, 2.5, math.radians(80), roll=0.05, offset=(12.3, -20.7))
    images = [seen([panel], seed=seed) for seed in range(10)]
    assert sum(set(found(DETECTOR.detect(image))) == {14} for image in images) >= 8


@pytest.mark.parametrize(
    'degradation',
    [
        Degradation(blur=2.0),
        Degradation(motion=6.0, direction=0.3),
        Degradation(light=0.06),
        Degradation(light=1.8),
        Degradation(light=0.7, slope=0.7),
        Degradation(noise=30.0),
    ],
    ids=['blurred', 'moving', 'dark', 'bright', 'uneven', 'noisy'],
)
def test_marker_is_found_in_a_poor_image(degradation):
    panel = Panel(16, 3.0, 0.4, offset=(-40.0, 30.0))
    assert set(found(DETECTOR.detect(seen([panel], degradation)))) == {16}


@pytest.mark.parametrize('quarter', range(4))
def test_corners_begin_at_the_markers_own_top_left(quarter):
    panel = Panel(11, 2.0, 0.3, roll=quarter * math.pi / 2 + 0.1)
    detection = found(DETECTOR.detect(seen([panel])))[11]
    assert np.abs(detection.corners - corners_in_image(panel, CAMERA)).max() < 0.5


def test_all_markers_of_a_image_are_found_also_two_of_one_id():
    panels = [Panel(11 + k % 4, 2.0 + k * 0.4, offset=(-240.0 + 80 * k, 40.0)) for k in range(7)]
    ids = sorted(each.marker_id for each in DETECTOR.detect(seen(panels)))
    assert ids == sorted(panel.marker_id for panel in panels)


def test_other_ids_are_told_apart_from_known_ones():
    panels = [Panel(13, 2.0, offset=(-90.0, 0.0)), Panel(70, 2.0, offset=(90.0, 0.0))]
    detections = found(DETECTOR.detect(seen(panels)))
    assert detections[13].known
    assert not detections[70].known


@pytest.mark.parametrize('backdrop', sorted({*BACKDROPS} - {*BUSY}))
def test_no_known_id_is_seen_where_there_is_none(backdrop):
    for seed in range(4):
        assert not [each for each in DETECTOR.detect(seen([], None, backdrop, seed)) if each.known]


@pytest.mark.parametrize('other', ['DICT_4X4_50', 'DICT_6X6_50', 'DICT_APRILTAG_36h11'])
def test_markers_of_another_dictionary_are_not_known_ids(other):
    dictionary = dictionary_named(other)
    for marker_id in range(6):
        image = seen([Panel(marker_id, 2.5, 0.3)], seed=marker_id, dictionary=dictionary)
        assert not [each for each in DETECTOR.detect(image) if each.known]


def test_colour_and_grey_images_show_the_same():
    grey = seen([Panel(15, 3.0, 0.5)])
    colour = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    assert [each.marker_id for each in DETECTOR.detect(colour)] == [15]


def test_marker_expected_from_the_image_before_is_found_again():
    panel = Panel(12, 4.0, 0.4)
    truth = corners_in_image(panel, CAMERA)
    assert set(found(DETECTOR.detect(seen([panel]), [truth + 1.0]))) == {12}


@pytest.mark.parametrize('name', DICTIONARY_NAMES)
def test_every_dictionary_of_opencv_is_read(name):
    dictionary = dictionary_named(name)
    detector = MarkerDetector(DetectorSettings(dictionary=name))
    marker_id = 5
    image = seen([Panel(marker_id, 1.5, 0.4)], dictionary=dictionary)
    assert marker_id in found(detector.detect(image))


@pytest.mark.parametrize(
    ('image', 'reason'),
    [
        (np.zeros((0, 0), np.uint8), '0x0'),
        (np.zeros((4, 4, 2), np.uint8), '4x4x2'),
        (np.zeros((4, 4), np.uint16), 'uint16'),
        (np.zeros((4, 4), np.float64), 'float64'),
    ],
)
def test_what_is_no_image_is_refused_in_one_line(image, reason):
    with pytest.raises(ValueError, match=reason) as error:
        DETECTOR.detect(image)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('shape', [(1, 1), (2, 700), (5, 5), (30, 30)])
@pytest.mark.parametrize('level', [0, 255])
def test_tiny_and_empty_images_show_nothing(shape, level):
    assert DETECTOR.detect(np.full(shape, level, np.uint8)) == []


@pytest.mark.parametrize(
    ('options', 'reason'),
    [
        ({'dictionary': 'DICT_9X9'}, "unknown marker dictionary 'DICT_9X9'"),
        (
            {'known_ids': frozenset({100})},
            'known id 100 is not in the dictionary, expected 0 to 99',
        ),
        ({'windows': (4,)}, 'windows must be odd'),
        ({'bridges': (1,)}, 'bridges must be at least 2'),
    ],
)
def test_settings_that_cannot_be_are_refused(options, reason):
    with pytest.raises(ValueError, match=reason):
        MarkerDetector(DetectorSettings(**options))


def test_marker_that_leaves_the_image_is_read_or_not_but_never_ends_the_detector():
    sheet = np.full((300, 300), 220, np.uint8)
    sheet[100:170, 100:170] = DICTIONARY.generateImageMarker(7, 70)
    found = 0
    for shift in range(2, 110, 4):
        for image in (sheet[:, shift:], sheet[shift:], sheet[shift:, shift:]):
            found += [each.marker_id for each in DETECTOR.detect(image)] == [7]
    # whole with two pixels around it, it is read; cut, it is not
    assert found >= 3 * 22


def test_crowd_of_markers_is_read_whole_and_a_bound_is_told():
    image = np.full((800, 1000), 220, np.uint8)
    for index in range(80):
        row, column = divmod(index, 10)
        top, left = 20 + row * 96, 20 + column * 96
        image[top : top + 70, left : left + 70] = DICTIONARY.generateImageMarker(index, 70)
    assert sorted(each.marker_id for each in DETECTOR.detect(image)) == list(range(80))
    assert DETECTOR.left_out == 0
    bounded = MarkerDetector(DetectorSettings(max_candidates=10))
    assert len(bounded.detect(image)) == 10
    assert bounded.left_out >= 70


def test_crowd_of_blurred_markers_of_fourteen_pixels_is_read():
    sheet = np.full((1200, 1800), 225, np.uint8)
    for index in range(96):
        row, column = divmod(index, 12)
        top, left = 50 + row * 140, 50 + column * 140
        sheet[top : top + 84, left : left + 84] = DICTIONARY.generateImageMarker(index, 84)
    small = cv2.GaussianBlur(
        cv2.resize(sheet, (300, 200), interpolation=cv2.INTER_AREA), (0, 0), 0.7
    )
    found = [each.marker_id for each in DETECTOR.detect(small)]
    assert set(found) <= set(range(96))
    assert len(found) == len(set(found)) >= 93


def test_any_image_is_looked_at_without_an_error_of_opencv():
    generator = np.random.default_rng(11)
    marker = DICTIONARY.generateImageMarker(3, 63)
    for _ in range(300):
        height, width = generator.integers(1, 90, 2)
        image = generator.integers(0, 256, (height, width), dtype=np.uint8)
        if generator.random() < 0.7:
            image[:] = generator.integers(0, 256)
            top, left = generator.integers(-60, 80, 2)
            sheet = np.full((300, 300), image[0, 0], np.uint8)
            sheet[100 + top : 163 + top, 100 + left : 163 + left] = marker
            image = sheet[100 : 100 + height, 100 : 100 + width]
        for detection in DETECTOR.detect(image, [generator.normal(0, 1e6, (4, 2))]):
            assert np.isfinite(detection.corners).all()


def test_marker_two_pixels_from_the_edge_is_read_whatever_its_id():
    image = np.full((160, 160), 220, np.uint8)
    for marker_id in range(100):
        image[2:72, 2:72] = DICTIONARY.generateImageMarker(marker_id, 70)
        assert [each.marker_id for each in DETECTOR.detect(image)] == [marker_id]


@pytest.mark.parametrize('degrees', [14, 18])
@pytest.mark.parametrize('above', [0.05, 0.2, 0.4])
def test_corner_in_the_last_row_of_pixels_is_found_where_it_is(above, degrees):
    drop = 0.0
    for _ in range(4):
        panel = Panel(14, 1.0, roll=math.radians(degrees), offset=(0.0, drop))
        truth = corners_in_image(panel, CAMERA)
        drop += 479.0 - above - truth[:, 1].max()
    lowest = truth[:, 1].argmax()
    assert 478.5 < truth[lowest, 1] < 479.1
    seen_at = found(DETECTOR.detect(seen([panel])))[14].corners[lowest]
    assert seen_at[1] == pytest.approx(truth[lowest, 1], abs=0.25)


def lit(degradation, **changes):
    return seen([Panel(14, 2.0, 0.3, roll=0.1, **changes)], degradation)


MIDDLE = tuple(corners_in_image(Panel(14, 2.0), CAMERA).mean(axis=0))


@pytest.mark.parametrize(
    ('degradation', 'changes'),
    [
        (Degradation(shadows=(Shadow(MIDDLE, 0.4),)), {}),
        (Degradation(shadows=(Shadow(MIDDLE, 2.1, 0.3),)), {}),
        (Degradation(shadows=(Shadow(MIDDLE, 4.0, 0.5, 4.0),)), {}),
        (Degradation(glares=(Glare(MIDDLE, 8.0),)), {}),
        (Degradation(glares=(Glare(MIDDLE, 12.0),)), {}),
        (Degradation(vignette=0.8, light=0.5), {}),
        (Degradation(shutter=50.0), {}),
        (Degradation(jpeg=15), {}),
        (Degradation(), {'curl': 0.9}),
        (Degradation(motion=4.0, noise=6.0), {}),
    ],
)
def test_marker_is_read_under_real_light(degradation, changes):
    assert set(found(DETECTOR.detect(lit(degradation, **changes)))) == {14}


def test_thin_margin_on_a_dark_wall_is_enough():
    for margin in (0.2, 0.3, 1.0):
        image = seen([Panel(14, 2.0, 0.2, margin=margin)], backdrop='dark')
        assert set(found(DETECTOR.detect(image))) == {14}


@pytest.mark.parametrize('distance', [2.0, 7.0])
def test_black_and_white_may_differ_by_few_levels(distance):
    image = seen([Panel(14, distance, 0.2)], Degradation(blur=0.8, noise=0.0), 'plain')
    faint = np.rint(180.0 + 0.05 * image).astype(np.uint8)
    assert set(found(DETECTOR.detect(faint))) == {14}


def test_grey_code_without_a_margin_before_bright_light_is_read():
    marker = cv2.aruco.generateImageMarker(DICTIONARY, 14, 56)
    image = np.full((160, 160), 255, np.uint8)
    image[50:106, 50:106] = marker // 4
    assert [each.marker_id for each in DETECTOR.detect(image)] == [14]


@pytest.mark.parametrize('backdrop', BUSY)
def test_busy_textures_show_no_marker(backdrop):
    for seed in range(5):
        assert not DETECTOR.detect(seen([], backdrop=backdrop, seed=seed))


def test_margin_may_be_cut_by_the_edge_of_the_image():
    marker = cv2.aruco.generateImageMarker(DICTIONARY, 14, 56)
    image = np.full((120, 160), 200, np.uint8)
    image[40:96, 0:56] = marker
    assert [each.marker_id for each in DETECTOR.detect(image)] == [14]


@pytest.mark.parametrize('crowd', [0, 30], ids=['alone', 'in a crowd'])
def test_dark_thing_that_touches_the_border_hides_no_marker(crowd):
    marker = cv2.aruco.generateImageMarker(DICTIONARY, 14, 42)
    image = np.full((160 + 40 * crowd, 160 + 40 * crowd), 215, np.uint8)
    for row, column in np.ndindex(crowd, crowd):
        image[170 + 40 * row :, 20 + 40 * column :][:14, :14] = 20
    image[60:102, 60:102] = marker
    cv2.line(image, (101, 61), (108, 57), 10, 3)
    assert [each.marker_id for each in DETECTOR.detect(image)] == [14]


@pytest.mark.parametrize('dictionary', ['DICT_4X4_50', 'DICT_4X4_250'])
def test_text_is_no_marker_of_a_dictionary_with_few_spare_bits(dictionary):
    detector = MarkerDetector(DetectorSettings(dictionary))
    for scale in (0.4, 0.5, 0.6, 0.8):
        for font in (cv2.FONT_HERSHEY_SIMPLEX, cv2.FONT_HERSHEY_DUPLEX):
            image = np.full((240, 640), 215, np.uint8)
            for row, text in enumerate(('ABCDEFGHIJKLM', 'NOPQRSTUVWXYZ', '0123456789', 'BERISE')):
                cv2.putText(image, text, (10, 50 + 50 * row), font, scale, 90, 2, cv2.LINE_AA)
            assert not detector.detect(cv2.GaussianBlur(image, (0, 0), 0.8))


def test_drawn_outline_on_bright_paper_is_no_marker_in_a_reflection():
    detector = MarkerDetector(DetectorSettings('DICT_5X5_1000'))
    generator = np.random.default_rng(2)
    for _ in range(60):
        image = np.full((90, 110), 255, np.uint8)
        corners = np.array([[30, 30], [75, 30], [75, 60], [30, 60]]) + generator.integers(
            -4, 5, (4, 2)
        )
        cv2.polylines(image, [corners], True, 20, 3, cv2.LINE_AA)
        compressed = cv2.imencode('.jpg', image, [cv2.IMWRITE_JPEG_QUALITY, 60])[1]
        unpacked: Any = cv2.imdecode(compressed, cv2.IMREAD_GRAYSCALE)
        assert not detector.detect(unpacked)


def test_white_field_of_six_megapixels_in_a_dark_frame_overflows_nothing():
    image = np.full((2600, 2600), 20, np.uint8)
    image[20:-20, 20:-20] = 230
    with np.errstate(all='raise', under='ignore'):
        assert MarkerDetector().detect(image) == []


def test_square_with_two_covered_corners_is_an_outline_in_crowds_too():
    mask = np.zeros((160, 160), np.uint8)
    mask[10:50, 100:140] = mask[60:100, 100:140] = mask[100:140, 10:50] = 255
    cv2.fillPoly(mask, [np.array([[10, 100], [36, 100], [10, 126]])], 0)
    mask[120:140, 35:50] = 0
    middles = quads_around([Mask(mask)], limit=1).mean(axis=1)
    assert (np.linalg.norm(middles - (30.0, 120.0), axis=1) < 5.0).any()


def test_outlines_of_one_marker_are_one_in_crowds_too():
    generator = np.random.default_rng(3)
    middles = np.stack(np.meshgrid(np.arange(60.0), np.arange(50.0)), axis=-1).reshape(-1, 1, 2)
    quads = 12.0 * middles + 4.0 * SQUARE
    near = quads + generator.uniform(-0.5, 0.5, (len(quads), 1, 2))
    inside = 12.0 * middles + 1.5 * SQUARE
    tracemalloc.start()
    kept = distinct(np.concatenate([quads, near, inside]), 2.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert kept.tolist() == [*range(len(quads)), *range(2 * len(quads), 3 * len(quads))]
    assert peak < 20e6


@pytest.mark.parametrize('margin', [0.09, 0.13, 0.2])
def test_white_margin_of_a_pixel_or_two_on_a_black_wall_is_enough(margin):
    # cells of eleven pixels
    panel = Panel(14, 1.45, margin=margin, roll=0.1)
    wall = np.full((480, 640), 10.0, np.float32)
    generator = np.random.default_rng(1)
    image = image_of([panel], CAMERA, DICTIONARY, wall, Degradation(blur=0.5), generator)
    assert set(found(DETECTOR.detect(image))) == {14}


# At the edge of the image.


def beside_the_edge(marker_id, side, gap, turns, shape, wall=220, frame=None):
    """Return an image of a marker so many pixels before its edge, and the marker's corners."""
    # beside the lower edge, then turned by quarters
    height, width = shape if turns in (0, 2) else shape[::-1]
    image = np.full((height, width), wall, np.uint8)
    top, left = height - gap - side, (width - side) // 3
    cell = side // 7
    image[max(0, top - cell) :, left - cell : left + side + cell] = 220
    marker = DICTIONARY.generateImageMarker(marker_id, side)
    image[top : top + side, left : left + side] = marker[: height - top]
    if frame is not None:
        image[-1:] = frame
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    corners = side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    corners = np.add(corners, (left - 0.5, top - 0.5))
    for _ in range(turns):
        image = np.asarray(cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE), np.uint8)
        corners = np.stack([image.shape[1] - 1.0 - corners[:, 1], corners[:, 0]], axis=1)
    return image, corners


@pytest.mark.parametrize('turns', range(4))
@pytest.mark.parametrize('shape', [(300, 400), (333, 417)])
def test_corners_are_right_beside_the_edge_of_the_image(shape, turns):
    for side in (35, 70, 126, 168, 210):
        for gap in (1, 2, 3, 8):
            image, truth = beside_the_edge(14, side, gap, turns, shape)
            (seen_at,) = DETECTOR.detect(image)
            assert seen_at.marker_id == 14
            error = np.linalg.norm(seen_at.corners - truth, axis=1).max()
            assert error < 1.0, (side, gap)
            assert seen_at.confidence > 0.8


@pytest.mark.parametrize('wall', [60, 130])
@pytest.mark.parametrize('frame', [None, 0, 255])
def test_neither_wall_nor_frame_beside_the_edge_moves_a_corner(wall, frame):
    for side, gap in ((63, 4), (105, 5), (168, 3), (210, 4)):
        for turns, marker_id in enumerate((3, 22, 57, 91)):
            image, truth = beside_the_edge(marker_id, side, gap, turns, (333, 417), wall, frame)
            (seen_at,) = DETECTOR.detect(image)
            assert seen_at.marker_id == marker_id
            error = np.linalg.norm(seen_at.corners - truth, axis=1).max()
            assert error < 1.0, (side, gap, turns)


@pytest.mark.parametrize('turns', range(4))
def test_corners_beyond_the_edge_of_the_image_are_those_of_the_whole_marker(turns):
    for side in (70, 126, 168):
        whole = DETECTOR.detect(beside_the_edge(14, side, 8, turns, (300, 400))[0])[0].confidence
        for gap in (0, -1, -2):
            image, truth = beside_the_edge(14, side, gap, turns, (300, 400))
            (seen_at,) = DETECTOR.detect(image)
            error = np.linalg.norm(seen_at.corners - truth, axis=1).max()
            assert error < 0.03 * side
            # who has not seen a side is less sure
            assert seen_at.confidence < whole - 0.08


@pytest.mark.parametrize('seed', range(3))
def test_marker_whose_blurred_cells_show_nothing_is_matched_as_a_whole(seed):
    image = seen([Panel(14, 6.0, 0.3, roll=0.1)], Degradation(blur=2.0), 'plain', seed)
    (detection,) = DETECTOR.detect(image)
    assert detection.marker_id == 14
    truth = corners_in_image(Panel(14, 6.0, 0.3, roll=0.1), CAMERA)
    assert np.linalg.norm(detection.corners - truth, axis=1).max() < 1.5


def test_corners_of_a_marker_of_ten_pixels_are_not_drawn_outwards():
    errors = []
    for marker_id in range(20):
        # sixteen times as large, between pixels, with a margin of a cell
        side, left, top = 154, 320 + 13 * marker_id, 300 + 7 * marker_id
        sheet = np.full((800, 960), 90, np.uint8)
        sheet[top - 22 : top + side + 22, left - 22 : left + side + 22] = 220
        marker = DICTIONARY.generateImageMarker(marker_id, side)
        sheet[top : top + side, left : left + side] = np.where(marker > 0, 220, 20)
        image = cv2.resize(sheet, (60, 50), interpolation=cv2.INTER_AREA)
        (seen_at,) = DETECTOR.detect(np.asarray(cv2.GaussianBlur(image, (0, 0), 0.6), np.uint8))
        assert seen_at.marker_id == marker_id
        truth = np.add(side * np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), (left, top)) / 16 - 0.5
        errors.append(np.linalg.norm(seen_at.corners - truth, axis=1).max())
    assert max(errors) < 0.45


@pytest.mark.parametrize(('distance', 'degrees'), [(1.0, 0), (2.0, 50), (4.0, 20), (6.0, 0)])
def test_an_inverted_marker_is_read_where_that_is_asked_for(distance, degrees):
    panel = Panel(12, distance, math.radians(degrees))
    plain = seen([panel])
    inverted = np.asarray(255 - plain, np.uint8)
    assert 12 not in found(DETECTOR.detect(inverted))
    both = MarkerDetector(DetectorSettings(known_ids=KNOWN, inverted=True))
    truth = found(DETECTOR.detect(plain))[12]
    for image in (inverted, plain):
        assert found(both.detect(image))[12].corners == pytest.approx(truth.corners, abs=0.3)


def test_plain_and_inverted_markers_of_one_image_are_both_read():
    left, right = Panel(12, 2.0, 0.0, offset=(-150, 0)), Panel(15, 2.0, 0.0, offset=(150, 0))
    image = seen([left, right])
    image[:, 320:] = 255 - image[:, 320:]
    detector = MarkerDetector(DetectorSettings(known_ids=KNOWN, inverted=True))
    assert set(found(detector.detect(image))) == {12, 15}


@pytest.mark.parametrize('backdrop', BUSY)
def test_busy_textures_show_no_inverted_marker(backdrop):
    detector = MarkerDetector(DetectorSettings(known_ids=KNOWN, inverted=True))
    assert not detector.detect(seen([], backdrop=backdrop))
