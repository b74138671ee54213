"""The drop-in for armor_py_api: a program of ARMOR's tutorial runs, without spinning anything."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from armor_api.armor_client import ArmorClient
from armor_api.armor_exceptions import (
    ArmorPyException,
    ArmorServiceCallError,
    ArmorServiceInternalError,
)
from armor_api.armor_manipulation_client import ArmorManipulationClient
from armor_api.armor_query_client import ArmorQueryClient
from armor_api.armor_utils_client import ArmorUtilsClient
from armor_service import client
from armor_service.client import InProcessTransport
from armor_service.protocol import DirectiveRequest, DirectiveResponse
from libs.armor_service.tests.seven_rooms import FIXTURES, ONTOLOGY
from surveillance_ontology.armor_server_node import ArmorServer

FOUR_CLASSES = FIXTURES / 'four_classes.owl'
BASE = 'http://www.semanticweb.org/emarolab/pyarmor/test'
PROGRAM = """
from armor_api.armor_client import ArmorClient

client = ArmorClient('client', 'reference', timeout=60)
client.utils.load_ref_from_file('PATH', 'BASE', True, 'PELLET', True, False)
client.utils.mount_on_ref()
client.utils.set_log_to_terminal(True)
client.manipulation.add_ind_to_class('ind_1', 'Class_1')
client.manipulation.add_ind_to_class('ind_2', 'Class_2')
client.manipulation.add_ind_to_class('ind_3', 'Class_3')
client.manipulation.add_objectprop_to_ind('OProperty_1', 'ind_1', 'ind_3')
client.manipulation.add_objectprop_to_ind('OProperty_2', 'ind_1', 'ind_2')
client.manipulation.add_dataprop_to_ind('DProperty_1', 'ind_1', 'INTEGER', '1')
client.manipulation.replace_dataprop_b2_ind('DProperty_1', 'ind_1', 'INTEGER', '3', '1')
client.utils.apply_buffered_changes()
client.utils.sync_buffered_reasoner()
print(client.query.check_ind_exists('ind_1'))
values = client.query.dataprop_b2_ind('DProperty_1', 'ind_1')
print(sorted(client.query.ind_b2_class('Class_1')), values)
client.utils.save_ref_with_inferences('inferred_test.owl')
"""


@pytest.fixture
def server(graph: Any, tmp_path: Path) -> ArmorServer:
    """Provide a server under ARMOR's own service names."""
    parameters = {'ontologies_folder': str(tmp_path), 'directories': [str(FIXTURES)]}
    made: ArmorServer = graph.add(ArmorServer, parameters)
    return made


def test_a_program_of_armor_py_api_runs_as_it_is(server: ArmorServer, tmp_path: Path) -> None:
    text = PROGRAM.replace('PATH', str(FOUR_CLASSES)).replace('BASE', BASE)
    done = subprocess.run(
        [sys.executable, '-c', text],
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.splitlines() == ['True', "['ind_1'] ['\"3\"^^xsd:integer']"]
    assert (tmp_path / 'inferred_test.owl').exists()


def test_errors_carry_code_and_msg(server: ArmorServer) -> None:
    client = ArmorClient('one', 'reference', timeout=60)
    with pytest.raises(ArmorServiceInternalError) as refused:
        client.manipulation.add_ind_to_class('a', 'B')
    assert refused.value.code == 205
    assert 'unknown reference' in refused.value.msg
    client.utils.load_ref_from_file(ONTOLOGY, BASE)
    client.manipulation.add_dataprop_to_ind('p', 'i', 'INT', '1')
    client.manipulation.add_dataprop_to_ind('p', 'i', 'INT', '2')
    with pytest.raises(ArmorPyException) as several:
        client.manipulation.replace_one_dataprop_b2_ind('p', 'i', 'INT', '3')
    assert several.value.code == 206  # type: ignore[attr-defined]


def test_a_server_that_is_not_there_is_reported_in_time() -> None:
    client = ArmorClient('one', 'reference', '/no_such_srv', '/no_such_serialized_srv', timeout=0.1)
    assert client.timeout == 0.1
    with pytest.raises(ArmorServiceCallError) as error:
        client.utils.sync_buffered_reasoner()
    assert '/no_such_srv' in error.value.msg


def test_the_names_of_armor_py_api_are_there() -> None:
    """Names and order of arguments as of armor_py_api 0a6610a."""
    for kind, methods in {
        ArmorManipulationClient: {
            'add_ind_to_class': ['ind_name', 'class_name'],
            'disj_inds_of_class': ['class_name'],
            'add_objectprop_to_ind': ['objectprop_name', 'ind_name', 'value_obj_name'],
            'add_dataprop_to_ind': ['dataprop_name', 'ind_name', 'value_type', 'value'],
            'add_batch_dataprop_to_ind': ['ind_name', 'properties'],
            'replace_objectprop_b2_ind': ['objectprop_name', 'ind_name', 'new_value', 'old_value'],
            'replace_dataprop_b2_ind': [
                *('dataprop_name', 'ind_name', 'value_type', 'new_value', 'old_value')
            ],
            'replace_one_dataprop_b2_ind': ['dataprop_name', 'ind_name', 'value_type', 'new_value'],
            'replace_one_objectprop_b2_ind': ['objectprop_name', 'ind_name', 'new_value'],
            'remove_dataprop_from_ind': ['dataprop_name', 'ind_name', 'value_type', 'value'],
            'remove_objectprop_from_ind': ['objectprop_name', 'ind_name', 'value_obj_name'],
            'remove_batch_dataprop_to_ind': ['ind_name', 'properties'],
            'remove_ind_from_class': ['ind_name', 'class_name'],
        },
        ArmorQueryClient: {
            'ind_b2_class': ['class_name', 'with_URI'],
            'objectprop_b2_ind': ['objectprop_name', 'ind_name', 'with_URI'],
            'dataprop_b2_ind': ['dataprop_name', 'ind_name'],
            'check_ind_exists': ['ind_name'],
        },
        ArmorUtilsClient: {
            'apply_buffered_changes': [],
            'sync_buffered_reasoner': [],
            'save_ref_with_inferences': ['filepath'],
            'save': ['filepath', 'inference'],
            'load_ref_from_file': [
                *('owl_file_path', 'iri', 'buffered_manipulation', 'reasoner'),
                *('buffered_reasoner', 'mounted'),
            ],
            'mount_on_ref': [],
            'unmount_from_ref': [],
            'set_log_to_terminal': ['switch'],
            'set_log_to_file': ['switch', 'filepath'],
        },
    }.items():
        for name, arguments in methods.items():
            taken = [*inspect.signature(getattr(kind, name).takes).parameters]
            assert [one for one in taken if one != 'self'] == arguments, name


SENT: dict[str, tuple[tuple[object, ...], str, tuple[str, ...]]] = {
    'manipulation.add_ind_to_class': (('i', 'C'), 'ADD IND CLASS', ('i', 'C')),
    'manipulation.disj_inds_of_class': (('C',), 'DISJOINT IND CLASS', ('C',)),
    'manipulation.add_objectprop_to_ind': (('p', 'i', 'j'), 'ADD OBJECTPROP IND', ('p', 'i', 'j')),
    'manipulation.add_dataprop_to_ind': (
        ('d', 'i', 'LONG', '1'),
        'ADD DATAPROP IND',
        ('d', 'i', 'LONG', '1'),
    ),
    'manipulation.replace_objectprop_b2_ind': (
        ('p', 'i', 'new', 'old'),
        'REPLACE OBJECTPROP IND',
        ('p', 'i', 'new', 'old'),
    ),
    'manipulation.replace_dataprop_b2_ind': (
        ('d', 'i', 'LONG', '2', '1'),
        'REPLACE DATAPROP IND',
        ('d', 'i', 'LONG', '2', '1'),
    ),
    'manipulation.remove_dataprop_from_ind': (
        ('d', 'i', 'LONG', '1'),
        'REMOVE DATAPROP IND',
        ('d', 'i', 'LONG', '1'),
    ),
    'manipulation.remove_objectprop_from_ind': (
        ('p', 'i', 'j'),
        'REMOVE OBJECTPROP IND',
        ('p', 'i', 'j'),
    ),
    'manipulation.remove_ind_from_class': (('i', 'C'), 'REMOVE IND CLASS', ('i', 'C')),
    'query.ind_b2_class': (('C',), 'QUERY IND CLASS', ('C',)),
    'query.objectprop_b2_ind': (('p', 'i'), 'QUERY OBJECTPROP IND', ('p', 'i')),
    'query.dataprop_b2_ind': (('d', 'i'), 'QUERY DATAPROP IND', ('d', 'i')),
    'query.check_ind_exists': (('i',), 'QUERY IND', ('i',)),
    'utils.apply_buffered_changes': ((), 'APPLY', ()),
    'utils.sync_buffered_reasoner': ((), 'REASON', ()),
    'utils.save_ref_with_inferences': (('f.owl',), 'SAVE INFERENCE', ('f.owl',)),
    'utils.save': (('f.owl',), 'SAVE', ('f.owl',)),
    'utils.load_ref_from_file': (
        ('f.owl', 'http://i', True, 'PELLET', False),
        'LOAD FILE',
        ('f.owl', 'http://i', 'True', 'PELLET', 'False'),
    ),
    'utils.mount_on_ref': ((), 'MOUNT', ()),
    'utils.unmount_from_ref': ((), 'UNMOUNT', ()),
    'utils.set_log_to_terminal': ((True,), 'LOG SCREEN ON', ()),
    'utils.set_log_to_file': ((True, 'f.log'), 'LOG FILE ON', ('f.log',)),
}
"""What each method of armor_py_api 0a6610a sends: arguments, directive, arguments of that."""
EACH = pytest.mark.parametrize('method', SENT)


class Answers(InProcessTransport):
    """A transport that notes what is sent and gives one answer to everything."""

    def __init__(self, answer: DirectiveResponse | Exception) -> None:
        self.sent: list[DirectiveRequest] = []
        self._answer = answer

    def call(self, request: Any) -> DirectiveResponse:
        self.sent.append(request)
        if isinstance(self._answer, Exception):
            raise self._answer
        return self._answer


def called(method: str, answer: DirectiveResponse | Exception) -> tuple[Any, Answers]:
    """Call a method with what `SENT` says; its result, and what was sent."""
    transport = Answers(answer)
    part, name = method.split('.')
    made = client.ArmorClient('me', 'map', transport)
    return getattr(getattr(made, part), name)(*SENT[method][0]), transport


@EACH
def test_each_method_sends_what_armor_py_api_sends(method: str) -> None:
    answer = DirectiveResponse(is_consistent=True, queried_objects=['<http://i#a>'])
    result, transport = called(method, answer)
    (sent,) = transport.sent
    assert (sent.client_name, sent.reference_name) == ('me', 'map')
    assert (sent.words, tuple(sent.args)) == SENT[method][1:]
    if method.startswith('manipulation.') or method.split('.')[1].split('_')[0] in (
        'apply',
        'sync',
    ):
        assert result is True, 'whether the ontology is consistent'
    elif method.startswith('utils.'):
        assert result is None
    elif method == 'query.check_ind_exists':
        assert result is True
    else:
        assert result == (['<http://i#a>'] if 'dataprop' in method else ['a'])


@EACH
def test_each_method_raises_what_the_server_refuses(method: str) -> None:
    refusal = DirectiveResponse(False, exit_code=205, error_description='why')
    with pytest.raises(ArmorServiceInternalError) as error:
        called(method, refusal)
    assert (error.value.code, error.value.msg) == (205, 'why')


@EACH
def test_each_method_raises_that_nobody_answers(method: str) -> None:
    with pytest.raises(ArmorServiceCallError) as error:
        called(method, ArmorServiceCallError('nobody'))
    assert error.value.msg == 'nobody'


def test_exceptions_are_made_as_in_armor_py_api() -> None:
    assert ArmorPyException('a').msg == ArmorServiceCallError('a').msg == 'a'
    unknown = ArmorServiceInternalError('a', '299')
    assert (unknown.msg, unknown.code) == ('a', 299)
    assert isinstance(unknown, ArmorPyException)


def test_rows_of_a_sparql_answer_have_key_and_value(server: ArmorServer) -> None:
    made = ArmorClient('one', 'reference', timeout=60)
    made.utils.load_ref_from_file(ONTOLOGY, BASE)
    made.manipulation.add_ind_to_class('a', 'B')
    response = made.call('QUERY', 'SPARQL', 'FORMATTED', [f'SELECT ?x {{ ?x a <{BASE}#B> }}'])
    (item,) = response.sparql_queried_objects
    assert (item.key, item.value) == ('x', f'{BASE}#a')
