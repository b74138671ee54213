"""Other programs open a running service's files with owlready2, read, and write."""

from __future__ import annotations

import json
import shutil
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from armor_service.access import Settings
from armor_service.client import ArmorClient, InProcessTransport
from armor_service.service import ArmorService
from armor_service.store import write_failure
from armor_service.store.store import Store
from owl_reasoner.notifier import Changes

from .seven_rooms import IRI, Ask, asker, build_seven_rooms, names

BEGIN = f"""
import json, sys, time, types
import owlready2
from owlready2 import *
IRI = {IRI!r}
world = World(filename=sys.argv[1], exclusive=False)
onto = world.get_ontology(IRI).load()
"""


class Served:
    """A durable service with the seven rooms, what it says, and programs beside it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.notes: list[str] = []
        self.told: list[Changes | None] = []
        self.start()
        build_seven_rooms(ArmorClient('c', 'map', InProcessTransport(self.service)), False, True)

    def start(self, folder: str = 'store') -> None:
        settings = Settings(ontologies_folder=self.folder / 'files')
        self.store = Store(self.folder / folder)
        self.service = ArmorService(settings, print, self.notes.append, self.store)
        self.service.watch(lambda _, changes: self.told.append(changes))
        self.ask: Ask = asker(self.service)

    @property
    def path(self) -> Path:
        return self.store.path('map')

    def program(self, text: str, begin: str = BEGIN) -> subprocess.Popen[str]:
        """Start a program of owlready2 beside the service."""
        return subprocess.Popen(
            [sys.executable, '-c', begin + text, str(self.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, text: str, begin: str = BEGIN) -> Any:
        """Run a program to its end; return what its last line says."""
        done = self.program(text, begin)
        out, err = done.communicate(timeout=120)
        assert done.returncode == 0, err
        return json.loads(out.splitlines()[-1]) if out.strip() else None

    def until(self, holds: Callable[[], object]) -> None:
        """Wait for what follows of a foreign change; a test that fails ends by its own limit."""
        while not holds():
            time.sleep(0.01)

    def names(self, *words: str) -> list[str]:
        return names(self.ask(*words))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """Provide the service."""
    made = Served(tmp_path)
    yield made
    made.service.close()


def test_a_reader_sees_objects_values_and_what_follows(served: Served) -> None:
    begin = BEGIN.replace('exclusive=False', 'exclusive=False, read_only=True').replace(
        '.load()', ''
    )
    found = served.run(
        """
room = world[IRI + '#ROOM']
robot = world[IRI + '#Robot1']
print(json.dumps({
    'rooms': sorted(one.name for one in room.instances()),
    'reach': sorted(one.name for one in robot.canReach),
    'indirect': sorted(one.name for one in robot.INDIRECT_canReach),
    'visit': world[IRI + '#R1'].visitedAt,
    'search': sorted(one.name for one in world.search(type=world[IRI + '#CORRIDOR'])),
    'rules': len(list(world.rules())),
    'sparql': sorted(row[0].name for row in world.sparql(
        'SELECT ?x { ?x a <%s#CORRIDOR> }' % IRI)),
}))
""",
        begin,
    )
    assert found['rooms'] == ['C1', 'C2', 'E', 'R1', 'R2', 'R3', 'R4']
    assert found['reach'] == found['indirect'] == ['C1', 'C2']
    assert found['visit'] == [1665579740]
    assert found['search'] == found['sparql'] == ['C1', 'C2', 'E']
    assert found['rules'] == 3


def test_a_value_that_is_assigned_is_an_ordinary_change(served: Served) -> None:
    served.run('onto.R1.visitedAt = [7]\nworld.save()\n')
    served.until(lambda: '"7"^^xsd:long' in served.ask(*VISIT).queried_objects)
    assert served.ask(*VISIT).queried_objects == ['"7"^^xsd:long'], 'of the type it had'
    served.until(lambda: 'R1' in served.names('QUERY IND CLASS', 'URGENT'))
    found = served.run('print(json.dumps(onto.R1.visitedAt))')
    assert found == [7]
    served.service.close()
    served.start()
    assert served.ask(*VISIT).queried_objects == ['"7"^^xsd:long']
    assert served.notes == []


VISIT = ('QUERY DATAPROP IND', 'visitedAt', 'R1')


def test_what_is_written_while_the_service_is_off_is_the_same_change(served: Served) -> None:
    text = """
with onto:
    onto.R1.visitedAt = [1665579999]
    onto.R2.hasDoor.append(onto.DOOR('D9'))
    class ATTIC(onto.ROOM): pass
    ATTIC.is_a.append(onto.hasDoor.max(1, onto.DOOR))
    AllDifferent([onto.D9, onto.D1])
    onto.R3.iri = IRI + '#Kitchen'
    destroy_entity(onto.R4)
world.save()
"""
    questions = [
        ('QUERY AXIOMS', name) for name in ('R1', 'R2', 'R3', 'Kitchen', 'R4', 'ATTIC', 'D1', 'D9')
    ] + [('QUERY IND CLASS', name) for name in ('ROOM', 'CORRIDOR', 'DOOR')]

    def asked() -> list[list[str]]:
        return [sorted(served.ask(*words).queried_objects) for words in questions]

    served.service.close()
    copy = served.path.with_name('copy.sqlite3')
    shutil.copy(served.path, copy)
    served.run(text)
    served.start()
    assert '"1665579999"^^xsd:long' in str(served.ask('QUERY DATAPROP IND', 'visitedAt', 'R1'))
    assert served.ask('REASON').is_consistent
    after_a_start = asked()
    served.service.close()
    shutil.copy(copy, served.path)
    copy.unlink()
    served.start()
    served.run(text)
    served.until(lambda: 'Kitchen' in served.names('QUERY IND CLASS', 'ROOM'))
    assert asked() == after_a_start
    served.service.close()
    served.start()
    assert asked() == after_a_start


def test_individuals_classes_properties_and_rules_come_by_owlready2s_idioms(
    served: Served,
) -> None:
    served.run(
        """
with onto:
    class LAB(onto.ROOM): pass
    class isNear(ObjectProperty): pass
    class size(DataProperty, FunctionalProperty): range = [int]
    class BIG(Thing):
        equivalent_to = [onto.ROOM & onto.hasDoor.min(3, onto.DOOR)]
    rule = Imp()
    rule.set_as_rule('LAB(?x), hasDoor(?x, ?d) -> URGENT(?x)')
    lab = LAB('L1', hasDoor=[onto.D1], size=12, label=['the lab'])
    lab.isNear.append(onto.R1)
world.save()
"""
    )
    served.until(lambda: 'L1' in served.names('QUERY IND CLASS', 'URGENT'))
    assert 'L1' in served.names('QUERY IND CLASS', 'ROOM'), 'a LAB is a ROOM'
    assert served.names('QUERY OBJECTPROP IND', 'isNear', 'L1') == ['R1']
    assert served.ask('QUERY DATAPROP IND', 'size', 'L1').queried_objects == ['"12"^^xsd:integer']
    assert len(served.ask('QUERY RULES').queried_objects) == 4
    assert served.names('QUERY CLASS CLASS', 'ROOM').count('LAB') == 1
    served.service.close()
    served.start()
    assert 'L1' in served.names('QUERY IND CLASS', 'URGENT')
    served.run('destroy_entity(onto.L1)\ndestroy_entity(onto.LAB)\nworld.save()\n')
    served.until(lambda: 'L1' not in served.names('QUERY IND CLASS', 'URGENT'))
    assert 'LAB' not in served.names('QUERY CLASS CLASS', 'ROOM')
    assert 'L1' not in served.names('QUERY IND CLASS', 'ROOM')
    assert served.notes == []


def test_what_takes_nodes_without_a_name_is_changed_and_taken_away(served: Served) -> None:
    at_first = len(served.ask('QUERY AXIOMS', 'DOOR').queried_objects)
    served.run(
        """
with onto:
    onto.ROBOT.is_a.append(onto.isIn.max(1, onto.LOCATION))
    AllDifferent([onto.R1, onto.R2, onto.D1])
    onto.DOOR.is_a.append(onto.hasDoor.only(Nothing))
world.save()
"""
    )
    served.until(lambda: len(served.ask('QUERY AXIOMS', 'DOOR').queried_objects) > at_first)
    before = served.ask('QUERY AXIOMS', 'DOOR').queried_objects
    served.run(
        """
(one,) = [part for part in onto.DOOR.is_a if isinstance(part, Restriction)]
onto.DOOR.is_a.remove(one)
(other,) = [part for part in onto.ROBOT.is_a if isinstance(part, Restriction)
            and part.type == MAX]
other.cardinality = 2
world.save()
"""
    )
    served.until(lambda: len(served.ask('QUERY AXIOMS', 'DOOR').queried_objects) < len(before))
    (robot,) = (
        text for text in served.ask('QUERY AXIOMS', 'ROBOT').queried_objects if ' max ' in text
    )
    assert ' max 2 ' in robot
    # The service takes away what the other program wrote.
    assert served.ask('REMOVE AXIOM', robot).success
    found = served.run('print(json.dumps([str(p) for p in onto.ROBOT.is_a]))')
    assert [text for text in found if 'max' in text] == []
    assert served.notes == []


def test_an_individual_that_gets_another_name_is_the_same(served: Served) -> None:
    served.run("onto.R4.iri = IRI + '#Kitchen'\nworld.save()\n")
    served.until(lambda: 'Kitchen' in served.names('QUERY IND CLASS', 'ROOM'))
    assert 'R4' not in served.names('QUERY IND CLASS', 'ROOM')
    assert served.names('QUERY OBJECTPROP IND', 'hasDoor', 'Kitchen') == ['D4']
    served.ask('ADD IND CLASS', 'R4', 'DOOR')
    assert served.run('print(json.dumps(onto.R4.is_a[0].name))') == 'DOOR'
    assert served.notes == []


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ("world.graph.execute('INSERT INTO objs VALUES (?, ?, ?, ?)', (c, r1, visited, r1))", 'R1'),
        (
            "world.graph.execute('INSERT INTO objs VALUES (?, ?, ?, ?)', (c, r1, sub, -9999))",
            '9999',
        ),
    ],
)
def test_what_is_no_owl_is_undone_with_one_line(served: Served, text: str, words: str) -> None:
    before = sorted(served.ask('QUERY AXIOMS', 'R1').queried_objects)
    served.run(
        f"""
c, r1, visited = onto.graph.c, onto.R1.storid, onto.visitedAt.storid
sub = world._abbreviate('http://www.w3.org/2002/07/owl#equivalentClass')
{text}
onto.R2.visitedAt = [9]
world.save()
"""
    )
    served.until(lambda: served.notes)
    (note,) = served.notes
    assert 'is no OWL and undone' in note
    assert '\n' not in note
    assert sorted(served.ask('QUERY AXIOMS', 'R1').queried_objects) == before
    assert served.ask('QUERY DATAPROP IND', 'visitedAt', 'R2').queried_objects != [
        '"9"^^xsd:long'
    ], 'not half taken'
    (aside,) = served.path.parent.glob('refused-*')
    assert words in aside.read_text()
    served.service.close()
    served.start()
    assert sorted(served.ask('QUERY AXIOMS', 'R1').queried_objects) == before
    assert len(served.notes) == 1


def test_what_is_too_hard_is_taken_back_out_of_the_file(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    ref = served.service.workspace.references.get('map')
    assert ref is not None
    reason = ref.kb.reason

    def hard(*args: Any, **more: Any) -> bool:
        from owl_reasoner.reasoner.budget import ReasoningBudgetError

        if any('HARD' in str(axiom) for axiom in ref.kb.axioms_about(f'{IRI}#HARD')):
            raise ReasoningBudgetError('seconds', 'it takes too long')
        return reason(*args, **more)

    monkeypatch.setattr(ref.kb, 'reason', hard)
    served.run('with onto:\n    class HARD(onto.ROOM): pass\nworld.save()\n')
    served.until(lambda: served.notes)
    assert "of client 'file'" in served.notes[0]
    assert 'it takes too long' in served.notes[0]
    served.until(lambda: not served.ask('QUERY AXIOMS', 'HARD').queried_objects)
    assert served.run('print(json.dumps(onto.HARD is None))') is True


def test_who_saves_late_loses_nothing_and_keeps_nobody_waiting(served: Served) -> None:
    late = served.program(
        """
onto.R2.visitedAt = [5]
with onto:
    onto.DOOR('late')
print('open', flush=True)
sys.stdin.readline()
world.save()
print('saved', flush=True)
"""
    )
    assert late.stdout is not None
    assert late.stdin is not None
    assert late.stdout.readline() == 'open\n'
    begin = time.thread_time()
    for number in range(50):
        assert served.ask('SET DATAPROP IND', 'visitedAt', 'R1', 'LONG', str(100 + number)).success
        assert served.ask('ADD IND CLASS', f'N{number}', 'DOOR').success
    assert served.ask('SET DATAPROP IND', 'visitedAt', 'R2', 'LONG', '44').success
    assert time.thread_time() - begin < 5.0
    spill = served.path.with_suffix('.spill')
    assert spill.exists()
    # Another service on a copy, as after SIGKILL: all that was answered is there.
    late.stdin.write('\n')
    late.stdin.flush()
    assert late.stdout.readline() == 'saved\n'
    late.wait()
    served.until(lambda: not spill.exists())
    assert served.ask(*VISIT).queried_objects == ['"149"^^xsd:long']
    assert served.ask('QUERY DATAPROP IND', 'visitedAt', 'R2').queried_objects == [
        '"44"^^xsd:long'
    ], 'a value that is set is the only one, whoever wrote before'
    doors = served.names('QUERY IND CLASS', 'DOOR')
    assert {'late', 'N0', 'N49'} <= set(doors)
    served.service.close()
    served.start()
    assert served.names('QUERY IND CLASS', 'DOOR') == doors
    assert served.ask(*VISIT).queried_objects == ['"149"^^xsd:long']


def test_who_keeps_the_file_for_long_is_named(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(write_failure, 'TOLD_AFTER', 0.2)
    late = served.program("print('open', flush=True)\nsys.stdin.readline()\n")
    assert late.stdout is not None
    assert late.stdin is not None
    late.stdout.readline()
    served.ask('ADD IND CLASS', 'N', 'DOOR')
    served.until(lambda: served.notes)
    assert f'(process {late.pid}) keeps it locked; changes are kept in map.spill' in served.notes[0]
    late.kill()
    late.wait()
    served.until(lambda: len(served.notes) > 1)
    assert served.notes[1].endswith('can be written again, every change is kept')
    assert 'N' in served.run('print(json.dumps([one.name for one in onto.DOOR.instances()]))')


def test_what_is_in_the_spill_is_there_after_a_death(served: Served, tmp_path: Path) -> None:
    late = served.program(
        "onto.R1.visitedAt = [5]\nprint('open', flush=True)\nsys.stdin.readline()"
    )
    assert late.stdout is not None
    late.stdout.readline()
    for number in range(20):
        served.ask('ADD IND CLASS', f'N{number}', 'DOOR')
    served.ask('MOUNT', client='a')
    files = [path for path in served.path.parent.iterdir() if path.suffix in ('.sqlite3', '.spill')]
    files.append(served.path.with_name(served.path.name + '-wal'))
    copy = tmp_path / 'copy' / 'worlds'
    copy.mkdir(parents=True)
    ref = served.service.workspace.references.get('map')
    assert ref is not None
    with ref.lock:
        for path in files:
            (copy / path.name).write_bytes(path.read_bytes())
    late.kill()
    late.wait()
    service = ArmorService(Settings(), print, print, Store(tmp_path / 'copy'))
    ask = asker(service)
    assert {f'N{number}' for number in range(20)} <= set(names(ask('QUERY IND CLASS', 'DOOR')))
    assert ask('GET REF CLIENT', 'map').queried_objects == ['a']
    service.close()
    assert not (copy / 'map.spill').exists()


def test_who_opens_a_file_for_himself_is_refused_and_harms_nobody(served: Served) -> None:
    refused = served.program('', 'import sys, owlready2\nowlready2.World(filename=sys.argv[1])\n')
    _, err = refused.communicate(timeout=60)
    assert 'database is locked' in err
    assert served.ask('ADD IND CLASS', 'N', 'DOOR').success
    assert 'N' in served.run('print(json.dumps([one.name for one in onto.DOOR.instances()]))')


def test_three_programs_and_the_service_lose_nothing(served: Served) -> None:
    writer = """
name = sys.stdin.readline().strip()
for number in range(25):
    while True:
        try:
            with onto:
                onto.DOOR(f'{name}_{number}')
                onto.R1.comment.append(f'{name} {number}')
            world.save()
            break
        except Exception as error:
            assert 'locked' in str(error), error
            world.graph.db.rollback()
            time.sleep(0.01)
"""
    programs = [served.program(writer) for _ in range(3)]
    for name, program in zip('abc', programs, strict=True):
        assert program.stdin is not None
        program.stdin.write(f'{name}\n')
        program.stdin.flush()
    number = 0
    while any(program.poll() is None for program in programs):
        assert served.ask('ADD IND CLASS', f's_{number}', 'DOOR').success
        number += 1
        time.sleep(0.005)
    for program in programs:
        _, err = program.communicate()
        assert program.returncode == 0, err
    wanted = {f'{name}_{each}' for name in 'abc' for each in range(25)}
    wanted |= {f's_{each}' for each in range(number)}
    served.until(lambda: wanted <= set(served.names('QUERY IND CLASS', 'DOOR')))
    served.until(lambda: not served.path.with_suffix('.spill').exists())
    found = served.run('print(json.dumps([one.name for one in onto.DOOR.instances()]))')
    assert wanted <= set(found)
    served.service.close()
    served.start()
    assert wanted <= set(served.names('QUERY IND CLASS', 'DOOR'))
    assert [note for note in served.notes if 'undone' in note] == []


def test_a_second_ontology_in_the_file_is_left_alone(served: Served) -> None:
    served.run(
        """
other = world.get_ontology('http://example.org/other#')
with other:
    class Thingy(Thing): pass
    Thingy('one')
world.save()
onto.R1.visitedAt = [8]
world.save()
"""
    )
    served.until(lambda: '"8"^^xsd:long' in served.ask(*VISIT).queried_objects)
    assert served.ask('QUERY IND CLASS', '<http://example.org/other#Thingy>').queried_objects == []
    served.ask('ADD IND CLASS', 'N', 'DOOR')
    found = served.run(
        "print(json.dumps([i.name for i in world['http://example.org/other#Thingy'].instances()]))"
    )
    assert found == ['one']
    (note,) = served.notes
    assert 'wrote in the ontology <http://example.org/other#> is kept and left alone' in note


def test_a_world_that_somebody_made_is_a_reference(tmp_path: Path) -> None:
    folder = tmp_path / 'store' / 'worlds'
    folder.mkdir(parents=True)
    made = """
import sys, owlready2
from owlready2 import *
world = World(filename=sys.argv[1])
onto = world.get_ontology('http://example.org/own#')
with onto:
    class Shelf(Thing): pass
    Shelf('s1')
if len(sys.argv) > 2:
    with world.get_ontology('http://example.org/more#'):
        class More(Thing): pass
world.save()
"""
    for name, more in (('own', ()), ('two', ('two',))):
        arguments = [sys.executable, '-c', made, str(folder / f'{name}.sqlite3'), *more]
        subprocess.run(arguments, check=True)
    notes: list[str] = []
    service = ArmorService(Settings(), print, notes.append, Store(tmp_path / 'store'))
    ask = asker(service)
    assert ask('GET ALL REFS', reference='own').queried_objects == ['own']
    shelf = ask('QUERY IND CLASS', 'Shelf', reference='own').queried_objects
    assert shelf == ['<http://example.org/own#s1>']
    (note,) = notes
    assert 'is left alone: expected one ontology, found http://example.org/' in note
    service.close()


def test_subscribers_are_told_of_what_others_write(served: Served) -> None:
    came = threading.Event()

    def on_change(_: str, changes: Changes | None) -> None:
        if changes and any('Fresh' in str(axiom) for axiom, _ in changes.added):
            came.set()

    served.service.watch(on_change)
    served.run("with onto:\n    onto.DOOR('Fresh')\nworld.save()\n")
    assert came.wait(60.0)


def test_what_others_write_in_the_middle_of_a_list_does_not_cut_it(served: Served) -> None:
    """A list is in the file as a whole or not at all, at whatever moment the process ends."""

    def written() -> set[str]:
        with closing(sqlite3.connect(served.path)) as db:
            rows = db.execute('SELECT iri FROM resources').fetchall()
        return {iri.partition('#')[2] for (iri,) in rows} & {'early', 'foreign', 'late'}

    ref = served.service.workspace.references.find('map')
    with ref.lock, served.store.batch():
        assert served.ask('ADD IND CLASS', 'early', 'DOOR').success
        served.run("with onto: onto.DOOR('foreign')\nworld.save()\n")
        assert served.ask('ADD IND CLASS', 'late', 'DOOR').success
        assert written() == {'foreign'}
    assert written() == {'early', 'foreign', 'late'}
    served.until(lambda: 'foreign' in served.names('QUERY IND CLASS', 'DOOR'))


def test_sql_alone_is_heard_as_well(served: Served) -> None:
    with closing(sqlite3.connect(served.path)) as db:
        names_of = dict(db.execute('SELECT iri, storid FROM resources'))
        room, door = names_of[f'{IRI}#R1'], names_of[f'{IRI}#DOOR']
        has = names_of[f'{IRI}#hasDoor']
        (c,) = db.execute('SELECT c FROM ontologies WHERE iri=?', (f'{IRI}#',)).fetchone()
        db.execute('UPDATE store SET current_resource=current_resource+1')
        (new,) = db.execute('SELECT current_resource FROM store').fetchone()
        db.execute('INSERT INTO resources VALUES (?, ?)', (new, f'{IRI}#Hatch'))
        db.execute('INSERT INTO objs VALUES (?, ?, 6, ?)', (c, new, door))
        db.execute('INSERT INTO objs VALUES (?, ?, ?, ?)', (c, room, has, new))
        db.commit()
    served.until(lambda: 'Hatch' in served.names('QUERY OBJECTPROP IND', 'hasDoor', 'R1'))
