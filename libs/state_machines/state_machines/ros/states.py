"""States that call ROS 2 services and actions, watch topics and ask questions.

None of them blocks an executor and none can hang: each ends in one of its outcomes within its time
limits. The node's executor must spin in another thread than the machine's.
"""

from __future__ import annotations

import copy
import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

import state_machines as fsm
from state_machines.exceptions import CallError, CallInterruptedError, describe
from state_machines.ros.calls import GoalCaller, ServiceCaller
from state_machines.ros.waiting import ClockWait, seconds


class RosState(fsm.State):
    """Base of states that have a node.

    Attributes:
        node: The node.

    Args:
        node: The node.
        outcomes: See `State`.
        input_keys: See `State`.
        output_keys: See `State`.
        io_keys: See `State`.
    """

    def __init__(
        self,
        node: Node,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        self.node = node

    def _take_condition(self, cond_cb: Any) -> None:
        """Check a condition, and take over the userdata keys that it declares.

        Raises:
            InvalidStateError: It cannot be called.
        """
        if not callable(cond_cb):
            raise fsm.InvalidStateError(f'cond_cb {cond_cb!r} cannot be called')
        self.fsm_take_over(cond_cb, outcomes=False)

    def _preempted(self) -> str:
        """Serve the preempt; return the outcome for that."""
        self.service_preempt()
        return 'preempted'


# Messages made of userdata and the other way round.


class UserCallback:
    """A user's callback; one without a `cb_interface` sees all that its state declares.

    Args:
        state: The state that it belongs to; what the callback declares is added to it.
        name: The argument it was given as, for errors.
        function: The callback; None for none.
        args: Further positional arguments.
        kwargs: Further keyword arguments.

    Raises:
        InvalidStateError: It cannot be called.
    """

    def __init__(
        self,
        state: fsm.State,
        name: str,
        function: Any,
        args: Iterable[Any],
        kwargs: Mapping[str, Any] | None,
    ) -> None:
        if function is not None and not callable(function):
            raise fsm.InvalidStateError(f'{name} {function!r} cannot be called')
        self.name = name
        self.function = function
        self._args = tuple(args)
        self._kwargs = dict(kwargs or {})
        self._declares = state.fsm_take_over(function)

    def call(self, ud: Any, *message: Any) -> Any:
        """Call it with its view of userdata.

        Raises:
            InvalidUserCodeError: It raised something.
        """
        function = self.function
        if self._declares:
            ud = fsm.Remapper(
                ud, function.get_registered_input_keys(), function.get_registered_output_keys()
            )
        try:
            return function(ud, *message, *self._args, **self._kwargs)
        except Exception as error:
            raise fsm.InvalidUserCodeError(f'{self.name} raised {describe(error)}') from error


class Outgoing:
    """How a goal or a request is made.

    Args:
        state: The state that sends it; it declares the userdata keys.
        kind: ``goal`` or ``request``, for errors.
        message_type: The message's class.
        message: The message to begin with; an empty one by default.
        key: Userdata key that holds the whole message.
        slots: Fields that are taken from userdata keys of the same names.
        callback: Given the userdata and the message; returns the message to send, or None when it
            changed the one it was given.

    Raises:
        InvalidStateError: The message is of another type, or a field does not exist.
    """

    def __init__(
        self,
        state: fsm.State,
        kind: str,
        message_type: Any,
        message: Any,
        key: str | None,
        slots: Iterable[str],
        callback: UserCallback,
    ) -> None:
        if message is not None and not isinstance(message, message_type):
            raise fsm.InvalidStateError(
                f'{kind} is a {type(message).__name__}, expected {message_type.__name__}'
            )
        self.kind, self.message_type, self.message = kind, message_type, message
        self.key, self.callback = key, callback
        self.slots = checked_slots(f'{kind}_slots', slots, message_type)
        state.register_input_keys(self.slots if key is None else (key, *self.slots))

    def make(self, ud: Any) -> Any:
        """Make the message to send.

        Raises:
            InvalidUserCodeError: Userdata lacks something, or holds the wrong thing.
        """
        # A copy: the caller's message is used again by the next execution.
        message = copy.deepcopy(self.message) if self.message is not None else self.message_type()
        # Messages check their fields' types on request only, and there is no public way to ask
        # for it after construction.
        message._check_fields = True
        try:
            if self.key is not None:
                message = ud[self.key]
            for slot in self.slots:
                setattr(message, slot, ud[slot])
        except (fsm.SmachError, AssertionError, AttributeError, TypeError) as error:
            raise fsm.InvalidUserCodeError(f'no {self.kind}: {describe(error)}') from error
        if self.callback.function is not None:
            made = self.callback.call(ud, message)
            message = message if made is None else made
        if not isinstance(message, self.message_type):
            raise fsm.InvalidUserCodeError(
                f'the {self.kind} is a {type(message).__name__}, expected '
                f'{self.message_type.__name__}'
            )
        return message


class Incoming:
    """What becomes of a result or a response.

    Args:
        state: The state that receives it; it declares the userdata keys.
        kind: ``result`` or ``response``, for errors.
        message_type: The message's class.
        key: Userdata key that takes the whole message.
        slots: Fields that go to userdata keys of the same names.
        callback: Given the userdata and the message; may return an outcome.

    Raises:
        InvalidStateError: A field does not exist.
    """

    def __init__(
        self,
        state: fsm.State,
        kind: str,
        message_type: Any,
        key: str | None,
        slots: Iterable[str],
        callback: UserCallback,
    ) -> None:
        self.state, self.key, self.callback = state, key, callback
        self.slots = checked_slots(f'{kind}_slots', slots, message_type)
        state.register_output_keys(self.slots if key is None else (key, *self.slots))

    def take(self, ud: Any, *message: Any) -> str | None:
        """Put a message, the last of `message`, into userdata; the callback's outcome, if any.

        Raises:
            InvalidUserCodeError: The callback raised, or returned an outcome that is not declared.
        """
        outcome = None
        if self.callback.function is not None:
            outcome = self.callback.call(ud, *message)
            outcomes = self.state.get_registered_outcomes()
            if outcome is not None and outcome not in outcomes:
                raise fsm.InvalidUserCodeError(
                    f'{self.callback.name} returned outcome {outcome!r}: the outcomes are '
                    f'{sorted(outcomes)}'
                )
        if self.key is not None:
            ud[self.key] = message[-1]
        for slot in self.slots:
            ud[slot] = getattr(message[-1], slot)
        return outcome


def checked_slots(name: str, slots: Iterable[str], message_type: Any) -> tuple[str, ...]:
    """Return names of fields, all of which exist.

    Raises:
        InvalidStateError: One does not.
    """
    slots, fields = tuple(slots), message_type.get_fields_and_field_types()
    for slot in slots:
        if slot not in fields:
            raise fsm.InvalidStateError(
                f"{name}: {message_type.__name__} has no field '{slot}', only {sorted(fields)}"
            )
    return slots


# The states.


class ServiceState(RosState):
    """Calls a service and ends with ``succeeded``, ``aborted`` or ``preempted``.

    However the server behaves, the state ends within `timeout`; a preempt ends it at once.

    Args:
        node: The node that calls; an executor must spin it in another thread.
        service_name: The service's name.
        service_spec: The service's type.
        request: The request; an empty one by default. It is copied, never changed.
        request_cb: ``(userdata, request, *args, **kwargs)``; returns the request, or None.
        request_cb_args: See `request_cb`.
        request_cb_kwargs: See `request_cb`.
        request_key: Userdata key that holds the request.
        request_slots: Fields of the request that are userdata keys.
        response_cb: ``(userdata, response, *args, **kwargs)``; may return an outcome.
        response_cb_args: See `response_cb`.
        response_cb_kwargs: See `response_cb`.
        response_key: Userdata key that takes the response.
        response_slots: Fields of the response that become userdata keys.
        input_keys: Userdata that callbacks without a `cb_interface` read.
        output_keys: Userdata that callbacks without a `cb_interface` write.
        outcomes: Outcomes that `response_cb` may return.
        timeout: Seconds (steady time, or an rclpy ``Duration``) for finding the server and for its
            answer together.

    Raises:
        InvalidStateError: A field or a callback is wrong.
    """

    def __init__(
        self,
        node: Node,
        service_name: str,
        service_spec: Any,
        request: Any = None,
        request_cb: Callable[..., Any] | None = None,
        request_cb_args: Iterable[Any] = (),
        request_cb_kwargs: Mapping[str, Any] | None = None,
        request_key: str | None = None,
        request_slots: Iterable[str] = (),
        response_cb: Callable[..., Any] | None = None,
        response_cb_args: Iterable[Any] = (),
        response_cb_kwargs: Mapping[str, Any] | None = None,
        response_key: str | None = None,
        response_slots: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcomes: Iterable[str] = (),
        *,
        timeout: Any = 60.0,
    ) -> None:
        outcomes = ['succeeded', 'aborted', 'preempted', *outcomes]
        super().__init__(node, outcomes, input_keys, output_keys)
        made_by = UserCallback(self, 'request_cb', request_cb, request_cb_args, request_cb_kwargs)
        self._request = Outgoing(
            self, 'request', service_spec.Request, request, request_key, request_slots, made_by
        )
        taken_by = UserCallback(
            self, 'response_cb', response_cb, response_cb_args, response_cb_kwargs
        )
        self._response = Incoming(
            self, 'response', service_spec.Response, response_key, response_slots, taken_by
        )
        self._timeout = seconds(timeout) or 0.0
        self._caller = ServiceCaller(node, service_spec, service_name)

    def execute(self, ud: Any) -> str:
        """Call the service."""
        if self.preempt_requested():
            return self._preempted()
        try:
            request = self._request.make(ud)
            response = self._caller.call(request, self._timeout, self.interrupt)
            return self._response.take(ud, response) or 'succeeded'
        except CallInterruptedError:
            return self._preempted()
        except (CallError, fsm.InvalidUserCodeError) as error:
            fsm.logerr(f"Service '{self._caller.name}': {error}")
            return 'aborted'


class SimpleActionState(RosState):
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
        outcomes = ['succeeded', 'aborted', 'preempted', *outcomes]
        super().__init__(node, outcomes, input_keys, output_keys)
        made_by = UserCallback(self, 'goal_cb', goal_cb, goal_cb_args, goal_cb_kwargs)
        self._goal = Outgoing(self, 'goal', action_spec.Goal, goal, goal_key, goal_slots, made_by)
        taken_by = UserCallback(self, 'result_cb', result_cb, result_cb_args, result_cb_kwargs)
        self._result = Incoming(
            self, 'result', action_spec.Result, result_key, result_slots, taken_by
        )
        self._feedback = UserCallback(
            self, 'feedback_cb', feedback_cb, feedback_cb_args, feedback_cb_kwargs
        )
        self._exec_timeout = seconds(exec_timeout)
        self._server_wait_timeout = seconds(server_wait_timeout) or 0.0
        self._caller = GoalCaller(
            node,
            action_spec,
            action_name,
            cancel_timeout=seconds(preempt_timeout) or 0.0,
            executor_patience=max(1.0, self._server_wait_timeout),
        )

    def execute(self, ud: Any) -> str:
        """Run the action."""
        if self.preempt_requested():
            return self._preempted()
        try:
            goal = self._goal.make(ud)
            end = self._caller.run(
                goal,
                accept_timeout=self._server_wait_timeout,
                result_timeout=self._exec_timeout,
                interrupt=self.interrupt,
                on_feedback=self._on_feedback(ud),
            )
            if end.status == 'rejected':
                fsm.logerr(f"Action '{self._caller.name}': the server rejected the goal")
                return 'aborted'
            status = getattr(GoalStatus, f'STATUS_{end.status.upper()}')
            outcome = self._result.take(ud, status, end.result)
        except CallInterruptedError:
            return self._preempted()
        except (CallError, fsm.InvalidUserCodeError) as error:
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
            except fsm.InvalidUserCodeError as error:
                fsm.logerr(f"Action '{self._caller.name}': {error}")

        return told


class MonitorState(RosState):
    """Looks at each message of a topic until one is not as it should be.

    It ends with ``invalid`` when `cond_cb` says no, with ``valid`` after `max_checks` messages for
    which it said yes, and with ``preempted``. Watching has no end of its own; give `timeout` where
    silence is a fault.

    Args:
        node: The node that subscribes; an executor must spin it in another thread.
        topic: The topic's name.
        msg_type: The topic's type.
        cond_cb: ``(userdata, message)``; whether the message is as it should be.
        max_checks: Messages to look at; -1 for no limit.
        input_keys: Userdata that `cond_cb` reads.
        output_keys: Userdata that `cond_cb` writes.
        io_keys: Both.
        timeout: Longest silence, seconds of steady time (or an rclpy ``Duration``), after which the
            state ends with ``invalid``.
        qos: The subscription's profile. With transient local durability the last message counts
            also when it came before the state.
    """

    def __init__(
        self,
        node: Node,
        topic: str,
        msg_type: Any,
        cond_cb: Callable[[Any, Any], Any],
        max_checks: int = -1,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
        *,
        timeout: Any = None,
        qos: QoSProfile | int = 10,
    ) -> None:
        super().__init__(node, ['valid', 'invalid', 'preempted'], input_keys, output_keys, io_keys)
        self._take_condition(cond_cb)
        self._topic = topic
        self._cond_cb = cond_cb
        self._max_checks = max_checks
        self._timeout = seconds(timeout)
        self._changed = threading.Condition()
        self._ud: Any = None
        self._checks = 0
        self._verdict: str | None = None
        self._heard = 0.0
        self._latched = (
            isinstance(qos, QoSProfile) and qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        )
        self._last: Any = None
        # Made once: an entity must not be destroyed while an executor spins.
        self._subscription = node.create_subscription(msg_type, topic, self._arrived, qos)

    def execute(self, ud: Any) -> str:
        """Watch."""
        remove = self.interrupt.subscribe(self._wake)
        with self._changed:
            self._ud, self._checks, self._verdict = ud, 0, None
            self._heard = time.monotonic()
            if self._last is not None:
                self._look_at(self._last)
        try:
            with self._changed:
                while self._verdict is None and not self.preempt_requested():
                    left = None
                    if self._timeout is not None:
                        left = self._heard + self._timeout - time.monotonic()
                        if left <= 0.0:
                            fsm.logwarn(f"Topic '{self._topic}': silent for {self._timeout:g} s")
                            self._verdict = 'invalid'
                            break
                    self._changed.wait(left)
                self._ud = None
                verdict = self._verdict
        finally:
            remove()
        if verdict is None or self.preempt_requested():
            return self._preempted()
        return verdict

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _arrived(self, message: Any) -> None:
        with self._changed:
            if self._latched:
                self._last = message
            if self._ud is not None and self._verdict is None:
                self._look_at(message)
                self._changed.notify_all()

    def _look_at(self, message: Any) -> None:
        self._heard = time.monotonic()
        try:
            good = bool(self._cond_cb(self._ud, message))
        except Exception as error:
            fsm.logerr(f"Topic '{self._topic}': cond_cb raised {describe(error)}")
            good = False
        if not good:
            self._verdict = 'invalid'
            return
        self._checks += 1
        if 0 < self._max_checks <= self._checks:
            self._verdict = 'valid'


class ConditionState(RosState):
    """Checks a condition and ends with ``true``, ``false`` or ``preempted``.

    Args:
        node: The node whose clock counts.
        cond_cb: ``(userdata)``; the condition.
        input_keys: Userdata it reads.
        poll_rate: Checks a second of ROS time, hertz.
        timeout: After this time the answer is ``false``: seconds of ROS time, or an rclpy
            ``Duration``.
        max_checks: After so many checks the answer is ``false``; -1 for no limit.

    Raises:
        InvalidStateError: `poll_rate` is not above 0, or there is neither `timeout` nor a limit of
            checks and the callback cannot be called.
    """

    def __init__(
        self,
        node: Node,
        cond_cb: Callable[[Any], Any],
        input_keys: Iterable[str] = (),
        poll_rate: float = 20.0,
        timeout: Any = None,
        max_checks: int = 1,
    ) -> None:
        super().__init__(node, ['true', 'false', 'preempted'], input_keys)
        self._take_condition(cond_cb)
        self._cond_cb = cond_cb
        if not isinstance(poll_rate, int | float) or not 0.0 < poll_rate < math.inf:
            raise fsm.InvalidStateError(f'poll_rate is {poll_rate!r}, expected hertz above 0')
        self._period = 1.0 / poll_rate
        self._timeout = seconds(timeout)
        self._max_checks = max_checks
        self._clock = ClockWait(node)

    def execute(self, ud: Any) -> str:
        """Check until yes, or until it is enough."""
        start = self._clock.elapsed()
        checks = 0
        while not self.preempt_requested():
            try:
                if self._cond_cb(ud):
                    return 'true'
            except Exception as error:
                raise fsm.InvalidUserCodeError(f'cond_cb raised {describe(error)}') from error
            checks += 1
            if 0 <= self._max_checks <= checks:
                return 'false'
            left = self._period
            if self._timeout is not None:
                left = min(left, start + self._timeout - self._clock.elapsed())
                if left <= 0.0:
                    return 'false'
            self._clock.sleep(left, self.interrupt)
        return self._preempted()
