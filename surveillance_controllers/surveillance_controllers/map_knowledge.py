"""What a controller asks of the map and the ontology, and what it writes there.

Every method blocks for at most the peers' deadline, so it belongs on a worker thread.
"""

from __future__ import annotations

from surveillance_controllers import conversions
from surveillance_controllers.polyline import Points
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_runtime.calls import ServiceCaller
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.waiting import Interrupt

ROBOT = 'Robot1'


class UnknownPlace(LookupError):
    """A place that the map does not have; the text names it."""


class MapKnowledge:
    """The map's places and the robot's whereabouts, as ontology and map builder know them.

    Args:
        node: The node that asks.
        timeout: Deadline of each question, seconds of steady time.
    """

    def __init__(self, node: PatrolNode, timeout: float) -> None:
        self._node = node
        self._timeout = timeout
        self._positions = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        self._names = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
        self._armor: ArmorClient | None = None

    def position(self, place: str, interrupt: Interrupt) -> Points:
        """The point of a place that the robot can reach, shape (3,), metres, world frame.

        Raises:
            UnknownPlace: The map has no such place.
            CallFailed: The map does not answer.
        """
        request = RoomPosition.Request(room_name=place)
        answer = self._positions.call(request, self._timeout, interrupt)
        if not answer.valid:
            raise UnknownPlace(f'the map has no place {place!r}')
        point: Points = conversions.array_from_points([answer.position])[0]
        return point

    def places(self, interrupt: Interrupt) -> dict[str, Points]:
        """Every place with its point.

        Raises:
            CallFailed: Map or ontology do not answer.
        """
        names = self._client(interrupt).query.ind_b2_class('LOCATION')
        return {name: self.position(name, interrupt) for name in sorted(names)}

    def robot_place(self, interrupt: Interrupt) -> str:
        """The place in which the ontology has the robot.

        Raises:
            UnknownPlace: It has the robot in no place, or in several.
            CallFailed: The ontology does not answer.
        """
        found = self._client(interrupt).query.objectprop_b2_ind('isIn', ROBOT)
        if len(found) != 1:
            what = f'several places: {", ".join(sorted(found))}' if found else 'no place'
            raise UnknownPlace(f'the ontology has {ROBOT} in {what}')
        return str(found[0])

    def record_place(self, place: str, interrupt: Interrupt) -> bool:
        """Writes that the robot is in a place (isIn).

        Returns:
            Whether the ontology had it elsewhere before.

        Raises:
            CallFailed: The ontology does not answer.
        """
        armor = self._client(interrupt)
        before = armor.query.objectprop_b2_ind('isIn', ROBOT)
        if before == [place]:
            return False
        for other in before:
            armor.manipulation.remove_objectprop_from_ind('isIn', ROBOT, other)
        armor.manipulation.add_objectprop_to_ind('isIn', ROBOT, place)
        armor.utils.sync_buffered_reasoner()
        return True

    def record_visit(self, place: str, now: float, interrupt: Interrupt) -> None:
        """Writes that the robot is in a place now: isIn, now, and the place's visitedAt.

        Args:
            place: The place.
            now: ROS time, seconds; the ontology keeps whole ones.
            interrupt: Ends the wait for the ontology.

        Raises:
            CallFailed: The ontology does not answer.
        """
        armor = self._client(interrupt)
        seconds = str(int(now))
        self.record_place(place, interrupt)
        for name, owner in (('now', ROBOT), ('visitedAt', place)):
            for old in armor.query.dataprop_b2_ind(name, owner):
                armor.manipulation.remove_dataprop_from_ind(name, owner, 'LONG', _lexical(old))
            armor.manipulation.add_dataprop_to_ind(name, owner, 'LONG', seconds)
        armor.utils.sync_buffered_reasoner()

    def _client(self, interrupt: Interrupt) -> ArmorClient:
        from surveillance_ontology.armor_client import ArmorClient

        if self._armor is None:
            answer = self._names.call(ReferenceName.Request(), self._timeout, interrupt)
            self._armor = ArmorClient(self._node, self._node.get_name(), answer.name)
        return self._armor


def _lexical(literal: str) -> str:
    """The value of a literal as ARMOR renders it: `"15"^^xsd:long` gives `15`."""
    return literal.split('"')[1] if '"' in literal else literal
