"""Where frames are in each other, as they are told one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from surveillance_runtime.sensing.frame_tree import FrameLink, FrameTree


def link(parent: str, x: float, y: float, yaw: float, *, fixed: bool = False) -> FrameLink:
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    matrix[:2, 3] = x, y
    return FrameLink(parent, matrix) if fixed else FrameLink(parent, matrix, 7.0, 100.0)


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
