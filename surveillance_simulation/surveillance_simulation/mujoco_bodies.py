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
        is_box = part.shape == Shape.BOX
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX if is_box else mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[part.length / 2, part.width / 2, half] if is_box else [part.length / 2, half, 0],
            pos=[x, y, part.bottom + half],
            quat=about_z(thing.yaw),
            **kind(part),
        )
