"""Asks a mission what nobody publishes: the ontology's facts, positions, parameters.

What is not answered is asked again; all of it when another mission has begun. Doors, zones and
stations are the nodes' parameters until the place is changed, then what the topic `place` says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.parameter import parameter_value_to_python

from armor_service.facts import ShortFact
from floor_plans import Door, PlaceError, Zone
from floor_plans.parameters import ZONE_TABLES, nested, stations_in, zones_from
from state_machines.ros import CallError, ServiceCaller
from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor_client import ArmorClient, FactSubscription
from surveillance_ontology.patrol_vocabulary import CONNECTIONS, PLACES, URGENT_PLACES, VISITS
from surveillance_operator.mission_state import MissionState, Pose
from surveillance_operator.topics import (
    BEHAVIOUR,
    behaviour_fields,
    point_from,
    with_fact,
    without,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.place_changes import follow_place

TIMEOUT = 2.0
"""Deadline of each question, seconds of steady time; then it is asked again."""
BUILDER = 'ontology_map_builder'
PLANNER = 'planner_controller'
"""The node that knows the doors' lines and the execution mode, as its parameters."""


class MissionQuestions:
    """Asks and follows what is not published: facts, positions, parameters.

    Args:
        node: The node that watches.
        update: Takes a function from the old state to the new one.
        robot: The robot of a fleet; then what the robots share is not asked for.
    """

    def __init__(
        self,
        node: PatrolNode,
        update: Callable[[Callable[[MissionState], MissionState]], None],
        robot: str = '',
    ) -> None:
        self._node = node
        self._update = update
        self._reference = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
        self._position = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        planner, behaviour = name_for(robot, PLANNER), name_for(robot, BEHAVIOUR)
        self._list = ServiceCaller(node, ListParameters, f'{planner}/list_parameters')
        self._get = ServiceCaller(node, GetParameters, f'{planner}/get_parameters')
        self._list_stations = ServiceCaller(node, ListParameters, f'{BUILDER}/list_parameters')
        self._get_stations = ServiceCaller(node, GetParameters, f'{BUILDER}/get_parameters')
        self._get_behaviour = ServiceCaller(node, GetParameters, f'{behaviour}/get_parameters')
        follow_place(node, self._take_place)
        self._armor: ArmorClient | None = None
        self._followed: list[FactSubscription] = []
        self._places: set[str] = set()
        self._without_position: set[str] = set()
        of_robot = (self._ask_doors, self._ask_behaviour)
        shared = (self._ask_reference, self._ask_stations)
        self._questions = of_robot if robot else (*of_robot, *shared)
        self._asks_places = not robot
        self._changed = False
        self._unanswered = set(self._questions)
        self._asking = False

    def _take_place(self, described: Mapping[str, Any]) -> None:
        """Take doors, zones, stations and points of a place that was changed."""
        lines = {
            name: Door(name, *row).segment for name, row in (described.get('doors') or {}).items()
        }
        zones, stations = _zones_of(described), _poses_of(described)
        self._without_position |= self._places
        # From now on the nodes' parameters are those of the place as it was.
        self._changed = True
        self._update(lambda old: old.having(door_lines=lines, zones=zones, stations=stations))

    def forget(self) -> None:
        """Ask anew: another mission may have another map."""
        self._changed = False
        self._unanswered = set(self._questions)
        self._without_position = set(self._places)

    def servers(self) -> frozenset[str]:
        """Return the nodes that there are now to answer."""
        known = [(PLANNER, self._get)]
        if self._asks_places:
            known.append((BUILDER, self._position))
        return frozenset(name for name, service in known if service.is_ready())

    def ask(self) -> None:
        """Ask for what is missing, if it is not being asked for; call it now and then."""
        missing = self._unanswered or self._without_position
        if missing and not self._asking and self._node.executor is not None:
            self._asking = True
            self._node.executor.create_task(self._ask)

    async def _ask(self) -> None:
        try:
            for question in (*self._questions, self._ask_positions):
                if question in self._unanswered or question == self._ask_positions:
                    # Not after it: what is to be asked anew meanwhile stays so.
                    self._unanswered.discard(question)
                    try:
                        await question()
                    except CallError as error:
                        if question in self._questions:
                            self._unanswered.add(question)
                        self._node.get_logger().debug(str(error))
        finally:
            self._asking = False

    async def _ask_reference(self) -> None:
        name = (await self._reference.call_async(ReferenceName.Request(), TIMEOUT)).name
        if self._armor is not None:
            if name != self._armor.reference_name:
                self._armor.reference_name = name
                for followed in self._followed:
                    followed.ask_anew()
            return
        self._armor = ArmorClient(self._node, self._node.get_name(), name, timeout=TIMEOUT)
        for pattern, callback in (
            (PLACES, self._on_place),
            (URGENT_PLACES, self._on_fact),
            (VISITS, self._on_fact),
            (CONNECTIONS, self._on_fact),
        ):
            self._followed.append(FactSubscription(self._node, self._armor, pattern, callback))

    async def _ask_positions(self) -> None:
        for place in sorted(self._without_position):
            request = RoomPosition.Request(room_name=place)
            self._without_position.discard(place)
            try:
                answer = await self._position.call_async(request, TIMEOUT)
            except CallError:
                self._without_position.add(place)
                raise
            if answer.valid and place in self._places:
                self._update(_placed(place, point_from(answer.position)))

    async def _ask_doors(self) -> None:
        request = ListParameters.Request(prefixes=['doors', *ZONE_TABLES])
        listed = await self._list.call_async(request, TIMEOUT)
        names = ['execution_mode', *listed.result.names]
        values = (await self._get.call_async(GetParameters.Request(names=names), TIMEOUT)).values
        if len(values) != len(names):
            raise CallError(f'{PLANNER} gave {len(values)} of {len(names)} parameters')
        found = nested(
            dict(zip(names[1:], map(parameter_value_to_python, values[1:]), strict=True))
        )
        lines = {
            name: Door(name, *row).segment
            for name, row in (found.get('doors') or {}).items()
            if row is not None and len(row) == 4
        }
        mode, zones = values[0].string_value, _zones_of(found)
        if self._changed:
            self._update(lambda old: old.having(mode=mode))
        else:
            self._update(lambda old: old.having(mode=mode, door_lines=lines, zones=zones))

    async def _ask_stations(self) -> None:
        """Ask who answers for the places' points where the stations are."""
        request = ListParameters.Request(prefixes=['stations'])
        listed = await self._list_stations.call_async(request, TIMEOUT)
        names = ['recharge_rooms', 'station', *listed.result.names]
        answer = await self._get_stations.call_async(GetParameters.Request(names=names), TIMEOUT)
        if len(answer.values) != len(names):
            raise CallError(f'{BUILDER} gave {len(answer.values)} of {len(names)} parameters')
        given = dict(zip(names, map(parameter_value_to_python, answer.values), strict=True))
        single = {name: given.pop(name) for name in names[:2]}
        table = nested(nested(given).get('stations', {}))
        stations = _poses_of({**single, 'stations': table})
        if not self._changed:
            self._update(lambda old: old.having(stations=stations))

    async def _ask_behaviour(self) -> None:
        names = ['urgency_threshold', 'policy']
        request = GetParameters.Request(names=names)
        values = (await self._get_behaviour.call_async(request, TIMEOUT)).values
        fields = behaviour_fields(dict(zip(names, values, strict=False)))
        self._update(lambda old: old.having(**fields))

    def _on_place(self, fact: ShortFact, came: bool) -> None:
        (place,) = fact.arguments
        for places in (self._places, self._without_position):
            (places.add if came else places.discard)(place)
        if not came:
            self._update(lambda old: old.having(positions=without(old.place.positions, place)))

    def _on_fact(self, fact: ShortFact, came: bool) -> None:
        self._update(lambda old: with_fact(old, fact, came))


def _zones_of(described: Mapping[str, Any]) -> dict[str, Zone]:
    """Return the zones of a place, by name; none where they are not sound."""
    tables = {
        table: {name: list(row or ()) for name, row in (described.get(table) or {}).items()}
        for table in ZONE_TABLES
    }
    try:
        zones = zones_from(tables)
    except PlaceError:
        return {}
    return {**zones.keep_out, **zones.slow}


def _poses_of(described: Mapping[str, Any]) -> dict[str, Pose]:
    """Return the poses of a place's stations; none where they are not sound."""
    try:
        return {
            room: station.pose
            for room, station in stations_in(described).items()
            if room and (described.get('station') or described.get('stations'))
        }
    except PlaceError:
        return {}


def _placed(place: str, point: tuple[float, float]) -> Callable[[MissionState], MissionState]:
    return lambda old: old.having(positions={**old.place.positions, place: point})
