"""A state machine engine with SMACH's interface and without ROS.

``import state_machines as smach`` runs machines written for SMACH. Begin with `StateMachine`, or
see it run: ``python -m state_machines.demo``.

Public modules: `ros` (states, action servers and calls for ROS 2), `ros.waiting` (of an executor's
threads), `exceptions` (of calls, too), `verify` (checks before running), `export` (drawings),
`transitions` (told as they happen), `checkpoint` (outlives a kill), `structure` (a machine looked
at), `autonomy` (transitions that ask a person), `clock`, `userdata`, `testing` (fake clock,
scripted outcomes).
"""

from __future__ import annotations

from state_machines.autonomy import Approval, Autonomy, Question
from state_machines.clock import Clock, Interrupt, WallClock
from state_machines.concurrence import Concurrence
from state_machines.container import Container
from state_machines.exceptions import (
    CheckpointError,
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    MissingKeyError,
    SmachError,
)
from state_machines.execution import is_shutdown, set_shutdown_check
from state_machines.log import (
    logdebug,
    logerr,
    loginfo,
    logwarn,
    reset_loggers,
    set_loggers,
)
from state_machines.program import RESUME, LimitOptions
from state_machines.state import (
    CBInterface,
    CBState,
    State,
    cb_interface,
    has_smach_interface,
)
from state_machines.state_machine import Iterator, Sequence, StateMachine
from state_machines.userdata import Remapper, UserData

__all__ = [
    'RESUME',
    'Approval',
    'Autonomy',
    'CBInterface',
    'CBState',
    'CheckpointError',
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
    'MissingKeyError',
    'Question',
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
