"""Whether what a planner and a motion controller answered is what was asked for."""

from __future__ import annotations

import itertools
import math

from surveillance_behaviour.peers.ports import PeerError, Point


def path_length(path: list[Point]) -> float:
    """Length of a path, metres."""
    return sum(math.dist(start, end) for start, end in itertools.pairwise(path))


def check_path(path: list[Point], goal: Point | None, tolerance: float, peer: str) -> None:
    """Refuses a path that leads nowhere, or elsewhere.

    Raises:
        PeerError: It is empty, not finite, or ends too far from ``goal``.
    """
    if not path:
        raise PeerError(peer, 'the path has no points')
    if not all(math.isfinite(value) for point in path for value in point):
        raise PeerError(peer, 'the path has a point that is not finite')
    if goal is not None and math.dist(path[-1][:2], goal[:2]) > tolerance:
        raise PeerError(
            peer,
            f'the path ends {math.dist(path[-1][:2], goal[:2]):.2f} m from the goal, expected '
            f'at most {tolerance:g} m',
        )


def check_arrival(end: Point, goal: Point, tolerance: float, peer: str) -> None:
    """Refuses an arrival that is none.

    Raises:
        PeerError: The robot stopped too far from ``goal``.
    """
    away = math.dist(end[:2], goal[:2])
    if not away <= tolerance:
        raise PeerError(
            peer, f'the robot stopped {away:.2f} m short, expected at most {tolerance:g} m'
        )
