"""Directions in which to look so that no direction stays unseen.

Views stand in rows of equal elevation. How far a row may be from the next, and a view from the one
beside it, follows from what a rectangular image covers: the condition is looked at exactly, at
closely spaced directions of each row's band, instead of taking the image for a rectangle of
angles, which it is not away from the horizon.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from surveillance_runtime.robot_arm import Array

_BAND_SAMPLES = 25
_AZIMUTH_STEP = math.radians(0.5)
_MOST_ROWS = 24


@dataclass(frozen=True)
class View:
    """A line of sight.

    Attributes:
        azimuth: From x towards y, rad, -pi to pi.
        elevation: Above the horizon, rad.
    """

    azimuth: float
    elevation: float


def views_covering(
    horizontal: float, vertical: float, overlap: float, lowest: float, highest: float
) -> list[View]:
    """Return views that together show every direction between two elevations, all the way around.

    Args:
        horizontal: Field of view along the image's rows, rad.
        vertical: Field of view along its columns, rad.
        overlap: Share of the image's angles at its edge that does not count, 0 to 0.8, so that
            what lies on the border of a view is whole in some view.
        lowest: Lowest elevation, rad, from -pi/2.
        highest: Highest elevation, rad, to pi/2.

    Returns:
        The views in an order with short ways between them.

    Raises:
        ValueError: An angle or the overlap is out of range.
    """
    if not 0.0 < horizontal < math.pi or not 0.0 < vertical < math.pi:
        raise ValueError('fields of view must lie between 0 and pi rad')
    if not 0.0 <= overlap <= 0.8:
        raise ValueError(f'overlap must be 0 to 0.8, got {overlap:g}')
    if not -math.pi / 2 - 1e-9 <= lowest <= highest <= math.pi / 2 + 1e-9:
        raise ValueError(
            f'elevations must run upwards within -pi/2 and pi/2, got {lowest:g} to {highest:g}'
        )
    half_width = horizontal / 2.0 * (1.0 - overlap)
    half_height = vertical / 2.0 * (1.0 - overlap)
    fewest = max(1, math.ceil((highest - lowest) / (2.0 * half_height) - 1e-9))
    plans = []
    for rows in range(fewest, fewest + _MOST_ROWS):
        plan = _rows(rows, half_width, half_height, lowest, highest)
        if plan is not None:
            plans.append(plan)
            if len(plans) == 3:
                break
    if not plans:
        raise ValueError('the field of view is too narrow to cover the sphere')
    best = min(plans, key=lambda plan: sum(count for _, count in plan))
    views = []
    for index, (elevation, count) in enumerate(best):
        azimuths = [-math.pi + (k + 0.5) * 2.0 * math.pi / count for k in range(count)]
        # every other row is taken backwards: its first view is near the last one
        views += [View(each, elevation) for each in (azimuths, azimuths[::-1])[index % 2]]
    return views


def coverage(
    views: list[View],
    horizontal: float,
    vertical: float,
    lowest: float,
    highest: float,
    samples: int = 4000,
) -> float:
    """Share of the directions between two elevations that lie in at least one view's image."""
    # evenly spread directions: the golden angle between neighbours on a spiral
    index: Array = np.arange(samples, dtype=float) + 0.5
    sine = math.sin(lowest) + (math.sin(highest) - math.sin(lowest)) * index / samples
    elevation = np.asarray(np.arcsin(np.clip(sine, -1.0, 1.0)), dtype=float)
    azimuth = index * math.pi * (3.0 - math.sqrt(5.0))
    seen = np.zeros(samples, bool)
    for view in views:
        offset = azimuth - view.azimuth
        seen |= _seen(offset, elevation, view.elevation, horizontal / 2.0, vertical / 2.0)
    return float(seen.mean())


def _rows(
    rows: int, half_width: float, half_height: float, lowest: float, highest: float
) -> list[tuple[float, int]] | None:
    """Elevation and number of views of each row; None when a row has gaps."""
    height = (highest - lowest) / rows
    plan = []
    for row in range(rows):
        bottom = lowest + row * height
        middle = bottom + height / 2.0
        # a row next to a pole looks at the pole when it can see all of its band from there
        for elevation in {middle, math.copysign(math.pi / 2, middle)}:
            reach = _reach(bottom, bottom + height, elevation, half_width, half_height)
            if reach >= math.pi - 1e-9:
                plan.append((elevation, 1))
                break
        else:
            reach = _reach(bottom, bottom + height, middle, half_width, half_height)
            if reach < _AZIMUTH_STEP:
                return None
            plan.append((middle, math.ceil(math.pi / reach - 1e-9)))
    return plan


def _reach(
    bottom: float, top: float, elevation: float, half_width: float, half_height: float
) -> float:
    """Azimuth to both sides within which a view shows its whole band, rad."""
    band = np.linspace(bottom, top, _BAND_SAMPLES)[:, None]
    offsets = np.arange(0.0, math.pi + _AZIMUTH_STEP, _AZIMUTH_STEP).clip(max=math.pi)[None, :]
    whole = _seen(offsets, band, elevation, half_width, half_height).all(axis=0)
    gaps = np.flatnonzero(~whole)
    if not len(gaps):
        return math.pi
    return float(offsets[0, gaps[0] - 1]) if gaps[0] > 0 else 0.0


def _seen(
    offset: Array, elevation: Array, view: float, half_width: float, half_height: float
) -> npt.NDArray[np.bool_]:
    """Tell whether directions lie in the image of a view at azimuth 0."""
    flat, up = np.cos(elevation), np.sin(elevation)
    depth = flat * np.cos(offset) * math.cos(view) + up * math.sin(view)
    right = flat * np.sin(offset)
    above = up * math.cos(view) - flat * np.cos(offset) * math.sin(view)
    return np.asarray(
        (depth > 1e-9)
        & (np.abs(right) <= depth * math.tan(half_width) + 1e-9)
        & (np.abs(above) <= depth * math.tan(half_height) + 1e-9)
    )
