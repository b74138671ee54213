"""Moving by Nav2 and docking by a docking server, with both servers scripted.

Their messages, nav2_msgs, come with them and are no wheel, so classes stand in for the types here;
`tests/mission/test_nav2_mission.py` has the types themselves.
"""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid

from floor_plans import Station
from state_machines import Interrupt
from state_machines.ros import CallInterruptedError, GoalCaller, GoalEnd, UnavailableError
from surveillance_controllers.controller_parameters import MotionSettings
from surveillance_controllers.motion import nav2 as nav2_motion
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.conversions import map_message, point_messages, pose_estimate
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.spin_in_place import spin_path
from tests.nav2_definitions import ACTIONS, stand_in

PATH = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])
TYPES = {name: stand_in(name) for name in ACTIONS}


def result(action: str, **fields: Any) -> Any:
    return TYPES[action].Result(**fields)


class Servers:
    """Action servers that answer as told and keep what they were asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Any]] = []
        self.ends: dict[str, GoalEnd | Exception] = {}
        self.feedback: list[Any] = []

    def caller(self, _node: Any, _type: Any, name: str) -> Any:
        def run(goal: Any, *, on_feedback: Any = None, **_deadlines: Any) -> GoalEnd:
            self.asked.append((name, goal))
            for message in self.feedback if on_feedback else ():
                on_feedback(message)
            end = self.ends.get(name, GoalEnd('succeeded', SimpleNamespace(success=True)))
            if isinstance(end, Exception):
                raise end
            return end

        return SimpleNamespace(run=run)


@pytest.fixture
def servers(monkeypatch: pytest.MonkeyPatch) -> Servers:
    servers = Servers()
    package, module = ModuleType('nav2_msgs'), ModuleType('nav2_msgs.action')
    vars(package)['action'] = module
    vars(module).update(TYPES)
    monkeypatch.setitem(sys.modules, 'nav2_msgs', package)
    monkeypatch.setitem(sys.modules, 'nav2_msgs.action', module)
    monkeypatch.setattr(nav2_motion, 'GoalCaller', servers.caller)
    return servers


@pytest.fixture
def run() -> Any:
    return SimpleNamespace(interrupt=Interrupt())


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
        (UnavailableError('action navigate_through_poses: no server'), 'poses: no server'),
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
    graph.until(lambda: np.isfinite(motion._yaw))
    assert tuple(motion.follow(path, run, lambda _: None)) == (1.0, 2.0, 0.0)
    ((name, goal),) = servers.asked
    assert name == 'spin'
    assert goal.target_yaw == pytest.approx(np.pi - 2.0 * np.pi + 2.0)
    refused = result('Spin', error_code=703, error_msg='Collision ahead')
    servers.ends['spin'] = GoalEnd('aborted', refused)
    reason = r'aborted the turn \(error code 703 COLLISION_AHEAD, Collision ahead\)'
    with pytest.raises(MotionFailedError, match=reason):
        motion.follow(path, run, lambda _: None)


def docked(graph: Any, station: tuple[float, float, float]) -> nav2_motion.DockingMotion:
    stations = {'C2': Station((90.0, 0.0, 0.0)), 'E': Station(station)}
    settings = MotionSettings(stations=stations, dock_type='charger', peer_timeout=60.0)
    return nav2_motion.DockingMotion(graph.node, nav2(graph), settings)


def test_a_way_to_the_station_ends_in_the_dock_and_the_next_one_begins_by_undocking(
    graph: Any, servers: Servers, run: Any
) -> None:
    motion = docked(graph, (3.2, 4.0, 1.0))
    motion.follow(PATH, run, lambda _: None)
    motion.look_around(run)
    assert [name for name, _ in servers.asked] == ['navigate_through_poses', 'dock_robot']
    goal = servers.asked[-1][1]
    assert (goal.dock_type, goal.use_dock_id) == ('charger', False)
    assert goal.dock_pose.pose.position.x == 3.2
    motion.follow(PATH[::-1], run, lambda _: None)
    assert [name for name, _ in servers.asked[2:]] == ['undock_robot', 'navigate_through_poses']


def test_a_way_to_elsewhere_does_not_dock(graph: Any, servers: Servers, run: Any) -> None:
    docked(graph, (9.0, 9.0, 0.0)).follow(PATH, run, lambda _: None)
    assert [name for name, _ in servers.asked] == ['navigate_through_poses']


def test_a_dock_that_is_not_found_fails_the_way(graph: Any, servers: Servers, run: Any) -> None:
    refused = result('DockRobot', success=False, error_code=903, error_msg='No way there')
    servers.ends['dock_robot'] = GoalEnd('aborted', refused)
    reason = r'docking: .* aborted the goal \(error code 903 FAILED_TO_STAGE, No way there\)'
    with pytest.raises(MotionFailedError, match=reason):
        docked(graph, (3.0, 4.0, 0.0)).follow(PATH, run, lambda _: None)


def test_without_their_messages_both_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, 'nav2_msgs', None)
    monkeypatch.setitem(sys.modules, 'nav2_msgs.action', None)
    none: Any = None
    with pytest.raises(ParameterError, match=r'navigator: got nav2.* install ros-jazzy-nav2-msgs'):
        nav2_motion.Nav2Motion(none, none, none, MotionSettings())
    with pytest.raises(ParameterError, match=r'docking: .* install ros-jazzy-nav2-msgs'):
        nav2_motion.DockingMotion(none, none, MotionSettings())
