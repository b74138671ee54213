"""The driver that watches over the motions of the arm."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from surveillance_perception.arm.driver import ArmDriver
from surveillance_perception.arm.kinematics import (
    ArmMotionError,
)
from surveillance_perception.arm.trajectory import (
    ArmState,
)
from surveillance_runtime.robot_arm import ARM

HOME = np.array(ARM.home)


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
