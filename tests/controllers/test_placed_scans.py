"""A scan is read from where the robot was when it was made, whichever comes first."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from surveillance_controllers.motion.placed_scans import LONGEST_WAIT, PlacedScans
from surveillance_runtime.sensing.frame_tree import FrameLink, FrameTree


class Placed:
    """Frames of a robot that drives along x and turns, and the scans that are placed."""

    def __init__(self) -> None:
        self.tree = FrameTree()
        self.found: list[tuple[Any, ...]] = []
        self.scans = PlacedScans(
            self.tree, 'base', 'map', lambda *placed: self.found.append(placed)
        )

    def tell(self, stamp: float, turn: float = 0.0) -> None:
        yaw = turn * stamp
        matrix = np.eye(4)
        matrix[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
        matrix[0, 3] = stamp
        self.tree.take('base', FrameLink('map', matrix, stamp, stamp))
        self.scans.look()


def test_a_scan_waits_for_the_frames_of_its_time() -> None:
    placed = Placed()
    scan: Any = object()
    placed.tell(1.0)
    placed.scans.take(scan, 1.25, 1.3)
    placed.scans.take(object(), 1.3, 1.31)  # type: ignore[arg-type]
    assert not placed.found
    placed.tell(1.5)
    ((pose, seen, made, _),) = placed.found
    assert pose == pytest.approx((1.25, 0.0, 0.0))
    assert seen is scan
    assert made == 1.25


@pytest.mark.parametrize(('turn', 'is_slow'), [(0.1, True), (1.0, False)])
def test_it_is_told_whether_the_robot_turned_meanwhile(turn: float, is_slow: bool) -> None:
    placed = Placed()
    scan: Any = object()
    for count in range(20):
        placed.tell(0.1 * count, turn)
    for made in (1.0, 1.2):
        placed.scans.take(scan, made, 2.0)
    assert [each[3] for each in placed.found] == [False, is_slow]


def test_a_scan_of_which_nobody_will_tell_gives_way_to_the_next() -> None:
    placed = Placed()
    scan: Any = object()
    placed.tell(1.0)
    placed.tell(1.2)
    placed.scans.take(scan, 900.0, 5.0)
    placed.scans.take(scan, 1.1, 5.0 + LONGEST_WAIT / 2)
    assert not placed.found
    placed.scans.take(scan, 1.1, 5.1 + LONGEST_WAIT)
    assert [each[2] for each in placed.found] == [1.1]
