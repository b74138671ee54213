"""The node `video_source` plays files as a camera."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
import pytest
from sensor_msgs.msg import CameraInfo, Image

from libs.marker_detection.tests.backdrops import backdrop_of
from marker_detection.camera_model import CameraModel
from marker_detection.dictionaries import dictionary_named
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    image_of,
)
from surveillance_perception.video_source_node import VideoSource
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import SENSOR_QOS

CAMERA = CameraModel.from_field_of_view(320, 240, math.radians(60))


def image(*panels: Panel, dictionary: str = 'DICT_5X5_100') -> np.ndarray:
    generator = np.random.default_rng(5)
    scene = backdrop_of('plain', CAMERA, generator)
    return image_of(
        list(panels), CAMERA, dictionary_named(dictionary), scene, Degradation(), generator
    )


ROOM = image(Panel(12, 1.5, 0.3, offset=(-60.0, 0.0)), Panel(70, 1.5, offset=(60.0, 0.0)))


def test_video_source_sends_a_folder_as_the_camera(graph: Any, tmp_path: Any) -> None:
    images = graph.listen(Image, 'camera/rgb/image_raw', SENSOR_QOS)
    infos = graph.listen(CameraInfo, 'camera/rgb/camera_info', SENSOR_QOS)
    cv2.imwrite(str(tmp_path / 'a.png'), ROOM)
    (tmp_path / 'b.png').write_bytes(b'broken')
    graph.add(VideoSource, parameters={'source': str(tmp_path), 'rate': 50.0, 'loop': True})
    graph.until(lambda: len(images) >= 2 and infos)
    assert (images[0].width, images[0].height, images[0].encoding) == (320, 240, 'bgr8')
    assert infos[0].k[0] == pytest.approx(CAMERA.matrix[0, 0])


def test_video_source_does_not_start_without_a_source(graph: Any) -> None:
    with pytest.raises(ParameterError, match='no such video file or folder of images'):
        graph.add(VideoSource, parameters={'source': 'none.mp4'})
    with pytest.raises(ParameterError, match='camera 77 cannot be opened'):
        graph.add(VideoSource, parameters={'camera': 77})
