"""What a patrol robot and its ontology say to each other.

This is the only module that spells the patrol's vocabulary (``isIn``, ``visitedAt``, ``now``, ...)
and the robot's name. Everything is told as one batch, which the server carries out in one piece:

    ontology = PatrolOntology(ArmorClient('me', 'surveillance', transport))
    ontology.build(place, path, uri)                # rooms and doors
    ontology.record_place('C1', stamp)              # by the one node that knows where the robot is
    # By the one node that decides: when it visited what, and what follows, all of one moment.
    ontology.snapshot(130.0, ['URGENT'], visits={'C1': 120.0})

A closed door is left out on one of its sides, which ends the connection: on the side that has more
doors, so that the other stays a room and this one, mostly, a corridor.

A fact is replaced by ``SET``, so the robot cannot be told to be in two places, whoever tells it.
Every method blocks while the server answers and belongs on a worker thread; one thread at a time
may take snapshots.
"""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from armor_service.client import (
    ArmorClient,
    ArmorServiceInternalError,
)
from armor_service.facts import parse_fact
from armor_service.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    name_in,
    value_in,
)
from surveillance_runtime.place import Place, PlaceError

DATA = Path(__file__).resolve().parent / 'data'
"""The ontologies that come with this package."""
ONTOLOGY = DATA / 'surveillance.owl'
"""The ontology that a patrol starts from."""
ROBOT = 'Robot1'
"""The robot's name where nobody gives another one."""
NEVER = 0
"""The time of visit of a place that nobody has visited yet, seconds, or any time before."""
LONGEST_THRESHOLD = 10**9
"""The longest time without a visit after which a place may become URGENT, seconds."""
PLACES = 'LOCATION(?)'
"""The places, as a pattern of facts for a query or a subscription."""
URGENT_PLACES = 'URGENT(?)'
"""The places that are due for a visit."""
VISITS = 'visitedAt(?, ?)'
"""When each place was visited last, seconds."""
CONNECTIONS = 'connectedTo(?, ?)'
"""Which places have a door in common."""
DOORS = 'hasDoor(?, ?)'
"""Which doors a place has: what changes with the map and its closed doors."""
CHUNK = 2000
"""Directives in one batch while a map is built."""
RETRY_PERIOD = 0.05
"""Pause between two looks at an ontology that is not yet as new as was asked for, seconds."""


class OntologyNotReadyError(Exception):
    """The ontology, or the map in it, does not answer, does not know (yet) what was asked for, or
    contradicts itself; the text is one line.
    """


def checked_names(place: Place, robot: str = ROBOT) -> Place:
    """Return the place, whose names the ontology has for nothing else.

    Raises:
        PlaceError: A room or a door has the robot's name, which would make the robot a place.
    """
    for room, doors in place.rooms.items():
        if robot in (room, *doors):
            raise PlaceError(('map', room), f"'{robot}' is the robot's name: expected another one")
    return place


def shown_doors(place: Place) -> dict[str, tuple[str, ...]]:
    """Return the doors of each room as the ontology has them: closed ones on one side only."""
    doors = {room: list(found) for room, found in place.rooms.items()}
    for door in sorted(place.closed):
        sides = place.doors[door]
        if len(sides) > 1:
            hiding = max(sides, key=lambda room: (len(doors[room]), room))
            doors[hiding].remove(door)
    return {room: tuple(found) for room, found in doors.items()}


def closed_doors(place: Place, shown: Mapping[str, Iterable[str]]) -> frozenset[str]:
    """Return the closed doors of a place of which an ontology has some rooms, see `shown_doors`.

    Args:
        place: The place; what the ontology does not tell of a door is as it is here.
        shown: The doors of each room that the ontology has.
    """
    present = {room: set(doors) for room, doors in shown.items()}
    closed = set(place.closed)
    for door, sides in place.doors.items():
        seen = sum(door in present.get(side, ()) for side in sides)
        if len(sides) > 1 and seen and all(side in present for side in sides):
            closed.discard(door)
            if seen == 1:
                closed.add(door)
    return frozenset(closed)


class Waiting(Protocol):
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
class _Answers:
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


class PatrolOntology:
    """One robot's view of one ontology.

    Args:
        armor: A client of the ontology's reference.
        robot: The robot's name.
        fleet: The names of all robots that share the ontology; empty: this one is alone.
    """

    def __init__(self, armor: ArmorClient, robot: str = ROBOT, fleet: Sequence[str] = ()) -> None:
        self._armor = armor
        self._robot = robot
        self._fleet = tuple(fleet) or (robot,)
        self._places: tuple[str, ...] = ()
        self._last: Snapshot | None = None
        # Thresholds of places as the ontology had them last, and whether it has the rule for them.
        self._own: Mapping[str, int] = {}
        self._knows_own: bool | None = None

    @property
    def reference(self) -> str:
        """The ontology's reference name."""
        return self._armor.reference_name

    @property
    def robot_place_facts(self) -> str:
        """The facts, for a subscription, that say where the robot is, or those of a fleet are."""
        return f'isIn({self._robot}, ?)' if len(self._fleet) == 1 else 'isIn(?, ?)'

    # --- the map ---

    def is_loaded(self) -> bool:
        """Tell whether the server has the reference."""
        return self.reference in self._armor.utils.get_all_refs()

    def build(
        self,
        place: Place,
        path: str,
        uri: str,
        first_visit: int = NEVER,
        now: int | None = None,
        gone: Iterable[str] = (),
    ) -> Place:
        """Load the ontology and enter a place, as far as it is not there yet.

        Where the robot is, and when it visited which place, is left to those who know.

        Args:
            place: Rooms and doors.
            path: The ontology to start from.
            uri: Its IRI.
            first_visit: Time of visit of places that the ontology does not know, seconds.
            now: The robot's time in an ontology that knows none of the places, seconds; None
                leaves it as it is.
            gone: Rooms and doors that the ontology may still have, and is to have no more.

        Returns:
            The place with the closed doors that the ontology has.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses, for example because there is no such file.
        """
        self._armor.utils.load_ref_from_file(path, uri, False, 'PELLET', True)
        known = self._known_doors(place)
        place = replace(place, closed=closed_doors(place, known))
        mine = {
            room: [door for door in doors if door in place.rooms[room]]
            for room, doors in known.items()
        }
        todo = [self._request('REMOVE IND', name) for name in sorted(gone)]
        if ROBOT not in self._fleet:
            # It would have the time that it was written with, for which every place is URGENT.
            todo.append(self._request('REMOVE IND', ROBOT))
        todo += self._differences(mine, shown_doors(place), first_visit)
        if not known and now is not None:
            todo += [self._set_value('now', robot, now) for robot in self._fleet]
        self._carry_out(
            [
                *todo,
                self._request('REASON'),
                self._request('DISJOINT IND CLASS', 'ROOM'),
                self._request('DISJOINT IND CLASS', 'DOOR'),
                self._request('REASON'),
            ]
        )
        return place

    def change(self, before: Place, after: Place, first_visit: int = NEVER) -> None:
        """Bring the ontology from one place to another: rooms and doors added, closed, taken away.

        Args:
            before: What the ontology has.
            after: What it is to have.
            first_visit: Time of visit of new rooms, seconds.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        todo = self._differences(shown_doors(before), shown_doors(after), first_visit)
        todo += [
            self._request('REMOVE IND', name)
            for name in (*before.rooms, *before.doors)
            if name not in after.rooms and name not in after.doors
        ]
        todo.append(self._request('REASON'))
        if any(room not in before.rooms for room in after.rooms):
            todo.append(self._request('DISJOINT IND CLASS', 'ROOM'))
        if any(door not in before.doors for door in after.doors):
            todo.append(self._request('DISJOINT IND CLASS', 'DOOR'))
        if todo[-1].command != 'REASON':
            todo.append(self._request('REASON'))
        self._carry_out(todo)

    def forget(self) -> None:
        """Drop the ontology from the server."""
        self._armor.utils.drop_ref()

    def contradiction(self) -> str:
        """Return which facts of the ontology clash, as a sentence; empty when it is consistent.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        answer = self._carry_out(
            [self._request('REASON'), self._request('QUERY EXPLAIN INCONSISTENCY')]
        )[-1]
        if answer.is_consistent:
            return ''
        return answer.queried_objects[0] if answer.queried_objects else 'for no known reason'

    def places(self) -> tuple[str, ...]:
        """Return the names of all places.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        (answer,) = self._carry_out([self._request('QUERY IND CLASS', 'LOCATION')])
        return _names(answer)

    def place_classes(self) -> tuple[str, ...]:
        """Return the names of the classes that a place can be in.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        (answer,) = self._carry_out([self._request('QUERY CLASS CLASS', 'LOCATION')])
        below = (name for name in _names(answer) if not name.endswith('Nothing'))
        return ('LOCATION', *below)

    def doors(self) -> dict[str, set[str]]:
        """Return the places that each door leads into.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        places = self.places()
        answers = self._carry_out(
            [self._request('QUERY OBJECTPROP IND', 'hasDoor', place) for place in places]
        )
        rooms_of: dict[str, set[str]] = {}
        for place, answer in zip(places, answers, strict=True):
            for door in _names(answer):
                rooms_of.setdefault(door, set()).add(place)
        return rooms_of

    # --- the robot ---

    def robot_places(self) -> tuple[str, ...]:
        """Return where the ontology has the robot: one place, or none yet.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        (answer,) = self._carry_out([self._request('QUERY OBJECTPROP IND', 'isIn', self._robot)])
        return _names(answer)

    def reachable(self) -> frozenset[str]:
        """Return the places that the robot can reach over one open door, as last reasoned.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses.
        """
        request = self._request('QUERY OBJECTPROP IND', 'canReach', self._robot)
        (answer,) = self._carry_out([request])
        return frozenset(_names(answer))

    def record_place(self, place: str, stamp: int) -> None:
        """Tell where the robot is, instead of wherever it was thought to be.

        Args:
            place: The place.
            stamp: When the robot was seen there, nanoseconds of ROS time.

        Raises:
            ArmorServiceCallError: The server does not answer.
            ArmorServiceInternalError: It refuses, for example because it has no such ontology.
        """
        self._carry_out(
            [
                self._request('SET OBJECTPROP IND', 'isIn', self._robot, place),
                self._set_value('seenAt', self._robot, stamp),
                self._request('REASON'),
            ]
        )

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
        interrupt: Waiting | None = None,
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
        _, because, facts = self.contradiction().partition(' because ')
        return f'ontology {self.reference} is inconsistent{because}{facts}'

    def _as_known(self, found: _Answers, visits: Mapping[str, float], why: str) -> Snapshot:
        """Return the last snapshot with what was told since: nothing follows from a contradiction.

        Raises:
            OntologyNotReadyError: There is none, or the robot is not in one place of it.
        """
        where, last = _names(found.is_in), self._last
        if last is None or len(where) != 1 or where[0] not in last.connections:
            raise OntologyNotReadyError(why)
        told = {place: at for place, at in visits.items() if place in last.connections}
        return replace(
            last,
            place=where[0],
            seen_at=_time(f'seenAt of {self._robot}', found.seen_at),
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
    ) -> _Answers:
        """Tell and ask until the answers are about all places, of one moment."""
        if self._knows_own is None:
            (rules,) = self._carry_out([self._request('QUERY RULES')])
            self._knows_own = any('acceptedWait' in rule for rule in rules.queried_objects)
        limits: list[DirectiveRequest] = []
        told_limits = False
        asked = self._places
        # A visit of this moment is the latest there can be, and nobody takes away the place that
        # the robot stands in: it can be told unasked. For any other the ontology is asked first.
        owed = [place for place, at in visits.items() if place in asked and int(at) >= int(now)]
        while True:
            robot = {'now': now}
            if threshold is not None:
                # The rule of the robot's threshold holds for all places: it is the longest one.
                robot['urgencyThreshold'] = max([threshold, *self._own.values()])
            told = {place: visits[place] for place in owed}
            found = self._exchange(robot, told, classes, asked, limits)
            self._places = _names(found.locations)
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
        self, found: _Answers, threshold: float | None, wanted: Mapping[str, float]
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
        todo = [self._set_value('urgencyThreshold', *entry) for entry in missing.items()]
        if own != self._own:
            self._own = own
            # The robot's threshold follows; nothing else need be told for that.
            todo.append(self._request('REASON'))
        if threshold is not None:
            usual = int(threshold)
            fill = places - own.keys() if max([usual, *own.values()]) > usual else set()
            todo += [
                self._set_value('acceptedWait', place, usual)
                for place in sorted(fill)
                if found.usual.get(place) != usual
            ]
            todo += [
                self._request('REMOVE DATAPROP IND', 'acceptedWait', place, 'LONG', str(value))
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
    ) -> _Answers:
        """Tell visits and values of the robot, ask about it and some places, all in one batch."""
        request, robot = self._request, self._robot
        told = [self._set_value('visitedAt', place, int(at)) for place, at in visits.items()]
        told += [self._set_value(name, robot, int(value)) for name, value in own.items()]
        told += [*limits, request('REASON')]
        kept = ('urgencyThreshold', 'acceptedWait') if self._knows_own else ()
        questions = [
            request('QUERY OBJECTPROP IND', 'isIn', robot),
            request('QUERY DATAPROP IND', 'seenAt', robot),
            request('QUERY OBJECTPROP IND', 'canReach', robot),
            request('QUERY IND CLASS', 'LOCATION'),
            *(request('QUERY IND CLASS', name) for name in classes),
            *(request('QUERY OBJECTPROP IND', 'connectedTo', place) for place in asked),
            *(request('QUERY DATAPROP IND', 'visitedAt', place) for place in asked),
            *(request('QUERY FACT', f'{name}(?, ?)', 'true') for name in kept),
        ]
        answers = iter(self._carry_out([*told, *questions], whole=True)[len(told) :])
        return _Answers(
            is_in=next(answers),
            seen_at=next(answers),
            can_reach=next(answers),
            locations=next(answers),
            members={name: frozenset(_names(next(answers))) for name in classes},
            connections={place: _names(next(answers)) for place in asked},
            visited={place: _time(f'visitedAt of {place}', next(answers)) for place in asked},
            own=_values(next(answers), robot) if kept else {},
            usual=_values(next(answers), robot) if kept else {},
        )

    def _snapshot_of(self, found: _Answers, classes: Sequence[str]) -> Snapshot:
        """Make a snapshot of answers about all places.

        Raises:
            OntologyNotReadyError: The ontology has the robot in no place, or in several.
        """
        where = _names(found.is_in)
        if len(where) != 1:
            what = f'in {" and ".join(where)}' if where else 'in no place'
            raise OntologyNotReadyError(f'ontology {self.reference} has {self._robot} {what}')
        return Snapshot(
            place=where[0],
            seen_at=_time(f'seenAt of {self._robot}', found.seen_at),
            reachable=_names(found.can_reach),
            classes={
                place: frozenset(name for name in classes if place in found.members[name])
                for place in found.connections
            },
            visited_at={place: float(at) for place, at in found.visited.items() if at > NEVER},
            connections=found.connections,
            thresholds={place: float(at) for place, at in found.own.items()},
        )

    # --- directives ---

    def _request(self, words: str, *args: str) -> DirectiveRequest:
        return self._armor.request(words, *args)

    def _set_value(self, prop: str, individual: str, value: int) -> DirectiveRequest:
        return self._request('SET DATAPROP IND', prop, individual, 'LONG', str(value))

    def _known_doors(self, place: Place) -> dict[str, list[str]]:
        """Return the doors of the rooms that the ontology has already; empty when it has none of
        them.
        """
        rooms = tuple(place.rooms)
        answers = self._carry_out(
            [
                *(self._request('QUERY DATAPROP IND', 'visitedAt', room) for room in rooms),
                *(self._request('QUERY OBJECTPROP IND', 'hasDoor', room) for room in rooms),
            ]
        )
        return {
            room: list(_names(doors))
            for room, visit, doors in zip(rooms, answers, answers[len(rooms) :], strict=False)
            if visit.queried_objects
        }

    def _differences(
        self,
        before: Mapping[str, Sequence[str]],
        after: Mapping[str, Sequence[str]],
        first_visit: int,
    ) -> list[DirectiveRequest]:
        request = self._request
        todo: list[DirectiveRequest] = []
        for room, doors in after.items():
            old = before.get(room, ())
            todo += [
                request('REMOVE OBJECTPROP IND', 'hasDoor', room, door)
                for door in old
                if door not in doors
            ]
            todo += [
                request('ADD OBJECTPROP IND', 'hasDoor', room, door)
                for door in doors
                if door not in old
            ]
            if room not in before:
                todo.append(self._set_value('visitedAt', room, first_visit))
        return todo

    def _carry_out(
        self, requests: Sequence[DirectiveRequest], *, whole: bool = False
    ) -> list[DirectiveResponse]:
        """Send the directives in one batch; in several where there are very many, unless all must
        be of one moment.
        """
        answers: list[DirectiveResponse] = []
        size = len(requests) if whole else CHUNK
        for start in range(0, len(requests), size):
            chunk = requests[start : start + size]
            found = self._armor.batch(chunk).responses
            if len(found) != len(chunk):
                why = found[-1].error_description if found else ''
                raise ArmorServiceInternalError(
                    f'{len(found)} answers to {len(chunk)} directives: {why or "no reason given"}',
                    ExitCode.INVALID_COMMAND,
                )
            for wanted, answer in zip(chunk, found, strict=True):
                if not answer.success:
                    words = ' '.join((wanted.words, *wanted.args[:3]))
                    raise ArmorServiceInternalError(
                        f'{words}: {answer.error_description or "refused"}', answer.exit_code
                    )
            answers += found
        return answers


def facts_of(place: str) -> tuple[str, ...]:
    """Return the patterns of what can hold of a place, those that change most often first."""
    return (
        f'URGENT({place})',
        f'ROOM({place})',
        f'CORRIDOR({place})',
        f'LOCATION({place})',
        f'isIn(?, {place})',
        f'canReach(?, {place})',
        f'visitedAt({place}, ?)',
        f'hasDoor({place}, ?)',
        f'connectedTo({place}, ?)',
    )


def is_gone(error: ArmorServiceInternalError) -> bool:
    """Tell whether the server refused something because it does not have the ontology."""
    return 'unknown reference' in str(error)


def _names(answer: DirectiveResponse) -> tuple[str, ...]:
    return tuple(sorted(name_in(text) for text in answer.queried_objects))


def _values(answer: DirectiveResponse, robot: str) -> dict[str, int]:
    """Return the value of each individual but the robot, by facts of one property."""
    found: dict[str, int] = {}
    for text in answer.queried_objects:
        name, value = parse_fact(text).arguments
        number = re.match(r'"?(\d+)\b', value)
        if name != robot and number:
            # Of several the shortest one counts, as for the rule.
            seconds = int(number[1])
            found[name] = min(seconds, found.get(name, seconds))
    return found


def never_visited(now: int) -> int:
    """Return a time of visit that stands for none, so that the place is URGENT from the start.

    By the machine's clock that is `NEVER`. A simulated clock may begin at 0, where even `NEVER` is
    no longer ago than any threshold.

    Args:
        now: The present time, seconds.
    """
    return min(NEVER, now - LONGEST_THRESHOLD - 1)


def _time(what: str, answer: DirectiveResponse) -> int:
    """Return the latest of the times in an answer.

    Raises:
        OntologyNotReadyError: One of them is none.
    """
    try:
        return max((int(value_in(value)) for value in answer.queried_objects), default=0)
    except ValueError:
        raise OntologyNotReadyError(
            f'{what} is {", ".join(answer.queried_objects)}: expected a whole number'
        ) from None
