"""Messages from what the simulation computes, and the other way round. No node, no clock."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import cv2
import numpy as np
import numpy.typing as npt
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image, JointState, LaserScan
from std_msgs.msg import Header

from floor_plans import Marker
from floor_plans.shapes import Pose as PlanePose
from marker_detection.rotations import quaternion_of
from surveillance_interfaces.msg import DoorStates
from surveillance_interfaces.srv import SetMarker
from surveillance_runtime.conversions import (
    planar_covariance,
    pose_estimate,
    pose_message,
)
from surveillance_runtime.profile.description import FixedFrame
from surveillance_simulation.camera.model import Camera, Picture
from surveillance_simulation.robot.lidar import LidarModel
from surveillance_simulation.world.simulated_place import SimulatedPlace


def time_to_ros(seconds: float) -> Time:
    """Convert seconds since the clock's start to a time message."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)


def stamped_pose_to_ros(pose: PlanePose, frame: str, stamp: Time) -> PoseStamped:
    """Convert a pose in the plane to a stamped pose message."""
    return PoseStamped(header=Header(frame_id=frame, stamp=stamp), pose=pose_message(pose))


def uncertain_pose_to_ros(
    pose: PlanePose, frame: str, stamp: Time, deviation: float, turn_deviation: float
) -> PoseWithCovarianceStamped:
    """Convert a pose in the plane and its standard deviations (metres, rad) to a message."""
    estimate = pose_estimate(pose, deviation, turn_deviation)
    return PoseWithCovarianceStamped(header=Header(frame_id=frame, stamp=stamp), pose=estimate)


def odometry_message(frame: str, child: str) -> Odometry:
    """Return a message of odometry with its frames and covariances; see `set_odometry`."""
    message = Odometry(header=Header(frame_id=frame), child_frame_id=child)
    message.pose.covariance = message.twist.covariance = planar_covariance(0.02, 0.02)
    return message


def set_odometry(
    message: Odometry, pose: PlanePose, speed: float, turn_speed: float, stamp: Time
) -> None:
    """Put odometry (metres, rad, m/s, rad/s) into a message."""
    message.header.stamp = stamp
    message.pose.pose = pose_message(pose)
    message.twist.twist.linear.x = float(speed)
    message.twist.twist.angular.z = float(turn_speed)


def transform_to_ros(pose: PlanePose, frame: str, child: str, stamp: Time) -> TransformStamped:
    """Convert the pose of a frame in another one to a transform message."""
    message = TransformStamped(header=Header(frame_id=frame, stamp=stamp), child_frame_id=child)
    message.transform.translation.x, message.transform.translation.y = pose[0], pose[1]
    message.transform.rotation = pose_message(pose).orientation
    return message


def matrix_to_ros(matrix: npt.NDArray[np.float64], frame: str, child: str) -> TransformStamped:
    """Convert a frame in another one, shape (4, 4), metres, to a transform message."""
    message = TransformStamped(header=Header(frame_id=frame), child_frame_id=child)
    moved = message.transform.translation
    moved.x, moved.y, moved.z = (float(each) for each in matrix[:3, 3])
    rotation = message.transform.rotation
    rotation.x, rotation.y, rotation.z, rotation.w = quaternion_of(matrix[:3, :3])
    return message


def fixed_frame_to_ros(frame: FixedFrame, stamp: Time) -> TransformStamped:
    """Convert a frame that does not move to a transform message."""
    matrix = np.eye(4)
    about_x, about_y, about_z = (cv2.Rodrigues(turn)[0] for turn in np.diag(frame.rpy))
    matrix[:3, :3] = about_z @ about_y @ about_x
    matrix[:3, 3] = frame.xyz
    message = matrix_to_ros(matrix, frame.parent, frame.name)
    message.header.stamp = stamp
    return message


def scan_to_ros(
    ranges: npt.NDArray[np.floating],
    lidar: LidarModel,
    frame: str,
    stamp: Time,
    duration: float = 0.0,
    *,
    upside_down: bool = False,
) -> LaserScan:
    """Convert distances (rays,) in metres to a message.

    Args:
        ranges: The distances.
        lidar: What measured them.
        frame: Where that sits.
        stamp: The time of the first ray.
        duration: From the first ray to the first of the next turn, seconds.
        upside_down: Whether the lidar hangs: in its own frame it turns the other way round.
    """
    increment = 2.0 * math.pi / lidar.rays
    way = -1.0 if upside_down else 1.0
    message = LaserScan(
        header=Header(frame_id=frame, stamp=stamp),
        angle_min=way * -math.pi,
        angle_max=way * (math.pi - increment),
        angle_increment=way * increment,
        range_min=lidar.range_min,
        range_max=lidar.range_max,
        time_increment=duration / lidar.rays,
        scan_time=duration,
    )
    message.ranges.frombytes(ranges.astype(np.float32).tobytes())
    return message


def joints_to_ros(
    names: Sequence[str], positions: Iterable[float], velocities: Iterable[float], stamp: Time
) -> JointState:
    """Convert joint positions (rad) and velocities (rad/s) to a message."""
    return JointState(
        header=Header(stamp=stamp),
        name=list(names),
        position=[float(each) for each in positions],
        velocity=[float(each) for each in velocities],
    )


def image_to_ros(picture: Picture, frame: str, stamp: Time) -> Image:
    """Convert an RGB picture (rows, columns, 3) to a message."""
    rows, columns, channels = picture.shape
    message = Image(
        header=Header(frame_id=frame, stamp=stamp),
        height=rows,
        width=columns,
        encoding='rgb8',
        step=columns * channels,
    )
    message.data.frombytes(np.ascontiguousarray(picture).tobytes())
    return message


def camera_info_to_ros(camera: Camera, frame: str, stamp: Time) -> CameraInfo:
    """Convert a camera without distortion to a message."""
    matrix = camera.matrix
    return CameraInfo(
        header=Header(frame_id=frame, stamp=stamp),
        height=camera.height,
        width=camera.width,
        distortion_model='plumb_bob',
        d=[0.0] * 5,
        k=matrix.ravel().tolist(),
        r=np.eye(3).ravel().tolist(),
        p=np.hstack([matrix, np.zeros((3, 1))]).ravel().tolist(),
    )


def doors_to_ros(world: SimulatedPlace) -> DoorStates:
    """Convert the doors of a world to a message."""
    closed = world.closed_doors
    return DoorStates(
        open=[name for name in world.plan.doors if name not in closed], closed=sorted(closed)
    )


def marker_from_ros(request: SetMarker.Request, size: float) -> Marker:
    """Convert the request to hang a marker; its side (metres) is that of the place's markers."""
    return Marker(request.name, int(request.id), request.x, request.y, request.z, request.yaw, size)
