"""Persons found in pictures, and in pictures without any.

.venv/bin/python benchmarks/persons.py --with FOLDER_OR_PICTURE ... --without FOLDER_OR_PICTURE ...

Of 1,486 photographs that were looked at by eye (docs/reference/measurements.md), most are of these
repositories on GitHub, and none is kept here: EliSchwartz/imagenet-sample-images,
dusty-nv/jetson-inference,
open-mmlab/mmpose, magicleap/SuperGluePretrainedNetwork, zillow/zind (perspective views of its
panoramas), EPFL-VILAB/omnidata, baegwangbin/DSINE, ialhashim/DenseDepth, tensorflow/tfjs-models,
CMU-Perceptual-Computing-Lab/openpose, ildoonet/tf-pose-estimation and xingyizhou/CenterNet.

With --crops N, N parts of each picture without persons are looked at, too: half of it to all of it,
mirrored or not.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import Size, sized_parser, skip
from indoor_watch.detectors import load_detector
from indoor_watch.persons import PersonFinder

ENDINGS = ('.jpg', '.jpeg', '.png')


def pictures(given: list[Path]) -> list[Path]:
    """Return the pictures that are named, and those in folders that are."""
    found = [each for path in given for each in ([path] if path.is_file() else path.rglob('*'))]
    return sorted(each for each in found if each.suffix.lower() in ENDINGS)


def measured(
    finder: PersonFinder, paths: list[Path], light: float = 1.0
) -> tuple[list[str], float]:
    """Return the names of the pictures with a find, and milliseconds of CPU a picture."""
    hits, spent = [], 0.0
    rng = np.random.default_rng()
    for path in paths:
        read = cv2.imread(str(path))
        if read is None:
            continue
        if light < 1.0:
            # A camera's noise does not become less in the dark.
            read = np.clip(np.rint(read * light + rng.normal(0.0, 2.0, read.shape)), 0, 255)
        began = time.process_time()
        if finder.find(np.asarray(read, np.uint8)):
            hits.append(path.name)
        spent += time.process_time() - began
    return hits, 1000.0 * spent / max(1, len(paths))


def false_in_crops(finder: PersonFinder, paths: list[Path], crops: int) -> tuple[int, list[str]]:
    """Return how many parts of pictures were looked at, and the pictures of those with a find."""
    rng = np.random.default_rng(8)
    looked, false = 0, []
    for path in paths:
        read = cv2.imread(str(path))
        if read is None:
            continue
        for _ in range(crops):
            rows, columns = read.shape[:2]
            high, wide = (max(1, round(each * rng.uniform(0.5, 1.0))) for each in (rows, columns))
            top, left = rng.integers(rows - high + 1), rng.integers(columns - wide + 1)
            part = read[top : top + high, left : left + wide]
            if rng.random() < 0.5:
                part = part[:, ::-1]
            looked += 1
            if finder.find(np.ascontiguousarray(part, np.uint8)):
                false.append(path.name)
    return looked, false


def main() -> None:
    """Print the table."""
    parser = sized_parser(__doc__)
    parser.add_argument('--with', dest='persons', type=Path, nargs='*', default=[])
    parser.add_argument('--without', type=Path, nargs='*', default=[])
    parser.add_argument('--weights', default='', help='an ONNX file, or a frozen graph')
    parser.add_argument('--light', type=float, default=1.0, help='of what the pictures had')
    parser.add_argument('--crops', type=int, default=0, help='of each picture without persons')
    given = parser.parse_args()
    try:
        detector = load_detector(given.weights)
    except ValueError as error:
        skip(str(error))
    name, finder = detector.name, PersonFinder(detector)
    if given.size is Size.SMOKE:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / 'grey.png'
            cv2.imwrite(str(path), np.full((240, 320, 3), 128, np.uint8))
            compare(name, finder, [], [path], 1)
    else:
        compare(
            name,
            finder,
            pictures(given.persons),
            pictures(given.without),
            given.crops,
            given.light,
        )


def compare(
    name: str,
    finder: PersonFinder,
    persons: list[Path],
    without: list[Path],
    crops: int,
    light: float = 1.0,
) -> None:
    """Print what is found in pictures with persons and without, and in parts of the latter."""
    print(f'{"":40} {"found":>10} {"false":>10} {"ms CPU":>8}')
    hits, first = measured(finder, persons, light)
    false, second = measured(finder, without, light)
    spent = (first * len(persons) + second * len(without)) / max(1, len(persons + without))
    found, wrong = f'{len(hits)}/{len(persons)}', f'{len(false)}/{len(without)}'
    print(f'{name:40} {found:>10} {wrong:>10} {spent:8.0f}   {", ".join(false)}')
    missed = [each.name for each in persons if each.name not in hits]
    print(f'missed: {", ".join(missed) or "none"}')
    if crops:
        looked, wrong_parts = false_in_crops(finder, without, crops)
        names = ', '.join(f'{each} {wrong_parts.count(each)}' for each in sorted(set(wrong_parts)))
        print(f'parts: {len(wrong_parts)} of {looked} false   {names}')


if __name__ == '__main__':
    main()
