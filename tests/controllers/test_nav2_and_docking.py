"""Moving by Nav2 and docking by a docking server, with both servers scripted.

Their messages, nav2_msgs, come with them and are no wheel, so classes stand in for the types here;
`tests/mission/test_nav2_mission.py` has the types themselves.
"""

from __future__ import annotations

import sys
import time
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import BatteryState
from tf2_msgs.msg import TFMessage

from floor_plans import Station
from state_machines import Interrupt
from state_machines.ros import CallInterruptedError, GoalCaller, GoalEnd, UnavailableError
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.motion import docking as docking_motion
from surveillance_controllers.motion import nav2 as nav2_motion
from surveillance_controllers.motion import nav2_goals
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion.holding import Hold
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.conversions import (
    map_message,
    point_messages,
    pose_estimate,
    pose_message,
)
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.spin_in_place import bearing_of, spin_path
from tests.nav2_definitions import ACTIONS, stand_in

PATH = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])
TYPES = {name: stand_in(name) for name in ACTIONS}


def result(action: str, **fields: Any) -> Any:
    return TYPES[action].Result(**fields)


class Servers:
    """Action servers that answer as told and keep what they were asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Any]] = []
        self.ends: dict[str, Any] = {}
        self.states: dict[str, list[str]] = {}
        self.is_there = True
        self.feedback: list[Any] = []

    def caller(self, _node: Any, _type: Any, name: str) -> Any:
        def run(goal: Any, *, on_feedback: Any = None, **_deadlines: Any) -> GoalEnd:
            self.asked.append((name, goal))
            for message in self.feedback if on_feedback else ():
                on_feedback(message)
            end = self.ends.get(name, GoalEnd('succeeded', SimpleNamespace(success=True)))
            if isinstance(end, list):
                end = end.pop(0) if len(end) > 1 else end[0]
            if isinstance(end, Exception):
                raise end
            return end

        return SimpleNamespace(run=run, is_ready=lambda: self.is_there)

    def states_of(self, _node: Any, _type: Any, name: str) -> Any:
        """Answers get_state of one node of Nav2 by `states`, else as a node that is not there."""
        server = name.partition('/')[0]

        def call(_request: Any, _timeout: float, _interrupt: Any) -> Any:
            states = self.states[server]
            label = states.pop(0) if len(states) > 1 else states[0]
            return SimpleNamespace(current_state=SimpleNamespace(label=label))

        return SimpleNamespace(is_ready=lambda: server in self.states, call=call)

    @property
    def names(self) -> list[str]:
        """What was asked, by the names of the actions."""
        return [name for name, _ in self.asked]


@pytest.fixture
def servers(monkeypatch: pytest.MonkeyPatch) -> Servers:
    servers = Servers()
    package, module = ModuleType('nav2_msgs'), ModuleType('nav2_msgs.action')
    vars(package)['action'] = module
    vars(module).update(TYPES)
    monkeypatch.setitem(sys.modules, 'nav2_msgs', package)
    monkeypatch.setitem(sys.modules, 'nav2_msgs.action', module)
    monkeypatch.setattr(nav2_goals, 'GoalCaller', servers.caller)
    monkeypatch.setattr(nav2_goals, 'ServiceCaller', servers.states_of)
    return servers


class Run:
    """A goal's run whose time passes when somebody sleeps."""

    def __init__(self) -> None:
        self.interrupt = Interrupt()
        self.time = 0.0
        self.pauses: list[float] = []

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> bool:
        self.time += seconds
        self.pauses.append(seconds)
        return not self.interrupt.is_set()


@pytest.fixture
def run() -> Run:
    return Run()


class Recorder:
    """Keeps the places that it is told."""

    def __init__(self) -> None:
        self.places: list[Any] = []

    def tell(self, place: str) -> None:
        self.places.append(place)


class Knowledge:
    """Knows where the places are at once."""

    def __init__(self, positions: dict[str, Any]) -> None:
        self._positions = positions

    def assume(self, positions: dict[str, Any]) -> None:
        pass

    def follow_places(self, take: Any) -> None:
        take(self._positions)


def nav2(graph: Any, recorder: Any = None, flat: Any = None, **more: Any) -> nav2_motion.Nav2Motion:
    settings: Any = SimpleNamespace(peer_timeout=60.0)
    knowledge: Any = Knowledge({} if flat is None else flat.POSITIONS)
    doors = {} if flat is None else {'doors.D': [4.05, 1.5, np.pi / 2, 1.0]}
    taken: Any = recorder or Recorder()
    node = graph.add(PatrolNode, doors | more, name='motion_controller')
    return nav2_motion.Nav2Motion(node, knowledge, taken, settings)


def at(x: float, y: float) -> Any:
    position = SimpleNamespace(x=x, y=y, z=0.0)
    return SimpleNamespace(current_pose=SimpleNamespace(pose=SimpleNamespace(position=position)))


def test_nav2_is_told_in_the_frame_that_the_profile_names(
    graph: Any, servers: Servers, run: Any
) -> None:
    nav2(graph, **{'robot.frames.map': 'office'}).follow(PATH, run, lambda _at: None)
    ((_, goal),) = servers.asked
    assert {pose.header.frame_id for pose in goal.poses} == {'office'}


def test_nav2_is_led_along_the_path(graph: Any, servers: Servers, run: Any) -> None:
    servers.feedback = [at(1, 0), at(2.9, 3.9), at(float('nan'), 4.0)]
    seen: list[Any] = []
    end = nav2(graph).follow(PATH, run, seen.append)
    ((name, goal),) = servers.asked
    assert name == 'navigate_through_poses'
    assert all(pose.header.frame_id == 'map' for pose in goal.poses)
    points = [(pose.pose.position.x, pose.pose.position.y) for pose in goal.poses]
    expected = [(1.4, 0), (2.8, 0), (3, 1.2), (3, 2.6), (3, 4)]
    assert np.array(points) == pytest.approx(np.array(expected))
    assert goal.poses[-1].pose.orientation.z == pytest.approx(np.sin(np.pi / 4))
    assert [tuple(p) for p in seen] == [(1, 0, 0), (2.9, 3.9, 0)]
    assert tuple(end) == (2.9, 3.9, 0)


def test_a_path_around_the_world_is_led_through_a_bounded_number_of_poses(
    graph: Any, servers: Servers, run: Any
) -> None:
    far = np.array([[0.0, 0.0, 0.0], [2e7, 0.0, 0.0]])
    nav2(graph).follow(far, run, lambda _: None)
    poses = servers.asked[-1][1].poses
    assert len(poses) == nav2_motion.MOST_POSES
    assert poses[-1].pose.position.x == 2e7


def test_feedback_comes_once_a_period_however_often_nav2_tells_it(
    graph: Any, servers: Servers, in_background: Any
) -> None:
    servers.feedback = [at(0.001 * step, 0) for step in range(500)]
    parameters = {'execution_mode': 'SIMULATED', 'navigator': 'nav2', 'feedback_period': 60.0}
    graph.add(MotionController, parameters)
    seen: list[float] = []
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    goal = FollowPath.Goal(path=point_messages(PATH))
    ended = in_background(
        lambda: caller.run(
            goal, accept_timeout=60.0, on_feedback=lambda f: seen.append(f.position.x)
        )
    )()
    assert ended.status == 'succeeded'
    assert set(seen) <= {0.0, 0.499}
    assert ended.result.position.x == 0.499


def test_a_goal_that_was_cancelled_is_no_failure(graph: Any, servers: Servers, run: Any) -> None:
    servers.feedback = [at(1, 0)]
    servers.ends['navigate_through_poses'] = CallInterruptedError('interrupted')
    assert tuple(nav2(graph).follow(PATH, run, lambda _: None)) == (1, 0, 0)


def test_the_place_follows_the_pose_by_the_rooms_of_the_map(
    graph: Any, servers: Servers, run: Any, flat: Any
) -> None:
    recorder = Recorder()
    motion = nav2(graph, recorder, flat)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    maps = graph.node.create_publisher(OccupancyGrid, 'map', STATE_QOS)
    message = PoseWithCovarianceStamped()

    def come_to(x: float) -> None:
        message.pose.pose.position.x, message.pose.pose.position.y = x, 2.7
        poses.publish(message)

    # The map may come after the pose. Both points are nearer to A's than to B's.
    come_to(3.6)
    maps.publish(map_message(flat.grid, 'map', Time()))
    graph.until(lambda: recorder.places[-1:] == ['A'])
    come_to(4.3)
    graph.until(lambda: recorder.places[-1] == 'B')
    come_to(float('nan'))
    come_to(3.6)
    graph.until(lambda: recorder.places[-1] == 'A')
    end = motion.follow(PATH, run, lambda _: None)
    assert tuple(end) == (3.6, 2.7, 0.0)
    assert motion.place_reached(np.array([2.0, 1.5, 0.0]), end) == 'A'
    with pytest.raises(MotionFailedError, match='stopped in A: expected B'):
        motion.place_reached(np.array([5.5, 1.5, 0.0]), end)


@pytest.mark.parametrize(
    ('end', 'text'),
    [
        (GoalEnd('aborted', None), 'Nav2 aborted the goal'),
        (
            GoalEnd(
                'aborted',
                result('NavigateThroughPoses', error_code=106, error_msg='Collision ahead'),
            ),
            'the goal .error code 106 NO_VALID_CONTROL, Collision ahead.',
        ),
        (
            GoalEnd('aborted', result('NavigateThroughPoses', error_code=4321)),
            'the goal .error code 4321.$',
        ),
    ],
)
def test_what_nav2_cannot_do_fails_with_the_reason(
    graph: Any, servers: Servers, run: Any, end: Any, text: str
) -> None:
    servers.ends['navigate_through_poses'] = end
    with pytest.raises(MotionFailedError, match=text):
        nav2(graph).follow(PATH, run, lambda _: None)


def test_a_path_that_leads_nowhere_is_a_turn_by_the_shorter_way(
    graph: Any, servers: Servers, run: Any
) -> None:
    motion = nav2(graph)
    path = np.array(spin_path((1.0, 2.0), np.pi))
    with pytest.raises(MotionFailedError, match='nobody tells where the robot points'):
        motion.follow(path, run, lambda _: None)
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    poses.publish(PoseWithCovarianceStamped(pose=pose_estimate((1.0, 2.0, -2.0), 0.1, 0.1)))
    graph.until(lambda: motion.pose is not None)
    assert tuple(motion.follow(path, run, lambda _: None)) == (1.0, 2.0, 0.0)
    ((name, goal),) = servers.asked
    assert name == 'spin'
    assert goal.target_yaw == pytest.approx(np.pi - 2.0 * np.pi + 2.0)
    refused = result('Spin', error_code=703, error_msg='Collision ahead')
    servers.ends['spin'] = GoalEnd('aborted', refused)
    reason = r'aborted the turn \(error code 703 COLLISION_AHEAD, Collision ahead\)'
    with pytest.raises(MotionFailedError, match=reason):
        motion.follow(path, run, lambda _: None)


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

    def look_around(self, run: Any) -> None:
        self.looked += 1


class Docked:
    """A robot with a dock at `DOCK`, and what it is told."""

    def __init__(self, graph: Any, servers: Servers, at: Any = DOCK, **settings: Any) -> None:
        self.node = graph.add(PatrolNode, name='motion_controller')
        self.drive = Drive(servers, self.node, at)
        given: dict[str, Any] = {'dock_type': 'charger', 'navigator': 'nav2', 'peer_timeout': 60.0}
        stations = {'C2': Station((90.0, 0.0, 0.0)), 'E': Station(DOCK)}
        settings = MotionSettings(stations=stations, **(given | settings))
        self.motion = docking_motion.DockingMotion(self.node, self.drive, settings)
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


def test_a_server_that_is_not_active_is_waited_for_by_name(
    graph: Any, servers: Servers, run: Run
) -> None:
    servers.ends['navigate_through_poses'] = [
        GoalEnd('rejected', None),
        GoalEnd('succeeded', None),
    ]
    servers.states = {
        'bt_navigator': ['active'],
        'controller_server': ['inactive'] * 5 + ['active'],
    }
    motion = nav2(graph)
    incidents = motion._node.incidents
    said: list[str] = []
    sleep = run.sleep

    def asleep(seconds: float) -> bool:
        said.extend(each.text for each in incidents.updates())
        return sleep(seconds)

    run.sleep = asleep  # type: ignore[method-assign]
    motion.follow(PATH, run, lambda _at: None)
    assert servers.names == ['navigate_through_poses'] * 2
    assert said[0] == "Nav2's controller_server is inactive: the patrol waits for it"
    assert run.pauses[:5] == list(nav2_goals.PAUSES[:5])
    assert not incidents.updates()


def test_goals_that_fail_at_once_are_sent_with_growing_pauses(
    graph: Any, servers: Servers, run: Run
) -> None:
    servers.ends['navigate_through_poses'] = GoalEnd('rejected', None)
    motion = nav2(graph)
    while run.time < 60.0:
        with pytest.raises(MotionFailedError, match='Nav2 rejected the goal 5 times'):
            motion.follow(PATH, run, lambda _at: None)
    assert len(servers.asked) <= 15
    servers.ends['navigate_through_poses'] = GoalEnd('aborted', result('NavigateThroughPoses'))
    began = run.time
    for _ in range(6):
        with pytest.raises(MotionFailedError, match='Nav2 aborted the goal'):
            motion.follow(PATH, run, lambda _at: None)
    assert run.time - began > 30.0


def test_a_robot_that_another_program_sends_is_waited_for(
    graph: Any, servers: Servers, run: Run
) -> None:
    servers.ends['navigate_through_poses'] = GoalEnd('aborted', result('NavigateThroughPoses'))
    motion = nav2(graph)
    runs = ['navigate_to_pose', 'navigate_to_pose', '']
    said: list[str] = []

    def running() -> str:
        said.extend(each.text for each in motion._node.incidents.updates())
        return runs.pop(0)

    motion._others.running = running  # type: ignore[method-assign]
    with pytest.raises(MotionFailedError, match='Nav2 aborted the goal'):
        motion.follow(PATH, run, lambda _at: None)
    assert 'another program, RViz perhaps, has a goal on navigate_to_pose' in said[0]
    assert not runs
    assert not motion._node.incidents.updates()


def test_what_nav2_said_on_the_way_is_told_when_it_fails(
    graph: Any, servers: Servers, run: Run
) -> None:
    feedback = at(1, 0)
    feedback.number_of_recoveries, feedback.distance_remaining = 3, 1.25
    servers.feedback = [feedback]
    servers.ends['navigate_through_poses'] = GoalEnd(
        'aborted', result('NavigateThroughPoses', error_code=105)
    )
    reason = r'105 FAILED_TO_MAKE_PROGRESS\), after 3 recoveries, 1.2 m before its end'
    with pytest.raises(MotionFailedError, match=reason) as failure:
        nav2(graph).follow(PATH, run, lambda _: None)
    assert tuple(failure.value.end) == (1, 0, 0)


def test_a_robot_that_nav2_does_not_move_is_given_up(
    graph: Any, servers: Servers, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = nav2(graph)

    def hangs(goal: Any, *, interrupt: Any, on_feedback: Any, **_more: Any) -> GoalEnd:
        on_feedback(at(1, 0))
        run.time += 80.0
        on_feedback(at(1.1, 0))
        motion._look()
        assert not interrupt.is_set()
        run.time += 20.0
        motion._look()
        assert interrupt.is_set()
        raise CallInterruptedError('interrupted')

    monkeypatch.setattr(motion._navigator._caller, 'run', hangs)
    with pytest.raises(MotionFailedError, match='Nav2 has not moved the robot for 90 s'):
        motion.follow(PATH, run, lambda _: None)


def moved(parent: str, child: str, x: float, y: float, yaw: float) -> TransformStamped:
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = parent
    transform.header.stamp.sec = 5
    transform.transform.translation.x, transform.transform.translation.y = x, y
    transform.transform.rotation = pose_message((x, y, yaw)).orientation
    return transform


def test_where_nobody_tells_a_pose_the_frames_tell_it(
    graph: Any, servers: Servers, run: Run
) -> None:
    heard = graph.listen(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    motion = nav2(graph)
    frames = graph.node.create_publisher(TFMessage, 'tf', 10)
    message = TFMessage(
        transforms=[
            moved('map', 'odom', 10.0, 0.0, np.pi / 2),
            moved('odom', 'base_link', 2.0, 1.0, 0.5),
        ]
    )
    graph.until(lambda: (frames.publish(message), heard)[1])
    assert heard[-1].header.frame_id == 'map'
    assert heard[-1].header.stamp.sec == 5
    assert motion.pose == pytest.approx((9.0, 2.0, np.pi / 2 + 0.5))
    # It is fresh, and beats what Nav2 said on the way.
    servers.feedback = [at(1, 0)]
    assert tuple(motion.follow(PATH, run, lambda _: None)) == pytest.approx((9.0, 2.0, 0.0))


def test_a_pose_that_was_heard_long_ago_is_not_believed_at_the_end(
    graph: Any, servers: Servers, run: Run
) -> None:
    motion = nav2(graph)
    motion._pose, motion._heard_at = (8.0, 8.0, 0.0), time.monotonic() - 60.0
    servers.feedback = [at(2.9, 3.9)]
    assert tuple(motion.follow(PATH, run, lambda _: None)) == (2.9, 3.9, 0.0)


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
