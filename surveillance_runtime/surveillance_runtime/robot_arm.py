"""The robot's arm as a chain of joints: the one description that controller and simulator share.

Frames follow REP-103: `base_link` on the floor below the robot's middle, x forwards, z up; the
camera's optical frame at the end has x right, y down, z forward. With every joint at 0 the arm
stands straight up and the camera looks forwards. No ROS in here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

REST_PATIENCE = 30.0
"""Seconds of real time for which a scan may wait for pictures at a view, beyond its rest there:
whoever listens to a scan waits for longer before it counts as dead."""
_TOLERANCE = 1e-6
"""What a position may be beyond a limit, rad."""


@dataclass(frozen=True)
class Joint:
    """A revolute joint, described as URDF does.

    Attributes:
        name: Name in joint_states and trajectories.
        offset: Position of the joint in the frame of the joint before, metres.
        axis: Unit vector of the rotation, in the same frame.
        lower: Least position, rad.
        upper: Greatest position, rad.
        speed: Greatest speed, rad/s.
        acceleration: Greatest acceleration, rad/s^2.
        jerk: Greatest jerk, rad/s^3.
    """

    name: str
    offset: tuple[float, float, float]
    axis: tuple[float, float, float]
    lower: float
    upper: float
    speed: float = 1.5
    acceleration: float = 3.0
    jerk: float = 15.0


@dataclass(frozen=True)
class TrajectoryPoint:
    """Where the joints are to be at a time.

    Attributes:
        time: Seconds from the trajectory's start.
        positions: Positions in the order of the trajectory's joint names, rad.
        velocities: Velocities likewise, rad/s; empty when not given.
    """

    time: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()


@dataclass(frozen=True)
class Arm:
    """A chain of joints with a camera at its end.

    Attributes:
        joints: From the base to the wrist.
        camera_offset: Position of the lens in the frame of the last joint, metres.
        home: Positions of the joints at rest, rad.
    """

    joints: tuple[Joint, ...]
    camera_offset: tuple[float, float, float]
    home: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the wrist."""
        return tuple(joint.name for joint in self.joints)

    @property
    def lower(self) -> Array:
        """Least positions (n,), rad."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> Array:
        """Greatest positions (n,), rad."""
        return np.array([joint.upper for joint in self.joints])

    @property
    def longest_motion(self) -> float:
        """Seconds from rest to rest over the whole range of the slowest joint.

        A motion limited in jerk, acceleration and speed that reaches all three takes this long.
        """
        return max(
            (joint.upper - joint.lower) / joint.speed
            + joint.speed / joint.acceleration
            + joint.acceleration / joint.jerk
            for joint in self.joints
        )

    def frames(self, positions: Sequence[float] | Array) -> list[Array]:
        """Return the transforms (4, 4) from each joint's frame, after its turn, to `base_link`.

        Args:
            positions: Positions (n,) of the joints, rad.

        Raises:
            ValueError: There are not as many positions as joints.
        """
        if len(positions) != len(self.joints):
            raise ValueError(f'{len(positions)} positions: expected {len(self.joints)}')
        frame = np.eye(4)
        frames = []
        for joint, position in zip(self.joints, positions, strict=True):
            frame = frame @ _turned(joint, float(position))
            frames.append(frame)
        return frames

    def camera_frame(self, positions: Sequence[float] | Array) -> Array:
        """Return the transform (4, 4) from the camera's optical frame to `base_link`.

        Raises:
            ValueError: There are not as many positions as joints.
        """
        frame = self.frames(positions)[-1].copy()
        frame[:3, 3] += frame[:3, :3] @ self.camera_offset
        # x right is -y, y down is -z, z forward is x.
        frame[:3, :3] = frame[:3, :3] @ _OPTICAL
        return frame

    def check(self, names: Sequence[str], points: Sequence[TrajectoryPoint]) -> None:
        """Refuse a trajectory that the arm cannot follow.

        Args:
            names: The joints that it moves.
            points: Where they are to be.

        Raises:
            ValueError: A joint is unknown or named twice, a point has the wrong number of
                values or one that is not finite or beyond a limit, or the times do not rise.
        """
        known = self.names
        for name in names:
            if name not in known:
                raise ValueError(f"no joint '{name}': expected {', '.join(known)}")
        if len(set(names)) != len(names):
            raise ValueError(f'joint named twice in {", ".join(names)}')
        reached = -math.inf
        limits = {joint.name: (joint.lower, joint.upper) for joint in self.joints}
        for number, point in enumerate(points, start=1):
            if len(point.positions) != len(names) or len(point.velocities) not in (0, len(names)):
                raise ValueError(
                    f'point {number}: {len(point.positions)} positions and '
                    f'{len(point.velocities)} velocities for {len(names)} joints'
                )
            if not all(map(math.isfinite, (point.time, *point.positions, *point.velocities))):
                raise ValueError(f'point {number}: expected finite numbers')
            if point.time < 0 or point.time <= reached:
                raise ValueError(
                    f'point {number}: time {point.time:g} s: expected more than the point before'
                )
            reached = point.time
            for name, position in zip(names, point.positions, strict=True):
                lower, upper = limits[name]
                if not lower - _TOLERANCE <= position <= upper + _TOLERANCE:
                    raise ValueError(
                        f'point {number}: {name} at {position:g} rad: '
                        f'expected {lower:g} to {upper:g}'
                    )


_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def _turned(joint: Joint, angle: float) -> Array:
    """Return the transform of a joint: its offset, then its turn (Rodrigues' formula)."""
    x, y, z = joint.axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    transform = np.eye(4)
    transform[:3, :3] += math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    transform[:3, 3] = joint.offset
    return transform


ARM = Arm(
    joints=(
        Joint('arm_pan', (0.05, 0.0, 0.30), (0.0, 0.0, 1.0), -3.2, 3.2),
        Joint('arm_lift', (0.0, 0.0, 0.08), (0.0, 1.0, 0.0), -1.8, 1.8),
        Joint('arm_elbow', (0.0, 0.0, 0.25), (0.0, 1.0, 0.0), -2.4, 2.4),
        Joint('arm_tilt', (0.0, 0.0, 0.22), (0.0, 1.0, 0.0), -1.9, 1.9),
        Joint('arm_roll', (0.05, 0.0, 0.0), (1.0, 0.0, 0.0), -3.2, 3.2),
    ),
    camera_offset=(0.04, 0.0, 0.0),
    home=(0.0, -0.8, 1.6, -0.8, 0.0),
)
"""The patrol robot's arm: 0.55 m reach above a turntable, a camera that can be turned anywhere."""
