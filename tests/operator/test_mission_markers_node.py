"""What RViz, Foxglove and rqt get to see."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from std_msgs.msg import String

from surveillance_operator import mission_markers_node, node_graph_watch
from surveillance_operator.mission_markers_node import (
    FRESH,
    LATE,
    MissionMarkers,
    markers_of,
    path_of,
    urdf,
)
from surveillance_operator.mission_state import MissionState
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.robot_arm import ARM

CONFIG = Path(__file__).parents[2] / 'config'


def test_a_place_is_coloured_by_its_wait_and_a_door_by_its_state() -> None:
    state = MissionState().having(
        now=220.0,
        threshold=120.0,
        positions={'A': (1.0, 2.0), 'B': (3.0, 4.0)},
        visited_at={'A': 220.0, 'B': 50.0},
        urgent=frozenset({'B'}),
        door_lines={'D': (0.0, 0.0, 1.0, 0.0)},
        doors={'D': False},
    )
    found = {(each.ns, each.id): each for each in markers_of(state, Time()).markers}
    first, second = found['places', 0].color, found['places', 1].color
    assert (first.r, first.g, first.b) == pytest.approx(FRESH, abs=1e-6)
    assert (second.r, second.g, second.b) == pytest.approx(LATE, abs=1e-6)
    assert found['names', 1].text == 'B URGENT'
    assert [point.x for point in found['doors', 0].points] == [0.0, 1.0]
    assert found['doors', 0].color.r > 0.5
    assert {each.header.frame_id for each in found.values()} == {'map'}


def test_the_driven_way_is_a_path() -> None:
    path = path_of(MissionState().having(trail=np.array([(0.0, 1.0), (2.0, 3.0)])), Time())
    assert [(each.pose.position.x, each.pose.position.y) for each in path.poses] == [
        (0.0, 1.0),
        (2.0, 3.0),
    ]


def test_the_description_has_the_joints_of_joint_states() -> None:
    robot = ElementTree.fromstring(urdf())
    moving = [each.get('name') for each in robot.iter('joint') if each.get('type') == 'revolute']
    assert tuple(moving) == ARM.names
    links = {each.get('name') for each in robot.iter('link')}
    joined = [each.get('link') for each in robot.iter('child')]
    assert links - set(joined) == {'base_link'}
    assert len(joined) == len(set(joined))


def test_a_node_that_reports_no_more_is_stale(graph: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mission_markers_node, 'PERIOD', 0.05)
    monkeypatch.setattr(node_graph_watch, 'STALE_AFTER', 0.5)
    node_speaks = graph.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
    status = DiagnosticStatus(name='planner', hardware_id='robot7', message='up')
    heard = graph.listen(DiagnosticArray, '/diagnostics')
    described = graph.listen(String, 'robot_description', STATE_QOS)
    graph.add(MissionMarkers)
    listeners = len([heard, 'the subscriber of the markers'])
    graph.until(lambda: node_speaks.get_subscription_count() == listeners)
    terminal = DiagnosticStatus(name='robot7/console', message='up')  # its end is no fault
    node_speaks.publish(DiagnosticArray(status=[terminal, status]))
    stale = graph.until(
        lambda: [
            status
            for message in heard
            for status in message.status
            if status.level == DiagnosticStatus.STALE
        ]
    )
    assert (stale[0].name, stale[0].hardware_id) == ('planner', 'robot7')
    assert stale[0].message == 'does not report'
    assert {each.name for each in stale} == {'planner'}
    monkeypatch.setattr(node_graph_watch, 'STALE_AFTER', 1000.0)
    node_speaks.publish(DiagnosticArray(status=[status]))
    seen = len(heard)
    graph.until(lambda: DiagnosticStatus.OK in [each.status[0].level for each in heard[seen:]])
    assert described[0].data.startswith('<?xml')


def test_the_layouts_name_topics_that_there_are() -> None:
    rviz = yaml.safe_load((CONFIG / 'mission.rviz').read_text())
    displays = rviz['Visualization Manager']['Displays']
    shown = {each.get('Topic', {}).get('Value') for each in displays}
    foxglove = json.loads((CONFIG / 'mission.foxglove.json').read_text())
    for topic in ('/map', '/place_markers', '/plan', '/driven_path', '/amcl_pose', '/scan'):
        assert topic in shown
        assert topic in foxglove['configById']['3D!map']['topics']
