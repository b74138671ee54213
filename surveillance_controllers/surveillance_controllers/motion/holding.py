"""Whether the robot is to stand where it is: a person has stopped it, or its mission is paused.

A stop has two paths. `collision_monitor` lets no command through to the base; whoever drives the
robot commands nothing. Each hears the wish itself (topic `stop_requested`), so that one of them may
be dead. Who drives repeats the wish until the monitor has taken it, also to a monitor that begins
anew and could keep nothing. Until then it keeps the wish in the file that the monitor reads when it
begins: whoever drives may die before that. A base that was told to drive a moment ago goes on until
its own time-out: it is told to stand, past the monitor.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.publisher import Publisher
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from state_machines import Interrupt
from surveillance_interfaces.msg import StopRequest as StopRequestMessage
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription
from surveillance_runtime.stop_keeper import StopKeeper
from surveillance_runtime.stop_request import TOPIC, StopRequest, own_stop
from surveillance_runtime.topic_names import BASE_COMMAND

STOPPED = 'stopped'
"""Topic of `collision_monitor`: a person has stopped the robot."""
PAUSED = 'paused'
"""Topic of `robot_behavior`: its state machine is paused."""
COMMAND = BASE_COMMAND
"""Topic that the base listens to: of `collision_monitor`, or of nobody while that is dead."""
ALONE_AFTER = 0.1
"""Seconds of real time after which a wish that the monitor has not taken goes to the base itself;
and from one such command to the next."""
_COMMANDS: dict[str, Any] = {
    'geometry_msgs/msg/Twist': Twist,
    'geometry_msgs/msg/TwistStamped': TwistStamped,
}
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
        self._wish = StopRequestMessage()
        self._taken_by: bytes | None = None
        own = own_stop(node.context.get_domain_id(), node.get_namespace(), os.environ)
        self._keeper = StopKeeper(node, own)
        self._kept = False
        self.begun, self.ended = Interrupt(), Interrupt()
        self.ended.set()
        # Where the owner does not run, nobody else may have the robot stand for ever.
        self._monitor = StateSubscription(
            node, Bool, STOPPED, self._on_stopped, owner='collision_monitor', only=True, each=True
        )
        StateSubscription(node, Bool, PAUSED, self._on_paused, owner='robot_behavior', only=True)
        node.create_subscription(StopRequestMessage, TOPIC, self._on_request, 10)
        self._requests = node.create_publisher(StopRequestMessage, TOPIC, 10)
        # While one waits for the disk, everything else is handled.
        aside = ReentrantCallbackGroup()
        node.create_service(SetBool, 'motion/stop', self._on_service, callback_group=aside)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(
            REPEAT, self._repeat, clock=steady, autostart=False, callback_group=aside
        )
        self._node = node
        self._halt_publisher: Publisher | None = None
        self._halt_type: Any = Twist
        self._halting = node.create_timer(ALONE_AFTER, self._halt, clock=steady, autostart=False)

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
                self._begin_alone()

    def _on_paused(self, message: Bool) -> None:
        self._set(PAUSED, message.data)

    def _on_request(self, message: StopRequestMessage) -> None:
        if STOPPED not in self._reasons:
            self._wish = message
            self._set(STOPPED, True)
            self._begin_alone()

    def _begin_alone(self) -> None:
        self._timer.reset()
        self._halting.reset()

    def _halt(self) -> None:
        """Tell the base to stand, in the type that it expects."""
        if STOPPED not in self._reasons or self._taken_by is not None:
            self._halting.cancel()
            return
        if self._halt_publisher is None:
            for base in self._node.get_subscriptions_info_by_topic(COMMAND):
                kind = _COMMANDS.get(base.topic_type)
                if kind is not None:
                    self._halt_type = kind
                    self._halt_publisher = self._node.create_publisher(kind, COMMAND, 1)
                    break
            else:
                return  # no base is there
        command: Any = self._halt_type()
        if self._halt_type is TwistStamped:
            command.header.stamp = self._node.get_clock().now().to_msg()
        self._halt_publisher.publish(command)

    async def _on_service(self, request: Any, response: Any) -> Any:
        if request.data:
            self._on_request(StopRequestMessage(owner='motion/stop'))
            problem = await self._keep()
        else:
            was_kept = self._kept
            self._release()
            problem = await self._keeper.forget() if was_kept else ''
            problem = problem and f'the next start may find it stopped: {problem}'
        response.success = True
        response.message = 'the robot stands' if self.active else 'the robot may move again'
        if problem:
            response.message += f', but {problem}'
        return response

    async def _keep(self) -> str:
        """Keep a wish that the monitor has not taken; return why it is not known to be kept."""
        if self._kept or self._taken_by is not None:
            return ''
        self._kept = True
        return await self._keeper.keep(StopRequest.heard(self._wish.owner, self._wish.reason))

    def _release(self) -> None:
        self._taken_by, self._kept = None, False
        self._set(STOPPED, False)

    async def _repeat(self) -> None:
        if STOPPED in self._reasons and self._taken_by is None:
            self._requests.publish(self._wish)
            await self._keep()
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
