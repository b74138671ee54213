"""A pose is in doubt when the lidar contradicts it for a while, and not before."""

from __future__ import annotations

import secrets
from typing import Any

import numpy as np

from surveillance_controllers.motion.pose_doubt import AFTER, PoseDoubt


def test_a_pose_in_the_wrong_room_comes_into_doubt_and_a_right_one_does_not(flat: Any) -> None:
    seed = secrets.randbits(32)
    rng = np.random.default_rng(seed)
    doubt = PoseDoubt()
    doubt.set_map(flat.grid)
    now = 0.0
    for _ in range(20):
        now += 10.0
        x, y, yaw = rng.uniform((0.8, 0.4, -3.0), (3.2, 1.9, 3.0))
        scan = flat.scan((x, y, yaw), closed=bool(rng.integers(2)))
        off = rng.uniform(-0.08, 0.08, 2)
        near = (x + off[0], y + off[1], yaw + rng.uniform(-0.03, 0.03))
        assert not any(doubt.look(near, scan, now + second) for second in range(8)), seed
        wrong = (x + 3.6, y, yaw)
        assert not doubt.look(wrong, scan, now), seed
        assert not doubt.look(wrong, scan, now + AFTER / 2), seed
        assert doubt.look(wrong, scan, now + AFTER), seed
        assert not doubt.look(near, scan, now + AFTER + 1.0), seed


def test_what_stands_around_the_robot_is_no_doubt(flat: Any) -> None:
    doubt = PoseDoubt()
    doubt.set_map(flat.grid)
    pose = (5.5, 1.5, 0.0)
    ring = [
        (5.5 + 0.7 * np.cos(angle), 1.5 + 0.7 * np.sin(angle), 0.3)
        for angle in np.arange(0.0, 6.28, 0.5)
    ]
    scan = flat.scan(pose, ring)
    assert not any(doubt.look(pose, scan, 1.0 * second) for second in range(20))
