"""The file of a World: what is written in it as a whole, what others write, and its copies."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from armor_service.store.world_connection import WorldConnection
from owl_reasoner.owl.axioms import ClassAssertion

IRI = 'http://example.org/o'
ROOM = ClassAssertion(f'{IRI}#Room', f'{IRI}#r1')


@pytest.fixture
def file(tmp_path: Path) -> WorldConnection:
    made = WorldConnection(tmp_path / 'folder' / 'o.sqlite3', synced=True)
    made.make()
    with made.transaction(IRI) as (ontology, _):
        ontology.add(ROOM)
    return made


def axioms(path: Path) -> list[object]:
    again = WorldConnection(path)
    again.open()
    found = again.asserted(IRI).read().added
    again.close()
    return [axiom for axiom in found if isinstance(axiom, ClassAssertion)]


def then_full(axiom: ClassAssertion) -> Iterator[ClassAssertion]:
    yield axiom
    raise sqlite3.OperationalError('database or disk is full')


def write(path: Path, statement: str) -> None:
    with closing(sqlite3.connect(path)) as other:
        other.execute(statement)
        other.commit()


def test_a_transaction_that_fails_leaves_nothing(file: WorldConnection) -> None:
    other = ClassAssertion(f'{IRI}#Corridor', f'{IRI}#c1')
    with pytest.raises(sqlite3.OperationalError), file.transaction(IRI) as (ontology, _):
        ontology.add_all(then_full(other))
    assert axioms(file.path) == [ROOM]
    with file.transaction(IRI) as (ontology, _):
        ontology.add(other)
    assert set(axioms(file.path)) == {ROOM, other}


def test_what_others_write_is_heard_once_and_what_the_service_writes_never(
    file: WorldConnection,
) -> None:
    with file.transaction(IRI) as (ontology, inferred):
        contexts = ontology.context, inferred.context
        assert file.take_foreign(*contexts) is None
    assert not file.has_foreign()
    (quad,) = file.open().execute('SELECT s, p, o FROM objs WHERE s>300 AND o>300').fetchall()
    write(file.path, f'DELETE FROM objs WHERE s={quad[0]} AND o={quad[2]}')
    assert file.has_foreign()
    with file.transaction(IRI):
        rows = file.take_foreign(*contexts)
        assert file.take_foreign(*contexts) is None
    assert rows is not None
    assert rows.gone == [quad]
    assert rows.come == []


def test_what_came_and_went_again_is_no_change(file: WorldConnection) -> None:
    with file.transaction(IRI) as (ontology, inferred):
        contexts = ontology.context, inferred.context
    write(file.path, f'INSERT INTO objs VALUES ({contexts[0]}, 301, 6, 302)')
    write(file.path, f'DELETE FROM objs WHERE c={contexts[0]} AND s=301 AND p=6 AND o=302')
    with file.transaction(IRI):
        rows = file.take_foreign(*contexts)
    assert rows is not None
    assert not rows.come


def test_a_file_that_was_taken_away_is_lost_and_one_without_bytes_is_empty(
    file: WorldConnection,
) -> None:
    assert not file.is_lost()
    file.path.unlink()
    assert file.is_lost()
    file.close()
    assert not file.is_lost()
    file.path.touch()
    assert file.is_empty()
    file.make()
    assert not file.is_empty()


def test_a_copy_and_a_file_put_aside_hold_the_same(file: WorldConnection) -> None:
    copy = file.path.with_name('copy.sqlite3')
    file.backup(copy)
    aside = file.quarantine('damaged-')
    assert axioms(copy) == axioms(aside) == [ROOM]
    assert not file.path.exists()
    quads, lost = file.salvage(aside)
    assert quads
    assert not lost
    assert axioms(file.path) == [ROOM]
    file.remove()
    assert not list(file.path.parent.glob(f'{file.path.name}*'))
