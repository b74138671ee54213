"""Where to go next: charging first, then an operator's request, quiet hours, the rules, the policy.

`decide` is the one function that decides, for both behaviours. It is pure: all that it knows
comes in as a `Situation`, a `Battery` and `DecisionSettings`. `why_not` answers from the same steps
why a place is not chosen.

The rules are classes of places in order of priority (`rule_table`). The first class that has a
reachable member decides: its members are the candidates, and the policy chooses among them. Where
the way to the chosen place and home from there takes more than the charge, the robot charges first.
A policy that plans ahead may also choose to charge, where that costs least.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from patrol_policy.battery import (
    PERCENTILE_99,
    Battery,
    BatteryLimits,
    ChargeCurve,
    Charger,
    Energy,
)
from patrol_policy.fleet.assignment import FleetOutlook, PartitionCell
from patrol_policy.policies import DEFAULT_POLICY, POLICIES, Charge, Scores, make_policy
from patrol_policy.rule_table import (
    ANY,
    DEFAULT_PRIORITIES,
    Priorities,
    is_by_waiting,
    priorities_expected,
)
from patrol_policy.situation import Decision, Situation
from strict_files.settings import converted, names_expected, parameter, parameters
from strict_files.suggestions import nearest

RECHARGE = 'recharge'
"""The rule of a decision to go charging."""
REQUEST = 'request'
"""The rule of a decision to go where an operator has sent the robot."""
QUIET = 'quiet'
"""The rule of a decision to stay at the station: quiet hours, or nothing is open."""
SHARE = 'share'
"""The rule of a decision that a fleet's share asks for, where the rules ask nothing."""
WAIT = 'wait'
"""The rule of a decision to stay: another robot of the fleet goes first, or has the dock."""
SWEEP = 'sweep'
"""The rule of a decision to go over the only place that there is once more."""
LONGEST_THRESHOLD = 10**9
"""Seconds: 31 years."""


class NowhereToGoError(RuntimeError):
    """No place can be reached from where the robot is."""


class NothingOpenError(NowhereToGoError):
    """All that can be reached is closed now, or will be before the robot is out again."""


class OutOfRangeError(NowhereToGoError):
    """A full charge does not suffice for any place within reach."""


class RequestError(NowhereToGoError):
    """The place that an operator asked for cannot be reached."""


@dataclass
class DecisionSettings:
    """What a decision depends on beside the world and the battery; may be changed in between.

    Attributes:
        battery: When to charge.
    """

    priorities: Priorities = converted(
        lambda entries: Priorities(tuple(entries)),
        DEFAULT_PRIORITIES,
        'Classes of places by falling priority; empty: any place within reach.',
        name='rooms_priority',
        of=str,
        check=priorities_expected,
    )
    policy: str = parameter(
        DEFAULT_POLICY,
        'How a place is chosen among those that the rules allow.',
        choices=tuple(POLICIES),
    )
    urgency_threshold: float = parameter(
        7, 'Seconds without a visit after which a place is URGENT.', 0, LONGEST_THRESHOLD
    )
    recharge_rooms: tuple[str, ...] = parameter(
        ('E',), 'Places with a charging station.', of=str, check=names_expected
    )
    battery: BatteryLimits = parameters(BatteryLimits)
    exploration_seconds: float = parameter(
        2.0, 'Seconds the robot takes to explore a place.', 0.0, 86_400.0
    )
    speed: float = parameter(
        0.6,
        "Metres per second, to tell a move's time before any was driven.",
        0.001,
        100.0,
        name='robot_speed',
    )


def enterable(world: Situation) -> list[str]:
    """Return the places that may be entered next, whatever their class.

    Those that could not be reached lately only count when nothing else can be reached.

    Raises:
        NowhereToGoError: Nothing is reachable.
        NothingOpenError: Nothing that is reachable is open.
    """
    reachable = [place for place in world.reachable if place != world.place]
    if not reachable:
        raise NowhereToGoError(f'nothing can be reached from {world.place}')
    reachable = [place for place in reachable if not is_closed(world, place)]
    if not reachable:
        raise NothingOpenError(f'nothing that can be reached from {world.place} is open')
    return [place for place in reachable if place not in world.avoided] or reachable


def candidates(world: Situation) -> tuple[str, tuple[str, ...]]:
    """Return the class whose turn it is and the places that may be chosen, sorted; see `enterable`.

    Raises:
        NowhereToGoError: Nothing is reachable.
    """
    return world.first_of(enterable(world))


def is_closed(world: Situation, place: str) -> bool:
    """Return whether a place may not be entered now, or closes before the robot is out of it."""
    return bool(why_closed(world, place))


def why_closed(world: Situation, place: str) -> str:
    """Return why a place may not be entered now; empty: it may."""
    openings = world.openings
    if place in openings.closed:
        return openings.closed[place]
    closes = openings.closes_in.get(place)
    if closes is None or place not in world.graph.index or world.place not in world.graph.index:
        return ''
    # It must be able to leave again, too: as long as the longest leg out of it may take.
    seconds = world.graph.move(world.place, place) + world.graph.longest_exit(place)
    seconds *= 1.0 + PERCENTILE_99 * world.time_spread
    if seconds < closes:
        return ''
    return f'it closes in {closes:.0f} s, and a visit takes up to {seconds:.0f} s'


def energy_of(world: Situation, battery: Battery, settings: DecisionSettings) -> Energy | None:
    """Return what the charge comes to on this map; None: too little is known of the battery.

    It is kept with the world's memory as long as nothing has changed.
    """
    if battery.level is None or battery.draw.rate <= 0.0:
        return None
    stations = [
        Charger(place, battery.curves.get(place, ChargeCurve()), battery.approaches.get(place, 0.0))
        for place in sorted(settings.recharge_rooms)
        if place in world.graph.index and place not in world.avoided
    ]
    if not stations:
        return None
    spread = round(world.time_spread, 2)
    key = (world.graph, tuple(stations), battery.draw, spread, settings.battery)
    kept = world.memory.energy
    found = kept.get(key)
    if found is None:
        # One for the whole map and one for the part that is open.
        if len(kept) > 1:
            kept.pop(next(iter(kept)))
        found = kept[key] = Energy(world.graph, stations, battery.draw, spread, settings.battery)
    return found


def decide(world: Situation, battery: Battery, settings: DecisionSettings) -> Decision:
    """Choose where to go next.

    Raises:
        NowhereToGoError: Nothing can be reached, or no charging place when one is needed.
    """
    if world.fleet is not None:
        return _one_move(world, _decide(world, battery, settings))
    return _decide(world, battery, settings)


def _one_move(world: Situation, decision: Decision) -> Decision:
    """Go only as far as the next place: between robots each way has its own right of way."""
    if decision.place in (world.place, *world.graph.leg_seconds[world.place]):
        return decision
    return replace(decision, place=world.graph.route(world.place, decision.place)[0])


def _decide(world: Situation, battery: Battery, settings: DecisionSettings) -> Decision:
    if why := why_charge(world, battery, settings):
        return _to_charge(world, settings.recharge_rooms, why)
    if world.requested and world.requested != world.place:
        return _as_requested(world)
    if world.openings.quiet_for > 0.0:
        return _stay(world, settings, f'quiet hours for {world.openings.quiet_for:.0f} s more')
    if {*world.classes, *world.graph.places} == {world.place} and not is_closed(world, world.place):
        reason = (
            f'{world.place} is the only place there is ({world.idleness_in_words(world.place)})'
        )
        return _straight_to(world, world.place, SWEEP, 'sweep', reason, {world.place: 0.0})
    world = planning_view(world, battery, settings)
    energy = energy_of(world, battery, settings)
    try:
        rule, allowed = candidates(_within_range(world, energy))
    except (NothingOpenError, OutOfRangeError) as error:
        return _stay(world, settings, str(error))
    if world.fleet is not None:
        decision = _shared(world, world.fleet, _within_range(world, energy), settings)
    else:
        scores = make_policy(settings.policy)(world, allowed, energy)
        if isinstance(scores, Charge):
            return _to_charge(world, (scores.place,), scores.words)
        decision = _best(world, rule, allowed, scores, settings.policy)
    # A dock of the fleet that is closed for long is driven to, and is not on the plan's map.
    is_on_map = decision.place in world.graph.index
    if energy is not None and is_on_map and (why := _too_far(world, decision.place, energy)):
        here = world.graph.index[world.place]
        if not (here in energy.stations and world.level >= energy.full):
            return _to_charge(world, settings.recharge_rooms, why)
    return decision


def _shared(
    world: Situation, fleet: FleetOutlook, within: Situation, settings: DecisionSettings
) -> Decision:
    """Choose what the robot's share of the places asks for, as far as the rules allow it.

    An URGENT place counts for the robot that comes to it first on its way along the tour. Stops
    that the rules do not allow are passed over, and are the next robot's.
    """
    choice = fleet.choose(world.now, world.visited_at)
    here = world.place
    common: dict[str, Any] = {
        'time': world.now,
        'from_place': here,
        'policy': 'fleet',
        'cell': choice.cell,
    }
    if choice.slot is not None:
        return Decision(
            **common,
            place=choice.place,
            target=choice.place,
            rule=RECHARGE,
            reason=choice.reason,
            slot=choice.slot,
        )
    if choice.cell is None:
        stay = max(1.0, (choice.until or world.now) - world.now)
        return Decision(
            **common, place=here, target=here, rule=WAIT, reason=choice.reason, stay=stay
        )
    others = dict.fromkeys(set(world.graph.places) - choice.mine, False)
    mine = replace(within, said={**within.said, **others})
    rule, allowed = candidates(mine)
    goal, graph = choice.place, world.graph
    if not is_by_waiting(rule) and (far := _overdue(world, fleet, choice.cell, enterable(within))):
        common['cell'] = PartitionCell(choice.cell.tour, far)
        step = graph.route(here, far)[0]
        reason = (
            f'{far} is overdue ({world.idleness_in_words(far)}): by the rules no robot of its '
            f'group came to it'
        )
        return Decision(**common, place=step, target=far, rule=SHARE, reason=reason)
    # It stays where the rules would have it go; but as others pass stops over and overtake it again
    # and again, not for ever.
    is_of_rule = not is_by_waiting(rule) and world.is_in(here, rule)
    fits = rule == ANY or (is_of_rule and not choice.overstays)
    if goal == here and fits:
        stay = max(1.0, (choice.until or world.now + 1.0) - world.now)
        reason = choice.reason
        return Decision(**common, place=here, target=here, rule=SHARE, reason=reason, stay=stay)
    # A stop that is closed for long is not on this robot's map, and is passed over.
    if goal in graph.index and goal != here and (step := graph.route(here, goal)[0]) in allowed:
        return Decision(**common, place=step, target=goal, rule=rule, reason=choice.reason)
    for stop in _onward(choice.cell):
        if stop == here or stop not in graph.index:
            continue
        if rule == ANY or mine.is_in(stop, rule) or mine.is_urgent(stop):
            step = graph.route(here, stop)[0]
            if step in allowed:
                common['cell'] = PartitionCell(choice.cell.tour, stop)
                reason = f'{stop} is the next on the tour that the rules allow ({rule})'
                if goal != here:  # why it would stay is no reason to go
                    reason += f'; {choice.reason}'
                return Decision(**common, place=step, target=stop, rule=rule, reason=reason)
    onward = graph if goal in graph.index else fleet.graph
    scores = {
        place: -graph.move(here, place)
        - onward.seconds(place, goal)
        + world.idleness_of(place) * 1e-3
        for place in allowed
    }
    best = max(sorted(scores), key=lambda place: scores[place])
    kind = 'place' if rule == ANY else f'{rule} place'
    reason = (
        f'{best} ({world.idleness_in_words(best)}) is the {kind} within reach that is nearest to '
        f'{goal}; {choice.reason}'
    )
    return Decision(**common, place=best, target=best, rule=rule, reason=reason, scores=scores)


def _overdue(
    world: Situation,
    fleet: FleetOutlook,
    cell: PartitionCell,
    onward: Collection[str],
) -> str:
    """Return a stop of the robot's group that has been URGENT for a whole tour; empty: none.

    The way to it may lead through places that are never URGENT, since other robots visit them, nor
    of the class whose turn it is; a robot that is alone would find them URGENT some time. Or two
    robots that arrive by turns left it to each other. One that another robot of the group drives to
    is left to that one; where two do, to the nearer one, then to the first by name.

    Args:
        world: What is known.
        fleet: The same of all robots.
        cell: What the robot drives to by its share.
        onward: The neighbours that may be entered now, whatever their class.
    """
    if not world.table.has_urgent:
        return ''
    late = fleet.graph.tour.length

    def can_go(stop: str) -> bool:
        if stop == world.place or stop not in world.graph.index or stop in world.avoided:
            return False
        return not is_closed(world, stop) and world.graph.route(world.place, stop)[0] in onward

    overdue = [
        stop
        for stop in _onward(cell)
        if world.idleness_of(stop) > world.threshold_of(stop) + late and can_go(stop)
    ]
    if not overdue:
        return ''
    distances, index = fleet.graph.distances, fleet.graph.index
    sharing = fleet.sharing(world.now)
    # Who charges is on no way, and comes to it later than whoever finds it overdue.
    ways = {
        robot.name: (world.place if robot.name == fleet.name else robot.place, robot.cell.stop)
        for robot in fleet.robots
        if robot.name in sharing
        and robot.cell is not None
        and robot.cell.tour == cell.tour
        and robot.charging_until is None
    }

    def is_taken(stop: str) -> bool:
        away = [
            (float(distances[index[place], index[stop]]), name)
            for name, (place, goal) in ways.items()
            if goal == stop
        ]
        return bool(away) and min(away)[1] != fleet.name

    return next((stop for stop in overdue if not is_taken(stop)), '')


def _onward(cell: PartitionCell) -> tuple[str, ...]:
    """Return the stops of a share's tour from its own stop on."""
    first = cell.tour.index(cell.stop)
    return cell.tour[first:] + cell.tour[:first]


def planning_view(world: Situation, battery: Battery, settings: DecisionSettings) -> Situation:
    """Return the world as the policies see it.

    It knows the rules and the charge, and its map has no places that stay closed for longer than a
    plan looks ahead.
    """
    level = 100.0 if battery.level is None else battery.level
    openings, graph = world.openings, world.graph
    # What opens soon is part of the plan, though it is not entered before.
    gone = [
        place
        for place in openings.closed
        if place in graph.index and openings.opens_in.get(place, math.inf) > world.look_ahead
    ]
    if gone:
        graph = world.memory.without(graph, frozenset(gone), world.place)
    known = level, graph, settings.priorities
    if known == (world.level, world.graph, world.priorities):
        return world
    return replace(world, level=level, graph=graph, priorities=settings.priorities)


def _within_range(world: Situation, energy: Energy | None) -> Situation:
    """Return the world without places that a full charge does not suffice for.

    Raises:
        OutOfRangeError: There are no others.
    """
    if energy is None:
        return world
    index = energy.index
    near = tuple(p for p in world.reachable if p not in index or energy.within_range[index[p]])
    if world.reachable and not [place for place in near if place != world.place]:
        raise OutOfRangeError(
            f'a full charge of {energy.full:g} % suffices for no place within reach'
        )
    return replace(world, reachable=near)


def _too_far(world: Situation, place: str, energy: Energy) -> str:
    """Return why the charge does not suffice for a place and the way home; empty: it does."""
    seconds = world.graph.move(world.place, place)
    left, least = world.level - energy.draw * seconds, energy.least[energy.index[place]]
    if left >= least:
        return ''
    home = energy.home_seconds[energy.index[place]]
    return (
        f'the battery is at {world.level:g} %; a visit of {place} would leave {left:.1f} %, and '
        f'{least:.1f} % must be left there, {home:.1f} s of driving from a station'
    )


def _stay(world: Situation, settings: DecisionSettings, why: str) -> Decision:
    """Stay at the station, or go to the nearest one to stay there."""
    within = stations_within_reach(world, settings.recharge_rooms)
    if not within and world.openings.opens_in:
        reason = f'{why}, nor any way to a station: the robot waits in {world.place}'
        return _straight_to(world, world.place, QUIET, 'station', reason, {world.place: 0.0})
    if not within:
        raise NowhereToGoError(f'{why}, and no station can be reached from {world.place}')
    if world.place in within:
        reason = f'{why}: the robot stays at its station in {world.place}'
        return _straight_to(world, world.place, QUIET, 'station', reason, {world.place: 0.0})
    best = min(within, key=lambda station: (station in world.avoided, within[station]))
    reason = f'{why}: it goes to its station in {best}, {within[best]:.1f} s away'
    return _straight_to(world, best, QUIET, 'station', reason, within)


def why_charge(world: Situation, battery: Battery, settings: DecisionSettings) -> str:
    """Return why the robot must charge now, as a sentence; empty: it need not.

    Once it was sent to charge it must until it has: what is too little for the far end of the
    map may be enough beside the station.
    """
    if battery.sent_to_charge and not battery.charged_enough(settings.battery):
        return battery.sent_to_charge
    if battery.low:
        return f'the battery is low ({battery.level_text()})'
    if battery.level is None:
        return ''
    required, words = settings.battery.require_recharge, 'battery_require_recharge'
    energy = energy_of(world, battery, settings)
    if energy is not None and world.place in energy.index:
        here = energy.index[world.place]
        if energy.least[here] > required and math.isfinite(energy.least[here]):
            required = min(energy.least[here], settings.battery.stop_recharge)
            words = (
                f'home takes {energy.home_seconds[here]:.1f} s at {energy.draw:.3g} %/s, in 99 of '
                f'100 cases with a margin of {settings.battery.margin:g} %'
            )
    if battery.level >= required:
        return ''
    return f'the battery is at {battery.level:g} %, below {required:.1f} % ({words})'


def _to_charge(world: Situation, stations: Sequence[str], why: str) -> Decision:
    """Send the robot to the nearest place where it can charge, wherever that is."""
    within = stations_within_reach(world, stations)
    if not within:
        raise NowhereToGoError(
            f'no charging place ({", ".join(stations)}) can be reached from {world.place}'
        )
    best = min(within, key=lambda station: (station in world.avoided, within[station]))
    kind = 'the charging place' if len(within) == 1 else 'the nearest charging place'
    reason = f'{why}; {best} is {kind}, {within[best]:.1f} s away'
    return _straight_to(world, best, RECHARGE, 'nearest', reason, within)


def stations_within_reach(world: Situation, stations: Sequence[str]) -> dict[str, float]:
    """Return the seconds of driving to each charging place within reach, sorted by name."""
    away = {}
    for station in sorted(stations):
        if station in world.graph.index:
            seconds, _ = world.graph.drive_home([station])
            away[station] = seconds[world.graph.index[world.place]]
    return {station: seconds for station, seconds in away.items() if math.isfinite(seconds)}


def _as_requested(world: Situation) -> Decision:
    """Send the robot where an operator wants it."""
    place = world.requested
    if place not in world.graph.index:
        raise RequestError(f'{place}, as requested, cannot be reached from {world.place}')
    seconds = world.graph.seconds(world.place, place)
    reason = f'an operator has sent the robot to {place}, {seconds:.1f} s away'
    return _straight_to(world, place, REQUEST, 'request', reason, {place: seconds})


def _straight_to(
    world: Situation, place: str, rule: str, policy: str, reason: str, away: Mapping[str, float]
) -> Decision:
    """Go to a place whatever the rules say; ``away`` has the seconds to each candidate."""
    scores = {candidate: -seconds for candidate, seconds in away.items()}
    return Decision(world.now, world.place, place, place, rule, policy, reason, scores)


def _best(
    world: Situation, rule: str, allowed: Sequence[str], scores: Scores, policy: str
) -> Decision:
    """Take the highest score; among equals the longest unvisited, then the first by name."""
    order = sorted(allowed)
    best = max(
        order,
        key=lambda place: (
            round(scores[place].value, 6),
            world.idleness_of(place),
            -order.index(place),
        ),
    )
    threshold = f', threshold {world.threshold_of(best):g} s' if is_by_waiting(rule) else ''
    name = f'{best} ({world.idleness_in_words(best)}{threshold})'
    kind = 'place' if rule == ANY else f'{rule} place'
    if len(allowed) == 1:
        choice = f'{name} is the only reachable {kind}'
    else:
        choice = f'{policy} chose {name} from {len(allowed)} reachable {kind}s'
    return Decision(
        time=world.now,
        from_place=world.place,
        place=best,
        target=scores[best].target,
        rule=rule,
        policy=policy,
        reason=f'{choice}; {scores[best].words}',
        scores={place: scores[place].value for place in order},
    )


def tour_warning(tour: float, threshold: float) -> str:
    """Return what to say when no robot can keep to the threshold; empty when one can.

    Args:
        tour: Length of the shortest closed tour, seconds.
        threshold: The urgency threshold, seconds.
    """
    if threshold >= tour:
        return ''
    return (
        f'urgency_threshold is {threshold:g} s, but the shortest tour of all places takes '
        f'{tour:.1f} s: no robot can keep them from becoming URGENT'
    )


@dataclass(frozen=True)
class WhyNot:
    """Why a place is not chosen.

    Attributes:
        sentence: The rule and the figures.
        premises: What the ontology would have to hold for the place to be chosen, those that it
            lacks first; each says whether it holds.
    """

    sentence: str
    premises: tuple[str, ...] = ()


def check_place(place: str, world: Situation) -> None:
    """Check that a place is on the map, and that an open door leads to it.

    Raises:
        ValueError: It is not, or none does.
    """
    places = world.graph.places
    if place in places:
        return
    if place in world.classes:
        raise ValueError(f'{place} cannot be reached: no open door leads to it')
    raise ValueError(f'there is no place {place!r} on the map, expected {nearest(place, places)}')


def why_not(place: str, world: Situation, battery: Battery, settings: DecisionSettings) -> WhyNot:
    """Tell why `decide` would not send the robot to ``place`` now; changes nothing of that.

    Raises:
        ValueError: There is no such place, or no open door leads to it.
    """
    check_place(place, world)
    if place == world.place:
        return WhyNot(f'the robot is in {place} already')
    try:
        asked = replace(world, memory=world.memory.for_a_question())
        decision = decide(asked, battery, settings)
    except NowhereToGoError as error:
        return WhyNot(str(error), _premises(place, world, ''))
    if decision.place == place and decision.rule != QUIET:
        return WhyNot(f'the robot would go to {place} now [{decision.rule}]: {decision.reason}')
    does = 'stays in' if decision.place == world.place else 'goes to'
    instead = f'the robot {does} {decision.place} [{decision.rule}]'
    if decision.rule in (RECHARGE, REQUEST, QUIET, WAIT, SWEEP):
        return WhyNot(f'{instead}: {decision.reason}')
    if why := why_closed(world, place):
        return WhyNot(f'{place} is not entered: {why}; {instead}')
    energy = energy_of(world, battery, settings)
    if energy is not None and not energy.within_range[energy.index[place]]:
        return WhyNot(f'{place} is not entered: {energy.why_never(place)}; {instead}')
    premises = _premises(place, world, '' if decision.rule in (ANY, SHARE) else decision.rule)
    if place not in world.reachable:
        way = ' - '.join((world.place, *world.graph.route(world.place, place)))
        return WhyNot(
            f'{place} cannot be reached from {world.place} in one move (the way is {way}); '
            f'{instead}',
            premises,
        )
    if place not in decision.scores:
        if place in world.avoided:
            return WhyNot(f'{place} could not be reached lately and is avoided for now; {instead}')
        if not decision.scores:  # A share of a fleet's places compares no candidates.
            return WhyNot(f'{instead}: {decision.reason}', premises)
        return WhyNot(
            f'{place} is not {decision.rule} ({world.idleness_in_words(place)}, threshold '
            f'{world.threshold_of(place):g} s), but {_listed(decision.scores)} '
            f'{"is" if len(decision.scores) == 1 else "are"}; {instead}',
            premises,
        )
    return WhyNot(
        f'{decision.policy} scores {place} {decision.scores[place]:.1f} and {decision.place} '
        f'{decision.scores[decision.place]:.1f}; {instead}: {decision.reason}',
        premises,
    )


def _listed(names: Mapping[str, float]) -> str:
    *rest, last = sorted(names)
    return f'{", ".join(rest)} and {last}' if rest else last


def _premises(place: str, world: Situation, rule: str) -> tuple[str, ...]:
    """Return the facts that a choice of ``place`` rests on, with whether they hold, missing ones
    first.
    """
    facts = [
        (f'the robot canReach {place}', place in world.reachable),
        (
            f'{world.place} connectedTo {place}',
            place in world.graph.leg_seconds.get(world.place, {}),
        ),
    ]
    if rule:
        facts.append((f'{place} is {rule}', world.is_in(place, rule)))
    facts.sort(key=lambda fact: fact[1])
    return tuple(f'{fact}: {"holds" if holds else "missing"}' for fact, holds in facts)
