"""The execution of a container: the loop over its states.

Most transitions need only the loop, `Frame._run_from`. It looks at one flag after each state. When
something beside the next state wants to be looked at (`attention`), `_attend` passes preempts on,
lets interrupts cut in and resumes from them, forces outcomes, and stands still while the machine is
paused.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from state_machines import execution, log
from state_machines.exceptions import InvalidStateError, SmachError
from state_machines.execution import ExecutionThread, LeftBehindError
from state_machines.nodes import LOWEST, RESUMPTION, SUSPENDED, Exit, Node, Noted
from state_machines.state import State, this_thread
from state_machines.timeouts import settled
from state_machines.userdata import raw

if TYPE_CHECKING:
    from state_machines.container import Container

SHUTDOWN = Exit('shutdown')
"""Where a run goes that the shutdown check ended."""
ASIDE = Exit('aside')
"""Where a run goes that was put aside."""


@dataclass
class History:
    """Where a container that was put aside goes on.

    Attributes:
        current: Label of the state, or of the outcome when `leaving`; empty for all states of a
            concurrence.
        leaving: `current` is an outcome of the container.
        saved: Of the interrupts under way, where each goes on: (label, leaving).
        index: How many items an iterator had begun, the current one included.
        repeat: The current item had not ended.
        outcomes: Of a concurrence's children that had ended.
    """

    current: str = ''
    leaving: bool = False
    saved: list[tuple[str, bool]] = field(default_factory=list)
    index: int = 0
    repeat: bool = True
    outcomes: dict[str, str] = field(default_factory=dict)
    # An iterator suspended in this process goes on with its own generator.
    items: Any = None


class Move(NamedTuple):
    """A transition to be told: the state left (None at the start), its outcome, where to, kind."""

    left: Node | None
    outcome: Any
    target: Node | Exit
    kind: str


class Answer(NamedTuple):
    """What the end of a state says of what it was asked.

    Attributes:
        made_way: It stopped for an interrupt, and is executed again.
        served: It stopped for the preempt.
    """

    made_way: bool
    served: bool


def answer_of(state: State, outcome: Any, *, preempted: bool, cut: bool, gone: bool) -> Answer:
    """Tell what a state's end answers, and take back what it did not acknowledge.

    One flag stands for both requests. So a state that was asked for both, and acknowledged once,
    served the preempt if nothing is pending, and else made way.

    Args:
        state: The state, which has ended.
        outcome: What it ended with.
        preempted: It was asked to stop for good.
        cut: It was asked to make way for an interrupt.
        gone: It was left behind: it keeps the request, so that it ends some time.
    """
    pending = state.preempt_requested() and not gone
    if pending and (preempted or (cut and outcome is not SUSPENDED)):
        state.recall_preempt()
    # A container that makes way is suspended; any other outcome is its own.
    cut = cut and not state.fsm_suspends
    if outcome is SUSPENDED:
        made_way = True
    elif pending:
        made_way = cut and outcome == 'preempted'
    else:
        made_way = cut and not preempted
    return Answer(made_way, served=preempted and not pending)


class Frame:
    """One execution of a container.

    The thread that executes writes `current` first and looks at `attention` after; a thread that
    wants something raises `attention` first and looks at `current` after. So one of the two always
    sees the other, and the loop needs no lock. Everything else is touched under the machine's
    condition only.

    Args:
        container: Whose execution it is.
        thread: The logical thread it belongs to.
        path: The container's path.
        current: The node it begins with.
        parent_ud: The parent's userdata.

    Attributes:
        control: The control of the machine it belongs to.
        current: The node that executes, or the exit that was taken.
        attention: Something beside the next state wants to be looked at.
        stale: The machine went on without the thread that runs this frame.
        preempted: The node whose state was last asked to stop because of a preempt.
        cut: The node whose state was asked to stop because of an interrupt.
        suspending: The parent wants the container put aside.
        gone: The node whose state was left behind.
        forced: A node, and the outcome to take in place of the one that its state returns.
        ended: The execution is over. The container keeps the frame until its parent has taken note,
            so that a checkpoint taken in between does not take it for one that has not begun.
        saved: Where to go on after each of the interrupts under way.
        stopped: Where the shutdown check ended the run.
        watches_threads: It watches threads of its own, which have bounds of their own.
    """

    # Class attributes: most executions of a container need none of them.
    attention = False
    stale = False
    preempted: Node | None = None
    cut: Node | None = None
    suspending = False
    gone: Node | None = None
    forced: tuple[Node, str] | None = None
    ended = False
    saved: tuple[Node | Exit, ...] = ()
    stopped: Node | Exit = SHUTDOWN
    watches_threads = False

    def __init__(
        self,
        container: Container,
        thread: ExecutionThread,
        path: str,
        current: Node | Exit,
        parent_ud: Any,
    ) -> None:
        self.container = container
        self.thread = thread
        self.control = thread.control
        self.path = path
        self.current = current
        self.parent_ud = parent_ud

    # From the beginning to the end.

    def execute(self, history: History | None) -> Any:
        """Run the container to its outcome, or to `SUSPENDED`."""
        container, control = self.container, self.control
        if history is None:
            container.fsm_copy_input_keys(self.parent_ud)
        else:
            self.go_on_from(history)
        if control.chatty:
            verb = 'starts in' if history is None else 'goes on in'
            place = ', '.join(map(repr, self.active_labels())) or repr(self.current.label)
            keys = sorted(container.userdata.keys())
            log.loginfo(f"'{self.path}' {verb} {place} with userdata {keys}")
        if history is None and container.fsm_start_cbs:
            container.call_start_cbs()
        target = self.current
        if (
            container.preempt_requested()
            or container.fsm_raised
            or self.attention
            or self.suspending
            or control.paused
            or history is not None
            or execution.shutdown_check is not None
        ):
            target = self._attend(None, None, target)
        elif control.trace is not None:
            self.tell(Move(None, None, target, 'start'))
        return self._run_from(target)

    def to_its_end(self, run: Callable[[], Any]) -> Any:
        """Call what runs the container to its end; the frame leaves this thread's stack then."""
        stack = this_thread.stack
        try:
            return run()
        except BaseException:
            if self.container.fsm_frame is self:
                self.container.fsm_frame = None
            raise
        finally:
            self.ended = True
            if stack and stack[-1] is self:
                stack.pop()

    def run_on(self, outcome: Any) -> Any:
        """Go on as if the current state had just returned `outcome`, and run to the end."""
        node = self.current
        assert isinstance(node, Node)
        outcome = settled(self, outcome)
        self.current = target = node.target(outcome)
        node.release()
        return self._run_from(self._attend(node, outcome, target))

    def successor(self) -> Self:
        """Return a copy for the thread that takes this execution over."""
        frame = copy.copy(self)
        frame.attention, frame.gone = False, None
        return frame

    def last_outcomes(self) -> Iterable[str]:
        """Return what the logical thread may end with whose outermost frame this is."""
        return self.container.get_registered_outcomes()

    def hold(self) -> None:
        """Be the execution of the container."""
        self.container.fsm_frame = self

    def go_on_from(self, history: History) -> None:
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

    def _run_from(self, target: Any) -> Any:
        """Execute states from `target` on until one leads out of the container; the outcome."""
        container, control = self.container, self.control
        data, now = container.fsm_data, control.now
        trace, callbacks, chatty = control.trace, container.fsm_transition_cbs, control.chatty
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
                trace, chatty = control.trace, control.chatty
            elif trace is not None or callbacks or chatty or execution.shutdown_check is not None:
                if execution.is_shutdown():
                    self.stopped = target
                    self.current = told = target = SHUTDOWN
                    break
                if trace is not None:
                    trace((node, outcome, now(), data.copy()))
                if chatty:
                    self._log(node, outcome, target)
                if callbacks and not target.is_exit:
                    container.call_transition_cbs()
        if target is not told and container.fsm_termination_cbs:
            container.call_termination_cbs([node.label], target.label)
        if target is ASIDE:
            return SUSPENDED
        container.fsm_copy_output_keys(self.parent_ud)
        if target is SHUTDOWN:
            return self._shut_down()
        return target.label

    def _shut_down(self) -> Any:
        """End with None; below the root, leave that to the parent, which sees the check, too."""
        container = self.container
        if self.thread.stack[0] is not self:
            # What runs beside it may save a checkpoint yet.
            container.fsm_history = self.where()
            return SUSPENDED
        for child in container.fsm_children().values():
            child.fsm_forget()
        return None

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
        control, stood, still = self.control, False, False
        while True:
            with control.condition:
                paused = control.paused and not control.steps
                if still and paused and not (self.attention or self.stale):
                    control.condition.wait()
                if self.stale:
                    raise LeftBehindError
                self.thread.asked_at = None  # The state that was asked has returned.
                self.attention = False
                target, moves = self._decide(left, outcome, target, stood=stood)
                self.current = target
                still = self._stands_still(target)
                self.attention = self._wants_attention(target)
            if stood and not still and not moves:
                # The pause is no part of the duration of what begins now.
                moves = [Move(None, None, target, 'entered')]
            # Told before a pause, and not under the condition: callbacks may take their time.
            for move in moves:
                self.tell(move)
            if not still:
                return target
            stood, outcome = True, ''
            left = target  # type: ignore[assignment]

    def _decide(
        self, left: Node | None, outcome: Any, target: Node | Exit, *, stood: bool
    ) -> tuple[Node | Exit, list[Move]]:
        """Return where to go, and the transitions to be told; under the machine's condition.

        Args:
            left: The state that ended, or before which the machine stood; None at the start.
            outcome: What it returned.
            target: Where that leads by the table.
            stood: The machine stood here in a pause: nothing has ended since.
        """
        container, moves = self.container, []
        ended = None if stood else left
        move = None if stood else Move(left, outcome, target, '')
        while True:
            self._settle_cut(ended)
            if ended is not None:
                move = self._leave(ended, outcome, target)
                target = ended if move is None else move.target
            if self.forced is None or self.forced[0] is not target:
                break
            # Forced before it began.
            if move is not None:
                moves.append(move)
            left = ended = self.forced[0]
        if move is not None:
            outcome = move.outcome
        preempted = container.preempt_requested()
        if preempted and isinstance(target, Node):
            self._preempt_next(target)
        elif self.suspending and (isinstance(target, Node) or container.fsm_raised):
            # At its end, too, while interrupts are to run before that: they wait with it.
            container.fsm_history = self.history_before(target)
            return ASIDE, moves if move is None or left is None else [*moves, move]
        elif container.fsm_raised and not preempted:
            urgent = container.fsm_take_raised(target.priority)
            if urgent is not None:
                self.saved = (*self.saved, target)
                target = container.fsm_table[urgent.label]
                move = Move(left, outcome, target, 'interrupt')
        if execution.is_shutdown():
            self.stopped = target
            return SHUTDOWN, moves
        return target, moves if move is None else [*moves, move]

    def _settle_cut(self, ended: Node | None) -> None:
        """Take the request to make way back from a state that had not begun when it came."""
        cut = self.cut
        if cut is not None and cut is not ended:
            if not cut.state.fsm_suspends:
                cut.state.recall_preempt()
            if self.preempted is cut:
                self.preempted = None  # It is asked again.
            self.cut = None

    def _leave(self, node: Node, outcome: Any, target: Node | Exit) -> Move | None:
        """Settle what was asked of the state that ended, and leave it.

        Returns:
            The transition; None for a state that made way, which is not left.
        """
        if self.forced is not None and self.forced[0] is node:
            outcome, kind = self.forced[1], 'forced'
            target = node.target(outcome)
            node.state.recall_preempt()
            node.state.fsm_forget()
            self.forced = self.preempted = self.cut = None
        else:
            answer = self._answer_of(node, outcome)
            preempted = self.container.preempt_requested()
            if answer.served and preempted:
                self.container.service_preempt()
            # Whoever forces the next state's outcome has seen this one end.
            forced_next = self.forced is not None and self.forced[0] is target
            if answer.made_way and not forced_next:
                return None
            kind, node.state.fsm_progress = '', None
            if preempted and target is node:
                target = self._end_of_loop(outcome, target)
        if node.priority > LOWEST:
            return self._leave_branch(Move(node, outcome, target, kind))
        return Move(node, outcome, target, kind)

    def _answer_of(self, node: Node, outcome: Any) -> Answer:
        """Tell what a state's end answers; nothing is asked of it any more."""
        asked, cut, gone = self.preempted is node, self.cut is node, self.gone is node
        self.cut = self.gone = None
        if asked:
            self.preempted = None
        return answer_of(node.state, outcome, preempted=asked, cut=cut, gone=gone)

    def _leave_branch(self, move: Move) -> Move:
        """Go back to where the interrupt came, or forget that place."""
        if move.target is RESUMPTION:
            *saved, target = self.saved
            self.saved = tuple(saved)
            return move._replace(target=target, kind='resume')
        for node in self.saved:
            if isinstance(node, Node):
                node.state.fsm_forget()
        self.saved = ()
        return move

    def _end_of_loop(self, outcome: Any, target: Node | Exit) -> Node | Exit:
        """Return where a preempt leads that came while a state led to itself; an iterator ends."""
        return target

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
        steering = self.control
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
            or self.control.paused
            or (isinstance(target, Node) and target.state.fsm_progress)
        )

    # Telling.

    def tell(self, move: Move) -> None:
        """Tell trace, log and callbacks of a transition."""
        container, control = self.container, self.control
        left, outcome, target, kind = move
        if left is None:
            self.note('', '', target.label, kind or 'start')
            return
        kind = target.kind if target.is_exit else kind or 'transition'
        self.note(left.label, outcome, target.label, kind)
        if control.chatty:
            self._log(left, outcome, target)
        if target.is_exit:
            container.call_termination_cbs([left.label], target.label)
        else:
            container.call_transition_cbs()

    def _log(self, left: Node, outcome: Any, target: Node | Exit) -> None:
        verb = 'ends' if target.is_exit else 'goes on'
        log.loginfo(f"'{self.path}' {verb}: '{left.label}' : '{outcome}' --> '{target.label}'")

    def note(self, source: str, outcome: Any, target: str, kind: str) -> None:
        """Tell the run's trace, if there is one, of a transition; see `Noted`."""
        trace = self.control.trace
        if trace is not None:
            now, userdata = self.control.now(), raw(self.container.userdata).copy()
            trace(Noted(self.path, source, str(outcome), target, now, userdata, kind))

    # What others want; under the machine's condition.

    @property
    def wanted(self) -> bool:
        """Whether somebody wants the current state to end."""
        return bool(
            self.container.preempt_requested()
            or self.cut is not None
            or self.suspending
            or self.forced is not None
        )

    def preempt(self) -> None:
        """Ask the state that runs to stop."""
        self.attention = True
        current = self.current
        if isinstance(current, Node) and self.preempted is not current:
            self.preempted = current
            self.thread.asked()
            current.state.request_preempt()
        if self.control.paused:
            self.control.condition.notify_all()

    def interrupted(self) -> None:
        """Make way for the container's raised interrupts."""
        self.attention = True
        priority = self.current.priority
        if any(branch.priority > priority for branch in self.container.fsm_raised):
            self.cut_short()
        if self.control.paused:
            self.control.condition.notify_all()

    def suspend(self) -> None:
        """Have the container put aside with its history."""
        self.suspending = self.attention = True
        self.cut_short()

    def cut_short(self) -> None:
        current = self.current
        if isinstance(current, Node) and self.cut is not current:
            self.cut = current
            self.thread.asked()
            current.state.fsm_suspend()

    def where(self) -> History | None:
        """Return where the container would go on if its process ended now."""
        if self.current is ASIDE:
            return self.container.fsm_history
        return self.history_before(self.stopped if self.current is SHUTDOWN else self.current)

    def history_before(self, target: Node | Exit) -> History:
        """Return where to go on when the container is put aside before `target`."""
        return History(
            target.label,
            target.is_exit,
            [(node.label, node.is_exit) for node in self.saved],
        )

    def active_labels(self) -> list[str]:
        """Return the label of the state that runs; empty when none does."""
        current = self.current
        return [] if current.is_exit else [current.label]

    def abandoned(self, *, for_good: bool) -> None:
        """Note that the machine went on without the thread that runs this frame.

        Args:
            for_good: No other thread takes the execution over.
        """
        self.stale = self.attention = True
        self.container.fsm_frame = None
        if for_good:
            self.container.recall_preempt()
