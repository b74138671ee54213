"""Whether a process hangs, by its heartbeats and by what the kernel says of it."""

from __future__ import annotations

import os
from dataclasses import dataclass

STOPPED_AFTER = 1.0
"""Seconds without a heartbeat after which a process that was stopped by a signal is given up."""
STUCK_AFTER = 3.0
"""The same for one that uses no processor time, as in a deadlock."""
BUSY_AFTER = 3.5
"""The same for one that computes, of its own processor time: an endless loop."""
STARVED_AFTER = 20.0
"""The same for one that gets little processor time, on a busy machine."""
IDLE_AFTER = 1.0
"""Seconds without processor time after which a process does nothing, as far as one can see."""
SILENT_START = 90.0
"""Seconds that a process may take until its first heartbeat."""
_PAGE = os.sysconf('SC_PAGE_SIZE')
_LEAST_SHARE = 0.02


@dataclass(frozen=True)
class ProcessSample:
    """One look at a process.

    Attributes:
        state: The kernel's letter: R runs, S sleeps, T stopped, D waits for a device.
        cpu: Processor time used so far, seconds.
        memory: Resident memory, bytes.
    """

    state: str
    cpu: float
    memory: int


def look_at(pid: int) -> ProcessSample | None:
    """Return how a process is, None where the kernel does not say."""
    try:
        with open(f'/proc/{pid}/stat', encoding='utf-8', errors='replace') as file:
            fields = file.read().rsplit(')', 1)[1].split()
    except (OSError, IndexError):
        return None
    ticks = os.sysconf('SC_CLK_TCK')
    return ProcessSample(
        fields[0], (int(fields[11]) + int(fields[12])) / ticks, int(fields[21]) * _PAGE
    )


class Activity:
    """How long a process has done nothing.

    One that gets no processor time on a busy machine is ready to run, or waits for a device: it
    does something.
    """

    def __init__(self) -> None:
        self._since = self._cpu = 0.0
        self._begun = False

    def idle(self, now: float, look: ProcessSample) -> float:
        """Take a look, and return for how many seconds the process has done nothing."""
        used, least = look.cpu - self._cpu, _LEAST_SHARE * (now - self._since)
        if not self._begun or look.state in ('R', 'D') or used > least:
            self._begun, self._since, self._cpu = True, now, look.cpu
        return now - self._since


class Heartbeats:
    """Judges one process by its heartbeats and by what the kernel says of it.

    Args:
        now: Steady time, seconds.

    Attributes:
        begun: Whether the process came through its start: there was a heartbeat.
    """

    def __init__(self, now: float) -> None:
        self.begun = False
        self.excuse(now)

    def beat(self, now: float) -> None:
        """Note a heartbeat."""
        self.begun = True
        self.excuse(now)

    def excuse(self, now: float) -> None:
        """Begin to count anew: the watcher itself did not run."""
        self._last = now
        self._activity = Activity()
        self._cpu_at_beat: float | None = None

    def problem(self, now: float, look: ProcessSample | None) -> str:
        """Return why the process is to be ended, empty while it is not."""
        quiet = now - self._last
        if look is None:
            return ''
        if self._cpu_at_beat is None:
            self._cpu_at_beat = look.cpu
        if quiet < STOPPED_AFTER:
            return ''
        if look.state == 'T':
            return f'was stopped {quiet:.1f} s ago'
        if not self.begun:
            return f'did not come up in {SILENT_START:g} s' if quiet >= SILENT_START else ''
        idle = self._activity.idle(now, look)
        stuck = quiet >= STUCK_AFTER and idle >= IDLE_AFTER
        loops = look.cpu - self._cpu_at_beat >= BUSY_AFTER
        if stuck or loops or quiet >= STARVED_AFTER:
            return f'hangs: no heartbeat for {quiet:.1f} s'
        return ''
