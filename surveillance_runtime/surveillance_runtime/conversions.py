"""Conversions that several packages use: times, points, poses in the plane, maps, clouds, texts.

Poses and odometry come with every measurement, and rclpy makes eight nested objects and two
covariances of each, which nobody reads: ten times the work of reading the pose. A subscription with
`raw=True` hands the bytes over as they came, in plain CDR (OMG DDS-RTPS 2.5, 10.2): four bytes that
tell the byte order, then the fields in their order, each aligned to its own size.
`pose_of_serialized` and `stamp_of_serialized` read them.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Pose, PoseWithCovariance, Quaternion
from nav_msgs.msg import OccupancyGrid
from numpy.typing import NDArray
from sensor_msgs.msg import BatteryState, PointCloud2, PointField

from strict_files.one_line import without_controls
from surveillance_runtime.robot_arm import TrajectoryPoint

if TYPE_CHECKING:
    from trajectory_msgs.msg import JointTrajectory

    from floor_plans import Grid

PlanarPose = tuple[float, float, float]
"""x, y in metres and yaw in radians."""
FARTHEST = 2e7
"""A pose farther from the origin than this is none, metres: northings of UTM go up to 1e7."""
_BYTE_ORDERS = {b'\0\0': '>', b'\0\1': '<'}
_HEAD = 4
"""Bytes before the first field."""


def clean_texts(message: Any) -> None:
    """Write the control characters in all texts of a message as escapes, but for line breaks.

    Whoever shows the message on a terminal then passes no command of a peer on to it.
    """
    for name in _fields_to_clean(message.__class__):
        value = getattr(message, name)
        if isinstance(value, str):
            setattr(message, name, without_controls(value))
        elif not isinstance(value, list):
            clean_texts(value)
        elif value and isinstance(value[0], str):
            setattr(message, name, [without_controls(each) for each in value])
        else:
            for each in value:
                clean_texts(each)


@cache
def _fields_to_clean(kind: Any) -> tuple[str, ...]:
    """Return the fields of a message's class that are texts, or messages that may hold some."""
    fields = kind.get_fields_and_field_types()
    return tuple(name for name, written in fields.items() if 'string' in written or '/' in written)


def seconds_of(stamp: Time | Duration) -> float:
    """Return a stamp as seconds since the clock's start, or a duration in seconds."""
    return float(stamp.sec + stamp.nanosec / 1e9)


def nanoseconds_of(stamp: Time) -> int:
    """Return a stamp as whole nanoseconds since the clock's start."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def stamp_from(nanoseconds: int) -> Time:
    """Return the stamp of whole nanoseconds since the clock's start."""
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def point_message(coordinates: Sequence[float] | NDArray[np.float64]) -> Point:
    """Return a point from x, y and perhaps z, metres."""
    x, y, z = (*(float(each) for each in coordinates), 0.0)[:3]
    return Point(x=x, y=y, z=z)


def point_messages(
    points: Iterable[Sequence[float] | NDArray[np.float64]] | NDArray[np.float64],
) -> list[Point]:
    """Return points, or the rows of an array of shape (n, 2) or (n, 3), as messages."""
    return [point_message(point) for point in points]


def point_from(message: Point) -> tuple[float, float, float]:
    """Return a point, metres."""
    return message.x, message.y, message.z


def pose_from(message: Pose) -> PlanarPose:
    """Return a pose in the plane.

    Raises:
        ValueError: A coordinate is not finite, or too large to be one.
    """
    at, q = message.position, message.orientation
    return planar_pose(at.x, at.y, (q.x, q.y, q.z, q.w))


def planar_pose(x: float, y: float, turn: Sequence[float]) -> PlanarPose:
    """Return the pose in the plane at a point, turned by a quaternion (x, y, z, w).

    Raises:
        ValueError: As `pose_from`.
    """
    if not all(map(math.isfinite, (x, y, *turn))):
        raise ValueError('a pose with a coordinate that is not finite: expected finite numbers')
    if max(abs(x), abs(y)) > FARTHEST:
        raise ValueError(
            f'a pose at ({x:g}, {y:g}) m: expected at most {FARTHEST:g} m from the origin'
        )
    size = math.hypot(*turn) or 1.0  # Who leaves the turn out means none.
    qx, qy, qz, qw = (each / size for each in turn)
    # Yaw of a quaternion in Z-Y-X order; exact for any tilt that is not straight up.
    return x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))


def stamp_of_serialized(data: bytes) -> float:
    """Return the stamp of a message that begins with a header, seconds.

    Raises:
        ValueError: It is no such message.
    """
    seconds, nanoseconds = _read(data, 'iI', _HEAD)
    return float(seconds + nanoseconds / 1e9)


def pose_of_serialized(data: bytes, texts: int = 0) -> PlanarPose:
    """Return the pose in the plane of a stamped message.

    Args:
        data: The message: a header, texts, then a pose, with whatever follows.
        texts: How many texts there are between; 0 in PoseWithCovarianceStamped, 1 in Odometry.

    Raises:
        ValueError: It is no such message, or not a pose; see `pose_from`.
    """
    at = _HEAD + 8
    for _ in range(1 + texts):
        at += -at % 4
        at += 4 + int(_read(data, 'I', at)[0])
    x, y, _z, *turn = _read(data, '7d', at + (_HEAD - at) % 8)
    return planar_pose(x, y, turn)


def frames_of_serialized(data: bytes, texts: int = 0) -> bytes:
    """Return the part of a stamped message that names its frame and the texts behind it, as it is.

    Args:
        data: The message, as `pose_of_serialized` takes it.
        texts: How many texts there are behind the header.

    Raises:
        ValueError: It is no such message.
    """
    at = begin = _HEAD + 8
    for _ in range(1 + texts):
        at += -at % 4
        at += 4 + int(_read(data, 'I', at)[0])
    return bytes(data[begin:at])


def turn_rate_of_serialized(data: bytes) -> float:
    """Return what a sensor_msgs/Imu says of the turn about its z axis, rad/s.

    Raises:
        ValueError: It is no such message, or says nothing of it (a covariance of -1).
    """
    at = _HEAD + 8
    at += 4 + int(_read(data, 'I', at)[0])
    at += (_HEAD - at) % 8
    # Behind an orientation and its covariance.
    *_, rate, unknown = _read(data, '17d', at)
    if unknown == -1.0 or not math.isfinite(rate):
        raise ValueError('a turn rate that is not known: expected rad/s about z')
    return rate


def _read(data: bytes, fields: str, at: int) -> tuple[float, ...]:
    order = _BYTE_ORDERS.get(bytes(data[:2]))
    if order is None:
        raise ValueError(f'a message serialized as {data[:2].hex()}: expected plain CDR')
    try:
        return struct.unpack_from(order + fields, data, at)
    except struct.error:
        raise ValueError(f'a message of {len(data)} bytes: expected a longer one') from None


def pose_message(pose: PlanarPose) -> Pose:
    """Return a pose in the plane as a message."""
    turn = Quaternion(z=math.sin(pose[2] / 2), w=math.cos(pose[2] / 2))
    return Pose(position=point_message(pose[:2]), orientation=turn)


def pose_estimate(pose: PlanarPose, deviation: float, turn_deviation: float) -> PoseWithCovariance:
    """Return a pose in the plane with its standard deviations, metres and rad."""
    covariance = planar_covariance(deviation, turn_deviation)
    return PoseWithCovariance(pose=pose_message(pose), covariance=covariance)


@cache
def planar_covariance(deviation: float, turn_deviation: float) -> NDArray[np.float64]:
    """Return the covariance of a pose or a velocity in the plane, shape (36,)."""
    covariance = np.zeros(36)
    covariance[[0, 7]] = deviation**2
    covariance[35] = turn_deviation**2
    return covariance


def map_message(grid: Grid, frame: str, stamp: Time) -> OccupancyGrid:
    """Return the message of a map; see `map_from`."""
    message = OccupancyGrid()
    message.header.frame_id, message.header.stamp = frame, stamp
    message.info.map_load_time = stamp
    message.info.resolution = float(grid.resolution)
    message.info.height, message.info.width = grid.cells.shape
    message.info.origin = pose_message((*grid.origin, 0.0))
    message.data.frombytes(grid.cells.tobytes())
    return message


def map_from(message: OccupancyGrid, most_cells: int) -> Grid:
    """Return a map.

    Args:
        message: The map.
        most_cells: A larger one is refused.

    Raises:
        ValueError: It has no cells, not as many as it says, or too many.
    """
    # Only here: most processes never see a map.
    from floor_plans import Grid

    info = message.info
    size = f'{info.width} x {info.height}'
    if info.width * info.height > most_cells:
        raise ValueError(f'a map of {size} cells: expected at most {most_cells}')
    cells = np.array(message.data, dtype=np.int8)
    if cells.size != info.width * info.height:
        raise ValueError(f'a map of {cells.size} cells: expected {size} of them')
    if not cells.size:
        raise ValueError(f'a map of {size} cells: expected at least one')
    if not 1e-4 <= info.resolution <= 100.0:
        raise ValueError(
            f'a map of {info.resolution:g} m a cell: expected between 0.0001 and 100 m'
        )
    x, y, yaw = pose_from(info.origin)
    cells, side = cells.reshape(info.height, info.width), float(info.resolution)
    if abs(yaw) > 1e-6:
        return _straightened(cells, side, (x, y, yaw), most_cells)
    return Grid(cells, side, (x, y))


def _straightened(
    cells: NDArray[np.int8], side: float, origin: PlanarPose, most_cells: int
) -> Grid:
    """Return a map whose cells are turned, drawn with cells that are not; beside it is unknown.

    The new cells are smaller, so that no wall gets a gap.
    """
    from floor_plans import Grid

    x, y, yaw = origin
    cos, sin = math.cos(yaw), math.sin(yaw)
    rows, columns = cells.shape
    corners = side * np.array([(0, 0), (columns, 0), (0, rows), (columns, rows)])
    seen = corners @ np.array([(cos, sin), (-sin, cos)])
    west, south = seen.min(axis=0)
    drawn_side = side / math.sqrt(2.0)
    width, height = np.ceil((seen.max(axis=0) - (west, south)) / drawn_side - 1e-6).astype(int)
    if width * height > most_cells:
        raise ValueError(f'a turned map of {width} x {height} cells: expected {most_cells} at most')
    drawn = np.full((height, width), -1, np.int8)
    right = west + (np.arange(width) + 0.5) * drawn_side
    for row in range(height):
        up = south + (row + 0.5) * drawn_side
        column = np.floor((cos * right + sin * up) / side).astype(int)
        line = np.floor((cos * up - sin * right) / side).astype(int)
        inside = (column >= 0) & (column < columns) & (line >= 0) & (line < rows)
        drawn[row, inside] = cells[line[inside], column[inside]]
    return Grid(drawn, drawn_side, (x + west, y + south))


MOST_JOINTS = 100
"""Joints of an arm at most."""


def trajectory_from(message: JointTrajectory) -> tuple[list[str], list[TrajectoryPoint]]:
    """Return a trajectory's joint names and points.

    Raises:
        ValueError: There are more joints than an arm has, or more values than joints.
    """
    joints = len(message.joint_names)
    if joints > MOST_JOINTS:
        raise ValueError(f'trajectory of {joints} joints: expected at most {MOST_JOINTS}')
    for point in message.points:
        if max(len(point.positions), len(point.velocities)) > joints:
            raise ValueError(f'trajectory: a point has more values than its {joints} joints')
    points = [
        TrajectoryPoint(
            seconds_of(point.time_from_start), tuple(point.positions), tuple(point.velocities)
        )
        for point in message.points
    ]
    return list(message.joint_names), points


_FLOATS = {PointField.FLOAT32: 'f4', PointField.FLOAT64: 'f8'}


def cloud_from_points(
    points: NDArray[np.float64],
    frame: str = 'map',
    **values: NDArray[np.float64] | NDArray[np.bool_],
) -> PointCloud2:
    """Return points as a cloud in the map's frame; the caller stamps it.

    Args:
        points: Shape (n, 2), metres.
        frame: The name of the map's frame.
        values: Further fields by name, each of shape (n,).
    """
    message = PointCloud2()
    message.header.frame_id = frame
    message.height, message.width = 1, len(points)
    # What a float of 32 bits leaves of a coordinate is up to 1 m in UTM.
    near = points.astype(np.float32)
    values = {'x_rest': points[:, 0] - near[:, 0], 'y_rest': points[:, 1] - near[:, 1], **values}
    names = ('x', 'y', 'z', *values)
    message.fields = [
        PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate(names)
    ]
    message.point_step, message.row_step = 4 * len(names), 4 * len(names) * len(points)
    message.is_dense = True
    heights = np.zeros(len(points))
    message.data.frombytes(
        np.column_stack([near, heights, *values.values()]).astype('<f4').tobytes()
    )
    return message


def points_from_cloud(message: PointCloud2) -> NDArray[np.float64]:
    """Return the x and y of a cloud's points, shape (n, 2), metres.

    Raises:
        ValueError: The cloud has no x and y.
    """
    x, y = (values_from_cloud(message, name) for name in 'xy')
    if x is None or y is None:
        raise ValueError('a cloud without x and y: expected fields of type FLOAT32 or FLOAT64')
    points = np.stack([x, y], axis=1)
    for column, name in enumerate(('x_rest', 'y_rest')):
        rest = values_from_cloud(message, name)
        points[:, column] += 0.0 if rest is None else rest
    return points


def values_from_cloud(message: PointCloud2, name: str) -> NDArray[np.float64] | None:
    """Return one field of a cloud's points, shape (n,); None: it has no such field of floats.

    Raises:
        ValueError: The cloud is not as long as it says.
    """
    for field in message.fields:
        if field.name == name and field.datatype in _FLOATS:
            kind = np.dtype(
                {
                    'names': [name],
                    'formats': ['<>'[message.is_bigendian] + _FLOATS[field.datatype]],
                    'offsets': [field.offset],
                    'itemsize': message.point_step,
                }
            )
            count = message.width * message.height
            points = np.frombuffer(bytes(message.data), dtype=kind, count=count)
            return np.asarray(points[name], dtype=np.float64)
    return None


def charging_from(message: BatteryState) -> bool | None:
    """Tell whether a battery is being charged, or is full at its charger; None: it does not say."""
    status = message.power_supply_status
    if status in (
        BatteryState.POWER_SUPPLY_STATUS_CHARGING,
        BatteryState.POWER_SUPPLY_STATUS_FULL,
    ):
        return True
    return None if status == BatteryState.POWER_SUPPLY_STATUS_UNKNOWN else False
