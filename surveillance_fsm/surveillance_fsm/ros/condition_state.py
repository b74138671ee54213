"""A state that asks a question until the answer is yes."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from rclpy.node import Node

import surveillance_fsm as fsm
from surveillance_fsm.container import describe
from surveillance_fsm.ros.exchange import seconds
from surveillance_runtime.waiting import ClockWait


class ConditionState(fsm.State):
    """Checks a condition and ends with ``true``, ``false`` or ``preempted``.

    Args:
        node: The node whose clock counts.
        cond_cb: ``(userdata)``; the condition.
        input_keys: Userdata it reads.
        poll_rate: Time from one check to the next, seconds of ROS time or an rclpy ``Duration``.
        timeout: After this time the answer is ``false``, likewise.
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
        poll_rate: Any = 0.05,
        timeout: Any = None,
        max_checks: int = 1,
    ) -> None:
        super().__init__(['true', 'false', 'preempted'], input_keys)
        declared: Any = cond_cb
        if not callable(cond_cb):
            raise fsm.InvalidStateError(f'cond_cb {cond_cb!r} cannot be called')
        if fsm.has_smach_interface(declared):
            self.register_input_keys(declared.get_registered_input_keys())
            self.register_output_keys(declared.get_registered_output_keys())
        self._cond_cb = cond_cb
        self._period = seconds(poll_rate) or 0.0
        if not self._period > 0.0:
            raise fsm.InvalidStateError(f'poll_rate is {poll_rate!r}, expected seconds above 0')
        self._timeout = seconds(timeout)
        self._max_checks = max_checks
        self._clock = ClockWait(node)

    def execute(self, ud: Any) -> str:
        """Check until yes, or until it is enough."""
        start = self._clock.now()
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
                left = min(left, start + self._timeout - self._clock.now())
                if left <= 0.0:
                    return 'false'
            self._clock.sleep(left, self.interrupt)
        self.service_preempt()
        return 'preempted'
