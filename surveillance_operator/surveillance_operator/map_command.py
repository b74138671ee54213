"""The command `map`: checks a place and draws it, after a run with the run in it."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from floor_plans import (
    Place,
    PlaceError,
    PlaceFile,
    read_place,
)
from floor_plans.drawing import DrivenRun, draw_place
from floor_plans.facts import counted, facts, graph_over_doors
from floor_plans.filter_masks import write_filter_masks
from patrol_policy.battery import Battery, ChargeCurve, Draw
from patrol_policy.decision import LONGEST_THRESHOLD, DecisionSettings
from patrol_policy.graph import PatrolGraph
from patrol_policy.idleness_bounds import IdlenessBound, idleness_bounds
from patrol_policy.idleness_bounds import lines as bound_lines
from patrol_policy.situation import Situation
from strict_files.files import FileError
from surveillance_behaviour.mission import mission_log
from surveillance_ontology.patrol_vocabulary import checked_names
from surveillance_runtime import event_log
from surveillance_runtime.command_line import EXIT_BAD_INPUT, CommandParser
from surveillance_runtime.configuration import Configuration, file_layer
from surveillance_runtime.event_log import record_in
from surveillance_runtime.node_table import RESERVED
from surveillance_simulation.world.textures import marker_panel

Spot = tuple[float, float]
Way = list[Spot]
_SUFFIXES = ('.png', '.jpg', '.jpeg', '.webp')


def expected_idleness(
    file: PlaceFile, threshold: float, battery_seconds: float | None, now: float
) -> tuple[IdlenessBound, ...]:
    """Return what can be kept of a place's rooms.

    Legs take what the way over the doors takes at the speed that a robot is given before it has
    driven any.

    Args:
        file: The place.
        threshold: Seconds after which a room without its own is URGENT.
        battery_seconds: How long a charge lasts; None: the battery does not matter.
        now: Seconds since 1970: which hours it is.
    """
    place, rules = file.place, file.rules
    settings = DecisionSettings(recharge_rooms=place.recharge_rooms)
    metres = graph_over_doors(file.plan).leg_seconds
    legs = {
        room: {other: length / settings.speed for other, length in ways.items()}
        for room, ways in metres.items()
    }
    graph = PatrolGraph(legs, settings.exploration_seconds, rules.exploration)
    world = Situation(
        place=place.start,
        now=now,
        reachable=tuple(graph.leg_seconds[place.start]),
        classes={
            room: frozenset(('ROOM', *['CORRIDOR'] * (len(doors) > 1)))
            for room, doors in place.rooms.items()
        },
        visited_at={},
        graph=graph,
        since=now,
        threshold=threshold,
        own_thresholds=rules.thresholds,
        openings=rules.calendar.at(now),
    )
    battery = Battery()
    if battery_seconds is not None:
        rates = {room: s.rate / 60.0 for room, s in file.plan.stations.items() if s.rate}
        curves = {room: ChargeCurve.even(rate) for room, rate in rates.items()}
        battery = Battery(100.0, draw=Draw(100.0 / battery_seconds), curves=curves)
    return idleness_bounds(world, battery, settings, sorted(place.rooms))


def run_of(events: Sequence[event_log.RecordEntry], place: Place, source: str) -> DrivenRun:
    """Return what a mission's record adds to the picture of its place.

    Raises:
        FileError: The record is empty.
    """
    summary = mission_log.summarize(events)
    if not summary.visits:
        raise FileError(f'{source}: nothing was recorded')
    line = in_words(summary)
    if events[0].name == 'snapshot':
        listed = max(event.time for event in events) - events[0].time
        line += f' · the ways of the last {listed / 3600.0:.1f} h'
    driven, planned, failures = _drives(events, place)
    charged = Counter(event.text('place') for event in events if event.name == 'recharge')
    return DrivenRun(
        driven=driven,
        planned=planned,
        failures=failures,
        waits=summary.unvisited,
        visits=summary.visits,
        recharges=charged,
        threshold=summary.threshold,
        summary=line,
    )


def in_words(summary: mission_log.Summary) -> str:
    """Return what a mission did in one line."""
    hours, seconds = divmod(round(summary.seconds), 3600)
    lasted = f'{hours} h {seconds // 60} min' if hours else f'{seconds // 60} min {seconds % 60} s'
    charged = f' ({summary.charging_seconds:.0f} s)' if summary.recharges else ''
    parts = [
        f'{lasted} of patrol',
        counted(sum(summary.visits.values()), 'visit'),
        f'{summary.distance:.0f} m driven',
        counted(summary.recharges, 'recharge') + charged,
        counted(sum(summary.failures.values()), 'failure'),
    ]
    if summary.restarts:
        parts.append(f'the behaviour was started again {counted(summary.restarts, "time")}')
    return ' · '.join(parts)


def _way(event: event_log.RecordEntry, field: str) -> Way:
    points = event.fields.get(field)
    return [(float(x), float(y)) for x, y in points] if isinstance(points, list) else []


def _position(place: Place, name: str) -> Spot | None:
    position = place.positions.get(name)
    return None if position is None else position[:2]


def _drives(
    events: Sequence[event_log.RecordEntry], place: Place
) -> tuple[list[Way], list[Way], list[Spot]]:
    """Return the ways driven, those planned, and where something failed.

    A way that the record does not have is the straight line. A room that was added during the run
    is where the way to it ended.
    """
    driven: list[Way] = []
    planned: list[Way] = []
    failures: list[Spot] = []
    here: Spot | None = None
    for event in events:
        if event.name == 'start':
            here = _position(place, event.text('place'))
        elif event.name == 'visit':
            planned.append(_way(event, 'path'))
            driven.append(_way(event, 'driven'))
            there = _position(place, event.text('place')) or next(iter(planned[-1][-1:]), None)
            if not planned[-1] and here is not None and there is not None and here != there:
                planned[-1] = [here, there]
            here = there
        elif event.name == 'failure':
            way = _way(event, 'driven')
            driven.append(way)
            failures += way[-1:] or ([here] if here is not None else [])
    return [way for way in driven if len(way) > 1], [way for way in planned if way], failures


def _parse(argv: Sequence[str] | None) -> argparse.Namespace:
    parser = CommandParser(
        prog='launch.py map', description='Checks a place and draws it as a picture.'
    )
    parser.add_argument('place', type=Path, metavar='FILE', help='the place, a file of config/')
    parser.add_argument(
        '--record', type=Path, metavar='RUN', help='draw this run: its folder or its events.jsonl'
    )
    parser.add_argument(
        '-o', '--output', type=Path, metavar='PNG', help='the picture (default: FILE.png here)'
    )
    parser.add_argument(
        '--nav2-masks',
        type=Path,
        metavar='FOLDER',
        help="write the place's zones as masks of Nav2's costmap filters",
    )
    parser.add_argument(
        '--threshold',
        type=_positive,
        metavar='SECONDS',
        help='say which rooms can be visited within this time, or within their own in the file',
    )
    parser.add_argument(
        '--charge-lasts',
        type=_positive,
        metavar='SECONDS',
        help='and with a battery of which a full charge lasts so long',
    )
    return parser.parse_args(argv)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= LONGEST_THRESHOLD:
        raise argparse.ArgumentTypeError(f'got {text!r}, expected seconds above 0, at most 1e9')
    return value


def _draw(options: argparse.Namespace) -> list[str]:
    file = read_place(options.place, reserved=RESERVED)
    plan = file.plan
    try:
        checked_names(plan.place)
    except PlaceError as error:
        raise FileError(f'{options.place}: {error}') from None
    # As a run does: what the file says to nodes, too.
    Configuration((file_layer(options.place),)).check()
    for marker in plan.markers.values():
        marker_panel(plan.marker_dictionary, marker.id, 'whole')
    output: Path = options.output or Path(options.place.stem + '.png')
    if output.suffix.lower() not in _SUFFIXES:
        raise ValueError(f'{output}: expected a picture, one of *{", *".join(_SUFFIXES)}')
    if not output.parent.is_dir():
        raise ValueError(f'{output}: there is no folder {output.parent}')
    run = None
    lines = [f'{options.place}: {facts(plan)}']
    if options.record:
        record = record_in(options.record) if options.record.is_dir() else options.record
        run = run_of(event_log.read(record), plan.place, str(record))
        unknown = sorted(set(run.visits) - set(plan.place.rooms))
        # A run whose map a room was added to knows all of the place's rooms, too.
        if unknown and not set(plan.place.rooms) <= set(run.visits):
            raise FileError(
                f"{record}: visits '{unknown[0]}', which the place does not have; "
                f'expected the record of a run through {", ".join(plan.place.rooms)}'
            )
        lines.append(f'{options.record}: {run.summary}')
        told = mission_log.last_idleness_bounds(event_log.read(record))
        lines += bound_lines(told) if told else []
    elif options.threshold is not None:
        found = expected_idleness(file, options.threshold, options.charge_lasts, time.time())
        lines += bound_lines(found)
    elif options.charge_lasts is not None:
        raise ValueError('--charge-lasts: expected --threshold, too')
    title = options.place.stem.replace('_', ' ')
    picture = draw_place(plan, title[:1].upper() + title[1:], facts(plan), run)
    try:
        picture.save(output)
    except OSError as error:
        raise ValueError(f'{output}: {error.strerror or error}') from None
    lines.append(f'drawn: {output}')
    if options.nav2_masks is not None:
        if not (plan.zones.keep_out or plan.zones.slow):
            raise ValueError(
                f'{options.place}: has no zones: expected keep_out_zones or slow_zones'
            )
        written = write_filter_masks(plan, options.nav2_masks)
        lines += [f'written: {path}' for path in written]
    return lines


def main(argv: Sequence[str] | None = None) -> int:
    """Check a place, draw it, and say what was found; the exit code is 2 for bad input."""
    options = _parse(argv)
    try:
        lines = _draw(options)
    except ValueError as error:
        print(f'map: {error}', file=sys.stderr)
        return EXIT_BAD_INPUT
    print('\n'.join(lines))
    return 0
