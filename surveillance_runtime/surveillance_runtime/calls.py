"""Service calls and action goals that always end, as `surveillance_fsm.ros.calls` has them."""

from surveillance_fsm.ros.calls import (
    CallError,
    CallInterruptedError,
    CallTimeoutError,
    GoalCaller,
    GoalEnd,
    ServiceCaller,
    UnavailableError,
    await_ready,
    block_on,
)

__all__ = [
    'CallError',
    'CallInterruptedError',
    'CallTimeoutError',
    'GoalCaller',
    'GoalEnd',
    'ServiceCaller',
    'UnavailableError',
    'await_ready',
    'block_on',
]
