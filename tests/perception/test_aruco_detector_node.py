"""The node `aruco_detector` among real publishers and clients."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseArray
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Bool, Header, Int32

from libs.marker_detection.tests.backdrops import backdrop_of
from marker_detection.camera_model import CameraModel
from marker_detection.dictionaries import dictionary_named
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    image_of,
)
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_perception.aruco_detector_node import IDS_QOS, ArucoDetector
from surveillance_perception.conversions import camera_to_ros, image_to_ros
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

CAMERA = CameraModel.from_field_of_view(320, 240, math.radians(60))


def image(*panels: Panel, dictionary: str = 'DICT_5X5_100') -> np.ndarray:
    generator = np.random.default_rng(5)
    scene = backdrop_of('plain', CAMERA, generator)
    return image_of(
        list(panels), CAMERA, dictionary_named(dictionary), scene, Degradation(), generator
    )


ROOM = image(Panel(12, 1.5, 0.3, offset=(-60.0, 0.0)), Panel(70, 1.5, offset=(60.0, 0.0)))


class Camera:
    """Publishes images and listens to what the detector makes of them."""

    def __init__(self, graph: Any, qos: Any = 5) -> None:
        self.graph = graph
        self.images = graph.node.create_publisher(Image, 'camera/rgb/image_raw', qos)
        self.compressed = graph.node.create_publisher(
            CompressedImage, 'camera/rgb/image_raw/compressed', qos
        )
        self.info = graph.node.create_publisher(CameraInfo, 'camera/rgb/camera_info', SENSOR_QOS)
        self.ids = graph.listen(Int32, 'aruco_detector/id', IDS_QOS)
        self.detections = graph.listen(MarkerDetectionArray, 'aruco_detector/detections')
        self.poses = graph.listen(PoseArray, 'aruco_detector/poses')
        self.drawn = graph.listen(Image, 'aruco_detector/annotated', SENSOR_QOS)

    def ready(self) -> None:
        self.graph.until(lambda: self.images.get_subscription_count())
        self.graph.until(lambda: self.compressed.get_subscription_count())

    def show(self, shown: np.ndarray) -> Any:
        """Publish an image until the detector has looked at it; its detections."""
        before = len(self.detections)
        header = Header(frame_id='lens', stamp=self.graph.node.get_clock().now().to_msg())
        self.images.publish(image_to_ros(shown, header))
        self.graph.until(lambda: len(self.detections) > before)
        return self.detections[-1]


def detector(graph: Any, qos: Any = 5, **parameters: Any) -> tuple[Camera, ArucoDetector]:
    camera = Camera(graph, qos)
    node = graph.add(ArucoDetector, parameters={'known_ids': [11, 12, 13]} | parameters)
    camera.ready()
    return camera, node


def test_each_marker_is_announced_once_when_enough_images_agree(graph: Any) -> None:
    camera, _ = detector(graph, confirmation_frames=2, unknown_confirmation_frames=3)
    for _ in range(5):
        camera.show(ROOM)
    graph.until(lambda: len(camera.ids) == 2)
    assert [message.data for message in camera.ids] == [12, 70]
    late = graph.listen(Int32, 'aruco_detector/id', IDS_QOS)
    graph.until(lambda: len(late) == 2)


def test_camera_that_offers_best_effort_only_is_heard(graph: Any) -> None:
    camera, _ = detector(graph, qos=SENSOR_QOS)
    assert len(camera.show(ROOM).detections) == 2


def test_detections_are_typed_posed_and_drawn(graph: Any) -> None:
    camera, _ = detector(graph, confirmation_frames=1)
    camera.info.publish(camera_to_ros(CAMERA, Header()))
    camera.show(ROOM)
    message = camera.show(ROOM)
    by_id = {each.id: each for each in message.detections}
    assert message.header.frame_id == 'lens'
    assert (by_id[12].known, by_id[12].confirmed, by_id[12].size) == (True, True, 0.2)
    assert (by_id[70].known, by_id[70].confirmed) == (False, False)
    position = by_id[12].pose.position
    assert math.dist((position.x, position.y, position.z), (0, 0, 0)) == pytest.approx(
        1.5, abs=0.03
    )
    assert by_id[12].reprojection_error < 0.5
    assert 0.5 < by_id[12].confidence <= 1.0
    assert len(camera.poses[-1].poses) == 1
    graph.until(lambda: camera.drawn)
    assert (camera.drawn[-1].width, camera.drawn[-1].encoding) == (320, 'bgr8')


def test_compressed_images_are_looked_at_too(graph: Any) -> None:
    camera, _ = detector(graph)
    data = cv2.imencode('.jpg', ROOM)[1].tobytes()
    camera.compressed.publish(CompressedImage(format='jpeg', data=data))
    graph.until(lambda: camera.detections)
    assert {each.id for each in camera.detections[-1].detections} == {12, 70}


def test_images_that_are_none_are_named_and_the_node_goes_on(graph: Any) -> None:
    camera, node = detector(graph)
    good = image_to_ros(ROOM, Header())

    def named(reason: str) -> bool:
        return any(
            level == DiagnosticStatus.ERROR and reason in text
            for level, text in node.health.findings()
        )

    for encoding, width, reason in (
        ('yuv444', 320, "encoded as 'yuv444'"),
        ('forged\n[ERROR]', 320, r"encoded as 'forged\n[ERROR]'"),
        ('mono8', 100000, 'larger than'),
        ('bgr8', 320, 'rows of 320 bytes'),
        ('mono8', 0, 'is empty'),
    ):
        wrong = Image(encoding=encoding, width=width, height=good.height, step=good.step)
        wrong.data = good.data
        camera.images.publish(wrong)
        graph.until(lambda reason=reason: named(reason))
    camera.compressed.publish(CompressedImage(data=b'junk'))
    graph.until(lambda: named('compressed image is no image'))
    assert len(camera.show(ROOM).detections) == 2
    assert not node.stopping.is_set()


def test_image_that_raises_costs_itself_alone(graph: Any) -> None:
    camera, node = detector(graph)
    before_the_epoch = image_to_ros(ROOM, Header())
    before_the_epoch.header.stamp.sec = -5
    camera.images.publish(before_the_epoch)
    assert len(camera.show(ROOM).detections) == 2
    assert node.failure is None


def test_camera_info_that_fits_no_camera_leaves_ids_without_poses(graph: Any) -> None:
    camera, _ = detector(graph, confirmation_frames=1)

    def described(**changes: Any) -> CameraInfo:
        message = camera_to_ros(CAMERA, Header())
        for name, value in changes.items():
            setattr(message, name, value)
        camera.info.publish(message)
        return message

    def has_poses() -> bool:
        seen = camera.show(ROOM).detections
        assert len(seen) == 2
        return all(math.isfinite(each.pose.position.z) for each in seen)

    assert has_poses()
    for changes in (
        {'d': [0.1, 0.2, 0.3]},
        {'d': [math.nan] * 5},
        {'k': [500.0, 0.0, 160.0, 0.0, 500.0, 120.0, 0.0, 0.0, 0.0]},
        {'distortion_model': 'mei'},
        {'width': 100},
    ):
        described(**changes)
        graph.until(lambda: not has_poses())
        described()
        graph.until(has_poses)


def test_each_reason_against_camera_info_is_said_within_the_minute(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, node = detector(graph)
    said: list[str] = []
    logger = node.get_logger()
    monkeypatch.setattr(logger, 'warn', lambda text, **_: said.append(text))
    monkeypatch.setattr(node, 'get_logger', lambda: logger)
    graph.until(lambda: camera.info.get_subscription_count())
    for changes in ({'d': [0.1] * 3}, {'distortion_model': 'mei'}, {'d': [0.1] * 3}):
        message = camera_to_ros(CAMERA, Header())
        for name, value in changes.items():
            setattr(message, name, value)
        before = node._described = CAMERA
        camera.info.publish(message)
        graph.until(lambda before=before: node._described is not before)
    assert ['3 distortion' in said[0], "model 'mei'" in said[1], len(said)] == [True, True, 2]


def test_settings_change_while_it_runs(graph: Any) -> None:
    camera, node = detector(graph)
    other = image(Panel(7, 1.5), dictionary='DICT_4X4_50')
    assert not camera.show(other).detections
    setter = ServiceCaller(graph.node, SetParameters, 'aruco_detector/set_parameters')

    def change(name: str, value: Any) -> Any:
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        return setter.call(request, 60.0).results[0]

    assert change('known_ids', [7]).successful
    assert change('marker_dictionary', 'DICT_4X4_50').successful
    assert change('marker_sizes', ['7:0.4']).successful
    shown = camera.show(other).detections
    assert [(each.id, each.known, each.size) for each in shown] == [(7, True, 0.4)]
    refused = change('marker_dictionary', 'DICT_77')
    assert not refused.successful
    assert 'DICT_77' in refused.reason
    refused = change('known_ids', [70])
    assert 'known id 70 is not in the dictionary, expected 0 to 49' in refused.reason
    assert not change('marker_sizes', ['big']).successful
    assert not change('windows', [4]).successful
    assert not node.stopping.is_set()


def test_images_taken_while_the_arm_moves_are_not_read(graph: Any) -> None:
    rest = graph.node.create_publisher(Bool, 'arm/at_rest', STATE_QOS)
    camera, node = detector(graph)
    graph.until(lambda: rest.get_subscription_count())
    assert len(camera.show(ROOM).detections) == 2
    rest.publish(Bool(data=False))
    graph.until(lambda: node._rest_since is None)
    moving = Header(stamp=graph.node.get_clock().now().to_msg())
    camera.images.publish(image_to_ros(ROOM, moving))
    graph.until(lambda: node.skipped == 1)
    rest.publish(Bool(data=True))
    graph.until(lambda: node._rest_since is not None)
    camera.images.publish(image_to_ros(ROOM, moving))
    graph.until(lambda: node.skipped == 2)
    camera.show(ROOM)
    assert len(camera.detections) == 2


@pytest.mark.parametrize(
    ('stamp_of', 'words'),
    [
        (lambda _now: Time(), 'do not advance'),
        (lambda now: Time(sec=now.sec - 60, nanosec=now.nanosec), '60.0 s behind'),
        (lambda now: Time(sec=now.sec + 60, nanosec=now.nanosec), '60.0 s ahead of'),
        (lambda now: Time(sec=now.sec % 1000, nanosec=now.nanosec), 'use_sim_time'),
    ],
)
def test_camera_with_another_clock_is_read_while_the_arm_rests_and_named_once(
    graph: Any, monkeypatch: pytest.MonkeyPatch, stamp_of: Any, words: str
) -> None:
    rest = graph.node.create_publisher(Bool, 'arm/at_rest', STATE_QOS)
    camera, node = detector(graph)
    warnings: list[str] = []
    logger = node.get_logger()
    monkeypatch.setattr(logger, 'warn', lambda text, **_: warnings.append(text))
    monkeypatch.setattr(node, 'get_logger', lambda: logger)
    graph.until(lambda: rest.get_subscription_count())

    def publish() -> None:
        stamp = stamp_of(graph.node.get_clock().now().to_msg())
        camera.images.publish(image_to_ros(ROOM, Header(stamp=stamp)))

    for _ in range(2):
        rest.publish(Bool(data=False))
        graph.until(lambda: node._rest_since is None)
        skipped = node.skipped
        publish()
        graph.until(lambda skipped=skipped: node.skipped > skipped)
        rest.publish(Bool(data=True))
        graph.until(lambda: node._rest_since is not None)
        for _ in range(3):
            read = len(camera.detections)
            publish()
            graph.until(lambda read=read: len(camera.detections) > read)
    assert len(warnings) == 1
    assert words in warnings[0]
    graph.until(lambda: any(words in text for _, text in node.health.findings()))


@pytest.mark.parametrize(
    'wrong',
    [{'marker_dictionary': 'DICT_0'}, {'known_ids': [500]}, {'blur': -1.0}, {'marker_size': 0.0}],
)
def test_wrong_parameters_are_refused_at_the_start(graph: Any, wrong: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        graph.add(ArucoDetector, parameters=wrong)


def test_a_place_s_file_is_looked_at_without_opencv() -> None:
    """Every process of a mission does so; most have no use for it."""
    code = (
        'import sys\n'
        'from surveillance_runtime.configuration import Configuration, file_layer\n'
        'Configuration((file_layer("config/patrol_world.yaml"),)).check()\n'
        'sys.exit("cv2" in sys.modules)'
    )
    root = Path(__file__).parents[2]
    assert subprocess.run([sys.executable, '-c', code], cwd=root, check=False).returncode == 0
