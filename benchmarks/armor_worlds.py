"""What a durable visit costs: the journal, the World of owlready2 as the store, and both.

    python benchmarks/armor_worlds.py [--rounds N] [--places N]

A visit is three values that are replaced, as one batch, on the disk when it is answered for. The
journal appends and syncs a line. The World deletes and inserts quads and commits, in write-ahead
mode with a sync, in SQLite's pages of 4 KiB and in owlready2's of 32 KiB. They take turns in one
loop. Then the whole service carries the visit out in one list, with the World that it writes beside
its journal and without, in turn. Last, what a program that opens the World does to its writer.
"""

from __future__ import annotations

import random
import sqlite3
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import owlready2

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from armor_service.access import Settings
from armor_service.changes import AddAxiom, Change, RemoveAxiom
from armor_service.protocol import DirectiveRequest
from armor_service.service import ArmorService
from armor_service.store import Journal, Store, encode
from benchmarks.sizes import sized_parser
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, DataPropertyAssertion
from owl_reasoner.owl.expressions import Literal
from owl_reasoner.owl.vocabulary import XSD
from owl_reasoner.owlready.quads import OntologyWriter

ONTOLOGY = ROOT / 'surveillance_ontology' / 'surveillance_ontology' / 'data' / 'surveillance.owl'
IRI = 'http://bnc/exp-rob-lab/2022-23'


def value(name: str, number: int) -> DataPropertyAssertion:
    """Return a statement of a visit."""
    literal = Literal(str(number), XSD + 'long')
    return DataPropertyAssertion(f'{IRI}#visitedAt', f'{IRI}#{name}', literal)


def batch(number: int) -> list[tuple[Axiom, Axiom]]:
    """Return what goes and what comes with a visit."""
    return [(value(name, number), value(name, number + 1)) for name in ('C1', 'E', 'Robot1')]


class WorldStore:
    """A World that is committed with a sync at each visit."""

    def __init__(self, path: Path, places: int, page: int) -> None:
        connection = sqlite3.connect(path, check_same_thread=False, isolation_level='DEFERRED')
        connection.execute(f'PRAGMA page_size = {page}')
        connection.execute('PRAGMA journal_mode = WAL')
        connection.execute('PRAGMA synchronous = FULL')
        world = owlready2.World(filename='')
        world.set_backend(filename=':memory:', connection=connection, exclusive=False)
        self._world = world
        self._writer = OntologyWriter(world.get_ontology(f'{IRI}#'))
        for number in range(places):
            self._writer.add(ClassAssertion(f'{IRI}#ROOM', f'{IRI}#R{number}'))
            self._writer.add(value(f'R{number}', number))
        world.graph.commit()

    def __call__(self, number: int) -> None:
        for old, new in batch(number):
            self._writer.remove(old)
            self._writer.add(new)
        self._world.graph.commit()


def journal_store(folder: Path) -> Callable[[int], None]:
    """Return what appends a visit to a journal."""
    journal = Journal(folder)

    def visit(number: int) -> None:
        changes: list[Change] = []
        for old, new in batch(number):
            changes += [RemoveAxiom(old), AddAxiom(new)]
        journal.append([['change', 'map', [encode(change)]] for change in changes])

    return visit


def served(folder: Path, places: int, *, worlds: bool) -> Callable[[int], None]:
    """Return what carries a visit out through a durable service, with REASON, in one list."""
    settings = Settings(folder / 'files', worlds=worlds)
    service = ArmorService(settings, print, print, Store(folder / 'store'))

    def request(words: str, *args: str) -> DirectiveRequest:
        command, primary, secondary, *_ = (*words.split(), '', '', '')
        return DirectiveRequest('visitor', 'map', command, primary, secondary, args)

    load = request('LOAD FILE', str(ONTOLOGY), IRI, 'false', 'PELLET', 'true')
    assert service.execute(load).success
    built = [request('ADD IND CLASS', f'R{number}', 'ROOM') for number in range(places)]
    service.execute_list([*built, request('REASON')])
    if service.workspace.worlds:
        assert service.workspace.worlds.flush()

    def visit(number: int) -> None:
        rows = [
            request('SET DATAPROP IND', 'visitedAt', name, 'LONG', str(number))
            for name in ('C1', 'E', 'R1')
        ]
        service.execute_list([*rows, request('REASON'), request('QUERY IND CLASS', 'URGENT')])

    return visit


def taken(calls: dict[str, Callable[[int], None]], rounds: int) -> dict[str, list[float]]:
    """Return the milliseconds of each call, in random order in each round."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    names, shuffle = list(calls), random.Random(1).shuffle
    for number in range(rounds):
        shuffle(names)
        for name in names:
            begin = time.perf_counter()
            calls[name](number)
            times[name].append((time.perf_counter() - begin) * 1e3)
    return times


def beside(path: Path, **options: Any) -> str:
    """Return what happens to the writer of a World while a program has it open."""
    writer = sqlite3.connect(path, timeout=0.05, isolation_level=None)
    writer.execute('SELECT count(*) FROM objs').fetchall()
    try:
        world = owlready2.World(filename=str(path), **options)
    except sqlite3.OperationalError as error:
        return f'the program cannot open it: {error}'
    try:
        writer.execute('BEGIN IMMEDIATE')
        writer.execute('ROLLBACK')
    except sqlite3.OperationalError as error:
        return f'the writer waits until the program saves: {error}'
    finally:
        world.close()
        writer.close()
    return 'both go on'


def main() -> None:
    """Measure and print."""
    parser = sized_parser(__doc__)
    parser.add_argument('--rounds', type=int, default=300)
    parser.add_argument('--places', type=int, default=1000)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=ROOT) as name:
        folder = Path(name)
        size = options.size
        places = size.of(options.places, options.places, 20)
        rounds = size.of(options.rounds, options.rounds, 3)
        stores: dict[str, Callable[[int], None]] = {
            'journal': journal_store(folder / 'journal'),
            'World, pages of 4 KiB': WorldStore(folder / 'small.sqlite3', places, 4096),
            'World, pages of 32 KiB': WorldStore(folder / 'large.sqlite3', places, 32768),
        }
        services = {
            'service, journal': served(folder / 'a', places, worlds=False),
            'service, journal and World beside it': served(folder / 'b', places, worlds=True),
        }
        print(f'{"durable visit":40} median ms   95 %')
        for calls in (stores, services):
            for call, times in taken(calls, rounds).items():
                high = sorted(times)[int(len(times) * 0.95)]
                print(f'{call:40} {statistics.median(times):9.3f} {high:6.2f}')
        written = folder / 'b' / 'store' / 'worlds' / 'map.sqlite3'
        print('a program opens the World while its writer has it open:')
        for shown, chosen in (
            ('World(filename=f)', {}),
            ('exclusive=False', {'exclusive': False}),
            ('exclusive=False, read_only=True', {'exclusive': False, 'read_only': True}),
        ):
            print(f'  {shown:38} {beside(written, **chosen)}')


if __name__ == '__main__':
    main()
