"""The state of a running mission, as whoever watches keeps it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, UInt8

from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import (
    Decision,
    DoorStates,
    MissionStatus,
    PlaceCoverage,
    PlaceCoverages,
)
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_operator.mission_subscriber import MissionSubscriber
from surveillance_operator.mission_view_node import MissionViewNode
from surveillance_operator.page_state import PARTS
from surveillance_runtime.conversions import cloud_from_points
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from tests.operator.peers import PLACE, Planner, Watcher, pose, say


def test_who_leaves_a_mission_hears_nothing_more(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A fleet's page leaves robots that go: their topics would come in for ever."""
    watcher = graph.add(Watcher)
    publisher = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    publisher.publish(pose(1.0, 0.0))
    graph.until(lambda: watcher.subscriber.state.sensors.pose == (1.0, 0.0, 0.0))
    watcher.subscriber.leave()
    graph.until(lambda: publisher.get_subscription_count() == 0)
    assert graph.node.count_subscribers('battery_level') == 0
    publisher.publish(pose(2.0, 0.0))
    assert watcher.subscriber.state.sensors.pose == (1.0, 0.0, 0.0)


def test_it_gathers_what_topics_ontology_and_parameters_tell(graph: Any) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, parameters=PLACE)
    planner = graph.add(Planner, parameters={'doors.D': [3.0, 1.0, 0.0, 1.0]})
    view = graph.add(MissionViewNode)

    grid = OccupancyGrid(data=[0, 100, -1, 0, 0, 0])
    grid.info.width, grid.info.height, grid.info.resolution = 3, 2, 0.5
    say(graph, 'map', grid)
    say(graph, 'mission_status', MissionStatus(machine='surveillance', state='MOVE', place='A'))
    say(graph, 'decision', Decision(sequence=4, from_place='A', place='B', rule='URGENT'))
    say(graph, 'battery_level', UInt8(data=15))
    say(graph, 'battery_low', Bool(data=True))
    say(graph, 'door_states', DoorStates(closed=['D']))
    say(graph, 'obstacles', cloud_from_points(np.array([[2.0, 1.0]])))
    pose = PoseWithCovarianceStamped()
    pose.pose.pose.position.x, pose.pose.pose.orientation.w = 1.5, 1.0
    say(graph, 'amcl_pose', pose)

    graph.until(
        lambda: (
            view.state.task.mode == 'SIMULATED'
            and view.state.place.positions == {'A': (1.0, 1.0), 'B': (5.0, 1.0)}
            and view.state.place.visited_at.keys() == {'A', 'B'}
            and view.state.place.links
            and view.state.sensors.pose
            and view.state.place.doors
            and view.state.sensors.obstacles is not None
            and view.state.place.grid is not None
            and view.state.task.battery_low
            and 'planner_controller' in view.state.health.nodes
        )
    )
    seen = view.see()['']
    assert seen.task.battery == 15.0
    assert seen.task.status is not None
    assert seen.task.status.state == 'MOVE'
    assert seen.task.decision is not None
    assert (seen.task.decision_number, seen.task.decision.place) == (4, 'B')
    assert seen.place.grid is not None
    assert seen.place.grid.cells.tolist() == [[0, 100, -1], [0, 0, 0]]
    assert seen.place.doors == {'D': False}
    assert seen.place.door_lines['D'] == pytest.approx((2.5, 1.0, 3.5, 1.0))
    assert seen.sensors.obstacles is not None
    assert seen.sensors.obstacles.tolist() == [[2.0, 1.0]]
    assert seen.sensors.pose == (1.5, 0.0, 0.0)
    assert seen.sensors.trail.tolist() == [[1.5, 0.0]]
    assert seen.place.visited_at == {'A': 0.0, 'B': 0.0}  # never yet
    assert 'door D closed' in [each.text for each in seen.notices]

    graph.remove(planner)
    graph.until(lambda: view.state.health.ended == {'planner_controller'})
    assert ('planner_controller ended') in view.state.notices[-1].text


def test_what_of_each_place_was_in_view_reaches_the_page(graph: Any) -> None:
    watcher = graph.add(Watcher)
    seen = {'A': 0.456, 'B': 1.0, 'unknown': np.nan}
    told = [PlaceCoverage(place=name, share=share) for name, share in seen.items()]
    say(graph, 'coverage', PlaceCoverages(places=told))
    graph.until(lambda: watcher.subscriber.state.place.coverage)
    assert PARTS['coverage'](watcher.subscriber.state) == {'A': 0.46, 'B': 1.0}


def test_where_nobody_estimates_the_pose_the_feedback_of_the_drive_tells_it(graph: Any) -> None:
    view = graph.add(MissionViewNode)
    kind = FollowPath.Impl.FeedbackMessage
    drive = graph.node.create_publisher(kind, 'follow_path/_action/feedback', 1)
    graph.until(drive.get_subscription_count)
    for x in (1.0, 2.0):
        message = kind()
        message.feedback.position.x = message.feedback.position.y = x
        drive.publish(message)
        graph.until(lambda x=x: view.state.sensors.pose and view.state.sensors.pose[0] == x)
    assert view.state.sensors.pose == pytest.approx((2.0, 2.0, np.pi / 4))


def test_the_next_mission_begins_with_an_empty_picture(graph: Any) -> None:
    view = graph.add(MissionViewNode, namespace='alone')
    status = say(graph, '/alone/mission_status', MissionStatus(state='FIRST'))
    battery = say(graph, '/alone/battery_level', UInt8(data=50))
    clock = say(graph, '/clock', Clock(clock=Time(sec=100)))
    graph.until(lambda: view.state.task.battery == 50 and view.state.health.nodes)
    graph.until(lambda: view.see()[''].now == 100.0)
    for publisher in (status, battery, clock):
        graph.node.destroy_publisher(publisher)
    graph.until(lambda: not view.state.health.nodes)
    frozen = view.see()['']
    assert frozen.task.status is not None
    assert frozen.task.status.state == 'FIRST'
    assert view.see()[''].now == frozen.now
    reports = say(graph, '/diagnostics', DiagnosticArray(status=[DiagnosticStatus(name='x')]), 10)

    def reported() -> bool:  # an observer of the mission, which goes on
        reports.publish(DiagnosticArray(status=[DiagnosticStatus(name='x')]))
        return 'x' in view.state.health.reports

    graph.until(reported)
    assert view.see()[''].task.status == frozen.task.status
    assert view.see()[''].now == 100.0  # no wait grows by the time of day

    say(graph, '/alone/mission_status', MissionStatus(state='SECOND'))
    graph.until(lambda: view.state.task.status and view.state.task.status.state == 'SECOND')
    assert view.state.task.battery is None
    assert view.state.history.battery == ()
    assert view.see()[''].now > 1e9
    assert any('waiting for the next mission' in each.text for each in view.state.notices)


def test_nodes_of_one_process_follow_the_mission_together(graph: Any) -> None:
    first, second = graph.add(PatrolNode, name='first'), graph.add(PatrolNode, name='second')
    shared = MissionSubscriber.of_process(first)
    assert MissionSubscriber.of_process(second) is shared
    first.stop()
    assert MissionSubscriber.of_process(second) is not shared
