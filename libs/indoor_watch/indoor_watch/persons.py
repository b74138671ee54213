"""Persons in a picture.

A network of `detectors` looks at a picture as a whole, and in three overlapping squares along its
longer side, where those far away are larger. What it finds it looks at again, closer. A dark
picture is lifted before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from indoor_watch.detectors import Detector, load_detector

Picture = npt.NDArray[np.uint8]

SAME_PERSON = 0.3
"""Two finds that overlap by this part are one."""
CLOSER = (1.5, 2.5)
"""Sides of the closer looks, as parts of the person's longer side."""
MOST_LOOKED = 4
"""So many finds are looked at again, the surest: one person is enough for an alert."""
DARK = 70.0
"""A picture whose mean is below is lifted to it, grey levels of 0 to 255."""
MOST_LIFT = 0.25
"""Least exponent of the gamma that lifts it: a level of 6 becomes 100."""


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
        detector: Tells how likely persons are where.
        anybody: Also of whom it is not sure, for what is blurred.
    """

    def __init__(self, detector: Detector, *, anybody: bool = False) -> None:
        self._detector = detector
        self._threshold = detector.anybody if anybody else detector.sure
        self._closer = 0.0 if anybody else detector.closer

    def find(self, picture: Picture) -> list[Person]:
        """Return the persons in a picture, the surest first.

        Args:
            picture: (rows, columns) of grey, or (rows, columns, 3) of BGR.
        """
        if picture.ndim == 2:
            picture = np.asarray(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), np.uint8)
        picture = lifted(picture)
        rows, columns = picture.shape[:2]
        found = self._in_window(picture, (0, 0, columns, rows), self._threshold.whole)
        for window in _squares(columns, rows):
            found += self._in_window(picture, window, self._threshold.square)
        kept: list[Person] = []
        for each in sorted(found, key=lambda each: -each.confidence):
            if not any(_one_person(each, other) for other in kept):
                kept.append(each)
        if self._closer:
            looked = [self._looked_closer(picture, each) for each in kept[:MOST_LOOKED]]
            kept = [each for each in looked if each.confidence >= self._closer]
        known = [replace(each, confidence=self._sure_of(each)) for each in kept]
        return sorted(known, key=lambda each: -each.confidence)

    def _sure_of(self, person: Person) -> float:
        return self._detector.confidence(person.confidence)

    def _looked_closer(self, picture: Picture, person: Person) -> Person:
        """Return a person with the mean score of closer looks, each also mirrored.

        What happens to look like a person in one picture does not in the next one, which shows it
        larger, with less around it, or the other way round.
        """
        rows, columns = picture.shape[:2]
        left, top, width, height = person.box
        scores = []
        for around in CLOSER:
            half = around * max(width, height) / 2
            x, y = left + width / 2, top + height / 2
            low = max(0, round(x - half)), max(0, round(y - half))
            high = min(columns, round(x + half)), min(rows, round(y + half))
            part = picture[low[1] : high[1], low[0] : high[0]]
            for shown in (part, np.ascontiguousarray(part[:, ::-1])):
                scores.append(max(self._detector.look(shown)[:, 0], default=0.0))
        return replace(person, confidence=float(np.mean(scores)))

    def _in_window(
        self, picture: Picture, window: tuple[int, int, int, int], sure: float
    ) -> list[Person]:
        left, top, width, height = window
        found = []
        answer = self._detector.look(picture[top : top + height, left : left + width])
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


def load_finder(weights: str = '', runtime: str = 'auto', *, anybody: bool = False) -> PersonFinder:
    """Return a finder with a network's weights, see `load_detector`.

    Raises:
        ValueError: One line: what is missing, and how to get it.
    """
    return PersonFinder(load_detector(weights, runtime), anybody=anybody)


def lifted(picture: Picture) -> Picture:
    """Return a picture as bright as the networks know them: a dark one is lifted by a gamma.

    A gamma keeps black and white, so that a lit window stays as it is.
    """
    mean = float(picture.mean())
    if not 0.0 < mean < DARK:
        return picture
    exponent = max(MOST_LIFT, np.log(DARK / 255.0) / np.log(mean / 255.0))
    table = np.rint(255.0 * (np.arange(256) / 255.0) ** exponent)
    return np.asarray(cv2.LUT(picture, table.astype(np.uint8)), np.uint8)


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
