"""What a process tells of itself: heartbeats to the launcher, its nodes' health on `/diagnostics`.

A node notes in its `Health` what is wrong with it, and the figures that it shows.
`DiagnosticsThread` publishes the health of all nodes of a process once a second of real time. It
does not need the executor, so an executor that hangs is reported too. Who listens takes a node that
has been silent for `STALE_AFTER` as stale.
"""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType

from surveillance_runtime.free_memory import give_back
from surveillance_runtime.health import ERROR, OK, RECENT, WARN, Finding
from surveillance_runtime.launch_protocol import (
    AGE,
    BEAT,
    DONE,
    FINISHED,
    HEARTBEAT,
    LAUNCH,
    RESTARTS,
    SLEPT,
    launch_of_process,
)
from surveillance_runtime.node import PatrolNode

TOPIC = '/diagnostics'
PERIOD = 1.0
"""Seconds of real time between two messages of a process."""
STALE_AFTER = 5.0
"""Seconds without a message after which a node's last status says nothing any more."""
LATE = 0.5
"""Seconds by which an executor is late that are worth a warning."""
HANGS = 3.0
"""Seconds by which an executor is late that are an error."""
FIRST_RETURN, RETURN_PERIOD = 10, 60
"""After how many messages freed memory is given back: most of it is of the start."""
BEAT_PERIOD = 0.25
"""Seconds of real time between two heartbeats."""
SLEPT_AFTER = 18.0
"""If no thread ran for so many seconds, this process says that it slept, as on a frozen machine. An
executor that is late alone says nothing: DDS has threads of its own.

After 20 s DDS forgets a silent peer. Of two that were frozen together sometimes only one forgets
the other, and then they do not find each other any more (Fast DDS 155, 457)."""


class Heartbeat:
    """Notes that the executor goes round, and tells the launcher where it asked to be told.

    `take_lateness` is to be called once a second by a thread that does not need the executor.

    Args:
        nodes: The nodes of the process; a timer of the first one beats.
        now: Steady time, seconds.
    """

    def __init__(
        self, nodes: Sequence[PatrolNode], now: Callable[[], float] = time.monotonic
    ) -> None:
        self._now = now
        given = os.environ.pop(HEARTBEAT, None)
        self._pipe = int(given) if given is not None else None
        if self._pipe is not None:
            os.set_blocking(self._pipe, False)
        self._last = self._asked = now()
        self._late = 0.0
        nodes[0].create_timer(
            BEAT_PERIOD,
            self._beat,
            callback_group=ReentrantCallbackGroup(),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    def _beat(self) -> None:
        now = self._now()
        self._late = max(self._late, now - self._last - BEAT_PERIOD)
        self._last = now
        self._write(BEAT)

    def take_lateness(self) -> float:
        """Return by how much a beat came late at most since this was asked last, seconds."""
        now = self._now()
        if now - self._asked > SLEPT_AFTER:
            self._write(SLEPT)
        self._asked = now
        late, self._late = self._late, 0.0
        return max(0.0, late, now - self._last - BEAT_PERIOD)

    def say_finished(self) -> None:
        """Say that the process ends on purpose, and is not to be started again."""
        self._write(FINISHED)

    def say_done(self) -> None:
        """Say that the nodes' work has ended: what follows may be cut off."""
        self._write(DONE)

    def _write(self, word: bytes) -> None:
        if self._pipe is not None:
            with contextlib.suppress(OSError):  # the launcher is gone, or has not read for long
                os.write(self._pipe, word)


class DiagnosticsThread:
    """Publishes the health of a process's nodes until it is stopped; gives freed memory back.

    Args:
        nodes: The nodes.
        lateness: Returns by how many seconds the executor was late at most since it was asked last.
    """

    def __init__(self, nodes: Sequence[PatrolNode], lateness: Callable[[], float]) -> None:
        self._began = time.monotonic()
        self._lateness = lateness
        self._restarts = _restarts()
        self._nodes = nodes
        # One message for all: each costs every listening process several wakeups.
        self._publisher = nodes[0].create_publisher(DiagnosticArray, TOPIC, 10)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work, name='diagnostics', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Publish once more, where a node has failed, and end."""
        self._ended.set()
        self._thread.join()
        if any(node.failure is not None for node in self._nodes):
            self._publish()

    def _work(self) -> None:
        rounds = 0
        while not self._ended.wait(PERIOD):
            self._publish()
            rounds += 1
            if rounds % RETURN_PERIOD == FIRST_RETURN:
                give_back()

    def _publish(self) -> None:
        late = self._lateness()
        launch, age = launch_of_process()
        figures = {
            'restarts': str(self._restarts),
            'late_ms': f'{1e3 * late:.0f}',
            **_process(),
            LAUNCH: launch,
            AGE: f'{age:.1f}',
        }
        message = DiagnosticArray()
        for node in self._nodes:
            name = node.get_fully_qualified_name().removeprefix('/')
            robot = node.get_namespace().strip('/') or 'surveillance_robot'
            status = DiagnosticStatus(name=name, hardware_id=robot)
            found = [*node.health.findings(), *self._of_process(late)]
            if node.failure is not None:
                found.insert(0, (ERROR, node.failure))
            # Of findings of one level the first one comes first.
            found.sort(key=lambda each: each[0], reverse=True)
            status.level = found[0][0] if found else OK
            status.message = '; '.join(text for _, text in found) or 'up'
            every = {**figures, **node.health.figures()}
            status.values = [KeyValue(key=key, value=value) for key, value in every.items()]
            message.status.append(status)
        message.header.stamp = self._nodes[0].get_clock().now().to_msg()
        self._publisher.publish(message)

    def _of_process(self, late: float) -> list[Finding]:
        found: list[Finding] = []
        if late > LATE:
            level = ERROR if late > HANGS else WARN
            found.append((level, f'callbacks wait for {late:.1f} s'))
        if self._restarts and time.monotonic() - self._began < RECENT:
            found.append((WARN, f'was started again ({self._restarts} times so far)'))
        return found


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
