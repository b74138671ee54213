"""A robot that explores a building by itself, and comes back.

With each scan the robot goes on along its way (`see`, at once). Now and then it thinks
(`think`, up to a second on a large map): it adds what it saw to the map, finds the frontiers that
are left and takes the best. It goes to the next one as soon as the one ahead has been seen. A
frontier that it cannot reach is given up, with the reason. When none is left it drives back to
where it began.
"""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

import numpy as np

from floor_plans import Grid
from floor_plans.occupancy_grid import distance_to
from lidar_navigation.driving.driving import Drive, DriveState, Spin
from lidar_navigation.driving.path_following import DriveParameters, Velocity
from lidar_navigation.exploration.frontiers import Frontier, FrontierParameters, find_frontiers
from lidar_navigation.exploration.map_building import MapBuilder
from lidar_navigation.geometry import Points, Pose, Scan, composed, in_map, relative
from lidar_navigation.planning.grid_planning import GridPlanner, NoPathError, PlanningParameters

_SEEN_ENOUGH = 0.3
"""The robot goes on when less than this part of the frontier ahead is left,"""
_BETTER = 1.5
"""or when another one is worth so much more, metres."""
_FOUND_AT_HOME = 0.3
"""The robot is back within this distance of its start, metres."""
_MAP_WITHIN = 8.0
"""What the robot sees goes into the map within this time, seconds; slam_toolbox takes 5."""
_NEAR_WALL = 0.15
"""A point this near to what the map has is no obstacle of its own, metres."""
_WAITS, _TRIES = 10.0, 3
"""For who stands in the way the robot waits so long, seconds, before it tries what is left once
more; so often."""
_BLIND_SPOT = 'what lies behind cannot be seen from beside it'
_TOO_NARROW = 'the robot does not fit there'
_ALL_AROUND = 6.0
"""A lidar that sees less than this, rad, turns once before the first drive."""


class Phase(Enum):
    """What the robot is about."""

    STARTING = 'waiting for the first scan'
    LOOKING = 'looking around'
    EXPLORING = 'exploring'
    RETURNING = 'driving back'
    DONE = 'done'


class Mapping(Protocol):
    """What builds the map, or follows it: `MapBuilder` or `ForeignMap`."""

    start: Pose

    def pose(self, odometry: Pose) -> Pose:
        """Return where the robot is on the map while its odometry says this."""

    def is_due(self, odometry: Pose) -> bool:
        """Tell whether a scan that is made here changes the map."""

    def see(self, scan: Scan, odometry: Pose, *, keep: bool = False) -> bool:
        """Take a scan; tell whether the map changed."""

    def grid(self) -> Grid:
        """Return the map as it is now."""


@dataclass(frozen=True, eq=False)
class GivenUp:
    """A frontier that was left.

    Attributes:
        point: Where, shape (2,), metres.
        length: How long it was, metres.
        reason: Why.
    """

    point: Points
    length: float
    reason: str


@dataclass(eq=False)
class Exploration:
    """Explores with one robot. `see` and `think` may be called from two threads.

    Args:
        builder: Builds the map.
        drive: How the robot drives.
        planning: How its ways are planned.
        frontiers: Which frontier comes first.

    Attributes:
        phase: What the robot is about.
        goal: The frontier that it drives to.
        reason: Why the robot is not back at its start, if it is not.
        bent: From where scans were made that contradict the map, though it was mended; empty: it
            agrees with all that was seen.
    """

    builder: Mapping
    drive: DriveParameters = field(default_factory=DriveParameters)
    planning: PlanningParameters = field(default_factory=PlanningParameters)
    frontiers: FrontierParameters = field(default_factory=FrontierParameters)
    phase: Phase = field(default=Phase.STARTING, init=False)
    goal: Frontier | None = field(default=None, init=False)
    reason: str = field(default='', init=False)
    bent: list[Pose] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        self._lock = threading.Lock()
        self._grid: Grid | None = None
        self._planner: GridPlanner | None = None
        self._task: Drive | Spin | None = None
        self._scan: tuple[Scan, Pose] | None = None
        self._pending: tuple[Scan, Pose] | None = None
        self._correction: Pose | None = None
        self._left: list[Frontier] = []
        self._spent: list[tuple[Points, str]] = []
        self._looked = False
        self._mended_at = -1
        self._tries = 0
        self._waits_until: float | None = None
        self._now = self._arrived_at = self._stood = 0.0
        self._heard_at: float | None = None

    @property
    def grid(self) -> Grid | None:
        """The map as it is known; None before the first scan."""
        return self._grid

    @property
    def correction(self) -> Pose | None:
        """Where the odometry's frame lies on the map; None before the first scan."""
        return self._correction

    @property
    def unreached(self) -> list[GivenUp]:
        """What was left unknown, and why, given the map as it is now."""
        return [
            GivenUp(each.middle, each.length, self._why(each))
            for each in self._left
            if each.viewpoint is None
        ]

    def _why(self, frontier: Frontier) -> str:
        """Return why a frontier cannot be looked over."""
        reach = self.frontiers.beside + self.frontiers.spent
        for point, reason in reversed(self._spent):
            if np.hypot(*(frontier.points - point).T).min() <= reach:
                return reason
        return _TOO_NARROW

    def pose(self, odometry: Pose) -> Pose:
        """Return where the robot is on the map while its odometry says this."""
        correction = self._correction
        return self.builder.start if correction is None else composed(correction, odometry)

    def see(
        self, scan: Scan, odometry: Pose, now: float, *, stands: bool = False, maps: bool = True
    ) -> Velocity:
        """Take a scan, and return with which velocity to go on.

        Args:
            scan: As seen from where the robot was when the odometry said this.
            odometry: Where the odometry had the robot, in its own frame.
            now: The time, seconds.
            stands: The robot is to stand where it is; no time passes for what is under way, which
                then goes on.
            maps: Whether where it was made is known; else it is driven by, and no part of the map.
        """
        with self._lock:
            if stands and self._heard_at is not None:
                self._stood += now - self._heard_at
            self._heard_at = now
            self._now = now = now - self._stood
            if maps:
                self._scan = scan, odometry
            if maps and self._pending is None and self.builder.is_due(odometry):
                self._pending = scan, odometry
            pose = self.pose(odometry)
            if stands:
                return Velocity()
            if isinstance(self._task, Drive):
                if self._task.state.ended:
                    return Velocity()
                return self._task.step(now, pose, scan.points)
            if isinstance(self._task, Spin):
                return self._task.step(pose[2], now)
            return Velocity()

    def stop(self) -> None:
        """Give up what is under way; the map stays as it is."""
        with self._lock:
            self._task, self.phase = None, Phase.DONE

    def think(self) -> bool:
        """Add what was seen to the map and decide where to go; tell whether the map changed."""
        changed = self._map()
        if self._grid is None or self._scan is None or self.phase is Phase.DONE:
            return changed
        if self.phase is Phase.STARTING:
            with self._lock:
                angles = self._scan[0].angles
                narrow = float(angles.max() - angles.min()) < _ALL_AROUND
                self._task = Spin() if narrow else None
                self.phase = Phase.LOOKING if narrow else Phase.EXPLORING
        if self.phase is Phase.LOOKING:
            if isinstance(self._task, Spin) and not self._task.done:
                return changed
            self.phase = Phase.EXPLORING
        if self.phase is Phase.EXPLORING:
            self._explore(changed)
        if self.phase is Phase.RETURNING:
            self._return(changed)
        return changed

    def _map(self) -> bool:
        """Add the scan that waits to the map, if there is one."""
        with self._lock:
            waiting = self._pending
        if waiting is None:
            return False
        scan, odometry = waiting
        changed = self.builder.see(scan, odometry, keep=self._looked)
        if changed:
            grid = self.builder.grid()
            planner = GridPlanner(grid, self.planning)
        with self._lock:
            self._pending = None
            if changed:
                pose = self.builder.pose(odometry)
                self._correction = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))
                self._grid, self._planner = grid, planner
        return changed

    @property
    def _here(self) -> Pose:
        assert self._scan is not None
        return self.pose(self._scan[1])

    def _explore(self, changed: bool) -> None:
        task = self._task
        driving = isinstance(task, Drive) and not task.state.ended
        if isinstance(task, Drive) and self.goal is not None:
            if task.state is DriveState.FAILED:
                self._give_up(self.goal, task.reason)
                changed = True
            elif task.state is DriveState.ARRIVED:
                if not self._looked:
                    self._looked, self._arrived_at = True, self._now
                    changed = False
                if not changed and self._now - self._arrived_at < _MAP_WITHIN:
                    # What is seen from here first goes into the map.
                    with self._lock:
                        self._pending = self._scan
                    return
                if self._part_left(self.goal) > _SEEN_ENOUGH:
                    self._give_up(self.goal, _BLIND_SPOT)
                changed = True
            elif task.state is DriveState.ASKING and not self._plan(self.goal.viewpoint):
                return
        if driving and not changed:
            return
        self._choose()

    def _choose(self) -> None:
        """Take the best frontier that is left, or drive back."""
        assert self._grid is not None
        assert self._planner is not None
        while True:
            spent = np.array([point for point, _ in self._spent]).reshape(-1, 2)
            self._left = find_frontiers(
                self._grid, self._planner.cost, self._here, self.frontiers, spent
            )
            able = [each for each in self._left if each.viewpoint is not None]
            if not able and self._mend():
                continue
            if not able and self._is_barred():
                if self._waits():
                    return
                continue
            if not able:
                self.goal = None
                self.phase = Phase.RETURNING
                with self._lock:
                    self._task = None
                return
            chosen = able[0]
            if self.goal is not None:
                same = min(able, key=lambda each: self._apart(each, self.goal))
                if self._apart(same, self.goal) < 1.0 and same.worth < chosen.worth + _BETTER:
                    chosen = same
            if self._plan(chosen.viewpoint):
                self.goal = chosen
                return
            self._give_up(chosen, self.reason)

    def _is_barred(self) -> bool:
        """Tell whether something is left only because of what stood in the way, maybe people."""
        reasons = {self._why(each) for each in self._left if each.viewpoint is None}
        return self._tries < _TRIES and bool(reasons - {_BLIND_SPOT})

    def _waits(self) -> bool:
        """Stand for a while; tell whether it still does. Then what was barred is tried again."""
        if self._waits_until is None:
            self._waits_until = self._now + _WAITS
            with self._lock:
                self._task, self.goal = None, None
        if self._now < self._waits_until:
            return True
        self._waits_until = None
        self._tries += 1
        self._spent = [each for each in self._spent if each[1] == _BLIND_SPOT]
        # Who stood in a doorway is in the map until it is seen without them.
        with self._lock:
            self._pending, self._looked = self._scan, True
        self._map()
        return False

    def _mend(self) -> bool:
        """Look whether the map contradicts itself, before it is called whole; tell whether it
        changed by that, so that there may be more to see.
        """
        if not isinstance(self.builder, MapBuilder) or self._mended_at == self.builder.kept:
            return False
        self._mended_at = self.builder.kept
        loops = self.builder.loops
        self.bent = self.builder.repair()
        if self.builder.loops == loops or self._scan is None:
            return False
        grid, odometry = self.builder.grid(), self._scan[1]
        planner = GridPlanner(grid, self.planning)
        with self._lock:
            pose = self.builder.pose(odometry)
            self._correction = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))
            self._grid, self._planner = grid, planner
        return True

    def is_behind(self, odometry: Pose) -> bool:
        """Tell whether the robot is so far from where a scan waits to be mapped that the next one
        is due: what lies between may be too far to be matched.
        """
        with self._lock:
            if self._pending is None or not isinstance(self.builder, MapBuilder):
                return False
            step = relative(self._pending[1], odometry)
        p = self.builder.parameters
        return math.hypot(*step[:2]) >= p.keep_distance or abs(step[2]) >= p.keep_turn

    @staticmethod
    def _apart(first: Frontier, second: Frontier | None) -> float:
        """Return how far two frontiers are from each other, metres."""
        if second is None:
            return math.inf
        return float(np.hypot(*(first.points - second.middle).T).min())

    def _part_left(self, frontier: Frontier) -> float:
        """Return the part of a frontier's cells that still lie beside the unknown."""
        assert self._grid is not None
        unknown = (self._grid.cells < 0).astype(np.uint8)
        away = distance_to(unknown.astype(np.bool_), self._grid.resolution)
        cells = self._grid.cells_of(frontier.points)
        inside = self._grid.contains(cells)
        row, column = cells[inside].T
        return float((away[row, column] <= 1.5 * self._grid.resolution).mean())

    def _give_up(self, frontier: Frontier, reason: str) -> None:
        assert frontier.viewpoint is not None
        self._spent.append((frontier.viewpoint, reason))
        self.goal = None

    def _plan(self, goal: Points | None) -> bool:
        """Plan a way and set out on it; tell whether there is one, else `reason` says why."""
        assert self._planner is not None
        assert self._scan is not None
        assert self._grid is not None
        scan, odometry = self._scan
        pose = self.pose(odometry)
        points = in_map(pose, scan.points)
        away = self._grid.interpolated(
            distance_to(self._grid.occupied, self._grid.resolution), points
        )
        try:
            self._planner.set_obstacles(points[away > _NEAR_WALL])
            path = self._planner.plan(
                pose[:2], goal if goal is not None else self.builder.start[:2]
            )
        except NoPathError as error:
            self.reason = str(error)
            with self._lock:
                if isinstance(self._task, Drive) and self._task.state is DriveState.ASKING:
                    self._task.no_path(self.reason)
                    return not self._task.state.ended
            return False
        with self._lock:
            if isinstance(self._task, Drive) and not self._task.state.ended:
                self._task.new_path(path)
            else:
                self._task = Drive(path, self.drive)
            self._looked = False
        self.reason = ''
        return True

    def _return(self, changed: bool) -> None:
        task = self._task
        if isinstance(task, Drive) and task.state.ended:
            self.reason = task.reason if task.state is DriveState.FAILED else ''
            if math.dist(self._here[:2], self.builder.start[:2]) <= _FOUND_AT_HOME:
                self.reason = ''
            self.phase = Phase.DONE
            return
        wants = not isinstance(task, Drive) or task.state is DriveState.ASKING or changed
        if wants and not self._plan(None) and not isinstance(self._task, Drive):
            self.phase = Phase.DONE
