""""""

from __future__ import annotations

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from PIL import Image
from sensor_msgs.msg import CompressedImage, LaserScan
from std_msgs.msg import UInt8

from surveillance_interfaces.msg import Decision, FactChange, FactChanges, MissionStatus
from surveillance_interfaces.msg import Fact as FactMessage
from surveillance_operator.mission_markers_node import markers_of
from surveillance_operator.mission_state import MissionState

START = 1_000_000.0


SECONDS = 20


def stamp(at: float) -> Time:
    return Time(sec=int(at), nanosec=int(at % 1 * 1e9))


def pose_at(at: float, x: float) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.stamp = stamp(at)
    message.pose.pose.position.x, message.pose.pose.orientation.w = x, 1.0
    return message


def scan_at(at: float) -> LaserScan:
    ranges = np.array([2.0], dtype=np.float32)
    message = LaserScan(range_max=8.0, angle_increment=0.1, ranges=ranges)
    message.header.stamp = stamp(at)
    return message


def image() -> CompressedImage:
    file = io.BytesIO()
    Image.new('RGB', (8, 6), 'red').save(file, 'JPEG')
    return CompressedImage(format='jpeg', data=file.getvalue())


def visit(place: str, at: float) -> FactChanges:
    fact = FactMessage(predicate='visitedAt', arguments=[place, f'"{at:.0f}"^^xsd:long'])
    return FactChanges(sequence=1, changes=[FactChange(fact=fact, added=True)])


def said() -> Iterator[tuple[float, str, Any]]:
    """Yield what a mission in the namespace `two` said: seconds, topic, message."""
    places = MissionState().having(
        positions={'A': (0.0, 0.0), 'B': (9.0, 0.0)}, door_lines={'D': (5.0, -1.0, 5.0, 1.0)}
    )
    yield 0.0, '/two/place_markers', markers_of(places, Time())
    for second in range(SECONDS):
        at = START + second
        yield (
            second,
            '/two/mission_status',
            MissionStatus(machine='surveillance', state=f'S{second}'),
        )
        yield second + 0.01, '/two/battery_level', UInt8(data=90 - second)
        yield second + 0.02, '/two/amcl_pose', pose_at(at, second / 2)
        yield second + 0.03, '/two/scan', scan_at(at)
        yield second + 0.04, '/two/camera/rgb/image_raw/compressed', image()
        if second == 10:
            decision = Decision(sequence=7, from_place='A', place='B', rule='URGENT')
            yield second + 0.05, '/two/decision', decision
        if second == 15:
            yield second + 0.06, '/two/fact_changes', visit('B', at)
