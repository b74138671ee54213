"""What differs from place to place on a patrol: thresholds, exploring, hours, keep-outs."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from floor_plans.rooms import PlaceError
from patrol_policy.hours import NO_CALENDAR, Calendar, WeeklyHours
from strict_files.suggestions import nearest

CLASSES = ('ROOM', 'CORRIDOR')
LONGEST = 1e9
"""Seconds: 31 years."""


@dataclass(frozen=True)
class PatrolRules:
    """What holds for single places.

    Attributes:
        thresholds: Seconds without a visit after which a place is URGENT, where it differs.
        exploration: Seconds that the robot explores a place, where it differs.
        calendar: Hours, keep-out places and the quiet hours of the station.
        classes: ROOM or CORRIDOR, where a person says it; else it follows from the doors.
        swept: Places that are too large to be seen from their point: a visit covers all of it.
    """

    thresholds: Mapping[str, float] = field(default_factory=dict)
    exploration: Mapping[str, float] = field(default_factory=dict)
    calendar: Calendar = NO_CALENDAR
    classes: Mapping[str, str] = field(default_factory=dict)
    swept: frozenset[str] = frozenset()

    def with_classes(self, found: Mapping[str, frozenset[str]]) -> Mapping[str, frozenset[str]]:
        """Return the classes of places as a person says them, in place of what was inferred."""
        if not self.classes:
            return found
        # As the ontology has it, a corridor is a room, too.
        said = {place: frozenset({'ROOM', name}) for place, name in self.classes.items()}
        own = frozenset(CLASSES)
        return {
            place: (kinds - own) | said[place] if place in said else kinds
            for place, kinds in found.items()
        }


def patrol_rules(described: Mapping[str, Any], rooms: Collection[str] | None = None) -> PatrolRules:
    """Check what is said of single places.

    Args:
        described: The parameters `PATROL_KEYS`; each may be missing.
        rooms: The places that there are; None: that is not known yet.

    Raises:
        PlaceError: A place or a value is none.
    """
    hours = {
        place: _hours(('hours', place), text, rooms, place)
        for place, text in dict(described.get('hours') or {}).items()
    }
    keep_out, swept = (_listed(key, described, rooms) for key in ('keep_out', 'sweep'))
    quiet = described.get('quiet_hours') or ''
    zone = described.get('time_zone') or ''
    try:
        time_zone = ZoneInfo(zone) if zone else None
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise PlaceError(
            ('time_zone',), f"no time zone {zone!r}, expected such as 'Europe/Rome'"
        ) from None
    return PatrolRules(
        _seconds('thresholds', described, rooms),
        _seconds('exploration', described, rooms),
        Calendar(
            hours,
            _hours(('quiet_hours',), quiet, None, '') if quiet else None,
            keep_out,
            time_zone,
        ),
        _classes(described, rooms),
        swept,
    )


def _listed(
    key: str, described: Mapping[str, Any], rooms: Collection[str] | None
) -> frozenset[str]:
    places = described.get(key) or ()
    if not isinstance(places, list | tuple):
        raise PlaceError((key,), f'expected a list of rooms, got {places!r}')
    for place in places:
        _check_room((key,), place, rooms)
    return frozenset(places)


def _seconds(
    key: str, described: Mapping[str, Any], rooms: Collection[str] | None
) -> dict[str, float]:
    found = {}
    for place, value in dict(described.get(key) or {}).items():
        _check_room((key, place), place, rooms)
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number or not math.isfinite(value) or not 0.0 <= value <= LONGEST:
            raise PlaceError((key, place), f'expected seconds from 0 to 1e9, got {value!r}')
        found[place] = float(value)
    return found


def _classes(described: Mapping[str, Any], rooms: Collection[str] | None) -> dict[str, str]:
    found = {}
    for place, value in dict(described.get('classes') or {}).items():
        _check_room(('classes', place), place, rooms)
        if value not in CLASSES:
            raise PlaceError(('classes', place), f'{value!r}: expected {" or ".join(CLASSES)}')
        found[place] = str(value)
    return found


def _hours(
    where: tuple[str, ...], text: Any, rooms: Collection[str] | None, place: str
) -> WeeklyHours:
    if place:
        _check_room(where, place, rooms)
    if not isinstance(text, str):
        raise PlaceError(where, f"expected hours such as 'mon-fri 08:00-18:00', got {text!r}")
    try:
        return WeeklyHours.parse(text)
    except ValueError as error:
        raise PlaceError(where, str(error)) from None


def _check_room(where: tuple[str, ...], place: Any, rooms: Collection[str] | None) -> None:
    if rooms is not None and place not in rooms:
        raise PlaceError(where, f'no room {place!r}, expected {nearest(str(place), rooms)}')
