"""Markers in images: ids, corners, poses, and what a stream of images confirms."""

from surveillance_perception.detection.annotation import annotated
from surveillance_perception.detection.camera_model import CameraModel
from surveillance_perception.detection.detector import (
    Detection,
    DetectorSettings,
    MarkerDetector,
)
from surveillance_perception.detection.dictionaries import DICTIONARY_NAMES, dictionary_named
from surveillance_perception.detection.fusion import FusedPosition, FusedPositions
from surveillance_perception.detection.marker_stream import (
    Confirmation,
    MarkerStream,
    Sighting,
    StreamSettings,
)
from surveillance_perception.detection.pose import MarkerPose, pose_of

__all__ = [
    'DICTIONARY_NAMES',
    'CameraModel',
    'Confirmation',
    'Detection',
    'DetectorSettings',
    'FusedPosition',
    'FusedPositions',
    'MarkerDetector',
    'MarkerPose',
    'MarkerStream',
    'Sighting',
    'StreamSettings',
    'annotated',
    'dictionary_named',
    'pose_of',
]
