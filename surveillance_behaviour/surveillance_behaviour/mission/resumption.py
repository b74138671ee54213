"""Where a mission stood whose process was killed, as far as its record tells."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from surveillance_behaviour.mission.record import Event
from surveillance_behaviour.policy.rules import RECHARGE


@dataclass(frozen=True)
class CutOff:
    """The last that is known of a mission that did not end as told.

    Attributes:
        time: When that was, seconds on the mission's clock.
        place: Where the robot was last.
        explored: Seconds for which it had explored that place; inf when it was done there.
        left: Another place had been chosen since, so that it may be anywhere by now.
        charging: Why it had been sent to charge and has not been charged since; empty: it was not.
        visits: When the robot was in each place last, seconds.
    """

    time: float
    place: str
    explored: float = 0.0
    left: bool = False
    charging: str = ''
    visits: dict[str, float] = field(default_factory=dict)

    def __str__(self) -> str:
        parts = [f'the robot was in {self.place}']
        if self.left:
            parts = [f'the robot was on its way from {self.place}']
        elif self.explored:
            done = 'whole' if math.isinf(self.explored) else f'for {self.explored:.1f} s'
            parts.append(f'had explored it {done}')
        if self.charging:
            parts.append('was to charge')
        return ', '.join(parts)


def cut_off(events: Iterable[Event]) -> CutOff | None:
    """Where the last mission of a record stood; None when it ended as told, or never began."""
    known: CutOff | None = None
    for event in events:
        if known is not None and event.time < known.time:
            known = None  # Another clock: another simulation.
        known = _after(known, event)
        if known is not None:
            known = replace(known, time=event.time)
    return known


def _after(known: CutOff | None, event: Event) -> CutOff | None:
    match event.name:
        case 'end':
            return None
        case 'start' | 'visit':
            place = event.text('place')
            if event.name == 'start' and known is not None and known.place == place:
                return known
            visits = known.visits if known else {}
            if event.name == 'visit':
                visits[place] = event.time
            charging = known.charging if known else ''
            return CutOff(event.time, place, charging=charging, visits=visits)
    if known is None:
        return None
    match event.name:
        case 'exploring':
            return replace(known, explored=event.number('seconds'))
        case 'decision':
            reason = event.text('reason') if event.text('rule') == RECHARGE else ''
            return replace(known, explored=math.inf, left=True, charging=reason)
        case 'recharge':
            return replace(known, explored=math.inf, left=False, charging='')
    return known
