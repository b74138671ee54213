"""What a message may not do to a view."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Pose
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import LaserScan, PointCloud2
from std_msgs.msg import UInt8

from surveillance_interfaces.msg import Decision, PlaceCoverage, PlaceCoverages
from surveillance_operator.mission_state import MissionState
from surveillance_operator.topics import TOPICS, read_message, scan_from
from surveillance_runtime.conversions import pose_from

TOPIC = {topic.name: topic for topic in TOPICS}


def grid(**info: Any) -> OccupancyGrid:
    message = OccupancyGrid(data=[0, 0])
    message.info.width, message.info.height, message.info.resolution = 2, 1, 0.5
    for name, value in info.items():
        setattr(message.info, name, value)
    return message


@pytest.mark.parametrize(
    ('topic', 'message', 'words'),
    [
        ('decision', Decision(candidates=['A'], scores=[]), '0 scores came for 1 candidates'),
        ('decision', Decision(candidates=['A'], scores=[math.nan]), 'score of A is not a number'),
        ('map', grid(width=3), 'a map of 2 cells'),
        ('map', grid(resolution=0.0), 'a map of 0 m a cell'),
        ('map', grid(resolution=math.nan), 'a map of nan m a cell'),
        ('battery_level', UInt8(data=200), 'a level of 200 %'),
        ('obstacles', PointCloud2(width=9, height=9, point_step=12), '0 bytes came for 81 points'),
        ('obstacles', PointCloud2(width=10**6, height=1), 'expected at most'),
        (
            'coverage',
            PlaceCoverages(places=[PlaceCoverage(place='A', share=1.5)]),
            'a share of 1.5 of A',
        ),
        ('scan', LaserScan(angle_min=math.inf), 'angles are not finite'),
    ],
)
def test_a_message_that_cannot_be_used_is_said_and_changes_nothing(
    topic: str, message: Any, words: str
) -> None:
    before = MissionState().having(pose=(0.0, 0.0, 0.0), battery=50.0)
    after = read_message(before, TOPIC[topic], message)
    assert words in after.health.silent[topic]
    assert after.task.battery == 50.0
    assert after.place.grid is None


def test_a_pose_that_is_not_finite_is_refused() -> None:
    pose = Pose()
    pose.position.x = math.nan
    with pytest.raises(ValueError, match='expected finite numbers'):
        pose_from(pose)


def test_a_scan_leaves_out_what_is_no_hit() -> None:
    ranges = [1.0, math.inf, math.nan, 0.0, 9.0, 2.0]
    scan = LaserScan(angle_increment=math.pi / 2, range_min=0.1, range_max=8.0, ranges=ranges)
    points = scan_from(scan)
    np.testing.assert_allclose(points, [[1.0, 0.0], [0.0, 2.0]], atol=1e-5)
