"""Reads what a node needs of a message that is still serialized.

Poses and odometry come with every measurement, and rclpy makes eight nested objects and two
covariances of each, which nobody reads: ten times the work of reading the pose. A subscription with
`raw=True` hands the bytes over as they came, in plain CDR (OMG DDS-RTPS 2.5, 10.2): four bytes that
tell the byte order, then the fields in their order, each aligned to its own size.
"""

from __future__ import annotations

import struct

from surveillance_runtime.conversions import PlanarPose, planar_pose

_BYTE_ORDERS = {b'\0\0': '>', b'\0\1': '<'}
_HEAD = 4
"""Bytes before the first field."""


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
        ValueError: It is no such message, or not a pose; see `conversions.pose_from`.
    """
    at = _HEAD + 8
    for _ in range(1 + texts):
        at += -at % 4
        at += 4 + int(_read(data, 'I', at)[0])
    x, y, _z, *turn = _read(data, '7d', at + (_HEAD - at) % 8)
    return planar_pose(x, y, turn)


def _read(data: bytes, fields: str, at: int) -> tuple[float, ...]:
    order = _BYTE_ORDERS.get(bytes(data[:2]))
    if order is None:
        raise ValueError(f'a message serialized as {data[:2].hex()}: expected plain CDR')
    try:
        return struct.unpack_from(order + fields, data, at)
    except struct.error:
        raise ValueError(f'a message of {len(data)} bytes: expected a longer one') from None
