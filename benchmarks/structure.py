#!/usr/bin/env python3
"""Print figures of the code's structure: size, ownership, inheritance, splinters.

    python3 benchmarks/structure.py [CHECKOUT]

Everything is read from the sources of the product (packages and launcher; no tests, benchmarks,
examples, documents). Lines of code are lines with a token that is no comment and no docstring.
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
from collections.abc import Sequence
from pathlib import Path

VOCABULARY = ('isIn', 'visitedAt', 'Robot1')
"""Names of the patrol ontology that one module alone is to spell."""
SMALL = 60
"""Lines of code below which a module is asked for a reason to be alone."""


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
    rows = [
        ('product modules', str(len(modules))),
        ('lines of code', f'{sum(lines.values()):,}'),
        ('median module', str(sorted(lines.values())[len(lines) // 2])),
        (f'modules that spell {", ".join(VOCABULARY)}', listed(spelling(trees))),
        ('modules that write isIn', listed(writers(modules))),
        (f'modules below {SMALL} lines with at most one importer', listed(small)),
        ('longest chain of own classes', f'{len(chain)}: {" <- ".join(chain)}'),
        ('classes of errors', str(len(errors))),
        ('of them not named ...Error', listed(e for e in errors if not e.endswith('Error'))),
    ]
    packages: Counter[str] = Counter()
    for name, count in lines.items():
        packages[name.split('.')[0]] += count
    rows += [(f'lines of {package}', f'{count:,}') for package, count in packages.most_common()]
    width = max(len(title) for title, _ in rows)
    for title, figure in rows:
        print(f'{title:{width}}  {figure}')
    return 0


def product(checkout: Path) -> dict[str, Path]:
    """Return the product's modules by dotted name, setup scripts left out."""
    patterns = ('surveillance_*/*.py', 'armor_api/*.py', 'launcher/*.py', 'launch.py')
    listing = subprocess.run(
        ['git', '-C', str(checkout), 'ls-files', *patterns],
        capture_output=True,
        text=True,
        check=False,
    )
    found = {}
    for line in listing.stdout.split():
        parts = Path(line).with_suffix('').parts
        if parts[-1] != 'setup' and not parts[-1].endswith('.launch'):
            inner = parts[1:] if parts[0] == parts[1:2] or parts[0].startswith('surv') else parts
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
