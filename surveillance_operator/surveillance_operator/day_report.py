"""The report of a day: what was checked, what was seen, what was normal and what was not.

One HTML file with its pictures in it, made of what the observer of a run kept: its events, its
counts (`DayBook`), its pictures, and what people were called for.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from datetime import date, datetime, timedelta
from html import escape
from itertools import groupby
from pathlib import Path
from typing import Any

from floor_plans.facts import counted
from indoor_watch import Event, EventState
from indoor_watch.day_book import DayBook, Seen
from indoor_watch.privacy import PictureError, shareable
from strict_files.files import FileError, read_file, replace_text
from strict_files.regular_files import parse_json
from surveillance_operator.run_entries import PastIncident, entries_of_run, incidents_of
from surveillance_perception.finding_teller import findings_of
from surveillance_runtime.run_files import EVIDENCE

OBSERVER = 'observer.json'
MOST_BYTES = 200_000_000
MOST_PICTURES = 60
ALERT = 3
_STYLE = """
:root{color-scheme:light dark}
body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:auto;padding:1rem}
h2{font-size:1.15rem;margin:1.4rem 0 .4rem}
table{border-collapse:collapse;width:100%}
td,th{padding:.2rem .7rem .2rem 0;text-align:left;vertical-align:top;border-bottom:1px solid #8886}
.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
.event{border-left:4px solid #8888;padding:.1rem .8rem;margin:.8rem 0}
.alert{border-color:#b3132b}.warning{border-color:#a04500}
.event p{margin:.2rem 0}.event img{max-width:100%;margin:.3rem .5rem .3rem 0;border:1px solid #8886}
.quiet{color:#777}"""


NEWEST = 'last'
"""Names the newest day there is."""


def write_day(folder: Path, day: str, *, blur: bool = True) -> Path:
    """Write the report of a day into a run's folder; return its path.

    Args:
        folder: Of the run.
        day: As 2026-03-01, or `today`, `yesterday`, or `last`: the newest there is.
        blur: Whether people in its pictures are blurred.

    Raises:
        FileError: The run has no observer, or nothing of that day.
    """
    day = _named(day)
    path = folder / OBSERVER
    if not path.exists():
        raise FileError(f'{folder}: nothing was watched, expected a run with --watch')
    try:
        kept = parse_json(read_file(path, MOST_BYTES))
        book = DayBook(datetime.fromtimestamp)
        book.restore(kept.get('days', {}))
        events = _findings(folder, kept['book']['events'])
    except (ValueError, LookupError, TypeError, AttributeError, OverflowError) as error:
        raise FileError(f'{path}: cannot be read: {error!s:.100}') from None
    newest = book.days()[-1] if book.days() else date.today().isoformat()
    wanted = newest if day == NEWEST else day
    begin = datetime.fromisoformat(wanted).timestamp()
    end = (datetime.fromisoformat(wanted) + timedelta(days=1)).timestamp()
    of_day = [each for each in events if each.began < end and each.last >= begin]
    seen = book.seen_on(wanted)
    if not seen and not of_day:
        known = ', '.join(book.days()[-5:]) or 'none'
        raise FileError(f'{folder}: nothing was seen on {wanted}, the newest days are: {known}')
    called = _called(folder, begin, end)
    written = folder / f'day_{wanted}.html'
    pictures = _Pictures(folder / EVIDENCE, blur=blur)
    replace_text(written, _page(wanted, folder.name, seen, of_day, called, pictures))
    return written


def _named(text: str) -> str:
    """Return the day that a text names, as 2026-03-01, or `NEWEST`.

    Raises:
        FileError: It names none.
    """
    if text == NEWEST:
        return text
    if text in ('today', 'yesterday'):
        return (date.today() - timedelta(days=text == 'yesterday')).isoformat()
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        raise FileError(
            f'--day {text!r}: expected such as 2026-03-01, or today, yesterday, last'
        ) from None


def _findings(folder: Path, kept: Sequence[Mapping[str, Any]]) -> list[Event]:
    """Return what was found: from the log, and what the observer's state knows better.

    Args:
        folder: Of the run.
        kept: Of the state: what goes on, whose last sightings it has; of a run of an earlier
            version everything.
    """
    try:
        found = findings_of(entries_of_run(folder, whole=True).entries)
    except FileError:
        found = {}
    for each in map(Event.from_json, kept):
        if each.number not in found or each.sightings >= found[each.number].sightings:
            found[each.number] = each
    return list(found.values())


def _called(folder: Path, begin: float, end: float) -> list[PastIncident]:
    """Return the incidents that began on a day."""
    try:
        found = incidents_of(entries_of_run(folder, whole=True).entries)
    except FileError:
        return []  # the observer ran without a mission
    return [each for each in found if begin <= each.at < end]


class _Pictures:
    """Gives pictures as they stand in a page, so many of them."""

    def __init__(self, folder: Path, *, blur: bool) -> None:
        self._folder, self._blur, self._left = folder, blur, MOST_PICTURES

    def shown(self, event: Event) -> str:
        parts = []
        for name in dict.fromkeys(event.evidence):
            if self._left <= 0:
                break
            try:
                jpeg = shareable(self._folder / Path(name).name, blur=self._blur)
            except PictureError:
                continue  # deleted since
            self._left -= 1
            data = base64.b64encode(jpeg).decode()
            parts.append(
                f'<img alt="{escape(event.words())}, before and after" '
                f'src="data:image/jpeg;base64,{data}">'
            )
        return ''.join(parts)


def _page(
    day: str,
    run: str,
    seen: Sequence[Seen],
    events: Sequence[Event],
    called: Sequence[PastIncident],
    pictures: _Pictures,
) -> str:
    unusual = sorted(
        (each for each in events if each.state not in (EventState.NORMAL, EventState.FALSE)),
        key=lambda each: (-each.severity, each.began),
    )
    settled = [each for each in events if each not in unusual]
    alerts = [each for each in events if each.severity >= ALERT]
    false = [each for each in events if each.state == EventState.FALSE]
    checks = len({(each.kind, each.subject, each.place) for each in seen})
    lines = [
        '<!DOCTYPE html><html lang="en"><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f'<title>{escape(day)}</title><style>{_STYLE}</style>',
        f'<h1>{escape(day)}</h1>',
        f'<p>{sum(each.count for each in seen)} observations of {checks} things; '
        f'{len(events)} events, {len(alerts)} of them alerts, {len(false)} false alarms. '
        f'Run {escape(run)}.</p>',
        '<h2>Unusual</h2>',
        ''.join(_event(each, pictures) for each in unusual) or '<p>nothing</p>',
    ]
    if settled:
        lines += [
            '<h2>Called normal or false</h2>',
            ''.join(_event(each, pictures) for each in settled),
        ]
    lines += ['<h2>Checked and seen</h2>', _checks(seen)]
    lines += ['<h2>People were called</h2>', _calls(called)]
    return '\n'.join(lines) + '\n'


def _event(event: Event, pictures: _Pictures) -> str:
    level = ('', '', 'warning', 'alert')[min(event.severity, ALERT)]
    rule = f'<p class="quiet">{escape(event.rule)}</p>' if event.rule else ''
    seen = f'{counted(event.sightings, "sighting")} in {counted(event.looks, "look")}'
    return (
        f'<div class="event {level}"><p><b>{escape(event.words())}</b> ({escape(event.state)})</p>'
        f'<p>{_clock(event.began)} to {_clock(event.last)}, {seen}, '
        f'confidence {event.confidence:.0%}</p>'
        f'{rule}{pictures.shown(event)}</div>'
    )


def _checks(seen: Sequence[Seen]) -> str:
    if not seen:
        return '<p>nothing</p>'
    rows = []
    for (kind, subject, place), group in groupby(
        seen, key=lambda each: (each.kind, each.subject, each.place)
    ):
        states = list(group)
        told = ', '.join(
            f'{each.state} ({each.count}, last {_clock(each.last)})' for each in states
        )
        rows.append(
            f'<tr><td>{escape(kind)} {escape(subject)}</td><td>{escape(place)}</td>'
            f'<td class="n">{sum(each.count for each in states)}</td><td>{escape(told)}</td></tr>'
        )
    head = '<tr><th>What<th>Where<th class="n">Times<th>Seen as</tr>'
    return f'<table>{head}{"".join(rows)}</table>'


def _calls(called: Sequence[PastIncident]) -> str:
    if not called:
        return '<p>nobody was</p>'
    rows = ''.join(
        f'<tr><td>{_clock(each.at)}</td><td>{escape(each.severity)}</td>'
        f'<td>{escape(each.text)}</td></tr>'
        for each in called
    )
    return f'<table>{rows}</table>'


def _clock(stamp: float) -> str:
    return f'{datetime.fromtimestamp(stamp):%H:%M:%S}'
