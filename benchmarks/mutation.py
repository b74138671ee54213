#!/usr/bin/env python3
"""Measure the strength of the tests: how many small faults in the core modules they notice.

    python3 benchmarks/mutation.py [PART ...] [--mutants 300] [--seed 1]

A mutant is a core module with one small fault: a comparison, a number, an operator, a condition
changed. Cosmic Ray makes them (`pip install cosmic-ray pytest-cov`). Each is tried by the tests
that reach its line, found by coverage; what they let pass is tried again by all tests of the files
that reach its module. A mutant that no test notices is a survivor: a missing assertion, or a change
that makes no difference.

A PART is a library, or a package of the robot: its modules without ROS, tried by the tests marked
`unit` alone. The mutants stand in a copy; the checkout is not touched. It takes about ten seconds a
mutant.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import random
import re
import resource
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tables import table

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT))

from launcher.environment import LIBRARIES

PACKAGES = (
    'surveillance_ontology',
    'surveillance_behaviour',
    'surveillance_controllers',
    'surveillance_perception',
    'surveillance_operator',
    'surveillance_runtime',
    'surveillance_simulation',
)
ROS = re.compile(r'^\s*(?:from|import) (?:rclpy|\w+_msgs|std_srvs|surveillance_interfaces)\b', re.M)
"""What a core module does not import."""
SKIPPED = ('ReplaceBinaryOperator_BitOr', 'NoOp')
"""Operators whose mutants are mostly type unions, which make no difference at run time."""
QUICK = 12
"""Mutants a part with `--quick`."""
GRACE = 20.0
"""Seconds of processor time that a mutant's tests may take beyond five times what they take without
it; ten times as many by the clock, since other programs may run."""


@dataclass(frozen=True)
class Mutant:
    """One small fault: which operator, applied at which of its places in which module."""

    module: Path
    """Path within the copy."""
    line: int
    operator: str
    occurrence: int


@dataclass(frozen=True)
class Reach:
    """Which tests reach which line of which module."""

    lines: Mapping[Path, Mapping[int, frozenset[str]]]
    seconds: Mapping[str, float]

    def of_line(self, module: Path, line: int) -> frozenset[str]:
        """Return the tests that run a line; for one that runs at import, those of the module."""
        lines = self.lines.get(module, {})
        return lines.get(line) or frozenset()

    def of_files(self, module: Path) -> frozenset[str]:
        """Return the test files that reach a module."""
        tests = self.lines.get(module, {}).values()
        return frozenset(test.split('::')[0] for each in tests for test in each)


def main(words: Sequence[str] | None = None) -> int:
    """Print the survivors as they come, then the table; return the exit code."""
    known = (*LIBRARIES, *PACKAGES)
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    parser.add_argument(
        'parts', nargs='*', metavar='PART', help=f'default: all of {", ".join(known)}'
    )
    parser.add_argument('--mutants', type=int, default=300, help='in all, shared by their places')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--quick', action='store_true', help=f'one library, {QUICK} mutants')
    given = parser.parse_args(words)
    for name in given.parts:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f'; did you mean {near[0]}?' if near else ''
            parser.error(f'PART {name}: expected one of {", ".join(known)}{hint}')
    try:
        import cosmic_ray.plugins  # noqa: F401
        import pytest_cov  # noqa: F401
    except ImportError as error:
        parser.error(f'{error.name} is missing: pip install cosmic-ray pytest-cov')
    parts = given.parts or (['state_machines'] if given.quick else list(known))
    generator = random.Random(given.seed)
    with tempfile.TemporaryDirectory() as folder:
        copies = {name: copy_of(name, Path(folder)) for name in parts}
        found = {name: groups_of(copies[name], name) for name in parts}
        total = sum(map(len, found.values()))
        wanted = QUICK * len(parts) if given.quick else given.mutants
        rows = [['part', 'places', 'mutants', 'killed', 'survived', 'not reached', 'killed, %']]
        sums = [0] * 5
        for name in parts:
            count = min(len(found[name]), max(1, round(wanted * len(found[name]) / total)))
            chosen = [generator.choice(each) for each in generator.sample(found[name], count)]
            results = tried(copies[name], name, chosen)
            figures = [len(found[name]), count, *results]
            sums = [a + b for a, b in zip(sums, figures, strict=True)]
            rows.append([name, *map(str, figures), f'{100 * results[0] / count:.0f}'])
    if len(parts) > 1:
        rows.append(['all', *map(str, sums), f'{100 * sums[2] / sums[1]:.0f}'])
    print(table(rows))
    return 0


def copy_of(name: str, folder: Path) -> Path:
    """Return a copy of what a part's tests need: the library, or the whole checkout."""
    inside = f'libs/{name}' if name in LIBRARIES else '.'
    listing = ['git', 'ls-files', '-co', '--exclude-standard', inside]
    done = subprocess.run(listing, cwd=CHECKOUT, capture_output=True, text=True, check=True)
    copy = folder / name
    for each in filter(None, done.stdout.split('\n')):
        if (CHECKOUT / each).is_file():
            target = copy / Path(each).relative_to(inside)
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((CHECKOUT / each).read_bytes())
    return copy


def groups_of(copy: Path, name: str) -> list[list[Mutant]]:
    """Return the places of a part that can be mutated, each with its mutants.

    One comparison has eight mutants and one condition one: chosen by place, both weigh the same.
    """
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator, operator_names

    operators = [(each, get_operator(each)) for each in operator_names()]
    plain = [
        (each, operator())
        for each, operator in operators
        if not operator.arguments() and not any(skipped in each for skipped in SKIPPED)
    ]
    groups: dict[tuple[Path, tuple[int, int], str], list[Mutant]] = defaultdict(list)
    for path in sorted((copy / name).rglob('*.py')):
        source = path.read_text(encoding='utf-8')
        if name not in LIBRARIES and ROS.search(source):
            continue
        module = path.relative_to(copy)
        kept_out = without_effect(ast.parse(source))
        nodes = list(ast_nodes(get_ast_from_path(path)))
        for operator_name, operator in plain:
            kind = operator_name.split('_')[0]
            places = (place for node in nodes for place in operator.mutation_positions(node))
            for occurrence, ((line, column), _) in enumerate(places):
                if line not in kept_out:
                    mutant = Mutant(module, line, operator_name, occurrence)
                    groups[module, (line, column), kind].append(mutant)
    return list(groups.values())


def without_effect(tree: ast.Module) -> set[int]:
    """Return the lines in which a change is none at run time: annotations and type checks."""
    lines: set[int] = set()
    for node in ast.walk(tree):
        for annotation in (getattr(node, 'annotation', None), getattr(node, 'returns', None)):
            # A default on the same line goes with it: few, and no loss to a sample.
            if isinstance(annotation, ast.expr):
                lines.update(range(annotation.lineno, (annotation.end_lineno or 0) + 1))
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith('TYPE_CHECKING'):
            lines.update(range(node.lineno, (node.end_lineno or 0) + 1))
    return lines


def tried(copy: Path, name: str, mutants: Iterable[Mutant]) -> tuple[int, int, int]:
    """Try mutants and print those that live; return how many were killed, survived, not reached."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    reach = reach_of(copy, name)
    killed = survived = unreached = 0
    for mutant in mutants:
        path = copy / mutant.module
        source = path.read_text(encoding='utf-8')
        changed = mutate_code(source, get_operator(mutant.operator)(), mutant.occurrence)
        tests = reach.of_line(mutant.module, mutant.line)
        path.write_text(changed or source, encoding='utf-8')
        try:
            if not tests:
                unreached += 1
            elif notices(copy, name, tests, reach) or notices(
                copy, name, reach.of_files(mutant.module), reach
            ):
                killed += 1
                continue
            else:
                survived += 1
        finally:
            path.write_text(source, encoding='utf-8')
        where = f'{mutant.module} ({"survived" if tests else "not reached"})'
        print(*difference(source, changed or source, where), sep='\n')
        print(f'{name}: {killed} killed, {survived} survived, {unreached} not reached', flush=True)
    return killed, survived, unreached


def difference(before: str, after: str, where: str) -> Iterator[str]:
    """Yield the lines that a mutant changes."""
    lines = difflib.unified_diff(before.split('\n'), after.split('\n'), where, n=0, lineterm='')
    yield from (line for line in lines if not line.startswith('+++'))


def reach_of(copy: Path, name: str) -> Reach:
    """Run all tests of a part once and return which lines each of them reaches."""
    from coverage import CoverageData

    options = [f'--cov={name}', '--cov-context=test', '--cov-report=', '--durations=0']
    done = pytest(copy, name, [*options, '--durations-min=0', '-n', '2'], 3600)
    if done is None or done.returncode not in (0, 1):
        output = '' if done is None else done.stdout[-2000:]
        sys.exit(f'{name}: its tests cannot be run:\n{output}')
    if done.returncode:
        failed = re.findall(r'^FAILED (\S+)', done.stdout, re.M)
        print(f'{name}: fail without a mutant and are left out: {", ".join(failed)}')
    else:
        failed = []
    data = CoverageData(copy / '.coverage')
    data.read()
    lines: dict[Path, dict[int, frozenset[str]]] = {}
    for file in data.measured_files():
        if not Path(file).is_relative_to(copy / name):
            continue
        by_line = {
            line: tests_of(contexts, failed)
            for line, contexts in data.contexts_by_lineno(file).items()
        }
        everything = frozenset().union(*by_line.values())
        # What runs at import has no test of its own: each that reaches the module may notice it.
        lines[Path(file).relative_to(copy)] = {
            line: tests or everything for line, tests in by_line.items()
        }
    seconds: dict[str, float] = defaultdict(float)
    for spent, test in re.findall(r'^([\d.]+)s \w+ +(\S.*)$', done.stdout, re.M):
        seconds[test] += float(spent)
    return Reach(lines, seconds)


def tests_of(contexts: Iterable[str], failed: Sequence[str]) -> frozenset[str]:
    """Return the tests of coverage's contexts; a fixture counts for each test of its file.

    A fixture of a module or of the session runs within the first test that asks for it.
    """
    tests = set()
    for context in contexts:
        test, _, phase = context.partition('|')
        if test and test not in failed:
            tests.add(test.split('::')[0] if phase == 'setup' else test)
    return frozenset(tests)


def notices(copy: Path, name: str, tests: Iterable[str], reach: Reach) -> bool:
    """Tell whether one of the tests fails, or they take five times as long."""
    ordered = sorted(tests, key=lambda test: (reach.seconds.get(test, 0.0), test))
    expected = sum(
        spent
        for test, spent in reach.seconds.items()
        if test in ordered or test.split('::')[0] in ordered
    )
    # Too many for a command line: pytest reads them from a file.
    listing = copy / '.tests'
    listing.write_text('\n'.join(ordered), encoding='utf-8')
    done = pytest(copy, name, ['-x', f'@{listing}'], GRACE + 5 * expected)
    return done is None or done.returncode != 0


def pytest(
    copy: Path, name: str, words: Sequence[str], seconds: float
) -> subprocess.CompletedProcess[str] | None:
    """Run pytest in a copy; return None if it hung: took `seconds` of a processor, or waited."""
    marks = 'not java and not long' if name in LIBRARIES else 'unit and not java and not long'
    command = [sys.executable, '-B', '-m', 'pytest', '-p', 'no:cacheprovider', '-m', marks, *words]
    limit = round(seconds)
    try:
        return subprocess.run(
            command,
            cwd=copy,
            capture_output=True,
            text=True,
            timeout=10 * seconds,
            check=False,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit)),
        )
    except subprocess.TimeoutExpired:
        return None


if __name__ == '__main__':
    sys.exit(main())
