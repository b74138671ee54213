"""What the seeds' own clients rely on: the fact is there when the service has answered."""

from __future__ import annotations

from typing import Any

import pytest
from std_srvs.srv import Empty

from state_machines.ros import ServiceCaller
from surveillance_behaviour.initial_state_node import InitialState
from surveillance_controllers.motion_controller_node import MotionController
from surveillance_interfaces.srv import ReferenceName
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder

from .test_ontology_map_builder import PLACE


def robot_place(graph: Any) -> list[str]:
    """Ask as seed 2's machine does, at once and only once."""
    armor = ArmorClient(graph.node, 'machine', 'surveillance', timeout=60.0)
    return armor.query.objectprop_b2_ind('isIn', 'Robot1')


@pytest.mark.parametrize('robot_first', [True, False])
def test_the_ontology_knows_where_the_robot_is_when_its_name_is_told(
    graph: Any, robot_first: bool
) -> None:
    def add_robot() -> None:
        graph.add(MotionController, {'execution_mode': 'RANDOM', 'robot_room': 'E'})

    if robot_first:
        add_robot()
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, PLACE)
    if not robot_first:
        add_robot()
    names = ServiceCaller(graph.node, ReferenceName, 'ontology_map/reference_name')
    assert names.call(ReferenceName.Request(), 60.0).name == 'surveillance'
    assert robot_place(graph) == ['E']


def test_the_ontology_knows_where_the_robot_is_when_start_has_answered(
    graph: Any,
) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder)
    graph.add(MotionController, {'execution_mode': 'RANDOM', 'robot_room': ''})
    graph.add(InitialState, {**PLACE, 'map_source': 'configuration'})
    ServiceCaller(graph.node, Empty, 'start').call(Empty.Request(), 60.0)
    assert robot_place(graph) == ['E']


def test_the_name_is_told_without_a_robot_and_the_log_says_why(
    graph: Any,
) -> None:
    said = graph.said()
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, PLACE)
    names = ServiceCaller(graph.node, ReferenceName, 'ontology_map/reference_name')
    assert names.call(ReferenceName.Request(), 60.0).name == 'surveillance'
    graph.until(lambda: any('has the robot in no place' in line for line in said))
