"""Bridge between the sensor topics, the navigator and the base (SIMULATED mode).

Reads `map`, `door_states`, `odom`, `scan` and `initialpose`; commands `cmd_vel`; publishes where
the robot is (`amcl_pose`) and what stands about that the map does not have (`obstacles`).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan, PointCloud2

from surveillance_controllers import conversions
from surveillance_controllers.geometry import Mount, Points, Pose, Scan, point_of
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion.command_publisher import CommandPublisher
from surveillance_controllers.motion.driving import Drive, Spin, State
from surveillance_controllers.motion.navigator import Navigator
from surveillance_controllers.motion.path_following import Velocity
from surveillance_controllers.motion.transforms import Transforms
from surveillance_controllers.planning.grid_planning import NoPathError
from surveillance_fsm import Interrupt
from surveillance_interfaces.msg import DoorStates
from surveillance_runtime.conversions import cloud_from_points, pose_estimate, pose_from, seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.robot_base import ROBOT_DECELERATION, ROBOT_RADIUS
from surveillance_runtime.serialized import pose_of_serialized

POSE_PERIOD = 0.19
"""Least time between two messages on amcl_pose, seconds: with every second scan at 10 Hz."""


class RobotBase:
    """Passes sensor messages to the navigator and publishes its commands.

    Args:
        node: The motion controller's node.
        navigator: What steers.
        sensor_timeout: How long the sensors may be silent during a task, seconds of steady time.
        on_place: Told in the executor's thread in which place a scan found the robot, when that
            changed (None: not known any more), and the scan's stamp; must not block.
        mount: Where the lidar sits on the robot; None: as `tf_static` says of the scan's frame.
        deceleration: With which the base brakes when it must, m/s^2.
        radius: Of the robot, metres.
    """

    def __init__(
        self,
        node: PatrolNode,
        navigator: Navigator,
        sensor_timeout: float,
        on_place: Callable[[str | None, Any], None],
        mount: Mount | None = None,
        deceleration: float = ROBOT_DECELERATION,
        radius: float = ROBOT_RADIUS,
    ) -> None:
        self._node = node
        self._radius = radius
        self._navigator = navigator
        navigator.before_search = self._stand_for_search
        self._stands_for_search = False
        self._sensor_timeout = sensor_timeout
        self._on_place = on_place
        self._lock = threading.RLock()
        self._stepped = threading.Condition(self._lock)
        self._steps = 0
        self._awaited: Callable[[], bool] = lambda: False
        self._on_step: Callable[[Pose], None] = lambda _pose: None
        self._pose_sent = float('-inf')
        self._was_lost = False
        self._jumps = 0
        self._base = CommandPublisher(
            node, 'cmd_vel', ('scan', 'odom'), deceleration, self._warn_of_silence
        )
        self._poses = node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
        self._obstacles = node.create_publisher(PointCloud2, 'obstacles', STATE_QOS)
        self._tf = Transforms(node)
        self._mount = mount
        node.create_subscription(OccupancyGrid, 'map', self._on_map, STATE_QOS)
        node.create_subscription(DoorStates, 'door_states', self._on_doors, STATE_QOS)
        node.create_subscription(Odometry, 'odom', self._on_odometry, SENSOR_QOS, raw=True)
        node.create_subscription(LaserScan, 'scan', self._on_scan, SENSOR_QOS)
        node.create_subscription(PoseWithCovarianceStamped, 'initialpose', self._on_initial_pose, 1)

    @property
    def is_sure(self) -> bool:
        """Whether the robot knows where it is: not lost, and nowhere else as likely."""
        return not (self._navigator.lost or self._navigator.ambiguous)

    @property
    def place(self) -> str | None:
        """The place the robot is in; None while that is not known."""
        return self._navigator.place if self.is_sure else None

    @property
    def pose(self) -> Pose | None:
        """Where the robot is, map frame."""
        return self._navigator.pose

    def place_at(self, point: Points) -> str | None:
        """Return the place that a point is in."""
        return self._navigator.place_at(point)

    def set_positions(self, positions: Mapping[str, Points]) -> None:
        """Take the places: a point in each."""
        with self._lock:
            self._navigator.set_positions(positions)

    def drive(
        self,
        drive: Drive,
        interrupt: Interrupt,
        on_step: Callable[[Pose], None],
        another_path: Callable[[Pose], Points],
    ) -> Pose:
        """Carry out a drive; it blocks, so it belongs on a worker thread.

        Args:
            drive: The drive.
            interrupt: Ends it early: the robot brakes.
            on_step: Told the pose with each scan, in the executor's thread; must not block.
            another_path: Finds a path from a pose to the drive's goal; raises `NoPathError`.

        Returns:
            Where the robot is then.

        Raises:
            MotionFailedError: The sensors gave nothing for too long.
        """
        with self._carrying_out(drive, interrupt, on_step):
            while not drive.state.ended and not interrupt.is_set():
                self._await(lambda: drive.state.ended or drive.state is State.ASKING, interrupt)
                pose = self.pose
                if drive.state is not State.ASKING or interrupt.is_set() or pose is None:
                    continue
                self._node.get_logger().info(f'{drive.reason}: looking for another path')
                try:
                    path = another_path(pose)
                except NoPathError as error:
                    with self._lock:
                        drive.no_path(str(error))
                else:
                    with self._lock:
                        drive.new_path(path)
        return self.pose or (float('nan'),) * 3

    def spin(self, spin: Spin, interrupt: Interrupt) -> None:
        """Turn once on the spot; it blocks.

        Raises:
            MotionFailedError: The sensors gave nothing for too long.
        """
        with self._carrying_out(spin, interrupt):
            self._await(lambda: spin.done, interrupt)

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
                woken = self._stepped.wait(self._sensor_timeout)
                if not woken and self._steps == before:
                    topic = self._navigator.missing or 'scan'
                    raise MotionFailedError(
                        f'nothing of use came on the topic {topic} for {self._sensor_timeout:g} s',
                        None if self.pose is None else point_of(self.pose),
                    )

    def _wake(self) -> None:
        with self._stepped:
            self._stepped.notify_all()

    def _on_map(self, message: OccupancyGrid) -> None:
        with conversions.refusing(self._node, 'map'):
            grid = conversions.grid_from(message)
            with self._lock:
                self._navigator.set_map(grid)

    def _on_doors(self, message: DoorStates) -> None:
        with self._lock:
            self._navigator.set_closed(message.closed)

    def _on_odometry(self, serialized: bytes) -> None:
        with conversions.refusing(self._node, 'odom'):
            pose = pose_of_serialized(serialized, texts=1)
            with self._lock:
                self._base.hear('odom')
                self._navigator.move(pose)

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        with conversions.refusing(self._node, 'initialpose'):
            pose = pose_from(message.pose.pose)
            self._node.get_logger().info(f'pose set to ({pose[0]:.2f}, {pose[1]:.2f})')
            with self._lock:
                self._navigator.believe(pose)

    def _on_scan(self, message: LaserScan) -> None:
        with conversions.refusing(self._node, 'scan'):
            mount = self._mount or self._tf.mount_of(message.header.frame_id)
            stamp = message.header.stamp
            if stamp == Time():
                # A lidar without a clock; a drive needs the time that passes.
                stamp = self._node.get_clock().now().to_msg()
            self._see(conversions.scan_from(message, mount, self._radius), stamp)

    def _see(self, scan: Scan, stamp: Any) -> None:
        measured = seconds_of(stamp)
        with self._stepped:
            before = self.place
            self._base.hear('scan')
            self._stands_for_search = False
            velocity = self._navigator.see(scan, measured)
            if velocity is not None and self._navigator.task is not None:
                if not self._stands_for_search:
                    self._base.command(velocity)
                if self._navigator.pose is not None:
                    self._on_step(self._navigator.pose)
            self._publish_pose(measured, stamp)
            if self.place != before:
                self._on_place(self.place, stamp)
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
        navigator = self._navigator
        if navigator.pose is None or 0 <= measured - self._pose_sent < POSE_PERIOD:
            return
        unsure = navigator.lost or navigator.ambiguous
        deviation = (5.0, 3.0) if unsure else (0.03, 0.02)
        estimate = PoseWithCovarianceStamped(pose=pose_estimate(navigator.pose, *deviation))
        estimate.header.frame_id, estimate.header.stamp = 'map', stamp
        self._pose_sent = measured
        self._poses.publish(estimate)

    def _tell(self, stamp: Any) -> None:
        navigator = self._navigator
        if navigator.pose is None:
            return
        if navigator.lost != self._was_lost:
            self._was_lost = navigator.lost
            if navigator.lost:
                self._node.get_logger().warn('pose lost: the scans do not fit the map')
        if navigator.jumps != self._jumps:
            self._jumps = navigator.jumps
            x, y, _ = navigator.pose
            self._node.get_logger().info(f'pose found at ({x:.2f}, {y:.2f})')
        if navigator.obstacles_changed:
            navigator.obstacles_changed = False
            cloud = cloud_from_points(navigator.obstacles, stays=navigator.obstacles_stay)
            cloud.header.stamp = stamp
            self._obstacles.publish(cloud)
        if navigator.odometry is not None:
            self._tf.tick(navigator.pose, navigator.odometry, stamp)
