"""A topic that a robot needs and does not hear is named, and why what comes is of no use."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from surveillance_runtime.alarms import SILENT_AFTER
from surveillance_runtime.graph_check import PATIENCE, InputWatch
from surveillance_runtime.incidents import Incidents
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.profile.check_up import awaited
from surveillance_runtime.profile.record import Frames, RobotProfile
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.sensing.sensors import REPEATED, OdometryReader
from surveillance_runtime.sensing.silence import SensorWatch, SilenceWatch
from surveillance_runtime.sensing.transforms import ScanReader


def stream(topic: str) -> Any:
    return SimpleNamespace(topic=topic, came_at=None, heard_at=None, problem='')


def test_a_silent_topic_is_named_once_until_it_speaks() -> None:
    lines: list[str] = []
    scan, odom = stream('/scan'), stream('/odom')
    silence = SilenceWatch(Incidents(lambda told: lines.append(told.words())), (scan, odom))
    # What never came is told elsewhere, once.
    silence.look(-1.0)
    assert not lines
    scan.came_at = scan.heard_at = 0.0
    for second in range(30):
        odom.came_at = odom.heard_at = float(second)
        silence.look(float(second))
    assert lines == [
        'incident [topic /scan, alarm]: nothing is published on /scan: the robot cannot drive'
    ]
    scan.came_at = scan.heard_at = odom.came_at = odom.heard_at = 31.0
    silence.look(31.0)
    assert lines[1:] == ['incident [topic /scan, over]: /scan is published again']
    silence.look(31.0 + SILENT_AFTER - 1.0)
    silence.look(1000.0)
    assert not lines[2:], 'nobody spun the node meanwhile'
    silence.look(1001.0)
    assert {line.split(',')[0] for line in lines[2:]} == {
        'incident [topic /odom',
        'incident [topic /scan',
    }


def test_what_comes_and_is_of_no_use_is_not_called_silence() -> None:
    lines: list[str] = []
    scan = stream('/scan')
    silence = SilenceWatch(Incidents(lambda told: lines.append(told.words())), (scan,))
    scan.heard_at, scan.came_at, scan.problem = 0.0, 9.9, 'the lidar is covered'
    for now in (8.0, 10.0, 29.0, 30.0):
        silence.look(now)
    assert [line.partition(']: ')[2] for line in lines] == [
        'nothing of use comes on /scan (the lidar is covered): the robot cannot drive',
        'nothing is published on /scan: the robot cannot drive',
    ]


@pytest.mark.parametrize('fault', ['covered', 'repeated'])
def test_a_lidar_that_is_of_no_use_from_the_beginning_is_told_with_the_reason(
    graph: Any, fault: str
) -> None:
    said = graph.said()
    node = graph.add(PatrolNode, {'lidar_mounts': [0.0] * 4}, name='driving')
    lidar = ScanReader(node, 0.2)
    seen: list[Any] = []
    lidar.subscribe(lambda *heard: seen.append(heard))
    odometry: Any = stream('/odom')
    odometry.heard_at = 0.0
    watch = SensorWatch(node, Frames(), lidar.streams, odometry)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    message = LaserScan(angle_increment=0.1, range_max=8.0, ranges=[1.0] * 20)
    if fault == 'covered':
        message.ranges = [0.0] * 20
    message.header.stamp = Time(sec=5)

    def told() -> bool:
        scans.publish(message)
        watch._inputs._silent['/scan'] += 4.0
        lidar.streams['scan'].heard_at = None
        return any('/scan: what comes is of no use: ' in line for line in said)

    graph.until(told)
    reason = 'less than 5% of the rays' if fault == 'covered' else REPEATED
    assert any(reason in line for line in said)
    assert len(seen) == (0 if fault == 'covered' else 1)
    assert not any('nothing came for' in line for line in said)


def test_time_in_which_nobody_spun_the_node_is_no_silence(graph: Any) -> None:
    node = graph.add(PatrolNode, name='driving')
    odom = next(each for each in awaited(RobotProfile()) if each.topic == '/odom')
    clock = [0.0]
    watch = InputWatch(node, [odom], lambda: ['/odom'], now=lambda: clock[0])

    def told_at(now: float) -> bool:
        clock[0] = now
        watch._look()
        return bool(node.incidents.open())

    # The executor begins late, and later stands still for a minute: both times it looks before it
    # takes what waits.
    assert not told_at(4.6)
    assert not told_at(66.6)
    assert told_at(66.6 + PATIENCE)


def test_a_publisher_that_says_nothing_is_told_of_once(graph: Any) -> None:
    said = graph.said()
    node = graph.add(PatrolNode, name='driving')
    odom = next(each for each in awaited(RobotProfile()) if each.topic == '/odom')
    graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)
    graph.until(lambda: node.count_publishers('/odom') == 1)
    clock = [0.0]
    watch = InputWatch(node, [odom], lambda: ['/odom'], now=lambda: clock[0])
    for step in range(20):
        clock[0] = 2.0 * step
        watch._look()
    node.get_logger().info('the last word')  # each line of a node comes after those before it
    graph.until(lambda: any('the last word' in line for line in said))
    assert sum('nothing came for' in line for line in said) == 1, 'how long by now is no news'


def test_odometry_that_is_no_number_is_told_as_such(graph: Any) -> None:
    node = graph.add(PatrolNode, name='driving')
    poses: list[Any] = []
    reader = OdometryReader(node, lambda pose, at: poses.append((pose, at)))
    publisher = graph.node.create_publisher(Odometry, 'odom', SENSOR_QOS)
    bad = Odometry()
    bad.pose.pose.position.x = float('nan')

    def refused() -> bool:
        publisher.publish(bad)
        return 'not finite' in reader.stream.problem

    graph.until(refused)
    assert reader.stream.heard_at is None
    assert not poses
    good = Odometry()
    graph.until(lambda: publisher.publish(good) or bool(poses))
    assert reader.stream.problem == ''
    assert poses[0][1] > 1e9  # without a stamp it counts from when it came
