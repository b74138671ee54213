"""A planar lidar: how far each ray of a full turn goes before it meets something.

Every ray is cut with every box at once (slab method: the ray enters a box where it has passed the
nearer face of both pairs of faces) and with every disc (quadratic equation). Only what is within
range is looked at. What a map shows is met on the way along the rays.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from floor_plans import shapes
from floor_plans.shapes import Pose
from strict_files.settings import parameter
from surveillance_simulation.world.simulated_place import SimulatedPlace

_PARALLEL = 1e-12


@dataclass(frozen=True)
class LidarModel:
    """What the lidar can do.

    Attributes:
        rays: Rays of a full turn; the first looks backwards (-pi), the others follow anticlockwise.
        range_min: Least distance reported, metres.
        range_max: Greatest distance reported, metres; beyond it a ray returns infinity.
    """

    rays: int = parameter(360, 'Rays of a full turn.', 4, 7200)
    range_min: float = 0.1
    range_max: float = parameter(8.0, 'Greatest distance measured, metres.', 0.5, 200.0)
    noise: float = parameter(0.01, 'Standard deviation of a distance, metres.', 0.0, 1.0)

    @cached_property
    def angles(self) -> shapes.Array:
        """Direction of each ray in the robot's frame (rays,), rad."""
        steps: shapes.Array = np.arange(self.rays, dtype=np.float64) * (2.0 * math.pi / self.rays)
        return steps - math.pi


@dataclass(frozen=True, eq=False)
class Sweep:
    """One turn of a lidar as it is told.

    Attributes:
        ranges: How far each ray went, shape (rays,), metres.
        age: The first ray was measured so long ago, seconds.
        duration: From the first ray to the first of the next turn, seconds; 0: all at once.
    """

    ranges: npt.NDArray[np.floating]
    age: float
    duration: float


def scan(
    world: SimulatedPlace,
    pose: Pose,
    model: LidarModel,
    rng: np.random.Generator | None = None,
    robot: str = '',
) -> npt.NDArray[np.float32]:
    """Return the distance (rays,) along each ray in metres, infinity where nothing is in range.

    Args:
        world: The place.
        pose: Where the lidar is, metres and rad.
        model: The lidar.
        rng: Source of the noise; None measures exactly.
        robot: Whose lidar it is: it does not see its own body.
    """
    x, y, yaw = pose
    angles = model.angles + yaw
    direction = np.stack([np.cos(angles), np.sin(angles)])
    near = shapes.distances(world.solid, x, y) <= model.range_max
    distance = _to_boxes(world.solid[near], x, y, direction)
    if world.surface is not None:
        distance = np.minimum(distance, world.surface.ranges(x, y, direction, model.range_max))
    discs = world.discs_around(robot)
    if len(discs):
        distance = np.minimum(distance, _to_discs(discs, x, y, direction))
    if rng is not None and model.noise > 0:
        distance = distance + rng.normal(0.0, model.noise, model.rays)
    distance[distance > model.range_max] = np.inf
    return np.maximum(distance, model.range_min).astype(np.float32)


def _to_boxes(solid: shapes.Array, x: float, y: float, direction: shapes.Array) -> shapes.Array:
    # Seen in the frame of each box: where the rays begin (n, 2), and where they go (n, 2, rays).
    cos, sin = solid[:, 2], solid[:, 3]
    axes = np.array([[cos, sin], [-sin, cos]]).transpose(2, 0, 1)
    begin = np.einsum('nij,nj->ni', axes, (x, y) - solid[:, :2])[..., None]
    slope = axes @ direction
    slope[np.abs(slope) < _PARALLEL] = _PARALLEL
    # In place: with many boxes, new memory costs more than the arithmetic.
    inverse = np.divide(1.0, slope, out=slope)
    middle = -begin * inverse
    reach = np.abs(inverse, out=inverse)
    reach *= solid[:, 4:6, None]
    enter = (middle - reach).max(axis=1)
    leave = np.add(middle, reach, out=middle).min(axis=1)
    hit = (leave >= enter) & (leave >= 0.0)
    distance = np.where(hit, np.maximum(enter, 0.0), np.inf)
    return np.asarray(distance.min(axis=0, initial=np.inf))


def _to_discs(discs: shapes.Array, x: float, y: float, direction: shapes.Array) -> shapes.Array:
    dx, dy = discs[:, 0, None] - x, discs[:, 1, None] - y
    along = dx * direction[0] + dy * direction[1]
    inside = discs[:, 2, None] ** 2 - (dx**2 + dy**2 - along**2)
    half = np.sqrt(np.maximum(inside, 0.0))
    hit = (inside >= 0.0) & (along + half >= 0.0)
    return np.asarray(np.where(hit, np.maximum(along - half, 0.0), np.inf).min(axis=0))
