"""Which environment a checkout takes, and what a set-up changes in one, without any pip."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from launcher import environment as module
from launcher.environment import (
    FOLDERS,
    INTERFACES,
    SPACE,
    PythonEnvironment,
    SetUpJournal,
    _Command,
    clean_environ,
    complete,
    keep_bytecode,
    requirements,
    users_of,
)
from launcher.progress import SetUpStep
from surveillance_runtime.launch_protocol import NotNowError


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    project = '[project]\ndependencies = ["one==1", "patrol_policy==0.1"]\n'
    project += '[project.optional-dependencies]\ntest = ["two"]\nmujoco = ["three"]\n'
    (tmp_path / 'pyproject.toml').write_text(project)
    (tmp_path / INTERFACES).mkdir()
    (tmp_path / 'libs' / 'owl_reasoner').mkdir(parents=True)
    (tmp_path / 'libs' / 'owl_reasoner' / 'pyproject.toml').write_text(
        '[project]\ndependencies = ["one==1", "four", "armor_service"]\n'
    )
    return tmp_path


def venv(checkout: Path, name: str, *extras: str, python: str = '') -> Path:
    """Make what looks like a complete environment, of this interpreter or of another one."""
    folder = checkout / name
    (folder / 'bin').mkdir(parents=True)
    (folder / 'bin' / 'python').write_text('')
    journal = complete(checkout, extras)
    journal.python = python or journal.python
    journal.write(folder)
    return folder


def test_libraries_of_the_checkout_are_not_installed_but_what_they_need_is(checkout: Path) -> None:
    assert requirements(checkout, []) == ['one==1', 'four']
    assert requirements(checkout, ['mujoco']) == ['one==1', 'three', 'four']


def test_the_complete_environment_is_taken_with_the_extras_it_has(checkout: Path) -> None:
    assert PythonEnvironment(checkout).venv == checkout / '.venv'
    assert not PythonEnvironment(checkout).ready()
    venv(checkout, '.venv', python='3.9 /opt')
    second = venv(checkout, '.venv-3.11-1', 'test')
    (checkout / '.venv.link').symlink_to(second)
    chosen = PythonEnvironment(checkout)
    assert (chosen.venv, chosen.ready()) == (second, True)
    assert chosen.python == second / 'bin' / 'python'
    assert not chosen.active()
    assert not PythonEnvironment(checkout, extras=['mujoco']).ready(), 'that extra is not there'
    (second / 'bin' / 'python').unlink()
    assert not PythonEnvironment(checkout).ready()


def test_one_in_use_and_one_of_another_interpreter_are_left_alone(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[Path] = []
    monkeypatch.setattr(module, 'users_of', lambda folder: [7] if folder in used else [])
    version = f'{sys.version_info.major}.{sys.version_info.minor}'

    def chosen() -> str:
        environment = PythonEnvironment(checkout)
        environment._choose()
        return environment.venv.name

    assert chosen() == '.venv'
    first = venv(checkout, '.venv')
    assert chosen() == '.venv'
    (checkout / INTERFACES / 'A.msg').write_text('int32 a\n')  # no longer complete
    assert chosen() == '.venv', 'it is brought up to date'
    used.append(first)
    assert chosen() == f'.venv-{version}-1'
    other = venv(checkout, f'.venv-{version}-1', python='3.9 /opt')
    assert chosen() == f'.venv-{version}-2', 'of another interpreter'
    (other / 'bin' / 'python').unlink()
    assert chosen() == f'.venv-{version}-1', 'whose interpreter is gone'
    complete_one = venv(checkout, f'.venv-{version}-2')
    used.append(complete_one)
    assert chosen() == complete_one.name, 'what is complete may be in use'


def test_the_link_leads_to_the_one_set_up_last_and_old_ones_go(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[Path] = []
    monkeypatch.setattr(module, 'users_of', lambda folder: [7] if folder in used else [])
    old, foreign = venv(checkout, '.venv-a'), venv(checkout, '.venv-b', python='3.9 /opt')
    busy = venv(checkout, '.venv-c')
    used.append(busy)
    (checkout / INTERFACES / 'A.msg').write_text('int32 a\n')
    new = venv(checkout, '.venv-d')
    environment = PythonEnvironment(checkout)
    environment._settle()
    assert [each.exists() for each in (old, foreign, busy, new)] == [False, True, True, True]
    assert (checkout / '.venv').readlink() == Path('.venv-d')
    environment._settle()
    assert (checkout / '.venv').resolve() == new
    assert not (checkout / '.venv.link').is_symlink()


def test_of_two_complete_ones_the_one_with_less_goes_when_nobody_runs_in_it(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # What `test` leaves that was started beside a mission.
    first = venv(checkout, '.venv')
    second = venv(checkout, '.venv-3.11-1', 'test')
    used = [first]
    monkeypatch.setattr(module, 'users_of', lambda folder: [7] if folder in used else [])
    environment = PythonEnvironment(checkout)
    assert environment.venv == second
    environment.prepare()
    assert first.exists(), 'a mission runs in it'
    used.clear()
    environment.prepare()
    assert first.is_symlink()
    assert first.resolve() == second
    assert [each.name for each in environment._folders()] == [second.name]


def test_a_new_one_begins_with_what_the_one_in_use_has(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = venv(checkout, '.venv')
    (first / 'pyvenv.cfg').write_text(f'prompt = {first}\n')
    (first / 'bin' / 'tool').write_text(f'#!{first}/bin/python\n')
    (first / 'lib').mkdir()
    (first / 'lib' / 'module.py').write_text(f'{first}\n')
    (first / 'bin' / 'program').write_bytes(os.fsencode(f'{first}\0'))
    python = SetUpJournal.read(first).python
    environment = PythonEnvironment(checkout)
    assert environment._seed(python) is None, 'there is one already'
    environment.venv = checkout / '.venv-3.11-1'
    assert environment._seed(python) is None, 'nobody uses the other one'
    monkeypatch.setattr(module, 'users_of', lambda folder: [42, 43])
    assert environment._seed('3.9 /opt') is None, 'it is of another interpreter'
    assert environment._seed(python) == (first, 42)
    new = environment.venv
    assert (new / 'bin' / 'tool').read_text() == f'#!{new}/bin/python\n'
    assert (new / 'pyvenv.cfg').read_text() == f'prompt = {new}\n'
    assert (first / 'bin' / 'tool').read_text() == f'#!{first}/bin/python\n'
    assert (new / 'lib' / 'module.py').samefile(first / 'lib' / 'module.py'), 'shared'
    assert (new / 'bin' / 'program').read_bytes() == os.fsencode(f'{first}\0'), 'a program stays'
    assert sorted(each.name for each in checkout.glob('.*')) == ['.venv', '.venv-3.11-1']


def test_who_runs_in_an_environment_is_found(tmp_path: Path) -> None:
    assert users_of(tmp_path) == []
    own = users_of(Path(sys.prefix))
    assert os.getpid() not in own


def test_what_was_half_installed_is_taken_away(checkout: Path) -> None:
    environment = PythonEnvironment(checkout)
    site = environment._site_packages()
    version = f'python{sys.version_info.major}.{sys.version_info.minor}'
    assert site == checkout / '.venv' / 'lib' / version / 'site-packages'
    for name in ('whole-1.dist-info', 'half-1.dist-info', '~aside'):
        (site / name).mkdir(parents=True)
    (site / 'whole-1.dist-info' / 'RECORD').write_text('')
    (site / '~file').write_text('')
    (site / 'module.py').write_text('')
    environment._remove_half_installed()
    assert sorted(each.name for each in site.iterdir()) == ['module.py', 'whole-1.dist-info']
    environment._write_path_file()
    lines = (site / 'surveillance_checkout.pth').read_text().splitlines()
    assert lines == [str(checkout / folder) for folder in FOLDERS]
    assert lines[0].endswith('libs/strict_files')
    assert lines[-1].endswith('surveillance_operator')


def test_without_room_on_the_disk_nothing_is_begun(
    checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[Any] = []
    monkeypatch.setattr(PythonEnvironment, '_carry_out', lambda *words: begun.append(words))
    monkeypatch.setattr(PythonEnvironment, '_write_path_file', lambda _: None)
    disk = shutil.disk_usage(checkout)
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: disk._replace(free=SPACE - 1))
    environment = PythonEnvironment(checkout)
    with pytest.raises(NotNowError, match=r'\.venv: the set-up needs 900 MB, 899 MB are free on'):
        environment._set_up(0)
    assert begun == []
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: disk._replace(free=SPACE))
    (checkout / '.venv').mkdir()
    environment._set_up(0)
    ((_, titles, journal, wanted, _),) = begun
    assert titles == [module.VENV_STEP, module.PACKAGES_STEP, module.INTERFACES_STEP]
    assert SetUpJournal.read(checkout / '.venv').python == wanted.python
    assert journal.working == ''


def test_a_middleware_that_is_not_installed_is_left_out_with_a_line(checkout: Path) -> None:
    environment = PythonEnvironment(checkout)
    (checkout / '.venv' / 'lib').mkdir(parents=True)
    (checkout / '.venv' / 'lib' / 'librmw_cyclonedds_cpp.so').write_text('')
    given = {
        'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp',
        'RCL_ASSERT_RMW_ID_MATCHES': 'rmw_zenoh_cpp',
        'OTHER': 'x',
    }
    assert environment.drop_missing_middleware(given) == [
        'environment variable RCL_ASSERT_RMW_ID_MATCHES: rmw_zenoh_cpp is not installed in .venv, '
        'going on with its own middleware, rmw_fastrtps_cpp'
    ]
    assert given == {'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp', 'OTHER': 'x'}
    assert environment.drop_missing_middleware({'RMW_IMPLEMENTATION': ''}) == []


def test_a_folder_without_wheels_is_said(tmp_path: Path, checkout: Path) -> None:
    with pytest.raises(ValueError, match=r'--wheels .*none: expected a folder of wheels'):
        PythonEnvironment(checkout, wheels=tmp_path / 'none')
    (tmp_path / 'some').mkdir()
    with pytest.raises(ValueError, match=r'no wheel \(\*\.whl\) in it: fill it on a machine with'):
        PythonEnvironment(checkout, wheels=tmp_path / 'some')
    (tmp_path / 'some' / 'a.whl').write_text('')
    assert PythonEnvironment(checkout, wheels=tmp_path / 'some').wheels == tmp_path / 'some'


@pytest.mark.parametrize(
    ('printed', 'reason'),
    [
        ('', 'no output'),
        ('one\ntwo', 'two'),
        ('error: one\nERROR: two\nthree', 'ERROR: two'),
        (
            'error: x\nSSLError y',
            'the package index was not trusted (TLS certificate): is a proxy in between?',
        ),
        ('ERROR: Errno 28', 'no space left for {venv}, which takes 900 MB'),
        ('NewConnectionError\nerror: z', 'error: z (is this machine online?)'),
    ],
)
def test_why_a_step_failed_is_told_in_one_line(checkout: Path, printed: str, reason: str) -> None:
    environment = PythonEnvironment(checkout)
    environment.venv.mkdir()
    code = f'import sys; print({printed!r}); sys.exit(3)'
    lock = os.open(checkout, os.O_RDONLY)
    try:
        with (
            SetUpStep(1, 1, 'fail') as step,
            _Command(environment, [sys.executable, '-S', '-c', code], lock) as command,
            pytest.raises(NotNowError) as found,
        ):
            command.watch(step)
    finally:
        os.close(lock)
    log = environment.venv / 'setup.log'
    reason = reason.format(venv=environment.venv)
    assert str(found.value) == (
        f'the set-up stopped: {reason} (more in {log}); the next start continues'
    )
    assert log.read_text().strip() == printed


def test_what_belongs_to_another_ros_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {
        'PATH': '/bin',
        'PYTHONPATH': '/opt/ros/lib',
        'VIRTUAL_ENV': '/x',
        'ROS_DISTRO': 'humble',
        'LD_LIBRARY_PATH': '/opt/ros/humble/lib::/usr/local/lib',
    }
    monkeypatch.setattr(os, 'environ', given)
    assert clean_environ() == {'PATH': '/bin', 'LD_LIBRARY_PATH': '/usr/local/lib'}
    given['LD_LIBRARY_PATH'] = '/usr/lib:'
    assert clean_environ()['LD_LIBRARY_PATH'] == '/usr/lib:'
    given['_ROS_WHEELS_BOOTSTRAP_COMPLETE'] = '1'
    assert clean_environ() == {'PATH': '/bin'}


@pytest.mark.parametrize(('free', 'kept'), [(100_000_000, True), (99_999_999, False)])
def test_compiled_modules_are_kept_where_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, free: int, kept: bool
) -> None:
    disk = shutil.disk_usage(tmp_path)._replace(free=free)
    monkeypatch.setattr(shutil, 'disk_usage', lambda _: disk)
    given = {'PYTHONDONTWRITEBYTECODE': '1'}
    keep_bytecode(given, tmp_path)
    assert ('PYTHONPYCACHEPREFIX' in given) is kept
    assert ('PYTHONDONTWRITEBYTECODE' in given) is not kept
    elsewhere = {'PYTHONDONTWRITEBYTECODE': '1', 'PYTHONPYCACHEPREFIX': '/kept'}
    keep_bytecode(elsewhere, tmp_path)
    assert elsewhere['PYTHONPYCACHEPREFIX'] == '/kept'
