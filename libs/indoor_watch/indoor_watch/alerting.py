"""What is made of an observation: how usual it is, which rule it breaks, its event, who is called.

An alert that one look alone does not make sure waits for a second look.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, Protocol

from indoor_watch.events import Event, EventBook, EventState
from indoor_watch.evidence import BLURRED, SWEEP, EvidenceStore, side_by_side
from indoor_watch.habits import Habits
from indoor_watch.observations import Observation
from indoor_watch.persons import Picture
from indoor_watch.visit import Pictured, Visit
from indoor_watch.watch_rules import Level, WatchRule, severity_of

SENT_WITHIN = 60.0
"""Whoever was told of a picture that is replaced has sent it by then, seconds."""
Drawn = Callable[[tuple[float, float], Visit], tuple[Picture, Picture | None] | None]
"""Draws what a lidar met around a point of the map, and what stands there normally."""
Blur = Callable[[Picture], tuple[Picture, bool]]
"""Blurs people in a picture, and tells whether nobody in it can be recognised any more."""


class Alerting:
    """Judges observations by the rules; owned by whoever calls it, one thread.

    Args:
        rules: What matters.
        book: Joins what was seen to events.
        local: Returns the local time of a stamp.
        robot: Whose observations they are.
        tell: Called with each observation.
        alert: Called with each event of level ALERT that lasts as long as its rule wants.
        warn: Called with each of them that nobody could look at again, where its rule wants that.
        store: Keeps pictures; None: nothing is kept.
        drawn: Draws what has no picture.
        blur: Blurs people in pictures, for rules that do not want them sharp; None: all are kept
            as they are.
        verify_seconds: An alert that is not sure waits so long for a second look.
    """

    def __init__(
        self,
        rules: Sequence[WatchRule],
        book: EventBook,
        *,
        local: Callable[[float], datetime],
        robot: str,
        tell: Callable[[Observation], object],
        alert: Callable[[Event], object],
        warn: Callable[[Event], object] = lambda _: None,
        store: EvidenceStore | None,
        drawn: Drawn,
        verify_seconds: float,
        blur: Blur | None = None,
    ) -> None:
        self.rules, self.book = tuple(rules), book
        self._local, self._robot, self._tell = local, robot, tell
        self._alert, self._warn = alert, warn
        self._store, self._drawn, self._blur = store, drawn, blur
        self._verify_seconds = verify_seconds
        self._habits = Habits()
        self._by_words = {each.words(): each for each in self.rules}
        self._doubts: dict[int, float] = {}
        # Events that nobody could look at again in time: told once.
        self._given_up: set[int] = set()
        # How bad each doubt is when nobody looks again, by its rule.
        self._unverified: dict[int, Level] = {}
        # Pictures that no event has any more, and since when.
        self._replaced: deque[tuple[float, str]] = deque()

    def follow(self, rules: Sequence[WatchRule]) -> None:
        """Judge by other rules from now on; what an earlier one has made keeps that."""
        self.rules = tuple(rules)
        self._by_words |= {each.words(): each for each in self.rules}

    def take(self, noted: Iterable[Pictured], visit: Visit) -> None:
        """Take what was noticed in a visit."""
        for each in noted:
            self._take(each, visit)

    def _take(self, pictured: Pictured, visit: Visit) -> None:
        seen = replace(pictured.seen, usual=self._habits.usual(pictured.seen))
        self._habits.learn(seen, visit.number)
        severity, rule = severity_of(self.rules, seen, self._local(seen.stamp))
        is_sharp = rule is not None and rule.sharp
        evidence = self._keep(pictured, severity, visit, is_sharp=is_sharp) if severity else ''
        seen = replace(seen, robot=self._robot, evidence=evidence, seen_from=visit.at)
        self._tell(seen)
        words = '' if rule is None else rule.words()
        before = self._pictures()
        event = self.book.take(seen, severity=severity, rule=words, visit=visit.number)
        if evidence:
            self._drop((before | {evidence}) - self._pictures(), seen.stamp)
        if event is None or rule is None or event.state != EventState.OPEN:
            return
        lasts = rule.lasting(event.looks, event.last - event.began)
        if event.severity >= Level.ALERT and lasts:
            if event.confirmed or not self._verify_seconds:
                self._doubts.pop(event.number, None)
                self._alert(event)
            elif event.number not in self._given_up:
                self._doubts.setdefault(event.number, seen.stamp + self._verify_seconds)
                self._unverified[event.number] = rule.unverified_level

    def _keep(self, pictured: Pictured, severity: int, visit: Visit, *, is_sharp: bool) -> str:
        """Keep a picture, and return its file; empty: there is none."""
        if self._store is None:
            return ''
        seen, picture, before, kind = pictured.seen, pictured.picture, pictured.before, ''
        if picture is None and seen.position is not None:
            drawn = self._drawn(seen.position, visit)
            if drawn is not None:
                (picture, before), kind = drawn, SWEEP
                # What the first look shows is normal already: the map alone is what it is beside.
                before = None if seen.state == 'unmapped' else before
        if picture is None:
            return ''
        if self._blur is not None and not is_sharp and not kind:
            picture, is_complete = self._blur(picture)
            if before is not None:
                before, is_also = self._blur(before)
                is_complete = is_complete and is_also
            kind = BLURRED if is_complete else ''
        if before is not None:
            picture = side_by_side(before, picture)
        what = f'{kind}{seen.kind}-{seen.subject or seen.place}-{seen.state}'
        return self._store.keep(picture, what, severity, seen.stamp, self._pictures())

    def _pictures(self) -> set[str]:
        """Return the pictures of the events that go on."""
        return {name for each in self.book.current for name in each.evidence}

    def _drop(self, names: Iterable[str], stamp: float) -> None:
        """Delete pictures that a later one replaces, once nobody sends them any more."""
        if self._store is None:
            return
        self._replaced += [(stamp, each) for each in names]
        while self._replaced and not 0.0 <= stamp - self._replaced[0][0] < SENT_WITHIN:
            _, name = self._replaced.popleft()
            if name not in self._pictures():
                self._store.delete(name)

    def end(self, numbers: Iterable[int], stamp: float) -> None:
        """Take that what made some events is seen no more."""
        for number in numbers:
            self.book.end(number, stamp)

    def accept(self, stamp: float) -> None:
        """Take as normal what goes on for so long as its rule says, and nobody has answered.

        Args:
            stamp: Now, seconds since 1970.
        """
        for event in self.book.current:
            rule = self._by_words.get(event.rule)
            is_due = rule is not None and stamp - event.began >= rule.accepted
            if is_due and event.state == EventState.OPEN:
                self.book.answer(event.number, EventState.NORMAL)

    def doubts(self, stamp: float) -> list[Event]:
        """Return the alerts that wait until the robot has looked again.

        One that nobody could look at again in time is told as its rule says: as an alert, or as
        unverified. So is one whose time is no longer known, for the clock was set back.
        """
        self._given_up = {
            number
            for number in self._given_up
            if (known := self.book.find(number)) is not None and known.state == EventState.OPEN
        }
        for number, until in list(self._doubts.items()):
            event = self.book.find(number)
            if event is None or event.state != EventState.OPEN:
                del self._doubts[number]
            elif not until - self._verify_seconds <= stamp < until:
                del self._doubts[number]
                is_alert = self._unverified.pop(number, Level.ALERT) >= Level.ALERT
                (self._alert if is_alert else self._warn)(event)
                self._given_up.add(number)
        return [each for each in map(self.book.find, self._doubts) if each is not None]

    def state(self) -> dict[str, Any]:
        """Return what must not be forgotten as plain values, for `restore`."""
        return {
            'book': self.book.state(),
            'habits': self._habits.state(),
            'doubts': {str(number): until for number, until in self._doubts.items()},
            'unverified': {str(number): int(level) for number, level in self._unverified.items()},
        }

    def restore(self, kept: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        doubts = {int(each): float(until) for each, until in dict(kept['doubts']).items()}
        levels = {
            int(each): Level(level) for each, level in dict(kept.get('unverified', {})).items()
        }
        with restoring_all() as parts:
            parts(self._habits, kept['habits'])
            parts(self.book, kept['book'])
        self._doubts, self._unverified = doubts, levels


class _Restorable(Protocol):
    def state(self) -> dict[str, Any]: ...

    def restore(self, kept: Mapping[str, Any], /) -> None: ...


@contextlib.contextmanager
def restoring_all() -> Iterator[Callable[[_Restorable, Mapping[str, Any]], None]]:
    """Restore several parts, or none: one that does not fit gives back what those before it had."""
    with contextlib.ExitStack() as undo:

        def restore(part: _Restorable, kept: Mapping[str, Any]) -> None:
            undo.callback(part.restore, part.state())
            part.restore(kept)

        yield restore
        undo.pop_all()
