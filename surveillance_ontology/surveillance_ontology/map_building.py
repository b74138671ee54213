"""Which doors of which rooms an ontology has of a place, and a place that messages extend.

A closed door is left out on one of its sides, which ends the connection: on the side that has more
doors, so that the other stays a room and this one, mostly, a corridor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from surveillance_runtime.place import Place, PlaceError, Position


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
    """Return the doors of each room as the ontology has them: closed ones on one side only."""
    doors = {room: list(found) for room, found in place.rooms.items()}
    for door in sorted(place.closed):
        sides = place.doors[door]
        if len(sides) > 1:
            hiding = max(sides, key=lambda room: (len(doors[room]), room))
            doors[hiding].remove(door)
    return {room: tuple(found) for room, found in doors.items()}


def closed_doors(place: Place, shown: Mapping[str, Iterable[str]]) -> frozenset[str]:
    """Return the closed doors of a place of which an ontology has some rooms, see `shown_doors`.

    Args:
        place: The place; what the ontology does not tell of a door is as it is here.
        shown: The doors of each room that the ontology has.
    """
    present = {room: set(doors) for room, doors in shown.items()}
    closed = set(place.closed)
    for door, sides in place.doors.items():
        seen = sum(door in present.get(side, ()) for side in sides)
        if len(sides) > 1 and seen and all(side in present for side in sides):
            closed.discard(door)
            if seen == 1:
                closed.add(door)
    return frozenset(closed)


def extended(place: Place | None, notes: Sequence[RoomNote], robot_room: str) -> Place:
    """Return a place with further rooms, or with further doors of rooms it has.

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
