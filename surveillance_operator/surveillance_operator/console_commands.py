"""The commands of the operator's console: what can be typed, and which action each one is.

The controllers' own commands (`battery`, `plan`, `move`) are handed on as they were typed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

from surveillance_controllers.manual.commands import (
    BATTERY,
    EXIT,
    HELP,
    MOTION,
    PLANNER,
    STATUS,
    Argument,
    Command,
    CommandError,
    Grammar,
    number,
)

if TYPE_CHECKING:  # the launcher's prompt needs the words alone, without ROS
    from surveillance_operator.mission_actions import MissionActions

CONTROLLED = {
    'battery_controller': BATTERY,
    'planner_controller': PLANNER,
    'motion_controller': MOTION,
}
"""The controllers with the commands that each of them understands itself."""
LIMIT = 10_000.0
"""Coordinates are within this many metres."""


def _word(name: str, expected: str) -> Argument:
    return Argument(name, expected, str)


def _rest(name: str, expected: str) -> Argument:
    return Argument(name, expected, str.split, takes_rest=True)


_PLACE = _word('ROOM', 'the name of a place like R3')
_X, _Y = number('X', -LIMIT, LIMIT, 'metres'), number('Y', -LIMIT, LIMIT, 'metres')

Do = Callable[..., str]


def _why_not(actions: MissionActions, place: str) -> str:
    text, premises = actions.why_not(place)
    return '\n'.join([text, *(f'  {premise}' for premise in premises)])


def _known(actions: MissionActions, place: str) -> str:
    """Return what is known of a place, with the proof of each derived fact."""
    lines = []
    for fact, asserted in actions.facts(place):
        if asserted:
            lines.append(f'{fact}  [asserted]')
        else:
            lines += ['  ' * depth + text for depth, text in actions.explain(fact)]
    return '\n'.join(lines) or f'nothing is known of {place}'


_COMMANDS: tuple[tuple[Command, Do], ...] = (
    (
        Command(('door', 'open'), (_word('DOOR', 'a door like D1'),), 'Open a door.'),
        lambda actions, door: actions.set_door(door, True),
    ),
    (
        Command(('door', 'close'), (_word('DOOR', 'a door like D1'),), 'Close a door.'),
        lambda actions, door: actions.set_door(door, False),
    ),
    (
        Command(
            ('obstacle', 'place'),
            (_word('NAME', 'a name'), _X, _Y, number('RADIUS', 0.01, 10.0, 'metres')),
            'Put a cylinder in the way.',
        ),
        lambda actions, *at: actions.place_obstacle(*at),
    ),
    (
        Command(('obstacle', 'remove'), (_word('NAME', 'its name'),), 'Take it away.'),
        lambda actions, name: actions.remove_obstacle(name),
    ),
    (
        Command(
            ('room', 'add'),
            (_word('ROOM', 'a new name'), _X, _Y, _rest('DOOR...', 'one door or more')),
            'Add a place to the map and the ontology.',
        ),
        lambda actions, *room: actions.add_room(*room),
    ),
    (
        Command(('room', 'remove'), (_PLACE,), 'Remove a place.'),
        lambda actions, place: actions.remove_room(place),
    ),
    (
        Command(
            ('battery', 'drain'),
            (number('PERCENT', 0.0, 100.0, 'percent'),),
            'Take charge out of the simulated battery.',
        ),
        lambda actions, percent: actions.drain_battery(percent),
    ),
    (
        Command(
            ('arm',), (_word('POSE', 'left, home, right, back or stop'),), 'Move the camera arm.'
        ),
        lambda actions, pose: actions.move_arm(pose),
    ),
    (
        Command(
            ('policy',), (_word('POLICY', 'a policy like tour'),), 'Set how places are chosen.'
        ),
        lambda actions, policy: actions.set_policy(policy),
    ),
    (
        Command(
            ('threshold',),
            (number('SECONDS', 0.0, 1e9, 'seconds'),),
            'Set after how long a place is URGENT.',
        ),
        lambda actions, seconds: actions.set_threshold(seconds),
    ),
    (Command(('go',), (_PLACE,), 'Send the robot there next.'), lambda a, place: a.go_to(place)),
    (Command(('home',), (), 'Call the robot home.'), lambda actions: actions.go_to('')),
    (Command(('pause',), (), 'Enter no further state.'), lambda a: a.machine('pause')),
    (Command(('step',), (), 'Enter one state, then pause.'), lambda a: a.machine('step')),
    (Command(('resume',), (), 'Go on.'), lambda a: a.machine('resume')),
    (
        Command(('why', 'not'), (_PLACE,), 'Say why the robot does not go there now.'),
        _why_not,
    ),
    (
        Command(('known',), (_PLACE,), 'Show what is known of a place, with its proofs.'),
        _known,
    ),
)
WHY = Command(('why',), (), 'Say why the robot goes where it goes.')
EXIT_NODE = 'exit NODE'
GRAMMAR = Grammar(
    (*(c for group in CONTROLLED.values() for c in group), *(c for c, _ in _COMMANDS))
)
_CONTROLLER_OF = {command.name: name for name, group in CONTROLLED.items() for command in group}
_DOES = {command.name: do for command, do in _COMMANDS}


@dataclass(frozen=True)
class Answer:
    """What came of a line.

    Attributes:
        text: For the operator.
        who: Which node said it; empty for the console itself.
        ends: Whether the console is to end.
    """

    text: str
    who: str = ''
    ends: bool = False


def help_text(columns: int = 1000) -> str:
    """Return every command with its arguments and what it does, in lines of that many columns."""
    usages = [
        *((command.usage, command.description) for command in GRAMMAR.commands),
        (WHY.usage, WHY.description),
        (EXIT_NODE, 'Stop one controller.'),
    ]
    width = max(len(usage) for usage, _ in usages)
    lines = []
    for usage, text in sorted(usages):
        first, *rest = wrap(text, max(20, columns - width - 4))
        lines += [f'  {usage:<{width}}  {first}', *(' ' * (width + 4) + line for line in rest)]
    return '\n'.join(lines)


def wrapped(text: str, columns: int) -> str:
    """Return a text in lines of that many columns; what is indented stays so."""
    lines = []
    for line in text.splitlines():
        indent = ' ' * (len(line) - len(line.lstrip()))
        further = indent + '    '
        lines += wrap(line, columns, subsequent_indent=further, break_on_hyphens=False) or ['']
    return '\n'.join(lines)


def completions(text: str) -> list[str]:
    """Return the words that can stand where the last word of `text` is being typed."""
    words = text.lower().split()
    if words[:1] == ['exit'] and (len(words) > 1 or text[-1:].isspace()):
        typed = words[1] if len(words) > 1 else ''
        return [name for name in CONTROLLED if name.startswith(typed)]
    return GRAMMAR.completions(text)


def answer(
    line: str, actions: MissionActions, why: Callable[[], str], columns: int = 1000
) -> list[Answer]:
    """Do what a line says, and return what came of it.

    Args:
        line: As it was typed.
        actions: Does it.
        why: The present decision in words.
        columns: Of the terminal.
    """
    words = line.split()
    if [word.lower() for word in words] == ['why']:
        return [Answer(why())]
    if len(words) == 2 and words[0].lower() == EXIT.name:
        return [_exit(words[1], actions)]
    try:
        command = GRAMMAR.parse(line)
    except CommandError as error:
        return [Answer(str(error))]
    if command is None:
        return []
    if command.name == HELP.name:
        return [Answer(help_text(columns))]
    if command.name == EXIT.name:
        return [Answer('', ends=True)]
    if command.name == STATUS.name:
        return [_told(actions, controller, line) for controller in CONTROLLED]
    if command.name in _CONTROLLER_OF:
        return [_told(actions, _CONTROLLER_OF[command.name], line)]
    try:
        return [Answer(_DOES[command.name](actions, *command.values))]
    except ValueError as error:
        return [Answer(f'{command.name}: {error}')]


def _exit(name: str, actions: MissionActions) -> Answer:
    if name not in CONTROLLED:
        return Answer(f'exit {name}: expected one of {", ".join(CONTROLLED)}')
    return _told(actions, name, EXIT.name)


def _told(actions: MissionActions, controller: str, line: str) -> Answer:
    try:
        return Answer(actions.command(controller, line), controller)
    except LookupError as error:  # it does not answer at all
        return Answer(f'{controller} does not answer: {error}')
    except ValueError as error:
        return Answer(str(error), controller)
