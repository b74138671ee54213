"""Localisation and velocity control of one robot: sensors go in, a velocity comes out.

The navigator keeps the estimate of the pose, remembers obstacles that the map does not have, knows
the place the robot is in, and carries out one task at a time: a `Drive` or a `Spin`. It knows no
ROS; who feeds it takes care that calls do not overlap.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from floor_plans import Grid, Zones
from floor_plans.occupancy_grid import with_walls
from floor_plans.parameters import NO_ZONES
from floor_plans.shapes import Segment
from lidar_navigation.driving.driving import Drive, Spin
from lidar_navigation.driving.obstacle_memory import ObstacleMemory
from lidar_navigation.driving.path_following import DriveParameters, Velocity
from lidar_navigation.driving.relocation import OdometryTrack, Relocation
from lidar_navigation.geometry import Points, Pose, Scan, composed, in_map, relative
from lidar_navigation.localisation.localisation import Localiser
from lidar_navigation.localisation.odometry import ContinuousOdometry, OdometryBuffer, joined
from lidar_navigation.localisation.place_locator import PlaceLocator
from lidar_navigation.localisation.tracking import Mover, Tracker

SETTLE_SECONDS = 0.2
"""A place counts once the robot has been in it for this long, so that a doorway does not
flicker."""

LONGEST_STEP = 6.0
"""More than this between two scans counts as this, seconds: longer than what was not seen is still
taken for the same thing, and short enough that nothing is forgotten for one wrong stamp."""
MOST_LATE = 1.0
"""A scan that is older than the one before by this much, seconds, or less came late, as those of
a second lidar do; by more, the clock began anew."""
OTHER_LIDAR = 0.5
"""What another lidar saw counts for so long, seconds."""
MOVER_REACH = 3.5
"""Who moves within this distance is driven around, metres."""
ZONE_REACH = 2.0
"""Keep-out zones within this distance are looked at, metres."""
SLOWING = 0.5
"""With which the robot slows down before a slow zone, m/s^2; less than its acceleration."""
SEEK_AFTER, SEEK_AGAIN = 5.0, 60.0
"""A robot without a task that does not know where it is moves about after this time, seconds; and
once more so long after it has done so in vain."""
MOVER_GAP = 0.15
"""Nearer than this to what the map has, a point belongs to nothing that moves, metres."""


class Navigator:
    """What drives one robot.

    Args:
        doors: All doors by name, as segments; they divide the map into places.
        guesses: Where the robot may be at first, beside where its odometry says.
        zones: Where the robot is not to drive, or slowly.

    Attributes:
        task: What is carried out at the moment.
        stands: The robot is to stand where it is; no time passes for the task, which then goes on.
        before_search: Called before the robot looks for its pose everywhere, which takes a while in
            which it sees nothing else.
        obstacles_changed: Set when the obstacles changed; the reader clears it.
        place: The place the robot is in; None while that is not known.
        seeks: A robot that has no task and does not know where it is moves about to find out.
        robot: Its limits, for that.
        trusted: The last scan, from where it was made, and its time, seconds, which never goes
            back; None where that pose is in doubt.
    """

    def __init__(
        self,
        doors: Mapping[str, Segment] | None = None,
        guesses: Iterable[Pose] = (),
        zones: Zones = NO_ZONES,
    ) -> None:
        self._zones = zones
        self._doors = dict(doors or {})
        self._closed: frozenset[str] = frozenset()
        self._guesses = tuple(guesses)
        self._places = PlaceLocator(self._doors.values())
        self._grid: Grid | None = None
        self._localiser: Localiser | None = None
        self._memory: ObstacleMemory | None = None
        self._tracker = Tracker()
        self._odometry: Pose | None = None
        self._readings = OdometryBuffer()
        self._continuous = ContinuousOdometry()
        self._way_here = OdometryTrack()
        self._here: Pose = (0.0, 0.0, 0.0)
        self._relocation: Relocation | None = None
        self._unsure_at: float | None = None
        self._others: dict[str, tuple[Scan, float]] = {}
        self._believed: Pose | None = None
        self._candidate: tuple[str | None, float] | None = None
        self._stamp, self._now = -math.inf, 0.0
        self._stood = 0.0
        self.stands = False
        self.seeks = False
        self.robot = DriveParameters()
        self.task: Drive | Spin | None = None
        self.before_search: Callable[[], None] = lambda: None
        self.obstacles_changed = False
        self.place: str | None = None
        self.trusted: tuple[Pose, Scan, float] | None = None

    @property
    def awaits(self) -> tuple[str, ...]:
        """All that has not come yet of map, odom and scan."""
        has_scan = self._localiser is not None or bool(self._others)
        parts = (self._grid, 'map'), (self._odometry, 'odom'), (has_scan or None, 'scan')
        return tuple(name for part, name in parts if part is None)

    @property
    def missing(self) -> str | None:
        """What has not come yet of what the navigator needs; None when it is ready."""
        if self._grid is None:
            return 'map'
        if self._odometry is None:
            return 'odom'
        return None if self._localiser is not None else 'scan'

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, map frame; None until it is ready."""
        return None if self._localiser is None else self._localiser.pose

    @property
    def odometry(self) -> Pose | None:
        """The last reading of the odometry."""
        return self._odometry

    @property
    def jumps(self) -> int:
        """How often the robot found itself elsewhere than it thought."""
        return 0 if self._localiser is None else self._localiser.jumps

    @property
    def lost(self) -> bool:
        """Whether the robot does not know where it is."""
        return self._localiser is not None and self._localiser.lost

    @property
    def ambiguous(self) -> bool:
        """Whether the robot may as well be in another place that looks alike."""
        return self._localiser is not None and self._localiser.ambiguous

    @property
    def is_sure(self) -> bool:
        """Whether the robot knows where it is: not lost, and nowhere else as likely."""
        return not (self.lost or self.ambiguous)

    @property
    def may_be_in(self) -> tuple[str, ...]:
        """The places in which the robot may be: that of its pose, and of those that look alike."""
        if self._localiser is None:
            return ()
        poses = [self._localiser.pose, *self._localiser.alike]
        places = (self._places.place_at(pose[:2]) for pose in poses)
        return tuple(sorted({place for place in places if place is not None}))

    @property
    def obstacles(self) -> Points:
        """Obstacles that the map does not have, shape (n, 2), metres, map frame."""
        return np.zeros((0, 2)) if self._memory is None else self._memory.points

    @property
    def obstacles_stay(self) -> NDArray[np.bool_]:
        """Which of the obstacles stay, shape (n,); the others may be people."""
        return np.zeros(0, np.bool_) if self._memory is None else self._memory.stay

    def set_map(self, grid: Grid) -> None:
        """Take the map, or another one."""
        self._grid = grid
        self._redraw()
        self._places.set_map(grid)
        self._candidate = None

    def set_closed(self, doors: Iterable[str]) -> None:
        """Take which doors are closed: the lidar sees them as walls."""
        closed = frozenset(doors) & self._doors.keys()
        if closed != self._closed:
            self._closed = closed
            self._redraw()

    def set_positions(self, positions: Mapping[str, ArrayLike]) -> None:
        """Take the places: a point in each, metres."""
        self._places.set_positions(positions)
        self._candidate = None

    def take_place(
        self,
        doors: Mapping[str, Segment],
        zones: Zones,
        positions: Mapping[str, ArrayLike],
    ) -> None:
        """Take a place that was changed: its doors, its zones and a point in each room."""
        self._doors, self._zones = dict(doors), zones
        self._places = PlaceLocator(self._doors.values())
        self._places.set_positions(positions)
        if self._grid is not None:
            self._places.set_map(self._grid)
        self._candidate = None
        closed, self._closed = self._closed, self._closed & self._doors.keys()
        if closed != self._closed:
            self._redraw()

    def believe(self, pose: Pose) -> None:
        """Take where the robot is said to be."""
        self._believed = pose
        if self._localiser is not None:
            self._localiser.believe(pose)

    def move(self, odometry: Pose, stamp: float | None = None) -> None:
        """Take a reading of the odometry.

        Args:
            odometry: Where it has the robot.
            stamp: Its time, seconds; None: it says none, and each scan counts as made now.
        """
        if stamp is not None:
            self._readings.add(stamp, odometry)
        self._odometry = odometry
        self._here = self._continuous.take(odometry, stamp)
        if self._relocation is None:
            self._way_here.add(self._here)
        if self._localiser is not None:
            self._localiser.move(odometry, stamp)

    def told_pose(self, stamp: float) -> tuple[Pose, float] | None:
        """Return where the robot is and the time of that, seconds, at least that of a scan.

        Args:
            stamp: The time of the scan, seconds.
        """
        if self.pose is None:
            return None
        latest = self._readings.latest
        if latest is None or not -OTHER_LIDAR < latest[0] - stamp < LONGEST_STEP:
            return self.pose, stamp
        if latest[0] >= stamp:
            return self.pose, latest[0]
        if not self._readings.covers(stamp, stamp):
            return self.pose, stamp
        x, y, yaw = self._readings.at(np.array([stamp]))[0].tolist()
        return composed(self.pose, relative(latest[1], (x, y, yaw))), stamp

    def see(self, scan: Scan, stamp: float, lidar: str = '') -> Velocity | None:
        """Take a scan and decide what to do.

        Args:
            scan: What the lidar saw from where the robot was when it measured.
            stamp: The time of its first ray by a clock that may jump or begin anew, seconds.
            lidar: Which of several lidars saw it.

        Returns:
            The velocity to command; None when there is no task, or something is missing yet.
        """
        if self._grid is None or self._odometry is None:
            self._others[lidar] = scan, stamp
            return None
        before, now = self._now, self._passed(stamp)
        if self.stands:
            self._stood += now - before
        measured, scan = scan, joined(scan, self._readings, stamp)
        if self._localiser is None:
            self._localiser = self._first_localiser(scan, self._odometry)
        used = self._localiser.see(scan, now)
        seen = np.concatenate([scan.points, *self._seen_by_others(lidar, stamp)])
        self._others[lidar] = measured, stamp
        if self._localiser.certain:
            self._track(seen, now)
            if used:
                self._remember(scan, now)
        if self._localiser.plausible:
            self._settle_place(now)
        pose = self._localiser.pose
        is_trusted = self._localiser.plausible and not self._localiser.ambiguous
        self.trusted = (pose, scan, now) if is_trusted else None
        if self.is_sure:
            self._relocation = self._unsure_at = None
        elif self._unsure_at is None:
            self._unsure_at = now
        if self.stands:
            return None if self.task is None else Velocity()
        if isinstance(self.task, Drive):
            # A keep-out zone stands in the way as a wall does that the lidar sees.
            edges = self._zones.edges_near(pose, ZONE_REACH)
            return self.task.step(
                now - self._stood,
                pose,
                np.concatenate([seen, edges]) if len(edges) else seen,
                movers=self._movers_near(pose),
                lost=self._localiser.lost,
                search=lambda: self._moved_about(now - self._stood, seen),
                limit=self._zones.speed_limit(pose, SLOWING),
            )
        if isinstance(self.task, Spin):
            return self.task.step(pose[2], now - self._stood)
        return self._sought(now, seen) if self.seeks else None

    def _sought(self, now: float, seen: Points) -> Velocity | None:
        """Return how a robot without a task moves to find out where it is; None: it need not."""
        if self._unsure_at is None or now - self._unsure_at < SEEK_AFTER:
            return None
        velocity = self._moved_about(now - self._stood, seen)
        if velocity is None:
            self._relocation, self._unsure_at = None, now + SEEK_AGAIN - SEEK_AFTER
            return Velocity()
        return velocity

    def _moved_about(self, now: float, seen: Points) -> Velocity | None:
        """Return how a robot moves that does not know where it is; None when all was tried."""
        if self._relocation is None:
            # Where it is not to drive, it may be now.
            may_drive = not self._zones.keep_out
            self._relocation = Relocation(self._way_here, self.robot, may_drive=may_drive)
        velocity = self._relocation.step(now, self._here, seen)
        return None if self._relocation.is_over else velocity

    def _passed(self, stamp: float) -> float:
        """Return the time that passed up to a scan, seconds; it never goes back."""
        step = stamp - self._stamp
        if not -MOST_LATE <= step < 0.0:
            self._stamp = stamp
            self._now += min(max(step, 0.0), LONGEST_STEP)
        return self._now

    def _first_localiser(self, scan: Scan, odometry: Pose) -> Localiser:
        """Begin where the robot is said to be, or else where its first scan fits best."""
        localiser = Localiser(self._seen_map, odometry, lambda: self.before_search())
        if self._believed is not None:
            localiser.believe(self._believed)
        else:
            # The first of equals: the odometry.
            fits = [localiser.explained(pose, scan) for pose in (odometry, *self._guesses)]
            localiser.believe((odometry, *self._guesses)[fits.index(max(fits))])
        localiser.move(odometry)
        return localiser

    def _seen_by_others(self, lidar: str, stamp: float) -> list[Points]:
        """Return what the other lidars saw last, robot's frame, unless that is long ago."""
        return [
            joined(scan, self._readings, at).points
            for other, (scan, at) in self._others.items()
            if other != lidar and abs(stamp - at) <= OTHER_LIDAR
        ]

    def _track(self, seen: Points, now: float) -> None:
        assert self._localiser is not None
        assert self._memory is not None
        pose = self._localiser.pose
        points = in_map(pose, seen)
        self._tracker.update(pose, points[self._memory.is_unknown(points, MOVER_GAP)], now)

    def _movers_near(self, pose: Pose) -> list[Mover]:
        """Return what moves within `MOVER_REACH`, in the robot's frame."""
        near = []
        for each in self._tracker.movers:
            x, y, _ = relative(pose, (each.x, each.y, 0.0))
            if math.hypot(x, y) <= MOVER_REACH:
                vx, vy, _ = relative((0.0, 0.0, pose[2]), (each.vx, each.vy, 0.0))
                near.append(Mover(x, y, vx, vy, each.radius))
        return near

    def _remember(self, scan: Scan, now: float) -> None:
        assert self._localiser is not None
        if self._memory is not None and self._memory.update(
            self._localiser.pose, scan, now, self._tracker.may_move
        ):
            self.obstacles_changed = True
            if isinstance(self.task, Drive):
                self.task.heed(self._memory.points)

    def _settle_place(self, now: float) -> None:
        if not self._places.is_known or self._localiser is None:
            return
        place = self._places.place_at(self._localiser.pose[:2])
        if self._candidate is None or self._candidate[0] != place:
            self._candidate = place, now
        if self.place is None or now - self._candidate[1] >= SETTLE_SECONDS:
            self.place = place

    def _redraw(self) -> None:
        if self._grid is None:
            return
        self._seen_map = with_walls(self._grid, [self._doors[name] for name in self._closed])
        if self._memory is None:
            self._memory = ObstacleMemory(self._seen_map)
        else:
            self._memory.set_map(self._seen_map)
        self.obstacles_changed = True
        if self._localiser is not None:
            self._localiser.set_map(self._seen_map)

    def place_at(self, point: Points) -> str | None:
        """Return the place that a point belongs to; None when it is in none, or there is no map
        yet.
        """
        return self._places.place_at(point)
