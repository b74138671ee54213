"""The shutdown check: a machine asks it between two states and ends with None when it is true."""

from __future__ import annotations

from collections.abc import Callable

_check: Callable[[], bool] | None = None


def is_shutdown() -> bool:
    """Whether the check set with `set_shutdown_check` says that the program is shutting down."""
    return _check is not None and bool(_check())


def set_shutdown_check(cb: Callable[[], bool] | None) -> None:
    """Set the function that tells of a shutdown, for example ``lambda: not rclpy.ok()``.

    Args:
        cb: Called between any two states; None takes the check away.
    """
    global _check
    _check = cb


def shutdown_checked() -> bool:
    """Whether there is a check at all, so that machines without one skip the call."""
    return _check is not None
