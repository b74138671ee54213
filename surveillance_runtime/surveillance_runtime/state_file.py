"""What a node models and must not forget when its process is killed, in a small file."""

from __future__ import annotations

import math
from collections.abc import Mapping

from state_machines import Interrupt
from strict_files.files import KeptFile
from surveillance_runtime.node import PatrolNode

WRITE_PERIOD = 0.2
"""Least time between two writes, seconds of steady time."""

State = Mapping[str, float | str]


class StateFile:
    """A node's state, written by a thread of its own: `save` waits for no disk.

    Args:
        node: The node; the last state is written when it stops.
        path: The file; empty: nothing is kept.

    Attributes:
        found: The state that an earlier process left; empty when there is none.
    """

    def __init__(self, node: PatrolNode, path: str) -> None:
        self._node = node
        self._file = KeptFile(path, 'starting without it')
        self._state: State = {}
        self._complaint = ''
        self._news = Interrupt()
        self.found: State = {}
        self._complain(self._file.read(self._take))
        if self._file:
            node.stopping.subscribe(self._news.set)
            node.spawn(self._work, 'state file')

    def _take(self, found: State) -> None:
        if not isinstance(found, dict):
            raise TypeError('expected an object')
        self.found = found

    def number(self, name: str) -> float | None:
        """Return a finite number of the state that was found; None when there is none of this
        name.
        """
        value = self.found.get(name)
        if not isinstance(value, int | float) or not math.isfinite(value):
            return None
        return float(value)

    def text(self, name: str) -> str:
        """Return a text of the state that was found; empty when there is none of this name."""
        value = self.found.get(name)
        return value if isinstance(value, str) else ''

    def save(self, state: State) -> None:
        """Have a state written instead of the last one; returns at once."""
        self._state = state
        self._news.set()

    def _work(self) -> None:
        stopping = self._node.stopping
        while True:
            self._news.wait()
            self._news.clear()
            if self._state:
                problem = self._file.write(self._state)
                self._complain(problem and f'{problem}; the state is not kept')
            if stopping.is_set():
                return
            stopping.wait(WRITE_PERIOD)
            if stopping.is_set():
                self._news.set()

    def _complain(self, problem: str) -> None:
        if problem and problem != self._complaint:
            self._node.get_logger().warn(f'parameter state_file: {problem}')
        self._complaint = problem
