from __future__ import annotations

import subprocess
import sys

import pytest

from launcher.cli import main, make_parser
from launcher.node_table import NODES
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
        (['--for', 'ever'], "'ever' is not a positive number of seconds"),
        (['--for', '-3'], '-3'),
        (['--domain', 'x'], 'domain'),
        (['--log-level', 'loud'], 'loud'),
        (['--behaviour', 'dance'], 'dance'),
        (['list', 'nodes'], 'nodes'),
        (['--speed', '9'], '--speed'),
    ],
)
def test_a_wrong_command_line_is_one_line_and_exit_code_2(arguments, wrong, capsys):
    assert main(arguments) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert error.startswith('launch.py: ')
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
    assert main([]) == 2
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
    assert options.composed
