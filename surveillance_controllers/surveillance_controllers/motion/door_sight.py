"""Which doors the robot has seen shut on its way: no door tells it in a real building.

Each scan is read door by door (`indoor_watch.doors`). Most of the last readings must agree before a
door is shut, or open again: people stand in doorways. A door that nobody looks at may be open
again, and the robot has to go there to see it. So it counts as shut for as long again as it is
known to have been shut: one that has just been shut is looked at soon, one that stays shut seldom.
Where nothing else can be reached, each one is looked at as soon as one that has just been shut.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from floor_plans.shapes import Segment
from indoor_watch.doors import DoorState, read_door
from lidar_navigation.geometry import Pose, Scan, composed

READ_WITHIN = 6.0
"""Doors are read from here on, metres: farther away too few rays meet them."""
PERIOD = 0.2
"""Time between two readings of a door, seconds."""
READINGS, AGREEING = 8, 7
"""So many of the last readings must agree."""
AT_ONCE = 10.0
"""Readings that are older than this say nothing of now, seconds."""
COUNTS_FOR = 30.0, 120.0
"""A shut door counts for at least and at most this long after it was seen so last, seconds."""
_SURE = 0.8
"""A reading that is less likely than this says nothing."""


@dataclass(eq=False)
class _SeenDoor:
    segment: Segment
    readings: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=READINGS))
    shut_since: float | None = None
    shut_at: float = -math.inf

    def is_shut(self, now: float) -> bool:
        """Tell whether it counts as shut."""
        if self.shut_since is None:
            return False
        least, most = COUNTS_FOR
        return 0.0 <= now - self.shut_at <= min(max(self.shut_at - self.shut_since, least), most)


class DoorSight:
    """Reads doors; owned by whoever calls it, one thread.

    Args:
        doors: Their openings by name, map frame, metres.

    Attributes:
        nothing_else: Nothing else can be reached: what was not seen shut for the least time may be
            open, so that the robot goes there and looks.
    """

    def __init__(self, doors: Mapping[str, Segment]) -> None:
        self._doors = {name: _SeenDoor(segment) for name, segment in doors.items()}
        self._read_at = -math.inf
        self.nothing_else = False
        self._shut: frozenset[str] = frozenset()

    @property
    def doors(self) -> frozenset[str]:
        """The names of all doors."""
        return frozenset(self._doors)

    @property
    def shut(self) -> frozenset[str]:
        """The doors that count as shut."""
        return self._shut

    def take_doors(self, doors: Mapping[str, Segment]) -> None:
        """Take where the doors are now; what is known of those that stay is kept."""
        before = self._doors
        self._doors = {
            name: before[name]
            if name in before and before[name].segment == segment
            else _SeenDoor(segment)
            for name, segment in doors.items()
        }
        self._shut &= self._doors.keys()

    def see(self, pose: Pose, scan: Scan, now: float) -> bool:
        """Take a scan made at a pose that is to be trusted; tell whether `shut` changed.

        Args:
            pose: Where the robot is, map frame.
            scan: What it sees.
            now: The scan's time, seconds.
        """
        if 0.0 <= now - self._read_at < PERIOD:
            return False
        self._read_at = now
        lidar = composed(pose, scan.mount)
        turned = scan.angles + lidar[2]
        ranges = np.minimum(scan.ranges, scan.range_max)
        ends = np.stack(
            [lidar[0] + ranges * np.cos(turned), lidar[1] + ranges * np.sin(turned)], axis=1
        )
        for door in self._doors.values():
            x1, y1, x2, y2 = door.segment
            if math.dist(((x1 + x2) / 2, (y1 + y2) / 2), lidar[:2]) <= READ_WITHIN:
                self._read(door, lidar, ends, now)
            if self.nothing_else and now - door.shut_at > COUNTS_FOR[0]:
                # For good: on the way there the robot no longer waits for help.
                door.shut_since = None
        before, self._shut = (
            self._shut,
            frozenset(name for name, door in self._doors.items() if door.is_shut(now)),
        )
        return self._shut != before

    @staticmethod
    def _read(door: _SeenDoor, lidar: Pose, ends: np.ndarray, now: float) -> None:
        reading = read_door(door.segment, lidar[:2], ends)
        if reading is None or reading.confidence < _SURE:
            return
        is_shut = reading.state is DoorState.CLOSED
        if door.readings and not 0.0 <= now - door.readings[-1][0] <= AT_ONCE:
            door.readings.clear()
        door.readings.append((now, is_shut))
        if sum(shut == is_shut for _, shut in door.readings) >= AGREEING:
            if not is_shut:
                door.shut_since = None
                return
            door.shut_at = now
            if door.shut_since is None:
                door.shut_since = now
