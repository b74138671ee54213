"""Which doors are closed: by their own contacts, and by the ontology.

What the contacts report (topic `door_states`) is told to the map builder, so that a closed door
leaves the ontology and comes back with it. A door that the ontology has on one side only, because
somebody closed it there, is closed for the planner as well.
"""

from __future__ import annotations

from collections.abc import Mapping

from floor_plans.shapes import Segment
from state_machines import Interrupt
from state_machines.ros import ServiceCaller
from surveillance_controllers.map_knowledge import MapKnowledge, keep_up
from surveillance_interfaces.msg import DoorStates
from surveillance_interfaces.srv import SetDoor
from surveillance_ontology.patrol_vocabulary import OntologyNotReadyError
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription

RETRY_PERIOD = 1.0
"""Pause before a peer that did not answer is asked again, seconds."""


class DoorWatch:
    """The doors' states.

    Args:
        node: The node that watches.
        segments: Where the doors are.
        knowledge: Map and ontology.
        timeout: Deadline of each call, seconds of steady time.
    """

    def __init__(
        self,
        node: PatrolNode,
        segments: Mapping[str, Segment],
        knowledge: MapKnowledge,
        timeout: float,
    ) -> None:
        self._node = node
        self._segments = dict(segments)
        self._knowledge = knowledge
        self._timeout = timeout
        self._contacts: frozenset[str] = frozenset()
        self._told: frozenset[str] = frozenset()
        self._sides: dict[str, set[str]] = {}
        self._set_door = ServiceCaller(node, SetDoor, 'ontology_map/set_door')
        self._news = Interrupt()
        keep_up(node, 'door watch', self._news, self._catch_up, RETRY_PERIOD)
        StateSubscription(node, DoorStates, 'door_states', self._on_states, owner='simulator')

    def take_segments(self, segments: Mapping[str, Segment]) -> None:
        """Take where the doors are now: the place was changed."""
        self._segments = dict(segments)

    def rooms_of(self, interrupt: Interrupt) -> dict[str, set[str]]:
        """Return the places that each door leads into; empty while the ontology does not say.

        Blocks for the ontology's answer, so it belongs on a worker thread.
        """
        if not self._knowledge.connected:
            return {}
        try:
            return self._knowledge.doors(interrupt)
        except OntologyNotReadyError as error:
            self._node.get_logger().warn(f'door contacts are not passed on: {error}')
            return {}

    def closed(self, rooms_of: Mapping[str, set[str]]) -> frozenset[str]:
        """Return the doors that are closed, by their contacts or because they join no two places.

        A door whose other room was taken from the map is not closed by that: who is in that room
        must be able to leave it.
        """
        rooms = {room for sides in rooms_of.values() for room in sides}
        for door, sides in rooms_of.items():
            if sides - self._sides.get(door, set()):
                self._sides[door] = self._sides.get(door, set()) | sides
        half = {
            door
            for door in self._segments
            if len(rooms_of.get(door, ())) < 2 and self._sides.get(door, set()) <= rooms
        }
        return self._contacts | half if rooms_of else self._contacts

    def closed_segments(self, interrupt: Interrupt) -> dict[str, Segment]:
        """Return where the closed doors are; blocks as `rooms_of` does."""
        closed = self.closed(self.rooms_of(interrupt))
        return {door: self._segments[door] for door in closed if door in self._segments}

    def _on_states(self, message: DoorStates) -> None:
        self._contacts = frozenset(message.closed)
        self._news.set()

    def _catch_up(self) -> None:
        """Subscribe to the ontology's doors and tell it of the contacts."""
        self._knowledge.connect(self._node.stopping)
        for door in sorted(self._contacts ^ self._told):
            self._tell(door, is_open=door not in self._contacts)

    def _tell(self, door: str, *, is_open: bool) -> None:
        request = SetDoor.Request(door=door, open=is_open)
        answer = self._set_door.call(request, self._timeout, self._node.stopping)
        self._told = self._told - {door} if is_open else self._told | {door}
        if not answer.success:
            self._node.get_logger().warn(f'door {door}: {answer.message}')
