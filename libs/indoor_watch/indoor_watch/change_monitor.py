"""What a robot notices as it goes about: sweeps and pictures in, observations and events out.

Each monitor owns one kind of thing: the floor, doors, persons, light, views, markers. A visit is
what was in view from when the robot came to a place until it left. What the monitors note is judged
in `alerting`. This module hands sweeps and pictures to them, in an order that matters: who walks is
told before the floor takes the sweep, persons before views, for it is they who change a view.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from typing import Any

from floor_plans import Grid
from indoor_watch.alerting import Alerting, Blur, restoring_all
from indoor_watch.door_monitor import DoorMonitor
from indoor_watch.doors import Segment
from indoor_watch.events import ELSEWHERE, Event, EventBook, EventState
from indoor_watch.evidence import EvidenceStore
from indoor_watch.floor_monitor import FloorMonitor
from indoor_watch.hung_markers import CameraView, HungSpot, SeenMarker
from indoor_watch.marker_monitor import MarkerMonitor
from indoor_watch.movables import Movables
from indoor_watch.observations import Kind, Observation
from indoor_watch.other_robots import OtherRobots
from indoor_watch.passages import Passages
from indoor_watch.person_monitor import PersonMonitor
from indoor_watch.persons import Person, Picture
from indoor_watch.reference_views import ReferenceViews, Viewpoint
from indoor_watch.registration import Registration
from indoor_watch.view_monitor import LightMonitor, ViewMonitor
from indoor_watch.views import Sight, grey_of
from indoor_watch.visit import CameraShot, Coverage, LidarSweep, Mask, Points, Rooms, Visit
from indoor_watch.watch_rules import WatchRule

SET_BACK = 30.0
"""A clock that is earlier by more was set back, seconds: work may wait for so long."""
LONGEST_STAND = 120.0
"""A robot that stands for longer begins another visit, seconds. A thing is told once it was met in
three tenths of the sweeps of a visit: so within 40 s, however long the robot stands. A whole look,
which takes 30 s (docs/explanation/noticing.md), is not cut."""


class ChangeMonitor:
    """Notices, by the rules of a person; owned by whoever calls it, one thread.

    Args:
        rules: What matters.
        book: Joins what was seen to events.
        local: Returns the local time of a stamp.
        tell: Called with each observation.
        alert: Called with each event of level ALERT that lasts as long as its rule wants.
        warn: Called with each of them that nobody could look at again, where its rule wants that.
        doors: The doors' openings by name, map frame, metres.
        robot: Whose observations they are.
        markers: The ids that hang here, and where, map frame, metres; None: that is learned. Empty:
            all that is seen is known.
        rooms: Which place is where; None: a thing is in the robot's place.
        passages_of: Returns the passages of a map; None: none is looked at.
        find_persons: Finds the persons in a picture; None: the lidar sees those who walk.
        covered: Called with what each visit to a place saw, when it ends.
        store: Keeps pictures; None: nothing is kept.
        views: How each viewpoint looks normally.
        verify_seconds: An alert that is not sure waits so long for a second look.
        others: The other robots of a fleet, which are no news; None: there are none.
        blur: Blurs people in pictures that are kept, see `Alerting`; None: none are blurred.

    Attributes:
        visit: The one that goes on.
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
        warn: Callable[[Event], object] = lambda _: None,
        doors: Mapping[str, Segment] | None = None,
        markers: Mapping[int, tuple[float, float, float] | None] | None = None,
        rooms: Rooms | None = None,
        passages_of: Callable[[Grid], Passages] | None = None,
        find_persons: Callable[[Picture], list[Person]] | None = None,
        covered: Callable[[Coverage], object] = lambda _: None,
        store: EvidenceStore | None = None,
        views: ReferenceViews | None = None,
        verify_seconds: float = 0.0,
        others: OtherRobots | None = None,
        blur: Blur | None = None,
    ) -> None:
        self._others = others or OtherRobots(0.0)
        self._covered = covered
        self._doors = DoorMonitor(doors or {})
        self._floor = FloorMonitor(self._doors.may_be_leaf, passages_of)
        self._persons = PersonMonitor(find_persons, (doors or {}).values())
        self._light = LightMonitor()
        self._views = ViewMonitor(views or ReferenceViews(), self._doors.near)
        self._markers = MarkerMonitor(markers or {}, self._others.may_be_seen)
        self._alerting = Alerting(
            rules,
            book,
            local=local,
            robot=robot,
            tell=tell,
            alert=alert,
            warn=warn,
            store=store,
            drawn=self._floor.drawn,
            verify_seconds=verify_seconds,
            blur=blur,
        )
        self._registration = Registration()
        self._latest = math.inf
        self.visit = Visit(rooms=rooms)

    @property
    def rules(self) -> tuple[WatchRule, ...]:
        """What matters."""
        return self._alerting.rules

    def follow(self, rules: Sequence[WatchRule]) -> None:
        """Judge by other rules from now on."""
        self._alerting.follow(rules)

    @property
    def movables(self) -> Movables:
        """What moves often."""
        return self._floor.movables

    @property
    def _current(self) -> list[Event]:
        return self._alerting.book.current

    def use_map(self, grid: Grid) -> None:
        """Take the map; what was normal on another one is forgotten."""
        if self._floor.use_map(grid):
            self._doors.use_map()
            self.visit.floor, self.visit.things = None, []
            self.visit.people.shown = None

    def arrive(self, place: str, stamp: float) -> None:
        """Take that the robot is in a place; the visit of another one ends."""
        if place != self.visit.place:
            self._compare(stamp)
            self._begin(place, stamp)

    def assess(self, stamp: float) -> None:
        """Compare what this visit saw so far with what is normal; call it every few seconds.

        A robot that stands for long, as at its dock, ends its visit and begins another one.
        """
        self._heed_clock(stamp)
        self._compare(stamp)
        self._alerting.accept(stamp)
        # A clock that was set back is no reason to stand for ever.
        if self.visit.place and not 0.0 <= stamp - self.visit.stood_since < LONGEST_STAND:
            self._begin(self.visit.place, stamp)

    def _begin(self, place: str, stamp: float) -> None:
        """End the visit, and begin the next one."""
        ended = self.visit
        if ended.place and not math.isnan(ended.began):
            coverage = self.coverage(stamp)
            self._covered(coverage)
            nobody = self._persons.leave(ended, coverage)
            self._alerting.take(nobody, ended)
            if nobody and self._floor.normal is not None:
                gone = self._persons.gone(self._current, ended, self._floor.is_as_before)
                self._alerting.end(gone, stamp)
        self._floor.learn(ended, self._current)
        self._alerting.take(self._floor.baseline(ended, stamp), ended)
        self._persons.begin()
        self._registration.begin()
        self.visit = ended.next(place, stamp)

    def _compare(self, stamp: float) -> None:
        self._alerting.take(self._floor.compare(self.visit, stamp), self.visit)
        self._alerting.end(self._floor.gone(self._current, self.visit), stamp)

    def _heed_clock(self, stamp: float) -> None:
        """Have no event be of the future, where the clock was set back, perhaps before a start."""
        if stamp < self._latest - SET_BACK:
            self._alerting.book.set_back(stamp)
            self._latest = stamp
        self._latest = max(self._latest, stamp)

    def coverage(self, stamp: float) -> Coverage:
        """Return what was in view since the robot came here."""
        return self.visit.coverage(self._floor.grid, stamp)

    def sweep(
        self,
        sensor: tuple[float, float],
        ends: Points,
        met: Mask,
        stamp: float,
        doubt: tuple[float, float] | None = None,
    ) -> None:
        """Take a sweep of the lidar.

        Args:
            sensor: Where it was, map frame, metres.
            ends: Where beams ended, (n, 2), same frame.
            met: Whether something was met there, (n,).
            stamp: Seconds since 1970.
            doubt: Standard deviations of the pose, as the localisation says, metres and rad; None:
                it does not tell.
        """
        self._heed_clock(stamp)
        apart = self._others.apart(ends, stamp)
        sweep, visit = LidarSweep(sensor, ends[apart], met[apart], stamp), self.visit
        if self._floor.grid is not None:
            sweep = self._registration.registered(
                sweep, self._floor.grid, self._floor.normal, doubt
            )
        visit.sweep = sweep
        if visit.stood_at is None or math.dist(sweep.sensor, visit.stood_at) > ELSEWHERE:
            visit.stood_at, visit.stood_since = sweep.sensor, stamp
        self._floor.begin(visit)
        self._alerting.take(self._persons.take(sweep, visit, self._floor.normal), visit)
        self._floor.take(sweep, visit)
        self._alerting.take(self._doors.take(sweep, visit), visit)

    def picture(
        self,
        picture: Picture,
        viewpoint: Viewpoint | None,
        stamp: float,
        markers: Sequence[SeenMarker] | None,
        camera: CameraView | None = None,
    ) -> None:
        """Take a picture; see `CameraShot` for the arguments."""
        if camera is not None:
            camera = self._registration.placed(camera, stamp)
        shot, visit = CameraShot(picture, viewpoint, stamp, markers, camera), self.visit
        visit.pictures += 1
        take, grey = self._alerting.take, grey_of(picture)
        noted, sight, light = self._light.take(grey, stamp, visit)
        take(noted, visit)
        if sight == Sight.BLOCKED:
            self._markers.hold(shot, visit)
        if sight != Sight.CLEAR:
            return
        take(self._persons.look(shot, visit, self._floor.grid, is_lit=light == 'on'), visit)
        take(self._markers.strange(shot, grey, visit, self._current), visit)
        for each in self._markers.held(shot, visit):
            before = self._views.normal_from(each.viewpoint)
            take(self._markers.take(each, visit, self._current, before), visit)
        if viewpoint is None or self._others.may_be_seen((viewpoint[0], viewpoint[1]), stamp):
            return
        take(self._views.take(shot, visit, self._current), visit)

    def answer(self, number: int, state: EventState) -> Event:
        """Take a person's word about an event; a view that is normal now is learned anew.

        Raises:
            KeyError, ValueError: See `EventBook.answer`.
        """
        event = self._alerting.book.answer(number, state)
        if state == EventState.NORMAL and event.kind == Kind.VIEW and event.subject:
            self._views.views.forget(event.subject)
        is_marker = event.kind == Kind.MARKER and event.seen != 'unknown'
        if state == EventState.NORMAL and is_marker:
            self._markers.hung.accept(int(event.subject))
        if state == EventState.FALSE and event.seen == 'movable' and event.position is not None:
            thing = self.movables.near(event.position)
            if thing is not None:
                self.movables.undo(thing.number)
        return event

    def pass_by(self, pose: Points, seen: Sequence[SeenMarker]) -> None:
        """Take markers that were read in passing, see `HungMarkers.pass_by`."""
        self._markers.hung.pass_by(pose, seen)

    def spots(self) -> list[HungSpot]:
        """Return where markers hang, as far as that is known."""
        return self._markers.hung.spots()

    def doubts(self, stamp: float) -> list[Event]:
        """Return the alerts that wait until the robot has looked again, see `Alerting`."""
        return self._alerting.doubts(stamp)

    def state(self) -> dict[str, Any]:
        """Return what must not be forgotten, for `restore`: events, and what is normal."""
        self._floor.learn(self.visit, self._current)
        return {
            **self._alerting.state(),
            'normal': self._floor.state(),
            'look': self.visit.number,
            'hung': self._markers.hung.state(),
            'views': self._views.views.state(),
            'movables': self.movables.state(),
        }

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        number = int(kept['look'])
        with restoring_all() as restore:
            restore(self._floor, kept['normal'])
            restore(self._markers.hung, kept['hung'])
            restore(self._views.views, kept['views'])
            restore(self.movables, kept.get('movables', {'things': [], 'next': 1}))
            restore(self._alerting, kept)
        self.visit.number = number
