"""Lists of different individuals: read as the general mapping reads them, and left to it if odd."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from armor_service.store import world_ontology
from armor_service.store.unique_names import ListWords, different_lists
from armor_service.store.world_ontology import AxiomsRead
from owl_reasoner.owl.axioms import AxiomAnnotation, DifferentIndividuals
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import OWL, RDF, RDFS

from .test_world_ontology import IRI, File

WORDS = ListWords(6, 32, 5, frozenset({33, 34}), 3, 4)
HEAD = [(-1, 6, 32), (-1, 33, -2)]
LINKS = [(-2, 3, 301), (-2, 4, -3), (-3, 3, 302), (-3, 4, 5)]


@pytest.fixture
def file(tmp_path: Path) -> File:
    return File(tmp_path)


def test_a_list_is_taken_out_whole() -> None:
    found, left = different_lists([*HEAD, (300, 310, 301)], LINKS, WORDS)
    assert found == [([301, 302], (-1, -2, -3))]
    assert left == [(300, 310, 301)]


@pytest.mark.parametrize(
    'more',
    [
        [(-1, 9, 'said of it', 60)],
        [(-4, 6, 32), (-4, 33, -2)],
        [(-4, 6, 32), (-4, 33, -3)],
        [(300, 310, -3)],
        [(-3, 310, 300)],
    ],
    ids=['annotated', 'list of two', 'end shared', 'node named', 'node says more'],
)
def test_what_takes_part_in_something_else_is_left(more: list[tuple[object, ...]]) -> None:
    quads = [*HEAD, *more]
    found, left = different_lists(quads, LINKS, WORDS)
    assert not found
    assert sorted(map(str, left)) == sorted(map(str, [*quads, *LINKS]))


@pytest.mark.parametrize(
    'links',
    [LINKS[:-1], [*LINKS[:-1], (-3, 4, -2)], [*LINKS, (-3, 3, 303)], [*LINKS[:1], (-2, 4, 5)]],
    ids=['no end', 'ring', 'two members of a node', 'one member'],
)
def test_no_list_is_left(links: list[tuple[int, int, int]]) -> None:
    found, left = different_lists(HEAD, links, WORDS)
    assert not found
    assert sorted(left) == sorted([*HEAD, *links])


def test_both_ways_of_reading_find_the_same(file: File, monkeypatch: pytest.MonkeyPatch) -> None:
    seed = random.randrange(2**32)
    print(f'seed {seed}')
    draw = random.Random(seed)
    names = [f'{IRI}#{number}' for number in range(30)] + ['_:a', '_:b']
    lists = [
        DifferentIndividuals(frozenset(draw.sample(names, draw.randrange(2, 9)))) for _ in range(12)
    ]
    said = tuple(
        AxiomAnnotation(one, ((RDFS + 'comment', Literal('why')),))
        for one in lists
        if draw.random() < 0.3
    )
    file.change(dict.fromkeys([*lists, *said]))
    numbers = [file.ontology._names.number(RDF + word) for word in ('first', 'rest')]
    if draw.random() < 0.7:  # Somebody else cuts a list, or ends one in another one.
        links = file.db.execute('SELECT s, o FROM objs WHERE p=?', (numbers[1],)).fetchall()
        (cut, _), (_, other) = draw.sample(links, 2)
        file.db.execute('UPDATE objs SET o=? WHERE s=? AND p=?', (other, cut, numbers[1]))
    fast = read(file)
    monkeypatch.setattr(
        world_ontology, 'different_lists', lambda quads, links, _: ([], [*quads, *links])
    )
    slow = read(file)
    assert set(fast.added) == set(slow.added)
    assert sorted(fast.problems) == sorted(slow.problems)


def read(file: File) -> AxiomsRead:
    """Read the file anew."""
    file.reopen()
    return file.ontology.read()


@pytest.mark.parametrize('times', [1, 2])
def test_a_list_goes_without_a_trace(file: File, times: int) -> None:
    file.change([DifferentIndividuals(frozenset(f'{IRI}#{number}' for number in range(9)))])
    if times == 2:  # Somebody else says the same once more.
        head = 'SELECT s FROM objs WHERE o=(SELECT storid FROM resources WHERE iri=?)'
        (node,) = file.db.execute(head, (OWL + 'AllDifferent',)).fetchone()
        rows = file.db.execute('SELECT c, s, p, o FROM objs WHERE s<=?', (node,)).fetchall()
        copies = [(c, s - 1000, p, o - 1000 if o < 0 else o) for c, s, p, o in rows]
        file.db.executemany('INSERT INTO objs VALUES (?, ?, ?, ?)', copies)
    (axiom,) = file.reopen()
    file.change(removed=[axiom])
    assert not file.reopen()
    assert not file.db.execute('SELECT * FROM objs WHERE s<0').fetchall()
