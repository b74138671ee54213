"""The map builder: loads the ontology into the armor server and enters the place.

It goes on watching: when the server comes late, comes back without its ontologies, or drops this
one, the map is built again, with the rooms and doors as they are by then.
"""

from __future__ import annotations

import queue
import sys
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future

from surveillance_interfaces.msg import OntologyMap
from surveillance_interfaces.srv import (
    AddRoom,
    ReferenceName,
    RemoveRoom,
    RoomPosition,
    SetDoor,
)
from surveillance_ontology.armor.settings import DATA
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    FactSubscription,
)
from surveillance_ontology.conversions import point_to_ros, position_from_ros, room_note_from_ros
from surveillance_ontology.map_building import ROBOT, MapBuilding, RoomNote, extended
from surveillance_ontology.place import Place, PlaceError, make_place
from surveillance_runtime.node import PatrolNode, StartError, run_node
from surveillance_runtime.qos import STATE_QOS


class OntologyMapBuilder(PatrolNode):
    """Builds and keeps the map in the ontology."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('ontology_map_builder', **node_options)
        self._reference = self.parameter(
            'ontology_reference', 'surveillance', 'Reference name of the ontology in the server.'
        )
        path = self.parameter(
            'ontology_path', str(DATA / 'surveillance.owl'), 'The ontology to start from.'
        )
        uri = self.parameter(
            'ontology_uri', 'http://bnc/exp-rob-lab/2022-23', 'IRI of the ontology.'
        )
        timeout = self.parameter(
            'armor_timeout', 5.0, 'Longest wait for an answer of the server, seconds.', minimum=0.1
        )
        self._place = self._described_place()
        self.robot_room = self._place.start if self._place else ''
        self._built = False
        self._waiting: list[Future] = []
        self._work: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        armor = ArmorClient(
            self, self.get_name(), self._reference, timeout=timeout, interrupt=self.stopping
        )
        self._building = MapBuilding(armor, path, uri)
        pattern = f'isIn({ROBOT}, ?)'
        self._is_in = FactSubscription(self, armor, pattern, self._on_moved, self._look)
        group = ReentrantCallbackGroup()
        prefix = 'ontology_map/'
        for kind, name, callback in (
            (ReferenceName, 'reference_name', self._on_reference_name),
            (RoomPosition, 'room_position', self._on_room_position),
            (AddRoom, 'add_room', self._on_add_room),
            (RemoveRoom, 'remove_room', self._on_remove_room),
            (SetDoor, 'set_door', self._on_set_door),
        ):
            self.create_service(kind, prefix + name, callback, callback_group=group)
        self.create_subscription(
            OntologyMap, prefix + 'build_map', self._on_build_map, STATE_QOS, callback_group=group
        )
        self._look()
        self.spawn(self._run_work, 'map building')

    def on_stop(self) -> None:
        """End the worker."""
        self._work.put(None)

    def _described_place(self) -> Place | None:
        source = self.parameter(
            'map_source',
            'configuration',
            'Where the map comes from: the parameters, or ontology_map/build_map alone.',
            choices=('configuration', 'markers'),
            read_only=True,
        )
        if source == 'markers':
            return None
        rooms = self.parameters_under('map')
        positions = self.parameters_under('room_positions')
        robot_room = self.parameter('robot_room', '', 'Room in which the robot starts.')
        stations = self.parameter(
            'recharge_rooms', [], 'Rooms with a charging station; they are never removed.', of=str
        )
        if not rooms and not positions:
            return None
        try:
            return make_place(rooms, positions, robot_room, stations)
        except PlaceError as error:
            raise StartError(f'{self.get_name()}: parameter {error}') from None

    # --- callbacks ---

    async def _on_reference_name(self, _request: Any, response: Any) -> Any:
        if not self._built:
            future = Future(executor=self.executor)
            self._waiting.append(future)
            await future
        response.name = self._reference
        return response

    def _on_room_position(self, request: Any, response: Any) -> Any:
        position = self._place.positions.get(request.room_name) if self._place else None
        response.valid = position is not None
        if position is not None:
            response.position = point_to_ros(position)
        return response

    async def _on_add_room(self, request: Any, response: Any) -> Any:
        name, position = request.room_name, position_from_ros(request.position)
        return await self._edited(
            lambda place: place.with_room(name, position, request.doors),
            f'{name} has {", ".join(request.doors)}',
            response,
        )

    async def _on_remove_room(self, request: Any, response: Any) -> Any:
        name = request.room_name

        def edit(place: Place) -> Place:
            left = place.without_room(name)
            if self._building.robot_room() == name:
                raise PlaceError(('map', name), 'the robot is in it, it cannot be removed')
            return left

        return await self._edited(edit, f'{name} removed', response)

    async def _on_set_door(self, request: Any, response: Any) -> Any:
        state = 'open' if request.open else 'closed'
        return await self._edited(
            lambda place: place.with_door(request.door, is_open=request.open),
            f'{request.door} is {state}',
            response,
        )

    def _on_build_map(self, msg: OntologyMap) -> None:
        notes = [room_note_from_ros(place) for place in msg.places]
        self._work.put(lambda: self._extend(notes, msg.robot_room))

    def _on_moved(self, fact: Any, came: bool) -> None:
        if came:
            self.robot_room = fact.arguments[1]

    # --- work, on the worker's thread ---

    def _look(self) -> None:
        self._work.put(self._ensure_built)

    def _run_work(self) -> None:
        while (work := self._work.get()) is not None and not self.stopping.is_set():
            work()

    def _ensure_built(self) -> None:
        told = False
        while self._place is not None and not self.stopping.is_set():
            try:
                if self._built and self._building.is_loaded():
                    return
                self._built = False
                self._place = self._building.build(self._place, self._now(), self.robot_room)
            except ArmorServiceCallError as error:
                if not told and not self.stopping.is_set():
                    self.get_logger().warn(f'waiting for the armor server: {error}')
                    told = True
            except ArmorServiceInternalError as error:
                self.fail(f'cannot build the map: {error}')
                return
            else:
                self._announce()
                return

    def _announce(self) -> None:
        assert self._place is not None
        rooms, doors = len(self._place.rooms), len(self._place.doors)
        self.get_logger().info(f'map {self._reference} is built: {rooms} rooms, {doors} doors')

        self._built = True

        def answer() -> None:
            waiting, self._waiting = self._waiting, []
            for future in waiting:
                future.set_result(None)

        self.executor.create_task(answer)

    def _extend(self, notes: list[RoomNote], robot_room: str) -> None:
        try:
            place = extended(self._place, notes, robot_room)
        except PlaceError as error:
            self.get_logger().error(f'ontology_map/build_map refused: {error}')
            return
        if robot_room or not self.robot_room:
            self.robot_room = place.start
        before, self._place = self._place, place
        if before is not None and self._built:
            try:
                self._building.change(before, place, self._now())
            except (ArmorServiceCallError, ArmorServiceInternalError) as error:
                self.get_logger().warn(f'ontology_map/build_map: {error}; building anew')
            else:
                return
        self._built = False
        self._ensure_built()

    async def _edited(self, edit: Callable[[Place], Place], done: str, response: Any) -> Any:
        future = Future(executor=self.executor)

        def work() -> None:
            future.set_result(self._edit(edit))
            self.executor.wake()

        self._work.put(work)
        problem = await future
        response.success = not problem
        response.message = problem or done
        return response

    def _edit(self, edit: Callable[[Place], Place]) -> str:
        """Change the place and the ontology; what went wrong, empty if nothing did."""
        if self._place is None:
            return 'there is no map yet'
        try:
            after = edit(self._place)
            self._building.change(self._place, after, self._now())
        except PlaceError as error:
            return str(error)
        except (ArmorServiceCallError, ArmorServiceInternalError) as error:
            return f'the ontology was not changed: {error}'
        self._place = after
        return ''

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds // 1_000_000_000)


def main(args: list[str] | None = None) -> int:
    """Run the node as a process."""
    return run_node(OntologyMapBuilder, args)


if __name__ == '__main__':
    sys.exit(main())
