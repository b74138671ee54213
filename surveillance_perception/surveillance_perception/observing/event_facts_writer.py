"""Keeps the events of the ontology as the observer has them."""

from __future__ import annotations

from collections.abc import Sequence

from indoor_watch import Event, EventState, Level
from state_machines import Interrupt
from state_machines.ros import CallError, ServiceCaller
from surveillance_interfaces.srv import ReferenceName
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)
from surveillance_ontology.event_facts import EventFact, EventOntology, EventSighting
from surveillance_ontology.patrol_vocabulary import ROBOT
from surveillance_runtime.node import PatrolNode

PERIOD = 10.0
"""Seconds after which it is looked whether the ontology still has the events."""
_GOING_ON = (EventState.OPEN, EventState.ACKNOWLEDGED)


class EventFactsWriter:
    """Writes events into the ontology, on a thread of its own; `tell` may be called from any.

    Args:
        node: The node that asks.
        robot: Whose events they are.
        checked_every: While an alert is open its place is URGENT after so long without a visit, s.
        timeout: How long map builder and ontology may take to answer, s of real time.
    """

    def __init__(self, node: PatrolNode, robot: str, checked_every: int, timeout: float) -> None:
        self._node, self._robot = node, robot
        self._checked_every, self._timeout = checked_every, timeout
        self._facts: list[EventFact] = []
        self._changed = Interrupt()
        node.stopping.subscribe(self._changed.set)
        node.spawn(self._write, 'facts')

    def tell(self, events: Sequence[Event]) -> None:
        """Take all events there are; those that go on are facts."""
        going_on = [each for each in events if each.state in _GOING_ON]
        self._facts = [_fact(each, self._checked_every) for each in going_on]
        self._changed.set()

    def _write(self) -> None:
        """Keep the ontology's events as they are; it may be built anew at any time."""
        node = self._node
        names = ServiceCaller(node, ReferenceName, 'ontology_map/built')
        ontology: EventOntology | None = None
        told: list[EventFact] | None = None
        while not node.stopping.is_set():
            self._changed.wait(PERIOD)
            self._changed.clear()
            facts = self._facts
            if node.stopping.is_set() or facts == told == []:
                continue
            try:
                if ontology is None:
                    name = names.call(ReferenceName.Request(), self._timeout, node.stopping).name
                    armor = ArmorClient(
                        node, node.get_name(), name, timeout=self._timeout, interrupt=node.stopping
                    )
                    ontology = EventOntology(armor, self._robot)
                ontology.tell(facts)
                told = facts
            except (CallError, ArmorServiceCallError, ArmorServiceInternalError) as error:
                if facts and not node.stopping.is_set():
                    node.get_logger().warn(
                        f'events are not in the ontology: {error}', throttle_duration_sec=60.0
                    )


def _fact(event: Event, checked_every: int) -> EventFact:
    """Return an event as the ontology has it."""
    first, last = ''.join(event.evidence[:1]), ''.join(event.evidence[-1:])
    by, at, sure = event.robots or (ROBOT,), event.position, event.confidence
    return EventFact(
        event.number,
        event.kind.capitalize(),
        event.seen,
        event.place,
        event.subject,
        Level(max(1, event.severity)).name.capitalize(),
        event.state.split()[0].capitalize(),
        EventSighting(int(event.began), sure, at, first, by=by[0]),
        EventSighting(int(event.last), sure, at, last, event.compared_with, by[-1]),
        checked_every,
    )
