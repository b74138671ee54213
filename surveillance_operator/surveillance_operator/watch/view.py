"""The view of a mission in a terminal: the map, and beside or below it what goes on.

Each part that nothing came for says so in its place. Keys choose what is shown, see `KEYS`. Every
mark has a character or a word of its own, so that none needs colours.
"""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from textwrap import wrap
from typing import Any

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.live import Live
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from floor_plans.occupancy_grid import Box
from state_machines import Interrupt
from surveillance_operator.figures import ShownFigure, figures_of
from surveillance_operator.fleet_actions import ALL
from surveillance_operator.fleet_table import fleet_lines
from surveillance_operator.mission_state import MissionState, Pose
from surveillance_operator.mission_words import doing, troubles, why
from surveillance_operator.page_state import events_of, health, merged_events
from surveillance_operator.watch import raster
from surveillance_operator.watch.raster import CharacterCanvas, Viewport, rasterise

SIDE_BY_SIDE = 76
"""From this many columns on the panel stands beside the map, else below."""
LEAST_PANEL = 40
"""Columns of the panel beside the map; it gets what the map does not need, too."""
MOST_EVENTS = 10
"""Lines."""
PERIOD = 0.2
"""Seconds between two pictures."""
SETTLING = 2.0
"""How long a single picture waits for what is latched, once a mission was seen, seconds."""
PLAIN_SIZE = 100, 40
"""Columns and rows of a single picture where there is no terminal, and COLUMNS and LINES are not
set."""
KEY_NOTE = 's STOP · r release · q quit · p hold · d decision · n nodes · e events'
KEYS = {
    'm': 'map',
    'd': 'decision',
    'n': 'nodes',
    'e': 'events',
    'f': 'robots',
}
"""Keys that choose a page; `p` holds the picture, `q` ends, `s` stops the robot and `r` releases
it; of a fleet a digit chooses the robot, `S` stops all and `R` releases all."""
STOP_KEYS = {'s': True, 'r': False}
FLEET_NOTE = 's STOP · S STOP ALL · r, R release · 1-9 robot · f robots · q quit · d n e pages'
BAR = 20
MARGIN = 1.5
"""Around the places, where there is no map, metres."""
HALF_WALL = 0.04
"""Half of what a door's opening is deep, metres."""
RECENT = 300
"""Points of the trail that are drawn brighter."""

PUBLISHERS = {
    'mission_status': 'robot_behavior tells what it does',
    'decision': 'no place was chosen',
    'map': 'the simulator or a map server publishes it; in modes RANDOM and MANUAL nobody does',
    'amcl_pose': 'motion_controller publishes it in mode SIMULATED',
}
LEVELS = ('ok', 'WARN', 'ERROR', 'STALE')
"""Of what nodes report, by their numbers on `/diagnostics`."""
HEADER = Style(color='black', bgcolor='deep_sky_blue1', bold=True)
ALARM = Style(color='white', bgcolor='red3', bold=True)
DIM = Style(dim=True)
ROBOT = Style(color='black', bgcolor='yellow1', bold=True)
OTHER = Style(color='black', bgcolor='deep_sky_blue1', bold=True)
FLEET_COLOURS = ('yellow1', 'deep_sky_blue1', 'hot_pink', 'spring_green2', 'medium_purple1')
LABEL = Style(color='white', bold=True)
URGENT = Style(color='red1', bold=True)
HERE = Style(color='yellow1', bold=True)

Lines = list[list[Segment]]


class MissionView:
    """Draws one state.

    Args:
        state: What is known.
        whole: Fill the terminal, down to its last line.
        page: What to show, one of the values of `KEYS`.
        note: Stands in the last line.
        fleet: All robots by their names; what they share has none. Empty: the robot is alone.
        robot: The name of the one that is drawn.
    """

    def __init__(
        self,
        state: MissionState,
        *,
        whole: bool = True,
        page: str = 'map',
        note: str = '',
        fleet: Mapping[str, MissionState] | None = None,
        robot: str = '',
    ) -> None:
        self._state = state
        self._robot = robot
        self._fleet = dict(fleet or {}) if robot else {}
        self._events = merged_events(
            {name: events_of(each) for name, each in (self._fleet or {'': state}).items()}
        )
        self._whole = whole
        self._page = page
        self._note = note

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Yield the picture: as many lines as the terminal has, each as wide as it is."""
        width, height = options.max_width, options.height or console.height
        colours = console.color_system is not None and not console.no_color
        body = height - (2 if self._note else 1)
        if self._page != 'map':
            lines = _wrapped(console, self._page_lines(), width)
            rows = _rendered(console, options, lines[:body], width)
        elif width >= SIDE_BY_SIDE:
            picture = self._map(width - LEAST_PANEL - 1, body, colours=colours)
            used = max(Segment.get_line_length(line) for line in picture)
            panel = self._panel(console, options, width - used - 1, body)
            rows = [
                [*Segment.adjust_line_length(line or [], used + 1), *(beside or [])]
                for line, beside in zip_longest(picture, panel)
            ]
        else:
            picture = self._map(width, max(3, body // 2), colours=colours)
            rows = [*picture, *self._panel(console, options, width, max(0, body - len(picture)))]
        title = header_line(self._state, self._robot)
        title.pad_right(max(0, width - len(title)))
        rows = [*_rendered(console, options, [title], width), *rows][: body + 1]
        if self._whole:
            rows += [[] for _ in range(body + 1 - len(rows))]
        if self._note:
            rows += _rendered(console, options, [_dim(f' {self._note}')], width)
        for number, row in enumerate(rows):
            if number:
                yield Segment.line()
            yield from Segment.adjust_line_length(row, width)

    def _map(self, columns: int, rows: int, *, colours: bool) -> Lines:
        others = {
            name: each.sensors.pose
            for name, each in self._fleet.items()
            if name and name != self._robot and each.sensors.pose is not None
        }
        return draw_map(self._state, columns, rows, colours=colours, others=others)

    def _page_lines(self) -> list[Text]:
        if self._page == 'events':
            return [_event(each) for each in reversed(self._events)] or [_dim('no events yet')]
        if self._page == 'robots':
            if not self._fleet:
                return [_dim('this robot is alone')]
            return [Text(line) for line in fleet_lines(self._fleet)]
        return PAGES[self._page](self._state)

    def _robot_lines(self) -> list[Text]:
        """Return what the robots of a fleet do, with the keys that choose them."""
        names = [name for name in self._fleet if name]
        lines = []
        for number, name in enumerate(names, 1):
            each = self._fleet[name]
            wrong = troubles(each)
            style = 'bold' if name == self._robot else ''
            lines.append(
                Text.assemble(
                    (f'{number} {name} ', style or robot_colour(names, name)),
                    f'{each.robot_place} {"; ".join(wrong) or doing(each)}',
                    style=URGENT if wrong else style,
                )
            )
        return lines

    def _panel(
        self, console: Console, options: ConsoleOptions, width: int, height: int
    ) -> list[list[Segment]]:
        state = self._state
        fixed = _wrapped(console, state_lines(state), width)
        fixed += figure_lines(state, width, brief=True)
        figures = _wrapped(console, figure_lines(state, width, brief=False), width)
        decision = _wrapped(console, decision_lines(state), width)
        # The whole reason, as long as the longest waiting places and the last event stay.
        most = max(2, height - len(fixed) - len(figures) - 5)
        if len(decision) > most:
            decision[most - 1].append('…')
        fixed += [*decision[:most], *figures]
        places = place_lines(state, width)
        robots = self._robot_lines()
        if robots:
            fixed = [_title('robots', width), *robots, _title(self._robot, width), *fixed]
        told = self._events[-MOST_EVENTS:]
        texts = [_event(each) for each in told]
        # The places come before all but the latest events.
        room = max(0, height - len(fixed) - 2)
        events = _wrapped(console, texts, width)
        if len(places) + len(events) > room:
            events = texts
        shown_events = min(len(events), max(min(3, room), room - len(places)), MOST_EVENTS)
        room -= shown_events
        if len(places) > room:
            places = [*places[: max(0, room - 1)], _dim('… and more places')][: max(0, room)]
        lines = fixed
        if places:
            lines += [_title('places, longest unvisited first', width), *places]
        if shown_events:
            lines += [_title('events', width), *events[-shown_events:]]
        return _rendered(console, options, lines[:height], width)


def robot_colour(names: Sequence[str], name: str) -> str:
    """Return the colour of a robot of a fleet, by its place among the names."""
    return FLEET_COLOURS[list(names).index(name) % len(FLEET_COLOURS)]


def header_line(state: MissionState, robot: str = '') -> Text:
    """Return which mission this is, or that there is none."""
    if not state.health.nodes:
        text = 'the mission has ended' if state.task.status else 'no mission yet'
        return Text(f' {text}: waiting on {state.where} ', style=ALARM)
    if state.health.ended:
        ended = ', '.join(sorted(state.health.ended))
        return Text(f' ended: {ended} · {state.where} ', style=ALARM)
    if state.task.stopped:
        who = f'{robot} is ' if robot else ''
        text = f' {who}STOPPED until a person releases it (r) · {state.where} '
        return Text(text, style=ALARM)
    name = state.task.status.machine if state.task.status else 'mission'
    name = f'{robot} · {name}' if robot else name
    mode = f' in mode {state.task.mode}' if state.task.mode else ''
    mode += ' · PAUSED' if state.machine.paused else ''
    return Text(f' {name}{mode} · {state.where} ', style=HEADER)


def state_lines(state: MissionState) -> list[Text]:
    """Return what the state machine does."""
    status = state.task.status
    if status is None:
        return [_nothing(state, 'mission_status')]
    age = f' for {_age(state.now - status.since)}'
    lines = [
        Text.assemble((status.state or 'not started', 'bold cyan'), (age, DIM)),
        Text(state.whereabouts),
    ]
    if status.text and not status.waiting_for_help:
        lines.append(Text(status.text))
    return lines


def figure_lines(state: MissionState, width: int, *, brief: bool) -> list[Text]:
    """Return the figures of the mission (`figures.FIGURES`), a line each.

    Args:
        state: What is known.
        width: Columns that there are.
        brief: Those that are brief, or else the others.
    """
    lines = []
    for each in figures_of(state):
        if each.figure.is_brief != brief:
            continue
        if each.words:
            lines.append(_figure(each, width))
        elif each.figure.awaited:
            lines.append(_nothing(state, *each.figure.awaited))
    return lines


def _figure(shown: ShownFigure, width: int) -> Text:
    """Return a figure, with a bar where it is a share of something."""
    line = Text(f'{shown.figure.label} ')
    if shown.fraction is not None:
        cells = min(BAR, width - 18)
        full = round(shown.fraction * cells)
        line.append('█' * full, 'red1' if shown.is_bad else 'green3')
        line.append(f'{"░" * (cells - full)} ', DIM)
    return line.append(shown.words, URGENT if shown.is_bad else '')


def decision_lines(state: MissionState) -> list[Text]:
    """Return the present decision and its reason, or what the robot waits for."""
    said = why(state)
    if said is None:
        return [_nothing(state, 'decision')]
    waits = state.task.stopped or (
        state.task.status is not None and state.task.status.waiting_for_help
    )
    return [Text(said[0], URGENT if waits else 'bold'), Text(said[1])]


def decision_page(state: MissionState) -> list[Text]:
    """Return the decision in full, with the score of each candidate."""
    lines = decision_lines(state)
    status, decision = state.task.status, state.task.decision
    if decision is None or (status is not None and status.waiting_for_help):
        return lines
    lines.append(Text(f'policy {decision.policy}, target {decision.target}'))
    for place, score in sorted(decision.scores.items(), key=lambda each: -each[1]):
        chosen = ' ← chosen' if place == decision.place else ''
        lines.append(Text(f'  {place:<12} {score:>12.3f}{chosen}'))
    return lines


def node_page(state: MissionState) -> list[Text]:
    """Return the nodes: up or ended, how often started again, the worst that they report."""
    known = health(state)
    others = {name: {'up': True, 'reports': [each]} for name, each in known['others'].items()}
    lines = []
    for name, node in {**known['nodes'], **others}.items():
        worst = max((each['level'] for each in node['reports']), default=0)
        said = [each['message'] for each in node['reports'] if each['level'] == worst]
        words = f': {"; ".join(said)}' if said and node['up'] else ''
        if again := node.get('restarts', 0):
            words += f', started again {again} time{"s" if again > 1 else ""}'
        level = f'▲ {LEVELS[min(worst, 3)]}' if worst else '● up'
        is_good = node['up'] and not worst
        sign = level if node['up'] else '✗ ended'
        lines.append(Text(f'{sign:<7} {name}{words}', '' if is_good else URGENT))
    return lines or [_dim('no nodes')]


def _event(event: Sequence[Any]) -> Text:
    at, robot, text = event
    who = (f'{robot} ', 'bold') if robot else ''
    return Text.assemble((time.strftime('%H:%M:%S', time.localtime(at)), DIM), ' ', who, text)


PAGES: dict[str, Callable[[MissionState], list[Text]]] = {
    'decision': decision_page,
    'nodes': node_page,
}


def place_lines(state: MissionState, width: int) -> list[Text]:
    """Return places by the time since their last visit, in as many columns as fit."""
    known = state.place.visited_at
    names = sorted({*known, *state.place.positions}, key=lambda name: (known.get(name, 0.0), name))
    if not names:
        return [_dim('nothing from the ontology yet: its map is not built')]
    ages = [_age(state.now - known[name]) if known.get(name) else 'never' for name in names]
    status, longest, widest = state.task.status, max(map(len, names)), max(map(len, ages))
    column = longest + widest + len('  avoided ←')
    lines = [Text()]
    for place, age in zip(names, ages, strict=True):
        entry = Text(f'{place:<{longest}} {age:>{widest}} ')
        if place in state.place.urgent:
            entry.append('URGENT', URGENT)
        elif status and place in status.avoided:
            entry.append('avoided', 'orange1')
        if place == state.robot_place:
            entry.append(' ●', HERE)
        elif status and place == status.heading_to:
            entry.append(' ←', HERE)
        if lines[-1] and len(lines[-1]) + column > width:
            lines.append(Text())
        entry.align('left', column)
        lines[-1].append_text(entry)
    return lines


def draw_map(
    state: MissionState,
    columns: int,
    rows: int,
    *,
    colours: bool,
    others: Mapping[str, Pose] | None = None,
) -> Lines:
    """Return the map with all that is on it, or a sketch of the places; a line for what is
    missing.

    Args:
        state: What is known.
        columns, rows: Of the picture.
        colours: Whether there are any.
        others: Where the other robots of a fleet are.
    """
    notes = []
    if state.place.grid is None:
        notes.append(_nothing(state, 'map', sketched=bool(state.place.positions)))
    elif state.sensors.pose is None:
        notes.append(_nothing(state, 'amcl_pose'))
    captions = [[Segment(line, DIM)] for note in notes for line in wrap(note.plain, columns)]
    box = state.place.grid.known if state.place.grid else _box_around(state)
    if box is None or rows - len(captions) < 1:
        return captions[:rows] or [[]]
    viewport = Viewport.around(box, columns, rows - len(captions))
    canvas = CharacterCanvas(
        viewport, rasterise(state.place.grid, viewport) if state.place.grid else None
    )
    if state.place.grid is None:
        for first, second in state.place.links:
            if {first, second} <= state.place.positions.keys():
                ends = state.place.positions[first], state.place.positions[second]
                canvas.line(*ends, raster.LINK)
    canvas.dots(state.sensors.trail[:-RECENT], raster.OLD_TRAIL)
    canvas.dots(state.sensors.trail[-RECENT:], raster.TRAIL)
    for door, is_open in (state.place.doors or {}).items():
        if door in state.place.door_lines:
            x1, y1, x2, y2 = state.place.door_lines[door]
            kind = raster.OPEN_DOOR if is_open else raster.CLOSED_DOOR
            # Two lines, so that it is as thick as its wall where that takes two pixels.
            for aside in (-HALF_WALL, HALF_WALL):
                canvas.line((x1 + aside, y1 + aside), (x2 + aside, y2 + aside), kind)
    if state.sensors.obstacles is not None:
        canvas.dots(state.sensors.obstacles, raster.OBSTACLE)
    if state.place.grid is None:
        for x, y in state.place.positions.values():
            canvas.mark(x, y, '○', LABEL)
    for place, (x, y) in state.place.positions.items():
        canvas.label(x, y, place, URGENT if place in state.place.urgent else LABEL)
    for name, pose in (others or {}).items():
        canvas.arrow(pose, OTHER)
        canvas.label(pose[0], pose[1], name, OTHER)
    place = state.robot_place
    if state.sensors.pose is not None:
        canvas.arrow(state.sensors.pose, ROBOT)
    elif place in state.place.positions:
        canvas.mark(*state.place.positions[place], '●', ROBOT)
    return [*canvas.lines(colours=colours), *captions]


def _box_around(state: MissionState) -> Box | None:
    if not state.place.positions:
        return None
    points = np.array([*state.place.positions.values(), *state.sensors.trail])
    (left, bottom), (right, top) = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    return float(left), float(bottom), float(right), float(top)


def _nothing(
    state: MissionState, topic: str, publisher: str = '', *, sketched: bool = False
) -> Text:
    why = state.health.silent.get(topic) or publisher or PUBLISHERS[topic]
    return _dim(f'{"sketched: " if sketched else ""}nothing on {topic} yet: {why}')


def _age(seconds: float) -> str:
    minutes, rest = divmod(max(0, int(seconds)), 60)
    if minutes < 60:
        return f'{minutes}:{rest:02d}'
    return f'{minutes // 60}:{minutes % 60:02d}:{rest:02d}'


def _dim(text: str) -> Text:
    return Text(text, style=DIM)


def _title(text: str, width: int) -> Text:
    return Text(f'── {text} '.ljust(width, '─'), style=DIM)


def _wrapped(console: Console, texts: Sequence[Text], width: int) -> list[Text]:
    return [line for text in texts for line in text.wrap(console, max(1, width))]


def _rendered(
    console: Console, options: ConsoleOptions, lines: Sequence[Text], width: int
) -> Lines:
    """Return one line of segments for each text, cut to the width with an ellipsis."""
    narrow = options.update(width=width, height=None)
    rendered = []
    for line in lines:
        line.truncate(width, overflow='ellipsis')
        line.no_wrap = True
        rendered.append(console.render_lines(line, narrow)[0])
    return rendered


See = Callable[[], Mapping[str, MissionState]]
"""Returns all robots by their names; one that is alone has none."""


@dataclass
class _Chosen:
    """What the keys chose."""

    page: str = 'map'
    robot: str = ''
    held: Mapping[str, MissionState] | None = None
    ended: bool = False

    def drawn(self, seen: Mapping[str, MissionState]) -> str:
        """Return the name of the robot that is drawn."""
        return self.robot if self.robot in seen else next(iter(seen), '')

    def press(self, key: str, seen: Mapping[str, MissionState]) -> None:
        """Handle a key; one without a meaning changes nothing."""
        names = [name for name in seen if name]
        if key == 'q':
            self.ended = True
        elif key.isdigit() and 1 <= int(key) <= len(names):
            self.robot = names[int(key) - 1]
        elif key == 'p':
            self.held = seen if self.held is None else None
        elif key in KEYS:
            self.page = 'map' if self.page == KEYS[key] else KEYS[key]


def show_moving(
    see: See,
    stopping: Interrupt,
    console: Console,
    press_stop: Callable[[bool, str], None] = lambda _stop, _robot: None,
    said: Callable[[], str] = lambda: '',
    robot: str = '',
) -> None:
    """Draw on the terminal's other screen until `q` or told to stop; give the first one back.

    Args:
        see: Returns what is known.
        stopping: Ends it.
        console: The terminal.
        press_stop: Called with True to stop a robot, False to release it, and its name, or that
            all are meant; must not block.
        said: What came of that, shown in the last line.
        robot: The robot of a fleet that is drawn first.
    """
    chosen = _Chosen(robot=robot)
    with (
        _keyboard() as read_keys,
        Live(console=console, screen=True, auto_refresh=False) as live,
    ):
        while not stopping.is_set() and not chosen.ended:
            seen = chosen.held or see()
            name = chosen.drawn(seen)
            usual = FLEET_NOTE if name else KEY_NOTE
            if chosen.robot not in ('', *seen):
                usual = f'{chosen.robot} is not heard: this is {name or "another robot"}'
            shown = 'HELD: p continues' if chosen.held else said() or usual
            view = MissionView(seen[name], page=chosen.page, note=shown, fleet=seen, robot=name)
            live.update(view, refresh=True)
            for key in read_keys(PERIOD, stopping):
                if key.lower() in STOP_KEYS:
                    press_stop(STOP_KEYS[key.lower()], ALL if key.isupper() else name)
                chosen.press(key, seen)


@contextlib.contextmanager
def _keyboard() -> Iterator[Callable[[float, Interrupt], str]]:
    """Read single keys from the terminal; without one, only wait."""

    def wait(seconds: float, stopping: Interrupt) -> str:
        stopping.wait(seconds)
        return ''

    def read(seconds: float, _stopping: Interrupt) -> str:
        try:
            ready = select.select([keyboard], [], [], seconds)[0]
            return os.read(keyboard, 64).decode(errors='ignore') if ready else ''
        except OSError:
            return ''

    try:
        keyboard = sys.stdin.fileno()
        before = termios.tcgetattr(keyboard)
    except (OSError, ValueError, AttributeError, termios.error):
        yield wait
        return
    tty.setcbreak(keyboard)
    try:
        yield read
    finally:
        termios.tcsetattr(keyboard, termios.TCSADRAIN, before)


def show_once(
    see: See, stopping: Interrupt, console: Console, timeout: float, robot: str = ''
) -> bool:
    """Draw one picture once there is a mission; return whether there was one within the time.

    Where a robot is named, it must be there.
    """
    deadline = time.monotonic() + timeout
    while True:
        seen = see()
        if robot in ('', *seen) and any(each.task.status is not None for each in seen.values()):
            break
        if time.monotonic() > deadline or stopping.wait(PERIOD / 4):
            return False
    settled = time.monotonic() + SETTLING
    while not _are_complete(see()) and time.monotonic() < settled and not stopping.wait(PERIOD / 4):
        pass
    if not console.is_terminal:
        console.size = shutil.get_terminal_size(PLAIN_SIZE)
    seen = see()
    name = _Chosen(robot=robot).drawn(seen)
    console.print(MissionView(seen[name], whole=False, fleet=seen, robot=name))
    return True


def _are_complete(seen: Mapping[str, MissionState]) -> bool:
    """Tell whether all that each robot of a simulated mission tells has come."""
    return all(_is_complete(each) for name, each in seen.items() if name or len(seen) == 1)


def _is_complete(state: MissionState) -> bool:
    """Tell whether all that a simulated mission tells has come."""
    parts = (
        state.task.battery,
        state.task.decision,
        state.place.grid,
        state.sensors.pose,
        state.place.doors,
    )
    placed = state.place.positions and state.place.visited_at.keys() <= state.place.positions.keys()
    return None not in parts and bool(placed and state.task.mode)
