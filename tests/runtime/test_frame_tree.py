"""Where frames are in each other, as they are told one by one."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from lidar_navigation.geometry import composed
from surveillance_runtime.sensing.frame_tree import FrameLink, FrameTree


def link(
    parent: str, x: float, y: float, yaw: float, *, fixed: bool = False, stamp: float = 7.0
) -> FrameLink:
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    matrix[:2, 3] = x, y
    return FrameLink(parent, matrix) if fixed else FrameLink(parent, matrix, stamp, 100.0)


def tree() -> FrameTree:
    made = FrameTree()
    made.take('odom', link('map', 10.0, 0.0, math.pi / 2))
    made.take('/base_footprint', link('odom', 2.0, 1.0, 0.5))
    made.take('base_link', link('base_footprint', 0.0, 0.0, 0.0, fixed=True))
    return made


def test_a_robot_is_where_the_frames_between_it_and_the_map_say() -> None:
    found = tree().pose('base_link', '/map', 100.5, 1.0)
    assert found is not None
    pose, stamp = found
    assert pose == pytest.approx((9.0, 2.0, math.pi / 2 + 0.5))
    assert stamp == 7.0


def test_what_nobody_tells_any_more_is_not_known() -> None:
    assert tree().pose('base_link', 'map', 101.5, 1.0) is None
    assert tree().pose('laser', 'map', 100.5, 1.0) is None
    round_about = tree()
    round_about.take('map', link('base_link', 0.0, 0.0, 0.0))
    assert round_about.pose('base_link', 'earth', 100.5, 1.0) is None


def test_a_frame_that_two_tell_of_is_named() -> None:
    made = tree()
    made.take('laser', link('base_link', 0.1, 0.0, 0.0, fixed=True))
    made.take('laser', link('base_link', 0.1, 0.0, 0.0, fixed=True))
    assert not made.doubled
    made.take('laser', link('base_link', 0.3, 0.0, 0.0, fixed=True))
    assert 'laser is told at two places on base_link, 0.20 apart' in made.doubled['laser']
    made.take('base_footprint', link('map', 0.0, 0.0, 0.0))
    assert 'below odom and below map' in made.doubled['base_footprint']


def test_a_robot_was_where_the_words_before_and_behind_a_time_have_it() -> None:
    seed = random.randrange(1 << 30)
    print('seed', seed)
    rng = random.Random(seed)
    for _ in range(50):
        made = FrameTree()
        made.take('base_link', link('base', 0.1, 0.0, 0.0, fixed=True))
        correction = rng.uniform(-20, 20), rng.uniform(-20, 20), rng.uniform(-3, 3)
        began, speed, turn = rng.uniform(0, 1e9), rng.uniform(-1, 1), rng.uniform(-1, 1)
        for count in range(60):  # dated ahead, as AMCL does
            made.take('odom', link('map', *correction, stamp=began + 0.1 * count + 1.0))
        for count in range(120):
            passed = 0.05 * count
            yaw = math.remainder(3.0 + turn * passed, math.tau)
            made.take('base', link('odom', speed * passed, 0.0, yaw, stamp=began + passed))
        passed = rng.uniform(2.0, 5.9)
        yaw = 3.0 + turn * passed
        in_odom = speed * passed + 0.1 * math.cos(yaw), 0.1 * math.sin(yaw), yaw
        found = made.pose_at('base_link', 'map', began + passed)
        assert found is not None
        x, y, turned = composed(correction, in_odom)
        assert found[:2] == pytest.approx((x, y), abs=1e-3)
        assert math.remainder(found[2] - turned, math.tau) == pytest.approx(0.0, abs=1e-3)
        assert made.is_past('base_link', 'map', began + passed)


def test_where_a_robot_will_be_or_was_long_ago_is_not_known() -> None:
    made = tree()
    made.take('odom', link('map', 10.0, 0.0, 0.0, stamp=30.0))
    made.take('base_footprint', link('odom', 0.0, 0.0, 0.0, stamp=8.0))
    assert not made.is_past('base_link', 'map', 8.1)
    for stamp in (6.9, 8.1):
        assert made.pose_at('base_link', 'map', stamp) is None
    assert made.pose_at('base_link', 'odom', 7.5) is not None
    assert made.pose_at('base_link', 'map', 7.5) is None, 'nobody told of map -> odom for 23 s'
    made.take('base_footprint', link('odom', 0.0, 0.0, 0.0, stamp=1.0))
    assert made.pose_at('base_link', 'odom', 7.5) is None, 'the clock was set'
    assert made.pose_at('base_link', 'odom', 1.0) is not None
