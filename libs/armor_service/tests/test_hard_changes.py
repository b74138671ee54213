"""A change that reasoning cannot master is taken back and told; nobody stays without answers."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import owlready2
import pytest

from armor_service.access import Settings
from armor_service.service import ArmorService
from armor_service.store.store import Store

from .seven_rooms import IRI, ONTOLOGY, Ask, asker, names

T = 'http://t.org/o'
COUNT = 120
"""Individuals of the rule of products: some two hundred million combinations."""
PRODUCTS = f"""
Prefix(:=<{T}#>)
Ontology(<{T}>
Declaration(Class(:N)) Declaration(Class(:T)) Declaration(ObjectProperty(:r))
DLSafeRule(
  Body(ClassAtom(:T Variable(<urn:t>)) ClassAtom(:N Variable(<urn:a>))
    ClassAtom(:N Variable(<urn:b>)) ClassAtom(:N Variable(<urn:c>)) ClassAtom(:N Variable(<urn:d>))
    DifferentIndividualsAtom(Variable(<urn:a>) Variable(<urn:b>))
    DifferentIndividualsAtom(Variable(<urn:b>) Variable(<urn:c>))
    DifferentIndividualsAtom(Variable(<urn:c>) Variable(<urn:d>)))
  Head(ObjectPropertyAtom(:r Variable(<urn:a>) Variable(<urn:d>))))
{' '.join(f'ClassAssertion(:N :n{n})' for n in range(COUNT))}
DifferentIndividuals({' '.join(f':n{n}' for n in range(COUNT))})
)"""
GROWS = f"""
Prefix(:=<{T}#>)
Ontology(<{T}>
Declaration(DataProperty(:log))
DLSafeRule(
  Body(DataPropertyAtom(:log Variable(<urn:x>) Variable(<urn:y>))
    BuiltInAtom(<http://www.w3.org/2003/11/swrlb#stringConcat>
      Variable(<urn:z>) Variable(<urn:y>) Variable(<urn:y>)))
  Head(DataPropertyAtom(:log Variable(<urn:x>) Variable(<urn:z>))))
)"""
HARD = {
    'products': (PRODUCTS, ('ADD IND CLASS', 't', 'T')),
    'grows': (GROWS, ('ADD DATAPROP IND', 'log', 'i', 'STRING', 'a')),
}


class Served:
    """A durable service with a hard ontology and the patrol's map."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.notes: list[str] = []
        for name, (text, _) in HARD.items():
            (folder / f'{name}.owl').write_text(text)
        self.start()
        self.ask('LOAD FILE', ONTOLOGY, IRI, 'false', '', 'false')

    def start(self) -> None:
        settings = Settings(self._folder, reasoning_timeout=0.1, reasoning_memory=200)
        self.store = Store(self._folder / 'store')
        self.service = ArmorService(settings, print, self.notes.append, self.store)
        self.ask: Ask = asker(self.service)

    def load(self, name: str, lazy: str) -> Ask:
        path = str(self._folder / f'{name}.owl')
        loaded = self.ask('LOAD FILE', path, T, 'false', '', lazy, reference='hard')
        assert loaded.success, loaded
        return asker(self.service, 'hard', 'stranger')

    def restart(self) -> Ask:
        """Restart without a goodbye to what reasons."""
        self.service.close()
        self.start()
        return asker(self.service, 'hard', 'stranger')


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """Provide the service."""
    made = Served(tmp_path)
    yield made
    made.service.close()


def test_the_change_that_is_too_hard_is_refused_with_its_reason(served: Served) -> None:
    ask = served.load('products', 'false')
    answer = ask(*HARD['products'][1])
    assert not answer.success
    assert 'taken back: add ' in answer.error_description
    assert "client 'stranger'" in answer.error_description
    assert ask('ADD IND CLASS', 'other', 'M').success, 'the reference goes on'
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#other>']
    assert ask('QUERY IND CLASS', 'T').queried_objects == []
    (line,) = ask('QUERY TAKEN BACK').queried_objects
    assert 'stranger' in line
    assert [note for note in served.notes if note.startswith('hard: taken back: ')]
    ask = served.restart()
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#other>']
    assert ask('QUERY IND CLASS', 'T').queried_objects == []
    assert ask('QUERY TAKEN BACK').queried_objects == [line]


def test_a_rule_that_makes_ever_longer_texts_ends_and_is_named(served: Served) -> None:
    ask = served.load('grows', 'false')
    assert ask(*HARD['grows'][1]).success
    assert '"aa"^^xsd:string' in ask('QUERY DATAPROP IND', 'log', 'i').queried_objects
    assert ask('QUERY UNSUPPORTED').queried_objects
    ask = served.restart()
    assert '"aa"^^xsd:string' in ask('QUERY DATAPROP IND', 'log', 'i').queried_objects


def test_of_several_changes_only_the_hard_one_is_taken_back(served: Served) -> None:
    ask = served.load('products', 'true')
    for directive in (('ADD IND CLASS', 'x', 'M'), HARD['products'][1], ('ADD IND', 'y')):
        assert ask(*directive).success
    answer = ask('REASON')
    assert answer.success
    assert answer.error_description.startswith('taken back: ')
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#x>']
    assert ask('QUERY IND CLASS', 'T').queried_objects == []
    served.service.close()
    served.start()
    ask = asker(served.service, 'hard')
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#x>']
    assert ask('QUERY IND CLASS', 'T').queried_objects == []


def test_what_was_not_reasoned_over_before_a_restart_is_taken_back_after_it(
    served: Served,
) -> None:
    ask = served.load('products', 'true')
    ask('ADD IND CLASS', 'x', 'M')
    ask(*HARD['products'][1])
    ask('ADD IND CLASS', 'y', 'M')
    ask = served.restart()
    others = served.ask('QUERY IND', 'Robot1')
    assert names(others) == ['ROBOT'], 'others answer meanwhile'
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#x>', f'<{T}#y>']
    assert ask('QUERY IND CLASS', 'T').queried_objects == []
    assert len(ask('QUERY TAKEN BACK').queried_objects) == 1
    ask = served.restart()
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#x>', f'<{T}#y>']


def test_what_is_too_hard_and_came_while_the_service_was_off_takes_nothing_else_with_it(
    served: Served,
) -> None:
    ask = served.load('products', 'false')
    assert ask('ADD IND CLASS', 'x', 'M').success
    path = served.store.path('hard')
    served.service.close()
    world = owlready2.World(filename=str(path), exclusive=False)
    with world.get_ontology(T).load():
        world[f'{T}#T']('t')
    world.save()
    world.close()
    served.start()
    ask = asker(served.service, 'hard')
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#x>']
    assert len(ask('QUERY IND CLASS', 'N').queried_objects) == COUNT
    assert ask('QUERY IND CLASS', 'T').queried_objects == []
    (line,) = ask('QUERY TAKEN BACK').queried_objects
    assert "of client 'file'" in line


@pytest.mark.parametrize('place', [-1, 1])
def test_what_ended_the_process_again_and_again_is_not_tried_once_more(
    served: Served, tmp_path: Path, place: int
) -> None:
    """A process that the system ends says nothing; the file says over what it reasoned."""
    ask = served.load('products', 'true')
    ask('ADD IND CLASS', 'x', 'M')
    ask(*HARD['products'][1])
    served.service.close()
    (tmp_path / 'store' / 'reasoning').write_text(json.dumps({'hard': [2, place]}))
    served.start()
    ask = asker(served.service, 'hard')
    assert ask('QUERY IND CLASS', 'M').queried_objects == [f'<{T}#x>']
    assert ask('QUERY IND CLASS', 'T').queried_objects == []
    (line,) = ask('QUERY TAKEN BACK').queried_objects
    assert ('the process ended 2 times' in line) == (place == 1)


def begun(served: Served, words: str, *args: str) -> tuple[threading.Thread, list[object]]:
    """Send a directive to the hard reference; return once it reasons."""
    answers: list[object] = []
    ask = asker(served.service, 'hard')
    ref = served.service.workspace.references.find('hard')
    reasons = threading.Event()
    note = ref.on_reasoning

    def on_reasoning(place: int | None) -> None:
        note(place)
        reasons.set()

    ref.on_reasoning = on_reasoning
    thread = threading.Thread(target=lambda: answers.append(ask(words, *args)))
    thread.start()
    assert reasons.wait(60.0)
    return thread, answers


@pytest.fixture
def unbounded(served: Served) -> Served:
    """Provide the service with the hard ontology and hours for it."""
    ask = served.load('products', 'true')
    ref = served.service.workspace.references.find('hard')
    ref.effort.limits = type(ref.effort.limits)()
    ask(*HARD['products'][1])
    return served


def test_cancel_ends_what_runs_and_leaves_the_changes(unbounded: Served) -> None:
    thread, answers = begun(unbounded, 'REASON')
    ask = asker(unbounded.service, 'hard')
    assert ask('CANCEL').success
    thread.join(60.0)
    assert 'cancelled' in str(answers)
    assert ask('QUERY IND CLASS', 'T').queried_objects == [f'<{T}#t>']
    assert not ask('QUERY TAKEN BACK').queried_objects


def test_reason_may_have_a_time_of_its_own(unbounded: Served) -> None:
    ask = asker(unbounded.service, 'hard')
    answer = ask('REASON', '0.05')
    assert (answer.success, answer.timeout) == (False, True)
    assert 'more than 0.05 s' in answer.error_description
    assert 'expected a number above 0' in ask('REASON', 'soon').error_description
    assert ask('QUERY IND CLASS', 'T').queried_objects == [f'<{T}#t>']


def test_drop_waits_for_no_reasoning(unbounded: Served) -> None:
    thread, _ = begun(unbounded, 'REASON')
    begin = time.monotonic()
    assert asker(unbounded.service, 'hard')('DROP').success
    assert time.monotonic() - begin < 30.0
    assert unbounded.ask('GET ALL REFS').queried_objects == ['map']
    thread.join(60.0)
    assert not thread.is_alive()
    unbounded.restart()
    assert unbounded.ask('GET ALL REFS').queried_objects == ['map']
