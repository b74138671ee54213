"""Services that make things go wrong in the simulated place."""

from __future__ import annotations

import math
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

from surveillance_interfaces.msg import DoorStates
from surveillance_interfaces.srv import (
    DrainBattery,
    PlaceObstacle,
    PushRobot,
    RemoveObstacle,
    SetDoor,
    SetMarker,
    SlipOdometry,
)
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS

from .simulators import ask, simulator


def test_doors_and_obstacles_are_seen_by_the_lidar(graph: Any) -> None:
    simulator(graph, **{'lidar.noise': 0.0})
    doors = graph.listen(DoorStates, 'door_states', STATE_QOS)
    scans = graph.listen(LaserScan, 'scan', SENSOR_QOS)

    def ahead(distance: float) -> bool:
        return bool(scans) and scans[-1].ranges[180] == pytest.approx(distance, abs=1e-3)

    graph.until(lambda: ahead(4.95))
    assert ask(graph, SetDoor, 'set_door', door='D', open=False).success
    graph.until(lambda: ahead(1.95) and list(doors[-1].closed) == ['D'])
    answer = ask(graph, PlaceObstacle, 'place_obstacle', name='box', x=2.0, y=1.0, radius=0.25)
    assert answer.success
    graph.until(lambda: ahead(0.75))
    assert ask(graph, RemoveObstacle, 'remove_obstacle', name='box').success
    assert ask(graph, SetDoor, 'set_door', door='D', open=True).success
    graph.until(lambda: ahead(4.95) and list(doors[-1].open) == ['D'])


def test_a_push_moves_the_robot_and_a_slip_the_odometry(graph: Any) -> None:
    simulator(graph)
    truth = graph.listen(PoseStamped, 'ground_truth', SENSOR_QOS)
    odometry = graph.listen(Odometry, 'odom', SENSOR_QOS)
    assert 'pushed by 0.50 m' in ask(graph, PushRobot, 'push_robot', dx=0.5).message
    graph.until(lambda: truth and truth[-1].pose.position.x == pytest.approx(1.5))
    assert odometry[-1].pose.pose.position.x == 1.0
    assert ask(graph, SlipOdometry, 'slip_odometry', dx=0.2).success
    graph.until(lambda: odometry[-1].pose.pose.position.x == pytest.approx(1.2))
    assert truth[-1].pose.position.x == pytest.approx(1.5)


def test_the_battery_hears_of_a_drain(graph: Any) -> None:
    simulator(graph)
    drained = graph.listen(Float32, 'battery_drain')
    graph.until(lambda: graph.node.count_publishers('battery_drain'))
    assert ask(graph, DrainBattery, 'drain_battery', percent=30.0).success
    graph.until(lambda: drained)
    assert drained[0].data == 30.0


def test_markers_break_and_move(graph: Any) -> None:
    simulator(graph)
    assert ask(graph, SetMarker, 'set_marker', name='m1', state='broken').success
    moved = ask(graph, SetMarker, 'set_marker', name='m2', state='moved', id=4, x=1.0, z=1.0)
    assert moved.message == 'marker m2 with id 4 hangs at (1.00, 0.00)'


@pytest.mark.parametrize(
    ('kind', 'service', 'request_fields', 'message'),
    [
        (SetDoor, 'set_door', {'door': 'X'}, "there is no door 'X': expected 'D'"),
        (PlaceObstacle, 'place_obstacle', {'name': 'b'}, "obstacle 'b': radius 0 m"),
        (RemoveObstacle, 'remove_obstacle', {'name': 'b'}, "there is no obstacle 'b'"),
        (DrainBattery, 'drain_battery', {'percent': 101.0}, 'percent 101: expected 0 to 100'),
        (PushRobot, 'push_robot', {'dx': math.nan}, 'expected -1000 to 1000, got nan'),
        (PushRobot, 'push_robot', {'dx': 1.7e308}, 'expected -1000 to 1000, got 1.7e+308'),
        (SlipOdometry, 'slip_odometry', {'dyaw': math.inf}, 'expected -1000 to 1000, got '),
        (SetMarker, 'set_marker', {'name': 'm1', 'state': 'lost'}, "marker state 'lost'"),
        (
            SetMarker,
            'set_marker',
            {'name': 'm1', 'state': 'moved', 'id': 100},
            'marker id 100: DICT_5X5_100 holds ids 0 to 99',
        ),
    ],
)
def test_a_wrong_request_is_refused_in_one_line(
    graph: Any, kind: Any, service: str, request_fields: dict[str, Any], message: str
) -> None:
    simulator(graph)
    answer = ask(graph, kind, service, **request_fields)
    assert not answer.success
    assert answer.message.startswith(message)
