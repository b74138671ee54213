"""The page "Your robot has Nav2": its commands are understood, and what it quotes is said."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from surveillance_runtime.profile import read_profile

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / 'docs' / 'how-to' / 'nav2.md').read_text('utf-8')
SOURCES = '\n'.join(
    path.read_text('utf-8')
    for package in ('surveillance_controllers', 'surveillance_runtime', 'surveillance_operator')
    for path in sorted((ROOT / package / package).rglob('*.py'))
)


@pytest.mark.parametrize(
    'words',
    [
        'is not installed',
        'the patrol waits for it',
        'is not there',
        'Nav2 has not moved the robot for',
        'another program, RViz perhaps, has a goal on',
        'has more than one type',
        'undocking: ',
        'docking: ',
        'nobody tells where the robot points',
    ],
)
def test_a_message_that_it_explains_is_one_that_is_said(words: str) -> None:
    assert words.strip() in PAGE or words.rpartition(' on')[0] in PAGE
    assert words in SOURCES


def test_its_profile_is_one() -> None:
    profile = read_profile(ROOT / 'config' / 'robots' / 'nav2.yaml').profile
    assert profile.dock.navigator == 'nav2'
    known = {'topics', 'frames', 'types', 'body', 'drive', 'battery', 'dock'}
    table = PAGE.partition('| Key |')[2].partition('\n\n')[0]
    named = set(re.findall(r'^\| `(\w+)', table, re.MULTILINE))
    assert named <= known


def test_its_options_are_those_of_the_commands() -> None:
    commands = {
        line.split()[2] if not line.split()[2].startswith('-') else ''
        for line in PAGE.splitlines()
        if line.startswith('python3 launch.py')
    }
    assert commands == {'import', 'setup', 'doctor', ''}
    for command in commands:
        words = [sys.executable, 'launch.py', *filter(None, [command]), '--help']
        said = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for line in PAGE.splitlines():
            if line.startswith(f'python3 launch.py {command or "--"}'):
                for option in re.findall(r'--[a-z]+', line):
                    assert option in said, (line, option)


def test_its_place_reads_as_yaml() -> None:
    line = next(each for each in PAGE.split('`') if each.startswith('stations:'))
    assert yaml.safe_load(line)['stations']['E']['dock'] == 'bay'
