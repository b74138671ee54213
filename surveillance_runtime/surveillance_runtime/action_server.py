"""An action server whose goals run on a worker thread, one at a time, the newest first.

It behaves as ROS 1's SimpleActionServer did: a new goal takes the place of the one that runs. The
executor stays free while a goal runs, so a goal can be cancelled at any moment.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup

from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import ACTION_SERVER_QOS
from surveillance_runtime.waiting import ClockWait, Interrupt, work_aside

RESULT_KEPT = 300
"""How long a server keeps the result of an ended goal, seconds of ROS time."""


class GoalAbortedError(Exception):
    """Raised by an execute function to abort its goal.

    Args:
        reason: One line, logged by the server.
        result: The result message to send along; None sends an empty one.
    """

    def __init__(self, reason: str, result: Any = None) -> None:
        super().__init__(reason)
        self.result = result


class GoalRun:
    """One goal while it runs: what its execute function may do.

    Attributes:
        interrupt: Raised when the goal shall end: cancelled, replaced by a newer one, or the
            node stops.
    """

    def __init__(self, handle: Any, wait: ClockWait) -> None:
        self.interrupt = Interrupt()
        self.cancelled = False
        self._handle = handle
        self._wait = wait

    def feedback(self, message: Any) -> None:
        """Publish a feedback message; ignored once the goal has ended."""
        if self._handle.is_active:
            self._handle.publish_feedback(message)

    def sleep(self, seconds: float) -> bool:
        """Sleep on ROS time; False when the goal shall end."""
        return self._wait.sleep(seconds, self.interrupt)

    def now(self) -> float:
        """Return ROS time in seconds."""
        return self._wait.now()


Execute = Callable[[Any, GoalRun], Any]
"""Takes the goal request and its run; returns the result. Runs on a worker thread."""


class GoalServer:
    """Serves one action.

    A goal whose run was interrupted ends as canceled when its client asked for that, else as
    aborted; what the execute function returned is sent as the result either way.

    Args:
        node: The node that serves.
        action_type: The action's type.
        name: The action's name, relative to the node's namespace.
        execute: Does the work of a goal; may raise `GoalAbortedError`.
        accept: Looks at a goal request before it is accepted; default accepts all.
    """

    def __init__(
        self,
        node: PatrolNode,
        action_type: Any,
        name: str,
        execute: Execute,
        accept: Callable[[Any], bool] = lambda _goal: True,
    ) -> None:
        self._node = node
        self._action_type = action_type
        self._execute = execute
        self._wait = ClockWait(node)
        self._lock = threading.Lock()
        self._current: GoalRun | None = None
        self._turn = threading.Lock()
        self._runs: dict[bytes, GoalRun] = {}
        self.name = name
        self._server = ActionServer(
            node,
            action_type,
            name,
            self._run,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=lambda goal: GoalResponse.ACCEPT if accept(goal) else GoalResponse.REJECT,
            handle_accepted_callback=self._accepted,
            cancel_callback=self._cancel,
            result_timeout=RESULT_KEPT,
            **ACTION_SERVER_QOS,
        )
        node.own(self._server)
        node.stopping.subscribe(self._stop)

    def _accepted(self, handle: Any) -> None:
        run = GoalRun(handle, self._wait)
        with self._lock:
            previous, self._current = self._current, run
            self._runs[bytes(handle.goal_id.uuid)] = run
        if previous is not None:
            previous.interrupt.set()
        handle.execute()

    def _cancel(self, handle: Any) -> CancelResponse:
        run = self._runs.get(bytes(handle.goal_id.uuid))
        if run is not None:
            run.cancelled = True
            run.interrupt.set()
        return CancelResponse.ACCEPT

    def _stop(self) -> None:
        with self._lock:
            runs = list(self._runs.values())
        for run in runs:
            run.interrupt.set()

    async def _run(self, handle: Any) -> Any:
        run = self._runs[bytes(handle.goal_id.uuid)]
        if self._node.stopping.is_set():
            run.interrupt.set()

        def work() -> tuple[Any, str | None]:
            # One goal works at a time: the one that is replaced lets go first.
            with self._turn:
                return self._work(handle.request, run)

        result, error = await work_aside(self._node, work, f'{self.name} goal')
        with self._lock:
            del self._runs[bytes(handle.goal_id.uuid)]
            if self._current is run:
                self._current = None
        if error is not None:
            self._node.get_logger().error(f'{self.name}: {error}')
        if handle.is_cancel_requested:
            handle.canceled()
        elif error is not None or run.interrupt.is_set():
            handle.abort()
        else:
            handle.succeed()
        return result

    def _work(self, request: Any, run: GoalRun) -> tuple[Any, str | None]:
        empty = self._action_type.Result()
        try:
            result = self._execute(request, run)
        except GoalAbortedError as abort:
            return (empty if abort.result is None else abort.result), str(abort)
        except Exception as error:
            if run.interrupt.is_set():
                return empty, None
            return empty, f'{type(error).__name__}: {error}'
        return (empty if result is None else result), None
