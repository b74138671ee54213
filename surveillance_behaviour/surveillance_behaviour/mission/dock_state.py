"""Whether the robot stands at a station where it can charge, and whether its drive ends at one.

A recharge room may have its station elsewhere than at the room's point. A drive to charge, to rest
or at a person's wish ends at the station, any other one at the point.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from surveillance_behaviour.ports import Point

SAME_POINT = 0.2
"""A station within this distance of its room's point is at it, metres."""


@dataclass
class DockState:
    """Whether it is docked.

    Attributes:
        is_docked: Whether it came to where it stands as a drive to a station does.
        to_station: Whether the next drive to a recharge room ends at its station.
    """

    # Where it starts in a recharge room, it starts at the station.
    is_docked: bool = True
    to_station: bool = False
    _will_dock: bool = True

    def leaves_for(self, point: Point, station: Point | None, *, is_recharge_room: bool) -> bool:
        """Note where a drive is to end; return whether that is the station.

        Args:
            point: The room's point.
            station: The room's station; None: it has none, or the map knows of none.
            is_recharge_room: Whether the robot can charge there.
        """
        self._will_dock = False
        if not is_recharge_room:
            return False
        if station is None:
            self._will_dock = True
            return False
        near = math.dist(point[:2], station[:2]) <= SAME_POINT
        self._will_dock = self.to_station or near
        return self.to_station

    def arrived(self) -> None:
        """Note that the drive has ended as it was to."""
        self.is_docked = self._will_dock

    def strayed(self) -> None:
        """Note that the robot stands elsewhere than a drive was to end."""
        self.is_docked = False
