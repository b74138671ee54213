"""How a robot goes among the others of its fleet: who goes first, who has a dock, and for how long.

`Traffic` is that of a robot that is alone, where nobody is in the way; `FleetTraffic` publishes
what the robot is about to do, and waits or gives way where another one goes first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

from patrol_policy.battery import Battery, Energy
from patrol_policy.decision import RECHARGE, WAIT, DecisionSettings, energy_of
from patrol_policy.fleet import FleetOutlook, Intention, RightOfWay
from patrol_policy.graph import PatrolGraph
from patrol_policy.situation import Decision, Situation
from state_machines import Interrupt
from state_machines.exceptions import CallInterruptedError
from surveillance_behaviour.fleet import FleetKnowledge, cell_of

LOOK_AGAIN = 1.0
"""How long a robot waits for another one until it looks again, seconds."""
UNKNOWN_CHARGE = 600.0
"""How long a charge is taken to last before anything is known of the battery, seconds."""


class Traffic:
    """That of a robot that is alone.

    Attributes:
        others_visits: Returns when the other robots visited places; None: there are none.
    """

    others_visits: Callable[[], Mapping[str, float]] | None = None

    def outlook(self, graph: Callable[[], PatrolGraph], now: float) -> FleetOutlook | None:
        """Return what a decision needs to know of the fleet; None: there is none.

        Args:
            graph: Returns the map with times that all robots compute with.
            now: Seconds on the mission's clock.
        """
        return None

    def enter(
        self,
        decision: Decision,
        world: Situation,
        battery: Battery,
        visits: Mapping[str, float],
        interrupt: Interrupt,
    ) -> Decision:
        """Publish what was decided; return it, or to wait or give way where another goes first.

        Args:
            decision: What was decided.
            world: What is known.
            battery: The same of the battery.
            visits: When this robot visited each place last.
            interrupt: Ends it.

        Raises:
            CallInterruptedError: It was ended.
        """
        return decision

    def saw(self, place: str, now: float, visits: Mapping[str, float]) -> None:
        """Publish where the robot is."""

    def stands(self, place: str) -> None:
        """Publish that the robot is not on its way any more."""

    def begin_charge(self, decision: Decision, why: str, approach: float) -> None:
        """Note that a charge was decided.

        Args:
            decision: To charge.
            why: Why the robot must; empty: it is a planned one.
            approach: Seconds from the place to its station.
        """

    def begin_whole_charge(self) -> None:
        """Note that the robot charges until it is full."""

    def tell_charge(self, world: Situation, battery: Battery, now: float) -> None:
        """Publish until when the robot charges, as the level rises."""

    def charged(self, now: float) -> None:
        """Publish that the robot has been charged."""

    def passing_charge_is_over(self, now: float) -> bool:
        """Return whether a charge in passing has had its time."""
        return False

    def who_is_at(self, dock: str, world: Situation) -> str:
        """Return the other robot that has a dock; empty: none."""
        return ''


class FleetTraffic(Traffic):
    """That of one robot of a fleet.

    Args:
        fleet: What is known of all robots.
        settings: Of decisions, shared with whoever changes them.
        settle: Waits until what was published is heard, so that two robots that want the same at
            the same moment know it of each other.
    """

    def __init__(
        self,
        fleet: FleetKnowledge,
        settings: DecisionSettings,
        settle: Callable[[Interrupt], None] = lambda interrupt: None,
    ) -> None:
        self.fleet = fleet
        self.others_visits = fleet.visits
        self._settings, self._settle = settings, settle
        self._wanted: tuple[str, float] = ('', 0.0)  # Where to, and since when.
        self._waits = False
        self._charge_until: float | None = None

    def outlook(self, graph: Callable[[], PatrolGraph], now: float) -> FleetOutlook:
        return self.fleet.outlook(graph(), now)

    def enter(
        self,
        decision: Decision,
        world: Situation,
        battery: Battery,
        visits: Mapping[str, float],
        interrupt: Interrupt,
    ) -> Decision:
        fleet, here, now = self.fleet, world.place, world.now
        if decision.target != self._wanted[0]:
            # Who waits keeps its turn, whatever it wants meanwhile.
            self._wanted = (decision.target, self._wanted[1] if self._waits else now)
        self._waits = False
        dock = decision.target if decision.rule == RECHARGE else None
        goes_to = decision.place if decision.place != here else ''
        wish = Intention(fleet.name, here, goes_to, self._wanted[1])
        is_new = wish != fleet.own.intention
        begins = {'since': now} if dock is not None and fleet.own.robot.dock is None else {}
        fleet.tell(
            place=here,
            now=now,
            visits=visits,
            intention=wish,
            cell=cell_of(decision, fleet.own.robot.cell),
            dock=dock,
            **self._charge_facts(world, battery, dock),
            **begins,
        )
        at_dock = dock is not None and dock in (here, decision.place)
        if at_dock and (other := self.who_is_at(decision.target, world)):
            reason = f"{decision.reason}; the station in {dock} is {other}'s"
            return self._waiting(decision, world, reason)
        right = self._right_of_way(wish, world, is_new, interrupt)
        if not right.go:
            return self._waiting(decision, world, f'waiting in {here}: {right.because}')
        if not goes_to and right.place not in ('', here):
            decision = replace(
                decision,
                place=right.place,
                target=right.place,
                rule=WAIT,
                reason=f'giving way: {right.because}',
                stay=0.0,
            )
            wish = replace(wish, heading_to=right.place)
        if wish.heading_to:
            fleet.tell(intention=replace(wish, is_moving=True))
        return decision

    def _right_of_way(
        self, wish: Intention, world: Situation, is_new: bool, interrupt: Interrupt
    ) -> RightOfWay:
        fleet, neighbours = self.fleet, world.graph.leg_seconds
        if not fleet.others():
            return RightOfWay(True, wish.heading_to or world.place)
        # What was said before is known to all by now.
        if is_new and fleet.may_be_contested(neighbours, world.now):
            self._settle(interrupt)
            if interrupt.is_set():
                raise CallInterruptedError
        return fleet.right_of_way(neighbours, world.now)

    def _waiting(self, decision: Decision, world: Situation, reason: str) -> Decision:
        self._waits = True
        return replace(
            decision,
            place=world.place,
            rule=WAIT,
            reason=reason,
            stay=LOOK_AGAIN,
            cell=None,
            slot=None,
        )

    def who_is_at(self, dock: str, world: Situation) -> str:
        assert world.fleet is not None
        for robot in sorted(world.fleet.robots, key=lambda each: each.name):
            if robot.name != self.fleet.name and robot.dock == dock and robot.place == dock:
                return robot.name
        return ''

    def take_out(self, out: bool) -> str:
        """Take this robot out of the fleet's patrol, or put it back; return what was done."""
        self.fleet.tell(taken_out=out, cell=None)
        if out:
            return f'{self.fleet.name} is taken out: the others have its places'
        return f'{self.fleet.name} patrols again'

    def saw(self, place: str, now: float, visits: Mapping[str, float]) -> None:
        self.fleet.tell(place=place, now=now, visits=visits)

    def stands(self, place: str) -> None:
        own = self.fleet.own
        if own.intention.heading_to:
            wish = Intention(self.fleet.name, place or own.robot.place, '', self._wanted[1])
            self.fleet.tell(intention=wish)

    # A charge in passing is a stop of known length; one that the battery asks for ends when full.

    def begin_charge(self, decision: Decision, why: str, approach: float) -> None:
        self._charge_until = None
        if not why and decision.slot is not None and decision.place == decision.from_place:
            self._charge_until = decision.slot.end + approach

    def begin_whole_charge(self) -> None:
        self._charge_until = None

    def passing_charge_is_over(self, now: float) -> bool:
        return self._charge_until is not None and now >= self._charge_until

    def charged(self, now: float) -> None:
        self._charge_until = None
        self.fleet.tell(dock=None, charging_until=None, since=now)

    def tell_charge(self, world: Situation, battery: Battery, now: float) -> None:
        if self.fleet.own.robot.dock is None:
            return
        energy = energy_of(world, battery, self._settings)
        if energy is not None and battery.level is not None:
            self.fleet.tell(charging_until=self._charges_until(now, energy, battery.level))

    def _charge_facts(
        self, world: Situation, battery: Battery, dock: str | None
    ) -> dict[str, float | None]:
        """Return what the others must know of this robot's battery."""
        energy = energy_of(world, battery, self._settings)
        facts: dict[str, float | None] = {
            'charging_until': None,
            'runs_until': None,
            'charge_seconds': 0.0,
        }
        if energy is None or battery.level is None:
            if dock is not None:
                facts['charging_until'] = world.now + UNKNOWN_CHARGE
            return facts
        least = max(
            self._settings.battery.require_recharge,
            max(level for level in energy.least if math.isfinite(level)),
        )
        # What it would take now: a full battery needs no time at a dock yet.
        facts['charge_seconds'] = energy.charge_seconds(0, battery.level)
        assert world.fleet is not None
        self.fleet.charges_at(energy.charge_ratio(world.fleet.graph.tour.length))
        facts['runs_until'] = world.now + max(0.0, battery.level - least) / energy.draw
        if dock is not None:
            facts['charging_until'] = self._charges_until(world.now, energy, battery.level)
        return facts

    def _charges_until(self, now: float, energy: Energy, level: float) -> float:
        """Return when this robot leaves its dock: when it is full, or its time in passing is over.

        Where that is over, and the battery does not let it go on, it charges until it is full.
        """
        full, ends = now + energy.charge_seconds(0, level), self._charge_until
        return full if ends is None or ends <= now else min(full, ends)
