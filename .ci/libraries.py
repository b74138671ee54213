#!/usr/bin/env python3
"""Builds each library's wheel, installs it alone, and runs its examples and its tests there.

    python3 .ci/libraries.py [NAME ...]

Each library gets an empty virtual environment in a temporary folder. What it imports beyond its own
project's dependencies fails there, and so does a test that needs the checkout.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT))

from launcher.environment import LIBRARIES  # noqa: E402

RUNNERS = ['pytest-xdist>=3.5,<4']
BY_PATH = ('CMAKE_PREFIX_PATH', 'AMENT_PREFIX_PATH', 'PYTHONPATH', 'PYTHONHOME')


def main(names: list[str]) -> int:
    """Check the named libraries, all of them by default; return the exit code."""
    environ = {key: value for key, value in os.environ.items() if key not in BY_PATH}
    with tempfile.TemporaryDirectory() as folder:
        wheels = Path(folder) / 'wheels'
        for name in LIBRARIES:
            sources = copy_of(name, Path(folder))
            build = ['wheel', '--no-deps', '-w', str(wheels), str(sources)]
            pip(Path(sys.executable), build, environ)
        for name in names or LIBRARIES:
            alone = Path(folder) / name
            venv.create(alone / 'venv', with_pip=True)
            python = alone / 'venv' / 'bin' / 'python'
            found = ['install', '--find-links', str(wheels)]
            pip(python, [*found, name], environ)
            pip(python, ['check'], environ)
            project = CHECKOUT / 'libs' / name / 'pyproject.toml'
            wanted = tomllib.loads(project.read_text())['project']['optional-dependencies']['test']
            for script in sorted((alone / 'examples').glob('*.py')):
                run([python, script], alone / 'examples', environ)
            pip(python, ['install', *RUNNERS, *wanted], environ)
            # Its own package is out of the way: the wheel is what is tested.
            shutil.rmtree(alone / name)
            print(f'{name}: its tests, alone', flush=True)
            run([python, '-m', 'pytest', '-n', '2', '-p', 'no:cacheprovider'], alone, environ)
    return 0


def copy_of(name: str, folder: Path) -> Path:
    """Return a copy of a library's files that git knows: a build leaves folders beside them."""
    listing = ['git', 'ls-files', '-co', '--exclude-standard', f'libs/{name}']
    done = subprocess.run(listing, cwd=CHECKOUT, capture_output=True, text=True, check=True)
    for each in done.stdout.split('\n'):
        if each and (CHECKOUT / each).is_file():
            target = folder / Path(each).relative_to('libs')
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes((CHECKOUT / each).read_bytes())
    return folder / name


def pip(python: Path, words: list[str], environ: dict[str, str]) -> None:
    """Run pip of an environment; end the program where it fails."""
    options = ['--quiet', '--disable-pip-version-check', '--no-input']
    run([python, '-m', 'pip', words[0], *options, *words[1:]], Path.cwd(), environ)


def run(words: list[str | Path], folder: Path, environ: dict[str, str]) -> None:
    """Run a command; end the program where it fails."""
    done = subprocess.run(words, cwd=folder, env=environ, stdin=subprocess.DEVNULL, check=False)
    if done.returncode:
        sys.exit(f'failed in {folder}: {" ".join(map(str, words))}')


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
