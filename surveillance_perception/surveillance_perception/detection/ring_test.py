"""A quick look at a quadrilateral: white margin, black border, something drawn inside?

Of the hundreds of dark outlines in a textured picture only a few pass, and every marker that can
be read does. A candidate costs 73 samples here and some thousands in `template_fit`.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from surveillance_perception.detection.picture_sampling import Array, PicturePyramid, levels_for

_PER_SIDE = 6
_INNER = 5
_LEAST_CORRELATION = 0.55
_LEAST_SIDE = 0.0
_LEAST_INNER_DEVIATION = 0.28
_CELL_PIXELS = 6.0


class RingTest:
    """Samples around the border of a marker of `side` cells along its black square."""

    def __init__(self, side: int) -> None:
        self._side = side
        along = np.linspace(-0.85, 0.85, _PER_SIDE)
        inner = np.linspace(-1.0, 1.0, _INNER) * (1.0 - 3.0 / side)
        points = [_ring(along, 1.0 + 1.0 / side), _ring(along, 1.0 - 1.0 / side)]
        points.append(np.stack([each.ravel() for each in np.meshgrid(inner, inner)]))
        flat = np.concatenate(points, axis=1)
        self._grid = np.vstack([flat, np.ones(flat.shape[1])])

    def correlation(
        self, pyramid: PicturePyramid, homographies: Array, least_contrast: float
    ) -> Array:
        """How well white margin and black border correlate with the picture.

        Args:
            pyramid: The picture.
            homographies: (m, 3, 3) from marker coordinates to pixels.
            least_contrast: Grey levels from black to white below which nothing is taken for a
                marker.

        Returns:
            (m,) 0 to 1; -1 where it can be no marker.
        """
        levels = levels_for(homographies, self._side, _CELL_PIXELS)
        values = pyramid.sample(homographies, self._grid, levels).astype(float)
        count = 4 * _PER_SIDE
        margin, border, inner = (
            values[:, :count],
            values[:, count : 2 * count],
            values[:, 2 * count :],
        )
        contrast = margin.mean(axis=1) - border.mean(axis=1)
        variance = (margin.var(axis=1) + border.var(axis=1)) / 2.0
        correlation = contrast / np.sqrt(contrast**2 + 4.0 * variance + 1e-6)
        by_side = (margin - border).reshape(-1, 4, _PER_SIDE).mean(axis=2).min(axis=1)
        passed = (
            (contrast > least_contrast)
            & (correlation > _LEAST_CORRELATION)
            & (by_side > _LEAST_SIDE * contrast)
            & (inner.std(axis=1) > _LEAST_INNER_DEVIATION * contrast)
        )
        return np.where(passed, correlation, -1.0)


def _ring(along: npt.NDArray[np.float64], radius: float) -> Array:
    across = np.full_like(along, radius)
    sides = [(along, -across), (across, along), (along, across), (-across, along)]
    return np.concatenate([np.stack(side) for side in sides], axis=1)
