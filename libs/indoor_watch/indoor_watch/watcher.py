"""What a robot notices as it goes about: sweeps and pictures in, observations and events out.

The floor is compared with what is normal, which the first look at each part of it decides; doors
are read over several sweeps; a picture is compared with the first one of the same viewpoint. The
rules say what of it matters. A thing must be seen in two assessments before it is told.
"""

from __future__ import annotations

import base64
import contextlib
import math
import zlib
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any, Generic, Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from floor_plans import Grid
from indoor_watch.camera_floor import CameraFloor
from indoor_watch.doors import Segment, read_door
from indoor_watch.events import ELSEWHERE, Event, EventBook, EventState
from indoor_watch.evidence import EvidenceStore, side_by_side, sweep_picture
from indoor_watch.floor import Change, FloorView, FloorVisit, ObjectChange, changes, is_leaf
from indoor_watch.habits import Habits
from indoor_watch.hung_markers import CameraView, HungMarkers, HungSpot, SeenMarker
from indoor_watch.motion import WalkFinder
from indoor_watch.observations import Kind, Observation
from indoor_watch.other_robots import OtherRobots
from indoor_watch.person_places import place_of
from indoor_watch.persons import Person, Picture
from indoor_watch.reference_views import ReferenceViews, Viewpoint
from indoor_watch.views import Grey, Sight, grey_of, light_of, sight_of, view_changes
from indoor_watch.watch_rules import Level, WatchRule, severity_of
from indoor_watch.ways import Ways

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]

DOOR_RANGE = 6.0
"""Doors are read from here on, metres: farther away too few beams meet them."""
READINGS = 5
"""A door's state is that of most of so many readings, of which `AGREEING` must agree."""
AGREEING = 4
FEWEST_SWEEPS = 5
SAME_THING = 0.4
"""Two assessments mean one thing up to here, metres."""
MOST_CELLS = 25_000_000
"""Of the largest map on which a robot watches."""
SPOT, SPOT_FREE = 0.15, 0.8
"""A thing is gone when so many cells are free so far around where it stood, metres."""
OTHER_SIDES = 0.6
"""What is hidden so near to a new thing may be its other sides, metres."""
SEEN_AGAIN = 10.0
"""What goes on is told again after this time, seconds."""
MOST_LIT = 500
"""Of so many places it is kept how light they were."""
AGREED_PICTURES = 3
"""A dark or covered view, and an unknown marker, must be seen in so many pictures in a row."""
AGREED_SECONDS = 4.0
"""Or in two of one stay that are as far apart as so many usually are, seconds: a busy machine looks
at few of them."""
SET_BACK = 30.0
"""A clock that is earlier by more was set back, seconds: work may wait for so long."""
ONE_LOOK, SEEN_TWICE = 0.5, 0.95
"""Confidence in a changed view after one look, at most, and after two, at least: a third is not
waited for."""
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
LONGEST_STAND = 120.0
"""A robot that stands for longer begins another look, seconds. A thing is told once it was met in
three tenths of the sweeps of a look: so within 40 s, however long the robot stands. A whole look,
which takes 30 s (docs/watching.md), is not cut."""
FOUND = 0.88
"""Share of the persons in single photographs that are found (docs/watching.md): so sure are
pictures of a whole floor that nobody is there."""
UNSURE = 0.5
"""Confidence of the lidar alone that nobody is there, at most: one who stands still is a thing."""
BESIDE = 0.3
"""A point so far from a door, or a marker, is in the place on its side, metres."""
BEFORE_MARKER, ASIDE = 0.4, 0.25
"""What the lidar meets so far before a marker and so near to the line of sight hides it, metres."""
MOST_HELD = 8
"""So many pictures wait until it is known whether the lens is covered."""
BEHIND = 0.3
"""Depth of what stands in a way, metres."""


_Value = TypeVar('_Value')
_MarkerPicture = tuple[Picture, Viewpoint | None, float, Sequence[SeenMarker], CameraView]
"""A picture, from where it was taken, when, the markers in it, and where on the map that was."""


class _Agreement(Generic[_Value]):
    """What the last pictures say, and whether they agree on it."""

    def __init__(self) -> None:
        self._last: deque[tuple[_Value, int, float]] = deque(maxlen=AGREED_PICTURES)

    def take(self, value: _Value, look: int, stamp: float) -> bool:
        """Take what a picture of a stay says; tell whether that is settled."""
        self._last.append((value, look, stamp))
        if len(self._last) == AGREED_PICTURES and all(each[0] == value for each in self._last):
            return True
        return any(
            before == value and stay == look and stamp - taken >= AGREED_SECONDS
            for before, stay, taken in list(self._last)[-2:-1]
        )


@dataclass
class _Door:
    segment: Segment
    readings: deque[tuple[str, float]] = field(default_factory=lambda: deque(maxlen=READINGS))
    told: str = ''
    told_at: float = -math.inf
    look: int = -1
    place: str = ''


class Rooms(Protocol):
    """Which place is where."""

    def place_at(self, point: Sequence[float]) -> str | None:
        """Return the place that a point of the map lies in; None: in none."""

    def cells_of(self, place: str) -> Mask | None:
        """Return the cells of a place, shape as the map's; None where it has none."""


@dataclass(frozen=True)
class Look:
    """What was looked at in one stay at a place.

    Attributes:
        place: The place.
        began, ended: Seconds since 1970.
        share: Part of its floor that the lidar saw, 0 to 1; nan where the map does not show it.
        area: Of that part, square metres.
        pictures: How many were looked at.
        camera_share: Part of its floor where a person would have been in a picture that was looked
            at for persons, 0 to 1; nan where that is not known.
    """

    place: str
    began: float
    ended: float
    share: float
    area: float
    pictures: int
    camera_share: float = math.nan

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values; a share that is not known is missing."""
        values = {
            'place': self.place,
            'began': round(self.began, 3),
            'ended': round(self.ended, 3),
            'area': round(self.area, 2),
            'pictures': self.pictures,
        }
        shares = {'share': self.share, 'camera_share': self.camera_share}
        return values | {k: round(v, 3) for k, v in shares.items() if not math.isnan(v)}


class Watcher:
    """Notices, by the rules of a person.

    Args:
        rules: What matters.
        book: Joins what was seen to events.
        local: Returns the local time of a stamp.
        tell: Called with each observation.
        alert: Called with each event of level ALERT that lasts as long as its rule wants.
        doors: The doors' openings by name, map frame, metres.
        robot: Whose observations they are.
        markers: The ids that hang here, and where, map frame, metres; None: that is learned. Empty:
            all that is seen is known.
        rooms: Which place is where; None: a thing is in the robot's place.
        ways_of: Returns the ways of a map; None: no way is looked at.
        find_persons: Finds the persons in a picture; None: the lidar sees those who walk.
        looked: Called with each stay at a place when it ends.
        store: Keeps pictures; None: nothing is kept.
        views: How each viewpoint looks normally.
        verify_seconds: An alert that is not sure waits so long for a second look.
        others: The other robots of a fleet, which are no news; None: there are none.
    """

    def __init__(
        self,
        rules: Sequence[WatchRule],
        book: EventBook,
        *,
        local: Callable[[float], datetime],
        robot: str,
        tell: Callable[[Observation], object] = lambda _: None,
        alert: Callable[[Event], object] = lambda _: None,
        doors: Mapping[str, Segment] | None = None,
        markers: Mapping[int, tuple[float, float, float] | None] | None = None,
        rooms: Rooms | None = None,
        ways_of: Callable[[Grid], Ways] | None = None,
        find_persons: Callable[[Picture], list[Person]] | None = None,
        looked: Callable[[Look], object] = lambda _: None,
        store: EvidenceStore | None = None,
        views: ReferenceViews | None = None,
        verify_seconds: float = 0.0,
        others: OtherRobots | None = None,
    ) -> None:
        self.rules = tuple(rules)
        self.book = book
        self._local, self._tell, self._alert = local, tell, alert
        self._doors = {name: _Door(segment) for name, segment in (doors or {}).items()}
        self._known_markers = frozenset(markers or ())
        self._markers = HungMarkers(
            {number: where for number, where in (markers or {}).items() if where is not None}
        )
        self._rooms, self._ways_of = rooms, ways_of
        self._find_persons, self._looked = find_persons, looked
        self._ways: Ways | None = None
        self._walks = WalkFinder([each.segment for each in self._doors.values()])
        self._verify_seconds = verify_seconds
        self._others = others
        self._doubts: dict[int, float] = {}
        self._habits = Habits()
        self._persons = 0
        # The last person of this stay whom each sensor saw.
        self._person_by: dict[str, Observation] = {}
        self._began = math.nan
        self._pictures = 0
        # What the pictures of this stay showed, once persons were looked for in one; and whether in
        # one of which nobody knows from where it was taken.
        self._shown: CameraFloor | None = None
        self._shown_elsewhere = False
        self._store = store
        self._robot = robot
        self._place = ''
        self._look = 0
        self._latest = math.inf
        self._grid: Grid | None = None
        self._visit: FloorVisit | None = None
        self._normal: FloorView | None = None
        self._kept: Mapping[str, Any] = {}
        self._candidates: list[ObjectChange] = []
        self._told: dict[tuple[str, ...], tuple[float, tuple[float, float] | None]] = {}
        self._last: tuple[tuple[float, float], Points] = ((0.0, 0.0), np.zeros((0, 2)))
        self._at: tuple[float, float] | None = None
        # Where the robot stands, and since when.
        self._stands: tuple[tuple[float, float] | None, float] = None, math.nan
        self._views = views or ReferenceViews()
        # Pictures of this stay whose markers are judged once it is clear what else they show.
        self._held: list[_MarkerPicture] = []
        self._saw_clearly = False
        self._strange: dict[int, _Agreement[bool]] = {}
        self._sights: _Agreement[Sight] = _Agreement()
        self._sight: Sight | None = None
        self._lights: dict[str, _Agreement[str]] = {}
        self._light = ''

    # --- the floor and its doors ---

    def use_map(self, grid: Grid) -> None:
        """Take the map; what was normal on another one is forgotten."""
        if self._grid is not None and same_map(self._grid, grid):
            return
        self._grid = grid
        self._visit, self._normal, self._candidates = None, None, []
        self._shown = None
        self._ways = None if self._ways_of is None else self._ways_of(grid)
        for door in self._doors.values():
            door.place = ''
        if self._kept:
            self._normal = _unpacked(self._kept, grid)

    def arrive(self, place: str, stamp: float) -> None:
        """Take that the robot is in a place; the visit of another one ends."""
        if place != self._place:
            self._compare(stamp)
            self._begin_look(place, stamp)

    def _begin_look(self, place: str, stamp: float) -> None:
        """End the look at the place before, and begin one at this place."""
        self._end_look(stamp)
        self._learn()
        self._place = place
        self._began, self._pictures, self._persons = stamp, 0, 0
        self._stands = self._at, stamp
        self._shown, self._shown_elsewhere = None, False
        self._person_by = {}
        self._walks.clear()
        # Told anew in each place, of which a short stay may give one picture alone.
        self._sight = None
        self._light = ''
        self._held, self._saw_clearly = [], False
        self._look += 1
        self._visit = None
        self._candidates = []
        self._told = {}
        for door in self._doors.values():
            door.readings.clear()

    def _end_look(self, stamp: float) -> None:
        """Tell what was in view, and that nobody was there, by what saw the floor."""
        if not self._place or math.isnan(self._began):
            return
        look = self.look(stamp)
        self._looked(look)
        is_long = look.ended - look.began >= LOOKED_SECONDS
        if not is_long or not look.share >= LOOKED or self._persons:
            return
        # Who walks about between two pictures is seen by the lidar, and who stands in pictures.
        if look.camera_share >= SHOWN:
            state, sensor, sure = 'nobody', 'camera', FOUND * look.camera_share
        else:
            state, sensor, sure = 'nobody walks', 'lidar', min(UNSURE, look.share)
        self._take(
            Observation(
                Kind.PERSON, state, self._place, confidence=sure, stamp=stamp, sensor=sensor
            )
        )
        self._end_persons(stamp)

    def _end_persons(self, stamp: float) -> None:
        """End the events of those of an earlier look who do not stand any more where they stood.

        Where nobody knows where that was, pictures of this look have to show nobody.
        """
        if self._visit is None or self._normal is None:
            return
        now = self._visit.view()
        is_pictured = self._shown is not None or self._shown_elsewhere
        for event in self.book.current:
            if (event.kind, event.seen, event.place) != (Kind.PERSON, 'seen', self._place):
                continue
            if event.position is None:
                is_over = is_pictured
            else:
                is_over = self._is_free(now, event.position) and not self._stands_anew(
                    now, event.position
                )
            if is_over:
                self.book.end(event.number, stamp)

    def look(self, stamp: float) -> Look:
        """Return what was in view since the robot came here."""
        share = shown = math.nan
        area = 0.0
        floor = None if self._rooms is None else self._rooms.cells_of(self._place)
        if floor is not None and self._grid is not None and floor.shape == self._grid.cells.shape:
            seen, cells = 0, max(1, int(floor.sum()))
            if self._visit is not None and self._visit.sweeps:
                seen = int((floor & self._visit.view().seen).sum())
            share = seen / cells
            area = seen * self._grid.resolution**2
            if self._shown is not None:
                shown = int((floor & self._shown.seen).sum()) / cells
            elif not self._shown_elsewhere:
                shown = 0.0
        return Look(self._place, self._began, stamp, share, area, self._pictures, shown)

    def _place_of(self, point: tuple[float, float]) -> str:
        """Return where a thing lies that was seen, perhaps through a doorway."""
        found = None if self._rooms is None else self._rooms.place_at(point)
        return found or self._place

    def _walk(self, sensor: tuple[float, float], ends: Points, met: Mask, stamp: float) -> None:
        """Tell of what walks; before the sweep is taken into the visit."""
        assert self._visit is not None
        fresh = ends[met]
        fresh = fresh[self._visit.fresh(sensor, fresh)]
        if self._normal is not None and len(fresh):
            cells = self._normal.grid.cells_of(fresh)
            fresh = fresh[~self._normal.occupied[cells[:, 0], cells[:, 1]]]
        for walk in self._walks.add(sensor, fresh, ends[met], len(ends), stamp)[:1]:
            place = self._place_of(walk.position)
            seen = Observation(Kind.PERSON, 'seen', place, '', walk.position, WALKING, stamp)
            self._see_person('lidar', seen)

    def _see_person(self, sensor: str, seen: Observation, picture: Picture | None = None) -> None:
        """Tell of a person, with more confidence where the other sensor saw one there just now."""
        self._persons += 1
        seen = replace(seen, sensor=sensor)
        other = self._person_by.get('camera' if sensor == 'lidar' else 'lidar')
        if other is not None and abs(seen.stamp - other.stamp) > BOTH:
            other = None
        if other is not None and seen.position is None:
            # The camera does not know where: it is who walks there.
            seen = replace(seen, place=other.place, position=other.position)
        self._person_by[sensor] = seen
        both = other is not None and other.place == seen.place
        if other is not None and both:
            # They err for different reasons.
            sure = 1.0 - (1.0 - seen.confidence) * (1.0 - other.confidence)
            seen = replace(seen, confidence=sure)
        if self._is_due(seen, 'both' if both else sensor):
            self._take(seen, picture)

    def sweep(self, sensor: tuple[float, float], ends: Points, met: Mask, stamp: float) -> None:
        """Take a sweep of the lidar.

        Args:
            sensor: Where it was, map frame, metres.
            ends: Where beams ended, (n, 2), same frame.
            met: Whether something was met there, (n,).
            stamp: Seconds since 1970.
        """
        self._heed_clock(stamp)
        if self._others is not None:
            apart = self._others.apart(ends, stamp)
            ends, met = ends[apart], met[apart]
        self._last, self._at = (sensor, ends[met]), sensor
        if self._stands[0] is None or math.dist(sensor, self._stands[0]) > ELSEWHERE:
            self._stands = sensor, stamp
        if self._grid is not None:
            if self._visit is None:
                self._visit = FloorVisit(self._grid)
            self._walk(sensor, ends, met, stamp)
            self._visit.add(sensor, ends, met, stamp)
        for name, door in self._doors.items():
            x1, y1, x2, y2 = door.segment
            middle = (x1 + x2) / 2, (y1 + y2) / 2
            if math.dist(middle, sensor) > DOOR_RANGE:
                continue
            reading = read_door(door.segment, sensor, ends)
            if reading is not None:
                door.readings.append((str(reading.state), reading.confidence))
                self._judge(name, door, middle, stamp)

    def _judge(self, name: str, door: _Door, middle: tuple[float, float], stamp: float) -> None:
        states = [state for state, _ in door.readings]
        state = max(set(states), key=states.count)
        if states.count(state) < AGREEING:
            return
        door.look = self._look
        if state == door.told and abs(stamp - door.told_at) < SEEN_AGAIN:
            return
        sure = float(np.mean([sure for each, sure in door.readings if each == state]))
        door.told, door.told_at = state, stamp
        place = self._place_of_door(door)
        self._take(Observation(Kind.DOOR, state, place, name, middle, sure, stamp))

    def _place_of_door(self, door: _Door) -> str:
        """Return the smaller of the two places that a door joins, which is the one it closes."""
        if self._rooms is None:
            return self._place
        if not door.place:
            x1, y1, x2, y2 = door.segment
            scale = BESIDE / max(math.dist(door.segment[:2], door.segment[2:]), 1e-9)
            across = (y1 - y2) * scale, (x2 - x1) * scale
            sizes = {}
            for sign in (1.0, -1.0):
                side = (x1 + x2) / 2 + sign * across[0], (y1 + y2) / 2 + sign * across[1]
                place = self._rooms.place_at(side)
                floor = None if place is None else self._rooms.cells_of(place)
                if place is not None and floor is not None:
                    sizes[place] = int(floor.sum())
            door.place = min(sizes, key=lambda each: sizes[each], default='')
        return door.place or self._place

    def assess(self, stamp: float) -> None:
        """Compare what this look saw so far with what is normal; call it every few seconds.

        A robot that stands for long, as at its dock, ends its look and begins another one.
        """
        self._heed_clock(stamp)
        self._compare(stamp)
        # A clock that was set back is no reason to stand for ever.
        if self._place and not 0.0 <= stamp - self._stands[1] < LONGEST_STAND:
            self._begin_look(self._place, stamp)

    def _heed_clock(self, stamp: float) -> None:
        """Have no event be of the future, where the clock was set back, perhaps before a start."""
        if stamp < self._latest - SET_BACK:
            self.book.set_back(stamp)
            self._latest = stamp
        self._latest = max(self._latest, stamp)

    def _compare(self, stamp: float) -> None:
        """Compare what this look saw so far with what is normal."""
        if self._visit is None or self._visit.sweeps < FEWEST_SWEEPS or self._normal is None:
            return
        now = self._visit.view()
        found = [each for each in changes(self._normal, now) if not self._at_door(each.points)]
        for each in found:
            if not self._is_candidate(each):
                continue
            observation = Observation(
                Kind.OBJECT,
                str(each.change),
                # A thing seen through a doorway is where it lies.
                self._place_of(each.position),
                position=each.position,
                confidence=each.confidence,
                stamp=stamp,
                compared_with='' if each.before is None else '{:.2f} {:.2f}'.format(*each.before),
            )
            if self._is_due(observation):
                self._take(observation)
        self._look_at_ways(now, found, stamp)
        self._candidates = found
        self._end_gone(now, found, stamp)

    def _look_at_ways(self, now: FloorView, found: Sequence[ObjectChange], stamp: float) -> None:
        """Tell of the ways that are blocked by what was seen in two assessments."""
        new = [
            each.points
            for each in found
            if each.change != Change.REMOVED and self._is_candidate(each)
        ]
        if self._ways is None or self._grid is None or self._normal is None or not new:
            return
        things = self._normal.occupied.copy()
        before = {(each.door, each.place) for each in self._ways.blocked(things)}
        cells = self._grid.cells_of(np.concatenate(new))
        things[cells[:, 0], cells[:, 1]] = True
        # Of a thing its front alone is seen: what lies hidden just behind it is taken for it, too.
        away = ndimage.distance_transform_edt(~things) * self._grid.resolution
        things |= (away < BEHIND) & ~now.free
        for each in self._ways.blocked(things):
            if (each.door, each.place) not in before:
                place = each.place or self._place_of(each.position)
                seen = Observation(Kind.WAY, 'blocked', place, each.door, each.position, 0.9, stamp)
                if self._is_due(seen):
                    self._take(seen)

    def _is_candidate(self, thing: ObjectChange) -> bool:
        """Tell whether the assessment before found a thing, too."""
        return any(
            before.change == thing.change
            and math.dist(before.position, thing.position) < SAME_THING
            for before in self._candidates
        )

    def _end_gone(self, now: FloorView, found: Sequence[ObjectChange], stamp: float) -> None:
        """End the events of things whose spot was in view, and is as before."""
        for event in self.book.current:
            if event.kind not in (Kind.OBJECT, Kind.WAY) or event.position is None:
                continue
            if any(math.dist(each.position, event.position) < 2 * SAME_THING for each in found):
                continue
            if event.seen == Change.REMOVED:
                is_over = bool(now.grid.at(now.occupied, *event.position))
            else:
                # Its spot is free, and nothing stands around it that never did: a beam that grazes
                # a thing passes through a cell of it, and its other sides may look like little.
                is_over = self._is_free(now, event.position) and not self._stands_anew(
                    now, event.position
                )
            if is_over:
                self.book.end(event.number, stamp)

    def _is_free(self, now: FloorView, position: tuple[float, float]) -> bool:
        """Tell whether beams passed through nearly all of a thing's spot."""
        row, column = now.grid.cell_of(*position)
        reach = max(1, round(SPOT / now.grid.resolution))
        if not now.grid.contains(np.array([[row, column]]))[0]:
            return False  # of an event that was seen on another map
        spot = now.free[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) :][
            :, : 2 * reach + 1
        ]
        return bool(spot.size and spot.mean() >= SPOT_FREE)

    def _stands_anew(self, now: FloorView, position: tuple[float, float]) -> bool:
        """Tell whether beams ended near a point where nothing is normal."""
        assert self._normal is not None
        rows, columns = np.nonzero(now.occupied & ~self._normal.occupied)
        if not len(rows):
            return False
        centres = now.grid.centres_of(np.column_stack([rows, columns]))
        return bool((np.hypot(*(centres - position).T) < SAME_THING).any())

    def _learn(self) -> None:
        """Take what was in view for the first time as normal."""
        if self._visit is None or self._visit.sweeps < FEWEST_SWEEPS:
            return
        now = self._visit.view()
        if self._normal is None:
            self._normal = now
            return
        new = ~self._normal.seen
        there = [each.points for each in self._candidates if each.change != Change.REMOVED]
        there += [
            np.array([event.position])
            for event in self.book.current
            if event.kind == Kind.OBJECT and event.position
        ]
        # The other sides of what is new are seen for the first time, too, and are not normal.
        things = np.zeros_like(new)
        if there:
            # Events outlive the map that they were seen on.
            cells = now.grid.cells_of(np.concatenate(there))
            cells = cells[now.grid.contains(cells)]
            things[cells[:, 0], cells[:, 1]] = True
        if things.any():
            away = ndimage.distance_transform_edt(~things) * now.grid.resolution
            new &= away > OTHER_SIDES
        self._normal = replace(
            self._normal,
            occupied=self._normal.occupied | (now.occupied & new),
            free=self._normal.free | (now.free & new),
            moving=np.zeros_like(now.moving),
        )

    def _at_door(self, points: Points) -> bool:
        """Tell whether a thing may be a door's leaf, which is the door's own matter."""
        for door in self._doors.values():
            width = math.dist(door.segment[:2], door.segment[2:])
            for hinge in (door.segment[:2], door.segment[2:]):
                if is_leaf(points, hinge, width):
                    return True
        return False

    # --- the camera ---

    def picture(
        self,
        picture: Picture,
        viewpoint: Viewpoint | None,
        stamp: float,
        markers: Sequence[SeenMarker] | None,
        camera: CameraView | None = None,
    ) -> None:
        """Take a picture.

        Args:
            picture: (rows, columns) of grey bytes, or (rows, columns, 3) of BGR.
            viewpoint: Where the camera is: x, y in metres, then angles in radians; None while it
                moves.
            stamp: Seconds since 1970.
            markers: The markers in it; None: nobody looked for markers.
            camera: From where on the map it was taken; None: that is not known, and nothing is said
                of markers.
        """
        grey = grey_of(picture)
        self._pictures += 1
        sight = sight_of(grey)
        settled = self._sights.take(sight, self._look, stamp)
        light = light_of(grey, sight)
        if light and self._lit(light, stamp) and light != self._light:
            self._light = light
            self._take(Observation(Kind.LIGHT, light, self._place, stamp=stamp), grey)
        if settled and sight != self._sight:
            self._sight = sight
            if sight != Sight.DARK:
                view = 'blocked' if sight == Sight.BLOCKED else 'clear'
                self._take(Observation(Kind.VIEW, view, self._place, stamp=stamp), grey)
        told = None
        if camera is not None and markers is not None:
            told = picture, viewpoint, stamp, markers, camera
        self._saw_clearly |= sight == Sight.CLEAR
        if told is not None and sight == Sight.BLOCKED and self._saw_clearly:
            # A bare wall, or a covered lens: what the stay shows before and after tells which.
            self._held = [*self._held, told][-MOST_HELD:]
        if sight != Sight.CLEAR:
            return
        self._look_for_persons(picture, camera, stamp, is_lit=light == 'on')
        self._look_for_strange(markers or (), stamp, grey)
        held, self._held = self._held, []
        for each in (*held, *([] if told is None else [told])):
            self._judge_markers(*each)
        if viewpoint is None:
            return
        at = viewpoint[0], viewpoint[1]
        if self._others is not None and self._others.may_be_seen(at, stamp):
            return
        doors = self._doors_near(at)
        if self._views.awaits(viewpoint, doors):
            return  # how a door stood in an earlier visit does not tell how it stands now
        known = self._views.at(viewpoint, doors)
        if known is None:
            # Who walks about here is no part of how it looks normally.
            if not self._persons:
                self._views.add(viewpoint, picture, stamp, doors)
            return
        if self._persons:
            return  # it is they who change the view
        differences = view_changes(known.picture, picture)
        things = [each for each in differences or () if not each.may_be_light]
        if differences is not None:
            doubtful = [each.box for each in differences if each.may_be_light]
            known.note([each.box for each in things], doubtful, self._look)
        again = [each for each in things if known.lasts(each.box, self._look)]
        if differences == []:
            current = {(each.kind, each.subject) for each in self.book.current}
            if (Kind.VIEW, known.name) in current:
                self._take(Observation(Kind.VIEW, 'clear', self._place, known.name, stamp=stamp))
        for change in (again or differences or [])[:1]:
            # Shadows wander and people leave: one look alone is no reason to call anybody.
            sure = change.confidence if again else min(change.confidence, ONE_LOOK)
            observation = Observation(
                Kind.VIEW,
                'changed',
                self._place,
                known.name,
                (viewpoint[0], viewpoint[1]),
                confidence=max(sure, SEEN_TWICE) if again else sure,
                stamp=stamp,
                compared_with=f'{known.stamp:.0f}',
            )
            if self._is_due(observation):
                self._take(observation, picture, known.picture)

    def _lit(self, light: str, stamp: float) -> bool:
        """Take how light a picture of this place is; tell whether the last ones of it agree.

        A short stay has one or two pictures: those of earlier stays count, too.
        """
        lights = self._lights.pop(self._place, None) or _Agreement()
        self._lights[self._place] = lights
        for oldest in list(self._lights)[:-MOST_LIT]:
            del self._lights[oldest]
        return lights.take(light, self._look, stamp)

    def _doors_near(self, point: tuple[float, float]) -> dict[str, str]:
        """Return the states of the doors near a point, of those that this visit has seen."""
        near = {}
        for name, door in self._doors.items():
            x1, y1, x2, y2 = door.segment
            if (
                door.told
                and door.look == self._look
                and math.dist(((x1 + x2) / 2, (y1 + y2) / 2), point) <= DOOR_RANGE
            ):
                near[name] = door.told
        return near

    def _look_for_persons(
        self, picture: Picture, camera: CameraView | None, stamp: float, *, is_lit: bool
    ) -> None:
        if self._find_persons is None:
            return
        found = self._find_persons(picture)
        if is_lit:
            # Who stands in a dark room beside a lit doorway is not found.
            self._note_shown(picture, camera)
        if not found:
            return
        surest = found[0]
        where = None if camera is None else place_of(surest, camera, self._things_met())
        place = self._place if where is None else self._place_of(where)
        seen = Observation(Kind.PERSON, 'seen', place, '', where, surest.confidence, stamp)
        shown = picture.copy()
        for each in found:
            left, top, width, height = each.box
            cv2.rectangle(shown, (left, top), (left + width, top + height), (0, 200, 0), 2)
        self._see_person('camera', seen, shown)

    def _note_shown(self, picture: Picture, camera: CameraView | None) -> None:
        """Note the floor that a picture shows in which persons were looked for."""
        if camera is None or self._grid is None:
            self._shown_elsewhere = True
            return
        if self._shown is None:
            self._shown = CameraFloor(self._grid)
        things = None if self._visit is None else self._visit.view().occupied
        rows, columns = picture.shape[:2]
        self._shown.add(camera, (rows, columns), things)

    def _things_met(self) -> Points:
        """Return the ends of the last sweep that no wall of the map explains, (n, 2)."""
        sensor, met = self._last
        if self._visit is None or not len(met):
            return met
        return met[~self._visit.of_wall(met, np.linalg.norm(met - np.asarray(sensor), axis=1))]

    def _look_for_strange(self, seen: Sequence[SeenMarker], stamp: float, grey: Grey) -> None:
        """Tell of markers that no file knows, once several pictures in a row show them."""
        if not self._known_markers:
            return
        numbers = {each.number for each in seen} - self._known_markers
        # One that has moved is that, and no longer merely unknown.
        numbers -= {int(each) for each in self._misplaced()}
        self._strange = {
            number: self._strange.get(number, _Agreement[bool]()) for number in numbers
        }
        for number, pictures in self._strange.items():
            if pictures.take(True, self._look, stamp):
                where = self._at
                strange = Observation(
                    Kind.MARKER, 'unknown', self._place, str(number), where, 0.9, stamp
                )
                if self._is_due(strange):
                    self._take(strange, grey)

    def _judge_markers(
        self,
        picture: Picture,
        viewpoint: Viewpoint | None,
        stamp: float,
        seen: Sequence[SeenMarker],
        camera: CameraView,
    ) -> None:
        """Tell of the markers that hang no longer where they hung."""
        normal = None if viewpoint is None else self._views.at(viewpoint)
        before = None if normal is None else normal.picture
        others = self._others
        hidden = bool(self._persons) or (
            others is not None
            and others.may_be_seen((float(camera.at[0]), float(camera.at[1])), stamp)
        )

        def is_clear(point: Points) -> bool:
            return not hidden and not self._stands_before(camera, point)

        current = self._misplaced()
        for each in self._markers.take(picture, camera, seen, self._look, is_clear):
            if each.state == 'here' and str(each.number) not in current:
                continue
            x, y, _ = each.position
            # It hangs on a wall, which belongs to the place before it.
            away = math.dist((x, y), camera.at[:2])
            part = min(1.0, BESIDE / max(away, 1e-9))
            front = x + part * (camera.at[0] - x), y + part * (camera.at[1] - y)
            if self._rooms is not None and self._rooms.place_at(front) is None:
                continue  # nothing hangs off the map: it was measured wrongly
            place, number = self._place_of(front), str(each.number)
            told = Observation(Kind.MARKER, each.state, place, number, (x, y), SEEN_TWICE, stamp)
            if self._is_due(told):
                self._take(told, picture, before)

    def _misplaced(self) -> set[str]:
        """Return the markers that hang otherwise than they did, as the events say."""
        return {
            each.subject
            for each in self.book.current
            if each.kind == Kind.MARKER and each.seen != 'unknown'
        }

    def _stands_before(self, camera: CameraView, point: Points) -> bool:
        """Tell whether the lidar met something between a camera and a marker."""
        _, met = self._last
        if not len(met):
            return False
        start = camera.at[:2]
        sight = point[:2] - start
        length = float(np.hypot(*sight))
        ahead = sight / max(length, 1e-9)
        along = (met - start) @ ahead
        aside = np.abs((met - start) @ np.array([-ahead[1], ahead[0]]))
        return bool(((along > 0.0) & (along < length - BEFORE_MARKER) & (aside < ASIDE)).any())

    def answer(self, number: int, state: EventState) -> Event:
        """Take a person's word about an event; a view that is normal now is learned anew.

        Raises:
            KeyError, ValueError: See `EventBook.answer`.
        """
        event = self.book.answer(number, state)
        if state == EventState.NORMAL and event.kind == Kind.VIEW and event.subject:
            self._views.forget(event.subject)
        is_marker = event.kind == Kind.MARKER and event.seen != 'unknown'
        if state == EventState.NORMAL and is_marker:
            self._markers.accept(int(event.subject))
        return event

    def pass_by(self, pose: Points, seen: Sequence[SeenMarker]) -> None:
        """Take markers that were read in passing, see `HungMarkers.pass_by`."""
        self._markers.pass_by(pose, seen)

    def spots(self) -> list[HungSpot]:
        """Return where markers hang, as far as that is known."""
        return self._markers.spots()

    # --- what is made of it ---

    def _is_due(self, seen: Observation, sensor: str = '') -> bool:
        """Tell whether a thing was not told of a moment ago, or from elsewhere, or otherwise."""
        cell = [] if seen.position is None else [str(round(each)) for each in seen.position]
        key = (seen.kind, seen.state, seen.subject, sensor, *cell)
        stamp, at = self._told.get(key, (-math.inf, None))
        if abs(seen.stamp - stamp) < SEEN_AGAIN:
            here = self._at
            if at is None or here is None or math.dist(at, here) < ELSEWHERE:
                return False
        self._told[key] = seen.stamp, self._at
        return True

    def _take(
        self, seen: Observation, picture: Picture | None = None, before: Picture | None = None
    ) -> None:
        """Take an observation, with a picture of it and of how it looks normally."""
        seen = replace(seen, usual=self._habits.usual(seen))
        self._habits.learn(seen, self._look)
        severity, rule = severity_of(self.rules, seen, self._local(seen.stamp))
        evidence = kind = ''
        if self._store is not None and severity:
            if picture is None and seen.position is not None and self._grid is not None:
                picture, kind = self._met_picture(seen.position, self._grid), 'sweep-'
                before = self._normal_picture(seen.position)
            if picture is not None:
                if before is not None:
                    picture = side_by_side(before, picture)
                what = f'{kind}{seen.kind}-{seen.subject or seen.place}-{seen.state}'
                evidence = self._store.keep(picture, what, severity, seen.stamp)
        seen = replace(seen, robot=self._robot, evidence=evidence, seen_from=self._at)
        self._tell(seen)
        words = '' if rule is None else rule.words()
        event = self.book.take(seen, severity=severity, rule=words, look=self._look)
        if event is None or rule is None or event.state != EventState.OPEN:
            return
        lasts = rule.lasting(event.looks, event.last - event.began)
        if event.severity >= Level.ALERT and lasts:
            if event.confirmed or not self._verify_seconds:
                self._doubts.pop(event.number, None)
                self._alert(event)
            else:
                self._doubts.setdefault(event.number, seen.stamp + self._verify_seconds)

    def doubts(self, stamp: float) -> list[Event]:
        """Return the alerts that wait until the robot has looked again.

        One that nobody could look at again in time is told as it is; so is one whose time is no
        longer known, for the clock was set back.
        """
        for number, until in list(self._doubts.items()):
            event = self.book.find(number)
            if event is None or event.state != EventState.OPEN:
                del self._doubts[number]
            elif not until - self._verify_seconds <= stamp < until:
                del self._doubts[number]
                self._alert(event)
        return [each for each in map(self.book.find, self._doubts) if each is not None]

    def _met_picture(self, middle: tuple[float, float], grid: Grid) -> Picture:
        """Return the map around a point with what beams met in this visit."""
        sensor, ends = self._last
        if self._visit is not None:
            ends = np.concatenate([ends, _middles(self._visit.view().occupied, grid)])
        return sweep_picture(grid, middle, sensor, ends)

    def _normal_picture(self, middle: tuple[float, float]) -> Picture | None:
        """Return the map around a point with what normally stands there; None: nothing is known."""
        if self._normal is None or self._grid is None:
            return None
        ends = _middles(self._normal.occupied, self._grid)
        return sweep_picture(self._grid, middle, self._last[0], ends)

    # --- over restarts ---

    def state(self) -> dict[str, Any]:
        """Return what must not be forgotten, for `restore`: events, and what is normal."""
        self._learn()
        normal = self._kept if self._normal is None else _packed(self._normal)
        return {
            'book': self.book.to_json(),
            'normal': normal,
            'look': self._look,
            'hung': self._markers.to_json(),
            'views': self._views.to_json(),
            'habits': self._habits.to_json(),
            'doubts': {str(number): until for number, until in self._doubts.items()},
        }

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        look, normal = int(kept['look']), dict(kept['normal'])
        doubts = {int(each): float(until) for each, until in dict(kept['doubts']).items()}
        if normal:
            _masks(normal)
            _where(normal)
        with contextlib.ExitStack() as undo:
            # A part that does not fit gives back what the parts before it had.
            for part, name in (
                (self._markers, 'hung'),
                (self._views, 'views'),
                (self._habits, 'habits'),
                (self.book, 'book'),
            ):
                undo.callback(part.restore, part.to_json())
                part.restore(kept[name])
            undo.pop_all()
        self._look, self._kept, self._doubts = look, normal, doubts
        if self._grid is not None and normal:
            self._normal = _unpacked(normal, self._grid)


def same_map(one: Grid, other: Grid) -> bool:
    """Tell whether two maps are the same one, sent twice."""
    return (
        one.resolution == other.resolution
        and one.origin == other.origin
        and np.array_equal(one.cells, other.cells)
    )


def _middles(mask: Mask, grid: Grid) -> Points:
    """Return the middles of the cells of a mask, (n, 2), map frame, metres."""
    cells = np.argwhere(mask)
    return grid.centres_of(cells) if len(cells) else np.zeros((0, 2))


def _packed(view: FloorView) -> dict[str, Any]:
    def text(mask: Mask) -> str:
        return base64.b64encode(zlib.compress(np.packbits(mask).tobytes(), 6)).decode()

    grid = view.grid
    return {
        'shape': list(grid.cells.shape),
        'resolution': grid.resolution,
        'origin': list(grid.origin),
        'occupied': text(view.occupied),
        'free': text(view.free),
    }


def _unpacked(values: Mapping[str, Any], grid: Grid) -> FloorView | None:
    """Return what is normal on a map; None where it was on another one."""
    if _where(values) != (list(grid.cells.shape), grid.resolution, list(grid.origin)):
        return None
    occupied, free = _masks(values)
    return FloorView(grid, occupied, free, np.zeros_like(free))


def _where(values: Mapping[str, Any]) -> tuple[list[int], float, list[float]]:
    """Return the shape, resolution and origin of the map that a packed layer is of.

    Raises:
        ValueError, KeyError, TypeError: It is something else.
    """
    return list(values['shape']), values['resolution'], list(values['origin'])


def _masks(values: Mapping[str, Any]) -> tuple[Mask, Mask]:
    """Return which cells of a packed layer are occupied and which are free.

    Raises:
        ValueError, KeyError, TypeError: It is something else.
    """
    rows, columns = map(int, values['shape'])

    def mask(text: str) -> Mask:
        unpacking = zlib.decompressobj()
        try:
            # Not more than a map can hold: a file may be packed a thousand times smaller.
            data = unpacking.decompress(base64.b64decode(text), MOST_CELLS // 8 + 1)
        except zlib.error as error:
            raise ValueError(f'a layer of the map: {error}') from None
        if not unpacking.eof:
            raise ValueError(f'a layer of the map: cut off, or of more than {MOST_CELLS} cells')
        # before room is made for the cells
        if min(rows, columns) < 0 or len(data) != -(-rows * columns // 8):
            raise ValueError(f'a layer of the map of {len(data)} bytes, not {rows} by {columns}')
        cells = np.unpackbits(np.frombuffer(data, np.uint8), count=rows * columns)
        return np.asarray(cells.reshape(rows, columns), np.bool_)

    return mask(values['occupied']), mask(values['free'])
