"""A mission as a picture of the terminal's size: the map, and beside or below it what goes on.

Each part that nothing came for says so in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from textwrap import wrap

import numpy as np
from rich.console import Console, ConsoleOptions, RenderResult
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from surveillance_operator import map_raster
from surveillance_operator.map_raster import Box, Canvas, Frame, rasterise
from surveillance_operator.snapshot import Snapshot, decision_line

SIDE_BY_SIDE = 76
"""From this many columns on the panel stands beside the map, else below."""
LEAST_PANEL = 40
"""Columns of the panel beside the map; it gets what the map does not need, too."""
MOST_DECISION, MOST_EVENTS = 6, 10
"""Lines."""
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
    'battery_level': 'battery_controller publishes it',
    'map': 'the simulator or a map server publishes it; in modes RANDOM and MANUAL nobody does',
    'amcl_pose': 'motion_controller publishes it in mode SIMULATED',
    'door_states': 'the simulator or the doors publish it',
}
HEADER = Style(color='black', bgcolor='deep_sky_blue1', bold=True)
ALARM = Style(color='white', bgcolor='red3', bold=True)
DIM = Style(dim=True)
ROBOT = Style(color='black', bgcolor='yellow1', bold=True)
LABEL = Style(color='white', bold=True)
URGENT = Style(color='red1', bold=True)
HERE = Style(color='yellow1', bold=True)

Lines = list[list[Segment]]


class MissionView:
    """Draws one snapshot.

    Args:
        snapshot: What is known.
        whole: Fill the terminal, down to its last line.
    """

    def __init__(self, snapshot: Snapshot, *, whole: bool = True) -> None:
        self._snapshot = snapshot
        self._whole = whole

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """The picture: as many lines as the terminal has, each as wide as it is."""
        width, height = options.max_width, options.height or console.height
        colours = console.color_system is not None and not console.no_color
        body = height - 1
        if width >= SIDE_BY_SIDE:
            picture = draw_map(self._snapshot, width - LEAST_PANEL - 1, body, colours=colours)
            used = max(Segment.get_line_length(line) for line in picture)
            panel = self._panel(console, options, width - used - 1, body)
            rows = [
                [*Segment.adjust_line_length(line or [], used + 1), *(beside or [])]
                for line, beside in zip_longest(picture, panel)
            ]
        else:
            picture = draw_map(self._snapshot, width, max(3, body // 2), colours=colours)
            rows = [*picture, *self._panel(console, options, width, max(0, body - len(picture)))]
        title = header_line(self._snapshot)
        title.pad_right(max(0, width - len(title)))
        header = _rendered(console, options, [title], width)
        rows = [*header, *rows][:height]
        if self._whole:
            rows += [[] for _ in range(height - len(rows))]
        for number, row in enumerate(rows):
            if number:
                yield Segment.line()
            yield from Segment.adjust_line_length(row, width)

    def _panel(
        self, console: Console, options: ConsoleOptions, width: int, height: int
    ) -> list[list[Segment]]:
        snapshot = self._snapshot
        fixed = [*_wrapped(console, state_lines(snapshot), width), battery_line(snapshot, width)]
        decision = _wrapped(console, decision_lines(snapshot), width)
        most = min(MOST_DECISION, max(2, height // 6))
        if len(decision) > most:
            decision[most - 1].append('…')
        fixed += decision[:most]
        fixed += _wrapped(console, [doors_line(snapshot)], width)
        places = place_lines(snapshot, width)
        told = snapshot.events[-MOST_EVENTS:]
        texts = [Text.assemble((at, DIM), ' ', text) for at, text in told]
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


def header_line(snapshot: Snapshot) -> Text:
    """Which mission this is, or that there is none."""
    if not snapshot.nodes:
        text = 'the mission has ended' if snapshot.status else 'no mission yet'
        return Text(f' {text}: waiting on {snapshot.where} ', style=ALARM)
    if snapshot.ended:
        ended = ', '.join(sorted(snapshot.ended))
        return Text(f' ended: {ended} · {snapshot.where} ', style=ALARM)
    name = snapshot.status.machine if snapshot.status else 'mission'
    mode = f' in mode {snapshot.mode}' if snapshot.mode else ''
    return Text(f' {name}{mode} · {snapshot.where} ', style=HEADER)


def state_lines(snapshot: Snapshot) -> list[Text]:
    """What the state machine does."""
    status = snapshot.status
    if status is None:
        return [_nothing(snapshot, 'mission_status')]
    age = f' for {_age(snapshot.now - status.since)}'
    lines = [
        Text.assemble((status.state or 'not started', 'bold cyan'), (age, DIM)),
        Text(status.whereabouts),
    ]
    if status.text:
        lines.append(Text(status.text, style=URGENT if status.waiting_for_help else 'none'))
    return lines


def battery_line(snapshot: Snapshot, width: int) -> Text:
    """The battery as a bar."""
    if snapshot.battery is None:
        return _nothing(snapshot, 'battery_level')
    full = round(snapshot.battery / 100 * min(BAR, width - 18))
    rest = min(BAR, width - 18) - full
    colour = 'red1' if snapshot.battery_low else 'green3'
    low = ('  low', URGENT) if snapshot.battery_low else ''
    bar = (('█' * full, colour), ('░' * rest, DIM))
    return Text.assemble('battery ', *bar, f' {snapshot.battery:.0f} %', low)


def decision_lines(snapshot: Snapshot) -> list[Text]:
    """The present decision and its reason."""
    if snapshot.decision is None:
        return [_nothing(snapshot, 'decision')]
    return [Text(decision_line(snapshot), style='bold'), Text(snapshot.decision.reason)]


def doors_line(snapshot: Snapshot) -> Text:
    """Which doors are open, and which closed."""
    if snapshot.doors is None:
        return _nothing(snapshot, 'door_states')
    closed = [door for door, is_open in snapshot.doors.items() if not is_open]
    if not closed:
        return Text.assemble('doors ', (f'all {len(snapshot.doors)} open', 'green3'))
    opened = len(snapshot.doors) - len(closed)
    return Text.assemble(
        'doors ', (f'{" ".join(closed)} closed', 'bold red1'), (f', {opened} open', 'green3')
    )


def place_lines(snapshot: Snapshot, width: int) -> list[Text]:
    """Places by the time since their last visit, in as many columns as fit."""
    known = snapshot.visited_at
    names = sorted({*known, *snapshot.positions}, key=lambda name: (known.get(name, 0.0), name))
    if not names:
        return [_dim('nothing from the ontology yet: its map is not built')]
    ages = [_age(snapshot.now - known[name]) if name in known else 'never' for name in names]
    status, longest, widest = snapshot.status, max(map(len, names)), max(map(len, ages))
    column = longest + widest + len('  avoided ←')
    lines = [Text()]
    for place, age in zip(names, ages, strict=True):
        entry = Text(f'{place:<{longest}} {age:>{widest}} ')
        if place in snapshot.urgent:
            entry.append('URGENT', URGENT)
        elif status and place in status.avoided:
            entry.append('avoided', 'orange1')
        if status and place == status.place:
            entry.append(' ●', HERE)
        elif status and place == status.heading_to:
            entry.append(' ←', HERE)
        if lines[-1] and len(lines[-1]) + column > width:
            lines.append(Text())
        entry.align('left', column)
        lines[-1].append_text(entry)
    return lines


def draw_map(snapshot: Snapshot, columns: int, rows: int, *, colours: bool) -> Lines:
    """The map with all that is on it, or a sketch of the places; a line for what is missing."""
    notes = []
    if snapshot.grid is None:
        notes.append(_nothing(snapshot, 'map', sketched=bool(snapshot.positions)))
    elif snapshot.pose is None:
        notes.append(_nothing(snapshot, 'amcl_pose'))
    captions = [[Segment(line, DIM)] for note in notes for line in wrap(note.plain, columns)]
    box = snapshot.grid.known if snapshot.grid else _box_around(snapshot)
    if box is None or rows - len(captions) < 1:
        return captions[:rows] or [[]]
    frame = Frame.around(box, columns, rows - len(captions))
    canvas = Canvas(frame, rasterise(snapshot.grid, frame) if snapshot.grid else None)
    if snapshot.grid is None:
        for first, second in snapshot.links:
            if {first, second} <= snapshot.positions.keys():
                ends = snapshot.positions[first], snapshot.positions[second]
                canvas.line(*ends, map_raster.LINK)
    canvas.dots(snapshot.trail[:-RECENT], map_raster.OLD_TRAIL)
    canvas.dots(snapshot.trail[-RECENT:], map_raster.TRAIL)
    for door, is_open in (snapshot.doors or {}).items():
        if door in snapshot.door_lines:
            x1, y1, x2, y2 = snapshot.door_lines[door]
            kind = map_raster.OPEN_DOOR if is_open else map_raster.CLOSED_DOOR
            # Two lines, so that it is as thick as its wall where that takes two pixels.
            for aside in (-HALF_WALL, HALF_WALL):
                canvas.line((x1 + aside, y1 + aside), (x2 + aside, y2 + aside), kind)
    if snapshot.obstacles is not None:
        canvas.dots(snapshot.obstacles, map_raster.OBSTACLE)
    if snapshot.grid is None:
        for x, y in snapshot.positions.values():
            canvas.mark(x, y, '○', LABEL)
    for place, (x, y) in snapshot.positions.items():
        canvas.label(x, y, place, URGENT if place in snapshot.urgent else LABEL)
    place = snapshot.status.place if snapshot.status else ''
    if snapshot.pose is not None:
        canvas.arrow(snapshot.pose, ROBOT)
    elif place in snapshot.positions:
        canvas.mark(*snapshot.positions[place], '●', ROBOT)
    return [*canvas.lines(colours=colours), *captions]


def _box_around(snapshot: Snapshot) -> Box | None:
    if not snapshot.positions:
        return None
    points = np.array([*snapshot.positions.values(), *snapshot.trail])
    (left, bottom), (right, top) = points.min(axis=0) - MARGIN, points.max(axis=0) + MARGIN
    return float(left), float(bottom), float(right), float(top)


def _nothing(snapshot: Snapshot, topic: str, *, sketched: bool = False) -> Text:
    why = snapshot.silent.get(topic) or PUBLISHERS[topic]
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
    """One line of segments for each text, cut to the width with an ellipsis."""
    narrow = options.update(width=width, height=None)
    rendered = []
    for line in lines:
        line.truncate(width, overflow='ellipsis')
        line.no_wrap = True
        rendered.append(console.render_lines(line, narrow)[0])
    return rendered
