"""The durable service: after any death it is as it was answered for."""

from __future__ import annotations

import errno
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path

import owlready2
import pytest

from armor_service.access import Settings
from armor_service.changes import AddAxiom, RemoveEntity, RenameEntity
from armor_service.protocol import DirectiveRequest, StoreError
from armor_service.quarantine import Quarantine, Submission
from armor_service.reference import Buffering, Origin, Reference
from armor_service.service import ArmorService
from armor_service.store import store as store_module
from armor_service.store.records import decode, encode
from armor_service.store.spill import Spill
from armor_service.store.store import Store, file_stem
from armor_service.store.world_file import WorldFile
from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import ClassAssertion

from .seven_rooms import FIXTURES, IRI, ONTOLOGY, Ask, asker, names

OLD = 'http://example.org/old'
LOAD = ('LOAD FILE', ONTOLOGY, IRI)
LOAD_ALL = (ONTOLOGY, IRI, 'false', 'PELLET', 'false')


class Server:
    """A service with a store, which can be restarted without a goodbye."""

    def __init__(self, directory: Path, *, synced: bool = False) -> None:
        self.directory = directory
        self._files = directory.parent / 'files'
        self._files.mkdir(exist_ok=True)
        self._synced = synced
        self.notes: list[str] = []
        self.written = threading.Event()
        self.start()

    def start(self) -> None:
        settings = Settings(ontologies_folder=self._files)
        self.store = Store(self.directory, synced=self._synced)
        self.service = ArmorService(settings, print, self._note, self.store)
        self.ask: Ask = asker(self.service)

    def _note(self, text: str) -> None:
        self.notes.append(text)
        if 'can be written again' in text:
            self.written.set()

    def restart(self) -> None:
        self.service.close()
        self.start()

    @property
    def path(self) -> Path:
        return self.store.path('map')


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


def full_file(*_: object) -> None:
    raise sqlite3.OperationalError('database or disk is full')


def door(name: str) -> DirectiveRequest:
    return DirectiveRequest('c', 'map', 'ADD', 'IND', 'CLASS', (name, 'DOOR'))


def test_a_full_disk_takes_no_knowledge_and_is_caught_up_with(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = (ONTOLOGY, IRI, 'false', '', 'false')
    with monkeypatch.context() as patch:
        patch.setattr(WorldFile, '_committed', full_file)
        patch.setattr(Spill, 'append', full)
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
    assert [note.partition('.sqlite3: ')[2] for note in server.notes if 'map.' in note] == [
        'database or disk is full: until it can be written, changes are lost at a restart',
        'can be written again, every change is kept',
    ]
    server.ask('ADD IND CLASS', 'E', 'DOOR')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C', 'D', 'E']
    assert server.ask('GET ALL REFS').queried_objects == ['map']


def test_a_file_that_may_not_grow_gives_its_changes_to_the_spill(server: Server) -> None:
    db = server.store._files['map'].connection.db
    assert db is not None
    (pages,) = db.execute('PRAGMA page_count').fetchone()
    db.execute(f'PRAGMA max_page_count = {pages}')
    for number in range(400):
        assert server.ask('ADD IND CLASS', f'a_door_with_a_long_name_{number}', 'DOOR').success
    assert [note for note in server.notes if 'changes are kept in map.spill' in note]
    # Like a SIGKILL: the files as they are at one moment.
    ref = server.service.workspace.references.get('map')
    assert ref is not None
    with ref.lock:
        shutil.copytree(server.directory, server.directory.with_name('copy'))
    again = Server(server.directory.with_name('copy'))
    assert len(names(again.ask('QUERY IND CLASS', 'DOOR'))) == 400
    again.restart()
    assert len(names(again.ask('QUERY IND CLASS', 'DOOR'))) == 400
    assert not list(again.path.parent.glob('*.spill'))


def test_what_cannot_be_written_is_there_as_a_whole_or_not_at_all(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    server.ask('ADD IND CLASS', 'A', 'DOOR')
    with monkeypatch.context() as patch:
        patch.setattr(WorldFile, '_committed', full_file)
        patch.setattr(Spill, 'append', full)
        server.service.execute_list([door('B'), door('C')])
        server.service.close()
        assert server.notes[-1].endswith('2 changes are not kept')
    server.start()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A']
    with monkeypatch.context() as patch:
        patch.setattr(WorldFile, '_committed', full_file)
        patch.setattr(Spill, 'append', full)
        server.service.execute_list([door('B'), door('C')])
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C']


def test_changes_are_refused_one_by_one_where_too_many_wait(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(store_module, 'MOST_WAITING', 1)
    query = DirectiveRequest('c', 'map', 'QUERY', 'IND', 'CLASS', ('DOOR',))
    with monkeypatch.context() as patch:
        patch.setattr(WorldFile, '_committed', full_file)
        patch.setattr(Spill, 'append', full)
        server.service.execute_list([door('A'), door('B')])
        answers = server.service.execute_list([door('C'), query]).responses
    assert not answers[0].success
    assert 'nothing was done' in answers[0].error_description
    assert '2 changes wait to be written' in answers[0].error_description
    assert names(answers[1]) == ['A', 'B']


def test_a_folder_that_was_taken_away_is_written_again(server: Server) -> None:
    server.ask('ADD IND CLASS', 'A', 'DOOR')
    for path in server.path.parent.iterdir():
        path.unlink()
    server.ask('ADD IND CLASS', 'B', 'DOOR')
    assert [note for note in server.notes if 'is no longer there' in note]
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B']


def test_only_one_service_has_a_folder(server: Server) -> None:
    with pytest.raises(StoreError, match='in use by another process'):
        Store(server.directory)
    server.service.close()
    Store(server.directory).close()


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        (b'no database at all' * 100, 'file is not a database; put aside in damaged-'),
        (b'SQLite format 3\x00' + b'\x00' * 4000, 'put aside in damaged-'),
    ],
)
def test_a_file_that_is_no_database_is_put_aside(
    server: Server, content: bytes, words: str
) -> None:
    server.service.close()
    path = server.path
    path.write_bytes(content)
    server.start()
    assert [note for note in server.notes if words in note], server.notes
    assert server.ask('GET ALL REFS').queried_objects == []
    assert list(path.parent.glob('damaged-*'))
    assert server.ask(*LOAD, 'false', 'PELLET', 'false').success


@pytest.mark.parametrize(
    ('tables', 'words', 'least'),
    [
        (('objs',), 'statements were saved; nothing is lost', 600),
        (('objs', 'index_objs_op'), 'statements were saved; of 1 tables some may be lost', 200),
        (('index_objs_op',), '', 600),
    ],
)
def test_of_a_damaged_file_what_can_be_read_is_kept(
    server: Server, tables: tuple[str, ...], words: str, least: int
) -> None:
    for number in range(600):
        server.ask('ADD IND CLASS', f'D{number}', 'DOOR')
    server.service.close()
    path = server.path
    data = bytearray(path.read_bytes())
    with closing(sqlite3.connect(path)) as db:
        for table in tables:
            query = 'SELECT pageno FROM dbstat WHERE name=? AND pagetype=?'
            pages = [page for (page,) in db.execute(query, (table, 'leaf'))]
            middle = pages[len(pages) // 2]
            data[(middle - 1) * 4096 : middle * 4096] = b'\xff' * 4096
    path.write_bytes(bytes(data))
    server.start()
    assert not words or [note for note in server.notes if words in note], server.notes
    kept = names(server.ask('QUERY IND CLASS', 'DOOR'))
    assert least <= len(kept) <= 600
    assert server.ask('ADD IND CLASS', 'last', 'DOOR').success
    assert not words or [note for note in server.notes if 'put aside in damaged-' in note]
    assert all('\n' not in note for note in server.notes)
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == sorted([*kept, 'last'])


def test_a_world_of_another_version_is_refused_with_one_line(server: Server) -> None:
    server.service.close()
    with closing(sqlite3.connect(server.path)) as db:
        db.execute('UPDATE store SET version=13')
        db.commit()
    with pytest.raises(StoreError, match='of version 13 of owlready2, expected 12'):
        server.start()


def test_what_is_no_reference_is_left_alone_and_put_aside_by_a_load(tmp_path: Path) -> None:
    folder = tmp_path / 'store' / 'worlds'
    folder.mkdir(parents=True)
    with closing(sqlite3.connect(folder / 'other.sqlite3')) as db:
        db.execute('CREATE TABLE notes (text)')
        db.execute("INSERT INTO notes VALUES ('mine')")
        db.commit()
    world = owlready2.World(filename=str(folder / 'map.sqlite3'))
    for name in 'ab':
        world.get_ontology(f'http://example.org/{name}#')
    world.save()
    world.close()
    server = Server(tmp_path / 'store')
    two, other = sorted(server.notes)
    assert 'map.sqlite3: is left alone: expected one ontology, found' in two
    assert other.endswith('other.sqlite3: is left alone: is no World of owlready2')
    server.notes.clear()
    for name in ('map', 'other'):
        request = DirectiveRequest('c', name, 'LOAD', 'FILE', '', LOAD_ALL)
        assert server.service.execute(request).success
    assert len([note for note in server.notes if 'put aside in replaced-' in note]) == 2
    server.restart()
    assert server.ask('QUERY IND CLASS', 'ROBOT').success
    (aside,) = folder.glob('replaced-*-other.sqlite3')
    with closing(sqlite3.connect(aside)) as db:
        assert db.execute('SELECT text FROM notes').fetchall() == [('mine',)]
    (aside,) = folder.glob('replaced-*-map.sqlite3')
    world = owlready2.World(filename=str(aside))
    assert {'http://example.org/a#', 'http://example.org/b#'} <= {*world.ontologies}
    world.close()


def test_tables_of_others_stay_in_the_file(server: Server) -> None:
    with closing(sqlite3.connect(server.path)) as db:
        db.execute('CREATE TABLE notes (text)')
        db.execute("INSERT INTO notes VALUES ('mine')")
        db.commit()
    server.ask('ADD IND CLASS', 'D9', 'DOOR')
    server.restart()
    assert '<' + IRI + '#D9>' in server.ask('QUERY IND CLASS', 'DOOR').queried_objects
    with closing(sqlite3.connect(server.path)) as db:
        assert db.execute('SELECT text FROM notes').fetchall() == [('mine',)]
    assert server.notes == []


def test_a_folder_that_may_not_be_written_is_told_and_keeps_nobody_from_working(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EROFS, 'Read-only file system')

    with monkeypatch.context() as patched:
        patched.setattr(WorldFile, '_opened', refuse)
        patched.setattr(Spill, 'append', refuse)
        patched.setattr(Spill, 'clear', refuse)
        patched.setattr('os.access', lambda *_: False)
        request = DirectiveRequest('c', 'map', 'LOAD', 'FILE', '', LOAD_ALL)
        assert server.service.execute(request).success
        server.ask('ADD IND CLASS', 'D9', 'DOOR')
        (note,) = [note for note in server.notes if 'Read-only' in note]
        assert note.endswith('until it can be written, changes are lost at a restart')
    server.written.wait(60.0)
    server.restart()
    assert '<' + IRI + '#D9>' in server.ask('QUERY IND CLASS', 'DOOR').queried_objects


def test_an_import_that_is_not_there_is_told_and_costs_no_cases(
    tmp_path: Path, server: Server
) -> None:
    path = tmp_path / 'files' / 'importing.omn'
    path.write_text('Ontology: <http://x/a> Import: <http://x/gone> Individual: <http://x/a#i>')
    request = DirectiveRequest(
        'c', 'a', 'LOAD', 'FILE', '', (str(path), 'http://x/a', *LOAD_ALL[2:])
    )
    said = server.service.execute(request)
    assert said.success
    assert said.error_description.startswith('1 statements not supported')
    assert 'owl:imports <http://x/gone> is not followed: no such file' in said.error_description
    for _ in range(2):
        query = DirectiveRequest('c', 'a', 'QUERY', 'UNSUPPORTED', '', ())
        found = server.service.execute(query).queried_objects
        assert found == ['owl:imports <http://x/gone> is not followed']
        server.restart()


def test_a_copy_is_whole_while_the_service_runs(server: Server, tmp_path: Path) -> None:
    server.ask('ADD IND CLASS', 'A', 'DOOR')
    assert server.ask('BACKUP', 'copy.sqlite3').success
    server.ask('ADD IND CLASS', 'B', 'DOOR')
    copied = tmp_path / 'files' / 'copy.sqlite3'
    server.service.close()
    shutil.copyfile(copied, server.path)
    server.start()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A']
    refused = server.ask('BACKUP', 'copy.owl')
    assert 'expected a name that ends in .sqlite3' in refused.error_description


def test_a_copy_says_what_it_lacks_while_another_program_has_the_file(server: Server) -> None:
    with closing(sqlite3.connect(server.path, isolation_level=None)) as other:
        other.execute('BEGIN IMMEDIATE')
        server.ask('ADD IND CLASS', 'A', 'DOOR')
        copied = server.ask('BACKUP', 'copy.sqlite3')
        assert copied.success
        lacks = 'the copy lacks 1 changes that wait to be written: database is locked'
        assert copied.error_description == lacks
        other.execute('ROLLBACK')


def test_a_full_disk_behind_a_locked_file_loses_nothing_once_both_are_over(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(sqlite3.connect(server.path, isolation_level=None)) as other:
        other.execute('BEGIN IMMEDIATE')
        server.ask('ADD IND CLASS', 'A', 'DOOR')
        with monkeypatch.context() as patch:
            patch.setattr(Spill, 'append', full)
            # What tells it goes to a file on the same disk.
            patch.setattr(server.service.workspace, '_warn', full)
            server.ask('ADD IND CLASS', 'B', 'DOOR')
        # There is room again, and the file is still locked: a death keeps both.
        server.ask('ADD IND CLASS', 'C', 'DOOR')
        kept = server.path.with_suffix('.spill').read_bytes()
        assert all(f'#{name}'.encode() in kept for name in 'ABC')
        other.execute('ROLLBACK')
    server.restart()
    assert names(server.ask('QUERY IND CLASS', 'DOOR')) == ['A', 'B', 'C']


def test_a_spill_that_cannot_be_removed_is_merged_once(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(sqlite3.connect(server.path, isolation_level=None)) as other:
        other.execute('BEGIN IMMEDIATE')
        server.ask('ADD IND CLASS', 'A', 'DOOR')
        other.execute('ROLLBACK')
    with monkeypatch.context() as patch:
        patch.setattr(Spill, 'clear', full)
        file = server.store._files['map']
        while file.is_behind:
            with file.ref.lock:
                file.attend()
        assert server.ask('REMOVE IND CLASS', 'A', 'DOOR').success
    server.restart()
    assert not names(server.ask('QUERY IND CLASS', 'DOOR'))


WRITER = """
import sys
from pathlib import Path
from armor_service.access import Settings
from armor_service.protocol import DirectiveRequest
from armor_service.service import ArmorService
from armor_service.store.store import Store

service = ArmorService(Settings(), print, lambda _: None, Store(Path(sys.argv[1])))
number = int(sys.argv[2])
while True:
    number += 1
    words = ('ADD', f'D{number}') if number % 5 else ('REMOVE', f'D{number - 1}')
    request = DirectiveRequest('w', 'map', words[0], 'IND', 'CLASS', (words[1], 'DOOR'))
    assert service.execute(request).success
    print(number, flush=True)
"""


def doors_after(number: int) -> set[str]:
    present: set[str] = set()
    for each in range(1, number + 1):
        if each % 5:
            present.add(f'D{each}')
        else:
            present.discard(f'D{each - 1}')
    return present


@pytest.mark.parametrize('synced', [False, True])
def test_killed_at_any_moment_it_has_exactly_what_it_answered(tmp_path: Path, synced: bool) -> None:
    server = Server(tmp_path / 'store', synced=synced)
    server.ask(*LOAD, 'false', 'PELLET', 'false')
    server.service.close()
    directory = str(server.directory)
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


def test_a_store_of_before_is_read_once_and_put_aside(tmp_path: Path) -> None:
    shutil.copytree(FIXTURES / 'journal', tmp_path / 'store')
    server = Server(tmp_path / 'store')
    assert [note for note in server.notes if 'the journal is put aside in converted-' in note]
    assert not list((tmp_path / 'store').glob('*.log'))
    assert len(list((tmp_path / 'store').glob('converted-*/*.log'))) == 2
    for _ in range(2):
        ask = server.ask
        assert ask('GET ALL REFS').queried_objects == ['map']
        assert ask('QUERY IND CLASS', 'DOOR').queried_objects == [f'<{OLD}#D1>']
        assert ask('QUERY DATAPROP IND', 'visitedAt', 'Hall').queried_objects == ['"007"^^xsd:long']
        assert ask('QUERY TAKEN BACK').queried_objects == ['a line']
        assert ask('GET REF CLIENT', 'map').queried_objects == ['none']
        server.restart()
    server.ask('APPLY')
    doors = server.ask('QUERY IND CLASS', 'DOOR').queried_objects
    assert doors == [f'<{OLD}#D1>', f'<{OLD}#D2>'], 'it waited'
    server.service.close()


def test_damage_in_a_store_of_before_costs_what_was_damaged(tmp_path: Path) -> None:
    shutil.copytree(FIXTURES / 'journal', tmp_path / 'store')
    path = tmp_path / 'store' / 'journal-1.log'
    path.write_bytes(path.read_bytes().replace(b'visitedAt', b'visitedat'))
    server = Server(tmp_path / 'store')
    assert [note for note in server.notes if '1 damaged entries are left out' in note]
    doors = server.ask('QUERY IND CLASS', 'DOOR').queried_objects
    assert doors == [f'<{OLD}#D1>']
    server.service.close()


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


def reference(count: int = 3) -> Reference:
    axioms = [ClassAssertion(f'{IRI}#K', f'{IRI}#n{number}') for number in range(count)]
    kb = KnowledgeBase(IRI, axioms)
    kb.reason()
    origin = Origin('/a/map.ttl', 'ntriples', {'x': 'urn:x#'})
    return Reference('map', kb, origin, Buffering(False, True), 'me', Quarantine(lines=['a line']))


def test_a_reference_is_as_it_was(tmp_path: Path) -> None:
    store = Store(tmp_path / 'store')
    assert store.recover() == []
    ref = reference()
    store.loaded(ref)
    waits = Submission('you', 7.0, (RenameEntity('individual', f'{IRI}#a', f'{IRI}#b'),))
    ref.buffering.waiting.append(waits)
    store.commit(ref)
    store.close()
    store = Store(tmp_path / 'store')
    (again,) = store.recover()
    store.close()
    assert set(again.kb.axioms()) == set(ref.kb.axioms())
    assert again.kb.iri == IRI
    for name in ('name', 'origin', 'buffering', 'mounted'):
        assert getattr(again, name) == getattr(ref, name), name
    assert again.quarantine.lines == ['a line']
    assert not again.opened
    assert store.notes == []


def test_what_was_not_reasoned_over_is_known_after_the_death_with_what_was_before(
    tmp_path: Path,
) -> None:
    store = Store(tmp_path / 'store')
    store.recover()
    ref = reference()
    store.loaded(ref)
    before = set(ref.kb.axioms())
    told = [
        Submission('you', 7.0, (AddAxiom(ClassAssertion(f'{IRI}#K', f'{IRI}#{name}')),))
        for name in 'ab'
    ]
    for one in told:
        ref.submit(one)
        store.commit(ref)
    ref.on_reasoning(1)
    # As after a death: nobody closed it.
    note = tmp_path / 'store' / 'reasoning'
    assert json.loads(note.read_text()) == {'map': [1, 1]}
    with ref.lock:
        shutil.copytree(tmp_path / 'store', tmp_path / 'copy')
    note = tmp_path / 'copy' / 'reasoning'
    again = Store(tmp_path / 'copy')
    (found,) = again.recover()
    assert found.quarantine.untested == told
    assert set(found.quarantine.origin) == before
    assert (found.quarantine.deaths, found.quarantine.died_at) == (1, 1)
    # A further one counts on, until reasoning is completed.
    found.on_reasoning(-1)
    assert json.loads(note.read_text()) == {'map': [2, -1]}
    found.on_reasoning(None)
    found.on_completed()
    found.on_reasoning(0)
    assert json.loads(note.read_text()) == {'map': [1, 0]}
    # Reasoned over, nothing of it is left to be tried.
    with found.lock:
        found.open()
        again.commit(found)
    again.close()
    assert note.read_text() == '{}'
    store.close()
    last = Store(tmp_path / 'copy')
    (found,) = last.recover()
    last.close()
    assert (found.quarantine.untested, found.quarantine.origin) == ([], ())


def test_nothing_is_written_to_a_store_that_was_closed(tmp_path: Path) -> None:
    store = Store(tmp_path / 'store')
    store.recover()
    store.close()
    for use in (
        lambda: store.loaded(reference()),
        lambda: store.dropped('map'),
        lambda: store.check('map'),
    ):
        with pytest.raises(StoreError, match=r': closed$'):
            use()


def test_a_folder_that_cannot_be_used_is_told(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(StoreError, match='file: '):
        Store(tmp_path / 'file')


@pytest.mark.parametrize('name', ['map', 'a/b', '..', '.hidden', 'ä' * 100, 'x' * 256, 'a b'])
def test_every_reference_name_makes_a_file_name_of_its_own(name: str) -> None:
    stem = file_stem(name)
    assert '/' not in stem
    assert stem not in ('.', '..', '')
    assert len(stem) <= 200
    assert stem != file_stem(name + 'x')


def test_references_of_any_name_come_back(server: Server) -> None:
    for name in ('a/b', '..', 'ä' * 100, 'a b'):
        assert server.ask(*LOAD, 'false', '', 'false', reference=name).success
    server.restart()
    assert set(server.ask('GET ALL REFS').queried_objects) == {'map', 'a/b', '..', 'ä' * 100, 'a b'}
    server.service.close()
    assert os.listdir(server.directory)
