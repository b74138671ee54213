"""The robot for `motion_controller` in SIMULATED mode: its sensors and its drive, as topics.

Reads `map`, `door_states`, `odom`, `scan` and `initialpose`; commands `cmd_vel`; publishes where
the robot is (`amcl_pose`) and what stands about that the map does not have (`obstacles`).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan, PointCloud2

from surveillance_controllers import conversions
from surveillance_controllers.geometry.polyline import Points
from surveillance_controllers.geometry.poses import Pose
from surveillance_controllers.motion.driving import Drive, Spin, State
from surveillance_controllers.motion.path_following import Velocity
from surveillance_controllers.motion.pilot import Pilot
from surveillance_controllers.motion.tf_correction import TfCorrection
from surveillance_controllers.planning.grid_planning import NoPath
from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.conversions import cloud_from_points, seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.waiting import Interrupt

POSE_PERIOD = 0.19
"""Least time between two messages on amcl_pose, seconds: with every second scan at 10 Hz."""


class RobotSilent(Exception):
    """What the robot's sensors must give does not come; the text names the topic."""


class RobotBase:
    """Feeds a pilot and obeys it.

    Args:
        node: The motion controller's node.
        pilot: What steers.
        sensor_timeout: How long the sensors may be silent during a task, seconds of steady time.
        on_place: Told in the executor's thread in which place a scan found the robot, when that
            changed (None: not known any more), and the scan's stamp; must not block.
    """

    def __init__(
        self,
        node: PatrolNode,
        pilot: Pilot,
        sensor_timeout: float,
        on_place: Callable[[str | None, Any], None],
    ) -> None:
        self._node = node
        self._pilot = pilot
        self._sensor_timeout = sensor_timeout
        self._on_place = on_place
        self._lock = threading.RLock()
        self._stepped = threading.Condition(self._lock)
        self._steps = 0
        self._pose_sent = float('-inf')
        self._was_lost = False
        self._jumps = 0
        self._commands = node.create_publisher(Twist, 'cmd_vel', 1)
        self._poses = node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
        self._obstacles = node.create_publisher(PointCloud2, 'obstacles', STATE_QOS)
        self._tf = TfCorrection(node)
        node.create_subscription(OccupancyGrid, 'map', self._on_map, STATE_QOS)
        node.create_subscription(DoorStates, 'door_states', self._on_doors, STATE_QOS)
        node.create_subscription(Odometry, 'odom', self._on_odometry, SENSOR_QOS)
        node.create_subscription(LaserScan, 'scan', self._on_scan, SENSOR_QOS)
        node.create_subscription(PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, 1)

    @property
    def place(self) -> str | None:
        """The place the robot is in; None while that is not known."""
        return None if self._pilot.lost else self._pilot.place

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, map frame."""
        return self._pilot.pose

    def place_at(self, point: Points) -> str | None:
        """The place that a point is in."""
        return self._pilot.place_at(point)

    def set_positions(self, positions: Mapping[str, Points]) -> None:
        """Takes the places: a point in each."""
        with self._lock:
            self._pilot.set_positions(positions)

    def drive(
        self,
        drive: Drive,
        interrupt: Interrupt,
        on_step: Callable[[Pose], None],
        another_path: Callable[[Pose], Points],
    ) -> Pose:
        """Carries out a drive; blocks, so it belongs on a worker thread.

        Args:
            drive: The drive.
            interrupt: Ends it early: the robot brakes.
            on_step: Told the pose now and then.
            another_path: Finds a path from a pose to the drive's goal; raises `NoPath`.

        Returns:
            Where the robot is then.

        Raises:
            RobotSilent: The sensors gave nothing for too long.
        """
        with self._carrying_out(drive, interrupt):
            while not drive.state.ended and not interrupt.is_set():
                pose = self._await_step(interrupt)
                if pose is None:
                    continue
                on_step(pose)
                if drive.state is State.ASKING:
                    self._node.get_logger().info(f'{drive.reason}: looking for another path')
                    try:
                        path = another_path(pose)
                    except NoPath as error:
                        with self._lock:
                            drive.no_path(str(error))
                    else:
                        with self._lock:
                            drive.new_path(path)
        return self._pilot.pose or (float('nan'),) * 3

    def spin(self, spin: Spin, interrupt: Interrupt) -> None:
        """Turns once on the spot; blocks.

        Raises:
            RobotSilent: The sensors gave nothing for too long.
        """
        with self._carrying_out(spin, interrupt):
            while not spin.done and not interrupt.is_set():
                self._await_step(interrupt)

    @contextmanager
    def _carrying_out(self, task: Drive | Spin, interrupt: Interrupt) -> Iterator[None]:
        """Hands a task to the pilot; afterwards the robot stands."""
        with self._lock:
            self._pilot.task = task
        unsubscribe = interrupt.subscribe(self._wake)
        try:
            yield
        finally:
            unsubscribe()
            with self._lock:
                self._pilot.task = None
                self._commands.publish(conversions.twist_from(Velocity()))

    def _await_step(self, interrupt: Interrupt) -> Pose | None:
        with self._stepped:
            before = self._steps
            self._stepped.wait_for(
                lambda: self._steps != before or interrupt.is_set(), self._sensor_timeout
            )
            if interrupt.is_set():
                return None
            if self._steps == before:
                topic = self._pilot.missing or 'scan'
                raise RobotSilent(
                    f'nothing came on the topic {topic} for {self._sensor_timeout:g} s'
                )
            return self._pilot.pose

    def _wake(self) -> None:
        with self._stepped:
            self._stepped.notify_all()

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            grid = conversions.grid_from(message)
        except ValueError as error:
            self._node.get_logger().error(f'map: {error}')
            return
        with self._lock:
            self._pilot.set_map(grid)

    def _on_doors(self, message: DoorStates) -> None:
        with self._lock:
            self._pilot.set_closed(message.closed)

    def _on_odometry(self, message: Odometry) -> None:
        with self._lock:
            self._pilot.move(conversions.pose_from(message.pose.pose))

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        pose = conversions.pose_from(message.pose.pose)
        self._node.get_logger().info(f'told to be at ({pose[0]:.2f}, {pose[1]:.2f})')
        with self._lock:
            self._pilot.believe(pose)

    def _on_scan(self, message: LaserScan) -> None:
        stamp = message.header.stamp
        measured = seconds_of(stamp)
        with self._stepped:
            before = self.place
            velocity = self._pilot.see(conversions.scan_from(message), measured)
            if velocity is not None and self._pilot.task is not None:
                self._commands.publish(conversions.twist_from(velocity))
            self._publish_pose(measured, stamp)
            if self.place != before:
                self._on_place(self.place, stamp)
            self._steps += 1
            self._stepped.notify_all()
        self._tell(stamp)

    def _publish_pose(self, measured: float, stamp: Any) -> None:
        pilot = self._pilot
        if pilot.pose is None or 0 <= measured - self._pose_sent < POSE_PERIOD:
            return
        deviation = (5.0, 3.0) if pilot.lost else (0.03, 0.02)
        estimate = conversions.pose_estimate(pilot.pose, *deviation)
        estimate.header.stamp = stamp
        self._pose_sent = measured
        self._poses.publish(estimate)

    def _tell(self, stamp: Any) -> None:
        pilot = self._pilot
        if pilot.pose is None:
            return
        if pilot.lost != self._was_lost:
            self._was_lost = pilot.lost
            if pilot.lost:
                self._node.get_logger().warn('lost: what is seen does not fit the map')
        if pilot.jumps != self._jumps:
            self._jumps = pilot.jumps
            x, y, _ = pilot.pose
            self._node.get_logger().info(f'found itself at ({x:.2f}, {y:.2f})')
        if pilot.obstacles_changed:
            pilot.obstacles_changed = False
            cloud = cloud_from_points(pilot.obstacles)
            cloud.header.stamp = stamp
            self._obstacles.publish(cloud)
        if pilot.odometry is not None:
            self._tf.tick(pilot.pose, pilot.odometry, stamp)
