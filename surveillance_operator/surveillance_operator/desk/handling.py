"""What people do about alarms: the states of ISA-18.2, and the lines that change them.

An alarm goes on until its owner says that it is over; a person acknowledges it, which ends the
calls but not the alarm. So it is in one of these states (ISA-18.2-2016, clause 5; the names are
those of the standard in plain words):

    going on:  unacknowledged -> acknowledged;  shelved or muted for a time
    over:      returned, until a person has acknowledged it -> over

A person says so by a line: ``acknowledge ID by Anna: I look after it``, ``shelve ID 2 h``, ``assign
ID to Ben``, ``note ID: text``, ``normal ID``, ``false ID``, ``unshelve ID``, ``mute person daily
08:00-18:00``, ``unmute person``. Each becomes an entry `handling` of the log, from which a keeper
that is started again, the page, the search and the reports know it: there is no other store.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from enum import StrEnum
from typing import Any

from patrol_policy.hours import WeeklyHours
from strict_files.one_line import clean
from strict_files.suggestions import nearest
from surveillance_runtime.incidents import Incident, IncidentUpdate

NOBODY_NAMED = 'a person'
"""Who has done something where no name is told."""
LONGEST_SHELF = 24 * 3600.0
"""A shelf ends by itself after at most this time, seconds: what is shelved for good is a rule."""
MOST_MUTES = 50
_UNITS = {'s': 1.0, 'min': 60.0, 'm': 60.0, 'h': 3600.0}
_LONGEST_NAME, _LONGEST_NOTE = 60, 500


class AlarmState(StrEnum):
    """How far an alarm is."""

    UNACKNOWLEDGED = 'unacknowledged'
    ACKNOWLEDGED = 'acknowledged'
    SHELVED = 'shelved'
    MUTED = 'muted'
    RETURNED = 'returned'
    OVER = 'over'


VERBS: Mapping[str, str] = {
    'acknowledge': 'somebody takes care of it: nobody is called again',
    'note': 'a remark is kept with it',
    'assign': 'somebody is to take care of it',
    'shelve': 'nobody is called for a time',
    'unshelve': 'the shelf ends',
    'normal': 'it is normal from now on',
    'false': 'it was a false alarm',
    'mute': 'nobody is called for a kind in some hours',
    'unmute': 'the kind is told again',
}
"""What a person may say of an alarm, and what it means."""
OF_KINDS = ('mute', 'unmute')
"""Verbs that are about a kind of alarm."""


@dataclass(frozen=True)
class Handled:
    """One thing that a person has said.

    Attributes:
        verb: One of `VERBS`.
        id: Of the incident; of a verb of `OF_KINDS` the kind.
        by: Who.
        at: When, seconds since 1970.
        note: A remark; empty: none.
        until: When a shelf ends, seconds since 1970; 0: it is none.
        to: Whom it is assigned to.
        hours: When the kind is muted.
    """

    verb: str
    id: str
    by: str
    at: float
    note: str = ''
    until: float = 0.0
    to: str = ''
    hours: str = ''

    @property
    def text(self) -> str:
        """It in words, without who."""
        more = ''
        if self.until:
            more = f' until {datetime.fromtimestamp(self.until):%H:%M}'
        elif self.to:
            more = f' to {self.to}'
        elif self.verb in OF_KINDS:
            more = f' {self.id} {self.hours}'.rstrip()
        return f'{self.verb}{more}' + (f': {self.note}' if self.note else '')

    def to_fields(self) -> dict[str, Any]:
        """Return it as the fields of an entry `handling`."""
        fields = {'id': self.id, 'verb': self.verb, 'by': self.by, 'text': self.text}
        more = {'note': self.note, 'until': self.until, 'to': self.to, 'hours': self.hours}
        return fields | {key: value for key, value in more.items() if value}

    @classmethod
    def from_fields(cls, fields: Mapping[str, Any], at: float) -> Handled:
        """Return what `to_fields` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        if fields['verb'] not in VERBS:
            raise ValueError(f'{fields["verb"]!r}: expected one of {", ".join(VERBS)}')
        texts = {key: str(fields.get(key, '')) for key in ('note', 'to', 'hours')}
        until = float(fields.get('until', 0.0))
        return cls(fields['verb'], str(fields['id']), str(fields['by']), at, until=until, **texts)


@dataclass(frozen=True)
class Handling:
    """What people have done about one alarm.

    Attributes:
        acknowledged_by, acknowledged_at: Who, and when, seconds since 1970; empty, 0: nobody.
        assigned_to: Who is to take care of it.
        shelved_until: Seconds since 1970; 0: it is not shelved.
        answer: `normal` or `false`; empty: neither.
        said: All of it, in its order.
    """

    acknowledged_by: str = ''
    acknowledged_at: float = 0.0
    assigned_to: str = ''
    shelved_until: float = 0.0
    answer: str = ''
    said: tuple[Handled, ...] = ()

    def after(self, done: Handled) -> Handling:
        """Return it after one more thing was said."""
        changes: dict[str, Any] = {}
        if done.verb in ('acknowledge', 'normal', 'false') and not self.acknowledged_by:
            changes = {'acknowledged_by': done.by, 'acknowledged_at': done.at}
        if done.verb in ('normal', 'false'):
            changes['answer'] = done.verb
        elif done.verb == 'assign':
            changes['assigned_to'] = done.to
        elif done.verb in ('shelve', 'unshelve'):
            changes['shelved_until'] = done.until
        return replace(self, said=(*self.said, done), **changes)

    def state(self, *, goes_on: bool, now: float, muted: bool = False) -> AlarmState:
        """Return the state of an alarm.

        Args:
            goes_on: Whether its cause does.
            now: Seconds since 1970.
            muted: Whether its kind is muted now.
        """
        if not goes_on:
            return AlarmState.OVER if self.acknowledged_by else AlarmState.RETURNED
        if now < self.shelved_until:
            return AlarmState.SHELVED
        if self.acknowledged_by:
            return AlarmState.ACKNOWLEDGED
        return AlarmState.MUTED if muted else AlarmState.UNACKNOWLEDGED


class Mutes:
    """Kinds of alarms that nobody is called for in some hours."""

    def __init__(self) -> None:
        self._by_kind: dict[str, tuple[WeeklyHours, Handled]] = {}

    def __bool__(self) -> bool:
        return bool(self._by_kind)

    def take(self, done: Handled) -> None:
        """Take that a kind is muted, or no more.

        Raises:
            ValueError: The hours are none, or there are too many mutes.
        """
        if done.verb == 'unmute':
            self._by_kind.pop(done.id, None)
            return
        hours = WeeklyHours.parse(done.hours)
        if len(self._by_kind) >= MOST_MUTES and done.id not in self._by_kind:
            raise ValueError(f'more than {MOST_MUTES} kinds are muted: unmute one first')
        self._by_kind[done.id] = hours, done

    def holds(self, kinds: Iterable[str], at: float) -> bool:
        """Tell whether one of the kinds is muted at a time, seconds since 1970."""
        if not self._by_kind:
            return False
        moment = datetime.fromtimestamp(at)
        found = (self._by_kind.get(kind) for kind in kinds)
        return any(each is not None and each[0].at(moment) == 'must' for each in found)

    def listed(self) -> list[dict[str, Any]]:
        """Return them as plain values."""
        return [
            {'kind': kind, 'hours': done.hours, 'by': done.by, 'at': done.at, 'note': done.note}
            for kind, (_, done) in sorted(self._by_kind.items())
        ]


def kinds_of(told: IncidentUpdate) -> tuple[str, ...]:
    """Return the kinds of an incident: that of its cause, and of what was seen."""
    seen = told.finding
    return (told.cause.kind,) if seen is None else (told.cause.kind, seen.kind)


def _thing(told: IncidentUpdate) -> tuple[str, ...]:
    """Return what is shelved: the same thing in the same place, also when it comes again."""
    seen = told.finding
    if seen is None:
        return (told.owner, *told.cause)
    return (told.robot, seen.kind, seen.seen, seen.subject, told.place)


class AlarmDesk:
    """Keeps what people have done about the alarms of a run; one thread at a time.

    Args:
        write: Keeps what was said: takes it, and the name of the robot whose alarm it is.
        wall: Returns the seconds since 1970.
    """

    def __init__(
        self, write: Callable[[Handled, str], object], wall: Callable[[], float] = time.time
    ) -> None:
        self._write, self._wall = write, wall
        self._handling: dict[str, Handling] = {}
        self._shelves: dict[tuple[str, ...], Handled] = {}
        self.mutes = Mutes()

    def of(self, number: str) -> Handling:
        """Return what was done about an incident."""
        return self._handling.get(number, Handling())

    def began(self, told: IncidentUpdate) -> None:
        """Take an incident that has begun: what is shelved stays so when it comes again."""
        shelf = self._shelves.get(_thing(told))
        if shelf is not None and shelf.until > self._wall():
            self._keep(replace(shelf, id=told.id, at=self._wall(), note='again'), told.robot)

    def heard(self, told: IncidentUpdate) -> None:
        """Take that its owner says who takes care of it."""
        if told.acknowledged_by and not self.of(told.id).acknowledged_by:
            done = Handled('acknowledge', told.id, told.acknowledged_by, self._wall())
            self._keep(done, told.robot)

    def is_quiet(self, incident: Incident) -> bool:
        """Tell whether nobody is called for an incident now."""
        told, now = incident.told, self._wall()
        muted = self.mutes.holds(kinds_of(told), now)
        state = self.of(told.id).state(goes_on=True, now=now, muted=muted)
        return state is not AlarmState.UNACKNOWLEDGED

    def next_change(self) -> float | None:
        """Return in how many seconds a shelf may end, or a mute; None: there is none."""
        now = self._wall()
        ends = [each.until - now for each in self._shelves.values() if each.until > now]
        return min([*ends, *([30.0] if self.mutes else [])], default=None)

    def carry_out(self, line: str, known: Mapping[str, IncidentUpdate]) -> str:
        """Do what a line says; return what was done.

        Args:
            line: See the head of this module.
            known: The incidents by their numbers.

        Raises:
            ValueError: What was wrong, and what was expected.
        """
        done = parsed(line, self._wall())
        if done.verb in OF_KINDS:
            self.mutes.take(done)
            self._write(done, '')
            return f'{done.text}, by {done.by}'
        told = _found(done.id, known)
        done = replace(done, id=told.id)
        self._keep(done, told.robot)
        if done.verb in ('shelve', 'unshelve'):
            self._shelves[_thing(told)] = done
        return f'{done.text}, by {done.by}: {told.text}'

    def restore(self, done: Handled, told: IncidentUpdate | None) -> None:
        """Take what was said before this process.

        Args:
            done: What was said.
            told: The incident; None: it is of a kind, or not known.

        Raises:
            ValueError: It is of a kind and its hours are none.
        """
        if done.verb in OF_KINDS:
            self.mutes.take(done)
            return
        self._handling[done.id] = self.of(done.id).after(done)
        if told is not None and done.verb in ('shelve', 'unshelve'):
            self._shelves[_thing(told)] = done

    def forget(self, numbers: Iterable[str]) -> None:
        """Forget incidents that nobody can say anything of any more."""
        for number in numbers:
            self._handling.pop(number, None)
        now = self._wall()
        self._shelves = {key: each for key, each in self._shelves.items() if each.until > now}

    def _keep(self, done: Handled, robot: str) -> None:
        self._handling[done.id] = self.of(done.id).after(done)
        self._write(done, robot)


def _found(given: str, known: Mapping[str, IncidentUpdate]) -> IncidentUpdate:
    """Return the incident that a person means: by its number, the begin of it, or its event's.

    Raises:
        ValueError: There is none, or more than one.
    """
    if given in known:
        return known[given]
    found = [
        told
        for number, told in known.items()
        if (len(given) >= 4 and number.startswith(given)) or told.cause == ('event', given)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f'{given!r} names {len(found)} alarms: expected more of its number')
    newest = ', '.join(list(known)[-5:]) or 'none'
    raise ValueError(f'there is no alarm {given[:40]!r}, the newest are: {newest}')


def parsed(line: str, at: float) -> Handled:
    """Return what a line says.

    Args:
        line: See the head of this module.
        at: Now, seconds since 1970.

    Raises:
        ValueError: What was wrong, and what was expected.
    """
    head, _, note = line.strip().partition(': ')
    head, by, name = head.removesuffix(':').rpartition(' by ')
    if not by:
        head, name = name, NOBODY_NAMED
    note, name = clean(note.strip()), clean(name.strip()) or NOBODY_NAMED
    if len(note) > _LONGEST_NOTE or len(name) > _LONGEST_NAME:
        raise ValueError(f'expected a name of {_LONGEST_NAME} and a note of {_LONGEST_NOTE} signs')
    verb, _, rest = head.strip().partition(' ')
    about, _, rest = rest.strip().partition(' ')
    rest = rest.strip()
    if verb not in VERBS:
        raise ValueError(f'got {verb[:40]!r}, expected {nearest(verb[:40], VERBS)}')
    if not about:
        what = 'a kind, such as person' if verb in OF_KINDS else "the alarm's number"
        raise ValueError(f'{verb}: expected {what}')
    done = Handled(verb, clean(about), name, at, note)
    if verb == 'shelve':
        return replace(done, until=at + _seconds(rest or '2 h'))
    if verb == 'assign':
        to = clean(rest.removeprefix('to ').strip())
        if not to or len(to) > _LONGEST_NAME:
            raise ValueError('assign: expected whom, such as `assign 4f2a to Ben`')
        return replace(done, to=to)
    if verb == 'mute':
        hours = rest or 'daily 00:00-24:00'
        hours = f'daily {hours}' if re.match(r'\d', hours) else hours
        WeeklyHours.parse(hours)
        return replace(done, hours=hours)
    if rest:
        raise ValueError(f'{verb}: {rest[:40]!r} is too much, a remark stands behind a colon')
    if verb == 'note' and not note:
        raise ValueError('note: expected a remark, such as `note 4f2a: the cleaner`')
    return done


def _seconds(text: str) -> float:
    match = re.fullmatch(r'(?:for )?(\d+(?:\.\d+)?) ?(s|min|m|h)', text)
    if match is None:
        raise ValueError(f"shelve: got {text[:40]!r}, expected such as '2 h' or '30 min'")
    seconds = float(match[1]) * _UNITS[match[2]]
    if not 0 < seconds <= LONGEST_SHELF:
        raise ValueError(f'shelve: expected up to {LONGEST_SHELF / 3600:g} h')
    return seconds
