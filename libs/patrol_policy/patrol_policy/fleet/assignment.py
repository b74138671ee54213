"""Which places are whose, computed by each robot from the same facts: no leader, no lock, no vote.

Facts are what all robots publish: where each is, when it was last heard, its charge, and the share
it took. A robot that was not heard for a while, charges for far longer than planned, or is taken
out has no share. One that charges as planned keeps it: its charge is a stop of its tour. The others
follow the plan for their number (`partition.fleet_plan`). Those whose share is part of the plan
keep it; the rest get the free ones, the nearest first. The groups in force are kept as long as the
best plan is not clearly better, so that a change of the fleet moves few robots.

Robots whose facts differ for a while may take the same share: then places get double visits, never
none. When the facts agree again, the robot whose name comes first keeps it.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, tzinfo

import numpy as np
from numpy.typing import NDArray

from patrol_policy.fleet.docks import ChargeNeed, DockSlot, dock_slots
from patrol_policy.fleet.partition import FleetPlan, Group, balanced, fleet_plan, group_of
from patrol_policy.graph import PatrolGraph

ANCHORS = 64
"""How many places of a group are tried as the one where its first robot begins."""

CATCH_UP = 1.02
"""How much longer than planned a charge in passing may be, as a factor."""


class FleetError(ValueError):
    """The facts of a fleet do not fit together; the message names the robot."""


@dataclass(frozen=True)
class PartitionCell:
    """The cell of the partitioned map that a robot patrols, as it publishes it.

    Attributes:
        tour: The stops of its group, in order.
        stop: The stop it drives to or stands at.
    """

    tour: tuple[str, ...]
    stop: str


@dataclass(frozen=True)
class FleetRobot:
    """What all know of a robot. Times are seconds since 1970.

    Attributes:
        name: Its name.
        place: The place it entered last.
        since: When it entered it, or when a charge there began or ended.
        heard_at: When it was last heard.
        heard_since: Since when it is heard without a gap.
        cell: The share it published last; None once it is back from an outage, so that it begins
            in the largest gap.
        charging_until: When it has charged enough; None: it does not charge.
        dock: The dock it stands at or drives to in order to charge.
        runs_until: When its battery reaches its reserve; None: it need not charge.
        charge_seconds: How long a charge would take now.
        taken_out: Whether a person took it out of the patrol.
    """

    name: str
    place: str
    since: float = 0.0
    heard_at: float = 0.0
    heard_since: float = -math.inf
    cell: PartitionCell | None = None
    charging_until: float | None = None
    dock: str | None = None
    runs_until: float | None = None
    charge_seconds: float = 0.0
    taken_out: bool = False


@dataclass(frozen=True, eq=False)
class FleetOutlook:
    """What one robot of a fleet knows of all when it decides.

    Attributes:
        name: Its own name.
        robots: What is known of each, itself included.
        graph: The map with the same times for all, whatever each robot has learned of its legs.
        settings: How the work is shared.
    """

    name: str
    robots: Sequence[FleetRobot]
    graph: PatrolGraph
    settings: FleetSettings = field(default_factory=lambda: FleetSettings())

    def choose(self, now: float, visited_at: Mapping[str, float]) -> FleetChoice:
        """Choose by the facts of the robots that doors join with this one.

        Raises:
            FleetError: The facts do not fit together.
        """
        near, settings = self._of_this_map()
        return choose(self.graph, near, self.name, now, settings, visited_at)

    def waits(self, now: float) -> dict[str, float]:
        """Return the seconds from robot to robot in each place, once all are equally spaced.

        Charging as planned is part of it. A place that no robot has is missing.

        Raises:
            FleetError: The facts do not fit together.
        """
        near, settings = self._of_this_map()
        plan = assign(self.graph, near, now, settings).plan
        found: dict[str, float] = {}
        for group in plan.groups if plan is not None else ():
            for stop in group.stops:
                found[stop] = min(group.wait, found.get(stop, math.inf))
        return found

    def sharing(self, now: float) -> frozenset[str]:
        """Return the names of the robots that have a share."""
        near, settings = self._of_this_map()
        return frozenset(assign(self.graph, near, now, settings).cells)

    def team(self, now: float) -> int:
        """Return how many robots have a share."""
        return len(self.sharing(now))

    def _of_this_map(self) -> tuple[list[FleetRobot], FleetSettings]:
        """Return the robots that doors join with this one, and the docks that are on the map."""
        stops = self.graph.index.keys()
        docks = tuple(dock for dock in self.settings.docks if dock in stops)
        near = []
        for robot in self.robots:
            if robot.place not in stops:
                continue
            # A share of another map counts for nothing.
            if robot.cell is not None and not set(robot.cell.tour) <= stops:
                robot = replace(robot, cell=None)
            near.append(robot if robot.dock in docks else replace(robot, dock=None))
        return near, replace(self.settings, docks=docks)


@dataclass(frozen=True)
class FleetSettings:
    """How the work is shared.

    Attributes:
        silent_after: Seconds without a word after which a robot has no share.
        back_after: Seconds that a robot must be heard without a gap to get a share again.
        worth_changing: By which part the best plan's wait must be shorter than that of the groups
            in force for these to be given up.
        docks: Where robots of the fleet charge: all know the same.
        own_docks: Where this robot may charge; None: at each of them.
        charge_ratio: Seconds of charging for each second of patrol. The groups do not depend on it,
            only the distances that a robot keeps.
        least_charge: A charge in passing that is shorter is left out, seconds.
        timezone: Of the times in reasons.
    """

    silent_after: float = 10.0
    back_after: float = 5.0
    worth_changing: float = 0.1
    docks: tuple[str, ...] = ()
    own_docks: tuple[str, ...] | None = None
    charge_ratio: float = 0.0
    least_charge: float = 5.0
    timezone: tzinfo = UTC

    @property
    def usable_docks(self) -> tuple[str, ...]:
        """Where this robot may charge."""
        own = self.own_docks
        return self.docks if own is None else tuple(dock for dock in self.docks if dock in own)


@dataclass(frozen=True)
class Assignment:
    """Who does what.

    Attributes:
        plan: The groups and how many robots each has; None: no robot has a share.
        cells: The share of each robot that has one.
        absent: Why each other robot has none, in words.
    """

    plan: FleetPlan | None
    cells: Mapping[str, PartitionCell]
    absent: Mapping[str, str]


@dataclass(frozen=True)
class FleetChoice:
    """What a robot does next.

    Attributes:
        place: The stop to drive to, or a dock; its own place when it stays.
        until: It stays where it is until then, seconds since 1970; None: it drives.
        cell: The share to publish; None: it has none.
        reason: Why, in words.
        slot: The time at the dock that it drives to.
        mine: The stops of its group that are its own: from the one it drives to up to the one that
            the next robot on the tour drives to.
        overstays: Whether it has been in its place for longer than the equal distance.
    """

    place: str
    until: float | None
    cell: PartitionCell | None
    reason: str
    slot: DockSlot | None = field(default=None)
    mine: frozenset[str] = frozenset()
    overstays: bool = False


def assign(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    now: float,
    settings: FleetSettings | None = None,
    visited_at: Mapping[str, float] | None = None,
) -> Assignment:
    """PartitionCell the places of a map among robots.

    Args:
        graph: The map, connected.
        robots: All that is known, the silent ones too; their order does not matter.
        now: Seconds since 1970.
        settings: How.
        visited_at: The last visit of each place, seconds since 1970; where it is given, robots of a
            new group begin where that ends the longest wait soonest.

    Raises:
        FleetError: A name stands twice, or a robot is at an unknown place.
    """
    settings = settings or FleetSettings()
    robots = sorted(robots, key=lambda robot: robot.name)
    for robot, after in itertools.pairwise(robots):
        if robot.name == after.name:
            raise FleetError(f'{robot.name} stands twice among the robots')
    absent = {}
    for robot in robots:
        if robot.place not in graph.index:
            raise FleetError(f'{robot.name} is at {robot.place}, which is not a place of the map')
        if robot.cell is not None and robot.cell.stop not in robot.cell.tour:
            raise FleetError(
                f'{robot.name} drives to {robot.cell.stop}, expected a stop of its own tour'
            )
        if (reason := _absence(graph, robots, robot, now, settings)) is not None:
            absent[robot.name] = reason
    present = [robot for robot in robots if robot.name not in absent]
    if not present:
        return Assignment(None, {}, absent)
    plan = _plan_in_force(graph, robots, present, settings)
    return Assignment(plan, _shares(graph, plan, present, now, visited_at or {}), absent)


def choose(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    name: str,
    now: float,
    settings: FleetSettings | None = None,
    visited_at: Mapping[str, float] | None = None,
) -> FleetChoice:
    """Return what one robot does next, once it has arrived and explored where it is.

    It charges whenever its tour passes a free dock, or when its slot at a dock begins; else it goes
    on along its group's tour, or stays while the robot ahead is nearer than the equal distance.

    Raises:
        FleetError: The robot is not among the robots, or their facts do not fit together.
    """
    settings = settings or FleetSettings()
    me = next((robot for robot in robots if robot.name == name), None)
    if me is None:
        known = ', '.join(sorted(robot.name for robot in robots))
        raise FleetError(f'{name} is not in the fleet, expected one of {known or "no robot"}')
    # Who decides does not charge.
    me = replace(me, charging_until=None, dock=None)
    robots = [me if robot.name == name else robot for robot in robots]
    assignment = assign(graph, robots, now, settings, visited_at)
    cell = assignment.cells.get(name)
    if cell is None:
        reason = f'no place is mine: {assignment.absent[name]}'
        return FleetChoice(me.place, now + settings.back_after, None, reason)
    group = _group(assignment, cell)
    reached = cell.stop == me.place
    onward = _next(group, cell.stop) if reached else cell
    mine = _mine(group, assignment, robots, me, onward)
    slot, leave = _slot(graph, robots, me, onward.stop, now, settings, assignment)
    if _charges_in_passing(group, robots, me, reached, settings):
        # A stop of known length: what is missing beyond it is made up for little by little.
        end = now + min(me.charge_seconds, CATCH_UP * _planned_charge(group, me.place, settings))
        reason = (
            f'charging in passing at {me.place} until {_clock(end, settings)}: a stop of the tour '
            f'of {group.length:.0f} s'
        )
        # It goes on to the next stop afterwards, whatever it still lacks.
        after = onward if reached else cell
        return FleetChoice(me.place, None, after, reason, DockSlot(name, me.place, now, end))
    if slot is not None and now >= leave:
        late = f', {slot.late:.0f} s late: the docks are too few' if slot.late > 1.0 else ''
        reason = (
            f'charging at {slot.dock} from {_clock(slot.begin, settings)} '
            f'to {_clock(slot.end, settings)}: that is my slot{late}'
        )
        return FleetChoice(slot.dock, None, onward, reason, slot)
    if reached and (hold := _hold(graph, group, assignment, robots, me, now)) is not None:
        seconds, ahead = min(hold[0], leave - now), hold[1]
        reason = (
            f'staying in {me.place} for {seconds:.0f} s: {ahead} is less than {group.wait:.0f} s '
            f'ahead on the tour of {group.length:.0f} s'
        )
        return FleetChoice(
            me.place,
            now + seconds,
            cell,
            reason,
            mine=mine,
            overstays=now - me.since > group.wait,
        )
    # Where the only stop is its own it looks anew soon: the fleet may have changed.
    look = min(leave, now + settings.back_after) if onward.stop == me.place else None
    reason = _why(onward.stop, name, group, assignment, robots)
    return FleetChoice(onward.stop, look, onward, reason, mine=mine)


def _charges_in_passing(
    group: Group,
    robots: Sequence[FleetRobot],
    me: FleetRobot,
    reached: bool,
    settings: FleetSettings,
) -> bool:
    """Return whether a robot is at a free dock of its tour and a charge is worth its while.

    Where the dock is not the stop that it drives to it only makes up for charges that it missed.
    """
    planned = _planned_charge(group, me.place, settings)
    least = max(min(settings.least_charge, planned), 0.0 if reached else 1.5 * planned)
    has_been = not reached and me.place in group.position and me.cell == _next(group, me.place)
    return (
        planned > 0.0
        and not has_been
        and me.runs_until is not None
        and me.charge_seconds >= least
        and not any(other.dock == me.place for other in robots if other.name != me.name)
    )


def _planned_charge(group: Group, place: str, settings: FleetSettings) -> float:
    """Return the seconds that this robot charges in passing at a place.

    Where its group charges at docks that are not its own, it takes the charge of a whole round at
    the first of its own on the tour.
    """
    own = [stop for stop in group.stops if stop in settings.usable_docks]
    if place not in own:
        return 0.0
    if any(group.charge_at(stop) for stop in own):
        return group.charge_at(place)
    return sum(group.charges) if place == own[0] else 0.0


def _absence(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    robot: FleetRobot,
    now: float,
    settings: FleetSettings,
) -> str | None:
    """Return why a robot has no share; None: it has one."""
    if robot.taken_out:
        return f'{robot.name} is taken out'
    if now - robot.heard_at > settings.silent_after:
        return f'{robot.name} was last heard at {_clock(robot.heard_at, settings)}'
    if robot.charging_until is not None and _charges_too_long(graph, robots, robot, now, settings):
        return f'{robot.name} is charging until {_clock(robot.charging_until, settings)}'
    if now - robot.heard_since < settings.back_after:
        return f'{robot.name} is heard again only since {_clock(robot.heard_since, settings)}'
    return None


def _charges_too_long(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    robot: FleetRobot,
    now: float,
    settings: FleetSettings,
) -> bool:
    """Return whether a robot that charges leaves its group alone for so long that the others had
    better share its places.

    That is longer than planned by more than the time from one robot of the group to the next.
    """
    cell, until = robot.cell, robot.charging_until
    if cell is None or until is None or not set(cell.tour) <= graph.index.keys():
        return True
    team = sum(other.cell is not None and other.cell.tour == cell.tour for other in robots)
    group = group_of(graph, cell.tour, team).charging(settings.docks, settings.charge_ratio)
    planned = max(group.charges, default=0.0)
    return max(until, now) - robot.since > planned + group.wait


def _clock(seconds: float, settings: FleetSettings) -> str:
    return f'{datetime.fromtimestamp(seconds, settings.timezone):%H:%M}'


def _plan_in_force(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    present: Sequence[FleetRobot],
    settings: FleetSettings,
) -> FleetPlan:
    """Return the published groups with the robots that are there, or the best plan if clearly
    better; with the charges where robots charge.
    """
    charge = any(
        robot.runs_until is not None or robot.charging_until is not None for robot in present
    )
    docks = settings.docks if charge else ()
    plan = _groups_in_force(graph, robots, present, docks, settings)
    groups = (group.charging(docks, settings.charge_ratio) for group in plan.groups)
    return FleetPlan(tuple(groups))


def _groups_in_force(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    present: Sequence[FleetRobot],
    docks: Sequence[str],
    settings: FleetSettings,
) -> FleetPlan:
    best = fleet_plan(graph, len(present), docks=docks)
    # The absent robots' groups belong to the groups in force until others have taken them over.
    for some in (present, robots):
        tours = sorted({robot.cell.tour for robot in some if robot.cell is not None})
        times = Counter(stop for tour in tours for stop in tour)
        if times.keys() != graph.index.keys():
            continue
        # Only a dock is a stop of several tours, and each tour has one.
        if any(count > 1 and stop not in docks for stop, count in times.items()):
            continue
        if docks and any(set(tour).isdisjoint(docks) for tour in tours):
            continue
        kept = balanced([group_of(graph, tour) for tour in tours], len(present))
        if kept is None or best.wait < kept.wait * (1.0 - settings.worth_changing):
            break
        return kept
    return best


def _shares(
    graph: PatrolGraph,
    plan: FleetPlan,
    present: Sequence[FleetRobot],
    now: float,
    visited_at: Mapping[str, float],
) -> dict[str, PartitionCell]:
    """Keep the shares that are part of the plan, give the free ones to the rest."""
    number_of = {group.stops: number for number, group in enumerate(plan.groups)}
    members: list[list[FleetRobot]] = [[] for _ in plan.groups]
    cells: dict[str, PartitionCell] = {}
    rest = []
    for robot in present:
        number = None if robot.cell is None else number_of.get(robot.cell.tour)
        full = number is not None and len(members[number]) >= plan.groups[number].robots
        if robot.cell is None or number is None or full:
            rest.append(robot)
        else:
            members[number].append(robot)
            cells[robot.name] = robot.cell
    if not rest:
        return cells
    free = [
        PartitionCell(group.stops, group.stops[stop])
        for group, kept in zip(plan.groups, members, strict=True)
        for stop in _free_stops(graph, group, kept, rest, now, visited_at)
    ]
    from scipy.optimize import linear_sum_assignment

    begins = [graph.index[cell.stop] for cell in free]
    seconds = graph.distances[np.ix_([graph.index[robot.place] for robot in rest], begins)]
    # Squares: one long way is worse than two of half its length.
    for robot_number, cell_number in zip(*linear_sum_assignment(seconds**2), strict=True):
        cells[rest[robot_number].name] = free[cell_number]
    return cells


def _free_stops(
    graph: PatrolGraph,
    group: Group,
    kept: Sequence[FleetRobot],
    rest: Sequence[FleetRobot],
    now: float,
    visited_at: Mapping[str, float],
) -> list[int]:
    """Return the stops at which robots that are new in a group begin, at equal distances from those
    that keep their share.
    """
    free = group.robots - len(kept)
    if not free:
        return []
    offsets, length = group.offsets, max(group.length, math.ulp(1.0))
    slots = np.arange(group.robots) * group.wait
    if not kept:
        anchor = _anchor(graph, group, rest, now, visited_at)
        return [_stop_after(offsets, length, anchor + slot) for slot in slots]
    taken = [float(offsets[group.position[robot.cell.stop]]) for robot in kept if robot.cell]
    slots = taken[0] + slots
    left = list(range(1, group.robots))
    for offset in taken[1:]:
        left.remove(min(left, key=lambda slot: _apart(float(slots[slot]), offset, length)))
    return [_stop_after(offsets, length, float(slots[slot])) for slot in left]


def _anchor(
    graph: PatrolGraph,
    group: Group,
    rest: Sequence[FleetRobot],
    now: float,
    visited_at: Mapping[str, float],
) -> float:
    """Return the offset at which a group's first robot begins: where that ends the longest wait
    soonest.
    """
    rows = [graph.index[stop] for stop in group.stops]
    from_rest = np.ix_([graph.index[robot.place] for robot in rest], rows)
    near = graph.distances[from_rest].min(axis=0)
    idle = np.array([max(0.0, now - visited_at.get(stop, now)) for stop in group.stops])
    tried = np.unique(np.linspace(0, len(rows) - 1, min(ANCHORS, len(rows))).astype(int))
    wait = max(group.wait, math.ulp(1.0))

    def worst(number: int) -> float:
        behind = (group.offsets - group.offsets[number]) % max(group.length, math.ulp(1.0)) % wait
        return float(near[number] + (idle + behind).max())

    return float(group.offsets[min(tried, key=lambda number: (worst(int(number)), number))])


def _stop_after(offsets: NDArray[np.float64], length: float, at: float) -> int:
    """Return the first stop at or after an offset."""
    return int(np.searchsorted(offsets, at % length - 1e-9)) % len(offsets)


def _apart(first: float, second: float, length: float) -> float:
    around = (first - second) % length
    return min(around, length - around)


def _group(assignment: Assignment, cell: PartitionCell) -> Group:
    assert assignment.plan is not None
    return next(group for group in assignment.plan.groups if group.stops == cell.tour)


def _next(group: Group, stop: str) -> PartitionCell:
    return PartitionCell(group.stops, group.stops[(group.position[stop] + 1) % len(group.stops)])


def _mine(
    group: Group,
    assignment: Assignment,
    robots: Sequence[FleetRobot],
    me: FleetRobot,
    onward: PartitionCell,
) -> frozenset[str]:
    """Return the stops that no other robot of the group comes to before this one.

    Of robots with the same stop it is that of the one that is in its place the longest. That
    changes with each that arrives: what both leave to the other `decision` finds overdue.
    """
    since = {robot.name: (robot.since, robot.name) for robot in robots}
    here, length = group.position[onward.stop], len(group.stops)
    gap = length
    for name, cell in assignment.cells.items():
        if name == me.name or cell.tour != group.stops:
            continue
        ahead = (group.position[cell.stop] - here) % length
        if ahead == 0 and since[me.name] < since[name]:
            continue
        gap = min(gap, ahead)
    return frozenset(group.stops[(here + step) % length] for step in range(gap))


def _hold(
    graph: PatrolGraph,
    group: Group,
    assignment: Assignment,
    robots: Sequence[FleetRobot],
    me: FleetRobot,
    now: float,
) -> tuple[float, str] | None:
    """Return the seconds to stay so that the robot ahead gets as far as it should, and its name.

    None: it is far enough. Of robots at the same stop the one that came first is ahead.
    """
    if group.robots < 2 or not group.length:
        return None
    here = float(group.offsets[group.position[me.place]]) + group.charge_at(me.place)
    nearest, ahead = math.inf, ''
    for robot in robots:
        theirs = assignment.cells.get(robot.name)
        if robot.name == me.name or theirs is None or theirs.tour != group.stops:
            continue
        number = group.position[theirs.stop]
        at = float(group.offsets[number])
        if robot.place == theirs.stop:
            at += group.charge_at(theirs.stop)
        else:
            leg = group.leg_seconds[number - 1]
            left = float(graph.distances[graph.index[robot.place], graph.index[theirs.stop]])
            left -= max(0.0, now - robot.since)
            if robot.charging_until is not None:
                # The rest of its charge, and the way, of which it has gone nothing.
                leg += group.charge_at(robot.place) if robot.place in group.position else 0.0
                left += max(0.0, robot.charging_until - robot.since)
            # One that is farther than a leg is not on the tour yet: it will begin at its stop.
            at -= max(0.0, left) if left <= leg else 0.0
        gap = (at - here) % group.length
        if min(gap, group.length - gap) < 1e-6:
            if (me.since, me.name) < (robot.since, robot.name):
                continue
            gap = 0.0
        if gap < nearest:
            nearest, ahead = gap, robot.name
    seconds = group.wait - nearest
    # Less than a hundredth is not worth a stop.
    return (seconds, ahead) if math.isfinite(nearest) and seconds > 0.01 * group.wait else None


def _slot(
    graph: PatrolGraph,
    robots: Sequence[FleetRobot],
    me: FleetRobot,
    stop: str,
    now: float,
    settings: FleetSettings,
    assignment: Assignment,
) -> tuple[DockSlot | None, float]:
    """Return the robot's slot at a dock, and when it must leave if it visits ``stop`` before.

    None and never: it need not charge.
    """
    docks = settings.usable_docks
    if me.runs_until is None or not docks:
        return None, math.inf
    needs = []
    for robot in sorted(robots, key=lambda robot: robot.name):
        if robot.dock is not None and robot.charging_until is not None:
            if robot.dock not in docks:
                continue
            left = max(0.0, robot.charging_until - now)
            needs.append(ChargeNeed(robot.name, now, left, robot.dock))
        elif robot.runs_until is not None and robot.name in assignment.cells:
            needs.append(ChargeNeed(robot.name, robot.runs_until, robot.charge_seconds))
    slot = dock_slots(needs, docks, now)[me.name]
    here, there, dock = (graph.index[place] for place in (me.place, stop, slot.dock))
    # One whose slot comes late waits at the dock.
    begin = min(slot.begin, me.runs_until)
    return slot, begin - float(graph.distances[here, there] + graph.distances[there, dock])


def _why(
    stop: str,
    name: str,
    group: Group,
    assignment: Assignment,
    robots: Sequence[FleetRobot],
) -> str:
    """Return why a stop is a robot's, in words."""
    for robot in robots:
        if (
            robot.cell is not None
            and robot.name in assignment.absent
            and stop in robot.cell.tour
            and robot.name != name
        ):
            return f'{stop} is mine: {assignment.absent[robot.name]}'
    others = sorted(other for other, cell in assignment.cells.items() if cell.tour == group.stops)
    others.remove(name)
    with_whom = ' and '.join(others) if len(others) < 4 else f'{len(others)} others'
    shared = f', shared with {with_whom}' if others else ''
    return (
        f'{stop} is mine: it is the next of {len(group.stops)} places on a tour of '
        f'{group.length:.0f} s{shared}, each every {group.wait:.0f} s'
    )
