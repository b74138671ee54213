"""The robot's camera is turned by whoever turns it: the arm's poses, or `follow_path`."""

from __future__ import annotations

import math
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from geometry_msgs.msg import Point, PoseWithCovarianceStamped
from rclpy.callback_groups import ReentrantCallbackGroup
from std_msgs.msg import Bool

from state_machines import Interrupt
from state_machines.exceptions import CallInterruptedError
from state_machines.ros import GoalServer, work_aside
from surveillance_behaviour.ros_adapters.looking import RosInspection
from surveillance_behaviour.ros_adapters.peers import Deadlines, MissionClock
from surveillance_interfaces.action import FollowPath
from surveillance_interfaces.msg import PlaceCheck, PlaceChecks, ViewedPicture, ViewedPictures
from surveillance_interfaces.srv import MarkerRoutine, PointCamera
from surveillance_runtime.conversions import point_from, pose_estimate, stamp_from
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.qos import STATE_QOS
from surveillance_runtime.spin_in_place import bearing_of

REQUEST = MarkerRoutine.Request


class Arm(PatrolNode):
    """Takes a while for each pose, until it is released."""

    def __init__(self, **options: Any) -> None:
        super().__init__('arm_controller', **options)
        self.asked: list[int] = []
        self.released = threading.Event()
        group = ReentrantCallbackGroup()
        self.create_service(MarkerRoutine, 'move_arm', self._move, callback_group=group)

    async def _move(self, request: Any, response: Any) -> Any:
        self.asked.append(request.pos)
        await work_aside(self, lambda: self.released.wait(60.0), 'arm motion')
        response.success = True
        return response


def looking_of(graph: Any) -> RosInspection:
    node = graph.add(PatrolNode, name='robot_behavior')
    return RosInspection(node, Deadlines(), MissionClock(node))


def tell_pose(graph: Any, looking: RosInspection, x: float, y: float, yaw: float) -> None:
    poses = graph.node.create_publisher(PoseWithCovarianceStamped, 'amcl_pose', STATE_QOS)
    poses.publish(PoseWithCovarianceStamped(pose=pose_estimate((x, y, yaw), 0.1, 0.1)))
    graph.until(lambda: looking.position() is not None)


def test_a_look_that_is_interrupted_has_the_arm_look_ahead(graph: Any) -> None:
    looking, arm = looking_of(graph), graph.add(Arm)
    tell_pose(graph, looking, 1.0, 2.0, math.pi / 2)
    graph.until(looking.has_arm)
    interrupt = Interrupt()
    with ThreadPoolExecutor() as threads:
        ended = threads.submit(looking.face, math.pi, interrupt)
        graph.until(lambda: arm.asked == [REQUEST.LEFT])
        interrupt.set()
        with pytest.raises(CallInterruptedError):
            ended.result(60.0)
    looking.rest_arm()
    graph.until(lambda: arm.asked == [REQUEST.LEFT, REQUEST.HOME])
    arm.released.set()
    looking.face(-math.pi / 2 + 0.2, Interrupt())
    assert arm.asked[-1] == REQUEST.BACK


def test_an_arm_that_comes_late_is_brought_ahead_and_not_after_it_was_pointed(graph: Any) -> None:
    looking = looking_of(graph)
    looking.rest_arm()
    arm = graph.add(Arm)
    arm.released.set()
    graph.until(lambda: arm.asked == [REQUEST.HOME])
    graph.remove(arm)
    graph.until(lambda: not looking.has_arm())
    looking.rest_arm()
    looking._resting.set()  # as pointing it elsewhere does
    later = graph.add(Arm)
    later.released.set()
    graph.until(looking.has_arm)
    looking.face(math.pi / 2, Interrupt())
    assert later.asked == [REQUEST.LEFT]


def test_without_an_arm_the_base_turns(graph: Any) -> None:
    looking = looking_of(graph)
    bearings = []

    def follow(goal: Any, _run: Any) -> Any:
        bearings.append(bearing_of([point_from(each) for each in goal.path]))
        return FollowPath.Result()

    node = graph.add(PatrolNode, name='motion_controller')
    GoalServer(node, FollowPath, 'follow_path', follow)
    tell_pose(graph, looking, 1.0, 2.0, 0.0)
    looking.face(2.5, Interrupt())
    assert bearings == [pytest.approx(2.5)]


def test_the_first_look_waits_for_the_observer(graph: Any) -> None:
    looking = looking_of(graph)
    with ThreadPoolExecutor() as threads:
        waited = threads.submit(looking.await_watcher, Interrupt())
        graph.node.create_publisher(Bool, 'sees_around', STATE_QOS).publish(Bool(data=True))
        waited.result(60.0)
    assert looking.sees_around()
    interrupt = Interrupt()
    interrupt.set()
    looking_of(graph).await_watcher(interrupt)


def test_an_arm_that_can_be_pointed_looks_at_any_side(graph: Any) -> None:
    looking, arm = looking_of(graph), graph.add(Arm)
    arm.released.set()
    points = []

    def point(request: Any, response: Any) -> Any:
        points.append((request.frame_id, request.point))
        response.success = True
        return response

    arm.create_service(PointCamera, 'point_camera', point)
    tell_pose(graph, looking, 1.0, 2.0, 0.5)
    graph.until(lambda: looking.has_arm() and looking._pointing.is_ready())
    looking.face(0.5 + 1.0, Interrupt())
    ((frame, target),) = points
    assert frame == 'base_link'
    assert math.atan2(target.y, target.x) == pytest.approx(1.0, abs=0.01)
    looking.face(0.5 + math.pi / 2, Interrupt())
    assert arm.asked == [REQUEST.LEFT], 'a pose is that of the arm'
    assert len(points) == 1


def test_a_side_is_seen_once_a_picture_of_it_was_looked_at(graph: Any) -> None:
    looking, arm = looking_of(graph), graph.add(Arm)
    arm.released.set()
    tell = graph.node.create_publisher(ViewedPictures, 'pictures', STATE_QOS)
    tell_pose(graph, looking, 1.0, 2.0, 0.0)
    graph.until(looking.has_arm)

    def now() -> float:
        return 1e-9 * float(graph.node.get_clock().now().nanoseconds)

    def looked(*pictures: tuple[float, int | None], camera: bool = True) -> None:
        told = ViewedPictures(camera=camera, angle=[math.radians(60)])
        for taken, bearing in pictures:
            sides = [] if bearing is None else [math.radians(bearing)]
            told.looked.append(
                ViewedPicture(stamp=stamp_from(math.ceil(1e9 * taken)), bearing=sides)
            )
        tell.publish(told)

    before = now()
    looking.face(math.pi / 2, Interrupt())
    assert not looking.saw(math.pi / 2), 'nobody has said so'
    looked((before, 90), (now(), 0))
    graph.until(lambda: looking.camera_angle() == pytest.approx(math.radians(60)))
    assert not looking.saw(math.pi / 2), 'one is old, the other is of another side'
    looked((now(), 85))
    graph.until(lambda: looking.saw(math.pi / 2) == 1)
    looking.face(math.pi, Interrupt())
    assert not looking.saw(math.pi)
    looked((now(), None))
    graph.until(lambda: looking.saw(math.pi))
    looking.face(math.pi, Interrupt())
    looked(camera=False)
    graph.until(lambda: looking.saw(math.pi))


def test_what_the_rules_ask_for_is_known_by_place(graph: Any) -> None:
    looking = looking_of(graph)
    check = PlaceCheck(place='C1', name='marker 21', at=Point(x=1.0, y=2.0))
    tell = graph.node.create_publisher(PlaceChecks, 'checks', STATE_QOS)
    tell.publish(PlaceChecks(checks=[check]))
    graph.until(lambda: looking.checks('C1'))
    (known,) = looking.checks('C1')
    assert (known.name, known.point[:2], known.look_from) == ('marker 21', (1.0, 2.0), None)
    assert not looking.checks('C2')
