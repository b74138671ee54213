"""Between this package's core types and messages; the only place that knows both."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

from patrol_policy.world import Decision
from surveillance_behaviour.map_from_markers.assembly import PlaceNote
from surveillance_interfaces.msg import Decision as DecisionMessage
from surveillance_interfaces.msg import OntologyMap, OntologyPlace, RoomConnection
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
