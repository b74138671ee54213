"""The arm's aim, its motions and the driver that watches over them."""

from __future__ import annotations

import math
import threading
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from surveillance_perception.arm.driver import ArmDriver
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
from surveillance_perception.arm.trajectory import (
    SAMPLE_PERIOD,
    ArmState,
    ArmTrajectory,
    motion_to,
    motion_to_rest,
)
from surveillance_runtime.robot_arm import ARM, Arm, Joint

HOME = np.array(ARM.home)
LIMITED = settings(max_examples=60)
joint_positions = st.tuples(*(st.floats(joint.lower, joint.upper) for joint in ARM.joints)).map(
    np.array
)


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


class FollowingArm:
    """An arm that does what it is sent when `run` is called, on a clock of its own."""

    def __init__(self, follows: float = 1.0, patience: float = 5.0) -> None:
        self.time = 0.0
        self.sent = []
        self.rests = []
        self.follows = follows
        self.got = threading.Semaphore(0)
        self.driver = ArmDriver(
            ARM, self._take, lambda: self.time, self.rests.append, patience=patience
        )

    def _take(self, motion):
        self.sent.append((self.time, motion))
        self.got.release()

    def report(self):
        state = ArmState.resting(HOME)
        if self.sent:
            began, motion = self.sent[-1]
            state = motion.at((self.time - began) * self.follows)
        self.driver.report(ARM.names, state.positions.tolist(), state.speeds.tolist())

    def run(self, seconds, step=0.05):
        for _ in range(round(seconds / step)):
            self.time += step
            self.report()

    def wait_for_motion(self):
        assert self.got.acquire(timeout=60.0)


def in_thread(work):
    outcome = []

    def body():
        try:
            work()
            outcome.append(None)
        except ArmMotionError as error:
            outcome.append(error)

    thread = threading.Thread(target=body)
    thread.start()

    def join():
        thread.join(60.0)
        assert not thread.is_alive()
        return outcome[0]

    return join


def test_driver_returns_when_the_arm_rests_at_its_goal():
    arm = FollowingArm()
    arm.report()
    goal = HOME + np.array([1.0, 0, 0, 0, 0])
    done = in_thread(lambda: arm.driver.move(goal))
    arm.wait_for_motion()
    assert arm.rests[-1] is False
    arm.run(arm.sent[-1][1].duration + 0.3)
    assert done() is None
    assert arm.driver.positions is not None
    assert np.allclose(arm.driver.positions, goal, atol=0.01)
    assert arm.rests[-1] is True


def test_newer_motion_takes_over_from_where_the_arm_is():
    arm = FollowingArm()
    arm.report()
    first = in_thread(lambda: arm.driver.move(HOME + np.array([2.0, 0, 0, 0, 0])))
    arm.wait_for_motion()
    arm.run(0.8)
    second = in_thread(lambda: arm.driver.move(HOME - np.array([1.0, 0, 0, 0, 0])))
    arm.wait_for_motion()
    assert 'took over' in str(first())
    begun = arm.sent[-1][1]
    assert abs(begun.speeds[0][0]) > 0.1
    arm.run(begun.duration + 0.3)
    assert second() is None


def test_motion_that_is_given_up_stops_the_arm():
    arm = FollowingArm()
    arm.report()
    ended = threading.Event()
    done = in_thread(lambda: arm.driver.move(HOME + np.array([2.0, 0, 0, 0, 0]), ended.is_set))
    arm.wait_for_motion()
    arm.run(0.6)
    ended.set()
    arm.driver.wake()
    assert 'given up' in str(done())
    assert np.allclose(arm.sent[-1][1].speeds[-1], 0.0, atol=1e-6)


def test_halt_waits_for_the_standstill():
    arm = FollowingArm()
    arm.report()
    moving = in_thread(lambda: arm.driver.move(HOME + np.array([2.0, 0, 0, 0, 0])))
    arm.wait_for_motion()
    arm.run(0.6)
    halted = in_thread(arm.driver.halt)
    arm.wait_for_motion()
    arm.run(2.0)
    assert halted() is None
    assert 'took over' in str(moving())


def test_arm_that_never_reports_is_named():
    with pytest.raises(ArmMotionError, match='does not report'):
        FollowingArm(patience=0.05).driver.move(HOME)


def test_arm_that_stops_short_is_named():
    arm = FollowingArm(follows=0.3, patience=0.05)
    arm.report()
    done = in_thread(lambda: arm.driver.move(HOME + np.array([2.0, 0, 0, 0, 0])))
    arm.wait_for_motion()
    arm.run(arm.sent[-1][1].duration + 0.1)
    assert 'away from its goal' in str(done())


def test_reports_of_other_joints_are_not_taken():
    arm = FollowingArm()
    arm.driver.report(['wheel_left', 'wheel_right'], [0.0, 0.0], [])
    assert arm.driver.positions is None
    names = ['wheel_left', *reversed(ARM.names)]
    arm.driver.report(names, [9.0, 5.0, 4.0, 3.0, 2.0, 1.0], [])
    positions: Any = arm.driver.positions
    assert positions.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


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
