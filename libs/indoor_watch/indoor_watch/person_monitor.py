"""Who is there: those who walk, by the lidar; those in pictures, by the camera; or nobody."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import cv2

from floor_plans import Grid
from indoor_watch.camera_floor import CameraFloor
from indoor_watch.doors import Segment
from indoor_watch.events import Event
from indoor_watch.floor import FloorView
from indoor_watch.hung_markers import CameraView
from indoor_watch.motion import WalkFinder
from indoor_watch.observations import Kind, Observation
from indoor_watch.person_places import is_passed, place_of
from indoor_watch.person_tracks import PersonTracks, Spot
from indoor_watch.persons import Person, Picture
from indoor_watch.visit import CameraShot, Coverage, LidarSweep, Pictured, Visit

WALKING = 0.8
"""Confidence that what walks is a person."""
BOTH = 5.0
"""Lidar and camera see the same person within this time, seconds."""
LOOKED = 0.6
"""Share of a place's floor that the lidar must have seen before nobody is said to walk there."""
SHOWN = 0.5
"""And that pictures must have shown before nobody is said to be there: a camera of 60 degrees that
looks to four sides from the middle of a room shows 53 %; the confidence says how much it was."""
LOOKED_SECONDS = 5.0
"""And for so long."""
FOUND = 0.88
"""Share of the persons in single photographs that are found (docs/explanation/noticing.md): so
sure are pictures of a whole floor that nobody is there."""
DOUBTED = 0.3
"""Confidence at most of whom the lidar sees through: below what a rule asks for."""
UNSURE = 0.5
"""Confidence of the lidar alone that nobody is there, at most: one who stands still is a thing."""


class PersonMonitor:
    """Notices persons by two sensors; owned by whoever calls it, one thread.

    Args:
        find: Finds the persons in a picture; None: the lidar sees those who walk.
        doors: The doors' openings, map frame, metres: their leaves move, too.
    """

    def __init__(
        self, find: Callable[[Picture], list[Person]] | None, doors: Iterable[Segment]
    ) -> None:
        self._find = find
        self._walks = WalkFinder(list(doors))
        self._tracks = PersonTracks()

    def begin(self) -> None:
        """Take that a visit begins."""
        self._walks.clear()
        self._tracks.begin()

    def take(self, sweep: LidarSweep, visit: Visit, normal: FloorView | None) -> list[Pictured]:
        """Return who walks; before the sweep is taken into the visit's floor.

        Args:
            sweep: Of the lidar.
            visit: Its floor so far tells where all was free.
            normal: What stands there normally; None: that is not known.
        """
        if visit.floor is None:
            return []
        met = sweep.points
        fresh = met[visit.floor.fresh(sweep.sensor, met)]
        if normal is not None and len(fresh):
            cells = normal.grid.cells_of(fresh)
            fresh = fresh[~normal.occupied[cells[:, 0], cells[:, 1]]]
        found = []
        for walk in self._walks.add(sweep.sensor, fresh, met, len(sweep.ends), sweep.stamp)[:1]:
            place = visit.place_of(walk.position)
            seen = Observation(Kind.PERSON, 'seen', place, '', walk.position, WALKING, sweep.stamp)
            found += _seen_by('lidar', seen, visit)
        return found

    def look(
        self, shot: CameraShot, visit: Visit, grid: Grid | None, *, is_lit: bool
    ) -> list[Pictured]:
        """Return who is in a picture."""
        if self._find is None:
            return []
        picture, camera = shot.picture, shot.camera
        found = self._find(picture)
        if is_lit:
            # Who stands in a dark room beside a lit doorway is not found.
            _note_shown(picture, camera, visit, grid)
        finds: list[tuple[float, Spot | None]] = []
        met = visit.things_met() if found and camera is not None else None
        ends = None if visit.sweep is None else visit.sweep.ends
        for each in found:
            where, sure = None, each.confidence
            if camera is not None and met is not None:
                where = place_of(each, camera, met)
                if ends is not None and where is None:
                    passed = is_passed(each, camera, ends, picture.shape[0])
                    sure = min(sure, DOUBTED) if passed else sure
            finds.append((sure, where))
        tracks = self._tracks.take(finds, shot.stamp)
        if not tracks:
            return []
        surest = tracks[0]
        place = visit.place if surest.position is None else visit.place_of(surest.position)
        seen = Observation(
            Kind.PERSON, 'seen', place, '', surest.position, surest.confidence, shot.stamp
        )
        return _seen_by('camera', seen, visit, _framed(picture, found))

    def leave(self, visit: Visit, coverage: Coverage) -> list[Pictured]:
        """Return that nobody was there, where a visit that ends saw enough of the floor."""
        is_long = coverage.ended - coverage.began >= LOOKED_SECONDS
        if not is_long or not coverage.share >= LOOKED or visit.people.count:
            return []
        # Who walks about between two pictures is seen by the lidar, and who stands in pictures.
        if coverage.camera_share >= SHOWN:
            state, sensor, sure = 'nobody', 'camera', FOUND * coverage.camera_share
        else:
            state, sensor, sure = 'nobody walks', 'lidar', min(UNSURE, coverage.share)
        stamp = coverage.ended
        return [
            Pictured(
                Observation(
                    Kind.PERSON, state, visit.place, confidence=sure, stamp=stamp, sensor=sensor
                )
            )
        ]

    def gone(
        self,
        current: Iterable[Event],
        visit: Visit,
        is_as_before: Callable[[tuple[float, float], FloorView], bool],
    ) -> list[int]:
        """Return the events of those of an earlier visit who stand no more where they stood.

        Where nobody knows where that was, pictures of this visit have to show nobody.

        Args:
            current: The events that go on.
            visit: One that showed nobody.
            is_as_before: Tells of a spot whether it looks as it normally does.
        """
        if visit.floor is None:
            return []
        now = visit.floor.view()
        is_pictured = visit.people.shown is not None or visit.people.shown_elsewhere
        return [
            event.number
            for event in current
            if (event.kind, event.seen, event.place) == (Kind.PERSON, 'seen', visit.place)
            and (is_pictured if event.position is None else is_as_before(event.position, now))
        ]


def _seen_by(
    sensor: str, seen: Observation, visit: Visit, picture: Picture | None = None
) -> list[Pictured]:
    """Return a person, with more confidence where the other sensor saw one there just now."""
    visit.people.count += 1
    seen = replace(seen, sensor=sensor)
    other = visit.people.by_sensor.get('camera' if sensor == 'lidar' else 'lidar')
    if other is not None and abs(seen.stamp - other.stamp) > BOTH:
        other = None
    if other is not None and seen.position is None:
        # The camera does not know where: it is who walks there.
        seen = replace(seen, place=other.place, position=other.position)
    visit.people.by_sensor[sensor] = seen
    both = other is not None and other.place == seen.place
    if other is not None and both:
        # They err for different reasons.
        sure = 1.0 - (1.0 - seen.confidence) * (1.0 - other.confidence)
        seen = replace(seen, confidence=sure)
    return [Pictured(seen, picture)] if visit.is_due(seen, 'both' if both else sensor) else []


def _note_shown(
    picture: Picture, camera: CameraView | None, visit: Visit, grid: Grid | None
) -> None:
    """Note the floor that a picture shows in which persons were looked for."""
    if camera is None or grid is None:
        visit.people.shown_elsewhere = True
        return
    if visit.people.shown is None:
        visit.people.shown = CameraFloor(grid)
    things = None if visit.floor is None else visit.floor.view().occupied
    rows, columns = picture.shape[:2]
    visit.people.shown.add(camera, (rows, columns), things)


def _framed(picture: Picture, persons: Sequence[Person]) -> Picture:
    """Return a picture with a frame around each person."""
    shown = picture.copy()
    for each in persons:
        left, top, width, height = each.box
        cv2.rectangle(shown, (left, top), (left + width, top + height), (0, 200, 0), 2)
    return shown
