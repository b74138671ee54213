"""From messages to the values of a snapshot; the only place of this package that knows both.

A message from the network may hold anything. What cannot be used raises `ValueError` with one line.
"""

from __future__ import annotations

import io
import math
import time
from collections.abc import Iterable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid
from nav_msgs.msg import Path as PathMessage
from numpy.typing import NDArray
from PIL import Image
from sensor_msgs.msg import CompressedImage, JointState, LaserScan, PointCloud2
from sensor_msgs.msg import Image as ImageMessage
from std_msgs.msg import UInt8
from visualization_msgs.msg import MarkerArray

from surveillance_interfaces.msg import (
    DoorStates,
    FsmStructure,
    FsmTransition,
    MarkerDetectionArray,
    MissionStatus,
)
from surveillance_operator.snapshot import Container, Health, Status, Transition
from surveillance_runtime.conversions import map_from, points_from_cloud, seconds_of
from surveillance_runtime.place.occupancy_grid import Grid

MOST_CELLS = 16_000_000
MOST_POINTS = 20_000
MOST_NAMES = 10_000
MOST_PIXELS = 20_000_000
JPEG_QUALITY = 75
JPEG_START = b'\xff\xd8'
URGENT_MARK = ' URGENT'
"""Follows the name of a place on `place_markers`."""
STANDING = 0.01
"""A joint that is slower stands still, rad/s."""
MOST_BEAMS = 120
"""Of a scan with more beams every n-th is shown."""


def status_from(message: MissionStatus) -> Status:
    """Return what the machine does, as it was published."""
    return Status(
        since=seconds_of(message.stamp),
        machine=message.machine,
        state=message.state,
        place=message.place,
        heading_to=message.heading_to,
        waiting_for_help=message.waiting_for_help,
        text=message.text,
        avoided=_names(message.avoided, 'avoided'),
    )


def doors_from(message: DoorStates) -> dict[str, bool]:
    """Return whether each door is open, by name."""
    opened, closed = _names(message.open, 'open doors'), _names(message.closed, 'closed doors')
    return dict(sorted({**dict.fromkeys(opened, True), **dict.fromkeys(closed, False)}.items()))


def point_from(message: Any) -> tuple[float, float]:
    """Return x and y of a point in metres.

    Raises:
        ValueError: A coordinate is not finite.
    """
    if not (math.isfinite(message.x) and math.isfinite(message.y)):
        raise ValueError(f'a point at ({message.x:g}, {message.y:g}): expected finite numbers')
    return message.x, message.y


def percent_from(message: UInt8) -> float:
    """Return a battery level.

    Raises:
        ValueError: It is not from 0 to 100.
    """
    if not 0 <= message.data <= 100:
        raise ValueError(f'a level of {message.data} %: expected 0 to 100')
    return float(message.data)


def grid_from(message: OccupancyGrid) -> Grid:
    """Return a map; see `map_from`."""
    return map_from(message, MOST_CELLS)


def cloud_from(message: PointCloud2) -> NDArray[np.float64]:
    """Return the points of a cloud that are finite, shape (n, 2), metres.

    Raises:
        ValueError: It has no x and y, or its sizes contradict each other.
    """
    count = message.width * message.height
    if count > MOST_POINTS:
        raise ValueError(f'a cloud of {count} points: expected at most {MOST_POINTS}')
    if count * message.point_step > len(message.data):
        raise ValueError(f'{len(message.data)} bytes came for {count} points')
    points = points_from_cloud(message)
    return points[np.isfinite(points).all(axis=1)]


def path_from(message: PathMessage) -> NDArray[np.float64]:
    """Return the points of a path, shape (n, 2), metres.

    Raises:
        ValueError: Too many points, or one is not finite.
    """
    if len(message.poses) > MOST_POINTS:
        raise ValueError(f'a path of {len(message.poses)} points: expected at most {MOST_POINTS}')
    points = [point_from(each.pose.position) for each in message.poses]
    return np.array(points, dtype=float).reshape(-1, 2)


def scan_from(message: LaserScan) -> NDArray[np.float64]:
    """Return where a lidar's beams end, shape (n, 2), metres, in the lidar's frame.

    Beams that hit nothing are left out.

    Raises:
        ValueError: Its angles are not finite.
    """
    count = len(message.ranges)
    if not (math.isfinite(message.angle_min) and math.isfinite(message.angle_increment)):
        raise ValueError('a scan whose angles are not finite')
    step = max(1, -(-min(count, MOST_POINTS) // MOST_BEAMS))
    ranges = np.asarray(message.ranges[:MOST_POINTS:step], dtype=float)
    angles = message.angle_min + message.angle_increment * step * np.arange(len(ranges))
    with np.errstate(invalid='ignore'):
        good = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges < message.range_max)
    ranges, angles = ranges[good], angles[good]
    return np.stack([ranges * np.cos(angles), ranges * np.sin(angles)], axis=1)


def containers_from(message: FsmStructure) -> tuple[Container, ...]:
    """Return the containers of a state machine, outermost first."""
    if len(message.containers) > MOST_NAMES:
        raise ValueError(f'a state machine of {len(message.containers)} containers')
    return tuple(
        Container(
            each.path,
            each.kind,
            _names(each.states, 'states'),
            _names(each.initial_states, 'initial states'),
            _names(each.outcomes, 'outcomes'),
            tuple((edge.from_state, edge.outcome, edge.to_state) for edge in each.edges),
        )
        for each in message.containers
    )


def transition_from(message: FsmTransition) -> Transition:
    """Return a transition of the state machine."""
    duration = float(message.duration)
    return Transition(
        message.sequence,
        seconds_of(message.stamp),
        message.path,
        message.from_state,
        message.outcome,
        message.to_state,
        duration if math.isfinite(duration) else 0.0,
    )


def detections_from(message: MarkerDetectionArray) -> tuple[tuple[int, bool, bool, float], ...]:
    """Return the markers of one image: id, known, confirmed, confidence."""
    return tuple(
        (each.id, each.known, each.confirmed, round(float(each.confidence), 2))
        for each in message.detections[:MOST_NAMES]
    )


def confirmed_from(message: MarkerDetectionArray) -> dict[int, NDArray[np.float64]]:
    """Return where the confirmed markers of an image are by id, (3,) metres, optical frame."""
    found = {}
    for each in message.detections[:MOST_NAMES]:
        at = each.pose.position
        if each.confirmed and all(map(math.isfinite, (at.x, at.y, at.z))):
            found[int(each.id)] = np.array([at.x, at.y, at.z])
    return found


def joints_from(message: JointState) -> tuple[dict[str, float], bool]:
    """Return the positions of joints by name, rad, and whether all stand still.

    Raises:
        ValueError: There are not as many positions as names, or one is not finite.
    """
    if len(message.name) != len(message.position):
        raise ValueError(f'{len(message.position)} positions came for {len(message.name)} joints')
    if not all(map(math.isfinite, message.position)):
        raise ValueError('joints whose positions are not finite')
    still = all(abs(speed) < STANDING for speed in message.velocity)
    return dict(zip(message.name, message.position, strict=True)), still


def jpeg_from(message: ImageMessage | CompressedImage) -> bytes | None:
    """Return an image as JPEG; None when its encoding or its size cannot be used."""
    if isinstance(message, CompressedImage):
        data = bytes(message.data)
        return data if data.startswith(JPEG_START) else None
    channels = {'rgb8': 3, 'bgr8': 3, 'mono8': 1}.get(message.encoding)
    if channels is None or not 0 < message.width * message.height <= MOST_PIXELS:
        return None
    pixels = np.frombuffer(bytes(message.data), np.uint8)
    if message.step < message.width * channels or pixels.size < message.step * message.height:
        return None
    rows = pixels[: message.step * message.height].reshape(message.height, message.step)
    image = rows[:, : message.width * channels].reshape(message.height, message.width, channels)
    if message.encoding == 'bgr8':
        image = image[:, :, ::-1]
    file = io.BytesIO()
    Image.fromarray(image if channels == 3 else image[:, :, 0]).save(
        file, 'JPEG', quality=JPEG_QUALITY
    )
    return file.getvalue()


def places_from(
    message: MarkerArray,
) -> tuple[dict[str, tuple[float, float]], dict[str, tuple[float, float, float, float]]]:
    """Return the places' points and the doors' lines that `place_markers` shows, metres."""
    positions, lines = {}, {}
    for each in message.markers[:MOST_NAMES]:
        if each.ns == 'names':
            positions[each.text.removesuffix(URGENT_MARK)] = point_from(each.pose.position)
        elif each.ns == 'doors' and len(each.points) == 2 and each.text:
            lines[each.text] = (*point_from(each.points[0]), *point_from(each.points[1]))
    return positions, lines


def health_from(message: DiagnosticArray) -> dict[str, Health]:
    """Return what each part reports, by name."""
    heard = time.monotonic()
    return {
        each.name: Health(
            each.level[0] if isinstance(each.level, bytes) else int(each.level),
            each.message,
            tuple((value.key, value.value) for value in each.values[:50]),
            each.hardware_id,
            heard,
        )
        for each in message.status[:MOST_NAMES]
    }


def _names(names: Iterable[str], what: str) -> tuple[str, ...]:
    found = tuple(names)
    if len(found) > MOST_NAMES:
        raise ValueError(f'{len(found)} {what}: expected at most {MOST_NAMES}')
    return found
