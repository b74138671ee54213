"""A photo or scan of a floor plan made a map: straightened, to scale, with its walls alone.

A plan has more than walls: text, arrows and symbols, furniture, the arcs of doors, dimension lines.
Coloured signs are taken for paper, since walls are drawn dark. Where walls are thick strokes, these
are the walls, with the lines that close gaps between them (windows). Where all strokes are thin,
walls are what runs straight for a while in some direction (openings with lines, Serra 1982), which
an arc does not. What is small and stands alone is left out in both cases.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from strict_files.files import FileError

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Corner = tuple[float, float]

SIDE = 0.025
"""Of the cells of the map that is made, metres."""
MOST_CELLS = 36_000_000
MOST_PIXELS = 50_000_000
_INK = 0.75
"""What is darker than this part of the paper around it is ink."""
_MARGIN = 0.2
"""So much of the picture beyond the corners is looked at, as a share of the rectangle's sides."""
_COLOURED = 60
"""What differs so much between its channels, of 255, is of a colour, and no wall."""
_THICK = 0.1
"""A stroke from this thickness on is a wall for sure, metres."""
_MOSTLY_THICK = 0.3
"""From this part of the ink on the walls of a plan are thick strokes."""
_STRAIGHT = 0.9
"""A line that runs straight for so long is none of an arc, metres."""
_ALONE = 1.5
"""What stands alone and is smaller from corner to corner is text or furniture, metres."""
_WINDOW = 0.35
"""A line from so long on may close a gap between thick walls, metres."""
_WALL = 0.6
"""A closed strip between two lines up to this width is the inside of a wall, metres."""
_CLOSED = 0.3
"""Between thin lines a narrower gap is wall, metres."""
_DIRECTIONS = 24


@dataclass(frozen=True)
class PlanPhoto:
    """How a picture shows a floor plan.

    Attributes:
        corners: Four points of the picture that are the corners of a rectangle of the plan, in
            turn, pixels from its left and top; empty: the picture is as straight as it is.
        scale: Two points of the picture, in the same way.
        length: How far these are apart in the building, metres.
    """

    corners: tuple[Corner, ...]
    scale: tuple[Corner, Corner]
    length: float

    @classmethod
    def from_words(cls, corners: str, scale: str) -> PlanPhoto:
        """Return what a person typed or clicked.

        Args:
            corners: `x,y x,y x,y x,y`, pixels; empty: the picture is straight.
            scale: `x,y x,y METRES`.

        Raises:
            ValueError: It is not that.
        """
        try:
            points = [tuple(_numbers(each.split(','))) for each in corners.split()]
            first, second, length = scale.split()
            ends = [tuple(_numbers(each.split(','))) for each in (first, second)]
            (metres,) = _numbers([length])
        except ValueError:
            raise ValueError(
                f'corners {corners!r:.80}, scale {scale!r:.80}: expected `x,y x,y x,y x,y` and '
                '`x,y x,y METRES`, in pixels of the picture'
            ) from None
        if len(points) not in (0, 4) or any(len(each) != 2 for each in (*points, *ends)):
            raise ValueError(
                f'corners: {len(points)} points, expected four (or none), each as x,y in pixels'
            )
        if not 0.1 <= metres <= 1000.0:
            raise ValueError(f'scale: {metres:g} m, expected 0.1 to 1000')
        corner_points = tuple((each[0], each[1]) for each in points)
        (x1, y1), (x2, y2) = ends
        return cls(corner_points, ((x1, y1), (x2, y2)), metres)


def read_photo(path: Path) -> Image:
    """Return a picture with its colours, (rows, columns, BGR).

    Raises:
        FileError: It cannot be read, or has too many pixels.
    """
    from PIL import Image as Picture
    from PIL import ImageOps

    try:
        with Picture.open(path) as found:
            if found.width * found.height > MOST_PIXELS:
                raise FileError(
                    f'{path}: {found.width} by {found.height} pixels: expected at most '
                    f'{MOST_PIXELS} in all'
                )
            # A telephone writes how it was held; where there is nothing, there is paper.
            upright = ImageOps.exif_transpose(found).convert('RGBA')
            paper = Picture.new('RGBA', upright.size, (255, 255, 255, 255))
            colours = np.asarray(Picture.alpha_composite(paper, upright).convert('RGB'))
    except Picture.DecompressionBombError:
        raise FileError(f'{path}: more pixels than any plan has') from None
    except FileError:
        raise
    except (OSError, ValueError, SyntaxError) as error:
        raise FileError(f'{path}: cannot be read as a picture: {error}') from None
    return np.ascontiguousarray(colours[..., ::-1])


def walls_of_photo(photo: Image, shown: PlanPhoto) -> NDArray[np.int8]:
    """Return the map of a photographed plan: 100 where walls are, else 0; row 0 at its top.

    Cells are `SIDE`; the paper around the building is free.

    Raises:
        ValueError: The corners or the scale are none of this picture.
    """
    plan = _to_scale(photo, shown)
    ink = _ink(plan)
    walls = _walls(ink)
    return np.where(walls, 100, 0).astype(np.int8)


def _to_scale(photo: Image, shown: PlanPhoto) -> Image:
    """Return the plan straightened, in pixels of `SIDE`."""
    rows, columns = photo.shape[:2]
    for x, y in (*shown.corners, *shown.scale):
        if not (-1 <= x <= columns + 1 and -1 <= y <= rows + 1):
            raise ValueError(
                f'({x:g}, {y:g}): expected a point of the picture, {columns} by {rows} pixels'
            )
    turn: NDArray[Any] = np.eye(3)
    size = (columns, rows)
    if shown.corners:
        points = np.array(shown.corners, np.float32)
        if not cv2.isContourConvex(points) or cv2.contourArea(points) < 0.01 * rows * columns:
            raise ValueError('corners: expected the four corners of a rectangle, in turn')
        # Clicked anywhere first and either way round: the upper left one comes first, clockwise.
        if cv2.contourArea(points, oriented=True) < 0:
            points = points[::-1]
        points = np.roll(points, -int(np.argmin(points.sum(axis=1))), axis=0)
        sides = np.hypot(*(np.roll(points, -1, axis=0) - points).T)
        wide, high = (float(max(sides[k], sides[k + 2])) for k in (0, 1))
        rectangle = np.array([[0, 0], [wide, 0], [wide, high], [0, high]], np.float32)
        turn = cv2.getPerspectiveTransform(points, rectangle)
        # All of the picture that the plan may go on to, as far as it is not much larger.
        frame = np.array([[[0, 0], [columns, 0], [columns, rows], [0, rows]]], np.float32)
        outer = cv2.perspectiveTransform(frame, turn)[0]
        low = np.maximum(outer.min(axis=0), (-_MARGIN * wide, -_MARGIN * high))
        top = np.minimum(outer.max(axis=0), ((1 + _MARGIN) * wide, (1 + _MARGIN) * high))
        turn = np.array([[1, 0, -low[0]], [0, 1, -low[1]], [0, 0, 1]]) @ turn
        size = (math.ceil(top[0] - low[0]), math.ceil(top[1] - low[1]))
    ends = cv2.perspectiveTransform(np.array([shown.scale], np.float64), turn)[0]
    apart = float(np.hypot(*(ends[1] - ends[0])))
    if apart < 5.0:
        raise ValueError('scale: its two points are one: expected two that are farther apart')
    factor = shown.length / apart / SIDE
    wide, high = (max(1, round(each * factor)) for each in size)
    if wide * high > MOST_CELLS:
        raise ValueError(
            f'scale: the plan would be {wide * SIDE:.0f} m by {high * SIDE:.0f} m: expected a '
            'building, whose longest line is clicked and given in metres'
        )
    if wide * SIDE < 2.0 or high * SIDE < 2.0:
        raise ValueError(
            f'scale: the plan would be {wide * SIDE:.2f} m by {high * SIDE:.2f} m: expected a '
            'building, whose longest line is clicked and given in metres'
        )
    paper = np.median(photo.reshape(-1, 3)[:: max(1, photo.size // 100_000)], axis=0)
    if factor < 1.0:
        # A thin line must outlive a pixel that is larger than it.
        block = max(1, int(1.0 / factor))
        photo = np.asarray(cv2.erode(photo, np.ones((block, block), np.uint8)), np.uint8)
    grown = np.diag([factor, factor, 1.0]) @ turn
    return np.asarray(
        cv2.warpPerspective(
            photo,
            grown,
            (wide, high),
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=[float(each) for each in paper],
        ),
        np.uint8,
    )


def _ink(plan: Image) -> Mask:
    """Return where a plan is drawn on: darker than the paper beside it, and of no colour."""
    # The lightest channel: what is green, red or blue is light in one of them.
    light = plan.max(axis=2)
    small = max(1, round(max(light.shape) / 400))
    wide = cv2.resize(light, None, fx=1 / small, fy=1 / small, interpolation=cv2.INTER_AREA)
    side = 2 * (max(wide.shape) // 16) + 1
    wide = cv2.dilate(wide, np.ones((side // 2 * 2 + 1,) * 2, np.uint8))
    wide = cv2.blur(wide, (side, side))
    paper = cv2.resize(wide, light.shape[::-1], interpolation=cv2.INTER_LINEAR)
    grey = light - plan.min(axis=2) < _COLOURED
    return np.asarray(grey & (light < _INK * np.maximum(paper, 60)))


def _walls(ink: Mask) -> Mask:
    thick = _opened(ink, round(_THICK / SIDE))
    thick = _without_what_stands_alone(thick, 0.0, ink)
    # What is dark up to the picture's edge is the desk or the wall that the plan lies on.
    _, pieces = cv2.connectedComponents(thick.astype(np.uint8), connectivity=8)
    beyond = np.unique(np.concatenate([pieces[0], pieces[-1], pieces[:, 0], pieces[:, -1]]))
    desk = np.isin(pieces, beyond[beyond > 0])
    thick, ink = thick & ~desk, ink & ~_dilated(desk, 3)
    # A wall that is filled with grey is drawn as two lines; what lies between is wall, too.
    if thick.sum() >= _MOSTLY_THICK * max(1, int(ink.sum())):
        grown = _grown_into(thick, ink, 2)
        lines = _straight(ink & ~_dilated(thick, 1), _WINDOW)
        walls = grown | _bridges(lines, grown)
    else:
        inked = _dilated(ink, 1)
        walls = _straight(inked, _STRAIGHT) & inked
        # Two lines side by side are the faces of a wall, also where that ends open.
        walls = _closed(walls, round(_CLOSED / SIDE))
    walls = _filled_strips(walls)
    return _without_what_stands_alone(walls, _ALONE, walls)


def _opened(mask: Mask, side: int) -> Mask:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc) > 0


def _closed(mask: Mask, side: int) -> Mask:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, disc) > 0


def _dilated(mask: Mask, by: int) -> Mask:
    side = 2 * by + 1
    return cv2.dilate(mask.astype(np.uint8), np.ones((side, side), np.uint8)) > 0


def _grown_into(seed: Mask, mask: Mask, times: int) -> Mask:
    """Return a mask grown by some cells, within another one."""
    for _ in range(times):
        seed = _dilated(seed, 1) & mask
    return seed


def _straight(mask: Mask, length: float) -> Mask:
    """Return the parts of a mask that go on straight for a length in some direction."""
    found = np.zeros(mask.shape, np.uint8)
    plain = mask.astype(np.uint8)
    reach = round(length / SIDE)
    for step in range(_DIRECTIONS):
        angle = math.pi * step / _DIRECTIONS
        dx, dy = round(reach / 2 * math.cos(angle)), round(reach / 2 * math.sin(angle))
        kernel = np.zeros((2 * abs(dy) + 1, 2 * abs(dx) + 1), np.uint8)
        middle = (abs(dx), abs(dy))
        cv2.line(kernel, (middle[0] - dx, middle[1] - dy), (middle[0] + dx, middle[1] + dy), 1, 1)
        found |= np.asarray(cv2.morphologyEx(plain, cv2.MORPH_OPEN, kernel), np.uint8)
    return found > 0


def _bridges(lines: Mask, walls: Mask) -> Mask:
    """Return the lines that go from one place of the walls to another one, as windows do."""
    count, pieces, stats, _ = cv2.connectedComponentsWithStats(
        lines.astype(np.uint8), connectivity=8
    )
    touching = _dilated(walls, 3)
    keep = np.zeros(count, np.bool_)
    for piece in range(1, count):
        left, top, wide, high, _ = stats[piece]
        box = np.s_[top : top + high, left : left + wide]
        touched = (pieces[box] == piece) & touching[box]
        ends, _, _, centres = cv2.connectedComponentsWithStats(
            touched.astype(np.uint8), connectivity=8
        )
        apart = [math.dist(centres[a], centres[b]) for a in range(1, ends) for b in range(1, a)]
        # A leaf of a door touches at its hinge only; a window ends at walls on both sides.
        keep[piece] = bool(apart) and max(apart) >= 0.6 * math.hypot(wide, high)
    keep[0] = False
    return np.asarray(keep[pieces])


def _filled_strips(walls: Mask) -> Mask:
    """Return walls with the closed strips between two lines filled."""
    free = (~walls).astype(np.uint8)
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(free, connectivity=4)
    depth = cv2.distanceTransform(free, cv2.DIST_L2, 3) * SIDE
    deepest = np.zeros(len(stats), np.float32)
    np.maximum.at(deepest, np.asarray(pieces, np.intp).ravel(), depth.ravel())
    strips = deepest < _WALL / 2
    strips[0] = False
    return np.asarray(walls | strips[pieces])


def _without_what_stands_alone(mask: Mask, smallest: float, whole: Mask) -> Mask:
    """Return a mask without small things: letters, symbols, furniture.

    What is thick and small counts as a column if it is about as full as a box.

    Args:
        mask: The strokes.
        smallest: Smaller things go, metres from corner to corner; 0: half of `_ALONE`.
        whole: What they belong to, by which their size is taken.
    """
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(whole.astype(np.uint8), connectivity=8)
    size = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) * SIDE
    box = stats[:, cv2.CC_STAT_WIDTH] * stats[:, cv2.CC_STAT_HEIGHT]
    full = stats[:, cv2.CC_STAT_AREA] > 0.85 * box
    column = full & (size > 0.3) & (np.minimum(*stats[:, 2:4].T) * SIDE > 0.2)
    keep = (size >= (smallest or _ALONE / 2)) | column
    keep[0] = False
    return np.asarray(mask & keep[pieces])


def _numbers(words: Sequence[str]) -> list[float]:
    numbers = [float(each) for each in words]
    if not all(map(math.isfinite, numbers)):
        raise ValueError('expected numbers')
    return numbers
