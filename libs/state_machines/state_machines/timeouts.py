"""Time limits, retries, and states that hang: stopped in time, executed again, left behind.

Whoever executes a machine watches its threads (`supervise`). When a state neither returns within
its deadline nor heeds a preempt within its bound, the watcher leaves its thread behind, has another
one go on where the state would have ended (`_abandon`), and names the state in the log.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from state_machines.clock import Interrupt
from state_machines.exceptions import InvalidTransitionError
from state_machines.execution import Control, ExecutionThread, Watch, Work
from state_machines.log import logerr, logwarn
from state_machines.nodes import SUSPENDED, Limits, Node
from state_machines.state import this_thread

if TYPE_CHECKING:
    from state_machines.frame import Frame


def limited(node: Node, limits: Limits) -> Callable[[Any], Any]:
    """Wrap what executes a state so that its limits are at work meanwhile."""
    timed = limits.timeout is not None or limits.deadline is not None

    def run(view: Any) -> Any:
        for attempt in range(limits.retry + 1):
            thread: ExecutionThread | None = this_thread.thread
            watch = _begin_watch(thread, node, limits) if thread is not None and timed else None
            try:
                outcome = node.enter(view)
            finally:
                if watch is not None and thread is not None:
                    _end_watch(thread, watch)
            frame = thread.stack[-1] if thread is not None else None
            outcome = _settle(node, frame, watch, outcome)
            if outcome not in limits.failures or attempt == limits.retry:
                return outcome
            if node.state.preempt_requested() or (frame is not None and frame.wanted):
                return outcome
            logwarn(
                f"State '{node.path}' ended with '{outcome}': attempt {attempt + 2} of "
                f'{limits.retry + 1}'
            )
        return None

    return run


def _settle(node: Node, frame: Frame | None, watch: Watch | None, outcome: Any) -> Any:
    """Turn what a state returned after running out of time into the outcome for that.

    Args:
        node: The state's node.
        frame: The frame that it ran in.
        watch: Its limits at work.
        outcome: What it returned.
    """
    limits = node.limits
    if watch is None or not watch.asked or limits is None or outcome is SUSPENDED:
        return outcome
    if frame is not None and frame.wanted:
        return outcome  # Whoever wants it to end too sorts the request out.
    ignored = node.state.preempt_requested()
    if ignored:
        # It ended by itself; the request came too late or for nothing.
        node.state.recall_preempt()
        if outcome != 'preempted':
            return outcome
    logwarn(f"State '{node.path}' was stopped after its timeout of {limits.timeout:g} s")
    return limits.late_outcome


# Limits at work.


def _begin_watch(thread: ExecutionThread, node: Node, limits: Limits) -> Watch:
    """Put limits to work on the state that the innermost frame is about to execute."""
    now = thread.control.now()
    with thread.control.condition:
        thread.check()
        watch = Watch(
            node,
            len(thread.stack) - 1,
            None if limits.timeout is None else now + limits.timeout,
            None if limits.deadline is None else now + limits.deadline,
        )
        thread.watches.append(watch)
    thread.wakeup.set()
    return watch


def _end_watch(thread: ExecutionThread, watch: Watch) -> None:
    """End the limits of a state that has returned."""
    with thread.control.condition:
        thread.check()
        thread.watches.remove(watch)


def settled(frame: Frame, outcome: Any) -> Any:
    """Return the outcome of the state that `frame` executed, its limits having been ended."""
    for watch in frame.thread.watches:
        if frame.thread.stack[watch.depth] is frame:
            _end_watch(frame.thread, watch)
            return _settle(watch.node, frame, watch, outcome)
    return outcome


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

STOPPED = ('preempted', 'aborted')
"""Outcomes that a state may be taken to have ended with that was left behind."""


def stopped_outcome(node: Node) -> str | None:
    """Return the outcome that a state is taken to have ended with, if it has one for that."""
    return next((outcome for outcome in STOPPED if outcome in node.targets), None)


def _abandon_unpreemptible(thread: ExecutionThread) -> None:
    """Go on without a state that ignores a preempt: with its preempted outcome, or its container's.

    Under the machine's condition.
    """
    reason = f'ignored a preempt for {thread.control.preempt_timeout:g} s'
    for depth, frame in reversed(list(enumerate(thread.stack))):
        if not isinstance(frame.current, Node):
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
    frames = leave_behind(thread, depth)
    if frames:
        thread.start(lambda: _go_on(thread, frames, outcome))
        return
    error = None if isinstance(outcome, str) else outcome
    thread.end(outcome if error is None else None, error)
    thread.wakeup.set()


def leave_behind(thread: ExecutionThread, depth: int = -1) -> list[Frame]:
    """Leave the present thread behind, and take its containers and userdata away from it.

    Under the machine's condition.

    Args:
        thread: The logical thread.
        depth: Index of the last frame that is gone on in, without its state; -1 for none.

    Returns:
        The frames up to `depth` for the thread that takes the execution over.
    """
    old, work = thread.stack, thread.work
    frames = [frame.successor() for frame in old[: depth + 1]]
    inside = old[-1].current if old else None
    for index, frame in enumerate(old):
        frame.abandoned(for_good=index > depth)
    for frame in frames:
        frame.hold()
    if work is not None:
        thread.control.hanging.append((thread.path_inside(), work))
    if isinstance(inside, Node) and work is not None:
        # The request stays with the state, so that the thread left behind ends some time.
        inside.state.request_preempt()
        inside.revoke()
        block_reentry(inside, work)
    if frames and isinstance(frames[-1].current, Node):
        frames[-1].gone = frames[-1].current
        if frames[-1].current is not inside:
            frames[-1].current.revoke()
    thread.stack = list(frames)
    thread.watches = [watch for watch in thread.watches if watch.depth < depth]
    thread.asked_at = None
    if not frames:
        thread.retire()
    thread.control.condition.notify_all()
    return frames


def _go_on(thread: ExecutionThread, frames: list[Frame], outcome: Any) -> Any:
    """Finish nested containers from inside out, the innermost one's state having ended."""
    frame = frames[-1]
    try:
        for frame in reversed(frames):
            outcome = frame.to_its_end(partial(frame.run_on, outcome))
    finally:
        with thread.control.condition:
            for rest in frames[: frames.index(frame) + 1]:
                if rest.container.fsm_frame is rest:
                    rest.container.fsm_frame = None
    return outcome


def block_reentry(node: Node, left: Work) -> None:
    """Enter a state again only when the thread that was left behind in it has ended."""
    enter = node.state.execute
    unlimited = node.execute is node.enter

    def wait_and_enter(view: Any) -> Any:
        thread: ExecutionThread | None = this_thread.thread
        if not left.await_end(thread.control.preempt_timeout if thread is not None else None):
            logerr(f"State '{node.label}' is still running from an earlier execution")
            if thread is not None:
                thread.still_gone(node)
            return stopped_outcome(node)
        node.state.fsm_left = None
        node.enter = enter
        if unlimited:
            node.execute = enter
        if thread is None:
            node.state.recall_preempt()
        else:
            thread.renew_request(node)
        return enter(view)

    node.state.fsm_left = left
    node.enter = wait_and_enter
    if unlimited:
        node.execute = wait_and_enter
