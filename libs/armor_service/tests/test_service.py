"""The service: bounds, batches, memory, and what other people's scripts do."""

from __future__ import annotations

import math
import resource
import threading
from pathlib import Path

import pytest

from armor_service import reference
from armor_service.access import Settings
from armor_service.protocol import DirectiveRequest
from armor_service.service import LARGE, ArmorService
from owl_reasoner.owl.vocabulary import OWL, RDF, XSD

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker, iri, names


def test_size_is_bounded(service: ArmorService) -> None:
    small = Settings(max_arguments=10, max_characters=100, max_batch=3)
    bounded = ArmorService(small)
    ask = asker(bounded)
    ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    assert '11 arguments, at most 10' in ask('DISJOINT IND', *'abcdefghijk').error_description
    assert 'at most 100' in ask('ADD IND', 'x' * 101).error_description
    answer = bounded.execute_list([DirectiveRequest('c', 'map', 'REASON')] * 4)
    assert not answer.success
    assert 'at most 3' in answer.responses[0].error_description
    bounded.close()


def test_names_of_references_are_bounded(ask: Ask) -> None:
    for name in ('a\x00b', 'x' * 300, 'a\nb'):
        answer = ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', reference=name)
        assert (answer.success, answer.exit_code) == (False, 205)


def request(words: str, *args: str, client: str = 'c', reference: str = 'map') -> DirectiveRequest:
    command, primary, secondary, *_ = (*words.split(), '', '', '')
    return DirectiveRequest(client, reference, command, primary, secondary, args)


def test_a_batch_runs_in_order_with_one_answer_each(service: ArmorService, ask: Ask) -> None:
    answer = service.execute_list(
        [
            request('ADD IND CLASS', 'X', 'DOOR'),
            request('QUERY IND CLASS', 'DOOR'),
            request('NO SUCH COMMAND'),
            request('ADD IND CLASS', 'Y', 'DOOR'),
            request('REASON'),
        ]
    )
    assert [row.success for row in answer.responses] == [True, True, False, True, True]
    assert answer.responses[1].queried_objects == [iri('X')]
    assert not answer.success
    assert answer.is_consistent
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']
    assert service.execute_list([request('REASON')]).success
    assert service.execute_list([]).success


def test_the_python_clients_own_test_script(service: ArmorService) -> None:
    base = 'http://example.org/four'
    ask = asker(service)
    path = str(FIXTURES / 'four_classes.owl')
    assert ask('LOAD FILE', path, base, 'True', 'PELLET', 'True').success
    ask('MOUNT')
    for ind in '123':
        ask('ADD IND CLASS', f'ind_{ind}', f'Class_{ind}')
    ask('ADD OBJECTPROP IND', 'OProperty_1', 'ind_1', 'ind_3')
    ask('ADD OBJECTPROP IND', 'OProperty_2', 'ind_1', 'ind_2')
    ask('ADD DATAPROP IND', 'DProperty_1', 'ind_1', 'INTEGER', '1')
    ask('REPLACE DATAPROP IND', 'DProperty_1', 'ind_1', 'INTEGER', '3', '1')
    ask('APPLY')
    ask('REASON')
    types = {ind: ask('QUERY IND', ind).queried_objects for ind in ('ind_1', 'ind_2', 'ind_3')}
    assert types == {
        'ind_1': [f'<{base}#Class_1>', f'<{base}#Class_4>'],
        'ind_2': [f'<{base}#Class_1>', f'<{base}#Class_2>'],
        'ind_3': [f'<{base}#Class_3>'],
    }
    assert ask('QUERY DATAPROP IND', 'DProperty_1', 'ind_1').queried_objects == ['"3"^^xsd:integer']


def test_the_tutorials_calls(ask: Ask) -> None:
    assert ask('QUERY DATAPROP IND', 'now', 'Robot1').queried_objects == ['"1665579740"^^xsd:long']
    ask('ADD OBJECTPROP IND', 'hasDoor', 'R1', 'D1')
    ask('ADD OBJECTPROP IND', 'isIn', 'Robot1', 'R1')
    ask('ADD DATAPROP IND', 'visitedAt', 'R1', 'LONG', '1665579710')
    assert names(ask('QUERY IND CLASS', 'ROOM')) == ['R1']
    assert names(ask('QUERY OBJECTPROP IND', 'isIn', 'Robot1')) == ['R1']
    ask('REPLACE DATAPROP IND', 'now', 'Robot1', 'LONG', '1665579750', '1665579740')
    assert names(ask('QUERY IND CLASS', 'URGENT')) == ['R1']


def test_an_ontology_with_the_older_form_of_all_different(
    service: ArmorService, tmp_path: Path
) -> None:
    vocabulary = Path(ONTOLOGY).read_text().rpartition('</rdf:RDF>')[0]
    individuals = (FIXTURES / 'three_places.owl').read_text().partition('rdf-syntax-ns#">')[2]
    (tmp_path / 'abox.owl').write_text(vocabulary + individuals)
    ask = asker(service)
    assert ask('LOAD FILE', 'abox.owl', IRI, 'false', 'PELLET', 'false').success
    assert names(ask('QUERY IND', 'C1')) == ['CORRIDOR', 'LOCATION', 'ROOM']
    assert 'URGENT' in names(ask('QUERY IND', 'R1'))
    assert names(ask('QUERY OBJECTPROP IND', 'canReach', 'Robot1')) == ['R1', 'R2']


def test_disjointness_of_very_many_classes_is_refused(ask: Ask) -> None:
    answer = ask('DISJOINT CLASS', *(f'K{number}' for number in range(501)))
    assert (answer.success, answer.exit_code) == (False, 205)
    assert answer.error_description == 'DISJOINT CLASS: 501 arguments, at most 500'


def test_what_may_take_long_is_not_done_at_once(
    service: ArmorService, ask: Ask, monkeypatch: pytest.MonkeyPatch
) -> None:
    # On a busy machine, or one that is measured, any reasoning takes long.
    monkeypatch.setattr(reference, 'SLOW', math.inf)
    assert service.execute_at_once(request('QUERY IND CLASS', 'ROOM')) is not None
    for slow in (
        request('QUERY SPARQL', 'SELECT * { ?a ?b ?c }'),
        request('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false', reference='other'),
        request('ADD CLASS CLASS', 'A', 'B'),
        request('REMOVE CLASS', 'A'),
        request('REMOVE CLASS CLASS', 'A', 'B'),
        request('DISJOINT IND', *(f'X{number}' for number in range(2000))),
        request('QUERY EXPLAIN', 'ROOM(R1)'),
        request('QUERY EXPLAIN INCONSISTENCY'),
    ):
        assert service.execute_at_once(slow) is None
    assert ask('GET ALL REFS').queried_objects == ['map'], 'nothing was done'
    ask('LOAD FILE', ONTOLOGY, IRI, 'true', '', 'true')
    assert service.execute_at_once(request('REASON')) is not None
    for change in ('ADD CLASS CLASS', 'REMOVE CLASS CLASS'):
        ask(change, 'A', 'B')
        assert service.execute_at_once(request('REASON')) is None, 'classes changed'
        ask('REASON')
        assert service.execute_at_once(request('REASON')) is not None
    assert service.execute_at_once(request('QUERY FACT', 'p(?, a)')) is not None
    ask('DISJOINT IND', *(f'X{number}' for number in range(2000)))
    ask('APPLY')
    for number in range(LARGE):
        ask('ADD IND', f'X{number}')
    ask('APPLY')
    assert service.execute_at_once(request('QUERY FACT', 'p(?, a)')) is None, 'many facts'
    assert service.execute_at_once(request('QUERY AXIOMS', 'X1')) is None, 'many facts'


def test_a_reference_whose_reasoning_takes_long_is_reasoned_over_by_a_worker(
    service: ArmorService, ask: Ask, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reference, 'SLOW', 60.0)
    ref = service.workspace.references.find('map')
    ask('ADD IND CLASS', 'R1', 'ROOM')
    ref.effort.took = 60.0
    assert service.execute_at_once(request('REASON')) is not None
    ref.effort.took = 60.1
    assert service.execute_at_once(request('ADD IND CLASS', 'R2', 'ROOM')) is None
    ask('ADD IND CLASS', 'R2', 'ROOM')
    assert service.execute_at_once(request('REASON')) is not None, 'it took less this time'


def test_an_ontology_that_was_dropped_meanwhile_is_asked_no_more(
    service: ArmorService, ask: Ask
) -> None:
    ref = service.workspace.references.find('map')
    answers = []
    with ref.lock:
        asking = threading.Thread(
            target=lambda: answers.append(ask('QUERY EXPLAIN', 'ROOM(R1)').error_description)
        )
        asking.start()
        ask('DROP')
    asking.join()
    assert answers[0] in (
        "'map' was dropped meanwhile",
        "unknown reference 'map'; loaded: none",
    )


def test_who_still_works_on_what_was_dropped_tells_nothing_of_the_next_of_its_name(
    service: ArmorService, ask: Ask
) -> None:
    told: list[tuple[str, bool]] = []
    service.watch(lambda name, changes: told.append((name, changes is None)))
    ref = service.workspace.references.find('map')
    with ref.lock:
        ask('DROP')
        ask('LOAD FILE', ONTOLOGY, IRI, 'false', 'PELLET', 'false')
        ref.kb.change([], list(ref.kb.axioms()))
    assert told == [('map', True), ('map', True)]


def test_the_memory_of_a_large_ontology_is_given_back(
    service: ArmorService, tmp_path: Path
) -> None:
    def resident() -> int:
        pages = Path('/proc/self/statm').read_text().split()[1]
        return int(pages) * resource.getpagesize()

    ask = asker(service)
    facts = ''.join(f'<{IRI}#i{n}> <{IRI}#p> "{n}"^^<{XSD}long> .\n' for n in range(40_000))
    declared = f'<{IRI}#p> <{RDF}type> <{OWL}DatatypeProperty> .\n'
    (tmp_path / 'large.nt').write_text(declared + facts)
    before = resident()
    assert ask('LOAD FILE', 'large.nt', IRI, 'false', '', 'false').success
    loaded = resident() - before
    assert ask('DROP').success
    for thread in threading.enumerate():
        if thread.daemon and thread.name.startswith('Thread-'):
            thread.join(60.0)
    assert resident() - before < loaded / 2
