"""Where the camera was: base and joints by their stamps, and how sure that is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from marker_detection.camera_model import CameraModel
from surveillance_perception.observing.base_history import BaseHistory
from surveillance_perception.observing.camera_tracker import (
    CameraTracker,
    camera_joints,
    matrix_of,
)
from surveillance_runtime.robot_arm import ARM


def standing(doubt=(0.05, 0.02), joints=None, at: float = 0.0) -> CameraTracker:
    """Return a camera on a base that stood at (1, 2) for two seconds."""
    base = BaseHistory()
    tracker = CameraTracker(base, lambda: doubt)
    for tick in range(21):
        base.take_pose(tick / 10, (1.0, 2.0, at), tick / 10)
        if joints:
            tracker.take_joints(tick / 10, joints)
    return tracker


def test_without_joints_the_camera_looks_ahead():
    tracker = standing(at=0.5)
    viewpoint = tracker.viewpoint(1.5, 1.5)
    assert viewpoint is not None
    assert viewpoint == (1.0, 2.0, 0.5)
    assert tracker.bearing_of(viewpoint) == 0.5
    assert tracker.camera_at(viewpoint) is None, 'nobody knows how it is mounted'


def test_with_an_arm_it_is_known_where_on_the_map_the_camera_is_and_how_sure_that_is():
    tracker = standing(joints=dict(zip(ARM.names, ARM.home, strict=True)))
    viewpoint = tracker.viewpoint(1.5, 1.5)
    assert viewpoint is not None
    assert viewpoint == pytest.approx((1.0, 2.0, 0.0, *ARM.home))
    assert tracker.camera_at(viewpoint) is None, 'the lens is not known'
    assert tracker.angle is None
    matrix = np.array([[300.0, 0.0, 160.0], [0.0, 300.0, 120.0], [0.0, 0.0, 1.0]])
    tracker.lens = CameraModel(320, 240, matrix)
    camera = tracker.camera_at(viewpoint)
    assert camera.deviation == 0.05
    assert tracker.angle == pytest.approx(2.0 * math.atan(160.0 / 300.0))
    assert tracker.passing(1.5) is None, 'the odometry has told nothing'
    vague = standing(None, dict(zip(ARM.names, ARM.home, strict=True)))
    vague.lens = tracker.lens
    assert vague.camera_at(viewpoint) is None, 'who localises does not tell how sure it is'


def test_a_camera_that_turns_has_no_viewpoint():
    tracker = standing()
    for tick in range(21):
        tracker.take_joints(tick / 10, {'pan': tick / 10})
    assert tracker.viewpoint(1.5, 1.5) is None
    assert tracker.is_told(1.0, 1.5)
    assert not tracker.is_told(1.0, 9.0)


def test_of_joints_the_arm_counts_and_wheels_do_not():
    assert camera_joints(['wheel_left', 'pan'], [1.0, 2.0]) == {'pan': 2.0}
    names = ['gripper', *ARM.names]
    assert camera_joints(names, [0.0] * len(names)).keys() == set(ARM.names)
    assert camera_joints(['pan'], []) == {}
    with pytest.raises(ValueError, match='1 positions: expected one for each of 2 names'):
        camera_joints(['pan', 'tilt'], [1.0])
    with pytest.raises(ValueError, match='not finite'):
        camera_joints(['pan'], [math.nan])


def test_a_pose_in_the_plane_is_a_transform():
    turned = matrix_of((1.0, 2.0, math.pi / 2)) @ np.array([1.0, 0.0, 0.5, 1.0])
    assert turned == pytest.approx([1.0, 3.0, 0.5, 1.0])
