"""Upper bounds of idleness, told beforehand: how long each place will wait, or why for ever.

Idleness is the time since the last visit of a place, as in the literature of patrolling.

`idleness_bounds` is a pure function of what is known when a decision is made. It follows the plan
of the policy `tour` from where the robot is until it repeats itself, so what it says is what comes,
as long as legs, doors and battery stay as they are. In a fleet it counts all robots that have a
share, their charging included: how long a place waits follows from its group's tour.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from patrol_policy.battery import Battery, Energy
from patrol_policy.decision import (
    DecisionSettings,
    energy_of,
    planning_view,
    stations_within_reach,
)
from patrol_policy.fleet.assignment import FleetOutlook
from patrol_policy.fleet.ruled import ruled
from patrol_policy.fleet.simulation import FleetBattery, FleetPatrol, FleetPolicy
from patrol_policy.plan import planner_of
from patrol_policy.rule_table import RuleTable
from patrol_policy.situation import Situation

WITHIN, LATER, NEVER, UNKNOWN = 'within', 'later', 'never', 'unknown'
CLOSED = 'closed'
SLIGHTLY = 1.25
"""What waits up to so many thresholds is late by little: drives are not that exact."""
MOST_NAMES = 8
"""So many places are named of those of which the same is said."""
MOST_REHEARSED = 400
"""A fleet's patrol is rehearsed for so many decisions at most, about a second's work."""
ROUNDING = 0.05
"""Seconds by which a wait may be above the threshold and counts as within it."""


@dataclass(frozen=True)
class IdlenessBound:
    """What can be kept of one place.

    Attributes:
        place: The place.
        verdict: ``within`` its threshold, ``later``, ``never``, ``unknown``, or ``closed``: it is
            no bound is told before it opens.
        threshold: Seconds that it may go unvisited; inf: as long as it likes.
        wait: The longest time from visit to visit, seconds; inf: it is not visited.
        words: The same as a sentence.
    """

    place: str
    verdict: str
    threshold: float
    wait: float
    words: str


def idleness_bounds(
    world: Situation, battery: Battery, settings: DecisionSettings, places: Sequence[str] = ()
) -> tuple[IdlenessBound, ...]:
    """Return what can be kept of each place, by its name.

    The next decision follows the plan that this is read from.

    Args:
        world: What is known of the surroundings.
        battery: What is known of the battery.
        settings: Of decisions.
        places: All places, also those that no open door leads to.
    """
    asked = planning_view(world, battery, settings)
    names = sorted({*world.graph.places, *places} | world.openings.closed.keys())
    energy = energy_of(asked, battery, settings)
    waits: dict[str, float] = {}
    missed: frozenset[str] = frozenset()
    cut, proven = '', False
    by = ''
    if world.fleet is not None:
        waits = fleet_waits(asked, settings, energy)
        cut, by = 'no robot has it in its share', f' by one of {world.fleet.team(world.now)} robots'
        proven = True
    elif settings.policy == 'tour' and world.place in asked.graph.index:
        planner = planner_of(asked, energy)
        waits = dict(zip(planner.places, planner.settled_waits(), strict=True))
        cut = planner.cut or 'none of the ways that were looked at leads there'
        proven, missed = planner.repeats, planner.missed
    found = []
    for place in names:
        threshold = asked.threshold_of(place)
        never = _why_never(place, world, asked, battery, settings, energy)
        wait = waits.get(place, math.inf)
        opens = world.openings.opens_in.get(place)
        if opens is not None or (place in missed and wait > threshold):
            words = f'{place}: not visited before {_end_of_stretch(place, world)}'
            if place in world.openings.closed:
                words = f'{place}: not visited now, {world.openings.closed[place]}'
            found.append(IdlenessBound(place, CLOSED, threshold, math.inf, words))
        elif never:
            found.append(IdlenessBound(place, NEVER, threshold, math.inf, f'{place}: {never}'))
        elif math.isinf(wait) and proven and (world.fleet is None or place in waits):
            words = (
                f'{place}: never visited, as the rules always have other places before it, and it '
                'never becomes URGENT'
            )
            found.append(IdlenessBound(place, NEVER, threshold, wait, words))
        elif math.isinf(wait):
            why = cut or f'the policy {settings.policy} plans nothing ahead'
            words = f'{place}: it is not known when it is visited, {why}'
            found.append(IdlenessBound(place, UNKNOWN, threshold, wait, words))
        else:
            found.append(_timely(place, wait, threshold, world, by))
    return tuple(found)


def fleet_waits(
    world: Situation, settings: DecisionSettings, energy: Energy | None = None
) -> dict[str, float]:
    """Return how long each place waits at the latest when a fleet has it, seconds.

    Where the rules let every robot enter every place, robots pass each place of a group at equal
    distances in time. Else what follows from the rules is rehearsed: all robots decide in simulated
    time as they would, from where they are. Where that takes too many decisions a place waits
    until it is URGENT, and for a whole round of the robot that has it then. inf: for ever.
    """
    fleet, graph = world.fleet, world.graph
    assert fleet is not None
    waits = fleet.waits(world.now)
    places = fleet.graph.places
    order = settings.priorities.at(world.now, world.openings.zone)
    table = RuleTable.of(order, places, world.classes, world.threshold_of)
    if len(set(table.base)) < 2 or not waits:
        return waits
    limits = {
        place: limit if table.has_urgent else math.inf
        for place, limit in zip(places, table.limits, strict=True)
    }
    team = fleet.team(world.now)
    tour = fleet.graph.tour.length
    longest = max((limit for limit in limits.values() if math.isfinite(limit)), default=0.0)
    begin = longest + tour
    if team * len(graph.places) * 3.0 * begin <= MOST_REHEARSED * tour:
        return _rehearsed(fleet, ruled(world.classes, limits, settings), begin, world.now, energy)
    first = min(table.base)
    return {
        place: wait
        if table.base[fleet.graph.index[place]] == first and not table.has_urgent
        else limits[place] + team * wait
        for place, wait in waits.items()
    }


def _rehearsed(
    fleet: FleetOutlook, policy: FleetPolicy, begin: float, now: float, energy: Energy | None
) -> dict[str, float]:
    """Return how long each place waits when the robots decide by a policy, seconds."""
    docks = tuple(dock for dock in fleet.settings.docks if dock in fleet.graph.index)
    battery = None
    if energy is not None and docks and fleet.settings.charge_ratio > 0.0:
        run = max(1.0, (energy.full - min(energy.least)) / energy.draw)
        battery = FleetBattery(run, run * fleet.settings.charge_ratio)
    sharing = fleet.sharing(now)
    patrol = FleetPatrol(
        fleet.graph,
        {robot.name: robot.place for robot in fleet.robots if robot.name in sharing},
        policy,
        replace(fleet.settings, docks=docks),
        battery=battery,
    )
    patrol.until(3.0 * begin)
    waits = patrol.longest_waits(begin)
    seen = {place for at, _, place in patrol.visits if at >= begin}
    return {place: wait if place in seen else math.inf for place, wait in waits.items()}


def _end_of_stretch(place: str, world: Situation) -> str:
    """Return what ends the time in which an open place can be visited, and when."""
    openings = world.openings
    closes = openings.closes_in.get(place, math.inf)
    windows = openings.windows.get(place, ())
    end = min((end - world.now for _, end in windows if end > world.now), default=closes)
    if end < closes:
        return f'the quiet hours, which begin in {end:.0f} s'
    return f'it closes in {closes:.0f} s'


def _timely(place: str, wait: float, threshold: float, world: Situation, by: str) -> IdlenessBound:
    """Return the bound of a place that is visited again and again."""
    hours = by + (' while it is open' if place in world.openings.windows else '')
    if world.openings.has_quiet:
        hours += ' outside the quiet hours'
    if wait <= threshold + ROUNDING:
        words = f'{place}: visited every {wait:.0f} s at the latest{hours}'
        if math.isfinite(threshold):
            words += f', within its threshold of {threshold:g} s'
        return IdlenessBound(place, WITHIN, threshold, wait, words)
    words = (
        f'{place}: visited every {wait:.0f} s at the latest{hours}, '
        f'{wait - threshold:.0f} s later than its threshold of {threshold:g} s'
    )
    return IdlenessBound(place, LATER, threshold, wait, words)


def _why_never(
    place: str,
    world: Situation,
    asked: Situation,
    battery: Battery,
    settings: DecisionSettings,
    energy: Energy | None,
) -> str:
    """Return why a place is not visited as things are; empty: it is."""
    if place in world.openings.closed:
        return f'never visited, {world.openings.closed[place]}'
    if place not in world.graph.index:
        return 'never visited, no open door leads to it'
    if place not in asked.graph.index:
        return 'not visited now, the way there leads through a place that may not be entered'
    if battery.level is not None and battery.draw.rate > 0.0:
        if not stations_within_reach(world, settings.recharge_rooms):
            return 'never visited, no charging place can be reached'
        if energy is not None and not energy.within_range[energy.index[place]]:
            return f'never visited, {energy.why_never(place)}{_remedy(place, asked, energy)}'
    return ''


def _remedy(place: str, world: Situation, energy: Energy) -> str:
    """Return what would help a place that the charge does not suffice for."""
    graph, at = world.graph, energy.index[place]
    home, _ = graph.drive_home([place])
    ways = sorted(range(len(home)), key=lambda other: (energy.out_seconds[other], other))
    for other in ways:
        # From a station there the place would be left with at least what the way back takes.
        back = graph.drive_home([graph.places[other]])[0][at]
        out = float(graph.row(other)[at])
        if energy.within_range[other] and energy.suffices(out, back):
            return f'; a second station in {graph.places[other]} would do'
    return '; no second station within reach would do'


def lines(found: Sequence[IdlenessBound]) -> list[str]:
    """Return the bounds in words: a sentence for all, then those that cannot be kept in full.

    What is late by little is part of the first one: a place that the rules let the robot enter only
    when it is URGENT never is in time. Places of which the same is to be said share a line.
    """
    if not found:
        return ['there are no places to visit']
    slightly = [each for each in found if _slightly_later(each)]
    rest = [each for each in found if each.verdict != WITHIN and each not in slightly]
    count = len(found) - len(rest)
    kept = f'all {count}' if not rest else f'{count} of {len(found)}'
    first = f'{kept} places can be visited within their thresholds'
    if slightly:
        most = max(100.0 * (each.wait / each.threshold - 1.0) for each in slightly)
        first += f' or little later ({_named(slightly)} up to {most:.0f} %)'
    alike: dict[str, list[IdlenessBound]] = {}
    for each in rest:
        alike.setdefault(each.words.removeprefix(f'{each.place}: '), []).append(each)
    return [first, *(f'{_named(several)}: {words}' for words, several in alike.items())]


def _named(found: Sequence[IdlenessBound]) -> str:
    names = [each.place for each in found]
    more = f' and {len(names) - MOST_NAMES} more' if len(names) > MOST_NAMES else ''
    return ', '.join(names[:MOST_NAMES]) + more


def summary(found: Sequence[IdlenessBound]) -> str:
    """Return the bounds in one sentence for a log; see `lines`."""
    return '; '.join(lines(found))


def verdicts(found: Sequence[IdlenessBound]) -> dict[str, str]:
    """Return what a person is told again of when it changes: kept, later or never, by place.

    What is late by so little that the next drive may turn it counts as kept; what is not known is
    left out.
    """
    return {
        each.place: WITHIN if _slightly_later(each) else each.verdict
        for each in found
        if each.verdict != UNKNOWN
    }


def _slightly_later(bound: IdlenessBound) -> bool:
    return bound.verdict == LATER and bound.wait <= SLIGHTLY * bound.threshold
