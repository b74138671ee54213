"""The node `reasoner` is no OWL reasoner: it answers `reason` with the place to go to next.

The name is that of the assignment; the node runs in the behaviour `patrol`. Reasoning about the
ontology is `armor_server`'s.

It takes one snapshot of the ontology, and decides by the same function as the behaviour
`surveillance`: charging first, then an operator's request, then the rules and the policy. The
decision is published with its reason. It also offers `why_not` and `go_to`. A setting of decisions
that is changed in `robot_behavior` is changed here, too.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import ParameterEvent
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.parameter import Parameter
from rclpy.task import Future

from patrol_policy.decision import DecisionSettings, NowhereToGoError
from state_machines.exceptions import CallError, CallInterruptedError
from state_machines.ros import ClockWait
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.ros_adapters.decision_services import (
    MemorySettings,
    decision_maker_of,
    offer_decision_services,
)
from surveillance_behaviour.ros_adapters.peers import (
    Deadlines,
    RosPlaces,
    hear_battery,
    ros_ontology,
)
from surveillance_interfaces.msg import MissionStatus
from surveillance_interfaces.srv import Reason
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.run_parameters import BEHAVIOUR_NODE
from surveillance_runtime.state_topics import StateSubscription


class Reasoner(PatrolNode):
    """Decides on request where the robot goes."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('reasoner', **node_options)
        settings = self.declare_live(
            DecisionSettings(exploration_seconds=0.0), without=('exploration_seconds',)
        )
        deadlines = self.declare_fields(
            Deadlines(), prefix='deadline.', without=('plan', 'move', 'charge')
        )
        battery = BatteryMonitor()
        self._wait = ClockWait(self)
        self.decision_maker = decision_maker_of(
            self,
            settings,
            self.declare_fields(MemorySettings()),
            ros_ontology(self, deadlines),
            RosPlaces(self, deadlines),
            battery,
            self._wait.elapsed,
        )
        self._avoided: frozenset[str] = frozenset()
        self._place = ''
        self._next: Future | None = None
        self._sharing = threading.Lock()
        hear_battery(self, battery)
        StateSubscription(
            self,
            MissionStatus,
            'mission_status',
            self._on_status,
            stamp=lambda told: seconds_of(told.stamp),
            owner=BEHAVIOUR_NODE,
        )
        self._owner = f'{self.get_namespace().rstrip("/")}/{BEHAVIOUR_NODE}'
        self.create_subscription(ParameterEvent, '/parameter_events', self._on_parameters, 1000)
        self.create_service(
            Reason, 'reason', self._on_reason, callback_group=ReentrantCallbackGroup()
        )
        self._work = offer_decision_services(
            self, self.decision_maker, self._wait.now, lambda: self._avoided
        )

    def _on_status(self, status: MissionStatus) -> None:
        self._avoided = frozenset(status.avoided)
        if status.waiting_for_help or 'Recover' in status.state:
            self.decision_maker.disturbed()
        if status.place and status.place != self._place:
            before, self._place = self._place, status.place
            # Where the robot was last when this node began, it may have left.
            if before:
                self.decision_maker.arrived(status.place, seconds_of(status.stamp))

    def _on_parameters(self, event: ParameterEvent) -> None:
        """Take over what is set in the node that owns the settings of decisions."""
        if event.node == self._owner:
            changed = [each for each in event.changed_parameters if each.name in self.declared]
            # In one step, as there: alone, one of two levels may be refused.
            taken = self.set_parameters_atomically([*map(Parameter.from_parameter_msg, changed)])
            if not taken.successful:
                self.get_logger().warn(f'not taken over from {BEHAVIOUR_NODE}: {taken.reason}')

    async def _on_reason(self, _request: Any, response: Any) -> Any:
        # Who asks before a choice is begun shares it: one client that gave up and asks again must
        # not have to wait until all that it asked before has been chosen.
        with self._sharing:
            if self._next is None:
                self._next = self._work.run(self._choose)
            shared = self._next
        response.point = await shared
        return response

    def _choose(self) -> str:
        """Return the next place; empty when there is none, and the log says why."""
        with self._sharing:
            # The lock is held until the request that began this choice has noted it as the next.
            self._next = None
        try:
            return self.decision_maker.decide(self._wait.now(), self.stopping, self._avoided).place
        except CallInterruptedError:  # the node ends
            return ''
        except (CallError, NowhereToGoError) as error:
            self.get_logger().warn(f'no place to name: {error}')
            return ''


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(Reasoner, args)
