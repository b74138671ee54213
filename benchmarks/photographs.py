"""Real photographs with markers, as taken and varied in ways that leave the markers readable."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]
Corners = npt.NDArray[np.float64]
Marker = tuple[int, Corners]

AS_TAKEN = 'as taken'
_NEAR = 8.0
_BESIDE = 3.0


@dataclass(frozen=True, eq=False)
class Photograph:
    """A photograph and the markers that are known to be in it.

    Attributes:
        name: Its file.
        dictionary: Name of the markers' dictionary.
        image: (height, width, 3) BGR.
        markers: Id and middle in pixels of each.
    """

    name: str
    dictionary: str
    image: Image
    markers: list[Marker]

    def listed(self, found: list[Marker]) -> list[int | None]:
        """Return which of its markers each one found, of an id and corners (4, 2), is."""
        left = dict(enumerate(self.markers))
        result: list[int | None] = []
        for marker_id, corners in found:
            middle = corners.mean(axis=0)
            reach = max(_NEAR, float(np.linalg.norm(corners - middle, axis=1).mean()))
            near = [
                index
                for index, (listed_id, centre) in left.items()
                if listed_id == marker_id and math.dist(centre, middle) < reach
            ]
            result.append(near[0] if near else None)
            left = {index: each for index, each in left.items() if index not in near[:1]}
        return result

    def painted(self, change: Callable[[Image], npt.ArrayLike]) -> Photograph:
        """Return the photograph with other grey levels."""
        return replace(self, image=np.clip(np.rint(change(self.image)), 0, 255).astype(np.uint8))

    def moved(self, homography: npt.ArrayLike, width: int, height: int) -> Photograph:
        """Return the photograph under a homography (3, 3), with the markers that stay in it."""
        matrix = np.asarray(homography, dtype=float)
        image = cv2.warpPerspective(self.image, matrix, (width, height))
        markers = [
            (marker_id, cv2.perspectiveTransform(middle.reshape(1, 1, 2), matrix)[0, 0])
            for marker_id, middle in self.markers
        ]
        markers = [
            (marker_id, middle)
            for marker_id, middle in markers
            if (middle >= 0).all() and (middle < (width, height)).all()
        ]
        return replace(self, image=np.asarray(image, dtype=np.uint8), markers=markers)

    def scaled(self, factor: float) -> Photograph:
        """Return the photograph with more or fewer pixels."""
        way = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
        image = cv2.resize(self.image, None, fx=factor, fy=factor, interpolation=way)
        markers = [(marker_id, (middle + 0.5) * factor - 0.5) for marker_id, middle in self.markers]
        return replace(self, image=np.asarray(image, dtype=np.uint8), markers=markers)

    def turned(self, degrees: float) -> Photograph:
        """Return the photograph turned about its middle; black beyond its edges."""
        height, width = self.image.shape[:2]
        cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        wide = math.ceil(abs(width * cosine) + abs(height * sine) - 1e-6)
        high = math.ceil(abs(width * sine) + abs(height * cosine) - 1e-6)
        x, y = (width - 1) / 2, (height - 1) / 2
        right, down = (wide - 1) / 2 - cosine * x + sine * y, (high - 1) / 2 - sine * x - cosine * y
        return self.moved([[cosine, -sine, right], [sine, cosine, down], [0, 0, 1]], wide, high)

    def tilted(self) -> Photograph:
        """Return the photograph with its right side a fifth lower than its left one."""
        height, width = self.image.shape[:2]
        corners = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
        inwards = np.array([[0, 0], [0, 0.1], [0, -0.1], [0, 0]], np.float32) * height
        return self.moved(cv2.getPerspectiveTransform(corners, corners + inwards), width, height)

    def cut(self) -> Photograph:
        """Return the photograph cut a few pixels beyond the outermost markers OpenCV sees."""
        height, width = self.image.shape[:2]
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        outlines, *_ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(self.image)
        if not len(outlines):
            return self
        points = np.concatenate(outlines, axis=1)[0]
        left, top = np.maximum(points.min(axis=0) - _BESIDE, 0).astype(int).tolist()
        right, bottom = np.minimum(points.max(axis=0) + _BESIDE, (width, height)).astype(int)
        shift = [[1, 0, -left], [0, 1, -top], [0, 0, 1]]
        return self.moved(shift, int(right) - left, int(bottom) - top)


def photographs_in(folder: Path) -> Iterator[Photograph]:
    """Photographs of a folder with `markers.json`."""
    for entry in json.loads((folder / 'markers.json').read_text()):
        image = cv2.imread(str(folder / entry['file']))
        if image is None:
            raise ValueError(f'{folder / entry["file"]} cannot be read')
        markers = [(each['id'], np.array(each['centre'])) for each in entry['markers']]
        yield Photograph(
            entry['file'], entry['dictionary'], np.asarray(image, dtype=np.uint8), markers
        )


def _gamma(power: float) -> Callable[[Photograph], Photograph]:
    return lambda photo: photo.painted(lambda image: 255.0 * (image / 255.0) ** power)


def _linear(gain: float, offset: float) -> Callable[[Photograph], Photograph]:
    return lambda photo: photo.painted(lambda image: gain * image.astype(float) + offset)


def _compressed(image: Image) -> Image:
    packed = cv2.imencode('.jpg', image, (cv2.IMWRITE_JPEG_QUALITY, 30))[1]
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.uint8)


def _noisy(image: Image) -> npt.ArrayLike:
    return image + np.random.default_rng(image.shape).normal(0.0, 10.0, image.shape)


VARIATIONS: dict[str, Callable[[Photograph], Photograph]] = {
    AS_TAKEN: lambda photo: photo,
    **{
        f'scaled by {factor}': (lambda photo, f=factor: photo.scaled(f))
        for factor in (0.4, 0.6, 1.5, 2.0)
    },
    **{
        f'turned by {angle} degrees': (lambda photo, a=angle: photo.turned(a)) for angle in (17, 90)
    },
    'seen from the right': Photograph.tilted,
    'gamma 0.5': _gamma(0.5),
    'gamma 2': _gamma(2.0),
    'contrast halved, dark': _linear(0.5, 0.0),
    'contrast halved, bright': _linear(0.5, 120.0),
    'overexposed by half': _linear(1.5, 0.0),
    'JPEG quality 30': lambda photo: photo.painted(_compressed),
    'blur of 1 pixel': lambda photo: photo.painted(
        lambda image: cv2.GaussianBlur(image, (0, 0), 1.0)
    ),
    'noise of 10 levels': lambda photo: photo.painted(_noisy),
    'grey': lambda photo: photo.painted(lambda image: cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)),
    'cut beside the markers': Photograph.cut,
    'red and blue swapped': lambda photo: photo.painted(lambda image: image[..., ::-1]),
}
"""Names of variations, and what each makes of a photograph."""
