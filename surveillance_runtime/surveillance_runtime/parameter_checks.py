"""What lists and texts have to hold to be a parameter: for nodes, and for who reads their files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from urllib.parse import urlsplit

MOST_TILT = 0.1
"""A lidar that is tilted by more than this does not look along the floor, rad."""


def pose(values: Sequence[float]) -> str | None:
    """Ask for a place and a direction."""
    return None if len(values) == 3 else 'three numbers: x, y, yaw'


def pose_or_none(values: Sequence[float]) -> str | None:
    """Ask for a place and a direction, if for anything."""
    return None if len(values) in (0, 3) else 'three numbers: x, y, yaw; or none'


def lidar_mounts(values: Sequence[float]) -> str | None:
    """Ask for where each lidar sits on the robot, if for anything; it stands or hangs."""
    good = len(values) % 4 == 0 and all(
        abs(math.sin(roll)) <= MOST_TILT and abs(roll) <= 3.3 for roll in values[3::4]
    )
    return (
        None
        if good
        else 'x, y, yaw and roll of each lidar; roll 0, or 3.1416 for one that hangs upside down'
    )


def times(values: Sequence[float]) -> str | None:
    """Ask for a shortest and a longest time."""
    good = len(values) == 2 and 0 < values[0] <= values[1]
    return None if good else 'two numbers above 0, the shortest and the longest time'


def rectangle(values: Sequence[float]) -> str | None:
    """Ask for the sides of an upright rectangle."""
    good = len(values) == 4 and values[0] < values[1] and values[2] < values[3]
    return None if good else 'four numbers [x_min, x_max, y_min, y_max], each pair rising'


def web_origin(text: str) -> str | None:
    """Ask for an origin as browsers write it (RFC 6454), if for anything."""
    wanted = text.rstrip('/')
    try:
        parts = urlsplit(wanted)
        whole = f'{parts.scheme}://{parts.netloc}' == wanted and parts.username is None
        good = whole and parts.scheme in ('http', 'https') and bool(parts.hostname)
        good = good and parts.port != 0
    except ValueError:  # of the port, or of brackets that are not closed
        good = False
    return None if good or not wanted else 'an origin like https://robot.example.org'
