from __future__ import annotations

import os
import subprocess
import sys

import pytest

from launcher.cli import main, runs_folder
from launcher.run import make_parser
from surveillance_runtime.node_table import NODES
from tests.launcher.conftest import ROOT


@pytest.mark.parametrize(
    ('arguments', 'wrong'),
    [
        (['fly'], "unknown command 'fly'"),
        (['--mode', 'fast'], "invalid choice: 'FAST'"),
        (['--only', 'armor'], "unknown node 'armor'"),
        (['--without', 'armor_server,nobody'], "unknown node 'nobody'"),
        (['node', 'nobody'], "unknown node 'nobody'"),
        (['node', 'motion_controller', '--mode', 'fast'], "invalid choice: 'FAST'"),
        (['node', 'motion_controller', '-p', 'navigator'], '-p navigator: expected NAME:=VALUE'),
        (['node', 'motion_controller', '-p', 'navigater:=own'], "expected 'navigator'"),
        (['--only', ','], "',' names no node"),
        (['node', 'Armor_Server'], "unknown node 'Armor_Server': expected 'armor_server'"),
        (['--memory', '99'], "'99' is not a number of megabytes from 100, or 0"),
        (['--keep', 'inf'], "'inf' is not a number of gigabytes"),
        (['--for', 'ever'], "'ever' is not a positive number of seconds"),
        (['--for', '-3'], '-3'),
        (['--domain', 'x'], 'domain'),
        (['--log-level', 'loud'], 'loud'),
        (['--behaviour', 'dance'], 'dance'),
        (['list', 'nodes'], 'nodes'),
        (['--speed', '9'], "unknown option '--speed': expected one of --help, --mode"),
        (['--policy', 'x'], "unknown option '--policy': expected one of --help, --mode"),
        (['--behavior', 'patrol'], "unknown option '--behavior': expected '--behaviour'"),
        (['--web', '8123'], "unexpected word '8123'"),
        (['test', '-x', 'libs/state_machines/tests/test_stat.py::test_x'], "expected '"),
        (['wacth'], "unknown command 'wacth': expected 'watch'"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_exit_code_2(arguments, wrong, capsys):
    code: object
    try:
        code = main(arguments)
    except SystemExit as ended:
        code = ended.code
    error = capsys.readouterr().err
    assert code == 2
    assert error.count('\n') == 1
    assert error.startswith(('launch.py: ', f'{arguments[0]}: '))
    assert wrong in error


def test_an_encoding_without_the_character_and_a_closed_output_are_no_errors():
    environ = {'PYTHONPATH': str(ROOT), 'PYTHONIOENCODING': 'ascii', 'COLUMNS': '80'}
    for arguments in (['fl\u00fcg'], ['list']):
        program = f'from launcher.cli import main; raise SystemExit(main({arguments!r}))'
        for closing in ('', 'exec >&- 2>&-; '):
            script = f'{closing}exec "{sys.executable}" -c "{program}"'
            done = subprocess.run(['bash', '-c', script], env=environ, capture_output=True)
            assert done.returncode == (0 if arguments == ['list'] else 2), done.stderr
            assert b'Traceback' not in done.stderr


def test_a_folder_that_cannot_be_written_is_one_line(monkeypatch, capsys):
    def full(_argv):
        raise PermissionError(13, 'Permission denied', '/some/where')

    monkeypatch.setattr('launcher.cli._dispatch', full)
    assert main([]) == os.EX_TEMPFAIL
    assert capsys.readouterr().err == 'launch.py: /some/where: Permission denied\n'


def test_list_names_every_node(capsys):
    assert main(['list']) == 0
    output = capsys.readouterr().out
    assert all(node.name in output and node.package in output for node in NODES)


def test_the_options_of_a_run():
    options = make_parser().parse_args(
        ['--mode', 'manual', '--for', '2.5', '--without', 'armor_server,reasoner', '--composed']
    )
    assert options.mode == 'MANUAL'
    assert options.seconds == 2.5
    assert options.without == ['armor_server', 'reasoner']
    assert options.processes == 'one'


def test_a_middleware_that_is_not_installed_is_said_in_one_line_and_does_without():
    words = [sys.executable, 'launch.py', 'node', 'armor_server', '-p', 'store:=none']
    words += ['--ros-args', '-p', 'nonsense:=1']
    environ = {**os.environ, 'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp'}
    done = subprocess.run(words, cwd=ROOT, env=environ, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    first, second = done.stderr.splitlines()
    assert 'RMW_IMPLEMENTATION: rmw_cyclonedds_cpp is not installed' in first
    assert "unknown parameter 'nonsense'" in second


@pytest.mark.parametrize(
    'environ',
    [
        {
            'LANG': 'C',
            'LC_ALL': 'C',
            'HOME': '/nonexistent',
            'TMPDIR': '/nonexistent',
            'XDG_RUNTIME_DIR': '/nonexistent',
            'TERM': 'dumb',
            'COLUMNS': '0',
            'NOTIFY_SOCKET': '/nonexistent',
        },
        {
            'LC_ALL': 'xx_XX.ISO-8859-1',
            'HOME': '',
            'XDG_RUNTIME_DIR': 'relative',
            'COLUMNS': 'wide',
            'LINES': '-1',
            'http_proxy': 'http://127.0.0.1:9',
            'https_proxy': 'nonsense',
            'ROS_LOCALHOST_ONLY': '1',
        },
        {'PYTHONPATH': '/nonexistent', 'PYTHONHOME': '', 'ROS_DOMAIN_ID': ''},
        {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'NONSENSE', 'RMW_IMPLEMENTATION': '../../x'},
    ],
)
def test_a_hostile_environment_works_or_costs_one_line(environ):
    program = 'import sys; from launcher.cli import main; sys.exit(main(sys.argv[1:]))'
    words = [sys.executable, '-c', program, 'params', 'reasoner', '-p', 'urgency_threshold:=77']
    given = {**os.environ, 'PYTHONPATH': str(ROOT)} | environ
    if 'PYTHONPATH' in environ:
        words[1:3] = ['launch.py']
    done = subprocess.run(words, cwd=ROOT, env=given, capture_output=True, text=True, timeout=60)
    assert 'Traceback' not in done.stderr
    assert done.stderr.count('\n') <= 1
    if done.returncode == 0:
        assert 'urgency_threshold' in done.stdout
    else:
        assert done.returncode == 2


@pytest.mark.parametrize('domain', ['200', '-1', 'x', '1e3'])
def test_a_domain_of_the_environment_that_is_none_costs_one_line(domain, monkeypatch, capsys):
    monkeypatch.setattr('launcher.cli._enter', lambda _argv: None)
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert main(['node', 'reasoner']) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert f'ROS_DOMAIN_ID: got {domain!r}' in error


def test_the_runs_of_a_read_only_checkout_lie_in_the_users_folder(tmp_path, monkeypatch):
    assert runs_folder(tmp_path) == tmp_path / 'runs'
    monkeypatch.setattr(os, 'access', lambda _path, _mode: False)
    monkeypatch.setenv('XDG_STATE_HOME', '/state')
    assert str(runs_folder(tmp_path)) == '/state/surveillance/runs'
