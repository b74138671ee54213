"""Going on without a state: whose outcome it is, who runs the rest, who may enter it again."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from surveillance_behaviour.fsm.engine import Frame, Node
from surveillance_behaviour.fsm.log import logerr
from surveillance_behaviour.fsm.this_thread import this_thread

if TYPE_CHECKING:
    from surveillance_behaviour.fsm.run import Strand

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
