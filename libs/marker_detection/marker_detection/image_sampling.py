"""Reading grey levels of an image under many homographies at once.

Marker coordinates: a marker's black square spans [-1, 1] in x (right) and y (down). A homography
takes them to pixels, pixel centres having integer coordinates.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Quads = npt.NDArray[np.float64]
"""(m, 4, 2) corners in pixels, clockwise."""
Indices = npt.NDArray[np.int64]
Patches = npt.NDArray[np.float32]
Reals = npt.NDArray[np.floating[Any]]
"""Of single or double precision; numpy's own types do not say which for some operations."""
Grey = npt.NDArray[np.uint8]

_TO_UNIT_SQUARE = np.array([[0.5, 0.0, 0.5], [0.0, 0.5, 0.5], [0.0, 0.0, 1.0]])
_CORNERS = np.array([[-1.0, -1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])
_LAST_LEVEL = 5
# rows that OpenCV's `remap` takes at once: it asks for fewer than SHRT_MAX
_MOST_ROWS = 2**15 - 2
# pixels of the read image that a sample lies at least from the middles of the outermost ones
_INSIDE = 0.5


class ImagePyramid:
    """A grey image and its halves, so that a large marker is read from few averaged pixels."""

    def __init__(self, image: Grey) -> None:
        self._levels = [image]

    def sample(self, homographies: Array, grid: Patches, levels: Indices) -> Patches:
        """Return grey levels under homographies, linearly interpolated.

        Args:
            homographies: (m, 3, 3).
            grid: (3, n) homogeneous marker coordinates.
            levels: (m,) how often the image is halved before it is read.

        Returns:
            (m, n) grey levels; outside the image those of its edge.
        """
        # pixel centres have whole coordinates in each of the images
        half = homographies[:, 2:] / 2.0
        shrunk = (homographies[:, :2] + half) * 0.5 ** levels[:, None, None] - half
        # OpenCV interpolates between 32 steps of a pixel: single precision is more than enough
        points = np.concatenate([shrunk, homographies[:, 2:]], axis=1).astype(np.float32) @ grid
        depth = points[:, 2]
        depth = np.where(np.abs(depth) < 1e-6, np.float32(1e-6), depth)
        x, y = points[:, 0] / depth, points[:, 1] / depth
        used = np.unique(levels).tolist()
        if len(used) == 1:
            return self._read(x, y, used[0])
        patches = np.empty(x.shape, np.float32)
        for level in used:
            chosen = levels == level
            patches[chosen] = self._read(x[chosen], y[chosen], level)
        return patches

    def shown(self, homographies: Array, grid: Patches, levels: Indices) -> npt.NDArray[np.bool_]:
        """Return which samples (m, n) are of the image itself, not of what goes on beyond its edge.

        Those count that are interpolated between whole pixels of the halved image alone.

        Args:
            homographies: As in `sample`.
            grid: As in `sample`.
            levels: As in `sample`.
        """
        points = homographies @ grid
        shown = points[:, 2] > 0.0
        depth = np.where(shown, points[:, 2], 1.0)
        size = 2.0 ** levels[:, None]
        height, width = self._levels[0].shape
        for axis, length in enumerate((width, height)):
            # in pixels of the image that is read
            places = (points[:, axis] / depth + 0.5) / size - 0.5
            shown &= (places >= _INSIDE) & (places <= length // size - 1.0 - _INSIDE)
        return np.asarray(shown)

    def _read(self, x: Patches, y: Patches, level: int) -> Patches:
        while len(self._levels) <= level:
            self._levels.append(halved(self._levels[-1]))
        sampled = np.empty(x.shape, np.float32)
        for start in range(0, len(x), _MOST_ROWS):
            part = slice(start, start + _MOST_ROWS)
            sampled[part] = cv2.remap(
                self._levels[level],
                x[part],
                y[part],
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
        return sampled


def halved(image: Grey) -> Grey:
    """Return an image of half the size, rounded up: each pixel is the mean of four.

    Of an odd number of rows or columns the last one counts twice. Scaling by any other factor than
    2 would move what is far from the upper left corner, by as many pixels as it was scaled often.
    """
    below, right = image.shape[0] % 2, image.shape[1] % 2
    if below or right:
        image = np.asarray(
            cv2.copyMakeBorder(image, 0, below, 0, right, cv2.BORDER_REPLICATE), np.uint8
        )
    size = (image.shape[1] // 2, image.shape[0] // 2)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def beside_sides(along: Array, out: Array) -> Array:
    """Return places (2, 4 * k * n) along the sides of squares around the marker.

    Args:
        along: (k,) where along each side, from -1 to 1.
        out: (n,) half the width of each square: 1 is the black square.

    Returns:
        The upper side's, then those of the right, lower and left one; of each the places `along`,
        and at each of them `out`.
    """
    x, y = (each.ravel() for each in np.meshgrid(along, out, indexing='ij'))
    sides = ((x, -y), (y, x), (x, y), (-y, x))
    return np.concatenate([np.stack(side) for side in sides], axis=1)


def homogeneous(points: Array) -> Patches:
    """Return marker coordinates (2, n) as a grid (3, n) to sample at."""
    return np.vstack([points, np.ones(points.shape[1])]).astype(np.float32)


def cell_widths(homographies: Array, cells: int) -> Array:
    """Width in pixels (m,) of a marker's cell across its narrower direction."""
    return np.asarray(np.linalg.norm(jacobians_of(homographies), axis=1).min(axis=1) * 2.0 / cells)


def levels_for(homographies: Array, cells: int, cell_pixels: float) -> Indices:
    """Return how often to halve the image so that a cell is at most `cell_pixels` wide."""
    width = cell_widths(homographies, cells)
    level = np.floor(np.log2(np.maximum(width / cell_pixels, 1e-3))) + 1
    return np.asarray(np.clip(level, 0, _LAST_LEVEL), dtype=np.int64)


def homographies_of(quads: Quads) -> Array:
    """Homographies (m, 3, 3) from marker coordinates to quads (m, 4, 2), clockwise.

    Closed form of a square's projection (Heckbert, "Fundamentals of texture mapping and image
    warping", 1989, section 2.2.3).
    """
    p0, p1, p2, p3 = (quads[:, index] for index in range(4))
    d1, d2, total = p1 - p2, p3 - p2, p0 - p1 + p2 - p3
    determinant = d1[:, 0] * d2[:, 1] - d2[:, 0] * d1[:, 1]
    determinant = np.where(np.abs(determinant) < 1e-9, 1e-9, determinant)
    g = (total[:, 0] * d2[:, 1] - d2[:, 0] * total[:, 1]) / determinant
    h = (d1[:, 0] * total[:, 1] - total[:, 0] * d1[:, 1]) / determinant
    result = np.empty((len(quads), 3, 3))
    result[:, :2, 0] = p1 - p0 + g[:, None] * p1
    result[:, :2, 1] = p3 - p0 + h[:, None] * p3
    result[:, :2, 2] = p0
    result[:, 2] = np.stack([g, h, np.ones_like(g)], axis=1)
    result = result @ _TO_UNIT_SQUARE
    return np.asarray(result / result[:, 2:, 2:])


def corners_of(homographies: Array) -> Quads:
    """Corners (m, 4, 2) of the black square in pixels, clockwise from marker (-1, -1)."""
    points = homographies @ _CORNERS.T
    return np.asarray((points[:, :2] / points[:, 2:]).transpose(0, 2, 1))


def jacobians_of(homographies: Array) -> Array:
    """Pixels per marker unit (m, 2, 2) at the marker's centre."""
    depth = homographies[:, 2, 2][:, None, None]
    centre = homographies[:, :2, 2:] / depth
    return np.asarray((homographies[:, :2, :2] - centre * homographies[:, 2:, :2]) / depth)
