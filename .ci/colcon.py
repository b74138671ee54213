#!/usr/bin/env python3
"""Builds the workspace with colcon in a virtual environment with the ROS wheels, and looks at it.

    python3 .ci/colcon.py [FOLDER]

Every node's executable has to stand where `ros2 run` looks for it, lib/<package>/<node>, and to
run from there in the built workspace. FOLDER, build/colcon unless given, keeps the environment and
the build for the next time.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT))

from launcher.environment import (  # noqa: E402
    FOLDERS,
    INTERFACES,
    clean_environ,
    requirements,
)
from surveillance_runtime import node_table  # noqa: E402

COLCON = [
    'colcon-core',
    'colcon-cmake',
    'colcon-ros',
    'colcon-bash',
    'colcon-python-setup-py',
    'colcon-parallel-executor',
    'colcon-defaults',
    'colcon-metadata',
    'colcon-output',
    'colcon-package-selection',
    'colcon-package-information',
    'colcon-recursive-crawl',
    'colcon-library-path',
    'colcon-test-result',
]


def main() -> int:
    """Return builds, checks, and returns the exit code."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else CHECKOUT / 'build' / 'colcon').resolve()
    folder.mkdir(parents=True, exist_ok=True)
    # A workspace that this checkout is part of is not to look for packages in here.
    (folder / 'COLCON_IGNORE').touch()
    python = make_environment(folder / 'venv')
    build(folder, python)
    wrong = misplaced(folder / 'install') or broken(folder / 'install')
    for line in wrong:
        print(f'colcon: {line}', file=sys.stderr)
    return 1 if wrong else 0


def make_environment(venv: Path) -> Path:
    """Return a virtual environment with what the build and the nodes need."""
    python = venv / 'bin' / 'python'
    if not python.exists():
        run([sys.executable, '-m', 'venv', str(venv)])
    build_system = tomllib.loads((CHECKOUT / INTERFACES / 'pyproject.toml').read_text())
    needed = [*build_system['build-system']['requires'], *requirements(CHECKOUT, ()), *COLCON]
    pip = [str(python), '-m', 'pip', 'install', '-q', '--disable-pip-version-check']
    run([*pip, *needed])
    return python


def build(folder: Path, python: Path) -> None:
    """Build every package of the checkout into `folder`/install."""
    # Neither CMAKE_PREFIX_PATH nor AMENT_PREFIX_PATH: the interfaces ask the interpreter for both.
    environ = clean_environ()
    environ['PATH'] = f'{python.parent}{os.pathsep}{environ["PATH"]}'
    words = ['colcon', 'build', '--base-paths']
    words += [str(CHECKOUT / folder) for folder in (INTERFACES, *FOLDERS)]
    # The interpreter that a find_package finds first is not always the environment's.
    words += ['--cmake-args', f'-DPython3_EXECUTABLE={python}']
    run([str(python), '-m', *words], cwd=folder, environ=environ)


def misplaced(install: Path) -> list[str]:
    """Return what is wrong with the executables."""
    wrong = []
    for node in node_table.NODES:
        executable = install / node.package / 'lib' / node.package / node.name
        if not os.access(executable, os.X_OK):
            wrong.append(f'{node.name} is not at {executable.relative_to(install.parent)}')
    return wrong


def broken(install: Path) -> list[str]:
    """Return which executables do not run: each is given a wrong argument, which it has to name."""
    wrong = []
    for node in node_table.NODES:
        executable = install / node.package / 'lib' / node.package / node.name
        run_it = f'exec {executable} --ros-args --log-level odd'
        script = f'source {install}/local_setup.bash && {run_it}'
        done = subprocess.run(
            ['bash', '-c', script],
            env=clean_environ(),
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        if 'cannot start' not in done.stderr or 'odd' not in done.stderr:
            wrong.append(f'{node.name} does not run: {done.stderr.strip()[-300:]}')
    return wrong


def run(words: list[str], cwd: Path = CHECKOUT, environ: dict[str, str] | None = None) -> None:
    """Run a command; end the program where it fails."""
    done = subprocess.run(words, cwd=cwd, env=environ or clean_environ(), check=False)
    if done.returncode != 0:
        sys.exit(f'colcon: {" ".join(words[:6])} ... ended with exit code {done.returncode}')


if __name__ == '__main__':
    sys.exit(main())
