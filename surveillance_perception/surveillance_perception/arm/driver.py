"""Driving the arm: sends motions, follows the joints' reports, and knows when the arm rests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from surveillance_perception.arm.kinematics import ArmMotionError
from surveillance_perception.arm.trajectory import (
    ArmState,
    ArmTrajectory,
    motion_to,
    motion_to_rest,
)
from surveillance_runtime.robot_arm import Arm, Array

PATIENCE = 5.0
"""Seconds of steady time for which an arm that does not move is waited for."""

REST_SPEED = 0.01
"""Speed of every joint below which the arm rests, rad/s."""

# how near to its goal each joint must come, rad
_TOLERANCE = 0.02


class ArmDriver:
    """Moves one arm, one motion at a time; the newest wins.

    Args:
        arm: The arm's joints.
        send: Hands a motion to the arm's hardware or simulation.
        now: Time in seconds of the clock by which motions run.
        on_rest: Told whenever the arm comes to rest (True) or begins to move (False).
        patience: Seconds of steady time for which an arm that does not move is waited for.
    """

    def __init__(
        self,
        arm: Arm,
        send: Callable[[ArmTrajectory], None],
        now: Callable[[], float],
        on_rest: Callable[[bool], None] = lambda _resting: None,
        patience: float = PATIENCE,
    ) -> None:
        self.arm = arm
        self._send = send
        self._now = now
        self._on_rest = on_rest
        self._patience = patience
        self._changed = threading.Condition(threading.RLock())
        self._measured: ArmState | None = None
        self._reports = 0
        self._motion: ArmTrajectory | None = None
        self._began = 0.0
        self._turn = 0
        self._resting: bool | None = None

    @property
    def positions(self) -> Array | None:
        """Joint positions (n,) as last reported, rad; None before the first report."""
        measured = self._measured
        return None if measured is None else measured.positions

    @property
    def posture(self) -> Array:
        """Joint positions (n,) as last reported, rad; the arm's home before the first report."""
        positions = self.positions
        return np.array(self.arm.home) if positions is None else positions

    def report(
        self, names: Sequence[str], positions: Sequence[float], speeds: Sequence[float]
    ) -> bool:
        """Take a report of the joints; one that lacks a joint of the arm is not for it.

        One with a number that is not finite is left out.

        Returns:
            Whether it was taken.
        """
        where = {name: index for index, name in enumerate(names)}
        if any(name not in where for name in self.arm.names) or len(positions) < len(names):
            return False
        order = [where[name] for name in self.arm.names]
        found = np.array([positions[index] for index in order])
        moving = np.zeros(len(order))
        if len(speeds) >= len(names):
            moving = np.array([speeds[index] for index in order])
        if not np.isfinite(found).all() or not np.isfinite(moving).all():
            return False
        with self._changed:
            self._measured = ArmState(found, moving, np.zeros(len(order)))
            self._reports += 1
            self._settle()
            self._changed.notify_all()
        return True

    def wake(self) -> None:
        """Make a waiting motion look at its `ended` again."""
        with self._changed:
            self._changed.notify_all()

    def move(self, goal: Array, ended: Callable[[], bool] = lambda: False) -> None:
        """Move to joint positions and block until the arm rests there.

        Args:
            goal: (n,) rad.
            ended: Tells whether the motion shall be given up; the arm is stopped then. Call `wake`
                after a change.

        Raises:
            ArmMotionError: The goal is outside the limits, the arm does not report or get there, or
                another motion took over.
        """
        with self._changed:
            self._turn += 1
            turn = self._turn
            self._changed.notify_all()
            self._await_report(turn, ended)
            motion = motion_to(self.arm, self._state(), goal)
            self._begin(motion)
            self._follow(turn, motion, ended)

    def stop(self) -> None:
        """Bring the arm to a standstill where it is; the motion that runs fails."""
        with self._changed:
            self._turn += 1
            if self._measured is not None:
                self._begin(motion_to_rest(self.arm, self._state()))
            self._changed.notify_all()

    def halt(self, ended: Callable[[], bool] = lambda: False) -> None:
        """Stop, and block until the arm rests.

        Raises:
            ArmMotionError: The arm does not report, or another motion took over.
        """
        with self._changed:
            self.stop()
            turn = self._turn
            self._await_report(turn, ended)
            if self._motion is not None:
                self._follow(turn, self._motion, ended)

    def _state(self) -> ArmState:
        assert self._measured is not None
        if self._motion is None:
            return ArmState.resting(self._measured.positions)
        # what was sent, not what was measured: reports come late and without accelerations
        return self._motion.at(self._now() - self._began)

    def _begin(self, motion: ArmTrajectory) -> None:
        self._motion = motion
        self._began = self._now()
        self._tell(False)
        self._send(motion)

    def _await_report(self, turn: int, ended: Callable[[], bool]) -> None:
        deadline = time.monotonic() + self._patience
        while self._measured is None:
            if not self._changed.wait(deadline - time.monotonic()):
                raise ArmMotionError('the arm does not report its joints')
            self._check(turn, ended)

    def _follow(self, turn: int, motion: ArmTrajectory, ended: Callable[[], bool]) -> None:
        progress, best, reports = time.monotonic(), np.inf, self._reports
        while not self._arrived(motion):
            self._changed.wait(0.5)
            self._check(turn, ended)
            assert self._measured is not None
            left = float(np.abs(self._measured.positions - motion.goal).max())
            running = self._now() - self._began < motion.duration
            if left < best - 1e-4 or (running and self._reports != reports):
                best, progress = min(best, left), time.monotonic()
            if time.monotonic() - progress > self._patience:
                if self._reports == reports:
                    raise ArmMotionError('the arm does not report its joints')
                raise ArmMotionError(f'the arm stays {left:.3f} rad away from its goal')
        self._settle()

    def _check(self, turn: int, ended: Callable[[], bool]) -> None:
        if turn != self._turn:
            raise ArmMotionError('another motion took over')
        if ended():
            self.stop()
            raise ArmMotionError('the motion was given up')

    def _arrived(self, motion: ArmTrajectory) -> bool:
        if self._measured is None or self._now() - self._began < motion.duration:
            return False
        near = np.abs(self._measured.positions - motion.goal).max() <= _TOLERANCE
        return bool(near and np.abs(self._measured.speeds).max() <= REST_SPEED)

    def _settle(self) -> None:
        if self._measured is None:
            return
        still = bool(np.abs(self._measured.speeds).max() <= REST_SPEED)
        if self._motion is not None:
            still = still and self._now() - self._began >= self._motion.duration
        self._tell(still)

    def _tell(self, resting: bool) -> None:
        if resting is not self._resting:
            self._resting = resting
            self._on_rest(resting)
