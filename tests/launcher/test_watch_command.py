"""The `watch` command as a process of its own."""

from __future__ import annotations

import os
import select
import sys
import termios

import pytest

from surveillance_operator.watch_command import main
from tests.launcher.test_console import Terminal

SHOW_CURSOR, FIRST_SCREEN = b'\x1b[?25h', b'\x1b[?1049l'
COMMAND = ['-m', 'surveillance_operator.watch_command']


@pytest.mark.parametrize(
    ('arguments', 'wrong'),
    [
        (['--domain', '102'], '--domain 102: expected a number from 0 to 101'),
        (['--timeout', '0'], '--timeout 0: expected 0.1 seconds or more'),
        (['--namespace', 'a b'], '--namespace /a b: expected letters'),
        (['--twice'], '--twice'),
    ],
)
def test_a_wrong_option_is_one_line_and_exit_code_2(arguments, wrong, capsys):
    with pytest.raises(SystemExit) as exit_info:
        main(arguments)
    assert exit_info.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith('watch: ')
    assert wrong in error
    assert error.count('\n') == 1


def test_once_without_a_mission_is_one_line_and_exit_code_1(start, ros_domain):
    process = start(*COMMAND, '--once', '--timeout', '0.1', '--domain', str(ros_domain))
    assert process.end()[0] == 1
    assert process.lines == [f'watch: no mission on ROS domain {ros_domain} within 0.1 s']


def test_ctrl_c_gives_the_terminal_back(ros_domain):
    terminal = Terminal([sys.executable, *COMMAND, '--domain', str(ros_domain)])
    try:
        terminal.until(rb'no mission yet')
        terminal.type('\x03')
        assert terminal.process.wait(60.0) == 0
        while select.select([terminal.ours], [], [], 0)[0]:
            terminal.seen += os.read(terminal.ours, 65536)
        assert terminal.seen.endswith(SHOW_CURSOR + FIRST_SCREEN)
        assert termios.tcgetattr(terminal.theirs) == terminal.settings
    finally:
        terminal.close()
