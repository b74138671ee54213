"""The shutdown check: a machine asks it between two states and ends with None when it is true."""

from __future__ import annotations

from collections.abc import Callable

check: Callable[[], bool] | None = None
"""What was set with `set_shutdown_check`."""


def is_shutdown() -> bool:
    """Whether the check set with `set_shutdown_check` says that the program is shutting down."""
    return check is not None and bool(check())


def set_shutdown_check(cb: Callable[[], bool] | None) -> None:
    """Set the function that tells of a shutdown, for example ``lambda: not rclpy.ok()``.

    Args:
        cb: Called between any two states; None takes the check away.
    """
    global check
    check = cb
