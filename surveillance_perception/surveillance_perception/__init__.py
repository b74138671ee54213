"""Find ArUco markers in images, and turn a camera arm to look for them.

Most users need the names below; the sub-packages hold the rest:

- `detection`: images in, ids, corners and poses out. No ROS.
- `arm`: kinematics, trajectories and scans of the arm that carries the camera. No ROS.
- `stream`: images from files, videos and webcams.
- `testing`: rendered images of markers with known truth.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from surveillance_perception.detection import (
        CameraModel,
        Detection,
        DetectorSettings,
        MarkerDetector,
        MarkerPose,
        pose_of,
    )

__all__ = [
    'CameraModel',
    'Detection',
    'DetectorSettings',
    'MarkerDetector',
    'MarkerPose',
    'pose_of',
]


def __getattr__(name: str) -> Any:
    # late, so that a node that needs no image does not load OpenCV
    if name in __all__:
        from surveillance_perception import detection

        return getattr(detection, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
