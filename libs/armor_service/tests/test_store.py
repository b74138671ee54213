"""The durable service: after any death it is as it was answered for."""

from __future__ import annotations

import fcntl
import json
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

from armor_service import registry as registry_module
from armor_service import store as store_module
from armor_service.access import Settings
from armor_service.changes import AddAxiom, RemoveEntity, RenameEntity
from armor_service.protocol import DirectiveRequest, StoreError
from armor_service.quarantine import Quarantine, Told
from armor_service.reference import Buffering, Effort, Origin, Reference
from armor_service.service import ArmorService
from armor_service.store import Journal, Store, decode, encode
from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import ClassAssertion

from .seven_rooms import IRI, ONTOLOGY, Ask, asker, names

LOAD = ('LOAD FILE', ONTOLOGY, IRI)


class Server:
    """A service with a store, which can be restarted without a goodbye."""

    def __init__(self, directory: Path, compact_from: int = 1 << 20) -> None:
        self._directory = directory
        self._compact_from = compact_from
        self._files = directory.parent / 'files'
        self._files.mkdir(exist_ok=True)
        self.notes: list[str] = []
        self.written = threading.Event()
        self.start()

    def start(self) -> None:
        store = Store(self._directory, self._compact_from)
        settings = Settings(ontologies_folder=self._files)
        self.service = ArmorService(settings, print, self._note, store)
        self.ask: Ask = asker(self.service)

    def _note(self, text: str) -> None:
        self.notes.append(text)
        if 'can be written again' in text:
            self.written.set()

    def restart(self) -> None:
        self.service.close()
        self.start()


@pytest.fixture
def server(tmp_path: Path) -> Server:
    """Provide a fresh durable service with the patrol's ontology, nothing buffered."""
    made = Server(tmp_path / 'store')
    made.ask(*LOAD, 'false', 'PELLET', 'false')
    return made


def test_facts_mounts_and_references_come_back(server: Server) -> None:
    ask = server.ask
    ask('ADD DATAPROP IND', 'visitedAt', 'R1', 'LONG', '1')
    ask('ADD OBJECTPROP IND', 'hasDoor', 'R1', 'D1')
    ask('ADD IND CLASS', 'X', 'DOOR')
    ask('REMOVE IND CLASS', 'X', 'DOOR')
    ask('RENAME IND', 'R1', 'R2')
    ask('DISJOINT IND', 'A', 'B')
    ask('MOUNT', client='a')
    ask(*LOAD, 'false', '', 'false', reference='other')
    ask(*LOAD, 'false', '', 'false', reference='gone')
    ask('DROP', reference='gone')
    server.restart()
    ask = server.ask
    assert ask('GET ALL REFS').queried_objects == ['map', 'other']
    assert ask('GET REF CLIENT', 'map').queried_objects == ['a']
    assert ask('ADD IND', 'Y', client='b').exit_code == 102
    assert names(ask('QUERY IND', 'R2')) == ['LOCATION', 'ROOM', 'URGENT']
    assert names(ask('QUERY IND CLASS', 'DOOR')) == ['D1']
    assert ask('QUERY CLASS RESTRICTIONS', 'ROOM').queried_objects
    assert ask(*LOAD, 'false', '', 'false').error_description == 'map is loaded already'


def test_what_waits_in_the_buffer_waits_again(tmp_path: Path) -> None:
    server = Server(tmp_path / 'store')
    server.ask(*LOAD, 'true', '', 'true')
    server.ask('ADD IND CLASS', 'X', 'DOOR')
    server.ask('APPLY')
    server.ask('ADD IND CLASS', 'Y', 'DOOR')
    for place in ('A', 'B'):
        server.ask('SET OBJECTPROP IND', 'isIn', 'Robot1', place)
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X']
    server.ask('APPLY')
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']
    assert names(server.ask('QUERY OBJECTPROP IND', 'isIn', 'Robot1')) == ['B']
    server.ask(*LOAD, 'false', '', 'true')
    server.ask('ADD IND CLASS', 'Z', 'DOOR')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y', 'Z']


def test_what_waits_is_applied_where_the_buffer_was_switched_off(tmp_path: Path) -> None:
    server = Server(tmp_path / 'store')
    server.ask(*LOAD, 'true', '', 'false')
    server.ask('ADD IND CLASS', 'X', 'DOOR')
    server.ask(*LOAD, 'false', '', 'false')
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X']
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X']
    # Switched on again, what comes waits, now and after the next restart.
    server.ask(*LOAD, 'true', '', 'false')
    server.ask('ADD IND CLASS', 'Y', 'DOOR')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X']
    server.ask('APPLY')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']


def test_an_inconsistent_ontology_comes_back_as_such(server: Server) -> None:
    for value in '12':
        server.ask('ADD DATAPROP IND', 'visitedAt', 'R1', 'LONG', value)
    server.restart()
    assert not server.ask('QUERY IND', 'R1').is_consistent
    assert server.ask('REMOVE DATAPROP IND', 'visitedAt', 'R1', 'LONG', '1').is_consistent


def full(*_: object) -> None:
    raise OSError(28, 'No space left on device')


def door(name: str) -> DirectiveRequest:
    return DirectiveRequest('c', 'map', 'ADD', 'IND', 'CLASS', (name, 'DOOR'))


def test_a_full_disk_takes_no_knowledge_and_is_caught_up_with(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, 'RETRY_SECONDS', 0.01)
    load = (ONTOLOGY, IRI, 'false', '', 'false')
    with monkeypatch.context() as patch:
        patch.setattr(os, 'fdatasync', full)
        answer = server.service.execute_list([door(name) for name in 'ABC'])
        assert server.ask('ADD IND CLASS', 'D', 'DOOR').success
        lifecycle = [
            DirectiveRequest('c', 'other', 'LOAD', 'FILE', '', load),
            DirectiveRequest('c', 'other', 'DROP'),
            DirectiveRequest('c', 'map', 'QUERY', 'IND', 'CLASS', ('DOOR',)),
        ]
        assert [each.success for each in server.service.execute_list(lifecycle).responses] == [
            True
        ] * 3
    assert [each.success for each in answer.responses] == [True] * 3
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C', 'D']
    assert server.written.wait(60.0)
    assert [note.partition('store: ')[2] for note in server.notes] == [
        'No space left on device: until it can be written, changes are lost at a restart',
        'can be written again, every change is kept',
    ]
    server.ask('ADD IND CLASS', 'E', 'DOOR')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C', 'D', 'E']
    assert server.ask('GET ALL REFS').queried_objects == ['map']


def test_what_cannot_be_written_is_there_as_a_whole_or_not_at_all(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.ask('ADD IND CLASS', 'A', 'DOOR')
    with monkeypatch.context() as patch:
        patch.setattr(os, 'fdatasync', full)
        server.service.execute_list([door('B'), door('C')])
        server.service.close()
        assert server.notes[-1].endswith('2 changes are not kept')
    server.start()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A']
    with monkeypatch.context() as patch:
        patch.setattr(os, 'fdatasync', full)
        server.service.execute_list([door('B'), door('C')])
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C']


def test_changes_are_refused_one_by_one_where_too_many_wait(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, 'MOST_WAITING', 1)
    query = DirectiveRequest('c', 'map', 'QUERY', 'IND', 'CLASS', ('DOOR',))
    with monkeypatch.context() as patch:
        patch.setattr(os, 'fdatasync', full)
        server.service.execute_list([door('A'), door('B')])
        answers = server.service.execute_list([door('C'), query]).responses
    assert not answers[0].success
    assert 'nothing was done' in answers[0].error_description
    assert '2 changes wait to be written' in answers[0].error_description
    assert names(answers[1]) == ['A', 'B']


def test_snapshots_keep_the_journal_short(tmp_path: Path) -> None:
    server = Server(tmp_path / 'store', compact_from=2000)
    server.ask(*LOAD, 'false', '', 'true')
    for number in range(200):
        server.ask('REPLACE DATAPROP IND', 'now', 'Robot1', 'LONG', str(number + 1), str(number))
    server.ask('ADD IND CLASS', 'X', 'DOOR')
    server.restart()
    size = sum(path.stat().st_size for path in (tmp_path / 'store').iterdir())
    assert size < 30_000, 'without snapshots it would be twice as much'
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X']
    assert '"200"^^xsd:long' in server.ask('QUERY DATAPROP IND', 'now', 'Robot1').queried_objects
    assert server.notes == []


def test_one_snapshot_is_written_at_a_time(tmp_path: Path) -> None:
    store = Store(tmp_path / 'store', compact_from=0)
    entered: list[str] = []
    failures: list[str] = []
    store.warn = failures.append
    asked, may_go = threading.Barrier(9), threading.Event()

    @contextmanager
    def hold_all() -> Iterator[list[Reference]]:
        entered.append(threading.current_thread().name)
        assert may_go.wait(60.0)
        yield []

    def ask() -> None:
        asked.wait(60.0)
        store.compact_if_large(hold_all)

    callers = [threading.Thread(target=ask) for _ in range(8)]
    for caller in callers:
        caller.start()
    asked.wait(60.0)
    for caller in callers:
        caller.join(60.0)
    may_go.set()
    store.close()
    assert (len(entered), failures) == (1, [])


def test_a_snapshot_waits_for_an_ontology_in_use_and_holds_no_other_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registry_module, 'UNUSED_WITHIN', 60.0)
    server = Server(tmp_path / 'store', compact_from=1)
    server.ask(*LOAD, 'false', '', 'false')
    server.ask(*LOAD, 'false', '', 'false', reference='used')
    used = server.service.workspace.references.find('used')
    with used.lock:
        answers: list[bool] = []

        def ask_twice() -> None:
            answers.extend(server.ask('ADD IND CLASS', name, 'DOOR').success for name in 'XY')

        asking = threading.Thread(target=ask_twice)
        asking.start()
        asking.join(60.0)
        assert answers == [True, True]
    server.restart()
    assert list((tmp_path / 'store').glob('snapshot-*'))
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']


def test_references_that_come_and_go_while_a_snapshot_begins_are_not_mistaken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    server = Server(tmp_path / 'store', compact_from=1)
    server.ask(*LOAD, 'false', '', 'false')
    server.ask(*LOAD, 'false', '', 'false', reference='early')
    registry = server.service.workspace.references
    held = registry.held_briefly

    def held_late() -> AbstractContextManager[list[Reference]]:
        server.ask(*LOAD, 'false', '', 'false', reference='late')
        server.ask('DROP', reference='early')
        return held()

    monkeypatch.setattr(registry, 'held_briefly', held_late)
    server.ask('ADD IND CLASS', 'X', 'DOOR')
    server.restart()
    assert server.ask('GET ALL REFS').queried_objects == ['late', 'map']
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X']
    server.ask('ADD IND CLASS', 'Y', 'DOOR')
    server.restart()
    assert list((tmp_path / 'store').glob('snapshot-*')), 'the next change tries again'
    assert server.ask('GET ALL REFS').queried_objects == ['late', 'map']
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['X', 'Y']


def test_a_closed_journal_is_free_although_a_process_that_just_starts_holds_its_files(
    tmp_path: Path,
) -> None:
    journal = Journal(tmp_path / 'store')
    inherited = os.dup(journal._lock.fileno())  # as between fork and exec
    journal.close()
    Journal(tmp_path / 'store').close()
    os.close(inherited)


@pytest.mark.parametrize('left', [0, 5])
def test_a_journal_that_somebody_cut_costs_nothing_that_is_known(tmp_path: Path, left: int) -> None:
    journal = Journal(tmp_path)
    journal.append([['a', 1]])
    os.truncate(tmp_path / 'journal-0.log', left)
    journal.append([['b', 2]])
    journal.append([['c', 3]])
    assert journal.is_incomplete
    journal.close()
    journal = Journal(tmp_path)
    assert journal.records() == [['b', 2], ['c', 3]]
    assert len(journal.notes) == 1
    journal.close()


def test_a_failed_write_after_a_cut_takes_no_record_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OSError(5, 'Input/output error')

    whole, cut = Journal(tmp_path / 'whole'), Journal(tmp_path / 'cut')
    for journal in (whole, cut):
        journal.append([['a', 1]])
    os.truncate(tmp_path / 'cut' / 'journal-0.log', 5)
    for journal in (whole, cut):
        journal.append([['b', 2]])
        with monkeypatch.context() as patch:
            patch.setattr(os, 'fdatasync', broken)
            with pytest.raises(StoreError, match='Input/output error'):
                journal.append([['x', 0]])
        journal.append([['c', 3]])
        journal.close()
    # Each record is where it would be had nobody cut the file.
    sizes = {(tmp_path / name / 'journal-0.log').stat().st_size for name in ('whole', 'cut')}
    assert len(sizes) == 1
    journal = Journal(tmp_path / 'cut')
    assert journal.records() == [['b', 2], ['c', 3]]
    journal.close()


def test_what_was_cut_from_the_journal_is_in_a_snapshot(server: Server) -> None:
    server.ask('ADD IND CLASS', 'A', 'DOOR')
    store = server.service.workspace.store
    assert store is not None
    os.truncate(store.directory / 'journal-0.log', 0)
    server.ask('ADD IND CLASS', 'B', 'DOOR')
    snapshot = store._snapshot
    assert snapshot is not None
    snapshot.join(60.0)
    assert server.notes[-1].endswith('the journal was cut; all that is known is written again')
    server.ask('ADD IND CLASS', 'C', 'DOOR')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C']


def test_a_store_of_a_newer_version_is_refused(tmp_path: Path) -> None:
    journal = Journal(tmp_path / 'store')
    journal.append([['more', 'map', []]])
    journal.close()
    with pytest.raises(StoreError, match=r'cannot be read: unknown kind .more.'):
        Server(tmp_path / 'store')


def test_changes_of_a_reference_that_is_lost_are_left_out_with_one_line(tmp_path: Path) -> None:
    journal = Journal(tmp_path / 'store')
    journal.append([['change', 'nowhere', []]])
    journal.append([['mount', 'nowhere', 'a']])
    journal.close()
    server = Server(tmp_path / 'store')
    assert server.ask('GET ALL REFS').queried_objects == []
    (note,) = server.notes
    assert '2 changes of references that are not there' in note


def test_damage_costs_what_was_damaged_and_no_more(tmp_path: Path) -> None:
    server = Server(tmp_path / 'store')
    server.ask(*LOAD, 'false', '', 'true')
    for number in range(20):
        server.ask('ADD IND CLASS', f'X{number}', 'DOOR')
    server.service.close()
    (path,) = (tmp_path / 'store').glob('journal-*.log')
    whole = path.read_bytes()
    header = whole.index(b'\n')
    seed = random.Random(3)
    for byte in [10, header // 2, *(seed.randrange(len(whole)) for _ in range(20))]:
        data = bytearray(whole)
        data[byte] ^= 1 << seed.randrange(8)
        path.write_bytes(data)
        server.notes.clear()
        server.start()
        doors = names(server.ask('QUERY IND CLASS', 'DOOR'))
        assert len(server.notes) <= 1, 'one line'
        assert len(doors) >= 19, byte
        server.service.close()


WRITER = """
import sys
from pathlib import Path
from armor_service.protocol import DirectiveRequest
from armor_service.service import ArmorService
from armor_service.store import Store

service = ArmorService(store=Store(Path(sys.argv[1]), compact_from=3000))
number = int(sys.argv[2])
while True:
    number += 1
    what = 'ADD' if number % 3 else 'REMOVE'
    args = (f'X{number if number % 3 else number - 1}', 'DOOR')
    request = DirectiveRequest('c', 'map', what, 'IND', 'CLASS', args)
    assert service.execute(request).success
    sys.stdout.write(f'{number}\\n')
    sys.stdout.flush()
"""


def doors_after(number: int) -> set[str]:
    doors: set[str] = set()
    for step in range(1, number + 1):
        if step % 3:
            doors.add(f'X{step}')
        else:
            doors.discard(f'X{step - 1}')
    return doors


def test_killed_at_any_moment_it_has_exactly_what_it_answered(server: Server) -> None:
    server.service.close()
    directory = str(server._directory)
    seed = random.Random(7)
    answered = 0
    for _ in range(4):
        writer = subprocess.Popen(
            [sys.executable, '-c', WRITER, directory, str(answered)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert writer.stdout is not None
        for _ in range(seed.randrange(20, 120)):
            answered = int(writer.stdout.readline())
        writer.send_signal(signal.SIGKILL)
        for line in writer.stdout:
            if line.endswith('\n'):
                answered = int(line)
        writer.wait()
        writer.stdout.close()
        server.start()
        present = set(names(server.ask('QUERY IND CLASS', 'DOOR')))
        server.service.close()
        # The directive under way when it died may have been done, but not answered.
        assert present in (doors_after(answered), doors_after(answered + 1))
        if present != doors_after(answered):
            answered += 1


TERMS = f"""
Prefix(:=<{IRI}#>) Prefix(xsd:=<http://www.w3.org/2001/XMLSchema#>)
Ontology(<{IRI}>
Declaration(Class(:A)) Declaration(ObjectProperty(:p)) Declaration(DataProperty(:d))
EquivalentClasses(:A ObjectIntersectionOf(:B ObjectMinCardinality(2 :p :C)))
SubClassOf(:A ObjectAllValuesFrom(ObjectInverseOf(:p) ObjectUnionOf(:B ObjectComplementOf(:C))))
SubObjectPropertyOf(ObjectPropertyChain(:p :q) :r) TransitiveObjectProperty(:p)
ObjectPropertyDomain(:p :A) DataPropertyRange(:d xsd:integer)
DisjointClasses(:A :D) DifferentIndividuals(:a :b :c) SameIndividual(:x :y)
HasKey(:A (:p) (:d)) ClassAssertion(ObjectHasValue(:p :a) :b)
DataPropertyAssertion(:d :a "5"^^xsd:long) DataPropertyAssertion(:d :a "Raum"@de)
DLSafeRule(Body(ClassAtom(:A Variable(<urn:x>)) DataPropertyAtom(:d Variable(<urn:x>) "7"))
  Head(ObjectPropertyAtom(:p Variable(<urn:x>) :a)))
AnnotationAssertion(:note :a "said") Annotation(:note "of it")
)"""


def test_every_kind_of_axiom_comes_back_from_its_record() -> None:
    found = read_ontology(TERMS.encode(), IRI).axioms
    kinds = {type(axiom).__name__ for axiom in found}
    assert len(kinds) > 14
    for axiom in found:
        text = json.dumps(encode(axiom))
        again = decode(json.loads(text))
        assert again == axiom
        assert hash(again) == hash(axiom)
    for change in (
        AddAxiom(found[0]),
        RenameEntity('individual', 'a', 'b'),
        RemoveEntity('class', 'A'),
    ):
        assert decode(json.loads(json.dumps(encode(change)))) == change


@pytest.mark.parametrize('record', [[], [5], [['t']], ['NoSuch', 'a']])
def test_a_record_that_nobody_wrote_is_refused(record: list[object]) -> None:
    with pytest.raises(ValueError, match=r'no record|unknown record'):
        decode(record)


@pytest.mark.parametrize(
    ('record', 'words'),
    [
        (['load', 'map'], 'not enough values'),
        (['load', 'map', {'iri': IRI}, [], []], "no setting 'path'"),
        (['change'], 'not enough values'),
        (7, 'cannot be read'),
    ],
)
def test_a_record_that_cannot_be_read_ends_the_start_with_one_line(
    tmp_path: Path, record: object, words: str
) -> None:
    journal = Journal(tmp_path / 'store')
    journal.append([record])
    journal.close()
    with pytest.raises(StoreError, match=words) as refused:
        Store(tmp_path / 'store').recover()
    assert '\n' not in str(refused.value)
    assert 'cannot be read: ' in str(refused.value)


def reference(count: int = 3) -> Reference:
    axioms = [ClassAssertion(f'{IRI}#K', f'{IRI}#n{number}') for number in range(count)]
    kb = KnowledgeBase(IRI, axioms)
    kb.reason()
    origin = Origin('/a/map.ttl', 'ntriples', {'x': 'urn:x#'})
    buffering, quarantine = Buffering(True, True), Quarantine(lines=['a line'])
    return Reference('map', kb, origin, buffering, 'me', quarantine, Effort(base=2.5))


@pytest.mark.parametrize('count', [0, 3, 100, 101, 250])
def test_a_reference_is_made_from_its_records_again(tmp_path: Path, count: int) -> None:
    store = Store(tmp_path / 'store')
    ref = reference(count)
    waits = Told('you', 7.0, (AddAxiom(ClassAssertion(f'{IRI}#K', f'{IRI}#later')),))
    ref.buffering.waiting.append(waits)
    store.loaded(ref)
    store.close()
    store = Store(tmp_path / 'store')
    (again,) = store.recover()
    store.close()
    assert set(again.kb.axioms()) == set(ref.kb.axioms())
    assert again.kb.iri == IRI
    for name in ('name', 'origin', 'buffering', 'mounted'):
        assert getattr(again, name) == getattr(ref, name), name
    assert again.quarantine.lines == ['a line']
    assert again.buffering.waiting == [waits]
    assert not again.opened
    assert store.notes == []
    # Damage costs a hundred axioms at most, and never the settings.
    lines = (tmp_path / 'store' / 'journal-0.log').read_text().splitlines()
    assert len(lines) == 2 + -(-count // 100)


def test_a_reference_whose_first_record_is_damaged_has_its_axioms_from_the_others(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path / 'store')
    store.loaded(reference(150))
    store.close()
    path = tmp_path / 'store' / 'journal-0.log'
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b'damaged\n' + b''.join(lines[1:]))
    store = Store(tmp_path / 'store')
    (again,) = store.recover()
    store.close()
    assert len(again.kb) == 150
    assert again.mounted == 'me'
    assert len(store.notes) == 1


def test_what_was_not_reasoned_over_is_known_after_the_death_with_what_was_before(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path / 'store')
    ref = reference()
    ref.buffering.manipulation = False
    store.loaded(ref)
    before = tuple(ref.kb.axioms())
    told = [
        Told('you', 7.0, (AddAxiom(ClassAssertion(f'{IRI}#K', f'{IRI}#{name}')),)) for name in 'ab'
    ]
    for one in told:
        store.changed('map', one)
    ref.on_reasoning(1)
    # As after a death: nobody closed it.
    left = json.loads((tmp_path / 'store' / 'reasoning').read_text())
    assert left == {'map': [1, 1]}
    fcntl.flock(store._journal._lock, fcntl.LOCK_UN)
    again = Store(tmp_path / 'store')
    (found,) = again.recover()
    assert found.quarantine.untested == told
    assert set(found.quarantine.origin) == set(before)
    assert (found.quarantine.deaths, found.quarantine.died_at) == (1, 1)
    # A further one counts on, until reasoning is completed.
    found.on_reasoning(-1)
    assert json.loads((tmp_path / 'store' / 'reasoning').read_text()) == {'map': [2, -1]}
    found.on_reasoning(None)
    found.on_completed()
    found.on_reasoning(0)
    assert json.loads((tmp_path / 'store' / 'reasoning').read_text()) == {'map': [1, 0]}
    again.close()
    assert (tmp_path / 'store' / 'reasoning').read_text() == '{}'
    store.close()


def test_a_snapshot_is_written_from_the_size_on_that_was_set(tmp_path: Path) -> None:
    store = Store(tmp_path / 'store', compact_from=1)
    ref = reference()
    store.loaded(ref)
    size = store._journal.size

    @contextmanager
    def hold_all() -> Iterator[list[Reference]]:
        yield [ref]

    def compacted() -> bool:
        begun = store._snapshot
        store.compact_if_large(hold_all)
        if store._snapshot is None or store._snapshot is begun:
            return False
        store._snapshot.join(60.0)
        return True

    store._compact_from = size + 1
    assert not compacted()
    # Reasoning over it may end the process, and the journal says by which directive.
    ref.quarantine.untested = [Told('me', 0.0, ())]
    store._compact_from = size
    assert compacted()
    assert not list((tmp_path / 'store').glob('snapshot-*'))
    ref.quarantine.untested = [Told('me', 0.0, ())] * (store_module.MOST_UNTESTED + 1)
    assert compacted()
    (path,) = (tmp_path / 'store').glob('snapshot-*')
    # The next one comes where the journal is as long as the snapshot.
    store._compact_from = 1
    while store._journal.size + 60 < path.stat().st_size:
        store.mounted('map', 'me')
    assert not compacted()
    store.mounted('map', 'me')
    store.mounted('map', 'me')
    assert compacted()
    store.close()


def test_nothing_is_written_to_a_store_that_was_closed(tmp_path: Path) -> None:
    store = Store(tmp_path / 'store')
    store.close()
    for use in (
        lambda: store.mounted('map', 'me'),
        lambda: store.dropped('map'),
        lambda: store.flushed('map'),
    ):
        with pytest.raises(StoreError, match=r': closed$'):
            use()
