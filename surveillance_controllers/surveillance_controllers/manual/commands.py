"""The language of the operator's consoles: which commands exist, and how a typed line is read.

A console speaks a `Grammar`: a list of `Command`, each a few fixed words followed by typed
arguments. `Grammar.parse` turns one line into a `ParsedCommand` or raises `CommandError`, whose
text names the word that was wrong and what was expected in its place. The same grammar answers
`help` and proposes completions.

The commands of the three controllers are defined here, in `BATTERY`, `PLANNER` and `MOTION`, so
that each controller's own console and the one console for all of them cannot drift apart.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from lidar_navigation import geometry
from lidar_navigation.geometry import Points
from strict_files.suggestions import nearest

Point3 = tuple[float, float, float]
"""x, y, z in metres, world frame."""

LONGEST_LINE = 20_000
"""A line beyond this many characters is refused unread; 20,000 hold a plan of about a thousand
points."""


class CommandError(ValueError):
    """A line that is no command; the text is one line, meant for the operator."""


@dataclass(frozen=True)
class CommandArgument:
    """One typed value of a command.

    Attributes:
        name: As shown in the help, in capitals.
        expected: What a good value is, completing the sentence "expected ...".
        read: Turns the text into the value; raises `ValueError` with a detail (or an empty text).
        takes_rest: The argument takes the rest of the line, blanks included.
        known: Values to propose, from the arguments before it.
    """

    name: str
    expected: str
    read: Callable[[str], object]
    takes_rest: bool = False
    known: Callable[..., Iterable[str]] = lambda *_: ()


@dataclass(frozen=True)
class Command:
    """Fixed words, the arguments after them, and a sentence for the help."""

    words: tuple[str, ...]
    arguments: tuple[CommandArgument, ...]
    description: str

    @property
    def name(self) -> str:
        """The fixed words, as one text: `battery set`."""
        return ' '.join(self.words)

    @property
    def usage(self) -> str:
        """The command as it is typed: `battery set VALUE`."""
        return ' '.join((*self.words, *(argument.name for argument in self.arguments)))


@dataclass(frozen=True)
class ParsedCommand:
    """A command that was understood: its name and the values of its arguments."""

    name: str
    values: tuple[object, ...] = ()


def integer(name: str, low: int, high: int) -> CommandArgument:
    """Return an argument that is a whole number from `low` to `high`."""

    def read(text: str) -> int:
        if not re.fullmatch(r'[+-]?\d{1,9}', text, re.ASCII) or not low <= int(text) <= high:
            raise ValueError
        return int(text)

    return CommandArgument(name, f'a whole number from {low} to {high}', read)


def number(name: str, low: float, high: float, unit: str) -> CommandArgument:
    """Return an argument that is a real number from `low` to `high`."""

    def read(text: str) -> float:
        value = _real(text)
        if not low <= value <= high:
            raise ValueError
        return value

    return CommandArgument(name, f'a number from {low:.10g} to {high:.10g} ({unit})', read)


def points(name: str) -> CommandArgument:
    """Return an argument that is a list of points, `[[x, y, z], ...]`, possibly empty."""
    return CommandArgument(
        name, 'a list of points as [[x, y, z], ...]', _read_points, takes_rest=True
    )


def _real(text: str) -> float:
    value = float(text) if re.fullmatch(r'[+-]?[\d.]+([eE][+-]?\d+)?', text, re.ASCII) else math.nan
    if not math.isfinite(value):
        raise ValueError
    return value


def _read_points(text: str) -> tuple[Point3, ...]:
    tokens: list[str] = [*re.findall(r'\[|\]|,|[^\[\],\s]+', text), '']

    def take(place: str, *wanted: str) -> str:
        found = tokens.pop(0)
        if found not in wanted:
            raise ValueError(f'{_found(found)} {place}, where {wanted[-1]!r} belongs')
        return found

    def coordinate(place: str) -> float:
        found = tokens.pop(0)
        try:
            return _real(found)
        except ValueError:
            raise ValueError(f'{_found(found)} {place}, where a number belongs') from None

    result: list[Point3] = []
    take('at the start', '[')
    more = tokens[0] != ']' or take('', ']') == ','
    while more:
        place = f'in point {len(result) + 1}'
        take(place, '[')
        x = coordinate(place)
        take(place, ',')
        y = coordinate(place)
        take(place, ',')
        z = coordinate(place)
        take(place, ']')
        result.append((x, y, z))
        more = take(f'after point {len(result)}', ',', ']') == ','
    if tokens[0]:
        raise ValueError(f'{tokens[0]!r} after the list')
    return tuple(result)


def _found(token: str) -> str:
    return repr(token) if token else 'the end of the line'


HELP = Command(('help',), (), 'List the commands.')
STATUS = Command(('status',), (), 'Show the request that waits for a command, if there is one.')
EXIT = Command(('exit',), (), "Stop this console's node.")
BUILT_IN = (HELP, STATUS, EXIT)
"""Commands every console has."""

BATTERY_SET = Command(
    ('battery', 'set'), (integer('VALUE', 0, 100),), 'Set the battery level, in percent.'
)
BATTERY_OFFSET = Command(
    ('battery', 'offset'),
    (integer('OFFSET', -100, 100),),
    'Add to the battery level, in percent; the level stays between 0 and 100.',
)
PLAN_SET = Command(
    ('plan', 'set'),
    (points('[[X,Y,Z],...]'),),
    'Answer the waiting request with these points between its start and its goal, in metres.',
)
MOVE = Command(
    ('move',),
    (number('TIME', 0, 86_400, 'seconds'), number('DELTA', -1000, 1000, 'metres')),
    'Carry out the waiting request in TIME s; stop at most DELTA m off the goal on each axis.',
)
BATTERY = (BATTERY_SET, BATTERY_OFFSET)
PLANNER = (PLAN_SET,)
MOTION = (MOVE,)


class Grammar:
    """What one console understands.

    Args:
        commands: The console's own commands; `help`, `status` and `exit` are always added.
    """

    def __init__(self, commands: Sequence[Command]) -> None:
        self.commands = (*commands, *BUILT_IN)

    def parse(self, line: str) -> ParsedCommand | None:
        """Read one line.

        Words may be in any case. A blank line, and one that begins with `#`, is no command.

        Raises:
            CommandError: The line is no command of this console.
        """
        if len(line) > LONGEST_LINE:
            raise CommandError(f'a line of {len(line)} characters: expected at most {LONGEST_LINE}')
        words = line.split()
        if not words or words[0].startswith('#'):
            return None
        command = self._command_of(words)
        return ParsedCommand(command.name, _read_arguments(command, line))

    def _command_of(self, words: Sequence[str]) -> Command:
        fitting: tuple[Command, ...] = self.commands
        for depth, word in enumerate((*words, '')):
            longer = tuple(c for c in fitting if c.words[depth : depth + 1] == (word.lower(),))
            if not longer:
                raise CommandError(_no_command(words, depth, fitting))
            fitting = longer
            if len(fitting) == 1 and len(fitting[0].words) == depth + 1:
                break
        return fitting[0]

    def help(self) -> str:
        """Return every command with its arguments and what it does, one a line."""
        width = max(len(command.usage) for command in self.commands)
        return '\n'.join(f'  {c.usage:<{width}}  {c.description}' for c in self.commands)

    def completions(self, text: str) -> list[str]:
        """Return the words that can stand where the last word of `text` is being typed, in
        alphabetical order.
        """
        words = text.split()
        if not text or text[-1].isspace():
            words.append('')
        *done, typed = words
        found: set[str] = set()
        for command in self.commands:
            count = len(command.words)
            if list(command.words[: len(done)]) != [each.lower() for each in done[:count]]:
                continue
            if len(done) < count:
                found.add(command.words[len(done)])
            elif len(done) - count < len(command.arguments):
                found.update(command.arguments[len(done) - count].known(*done[count:]))
        return sorted(each for each in found if each.lower().startswith(typed.lower()))


def _no_command(words: Sequence[str], depth: int, fitting: Sequence[Command]) -> str:
    """Say that no command goes on as the words do from `depth` on."""
    expected = [command.words[depth] for command in fitting if len(command.words) > depth]
    before = ' '.join(words[:depth])
    where = f' after {before!r}' if before else ''
    if depth == len(words):
        return f'the line ends{where}: expected {_alternatives(expected)}'
    found = words[depth]
    return f'{_shown(found)}{where} is no command: expected {nearest(found.lower(), expected)}'


def _read_arguments(command: Command, line: str) -> tuple[object, ...]:
    rest = line.split(maxsplit=len(command.words))[len(command.words) :]
    remaining = rest[0].strip() if rest else ''
    values: list[object] = []
    for argument in command.arguments:
        if not remaining:
            raise CommandError(
                f'{command.name}: {argument.name} is missing: expected {argument.expected}'
            )
        if argument.takes_rest:
            text, remaining = remaining, ''
        else:
            text, _, remaining = remaining.partition(' ')
            remaining = remaining.strip()
        try:
            values.append(argument.read(text))
        except ValueError as error:
            detail = f' ({error})' if str(error) else ''
            raise CommandError(
                f'{command.name}: {argument.name} is {_shown(text)}{detail}: '
                f'expected {argument.expected}'
            ) from None
    if remaining:
        raise CommandError(
            f'{command.name}: {_shown(remaining)} is too much: expected {command.usage!r}'
        )
    return tuple(values)


def _shown(text: str) -> str:
    return repr(text if len(text) <= 60 else text[:57] + '...')


def _alternatives(words: Sequence[str]) -> str:
    unique = list(dict.fromkeys(words))
    if len(unique) == 1:
        return repr(unique[0])
    return ', '.join(map(repr, unique[:-1])) + f' or {unique[-1]!r}'


MOST_POINTS = 12
"""Of a longer path only the first and last points are shown."""


def point(coordinates: Iterable[float]) -> str:
    """Return a point in metres: `(10, 5, 0)`."""
    return '(' + ', '.join(f'{c:.4g}' for c in coordinates) + ')'


def path_request(what: str, start: Points, goal: Points) -> str:
    """Return the text for a path that the operator shall give."""
    return (
        f'New request: {what}\n'
        f'  start {point(start)}, goal {point(goal)}, '
        f'{geometry.length([start, goal]):.2f} m apart\n'
        '  Answer with: plan set [[x,y,z],...]   (the points between start and goal)'
    )


def move_request(what: str, path: Points) -> str:
    """Return the text for a motion that the operator shall carry out."""
    shown = [point(p) for p in path]
    if len(shown) > MOST_POINTS:
        half = MOST_POINTS // 2
        shown = [*shown[:half], f'... {len(path) - 2 * half} more ...', *shown[-half:]]
    return (
        f'New request: {what}\n'
        f'  start {point(path[0])}, goal {point(path[-1])}, '
        f'{geometry.length(path):.2f} m along {len(path)} point{"s" * (len(path) > 1)}\n'
        f'  path {" ".join(shown)}\n'
        '  Answer with: move TIME DELTA   (seconds, metres)'
    )
