"""The actions of `patrol` with ARMOR and the map builder, without a robot: plan, move, tell."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Point
from std_msgs.msg import String

from state_machines.ros import GoalCaller, ServiceCaller
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_controllers.planner_controller_node import PlannerController
from surveillance_interfaces.action import Control, FollowPath, Plan
from surveillance_interfaces.msg import RobotPlace
from surveillance_interfaces.srv import ConsoleCommand, ReferenceName
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime.qos import STATE_QOS


@pytest.fixture
def armor(graph: Any, seven_rooms: dict[str, Any]) -> ArmorClient:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, seven_rooms)
    ServiceCaller(graph.node, ReferenceName, 'ontology_map/reference_name').call(
        ReferenceName.Request(), 60.0
    )
    armor = ArmorClient(graph.node, 'test', 'surveillance', timeout=60.0)
    RobotOntology(armor).record_place('E', 1)
    return armor


def plan(graph: Any, target: str) -> Any:
    caller = GoalCaller(graph.node, Plan, 'motion/planner')
    return caller.run(Plan.Goal(target=target), accept_timeout=60.0, result_timeout=60.0)


def test_a_random_plan_leads_straight_to_the_place_in_equal_steps(
    graph: Any, armor: ArmorClient
) -> None:
    graph.add(PlannerController, {'execution_mode': 'RANDOM', 'via_point_delay': 0.0})
    end = plan(graph, 'C1')
    assert end.status == 'succeeded'
    points = [(p.x, p.y) for p in end.result.via_points]
    assert len(points) == 10
    assert points[0] == (5, 10)
    assert points[-1] == (10, 8)
    assert np.array(points) == pytest.approx(np.linspace((5, 10), (10, 8), 10))


def test_a_plan_without_a_target_that_exists_or_fits_is_aborted(
    graph: Any, armor: ArmorClient, capfd: Any
) -> None:
    graph.add(
        PlannerController,
        {'execution_mode': 'RANDOM', 'environment_size': [0.0, 12.0, 0.0, 20.0]},
    )
    assert plan(graph, 'R9').status == 'aborted'
    assert plan(graph, 'R4').status == 'aborted'
    logged = capfd.readouterr().err
    assert "no way to 'R9': the map has no place 'R9'" in logged
    assert "place 'R4' is at (15, 15, 0): expected within environment_size [0, 12, 0, 20]" in logged


def test_without_a_map_a_plan_is_aborted_in_time(graph: Any, capfd: Any) -> None:
    graph.add(PlannerController, {'execution_mode': 'RANDOM', 'peer_timeout': 0.1})
    assert plan(graph, 'C1').status == 'aborted'
    assert 'service ontology_map/room_position: no server' in capfd.readouterr().err


def control(graph: Any, in_background: Any, point: Point, command: str) -> Any:
    told = graph.listen(String, 'motion_controller/announcement', STATE_QOS)
    caller = GoalCaller(graph.node, Control, 'motion/controller')
    seen: list[Any] = []
    goal = Control.Goal(point_set=[Point(x=5.0, y=10.0), Point(x=7.0, y=9.0), point])
    end = in_background(
        lambda: caller.run(goal, accept_timeout=60.0, on_feedback=lambda f: seen.append(f))
    )
    graph.until(lambda: told)
    console = ServiceCaller(graph.node, ConsoleCommand, 'motion_controller/command')
    assert console.call(ConsoleCommand.Request(line=command), 60.0).accepted
    return end(), seen


def test_the_place_that_was_reached_is_published_and_written_into_the_ontology(
    graph: Any, armor: ArmorClient, in_background: Any
) -> None:
    places = graph.listen(RobotPlace, 'robot_place', STATE_QOS)
    graph.add(
        MotionController,
        {'execution_mode': 'MANUAL', 'console': False, 'feedback_period': 0.02},
    )
    end, seen = control(graph, in_background, Point(x=10.0, y=8.0), 'move 0.2 0.01')
    assert end.status == 'succeeded'
    reached = end.result.reached_point
    assert (reached.x, reached.y) == pytest.approx((10, 8), abs=0.02)
    assert [f.reached_point.x for f in seen] == sorted(f.reached_point.x for f in seen)
    graph.until(lambda: places and places[-1].place == 'C1')
    graph.until(lambda: armor.query.objectprop_b2_ind('isIn', 'Robot1') == ['C1'])


def test_a_move_that_ends_in_no_place_is_aborted_and_not_noted(
    graph: Any, armor: ArmorClient, in_background: Any, capfd: Any
) -> None:
    graph.add(MotionController, {'execution_mode': 'MANUAL', 'console': False})
    end, _ = control(graph, in_background, Point(x=50.0, y=50.0), 'move 0.05 0')
    assert end.status == 'aborted'
    assert (end.result.reached_point.x, end.result.reached_point.y) == (50, 50)
    assert 'expected a place within 2 m, R4 is 49.50 m away' in capfd.readouterr().err
    assert armor.query.objectprop_b2_ind('isIn', 'Robot1') == ['E']


def test_an_ontology_that_comes_back_empty_has_the_robot_where_it_was_last_known_to_be(
    graph: Any, armor: ArmorClient, in_background: Any
) -> None:
    places = graph.listen(RobotPlace, 'robot_place', STATE_QOS)
    told = graph.listen(String, 'motion_controller/announcement', STATE_QOS)
    graph.add(MotionController, {'execution_mode': 'MANUAL', 'console': False})
    graph.until(lambda: places and places[-1].place == 'E')
    caller = GoalCaller(graph.node, FollowPath, 'follow_path')
    goal = FollowPath.Goal(path=[Point(x=5.0, y=10.0), Point(x=50.0, y=50.0)])
    end = in_background(lambda: caller.run(goal, accept_timeout=60.0))
    graph.until(lambda: told)
    console = ServiceCaller(graph.node, ConsoleCommand, 'motion_controller/command')
    assert console.call(ConsoleCommand.Request(line='move 0.05 0'), 60.0).accepted
    assert end().status == 'succeeded'
    graph.until(lambda: places[-1].place == '')
    assert armor.query.objectprop_b2_ind('isIn', 'Robot1') == ['E']
    armor.utils.drop_ref()
    graph.until(lambda: armor.utils.get_all_refs())
    graph.until(lambda: armor.query.objectprop_b2_ind('isIn', 'Robot1') == ['E'])
    assert places[-1].place == ''
