"""Where a robot may be: poses with their odds, in plain numbers."""

from __future__ import annotations

import math

import pytest

from lidar_navigation.geometry import Pose
from lidar_navigation.localisation.belief import CARRIED, FORGOTTEN, SURE, Belief, told

HERE = (5.0, 5.0, 0.0)
FAR = (15.0, 15.0, 0.0)
OTHER = (2.0, 18.0, 1.0)


def weigh(belief: Belief, likelihood: dict[Pose, float], information: float = 1.0) -> None:
    belief.weigh(
        likelihood[belief.pose], lambda pose: (pose, likelihood.get(pose, -math.inf)), information
    )


@pytest.mark.parametrize(
    ('difference', 'left'), [(0.5, 0.0), (-0.5, 0.0), (1.6, 1.0), (-1.6, -1.0)]
)
def test_a_small_difference_says_nothing(difference: float, left: float) -> None:
    assert told(difference) == pytest.approx(left)


def test_a_push_is_likelier_than_being_carried_and_a_small_one_likelier_than_a_great_one() -> None:
    belief = Belief(HERE)
    near, farther, turned = (5.2, 5.0, 0.0), (6.0, 5.0, 0.0), (5.2, 5.0, 1.0)
    priors = [belief.prior(pose) for pose in (near, farther, turned, FAR)]
    assert priors == sorted(priors, reverse=True)
    assert priors[-1] == -CARRIED


def test_what_nothing_tells_apart_stays_alike_and_what_is_ruled_out_does_not() -> None:
    belief = Belief(HERE)
    belief.add([(FAR, 0.0), (OTHER, 0.0)])
    for _ in range(9):
        weigh(belief, {HERE: -1.0, FAR: -1.2, OTHER: -2.6})
    assert belief.alike == [FAR]
    assert not belief.follow_best(SURE)
    weigh(belief, {HERE: -9.0, FAR: -1.0, OTHER: -1.0})
    assert belief.follow_best(SURE)
    assert belief.pose == FAR
    assert HERE not in belief.alike


def test_of_odds_against_the_pose_that_wins_those_of_all_others_follow() -> None:
    belief = Belief(HERE)
    belief.add([(FAR, 4.0), (OTHER, 2.0)])
    assert belief.follow_best(SURE)
    assert [(rival.pose, rival.odds) for rival in belief.rivals] == [(OTHER, -2.0), (HERE, -4.0)]


def test_a_pose_that_a_push_explains_is_followed_as_soon_as_it_is_likelier() -> None:
    belief = Belief(HERE)
    belief.add([((5.6, 5.0, 0.0), 0.1)])
    assert belief.follow_best(SURE)
    belief = Belief(HERE)
    belief.add([(FAR, SURE - 0.1)])
    assert not belief.follow_best(SURE)


def test_rivals_end_where_no_robot_can_be_or_another_pose_is_or_none_believes_in_them() -> None:
    belief = Belief(HERE)
    wall, same = (18.0, 2.0, 0.0), (5.3, 5.0, 0.1)
    belief.add([(FAR, 0.0), (OTHER, 0.0), (wall, 0.0), (same, 0.0), ((1.0, 1.0, 0.0), -FORGOTTEN)])
    assert [rival.pose for rival in belief.rivals] == [FAR, OTHER, wall]
    weigh(belief, {HERE: 0.0, FAR: 0.0, OTHER: -FORGOTTEN - 1.0})
    assert [rival.pose for rival in belief.rivals] == [FAR]


def test_all_poses_move_with_the_odometry_and_a_pose_that_is_told_is_the_only_one() -> None:
    belief = Belief((1.0, 1.0, math.pi / 2))
    belief.add([(FAR, 0.0)])
    belief.move((1.0, 0.0, 0.0))
    assert belief.pose == pytest.approx((1.0, 2.0, math.pi / 2))
    assert belief.rivals[0].pose == pytest.approx((16.0, 15.0, 0.0))
    belief.believe(OTHER)
    assert (belief.pose, belief.rivals) == (OTHER, [])
