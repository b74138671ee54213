"""The node `reasoner`: answers `reason` with the place to visit next.

It asks the ontology where the robot is, what it can reach and what is URGENT, and chooses by the
same rules and policies as the surveillance machine. The decision is published with its reason.
"""

from __future__ import annotations

import random
import threading
from collections.abc import Sequence
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future

from surveillance_behaviour import behaviour_parameters
from surveillance_behaviour.peers.announcing import DecisionTopic
from surveillance_behaviour.peers.ports import InterruptedWaitError, PeerError
from surveillance_behaviour.peers.ros_ports import RosPlaces, ros_knowledge
from surveillance_behaviour.policy.chooser import Chooser
from surveillance_behaviour.policy.rules import NowhereToGoError
from surveillance_fsm import Interrupt
from surveillance_interfaces.msg import MissionStatus
from surveillance_interfaces.srv import Reason
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.waiting import AwaitedWork, ClockWait


class Reasoner(PatrolNode):
    """Chooses the next place on request."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('reasoner', **node_options)
        settings = behaviour_parameters.choice_settings(self)
        deadlines = behaviour_parameters.deadlines(self, ('answer', 'build'))
        seed = behaviour_parameters.random_seed(self)
        self._chooser = Chooser(
            settings,
            ros_knowledge(self, deadlines),
            RosPlaces(self, deadlines),
            random.Random(seed if seed >= 0 else None),
        )
        self._wait = ClockWait(self)
        self._decisions = DecisionTopic(self)
        self._avoided: frozenset[str] = frozenset()
        self._work = AwaitedWork(self, 1)
        self._next: Future | None = None
        self._sharing = threading.Lock()
        self._interrupt = Interrupt()
        self.stopping.subscribe(self._interrupt.set)
        self.create_subscription(MissionStatus, 'mission_status', self._on_status, STATE_QOS)
        self.create_service(
            Reason, 'reason', self._on_reason, callback_group=ReentrantCallbackGroup()
        )

    def _on_status(self, status: MissionStatus) -> None:
        self._avoided = frozenset(status.avoided)

    async def _on_reason(self, _request: Any, response: Any) -> Any:
        # Who asks before a choice is begun shares it: one client that gave up and asks again must
        # not have to wait until all that it asked before has been chosen.
        with self._sharing:
            if self._next is None:
                self._next = self._work.run(self._choose)
            shared = self._next
        response.point = await shared
        return response

    def on_stop(self) -> None:
        """Ends the worker."""
        self._work.stop()

    def _choose(self) -> str:
        """The next place; empty when there is none, and the log says why."""
        with self._sharing:
            # The lock is held until the request that began this choice has noted it as the next.
            self._next = None
        try:
            situation = self._chooser.look(self._wait.now(), self._interrupt, self._avoided)
            decision = self._chooser.choose(situation)
        except (PeerError, NowhereToGoError) as error:
            self.get_logger().warn(f'no place to name: {error}')
            return ''
        except InterruptedWaitError:
            return ''
        self._decisions.publish(decision)
        return decision.place


def main(args: Sequence[str] | None = None) -> int:
    """Runs the node until it is stopped."""
    return run_node(Reasoner, args)
