"""What a mission decided, judged against one that nobody disturbed.

A mission's record has the times of its own clock. Where that was set meanwhile, `SetClock` gives
the true ones.
"""

from __future__ import annotations

import statistics
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

LATE = 2.0
"""By how much a time in the record may differ from when something was decided, seconds."""
NEAR = 0.1
"""By which share a leg may take longer or shorter than the twin's."""


@dataclass
class SetClock:
    """A clock that was set while it ran.

    Attributes:
        steps: When it was set, true seconds, and how far ahead it was from then on, seconds.
    """

    steps: list[tuple[float, float]] = field(default_factory=list)

    def true_times(self, shown: Iterable[float]) -> list[float]:
        """Return the true times of moments that came one after the other, as the clock showed them.

        Between two steps the clock goes right: a moment belongs to the first stretch, not before
        that of the moment before it, in which its true time lies.
        """
        ahead = [0.0, *(each for _, each in self.steps)]
        begun = [float('-inf'), *(at for at, _ in self.steps), float('inf')]
        stretch, found = 0, []
        for time in shown:
            for number in range(stretch, len(ahead)):
                true = time - ahead[number]
                if begun[number] - LATE <= true <= begun[number + 1] + LATE:
                    stretch = number
                    break
            found.append(time - ahead[stretch])
        return found


@dataclass(frozen=True)
class Leg:
    """One drive: from where to where, when it was decided, and for how long, true seconds."""

    start: str
    goal: str
    begun: float
    seconds: float


def legs_of(events: Sequence[dict[str, Any]], clock: SetClock) -> list[Leg]:
    """Return the drives that nothing came between: a visit, a decision, the visit decided on."""
    times = clock.true_times(float(each['time']) for each in events)
    timed = [
        (each, at) for each, at in zip(events, times, strict=True) if each['event'] != 'exploring'
    ]
    found = []
    for (before, _), (decision, begun), (visit, ended) in zip(
        timed, timed[1:], timed[2:], strict=False
    ):
        kinds = [each['event'] for each in (before, decision, visit)]
        if kinds == ['visit', 'decision', 'visit'] and decision['place'] == visit['place']:
            found.append(Leg(before['place'], visit['place'], begun, ended - begun))
    return found


def wrongly_urgent(events: Sequence[dict[str, Any]], clock: SetClock) -> list[str]:
    """Return the decisions for a place as URGENT that was visited within the threshold."""
    times = clock.true_times(float(each['time']) for each in events)
    threshold, visited, found = 0.0, dict[str, float](), []
    for event, at in zip(events, times, strict=True):
        threshold = float(event.get('urgency_threshold', threshold))
        place = str(event.get('place', ''))
        if event['event'] == 'visit':
            visited[place] = at
        elif event['event'] == 'decision' and event.get('rule') == 'URGENT' and place in visited:
            ago = at - visited[place]
            if ago < threshold - LATE:
                found.append(f'{place}, visited {ago:.0f} s ago, threshold {threshold:.0f} s')
    return found


@dataclass(frozen=True)
class Comparison:
    """Legs beside those of the twin, each as the share of what the twin takes in the median.

    Attributes:
        shares: Of each leg that the twin drove, too.
    """

    shares: tuple[float, ...]

    @property
    def near(self) -> int:
        """How many took within `NEAR` of what the twin took."""
        return sum(abs(each - 1.0) <= NEAR for each in self.shares)

    @property
    def median(self) -> float:
        """The share in the median; nan: there is no leg."""
        return statistics.median(self.shares) if self.shares else float('nan')

    @property
    def passed(self) -> bool:
        """Whether the median leg, where one can be compared, takes what the twin's does."""
        return not self.shares or abs(self.median - 1.0) <= NEAR

    def __str__(self) -> str:
        if not self.shares:
            return 'none that nothing came between: hits are too close (--pause)'
        worst = max(self.shares, key=lambda each: abs(each - 1.0))
        return (
            f'{self.near} of {len(self.shares)} within {100 * NEAR:.0f} % of the twin, '
            f'median {self.median:.2f}, worst {worst:.2f}'
        )


def compare(
    legs: Iterable[Leg], twin: Iterable[Leg], hits: Iterable[tuple[float, float]] = ()
) -> Comparison:
    """Compare a mission's legs with its twin's.

    Args:
        legs: Of the mission.
        twin: Of the one that nobody disturbed.
        hits: From when to when nodes of the mission were away, true seconds: what was driven then
            is not compared.
    """
    usual = defaultdict(list)
    for leg in twin:
        usual[leg.start, leg.goal].append(leg.seconds)
    away = list(hits)
    return Comparison(
        tuple(
            leg.seconds / statistics.median(usual[leg.start, leg.goal])
            for leg in legs
            if (leg.start, leg.goal) in usual
            and not any(
                leg.begun <= end and begin <= leg.begun + leg.seconds for begin, end in away
            )
        )
    )
