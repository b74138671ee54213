"""Going on without a state: whose outcome it is, who runs the rest, who may enter it again."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from surveillance_fsm.engine import Frame, Node
from surveillance_fsm.exceptions import PreemptIgnoredError
from surveillance_fsm.log import logerr
from surveillance_fsm.this_thread import this_thread

if TYPE_CHECKING:
    from surveillance_fsm.run import Strand

STOPPED = ('preempted', 'aborted')
"""Outcomes that a state may be taken to have ended with that was left behind."""


def keep_out(node: Node, ended: threading.Event) -> None:
    """Let nobody into a state before the thread that was left behind in it has ended."""
    enter = node.state.execute
    unlimited = node.execute is node.enter

    def wait_and_enter(view: Any) -> Any:
        strand = this_thread.strand
        bound = strand.run.preempt_timeout if strand is not None else None
        if not ended.wait(bound):
            logerr(f"State '{node.label}' is still running from an earlier execution")
            if strand is not None:
                strand.still_gone(node)
            return stopped_outcome(node)
        node.enter = enter
        if unlimited:
            node.execute = enter
        if strand is None:
            node.state.recall_preempt()
        else:
            strand.renew_request(node)
        return enter(view)

    node.state._fsm_left = ended
    node.enter = wait_and_enter
    if unlimited:
        node.execute = wait_and_enter


def stopped_outcome(node: Node) -> str | None:
    """The outcome that a state is taken to have ended with, if it has one for that."""
    for outcome in STOPPED:
        if outcome in node.targets:
            return outcome
    return None


def go_on(strand: Strand, frames: list[Frame], outcome: Any) -> Any:
    """Finish nested containers from inside out, the innermost one's state having ended."""
    frame = frames[-1]
    try:
        for frame in reversed(frames):
            outcome = frame.container._proceed(frame, outcome)
    finally:
        with strand.run.condition:
            for rest in frames[: frames.index(frame) + 1]:
                if rest.container._frame is rest:
                    rest.container._frame = None
    return outcome


def go_on_past(strand: Strand) -> None:
    """Go on without a state that ignores a preempt: with its preempted outcome, or its container's.

    Under the run's condition.
    """
    bound = strand.run.preempt_timeout
    reason = f'ignored a preempt for {bound:g} s'
    culprit = strand.path_inside()
    for depth in range(len(strand.stack) - 1, -1, -1):
        node = strand.stack[depth].current
        if not isinstance(node, Node):
            return  # It is ending by itself.
        forced = strand.stack[depth].forced
        outcome = forced[1] if forced is not None else stopped_outcome(node)
        if outcome is not None:
            take_over(strand, depth, node, outcome, reason, culprit)
            return
    leaf, forced = strand.leaf, strand.forced
    if leaf is not None:
        outcome = forced[1] if forced is not None else stopped_outcome(leaf)
        if outcome is not None:
            take_over(strand, -1, leaf, outcome, reason, culprit)
            return
    root = strand.stack[0].container if strand.stack else None
    outcomes = root.get_registered_outcomes() if root is not None else ()
    for ending in STOPPED:
        if ending in outcomes:
            take_over(strand, -1, None, ending, reason, culprit)
            return
    error = PreemptIgnoredError(
        f"State '{culprit}' {reason}, and no container around it can "
        f"end with 'preempted' or 'aborted'"
    )
    take_over(strand, -1, None, error, reason, culprit)


def take_over(
    strand: Strand,
    depth: int,
    node: Node | None,
    outcome: str | BaseException,
    reason: str,
    culprit: str | None = None,
) -> None:
    """Leave a strand's thread behind and go on as if the state in frame `depth` had ended.

    Under the run's condition.

    Args:
        strand: The strand.
        depth: Index of the frame to go on in; -1 to end the strand.
        node: The state to go on without, whose userdata is taken away.
        outcome: What it is taken to have returned, or the error to end the strand with.
        reason: What it did wrong, for the log.
        culprit: Its path.
    """
    assert strand.thread is not None
    culprit = culprit or strand.path_inside()
    leaf = strand.stack[-1].current if strand.stack else strand.leaf
    ended = f"with '{outcome}'" if isinstance(outcome, str) else 'with an error'
    logerr(f"State '{culprit}' {reason}: the machine goes on without it, {ended}")
    strand.run.left_behind.append((culprit, strand.thread))
    old = strand.stack
    frames = [frame.successor() for frame in old[: depth + 1]]
    for frame in old:
        frame.stale = frame.attention = True
        frame.container._frame = None
    for frame in old[depth + 1 :]:
        frame.container.recall_preempt()
    for frame in frames:
        frame.container._frame = frame
    if frames:
        frames[-1].gone = node
    if isinstance(leaf, Node):
        # The request stays with the state, so that the thread left behind ends some time.
        leaf.state.request_preempt()
        leaf.revoke()
        keep_out(leaf, strand.thread_ended)
    if node is not None and node is not leaf:
        node.revoke()
    strand.stack = list(frames)
    strand.watches = [watch for watch in strand.watches if watch.depth < depth]
    strand.asked_at = None
    strand.run.condition.notify_all()
    for frame in old:
        frame.container._fsm_woken()
    if not frames:
        strand.token = object()
        strand.without_leaf = leaf is strand.leaf
        if isinstance(outcome, str):
            strand.end(outcome, None)
        else:
            strand.end(None, outcome)
        return
    strand.start(lambda: go_on(strand, frames, outcome))
