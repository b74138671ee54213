"""The hand-over of a shift, and the report of a day or a week: HTML to read, CSV to count with.

What is open, who acknowledged what and how soon, what was shelved or called false, which places
were not visited and what kept the robot from them, what was pressed; over several days how that
went. All of it is made of the logs.
"""

from __future__ import annotations

import csv
import gzip
import io
import statistics
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import Any

from floor_plans.facts import counted
from strict_files.regular_files import parse_json
from surveillance_operator.desk.event_index import (
    ALERT,
    WARNING,
    DeskEvent,
    EventIndex,
    folders_of,
)
from surveillance_runtime.event_log import record_in, segments

LONGEST = 366 * 86400.0
"""The longest time of one report, seconds."""
MOST_ROWS = 500
COLUMNS = (
    *('began', 'ended', 'robot', 'what', 'place', 'rule', 'severity', 'state', 'calls'),
    *('acknowledged_by', 'acknowledged_at', 'minutes_to_acknowledge', 'assigned_to', 'answer'),
    *('notes', 'run'),
)
"""Of the CSV, a row for each alarm and warning."""
_READ = tuple(f'{{"event": "{name}"'.encode() for name in ('visit', 'failure', 'press', 'start'))
_STYLE = """
:root{color-scheme:light dark}
body{font:15px/1.5 system-ui,sans-serif;max-width:75rem;margin:auto;padding:1rem}
h1{font-size:1.4rem;margin:.2rem 0}h2{font-size:1.15rem;margin:1.4rem 0 .4rem}
.t{overflow-x:auto}table{border-collapse:collapse;min-width:100%}
td,th{padding:.2rem .7rem .2rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #8886}
.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.time{white-space:nowrap}.alert{font-weight:600}
.bars{display:flex;gap:2px;align-items:end;height:6rem;margin:.4rem 0}
.bars div{flex:1 1 0;background:#4a7fb5;min-height:1px}
@media(max-width:40rem){thead{display:none}
tr{display:block;border-bottom:1px solid #8886;padding:.3rem 0}
td{display:inline-block;border:0;padding-right:.6rem;overflow-wrap:anywhere}.n{text-align:left}
td[data-h]:not(:empty)::before{content:attr(data-h) ' ';opacity:.8;font-size:.8em}}"""


@dataclass
class PlaceTime:
    """How a place was visited.

    Attributes:
        visits: How often.
        longest: The longest time without a visit, seconds.
        last: The last visit, seconds since 1970; None: there was none.
    """

    visits: int = 0
    longest: float = 0.0
    last: float | None = None


@dataclass
class Shift:
    """What happened from one time to another.

    Attributes:
        begin, end: Seconds since 1970.
        events: Alarms and warnings, the oldest first.
        open_ones: Of these, what is not over, or over without an acknowledgement.
        places: By robot and place, how it was visited.
        failures: When, robot, what and why.
        presses: When, who, role, action, answer.
    """

    begin: float
    end: float
    events: list[DeskEvent]
    open_ones: list[DeskEvent]
    places: dict[tuple[str, str], PlaceTime] = field(default_factory=dict)
    failures: list[tuple[float, str, str, str]] = field(default_factory=list)
    presses: list[tuple[float, str, str, str, str]] = field(default_factory=list)
    metres: float = 0.0

    @property
    def minutes_to_acknowledge(self) -> list[float]:
        """How long each alarm waited for somebody, minutes."""
        return [
            (each.handling.acknowledged_at - each.began) / 60
            for each in self.events
            if each.is_alarm and each.handling.acknowledged_at >= each.began
        ]


def shift_of(index: EventIndex, runs: Iterable[Path], begin: float, end: float) -> Shift:
    """Return what the logs tell of a time.

    Args:
        index: The events of the runs.
        runs: The folders of the runs.
        begin, end: Seconds since 1970.

    Raises:
        ValueError: It is no time, or longer than `LONGEST`.
    """
    if not 0 < end - begin <= LONGEST:
        raise ValueError(f'expected an end up to {LONGEST / 86400:.0f} days after the begin')
    events = [each for each in index.between(begin, end) if each.severity >= WARNING and each.ids]
    # What went on at its end, and what returned and nobody has acknowledged by then.
    states = {each.key: each.state(end, later=True) for each in events}
    open_ones = [each for each in events if states[each.key] != 'over']
    shift = Shift(begin, end, events, open_ones)
    visited: dict[tuple[str, str], list[float]] = defaultdict(list)
    for robot, entry in _entries(runs, begin, end):
        at, name = float(entry['at']), entry['event']
        if name == 'start':
            for place in entry.get('places', ()):
                visited.setdefault((robot, str(place)), [])
        elif not begin <= at < end:
            continue
        elif name == 'visit':
            visited[robot, str(entry['place'])].append(at)
            shift.metres += float(entry.get('distance', 0.0))
        elif name == 'failure':
            shift.failures.append((at, robot, str(entry['what']), str(entry['reason'])))
        else:
            told = (str(entry[key]) for key in ('by', 'role', 'action', 'answer'))
            shift.presses.append((at, *told))  # type: ignore[arg-type]  # four of them
    for key, times in sorted(visited.items()):
        around = [begin, *sorted(times), end]
        gaps = [after - before for before, after in pairwise(around)]
        shift.places[key] = PlaceTime(len(times), max(gaps), max(times, default=None))
    return shift


def _entries(
    runs: Iterable[Path], begin: float, end: float
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    for run in runs:
        for robot, folder in folders_of(run):
            log = record_in(folder)
            for path in (*segments(log), log):
                try:
                    if path.stat().st_mtime < begin:
                        continue
                    with gzip.open(path) if path.suffix == '.gz' else open(path, 'rb') as file:
                        lines = [line for line in file if line.startswith(_READ)]
                except (OSError, EOFError, zlib.error):
                    continue
                for line in lines:
                    try:
                        entry = parse_json(line)
                        if float(entry['at']) < end:
                            yield robot, entry
                    except (ValueError, KeyError, TypeError):
                        continue


def as_csv(shift: Shift) -> str:
    """Return the alarms and warnings as CSV."""
    file = io.StringIO()
    rows = csv.DictWriter(file, COLUMNS, lineterminator='\r\n')
    rows.writeheader()
    for each in shift.events:
        done = each.handling
        waited = (done.acknowledged_at - each.began) / 60 if done.acknowledged_at else None
        rows.writerow(
            {
                'began': _date(each.began),
                'ended': '' if each.ended is None else _date(each.ended),
                'robot': each.robot,
                'what': _cell(each.text),
                'place': _cell(each.place),
                'rule': _cell(each.rule),
                'severity': 'alert' if each.severity >= ALERT else 'warning',
                'state': each.state(shift.end, later=True),
                'calls': len(each.calls),
                'acknowledged_by': _cell(done.acknowledged_by),
                'acknowledged_at': _date(done.acknowledged_at) if done.acknowledged_at else '',
                'minutes_to_acknowledge': '' if waited is None else f'{waited:.1f}',
                'assigned_to': _cell(done.assigned_to),
                'answer': done.answer,
                'notes': _cell('; '.join(f'{e.by}: {e.text}' for e in done.said)),
                'run': each.run,
            }
        )
    return file.getvalue()


def _cell(text: str) -> str:
    """Return a text that no spreadsheet takes for a formula (OWASP, CSV injection)."""
    return f"'{text}" if text[:1] in ('=', '+', '-', '@', '\t', '\r') else text


def as_html(shift: Shift, of: str) -> str:
    """Return the report as a page.

    Args:
        shift: What happened.
        of: `shift`, `day` or `week`: what it is called.
    """
    alarms = [each for each in shift.events if each.is_alarm]
    false = [each for each in alarms if each.handling.answer == 'false']
    waits = shift.minutes_to_acknowledge
    soon = f', acknowledged after {statistics.median(waits):.0f} min in the median' if waits else ''
    title = f'{of.capitalize()} {_date(shift.begin)} to {_date(shift.end)}'
    visits = sum(each.visits for each in shift.places.values())
    body = [
        f'<h1>{escape(title)}</h1>',
        f'<p>{counted(len(alarms), "alarm")}{soon}, {counted(len(false), "false alarm")}, '
        f'{counted(len(shift.events) - len(alarms), "warning")}; '
        f'{counted(visits, "visit")}, {shift.metres:.0f} m; '
        f'<b>{len(shift.open_ones)} open at its end</b>.</p>',
        '<h2>Open</h2>',
        _alarms(shift.open_ones, shift.end, 'nothing is open', 'Open'),
        '<h2>Alarms and warnings</h2>',
        _alarms(shift.events, shift.end, 'none', 'Alarms and warnings'),
        '<h2>Places</h2>',
        _places(shift),
        '<h2>What kept the robot</h2>',
        _table(
            ('At', 'Robot', 'What', 'Why'),
            [(_clock(at), robot, what, why) for at, robot, what, why in shift.failures],
            'nothing',
            'What kept the robot',
        ),
    ]
    if shift.end - shift.begin > 1.5 * 86400:
        body += ['<h2>Day by day</h2>', _trends(shift)]
    body += [
        '<h2>What was pressed</h2>',
        _table(
            ('At', 'Who', 'What', 'Answer'),
            [(_clock(at), f'{who} ({role})', *rest) for at, who, role, *rest in shift.presses],
            'nothing',
            'What was pressed',
        ),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f'<title>{escape(title)}</title><style>{_STYLE}</style></head><body><main>'
        + '\n'.join(body)
        + '</main></body></html>\n'
    )


def _alarms(events: Sequence[DeskEvent], end: float, none: str, label: str) -> str:
    rows = []
    for each in events:
        done = each.handling
        by = (
            f'{done.acknowledged_by}, {_clock(done.acknowledged_at)}'
            if done.acknowledged_at
            else ''
        )
        lasted = '' if each.ended is None else _span(each.ended - each.began)
        rows.append(
            (
                _clock(each.began),
                f'{each.robot}: {each.text}' if each.robot else each.text,
                each.place,
                each.rule,
                each.state(end, later=True),
                lasted,
                by,
                '; '.join(f'{e.by}: {e.text}' for e in done.said if e.at <= end),
            )
        )
    head = ('Since', 'What', 'Where', 'Rule', 'State', 'Lasted', 'Acknowledged', 'Said')
    return _table(head, rows, none, label)


def _places(shift: Shift) -> str:
    """Return how each place was visited, those first that waited longest."""
    rows = [
        (
            f'{robot} {place}' if robot else place,
            str(each.visits),
            _span(each.longest),
            'never' if each.last is None else _clock(each.last),
        )
        for (robot, place), each in sorted(shift.places.items(), key=lambda e: -e[1].longest)
    ]
    head = ('Place', 'Visits', 'Longest without', 'Last visit')
    return _table(head, rows, 'none was visited', 'Places')


def _trends(shift: Shift) -> str:
    """Return the counts of each day, and a bar for the alarms of each."""
    alarms, false, warnings = Counter[str](), Counter[str](), Counter[str]()
    waits: dict[str, list[float]] = defaultdict(list)
    for each in shift.events:
        day = _day(max(each.began, shift.begin))
        (alarms if each.is_alarm else warnings)[day] += 1
        false[day] += each.handling.answer == 'false'
        if each.is_alarm and each.handling.acknowledged_at >= each.began:
            waits[day].append((each.handling.acknowledged_at - each.began) / 60)
    failures = Counter(_day(at) for at, *_ in shift.failures)
    days, noon = list[str](), datetime.fromtimestamp(shift.begin).replace(hour=12)
    while (name := f'{noon:%Y-%m-%d}') <= _day(shift.end - 1):
        days.append(name)
        noon += timedelta(days=1)
    most = max([1, *(alarms[each] for each in days)])
    bars = ''.join(
        f'<div style="height:{100 * alarms[each] / most:.0f}%" title="{each}"></div>'
        for each in days
    )
    rows = [
        (
            each,
            str(alarms[each]),
            str(false[each]),
            str(warnings[each]),
            f'{statistics.median(waits[each]):.0f} min' if waits[each] else '',
            str(failures[each]),
        )
        for each in days
    ]
    head = ('Day', 'Alarms', 'False', 'Warnings', 'Acknowledged after', 'Failures')
    label = f'alarms of each day, at most {most}'
    table = _table(head, rows, '', 'Day by day')
    return f'<div class="bars" role="img" aria-label="{label}">{bars}</div>{table}'


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], none: str, label: str) -> str:
    if not rows:
        return f'<p>{none}</p>'
    cells = ''.join(f'<th scope="col">{escape(each)}</th>' for each in head)
    lines = ''.join(
        '<tr>'
        + ''.join(
            f'<td data-h="{escape(name)}">{escape(cell)}</td>'
            for name, cell in zip(head, row, strict=True)
        )
        + '</tr>'
        for row in rows[:MOST_ROWS]
    )
    more = f'<p>and {len(rows) - MOST_ROWS} more</p>' if len(rows) > MOST_ROWS else ''
    return (
        f'<div class="t" tabindex="0" role="region" aria-label="{escape(label)}">'
        f'<table><thead><tr>{cells}</tr></thead><tbody>{lines}</tbody></table></div>{more}'
    )


def _date(at: float) -> str:
    return f'{datetime.fromtimestamp(at):%Y-%m-%d %H:%M}'


def _day(at: float) -> str:
    return f'{datetime.fromtimestamp(at):%Y-%m-%d}'


def _clock(at: float) -> str:
    return f'{datetime.fromtimestamp(at):%d.%m. %H:%M:%S}'


def _span(seconds: float) -> str:
    minutes = seconds / 60
    return f'{minutes:.0f} min' if minutes < 120 else f'{minutes / 60:.1f} h'
