"""What the page may ask of an index of events: a search, one event, what to choose from."""

from __future__ import annotations

import math
from collections.abc import Callable
from datetime import datetime
from typing import Any

from strict_files.suggestions import nearest
from surveillance_operator.desk.event_index import MOST, PAGE, SEVERITIES, STATES, EventIndex

Question = Callable[..., Any]


class EventQuestions:
    """Answers questions about events.

    Args:
        index: The events.
        now: Returns the seconds since 1970.
        until: Returns the moment of a replay, after which nothing is known; None: it is no replay.
    """

    def __init__(
        self,
        index: EventIndex,
        now: Callable[[], float],
        until: Callable[[], float] | None = None,
    ) -> None:
        self._index, self._now, self._until = index, now, until

    def all(self) -> dict[str, Question]:
        """Return the questions by name."""
        return {'search': self.search, 'event': self.event, 'choices': self.choices}

    def search(
        self,
        text: str = '',
        begin: str = '',
        end: str = '',
        place: str = '',
        kind: str = '',
        severity: str = '',
        state: str = '',
        robot: str = '',
        run: str = '',
        skip: str = '0',
        most: str = str(PAGE),
        whole: str = '',
    ) -> Any:
        """Search what was noticed, told and done, the newest first; in a replay up to its moment.

        Times are seconds since 1970 or such as 2026-03-01T22:00; `whole` takes what a replay
        knows after its moment, too.
        """
        if severity and severity not in SEVERITIES:
            raise ValueError(f'severity {severity!r:.40}: expected {nearest(severity, SEVERITIES)}')
        if state and state not in STATES:
            raise ValueError(f'state {state!r:.40}: expected {nearest(state, STATES)}')
        until = None if self._until is None or whole else self._until()
        return self._index.search(
            self._now(),
            text=text[:200],
            begin=moment(begin),
            end=moment(end),
            place=place,
            kind=kind,
            severity=SEVERITIES.index(severity) if severity else 0,
            state=state,
            robot=robot,
            run=run,
            skip=_count('skip', skip, 10**9),
            most=_count('most', most, MOST),
            until=until,
        )

    def event(self, key: str) -> Any:
        """Tell all that is known of one event."""
        found = self._index.find(key)
        if found is None:
            raise ValueError(f'no event {key[:80]!r}')
        return {'ok': True, 'event': found.to_json(self._now(), self._index.mutes)}

    def choices(self) -> Any:
        """Tell the places, kinds, states, severities and robots that events have."""
        return {'ok': True, **self._index.choices(), 'count': len(self._index)}


def moment(text: str) -> float | None:
    """Return the time that a text names, seconds since 1970; None: it is empty.

    Raises:
        ValueError: It names none.
    """
    if not text:
        return None
    try:
        value = float(text)
        if math.isfinite(value):
            return value
    except ValueError:
        pass
    try:
        return datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError, OSError):
        raise ValueError(f'time {text[:40]!r}: expected such as 2026-03-01T22:00') from None


def _count(name: str, text: str, most: int) -> int:
    if not (text.isascii() and text.isdigit() and int(text[:10]) <= most):
        raise ValueError(f'{name} {text[:40]!r}: expected a number up to {most}')
    return int(text)
