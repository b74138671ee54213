"""What a robot of a fleet tells the others, and what it knows of them.

Each robot publishes its facts and keeps the last ones of every other; what follows from them
(shares, right of way) is a pure function in `patrol_policy.fleet`. Times are the mission's clock,
seconds. Methods may be called from any thread.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace

from patrol_policy.fleet import (
    FleetOutlook,
    FleetRobot,
    FleetSettings,
    Intention,
    Layout,
    PartitionCell,
    RightOfWay,
    may_be_contested,
    right_of_way,
)
from patrol_policy.graph import PatrolGraph
from patrol_policy.situation import Decision

SILENT_STEADY = 2.0
"""A robot is not silent before it has said nothing for this long by the steady clock, seconds: fast
simulated time may pass quicker than messages travel."""
STANDS_AFTER = 60.0
"""A robot that is on one way, or waits to go it, for longer than this stands, seconds."""


@dataclass(frozen=True)
class FleetFacts:
    """What a robot publishes.

    Attributes:
        robot: Where it is, its share, its battery; when it was heard is the reader's.
        intention: Where it wants to go.
        visits: When it visited each place last.
    """

    robot: FleetRobot
    intention: Intention
    visits: Mapping[str, float] = field(default_factory=dict)


@dataclass
class _Heard:
    facts: FleetFacts
    at: float
    since: float
    steady: float


class FleetKnowledge:
    """The facts of all robots, as one of them knows them.

    Args:
        name: The robot's own name.
        settings: How the work is shared.
        layout: What is wide enough for two.
        publish: Sends this robot's facts.
        steady: The steady clock, seconds.
        on_news: Called when another robot's facts changed.
    """

    def __init__(
        self,
        name: str,
        settings: FleetSettings,
        layout: Layout,
        publish: Callable[[FleetFacts], None],
        steady: Callable[[], float],
        on_news: Callable[[], None] = lambda: None,
    ) -> None:
        self.name = name
        self.settings = settings
        self.layout = layout
        self._publish = publish
        self._steady = steady
        self._on_news = on_news
        self._lock = threading.Lock()
        self._heard: dict[str, _Heard] = {}
        self._own = FleetFacts(FleetRobot(name, ''), Intention(name, ''))
        self._since: dict[str, tuple[Intention, float]] = {}

    # --- what others say ---

    def hear(self, facts: FleetFacts, now: float) -> None:
        """Take what a robot has said; its own words are not taken."""
        name = facts.robot.name
        if not name or name == self.name or not facts.robot.place:
            return
        with self._lock:
            before, steady = self._heard.get(name), self._steady()
            since = now if before is None or self._is_silent(before, now) else before.since
            if before is None:
                since = -math.inf  # All begin at once: nobody waits for a robot that was there.
            self._heard[name] = _Heard(facts, now, since, steady)
            news = before is None or before.facts != facts
            noted = self._since.get(name)
            if noted is None or noted[0] != facts.intention:
                self._since[name] = (facts.intention, now)
        if news:
            self._on_news()

    def _is_silent(self, heard: _Heard, now: float) -> bool:
        return (
            now - heard.at > self.settings.silent_after
            and self._steady() - heard.steady > SILENT_STEADY
        )

    def others(self) -> tuple[str, ...]:
        """Return the names of all robots that were ever heard, without this one."""
        with self._lock:
            return tuple(sorted(self._heard))

    def visits(self) -> dict[str, float]:
        """Return when any other robot visited each place last."""
        with self._lock:
            latest: dict[str, float] = {}
            for heard in self._heard.values():
                for place, at in heard.facts.visits.items():
                    latest[place] = max(at, latest.get(place, -math.inf))
            return latest

    # --- what this one says ---

    def tell(
        self,
        *,
        place: str | None = None,
        now: float = 0.0,
        visits: Mapping[str, float] | None = None,
        intention: Intention | None = None,
        **robot: object,
    ) -> None:
        """Change what this robot says, and say it.

        Args:
            place: Where it is; another place than before is entered now.
            now: The time.
            visits: When it visited each place last.
            intention: Where it wants to go.
            **robot: Other attributes of `FleetRobot`.
        """
        with self._lock:
            own = self._own
            changed = dict(robot)
            if place is not None and place != own.robot.place:
                changed |= {'place': place, 'since': now}
            facts = FleetFacts(
                replace(own.robot, **changed),  # type: ignore[arg-type]
                own.intention if intention is None else intention,
                own.visits if visits is None else dict(visits),
            )
            self._own = facts
        if facts.robot.place:
            self._publish(facts)

    def repeat(self) -> None:
        """Say it again, as a sign of life."""
        self.tell()

    @property
    def own(self) -> FleetFacts:
        """What this robot says."""
        return self._own

    def charges_at(self, ratio: float) -> None:
        """Take how many seconds this robot charges for each second of patrol.

        Rounded, so that what is learned seldom changes a plan, and up: a charge in passing is to
        make good all that a round has cost, and ends by itself when the battery is full.
        """
        hundredths = math.ceil(100.0 * ratio - 1e-6)
        self.settings = replace(self.settings, charge_ratio=hundredths / 100.0)

    # --- what follows ---

    def outlook(self, graph: PatrolGraph, now: float) -> FleetOutlook:
        """Return what a decision needs."""
        with self._lock:
            robots = [
                replace(
                    heard.facts.robot,
                    heard_at=heard.at if self._is_silent(heard, now) else now,
                    heard_since=heard.since,
                )
                for heard in self._heard.values()
            ]
            robots.append(replace(self._own.robot, heard_at=now, heard_since=-math.inf))
        return FleetOutlook(self.name, tuple(robots), graph, self.settings)

    def right_of_way(self, neighbours: Mapping[str, Collection[str]], now: float) -> RightOfWay:
        """Return whether this robot may go where its intention says, or must give way."""
        return right_of_way(self._intentions(now), self.name, neighbours, self.layout)

    def may_be_contested(self, neighbours: Mapping[str, Collection[str]], now: float) -> bool:
        """Return whether another robot may want what this one's intention needs."""
        return may_be_contested(self._intentions(now), self.name, neighbours, self.layout)

    def _intentions(self, now: float) -> list[Intention]:
        """Return those of all robots that are heard, this one's last."""
        with self._lock:
            known = [
                heard.facts.intention
                for heard in self._heard.values()
                if not self._is_silent(heard, now)
            ]
            return [*known, self._own.intention]

    def standing(self, now: float) -> dict[str, str]:
        """Return the robots that are on one way, or wait for it, for too long, and the silent ones,
        with a sentence on each.
        """
        found = {}
        with self._lock:
            for name, heard in self._heard.items():
                intention, since = self._since[name]
                if heard.facts.robot.taken_out:
                    continue
                # The same words while it lasts: each other text would be told anew.
                if self._is_silent(heard, now):
                    limit = max(self.settings.silent_after, SILENT_STEADY)
                    found[name] = f'{name} has not been heard for more than {limit:g} s'
                elif intention.heading_to and now - since > STANDS_AFTER:
                    way = f'from {intention.place} to {intention.heading_to}'
                    what = 'been on its way' if intention.is_moving else 'waited to go'
                    found[name] = f'{name} has {what} {way} for more than {STANDS_AFTER:g} s'
        return found


def cell_of(decision: Decision, before: PartitionCell | None) -> PartitionCell | None:
    """Return the share to publish with a decision: one to charge or on request keeps it."""
    if decision.cell is not None:
        return decision.cell
    return before
