"""Whether the robot stands in a dock, as far as what was done and what is seen tells.

A docking server forgets at each start what it did, and answers `not in the dock` of a robot that it
did not dock itself (opennav_docking 1.3: the flag `isDocked` of its plugin needs the dock's pose
from an earlier goal). So neither its answer nor this node's memory is enough alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from lidar_navigation.geometry import Pose, angle_between

NEAR_YAW = 0.6
"""A robot that stands in a dock points as the dock does, within this angle, radians."""


class Contact(StrEnum):
    """What is known of it."""

    DOCKED = 'docked'
    FREE = 'free'
    DOUBTFUL = 'doubtful'
    """It may stand in a dock: it has to undock before it drives."""


@dataclass
class DockMemory:
    """What the docking server did last.

    Attributes:
        told: True: it docked the robot; False: it undocked it; None: neither holds.
    """

    told: bool | None = None

    def look(self, charging: bool | None, is_near: bool | None) -> Contact:
        """Take what is seen; return whether the robot is in a dock.

        Args:
            charging: Whether its battery is charged now; None: nobody says.
            is_near: Whether it stands where a dock is; None: its pose is not known.
        """
        if charging:
            # A cable far from each dock: the server is to say that there is none.
            return Contact.DOUBTFUL if is_near is False else Contact.DOCKED
        if is_near is False:
            # Wherever it is, a person may have pushed it there: no dock is.
            self.told = False
            return Contact.FREE
        if self.told is None:
            return Contact.DOUBTFUL
        return Contact.DOCKED if self.told else Contact.FREE


def stands_at(pose: Pose, dock: Pose, reach: float) -> bool:
    """Tell whether a robot stands as it does in a dock, either way round.

    Args:
        pose: Of the robot.
        dock: Of a robot in the dock.
        reach: How far it may be off, metres.
    """
    off = math.dist(pose[:2], dock[:2])
    turned = abs(angle_between(dock[2], pose[2]))
    # Some robots back into their dock, while its pose says how the dock points.
    return off <= reach and min(turned, math.pi - turned) <= NEAR_YAW


NO_RETRY = (901, 902)
"""DOCK_NOT_IN_DB, DOCK_NOT_VALID: the same request gets the same answer."""
NOT_MOVED_IN = (901, 902, 903)
"""With these the robot did not come into the dock: FAILED_TO_STAGE as well."""
WHAT_HELPS = {
    901: "name the dock as the docking server's parameter `docks` does (stations.ROOM.dock)",
    902: "name dock.dock_type as the docking server's parameter `dock_plugins` does",
    903: 'clear the way to the dock',
    904: 'clear the view to the dock',
    905: 'free the robot, or bring it into the dock',
    906: "clean the dock's contacts, or push the robot home",
}
"""What a person can do, by the error codes of Jazzy's DockRobot and UndockRobot."""
