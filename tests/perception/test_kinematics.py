"""Where the arm has the camera look, and how its joints get there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_perception.arm.kinematics import (
    AIM_TOLERANCE,
    ArmMotionError,
    _damped_step,
    _task,
    direction_of,
    in_base,
    look_at,
)
from surveillance_perception.arm.scan import ScanPlan, aim_at, from_nearer_end
from surveillance_runtime.robot_arm import ARM, Arm, Joint

HOME = np.array(ARM.home)
LIMITED = settings(max_examples=60)


@LIMITED
@given(
    azimuth=st.floats(-math.pi, math.pi),
    elevation=st.floats(-1.5, 1.5),
    distance=st.floats(1.0, 20.0),
)
def test_camera_looks_at_any_point_around_upright(azimuth, elevation, distance):
    target = np.array([0.0, 0.0, 0.7]) + distance * direction_of(azimuth, elevation)
    aim = look_at(ARM, target, HOME)
    assert (aim.positions >= ARM.lower).all()
    assert (aim.positions <= ARM.upper).all()
    frame = ARM.camera_frame(aim.positions)
    sight = target - frame[:3, 3]
    assert math.acos(min(1.0, frame[:3, 2] @ sight / np.linalg.norm(sight))) < AIM_TOLERANCE
    assert abs(frame[2, 0]) < math.sin(AIM_TOLERANCE)


def test_point_beyond_the_limits_is_refused_and_says_what_is_left():
    narrow = Arm(
        joints=tuple(
            Joint(joint.name, joint.offset, joint.axis, -0.3, 0.3) for joint in ARM.joints
        ),
        camera_offset=ARM.camera_offset,
        home=(0.0,) * 5,
    )
    look_at(narrow, np.array([4.0, 0.5, 0.8]), np.zeros(5))
    with pytest.raises(ArmMotionError, match=r'cannot look at \(-4.00, 0.00, 0.80\): .* degrees'):
        look_at(narrow, np.array([-4.0, 0.0, 0.8]), np.zeros(5))


@pytest.mark.parametrize('target', [[math.nan, 0, 0], [math.inf, 0, 0], [1.0, 2.0]])
def test_what_is_no_point_is_refused(target):
    with pytest.raises(ArmMotionError, match='three finite numbers'):
        look_at(ARM, np.array(target), HOME)


def test_point_at_the_lens_is_refused():
    lens = ARM.camera_frame(HOME)[:3, 3]
    with pytest.raises(ArmMotionError):
        look_at(ARM, lens, HOME)


@pytest.mark.parametrize('pan', [-math.pi, math.pi])
def test_scan_begins_at_the_end_that_the_arm_is_near(pan):
    posture = np.array([pan, *ARM.home[1:]])
    plan = ScanPlan(math.radians(60), math.radians(47), 0.1, -0.3, 0.3)
    views = from_nearer_end(ARM, plan.views, posture)
    assert set(views) == set(plan.views)
    assert abs(aim_at(ARM, views[0], posture)[0] - pan) < 0.6


@pytest.mark.parametrize('seed', range(4))
def test_what_each_joint_changes_is_what_small_turns_of_it_change(seed):
    draw = np.random.default_rng(seed)
    positions = draw.uniform(ARM.lower * 0.8, ARM.upper * 0.8)
    target = draw.uniform(-2.0, 2.0, 3)
    residual, jacobian = _task(ARM, positions, target)
    frame = ARM.camera_frame(positions)
    away = target - frame[:3, 3]
    assert residual[:3] == pytest.approx(frame[:3, 2] - away / np.linalg.norm(away))
    assert residual[3] == pytest.approx(frame[2, 0])
    for joint in range(len(positions)):
        step = np.zeros(len(positions))
        step[joint] = 1e-5
        ahead, _ = _task(ARM, positions + step, target)
        behind, _ = _task(ARM, positions - step, target)
        assert jacobian[:, joint] == pytest.approx((ahead - behind) / 2e-5, abs=1e-6)


def test_a_damped_step_is_the_least_squares_answer_and_the_rest_goes_to_the_posture():
    draw = np.random.default_rng(1)
    jacobian, residual = draw.normal(0, 1, (4, 5)), draw.normal(0, 0.1, 4)
    towards = draw.normal(0, 0.1, 5)
    damping = 0.3 * np.linalg.norm(residual) + 1e-3
    # Of |J x + r|^2 + (damping |x|)^2 the least, written as one system.
    stacked = np.vstack([jacobian, damping * np.eye(5)])
    plain, *_ = np.linalg.lstsq(stacked, np.concatenate([-residual, np.zeros(5)]), rcond=None)
    assert _damped_step(residual, jacobian, np.zeros(5)) == pytest.approx(plain)
    shared, *_ = np.linalg.lstsq(
        stacked, np.concatenate([jacobian @ towards, np.zeros(5)]), rcond=None
    )
    assert _damped_step(residual, jacobian, towards) == pytest.approx(plain + towards - shared)


def test_a_point_is_told_in_the_frames_that_are_known():
    base = np.eye(4)
    base[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    base[:3, 3] = 5.0, 1.0, 0.0
    point = np.array([5.0, 3.0, 0.4])
    odom_in_map = np.eye(4)
    odom_in_map[:3, 3] = 10.0, 0.0, 0.0
    for frame in ('', 'base_link'):
        assert in_base(point, frame, None) is point
    assert in_base(point, 'odom', ('odom', base)) == pytest.approx([2.0, 0.0, 0.4])
    assert in_base(point, 'map', ('odom', base)) == pytest.approx([2.0, 0.0, 0.4])
    beyond = point + np.array([10.0, 0.0, 0.0])
    assert in_base(beyond, 'map', ('odom', base), odom_in_map) == pytest.approx([2.0, 0.0, 0.4])
    assert in_base(point, 'odom', ('odom', base), odom_in_map) == pytest.approx([2.0, 0.0, 0.4])
    with pytest.raises(ValueError, match=r"^frame 'odom' is not known, expected 'base_link'$"):
        in_base(point, 'odom', None)
    expected = r"^frame 'mars' is not known, expected 'base_link', 'map' or 'odom'$"
    with pytest.raises(ValueError, match=expected):
        in_base(point, 'mars', ('odom', base))


def test_directions_go_from_x_towards_y_and_up():
    assert direction_of(0.0, 0.0) == pytest.approx([1.0, 0.0, 0.0])
    assert direction_of(math.pi / 2, 0.0) == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert direction_of(0.3, math.pi / 2) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)
    x, y, z = direction_of(0.5, 0.4)
    assert (math.atan2(y, x), math.asin(z)) == pytest.approx((0.5, 0.4))


def test_an_aim_says_how_far_it_is_off_and_keeps_to_the_limits():
    for azimuth, elevation in ((0.4, 0.2), (-2.0, -0.3), (1.2, 0.6)):
        shoulder = ARM.camera_frame(ARM.home)[:3, 3]
        target = shoulder + 3.0 * direction_of(azimuth, elevation)
        aim = look_at(ARM, target, np.array(ARM.home))
        frame = ARM.camera_frame(aim.positions)
        sight = (target - frame[:3, 3]) / np.linalg.norm(target - frame[:3, 3])
        assert aim.error == pytest.approx(
            math.acos(min(1.0, float(frame[:3, 2] @ sight))), abs=1e-6
        )
        assert aim.error < math.radians(0.5)
        assert aim.roll == pytest.approx(abs(math.asin(frame[2, 0])), abs=1e-9)
        assert (aim.positions >= ARM.lower).all()
        assert (aim.positions <= ARM.upper).all()
