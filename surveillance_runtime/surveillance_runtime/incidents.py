"""Incidents: what keeps a mission from its purpose, or what a person should know of.

An incident has a cause, a severity, a beginning and an end. A node begins and ends it
(`PatrolNode.incidents`), which publishes it on the topic `incidents` (`incident_topic`), logs it
and makes it a finding of the node's health. The node `alarm` keeps an `IncidentBook` of them, which
says what is to be told when: once at the beginning, again at distances that double, and once at the
end.

    node.incidents.begin(('door', 'D1'), 'D1 is closed: nothing else leads out of R1')
    node.incidents.end(('door', 'D1'))

What kinds there are, with their severity, delays and what a person is to do, is one table:
`surveillance_runtime.alarms`.
"""

from __future__ import annotations

import json
import math
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple

from surveillance_runtime.alarms import Severity as Severity
from surveillance_runtime.alarms import alarm_kind


class IncidentPhase(StrEnum):
    """How far an incident is when it is told of."""

    BEGIN = 'begin'
    UPDATE = 'update'
    END = 'end'


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
class SeenThing:
    """What the observer saw that made an incident.

    Attributes:
        number: Of the observer's event.
        kind, seen, subject: What it is, in which state, and its name; empty: it has none.
        position: Where, map frame, metres; None: not known.
        confidence: 0 to 1.
        rule: The rule that makes it matter, in words.
    """

    number: int
    kind: str
    seen: str
    subject: str = ''
    position: tuple[float, float] | None = None
    confidence: float = 0.0
    rule: str = ''

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> SeenThing:
        """Return what `asdict` gave.

        Raises:
            ValueError, KeyError, TypeError, IndexError: It is something else.
        """
        place, number = values['position'], int(values['number'])
        if not 0 <= number < 2**32:
            raise ValueError(f'number {number}: expected one of 32 bits')
        return cls(
            number,
            str(values['kind']),
            str(values['seen']),
            str(values['subject']),
            None if place is None else (float(place[0]), float(place[1])),
            float(values['confidence']),
            str(values['rule']),
        )


_TEXTS = ('text', 'id', 'robot', 'node', 'place', 'action', 'acknowledged_by')


@dataclass(frozen=True)
class IncidentUpdate:
    """An incident as its owner tells of it: it begins, it changes, or it is over.

    Attributes:
        phase: Which of these.
        cause: What it is about.
        severity: How much it matters.
        text: One sentence; at the end what made it end.
        id: The same from its beginning to its end.
        since: When it began, seconds on the owner's clock.
        robot: Whose it is; empty: of a run that has no names.
        node: Who tells of it.
        place: Where; empty: nowhere in particular.
        action: What a person is to do; empty: nobody knows.
        acknowledged_by: Who takes care of it; empty: nobody yet.
        evidence: Names of pictures that show it.
        finding: What the observer saw; None: it is of something else.
    """

    phase: IncidentPhase
    cause: Cause
    severity: Severity
    text: str
    id: str = ''
    since: float = 0.0
    robot: str = ''
    node: str = ''
    place: str = ''
    action: str = ''
    acknowledged_by: str = ''
    evidence: tuple[str, ...] = ()
    finding: SeenThing | None = None

    @property
    def over(self) -> bool:
        """Whether it is over."""
        return self.phase is IncidentPhase.END

    @property
    def owner(self) -> str:
        """Who tells of it, with the robot that it is of."""
        return f'{self.robot}/{self.node}' if self.robot else self.node

    def words(self) -> str:
        """Return it as a log has it, for people."""
        word = 'over' if self.over else self.severity.value
        return f'incident [{self.cause}, {word}]: {self.text}'

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> IncidentUpdate:
        """Return what `to_json` gave.

        Raises:
            ValueError, KeyError, TypeError, IndexError: It is something else.
        """
        given = dict(values)
        given['since'] = float(given.get('since', 0.0))
        if not math.isfinite(given['since']):
            raise ValueError(f'since {given["since"]}: expected a time')
        for key in _TEXTS:
            given[key] = str(given.get(key, ''))
        kind, name = given['cause']
        given['cause'] = Cause(str(kind), str(name))
        given['phase'], given['severity'] = (
            IncidentPhase(given['phase']),
            Severity(given['severity']),
        )
        given['evidence'] = tuple(str(each) for each in given.get('evidence', ()))
        if (seen := given.get('finding')) is not None:
            given['finding'] = SeenThing.from_json(seen)
        return cls(**given)

    def to_line(self) -> str:
        """Return it as one line, as the launcher hands it to the node `alarm`, see `from_line`."""
        return json.dumps(self.to_json())

    @classmethod
    def from_line(cls, line: str) -> IncidentUpdate:
        """Return what `to_line` gave.

        Raises:
            ValueError: It is something else.
        """
        try:
            return cls.from_json(json.loads(line))
        except (LookupError, TypeError, AttributeError, OverflowError, RecursionError) as error:
            raise ValueError(f'expected an incident, got {line[:60]!r}') from error


# --- in a node ---


class Incidents:
    """The incidents of one owner; safe from any thread.

    Args:
        tell: Called with each beginning, change and end; must not block.
        node: The owner's name.
        robot: Whose node it is; empty: of a run that has no names.
        now: Seconds on the owner's clock.
        steady: Steady seconds, by which the delays of `alarms.ALARMS` are kept, with `advance`;
            None: each incident begins and ends at once.
    """

    def __init__(
        self,
        tell: Callable[[IncidentUpdate], object],
        node: str = '',
        robot: str = '',
        now: Callable[[], float] = time.time,
        steady: Callable[[], float] | None = None,
    ) -> None:
        self._tell = tell
        self._steady = steady
        self._node, self._robot, self._now = node, robot, now
        # Held while it is told, too: an end that overtakes a change would never be over. Who is
        # told may ask what goes on.
        self._lock = threading.RLock()
        self._open: dict[Cause, IncidentUpdate] = {}
        # What holds, but not for its on-delay yet; what is away, but not for its off-delay yet.
        self._coming: dict[Cause, tuple[float, str, Severity, dict[str, Any]]] = {}
        self._going: dict[Cause, tuple[float, str]] = {}

    def begin(
        self,
        cause: tuple[str, str],
        text: str,
        severity: Severity | None = None,
        **more: Any,
    ) -> None:
        """Begin an incident; one that goes on gets another text, severity or the like.

        It is told when it has been so for its on-delay.

        Args:
            cause: Kind and name, see `Cause`.
            text: One sentence that names the cause.
            severity: Whether somebody is called; None: as the table says.
            **more: Others of `IncidentUpdate`'s: place, action, acknowledged_by, evidence, finding.
        """
        about, kind = Cause(*cause), alarm_kind(*cause)
        severity = kind.severity if severity is None else severity
        with self._lock:
            self._going.pop(about, None)
            known = self._open.get(about)
            if known is None and self._steady is not None and kind.on_delay:
                since = self._coming.get(about, (self._steady(),))[0]
                self._coming[about] = since, text, severity, more
                if self._steady() - since < kind.on_delay:
                    return
            self._coming.pop(about, None)
            if known is None:
                more.setdefault('action', kind.action)
            if known is None:
                told = IncidentUpdate(
                    *(
                        IncidentPhase.BEGIN,
                        about,
                        severity,
                        text,
                        uuid.uuid4().hex[:12],
                        self._now(),
                    ),
                    robot=self._robot,
                    node=self._node,
                    **more,
                )
            else:
                told = replace(
                    known, phase=IncidentPhase.UPDATE, severity=severity, text=text, **more
                )
                if told == replace(known, phase=IncidentPhase.UPDATE):
                    return
            self._open[about] = told
            self._tell(told)

    def acknowledge(self, cause: tuple[str, str], by: str) -> None:
        """Note who takes care of an incident; nothing happens when there is none.

        Args:
            cause: As it began.
            by: Who, in words.
        """
        with self._lock:
            known = self._open.get(Cause(*cause))
            if known is not None:
                going = self._going.get(known.cause)
                self.begin(cause, known.text, known.severity, acknowledged_by=by)
                if going is not None:
                    self._going[known.cause] = going

    def end(self, cause: tuple[str, str], text: str = '') -> None:
        """End an incident; nothing happens when there is none.

        It is told when it has been away for its off-delay, and has not begun again.

        Args:
            cause: As it began.
            text: What made it end; empty: what it was.
        """
        about, delay = Cause(*cause), alarm_kind(*cause).off_delay
        with self._lock:
            self._coming.pop(about, None)
            if about not in self._open:
                return
            if self._steady is not None and delay:
                at, _ = self._going.get(about, (self._steady() + delay, ''))
                self._going[about] = at, text
            else:
                self._end_now(about, text)

    def _end_now(self, about: Cause, text: str) -> None:
        self._going.pop(about, None)
        begun = self._open.pop(about)
        self._tell(replace(begun, phase=IncidentPhase.END, text=text or begun.text))

    def advance(self) -> None:
        """Tell what has held, or been away, for long enough; call it about each second."""
        if self._steady is None:
            return
        with self._lock:
            now = self._steady()
            for about, (_, text, severity, more) in list(self._coming.items()):
                self.begin(about, text, severity, **more)
            for about, (at, text) in list(self._going.items()):
                if now >= at:
                    self._end_now(about, text)

    def close(self) -> None:
        """Tell what is away already as over: nobody will come to tell it."""
        with self._lock:
            for about, (_, text) in list(self._going.items()):
                self._end_now(about, text)

    def end_all(self, kind: str, text: str = '') -> None:
        """End all incidents of one kind of cause."""
        for cause in [each for each in self.open() if each.kind == kind]:
            self.end(cause, text)

    def open(self) -> tuple[Cause, ...]:
        """Return the causes of those that hold."""
        with self._lock:
            return tuple(each for each in self._open if each not in self._going)

    def updates(self) -> tuple[IncidentUpdate, ...]:
        """Return those that go on, as they were told last."""
        with self._lock:
            return tuple(replace(each, phase=IncidentPhase.UPDATE) for each in self._open.values())


def thing_of(told: IncidentUpdate) -> Cause:
    """Return what an incident is about, whoever tells of it: of a finding about a door the door."""
    seen = told.finding
    is_door = seen is not None and seen.kind in ('door', 'way') and seen.subject
    return Cause('door', seen.subject) if seen is not None and is_door else told.cause


# --- for all nodes ---

FIRST_AGAIN = 240.0
"""The second call for an incident comes after this time, seconds; then the distance doubles: five
calls in the first hour (0, 4, 12, 28 and 60 minutes)."""
LONGEST_AGAIN = 4 * 3600.0
"""The longest distance between two calls, seconds."""
SETTLED = 5.0
"""An end counts when the incident has not begun again for this long, seconds."""
TOLD_AGAIN = 12 * SETTLED
"""So long after its owner was started again an incident ends that is not told again, seconds."""
CONSEQUENCE = 'robot'
"""Kind of the causes that say how the robot fares. While what keeps it from its purpose is told by
a cause of another kind, nobody is called for them as well."""
BESIDE = frozenset({'event', 'sight', 'sink', 'disk', 'clock', 'page'})
"""Kinds of the things that keep no robot from its purpose."""
KEPT = 1000
"""How many incidents that are over are kept."""
MOST_NUMBERS = 100
"""How many numbers of an incident are kept that began again: more are not latched."""
MOST_OPEN = 1000
"""How many go on at most: beyond these, of what a stranger may make up, none is taken."""


@dataclass(frozen=True)
class Incident:
    """One incident, from its beginning to its end, as the book has it.

    Attributes:
        told: What was said of it last while it went on.
        began: When it began, seconds on the book's clock.
        ended: When it ended; None: it goes on.
        calls: How often somebody was called.
        is_lost: Whether it ended since its owner, started again, has not told of it any more.
        also: Its owner's further numbers for it: it began again within moments.
    """

    told: IncidentUpdate
    began: float
    ended: float | None = None
    calls: int = 0
    is_lost: bool = False
    also: tuple[str, ...] = ()


@dataclass
class _Open:
    incident: Incident
    next_call: float = 0.0
    escalated: int = 0
    ends_at: float | None = None
    ending: str = ''
    is_lost: bool = False


class IncidentCall(NamedTuple):
    """A person is called.

    Attributes:
        text: One line.
        incident: What for.
        number: The how manieth call for it, from 1; 0: nobody is called, it is for who wants to
            know of warnings.
        over: Whether it is over.
        reached: Whoever is called after so long or less is told, seconds without an
            acknowledgement.
        only: Alone those are told who are called after just so long; None: all of them.
    """

    text: str
    incident: Incident
    number: int
    over: bool
    reached: float = 0.0
    only: float | None = None


class IncidentBook:
    """All incidents of a mission, and when somebody is to be called.

    Args:
        call: Called with each call.
        note: Called with each incident that has begun, and again when it has ended.
        is_quiet: Whether nobody is called for an incident at present, since a person wants it so.
        escalations: After how long without an acknowledgement others are called, too, seconds,
            ascending.
    """

    def __init__(
        self,
        call: Callable[[IncidentCall], object],
        note: Callable[[Incident], object] = lambda _i: None,
        is_quiet: Callable[[Incident], bool] = lambda _i: False,
        escalations: Sequence[float] = (),
    ) -> None:
        self._call = call
        self._note = note
        self._is_quiet = is_quiet
        self._escalations = tuple(escalations)
        self._open: dict[tuple[str, Cause], _Open] = {}
        self._over: dict[tuple[str, str], None] = {}
        self.past: list[Incident] = []

    def hear(self, told: IncidentUpdate, now: float) -> None:
        """Take what the owner of an incident tells.

        Args:
            told: What it tells.
            now: Steady time, seconds.
        """
        if (told.owner, told.id) in self._over:
            return
        key = told.owner, told.cause
        known = self._open.get(key)
        if told.over:
            if known is not None and (known.ends_at is None or known.is_lost):
                known.ends_at, known.ending = now + SETTLED, told.text
                known.is_lost = False
            return
        if known is None:
            if len(self._open) >= MOST_OPEN:
                return
            incident = Incident(told, now)
            self._open[key] = _Open(incident, next_call=now)
            self._note(incident)
        else:
            worse = Severity.ALARM in (told.severity, known.incident.told.severity)
            # One that has begun again within moments is the same for people.
            also = known.incident.also
            if told.id not in (known.incident.told.id, *also):
                also = (*also[-MOST_NUMBERS:], told.id)
            told = replace(told, id=known.incident.told.id)
            if worse:
                told = replace(told, severity=Severity.ALARM)
            known.incident = replace(known.incident, told=told, also=also)
            known.ends_at, known.is_lost = None, False
        self.advance(now)

    def restore(
        self,
        told: IncidentUpdate,
        began: float,
        calls: int,
        called: float,
        now: float,
        escalated: int = 0,
    ) -> None:
        """Take an incident that an earlier book had when its process ended.

        It ends unless its owner tells of it again.

        Args:
            told: What was known of it.
            began: When it began, seconds on this book's clock.
            calls: How often somebody was called.
            called: When that was last.
            now: Steady time, seconds.
            escalated: How many escalations there were.
        """
        incident = Incident(told, began, calls=calls)
        next_call = called + _again(calls) if calls else now
        ending = 'it was not told again after a restart'
        ends_at = now + TOLD_AGAIN
        self._open[told.owner, told.cause] = _Open(
            incident, next_call, escalated, ends_at, ending, True
        )

    def forget(self, owner: str, *numbers: str) -> None:
        """Take that an incident is over: what is still heard of it is old.

        The topic is latched: who begins to listen hears of the last hundred, also of those that
        have been over for long.

        Args:
            owner: Whose.
            numbers: The owner's for it.
        """
        self._over |= {(owner, number): None for number in numbers if number}
        while len(self._over) > KEPT:
            del self._over[next(iter(self._over))]

    def restarted(self, owner: str, now: float) -> None:
        """Take that a node was started again: what it told of ends, unless it tells of it again."""
        for (teller, _), each in self._open.items():
            if teller == owner and each.ends_at is None:
                each.ends_at, each.ending = now + TOLD_AGAIN, f'{owner} was started again'
                each.is_lost = True

    def advance(self, now: float) -> float | None:
        """Call whom it is time to call; return when to look again, None: after news."""
        for key, each in list(self._open.items()):
            if each.ends_at is not None and now >= each.ends_at:
                self._spare(each, now)
                del self._open[key]
                self._finish(each, each.ends_at - SETTLED)
        due = [each.ends_at for each in self._open.values() if each.ends_at is not None]
        for each in self._calling():
            if now >= each.next_call:
                self._call_for(each, now)
            due.append(each.next_call)
            while (at := self._escalates_at(each)) is not None and now >= at:
                self._escalate(each, now)
            due += [] if at is None else [at]
        return min(due, default=None)

    def _spare(self, ending: _Open, now: float) -> None:
        """Give the consequences of what ends time to end as well."""
        for first, following in self._joined():
            for each in following if first is ending else ():
                each.next_call = max(each.next_call, now + TOLD_AGAIN)

    def close(self, now: float) -> None:
        """End: what is over is told as such, though it might have begun again."""
        for key, each in list(self._open.items()):
            if each.ends_at is not None and each.ends_at <= now + SETTLED:
                del self._open[key]
                self._finish(each, each.ends_at - SETTLED)

    def open(self) -> tuple[Incident, ...]:
        """Return the incidents that go on."""
        return tuple(each.incident for each in self._open.values())

    def _calling(self) -> Iterator[_Open]:
        """Yield the incidents for which somebody is called."""
        for each, _ in self._joined():
            # Who takes care of it need not be called again.
            if not each.incident.told.acknowledged_by and not self._is_quiet(each.incident):
                yield each

    def _joined(self) -> list[tuple[_Open, list[_Open]]]:
        """Return the alarms, each with its consequences, which are no alarms of their own.

        Of one thing of one robot, as a shut door that the observer sees and that the mission waits
        at, the later ones are consequences of the first; how a robot fares is one of what else is
        wrong with it. An alarm that returned to normal and comes again is a new one (ISA-18.2),
        and one that nobody was called for, as it is muted, speaks for no other.
        """
        alarms = [e for e in self._open.values() if e.incident.told.severity is Severity.ALARM]
        faring = [e for e in alarms if e.incident.told.cause.kind == CONSEQUENCE]
        joined: list[tuple[_Open, list[_Open]]] = []
        newest: dict[tuple[str, Cause], tuple[_Open, list[_Open]]] = {}
        for each in alarms:
            told = each.incident.told
            if told.cause.kind == CONSEQUENCE:
                continue
            thing = told.robot, thing_of(told)
            known = newest.get(thing)
            if known is not None and self._explains(known[0], each):
                known[1].append(each)
            else:
                joined.append((each, []))
                newest[thing] = joined[-1]
        causes = [each for each in joined if thing_of(each[0].incident.told).kind not in BESIDE]
        for each in faring:
            whose = '', each.incident.told.robot
            for first, following in causes:
                if first.incident.told.robot in whose and self._explains(first, each):
                    following.append(each)
                    break
            else:
                joined.append((each, []))
        return joined

    def _explains(self, first: _Open, later: _Open) -> bool:
        """Tell whether somebody knows of an alarm, or is called, that had not returned before."""
        incident = first.incident
        returned = first.ends_at is not None and not first.is_lost
        if returned and later.incident.began >= (first.ends_at or 0.0) - SETTLED:
            return False
        return (
            incident.calls > 0
            or bool(incident.told.acknowledged_by)
            or not self._is_quiet(incident)
        )

    def _escalates_at(self, each: _Open) -> float | None:
        """Return when others are called for an incident, too; None: all are."""
        if each.escalated >= len(self._escalations):
            return None
        return each.incident.began + self._escalations[each.escalated]

    def _escalate(self, each: _Open, now: float) -> None:
        incident, after = each.incident, self._escalations[each.escalated]
        each.escalated += 1
        text = f'not acknowledged for {_span(now - incident.began)}: {incident.told.text}'
        self._call(IncidentCall(text, incident, incident.calls, False, after, after))

    def _reached(self, each: _Open) -> float:
        return self._escalations[each.escalated - 1] if each.escalated else 0.0

    def _so(self, each: _Open) -> str:
        """Say the consequences of an incident; empty: there are none."""
        following = next((also for first, also in self._joined() if first is each), [])
        texts = dict.fromkeys(other.incident.told.text for other in following)
        return f'; so: {"; ".join(texts)}' if texts else ''

    def _call_for(self, each: _Open, now: float) -> None:
        incident = each.incident
        since = f' (for {_span(now - incident.began)} now)' if incident.calls else ''
        each.next_call = now + _again(incident.calls + 1)
        each.incident = incident = replace(incident, calls=incident.calls + 1)
        text, reached = incident.told.text + since + self._so(each), self._reached(each)
        self._call(IncidentCall(text, incident, incident.calls, False, reached))

    def _finish(self, each: _Open, now: float) -> None:
        incident = replace(each.incident, ended=now, is_lost=each.is_lost)
        self._note(incident)
        if not incident.is_lost:  # its owner may have been silent only
            self.forget(incident.told.owner, incident.told.id, *incident.also)
        self.past = [*self.past[-KEPT:], incident]
        if incident.calls:
            text = incident.told.text
            lasted = _span(now - incident.began)
            if incident.told.finding is not None and not each.is_lost:
                text = each.ending  # which says what it was, too
            ending = f': {each.ending}' if each.ending != text else ''
            all_clear = f'all clear after {lasted}: {text}{ending}'
            reached = self._reached(each)
            self._call(IncidentCall(all_clear, incident, incident.calls, True, reached))


def _again(calls: int) -> float:
    """Return after how long somebody is called again who was called so often, seconds."""
    return min(FIRST_AGAIN * 2.0 ** (calls - 1), LONGEST_AGAIN)


def _span(seconds: float) -> str:
    if seconds < 120.0:
        return f'{seconds:.0f} s'
    return f'{seconds / 60.0:.0f} min' if seconds < 7200.0 else f'{seconds / 3600.0:.1f} h'
