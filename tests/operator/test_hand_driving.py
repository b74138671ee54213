"""Driving by hand lasts as long as the hand is on it, and a pose is told to who listens."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist

from surveillance_operator.hand_driving import HandDriving
from surveillance_runtime.node import PatrolNode


def driving(graph: Any, pauses: list[str]) -> HandDriving:
    node = graph.add(partial(PatrolNode, 'mission_page'))
    return HandDriving(node, lambda: pauses.append('paused'))


def test_a_hand_that_goes_away_stops_the_robot(graph: Any) -> None:
    pauses: list[str] = []
    hand = driving(graph, pauses)
    told = graph.listen(Twist, 'cmd_vel_manual', 1)
    graph.until(lambda: hand._commands.get_subscription_count())
    hand.drive(0.3, -0.2)
    graph.until(lambda: told and told[-1].linear.x == 0.3 and told[-1].angular.z == -0.2)
    # Nobody holds it any more: the last that is heard is that it is to stand.
    graph.until(lambda: told[-1].linear.x == 0.0)
    hand.drive(0.3, 0.0)
    hand.drive(0.0, 0.0)
    graph.until(lambda: told[-1].linear.x == 0.0)
    assert pauses == ['paused']


def test_what_is_no_command_is_refused(graph: Any) -> None:
    pauses: list[str] = []
    hand = driving(graph, pauses)
    for speed, turn in ((math.nan, 0.0), (9.0, 0.0), ('fast', 0.0), (0.0, 7.0)):
        with pytest.raises(ValueError, match='expected a number from'):
            hand.drive(speed, turn)  # type: ignore[arg-type]  # as a browser may send it
    assert pauses == []


def test_a_pose_is_told_to_who_listens(graph: Any) -> None:
    hand = driving(graph, [])
    with pytest.raises(ValueError, match='nobody listens to initialpose'):
        hand.set_pose(1.0, 2.0, 0.0)
    told = graph.listen(PoseWithCovarianceStamped, 'initialpose', 1)
    graph.until(lambda: hand._poses.get_subscription_count())
    assert hand.set_pose(1.0, 2.0, math.pi / 2) == (
        'it is told that it is at 1.0, 2.0, looking to 90°'
    )
    graph.until(lambda: told)
    pose = told[-1].pose.pose
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    assert pose.orientation.z == pytest.approx(math.sqrt(0.5))
    assert told[-1].header.frame_id == 'map'
    assert told[-1].pose.covariance[0] > 0
