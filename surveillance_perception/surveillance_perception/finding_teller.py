"""Tells of what the observer found: in the log of the run, and as incidents.

The log has a line for each change of a finding, and one for each answer of a person, so that what
was seen on a day is known without the observer's state. An alert is an incident from when it begins
until a look shows that it is over, or a person calls it normal or false; while somebody takes care
of it nobody is called again.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from indoor_watch import Event, EventState, Observation
from strict_files.files import FileError
from surveillance_runtime.event_log import EventLog, RecordEntry, read_newest
from surveillance_runtime.incidents import Cause, Incidents, SeenThing, Severity

KIND = 'event'
"""Of the causes of such incidents."""
GOING_ON = (EventState.OPEN, EventState.ACKNOWLEDGED)
PERSON = 'a person'
"""Who answers: the service does not say who."""


class FindingTeller:
    """Tells of findings; in one thread.

    Args:
        incidents: Where alerts are told.
        record: The log of the run; empty: none.
        say: Takes a line for the node's log.
        complain: Takes a line about a log that cannot be written, once for each cause.
        now: Seconds on the mission's clock.

    Raises:
        FileError: The log cannot be opened for writing.
    """

    def __init__(
        self,
        incidents: Incidents,
        record: str,
        say: Callable[[str], object],
        complain: Callable[[str], object],
        now: Callable[[], float],
    ) -> None:
        self._incidents, self._say, self._complain, self._now = incidents, say, complain, now
        self._log = EventLog(record) if record else None
        self._told: dict[int, EventState] = {}
        self._looks: dict[int, int] = {}
        self._problem = ''
        # Findings that were told as unverified.
        self._unverified: set[int] = set()

    def changed(self, finding: Event, instead: Observation | None = None) -> None:
        """Take a finding that has begun or changed its state.

        Args:
            finding: The finding.
            instead: What was seen instead, where that ended it.
        """
        cause = cause_of(finding)
        if self._told.get(finding.number) != finding.state:
            self._told[finding.number] = finding.state
            self._say(f'event {finding.words()}')
            self._write_finding(finding)
        if finding.state == EventState.ACKNOWLEDGED:
            self._incidents.acknowledge(cause, PERSON)
        elif finding.state != EventState.OPEN:
            self._incidents.end(cause, finding.ending(instead))

    def alert(self, finding: Event) -> None:
        """Take that people are to be called for a finding, if they are not yet."""
        # Told once: each look sees the middle of a thing elsewhere by some centimetres.
        is_told = cause_of(finding) in self._incidents.open()
        if is_told and finding.number not in self._unverified:
            return
        self._unverified.discard(finding.number)
        self._begin(finding, _name(finding.rule), Severity.ALARM)

    def warn(self, finding: Event) -> None:
        """Take that one look alone says so, and nobody could look again: nobody is called."""
        if cause_of(finding) not in self._incidents.open():
            self._unverified.add(finding.number)
            self._begin(finding, _name(finding.rule), Severity.WARNING)

    def _begin(self, finding: Event, why: str, severity: Severity) -> None:
        self._incidents.begin(
            cause_of(finding),
            f'{finding.words()} ({finding.trail()}; {why})',
            severity,
            place=finding.place,
            evidence=tuple(dict.fromkeys((*finding.evidence[:1], *finding.evidence[-1:]))),
            finding=SeenThing(
                finding.number,
                finding.kind.value,
                finding.seen,
                finding.subject,
                finding.position,
                finding.confidence,
                finding.rule,
            ),
        )

    def answered(self, line: str, answer: str) -> None:
        """Take what a person has said of a finding, and what came of it."""
        if line.strip() != 'events':
            self._write('answer', line=line, answer=answer, by=PERSON)

    def keep(self, findings: Iterable[Event]) -> None:
        """Write what has been seen in further looks since it was written last."""
        for each in findings:
            if self._looks.get(each.number, each.looks) != each.looks:
                self._write_finding(each)

    def kept(self, book: Mapping[str, Any]) -> dict[str, Any]:
        """Return what an observer keeps of its book beside the log: what goes on.

        Args:
            book: As `EventBook.state` gives it.
        """
        told = {int(each.name) for each in self._incidents.open() if each.kind == KIND}
        alerted = sorted(told - self._unverified)
        if self._log is None:
            return {**book, 'alerted': alerted}
        quiet = set(book['quiet'])
        open_ones = [
            each for each in book['events'] if each['state'] in GOING_ON or each['number'] in quiet
        ]
        return {**book, 'events': open_ones, 'alerted': alerted}

    def restored(self, kept: Mapping[str, Any]) -> dict[str, Any]:
        """Return the whole book of what `kept` gave, with what the log has of what is over.

        Raises:
            KeyError, TypeError: It is something else.
        """
        by_number = {each['number']: each for each in kept['events']}
        if self._log is not None:
            past = findings_of(read_newest(self._log.path))
            by_number = {number: each.to_json() for number, each in past.items()} | by_number
        return {**kept, 'events': list(by_number.values())}

    def take_up(self, kept: Mapping[str, Any], find: Callable[[int], Event | None]) -> None:
        """Tell again of the alerts that an earlier observer had told of and that go on.

        Args:
            kept: What `kept` gave.
            find: Returns the finding of a number.
        """
        for number in kept.get('alerted', ()):
            finding = find(int(number))
            if finding is not None and finding.state in GOING_ON:
                self.alert(finding)
                if finding.state == EventState.ACKNOWLEDGED:
                    self._incidents.acknowledge(cause_of(finding), PERSON)

    def close(self) -> None:
        """Close the log; nothing is lost without it."""
        if self._log is not None:
            self._log.close()

    def _write_finding(self, finding: Event) -> None:
        self._looks[finding.number] = finding.looks
        self._write('finding', **finding.to_json())

    def _write(self, kind: str, /, **fields: object) -> None:
        if self._log is None:
            return
        try:
            self._log.write(kind, self._now(), **fields)
            self._problem = ''
        except FileError as error:
            if str(error) != self._problem:
                self._problem = str(error)
                self._complain(self._problem)


def _name(rule: str) -> str:
    """Return the name that a person gave a rule, or the rule in words where it has none."""
    return rule.partition(': ')[0]


def cause_of(finding: Event) -> Cause:
    """Return what the incident of a finding is about."""
    return Cause(KIND, str(finding.number))


def findings_of(entries: Iterable[RecordEntry]) -> dict[int, Event]:
    """Return the findings of a log by their numbers, as they were written last."""
    found = {}
    for entry in entries:
        if entry.name == 'finding':
            with contextlib.suppress(ValueError, KeyError, TypeError):  # of another version
                finding = Event.from_json(entry.fields)
                found[finding.number] = finding
    return found
