"""What a node models and must not forget when its process is killed, in a small file."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path

from surveillance_fsm import Interrupt
from surveillance_runtime.files import FileError, in_one_line, read_json, replace_text
from surveillance_runtime.node import PatrolNode

WRITE_PERIOD = 0.2
"""Least time between two writes, seconds of steady time."""
LARGEST = 10_000
"""More bytes than this are no state of a node."""

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
        self._path = Path(os.path.expanduser(path)) if path else None
        self._state: State | None = None
        self._complaint = ''
        self._news = Interrupt()
        self.found: State = self._read()
        if self._path is not None:
            node.stopping.subscribe(self._news.set)
            node.spawn(self._work, 'state file')

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
        if self._path is not None:
            self._state = state
            self._news.set()

    def _work(self) -> None:
        stopping = self._node.stopping
        written: State | None = None
        while True:
            self._news.wait()
            self._news.clear()
            state = self._state
            if state is not written and state is not None:
                self._write(state)
                written = state
            if stopping.is_set():
                return
            stopping.wait(WRITE_PERIOD)
            if stopping.is_set():
                self._news.set()

    def _write(self, state: State) -> None:
        assert self._path is not None
        try:
            replace_text(self._path, json.dumps(state) + '\n')
        except OSError as error:
            self._complain(f'parameter state_file: {in_one_line(error)}; the state is not kept')
        else:
            self._complaint = ''

    def _read(self) -> State:
        if self._path is None:
            return {}
        try:
            state = read_json(self._path, LARGEST)
            if state is None:
                return {}
        except FileError:
            state = None
        if not isinstance(state, dict):
            self._complain(f'parameter state_file: {self._path} holds no state; it begins anew')
            return {}
        return state

    def _complain(self, text: str) -> None:
        if text != self._complaint:
            self._complaint = text
            self._node.get_logger().warn(text)
