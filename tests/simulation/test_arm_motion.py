"""The arm's motors and the chain they move."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from surveillance_runtime.robot_arm import ARM, TrajectoryPoint
from surveillance_simulation.robot.arm_motion import ArmMotion

NAMES = ARM.names


def point(time: float, *positions: float, velocities: tuple[float, ...] = ()) -> TrajectoryPoint:
    return TrajectoryPoint(time, positions, velocities)


def test_it_rests_at_home() -> None:
    arm = ArmMotion(ARM)
    assert arm.positions(12.0) == pytest.approx(ARM.home)
    assert not arm.is_moving(0.0)


def test_named_joints_move_and_the_others_stay() -> None:
    arm = ArmMotion(ARM)
    arm.follow(['arm_pan'], [point(2.0, 1.0)], now=10.0)
    assert arm.positions(11.0) == pytest.approx((0.5, *ARM.home[1:]))
    assert arm.velocities(11.0)[0] == pytest.approx(0.5)
    assert arm.is_moving(11.9)
    assert arm.positions(13.0) == pytest.approx((1.0, *ARM.home[1:]))
    assert not arm.is_moving(12.0)


def test_velocities_make_it_pass_points_smoothly() -> None:
    arm = ArmMotion(ARM)
    points = [point(1.0, 0.5, velocities=(1.0,)), point(2.0, 1.0, velocities=(0.0,))]
    arm.follow(['arm_pan'], points, now=0.0)
    times = np.linspace(0.0, 2.0, 401)
    positions = np.array([arm.positions(time)[0] for time in times])
    velocities = np.array([arm.velocities(time)[0] for time in times])
    assert np.gradient(positions, times)[5:-5] == pytest.approx(velocities[5:-5], abs=0.02)
    assert arm.velocities(1.0)[0] == pytest.approx(1.0)


def test_a_new_trajectory_takes_over_where_the_arm_is() -> None:
    arm = ArmMotion(ARM)
    arm.follow(['arm_pan'], [point(2.0, 1.0)], now=0.0)
    arm.follow(['arm_pan'], [point(1.0, 0.0)], now=1.0)
    assert arm.positions(1.0)[0] == pytest.approx(0.5)
    assert arm.positions(1.5)[0] == pytest.approx(0.25)


def test_an_empty_trajectory_stops_it_where_it_is() -> None:
    arm = ArmMotion(ARM)
    arm.follow(['arm_pan'], [point(2.0, 1.0)], now=0.0)
    arm.follow([], [], now=1.0)
    assert arm.positions(5.0)[0] == pytest.approx(0.5)
    assert not arm.is_moving(1.0)


@pytest.mark.parametrize(
    ('names', 'points', 'message'),
    [
        (['elbow'], [point(1.0, 0.0)], "no joint 'elbow': expected arm_pan, arm_lift"),
        (['arm_pan', 'arm_pan'], [point(1.0, 0.0, 0.0)], 'joint named twice in arm_pan, arm_pan'),
        (['arm_pan'], [point(1.0)], 'point 1: 0 positions and 0 velocities for 1 joints'),
        (['arm_pan'], [point(1.0, math.nan)], 'point 1: expected finite numbers'),
        (['arm_pan'], [point(1.0, 0.0), point(1.0, 0.1)], 'point 2: time 1 s: expected more'),
        (['arm_pan'], [point(1.0, 9.0)], 'point 1: arm_pan at 9 rad: expected -3.2 to 3.2'),
    ],
)
def test_what_it_cannot_follow_is_refused_in_one_line(
    names: list[str], points: list[TrajectoryPoint], message: str
) -> None:
    arm = ArmMotion(ARM)
    with pytest.raises(ValueError, match=f'^{re.escape(message)}'):
        arm.follow(names, points, now=0.0)
    assert arm.positions(1.0) == pytest.approx(ARM.home)


def test_the_camera_stands_upright_at_zero_and_follows_pan_and_tilt() -> None:
    upright = ARM.camera_frame([0.0] * 5)
    assert upright[:3, 2] == pytest.approx((1.0, 0.0, 0.0))
    assert upright[:3, 3] == pytest.approx((0.14, 0.0, 0.85))
    left = ARM.camera_frame([math.pi / 2, 0.0, 0.0, 0.0, 0.0])
    assert left[:3, 2] == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    down = ARM.camera_frame([0.0, 0.0, 0.0, math.pi / 2, 0.0])
    assert down[:3, 2] == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)


def test_the_chain_refuses_a_wrong_number_of_joints() -> None:
    with pytest.raises(ValueError, match='2 positions: expected 5'):
        ARM.camera_frame([0.0, 0.0])


def test_between_two_points_it_moves_on_the_cubic_of_hermite() -> None:
    arm = ArmMotion(ARM)
    arm.follow(
        ['arm_pan'],
        [point(2.0, 1.0, velocities=(0.5,)), point(3.0, 1.2, velocities=(0.0,))],
        now=10.0,
    )
    # From 0 at rest to 1 with 0.5 rad/s in 2 s: a s^3 + b s^2 with a = -2 + 1, b = 3 - 1.
    for share in (0.0, 0.25, 0.5, 0.9):
        assert arm.positions(10.0 + 2.0 * share)[0] == pytest.approx(2 * share**2 - share**3)
        assert arm.velocities(10.0 + 2.0 * share)[0] == pytest.approx(
            (4 * share - 3 * share**2) / 2
        )
    # From 1 with 0.5 rad/s to 1.2 at rest in 1 s.
    for share in (0.0, 0.3, 0.8):
        expected = 1.0 + 0.5 * share - 0.4 * share**2 + 0.1 * share**3
        assert arm.positions(12.0 + share)[0] == pytest.approx(expected)
        assert arm.velocities(12.0 + share)[0] == pytest.approx(0.5 - 0.8 * share + 0.3 * share**2)
    assert arm.positions(9.0)[0] == 0.0
    assert arm.positions(99.0)[0] == 1.2
    assert arm.velocities(13.0) == pytest.approx(np.zeros(5))


def test_joints_that_a_point_does_not_name_stay_and_its_own_start_is_no_point() -> None:
    arm = ArmMotion(ARM)
    arm.follow(['arm_lift', 'arm_pan'], [point(0.0, 0.5, 0.5), point(1.0, 0.2, -0.4)], now=5.0)
    first = list(ARM.home)
    pan, lift = ARM.names.index('arm_pan'), ARM.names.index('arm_lift')
    half = arm.positions(5.5)
    assert half[pan] == pytest.approx((first[pan] - 0.4) / 2)
    assert half[lift] == pytest.approx((first[lift] + 0.2) / 2)
    first[pan], first[lift] = -0.4, 0.2
    assert arm.positions(6.0) == pytest.approx(first)
    mixed = [point(1.0, 0.5, velocities=(0.3,)), point(2.0, 1.0)]
    arm.follow(['arm_pan'], mixed, now=7.0)
    assert arm.velocities(7.5)[pan] == pytest.approx(0.9), 'on a line where one has no velocity'


def test_a_cubic_does_not_leave_the_joints_limits() -> None:
    arm = ArmMotion(ARM)
    pan = ARM.names.index('arm_pan')
    top = float(ARM.upper[pan])
    arm.follow(['arm_pan'], [point(1.0, top, velocities=(-9.0,))], now=0.0)
    reached = [arm.positions(0.02 * n)[pan] for n in range(51)]
    assert max(reached) == top
    arm.positions(2.0)[pan] = 9.0
    assert arm.positions(2.0)[pan] == top, 'what it returned is not its own'
