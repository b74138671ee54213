"""Shells complete commands and options."""

from __future__ import annotations

import subprocess

import pytest

from launcher.completion import SHELLS, options_in, script

pytestmark = pytest.mark.unit
OPTIONS = {'run': ['--mode', '--map'], 'report': ['--day', '--shift'], '': ['--version']}


def completed(*words: str, shell: str = 'bash') -> list[str]:
    quoted = ' '.join(f"'{word}'" for word in words)
    text = (
        f'COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _launch_py; echo "${{COMPREPLY[@]}}"'
    )
    done = subprocess.run(
        ['bash', '-c', script(shell, 'launch.py', OPTIONS) + text],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.split()


def test_commands_and_the_options_of_each_are_completed() -> None:
    assert completed('launch.py', 'rep') == ['report']
    assert completed('python3', 'launch.py', 'rep') == ['report']
    assert completed('./launch.py', 'report', '--s') == ['--shift']
    assert completed('launch.py', '--v') == ['--version']
    assert completed('launch.py', 'run', '--ma') == ['--map']
    assert all('_launch_py' in script(shell, 'launch.py', OPTIONS) for shell in SHELLS)


def test_options_are_found_in_a_help_text() -> None:
    assert options_in('usage: x [-h] [--day DAY]\n  --no-such-thing, not--this') == [
        '--day',
        '--no-such-thing',
    ]
