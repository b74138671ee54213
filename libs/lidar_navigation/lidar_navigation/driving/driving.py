"""A drive along a path from beginning to end: following, and what to do when that does not go on.

When something stands in the way, or no progress is made, the drive recovers step by step: it waits
for what may move away, asks for another path, backs up and asks again, looks around and asks again,
and gives up with the reason. A step that brings the robot on a good way starts the list anew.

A drive is told the time with each step and never waits itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from lidar_navigation.driving.path_following import (
    DriveParameters,
    Guidance,
    PathFollower,
    Velocity,
    room_ahead,
)
from lidar_navigation.driving.sampled_planning import SampledPlanner
from lidar_navigation.geometry import Points, Pose, angle_between, composed
from lidar_navigation.localisation.tracking import Mover


class DriveState(Enum):
    """What a drive is doing."""

    DRIVING = 'driving'
    WAITING = 'waiting'
    BACKING = 'backing up'
    LOOKING = 'looking around'
    ASKING = 'asking for another path'
    STOPPING = 'stopping'
    ARRIVED = 'arrived'
    FAILED = 'failed'

    @property
    def ended(self) -> bool:
        """Whether the drive is over."""
        return self in (DriveState.ARRIVED, DriveState.FAILED)


@dataclass(frozen=True)
class RecoveryParameters:
    """When a drive recovers, and how.

    Attributes:
        patience: Standing before something for this long begins a recovery, seconds.
        stuck_after: As does making no progress for this long, seconds.
        step: Less way or turn than this is no progress, metres or rad.
        wait: How long to wait for what stands in the way, seconds.
        back_up: How far to back up, metres.
        back_speed: How fast, m/s.
        look_ahead: An obstacle on this much of the path ahead makes it ask for another, metres.
        off_path: Further from the path than this, another one is asked for, metres; twice as far
            around somebody who moves.
        fresh_start: After this much progress the list of recoveries starts anew, metres.
        most_paths: After so many other paths without a fresh start, the next recovery is tried.
        stand_lost: A robot that does not know where it is stands this long, seconds,
        look_lost: then looks around for this long before the drive fails, seconds.
        people_leave: Somebody who moved near the robot within this time may still move on, seconds:
        people_patience: then the list starts anew, for this long at most, seconds.
    """

    patience: float = 0.5
    stuck_after: float = 8.0
    step: float = 0.1
    wait: float = 3.0
    back_up: float = 0.4
    back_speed: float = 0.15
    look_ahead: float = 3.0
    off_path: float = 0.5
    fresh_start: float = 1.0
    most_paths: int = 6
    stand_lost: float = 1.0
    look_lost: float = 30.0
    people_leave: float = 30.0
    people_patience: float = 60.0


_STANDS = 0.004
"""A robot that moves less than this between two steps, metres or rad, stands."""

SPIN_SPEED, SPIN_ACCELERATION = 1.0, 3.0
"""Of one turn on the spot, rad/s and rad/s^2."""

SPIN_PATIENCE = 4.0
"""A turn on the spot that does not go on for so long ends, seconds: a robot that is not round may
have no room for it."""

_TURNED = 0.1
"""A turn that ends so near to its bearing, rad, has got there."""

_RECOVERIES = (DriveState.WAITING, DriveState.BACKING, DriveState.LOOKING)
"""What is tried one after the other; after each, another path is asked for."""


class Drive:
    """One drive along a path, which may be replaced on the way.

    Args:
        path: Points of shape (n, 2), n of at least 1, metres, map frame.
        robot: The robot's limits and tracking settings.
        recovery: When and how the drive recovers.

    Attributes:
        state: What the drive is doing.
        reason: Why it recovers or failed.
        recoveries: How many recoveries were begun.
    """

    def __init__(
        self,
        path: ArrayLike,
        robot: DriveParameters | None = None,
        recovery: RecoveryParameters | None = None,
    ) -> None:
        self._robot = robot or DriveParameters()
        self._recovery = recovery or RecoveryParameters()
        self._follower = PathFollower(path, self._robot)
        self._local = SampledPlanner(self._robot)
        self.state = DriveState.DRIVING
        self.reason = ''
        self.recoveries = 0
        self._level = 0
        self._paths = 0
        self._now: float | None = None
        self._since = 0.0
        self._blocked_since: float | None = None
        self._mark: tuple[float, Pose, float] | None = None
        self._best = 0.0
        self._turned = 0.0
        self._backed = 0.0
        self._last: Pose | None = None
        self._lost_since: float | None = None
        self._obstacles: Points = np.zeros((0, 2))
        self._through = False
        self._moved_at = -math.inf
        self._trouble_since = -math.inf

    def step(
        self,
        now: float,
        pose: Pose,
        seen: Points,
        *,
        movers: Sequence[Mover] = (),
        lost: bool = False,
        search: Callable[[], Velocity | None] | None = None,
        limit: float = math.inf,
    ) -> Velocity:
        """Decide the velocity for the next moment.

        Args:
            now: The time, seconds.
            pose: Where the robot is, map frame.
            seen: What the lidar sees, robot's frame, shape (n, 2), metres.
            movers: What moves, robot's frame.
            lost: The pose is not to be trusted; the robot stands still and looks.
            search: How it moves then so that it sees more; it returns None when it has tried all.
                None: it looks around.
            limit: Top speed here, m/s.
        """
        dt = 0.0 if self._now is None else max(0.0, now - self._now)
        self._now = now
        self._follower.limit = limit
        turned, moved = self._motion(pose)
        if movers:
            self._moved_at = now
        if not lost:
            self._lost_since = None
        elif not self.state.ended:
            return self._while_lost(now, seen, dt, search)
        if self.state is DriveState.DRIVING:
            return self._drive(now, pose, seen, movers, dt)
        if self.state is DriveState.STOPPING:
            if (moved <= _STANDS and abs(turned) <= _STANDS) or now - self._since > 3.0:
                self.state = DriveState.ARRIVED
            return Velocity()
        if self.state is DriveState.WAITING and now - self._since >= self._recovery.wait:
            self._begin(DriveState.ASKING, now)
        elif self.state is DriveState.BACKING:
            self._backed += moved
            return self._back(now, seen)
        elif self.state is DriveState.LOOKING:
            self._turned += abs(turned)
            if self._turned >= math.tau or now - self._since > 20.0:
                self._begin(DriveState.ASKING, now)
            else:
                return Velocity(0.0, min(self._robot.turn, 1.0))
        return self._follower.halt(seen, dt)

    def heed(self, obstacles: Points) -> None:
        """Take the obstacles known now (map frame); ask for another path if one is on the path.

        A path that was found in spite of an obstacle is followed up to there: it may go away.
        """
        self._obstacles = obstacles
        if self.state is DriveState.DRIVING and self._now is not None:
            before, self._through = self._through, self._is_through()
            if self._through and not before:
                self._ask(self._now, 'something is on the path ahead')

    def _is_through(self) -> bool:
        """Tell whether an obstacle is on the path ahead."""
        margin = self._robot.margin / 2
        return not self._follower.is_clear(self._obstacles, margin, self._recovery.look_ahead)

    def new_path(self, path: ArrayLike) -> None:
        """Go on along another path."""
        self._follower = PathFollower(path, self._robot)
        self._through = self._is_through()
        self.state = DriveState.DRIVING
        self._blocked_since = self._mark = None
        self._best = 0.0

    def no_path(self, reason: str) -> None:
        """Say that no other path was found; the drive tries the next recovery."""
        self.reason = reason
        if self.state is DriveState.ASKING and self._now is not None:
            self._recover(self._now, reason)

    def _while_lost(
        self,
        now: float,
        seen: Points,
        dt: float,
        search: Callable[[], Velocity | None] | None,
    ) -> Velocity:
        r = self._recovery
        self._mark = self._blocked_since = None
        if self._lost_since is None:
            self._lost_since = now
        lost_for = now - self._lost_since
        if lost_for < r.stand_lost:
            return self._follower.halt(seen, dt)
        if search is not None:
            velocity = search()
            if velocity is not None:
                return velocity
        elif lost_for < r.stand_lost + r.look_lost:
            return Velocity(0.0, 0.5)
        self.reason = 'the robot does not know where it is: what it sees is nowhere on the map'
        self.state = DriveState.FAILED
        return Velocity()

    def _motion(self, pose: Pose) -> tuple[float, float]:
        last, self._last = self._last, pose
        if last is None:
            return 0.0, 0.0
        return angle_between(last[2], pose[2]), math.dist(last[:2], pose[:2])

    def _guided(self, pose: Pose, seen: Points, movers: Sequence[Mover], dt: float) -> Guidance:
        """Follow the path: straight, or around who moves near it."""
        if not movers:
            self._local.forget()
            return self._follower.step(pose, seen, dt)

        def choose(way: Points, last: Velocity) -> Velocity:
            return self._local.step(way, seen, movers, last, dt)

        return self._follower.step_with(choose, pose, seen, dt)

    def _drive(
        self, now: float, pose: Pose, seen: Points, movers: Sequence[Mover], dt: float
    ) -> Velocity:
        r = self._recovery
        guidance = self._guided(pose, seen, movers, dt)
        if guidance.done:
            self._since = now
            self.state = DriveState.STOPPING
            return guidance.velocity
        if guidance.off_path > (2 * r.off_path if movers else r.off_path):
            self._ask(now, f'the robot is {guidance.off_path:.2f} m off its path')
            return self._follower.halt(seen, dt)
        if not guidance.blocked:
            self._blocked_since = None
        elif self._blocked_since is None:
            self._blocked_since = now
        elif now - self._blocked_since >= r.patience:
            where = self._what_is_near(pose, seen)
            self._recover(now, f'something stands in the way{where}')
        if self._is_stuck(now, pose):
            self._recover(now, f'no progress for {r.stuck_after:g} s')
        if self._follower.progress - self._best >= r.fresh_start:
            self._best, self._level, self._paths = self._follower.progress, 0, 0
        return guidance.velocity

    def _is_stuck(self, now: float, pose: Pose) -> bool:
        r, progress = self._recovery, self._follower.progress
        if self._mark is not None:
            since, before, marked = self._mark
            turned = abs(angle_between(before[2], pose[2]))
            if progress - marked < r.step and turned < 3 * r.step:
                return now - since >= r.stuck_after
        self._mark = now, pose, progress
        return False

    @staticmethod
    def _what_is_near(pose: Pose, seen: Points) -> str:
        ahead = seen[seen[:, 0] > 0] if len(seen) else seen
        if not len(ahead):
            return ''
        nearest = ahead[np.argmin((ahead**2).sum(axis=1))]
        x, y, _ = composed(pose, (float(nearest[0]), float(nearest[1]), 0.0))
        return f' at ({x:.2f}, {y:.2f})'

    def _recover(self, now: float, reason: str) -> None:
        self.reason = reason
        r = self._recovery
        if self._level == 0:
            self._trouble_since = now
        elif self._level >= len(_RECOVERIES):
            among_people = now - self._moved_at <= r.people_leave
            if not among_people or now - self._trouble_since >= r.people_patience:
                self.state = DriveState.FAILED
                return
            self._level = 1
        self.recoveries += 1
        self._begin(_RECOVERIES[self._level], now)
        self._level += 1

    def _ask(self, now: float, reason: str) -> None:
        self.reason = reason
        self._paths += 1
        if self._paths > self._recovery.most_paths:
            self._paths = 0
            self._recover(now, reason)
            return
        self.recoveries += 1
        self._begin(DriveState.ASKING, now)

    def _begin(self, state: DriveState, now: float) -> None:
        self.state = state
        self._since = now
        self._turned = self._backed = 0.0
        self._blocked_since = self._mark = None

    def _back(self, now: float, seen: Points) -> Velocity:
        r = self._recovery
        behind = -seen if len(seen) else seen
        room = room_ahead(behind, 0.0, self._robot.body.turned_round, self._robot.margin, 1.0)
        slow = r.back_speed**2 / (2 * self._robot.acceleration) + 0.02
        if self._backed >= r.back_up or room <= slow or now - self._since > 10.0:
            self._begin(DriveState.ASKING, now)
            return Velocity()
        return Velocity(-r.back_speed, 0.0)


class Spin:
    """A turn on the spot; it ends early where the robot cannot turn.

    Args:
        bearing: Where the robot's front shall point at the end, map frame, rad; it turns the
            shorter way. None: once around, anticlockwise.
    """

    def __init__(self, bearing: float | None = None) -> None:
        self._bearing = bearing
        self._whole = math.tau
        self._turned = 0.0
        self._last: float | None = None
        self._moved_at: float | None = None
        self._is_stuck = False

    @property
    def done(self) -> bool:
        """Whether the turn is complete, to a degree, or does not go on."""
        if self._last is None:
            return False
        return self._is_stuck or (self.left if self._bearing is None else abs(self.left)) <= 0.02

    @property
    def has_turned(self) -> bool:
        """Whether it is near enough to its bearing to have got there."""
        return abs(self.left) <= _TURNED

    @property
    def left(self) -> float:
        """How far there is to turn, rad, anticlockwise."""
        return self._whole - self._turned

    def step(self, yaw: float, now: float) -> Velocity:
        """Decide the velocity for the next moment.

        Args:
            yaw: The robot's, rad.
            now: The time, seconds.
        """
        if self._last is None and self._bearing is not None:
            self._whole = angle_between(yaw, self._bearing)
        step = 0.0 if self._last is None else angle_between(self._last, yaw)
        self._turned += step
        self._last = yaw
        if self._moved_at is None or abs(step) > _STANDS:
            self._moved_at = now
        self._is_stuck = now - self._moved_at >= SPIN_PATIENCE
        if self.done:
            return Velocity()
        speed = min(SPIN_SPEED, math.sqrt(2 * SPIN_ACCELERATION * abs(self.left)))
        return Velocity(0.0, math.copysign(speed, self.left))
