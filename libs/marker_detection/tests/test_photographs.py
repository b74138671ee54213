"""Real photographs, where the environment variable MARKER_PHOTOS names their folder."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from marker_detection import DetectorSettings, MarkerDetector

FOLDER = Path(os.environ.get('MARKER_PHOTOS', ''))
# markers that whoever looks at the photograph sees, and that no detector of the list had read
SEEN_BY_EYE = {
    ('lib-dt-apriltags_test_test_files_test_image_multiple_08.jpg', 58),
    ('lib-dt-apriltags_test_test_files_test_image_multiple_09.jpg', 198),
}


@pytest.mark.skipif(
    not (FOLDER / 'markers.json').is_file(),
    reason='MARKER_PHOTOS names no folder of photographs with markers.json',
)
def test_markers_that_two_detectors_agree_on_are_found_and_no_wrong_one():
    missed, wrong, shown = [], [], 0
    for entry in json.loads((FOLDER / 'markers.json').read_text()):
        detector = MarkerDetector(DetectorSettings(entry['dictionary']))
        seen = {}
        image: Any = cv2.imread(str(FOLDER / entry['file']))
        for each in detector.detect(image):
            seen.setdefault(each.marker_id, []).append(each.corners.mean(axis=0))
        for marker in entry['markers']:
            middles = seen.get(marker['id'], [])
            near = any(np.linalg.norm(middle - marker['centre']) < 15 for middle in middles)
            shown += marker['sure']
            if marker['sure'] and not near:
                missed.append((entry['file'], marker['id']))
        ids = {marker['id'] for marker in entry['markers']}
        wrong += [(entry['file'], marker_id) for marker_id in seen if marker_id not in ids]
    assert not set(wrong) - SEEN_BY_EYE
    assert len(missed) <= 0.03 * shown, missed
