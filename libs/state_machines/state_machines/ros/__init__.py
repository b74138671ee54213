"""States and servers that connect the state machine engine with ROS 2.

They have the names and arguments of SMACH's ROS package, with the node in front, and work with any
``rclpy`` node. None of them blocks an executor and none can hang: each ends in one of its outcomes
within its time limits.

All needs ``rclpy`` alone.
"""

from __future__ import annotations

from state_machines.exceptions import (
    CallError,
    CallInterruptedError,
    CallTimeoutError,
    UnavailableError,
)
from state_machines.ros.action_server import (
    ActionServerWrapper,
    GoalAbortedError,
    GoalRun,
    GoalServer,
)
from state_machines.ros.calls import GoalCaller, GoalEnd, ServiceCaller, await_ready
from state_machines.ros.states import (
    ConditionState,
    MonitorState,
    RosState,
    ServiceState,
    SimpleActionState,
)
from state_machines.ros.waiting import ClockWait, set_preempt_handler, work_aside

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
