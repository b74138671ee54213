"""Drawing in metres: a picture with smooth edges, text and a plane with y upwards.

Everything is drawn at a multiple of the picture's size and averaged down at the end. Lengths named
`points` are pixels of the finished picture.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, ImageColor, ImageDraw, ImageFont

Point = tuple[float, float]
_FINE = 3


class Canvas:
    """A picture of a piece of the plane.

    Attributes:
        scale: Points per metre.
        size: Width and height of the finished picture, points.
    """

    def __init__(
        self,
        bounds: tuple[float, float, float, float],
        scale: float,
        margins: tuple[int, int, int, int],
        background: str,
    ) -> None:
        """Begin an empty picture.

        Args:
            bounds: West, south, east and north edge of what is to be seen, metres.
            scale: Points per metre.
            margins: Left, top, right and bottom margin around that, points.
            background: Colour of the paper.
        """
        west, south, east, north = bounds
        left, top, right, bottom = margins
        self.scale = scale
        self.size = (
            math.ceil((east - west) * scale) + left + right,
            math.ceil((north - south) * scale) + top + bottom,
        )
        self._origin = (left - west * scale, top + north * scale)
        self._image = Image.new('RGB', (self.size[0] * _FINE, self.size[1] * _FINE), background)
        self._draw = ImageDraw.Draw(self._image)

    def at(self, point: Sequence[float]) -> Point:
        """Return where a point of the plane (metres) lies in the finished picture."""
        return (self._origin[0] + point[0] * self.scale, self._origin[1] - point[1] * self.scale)

    def polygon(self, outline: Iterable[Sequence[float]], colour: str) -> None:
        """Fill a polygon given in metres."""
        self._draw.polygon([self._fine(self.at(point)) for point in outline], fill=colour)

    def box(self, left: float, top: float, right: float, bottom: float, colour: str) -> None:
        """Fill a rectangle given in points."""
        corners = (*self._fine((left, top)), *self._fine((right, bottom)))
        self._draw.rectangle(corners, fill=colour)

    def line(
        self,
        points: Sequence[Sequence[float]],
        colour: str,
        width: float,
        dash: tuple[float, float] | None = None,
    ) -> None:
        """Draw a line through points in metres; its width and dashes (on, off) are in points."""
        ends = [self.at(point) for point in points]
        pieces = [ends] if dash is None else _dashes(ends, *dash)
        for piece in pieces:
            self._draw.line(
                [self._fine(end) for end in piece],
                fill=colour,
                width=max(1, round(width * _FINE)),
                joint='curve',
            )

    def arc(
        self,
        centre: Sequence[float],
        radius: float,
        start: float,
        end: float,
        colour: str,
        width: float,
    ) -> None:
        """Draw an arc in metres, anticlockwise between two angles in rad."""
        steps = np.linspace(start, end, 24)
        points = [
            (centre[0] + radius * math.cos(a), centre[1] + radius * math.sin(a)) for a in steps
        ]
        self.line(points, colour, width)

    def disc(self, centre: Sequence[float], radius: float, colour: str) -> None:
        """Fill a circle around a point in metres; its radius is in points."""
        x, y = self.at(centre)
        corners = (*self._fine((x - radius, y - radius)), *self._fine((x + radius, y + radius)))
        self._draw.ellipse(corners, fill=colour)

    def pill(self, centre: Point, text: str, size: float, colour: str) -> None:
        """Write text on a rounded sign; its centre and size are in points."""
        width = self.text_width(text, size) + size * 1.1
        high = size * 1.75
        x, y = centre
        self._draw.rounded_rectangle(
            (
                *self._fine((x - max(width, high) / 2, y - high / 2)),
                *self._fine((x + max(width, high) / 2, y + high / 2)),
            ),
            radius=high / 2 * _FINE,
            fill=colour,
        )
        self.text(centre, text, size, 'white', anchor='mm')

    def text(self, at: Point, text: str, size: float, colour: str, anchor: str = 'la') -> None:
        """Write text at a point in points; `anchor` as Pillow has it."""
        self._draw.text(self._fine(at), text, fill=colour, font=_font(size), anchor=anchor)

    def text_width(self, text: str, size: float) -> float:
        """Return how wide a text is, points."""
        return float(self._draw.textlength(text, font=_font(size))) / _FINE

    def traces(
        self, lines: Iterable[Sequence[Sequence[float]]], colour: str, width: float, opacity: float
    ) -> None:
        """Draw lines in metres that show through: where many lie, the colour is stronger."""
        columns, rows = self.size
        count = np.zeros((rows, columns), np.float32)
        for points in lines:
            once = np.zeros((rows, columns), np.uint8)
            fixed = np.rint(np.array([self.at(point) for point in points]) * 16).astype(np.int32)
            thick = max(1, round(width))
            cv2.polylines(once, [fixed], False, 255, thick, cv2.LINE_AA, shift=4)
            count += once.astype(np.float32) / 255
        share = 1.0 - (1.0 - opacity) ** count
        mask = Image.fromarray((share * 255).astype(np.uint8)).resize(self._image.size)
        paint = Image.new('RGB', self._image.size, ImageColor.getrgb(colour))
        self._image.paste(paint, mask=mask)

    def finished(self) -> Image.Image:
        """Return the picture."""
        return self._image.resize(self.size, Image.Resampling.LANCZOS)

    @staticmethod
    def _fine(point: Point) -> Point:
        return point[0] * _FINE, point[1] * _FINE


def blend(first: str, second: str, share: float) -> str:
    """Return the colour that lies between two, `share` of the way from the first to the second."""
    start: npt.NDArray[np.float64] = np.array(ImageColor.getrgb(first)[:3], dtype=float)
    end: npt.NDArray[np.float64] = np.array(ImageColor.getrgb(second)[:3], dtype=float)
    red, green, blue = np.rint(start + (end - start) * min(max(share, 0.0), 1.0)).astype(int)
    return f'#{red:02x}{green:02x}{blue:02x}'


def _font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size * _FINE)


def _dashes(ends: Sequence[Point], on: float, off: float) -> list[list[Point]]:
    pieces = []
    for first, last in pairwise(ends):
        length = math.dist(first, last)
        position = 0.0
        while position < length:
            until = min(position + on, length)
            pieces.append([_between(first, last, s / length) for s in (position, until)])
            position = until + off
    return pieces


def _between(first: Point, last: Point, share: float) -> Point:
    return first[0] + share * (last[0] - first[0]), first[1] + share * (last[1] - first[1])
