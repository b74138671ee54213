"""A state machine engine with SMACH's interface and without ROS.

``import surveillance_fsm as smach`` runs machines written for SMACH. The rest is in modules of
their own: `verify`, `export`, `history`, `testing`, and `surveillance_fsm.ros` for ROS 2.
"""

from __future__ import annotations

from surveillance_fsm.clock import Clock, Interrupt, WallClock
from surveillance_fsm.concurrence import Concurrence
from surveillance_fsm.container import Container
from surveillance_fsm.exceptions import (
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    MachineFileError,
    MissingKeyError,
    SmachError,
)
from surveillance_fsm.execution import is_shutdown, set_shutdown_check
from surveillance_fsm.log import (
    logdebug,
    logerr,
    loginfo,
    logwarn,
    reset_loggers,
    set_loggers,
)
from surveillance_fsm.nodes import RESUME, LimitOptions
from surveillance_fsm.state import (
    CBInterface,
    CBState,
    State,
    cb_interface,
    has_smach_interface,
)
from surveillance_fsm.state_machine import Iterator, Sequence, StateMachine
from surveillance_fsm.userdata import Remapper, UserData

__all__ = [
    'RESUME',
    'CBInterface',
    'CBState',
    'Clock',
    'Concurrence',
    'Container',
    'Interrupt',
    'InvalidConstructionError',
    'InvalidStateError',
    'InvalidTransitionError',
    'InvalidUserCodeError',
    'Iterator',
    'LimitOptions',
    'MachineFileError',
    'MissingKeyError',
    'Remapper',
    'Sequence',
    'SmachError',
    'State',
    'StateMachine',
    'UserData',
    'WallClock',
    'cb_interface',
    'has_smach_interface',
    'is_shutdown',
    'logdebug',
    'logerr',
    'loginfo',
    'logwarn',
    'reset_loggers',
    'set_loggers',
    'set_shutdown_check',
]
