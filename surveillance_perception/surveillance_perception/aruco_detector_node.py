"""The `aruco_detector` node: camera images in, markers out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from geometry_msgs.msg import PoseArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Bool, Int32

from marker_detection import CameraModel, MarkerStream, StreamSettings, annotated
from strict_files.settings import parameter
from surveillance_interfaces.msg import MarkerDetectionArray
from surveillance_perception.conversions import (
    camera_from_ros,
    detections_to_ros,
    image_from_any,
    image_to_ros,
    poses_to_ros,
    transforms_to_ros,
)
from surveillance_perception.stream.image_subscription import IMAGES_QOS, ImageSubscription, Latest
from surveillance_runtime.conversions import seconds_of
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.process import run_node
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.stamp_offset import StampOffset
from surveillance_runtime.state_topics import StateSubscription

try:
    # the wheels on PyPI hold no tf2_msgs; an installed ROS 2 does
    from tf2_msgs.msg import TFMessage
except ImportError:
    TFMessage = None

# seconds after which a warning is repeated, and how many different ones there are in that time
_SAY_AGAIN, _MOST_REASONS = 60.0, 10
REPORT_PERIOD = 1.0
"""Seconds over which images are counted for the node's health."""
IDS_QOS = QoSProfile(depth=200, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Each id is sent once, so whoever comes late gets those that were sent before."""


@dataclass(frozen=True)
class ImageSettings:
    """Which images are looked at, and through which lens."""

    field_of_view: float = parameter(
        60.0, 'Horizontal, degrees, while there is no camera_info.', 5.0, 170.0
    )
    max_pixels: int = parameter(20_000_000, 'The largest image that is looked at.', 1)
    only_at_rest: bool = parameter(
        True, 'Leave out images taken while arm/at_rest is false; without an arm it is never told.'
    )


class ArucoDetector(PatrolNode):
    """Finds ArUco markers in the camera's images.

    Attributes:
        skipped: How many images were left out because the arm moved.
    """

    def __init__(self, **node_options: Any) -> None:
        super().__init__('aruco_detector', **node_options)
        self._settings = self.declare_fields(StreamSettings(), on_change=self._set_stream)
        self._options = self.declare_live(ImageSettings())
        self._described: CameraModel | None = None
        self._undescribed = True
        self._rest_since: float | None = -math.inf
        self._stale = False
        self._said_left_out = False
        self._warned: dict[str, float] = {}
        self.skipped = self._skipped_before = 0
        self._watch = MarkerStream(self._settings)
        # with each image, when it was taken: seconds of this node's clock
        self._images: Latest[tuple[Image | CompressedImage, float]] = Latest()
        self._stamps: list[StampOffset] = []
        self._ids = self.create_publisher(Int32, 'aruco_detector/id', IDS_QOS)
        self._detections = self.create_publisher(
            MarkerDetectionArray, 'aruco_detector/detections', 10
        )
        self._poses = self.create_publisher(PoseArray, 'aruco_detector/poses', 10)
        self._annotated = self.create_publisher(Image, 'aruco_detector/annotated', IMAGES_QOS)
        self._transforms = None if TFMessage is None else self.create_publisher(TFMessage, 'tf', 10)
        topic = 'camera/rgb/image_raw'
        ImageSubscription(self, Image, topic, self._image_taker(topic))
        compressed = topic + '/compressed'
        ImageSubscription(self, CompressedImage, compressed, self._image_taker(compressed))
        self.create_subscription(
            CameraInfo, 'camera/rgb/camera_info', self._on_camera_info, SENSOR_QOS
        )
        StateSubscription(self, Bool, 'arm/at_rest', self._on_rest, owner='arm_controller')
        self.create_timer(REPORT_PERIOD, self._report)
        self.spawn(self._work, 'marker detection')

    def on_stop(self) -> None:
        """End the worker."""
        self._images.close()

    def _set_stream(self, settings: StreamSettings) -> None:
        self._settings, self._stale = settings, True

    def _on_camera_info(self, message: CameraInfo) -> None:
        self._undescribed = False
        try:
            self._described = camera_from_ros(message)
        except ValueError as error:
            self._described = None
            self._warn_once_a_minute(f'camera_info refused, ids are read without poses: {error}')

    def _warn_once_a_minute(self, text: str) -> None:
        """Say each of the last few reasons once a minute: another one is not swallowed."""
        now = time.monotonic()
        self._warned = {told: at for told, at in self._warned.items() if now - at < _SAY_AGAIN}
        if text not in self._warned and len(self._warned) < _MOST_REASONS:
            self._warned[text] = now
            self.get_logger().warn(text)

    def _on_rest(self, message: Bool) -> None:
        self._rest_since = self._now() if message.data else None

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds / 1e9)

    def _image_taker(self, topic: str) -> Callable[[Image | CompressedImage], None]:
        """Return what takes the images of a topic, whatever clock its camera stamps them by."""
        stamps = StampOffset(topic, self.is_simulated)
        self._stamps.append(stamps)

        def take(message: Image | CompressedImage) -> None:
            # here, not in the worker, which may be late
            taken = stamps.time_of(seconds_of(message.header.stamp), self._now())
            warning = stamps.warning()
            if warning is not None:
                self.get_logger().warn(warning)
            self._images.put((message, taken))

        return take

    def _work(self) -> None:
        while (item := self._images.take()) is not None:
            message, taken = item
            try:
                if self._stale:
                    self._stale = False
                    self._watch.adopt(self._settings)
                if self._options.only_at_rest and not self._taken_at_rest(taken):
                    self.skipped += 1
                    continue
                self._look(message)
            except ValueError as error:
                self._refuse(str(error))
            except Exception as error:
                # whatever it was, it was this image's: the next one may be good
                if self.stopping.is_set():
                    return
                self._refuse(f'{type(error).__name__}: {error}')

    def _refuse(self, reason: str) -> None:
        reason = ' '.join(reason.split())
        self._watch.refuse()
        self.health.error('images', reason)
        self.get_logger().error(reason, throttle_duration_sec=5.0)

    def _taken_at_rest(self, taken: float) -> bool:
        since = self._rest_since
        return since is not None and taken >= since

    def _look(self, message: Any) -> None:
        image = image_from_any(message, self._options.max_pixels)
        height, width = image.shape[:2]
        sightings, new = self._watch.look(image, self._camera_of(width, height))
        if self._watch.left_out and not self._said_left_out:
            self._said_left_out = True
            self.get_logger().warn(
                f'{self._watch.left_out} candidates of an image were left unread to bound the work '
                '(max_candidates); /diagnostics counts them from now on'
            )
        other = self._watch.other_family
        if other is not None:
            self._warn_once_a_minute(_another_family(other, self._settings.detector.dictionary))
        for marker_id in new:
            self._ids.publish(Int32(data=marker_id))
        self._detections.publish(detections_to_ros(message.header, sightings))
        self._poses.publish(poses_to_ros(message.header, sightings))
        if self._transforms is not None:
            transforms = transforms_to_ros(message.header, sightings)
            self._transforms.publish(TFMessage(transforms=transforms))
        if self._annotated.get_subscription_count():
            drawn = annotated(image, (s.detection for s in sightings), self._watch.confirmed)
            self._annotated.publish(image_to_ros(drawn, message.header))

    def _camera_of(self, width: int, height: int) -> CameraModel | None:
        """Return the camera that took an image of this size; None when it is not known."""
        if self._undescribed:
            field_of_view = math.radians(self._options.field_of_view)
            return CameraModel.from_field_of_view(width, height, field_of_view)
        if self._described is None:
            return None
        camera = self._described.scaled_to(width, height)
        if camera is None:
            size = f'{self._described.width}x{self._described.height}'
            self._warn_once_a_minute(
                f'images have {width}x{height} pixels, camera_info {size}: ids without poses'
            )
        return camera

    def _report(self) -> None:
        """Note how the stream of images was in the last period."""
        statistics, health = self._watch.take_statistics(), self.health
        in_motion, self._skipped_before = self.skipped - self._skipped_before, self.skipped
        if statistics.is_silent(in_motion):
            health.warn('images', 'no images')
        elif not statistics.refused:
            health.clear('images')
        odd = [finding for each in self._stamps if (finding := each.finding()) is not None]
        if odd:
            health.warn('stamps', '; '.join(odd))
        else:
            health.clear('stamps')
        if self._watch.other_family is not None:
            ours = self._settings.detector.dictionary
            health.warn('dictionary', _another_family(self._watch.other_family, ours))
        else:
            health.clear('dictionary')
        health.figure('images', statistics.images)
        health.figure('refused', statistics.refused)
        health.figure('candidates_left_out', statistics.left_out)
        health.figure('ms_per_image', f'{statistics.mean_milliseconds:.1f}')
        health.figure('dropped_in_all', self._images.dropped)
        health.figure('taken_in_motion_in_all', self.skipped)
        health.figure('confirmed_ids', ' '.join(map(str, sorted(self._watch.confirmed))))


def _another_family(theirs: str, ours: str) -> str:
    return f'no marker of {ours} is seen, and several that look like {theirs} (marker_dictionary)'


def main(args: Sequence[str] | None = None) -> int:
    """Run the node."""
    return run_node(ArucoDetector, args)


if __name__ == '__main__':
    raise SystemExit(main())
