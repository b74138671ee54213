"""Incidents: what keeps a mission from its purpose, or what a person should know of.

An incident has a cause, a severity, a beginning and an end. A node begins and ends it
(`PatrolNode.incidents`), which writes a line of the log and a finding of the node's health. The
launcher reads the lines of all nodes into an `IncidentBook`, which says what is to be told when:
once at the beginning, again at distances that double, and once at the end.

    node.incidents.begin(('door', 'D1'), 'D1 is closed: nothing else leads out of R1')
    node.incidents.end(('door', 'D1'))
"""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import NamedTuple


class Severity(StrEnum):
    """How much an incident matters."""

    WARNING = 'warning'
    """A person should know; nobody is called."""
    ALARM = 'alarm'
    """A person is called."""


class Cause(NamedTuple):
    """What an incident is about.

    Attributes:
        kind: `topic`, `door`, `place`, `station`, `node`, `person`, `event`, `sight` or
            `robot`.
        name: Which one.
    """

    kind: str
    name: str

    def __str__(self) -> str:
        return f'{self.kind} {self.name}'


@dataclass(frozen=True)
class Incident:
    """One incident.

    Attributes:
        node: Who tells of it.
        cause: What it is about.
        text: One sentence.
        severity: How much it matters.
        began: When it began, seconds.
        ended: When it ended; None: it goes on.
    """

    node: str
    cause: Cause
    text: str
    severity: Severity
    began: float
    ended: float | None = None


# --- in a node ---


class Told(NamedTuple):
    """A line about an incident: it began or changed, or it is over."""

    cause: Cause
    severity: Severity
    text: str
    over: bool

    def line(self) -> str:
        """Return the line of the log, see `read_line`."""
        word = 'over' if self.over else self.severity.value
        return f'incident [{self.cause}, {word}]: {self.text}'


class Incidents:
    """The incidents of one node; safe from any thread.

    Args:
        tell: Called with each beginning, change and end; must not block.
    """

    def __init__(self, tell: Callable[[Told], object]) -> None:
        self._tell = tell
        self._lock = threading.Lock()
        self._open: dict[Cause, Told] = {}

    def begin(
        self, cause: tuple[str, str], text: str, severity: Severity = Severity.WARNING
    ) -> None:
        """Begin an incident; one that goes on gets another text or severity.

        Args:
            cause: Kind and name, see `Cause`.
            text: One sentence that names the cause.
            severity: Whether somebody is called.
        """
        told = Told(Cause(*cause), severity, text, over=False)
        with self._lock:
            if self._open.get(told.cause) == told:
                return
            self._open[told.cause] = told
        self._tell(told)

    def end(self, cause: tuple[str, str], text: str = '') -> None:
        """End an incident; nothing happens when there is none.

        Args:
            cause: As it began.
            text: What made it end; empty: what it was.
        """
        with self._lock:
            begun = self._open.pop(Cause(*cause), None)
        if begun is not None:
            self._tell(begun._replace(text=text or begun.text, over=True))

    def end_all(self, kind: str, text: str = '') -> None:
        """End all incidents of one kind of cause."""
        for cause in [each for each in self.open() if each.kind == kind]:
            self.end(cause, text)

    def open(self) -> tuple[Cause, ...]:
        """Return the causes of those that go on."""
        with self._lock:
            return tuple(self._open)


# --- for all nodes ---

_LINE = re.compile(r'incident \[(\w+) (.*?), (warning|alarm|over)\]: (.*)')


def read_line(line: str) -> Told | None:
    """Return what a line of a node's log says of an incident; None: it says something else."""
    match = _LINE.match(line)
    if match is None:
        return None
    kind, name, word, text = match.groups()
    over = word == 'over'
    severity = Severity.ALARM if over else Severity(word)
    return Told(Cause(kind, name), severity, text, over)


FIRST_AGAIN = 240.0
"""The second call for an incident comes after this time, seconds; then the distance doubles: five
calls in the first hour (0, 4, 12, 28 and 60 minutes)."""
LONGEST_AGAIN = 4 * 3600.0
"""The longest distance between two calls, seconds."""
SETTLED = 5.0
"""An end counts when the incident has not begun again for this long, seconds."""
CONSEQUENCE = 'robot'
"""Kind of the causes that say how the robot fares. While what keeps it from its purpose is told by
a cause of another kind, nobody is called for them as well."""
KEPT = 1000
"""How many incidents that are over are kept."""


@dataclass
class _Open:
    incident: Incident
    calls: int = 0
    next_call: float = 0.0
    ends_at: float | None = None
    ending: str = ''


class Call(NamedTuple):
    """A person is called.

    Attributes:
        text: One line.
        incident: What for.
        number: The how manieth call for it, from 1.
        over: Whether it is over.
    """

    text: str
    incident: Incident
    number: int
    over: bool


class IncidentBook:
    """All incidents of a mission, and when somebody is to be called.

    Args:
        call: Called with each call.
        note: Called with each incident that has begun, and again when it has ended.
    """

    def __init__(
        self, call: Callable[[Call], object], note: Callable[[Incident], object] = lambda _i: None
    ) -> None:
        self._call = call
        self._note = note
        self._open: dict[tuple[str, Cause], _Open] = {}
        self.past: list[Incident] = []

    def hear(self, node: str, told: Told, now: float) -> None:
        """Take what a node tells.

        Args:
            node: The node.
            told: What it tells.
            now: Steady time, seconds.
        """
        key = node, told.cause
        known = self._open.get(key)
        if told.over:
            if known is not None and known.ends_at is None:
                known.ends_at, known.ending = now + SETTLED, told.text
            return
        if known is None:
            incident = Incident(node, told.cause, told.text, told.severity, now)
            self._open[key] = _Open(incident, next_call=now)
            self._note(incident)
        else:
            worse = Severity.ALARM in (told.severity, known.incident.severity)
            severity = Severity.ALARM if worse else told.severity
            known.incident = replace(known.incident, text=told.text, severity=severity)
            known.ends_at = None
        self.advance(now)

    def restarted(self, node: str, now: float) -> None:
        """Take that a node was started again: what it told of ends, unless it tells of it again."""
        for (teller, _), each in self._open.items():
            if teller == node and each.ends_at is None:
                each.ends_at, each.ending = now + 12 * SETTLED, f'{node} was started again'

    def advance(self, now: float) -> float | None:
        """Call whom it is time to call; return when to look again, None: after news."""
        for key, each in list(self._open.items()):
            if each.ends_at is not None and now >= each.ends_at:
                del self._open[key]
                self._finish(each, each.ends_at - SETTLED)
        due = [each.ends_at for each in self._open.values() if each.ends_at is not None]
        for each in self._calling():
            if now >= each.next_call:
                self._call_for(each, now)
            due.append(each.next_call)
        return min(due, default=None)

    def open(self) -> tuple[Incident, ...]:
        """Return the incidents that go on."""
        return tuple(each.incident for each in self._open.values())

    def _calling(self) -> Iterator[_Open]:
        """Yield the incidents for which somebody is called."""
        alarms = [e for e in self._open.values() if e.incident.severity is Severity.ALARM]
        explained = any(e.incident.cause.kind != CONSEQUENCE for e in alarms)
        for each in alarms:
            if each.incident.cause.kind != CONSEQUENCE or not explained:
                yield each

    def _call_for(self, each: _Open, now: float) -> None:
        incident = each.incident
        since = f' (for {_span(now - incident.began)} now)' if each.calls else ''
        each.next_call = now + min(FIRST_AGAIN * 2.0**each.calls, LONGEST_AGAIN)
        each.calls += 1
        self._call(Call(incident.text + since, incident, each.calls, over=False))

    def _finish(self, each: _Open, now: float) -> None:
        incident = replace(each.incident, ended=now)
        self._note(incident)
        self.past = [*self.past[-KEPT:], incident]
        if each.calls:
            lasted = _span(now - incident.began)
            ending = f': {each.ending}' if each.ending != incident.text else ''
            text = f'all clear after {lasted}: {incident.text}{ending}'
            self._call(Call(text, incident, each.calls, over=True))


def _span(seconds: float) -> str:
    if seconds < 120.0:
        return f'{seconds:.0f} s'
    return f'{seconds / 60.0:.0f} min' if seconds < 7200.0 else f'{seconds / 3600.0:.1f} h'
