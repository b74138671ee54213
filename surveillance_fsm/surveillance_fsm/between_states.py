"""What a container that runs one state at a time does between two of them.

Most transitions need none of this: the loop in `driven` comes here only when something beside the
next state wants to be looked at. Preempts are passed on, interrupts cut in and are resumed from,
outcomes are forced, a paused machine stands still.
"""

from __future__ import annotations

from typing import Any

from surveillance_fsm import log, shutdown
from surveillance_fsm.active import ActiveContainer, forget, let_go
from surveillance_fsm.container import Container
from surveillance_fsm.engine import (
    LOWEST,
    NO_USERDATA,
    RESUMPTION,
    SUSPENDED,
    Exit,
    Frame,
    Node,
    SpecialStep,
)
from surveillance_fsm.nodes import wrong_outcome
from surveillance_fsm.run import LeftBehind

SHUTDOWN = Exit('shutdown')
"""Where a run goes that the shutdown check ended."""
ASIDE = Exit('aside')
"""Where a run goes that was put aside."""


class BetweenStates(ActiveContainer):
    """Base of the containers that run one state at a time: what comes between the states."""

    _always_attend = False
    _table: dict[str, Node]

    def _attend(
        self, frame: Frame, left: Node | None, outcome: Any, target: Node | Exit
    ) -> Node | Exit:
        """Do what comes between two states beside the transition itself.

        Args:
            frame: The execution.
            left: The state that ended; None at the start.
            outcome: What it returned.
            target: Where that leads by the table.

        Returns:
            Where to go.
        """
        run = frame.strand.run
        ended = left
        passed: list[tuple[Node | None, Any, Node | Exit, str]] | None = None
        with run.condition:
            if frame.stale:
                raise LeftBehind
            frame.strand.heeded()
            frame.attention = False
            kind = 'start' if left is None else 'transition'
            moves = left is not None
            while True:
                if frame.cut is not None and frame.cut is not ended:
                    # It was asked to make way before it began.
                    let_go(frame.cut.state)
                    if frame.preempted is frame.cut:
                        frame.preempted = None  # It is asked again below.
                    frame.cut = None
                if frame.forced is not None and frame.forced[0] is ended:
                    outcome, kind = frame.forced[1], 'forced'
                    target, moves = self._target(frame.forced[0], outcome), True
                    self._drop_requests(frame, frame.forced[0])
                elif ended is not None:
                    target, moves = self._sort_requests(frame, ended, outcome, target)
                if ended is not None and ended.priority > LOWEST and target is not ended:
                    target, kind = self._leave_branch(frame, target, kind)
                if frame.forced is not None and frame.forced[0] is target:
                    # Forced before it began.
                    passed = [*(passed or ()), (left, outcome, target, kind)]
                    left = ended = frame.forced[0]
                    continue
                ended = None
                if self._preempt_requested and isinstance(target, Node):
                    self._preempt_next(frame, target)
                elif frame.suspending and isinstance(target, Node):
                    self._fsm_history = frame.history(target)
                    if moves:
                        passed = [*(passed or ()), (left, outcome, target, kind)]
                    target = ASIDE
                    break
                elif self._fsm_raised and not self._preempt_requested:
                    target, kind = self._branch_off(frame, target, kind)
                if shutdown.is_shutdown():
                    target = SHUTDOWN
                frame.current = target
                if not self._stands_still(frame, target):
                    break
                run.condition.wait()
                if frame.stale:
                    raise LeftBehind
            frame.attention = self._wants_attention(frame, target)
            frame.trace = run.trace
        for transition in passed or ():
            self._tell(frame, *transition)
        if target is not SHUTDOWN and target is not ASIDE:
            self._tell(frame, left, outcome, target, kind)
        return target

    def _sort_requests(
        self, frame: Frame, left: Node, outcome: Any, target: Node | Exit
    ) -> tuple[Node | Exit, bool]:
        """Settle what was asked of the state that ended: a preempt, or to make way.

        Returns:
            Where to go, and whether that is a transition; a state that made way is not left.
        """
        state, cut, made_way = left.state, frame.cut, False
        forced_next = frame.forced is not None and frame.forced[0] is target
        asked = frame.preempted is left
        gone = frame.gone is left
        # A state that was left behind keeps the request, and has not ignored it any longer.
        pending = state.preempt_requested() and not gone
        frame.cut = frame.gone = None
        if asked:
            frame.preempted = None
        if cut is left and outcome is not SUSPENDED and (pending or not asked):
            # With both asked and one still pending, what it served was to make way.
            # Whoever forces the next state's outcome has seen this one end.
            made_way = (not pending or outcome == 'preempted') and not forced_next
            if not gone:
                state.recall_preempt()
        elif asked and pending:
            state.recall_preempt()
        elif asked and self._preempt_requested:
            self.service_preempt()
        if made_way:
            target = left
        stays = made_way or outcome is SUSPENDED
        if stays:
            frame.repeat = True
        if not made_way and getattr(state, '_fsm_progress', None) is not None:
            state._fsm_progress = None
        return target, not stays

    def _drop_requests(self, frame: Frame, left: Node) -> None:
        left.state.recall_preempt()
        forget(left.state)
        frame.forced = frame.preempted = frame.cut = None

    def _preempt_next(self, frame: Frame, target: Any) -> None:
        """Ask the next state to stop, because the last one did not acknowledge the preempt."""
        if frame.preempted is not target:
            if frame.preempted is not None:
                frame.preempted.state.recall_preempt()
            frame.preempted = target
            frame.strand.asked()
            target.state.request_preempt()

    def _stands_still(self, frame: Frame, target: Node | Exit) -> bool:
        """Whether the machine is paused here; takes one step if it may."""
        run = frame.strand.run
        if not run.paused or not isinstance(target, Node) or isinstance(target.state, Container):
            return False
        if frame.suspending:
            return False
        if any(other.container._preempt_requested for other in frame.strand.stack):
            return False
        if run.steps:
            run.steps -= 1
            return False
        return True

    def _wants_attention(self, frame: Frame, target: Node | Exit) -> bool:
        return bool(
            log.chatty()
            or self._transition_cbs
            or self._termination_cbs
            or self._preempt_requested
            or self._fsm_raised
            or frame.saved
            or frame.suspending
            or frame.cut
            or frame.forced
            or frame.strand.run.paused
            or self._always_attend
            or (isinstance(target, Node) and getattr(target.state, '_fsm_progress', None))
        )

    def _tell(
        self, frame: Frame, left: Node | None, outcome: Any, target: Node | Exit, kind: str
    ) -> None:
        trace = frame.trace
        if left is None:
            if trace is not None:
                step = SpecialStep(frame.path, '', target.label, 'start')
                trace((step, '', frame.now(), NO_USERDATA))
            return
        if trace is not None:
            kind = target.kind if target.is_exit else kind
            step = SpecialStep(frame.path, left.label, target.label, kind)
            trace((step, outcome, frame.now(), self.userdata._data.copy()))
        if log.chatty():
            verb = 'ends' if target.is_exit else 'goes on'
            log.loginfo(f"'{frame.path}' {verb}: '{left.label}' : '{outcome}' --> '{target.label}'")
        if target.is_exit:
            self.call_termination_cbs([left.label], target.label)
        else:
            self.call_transition_cbs()

    def _branch_off(self, frame: Frame, target: Node | Exit, kind: str) -> tuple[Node | Exit, str]:
        """Enter the branch of the most urgent interrupt, if it is more urgent than `target`."""
        urgent = max(self._fsm_raised, key=lambda branch: branch.priority)
        if urgent.priority <= target.priority:
            return target, kind
        self._fsm_raised.remove(urgent)
        frame.saved.append(target)
        return self._table[urgent.label], 'interrupt'

    def _leave_branch(
        self, frame: Frame, target: Node | Exit, kind: str
    ) -> tuple[Node | Exit, str]:
        """Go back to where the interrupt came, or forget that place."""
        if target is RESUMPTION:
            return frame.saved.pop(), 'resume'
        for node in frame.saved:
            if isinstance(node, Node):
                forget(node.state)
        frame.saved.clear()
        return target, kind

    def _target(self, node: Node, outcome: Any) -> Node | Exit:
        try:
            return node.targets[outcome]
        except (KeyError, TypeError):
            raise wrong_outcome(self._path_of(node.label), node, outcome) from None
