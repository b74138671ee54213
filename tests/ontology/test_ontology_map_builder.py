"""The map builder as a node in a real graph, and a server that comes and goes beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import String

from libs.armor_service.tests.seven_rooms import SEVEN_ROOMS, reach
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import OntologyMap, OntologyPlace, RoomConnection
from surveillance_interfaces.srv import (
    AddRoom,
    ConsoleCommand,
    ReferenceName,
    RemoveRoom,
    RoomPosition,
    SetDoor,
)
from surveillance_ontology import ontology_map_builder_node
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceInternalError,
)
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_ontology.robot_ontology import RobotOntology
from surveillance_runtime.conversions import point_message
from surveillance_runtime.parameters import ParameterError
from surveillance_runtime.place_changes import described_in_text, description_text
from surveillance_runtime.qos import STATE_QOS

PLACE: dict[str, Any] = {
    **{f'map.{room}': doors for room, doors in SEVEN_ROOMS.items()},
    **{f'room_positions.{room}': [float(i), 1.5] for i, room in enumerate(SEVEN_ROOMS)},
    'robot_room': 'E',
    'recharge_rooms': ['E'],
}


@pytest.fixture(autouse=True)
def nobody_waits_for_a_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """No robot tells here where it is."""
    monkeypatch.setattr(ontology_map_builder_node, 'PLACE_SECONDS', 0.01)


class Caller:
    """Calls the map builder's services from the test's thread."""

    def __init__(self, graph: Any) -> None:
        kinds = {
            'reference_name': ReferenceName,
            'room_position': RoomPosition,
            'add_room': AddRoom,
            'remove_room': RemoveRoom,
            'set_door': SetDoor,
            'set_place': ConsoleCommand,
        }
        self._kinds = kinds
        self._callers = {
            name: ServiceCaller(graph.node, kind, f'ontology_map/{name}')
            for name, kind in kinds.items()
        }

    def __call__(self, name: str, **fields: Any) -> Any:
        return self._callers[name].call(self._kinds[name].Request(**fields), 60.0)


@pytest.fixture
def armor(graph: Any) -> ArmorClient:
    """Provide a client of the map builder's ontology."""
    return ArmorClient(graph.node, 'test', 'surveillance', timeout=60.0)


@pytest.fixture
def call(graph: Any) -> Caller:
    """Call services of the map builder."""
    return Caller(graph)


@pytest.fixture
def built(graph: Any, call: Caller) -> OntologyMapBuilder:
    """Provide a server, and a builder that has built the seven rooms."""
    graph.add(ArmorServer)
    builder: OntologyMapBuilder = graph.add(OntologyMapBuilder, PLACE)
    assert call('reference_name').name == 'surveillance'
    armor = ArmorClient(graph.node, 'test', 'surveillance', timeout=60.0)
    RobotOntology(armor).record_place('E', 1)
    return builder


def connected(armor: ArmorClient) -> list[str]:
    """Return what C1 is connected to; nothing while there is no ontology."""
    try:
        return armor.query.objectprop_b2_ind('connectedTo', 'C1')
    except ArmorServiceInternalError:
        return []


def test_the_builder_waits_for_the_server_and_its_clients_for_the_builder(
    graph: Any, call: Caller, armor: ArmorClient
) -> None:
    graph.add(OntologyMapBuilder, {**PLACE, 'armor_timeout': 0.2})
    assert call('room_position', room_name='C1').valid, 'the node answers meanwhile'
    answers: list[str] = []

    async def ask() -> None:
        caller = ServiceCaller(graph.node, ReferenceName, 'ontology_map/reference_name')
        graph_ready.append(caller)
        answers.append((await caller.call_async(ReferenceName.Request(), 60.0)).name)

    graph_ready: list[Any] = []
    graph.node.executor.create_task(ask)
    graph.until(lambda: graph_ready)
    position = call('room_position', room_name='R2')
    assert (position.valid, position.position.x, position.position.y) == (True, 1.0, 1.5)
    assert not call('room_position', room_name='R9').valid
    assert answers == []
    graph.add(ArmorServer)
    graph.until(lambda: answers)
    assert answers == ['surveillance']
    assert armor.query.objectprop_b2_ind('connectedTo', 'E') == ['C1', 'C2']
    assert armor.query.ind_b2_class('CORRIDOR') == ['C1', 'C2', 'E']
    assert armor.query.objectprop_b2_ind('isIn', 'Robot1') == [], 'that is for who knows it'


@pytest.mark.parametrize('urgent_at_start', [True, False])
def test_places_that_nobody_visited_are_urgent_at_the_start_or_not(
    graph: Any, call: Caller, armor: ArmorClient, urgent_at_start: bool
) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, {**PLACE, 'urgent_at_start': urgent_at_start})
    assert call('reference_name').name == 'surveillance'
    visits = {
        value for room in SEVEN_ROOMS for value in armor.query.dataprop_b2_ind('visitedAt', room)
    }
    assert (visits == {'"0"^^xsd:long'}) is urgent_at_start
    assert armor.query.ind_b2_class('URGENT') == (sorted(SEVEN_ROOMS) if urgent_at_start else [])


def test_places_that_nobody_visited_are_urgent_where_simulated_time_begins(
    graph: Any, call: Caller, armor: ArmorClient
) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, {**PLACE, 'use_sim_time': True})
    assert call('reference_name').name == 'surveillance'
    assert armor.query.ind_b2_class('URGENT') == sorted(SEVEN_ROOMS)
    ontology = RobotOntology(armor)
    ontology.record_place('E', 1)
    assert ontology.snapshot(0.0, ['URGENT']).visited_at == {}


def test_a_server_that_comes_back_empty_gets_the_map_again(
    graph: Any, call: Caller, armor: ArmorClient, built: OntologyMapBuilder
) -> None:
    assert call('set_door', door='D1', open=False).success
    armor.utils.drop_ref()
    graph.until(lambda: armor.utils.get_all_refs())
    graph.until(lambda: armor.query.objectprop_b2_ind('connectedTo', 'C1'))
    assert armor.query.objectprop_b2_ind('connectedTo', 'C1') == ['C2', 'E', 'R2'], 'still closed'
    assert armor.query.objectprop_b2_ind('isIn', 'Robot1') == [], 'no start value for the robot'


def test_an_ontology_that_contradicts_itself_is_built_anew_once(
    graph: Any, call: Caller, armor: ArmorClient, built: OntologyMapBuilder, capfd: Any
) -> None:
    assert call('set_door', door='D1', open=False).success
    armor.manipulation.add_ind_to_class('R1', 'DOOR')
    assert not armor.utils.sync_buffered_reasoner()
    graph.until(lambda: armor.utils.get_all_refs() and connected(armor) == ['C2', 'E', 'R2'])
    assert armor.utils.sync_buffered_reasoner()
    lines = [line for line in capfd.readouterr().err.splitlines() if 'contradicts itself' in line]
    assert len(lines) == 1
    assert 'is built again: ' in lines[0]
    assert 'DOOR' in lines[0]
    assert 'R1' in lines[0]


def test_a_builder_that_comes_back_keeps_what_the_ontology_knows(
    graph: Any, call: Caller, armor: ArmorClient, built: OntologyMapBuilder
) -> None:
    armor.manipulation.replace_one_dataprop_b2_ind('visitedAt', 'R1', 'LONG', '5')
    armor.manipulation.replace_objectprop_b2_ind('isIn', 'Robot1', 'C1', 'E')
    call('set_door', door='D5', open=False)
    graph.remove(built)
    graph.add(OntologyMapBuilder, PLACE)
    assert call('reference_name').name == 'surveillance'
    assert armor.query.dataprop_b2_ind('visitedAt', 'R1') == ['"5"^^xsd:long']
    assert reach(armor) == ['E', 'R1', 'R2'], 'D5 is still closed'
    assert call('set_door', door='D5', open=True).success
    assert reach(armor) == ['C2', 'E', 'R1', 'R2']


def test_doors_close_and_open(armor: ArmorClient, call: Caller, built: OntologyMapBuilder) -> None:
    answer = call('set_door', door='D6', open=False)
    assert (answer.success, answer.message) == (True, 'D6 is closed')
    assert reach(armor) == ['C2']
    assert armor.query.objectprop_b2_ind('connectedTo', 'E') == ['C2']
    assert armor.query.ind_b2_class('CORRIDOR') == ['C1', 'C2', 'E'], 'it has its doors still'
    call('set_door', door='D7', open=False)
    assert reach(armor) == []
    call('set_door', door='D7', open=False)
    for door in ('D6', 'D7'):
        assert call('set_door', door=door, open=True).success
    assert reach(armor) == ['C1', 'C2']
    refused = call('set_door', door='D9', open=True)
    assert not refused.success
    assert refused.message.startswith('door.D9: no such door, expected one of D1')


def test_rooms_join_and_leave(armor: ArmorClient, call: Caller, built: OntologyMapBuilder) -> None:
    here = point_message((1.0, 2.0, 0.0))
    added = call('add_room', room_name='R5', position=here, doors=['D8'])
    assert (added.success, added.message) == (True, 'R5 has D8; no other place has D8 yet')
    assert armor.query.objectprop_b2_ind('connectedTo', 'R5') == []
    assert call('add_room', room_name='E', position=here, doors=['D8']).message == 'E has D8'
    beside = point_message((1.2, 2.0, 0.0))
    near = call('add_room', room_name='R6', position=beside, doors=['D9'])
    assert near.message == 'R6 has D9; no other place has D9 yet; its point is that of E, R5'
    assert call('remove_room', room_name='R6').success
    assert reach(armor) == ['C1', 'C2', 'R5']
    assert call('room_position', room_name='R5').position.y == 2.0
    assert 'R5' in armor.query.ind_b2_class('ROOM')
    assert call('remove_room', room_name='R5').success
    assert reach(armor) == ['C1', 'C2']
    assert not armor.query.check_ind_exists('R5')
    assert not call('room_position', room_name='R5').valid
    for name, words in (('R9', 'no such room'), ('E', 'charging station'), ('C1', 'only way to')):
        refused = call('remove_room', room_name=name)
        assert not refused.success
        assert words in refused.message
    armor.manipulation.replace_objectprop_b2_ind('isIn', 'Robot1', 'R1', 'E')
    assert 'the robot is in it' in call('remove_room', room_name='R1').message
    assert 'at least one' in call('add_room', room_name='R6', position=here, doors=[]).message
    for name, door in (('Robot1', 'D9'), ('R6', 'Robot1')):
        refused = call('add_room', room_name=name, position=here, doors=[door])
        assert not refused.success
        assert "'Robot1' is the robot's name" in refused.message


def test_rooms_that_were_added_and_removed_are_there_after_a_restart(
    graph: Any, armor: ArmorClient, call: Caller, tmp_path: Path
) -> None:
    graph.add(ArmorServer)
    parameters = {**PLACE, 'state_file': str(tmp_path / 'builder.json')}
    builder = graph.add(OntologyMapBuilder, parameters)
    assert call('reference_name').name == 'surveillance'
    here = point_message((1.0, 2.0, 0.0))
    assert call('add_room', room_name='R5', position=here, doors=['D8']).success
    assert call('add_room', room_name='E', position=here, doors=['D8']).success
    assert call('add_room', room_name='R6', position=here, doors=['loose']).success
    assert call('remove_room', room_name='R1').success
    graph.remove(builder)
    builder = graph.add(OntologyMapBuilder, parameters)
    assert call('reference_name').name == 'surveillance'
    assert call('room_position', room_name='R5').position.y == 2.0
    assert not call('room_position', room_name='R1').valid
    assert not armor.query.check_ind_exists('R1')
    RobotOntology(armor).record_place('E', 1)
    assert reach(armor) == ['C1', 'C2', 'R5']
    assert call('remove_room', room_name='R6').success
    graph.remove(builder)
    graph.add(OntologyMapBuilder, {**parameters, 'room_positions.E': [9.0, 9.0]})
    assert call('reference_name').name == 'surveillance'
    assert not call('room_position', room_name='R5').valid, 'another place was described'


def room(name: str, *connections: tuple[str, str]) -> OntologyPlace:
    return OntologyPlace(
        name=name,
        position=point_message((3.0, 4.0, 0.0)),
        connections=[RoomConnection(connected_to=to, through_door=by) for to, by in connections],
    )


def test_a_map_comes_over_the_topic_in_parts(graph: Any, armor: ArmorClient, call: Caller) -> None:
    graph.add(ArmorServer)
    graph.add(OntologyMapBuilder)
    assert not call('room_position', room_name='E').valid
    assert not call('set_door', door='D1', open=True).success
    publisher = graph.node.create_publisher(OntologyMap, 'ontology_map/build_map', STATE_QOS)
    first = [room('E', ('A', 'D1')), room('A', ('E', 'D1'), ('B', 'D2'))]
    publisher.publish(OntologyMap(places=first, robot_room='E'))
    assert call('reference_name').name == 'surveillance'
    RobotOntology(armor).record_place('E', 1)
    assert reach(armor) == ['A']
    publisher.publish(OntologyMap(places=[room('X', ('X', 'D7'))]))
    publisher.publish(OntologyMap(places=[room('B', ('A', 'D2'), ('E', 'D3'))]))
    graph.until(lambda: reach(armor) == ['A', 'B'])
    assert armor.query.ind_b2_class('CORRIDOR') == ['A', 'B', 'E']
    assert call('room_position', room_name='B').valid
    assert not call('room_position', room_name='X').valid, 'a room connected to itself is refused'
    publisher.publish(OntologyMap(places=[room('Robot1', ('A', 'D8'))]))
    publisher.publish(OntologyMap(places=[room('Z', ('A', 'D9'))]))
    graph.until(lambda: call('room_position', room_name='Z').valid)
    assert not call('room_position', room_name='Robot1').valid


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'map.R1': ['D9']}, "parameter map.R1: door 'D9' is in only one place, R1; expected two"),
        ({'robot_room': 'X'}, "parameter robot_room: no room 'X'"),
        ({'map.R1': ['D1', 'D1']}, "parameter map.R1: duplicate door 'D1'"),
        ({'room_positions.X': [1.0, 2.0]}, 'parameter room_positions.X: no such room'),
        ({'recharge_rooms': ['X']}, "parameter recharge_rooms: no room 'X'"),
        (
            {'map.Robot1': ['D8'], 'map.R1': ['D1', 'D8'], 'room_positions.Robot1': [1.0, 2.0]},
            "parameter map.Robot1: 'Robot1' is the robot's name: expected another one",
        ),
    ],
)
def test_a_wrong_map_ends_the_builder_with_one_line(
    graph: Any, change: dict[str, Any], words: str
) -> None:
    with pytest.raises(ParameterError) as refusal:
        graph.add(OntologyMapBuilder, {**PLACE, **change})
    assert words in str(refusal.value)
    assert '\n' not in str(refusal.value)


def test_an_ontology_that_cannot_be_loaded_ends_the_builder(graph: Any, tmp_path: Path) -> None:
    graph.add(ArmorServer, {'ontologies_folder': str(tmp_path)})
    broken = tmp_path / 'broken.owl'
    broken.write_text('<rdf:RDF>\n<oops')
    for path in (broken, tmp_path / ('a' * 80 + '.owl')):
        builder = graph.add(OntologyMapBuilder, {**PLACE, 'ontology_path': str(path)})
        graph.until(lambda builder=builder: builder.failure)
        assert builder.failure.startswith('cannot build the map: ')
        assert path.stem in builder.failure
        graph.remove(builder)


def test_a_server_that_dies_and_comes_back_gets_the_map_again(
    graph: Any, call: Caller, armor: ArmorClient
) -> None:
    server = graph.add(ArmorServer)
    graph.add(OntologyMapBuilder, {**PLACE, 'armor_timeout': 0.3})
    assert call('reference_name').name == 'surveillance'
    graph.drop(server)
    graph.add(ArmorServer)
    graph.until(lambda: armor.utils.get_all_refs() and armor.query.check_ind_exists('C1'))
    assert call('reference_name').name == 'surveillance'
    graph.until(lambda: armor.query.objectprop_b2_ind('connectedTo', 'E') == ['C1', 'C2'])


def test_a_place_that_was_changed_is_taken_told_and_kept(
    graph: Any, armor: ArmorClient, call: Caller, tmp_path: Path
) -> None:
    graph.add(ArmorServer)
    described: dict[str, Any] = {
        'map': {room: list(doors) for room, doors in SEVEN_ROOMS.items()},
        'room_positions': {room: [float(i), 1.5] for i, room in enumerate(SEVEN_ROOMS)},
        'robot_room': 'E',
        'recharge_rooms': ['E'],
    }
    given = {**PLACE, 'state_file': str(tmp_path / 'state.json')}
    builder = graph.add(OntologyMapBuilder, given)
    told = graph.listen(String, 'place', STATE_QOS)
    call('reference_name')
    # R1 has another name, and R2 is cut in two.
    described['map']['kitchen'] = described['map'].pop('R1')
    described['room_positions']['kitchen'] = described['room_positions'].pop('R1')
    described['map']['R5'], described['room_positions']['R5'] = ['D8'], [2.5, 3.5]
    described['map']['R2'] = ['D2', 'D8']
    described['keep_out_zones'] = {'Z': [0.0, 9.0, 1.0, 9.0, 1.0, 10.0]}
    answer = call('set_place', line=description_text(described))
    assert (answer.accepted, answer.answer) == (
        True,
        'the mission has the place now: 8 rooms, 8 doors',
    )
    assert not armor.query.check_ind_exists('R1')
    assert armor.query.objectprop_b2_ind('connectedTo', 'R5') == ['R2']
    assert call('room_position', room_name='kitchen').valid
    graph.until(lambda: bool(told))
    assert described_in_text(told[-1].data) == described
    for change, words in (
        ({'map': {}}, 'map: expected rooms'),
        ({'hours': {'R2': 'noon'}}, 'hours.R2: '),
        ({'keep_out_zones': {'Z': [1]}}, 'keep_out_zones.Z: '),
        ({'station': [3.0]}, 'station: '),
    ):
        refused = call('set_place', line=description_text({**described, **change}))
        assert not refused.accepted
        assert words in refused.answer
    assert 'expected a JSON object' in call('set_place', line='[1]').answer
    # The station has moved.
    described['station'] = [3.0, 3.0, 0.0]
    assert call('set_place', line=description_text(described)).accepted
    assert call('room_position', room_name='E/station').position.x == 3.0
    # A builder that is started again tells it again.
    graph.remove(builder)
    told.clear()
    graph.add(OntologyMapBuilder, given)
    graph.until(lambda: bool(told))
    assert call('room_position', room_name='kitchen').valid


def test_robots_of_a_fleet_share_the_map_and_each_has_its_own_place(
    graph: Any, armor: ArmorClient, call: Caller
) -> None:
    graph.add(ArmorServer)
    start = [0.0, 0.0, 0.0]
    graph.add(
        OntologyMapBuilder, parameters={'robots.anna.start': start, 'robots.bert.start': start}
    )
    rooms = [room('E', ('A', 'D1')), room('A', ('E', 'D1'), ('B', 'D2')), room('B', ('A', 'D2'))]
    for robot, found in (('anna', rooms[:2]), ('bert', rooms[1:])):
        topic = f'{robot}/ontology_map/build_map'
        publisher = graph.node.create_publisher(OntologyMap, topic, STATE_QOS)
        publisher.publish(OntologyMap(places=found, robot_room=found[0].name))
    assert call('reference_name').name == 'surveillance'
    graph.until(lambda: call('room_position', room_name='B').valid)
    graph.until(lambda: call('room_position', room_name='E').valid)
    RobotOntology(armor, 'anna').record_place('E', 1)
    RobotOntology(armor, 'bert').record_place('A', 1)
    graph.until(lambda: RobotOntology(armor, 'anna').reachable() == {'A'})
    assert RobotOntology(armor, 'bert').reachable() == {'B', 'E'}
    first = RobotOntology(armor, 'anna').snapshot(1000.0, ['URGENT'], visits={'E': 1000.0})
    # A visit of one is known to the other, and neither is taken for the robot of the seeds.
    second = RobotOntology(armor, 'bert').snapshot(1001.0, ['URGENT'], threshold=240.0)
    assert (first.place, second.place) == ('E', 'A')
    assert second.visited_at['E'] == 1000.0
    assert armor.query.ind_b2_class('ROBOT') == ['anna', 'bert']
