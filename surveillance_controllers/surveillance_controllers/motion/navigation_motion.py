"""Motion for `motion_controller` by its own navigation (SIMULATED mode): sensors, navigator, base.

Reads `map`, `door_states`, `odom`, `scan`, `initialpose`, `mission_status`, `stopped` and `paused`;
commands `cmd_vel`; publishes where the robot is (`amcl_pose`) and what stands about that the map
does not have (`obstacles`). Asks `compute_path` for another path when a drive does not go on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan

from floor_plans.parameters import zones_from
from lidar_navigation import (
    DriveParameters,
    Navigator,
    Velocity,
)
from lidar_navigation.geometry import Points, Pose, Scan
from state_machines.ros import GoalRun
from surveillance_controllers import conversions
from surveillance_controllers.controller_parameters import MotionSettings, NavigationSettings
from surveillance_controllers.map_knowledge import MapKnowledge
from surveillance_controllers.motion.arrival import MotionFailedError, expect_place
from surveillance_controllers.motion.command_publisher import CommandPublisher, blind_time
from surveillance_controllers.motion.door_teller import DoorTeller
from surveillance_controllers.motion.goal_execution import GoalExecution
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.place_recording import PlaceRecorder
from surveillance_controllers.motion.pose_reports import PoseReports
from surveillance_interfaces.msg import DoorStates, MissionStatus
from surveillance_runtime.conversions import (
    pose_from,
    seconds_of,
)
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
from surveillance_runtime.sensing.mount_watch import MountWatch
from surveillance_runtime.sensing.sensors import OdometryReader
from surveillance_runtime.sensing.silence import SensorWatch
from surveillance_runtime.sensing.transforms import ScanReader
from surveillance_runtime.spin_in_place import bearing_of
from surveillance_runtime.state_topics import StateSubscription


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
        robot = node.declare_fields(DriveParameters(), prefix='drive.', mode='SIMULATED and ROBOT')
        self._settings = node.declare_fields(NavigationSettings(), mode='SIMULATED and ROBOT')
        self._frames = declared_frames(node, 'map', 'odom', 'base', 'transform_tolerance')
        self._lidar = ScanReader(node, robot.radius, self._frames.base)
        self._mounts = MountWatch(node, self._lidar)
        guesses = [station.pose for station in settings.stations.values()]
        if settings.start_pose:
            x, y, yaw = settings.start_pose
            guesses = [(x, y, yaw)]
        self._navigator = navigator or Navigator(
            door_segments(node), guesses=guesses, zones=place_zones(node)
        )
        self._navigator.robot = robot
        self._doors = DoorTeller(node, door_segments(node))
        self._navigator.before_search = self._stand_for_search
        self._stands_for_search = False
        self._seen: dict[str, Scan] = {}
        self._robot = robot
        self._seeks = False
        self._place_told: str | None = None
        self._base = CommandPublisher(
            node,
            'cmd_vel',
            (*self._lidar.settings.scans, 'odom'),
            robot.deceleration,
            self._warn_of_silence,
            frame=self._frames.base,
            patience=self._patience,
        )
        self._goals = GoalExecution(
            node,
            self._navigator,
            self._base,
            robot,
            settings.peer_timeout,
            self._settings.sensor_timeout,
            lambda: self.hold.active,
            lambda: self._mounts.problem,
        )
        positions = place_positions(node)
        self._set_positions(positions)
        knowledge.assume(positions)
        # The places that come and go change what the robot's place can be.
        knowledge.follow_places(self._set_positions)
        self._knowledge = knowledge
        follow_place(node, self._take_place)
        self.hold = Hold(node, self._on_hold)
        StateSubscription(node, OccupancyGrid, 'map', self._on_map, owner='simulator')
        StateSubscription(node, DoorStates, 'door_states', self._on_doors, owner='simulator')
        self._odometry = OdometryReader(node, self._on_odometry, self._frames)
        self._reports = PoseReports(node, self._navigator, self._frames, self._odometry)
        self._lidar.subscribe(self._on_scan)
        node.create_subscription(PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, 1)
        StateSubscription(
            node,
            MissionStatus,
            'mission_status',
            self._on_mission,
            owner='robot_behavior',
            only=True,
        )
        self._watch = SensorWatch(
            node,
            self._frames,
            self._lidar.streams,
            self._odometry.stream,
            lambda: 'map' in self._navigator.awaits,
            lambda: self._odometry.child,
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
            return self._goals.turn(run, bearing)
        end = self._goals.drive(path, run, report)
        sure = self._navigator.is_sure
        self._recorder.tell(self._navigator.place_at(end) if sure else None)
        return end

    def look_around(self, run: GoalRun) -> None:
        """Turn once on the spot, as the place's exploration asks for.

        Raises:
            MotionFailedError: The robot's sensors are silent.
        """
        if self._settings.spin:
            self._goals.turn(run)

    def place_reached(self, goal: Points, end: Points) -> str:
        """Return the place the robot is in after a drive.

        Args:
            goal: Where the robot should be, shape (3,).
            end: Where it is, shape (3,).

        Raises:
            MotionFailedError: It is not in the goal's place.
        """
        if not self._navigator.is_sure:
            raise MotionFailedError('the robot does not know in which of several places it is', end)
        return expect_place(self._navigator.place_at(end), self._navigator.place_at(goal), end)

    @property
    def map_frame(self) -> str:
        """The name of the map's frame."""
        return self._frames.map

    @property
    def pose(self) -> Pose | None:
        """Where the robot is; None: it does not know."""
        return self._navigator.pose if self._navigator.is_sure else None

    @property
    def _place(self) -> str | None:
        """The place the robot is in; None while that is not known."""
        return self._navigator.place if self._navigator.is_sure else None

    def _set_positions(self, positions: Mapping[str, Points]) -> None:
        """Take the places: a point in each."""
        with self._goals.lock:
            self._navigator.set_positions(positions)

    def _take_place(self, described: Mapping[str, Any]) -> None:
        positions = positions_of(described)
        self._knowledge.replace_known(positions)
        with self._goals.lock:
            self._doors.take_doors(door_segments_of(described))
            self._navigator.take_place(
                door_segments_of(described), zones_from(described), positions
            )

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self._node, 'map'):
            grid = conversions.grid_from(message)
            with self._goals.lock:
                self._navigator.set_map(grid)

    def _on_doors(self, message: DoorStates) -> None:
        if self._doors.tells:
            return  # its own: what is seen is judged by each scan anew, and is no wall of the map
        with self._goals.lock:
            self._navigator.set_closed(message.closed)

    def _on_mission(self, message: MissionStatus) -> None:
        """Take that a mission goes on: then a robot that does not know where it is finds out."""
        with self._goals.lock:
            self._navigator.seeks = 'RECHARG' not in message.state.upper()
        self._doors.take_mission(message)

    def _on_hold(self) -> None:
        with self._goals.lock:
            self._navigator.stands = self.hold.active
            if self.hold.active and (self._navigator.task is not None or self._seeks):
                # At once: the next scan may be a tenth of a second away.
                self._base.command(Velocity())

    def _on_odometry(self, pose: Pose, measured: float) -> None:
        with self._goals.lock:
            self._base.hear('odom')
            self._mounts.move(pose, measured)
            self._navigator.move(pose, measured)

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        with refusing(self._node, 'initialpose'):
            pose, frame = pose_from(message.pose.pose), message.header.frame_id.removeprefix('/')
            if frame not in ('', self._frames.map):
                raise ValueError(f'a pose in the frame {frame!r}: expected {self._frames.map!r}')
            self._node.get_logger().info(f'pose set to ({pose[0]:.2f}, {pose[1]:.2f})')
            with self._goals.lock:
                self._navigator.believe(pose)

    def _on_scan(self, topic: str, scan: Scan, message: LaserScan) -> None:
        with self._goals.lock:
            self._mounts.see(topic, scan, message)
            if self._mounts.problem:
                self._base.command(Velocity())
        self._see(scan, message.header.stamp, topic)
        if (trusted := self._navigator.trusted) is not None:
            self._doors.see(*trusted)

    def _see(self, scan: Scan, stamp: Any, topic: str = 'scan') -> None:
        measured = seconds_of(stamp)
        with self._goals.lock:
            self._seen[topic] = scan
            self._base.hear(topic)
            self._stands_for_search = False
            velocity = self._navigator.see(scan, measured, topic)
            stands = self._stands_for_search or self._mounts.problem
            if velocity is None and self._seeks:
                velocity = Velocity()
            self._seeks = velocity is not None and self._navigator.task is None
            if velocity is not None and not stands:
                self._base.command(velocity.slowed_to(self._mounts.top_speed))
            self._reports.publish_pose(measured, stamp)
            # Not only a scan makes the robot sure: a pose that somebody tells does, too.
            if self._settings.track_place and self._place != self._place_told:
                self._place_told = self._place
                self._recorder.tell(self._place, stamp)
            self._goals.stepped()
        self._reports.tell(stamp)

    def _stand_for_search(self) -> None:
        """Brake for as long as a search takes: until the next scan is seen."""
        if self._base.wanted.speed != 0.0:
            self._base.command(Velocity())
            self._stands_for_search = True

    def _patience(self, velocity: Velocity) -> float:
        scans = tuple(self._seen.values())  # another thread may add a lidar
        seen = np.concatenate([scan.points for scan in scans] or [np.empty((0, 2))])
        return blind_time(velocity, seen, self._robot.body, self._robot.margin)

    def _warn_of_silence(self, topic: str) -> None:
        self._node.get_logger().warn(f'nothing on the topic {topic}: the robot stands')
