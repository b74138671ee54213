"""One goal of motion at a time: a drive or a turn, from its beginning to its end.

The goal's own thread waits here; what the navigator does with each scan happens in the executor's
thread, which holds `lock` and calls `stepped`. Asks `compute_path` for another path when a drive
does not go on.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lidar_navigation import (
    Drive,
    DriveParameters,
    DriveState,
    Navigator,
    NoPathError,
    Spin,
    Velocity,
)
from lidar_navigation.geometry import Points, Pose, point_of
from state_machines import Interrupt
from state_machines.ros import CallError, GoalCaller, GoalRun
from surveillance_controllers import conversions
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion.command_publisher import CommandPublisher
from surveillance_interfaces.action import ComputePath
from surveillance_runtime.conversions import point_message
from surveillance_runtime.node import PatrolNode


class GoalExecution:
    """Carries out goals with a navigator.

    Args:
        node: The node that has the goals.
        navigator: What steers.
        base: Takes the velocities.
        robot: How it drives.
        wait_for_peer: How long the planner may take to answer, seconds.
        sensor_timeout: A goal fails when nothing of use came for so long, seconds.
        holds: Whether the robot is held where it is.
        problem: Why it is not to be driven; empty: it may be.

    Attributes:
        lock: Held by whoever touches the navigator.
    """

    def __init__(
        self,
        node: PatrolNode,
        navigator: Navigator,
        base: CommandPublisher,
        robot: DriveParameters,
        wait_for_peer: float,
        sensor_timeout: float,
        holds: Callable[[], bool],
        problem: Callable[[], str] = str,
    ) -> None:
        self.lock = threading.RLock()
        self._node, self._navigator, self._base, self._robot = node, navigator, base, robot
        self._wait_for_peer, self._sensor_timeout, self._holds = (
            wait_for_peer,
            sensor_timeout,
            holds,
        )
        self._problem = problem
        self._stepped = threading.Condition(self.lock)
        self._steps = 0
        self._awaited: Callable[[], bool] = lambda: False
        self._on_step: Callable[[Pose], None] = lambda _pose: None
        self._planner = GoalCaller(node, ComputePath, 'compute_path')

    def drive(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Drive along a path of shape (n, 3), and along others where that does not go on.

        Args:
            path: The path.
            run: The goal that is carried out; its interrupt ends the drive early.
            report: Told the position with each scan, in the executor's thread; must not block.

        Returns:
            Where the robot is then, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        drive = Drive(path[:, :2], self._robot)
        interrupt = run.interrupt
        with self._carrying_out(drive, interrupt, lambda pose: report(point_of(pose))):
            while not drive.state.ended and not interrupt.is_set():
                self._await(
                    lambda: drive.state.ended or drive.state is DriveState.ASKING, interrupt
                )
                if drive.state is DriveState.ASKING and not interrupt.is_set():
                    self._find_another_path(drive, path[-1], run)
        end = point_of(self._navigator.pose or (float('nan'),) * 3)
        if drive.state is DriveState.FAILED:
            raise MotionFailedError(drive.reason, end)
        return end

    def turn(self, run: GoalRun, bearing: float | None = None) -> Points:
        """Turn on the spot, once around or to a bearing (rad); return where the robot is then.

        Raises:
            MotionFailedError: It has no room for that, or its sensors are silent.
        """
        spin = Spin(bearing)
        with self._carrying_out(spin, run.interrupt):
            self._await(lambda: spin.done, run.interrupt)
        end = point_of(self._navigator.pose or (float('nan'),) * 3)
        if bearing is not None and spin.done and not spin.has_turned:
            short = math.degrees(abs(spin.left))
            raise MotionFailedError(f'the robot cannot turn: {short:.0f} degrees are left', end)
        return end

    def stepped(self) -> None:
        """Take that the navigator has taken a scan; the caller holds the lock."""
        task, pose = self._navigator.task, self._navigator.pose
        if task is not None and pose is not None:
            self._on_step(pose)
        self._steps += 1
        if task is not None and self._awaited():
            self._stepped.notify_all()

    def _find_another_path(self, drive: Drive, goal: Points, run: GoalRun) -> None:
        """Ask the planner, and give the drive what it answers."""
        self._node.get_logger().info(f'{drive.reason}: looking for another path')
        pose = self._navigator.pose
        assert pose is not None
        try:
            path = self._ask_planner(point_of(pose), goal, run)
        except NoPathError as error:
            with self.lock:
                drive.no_path(str(error))
        else:
            with self.lock:
                drive.new_path(path)

    def _ask_planner(self, start: Points, goal: Points, run: GoalRun) -> Points:
        request = ComputePath.Goal(start=point_message(start), goal=point_message(goal))
        try:
            end = self._planner.run(
                request,
                accept_timeout=self._wait_for_peer,
                result_timeout=self._wait_for_peer,
                interrupt=run.interrupt,
            )
        except CallError as error:
            raise NoPathError(str(error)) from error
        if end.status != 'succeeded':
            raise NoPathError('the planner finds no other path')
        return conversions.array_from_points(end.result.path)[:, :2]

    @contextmanager
    def _carrying_out(
        self,
        task: Drive | Spin,
        interrupt: Interrupt,
        on_step: Callable[[Pose], None] = lambda _pose: None,
    ) -> Iterator[None]:
        """Hands a task to the navigator; before and afterwards the robot stands."""
        with self.lock:
            self._navigator.task, self._on_step = task, on_step
            self._navigator.stands = self._holds()
            # A simulator in lockstep waits for a command from the moment the goal is executed on,
            # and the scan of that moment may have come before the task.
            self._base.command(Velocity())
        unsubscribe = interrupt.subscribe(self._wake)
        try:
            yield
        finally:
            unsubscribe()
            with self.lock:
                self._navigator.task = None
                self._base.command(Velocity())

    def _await(self, condition: Callable[[], bool], interrupt: Interrupt) -> None:
        """Wait until a condition holds after a scan, or for the interrupt.

        Raises:
            MotionFailedError: The sensors gave nothing for too long, or what they tell contradicts
                itself.
        """
        with self._stepped:
            # The worker is woken when there is something to do, not with each scan.
            self._awaited = lambda: condition() or bool(self._problem())
            while not (condition() or interrupt.is_set()):
                if problem := self._problem():
                    pose = self._navigator.pose
                    raise MotionFailedError(problem, None if pose is None else point_of(pose))
                before = self._steps
                woken = self._stepped.wait(self._sensor_timeout)
                if not woken and self._steps == before:
                    topic, pose = self._navigator.missing or 'scan', self._navigator.pose
                    raise MotionFailedError(
                        f'nothing of use came on the topic {topic} for {self._sensor_timeout:g} s',
                        None if pose is None else point_of(pose),
                    )

    def _wake(self) -> None:
        with self._stepped:
            self._stepped.notify_all()
