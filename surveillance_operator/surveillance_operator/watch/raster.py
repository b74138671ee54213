"""An occupancy grid as a picture of terminal cells, each two square pixels one above the other."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.segment import Segment
from rich.style import Style

from floor_plans import Grid
from floor_plans.occupancy_grid import Box
from surveillance_operator.mission_state import Pose

UNKNOWN, FREE, WALL, LINK, OLD_TRAIL, TRAIL, OPEN_DOOR, CLOSED_DOOR, OBSTACLE = range(9)
"""What a pixel shows; those above `FREE` are drawn on the ground that the first two are."""

COLOURS = (
    'default',
    'grey19',
    'grey85',
    'grey50',
    'dodger_blue3',
    'deep_sky_blue1',
    'green3',
    'red1',
    'orange1',
)
WITHOUT_COLOURS = '  #.··=X*'
"""Characters for a terminal without colours; walls are drawn as blocks there, too."""

ARROWS = '→↗↑↖←↙↓↘'


@dataclass(frozen=True)
class Viewport:
    """Which part of the world a picture shows.

    Attributes:
        left, top: Its upper left corner, metres, map viewport.
        scale: Side of a pixel, metres.
        columns, rows: Its size in terminal cells.
    """

    left: float
    top: float
    scale: float
    columns: int
    rows: int

    @classmethod
    def around(cls, box: Box, columns: int, rows: int) -> Viewport:
        """Return the largest picture of a box that fits into so many cells, its aspect kept."""
        left, bottom, right, top = box
        scale = max((right - left) / columns, (top - bottom) / (2 * rows), 1e-6)
        width, height = (math.ceil(side / scale - 1e-6) for side in (right - left, top - bottom))
        return cls(left, top, scale, max(1, width), max(1, (height + 1) // 2))

    def pixels(self, points: ArrayLike) -> NDArray[np.intp]:
        """Return the row and column of each point's pixel, which may lie outside the picture.

        Args:
            points: Shape (n, 2), metres, map viewport.
        """
        x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
        offsets = np.stack([self.top - y, x - self.left], axis=1)
        return np.floor(offsets / self.scale).astype(np.intp)


@lru_cache(maxsize=4)
def rasterise(grid: Grid, viewport: Viewport) -> NDArray[np.uint8]:
    """Return what each pixel of a picture shows of a grid: a wall, however thin, before all else.

    Returns:
        Shape (2 * viewport.rows, viewport.columns), north first; not to be written to.
    """
    kinds = np.where(grid.occupied, WALL, np.where(grid.free, FREE, UNKNOWN))
    kinds = kinds.astype(np.uint8)[::-1]
    west, north = grid.origin[0], grid.origin[1] + len(kinds) * grid.resolution
    for axis, offset, count in (
        (0, north - viewport.top, 2 * viewport.rows),
        (1, viewport.left - west, viewport.columns),
    ):
        edges = (offset + np.arange(count + 1) * viewport.scale) / grid.resolution
        starts = np.floor(edges + 1e-6).astype(np.intp)
        size = min(kinds.shape[axis], max(1, int(starts[-1])))
        starts = starts[:-1][starts[:-1] < size].clip(0)
        # Where a pixel is smaller than a cell, reduceat takes the cell that it begins in.
        kinds = np.maximum.reduceat(kinds.take(range(size), axis=axis), starts, axis=axis)
        padding = [(0, 0), (0, 0)]
        padding[axis] = (0, count - len(starts))
        kinds = np.pad(kinds, padding, constant_values=UNKNOWN)
    kinds.flags.writeable = False
    return kinds


class CharacterCanvas:
    """A picture on which more is drawn.

    Args:
        viewport: What it shows.
        ground: Its pixels, see `rasterise`; all free unless given.
    """

    def __init__(self, viewport: Viewport, ground: NDArray[np.uint8] | None = None) -> None:
        self.viewport = viewport
        shape = (2 * viewport.rows, viewport.columns)
        self.pixels = np.full(shape, FREE, np.uint8) if ground is None else ground.copy()
        self._ground = np.minimum(self.pixels, FREE)
        self._characters: dict[tuple[int, int], tuple[str, Style]] = {}

    def dots(self, points: ArrayLike, kind: int) -> None:
        """Draw points, shape (n, 2), metres."""
        at = self.viewport.pixels(points)
        at = at[((at >= 0) & (at < self.pixels.shape)).all(axis=1)]
        self.pixels[at[:, 0], at[:, 1]] = kind

    def line(self, start: ArrayLike, end: ArrayLike, kind: int) -> None:
        """Draw a straight line from one point to another."""
        ends = np.array([start, end], dtype=float)
        steps = 2 + int(2 * np.abs(ends[1] - ends[0]).max() / self.viewport.scale)
        self.dots(ends[0] + np.linspace(0.0, 1.0, steps)[:, None] * (ends[1] - ends[0]), kind)

    def mark(self, x: float, y: float, character: str, style: Style) -> None:
        """Put one character where a point is, over whatever is there."""
        row, column = self.viewport.pixels([(x, y)])[0]
        self._characters[row // 2, column] = character, style

    def label(self, x: float, y: float, text: str, style: Style) -> None:
        """Write beside a point, in the nearest row where it covers nothing, or walls at most.

        Where that would be over another label, or the picture is too narrow, it is left out.
        """
        row, column = self.viewport.pixels([(x, y)])[0]
        first = min(max(0, column - (len(text) - 1) // 2), self.viewport.columns - len(text))
        columns = range(first, first + len(text))
        near = [row // 2 + offset for offset in (-1, 1, 0, -2, 2)]
        unwritten = [r for r in near if first >= 0 and self._is_unwritten(r, columns)]
        best = [r for r in unwritten if not self._is_drawn(r, columns)] + unwritten
        for column, character in zip(columns, text if best else '', strict=False):
            self._characters[best[0], column] = character, style

    def arrow(self, pose: Pose, style: Style) -> None:
        """Draw the robot, as an arrow in one of eight directions."""
        x, y, yaw = pose
        self.mark(x, y, ARROWS[round(yaw / (math.pi / 4)) % 8], style)

    def lines(self, *, colours: bool = True) -> Iterator[list[Segment]]:
        """Yield the picture, row by row, each as wide as the viewport."""
        for row in range(self.viewport.rows):
            upper, lower, ground = (
                line.tolist()
                for line in (*self.pixels[2 * row : 2 * row + 2], self._ground[2 * row])
            )
            cells = []
            for column, (top, bottom) in enumerate(zip(upper, lower, strict=True)):
                written = self._characters.get((row, column))
                if written is not None:
                    text, style = written
                    cells.append((text, _on(ground[column]) + style if colours else None))
                else:
                    cells.append(_cell(top, bottom) if colours else (_plain(top, bottom), None))
            runs = groupby(cells, key=lambda cell: cell[1])
            yield [Segment(''.join(text for text, _ in run), style) for style, run in runs]

    def _is_unwritten(self, row: int, columns: range) -> bool:
        taken = any((row, column) in self._characters for column in columns)
        return 0 <= row < self.viewport.rows and not taken

    def _is_drawn(self, row: int, columns: range) -> bool:
        pixels = self.pixels[2 * row : 2 * row + 2, columns.start : columns.stop]
        return bool(np.isin(pixels, (UNKNOWN, FREE, OLD_TRAIL, TRAIL), invert=True).any())


@lru_cache(maxsize=256)
def _cell(top: int, bottom: int) -> tuple[str, Style]:
    """Return one cell's character and colours."""
    if top == bottom and top <= FREE:
        return ' ', _on(top)
    if top == bottom:
        return '█', Style(color=COLOURS[top])
    if top <= FREE:
        return '▄', Style(color=COLOURS[bottom], bgcolor=COLOURS[top])
    return '▀', Style(color=COLOURS[top], bgcolor=COLOURS[bottom])


@lru_cache(maxsize=16)
def _on(ground: int) -> Style:
    return Style(bgcolor=COLOURS[ground])


def _plain(top: int, bottom: int) -> str:
    if max(top, bottom) <= WALL:
        return ' ▀▄█'[(top == WALL) + 2 * (bottom == WALL)]
    return WITHOUT_COLOURS[max(top, bottom)]
