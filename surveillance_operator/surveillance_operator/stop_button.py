"""The Stop: the robot stands, whoever commands it, until a person releases it."""

from __future__ import annotations

from std_srvs.srv import SetBool, Trigger

from state_machines.exceptions import CallError, UnavailableError
from state_machines.ros import ServiceCaller
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.run_parameters import BEHAVIOUR_NODE

TIMEOUT = 2.0
"""Seconds of steady time that an answer may take."""
DISCOVERY = 0.5
"""Seconds for the collision monitor to be found; a robot without one has its mission paused."""


class StopButton:
    """Stops the robot, and releases it.

    Args:
        node: The node that calls; an executor must spin it.
        robot: The robot of a fleet; empty: that of the node's namespace.
    """

    def __init__(self, node: PatrolNode, robot: str = '') -> None:
        machine = name_for(robot, f'{BEHAVIOUR_NODE}/fsm')
        self._stop = ServiceCaller(node, SetBool, name_for(robot, 'stop'))
        self._machine = {
            True: ServiceCaller(node, Trigger, f'{machine}/pause'),
            False: ServiceCaller(node, Trigger, f'{machine}/resume'),
        }

    def press(self, stop: bool) -> str:
        """Stop the robot, or release it; return what was done.

        A robot without a collision monitor has no base that could be held: its state machine is
        paused, which lets it stand as well.

        Raises:
            CallError: Nobody answers, or it was refused.
        """
        try:
            answer = self._stop.call(SetBool.Request(data=stop), TIMEOUT, discovery=DISCOVERY)
            if not answer.success:
                raise CallError(answer.message or 'refused')
            return str(answer.message)
        except UnavailableError:
            self._machine[stop].call(Trigger.Request(), TIMEOUT, discovery=DISCOVERY)
            done = 'paused' if stop else 'going on'
            return f'there is no collision_monitor: the state machine is {done} instead'
