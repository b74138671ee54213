"""Moving by Nav2 and docking by a docking server, with both servers scripted.

Their messages, nav2_msgs, come with them and are no wheel, so classes stand in for the types here;
`tests/mission/test_nav2_mission.py` has the types themselves.
"""

from __future__ import annotations

import itertools
import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid
from tf2_msgs.msg import TFMessage

from state_machines.ros import CallInterruptedError, GoalCaller, GoalEnd
from surveillance_controllers.motion import nav2 as nav2_motion
from surveillance_controllers.motion import pose_doubt
from surveillance_controllers.motion.arrival import MotionFailedError
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_interfaces.action import FollowPath
from surveillance_runtime.conversions import (
    map_message,
    point_messages,
    pose_estimate,
    pose_message,
)
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.spin_in_place import spin_path
from tests.controllers.nav2_servers import PATH, Recorder, Run, Servers, nav2, result


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


@pytest.mark.usefixtures('incidents_at_once')
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
    end = failure.value.end
    assert end is not None
    assert tuple(end) == (1, 0, 0)


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


def test_a_pose_that_the_lidar_contradicts_is_told_of_and_no_visit_is_believed(
    graph: Any, servers: Servers, flat: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pose_doubt, 'AFTER', 0.0)
    monkeypatch.setattr(pose_doubt, 'LOOK_PERIOD', 0.0)
    said = graph.said()
    recorder = Recorder()
    motion = nav2(graph, recorder, flat)
    maps = graph.node.create_publisher(OccupancyGrid, 'map', STATE_QOS)
    frames = graph.node.create_publisher(TFMessage, 'tf', 10)
    maps.publish(map_message(flat.grid, 'map', Time()))
    scan = flat.scan((2.0, 1.5, 0.0))
    clock = itertools.count(6)

    def tell(x: float, stamp: Time) -> None:
        links = [moved('map', 'odom', 0.0, 0.0, 0.0), moved('odom', 'base_link', x, 1.5, 0.0)]
        for link in links:
            link.header.stamp = stamp
        frames.publish(TFMessage(transforms=links))
        seconds = stamp.sec + 1e-9 * stamp.nanosec
        graph.until(lambda: motion._tf.tree.is_past('base_link', 'map', seconds))

    def seen_from(x: float) -> None:
        for _ in range(2):
            second = next(clock)
            tell(x, Time(sec=second))
            header = SimpleNamespace(stamp=Time(sec=second, nanosec=200_000_000))
            motion._on_scan('scan', scan, SimpleNamespace(header=header))
            tell(x, Time(sec=second, nanosec=400_000_000))

    graph.until(lambda: motion._doubt._fit)
    seen_from(2.0)
    graph.until(lambda: recorder.places[-1:] == ['A'])
    seen_from(5.5)
    words = 'the pose that Nav2 tells does not fit what the lidar sees'
    graph.until(lambda: any(words in line for line in said))
    seen_from(5.6)
    seen_from(5.7)
    assert sum(words in line for line in said) == 1, 'a pose that moves is no news'
    end = np.array([5.5, 1.5, 0.0])
    with pytest.raises(MotionFailedError, match='does not fit'):
        motion.place_reached(end, end)
    seen_from(2.0)
    graph.until(lambda: any('the pose fits what the lidar sees' in line for line in said))
    assert motion.place_reached(np.array([2.0, 1.5, 0.0]), np.array([2.0, 1.5, 0.0])) == 'A'


def test_a_pose_that_was_heard_long_ago_is_not_believed_at_the_end(
    graph: Any, servers: Servers, run: Run
) -> None:
    motion = nav2(graph)
    motion._pose, motion._heard_at = (8.0, 8.0, 0.0), time.monotonic() - 60.0
    servers.feedback = [at(2.9, 3.9)]
    assert tuple(motion.follow(PATH, run, lambda _: None)) == (2.9, 3.9, 0.0)
