"""A person stops the robot, or pauses its mission: it stands, and goes on afterwards."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from state_machines.ros import CallError, ServiceCaller
from surveillance_controllers.collision_monitor_node import CollisionMonitor
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion.nav2 import rest_of
from surveillance_operator.stop_button import StopButton
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import SENSOR_QOS
from surveillance_runtime.state_topics import OwnedTopic
from surveillance_runtime.stop_request import StopFile, StopRequest

from .test_navigation_motion import World, world  # noqa: F401 - a fixture


def press(graph: Any, stop: bool) -> str:
    caller = ServiceCaller(graph.node, SetBool, 'stop')
    return str(caller.call(SetBool.Request(data=stop), 60.0).message)


def open_text(node: Any, cause: tuple[str, ...]) -> str:
    """Return the text of an open incident of a node; empty where there is none."""
    return next((str(e.text) for e in node.incidents.updates() if tuple(e.cause) == cause), '')


class Joystick:
    """Commands the base past the mission, in an empty hall."""

    def __init__(self, graph: Any) -> None:
        self._commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
        self._scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
        self._told = graph.listen(Twist, 'cmd_vel_monitored', 1)

    def speed(self) -> float:
        self._scans.publish(LaserScan(angle_increment=0.02, range_max=8.0, ranges=[7.0] * 21))
        command = Twist()
        command.linear.x = 0.5
        self._commands.publish(command)
        return float(self._told[-1].linear.x) if self._told else math.nan


def test_a_stop_holds_whoever_commands_and_only_a_person_ends_it(
    graph: Any, tmp_path: Path
) -> None:
    kept = {'state_file': str(tmp_path / 'monitor.json')}
    monitor = graph.add(CollisionMonitor, kept)
    joystick = Joystick(graph)
    stopped = graph.listen(Bool, 'stopped', 1)
    graph.until(lambda: joystick.speed() == 0.5)
    assert press(graph, True) == 'the robot is stopped'
    graph.until(lambda: joystick.speed() == 0.0)
    assert ('person', 'stop') in monitor.incidents.open()
    # Nobody else's word counts, neither on the topic nor that of a node that begins anew.
    stranger = graph.add(PatrolNode, name='stranger')
    stranger.create_publisher(Bool, 'stopped', 1).publish(Bool(data=False))
    graph.remove(monitor)
    graph.add(CollisionMonitor, kept)
    graph.until(lambda: stopped and stopped[-1].data)
    for _try in range(20):
        assert joystick.speed() == 0.0
    assert press(graph, False) == 'the robot may move again'
    graph.until(lambda: joystick.speed() == 0.5)


def test_a_stop_stands_over_every_restart_and_says_by_whom_and_since_when(graph: Any) -> None:
    monitor = graph.add(CollisionMonitor)
    button = StopButton(graph.add(PatrolNode, name='mission_page'), owner='the guard')
    assert button.press(True) == 'the robot is stopped'
    graph.until(lambda: 'stopped by the guard at ' in open_text(monitor, ('person', 'stop')))
    graph.remove(monitor)
    monitor = graph.add(CollisionMonitor)
    assert 'stopped by the guard at ' in open_text(monitor, ('person', 'stop'))
    assert press(graph, False) == 'the robot may move again'
    graph.remove(monitor)
    assert ('person', 'stop') not in graph.add(CollisionMonitor).incidents.open()


def test_a_file_that_cannot_be_read_stops_the_robot(graph: Any, tmp_path: Path) -> None:
    kept = tmp_path / 'stop.json'
    kept.write_bytes(b'{"owner": "a", "rea\xff')
    monitor = graph.add(CollisionMonitor, {'state_file': str(kept)})
    assert f'{kept} cannot be read' in open_text(monitor, ('person', 'stop'))
    assert press(graph, False) == 'the robot may move again'
    assert not kept.exists()


def test_a_stop_that_cannot_be_kept_says_so_and_outlives_the_monitor_in_who_drives(
    graph: Any, tmp_path: Path
) -> None:
    (tmp_path / 'file').write_text('')
    kept = {'state_file': str(tmp_path / 'file' / 'stop.json')}
    monitor = graph.add(CollisionMonitor, kept)
    hold = Hold(graph.add(PatrolNode, name='motion_controller'))
    said = press(graph, True)
    assert said.startswith('the robot is stopped, but not over a restart: ')
    graph.until(lambda: hold.active)
    graph.remove(monitor)
    monitor = graph.add(CollisionMonitor, kept)
    graph.until(lambda: ('person', 'stop') in monitor.incidents.open())
    assert hold.active
    assert press(graph, False) == 'the robot may move again'
    graph.until(lambda: not hold.active)


def test_a_stop_while_the_monitor_is_dead_is_obeyed_by_who_drives_and_by_the_next_monitor(
    graph: Any,
) -> None:
    hold = Hold(graph.add(PatrolNode, name='motion_controller'))
    button = StopButton(graph.add(PatrolNode, name='console'))
    assert button.press(True).startswith('the robot stands: collision_monitor has not confirmed')
    assert hold.active
    monitor = graph.add(CollisionMonitor)
    graph.until(lambda: ('person', 'stop') in monitor.incidents.open())
    assert 'by console' in open_text(monitor, ('person', 'stop'))
    assert hold.active
    assert button.press(False) == 'the robot may move again'
    graph.until(lambda: not hold.active)


def test_a_stop_that_who_drives_alone_has_confirmed_outlives_its_death_too(graph: Any) -> None:
    drive = graph.add(PatrolNode, name='motion_controller')
    Hold(drive)
    console = graph.add(PatrolNode, name='console')
    button = StopButton(console, owner='the guard')
    assert button.press(True).startswith('the robot stands: collision_monitor has not confirmed')
    graph.drop(drive)
    graph.drop(console)
    monitor = graph.add(CollisionMonitor)
    assert 'stopped by the guard at ' in open_text(monitor, ('person', 'stop'))
    assert press(graph, False) == 'the robot may move again'
    graph.remove(monitor)
    assert ('person', 'stop') not in graph.add(CollisionMonitor).incidents.open()


def test_what_who_drives_has_kept_is_found_by_a_monitor_with_a_file_of_its_own(
    graph: Any, tmp_path: Path
) -> None:
    drive = graph.add(PatrolNode, name='motion_controller')
    Hold(drive)
    StopButton(graph.add(PatrolNode, name='console')).press(True)
    kept = {'state_file': str(tmp_path / 'monitor.json')}
    graph.drop(drive)
    monitor = graph.add(CollisionMonitor, kept)
    assert 'by console' in open_text(monitor, ('person', 'stop'))
    press(graph, False)
    graph.remove(monitor)
    assert ('person', 'stop') not in graph.add(CollisionMonitor, kept).incidents.open()


def test_while_the_disk_hangs_the_monitor_goes_on(
    graph: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked, answers, goes_on = threading.Event(), threading.Event(), StopFile.keep

    def hang(file: StopFile, request: StopRequest) -> str:
        asked.set()
        answers.wait()
        return goes_on(file, request)

    monkeypatch.setattr(StopFile, 'keep', hang)
    file = tmp_path / 'monitor.json'
    graph.add(CollisionMonitor, {'state_file': str(file)})
    joystick = Joystick(graph)
    graph.until(lambda: joystick.speed() == 0.5)
    try:
        said = press(graph, True)
        assert said.startswith('the robot is stopped, but not for sure over a restart')
        assert 'the disk has not answered' in said
        assert asked.is_set()
        graph.until(lambda: joystick.speed() == 0.0)
        assert 'the disk has not answered' in press(graph, False)
        graph.until(lambda: joystick.speed() == 0.5)
        press(graph, True)
        graph.until(lambda: joystick.speed() == 0.0)
    finally:
        answers.set()
    graph.until(file.exists)


@pytest.mark.parametrize('kind', [Twist, TwistStamped])
def test_who_drives_tells_the_base_to_stand_while_the_monitor_does_not_answer(
    graph: Any, kind: Any
) -> None:
    told = graph.listen(kind, 'cmd_vel_monitored', 1)
    hold = Hold(graph.add(PatrolNode, name='motion_controller'))
    StopButton(graph.add(PatrolNode, name='console')).press(True)
    graph.until(lambda: len(told) > 2)
    assert all(getattr(each, 'twist', each) == Twist() for each in told)
    monitor = graph.add(CollisionMonitor, {'robot.command_type': kind.__name__})
    graph.until(lambda: hold._taken_by is not None)
    graph.until(lambda: hold._halting.is_canceled())
    # It is none that commands the base, too.
    monitor._look_for_others()
    assert ('robot', 'second command') not in monitor.incidents.open()


def test_a_stop_that_nobody_hears_is_asked_again(graph: Any) -> None:
    button = StopButton(graph.add(PatrolNode, name='console'))
    with pytest.raises(CallError, match=r'nobody confirms it .* is asked again'):
        button.press(True)
    hold = Hold(graph.add(PatrolNode, name='motion_controller'))
    graph.until(lambda: hold.active)


def test_a_robot_without_a_monitor_is_released_by_who_drives_it(graph: Any) -> None:
    hold = Hold(graph.add(PatrolNode, name='motion_controller'))
    button = StopButton(graph.add(PatrolNode, name='console'))
    button.press(True)
    assert 'whether collision_monitor holds it is not known' in button.press(False)
    assert not hold.active


@pytest.mark.parametrize('speed', [5_000.0, -1e300])
def test_a_command_beyond_all_bounds_costs_no_more_than_another(graph: Any, speed: float) -> None:
    graph.add(CollisionMonitor)
    told = graph.listen(Twist, 'cmd_vel_monitored', 1)
    commands = graph.node.create_publisher(Twist, 'cmd_vel', 1)
    scans = graph.node.create_publisher(LaserScan, 'scan', SENSOR_QOS)
    command = Twist()
    command.linear.x, command.angular.z = speed, 1e-3 * speed

    def obeyed() -> bool:
        scans.publish(LaserScan(angle_increment=0.02, range_max=8.0, ranges=[7.0] * 21))
        commands.publish(command)
        return any(abs(each.linear.x) > 0.0 or abs(each.angular.z) > 0.0 for each in told)

    graph.until(obeyed)
    assert all(abs(each.linear.x) <= 1.0 and abs(each.angular.z) <= 20.0 for each in told)
    assert press(graph, True) == 'the robot is stopped'


def test_whoever_else_commands_the_base_is_named(graph: Any) -> None:
    monitor = graph.add(CollisionMonitor)
    stranger = graph.add(PatrolNode, name='stranger')
    publisher = stranger.create_publisher(Twist, 'cmd_vel_monitored', 1)
    cause = ('robot', 'second command')
    graph.until(lambda: '/stranger commands the base, too' in open_text(monitor, cause))
    stranger.destroy_publisher(publisher)
    graph.until(lambda: cause not in monitor.incidents.open())


@pytest.mark.parametrize('topic', ['stopped', 'paused'])
def test_a_robot_that_is_held_stands_and_then_ends_its_leg(
    world: World,  # noqa: F811
    topic: str,
) -> None:
    graph = world.graph
    owner = {'stopped': 'collision_monitor', 'paused': 'robot_behavior'}[topic]
    hold = OwnedTopic(graph.add(PatrolNode, name=owner), Bool, topic)
    path = world.compute((10.0, 8.0)).result.path
    ends: list[Any] = []
    begun = world.position
    thread = threading.Thread(target=lambda: ends.append(world.follow(path)))
    thread.start()
    graph.until(lambda: math.dist(world.position, begun) > 0.5)
    hold.publish(Bool(data=True))
    still = [world.position]

    def stands() -> bool:
        seen = len(world.truth)
        graph.until(lambda: len(world.truth) > seen + 20)
        still.append(world.position)
        return math.dist(still[-1], still[-2]) < 1e-3

    world.ask_until(stands)
    assert not ends
    assert math.dist(still[-1], begun) < math.dist((10.0, 8.0), begun) - 0.5
    # Longer than a drive waits for what is in the way, in the robot's time.
    before = world.truth[-1].header.stamp.sec
    graph.until(lambda: world.truth[-1].header.stamp.sec > before + 60)
    hold.publish(Bool(data=False))
    graph.until(lambda: ends)
    thread.join()
    assert ends[0].status == 'succeeded'
    assert world.position == pytest.approx((10, 8), abs=0.15)
    assert world.collisions[-1].data == 0


def test_what_is_left_of_a_path_begins_where_the_robot_is() -> None:
    path = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    left = rest_of(path, np.array([1.2, 0.1, 0.0]))
    assert left.tolist() == [[1.2, 0.1, 0.0], [2.0, 0.0, 0.0]]
    assert len(rest_of(path, np.array([2.0, 0.0, 0.0]))) == 2
