"""The set-up on a small project: nothing to download, and interfaces that build at once."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from launcher import cli
from launcher.environment import (
    INTERFACES,
    JOURNAL,
    PythonEnvironment,
    _Command,
    clean_environ,
    keep_bytecode,
)
from launcher.progress import SetUpStep
from tests.launcher.conftest import ROOT

# A build backend that needs nothing and waits, when told to, for the test to go on.
BACKEND = """
import os, zipfile
NAME = 'surveillance_interfaces-1'
def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    if 'FAIL_BUILD' in os.environ:
        raise SystemExit('error: no compiler today')
    if 'HOLD_BUILD' in os.environ:
        with open(os.environ['HOLD_BUILD'], 'w') as reached:
            reached.write('x')
        with open(os.environ['HOLD_BUILD'] + '.go') as go:
            go.read()
    with zipfile.ZipFile(os.path.join(wheel_directory, NAME + '-py3-none-any.whl'), 'w') as wheel:
        with open('source.py') as source:
            wheel.writestr('surveillance_interfaces.py', source.read())
        info = NAME + '.dist-info/'
        about = ['Metadata-Version: 2.1', 'Name: surveillance_interfaces', 'Version: 1']
        wheel.writestr(info + 'METADATA', '\\n'.join(about))
        about = ['Wheel-Version: 1.0', 'Root-Is-Purelib: true', 'Tag: py3-none-any']
        wheel.writestr(info + 'WHEEL', '\\n'.join(about))
        names = [*wheel.namelist(), info + 'RECORD']
        wheel.writestr(info + 'RECORD', ''.join(f'{name},,\\n' for name in names))
    return NAME + '-py3-none-any.whl'
"""
BUILD = """
[build-system]
requires = []
build-backend = "backend"
backend-path = ["."]
"""
PROJECT = """
[project]
dependencies = ["pip"]
[project.optional-dependencies]
test = []
"""
PREPARE = """
import sys
from pathlib import Path
from launcher.environment import PythonEnvironment
wheels, collected = (Path(word) if word else None for word in (*sys.argv[2:], '', '')[:2])
try:
    environment = PythonEnvironment(Path(sys.argv[1]), wheels=wheels)
    environment.prepare() if collected is None else environment.collect(collected)
except ValueError as error:
    sys.exit(str(error))
print('ready', environment.ready())
"""


@pytest.fixture(scope='module')
def checkout(tmp_path_factory):
    """Provide a checkout whose environment the tests set up, and use, one after the other."""
    folder = tmp_path_factory.mktemp('checkout')
    (folder / 'pyproject.toml').write_text(PROJECT)
    interfaces = folder / INTERFACES
    interfaces.mkdir()
    (interfaces / 'pyproject.toml').write_text(BUILD)
    (interfaces / 'backend.py').write_text(BACKEND)
    (interfaces / 'source.py').write_text('VALUE = 0\n')
    return folder


def environ(**more: str) -> dict[str, str]:
    return {**clean_environ(), 'PYTHONPATH': str(ROOT), **more}


def prepare(checkout: Path, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, '-c', PREPARE, str(checkout), *words],
        env=environ(**more),
        capture_output=True,
        text=True,
        check=False,
    )


def value(checkout: Path, venv: Path | None = None) -> str:
    python = (venv or checkout / '.venv') / 'bin' / 'python'
    code = 'import surveillance_interfaces as i; print(i.VALUE)'
    return subprocess.check_output([python, '-c', code], env=environ(), text=True).strip()


def test_a_set_up_from_nothing_to_an_edit(checkout, start):
    # A build that fails says why in one line, and the environment is not taken as finished.
    (checkout / INTERFACES / 'source.py').write_text('VALUE = 1\n')
    failed = prepare(checkout, FAIL_BUILD='1')
    assert failed.returncode == 1
    assert failed.stderr.count('\n') == 1
    assert 'the set-up stopped' in failed.stderr
    assert 'setup.log' in failed.stderr
    assert 'no compiler today' in (checkout / '.venv' / 'setup.log').read_text()

    # The next run goes on where it stopped: the interfaces alone are left.
    done = prepare(checkout)
    assert 'ready True' in done.stdout, done.stderr
    assert '[1/1] messages' in done.stdout
    assert value(checkout) == '1'

    # Nothing changed: nothing is done, and nothing is said.
    assert prepare(checkout).stdout == 'ready True\n'

    # Cut off in the middle of a build by SIGKILL: the next run waits for what still builds, then
    # finishes the work.
    (checkout / INTERFACES / 'source.py').write_text('VALUE = 2\n')
    reached = checkout / 'reached'
    os.mkfifo(reached)
    os.mkfifo(f'{reached}.go')
    cut = start('-c', PREPARE, str(checkout), environ=environ(HOLD_BUILD=str(reached)))
    with reached.open() as signal_of_build:
        assert signal_of_build.read() == 'x'
    cut.end(signal.SIGKILL)
    assert json.loads((checkout / '.venv' / JOURNAL).read_text())['working'].startswith('messages')
    following = start('-u', '-c', PREPARE, str(checkout), environ=environ())
    following.until(r'Another set-up of this checkout is at work \(process')
    with open(f'{reached}.go', 'w') as go:
        go.write('x')
    following.until('ready True')
    assert following.end()[0] == 0
    assert value(checkout) == '2'

    # Cut off while packages were installed: what pip had not finished is installed again, and no
    # more than that.
    journal = json.loads((checkout / '.venv' / JOURNAL).read_text())
    journal['working'] = 'Python packages, ROS 2 Jazzy among them'
    (checkout / '.venv' / JOURNAL).write_text(json.dumps(journal))
    (checkout / '.venv' / 'kept').touch()
    (site,) = (checkout / '.venv').glob('lib/*/site-packages')
    cut_off = site / 'half_installed-1.dist-info'
    cut_off.mkdir()
    (cut_off / 'METADATA').write_text('Metadata-Version: 2.1\nName: half_installed\nVersion: 1\n')
    resumed = prepare(checkout)
    assert '[1/1] Python packages' in resumed.stdout
    assert 'ready True' in resumed.stdout
    assert (checkout / '.venv' / 'kept').exists()
    assert not cut_off.exists()


def test_two_set_ups_at_once_are_one_after_the_other(checkout, start):
    lock = os.open(checkout, os.O_RDONLY)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        (checkout / INTERFACES / 'source.py').write_text('VALUE = 3\n')
        both = [start('-u', '-c', PREPARE, str(checkout), environ=environ()) for _ in range(2)]
        for one in both:
            one.until(r'Another set-up of this checkout is at work \(process')
    finally:
        os.close(lock)
    for one in both:
        one.until('ready True')
    # One did the work, the other saw that it was done.
    worked = [any('] messages' in line for line in one.lines) for one in both]
    assert sorted(worked) == [False, True]


def test_an_environment_in_use_stays_and_a_new_one_is_set_up_beside_it(checkout):
    (checkout / INTERFACES / 'source.py').write_text('VALUE = 4\n')
    assert 'ready True' in prepare(checkout).stdout
    first = checkout / '.venv'
    words = [first / 'bin' / 'python', '-c', 'input()']
    with subprocess.Popen(words, stdin=subprocess.PIPE, env=environ()) as running:
        # A pull changes the interfaces below a mission.
        (checkout / INTERFACES / 'source.py').write_text('VALUE = 5\n')
        done = prepare(checkout)
        assert f'.venv is in use by process {running.pid}' in done.stdout
        assert '[1/1] messages' in done.stdout, 'what both have is not installed twice'
        assert 'ready True' in done.stdout
        assert value(checkout) == '4', 'a node that is started again finds what it had'
        (second,) = checkout.glob('.venv-*')
        assert (second / 'bin' / 'pip').read_text().startswith(f'#!{second}/bin/python')
        assert value(checkout, second) == '5'
        running.communicate(b'\n')
    # The mission has ended: the next start takes its environment away.
    assert prepare(checkout).stdout == 'ready True\n'
    (left,) = [each for each in checkout.glob('.venv*') if not each.is_symlink()]
    assert left == second
    assert value(checkout) == '5'


def test_another_interpreter_gets_an_environment_of_its_own(checkout):
    assert 'ready True' in prepare(checkout).stdout
    before = value(checkout)
    journal = (checkout / '.venv').resolve() / JOURNAL
    others = json.loads(journal.read_text())
    journal.write_text(json.dumps({**others, 'python': '3.12 /elsewhere'}))
    (checkout / INTERFACES / 'source.py').write_text('VALUE = 7\n')
    done = prepare(checkout)
    assert 'ready True' in done.stdout
    assert '[1/3] virtual environment' in done.stdout
    assert value(checkout, journal.parent) == before
    assert prepare(checkout).stdout == 'ready True\n'


def test_a_machine_without_internet_is_set_up_from_a_folder_of_wheels(tmp_path, checkout):
    wheels = tmp_path / 'wheels'
    missing = f'--wheels {wheels}: expected a folder of wheels\n'
    assert prepare(checkout, str(wheels)).stderr == missing
    wheels.mkdir()
    project = checkout / 'pyproject.toml'
    project.write_text(PROJECT.replace('"pip"', '"tiny==1"'))
    assert f'setup --collect {wheels}' in prepare(checkout, str(wheels)).stderr
    with zipfile.ZipFile(wheels / 'tiny-1-py3-none-any.whl', 'w') as wheel:
        wheel.writestr('tiny.py', '')
        wheel.writestr('tiny-1.dist-info/METADATA', 'Metadata-Version: 2.1\nName: tiny\nVersion: 1')
        wheel.writestr('tiny-1.dist-info/WHEEL', 'Wheel-Version: 1.0\nTag: py3-none-any')
        wheel.writestr('tiny-1.dist-info/RECORD', '')
    (checkout / INTERFACES / 'source.py').write_text('VALUE = 8\n')
    assert 'ready True' in prepare(checkout, str(wheels)).stdout
    assert list(checkout.glob('.venv/lib/*/site-packages/tiny.py'))
    assert value(checkout) == '8'
    # What the set-up needs is gathered from wherever pip finds it.
    there = {'PIP_NO_INDEX': '1', 'PIP_FIND_LINKS': str(wheels)}
    assert prepare(checkout, '', str(tmp_path / 'gathered'), **there).returncode == 0
    assert [path.name for path in (tmp_path / 'gathered').iterdir()] == ['tiny-1-py3-none-any.whl']
    project.write_text(PROJECT.replace('"pip"', '"tiny==2"'))
    lacking = prepare(checkout, str(wheels)).stderr
    project.write_text(PROJECT)
    assert f'{wheels} has no wheel that fits tiny==2' in lacking


def test_half_an_environment_without_pip_is_made_anew(tmp_path, checkout, start):
    # What Debian leaves behind when its python3-venv is missing.
    if not (checkout / '.venv').exists():
        prepare(checkout)
    for path in (checkout / '.venv').glob('lib/*/site-packages/pip*'):
        path.rename(tmp_path / path.name)
    (checkout / '.venv' / JOURNAL).unlink()
    anew = start('-u', '-c', PREPARE, str(checkout), environ=environ())
    anew.until(r'\[1/3\] virtual environment')
    anew.end(signal.SIGINT)  # the rest is as from nothing


def test_compiled_modules_are_kept_where_python_may_not_write_them_beside_the_sources(tmp_path):
    (tmp_path / 'module.py').write_text('VALUE = 1\n')
    given = {**clean_environ(), 'PYTHONDONTWRITEBYTECODE': '1'}
    given.pop('PYTHONPYCACHEPREFIX', None)
    keep_bytecode(given, tmp_path)
    subprocess.run([sys.executable, '-c', 'import module'], cwd=tmp_path, env=given, check=True)
    assert not (tmp_path / '__pycache__').exists()
    assert list((tmp_path / 'build').rglob('module.*.pyc'))


def test_who_lets_python_write_its_compiled_modules_gets_them_beside_the_sources(tmp_path):
    given = {'PATH': os.environ['PATH']}
    keep_bytecode(given, tmp_path)
    assert given == {'PATH': os.environ['PATH']}


@pytest.mark.parametrize('in_the_way', ['a file', 'a full disk', 'another user'])
def test_where_compiled_modules_cannot_be_kept_all_stays_as_it_is(
    tmp_path, monkeypatch, in_the_way
):
    if in_the_way == 'a file':
        (tmp_path / 'build').write_text('')
    elif in_the_way == 'a full disk':
        full = shutil.disk_usage(tmp_path)._replace(free=10**6)
        monkeypatch.setattr(shutil, 'disk_usage', lambda _: full)
    else:
        monkeypatch.setattr(os, 'access', lambda *_: False)
    given = {'PYTHONDONTWRITEBYTECODE': '1'}
    keep_bytecode(given, tmp_path)
    assert given == {'PYTHONDONTWRITEBYTECODE': '1'}


def test_on_a_full_disk_nobody_writes_compiled_modules_that_would_be_cut_off(tmp_path, monkeypatch):
    full = shutil.disk_usage(tmp_path)._replace(free=10**6)
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: full)
    given = {'PYTHONPYCACHEPREFIX': str(tmp_path)}
    keep_bytecode(given, tmp_path)
    assert given.pop('PYTHONDONTWRITEBYTECODE') == '1'


def test_what_a_set_up_runs_leaves_no_compiled_modules_and_finds_those_of_pip(
    tmp_path, monkeypatch
):
    (tmp_path / 'module.py').write_text('VALUE = 1\n')
    monkeypatch.delenv('PYTHONDONTWRITEBYTECODE', raising=False)
    monkeypatch.setenv('PYTHONPYCACHEPREFIX', str(tmp_path / 'kept'))
    lock = os.open(tmp_path, os.O_RDONLY)
    try:
        code = (
            'import module, pathlib\n'
            "beside = pathlib.Path('__pycache__').absolute()\n"
            'assert pathlib.Path(module.__cached__).parent == beside'
        )
        words = [sys.executable, '-c', code]
        with (
            _Command(PythonEnvironment(tmp_path), words, lock) as command,
            SetUpStep(1, 1, 'import') as step,
        ):
            command.watch(step)
    finally:
        os.close(lock)
    assert not (tmp_path / 'kept').exists()
    assert not (tmp_path / '__pycache__').exists()


def test_the_processes_of_a_test_run_share_compiled_modules(tmp_path, monkeypatch):
    given = {'PATH': os.environ['PATH'], 'PYTHONDONTWRITEBYTECODE': '1'}
    started = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, 'environ', given)
    monkeypatch.setattr(os, 'execv', lambda _, words: started.append((words, dict(given))))
    monkeypatch.setattr(cli, '_environment', lambda extras: None)
    cli._test(['-x'])
    ((words, environ),) = started
    assert words[1:3] == ['-m', 'pytest']
    assert environ['PYTHONPYCACHEPREFIX'] == str(ROOT / 'build' / 'pycache')
    assert 'PYTHONDONTWRITEBYTECODE' not in environ
