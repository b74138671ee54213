"""What sensors publish, as the core computes with it; checked as it comes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from weakref import WeakKeyDictionary

import numpy as np
from geometry_msgs.msg import Transform
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import LaserScan

from lidar_navigation.geometry import Mount, Points, Scan

_refused: WeakKeyDictionary[Node, dict[str, str]] = WeakKeyDictionary()
"""Of each node: why the last message of a topic was refused."""

MOST_RAYS = 100_000
"""Rays of the largest scan that is taken."""


LONGEST_RANGE = 1000.0
"""No ray of a lidar goes farther, metres."""


LONGEST_SWEEP = 2.0
"""No lidar turns slower, seconds: what a scan says beyond that counts for nothing."""


LEAST_TOLD = 0.05
"""Share of a scan's rays that must tell something; below it the lidar is covered or broken."""


@contextmanager
def refusing(node: Node, topic: str) -> Iterator[None]:
    """Let messages that are not sound cost one line in the node's log, and nothing else.

    The same fault is told again after a sound message.
    """
    refused = _refused.setdefault(node, {})
    try:
        yield
    except ValueError as error:
        if refused.get(topic) != str(error):
            refused[topic] = str(error)
            node.get_logger().error(f'{topic}: {error}')
    else:
        refused.pop(topic, None)


def refusal(node: Node, topic: str) -> str:
    """Return why the last message of a topic was refused; empty where it was not."""
    return _refused.get(node, {}).get(topic, '')


_LEVEL = Mount()


def scan_from(
    message: LaserScan, mount: Mount = _LEVEL, radius: float = 0.0, sweep: float = 0.0
) -> Scan:
    """Return a turn of a lidar.

    Rays beyond its reach met nothing; those that are 0 or not a number tell nothing; those of minus
    infinity met something nearer than it can measure (REP 117), perhaps at the robot's edge. What
    is nearer than that, and within the robot, is the robot's own.

    Args:
        message: The scan; of a lidar that turns clockwise, its rays come back the other way round.
        mount: Where the lidar sits on the robot.
        radius: Of the robot, metres.
        sweep: How long a turn takes whose scan does not say it, seconds.

    Raises:
        ValueError: Angles or reach are no lidar's, there are too many rays, next to none of them
            tells anything, or it was made before time began.
    """
    count = len(message.ranges)
    first, step, reach = message.angle_min, message.angle_increment, message.range_max
    if message.header.stamp.sec < 0:
        raise ValueError(f'a scan made at {message.header.stamp.sec} s: expected 0 s or later')
    if not 1 <= count <= MOST_RAYS:
        raise ValueError(f'a scan of {count} rays: expected 1 to {MOST_RAYS}')
    if not (math.isfinite(first) and math.isfinite(step) and abs(step) * count < 20.0):
        raise ValueError(
            f'a scan of {count} rays from {first:g} rad, {step:g} rad apart: expected one turn'
        )
    if abs(first) > 20.0 or (count > 1 and step == 0.0) or not reach > 0.0:
        raise ValueError(
            f'a scan from {first:g} rad, {step:g} rad apart, of {reach:g} m: expected one turn of '
            'a lidar that reaches farther than 0 m'
        )
    reach = min(float(reach), LONGEST_RANGE)
    ranges = np.frombuffer(message.ranges, dtype=np.float32).astype(float)
    ranges[ranges >= reach] = np.inf
    if mount.upside_down:
        first, step = -first, -step
    angles = first + step * np.arange(count)
    near = ranges <= message.range_min
    edge = _edge(mount, angles[near], radius)
    least = np.where(np.isinf(ranges[near]), message.range_min, ranges[near])
    met = np.where(np.isinf(ranges[near]), edge, ranges[near])
    ranges[near] = np.where(least > edge, met, np.nan)
    ranges[~(ranges > 0)] = np.nan
    if np.isnan(ranges).mean() > 1.0 - LEAST_TOLD:
        raise ValueError(
            f'a scan of which less than {LEAST_TOLD:.0%} of the rays tells something: expected '
            'distances, or infinity where nothing is met; the lidar may be covered or broken'
        )
    told = message.time_increment * count
    times = np.arange(count) * ((told if 0.0 < told <= LONGEST_SWEEP else sweep) / count)
    if step < 0:
        angles, ranges, times = angles[::-1], ranges[::-1], times[::-1]
    return Scan(angles, ranges, reach, mount.pose, times if times.any() else None)


def _edge(mount: Mount, angles: Points, radius: float) -> Points:
    """Return how far it is from a lidar to its robot's edge along rays, metres, more than 0."""
    x, y, yaw = mount.pose
    along = x * np.cos(angles + yaw) + y * np.sin(angles + yaw)
    within = np.maximum(along**2 + radius**2 - x**2 - y**2, 0.0)
    return np.maximum(np.sqrt(within) - along, 1e-3)


def matrix_from(transform: Transform) -> NDArray[np.float64]:
    """Return a transform as a matrix of homogeneous coordinates, shape (4, 4).

    Raises:
        ValueError: It is not finite, or its rotation is none.
    """
    moved, q = transform.translation, transform.rotation
    size = math.hypot(q.x, q.y, q.z, q.w)
    values = moved.x, moved.y, moved.z, size
    if not (all(map(math.isfinite, values)) and size > 0):
        raise ValueError('a transform that is none: expected finite numbers and a rotation')
    x, y, z, w = q.x / size, q.y / size, q.z / size, q.w / size
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), moved.x],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), moved.y],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), moved.z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
