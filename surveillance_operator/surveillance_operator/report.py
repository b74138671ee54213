"""The report of a mission: one HTML file that needs nothing else, and a picture beside it."""

from __future__ import annotations

import argparse
import base64
import contextlib
import io
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import replace
from html import escape
from itertools import groupby, pairwise
from pathlib import Path

from floor_plans import FloorPlan, read_place
from floor_plans.drawing import DrivenRun, draw_place
from floor_plans.facts import counted, facts, graph_over_doors
from patrol_policy.idleness_bounds import lines as bound_lines
from strict_files.files import FileError, replace_text
from surveillance_behaviour.mission import mission_log
from surveillance_operator.map_command import in_words, run_of
from surveillance_operator.recording import bag
from surveillance_operator.recording.runs import find_run, robots_of, run_parser
from surveillance_operator.run_entries import RunEntries, entries_of_run, incidents_of
from surveillance_runtime.command_line import EXIT_BAD_INPUT
from surveillance_runtime.event_log import KINDS, RECORD, RecordEntry, Section, gaps, record_in
from surveillance_runtime.run_files import PLACE, RECORDING

NAME, PICTURE = 'report.html', 'report.png'
MOST_LINES = 2000
_STYLE = """
:root{color-scheme:light dark}
body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:auto;padding:1rem}
h2,summary{font-size:1.15rem;font-weight:600;margin:1.2rem 0 .4rem}summary{cursor:pointer}
table{border-collapse:collapse;width:100%}
td,th{padding:.2rem .7rem .2rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #8886}
.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.late{font-weight:700}th.w{width:55%}
svg{width:100%;height:2rem;display:block}
.map{display:block;max-width:100%;max-height:44rem;margin:auto;border-radius:6px}
.strip{fill:#5b9bd5}.limit{stroke:#b3132b;stroke-dasharray:4 3}
@media(max-width:40rem){.w{display:none}
.long tr{display:grid;grid-template-columns:4rem 1fr 1fr;border-bottom:1px solid #8886}
.long td,.long th{border:0}.long td:nth-child(4){grid-column:1/-1}
.long th:nth-child(4){display:none}}"""


def write_report(folder: Path) -> Path:
    """Write the report of a run into its folder; return its path.

    That of a fleet leads to one for each robot, which are written, too.

    Raises:
        FileError: The run has no record, or it cannot be read.
    """
    robots = robots_of(folder)
    with _one_line(folder):
        if robots and '' not in robots:
            return _write_fleet(folder, robots)
        happened, plan, run = _material(folder)
        events = happened.of_mission
        if not any(mission_log.summarize(events).visits.values()):
            raise FileError(f'no visit was recorded in {record_in(folder)}')
        drawn = _map(plan, run) if plan is not None and run is not None else ''
        speed = _fastest(events)
        bound = graph_over_doors(plan).tour.bound / speed if plan is not None and speed else None
        path = folder / NAME
        replace_text(path, _page(folder, happened, drawn, bound))
    return path


def draw_picture(folder: Path) -> Path | None:
    """Draw the way driven as a picture beside the report; None without a place.

    Raises:
        FileError: As for `write_report`.
    """
    with _one_line(folder):
        robots = robots_of(folder)
        if robots and '' not in robots:
            plan, runs = _ways(folder, _records(robots)[0])
            run = _together(runs)
        else:
            _, plan, alone = _material(folder)
            run = alone or DrivenRun()
        if plan is None:
            return None
        path = folder / PICTURE
        draw_place(plan, 'The way driven', facts(plan), run).save(path)
    return path


@contextlib.contextmanager
def _one_line(folder: Path) -> Iterator[None]:
    """Say what goes wrong in one line."""
    try:
        yield
    except OSError as error:
        raise FileError(f'{error.filename or folder}: {error.strerror or error}') from None


def _material(folder: Path) -> tuple[RunEntries, FloorPlan | None, DrivenRun | None]:
    """Return what happened in a run, its place, and what it did there; no place: none of that."""
    happened = entries_of_run(folder)
    file = folder / PLACE
    if not file.exists() or not happened.of_mission:
        return happened, None, None
    plan = read_place(file).plan
    return happened, plan, run_of(happened.of_mission, plan.place, str(record_in(folder)))


def _write_fleet(folder: Path, robots: Mapping[str, Path]) -> Path:
    """Write the report of several robots, and each one's own."""
    records, problems = _records(robots)
    if not any(event.name == 'visit' for events in records.values() for event in events):
        raise FileError(f'no visit was recorded in {folder}')
    plan, runs = _ways(folder, records)
    links = {}
    for robot, own in robots.items():
        with contextlib.suppress(FileError):  # as of one that has visited nothing
            links[robot] = f'{robot}/{write_report(own).name}'
    drawn = _map(plan, _together(runs)) if plan is not None else ''
    path = folder / NAME
    everything = [each for own in (folder, *robots.values()) for each in _read_or_nothing(own)]
    replace_text(path, _fleet_page(folder, records, problems, drawn, links, everything))
    return path


def _read_or_nothing(folder: Path) -> list[RecordEntry]:
    """Return what happened, nothing where that cannot be read: it is told elsewhere."""
    with contextlib.suppress(FileError):
        return entries_of_run(folder).entries
    return []


def _records(robots: Mapping[str, Path]) -> tuple[dict[str, Sequence[RecordEntry]], list[str]]:
    """Return what each robot's mission was, and what cannot be read."""
    records: dict[str, Sequence[RecordEntry]] = {}
    problems = []
    for robot, own in robots.items():
        try:
            happened = entries_of_run(own)
            records[robot] = happened.of_mission
            if told := happened.problem():
                problems.append(f'{robot}: {told}')
        except FileError as error:
            records[robot] = ()
            problems.append(f'{robot}: {error}')
    return records, problems


def _ways(
    folder: Path, records: Mapping[str, Sequence[RecordEntry]]
) -> tuple[FloorPlan | None, list[DrivenRun]]:
    """Return the place of a fleet, and what each robot did there."""
    if not (folder / PLACE).exists():
        return None, []
    plan = read_place(folder / PLACE).plan
    runs = []
    for robot, events in records.items():
        try:
            runs.append(run_of(events, plan.place, robot))
        except FileError:  # nothing was recorded of it
            runs.append(DrivenRun())
    return plan, runs


def _together(runs: Sequence[DrivenRun]) -> DrivenRun:
    """Return what several robots did, for one picture."""
    visits: Counter[str] = Counter()
    recharges: Counter[str] = Counter()
    for run in runs:
        visits.update(run.visits)
        recharges.update(run.recharges)
    return DrivenRun(
        driven=[way for run in runs for way in run.driven],
        planned=[way for run in runs for way in run.planned],
        failures=[point for run in runs for point in run.failures],
        recharges=recharges,
        visits=visits,
        threshold=next((run.threshold for run in runs if run.threshold), None),
        summary=f'{_robots(runs)}, {sum(visits.values())} visits',
    )


def _robots(each: Sized) -> str:
    """Return how many robots there are, in words."""
    return counted(len(each), 'robot')


def _fleet_page(
    folder: Path,
    records: Mapping[str, Sequence[RecordEntry]],
    problems: Sequence[str],
    drawn: str,
    links: Mapping[str, str],
    everything: Sequence[RecordEntry],
) -> str:
    events = [event for own in records.values() for event in own]
    begin, end = min(e.time for e in events), max(e.time for e in events)
    summaries = {robot: mission_log.summarize(own) for robot, own in records.items()}
    threshold = next((each.threshold for each in summaries.values() if each.threshold), None)
    rows = []
    for robot, summary in summaries.items():
        name = escape(robot)
        linked = f'<a href="{escape(links[robot])}">{name}</a>' if robot in links else name
        told = in_words(summary) if records[robot] else 'nothing was recorded'
        rows.append(f'<tr><td>{linked}</td><td>{escape(told)}</td></tr>')
    lines = _one_time_line(records, begin)
    table = _table(['at', 'robot', 'what', 'in words'], lines[-MOST_LINES:])
    left_out = len(lines) - MOST_LINES
    more = f'<p>The last {MOST_LINES}; {left_out} earlier ones: see {RECORD}.</p>'
    body = [
        f'<h1>Mission {escape(folder.name)}, {_robots(records)}</h1>',
        *(f'<p class="late">{escape(each)}</p>' for each in problems),
        f'<table><tbody>{"".join(rows)}</tbody></table>',
        drawn,
        '<h2>Idleness</h2>',
        _idleness_of_all(records, summaries, threshold, begin, end),
        f'<details open><summary>What happened ({len(lines)})</summary>{table}'
        f'{more if left_out > 0 else ""}</details>',
        _incidents(everything),
    ]
    return _document(folder, body)


def _idleness_of_all(
    records: Mapping[str, Sequence[RecordEntry]],
    summaries: Mapping[str, mission_log.Summary],
    threshold: float | None,
    begin: float,
    end: float,
) -> str:
    """Return how long each place waited for any robot, and how often each one visited it."""
    times: dict[str, list[float]] = {}
    for summary in summaries.values():
        times |= {place: [] for place in summary.visits if place not in times}
    for events in records.values():
        for event in events:
            if event.name == 'visit':
                times.setdefault(event.text('place'), []).append(event.time)
    removed = _removed_at(records.values())
    rows = []
    for place in sorted(times):
        visits = sorted(times[place])
        until = max([removed.get(place, end), *visits])
        longest = max(after - before for before, after in pairwise([begin, *visits, until]))
        late = threshold is not None and longest > threshold
        by = ', '.join(
            f'{robot} {summary.visits[place]}'
            for robot, summary in summaries.items()
            if summary.visits[place]
        )
        rows.append(
            f'<tr><td>{_name(place, removed)}</td><td class="n">{len(visits)}</td>'
            f'<td>{escape(by)}</td>'
            f'<td class="n{" late" if late else ""}">{longest:.0f} s{" !" if late else ""}</td>'
            f'<td class="w">{_strip(visits, threshold, begin, end, until)}</td></tr>'
        )
    return (
        '<table><thead><tr><th>place</th><th class="n">visits</th><th>by</th>'
        '<th class="n">longest unvisited</th>'
        f'<th class="w">over the mission</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
    )


def _one_time_line(records: Mapping[str, Sequence[RecordEntry]], begin: float) -> list[list[str]]:
    """Return what happened to all robots in one order; equal lines of a robot stand once."""
    told: list[tuple[float, str, list[str]]] = []
    for robot, events in records.items():
        before: list[str] = []
        for event in events:
            if not event.kind.words:
                continue
            head, *words = event.kind.words
            cells = [_cell(event.fields[head]), ', '.join(_cell(event.fields[k]) for k in words)]
            line = [robot, f'{event.name} {cells[0]}', cells[1]]
            if line != before:
                told.append((event.time, robot, line))
            before = line
    return [[_clock(at - begin), *line] for at, _, line in sorted(told)]


def _map(plan: FloorPlan, run: DrivenRun) -> str:
    """Return the picture of the place with the ways driven, inside of the page.

    The page tells the summary and the waits itself, so the picture is without them.
    """
    picture = io.BytesIO()
    way = replace(run, waits={}, summary=facts(plan))
    draw_place(plan, 'The way driven', '', way).save(picture, 'PNG', optimize=True)
    data = base64.b64encode(picture.getvalue()).decode()
    return (
        f'<img class="map" alt="The place with the way driven" src="data:image/png;base64,{data}">'
    )


def _fastest(events: Sequence[RecordEntry]) -> float:
    """Return the highest mean speed of a leg, from decision to arrival, m/s."""
    fastest, began = 0.0, math.inf
    for event in events:
        if event.name == 'decision':
            began = event.time
        elif event.name == 'visit':
            if event.time - began > 1.0:
                fastest = max(fastest, event.number('distance') / (event.time - began))
            began = math.inf
    return fastest


def _page(folder: Path, happened: RunEntries, drawn: str, bound: float | None) -> str:
    events = happened.of_mission
    summary = mission_log.summarize(events)
    threshold = summary.threshold
    begin, end = events[0].time, max(event.time for event in events)
    is_whole = events[0].name != 'snapshot'
    start = begin if is_whole else end - summary.seconds
    body = [f'<h1>Mission {escape(folder.name)}</h1>']
    body += [
        f'<p>{escape(line)}</p>'
        for line in _overview(summary, _removed_at([events]), threshold, bound)
    ]
    if told := happened.problem():
        body.append(f'<p class="late">{escape(told)}</p>')
    for gap in gaps(happened.entries):
        body.append(
            f'<p class="late">The disk was full: of what happened from {_clock(gap.begin - start)} '
            f'to {_clock(gap.end - start)} something is missing.</p>'
        )
    if not is_whole:
        body.append(
            f'<p>All figures are of the whole mission; map, strips and lists begin at '
            f'{_clock(begin - start)}. What came before is in {RECORD}.*.gz.</p>'
        )
    body.append(drawn)
    body.append(_idleness_bounds(events))
    body.append('<h2>Idleness</h2>')
    body.append(_idleness(events, summary, threshold, begin, end))
    counts = {
        'recharge': summary.recharges,
        'failure': summary.failures.total(),
        'decision': summary.rules.total(),
        'visit': summary.visits.total(),
    }
    for name, kind in KINDS.items():
        if kind.section is not None:
            found = [each for each in happened.entries if each.name == name]
            body.append(_listed(kind.section, found, counts.get(name), start))
    body.append(_incidents(happened.entries))
    return _document(folder, body)


def _listed(
    section: Section, found: Sequence[RecordEntry], number: int | None, start: float
) -> str:
    """Return the list of a kind of entries.

    Args:
        section: How they are listed.
        found: The entries.
        number: How many there were in the whole mission; None: these, and none are not mentioned.
        start: When the mission began, seconds.
    """
    if not found:
        return '' if number is None else f'<h2>{section.title} ({number})</h2>'
    rows = _rows(found, section.columns, start)
    table = _table(['at', *section.columns], rows[:MOST_LINES])
    if len(rows) > MOST_LINES:
        table += f'<p>and {len(rows) - MOST_LINES} more: see {RECORD}.</p>'
    opened = ' open' if section.is_open else ''
    head = f'<summary>{section.title} ({len(found) if number is None else number})</summary>'
    return f'<details{opened}>{head}{table}</details>'


def _document(folder: Path, body: Sequence[str]) -> str:
    """Return the whole page."""
    made = time.strftime('%Y-%m-%d %H:%M')
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>Mission {escape(folder.name)}</title><style>{_STYLE}</style></head>'
        f'<body><main>{"".join(body)}<p>Written {made}.</p></main></body></html>\n'
    )


def _idleness_bounds(events: Sequence[RecordEntry]) -> str:
    """Return what was said last of what can be kept of each place."""
    found = mission_log.last_idleness_bounds(events)
    if not found:
        return ''
    first, *rest = bound_lines(found)
    rows = [[each.place, each.verdict, each.words] for each in found[:MOST_LINES]]
    head = f'What could be kept: {escape(first)}'
    opened = ' open' if rest else ''
    table = _table(['place', 'verdict', 'in words'], rows)
    return f'<details{opened}><summary>{head}</summary>{table}</details>'


def _incidents(entries: Iterable[RecordEntry]) -> str:
    """Return what went wrong, and what people were called for."""
    found = sorted(incidents_of(entries), key=lambda each: each.at)
    if not found:
        return '<h2>Incidents (0)</h2>'
    rows = [
        [
            time.strftime('%H:%M:%S', time.localtime(each.at)),
            each.cause,
            each.severity,
            'goes on' if each.lasted is None else f'{each.lasted:.0f} s',
            each.text,
        ]
        for each in found[-MOST_LINES:]
    ]
    table = _table(['at', 'cause', 'severity', 'lasted', 'what'], rows)
    return f'<details open><summary>Incidents ({len(found)})</summary>{table}</details>'


def _overview(
    summary: mission_log.Summary,
    removed: Mapping[str, float],
    threshold: float | None,
    bound: float | None,
) -> list[str]:
    """Return the mission in a few sentences."""
    there = [times for place, times in summary.visits.items() if place not in removed]
    visited = sum(1 for times in there if times)
    did = f'{in_words(summary)} · {visited} of {len(there)} places visited'
    limits = [f'Threshold {threshold:g} s.' if threshold else 'The threshold was not recorded.']
    if bound:
        limits.append(f'No patrol at this pace keeps every place below {bound:.0f} s.')
    return [did, ' '.join(limits)]


def _idleness(
    events: Sequence[RecordEntry],
    summary: mission_log.Summary,
    threshold: float | None,
    start: float,
    end: float,
) -> str:
    removed = _removed_at([events])
    rows = []
    for place in sorted(summary.visits):
        times = [e.time for e in events if e.name == 'visit' and e.text('place') == place]
        until = max([removed.get(place, end), *times])
        longest = summary.unvisited.get(place, 0.0)
        late = threshold is not None and longest > threshold
        mark = ' !' if late else ''
        rows.append(
            f'<tr><td>{_name(place, removed)}</td><td class="n">{summary.visits[place]}</td>'
            f'<td class="n{" late" if late else ""}">{longest:.0f} s{mark}</td>'
            f'<td class="w">{_strip(times, threshold, start, end, until)}</td></tr>'
        )
    return (
        '<table><thead><tr><th>place</th><th class="n">visits</th>'
        '<th class="n">longest unvisited</th>'
        f'<th class="w">over the mission</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
    )


def _removed_at(records: Iterable[Sequence[RecordEntry]]) -> dict[str, float]:
    """Return when each place was removed that was there and is there no more: it waits for nobody.

    Args:
        records: What happened to each robot.
    """
    known: set[str] = set()
    removed: dict[str, float] = {}
    maps = (each for events in records for each in events if each.name in ('start', 'map'))
    for event in sorted(maps, key=lambda event: event.time):
        places = {*event.names('places'), *([event.text('place')] if event.name == 'start' else ())}
        removed |= dict.fromkeys(known - places - removed.keys(), event.time)
        for place in places & removed.keys():
            del removed[place]
        known |= places
    return removed


def _name(place: str, removed: Mapping[str, float]) -> str:
    return escape(f'{place} (removed)' if place in removed else place)


def _strip(
    times: Iterable[float], threshold: float | None, start: float, end: float, until: float
) -> str:
    """Return how long a place had not been visited, over the mission, as a small SVG.

    Args:
        times: Of its visits.
        threshold: Of the mission, seconds.
        start, end: Of the mission.
        until: When the place was removed; the end where it was not.
    """
    span = max(end - start, 1.0)
    gaps = [start, *sorted(times), until]
    top = max(threshold or 0.0, *(b - a for a, b in pairwise(gaps))) or 1.0
    points = []
    for before, at in pairwise(gaps):
        x1, x2 = (600 * (each - start) / span for each in (before, at))
        points.append(f'{x1:.1f},30 {x2:.1f},{30 - 30 * (at - before) / top:.1f} {x2:.1f},30')
    limit = ''
    if threshold:
        y = 30 - 30 * threshold / top
        limit = f'<line class="limit" x1="0" x2="600" y1="{y:.1f}" y2="{y:.1f}"/>'
    return (
        '<svg viewBox="0 0 600 30" preserveAspectRatio="none" aria-hidden="true">'
        f'<polygon class="strip" points="{" ".join(points)}"/>{limit}</svg>'
    )


def _rows(found: Sequence[RecordEntry], columns: Sequence[str], start: float) -> list[list[str]]:
    """Return a row for each event; equal ones that follow each other share one."""
    rows = []
    for cells, group in groupby(found, lambda event: [_cell(event.fields[k]) for k in columns]):
        first, *more = (_clock(event.time - start) for event in group)
        again = f' ({len(more) + 1} times until {more[-1]})' if more else ''
        rows.append([first, *cells[:-1], cells[-1] + again])
    return rows


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    cells = ''.join(f'<th>{escape(each)}</th>' for each in head)
    lines = ''.join(
        '<tr>' + ''.join(f'<td>{escape(cell)}</td>' for cell in row) + '</tr>' for row in rows
    )
    return f'<table class="long"><thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table>'


def _cell(value: object) -> str:
    return f'{value:.1f}' if isinstance(value, float) else str(value)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(max(0, int(seconds)), 60)
    return f'{minutes // 60}:{minutes % 60:02d}:{rest:02d}'


def _write_days(
    robots: Mapping[str, Path], day: str, write: Callable[..., Path], blur: bool
) -> int:
    """Write the day of each robot that has one; return 2 where none has."""
    written, problems = [], []
    for own in robots.values():
        try:
            written.append(write(own, day, blur=blur))
        except FileError as error:
            problems.append(str(error))
    for path in written:
        print(path)
    for problem in dict.fromkeys(problems):
        print(f'report: {problem}', file=sys.stderr)
    return 0 if written else 2


def hours_of(text: str) -> float:
    """Return the hours that a text says.

    Raises:
        argparse.ArgumentTypeError: It says none, or more than a month.
    """
    try:
        hours = float(text.removesuffix('h'))
    except ValueError:
        hours = math.nan
    if not 0 < hours <= 744:
        raise argparse.ArgumentTypeError(f'{text!r}: expected hours, such as 8')
    return hours


def _write_shift(folder: Path, hours: float, of: str, as_table: bool) -> Path:
    """Write the hand-over of the hours before the end of a run; return where it is."""
    from surveillance_operator.desk.documents import DeskDocuments
    from surveillance_operator.desk.event_index import EventIndex, folders_of, read_run

    index = EventIndex()
    runs = [each for each in folder.resolve().parent.iterdir() if each.is_dir()]
    for run in runs:
        read_run(index, run, live=run.name == folder.resolve().name)
    logs = [record_in(own) for _, own in folders_of(folder)]
    end = max((path.stat().st_mtime for path in logs), default=time.time())
    documents = DeskDocuments(index, folder.resolve().parent, lambda: end)
    form = 'csv' if as_table else 'html'
    made = documents.report(str(end - 3600 * hours), str(end), of, form)
    path = folder / f'{of}_{time.strftime("%Y-%m-%d", time.localtime(end))}.{form}'
    replace_text(path, made.content.decode())
    return path


def main(argv: Sequence[str] | None = None) -> int:
    """Write the report of a run and say where; the exit code is 2 for bad input."""
    parser = run_parser('report', 'Writes what a mission did into one HTML file.')
    parser.add_argument(
        '--day',
        metavar='DAY',
        help='instead, what the observer saw on a day: 2026-03-01, today, yesterday, or last',
    )
    parser.add_argument(
        '--sharp', action='store_true', help='with --day: do not blur people in its pictures'
    )
    parser.add_argument(
        '--shift',
        metavar='HOURS',
        type=hours_of,
        help='instead, the hand-over of the hours before the end of the run',
    )
    parser.add_argument(
        '--week', action='store_true', help='instead, the seven days before the end of the run'
    )
    parser.add_argument(
        '--csv', action='store_true', help='with --shift or --week: the alarms as CSV'
    )
    options = parser.parse_args(argv)
    try:
        folder = find_run(options.run, options.runs)
        if options.shift is not None or options.week:
            hours = 168.0 if options.week else options.shift
            print(_write_shift(folder, hours, 'week' if options.week else 'shift', options.csv))
            return 0
        if options.day is not None:
            from surveillance_operator.day_report import write_day  # its pictures take time

            return _write_days(robots_of(folder), options.day, write_day, not options.sharp)
        for own in robots_of(folder).values():
            try:
                for line in bag.repair(own / RECORDING):
                    print(line)
            except OSError as error:  # the report can do without
                print(f'report: {own / RECORDING}: cannot be repaired: {error.strerror}')
        print(write_report(folder))
        if (picture := draw_picture(folder)) is not None:
            print(picture)
    except FileError as error:
        print(f'report: {error}', file=sys.stderr)
        return EXIT_BAD_INPUT
    return 0


if __name__ == '__main__':
    sys.exit(main())
