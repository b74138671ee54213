"""What a person should know of the machine: its disk is almost full, its clock was set."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from surveillance_runtime.alarms import CLOCK_SET, DISK_LOW, DISK_WELL
from surveillance_runtime.event_log import steady_now
from surveillance_runtime.incidents import Incidents

CLOCK = 'clock', 'machine'


class MachineWatch:
    """Begins and ends the incidents of the machine; one thread at a time.

    Args:
        incidents: Where they are told.
        folder: Of the run, on whose disk is written; None: no disk is watched.
        free: Returns the bytes that are free there; raises `OSError`.
        wall: Returns the seconds since 1970.
        steady: Returns the seconds since the machine was started.
    """

    def __init__(
        self,
        incidents: Incidents,
        folder: Path | None,
        free: Callable[[Path], float] = lambda folder: shutil.disk_usage(folder).free,
        wall: Callable[[], float] = time.time,
        steady: Callable[[], float] = steady_now,
    ) -> None:
        self._incidents, self._folder, self._free = incidents, folder, free
        self._wall, self._steady = wall, steady
        self._offset = wall() - steady()

    def look(self) -> None:
        """Look at the disk and the clock; call it every second or two."""
        if self._folder is not None:
            self._look_at_disk(self._folder)
        self._look_at_clock()

    def _look_at_disk(self, folder: Path) -> None:
        cause = 'disk', str(folder)
        with suppress(OSError):
            free = self._free(folder)
            if free < DISK_LOW:
                self._incidents.begin(
                    cause,
                    f'the disk of {folder} is almost full, below {DISK_LOW / 1e6:g} MB are free: '
                    'recording and record end soon',
                )
            elif free > DISK_WELL:
                self._incidents.end(cause, f'{free / 1e6:.0f} MB are free')

    def _look_at_clock(self) -> None:
        now = self._wall()
        offset = now - self._steady()
        step, self._offset = offset - self._offset, offset
        if abs(step) > CLOCK_SET:
            before = datetime.fromtimestamp(now - step)
            text = (
                f"the machine's clock was set by {step:+.0f} s, from {before:%H:%M:%S} to "
                f'{datetime.fromtimestamp(now):%H:%M:%S}'
            )
            self._incidents.begin(CLOCK, text)
        else:
            self._incidents.end(CLOCK, 'the clock was not set again')
