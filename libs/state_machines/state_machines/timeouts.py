"""States that hang: asked to stop in time, and left behind when they do not.

Whoever executes a machine with time limits or a bound on preempts watches its threads
(`supervise`). When a state neither returns within its deadline nor heeds a preempt within its
bound, the watcher leaves its thread behind, has another one go on where the state would have ended
(`_abandon`), and names the state in the log.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

from state_machines.clock import Interrupt
from state_machines.exceptions import InvalidTransitionError
from state_machines.execution import STOPPED, Control, ExecutionThread, stopped_outcome
from state_machines.frame import Frame
from state_machines.log import logerr
from state_machines.program import StateNode

# Watching.


def supervise(control: Control, threads: Sequence[ExecutionThread], wakeup: Interrupt) -> None:
    """Watch threads until one of them ends or `wakeup` is raised by somebody else.

    A preempt need not wake a watcher that sleeps on no clock: it looks at least once in every
    bound, so that it always looks before a bound that has just begun is over.

    Args:
        control: The control of the machine they belong to.
        threads: The threads; each raises `wakeup` when it ends or its limits change.
        wakeup: What the wait ends by.
    """
    with control.condition:
        wakeup.clear()
        quiet = True
        for thread in threads:
            if thread.done:
                return
            if thread.watches:
                # Before the look at what is due: a request that comes after it wakes.
                control.sleeps_on_clock = True
            quiet = quiet and not thread.watches and thread.asked_at is None
        dues = [] if quiet else [_due(thread) for thread in threads]
    clocked = min((due for due, _ in dues if due is not None), default=None)
    steady = min((due for _, due in dues if due is not None), default=None)
    left = None if steady is None else max(0.0, steady - time.monotonic())
    if clocked is None:
        wakeup.wait(control.preempt_timeout if left is None else left)
    else:
        alarm = threading.Timer(left, wakeup.set) if left is not None else None
        if alarm is not None:
            alarm.daemon = True
            alarm.start()
        control.clock.sleep(max(0.0, clocked - control.now()), wakeup)
        if alarm is not None:
            alarm.cancel()
    for thread in threads:
        if not thread.done:
            _enforce(thread)


def _due(thread: ExecutionThread) -> tuple[float | None, float | None]:
    """When something is due next: (on the machine's clock, in steady time)."""
    times = [t for watch in thread.watches for t in (watch.soft, watch.hard) if t is not None]
    bound = thread.control.preempt_timeout
    steady = None
    if thread.asked_at is not None and bound is not None and not _bounds_itself(thread):
        steady = thread.asked_at + bound
    return (min(times) if times else None), steady


def _bounds_itself(thread: ExecutionThread) -> bool:
    """Tell whether a thread is in a concurrence, which watches its states' threads."""
    # A copy: the thread itself changes its stack at any moment.
    stack = tuple(thread.stack)
    return bool(stack) and stack[-1].watches_threads


def _enforce(thread: ExecutionThread) -> None:
    """Do what is due: ask states to stop, or go on without them."""
    now = thread.control.now()
    with thread.control.condition:
        if thread.done:
            return
        for watch in tuple(thread.watches):
            limits = watch.node.limits
            if watch.hard is not None and now >= watch.hard and limits is not None:
                _hold(thread)
                if thread.stack[watch.depth].current is not watch.node:
                    return  # It has just returned.
                reason = f'did not return within its deadline of {limits.deadline:g} s'
                _abandon(thread, watch.depth, limits.late_outcome, reason)
                return
            if watch.soft is not None and now >= watch.soft:
                watch.soft, watch.asked = None, True
                watch.node.state.request_preempt()
        _, steady = _due(thread)
        if steady is not None and time.monotonic() >= steady:
            _abandon_unpreemptible(thread)


# Going on without a state.


def _hold(thread: ExecutionThread) -> None:
    """Have the thread wait for the condition before its next state; under the condition.

    What its frames' `current` say from here on is what it executes, until the condition is given
    back: it writes that before it looks at `attention`.
    """
    for frame in tuple(thread.stack):
        frame.attention = True


def _abandon_unpreemptible(thread: ExecutionThread) -> None:
    """Go on without a state that ignores a preempt: with its preempted outcome, or its container's.

    Under the machine's condition.
    """
    reason = f'ignored a preempt for {thread.control.preempt_timeout:g} s'
    _hold(thread)
    for depth, frame in reversed(list(enumerate(thread.stack))):
        if not isinstance(frame.current, StateNode):
            return  # It is ending by itself.
        outcome = frame.forced[1] if frame.forced is not None else stopped_outcome(frame.current)
        if outcome is not None:
            _abandon(thread, depth, outcome, reason)
            return
    outcomes = thread.stack[0].last_outcomes() if thread.stack else ()
    ending = next((outcome for outcome in STOPPED if outcome in outcomes), None)
    error = InvalidTransitionError(
        f"State '{thread.path_inside()}' {reason}, and no container around it can end with "
        "'preempted' or 'aborted'"
    )
    _abandon(thread, -1, error if ending is None else ending, reason)


def _abandon(
    thread: ExecutionThread, depth: int, outcome: str | BaseException, reason: str
) -> None:
    """Go on without the present thread, as if the state in frame `depth` had ended.

    Under the machine's condition.

    Args:
        thread: The logical thread.
        depth: Index of the frame to go on in; -1 to end the logical thread.
        outcome: What the state is taken to have returned, or the error to end with.
        reason: What it did wrong, for the log.
    """
    ended = f"with '{outcome}'" if isinstance(outcome, str) else 'with an error'
    logerr(f"State '{thread.path_inside()}' {reason}: the machine goes on without it, {ended}")
    leave_behind(thread, depth)
    stack = thread.stack
    if stack:
        thread.start(lambda: stack[0].go_on(stack, outcome))
        return
    error = None if isinstance(outcome, str) else outcome
    thread.end(outcome if error is None else None, error)
    thread.wake_watcher()


def leave_behind(thread: ExecutionThread, depth: int = -1) -> None:
    """Leave the present thread behind, and take its containers and userdata away from it.

    Under the machine's condition.

    Args:
        thread: The logical thread. Its stack has copies of the frames up to `depth` afterwards, for
            the thread that takes the execution over.
        depth: Index of the last frame that is gone on in, without its state; -1 for none.
    """
    old: list[Frame] = thread.stack
    work, where = thread.work, thread.path_inside()
    frames = [frame.successor() for frame in old[: depth + 1]]
    # First of all: what the old thread puts on its stack from here on ends at once.
    thread.stack = frames
    inside = old[-1].current if old else None
    for index, frame in enumerate(old):
        frame.abandon(for_good=index > depth)
    for frame in frames:
        frame.hold()
    if work is not None:
        thread.control.hanging.append((where, work))
    if isinstance(inside, StateNode) and work is not None:
        # The request stays with the state, so that the thread left behind ends some time.
        inside.state.request_preempt()
        inside.revoke()
        work.block_reentry(inside)
    if frames and isinstance(frames[-1].current, StateNode):
        frames[-1].left, frames[-1].watch = frames[-1].current, None
        if frames[-1].current is not inside:
            frames[-1].current.revoke()
    thread.watches = [watch for watch in thread.watches if watch.depth < depth]
    thread.asked_at = None
    if not frames:
        thread.retire()
    thread.control.condition.notify_all()
