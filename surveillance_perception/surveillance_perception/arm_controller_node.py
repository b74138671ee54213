"""The `arm_controller` node: named poses, looking at a point, looking all around."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.callback_groups import ReentrantCallbackGroup
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from marker_detection.fusion import MOST_MARKERS, FusedPositions
from state_machines.ros import GoalAbortedError, GoalRun, GoalServer, work_aside
from strict_files.settings import converted, parameter
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_interfaces.srv import MarkerRoutine, PointCamera
from surveillance_perception.arm.driver import ArmDriver
from surveillance_perception.arm.kinematics import ArmMotionError, in_base, look_at
from surveillance_perception.arm.scan import View, scan
from surveillance_perception.arm_commands import ArmCommands
from surveillance_perception.conversions import (
    base_pose_from_ros,
    fuse_views,
    fused_to_ros,
    pose_on_map,
    scan_feedback_to_ros,
    scan_plan_from_ros,
    scan_result_to_ros,
    trajectory_to_ros,
)
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.fresh_images import FreshImages
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.robot_arm import ARM, REST_PATIENCE, Arm, Array
from surveillance_runtime.sensing.sensors import measured_at
from surveillance_runtime.stamp_offset import StampOffset
from surveillance_runtime.stamped_readings import OdometryStamps, StampedReadings
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

_POSES = {
    MarkerRoutine.Request.LEFT: 'left',
    MarkerRoutine.Request.HOME: 'home',
    MarkerRoutine.Request.RIGHT: 'right',
    MarkerRoutine.Request.BACK: 'back',
}
_FAILURES = (ArmMotionError, ValueError)
MAP = 'map'
KEPT_ODOMETRY = 100
DRIFTED = 3.0
"""Odometry alone is good for so far, metres: then two readings of one panel look like two."""


_PAN = {'left': math.pi / 2, 'home': 0.0, 'right': -math.pi / 2, 'back': math.pi}


@dataclass
class ArmSettings:
    """What an operator can set.

    Attributes:
        poses: Joint positions (n,) of the named poses, rad.
        dwell: Rest at each view of a scan, seconds; may change at any time.
    """

    poses: Mapping[str, Array]
    dwell: float = parameter(0.5, 'Rest at each view of a scan, seconds.', 0.0)
    pictures: int = parameter(
        4, 'Pictures that the marker detector must have looked at before a view is left.', 0
    )
    patience: float = parameter(
        3.0, 'Seconds of real time after which a view is left without them.', 0.0, REST_PATIENCE
    )
    horizontal: float = converted(
        math.radians,
        60.0,
        "The camera's horizontal field of view, degrees.",
        minimum=5.0,
        maximum=150.0,
        name='horizontal_field_of_view',
        read_only=True,
    )
    vertical: float = converted(
        math.radians,
        46.8,
        "The camera's vertical field of view, degrees.",
        minimum=5.0,
        maximum=150.0,
        name='vertical_field_of_view',
        read_only=True,
    )


def arm_settings(node: PatrolNode, arm: Arm) -> ArmSettings:
    """Declare the parameters.

    Raises:
        ParameterError: A value is of the wrong type or out of range.
    """
    poses = {name: _pose(node, arm, name, pan) for name, pan in _PAN.items()}
    return node.declare_live(ArmSettings(poses))


def _pose(node: PatrolNode, arm: Arm, name: str, pan: float) -> Array:
    def check(value: Sequence[float]) -> str | None:
        pose = np.array(value)
        if len(pose) == len(arm.names) and (arm.lower <= pose).all() and (pose <= arm.upper).all():
            return None
        return f'{len(arm.names)} joint positions within the limits of the arm'

    value = node.parameter(
        f'pose_{name}',
        [pan, *arm.home[1:]],
        f'Joint positions of the pose {name}, rad, in the order {", ".join(arm.names)}.',
        check=check,
        read_only=True,
    )
    return np.array(value)


class ArmController(PatrolNode):
    """Moves the arm that carries the camera."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('arm_controller', **node_options)
        self._settings = arm_settings(self, ARM)
        group = ReentrantCallbackGroup()
        self._base: tuple[str, np.ndarray] | None = None
        self._bases, self._postures = StampedReadings(), StampedReadings()
        self._stamps, self._base_stamps, self._joint_stamps = (
            StampOffset(topic, self.is_simulated)
            for topic in ('aruco_detector/detections', 'odom', 'joint_states')
        )
        commands = ArmCommands(self)
        self._at_rest = OwnedTopic(self, Bool, 'arm/at_rest')
        self._driver = ArmDriver(
            ARM,
            lambda motion: commands.send(trajectory_to_ros(motion, ARM.names)),
            self._now,
            lambda resting: self._at_rest.publish(Bool(data=resting)),
        )
        self.stopping.subscribe(self._driver.wake)
        self.create_subscription(JointState, 'joint_states', self._on_joints, SENSOR_QOS)
        self._read = FreshImages(self)
        self._fused, self._fused_in = FusedPositions(), ''
        # Where the odometry began on the map, as who localises tells of the same stamps.
        self._odometry = OdometryStamps[np.ndarray](KEPT_ODOMETRY)
        self._odom_in_map: np.ndarray | None = None
        self._doubt: tuple[float, float] | None = None
        self._map_frame = MAP
        self._driven, self._last_at = 0.0, np.zeros(3)
        self._twins: dict[int, str] = {}
        self._markers = self.create_publisher(MarkerDetectionArray, 'arm/markers', 10)
        self.create_subscription(
            MarkerDetectionArray, 'aruco_detector/detections', self._on_detections, 10
        )
        self.create_subscription(Odometry, 'odom', self._on_odometry, SENSOR_QOS)
        StateSubscription(
            self,
            PoseWithCovarianceStamped,
            'amcl_pose',
            self._on_pose,
            owner='motion_controller',
        )
        self.create_service(MarkerRoutine, 'move_arm', self._on_move, callback_group=group)
        self.create_service(PointCamera, 'point_camera', self._on_point, callback_group=group)
        GoalServer(self, ScanSurroundings, 'scan_surroundings', self._scan)

    def _on_joints(self, message: JointState) -> None:
        if self._driver.report(message.name, message.position, message.velocity):
            measured = self._measured(message, self._joint_stamps)
            self._postures.add(measured, self._driver.posture.tolist())

    def _on_odometry(self, message: Odometry) -> None:
        try:
            frame, base = message.header.frame_id, base_pose_from_ros(message)
        except ValueError as error:
            self.get_logger().warn(str(error), throttle_duration_sec=60.0)
            return
        self._base = frame, base
        self._driven += float(np.linalg.norm(base[:3, 3] - self._last_at))
        self._last_at = base[:3, 3]
        measured = self._measured(message, self._base_stamps)
        self._odometry.add(base, seconds_of(message.header.stamp), measured)
        self._bases.add(measured, base[:3].ravel().tolist())

    def _measured(self, message: JointState | Odometry, stamps: StampOffset) -> float:
        """Return when a reading was made, seconds of this node's clock."""
        return measured_at(self, stamps, seconds_of(message.header.stamp), self._now())

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            on_map, doubt = pose_on_map(message)
        except ValueError as error:
            self.get_logger().warn(f'amcl_pose: {error}', throttle_duration_sec=60.0)
            return
        self._map_frame = message.header.frame_id or MAP
        if (base := self._odometry.at(seconds_of(message.header.stamp))) is not None:
            self._odom_in_map, self._doubt = on_map @ np.linalg.inv(base), doubt

    def _fixed(self, frame: str) -> tuple[str, np.ndarray, tuple[float, float] | None]:
        """Return the frame in which markers hang still, how the odometry lies in it, its doubt.

        That is the map's once somebody tells where the robot is. The odometry's drifts: there
        positions begin anew after `DRIFTED` metres.
        """
        if self._odom_in_map is not None:
            fixed, moved = self._map_frame, self._odom_in_map
        else:
            fixed, moved = frame, np.eye(4)
        has_drifted = self._odom_in_map is None and self._driven > DRIFTED
        if fixed != self._fused_in or has_drifted:
            self._fused, self._fused_in, self._driven = FusedPositions(), fixed, 0.0
        return fixed, moved, self._doubt

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds / 1e9)

    def _on_detections(self, message: MarkerDetectionArray) -> None:
        """Fuse what is seen at rest with what was seen from elsewhere, on the map if it can be."""
        taken_at = self._stamps.span_of(seconds_of(message.header.stamp), self._now())
        base, posture = self._bases.stood(*taken_at), self._postures.stood(*taken_at)
        if self._base is None or base is None or posture is None or not message.detections:
            return
        frame, odom, doubt = self._fixed(self._base[0])
        standing = odom @ np.vstack([np.reshape(base, (3, 4)), [0.0, 0.0, 0.0, 1.0]])
        camera = standing @ ARM.camera_frame(posture)
        taken = fuse_views(self._fused, message, camera, doubt)
        if self._fused.is_full:
            self.get_logger().warn(
                f'markers of {MOST_MARKERS} ids are kept: those of further ids are left out',
                once=True,
            )
        self._report_twins(frame)
        fused = [(each, self._fused.position_of(each)) for each in taken]
        seen = MarkerDetectionArray(header=Header(stamp=message.header.stamp, frame_id=frame))
        seen.detections = [fused_to_ros(each, at) for each, at in fused if at is not None]
        if seen.detections:
            self._markers.publish(seen)

    def _report_twins(self, frame: str) -> None:
        """Say of each id, once, that two panels show it; the finding stays."""
        for marker_id in self._fused.twins:
            places = self._fused.two_places(marker_id)
            if marker_id in self._twins or places is None:
                continue
            self._twins[marker_id] = f'marker {marker_id} hangs at ' + ' and at '.join(
                '(' + ', '.join(f'{value:.2f}' for value in each.position) + ')' for each in places
            )
            self.get_logger().warn(f'{self._twins[marker_id]} in {frame}: two panels with one id')
            self.health.warn('markers', '; '.join(self._twins.values()))

    async def _on_move(self, request: Any, response: Any) -> Any:
        def work() -> str:
            if request.pos == MarkerRoutine.Request.STOP:
                self._driver.halt(self.stopping.is_set)
                return 'stopped'
            if request.pos not in _POSES:
                raise ValueError(f'no pose {request.pos}, expected 1 to 5')
            name = _POSES[request.pos]
            self._driver.move(self._settings.poses[name], self.stopping.is_set)
            return f'at pose {name}'

        response.success, response.message = await self._off_executor(work)
        return response

    async def _on_point(self, request: Any, response: Any) -> Any:
        def work() -> str:
            point = np.array([request.point.x, request.point.y, request.point.z])
            target = in_base(point, request.frame_id, self._base, self._odom_in_map)
            aim = look_at(ARM, target, self._driver.posture)
            response.error = aim.error
            self._driver.move(aim.positions, self.stopping.is_set)
            return 'looking at the point'

        response.success, response.message = await self._off_executor(work)
        return response

    async def _off_executor(self, work: Callable[[], str]) -> tuple[bool, str]:
        """Do blocking work on a thread of its own; whether it went well, and what to say."""
        try:
            return True, await work_aside(self, work, 'arm motion')
        except _FAILURES as error:
            return False, str(error)

    def _scan(self, goal: Any, run: GoalRun) -> Any:
        settings = self._settings
        dwell = goal.dwell if goal.dwell > 0 else settings.dwell
        try:
            plan = scan_plan_from_ros(goal, settings.horizontal, settings.vertical)
        except ValueError as error:
            raise GoalAbortedError(str(error)) from None

        def tell(index: int, view: View, resting: bool) -> None:
            run.feedback(scan_feedback_to_ros(index, len(plan.views), view, resting))

        def rest() -> bool:
            return self._read.wait(settings.pictures, dwell, settings.patience, run.interrupt)

        wake = run.interrupt.subscribe(self._driver.wake)
        try:
            outcome = scan(self._driver, plan, rest, tell, run.interrupt.is_set)
        finally:
            wake()
        result = scan_result_to_ros(outcome)
        if outcome.failure and not run.interrupt.is_set():
            raise GoalAbortedError(f'scan ended at {outcome.failure}', result)
        return result


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(ArmController, args)


if __name__ == '__main__':
    raise SystemExit(main())
