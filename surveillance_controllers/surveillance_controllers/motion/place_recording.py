"""The place that the robot is in, as `motion_controller` tells it: a topic at once, and the
ontology's isIn as soon as that can be written."""

from __future__ import annotations

import threading
import time

from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from lidar_navigation.geometry import Points
from state_machines import Interrupt
from surveillance_controllers.map_knowledge import MapKnowledge, answered, keep_up
from surveillance_controllers.motion.arrival import nearest_place
from surveillance_interfaces.msg import OntologyMap, RobotPlace
from surveillance_ontology.armor_client import FactSubscription
from surveillance_runtime.conversions import nanoseconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.state_file import StateFile
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

CHANGES_DELAY = 0.5
"""How long the ontology's change messages may be behind what was written, seconds."""


class PlaceRecorder:
    """Publishes `robot_place`, and is the only writer of the robot's place in the ontology.

    `robot_place_written` says up to which stamp the ontology has it.

    `tell` waits for nobody. A worker writes; what cannot be written yet is tried again, and an
    ontology that has another place (it came back, was built anew, or somebody else wrote) is told
    again. While the place is not known, the ontology keeps the last one that was.

    Args:
        node: The motion controller's node.
        knowledge: Map and ontology.
        reach: How near to a place's point the robot is in that place, for `tell_point`, metres.
        start: The place the robot starts in, while neither `tell` nor the ontology says; empty:
            the one of `ontology_map/build_map`. None where the robot localises itself.
        state_file: Keeps the place over a restart, for a robot that does not localise itself.
    """

    def __init__(
        self,
        node: PatrolNode,
        knowledge: MapKnowledge,
        reach: float,
        start: str | None,
        state_file: str = '',
    ) -> None:
        self._node = node
        self._knowledge = knowledge
        self._reach = reach
        self._kept = StateFile(node, state_file if start is not None else '')
        self._start = start if start is None else self._kept.text('place') or start
        self._lock = threading.Lock()
        self._point: tuple[Points, Time] | None = None
        self._told: RobotPlace | None = None
        self._written: RobotPlace | None = None
        self._written_at = 0.0
        self._facts: FactSubscription | None = None
        self._topic = OwnedTopic(node, RobotPlace, 'robot_place')
        self._done = OwnedTopic(node, Time, 'robot_place_written', repeat=None)
        self._news = Interrupt()
        keep_up(node, 'place recorder', self._news, self._catch_up)
        if start == '':
            StateSubscription(node, OntologyMap, 'ontology_map/build_map', self._on_build_map)

    def tell(self, place: str | None, stamp: Time | None = None) -> None:
        """Take where the robot is; from any thread, without waiting.

        Args:
            place: The place; None: that is not known.
            stamp: When it was seen there; now unless given.
        """
        with self._lock:
            if self._told is not None and self._told.place == (place or ''):
                return
            stamp = stamp or self._node.get_clock().now().to_msg()
            self._told = RobotPlace(header=Header(stamp=stamp), place=place or '')
            self._topic.publish(self._told)
            if place:
                self._kept.save({'place': place})
        self._news.set()

    def tell_point(self, point: Points) -> None:
        """Take where the robot is as a point of shape (3,), metres; from any thread, without
        waiting.

        The place is the nearest one within reach, as soon as the map says where the places are.
        """
        with self._lock:
            self._point = point, self._node.get_clock().now().to_msg()
        self._news.set()

    def _on_build_map(self, message: OntologyMap) -> None:
        if message.robot_room:
            self._start = message.robot_room
            self._news.set()

    def _catch_up(self) -> float | None:
        """Write what is to be written.

        Returns:
            Seconds after which to look again; None: when something has changed.

        Raises:
            OntologyNotReadyError: Map or ontology do not answer.
        """
        stopping = self._node.stopping
        if self._facts is None:
            self._facts = self._knowledge.watch_robot_place(stopping, self._news.set)
        self._find_place()
        if self._told is None and self._start is not None:
            self._begin()
        told, written = self._told, self._written
        if told is None:
            return None
        if not told.place:
            # Not known at present, as between two places: `isIn` stays what it was, also in an
            # ontology that has come back empty.
            if written is None or self._facts.facts:
                return None
            told = written
        told_stamp = told.header.stamp
        place, stamp = str(told.place), nanoseconds_of(told_stamp)
        if written is told:
            if {fact.arguments[1] for fact in self._facts.facts} == {place}:
                return None
            left = self._written_at + CHANGES_DELAY - time.monotonic()
            if left > 0.0:
                return left
        with answered():
            ontology = self._knowledge.connect(stopping)
            ontology.record_place(place, stamp)
        self._done.publish(told_stamp)
        if written is None or written.place != place:
            self._node.get_logger().info(f'the robot is in {place}')
        self._written, self._written_at = told, time.monotonic()
        return None

    def _find_place(self) -> None:
        """Tell the place of the last point."""
        with self._lock:
            found = self._point
        if found is None:
            return
        point, stamp = found
        place, gap = nearest_place(self._knowledge.places(self._node.stopping), point)
        self.tell(place if gap <= self._reach else None, stamp)
        with self._lock:
            if self._point is found:
                self._point = None

    def _begin(self) -> None:
        """Take the place in which an earlier process left the robot, or else where it starts."""
        kept = self._kept.text('place')
        if kept and kept in self._knowledge.places(self._node.stopping):
            self.tell(kept)
            return
        with answered():
            found = self._knowledge.connect(self._node.stopping).robot_places()
        if len(found) == 1:
            self.tell(found[0])
        elif self._start:
            self.tell(self._start)
