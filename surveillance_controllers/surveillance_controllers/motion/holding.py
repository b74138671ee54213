"""Whether the robot is to stand where it is: a person has stopped it, or its mission is paused."""

from __future__ import annotations

from collections.abc import Callable

from std_msgs.msg import Bool

from state_machines import Interrupt
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription

STOPPED = 'stopped'
"""Topic of `collision_monitor`: a person has stopped the robot."""
PAUSED = 'paused'
"""Topic of `robot_behavior`: its state machine is paused."""


class Hold:
    """Follows the topics `stopped` and `paused`.

    Args:
        node: The node that moves the robot.
        on_change: Called in the executor's thread when the robot is to stand, or may move again.

    Attributes:
        begun: Raised while the robot is to stand.
        ended: Raised while it may move.
    """

    def __init__(self, node: PatrolNode, on_change: Callable[[], None] = lambda: None) -> None:
        self._on_change = on_change
        self._reasons: set[str] = set()
        self.begun, self.ended = Interrupt(), Interrupt()
        self.ended.set()
        for topic, owner in ((STOPPED, 'collision_monitor'), (PAUSED, 'robot_behavior')):
            # Where the owner does not run, nobody else may have the robot stand for ever.
            StateSubscription(node, Bool, topic, self._follower(topic), owner=owner, only=True)

    def _follower(self, topic: str) -> Callable[[Bool], None]:
        def follow(message: Bool) -> None:
            before = self.active
            (self._reasons.add if message.data else self._reasons.discard)(topic)
            if self.active == before:
                return
            raised, cleared = (self.begun, self.ended) if self.active else (self.ended, self.begun)
            cleared.clear()
            raised.set()
            self._on_change()

        return follow

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
