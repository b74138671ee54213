"""Find the ArUco markers in an image: one image in, ids, places and poses out. No ROS.

    python libs/marker_detection/examples/detect_markers.py [IMAGE]

Without an image it draws a room with two markers, one of them half in the shade.
"""

from __future__ import annotations

import math
import sys

import cv2
import numpy as np

from marker_detection import (
    CameraModel,
    DetectorSettings,
    MarkerDetector,
    dictionary_named,
    pose_of,
)
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    Shadow,
    image_of,
)

DICTIONARY = 'DICT_5X5_100'
MARKER_SIZE = 0.2  # metres


def drawn_room(camera: CameraModel) -> np.ndarray:
    """Return an image with markers 11 and 14."""
    generator = np.random.default_rng(1)
    panels = [Panel(11, 2.0, 0.4, offset=(-120.0, 0.0)), Panel(14, 3.0, 0.2, offset=(100.0, 20.0))]
    shade = Degradation(shadows=(Shadow((420.0, 260.0), 0.6),))
    wall = np.full((camera.height, camera.width), 150.0, np.float32)
    return image_of(panels, camera, dictionary_named(DICTIONARY), wall, shade, generator)


def main() -> None:
    """Detect and print."""
    camera = CameraModel.from_field_of_view(640, 480, math.radians(60))
    if len(sys.argv) > 1:
        read = cv2.imread(sys.argv[1])
        if read is None:
            sys.exit(f'{sys.argv[1]}: no image that OpenCV reads')
        image = np.asarray(read, np.uint8)
        camera = CameraModel.from_field_of_view(
            image.shape[1], image.shape[0], camera.horizontal_field_of_view
        )
    else:
        image = drawn_room(camera)
    detector = MarkerDetector(DetectorSettings(DICTIONARY))
    for found in sorted(detector.detect(image), key=lambda each: each.marker_id):
        x, y = found.corners.mean(axis=0)
        line = f'marker {found.marker_id:3d} at pixel ({x:.0f}, {y:.0f})'
        pose = pose_of(found.corners, MARKER_SIZE, camera)
        if pose is not None:
            deviation = math.sqrt(pose.covariance[2, 2])
            line += f', {pose.position[2]:.2f} m ahead (+-{deviation:.2f} m)'
        print(line)


if __name__ == '__main__':
    main()
