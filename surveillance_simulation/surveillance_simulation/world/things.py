"""What stands or goes about in a place, made of boxes and cylinders: barrels, boxes, chairs,
people, and robots as others see them.

A thing is the same to all sensors: the lidar meets the parts that its plane cuts, the camera sees
all of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from floor_plans import PlaceError, shapes

LIDAR_HEIGHT = 0.18
"""Height of the lidar's plane, metres."""
Colour = tuple[int, int, int]


class Shape(StrEnum):
    """What a part looks like from above."""

    BOX = 'box'
    CYLINDER = 'cylinder'
    ELLIPSE = 'ellipse'


@dataclass(frozen=True)
class Part:
    """One upright body of a thing, in the thing's frame: x ahead, y to the left.

    Attributes:
        shape: Box, cylinder, or a slice of something round: an upright elliptic cylinder.
        x, y: Its middle, metres.
        length, width: Its sides along x and y, metres; of a cylinder both are its diameter.
        bottom, top: Its heights, metres.
        colour: RGB.
    """

    shape: Shape
    x: float
    y: float
    length: float
    width: float
    bottom: float
    top: float
    colour: Colour

    @property
    def is_cut(self) -> bool:
        """Whether the lidar's plane cuts it."""
        return self.bottom <= LIDAR_HEIGHT < self.top


@dataclass(frozen=True)
class Thing:
    """What stands or walks in a place.

    Attributes:
        name: Its own name.
        kind: barrel, box, chair, person or robot.
        x, y, yaw: Where it is, metres and rad.
        parts: What it is made of.
    """

    name: str
    kind: str
    x: float
    y: float
    yaw: float
    parts: tuple[Part, ...]

    def at(self, part: Part) -> tuple[float, float]:
        """Return where the middle of a part is, world frame, metres."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return (
            self.x + cosine * part.x - sine * part.y,
            self.y + sine * part.x + cosine * part.y,
        )

    def moved(self, x: float, y: float, yaw: float) -> Thing:
        """Return it elsewhere."""
        return replace(self, x=x, y=y, yaw=yaw)


BARREL_HEIGHT = 0.8
_ORANGE, _BROWN, _WOOD = (224, 104, 28), (150, 108, 62), (96, 62, 36)
_CASE, _ARM = (62, 66, 72), (148, 152, 158)


def barrel(name: str, x: float, y: float, radius: float) -> Thing:
    """Return an orange barrel.

    Raises:
        PlaceError: A number is not finite, or the radius is not between 1 cm and 5 m.
    """
    if not 0.01 <= radius <= 5.0:
        raise PlaceError((), f"obstacle '{name}': radius {radius:g} m: expected 0.01 to 5 m")
    side = 2.0 * radius
    part = Part(Shape.CYLINDER, 0.0, 0.0, side, side, 0.0, BARREL_HEIGHT, _ORANGE)
    return checked(Thing(name, 'barrel', x, y, 0.0, (part,)))


def box(
    name: str, x: float, y: float, yaw: float, length: float, width: float, height: float
) -> Thing:
    """Return a cardboard box.

    Raises:
        PlaceError: A number is not finite, or a side is not between 2 cm and 5 m.
    """
    for word, side in (('length', length), ('width', width), ('height', height)):
        if not 0.02 <= side <= 5.0:
            raise PlaceError((), f"box '{name}': {word} {side:g} m: expected 0.02 to 5 m")
    part = Part(Shape.BOX, 0.0, 0.0, length, width, 0.0, height, _BROWN)
    return checked(Thing(name, 'box', x, y, yaw, (part,)))


def chair(name: str, x: float, y: float, yaw: float) -> Thing:
    """Return a chair of usual size: four legs, a seat, a back that it has behind it."""
    legs = tuple(
        Part(Shape.CYLINDER, dx, dy, 0.05, 0.05, 0.0, 0.45, _WOOD)
        for dx in (-0.19, 0.19)
        for dy in (-0.19, 0.19)
    )
    seat = Part(Shape.BOX, 0.0, 0.0, 0.44, 0.44, 0.45, 0.5, _WOOD)
    back = Part(Shape.BOX, -0.2, 0.0, 0.04, 0.44, 0.5, 0.95, _WOOD)
    return checked(Thing(name, 'chair', x, y, yaw, (*legs, seat, back)))


def robot(name: str, x: float, y: float, radius: float) -> Thing:
    """Return a robot as others see it: a round base of a radius, metres, with its arm upright."""
    parts = (
        Part(Shape.CYLINDER, 0.0, 0.0, 2.0 * radius, 2.0 * radius, 0.02, 0.32, _CASE),
        Part(Shape.CYLINDER, 0.0, 0.0, 0.1, 0.1, 0.32, 0.75, _ARM),
    )
    return checked(Thing(name, 'robot', x, y, 0.0, parts))


def discs_of(things: Iterable[Thing]) -> shapes.Array:
    """Return what is round in the lidar's plane, (n, 3): centre x, y and (mean) radius, metres."""
    rows = [
        (*thing.at(part), (part.length + part.width) / 4)
        for thing in things
        for part in thing.parts
        if part.is_cut and part.shape != Shape.BOX
    ]
    return np.array(rows, dtype=float).reshape(-1, 3)


def boxes_of(things: Iterable[Thing]) -> shapes.Array:
    """Return the boxes that the lidar's plane cuts, (n, 6), see `boxes`."""
    rows = [
        (
            *thing.at(part),
            math.cos(thing.yaw),
            math.sin(thing.yaw),
            part.length / 2,
            part.width / 2,
        )
        for thing in things
        for part in thing.parts
        if part.is_cut and part.shape == Shape.BOX
    ]
    return np.array(rows, dtype=float).reshape(-1, 6)


def checked(thing: Thing) -> Thing:
    """Return a thing that has a name and a place.

    Raises:
        PlaceError: It has none.
    """
    word = 'obstacle' if thing.kind == 'barrel' else thing.kind
    if not thing.name:
        raise PlaceError((), f"{word} '': expected a name")
    if not all(map(math.isfinite, (thing.x, thing.y, thing.yaw))):
        raise PlaceError(
            (),
            f"{word} '{thing.name}' at ({thing.x:g}, {thing.y:g}): expected two numbers in metres",
        )
    return thing
