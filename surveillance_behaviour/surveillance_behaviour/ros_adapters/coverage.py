"""What of each place was in view, on the latched topic `coverage`, and the driving of a sweep.

By the map and by where the robot was: what `amcl_pose` tells is looked at on a thread of its own,
which holds the floor (`lidar_navigation.coverage`). A mission without a map, or whose places come
from markers, has no coverage, and sweeps nothing.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid

from floor_plans import ROBOT_RADIUS, Grid
from floor_plans.parameters import patrol_rules
from lidar_navigation import PlaceLocator
from lidar_navigation.coverage import (
    FloorSweep,
    PlaceFloors,
    SeenFloor,
    SeenFraction,
    SweepPlanner,
)
from patrol_policy.decision import DecisionSettings
from state_machines import Interrupt
from state_machines.ros import GoalCaller
from strict_files.settings import parameter
from surveillance_behaviour.ports import Point
from surveillance_behaviour.ros_adapters.peers import Deadlines, run
from surveillance_interfaces.action import ComputePath, FollowPath
from surveillance_interfaces.msg import PlaceCoverage, PlaceCoverages
from surveillance_runtime.conversions import (
    map_from,
    point_from,
    point_message,
    point_messages,
    pose_of_serialized,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.place_parameters import (
    door_segments,
    door_segments_of,
    place_positions,
    positions_of,
)
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.spin_in_place import spin_path
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

STEP, TURN = 0.25, 0.35
"""What is in view is looked at again when the robot went or turned so far, metres and rad."""
PERIOD = 2.0
"""Between two messages, seconds of real time."""
MOST_CELLS = 100_000_000
"""Of a map."""
OTHERWISE = 0.2
"""A sweep that takes longer or shorter by this part changes what a visit is taken to last."""
Pose = tuple[float, float, float]


@dataclass(frozen=True)
class CoverageSettings:
    """What counts as seen."""

    range: float = parameter(
        6.0, 'The floor counts as seen that the lidar has in view within so far, m.', 0.5, 100.0
    )
    camera_range: float = parameter(
        0.0,
        'And that the camera has in view within so far, m, looking ahead; 0: no camera counts. '
        'A sweep then turns the robot at each stop.',
        0.0,
        100.0,
    )
    camera_angle: float = parameter(
        1.05, 'How much of the horizon the camera shows, rad.', 0.1, math.tau
    )

    @property
    def camera(self) -> tuple[float, float] | None:
        """How far the camera shows the floor, metres, and how much of the horizon, rad; or None."""
        return (self.camera_range, self.camera_angle) if self.camera_range else None


@dataclass(frozen=True)
class _Swept:
    sweep: tuple[str, ...] = parameter(
        (),
        'Places that are too large to be seen from their point: a visit covers all of each.',
        of=str,
    )
    radius: float = parameter(
        ROBOT_RADIUS, 'Radius of the robot, m.', 0.01, 20.0, name='robot_radius'
    )


@dataclass(frozen=True)
class _SweptPlaces:
    """What the place's parameters say that matters here."""

    positions: Mapping[str, Any]
    doors: Mapping[str, tuple[float, float, float, float]]
    swept: frozenset[str]
    thresholds: Mapping[str, float]


@dataclass(frozen=True)
class SeenMap:
    """What follows from a map and its places."""

    floor: SeenFloor
    places: PlaceFloors
    planner: SweepPlanner

    @classmethod
    def of(
        cls, grid: Grid, place: _SweptPlaces, settings: CoverageSettings, radius: float
    ) -> SeenMap:
        """Return a map of which nothing was seen yet."""
        camera = settings.camera
        floor = SeenFloor(grid, settings.range, camera)
        rooms = PlaceLocator(place.doors.values())
        rooms.set_map(floor.grid)
        rooms.set_positions(place.positions)
        found = {name: rooms.cells_of(name) for name in place.positions}
        floors = {name: cells for name, cells in found.items() if cells is not None}
        reach = settings.range if camera is None else min(settings.range, camera[0])
        planner = SweepPlanner(floor.grid, radius, reach)
        return cls(floor, PlaceFloors(floor.grid, floors), planner)


class RosCoverage:
    """Hears `map`, `amcl_pose` and `place`, and tells `coverage`.

    Args:
        node: The node.
        choice: The parameters of decisions, which may change.
        now: Seconds on the mission's clock.

    Attributes:
        settings: What counts as seen.
        known: What follows from the map; None: nobody knows one.
        pose: Where the robot is, x, y in metres and yaw; None: nobody has said.
        metres: How far it was seen to go.
    """

    def __init__(
        self, node: PatrolNode, choice: DecisionSettings, now: Callable[[], float]
    ) -> None:
        self._node, self._choice, self._now = node, choice, now
        self.settings = node.declare_fields(CoverageSettings(), prefix='coverage.')
        own = node.declare_fields(_Swept())
        self._radius = own.radius
        self._place = _SweptPlaces(
            place_positions(node),
            door_segments(node),
            frozenset(own.sweep),
            {name: float(each) for name, each in node.parameters_under('thresholds').items()},
        )
        self._grid: Grid | None = None
        self.known: SeenMap | None = None
        self.pose: Pose | None = None
        self.metres = 0.0
        self._looked_from: Pose | None = None
        self._poses: deque[tuple[Pose, float]] = deque()
        self._lock = threading.Lock()
        self._wake = Interrupt()
        self._topic = OwnedTopic(node, PlaceCoverages, 'coverage')
        StateSubscription(node, OccupancyGrid, 'map', self._on_map, owner='simulator')
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            raw=True,
            owner='motion_controller',
        )
        follow_place(node, self._on_place)
        node.stopping.subscribe(self._wake.set)
        node.spawn(self._follow, 'coverage')

    @property
    def swept(self) -> frozenset[str]:
        """The places of which a visit is to cover all."""
        return self._place.swept

    @property
    def places(self) -> frozenset[str]:
        """All places that the parameters describe."""
        return frozenset(self._place.positions)

    def threshold(self, place: str) -> float:
        """Return after how many seconds without a visit a place is URGENT."""
        return self._place.thresholds.get(place, self._choice.urgency_threshold)

    def fractions(self) -> dict[str, SeenFraction]:
        """Return how much of each place was in view within its threshold; from any thread."""
        known, now = self.known, self._now()
        if known is None:
            return {}
        since = {name: now - self.threshold(name) for name in known.places.names}
        with self._lock:
            return known.places.fractions(known.floor, since)

    def share_since(self, place: str, since: float) -> float:
        """Return which part of a place was in view since a time, by all that counts."""
        self.see()
        if (known := self.known) is None:
            return 0.0
        times = dict.fromkeys(known.places.names, math.inf) | {place: since}
        with self._lock:
            found = known.places.fractions(known.floor, times)
        return found[place].counted if place in found else 0.0

    def see(self) -> None:
        """Take what is in view from where the robot was until now; from any thread."""
        known, pose = self.known, self.pose
        if known is None:
            return
        with self._lock:
            while self._poses:
                (x, y, heading), at = self._poses.popleft()
                known.floor.see((x, y), heading, at)
            if pose is not None:
                known.floor.see(pose[:2], pose[2], self._now())

    # In the executor's thread.

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self._node, 'map'):
            self._grid, self.known = map_from(message, MOST_CELLS), None
            self._wake.set()

    def _on_place(self, described: Mapping[str, Any]) -> None:
        rules = patrol_rules(described)
        self._place = _SweptPlaces(
            positions_of(described), door_segments_of(described), rules.swept, rules.thresholds
        )
        self.known = None
        self._wake.set()

    def _on_pose(self, serialized: bytes) -> None:
        with refusing(self._node, 'amcl_pose'):
            x, y, yaw = pose_of_serialized(serialized)
            pose = self.pose = float(x), float(y), float(yaw)
            last = self._looked_from
            moved = math.inf if last is None else math.dist(last[:2], pose[:2])
            turned = 0.0 if last is None else abs(math.remainder(last[2] - yaw, math.tau))
            if moved >= STEP or (self.settings.camera is not None and turned >= TURN):
                self.metres += moved if last is not None else 0.0
                self._looked_from = pose
                self._poses.append((pose, self._now()))
                self._wake.set()

    # In its own thread.

    def _follow(self) -> None:
        """Look at what is in view from where the robot is, and tell the coverage now and then."""
        said: object = None
        told_at = -math.inf
        while not self._node.stopping.is_set():
            self._wake.wait(PERIOD)
            self._wake.clear()
            grid, place = self._grid, self._place
            if self.known is None and grid is not None and place.positions:
                self.known = SeenMap.of(grid, place, self.settings, self._radius)
            if self.known is None:
                continue
            self.see()
            if time.monotonic() - told_at >= PERIOD and (shares := self.fractions()) != said:
                told_at, said = time.monotonic(), shares
                self._topic.publish(self._message(shares))

    def _message(self, shares: Mapping[str, SeenFraction]) -> PlaceCoverages:
        now = self._now()
        return PlaceCoverages(
            places=[
                PlaceCoverage(
                    place=name,
                    began=_time(max(0.0, now - self.threshold(name))),
                    ended=_time(now),
                    share=share.seen,
                    area=share.area,
                    camera_share=share.shown,
                )
                for name, share in shares.items()
            ]
        )


class RosSweep:
    """Drives a sweep by `compute_path` and `follow_path`; in the machine's thread.

    Args:
        node: The node.
        coverage: What was in view.
        deadlines: Of the actions.
    """

    def __init__(self, node: PatrolNode, coverage: RosCoverage, deadlines: Deadlines) -> None:
        self._coverage, self._deadlines = coverage, deadlines
        self._sweep: FloorSweep | None = None
        self._since, self._place, self._metres_before = 0.0, '', 0.0
        self._seconds: dict[str, float] = {}
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        self._follower = GoalCaller(node, FollowPath, 'follow_path')

    @property
    def sweeps_any(self) -> bool:
        """Whether there is a place that is swept."""
        return bool(self._coverage.swept) or len(self._coverage.places) == 1

    def seconds(self) -> Mapping[str, float]:
        """Return how long a sweep of each place takes that was swept, seconds."""
        return dict(self._seconds)

    def is_swept(self, place: str) -> bool:
        """Tell whether a visit is to cover all of a place."""
        return place in self._coverage.swept

    def threshold(self, place: str) -> float:
        """Return after how many seconds without a visit a place is URGENT."""
        return self._coverage.threshold(place)

    def position(self) -> Point | None:
        """Return where the robot is; None: nobody has said."""
        pose = self._coverage.pose
        return None if pose is None else (pose[0], pose[1], 0.0)

    def begin(self, place: str, since: float) -> float | None:
        """Begin to sweep a place; return the metres of the way, None where it is not known."""
        known, here = self._coverage.known, self.position()
        cells = None if known is None else known.places.of(place)
        if known is None or cells is None or here is None:
            return None
        reachable = known.planner.reachable(cells, here[:2])
        self._sweep = FloorSweep(known.floor, known.planner, reachable, since)
        self._since, self._place = since, place
        self._metres_before = self._coverage.metres
        return self._sweep.metres(here[:2])

    def next_stop(self) -> Point | None:
        """Return where to drive next; None: nothing that can be seen is left."""
        sweep, here = self._sweep, self.position()
        if sweep is None or here is None:
            return None
        self._coverage.see()
        stop = sweep.next_stop(here[:2])
        return None if stop is None else (*stop, 0.0)

    def leave_out(self, stop: Point) -> None:
        """Take note that a stop cannot be reached."""
        if self._sweep is not None:
            self._sweep.leave_out(stop[:2])

    def drive(self, stop: Point, interrupt: Interrupt) -> None:
        """Drive to a point in the same place, and turn the camera around there if it counts."""
        limits, start = self._deadlines, self.position() or stop
        request = ComputePath.Goal(start=point_message(start), goal=point_message(stop))
        planned = run(self._planner, request, limits.answer, limits.plan, interrupt)
        self._follow([point_from(each) for each in planned.path], interrupt)
        camera, sweep = self._coverage.settings.camera, self._sweep
        known, here = self._coverage.known, self.position()
        if camera is None or known is None or sweep is None or here is None:
            return
        self._coverage.see()
        for bearing in known.planner.bearings(here[:2], sweep.left, camera[1]):
            self._follow(spin_path(here, bearing), interrupt)
            self._coverage.see()

    def _follow(self, path: Sequence[Point], interrupt: Interrupt) -> None:
        limits = self._deadlines
        goal = FollowPath.Goal(path=point_messages(path))
        run(self._follower, goal, limits.answer, limits.move, interrupt)

    def end(self, seconds: float | None) -> tuple[float, float]:
        """End the sweep; return which part was in view since its time, and the metres driven."""
        self._sweep = None
        if seconds is not None:
            before = self._seconds.get(self._place, 0.0)
            if abs(seconds - before) > OTHERWISE * max(before, 1.0):
                self._seconds[self._place] = seconds
        part = self._coverage.share_since(self._place, self._since)
        return part, self._coverage.metres - self._metres_before

    def covered(self) -> Mapping[str, float]:
        """Return which part of each place was in view within its threshold."""
        return {name: share.counted for name, share in self._coverage.fractions().items()}


def _time(seconds: float) -> Time:
    whole = math.floor(seconds)
    return Time(sec=whole, nanosec=int((seconds - whole) * 1e9))
