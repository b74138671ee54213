"""What there is to say of a place: how much there is of it, and how long the ways are."""

from __future__ import annotations

import math

from floor_plans.floor_plan import FloorPlan
from patrol_policy import PatrolGraph


def graph_over_doors(plan: FloorPlan) -> PatrolGraph:
    """Return the graph of a place, each leg as long as the way over the middle of the door, metres.

    Where two doors join the same places, the shorter way counts. A door of which no position is
    known counts as on the straight line.
    """
    place = plan.place
    legs: dict[str, dict[str, float]] = {name: {} for name in place.rooms}
    for name, sides in place.doors.items():
        if len(sides) < 2:
            continue  # the door of the only room
        first, second = sides
        ends = [place.positions[room][:2] for room in sides]
        door = plan.doors.get(name)
        if door is None:
            length = math.dist(*ends)
        else:
            length = sum(math.dist(end, (door.x, door.y)) for end in ends)
        length = min(length, legs[first].get(second, math.inf))
        legs[first][second] = legs[second][first] = length
    return PatrolGraph(legs)


def facts(plan: FloorPlan) -> str:
    """Return what there is to say about a place in one line."""
    parts = [counted(len(plan.place.rooms), 'place'), counted(len(plan.place.doors), 'door')]
    zones = len(plan.zones.keep_out) + len(plan.zones.slow)
    if zones:
        parts.append(counted(zones, 'zone'))
    if plan.markers:
        parts.append(counted(len(plan.markers), 'marker'))
    tour = graph_over_doors(plan).tour
    if tour.exact:
        parts.append(f'shortest tour {tour.length:.1f} m')
    else:
        parts.append(f'tour {tour.length:.1f} m (none is shorter than {tour.bound:.1f} m)')
    return ' · '.join(parts)


def counted(number: int, word: str) -> str:
    """Return a number of things in words: '1 door', '2 doors'."""
    return f'{number} {word}{"" if number == 1 else "s"}'
