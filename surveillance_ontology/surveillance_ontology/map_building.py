"""How a place stands in the ontology, and the directives that bring the ontology there.

A place becomes ``hasDoor`` and ``visitedAt`` statements; rooms, corridors and connections follow by
reasoning. A closed door is left out on one of its sides, which ends the connection: on the side
that has more doors, so that the other stays a room and this one, mostly, a corridor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from surveillance_ontology.armor.client import (
    ArmorClient,
    ArmorServiceInternalError,
    name_in,
)
from surveillance_ontology.armor.protocol import DirectiveRequest, DirectiveResponse
from surveillance_runtime.place import Place, PlaceError, Position

ROBOT = 'Robot1'
CHUNK = 2000
"""Directives in one batch."""


@dataclass(frozen=True)
class RoomNote:
    """A room as a message describes it.

    Attributes:
        name: Its name.
        position: A point inside, metres, world frame.
        connections: Pairs of the room behind a door and the door.
    """

    name: str
    position: Position
    connections: tuple[tuple[str, str], ...]


def shown_doors(place: Place) -> dict[str, tuple[str, ...]]:
    """The doors of each room as the ontology has them: closed ones on one side only."""
    doors = {room: list(found) for room, found in place.rooms.items()}
    for door in sorted(place.closed):
        sides = place.doors[door]
        if len(sides) > 1:
            hiding = max(sides, key=lambda room: (len(doors[room]), room))
            doors[hiding].remove(door)
    return {room: tuple(found) for room, found in doors.items()}


def closed_doors(place: Place, shown: Mapping[str, Iterable[str]]) -> frozenset[str]:
    """The doors of a place that an ontology has on one side only, see `shown_doors`."""
    present = {room: set(doors) for room, doors in shown.items()}
    return frozenset(
        door
        for door, sides in place.doors.items()
        if len(sides) > 1
        and all(side in present for side in sides)
        and sum(door in present[side] for side in sides) == 1
    )


def extended(place: Place | None, notes: Sequence[RoomNote], robot_room: str) -> Place:
    """A place with further rooms, or with further doors of rooms it has.

    A connection is entered on both its sides as far as they are known.

    Args:
        place: What is known; None at first.
        notes: The rooms, each once.
        robot_room: Where the robot is; empty leaves it.

    Raises:
        PlaceError: A note that cannot be used; nothing is taken of any then.
    """
    names = [note.name for note in notes]
    for name in names:
        if names.count(name) > 1:
            raise PlaceError(('map', name), 'described twice')
    if not notes and place is None:
        raise PlaceError(('map',), 'no rooms described')
    grown = place or Place({}, {}, robot_room or names[0])
    for note in notes:
        for other, _ in note.connections:
            if other == note.name:
                raise PlaceError(('map', note.name), 'is connected to itself')
        doors = [door for _, door in note.connections]
        known = grown.rooms.get(note.name)
        if known is None or any(door not in known for door in doors):
            grown = grown.with_room(note.name, note.position, doors)
        else:
            positions = {**grown.positions, note.name: note.position}
            grown = replace(grown, positions=positions)
    for note in notes:
        for other, door in note.connections:
            if other in grown.rooms and door not in grown.rooms[other]:
                grown = grown.with_room(other, grown.positions[other], [door])
    if robot_room and robot_room not in grown.rooms:
        raise PlaceError(('robot_room',), f"no room '{robot_room}' in the map")
    return replace(grown, start=robot_room or grown.start)


class MapBuilding:
    """Writes a place into an ontology.

    Args:
        client: A client of the reference that the map is to have.
        path: The ontology to start from.
        uri: Its IRI.
    """

    def __init__(self, client: ArmorClient, path: str, uri: str) -> None:
        self._client = client
        self._path = path
        self._uri = uri

    def is_loaded(self) -> bool:
        """Tell whether the server has the reference."""
        return self._client.reference_name in self._client.utils.get_all_refs()

    def robot_room(self) -> str | None:
        """Where the ontology has the robot."""
        rooms = self._client.query.objectprop_b2_ind('isIn', ROBOT)
        return rooms[0] if rooms else None

    def build(self, place: Place, now: int, robot_room: str) -> Place:
        """Load the ontology and enter a place.

        What the ontology has of it already is kept: times of visit, where the robot is, which doors
        are closed. So it may be called again at any time.

        Args:
            place: The place.
            now: Time in seconds, entered as the robot's time and as the time of visit of new rooms.
            robot_room: Where the robot is, if the ontology does not know.

        Returns:
            The place with the closed doors that the ontology has.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses, for example because there is no such file.
        """
        request = self._client.request
        self._client.utils.load_ref_from_file(self._path, self._uri, False, 'PELLET', True)
        known = self._known(place)
        if known:
            place = replace(place, closed=closed_doors(place, known))
            mine = {
                room: [door for door in doors if door in place.rooms[room]]
                for room, doors in known.items()
            }
            todo = self._differences(mine, shown_doors(place), now)
        else:
            todo = self._differences({}, shown_doors(place), now)
            clock = self._client.query.dataprop_b2_ind('now', ROBOT)
            todo += [request('REMOVE DATAPROP IND', 'now', ROBOT, 'LONG', old) for old in clock]
            todo.append(request('ADD DATAPROP IND', 'now', ROBOT, 'LONG', str(now)))
        self._send([*todo, request('REASON')])
        todo = [
            request('DISJOINT IND CLASS', 'ROOM'),
            request('DISJOINT IND CLASS', 'DOOR'),
        ]
        # Who drives the robot may have told its place since the ontology was loaded.
        if self.robot_room() is None:
            todo.append(request('ADD OBJECTPROP IND', 'isIn', ROBOT, robot_room))
        self._send([*todo, request('REASON')])
        return place

    def change(self, before: Place, after: Place, now: int) -> None:
        """Bring the ontology from one place to another.

        Args:
            before: What the ontology has.
            after: What it is to have.
            now: Time of visit of new rooms, seconds.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        request = self._client.request
        todo = self._differences(shown_doors(before), shown_doors(after), now)
        todo += [
            request('REMOVE IND', name)
            for name in (*before.rooms, *before.doors)
            if name not in after.rooms and name not in after.doors
        ]
        todo.append(request('REASON'))
        if any(room not in before.rooms for room in after.rooms):
            todo.append(request('DISJOINT IND CLASS', 'ROOM'))
        if any(door not in before.doors for door in after.doors):
            todo.append(request('DISJOINT IND CLASS', 'DOOR'))
        if todo[-1].command != 'REASON':
            todo.append(request('REASON'))
        self._send(todo)

    def _known(self, place: Place) -> dict[str, list[str]]:
        """The doors of the rooms that the ontology has already; empty when it has none of them."""
        rooms = set(self._client.query.ind_b2_class('LOCATION')) & set(place.rooms)
        asked = [room for room in place.rooms if room in rooms]
        request = self._client.request
        answers = self._send([request('QUERY OBJECTPROP IND', 'hasDoor', room) for room in asked])
        return {
            room: [name_in(door) for door in answer.queried_objects]
            for room, answer in zip(asked, answers, strict=True)
        }

    def _differences(
        self,
        before: Mapping[str, Sequence[str]],
        after: Mapping[str, Sequence[str]],
        now: int,
    ) -> list[DirectiveRequest]:
        request = self._client.request
        todo: list[DirectiveRequest] = []
        for room, doors in after.items():
            old = before.get(room, ())
            todo += [
                request('REMOVE OBJECTPROP IND', 'hasDoor', room, door)
                for door in old
                if door not in doors
            ]
            todo += [
                request('ADD OBJECTPROP IND', 'hasDoor', room, door)
                for door in doors
                if door not in old
            ]
            if room not in before:
                todo.append(request('ADD DATAPROP IND', 'visitedAt', room, 'LONG', str(now)))
        return todo

    def _send(self, requests: Sequence[DirectiveRequest]) -> list[DirectiveResponse]:
        answers: list[DirectiveResponse] = []
        for start in range(0, len(requests), CHUNK):
            chunk = requests[start : start + CHUNK]
            for wanted, answer in zip(chunk, self._client.batch(chunk).responses, strict=True):
                if not answer.success:
                    raise ArmorServiceInternalError(
                        f'{wanted.words}: {answer.error_description}', answer.exit_code
                    )
                answers.append(answer)
        return answers
