"""Where markers are: fused by the arm's controller, checked by the marker server, sent as tf."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header

from libs.marker_detection.tests.backdrops import backdrop_of
from marker_detection.camera_model import CameraModel
from marker_detection.dictionaries import dictionary_named
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    image_of,
)
from surveillance_interfaces.msg import MarkerDetection, MarkerDetectionArray
from surveillance_perception import aruco_detector_node
from surveillance_perception.arm.kinematics import in_base
from surveillance_perception.arm_controller_node import ArmController
from surveillance_perception.aruco_detector_node import ArucoDetector
from surveillance_perception.conversions import image_to_ros
from surveillance_perception.marker_server_node import MarkerServer
from surveillance_runtime.conversions import pose_estimate, seconds_of
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.robot_arm import ARM


class Log:
    """A logger that keeps its warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warn(self, text: str, **_options: Any) -> None:
        self.warnings.append(text)

    def __getattr__(self, _name: str) -> Any:
        return lambda *_arguments, **_options: None


def seen(marker_id: int, *place: float, deviation: float = 0.02) -> MarkerDetection:
    """Return a confirmed marker at a place, with a covariance."""
    x, y, z = place
    message = MarkerDetection(id=marker_id, confirmed=True)
    message.pose.position = Point(x=x, y=y, z=z)
    message.pose_covariance = (np.eye(6) * deviation**2).ravel()
    return message


def stamp_of(seconds: float) -> Time:
    """Return a stamp."""
    nanoseconds = round(1e9 * seconds)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def test_marker_that_hangs_elsewhere_is_told_once(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / 'markers.yaml'
    place = '{room: %s, x: 0, y: 0, connections: {D: C}, hangs_at: [1.0, 2.0, 1.5]}'
    file.write_text(f'markers:\n  3: {place % "A"}\n  4: {place % "B"}\n')
    node = graph.add(MarkerServer, parameters={'markers_file': str(file)})
    log = Log()
    monkeypatch.setattr(node, 'get_logger', lambda: log)
    markers = graph.node.create_publisher(MarkerDetectionArray, 'arm/markers', 10)
    graph.until(markers.get_subscription_count)
    nowhere = seen(3, math.nan, 0.0, 0.0)
    where = [nowhere, seen(3, 1.05, 2.0, 1.5), seen(4, 1.0, 3.0, 1.5), seen(9, 0.0, 0.0, 0.0)]
    for _ in range(2):
        markers.publish(MarkerDetectionArray(detections=where))
    graph.until(lambda: log.warnings)
    assert log.warnings == [
        'marker 4 (B) is seen at (1.00, 3.00, 1.50), 1.00 m from where the file has it: '
        '(1.00, 2.00, 1.50)'
    ]


def test_arm_tells_where_markers_are_in_the_frame_of_the_odometry(graph: Any) -> None:
    node = graph.add(ArmController)
    fused = graph.listen(MarkerDetectionArray, 'arm/markers')
    states = graph.node.create_publisher(JointState, 'joint_states', SENSOR_QOS)
    odometry = graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)
    shown = graph.node.create_publisher(MarkerDetectionArray, 'aruco_detector/detections', 10)
    base = Odometry(header=Header(frame_id='odom'))
    base.pose.pose.position.x, base.pose.pose.orientation.w = 2.0, 1.0
    home = JointState(name=list(ARM.names), position=list(ARM.home), velocity=[0.0] * 5)

    def rests() -> bool:
        states.publish(home)
        odometry.publish(base)
        return bool(node._bases and node._postures)

    graph.until(rests)
    graph.until(shown.get_subscription_count)
    stamp = graph.node.get_clock().now().to_msg()
    home.header.stamp = base.header.stamp = stamp
    at = seconds_of(stamp)
    graph.until(lambda: rests() and node._bases.stood(at, at) and node._postures.stood(at, at))
    unknown = MarkerDetection(id=8, confirmed=True)
    message = MarkerDetectionArray(detections=[seen(7, 0.0, 0.0, 3.0), unknown])
    message.header.stamp = stamp
    shown.publish(message)
    graph.until(lambda: fused)
    (marker,) = fused[0].detections
    camera = ARM.camera_frame(ARM.home)
    expected = camera[:3, 3] + 3.0 * camera[:3, 2] + [2.0, 0.0, 0.0]
    place = marker.pose.position
    assert (fused[0].header.frame_id, marker.id) == ('odom', 7)
    assert [place.x, place.y, place.z] == pytest.approx(expected.tolist(), abs=1e-6)
    assert 0.02 < math.sqrt(marker.pose_covariance[0]) < 0.1


def carried(node: ArmController, x: float, stamp: Time) -> None:
    """Tell an arm's controller where it stands, and that its arm is at home."""
    base = Odometry(header=Header(frame_id='odom', stamp=stamp))
    base.pose.pose.position.x, base.pose.pose.orientation.w = x, 1.0
    node._on_odometry(base)
    home = JointState(name=list(ARM.names), position=list(ARM.home), velocity=[0.0] * 5)
    home.header.stamp = stamp
    node._on_joints(home)


@pytest.mark.parametrize('late', [0.5, 2.4, 20.0])
def test_a_late_picture_is_paired_with_where_the_camera_was_when_it_was_taken(
    graph: Any, late: float
) -> None:
    node = graph.add(ArmController)
    now = 1e-9 * graph.node.get_clock().now().nanoseconds
    told: list[float] = []
    node._markers = SimpleNamespace(
        publish=lambda message: told.append(message.detections[0].pose.position.x)
    )
    # The robot stands for long, drives a metre, and stands again since just now.
    for tick in range(-600, 2):
        since = tick / 10
        carried(node, min(max(since + 1.5, 0.0), 1.0), stamp_of(now + since))
    for tick in range(20):
        message = MarkerDetectionArray(detections=[seen(7, 0.0, 0.0, 3.0)])
        message.header.stamp = stamp_of(now - late - 2.0 + tick / 10)
        node._on_detections(message)
    standing = ARM.camera_frame(ARM.home) @ [0.0, 0.0, 3.0, 1.0]
    # Half a second ago it drove, and earlier it stood: but then its clock may be behind, too.
    assert told == [] or told == pytest.approx([standing[0]] * len(told), abs=1e-6)


def test_drivers_that_have_another_clock_hide_no_marker(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = graph.add(ArmController)
    told: list[Any] = []
    node._markers = SimpleNamespace(publish=told.append)
    at = SimpleNamespace(nanoseconds=1_700_000_000_000_000_000)
    monkeypatch.setattr(node, 'get_clock', lambda: SimpleNamespace(now=lambda: at))
    for _ in range(20):
        at.nanoseconds += 100_000_000
        now = 1e-9 * at.nanoseconds
        carried(node, 0.0, stamp_of(now - 1.6e9))  # counted since they were switched on
        message = MarkerDetectionArray(detections=[seen(7, 0.0, 0.0, 3.0)])
        message.header.stamp = stamp_of(now - 0.05)
        node._on_detections(message)
    assert len(told) > 10


def test_two_panels_with_one_id_are_a_finding_with_both_positions(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = graph.add(ArmController)
    log = Log()
    monkeypatch.setattr(node, 'get_logger', lambda: log)
    for _ in range(4):
        stamp = graph.node.get_clock().now().to_msg()
        carried(node, 0.0, stamp)
        twice = MarkerDetectionArray(detections=[seen(7, 0.0, 0.0, 3.0), seen(7, 1.0, 0.0, 3.0)])
        twice.header.stamp = stamp
        node._on_detections(twice)
    assert len(log.warnings) == 1
    assert log.warnings[0].startswith('marker 7 hangs at (')
    assert log.warnings[0].endswith(') in odom: two panels with one id')
    assert any('marker 7 hangs at' in text for _, text in node.health.findings())


@pytest.mark.parametrize('localised', [True, False])
def test_odometry_that_drifts_makes_no_second_panel_of_a_marker(
    graph: Any, monkeypatch: pytest.MonkeyPatch, localised: bool
) -> None:
    node = graph.add(ArmController)
    log: Any = Log()
    told: list[Any] = []
    monkeypatch.setattr(node, 'get_logger', lambda: log)
    monkeypatch.setattr(node, '_markers', SimpleNamespace(publish=told.append))
    monkeypatch.setattr(node._stamps, 'span_of', lambda stamp, _now: (stamp, stamp))
    now, x = 1e-9 * graph.node.get_clock().now().nanoseconds - 1.5, 0.0
    # It goes to and fro between two places, and the odometry gets lost by half a metre each time.
    for way in range(6):
        x = 2.0 * (way % 2)
        for tick in range(8):
            now += 0.03
            stamp = stamp_of(now)
            carried(node, x + 0.5 * way, stamp)
            if localised:
                pose = PoseWithCovarianceStamped(pose=pose_estimate((x, 0.0, 0.0), 0.03, 0.01))
                pose.header.stamp, pose.header.frame_id = stamp, 'map'
                node._on_pose(pose)
            image = MarkerDetectionArray(detections=[seen(7, 0.0, 0.0, 5.0 - x)])
            image.header.stamp = stamp
            if tick:
                node._on_detections(image)
    assert log.warnings == []
    assert {each.header.frame_id for each in told} == {'map' if localised else 'odom'}
    if localised:
        camera = ARM.camera_frame(ARM.home)
        place = told[-1].detections[0].pose.position
        expected = camera[:3, 3] + 5.0 * camera[:3, 2]
        assert [place.x, place.y, place.z] == pytest.approx(expected.tolist(), abs=1e-3)
        point = in_base(np.array([5.0, 0.0, 1.0]), 'map', node._base, node._odom_in_map)
        assert point[0] == pytest.approx(5.0 - x)


def room() -> Any:
    """Return an image of markers 12 and 17."""
    generator = np.random.default_rng(3)
    camera = CameraModel.from_field_of_view(320, 240, math.radians(60))
    panels = [Panel(12, 1.5, offset=(-60.0, 0.0)), Panel(17, 1.5, offset=(60.0, 0.0))]
    scene = backdrop_of('plain', camera, generator)
    dictionary = dictionary_named('DICT_5X5_100')
    return image_of(panels, camera, dictionary, scene, Degradation(), generator)


def look(graph: Any, node: ArucoDetector, times: int) -> None:
    """Show the room to a detector until it has looked several times."""
    images = graph.node.create_publisher(Image, 'camera/rgb/image_raw', 5)
    answers = graph.listen(MarkerDetectionArray, 'aruco_detector/detections')
    graph.until(lambda: images.get_subscription_count())
    for count in range(times):
        stamp = graph.node.get_clock().now().to_msg()
        images.publish(image_to_ros(room(), Header(frame_id='lens', stamp=stamp)))
        graph.until(lambda count=count: len(answers) > count)


def test_markers_are_frames_of_tf_where_tf2_msgs_is_installed(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = graph.add(ArucoDetector, parameters={'confirmation_frames': 1})
    sent: list[Any] = []
    # the type that an installed ROS 2 brings; the wheels lack it
    monkeypatch.setattr(aruco_detector_node, 'TFMessage', SimpleNamespace)
    monkeypatch.setattr(node, '_transforms', SimpleNamespace(publish=sent.append))
    look(graph, node, 1)
    graph.until(lambda: sent)
    frames = {each.child_frame_id: each for each in sent[0].transforms}
    assert set(frames) == {'marker_12', 'marker_17'}
    assert frames['marker_12'].header.frame_id == 'lens'
    place = frames['marker_12'].transform.translation
    assert math.hypot(place.x, place.y, place.z) == pytest.approx(1.5, rel=0.02)


def test_candidates_left_unread_are_told_once(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    node = graph.add(ArucoDetector, parameters={'max_candidates': 1})
    log = Log()
    monkeypatch.setattr(node, 'get_logger', lambda: log)
    look(graph, node, 3)
    assert len(log.warnings) == 1
    assert 'left unread to bound the work (max_candidates)' in log.warnings[0]
