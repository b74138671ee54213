"""Run owlready2's own tests with the native reasoner, and on files of the directive service.

    python benchmarks/owlready_suite.py --tests FOLDER [--modes plain,native,file,served] [-k WORDS]

FOLDER is `test` of owlready2's source package, in the version that is installed (`pip download
--no-deps --no-binary :all: owlready2==VERSION`). Nothing of it is changed. Each mode is a process:

- plain: as they are;
- native: `sync_reasoner_native` in place of HermiT and Pellet;
- file: each World with a file begins as one that the service made and let go of;
- served: the same while the service has each of these files open.
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import traceback
import unittest
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import wraps
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.sizes import Size, sized_parser, skip

MODES = ('plain', 'native', 'file', 'served')
EMPTY = """<?xml version="1.0"?>
<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"
  xmlns:owl="http://www.w3.org/2002/07/owl#"><owl:Ontology rdf:about="http://example.org/served"/>
</rdf:RDF>
"""


class Service:
    """The directive service with a reference for each World that is asked for."""

    def __init__(self, folder: Path) -> None:
        from armor_service.access import Settings
        from armor_service.service import ArmorService
        from armor_service.store.store import Store

        self.told: list[str] = []
        self._folder = folder
        (folder / 'files').mkdir(parents=True)
        (folder / 'files' / 'empty.owl').write_text(EMPTY)
        self._store = Store(folder / 'store')
        settings = Settings(folder / 'files')
        self._service = ArmorService(settings, self.told.append, self.told.append, self._store)
        self._count = 0

    def new_file(self) -> Path:
        """Load an empty ontology, and return where its World is."""
        from armor_service.protocol import DirectiveRequest

        self._count += 1
        name = f'world{self._count}'
        path = str(self._folder / 'files' / 'empty.owl')
        words = (path, 'http://example.org/served', 'false', '', 'false')
        request = DirectiveRequest('suite', name, 'LOAD', 'FILE', '', words)
        answer = self._service.execute(request)
        assert answer.success, answer.error_description
        return self._store.path(name)

    def close(self) -> None:
        """Let go of the files."""
        self._service.close()


def use_files(new_file: Callable[[], Path], served: bool) -> None:
    """Have owlready2 find a file of the service wherever it would make one."""
    from owlready2 import triplelite

    make = triplelite.Graph.__init__

    @wraps(make)
    def on_file(graph: Any, filename: str, clone: Any = None, **options: Any) -> None:
        is_new = not (os.path.exists(filename) and os.path.getsize(filename))
        if filename != ':memory:' and not options.get('connection'):
            if is_new and clone is None and served:
                path = new_file()
                # The tests open it again by their own name.
                Path(filename).unlink(missing_ok=True)
                Path(filename).symlink_to(path)
                filename = str(path)
            elif is_new and clone is None:
                shutil.copyfile(new_file(), filename)
            if served:
                options['exclusive'] = False
        make(graph, filename, clone, **options)

    triplelite.Graph.__init__ = on_file


def use_native() -> None:
    """Put the native reasoner in place of those in Java."""
    import owlready2

    from owl_reasoner import sync_reasoner_native

    def reason(
        x: Any = None,
        infer_property_values: bool = False,
        debug: int = 1,
        keep_tmp_file: bool = False,
        infer_data_property_values: bool = False,
        **_others: Any,
    ) -> None:
        sync_reasoner_native(x, infer_property_values, infer_data_property_values, debug=debug)

    for name in ('sync_reasoner', 'sync_reasoner_hermit', 'sync_reasoner_pellet'):
        setattr(owlready2, name, reason)
        setattr(owlready2.reasoning, name, reason)


def run(tests: Path, mode: str, words: str, folder: Path) -> None:
    """Run the tests in one mode, and print what became of each as JSON."""
    service: Service | None = None
    if mode == 'native':
        use_native()
    elif mode == 'file':
        made = Service(folder)
        template = folder / 'template.sqlite3'
        path = made.new_file()
        made.close()
        shutil.copyfile(path, template)
        count = iter(range(1_000_000))

        def copied() -> Path:
            path = folder / f'copy{next(count)}.sqlite3'
            return Path(shutil.copyfile(template, path))

        use_files(copied, served=False)
    elif mode == 'served':
        service = Service(folder)
        use_files(service.new_file, served=True)
    os.chdir(tests)
    sys.path.insert(0, str(tests))
    sys.argv = ['regtest.py']
    quiet = io.StringIO()
    outcome: dict[str, str] = {}
    with redirect_stdout(quiet), redirect_stderr(quiet):
        module = importlib.import_module('regtest')
        for test in _all(unittest.defaultTestLoader.loadTestsFromModule(module)):
            name = test.id().partition('.')[2]
            source = inspect.getsource(getattr(test, test.id().rpartition('.')[2]))
            if not any(word in name for word in words.split(',')) or (
                mode == 'native' and 'sync_reasoner' not in source
            ):
                continue
            result = unittest.TestResult()
            test.run(result)
            failed = [text for _, text in (*result.errors, *result.failures)]
            outcome[name] = failed[0].strip() if failed else ''
    told: list[str] = []
    if service is not None:
        service.close()
        told = service.told
    print(json.dumps([outcome, told]))


def _all(suite: unittest.TestSuite) -> list[unittest.TestCase]:
    found: list[unittest.TestCase] = []
    for part in suite:
        found += _all(part) if isinstance(part, unittest.TestSuite) else [part]
    return found


def main() -> None:
    """Run each mode in a process of its own, and print a table."""
    parser = sized_parser(__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--tests', type=Path, help="the folder 'test' of owlready2's source")
    parser.add_argument('--modes', default=','.join(MODES), help='which of them, with commas')
    parser.add_argument(
        '-k',
        dest='words',
        default='',
        help='only tests with one of these, with commas, in their name',
    )
    parser.add_argument('--show', action='store_true', help='print the whole of each failure')
    parser.add_argument('--one', nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    tests = options.tests.resolve() if options.tests else None
    if tests is None or not (tests / 'regtest.py').exists():
        skip("the folder 'test' of owlready2's source package is needed: --tests FOLDER")
    if options.one:
        run(tests, options.one[0], options.words, Path(options.one[1]))
        return
    words = options.words or ('test_reasoning' if options.size is Size.SMOKE else '')
    found: dict[str, dict[str, str]] = {}
    for mode in options.modes.split(','):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, __file__, '--tests', str(tests), '-k', words]
            ended = subprocess.run(
                [*command, '--one', mode, folder], capture_output=True, text=True, check=False
            )
        try:
            found[mode], told = json.loads(ended.stdout.splitlines()[-1])
        except (IndexError, ValueError):
            print(f'{mode}: ended with {ended.returncode}: {ended.stderr[-2000:]}')
            continue
        failed = {name: text for name, text in found[mode].items() if text}
        print(f'{mode:8} {len(found[mode])} tests, {len(found[mode]) - len(failed)} pass')
        before = found.get('plain', {})
        for name, text in failed.items():
            if mode != 'plain' and before.get(name, '') and mode != 'native':
                continue
            print(f'    {name}: {text if options.show else text.splitlines()[-1][:150]}')
        for line in told:
            print(f'    told: {line}')


if __name__ == '__main__':
    try:
        main()
    except Exception:
        traceback.print_exc()
        raise SystemExit(1) from None
