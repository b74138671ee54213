"""What lidar and camera saw at a moment of a recording, from the recorded messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage, Image

from surveillance_operator.conversions import jpeg_from
from surveillance_operator.recording.conversion import prefix_of, read_stored
from surveillance_operator.recording.reading import Messages
from surveillance_operator.snapshot import Snapshot
from surveillance_operator.topics import POSE_TOPIC, TOPICS

RECENT = 2.5
"""What was seen longer ago is not shown, seconds."""
IMAGES = ('aruco_detector/annotated', 'camera/rgb/image_raw')
SCAN_TOPIC = 'scan'
KINDS = {'sensor_msgs/msg/Image': Image, 'sensor_msgs/msg/CompressedImage': CompressedImage}


class RecordedSights:
    """Reads what was seen.

    Args:
        recording: Its folder, or its only file.

    Raises:
        RecordingError: It cannot be read.
    """

    def __init__(self, recording: Path) -> None:
        self._messages = Messages(recording)
        self._prefix = prefix_of(self._messages.types)
        self._images = [
            f'{self._prefix}{name}{end}' for name in IMAGES for end in ('', '/compressed')
        ]
        by_name = {topic.name: topic for topic in TOPICS}
        self._pose, self._scan = by_name[POSE_TOPIC], by_name[SCAN_TOPIC]

    def scan(self, at: float) -> list[list[float]]:
        """Return the points that the lidar saw, metres, map frame; none where it was silent."""
        poses = [
            read_stored(Snapshot(), self._pose, data)
            for _, _, data in self._messages.before([self._prefix + POSE_TOPIC], at, RECENT)
        ]
        for _, _, data in self._messages.before([self._prefix + SCAN_TOPIC], at, RECENT):
            # A scan is shown from the pose of its moment.
            for known in poses:
                seen = read_stored(known, self._scan, data).scan
                if len(seen):
                    points: list[list[float]] = np.round(seen, 2).tolist()
                    return points
        return []

    def jpeg(self, at: float) -> bytes | None:
        """Return the image of the camera as JPEG, None where there is none."""
        for topic, _, data in self._messages.before(self._images, at, RECENT, 1):
            kind = KINDS.get(self._messages.types.get(topic, ''))
            if kind is None:
                continue
            try:
                return jpeg_from(deserialize_message(data, kind))
            except Exception:  # whatever rmw finds: the bytes may be anything
                return None
        return None

    def close(self) -> None:
        """Close the files."""
        self._messages.close()
