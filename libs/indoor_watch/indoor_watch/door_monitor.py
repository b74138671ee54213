"""Which doors are open, closed or ajar: what most of the last readings of a visit agree on."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from indoor_watch.doors import Segment, read_door
from indoor_watch.events import ELSEWHERE
from indoor_watch.floor import is_leaf
from indoor_watch.observations import Kind, Observation
from indoor_watch.visit import SEEN_AGAIN, LidarSweep, Pictured, Rooms, Visit

DOOR_RANGE = 6.0
"""Doors are read from here on, metres: farther away too few beams meet them."""
READINGS = 5
"""A door's state is that of most of so many readings, of which `AGREEING` must agree."""
AGREEING = 4
"""So one sweep through which somebody walks changes nothing."""
BESIDE = 0.3
"""A point so far from a door is in the place on its side, metres."""


@dataclass
class _Door:
    segment: Segment
    told: str = ''
    told_at: float = -math.inf
    told_from: tuple[float, float] | None = None
    place: str = ''

    @property
    def middle(self) -> tuple[float, float]:
        x1, y1, x2, y2 = self.segment
        return (x1 + x2) / 2, (y1 + y2) / 2


class DoorMonitor:
    """Reads doors; owned by whoever calls it, one thread.

    Args:
        doors: The doors' openings by name, map frame, metres.
    """

    def __init__(self, doors: Mapping[str, Segment]) -> None:
        self._doors = {name: _Door(segment) for name, segment in doors.items()}

    def use_map(self) -> None:
        """Take that there is another map, on which a door may close another place."""
        for door in self._doors.values():
            door.place = ''

    def take(self, sweep: LidarSweep, visit: Visit) -> list[Pictured]:
        """Return what a sweep tells of the doors near it."""
        found = []
        for name, door in self._doors.items():
            if math.dist(door.middle, sweep.sensor) > DOOR_RANGE:
                continue
            reading = read_door(door.segment, sweep.sensor, sweep.ends)
            if reading is not None:
                readings = visit.readings.setdefault(name, deque(maxlen=READINGS))
                readings.append((str(reading.state), reading.confidence))
                seen = self._judged(name, door, visit, sweep)
                found += [] if seen is None else [Pictured(seen)]
        return found

    def _judged(
        self, name: str, door: _Door, visit: Visit, sweep: LidarSweep
    ) -> Observation | None:
        stamp, sensor = sweep.stamp, sweep.sensor
        readings = visit.readings[name]
        states = [state for state, _ in readings]
        state = max(set(states), key=states.count)
        if states.count(state) < AGREEING:
            return None
        visit.doors[name] = state
        is_new = state != door.told or abs(stamp - door.told_at) >= SEEN_AGAIN
        # A second look from elsewhere is told once, of readings of its own.
        is_second = door.told_from is not None and math.dist(door.told_from, sensor) >= ELSEWHERE
        if not is_new and not is_second:
            return None
        sure = float(np.mean([sure for each, sure in readings if each == state]))
        readings.clear()
        if is_new:
            door.told_at = stamp
        door.told, door.told_from = state, sensor if is_new else None
        place = visit.place
        if visit.rooms is not None:
            door.place = door.place or _smaller_side(door.segment, visit.rooms)
            place = door.place or place
        return Observation(Kind.DOOR, state, place, name, door.middle, sure, stamp)

    def near(self, point: tuple[float, float], visit: Visit) -> dict[str, str]:
        """Return the states of the doors near a point, of those that this visit has seen."""
        return {
            name: state
            for name, state in visit.doors.items()
            if math.dist(self._doors[name].middle, point) <= DOOR_RANGE
        }

    def may_be_leaf(self, points: NDArray[np.float64]) -> bool:
        """Tell whether a thing may be a door's leaf, which is the door's own matter."""
        for door in self._doors.values():
            width = math.dist(door.segment[:2], door.segment[2:])
            for hinge in (door.segment[:2], door.segment[2:]):
                if is_leaf(points, hinge, width):
                    return True
        return False


def _smaller_side(segment: Segment, rooms: Rooms) -> str:
    """Return the smaller of the two places that a door joins, which is the one it closes."""
    x1, y1, x2, y2 = segment
    scale = BESIDE / max(math.dist(segment[:2], segment[2:]), 1e-9)
    across = (y1 - y2) * scale, (x2 - x1) * scale
    sizes = {}
    for sign in (1.0, -1.0):
        side = (x1 + x2) / 2 + sign * across[0], (y1 + y2) / 2 + sign * across[1]
        place = rooms.place_at(side)
        floor = None if place is None else rooms.cells_of(place)
        if place is not None and floor is not None:
            sizes[place] = int(floor.sum())
    return min(sizes, key=lambda each: sizes[each], default='')
