"""Between this package's core types and messages; the only place that knows both."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point as PointMessage

from patrol_policy.idleness_bounds import CLOSED, LATER, NEVER, UNKNOWN, WITHIN, IdlenessBound
from patrol_policy.situation import Decision
from surveillance_behaviour.map_from_markers.assembly import PlaceNote
from surveillance_behaviour.ports import Check, Doubt, Point
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_interfaces.msg import (
    Doubts,
    OntologyMap,
    OntologyPlace,
    PlaceChecks,
    RoomConnection,
    ViewedPictures,
    Viewpoints,
)
from surveillance_runtime.conversions import point_message, seconds_of

MOST_CANDIDATES = 10_000
"""Of a decision; more are refused."""


def decision_message(decision: Decision, sequence: int, stamp: Any) -> DecisionMessage:
    """Return a decision, numbered and stamped."""
    return DecisionMessage(
        stamp=stamp,
        sequence=sequence,
        policy=decision.policy,
        from_place=decision.from_place,
        place=decision.place,
        target=decision.target,
        rule=decision.rule,
        reason=decision.reason,
        candidates=list(decision.scores),
        scores=[float(value) for value in decision.scores.values()],
        stay=float(decision.stay),
    )


_LEVELS = {
    WITHIN: DiagnosticStatus.OK,
    LATER: DiagnosticStatus.WARN,
    NEVER: DiagnosticStatus.ERROR,
    CLOSED: DiagnosticStatus.STALE,
    UNKNOWN: DiagnosticStatus.STALE,
}


def idleness_bounds_message(
    bounds: Sequence[IdlenessBound], hours: Mapping[str, str], stamp: Any
) -> DiagnosticArray:
    """Return what can be kept of the places: a status each, with the hours of those that have some.

    The level is OK within the threshold, WARN later, ERROR never, STALE while it is closed or not
    known; the values are ``threshold`` and ``wait`` in seconds, and ``hours``.
    """
    message = DiagnosticArray()
    message.header.stamp = stamp
    for each in bounds:
        values = {'threshold': f'{each.threshold:g}', 'wait': f'{each.wait:g}'}
        values |= {'hours': hours.get(each.place, ''), 'verdict': each.verdict}
        message.status.append(
            DiagnosticStatus(
                level=_LEVELS[each.verdict],
                name=each.place,
                message=each.words,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        )
    return message


def idleness_bounds_from(
    message: DiagnosticArray,
) -> tuple[tuple[IdlenessBound, ...], dict[str, str]]:
    """Return what can be kept of the places, and the hours of those that have some.

    Raises:
        ValueError: There are more than any map has, or a value is none.
    """
    if len(message.status) > MOST_CANDIDATES:
        raise ValueError(
            f'{len(message.status)} idleness bounds: expected at most {MOST_CANDIDATES}'
        )
    verdicts = {level: verdict for verdict, level in _LEVELS.items()}
    found, hours = [], {}
    for each in message.status:
        values = {entry.key: entry.value for entry in each.values}
        try:
            threshold, wait = float(values['threshold']), float(values['wait'])
            verdict = values.get('verdict', '')
            if _LEVELS.get(verdict) != each.level:
                verdict = verdicts[each.level]
        except (KeyError, ValueError):
            raise ValueError(
                f'idleness bound of {each.name!r}: expected a level and numbers threshold and wait'
            ) from None
        if not (threshold >= 0.0 and wait >= 0.0):
            raise ValueError(f'idleness bound of {each.name!r}: expected times of 0 or more')
        found.append(IdlenessBound(each.name, verdict, threshold, wait, each.message))
        if values.get('hours'):
            hours[each.name] = values['hours']
    return tuple(found), hours


def decision_from(message: DecisionMessage) -> Decision:
    """Return a decision with the score of each candidate.

    Raises:
        ValueError: The scores are not as many as the candidates, one is not a number, or there are
            more than any map has places.
    """
    if len(message.candidates) > MOST_CANDIDATES:
        raise ValueError(
            f'{len(message.candidates)} candidates: expected at most {MOST_CANDIDATES}'
        )
    if len(message.candidates) != len(message.scores):
        raise ValueError(
            f'{len(message.scores)} scores came for {len(message.candidates)} candidates'
        )
    scores = {
        name: float(score) for name, score in zip(message.candidates, message.scores, strict=True)
    }
    if wrong := [name for name, score in scores.items() if math.isnan(score)]:
        raise ValueError(f'the score of {wrong[0]} is not a number')
    return Decision(
        time=seconds_of(message.stamp),
        from_place=message.from_place,
        place=message.place,
        target=message.target,
        rule=message.rule,
        policy=message.policy,
        reason=message.reason,
        scores=scores,
        stay=message.stay if 0.0 < message.stay < math.inf else 0.0,
    )


def place_note_from(response: Any) -> PlaceNote | None:
    """Return what a marker stands for, from the answer of `room_info`; None when it is not
    known.
    """
    if not response.connections:
        return None
    doors = {each.through_door: each.connected_to for each in response.connections}
    return PlaceNote(response.room, (response.x, response.y), doors)


def map_message(places: Iterable[PlaceNote], robot_room: str) -> OntologyMap:
    """Return the message that enters places into the ontology."""
    return OntologyMap(
        places=[
            OntologyPlace(
                name=place.room,
                position=point_message(place.position),
                connections=[
                    RoomConnection(connected_to=behind, through_door=door)
                    for door, behind in place.connections.items()
                ],
            )
            for place in places
        ],
        robot_room=robot_room,
    )


def viewpoints_from(message: Viewpoints) -> dict[str, list[Point]]:
    """Return from where else each place is to be looked at, map frame, metres.

    Raises:
        ValueError: A number is not finite.
    """
    return {each.place: [_spot_from(point) for point in each.points] for each in message.places}


def doubts_from(message: Doubts) -> list[Doubt]:
    """Return the alerts that wait for a second look.

    Raises:
        ValueError: A number is not finite.
    """
    return [
        Doubt(each.number, each.place, _perhaps(each.look_from), _perhaps(each.position))
        for each in message.doubts
    ]


def checks_from(message: PlaceChecks) -> dict[str, list[Check]]:
    """Return what the rules ask for, by place.

    Raises:
        ValueError: A number is not finite.
    """
    found: dict[str, list[Check]] = {}
    for each in message.checks:
        check = Check(each.name, _spot_from(each.at), _perhaps(each.look_from), each.is_open)
        found.setdefault(each.place, []).append(check)
    return found


def pictures_from(
    message: ViewedPictures,
) -> tuple[list[tuple[float, float | None]] | None, float | None]:
    """Return which pictures were looked at, and how much of the horizon one shows.

    Returns:
        Of each when it was taken, seconds, and to which bearing, rad, None: not known; or None:
        nobody looks at pictures. And the camera's angle, rad; None: not known.
    """
    angle = message.angle[0] if len(message.angle) else None
    if not message.camera:
        return None, angle
    looked = [
        (seconds_of(each.stamp), each.bearing[0] if len(each.bearing) else None)
        for each in message.looked
    ]
    return looked, angle


def _spot_from(message: PointMessage) -> Point:
    if not (math.isfinite(message.x) and math.isfinite(message.y)):
        raise ValueError(f'expected finite numbers, got {message.x}, {message.y}')
    return message.x, message.y, 0.0


def _perhaps(points: Sequence[PointMessage]) -> Point | None:
    return _spot_from(points[0]) if len(points) else None
