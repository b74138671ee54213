"""What programs that use owlready2 see of a running service."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from pathlib import Path

import owlready2
import pytest

from armor_service import worlds as worlds_module
from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService
from armor_service.store import Store
from armor_service.worlds import Worlds, file_stem

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
