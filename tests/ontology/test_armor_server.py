"""The armor server and its clients as nodes in a real graph."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import pytest
from rclpy.task import Future

from armor_service.protocol import DirectiveRequest
from libs.armor_service.tests.seven_rooms import IRI, ONTOLOGY, build_seven_rooms, reach
from surveillance_interfaces.msg import FactChanges
from surveillance_interfaces.srv import ArmorDirective
from surveillance_ontology import armor_client
from surveillance_ontology.armor_client import (
    CHANGES_QOS,
    CHANGES_TOPIC,
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    FactSubscription,
)
from surveillance_ontology.armor_server_node import ArmorServer
from surveillance_ontology.conversions import changes_from_ros
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.parameters import ParameterError


def test_directives_travel_both_ways(graph: Any, tmp_path: Path) -> None:
    graph.add(ArmorServer, {'ontologies_folder': str(tmp_path)})
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
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


def test_an_inconsistent_ontology_is_told_to_whoever_looks_at_health(graph: Any) -> None:
    server = graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    build_seven_rooms(armor, True, False)
    armor.manipulation.add_ind_to_class('D1', 'ROOM')
    armor.utils.sync_buffered_reasoner()
    graph.until(lambda: [text for _, text in server.health.findings()] == ['map is inconsistent'])
    armor.manipulation.remove_ind_from_class('D1', 'ROOM')
    armor.utils.sync_buffered_reasoner()
    graph.until(lambda: not server.health.findings())


def test_an_ontology_that_a_restart_finds_inconsistent_is_told_as_well(
    graph: Any, tmp_path: Path
) -> None:
    kept = {'store': str(tmp_path / 'store')}
    server = graph.add(ArmorServer, kept)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    build_seven_rooms(armor, True, False)
    armor.manipulation.add_ind_to_class('D1', 'ROOM')
    armor.utils.sync_buffered_reasoner()
    graph.remove(server)
    server = graph.add(ArmorServer, kept)
    graph.until(lambda: [text for _, text in server.health.findings()] == ['map is inconsistent'])


def test_a_callback_awaits_the_same_methods(graph: Any) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
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
    ArmorClient(graph.node, 'test', 'map', timeout=60.0).utils.get_all_refs()
    armor = ArmorClient(graph.node, 'test', 'map', timeout=0.3)
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

    assert all(client.wait_for_service(60.0) for client in clients.values())
    graph.node.executor.create_task(both)
    assert done.wait(60.0), f'{601 - len(order)} of 601 requests were lost'
    assert order.index('good') < 300


def test_an_ontology_that_is_used_for_long_keeps_nobody_waiting_for_another(
    graph: Any, tmp_path: Path
) -> None:
    server = graph.add(ArmorServer, {'ontologies_folder': str(tmp_path)})
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    armor.utils.load_ref_from_file(ONTOLOGY, IRI)
    ended: list[bool] = []
    asked = [
        armor.request('LOAD FILE', ONTOLOGY, IRI, 'true', '', 'true'),
        armor.request('SAVE', 'saved.owl'),
        armor.request('ADD CLASS', 'NEW'),
        armor.request('QUERY EXPLAIN INCONSISTENCY'),
    ]

    async def ask(request: DirectiveRequest) -> None:
        ended.append((await armor.transport.call_async(request)).success)

    async def ask_all() -> None:
        ended.append((await armor.transport.call_async(asked)).success)

    other = ArmorClient(graph.node, 'test', 'other', timeout=60.0)
    other.utils.get_all_refs()
    server_waits = (server._work, server._queries, *server._documents.values())
    with server._service.workspace.references.find('map').lock:
        for _ in range(5):
            graph.node.executor.create_task(ask_all)
            for request in asked:
                graph.node.executor.create_task(ask, request)
        graph.until(lambda: [turns.waiting('map') for turns in server_waits] == [9, 3, 4, 4])
        other.utils.load_ref_from_file(ONTOLOGY, IRI)
        assert other.manipulation.add_class('NEW')
        assert other.batch([other.request('REASON')]).success
        assert other.query.explain_inconsistency() is None
        other.utils.save('other.owl')
        assert not ended
    graph.until(lambda: len(ended) == 25)
    assert all(ended)


def test_a_long_query_keeps_nobody_waiting(graph: Any) -> None:
    graph.add(ArmorServer, {'sparql_timeout': 3.0})
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    armor.utils.load_ref_from_file(ONTOLOGY, IRI)
    ended: list[str] = []

    async def endless() -> None:
        pattern = ' . '.join(f'?a{i} ?b{i} ?c{i}' for i in range(8))
        response = await armor.call.call_async(
            'QUERY', 'SPARQL', '', [f'SELECT (COUNT(*) AS ?n) {{ {pattern} }}', '1500']
        )
        ended.append('stopped' if response.timeout else 'done')

    graph.node.executor.create_task(endless)
    answered = 0
    while not ended and answered < 10:
        armor.manipulation.add_ind_to_class('X', 'DOOR')
        assert armor.query.ind_b2_class('DOOR') == ['X']
        assert armor.batch([armor.request('REASON')]).success
        answered += not ended
    assert answered, 'while the query ran'
    graph.until(lambda: ended)
    assert ended == ['stopped']


def test_parameters_of_the_server(graph: Any, tmp_path: Path) -> None:
    graph.add(ArmorServer, {'enforce_mount': False, 'narrow_doubles': True})
    one, two = (ArmorClient(graph.node, name, 'map', timeout=60.0) for name in ('one', 'two'))
    one.utils.load_ref_from_file(ONTOLOGY, IRI, mounted=True)
    two.manipulation.add_dataprop_to_ind('size', 'X', 'DOUBLE', '0.5')
    assert two.query.dataprop_b2_ind('size', 'X') == ['"0.5"^^xsd:float']
    (tmp_path / 'file').write_text('')
    with pytest.raises(NotNowError, match='parameter store'):
        graph.add(ArmorServer, {'store': str(tmp_path / 'file' / 'store')})


def test_a_stored_ontology_outlives_its_server(graph: Any, tmp_path: Path) -> None:
    server = graph.add(ArmorServer, {'store': str(tmp_path / 'store')})
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    build_seven_rooms(armor, False, True)
    armor.utils.mount_on_ref()
    graph.remove(server)
    graph.add(ArmorServer, {'store': str(tmp_path / 'store')})
    assert reach(armor) == ['C1', 'C2']
    assert armor.utils.get_ref_client() == 'test'


def test_a_store_belongs_to_a_place(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    for place, rooms in (('seven_rooms', ['E']), ('office', []), ('seven_rooms', ['E'])):
        server = graph.add(ArmorServer, {'store': 'auto', 'place': place})
        armor.utils.load_ref_from_file(ONTOLOGY, IRI, mounted=True)
        if place == 'seven_rooms':
            armor.manipulation.add_ind_to_class('E', 'ROOM')
        assert armor.query.ind_b2_class('ROOM') == rooms
        graph.remove(server)
    assert 'place office: it has a store of its own' in capfd.readouterr().err
    with pytest.raises(ParameterError, match=r"place '\.\./x': expected letters"):
        graph.add(ArmorServer, {'place': '../x'})


def test_a_change_that_is_under_way_at_a_stop_is_kept(
    graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = graph.add(ArmorServer, {'store': str(tmp_path / 'store')})
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    build_seven_rooms(armor, False, True)
    begun, told_to_stop = threading.Event(), threading.Event()
    execute, on_stop = server._service.execute, server.on_stop

    def held(directive: Any) -> Any:
        begun.set()
        told_to_stop.wait(60.0)
        return execute(directive)

    monkeypatch.setattr(server._service, 'execute', held)
    monkeypatch.setattr(server, 'on_stop', lambda: (on_stop(), told_to_stop.set()))
    change = threading.Thread(target=armor.manipulation.add_ind_to_class, args=('X', 'ROOM'))
    change.start()
    assert begun.wait(60.0)
    graph.remove(server)
    change.join(60.0)
    graph.add(ArmorServer, {'store': str(tmp_path / 'store')})
    assert 'X' in armor.query.ind_b2_class('ROOM')


def test_facts_come_and_go_at_a_subscriber(graph: Any) -> None:
    server = graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
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
    """A client whose answers wait until they are let go.

    Attributes:
        answered: How many answers the server has given so far.
    """

    def __init__(self, graph: Any, armor: ArmorClient) -> None:
        self.reference_name = armor.reference_name
        self.query = self.facts_by_origin = self
        self._armor = armor
        self._executor = graph.node.executor
        self._held: list[Future] = []
        self.answered = 0

    def let_go(self) -> None:
        self._executor.create_task(self._held.pop().set_result, None)

    async def call_async(self, pattern: str) -> Any:
        held = Future(executor=self._executor)
        try:
            return await self._armor.query.facts_by_origin.call_async(pattern)
        finally:
            self._held.append(held)
            self.answered += 1
            await held


def test_what_changes_while_the_server_is_asked_is_told_too(graph: Any) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    build_seven_rooms(armor, False, True)
    held = HeldClient(graph, armor)
    told: set[str] = set()
    visits = FactSubscription(
        graph.node,
        held,  # type: ignore[arg-type]
        'visitedAt(R3, ?)',
        lambda fact, came: (told.add if came else told.discard)(str(fact)),
    )
    graph.until(lambda: held.answered)
    for before, after in (('1665579740', '5'), ('5', '6'), ('6', '7')):
        armor.manipulation.replace_dataprop_b2_ind('visitedAt', 'R3', 'LONG', after, before)
    last = 'visitedAt(R3, "7"^^xsd:long)'
    graph.until(lambda: last in map(str, visits.facts))
    held.let_go()
    graph.until(lambda: held.answered > 1)
    held.let_go()
    graph.until(lambda: told)
    assert set(map(str, visits.facts)) == {last}
    assert told == {last}


def test_what_is_loaded_while_the_server_says_that_there_is_no_such_reference_is_told(
    graph: Any,
) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    held = HeldClient(graph, armor)
    rooms = FactSubscription(
        graph.node,
        held,  # type: ignore[arg-type]
        'ROOM(?)',
        lambda _fact, _came: None,
    )
    graph.until(lambda: held.answered)
    build_seven_rooms(armor, False, True)
    armor.manipulation.add_ind_to_class('X', 'ROOM')
    graph.until(lambda: 'ROOM(X)' in map(str, rooms.facts))
    held.let_go()
    graph.until(lambda: held.answered > 1)
    held.let_go()
    graph.until(lambda: {'ROOM(X)', 'ROOM(R1)'} <= set(map(str, rooms.facts)))


def test_what_goes_before_it_was_ever_known_is_not_kept(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph.add(ArmorServer)
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    build_seven_rooms(armor, False, True)
    held = HeldClient(graph, armor)
    taken: list[tuple[str, bool]] = []
    told: list[tuple[str, bool]] = []

    def noted(message: Any) -> Any:
        changes = changes_from_ros(message)
        taken.extend((str(fact), came) for fact, came, _ in changes)
        return changes

    monkeypatch.setattr(armor_client, 'changes_from_ros', noted)
    visits = FactSubscription(
        graph.node,
        held,  # type: ignore[arg-type]
        'visitedAt(?, ?)',
        lambda fact, came: told.append((fact.arguments[0], came)),
    )
    graph.until(lambda: held.answered)  # what changes before that is in the answer
    armor.manipulation.add_ind_to_class('X', 'ROOM')  # the first message tells where the count is
    graph.until(lambda: ('ROOM(X)', True) in taken)
    held.let_go()
    graph.until(lambda: held.answered > 1)
    armor.manipulation.remove_dataprop_from_ind('visitedAt', 'R3', 'LONG', '1665579740')
    graph.until(lambda: ('visitedAt(R3, "1665579740"^^xsd:long)', False) in taken)
    held.let_go()
    graph.until(lambda: held.answered > 2)
    held.let_go()
    graph.until(lambda: told)
    assert 'R3' not in dict(told)
    assert not any(fact.arguments[0] == 'R3' for fact in visits.facts)


def test_a_load_that_was_missed_is_told_as_one_that_was_heard(graph: Any) -> None:
    armor = ArmorClient(graph.node, 'test', 'map', timeout=60.0)
    reloads: list[int] = []
    rooms = FactSubscription(
        graph.node, armor, 'ROOM(?)', lambda _fact, _came: None, lambda: reloads.append(1)
    )
    publisher = graph.node.create_publisher(FactChanges, CHANGES_TOPIC, CHANGES_QOS)
    graph.until(lambda: reloads)
    for heard, (number, name) in enumerate([(3, 'map'), (6, 'other'), (0, 'map')], 2):
        publisher.publish(FactChanges(sequence=number, reference_name=name))
        graph.until(lambda heard=heard: len(reloads) == heard)
    assert not rooms.facts
