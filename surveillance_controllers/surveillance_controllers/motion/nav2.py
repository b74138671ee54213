"""Motion for `motion_controller` by Nav2.

A path becomes a NavigateThroughPoses goal, so that Nav2 goes the way that was planned here, through
the doors that are open. (Its action FollowPath has the name of this project's own, `follow_path`.)
A path that only says where to turn (`spin_in_place`) becomes a Spin goal.

Where the robot is, `map -> odom -> base` on `tf` says, else `amcl_pose`. Where no other program
tells `amcl_pose` (slam_toolbox, RTAB-Map, Cartographer), this one does, from `tf`: planner, battery
and page read it. Where `tf` had the robot when a scan was made, the scan shows which doors are
shut. A pose that does not fit what the lidar sees is told of, and no visit is believed.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import LaserScan

from lidar_navigation import PlaceLocator
from lidar_navigation.geometry import (
    Points,
    Pose,
    Scan,
    angle_between,
    distance_nearest,
    equally_spaced,
    length,
    point_of,
    points_passed,
)
from lidar_navigation.robot_base import robot_radius
from state_machines import Interrupt
from state_machines.ros import GoalEnd, GoalRun
from surveillance_controllers import conversions
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailedError, expect_place
from surveillance_controllers.motion.door_teller import DoorTeller
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.nav2_goals import (
    DRIVING_SERVERS,
    GoalCanceller,
    Nav2Goals,
    OtherGoals,
    nav2_actions,
    reason_of,
)
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_controllers.motion.placed_scans import PlacedScans
from surveillance_controllers.motion.pose_doubt import PoseDoubt
from surveillance_controllers.motion.pose_reports import POSE
from surveillance_runtime.conversions import (
    pose_estimate,
    pose_from,
    pose_message,
    seconds_of,
    stamp_from,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_parameters import door_segments, place_positions
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.sensing.frames_heard import FramesHeard
from surveillance_runtime.sensing.transforms import ScanReader
from surveillance_runtime.spin_in_place import bearing_of
from surveillance_runtime.state_topics import StateSubscription

SPACING = 1.5
"""The largest distance of the poses that Nav2 is led through, metres."""
SPIN_ALLOWANCE = Duration(sec=30)
"""So long a turn on the spot may take."""
MOST_POSES = 10_000
"""A path that would need more poses is led through poses farther apart."""
FRESH = 1.5
"""A pose on `tf` counts for so long, and one on `amcl_pose` at the end of a way, seconds. (AMCL
tells none until the robot has moved 0.25 m.)"""
POSE_PERIOD = 0.2
"""Time between two looks at where `tf` has the robot, seconds."""
STALLED = 90.0
"""A robot that has not moved for so long on its way is not brought there, seconds: some server
never answers, or a costmap does not clear. Nav2's own recoveries are through before."""
MOVED = 0.25
"""It has moved when it is this far from where it was, metres."""


@dataclass(frozen=True)
class _RadiusSetting:
    radius: float = robot_radius()


@dataclass
class DriveProgress:
    """How far one drive is, by Nav2's feedback.

    Attributes:
        position: Where the robot is, shape (3,), metres; None: Nav2 has not said it.
        recoveries: How often Nav2 had to recover.
        left: How far it still has to go, metres; None: Nav2 has not said it.
        anchor: Where it was when it had last moved.
        moved_at: When that was, seconds.
    """

    moved_at: float
    position: Points | None = None
    recoveries: int = 0
    left: float | None = None
    anchor: Points | None = None

    def take(self, feedback: Any, now: float) -> Points | None:
        """Take a feedback message; return where the robot is, None where it does not say it."""
        self.recoveries = int(getattr(feedback, 'number_of_recoveries', 0))
        left = float(getattr(feedback, 'distance_remaining', math.nan))
        self.left = left if math.isfinite(left) and left >= 0.0 else self.left
        point: Points = conversions.array_from_points([feedback.current_pose.pose.position])[0]
        if not np.isfinite(point).all():
            return None
        self.position = point
        if self.anchor is None or float(np.linalg.norm(point - self.anchor)) >= MOVED:
            self.anchor, self.moved_at = point, now
        return point

    def words(self) -> str:
        """Return what there was on the way, to be added to a reason; empty: nothing."""
        said = []
        if self.recoveries:
            said.append(f'after {self.recoveries} recoveries')
        if self.left:
            said.append(f'{self.left:.1f} m before its end')
        return ''.join(f', {each}' for each in said)


class Nav2Motion:
    """Has a running Nav2 drive the base.

    Args:
        node: The motion controller's node.
        knowledge: Map and ontology.
        recorder: Is told the place that the robot is in, by its pose and the topic `map`.
        settings: How long Nav2 may take to accept a goal.

    Raises:
        ParameterError: nav2_msgs is not installed.
    """

    def __init__(
        self,
        node: PatrolNode,
        knowledge: MapKnowledge,
        recorder: PlaceRecorder,
        settings: MotionSettings,
    ) -> None:
        self._node = node
        self._recorder = recorder
        self._type, self._spin = nav2_actions(
            'navigator', 'nav2', 'own', 'NavigateThroughPoses', 'Spin'
        )
        self._frames = declared_frames(node, 'map', 'odom', 'base')
        self.hold = Hold(node)
        wait = settings.peer_timeout
        name = 'navigate_through_poses'
        self._navigator = Nav2Goals(node, self.hold, self._type, name, DRIVING_SERVERS, wait)
        spinning = 'behavior_server', 'velocity_smoother', 'collision_monitor'
        self._spinner = Nav2Goals(node, self.hold, self._spin, 'spin', spinning, wait)
        self._others = OtherGoals(node)
        self._orphans = GoalCanceller(node, 'follow_path')
        self._lock = threading.Lock()
        self._places = PlaceLocator(door_segments(node).values())
        # Of the last pose: where, and when it was heard, steady seconds.
        self._pose: Pose | None = None
        self._heard_at = -math.inf
        self._drive: tuple[DriveProgress, Interrupt, GoalRun] | None = None
        positions = place_positions(node)
        self._places.set_positions(positions)
        knowledge.assume(positions)
        knowledge.follow_places(self._set_positions)
        self._tf = FramesHeard(node, news=lambda: self._scans.look())
        self._scans = PlacedScans(
            self._tf.tree, self._frames.base, self._frames.map, self._on_placed
        )
        self._own_poses: Any = None
        self._doubt = PoseDoubt()
        StateSubscription(node, OccupancyGrid, 'map', self._on_map, owner='simulator')
        StateSubscription(
            node,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            stamp=lambda told: seconds_of(told.header.stamp),
        )
        self._doors = DoorTeller(node, door_segments(node))
        lidar = ScanReader(node, node.declare_fields(_RadiusSetting()).radius, self._frames.base)
        lidar.subscribe(self._on_scan)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(POSE_PERIOD, self._look, clock=steady)

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Send the robot along a path of shape (n, 3).

        Returns:
            Where the robot is then, shape (3,).

        Raises:
            MotionFailedError: It did not get there.
        """
        if (bearing := bearing_of(path.tolist())) is not None:
            return self._turn(bearing, path[0], run)
        progress, stalled = DriveProgress(run.now()), Interrupt()

        def make() -> Any:
            # A goal that is sent again gets what is left of the way.
            left = path if progress.position is None else rest_of(path, progress.position)
            progress.moved_at = run.now()
            return self._type.Goal(poses=self._poses(left))

        def on_feedback(feedback: Any) -> None:
            if (point := progress.take(feedback, run.now())) is not None:
                report(point)

        self._drive = progress, stalled, run
        try:
            end = self._navigator.send(make, run, on_feedback, also=stalled)
        except MotionFailedError as error:
            raise MotionFailedError(f'{error}{progress.words()}', progress.position) from error
        finally:
            self._drive = None
        if end is None:
            if stalled.is_set() and not run.interrupt.is_set():
                self._orphans.cancel(run.interrupt)
                why = f'Nav2 has not moved the robot for {STALLED:g} s{progress.words()}'
                raise MotionFailedError(why, self._position(progress))
            # It was cancelled, which is no failure.
            return path[0] if progress.position is None else progress.position
        if end.status != 'succeeded':
            self._give_way(end, run)
            why = f'Nav2 {end.status} the goal{reason_of(end.result)}{progress.words()}'
            raise MotionFailedError(why, self._position(progress))
        position = self._position(progress)
        if position is None:
            position = path[-1]
        self._tell(position)
        return position

    def _give_way(self, end: GoalEnd, run: GoalRun) -> None:
        """Wait while another program has Nav2 drive, which took the place of our goal."""
        if getattr(end.result, 'error_code', 0) or not run.sleep(0.5):
            return
        cause = 'robot', 'goal'
        while name := self._others.running():
            self._node.incidents.begin(
                cause,
                f'another program, RViz perhaps, has a goal on {name}: the patrol waits for its '
                'end',
            )
            if not run.sleep(1.0):
                break
        self._node.incidents.end(cause, "the other program's goal has ended")

    def _position(self, progress: DriveProgress) -> Points | None:
        """Return where the robot is at the end of a drive, shape (3,); None: nobody says.

        What was heard long ago is not believed: AMCL tells no pose until the robot has moved.
        """
        if time.monotonic() - self._heard_at <= FRESH and self._pose is not None:
            return point_of(self._pose)
        if progress.position is not None:
            return progress.position
        return None if self._pose is None else point_of(self._pose)

    def _turn(self, bearing: float, at: Points, run: GoalRun) -> Points:
        """Turn on the spot, which Nav2 does by an angle; return where the robot is."""
        if self._pose is None:
            raise MotionFailedError(
                'nobody tells where the robot points: expected amcl_pose, or '
                f'{self._frames.map} -> {self._frames.odom} -> {self._frames.base} on tf',
                at,
            )

        def make() -> Any:
            pose = self._pose
            assert pose is not None
            return self._spin.Goal(
                target_yaw=angle_between(pose[2], bearing), time_allowance=SPIN_ALLOWANCE
            )

        end = self._spinner.send(make, run)
        if end is not None and end.status != 'succeeded':
            raise MotionFailedError(f'Nav2 {end.status} the turn{reason_of(end.result)}', at)
        return at if end is None else point_of(self._pose)

    def _poses(self, path: Points) -> list[PoseStamped]:
        """Return the poses behind the start, each facing along the path."""
        points = equally_spaced(path, max(SPACING, length(path) / MOST_POSES))
        if len(points) == 1:
            points = np.vstack([path[-1], path[-1]])
        stamp = self._node.get_clock().now().to_msg()
        poses = []
        for before, at in pairwise(points):
            pose = PoseStamped()
            pose.header.frame_id, pose.header.stamp = self.map_frame, stamp
            yaw = math.atan2(at[1] - before[1], at[0] - before[0])
            pose.pose = pose_message((float(at[0]), float(at[1]), yaw))
            poses.append(pose)
        return poses

    def _look(self) -> None:
        """Take where `tf` has the robot; end a drive that stands."""
        found = self._tf.pose(self._frames.base, self._frames.map, FRESH)
        if found is not None:
            pose, stamp = found
            self._take(pose)
            self._publish(pose, stamp)
        if self._drive is not None:
            progress, stalled, run = self._drive
            if self.hold.active:
                progress.moved_at = run.now()
            elif run.now() - progress.moved_at > STALLED:
                stalled.set()

    def _on_scan(self, _topic: str, scan: Scan, message: LaserScan) -> None:
        self._scans.take(scan, seconds_of(message.header.stamp), time.monotonic())

    def _on_placed(self, pose: Pose, scan: Scan, made: float, is_slow: bool) -> None:
        """Compare a scan with the map, and read the doors by it."""
        if self._doubt.is_due(time.monotonic()):
            self._doubt.look(pose, scan, made)
            self._tell_doubt()
        if is_slow and not self._doubt.in_doubt:
            self._doors.see(pose, scan, made)

    def _publish(self, pose: Pose, stamp: float) -> None:
        """Tell `amcl_pose` where no other program does."""
        own = 0 if self._own_poses is None else 1
        if self._node.count_publishers('amcl_pose') > own:
            if self._own_poses is not None:
                self._node.destroy_publisher(self._own_poses)
                self._own_poses = None
            return
        if self._own_poses is None:
            self._own_poses = self._node.create_publisher(
                PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS
            )
        message = PoseWithCovarianceStamped(pose=pose_estimate(pose, 0.1, 0.05))
        message.header.frame_id = self.map_frame
        message.header.stamp = stamp_from(round(1e9 * stamp))
        self._own_poses.publish(message)

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        if self._own_poses is not None:
            return
        with refusing(self._node, 'amcl_pose'):
            self._take(pose_from(message.pose.pose))

    def _take(self, pose: Pose) -> None:
        self._pose, self._heard_at = pose, time.monotonic()
        self._tell(point_of(pose))

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self._node, 'map'):
            grid = conversions.grid_from(message)
            with self._lock:
                self._places.set_map(grid)
            self._doubt.set_map(grid)
            self._tell_pose()

    def _tell_doubt(self) -> None:
        """Tell whether the pose fits what the lidar saw from there."""
        if self._doubt.in_doubt:
            self._node.incidents.begin(
                POSE,
                # Without the pose, which moves: each change would be told anew.
                'the pose that Nav2 tells does not fit what the lidar sees',
                action='set the pose, in RViz by 2D Pose Estimate, or load the right map',
            )
        else:
            self._node.incidents.end(POSE, 'the pose fits what the lidar sees')

    def _set_positions(self, positions: Mapping[str, Points]) -> None:
        with self._lock:
            self._places.set_positions(positions)
        self._tell_pose()

    def _tell_pose(self) -> None:
        if self._pose is not None:
            self._tell(point_of(self._pose))

    def _tell(self, point: Points) -> None:
        """Tell the place that the robot is in; where it is in none, or its pose is in doubt, that
        stays as it was.
        """
        with self._lock:
            place = self._places.place_at(point)
        if place is not None and not self._doubt.in_doubt:
            self._recorder.tell(place)

    def place_reached(self, goal: Points, end: Points) -> str:
        """Return the place that the robot is in, which is at `end`, shape (3,).

        Raises:
            MotionFailedError: It is not in the goal's place, or its pose is in doubt.
        """
        if self._doubt.in_doubt:
            raise MotionFailedError('the pose of Nav2 does not fit what the lidar sees', end)
        with self._lock:
            place, wanted = self._places.place_at(end), self._places.place_at(goal)
        return expect_place(place, wanted, end)

    @property
    def map_frame(self) -> str:
        """The name of the map's frame."""
        return self._frames.map

    @property
    def pose(self) -> Pose | None:
        """Where the robot is; None: nobody has said it."""
        return self._pose

    def look_around(self, _run: GoalRun) -> None:
        """Nothing: Nav2's own behaviours turn the robot where that is wanted."""


def rest_of(path: Points, position: Points) -> Points:
    """Return what is left of a path from where the robot is, shape (n, 3), n of at least 2."""
    passed = points_passed(path, distance_nearest(path, position))
    return np.vstack([position, path[min(passed, len(path) - 1) :]])
