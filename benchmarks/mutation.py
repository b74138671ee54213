#!/usr/bin/env python3
"""Measure the strength of the tests: how many small faults in the core modules they notice.

    python3 benchmarks/mutation.py [PART ...] [--mutants 300] [--seed 1]

A mutant is a core module with one small fault: a comparison, a number, an operator, a condition
changed. Cosmic Ray makes them (`pip install cosmic-ray coverage`). Each is tried by the tests that
reach its line, found by coverage; a mutant that none of them notices is a survivor: a missing
assertion, or a change that makes no difference.

A PART is a library, or a package of the robot: its modules without ROS, tried by the tests marked
`unit` alone, of the files that name the module. A process collects the tests once. A fault within a
function is put into a fork of it, which therefore costs its tests alone; a fault in what runs at
import costs the imports as well. Limits are in processor time, since the machine may be busy. No
file is changed. What needs an extra that is not installed (MuJoCo) counts as not reached.

`equivalent_mutants.toml` names changes that make no difference to a user, each with its reason;
they are left out. `--report FILE` keeps the survivors, `--again FILE` tries those alone.
"""

from __future__ import annotations

import ast
import contextlib
import difflib
import gc
import inspect
import json
import os
import pickle
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT))

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.sizes import sized_parser, skip
from benchmarks.tables import table
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
ROBOT = 'robot'
"""The packages of the robot share their tests, and one process that collects them."""
ROS = re.compile(r'^\s*(?:from|import) (?:rclpy|\w+_msgs|std_srvs|surveillance_interfaces)\b', re.M)
"""What a core module does not import."""
OWN_PROCESSES = ('launcher', 'mission', 'examples')
"""Folders of the robot's tests that mostly start processes."""
LOGGED = re.compile(r'\b(?:log|logger|get_logger\(\))\.(?:debug|info|warn|warning|error|fatal)$')
SKIPPED = ('BinaryOperator_BitOr', 'NoOp', 'Eq_Is', 'NotEq_IsNot', 'Is_Eq', 'IsNot_NotEq')
"""Operators whose mutants mostly make no difference: type unions, and identity for equality, which
is the same for None, enumerations and small numbers."""
QUICK = 12
"""Mutants a part with `--quick`."""
GRACE = 6.0
"""Seconds of processor time that a test may take beyond five times what it takes otherwise."""
ENOUGH = 150.0
"""Seconds of tests that one mutant is tried by, the cheap first; as measured with coverage, which
takes several times as long: the tests of most libraries are within it."""
FAR = 3.0
"""A test whose file does not name the module is tried as late as one that costs so many times as
much."""
IDLE = 15.0
"""Seconds without any use of a processor after which tests have noticed a fault: they wait."""
AT_ONCE = 4
"""Mutants that are tried at the same time."""
NOT_IN_PLACE = 99
"""Exit code of a process that could not put a fault in place."""
COMPREHENSIONS = ('<listcomp>', '<setcomp>', '<dictcomp>', '<genexpr>')
EQUIVALENT = Path(__file__).with_name('equivalent_mutants.toml')


@dataclass(frozen=True)
class Mutant:
    """One small fault: which operator, applied at which of its places in which module."""

    part: str
    module: str
    """Path within the checkout."""
    line: int
    operator: str
    occurrence: int

    @property
    def path(self) -> Path:
        """Return the module's file."""
        return CHECKOUT / self.module

    def sources(self) -> tuple[str, str]:
        """Return the module without and with the fault."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        source = self.path.read_text(encoding='utf-8')
        return source, mutate_code(source, get_operator(self.operator)(), self.occurrence) or source

    def is_python(self) -> bool:
        """Tell whether Python reads it; Cosmic Ray takes the star of a signature for a product."""
        try:
            ast.parse(self.sources()[1])
        except SyntaxError:
            return False
        return True

    def difference(self) -> tuple[str, str]:
        """Return the lines that change, before and after."""
        old, new = (each.splitlines() for each in self.sources())
        lines = list(difflib.ndiff(old, new))
        before, after = (
            ' '.join(line[2:].strip() for line in lines if line.startswith(sign)) for sign in '-+'
        )
        return before, after


@dataclass
class Reach:
    """Which tests reach which line of which module, and what each of them costs."""

    lines: dict[str, dict[int, list[str]]] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    failing: list[str] = field(default_factory=list)

    def add(self, other: Reach) -> None:
        """Take in what other tests reach."""
        for module, lines in other.lines.items():
            known = self.lines.setdefault(module, {})
            for line, tests in lines.items():
                known.setdefault(line, []).extend(tests)
        self.seconds |= other.seconds
        self.failing += other.failing

    def tests(self, module: str, lines: Iterable[int] | None = None) -> set[str]:
        """Return the tests that run one of the lines of a module, or any of them."""
        of_module = self.lines.get(module, {})
        chosen = of_module if lines is None else lines
        return {test for line in chosen for test in of_module.get(line, ())}

    def ordered(self, tests: Iterable[str], module: str) -> list[str]:
        """Return tests in their order: the cheap and those whose file names the module first."""
        name = re.compile(rf'\b{Path(module).stem}\b')
        near = {file: bool(name.search(text)) for file, text in self.texts(module)}

        def rank(test: str) -> tuple[float, str]:
            weight = 1.0 if near.get(test.split('::')[0]) else FAR
            return weight * self.seconds[test], test

        chosen, spent = [], 0.0
        for test in sorted(tests, key=rank):
            spent += self.seconds[test]
            if chosen and spent > ENOUGH:
                break
            chosen.append(test)
        return chosen

    def texts(self, module: str) -> Iterator[tuple[str, str]]:
        """Yield the test files, as tests name them, with their texts."""
        folder = root_of(module)
        for file in {test.split('::')[0] for test in self.seconds}:
            yield file, (folder / file).read_text(encoding='utf-8')

    def naming(self, module: str) -> set[str]:
        """Return the tests of the files that import a module."""
        name = re.compile(rf'\b{Path(module).stem} import\b')
        files = {file for file, text in self.texts(module) if name.search(text)}
        return {test for test in self.seconds if test.split('::')[0] in files}


def root_of(module: str) -> Path:
    """Return the folder from which the tests of a module are run."""
    parts = Path(module).parts
    return CHECKOUT / 'libs' / parts[1] if parts[0] == 'libs' else CHECKOUT


def main(words: Sequence[str] | None = None) -> int:
    """Print the survivors as they come, then the table; return the exit code."""
    known = (*LIBRARIES, *PACKAGES)
    parser = sized_parser(__doc__, quick=f'one library, {QUICK} mutants')
    parser.add_argument(
        'parts', nargs='*', metavar='PART', help=f'default: all of {", ".join(known)}'
    )
    parser.add_argument('--mutants', type=int, default=300, help='in all, shared by their places')
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--report', type=Path, metavar='FILE', help='keep the survivors as JSON')
    parser.add_argument('--again', type=Path, metavar='FILE', help='try those of a report alone')
    given = parser.parse_args(words)
    for name in given.parts:
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            hint = f'; did you mean {near[0]}?' if near else ''
            parser.error(f'PART {name}: expected one of {", ".join(known)}{hint}')
    try:
        import cosmic_ray  # noqa: F401
        import coverage  # noqa: F401
    except ImportError as error:
        skip(f'{error.name} is missing: pip install cosmic-ray coverage')
    few = ['state_machines']
    parts = given.parts or given.size.of(list(known), few, few)
    groups = {name: groups_of(name) for name in parts}
    places = sum(map(len, groups.values()))
    chosen: list[Mutant] = []
    left_out: dict[str, int] = defaultdict(int)
    known_equal = equivalent()
    for name in parts:
        generator = random.Random(f'{given.seed} {name}')
        wanted = given.size.of(round(given.mutants * len(groups[name]) / places), QUICK, 1)
        count = min(len(groups[name]), max(1, wanted))
        for mutant in (generator.choice(each) for each in generator.sample(groups[name], count)):
            if not mutant.is_python():
                continue
            if (mutant.module, *mutant.difference()) in known_equal:
                left_out[name] += 1
            else:
                chosen.append(mutant)
    if given.again is not None:
        try:
            kept = {tuple(each) for each in json.loads(given.again.read_text(encoding='utf-8'))}
        except (OSError, ValueError) as error:
            parser.error(f'--again {given.again}: {error}')
        flat = (each for name in parts for group in groups[name] for each in group)
        # To make a mutant takes milliseconds: only those of the lines in the report are made.
        reported: dict[str, set[int]] = defaultdict(set)
        for module, before, _ in kept:
            path = CHECKOUT / module
            lines = path.read_text(encoding='utf-8').splitlines() if path.is_file() else []
            reported[module] |= {n for n, line in enumerate(lines, 1) if line.strip() in before}
        near_ones = [each for each in flat if each.line in reported.get(each.module, ())]
        kept -= known_equal
        chosen, left_out = [], defaultdict(int)
        for each in near_ones:
            if (difference := (each.module, *each.difference())) in kept:
                kept.discard(difference)
                chosen.append(each)
    results = run(chosen)
    rows = [
        ['part', 'places', 'mutants', 'killed', 'survived', 'not reached', 'equal', 'killed, %']
    ]
    sums = [0] * 6
    for name in parts:
        found = [results[each] for each in chosen if each.part == name]
        figures = [found.count(each) for each in ('killed', 'survived', 'not reached')]
        figures = [len(groups[name]), len(found), *figures, left_out[name]]
        sums = [a + b for a, b in zip(sums, figures, strict=True)]
        rows.append([name, *map(str, figures), f'{100 * figures[2] / max(1, len(found)):.0f}'])
    if len(parts) > 1:
        rows.append(['all', *map(str, sums), f'{100 * sums[2] / max(1, sums[1]):.0f}'])
    print(table(rows))
    if given.report is not None:
        alive = [[each.module, *each.difference()] for each in chosen if results[each] != 'killed']
        given.report.write_text(json.dumps(alive, indent=1), encoding='utf-8')
    return 0


def equivalent() -> set[tuple[str, str, str]]:
    """Return the changes that make no difference: module, lines before, lines after."""
    data = tomllib.loads(EQUIVALENT.read_text(encoding='utf-8'))
    return {(each['module'], each['before'], each['after']) for each in data.get('mutant', [])}


def groups_of(name: str) -> list[list[Mutant]]:
    """Return the places of a part that can be mutated, each with its mutants.

    One comparison has eight mutants and one condition one: chosen by place, both weigh the same.
    """
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator, operator_names

    operators = [(each, get_operator(each)) for each in operator_names()]
    plain = [
        (each, operator())
        for each, operator in operators
        if not operator.arguments() and not each.endswith(SKIPPED) and 'BitOr_' not in each
    ]
    folder = CHECKOUT / ('libs' if name in LIBRARIES else '.') / name / name
    groups: dict[tuple[str, tuple[int, int], str], list[Mutant]] = defaultdict(list)
    for path in sorted(folder.rglob('*.py')):
        source = path.read_text(encoding='utf-8')
        if 'ros' in path.parts or ROS.search(source):
            continue
        module = str(path.relative_to(CHECKOUT))
        kept_out, checks = without_effect(tree := ast.parse(source)), own_checks(tree)
        nodes = list(ast_nodes(get_ast_from_path(path)))
        for operator_name, operator in plain:
            kind = operator_name.split('_')[0]
            places = (place for node in nodes for place in operator.mutation_positions(node))
            for occurrence, ((line, column), _) in enumerate(places):
                if line not in kept_out and (line, column) not in checks:
                    mutant = Mutant(name, module, line, operator_name, occurrence)
                    groups[module, (line, column), kind].append(mutant)
    return list(groups.values())


def without_effect(tree: ast.Module) -> set[int]:
    """Return the lines whose change no user notices: annotations, type checks, texts of a log.

    So do decorators of records (`frozen` keeps programmers from a mistake), constants of the module
    beyond 10 (a bound or a tuned number that changes by a tenth), and what a module does as a
    program of its own. An exception's dotted name (`except cv2.error`) counts too: Cosmic Ray makes
    no Python of it.
    """
    lines: set[int] = set()

    def leave_out(node: ast.AST) -> None:
        first = getattr(node, 'lineno', 0)
        lines.update(range(first, (getattr(node, 'end_lineno', None) or first) + 1))

    for node in ast.walk(tree):
        for annotation in (getattr(node, 'annotation', None), getattr(node, 'returns', None)):
            # A default on the same line goes with it: few, and no loss to a sample.
            if isinstance(annotation, ast.expr):
                leave_out(annotation)
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith('TYPE_CHECKING'):
            leave_out(node)
        if isinstance(node, ast.FunctionDef) and node.name == '__repr__':
            leave_out(node)
        if isinstance(node, ast.If) and '__name__' in ast.unparse(node.test):
            leave_out(node)
        if isinstance(node, ast.ClassDef):
            for decorator in node.decorator_list:
                leave_out(decorator)
        if isinstance(node, ast.Call) and LOGGED.search(ast.unparse(node.func)):
            leave_out(node)
        if isinstance(node, ast.ExceptHandler) and isinstance(node.type, ast.Attribute):
            leave_out(node.type)
    for node in tree.body:
        value = getattr(getattr(node, 'value', None), 'value', None)
        if isinstance(value, int | float) and abs(value) >= 10:
            leave_out(node)
    return lines


def own_checks(tree: ast.Module) -> set[tuple[int, int]]:
    """Return where `strict=True` and `frozen=True` have their values.

    By those a module has Python check what it knows to hold.
    """
    return {
        (keyword.value.lineno, keyword.value.col_offset)
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg in ('strict', 'frozen')
    }


def run(mutants: Sequence[Mutant]) -> dict[Mutant, str]:
    """Try mutants and print those that live; return what became of each."""
    results: dict[Mutant, str] = {}
    by_root: dict[Path, list[Mutant]] = defaultdict(list)
    for each in mutants:
        by_root[root_of(each.module)].append(each)
    for root, own in by_root.items():
        begun = time.monotonic()
        ((reach, tried),) = in_forks([lambda root=root, own=own: collected(root, own)])
        trials = Trials()
        for mutant in own:
            if mutant not in tried:
                try_at_import(mutant, root, reach, trials)
        trials.finish()
        results |= tried | trials.results
        print(f'{root.name}: {len(own)} mutants in {time.monotonic() - begun:.0f} s', flush=True)
    return results


def in_forks(calls: Sequence[Any]) -> list[Any]:
    """Return what each of some calls returns in a process of its own, all at the same time."""
    begun: list[tuple[int, int]] = []
    for call in calls:
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            code = 1
            try:
                os.close(reading)
                with os.fdopen(writing, 'wb') as pipe:
                    pickle.dump(call(), pipe)
                code = 0
            finally:
                sys.stdout.flush()
                os._exit(code)
        os.close(writing)
        begun.append((child, reading))
    returned = []
    for child, reading in begun:
        with os.fdopen(reading, 'rb') as pipe:
            data = pipe.read()
        os.waitpid(child, 0)
        if not data:
            sys.exit('the tests cannot be run: see above')
        returned.append(pickle.loads(data))
    return returned


def options(root: Path, scratch: str) -> list[str]:
    """Return the words for pytest that all processes share."""
    marks = 'not java and not long' + (' and unit' if root == CHECKOUT else '')
    plugins = ['-p', 'no:cacheprovider', '-p', 'no:xdist', '-p', 'no:anyio', '-p', 'no:cov']
    return [*plugins, '-m', marks, f'--basetemp={scratch}/base', '-qq']


def collected(root: Path, mutants: Sequence[Mutant]) -> tuple[Reach, dict[Mutant, str]]:
    """Collect the tests of a folder and try the mutants within functions in forks.

    Returns:
        What the tests reach, and what became of each mutant; those that run at import are left out.
    """
    os.chdir(root)
    with tempfile.TemporaryDirectory() as scratch:
        server = Server(root, mutants)
        pytest.main([*options(root, scratch), *test_files(root, mutants)], plugins=[server])
    return server.reach, server.trials.results


def test_files(root: Path, mutants: Sequence[Mutant]) -> list[str]:
    """Return the test files to collect: of the robot's those that name a mutant's module.

    What a file takes from the helpers beside it counts as its own, and `test_<module>.py` names its
    module. A module that none names is tried by the files that name one that imports it, or else
    its folder, or its package. Tests in processes of their own meet no fault.
    """
    if root != CHECKOUT:
        return []
    texts: dict[str, str] = {}
    for path in sorted((root / 'tests').rglob('test_*.py')):
        if path.parent.name in OWN_PROCESSES:
            continue
        text = path.read_text(encoding='utf-8')
        for helper in path.parent.glob('*.py'):
            if re.search(rf'\b{helper.stem} import\b', text):
                text += helper.read_text(encoding='utf-8')
        texts[str(path.relative_to(root))] = text

    def naming(name: Sequence[str]) -> set[str]:
        near = re.compile(rf'\b{".".join(name[:-1])}(?:\.| import (?:.*, )?){name[-1]}\b')
        own = f'test_{name[-1]}'
        return {f for f, text in texts.items() if near.search(text) or Path(f).stem == own}

    chosen: set[str] = set()
    for module in {each.module for each in mutants}:
        name = Path(module).with_suffix('').parts[1:]
        found = naming(name)
        if not found:
            imports = re.compile(rf'\b{".".join(name)} import\b')
            for path in (root / Path(module).parts[0]).rglob('*.py'):
                if imports.search(path.read_text(encoding='utf-8')):
                    found |= naming(path.relative_to(root).with_suffix('').parts[1:])
        while len(name) > 1 and not found:
            name = name[:-1]
            found = naming(name)
        chosen |= found
    return sorted(chosen)


class Server:
    """A pytest plugin that tries mutants where pytest would run the tests."""

    def __init__(self, root: Path, mutants: Sequence[Mutant]) -> None:
        self.root = root
        self.mutants = mutants
        self.reach = Reach()
        self.trials = Trials()
        self.items: dict[str, pytest.Item] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Find what the tests reach, then try each mutant in a fork."""
        # Else each fork copies what the collector of garbage writes into all objects.
        gc.freeze()
        self.items = {item.nodeid: item for item in session.items}
        by_file: dict[str, list[str]] = defaultdict(list)
        for name in self.items:
            by_file[name.split('::')[0]].append(name)
        shares: list[list[str]] = [[] for _ in range(AT_ONCE)]
        for names in sorted(by_file.values(), key=len, reverse=True):
            min(shares, key=len).extend(names)
        for each in in_forks([lambda s=share: self._reach(s) for share in shares]):
            self.reach.add(each)
        if self.reach.failing:
            print('fail without a fault, left out:', ', '.join(self.reach.failing), flush=True)
        for mutant in self.mutants:
            codes = changed_functions(mutant)
            tests = self.reach.tests(mutant.module, [mutant.line])
            if codes is None or (not tests and run_at_import(mutant, codes)):
                continue
            for (_, first), code in () if tests else codes.items():
                last = max(line for *_, line in code.co_lines() if line is not None)
                tests |= self.reach.tests(mutant.module, range(first + 1, last + 1))
            if tests:
                self.trials.start(mutant, lambda m=mutant, c=codes, t=tests: self._try(m, c, t))
            else:
                self.trials.settle(mutant, 'not reached')
        self.trials.finish()
        return True

    def _reach(self, names: Sequence[str]) -> Reach:
        """Run each of some tests once and return which lines it reaches."""
        from coverage import Coverage

        reach = Reach()
        # Only the modules that have a mutant: the rest runs at its own speed.
        modules = sorted({str(each.path) for each in self.mutants})
        measured = Coverage(data_file=None, include=modules, config_file=False, messages=False)
        measured.set_option('run:disable_warnings', ['no-data-collected'])
        measured.start()
        own_folder = self._own_folder()
        for name in names:
            measured.switch_context(name)
            begun = cpu_seconds()
            passed = run_item(self.items[name], None)
            if passed:
                reach.seconds[name] = cpu_seconds() - begun
            else:
                reach.failing.append(name)
        measured.stop()
        shutil.rmtree(own_folder, ignore_errors=True)
        data = measured.get_data()
        for file in data.measured_files():
            module = str(Path(file).resolve().relative_to(CHECKOUT))
            reach.lines[module] = {
                line: [test for test in tests if test in reach.seconds]
                for line, tests in data.contexts_by_lineno(file).items()
            }
        return reach

    def _try(
        self, mutant: Mutant, codes: Mapping[tuple[str, int], CodeType], tests: set[str]
    ) -> bool:
        """Put a fault into this process and tell whether no test notices it."""
        gc.unfreeze()
        replaced = 0
        for each in gc.get_objects():
            if isinstance(each, FunctionType):
                code = each.__code__
                new = codes.get((code.co_qualname, code.co_firstlineno))
                if new is not None and Path(code.co_filename).resolve() == mutant.path:
                    each.__code__ = new
                    replaced += 1
        if not replaced:
            raise LookupError(mutant)
        own_folder = self._own_folder()
        try:
            return self._all_pass(mutant, tests)
        finally:
            shutil.rmtree(own_folder, ignore_errors=True)

    def _own_folder(self) -> Path:
        """Return a new folder for what the tests of this fork write."""
        folder = Path(tempfile.mkdtemp())
        config = next(iter(self.items.values())).config
        config._tmp_path_factory._given_basetemp = folder / 'base'  # type: ignore[attr-defined]
        config._tmp_path_factory._basetemp = None  # type: ignore[attr-defined]
        return folder

    def _all_pass(self, mutant: Mutant, tests: set[str]) -> bool:
        """Tell whether the tests pass, up to the first that does not."""
        ordered = self.reach.ordered(tests, mutant.module)
        for name, following in zip(ordered, [*ordered[1:], None], strict=True):
            limit(self.reach.seconds[name])
            if not run_item(self.items[name], self.items[following] if following else None):
                return False
        return True


def run_item(item: pytest.Item, following: pytest.Item | None) -> bool:
    """Run one test and tell whether it passes."""
    from _pytest.runner import runtestprotocol

    # As pytest does for a test that is run again.
    if hasattr(item, '_request') and not item._request:
        item._initrequest()  # type: ignore[attr-defined]
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    return not any(each.failed for each in runtestprotocol(item, log=False, nextitem=following))


def cpu_seconds() -> float:
    """Return the processor time of this process and of the children that have ended."""
    return time.process_time() + sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def limit(seconds: float) -> None:
    """End this process when it takes much more of the processor than a test does."""
    end = round(time.process_time() + GRACE + 5 * seconds)
    resource.setrlimit(resource.RLIMIT_CPU, (end, resource.RLIM_INFINITY))


class Trials:
    """Mutants that are tried at the same time, each in a fork, since some tests only wait.

    Attributes:
        results: What became of each mutant.
    """

    def __init__(self) -> None:
        self.results: dict[Mutant, str] = {}
        self._running: dict[int, tuple[Mutant, float, float]] = {}

    def settle(self, mutant: Mutant, result: str) -> None:
        """Keep a result, and print a mutant that lives."""
        self.results[mutant] = result
        if result != 'killed':
            before, after = mutant.difference()
            print(f'{mutant.module}:{mutant.line} {result}\n  - {before}\n  + {after}', flush=True)

    def start(self, mutant: Mutant, call: Any) -> None:
        """Try a mutant by a call in a fork: True if no test notices it."""
        while len(self._running) >= AT_ONCE:
            self._look()
        child = os.fork()
        if not child:
            code = 1
            try:
                os.setpgid(0, 0)
                with open(os.devnull, 'w') as nowhere:
                    os.dup2(nowhere.fileno(), 1)
                    os.dup2(nowhere.fileno(), 2)
                resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
                code = 0 if call() is True else 1
            except LookupError:
                code = NOT_IN_PLACE
            finally:
                os._exit(code)
        self._running[child] = (mutant, 0.0, time.monotonic())

    def finish(self) -> None:
        """Wait until all have ended."""
        while self._running:
            self._look()

    def _look(self) -> None:
        """Take those that have ended, and end those that wait for ever."""
        time.sleep(0.01)
        for child, (mutant, used, since) in list(self._running.items()):
            now_used, now = used_by(child), time.monotonic()
            if now_used != used:
                self._running[child] = (mutant, now_used, now)
            ended, status = os.waitpid(child, os.WNOHANG)
            idle = not ended and now_used == used and now > since + IDLE
            if idle and wants_processor(child):
                # On a busy machine it waits for its turn.
                self._running[child] = (mutant, now_used, now)
                idle = False
            if not ended and not idle:
                continue
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child, signal.SIGKILL)
            if idle:
                os.waitpid(child, 0)
            elif os.WIFEXITED(status) and os.WEXITSTATUS(status) == NOT_IN_PLACE:
                raise LookupError(f'{mutant}: the tests that reach it have not imported it')
            del self._running[child]
            self.settle(mutant, 'killed' if idle or status else 'survived')


def used_by(process: int) -> float:
    """Return the processor time of a process and of its children that have ended, in ticks."""
    try:
        text = Path(f'/proc/{process}/stat').read_text(encoding='utf-8')
    except OSError:
        return 0.0
    return sum(map(float, text.rpartition(')')[2].split()[11:15]))


def wants_processor(group: int) -> bool:
    """Tell whether a thread of a group of processes could run if there was a processor for it."""
    for path in Path('/proc').glob('[0-9]*/task/[0-9]*/stat'):
        try:
            state, _, of_group = path.read_text(encoding='utf-8').rpartition(')')[2].split()[:3]
        except OSError:
            continue
        if int(of_group) == group and state in 'RD':
            return True
    return False


def changed_functions(mutant: Mutant) -> dict[tuple[str, int], CodeType] | None:
    """Return the functions that a fault changes, by name and line; None if it runs at import."""
    source, changed = mutant.sources()
    codes: dict[tuple[str, int], CodeType] = {}

    def compare(old: CodeType, new: CodeType, at_import: bool) -> bool:
        # A comprehension of the module is done at import, too.
        function = not at_import or (
            bool(old.co_flags & inspect.CO_NEWLOCALS) and old.co_name not in COMPREHENSIONS
        )
        if not function and own(old) != own(new):
            return False
        inner_old, inner_new = (
            [each for each in code.co_consts if isinstance(each, CodeType)] for code in (old, new)
        )
        if function:
            if own(old) != own(new) or inner_old != inner_new:
                codes[old.co_qualname, old.co_firstlineno] = new
            if old.co_freevars != new.co_freevars or len(inner_old) != len(inner_new):
                return False
        return len(inner_old) == len(inner_new) and all(
            compare(a, b, not function) for a, b in zip(inner_old, inner_new, strict=True)
        )

    top, top_changed = (compile(each, str(mutant.path), 'exec') for each in (source, changed))
    return codes if compare(top, top_changed, True) else None


def run_at_import(mutant: Mutant, codes: Iterable[tuple[str, int]]) -> bool:
    """Tell whether the module names a function that a fault changes in what runs at import.

    A fault in a function that only makes tables of the module is noticed by a new import alone.
    """
    tree = ast.parse(mutant.sources()[0])
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    pending: list[ast.stmt] = [node for node in tree.body if node not in functions.values()]
    named: set[str] = set()
    while pending:
        for node in ast.walk(pending.pop()):
            if isinstance(node, ast.Name) and node.id in functions and node.id not in named:
                named.add(node.id)
                pending.append(functions[node.id])
    return any(name in named for name, _ in codes)


def own(code: CodeType) -> tuple[object, ...]:
    """Return what a code object is without the functions in it."""
    constants = [repr(each) for each in code.co_consts if not isinstance(each, CodeType)]
    names = (code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars)
    return code.co_code, constants, names, code.co_qualname


def try_at_import(mutant: Mutant, root: Path, reach: Reach, trials: Trials) -> None:
    """Try a fault in what runs at import, in a process that imports the package anew."""
    tests = reach.tests(mutant.module) | reach.naming(mutant.module)
    if not tests:
        trials.settle(mutant, 'not reached')
        return
    ordered = reach.ordered(tests, mutant.module)
    _, changed = mutant.sources()

    def attempt() -> bool:
        plain, placed = SourceFileLoader.get_code, []

        def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
            if Path(loader.path).resolve() == mutant.path:
                placed.append(fullname)
                return compile(changed, loader.path, 'exec', dont_inherit=True)
            return plain(loader, fullname)

        SourceFileLoader.get_code = get_code  # type: ignore[assignment,method-assign]
        # The launcher, whose table of libraries is read here, has imported some of them.
        package = mutant.path.relative_to(root).parts[0]
        for name in [each for each in sys.modules if each.split('.')[0] == package]:
            del sys.modules[name]
        os.chdir(root)
        limit(ENOUGH)
        files = sorted({test.split('::')[0] for test in ordered})
        with tempfile.TemporaryDirectory() as scratch:
            words = [*options(root, scratch), '-x', *files]
            done = pytest.main(words, plugins=[Chosen(ordered, reach)])
        if not placed:
            raise LookupError(mutant)
        return done == 0

    trials.start(mutant, attempt)


class Chosen:
    """A pytest plugin that runs certain tests in a certain order, each within its limit."""

    def __init__(self, ordered: Sequence[str], reach: Reach) -> None:
        self.place = {name: number for number, name in enumerate(ordered)}
        self.reach = reach

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Leave the chosen tests, in their order."""
        kept = [each for each in items if each.nodeid in self.place]
        items[:] = sorted(kept, key=lambda each: self.place[each.nodeid])

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Limit a test's processor time."""
        limit(self.reach.seconds[item.nodeid])


if __name__ == '__main__':
    sys.exit(main())
