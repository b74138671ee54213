"""A state machine as an action server, and the server that it stands on.

`GoalServer` is an action server whose goals run on a worker thread, one at a time,
the newest first.

It behaves as ROS 1's SimpleActionServer did: a new goal takes the place of the one that runs. The
executor stays free while a goal runs, so a goal can be cancelled at any moment.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

import state_machines as fsm
from state_machines.clock import Interrupt
from state_machines.exceptions import describe
from state_machines.ros.waiting import (
    ACTION_SERVER_QOS,
    ClockWait,
    own,
    stopping_of,
    work_aside,
)

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
        """Return seconds as they pass in ROS time; only differences have a meaning."""
        return self._wait.elapsed()


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
        node: Node,
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
        own(node, self._server)
        self._stopping = stopping_of(node)
        if self._stopping is not None:
            self._stopping.subscribe(self.stop)

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

    def stop(self) -> None:
        """End the goals that run."""
        with self._lock:
            runs = list(self._runs.values())
        for run in runs:
            run.interrupt.set()

    async def _run(self, handle: Any) -> Any:
        run = self._runs[bytes(handle.goal_id.uuid)]
        if self._stopping is not None and self._stopping.is_set():
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
            # In two lines: rclpy's loggers take one severity for each line of code.
            if run.interrupt.is_set():  # whoever takes a goal back wants it to end
                self._node.get_logger().info(f'{self.name}: {error}')
            else:
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


class ActionServerWrapper:
    """Executes a container for every goal of an action; the newest goal wins.

    The container's input keys are taken from the wrapper's userdata and its output keys put there.

    Args:
        node: The node that serves.
        server_name: The action's name.
        action_spec: The action's type.
        wrapped_container: What to execute.
        succeeded_outcomes: Outcomes that make the goal succeed.
        aborted_outcomes: Outcomes that abort it; so do all that are not named.
        preempted_outcomes: Outcomes after a cancel; without a cancel they abort the goal.
        goal_key: Userdata key for the goal.
        feedback_key: Userdata key of the container that holds the feedback to publish at each
            transition.
        result_key: Userdata key for the result.
        goal_slots_map: From fields of the goal to userdata keys.
        feedback_slots_map: From fields of the feedback to userdata keys of the container.
        result_slots_map: From fields of the result to userdata keys.
        expand_goal_slots: Put every field of the goal under its own name.
        pack_result_slots: Take every field of the result from the key of its name, if set.

    Raises:
        InvalidStateError: An outcome is named twice, or is none of the container's.
    """

    def __init__(
        self,
        node: Node,
        server_name: str,
        action_spec: Any,
        wrapped_container: fsm.Container,
        succeeded_outcomes: Iterable[str] = (),
        aborted_outcomes: Iterable[str] = (),
        preempted_outcomes: Iterable[str] = (),
        goal_key: str = 'action_goal',
        feedback_key: str = 'action_feedback',
        result_key: str = 'action_result',
        goal_slots_map: Mapping[str, str] | None = None,
        feedback_slots_map: Mapping[str, str] | None = None,
        result_slots_map: Mapping[str, str] | None = None,
        expand_goal_slots: bool = False,
        pack_result_slots: bool = False,
    ) -> None:
        self.wrapped_container = wrapped_container
        self.userdata = fsm.UserData()
        self._node = node
        self._server_name = server_name
        self._action_spec = action_spec
        self._succeeded = frozenset(succeeded_outcomes)
        self._preempted = frozenset(preempted_outcomes)
        aborted = frozenset(aborted_outcomes)
        named = [*self._succeeded, *self._preempted, *aborted]
        outcomes = wrapped_container.get_registered_outcomes()
        for outcome in named:
            if named.count(outcome) > 1 or outcome not in outcomes:
                raise fsm.InvalidStateError(
                    f"Action '{server_name}': outcome '{outcome}' must be named once and be one of "
                    f'{sorted(outcomes)}'
                )
        self._goal_key, self._feedback_key, self._result_key = goal_key, feedback_key, result_key
        self._goal_slots = dict(goal_slots_map or {})
        self._feedback_slots = dict(feedback_slots_map or {})
        self._result_slots = dict(result_slots_map or {})
        self._expand_goal_slots = expand_goal_slots
        self._pack_result_slots = pack_result_slots
        self._run: GoalRun | None = None
        wrapped_container.register_transition_cb(
            lambda userdata, _: self.publish_feedback(userdata)
        )
        # As SMACH does: the states inside find the action's own messages.
        given = [goal_key, result_key, feedback_key]
        if expand_goal_slots:
            given += action_spec.Goal.get_fields_and_field_types()
        wrapped_container.register_input_keys(given)
        self._server = GoalServer(node, action_spec, server_name, self._execute)

    def run_server(self) -> None:
        """Do nothing: it serves since it was made, as in ROS 2; SMACH of ROS 1 begins here."""

    def publish_feedback(self, userdata: fsm.UserData) -> None:
        """Publish the feedback that is in `userdata`."""
        run = self._run
        if run is None:
            return
        feedback = self._action_spec.Feedback()
        if self._feedback_key in userdata:
            feedback = userdata[self._feedback_key]
        for slot, key in self._feedback_slots.items():
            if key in userdata:
                setattr(feedback, slot, userdata[key])
        run.feedback(feedback)

    def _execute(self, goal: Any, run: GoalRun) -> Any:
        container, userdata = self.wrapped_container, self.userdata
        spec = self._action_spec
        if self._expand_goal_slots:
            for slot in spec.Goal.get_fields_and_field_types():
                userdata[slot] = getattr(goal, slot)
        userdata[self._goal_key] = goal
        userdata[self._result_key] = spec.Result()
        userdata[self._feedback_key] = spec.Feedback()
        for slot, key in self._goal_slots.items():
            userdata[key] = getattr(goal, slot)
        # What a goal before asked for is not for this one.
        container.recall_preempt()
        self._run = run
        remove = run.interrupt.subscribe(container.request_preempt)
        try:
            outcome = container.execute(userdata)
        except fsm.SmachError as error:
            raise GoalAbortedError(describe(error)) from error
        finally:
            remove()
            self._run = None
            container.recall_preempt()
        result = self._result()
        if outcome in self._succeeded:
            return result
        if outcome in self._preempted and run.interrupt.is_set():
            return result
        raise GoalAbortedError(f"'{container.get_name()}' ended with '{outcome}'", result)

    def _result(self) -> Any:
        result = copy.copy(self.userdata[self._result_key])
        for slot, key in self._result_slots.items():
            setattr(result, slot, self.userdata[key])
        if self._pack_result_slots:
            for slot in self._action_spec.Result.get_fields_and_field_types():
                if slot in self.userdata:
                    setattr(result, slot, self.userdata[slot])
        return result
