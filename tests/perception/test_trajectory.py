"""Motions of the arm within its limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_perception.arm.kinematics import (
    ArmMotionError,
)
from surveillance_perception.arm.trajectory import (
    SAMPLE_PERIOD,
    ArmState,
    ArmTrajectory,
    motion_to,
    motion_to_rest,
)
from surveillance_runtime.robot_arm import ARM

HOME = np.array(ARM.home)
LIMITED = settings(max_examples=60)
joint_positions = st.tuples(*(st.floats(joint.lower, joint.upper) for joint in ARM.joints)).map(
    np.array
)


@LIMITED
@given(start=joint_positions, goal=joint_positions)
def test_motion_keeps_all_limits_and_ends_at_rest(start, goal):
    motion = motion_to(ARM, ArmState.resting(start), goal)
    assert np.allclose(motion.positions[0], start)
    assert np.allclose(motion.goal, goal, atol=1e-6)
    assert np.allclose(motion.speeds[[0, -1]], 0.0, atol=1e-6)
    assert (np.abs(motion.speeds) <= [j.speed + 1e-6 for j in ARM.joints]).all()
    assert (np.abs(motion.accelerations) <= [j.acceleration + 1e-6 for j in ARM.joints]).all()
    if motion.duration > 0:
        jerks = np.diff(motion.accelerations, axis=0) / np.diff(motion.times)[:, None]
        assert (np.abs(jerks) <= [j.jerk + 1e-3 for j in ARM.joints]).all()


def test_stop_in_the_middle_is_smooth():
    motion = motion_to(ARM, ArmState.resting(HOME), HOME + np.array([2.5, 0, 0, 0, 0]))
    middle = motion.at(motion.duration / 2)
    stop = motion_to_rest(ARM, middle)
    assert np.allclose(stop.positions[0], middle.positions)
    assert np.allclose(stop.speeds[0], middle.speeds)
    assert np.allclose(stop.speeds[-1], 0.0, atol=1e-6)
    assert stop.duration < 1.5


def test_between_its_points_a_motion_is_linear_and_before_and_after_them_it_stands():
    motion = ArmTrajectory(
        np.array([0.0, 1.0, 3.0]),
        np.array([[0.0, 1.0], [0.4, 3.0], [1.0, 2.0]]),
        np.array([[0.0, 0.0], [0.6, -0.2], [0.0, 0.0]]),
        np.array([[0.0, 2.0], [-1.0, 0.0], [0.0, 0.0]]),
    )
    assert motion.duration == 3.0
    assert motion.goal.tolist() == [1.0, 2.0]
    for time, positions, speeds, accelerations in (
        (-1.0, (0.0, 1.0), (0.0, 0.0), (0.0, 2.0)),
        (0.25, (0.1, 1.5), (0.15, -0.05), (-0.25, 1.5)),
        (1.0, (0.4, 3.0), (0.6, -0.2), (-1.0, 0.0)),
        (2.5, (0.85, 2.25), (0.15, -0.05), (-0.25, 0.0)),
        (3.0, (1.0, 2.0), (0.0, 0.0), (0.0, 0.0)),
        (9.0, (1.0, 2.0), (0.0, 0.0), (0.0, 0.0)),
    ):
        state = motion.at(time)
        assert state.positions == pytest.approx(positions)
        assert state.speeds == pytest.approx(speeds)
        assert state.accelerations == pytest.approx(accelerations)


def test_a_motion_to_where_the_arm_is_has_two_points():
    motion = motion_to(ARM, ArmState.resting(HOME), HOME)
    assert motion.times.tolist() == [0.0, SAMPLE_PERIOD]
    assert np.allclose(motion.positions, [HOME, HOME])


def test_the_points_of_a_motion_are_as_few_as_their_period_allows():
    motion = motion_to(ARM, ArmState.resting(HOME), HOME + np.array([0.7, 0, 0, 0, 0]))
    steps = np.diff(motion.times)
    assert motion.times[0] == 0.0
    assert np.allclose(steps, steps[0])
    assert steps.max() <= SAMPLE_PERIOD + 1e-9
    assert len(steps) == math.ceil(motion.duration / SAMPLE_PERIOD)


def test_a_joint_s_limit_itself_is_reached_and_a_little_beyond_it_is_not():
    for side, sign in ((ARM.lower, -1.0), (ARM.upper, 1.0)):
        goal = HOME.copy()
        goal[0] = side[0]
        motion = motion_to(ARM, ArmState.resting(HOME), goal)
        assert motion.goal[0] == pytest.approx(side[0], abs=1e-6)
        goal[0] += sign * 0.001
        with pytest.raises(ArmMotionError) as error:
            motion_to(ARM, ArmState.resting(HOME), goal)
        joint = ARM.joints[0]
        assert str(error.value) == (
            f'{joint.name} cannot reach {goal[0]:.3f} rad, '
            f'expected {joint.lower:g} to {joint.upper:g}'
        )


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_joint_that_was_measured_beyond_its_limits_is_stopped(sign):
    speeds = np.array([sign * 1.01 * joint.speed for joint in ARM.joints])
    accelerations = np.array([-sign * 1.01 * joint.acceleration for joint in ARM.joints])
    stop = motion_to_rest(ARM, ArmState(HOME, speeds, accelerations))
    assert stop.speeds[0] == pytest.approx(speeds / 1.01)
    assert stop.accelerations[0] == pytest.approx(accelerations / 1.01)
    assert np.allclose(stop.speeds[-1], 0.0, atol=1e-6)


@pytest.mark.parametrize('goal', [[9.0, 0, 0, 0, 0], [0.0, 0.0], [math.nan] * 5])
def test_goal_outside_the_limits_is_refused(goal):
    with pytest.raises(ArmMotionError):
        motion_to(ARM, ArmState.resting(HOME), np.array(goal))
