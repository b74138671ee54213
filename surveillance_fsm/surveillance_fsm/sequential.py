"""The execution of a container in which one state runs at a time: the loop over its states.

Most transitions need only the loop, `SequentialFrame._run_from`. It looks at one flag after each
state. When something beside the next state wants to be looked at (`attention`), `_attend` passes
preempts on, lets interrupts cut in and resumes from them, forces outcomes, and stands still while
the machine is paused.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from surveillance_fsm import control, log
from surveillance_fsm.container import Container
from surveillance_fsm.exceptions import InvalidStateError, SmachError
from surveillance_fsm.execution import (
    LOWEST,
    NO_USERDATA,
    RESUMPTION,
    SUSPENDED,
    Exit,
    Frame,
    History,
    LeftBehindError,
    Node,
    SpecialStep,
)
from surveillance_fsm.timeouts import end_watch, settle, watch_of
from surveillance_fsm.userdata import raw

SHUTDOWN = Exit('shutdown')
"""Where a run goes that the shutdown check ended."""
ASIDE = Exit('aside')
"""Where a run goes that was put aside."""


class _Move(NamedTuple):
    """A transition to be told: the state left (None at the start), its outcome, where to, kind."""

    left: Node | None
    outcome: Any
    target: Node | Exit
    kind: str


class SequentialFrame(Frame):
    """One execution of a container that runs one state at a time.

    Args:
        container: Whose execution it is.
        thread: The logical thread it belongs to.
        path: The container's path.
        current: The node it begins with.
        parent_ud: The parent's userdata.

    Attributes:
        saved: Where to go on after each of the interrupts under way.
        stopped: Where the shutdown check ended the run.
        items: An iterator's items that are left.
        index: How many items an iterator has begun.
        repeat: An iterator's current item has not ended: it is not followed by the next one.
    """

    saved: tuple[Node | Exit, ...] = ()
    stopped: Node | Exit = SHUTDOWN
    items: Any = None
    index = 0
    repeat = False
    carried_over = (*Frame.carried_over, 'saved', 'items', 'index', 'repeat')

    # From the beginning to the end.

    def execute(self, history: History | None) -> Any:
        """Run the container to its outcome, or to `SUSPENDED`."""
        container, run = self.container, self.run
        if history is None:
            container.fsm_copy_input_keys(self.parent_ud)
        else:
            self._go_on_from(history)
        if run.chatty:
            verb = 'starts in' if history is None else 'goes on in'
            log.loginfo(
                f"'{self.path}' {verb} '{self.current.label}' with userdata "
                f'{sorted(container.userdata.keys())}'
            )
        if history is None and container.fsm_start_cbs:
            container.call_start_cbs()
        target = self.current
        if (
            container.preempt_requested()
            or container.fsm_raised
            or self.attention
            or self.suspending
            or run.control.paused
            or history is not None
            or control.shutdown_check is not None
        ):
            target = self._attend(None, None, target)
        elif run.control.trace is not None:
            self._tell(_Move(None, None, target, 'start'))
        return self._run_from(target)

    def run_on(self, outcome: Any) -> Any:
        """Take `outcome` for that of the current state, and run to the end."""
        node = self.current
        assert isinstance(node, Node)
        watch = watch_of(self)
        if watch is not None:
            end_watch(self.thread, watch)
            outcome = settle(node, self, watch, outcome)
        self.current = target = node.target(outcome)
        node.release()
        return self._run_from(self._attend(node, outcome, target))

    def _go_on_from(self, history: History) -> None:
        """Begin where the container was put aside.

        Raises:
            InvalidStateError: It has no such state any more.
        """
        table = self.container.fsm_table

        def place(label: str, leaving: bool) -> Node | Exit:
            if leaving:
                return Exit(label)
            if label not in table:
                raise InvalidStateError(
                    f"'{self.path}' cannot go on in '{label}': its states are {sorted(table)}"
                )
            return table[label]

        self.saved = tuple(place(*saved) for saved in history.saved)
        self.current = place(history.current, history.leaving)
        self.index, self.items, self.repeat = history.index, history.items, history.repeat

    def _run_from(self, target: Any) -> Any:
        """Execute states from `target` on until one leads out of the container; the outcome."""
        container, run = self.container, self.run
        data, now = container.fsm_data, run.now
        trace, callbacks, chatty = run.control.trace, container.fsm_transition_cbs, run.chatty
        told: Node | Exit = target
        node: Any = None
        while not target.is_exit:
            node = target
            try:
                outcome = node.execute(node.view)
            except SmachError:
                raise
            except Exception as error:
                raise node.user_fault(error) from error
            try:
                target = node.targets[outcome]
            except (KeyError, TypeError):
                target = node.target(outcome)
            self.current = target
            if node.is_container:
                node.state.fsm_frame = None
            if self.attention:
                told = target = self._attend(node, outcome, target)
                trace, chatty = run.control.trace, run.chatty
            elif trace is not None or callbacks or chatty or control.shutdown_check is not None:
                if control.is_shutdown():
                    self.stopped = target
                    self.current = told = target = SHUTDOWN
                    break
                if trace is not None:
                    trace((node, outcome, now(), data.copy() if data else NO_USERDATA))
                if chatty:
                    self._log(node, outcome, target)
                if callbacks and not target.is_exit:
                    container.call_transition_cbs()
        if target is not told and container.fsm_termination_cbs:
            container.call_termination_cbs([node.label], target.label)
        if target is ASIDE:
            return SUSPENDED
        container.fsm_copy_output_keys(self.parent_ud)
        return None if target is SHUTDOWN else target.label

    # Between two states.

    def _attend(self, left: Node | None, outcome: Any, target: Node | Exit) -> Node | Exit:
        """Do what comes between two states beside the transition itself.

        Args:
            left: The state that ended; None at the start.
            outcome: What it returned.
            target: Where that leads by the table.

        Returns:
            Where to go.
        """
        run, ended, stood, still = self.run, left, False, False
        kind, moved = '', True
        while True:
            with run.condition:
                paused = run.control.paused and not run.control.steps
                if still and paused and not (self.attention or self.stale):
                    run.condition.wait()
                if self.stale:
                    raise LeftBehindError
                self.thread.heeded()
                self.attention = False
                target, moves = self._decide(_Move(left, outcome, target, kind), ended, moved)
                self.current = target
                still = self._stands_still(target)
                self.attention = self._wants_attention(target)
            if stood and not still and not moves:
                # The pause is no part of the duration of what begins now.
                moves = [_Move(None, None, target, 'entered')]
            # Told before a pause, and not under the condition: callbacks may take their time.
            for move in moves:
                self._tell(move)
            if not still:
                return target
            stood, moved, ended = True, False, None
            left, outcome = target, ''  # type: ignore[assignment]

    def _decide(
        self, move: _Move, ended: Node | None, moved: bool
    ) -> tuple[Node | Exit, list[_Move]]:
        """Return where to go, and the transitions to be told; under the run's condition.

        Args:
            move: What the table says.
            ended: The state that has just ended; None at the start and after a pause.
            moved: The move has not been told.
        """
        container = self.container
        left, outcome, target, kind = move
        moves: list[_Move] = []
        while True:
            self._settle_cut(ended)
            if self.forced is not None and self.forced[0] is ended:
                node, outcome = self.forced
                target, moved, kind = node.target(outcome), True, 'forced'
                self._drop_requests(node)
            elif ended is not None:
                target, moved = self._sort_requests(ended, outcome, target)
            if ended is not None and ended.priority > LOWEST and target is not ended:
                target, kind = self._leave_branch(target, kind)
            if self.forced is None or self.forced[0] is not target:
                break
            # Forced before it began.
            if moved:
                moves.append(_Move(left, outcome, target, kind))
            left = ended = self.forced[0]
        if container.preempt_requested() and isinstance(target, Node):
            self._preempt_next(target)
        elif self.suspending and isinstance(target, Node):
            container.fsm_history = self._history(target)
            if moved and left is not None:
                moves.append(_Move(left, outcome, target, kind))
            return ASIDE, moves
        elif container.fsm_raised and not container.preempt_requested():
            urgent = container.fsm_take_raised(target.priority)
            if urgent is not None:
                self.saved = (*self.saved, target)
                target, kind, moved = container.fsm_table[urgent.label], 'interrupt', True
        if control.is_shutdown():
            self.stopped = target
            return SHUTDOWN, moves
        if moved:
            moves.append(_Move(left, outcome, target, kind))
        return target, moves

    def _settle_cut(self, ended: Node | None) -> None:
        """Take the request to make way back from a state that had not begun when it came."""
        cut = self.cut
        if cut is not None and cut is not ended:
            cut.state.fsm_recall_suspend()
            if self.preempted is cut:
                self.preempted = None  # It is asked again.
            self.cut = None

    def _sort_requests(
        self, left: Node, outcome: Any, target: Node | Exit
    ) -> tuple[Node | Exit, bool]:
        """Settle what was asked of the state that ended: a preempt, or to make way.

        Returns:
            Where to go, and whether that is a transition; a state that made way is not left.
        """
        container, state, cut, made_way = self.container, left.state, self.cut, False
        preempted = container.preempt_requested()
        forced_next = self.forced is not None and self.forced[0] is target
        asked = self.preempted is left
        gone = self.gone is left
        # A state that was left behind keeps the request, and has not ignored it any longer.
        pending = state.preempt_requested() and not gone
        self.cut = self.gone = None
        if asked:
            self.preempted = None
        if cut is left and isinstance(state, Container):
            # One that makes way is suspended; any other outcome is its own.
            state.fsm_aside = False
            cut = None
        if cut is left and outcome is not SUSPENDED and (pending or not asked):
            # With both asked and one still pending, what it served was to make way.
            # Whoever forces the next state's outcome has seen this one end.
            made_way = (not pending or outcome == 'preempted') and not forced_next
            if not gone:
                state.recall_preempt()
        elif asked and pending:
            state.recall_preempt()
        elif asked and preempted:
            container.service_preempt()
        if made_way:
            target = left
        stays = made_way or outcome is SUSPENDED
        if stays:
            self.repeat = True
        else:
            state.fsm_progress = None
            if preempted and target is left:
                target = self._end_of_loop(outcome, target)
        return target, not stays

    def _end_of_loop(self, outcome: Any, target: Node | Exit) -> Node | Exit:
        """Return where a preempt leads that came while a state led to itself; an iterator ends."""
        return target

    def _drop_requests(self, left: Node) -> None:
        left.state.recall_preempt()
        left.state.fsm_forget()
        self.forced = self.preempted = self.cut = None

    def _preempt_next(self, target: Node) -> None:
        """Ask the next state to stop, because the last one did not acknowledge the preempt."""
        if self.preempted is not target:
            if self.preempted is not None:
                self.preempted.state.recall_preempt()
            self.preempted = target
            self.thread.asked()
            target.state.request_preempt()

    def _stands_still(self, target: Node | Exit) -> bool:
        """Tell whether the machine is paused here; takes one step if it may."""
        steering = self.run.control
        if not steering.paused or self.suspending:
            return False
        if not isinstance(target, Node) or target.is_container:
            return False
        if any(other.container.preempt_requested() for other in self.thread.stack):
            return False
        if steering.steps:
            steering.steps -= 1
            return False
        return True

    def _wants_attention(self, target: Node | Exit) -> bool:
        container = self.container
        return bool(
            container.preempt_requested()
            or container.fsm_raised
            or self.saved
            or self.suspending
            or self.cut
            or self.forced
            or self.run.control.paused
            or (isinstance(target, Node) and target.state.fsm_progress)
        )

    def _leave_branch(self, target: Node | Exit, kind: str) -> tuple[Node | Exit, str]:
        """Go back to where the interrupt came, or forget that place."""
        if target is RESUMPTION:
            *saved, target = self.saved
            self.saved = tuple(saved)
            return target, 'resume'
        for node in self.saved:
            if isinstance(node, Node):
                node.state.fsm_forget()
        self.saved = ()
        return target, kind

    # Telling.

    def _tell(self, move: _Move) -> None:
        """Tell trace, log and callbacks of a transition."""
        container, run = self.container, self.run
        left, outcome, target, kind = move
        if left is None:
            if run.control.trace is not None:
                step = SpecialStep(self.path, '', target.label, kind or 'start')
                self.note((step, '', run.now(), NO_USERDATA))
            return
        if run.control.trace is not None:
            kind = target.kind if target.is_exit else kind or 'transition'
            step = SpecialStep(self.path, left.label, target.label, kind)
            self.note((step, outcome, run.now(), raw(container.userdata).copy()))
        if run.chatty:
            self._log(left, outcome, target)
        if target.is_exit:
            container.call_termination_cbs([left.label], target.label)
        else:
            container.call_transition_cbs()

    def _log(self, left: Node, outcome: Any, target: Node | Exit) -> None:
        verb = 'ends' if target.is_exit else 'goes on'
        log.loginfo(f"'{self.path}' {verb}: '{left.label}' : '{outcome}' --> '{target.label}'")

    # What others want; under the run's condition.

    def preempt(self) -> None:
        """Ask the state that runs to stop."""
        self.attention = True
        current = self.current
        if isinstance(current, Node) and self.preempted is not current:
            self.preempted = current
            self.thread.asked()
            current.state.request_preempt()
        if self.run.control.paused:
            self.run.condition.notify_all()

    def interrupted(self) -> None:
        """Make way for the container's raised interrupts."""
        self.attention = True
        if self.container.fsm_urgent(self.current.priority):
            self._cut()
        if self.run.control.paused:
            self.run.condition.notify_all()

    def suspend(self) -> None:
        """Have the container put aside with its history."""
        self.suspending = self.attention = True
        self._cut()

    def _cut(self) -> None:
        current = self.current
        if isinstance(current, Node) and self.cut is not current:
            self.cut = current
            self.thread.asked()
            current.state.fsm_suspend()

    def where(self) -> History | None:
        """Return where the container would go on if its process ended now."""
        if self.current is ASIDE:
            return self.container.fsm_history
        return self._history(self.stopped if self.current is SHUTDOWN else self.current)

    def _history(self, target: Node | Exit) -> History:
        """Return where to go on when the container is put aside before `target`."""
        return History(
            target.label,
            target.is_exit,
            [(node.label, node.is_exit) for node in self.saved],
            self.index,
            self.repeat,
            items=self.items,
        )

    def active_labels(self) -> list[str]:
        """Return the label of the state that runs; empty when none does."""
        current = self.current
        return [] if current.is_exit else [current.label]
