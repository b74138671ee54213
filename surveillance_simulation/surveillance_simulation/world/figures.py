"""The figure of a standing person, as a stack of elliptic slices.

A detector of persons that was trained on photographs has to see a person in it: so it has the
proportions of a grown-up (Drillis and Contini 1966: lengths as parts of the stature), rounded
limbs, hair, shoes and a face, and stands in mid-step: from the side, legs side by side look like a
post. It is 1.75 m tall and looks along x.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from surveillance_simulation.world.things import Colour, Part, Shape, Thing, checked

_TROUSERS, _SHIRT, _SKIN, _HAIR = (58, 68, 104), (150, 62, 60), (214, 168, 138), (58, 42, 32)
_SHOE, _EYE, _LIP = (44, 38, 36), (46, 36, 32), (160, 92, 84)
_Ring = tuple[float, float, float, float, float]
"""Height, x and y of the middle, length and width, metres."""

_STEP, _SWING = 0.2, 0.22
"""How far a foot stands before the body's middle, or behind it, and a hand hangs, metres."""
_HIP, _SHOULDER, _ARM_LENGTH = 0.88, 1.42, 0.7
"""Heights that legs and arms hang from, and how far the arms reach down, metres."""

_LEG: tuple[_Ring, ...] = (
    (0.06, 0.0, 0.11, 0.095, 0.085),
    (0.16, 0.0, 0.11, 0.1, 0.1),
    (0.34, -0.01, 0.11, 0.13, 0.125),
    (0.48, 0.0, 0.105, 0.125, 0.12),
    (0.7, 0.0, 0.1, 0.165, 0.16),
    (0.88, 0.0, 0.09, 0.19, 0.17),
)
_TRUNK: tuple[_Ring, ...] = (
    (0.84, 0.0, 0.0, 0.21, 0.34),
    (0.94, 0.0, 0.0, 0.22, 0.35),
    (1.08, 0.0, 0.0, 0.2, 0.3),
    (1.26, 0.01, 0.0, 0.23, 0.35),
    (1.36, 0.0, 0.0, 0.21, 0.39),
    (1.42, 0.0, 0.0, 0.16, 0.36),
    (1.47, 0.0, 0.0, 0.12, 0.2),
)
_SLEEVE: tuple[_Ring, ...] = (
    (1.16, -0.01, 0.245, 0.105, 0.1),
    (1.3, 0.0, 0.22, 0.12, 0.11),
    (1.42, 0.0, 0.185, 0.12, 0.12),
)
_ARM: tuple[_Ring, ...] = (
    (0.72, 0.05, 0.265, 0.05, 0.03),
    (0.8, 0.045, 0.27, 0.085, 0.04),
    (0.88, 0.035, 0.27, 0.06, 0.05),
    (1.04, 0.01, 0.265, 0.08, 0.075),
    (1.18, -0.01, 0.245, 0.085, 0.08),
)
_NECK: tuple[_Ring, ...] = ((1.45, 0.0, 0.0, 0.12, 0.115), (1.55, 0.01, 0.0, 0.11, 0.11))
_HEAD: tuple[_Ring, ...] = (
    (1.51, 0.045, 0.0, 0.08, 0.075),
    (1.55, 0.025, 0.0, 0.16, 0.125),
    (1.62, 0.01, 0.0, 0.2, 0.15),
    (1.68, 0.01, 0.0, 0.195, 0.152),
    (1.71, 0.01, 0.0, 0.18, 0.145),
)
_CROWN: tuple[_Ring, ...] = (
    (1.69, 0.005, 0.0, 0.205, 0.165),
    (1.72, 0.005, 0.0, 0.175, 0.145),
    (1.75, 0.0, 0.0, 0.09, 0.08),
)
_BACK_OF_HEAD: tuple[_Ring, ...] = (
    (1.56, -0.045, 0.0, 0.09, 0.12),
    (1.61, -0.025, 0.0, 0.15, 0.162),
    (1.69, -0.02, 0.0, 0.165, 0.168),
)


def person(name: str, x: float, y: float, yaw: float) -> Thing:
    """Return a person of 1.75 m who stands on both legs; the lidar meets the shanks."""
    return checked(Thing(name, 'person', x, y, yaw, _standing()))


@cache
def _standing() -> tuple[Part, ...]:
    found: list[Part] = []
    for side in (-1.0, 1.0):
        found += _stack(_swung(_LEG, _HIP, _STEP * side / _HIP), 0.035, _TROUSERS, side)
        shoe = 0.05 + _STEP * side
        found.append(Part(Shape.BOX, shoe, 0.11 * side, 0.27, 0.095, 0.0, 0.08, _SHOE))
        # The arm goes back where the leg goes ahead.
        swing = -_SWING * side / _ARM_LENGTH
        found += _stack(_swung(_SLEEVE, _SHOULDER, swing), 0.03, _SHIRT, side)
        found += _stack(_swung(_ARM, _SHOULDER, swing), 0.03, _SKIN, side)
        # Eye and brow, a little before the face.
        for bottom, top, wide in ((1.632, 1.644, 0.026), (1.658, 1.665, 0.036)):
            found.append(Part(Shape.BOX, 0.092, 0.032 * side, 0.02, wide, bottom, top, _EYE))
    found += _stack(_TRUNK[:2], 0.025, _TROUSERS)
    found += _stack(_TRUNK[1:], 0.025, _SHIRT)
    found += _stack(_NECK, 0.05, _SKIN)
    found += _stack(_HEAD, 0.0125, _SKIN)
    found += _stack(_BACK_OF_HEAD, 0.0225, _HAIR)
    found += _stack(_CROWN, 0.02, _HAIR)
    found.append(Part(Shape.BOX, 0.112, 0.0, 0.025, 0.026, 1.585, 1.635, _SKIN))
    found.append(Part(Shape.BOX, 0.098, 0.0, 0.016, 0.05, 1.56, 1.57, _LIP))
    return tuple(found)


def _swung(rings: tuple[_Ring, ...], top: float, slope: float) -> tuple[_Ring, ...]:
    """Return rings of a limb that hangs from a height and swings ahead by so much a metre."""
    return tuple((each[0], each[1] + slope * max(0.0, top - each[0]), *each[2:]) for each in rings)


def _stack(
    rings: tuple[_Ring, ...], step: float, colour: Colour, side: float = 1.0
) -> Iterator[Part]:
    """Yield slices of about a thickness, metres, between rings, on one side of the body."""
    heights, values = np.array([each[0] for each in rings]), np.array(rings)[:, 1:]
    count = max(1, round((heights[-1] - heights[0]) / step))
    ends = np.linspace(heights[0], heights[-1], count + 1)
    for bottom, top in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        x, y, length, width = (
            float(np.interp((bottom + top) / 2, heights, column)) for column in values.T
        )
        yield Part(Shape.ELLIPSE, x, y * side, length, width, bottom, top, colour)
