"""Assembles a map from notes about single places, and says what does not fit.

Each marker describes one place: a point inside it, its doors, and the place behind each door. In a
complete map every door is described from both sides. While markers are missing or contradict each
other, `Survey.report` gives the reliable part: the places that can be reached from the robot's own
through doors on which both sides agree.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from floor_plans import Place

Position = tuple[float, float]

_SAME_POSITION = 0.05


@dataclass(frozen=True)
class PlaceNote:
    """What one marker says about a place.

    Attributes:
        room: Name of the place.
        position: A point inside it, metres, world frame.
        connections: The place behind each door.
    """

    room: str
    position: Position
    connections: Mapping[str, str]


@dataclass(frozen=True)
class SurveyReport:
    """The map that the notes describe together, and what is missing or wrong.

    Attributes:
        places: The places that can be patrolled, with the doors that lead to one another.
        robot_room: Where the robot is; empty when no note describes it.
        missing: Places that are named but that no marker describes, each with the doors that
            lead there.
        cut_off: Places that a marker describes but that cannot be reached from the robot's.
        contradictions: One sentence for each contradiction.
    """

    places: tuple[PlaceNote, ...]
    robot_room: str
    missing: Mapping[str, tuple[str, ...]]
    cut_off: tuple[str, ...]
    contradictions: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every place that is named is described, and everything fits."""
        return bool(
            self.places and not self.missing and not self.cut_off and not self.contradictions
        )

    def sentences(self) -> list[str]:
        """Return what is missing or wrong, one sentence each."""
        said = [
            f'no marker tells of {room}, to which {" and ".join(doors)} '
            f'lead{"s" if len(doors) == 1 else ""}'
            for room, doors in sorted(self.missing.items())
        ]
        if not self.robot_room:
            said.append('no marker tells of the place where the robot is')
        said += [f'{room} cannot be reached from {self.robot_room}' for room in self.cut_off]
        return said + list(self.contradictions)


class Survey:
    """Collects notes and judges them together.

    Args:
        robot_room: Where the robot is; empty when that is not known.
        robot_position: A point near which the robot is, used when its room is not known.
    """

    def __init__(self, robot_room: str = '', robot_position: Position | None = None) -> None:
        self.robot_room = robot_room
        self.robot_position = robot_position
        self._notes: dict[int, PlaceNote] = {}

    def note(self, marker_id: int, note: PlaceNote) -> None:
        """Take what a marker stands for; a later note for the same marker replaces it."""
        self._notes[marker_id] = note

    def to_json(self) -> dict[str, Any]:
        """Return what was noted, to be kept in a file."""
        notes = {
            str(marker_id): [note.room, list(note.position), dict(note.connections)]
            for marker_id, note in self._notes.items()
        }
        return {'notes': notes}

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `to_json` gave.

        Raises:
            KeyError, TypeError, ValueError: It is something else.
        """
        notes = {}
        for marker_id, (room, (x, y), doors) in kept['notes'].items():
            connections = {str(door): str(behind) for door, behind in doors.items()}
            notes[int(marker_id)] = PlaceNote(str(room), (float(x), float(y)), connections)
        self._notes.update(notes)

    def report(self) -> SurveyReport:
        """Judge all notes together."""
        contradictions: list[str] = []
        notes = self._by_room(contradictions)
        missing: dict[str, list[str]] = {}
        agreed: dict[str, dict[str, str]] = {room: {} for room in notes}
        overfull = self._doors_of_many(notes, contradictions)
        for room, note in notes.items():
            for door, behind in note.connections.items():
                if behind not in notes:
                    missing.setdefault(behind, []).append(door)
                elif door not in overfull:
                    back = notes[behind].connections.get(door)
                    if back == room:
                        agreed[room][door] = behind
                    elif back is None:
                        contradictions.append(
                            f'{room} has {door} to {behind}, but {behind} has no {door}'
                        )
                    elif room < behind or back not in notes:
                        contradictions.append(
                            f'{door} leads from {room} to {behind}, but from {behind} to {back}'
                        )
        start = self._start(notes)
        reached = _reached(start, agreed)
        return SurveyReport(
            tuple(
                PlaceNote(room, note.position, agreed[room])
                for room, note in notes.items()
                if room in reached
            ),
            start,
            {room: tuple(sorted(set(doors))) for room, doors in missing.items()},
            tuple(sorted(notes.keys() - reached)) if start else (),
            tuple(contradictions),
        )

    def _by_room(self, contradictions: list[str]) -> dict[str, PlaceNote]:
        """Return one note for each place: of several markers for one place the lowest id counts."""
        owners: dict[str, int] = {}
        for marker_id in sorted(self._notes):
            note = self._notes[marker_id]
            first = owners.setdefault(note.room, marker_id)
            if first == marker_id:
                continue
            other = self._notes[first]
            if math.dist(note.position, other.position) > _SAME_POSITION:
                contradictions.append(f'markers {first} and {marker_id} put {note.room} apart')
            if dict(note.connections) != dict(other.connections):
                contradictions.append(
                    f'markers {first} and {marker_id} give {note.room} different doors'
                )
        return {room: self._notes[marker_id] for room, marker_id in owners.items()}

    def _doors_of_many(
        self, notes: Mapping[str, PlaceNote], contradictions: list[str]
    ) -> frozenset[str]:
        rooms: dict[str, list[str]] = {}
        for room, note in notes.items():
            for door in note.connections:
                rooms.setdefault(door, []).append(room)
        overfull = {door: names for door, names in rooms.items() if len(names) > 2}
        for door, names in sorted(overfull.items()):
            contradictions.append(
                f'{door} cannot be in {", ".join(names)}: a door joins two places'
            )
        return frozenset(overfull)

    def _start(self, notes: Mapping[str, PlaceNote]) -> str:
        if self.robot_room:
            return self.robot_room if self.robot_room in notes else ''
        here = self.robot_position
        if here is None or not notes:
            return ''
        return min(notes, key=lambda room: math.dist(notes[room].position, here))


def _reached(start: str, agreed: Mapping[str, Mapping[str, str]]) -> frozenset[str]:
    if not start:
        return frozenset()
    reached, queue = {start}, deque([start])
    while queue:
        for other in agreed[queue.popleft()].values():
            if other not in reached:
                reached.add(other)
                queue.append(other)
    return frozenset(reached)


def notes_of(place: Place) -> tuple[PlaceNote, ...]:
    """Return a place that is described already, as notes."""
    notes = []
    for room, doors in place.rooms.items():
        behind = {door: other for door in doors for other in place.doors[door] if other != room}
        x, y, _ = place.positions[room]
        notes.append(PlaceNote(room, (x, y), behind))
    return tuple(notes)
