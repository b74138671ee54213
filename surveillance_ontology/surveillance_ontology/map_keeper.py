"""Keeps a place in the ontology: builds it, builds it again when the server lost it, changes it.

Everything here blocks while the server answers and belongs on a worker thread; `robot_room` alone
may be set from elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from surveillance_ontology.armor.client import ArmorServiceCallError, ArmorServiceInternalError
from surveillance_ontology.map_building import MapBuilding, RoomNote, extended
from surveillance_runtime.place import Place, PlaceError


@dataclass(frozen=True)
class Reports:
    """Where a `MapKeeper` says what happened; each is called with one line.

    Attributes:
        info: The map was built.
        warn: The server is not there yet; it is tried again.
        refused: A map that was sent is not used.
        failed: The map cannot be built at all, for example because the ontology is missing.
    """

    info: Callable[[str], None]
    warn: Callable[[str], None]
    refused: Callable[[str], None]
    failed: Callable[[str], None]


class MapKeeper:
    """The map of one reference.

    Args:
        building: Writes a place into the ontology.
        place: What is known at the start; None waits for `extend`.
        now: Time in whole seconds.
        stopping: Tells whether to give up.
        reports: Where to say what happened.
        on_built: Called each time the map is complete in the ontology.

    Attributes:
        place: The place as it is now.
        robot_room: Where the robot was last; used when the ontology does not know.
        is_built: The ontology holds the place, as far as is known.
    """

    def __init__(
        self,
        building: MapBuilding,
        place: Place | None,
        now: Callable[[], int],
        stopping: Callable[[], bool],
        reports: Reports,
        on_built: Callable[[], None],
    ) -> None:
        self._building = building
        self._now = now
        self._stopping = stopping
        self._reports = reports
        self._on_built = on_built
        self.place = place
        self.robot_room = place.start if place else ''
        self.is_built = False

    def ensure_built(self) -> None:
        """Build the map unless the server has it; goes on until it is done or the node stops."""
        told = False
        while self.place is not None and not self._stopping():
            try:
                if self.is_built and self._building.is_loaded():
                    return
                self.is_built = False
                self.place = self._building.build(self.place, self._now(), self.robot_room)
            except ArmorServiceCallError as error:
                if not told and not self._stopping():
                    self._reports.warn(f'waiting for the armor server: {error}')
                    told = True
            except ArmorServiceInternalError as error:
                self._reports.failed(f'cannot build the map: {error}')
                return
            else:
                self.is_built = True
                rooms, doors = len(self.place.rooms), len(self.place.doors)
                self._reports.info(f'the map is built: {rooms} rooms, {doors} doors')
                self._on_built()
                return

    def extend(self, notes: Sequence[RoomNote], robot_room: str) -> None:
        """Take in rooms that were described by a message."""
        try:
            place = extended(self.place, notes, robot_room)
        except PlaceError as error:
            self._reports.refused(f'the map that was sent is not used: {error}')
            return
        if robot_room or not self.robot_room:
            self.robot_room = place.start
        before, self.place = self.place, place
        if before is not None and self.is_built:
            try:
                self._building.change(before, place, self._now())
            except (ArmorServiceCallError, ArmorServiceInternalError) as error:
                self._reports.warn(f'the map is built anew: {error}')
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
        try:
            after = change(self.place)
            self._building.change(self.place, after, self._now())
        except PlaceError as error:
            return str(error)
        except (ArmorServiceCallError, ArmorServiceInternalError) as error:
            return f'the ontology was not changed: {error}'
        self.place = after
        return ''

    def without_room(self, place: Place, name: str) -> Place:
        """The place without a room, as a change for `edit`.

        Raises:
            PlaceError: The room cannot be removed; the robot's room never.
        """
        left = place.without_room(name)
        if self._building.robot_room() == name:
            raise PlaceError(('map', name), 'the robot is in it, it cannot be removed')
        return left
