"""What a watcher has to ask for: the places and their visits, the doors' lines, the mode.

Nothing here is published as it is. The ontology tells facts as they change; positions and
parameters are asked for once, and again when another mission has begun.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters

from surveillance_interfaces.srv import ReferenceName, RoomPosition
from surveillance_ontology.armor.facts import ShortFact
from surveillance_ontology.armor_client import ArmorClient, FactSubscription, value_in
from surveillance_operator.mission_topics import Update
from surveillance_operator.snapshot import Snapshot
from surveillance_runtime.calls import CallFailed, ServiceCaller
from surveillance_runtime.node import PatrolNode

TIMEOUT = 2.0
"""Deadline of each question, seconds of steady time; then it is asked again."""

BUILDER = 'ontology_map_builder'
PLANNER = 'planner_controller'
"""The node that knows the doors' lines and the execution mode, as its parameters."""


class RosMissionFacts:
    """Asks and follows, for a snapshot that somebody else keeps.

    Args:
        node: The node that watches.
        update: Takes a function from the old snapshot to the new one.
    """

    def __init__(self, node: PatrolNode, update: Update) -> None:
        self._node = node
        self._update = update
        self._reference = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
        self._position = ServiceCaller(node, RoomPosition, 'ontology_map/room_position')
        self._list = ServiceCaller(node, ListParameters, f'{PLANNER}/list_parameters')
        self._get = ServiceCaller(node, GetParameters, f'{PLANNER}/get_parameters')
        self._armor: ArmorClient | None = None
        self._places: set[str] = set()
        self._without_position: set[str] = set()
        self._has_parameters = self._has_reference = self._asking = False

    def forget(self) -> None:
        """Another mission may have another map."""
        self._has_parameters = self._has_reference = False
        self._without_position = set(self._places)

    def servers(self) -> frozenset[str]:
        """The nodes that there are now to answer."""
        known = ((BUILDER, self._position), (PLANNER, self._get))
        return frozenset(name for name, service in known if service.is_ready())

    def ask(self) -> None:
        """Asks for what is missing, if it is not being asked for; call it now and then."""
        missing = self._without_position or not (self._has_reference and self._has_parameters)
        if missing and not self._asking:
            self._asking = True
            self._node.executor.create_task(self._ask)

    async def _ask(self) -> None:
        try:
            for question in (self._ask_parameters, self._ask_reference, self._ask_positions):
                try:
                    await question()
                except CallFailed as error:
                    self._node.get_logger().debug(str(error))
        finally:
            self._asking = False

    async def _ask_reference(self) -> None:
        if self._has_reference:
            return
        name = (await self._reference.call_async(ReferenceName.Request(), TIMEOUT)).name
        self._has_reference = True
        if self._armor is not None:
            self._armor.reference_name = name
            return
        self._armor = ArmorClient(self._node, self._node.get_name(), name, timeout=TIMEOUT)
        for pattern, callback in (
            ('LOCATION(?)', self._on_place),
            ('URGENT(?)', self._on_urgent),
            ('visitedAt(?, ?)', self._on_visit),
            ('connectedTo(?, ?)', self._on_link),
        ):
            FactSubscription(self._node, self._armor, pattern, callback)

    async def _ask_positions(self) -> None:
        for place in sorted(self._without_position):
            request = RoomPosition.Request(room_name=place)
            answer = await self._position.call_async(request, TIMEOUT)
            self._without_position.discard(place)
            if answer.valid:
                point = (answer.position.x, answer.position.y)
                self._update(_with_position(place, point))

    async def _ask_parameters(self) -> None:
        if self._has_parameters:
            return
        listed = await self._list.call_async(ListParameters.Request(prefixes=['doors']), TIMEOUT)
        names = ['execution_mode', *listed.result.names]
        values = (await self._get.call_async(GetParameters.Request(names=names), TIMEOUT)).values
        self._has_parameters = len(values) == len(names)
        lines = {
            name.removeprefix('doors.'): _door_line(*value.double_array_value)
            for name, value in zip(names[1:], values[1:], strict=False)
            if len(value.double_array_value) == 4
        }
        mode = values[0].string_value if values else ''
        self._update(lambda old: replace(old, mode=mode, door_lines=lines))

    def _on_place(self, fact: ShortFact, came: bool) -> None:
        (place,) = fact.arguments
        for places in (self._places, self._without_position):
            (places.add if came else places.discard)(place)
        if not came:
            self._update(lambda old: replace(old, positions=_without(old.positions, place)))

    def _on_urgent(self, fact: ShortFact, came: bool) -> None:
        place = frozenset(fact.arguments)
        self._update(
            lambda old: replace(old, urgent=old.urgent | place if came else old.urgent - place)
        )

    def _on_visit(self, fact: ShortFact, came: bool) -> None:
        place, rendered = fact.arguments
        seconds = float(value_in(rendered))

        def told(old: Snapshot) -> Snapshot:
            if came:
                return replace(old, visited_at={**old.visited_at, place: seconds})
            if old.visited_at.get(place) != seconds:
                return old
            return replace(old, visited_at=_without(old.visited_at, place))

        self._update(told)

    def _on_link(self, fact: ShortFact, came: bool) -> None:
        pair = frozenset({(fact.arguments[0], fact.arguments[1])})
        self._update(lambda old: replace(old, links=old.links | pair if came else old.links - pair))


def _with_position(place: str, point: tuple[float, float]) -> Callable[[Snapshot], Snapshot]:
    return lambda old: replace(old, positions={**old.positions, place: point})


def _without(values: Any, name: str) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != name}


def _door_line(x: float, y: float, yaw: float, width: float) -> tuple[float, float, float, float]:
    dx, dy = width / 2 * math.cos(yaw), width / 2 * math.sin(yaw)
    return x - dx, y - dy, x + dx, y + dy
