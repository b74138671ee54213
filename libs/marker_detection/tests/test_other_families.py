"""Markers of other dictionaries are no markers of ours, and are told by their name."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from marker_detection import (
    CameraModel,
    DetectorSettings,
    MarkerDetector,
    MarkerStream,
    StreamSettings,
    dictionary_named,
)
from marker_detection.testing.marker_scene import Degradation, Panel, image_of

CAMERA = CameraModel.from_field_of_view(640, 480, math.radians(60))
DETECTOR = MarkerDetector(DetectorSettings('DICT_5X5_100'))


def scene(name: str, ids: list[int], seed: int) -> np.ndarray:
    """Return an image of up to three markers at 1 to 3 m."""
    generator = np.random.default_rng(seed)
    panels = [
        Panel(
            marker_id,
            float(generator.uniform(1.0, 3.0)),
            float(generator.uniform(-0.8, 0.8)),
            offset=(200.0 * (place - 1), float(generator.uniform(-80, 80))),
        )
        for place, marker_id in enumerate(ids)
    ]
    wall = np.full((480, 640), 170.0, np.float32)
    return image_of(panels, CAMERA, dictionary_named(name), wall, Degradation(blur=0.8), generator)


@pytest.mark.parametrize(
    ('name', 'marker_id'),
    # each was read as one of DICT_5X5_100 in every second view: as 80, 97, 46, 45
    [
        ('DICT_APRILTAG_36h11', 561),
        ('DICT_ARUCO_MIP_36h12', 85),
        ('DICT_ARUCO_MIP_36h12', 184),
        ('DICT_6X6_1000', 814),
    ],
)
def test_marker_that_looks_like_one_of_ours_is_not_read_as_it(name: str, marker_id: int) -> None:
    for seed in range(3):
        assert DETECTOR.detect(scene(name, [marker_id] * 3, seed)) == []


def test_marker_of_ours_is_no_other_family_s() -> None:
    image = scene('DICT_5X5_100', [3, 46, 80], 1)
    assert sorted(each.marker_id for each in DETECTOR.detect(image)) == [3, 46, 80]
    assert DETECTOR.other_families(image) == {}


@pytest.mark.parametrize(
    ('name', 'ids'),
    [
        ('DICT_4X4_50', [3, 7, 49]),
        ('DICT_6X6_250', [3, 120, 249]),
        ('DICT_APRILTAG_36h11', [3, 120, 561]),
        ('DICT_5X5_250', [130, 140, 249]),
    ],
)
def test_scene_of_another_dictionary_is_told_by_its_name(name: str, ids: list[int]) -> None:
    image = scene(name, ids, 2)
    assert DETECTOR.other_families(image) == {name: ids}
    stream = MarkerStream(StreamSettings(DetectorSettings('DICT_5X5_100')))
    for _ in range(4):
        stream.look(image, None)
    assert stream.other_family is None
    stream.look(image, None)
    assert stream.other_family == name
    stream.look(scene('DICT_5X5_100', [3], 1), None)
    assert stream.other_family is None


def test_wall_without_markers_has_no_other_family() -> None:
    grey = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (480, 640)), (0, 0), 6.0)
    image = cv2.normalize(grey, None, 0, 255, cv2.NORM_MINMAX).astype(np.uint8)
    assert DETECTOR.other_families(image) == {}
