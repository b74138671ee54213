"""A place and a two-wheeled robot as a model of MuJoCo: what is solid, what the wheels are like.

Walls, closed doors and obstacles are fixed bodies; people are moved by hand. The robot is a
cylinder or the prism over its footprint, on two driven wheels and casters without friction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from floor_plans import shapes
from floor_plans.shapes import WALL_HEIGHT, WALL_THICKNESS, Pose
from lidar_navigation import Footprint
from lidar_navigation.robot_base import robot_footprint
from strict_files.settings import parameter
from surveillance_simulation.mujoco_bodies import about_z, add_thing
from surveillance_simulation.optional_mujoco import mujoco
from surveillance_simulation.world.simulated_place import LEAF_THICKNESS, SimulatedPlace

STEP = 0.002
"""Step of the physics, seconds."""
SOLID, ROBOT, FLOOR = 0, 1, 2
"""Groups of geoms: rays of a lidar meet those of the first alone."""
_ON_FLOOR, _IN_THE_WAY = 1, 2
"""What touches what: the wheels the floor; the chassis walls, things and people."""
_CLEARANCE = 0.02
"""Between chassis and floor, metres."""
CHASSIS = 'chassis'
"""Name of the first part of the body; further ones have a number behind it."""
_PERSON_HEIGHT = 1.7


def two_numbers(values: Sequence[float]) -> str | None:
    """Ask for a number for the left wheel and one for the right."""
    return None if len(values) == 2 else 'two numbers, for the left wheel and the right one'


def three_numbers(values: Sequence[float]) -> str | None:
    """Ask for x, y and yaw."""
    return None if len(values) == 3 else 'three numbers: x, y in metres, yaw in radians'


@dataclass(frozen=True)
class PhysicsModel:
    """The robot's body and wheels, and how its sensors differ from what is said of them."""

    footprint: tuple[float, ...] = robot_footprint()
    height: float = parameter(0.35, 'Height of the body, m.', 0.03, 5.0)
    mass: float = parameter(8.0, 'Mass of the robot, kg.', 0.1, 1000.0)
    wheel_separation: float = parameter(0.34, 'Distance of the driven wheels, m.', 0.02, 10.0)
    wheel_radius: float = parameter(0.05, 'Radius of a driven wheel, m.', 0.01, 2.0)
    wheel_errors: tuple[float, ...] = parameter(
        (0.0, 0.0),
        'By which part the left and the right wheel are larger than the odometry takes them for.',
        -0.5,
        0.5,
        of=float,
        check=two_numbers,
    )
    friction: float = parameter(0.8, 'Friction of the wheels on the floor (mu).', 0.02, 2.0)
    backlash: float = parameter(
        0.01, 'Play between motor and wheel, seen at the wheel, rad.', 0.0, 0.5
    )
    motor_lag: float = parameter(0.05, 'Time constant of the motors, s.', 0.0, 1.0)
    torque: float = parameter(3.0, 'Greatest torque at a wheel, N m.', 0.01, 1000.0)
    lidar_height: float = parameter(0.25, 'Height of the lidars above the floor, m.', 0.0, 5.0)
    lidar_offset: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        'How far off the lidars sit from where lidar_mounts has them: x, y in metres, yaw in rad.',
        of=float,
        check=three_numbers,
    )
    sweep: float = parameter(
        0.1, 'Time of one turn of a lidar, s; at full speed of time no more than step.', 0.0, 2.0
    )


def require_mujoco() -> None:
    """Make sure that MuJoCo is there.

    Raises:
        ImportError: It is not installed.
    """
    if mujoco is None:
        raise ImportError("'mujoco': expected the package mujoco (pip install mujoco)")


def compiled(world: SimulatedPlace, radius: float, robot: PhysicsModel, people: int) -> Any:
    """Return the model of a world as it is now, with a robot that stands at the origin.

    The robot's free joint comes first in its coordinates, then the left wheel and the right one.

    Args:
        world: The place.
        radius: Of a round robot, metres.
        robot: The robot.
        people: How many bodies there are to be that are moved by hand, `person0` and so on.
    """
    spec = mujoco.MjSpec()
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 1.0],
        group=FLOOR,
        contype=_ON_FLOOR,
        conaffinity=_ON_FLOOR,
    )
    _add_robot(spec, radius, robot)
    for line in world.plan.solid_lines():
        _add_wall(spec, line)
    for name in world.plan.doors:
        if (leaf := world.leaf(name)) is not None:
            _add_wall(spec, leaf, LEAF_THICKNESS if world.door_angle(name) else WALL_THICKNESS)
    solid = {'group': SOLID, 'contype': _IN_THE_WAY, 'conaffinity': _IN_THE_WAY}
    for thing in world.things.values():
        if thing.kind != 'person':
            add_thing(spec.worldbody, thing, lambda _: solid)
    for index in range(people):
        body = spec.worldbody.add_body(name=f'person{index}', mocap=True)
        _add_upright(body, (0.0, 0.0), 1.0, _PERSON_HEIGHT)
    return spec.compile()


def _add_robot(spec: Any, radius: float, robot: PhysicsModel) -> None:
    body = spec.worldbody.add_body(name='robot')
    body.add_freejoint()
    half = max(robot.height - _CLEARANCE, 0.02) / 2
    corners = np.array(robot.footprint).reshape(-1, 2)
    shapes: list[dict[str, Any]] = []
    # MuJoCo takes a mesh for its convex hull: each convex part is one.
    parts = Footprint(radius, robot.footprint).convex_parts if len(corners) else ()
    for part in parts:
        heights = np.repeat([_CLEARANCE, _CLEARANCE + 2 * half], len(part))
        prism = np.column_stack([np.tile(part, (2, 1)), heights])
        name = f'{CHASSIS}{len(shapes) or ""}'
        spec.add_mesh(name=name, uservert=prism.ravel())
        shapes.append({'type': mujoco.mjtGeom.mjGEOM_MESH, 'meshname': name})
    if not shapes:
        shapes.append(
            {
                'type': mujoco.mjtGeom.mjGEOM_CYLINDER,
                'size': [radius, half, 0.0],
                'pos': [0.0, 0.0, _CLEARANCE + half],
            }
        )
    for number, shape in enumerate(shapes):
        body.add_geom(
            name=f'{CHASSIS}{number or ""}',
            group=ROBOT,
            contype=_IN_THE_WAY,
            conaffinity=_IN_THE_WAY,
            friction=[0.2, 0.005, 0.0001],
            mass=0.7 * robot.mass / len(shapes),
            **shape,
        )
    # What is heavy lies low: motors and battery.
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[0.5 * _least(corners, radius), 0.02, 0.0],
        pos=[0.0, 0.0, _CLEARANCE + 0.03],
        group=ROBOT,
        contype=0,
        conaffinity=0,
        mass=0.3 * robot.mass,
    )
    front, rear = (
        (float(corners[:, 0].max()), float(corners[:, 0].min()))
        if len(corners)
        else (radius, -radius)
    )
    size = min(0.02, robot.wheel_radius)
    for x in (0.85 * front, 0.85 * rear):
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[size, 0.0, 0.0],
            # Half a millimetre off the floor: the wheels carry the robot.
            pos=[x, 0.0, size + 0.0005],
            group=ROBOT,
            contype=_ON_FLOOR,
            conaffinity=_ON_FLOOR,
            priority=1,
            condim=3,
            friction=[0.01, 0.001, 0.0001],
            mass=0.01,
        )
    for side, name, error in zip((1.0, -1.0), ('left', 'right'), robot.wheel_errors, strict=True):
        _add_wheel(body, side, name, robot, robot.wheel_radius * (1.0 + error))


def _least(corners: Any, radius: float) -> float:
    return float(np.hypot(*corners.T).min()) if len(corners) else radius


def _add_wheel(body: Any, side: float, name: str, robot: PhysicsModel, radius: float) -> None:
    wheel = body.add_body(name=name, pos=[0.0, side * robot.wheel_separation / 2, radius])
    wheel.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0], armature=0.002
    )
    # A narrow tyre: it touches the floor at one point, so that it can turn there.
    wheel.add_geom(
        type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
        size=[radius, 0.2 * radius, radius],
        group=ROBOT,
        contype=_ON_FLOOR,
        conaffinity=_ON_FLOOR,
        priority=1,
        condim=3,
        friction=[robot.friction, 0.002, 0.0001],
        mass=0.05 * robot.mass,
    )


def _add_wall(
    spec: Any,
    line: tuple[tuple[float, float], tuple[float, float]],
    thickness: float = WALL_THICKNESS,
) -> None:
    x, y, cos, sin, along, across = shapes.boxes_around([line], thickness)[0]
    yaw = math.atan2(sin, cos)
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[float(along), float(across), WALL_HEIGHT / 2],
        pos=[float(x), float(y), WALL_HEIGHT / 2],
        quat=about_z(yaw),
        group=SOLID,
        contype=_IN_THE_WAY,
        conaffinity=_IN_THE_WAY,
    )


def _add_upright(body: Any, at: tuple[float, float], radius: float, height: float) -> None:
    body.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[radius, height / 2, 0.0],
        pos=[*at, height / 2],
        group=SOLID,
        contype=_IN_THE_WAY,
        conaffinity=_IN_THE_WAY,
    )


def standing_at(pose: Pose) -> tuple[list[float], list[float]]:
    """Return position and quaternion of a robot that stands at a pose in the plane."""
    x, y, yaw = pose
    return [x, y, 0.0], [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]
