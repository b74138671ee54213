"""The armor server, its client and the map builder as nodes in a real graph."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from rclpy.task import Future

from surveillance_fsm.ros import ServiceCaller
from surveillance_interfaces.msg import OntologyMap, OntologyPlace, RoomConnection
from surveillance_interfaces.srv import (
    AddRoom,
    ArmorDirective,
    ReferenceName,
    RemoveRoom,
    RoomPosition,
    SetDoor,
)
from surveillance_ontology.armor_client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    FactSubscription,
)
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.conversions import point_to_ros
from surveillance_ontology.ontology_map_builder_node import OntologyMapBuilder
from surveillance_ontology.patrol_ontology import PatrolOntology
from surveillance_runtime.node import PatrolNode, StartError
from surveillance_runtime.qos import STATE_QOS

from .seven_rooms import IRI, ONTOLOGY, SEVEN_ROOMS, build_seven_rooms

PLACE: dict[str, Any] = {
    **{f'map.{room}': doors for room, doors in SEVEN_ROOMS.items()},
    **{f'room_positions.{room}': [float(i), 1.5] for i, room in enumerate(SEVEN_ROOMS)},
    'robot_room': 'E',
    'recharge_rooms': ['E'],
}


class Caller:
    """Calls the map builder's services from the test's thread."""

    def __init__(self, graph: Any) -> None:
        kinds = {
            'reference_name': ReferenceName,
            'room_position': RoomPosition,
            'add_room': AddRoom,
            'remove_room': RemoveRoom,
            'set_door': SetDoor,
        }
        self._kinds = kinds
        self._callers = {
            name: ServiceCaller(graph.node, kind, f'ontology_map/{name}')
            for name, kind in kinds.items()
        }

    def __call__(self, name: str, **fields: Any) -> Any:
        return self._callers[name].call(self._kinds[name].Request(**fields), 10.0)


@pytest.fixture
def armor(graph: Any) -> ArmorClient:
    """Provide a client of the map builder's ontology."""
    return ArmorClient(graph.node, 'test', 'surveillance')


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
    PatrolOntology(ArmorClient(graph.node, 'test', 'surveillance')).record_place('E', 1)
    return builder


def connected(armor: ArmorClient) -> list[str]:
    """Return what C1 is connected to; nothing while there is no ontology."""
    try:
        return armor.query.objectprop_b2_ind('connectedTo', 'C1')
    except ArmorServiceInternalError:
        return []


def reach(armor: ArmorClient) -> list[str]:
    return armor.query.objectprop_b2_ind('canReach', 'Robot1')


# --- server and client ---


def test_directives_travel_both_ways(graph: Any, tmp_path: Path) -> None:
    graph.add(ArmorServer, {'ontologies_folder': str(tmp_path)})
    armor = ArmorClient(graph.node, 'test', 'map')
    build_seven_rooms(armor, True, False)
    assert reach(armor) == ['C1', 'C2']
    assert armor.query.dataprop_b2_ind('now', 'Robot1') == ['"1665579740"^^xsd:long']
    batch = armor.batch([armor.request('ADD IND', 'X'), armor.request('NO SUCH')])
    assert [row.exit_code for row in batch.responses] == [0, 205]
    assert armor.query.sparql(f'SELECT ?x {{ <{IRI}#Robot1> <{IRI}#isIn> ?x }}') == [
        {'x': f'{IRI}#E'}
    ]
    armor.utils.save_ref_with_inferences(str(tmp_path / 'saved.owl'))
    assert (tmp_path / 'saved.owl').stat().st_size > 1000
    with pytest.raises(ArmorServiceInternalError, match='may not be written'):
        armor.utils.save('/saved.owl')


def test_a_callback_awaits_the_same_methods(graph: Any) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map')
    found: list[Any] = []

    async def use() -> None:
        await armor.utils.load_ref_from_file.call_async(ONTOLOGY, IRI)
        found.append(await armor.query.dataprop_b2_ind.call_async('urgencyThreshold', 'Robot1'))

    armor.utils.get_all_refs()
    graph.node.executor.create_task(use)
    graph.until(lambda: found)
    assert found == [['"7"^^xsd:long']]


def test_a_missing_server_is_reported_in_time(graph: Any) -> None:
    armor = ArmorClient(graph.node, 'test', 'map', timeout=0.1)
    with pytest.raises(ArmorServiceCallError, match='armor_interface_srv'):
        armor.query.ind_b2_class('ROOM')


def test_a_client_that_nobody_spins_says_so(graph: Any) -> None:
    graph.add(ArmorServer)
    lonely = PatrolNode('lonely', context=graph.context, use_global_arguments=False)
    armor = ArmorClient(lonely, 'test', 'map', timeout=0.3)
    with pytest.raises(ArmorServiceCallError, match="no thread spins node 'lonely'") as error:
        armor.utils.get_all_refs()
    assert 'armor_api' in error.value.msg
    lonely.destroy_node()


def test_a_blocking_call_in_a_callback_says_so(graph: Any) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=0.3)
    armor.utils.get_all_refs()
    said: list[str] = []

    def callback() -> None:
        try:
            armor.utils.get_all_refs()
        except ArmorServiceCallError as error:
            said.append(error.msg)

    graph.node.executor.create_task(callback)
    graph.until(lambda: said)
    assert 'call_async' in said[0]


def test_a_client_beside_a_burst_of_another_is_answered_in_its_turn(graph: Any) -> None:
    graph.add(ArmorServer)
    clients = {
        name: graph.node.create_client(ArmorDirective, 'armor_interface_srv')
        for name in ('burst', 'good')
    }
    order: list[str] = []
    done = threading.Event()

    def send(name: str) -> None:
        request = ArmorDirective.Request()
        request.armor_request.client_name = name
        request.armor_request.reference_name = 'map'
        request.armor_request.command = 'MALFORMED'
        clients[name].call_async(request).add_done_callback(lambda _future: count(name))

    def count(name: str) -> None:
        order.append(name)
        if len(order) == 601:
            done.set()

    def both() -> None:
        for _ in range(600):
            send('burst')
        send('good')

    assert all(client.wait_for_service(5.0) for client in clients.values())
    graph.node.executor.create_task(both)
    assert done.wait(20.0), f'{601 - len(order)} of 601 requests were lost'
    assert order.index('good') < 300


def test_a_long_query_keeps_nobody_waiting(graph: Any) -> None:
    graph.add(ArmorServer, {'sparql_timeout': 3.0})
    armor = ArmorClient(graph.node, 'test', 'map')
    armor.utils.load_ref_from_file(ONTOLOGY, IRI)
    ended: list[str] = []

    async def endless() -> None:
        pattern = ' . '.join(f'?a{i} ?b{i} ?c{i}' for i in range(8))
        response = await armor.call.call_async(
            'QUERY', 'SPARQL', '', [f'SELECT (COUNT(*) AS ?n) {{ {pattern} }}', '1500']
        )
        ended.append('stopped' if response.timeout else 'done')

    graph.node.executor.create_task(endless)
    for _ in range(10):
        armor.manipulation.add_ind_to_class('X', 'DOOR')
        assert armor.query.ind_b2_class('DOOR') == ['X']
    assert armor.batch([armor.request('REASON')]).success
    assert not ended, 'the others were answered while the query ran'
    graph.until(lambda: ended)
    assert ended == ['stopped']


def test_parameters_of_the_server(graph: Any, tmp_path: Path) -> None:
    graph.add(ArmorServer, {'enforce_mount': False, 'narrow_doubles': True})
    one, two = (ArmorClient(graph.node, name, 'map') for name in ('one', 'two'))
    one.utils.load_ref_from_file(ONTOLOGY, IRI, mounted=True)
    two.manipulation.add_dataprop_to_ind('size', 'X', 'DOUBLE', '0.5')
    assert two.query.dataprop_b2_ind('size', 'X') == ['"0.5"^^xsd:float']
    (tmp_path / 'file').write_text('')
    with pytest.raises(StartError, match='parameter store'):
        graph.add(ArmorServer, {'store': str(tmp_path / 'file' / 'store')})


def test_a_stored_ontology_outlives_its_server(graph: Any, tmp_path: Path) -> None:
    server = graph.add(ArmorServer, {'store': str(tmp_path / 'store')})
    armor = ArmorClient(graph.node, 'test', 'map')
    build_seven_rooms(armor, False, True)
    armor.utils.mount_on_ref()
    graph.remove(server)
    graph.add(ArmorServer, {'store': str(tmp_path / 'store')})
    assert reach(armor) == ['C1', 'C2']
    assert armor.utils.get_ref_client() == 'test'


# --- subscriptions to facts ---


def test_facts_come_and_go_at_a_subscriber(graph: Any) -> None:
    server = graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map')
    told: list[tuple[str, bool]] = []
    urgent = FactSubscription(
        graph.node, armor, 'URGENT(?)', lambda fact, came: told.append((str(fact), came))
    )
    build_seven_rooms(armor, False, True)
    armor.manipulation.replace_dataprop_b2_ind('visitedAt', 'R3', 'LONG', '1', '1665579740')
    armor.utils.sync_buffered_reasoner()
    graph.until(lambda: told)
    late = FactSubscription(graph.node, armor, 'canReach(Robot1, ?)', lambda _fact, _came: None)
    graph.until(lambda: len(late.facts) == 2)
    armor.manipulation.replace_dataprop_b2_ind('visitedAt', 'R3', 'LONG', '1665579740', '1')
    armor.utils.sync_buffered_reasoner()
    graph.until(lambda: len(told) == 2)
    assert told == [('URGENT(R3)', True), ('URGENT(R3)', False)]
    assert urgent.facts == frozenset()
    graph.remove(server)
    graph.add(ArmorServer)
    graph.until(lambda: not late.facts)
    build_seven_rooms(armor, False, True)
    graph.until(lambda: len(late.facts) == 2)


class HeldClient:
    """A client whose questions wait until they are let go."""

    def __init__(self, graph: Any, armor: ArmorClient) -> None:
        self.reference_name = armor.reference_name
        self.query = self.facts_by_origin = self
        self._armor = armor
        self.go = Future(executor=graph.node.executor)
        self.asked = 0

    async def call_async(self, pattern: str) -> Any:
        self.asked += 1
        await self.go
        return await self._armor.query.facts_by_origin.call_async(pattern)


def test_what_changes_while_the_server_is_asked_is_told_too(graph: Any) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map')
    build_seven_rooms(armor, False, True)
    held = HeldClient(graph, armor)
    told: set[str] = set()
    visits = FactSubscription(
        graph.node,
        held,  # type: ignore[arg-type]
        'visitedAt(R3, ?)',
        lambda fact, came: (told.add if came else told.discard)(str(fact)),
    )
    graph.until(lambda: held.asked)
    for before, after in (('1665579740', '5'), ('5', '6'), ('6', '7')):
        armor.manipulation.replace_dataprop_b2_ind('visitedAt', 'R3', 'LONG', after, before)
    last = 'visitedAt(R3, "7"^^xsd:long)'
    graph.until(lambda: last in map(str, visits.facts))
    graph.node.executor.create_task(held.go.set_result, None)
    graph.until(lambda: set(map(str, visits.facts)) == {last} and held.asked > 1)
    assert told == {last}


# --- the map builder ---


def test_the_builder_waits_for_the_server_and_its_clients_for_the_builder(
    graph: Any, call: Caller, armor: ArmorClient
) -> None:
    graph.add(OntologyMapBuilder, {**PLACE, 'armor_timeout': 0.2})
    assert call('room_position', room_name='C1').valid, 'the node answers meanwhile'
    answers: list[str] = []

    async def ask() -> None:
        caller = ServiceCaller(graph.node, ReferenceName, 'ontology_map/reference_name')
        graph_ready.append(caller)
        answers.append((await caller.call_async(ReferenceName.Request(), 10.0)).name)

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
    assert 'is built anew: ' in lines[0]
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
    assert refused.message.startswith('door.D9: no such door; the doors are D1')


def test_rooms_join_and_leave(armor: ArmorClient, call: Caller, built: OntologyMapBuilder) -> None:
    here = point_to_ros((1.0, 2.0, 0.0))
    assert call('add_room', room_name='R5', position=here, doors=['D8']).success
    assert armor.query.objectprop_b2_ind('connectedTo', 'R5') == []
    assert call('add_room', room_name='E', position=here, doors=['D8']).success
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


def room(name: str, *connections: tuple[str, str]) -> OntologyPlace:
    return OntologyPlace(
        name=name,
        position=point_to_ros((3.0, 4.0, 0.0)),
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
    PatrolOntology(armor).record_place('E', 1)
    assert reach(armor) == ['A']
    publisher.publish(OntologyMap(places=[room('X', ('X', 'D7'))]))
    publisher.publish(OntologyMap(places=[room('B', ('A', 'D2'), ('E', 'D3'))]))
    graph.until(lambda: reach(armor) == ['A', 'B'])
    assert armor.query.ind_b2_class('CORRIDOR') == ['A', 'B', 'E']
    assert call('room_position', room_name='B').valid
    assert not call('room_position', room_name='X').valid, 'a room connected to itself is refused'


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'map.R1': ['D9']}, "parameter map.R1: door 'D9' is in only one place, R1; expected two"),
        ({'robot_room': 'X'}, "parameter robot_room: no room 'X'"),
        ({'map.R1': ['D1', 'D1']}, "parameter map.R1: duplicate door 'D1'"),
        ({'room_positions.X': [1.0, 2.0]}, 'parameter room_positions.X: no such room'),
        ({'recharge_rooms': ['X']}, "parameter recharge_rooms: no room 'X'"),
    ],
)
def test_a_wrong_map_ends_the_builder_with_one_line(
    graph: Any, change: dict[str, Any], words: str
) -> None:
    with pytest.raises(StartError) as refusal:
        graph.add(OntologyMapBuilder, {**PLACE, **change})
    assert words in str(refusal.value)
    assert '\n' not in str(refusal.value)


def test_an_ontology_that_cannot_be_loaded_ends_the_builder(graph: Any, tmp_path: Path) -> None:
    graph.add(ArmorServer, {'ontologies_folder': str(tmp_path)})
    broken = tmp_path / 'broken.owl'
    broken.write_text('<rdf:RDF>\n<oops')
    for path in (broken, tmp_path / 'none.owl'):
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
