"""Between what the observer knows and its messages."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point

from indoor_watch import Coverage, Event, EventState, Kind, Observation
from indoor_watch.marker_checks import MarkerCheck
from surveillance_interfaces import msg
from surveillance_runtime.conversions import seconds_of, stamp_from

Spot = tuple[float, float]


def observation_to_ros(seen: Observation) -> msg.Observation:
    """Return an observation as a message."""
    return msg.Observation(
        stamp=_time(seen.stamp),
        robot=seen.robot,
        kind=str(seen.kind),
        state=seen.state,
        place=seen.place,
        subject=seen.subject,
        position=_points(seen.position),
        confidence=float(seen.confidence),
        evidence=seen.evidence,
        compared_with=seen.compared_with,
        seen_from=_points(seen.seen_from),
        usual=[] if seen.usual is None else [float(seen.usual)],
        sensor=seen.sensor,
    )


def observation_from_ros(message: msg.Observation) -> Observation:
    """Return an observation.

    Raises:
        ValueError: A kind or state that is not known, or a number that is none.
    """
    return Observation(
        Kind(message.kind),
        message.state,
        message.place,
        message.subject,
        _spot(message.position),
        message.confidence,
        seconds_of(message.stamp),
        message.robot,
        message.evidence,
        message.compared_with,
        _spot(message.seen_from),
        message.usual[0] if len(message.usual) else None,
        message.sensor,
    )


def event_to_ros(event: Event) -> msg.ObservedEvent:
    """Return an event as a message."""
    return msg.ObservedEvent(
        number=event.number,
        kind=str(event.kind),
        seen=event.seen,
        place=event.place,
        subject=event.subject,
        position=_points(event.position),
        severity=event.severity,
        rule=event.rule,
        state=str(event.state),
        began=_time(event.began),
        last=_time(event.last),
        sightings=event.sightings,
        looks=event.looks,
        confidence=float(event.confidence),
        robots=list(event.robots),
        evidence=list(event.evidence),
        compared_with=event.compared_with,
        seen_from=_points(event.seen_from),
        confirmed=event.confirmed,
        sensors=list(event.sensors),
    )


def event_from_ros(message: msg.ObservedEvent) -> Event:
    """Return an event.

    Raises:
        ValueError: A kind or state that is not known, or a number that is none.
    """
    if not math.isfinite(message.confidence):
        raise ValueError(f'event {message.number}: its confidence is {message.confidence}')
    return Event(
        message.number,
        Kind(message.kind),
        message.seen,
        message.place,
        message.subject,
        _spot(message.position),
        message.severity,
        message.rule,
        EventState(message.state),
        seconds_of(message.began),
        seconds_of(message.last),
        message.sightings,
        message.looks,
        message.confidence,
        tuple(message.robots),
        tuple(message.evidence),
        message.compared_with,
        _spot(message.seen_from),
        message.confirmed,
        tuple(message.sensors),
    )


def coverage_to_ros(coverage: Coverage) -> msg.PlaceCoverage:
    """Return what a visit saw as a message; a share that is not known is nan."""
    return msg.PlaceCoverage(
        place=coverage.place,
        began=_time(coverage.began),
        ended=_time(coverage.ended),
        share=float(coverage.share),
        area=float(coverage.area),
        pictures=coverage.pictures,
        camera_share=float(coverage.camera_share),
    )


def coverage_from_ros(message: msg.PlaceCoverage) -> Coverage:
    """Return what a visit saw."""
    return Coverage(
        message.place,
        seconds_of(message.began),
        seconds_of(message.ended),
        message.share,
        message.area,
        message.pictures,
        message.camera_share,
    )


def viewpoints_to_ros(viewpoints: Mapping[str, Sequence[Spot]]) -> msg.Viewpoints:
    """Return from where each place is looked at, map frame, metres, as a message."""
    return msg.Viewpoints(
        places=[
            msg.PlaceViewpoints(place=place, points=[_point(each) for each in points])
            for place, points in viewpoints.items()
        ]
    )


def doubts_to_ros(doubts: Iterable[tuple[Event, Spot | None]]) -> msg.Doubts:
    """Return the events that wait for a second look, and from where, as a message."""
    return msg.Doubts(
        doubts=[
            msg.Doubt(
                number=event.number,
                place=event.place,
                position=_points(event.position),
                look_from=_points(look_from),
            )
            for event, look_from in doubts
        ]
    )


def checks_to_ros(checks: Iterable[MarkerCheck]) -> msg.PlaceChecks:
    """Return what the rules ask for as a message, to the centimetre: noise is no news."""
    return msg.PlaceChecks(
        checks=[
            msg.PlaceCheck(
                place=each.place,
                name=each.name,
                at=_point(_rounded(each.at)),
                look_from=_points(None if each.look_from is None else _rounded(each.look_from)),
                is_open=each.is_open,
            )
            for each in checks
        ]
    )


def pictures_to_ros(
    looked: Iterable[tuple[float, float | None]], angle: float | None, *, camera: bool
) -> msg.ViewedPictures:
    """Return which pictures were looked at as a message.

    Args:
        looked: Of each when it was taken, seconds, and to which bearing, rad; None: not known.
        angle: How much of the horizon a picture shows, rad; None: not known.
        camera: Whether pictures are looked at at all.
    """
    return msg.ViewedPictures(
        camera=camera,
        angle=[] if angle is None else [angle],
        looked=[
            msg.ViewedPicture(stamp=_time(taken), bearing=[] if bearing is None else [bearing])
            for taken, bearing in looked
        ],
    )


def _rounded(point: Spot) -> Spot:
    return round(point[0], 2), round(point[1], 2)


def _point(point: Sequence[float]) -> Point:
    return Point(x=float(point[0]), y=float(point[1]))


def _points(point: Sequence[float] | None) -> list[Point]:
    return [] if point is None else [_point(point)]


def _spot(points: Sequence[Point]) -> Spot | None:
    if not len(points):
        return None
    x, y = points[0].x, points[0].y
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f'expected finite numbers, got {x}, {y}')
    return x, y


def _time(seconds: float) -> Time:
    # Apart: a float of all the nanoseconds since 1970 is good to 256 of them.
    part, whole = math.modf(max(0.0, seconds))
    return stamp_from(1_000_000_000 * int(whole) + round(1e9 * part))
