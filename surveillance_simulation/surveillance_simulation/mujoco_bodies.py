"""Things of the world as bodies of a MuJoCo model, for its pictures and for its physics."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from surveillance_simulation.optional_mujoco import mujoco
from surveillance_simulation.world.things import Part, Shape, Thing


def about_z(yaw: float) -> list[float]:
    """Return the quaternion (w, x, y, z) of a turn in the plane."""
    return [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]


def add_thing(body: Any, thing: Thing, kind: Callable[[Part], Mapping[str, Any]]) -> None:
    """Add the parts of a thing to a body, in whose frame the thing is given.

    Args:
        body: Of an `MjSpec`.
        thing: What is added.
        kind: Further attributes of a part's geom: its colour, or what it collides with.
    """
    for part in thing.parts:
        x, y = thing.at(part)
        half = (part.top - part.bottom) / 2
        length, width = part.length / 2, part.width / 2
        shape, size = {
            Shape.BOX: (mujoco.mjtGeom.mjGEOM_BOX, [length, width, half]),
            Shape.CYLINDER: (mujoco.mjtGeom.mjGEOM_CYLINDER, [length, half, 0.0]),
            # Thicker than the slice, so that slices run into each other: 6 % of ripple.
            Shape.ELLIPSE: (mujoco.mjtGeom.mjGEOM_ELLIPSOID, [length, width, 3 * half]),
        }[part.shape]
        body.add_geom(
            type=shape,
            size=size,
            pos=[x, y, part.bottom + half],
            quat=about_z(thing.yaw),
            **kind(part),
        )
