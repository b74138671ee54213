"""How many markers are found, how exactly and how fast, beside OpenCV's detectors and AprilTag 3.

    python benchmarks/perception.py [--quick] [--photos FOLDER] [--picture FILE]
    python benchmarks/perception.py --fuzz N | --node N

All detectors get the same images: rendered ones of 640x480 pixels, 60 degrees field of view,
markers of 0.20 m from DICT_5X5_100, a lens blur of 0.8 pixels and a noise of 2 grey levels, under
lights from even to hard shadows; natural images without any marker; and real photographs where
there are some (`--photos`, or the environment variable MARKER_PHOTOS: a folder with
`markers.json`). Seven ids are on the known list; what others find is held against the same list.
Times are processor time of one thread. `--fuzz` sends that many damaged messages through the
conversions and the detector. `--node N` sends N images to the node in a process of its own and
times its answers.
`--picture` draws recall over distance and angle.
"""

from __future__ import annotations

import math
import os
import resource
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

# Read when numpy is imported.
for variable in ('OPENBLAS_NUM_THREADS', 'OMP_NUM_THREADS'):
    os.environ.setdefault(variable, '1')
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.photographs import AS_TAKEN, VARIATIONS, Photograph, photographs_in
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from libs.marker_detection.tests.backdrops import BACKDROPS, backdrop_of
from marker_detection.camera_model import CameraModel
from marker_detection.detector import DetectorSettings, MarkerDetector
from marker_detection.dictionaries import dictionary_named
from marker_detection.pose import pose_of
from marker_detection.preprocessing import grey_of
from marker_detection.testing.marker_scene import (
    Degradation,
    Glare,
    ImageArray,
    Panel,
    Shadow,
    corners_in_camera,
    corners_in_image,
    image_of,
)

CAMERA = CameraModel.from_field_of_view(640, 480, math.radians(60))
DICTIONARY = dictionary_named('DICT_5X5_100')
KNOWN = frozenset(range(11, 18))
DISTANCES = tuple(range(2, 10))
ANGLES = tuple(range(0, 81, 10))
SHARP = Degradation(blur=0.8, noise=2.0)
DEGRADED = {
    'blur 1.2 px': replace(SHARP, blur=1.2),
    'blur 1.6 px': replace(SHARP, blur=1.6),
    'blur 2.0 px': replace(SHARP, blur=2.0),
    'motion 4 px': replace(SHARP, motion=4.0, direction=0.3),
    'motion 8 px': replace(SHARP, motion=8.0, direction=0.3),
    'light 25 %': replace(SHARP, light=0.25),
    'light 10 %': replace(SHARP, light=0.10),
    'light 160 %': replace(SHARP, light=1.6),
    'light uneven': replace(SHARP, light=0.7, slope=0.7),
    'noise 10': replace(SHARP, noise=10.0),
    'noise 20': replace(SHARP, noise=20.0),
    'noise 30': replace(SHARP, noise=30.0),
}
TEXTURES = ('clouds', 'bricks', 'boxes', 'letters', 'leaves', 'boards')
IMAGE_TOPIC, DETECTIONS_TOPIC = 'camera/rgb/image_raw', 'aruco_detector/detections'
WARM_UP = 10
PHOTO_DETECTORS = ('OpenCV', 'ladder', 'AprilTag 3', 'here')
DECOYS = ('DICT_4X4_50', 'DICT_6X6_250', 'DICT_APRILTAG_36h11')

Found = list[tuple[int, npt.NDArray[np.float64]]]
Detect = Callable[[ImageArray], Found]


def opencv_defaults(dictionary: cv2.aruco.Dictionary = DICTIONARY) -> Detect:
    """OpenCV's detector as it comes."""
    detector = cv2.aruco.ArucoDetector(dictionary)
    return lambda image: _found(detector.detectMarkers(image))


def _found(answer: tuple[Sequence[npt.NDArray[np.float32]], Any, Any]) -> Found:
    corners, ids, _ = answer
    if ids is None:
        return []
    # (N, 1) in OpenCV 4, (N,) in OpenCV 5
    pairs = zip(np.ravel(ids).tolist(), corners, strict=True)
    return [(marker_id, outline.reshape(4, 2).astype(float)) for marker_id, outline in pairs]


def opencv_ladder(dictionary: cv2.aruco.Dictionary = DICTIONARY) -> Detect:
    """OpenCV's detector with many thresholds and refined corners."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeMax = 3, 53
    parameters.adaptiveThreshWinSizeStep = 4
    parameters.minMarkerPerimeterRate = 0.01
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    detector = cv2.aruco.ArucoDetector(dictionary, parameters)
    return lambda image: _found(detector.detectMarkers(image))


def apriltag3() -> Detect | None:
    """AprilTag 3 for the family tag36h11; None where pupil-apriltags is not installed."""
    try:
        from pupil_apriltags import Detector
    except ImportError:
        return None
    detector = Detector(families='tag36h11', nthreads=1, quad_decimate=1.0)
    return lambda image: [(each.tag_id, each.corners) for each in detector.detect(grey_of(image))]


def this_project(known: frozenset[int] | None = KNOWN, dictionary: str = 'DICT_5X5_100') -> Detect:
    """Return the detector of surveillance_perception."""
    detector = MarkerDetector(DetectorSettings(dictionary, known))
    return lambda image: [(each.marker_id, each.corners) for each in detector.detect(image)]


@dataclass
class Tally:
    """What one detector did with some images."""

    images: int = 0
    found: int = 0
    shown: int = 0
    wrong_known: int = 0
    wrong_other: int = 0
    seconds: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)

    def look(self, detect: Detect, image: ImageArray, panels: Sequence[Panel]) -> None:
        """Have one image looked at and hold it against the truth."""
        start = time.thread_time()
        found = detect(image)
        self.seconds.append(time.thread_time() - start)
        self.images += 1
        self.shown += len(panels)
        truths = [(panel.marker_id, corners_in_image(panel, CAMERA)) for panel in panels]
        for marker_id, corners in found:
            errors = [
                float(np.linalg.norm(corners - truth, axis=1).mean())
                for shown_id, truth in truths
                if shown_id == marker_id
            ]
            if errors and min(errors) < 8.0:
                self.found += 1
                self.errors.append(min(errors))
            elif marker_id in KNOWN:
                self.wrong_known += 1
            else:
                self.wrong_other += 1

    @property
    def recall(self) -> float:
        """Share of the markers that were found."""
        return self.found / self.shown if self.shown else math.nan


Tallies = dict[str, Tally]


def panel(distance: float, degrees: float, generator: np.random.Generator) -> Panel:
    """Return a known marker somewhere in the image, turned about an upright or a level axis."""
    upright = generator.random() < 0.75
    return Panel(
        int(generator.choice(sorted(KNOWN))),
        distance,
        math.radians(degrees) * float(generator.choice([-1, 1])),
        axis=(math.pi / 2 if upright else 0.0) + float(generator.uniform(-0.1, 0.1)),
        roll=float(generator.uniform(-0.15, 0.15)),
        offset=(float(generator.uniform(-170, 170)), float(generator.uniform(-120, 120))),
    )


def scene(
    panels: Sequence[Panel],
    backdrop: str,
    degradation: Degradation,
    generator: np.random.Generator,
    dictionary: cv2.aruco.Dictionary = DICTIONARY,
) -> ImageArray:
    """Return an image of panels in front of a backdrop."""
    ground = backdrop_of(backdrop, CAMERA, generator)
    return image_of(list(panels), CAMERA, dictionary, ground, degradation, generator)


def indoors(generator: np.random.Generator) -> str:
    """Backdrops of rooms, most often a plain or a stained wall."""
    return str(generator.choice(['plain', 'clouds', 'boxes', 'bricks'], p=[0.4, 0.4, 0.15, 0.05]))


def grid(detectors: dict[str, Detect], samples: int) -> dict[tuple[int, int], Tallies]:
    """Recall over distance and angle."""
    cells = {}
    for distance in DISTANCES:
        for degrees in ANGLES:
            generator = np.random.default_rng([1, distance, degrees])
            tallies = {name: Tally() for name in detectors}
            for _ in range(samples):
                panels = [panel(distance, degrees, generator)]
                image = scene(panels, indoors(generator), SHARP, generator)
                for name, detect in detectors.items():
                    tallies[name].look(detect, image, panels)
            cells[distance, degrees] = tallies
    return cells


def degraded(
    detectors: dict[str, Detect], samples: int, distances: Sequence[int] = (2, 3, 4, 5)
) -> dict[str, Tallies]:
    """Recall under each condition, at 2 to 5 m and up to 60 degrees."""
    result = {}
    for index, (condition, degradation) in enumerate(DEGRADED.items()):
        generator = np.random.default_rng([2, index])
        tallies = {name: Tally() for name in detectors}
        for distance in distances:
            for degrees in (0, 20, 40, 60):
                for _ in range(samples):
                    panels = [panel(distance, degrees, generator)]
                    image = scene(panels, indoors(generator), degradation, generator)
                    for name, detect in detectors.items():
                        tallies[name].look(detect, image, panels)
        result[condition] = tallies
    return result


LIGHTS = (
    'hard shadow',
    'soft shadow',
    'deep shadow',
    'glare',
    'vignette',
    'thin margin',
    'dark wall',
    'curled paper',
    'rolling shutter',
    'motion and noise',
    'JPEG 15',
    'all together',
)


def under_light(light: str, index: int) -> tuple[ImageArray, Panel]:
    """Return a known marker at 1.2 to 3 m, up to 40 degrees, under one of `LIGHTS`."""
    generator = np.random.default_rng([4, LIGHTS.index(light), index])
    shown = replace(
        panel(generator.uniform(1.2, 3.0), generator.uniform(0, 40), generator),
        offset=tuple(generator.uniform(-120, 120, 2).tolist()),
    )
    side = shown.size * float(CAMERA.matrix[0, 0]) / shown.distance
    middle = np.array(shown.offset) + CAMERA.matrix[:2, 2]
    spot = tuple((middle + generator.uniform(-0.3, 0.3, 2) * side).tolist())
    direction = float(generator.uniform(0, 2 * math.pi))
    look, ground = SHARP, indoors(generator)
    if light.endswith('shadow'):
        brightness, softness = (0.3 if light.startswith('deep') else 0.5), 0.0
        softness = 4.0 if light.startswith('soft') else 0.0
        look = replace(SHARP, shadows=(Shadow(spot, direction, brightness, softness),))
    elif light == 'glare':
        look = replace(SHARP, glares=(Glare(spot, 10.0),))
    elif light == 'vignette':
        look = replace(SHARP, vignette=0.8, light=0.6)
    elif light == 'thin margin':
        shown, ground = replace(shown, margin=float(generator.uniform(0.15, 0.3))), 'dark'
    elif light == 'dark wall':
        shown, ground = replace(shown, margin=float(generator.uniform(0.5, 1.0))), 'dark'
    elif light == 'curled paper':
        shown = replace(shown, curl=float(generator.uniform(0.6, 1.2)))
    elif light == 'rolling shutter':
        look = replace(SHARP, shutter=float(generator.uniform(-60, 60)))
    elif light == 'motion and noise':
        look = replace(SHARP, motion=4.0, direction=direction, noise=8.0)
    elif light == 'JPEG 15':
        look = replace(SHARP, jpeg=15)
    else:
        shadow = Shadow(spot, direction, 0.6, 2.0)
        look = replace(SHARP, shadows=(shadow,), vignette=0.4, motion=3.0, noise=5.0, jpeg=40)
    return scene([shown], ground, look, generator), shown


def print_lights(samples: int) -> None:
    """Recall of each detector under each light, and wrong ids."""
    detectors = {'OpenCV': opencv_defaults(), 'ladder': opencv_ladder(), 'here': this_project()}
    rows = []
    for light in LIGHTS:
        found, wrong = dict.fromkeys(detectors, 0), dict.fromkeys(detectors, 0)
        for index in range(samples):
            image, shown = under_light(light, index)
            for name, detect in detectors.items():
                ids = [marker_id for marker_id, _ in detect(image)]
                found[name] += shown.marker_id in ids
                wrong[name] += sum(each != shown.marker_id for each in ids)
        rows.append(
            [light, *(f'{found[name] / samples:.2f} ({wrong[name]})' for name in detectors)]
        )
    print_table(['recall (wrong ids) under', *detectors], rows)


def print_photos(folder: Path | None, every: int) -> None:
    """Print what is found of the markers in real photographs, as taken and varied.

    Args:
        folder: Holds the photographs and `markers.json`.
        every: Variations are made of each so many-th photograph only.
    """
    if folder is None or not (folder / 'markers.json').exists():
        print('no photographs: name their folder with --photos or MARKER_PHOTOS\n')
        return
    photographs = list(photographs_in(folder))
    rows = []
    for variation, change in VARIATIONS.items():
        chosen = photographs if variation == AS_TAKEN else photographs[::every]
        rows.append([variation, *_found_in([change(each) for each in chosen])])
    print_table(['photographs: found', *PHOTO_DETECTORS, 'of', 'not listed', 'ms in all'], rows)


def _found_in(photographs: Sequence[Photograph]) -> list[str]:
    """Return how many markers each detector found, all together found, and what else we did."""
    found, union, others = Counter[str](), 0, Counter[str]()
    seconds: dict[str, float] = defaultdict(float)
    for photograph in photographs:
        seen: dict[str, set[int]] = {}
        for name in PHOTO_DETECTORS:
            detect = _photo_detector(name, photograph.dictionary)
            if detect is None:
                continue
            start = time.thread_time()
            listed = photograph.listed(detect(photograph.image))
            seconds[name] += time.thread_time() - start
            seen[name] = {index for index in listed if index is not None}
            others[name] += listed.count(None)
            found[name] += len(seen[name])
        union += len(set().union(*seen.values()))
    return [
        *(str(found[name]) for name in PHOTO_DETECTORS),
        str(union),
        ' '.join(str(others[name]) for name in PHOTO_DETECTORS),
        ' '.join(f'{1e3 * seconds[name]:.0f}' for name in PHOTO_DETECTORS),
    ]


@cache
def _photo_detector(name: str, kind: str) -> Detect | None:
    if name == 'AprilTag 3':
        return apriltag3() if kind == 'DICT_APRILTAG_36h11' else None
    if name == 'here':
        return this_project(None, kind)
    make = opencv_defaults if name == 'OpenCV' else opencv_ladder
    return make(dictionary_named(kind))


def ippe_and_refinement(corners: npt.NDArray[np.float64], size: float) -> npt.NDArray[np.float64]:
    """Return the position (3,) by OpenCV's IPPE and its refinement: the better of two solutions."""
    square = np.array([[-1.0, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) * size / 2.0
    points, matrix, straight = corners.reshape(4, 1, 2), CAMERA.matrix, np.zeros(0)
    best, position = math.inf, np.full(3, math.nan)
    _, *solved, _ = cv2.solvePnPGeneric(
        square, points, matrix, straight, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    for start in zip(*solved, strict=True):
        turn, place = cv2.solvePnPRefineLM(
            square, points, matrix, straight, *(each.copy() for each in start)
        )
        again = cv2.projectPoints(square, turn, place, matrix, straight)[0]
        error = float(np.linalg.norm(again - points))
        if error < best and place[2, 0] > 0:
            best, position = error, place.ravel()
    return position


def print_poses(count: int) -> None:
    """Poses from exact corners with a noise of 0.15 pixels, at 2 to 8 m and up to 80 degrees."""
    ways: dict[str, Callable[[npt.NDArray[np.float64], float], npt.NDArray[np.float64]]] = {
        'OpenCV, IPPE and LM': ippe_and_refinement,
        'here': lambda corners, size: (
            np.full(3, math.nan)
            if (pose := pose_of(corners, size, CAMERA)) is None
            else pose.position
        ),
    }
    far, none = Counter[str](), Counter[str]()
    seconds: dict[str, float] = defaultdict(float)
    generator = np.random.default_rng(41)
    for _ in range(count):
        shown = Panel(
            0,
            generator.uniform(2.0, 8.0),
            generator.uniform(0.0, math.radians(80)),
            axis=generator.uniform(0.0, 2.0 * math.pi),
            roll=generator.uniform(0.0, 2.0 * math.pi),
            offset=(generator.uniform(-250, 250), generator.uniform(-180, 180)),
        )
        truth = corners_in_camera(shown, CAMERA).mean(axis=0)
        corners = corners_in_image(shown, CAMERA) + generator.normal(0.0, 0.15, (4, 2))
        for name, way in ways.items():
            start = time.thread_time()
            position = way(corners, shown.size)
            seconds[name] += time.thread_time() - start
            none[name] += bool(np.isnan(position).any())
            far[name] += float(np.linalg.norm(position - truth)) > 0.1 * shown.distance
    print_table(
        [f'{count} poses', 'more than 10 % off', 'none', 'ms each'],
        [
            [name, str(far[name]), str(none[name]), f'{1e3 * seconds[name] / count:.2f}']
            for name in ways
        ],
    )


FAMILIES = (
    'DICT_4X4_1000',
    'DICT_6X6_1000',
    'DICT_7X7_1000',
    'DICT_ARUCO_ORIGINAL',
    'DICT_APRILTAG_16h5',
    'DICT_APRILTAG_25h9',
    'DICT_APRILTAG_36h10',
    'DICT_APRILTAG_36h11',
    'DICT_ARUCO_MIP_36h12',
)


def print_foreign(every: int) -> None:
    """Ids of DICT_5X5_100 that are seen in markers of other dictionaries, each shown once.

    Args:
        every: Only each so many-th marker.
    """
    detectors = {'OpenCV': opencv_defaults(), 'ladder': opencv_ladder(), 'here': this_project(None)}
    rows = []
    for order, name in enumerate(FAMILIES):
        dictionary = dictionary_named(name)
        ids = list(range(0, len(dictionary.bytesList), every))
        wrong = dict.fromkeys(detectors, 0)
        for start in range(0, len(ids), 3):
            generator = np.random.default_rng([13, order, start])
            shown = [
                Panel(
                    marker_id,
                    float(generator.uniform(1, 7)),
                    math.radians(generator.uniform(-65, 65)),
                    offset=(190.0 * (place - 1), float(generator.uniform(-100, 100))),
                )
                for place, marker_id in enumerate(ids[start : start + 3])
            ]
            image = scene(shown, indoors(generator), SHARP, generator, dictionary)
            for detector, detect in detectors.items():
                wrong[detector] += len(detect(image))
        rows.append([name, str(len(ids)), *(str(wrong[each]) for each in detectors)])
    sums = [str(sum(int(row[column]) for row in rows)) for column in range(1, 5)]
    print_table(['wrong ids in other markers', 'views', *detectors], [*rows, ['all', *sums]])


def kalibrs_grid(view: int, scale: float) -> ImageArray:
    """Return an image of 1280x960 of Kalibr's AprilGrid of 12x6 tags, so large a part of it."""
    dictionary = dictionary_named('DICT_APRILTAG_36h11')
    tag, gap, columns, rows = 100, 30, 12, 6
    height, width = rows * (tag + gap) + gap, columns * (tag + gap) + gap
    sheet = np.full((height, width), 255, np.uint8)
    for row in range(rows + 1):
        for column in range(columns + 1):
            left, low = column * (tag + gap), height - row * (tag + gap)
            sheet[low - gap : low, left : left + gap] = 0
            if row < rows and column < columns:
                drawn = cv2.aruco.generateImageMarker(
                    dictionary, row * columns + column, tag, borderBits=2
                )
                top, left = low - gap - tag, left + gap
                sheet[top : top + tag, left : left + tag] = drawn
    generator = np.random.default_rng([14, view])
    half = np.array([width, height]) * scale / 2
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half + (640, 480)
    corners += generator.uniform(-0.18, 0.18, (4, 2)) * half[1]
    flat = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    matrix = cv2.getPerspectiveTransform(flat, corners.astype(np.float32))
    image = cv2.warpPerspective(sheet, matrix, (1280, 960), flags=cv2.INTER_AREA, borderValue=160)
    blurred = cv2.GaussianBlur(image, (0, 0), 0.8).astype(float) * 0.85 + 15.0
    noisy = blurred + generator.normal(0.0, 2.0, blurred.shape)
    return np.asarray(np.clip(noisy, 0, 255), np.uint8)


def print_kalibr(views: int) -> None:
    """Tags of Kalibr's AprilGrid (two black cells around each) that are found."""
    dictionary = dictionary_named('DICT_APRILTAG_36h11')
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = 2
    opencv = cv2.aruco.ArucoDetector(dictionary, parameters)
    ours = MarkerDetector(DetectorSettings('DICT_APRILTAG_36h11', border=2))
    detectors: dict[str, Detect] = {
        'OpenCV, border bits 2': lambda image: _found(opencv.detectMarkers(image)),
        'here, border 2': lambda image: [(d.marker_id, d.corners) for d in ours.detect(image)],
    }
    peer = apriltag3()
    if peer is not None:
        detectors['AprilTag 3'] = peer
    rows = []
    for scale in (0.75, 0.5, 0.35, 0.25, 0.18):
        row = [f'{100 * scale:.0f} pixels a tag']
        for detect in detectors.values():
            counts = [
                len({each for each, _ in detect(kalibrs_grid(v, scale))}) for v in range(views)
            ]
            row.append(f'{np.mean(counts):.0f}')
        rows.append(row)
    print_table(["tags of Kalibr's grid, of 72", *detectors], rows)


def print_corners(folder: Path | None) -> None:
    """Distance in pixels to the corners that AprilTag 3 finds in the photographs of its tags."""
    peer = apriltag3()
    if folder is None or peer is None or not (folder / 'markers.json').exists():
        print('no comparison of corners: it needs photographs and pupil-apriltags\n')
        return
    kind = 'DICT_APRILTAG_36h11'
    errors: defaultdict[str, list[float]] = defaultdict(list)
    for photograph in photographs_in(folder):
        if photograph.dictionary != kind:
            continue
        # AprilTag's pixels have their middles at halves
        theirs = [(marker_id, corners - 0.5) for marker_id, corners in peer(photograph.image)]
        for name in ('OpenCV', 'ladder', 'here'):
            detect = _photo_detector(name, kind)
            assert detect is not None
            for marker_id, corners in detect(photograph.image):
                for other_id, truth in theirs:
                    if (
                        other_id != marker_id
                        or math.dist(*(c.mean(0) for c in (corners, truth))) > 15
                    ):
                        continue
                    turned = [np.roll(c, k, 0) for c in (truth, truth[::-1]) for k in range(4)]
                    apart = [np.linalg.norm(each - corners, axis=1) for each in turned]
                    errors[name] += min(apart, key=lambda each: float(each.mean())).tolist()
    print_table(
        ["corners to AprilTag 3's", 'markers', 'median px', '95 %'],
        [
            [n, f'{len(e) // 4}', f'{np.median(e):.2f}', f'{np.quantile(e, 0.95):.2f}']
            for n, e in errors.items()
        ],
    )


GAPS = (-2.0, 0.0, 1.0, 3.0, 8.0)
"""Pixels between a marker and the edge of the image; less than 0: the edge cuts it."""


def beside_the_edge(gap: float, index: int) -> tuple[ImageArray, Panel]:
    """Return a marker at 0.4 to 2 m, up to 45 degrees, so many pixels before the image's edge."""
    generator = np.random.default_rng([15, index])
    shown = panel(generator.uniform(0.4, 2.0), generator.uniform(0, 45), generator)
    shown = replace(shown, offset=(0.0, 0.0), margin=float(generator.uniform(0.5, 1.5)))
    axis = index % 2
    last = (CAMERA.width, CAMERA.height)[axis] - 0.5
    # its outline changes as it is moved (perspective), so it is moved again by what is left
    for _ in range(6):
        corners = corners_in_image(shown, CAMERA)[:, axis]
        # towards the last column or row, or towards the first one
        miss = last - gap - corners.max() if index % 4 < 2 else gap - 0.5 - corners.min()
        offset = list(shown.offset)
        offset[axis] += float(miss)
        shown = replace(shown, offset=(offset[0], offset[1]))
    return scene([shown], indoors(generator), SHARP, generator), shown


def print_edge(count: int, gaps: Sequence[float]) -> None:
    """Markers beside the edge of the image, and cut by it: found, and how far a corner is off."""
    detectors = {'OpenCV': opencv_defaults(), 'ladder': opencv_ladder(), 'here': this_project()}
    rows = []
    for gap in gaps:
        row = [f'{gap:g} pixels']
        views = [beside_the_edge(gap, index) for index in range(count)]
        for detect in detectors.values():
            errors = [
                float(np.linalg.norm(corners - corners_in_image(shown, CAMERA), axis=1).max())
                for image, shown in views
                for marker_id, corners in detect(image)
                if marker_id == shown.marker_id
            ]
            worst = f'{np.median(errors):.2f}, {max(errors):.1f}' if errors else '-'
            row.append(f'{len(errors)}; {worst}')
        rows.append(row)
    head = [f'of {count}: found; worst corner, median and most', *detectors]
    print_table(head, rows)


def natural_images(count: int) -> Iterator[ImageArray]:
    """Photographs of scikit-image and, where it is installed, scikit-learn: parts, rescaled."""
    import skimage.data

    sources = [
        image
        for path in sorted(Path(skimage.data.__file__).parent.iterdir())
        if path.suffix in ('.png', '.jpg')
        and (image := cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) is not None
        and min(image.shape) > 60
    ]
    try:
        from sklearn.datasets import load_sample_images

        sources += [cv2.cvtColor(each, cv2.COLOR_RGB2GRAY) for each in load_sample_images().images]
    except ImportError:
        pass
    generator = np.random.default_rng(5)
    for index in range(count):
        image = sources[index % len(sources)]
        if index >= len(sources):
            scale = float(generator.uniform(0.4, 2.5))
            image = np.rot90(cv2.resize(image, None, fx=scale, fy=scale), index % 4)
        height, width = min(image.shape[0], 480), min(image.shape[1], 640)
        top = int(generator.integers(image.shape[0] - height + 1))
        left = int(generator.integers(image.shape[1] - width + 1))
        yield np.ascontiguousarray(image[top : top + height, left : left + width])


def print_natural(count: int) -> None:
    """Ids seen in natural images that hold none, and the time for one."""
    detectors = {'OpenCV': opencv_defaults(), 'ladder': opencv_ladder(), 'here': this_project(None)}
    wrong, seconds = dict.fromkeys(detectors, 0), dict.fromkeys(detectors, 0.0)
    for image in natural_images(count):
        for name, detect in detectors.items():
            start = time.thread_time()
            wrong[name] += len(detect(image))
            seconds[name] += time.thread_time() - start
    print_table(
        [f'{count} natural images', 'wrong ids', 'ms an image'],
        [[name, str(wrong[name]), f'{1e3 * seconds[name] / count:.1f}'] for name in detectors],
    )


def row_of_panels(generator: np.random.Generator, apart: float) -> list[Panel]:
    """Return three known markers beside each other, so many pixels apart."""
    ids = generator.choice(sorted(KNOWN), 3, replace=False).tolist()
    return [
        Panel(
            marker_id,
            float(generator.uniform(2, 8)),
            float(generator.uniform(-1, 1)),
            offset=(apart * (place - 1.0), float(generator.uniform(-100, 100))),
        )
        for place, marker_id in enumerate(ids)
    ]


def board_of_panels() -> list[Panel]:
    """Return 32 markers in four rows, which fill an image of 1920x1080."""
    return [
        Panel(row * 8 + column, 2.5, 0.1, offset=(202.0 * (column - 3.5), 208.0 * (row - 1.5)))
        for row in range(4)
        for column in range(8)
    ]


def print_times(count: int) -> None:
    """Processor time of small images, and of large ones in front of textures."""
    rows = []
    full_hd = CameraModel.from_field_of_view(1920, 1080, 1.2)
    twelve_megapixels = CameraModel.from_field_of_view(4000, 3000, 1.2)
    few = math.ceil(count / 5)
    shown_by: list[
        tuple[str, CameraModel, bool, int, Callable[[np.random.Generator], list[Panel]]]
    ] = [
        ('640x480, indoors', CAMERA, False, count, lambda each: row_of_panels(each, 120)),
        (
            '640x480, one, textured',
            CAMERA,
            True,
            count,
            lambda each: [panel(each.uniform(1.5, 6), each.uniform(0, 60), each)],
        ),
        ('1920x1080, textured', full_hd, True, count, lambda each: row_of_panels(each, 400)),
        ('1920x1080, board', full_hd, True, few, lambda _: board_of_panels()),
        (
            '4000x3000, textured',
            twelve_megapixels,
            True,
            few,
            lambda each: row_of_panels(each, 900),
        ),
    ]
    for title, camera, textured, images, panels_in in shown_by:
        detectors = {'OpenCV': opencv_defaults(), 'here': this_project()}
        seconds: dict[str, list[float]] = {name: [] for name in detectors}
        found, shown = dict.fromkeys(detectors, 0), 0
        for index in range(images):
            generator = np.random.default_rng([9, index])
            kind = TEXTURES[index % len(TEXTURES)] if textured else indoors(generator)
            panels = panels_in(generator)
            ids = {each.marker_id for each in panels}
            ground = backdrop_of(kind, camera, generator)
            image = image_of(panels, camera, DICTIONARY, ground, SHARP, generator)
            shown += len(panels)
            for name, detect in detectors.items():
                start = time.thread_time()
                seen = detect(image)
                seconds[name].append(time.thread_time() - start)
                found[name] += len({each for each, _ in seen} & ids)
        for name, times in seconds.items():
            milliseconds = [1e3 * each for each in (np.median(times), np.mean(times))]
            rows.append(
                [
                    title,
                    name,
                    f'{found[name]} of {shown}',
                    *(f'{each:.1f}' for each in milliseconds),
                ]
            )
    print_table(['processor time of an image', '', 'found', 'median ms', 'mean ms'], rows)


def processor_time(pid: int) -> float:
    """Return the processor time of a process so far, seconds."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def print_node(count: int) -> None:
    """Time from the publication of an image of 640x480 to the message of what it shows."""
    from surveillance_runtime.testing import claim_domain

    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import Header

    from surveillance_interfaces.msg import MarkerDetectionArray
    from surveillance_perception.conversions import image_to_ros

    generator = np.random.default_rng(8)
    images = [
        scene([panel(generator.uniform(2, 9), 30, generator)], indoors(generator), SHARP, generator)
        for _ in range(20)
    ]
    rclpy.init()
    node = rclpy.create_node('camera')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    answered: dict[int, float] = {}
    node.create_subscription(
        MarkerDetectionArray,
        DETECTIONS_TOPIC,
        lambda message: answered.setdefault(message.header.stamp.nanosec, time.perf_counter()),
        10,
    )
    publisher = node.create_publisher(type(image_to_ros(images[0], Header())), IMAGE_TOPIC, 2)
    command = [sys.executable, '-m', 'surveillance_perception.aruco_detector_node']
    process = subprocess.Popen([*command, '--ros-args', '-p', 'only_at_rest:=false'])
    seconds, busy = [], 0.0
    try:
        while not publisher.get_subscription_count() or not node.count_publishers(DETECTIONS_TOPIC):
            executor.spin_once(timeout_sec=0.1)
        for index in range(count + WARM_UP):
            message = image_to_ros(images[index % len(images)], Header())
            message.header.stamp.nanosec = index
            start = time.perf_counter()
            publisher.publish(message)
            while index not in answered and time.perf_counter() < start + 1.0:
                executor.spin_once(timeout_sec=0.1)
            if index == WARM_UP - 1:
                busy = -processor_time(process.pid)
            if index >= WARM_UP:
                seconds.append(answered.get(index, math.inf) - start)
            time.sleep(0.05)
        busy += processor_time(process.pid)
    finally:
        process.terminate()
        process.wait()
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    quantiles = np.quantile(seconds, (0.5, 0.95, 0.99), method='higher')
    figures = [f'{1e3 * each:.1f}' for each in (*quantiles, busy / count)]
    lost = sum(map(math.isinf, seconds))
    head = ['image to message, 640x480', 'images', 'lost', 'median ms', '95 %', '99 %', 'CPU ms']
    print_table(head, [['aruco_detector', str(count), str(lost), *figures]])


def print_fuzz(count: int) -> None:
    """Send damaged messages through conversions and detector; whatever escapes ends the program."""
    from benchmarks.damaged_messages import damaged, taken

    generator = np.random.default_rng(6)
    detector = MarkerDetector()
    good = sum(taken(damaged(generator), detector) for _ in range(count))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f'{count} damaged messages: {good} taken, the others refused; peak {peak:.0f} MB\n')


def without_markers(indices: Iterable[int]) -> Iterator[tuple[str, ImageArray]]:
    """Images without a marker of the dictionary: textures, and markers of other dictionaries."""
    kinds = [*BACKDROPS, 'other dictionaries']
    conditions = [SHARP, *DEGRADED.values()]
    for index in indices:
        generator = np.random.default_rng([3, index])
        kind = kinds[index % len(kinds)]
        degradation = SHARP if index % 2 else conditions[(index // 2) % len(conditions)]
        if kind in BACKDROPS:
            yield kind, scene([], kind, degradation, generator)
            continue
        dictionary = dictionary_named(DECOYS[(index // len(kinds)) % len(DECOYS)])
        decoys = [
            replace(
                panel(generator.uniform(1, 7), generator.uniform(0, 75), generator),
                marker_id=int(generator.integers(0, 50)),
            )
            for _ in range(3)
        ]
        yield kind, scene(decoys, indoors(generator), degradation, generator, dictionary)


def summed(tallies: Sequence[Tally]) -> Tally:
    """Several tallies as one."""
    total = Tally()
    for each in tallies:
        total.images += each.images
        total.found += each.found
        total.shown += each.shown
        total.wrong_known += each.wrong_known
        total.wrong_other += each.wrong_other
        total.seconds += each.seconds
        total.errors += each.errors
    return total


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table and an empty line."""
    print(table([head, *rows]) + '\n')


def ratio(ours: float, theirs: float) -> str:
    """Return how many times as much."""
    return f'{ours / theirs:.2f}x' if theirs else '-'


def print_recall(title: str, groups: dict[str, Tallies]) -> None:
    """Recall, corner error and time of both detectors for groups of images."""
    rows = []
    for name, tallies in groups.items():
        theirs, ours = tallies['OpenCV'], tallies['here']
        rows.append(
            [
                name,
                f'{theirs.recall:.3f}',
                f'{ours.recall:.3f}',
                ratio(ours.recall, theirs.recall),
                f'{np.mean(theirs.errors or [math.nan]):.2f}',
                f'{np.mean(ours.errors or [math.nan]):.2f}',
                f'{1e3 * np.mean(theirs.seconds):.1f}',
                f'{1e3 * np.mean(ours.seconds):.1f}',
                f'{1e3 * np.quantile(ours.seconds, 0.95):.1f}',
                f'{len(ours.seconds)}',
            ]
        )
    print_table(
        [
            title,
            'recall OpenCV',
            'here',
            'ratio',
            'corner error px OpenCV',
            'here',
            'ms OpenCV',
            'here',
            '95 %',
            'images',
        ],
        rows,
    )


def main(argv: Sequence[str] | None = None) -> int:
    """Measure and print."""
    parser = sized_parser(__doc__, quick='fewer images, under 50 s')
    parser.add_argument('--picture', type=Path, help='draw recall over distance and angle')
    parser.add_argument('--photos', type=Path, default=os.environ.get('MARKER_PHOTOS'))
    parser.add_argument('--fuzz', type=int, metavar='N', help='damaged messages, and nothing else')
    parser.add_argument('--node', type=int, metavar='N', help='images to the node, nothing else')
    options = parser.parse_args(argv)
    cv2.setNumThreads(1)
    if options.fuzz is not None:
        print_fuzz(options.fuzz)
        return 0
    if options.node is not None:
        print_node(options.node)
        return 0
    size = options.size
    if size is Size.SMOKE:
        print_fuzz(3)
        print_node(2)
    detectors = {'OpenCV': opencv_defaults(), 'here': this_project()}
    samples, degraded_samples, empty = size.of((12, 5, 10_000), (1, 1, 45), (1, 1, 9))
    print(f'OpenCV {cv2.__version__}, {samples} images a cell\n')

    print_times(size.of(60, 12, 1))
    print_lights(size.of(60, 3, 1))
    print_photos(options.photos, size.of(1, 12, 100))
    print_poses(size.of(6000, 300, 10))
    print_foreign(size.of(1, 40, 400))
    print_kalibr(size.of(5, 1, 1))
    print_corners(None if options.photos is None else Path(options.photos))
    print_edge(size.of(60, 4, 1), size.of(GAPS, GAPS, GAPS[:1]))
    print_natural(size.of(1500, 40, 1))
    cells = grid(detectors, samples)
    for name in detectors:
        rows = [
            [f'{distance} m', *(f'{cells[distance, a][name].recall:.2f}' for a in ANGLES)]
            for distance in DISTANCES
        ]
        print_table([f'recall, {name}', *(f'{angle} deg' for angle in ANGLES)], rows)

    def part(chosen: Callable[[int, int], bool]) -> Tallies:
        keys = [key for key in cells if chosen(*key)]
        return {name: summed([cells[key][name] for key in keys]) for name in detectors}

    print_recall(
        'distance and angle',
        {
            'whole grid': part(lambda _distance, _angle: True),
            'far: 5-9 m, to 45 deg': part(lambda distance, angle: distance >= 5 and angle <= 45),
            'oblique: from 70 deg, to 3 m': part(
                lambda distance, angle: distance <= 3 and angle >= 70
            ),
        },
    )
    conditions = degraded(detectors, degraded_samples, size.of((2, 3, 4, 5), (2, 3, 4, 5), (2,)))
    whole = {name: summed([each[name] for each in conditions.values()]) for name in detectors}
    print_recall('2-5 m, to 60 deg', {**conditions, 'all degraded': whole})

    kinds: defaultdict[str, Tallies] = defaultdict(lambda: {name: Tally() for name in detectors})
    for kind, image in without_markers(range(empty)):
        for name, detect in detectors.items():
            kinds[kind][name].look(detect, image, [])
    total = {name: summed([each[name] for each in kinds.values()]) for name in detectors}
    print_table(
        [
            'no marker in the image',
            'images',
            'known ids OpenCV',
            'here',
            'other ids OpenCV',
            'here',
            'ms OpenCV',
            'here',
        ],
        [
            [
                kind,
                str(tallies['here'].images),
                str(tallies['OpenCV'].wrong_known),
                str(tallies['here'].wrong_known),
                str(tallies['OpenCV'].wrong_other),
                str(tallies['here'].wrong_other),
                f'{1e3 * np.mean(tallies["OpenCV"].seconds):.1f}',
                f'{1e3 * np.mean(tallies["here"].seconds):.1f}',
            ]
            for kind, tallies in {**kinds, 'all': total}.items()
        ],
    )
    if options.picture is not None:
        draw(cells, options.picture)
        print(f'recall is drawn in {options.picture}')
    return 0


def draw(cells: dict[tuple[int, int], Tallies], path: Path) -> None:
    """Two maps of recall, side by side."""
    side, left, top = 56, 70, 70
    width = left + side * len(ANGLES) + 30
    height = top + side * len(DISTANCES) + 60
    sheets = []
    for name in ('OpenCV', 'here'):
        sheet = np.full((height, width, 3), 255, np.uint8)
        title = "OpenCV's defaults" if name == 'OpenCV' else 'this project'
        tallies = summed([each[name] for each in cells.values()])
        label = f'{title}: recall {tallies.recall:.2f}'
        cv2.putText(sheet, label, (left, 34), 0, 0.7, (30, 30, 30), 2, cv2.LINE_AA)
        for row, distance in enumerate(DISTANCES):
            y = top + row * side
            text = f'{distance} m'
            cv2.putText(sheet, text, (16, y + 34), 0, 0.5, (60, 60, 60), 1, cv2.LINE_AA)
            for column, angle in enumerate(ANGLES):
                x = left + column * side
                recall = cells[distance, angle][name].recall
                grey = np.array([[round(recall * 255)]], np.uint8)
                color = cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS)[0, 0].tolist()
                cv2.rectangle(sheet, (x, y), (x + side - 3, y + side - 3), color, -1)
                ink = (255, 255, 255) if recall < 0.7 else (20, 20, 20)
                text = f'{recall:.2f}'
                cv2.putText(sheet, text, (x + 9, y + 32), 0, 0.48, ink, 1, cv2.LINE_AA)
        for column, angle in enumerate(ANGLES):
            position = (left + column * side + 12, top + side * len(DISTANCES) + 20)
            cv2.putText(sheet, f'{angle}', position, 0, 0.5, (60, 60, 60), 1, cv2.LINE_AA)
        position = (left, top + side * len(DISTANCES) + 45)
        text = 'degrees between line of sight and the normal of the panel'
        cv2.putText(sheet, text, position, 0, 0.5, (60, 60, 60), 1, cv2.LINE_AA)
        sheets.append(sheet)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode('.png', np.hstack(sheets))[1].tobytes())


if __name__ == '__main__':
    sys.exit(main())
