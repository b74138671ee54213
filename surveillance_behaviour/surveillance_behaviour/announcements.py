"""What a person is told of a patrol beside its decisions: what cannot work, what can be kept."""

from __future__ import annotations

from collections.abc import Callable, Collection

from patrol_policy.battery import Battery
from patrol_policy.decision import DecisionSettings, tour_warning
from patrol_policy.idleness_bounds import IdlenessBound, idleness_bounds, summary, verdicts
from patrol_policy.plan import LEG_CHANGE
from patrol_policy.situation import Situation
from state_machines import Interrupt
from strict_files.suggestions import nearest


class SettingsCheck:
    """Says once what of the settings cannot work on this map and with this ontology.

    Args:
        settings: Of decisions, shared with whoever changes them.
        warn: Told each sentence.
    """

    def __init__(self, settings: DecisionSettings, warn: Callable[[str], None]) -> None:
        self._settings, self._warn = settings, warn
        self._warned = False
        self._threshold: object = None
        self._seconds = 0.0
        self._classes: tuple[str, ...] = ()

    def threshold(self, world: Situation) -> None:
        """Warn of a threshold that no robot can keep to.

        The shortest tour takes long on a large map. It is looked for anew only when places or
        threshold have changed, or what all legs take together, by more than `LEG_CHANGE`.
        """
        of_what = world.threshold, world.graph.places
        seconds = sum(sum(ways.values()) for ways in world.graph.leg_seconds.values())
        alike = abs(seconds - self._seconds) <= LEG_CHANGE * self._seconds
        if of_what == self._threshold and (self._warned or alike):
            return
        self._threshold, self._seconds = of_what, seconds
        warning = tour_warning(world.graph.tour.length, world.threshold)
        self._warned = bool(warning)
        if warning:
            self._warn(warning)

    def classes(self, ask: Callable[[Interrupt], Collection[str]], interrupt: Interrupt) -> None:
        """Warn of a class of the rules that no place can ever be in.

        Args:
            ask: Returns all classes of places.
            interrupt: Ends it.
        """
        classes = self._settings.priorities.classes
        if classes == self._classes:
            return
        known = ask(interrupt)
        self._classes = classes
        for name in classes:
            if name not in known:
                self._warn(
                    f'rooms_priority: the ontology has no class {name!r} of places, expected '
                    f'{nearest(name, known)}; the rule applies once a place is in such a class'
                )


class IdlenessReporter:
    """Says what can be kept of the places, at the start and when what it rests on changes.

    Args:
        settings: Of decisions, shared with whoever changes them.
        tell: Told the sentence, when a place is kept no more or again.
        publish: Given all of them, whenever they are found anew.

    Attributes:
        bounds: Of each place, as found last.
        publish: As given.
    """

    def __init__(
        self,
        settings: DecisionSettings,
        tell: Callable[[str], None],
        publish: Callable[[tuple[IdlenessBound, ...]], None],
    ) -> None:
        self.bounds: tuple[IdlenessBound, ...] = ()
        self._settings = settings
        self.publish = publish
        self._say = tell
        self._verdicts: dict[str, str] = {}
        self._rested_on: object = None

    def tell(
        self, world: Situation, battery: Battery, places: Collection[str], rules: object
    ) -> None:
        """Say it if it has changed.

        Args:
            world: What is known.
            battery: The same of the battery.
            places: All places of the map.
            rules: What holds for single places.
        """
        settings, plan = self._settings, world.memory.planner
        rests_on = (
            world.graph.places,
            world.threshold,
            settings.policy,
            settings.recharge_rooms,
            f'{battery.draw.rate:.1g}',
            frozenset(world.openings.closed),
            places,
            rules,
            _fleet_waits(world),
        )
        if (plan, rests_on) == self._rested_on:
            return
        found = self.bounds = idleness_bounds(world, battery, settings, sorted(places))
        # The first time there was no plan yet.
        self._rested_on = (world.memory.planner, rests_on)
        self.publish(found)
        now = verdicts(found)
        if any(self._verdicts.get(place, '') != verdict for place, verdict in now.items()):
            self._verdicts = {**self._verdicts, **now}
            self._say(summary(found))


def _fleet_waits(world: Situation) -> tuple[str, ...]:
    """Return what the fleet keeps, so roughly that only a changed plan changes it."""
    if world.fleet is None:
        return ()
    found = world.fleet.waits(world.now)
    return tuple(f'{place} {wait:.1g}' for place, wait in sorted(found.items()))
