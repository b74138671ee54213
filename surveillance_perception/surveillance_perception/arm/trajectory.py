"""Motions of the arm from rest, or from any state, limited in speed, acceleration and jerk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ruckig

from surveillance_perception.arm.kinematics import ArmMotionError
from surveillance_runtime.robot_arm import Arm, Array

SAMPLE_PERIOD = 0.05
"""Seconds between the points of a trajectory."""


@dataclass(frozen=True, eq=False)
class ArmState:
    """Where the joints are and how they move: each (n,), in rad, rad/s and rad/s^2."""

    positions: Array
    speeds: Array
    accelerations: Array

    @classmethod
    def resting(cls, positions: Array) -> ArmState:
        """At rest at some positions."""
        zero = np.zeros(len(positions))
        return cls(np.asarray(positions, dtype=float), zero, zero)


@dataclass(frozen=True, eq=False)
class ArmTrajectory:
    """A motion that ends at rest.

    Attributes:
        times: (k,) seconds from its start; the first is 0.
        positions: (k, n) rad.
        speeds: (k, n) rad/s.
        accelerations: (k, n) rad/s^2.
    """

    times: Array
    positions: Array
    speeds: Array
    accelerations: Array

    @property
    def duration(self) -> float:
        """Seconds."""
        return float(self.times[-1])

    @property
    def goal(self) -> Array:
        """Positions (n,) at the end, rad."""
        return np.asarray(self.positions[-1])

    def at(self, time: float) -> ArmState:
        """State at a time since the start, between the points linearly; after the end at rest."""
        rows = (self.positions, self.speeds, self.accelerations)
        values = [
            np.array([np.interp(time, self.times, column) for column in row.T]) for row in rows
        ]
        return ArmState(*values)


def motion_to(arm: Arm, start: ArmState, goal: Array) -> ArmTrajectory:
    """Return the fastest motion to joint positions within the limits of the joints.

    Raises:
        ArmMotionError: The goal is outside the joints' limits.
    """
    goal = np.asarray(goal, dtype=float)
    if goal.shape != (len(arm.joints),) or not np.isfinite(goal).all():
        raise ArmMotionError(f'a goal must be {len(arm.joints)} finite joint positions')
    for joint, value in zip(arm.joints, goal.tolist(), strict=True):
        if not joint.lower - 1e-9 <= value <= joint.upper + 1e-9:
            raise ArmMotionError(
                f'{joint.name} cannot reach {value:.3f} rad, '
                f'expected {joint.lower:g} to {joint.upper:g}'
            )
    request = _request(arm, start)
    request.target_position = goal.tolist()
    return _solve(request, start)


def motion_to_rest(arm: Arm, start: ArmState) -> ArmTrajectory:
    """Return the fastest way to a standstill from a moving state."""
    request = _request(arm, start)
    request.control_interface = ruckig.ControlInterface.Velocity
    request.target_velocity = [0.0] * len(arm.joints)
    return _solve(request, start)


def _request(arm: Arm, start: ArmState) -> ruckig.InputParameter:
    request = ruckig.InputParameter(len(arm.joints))
    limits = [(joint.speed, joint.acceleration, joint.jerk) for joint in arm.joints]
    request.max_velocity, request.max_acceleration, request.max_jerk = (
        list(each) for each in zip(*limits, strict=True)
    )
    # what was measured may be a little beyond a limit, which ruckig refuses
    request.current_position = start.positions.tolist()
    request.current_velocity = np.clip(
        start.speeds, -np.array(request.max_velocity), request.max_velocity
    ).tolist()
    request.current_acceleration = np.clip(
        start.accelerations, -np.array(request.max_acceleration), request.max_acceleration
    ).tolist()
    return request


def _solve(request: ruckig.InputParameter, start: ArmState) -> ArmTrajectory:
    joints = len(start.positions)
    trajectory = ruckig.Trajectory(joints)
    result = ruckig.Ruckig(joints).calculate(request, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise ArmMotionError(f'no motion from {start.positions.round(3).tolist()}: {result.name}')
    # also a motion to where the arm is takes its time: its points must follow one another
    duration = max(float(trajectory.duration), SAMPLE_PERIOD)
    count = max(2, int(np.ceil(duration / SAMPLE_PERIOD)) + 1)
    times = np.linspace(0.0, duration, count)
    rows = [trajectory.at_time(float(time)) for time in times]
    positions, speeds, accelerations = (np.array([row[k] for row in rows]) for k in range(3))
    return ArmTrajectory(times, positions, speeds, accelerations)
