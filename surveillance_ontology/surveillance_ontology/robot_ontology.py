"""The robot's half of the patrol's ontology: where it is, what it visited, what follows from it.

    ontology = RobotOntology(ArmorClient('me', 'surveillance', transport))
    ontology.record_place('C1', stamp)              # by the one node that knows where the robot is
    # By the one node that decides: when it visited what, and what follows, all of one moment.
    ontology.snapshot(130.0, ['URGENT'], visits={'C1': 120.0})

A fact is replaced by ``SET``, so the robot cannot be told to be in two places, whoever tells it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from armor_service.client import ArmorClient, ArmorServiceInternalError
from armor_service.protocol import DirectiveRequest, DirectiveResponse
from surveillance_ontology.patrol_directives import (
    PatrolDirectives,
    is_gone,
    names_in,
    time_in,
    values_in,
)
from surveillance_ontology.patrol_vocabulary import (
    ACCEPTED_WAIT,
    CAN_REACH,
    CONNECTED_TO,
    COVERED,
    IS_IN,
    LOCATION,
    NEVER,
    NOW,
    ROBOT,
    SEEN_AT,
    URGENCY_THRESHOLD,
    VISITED_AT,
    OntologyNotReadyError,
)

RETRY_PERIOD = 0.05
"""Pause between two looks at an ontology that is not yet as new as was asked for, seconds."""


class Interruptible(Protocol):
    """What ends a wait early; a `threading.Event` is one."""

    def wait(self, timeout: float) -> bool:
        """Wait; return True when the wait is to end."""


@dataclass(frozen=True)
class Snapshot:
    """What the ontology says, all of one moment.

    Attributes:
        place: Where the robot is.
        seen_at: When the robot was seen there, nanoseconds of ROS time; 0: nobody said.
        reachable: Where it can go from there in one move.
        classes: The classes of every place, among those that were asked for.
        visited_at: When each place was visited last, seconds; without those that never were.
        connections: The neighbours of every place.
        contradiction: Which facts clashed while it was taken, as a sentence; empty: none did.
        thresholds: Seconds after which a place is URGENT that has a threshold of its own.
    """

    place: str
    seen_at: int
    reachable: tuple[str, ...]
    classes: Mapping[str, frozenset[str]]
    visited_at: Mapping[str, float]
    connections: Mapping[str, tuple[str, ...]]
    contradiction: str = ''
    thresholds: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class _RobotAnswers:
    """What one batch of questions brought, all of one moment."""

    is_in: DirectiveResponse
    seen_at: DirectiveResponse
    can_reach: DirectiveResponse
    locations: DirectiveResponse
    members: Mapping[str, frozenset[str]]
    connections: Mapping[str, tuple[str, ...]]
    visited: Mapping[str, int]
    own: Mapping[str, int]
    usual: Mapping[str, int]


class RobotOntology:
    """One robot's view of one ontology; one thread at a time may take snapshots.

    Args:
        armor: A client of the ontology's reference.
        robot: The robot's name.
        fleet: The names of all robots that share the ontology; empty: this one is alone.
    """

    def __init__(self, armor: ArmorClient, robot: str = ROBOT, fleet: Sequence[str] = ()) -> None:
        self._directives = PatrolDirectives(armor)
        self._robot = robot
        self._is_alone = len(fleet) < 2
        self._places: tuple[str, ...] = ()
        self._last: Snapshot | None = None
        self._covered: dict[str, int] = {}
        # Thresholds of places as the ontology had them last, and whether it has the rule for them.
        self._own: Mapping[str, int] = {}
        self._knows_own: bool | None = None

    @property
    def reference(self) -> str:
        """The ontology's reference name."""
        return self._directives.armor.reference_name

    @property
    def robot_place_facts(self) -> str:
        """The facts, for a subscription, that say where the robot is, or those of a fleet are."""
        return f'{IS_IN}({self._robot}, ?)' if self._is_alone else f'{IS_IN}(?, ?)'

    def place_classes(self) -> tuple[str, ...]:
        """Return the names of the classes that a place can be in.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        (answer,) = self._directives.carry_out(
            [self._directives.request('QUERY CLASS CLASS', LOCATION)]
        )
        below = (name for name in names_in(answer) if not name.endswith('Nothing'))
        return (LOCATION, *below)

    def robot_places(self) -> tuple[str, ...]:
        """Return where the ontology has the robot: one place, or none yet.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        return self._directives.robot_places(self._robot)

    def reachable(self) -> frozenset[str]:
        """Return the places that the robot can reach over one open door, as last reasoned.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        request = self._directives.request('QUERY OBJECTPROP IND', CAN_REACH, self._robot)
        (answer,) = self._directives.carry_out([request])
        return frozenset(names_in(answer))

    def record_place(self, place: str, stamp: int) -> None:
        """Tell where the robot is, instead of wherever it was thought to be.

        Args:
            place: The place.
            stamp: When the robot was seen there, nanoseconds of ROS time.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses, for example because it has no such ontology.
        """
        self._directives.carry_out(
            [
                self._directives.request('SET OBJECTPROP IND', IS_IN, self._robot, place),
                self._directives.set_value(SEEN_AT, self._robot, stamp),
                self._directives.request('REASON'),
            ]
        )

    def record_coverage(self, covered: Mapping[str, int]) -> None:
        """Tell how much of each place was in view within its threshold; nothing follows from it.

        Args:
            covered: Whole percent by place; what was told before is not told again.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        changed = {
            place: percent
            for place, percent in covered.items()
            if place in self._places and self._covered.get(place) != percent
        }
        if changed:
            self._directives.carry_out(
                [
                    self._directives.set_value(COVERED, place, each)
                    for place, each in changed.items()
                ]
            )
            self._covered.update(changed)

    def snapshot(
        self,
        now: float,
        classes: Sequence[str],
        *,
        not_before: int = 0,
        visits: Mapping[str, float] | None = None,
        threshold: float | None = None,
        own_thresholds: Mapping[str, float] | None = None,
        patience: float = 0.0,
        interrupt: Interruptible | None = None,
    ) -> Snapshot:
        """Tell the time, and ask for all that a decision needs; mostly one round trip.

        It takes another one when the map has changed, or for a visit that the ontology does not
        know and that is not of this moment. From an ontology that contradicts itself nothing
        follows: after the patience, or at once where the snapshot before met a contradiction as
        well, the answer is what followed last, with the robot's place and visits as they are.

        Args:
            now: The robot's time, seconds.
            classes: The classes of places that matter.
            not_before: The answer must know where the robot was at this time, nanoseconds of ROS
                time; it is waited for.
            visits: When the robot visited places, seconds; the ontology is told what it does not
                know of that. Somebody else's later visit stays, unless it lies ahead: then the
                clock was set back. A place that was taken away does not come back.
            threshold: Seconds without a visit after which a place is URGENT, told with each
                snapshot, since an ontology that was built anew does not know it; None: as it was.
            own_thresholds: The same for places that differ; told of a place that has none. From
                then on it is the ontology's: what somebody else sets there stays.
            patience: How long to wait for an ontology that is there, is consistent and knows where
                the robot is, seconds of steady time. One that is built anew is gone meanwhile.
            interrupt: Ends the wait early.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
            OntologyNotReadyError: The patience came to its end.
        """
        pause = interrupt or threading.Event()
        deadline = time.monotonic() + patience
        clashed = self._last is not None and bool(self._last.contradiction)
        why = ''
        while True:
            is_over = time.monotonic() >= deadline
            try:
                found = self._ask(now, classes, visits or {}, threshold, own_thresholds or {})
                if found.is_in.is_consistent:
                    snapshot = self._snapshot_of(found, classes)
                else:
                    why = why or self._clash()
                    if not (is_over or clashed):
                        raise OntologyNotReadyError(why)
                    snapshot = self._as_known(found, visits or {}, why)
                if snapshot.seen_at < not_before:
                    raise OntologyNotReadyError(
                        f'nobody told it where the robot is since {not_before / 1e9:.1f} s'
                    )
                self._last = replace(snapshot, contradiction=why)
                return self._last
            except (ArmorServiceInternalError, OntologyNotReadyError) as error:
                if isinstance(error, ArmorServiceInternalError) and not is_gone(error):
                    raise
                if is_over or pause.wait(RETRY_PERIOD):
                    raise

    def _clash(self) -> str:
        """Return which facts clash, with the ontology's name."""
        _, because, facts = self._directives.contradiction().partition(' because ')
        return f'ontology {self.reference} is inconsistent{because}{facts}'

    def _as_known(self, found: _RobotAnswers, visits: Mapping[str, float], why: str) -> Snapshot:
        """Return the last snapshot with what was told since: nothing follows from a contradiction.

        Raises:
            OntologyNotReadyError: There is none, or the robot is not in one place of it.
        """
        where, last = names_in(found.is_in), self._last
        if last is None or len(where) != 1 or where[0] not in last.connections:
            raise OntologyNotReadyError(why)
        told = {place: at for place, at in visits.items() if place in last.connections}
        return replace(
            last,
            place=where[0],
            seen_at=time_in(f'{SEEN_AT} of {self._robot}', found.seen_at),
            reachable=last.connections[where[0]],
            visited_at={**last.visited_at, **told},
        )

    def _ask(
        self,
        now: float,
        classes: Sequence[str],
        visits: Mapping[str, float],
        threshold: float | None,
        own_thresholds: Mapping[str, float],
    ) -> _RobotAnswers:
        """Tell and ask until the answers are about all places, of one moment."""
        if self._knows_own is None:
            (rules,) = self._directives.carry_out([self._directives.request('QUERY RULES')])
            self._knows_own = any(ACCEPTED_WAIT in rule for rule in rules.queried_objects)
        limits: list[DirectiveRequest] = []
        told_limits = False
        asked = self._places
        # A visit of this moment is the latest there can be, and nobody takes away the place that
        # the robot stands in: it can be told unasked. For any other the ontology is asked first.
        owed = [place for place, at in visits.items() if place in asked and int(at) >= int(now)]
        while True:
            robot = {NOW: now}
            if threshold is not None:
                # The rule of the robot's threshold holds for all places: it is the longest one.
                robot[URGENCY_THRESHOLD] = max([threshold, *self._own.values()])
            told = {place: visits[place] for place in owed}
            found = self._exchange(robot, told, classes, asked, limits)
            self._places = names_in(found.locations)
            # Once: somebody else may be setting them at the same time.
            told_limits, was_told = told_limits or bool(limits), told_limits
            limits = [] if was_told else self._owed_limits(found, threshold, own_thresholds)
            owed = [
                place
                for place in asked
                if place in self._places
                and place in visits
                and (
                    int(visits[place]) > found.visited[place]
                    or found.visited[place] > int(now) >= int(visits[place])
                )
            ]
            if asked == self._places and not owed and not limits:
                return found
            asked = self._places

    def _owed_limits(
        self, found: _RobotAnswers, threshold: float | None, wanted: Mapping[str, float]
    ) -> list[DirectiveRequest]:
        """Return what is to be told of the thresholds of places.

        The seeds' rule makes every place URGENT after the robot's threshold, and what a rule
        says no other can take back. So the robot's becomes the longest of all, and where it is
        longer than the usual one, each other place accepts that one.
        """
        if not self._knows_own:
            return []
        places = set(self._places)
        missing = {p: int(s) for p, s in wanted.items() if p in places and p not in found.own}
        own = {**{p: at for p, at in found.own.items() if p in places}, **missing}
        todo = [self._directives.set_value(URGENCY_THRESHOLD, *entry) for entry in missing.items()]
        if own != self._own:
            self._own = own
            # The robot's threshold follows; nothing else need be told for that.
            todo.append(self._directives.request('REASON'))
        if threshold is not None:
            usual = int(threshold)
            fill = places - own.keys() if max([usual, *own.values()]) > usual else set()
            todo += [
                self._directives.set_value(ACCEPTED_WAIT, place, usual)
                for place in sorted(fill)
                if found.usual.get(place) != usual
            ]
            todo += [
                self._directives.request(
                    'REMOVE DATAPROP IND', ACCEPTED_WAIT, place, 'LONG', str(value)
                )
                for place, value in found.usual.items()
                if place not in fill
            ]
        return todo

    def _exchange(
        self,
        own: Mapping[str, float],
        visits: Mapping[str, float],
        classes: Sequence[str],
        asked: Sequence[str],
        limits: Sequence[DirectiveRequest],
    ) -> _RobotAnswers:
        """Tell visits and values of the robot, ask about it and some places, all in one batch."""
        request, robot = self._directives.request, self._robot
        told = [
            self._directives.set_value(VISITED_AT, place, int(at)) for place, at in visits.items()
        ]
        told += [self._directives.set_value(name, robot, int(value)) for name, value in own.items()]
        told += [*limits, request('REASON')]
        kept = (URGENCY_THRESHOLD, ACCEPTED_WAIT) if self._knows_own else ()
        questions = [
            request('QUERY OBJECTPROP IND', IS_IN, robot),
            request('QUERY DATAPROP IND', SEEN_AT, robot),
            request('QUERY OBJECTPROP IND', CAN_REACH, robot),
            request('QUERY IND CLASS', LOCATION),
            *(request('QUERY IND CLASS', name) for name in classes),
            *(request('QUERY OBJECTPROP IND', CONNECTED_TO, place) for place in asked),
            *(request('QUERY DATAPROP IND', VISITED_AT, place) for place in asked),
            *(request('QUERY FACT', f'{name}(?, ?)', 'true') for name in kept),
        ]
        answers = iter(self._directives.carry_out([*told, *questions], whole=True)[len(told) :])
        return _RobotAnswers(
            is_in=next(answers),
            seen_at=next(answers),
            can_reach=next(answers),
            locations=next(answers),
            members={name: frozenset(names_in(next(answers))) for name in classes},
            connections={place: names_in(next(answers)) for place in asked},
            visited={place: time_in(f'{VISITED_AT} of {place}', next(answers)) for place in asked},
            own=values_in(next(answers), robot) if kept else {},
            usual=values_in(next(answers), robot) if kept else {},
        )

    def _snapshot_of(self, found: _RobotAnswers, classes: Sequence[str]) -> Snapshot:
        """Make a snapshot of answers about all places.

        Raises:
            OntologyNotReadyError: The ontology has the robot in no place, or in several.
        """
        where = names_in(found.is_in)
        if len(where) != 1:
            what = f'in {" and ".join(where)}' if where else 'in no place'
            raise OntologyNotReadyError(f'ontology {self.reference} has {self._robot} {what}')
        return Snapshot(
            place=where[0],
            seen_at=time_in(f'{SEEN_AT} of {self._robot}', found.seen_at),
            reachable=names_in(found.can_reach),
            classes={
                place: frozenset(name for name in classes if place in found.members[name])
                for place in found.connections
            },
            visited_at={place: float(at) for place, at in found.visited.items() if at > NEVER},
            connections=found.connections,
            thresholds={place: float(at) for place, at in found.own.items()},
        )
