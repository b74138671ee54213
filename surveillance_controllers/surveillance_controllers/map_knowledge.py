"""What a controller asks of the map and the ontology, and what it writes there.

Every method blocks for at most the peers' deadline, so it belongs on a worker thread.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from surveillance_controllers import conversions
from surveillance_controllers.geometry.polyline import Points
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor.protocol import DirectiveRequest
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    FactSubscription,
    name_in,
    value_in,
)
from surveillance_runtime.calls import CallError, ServiceCaller
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.waiting import Interrupt

ROBOT = 'Robot1'


class KnowledgeError(Exception):
    """Map or ontology do not answer, or not what is needed; the text is one line."""


class MapKnowledge:
    """The map's places and the robot's whereabouts, as map builder and ontology know them.

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

    def find_position(self, place: str, interrupt: Interrupt) -> Points | None:
        """The point of a place that the robot can reach; None when the map has no such place.

        Returns:
            Shape (3,), metres, world frame.

        Raises:
            KnowledgeError: The map does not answer.
        """
        request = RoomPosition.Request(room_name=place)
        with _answered():
            answer = self._positions.call(request, self._timeout, interrupt)
        if not answer.valid:
            return None
        point: Points = conversions.array_from_points([answer.position])[0]
        return point

    def position(self, place: str, interrupt: Interrupt) -> Points:
        """The point of a place that the robot can reach, shape (3,), metres, world frame.

        Raises:
            KnowledgeError: The map has no such place, or does not answer.
        """
        point = self.find_position(place, interrupt)
        if point is None:
            raise KnowledgeError(f'the map has no place {place!r}')
        return point

    def places(self, interrupt: Interrupt) -> dict[str, Points]:
        """Every place with its point.

        Raises:
            KnowledgeError: Map or ontology do not answer.
        """
        with _answered():
            names = self._client(interrupt).query.ind_b2_class('LOCATION')
        return {name: self.position(name, interrupt) for name in sorted(names)}

    def connect(self, interrupt: Interrupt) -> None:
        """Waits until the map is built, so that the ontology can be asked.

        Raises:
            KnowledgeError: It is not built within the deadline.
        """
        with _answered():
            self._client(interrupt)

    @property
    def connected(self) -> bool:
        """Whether the map has been built, so that the ontology can be asked without a long wait."""
        return self._armor is not None

    def doors(self, interrupt: Interrupt) -> dict[str, set[str]]:
        """The places that each door leads into, as the ontology has them now.

        Raises:
            KnowledgeError: The ontology does not answer.
        """
        with _answered():
            armor = self._client(interrupt)
            places = armor.query.ind_b2_class('LOCATION')
            questions = [armor.request('QUERY OBJECTPROP IND', 'hasDoor', p) for p in places]
            answers = armor.batch(questions).responses
        rooms_of: dict[str, set[str]] = {}
        for place, answer in zip(places, answers, strict=True):
            for door in answer.queried_objects:
                rooms_of.setdefault(name_in(door), set()).add(place)
        return rooms_of

    def watch(
        self, pattern: str, interrupt: Interrupt, on_change: Callable[[], None] = lambda: None
    ) -> FactSubscription:
        """Keeps the facts that match a pattern, such as `hasDoor(?, ?)`, as long as the node lives.

        Args:
            pattern: Which facts.
            interrupt: Ends the wait for the map.
            on_change: Called in the executor's thread with each fact that comes or goes.

        Raises:
            KnowledgeError: The map is not built yet.
        """
        with _answered():
            armor = self._client(interrupt)
        return FactSubscription(self._node, armor, pattern, lambda _fact, _came: on_change())

    def robot_place(self, interrupt: Interrupt) -> str:
        """The place in which the ontology has the robot.

        Raises:
            KnowledgeError: It has the robot in no place, or in several, or does not answer.
        """
        with _answered():
            found = self._client(interrupt).query.objectprop_b2_ind('isIn', ROBOT)
        if len(found) != 1:
            what = f'several places: {", ".join(sorted(found))}' if found else 'no place'
            raise KnowledgeError(f'the ontology has {ROBOT} in {what}')
        return str(found[0])

    def record_place(self, place: str, before: Iterable[str], interrupt: Interrupt) -> None:
        """Writes that the robot is in a place (isIn), in one exchange with the ontology.

        Args:
            place: The place.
            before: Where the ontology has it so far.
            interrupt: Ends the wait for the ontology.

        Raises:
            KnowledgeError: The ontology does not answer.
        """
        with _answered():
            armor = self._client(interrupt)
            _carry_out(armor, _moved(armor, before, place))

    def record_visit(self, place: str, now: float, interrupt: Interrupt) -> None:
        """Writes that the robot is in a place now: isIn, now, and the place's visitedAt.

        Args:
            place: The place.
            now: ROS time, seconds; the ontology keeps whole ones.
            interrupt: Ends the wait for the ontology.

        Raises:
            KnowledgeError: The ontology does not answer.
        """
        seconds = str(int(now))
        with _answered():
            armor = self._client(interrupt)
            changes = _moved(armor, armor.query.objectprop_b2_ind('isIn', ROBOT), place)
            for name, owner in (('now', ROBOT), ('visitedAt', place)):
                for old in armor.query.dataprop_b2_ind(name, owner):
                    old_value = str(value_in(old))
                    changes.append(
                        armor.request('REMOVE DATAPROP IND', name, owner, 'LONG', old_value)
                    )
                changes.append(armor.request('ADD DATAPROP IND', name, owner, 'LONG', seconds))
            _carry_out(armor, changes)

    def _client(self, interrupt: Interrupt) -> ArmorClient:
        if self._armor is None:
            answer = self._names.call(ReferenceName.Request(), self._timeout, interrupt)
            self._armor = ArmorClient(
                self._node,
                self._node.get_name(),
                answer.name,
                timeout=self._timeout,
                interrupt=self._node.stopping,
            )
        return self._armor


def _moved(armor: ArmorClient, before: Iterable[str], place: str) -> list[DirectiveRequest]:
    leave = [
        armor.request('REMOVE OBJECTPROP IND', 'isIn', ROBOT, old) for old in before if old != place
    ]
    return [*leave, armor.request('ADD OBJECTPROP IND', 'isIn', ROBOT, place)]


def _carry_out(armor: ArmorClient, changes: list[DirectiveRequest]) -> None:
    """Makes the changes as one, with no other client's in between, and lets the reasoner see
    them."""
    for response in armor.batch([*changes, armor.request('REASON')]).responses:
        if not response.success:
            raise KnowledgeError(f'the ontology refuses: {response.error_description}')


@contextmanager
def _answered() -> Iterator[None]:
    try:
        yield
    except (CallError, ArmorServiceCallError, ArmorServiceInternalError) as error:
        raise KnowledgeError(str(error)) from error
