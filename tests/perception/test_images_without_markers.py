"""No id is read where there is no marker."""

from __future__ import annotations

from benchmarks.perception import without_markers
from marker_detection.detector import DetectorSettings, MarkerDetector


def test_markers_of_another_dictionary_are_not_read_as_ids():
    detector = MarkerDetector(DetectorSettings('DICT_5X5_100', frozenset(range(11, 18))))
    # each was read as an id once
    for kind, image in without_markers((458, 539, 557, 728, 2771, 8900)):
        assert kind == 'other dictionaries'
        assert detector.detect(image) == []
