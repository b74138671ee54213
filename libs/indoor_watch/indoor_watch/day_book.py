"""What was seen on each day: how often each door, thing, marker and light in which state.

Counts instead of observations: a month takes kilobytes. The day is that of local time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from indoor_watch.observations import Kind, Observation

MOST_DAYS = 60
MOST_LINES = 2000
"""So many different things are counted on one day; what is beyond is counted as `other`."""


@dataclass(frozen=True)
class Seen:
    """What was seen of one thing on one day.

    Attributes:
        kind, subject, place, state: As in `Observation`.
        count: How often.
        first, last: When, seconds since 1970.
    """

    kind: str
    subject: str
    place: str
    state: str
    count: int
    first: float
    last: float


class DayBook:
    """Counts observations by day.

    Args:
        local: Returns the local time of a stamp.
    """

    def __init__(self, local: Callable[[float], datetime]) -> None:
        self._local = local
        self._days: dict[str, dict[tuple[str, str, str, str], Seen]] = {}

    def take(self, seen: Observation) -> None:
        """Count an observation."""
        day = self._days.setdefault(self._local(seen.stamp).date().isoformat(), {})
        key = (str(seen.kind), seen.subject, seen.place, seen.state)
        if key not in day and len(day) >= MOST_LINES:
            key = (str(seen.kind), 'other', '', seen.state)
        known = day.get(key)
        if known is None:
            day[key] = Seen(*key, 1, seen.stamp, seen.stamp)
        else:
            day[key] = Seen(
                *key, known.count + 1, min(known.first, seen.stamp), max(known.last, seen.stamp)
            )
        for old in sorted(self._days)[:-MOST_DAYS]:
            del self._days[old]

    def days(self) -> list[str]:
        """Return the days there are, as 2026-03-01, the oldest first."""
        return sorted(self._days)

    def seen_on(self, day: str) -> list[Seen]:
        """Return what was seen on a day, by kind and name."""
        return sorted(
            self._days.get(day, {}).values(),
            key=lambda each: (each.kind, each.subject, each.place, each.state),
        )

    def state(self) -> dict[str, Any]:
        """Return all as plain values, for `restore`."""
        return {
            day: [
                [each.kind, each.subject, each.place, each.state, each.count, each.first, each.last]
                for each in seen.values()
            ]
            for day, seen in self._days.items()
        }

    def restore(self, values: Mapping[str, Any]) -> None:
        """Take what `state` gave.

        Raises:
            ValueError, KeyError, TypeError: It is something else; nothing is changed then.
        """
        days = {}
        for day, rows in values.items():
            datetime.fromisoformat(day)
            found = {}
            for kind, subject, place, state, count, first, last in rows:
                key = (str(Kind(kind)), str(subject), str(place), str(state))
                found[key] = Seen(*key, int(count), float(first), float(last))
            days[str(day)] = found
        self._days = days
