"""Generated command lines: each value takes effect in the node, or costs one line.

    .venv/bin/python benchmarks/command_lines.py [--count 1000] [--seed 1]

Every line is `launch.py node NAME ...` with values by `-p`, `--params` and `--ros-args`, right and
wrong ones. What the command line makes of it starts the node in this process, and its parameters
are read back. The judge is ROS itself: a plain rclpy node that gets the same value by `-p` or from
the same file.
"""

from __future__ import annotations

import array
import contextlib
import importlib
import io
import json
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import mock

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import rclpy
import yaml

from benchmarks.sizes import sized_parser
from launcher import cli
from surveillance_runtime import node as runtime_node
from surveillance_runtime import node_table
from surveillance_runtime.configuration import read_schema, split_arguments
from surveillance_runtime.parameters import ParameterSpec
from surveillance_runtime.testing import claim_domain

ODD_VALUES = [
    *('nan', '.nan', 'inf', '.inf', '-.inf', '1e308', '1e400', '-0', '-0.0', '0x10', '0o17', '010'),
    *('1_000', '+5', '.5', '1.', '1e3', '1,5', '1.000.000', '99999999999999999999', '-1', '0', '1'),
    *('5', '0.5', '50', '3.0', '1:30', '2001-01-01', 'yes', 'no', 'on', 'off', 'True', 'TRUE'),
    *('true,', '"true"', "'5'", "'a'b", '""', "''", '~', 'null', 'soon', 'a:b', 'MANUAL', 'manual'),
    *(
        'random',
        'false',
        '[]',
        '[1]',
        '[1,2.5]',
        '[1,a]',
        '[a,b]',
        "['a']",
        '[true,false]',
        '[[1]]',
    ),
    *('{a:1}', '{a: 1}', '{}', '&a', '*a', '!!str', '!!int', '!!float', '!!bool', '!!timestamp x'),
    *('!!binary =', '!!set {}', '!!python/object:os.system', '!!int x', '!own 5', '#', '-', '?'),
    *(':', ',', ']', '}', '%', '@', '`', '|', '>', 'ü', '→', '\\n', 'a\tb', 'x' * 20_000),
]
"""Values as people type them by mistake, and as a fuzzer would."""


class Taken(BaseException):
    """The command line came to the end: these words start the node."""

    def __init__(self, words: list[str]) -> None:
        super().__init__()
        self.words = words


@dataclass(frozen=True)
class Line:
    """One command line for one node, and what it says about one parameter."""

    node: node_table.Node
    name: str
    words: list[str]
    winner: list[str]
    """The ROS arguments that decide, for the judge."""


@dataclass(frozen=True)
class Verdict:
    """What came of a line."""

    kind: str
    detail: str
    seconds: float


def value_of(rng: random.Random, spec: ParameterSpec | None) -> str:
    """Return a value: often one that fits, else any."""
    if spec is None or rng.random() < 0.5:
        return rng.choice(ODD_VALUES)
    if spec.choices:
        return str(rng.choice(spec.choices))
    low = spec.minimum if spec.minimum is not None else -10.0
    high = spec.maximum if spec.maximum is not None else low + 100.0
    low, high = max(low, -1e6), min(high, 1e6)
    number = rng.uniform(low - 1, high + 1)
    kind = spec.element or type(spec.default)
    text = {
        bool: rng.choice(('true', 'false')),
        int: str(int(number)),
        float: f'{number:.3f}' if rng.random() < 0.8 else str(int(number)),
        str: rng.choice(('text', 'E', "'two words'", '', '/tmp/x')),
    }[kind]
    return f'[{text}, {text}]' if spec.element else text


def misspelt(rng: random.Random, name: str) -> str:
    """Return a name that is nearly one."""
    at = rng.randrange(len(name))
    return name[:at] + name[at + 1 :] if len(name) > 1 else name * 2


def make_line(rng: random.Random, folder: Path, number: int) -> Line:
    """Return a command line."""
    schema = read_schema()
    node = rng.choice([each for each in node_table.NODES if each.name != node_table.CONSOLE])
    table = schema[node.name]
    known = [*table.parameters, 'use_sim_time']
    name = rng.choice(known)
    spec = table.spec(name)
    if rng.random() < 0.1:
        name = misspelt(rng, name)
    value, other = value_of(rng, spec), value_of(rng, spec)
    pattern = rng.choice(('/**', node.name, f'/**/{node.name}', f'/{node.name}', 'other', '/*'))
    file = folder / f'{number}.yaml'
    file.write_text(f'{pattern}:\n  ros__parameters:\n    {name}: {value}\n')
    plain = ['-p', f'{name}:={value}']
    from_file = ['--params-file', str(file)]
    words, winner = rng.choice(
        (
            (plain, plain),
            (['-p', f'{node.name}:{name}:={value}'], plain),
            (['--ros-args', *plain], plain),
            (['--params', str(file)], from_file),
            (['--ros-args', *from_file], from_file),
            (['--params', str(file), '-p', f'{name}:={other}'], ['-p', f'{name}:={other}']),
            (
                ['--ros-args', '-p', f'{name}:={other}', *from_file],
                ['-p', f'{name}:={other}'],
            ),
        )
    )
    return Line(node, name, ['node', node.name, *words], winner)


def by_ros(line: Line) -> tuple[str, Any]:
    """Return what a plain node makes of it: `refused`, `unset`, or `set` and the value."""
    context = rclpy.Context()
    try:
        context.init(args=['judge', '--ros-args', *line.winner])
        node = rclpy.create_node(
            line.node.name,
            context=context,
            enable_rosout=False,
            start_parameter_services=False,
            allow_undeclared_parameters=True,
            automatically_declare_parameters_from_overrides=True,
        )
    except Exception as error:
        # A null is no value to ROS, whichever node it is for.
        return ('unset' if 'NOT_SET' in str(error) else 'refused'), str(error)
    finally:
        if context.ok():
            context.try_shutdown()
    value = node.get_parameter(line.name).value if node.has_parameter(line.name) else None
    node.destroy_node()
    return ('unset', None) if value is None else ('set', value)


def by_the_command_line(line: Line) -> tuple[str, Any]:
    """Return what the project makes of it: `refused` and its lines, or `set` and the value."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        try:
            cli.main(line.words)
        except Taken as taken:
            words = taken.words
        else:
            return 'refused', said.getvalue()
        try:
            return read_back(line, words)
        except ValueError as error:  # what ends a node with one line
            return 'refused', f'{error}\n'


def read_back(line: Line, words: Sequence[str]) -> tuple[str, Any]:
    """Start the node as its process would, and read the parameter."""
    given = split_arguments(words[words.index('--ros-args') :])
    kind = getattr(importlib.import_module(line.node.module), line.node.class_name)
    rclpy.init(args=['node', *given.rest])
    runtime_node.give_arguments(given)
    try:
        node = kind()
        value = node.get_parameter(line.name).value if node.has_parameter(line.name) else None
        node.stop()
        node.destroy_node()
    finally:
        runtime_node.give_arguments(None)
        rclpy.shutdown()
    return 'set', list(value) if isinstance(value, array.array) else value


def judge(line: Line) -> Verdict:
    """Say whether the value took effect, was refused in one line, or neither."""
    expected, wanted = by_ros(line)
    before = time.perf_counter()
    try:
        got, value = by_the_command_line(line)
    except Exception as error:
        return Verdict('EXCEPTION', f'{type(error).__name__}: {error}', 0.0)
    seconds = time.perf_counter() - before
    if got == 'refused':
        one_line = value.count('\n') == 1 and 'Traceback' not in value
        return Verdict('one line' if one_line else 'MANY LINES', value.strip(), seconds)
    if expected == 'unset':  # the file is for other nodes
        return Verdict('for others', '', seconds)
    if isinstance(wanted, array.array):
        wanted = list(wanted)
    meant = [wanted, as_yaml(line)] if expected == 'set' else [as_yaml(line)]
    if any(value == each or str(value).upper() == str(each).upper() for each in meant):
        return Verdict('took effect', '', seconds)
    return Verdict('OTHER VALUE', f'{value!r}, ROS: {expected} {wanted!r}', seconds)


def as_yaml(line: Line) -> Any:
    """Return the value as YAML 1.1 has it: ROS's reader knows no `1_000` and no empty text."""
    word = line.winner[1]
    if line.winner[0] == '-p':
        text = word.partition(':=')[2]
        return yaml.safe_load(text) if text else ''
    (body,) = yaml.safe_load(Path(word).read_text('utf-8')).values()
    return body['ros__parameters'][line.name]


@contextlib.contextmanager
def caught() -> Iterator[None]:
    """Have the command line end where it would become the node's process."""

    def take(_file: str, words: list[str], _environ: object) -> None:
        raise Taken(words)

    with (
        mock.patch.object(cli, '_enter'),
        mock.patch('launcher.interrupt.hold_back'),
        mock.patch.object(cli, 'claim', return_value=[]),
        mock.patch.object(os, 'execve', take),
    ):
        yield


def run(count: int, seed: int) -> tuple[Counter[str], list[str], float]:
    """Judge lines; return how often each came out, the bad ones, and the longest time."""
    rng = random.Random(seed)
    outcomes: Counter[str] = Counter()
    bad: list[str] = []
    longest = 0.0
    os.environ['ROS_DOMAIN_ID'] = str(claim_domain())
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), caught():
        for number in range(count):
            line = make_line(rng, Path(folder), number)
            verdict = judge(line)
            outcomes[verdict.kind] += 1
            longest = max(longest, verdict.seconds)
            if verdict.kind.isupper():
                shown = json.dumps(line.words, ensure_ascii=False)
                bad.append(f'{verdict.kind}: {shown} {line.winner}: {verdict.detail}')
    return outcomes, bad, longest


def main() -> int:
    """Print a table of what came of the lines."""
    parser = sized_parser(__doc__, quick='100 lines')
    parser.add_argument('--count', type=int, default=1000)
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    outcomes, bad, longest = run(options.size.of(options.count, 100, 5), options.seed)
    for line in bad:
        print(line)
    for kind, number in outcomes.most_common():
        print(f'{kind:<12} {number:6}')
    print(f'longest, with the start of the node: {longest:.2f} s')
    return 1 if bad else 0


if __name__ == '__main__':
    sys.exit(main())
