"""Which nodes of a mission there are, and which cannot be heard or have ceased to speak."""

from __future__ import annotations

from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt8

from surveillance_interfaces.msg import MissionStatus
from surveillance_operator import node_graph_watch
from surveillance_operator.mission_view_node import MissionViewNode
from tests.operator.peers import say


def test_why_a_topic_cannot_be_used_is_known(graph: Any) -> None:
    view = graph.add(MissionViewNode)
    say(graph, 'battery_level', UInt8(data=50), QoSProfile(depth=1))
    say(graph, 'map', OccupancyGrid(data=[0, 0]))
    graph.until(lambda: {'battery_level', 'map'} <= view.state.health.silent.keys())
    assert 'another DURABILITY' in view.state.health.silent['battery_level']
    assert 'a map of 2 cells' in view.state.health.silent['map']


def test_that_the_observers_of_an_ended_mission_are_gone_is_no_fault(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    view = graph.add(MissionViewNode)
    status = say(graph, 'mission_status', MissionStatus(state='MOVE'))
    graph.until(lambda: view.state.health.nodes)
    names = ('mission_recorder', 'arm_controller')
    reports = DiagnosticArray(status=[DiagnosticStatus(name=name) for name in names])
    say(graph, '/diagnostics', reports, 10)
    graph.until(lambda: view.state.health.reports.keys() == set(names))
    monkeypatch.setattr(node_graph_watch, 'STALE_AFTER', 0.0)
    graph.until(lambda: [each.level for each in view.state.health.reports.values()] == [3, 3])
    graph.node.destroy_publisher(status)
    graph.until(lambda: view.state.health.reports.keys() == {'arm_controller'})
