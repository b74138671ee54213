"""Hard markers in one picture: what stands there, what is read, and how far both are apart.

python -m marker_detection.demo [PICTURE]

Markers that are small, oblique, half in the shade, bent, and out of focus are drawn on a wall of
which every corner is known, and read back. What is read is drawn into PICTURE (`markers.png` in
this folder): an outline, the id, and the confidence.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection import (
    CameraModel,
    DetectorSettings,
    MarkerDetector,
    annotated,
    dictionary_named,
    pose_of,
)
from marker_detection.testing.marker_scene import (
    Degradation,
    Panel,
    Shadow,
    corners_in_image,
    image_of,
)

DICTIONARY = 'DICT_5X5_100'
SIZE = 0.2
"""Side of each marker, metres."""
MARKERS = {
    'near, in plain view': Panel(11, 1.5, 0.2, offset=(-190.0, -90.0)),
    'turned by 72 degrees': Panel(23, 1.6, math.radians(72), offset=(-20.0, -95.0)),
    'half in the shade': Panel(42, 1.8, 0.3, offset=(140.0, -95.0)),
    'on paper that curls': Panel(64, 1.7, 0.3, offset=(-180.0, 105.0), curl=0.6),
    '6 m away': Panel(77, 6.0, 0.1, offset=(0.0, 95.0)),
    '9 m away': Panel(90, 9.0, 0.2, offset=(120.0, 100.0)),
}


def picture(camera: CameraModel) -> npt.NDArray[np.uint8]:
    """Return a grey image of the markers, as a blurred and noisy camera sees them."""
    generator = np.random.default_rng(1)
    wall = np.linspace(110.0, 170.0, camera.width, dtype=np.float32)
    shade = Shadow((camera.width / 2 + 140.0, camera.height / 2 - 95.0), 0.5, brightness=0.35)
    lens = Degradation(blur=0.8, noise=4.0, shadows=(shade,))
    return image_of(
        list(MARKERS.values()),
        camera,
        dictionary_named(DICTIONARY),
        np.tile(wall, (camera.height, 1)),
        lens,
        generator,
    )


def main(words: Sequence[str] | None = None) -> int:
    """Draw, detect, compare, and write the picture."""
    given = sys.argv[1:] if words is None else list(words)
    path = Path(given[0] if given else 'markers.png')
    camera = CameraModel.from_field_of_view(640, 480, math.radians(60))
    image = picture(camera)
    detections = MarkerDetector(DetectorSettings(DICTIONARY)).detect(image)
    found = {each.marker_id: each for each in detections}
    print(f'{"marker":24} {"id":>3}  {"side":>6}  corners off  {"away":>6}  it says')
    for name, panel in MARKERS.items():
        truth = corners_in_image(panel, camera)
        side = math.sqrt(cv2.contourArea(truth.astype(np.float32)))
        line = f'{name:24} {panel.marker_id:3}  {side:3.0f} px  '
        detection = found.pop(panel.marker_id, None)
        if detection is None:
            print(line + 'not read')
            continue
        off = float(np.linalg.norm(detection.corners - truth, axis=1).max())
        pose = pose_of(detection.corners, SIZE, camera)
        says = 'no pose' if pose is None else f'{np.linalg.norm(pose.position):.2f} m'
        print(f'{line}{off:8.2f} px  {panel.distance:4.1f} m  {says}')
    print(f'read and not there: {", ".join(map(str, found)) or "none"}')
    drawn = annotated(image, detections)
    if not cv2.imwrite(str(path), drawn):
        print(f'{path}: cannot be written', file=sys.stderr)
        return 1
    print(f'drawn in {path}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
