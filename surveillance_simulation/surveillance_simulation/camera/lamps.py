"""Places whose lamp is not as bright as by day: how much darker each pixel of a picture becomes.

What a pixel shows lies in a place, whose lamp lights it. A wall belongs to the place on the side it
is seen from.
"""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from floor_plans.shapes import WALL_HEIGHT
from surveillance_simulation.camera.model import Array, Camera, Scene
from surveillance_simulation.world.simulated_place import SimulatedPlace

BESIDE_WALL = 0.15
"""What lights a surface is looked up so far before it, metres: half a wall and a cell."""
STRAY = 0.02
"""Brightness without any lamp."""
_REACH = 1.0
"""Light comes so far through an open door or past an edge, metres."""


class LampLight:
    """The light of a world whose lamps are not all as by day."""

    def __init__(self, world: SimulatedPlace) -> None:
        self.lamps = dict(world.lamps)
        self.doors = world.closed_doors
        self._grid = world.regions.grid
        masks = world.regions.masks()
        light = np.ones(self._grid.cells.shape, np.float32)
        for place, brightness in self.lamps.items():
            light[masks[place]] = brightness
        self._light = _spread(world, light)

    @classmethod
    def of(cls, world: SimulatedPlace, before: LampLight | None) -> LampLight | None:
        """Return the light of a world, the one from before where it still holds; None: all by day.

        Args:
            world: The world.
            before: What this returned for it the last time.
        """
        if not world.lamps:
            return None
        if (
            before is not None
            and before.lamps == world.lamps
            and before.doors == world.closed_doors
        ):
            return before
        return cls(world)

    def shine(
        self,
        picture: Scene,
        nearness: npt.NDArray[np.float32],
        camera: Camera,
        camera_pose: Array,
    ) -> Scene:
        """Return a picture (rows, columns, 3) in this light.

        Args:
            picture: As it is by day.
            nearness: One over the depth of each pixel (rows, columns), 1/m; 0: the ceiling.
            camera: Its lens.
            camera_pose: Transform (4, 4) from the optical frame to the world, metres.
        """
        rows, columns = picture.shape[:2]
        inverse = np.linalg.inv(camera.matrix)
        u, v = np.meshgrid(np.arange(columns), np.arange(rows))
        rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ (camera_pose[:3, :3] @ inverse).T
        eye = camera_pose[:3, 3]
        with np.errstate(divide='ignore'):
            depth = 1.0 / nearness
            ceiling = np.where(rays[..., 2] > 1e-6, (WALL_HEIGHT - eye[2]) / rays[..., 2], 100.0)
        depth = np.where(nearness > 0.0, depth, np.minimum(ceiling, 100.0))
        length = np.linalg.norm(rays, axis=-1)
        depth = np.maximum(depth - BESIDE_WALL / length, 0.0)
        points = eye[:2] + rays[..., :2] * depth[..., None]
        origin, side = self._grid.origin, self._grid.resolution
        where = ((points - origin) / side - 0.5).astype(np.float32)
        light = cv2.remap(
            self._light,
            where[..., 0],
            where[..., 1],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=1.0,
        )
        return np.asarray(picture * np.maximum(light, STRAY)[..., None], np.float32)


def _spread(world: SimulatedPlace, light: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Return the light of each cell, with what comes in from where it is brighter."""
    grid = world.regions.grid
    free = grid.free.copy()
    # `regions` has every door closed: what is open lets light through.
    for door in world.plan.doors.values():
        if door.name in world.closed_doors:
            continue
        (x1, y1), (x2, y2) = door.ends
        for part in np.linspace(0.0, 1.0, 2 + int(door.width / grid.resolution * 2)):
            row, column = grid.cell_of(x1 + part * (x2 - x1), y1 + part * (y2 - y1))
            free[max(0, row - 2) : row + 3, max(0, column - 2) : column + 3] = True
    weight = free.astype(np.float32)
    steps = max(1, round(_REACH / grid.resolution / 2))
    shone = light * weight
    for _ in range(steps):
        around = cv2.blur(shone, (3, 3))
        count = np.maximum(cv2.blur(weight, (3, 3)), 1e-6)
        shone = np.where(free, around / count, 0.0).astype(np.float32)
    # A wall's cells take the light beside them, so that no dark line is drawn along it.
    filled = cv2.blur(shone, (3, 3)) / np.maximum(cv2.blur(weight, (3, 3)), 1e-6)
    return np.where(free, shone, np.where(cv2.blur(weight, (3, 3)) > 0, filled, light)).astype(
        np.float32
    )
