"""Turning the arm so that its camera looks at a point.

Two directions of the line of sight and an upright image are asked of five joints; what freedom is
left keeps the arm near a posture. Damped least squares (Wampler, "Manipulator inverse kinematic
solutions based on vector formulations and damped least-squares methods", IEEE Trans. SMC 16(1),
1986), with joints that would leave their range held at its end for that step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from surveillance_runtime.robot_arm import Arm, Array

AIM_TOLERANCE = math.radians(0.5)
"""Largest angle between line of sight and target that counts as looking at it, rad."""

NEAREST = 0.15
"""Closest target the camera can look at, metres from the lens."""

_ITERATIONS = 60
_DAMPING = 0.3
_LEAST_DAMPING = 1e-3
_LARGEST_STEP = 0.35
_POSTURE_GAIN = 0.3
_POSTURE_DECAY = 0.9
_SETTLED = 1e-4
_FEWEST = 12


class ArmMotionError(Exception):
    """A motion cannot reach its goal, or did not; the message is one line."""


@dataclass(frozen=True, eq=False)
class Aim:
    """Joint positions that point the camera.

    Attributes:
        positions: (n,) rad, within the limits.
        error: Angle left between the line of sight and the target, rad.
        roll: Angle by which the image's rows are off the horizon, rad.
    """

    positions: Array
    error: float
    roll: float


def look_at(arm: Arm, target: Array, start: Array) -> Aim:
    """Joint positions that make the camera look at a point, the image upright.

    Args:
        arm: The arm.
        target: (3,) metres, base_link.
        start: (n,) joint positions from which the way should be short, rad.

    Raises:
        ArmMotionError: The point cannot be looked at within the joints' limits.
    """
    target = np.asarray(target, dtype=float)
    if target.shape != (3,) or not np.isfinite(target).all():
        raise ArmMotionError('the point to look at must be three finite numbers')
    home = np.array(arm.home)
    azimuth = math.atan2(target[1], target[0])
    turned = home.copy()
    turned[0] = np.clip(azimuth, arm.lower[0], arm.upper[0])
    best: Aim | None = None
    for attempt in (turned, np.asarray(start, dtype=float), home, (arm.lower + arm.upper) / 2.0):
        aim = _descend(arm, target, np.clip(attempt, arm.lower, arm.upper), home)
        if best is None or aim.error + aim.roll < best.error + best.roll:
            best = aim
        if best.error < AIM_TOLERANCE and best.roll < AIM_TOLERANCE:
            break
    assert best is not None
    distance = float(np.linalg.norm(target - arm.camera_frame(best.positions)[:3, 3]))
    if best.error > AIM_TOLERANCE or distance < NEAREST:
        x, y, z = target.tolist()
        why = (
            f'it is only {distance:.2f} m from the lens'
            if distance < NEAREST
            else f'{math.degrees(best.error):.1f} degrees are left at the limits of the joints'
        )
        raise ArmMotionError(f'cannot look at ({x:.2f}, {y:.2f}, {z:.2f}): {why}')
    return best


def direction_of(azimuth: float, elevation: float) -> Array:
    """Return the unit vector (3,) of a direction in base_link: azimuth from x towards y, elevation
    up, rad.
    """
    flat = math.cos(elevation)
    return np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])


def in_base(
    point: Array,
    frame: str,
    base: tuple[str, Array] | None,
    odom_in_map: Array | None = None,
) -> Array:
    """Return a point (3,) of some frame in base_link, metres.

    Args:
        point: (3,) metres.
        frame: `base_link` (also when empty), `map`, or the frame of the odometry.
        base: Frame of the odometry and the transform (4, 4) from base_link to it; None when there
            is no odometry.
        odom_in_map: Transform (4, 4) from the odometry's frame to the map's; None: nobody has told
            where the robot is, and the one is taken for the other.

    Raises:
        ValueError: The frame is not known.
    """
    if frame in ('', 'base_link'):
        return point
    if base is None or frame not in (base[0], 'map'):
        known = "'base_link'" if base is None else f"'base_link', 'map' or '{base[0]}'"
        raise ValueError(f"frame '{frame}' is not known, expected {known}")
    to_frame = base[1]
    if frame == 'map' and odom_in_map is not None:
        to_frame = odom_in_map @ to_frame
    return np.asarray((np.linalg.inv(to_frame) @ np.array([*point, 1.0]))[:3])


def _descend(arm: Arm, target: Array, start: Array, posture: Array) -> Aim:
    positions = start.copy()
    for iteration in range(_ITERATIONS):
        residual, jacobian = _task(arm, positions, target)
        gain = _POSTURE_GAIN * _POSTURE_DECAY**iteration
        free = np.ones(len(positions), bool)
        step = np.zeros_like(positions)
        for _ in range(len(positions)):
            step[:] = 0.0
            step[free] = _damped_step(
                residual, jacobian[:, free], gain * (posture - positions)[free]
            )
            beyond = (positions + step > arm.upper) | (positions + step < arm.lower)
            held = beyond & free & (np.abs(step) > 1e-12)
            at_end = held & ((positions >= arm.upper - 1e-9) | (positions <= arm.lower + 1e-9))
            if not at_end.any():
                break
            free &= ~at_end
        largest = float(np.abs(step).max())
        if largest > _LARGEST_STEP:
            step *= _LARGEST_STEP / largest
        moved = np.clip(positions + step, arm.lower, arm.upper) - positions
        positions = positions + moved
        if float(np.abs(moved).max()) < _SETTLED or (
            iteration > _FEWEST and float(np.linalg.norm(residual)) < _SETTLED
        ):
            break
    frame = arm.camera_frame(positions)
    sight = target - frame[:3, 3]
    norm = max(float(np.linalg.norm(sight)), 1e-9)
    cosine = float(np.clip(frame[:3, 2] @ sight / norm, -1.0, 1.0))
    return Aim(positions, math.acos(cosine), abs(math.asin(float(np.clip(frame[2, 0], -1.0, 1.0)))))


def _damped_step(residual: Array, jacobian: Array, towards_posture: Array) -> Array:
    # far from the goal short careful steps, near it exact ones
    damping = _DAMPING * float(np.linalg.norm(residual)) + _LEAST_DAMPING
    square = jacobian @ jacobian.T + damping**2 * np.eye(len(residual))
    inverse = np.linalg.solve(square, jacobian).T
    task = -inverse @ residual
    return np.asarray(task + towards_posture - inverse @ (jacobian @ towards_posture))


def _task(arm: Arm, positions: Array, target: Array) -> tuple[Array, Array]:
    """Return what is wrong (4,): line of sight less direction of the target, tilt of the image's
    rows.

    Also its change (4, n) with each joint.
    """
    frames = arm.frames(positions)
    camera = arm.camera_frame(positions)
    lens, right, forward = camera[:3, 3], camera[:3, 0], camera[:3, 2]
    away = target - lens
    distance = max(float(np.linalg.norm(away)), 1e-3)
    direction = away / distance
    residual = np.array([*(forward - direction), right[2]])
    jacobian = np.empty((4, len(positions)))
    across = (np.eye(3) - np.outer(direction, direction)) / distance
    for index, (joint, frame) in enumerate(zip(arm.joints, frames, strict=True)):
        axis = frame[:3, :3] @ np.array(joint.axis)
        swing = np.cross(axis, lens - frame[:3, 3])
        jacobian[:3, index] = np.cross(axis, forward) + across @ swing
        jacobian[3, index] = np.cross(axis, right)[2]
    return residual, jacobian
