"""What surfaces look like: plaster, floor, door leaves, marker panels, as pictures in RGB.

Everything is drawn by the program from fixed seeds, so that a place looks the same in every run.
"""

from __future__ import annotations

from functools import cache, lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from floor_plans import PlaceError

Texture = npt.NDArray[np.uint8]

TILE = 2.0
"""Side of the piece of wall or floor that a repeated texture covers, metres."""

_TEXELS, _CELL = 384, 24
"""Sides of a texture and of a cell of a marker's code, texels."""
_PAPER, _INK = 228, 22

MARGIN_CELLS = 1.5
"""White border around a marker, in cells of its code."""


@cache
def plaster() -> Texture:
    """Return painted plaster: one tile."""
    rng = np.random.default_rng(11)
    grey = 205 + 5 * _cloud(rng, 6) + rng.normal(0, 1.2, (_TEXELS, _TEXELS))
    return _tinted(grey, (1.0, 0.985, 0.94))


@cache
def floor() -> Texture:
    """Return square stone tiles with joints: one tile of the texture, four by four stones."""
    rng = np.random.default_rng(12)
    stones = 4
    side = _TEXELS // stones
    grey = 148 + 7 * _cloud(rng, 24) + rng.normal(0, 2.0, (_TEXELS, _TEXELS))
    grey += np.kron(rng.normal(0, 4.0, (stones, stones)), np.ones((side, side)))
    for line in range(0, _TEXELS, side):
        grey[line : line + 2] -= 38
        grey[:, line : line + 2] -= 38
    return _tinted(grey, (1.0, 0.95, 0.88))


@cache
def leaf() -> Texture:
    """Return a door leaf with two panels and a handle."""
    rng = np.random.default_rng(13)
    grain = rng.normal(0, 9, (1, _TEXELS)) + rng.normal(0, 2, (_TEXELS, _TEXELS))
    picture = _tinted(
        np.asarray(150 + cv2.GaussianBlur(grain, (0, 0), 2.0), np.float64), (1.0, 0.74, 0.5)
    )
    for top, bottom in ((0.08, 0.45), (0.55, 0.93)):
        corners = [(int(0.14 * _TEXELS), int(share * _TEXELS)) for share in (top, bottom)]
        opposite = (int(0.86 * _TEXELS), corners[1][1])
        cv2.rectangle(picture, corners[0], opposite, (96, 66, 40), 3)
    cv2.circle(picture, (int(0.92 * _TEXELS), int(0.51 * _TEXELS)), 9, (200, 200, 190), -1)
    return picture


@cache
def barrel() -> Texture:
    """Return the side of an obstacle: orange with white bands."""
    picture = np.empty((96, 32, 3), np.uint8)
    picture[:] = (226, 104, 28)
    picture[24:36] = picture[60:72] = (240, 240, 236)
    return picture


@lru_cache(64)
def plain(colour: tuple[int, int, int]) -> Texture:
    """Return a surface of one colour with a little grain."""
    rng = np.random.default_rng(14)
    grain = rng.normal(0.0, 3.0, (64, 64, 1)) + np.asarray(colour, float)
    return np.asarray(np.clip(grain, 0, 255), np.uint8)


@cache
def station() -> Texture:
    """Return the charging plate on the floor: yellow and black stripes around a dark plate."""
    row, column = np.mgrid[0:192, 0:192]
    stripes = ((row + column) // 16) % 2 == 0
    picture = np.where(stripes[..., None], (236, 196, 30), (30, 30, 30)).astype(np.uint8)
    picture[24:-24, 24:-24] = (62, 70, 78)
    cv2.putText(picture, 'E', (62, 130), cv2.FONT_HERSHEY_DUPLEX, 3.2, (90, 220, 120), 6)
    return picture


@cache
def marker_panel(dictionary: str, marker_id: int, state: str) -> Texture:
    """Return a marker on its white sheet as it hangs: whole, broken or covered.

    Args:
        dictionary: OpenCV's name of the dictionary, e.g. DICT_5X5_100.
        marker_id: Id within the dictionary.
        state: 'whole'; 'broken', a corner torn off; 'covered' by a grey sheet.

    Raises:
        PlaceError: There is no such dictionary, or no such id in it.
    """
    known = aruco_dictionary(dictionary)
    if not 0 <= marker_id < len(known.bytesList):
        raise PlaceError(
            (), f'marker id {marker_id}: {dictionary} holds ids 0 to {len(known.bytesList) - 1}'
        )
    cells = known.markerSize + 2
    margin, width = round(MARGIN_CELLS * _CELL), cells * _CELL
    sheet = np.full((width + 2 * margin,) * 2, _PAPER, np.uint8)
    code = cv2.aruco.generateImageMarker(known, marker_id, width)
    inner = slice(margin, margin + width)
    sheet[inner, inner] = np.where(code > 127, _PAPER, _INK)
    side = len(sheet)
    if state == 'broken':
        torn = np.array([[0, int(0.7 * side)], [int(0.85 * side), 0], [0, 0]])
        cv2.fillConvexPoly(sheet, torn, 160)
    elif state == 'covered':
        sheet[:] = 176
        cv2.line(sheet, (0, 0), (side, side), 150, _CELL // 6)
    return np.repeat(sheet[..., None], 3, axis=2)


def aruco_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return OpenCV's dictionary of a name such as DICT_5X5_100.

    Raises:
        PlaceError: OpenCV has no such dictionary.
    """
    number = getattr(cv2.aruco, name, None) if name.startswith('DICT_') else None
    if not isinstance(number, int):
        raise PlaceError(
            (), f"marker dictionary '{name}': expected one of OpenCV's, like DICT_5X5_100"
        )
    return cv2.aruco.getPredefinedDictionary(number)


def panel_share(dictionary: str) -> float:
    """Return the side of a whole panel as a multiple of its marker's side."""
    cells = aruco_dictionary(dictionary).markerSize + 2
    return 1.0 + 2.0 * MARGIN_CELLS / float(cells)


def _cloud(rng: np.random.Generator, waves: int) -> npt.NDArray[np.float64]:
    """Return smooth noise of unit size that repeats at the edges."""
    coarse = np.pad(rng.normal(0, 1, (waves, waves)), 2, mode='wrap')
    scale = _TEXELS / waves
    fine = cv2.resize(coarse, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    edge = int(2 * scale)
    return np.asarray(fine[edge : edge + _TEXELS, edge : edge + _TEXELS])


def _tinted(grey: npt.NDArray[np.float64], tint: tuple[float, float, float]) -> Texture:
    return np.clip(grey[..., None] * tint, 0, 255).astype(np.uint8)
