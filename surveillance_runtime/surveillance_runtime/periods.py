"""What nodes do periodically, by one timer for each period of a node."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

_Calls = list[tuple[float, Callable[[], object]]]
_CALLS = '_calls_by_period'
"""What a node keeps its calls as. In a table beside the nodes they would keep their node for good:
most are methods of what the node has."""


def every(node: Node, period: float, call: Callable[[], object]) -> None:
    """Have a node call something each period of steady time, with all else that has this period.

    The periods of all nodes of a machine begin together: fewer wakeups than each by itself.

    Args:
        node: The node.
        period: Seconds.
        call: First called after one to two periods, then for as long as the node is there.
    """
    of_node: dict[float, _Calls] = vars(node).setdefault(_CALLS, {})
    first = time.monotonic() + 0.999 * period
    if (calls := of_node.get(period)) is not None:
        calls.append((first, call))
        return
    calls = of_node[period] = [(first, call)]
    nanoseconds, made = round(1e9 * period), list[Timer]()

    def on_period() -> None:
        for timer in made:  # none yet where another thread spins the node and is quick
            if timer.timer_period_ns != nanoseconds:
                timer.timer_period_ns = nanoseconds
                timer.reset()
        now, failed = time.monotonic(), None
        for due, each in tuple(calls):
            try:
                if now >= due:
                    each()
            except Exception as error:  # the others are called all the same
                failed = error
        if failed is not None:
            raise failed

    ahead = max(0.001, period - time.monotonic() % period)
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    made.append(node.create_timer(ahead, on_period, clock=steady))
