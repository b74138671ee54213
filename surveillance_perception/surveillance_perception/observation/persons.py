"""Persons in a picture, found by the pose detector of MediaPipe's BlazePose.

The network (Bazarevsky and others, BlazePose, 2020; Apache-2.0) looks at 224 by 224 pixels and
gives, for each of 2,254 anchors, a score, a box, and four points: the first is the middle of the
hips, the second lies on the circle around them that holds the whole body. A picture is looked at as
a whole, for persons nearby, in three overlapping squares, for those far away, and with a black
margin around it, for those who stand so near that they reach out of it. Its weights are a file of
the package mediapipe, which is only read: nothing is fetched, and nothing of that package runs.
`ai-edge-litert` runs the network.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float32]
Network = Callable[[Floats], tuple[Floats, Floats]]
"""Takes (1, 224, 224, 3), -1 to 1, RGB; returns (2254, 12) coordinates and (2254,) scores."""

SIDE = 224
"""Of the network's picture, pixels."""
LAYERS = ((8, 2), (16, 2), (32, 6))
"""Stride of each grid of anchors, pixels, and how many anchors stand in each of its cells."""
SURE = 0.7
"""Score from which a person is told."""
MARGIN, SURE_WITH_MARGIN = 0.2, 0.8
"""Of the picture that is looked at with a margin: that, as part of its longer side, and the score
from which a person is told there; what is no person looks more like one there."""
SAME_PERSON = 0.3
"""Two finds that overlap by this part are one."""
INSTALL = 'pip install ai-edge-litert, and pip install --no-deps mediapipe==0.10.21'
WEIGHTS = Path('modules/pose_detection/pose_detection.tflite')


@dataclass(frozen=True)
class Person:
    """A person in a picture.

    Attributes:
        box: Around the body as the network guesses it, within the picture: left, top, width and
            height, pixels.
        confidence: 0 to 1.
    """

    box: tuple[int, int, int, int]
    confidence: float


class PersonFinder:
    """Finds persons.

    Args:
        network: The pose detector.
        sure: Score from which a person is told, 0 to 1.
    """

    def __init__(self, network: Network, sure: float = SURE) -> None:
        self._network = network
        self._sure = sure
        self._anchors = _anchors()

    def find(self, picture: Picture) -> list[Person]:
        """Return the persons in a picture, the surest first.

        Args:
            picture: (rows, columns) of grey, or (rows, columns, 3) of BGR.
        """
        if picture.ndim == 2:
            picture = np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), np.uint8)
        found = [
            each
            for left, top, width, height in _windows(picture.shape[1], picture.shape[0])
            for each in self._in_window(picture, left, top, width, height)
        ]
        found += self._with_margin(picture)
        kept: list[Person] = []
        for each in sorted(found, key=lambda each: -each.confidence):
            if not any(_one_person(each, other) for other in kept):
                kept.append(each)
        return kept

    def _with_margin(self, picture: Picture) -> list[Person]:
        margin = round(MARGIN * max(picture.shape[:2]))
        sides = (margin, margin, margin, margin)
        wide = np.asarray(cv2.copyMakeBorder(picture, *sides, cv2.BORDER_CONSTANT), np.uint8)
        found = []
        for each in self._in_window(wide, 0, 0, wide.shape[1], wide.shape[0]):
            left, top, width, height = each.box
            low = np.array([left, top]) - margin
            box = _box(low, low + np.array([width, height]), picture)
            if each.confidence >= SURE_WITH_MARGIN and min(box[2:]) > 0:
                found.append(replace(each, box=box))
        return found

    def _in_window(
        self, picture: Picture, left: int, top: int, width: int, height: int
    ) -> list[Person]:
        # The whole window with its proportions, black beside it, as the network was trained.
        scale = SIDE / max(width, height)
        size = max(1, round(width * scale)), max(1, round(height * scale))
        window = picture[top : top + height, left : left + width]
        method = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR
        canvas = np.zeros((SIDE, SIDE, 3), np.uint8)
        x, y = (SIDE - size[0]) // 2, (SIDE - size[1]) // 2
        canvas[y : y + size[1], x : x + size[0]] = cv2.resize(window, size, interpolation=method)
        values = canvas[None, :, :, ::-1].astype(np.float32) / 127.5 - 1.0
        coordinates, scores = self._network(values)
        sure = 1.0 / (1.0 + np.exp(-np.clip(scores.astype(float), -100.0, 100.0)))
        found = []
        for number in np.flatnonzero(sure >= self._sure):
            # Offsets are in pixels of the network's picture, from the anchor's middle.
            points = coordinates[number].reshape(-1, 2).astype(float)
            points += self._anchors[number] * SIDE
            hips, rim = points[2], points[3]
            # The body lies within the circle about the hips that goes through the rim.
            reach = math.dist(hips, rim)
            low, high = hips - reach, hips + reach
            offset = np.array([left, top]) - np.array([x, y]) / scale
            body = _box(low / scale + offset, high / scale + offset, picture)
            if min(body[2:]) > 0:
                found.append(Person(body, float(sure[number])))
        return found


def load_finder(weights: str = '', sure: float = SURE) -> PersonFinder:
    """Return a finder with the network's weights.

    Args:
        weights: The file `pose_detection.tflite`; empty: the one in the package mediapipe.
        sure: Score from which a person is told, 0 to 1.

    Raises:
        ValueError: One line: what is missing, and how to get it.
    """
    path = Path(weights) if weights else _installed_weights()
    if importlib.util.find_spec('ai_edge_litert') is None:
        raise ValueError(f'persons are not looked for: no package ai_edge_litert; {INSTALL}')
    litert = importlib.import_module('ai_edge_litert.interpreter')

    try:
        interpreter: Any = litert.Interpreter(model_path=str(path), num_threads=1)
        interpreter.allocate_tensors()
        (put,) = interpreter.get_input_details()
        outputs = {
            int(each['shape'][-1]): each['index'] for each in interpreter.get_output_details()
        }
        shapes = tuple(map(int, put['shape'])), set(outputs)
    except (ValueError, OSError, RuntimeError) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ValueError(f'person_weights {path}: {why}') from None
    if shapes != ((1, SIDE, SIDE, 3), {12, 1}):
        raise ValueError(f'person_weights {path}: expected the network pose_detection.tflite')

    def network(values: Floats) -> tuple[Floats, Floats]:
        interpreter.set_tensor(put['index'], values)
        interpreter.invoke()
        return interpreter.get_tensor(outputs[12])[0], interpreter.get_tensor(outputs[1])[0, :, 0]

    return PersonFinder(network, sure)


def _installed_weights() -> Path:
    found = importlib.util.find_spec('mediapipe')
    for folder in [] if found is None else (found.submodule_search_locations or []):
        if (path := Path(folder) / WEIGHTS).is_file():
            return path
    raise ValueError(
        f'persons are not looked for: no package mediapipe with {WEIGHTS.name}; {INSTALL}'
    )


def _anchors() -> npt.NDArray[np.float64]:
    """Return the anchors' middles as parts of the picture's side, (2254, 2)."""
    found = []
    for stride, count in LAYERS:
        cells = SIDE // stride
        middles = (np.arange(cells) + 0.5) / cells
        x, y = np.meshgrid(middles, middles)
        found.append(np.repeat(np.stack([x.ravel(), y.ravel()], axis=1), count, axis=0))
    return np.concatenate(found)


def _windows(width: int, height: int) -> list[tuple[int, int, int, int]]:
    """Return the whole picture and three squares along its longer side."""
    side = min(width, height)
    rest = max(width, height) - side
    whole = (0, 0, width, height)
    starts = sorted({0, rest // 2, rest})
    # A square that would be enlarged shows nothing new, and lines of text like persons.
    if rest < 0.1 * side or side < SIDE:
        return [whole]
    if width >= height:
        return [whole, *((start, 0, side, side) for start in starts)]
    return [whole, *((0, start, side, side) for start in starts)]


def _box(
    low: Sequence[float] | Any, high: Sequence[float] | Any, picture: Picture
) -> tuple[int, int, int, int]:
    """Return left, top, width and height of what lies within the picture, pixels."""
    limits = np.array([picture.shape[1], picture.shape[0]])
    start = np.clip(np.floor(low), 0, limits).astype(int)
    end = np.clip(np.ceil(high), 0, limits).astype(int)
    width, height = (end - start).tolist()
    return int(start[0]), int(start[1]), int(width), int(height)


def _one_person(one: Person, other: Person) -> bool:
    """Tell whether two finds are one person: their boxes overlap, or one lies in the other."""
    first, second = one.box, other.box
    width = min(first[0] + first[2], second[0] + second[2]) - max(first[0], second[0])
    height = min(first[1] + first[3], second[1] + second[3]) - max(first[1], second[1])
    common = max(0, width) * max(0, height)
    areas = first[2] * first[3], second[2] * second[3]
    return common > SAME_PERSON * (sum(areas) - common) or common > 0.7 * min(areas)
