"""The map's half of the patrol's ontology: rooms and doors, as a place has them.

    ontology = MapOntology(ArmorClient('me', 'surveillance', transport))
    ontology.build(place, path, uri)

A closed door is left out on one of its sides, which ends the connection: on the side that has more
doors, so that the other stays a room and this one, mostly, a corridor.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from armor_service.client import ArmorClient
from armor_service.protocol import DirectiveRequest
from floor_plans import Place
from surveillance_ontology.patrol_directives import PatrolDirectives, names_in
from surveillance_ontology.patrol_vocabulary import (
    DOOR,
    HAS_DOOR,
    NEVER,
    NOW,
    ROBOT,
    ROOM,
    VISITED_AT,
)


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


class MapOntology:
    """The map of one ontology: rooms, doors, and which of these are closed.

    Args:
        armor: A client of the ontology's reference.
        robot: A robot's name.
        fleet: The names of all robots that share the ontology; empty: this one is alone.
    """

    def __init__(self, armor: ArmorClient, robot: str = ROBOT, fleet: Sequence[str] = ()) -> None:
        self._directives = PatrolDirectives(armor)
        self._robot = robot
        self._fleet = tuple(fleet) or (robot,)

    def is_loaded(self) -> bool:
        """Tell whether the server has the reference."""
        armor = self._directives.armor
        return armor.reference_name in armor.utils.get_all_refs()

    def build(
        self,
        place: Place,
        path: str,
        uri: str,
        first_visit: int = NEVER,
        now: int | None = None,
        gone: Iterable[str] = (),
    ) -> Place:
        """Load the ontology and enter a place, as far as it is not there yet.

        Where the robot is, and when it visited which place, is left to those who know.

        Args:
            place: Rooms and doors.
            path: The ontology to start from.
            uri: Its IRI.
            first_visit: Time of visit of places that the ontology does not know, seconds.
            now: The robot's time in an ontology that knows none of the places, seconds; None
                leaves it as it is.
            gone: Rooms and doors that the ontology may still have, and is to have no more.

        Returns:
            The place with the closed doors that the ontology has.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses, for example because there is no such file.
        """
        self._directives.armor.utils.load_ref_from_file(path, uri, False, 'PELLET', True)
        known = self._known_doors(place)
        place = replace(place, closed=closed_doors(place, known))
        mine = {
            room: [door for door in doors if door in place.rooms[room]]
            for room, doors in known.items()
        }
        todo = [self._directives.request('REMOVE IND', name) for name in sorted(gone)]
        if ROBOT not in self._fleet:
            # It would have the time that it was written with, for which every place is URGENT.
            todo.append(self._directives.request('REMOVE IND', ROBOT))
        todo += self._differences(mine, shown_doors(place), first_visit)
        if not known and now is not None:
            todo += [self._directives.set_value(NOW, robot, now) for robot in self._fleet]
        self._directives.carry_out(
            [
                *todo,
                self._directives.request('REASON'),
                self._directives.request('DISJOINT IND CLASS', ROOM),
                self._directives.request('DISJOINT IND CLASS', DOOR),
                self._directives.request('REASON'),
            ]
        )
        return place

    def change(self, before: Place, after: Place, first_visit: int = NEVER) -> None:
        """Bring the ontology from one place to another: rooms and doors added, closed, taken away.

        Args:
            before: What the ontology has.
            after: What it is to have.
            first_visit: Time of visit of new rooms, seconds.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        todo = self._differences(shown_doors(before), shown_doors(after), first_visit)
        todo += [
            self._directives.request('REMOVE IND', name)
            for name in (*before.rooms, *before.doors)
            if name not in after.rooms and name not in after.doors
        ]
        todo.append(self._directives.request('REASON'))
        if any(room not in before.rooms for room in after.rooms):
            todo.append(self._directives.request('DISJOINT IND CLASS', ROOM))
        if any(door not in before.doors for door in after.doors):
            todo.append(self._directives.request('DISJOINT IND CLASS', DOOR))
        if todo[-1].command != 'REASON':
            todo.append(self._directives.request('REASON'))
        self._directives.carry_out(todo)

    def forget(self) -> None:
        """Drop the ontology from the server."""
        self._directives.armor.utils.drop_ref()

    def contradiction(self) -> str:
        """Return which facts of the ontology clash, as a sentence; empty when it is consistent.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        return self._directives.contradiction()

    def places(self) -> tuple[str, ...]:
        """Return the names of all places.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        return self._directives.places()

    def robot_places(self) -> tuple[str, ...]:
        """Return where the ontology has the robot: one place, or none yet.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        return self._directives.robot_places(self._robot)

    def _known_doors(self, place: Place) -> dict[str, list[str]]:
        """Return the doors of the rooms that the ontology has already; empty when it has none of
        them.
        """
        rooms = tuple(place.rooms)
        answers = self._directives.carry_out(
            [
                *(
                    self._directives.request('QUERY DATAPROP IND', VISITED_AT, room)
                    for room in rooms
                ),
                *(
                    self._directives.request('QUERY OBJECTPROP IND', HAS_DOOR, room)
                    for room in rooms
                ),
            ]
        )
        return {
            room: list(names_in(doors))
            for room, visit, doors in zip(rooms, answers, answers[len(rooms) :], strict=False)
            if visit.queried_objects
        }

    def _differences(
        self,
        before: Mapping[str, Sequence[str]],
        after: Mapping[str, Sequence[str]],
        first_visit: int,
    ) -> list[DirectiveRequest]:
        request = self._directives.request
        todo: list[DirectiveRequest] = []
        for room, doors in after.items():
            old = before.get(room, ())
            todo += [
                request('REMOVE OBJECTPROP IND', HAS_DOOR, room, door)
                for door in old
                if door not in doors
            ]
            todo += [
                request('ADD OBJECTPROP IND', HAS_DOOR, room, door)
                for door in doors
                if door not in old
            ]
            if room not in before:
                todo.append(self._directives.set_value(VISITED_AT, room, first_visit))
        return todo
