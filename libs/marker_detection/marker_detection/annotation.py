"""Drawing what was detected into the image."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from marker_detection.detector import Detection

_CONFIRMED = (60, 220, 60)
_SEEN = (0, 165, 255)
_CORNER = (255, 80, 40)
_GROUND = (20, 20, 20)


def annotated(
    image: npt.NDArray[np.uint8],
    detections: Iterable[Detection],
    confirmed: Iterable[int] | None = None,
) -> npt.NDArray[np.uint8]:
    """Return a BGR copy of an image with outlines and ids.

    Args:
        image: (height, width) grey or (height, width, 3) BGR.
        detections: What to draw.
        confirmed: Ids to draw in green, others in orange; None draws all in green.
    """
    drawn = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else image.copy()
    believed = None if confirmed is None else set(confirmed)
    scale = max(0.45, min(drawn.shape[:2]) / 1100.0)
    thickness = max(1, round(1.6 * scale))
    for detection in detections:
        sure = believed is None or detection.marker_id in believed
        color = _CONFIRMED if sure else _SEEN
        # four more bits than whole pixels, so that outlines of small markers lie where they are
        fixed = np.rint(detection.corners * 16).astype(np.int32)
        cv2.polylines(drawn, [fixed], True, color, thickness, cv2.LINE_AA, shift=4)
        cv2.circle(drawn, fixed[0].tolist(), 32 * thickness, _CORNER, -1, cv2.LINE_AA, shift=4)
        text = f'{detection.marker_id} {detection.confidence:.2f}'
        x = int(detection.corners[:, 0].min())
        y = int(detection.corners[:, 1].min()) - 5
        origin = (max(0, x), y if y > 12 else int(detection.corners[:, 1].max()) + 14)
        (width, height), _ = cv2.getTextSize(text, 0, scale, thickness)
        top_left = (origin[0] - 2, origin[1] - height - 2)
        cv2.rectangle(drawn, top_left, (origin[0] + width + 2, origin[1] + 3), _GROUND, -1)
        cv2.putText(drawn, text, origin, 0, scale, color, thickness, cv2.LINE_AA)
    return np.asarray(drawn, np.uint8)
