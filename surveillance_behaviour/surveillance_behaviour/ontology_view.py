"""What the ontology says when a robot decides, or what is known of it while it does not answer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

from floor_plans import PatrolRules
from patrol_policy.decision import DecisionSettings
from patrol_policy.rule_table import ALERT, URGENT
from state_machines import Interrupt
from state_machines.exceptions import CallError, CallInterruptedError
from surveillance_behaviour.ports import Ontology
from surveillance_ontology.robot_ontology import Snapshot

Visits = Mapping[str, float]
"""When each place was visited last, seconds on the mission's clock."""
Said = Mapping[str, bool]
"""Whether the ontology holds a place URGENT; of one that is missing its word does not count."""


class OntologyView:
    """Takes one snapshot of the ontology for each look, and remembers the last one.

    The ontology is told in the same batch which visits it does not know: one that was built anew
    has them from here. Owned by the thread that looks.

    Args:
        ontology: The ontology.
        settings: Of decisions, shared with whoever changes them.
        others_visits: The visits of the other robots of a fleet, which goes on while the ontology
            does not answer; None: there is no fleet, and the robot waits for it.
        warn: Told when the robot is cut off.
        tell: Told when it is no more.
    """

    def __init__(
        self,
        ontology: Ontology,
        settings: DecisionSettings,
        others_visits: Callable[[], Visits] | None,
        warn: Callable[[str], None],
        tell: Callable[[str], None],
    ) -> None:
        self._ontology = ontology
        self._settings = settings
        self._others_visits = others_visits
        self._warn, self._tell = warn, tell
        self._last: Snapshot | None = None
        self._cut_off = False

    @property
    def came(self) -> float | None:
        """When the robot came to the place that the ontology has; None where nobody told."""
        stamp = 0 if self._last is None else self._last.seen_at
        return stamp / 1e9 if stamp else None

    def heard_place(self, place: str, interrupt: Interrupt) -> str:
        """Return where the robot was heard of last, without waiting; empty: in no place."""
        return self._ontology.await_place(place, 0.0, interrupt)

    def place_classes(self, interrupt: Interrupt) -> Collection[str]:
        """Return the names of all classes of places; raises CallError as `look` does."""
        return self._ontology.place_classes(interrupt)

    def look(
        self, now: float, here: str, rules: PatrolRules, visits: Visits, interrupt: Interrupt
    ) -> tuple[Snapshot, Said]:
        """Return what the ontology says, and of which places whether they are URGENT.

        Args:
            now: Seconds on the mission's clock.
            here: Where the robot is, as far as is known.
            rules: What holds for single places.
            visits: The robot's own.
            interrupt: Ends it.

        Raises:
            CallError: It does not answer, and nothing is known yet, or there is no fleet.
        """
        last = self._last
        if self._cut_off and last is not None and not self._ontology.answers():
            place = self.heard_place(here, interrupt) or here
            if place in last.connections:
                return self._as_known(last, place, visits)
        classes = self._settings.priorities.classes
        try:
            found = self._last = self._ontology.snapshot(
                now,
                classes if ALERT in classes else (*classes, ALERT),
                visits,
                interrupt,
                self._settings.urgency_threshold,
                rules.thresholds,
            )
        except CallInterruptedError:
            raise
        except CallError as error:
            place = self.heard_place(here, interrupt) or here
            if self._others_visits is None or last is None or place not in last.connections:
                raise
            if not self._cut_off:
                self._warn(f'{error}: patrolling on by what was known')
            self._cut_off = True
            return self._as_known(last, place, visits)
        if self._cut_off:
            self._tell('the ontology answers again: it is told of the visits since')
        self._cut_off = False
        return found, _said(found, rules)

    def _as_known(self, last: Snapshot, here: str, visits: Visits) -> tuple[Snapshot, Said]:
        """Return what was known and what was seen since: the map is as it was.

        How long places wait says which are URGENT, and beside that what nobody has seen to.
        """
        assert self._others_visits is not None
        seen = dict(last.visited_at)
        for known in (visits, self._others_visits()):
            for place, at in known.items():
                if place in last.connections:
                    seen[place] = max(at, seen.get(place, -1.0))
        said = {
            place: True
            for place, kinds in last.classes.items()
            if place not in seen
            # Something was noticed there, and nobody came since.
            or ({ALERT, URGENT} <= kinds and seen[place] == last.visited_at.get(place))
        }
        return replace(last, place=here, reachable=last.connections[here], visited_at=seen), said


def _said(found: Snapshot, rules: PatrolRules) -> Said:
    """Return of which places the ontology's word counts, and whether it holds them URGENT.

    An ontology that knows one threshold for all says nothing of a place with its own, unless nobody
    was there yet, or something was noticed there.
    """
    return {
        place: URGENT in kinds
        for place, kinds in found.classes.items()
        if place not in rules.thresholds
        or place in found.thresholds
        or place not in found.visited_at
        or ALERT in kinds
    }
