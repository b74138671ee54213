"""How the reasoner takes ontologies that nobody here wrote.

    python benchmarks/conformance.py FOLDER [--quick] [--seconds 20] [--java]

FOLDER holds OWL 2 test cases of the W3C as JSON (a list of records with `name`, `kinds`, `premise`,
`conclusion` and `non_conclusion`, the documents as RDF/XML) and ontologies in any format that
`read_ontology` reads; subfolders too. Each is read and reasoned over in a process of its own.
One table tells what became of the cases, one what became of the ontologies. `named` are cases whose
answer is missing and whose axioms are reported in `unsupported`; `silent` ones are missing without
a word. With --java HermiT and Pellet (the copies that owlready2 brings) read the same ontologies,
and the subclasses and types that only one side finds are counted.
"""

from __future__ import annotations

import argparse
import json
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.sizes import Size, sized_parser
from libs.owl_reasoner.tests.java_reasoner import KINDS, JavaReasoner, JavaReasonerError, absent
from owl_reasoner import (
    KnowledgeBase,
    OntologyFileError,
    Unknown,
    read_ontology,
    write_ontology,
)
from owl_reasoner.owl.axioms import (
    Annotation,
    Axiom,
    Declaration,
    Import,
    SubClassOf,
)
from owl_reasoner.owl.entities import entities_of
from owl_reasoner.owl.vocabulary import NOTHING, THING
from owl_reasoner.reasoner.clauses import UnsupportedError

BASE = 'http://example.org/'
ENDINGS = ('.owl', '.rdf', '.ttl', '.ofn', '.owx', '.nt')
QUICK = 40


@dataclass
class Result:
    """What became of one document; `detail` says what is missing or went wrong."""

    name: str
    outcome: str
    detail: str = ''
    axioms: int = 0
    seconds: float = 0.0
    unsupported: int = 0


def follows(kb: KnowledgeBase, axiom: Axiom) -> bool | Unknown | None:
    """Tell whether an axiom follows; None where that cannot be asked for."""
    try:
        return kb.entails(axiom)
    except UnsupportedError:
        return None


def reasoned(source: bytes | Path) -> tuple[KnowledgeBase, bool, list[str], float]:
    """Return the document reasoned over: (knowledge, consistent, unsupported, seconds)."""
    document = read_ontology(source, BASE)
    kb = KnowledgeBase(document.iri or BASE, document.axioms)
    start = time.process_time()
    consistent = kb.reason()
    return (
        kb,
        consistent,
        [*document.unsupported, *kb.unsupported],
        time.process_time() - start,
    )


def judge_case(case: dict[str, Any]) -> list[Result]:
    """Return one result for the consistency and one for each entailment that a case tests."""
    name, kinds = case['name'], case['kinds']
    kb, consistent, unsupported, _ = reasoned(case['premise'].encode())
    missing = 'named' if unsupported else 'silent miss'
    results = []
    if 'InconsistencyTest' in kinds:
        results.append(Result(name, missing if consistent else 'right', 'no contradiction found'))
    elif not consistent:
        why = kb.explain_inconsistency()
        results.append(Result(name, 'false inconsistency', why.sentence() if why else ''))
    elif 'ConsistencyTest' in kinds:
        results.append(Result(name, 'right'))
    for kind, field in (
        ('PositiveEntailmentTest', 'conclusion'),
        ('NegativeEntailmentTest', 'non_conclusion'),
    ):
        if kind not in kinds or not consistent or not case.get(field):
            continue
        axioms = read_ontology(case[field].encode(), BASE).axioms
        stated = [a for a in axioms if not isinstance(a, Declaration | Annotation)]
        answers = [(axiom, follows(kb, axiom)) for axiom in stated]
        asked = [axiom for axiom, answer in answers if answer is not None]
        lacking = [axiom for axiom, answer in answers if answer is False]
        unknown = [answer for _, answer in answers if isinstance(answer, Unknown)]
        if kind == 'NegativeEntailmentTest':
            if stated and len(asked) == len(stated):
                left_open = 'named' if unknown else 'unsound'
                results.append(Result(name, 'right' if lacking else left_open, field))
        elif lacking:
            results.append(Result(name, missing, f'not derived: {lacking[0]}'))
        elif unknown:
            results.append(Result(name, 'named', str(unknown[0])))
        else:
            results.append(Result(name, 'right' if len(asked) == len(stated) else 'not asked'))
    return results


def work(path: Path, place: int) -> list[Result]:
    """Return the results of one case, or of one ontology where `place` is negative."""
    name = path.name
    try:
        if place >= 0:
            case = json.loads(path.read_text())[place]
            name = case['name']
            return judge_case(case)
        kb, consistent, unsupported, seconds = reasoned(path)
        outcome = 'loaded' if consistent else 'inconsistent'
        return [Result(name, outcome, '', len(kb), seconds, len(unsupported))]
    except OntologyFileError as error:
        return [Result(name, 'refused', error.message)]
    except Exception as error:
        return [Result(name, 'crash', f'{type(error).__name__}: {error}')]


def apart(path: Path, place: int, limit: int) -> list[Result]:
    """`work` in a process of its own, ended after `limit` seconds of processor time."""
    command = [sys.executable, __file__, str(path), '--one', str(place), '--seconds', str(limit)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == -signal.SIGXCPU:
        return [Result(f'{path.name} {place}', 'no answer', f'within {limit} s')]
    if done.returncode:
        return [Result(f'{path.name} {place}', 'crash', done.stderr.strip()[-200:])]
    return [Result(**record) for record in json.loads(done.stdout)]


def cases_in(folder: Path, most: int | None) -> Iterator[tuple[Path, int]]:
    """Yield every test case, spread evenly where there are more than `most`."""
    for path in sorted(folder.rglob('*.json')):
        records = json.loads(path.read_text())
        if isinstance(records, list) and all('premise' in record for record in records):
            step = 1 if most is None else max(1, len(records) // most)
            yield from ((path, place) for place in range(0, len(records), step))


def ontologies_in(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob('*') if path.suffix in ENDINGS)


def run_cases(places: list[tuple[Path, int]], limit: int) -> None:
    """Run the test cases and print what became of them."""
    counts: Counter[str] = Counter()
    wrong: list[Result] = []
    for path, place in places:
        for result in apart(path, place, limit):
            counts[result.outcome] += 1
            if result.outcome not in ('right', 'not asked', 'named'):
                wrong.append(result)
    print(f'{len(places)} test cases')
    for outcome in ('right', 'named', 'silent miss', 'false inconsistency', 'unsound'):
        print(f'  {outcome:20} {counts.pop(outcome, 0):5}')
    for outcome in ('crash', 'refused', 'no answer', 'not asked'):
        print(f'  {outcome:20} {counts.pop(outcome, 0):5}')
    for result in wrong:
        print(f'  {result.outcome}: {result.name}: {result.detail[:150]}')
    print()


def differences(kb: KnowledgeBase, reasoner: JavaReasoner) -> int:
    """Return how many subclasses and types are found here or there alone."""
    entities = {entity for axiom in kb.axioms() for entity in entities_of(axiom)}
    classes = {iri for kind, iri in entities if kind == 'class'} | {THING}
    individuals = {iri for kind, iri in entities if kind == 'individual' and iri[0] != '_'}
    above = {one: {one, THING, *kb.superclasses(one)} for one in classes}
    above[NOTHING] = classes
    count = 0
    for cls in classes - {NOTHING}:
        below = set(reasoner.ask('below', cls).split('\t')) & classes
        ours = {one for one in classes if cls in above[one]}
        members = set(reasoner.ask('members', cls).split('\t')) & individuals
        count += len((below ^ ours) - {cls}) + len(members ^ (kb.instances(cls) & individuals))
    return count


def verdicts(path: Path, java: list[str], limit: int) -> dict[str, str]:
    """Return what the Java reasoners say of an ontology, and in how many answers they differ."""
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / 'ontology.owl'
        try:
            kb, consistent, _, _ = reasoned(path)
            write_ontology((a for a in kb.axioms() if not isinstance(a, Import)), BASE, copy)
        except (ValueError, OSError) as error:
            return dict.fromkeys(java, str(error)[:40])
        for kind in java:
            with JavaReasoner(kind, timeout=limit) as reasoner:
                try:
                    found[kind] = reasoner.ask('load', str(copy))
                    if found[kind] == 'ok' and consistent:
                        found[kind] = f'{differences(kb, reasoner)} differ'
                except JavaReasonerError as error:
                    found[kind] = str(error)[:40]
    return found


def run_ontologies(paths: list[Path], limit: int, java: list[str]) -> None:
    if not paths:
        return
    head = f'{"ontology":26} {"axioms":>7} {"reason":>9} {"outcome":14} {"named":>6}'
    print(head + ''.join(f'  {kind}' for kind in java))
    for path in paths:
        (result,) = apart(path, -1, limit)
        line = f'{path.name:26} {result.axioms:7} {result.seconds:8.2f}s {result.outcome:14}'
        said = verdicts(path, java, limit) if java else {}
        line += f' {result.unsupported:6}' + ''.join(f'  {said[kind]}' for kind in java)
        print(line + (f'  {result.detail[:90]}' if result.detail else ''), flush=True)


def main() -> None:
    """Read the arguments and print the tables."""
    parser = sized_parser(__doc__, quick=f'about {QUICK} of the test cases')
    parser.add_argument(
        'folder', type=Path, nargs='?', help='where the ontologies and test cases are'
    )
    parser.add_argument(
        '--seconds', type=int, default=20, help='longest processor time for a document'
    )
    parser.add_argument('--java', action='store_true', help='HermiT and Pellet as judges')
    parser.add_argument('--one', type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one is not None:
        resource.setrlimit(resource.RLIMIT_CPU, (arguments.seconds, resource.RLIM_INFINITY))
        print(json.dumps([asdict(result) for result in work(arguments.folder, arguments.one)]))
        return
    if arguments.size is Size.SMOKE:
        with tempfile.TemporaryDirectory() as folder:
            write_example(Path(folder))
            judge_folder(Path(folder), None, arguments.seconds, [])
        return
    if arguments.folder is None or not arguments.folder.is_dir():
        parser.error(f'{arguments.folder or "FOLDER"} is not a folder')
    java: list[str] = []
    if arguments.java and not absent():
        java = list(KINDS)
    elif arguments.java:
        print(f'without Java reasoners: {absent()}')
    most = QUICK if arguments.size is Size.QUICK else None
    if not judge_folder(arguments.folder, most, arguments.seconds, java):
        parser.error(f'{arguments.folder} holds no test cases and no ontologies')


def judge_folder(folder: Path, most: int | None, limit: int, java: list[str]) -> bool:
    """Print both tables of a folder; tell whether it holds anything."""
    places, paths = list(cases_in(folder, most)), ontologies_in(folder)
    if places:
        run_cases(places, limit)
    run_ontologies(paths, limit, java)
    return bool(places or paths)


def write_example(folder: Path) -> None:
    """Write an ontology and a test case about it into a folder."""
    texts = []
    for axiom in (SubClassOf(f'{BASE}A', f'{BASE}B'), SubClassOf(f'{BASE}A', f'{BASE}C')):
        path = folder / 'example.owl'
        write_ontology([axiom], BASE, path)
        texts.append(path.read_text(encoding='utf-8'))
    case = {
        'name': 'example',
        'kinds': ['ConsistencyTest', 'PositiveEntailmentTest', 'NegativeEntailmentTest'],
        'premise': texts[0],
        'conclusion': texts[0],
        'non_conclusion': texts[1],
    }
    (folder / 'cases.json').write_text(json.dumps([case]), encoding='utf-8')


if __name__ == '__main__':
    main()
