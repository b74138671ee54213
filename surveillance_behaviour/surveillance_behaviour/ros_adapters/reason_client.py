"""The reasoner of the behaviour `patrol` as seen by its machine: the service `reason`."""

from __future__ import annotations

import threading
import time

from diagnostic_msgs.msg import DiagnosticArray

from patrol_policy.decision import RECHARGE
from patrol_policy.idleness_bounds import IdlenessBound
from patrol_policy.rule_table import ANY
from patrol_policy.situation import Decision
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from state_machines.ros import ServiceCaller
from surveillance_behaviour import conversions
from surveillance_behaviour.charging import BatteryMonitor
from surveillance_behaviour.ports import Ontology, Reasoner
from surveillance_behaviour.ros_adapters.peers import Deadlines
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_interfaces.srv import Reason
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription

DECISION_SECONDS = 1.0
"""How long the message about a decision may come after the answer of `reason`, seconds."""


class ReasonClient(Reasoner):
    """Decides over the service `reason`; the topic `decision` tells by which rule.

    It need not be told what happens: the reasoner hears that on `mission_status`.

    Args:
        node: The node.
        deadlines: Seconds of steady time.
        ontology: Asked once, at the start, what places there are.
        battery: The battery.
    """

    def __init__(
        self, node: PatrolNode, deadlines: Deadlines, ontology: Ontology, battery: BatteryMonitor
    ) -> None:
        self._deadlines = deadlines
        self._ontology = ontology
        self._battery = battery
        self._places: frozenset[str] = frozenset()
        self._told = threading.Condition()
        self._decision: Decision | None = None
        self._idleness_bounds: tuple[IdlenessBound, ...] = ()
        self._reason = ServiceCaller(node, Reason, 'reason')
        StateSubscription(node, DecisionMessage, 'decision', self._on_decision, owner='reasoner')
        StateSubscription(
            node, DiagnosticArray, 'idleness_bounds', self._on_idleness_bounds, owner='reasoner'
        )

    def _on_decision(self, message: DecisionMessage) -> None:
        with self._told:
            self._decision = conversions.decision_from(message)
            self._told.notify_all()

    def _on_idleness_bounds(self, message: DiagnosticArray) -> None:
        self._idleness_bounds, _ = conversions.idleness_bounds_from(message)

    @property
    def idleness_bounds(self) -> tuple[IdlenessBound, ...]:
        """What the reasoner said last of what can be kept."""
        return self._idleness_bounds

    @property
    def places(self) -> frozenset[str]:
        """The places that were there at the start, and those that decisions have named since."""
        return self._places

    def begin(self, now: float, interrupt: Interrupt) -> str:
        """Look at the map for the first time; where the robot is."""
        found = self._ontology.snapshot(now, (), {}, interrupt)
        self._places = frozenset(found.connections)
        return str(found.place)

    def decide(
        self,
        now: float,
        interrupt: Interrupt,
        avoided: frozenset[str],
        *,
        to_charge: bool = False,
    ) -> Decision:
        """Ask the reasoner, which knows from `mission_status` what is avoided."""
        late = time.monotonic() + self._deadlines.answer
        while True:
            decision = self._ask(now, interrupt)
            self._places |= {decision.place, decision.target, *decision.scores} - {''}
            # The reasoner may hear of a low battery a moment after this node.
            if not to_charge or decision.rule in (RECHARGE, ANY) or time.monotonic() > late:
                return decision
            interrupt.wait(0.1)
            if interrupt.is_set():
                raise CallInterruptedError

    def _ask(self, now: float, interrupt: Interrupt) -> Decision:
        self._decision = None
        answer = self._reason.call(Reason.Request(), self._deadlines.answer, interrupt)
        if not answer.point:
            raise CallError(f'{self._reason.name}: it names no place; its log says why')
        place = str(answer.point)

        def told() -> bool:
            return self._decision is not None and self._decision.place == place

        with self._told:
            if self._told.wait_for(told, DECISION_SECONDS) and self._decision is not None:
                return self._decision
        return Decision(now, '', place, place, ANY, 'reason', 'the service `reason` names it')

    def why_charge(self) -> str:
        """Return that the battery is low; all else is the reasoner's to say."""
        battery = self._battery
        return f'the battery is low ({battery.level_text()})' if battery.low else ''

    def detour(self, start: str, goal: str) -> tuple[str, ...]:
        """Return nothing: the planner of `motion/planner` goes round by itself."""
        return ()
