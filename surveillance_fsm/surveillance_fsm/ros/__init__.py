"""States and servers that connect the state machine engine with ROS 2.

They have the names and arguments of SMACH's ROS package, with the node in front. None of them
blocks an executor and none can hang: each ends in one of its outcomes within its time limits.
"""

from __future__ import annotations

from surveillance_fsm.ros.action_server_wrapper import ActionServerWrapper
from surveillance_fsm.ros.condition_state import ConditionState
from surveillance_fsm.ros.introspection import IntrospectionServer
from surveillance_fsm.ros.monitor_state import MonitorState
from surveillance_fsm.ros.preempt_handler import set_preempt_handler
from surveillance_fsm.ros.service_state import ServiceState
from surveillance_fsm.ros.simple_action_state import SimpleActionState

__all__ = [
    'ActionServerWrapper',
    'ConditionState',
    'IntrospectionServer',
    'MonitorState',
    'ServiceState',
    'SimpleActionState',
    'set_preempt_handler',
]
