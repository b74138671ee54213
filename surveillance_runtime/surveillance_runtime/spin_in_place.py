"""A path that leads nowhere: it has the robot turn on the spot.

`follow_path` drives along a path, and has no word for a turn. A path from where the robot stands
that is no longer than `SHORT` says where its front shall point at the end: along the path.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

SHORT = 0.02
"""A path of two points or more that is no longer has the robot turn, metres."""
Point = Sequence[float]


def spin_path(here: Point, bearing: float) -> list[tuple[float, float, float]]:
    """Return the path that has the robot turn.

    Args:
        here: Where it stands: x, y in metres, map frame; a further value is left out.
        bearing: Where its front shall point, map frame, rad.
    """
    x, y = float(here[0]), float(here[1])
    step = SHORT / 2
    return [(x, y, 0.0), (x + step * math.cos(bearing), y + step * math.sin(bearing), 0.0)]


def bearing_of(path: Sequence[Point]) -> float | None:
    """Return where a path has the robot point its front, rad; None: it is one to drive along."""
    if len(path) < 2:
        return None
    dx, dy = path[-1][0] - path[0][0], path[-1][1] - path[0][1]
    length = sum(math.dist(one[:2], other[:2]) for one, other in itertools.pairwise(path))
    return math.atan2(dy, dx) if (dx or dy) and length <= SHORT else None
