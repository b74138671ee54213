"""The `observer` node: what the robot notices as it goes about.

Reads the lidars, `amcl_pose`, `robot_place`, `map`, the camera with its arm, and
`aruco_detector/detections`; publishes each observation on `observations` and all events on
`events`; takes a person's answers on the service `observer/command`. What is noticed is decided in
`indoor_watch`, on one thread of its own; the executor's thread finds out where robot and camera
were (`observing/`).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan

from indoor_watch import MOST_CELLS
from indoor_watch.lost_sight import DROPPED, LATE, NO_POSE, LostSight
from indoor_watch.sees_around import SeesAround
from indoor_watch.work_queue import WorkQueue
from lidar_navigation.geometry import Pose, Scan
from state_machines.ros.waiting import reported
from strict_files.files import FileError
from surveillance_interfaces.msg import MarkerDetectionArray, RobotPlace
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_ontology.patrol_vocabulary import ROBOT
from surveillance_perception.conversions import (
    camera_from_ros,
    doubt_from,
    image_from_ros,
    seen_marker_from_ros,
)
from surveillance_perception.finding_teller import FindingTeller
from surveillance_perception.observing.base_history import BaseHistory
from surveillance_perception.observing.camera_tracker import CameraTracker, camera_joints
from surveillance_perception.observing.fleet_positions import FleetPositions
from surveillance_perception.observing.observer_settings import ObserverSettings
from surveillance_perception.observing.observer_topics import ObserverTopics
from surveillance_perception.observing.observer_worker import ObserverWorker
from surveillance_perception.observing.picture_chooser import (
    ChosenPicture,
    HeldPicture,
    PictureChooser,
)
from surveillance_perception.observing.scan_pairing import ScanPairing, sweep_of
from surveillance_perception.stream.image_subscription import ImageSubscription
from surveillance_runtime.conversions import (
    PlanarPose,
    map_from,
    pose_of_serialized,
    seconds_of,
    stamp_of_serialized,
)
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.place_parameters import door_segments, place_positions
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing.conversions import refusing
from surveillance_runtime.sensing.sensors import OdometryReader, SensorStream
from surveillance_runtime.sensing.transforms import ScanReader
from surveillance_runtime.stamp_offset import StampOffset
from surveillance_runtime.state_topics import StateSubscription

ASSESS_PERIOD, KEEP_PERIOD = 2.0, 20.0
"""Seconds of real time between two comparisons, and writings of the state."""
MOST_WAITING = {'sweeps': 10, 'pictures': 4, 'passing': 4}
"""So many wait for the worker; beyond that the oldest of the least worth is left out, and told."""
MOST_PIXELS = 20_000_000
MOST_MARKERS = 1000
"""In one message."""
TOO_LATE = 30.0
"""What is looked at so long after it was taken is told late, seconds."""
CAMERA = 'camera/rgb/image_raw'


class Observer(PatrolNode):
    """Notices. The worker owns monitor, book and plan; the executor's thread owns the history of
    base and camera, and what waits there. Values go from one to the other.

    Attributes:
        sweeps: How many sweeps of the lidars were compared.
        worker: What is done on the worker's thread.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('observer', **node_options)
        self._settings = settings = self.declare_fields(ObserverSettings())
        frames = declared_frames(self, 'base', 'map')
        robot = self.get_namespace().strip('/') or ROBOT
        self.sweeps = 0
        self._topics = ObserverTopics(self, camera=settings.camera)
        self.worker = ObserverWorker(
            self,
            settings,
            robot,
            self._make_teller(),
            self._topics,
            door_segments(self),
            place_positions(self),
        )
        self._lost = LostSight(time.monotonic)
        self._around = SeesAround()
        self._estimate = b''
        self._base = BaseHistory()
        self._pairing = ScanPairing(self._base, lambda: self._lost.count('sweeps', NO_POSE))
        self._tracker = CameraTracker(self._base, self._doubt)
        self._chooser = PictureChooser(self._tracker)
        self._image_stamps = StampOffset(CAMERA, self.is_simulated)
        self._joint_stream = SensorStream(self, 'joint_states')
        self._work = WorkQueue(MOST_WAITING, self._on_dropped)
        self._lidar = ScanReader(self, settings.radius, frames.base)
        self._odometer = OdometryReader(self, self._on_odometry)
        self._subscribe()
        FleetPositions(self, robot.rpartition('/')[2], self._on_peer)
        self.create_service(ConsoleCommand, 'observer/command', self._on_command)
        self.create_timer(ASSESS_PERIOD, lambda: self._work.put_once(self._assess, 'assess'))
        self.create_timer(KEEP_PERIOD, lambda: self._work.put_once(self._keep, 'keep'))
        self.spawn(self._watch, 'observer')

    def _make_teller(self) -> FindingTeller:
        log = self.get_logger()
        try:
            return FindingTeller(
                self.incidents, self._settings.record, log.info, log.warn, self._now
            )
        except FileError as error:
            raise NotNowError(f'parameter record: {error}') from None

    def _subscribe(self) -> None:
        self._lidar.subscribe(self._on_scan)
        owner = 'motion_controller'
        StateSubscription(self, OccupancyGrid, 'map', self._on_map, owner='simulator')
        StateSubscription(self, RobotPlace, 'robot_place', self._on_place, owner=owner)
        StateSubscription(
            self, PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, raw=True, owner=owner
        )
        if self._settings.camera:
            self._detections = self.create_subscription(
                MarkerDetectionArray, 'aruco_detector/detections', self._on_detections, 10
            )
            self.create_subscription(JointState, 'joint_states', self._on_joints, SENSOR_QOS)
            self.create_subscription(
                CameraInfo, 'camera/rgb/camera_info', self._on_camera_info, SENSOR_QOS
            )
            # Raw: most pictures are not looked at.
            ImageSubscription(self, Image, CAMERA, self._on_image, raw=True)

    def on_stop(self) -> None:
        """End the worker, which writes the state first."""
        self._work.put(self._keep)
        self._work.end()

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds / 1e9)

    # --- in the executor's thread ---

    def _on_dropped(self, kind: str) -> None:
        if kind in ('pictures', 'sweeps'):
            self._lost.count(kind, DROPPED)

    def _on_map(self, message: OccupancyGrid) -> None:
        with refusing(self, 'map'):
            grid = map_from(message, MOST_CELLS)
            self._work.put(lambda: self.worker.use_map(grid))

    def _on_place(self, message: RobotPlace) -> None:
        place, stamp = message.place, self._now()
        self._work.put(lambda: self.worker.monitor.arrive(place, stamp))

    def _on_scan(self, _topic: str, scan: Scan, message: LaserScan) -> None:
        self._pairing.take(seconds_of(message.header.stamp), scan)
        self._around.scanned(time.monotonic())
        self._pair()

    def _on_pose(self, serialized: bytes) -> None:
        with refusing(self, 'amcl_pose'):
            pose, stamp = pose_of_serialized(serialized), stamp_of_serialized(serialized)
            self._estimate = serialized
            self._base.take_pose(stamp, pose, self._now())
            self._pair()

    def _doubt(self) -> tuple[float, float] | None:
        """Return how sure the localisation is of its last pose; None: it does not tell."""
        if not self._estimate:
            return None
        try:
            return doubt_from(deserialize_message(self._estimate, PoseWithCovarianceStamped))
        except ValueError:
            return None

    def _on_odometry(self, pose: PlanarPose, measured: float) -> None:
        self._base.take_odometry(self._odometer.stream.stamp, measured, pose)
        self._pair()

    def _on_peer(self, name: str, x: float, y: float, stamp: float) -> None:
        self._work.put(lambda: self.worker.others.hear(name, x, y, stamp))

    def _pair(self) -> None:
        for pose, scan in self._pairing.paired():
            self._see(pose, scan)

    def _see(self, pose: Pose, scan: Scan) -> None:
        sweep, doubt = sweep_of(pose, scan, self._now()), self._doubt()

        def compare() -> None:
            self.worker.monitor.sweep(sweep.sensor, sweep.ends, sweep.met, sweep.stamp, doubt)
            self._lost.count('sweeps')
            self.sweeps += 1
            self.health.figure('sweeps', self.sweeps)

        self._work.put(compare, 'sweeps')

    def _on_camera_info(self, message: CameraInfo) -> None:
        with refusing(self, 'camera_info'):
            is_first, self._tracker.lens = self._tracker.lens is None, camera_from_ros(message)
            if is_first:
                self._topics.camera_angle(self._tracker.angle)

    def _on_joints(self, message: JointState) -> None:
        with refusing(self, 'joint_states'):
            joints = camera_joints(message.name, message.position)
            stamp, content = seconds_of(message.header.stamp), message.position.tobytes()
            measured = self._joint_stream.come(stamp, content)
            if measured is not None:
                self._tracker.take_joints(measured, joints)

    def _on_detections(self, message: MarkerDetectionArray) -> None:
        with refusing(self, 'aruco_detector/detections'):
            if (count := len(message.detections)) > MOST_MARKERS:
                raise ValueError(f'{count} markers in a picture: expected at most {MOST_MARKERS}')
            found = [seen_marker_from_ros(each) for each in message.detections if each.confirmed]
            stamp = seconds_of(message.header.stamp)
            self._chooser.take_markers(stamp, tuple(found))
            # Where markers seem to hang that are read on the way, so that they are looked at.
            taken = stamp + self._image_stamps.offset
            if found and (pose := self._tracker.passing(taken)) is not None:
                self._work.put(lambda: self.worker.monitor.pass_by(pose, found), 'passing')
            self._look_at_next()

    def _on_image(self, serialized: bytes) -> None:
        stamp = stamp_of_serialized(serialized)
        self._around.pictured()
        self._lost.come('pictures')
        first, last = self._image_stamps.span_of(stamp, self._now())
        if (warning := self._image_stamps.warning()) is not None:
            self.get_logger().warn(warning)
        self._chooser.take(HeldPicture(serialized, stamp, first, last), time.monotonic())
        self._look_at_next()

    def _look_at_next(self) -> None:
        is_detected = bool(self._detections.get_publisher_count())
        chosen = self._chooser.next(time.monotonic(), is_detected=is_detected)
        if chosen is None:
            return

        def look() -> None:
            late = [LATE] if self._now() - chosen.taken > TOO_LATE else []
            self._lost.count('pictures', *chosen.causes, *late)
            self._look(chosen)
            if chosen.viewpoint is not None:
                self._topics.looked_at(chosen.taken, chosen.bearing)

        self._work.put(look, 'pictures', worth=int(chosen.viewpoint is not None))

    async def _on_command(self, request: Any, response: Any) -> Any:
        # The worker alone touches the events.
        future, work = reported(self, lambda: self.worker.answer(request.line))
        self._work.put(work)
        try:
            response.answer = await future
            response.accepted = True
        except ValueError as error:
            response.answer = str(error)
        return response

    # --- in the worker ---

    def _watch(self) -> None:
        while (work := self._work.take()) is not None:
            try:
                work()
            except Exception as error:
                # Whatever it was, it was this message's: the next one may be good.
                self.get_logger().error(
                    f'{type(error).__name__}: {error}', throttle_duration_sec=10.0
                )

    def _look(self, chosen: ChosenPicture) -> None:
        image = image_from_ros(deserialize_message(chosen.data, Image), MOST_PIXELS)
        picture = np.asarray(image, np.uint8)
        view = None if chosen.camera is None else chosen.camera.view_of(picture)
        self.worker.monitor.picture(picture, chosen.viewpoint, chosen.taken, chosen.markers, view)

    def _assess(self) -> None:
        has_camera = self._settings.camera and bool(
            self.count_publishers(self.resolve_topic_name(CAMERA))
        )
        around = self._around.judged(
            time.monotonic(),
            has_camera=has_camera,
            has_map=self.worker.has_map,
            all_around=bool(self._pairing.sectors.all()),
        )
        if around is not None:
            self._topics.sees_around(around)
        self._lost.expect('pictures', has_camera)
        self._say_what_is_lost()
        self.worker.assess(self._now())

    def _say_what_is_lost(self) -> None:
        """Tell of pictures and sweeps that are of no use, once for each cause, and when it ends."""
        found = self._lost.findings()
        for (source, cause), text in found.items():
            self.incidents.begin(('sight', f'{source} {cause}'), text)
        for each in self.incidents.open():
            if each.kind == 'sight' and tuple(each.name.split(' ', 1)) not in found:
                self.incidents.end(each)
        for (source, cause), count in self._lost.lost.items():
            self.health.figure(f'{source}_{cause.replace(" ", "_")}', count)

    def _keep(self) -> None:
        self.worker.keep(self._now())


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(Observer, args)


if __name__ == '__main__':
    raise SystemExit(main())
