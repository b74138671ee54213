"""What an operator may have the robots of a fleet do: one of them, or all at once.

A robot that is alone has no name: it is a fleet of one.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

from state_machines.exceptions import CallError
from strict_files.suggestions import nearest
from surveillance_operator.mission_actions import MissionActions
from surveillance_runtime.node import PatrolNode

ALL = 'all'
"""Stands for every robot."""

Do = Callable[[MissionActions], str]
"""Has one robot do something; returns what came of it."""

WORDS: Mapping[str, tuple[str, Do]] = {
    'pause': ('no further step of the mission begins', lambda a: a.machine('pause')),
    'go': ('the mission goes on', lambda a: a.machine('resume')),
    'stop': ('the robot stands until it is released', lambda a: a.stop(True)),
    'release': ('it may drive again', lambda a: a.stop(False)),
    'out': ('it leaves the patrol; the others take its places', lambda a: a.take_out(True)),
    'in': ('it is given a share again', lambda a: a.take_out(False)),
}
"""What one robot or all may be told in a word: what it means, and how it is done."""


class FleetActions:
    """The actions of each robot.

    Args:
        node: The node that calls; an executor must spin it.
        robots: Returns the names of the robots that there are.
        timeout: Deadline of each call, seconds.
    """

    def __init__(
        self, node: PatrolNode, robots: Callable[[], Sequence[str]], timeout: float = 5.0
    ) -> None:
        self._node = node
        self._robots = robots
        self._timeout = timeout
        self._lock = threading.Lock()
        self._shared = MissionActions(node, timeout)
        self._of: dict[str, MissionActions] = {'': self._shared}

    @property
    def shared(self) -> MissionActions:
        """The actions on what the robots share; of a robot that is alone, all of its actions."""
        return self._shared

    def of(self, robot: str) -> MissionActions:
        """Return the actions of a robot; the earlier, the sooner its services are found.

        Raises:
            ValueError: There is no such robot.
        """
        with self._lock:
            if robot not in self._of:
                if robot not in (known := self._robots()):
                    raise ValueError(f'no robot {robot!r}: expected {nearest(robot, known)}')
                self._of[robot] = MissionActions(
                    self._node, self._timeout, robot=robot, shared=self._shared
                )
            return self._of[robot]

    def carry_out(self, robot: str, do: Do) -> str:
        """Have a robot do something, or all of them at once; return what came of it.

        Args:
            robot: Its name, or `ALL`.
            do: What.

        Raises:
            ValueError: There is no such robot, or it cannot be done.
            CallError: A robot did not do it; the text says what became of each.
        """
        names = tuple(self._robots())
        if robot != ALL:
            return do(self.of(robot))
        if names == ('',):
            return do(self._shared)
        outcomes = self.outcomes(names, do)
        text = '; '.join(f'{name}: {said}' for name, (_, said) in outcomes.items())
        if not all(done for done, _ in outcomes.values()):
            raise CallError(text)
        return text

    def outcomes(self, robots: Sequence[str], do: Do) -> dict[str, tuple[bool, str]]:
        """Have robots do something at once, so that one that does not answer delays nobody.

        Returns:
            By name, whether it was done, and what came of it.
        """

        def attempt(robot: str) -> tuple[bool, str]:
            try:
                return True, do(self.of(robot))
            except (ValueError, CallError) as error:
                return False, str(error)

        with ThreadPoolExecutor(len(robots) or 1) as pool:
            return dict(zip(robots, pool.map(attempt, robots), strict=True))
