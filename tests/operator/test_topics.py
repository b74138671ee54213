"""What messages tell of a mission, where more than one message is needed to know it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import JointState

from armor_service.facts import parse_fact
from surveillance_interfaces.action import ScanSurroundings
from surveillance_interfaces.msg import MarkerDetection, MarkerDetectionArray
from surveillance_operator.mission_state import MissionState
from surveillance_operator.topics import DETECTIONS_TOPIC, TOPICS, read_message, with_fact
from surveillance_runtime.robot_arm import ARM
from tests.operator.peers import pose

TOPIC = {topic.name: topic for topic in TOPICS}


def joints(speed: float = 0.0) -> JointState:
    message = JointState(name=list(ARM.names), position=[0.0] * 5, velocity=[speed] * 5)
    message.header.stamp = Time(sec=5)
    return message


def seen(second: int = 5, *, confirmed: bool = True) -> MarkerDetectionArray:
    """Return a marker three metres ahead of the camera."""
    message = MarkerDetectionArray(detections=[MarkerDetection(id=12, confirmed=confirmed)])
    message.detections[0].pose.position.z = 3.0
    message.header.stamp = Time(sec=second)
    return message


def told(*messages: tuple[str, Any]) -> MissionState:
    state = MissionState()
    for name, message in messages:
        state = read_message(state, TOPIC[name], message)
    assert not state.health.silent
    return state


def test_a_confirmed_marker_is_put_on_the_map() -> None:
    standing = [('amcl_pose', pose(1.0, 2.0, math.pi / 2))] * 2
    known = told(*standing, ('joint_states', joints()), (DETECTIONS_TOPIC, seen()))
    camera = ARM.camera_frame([0.0] * 5)
    ahead, left = (camera[:3, :3] @ np.array([0.0, 0.0, 3.0]) + camera[:3, 3])[:2]
    assert known.sensors.markers[12] == pytest.approx((1.0 - left, 2.0 + ahead), abs=0.01)


@pytest.mark.parametrize(
    'messages',
    [
        [pose(1.0, 2.0), pose(1.5, 2.0), joints(), seen()],  # the robot drives
        [pose(1.0, 2.0), pose(1.0, 2.0), joints(0.5), seen()],  # the arm moves
        [pose(1.0, 2.0), pose(1.0, 2.0), joints(), seen(second=4)],  # an image from before
        [pose(1.0, 2.0), pose(1.0, 2.0), joints(), seen(confirmed=False)],
        [pose(1.0, 2.0), pose(1.0, 2.0), seen()],  # nobody knows where the camera is
    ],
)
def test_where_a_marker_is_cannot_be_told_from_a_moving_camera(messages: list[Any]) -> None:
    names = {
        PoseWithCovarianceStamped: 'amcl_pose',
        JointState: 'joint_states',
        MarkerDetectionArray: DETECTIONS_TOPIC,
    }
    known = told(*((names[type(message)], message) for message in messages))
    assert known.sensors.markers == {}
    assert len(known.sensors.detections) == 1


def test_a_pose_in_utm_is_known() -> None:
    assert told(('amcl_pose', pose(499_000.5, 9_999_000.25))).sensors.pose == (
        499_000.5,
        9_999_000.25,
        0.0,
    )


def test_facts_come_and_go() -> None:
    state = MissionState()
    for text in ('URGENT(R1)', 'connectedTo(R1, C1)', 'visitedAt(R1, "7"^^xsd:long)', 'ROBOT(x)'):
        state = with_fact(state, parse_fact(text), came=True)
    assert state.place.urgent == {'R1'}
    assert state.place.links == {('R1', 'C1')}
    assert state.place.visited_at == {'R1': 7.0}
    state = with_fact(state, parse_fact('visitedAt(R1, "9"^^xsd:long)'), came=True)
    state = with_fact(state, parse_fact('visitedAt(R1, "7"^^xsd:long)'), came=False)
    assert state.place.visited_at == {'R1': 9.0}
    assert with_fact(state, parse_fact('URGENT(R1)'), came=False).place.urgent == set()


def test_the_progress_of_a_scan_ends_with_its_goal() -> None:
    """The page said `view 4 of 7` for the rest of the mission."""
    feedback = ScanSurroundings.Impl.FeedbackMessage()
    feedback.feedback.view, feedback.feedback.views = 4, 7
    goals = TOPIC['scan_surroundings/_action/status']
    running = GoalStatusArray(status_list=[GoalStatus(status=GoalStatus.STATUS_EXECUTING)])
    ended = GoalStatusArray(status_list=[GoalStatus(status=GoalStatus.STATUS_CANCELED)])
    state = read_message(MissionState(), TOPIC['scan_surroundings/_action/feedback'], feedback)
    assert read_message(state, goals, running).sensors.scan_progress == (4, 7)
    assert read_message(state, goals, ended).sensors.scan_progress is None


def test_a_topic_on_which_those_speak_who_only_look_on_tells_of_no_mission() -> None:
    everybody = {name for name, topic in TOPIC.items() if not topic.is_of_mission}
    assert everybody == {'/diagnostics', '/parameter_events', 'incidents'}


def test_a_map_that_is_repeated_changes_nothing() -> None:
    message = OccupancyGrid(data=[0, 100, 0, 0, 0, 100])
    message.info.width, message.info.height, message.info.resolution = 3, 2, 0.5
    (topic,) = (each for each in TOPICS if each.name == 'map')
    state = read_message(MissionState(), topic, message).having(trail=np.ones((2, 2)))
    assert read_message(state, topic, message) is state
    message.data[0] = 100
    changed = read_message(state, topic, message)
    assert changed.place.grid is not state.place.grid
    assert not len(changed.sensors.trail)
