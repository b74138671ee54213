"""The Stop: the robot stands, whoever commands it, until a person releases it.

A press is a wish that stands (`stop_request`). It goes two ways: to the collision monitor, which
lets nothing through to the base, and to whoever drives, who commands nothing. It is told again
until one of them has taken it, and that one tells the other.
"""

from __future__ import annotations

import threading

from rclpy.clock import Clock, ClockType
from std_srvs.srv import SetBool, Trigger

from state_machines.exceptions import CallError, UnavailableError
from state_machines.ros import ServiceCaller
from surveillance_interfaces.msg import StopRequest
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.node_table import name_for
from surveillance_runtime.run_parameters import BEHAVIOUR_NODE
from surveillance_runtime.stop_request import TOPIC

QUICK, TIMEOUT = 0.3, 2.0
"""Seconds of steady time that the first answer may take before the second way is gone, too, and
that any answer may take."""
_UNCONFIRMED = 'collision_monitor has not confirmed it yet, and is asked again'
REPEAT = 0.25
"""Seconds of steady time after which a wish that nobody has confirmed is told again."""


class StopButton:
    """Stops the robot, and releases it.

    Args:
        node: The node that calls; an executor must spin it.
        robot: The robot of a fleet; empty: that of the node's namespace.
        owner: Who presses, as people read it; empty: the node.
    """

    def __init__(self, node: PatrolNode, robot: str = '', owner: str = '') -> None:
        machine = name_for(robot, f'{BEHAVIOUR_NODE}/fsm')
        self._wish = StopRequest(owner=owner or node.get_name())
        self._requests = node.create_publisher(StopRequest, name_for(robot, TOPIC), 10)
        self._monitor = ServiceCaller(node, SetBool, name_for(robot, 'stop'))
        self._drive = ServiceCaller(node, SetBool, name_for(robot, 'motion/stop'))
        self._machine = {
            True: ServiceCaller(node, Trigger, f'{machine}/pause'),
            False: ServiceCaller(node, Trigger, f'{machine}/resume'),
        }
        self._standing = threading.Event()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(REPEAT, self._repeat, clock=steady, autostart=False)

    def press(self, stop: bool) -> str:
        """Stop the robot, or release it; return what was done. It waits for answers.

        Raises:
            CallError: Nobody confirms it, or it was refused. A stop is told again all the same.
        """
        return self._press_stop() if stop else self._release()

    def _press_stop(self) -> str:
        self._standing.set()
        self._requests.publish(self._wish)
        self._timer.reset()
        problems: list[str] = []
        for ask in (
            lambda: self._ask(self._monitor, True, QUICK),
            lambda: f'{self._ask(self._drive, True, TIMEOUT)}: {_UNCONFIRMED}',
            lambda: self._ask(self._monitor, True, TIMEOUT),
            lambda: self._ask_machine(True),
        ):
            try:
                said = ask()
            except CallError as error:
                problems.append(str(error))
            else:
                self._standing.clear()
                return said
        raise CallError(
            f'nobody confirms it ({"; ".join(dict.fromkeys(problems))}); it is asked again until '
            'somebody hears it, or until it is released here'
        )

    def _release(self) -> str:
        self._standing.clear()
        try:
            return self._ask(self._monitor, False, TIMEOUT)
        except UnavailableError as error:
            problem = str(error)
        try:
            said = self._ask(self._drive, False, TIMEOUT)
        except UnavailableError:
            return self._ask_machine(False)
        return (
            f'{said}, as far as who drives it knows; whether collision_monitor holds it is not '
            f'known: {problem}'
        )

    def _ask(self, caller: ServiceCaller, stop: bool, timeout: float) -> str:
        answer = caller.call(SetBool.Request(data=stop), timeout, discovery=min(timeout, 0.5))
        if not answer.success:
            raise CallError(answer.message or 'refused')
        return str(answer.message)

    def _ask_machine(self, stop: bool) -> str:
        self._machine[stop].call(Trigger.Request(), TIMEOUT, discovery=0.5)
        done = 'paused' if stop else 'going on'
        return f'there is no collision_monitor: the state machine is {done} instead'

    def _repeat(self) -> None:
        if self._standing.is_set():
            self._requests.publish(self._wish)
        else:
            self._timer.cancel()
