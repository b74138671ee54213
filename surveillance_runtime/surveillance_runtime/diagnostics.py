"""The health of nodes on `/diagnostics`: each node's own status, once a second of real time.

A node notes in its `Health` what is wrong with it and figures that matter. `DiagnosticsThread`
publishes the health of all nodes of a process. It does not need the executor, so an executor that
hangs is reported too. Who listens takes a node that has been silent for `STALE_AFTER` as stale.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

if TYPE_CHECKING:
    from surveillance_runtime.node import PatrolNode

TOPIC = '/diagnostics'
PERIOD = 1.0
"""Seconds of real time between two messages of a node."""
STALE_AFTER = 5.0
"""Seconds without a message after which a node's last status says nothing any more."""
RECENT = 10.0
"""For how long a lost message or a restart is a warning, seconds."""
LATE = 0.5
"""Seconds by which an executor is late that are worth a warning."""
HANGS = 3.0
"""Seconds by which an executor is late that are an error."""
RESTARTS = 'LAUNCH_RESTARTS'
"""The environment variable with how often the launcher has started the process again."""
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR

Finding = tuple[bytes, str]
"""A level and what it is about, in words."""


class Health:
    """What is wrong with a node at present, and its figures; safe from any thread.

    Attributes:
        lost: How many messages were lost to exceptions of callbacks.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._lost_at = -RECENT
        self._lost_by = ''
        self._findings: dict[str, Finding] = {}
        self._figures: dict[str, str] = {}
        self._lock = threading.Lock()

    def warn(self, subject: str, text: str) -> None:
        """Note a warning on a subject, in place of what was noted on it before."""
        self._note(subject, (WARN, text))

    def error(self, subject: str, text: str) -> None:
        """Note that the node cannot do its work until somebody helps."""
        self._note(subject, (ERROR, text))

    def clear(self, subject: str) -> None:
        """Take back what was noted on a subject."""
        with self._lock:
            self._findings.pop(subject, None)

    def figure(self, name: str, value: object) -> None:
        """Note a figure that is shown with the status."""
        with self._lock:
            self._figures[name] = str(value)

    def lose_message(self, why: str) -> None:
        """Count a message that was lost to an exception; it is a warning for a while."""
        with self._lock:
            self.lost += 1
            self._lost_at, self._lost_by = time.monotonic(), why

    def findings(self) -> list[Finding]:
        """Return what is wrong now."""
        with self._lock:
            found = list(self._findings.values())
            if time.monotonic() - self._lost_at < RECENT:
                found.append((WARN, f'a message was lost: {self._lost_by}'))
        return found

    def figures(self) -> dict[str, str]:
        """Return the figures that were noted."""
        with self._lock:
            return {**self._figures, 'lost_messages': str(self.lost)}

    def _note(self, subject: str, finding: Finding) -> None:
        with self._lock:
            self._findings[subject] = finding


class DiagnosticsThread:
    """Publishes the health of a process's nodes until it is stopped.

    Args:
        nodes: The nodes.
        lateness: Returns by how many seconds the executor was late at most since it was asked last.
    """

    def __init__(self, nodes: Sequence[PatrolNode], lateness: Callable[[], float]) -> None:
        self._began = time.monotonic()
        self._lateness = lateness
        self._restarts = _restarts()
        self._publishers = [
            (node, node.create_publisher(DiagnosticArray, TOPIC, 10)) for node in nodes
        ]
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name='diagnostics', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Publish once more, where a node has failed, and end."""
        self._ended.set()
        self._thread.join()
        for node, _ in self._publishers:
            if node.failure is not None:
                self._publish()
                return

    def _work(self) -> None:
        while not self._ended.wait(PERIOD):
            self._publish()

    def _publish(self) -> None:
        late = self._lateness()
        figures = {'restarts': str(self._restarts), 'late_ms': f'{1e3 * late:.0f}', **_process()}
        for node, publisher in self._publishers:
            status = DiagnosticStatus(name=_name(node), hardware_id=_robot(node))
            found = [*node.health.findings(), *self._of_process(late)]
            if node.failure is not None:
                found.insert(0, (ERROR, node.failure))
            # Of findings of one level the first one comes first.
            found.sort(key=lambda each: each[0], reverse=True)
            status.level = found[0][0] if found else OK
            status.message = '; '.join(text for _, text in found) or 'up'
            every = {**figures, **node.health.figures()}
            status.values = [KeyValue(key=key, value=value) for key, value in every.items()]
            message = DiagnosticArray(status=[status])
            message.header.stamp = node.get_clock().now().to_msg()
            publisher.publish(message)

    def _of_process(self, late: float) -> list[Finding]:
        found: list[Finding] = []
        if late > LATE:
            level = ERROR if late > HANGS else WARN
            found.append((level, f'callbacks wait for {late:.1f} s'))
        if self._restarts and time.monotonic() - self._began < RECENT:
            found.append((WARN, f'was started again ({self._restarts} times so far)'))
        return found


def _name(node: PatrolNode) -> str:
    return str(node.get_fully_qualified_name()).removeprefix('/')


def _robot(node: PatrolNode) -> str:
    return str(node.get_namespace()).strip('/') or 'surveillance_robot'


def _restarts() -> int:
    given = os.environ.get(RESTARTS, '')
    return int(given) if given.isdecimal() else 0


def _process() -> dict[str, str]:
    """Return what the process uses, where the kernel says so."""
    figures = {'threads': str(threading.active_count())}
    with contextlib.suppress(OSError, ValueError, IndexError):
        with open('/proc/self/statm', encoding='ascii') as file:
            pages = int(file.read().split()[1])
        figures['memory_mb'] = f'{pages * os.sysconf("SC_PAGE_SIZE") / 2**20:.0f}'
        figures['descriptors'] = str(len(os.listdir('/proc/self/fd')))
    return figures
