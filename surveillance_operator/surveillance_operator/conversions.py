"""From messages to what the views show; the only place of this package that knows both."""

from __future__ import annotations

import math

import numpy as np
from geometry_msgs.msg import Pose as PoseMessage
from nav_msgs.msg import OccupancyGrid

from surveillance_interfaces.msg import DoorStates, MissionStatus
from surveillance_operator.map_raster import Grid, Pose
from surveillance_operator.snapshot import Status
from surveillance_runtime.stamps import seconds_of


def status_from(message: MissionStatus) -> Status:
    """What the machine does, as it was published."""
    return Status(
        since=seconds_of(message.stamp),
        machine=message.machine,
        state=message.state,
        place=message.place,
        heading_to=message.heading_to,
        waiting_for_help=message.waiting_for_help,
        text=message.text,
        avoided=tuple(message.avoided),
    )


def doors_from(message: DoorStates) -> dict[str, bool]:
    """Whether each door is open, by name."""
    states = {**dict.fromkeys(message.open, True), **dict.fromkeys(message.closed, False)}
    return dict(sorted(states.items()))


def pose_from(message: PoseMessage) -> Pose:
    """x, y in metres and yaw in radians of a pose."""
    q = message.orientation
    yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
    return message.position.x, message.position.y, yaw


def grid_from(message: OccupancyGrid) -> Grid:
    """A map.

    Raises:
        ValueError: It has no cells, not as many as it says, or is turned.
    """
    info = message.info
    cells = np.array(message.data, dtype=np.int8)
    if not cells.size or cells.size != info.width * info.height or info.resolution <= 0:
        size = f'{info.width} x {info.height} of {info.resolution:g} m'
        raise ValueError(f'{cells.size} cells came where it says {size}')
    x, y, yaw = pose_from(info.origin)
    if abs(yaw) > 1e-6:
        raise ValueError(f'it is turned by {yaw:.3f} rad, which is not drawn')
    return Grid(cells.reshape(info.height, info.width), float(info.resolution), (x, y))
