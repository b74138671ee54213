"""ArUco and AprilTag markers in images: ids, corners, poses, and what a stream of images confirms.

    detector = MarkerDetector(DetectorSettings(dictionary='DICT_4X4_50'))
    for found in detector.detect(image):  # BGR or grey, bytes
        print(found.marker_id, found.corners)

Each name is imported when it is first used; OpenCV only then. See it run:
``python -m marker_detection.demo``.

Public modules: `camera_model` (lenses), `fusion` (positions from many views), `rotations`
(quaternions), `testing.marker_scene` and `testing.image_effects` (pictures with known truth).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from marker_detection.annotation import annotated as annotated
    from marker_detection.boards import BoardPose as BoardPose
    from marker_detection.boards import aprilgrid as aprilgrid
    from marker_detection.boards import board_pose as board_pose
    from marker_detection.camera_model import CameraModel as CameraModel
    from marker_detection.detector import Detection as Detection
    from marker_detection.detector import DetectorSettings as DetectorSettings
    from marker_detection.detector import MarkerDetector as MarkerDetector
    from marker_detection.dictionaries import DICTIONARY_NAMES as DICTIONARY_NAMES
    from marker_detection.dictionaries import dictionary_named as dictionary_named
    from marker_detection.fusion import FusedPosition as FusedPosition
    from marker_detection.fusion import FusedPositions as FusedPositions
    from marker_detection.marker_stream import Confirmation as Confirmation
    from marker_detection.marker_stream import MarkerStream as MarkerStream
    from marker_detection.marker_stream import Sighting as Sighting
    from marker_detection.marker_stream import StreamSettings as StreamSettings
    from marker_detection.pose import MarkerPose as MarkerPose
    from marker_detection.pose import pose_of as pose_of

_HOME = {
    'BoardPose': 'boards',
    'CameraModel': 'camera_model',
    'Confirmation': 'marker_stream',
    'DICTIONARY_NAMES': 'dictionaries',
    'Detection': 'detector',
    'DetectorSettings': 'detector',
    'FusedPosition': 'fusion',
    'FusedPositions': 'fusion',
    'MarkerDetector': 'detector',
    'MarkerPose': 'pose',
    'MarkerStream': 'marker_stream',
    'Sighting': 'marker_stream',
    'StreamSettings': 'marker_stream',
    'annotated': 'annotation',
    'aprilgrid': 'boards',
    'board_pose': 'boards',
    'dictionary_named': 'dictionaries',
    'pose_of': 'pose',
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_HOME[name]}'), name)
