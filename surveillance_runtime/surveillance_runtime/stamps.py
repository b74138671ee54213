"""Time stamps of messages as numbers."""

from __future__ import annotations

from builtin_interfaces.msg import Duration, Time


def seconds_of(stamp: Time | Duration) -> float:
    """Return a stamp as seconds since the clock's start, or a duration in seconds."""
    return float(stamp.sec + stamp.nanosec / 1e9)
