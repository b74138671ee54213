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
from surveillance_ontology.armor_server_node import ArmorServer

from .seven_rooms import FIXTURES, ONTOLOGY

FOUR_CLASSES = FIXTURES / 'four_classes.owl'
BASE = 'http://www.semanticweb.org/emarolab/pyarmor/test'
PROGRAM = """
from armor_api.armor_client import ArmorClient

client = ArmorClient('client', 'reference', timeout=20)
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
    client = ArmorClient('one', 'reference', timeout=5)
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
            steps = getattr(kind, name)._steps
            assert list(inspect.signature(steps).parameters)[1:] == arguments, name
