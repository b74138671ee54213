"""Docking by a docking server that answers as Jazzy's does."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import BatteryState

from floor_plans import Station
from state_machines.ros import CallInterruptedError, GoalEnd, UnavailableError
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.motion import docking as docking_motion
from surveillance_controllers.motion import nav2 as nav2_motion
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion.holding import Hold
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.spin_in_place import bearing_of
from tests.controllers.nav2_servers import PATH, Run, Servers, result

DOCK = (3.0, 4.0, 1.0)
ASKED_AGAIN = 3


class Drive:
    """A motion that drives as it is asked, and is where it is told to be."""

    map_frame = 'map'

    def __init__(self, servers: Servers, node: Any, at: tuple[float, float, float] | None) -> None:
        self.servers, self.pose, self.hold = servers, at, Hold(node)
        self.looked = 0

    def follow(self, path: Any, run: Any, report: Any) -> Any:
        self.servers.asked.append(('drive', path))
        self.pose = (float(path[-1][0]), float(path[-1][1]), 0.0)
        return path[-1]

    def place_reached(self, goal: Any, end: Any) -> str:
        raise AssertionError('a drive to a dock asks for no place')

    def look_around(self, run: Any) -> None:
        self.looked += 1


class Docked:
    """A robot with a dock at `DOCK`, and what it is told."""

    def __init__(self, graph: Any, servers: Servers, at: Any = DOCK, **settings: Any) -> None:
        self.node = graph.add(PatrolNode, name='motion_controller')
        self.drive = Drive(servers, self.node, at)
        given: dict[str, Any] = {'dock_type': 'charger', 'navigator': 'nav2', 'peer_timeout': 60.0}
        stations = {'C2': Station((90.0, 0.0, 0.0)), 'E': Station(DOCK)}
        asked = MotionSettings(stations=stations, **(given | settings))
        self.motion = docking_motion.DockingMotion(self.node, self.drive, asked)
        self.run = Run()

    def charges(self, status: int) -> None:
        self.motion._on_battery(BatteryState(power_supply_status=status))

    def go(self, path: Any) -> Any:
        return self.motion.follow(path, self.run, lambda _at: None)

    @property
    def incidents(self) -> list[str]:
        return [f'{each.text}; {each.action}' for each in self.node.incidents.updates()]


CHARGING = BatteryState.POWER_SUPPLY_STATUS_CHARGING
AWAY = PATH[::-1]


def undocking(error_code: int) -> GoalEnd:
    """As Jazzy's server aborts; without an error code it knows of no dock to leave."""
    return GoalEnd('aborted', result('UndockRobot', error_code=error_code, success=not error_code))


def docking(error_code: int) -> GoalEnd:
    return GoalEnd('aborted', result('DockRobot', error_code=error_code, success=False))


def test_a_robot_that_begins_in_its_dock_undocks_before_it_drives(
    graph: Any, servers: Servers
) -> None:
    Docked(graph, servers).go(AWAY)
    assert servers.names == ['undock_robot', 'drive']
    assert servers.asked[0][1].dock_type == 'charger'


def test_a_robot_that_charges_and_does_not_know_where_it_is_undocks_first(
    graph: Any, servers: Servers
) -> None:
    robot = Docked(graph, servers, None)
    robot.charges(CHARGING)
    robot.go(AWAY)
    assert servers.names == ['undock_robot', 'drive']


def test_a_robot_that_begins_elsewhere_drives_at_once(graph: Any, servers: Servers) -> None:
    Docked(graph, servers, (0.0, 0.0, 0.0)).go(AWAY)
    assert servers.names == ['drive']


def test_undocking_that_fails_is_tried_again_and_the_robot_does_not_move(
    graph: Any, servers: Servers
) -> None:
    servers.ends['undock_robot'] = undocking(905)
    robot = Docked(graph, servers)
    for mission in (1, 2):
        with pytest.raises(MotionFailedError, match=r'undocking: .*905 FAILED_TO_CONTROL'):
            robot.go(AWAY)
        assert servers.names == ['undock_robot'] * ASKED_AGAIN * mission
    assert any('free the robot' in line for line in robot.incidents), robot.incidents
    servers.ends['undock_robot'] = GoalEnd('succeeded', SimpleNamespace(success=True))
    robot.go(AWAY)
    assert servers.names[-2:] == ['undock_robot', 'drive']
    assert not robot.incidents


def test_a_type_of_dock_that_the_server_does_not_know_is_asked_for_once(
    graph: Any, servers: Servers
) -> None:
    servers.ends['undock_robot'] = undocking(902)
    robot = Docked(graph, servers)
    with pytest.raises(MotionFailedError, match='902 DOCK_NOT_VALID'):
        robot.go(AWAY)
    assert servers.names == ['undock_robot']
    assert 'dock_plugins' in robot.incidents[0]


def test_a_server_that_was_started_again_is_told_of_the_dock_that_the_robot_is_in(
    graph: Any, servers: Servers
) -> None:
    servers.ends['undock_robot'] = [undocking(0), GoalEnd('succeeded', result('UndockRobot'))]
    servers.ends['dock_robot'] = GoalEnd('succeeded', result('DockRobot'))
    robot = Docked(graph, servers)
    robot.charges(CHARGING)
    robot.go(AWAY)
    assert servers.names == ['undock_robot', 'dock_robot', 'undock_robot', 'drive']
    assert servers.asked[1][1].navigate_to_staging_pose is False


def test_a_robot_beside_a_dock_that_the_server_does_not_see_drives(
    graph: Any, servers: Servers
) -> None:
    servers.ends |= {'undock_robot': undocking(0), 'dock_robot': docking(904)}
    robot = Docked(graph, servers)
    robot.go(AWAY)
    assert servers.names == ['undock_robot', 'dock_robot', 'drive']


def test_a_robot_that_charges_is_not_driven_on_the_word_of_the_server_alone(
    graph: Any, servers: Servers
) -> None:
    servers.ends |= {'undock_robot': undocking(0), 'dock_robot': docking(904)}
    robot = Docked(graph, servers)
    robot.charges(CHARGING)
    with pytest.raises(MotionFailedError, match='does not know that the robot is in a dock'):
        robot.go(AWAY)
    assert 'drive' not in servers.names


def test_the_server_brings_the_robot_to_its_staging_pose(graph: Any, servers: Servers) -> None:
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    end = robot.go(PATH)
    (_, way), (name, goal) = servers.asked
    assert name == 'dock_robot'
    assert goal.navigate_to_staging_pose is True
    assert (goal.dock_type, goal.use_dock_id) == ('charger', False)
    assert goal.dock_pose.pose.position.x == DOCK[0]
    assert way[-1] == pytest.approx([3.0, 4.0 - docking_motion.SERVER_DRIVES, 0.0])
    assert tuple(end[:2]) == DOCK[:2]


@pytest.mark.parametrize('settings', [{'dock_staging': 0.9}, {'navigator': 'own'}])
def test_where_the_server_does_not_drive_the_robot_is_brought_before_its_dock(
    graph: Any, servers: Servers, settings: Any
) -> None:
    robot = Docked(graph, servers, (0.0, 0.0, 0.0), **settings)
    robot.go(PATH)
    drive, turn, (_, goal) = servers.asked
    staging = settings.get('dock_staging', docking_motion.DEFAULT_STAGING)
    x, y, yaw = DOCK
    expected = [x - staging * np.cos(yaw), y - staging * np.sin(yaw)]
    assert drive[1][-1][:2] == pytest.approx(expected)
    assert bearing_of(turn[1].tolist()) == pytest.approx(yaw)
    assert goal.navigate_to_staging_pose is False


def test_a_docked_robot_neither_looks_around_nor_docks_again(graph: Any, servers: Servers) -> None:
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    robot.go(PATH)
    robot.drive.pose = DOCK
    robot.motion.look_around(robot.run)
    robot.go(PATH)
    assert servers.names == ['drive', 'dock_robot']
    assert robot.drive.looked == 0
    robot.go(AWAY)
    assert servers.names[2:] == ['undock_robot', 'drive']


def test_after_charging_was_not_seen_the_robot_may_be_in_the_dock(
    graph: Any, servers: Servers
) -> None:
    servers.ends['dock_robot'] = docking(906)
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    with pytest.raises(MotionFailedError, match=r'docking: .*906 FAILED_TO_CHARGE'):
        robot.go(PATH)
    assert servers.names == ['drive'] + ['dock_robot'] * ASKED_AGAIN
    assert "the dock's contacts" in robot.incidents[0]
    robot.drive.pose = DOCK
    robot.go(AWAY)
    assert servers.names[-2:] == ['undock_robot', 'drive']


@pytest.mark.parametrize(('code', 'asked'), [(901, 1), (902, 1), (903, 3), (904, 3), (999, 3)])
def test_what_hope_an_error_code_leaves_decides_on_another_try(
    graph: Any, servers: Servers, code: int, asked: int
) -> None:
    servers.ends['dock_robot'] = docking(code)
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    with pytest.raises(MotionFailedError, match=f'error code {code} '):
        robot.go(PATH)
    assert servers.names == ['drive'] + ['dock_robot'] * asked
    assert robot.run.pauses[::2] == [5.0, 10.0][: asked - 1]


def test_a_server_that_is_not_there_is_waited_for_with_a_reason(
    graph: Any, servers: Servers
) -> None:
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    servers.ends['dock_robot'] = [
        UnavailableError('action dock_robot: no server'),
        GoalEnd('succeeded', result('DockRobot')),
    ]
    servers.is_there = False
    said: list[str] = []

    def sleep(seconds: float) -> bool:
        said.extend(robot.incidents)
        robot.run.time += seconds
        servers.is_there = robot.run.time > 30.0
        return True

    robot.run.sleep = sleep  # type: ignore[method-assign]
    robot.go(PATH)
    assert servers.names == ['drive', 'dock_robot', 'dock_robot']
    assert 'no server; docking_server is not there: the patrol waits for it' in said[0]
    assert not robot.incidents


def test_a_robot_that_a_person_pushed_away_from_its_dock_drives_at_once(
    graph: Any, servers: Servers
) -> None:
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    robot.go(PATH)
    robot.drive.pose = (1.0, 1.0, 0.0)
    robot.go(AWAY)
    assert servers.names == ['drive', 'dock_robot', 'drive']
    # And back into it by hand.
    robot.drive.pose = DOCK
    robot.charges(CHARGING)
    robot.go(AWAY)
    assert servers.names[3:] == ['undock_robot', 'drive']


def test_a_way_to_elsewhere_does_not_dock(graph: Any, servers: Servers) -> None:
    Docked(graph, servers, (9.0, 9.0, 0.0)).go(np.array([[0.0, 0, 0], [9, 9, 0]]))
    assert servers.names == ['drive']


def test_a_robot_that_is_to_stand_is_docked_when_it_may_move(
    graph: Any, servers: Servers, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = Docked(graph, servers, (0.0, 0.0, 0.0))
    hold = robot.drive.hold
    ends = [hold.begun.set, lambda: None]

    def run(goal: Any, *, interrupt: Any, **_more: Any) -> GoalEnd:
        servers.asked.append(('dock_robot', goal))
        ends.pop(0)()
        if interrupt.is_set():
            hold.begun.clear()
            raise CallInterruptedError('interrupted')
        return GoalEnd('succeeded', result('DockRobot'))

    monkeypatch.setattr(robot.motion._docker._caller, 'run', run)
    robot.go(PATH)
    assert servers.names == ['drive', 'dock_robot', 'dock_robot']


def test_without_their_messages_both_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, 'nav2_msgs', None)
    monkeypatch.setitem(sys.modules, 'nav2_msgs.action', None)
    none: Any = None
    with pytest.raises(ParameterError, match=r'navigator: got nav2.* install ros-jazzy-nav2-msgs'):
        nav2_motion.Nav2Motion(none, none, none, MotionSettings())
    with pytest.raises(ParameterError, match=r'docking: .* install ros-jazzy-nav2-msgs'):
        docking_motion.DockingMotion(none, none, MotionSettings())
