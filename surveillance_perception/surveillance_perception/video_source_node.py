"""The `video_source` node: a webcam, a video or images as the camera topic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from marker_detection import CameraModel
from state_machines.ros import ClockWait
from strict_files.settings import parameter
from surveillance_perception.conversions import camera_to_ros, image_to_ros
from surveillance_perception.stream.image_files import ImageArray, ImageError
from surveillance_perception.stream.image_subscription import IMAGES_QOS
from surveillance_perception.stream.video import FrameSource, open_source
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.process import run_node


@dataclass
class VideoSettings:
    """What is published, and how; units as declared."""

    source: str = parameter(
        '', 'A video file or a folder of images; empty: a webcam.', read_only=True
    )
    camera: int = parameter(0, 'Number of the webcam.', 0, read_only=True)
    rate: float = parameter(0.0, "Images a second; 0: the video's own, 5 for images.", 0.0, 1000.0)
    loop: bool = parameter(False, 'Begin again after the last image.')
    frame_id: str = parameter(
        'camera_rgb_optical_frame', "The camera's optical frame.", read_only=True
    )
    field_of_view: float = parameter(60.0, 'Horizontal field of view, degrees.', 5.0, 170.0)


class VideoSource(PatrolNode):
    """Publishes images from outside ROS on `camera/rgb/image_raw`."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__('video_source', **node_options)
        settings = self._settings = self.declare_live(VideoSettings())
        self._source = settings.source or str(settings.camera)
        self._is_camera = not settings.source
        self._images = self.create_publisher(Image, 'camera/rgb/image_raw', IMAGES_QOS)
        self._infos = self.create_publisher(CameraInfo, 'camera/rgb/camera_info', IMAGES_QOS)
        self._wait = ClockWait(self)
        try:
            opened = open_source(self._source)
        except ImageError as error:
            raise ParameterError(f'{self.get_name()}: {error}') from None
        self.spawn(lambda: self._work(opened), 'video')

    def _work(self, source: FrameSource) -> None:
        while True:
            good = self._play(source)
            source.frames.close()
            if self.stopping.is_set():
                return
            if self._is_camera:
                self.fail(f'camera {self._source} gives no more images')
                return
            if not self._settings.loop or not good:
                self.get_logger().info('the last image was sent')
                return
            source = open_source(self._source)

    def _play(self, source: FrameSource) -> bool:
        """Send every image once; whether there was one."""
        good = False
        for frame in source.frames:
            if isinstance(frame, ImageError):
                self.get_logger().error(str(frame))
                continue
            self._send(frame)
            good = True
            rate = self._settings.rate or source.rate or (0.0 if self._is_camera else 5.0)
            if not self._wait.sleep(1.0 / rate if rate else 0.0, self.stopping):
                break
        return good

    def _send(self, frame: ImageArray) -> None:
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=self._settings.frame_id)
        height, width = frame.shape[:2]
        field_of_view = math.radians(self._settings.field_of_view)
        camera = CameraModel.from_field_of_view(width, height, field_of_view)
        self._infos.publish(camera_to_ros(camera, header))
        self._images.publish(image_to_ros(frame, header))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(VideoSource, args)


if __name__ == '__main__':
    raise SystemExit(main())
