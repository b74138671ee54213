"""Processes that a benchmark starts, looks at and ends."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from launcher.process_watch import look_at


def end_processes(
    processes: Sequence[subprocess.Popen[Any]], patience: float, by: int = signal.SIGINT
) -> None:
    """Stop processes as Ctrl-C does, all at once; kill those that do not end in time.

    Args:
        processes: Some may have ended.
        patience: Seconds for each.
        by: The signal.
    """
    for process in processes:
        if process.poll() is None:
            process.send_signal(by)
    for process in processes:
        try:
            process.wait(patience)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used, seconds; 0 when it has ended."""
    look = look_at(pid)
    return 0.0 if look is None else look.cpu


def memory_mb(pid: int, field: str = 'VmRSS') -> float:
    """Return a size of a process, MB: `VmRSS` now, `VmHWM` at most; 0 when it has ended."""
    try:
        status = Path(f'/proc/{pid}/status').read_text()
    except OSError:
        return 0.0
    sizes = [line.split()[1] for line in status.splitlines() if line.startswith(field)]
    return int(sizes[0]) / 1024 if sizes else 0.0
