"""One visit: what was in view from when the robot came to a place until it left.

It is made anew for each visit, so that nothing of an earlier one is left by mistake. A robot that
stands for long, as at its dock, ends its visit and begins another one. What rules and events count
as `looks` are visits.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from floor_plans import Grid
from indoor_watch.camera_floor import CameraFloor
from indoor_watch.events import ELSEWHERE
from indoor_watch.floor import FloorVisit, ObjectChange
from indoor_watch.hung_markers import CameraView, SeenMarker
from indoor_watch.observations import Observation
from indoor_watch.persons import Picture
from indoor_watch.reference_views import Viewpoint
from indoor_watch.views import Sight

Points = NDArray[np.float64]
Mask = NDArray[np.bool_]

SEEN_AGAIN = 10.0
"""What goes on is told again after this time, seconds."""


class Rooms(Protocol):
    """Which place is where."""

    def place_at(self, point: Sequence[float]) -> str | None:
        """Return the place that a point of the map lies in; None: in none."""

    def cells_of(self, place: str) -> Mask | None:
        """Return the cells of a place, shape as the map's; None where it has none."""


class LidarSweep(NamedTuple):
    """One turn of a lidar, on the map.

    Attributes:
        sensor: Where it was, map frame, metres.
        ends: Where beams ended, (n, 2), same frame.
        met: Whether something was met there, (n,); False for a beam at its greatest range.
        stamp: Seconds since 1970.
        doubt: By what each end may be off across what it met, standard deviation, (n,), metres;
            None: that is not known.
    """

    sensor: tuple[float, float]
    ends: Points
    met: Mask
    stamp: float
    doubt: Points | None = None

    @property
    def points(self) -> Points:
        """Where something was met, (n, 2)."""
        return self.ends[self.met]


class CameraShot(NamedTuple):
    """A picture of the camera, and from where it was taken.

    Attributes:
        picture: (rows, columns) of grey bytes, or (rows, columns, 3) of BGR.
        viewpoint: Where the camera is: x, y in metres, then angles in radians; None while it moves.
        stamp: Seconds since 1970.
        markers: The markers in it; None: nobody looked for markers.
        camera: From where on the map it was taken; None: that is not known, and nothing is said of
            markers.
    """

    picture: Picture
    viewpoint: Viewpoint | None
    stamp: float
    markers: Sequence[SeenMarker] | None
    camera: CameraView | None


@dataclass(frozen=True, eq=False)
class Pictured:
    """An observation with what shows it.

    Attributes:
        seen: The observation.
        picture: What shows it; None: what the lidar met there is drawn.
        before: How that looks normally; None: not known.
    """

    seen: Observation
    picture: Picture | None = None
    before: Picture | None = None


@dataclass(frozen=True)
class Coverage:
    """What was looked at in one visit to a place.

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


@dataclass(eq=False)
class PeopleSeen:
    """Who was seen in a visit, and where persons were looked for.

    Attributes:
        count: How often somebody was seen.
        by_sensor: Whom each sensor saw last.
        shown: The floor that pictures showed in which persons were looked for; None: there is none.
        shown_elsewhere: Whether there is one of which nobody knows from where it was taken.
    """

    count: int = 0
    by_sensor: dict[str, Observation] = field(default_factory=dict)
    shown: CameraFloor | None = None
    shown_elsewhere: bool = False


@dataclass(eq=False)
class Visit:
    """What was in view since the robot came to a place.

    Attributes:
        place: Where it is; empty: in none that is known.
        number: Of the visit, from 1; 0 before the first.
        began: When, seconds since 1970; nan before the first.
        rooms: Which place is where; None: a thing is in the robot's place.
        sweep: The last one, also of the visit before; None: there was none.
        stood_at, stood_since: Where the robot stands, map frame, metres, and since when.
        floor: What the lidar saw; None before the first sweep on a map.
        things: What the last comparison of the floor found.
        readings: The last ones of each door: state and confidence.
        doors: The states of the doors that were read in this visit.
        pictures: How many were looked at.
        people: Who was seen, and where persons were looked for.
        sight, light: What was told of the view and of the light. They are told anew in each place,
            of which a short visit may give one picture alone.
        held: Pictures whose markers are judged once it is clear what else the visit shows.
        saw_clearly: Whether a picture showed more than a bare wall or a covered lens.
        told: What was told when, and where the robot was then.
    """

    place: str = ''
    number: int = 0
    began: float = math.nan
    rooms: Rooms | None = None
    sweep: LidarSweep | None = None
    stood_at: tuple[float, float] | None = None
    stood_since: float = math.nan
    floor: FloorVisit | None = None
    things: list[ObjectChange] = field(default_factory=list)
    readings: dict[str, deque[tuple[str, float]]] = field(default_factory=dict)
    doors: dict[str, str] = field(default_factory=dict)
    pictures: int = 0
    people: PeopleSeen = field(default_factory=PeopleSeen)
    sight: Sight | None = None
    light: str = ''
    held: list[CameraShot] = field(default_factory=list)
    saw_clearly: bool = False
    told: dict[tuple[str, ...], tuple[float, tuple[float, float] | None]] = field(
        default_factory=dict
    )

    @property
    def at(self) -> tuple[float, float] | None:
        """Where the robot's lidar was last, map frame, metres; None: it has told nothing yet."""
        return None if self.sweep is None else self.sweep.sensor

    def next(self, place: str, stamp: float) -> Visit:
        """Return the visit that follows."""
        return Visit(place, self.number + 1, stamp, self.rooms, self.sweep, self.at, stamp)

    def place_of(self, point: tuple[float, float]) -> str:
        """Return where a thing lies that was seen, perhaps through a doorway."""
        found = None if self.rooms is None else self.rooms.place_at(point)
        return found or self.place

    def is_due(self, seen: Observation, sensor: str = '') -> bool:
        """Tell whether a thing was not told of a moment ago, or from elsewhere, or otherwise."""
        cell = [] if seen.position is None else [str(round(each)) for each in seen.position]
        key = (seen.kind, seen.state, seen.subject, sensor, *cell)
        stamp, at = self.told.get(key, (-math.inf, None))
        if abs(seen.stamp - stamp) < SEEN_AGAIN:
            here = self.at
            if at is None or here is None or math.dist(at, here) < ELSEWHERE:
                return False
        self.told[key] = seen.stamp, self.at
        return True

    def things_met(self) -> Points:
        """Return the ends of the last sweep that no wall of the map explains, (n, 2)."""
        if self.sweep is None:
            return np.zeros((0, 2))
        met = self.sweep.points
        if self.floor is None or not len(met):
            return met
        away = np.linalg.norm(met - np.asarray(self.sweep.sensor), axis=1)
        doubt = None if self.sweep.doubt is None else self.sweep.doubt[self.sweep.met]
        return met[~self.floor.of_wall(met, away, doubt)]

    def coverage(self, grid: Grid | None, stamp: float) -> Coverage:
        """Return what was in view until now, of a map; None: there is none."""
        share = shown = math.nan
        area = 0.0
        floor = None if self.rooms is None else self.rooms.cells_of(self.place)
        if floor is not None and grid is not None and floor.shape == grid.cells.shape:
            seen, cells = 0, max(1, int(floor.sum()))
            if self.floor is not None and self.floor.sweeps:
                seen = int((floor & self.floor.view().seen).sum())
            share = seen / cells
            area = seen * grid.resolution**2
            if self.people.shown is not None:
                shown = int((floor & self.people.shown.seen).sum()) / cells
            elif not self.people.shown_elsewhere:
                shown = 0.0
        return Coverage(self.place, self.began, stamp, share, area, self.pictures, shown)
