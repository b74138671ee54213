"""The Python client: ARMOR's method names over any transport, blocking and awaited."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from inspect import signature
from typing import Any

import pytest

from armor_service.client import (
    ArmorClient,
    ArmorServiceCallError,
    ArmorServiceInternalError,
    InProcessTransport,
    Manipulation,
    Operation,
    Query,
    Utils,
)
from armor_service.directives import TABLE
from armor_service.directives.table import Read
from armor_service.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
    name_in,
    value_in,
)
from armor_service.service import ArmorService

from .seven_rooms import IRI, ONTOLOGY, build_seven_rooms


class Recorder:
    """A transport that keeps what is sent and answers with success."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, tuple[str, ...]]] = []
        self.answer = DirectiveResponse(is_consistent=True)

    def call(self, request: Any) -> Any:
        if not isinstance(request, DirectiveRequest):
            return ListResponse(True, True, [self.call(row) for row in request])
        self.sent.append((request.words, tuple(request.args)))
        return self.answer

    async def call_async(self, request: Any) -> Any:
        return self.call(request)


@pytest.mark.parametrize('buffered', [False, True])
@pytest.mark.parametrize('lazy', [False, True])
def test_the_map_gets_built_with_any_buffering(
    client: ArmorClient, buffered: bool, lazy: bool
) -> None:
    build_seven_rooms(client, buffered, lazy)
    query = client.query
    assert query.ind_b2_class('CORRIDOR') == ['C1', 'C2', 'E']
    assert query.ind_b2_class('ROOM', with_URI=True)[0] == f'<{IRI}#C1>'
    connected = {room: query.objectprop_b2_ind('connectedTo', room) for room in ('C1', 'R1', 'E')}
    assert connected == {'C1': ['C2', 'E', 'R1', 'R2'], 'R1': ['C1'], 'E': ['C1', 'C2']}
    total = sum(len(query.objectprop_b2_ind('connectedTo', r)) for r in query.ind_b2_class('ROOM'))
    assert total == 14
    assert query.objectprop_b2_ind('canReach', 'Robot1') == ['C1', 'C2']
    assert query.dataprop_b2_ind('urgencyThreshold', 'Robot1') == ['"7"^^xsd:long']
    assert query.dataprop_b2_ind('now', 'Robot1')[0].split('"')[1] == '1665579740'
    assert value_in(query.dataprop_b2_ind('now', 'Robot1')[0]) == '1665579740'


def test_every_method_sends_what_armor_expects() -> None:
    recorder = Recorder()
    client = ArmorClient('me', 'map', recorder)
    change, ask, use = client.manipulation, client.query, client.utils
    expected = {
        'ADD IND': (lambda: change.add_ind('a'), ('a',)),
        'ADD IND CLASS': (lambda: change.add_ind_to_class('a', 'A'), ('a', 'A')),
        'ADD CLASS': (lambda: change.add_class('A'), ('A',)),
        'ADD CLASS CLASS': (lambda: change.add_class('A', 'B'), ('A', 'B')),
        'ADD OBJECTPROP IND': (
            lambda: change.add_objectprop_to_ind('p', 'a', 'b'),
            ('p', 'a', 'b'),
        ),
        'ADD DATAPROP IND': (
            lambda: change.add_dataprop_to_ind('p', 'a', 'LONG', '1'),
            ('p', 'a', 'LONG', '1'),
        ),
        'ADD CARDINALITY MIN': (
            lambda: change.add_min_cardinality('A', 'p', 2, 'B'),
            ('A', 'p', '2', 'B'),
        ),
        'DISJOINT IND': (lambda: change.disj_inds(['a', 'b']), ('a', 'b')),
        'DISJOINT IND CLASS': (lambda: change.disj_inds_of_class('A'), ('A',)),
        'DISJOINT CLASS': (lambda: change.disj_classes(['A', 'B']), ('A', 'B')),
        'DISJOINT CLASS CLASS': (lambda: change.disj_subclasses('A'), ('A',)),
        'MAKE EQUIVALENT CLASS': (lambda: change.make_equivalent('A'), ('A',)),
        'REPLACE OBJECTPROP IND': (
            lambda: change.replace_objectprop_b2_ind('p', 'a', 'new', 'old'),
            ('p', 'a', 'new', 'old'),
        ),
        'REPLACE DATAPROP IND': (
            lambda: change.replace_dataprop_b2_ind('p', 'a', 'LONG', '2', '1'),
            ('p', 'a', 'LONG', '2', '1'),
        ),
        'REMOVE IND': (lambda: change.remove_ind('a'), ('a',)),
        'REMOVE IND CLASS': (lambda: change.remove_ind_from_class('a', 'A'), ('a', 'A')),
        'REMOVE CLASS': (lambda: change.remove_class('A'), ('A',)),
        'REMOVE CLASS CLASS': (lambda: change.remove_class('A', 'B'), ('A', 'B')),
        'REMOVE DATAPROP IND': (
            lambda: change.remove_dataprop_from_ind('p', 'a', 'LONG', '1'),
            ('p', 'a', 'LONG', '1'),
        ),
        'REMOVE OBJECTPROP IND': (
            lambda: change.remove_objectprop_from_ind('p', 'a', 'b'),
            ('p', 'a', 'b'),
        ),
        'RENAME IND': (lambda: change.rename_ind('a', 'b'), ('a', 'b')),
        'RENAME CLASS': (lambda: change.rename_class('A', 'B'), ('A', 'B')),
        'RENAME DATAPROP': (lambda: change.rename_dataprop('p', 'q'), ('p', 'q')),
        'RENAME OBJECTPROP': (lambda: change.rename_objectprop('p', 'q'), ('p', 'q')),
        'QUERY IND CLASS': (lambda: ask.ind_b2_class('A'), ('A',)),
        'QUERY OBJECTPROP IND': (lambda: ask.objectprop_b2_ind('p', 'a'), ('p', 'a')),
        'QUERY DATAPROP IND': (lambda: ask.dataprop_b2_ind('p', 'a'), ('p', 'a')),
        'QUERY IND': (lambda: ask.check_ind_exists('a'), ('a',)),
        'QUERY CLASS IND': (lambda: ask.class_of_ind('a'), ('a', 'false')),
        'QUERY CLASS CLASS': (lambda: ask.subclasses('A'), ('A',)),
        'QUERY CLASS RESTRICTIONS': (lambda: ask.restrictions('A'), ('A',)),
        'QUERY IND DATAPROP': (lambda: ask.dataprops_of_ind('a'), ('a',)),
        'QUERY IND OBJECTPROP': (lambda: ask.objectprops_of_ind('a'), ('a',)),
        'QUERY SPARQL ROWS': (lambda: ask.sparql('SELECT', 5), ('SELECT', '5')),
        'QUERY FACT': (lambda: ask.facts('A(?)'), ('A(?)',)),
        'QUERY IND EXPRESSION': (lambda: ask.ind_b2_expression('A and B'), ('A and B',)),
        'QUERY AXIOMS': (lambda: ask.axioms('A'), ('A',)),
        'QUERY RULES': (lambda: ask.rules(), ()),
        'QUERY TAKEN BACK': (lambda: ask.rolled_back(), ()),
        'QUERY EXPLAIN ABSENCE': (lambda: ask.explain_absence('A(a)'), ('A(a)',)),
        'QUERY EXPLAIN INCONSISTENCY': (lambda: ask.explain_inconsistency(), ()),
        'ADD AXIOM': (lambda: change.add_axiom('Class: A'), ('Class: A',)),
        'REMOVE AXIOM': (lambda: change.remove_axiom('Class: A'), ('Class: A',)),
        'ADD RULE': (lambda: change.add_rule('A(?x) -> B(?x)'), ('A(?x) -> B(?x)',)),
        'REMOVE RULE': (lambda: change.remove_rule('A(?x) -> B(?x)'), ('A(?x) -> B(?x)',)),
        'CLOSE OBJECTPROP': (lambda: change.close_objectprop('p'), ('p',)),
        'CLOSE OBJECTPROP IND': (lambda: change.close_objectprop('p', 'a'), ('p', 'a')),
        'CLOSE CLASS': (lambda: change.close_class('A'), ('A',)),
        'CLOSE CLASS IND': (lambda: change.close_class('A', 'a'), ('A', 'a')),
        'SET OBJECTPROP IND': (
            lambda: change.set_objectprop_of_ind('p', 'a', 'b'),
            ('p', 'a', 'b'),
        ),
        'SET DATAPROP IND': (
            lambda: change.set_dataprop_of_ind('p', 'a', 'LONG', '1'),
            ('p', 'a', 'LONG', '1'),
        ),
        'QUERY UNSUPPORTED': (lambda: ask.unsupported(), ()),
        'QUERY EXPLAIN': (lambda: ask.explain('A(a)'), ('A(a)',)),
        'BACKUP': (lambda: use.backup('f'), ('f',)),
        'GET REF CLIENT': (lambda: use.get_ref_client('map'), ('map',)),
        'CANCEL': (lambda: use.cancel(), ()),
        'APPLY': (lambda: use.apply_buffered_changes(), ()),
        'REASON': (lambda: use.sync_buffered_reasoner(), ()),
        'SAVE': (lambda: use.save('f'), ('f',)),
        'SAVE INFERENCE': (lambda: use.save_ref_with_inferences('f'), ('f',)),
        'LOAD FILE': (
            lambda: use.load_ref_from_file('f', 'iri', True, 'PELLET', False),
            ('f', 'iri', 'True', 'PELLET', 'False'),
        ),
        'LOAD FILE MOUNTED': (
            lambda: use.load_ref_from_file('f', 'iri', mounted=True),
            ('f', 'iri', 'False', 'PELLET', 'False'),
        ),
        'DROP': (lambda: use.drop_ref(), ()),
        'MOUNT': (lambda: use.mount_on_ref(), ()),
        'UNMOUNT': (lambda: use.unmount_from_ref(), ()),
        'GET ALL REFS': (lambda: use.get_all_refs(), ()),
        'LOG SCREEN ON': (lambda: use.set_log_to_terminal(True), ()),
        'LOG SCREEN OFF': (lambda: use.set_log_to_terminal(False), ()),
        'LOG FILE ON': (lambda: use.set_log_to_file(True, 'f'), ('f',)),
        'LOG FILE OFF': (lambda: use.set_log_to_file(False), ()),
    }
    answers = {'QUERY EXPLAIN': ['why', 'tree'], 'GET REF CLIENT': ['you']}
    for words, (send, args) in expected.items():
        recorder.sent.clear()
        recorder.answer.queried_objects = answers.get(words, [])
        send()
        assert recorder.sent == [(words, args)]
    recorder.answer.queried_objects = []
    # What has no method: other spellings of the same, forms of answers, and what allow_web allows.
    assert {row.words for row in TABLE.values()} - set(expected) == {
        *('ADD MIN CARDINALITY', 'MAKE EQUIVALENT', 'QUERY SPARQL', 'QUERY SPARQL FORMATTED'),
        *('LOAD WEB', 'LOAD WEB MOUNTED', 'INVALID COMMAND'),
    }
    for send, sent in (
        (lambda: ask.bottom_class_of_ind('a'), [('QUERY CLASS IND', ('a', 'true'))]),
        (lambda: ask.sparql('SELECT'), [('QUERY SPARQL ROWS', ('SELECT', '0'))]),
        (lambda: use.save('f', inference=True), [('SAVE INFERENCE', ('f',))]),
        (lambda: use.reason_within(2), [('REASON', ('2',))]),
        (
            lambda: use.load_ref_from_file('f', 'iri', buffered_reasoner=True),
            [('LOAD FILE', ('f', 'iri', 'False', 'PELLET', 'True'))],
        ),
        (
            lambda: change.add_batch_dataprop_to_ind('a', [['p', 'INT', '1'], ['q', 'INT', '2']]),
            [('ADD DATAPROP IND', (p, 'a', 'INT', v)) for p, v in (('p', '1'), ('q', '2'))],
        ),
        (
            lambda: change.remove_batch_dataprop_to_ind('a', [['p', 'INT', '1']]),
            [('REMOVE DATAPROP IND', ('p', 'a', 'INT', '1'))],
        ),
        (lambda: change.add_batch_dataprop_to_ind('a', []), []),
        (
            lambda: change.replace_one_objectprop_b2_ind('p', 'a', 'b'),
            [('QUERY OBJECTPROP IND', ('p', 'a')), ('ADD OBJECTPROP IND', ('p', 'a', 'b'))],
        ),
    ):
        recorder.sent.clear()
        send()
        assert recorder.sent == sent


def test_every_method_is_in_the_table_and_takes_what_that_says() -> None:
    rows = {row.words: row for row in TABLE.values()}
    kinds = {
        Read.INDIVIDUAL: {'ind_name', 'ind_names', 'value_obj_name', 'new_value', 'old_value'},
        Read.CLASS: {'class_name', 'class_names', 'super_class_name', 'value_class_name'},
        Read.OBJECT_PROPERTY: {'objectprop_name'},
        Read.DATA_PROPERTY: {'dataprop_name'},
        Read.TYPE: {'value_type'},
        Read.NUMBER: {'cardinality'},
        Read.VALUE: {'value', 'new_value'},
        Read.STORED: {'value', 'old_value'},
    }
    for part in (Manipulation, Query, Utils):
        for name, method in vars(part).items():
            if not isinstance(method, Operation):
                continue
            assert set(method.words) <= set(rows), name
            assert method.help, name
            taken = [one for one in signature(method.takes).parameters if one != 'with_URI']
            if taken[:1] == ['self']:
                continue  # It is more than one directive.
            row = rows[method.words[-1]]
            assert len(taken) >= row.required, name
            for one, argument in zip(taken, row.arguments, strict=False):
                assert one in kinds.get(argument.read, {one}) | {'old_name', 'new_name'}, (
                    name,
                    one,
                )


ENTITIES = ['<http://x.org/o#A>', 'owl:Nothing', '<http://x.org/o#B>']


def test_answers_are_read_as_names_or_left_as_they_are() -> None:
    recorder = Recorder()
    client = ArmorClient('me', 'map', recorder)
    change, ask, use = client.manipulation, client.query, client.utils
    recorder.answer = DirectiveResponse(is_consistent=True, queried_objects=ENTITIES)
    for method, args in (
        (ask.ind_b2_class, ('A',)),
        (ask.objectprop_b2_ind, ('p', 'a')),
        (ask.class_of_ind, ('a',)),
        (ask.dataprops_of_ind, ('a',)),
        (ask.objectprops_of_ind, ('a',)),
        (ask.ind_b2_expression, ('A',)),
    ):
        assert method(*args) == method(*args, with_URI=False) == ['A', 'owl:Nothing', 'B']
        assert method(*args, with_URI=True) == ENTITIES
    assert ask.subclasses('A') == ['A', 'B']
    assert ask.subclasses('A', with_URI=True) == [ENTITIES[0], ENTITIES[2]]
    assert ask.bottom_class_of_ind('a') == ENTITIES[0]
    assert ask.dataprop_b2_ind('p', 'a') == ask.restrictions('A') == ENTITIES
    assert ask.check_ind_exists('a')
    assert change.add_batch_dataprop_to_ind('a', [])
    recorder.answer = DirectiveResponse(queried_objects=['why', 'tree', 'more'])
    assert ask.explain_inconsistency() == ('why', 'tree')
    assert not change.add_ind('a')
    assert not use.sync_buffered_reasoner()
    assert not use.apply_buffered_changes()
    assert not use.reason_within(1.0)
    recorder.answer = DirectiveResponse()
    assert ask.explain_inconsistency() is None
    assert ask.bottom_class_of_ind('a') is None
    assert not ask.check_ind_exists('a')
    recorder.answer = DirectiveResponse(queried_objects=['{"x": "1"}', '{}'])
    assert ask.sparql('SELECT') == [{'x': '1'}, {}]
    recorder.answer = DirectiveResponse(queried_objects=['A(a)', 'A(b)'])
    every, asserted = ask.facts_by_origin('A(?)')
    assert [str(fact) for fact in every] == ['A(a)', 'A(b)'] == [str(fact) for fact in asserted]
    assert recorder.sent[-2:] == [('QUERY FACT', ('A(?)',)), ('QUERY FACT', ('A(?)', 'true'))]
    recorder.answer = DirectiveResponse(queried_objects=['none'])
    assert use.get_ref_client() is None
    assert recorder.sent[-1] == ('GET REF CLIENT', ('map',))
    recorder.answer = DirectiveResponse(queried_objects=['you'])
    assert use.get_ref_client('other') == 'you'
    assert recorder.sent[-1] == ('GET REF CLIENT', ('other',))


def test_a_refusal_is_told_from_an_empty_answer() -> None:
    recorder = Recorder()
    client = ArmorClient('me', 'map', recorder)
    # ARMOR says with code 0 that an individual has no class, or a fact does not hold.
    recorder.answer = DirectiveResponse(success=False, exit_code=0, queried_objects=['x'])
    assert not client.query.check_ind_exists('a')
    assert client.query.explain('A(a)') is None
    recorder.answer = DirectiveResponse(success=False, exit_code=205, error_description='wrong')
    for call in (
        lambda: client.query.check_ind_exists('a'),
        lambda: client.query.explain('A(a)'),
        lambda: client.query.facts_by_origin('A(?)'),
        lambda: client.manipulation.add_ind('a'),
        lambda: client.manipulation.add_batch_dataprop_to_ind('a', [['p', 'INT', '1']]),
    ):
        with pytest.raises(ArmorServiceInternalError) as refused:
            call()
        assert refused.value.msg == 'wrong'
        assert refused.value.code is ExitCode.INVALID_COMMAND
    assert not client.call('ADD', 'IND', '', ['a']).success
    for wrong in (client.query.facts, client.query.facts_by_origin, client.query.explain):
        sent = len(recorder.sent)
        with pytest.raises(ValueError, match='expected CLASS'):
            wrong('no fact')
        assert len(recorder.sent) == sent
    assert ArmorServiceInternalError('later', 999).code == 999
    assert ArmorServiceInternalError('text', '205').exit_code is ExitCode.INVALID_COMMAND
    recorder.answer = DirectiveResponse(queried_objects=['1', '2'])
    with pytest.raises(ArmorServiceInternalError) as several:
        client.manipulation.replace_one_objectprop_b2_ind('p', 'a', 'b')
    assert several.value.msg == 'p of a has 2 values, expected one: 1, 2'
    assert recorder.sent[-1][0] == 'QUERY OBJECTPROP IND', 'nothing was changed'


def test_an_operation_is_known_by_its_name_and_its_words() -> None:
    client = ArmorClient('me', 'map', Recorder())
    assert (
        client.query.rules.__doc__ == 'The rules, one each, as ADD RULE and REMOVE RULE take them.'
    )
    assert client.query.explain.__doc__ == type(client.query).explain.help
    assert type(client.query).explain.help.startswith('Return why a fact')
    assert str(signature(client.query.axioms)) == "(name: 'str')"
    with pytest.raises(TypeError):
        client.query.rules('too many')  # type: ignore[call-arg]
    sent = client.request('ADD IND', 'a', 'b')
    assert sent == DirectiveRequest('me', 'map', 'ADD', 'IND', '', ('a', 'b'))


def test_batches_of_values(client: ArmorClient) -> None:
    client.utils.load_ref_from_file(ONTOLOGY, IRI)
    values = [['size', 'LONG', '1'], ['label', 'STRING', 'x']]
    assert client.manipulation.add_batch_dataprop_to_ind('X', values)
    assert client.query.dataprops_of_ind('X') == ['label', 'size']
    assert client.manipulation.remove_batch_dataprop_to_ind('X', values)
    assert client.query.dataprops_of_ind('X') == []
    with pytest.raises(ArmorServiceInternalError, match="'x' is not a whole number"):
        client.manipulation.add_batch_dataprop_to_ind('X', [['size', 'LONG', 'x']])


def test_replacing_the_only_value(client: ArmorClient) -> None:
    client.utils.load_ref_from_file(ONTOLOGY, IRI)
    change, ask = client.manipulation, client.query
    change.replace_one_dataprop_b2_ind('size', 'X', 'LONG', '1')
    change.replace_one_dataprop_b2_ind('size', 'X', 'LONG', '2')
    assert ask.dataprop_b2_ind('size', 'X') == ['"2"^^xsd:long']
    change.add_dataprop_to_ind('size', 'X', 'LONG', '3')
    with pytest.raises(ArmorServiceInternalError) as several:
        change.replace_one_dataprop_b2_ind('size', 'X', 'LONG', '4')
    assert several.value.exit_code == 206
    assert several.value.code == 206
    assert several.value.msg == str(several.value)
    change.replace_one_objectprop_b2_ind('near', 'X', 'A')
    change.replace_one_objectprop_b2_ind('near', 'X', 'B')
    assert ask.objectprop_b2_ind('near', 'X') == ['B']


def test_existence_explanations_and_facts(client: ArmorClient) -> None:
    build_seven_rooms(client, True, False)
    ask = client.query
    assert ask.check_ind_exists('R1')
    assert not ask.check_ind_exists('R9')
    assert ask.class_of_ind('R1') == ['LOCATION', 'ROOM']
    assert ask.bottom_class_of_ind('C1') == 'CORRIDOR'
    assert ask.bottom_class_of_ind('R9') is None
    assert ask.subclasses('LOCATION') == ['CORRIDOR', 'ROOM', 'URGENT']
    explained = ask.explain('canReach(Robot1, C1)')
    assert explained is not None
    assert explained[0].startswith('Robot1 canReach C1 because')
    assert ask.explain('canReach(Robot1, R1)') is None
    assert [str(fact) for fact in ask.facts('canReach(Robot1, ?)')] == [
        'canReach(Robot1, C1)',
        'canReach(Robot1, C2)',
    ]
    assert client.utils.get_all_refs() == ['map']
    client.utils.mount_on_ref()
    assert client.utils.get_ref_client() == 'tester'
    client.utils.unmount_from_ref()
    assert client.utils.get_ref_client() is None


@pytest.mark.parametrize('name', ['a', 'nobody', 'z'])
def test_who_is_mounted_is_told_by_name(service: ArmorService, name: str) -> None:
    client = ArmorClient(name, 'map', InProcessTransport(service))
    client.utils.load_ref_from_file(ONTOLOGY, IRI)
    client.utils.mount_on_ref()
    assert client.utils.get_ref_client() == client.utils.get_ref_client('map') == name


def test_refusals_are_raised_with_their_code(client: ArmorClient) -> None:
    with pytest.raises(ArmorServiceInternalError, match='unknown reference') as refusal:
        client.query.ind_b2_class('ROOM')
    assert refusal.value.exit_code == 205
    with pytest.raises(ArmorServiceCallError, match='path of a file'):
        client.utils.set_log_to_file(True)
    assert client.call('NO', 'SUCH', 'THING', []).exit_code == 205


def test_the_same_methods_can_be_awaited(client: ArmorClient) -> None:
    async def use() -> list[str]:
        await client.utils.load_ref_from_file.call_async(ONTOLOGY, IRI)
        await client.manipulation.add_batch_dataprop_to_ind.call_async('X', [['p', 'INT', '1']])
        await client.manipulation.replace_one_dataprop_b2_ind.call_async('p', 'X', 'INT', '2')
        return await client.query.dataprop_b2_ind.call_async('p', 'X')

    assert asyncio.run(use()) == ['"2"^^xsd:integer']


def test_names_and_values_are_taken_out_of_answers() -> None:
    assert name_in('<http://example.org/x#R1>') == 'R1'
    assert name_in('<http://example.org/x/R1>') == 'R1'
    assert name_in('owl:Nothing') == 'owl:Nothing'
    assert value_in('"a \\"b\\""^^xsd:string') == 'a "b"'


def test_a_client_imports_no_reasoner_and_no_documents() -> None:
    script = (
        'import sys, armor_service.client; '
        "print(*(name for name in sys.modules if name.startswith(('owl_reasoner.', 'armor_s'))))"
    )
    run = subprocess.run([sys.executable, '-c', script], capture_output=True, text=True, check=True)
    loaded = run.stdout.split()
    assert 'armor_service.client' in loaded
    needless = ('reasoner', 'documents', 'owl.axioms', 'knowledge_base')
    for prefix in (*(f'owl_reasoner.{name}' for name in needless), 'armor_service.service'):
        assert not [name for name in loaded if name.startswith(prefix)]
