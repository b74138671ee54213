"""Events: sightings of the same thing over visits and robots, from the first one to its end.

An event is open until a person acknowledges it, calls it normal or false, or it is over: what was
seen is seen no more, in a visit that would have shown it, or two looks show it as it is to be. The
book is bounded: of what is over the least severe and oldest goes first; what is open stays.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from typing import Any, NamedTuple

from indoor_watch.observations import Joined, Kind, Observation

SAME_PLACE = 0.75
"""Two sightings of one kind without a name are of one thing up to here, metres."""


SURE = 0.95
"""A sighting as sure as this needs no second one."""
ELSEWHERE = 0.5
"""A second look is one from so far from where the first one was, metres."""
OFF_DELAY = 10.0
"""Or one so long after the first one, where that says that an event is over, seconds. An off-delay
keeps an alarm from coming and going (ANSI/ISA-18.2, 2016); who stands in a doorway has left it by
then."""


class _Look(NamedTuple):
    """One look at an event's thing: which, how sure earlier ones were together, and its surest."""

    look: tuple[int, bool]
    earlier: float
    surest: float


class EventState(StrEnum):
    """How far an event is."""

    OPEN = 'open'
    ACKNOWLEDGED = 'acknowledged'
    NORMAL = 'normal'
    FALSE = 'false alarm'
    OVER = 'over'


@dataclass(frozen=True)
class Event:
    """What was seen once or more often.

    Attributes:
        number: Its number, from 1.
        kind, seen, place, subject, position: As in its last observation; ``seen`` is the state.
        severity: 0: of no rule; higher is worse.
        rule: The rule in words that makes it matter; empty: none.
        state: How far it is.
        began, last: First and last sighting, seconds since 1970.
        sightings: How many observations.
        looks: In how many visits it was seen.
        confidence: How likely it is so: of what is called 0.9, nine in ten are
            (measured: docs/reference/measurements.md). Sightings from one spot in one visit err
            together: the surest counts. Those of other visits, or from elsewhere, err each by
            itself.
        robots: Who saw it.
        evidence: Of the first sighting, the surest and the last one, as far as these differ.
        compared_with: What the last sighting was compared with; or empty.
        seen_from: Where the robot was at the first sighting, map frame, metres; None: not known.
        confirmed: Whether one sighting was sure, or it was seen from elsewhere or in another visit,
            too. Of a person whom the camera alone saw: from elsewhere.
        sensors: What saw it, of a person.
        first: The confidence of the first sighting.
        again: What confirmed it, and when; empty: nothing has, or one sighting was sure.
    """

    number: int
    kind: Kind
    seen: str
    place: str
    subject: str
    position: tuple[float, float] | None
    severity: int
    rule: str
    state: EventState
    began: float
    last: float
    sightings: int
    looks: int
    confidence: float
    robots: tuple[str, ...]
    evidence: tuple[str, ...]
    compared_with: str = ''
    seen_from: tuple[float, float] | None = None
    confirmed: bool = False
    sensors: tuple[str, ...] = ()
    first: float = 0.0
    again: str = ''

    def trail(self) -> str:
        """Say how it was made sure: 'first look 0.82, seen from elsewhere after 14 s, now 0.97'."""
        by = f' by {" and ".join(self.sensors)}' if self.sensors else ''
        if self.again:
            return f'first look {self.first:.2f}, {self.again}, now {self.confidence:.2f}{by}'
        if self.confirmed:
            return f'sure in one look, {self.confidence:.2f}{by}'
        lasted = max(0.0, self.last - self.began)
        return f'unverified, one look of {lasted:.0f} s, {self.confidence:.2f}{by}'

    def words(self) -> str:
        """Return it in words, as '3: door D1 is ajar in C1'."""
        seen = Observation(self.kind, self.seen, self.place, self.subject)
        at = '' if self.position is None or self.subject else ' at {:.1f}, {:.1f}'
        return f'{self.number}: {seen.words()}{at.format(*(self.position or ()))}'

    def ending(self, instead: Observation | None) -> str:
        """Say what ended it, and what it was, as 'R3: door D3 is open again (was closed)'.

        Args:
            instead: What was seen instead; None: it was seen no more, or a person has answered.
        """
        where = f'{self.place}: ' if self.place else ''
        if instead is not None:
            said = instead.kind.words(instead.state, instead.subject)
            if instead.state == 'movable':
                return f'{where}{said}'
            return f'{where}{said} again (was {self.seen})'
        said = self.kind.words(self.seen, self.subject)
        if self.state == EventState.OVER:
            return f'{where}it is seen no more that {said}'
        if self.state == EventState.NORMAL:
            return f'{where}{said}: taken as normal'
        return f'{where}{said}: a person calls it {self.state}'

    def to_json(self) -> dict[str, Any]:
        """Return it as plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Event:
        """Return what `to_json` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else.
        """
        given = dict(values)
        place = given['position']
        given['position'] = None if place is None else (float(place[0]), float(place[1]))
        if (origin := given.get('seen_from')) is not None:
            given['seen_from'] = (float(origin[0]), float(origin[1]))
        given['kind'], given['state'] = Kind(given['kind']), EventState(given['state'])
        for name in ('robots', 'evidence', 'sensors'):
            given[name] = tuple(given.get(name, ()))
        return cls(**given)


class EventBook:
    """All events, joined from observations.

    Args:
        most: How many are kept.
        told: Called with each event that begins or changes its state, and with what was seen
            instead where that ended it, else None.
    """

    def __init__(
        self,
        most: int = 2000,
        told: Callable[[Event, Observation | None], object] = lambda _event, _instead: None,
    ) -> None:
        self._most = most
        self._told = told
        self._events: dict[int, Event] = {}
        # What may be of one thing, of what goes on or is quiet: a month of what is over is not
        # looked through for each observation.
        self._current: dict[_Key, set[int]] = {}
        self._over: list[tuple[int, float, int]] = []
        self._normal: dict[_Key, list[Observation]] = {}
        self._next = 1
        self._visits: dict[int, int] = {}
        # Of each event the surest sighting with a picture: how sure, and the picture.
        self._surest: dict[int, tuple[float, str]] = {}
        self._looked: dict[int, _Look] = {}
        self._quiet: set[int] = set()
        # The first look of those that say that an event is over, and its visit.
        self._ending: dict[int, tuple[Observation, int]] = {}

    @property
    def events(self) -> list[Event]:
        """All events, the newest first."""
        return sorted(self._events.values(), key=lambda each: -each.last)

    def find(self, number: int) -> Event | None:
        """Return an event by its number."""
        return self._events.get(number)

    def take(self, seen: Observation, *, severity: int, rule: str, visit: int) -> Event | None:
        """Join an observation to its event, or begin one.

        Args:
            seen: What was seen.
            severity: What the rules make of it; 0: nothing, it only ends others.
            rule: The rule in words.
            visit: The number of the visit, so that two sightings of one visit count once.

        Returns:
            The event; None where it is normal, or of no severity and of no event.
        """
        if severity > 0:
            self._turn(seen)
        self._end_others(seen, visit if severity <= 0 else None)
        if any(_same(each, seen) for each in self._normal.get(_key(seen), ())):
            return None
        event = self._event_of(seen)
        if event is None:
            if severity <= 0:
                return None
            evidence = (seen.evidence,) if seen.evidence else ()
            event = Event(
                self._next,
                seen.kind,
                seen.state,
                seen.place,
                seen.subject,
                seen.position,
                severity,
                rule,
                EventState.OPEN,
                seen.stamp,
                seen.stamp,
                1,
                1,
                seen.confidence,
                (seen.robot,),
                evidence,
                seen.compared_with,
                seen.seen_from,
                seen.confidence >= SURE and not _by_camera_alone(seen.kind, (seen.sensor,)),
                (seen.sensor,) if seen.sensor else (),
                seen.confidence,
            )
            self._next += 1
            self._visits[event.number] = visit
            self._looked[event.number] = _Look((visit, False), 0.0, seen.confidence)
            self._surest[event.number] = seen.confidence, seen.evidence
            self._keep(event)
            return event
        self._ending.pop(event.number, None)
        new_visit = self._visits.get(event.number) != visit
        self._visits[event.number] = visit
        is_elsewhere = _apart(event.seen_from, seen.seen_from)
        how = 'from elsewhere' if is_elsewhere else 'in another visit'
        sensors = tuple(dict.fromkeys((*event.sensors, *([seen.sensor] if seen.sensor else ()))))
        alone = _by_camera_alone(seen.kind, sensors)
        # From where nobody knows, another visit has to do.
        by_visit = not alone or event.seen_from is None
        is_apart = is_elsewhere or (by_visit and event.looks + new_visit > 1)
        after = f'seen {how} after {max(0.0, seen.stamp - event.began):.0f} s'
        changed = replace(
            event,
            position=seen.position or event.position,
            severity=max(event.severity, severity),
            rule=rule or event.rule,
            # It may come late, from a robot that was cut off.
            began=min(event.began, seen.stamp),
            last=max(event.last, seen.stamp),
            sightings=event.sightings + 1,
            looks=event.looks + new_visit,
            confidence=self._confidence(event, seen, (visit, is_elsewhere)),
            robots=tuple(dict.fromkeys((*event.robots, seen.robot))),
            evidence=self._evidence(event, seen),
            compared_with=seen.compared_with or event.compared_with,
            confirmed=event.confirmed or is_apart or (seen.confidence >= SURE and not alone),
            again=after if is_apart and not (event.confirmed or event.again) else event.again,
            sensors=sensors,
        )
        self._events[event.number] = changed
        if changed.state != EventState.OPEN:
            self._index(changed)
        return changed

    def _confidence(self, event: Event, seen: Observation, look: tuple[int, bool]) -> float:
        """Return how likely an event is so after a further sighting.

        Args:
            event: As it is.
            seen: The sighting.
            look: The visit, and whether it is from elsewhere than the first one.
        """
        known = self._looked.get(event.number)
        if known is None:  # of before a restart
            known = _Look((-1, False), 0.0, event.confidence)
        if known.look != look:
            known = _Look(look, 1.0 - (1.0 - known.earlier) * (1.0 - known.surest), 0.0)
        known = known._replace(surest=max(known.surest, seen.confidence))
        self._looked[event.number] = known
        return 1.0 - (1.0 - known.earlier) * (1.0 - known.surest)

    def _evidence(self, event: Event, seen: Observation) -> tuple[str, ...]:
        """Return the pictures of an event that are kept: the first, the surest, the last."""
        if not seen.evidence:
            return event.evidence
        # After a restart it is not known how sure the first one was: it stays.
        first = ''.join(event.evidence[:1])
        sure, surest = self._surest.get(event.number, (1.0, first))
        if seen.confidence > sure or not surest:
            self._surest[event.number] = seen.confidence, seen.evidence
            surest = seen.evidence
        kept = (first, surest, seen.evidence)
        return tuple(dict.fromkeys(each for each in kept if each))

    def answer(self, number: int, state: EventState) -> Event:
        """Take a person's word: acknowledged, normal from now on, or a false alarm.

        Raises:
            KeyError: There is no such event.
            ValueError: Only the robot's looks end an event.
        """
        if state in (EventState.OPEN, EventState.OVER):
            raise ValueError(f'an event cannot be made {state} by hand')
        event = replace(self._events[number], state=state)
        if state == EventState.NORMAL:
            is_normal = Observation(
                event.kind, event.seen, event.place, event.subject, event.position
            )
            self._normal.setdefault(_key(is_normal), []).append(is_normal)
        if state == EventState.FALSE:
            self._quiet.add(number)
        self._keep(event)
        return event

    def end(self, number: int, stamp: float) -> Event | None:
        """Take that a visit would have shown what was seen, and did not; None where it was over.

        Raises:
            KeyError: There is no such event.
        """
        event = self._events[number]
        self._quiet.discard(number)
        self._index(event)
        if event.state not in _GOING_ON:
            return None
        event = replace(event, state=EventState.OVER, last=max(event.last, stamp))
        self._keep(event)
        return event

    def set_back(self, stamp: float) -> None:
        """Take that the clock was set back: what happened later than now happened now.

        Else nothing that is seen from now on could end it until its time comes once more.

        Args:
            stamp: Now, seconds since 1970.
        """
        for event in [each for each in self._events.values() if each.last > stamp]:
            changed = replace(event, began=min(event.began, stamp), last=stamp)
            self._events[event.number] = changed
            self._index(changed)

    def false_rate(self, since: float) -> float:
        """Return which part of the events since a time a person has called false."""
        found = [each for each in self._events.values() if each.began >= since]
        wrong = sum(each.state == EventState.FALSE for each in found)
        return wrong / len(found) if found else 0.0

    def state(self) -> dict[str, Any]:
        """Return all as plain values, for `restore`."""
        return {
            'events': [each.to_json() for each in self._events.values()],
            'normal': [each.to_json() for some in self._normal.values() for each in some],
            'next': self._next,
            'quiet': sorted(self._quiet),
        }

    def restore(self, values: Mapping[str, Any]) -> None:
        """Take what `state` gave, in place of all there is.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        events = [Event.from_json(each) for each in values['events']]
        normal = [Observation.from_json(each) for each in values['normal']]
        following = int(values['next'])
        quiet = {int(each) for each in values['quiet']}
        self._events = {each.number: each for each in events}
        self._normal, self._next = {}, following
        for each in normal:
            self._normal.setdefault(_key(each), []).append(each)
        self._visits, self._surest, self._quiet = {}, {}, quiet
        self._looked, self._ending = {}, {}
        self._current, self._over = {}, []
        for event in events:
            self._index(event)

    @property
    def current(self) -> list[Event]:
        """Those that are open, acknowledged, or called false and still seen, by number."""
        numbers = sorted(number for some in self._current.values() for number in some)
        return [self._events[number] for number in numbers]

    def _keep(self, event: Event, instead: Observation | None = None) -> None:
        self._events[event.number] = event
        self._index(event)
        self._told(event, instead)
        while len(self._events) > self._most and self._over:
            severity, last, number = heapq.heappop(self._over)
            least = self._events.get(number)
            # An entry of an event that went on since, or that was seen again, is stale.
            if least is None or least.state == EventState.OPEN:
                continue
            if (least.severity, least.last) != (severity, last):
                continue
            del self._events[number]
            self._quiet.discard(number)
            self._visits.pop(number, None)
            self._surest.pop(number, None)
            self._looked.pop(number, None)
            self._ending.pop(number, None)
            self._current.get(_key(least), set()).discard(number)

    def _index(self, event: Event) -> None:
        """Put an event where `_near` finds it, and where the least one is found."""
        some = self._current.setdefault(_key(event), set())
        if event.state in _GOING_ON or event.number in self._quiet:
            some.add(event.number)
        else:
            some.discard(event.number)
        if event.state != EventState.OPEN:
            heapq.heappush(self._over, (event.severity, event.last, event.number))
            if len(self._over) > 4 * self._most + 100:
                # Mostly stale entries of what was seen again and again.
                ended = (e for e in self._events.values() if e.state != EventState.OPEN)
                self._over = [(each.severity, each.last, each.number) for each in ended]
                heapq.heapify(self._over)

    def _near(self, seen: Observation) -> list[Event]:
        """Return what goes on, or is quiet, of what may be the same thing."""
        numbers = sorted(self._current.get(_key(seen), ()))
        return [each for each in map(self._events.__getitem__, numbers) if _alike(each, seen)]

    def _event_of(self, seen: Observation) -> Event | None:
        # What a person called false is not told again while it is seen.
        found = [each for each in self._near(seen) if _agrees(each, seen)]
        return max(found, key=lambda each: each.last, default=None)

    def _turn(self, seen: Observation) -> None:
        """Have an open event of a thing with a name go on in another state that breaks a rule, too.

        A door that was ajar and is closed now, where it is to be open, calls nobody again.
        """
        for each in self._near(seen):
            is_open = each.subject and each.state == EventState.OPEN
            if is_open and _ends(each, seen) and seen.stamp > each.last:
                self._keep(replace(each, seen=seen.state), seen)

    def _end_others(self, seen: Observation, visit: int | None) -> None:
        """End events of the same thing in another state: a door that is open is closed no more.

        Of a door two looks must say so: one that is wrong would have it told again. What pictures
        show is told once several of them agree.

        Args:
            seen: What was seen.
            visit: In which visit; None: it breaks a rule itself, and ends them at once.
        """
        for each in self._near(seen):
            if not _ends(each, seen) or seen.stamp <= each.last:
                continue
            if (
                each.kind == Kind.DOOR
                and visit is not None
                and not self._is_second(each.number, seen, visit)
            ):
                continue
            if each.state in _GOING_ON:
                self._keep(replace(each, state=EventState.OVER, last=seen.stamp), seen)
            self._quiet.discard(each.number)
            self._index(self._events[each.number])

    def _is_second(self, number: int, seen: Observation, visit: int) -> bool:
        """Tell whether an event's end was seen before, by a look that errs by itself."""
        first, in_visit = self._ending.setdefault(number, (seen, visit))
        is_apart = (
            visit != in_visit
            or abs(seen.stamp - first.stamp) >= OFF_DELAY
            or _apart(first.seen_from, seen.seen_from)
        )
        if is_apart:
            del self._ending[number]
        return is_apart


_GOING_ON = (EventState.OPEN, EventState.ACKNOWLEDGED)
_Key = tuple[Kind, str]


def _key(thing: Event | Observation) -> _Key:
    """Return what two sightings of one thing have in common for certain."""
    return thing.kind, thing.subject


def _alike(event: Event, seen: Observation) -> bool:
    """Tell whether an event and an observation are about one thing."""
    if event.kind != seen.kind or event.subject != seen.subject:
        return False
    if event.subject:
        return True
    if event.kind.joined == Joined.ALWAYS:
        return True
    by_place = event.kind.joined == Joined.BY_PLACE
    if by_place or event.position is None or seen.position is None:
        return event.place == seen.place
    return math.dist(event.position, seen.position) <= SAME_PLACE


def _agrees(event: Event, seen: Observation) -> bool:
    """Tell whether what was seen is what an event says.

    A thing that has appeared and one that was moved there both stand there.
    """
    there = event.kind == Kind.OBJECT and {event.seen, seen.state} <= {'appeared', 'moved'}
    return event.seen == seen.state or there


def _ends(event: Event, seen: Observation) -> bool:
    """Tell whether what was seen says that an event's thing is in another state now.

    Whom a camera saw may stand there still when nobody walks.
    """
    if seen.state == 'nobody walks' and (event.seen == 'nobody' or 'camera' in event.sensors):
        return False
    if event.kind == Kind.OBJECT and (event.seen == 'movable' or seen.state == 'unmapped'):
        return False  # beside it something else has come, or stood before the first look
    if event.seen == 'unmapped':
        return seen.state == 'removed'
    return not _agrees(event, seen)


def _apart(one: tuple[float, float] | None, other: tuple[float, float] | None) -> bool:
    """Tell whether two looks were from two spots."""
    return one is not None and other is not None and math.dist(one, other) >= ELSEWHERE


def _by_camera_alone(kind: Kind, sensors: tuple[str, ...]) -> bool:
    """Tell whether the camera alone saw a person.

    What looks like one from here, as a coat or a picture on the wall, does so in each picture from
    here, in whatever visit: a second look is from elsewhere then, or another sensor's.
    """
    return kind == Kind.PERSON and sensors == ('camera',)


def _same(normal: Observation, seen: Observation) -> bool:
    if normal.kind != seen.kind or normal.state != seen.state or normal.subject != seen.subject:
        return False
    by_place = normal.kind.joined == Joined.BY_PLACE
    if by_place or normal.position is None or seen.position is None:
        return normal.place == seen.place
    return math.dist(normal.position, seen.position) <= SAME_PLACE
