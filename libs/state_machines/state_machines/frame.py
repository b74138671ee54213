"""The execution of containers: the loop over states, and what comes between two of them.

`run` is the loop. It executes states one after another, goes into a container by putting a `Frame`
on the thread's stack, and comes back out of it by taking that frame off. So a machine in a machine
costs no call of Python, and how deep machines are nested is bounded by memory.

Most transitions need only the loop. It looks at one flag after each state. When something beside
the next state wants to be looked at (`Frame.attention`), `Frame.attend` passes preempts on, lets
interrupts in and resumes from them, forces outcomes, and stands still while the machine is paused.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Iterable
from typing import Any, NamedTuple, Self

from state_machines import execution, log
from state_machines.autonomy import Question
from state_machines.exceptions import InvalidStateError, SmachError
from state_machines.execution import Control, ExecutionThread, LeftBehindError, Watch
from state_machines.program import (
    LOWEST,
    RESUMPTION,
    SUSPENDED,
    ContainerProgram,
    Exit,
    History,
    Noted,
    StateNode,
)
from state_machines.state import State
from state_machines.userdata import Remapper, raw

SHUTDOWN = Exit('shutdown')
"""Where a run goes that the shutdown check ended."""
ASIDE = Exit('aside')
"""Where a run goes that was put aside."""
AGAIN: Any = object()
"""What `Frame.after` returns for a state that is to be executed once more."""


# The loop.

_entry_lock = threading.Lock()


def run(stack: list[Any], base: int) -> Any:
    """Execute the containers on a thread's stack to the end of the one at `base`.

    Args:
        stack: The frames that the present thread began with, the innermost last. Whoever takes the
            execution over gives the logical thread another list, and marks these frames.
        base: Index of the frame whose end is waited for.

    Returns:
        Its outcome, or `SUSPENDED`.
    """
    try:
        return _run(stack, base)
    except BaseException:
        _unwind(stack, base)
        raise


def _unwind(stack: list[Any], base: int) -> None:
    """Take the frames from `base` on off the stack: an error ended them."""
    for frame in stack[base:]:
        if frame.program.frame is frame:
            frame.program.frame = None
        frame.ended = True
    thread = stack[base].thread if base < len(stack) else None
    if thread is not None and thread.watches:
        thread.end_watches(base)
    del stack[base:]


def _run(stack: list[Any], base: int) -> Any:
    # This function is the engine's speed. What it needs of a frame is in local variables, which are
    # set anew whenever it goes into a container or comes out of one.
    frame: Frame = stack[-1]
    thread, control = frame.thread, frame.thread.control
    now, trace, chatty = control.now, control.trace, control.chatty
    program = frame.program
    data, callbacks = program.data, program.transition_cbs
    target: Any = frame.current
    told: Any = target
    node: Any = None
    entry: Any = None
    while True:
        if target.is_exit:
            # The container ends.
            if target is not told and program.termination_cbs:
                frame.container.call_termination_cbs([node.label], target.label)
            told = None
            if target is ASIDE:
                outcome = SUSPENDED
            elif target is SHUTDOWN:
                outcome = frame.shut_down()
            else:
                outcome = target.label
            depth = len(stack) - 1
            if depth == base:
                if target is not ASIDE:
                    copy_output_keys(frame.container, frame.parent_ud)
                frame.ended = True
                stack.pop()
                return outcome
            inner, inner_data = frame, data
            frame = stack[depth - 1]
            program, node = frame.program, frame.current
            data, callbacks = program.data, program.transition_cbs
            entry = node.entry
            if target is not ASIDE:
                if entry.plain_keys:
                    for name, outside in entry.outputs:
                        try:
                            data[outside] = inner_data[name]
                        except KeyError:
                            warn_of_output(inner.container, name)
                else:
                    copy_output_keys(inner.container, inner.parent_ud)
            inner.ended = True
            stack.pop()
            if entry.hooked:
                outcome = frame.after(node, outcome)
                if outcome is AGAIN:
                    target = node
                    entry.program.frame = None
                    continue
        else:
            node = target
            entry = node.entry
            if entry is None:
                try:
                    outcome = node.execute(node.view)
                except SmachError:
                    raise
                except Exception as error:
                    raise node.user_fault(error) from error
            else:
                outcome = frame.before(node) if entry.hooked else None
                if outcome is not None:
                    # Nothing is left to be executed.
                    pass
                elif entry.program is None:
                    outcome = call(node)
                    if entry.hooked:
                        outcome = frame.after(node, outcome)
                        if outcome is AGAIN:
                            continue
                else:
                    # Into a container.
                    frame = enter(stack, thread, entry.program, node.path, node.view, frame)
                    outer_data, program = data, frame.program
                    data, callbacks = program.data, program.transition_cbs
                    trace = control.trace
                    if program.history is None:
                        if entry.plain_keys:
                            for name, outside in entry.inputs:
                                try:
                                    data[name] = outer_data[outside]
                                except KeyError:
                                    warn_of_input(frame.container, name)
                        else:
                            copy_input_keys(frame.container, node.view)
                        if not (
                            trace is not None
                            or chatty
                            or program.start_cbs
                            or frame.attention
                            or frame.container.fsm_interrupt is not None
                            or program.raised
                            or frame.suspending
                            or control.paused
                            or execution.shutdown_check is not None
                        ):
                            target = frame.current
                            continue
                    target = told = frame.begin()
                    trace, chatty = control.trace, control.chatty
                    continue
        try:
            target = node.targets[outcome]
        except (KeyError, TypeError):
            target = node.target(outcome)
        frame.current = target
        if entry is not None and entry.program is not None:
            entry.program.frame = None
        if frame.attention:
            told = target = frame.attend(node, outcome, target)
            trace, chatty = control.trace, control.chatty
        elif trace is not None or callbacks or chatty or execution.shutdown_check is not None:
            if execution.is_shutdown():
                frame.stopped = target
                frame.current = told = target = SHUTDOWN
                continue
            if trace is not None:
                trace((node, outcome, now(), data.copy()))
            if chatty:
                frame.log_move(node, outcome, target)
            if callbacks and not target.is_exit:
                frame.container.call_transition_cbs()


def call(node: StateNode) -> Any:
    """Execute a state that is no container; its outcome.

    Raises:
        InvalidUserCodeError: Its code raised.
    """
    try:
        return node.execute(node.view)
    except SmachError:
        raise
    except Exception as error:
        raise node.user_fault(error) from error


def enter(
    stack: list[Any],
    thread: ExecutionThread,
    program: ContainerProgram,
    path: str,
    parent_ud: Any,
    outer: Frame | None,
) -> Frame:
    """Put a frame for a container on the stack.

    Args:
        stack: The present thread's frames.
        thread: The logical thread.
        program: The container's program.
        path: Where the container is.
        parent_ud: The parent's userdata.
        outer: The frame around it, if there is one.

    Raises:
        InvalidStateError: The container is running already.
        InvalidTransitionError: It cannot run.
        LeftBehindError: The machine went on without the present thread.
    """
    before = program.frame
    if before is not None and not before.ended:
        raise InvalidStateError(f"'{program.path}' is running already")
    clock = thread.control.clock
    if not program.is_current(path, clock):
        program.make(path, clock)
    frame: Frame = program.container.fsm_frame_type(program, thread, parent_ud)
    with _entry_lock:
        # Another thread may enter it, too, as another state of a concurrence.
        if program.frame is not before:
            raise InvalidStateError(f"'{program.path}' is running already")
        program.frame = frame
    if outer is not None and outer.making_way is outer.current:
        # It was asked to make way before it could be seen that it had begun.
        frame.suspending = True
    stack.append(frame)
    # Whoever takes the thread over gives it another stack first, and looks at this one after.
    if stack is not thread.stack:
        raise LeftBehindError
    return frame


def execute_root(
    stack: list[Any], thread: ExecutionThread, program: ContainerProgram, ud: Any
) -> Any:
    """Execute a container with whatever userdata it is given; its outcome or `SUSPENDED`.

    Args:
        stack: The present thread's frames.
        thread: The logical thread.
        program: The container's program.
        ud: Userdata that input keys come from and output keys go to.
    """
    base = len(stack)
    outer = stack[-1] if stack else None
    path = outer.current.path if outer is not None else thread.path
    try:
        frame = enter(stack, thread, program, path, ud, outer)
        if program.history is None:
            copy_input_keys(frame.container, ud)
        frame.begin()
    except BaseException:
        _unwind(stack, base)
        raise
    return run(stack, base)


# Userdata in and out.


def copy_input_keys(container: Any, parent_ud: Any) -> None:
    """Take a container's input keys over from its parent's userdata, whatever kind that is."""
    keys = container.get_registered_input_keys()
    if parent_ud is None or not keys:
        return
    if not isinstance(parent_ud, Remapper):
        parent_ud = Remapper(parent_ud, keys)
    for key in parent_ud.fsm_copy_to(container.fsm_program.data, keys):
        warn_of_input(container, key)


def copy_output_keys(container: Any, parent_ud: Any) -> None:
    """Hand a container's output keys over to its parent's userdata, whatever kind that is."""
    keys = container.get_registered_output_keys()
    if parent_ud is None or not keys:
        return
    if not isinstance(parent_ud, Remapper):
        parent_ud = Remapper(parent_ud, (), keys)
    for key in parent_ud.fsm_take_from(container.fsm_program.data, keys):
        warn_of_output(container, key)


def warn_of_input(container: Any, key: str) -> None:
    """Say that an input key is not there."""
    log.logwarn(f"'{container.get_name()}' starts without its input key '{key}': nobody set it")


def warn_of_output(container: Any, key: str) -> None:
    """Say that an output key is not there."""
    log.logwarn(f"'{container.get_name()}' ends without its output key '{key}': nobody set it")


# What is between two states.


class Move(NamedTuple):
    """A transition to be told: the state left (None at the start), its outcome, where to, kind."""

    left: StateNode | None
    outcome: Any
    target: StateNode | Exit
    kind: str


class Answer(NamedTuple):
    """What the end of a state says of what it was asked.

    Attributes:
        made_way: It stopped for an interrupt, and is executed again.
        served: It stopped for the preempt.
    """

    made_way: bool
    served: bool


def answer_of(
    state: State, outcome: Any, *, preempted: bool, making_way: bool, left: bool
) -> Answer:
    """Tell what a state's end answers, and take back what it did not acknowledge.

    One flag stands for both requests. So a state that was asked for both, and acknowledged once,
    served the preempt if nothing is pending, and else made way.

    Args:
        state: The state, which has ended.
        outcome: What it ended with.
        preempted: It was asked to stop for good.
        making_way: It was asked to make way for an interrupt.
        left: It was left behind: it keeps the request, so that it ends some time.
    """
    pending = state.preempt_requested() and not left
    if pending and (preempted or (making_way and outcome is not SUSPENDED)):
        state.recall_preempt()
    # A container that makes way is suspended; any other outcome is its own.
    making_way = making_way and not state.fsm_suspends
    if outcome is SUSPENDED:
        made_way = True
    elif pending:
        made_way = making_way and outcome == 'preempted'
    else:
        made_way = making_way and not preempted
    return Answer(made_way, served=preempted and not pending)


class Frame:
    """One execution of a container.

    The thread that executes writes `current` first and looks at `attention` after; a thread that
    wants something raises `attention` first and looks at `current` after. So one of the two always
    sees the other, and the loop needs no lock. Everything else is touched under the machine's
    condition only.

    Args:
        program: The container's program.
        thread: The logical thread it belongs to.
        parent_ud: The parent's userdata.

    Attributes:
        container: The container.
        current: The node that executes, or the exit that was taken.
        attention: Something beside the next state wants to be looked at.
        abandoned: The machine went on without the thread that runs this frame.
        preempted: The node whose state was last asked to stop because of a preempt.
        making_way: The node whose state was asked to make way for an interrupt.
        suspending: The parent wants the container put aside.
        left: The node whose state was left behind.
        forced: A node, and the outcome to take in place of the one that its state returns.
        ended: The execution is over. The container keeps the frame until its parent has taken note,
            so that a checkpoint taken in between does not take it for one that has not begun.
        saved: Where to go on after each of the interrupts under way.
        stopped: Where the shutdown check ended the run.
        watch: The limits at work on the state that executes.
        attempt: How often that was executed before, because of its limits.
        question: The transition that waits for a person.
        held: A state that has ended and its outcome, whose question an interrupt put off.
        watches_threads: It watches threads of its own, which have bounds of their own.
    """

    # Class attributes: most executions of a container need none of them.
    attention = False
    abandoned = False
    preempted: StateNode | None = None
    making_way: StateNode | None = None
    suspending = False
    left: StateNode | None = None
    forced: tuple[StateNode, str] | None = None
    ended = False
    saved: tuple[StateNode | Exit, ...] = ()
    stopped: StateNode | Exit = SHUTDOWN
    watch: Watch | None = None
    attempt = 0
    question: Question | None = None
    held: tuple[StateNode, str] | None = None
    watches_threads = False

    def __init__(self, program: ContainerProgram, thread: ExecutionThread, parent_ud: Any) -> None:
        self.program = program
        self.container: Any = program.container
        self.thread = thread
        self.current: StateNode | Exit = program.first
        self.parent_ud = parent_ud

    @property
    def path(self) -> str:
        """The container's path."""
        return self.program.path

    @property
    def control(self) -> Control:
        """The control of the machine it belongs to."""
        return self.thread.control

    @property
    def condition(self) -> threading.Condition:
        """The machine's condition."""
        return self.thread.control.condition

    # From the beginning to the end.

    def begin(self) -> StateNode | Exit:
        """Go to the first state, or to the one that the history names; return it."""
        container, program, control = self.container, self.program, self.control
        history, program.history = program.history, None
        if history is not None:
            self.go_on_from(history)
        if control.chatty:
            verb = 'starts in' if history is None else 'goes on in'
            place = ', '.join(map(repr, self.active_labels())) or repr(self.current.label)
            keys = sorted(container.userdata.keys())
            log.loginfo(f"'{self.path}' {verb} {place} with userdata {keys}")
        if history is None and program.start_cbs:
            container.call_start_cbs()
        target = self.current
        if (
            container.preempt_requested()
            or program.raised
            or self.attention
            or self.suspending
            or control.paused
            or history is not None
            or execution.shutdown_check is not None
        ):
            target = self.attend(None, None, target)
        elif control.trace is not None:
            self.tell(Move(None, None, target, 'start'))
        return target

    def go_on_after(self, outcome: Any) -> None:
        """Go on as if the current state had just returned `outcome`."""
        node = self.current
        assert isinstance(node, StateNode)
        self.current = target = node.target(outcome)
        node.release()
        self.attend(node, outcome, target)

    def go_on(self, stack: list[Any], outcome: Any) -> Any:
        """As the outermost frame, go on after a state that was left behind, to the end.

        Args:
            stack: The frames for the thread that takes the execution over.
            outcome: What the innermost one's state is taken to have returned.
        """
        try:
            stack[-1].go_on_after(outcome)
        except BaseException:
            _unwind(stack, 0)
            raise
        return run(stack, 0)

    def successor(self) -> Self:
        """Return a copy for the thread that takes this execution over."""
        frame = copy.copy(self)
        # What was asked of the state inside is to be settled when that ends.
        frame.attention, frame.left = True, None
        return frame

    def last_outcomes(self) -> Iterable[str]:
        """Return what the logical thread may end with whose outermost frame this is."""
        outcomes: Iterable[str] = self.container.get_registered_outcomes()
        return outcomes

    def hold(self) -> None:
        """Be the execution of the container."""
        self.program.frame = self

    def go_on_from(self, history: History) -> None:
        """Begin where the container was put aside.

        Raises:
            InvalidStateError: It has no such state any more.
        """
        self.saved = tuple(self.program.place(*saved) for saved in history.saved)
        self.current = self.program.place(history.current, history.leaving)

    def shut_down(self) -> Any:
        """End with None; below the root, leave that to the parent, which sees the check, too."""
        program = self.program
        if self.thread.stack[0] is not self:
            # What runs beside it may save a checkpoint yet.
            program.history = self.where()
            return SUSPENDED
        self.container.fsm_forget()
        return None

    # Around a state with limits.

    def before(self, node: StateNode) -> Any:
        """Put the limits of the state to work that is about to be executed.

        Returns:
            The state's outcome, if there is nothing to execute; else None.
        """
        held, self.held = self.held, None
        if held is not None and held[0] is node:
            # It ended before the interrupt: what is left is the question.
            return self._ask(node, held[1])
        limits = node.limits
        if limits is not None and (limits.timeout is not None or limits.deadline is not None):
            self.watch = self.thread.begin_watch(node, limits)
        return None

    def after(self, node: StateNode, outcome: Any) -> Any:
        """End the limits of a state that returned; its outcome, or `AGAIN` for another attempt."""
        limits = node.limits
        self.thread.check()
        outcome = self._end_watch(node, outcome)
        if (
            limits is None
            or not isinstance(outcome, str)
            or outcome not in limits.failures
            or self.attempt == limits.retry
            or node.state.preempt_requested()
            or self.must_end
        ):
            self.attempt = 0
            return self._ask(node, outcome)
        self.attempt += 1
        log.logwarn(
            f"State '{node.path}' ended with '{outcome}': attempt {self.attempt + 1} of "
            f'{limits.retry + 1}'
        )
        return AGAIN

    def _end_watch(self, node: StateNode, outcome: Any) -> Any:
        """Turn what a state returned after running out of time into the outcome for that."""
        watch, limits = self.watch, node.limits
        if watch is None or limits is None:
            return outcome
        self.watch = None
        self.thread.end_watch(watch)
        if not watch.asked or outcome is SUSPENDED or self.must_end:
            # Whoever else wants it to end sorts the request out.
            return outcome
        if node.state.preempt_requested():
            # It ended by itself; the request came too late or for nothing.
            node.state.recall_preempt()
            if outcome != 'preempted':
                return outcome
        log.logwarn(f"State '{node.path}' was stopped after its timeout of {limits.timeout:g} s")
        return limits.late_outcome

    # Waiting for a person.

    def _ask(self, node: StateNode, outcome: Any) -> Any:
        """Return the outcome to go on with, after a question where the transition needs one."""
        entry, control = node.entry, self.thread.control
        approvals = entry.approvals if entry is not None else None
        approval = approvals.get(outcome) if approvals and isinstance(outcome, str) else None
        if approval is None or approval.level <= control.autonomy:
            return outcome
        with control.lock:
            self.thread.check()
            self.attention = True
            if self.must_end or approval.level <= control.autonomy:
                return self._settle_question(node, outcome, None)
            question = Question(
                node.path,
                outcome,
                node.target(outcome).label,
                approval,
                tuple(each for each in node.targets if isinstance(each, str)),
            )
            self.question = question
            control.fsm_ask(question)
        log.logwarn(f"State '{node.path}': outcome '{outcome}' waits for a person's approval")
        self.note(node.label, outcome, question.target, 'question')
        try:
            if approval.timeout is None:
                question.wake.wait()
            elif control.clock.sleep(approval.timeout, question.wake):
                log.logwarn(
                    f"State '{node.path}': nobody answered for {approval.timeout:g} s, it goes on "
                    f"with '{approval.otherwise}'"
                )
                question.answer = question.answer or approval.otherwise
        finally:
            with control.lock:
                self.question = None
                control.fsm_settle(question)
            self.note(node.label, outcome, question.target, 'question')
        with control.lock:
            self.thread.check()
            return self._settle_question(node, outcome, question.answer)

    def _settle_question(self, node: StateNode, outcome: str, answer: str | None) -> Any:
        """Return the outcome to go on with, the wait being over; under the machine's condition.

        Args:
            node: The state that ended.
            outcome: What it ended with.
            answer: What was chosen, if anything was.
        """
        if answer is not None or self.forced is not None:
            return answer or outcome
        if self.container.preempt_requested():
            if 'preempted' in node.targets:
                node.state.service_preempt()
                return 'preempted'
            return outcome  # The next state is asked to stop.
        if self.making_way is not None or self.suspending:
            node.state.recall_preempt()
            self.held = node, outcome
            return SUSPENDED
        return outcome

    # Between two states.

    def attend(
        self, left: StateNode | None, outcome: Any, target: StateNode | Exit
    ) -> StateNode | Exit:
        """Do what comes between two states beside the transition itself.

        Args:
            left: The state that ended; None at the start.
            outcome: What it returned.
            target: Where that leads by the table.

        Returns:
            Where to go.
        """
        control, stood, still = self.thread.control, False, False
        if left is not None and target.is_exit and self._leave_preempted(left, outcome, target):
            self.tell(Move(left, outcome, target, ''))
            return target
        while True:
            with control.lock:
                paused = control.paused and not control.steps
                if still and paused and not (self.attention or self.abandoned):
                    control.condition.wait()
                if self.abandoned:
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

    def _leave_preempted(self, node: StateNode, outcome: Any, target: StateNode | Exit) -> bool:
        """Leave the container because of a preempt, if nothing else is to be looked at.

        It is what `attend` does in general, for the way on which a preempt ends nested machines.
        """
        container = self.container
        with self.thread.control.lock:
            if (
                self.preempted is not node
                or self.making_way is not None
                or self.left is not None
                or self.forced is not None
                or self.abandoned
                or self.suspending
                or self.saved
                or self.program.raised
                or outcome is SUSPENDED
                or node.priority > LOWEST
                or execution.shutdown_check is not None
            ):
                return False
            self.thread.asked_at = self.preempted = node.state.fsm_progress = None
            if node.state.preempt_requested():
                # It ended by itself: whoever comes next is asked.
                node.state.recall_preempt()
            elif container.preempt_requested():
                container.service_preempt()
            self.current = target
        return True

    def _decide(
        self, left: StateNode | None, outcome: Any, target: StateNode | Exit, *, stood: bool
    ) -> tuple[StateNode | Exit, list[Move]]:
        """Return where to go, and the transitions to be told; under the machine's condition.

        Args:
            left: The state that ended, or before which the machine stood; None at the start.
            outcome: What it returned.
            target: Where that leads by the table.
            stood: The machine stood here in a pause: nothing has ended since.
        """
        container, program, moves = self.container, self.program, []
        ended = None if stood else left
        move = None if stood else Move(left, outcome, target, '')
        while True:
            self._settle_making_way(ended)
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
        if preempted and isinstance(target, StateNode):
            self._preempt_next(target)
        elif self.suspending and (isinstance(target, StateNode) or program.raised):
            # At its end, too, while interrupts are to run before that: they wait with it.
            program.history = self.history_before(target)
            return ASIDE, moves if move is None or left is None else [*moves, move]
        elif program.raised and not preempted:
            urgent = program.take_raised(target.priority)
            if urgent is not None:
                self.saved = (*self.saved, target)
                target = program.table[urgent.label]
                move = Move(left, outcome, target, 'interrupt')
        if execution.is_shutdown():
            self.stopped = target
            return SHUTDOWN, moves
        return target, moves if move is None else [*moves, move]

    def _settle_making_way(self, ended: StateNode | None) -> None:
        """Take the request to make way back from a state that had not begun when it came."""
        node = self.making_way
        if node is not None and node is not ended:
            if not node.state.fsm_suspends:
                node.state.recall_preempt()
            if self.preempted is node:
                self.preempted = None  # It is asked again.
            self.making_way = None

    def _leave(self, node: StateNode, outcome: Any, target: StateNode | Exit) -> Move | None:
        """Settle what was asked of the state that ended, and leave it.

        Returns:
            The transition; None for a state that made way, which is not left.
        """
        if self.forced is not None and self.forced[0] is node:
            outcome, kind = self.forced[1], 'forced'
            target = node.target(outcome)
            node.state.recall_preempt()
            node.state.fsm_forget()
            self.forced = self.preempted = self.making_way = None
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

    def _answer_of(self, node: StateNode, outcome: Any) -> Answer:
        """Tell what a state's end answers; nothing is asked of it any more."""
        preempted, making_way = self.preempted is node, self.making_way is node
        left = self.left is node
        self.making_way = self.left = None
        if preempted:
            self.preempted = None
        return answer_of(node.state, outcome, preempted=preempted, making_way=making_way, left=left)

    def _leave_branch(self, move: Move) -> Move:
        """Go back to where the interrupt came, or forget that place."""
        if move.target is RESUMPTION:
            *saved, target = self.saved
            self.saved = tuple(saved)
            return move._replace(target=target, kind='resume')
        for node in self.saved:
            if isinstance(node, StateNode):
                node.state.fsm_forget()
        self.saved = ()
        return move

    def _end_of_loop(self, outcome: Any, target: StateNode | Exit) -> StateNode | Exit:
        """Return where a preempt leads that came while a state led to itself; an iterator ends."""
        return target

    def _preempt_next(self, target: StateNode) -> None:
        """Ask the next state to stop, because the last one did not acknowledge the preempt."""
        if self.preempted is not target:
            if self.preempted is not None:
                self.preempted.state.recall_preempt()
            self.preempted = target
            self.thread.asked()
            target.state.request_preempt()

    def _stands_still(self, target: StateNode | Exit) -> bool:
        """Tell whether the machine is paused here; takes one step if it may."""
        steering = self.control
        if not steering.paused or self.suspending:
            return False
        if not isinstance(target, StateNode) or target.state.fsm_program is not None:
            return False
        if any(other.container.preempt_requested() for other in self.thread.stack):
            return False
        if steering.steps:
            steering.steps -= 1
            return False
        return True

    def _wants_attention(self, target: StateNode | Exit) -> bool:
        return bool(
            self.container.preempt_requested()
            or self.program.raised
            or self.saved
            or self.suspending
            or self.making_way
            or self.forced
            or self.control.paused
            or (isinstance(target, StateNode) and target.state.fsm_progress)
        )

    # Telling.

    def tell(self, move: Move) -> None:
        """Tell trace, log and callbacks of a transition."""
        container, control = self.container, self.thread.control
        left, outcome, target, kind = move
        if left is None:
            self.note('', '', target.label, kind or 'start')
            return
        kind = target.kind if target.is_exit else kind or 'transition'
        if control.trace is not None:
            self.note(left.label, outcome, target.label, kind)
        if control.chatty:
            self.log_move(left, outcome, target)
        if not target.is_exit:
            container.call_transition_cbs()
        elif self.program.termination_cbs:
            container.call_termination_cbs([left.label], target.label)

    def log_move(self, left: StateNode, outcome: Any, target: StateNode | Exit) -> None:
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
    def must_end(self) -> bool:
        """Whether somebody wants the current state to end."""
        return bool(
            self.container.preempt_requested()
            or self.making_way is not None
            or self.suspending
            or self.forced is not None
        )

    def preempt(self) -> None:
        """Ask what runs to stop: the containers inside, and the state in the innermost one.

        The request goes down level by level, not by calls: the state that waits is woken last, when
        nothing else is left to be done.
        """
        frame: Frame | None = self
        while frame is not None:
            frame.attention = True
            current = frame.current
            if not isinstance(current, StateNode) or frame.preempted is current:
                break
            frame.preempted = current
            frame.thread.asked()
            if frame.question is not None:
                frame.question.wake.set()
            entry = current.entry
            if entry is None or entry.program is None or not entry.relays:
                current.state.request_preempt()
                break
            State.request_preempt(entry.program.container)
            frame = entry.program.frame
        if self.control.paused:
            self.condition.notify_all()

    def interrupted(self) -> None:
        """Make way for the container's raised interrupts."""
        self.attention = True
        priority = self.current.priority
        if any(branch.priority > priority for branch in self.program.raised):
            self.make_way()
        if self.control.paused:
            self.condition.notify_all()

    def suspend(self) -> None:
        """Have the container put aside with its history, and all containers inside."""
        frame: Frame | None = self
        while frame is not None:
            frame.suspending = frame.attention = True
            current = frame.current
            if not isinstance(current, StateNode) or frame.making_way is current:
                return
            frame.making_way = current
            if frame.question is not None:
                frame.question.wake.set()
            program = current.program
            if program is None:
                frame.thread.asked()
                current.state.fsm_suspend()
                return
            frame = program.frame

    def make_way(self) -> None:
        """Ask the state that runs to make way for an interrupt."""
        current = self.current
        if isinstance(current, StateNode) and self.making_way is not current:
            self.making_way = current
            self.thread.asked()
            current.state.fsm_suspend()
            if self.question is not None:
                self.question.wake.set()

    def where(self) -> History | None:
        """Return where the container would go on if its process ended now."""
        if self.current is ASIDE:
            return self.program.history
        return self.history_before(self.stopped if self.current is SHUTDOWN else self.current)

    def history_before(self, target: StateNode | Exit) -> History:
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

    def abandon(self, *, for_good: bool) -> None:
        """Note that the machine went on without the thread that runs this frame.

        Args:
            for_good: No other thread takes the execution over.
        """
        self.abandoned = self.attention = True
        if self.question is not None:
            self.question.wake.set()
        self.program.frame = None
        if for_good:
            self.container.recall_preempt()
