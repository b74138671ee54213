"""Keeps the ontology's isIn right while the robot moves, is pushed, or finds itself again."""

from __future__ import annotations

from surveillance_controllers.map_knowledge import ROBOT, KnowledgeError, MapKnowledge
from surveillance_controllers.motion.robot_base import RobotBase
from surveillance_controllers.motion.robot_parameters import RobotSettings
from surveillance_ontology.armor_client import FactSubscription
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.waiting import Interrupt

RETRY_PERIOD = 0.3
"""Pause before map and ontology are asked again after they did not answer, seconds."""


class PlaceTracking:
    """Writes the robot's place whenever the ontology has another one.

    It also follows the map: places that come or go change what the robot's place can be.

    Args:
        node: The motion controller's node.
        base: Knows where the robot is.
        knowledge: Map and ontology.
        settings: The places at the start, and whether to track at all.
    """

    def __init__(
        self,
        node: PatrolNode,
        base: RobotBase,
        knowledge: MapKnowledge,
        settings: RobotSettings,
    ) -> None:
        self._node = node
        self._base = base
        self._knowledge = knowledge
        self._positions = dict(settings.positions)
        self._where: FactSubscription | None = None
        self._doors: FactSubscription | None = None
        self._news = Interrupt()
        node.stopping.subscribe(self._news.set)
        if settings.track_place:
            node.spawn(self._work, name='place tracking')

    def wake(self) -> None:
        """Has the place looked at again."""
        self._news.set()

    def _work(self) -> None:
        stopping = self._node.stopping
        while not stopping.is_set():
            self._news.clear()
            if stopping.is_set():
                return
            try:
                self._follow_map()
                self._correct()
            except KnowledgeError as error:
                self._node.get_logger().debug(f'where the robot is was not written: {error}')
                stopping.wait(RETRY_PERIOD)
            else:
                self._news.wait()

    def _follow_map(self) -> None:
        stopping = self._node.stopping
        if self._where is None:
            self._where = self._knowledge.watch(f'isIn({ROBOT}, ?)', stopping, self.wake)
            self._doors = self._knowledge.watch('hasDoor(?, ?)', stopping, self.wake)
        assert self._doors is not None
        names = {fact.arguments[0] for fact in self._doors.facts}
        if not names or names == set(self._positions):
            return
        for name in names ^ set(self._positions):
            # The facts may come one by one, so what is missing among them is asked for.
            position = self._knowledge.find_position(name, stopping)
            if position is None:
                self._positions.pop(name, None)
            else:
                self._positions[name] = position
        self._base.set_positions(self._positions)

    def _correct(self) -> None:
        place = self._base.place
        try:
            self._write(place)
        finally:
            self._base.release(place)

    def _write(self, place: str | None) -> None:
        assert self._where is not None
        known = {fact.arguments[1] for fact in self._where.facts}
        if place is None or not known or known == {place}:
            return
        self._knowledge.record_place(place, known, self._node.stopping)
        self._node.get_logger().info(f'the robot is in {place}')
