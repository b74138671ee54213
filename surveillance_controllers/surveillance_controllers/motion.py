"""What all ways to move have in common: how they fail."""

from __future__ import annotations

from surveillance_controllers.polyline import Points


class MotionFailed(Exception):
    """The robot did not get where it should; the text says why.

    Args:
        reason: One line.
        end: Where the robot is, shape (3,), metres; None when that is not known.
    """

    def __init__(self, reason: str, end: Points | None) -> None:
        super().__init__(reason)
        self.end = end
