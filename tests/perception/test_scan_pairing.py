"""A scan waits for where the robot was when it was made."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lidar_navigation.geometry import Scan
from surveillance_perception.observing.base_history import BaseHistory
from surveillance_perception.observing.scan_pairing import (
    MOST_SCANS,
    ScanPairing,
    sectors_of,
    sweep_of,
)


def scan(first: float = -math.pi, beams: int = 360, mount=(0.0, 0.0, 0.0)) -> Scan:
    angles = first + np.arange(beams) * math.tau / 360
    return Scan(angles, np.full(beams, 2.0), 8.0, mount)


def test_a_scan_waits_for_a_pose_and_is_told_once():
    base, lost = BaseHistory(), []
    pairing = ScanPairing(base, lambda: lost.append(1))
    pairing.take(10.0, scan())
    assert pairing.paired() == []
    base.take_pose(10.0, (1.0, 2.0, 0.0), 10.0)
    ((pose, _),) = pairing.paired()
    assert pose == (1.0, 2.0, 0.0)
    assert pairing.paired() == []
    for number in range(MOST_SCANS):
        pairing.take(20.0 + number, scan())
    assert not lost
    pairing.take(40.0, scan())
    assert len(lost) == 1, 'the first one goes, and that is told'


def test_a_lidar_that_looks_ahead_does_not_see_all_around():
    ahead = sectors_of(scan(-math.pi / 2, 180))
    assert 17 <= ahead.sum() <= 19
    turned = sectors_of(scan(-math.pi / 2, 180, (0.0, 0.0, math.pi)))
    assert (ahead | turned).all()


def test_a_scan_on_the_map_is_turned_and_moved_with_its_robot_and_mount():
    sweep = sweep_of((1.0, 2.0, math.pi / 2), scan(0.0, 1, (0.5, 0.0, 0.0)), 7.0)
    assert sweep.sensor == pytest.approx((1.0, 2.5))
    assert sweep.ends.tolist() == [pytest.approx([1.0, 4.5])]
    assert (sweep.met.all(), sweep.stamp) == (True, 7.0)
