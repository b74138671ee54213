"""The observer among real publishers: a box that appears is an event, an incident and an answer."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan
from std_msgs.msg import Bool

from indoor_watch.hung_markers import HungSpot
from indoor_watch.lost_sight import LostSight
from state_machines import Interrupt
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import (
    FleetRobot,
    MarkerDetection,
    MarkerDetectionArray,
    ObservedEvent,
    ObservedEvents,
    PlaceChecks,
    RobotPlace,
    ViewedPictures,
)
from surveillance_interfaces.srv import ConsoleCommand
from surveillance_perception import observer_node
from surveillance_perception.observer_node import Observer
from surveillance_perception.observing import picture_chooser
from surveillance_runtime.event_log import read
from surveillance_runtime.incidents import Cause
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_runtime.robot_arm import ARM

WATCH = 'rules:\n  nothing new:\n    object: none\n    places: [R1]\n'
HERE = (3.0, 2.5)


def ranges(box: tuple[float, float, float] | None) -> list[float]:
    """Return what a lidar in a room of 6 by 5 metres measures, with a round thing in it."""
    found = []
    for angle in np.linspace(-math.pi, math.pi, 360, endpoint=False):
        rays = np.arange(0.05, 8.0, 0.02)
        x, y = HERE[0] + rays * math.cos(angle), HERE[1] + rays * math.sin(angle)
        blocked = (x < 0.1) | (x > 5.9) | (y < 0.1) | (y > 4.9)
        if box is not None:
            blocked |= np.hypot(x - box[0], y - box[1]) < box[2]
        found.append(float(rays[blocked.argmax()]))
    return found


def room_map() -> OccupancyGrid:
    """Return the map of that room."""
    grid = OccupancyGrid()
    cells = np.zeros((100, 120), np.int8)
    cells[[0, 1, -1, -2], :] = 100
    cells[:, [0, 1, -1, -2]] = 100
    grid.info.width, grid.info.height, grid.info.resolution = 120, 100, 0.05
    grid.info.origin.orientation.w = 1.0
    grid.data = cells.ravel().tolist()
    return grid


def test_a_box_is_told_with_a_picture_and_a_person_calls_it_normal(graph, tmp_path: Path):
    (tmp_path / 'watch.yaml').write_text(WATCH)
    parameters = {
        'watch_file': str(tmp_path / 'watch.yaml'),
        'evidence_folder': str(tmp_path / 'evidence'),
        'state_file': str(tmp_path / 'observer.json'),
        'record': str(tmp_path / 'events.jsonl'),
    }
    node = graph.add(
        Observer,
        parameters,
    )
    make = graph.node.create_publisher
    maps, places = make(OccupancyGrid, 'map', STATE_QOS), make(RobotPlace, 'robot_place', STATE_QOS)
    poses = make(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    scans = make(LaserScan, 'scan', SENSOR_QOS)
    events = graph.listen(ObservedEvents, 'events', STATE_QOS)
    maps.publish(room_map())
    graph.until(lambda: scans.get_subscription_count() and poses.get_subscription_count())

    def seen() -> list[ObservedEvent]:
        return [each for each in events[-1].events if each.seen == 'appeared'] if events else []

    def look(place: str, box: tuple[float, float, float] | None, done) -> None:
        places.publish(RobotPlace(place=place))
        measured, number = ranges(box), 0

        def step() -> bool:
            nonlocal number
            number += 1
            stamp = graph.node.get_clock().now().to_msg()
            scan = LaserScan(angle_min=-math.pi, angle_increment=math.tau / 360, range_max=8.0)
            scan.header.stamp, scan.ranges = stamp, measured
            scans.publish(scan)
            pose = PoseWithCovarianceStamped()
            pose.header.stamp, pose.header.frame_id = stamp, 'map'
            pose.pose.pose.position.x, pose.pose.pose.position.y = HERE
            pose.pose.pose.orientation.w = 1.0
            poses.publish(pose)
            return bool(done(number))

        graph.until(step)

    look('R1', None, lambda number: node.sweeps >= 8)
    look('R2', None, lambda number: node.sweeps >= 12)
    look('R1', (1.5, 1.5, 0.2), lambda number: bool(seen()))
    (event,) = seen()
    assert (event.kind, event.seen, event.place) == ('object', 'appeared', 'R1')
    assert math.dist((event.position[0].x, event.position[0].y), (1.5, 1.5)) < 0.25
    assert (tmp_path / 'evidence' / event.evidence[0]).stat().st_size > 1000
    assert Cause('event', '1') in node.incidents.open()

    caller = ServiceCaller(graph.node, ConsoleCommand, 'observer/command')
    answer = caller.call(ConsoleCommand.Request(line='norml 1'), 20.0, Interrupt())
    assert (answer.accepted, answer.answer) == (False, "got 'norml', expected 'normal'")
    answer = caller.call(ConsoleCommand.Request(line='normal 1'), 20.0, Interrupt())
    assert answer.accepted
    assert 'is normal' in answer.answer
    graph.until(lambda: not node.incidents.open())
    graph.until(lambda: events[-1].events[0].state == 'normal')
    graph.remove(node)
    kept = json.loads((tmp_path / 'observer.json').read_text())
    assert kept['book']['events'] == [], 'what is over is in the log'
    told = read(tmp_path / 'events.jsonl')
    states = [each.text('state') for each in told if each.name == 'finding']
    assert (states[0], states[-1]) == ('open', 'normal')
    assert [each.text('line') for each in told if each.name == 'answer'] == ['normal 1']


def test_it_hears_of_the_other_robots_of_its_fleet_and_where_they_are(graph):
    node = graph.add(Observer, {'camera': False})
    bert = graph.add(PatrolNode, name='robot_behavior', namespace='b')
    fleet = bert.create_publisher(FleetRobot, '/fleet_robots', 10)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'b/amcl_pose', STATE_QOS)
    pose = PoseWithCovarianceStamped()
    pose.pose.pose.position.x, pose.pose.pose.position.y = 4.0, 1.0
    pose.pose.pose.orientation.w = 1.0

    def heard() -> bool:
        fleet.publish(FleetRobot(robot='b'))
        fleet.publish(FleetRobot(robot='not a name'))
        pose.header.stamp = graph.node.get_clock().now().to_msg()
        poses.publish(pose)
        now = 1e-9 * graph.node.get_clock().now().nanoseconds
        return list(node.worker.others.at(now)) == [(4.0, 1.0)]

    graph.until(heard)


def test_it_says_when_a_turn_would_show_nothing_more(graph):
    graph.add(Observer)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    graph.node.create_publisher(OccupancyGrid, 'map', STATE_QOS).publish(room_map())
    told = graph.listen(Bool, 'sees_around', STATE_QOS)

    def measured(beams: int, first: float) -> bool:
        scan = LaserScan(angle_min=first, angle_increment=math.tau / 360, range_max=8.0)
        scan.header.frame_id = 'base_link'
        scan.header.stamp = graph.node.get_clock().now().to_msg()
        scan.ranges = [2.0] * beams
        scans.publish(scan)
        return bool(told)

    graph.until(lambda: measured(180, -math.pi / 2))
    assert not told[-1].data, 'nothing is measured behind it'
    graph.until(lambda: measured(360, -math.pi) and told[-1].data)
    graph.node.create_publisher(Image, 'camera/rgb/image_raw', SENSOR_QOS)
    graph.until(lambda: not told[-1].data)


class Eyes:
    """Hands an observer what its robot tells, and keeps what it looks at.

    Attributes:
        node: The observer.
        looked: Of each picture where it was taken from, and the ids of the markers in it.
        camera: Where the camera was on the map in the last one.
    """

    def __init__(self, graph, monkeypatch):
        self.node = graph.add(Observer, {'facts': False})
        for each in ('PICTURE_PERIOD', 'STANDING_PATIENCE'):
            monkeypatch.setattr(picture_chooser, each, 0.0)
        self.now = 1e-9 * graph.node.get_clock().now().nanoseconds
        self.camera: Any = None
        self.looked: list[tuple[tuple[float, ...] | None, list[int] | None]] = []
        monkeypatch.setattr(self.node, '_look', self._look)
        monkeypatch.setattr(self.node._work, 'put', lambda work, *_, **__: work())
        # What is handed over comes a moment after the last reading of the odometry.
        self.clock = SimpleNamespace(nanoseconds=0)
        clock = SimpleNamespace(now=lambda: self.clock)
        monkeypatch.setattr(self.node, 'get_clock', lambda: clock)

    def _look(self, chosen):
        read = chosen.markers
        numbers = None if read is None else [each.number for each in read]
        self.looked.append((chosen.viewpoint, numbers))
        self.camera = chosen.camera

    def stamp(self, since: float) -> Time:
        nanoseconds = round(1e9 * (self.now + since))
        return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)

    def carry(self, x: float, since: float, off: float = 0.0) -> None:
        pose, odometry = PoseWithCovarianceStamped(), Odometry()
        self._pass(since)
        for message, ahead in ((pose, 0.0), (odometry, off)):
            message.header.stamp = self.stamp(since + ahead)
            message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
        pose.pose.pose.position.y = 5.0  # the odometry began elsewhere
        self.node._odometer._on_odometry(serialize_message(odometry))
        self.node._on_pose(serialize_message(pose))

    def _pass(self, since: float) -> None:
        now = round(1e9 * (self.now + since + 0.02))
        self.clock.nanoseconds = max(self.clock.nanoseconds, now)

    def bend(self, since: float, names: Sequence[str], positions: Sequence[float]) -> None:
        joints = JointState(name=list(names), position=list(positions))
        joints.header.stamp = self.stamp(since)
        self.node._on_joints(joints)

    def show(self, since: float, pixels: bytes = b'') -> None:
        self._pass(since)
        image = Image(data=pixels)
        image.header.stamp = self.stamp(since)
        self.node._on_image(serialize_message(image))

    def detect(self, since: float, *numbers: int) -> None:
        found = [MarkerDetection(id=each, confirmed=True) for each in numbers]
        message = MarkerDetectionArray(detections=found)
        message.header.stamp = self.stamp(since)
        self.node._on_detections(message)


def test_a_picture_counts_from_where_the_robot_was_when_it_was_taken(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    for tick in range(-100, 1):
        since = tick / 10
        eyes.carry(min(max(since + 4.0, 0.0), 2.0), since)
    eyes.show(-5.0)  # five seconds late: it stood at 0 then, or the camera's clock is behind
    eyes.show(-2.5)
    eyes.show(-1.0)
    assert [viewpoint for viewpoint, _ in eyes.looked] == [None, None, (2.0, 5.0, 0.0)]


def test_a_scan_counts_from_where_the_robot_was_when_it_was_made(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    seen: list[tuple[float, float]] = []
    monkeypatch.setattr(eyes.node, '_see', lambda pose, _scan: seen.append(pose[:2]))

    def scan(since: float) -> None:
        message = LaserScan(angle_increment=0.1, range_max=8.0, ranges=[1.0] * 63)
        message.header.stamp = eyes.stamp(since)
        eyes.node._lidar._take('scan', eyes.node._on_scan, message)

    for tick in range(-20, 1):
        eyes.carry(0.5 + tick / 20, tick / 20)  # a metre a second
    # A lidar's scan is stamped when it begins, and comes later than the odometry of that time.
    scan(-0.125)
    assert seen == [pytest.approx((0.375, 5.0), abs=0.01)]
    scan(-1.7)
    assert len(seen) == 1
    scan(0.1)
    assert len(seen) == 1, 'nobody knows yet how the robot goes on'
    eyes.carry(0.5, 0.15)  # it stopped at once
    assert seen[1:] == [pytest.approx((0.5, 5.0), abs=0.01)]


def test_a_picture_tells_where_on_the_map_its_camera_is_and_how_sure_that_is(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    for tick in range(-20, 1):
        eyes.carry(1.0, tick / 10)
        eyes.bend(tick / 10, ['wheel', *ARM.names], [7.0 + tick, *ARM.home])
    eyes.show(-0.1)
    assert not eyes.camera, 'the lens is not known'
    info = CameraInfo(
        width=320, height=240, k=[300.0, 0.0, 160.0, 0.0, 300.0, 120.0, 0.0, 0.0, 1.0]
    )
    eyes.node._on_camera_info(info)
    eyes.show(0.0)
    view = eyes.camera.view_of(np.zeros((480, 640), np.uint8))
    assert view.at == pytest.approx(ARM.camera_frame(ARM.home)[:3, 3] + [1.0, 5.0, 0.0])
    assert view.matrix[0, 0] == pytest.approx(600.0)
    assert (view.deviation, view.turn) == (0.01, 0.005), 'no localisation is exact'
    assert eyes.camera.view_of(np.zeros((480, 480), np.uint8)) is None
    pose = PoseWithCovarianceStamped()
    pose.header.stamp, pose.pose.pose.orientation.w = eyes.stamp(0.0), 1.0
    pose.pose.covariance[7] = 0.04
    eyes.node._on_pose(serialize_message(pose))
    eyes.show(0.01)
    assert eyes.camera.view_of(np.zeros((480, 640), np.uint8)).deviation == pytest.approx(0.2)
    pose.pose.covariance[0] = math.nan
    eyes.node._on_pose(serialize_message(pose))
    eyes.show(0.02)
    assert eyes.camera is None, 'it is not told how sure the pose is'
    assert eyes.looked[-1][0] is not None


def test_joints_come_from_several_drivers_and_wheels_turn_no_camera(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    for tick in range(-20, 1):
        eyes.carry(1.0, tick / 10)
        eyes.bend(tick / 10, ['wheel_left_joint', 'front_caster'], [float(tick), 0.1 * tick])
        eyes.bend(tick / 10, ['pan'], [0.5])
        eyes.bend(tick / 10, ['tilt', 'pan'], [0.1])  # too few positions
        eyes.bend(tick / 10, ['tilt'], [math.nan])
        eyes.bend(tick / 10, ['tilt'], [])
    eyes.show(-0.1)
    assert eyes.looked == [((1.0, 5.0, 0.0, 0.5), None)]
    # An arm that is known tells all; half a message of it is not for it.
    for tick in range(1, 21):
        eyes.carry(1.0, tick / 10)
        eyes.bend(tick / 10, ARM.names, ARM.home)
        eyes.bend(tick / 10, ARM.names, ARM.home[:2])
        eyes.bend(tick / 10, ['gripper'], [float(tick)])
    eyes.show(1.9)
    assert eyes.looked[-1] == ((1.0, 5.0, 0.0, *ARM.home), None)
    for number in range(100):
        eyes.bend(2.0, [f'of_a_stranger_{number}'], [0.0])
    assert eyes.looked[-1] == ((1.0, 5.0, 0.0, *ARM.home), None)


@pytest.mark.parametrize('off', [-3600.0, 3600.0, 1.0])
def test_a_picture_has_a_pose_also_where_the_drivers_have_another_clock(graph, monkeypatch, off):
    eyes = Eyes(graph, monkeypatch)
    for tick in range(-60, 1):
        eyes.carry(1.0, tick / 10, off)
        eyes.bend(tick / 10 + off, ['pan'], [0.5])
    eyes.show(0.0)
    assert eyes.looked == [(pytest.approx((1.0, 5.0, 0.0, 0.5)), None)]


def test_huge_messages_of_a_stranger_are_refused_in_a_line(graph, monkeypatch, capfd):
    eyes = Eyes(graph, monkeypatch)
    for _ in range(2):
        eyes.detect(-0.1, *range(observer_node.MOST_MARKERS + 1))
        eyes.bend(-0.1, [f'joint_{number}' for number in range(1001)], [0.0] * 1001)
    lines = capfd.readouterr().err
    assert lines.count('1001 markers in a picture: expected at most 1000') == 1
    assert lines.count('1001 joints: expected at most 1000') == 1
    eyes.show(-0.1)
    assert [numbers for _, numbers in eyes.looked] == [None]


def test_what_was_read_in_one_picture_is_not_of_another_one_with_the_same_stamp(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    eyes.show(-1.0, b'1')
    eyes.detect(-1.0, 14)
    eyes.show(-1.0, b'1')
    assert len(eyes.looked) == 1, 'it is the same picture'
    eyes.show(-1.0, b'2')
    assert [numbers for _, numbers in eyes.looked] == [None, None]


def test_markers_count_for_the_picture_that_they_were_read_in(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    eyes.detect(-0.4, 14)
    eyes.show(-0.3)
    eyes.show(-0.4)
    assert [numbers for _, numbers in eyes.looked] == [None, [14]]
    # The detector died: nobody looked for markers in what follows.
    eyes.show(-0.2)
    assert eyes.looked[-1][1] is None
    # One that is alive is waited for, and what it says of another picture is no answer.
    graph.node.create_publisher(MarkerDetectionArray, 'aruco_detector/detections', 10)
    graph.until(lambda: eyes.node._detections.get_publisher_count())
    monkeypatch.setattr(picture_chooser, 'DETECTOR_PATIENCE', 100.0)
    eyes.show(-0.1)
    eyes.detect(-0.2, 15)
    assert len(eyes.looked) == 3
    eyes.detect(-0.1, 16)
    assert [numbers for _, numbers in eyes.looked[3:]] == [[16]]


@pytest.mark.usefixtures('incidents_at_once')
def test_pictures_without_a_pose_are_told_once_and_when_that_is_over(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    node, steady = eyes.node, 0.0
    monkeypatch.setattr(node, '_lost', LostSight(lambda: steady))
    cause = Cause('sight', 'pictures no pose')
    for tick in range(-200, -29):
        eyes.carry(0.0, tick / 20)
    lines = []
    monkeypatch.setattr(node.incidents, '_tell', lambda told: lines.append(told.words()))

    def look(first: int, driven: bool) -> None:
        nonlocal steady
        for tick in range(first, first + 20):
            if driven:
                eyes.carry(0.0, tick / 20)
            eyes.show(tick / 20)
            steady += 3.0
            node._say_what_is_lost()

    look(-29, driven=True)
    assert not node.incidents.open()
    look(-4, driven=False)
    assert node.incidents.open() == (cause,)
    look(17, driven=True)
    assert not node.incidents.open()
    assert [line.split(']')[0] for line in lines] == [
        'incident [sight pictures no pose, warning',
        'incident [sight pictures no pose, over',
    ]
    assert node.health.figures()['pictures_no_pose'] == '20'


def test_who_drives_is_no_reason_to_worry_about_poses(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    for tick in range(-100, 1):
        eyes.carry(tick / 10, tick / 10)
    lost = eyes.node._lost
    for tick in range(-10, 1):
        eyes.show(tick / 10)
    assert all(viewpoint is None for viewpoint, _ in eyes.looked)
    assert not lost.lost


def test_it_tells_which_sides_it_has_seen_and_from_where_a_marker_is_to_be_read(
    graph, monkeypatch, tmp_path: Path
):
    (tmp_path / 'watch.yaml').write_text('rules:\n  hang: {marker: all}\n')
    parameters = {
        'facts': False,
        'watch_file': str(tmp_path / 'watch.yaml'),
        'room_positions.R1': [1.0, 2.5],
    }
    node = graph.add(Observer, parameters)
    pictures = graph.listen(ViewedPictures, 'pictures', STATE_QOS)
    checks = graph.listen(PlaceChecks, 'checks', STATE_QOS)
    spot = HungSpot(21, (5.8, 2.5, 1.0), math.pi, 0.2)
    monkeypatch.setattr(node.worker.monitor, 'spots', lambda: [spot])
    graph.node.create_publisher(OccupancyGrid, 'map', STATE_QOS).publish(room_map())
    graph.until(lambda: checks and checks[-1].checks)
    (check,) = checks[-1].checks
    assert (check.place, check.name, check.at.x, check.at.y) == ('R1', 'marker 21', 5.8, 2.5)
    assert 0.8 <= math.dist((check.look_from[0].x, check.look_from[0].y), (5.8, 2.5)) <= 2.2
    info = CameraInfo(width=640, height=480, k=[554.3, 0, 320, 0, 554.3, 240, 0, 0, 1.0])
    sender = graph.node.create_publisher(CameraInfo, 'camera/rgb/camera_info', SENSOR_QOS)

    def known() -> bool:
        sender.publish(info)
        return bool(pictures and len(pictures[-1].angle))

    graph.until(known)
    assert pictures[-1].camera
    assert pictures[-1].angle[0] == pytest.approx(math.radians(60.0), abs=0.01)


def test_a_marker_that_is_read_on_the_way_is_looked_for_where_it_hangs(graph, monkeypatch):
    eyes = Eyes(graph, monkeypatch)
    for tick in range(-20, 1):
        eyes.carry(tick / 20, tick / 20)  # it drives
        joints = JointState(name=[*ARM.names], position=[*ARM.home])
        joints.header.stamp = eyes.stamp(tick / 20)
        eyes.node._on_joints(joints)
    marker = MarkerDetection(id=21, confirmed=True, size=0.2)
    marker.pose.position.z = 2.0
    marker.pose.orientation.x, marker.pose.orientation.w = 1.0, 0.0
    marker.pose_covariance = (np.eye(6) * 1e-4).ravel().tolist()
    message = MarkerDetectionArray(detections=[marker])
    message.header.stamp = eyes.stamp(-0.525)
    eyes.node._on_detections(message)
    (spot,) = eyes.node.worker.monitor.spots()
    lens = ARM.camera_frame(ARM.home)[:3, 3]
    assert spot.position == pytest.approx((-0.525 + lens[0] + 2.0, 5.0, lens[2]), abs=0.02)
    assert abs(spot.facing) == pytest.approx(math.pi)
    assert not eyes.looked
