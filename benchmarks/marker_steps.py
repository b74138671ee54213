"""What each step of the marker detector earns: the same images with one step left out at a time.

    python benchmarks/marker_steps.py [--quick] [--photos FOLDER]

Images: known markers far away, at flat angles, blurred, in noise and under the lights of
`benchmarks/perception.py`; images of other dictionaries' markers; and real photographs where there
are some. `found` counts markers, `wrong` ids that are not there, `corners` the error of the corners
in pixels (median and 95th percentile). Times are processor time, all steps in turn on each image.
The table stands in the library's README.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

for variable in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS'):
    os.environ.setdefault(variable, '1')
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import cv2
import numpy as np

from benchmarks.perception import (
    CAMERA,
    LIGHTS,
    SHARP,
    indoors,
    panel,
    scene,
    under_light,
)
from benchmarks.photographs import photographs_in
from benchmarks.sizes import sized_parser
from benchmarks.tables import table
from marker_detection.cell_differences import CellReadings
from marker_detection.decoding import MarkerReader
from marker_detection.detector import DetectorSettings, MarkerDetector
from marker_detection.dictionaries import dictionary_named
from marker_detection.edge_fit import EdgeFit, SharpEdges
from marker_detection.other_families import OtherFamilies
from marker_detection.preprocessing import PreparedImage, grey_of
from marker_detection.template_fit import TemplateFit
from marker_detection.testing.marker_scene import ImageArray, Panel, corners_in_image

FOREIGN = (
    ('DICT_APRILTAG_36h11', 561),
    ('DICT_ARUCO_MIP_36h12', 85),
    ('DICT_ARUCO_MIP_36h12', 184),
    ('DICT_6X6_1000', 814),
)
Shown = tuple[ImageArray, list[Panel]]


def _unread(reader: MarkerReader, pyramid: Any, homographies: Any) -> CellReadings:
    """Read no cells: everything is matched."""
    read = _read_cells(reader, pyramid, homographies)
    return read._replace(error=np.full_like(read.error, np.inf))


_read_cells = MarkerReader.read_cells


def _not_prepared(image: ImageArray) -> PreparedImage:
    grey = grey_of(image)
    return PreparedImage(grey, grey, 0.0)


def _left_out(target: Any, name: str, instead: Any) -> Callable[[], AbstractContextManager[Any]]:
    return lambda: patch.object(target, name, instead)


STEPS: dict[str, tuple[DetectorSettings, Callable[[], AbstractContextManager[Any]]]] = {
    'all steps': (DetectorSettings(), nullcontext),
    'stretching, smoothing': (
        DetectorSettings(),
        lambda: patch('marker_detection.detector.prepare', _not_prepared),
    ),
    'neighbourhoods of 31 and 5 pixels': (DetectorSettings(windows=(15,)), nullcontext),
    'closing gaps in borders': (DetectorSettings(bridges=()), nullcontext),
    'EdgeFit': (
        DetectorSettings(),
        _left_out(EdgeFit, 'fitted', lambda _self, _pyramid, quads: quads),
    ),
    'reading cells by differences': (
        DetectorSettings(),
        _left_out(MarkerReader, 'read_cells', _unread),
    ),
    'matching blurred codes': (
        DetectorSettings(),
        _left_out(MarkerReader, 'read', lambda *_: None),
    ),
    'aligning with the image': (
        DetectorSettings(),
        _left_out(TemplateFit, 'refine', lambda _self, _pyramid, homographies, *_: homographies),
    ),
    'stronger blurs': (
        DetectorSettings(),
        lambda: patch('marker_detection.decoding._STRONGER_BLURS', np.zeros((0, 2))),
    ),
    'corners in the whole image': (
        DetectorSettings(),
        _left_out(SharpEdges, 'followed', lambda _self, _pyramid, quads: quads),
    ),
    'other dictionaries': (
        DetectorSettings(),
        _left_out(OtherFamilies, 'explain_better', lambda *args: np.zeros(len(args[-1]), bool)),
    ),
}
"""Steps, and how a detector goes on without each."""


@dataclass
class Result:
    """What a detector without one step did."""

    found: int = 0
    wrong: int = 0
    foreign: int = 0
    photographs: int = 0
    seconds: float = 0.0
    errors: list[float] = field(default_factory=list)


def rendered(samples: int) -> Iterator[Shown]:
    """Yield images of one known marker each."""
    for index in range(samples):
        generator = np.random.default_rng([11, index])
        for distance, degrees in ((7, 0), (8, 30), (5, 60), (2, 75), (3, 80)):
            shown = [panel(distance, degrees, generator)]
            yield scene(shown, indoors(generator), SHARP, generator), shown
        changes: tuple[dict[str, Any], ...] = (
            {'blur': 2.4},
            {'motion': 8.0},
            {'noise': 40.0},
            {'light': 0.04},
        )
        for change in changes:
            shown = [panel(3, 30, generator)]
            yield scene(shown, indoors(generator), replace(SHARP, **change), generator), shown
        for light in LIGHTS:
            image, one = under_light(light, index)
            yield image, [one]


def foreign(samples: int) -> Iterator[ImageArray]:
    """Yield images of other dictionaries' markers that look like one of ours."""
    for index in range(samples):
        for name, marker_id in FOREIGN:
            generator = np.random.default_rng([12, index, marker_id])
            shown = [
                replace(
                    panel(generator.uniform(1, 4), generator.uniform(0, 60), generator),
                    marker_id=marker_id,
                )
            ]
            yield scene(shown, indoors(generator), SHARP, generator, dictionary_named(name))


def main() -> int:
    """Measure and print."""
    parser = sized_parser(__doc__, quick='fewer images')
    parser.add_argument('--photos', type=Path, default=os.environ.get('MARKER_PHOTOS'))
    options = parser.parse_args()
    cv2.setNumThreads(1)
    samples = options.size.of(12, 2, 1)
    results = {name: Result() for name in STEPS}
    detectors: dict[tuple[str, str], MarkerDetector] = {}

    def detect(step: str, image: ImageArray, dictionary: str = 'DICT_5X5_100') -> Any:
        settings, without = STEPS[step]
        key = step, dictionary
        if key not in detectors:
            detectors[key] = MarkerDetector(replace(settings, dictionary=dictionary))
        with without():
            start = time.thread_time()
            found = detectors[key].detect(image)
            results[step].seconds += time.thread_time() - start
        return found

    images = 0
    for image, panels in rendered(samples):
        images += 1
        truths = {each.marker_id: corners_in_image(each, CAMERA) for each in panels}
        for step, result in results.items():
            for each in detect(step, image):
                if each.marker_id not in truths:
                    result.wrong += 1
                    continue
                result.found += 1
                apart = each.corners - truths[each.marker_id]
                result.errors += np.linalg.norm(apart, axis=1).tolist()
    for result in results.values():
        result.seconds /= images
    per_image = {step: result.seconds for step, result in results.items()}
    others = 0
    for image in foreign(3 * samples):
        others += 1
        for step, result in results.items():
            result.foreign += len(detect(step, image))
    listed = 0
    photos = options.photos
    if photos is not None and (Path(photos) / 'markers.json').exists():
        for photograph in photographs_in(Path(photos)):
            listed += len(photograph.markers)
            for step, result in results.items():
                found = detect(step, photograph.image, photograph.dictionary)
                pairs = photograph.listed([(each.marker_id, each.corners) for each in found])
                result.photographs += sum(index is not None for index in pairs)
    rows = [
        [
            'without',
            f'found of {images}',
            'wrong',
            f'wrong of {others} others',
            f'photographs, of {listed}' if listed else 'photographs',
            'corners px',
            '95 %',
            'ms',
        ]
    ]
    for step, result in results.items():
        errors = result.errors or [math.nan]
        rows.append(
            [
                '(nothing)' if step == 'all steps' else step,
                str(result.found),
                str(result.wrong),
                str(result.foreign),
                str(result.photographs) if listed else '-',
                f'{np.median(errors):.2f}',
                f'{np.quantile(errors, 0.95):.2f}',
                f'{1e3 * per_image[step]:.1f}',
            ]
        )
    print(table(rows))
    return 0


if __name__ == '__main__':
    sys.exit(main())
