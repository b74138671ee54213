"""Shows snapshots of a mission as they come: as a moving picture, as lines, or one picture."""

from __future__ import annotations

import time
from collections.abc import Callable

from rich.console import Console
from rich.live import Live

from surveillance_operator.snapshot import Snapshot
from surveillance_operator.watch.view import MissionView
from surveillance_runtime.interrupt import Interrupt

PERIOD = 0.2
"""Seconds between two pictures."""
SETTLING = 2.0
"""How long a single picture waits for what is latched, once a mission was seen, seconds."""
PLAIN_SIZE = 100, 40
"""Columns and rows of a single picture where there is no terminal."""

See = Callable[[], Snapshot]


def show_moving(see: See, stopping: Interrupt, console: Console) -> None:
    """Draws on the terminal's other screen until told to stop, which gives the first one back."""
    with Live(console=console, screen=True, auto_refresh=False) as live:
        while not stopping.is_set():
            live.update(MissionView(see()), refresh=True)
            stopping.wait(PERIOD)


def show_once(see: See, stopping: Interrupt, console: Console, timeout: float) -> bool:
    """Draws one picture once there is a mission; whether there was one within the time."""
    deadline = time.monotonic() + timeout
    while see().status is None:
        if time.monotonic() > deadline or stopping.wait(PERIOD / 4):
            return False
    settled = time.monotonic() + SETTLING
    while not _is_complete(see()) and time.monotonic() < settled and not stopping.wait(PERIOD / 4):
        pass
    if not console.is_terminal:
        console.size = PLAIN_SIZE
    console.print(MissionView(see(), whole=False))
    return True


def _is_complete(snapshot: Snapshot) -> bool:
    """Whether all that a simulated mission tells has come."""
    parts = (snapshot.battery, snapshot.decision, snapshot.grid, snapshot.pose, snapshot.doors)
    placed = snapshot.positions and snapshot.visited_at.keys() <= snapshot.positions.keys()
    return None not in parts and bool(placed and snapshot.mode)
