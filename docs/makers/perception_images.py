"""Draw the images of docs/explanation/perception.md again.

    python docs/makers/perception_images.py

`markers_seen.jpg` comes from the topic aruco_detector/annotated while the simulated robot's arm
goes through its poses; `hard_markers.png` shows what the benchmark asks for, enlarged.
"""

from __future__ import annotations

import math
import queue
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import cv2
import numpy as np
import numpy.typing as npt
import rclpy
import yaml
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image

from libs.marker_detection.tests.backdrops import backdrop_of
from marker_detection.annotation import annotated
from marker_detection.camera_model import CameraModel
from marker_detection.detector import DetectorSettings, MarkerDetector
from marker_detection.dictionaries import dictionary_named
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    image_of,
)
from state_machines.ros import ServiceCaller
from surveillance_interfaces.srv import MarkerRoutine, PointCamera
from surveillance_perception.arm_controller_node import ArmController
from surveillance_perception.aruco_detector_node import ArucoDetector
from surveillance_perception.conversions import image_from_ros
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import ExecutorThread
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_simulation.simulator_node import Simulator

ROOT = Path(__file__).resolve().parents[2]
IMAGES = ROOT / 'docs' / 'images'
KNOWN = list(range(11, 18))
ImageArray = npt.NDArray[np.uint8]


def place() -> dict[str, Any]:
    """Return the parameters of the marker patrol's place, with dotted names."""
    text = (ROOT / 'config' / 'patrol_world.yaml').read_text()
    flat: dict[str, Any] = {}
    for name, value in yaml.safe_load(text)['/**']['ros__parameters'].items():
        if isinstance(value, dict):
            flat |= {f'{name}.{entry}': each for entry, each in value.items()}
        else:
            flat[name] = value
    return flat


def overrides(**values: Any) -> list[Parameter]:
    """Parameters for a node."""
    return [Parameter(name, value=value) for name, value in values.items()]


def markers_seen() -> ImageArray:
    """Return what the detector shows at three poses, and looking at the two markers that none
    shows.
    """
    # a domain of its own: another robot may be running on this machine
    rclpy.init(domain_id=97)
    spinner = ExecutorThread()
    viewer = PatrolNode('viewer')
    nodes = [
        viewer,
        Simulator(parameter_overrides=[Parameter(n, value=v) for n, v in place().items()]),
        ArucoDetector(parameter_overrides=overrides(known_ids=KNOWN)),
        ArmController(),
    ]
    shown: queue.Queue[Image] = queue.Queue()
    viewer.create_subscription(Image, 'aruco_detector/annotated', shown.put, SENSOR_QOS)
    move = ServiceCaller(viewer, MarkerRoutine, 'move_arm')
    point = ServiceCaller(viewer, PointCamera, 'point_camera')
    for node in nodes:
        spinner.executor.add_node(node)
    spinner.start()

    def rested() -> ImageArray:
        while not shown.empty():
            shown.get()
        for _ in range(6):
            message = shown.get(timeout=30.0)
        return image_from_ros(message, 10**7)

    pictures = []
    try:
        for number in (
            MarkerRoutine.Request.LEFT,
            MarkerRoutine.Request.HOME,
            MarkerRoutine.Request.RIGHT,
            MarkerRoutine.Request.BACK,
        ):
            assert move.call(MarkerRoutine.Request(pos=number), 30.0).success
            pictures.append(rested())
        for x, y, z in ((4.2, 10.93, 1.5), (-1.6, 10.93, 1.8)):
            request = PointCamera.Request(frame_id='map')
            request.point.x, request.point.y, request.point.z = x, y, z
            assert point.call(request, 30.0).success
            pictures.append(rested())
    finally:
        for node in nodes:
            node.stop()
        spinner.stop()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
    rows = [np.hstack(pictures[start : start + 3]) for start in (0, 3)]
    return cv2.resize(np.vstack(rows), None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA)


def hard_markers() -> ImageArray:
    """Markers at the edge of what can be read, five times enlarged, and what was read."""
    camera = CameraModel.from_field_of_view(640, 480, math.radians(60))
    detector = MarkerDetector(DetectorSettings(known_ids=frozenset(KNOWN)))
    sharp = Degradation(blur=0.8)
    cases = {
        '9 m': (Panel(14, 9.0, 0.2), sharp),
        '9 m, 50 deg': (Panel(12, 9.0, math.radians(50)), sharp),
        '3 m, 80 deg': (Panel(16, 3.0, math.radians(80)), sharp),
        '4 m, blur 2 px': (Panel(13, 4.0, 0.4), Degradation(blur=2.0)),
        '4 m, motion 8 px': (Panel(11, 4.0, 0.3), Degradation(0.8, motion=8.0, direction=0.3)),
        '4 m, light 6 %': (Panel(17, 4.0, 0.4), Degradation(0.8, light=0.06)),
        '4 m, noise 30': (Panel(15, 4.0, 0.4), Degradation(0.8, noise=30.0)),
    }
    tiles = []
    for name, (panel, degradation) in cases.items():
        generator = np.random.default_rng(4)
        ground = backdrop_of('clouds', camera, generator)
        picture = image_of(
            [panel], camera, dictionary_named('DICT_5X5_100'), ground, degradation, generator
        )
        cut = (slice(216, 264), slice(296, 344))
        plain = cv2.resize(picture[cut], None, fx=5, fy=5, interpolation=cv2.INTER_NEAREST)
        corner = np.array([cut[1].start, cut[0].start])
        moved = [
            replace(each, corners=(each.corners - corner + 0.5) * 5 - 0.5)
            for each in detector.detect(picture)
        ]
        tile = np.vstack([cv2.cvtColor(plain, cv2.COLOR_GRAY2BGR), annotated(plain, moved)])
        strip = np.full((26, tile.shape[1], 3), 255, np.uint8)
        cv2.putText(strip, name, (6, 18), 0, 0.5, (30, 30, 30), 1, cv2.LINE_AA)
        tiles.append(cv2.copyMakeBorder(np.vstack([strip, tile]), 0, 0, 0, 6, 0, value=[255] * 3))
    return np.hstack(tiles)


if __name__ == '__main__':
    cv2.imwrite(str(IMAGES / 'hard_markers.png'), hard_markers())
    cv2.imwrite(str(IMAGES / 'markers_seen.jpg'), markers_seen(), [cv2.IMWRITE_JPEG_QUALITY, 85])
