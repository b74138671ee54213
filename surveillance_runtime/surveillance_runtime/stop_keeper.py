"""Keeps a stop in its file, off the path of whoever holds the robot.

A disk may hang for minutes. Whoever holds the robot handles its messages meanwhile, and answers
in time that the stop stands and is not known to be kept.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial

from state_machines.ros.waiting import work_aside
from surveillance_runtime.node import PatrolNode
from surveillance_runtime.stop_request import StopFile, StopRequest
from surveillance_runtime.waiting import AwaitedWork

ANSWER_WITHIN = 0.15
"""Seconds of steady time that an answer waits for the disk; who asks waits 0.3 s in all."""
UNANSWERED = f'the disk has not answered in {ANSWER_WITHIN} s'


class StopKeeper:
    """Writes and removes a stop's files in order, on a thread of its own.

    Args:
        node: The node that holds the robot. Services and topics whose callbacks await this need a
            callback group that admits others meanwhile.
        files: The stop is kept in the first and removed from all.
    """

    def __init__(self, node: PatrolNode, *files: StopFile) -> None:
        self._node = node
        self._files = files
        self._disk = AwaitedWork(node, 1)
        node.stopping.subscribe(self._disk.stop)

    async def keep(self, request: StopRequest) -> str:
        """Keep a stop; return what it is not known to outlive, and why, or ''."""
        problem = await self._in_time(partial(self._files[0].keep, request), 'the stop is kept')
        return f'not for sure over a restart: {problem}' if problem == UNANSWERED else problem

    async def forget(self) -> str:
        """Remove it; return why the next start may find it, or ''."""
        return await self._in_time(
            lambda: next(filter(None, [each.forget() for each in self._files]), ''),
            'the next start finds the robot stopped:',
        )

    async def _in_time(self, work: Callable[[], str], otherwise: str) -> str:
        done = threading.Event()
        problem = UNANSWERED

        def run() -> None:
            nonlocal problem
            problem = work()
            done.set()
            if problem:
                self._node.get_logger().error(f'{otherwise} {problem}')

        self._disk.put(run)
        await work_aside(self._node, lambda: done.wait(ANSWER_WITHIN), 'stop waits for the disk')
        return problem
