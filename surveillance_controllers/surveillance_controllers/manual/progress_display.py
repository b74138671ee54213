"""A charge on its way, shown in the terminal as a bar, or as a few plain lines where there is no
terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

PLAIN_STEP = 10
"""Percent between two plain lines."""


@contextmanager
def charge_display(
    start: float, stream: TextIO | None = None, *, bar: bool = True
) -> Iterator[Callable[[float], None]]:
    """Shows a charge while the context lasts.

    Args:
        start: Charge at the beginning, percent.
        stream: Where to show it; standard output unless given.
        bar: Allows a moving bar. Give False where something else moves the terminal's cursor.

    Yields:
        A function to call with each new charge in percent.
    """
    stream = sys.stdout if stream is None else stream
    console = Console(file=stream)
    if bar and console.is_terminal:
        columns = (
            TextColumn('{task.description}'),
            BarColumn(),
            TextColumn('{task.percentage:>3.0f} %'),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=console) as progress:
            task = progress.add_task('Charging', total=100.0, completed=round(start))
            yield lambda percent: progress.update(task, completed=percent)
        return
    shown = -1

    def show(percent: float) -> None:
        nonlocal shown
        step = int(percent // PLAIN_STEP)
        if step > shown:
            shown = step
            print(f'Charging: {step * PLAIN_STEP} %', file=stream, flush=True)

    shown = int(start // PLAIN_STEP) - 1
    show(start)
    yield show
