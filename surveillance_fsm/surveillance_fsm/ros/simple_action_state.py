"""A state that sends a goal to an action server and waits for its end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.node import Node

import surveillance_fsm as fsm
from surveillance_fsm.ros.exchange import (
    ExchangeError,
    Incoming,
    Outgoing,
    UserCallback,
    seconds,
)
from surveillance_fsm.ros.pulse import ExecutorPulse
from surveillance_runtime.calls import CallError, CallInterruptedError, GoalCaller

_STATUS = {
    'succeeded': GoalStatus.STATUS_SUCCEEDED,
    'aborted': GoalStatus.STATUS_ABORTED,
    'canceled': GoalStatus.STATUS_CANCELED,
}


class SimpleActionState(fsm.State):
    """Runs an action and ends with ``succeeded``, ``aborted`` or ``preempted``.

    The state ends whatever happens: a server that is absent, rejects the goal, dies or restarts in
    the middle, or an executor that does not spin any more make it ``aborted``. A preempt cancels
    the goal; a server that refuses to cancel is given up after `preempt_timeout`.

    Args:
        node: The node that sends the goal; an executor must spin it in another thread.
        action_name: The action's name.
        action_spec: The action's type.
        goal: The goal; an empty one by default. It is copied, never changed.
        goal_key: Userdata key that holds the goal.
        goal_slots: Fields of the goal that are userdata keys.
        goal_cb: ``(userdata, goal, *args, **kwargs)``; returns the goal, or None.
        goal_cb_args: See `goal_cb`.
        goal_cb_kwargs: See `goal_cb`.
        result_key: Userdata key that takes the result.
        result_slots: Fields of the result that become userdata keys.
        result_cb: ``(userdata, status, result, *args, **kwargs)`` with a status of
            ``action_msgs/GoalStatus``; may return an outcome.
        result_cb_args: See `result_cb`.
        result_cb_kwargs: See `result_cb`.
        input_keys: Userdata that callbacks without a `cb_interface` read.
        output_keys: Userdata that callbacks without a `cb_interface` write.
        outcomes: Outcomes that `result_cb` may return.
        exec_timeout: Longest execution; then the goal is cancelled and the state ``aborted``.
        preempt_timeout: How long a server may take to end a cancelled goal.
        server_wait_timeout: For finding the server and for its yes or no.
        feedback_cb: ``(userdata, feedback, *args, **kwargs)``, in the executor's thread.
        feedback_cb_args: See `feedback_cb`.
        feedback_cb_kwargs: See `feedback_cb`.

    Durations are seconds of steady time, or an rclpy ``Duration``.

    Raises:
        InvalidStateError: A field or a callback is wrong.
    """

    def __init__(
        self,
        node: Node,
        action_name: str,
        action_spec: Any,
        goal: Any = None,
        goal_key: str | None = None,
        goal_slots: Iterable[str] = (),
        goal_cb: Callable[..., Any] | None = None,
        goal_cb_args: Iterable[Any] = (),
        goal_cb_kwargs: Mapping[str, Any] | None = None,
        result_key: str | None = None,
        result_slots: Iterable[str] = (),
        result_cb: Callable[..., Any] | None = None,
        result_cb_args: Iterable[Any] = (),
        result_cb_kwargs: Mapping[str, Any] | None = None,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        exec_timeout: Any = None,
        preempt_timeout: Any = 60.0,
        server_wait_timeout: Any = 60.0,
        feedback_cb: Callable[..., Any] | None = None,
        feedback_cb_args: Iterable[Any] = (),
        feedback_cb_kwargs: Mapping[str, Any] | None = None,
    ) -> None:
        keys = tuple(input_keys), tuple(output_keys)
        super().__init__(['succeeded', 'aborted', 'preempted', *outcomes], *keys)
        self._goal = Outgoing(
            'goal',
            action_spec.Goal,
            goal,
            goal_key,
            tuple(goal_slots),
            UserCallback('goal_cb', goal_cb, goal_cb_args, goal_cb_kwargs, *keys),
        )
        self._result = Incoming(
            'result',
            action_spec.Result,
            result_key,
            tuple(result_slots),
            UserCallback('result_cb', result_cb, result_cb_args, result_cb_kwargs, *keys),
        )
        self._feedback = UserCallback(
            'feedback_cb', feedback_cb, feedback_cb_args, feedback_cb_kwargs, *keys
        )
        self._goal.declare(self)
        self._result.declare(self)
        self._feedback.declare(self)
        self._exec_timeout = seconds(exec_timeout)
        self._server_wait_timeout = seconds(server_wait_timeout) or 0.0
        self._caller = GoalCaller(
            node, action_spec, action_name, cancel_timeout=seconds(preempt_timeout) or 0.0
        )
        self._pulse = ExecutorPulse(node, max(1.0, self._server_wait_timeout))

    def execute(self, ud: Any) -> str:
        """Run the action."""
        if self.preempt_requested():
            self.service_preempt()
            return 'preempted'
        try:
            goal = self._goal.make(ud)
            with self._pulse.watched(self.interrupt) as interrupt:
                end = self._caller.run(
                    goal,
                    accept_timeout=self._server_wait_timeout,
                    result_timeout=self._exec_timeout,
                    interrupt=interrupt,
                    on_feedback=self._on_feedback(ud),
                )
            if end.status == 'rejected':
                fsm.logerr(f"Action '{self._caller.name}': the server rejected the goal")
                return 'aborted'
            outcome = self._result.take(ud, self, _STATUS[end.status], end.result)
        except CallInterruptedError:
            if not self.preempt_requested():
                fsm.logerr(f"Action '{self._caller.name}': the node's executor does not spin")
                return 'aborted'
            self.service_preempt()
            return 'preempted'
        except (CallError, ExchangeError) as error:
            fsm.logerr(f"Action '{self._caller.name}': {error}")
            return 'aborted'
        if self.preempt_requested():
            # It ended in the same moment; the preempt is served by that, whatever the status.
            self.service_preempt()
            return outcome or ('succeeded' if end.status == 'succeeded' else 'preempted')
        return outcome or ('succeeded' if end.status == 'succeeded' else 'aborted')

    def _on_feedback(self, ud: Any) -> Callable[[Any], None] | None:
        if self._feedback.function is None:
            return None

        def told(message: Any) -> None:
            try:
                self._feedback.call(ud, message)
            except ExchangeError as error:
                fsm.logerr(f"Action '{self._caller.name}': {error}")

        return told
