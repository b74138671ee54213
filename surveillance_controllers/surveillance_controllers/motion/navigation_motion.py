"""Motion for `motion_controller` by its own navigation (SIMULATED mode): sensors, navigator, base.

Reads `map`, `door_states`, `odom`, `scan`, `initialpose`, `stopped` and `paused`; commands
`cmd_vel`; publishes where the robot is (`amcl_pose`) and what stands about that the map does not
have (`obstacles`). Asks `compute_path` for another path when a drive does not go on.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan, PointCloud2

from floor_plans.parameters import zones_from
from lidar_navigation import (
    Drive,
    DriveParameters,
    DriveState,
    Navigator,
    NoPathError,
    Spin,
    Velocity,
)
from lidar_navigation.geometry import Points, Pose, Scan, point_of
from state_machines import Interrupt
from state_machines.ros import CallError, GoalCaller, GoalRun
from surveillance_controllers import conversions
from surveillance_controllers.controller_parameters import MotionSettings, NavigationSettings
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailedError, expect_place
from surveillance_controllers.motion.command_publisher import CommandPublisher
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_interfaces.action import ComputePath
from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.conversions import (
    cloud_from_points,
    point_message,
    pose_estimate,
    pose_from,
    seconds_of,
    stamp_from,
)
from surveillance_runtime.incidents import Severity
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_changes import follow_place
from surveillance_runtime.place_parameters import (
    door_segments,
    door_segments_of,
    place_positions,
    place_zones,
    positions_of,
)
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.sensing.sensors import OdometryReader
from surveillance_runtime.sensing.silence import SensorWatch
from surveillance_runtime.sensing.transforms import MapFrame, ScanReader
from surveillance_runtime.spin_in_place import bearing_of
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

POSE_PERIOD = 0.19
"""Least time between two messages on amcl_pose, seconds: with every second scan at 10 Hz."""
UNSURE_FOR = 10.0
"""A robot that stands and does not know where it is calls somebody after this, seconds of real
time."""
POSE = ('robot', 'pose')
"""The cause of that incident."""


class NavigationMotion:
    """Drives the base along paths, and follows with `robot_place` where it is.

    Args:
        node: The motion controller's node.
        knowledge: Map and ontology.
        recorder: Is told the place that the robot is in.
        settings: The stations, and how long the planner may take to answer.
        navigator: What steers; unless given, one for the doors of the parameters.
    """

    def __init__(
        self,
        node: PatrolNode,
        knowledge: MapKnowledge,
        recorder: PlaceRecorder,
        settings: MotionSettings,
        navigator: Navigator | None = None,
    ) -> None:
        self._node = node
        self._recorder = recorder
        self._wait_for_peer = settings.peer_timeout
        self._robot = node.declare_fields(
            DriveParameters(), prefix='drive.', mode='SIMULATED and ROBOT'
        )
        self._settings = node.declare_fields(NavigationSettings(), mode='SIMULATED and ROBOT')
        self._frames = declared_frames(node, 'map', 'odom', 'base', 'transform_tolerance')
        self._lidar = ScanReader(node, self._robot.radius, self._frames.base)
        guesses = [station.pose for station in settings.stations.values()]
        if settings.start_pose:
            x, y, yaw = settings.start_pose
            guesses = [(x, y, yaw)]
        self._navigator = navigator or Navigator(
            door_segments(node), guesses=guesses, zones=place_zones(node)
        )
        self._navigator.before_search = self._stand_for_search
        self._stands_for_search = False
        self._lock = threading.RLock()
        self._stepped = threading.Condition(self._lock)
        self._steps = 0
        self._awaited: Callable[[], bool] = lambda: False
        self._on_step: Callable[[Pose], None] = lambda _pose: None
        self._pose_sent = float('-inf')
        self._place_told: str | None = None
        self._unsure_since: float | None = None
        self._was_lost = self._was_ambiguous = False
        self._jumps = 0
        self._planner = GoalCaller(node, ComputePath, 'compute_path')
        self._base = CommandPublisher(
            node,
            'cmd_vel',
            (*self._lidar.settings.scans, 'odom'),
            self._robot.deceleration,
            self._warn_of_silence,
            frame=self._frames.base,
        )
        self._poses = OwnedTopic(node, PoseWithCovarianceStamped, 'amcl_pose', repeat=None)
        self._obstacles = OwnedTopic(node, PointCloud2, 'obstacles')
        self._map_frame = MapFrame(node, self._frames)
        positions = place_positions(node)
        self._set_positions(positions)
        knowledge.assume(positions)
        # The places that come and go change what the robot's place can be.
        knowledge.follow_places(self._set_positions)
        self._knowledge = knowledge
        follow_place(node, self._take_place)
        self._hold = Hold(node, self._on_hold)
        StateSubscription(node, OccupancyGrid, 'map', self._on_map, owner='simulator')
        StateSubscription(node, DoorStates, 'door_states', self._on_doors, owner='simulator')
        self._odometry = OdometryReader(node, self._on_odometry)
        self._lidar.subscribe(self._on_scan)
        node.create_subscription(PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, 1)
        self._watch = SensorWatch(
            node,
            self._frames,
            self._lidar.streams,
            self._odometry.stream,
            lambda: 'map' in self._navigator.awaits,
        )

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Drive along a path of shape (n, 3).

        Args:
            path: The path.
            run: The goal that is carried out; its interrupt ends the drive early.
            report: Told the position with each scan, in the executor's thread; must not block.

        Returns:
            Where the robot is then, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        if (bearing := bearing_of(path.tolist())) is not None:
            return self._turn(bearing, run)
        drive = Drive(path[:, :2], self._robot)
        interrupt = run.interrupt
        with self._carrying_out(drive, interrupt, lambda pose: report(point_of(pose))):
            while not drive.state.ended and not interrupt.is_set():
                self._await(
                    lambda: drive.state.ended or drive.state is DriveState.ASKING, interrupt
                )
                if drive.state is DriveState.ASKING and not interrupt.is_set():
                    self._find_another_path(drive, path[-1], run)
        end = point_of(self._navigator.pose or (float('nan'),) * 3)
        if drive.state is DriveState.FAILED:
            raise MotionFailedError(drive.reason, end)
        self._recorder.tell(self._navigator.place_at(end) if self._is_sure else None)
        return end

    def _turn(self, bearing: float, run: GoalRun) -> Points:
        """Turn on the spot; return where the robot is then.

        Raises:
            MotionFailedError: It has no room for that, or its sensors are silent.
        """
        spin = Spin(bearing)
        with self._carrying_out(spin, run.interrupt):
            self._await(lambda: spin.done, run.interrupt)
        end = point_of(self._navigator.pose or (float('nan'),) * 3)
        if spin.done and not spin.has_turned:
            short = math.degrees(abs(spin.left))
            raise MotionFailedError(f'the robot cannot turn: {short:.0f} degrees are left', end)
        return end

    def place_reached(self, goal: Points, end: Points) -> str:
        """Return the place the robot is in after a drive.

        Args:
            goal: Where the robot should be, shape (3,).
            end: Where it is, shape (3,).

        Raises:
            MotionFailedError: It is not in the goal's place.
        """
        if not self._is_sure:
            raise MotionFailedError('the robot does not know in which of several places it is', end)
        return expect_place(self._navigator.place_at(end), self._navigator.place_at(goal), end)

    @property
    def map_frame(self) -> str:
        """The name of the map's frame."""
        return self._frames.map

    def look_around(self, run: GoalRun) -> None:
        """Turn once on the spot, as the place's exploration asks for.

        Raises:
            MotionFailedError: The robot's sensors are silent.
        """
        if self._settings.spin:
            spin = Spin()
            with self._carrying_out(spin, run.interrupt):
                self._await(lambda: spin.done, run.interrupt)

    @property
    def _is_sure(self) -> bool:
        """Whether the robot knows where it is: not lost, and nowhere else as likely."""
        return not (self._navigator.lost or self._navigator.ambiguous)

    @property
    def _place(self) -> str | None:
        """The place the robot is in; None while that is not known."""
        return self._navigator.place if self._is_sure else None

    def _set_positions(self, positions: Mapping[str, Points]) -> None:
        """Take the places: a point in each."""
        with self._lock:
            self._navigator.set_positions(positions)

    def _take_place(self, described: Mapping[str, Any]) -> None:
        positions = positions_of(described)
        self._knowledge.replace_known(positions)
        with self._lock:
            self._navigator.take_place(
                door_segments_of(described), zones_from(described), positions
            )

    def _find_another_path(self, drive: Drive, goal: Points, run: GoalRun) -> None:
        """Ask the planner, and give the drive what it answers."""
        self._node.get_logger().info(f'{drive.reason}: looking for another path')
        pose = self._navigator.pose
        assert pose is not None
        try:
            path = self._ask_planner(point_of(pose), goal, run)
        except NoPathError as error:
            with self._lock:
                drive.no_path(str(error))
        else:
            with self._lock:
                drive.new_path(path)

    def _ask_planner(self, start: Points, goal: Points, run: GoalRun) -> Points:
        request = ComputePath.Goal(start=point_message(start), goal=point_message(goal))
        try:
            end = self._planner.run(
                request,
                accept_timeout=self._wait_for_peer,
                result_timeout=self._wait_for_peer,
                interrupt=run.interrupt,
            )
        except CallError as error:
            raise NoPathError(str(error)) from error
        if end.status != 'succeeded':
            raise NoPathError('the planner finds no other path')
        return conversions.array_from_points(end.result.path)[:, :2]

    @contextmanager
    def _carrying_out(
        self,
        task: Drive | Spin,
        interrupt: Interrupt,
        on_step: Callable[[Pose], None] = lambda _pose: None,
    ) -> Iterator[None]:
        """Hands a task to the navigator; before and afterwards the robot stands."""
        with self._lock:
            self._navigator.task, self._on_step = task, on_step
            self._navigator.stands = self._hold.active
            # A simulator in lockstep waits for a command from the moment the goal is executed on,
            # and the scan of that moment may have come before the task.
            self._base.command(Velocity())
        unsubscribe = interrupt.subscribe(self._wake)
        try:
            yield
        finally:
            unsubscribe()
            with self._lock:
                self._navigator.task = None
                self._base.command(Velocity())

    def _await(self, condition: Callable[[], bool], interrupt: Interrupt) -> None:
        """Wait until a condition holds after a scan, or for the interrupt.

        Raises:
            MotionFailedError: The sensors gave nothing for too long.
        """
        with self._stepped:
            # The worker is woken when there is something to do, not with each scan.
            self._awaited = condition
            while not (condition() or interrupt.is_set()):
                before = self._steps
                woken = self._stepped.wait(self._settings.sensor_timeout)
                if not woken and self._steps == before:
                    topic, pose = self._navigator.missing or 'scan', self._navigator.pose
                    raise MotionFailedError(
                        f'nothing of use came on the topic {topic} for '
                        f'{self._settings.sensor_timeout:g} s',
                        None if pose is None else point_of(pose),
                    )

    def _wake(self) -> None:
        with self._stepped:
            self._stepped.notify_all()

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self._node, 'map'):
            grid = conversions.grid_from(message)
            with self._lock:
                self._navigator.set_map(grid)

    def _on_doors(self, message: DoorStates) -> None:
        with self._lock:
            self._navigator.set_closed(message.closed)

    def _on_hold(self) -> None:
        with self._lock:
            self._navigator.stands = self._hold.active
            if self._hold.active and self._navigator.task is not None:
                # At once: the next scan may be a tenth of a second away.
                self._base.command(Velocity())

    def _on_odometry(self, pose: Pose, measured: float) -> None:
        with self._lock:
            self._base.hear('odom')
            self._navigator.move(pose, measured)

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        with refusing(self._node, 'initialpose'):
            pose, frame = pose_from(message.pose.pose), message.header.frame_id.removeprefix('/')
            if frame not in ('', self._frames.map):
                raise ValueError(f'a pose in the frame {frame!r}: expected {self._frames.map!r}')
            self._node.get_logger().info(f'pose set to ({pose[0]:.2f}, {pose[1]:.2f})')
            with self._lock:
                self._navigator.believe(pose)

    def _on_scan(self, topic: str, scan: Scan, message: LaserScan) -> None:
        self._see(scan, message.header.stamp, topic)

    def _see(self, scan: Scan, stamp: Any, topic: str = 'scan') -> None:
        measured = seconds_of(stamp)
        with self._stepped:
            self._base.hear(topic)
            self._stands_for_search = False
            velocity = self._navigator.see(scan, measured, topic)
            if velocity is not None and self._navigator.task is not None:
                if not self._stands_for_search:
                    self._base.command(velocity)
                if self._navigator.pose is not None:
                    self._on_step(self._navigator.pose)
            self._publish_pose(measured, stamp)
            # Not only a scan makes the robot sure: a pose that somebody tells does, too.
            if self._settings.track_place and self._place != self._place_told:
                self._place_told = self._place
                self._recorder.tell(self._place, stamp)
            self._steps += 1
            if self._navigator.task is not None and self._awaited():
                self._stepped.notify_all()
        self._tell(stamp)

    def _stand_for_search(self) -> None:
        """Brake for as long as a search takes: until the next scan is seen."""
        if self._base.wanted.speed != 0.0:
            self._base.command(Velocity())
            self._stands_for_search = True

    def _warn_of_silence(self, topic: str) -> None:
        self._node.get_logger().warn(f'nothing on the topic {topic}: the robot stands')

    def _publish_pose(self, measured: float, stamp: Any) -> None:
        told = self._navigator.told_pose(measured)
        if told is None or 0 <= measured - self._pose_sent < POSE_PERIOD:
            return
        pose, at = told
        if at != measured:
            stamp = stamp_from(round(1e9 * at))
        deviation = (0.03, 0.02) if self._is_sure else (5.0, 3.0)
        estimate = PoseWithCovarianceStamped(pose=pose_estimate(pose, *deviation))
        estimate.header.frame_id, estimate.header.stamp = self._frames.map, stamp
        self._pose_sent = measured
        self._poses.publish(estimate)

    def _tell(self, stamp: Any) -> None:
        navigator = self._navigator
        if navigator.pose is None:
            return
        self._tell_of_doubt()
        if navigator.lost != self._was_lost:
            self._was_lost = navigator.lost
            if navigator.lost:
                self._node.get_logger().warn('pose lost: the scans do not fit the map')
        if navigator.ambiguous != self._was_ambiguous:
            self._was_ambiguous = navigator.ambiguous
            if navigator.ambiguous:
                self._node.get_logger().info(
                    'the robot may be in one of several places that look alike: which one is told '
                    'once something tells them apart'
                )
        if navigator.jumps != self._jumps:
            self._jumps = navigator.jumps
            x, y, _ = navigator.pose
            self._node.get_logger().info(f'pose found at ({x:.2f}, {y:.2f})')
        if navigator.obstacles_changed:
            navigator.obstacles_changed = False
            cloud = cloud_from_points(
                navigator.obstacles, self._frames.map, stays=navigator.obstacles_stay
            )
            cloud.header.stamp = stamp
            self._obstacles.publish(cloud)
        if navigator.odometry is not None:
            offset = self._odometry.stream.offset
            self._map_frame.publish(navigator.pose, navigator.odometry, stamp, offset)

    def _tell_of_doubt(self) -> None:
        """Call somebody for a robot that stands and does not know where it is."""
        if self._is_sure:
            self._unsure_since = None
            self._node.incidents.end(POSE, 'the robot knows where it is')
            return
        now = time.monotonic()
        if self._unsure_since is None:
            self._unsure_since = now
        if now - self._unsure_since < UNSURE_FOR or self._navigator.task is not None:
            return
        why = 'what it sees is nowhere on the map'
        if not self._navigator.lost:
            *others, last = self._navigator.may_be_in or ('a place without a name',)
            here = f'{", ".join(others)} or {last}' if others else last
            why = f'it may be in {here}, at poses that look alike'
        self._node.incidents.begin(
            POSE,
            f'the robot does not know where it is: {why}; drive it about, or tell its pose on '
            'initialpose (2D Pose Estimate in RViz)',
            Severity.ALARM,
        )
