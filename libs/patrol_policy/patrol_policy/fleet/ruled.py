"""How a fleet decides in simulated time when rules hold for each robot, as `decision.decide` does.

It stands beside `simulation`, which knows no rules: decisions know fleets, not the other way round.
"""

from __future__ import annotations

from collections.abc import Mapping

from patrol_policy.battery import Battery
from patrol_policy.decision import RECHARGE, DecisionSettings, decide
from patrol_policy.fleet.assignment import FleetChoice, FleetOutlook
from patrol_policy.fleet.simulation import FleetPolicy, FleetView
from patrol_policy.situation import Situation


def ruled(
    classes: Mapping[str, frozenset[str]],
    thresholds: Mapping[str, float],
    settings: DecisionSettings,
) -> FleetPolicy:
    """Return a policy by which each robot keeps the rules.

    Args:
        classes: Of each place.
        thresholds: Seconds after which each place is URGENT.
        settings: Of decisions.
    """

    def choose_place(view: FleetView, name: str) -> FleetChoice:
        graph, here = view.graph, view.robots[name].place
        world = Situation(
            place=here,
            now=view.now,
            reachable=tuple(graph.leg_seconds[here]),
            classes=classes,
            visited_at=view.visited_at,
            graph=graph,
            own_thresholds=thresholds,
            fleet=FleetOutlook(name, tuple(view.robots.values()), graph, view.settings),
        )
        found = decide(world, Battery(), settings)
        place = found.slot.dock if found.rule == RECHARGE and found.slot else found.place
        until = view.now + found.stay if found.stay else None
        return FleetChoice(place, until, found.cell, found.reason, found.slot)

    return choose_place
