"""Planner and motion controller in SIMULATED mode, with the simulator, ARMOR and the map
builder."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable
from typing import Any

import pytest
from geometry_msgs.msg import Point, PoseStamped
from std_msgs.msg import UInt32

from state_machines import Interrupt
from state_machines.ros import CallInterruptedError, GoalCaller, ServiceCaller
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_controllers.planner_controller_node import PlannerController
from surveillance_interfaces.action import ComputePath, Control, FollowPath, Plan
from surveillance_interfaces.msg import OntologyMap, OntologyPlace, RoomConnection
from surveillance_interfaces.srv import PlaceObstacle, PushRobot, ReferenceName, SetDoor
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_runtime.qos import SENSOR_QOS, STATE_QOS
from surveillance_simulation.simulator_node import Simulator


class World:
    """The nodes of one robot in the seven rooms, and a client of their actions."""

    def __init__(self, graph: Any, place: dict[str, Any]) -> None:
        self.graph = graph
        timed = {**place, 'use_sim_time': True, 'execution_mode': 'SIMULATED'}
        self.armor_server = graph.add(ArmorServer)
        graph.add(OntologyMapBuilder, place)
        graph.add(Simulator, {**place, 'use_sim_time': True, 'speed': 0.0})
        self.planner = graph.add(PlannerController, {**timed, 'via_point_delay': 0.1})
        self.motion = graph.add(MotionController, timed)
        self.truth = graph.listen(PoseStamped, 'ground_truth', SENSOR_QOS)
        self.collisions = graph.listen(UInt32, 'collisions', STATE_QOS)
        self.armor = ArmorClient(graph.node, 'test', 'surveillance', timeout=60.0)
        node = graph.node
        # Before the map is built, there is no ontology to be asked.
        names = ServiceCaller(node, ReferenceName, 'ontology_map/reference_name')
        names.call(ReferenceName.Request(), 60.0)
        self._compute = GoalCaller(node, ComputePath, 'compute_path')
        self._follow = GoalCaller(node, FollowPath, 'follow_path')
        self._plan = GoalCaller(node, Plan, 'motion/planner')
        self._control = GoalCaller(node, Control, 'motion/controller')

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        answer = ServiceCaller(self.graph.node, kind, service).call(kind.Request(**fields), 60.0)
        assert answer.success, answer.message
        return answer

    @property
    def position(self) -> tuple[float, float]:
        self.graph.until(lambda: self.truth)
        point = self.truth[-1].pose.position
        return point.x, point.y

    def compute(self, goal: tuple[float, float]) -> Any:
        x, y = self.position
        request = ComputePath.Goal(start=Point(x=x, y=y), goal=Point(x=goal[0], y=goal[1]))
        return self._compute.run(request, accept_timeout=60.0, result_timeout=60.0)

    def follow(self, path: list[Point], **options: Any) -> Any:
        return self._follow.run(FollowPath.Goal(path=path), accept_timeout=60.0, **options)

    def plan(self, target: str) -> Any:
        seen: list[int] = []
        end = self._plan.run(
            Plan.Goal(target=target),
            accept_timeout=60.0,
            result_timeout=60.0,
            on_feedback=lambda feedback: seen.append(len(feedback.via_points)),
        )
        return end, seen

    def control(self, points: list[Point]) -> Any:
        return self._control.run(Control.Goal(point_set=points), accept_timeout=60.0)

    def ask_until(self, holds: Callable[[], bool]) -> None:
        """Ask again and again, which `graph.until` cannot: it must not wait for answers."""
        deadline = time.monotonic() + 60.0
        while not holds():
            assert time.monotonic() < deadline, 'not within 60 s'

    def can_reach(self, place: str) -> bool:
        return place in self.armor.query.objectprop_b2_ind('canReach', 'Robot1')

    def robot_place(self) -> list[str]:
        return self.armor.query.objectprop_b2_ind('isIn', 'Robot1')


@pytest.fixture
def world(graph: Any, seven_rooms: dict[str, Any]) -> World:
    return World(graph, seven_rooms)


def test_a_way_is_planned_and_driven_and_its_end_is_told(world: World) -> None:
    end, seen = world.plan('C1')
    assert end.status == 'succeeded'
    points = end.result.via_points
    assert len(points) == 10
    assert seen == sorted(seen)
    steps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in itertools.pairwise(points)]
    assert max(steps) < 1.5 * min(steps)
    end = world.control(points)
    assert end.status == 'succeeded'
    reached = end.result.reached_point
    assert (reached.x, reached.y) == pytest.approx(world.position, abs=0.05)
    assert world.position == pytest.approx((10, 8), abs=0.15)
    world.ask_until(lambda: world.robot_place() == ['C1'])
    assert world.collisions[-1].data == 0


def test_a_closed_door_leaves_route_path_and_ontology_and_comes_back(world: World) -> None:
    world.ask_until(lambda: world.can_reach('C1'))
    world.call(SetDoor, 'simulation/set_door', door='D6', open=False)
    world.ask_until(lambda: not world.can_reach('C1'))
    assert world.compute((10.0, 8.0)).status == 'succeeded'
    world.call(SetDoor, 'simulation/set_door', door='D7', open=False)
    world.ask_until(lambda: world.compute((10.0, 8.0)).status == 'aborted')
    end, _ = world.plan('C1')
    assert end.status == 'aborted'
    world.call(SetDoor, 'simulation/set_door', door='D6', open=True)
    world.ask_until(lambda: world.compute((10.0, 8.0)).status == 'succeeded')
    world.ask_until(lambda: world.can_reach('C1'))


def test_an_obstacle_in_the_way_is_driven_around(world: World) -> None:
    path = world.compute((10.0, 8.0)).result.path
    middle = path[len(path) // 2]
    world.call(
        PlaceObstacle, 'simulation/place_obstacle', name='box', x=middle.x, y=middle.y, radius=0.2
    )
    end = world.follow(path)
    assert end.status == 'succeeded'
    assert world.position == pytest.approx((10, 8), abs=0.15)
    assert world.collisions[-1].data == 0


def test_a_robot_pushed_off_its_way_finds_itself_and_arrives(world: World) -> None:
    path = world.compute((10.0, 8.0)).result.path
    pushed: list[Any] = []

    def push(_feedback: Any) -> None:
        if not pushed:
            request = PushRobot.Request(dx=-0.5, dy=0.6, dyaw=1.5)
            pushed.append(client.call_async(request))

    client = world.graph.node.create_client(PushRobot, 'simulation/push_robot')
    world.graph.until(client.service_is_ready)
    end = world.follow(path, on_feedback=push)
    assert pushed
    assert pushed[0].result().success
    assert end.status == 'succeeded'
    reached = end.result.position
    assert (reached.x, reached.y) == pytest.approx(world.position, abs=0.08)
    assert world.position == pytest.approx((10, 8), abs=0.15)
    world.ask_until(lambda: world.robot_place() == ['C1'])


def test_the_robot_drives_on_without_the_ontology(world: World) -> None:
    world.ask_until(lambda: world.robot_place() == ['E'])
    path = world.compute((10.0, 8.0)).result.path
    world.graph.remove(world.armor_server)
    assert world.follow(path).status == 'succeeded'
    assert world.position == pytest.approx((10, 8), abs=0.15)


def test_a_drive_that_is_cancelled_leaves_the_robot_standing(world: World) -> None:
    path = world.compute((10.0, 8.0)).result.path
    cancel = Interrupt()
    with pytest.raises(CallInterruptedError):
        world.follow(path, interrupt=cancel, on_feedback=lambda _: cancel.set())
    seen = len(world.truth)
    world.graph.until(lambda: len(world.truth) > seen + 5)
    stands = world.position
    seen = len(world.truth)
    world.graph.until(lambda: len(world.truth) > seen + 5)
    assert world.position == pytest.approx(stands, abs=1e-6)
    assert math.dist(stands, (10, 8)) > 1


def test_a_place_that_joins_is_planned_to_and_visited(world: World) -> None:
    world.ask_until(lambda: world.can_reach('C1'))
    alcove = OntologyPlace(
        name='ALCOVE',
        position=Point(x=12.5, y=8.0),
        connections=[RoomConnection(connected_to='C1', through_door='D9')],
    )
    world.graph.node.create_publisher(OntologyMap, 'ontology_map/build_map', STATE_QOS).publish(
        OntologyMap(places=[alcove])
    )
    world.ask_until(lambda: 'ALCOVE' in world.armor.query.ind_b2_class('LOCATION'))
    end, _ = world.plan('ALCOVE')
    assert end.status == 'succeeded'
    assert world.control(end.result.via_points).status == 'succeeded'
    world.ask_until(lambda: world.robot_place() == ['ALCOVE'])


@pytest.mark.parametrize(
    ('node', 'text'),
    [
        (PlannerController, 'no map came on the topic map within 0.2 s'),
        (MotionController, 'nothing of use came on the topic map for 0.2 s'),
    ],
)
def test_without_a_robot_the_reason_is_what_does_not_come(
    graph: Any, capfd: Any, node: Any, text: str
) -> None:
    graph.add(node, {'execution_mode': 'SIMULATED', 'peer_timeout': 0.2, 'sensor_timeout': 0.2})
    points = [Point(), Point(x=1.0)]
    if node is PlannerController:
        kind, name, goal = ComputePath, 'compute_path', ComputePath.Goal(goal=points[1])
    else:
        kind, name, goal = FollowPath, 'follow_path', FollowPath.Goal(path=points)
    end = GoalCaller(graph.node, kind, name).run(goal, accept_timeout=60.0)
    assert end.status == 'aborted'
    assert text in capfd.readouterr().err
