"""What a way to move the robot offers, and how a motion ends: in a place, or not as it should."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np

from lidar_navigation.geometry import Points, Pose
from state_machines.ros import GoalRun
from surveillance_controllers.manual import commands
from surveillance_controllers.motion.holding import Hold


class BaseMotion(Protocol):
    """What drives the robot: `NavigationMotion`, `Nav2Motion`, either with docking."""

    def follow(self, path: Points, run: GoalRun, report: Callable[[Points], None]) -> Points:
        """Drive along a path; return where the robot is then, or raise `MotionFailedError`.

        It may report where the robot is as often as it likes.
        """

    def place_reached(self, goal: Points, end: Points) -> str:
        """Return the place the robot is in; raises `MotionFailedError` when it is not the
        goal's.
        """

    def look_around(self, run: GoalRun) -> None:
        """Look around in the place."""

    @property
    def map_frame(self) -> str:
        """The name of the map's frame."""

    @property
    def pose(self) -> Pose | None:
        """Where the robot is; None: that is not known."""

    @property
    def hold(self) -> Hold:
        """Whether the robot is to stand."""


class MotionFailedError(Exception):
    """The robot did not get where it should; the text says why.

    Args:
        reason: One line.
        end: Where the robot is, shape (3,), metres; None when that is not known.
    """

    def __init__(self, reason: str, end: Points | None) -> None:
        super().__init__(reason)
        self.end = end


def expect_place(place: str | None, wanted: str | None, end: Points) -> str:
    """Return the place in which a motion ended.

    Raises:
        MotionFailedError: It is not the wanted one, or not known.
    """
    if place is None or place != wanted:
        raise MotionFailedError(f'the robot stopped in {place}: expected {wanted}', end)
    return place


def nearest_place(places: Mapping[str, Points], point: Points) -> tuple[str | None, float]:
    """Return the place whose point is nearest, and its distance in metres.

    Args:
        places: A point in each place, shape (3,), metres.
        point: Where the robot is, shape (3,), metres.

    Returns:
        None and infinity when there is no place.
    """
    gaps = {name: float(np.linalg.norm(point - at)) for name, at in places.items()}
    nearest = min(gaps, key=lambda name: gaps[name], default=None)
    return nearest, math.inf if nearest is None else gaps[nearest]


def place_reached(places: Mapping[str, Points], end: Points, reach: float) -> str:
    """Return the place in which a motion ended.

    Args:
        places: A point in each place, shape (3,), metres.
        end: Where the robot is, shape (3,), metres.
        reach: A place further away than this is not taken, metres.

    Raises:
        MotionFailedError: No place is within reach.
    """
    nearest, gap = nearest_place(places, end)
    if nearest is None or gap > reach:
        raise MotionFailedError(
            f'the robot stopped at {commands.point(end)}: expected a place within {reach:g} m'
            + (f', {nearest} is {gap:.2f} m away' if nearest else ''),
            end,
        )
    return nearest
