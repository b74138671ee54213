"""Whether the robot is to stand where it is: a person has stopped it, or its mission is paused.

A stop has two paths. `collision_monitor` lets no command through to the base; whoever drives the
robot commands nothing. Each hears the wish itself (topic `stop_requested`), so that one of them may
be dead. Who drives repeats the wish until the monitor has taken it, also to a monitor that begins
anew and could keep nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock, ClockType
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from state_machines import Interrupt
from surveillance_interfaces.msg import StopRequest
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription
from surveillance_runtime.stop_request import TOPIC

STOPPED = 'stopped'
"""Topic of `collision_monitor`: a person has stopped the robot."""
PAUSED = 'paused'
"""Topic of `robot_behavior`: its state machine is paused."""
REPEAT = 0.5
"""Seconds of real time after which a wish is told again to a monitor that has not taken it."""


class Hold:
    """Follows the topics `stop_requested`, `stopped` and `paused`, in the executor's thread.

    The service `motion/stop` does the same as the topic, and answers: for a robot whose monitor
    does not answer, or that has none.

    Args:
        node: The node that moves the robot.
        on_change: Called when the robot is to stand, or may move again.

    Attributes:
        begun: Raised while the robot is to stand.
        ended: Raised while it may move.
    """

    def __init__(self, node: PatrolNode, on_change: Callable[[], None] = lambda: None) -> None:
        self._on_change = on_change
        self._reasons: set[str] = set()
        self._wish = StopRequest()
        self._taken_by: bytes | None = None
        self.begun, self.ended = Interrupt(), Interrupt()
        self.ended.set()
        # Where the owner does not run, nobody else may have the robot stand for ever.
        self._monitor = StateSubscription(
            node, Bool, STOPPED, self._on_stopped, owner='collision_monitor', only=True, each=True
        )
        StateSubscription(node, Bool, PAUSED, self._on_paused, owner='robot_behavior', only=True)
        node.create_subscription(StopRequest, TOPIC, self._on_request, 10)
        self._requests = node.create_publisher(StopRequest, TOPIC, 10)
        node.create_service(SetBool, 'motion/stop', self._on_service)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(REPEAT, self._repeat, clock=steady, autostart=False)

    def _on_stopped(self, message: Bool) -> None:
        if message.data:
            self._taken_by = self._monitor.publisher
            self._set(STOPPED, True)
        elif self._taken_by == self._monitor.publisher:
            # The monitor that had stopped the robot releases it. One that began anew and knows of
            # no stop has lost it: it is told again.
            self._release()
        else:
            self._taken_by = None
            if STOPPED in self._reasons:
                self._timer.reset()

    def _on_paused(self, message: Bool) -> None:
        self._set(PAUSED, message.data)

    def _on_request(self, message: StopRequest) -> None:
        if STOPPED not in self._reasons:
            self._wish = message
            self._set(STOPPED, True)
            self._timer.reset()

    def _on_service(self, request: Any, response: Any) -> Any:
        if request.data:
            self._on_request(StopRequest(owner='motion/stop'))
        else:
            self._release()
        response.success = True
        response.message = 'the robot stands' if self.active else 'the robot may move again'
        return response

    def _release(self) -> None:
        self._taken_by = None
        self._set(STOPPED, False)

    def _repeat(self) -> None:
        if STOPPED in self._reasons and self._taken_by is None:
            self._requests.publish(self._wish)
        else:
            self._timer.cancel()

    def _set(self, reason: str, holds: bool) -> None:
        before = self.active
        (self._reasons.add if holds else self._reasons.discard)(reason)
        if self.active == before:
            return
        raised, cleared = (self.begun, self.ended) if self.active else (self.ended, self.begun)
        cleared.clear()
        raised.set()
        self._on_change()

    @property
    def active(self) -> bool:
        """Whether the robot is to stand."""
        return bool(self._reasons)

    def await_end(self, interrupt: Interrupt) -> None:
        """Wait until the robot may move, or for the interrupt."""
        either = Interrupt()
        forget = self.ended.subscribe(either.set), interrupt.subscribe(either.set)
        either.wait()
        for each in forget:
            each()
