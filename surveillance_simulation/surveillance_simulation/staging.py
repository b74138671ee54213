"""What happens in a simulated place, said in lines: by a person, or by a script at its times.

    door D1 ajar 30
    box parcel 9.2 4.1
    walk thief 8.0 8.0 12.0 8.0
    lamp R2 off

A script is a YAML file:

    stage:
      the cleaner forgets the door:
        at: daily 21:30          # day 3 21:30; mon 21:30; 90 s after the start
        do: door D1 ajar 40      # or a list of lines
        for: 45 min              # then the lines of `then` are done
        then: door D1 closed

Times are those of the clock that the robot's nodes have, in local time, as in watch.yaml. Each line
that is carried out is also written to the truth, a file that no node reads.
"""

from __future__ import annotations

import heapq
import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from floor_plans import Marker, PlaceError
from strict_files.suggestions import nearest
from strict_files.yaml_file import EntryError, read_table
from surveillance_simulation.robot.robot import Robot
from surveillance_simulation.world.figures import person
from surveillance_simulation.world.textures import marker_panel
from surveillance_simulation.world.things import Thing, barrel, box, chair

AJAR = 30.0
"""How far a door is ajar where nothing is said, degrees."""
FURTHEST = 1e4
"""Greatest coordinate, metres."""
USAGE: Mapping[str, str] = {
    'door': 'door NAME open|closed|ajar [DEGREES]',
    'barrel': 'barrel NAME X Y [RADIUS]',
    'box': 'box NAME X Y [SIDE [HEIGHT]]',
    'chair': 'chair NAME X Y [DEGREES]',
    'person': 'person NAME X Y [DEGREES]',
    'walk': 'walk NAME X Y X Y [X Y ...]',
    'remove': 'remove NAME',
    'marker': 'marker NAME whole|broken|covered|gone, or moved|copy X Y Z DEGREES',
    'lamp': 'lamp PLACE|all on|off|BRIGHTNESS',
    'lens': 'lens clear|covered',
}
"""Each line by its first word."""


class Stage:
    """Carries out lines on a robot and its world, and a script at its times.

    Args:
        robot: The robot in its world.
        truth: Takes one line of JSON for each thing done.
        script: What happens when.
        start: When the simulation began, seconds since 1970 of the nodes' clock.
    """

    def __init__(
        self,
        robot: Robot,
        truth: Callable[[str], object] = lambda _: None,
        script: Sequence[Happening] = (),
        start: float = 0.0,
    ) -> None:
        self._robot = robot
        self._truth = truth
        self._script = tuple(script)
        self.start = start
        self._lines: dict[tuple[str, str], str] = {}
        self._due: list[tuple[float, int, tuple[str, ...], int]] = []
        self._count = 0
        for index, each in enumerate(self._script):
            self._plan(index, each.times.first(start))

    def do(self, line: str, stamp: float) -> str:
        """Carry out a line, and return what was done.

        Args:
            line: See `USAGE`.
            stamp: Now, seconds since 1970 of the nodes' clock.

        Raises:
            PlaceError: What was wrong, and what was expected; nothing was done.
        """
        words = line.split()
        if not words or words[0] not in USAGE:
            given = words[0] if words else ''
            raise PlaceError((), f'stage: got {given!r}, expected {nearest(given, USAGE)}')
        told = getattr(self, f'_{words[0]}')(words[1:])
        self._remember(words)
        self.note(' '.join(words), told, stamp)
        return str(told['text'])

    def note(self, line: str, told: Mapping[str, Any], stamp: float) -> None:
        """Write to the truth what was done by other means."""
        self._truth(json.dumps({'at': round(stamp, 3), 'line': line, **told}))

    def forget(self, kind: str, subject: str) -> None:
        """Forget what was staged of a door, thing, marker or lamp: it was changed otherwise."""
        self._lines.pop((kind, subject), None)
        if kind == 'thing':
            self._robot.walks.end(subject)

    def advance(self, stamp: float) -> list[str]:
        """Carry out what the script has for the time up to now; return what was done or refused."""
        said = []
        while self._due and self._due[0][0] <= stamp:
            at, _, lines, index = heapq.heappop(self._due)
            if index >= 0:
                happening = self._script[index]
                self._plan(index, happening.times.after(at, self.start))
                if happening.then:
                    self._push(at + happening.lasts, happening.then, -1)
            for line in lines:
                try:
                    said.append(self.do(line, at))
                except PlaceError as error:
                    said.append(f'stage: {line}: {error}')
                    self.note(line, {'refused': str(error)}, at)
        return said

    # --- over restarts ---

    def state(self) -> str:
        """Return what was staged and still is, and when it began, for `restore`."""
        return json.dumps({'start': self.start, 'lines': list(self._lines.values())})

    def restore(self, kept: str, stamp: float) -> None:
        """Stage again what `state` gave; what the script had before now is not done again.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        values = json.loads(kept)
        start, lines = float(values['start']), [str(each) for each in values['lines']]
        if not math.isfinite(start):
            raise ValueError('expected when it began')
        self.start, self._due = start, []
        for line in lines:
            try:
                self.do(line, stamp)
            except PlaceError:
                continue  # of another place
        for index, each in enumerate(self._script):
            self._plan(index, each.times.after(stamp, start))
            began = each.times.before(stamp, start)
            if each.then and began is not None and began + each.lasts > stamp:
                self._push(began + each.lasts, each.then, -1)

    def _plan(self, index: int, at: float) -> None:
        if math.isfinite(at):
            self._push(at, self._script[index].lines, index)

    def _push(self, at: float, lines: tuple[str, ...], index: int) -> None:
        self._count += 1
        heapq.heappush(self._due, (at, self._count, lines, index))

    def _remember(self, words: Sequence[str]) -> None:
        """Keep the last line of each subject: they make the same stage again."""
        kind, subject = words[0], words[1] if len(words) > 1 else ''
        if kind in ('door', 'marker', 'lamp', 'lens'):
            if kind == 'lamp' and subject == 'all':
                self._lines = {k: v for k, v in self._lines.items() if k[0] != 'lamp'}
            key = (kind, '' if kind == 'lens' else subject)
            if kind == 'marker' and words[2] == 'copy':
                key = (kind, f'copy of {subject}')
        else:
            key = ('thing', subject)
        self._lines.pop(key, None)
        if kind != 'remove':
            self._lines[key] = ' '.join(words)

    # --- the lines ---

    def _door(self, words: Sequence[str]) -> dict[str, Any]:
        usage = USAGE['door']
        name, state, *rest = _at_least(words, 2, usage)
        world = self._robot.world
        if state not in ('open', 'closed', 'ajar') or len(rest) > (state == 'ajar'):
            raise PlaceError((), f'door {name}: got {" ".join(words[1:])!r}, expected {usage}')
        if state == 'ajar':
            world.turn_door(name, _number(rest[0], usage) if rest else AJAR)
        else:
            world.set_door(name, state == 'open')
        door = world.plan.doors[name]
        angle = world.door_angle(name)
        shown = f' by {angle:g} degrees' if state == 'ajar' else ''
        return _told('door', name, state, (door.x, door.y), f'door {name} is {state}{shown}')

    def _barrel(self, words: Sequence[str]) -> dict[str, Any]:
        name, x, y, radius = _placed(words, USAGE['barrel'], 0.2)
        return self._put(barrel(name, x, y, radius))

    def _box(self, words: Sequence[str]) -> dict[str, Any]:
        name, x, y, side, height = _placed(words, USAGE['box'], 0.3, 0.3)
        return self._put(box(name, x, y, 0.0, side, side, height))

    def _chair(self, words: Sequence[str]) -> dict[str, Any]:
        name, x, y, degrees = _placed(words, USAGE['chair'], 0.0)
        return self._put(chair(name, x, y, math.radians(degrees)))

    def _person(self, words: Sequence[str]) -> dict[str, Any]:
        name, x, y, degrees = _placed(words, USAGE['person'], 0.0)
        return self._put(person(name, x, y, math.radians(degrees)))

    def _put(self, thing: Thing) -> dict[str, Any]:
        world = self._robot.world
        if not world.regions.grid.contains(world.regions.grid.cells_of([(thing.x, thing.y)])).all():
            raise PlaceError((), f'{thing.kind} {thing.name}: expected a point in the place')
        state = 'moved' if thing.name in world.things else 'appeared'
        self._robot.walks.end(thing.name)
        world.put(thing)
        where = thing.x, thing.y
        text = f'{thing.kind} {thing.name} stands at ({thing.x:.2f}, {thing.y:.2f})'
        return _told(thing.kind, thing.name, state, where, text)

    def _walk(self, words: Sequence[str]) -> dict[str, Any]:
        usage = USAGE['walk']
        name, *rest = _at_least(words, 5, usage)
        if len(rest) % 2:
            raise PlaceError((), f'walk {name}: got {len(rest)} numbers, expected {usage}')
        numbers = [_number(each, usage) for each in rest]
        points = tuple(zip(numbers[::2], numbers[1::2], strict=True))
        self._robot.walks.begin(name, points)
        return _told('person', name, 'walks', points[0], f'person {name} walks about')

    def _remove(self, words: Sequence[str]) -> dict[str, Any]:
        name = _exactly(words, 1, USAGE['remove'])[0]
        world = self._robot.world
        thing = world.things.get(name)
        world.remove_obstacle(name)
        self._robot.walks.end(name)
        assert thing is not None
        return _told(
            thing.kind, name, 'removed', (thing.x, thing.y), f'{thing.kind} {name} is gone'
        )

    def _marker(self, words: Sequence[str]) -> dict[str, Any]:
        usage = USAGE['marker']
        name, state, *rest = _at_least(words, 2, usage)
        world = self._robot.world
        if state not in ('moved', 'copy'):
            _exactly(words, 2, usage)
            world.set_marker(name, state)
            panel = world.panels[name].marker
            where = panel.x, panel.y
            return _told('marker', str(panel.id), state, where, f'marker {name} is {state}')
        if name not in world.panels:
            known = nearest(name, world.panels) if world.panels else 'a place with markers'
            raise PlaceError((), f"there is no marker '{name}': expected {known}")
        x, y, z, degrees = (_number(each, usage) for each in _exactly(rest, 4, usage))
        panel = world.panels[name].marker
        new = name if state == 'moved' else f'{name} copy'
        marker_panel(world.plan.marker_dictionary, panel.id, 'whole')
        world.hang_marker(Marker(new, panel.id, x, y, z, math.radians(degrees), panel.size))
        does = 'hangs' if state == 'moved' else 'hangs a second time'
        text = f'marker {name} {does} at ({x:.2f}, {y:.2f})'
        return _told('marker', str(panel.id), 'double' if state == 'copy' else state, (x, y), text)

    def _lamp(self, words: Sequence[str]) -> dict[str, Any]:
        usage = USAGE['lamp']
        name, value = _exactly(words, 2, usage)
        brightness = {'on': 1.0, 'off': 0.0}.get(value)
        if brightness is None:
            brightness = _number(value, usage)
        world = self._robot.world
        for place in world.plan.place.positions if name == 'all' else (name,):
            world.set_lamp(place, brightness)
        state = {0.0: 'off', 1.0: 'on'}.get(brightness, f'{brightness:g}')
        return _told('light', name, state, None, f'the lamp of {name} is {state}')

    def _lens(self, words: Sequence[str]) -> dict[str, Any]:
        (state,) = _exactly(words, 1, USAGE['lens'])
        if state not in ('clear', 'covered'):
            raise PlaceError((), f'lens: got {state!r}, expected clear or covered')
        self._robot.lens_covered = state == 'covered'
        return _told('view', 'lens', state, None, f'the lens is {state}')


def _told(
    kind: str, subject: str, state: str, where: tuple[float, float] | None, text: str
) -> dict[str, Any]:
    place = {} if where is None else {'position': [round(each, 3) for each in where]}
    return {'kind': kind, 'subject': subject, 'state': state, **place, 'text': text}


def _at_least(words: Sequence[str], count: int, usage: str) -> Sequence[str]:
    if len(words) < count:
        raise PlaceError((), f'stage: got {len(words)} words, expected {usage}')
    return words


def _exactly(words: Sequence[str], count: int, usage: str) -> Sequence[str]:
    if len(words) != count:
        raise PlaceError((), f'stage: got {len(words)} words, expected {usage}')
    return words


def _number(word: str, usage: str) -> float:
    try:
        number = float(word)
    except ValueError:
        number = math.nan
    if not abs(number) <= FURTHEST:  # also false for NaN
        raise PlaceError((), f'stage: got {word[:40]!r} for a number, expected {usage}')
    return number


def _placed(words: Sequence[str], usage: str, *defaults: float) -> Any:
    """Return a name, x, y, and further numbers or their defaults."""
    _at_least(words, 3, usage)
    if len(words) > 3 + len(defaults):
        raise PlaceError((), f'stage: got {len(words)} words, expected {usage}')
    numbers = [_number(each, usage) for each in words[1:]]
    return words[0], *numbers, *defaults[len(numbers) - 2 :]


# --- the script ---

_DAYS = ('mon', 'tue', 'wed', 'thu', 'fri', 'sat', 'sun')
_UNITS = {'s': 1.0, 'min': 60.0, 'h': 3600.0, 'd': 86400.0}
_SPAN = re.compile(r'(\d+(?:\.\d+)?) ?(s|min|h|d)\Z')
_TIME = re.compile(r'(?:(daily|day (\d+)|mon|tue|wed|thu|fri|sat|sun) )?(\d\d?):(\d\d)\Z')
KEYS = ('at', 'do', 'for', 'then')


@dataclass(frozen=True)
class Times:
    """When something happens: once so long after the start, or at an hour of some days.

    Attributes:
        offset: Seconds after the start; None: at an hour.
        hour, minute: Local time.
        day: The day after the start's, from 1; 0: each.
        weekday: 0 to 6 from Monday; None: all.
    """

    offset: float | None = None
    hour: int = 0
    minute: int = 0
    day: int = 0
    weekday: int | None = None

    @classmethod
    def parse(cls, text: str) -> Times:
        """Return the times that a text means.

        Raises:
            ValueError: It means none.
        """
        if (span := _SPAN.match(text)) is not None:
            return cls(float(span[1]) * _UNITS[span[2]])
        match = _TIME.match(text)
        if match is None or int(match[3]) > 23 or int(match[4]) > 59:
            raise ValueError(
                f"at: got {text!r}, expected such as 'daily 21:30', 'day 3 21:30', 'mon 21:30' or "
                "'90 s'"
            )
        weekday = _DAYS.index(match[1]) if match[1] in _DAYS else None
        return cls(None, int(match[3]), int(match[4]), int(match[2] or 0), weekday)

    def first(self, start: float) -> float:
        """Return when it happens first, seconds since 1970; inf: never."""
        return self.after(start - 1e-6, start)

    def after(self, stamp: float, start: float) -> float:
        """Return when it happens next after a moment; inf: never again."""
        if self.offset is not None:
            at = start + self.offset
            return at if at > stamp else math.inf
        for days in range(9):
            at = self._on(stamp, days)
            if at > stamp and self._holds(at, start):
                return at
        if self.day:
            at = self._on(start, self.day - 1)
            return at if at > stamp else math.inf
        return math.inf

    def before(self, stamp: float, start: float) -> float | None:
        """Return when it happened last up to a moment; None: not yet."""
        if self.offset is not None:
            at = start + self.offset
            return at if at <= stamp else None
        if self.day:
            at = self._on(start, self.day - 1)
            return at if start <= at <= stamp else None
        for days in range(9):
            at = self._on(stamp, -days)
            if start <= at <= stamp and self._holds(at, start):
                return at
        return None

    def _on(self, stamp: float, days: int) -> float:
        """Return its time of day, so many days after the day of a stamp."""
        day = datetime.fromtimestamp(stamp) + timedelta(days=days)
        moment = day.replace(hour=self.hour, minute=self.minute, second=0, microsecond=0)
        return moment.timestamp()

    def _holds(self, at: float, start: float) -> bool:
        day = datetime.fromtimestamp(at)
        if self.weekday is not None and day.weekday() != self.weekday:
            return False
        if not self.day:
            return True
        begun = datetime.fromtimestamp(start)
        return (day.date() - begun.date()).days == self.day - 1


@dataclass(frozen=True)
class Happening:
    """One entry of a script.

    Attributes:
        name: A name of the user's choice.
        times: When it happens.
        lines: What is done.
        lasts: After so long the lines of `then` are done, seconds.
        then: Those.
    """

    name: str
    times: Times
    lines: tuple[str, ...]
    lasts: float = 0.0
    then: tuple[str, ...] = ()


def read_script(path: str | Path) -> list[Happening]:
    """Return what a script says.

    Raises:
        FileError: One line with file, line, what was wrong and what was expected.
    """
    return read_table(path, 'stage', "'at' and 'do'", _happening)


def _happening(name: str, entry: Mapping[str, Any]) -> Happening:
    for key in entry:
        if key not in KEYS:
            raise EntryError(key, f'unknown key, expected {nearest(key, KEYS)}')
    for key in ('at', 'do'):
        if key not in entry:
            raise ValueError(f"expected '{key}'")
    if ('for' in entry) != ('then' in entry):
        raise ValueError("expected 'for' and 'then' together")
    times = Times.parse(str(entry['at']))
    lines, then = _lines('do', entry['do']), _lines('then', entry.get('then', []))
    lasts = 0.0
    if 'for' in entry:
        if (span := _SPAN.match(str(entry['for']))) is None:
            raise ValueError(f"for: got {entry['for']!r}, expected such as '45 min'")
        lasts = float(span[1]) * _UNITS[span[2]]
    return Happening(name, times, lines, lasts, then)


def _lines(key: str, value: Any) -> tuple[str, ...]:
    lines = [value] if isinstance(value, str) else value
    if not isinstance(lines, list) or not all(isinstance(each, str) for each in lines):
        raise ValueError(f'{key}: expected a line or a list of lines')
    for line in lines:
        first = (line.split() or [''])[0]
        if first not in USAGE:
            raise ValueError(f'{key}: got {first!r}, expected {nearest(first, USAGE)}')
    return tuple(lines)


def check_script(robot: Robot, script: Sequence[Happening]) -> str:
    """Try each line of a script on a robot that is not used otherwise.

    Returns:
        What is wrong with the first one that cannot be carried out; empty: nothing.
    """
    stage = Stage(robot)
    for each in script:
        for line in (*each.lines, *each.then):
            if line.startswith('remove '):
                continue  # what it takes away may come by another entry
            if line.startswith('walk '):
                for door in robot.world.plan.doors:
                    robot.world.set_door(door, True)
            try:
                stage.do(line, 0.0)
            except PlaceError as error:
                return f'stage.{each.name}: {line}: {error}'
    return ''
