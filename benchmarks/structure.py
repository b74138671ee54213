#!/usr/bin/env python3
"""Print figures of the code's structure: the two floors, circles, ownership, inheritance.

    python3 benchmarks/structure.py [CHECKOUT]

Everything is read from the sources of the product (libraries, packages and launcher; no tests,
benchmarks, examples, documents). Lines of code are lines with a token that is no comment and no
docstring.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import subprocess
import sys
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

VOCABULARY = ('isIn', 'visitedAt', 'Robot1')
"""Names of the patrol ontology that one module alone is to spell."""
DENSE = (
    'owl_reasoner.derivation',
    'owl_reasoner.justification',
    'owl_reasoner.reasoner.',
    'patrol_policy.plan',
    'patrol_policy.ro',
    'patrol_policy.tour',
    'marker_detection.candidates',
    'marker_detection.cell_differences',
    'marker_detection.detector',
    'marker_detection.pose',
    'marker_detection.template_fit',
    'state_machines.concurrence',
    'state_machines.frame',
    'surveillance_runtime.executor',
)
"""Beginnings of the names of modules whose algorithms need reasons beside them."""
SMALL = 60
"""Lines of code below which a module is asked for a reason to be alone."""
MOST_ATTRIBUTES, MOST_LINES = 20, 400
"""A class with more of either is asked for a reason."""
ROS = (
    *('action_msgs', 'builtin_interfaces', 'control_msgs', 'diagnostic_msgs', 'geometry_msgs'),
    *('nav2_msgs', 'nav_msgs', 'rcl_interfaces', 'rclpy', 'rosgraph_msgs', 'sensor_msgs'),
    *('std_msgs', 'std_srvs', 'surveillance_interfaces', 'tf2_msgs', 'trajectory_msgs'),
    *('unique_identifier_msgs', 'visualization_msgs'),
)
"""Packages that come with ROS 2, and the project's messages."""


def main(words: Sequence[str] | None = None) -> int:
    """Print the table of one checkout and return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or '').split('\n')[0])
    own = Path(__file__).parents[1]
    parser.add_argument('checkout', nargs='?', type=Path, default=own, help='default: its own')
    modules = product(parser.parse_args(words).checkout.resolve())
    if not modules:
        parser.error('no product module there: expected a checkout of this project')
    trees = {name: ast.parse(path.read_text(encoding='utf-8')) for name, path in modules.items()}
    lines = {name: code_lines(path) for name, path in modules.items()}
    importers = importers_of(trees)
    small = sorted(
        name
        for name, count in lines.items()
        if 0 < count < SMALL
        and len(importers[name]) <= 1
        and not name.endswith(('__init__', '_node', 'setup'))
        and 'launch' not in name.split('.')[0]
    )
    chain = longest_chain(trees)
    errors = [name for tree in trees.values() for name in error_classes(tree)]
    libraries = {name for name, path in modules.items() if 'libs' in path.parts}
    robot = set(modules) - libraries
    arrows = arrows_between(trees)
    circles = circles_of(trees)
    testable, lacking = named_tests(modules)
    rows = [
        ('modules of the robot; of libraries', f'{len(robot)}; {len(libraries)}'),
        (
            'lines of code of the robot; of libraries',
            f'{sum(lines[n] for n in robot):,}; {sum(lines[n] for n in libraries):,}',
        ),
        ('imports from a library to the robot', listed(upward(trees, libraries, robot))),
        ('arrows between packages', str(len(arrows))),
        ('circles of files', listed(' - '.join(circle) for circle in circles)),
        ('classes above 40 methods', listed(large_classes(trees, 40))),
        ('median module', str(sorted(lines.values())[len(lines) // 2])),
        (f'modules that spell {", ".join(VOCABULARY)}', listed(spelling(trees))),
        ('modules that write isIn', listed(writers(modules))),
        (f'modules below {SMALL} lines with at most one importer', listed(small)),
        ('class names with several meanings', listed(double_names(trees))),
        (
            f'classes over {MOST_ATTRIBUTES} attributes or {MOST_LINES} lines',
            listed(f'{name} {size}' for name, size in owning_much(trees).items()),
        ),
        ('modules of the robot that load no ROS', str(len(robot - loading_ros(trees)))),
        ("imports past a library's face", listed(past_the_face(trees, modules))),
        (
            "modules whose tests are found by name: the robot's; the libraries'",
            '; '.join(
                f'{len(part) - len(part & lacking)} of {len(part)}'
                for part in (robot & testable, libraries & testable)
            ),
        ),
        ('longest chain of own classes', f'{len(chain)}: {" <- ".join(chain)}'),
        ('classes of errors', str(len(errors))),
        ('of them not named ...Error', listed(e for e in errors if not e.endswith('Error'))),
    ]
    packages: Counter[str] = Counter()
    comments: Counter[str] = Counter()
    for name, count in lines.items():
        packages[name.split('.')[0]] += count
        comments[name.split('.')[0]] += comment_lines(modules[name])
    rows += [
        (
            f'lines of {package}; comments in 100 of them',
            f'{count:,}; {100 * comments[package] / count:.1f}',
        )
        for package, count in packages.most_common()
    ]
    dense = [name for name in lines if name.startswith(DENSE)]
    share = (
        100 * sum(comment_lines(modules[n]) for n in dense) / max(sum(lines[n] for n in dense), 1)
    )
    rows.append(('lines of comments in 100 of the dense modules', f'{share:.1f}'))
    rows += [
        (f'  {name}', f'{100 * comment_lines(modules[name]) / lines[name]:.1f}')
        for name in sorted(dense)
        if lines[name] > 150
    ]
    width = max(len(title) for title, _ in rows)
    for title, figure in rows:
        print(f'{title:{width}}  {figure}')
    return 0


def product(checkout: Path) -> dict[str, Path]:
    """Return the product's modules by dotted name, setup scripts left out."""
    patterns = ('libs/*.py', 'surveillance_*/*.py', 'launcher/*.py', 'launch.py')
    listing = subprocess.run(
        ['git', '-C', str(checkout), 'ls-files', *patterns],
        capture_output=True,
        text=True,
        check=False,
    )
    found = {}
    for line in listing.stdout.split():
        parts = Path(line).with_suffix('').parts
        if parts[0] == 'libs':
            if parts[2] != parts[1]:  # its tests and examples
                continue
            parts = parts[1:]
        if parts[-1] != 'setup' and not parts[-1].endswith('.launch'):
            inner = parts[1:] if parts[:1] == parts[1:2] or parts[0].startswith('surv') else parts
            found['.'.join(inner)] = checkout / line
    return found


def code_lines(path: Path) -> int:
    """Return how many lines hold code: no blank line, comment or docstring."""
    source = path.read_text(encoding='utf-8')
    skipped = set()
    for node in ast.walk(ast.parse(source)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            skipped.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    quiet = (
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
    used: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in quiet:
            used.update(range(token.start[0], token.end[0] + 1))
    return len(used - skipped)


def importers_of(trees: dict[str, ast.Module]) -> dict[str, set[str]]:
    """Return which modules import each module."""
    found: dict[str, set[str]] = defaultdict(set)
    for name, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module:
                found[node.module].add(name)
                for alias in node.names:
                    found[f'{node.module}.{alias.name}'].add(name)
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    found[alias.name].add(name)
    return found


def comment_lines(path: Path) -> int:
    """Return how many lines hold a comment that a person wrote for a person."""
    source = path.read_text(encoding='utf-8')
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    directives = ('# type:', '# noqa', '#!')
    return sum(
        token.type == tokenize.COMMENT and not token.string.startswith(directives)
        for token in tokens
    )


def imports_of(trees: dict[str, ast.Module]) -> dict[str, set[str]]:
    """Return the product's modules that each module imports at its top, for its types too."""
    packages = {name.removesuffix('.__init__'): name for name in trees}
    found: dict[str, set[str]] = {name: set() for name in trees}

    def visit(name: str, body: Sequence[ast.stmt]) -> None:
        for node in body:
            if isinstance(node, ast.If | ast.Try | ast.With):
                visit(name, node.body)
            named: list[str] = []
            if isinstance(node, ast.ImportFrom) and node.module:
                inner = [f'{node.module}.{alias.name}' for alias in node.names]
                named = [each for each in inner if each in packages] or [node.module]
            elif isinstance(node, ast.Import):
                named = [alias.name for alias in node.names]
            found[name] |= {packages[each] for each in named if each in packages} - {name}

    for name, tree in trees.items():
        visit(name, tree.body)
    return found


def arrows_between(trees: dict[str, ast.Module]) -> set[tuple[str, str]]:
    """Return which package imports which other one, anywhere in its modules."""
    own = {name.split('.')[0] for name in trees}
    found = set()
    for imported, importers in importers_of(trees).items():
        for importer in importers:
            pair = importer.split('.')[0], imported.split('.')[0]
            if pair[1] in own and pair[0] != pair[1]:
                found.add(pair)
    return found


def upward(trees: dict[str, ast.Module], libraries: set[str], robot: set[str]) -> list[str]:
    """Return the imports with which a library names the robot."""
    above = {name.split('.')[0] for name in robot}
    return sorted(
        f'{importer} -> {imported}'
        for imported, importers in importers_of(trees).items()
        if imported.split('.')[0] in above
        for importer in importers & libraries
    )


def circles_of(trees: dict[str, ast.Module]) -> list[list[str]]:
    """Return the groups of modules that import each other in a circle (Tarjan's components)."""
    imports = imports_of(trees)
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    circles: list[list[str]] = []

    def visit(name: str) -> None:
        order[name] = low[name] = len(order)
        stack.append(name)
        for other in imports[name]:
            if other not in order:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], order[other])
        if low[name] == order[name]:
            circle = []
            while not circle or circle[-1] != name:
                circle.append(stack.pop())
            if len(circle) > 1:
                circles.append(sorted(circle))

    sys.setrecursionlimit(10_000)
    for name in imports:
        if name not in order:
            visit(name)
    return circles


def large_classes(trees: dict[str, ast.Module], most: int) -> list[str]:
    """Return the classes with more methods than `most`."""
    return [
        f'{name}.{node.name} ({count})'
        for name, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        and (count := sum(isinstance(each, ast.FunctionDef) for each in node.body)) > most
    ]


def double_names(trees: Mapping[str, ast.Module]) -> dict[str, list[str]]:
    """Return the names that several modules give a class of theirs, with those modules."""
    found: dict[str, list[str]] = defaultdict(list)
    for module, tree in trees.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                found[node.name].append(module)
    return {name: modules for name, modules in sorted(found.items()) if len(modules) > 1}


def owning_much(trees: Mapping[str, ast.Module]) -> dict[str, str]:
    """Return the classes above the limits, `module.Class`, with 'attributes/lines'.

    Attributes are the fields that the class declares and those that its methods assign on self.
    """
    found = {}
    for module, tree in trees.items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ClassDef):
                continue
            held = {
                each.target.id
                for each in node.body
                if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
            }
            held |= {
                each.attr
                for each in ast.walk(node)
                if isinstance(each, ast.Attribute)
                and isinstance(each.ctx, ast.Store)
                and ast.unparse(each.value) == 'self'
            }
            count = (node.end_lineno or node.lineno) - node.lineno + 1
            if len(held) > MOST_ATTRIBUTES or count > MOST_LINES:
                found[f'{module}.{node.name}'] = f'{len(held)}/{count}'
    return found


def loading_ros(trees: Mapping[str, ast.Module]) -> set[str]:
    """Return the modules whose import loads ROS, themselves or by what they import.

    What is imported for types only, or within a function, does not count.
    """
    packages = {name.removesuffix('.__init__'): name for name in trees}
    loaded = {name: set(at_import(tree.body)) for name, tree in trees.items()}
    found = {name for name, many in loaded.items() if any(m.split('.')[0] in ROS for m in many)}
    inner = {name: {packages[m] for m in many if m in packages} for name, many in loaded.items()}
    while more := {name for name, many in inner.items() if many & found} - found:
        found |= more
    return found


def at_import(body: Sequence[ast.stmt]) -> Iterator[str]:
    """Yield the dotted names that a module's import loads, or that name something in them."""
    for node in body:
        if isinstance(node, ast.If):
            for_types = 'TYPE_CHECKING' in ast.unparse(node.test)
            yield from at_import(node.orelse if for_types else [*node.body, *node.orelse])
        elif isinstance(node, ast.Try | ast.With):
            yield from at_import(node.body)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f'{node.module}.{alias.name}' for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def public_modules(face: ast.Module) -> set[str]:
    """Return the modules that a package's docstring calls public.

    That is a paragraph `Public modules: `a`, `b.c`.`; the names of `__all__` are public anyhow.
    """
    told = re.search(r'^Public modules: (.+?)(\n\n|\Z)', ast.get_docstring(face) or '', re.M | re.S)
    return set(re.findall(r'`([\w.]+)`', told[1])) if told else set()


def past_the_face(trees: Mapping[str, ast.Module], modules: Mapping[str, Path]) -> set[str]:
    """Return the modules of libraries that others import though they are not public."""
    faces = {
        name.split('.')[0]: public_modules(trees[name])
        for name, path in modules.items()
        if 'libs' in path.parts and name.count('.') == 1 and name.endswith('.__init__')
    }
    found = set()
    for module, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module and '.' in node.module:
                library, _, inner = node.module.partition('.')
                if library in faces and library != module.split('.')[0]:
                    named = {f'{inner}.{alias.name}' for alias in node.names}
                    if inner not in faces[library] and not named <= faces[library]:
                        found.add(node.module)
    return found


def named_tests(modules: Mapping[str, Path]) -> tuple[set[str], set[str]]:
    """Return the modules that can have a test file, and those without one of their name.

    A module's tests are `test_<module>.py`, or without its `_node`, anywhere below `tests/`; a
    library's in its own tests, or where they need ROS in `tests/<library>`.
    """
    some = next(iter(modules.values()))
    checkout = next(
        folder
        for folder in some.parents
        if (folder / 'pyproject.toml').is_file() and (folder / 'launch.py').is_file()
    )
    testable = {name for name in modules if not name.endswith(('__init__', '__main__'))}
    lacking = set()
    for name in testable:
        path = modules[name].relative_to(checkout)
        below = [Path('tests')]
        if path.parts[0] == 'libs':
            below = [Path(*path.parts[:2], 'tests'), Path('tests', path.parts[1])]
        stem = path.stem
        names = {f'test_{stem}.py', f'test_{stem.removesuffix("_node")}.py'}
        if not any(
            each.name in names
            for folder in below
            for each in (checkout / folder).rglob('test_*.py')
        ):
            lacking.add(name)
    return testable, lacking


def longest_chain(trees: dict[str, ast.Module]) -> list[str]:
    """Return the longest line of inheritance of the project's own classes, errors left out."""
    bases: dict[str, list[str]] = {}
    for tree in trees.values():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.endswith('Error'):
                bases.setdefault(node.name, [])
                bases[node.name] += [
                    ast.unparse(base).split('.')[-1].split('[')[0] for base in node.bases
                ]

    def line(name: str, seen: tuple[str, ...] = ()) -> list[str]:
        if name not in bases or name in seen:
            return []
        above = [line(base, (*seen, name)) for base in bases[name]]
        return [*max(above, key=len, default=[]), name]

    return max((line(name) for name in bases), key=len)


def error_classes(tree: ast.Module) -> list[str]:
    """Return the names of the exception classes of a module."""
    return [
        node.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
        and any(re.search(r'(Error|Exception|Interrupted)$', ast.unparse(b)) for b in node.bases)
    ]


def spelling(trees: dict[str, ast.Module]) -> list[str]:
    """Return the modules in which a string constant outside docstrings holds a vocabulary name."""
    word = re.compile(rf'(?<!\w)({"|".join(VOCABULARY)})(?!\w)')
    found = []
    for name, tree in trees.items():
        documents = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        if any(
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in documents
            and word.search(node.value)
            for node in ast.walk(tree)
        ):
            found.append(name)
    return found


def writers(modules: dict[str, Path]) -> list[str]:
    """Return the modules that write isIn with a directive of ADD, REMOVE, REPLACE or SET."""
    change = re.compile(r"(?:ADD|REMOVE|REPLACE|SET)[^'\n]*OBJECTPROP[^\n]*\n?[^\n]*isIn")
    return [name for name, path in modules.items() if change.search(path.read_text('utf-8'))]


def listed(names: object) -> str:
    """Return a count, and the names when they are few."""
    all_names = list(names)  # type: ignore[call-overload]
    few = ', '.join(all_names) if len(all_names) <= 8 else ', '.join(all_names[:8]) + ', ...'
    return f'{len(all_names)}{": " + few if few else ""}'


if __name__ == '__main__':
    sys.exit(main())
