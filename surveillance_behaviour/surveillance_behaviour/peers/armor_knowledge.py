"""The ontology behind the machines' port: ARMOR directives, sent in batches.

A batch is carried out in one piece, so what it answers is all of one moment, and a node that is
killed leaves nothing half written. Of the map only the answers are believed: places, ways and
classes are whatever the ontology infers now.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import surveillance_fsm as fsm
from surveillance_behaviour.peers.ports import (
    AwayError,
    Beliefs,
    InterruptedWaitError,
    LostRobotError,
    PeerError,
)
from surveillance_ontology.armor.client import (
    ArmorClient,
    ArmorServiceCallError,
    Transport,
    name_in,
    value_in,
)
from surveillance_ontology.armor.protocol import DirectiveResponse

ROBOT = 'Robot1'
Directive = tuple[str, ...]
"""A directive's words, ``QUERY OBJECTPROP IND``, and its arguments."""


class Wake(Protocol):
    """The interrupt that the transport heeds."""

    def set(self) -> None:
        """Ends the call that is under way."""

    def clear(self) -> None:
        """Lets the next call run."""


class ArmorKnowledge:
    """Asks and tells ARMOR; one thread at a time.

    Args:
        client_id: Name of the client.
        transport: How directives travel to the server.
        wake: Ends the transport's call when it is raised.
        reference: Waits until the map is built and gives the ontology's reference name.
    """

    def __init__(
        self,
        client_id: str,
        transport: Transport,
        wake: Wake,
        reference: Callable[[fsm.Interrupt], str],
    ) -> None:
        self._armor = ArmorClient(client_id, '', transport)
        self._wake = wake
        self._ask_reference = reference
        self._places: tuple[str, ...] = ()

    def wait_until_built(self, interrupt: fsm.Interrupt) -> None:
        """Asks for the name of the ontology, which is answered once the map is built."""
        self._armor.reference_name = self._ask_reference(interrupt)

    def set_urgency_threshold(self, seconds: float, interrupt: fsm.Interrupt) -> None:
        """Replaces the robot's urgencyThreshold."""
        answers = self._send([_query('urgencyThreshold', ROBOT)], interrupt)
        change = _replace('urgencyThreshold', ROBOT, answers[0].queried_objects, seconds)
        self._send([*change, ('REASON',)], interrupt)

    def robot_place(self, interrupt: fsm.Interrupt) -> str:
        """Where the ontology has the robot."""
        (answer,) = self._send([('QUERY OBJECTPROP IND', 'isIn', ROBOT)], interrupt)
        return _one_place(answer.queried_objects)

    def beliefs(self, classes: Sequence[str], now: float, interrupt: fsm.Interrupt) -> Beliefs:
        """Sets the robot's ``now``, reasons, and asks for all that a decision needs."""
        (old,) = self._send([_query('now', ROBOT)], interrupt)
        head: list[Directive] = [
            *_replace('now', ROBOT, old.queried_objects, now),
            ('REASON',),
            ('QUERY OBJECTPROP IND', 'isIn', ROBOT),
            ('QUERY OBJECTPROP IND', 'canReach', ROBOT),
            ('QUERY IND CLASS', 'LOCATION'),
            *(('QUERY IND CLASS', name) for name in classes),
        ]
        while True:
            asked = self._places
            tail: list[Directive] = []
            for place in asked:
                tail.append(('QUERY OBJECTPROP IND', 'connectedTo', place))
                tail.append(_query('visitedAt', place))
            answers = self._send([*head, *tail], interrupt)[-(3 + len(classes) + len(tail)) :]
            is_in, can_reach, locations = (answer.queried_objects for answer in answers[:3])
            if not answers[0].is_consistent:
                # With the robot in several places at once: that can be mended, see `note_arrival`.
                _one_place(is_in)
                raise PeerError('armor', f'ontology {self._armor.reference_name} is inconsistent')
            self._places = _names(locations)
            if asked == self._places:
                break
        members = {
            name: frozenset(_names(answer.queried_objects))
            for name, answer in zip(classes, answers[3:], strict=False)
        }
        per_place = answers[3 + len(classes) :]
        return Beliefs(
            place=_one_place(is_in),
            reachable=_names(can_reach),
            classes={
                place: frozenset(name for name in classes if place in members[name])
                for place in asked
            },
            visited_at=_visits(asked, per_place[1::2]),
            connections={
                place: _names(answer.queried_objects)
                for place, answer in zip(asked, per_place[::2], strict=True)
            },
        )

    def note_visit(self, place: str, now: float, interrupt: fsm.Interrupt) -> None:
        """Replaces the place's visitedAt and the robot's now."""
        self._write(place, now, [], interrupt)

    def note_arrival(self, before: str, place: str, now: float, interrupt: fsm.Interrupt) -> None:
        """Replaces the robot's isIn, wherever it was thought to be, and notes the visit."""
        (answer,) = self._send([('QUERY OBJECTPROP IND', 'isIn', ROBOT)], interrupt)
        changes: list[Directive] = [
            ('REMOVE OBJECTPROP IND', 'isIn', ROBOT, other)
            for other in _names(answer.queried_objects)
            if other != place
        ]
        changes.append(('ADD OBJECTPROP IND', 'isIn', ROBOT, place))
        self._write(place, now, changes, interrupt)

    def _write(
        self, place: str, now: float, changes: Sequence[Directive], interrupt: fsm.Interrupt
    ) -> None:
        visited, told = self._send([_query('visitedAt', place), _query('now', ROBOT)], interrupt)
        self._send(
            [
                *changes,
                *_replace('visitedAt', place, visited.queried_objects, now),
                *_replace('now', ROBOT, told.queried_objects, now),
                ('REASON',),
            ],
            interrupt,
        )

    def _send(
        self, directives: Sequence[Directive], interrupt: fsm.Interrupt
    ) -> Sequence[DirectiveResponse]:
        """Sends one batch; the answers in its order.

        Raises:
            PeerError: ARMOR is away, or refuses one of them.
            InterruptedWaitError: The interrupt was raised.
        """
        if not self._armor.reference_name:
            self.wait_until_built(interrupt)
        forget = interrupt.subscribe(self._wake.set)
        try:
            answer = self._armor.batch([self._armor.request(*words) for words in directives])
        except ArmorServiceCallError as error:
            if interrupt.is_set():
                raise InterruptedWaitError from None
            raise AwayError('armor', str(error)) from None
        finally:
            forget()
            self._wake.clear()
        if len(answer.responses) != len(directives):
            raise PeerError(
                'armor', f'{len(answer.responses)} answers to {len(directives)} directives'
            )
        for words, response in zip(directives, answer.responses, strict=True):
            if not response.success:
                # A server that was started anew does not know the ontology yet.
                self._armor.reference_name = ''
                raise PeerError(
                    'armor', f'{" ".join(words)}: {response.error_description or "refused"}'
                )
        return answer.responses


def _query(prop: str, individual: str) -> Directive:
    return 'QUERY DATAPROP IND', prop, individual


def _replace(prop: str, individual: str, old: Sequence[str], seconds: float) -> list[Directive]:
    """Removes all old values and adds the new one, in whole seconds."""
    new = str(int(seconds))
    kept = [value for value in old if value == f'"{new}"^^xsd:long']
    changes: list[Directive] = [
        ('REMOVE DATAPROP IND', prop, individual, 'LONG', value)
        for value in old
        if value not in kept
    ]
    if not kept:
        changes.append(('ADD DATAPROP IND', prop, individual, 'LONG', new))
    return changes


def _names(rendered: Sequence[str]) -> tuple[str, ...]:
    return tuple(sorted(name_in(text) for text in rendered))


def _visits(places: Sequence[str], answers: Sequence[DirectiveResponse]) -> Mapping[str, float]:
    visits = {}
    for place, answer in zip(places, answers, strict=True):
        try:
            times = [float(value_in(value)) for value in answer.queried_objects]
        except ValueError:
            raise PeerError(
                'armor', f'visitedAt of {place} is {answer.queried_objects}, expected seconds'
            ) from None
        if times:
            visits[place] = max(times)
    return visits


def _one_place(rendered: Sequence[str]) -> str:
    found = _names(rendered)
    if len(found) != 1:
        raise LostRobotError('armor', f'{ROBOT} isIn {" and ".join(found) or "no place"}')
    return found[0]
