"""Motion without a robot: along a path at constant speed, in a given time, to a given end."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from surveillance_controllers.geometry import polyline
from surveillance_controllers.geometry.polyline import Points


class Pace(Protocol):
    """Time as a goal's run gives it: `surveillance_runtime.action_server.GoalRun` is one."""

    def now(self) -> float:
        """The time in seconds."""

    def sleep(self, seconds: float) -> bool:
        """Lets time pass; False when the motion shall end at once."""


def glide(
    path: Points,
    seconds: float,
    end: Points,
    pace: Pace,
    on_position: Callable[[Points], None],
    period: float,
) -> Points:
    """Goes along a path in a given time.

    Args:
        path: At least one point, shape (n, 3), metres.
        seconds: How long it takes.
        end: Where the motion ends, shape (3,): the path's last point, or near it.
        pace: Passes the time.
        on_position: Told the position at the start, every `period` seconds, and at the end.
        period: Seconds between two reports.

    Returns:
        `end`, or where the motion was when it was ended early.
    """
    total = polyline.length(path)
    began = pace.now()
    while True:
        elapsed = pace.now() - began
        if elapsed >= seconds:
            break
        position = polyline.point_at(path, total * elapsed / seconds)
        on_position(position)
        if not pace.sleep(min(period, seconds - elapsed)):
            return position
    on_position(end)
    return np.asarray(end, dtype=float)
