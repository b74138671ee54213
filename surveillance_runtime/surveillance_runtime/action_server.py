"""Action servers whose newest goal wins, as `surveillance_fsm.ros.action_server` has them."""

from surveillance_fsm.ros.action_server import Execute, GoalAbortedError, GoalRun, GoalServer

__all__ = ['Execute', 'GoalAbortedError', 'GoalRun', 'GoalServer']
