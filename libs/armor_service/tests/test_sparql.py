"""SPARQL: what it sees, how it answers, and that nothing makes it run on."""

from __future__ import annotations

import json
import random
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from armor_service.access import Settings
from armor_service.client import (
    ArmorClient,
    ArmorServiceInternalError,
    InProcessTransport,
    checked,
)
from armor_service.reference import Origin, Reference
from armor_service.service import ArmorService
from armor_service.sparql import GraphChanges, GraphUpdate, SparqlEngine, Version
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import ObjectPropertyAssertion
from owl_reasoner.owl.vocabulary import OWL

from .seven_rooms import IRI, ONTOLOGY, asker, build_seven_rooms

PREFIX = f'PREFIX : <{IRI}#> '
ENDLESS = PREFIX + 'SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }'


@pytest.fixture
def built(client: ArmorClient) -> ArmorClient:
    """Provide a client of a built map."""
    build_seven_rooms(client, False, True)
    return client


def test_rows_as_one_text_and_as_pairs(service: ArmorService, built: ArmorClient) -> None:
    ask = asker(service)
    query = PREFIX + 'SELECT ?x ?v { :Robot1 :canReach ?x . ?x :visitedAt ?v } ORDER BY ?x'
    long = '1665579740^^http://www.w3.org/2001/XMLSchema#long'
    assert ask('QUERY SPARQL', query).queried_objects == [
        f'{{x={IRI}#C1, v={long}}}, {{x={IRI}#C2, v={long}}}'
    ]
    formatted = ask('QUERY SPARQL FORMATTED', query)
    assert formatted.queried_objects == []
    assert formatted.sparql_queried_objects == [
        ('x', f'{IRI}#C1'),
        ('v', long),
        ('x', f'{IRI}#C2'),
        ('v', long),
    ]
    parts = (PREFIX, 'SELECT ?x ', '{ :Robot1 :isIn ?x }')
    for args in (parts, (*parts, '5000'), (''.join(parts), '5000')):
        assert ask('QUERY SPARQL', *args).queried_objects == [f'{{x={IRI}#E}}']
    assert ask('QUERY SPARQL', PREFIX + 'SELECT ?x { :R9 :isIn ?x }').queried_objects == ['']


def test_rows_as_json_hold_texts_as_they_are(service: ArmorService, built: ArmorClient) -> None:
    ask = asker(service)
    ask('ADD DATAPROP IND', 'called', 'R1', 'STRING', 'Küche "1"')
    query = PREFIX + 'SELECT ?x ?v { :R1 :isIn ?x } '
    optional = PREFIX + 'SELECT ?x ?v { :R1 :called ?x OPTIONAL { :R1 :isIn ?v } }'
    assert ask('QUERY SPARQL ROWS', query).queried_objects == []
    (row,) = ask('QUERY SPARQL ROWS', optional).queried_objects
    assert json.loads(row).keys() == {'x'}
    assert 'Küche \\"1\\"' in row


def test_it_follows_the_ontology(built: ArmorClient) -> None:
    query = PREFIX + 'SELECT ?x { ?x a :URGENT } ORDER BY ?x'
    assert built.query.sparql(query) == []
    built.manipulation.replace_one_dataprop_b2_ind('visitedAt', 'R2', 'LONG', '1665579700')
    built.utils.sync_buffered_reasoner()
    assert built.query.sparql(query) == [{'x': f'{IRI}#R2'}]
    subclasses = PREFIX + (
        'PREFIX rdfs: <http://www.w3.org/2000/01/rdf-schema#> '
        'SELECT ?x { ?x rdfs:subClassOf :LOCATION } ORDER BY ?x'
    )
    found = [row['x'].rpartition('#')[2] for row in built.query.sparql(subclasses)]
    assert found == ['CORRIDOR', 'ROOM', 'URGENT']


def test_rows_keep_apart_what_they_leave_unbound(built: ArmorClient) -> None:
    query = PREFIX + (
        'SELECT ?place ?door { { :Robot1 :isIn ?place } UNION { :R1 :hasDoor ?door } '
        'UNION { :R2 :hasDoor ?other } }'
    )
    rows = sorted(built.query.sparql(query), key=str)
    assert rows == [{'door': f'{IRI}#D1'}, {'place': f'{IRI}#E'}, {}]


def test_values_come_back_as_they_were_written(service: ArmorService, built: ArmorClient) -> None:
    ask = asker(service)
    for prop, ind, kind, value in (
        ('size', 'R1', 'INTEGER', '7'),
        ('size', 'R2', 'FLOAT', '7'),
        ('seats', 'R1', 'LONG', '7'),
        ('seats', 'R2', 'INTEGER', '2'),
        ('open', 'R1', 'BOOLEAN', 'true'),
    ):
        ask('ADD DATAPROP IND', prop, ind, kind, value)

    def shown(query: str) -> str:
        text = ask('QUERY SPARQL', PREFIX + query).queried_objects[0]
        return text.replace('http://www.w3.org/2001/XMLSchema#', '').replace(f'{IRI}#', '')

    assert shown('SELECT ?v { :R1 :size ?v }') == '{v=7^^integer}'
    assert shown('SELECT ?v { :R1 :seats ?v }') == '{v=7^^long}'
    assert shown('SELECT ?v { :R2 :size ?v }') == '{v=7.0^^float}'
    assert shown('SELECT ?v { ?r :seats ?v FILTER(?v < 3) }') == '{v=2^^integer}', 'not as in min 2'
    both = f'SELECT ?a ?b {{ :R1 :size ?a ; <{IRI}#seats> ?b }}'
    assert shown(both) == '{a=7^^integer, b=7^^long}'
    by_row = 'SELECT ?p ?v { :R1 ?p ?v FILTER(?p IN (:size, :seats)) } ORDER BY DESC(?p)'
    assert shown(by_row) == '{p=size, v=7^^integer}, {p=seats, v=7^^long}'
    assert shown('SELECT (?v + 0 AS ?n) { :R1 :seats ?v }') == '{n=7^^integer}', 'computed'


QUERY = 'SELECT ?c { <urn:a> <urn:b> ?c }'


def test_the_time_asked_for_is_the_querys_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Starting the process and handing over the graph do not count, however long they take."""
    passed = 0.0
    clock = time.monotonic

    def update(*_: object) -> GraphUpdate:
        nonlocal passed
        passed += 100.0
        fact = ObjectPropertyAssertion('urn:b', 'urn:a', 'urn:c')
        return GraphUpdate(Version(0, True, 0), True, 'urn:x', [fact])

    monkeypatch.setattr(time, 'monotonic', lambda: clock() + passed)
    monkeypatch.setattr(GraphChanges, 'update', update)
    ref = Reference('map', KnowledgeBase('urn:x'), Origin('', ''))
    patient, short = (SparqlEngine(Settings(sparql_timeout=most)) for most in (1000.0, 50.0))
    try:
        rows = patient.select(ref, QUERY, 20.0)
        assert [[item.value for item in row] for row in rows] == [['urn:c']]
        with pytest.raises(TimeoutError):
            short.select(ref, QUERY, 20.0)
    finally:
        patient.close()
        short.close()


def test_derived_facts_can_be_left_out() -> None:
    service = ArmorService(Settings(sparql_derived=False))
    client = ArmorClient('c', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, True)
    assert client.query.sparql(PREFIX + 'SELECT ?x { :Robot1 :canReach ?x }') == []
    assert client.query.sparql(PREFIX + 'SELECT ?x { :Robot1 :isIn ?x }') == [{'x': f'{IRI}#E'}]
    service.close()


def test_a_query_is_stopped_at_its_time(service: ArmorService, built: ArmorClient) -> None:
    answer = asker(service)('QUERY SPARQL', ENDLESS, '300')
    assert (answer.success, answer.timeout) == (False, True)
    assert answer.error_description == 'QUERY SPARQL: stopped after 300 ms'
    assert built.query.sparql(PREFIX + 'SELECT ?x { :Robot1 :isIn ?x }'), 'the next one runs'


def test_a_query_process_that_is_stopped_costs_its_query_alone(
    service: ArmorService, built: ArmorClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def start(*args: Any, **options: Any) -> subprocess.Popen[bytes]:
        started.append(popen(*args, **options))
        return started[-1]

    popen = subprocess.Popen
    monkeypatch.setattr(subprocess, 'Popen', start)
    ask = asker(service)
    assert built.query.sparql(PREFIX + 'SELECT ?x { :Robot1 :isIn ?x }'), 'its process is kept'
    started[0].send_signal(signal.SIGSTOP)
    answer = ask('QUERY SPARQL', PREFIX + 'SELECT ?x { :Robot1 :isIn ?x }', '300')
    assert (answer.success, answer.timeout) == (False, True)
    assert started[0].poll() is not None
    assert built.query.sparql(PREFIX + 'SELECT ?x { :Robot1 :isIn ?x }'), 'the next one runs'


def test_the_server_sets_the_longest_time(tmp_path: Path) -> None:
    service = ArmorService(Settings(sparql_timeout=0.3))
    client = ArmorClient('c', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, True)
    for args in ((ENDLESS,), (ENDLESS, '0'), (ENDLESS, '-1'), (ENDLESS, '600000')):
        answer = asker(service)('QUERY SPARQL', *args)
        assert (answer.success, answer.timeout) == (False, True)
    service.close()


def test_queries_that_cannot_be_answered_say_why(service: ArmorService, built: ArmorClient) -> None:
    ask = asker(service)
    for query, words in (
        ('SELECT', 'not valid SPARQL'),
        ('ASK { ?a ?b ?c }', 'expected a SELECT query'),
        ('INSERT DATA { <urn:a> <urn:b> <urn:c> }', 'not valid SPARQL'),
    ):
        answer = ask('QUERY SPARQL', query)
        assert (answer.success, answer.exit_code, answer.timeout) == (False, 205, False)
        assert words in answer.error_description
    assert 'got 5' in ask('QUERY SPARQL', *'abcde').error_description
    with pytest.raises(ArmorServiceInternalError, match='not valid SPARQL'):
        built.query.sparql('SELECT')


def test_rows_are_bounded() -> None:
    service = ArmorService(Settings(sparql_rows=5))
    client = ArmorClient('c', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, True)
    answer = asker(service)('QUERY SPARQL', 'SELECT * { ?a ?b ?c }')
    assert 'more than 5 rows' in answer.error_description
    service.close()


def test_a_query_reaches_no_other_machine(service: ArmorService, built: ArmorClient) -> None:
    with socket.create_server(('127.0.0.1', 0)) as listener:
        address = f'http://127.0.0.1:{listener.getsockname()[1]}/'
        answer = asker(service)(
            'QUERY SPARQL', f'SELECT * {{ SERVICE <{address}> {{ ?a ?b ?c }} }}'
        )
        assert not answer.success
        assert 'SERVICE asks another machine; expected' in answer.error_description
        listener.setblocking(False)
        with pytest.raises(BlockingIOError):
            listener.accept()


@pytest.mark.parametrize(
    ('query', 'keyword'),
    [
        ('SELECT ?a { SERVICE SILENT <urn:a> { ?a ?b ?c } }', 'SERVICE'),
        ('SELECT ?a { VALUES ?s { <urn:a> } service ?s { ?a ?b ?c } }', 'SERVICE'),
        (r"""SELECT ?a { ?a ?b 'it\'s', "#" SERVICE<urn:a>{ ?a ?b ?c } }""", 'SERVICE'),
        ('SELECT ?a FROM <file:///etc/passwd> { ?a ?b ?c }', 'FROM'),
        ('SELECT ?a FROM NAMED <http://127.0.0.1/> { GRAPH ?g { ?a ?b ?c } }', 'FROM'),
    ],
)
def test_a_query_that_leaves_the_ontology_is_refused(
    service: ArmorService, built: ArmorClient, query: str, keyword: str
) -> None:
    answer = asker(service)('QUERY SPARQL', query)
    assert (answer.success, answer.exit_code) == (False, 205)
    assert answer.error_description.startswith(f'QUERY SPARQL: {keyword} ')


@pytest.mark.parametrize(
    'query',
    [
        'SELECT ?from { BIND("SERVICE <urn:a>" AS ?from) }',
        "SELECT ?a { BIND('''a ' FROM''' AS ?a) } # SERVICE",
        'PREFIX service: <urn:SERVICE#> SELECT ?a { VALUES ?a { service:from } }',
    ],
)
def test_words_that_are_no_keywords_do_no_harm(built: ArmorClient, query: str) -> None:
    assert len(built.query.sparql(query)) == 1


def test_an_answer_of_many_long_texts_is_bounded(service: ArmorService, built: ArmorClient) -> None:
    doubled = ' '.join(f'BIND(CONCAT(?t{n}, ?t{n}) AS ?t{n + 1})' for n in range(10))
    text = 'x' * 1000
    query = f'SELECT ?t10 {{ ?a ?b ?c . BIND("{text}" AS ?t0) {doubled} }}'
    answer = asker(service)('QUERY SPARQL', query)
    assert not answer.success
    assert 'more than 67108864 characters' in answer.error_description


def test_a_service_that_closes_stops_its_queries(service: ArmorService, built: ArmorClient) -> None:
    answers: list[str] = []
    thread = threading.Thread(
        target=lambda: answers.append(asker(service)('QUERY SPARQL', ENDLESS).error_description)
    )
    thread.start()
    while not service.workspace.sparql.is_busy():
        thread.join(0.01)
    service.workspace.sparql.close()
    thread.join(60.0)
    assert answers == ['QUERY SPARQL: the server stops']
    assert not asker(service)('QUERY SPARQL', 'SELECT * { ?a ?b ?c }').success


def graph_of(client: ArmorClient) -> list[dict[str, str]]:
    rows = client.query.sparql('SELECT ?s ?p ?o { ?s ?p ?o FILTER(!isBlank(?s) && !isBlank(?o)) }')
    return sorted(rows, key=lambda row: (row['s'], row['p'], row['o']))


@pytest.mark.parametrize('derived', [True, False])
def test_a_graph_that_is_kept_up_to_date_is_the_one_that_a_new_process_gets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, derived: bool
) -> None:
    service = ArmorService(Settings(tmp_path, sparql_derived=derived))
    client = ArmorClient('c', 'map', InProcessTransport(service))
    build_seven_rooms(client, False, True)
    graph_of(client)
    wholes: list[bool] = []
    update = GraphChanges.update

    def counted(*args: Any) -> GraphUpdate | None:
        found = update(*args)
        wholes.extend([found.whole] if found else [])
        return found

    monkeypatch.setattr(GraphChanges, 'update', counted)
    change, seed = client.manipulation, random.Random(5)
    rooms = ['R1', 'R2', 'R3', 'C1', 'NEW']
    for step in range(80):
        here, there, value = seed.choice(rooms), seed.choice(rooms), str(seed.randrange(3))
        changes: list[Callable[[], Any]] = [
            lambda h=here, v=value: change.replace_one_dataprop_b2_ind('size', h, 'INT', v),
            lambda h=here, v=value: change.add_dataprop_to_ind('size', h, 'LONG', v),
            lambda h=here, v=value: change.remove_dataprop_from_ind('size', h, 'LONG', v),
            lambda h=here, t=there: change.add_objectprop_to_ind('near', h, t),
            lambda h=here, t=there: change.remove_objectprop_from_ind('near', h, t),
            lambda h=here: change.add_ind_to_class(h, 'ODD'),
            lambda h=here: change.remove_ind_from_class(h, 'ODD'),
            lambda h=here, t=there: change.add_objectprop_to_ind('isIn', h, t),
            lambda h=here, s=step: change.remove_ind(h) if s % 10 == 9 else None,
            lambda v=value: change.add_class(f'CLASS_{v}'),
            lambda v=value: change.remove_class(f'CLASS_{v}'),
            lambda v=value: change.add_class(f'CLASS_{v}', 'ODD'),
            lambda v=value: change.add_class('ODD', f'CLASS_{v}'),
            lambda v=value: checked(client.call('REMOVE', 'CLASS', 'CLASS', [f'CLASS_{v}', 'ODD'])),
            lambda: client.utils.sync_buffered_reasoner(),
        ]
        seed.choice(changes)()
        kept = graph_of(client)
        service.workspace.sparql.note('map', None)
        assert kept == graph_of(client), step
    assert wholes.count(False) > 20, 'most changes were told as a difference'
    service.close()


@pytest.mark.parametrize('lazy', [True, False])
def test_what_comes_below_a_class_that_only_individuals_named_is_told(lazy: bool) -> None:
    service = ArmorService(warn=lambda _: None)
    client = ArmorClient('c', 'map', InProcessTransport(service))
    client.utils.load_ref_from_file(ONTOLOGY, IRI, not lazy, 'PELLET', lazy)
    change = client.manipulation
    if lazy:  # what waits for REASON
        change.add_class('LOWER', 'UPPER')
        graph_of(client)
        change.add_ind_to_class('E', 'UPPER')
    else:  # what waits for APPLY in an ontology that contradicts itself
        change.add_class('ROOM', 'DOOR')
        client.utils.sync_buffered_reasoner()
        change.add_class('UPPER')
        graph_of(client)
        client.utils.apply_buffered_changes()
    kept = graph_of(client)
    service.workspace.sparql.note('map', None)
    assert kept == graph_of(client)
    service.close()


def test_facts_and_new_classes_are_told_as_a_difference(
    built: ArmorClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    graph_of(built)
    wholes: list[bool] = []
    update = GraphChanges.update

    def noted(*args: Any) -> GraphUpdate | None:
        found = update(*args)
        wholes.extend([found.whole] if found else [])
        return found

    monkeypatch.setattr(GraphChanges, 'update', noted)
    for change in (
        lambda: built.manipulation.add_dataprop_to_ind('visitedAt', 'R1', 'LONG', '7'),
        lambda: built.manipulation.add_class('NEW'),
        lambda: built.manipulation.add_ind_to_class('R1', 'NEW'),
    ):
        change()
        graph_of(built)
    assert wholes == [False] * 3


def test_a_long_text_in_a_query_is_read_once(built: ArmorClient) -> None:
    long = 'x' * 2_000_000
    # A word was looked at again from each of its characters, for hours.
    assert built.query.sparql(f'SELECT ?x {{ ?x ?p "{long}" }}', 20_000) == []


def test_names_that_are_no_iris_are_seen(service: ArmorService, tmp_path: Path) -> None:
    ask = asker(service)
    (tmp_path / 'odd.ttl').write_text('<x:i> a <x:a#b#c>, <x:50%> ; <x:p#q#r> "v"@en-muchtoolong .')
    assert ask('LOAD FILE', 'odd.ttl', 'x:o', 'false', '', 'false').success
    rows = ask('QUERY SPARQL', 'SELECT ?c { <x:i> a ?c } ORDER BY ?c').queried_objects
    assert rows == ['{c=x:50%}, {c=x:a#b#c}']


def test_an_individual_without_a_name_is_one_node(service: ArmorService, tmp_path: Path) -> None:
    ask = asker(service)
    (tmp_path / 'blank.ttl').write_text(
        f'_:1 <x:p> <x:a>; <{OWL}differentFrom> <x:j> . _:i1 <x:p> <x:b> . _:w1 <x:p> <x:c> .'
        f' <x:k> a [ a <{OWL}Restriction>; <{OWL}onProperty> <x:p>; <{OWL}someValuesFrom> <x:C> ] .'
    )
    assert ask('LOAD FILE', 'blank.ttl', 'x:o', 'false', '', 'false').success
    for further, row in (('differentFrom> <x:j>', '{v=x:a}'), ('onProperty> ?q', '')):
        rows = ask('QUERY SPARQL', f'SELECT ?v {{ ?i <x:p> ?v; <{OWL}{further} }}').queried_objects
        assert rows == [row]


def test_a_query_that_nests_too_deeply_is_called_that(built: ArmorClient) -> None:
    with pytest.raises(ArmorServiceInternalError, match='nests too deeply'):
        built.query.sparql(f'SELECT ?s {{ ?s ?p ?o FILTER({"!" * 100_000}true) }}', 20_000)
    assert built.query.sparql('SELECT ?s { ?s ?p ?o } LIMIT 1', 20_000)
