"""The map builder: loads the ontology into the armor server and enters the place.

It goes on watching: when the server comes late, comes back without its ontologies, or drops this
one, the map is built again, with the rooms and doors as they are by then. An ontology that
contradicts itself is built anew, too. Where the robot is, and what it visited, is told by others.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from std_msgs.msg import String

from floor_plans import Place, PlaceError
from floor_plans.parameters import (
    AT_STATION,
    description_of,
    patrol_rules,
    place_from,
    stations_in,
    zones_from,
)
from strict_files.files import in_one_line, read_json, replace_text
from strict_files.yaml_file import MAX_BYTES
from surveillance_interfaces.msg import FactChanges, OntologyMap
from surveillance_interfaces.srv import (
    AddRoom,
    ConsoleCommand,
    ReferenceName,
    RemoveRoom,
    RoomPosition,
    SetDoor,
)
from surveillance_ontology.armor_client import (
    CHANGES_QOS,
    CHANGES_TOPIC,
    ArmorClient,
    FactSubscription,
)
from surveillance_ontology.conversions import room_note_from_ros
from surveillance_ontology.map_keeper import MapKeeper, Reports, Source
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_vocabulary import ROBOT, checked_names
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime.conversions import point_from, point_message
from surveillance_runtime.duplicate_nodes import DuplicateNodeWatch
from surveillance_runtime.node import PatrolNode, report_exception
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.place_changes import TOPIC, described_in_text
from surveillance_runtime.place_parameters import described_place, described_stations
from surveillance_runtime.process import run_node
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription
from surveillance_runtime.waiting import AwaitedEvent, AwaitedWork

SECONDS_PER_ROOM = 0.005
"""By which the longest wait grows with the map."""
ARMOR_SERVICE = 'armor_interface_srv'
PLACE_SECONDS = 2.0
"""How long an answer waits for the place of the robot once the map is built, steady seconds."""
APART = 0.5
"""Metres; whoever adds a room whose point is nearer than this to another's is told."""
PATIENCE = 1.0
"""Steady seconds after which a contradictory ontology is built anew. Before that another node may
end the contradiction: one that tells where the robot is, or changes two facts in two steps."""


class OntologyMapBuilder(PatrolNode):
    """Builds and keeps the map in the ontology."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('ontology_map_builder', **node_options)
        self._reference = self.parameter(
            'ontology_reference',
            'surveillance',
            'Reference name of the ontology in the server.',
            read_only=True,
        )
        timeout = self.parameter(
            'armor_timeout',
            5.0,
            'Longest wait for an answer of the server, seconds.',
            minimum=0.1,
            read_only=True,
        )
        source = self.declare_fields(Source())
        place = described_place(self)
        self._stations = described_stations(self, self.get_parameter('recharge_rooms').value)
        # Only their names matter here; the simulator checks the rest.
        fleet = tuple(
            dict.fromkeys(key.partition('.')[0] for key in self.parameters_under('robots'))
        )
        self._fleet = fleet
        robot = fleet[0] if fleet else ROBOT
        if place is not None:
            try:
                for each in fleet or (ROBOT,):
                    checked_names(place, each)
            except PlaceError as error:
                raise ParameterError(f'{self.get_name()}: parameter {error}') from None
        # The first reasoning over thousands of places takes its time.
        timeout = max(timeout, SECONDS_PER_ROOM * len(place.rooms if place else ()))
        armor = ArmorClient(
            self, self.get_name(), self._reference, timeout=timeout, interrupt=self.stopping
        )
        self._built = AwaitedEvent(self)
        log = self.get_logger()
        self._keeper = MapKeeper(
            MapOntology(armor, robot, fleet),
            source,
            place,
            lambda: int(self.get_clock().now().nanoseconds // 1_000_000_000),
            self.stopping.is_set,
            Reports(log.info, log.warn, log.error, self._cannot_build),
            self._built.happen,
        )
        self._work = AwaitedWork(self, 1)
        # Steady time: a simulated clock may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._doubt = self.create_timer(PATIENCE, self._on_doubt, clock=steady)
        self._doubt.cancel()
        self.create_subscription(
            FactChanges,
            CHANGES_TOPIC,
            self._on_changes,
            CHANGES_QOS,
        )
        self._placed = FactSubscription(
            self,
            armor,
            RobotOntology(armor, robot, fleet).robot_place_facts,
            lambda _fact, _came: self._built.happen(),
            self._look,
        )
        self._built_at: float | None = None
        self._late = self.create_timer(PLACE_SECONDS, self._on_late, clock=steady)
        self._late.cancel()
        self._changed_place = OwnedTopic(self, String, TOPIC)
        # As it reads again what was kept: lists instead of tuples.
        self._given = None if place is None else json.loads(json.dumps(description_of(place)))
        file = source.state_file
        self._place_file = Path(file).with_suffix('.place.json') if file else None
        self._tell_kept_place()
        self._serve()
        DuplicateNodeWatch(self)
        self._look()

    def _cannot_build(self, reason: str) -> None:
        """End the node; a new start helps only where the server came back without the ontology."""
        servers = self.count_services(self.resolve_service_name(ARMOR_SERVICE))
        if servers > 1:
            # Another one has answered, which reads other folders.
            reason = (
                f'{ARMOR_SERVICE} is offered by {servers} nodes in ROS domain '
                f'{self.context.get_domain_id()}: expected one armor_server; end the other one, or '
                f'choose another domain or namespace ({reason})'
            )
        self.fail(reason, unusable='unknown reference' not in reason)

    def _serve(self) -> None:
        group = ReentrantCallbackGroup()
        for kind, name, callback in (
            (ReferenceName, 'reference_name', self._on_reference_name),
            (ReferenceName, 'built', self._on_built),
            (RoomPosition, 'room_position', self._on_room_position),
            (AddRoom, 'add_room', self._on_add_room),
            (RemoveRoom, 'remove_room', self._on_remove_room),
            (SetDoor, 'set_door', self._on_set_door),
            # Its line is the place's parameters as JSON.
            (ConsoleCommand, 'set_place', self._on_set_place),
        ):
            self.create_service(kind, f'ontology_map/{name}', callback, callback_group=group)
        # Each robot of a fleet tells what it found: a topic of one owner each.
        for prefix in ('', *(f'{robot}/' for robot in self._fleet)):
            topic = f'{prefix}ontology_map/build_map'
            StateSubscription(self, OntologyMap, topic, self._on_build_map)

    def on_stop(self) -> None:
        """End the worker."""
        self._work.stop()

    def _look(self) -> None:
        self._work.put(self._keeper.ensure_built)

    async def _on_reference_name(self, request: Any, response: Any) -> Any:
        """Answer once the map is built and the ontology has the robot's place."""
        if not self._keeper.is_built:
            self._built_at = None
        await self._on_built(request, response)
        if self._built_at is None:
            self._built_at = time.monotonic()
            self._late.reset()
        await self._built.wait_for(self._is_answered)
        return response

    async def _on_built(self, _request: Any, response: Any) -> Any:
        """Answer once the map is built, for who will tell where the robot is."""
        await self._built.wait_for(lambda: self._keeper.is_built)
        response.name = self._reference
        return response

    def _is_answered(self) -> bool:
        assert self._built_at is not None
        return bool(self._placed.facts) or time.monotonic() >= self._built_at + PLACE_SECONDS

    def _on_late(self) -> None:
        self._late.cancel()
        if not self._placed.facts:
            self.get_logger().warn(
                'ontology_map/reference_name is answered although the ontology has the robot in no '
                f'place: nobody told it within {PLACE_SECONDS:g} s of the map'
            )
        self._built.happen()

    def _on_room_position(self, request: Any, response: Any) -> Any:
        place = self._keeper.place
        name, asked, _ = request.room_name.partition(AT_STATION)
        position = place.positions.get(name) if place else None
        if position is not None and asked and (station := self._stations.get(name)):
            position = (station.pose[0], station.pose[1], position[2])
        response.valid = position is not None
        if position is not None:
            response.position = point_message(position)
        return response

    async def _on_add_room(self, request: Any, response: Any) -> Any:
        name, position = request.room_name, point_from(request.position)
        done = f'{name} has {", ".join(request.doors)}'
        before = self._keeper.place.positions if self._keeper.place else {}
        response = await self._edit(
            lambda place: place.with_room(name, position, request.doors), done, response
        )
        place = self._keeper.place
        if response.success and place is not None:
            loose = [door for door in request.doors if len(place.doors.get(door, ())) == 1]
            if loose:
                response.message += f'; no other place has {", ".join(loose)} yet'
            near = [other for other, at in before.items() if math.dist(at, position) < APART]
            if near and name not in before:
                response.message += f'; its point is that of {", ".join(near)}'
        return response

    async def _on_remove_room(self, request: Any, response: Any) -> Any:
        name = request.room_name
        return await self._edit(
            lambda place: self._keeper.without_room(place, name), f'{name} removed', response
        )

    async def _on_set_door(self, request: Any, response: Any) -> Any:
        door, is_open = request.door, request.open
        done = f'{door} is {"open" if is_open else "closed"}'
        return await self._edit(
            lambda place: place.with_door(door, is_open=is_open), done, response
        )

    async def _on_set_place(self, request: Any, response: Any) -> Any:
        """Take the parameters of a place that somebody has changed."""
        try:
            described = described_in_text(request.line)
            wanted = checked_names(place_from(described))
            patrol_rules(described, wanted.rooms)
            zones_from(described)
            stations = stations_in(described)
            if self._fleet and stations != self._stations:
                raise PlaceError(
                    ('stations',),
                    'of a fleet are read at the start: expected them as they were; start the '
                    'mission again',
                )
        except ValueError as error:
            response.answer = str(error)
            return response

        def change(place: Place) -> Place:
            return replace(wanted, closed=place.closed & wanted.doors.keys())

        response.answer = await self._work.run(lambda: self._keeper.edit(change))
        response.accepted = not response.answer
        if response.accepted:
            self._stations = stations
            rooms, doors = len(wanted.rooms), len(wanted.doors)
            response.answer = f'the mission has the place now: {rooms} rooms, {doors} doors'
            self._tell_place(request.line)
            self._keep_place(request.line)
        return response

    def _tell_place(self, text: str) -> None:
        self._changed_place.publish(String(data=text))

    def _keep_place(self, text: str) -> None:
        """Keep a changed place over a restart of this process."""
        if self._place_file is None:
            return
        kept = {'described': self._given, 'text': text}
        try:
            replace_text(self._place_file, json.dumps(kept))
        except OSError as error:
            self.get_logger().warn(f'the changed place is not kept: {in_one_line(error)}')

    def _tell_kept_place(self) -> None:
        """Tell again which place an earlier process was given, if it began with the same."""
        if self._place_file is None or not self._place_file.exists():
            return
        try:
            kept = read_json(self._place_file, MAX_BYTES)
            if kept['described'] == self._given:
                self._stations = stations_in(described_in_text(kept['text']))
                self._tell_place(kept['text'])
        except (OSError, ValueError, KeyError, TypeError) as error:
            self.get_logger().warn(f'the changed place that was kept is not used: {error!r:.120}')

    async def _edit(self, change: Callable[[Place], Place], done: str, response: Any) -> Any:
        problem = await self._work.run(lambda: self._keeper.edit(change))
        response.success = not problem
        response.message = problem or done
        return response

    def _on_build_map(self, msg: OntologyMap) -> None:
        def extend() -> None:
            # A stranger's place may be wrong: it costs the message.
            try:
                notes = [room_note_from_ros(place) for place in msg.places]
                self._keeper.extend(notes, msg.robot_room)
            except ValueError as error:
                report_exception(error, self, 'ontology_map/build_map')

        self._work.put(extend)

    def _on_changes(self, msg: FactChanges) -> None:
        is_own = msg.reference_name == self._reference and msg.sequence
        if is_own and not msg.is_consistent and self._doubt.is_canceled():
            self._doubt.reset()

    def _on_doubt(self) -> None:
        self._doubt.cancel()
        self._work.put(self._keeper.end_contradiction)


def main(args: list[str] | None = None) -> int:
    """Run the node as a process."""
    return run_node(OntologyMapBuilder, args)


if __name__ == '__main__':
    sys.exit(main())
