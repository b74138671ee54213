"""The camera on its arm, as `initial_scan` turns it, over ROS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from surveillance_fsm.ros import CallError, GoalCaller, ServiceCaller
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.srv import MarkerRoutine
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.settled_frames import SettledFrames
from surveillance_runtime.waiting import ClockWait, Interrupt

_ARM_SECONDS = 30.0


class CameraScanner:
    """Moves the arm over `move_arm` and `scan_surroundings`, and waits for pictures at rest.

    Args:
        node: The node that looks around; its threads call the methods.
        pictures: How many pictures to wait for at each pose.
        patience: Seconds after which a pose is left without them.
    """

    def __init__(self, node: PatrolNode, pictures: int, patience: float) -> None:
        self._node = node
        self._pictures = pictures
        self._patience = patience
        self._wait = ClockWait(node)
        self._move = ServiceCaller(node, MarkerRoutine, 'move_arm')
        self._scan = GoalCaller(node, ScanSurroundings, 'scan_surroundings', cancel_timeout=1.0)
        self._read = SettledFrames(node)

    def pose(self, number: int) -> None:
        """Take one of the arm's poses and look."""
        if self._moved(number):
            self._read.wait(self._pictures, 0.0, self._patience, self._node.stopping)

    def home(self) -> None:
        """Fold the arm for driving."""
        self._moved(MarkerRoutine.Request.HOME)

    def scan(self, overlap: float, reach: float, dwell: float, done: Callable[[], bool]) -> None:
        """Look all around the horizon; `done` is asked after each view and ends the scan."""
        goal = ScanSurroundings.Goal(overlap=overlap, lowest=-reach, highest=reach, dwell=dwell)
        view_changed, ended = Interrupt(), Interrupt()
        forget = self._node.stopping.subscribe(ended.set)

        def told(feedback: Any) -> None:
            if not feedback.resting and feedback.view > 1:
                view_changed.set()

        # `done` may ask other nodes, which a feedback callback must not wait for
        watcher = self._node.spawn(lambda: _watch(view_changed, ended, done), 'scan watch')
        try:
            self._scan.run(goal, accept_timeout=_ARM_SECONDS, interrupt=ended, on_feedback=told)
        except CallError as error:
            if not ended.is_set():
                self._complain(str(error))
        finally:
            forget()
            ended.set()
            view_changed.set()
            watcher.join()

    def _moved(self, number: int) -> bool:
        request = MarkerRoutine.Request(pos=number)
        try:
            answer = self._move.call(request, _ARM_SECONDS, self._node.stopping)
        except CallError as error:
            self._complain(str(error))
            return False
        if not answer.success:
            self._complain(f'move_arm to pose {number}: {answer.message}')
        return bool(answer.success)

    def _complain(self, reason: str) -> None:
        if not self._node.stopping.is_set():
            self._node.get_logger().warn(reason)
            # without an arm there is nothing to wait for but the pictures that come anyway
            self._wait.sleep(1.0, self._node.stopping)


def _watch(view_changed: Interrupt, ended: Interrupt, done: Callable[[], bool]) -> None:
    while view_changed.wait() and not ended.is_set():
        view_changed.clear()
        if done():
            ended.set()
