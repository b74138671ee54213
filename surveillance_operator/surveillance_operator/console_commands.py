"""The commands of the operator's console: what can be typed, and which action each one is.

The controllers' own commands (`battery`, `plan`, `move`) are handed on as they were typed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING, Protocol

from state_machines.exceptions import CallError, UnavailableError
from strict_files.suggestions import nearest
from surveillance_controllers.manual.commands import (
    BATTERY,
    EXIT,
    HELP,
    MOTION,
    PLANNER,
    STATUS,
    Command,
    CommandArgument,
    CommandError,
    Grammar,
    ParsedCommand,
    number,
)
from surveillance_runtime.configuration import declared, read_schema
from surveillance_runtime.parameters import ParameterSpec, shown

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


def _word(
    name: str, expected: str, known: Callable[..., Iterable[str]] = lambda: ()
) -> CommandArgument:
    return CommandArgument(name, expected, str, known=known)


def _rest(name: str, expected: str) -> CommandArgument:
    return CommandArgument(name, expected, str.split, takes_rest=True)


_DOOR = _word('DOOR', 'a door like D1')
_PLACE = _word('ROOM', 'the name of a place like R3')
_NODE = _word('NODE', 'a node like robot_behavior', read_schema)


def _parameters(node: str) -> Mapping[str, ParameterSpec]:
    return schema.parameters if (schema := read_schema().get(node)) else {}


def _live(node: str) -> list[str]:
    return [name for name, spec in _parameters(node).items() if not spec.read_only]


def _choices(node: str, name: str) -> Iterable[str]:
    spec = _parameters(node).get(name)
    return map(str, spec.choices) if spec else ()


_POSES = ('left', 'home', 'right', 'back', 'stop')
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
    return '\n'.join(lines)


def _list_parameters(actions: MissionActions, node: str) -> str:
    """Return a node's parameters with the values that they have now; live ones are marked."""
    declared(node, 'use_sim_time')
    values, live = actions.parameters(node), _live(node)
    width = max(map(len, values), default=0)
    return '\n'.join(
        f'{"*" if name in live else " "} {name:<{width}}  {shown(value)}'
        for name, value in values.items()
    )


def _get_parameter(actions: MissionActions, node: str, name: str) -> str:
    """Return a parameter's value now, what it means, and whether it can be changed now."""
    spec = declared(node, name)
    values = actions.parameters(node)
    if name not in values:
        raise ValueError(f'{node} does not have {name} in this mode')
    change = f'param set {node} {name} VALUE'
    if spec.read_only:
        change = f'only when {node} starts, as launch.py -p {node}:{name}:=VALUE'
    return (
        f'{name} is {shown(values[name])}\n  {spec.description}\n'
        f'  expected: {spec.expected()}\n  change it: {change}'
    )


def _command(words: str, text: str, do: Do, *arguments: CommandArgument) -> tuple[Command, Do]:
    return Command(tuple(words.split()), arguments, text), do


_COMMANDS = (
    _command('door open', 'Open a door.', lambda a, door: a.set_door(door, True), _DOOR),
    _command('door close', 'Close a door.', lambda a, door: a.set_door(door, False), _DOOR),
    _command(
        'obstacle place',
        'Put a cylinder in the way.',
        lambda a, *at: a.place_obstacle(*at),
        *(_word('NAME', 'a name'), _X, _Y, number('RADIUS', 0.01, 10.0, 'metres')),
    ),
    _command(
        'obstacle remove',
        'Take it away.',
        lambda a, name: a.remove_obstacle(name),
        _word('NAME', 'its name'),
    ),
    _command(
        'stage',
        'Change the simulated place.',
        lambda a, words: a.stage(' '.join(words)),
        _rest('LINE...', 'a line like: box parcel 2.0 1.5'),
    ),
    _command(
        'events', 'List what the observer has noticed and is open.', lambda a: a.event('events')
    ),
    *(
        _command(
            word,
            text,
            lambda a, number, word=word: a.event(f'{word} {number}'),
            _word('NUMBER', "an event's number"),
        )
        for word, text in (
            ('acknowledge', 'Say that somebody takes care of an event.'),
            ('normal', 'Say that an event is normal from now on.'),
            ('false', 'Say that an event was a false alarm.'),
        )
    ),
    _command(
        'room add',
        'Add a place to the map and the ontology.',
        lambda a, *room: a.add_room(*room),
        *(_word('ROOM', 'a new name'), _X, _Y, _rest('DOOR...', 'one door or more')),
    ),
    _command('room remove', 'Remove a place.', lambda a, place: a.remove_room(place), _PLACE),
    _command(
        'battery drain',
        'Take charge out of the simulated battery.',
        lambda a, percent: a.drain_battery(percent),
        number('PERCENT', 0.0, 100.0, 'percent'),
    ),
    _command(
        'arm',
        'Move the camera arm.',
        lambda a, pose: a.move_arm(pose),
        _word(
            'POSE',
            'left, home, right, back or stop',
            lambda: _POSES,
        ),
    ),
    _command(
        'policy',
        'Set how places are chosen.',
        lambda a, policy: a.set_policy(policy),
        _word('POLICY', 'a policy like tour', lambda: _choices('robot_behavior', 'policy')),
    ),
    _command(
        'threshold',
        'Set after how long a place is URGENT.',
        lambda a, seconds: a.set_threshold(seconds),
        _word('SECONDS', 'seconds'),
    ),
    _command('go', 'Send the robot there next.', lambda a, place: a.go_to(place), _PLACE),
    _command('home', 'Call the robot home.', lambda a: a.go_to('')),
    _command(
        'stop',
        'Stop the robot, whoever commands it, until `release`.',
        lambda a: a.stop(True),
    ),
    _command('release', 'Let a stopped robot move again.', lambda a: a.stop(False)),
    _command(
        'out',
        "Take the robot out of its fleet's patrol; the others have its places.",
        lambda a: a.take_out(True),
    ),
    _command('in', 'Put it back.', lambda a: a.take_out(False)),
    _command('pause', 'Stand, and enter no further state.', lambda a: a.machine('pause')),
    _command('step', 'Enter one state, then pause.', lambda a: a.machine('step')),
    _command('resume', 'Go on.', lambda a: a.machine('resume')),
    _command('approve', 'Let the transition be made that waits for you.', lambda a: a.approve()),
    _command(
        'choose',
        'Go on with another outcome in its place.',
        lambda a, outcome: a.approve(outcome),
        _word('OUTCOME', 'an outcome of the state'),
    ),
    _command(
        'autonomy',
        'Set what the robot does without asking.',
        lambda a, level: a.set_autonomy(level),
        _word('LEVEL', 'off, low, high or full', lambda: ('off', 'low', 'high', 'full')),
    ),
    _command('why not', 'Say why the robot does not go there now.', _why_not, _PLACE),
    _command('param list', "Show a node's parameters; * can be set now.", _list_parameters, _NODE),
    _command(
        'param get',
        'Show one, what it means, what it can be.',
        _get_parameter,
        *(_NODE, _word('NAME', 'a parameter', _parameters)),
    ),
    _command(
        'param set',
        'Set a parameter of a running node.',
        lambda a, *given: a.set_parameter(*given),
        *(_NODE, _word('NAME', 'a parameter', _live)),
        CommandArgument('VALUE', 'a value', str, takes_rest=True, known=_choices),
    ),
    _command('known', 'Show what is known of a place, with its proofs.', _known, _PLACE),
)
ALL_WORDS = ('pause', 'go', 'stop', 'release', 'out', 'in')
_ROBOTS = Command(('robots',), (), 'Show the robots of a fleet.')
_ROBOT = Command(
    ('robot',), (_word('NAME', 'the name of a robot'),), 'Speak to this robot of a fleet.'
)
_ALL = Command(
    ('all',),
    (_word('WORD', ', '.join(ALL_WORDS), lambda: ALL_WORDS),),
    'Have all robots of a fleet do it.',
)
WHY = Command(('why',), (), 'Say why the robot goes where it goes.')
EXIT_NODE = 'exit NODE'
GRAMMAR = Grammar(
    (
        *(c for group in CONTROLLED.values() for c in group),
        *(c for c, _ in _COMMANDS),
        *(_ROBOTS, _ROBOT, _ALL),
    )
)
_CONTROLLER_OF = {command.name: name for name, group in CONTROLLED.items() for command in group}
_DOES = {command.name: do for command, do in _COMMANDS}


@dataclass(frozen=True)
class Reply:
    """What came of a line.

    Attributes:
        text: For the operator.
        who: Which node said it; empty for the console itself.
        ends: Whether the console is to end.
    """

    text: str
    who: str = ''
    ends: bool = False


class ConsoleMission(Protocol):
    """The mission that a console speaks to: one robot of it, and all of them."""

    def why(self) -> str:
        """Return why the robot goes where it goes."""

    def figures(self) -> str:
        """Return the figures of its mission in one line; empty: none is known."""

    def lines(self) -> list[str]:
        """Return what each robot does; raises `ValueError` where there is one only."""

    def choose(self, robot: str) -> str:
        """Speak to a robot from now on; raises `ValueError` where there is none of that name."""

    def tell_all(self, word: str) -> str:
        """Have all do one of `ALL_WORDS`; raises `ValueError` or `CallError`."""


def is_for_robot(line: str) -> bool:
    """Tell whether a line needs the robot that is spoken to."""
    words = line.lower().split()
    of_all = (_ROBOTS.name, _ROBOT.name, _ALL.name, HELP.name)
    return bool(words) and words[0] not in of_all and words != [EXIT.name]


def help_text(columns: int = 1000) -> str:
    """Return every command with its arguments and what it does, in lines of that many columns."""
    usages = [
        *((each.usage, each.description) for each in GRAMMAR.commands if each is not EXIT),
        (WHY.usage, WHY.description),
        (EXIT.usage, 'Leave; in the terminal of a run: end the run.'),
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
    line: str,
    actions: MissionActions,
    mission: ConsoleMission,
    columns: int = 1000,
) -> list[Reply]:
    """Do what a line says, and return what came of it.

    Args:
        line: As it was typed.
        actions: Does it.
        mission: The robot that is spoken to, and all of them.
        columns: Of the terminal.
    """
    words = line.split()
    if [word.lower() for word in words] == ['why']:
        return [Reply(mission.why())]
    if len(words) == 2 and words[0].lower() == EXIT.name:
        return [_exit(words[1], actions)]
    try:
        command = GRAMMAR.parse(line)
    except CommandError as error:
        return [Reply(str(error))]
    if command is None:
        return []
    if command.name == HELP.name:
        return [Reply(help_text(columns))]
    if command.name == EXIT.name:
        return [Reply('', ends=True)]
    if command.name == STATUS.name:
        known = [Reply(said)] if (said := mission.figures()) else []
        return [*known, *(_sent(actions, controller, line) for controller in CONTROLLED)]
    if command.name in _CONTROLLER_OF:
        return [_sent(actions, _CONTROLLER_OF[command.name], line)]
    try:
        if command.name in (_ROBOTS.name, _ROBOT.name, _ALL.name):
            return [Reply(_of_fleet(command, mission))]
        return [Reply(_DOES[command.name](actions, *command.values))]
    except (ValueError, CallError) as error:
        return [Reply(f'{command.name}: {error}')]


def _of_fleet(command: ParsedCommand, fleet: ConsoleMission) -> str:
    if command.name == _ROBOTS.name:
        return '\n'.join(fleet.lines())
    word = str(command.values[0])
    if command.name == _ROBOT.name:
        return fleet.choose(word)
    if word not in ALL_WORDS:
        raise ValueError(f'{word!r}: expected {nearest(word, ALL_WORDS)}')
    return fleet.tell_all(word)


def _exit(name: str, actions: MissionActions) -> Reply:
    if name not in CONTROLLED:
        return Reply(f'exit {name}: expected {nearest(name, CONTROLLED)}')
    return _sent(actions, name, EXIT.name)


def _sent(actions: MissionActions, controller: str, line: str) -> Reply:
    try:
        return Reply(actions.command(controller, line), controller)
    except UnavailableError as error:
        return Reply(str(error))
    except CallError as error:
        return Reply(f'{controller} does not answer: {error}')
    except ValueError as error:
        return Reply(str(error), controller)
