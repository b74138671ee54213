"""States and servers that connect the state machine engine with ROS 2.

They have the names and arguments of SMACH's ROS package, with the node in front, and work with any
``rclpy`` node. None of them blocks an executor and none can hang: each ends in one of its outcomes
within its time limits.

All needs ``rclpy`` alone, but for the introspection, whose messages are in
``surveillance_interfaces``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from surveillance_fsm.exceptions import (
    CallError,
    CallInterruptedError,
    CallTimeoutError,
    UnavailableError,
)
from surveillance_fsm.ros.action_server import (
    ActionServerWrapper,
    GoalAbortedError,
    GoalRun,
    GoalServer,
)
from surveillance_fsm.ros.calls import GoalCaller, GoalEnd, ServiceCaller, await_ready
from surveillance_fsm.ros.states import (
    ConditionState,
    MonitorState,
    RosState,
    ServiceState,
    SimpleActionState,
)
from surveillance_fsm.ros.waiting import ClockWait, set_preempt_handler, work_aside

if TYPE_CHECKING:
    from surveillance_fsm.ros.introspection import IntrospectionClient, IntrospectionServer

__all__ = [
    'ActionServerWrapper',
    'CallError',
    'CallInterruptedError',
    'CallTimeoutError',
    'ClockWait',
    'ConditionState',
    'GoalAbortedError',
    'GoalCaller',
    'GoalEnd',
    'GoalRun',
    'GoalServer',
    'IntrospectionClient',
    'IntrospectionServer',
    'MonitorState',
    'RosState',
    'ServiceCaller',
    'ServiceState',
    'SimpleActionState',
    'UnavailableError',
    'await_ready',
    'set_preempt_handler',
    'work_aside',
]


def __getattr__(name: str) -> Any:
    if name in ('IntrospectionClient', 'IntrospectionServer'):
        # Its messages are in a package that not everybody has.
        from surveillance_fsm.ros import introspection

        return getattr(introspection, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
