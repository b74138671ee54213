"""Command lines that are not understood cost one line."""

from __future__ import annotations

import pytest

from surveillance_runtime import run_options
from surveillance_runtime.command_line import CommandParser


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--speeed', '3'], "unknown option '--speeed': expected '--speed'"),
        (['--speeed=3'], "unknown option '--speeed': expected '--speed'"),
        (['fast'], "unexpected word 'fast'"),
        (
            ['--web', '0.0.0.0:80'],
            "unexpected word '0.0.0.0:80': --web takes no value, expected --web-address 0.0.0.0:80",
        ),
        (['--quiet', 'x'], "unexpected word 'x'"),
        (['--speed'], 'argument --speed: expected one argument'),
    ],
)
def test_a_line_that_is_not_understood_costs_one_line(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    parser = CommandParser(prog='launch.py drive')
    parser.add_argument('--speed')
    parser.add_argument('--web', action='store_true')
    parser.add_argument('--web-control', action='store_true')
    parser.add_argument('--web-address')
    parser.add_argument('--quiet', action='store_true')
    assert parser.parse_args(['--speed', '3', '--web']).speed == '3'
    with pytest.raises(SystemExit) as ended:
        parser.parse_args(words)
    assert ended.value.code == 2
    assert capsys.readouterr().err == f'drive: {said} (see launch.py drive --help)\n'


def test_a_run_without_a_simulator_leaves_it_out() -> None:
    assert run_options.left_out('none', ['reasoner']) == ('reasoner', 'simulator')
    assert run_options.left_out('kinematic', ['reasoner']) == ('reasoner',)
    assert run_options.left_out('mujoco', []) == ()
