"""The arm's joints: where they put the camera, and which trajectories they can follow."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from surveillance_runtime.robot_arm import ARM, Arm, Joint, TrajectoryPoint


@pytest.mark.parametrize('seed', range(4))
def test_the_camera_is_where_scipy_turns_it(seed: int) -> None:
    positions = np.random.default_rng(seed).uniform(ARM.lower, ARM.upper)
    at, turn = np.zeros(3), Rotation.identity()
    for joint, angle, frame in zip(ARM.joints, positions, ARM.frames(positions), strict=True):
        at = at + turn.apply(joint.offset)
        turn = turn * Rotation.from_rotvec(angle * np.array(joint.axis))
        assert frame[:3, 3] == pytest.approx(at)
        assert frame[:3, :3] == pytest.approx(turn.as_matrix())
        assert frame[3].tolist() == [0.0, 0.0, 0.0, 1.0]
    camera = ARM.camera_frame(positions)
    assert camera[:3, 3] == pytest.approx(at + turn.apply(ARM.camera_offset))
    # In the picture right is the last joint's -y, down its -z, and it looks along its x.
    right, down, ahead = (turn.apply(axis) for axis in np.eye(3)[[1, 2, 0]])
    assert camera[:3, :3] == pytest.approx(np.column_stack([-right, -down, ahead]))


def test_a_slanted_axis_is_turned_about() -> None:
    axis = np.array([1.0, 2.0, 2.0]) / 3.0
    arm = Arm((Joint('j', (1.0, 0.0, 0.5), tuple(axis.tolist()), -3, 3),), (0.0, 0.0, 0.0), (0.0,))
    (frame,) = arm.frames([0.7])
    assert frame[:3, :3] == pytest.approx(Rotation.from_rotvec(0.7 * axis).as_matrix())
    assert frame[:3, 3].tolist() == [1.0, 0.0, 0.5]


def test_its_names_limits_and_longest_motion() -> None:
    joints = (
        Joint('a', (0, 0, 0), (0, 0, 1), -1.0, 2.0, 1.5, 3.0, 15.0),
        Joint('b', (0, 0, 0), (0, 0, 1), -0.5, 0.5, 0.1, 2.0, 4.0),
    )
    arm = Arm(joints, (0, 0, 0), (0.0, 0.0))
    assert arm.names == ('a', 'b')
    assert arm.lower.tolist() == [-1.0, -0.5]
    assert arm.upper.tolist() == [2.0, 0.5]
    assert arm.longest_motion == pytest.approx(max(2.0 + 0.5 + 0.2, 10.0 + 0.05 + 0.5))
    for wrong in ([], [0.0], [0.0, 0.0, 0.0]):
        with pytest.raises(ValueError, match=rf'^{len(wrong)} positions: expected 2$'):
            arm.frames(wrong)


def points(*rows: tuple[float, ...]) -> list[TrajectoryPoint]:
    """Return points of one joint: time, position, and perhaps a velocity."""
    return [TrajectoryPoint(row[0], row[1:2], row[2:]) for row in rows]


@pytest.mark.parametrize(
    ('names', 'trajectory', 'problem'),
    [
        (['arm_pan'], points((0.0, 1.0)), ''),
        (['arm_pan'], points((1.0, 1.0, 0.0), (2.0, 3.2)), ''),
        ([], [], ''),
        (
            ['elbow'],
            [],
            "no joint 'elbow': expected arm_pan, arm_lift, arm_elbow, arm_tilt, arm_roll",
        ),
        (['arm_pan', 'arm_pan'], [], 'joint named twice in arm_pan, arm_pan'),
        (
            ['arm_pan', 'arm_lift'],
            points((1.0, 0.5)),
            'point 1: 1 positions and 0 velocities for 2 joints',
        ),
        (
            ['arm_pan'],
            points((1.0, 0.5), (2.0, 0.5, 1.0, 1.0)),
            'point 2: 1 positions and 2 velocities for 1 joints',
        ),
        (['arm_pan'], points((1.0, math.nan)), 'point 1: expected finite numbers'),
        (['arm_pan'], points((math.inf, 0.0)), 'point 1: expected finite numbers'),
        (['arm_pan'], points((1.0, 0.0, math.inf)), 'point 1: expected finite numbers'),
        (
            ['arm_pan'],
            points((-0.1, 0.0)),
            'point 1: time -0.1 s: expected more than the point before',
        ),
        (
            ['arm_pan'],
            points((1.0, 0.0), (1.0, 0.1)),
            'point 2: time 1 s: expected more than the point before',
        ),
        (['arm_lift'], points((1.0, 1.9)), 'point 1: arm_lift at 1.9 rad: expected -1.8 to 1.8'),
        (
            ['arm_lift'],
            points((1.0, 0.0), (2.0, -1.81)),
            'point 2: arm_lift at -1.81 rad: expected -1.8 to 1.8',
        ),
    ],
)
def test_a_trajectory_that_it_cannot_follow_is_refused_in_one_line(
    names: list[str], trajectory: list[TrajectoryPoint], problem: str
) -> None:
    if not problem:
        ARM.check(names, trajectory)
        return
    with pytest.raises(ValueError, match=r'.') as caught:
        ARM.check(names, trajectory)
    assert str(caught.value) == problem
