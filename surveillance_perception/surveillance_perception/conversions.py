"""Between ROS messages and the core's types."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseArray,
    PoseWithCovarianceStamped,
    Quaternion,
    TransformStamped,
    Vector3,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from indoor_watch.hung_markers import SeenMarker
from marker_detection import MarkerPose
from marker_detection.camera_model import DISTORTION_MODELS, Array, CameraModel
from marker_detection.fusion import FusedPosition, FusedPositions, is_measured
from marker_detection.rotations import rotation_of
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.msg import MarkerDetection, MarkerDetectionArray, RoomConnection
from surveillance_interfaces.srv import RoomInformation
from surveillance_perception.arm.scan import ScanOutcome, ScanPlan, View
from surveillance_perception.arm.trajectory import ArmTrajectory
from surveillance_perception.marker_registry import MarkedPlace
from surveillance_perception.observing.camera_tracker import matrix_of
from surveillance_perception.stream.encodings import image_of_pixels, printable
from surveillance_perception.stream.image_files import ImageArray, decode_image
from surveillance_runtime.conversions import pose_from

if TYPE_CHECKING:  # the detector behind it takes 0.2 s to import: one node needs it
    from marker_detection import Sighting


def image_from_ros(message: Image, max_pixels: int) -> ImageArray:
    """Return a grey (height, width) or BGR (height, width, 3) image from an Image.

    Args:
        message: sensor_msgs/Image.
        max_pixels: The largest image that is taken.

    Raises:
        ImageError: The image is empty, too large, shorter than its size says, or in an encoding
            that `stream.encodings` does not know.
    """
    return image_of_pixels(
        message.encoding,
        message.width,
        message.height,
        message.step,
        message.data,
        big_endian=bool(message.is_bigendian),
        max_pixels=max_pixels,
    )


def image_from_compressed(message: CompressedImage, max_pixels: int) -> ImageArray:
    """Return a BGR image (height, width, 3) from a CompressedImage.

    As the sensor has it, whatever EXIF says: its CameraInfo describes that one (cv_bridge does the
    same).

    Raises:
        ImageError: The data is no image, or the image is larger than `max_pixels`.
    """
    return decode_image(bytes(message.data), 'compressed image', max_pixels, upright=False)


def image_from_any(message: Image | CompressedImage, max_pixels: int) -> ImageArray:
    """Return an image from either kind of message; otherwise as the two above."""
    if isinstance(message, Image):
        return image_from_ros(message, max_pixels)
    return image_from_compressed(message, max_pixels)


def image_to_ros(image: npt.NDArray[np.uint8], header: Header) -> Image:
    """Return an Image (mono8 or bgr8) of a grey or BGR image."""
    height, width = image.shape[:2]
    message = Image(header=header, height=height, width=width)
    message.encoding = 'mono8' if image.ndim == 2 else 'bgr8'
    message.step = width * (1 if image.ndim == 2 else 3)
    # rclpy takes an array.array without looking at each byte
    message.data.frombytes(np.ascontiguousarray(image).tobytes())
    return message


def camera_from_ros(message: CameraInfo) -> CameraModel:
    """Return the camera that a CameraInfo describes, as its images come: binned, and cut to its
    region.

    Raises:
        ValueError: It describes no calibrated camera, or one of a distortion model that is not
            among `DISTORTION_MODELS`.
    """
    matrix = np.array(message.k, dtype=float).reshape(3, 3)
    across, down = max(1, message.binning_x), max(1, message.binning_y)
    region = message.roi
    width, height = region.width or message.width, region.height or message.height
    matrix[:2, 2] -= (region.x_offset, region.y_offset)
    matrix[0] /= across
    matrix[1] /= down
    model = message.distortion_model or 'plumb_bob'
    if model not in DISTORTION_MODELS:
        raise ValueError(
            f'distortion model {printable(model)}, expected one of {", ".join(DISTORTION_MODELS)}'
        )
    distortion = np.array(message.d, dtype=float)
    return CameraModel(width // across, height // down, matrix, distortion, model)


def camera_to_ros(camera: CameraModel, header: Header) -> CameraInfo:
    """Return a CameraInfo of a camera whose image is not rectified further."""
    message = CameraInfo(header=header, width=camera.width, height=camera.height)
    message.distortion_model = camera.distortion_model
    message.d = camera.distortion.tolist()
    message.k = camera.matrix.ravel().tolist()
    message.r = np.eye(3).ravel().tolist()
    message.p = np.hstack([camera.matrix, np.zeros((3, 1))]).ravel().tolist()
    return message


def detection_to_ros(sighting: Sighting) -> MarkerDetection:
    """Return a MarkerDetection; without a pose its position is not a number."""
    detection, pose = sighting.detection, sighting.pose
    message = MarkerDetection(
        id=detection.marker_id,
        known=detection.known,
        confirmed=sighting.confirmed,
        size=sighting.size,
    )
    message.confidence = detection.confidence
    message.corners = detection.corners.ravel().astype(float)
    if pose is None:
        nothing = float('nan')
        message.pose.position = Point(x=nothing, y=nothing, z=nothing)
        message.reprojection_error = nothing
    else:
        message.pose = pose_to_ros(pose)
        message.reprojection_error = pose.reprojection_error
        message.pose_covariance = pose.covariance.ravel()
        message.pose_ambiguity = pose.ambiguity
    return message


def detections_to_ros(header: Header, sightings: Iterable[Sighting]) -> MarkerDetectionArray:
    """Return all markers of one image."""
    return MarkerDetectionArray(header=header, detections=[*map(detection_to_ros, sightings)])


def fuse_views(
    fused: FusedPositions,
    message: MarkerDetectionArray,
    camera: Array,
    doubt: tuple[float, float] | None = None,
) -> list[int]:
    """Take the confirmed markers of an image into their fused positions.

    Args:
        fused: Takes the views.
        message: What `aruco_detector` saw.
        camera: Transform (4, 4) from the camera's optical frame to the fixed frame.
        doubt: Standard deviations of the camera's own place, metres, and direction, rad; None:
            they are those of an arm on a base that stands.

    Returns:
        The ids whose view counts.
    """
    taken = []
    fused.next_image()
    for each in message.detections:
        place = each.pose.position
        covariance = np.array(each.pose_covariance).reshape(6, 6)[:3, :3]
        position = np.array([place.x, place.y, place.z])
        # a covariance of zeros means: unknown
        if not each.confirmed or not covariance.any():
            continue
        carrier = None
        if doubt is not None:
            away = float(np.linalg.norm(position))
            carrier = np.eye(3) * (doubt[0] ** 2 + (doubt[1] * away) ** 2)
        if fused.add(each.id, camera, position, covariance, each.pose_ambiguity, carrier):
            taken.append(each.id)
    return taken


def fused_to_ros(marker_id: int, fused: FusedPosition) -> MarkerDetection:
    """Return a fused position as a MarkerDetection, in a fixed frame."""
    message = MarkerDetection(id=marker_id, confirmed=True, confidence=1.0)
    x, y, z = fused.position.tolist()
    message.pose.position = Point(x=x, y=y, z=z)
    covariance = np.zeros((6, 6))
    covariance[:3, :3] = fused.covariance
    message.pose_covariance = covariance.ravel()
    return message


def fused_from_ros(message: MarkerDetection) -> FusedPosition | None:
    """Return the fused position in a MarkerDetection; None when its numbers are none."""
    place = message.pose.position
    position = np.array([place.x, place.y, place.z])
    covariance = np.array(message.pose_covariance).reshape(6, 6)[:3, :3]
    return FusedPosition(position, covariance, 1) if is_measured(position, covariance) else None


def seen_marker_from_ros(message: MarkerDetection) -> SeenMarker:
    """Return a marker of a picture; without a position where its numbers are no measurement."""
    place, turn = message.pose.position, message.pose.orientation
    position = np.array([place.x, place.y, place.z])
    covariance = np.array(message.pose_covariance).reshape(6, 6)[:3, :3]
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    length, side = float(np.linalg.norm(quaternion)), float(message.size)
    measured = is_measured(position, covariance) and math.isfinite(length) and length > 0.5
    if not measured or not (math.isfinite(side) and side > 0.0):
        return SeenMarker(int(message.id))
    rotation = rotation_of(quaternion / length)
    return SeenMarker(int(message.id), side, position, rotation, covariance)


def poses_to_ros(header: Header, sightings: Iterable[Sighting]) -> PoseArray:
    """Return the poses of those markers of an image that are confirmed."""
    poses = [pose_to_ros(each.pose) for each in sightings if each.pose and each.confirmed]
    return PoseArray(header=header, poses=poses)


def transforms_to_ros(header: Header, sightings: Iterable[Sighting]) -> list[TransformStamped]:
    """Return the poses of an image's confirmed markers as frames `marker_ID` of the camera's
    frame.
    """
    transforms = []
    for each in sightings:
        if each.pose is None or not each.confirmed:
            continue
        pose = pose_to_ros(each.pose)
        place = pose.position
        transform = TransformStamped(
            header=header, child_frame_id=f'marker_{each.detection.marker_id}'
        )
        transform.transform.translation = Vector3(x=place.x, y=place.y, z=place.z)
        transform.transform.rotation = pose.orientation
        transforms.append(transform)
    return transforms


def scan_plan_from_ros(goal: ScanSurroundings.Goal, horizontal: float, vertical: float) -> ScanPlan:
    """Return what a goal asks a camera with these fields of view (rad) to look at.

    Raises:
        ValueError: An elevation or the overlap is out of range.
    """
    lowest, highest = goal.lowest, goal.highest
    if lowest == highest == 0.0:
        lowest, highest = -math.pi / 2, math.pi / 2
    return ScanPlan(horizontal, vertical, goal.overlap, lowest, highest)


def scan_feedback_to_ros(
    index: int, count: int, view: View, resting: bool
) -> ScanSurroundings.Feedback:
    """Return where a scan is."""
    return ScanSurroundings.Feedback(
        view=index + 1,
        views=count,
        azimuth=view.azimuth,
        elevation=view.elevation,
        resting=resting,
    )


def scan_result_to_ros(outcome: ScanOutcome) -> ScanSurroundings.Result:
    """Return what came of a scan."""
    return ScanSurroundings.Result(
        views=outcome.rested,
        unreachable=outcome.unreachable,
        coverage=outcome.covered,
        message=outcome.failure,
    )


def pose_to_ros(pose: MarkerPose) -> Pose:
    """Return a Pose message."""
    x, y, z = pose.position.tolist()
    qx, qy, qz, qw = pose.quaternion
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def base_pose_from_ros(message: Odometry) -> npt.NDArray[np.float64]:
    """Transform (4, 4) from base_link to the frame of the odometry.

    Raises:
        ValueError: A number is not finite, or the orientation is zero.
    """
    position, orientation = message.pose.pose.position, message.pose.pose.orientation
    turn = np.array([orientation.x, orientation.y, orientation.z, orientation.w])
    place = np.array([position.x, position.y, position.z])
    if not np.isfinite(place).all() or not np.isfinite(turn).all() or not turn.any():
        raise ValueError('odometry: position and orientation must be finite, the latter not zero')
    pose = np.eye(4)
    pose[:3, :3] = rotation_of(turn)
    pose[:3, 3] = place
    return pose


def pose_on_map(
    message: PoseWithCovarianceStamped,
) -> tuple[npt.NDArray[np.float64], tuple[float, float]]:
    """Return the transform (4, 4) from base_link to the map, and how sure that is.

    Returns:
        The transform, and what `doubt_from` says.

    Raises:
        ValueError: A number is not finite, or the orientation is zero.
    """
    return matrix_of(pose_from(message.pose.pose)), doubt_from(message)


def doubt_from(message: PoseWithCovarianceStamped) -> tuple[float, float]:
    """Return how sure who localises is.

    Returns:
        Standard deviations: metres, in the direction in which it is least sure (in a corridor,
        along it), and rad.

    Raises:
        ValueError: A number is not finite: it does not tell.
    """
    covariance = np.asarray(message.pose.covariance, float).reshape(6, 6)
    if not np.isfinite(covariance).all():
        raise ValueError('the covariance must be finite')
    along = float(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return math.sqrt(max(0.0, along)), math.sqrt(max(0.0, float(covariance[5, 5])))


def marked_place_to_ros(place: MarkedPlace, response: RoomInformation.Response) -> None:
    """Fill in the answer of `room_info`."""
    response.room = place.room
    response.x = place.x
    response.y = place.y
    response.connections = [
        RoomConnection(connected_to=behind, through_door=door)
        for door, behind in place.connections.items()
    ]


def trajectory_to_ros(trajectory: ArmTrajectory, names: tuple[str, ...]) -> JointTrajectory:
    """Return a JointTrajectory whose points run from now."""
    message = JointTrajectory(joint_names=list(names))
    for time, position, speed, acceleration in zip(
        trajectory.times,
        trajectory.positions,
        trajectory.speeds,
        trajectory.accelerations,
        strict=True,
    ):
        point = JointTrajectoryPoint(
            positions=position.tolist(),
            velocities=speed.tolist(),
            accelerations=acceleration.tolist(),
        )
        whole = int(time)
        point.time_from_start.sec = whole
        point.time_from_start.nanosec = int((time - whole) * 1e9)
        message.points.append(point)
    return message
