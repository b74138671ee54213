"""The map's places and doors as map builder and ontology have them, followed without asking twice.

Every method may block for the peers' deadline, so it belongs on a worker thread.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from lidar_navigation.geometry import Points
from state_machines import Interrupt
from state_machines.ros import CallError, ServiceCaller
from surveillance_controllers import conversions
from surveillance_interfaces.msg import RobotPlace
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    FactSubscription,
    declared_robot_name,
)
from surveillance_ontology.patrol_vocabulary import DOORS, OntologyNotReadyError
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_topics import StateSubscription

RETRY_PERIOD = 0.1
"""Pause before the ontology is asked again where the robot is, seconds."""
CATCH_UP_PERIOD = 0.3
"""Pause before map and ontology are asked again after they did not answer, seconds."""


class MapKnowledge:
    """The places and doors of the map; the ontology's changes are followed, not asked for.

    Args:
        node: The node that asks.
        timeout: Deadline of each question, seconds of steady time.
    """

    def __init__(self, node: PatrolNode, timeout: float) -> None:
        self._node = node
        self._timeout = timeout
        self._robot = declared_robot_name(node)
        self._positions = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        # Not `reference_name`: that answers when somebody, perhaps this node, has told the place.
        self._names = ServiceCaller(node, ReferenceName, 'ontology_map/built')
        self._connecting = threading.Lock()
        self._changed = threading.Condition()
        self._armor: ArmorClient | None = None
        self._ontology: RobotOntology | None = None
        self._doors: FactSubscription | None = None
        self._on_doors: list[Callable[[], None]] = []
        self._known: dict[str, Points] = {}
        self._robot_place = ''
        StateSubscription(
            node,
            RobotPlace,
            'robot_place',
            self._on_robot_place,
            stamp=lambda told: seconds_of(told.header.stamp),
            owner='motion_controller',
        )

    def assume(self, positions: Mapping[str, Points]) -> None:
        """Take points of places, so that the map builder need not be asked for them."""
        self._known.update(positions)

    def replace_known(self, positions: Mapping[str, Points]) -> None:
        """Take the points of all places of a place that was changed."""
        self._known = dict(positions)

    # --- what the map builder knows ---

    def find_position(self, place: str, interrupt: Interrupt) -> Points | None:
        """Return the point of a place that the robot can reach; None when the map has no such
        place.

        Returns:
            Shape (3,), metres, world frame.

        Raises:
            OntologyNotReadyError: The map does not answer.
        """
        request = RoomPosition.Request(room_name=place)
        with answered():
            answer = self._positions.call(request, self._timeout, interrupt)
        if not answer.valid:
            return None
        point: Points = conversions.array_from_points([answer.position])[0]
        return point

    def position(self, place: str, interrupt: Interrupt) -> Points:
        """Return the point of a place that the robot can reach, shape (3,), metres, world frame.

        Raises:
            OntologyNotReadyError: The map has no such place, or does not answer.
        """
        point = self.find_position(place, interrupt)
        if point is None:
            raise OntologyNotReadyError(f'the map has no place {place!r}')
        return point

    # --- what the ontology knows ---

    def connect(self, interrupt: Interrupt) -> RobotOntology:
        """Return the ontology, once the map is built.

        Raises:
            OntologyNotReadyError: It is not built within the deadline.
        """
        with self._connecting, answered():
            if self._ontology is None:
                answer = self._names.call(ReferenceName.Request(), self._timeout, interrupt)
                self._armor = ArmorClient(
                    self._node,
                    self._node.get_name(),
                    answer.name,
                    timeout=self._timeout,
                    interrupt=self._node.stopping,
                )
                self._doors = FactSubscription(
                    self._node, self._armor, DOORS, lambda _fact, _came: self._doors_changed()
                )
                self._ontology = RobotOntology(self._armor, self._robot)
            return self._ontology

    @property
    def connected(self) -> bool:
        """Whether the map has been built, so that the ontology can be asked without a long wait."""
        return self._ontology is not None

    def watch_doors(self, interrupt: Interrupt, on_change: Callable[[], None]) -> None:
        """Call back in the executor's thread with each change that `doors` and `places` then show.

        Args:
            interrupt: Ends the wait for the map.
            on_change: Is called after the change is known here: `doors` has it.

        Raises:
            OntologyNotReadyError: The map is not built yet.
        """
        self.connect(interrupt)
        self._on_doors.append(on_change)

    def follow_places(self, take: Callable[[Mapping[str, Points]], None]) -> None:
        """Have a function take the places, on a thread of its own, now and when they change."""
        stopping, news, watched = self._node.stopping, Interrupt(), False

        def catch_up() -> None:
            nonlocal watched
            if not watched:
                self.watch_doors(stopping, news.set)
                watched = True
            take(self.places(stopping))

        keep_up(self._node, 'map follower', news, catch_up)

    def watch_robot_place(
        self, interrupt: Interrupt, on_change: Callable[[], None]
    ) -> FactSubscription:
        """Keep the ontology's facts of where the robot is as long as the node lives.

        Args:
            interrupt: Ends the wait for the map.
            on_change: Called in the executor's thread with each fact that comes or goes, and when
                the ontology was loaded or dropped.

        Raises:
            OntologyNotReadyError: The map is not built yet.
        """
        pattern = self.connect(interrupt).robot_place_facts
        assert self._armor is not None
        return FactSubscription(
            self._node, self._armor, pattern, lambda _fact, _came: on_change(), on_change
        )

    def doors(self, interrupt: Interrupt) -> dict[str, set[str]]:
        """Return the places that each door leads into, as the ontology has them now.

        Raises:
            OntologyNotReadyError: The ontology does not answer.
        """
        self.connect(interrupt)
        subscription = self._doors
        assert subscription is not None
        deadline = time.monotonic() + self._timeout
        unsubscribe = interrupt.subscribe(self._notify)
        try:
            with self._changed:
                while not (facts := subscription.facts):
                    if interrupt.is_set() or not self._changed.wait(deadline - time.monotonic()):
                        raise OntologyNotReadyError(
                            f'the ontology named no door in {self._timeout:g} s'
                        )
        finally:
            unsubscribe()
        rooms_of: dict[str, set[str]] = {}
        for fact in facts:
            place, door = fact.arguments
            rooms_of.setdefault(door, set()).add(place)
        return rooms_of

    def places(self, interrupt: Interrupt) -> dict[str, Points]:
        """Return every place with its point.

        Raises:
            OntologyNotReadyError: Map or ontology do not answer.
        """
        names = {place for places in self.doors(interrupt).values() for place in places}
        for name in names ^ self._known.keys():
            # The facts may come one by one, so what is missing among them is asked for.
            position = self.find_position(name, interrupt)
            if position is None:
                self._known.pop(name, None)
            else:
                self._known[name] = position
        return dict(self._known)

    def robot_place(self, interrupt: Interrupt) -> str:
        """Return the place that the robot is in, from whoever knows it, or else from the ontology.

        Raises:
            OntologyNotReadyError: Nobody knows within the deadline, or there is no answer.
        """
        deadline = time.monotonic() + self._timeout
        while not self._robot_place:
            with answered():
                found = self.connect(interrupt).robot_places()
            if len(found) == 1:
                return found[0]
            if time.monotonic() >= deadline or interrupt.wait(RETRY_PERIOD):
                what = f'several places: {", ".join(found)}' if found else 'no place'
                raise OntologyNotReadyError(f'the ontology has the robot in {what}')
        return self._robot_place

    def _on_robot_place(self, message: RobotPlace) -> None:
        self._robot_place = message.place

    def _doors_changed(self) -> None:
        self._notify()
        for on_change in tuple(self._on_doors):
            on_change()

    def _notify(self) -> None:
        with self._changed:
            self._changed.notify_all()


@contextmanager
def answered() -> Iterator[None]:
    """Turn what a peer did not answer into a `OntologyNotReadyError`."""
    try:
        yield
    except (CallError, ArmorServiceCallError, ArmorServiceInternalError) as error:
        raise OntologyNotReadyError(str(error)) from error


def keep_up(
    node: PatrolNode,
    name: str,
    news: Interrupt,
    catch_up: Callable[[], float | None],
    retry: float = CATCH_UP_PERIOD,
) -> None:
    """Have a worker thread catch up with what the map's peers say, as long as the node lives.

    Args:
        node: The node.
        name: Of the thread.
        news: To be set when there is news.
        catch_up: Does what is to be done; returns after how many seconds to look again, None: when
            there is news. May raise `OntologyNotReadyError` or `CallError`.
        retry: Pause after such an error, seconds.
    """

    def work() -> None:
        while not node.stopping.is_set():
            news.clear()
            if node.stopping.is_set():
                return
            try:
                wait = catch_up()
            except (OntologyNotReadyError, CallError) as error:
                node.get_logger().debug(f'{name}: {error}')
                node.stopping.wait(retry)
            else:
                news.wait(wait)

    node.stopping.subscribe(news.set)
    node.spawn(work, name=name)
