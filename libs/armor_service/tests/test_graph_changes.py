"""What a query's process is told of an ontology: a difference where that will do, else all."""

from __future__ import annotations

import math
from typing import Any

import pytest

from armor_service import sparql
from armor_service.access import Settings
from armor_service.protocol import DirectiveError
from armor_service.reference import Origin, Reference
from armor_service.sparql import GraphChanges, GraphUpdate, SparqlEngine, Version
from owl_reasoner.knowledge_base import KnowledgeBase
from owl_reasoner.owl.axioms import (
    AnnotationAssertion,
    Axiom,
    AxiomAnnotation,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
    SubClassOf,
)
from owl_reasoner.owl.expressions import Literal, ObjectSomeValuesFrom
from owl_reasoner.owl.vocabulary import RDFS, THING

X = 'http://x.org/o#'
LABEL = RDFS + 'label'


class Followed:
    """An ontology whose changes are noted, and what a process with its graph is told."""

    def __init__(self, *axioms: Axiom, derived: bool = True) -> None:
        self.kb = KnowledgeBase(X.rstrip('#'), axioms)
        self.kb.reason()
        self.ref = Reference('map', self.kb, Origin('', ''))
        self.graphs = GraphChanges()
        self.derived = derived
        self.kb.subscribe(lambda changes: self.graphs.note('map', changes))
        first = self.update()
        assert first is not None
        assert first.whole

    known: Version | None = None

    def update(self) -> GraphUpdate | None:
        found = self.graphs.update(self.ref, self.derived, self.known)
        if found is not None:
            self.known = found.version
        return found

    def told(self, added: tuple[Axiom, ...] = (), removed: tuple[Axiom, ...] = ()) -> Any:
        """Change and reason; return whether all was told, what came and what went."""
        self.kb.change(added, removed)
        self.kb.reason()
        found = self.update()
        return found and (found.whole, set(found.added), set(found.removed))


def of(name: str, cls: str = 'K') -> ClassAssertion:
    return ClassAssertion(X + cls, X + name)


def near(name: str, other: str) -> ObjectPropertyAssertion:
    return ObjectPropertyAssertion(X + 'near', X + name, X + other)


def size(name: str, value: str) -> DataPropertyAssertion:
    return DataPropertyAssertion(X + 'size', X + name, Literal(value))


BELOW = SubClassOf(X + 'K', X + 'ABOVE')


def test_facts_that_come_and_go_are_told_alone() -> None:
    known = Followed(of('a'), near('a', 'b'), size('a', '1'), BELOW)
    assert known.update() is None, 'nothing is new'
    kept = (near('c', 'd'), size('c', '3'))
    assert known.told(kept) == (False, set(kept), set())
    assert known.told((of('c'),), (near('a', 'b'), size('a', '1'))) == (
        False,
        {of('c'), of('c', 'ABOVE')},
        {near('a', 'b'), size('a', '1')},
    )
    # What is asserted no longer and derived still is there as before.
    known.told((of('c', 'ABOVE'),))
    assert known.told((), (of('c', 'ABOVE'),)) == (False, {of('c', 'ABOVE')}, set())


def test_without_derived_facts_only_asserted_ones_are_told() -> None:
    known = Followed(of('a'), BELOW, derived=False)
    assert known.told((of('c'),))[:2] == (False, {of('c')})
    assert known.told((), (of('c'),))[:2] == (False, set())


@pytest.mark.parametrize(
    'axiom',
    [
        ClassAssertion(X + 'K', '_:n'),
        ClassAssertion(ObjectSomeValuesFrom(X + 'near', THING), X + 'a'),
        ObjectPropertyAssertion(X + 'near', '_:n', X + 'a'),
        ObjectPropertyAssertion(X + 'near', X + 'a', '_:n'),
        DataPropertyAssertion(X + 'size', '_:n', Literal('1')),
        SubClassOf(X + 'K', ObjectSomeValuesFrom(X + 'near', THING)),
        SubClassOf(ObjectSomeValuesFrom(X + 'near', THING), X + 'K'),
        AnnotationAssertion(LABEL, X + 'a', Literal('name')),
    ],
)
def test_what_is_no_single_triple_makes_all_be_told(axiom: Axiom) -> None:
    known = Followed(of('a'), near('a', 'b'), size('a', '1'))
    assert known.told((axiom,))[0]
    assert known.told((of('c'),))[:2] == (False, {of('c')}), 'the next is a difference again'


def test_only_the_last_changes_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sparql, 'KEPT', 3)
    for count in (3, 4):
        known = Followed(of('a'), derived=False)
        for number in range(count):
            known.kb.change([of(f'n{number}')])
        found = known.update()
        assert found is not None
        assert found.whole == (count == 4)


def test_the_last_axiom_of_a_class_or_property_takes_its_declaration_with_it() -> None:
    known = Followed(of('a'), of('b'), near('a', 'b'))
    assert known.told((), (of('a'),)) == (False, set(), {of('a')})
    assert known.told((), (of('b'),))[0], 'nobody is a K any more'
    assert known.told((), (near('a', 'b'),))[0]
    # The last axiom of an individual is nothing special.
    more = Followed(of('a'), of('b'))
    assert more.told((), (of('b'),)) == (False, set(), {of('b')})


def test_a_dropped_ontology_and_another_of_its_name_are_told_apart() -> None:
    known = Followed(of('a'))
    before = known.graphs.version(known.ref, True)
    known.graphs.note('map', None)
    assert known.graphs.version(known.ref, True).epoch != before.epoch
    assert known.told((of('b'),))[0]
    # Nobody asked about it: nothing is kept.
    graphs = GraphChanges()
    known.kb.subscribe(lambda changes: graphs.note('map', changes))
    known.kb.change([of('c')])
    assert graphs.version(known.ref, True).sequence == 0


def test_an_ontology_of_which_nothing_is_derived_is_told_whole_when_it_changes() -> None:
    known = Followed(of('a'))
    known.ref.too_hard = 'so long'
    known.ref.revision += 1
    found = known.update()
    assert found is not None
    assert found.whole
    assert known.update() is None
    known.kb.change([of('b')])
    known.ref.revision += 1
    found = known.update()
    assert found is not None
    assert found.whole


def test_triples_are_written_with_what_they_name_and_what_is_said_of_them() -> None:
    version = Version(0, True, 0)
    said = AxiomAnnotation(of('a'), ((LABEL, Literal('sure')),))
    whole = GraphUpdate(
        version, True, X.rstrip('#'), [of('a'), near('a', 'b'), size('a', '1'), BELOW, said]
    )
    removed, added = whole.triples()
    assert removed == b''
    text = added.decode()
    for name, kind in (('K', 'Class'), ('ABOVE', 'Class'), ('near', 'ObjectProperty')):
        assert f'<{X}{name}> ' in text
        assert text.count(f'<{X}{name}> <http://www.w3.org/1999/02/22-rdf-syntax-ns#type> ') >= 1
        assert f'#{kind}>' in text
    assert f'<{X}size> <http://www.w3.org/1999/02/22-rdf-syntax-ns#type> ' in text
    assert text.count(f'<{X}a> <http://www.w3.org/1999/02/22-rdf-syntax-ns#type> <{X}K> .') == 1
    assert 'annotatedSource' in text
    assert '"sure"' in text
    removed, added = GraphUpdate(version, False, X.rstrip('#'), [], [near('a', 'b')]).triples()
    assert removed.decode() == f'<{X}a> <{X}near> <{X}b> .\n'
    assert f'{X}near' not in added.decode()


class Idle:
    """Stands for a process that runs no query."""

    def __init__(self, version: Version | None) -> None:
        self.version = version
        self.ended = False

    def kill(self) -> None:
        self.ended = True

    def prepare(self, *_: Any) -> None: ...

    def ask(self, *_: Any) -> dict[str, Any]:
        return {'rows': []}


def test_the_process_that_has_most_of_a_graph_is_asked_and_two_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = Followed(of('a'))
    engine = SparqlEngine(Settings())
    engine.note('map', None)
    engine._graphs = known.graphs
    now = known.graphs.version(known.ref, True)
    older, old, other, plain = (
        Idle(Version(now.epoch, True, now.sequence - 5)),
        Idle(Version(now.epoch, True, now.sequence - 2)),
        Idle(Version(now.epoch + 1, True, now.sequence)),
        Idle(Version(now.epoch, False, now.sequence)),
    )
    engine._idle = [other, older, plain, old, Idle(None)]  # type: ignore[list-item]
    for best in (old, older):
        assert engine._take(now) is best  # type: ignore[comparison-overlap]
        assert engine.is_busy()
        assert best not in engine._idle
    engine._busy.clear()
    assert not engine.is_busy()
    # After a query the process waits for the next one; the one that waited longest goes.
    engine._idle = [other, plain]  # type: ignore[list-item]
    monkeypatch.setattr(engine, '_take', lambda _: old)
    assert engine.select(known.ref, 'SELECT', math.inf) == []
    assert engine._idle == [plain, old]
    assert [each.ended for each in (other, plain, old)] == [True, False, False]
    engine.forget()
    assert engine._idle == []
    assert plain.ended
    assert old.ended
    monkeypatch.undo()
    engine.close()
    with pytest.raises(DirectiveError, match='QUERY SPARQL: the server stops'):
        engine.select(known.ref, 'SELECT', math.inf)


@pytest.mark.parametrize(
    ('code', 'words'),
    [
        (1, 'the query process could not start; pyoxigraph is needed'),
        (3, 'the query needs too much memory'),
        (-11, 'the query nests too deeply'),
        (-9, 'the query needs too much memory'),
        (-6, 'the query needs too much memory'),
    ],
)
def test_why_a_process_ended_is_told(code: int, words: str) -> None:
    assert sparql._why_ended(code) == words
