"""What the launcher has to tell of its processes: restarts in the log, incidents to `alarm`.

The launcher is no node of ROS, so that nothing in the middleware can stop it. It hands its
incidents to the node `alarm` as lines on that process's input, and calls the user's command itself
where `alarm` does not live.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from strict_files.files import FileError
from surveillance_runtime.event_log import EventLog, record_in
from surveillance_runtime.incidents import Incidents, IncidentUpdate

LAUNCHER = 'launch'
QUIET_AGAIN = 600.0
"""A node that died again and again, and has not for this long, is well again, seconds."""


class NodeDeaths:
    """Tells of processes that die; in one thread.

    Args:
        send: Hands a line to the node `alarm`; returns whether that lives.
        call: Calls a person with one line where it does not.
        folder: Of the run, with a folder for each robot of a fleet; None: nothing is kept.
        now: Steady time, seconds.
    """

    def __init__(
        self,
        send: Callable[[str], bool],
        call: Callable[[str], object],
        folder: Path | None = None,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._send, self._call, self._folder, self._now = send, call, folder, now
        self._incidents = Incidents(self._tell, LAUNCHER)
        self._dying: dict[tuple[str, ...], float] = {}

    def trouble(self, nodes: Sequence[str], text: str) -> None:
        """Take that a process dies again and again.

        Args:
            nodes: What it holds.
            text: The line that says so.
        """
        name = ', '.join(nodes)
        self._dying[tuple(nodes)] = self._now()
        action = f'read the last lines of {name} in the log of the run'
        self._incidents.begin(('node', name), text, action=action)

    def restarted(self, name: str, why: str) -> None:
        """Take that a node was started again.

        Args:
            name: As the log calls it.
            why: What ended its process before.
        """
        for nodes in self._dying:
            if name in nodes:
                self._dying[nodes] = self._now()
        self._write(name, why)
        # `alarm` itself may be new, and knows of none.
        for each in self._incidents.updates():
            self._send(each.to_line())

    def advance(self, now: float) -> None:
        """End the incidents of processes that live again.

        Args:
            now: Steady time, seconds.
        """
        for nodes, at in list(self._dying.items()):
            if now - at >= QUIET_AGAIN:
                del self._dying[nodes]
                name = ', '.join(nodes)
                self._incidents.end(('node', name), f'{name} lives')

    def _tell(self, told: IncidentUpdate) -> None:
        if not self._send(told.to_line()) and not told.over:
            self._call(told.text)

    def _write(self, name: str, why: str) -> None:
        if self._folder is None:
            return
        robot, _, node = name.rpartition('/')
        # A full disk is told of by others.
        with contextlib.suppress(FileError), EventLog(record_in(self._folder / robot)) as log:
            log.write('restart', node=node, why=why)
