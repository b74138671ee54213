"""What programs that use owlready2 see of a running service."""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import owlready2
import pytest

from armor_service import worlds as worlds_module
from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.reference import Origin, Reference
from armor_service.service import ArmorService
from armor_service.store import Store
from armor_service.worlds import Worlds, file_stem
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.notifier import Changes
from owl_reasoner.owl.axioms import ClassAssertion, SubClassOf
from owl_reasoner.owl.expressions import ObjectSomeValuesFrom

from .seven_rooms import IRI, ONTOLOGY, Ask, asker, build_seven_rooms


class Served:
    """A durable service with the seven rooms, and what it says."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.notes: list[str] = []
        self.start()
        build_seven_rooms(ArmorClient('c', 'map', InProcessTransport(self.service)), False, True)

    def start(self) -> None:
        settings = Settings(ontologies_folder=self.folder / 'files')
        self.service = ArmorService(
            settings, print, self.notes.append, Store(self.folder / 'store')
        )
        self.ask: Ask = asker(self.service)
        assert self.service.workspace.worlds
        self.worlds: Worlds = self.service.workspace.worlds

    def world(self) -> owlready2.World:
        """Open the World as a program beside the service does."""
        assert self.worlds.flush()
        path = self.worlds.path('map')
        return owlready2.World(filename=str(path), exclusive=False, read_only=True)


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """Provide the service."""
    made = Served(tmp_path)
    yield made
    made.service.close()


def names(found: object) -> set[str]:
    assert hasattr(found, '__iter__')
    return {one.name for one in found}


def test_classes_individuals_and_values_are_python_objects(served: Served) -> None:
    world = served.world()
    room = world[f'{IRI}#ROOM']
    assert names(world.classes()) >= {'ROOM', 'CORRIDOR', 'URGENT', 'DOOR', 'ROBOT'}
    assert names(room.instances()) == {'R1', 'R2', 'R3', 'R4'} | {'C1', 'C2', 'E'}
    robot = world[f'{IRI}#Robot1']
    assert names(robot.isIn if isinstance(robot.isIn, list) else [robot.isIn]) == {'E'}
    assert world[f'{IRI}#R1'].visitedAt in (1665579740, [1665579740])
    assert names(robot.canReach) == {'C1', 'C2'}, 'derived ones, too'
    assert len(list(world.rules())) == 3
    world.close()


def test_each_change_is_seen_with_what_follows_from_it(served: Served) -> None:
    served.ask('REPLACE OBJECTPROP IND', 'isIn', 'Robot1', 'R1', 'E')
    served.ask('SET DATAPROP IND', 'visitedAt', 'R1', 'LONG', '1665579999')
    served.ask('ADD IND CLASS', 'D9', 'DOOR')
    served.ask('REASON')
    world = served.world()
    robot = world[f'{IRI}#Robot1']
    assert names(robot.canReach) == {'C1'}
    assert world[f'{IRI}#R1'].visitedAt in (1665579999, [1665579999])
    assert 'D9' in names(world[f'{IRI}#DOOR'].instances())
    world.close()
    served.ask('REMOVE IND', 'D9')
    served.ask('RENAME IND', 'R4', 'Kitchen')
    served.ask('ADD CLASS CLASS', 'OFFICE', 'ROOM')
    served.ask('ADD CARDINALITY MIN', 'OFFICE', 'hasDoor', '2', 'DOOR')
    served.ask('REASON')
    world = served.world()
    assert names(world.individuals()) >= {'Kitchen', 'R1'}
    assert not {'D9', 'R4'} & names(world.individuals())
    (restriction,) = (
        part for part in world[f'{IRI}#OFFICE'].is_a if isinstance(part, owlready2.Restriction)
    )
    assert restriction.cardinality == 2
    world.close()


def test_a_reference_that_is_dropped_takes_its_world_with_it(served: Served) -> None:
    assert served.worlds.flush()
    path = served.worlds.path('map')
    assert path.exists()
    served.ask('DROP')
    assert served.worlds.flush()
    assert not path.exists()
    served.ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')
    assert served.worlds.flush()
    assert path.exists()


def test_after_a_restart_the_world_is_that_of_the_journal(served: Served) -> None:
    assert served.worlds.flush()
    served.service.close()
    path = served.worlds.path('map')
    path.write_bytes(b'no database at all' * 100)
    (path.parent / 'gone.sqlite3').write_bytes(b'')
    served.start()
    world = served.world()
    assert names(world[f'{IRI}#Robot1'].canReach) == {'C1', 'C2'}
    world.close()
    assert not (path.parent / 'gone.sqlite3').exists()
    assert [note for note in served.notes if 'put aside in damaged-' in note]


def test_who_locks_a_world_keeps_nobody_waiting_and_it_catches_up(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worlds_module, 'RETRY_SECONDS', 0.05)
    assert served.worlds.flush()
    other = sqlite3.connect(served.worlds.path('map'), isolation_level=None)
    other.execute('BEGIN IMMEDIATE')
    assert served.ask('ADD IND CLASS', 'D9', 'DOOR').success
    assert not served.worlds.flush(0.5)
    other.execute('ROLLBACK')
    other.close()
    world = served.world()
    assert 'D9' in names(world[f'{IRI}#DOOR'].instances())
    world.close()
    assert served.worlds.flush()
    assert [note.partition('sqlite3: ')[2][:20] for note in served.notes] == [
        'database is locked: ',
        'can be written again',
    ]


@pytest.mark.parametrize('name', ['map', 'a/b', '..', '.hidden', 'ä' * 100, 'x' * 256, 'a b'])
def test_every_reference_name_makes_a_file_name_of_its_own(name: str) -> None:
    stem = file_stem(name)
    assert '/' not in stem
    assert stem not in ('.', '..', '')
    assert len(stem) <= 200
    assert stem != file_stem(name + 'x')


def test_a_long_name_of_a_reference_is_hashed_for_its_file() -> None:
    assert file_stem('x' * 200) == 'x' * 200
    assert file_stem('x' * 201) == hashlib.sha256(b'x' * 201).hexdigest()[:32]
    assert file_stem('ä' * 34) == hashlib.sha256('ä'.encode() * 34).hexdigest()[:32], (
        'each is %C3%A4'
    )
    assert file_stem('a/b c') == 'a%2Fb c'
    assert file_stem(' a') == hashlib.sha256(b' a').hexdigest()[:32]


class Followed:
    """An ontology whose World is written, without a service."""

    def __init__(self, folder: Path) -> None:
        self.notes: list[str] = []
        self.worlds = Worlds(folder / 'deep' / 'worlds', self.notes.append)
        self.kb = KnowledgeBase(IRI, [self.of('a')])
        self.kb.reason()
        self.ref = Reference('map', self.kb, Origin('', ''))
        with self.ref.lock:
            self.worlds.follow(self.ref)

    def of(self, name: str, cls: str = 'K') -> ClassAssertion:
        return ClassAssertion(f'{IRI}#{cls}', f'{IRI}#{name}')

    def held(self, cls: str = 'K') -> set[str]:
        """Return who is of a class in the file."""
        assert self.worlds.flush()
        path = str(self.worlds.path('map'))
        world = owlready2.World(filename=path, exclusive=False, read_only=True)
        found = world[f'{IRI}#{cls}']
        try:
            return names(found.instances()) if found is not None else set()
        finally:
            world.close()


@pytest.fixture
def followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Followed]:
    """Provide it, written as soon as it changes."""
    monkeypatch.setattr(worlds_module, 'PAUSE', 0.0)
    monkeypatch.setattr(worlds_module, 'RETRY_SECONDS', 0.01)
    made = Followed(tmp_path)
    yield made
    made.worlds.close()


def test_a_file_is_written_anew_where_its_changes_are_too_many_or_cannot_be_told(
    followed: Followed, monkeypatch: pytest.MonkeyPatch
) -> None:
    wholes: list[int] = []
    replace = worlds_module._WorldFile.replace

    def noted(file: Any, asserted: Any, derived: Any) -> None:
        wholes.append(len(asserted))
        replace(file, asserted, derived)

    monkeypatch.setattr(worlds_module._WorldFile, 'replace', noted)
    monkeypatch.setattr(worlds_module, 'MOST_WAITING', 3)
    assert followed.held() == {'a'}
    wholes.clear()
    followed.kb.change([followed.of(name) for name in 'bc'], [followed.of('a')])
    assert followed.held() == {'b', 'c'}
    assert wholes == []
    followed.kb.change([followed.of(name) for name in 'defg'])
    assert followed.held() == set('bcdefg')
    assert wholes == [6]
    # Of an axiom with a node of its own that was never written nobody knows which node that is.
    unknown = SubClassOf(f'{IRI}#K', ObjectSomeValuesFrom(f'{IRI}#p', f'{IRI}#K'))
    waiting = followed.worlds._waiting['map']
    followed.worlds._note(waiting, Changes(9, (), ((unknown, False),), True))
    assert followed.held() == set('bcdefg')
    assert wholes == [6, 6]
    # The last axiom that names a class takes its declaration with it.
    followed.kb.change([], [followed.of('b')])
    assert followed.held() == set('cdefg')
    followed.kb.change([followed.of('b', 'OTHER')])
    assert followed.held('OTHER') == {'b'}
    followed.kb.change([], [followed.of('b', 'OTHER')])
    assert followed.held('OTHER') == set()
    world = owlready2.World(filename=str(followed.worlds.path('map')), exclusive=False)
    assert world[f'{IRI}#OTHER'] is None
    world.close()


def test_who_uses_an_ontology_for_long_is_not_waited_for(
    followed: Followed, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worlds_module, 'IN_USE', 0.0)
    monkeypatch.setattr(worlds_module, 'MOST_WAITING', 0)
    assert followed.held() == {'a'}
    with followed.ref.lock:
        followed.kb.change([followed.of('b')])
        assert not followed.worlds.flush(0.05)
    assert followed.held() == {'a', 'b'}
    assert followed.notes == []


def test_another_ontology_of_the_same_name_has_the_file(followed: Followed) -> None:
    assert followed.held() == {'a'}
    first = followed.ref
    followed.kb = KnowledgeBase(IRI, [followed.of('z')])
    followed.kb.reason()
    followed.ref = Reference('map', followed.kb, Origin('', ''))
    with followed.ref.lock:
        followed.worlds.follow(followed.ref)
    assert followed.held() == {'z'}
    # What becomes of the one before changes nothing.
    first.kb.change([followed.of('b')])
    followed.worlds.drop(first)
    assert followed.held() == {'z'}
    followed.worlds.drop(followed.ref)
    followed.worlds.drop(followed.ref)
    assert followed.worlds.flush()
    assert not followed.worlds.path('map').exists()
    assert not list(followed.worlds.directory.glob('map*'))


def test_a_file_that_was_taken_away_is_made_again(followed: Followed) -> None:
    assert followed.held() == {'a'}
    with followed.ref.lock:
        for file in followed.worlds._files.values():
            file.close()
        followed.worlds.path('map').unlink()
        followed.kb.change([followed.of('b')])
    assert followed.held() == {'a', 'b'}
