"""Watching over strands: what is due, and doing it.

When a state neither returns within its deadline nor heeds a preempt within its bound, the watcher
leaves its thread behind, has another one go on where the state would have ended (`takeover`), and
names the culprit.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

from surveillance_fsm.run import Run, Strand, Watch
from surveillance_fsm.takeover import go_on_past, take_over
from surveillance_fsm.waiting import Interrupt


def supervise(run: Run, strands: Sequence[Strand], wakeup: Interrupt) -> None:
    """Watch strands until one of them ends or `wakeup` is raised by somebody else.

    Args:
        run: The execution they belong to.
        strands: The strands; each raises `wakeup` when it ends or its limits change.
        wakeup: What the wait ends by.
    """
    with run.condition:
        wakeup.clear()
        if any(strand.done for strand in strands):
            return
        dues = [_due(strand) for strand in strands]
    clocked = min((due for due, _ in dues if due is not None), default=None)
    steady = min((due for _, due in dues if due is not None), default=None)
    left = None if steady is None else max(0.0, steady - time.monotonic())
    if clocked is None:
        wakeup.wait(left)
    else:
        alarm = threading.Timer(left, wakeup.set) if left is not None else None
        if alarm is not None:
            alarm.start()
        run.clock.sleep(max(0.0, clocked - run.clock.now()), wakeup)
        if alarm is not None:
            alarm.cancel()
    for strand in strands:
        _enforce(strand)


def _due(strand: Strand) -> tuple[float | None, float | None]:
    """When something is due next: (on the machine's clock, in steady time)."""
    times = [t for watch in strand.watches for t in (watch.soft, watch.hard) if t is not None]
    bound = strand.run.preempt_timeout
    steady = None
    if strand.asked_at is not None and bound is not None and not _bounds_itself(strand):
        steady = strand.asked_at + bound
    return (min(times) if times else None), steady


def _bounds_itself(strand: Strand) -> bool:
    return bool(strand.stack) and strand.stack[-1].container._fsm_bounds_itself


def _enforce(strand: Strand) -> None:
    """Do what is due: ask states to stop, or go on without them."""
    now = strand.run.clock.now()
    with strand.run.condition:
        if strand.done:
            return
        for watch in tuple(strand.watches):
            if watch.hard is not None and now >= watch.hard:
                _go_on_without(strand, watch)
                return
            if watch.soft is not None and now >= watch.soft:
                watch.soft, watch.asked = None, True
                watch.node.state.request_preempt()
        _, steady = _due(strand)
        if steady is not None and time.monotonic() >= steady:
            go_on_past(strand)


def _go_on_without(strand: Strand, watch: Watch) -> None:
    limits = watch.node.limits
    assert limits is not None
    take_over(
        strand,
        watch.depth,
        watch.node,
        limits.late_outcome,
        f'did not return within its deadline of {limits.deadline:g} s',
    )
