"""What a reader types from the documentation: real parsers, types and tables take it."""

from __future__ import annotations

import argparse
import importlib
import itertools
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from floor_plans import read_place
from launcher import cli
from surveillance_runtime.command_line import CommandParser
from surveillance_runtime.configuration import Configuration, argument_layer, file_layer
from surveillance_runtime.profile.reading import read_profile

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob('docs/**/*.md'), ROOT / 'README.md', ROOT / 'CONTRIBUTING.md'])
GENERATED = {'cli', 'parameters', 'interfaces'}
UNCHECKED = {
    'launch.py test': 'the words are those of pytest',
    'launch.py -p policy:=nearest': 'the reader has written this policy on the page',
    'pip': 'a program of others',
    'python3 -m venv': 'a program of others',
    '.venv/bin/pip': 'a program of others',
    '.venv/bin/python -m': 'a module of others, or a demo that a test of its library runs',
    'ros2 bag': 'a program of others, and recordings of the reader',
    'ros2 lifecycle': 'nodes of others (Nav2)',
    'curl': 'tests of the page ask for its addresses',
    'git': 'a program of others',
    'systemctl': 'a program of others',
    'loginctl': 'a program of others',
    'colcon': '.ci/colcon.py runs it',
    'rviz2': 'a program of others',
    'fastdds': 'a program of others',
    'cp': 'a program of others',
    'ls': 'a program of others',
    'cat': 'a program of others',
    'cd': 'a program of others',
    'grep': 'a program of others',
    'export': 'a variable of the shell',
    'eval': 'a word of the shell',
    'source': 'a word of the shell',
}
"""Beginnings of commands that nothing here checks, and why."""
FOREIGN = {'my_driver', 'robot_state_publisher', 'turtlebot3_bringup'}
"""Packages of others."""


class Typed(NamedTuple):
    """A command of a page."""

    page: str
    words: tuple[str, ...]


class ParsedError(Exception):
    """A command line was understood."""


def blocks(path: Path, *languages: str) -> Iterator[str]:
    """Yield the code blocks of a page in one of some languages."""
    text = path.read_text(encoding='utf-8')
    found = re.findall(r'^[ \t]*```(\w*)[^\n]*\n(.*?)^[ \t]*```', text, re.MULTILINE | re.DOTALL)
    for language, code in found:
        if language in languages:
            yield code


def typed() -> list[Typed]:
    """Return each command that a page has its reader type."""
    found = []
    for path in PAGES:
        if path.stem in GENERATED:
            continue
        lines = [line for code in blocks(path, 'sh') for line in joined(code)]
        for code in blocks(path, 'console', ''):
            lines += [line[2:] for line in joined(code) if line.startswith('$ ')]
        for line in lines:
            for part in line.split(' && '):
                words = shlex.split(re.split(r'\s[|>]\s|\s&$', part)[0], comments=True)
                while words and re.fullmatch(r'[A-Z_]+=.*', words[0]):
                    words = words[1:]
                if words:
                    found.append(Typed(path.stem, tuple(words)))
    return found


def joined(code: str) -> list[str]:
    """Return the commands of a block; one that is not closed goes on in the next line."""
    found = ['']
    for line in code.replace('\\\n', ' ').splitlines():
        found[-1] += f' {line}' if found[-1] else line
        if found[-1].count('"') % 2 == 0 or not found[-1].startswith(('$ ', 'ros2')):
            found.append('')
    return found


def reason(words: tuple[str, ...]) -> str:
    """Return why a command is not checked; empty: it is."""
    text = ' '.join(words).replace('python3 launch.py', 'launch.py')
    return next((why for begin, why in UNCHECKED.items() if f'{text} '.startswith(begin + ' ')), '')


COMMANDS = [each for each in dict.fromkeys(typed()) if not reason(each.words)]


def test_each_reason_not_to_check_is_used() -> None:
    texts = [' '.join(each.words).replace('python3 launch.py', 'launch.py') for each in typed()]
    unused = {b for b in UNCHECKED if not any(f'{t} '.startswith(b + ' ') for t in texts)}
    assert not unused


@pytest.mark.parametrize('each', COMMANDS, ids=lambda each: f'{each.page}: {" ".join(each.words)}')
def test_a_typed_command_is_understood(
    each: Typed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = list(each.words)
    monkeypatch.chdir(tmp_path)
    for path in PAGES:
        for code in blocks(path, 'yaml') if path.stem == each.page else ():
            if name := re.match(r'# (\S+\.yaml)\n', code):
                Path(name[1]).write_text(code, encoding='utf-8')
    if words[:2] == ['python3', 'launch.py']:
        launched(words[2:], monkeypatch)
    elif words[0] in ('python3', '.venv/bin/python', 'python'):
        script(each.page, words[1:])
    elif words[0].startswith('.ci/'):
        assert (ROOT / words[0]).is_file()
    elif words[0] == 'ros2':
        ros2(words[1:])
    else:
        raise AssertionError(f'{words[0]}: check it, or name it in UNCHECKED with a reason')


def launched(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the launcher's own parsers take the words; nothing is run."""
    parse = CommandParser.parse_args

    def parse_only(self: CommandParser, args: Any = None) -> argparse.Namespace:
        parse(self, args)
        raise ParsedError

    def not_reached(*_: object, **__: object) -> None:
        raise AssertionError('it goes on without a look at its words')

    monkeypatch.setattr(CommandParser, 'parse_args', parse_only)
    monkeypatch.setattr(cli, '_enter', lambda *_, **__: None)
    monkeypatch.setattr(cli.os, 'execv', not_reached)
    if '--ros-args' in words:
        words = words[: words.index('--ros-args')]
    with pytest.raises(ParsedError):
        cli._dispatch(words)
    for before, assigned in itertools.pairwise(words):
        if before == '-p':
            is_assignable(assigned)


def is_assignable(assignment: str) -> None:
    """Check the name and the value of a parameter by what the nodes declare."""
    Configuration((argument_layer([assignment]),)).check()


def script(page: str, words: list[str]) -> None:
    """Make sure that a script is there, and knows its options."""
    file = ROOT / words[0]
    if not file.is_file():
        named = re.compile(rf'^# {re.escape(words[0])}\b', re.MULTILINE)
        assert any(
            named.search(code)
            for path in PAGES
            if path.stem == page
            for code in blocks(path, 'python')
        ), f'{words[0]}: no such file'
        return
    text = file.read_text(encoding='utf-8')
    text += (ROOT / 'benchmarks' / 'sizes.py').read_text(encoding='utf-8')
    for word in words[1:]:
        if word == '--':
            break
        assert not word.startswith('--') or f"'{word}'" in text, f'{words[0]} knows no {word}'


def ros2(words: list[str]) -> None:
    """Compare words of ros2 with the nodes, interfaces and parameters that there are."""
    tables = (ROOT / 'docs' / 'reference' / 'interfaces.md').read_text(encoding='utf-8')
    match words:
        case ['service', 'call', name, kind, *given]:
            assert f'`{name.strip("/")}`' in tables, name
            fill(kind, 'Request', given)
        case ['topic', 'pub', *rest]:
            name, kind, *given = [w for w in rest if not w.startswith('--') and not w.isdigit()]
            assert f'`{name.strip("/")}`' in tables, name
            fill(kind, '', given)
        case ['topic', 'echo', name, *_]:
            assert f'`{name.strip("/")}`' in tables or name == '/diagnostics', name
        case ['param', 'set', node, name, value]:
            is_assignable(f'{node.strip("/")}:{name}:={value}')
        case ['run', package, program, *rest]:
            if package in FOREIGN:
                return
            setup = (ROOT / package / 'setup.py').read_text(encoding='utf-8')
            assert re.search(rf"'{program} ?= ?", setup) or f"'{program}'" in setup, program
            for before, assigned in itertools.pairwise(rest):
                if before == '-p':
                    is_assignable(f'{program}:{assigned}')
        case ['launch', package, file, *given]:
            if package in FOREIGN:
                return
            text = (ROOT / package / 'launch' / file).read_text(encoding='utf-8')
            for each in given:
                name, _, _ = each.partition(':=')
                assert name == '--show-args' or f"'{name}'" in text, f'{file} takes no {name}'
        case _:
            raise AssertionError(f'ros2 {" ".join(words)}: check it, or say why not')


def fill(kind: str, part: str, given: list[str]) -> None:
    """Fill a message's fields with what is typed."""
    package, folder, name = kind.split('/')
    type_ = getattr(importlib.import_module(f'{package}.{folder}'), name)
    put(getattr(type_, part) if part else type_, yaml.safe_load(given[0]) if given else {})


def put(type_: Any, values: dict[str, Any]) -> None:
    message = type_()
    for name, value in values.items():
        known = message.get_fields_and_field_types()
        assert name in known, f'{type_.__name__} has no field {name}: {sorted(known)}'
        if isinstance(value, dict):
            put(type(getattr(message, name)), value)
        else:
            was = getattr(message, name)
            setattr(message, name, float(value) if isinstance(was, float) else value)


FILES = [
    (path.stem, number, code) for path in PAGES for number, code in enumerate(blocks(path, 'yaml'))
]
CHECKED_ELSEWHERE = {'rules', 'sinks', 'stage'}
"""First keys of files that `test_words.py` and `test_stage_page.py` hand to their readers."""


@pytest.mark.parametrize(('page', 'number', 'code'), FILES, ids=lambda e: str(e)[:24])
def test_a_file_of_a_page_has_known_keys(page: str, number: int, code: str, tmp_path: Path) -> None:
    table = yaml.safe_load(code)
    first = next(iter(table))
    file = tmp_path / 'file.yaml'
    if first in CHECKED_ELSEWHERE:
        return
    if first == '/**':
        file.write_text(code, encoding='utf-8')
        read_place(file)
    elif first in ('topics', 'body', 'frames', 'dock', 'types', 'drive'):
        file.write_text(code, encoding='utf-8')
        read_profile(file)
    elif page == 'markers':
        own = yaml.safe_load((ROOT / 'config' / 'markers.yaml').read_text(encoding='utf-8'))
        known = {key for each in own['markers'].values() for key in each}
        assert {key for each in table['markers'].values() for key in each} <= known
    else:
        own = [text for where, _, text in FILES if where == page and '\n/**:' in f'\n{text}']
        seven = (ROOT / 'config' / 'seven_rooms.yaml').read_text(encoding='utf-8')
        place = yaml.safe_load(own[0] if own and page == 'first_patrol' else seven)
        if 'stations' in table:
            del place['/**']['ros__parameters']['station']
        place['/**']['ros__parameters'] |= table
        file.write_text(yaml.safe_dump(place), encoding='utf-8')
        read_place(file)
        assert file_layer(file)
