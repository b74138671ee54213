"""Keeps a place in the ontology: builds it, builds it again when the server lost it, changes it.

A place is described at the start, or by messages, a room at a time (`RoomNote`).

Everything here blocks while the server answers and belongs on a worker thread.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from armor_service.client import (
    ArmorError,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)
from floor_plans import Place, PlaceError
from floor_plans.parameters import description_of, edited_place, problem_in_name
from floor_plans.shapes import Position
from strict_files.files import KeptFile
from strict_files.settings import parameter
from surveillance_ontology.map_ontology import MapOntology
from surveillance_ontology.patrol_directives import is_gone
from surveillance_ontology.patrol_vocabulary import ONTOLOGY, checked_names, never_visited

MOST_REPLACED = 10
"""Servers in a row that may lose the ontology while the map is entered, before that is an error."""


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
    for name, count in Counter(names).items():
        if count > 1:
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


@dataclass(frozen=True)
class Reports:
    """Where a `MapKeeper` says what happened; each is called with one line.

    Attributes:
        info: The map was built.
        warn: The server is not there yet; it is tried again. Or the ontology contradicted itself.
        refused: A map that was sent is not used; a contradiction that building anew does not end.
        failed: The map cannot be built at all, for example because the ontology is missing.
    """

    info: Callable[[str], None]
    warn: Callable[[str], None]
    refused: Callable[[str], None]
    failed: Callable[[str], None]


@dataclass(frozen=True)
class Source:
    """The ontology that a map is entered into."""

    path: str = parameter(str(ONTOLOGY), 'The ontology to start from.', name='ontology_path')
    uri: str = parameter(
        'http://bnc/exp-rob-lab/2022-23', 'IRI of the ontology.', name='ontology_uri'
    )
    urgent_at_start: bool = parameter(
        True,
        'Places that nobody has visited count as never visited, and so as URGENT; '
        'else as visited when the map was built.',
    )
    state_file: str = parameter(
        '',
        'File that keeps the rooms added, removed and told by messages over a restart of the '
        'process; empty: nothing is kept.',
    )


class MapKeeper:
    """The map of one reference.

    Args:
        ontology: The ontology.
        source: What it starts from.
        place: What is known at the start; None waits for `extend`.
        now: Time in whole seconds.
        stopping: Tells whether to give up.
        reports: Where to say what happened.
        on_built: Called each time the map is complete in the ontology.

    Attributes:
        place: The place as it is now.
        is_built: The ontology holds the place, as far as is known.
    """

    def __init__(
        self,
        ontology: MapOntology,
        source: Source,
        place: Place | None,
        now: Callable[[], int],
        stopping: Callable[[], bool],
        reports: Reports,
        on_built: Callable[[], None],
    ) -> None:
        self._ontology = ontology
        self._source = source
        self._now = now
        self._stopping = stopping
        self._reports = reports
        self._on_built = on_built
        self._began: int | None = None
        self._gave_up_mending = False
        self._described = None if place is None else description_of(place)
        self._kept = KeptFile(
            source.state_file, 'rooms that were added, removed or told by messages are not known'
        )
        self._by_hand: frozenset[str] = frozenset()
        self._entered: set[str] = set()
        self.place = place
        self.is_built = False
        if problem := self._kept.read(self._take_kept):
            reports.warn(f'parameter state_file: {problem}')

    def _take_kept(self, kept: dict[str, Any]) -> None:
        """Take the place as an earlier process left it."""
        edited = checked_names(edited_place(kept['edited']))
        by_hand = frozenset(kept['by_hand'])
        if any(problem_in_name('kept', name) for name in by_hand):
            raise PlaceError(('by_hand',), 'expected names')
        if kept['described'] == self._described:
            self.place, self._by_hand = edited, by_hand
            return
        if self.place is not None:
            # An ontology that was kept, too, has rooms that nobody knows the way to.
            self._entered = _names(edited)
        if by_hand:
            raise ValueError('it is of another place')

    def _keep(self, place: Place, by_hand: frozenset[str]) -> None:
        self._by_hand = by_hand
        problem = self._kept.write(
            {
                'described': self._described,
                'edited': description_of(place),
                'by_hand': sorted(by_hand),
            }
        )
        if problem:
            self._reports.warn(
                f'parameter state_file: {problem}; these rooms are lost at a restart'
            )

    def ensure_built(self) -> None:
        """Build the map unless the server has it; goes on until it is done or the node stops."""
        told, replaced = False, 0
        while self.place is not None and not self._stopping():
            try:
                if self.is_built and self._ontology.is_loaded():
                    return
                self.is_built = False
                self.place = self._build(self.place)
                self._end_contradiction()
            except ArmorServiceCallError as error:
                if not told and not self._stopping():
                    self._reports.warn(f'waiting for the armor server: {error}')
                    told = True
            except ArmorServiceInternalError as error:
                replaced += 1
                if not is_gone(error) or replaced >= MOST_REPLACED:
                    self._reports.failed(f'cannot build the map: {error}')
                    return
                # It was loaded, so this is another server, or somebody dropped it.
                self._reports.warn(f'the map is built again: {error}')
            else:
                self.is_built = True
                rooms, doors = len(self.place.rooms), len(self.place.doors)
                self._reports.info(f'the map is built: {rooms} rooms, {doors} doors')
                self._on_built()
                return

    def _build(self, place: Place) -> Place:
        if self._began is None:
            self._began = self._now()
        source = self._source
        built = self._ontology.build(
            place,
            source.path,
            source.uri,
            self._first_visit(),
            self._now(),
            (self._by_hand | self._entered) - _names(place),
        )
        if self._described is not None and self._entered != _names(built):
            # For whoever comes after it with another place.
            self._entered = _names(built)
            self._keep(built, self._by_hand)
        return built

    def _first_visit(self) -> int:
        if self._source.urgent_at_start or self._began is None:
            return never_visited(self._now())
        return self._began

    def end_contradiction(self) -> None:
        """Build an ontology that contradicts itself anew from what is known.

        What others asserted in it beside the map is lost; the robot's place and its visits are told
        again by those who know them. It is done once: a contradiction that is still there
        afterwards stands in the file, or somebody asserts it again and again.
        """
        try:
            self._end_contradiction()
        except ArmorServiceCallError:
            self.ensure_built()
        except ArmorServiceInternalError:
            # The ontology has gone; its loading or dropping is announced.
            pass

    def _end_contradiction(self) -> None:
        why = self._ontology.contradiction()
        if not why:
            self._gave_up_mending = False
            return
        if self.place is None or self._gave_up_mending:
            return
        self._gave_up_mending = True
        self._reports.warn(f'the ontology contradicts itself and is built again: {why}')
        self._ontology.forget()
        self.place = self._build(self.place)
        why = self._ontology.contradiction()
        if why:
            self._reports.refused(f'the ontology still contradicts itself: {why}')
        else:
            self._gave_up_mending = False

    def extend(self, notes: Sequence[RoomNote], robot_room: str) -> None:
        """Take in rooms that were described by a message; what was edited by hand stays so."""
        known = self.place.positions if self.place is not None else {}
        notes = [
            replace(note, position=known[note.name]) if note.name in self._by_hand else note
            for note in notes
            if note.name in known or note.name not in self._by_hand
        ]
        if robot_room in self._by_hand and robot_room not in known:
            robot_room = ''
        try:
            place = checked_names(extended(self.place, notes, robot_room))
        except PlaceError as error:
            self._reports.refused(f'the map that was sent is not used: {error}')
            return
        before, self.place = self.place, place
        if place != before:
            # Whoever described them may be gone when another process comes after this one.
            self._keep(place, self._by_hand)
        if before is not None and self.is_built:
            try:
                self._ontology.change(before, place, self._first_visit())
            except ArmorError as error:
                self._reports.warn(f'the map is built again: {error}')
            else:
                return
        self.is_built = False
        self.ensure_built()

    def edit(self, change: Callable[[Place], Place]) -> str:
        """Change the place and the ontology.

        Returns:
            What was wrong in one line, empty when it is done.
        """
        if self.place is None:
            return 'there is no map yet'
        before, by_hand = self.place, self._by_hand
        try:
            # First, as in `extend`: who learns of a new room from the ontology asks for its point.
            after = self.place = checked_names(change(before))
            edited = _differences(before, after)
            if edited:
                # Before the ontology has it: a builder that dies in between makes up for it.
                self._keep(after, by_hand | edited)
            self._ontology.change(before, after, self._first_visit())
        except PlaceError as error:
            self.place = before
            return str(error)
        except ArmorError as error:
            self.place = before
            if edited:
                self._keep(before, by_hand)
            return f'the ontology was not changed: {error}'
        return ''

    def without_room(self, place: Place, name: str) -> Place:
        """Return the place without a room, as a change for `edit`.

        Raises:
            PlaceError: The room cannot be removed; the robot's room never.
        """
        left = place.without_room(name)
        if name in self._ontology.robot_places():
            raise PlaceError(('map', name), 'the robot is in it, it cannot be removed')
        return left


def _names(place: Place) -> set[str]:
    return {*place.rooms, *place.doors}


def _differences(before: Place, after: Place) -> set[str]:
    """Return the rooms that are not the same in two places, and the doors that are gone."""
    old, new = (
        {room: (doors, place.positions[room]) for room, doors in place.rooms.items()}
        for place in (before, after)
    )
    rooms = {room for room in (*old, *new) if old.get(room) != new.get(room)}
    return rooms | (before.doors.keys() - after.doors.keys())
