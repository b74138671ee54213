"""A state machine engine with SMACH's interface and without ROS.

``import surveillance_fsm as smach`` runs machines written for SMACH.
"""

from __future__ import annotations

from surveillance_fsm.concurrence import Concurrence
from surveillance_fsm.container import Container
from surveillance_fsm.engine import RESUME
from surveillance_fsm.exceptions import (
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    MissingKeyError,
    PreemptIgnoredError,
    SmachError,
)
from surveillance_fsm.interface import CBInterface, cb_interface, has_smach_interface
from surveillance_fsm.iterator import Iterator
from surveillance_fsm.log import (
    logdebug,
    logerr,
    loginfo,
    logwarn,
    reset_loggers,
    set_loggers,
)
from surveillance_fsm.sequence import Sequence
from surveillance_fsm.shutdown import is_shutdown, set_shutdown_check
from surveillance_fsm.state import CBState, State
from surveillance_fsm.state_machine import StateMachine
from surveillance_fsm.user_data import Remapper, UserData
from surveillance_fsm.waiting import Clock, Interrupt, WallClock

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
    'MissingKeyError',
    'PreemptIgnoredError',
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
