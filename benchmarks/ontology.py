"""How fast the ontology follows a patrol: loading, reasoning, one visit, queries, memory.

    python benchmarks/ontology.py [--quick] [--places 7 57 ...]

A generated map is a chain of corridors, each joined to the next by a door, with seven rooms on
each. A visit replaces `isIn`, `now` and the place's `visitedAt`, reasons, and asks what a decision
asks: what the robot can reach, which places are URGENT, which are CORRIDORs, where the robot is.
LOAD, the first REASON and a full recompute are processor time, the rest is measured by the clock.
Each size runs in a process of its own. Peers in the same run: the same reasoner recomputing
everything, and the Java reasoners that owlready2 brings, resident in a JVM.
`benchmarks/armor_calls.py` adds the directives inside the server and over ROS.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.patrol_facts import IRI, Patrol, named, schema
from benchmarks.sizes import Size, sized_parser
from benchmarks.tables import table
from libs.owl_reasoner.tests.java_reasoner import KINDS, JavaReasoner, JavaReasonerError, absent
from owl_reasoner.documents.reading import read_ontology
from owl_reasoner.documents.writing import write_ontology
from owl_reasoner.knowledge_base import KnowledgeBase

SIZES = (7, 57, 225, 1125, 10_000)
JAVA_VISITS = {7: 100, 57: 10}  # by places; beyond, a visit takes Java reasoners seconds
VISITS = 300


@dataclass
class Figures:
    """What one size took; times in seconds, memory in bytes."""

    places: int
    load: float
    first: float
    visit: float
    reason: float
    query: float
    full: float
    memory: int


def resident_bytes() -> int:
    return int(Path('/proc/self/statm').read_text().split()[1]) * resource.getpagesize()


def first_reason(kb: KnowledgeBase) -> float:
    """Return the seconds of the first reasoning."""
    start = time.process_time()
    kb.reason()
    return time.process_time() - start


def measure(places: int, visits: int) -> Figures:
    """Return all figures of one size, in this process."""
    patrol = Patrol(places)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'map.owl'
        write_ontology([*schema(), *patrol.assertions()], IRI, path)
        gc.collect()
        before = resident_bytes()
        start = time.process_time()
        kb = KnowledgeBase(IRI, read_ontology(path, IRI).axioms)
        load = time.process_time() - start
    first = first_reason(kb)
    if not kb.consistent or kb.unsupported:
        raise SystemExit(f'{places} places: the generated map does not suit the ontology')
    gc.collect()
    memory = resident_bytes() - before
    first = min(first, first_reason(kb.copy()), first_reason(kb.copy()))
    whole: list[float] = []
    reasoning: list[float] = []
    asking: list[float] = []
    for _ in range(visits):
        gone, come, _ = patrol.step()
        begin = time.perf_counter()
        for old, new in zip(gone, come, strict=True):
            kb.remove(old)
            kb.add(new)
        replaced = time.perf_counter()
        kb.reason()
        reasoned = time.perf_counter()
        reach = kb.object_values(named('canReach'), patrol.robot)
        urgent = kb.instances(named('URGENT'))
        corridors = kb.instances(named('CORRIDOR'))
        here = kb.object_values(named('isIn'), patrol.robot)
        end = time.perf_counter()
        whole.append(end - begin)
        reasoning.append(reasoned - replaced)
        asking.append(end - reasoned)
        if here != {patrol.place} or reach != set(patrol.beyond[patrol.place]):
            raise SystemExit(f'{places} places: wrong answer at {patrol.place}')
    due = {place for place, seen in patrol.visited.items() if patrol.now - seen > patrol.threshold}
    if urgent != due or corridors != {p for p, doors in patrol.doors.items() if len(doors) > 1}:
        raise SystemExit(f'{places} places: wrong classes')
    full = min(first_reason(kb.copy()) for _ in range(3))
    middle = statistics.median
    return Figures(
        places, load, first, middle(whole), middle(reasoning), middle(asking), full, memory
    )


def measure_apart(places: int, visits: int) -> Figures:
    """Return all figures of one size, in a process of its own."""
    command = [sys.executable, __file__, '--one', str(places), '--visits', str(visits)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr.strip() or f'{places} places: failed')
    return Figures(**json.loads(done.stdout))


def measure_java(kind: str, places: int, visits: int) -> tuple[float, float]:
    """Median seconds of REASON and of the decision's queries after a visit, in a resident JVM."""
    patrol = Patrol(places)
    with tempfile.TemporaryDirectory() as folder, JavaReasoner(kind) as java:
        path = Path(folder) / 'map.owl'
        write_ontology([*schema(), *patrol.assertions()], IRI, path)
        java.ask('load', str(path))
        reasoning: list[float] = []
        asking: list[float] = []
        for _ in range(visits):
            answer = java.ask('visit', *patrol.step()[2]).split()
            reasoning.append(int(answer[0]) / 1e9)
            asking.append(int(answer[1]) / 1e9)
    # The JVM compiles as it goes: the second half of the visits is what a long patrol sees.
    half = len(reasoning) // 2
    return statistics.median(reasoning[half:]), statistics.median(asking[half:])


# --- the table ---


def duration(value: float) -> str:
    """Return the seconds with three significant digits in a unit that suits."""
    for unit, scale in (('s', 1.0), ('ms', 1e-3), ('us', 1e-6)):
        if value >= scale or unit == 'us':
            return f'{value / scale:.3g} {unit}'
    raise AssertionError


def java_rows(figures: list[Figures], size: Size) -> list[list[str]]:
    """REASON and QUERY of the resident Java reasoners beside ours; absent ones named as absent."""
    rows: list[list[str]] = []
    ours = {entry.places: entry for entry in figures}
    missing = absent()
    for kind in KINDS:
        for places, visits in list(JAVA_VISITS.items())[: size.of(None, 1, 1)]:
            if places not in ours:
                continue
            title = f'resident {kind}, {places} places'
            if missing:
                rows.append([title, 'absent', '', missing])
                break
            try:
                reason, query = measure_java(kind, places, size.of(visits, 40, 4))
            except JavaReasonerError as error:
                rows.append([title, 'refuses', '', str(error).rpartition(': ')[2]])
                break
            ratio = (reason + query) / ours[places].visit
            rows.append([title, duration(reason), duration(query), f'{ratio:.0f} x ours'])
    return rows


def directive_rows(size: Size) -> list[list[str]]:
    """Directives inside the server and over ROS, as `benchmarks/armor_calls.py` measures them."""
    try:
        calls = importlib.import_module('benchmarks.armor_calls')
        return [[what, duration(ms / 1e3), beside] for what, ms, beside in calls.rows(size)]
    except (ImportError, OSError, RuntimeError, subprocess.SubprocessError) as error:
        return [['over ROS', 'absent', str(error).partition('\n')[0][-80:]]]


def main() -> int:
    parser = sized_parser(__doc__, quick='fewer visits, sizes and peers')
    parser.add_argument('--places', type=int, nargs='+', default=list(SIZES))
    parser.add_argument('--visits', type=int, default=0, help='visits per size')
    parser.add_argument('--one', type=int, help=argparse.SUPPRESS)
    options = parser.parse_args()
    visits = options.visits or options.size.of(VISITS, 100, 10)
    if options.one:
        print(json.dumps(asdict(measure(options.one, visits))))
        return 0
    chosen = options.size.of(options.places, options.places, [7])
    figures = [measure_apart(places, visits) for places in chosen]
    base = figures[0].visit
    rows = [
        [
            'places',
            'LOAD',
            'first REASON',
            'visit in all',
            'x smallest',
            'its REASON',
            'its QUERYs',
            'full recompute',
            'memory',
        ]
    ]
    for entry in figures:
        rows.append(
            [
                str(entry.places),
                duration(entry.load),
                duration(entry.first),
                duration(entry.visit),
                f'{entry.visit / base:.2f}',
                duration(entry.reason),
                duration(entry.query),
                duration(entry.full),
                f'{entry.memory / 1e6:.1f} MB',
            ]
        )
    print(table(rows))
    print()
    print(
        table(
            [
                ['peer, after a visit', 'REASON', 'QUERYs', 'in all'],
                *java_rows(figures, options.size),
            ]
        )
    )
    if options.size is not Size.SMOKE:  # there armor_calls.py runs by itself
        print()
        print(table([['directive, 7 places', 'median', 'beside'], *directive_rows(options.size)]))
    return 0


if __name__ == '__main__':
    sys.exit(main())
