"""The start of the behaviour patrol as a whole: from pixels over markers to an ontology."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_msgs.msg import Int32
from std_srvs.srv import Empty

from state_machines.ros import ServiceCaller
from surveillance_behaviour.initial_state_node import InitialState
from surveillance_interfaces.msg import OntologyMap
from surveillance_interfaces.srv import ReferenceName, RoomPosition, SetMarker
from surveillance_ontology.armor_client import ArmorClient
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_perception.arm_controller_node import ArmController
from surveillance_perception.aruco_detector_node import IDS_QOS, ArucoDetector
from surveillance_perception.marker_server_node import MarkerServer
from surveillance_runtime.qos import STATE_QOS
from surveillance_simulation.simulator_node import Simulator

CONFIG = Path(__file__).parents[2] / 'config'
SIMULATED = {'use_sim_time': True}


def place() -> dict[str, Any]:
    described = yaml.safe_load((CONFIG / 'patrol_world.yaml').read_text())['/**']['ros__parameters']
    flat: dict[str, Any] = {}
    for name, value in described.items():
        if isinstance(value, dict):
            flat |= {f'{name}.{entry}': each for entry, each in value.items()}
        else:
            flat[name] = value
    return flat


def robot(graph: Any) -> list[Int32]:
    """Return all nodes of the start, with no deadline; the list of ids as they are found."""
    ids = graph.listen(Int32, 'aruco_detector/id', IDS_QOS)
    # every wait ends by what happens: a busy machine only makes it longer
    patient = SIMULATED | {'patience': 30.0, 'pictures': 2}
    graph.add(Simulator, parameters=place() | {'speed': 4.0, 'camera.rate': 5.0})
    graph.add(ArucoDetector, parameters=SIMULATED | {'known_ids': [*range(11, 18)]})
    graph.add(MarkerServer, parameters=SIMULATED)
    graph.add(ArmController, parameters=patient)
    options = {'robot_room': 'E', 'dwell': 0.1, 'deadline': 1e4}
    graph.add(InitialState, parameters=patient | options)
    return ids


def started(graph: Any) -> Any:
    client = graph.node.create_client(Empty, 'start')
    graph.until(client.service_is_ready)
    return client.call_async(Empty.Request())


def test_start_from_pixels_to_ontology_with_one_marker_covered_until_later(graph: Any) -> None:
    graph.add(ArmorServer, parameters=SIMULATED)
    # the place's file is for the simulator: the builder must not take its map from there
    graph.add(OntologyMapBuilder, parameters=place() | SIMULATED | {'map_source': 'markers'})
    maps = graph.listen(OntologyMap, 'ontology_map/build_map', STATE_QOS)
    ids = robot(graph)
    marker = ServiceCaller(graph.node, SetMarker, 'simulation/set_marker')
    covered = SetMarker.Request(name='m13', state=SetMarker.Request.COVERED)
    assert marker.call(covered, 60.0).success
    done = started(graph)
    graph.until(lambda: len(ids) == 6, timeout=300.0)
    assert not done.done()

    setter = ServiceCaller(graph.node, SetParameters, 'initial_state/set_parameters')
    deadline = Parameter('deadline', value=0.0).to_parameter_msg()
    assert setter.call(SetParameters.Request(parameters=[deadline]), 60.0).results[0].successful
    graph.until(done.done)
    reference = ServiceCaller(graph.node, ReferenceName, 'ontology_map/reference_name')
    name = reference.call(ReferenceName.Request(), 60.0).name
    armor = ArmorClient(graph.node, 'test', name, timeout=60.0)
    assert set(armor.query.ind_b2_class('LOCATION')) == {'E', 'C1', 'R1', 'R2'}
    assert maps[-1].robot_room == 'E'

    in_view = SetMarker.Request(
        name='m13', state=SetMarker.Request.MOVED, id=13, x=5.93, y=7.6, z=1.1, yaw=3.1416
    )
    assert marker.call(in_view, 60.0).success
    whole = {'E', 'C1', 'C2', 'R1', 'R2', 'R3', 'R4'}
    graph.until(lambda: {each.name for each in maps[-1].places} == whole, timeout=60.0)
    graph.until(lambda: set(armor.query.ind_b2_class('CORRIDOR')) == {'C1', 'C2', 'E'}, 60.0)
    assert set(armor.query.objectprop_b2_ind('hasDoor', 'C1')) == {'D1', 'D2', 'D5', 'D7'}
    assert maps[-1].robot_room == '', 'where the robot is by now is told by who knows it'
    position = ServiceCaller(graph.node, RoomPosition, 'ontology_map/room_position')
    answer = position.call(RoomPosition.Request(room_name='R4'), 60.0)
    assert (answer.position.x, answer.position.y) == (9.0, -4.0)
