"""Conversions of messages that several packages use: time stamps, points in the plane, texts."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from builtin_interfaces.msg import Duration, Time
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField

from surveillance_runtime.logging import without_controls


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


def cloud_from_points(
    points: NDArray[np.float64], **values: NDArray[np.float64] | NDArray[np.bool_]
) -> PointCloud2:
    """Return points as a cloud in the map's frame; the caller stamps it.

    Args:
        points: Shape (n, 2), metres.
        values: Further fields by name, each of shape (n,).
    """
    message = PointCloud2()
    message.header.frame_id = 'map'
    message.height, message.width = 1, len(points)
    names = ('x', 'y', 'z', *values)
    message.fields = [
        PointField(name=name, offset=4 * index, datatype=PointField.FLOAT32, count=1)
        for index, name in enumerate(names)
    ]
    message.point_step, message.row_step = 4 * len(names), 4 * len(names) * len(points)
    message.is_dense = True
    heights = np.zeros(len(points))
    message.data.frombytes(
        np.column_stack([points, heights, *values.values()]).astype('<f4').tobytes()
    )
    return message


def points_from_cloud(message: PointCloud2) -> NDArray[np.float64]:
    """Return the x and y of a cloud's points, shape (n, 2), metres.

    Raises:
        ValueError: The cloud has no x and y of 32 bits.
    """
    x, y = (values_from_cloud(message, name) for name in 'xy')
    if x is None or y is None:
        raise ValueError('a cloud without x and y: expected fields of type FLOAT32')
    return np.stack([x, y], axis=1)


def values_from_cloud(message: PointCloud2, name: str) -> NDArray[np.float64] | None:
    """Return one field of a cloud's points, shape (n,); None: it has no such field of 32 bits.

    Raises:
        ValueError: The cloud is not as long as it says.
    """
    for field in message.fields:
        if field.name == name and field.datatype == PointField.FLOAT32:
            kind = np.dtype(
                {
                    'names': [name],
                    'formats': ['>f4' if message.is_bigendian else '<f4'],
                    'offsets': [field.offset],
                    'itemsize': message.point_step,
                }
            )
            count = message.width * message.height
            points = np.frombuffer(bytes(message.data), dtype=kind, count=count)
            return np.asarray(points[name], dtype=np.float64)
    return None
