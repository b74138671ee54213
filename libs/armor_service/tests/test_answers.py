"""What the service answers word for word, and where its bounds lie: at them and one beyond."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from armor_service import service as service_module
from armor_service.access import Settings
from armor_service.directives import closing
from armor_service.directives.table import TABLE
from armor_service.protocol import DirectiveRequest, StoreError
from armor_service.quarantine import TooHardError
from armor_service.service import LARGE, LONG_ARGUMENTS, ArmorService
from armor_service.store.store import Store
from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.owl.axioms import ClassAssertion, EquivalentClasses
from owl_reasoner.owl.expressions import ObjectMaxCardinality

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker, iri, names

LOAD = ('LOAD FILE', ONTOLOGY, IRI)


def request(words: str, *args: str, reference: str = 'map') -> DirectiveRequest:
    command, primary, secondary, *_ = (*words.split(), '', '', '')
    return DirectiveRequest('c', reference, command, primary, secondary, args)


def test_types_are_told_from_none_and_from_nobody(ask: Ask) -> None:
    ask('ADD IND', 'X')
    ask('ADD IND CLASS', 'Y', 'DOOR')
    described = {name: ask('QUERY IND', name) for name in 'XYZ'}
    assert {name: answer.success for name, answer in described.items()} == {
        'X': False, 'Y': True, 'Z': False,
    }  # fmt: skip
    assert {name: answer.error_description for name, answer in described.items()} == {
        'X': f'{iri("X")} is of no class but owl:Thing',
        'Y': '',
        'Z': f'map has no individual {iri("Z")}',
    }
    assert ask('QUERY CLASS IND', 'Y', 'true').queried_objects == ['DOOR']
    assert ask('QUERY CLASS IND', 'Y', 'on').queried_objects == [iri('DOOR')]


@pytest.mark.parametrize(
    ('error', 'description', 'timeout', 'warned'),
    [
        (
            ZeroDivisionError('by a\nclient'),
            'QUERY IND: internal error, ZeroDivisionError: by a\\nclient',
            False,
            True,
        ),
        (
            StoreError('a/b: it is full'),
            'QUERY IND: nothing was done: a/b: it is full',
            False,
            False,
        ),
        (TooHardError('more than 3 s'), 'QUERY IND: more than 3 s', True, False),
    ],
)
def test_what_goes_wrong_inside_is_told_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
    description: str,
    timeout: bool,
    warned: bool,
) -> None:
    said: list[str] = []
    service = ArmorService(Settings(read_only_directories=(FIXTURES,)), warn=said.append)
    ask = asker(service)
    ask(*LOAD, 'false', '', 'false')

    def fail(*_: Any) -> None:
        raise error

    key = ('QUERY', 'IND', '')
    monkeypatch.setitem(TABLE, key, replace(TABLE[key], run=fail))
    answer = ask('QUERY IND', 'x')
    assert (answer.success, answer.exit_code, answer.timeout) == (False, 205, timeout)
    assert answer.error_description == description
    assert answer.is_consistent, 'of the ontology'
    assert said == ([description] if warned else [])
    service.close()


def test_a_batch_that_could_not_be_kept_is_told_as_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = Store(tmp_path / 'store')
    service = ArmorService(Settings(tmp_path), print, print, store)
    asker(service)(*LOAD, 'false', '', 'false')
    closing_one = DirectiveRequest('c', 'map', 'ADD', 'IND', '', ('x',))
    execute = service.execute

    def execute_and_close(each: DirectiveRequest) -> Any:
        answer = execute(each)
        store.close()
        return answer

    monkeypatch.setattr(service, 'execute', execute_and_close)
    answer = service.execute_list([closing_one])
    assert not answer.success
    assert not answer.is_consistent
    (row,) = answer.responses
    assert row.error_description == f'lost at the next start: {tmp_path / "store"}: closed'
    service.close()


def test_sizes_at_the_bound_and_one_beyond() -> None:
    service = ArmorService(Settings(max_arguments=10, max_characters=1000, max_batch=3))
    ask = asker(service)
    ask(*LOAD, 'false', '', 'false')
    assert ask('DISJOINT IND', *'abcdefghij').success
    assert ask('DISJOINT IND', *'abcdefghijk').error_description == '11 arguments, at most 10'
    assert ask('ADD IND', 'x' * 1000).success
    answer = ask('ADD IND', 'x' * 1001).error_description
    assert answer == '1001 characters of arguments, at most 1000'
    three = service.execute_list([request('REASON')] * 3)
    assert three.success
    assert len(three.responses) == 3
    four = service.execute_list([request('REASON')] * 4)
    assert [row.error_description for row in four.responses] == [
        '4 directives in a list, at most 3'
    ]
    assert (four.success, four.is_consistent) == (False, False)
    assert not service.execute_list([]).is_consistent
    for length in (256, 257):
        loaded = ask(*LOAD, 'false', '', 'false', reference='n' * length)
        assert loaded.success == (length == 256)
    assert loaded.error_description == (
        f'reference name {"n" * 77!r}...: expected at most 256 printable characters'
    )
    service.close()


def test_what_is_quick_is_done_at_once_and_all_else_is_left(
    service: ArmorService, ask: Ask, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once = service.execute_at_once
    assert at_once(request('DISJOINT IND', *('a' for _ in range(LONG_ARGUMENTS)))) is not None
    assert at_once(request('DISJOINT IND', *('a' for _ in range(LONG_ARGUMENTS + 1)))) is None
    kb = service.workspace.references.find('map').kb
    gathers = request('QUERY IND CLASS', 'ROOM')
    monkeypatch.setattr(service_module, 'LARGE', len(kb))
    assert at_once(gathers) is not None
    monkeypatch.setattr(service_module, 'LARGE', len(kb) - 1)
    assert at_once(gathers) is None
    assert at_once(request('QUERY IND', 'R1')) is not None, 'of one individual'
    assert LARGE == 1000
    for wrong in (request('NO SUCH'), request('QUERY IND', 'x', reference='other')):
        answer = at_once(wrong)
        assert answer is not None
        assert answer.exit_code == 205
    ref = service.workspace.references.find('map')
    found: list[Any] = []
    with ref.lock:
        thread = threading.Thread(target=lambda: found.append(at_once(request('QUERY IND', 'R1'))))
        thread.start()
        thread.join(60.0)
    assert found == [None], 'it would have to wait'
    ref.opened = False
    assert at_once(request('QUERY IND', 'R1')) is None
    ref.opened = True
    ref.effort.heavy = True
    assert at_once(request('QUERY IND', 'R1')) is not None, 'a query reasons over nothing'
    assert at_once(request('ADD IND', 'R1')) is None


def test_a_durable_service_writes_on_a_thread_that_may_block(tmp_path: Path) -> None:
    service = ArmorService(Settings(tmp_path), print, print, Store(tmp_path / 'store'))
    asker(service)(*LOAD, 'false', '', 'false')
    assert service.execute_at_once(request('ADD IND', 'x')) is None
    assert service.execute_at_once(request('QUERY IND', 'x')) is not None
    service.close()


def test_what_a_client_should_know_of_a_document(service: ArmorService, tmp_path: Path) -> None:
    ask = asker(service)

    def loaded(name: str, body: str, iri: str = 'urn:o', reasoner: str = '') -> str:
        (tmp_path / 'x.ofn').write_text(f'Ontology(<urn:o> {body})')
        answer = ask('LOAD FILE', 'x.ofn', iri, 'false', reasoner, 'false', reference=name)
        assert answer.success, answer
        return answer.error_description

    plain = 'ClassAssertion(<urn:A> <urn:i>)'
    assert loaded('a', plain) == ''
    assert loaded('a', plain) == 'a is loaded already'
    assert loaded('b', plain, 'urn:p#') == (
        'the document is of urn:o, names are completed with urn:p'
    )
    torn = f'{plain} DisjointClasses(<urn:A> <urn:B>) ClassAssertion(<urn:B> <urn:i>)'
    assert loaded('c', torn, reasoner='FACT') == (
        "reasoner 'FACT' is not available, the native one is used; the ontology is inconsistent"
    )
    for count in (1, 5, 6, 8):
        rules = ' '.join(
            f'DLSafeRule(Body(BuiltInAtom(<urn:unknown{number}> Variable(<urn:x>)))'
            ' Head(ClassAtom(<urn:A> Variable(<urn:x>))))'
            for number in range(count)
        )
        note = loaded(f'd{count}', rules)
        assert note.startswith(f'{count} statements not supported by the reasoner: ')
        assert note.count('-> urn:A') == min(count, 5)
        assert note.endswith(f' and {count - 5} more') == (count > 5)
        assert (' more' in note) == (count > 5)


def test_mounting_says_what_it_changes(ask: Ask) -> None:
    assert ask('MOUNT').error_description == ''
    assert ask('MOUNT').error_description == 'tester is mounted already'
    assert ask('UNMOUNT', client='b').error_description == 'b is not mounted on map'
    assert ask('UNMOUNT').error_description == ''
    assert ask('UNMOUNT').error_description == 'tester is not mounted on map'
    assert [ask('MOUNT', client='none').error_description for _ in range(2)] == ['', '']
    assert ask('MOUNT', reference='x').error_description == (
        'tester cannot be mounted on x. Unknown reference.'
    )
    assert ask('CANCEL').success
    assert ask('CANCEL', reference='x').exit_code == 205
    ask('MOUNT')
    assert ask('CANCEL', client='b').exit_code == 102
    assert ask('DROP', reference='x').error_description == ''


def test_reason_takes_a_number_above_zero(ask: Ask) -> None:
    assert ask('REASON').success
    assert ask('REASON', '').success
    assert ask('REASON', '1e9').success
    for wrong in ('0', '-1', 'nan', 'x'):
        assert ask('REASON', wrong).error_description == (
            f"REASON: argument seconds '{wrong}': expected a number above 0"
        )


def test_a_document_is_written_as_its_ending_says(ask: Ask, tmp_path: Path) -> None:
    ask('ADD IND CLASS', 'R1', 'ROOM')
    begins = {
        'a.nt': '<',
        'b.OMN': 'Prefix: ',
        'c.omn': 'Prefix: ',
        'd.owl': '<?xml',
        'e.ttl': '<?xml',
    }
    for name, begin in begins.items():
        assert ask('SAVE', name).success
        assert (tmp_path / name).read_text().startswith(begin), name
    assert ask('SAVE INFERENCE', 'f.nt').success
    lines = (tmp_path / 'f.nt').read_text().splitlines()
    assert len(lines) == len(set(lines)), 'what is asserted is not written once more'
    more = set(lines) - set((tmp_path / 'a.nt').read_text().splitlines())
    assert any('LOCATION>' in line for line in more)


def test_a_cardinality_has_31_bits(ask: Ask) -> None:
    for text in ('0', '2147483647', '0000000002'):
        assert ask('ADD CARDINALITY MIN', 'A', 'p', text, 'B').success
    for text in ('2147483648', '00000000002', '-1', '1.0', '', '\u0663'):
        assert ask('ADD CARDINALITY MIN', 'A', 'p', text, 'B').error_description == (
            f'ADD CARDINALITY MIN: argument cardinality {text!r} is not a number, '
            'expected 0 to 2147483647'
        )


def test_five_hundred_classes_are_stated_to_be_apart_at_most(ask: Ask) -> None:
    kinds = [f'K{number}' for number in range(501)]
    assert ask('DISJOINT CLASS', *kinds[:500], 'extra').exit_code == 205
    many = TABLE['DISJOINT', 'CLASS', '']
    assert len(many.read(kinds[:500], IRI)) == 500


def test_so_many_individuals_are_closed_for_at_most(
    ask: Ask, service: ArmorService, monkeypatch: pytest.MonkeyPatch
) -> None:
    for ind in ('R1', 'R2'):
        ask('ADD OBJECTPROP IND', 'near', ind, 'R3')
        ask('ADD OBJECTPROP IND', 'near', ind, 'R4')
    kb = service.workspace.references.find('map').kb
    monkeypatch.setattr(closing, 'MOST_CLOSED', 1)
    before = list(kb.axioms())
    answer = ask('CLOSE OBJECTPROP', 'near').error_description
    assert answer == 'CLOSE OBJECTPROP: 2 individuals, at most 1'
    others = len(kb.instances('http://www.w3.org/2002/07/owl#Thing'))
    answer = ask('CLOSE CLASS', 'NOTHING_IN_IT').error_description
    assert answer == f'CLOSE CLASS: {others} individuals, at most 1'
    assert list(kb.axioms()) == before
    monkeypatch.setattr(closing, 'MOST_CLOSED', 2)
    assert ask('CLOSE OBJECTPROP', 'near').success
    closed = [
        axiom
        for axiom in kb.axioms()
        if isinstance(axiom, ClassAssertion) and isinstance(axiom.cls, ObjectMaxCardinality)
    ]
    assert [(a.individual.rpartition('#')[2], a.cls.n) for a in closed] == [('R1', 2), ('R2', 2)]  # type: ignore[union-attr]


DEFINED = """
Prefix(:=<http://bnc/exp-rob-lab/2022-23#>) Prefix(xsd:=<http://www.w3.org/2001/XMLSchema#>)
Ontology(<urn:d>
EquivalentClasses(:T0 ObjectIntersectionOf(:A ObjectUnionOf(:B :C)))
EquivalentClasses(:T1 ObjectComplementOf(:A))
EquivalentClasses(:T2 ObjectHasValue(:p :i))
EquivalentClasses(:T3 DataHasValue(:d "5"^^xsd:long))
EquivalentClasses(:T4 ObjectMaxCardinality(3 ObjectInverseOf(:p) :A))
EquivalentClasses(:T5 ObjectAllValuesFrom(:p ObjectUnionOf(:A :B)))
EquivalentClasses(:T6 DataMinCardinality(2 :d xsd:long))
EquivalentClasses(:T7 DataSomeValuesFrom(:d xsd:long))
EquivalentClasses(:T8 ObjectExactCardinality(1 :p ObjectIntersectionOf(:A :B)))
EquivalentClasses(:T9 ObjectSomeValuesFrom(:p ObjectHasSelf(:q)))
EquivalentClasses(:TX ObjectHasSelf(:p))
)"""
FORMS = {
    'T0': 'CLASS : T0 -> (A), CLASS : T0 -> (B), CLASS : T0 -> (C)',
    'T1': 'CLASS : T1 -> (A)',
    'T2': 'SOME_OBJECT : T2 -> p(i)',
    'T3': 'SOME_DATA : T3 -> d(5)',
    'T4': 'MAX_OBJECT : T4 -> inverse(p) 3(A), CLASS : T4 -> (A)',
    'T5': 'ALL_OBJECT : T5 -> p(A or B), CLASS : T5 -> (A), CLASS : T5 -> (B)',
    'T6': 'MIN_DATA : T6 -> d 2(long)',
    'T7': 'SOME_DATA : T7 -> d(long)',
    'T8': 'EXACT_OBJECT : T8 -> p 1(A and B), CLASS : T8 -> (A), CLASS : T8 -> (B)',
    'T9': 'SOME_OBJECT : T9 -> p(ObjectHasSelf)',
}


def test_every_kind_of_definition_has_armors_form(ask: Ask, service: ArmorService) -> None:
    ref = service.workspace.references.find('map')
    ref.kb.change(read_ontology(DEFINED.encode(), IRI).axioms)
    for name, form in FORMS.items():
        parts = ', '.join(f'C-DEFINITION_{part}' for part in form.split(', '))
        assert ask('QUERY CLASS RESTRICTIONS', name).queried_objects == [f'[{parts}]'], name
    assert ask('QUERY CLASS RESTRICTIONS', 'TX').queried_objects == [], 'ARMOR has no form'


def test_one_superclass_becomes_the_definition_itself(ask: Ask, service: ArmorService) -> None:
    kb = service.workspace.references.find('map').kb
    ask('ADD CLASS', 'HALL')
    ask('ADD CLASS CLASS', 'HALL', 'ROOM')
    ask('ADD CLASS CLASS', 'LOBBY', 'HALL')
    ask('MAKE EQUIVALENT CLASS', 'HALL')
    assert EquivalentClasses((f'{IRI}#HALL', f'{IRI}#ROOM')) in kb
    assert 'LOBBY' in names(ask('QUERY CLASS CLASS', 'HALL'))
    assert ask('MAKE EQUIVALENT CLASS', 'owl:Thing').error_description.endswith('nothing to change')


def test_facts_of_any_form_are_found_and_explained(ask: Ask, service: ArmorService) -> None:
    ask('ADD OBJECTPROP IND', 'isIn', 'Robot1', 'R3')
    ask('ADD IND CLASS', 'R3', 'ROOM')
    ask('ADD DATAPROP IND', 'visitedAt', 'R3', 'LONG', '5')
    ask('ADD AXIOM', 'Individual: R3 SameAs: Kitchen')
    found = {
        'isIn(Robot1, R3)': ['isIn(Robot1, R3)'],
        'isIn(Robot1, R4)': [],
        '?(R3)': None,
        '?(Robot1, R3)': ['isIn(Robot1, R3)'],
        'visitedAt(R3, "5"^^xsd:long)': ['visitedAt(R3, "5"^^xsd:long)'],
        'visitedAt(R3, "6"^^xsd:long)': [],
        'owl:sameAs(?, ?)': ['owl:sameAs(Kitchen, R3)'],
        'owl:sameAs(Kitchen, ?)': ['owl:sameAs(Kitchen, R3)'],
        'owl:Thing(R9)': [],
        'ROOM(R9)': [],
    }
    for pattern, expected in found.items():
        answer = ask('QUERY FACT', pattern)
        if expected is not None:
            assert answer.queried_objects == expected, pattern
        else:
            assert {'ROOM(R3)', 'LOCATION(R3)', 'URGENT(R3)'} <= set(answer.queried_objects)
    assert ask('QUERY FACT', 'ROOM(?)', 'true').queried_objects == ['ROOM(R3)']
    assert ask('QUERY FACT', 'LOCATION(?)', 'true').queried_objects == []
    assert ask('QUERY FACT', 'owl:sameAs(?, ?)', 'true').queried_objects == [
        'owl:sameAs(Kitchen, R3)'
    ]
    for fact in (
        'owl:sameAs(R3, Kitchen)',
        'sameAs(R3, Kitchen)',
        'visitedAt(R3, "5"^^xsd:long)',
        'visitedAt(R3, 5)',
        'isIn(Robot1, R3)',
    ):
        assert ask('QUERY EXPLAIN', fact).success, fact
    for fact in ('visitedAt(R3, 6)', 'visitedAt(R3, "5"^^xsd:string)', 'isIn(R3, Robot1)'):
        assert not ask('QUERY EXPLAIN', fact).success, fact
    # A property of both kinds is taken for that of the two that has the value.
    ask('ADD DATAPROP IND', 'isIn', 'Robot1', 'INT', '5')
    assert ask('QUERY EXPLAIN', 'isIn(Robot1, 5)').success
    assert ask('QUERY EXPLAIN', 'isIn(Robot1, R3)').success


def test_names_are_compared_with_known_ones_of_their_kind(ask: Ask) -> None:
    near = 'class {} is new; there is {}'
    assert ask('ADD IND CLASS', 'a', 'CORRIDR').error_description == near.format(
        iri('CORRIDR'), iri('CORRIDOR')
    )
    # Six of eight letters are alike, and five of eight.
    assert 'there is' in ask('ADD IND CLASS', 'a', 'CORRIDXY').error_description
    assert ask('ADD IND CLASS', 'a', 'CORRIXYZ').error_description == ''
    assert ask('ADD DATAPROP IND', 'isIn', 'a', 'INT', '1').error_description == (
        f'{iri("isIn")} is used as a data property and is an object property, '
        'which OWL 2 DL forbids'
    )
    assert ask('ADD OBJECTPROP IND', 'now', 'a', 'b').error_description == (
        f'{iri("now")} is used as an object property and is a data property, which OWL 2 DL forbids'
    )
    assert ask('ADD OBJECTPROP IND', 'owl:topObjectProperty', 'a', 'b').error_description == ''
