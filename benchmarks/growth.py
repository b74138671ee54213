"""How the cost of reasoning grows with one thing at a time, HermiT beside it.

    python benchmarks/growth.py [--quick] [--seconds 60] [--java]

Each row is an ontology of a kind and a size, reasoned over for the first time in a process of its
own: the processor time here, and that of HermiT (the copy that owlready2 brings) with the start of
its JVM, for the classes and their members. `named` are sentences of what was left out. The second
table is a patrol's map with one more axiom: the first reasoning, and one after a change of `now`.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.patrol_facts import IRI, Patrol, schema
from benchmarks.sizes import sized_parser
from benchmarks.tables import table
from libs.owl_reasoner.tests.java_reasoner import JavaReasoner, JavaReasonerError, absent
from owl_reasoner import KnowledgeBase, ReasoningBudgetError, read_ontology, write_ontology
from owl_reasoner.owl import axioms as ax
from owl_reasoner.owl import expressions as ex
from owl_reasoner.owl.axioms import Axiom, ClassAssertion, ObjectPropertyAssertion, SubClassOf

BASE = 'http://example.org/growth#'


def named(kind: str, number: int | str = '') -> str:
    """Return the IRI of a numbered name."""
    return f'{BASE}{kind}{number}'


P = named('p')


def functional_values(n: int) -> Iterable[Axiom]:
    """Values of a functional property, all of which are the same."""
    yield ax.FunctionalObjectProperty(P)
    yield from (ObjectPropertyAssertion(P, named('a'), named('v', i)) for i in range(n))


def transitive_row(n: int) -> Iterable[Axiom]:
    """Links of a transitive property in a row."""
    yield ax.TransitiveObjectProperty(P)
    yield from (ObjectPropertyAssertion(P, named('v', i), named('v', i + 1)) for i in range(n))


def joined_unions(n: int) -> Iterable[Axiom]:
    """Unions in a row, both alternatives of which are below the next class."""
    for i in range(n):
        yield SubClassOf(named('A', i), ex.ObjectUnionOf((named('B', i), named('C', i))))
        yield from (SubClassOf(named(kind, i), named('A', i + 1)) for kind in 'BC')


def open_unions(n: int) -> Iterable[Axiom]:
    """Unions in a row, one alternative of which is below the next class."""
    for i in range(n):
        yield SubClassOf(named('A', i), ex.ObjectUnionOf((named('A', i + 1), named('B', i + 1))))


def functional_properties(n: int) -> Iterable[Axiom]:
    """Functional properties beside individuals of a union of classes."""
    yield SubClassOf(named('A'), ex.ObjectUnionOf((named('B'), named('C'))))
    for i in range(n):
        yield ax.FunctionalObjectProperty(named('p', i))
        yield ClassAssertion(named('A'), named('i', i))
        yield ObjectPropertyAssertion(named('p', i), named('i', i), named('i', (i + 1) % n))


def existentials(n: int) -> Iterable[Axiom]:
    """Classes of OWL 2 EL, each below another and with an existential of a third."""
    for i in range(n):
        some = ex.ObjectSomeValuesFrom(P, named('A', i * 7 % n))
        yield SubClassOf(named('A', i), ex.ObjectIntersectionOf((named('A', i // 2), some)))
        filler = ex.ObjectSomeValuesFrom(P, named('A', i))
        yield SubClassOf(filler, named('B', i % 50))


KINDS: dict[str, tuple[Callable[[int], Iterable[Axiom]], tuple[int, ...]]] = {
    'values of a functional property': (functional_values, (250, 500, 1000)),
    'links of a transitive property in a row': (transitive_row, (250, 500, 1000)),
    'unions in a row that meet again': (joined_unions, (100, 200, 400)),
    'unions in a row': (open_unions, (50, 100, 200)),
    'functional properties and individuals': (functional_properties, (100, 200, 400)),
    'classes with existentials (EL)': (existentials, (500, 1000, 2000)),
}
BESIDE_MAP = {
    'none': '',
    'DeadEnd = LOCATION and exactly 1 hasDoor': 'EquivalentClasses(:DeadEnd ObjectIntersectionOf('
    ':LOCATION ObjectExactCardinality(1 :hasDoor)))',
    'ROOM below Office or Lab or Kitchen': 'SubClassOf(:ROOM ObjectUnionOf(:Office :Lab :Kitchen)) '
    'DisjointClasses(:Office :Lab :Kitchen)',
    'Busy = not Free': 'EquivalentClasses(:Busy ObjectComplementOf(:Free))',
    'ROOM below inBuilding value B1 = Ours': 'SubClassOf(:ROOM ObjectHasValue(:inBuilding :B1)) '
    'EquivalentClasses(:Ours ObjectHasValue(:inBuilding :B1))',
}


def measure(kind: str, size: int, limit: float) -> tuple[str, str]:
    """Return the seconds of the first reasoning and how much is named, as text."""
    kb = KnowledgeBase(BASE, KINDS[kind][0](size))
    start = time.process_time()
    try:
        kb.reason(timeout=limit)
    except ReasoningBudgetError:
        return f'> {limit:g}', ''
    return f'{time.process_time() - start:.2f}', str(len(kb.unsupported))


def measure_java(kind: str, size: int, limit: float) -> str:
    """Return HermiT's seconds for the same ontology, as text."""
    with (
        tempfile.TemporaryDirectory() as folder,
        JavaReasoner('hermit', timeout=limit) as java,
    ):
        path = Path(folder) / 'growth.owl'
        write_ontology(KINDS[kind][0](size), BASE, path)
        try:
            java.ask('load', str(path))
            java.ask('below', named('A', 0))
            java.ask('members', named('A'))
            return f'{java.cpu_seconds():.2f}'
        except JavaReasonerError:
            return f'> {limit:g}'


def measure_map(name: str, places: int) -> tuple[str, str]:
    """Return the milliseconds of the first reasoning and of one after a change, as text."""
    text = f'Prefix(:=<{IRI}#>) Ontology(<{IRI}> {BESIDE_MAP[name]})'
    patrol = Patrol(places)
    more = read_ontology(text.encode(), IRI).axioms
    kb = KnowledgeBase(IRI, [*schema(), *patrol.assertions(), *more])
    seconds = []
    for _ in range(6):
        start = time.process_time()
        kb.reason()
        seconds.append(time.process_time() - start)
        gone, come, _ = patrol.step()
        kb.change([one for one in come if _is_clock(one)], [one for one in gone if _is_clock(one)])
    if kb.unsupported:
        raise SystemExit(f'{name}: {kb.unsupported[0]}')
    return f'{seconds[0] * 1e3:.1f}', f'{statistics.median(seconds[1:]) * 1e3:.2f}'


def _is_clock(axiom: Axiom) -> bool:
    return isinstance(axiom, ax.DataPropertyAssertion) and axiom.prop.endswith('#now')


def apart(*words: str) -> list[str]:
    """Return the figures of one row, measured in a process of its own."""
    done = subprocess.run([sys.executable, __file__, *words], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr.strip() or f'{words}: failed')
    found: list[str] = json.loads(done.stdout)
    return found


def main() -> None:
    """Read the arguments and print the tables."""
    parser = sized_parser(__doc__, quick='the smallest size of each kind')
    parser.add_argument('--seconds', type=float, default=60.0, help='longest time for a row')
    parser.add_argument('--java', action='store_true', help='HermiT beside it')
    parser.add_argument('--one', nargs=2, metavar=('KIND', 'SIZE'), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        kind, size = arguments.one[0], int(arguments.one[1])
        if kind in BESIDE_MAP:
            print(json.dumps(measure_map(kind, size)))
        else:
            print(json.dumps(measure(kind, size, arguments.seconds)))
        return
    java = arguments.java and not absent()
    rows = [['kind', 'size', 'here', 'HermiT', 'named']]
    part = arguments.size.of(None, None, 1)
    for kind, (_, sizes) in list(KINDS.items())[:part]:
        for size in arguments.size.of(sizes, sizes[:1], sizes[:1]):
            here, left_out = apart('--one', kind, str(size), '--seconds', str(arguments.seconds))
            beside = measure_java(kind, size, arguments.seconds) if java else '-'
            rows.append([kind, str(size), here, beside, left_out])
    print(f'Seconds of the first reasoning\n\n{table(rows)}\n')
    rows = [['axiom beside the map', 'places', 'first', 'change of now']]
    for name in list(BESIDE_MAP)[:part]:
        for places in arguments.size.of((50, 200), (50,), (50,)):
            rows.append([name, str(places), *apart('--one', name, str(places))])
    print(f'Milliseconds\n\n{table(rows)}')


if __name__ == '__main__':
    main()
