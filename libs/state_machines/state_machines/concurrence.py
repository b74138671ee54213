"""The concurrence: all states at the same time, one outcome made of theirs.

To the loop (`frame`) a concurrence is a container of one state, which stands for all of them.
`ConcurrentFrame` executes that: each state on a logical thread of its own, which the concurrence's
thread watches. `Concurrence` is the container.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Any, Self, Unpack

from state_machines import log
from state_machines.clock import Interrupt
from state_machines.container import Container
from state_machines.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
    describe,
    shown,
)
from state_machines.execution import ExecutionThread, LeftBehindError
from state_machines.frame import AGAIN, Frame, Move, answer_of, call, execute_root, run
from state_machines.program import (
    SUSPENDED,
    ContainerProgram,
    Exit,
    History,
    LimitOptions,
    StateNode,
)
from state_machines.state import State, this_thread
from state_machines.timeouts import leave_behind, supervise

Outcomes = dict[str, str | None]
ChildTerminationCallback = Callable[[Outcomes], bool | Iterable[str] | None]
OutcomeCallback = Callable[[Outcomes], str | None]

ENDED = Exit('')
"""Where every outcome of a concurrence's state leads: it has ended."""


class ChildState(enum.Flag):
    """What one state of a concurrence has been asked, and what its end says to that.

    A state may be asked several things while it runs: by a preempt, and by an interrupt, say.
    """

    RUNS = 0
    """Nothing was asked of it."""
    PREEMPTED = enum.auto()
    """A preempt of the concurrence asked it to stop."""
    STOPPED = enum.auto()
    """The concurrence itself asked it to stop, because another state had ended."""
    MAKES_WAY = enum.auto()
    """An interrupt asked it to make way; it is executed again afterwards."""
    SERVED = enum.auto()
    """It has ended, and acknowledged the preempt."""


class ChildFrame(Frame):
    """One execution of one state of a concurrence, on a logical thread of its own.

    Args:
        within: The execution of the concurrence.
        node: The state's node.
        thread: The logical thread.

    Attributes:
        node: The state's node.
        state: What it was asked.
    """

    state = ChildState.RUNS

    def __init__(self, within: ConcurrentFrame, node: StateNode, thread: ExecutionThread) -> None:
        super().__init__(within.program, thread, None)
        self.current = self.node = node

    def successor(self) -> Self:
        """Return a copy for the thread that takes this execution over."""
        frame = super().successor()
        # Not kept: the two would refer to each other, which is left to no garbage collector.
        within = self.program.frame
        assert isinstance(within, ConcurrentFrame)
        within.replace_child(frame)
        return frame

    def last_outcomes(self) -> Iterable[str]:
        """Return what the logical thread may end with: the state's, not the concurrence's."""
        return self.node.state.get_registered_outcomes()

    def execute(self) -> Any:
        """Execute the state on a thread of its own; its outcome."""
        stack = this_thread.stack
        if self.abandoned:
            raise LeftBehindError
        try:
            return self._execute(stack, AGAIN)
        finally:
            if stack and stack[-1] is self:
                stack.pop()

    def _execute(self, stack: list[Any], outcome: Any) -> Any:
        """Execute the state until it is not to be executed again; its outcome.

        Args:
            stack: The present thread's frames.
            outcome: What it has ended with already, or `AGAIN`.
        """
        node, hooked = self.node, self.node.entry is not None and self.node.entry.hooked
        while outcome is AGAIN:
            if hooked:
                self.before(node)
            program = node.program
            if program is None:
                outcome = call(node)
            else:
                outcome = execute_root(stack, self.thread, program, node.view)
            if hooked:
                outcome = self.after(node, outcome)
        node.target(outcome)
        return outcome

    def go_on(self, stack: list[Any], outcome: Any) -> Any:
        """Go on after a state that was left behind, here or in a container inside."""
        if len(stack) > 1:
            stack[-1].go_on_after(outcome)
            outcome = self.after(self.node, run(stack, 1))
        return self._execute(stack, outcome)

    def note_answer(self) -> bool:
        """Note what the state's end answers, and take back what it did not acknowledge.

        Returns:
            Whether it made way.
        """
        state = self.state
        answer = answer_of(
            self.node.state,
            self.thread.outcome,
            preempted=bool(state & (ChildState.STOPPED | ChildState.PREEMPTED)),
            making_way=bool(state & ChildState.MAKES_WAY),
            left=self.left is self.node,
        )
        if answer.served and state & ChildState.PREEMPTED:
            self.state |= ChildState.SERVED
        return answer.made_way

    # What others want; under the machine's condition.

    @property
    def making_way(self) -> StateNode | None:  # type: ignore[override]
        """The node, if its state was asked to make way for an interrupt."""
        return self.node if self.state & ChildState.MAKES_WAY else None

    @property
    def must_end(self) -> bool:
        """Whether somebody wants the state to end."""
        return bool(self.state) or super().must_end

    def preempt(self) -> None:
        """Ask the state to stop, once: again could come after it served the first request."""
        if not (self.thread.done or self.state & ChildState.PREEMPTED):
            self.state |= ChildState.PREEMPTED
            self.attention = True
            self.thread.asked()
            self.node.state.request_preempt()

    def make_way(self) -> None:
        """Ask the state to make way for an interrupt."""
        if not (self.thread.done or self.state & ChildState.MAKES_WAY):
            self.state |= ChildState.MAKES_WAY
            self.thread.asked()
            self.node.state.fsm_suspend()

    def stop(self) -> None:
        """Ask the state to stop, once: another one has ended.

        One that a preempt asked already is not asked again, nor when a third state ends: it may
        have served that, and be at what it does then.
        """
        if not (self.thread.done or self.state & ChildState.STOPPED):
            self.state |= ChildState.STOPPED
            if not self.state & ChildState.PREEMPTED:
                self.thread.asked()
                self.node.state.request_preempt()

    def hold(self) -> None:
        """Leave the concurrence to its own frame."""

    def abandon(self, *, for_good: bool) -> None:
        """Note that the machine went on without the thread; the concurrence may go on."""
        self.abandoned = self.attention = True


class _AllStates(State):
    """What the loop executes of a concurrence: all its states that have not ended, together."""

    fsm_suspends = True

    def __init__(self, concurrence: Concurrence) -> None:
        super().__init__(concurrence.get_registered_outcomes())
        self._concurrence = concurrence

    @property
    def _frame(self) -> ConcurrentFrame | None:
        frame = self._concurrence.fsm_program.frame
        return frame if isinstance(frame, ConcurrentFrame) else None

    def execute(self, ud: Any) -> Any:
        """Run them to their ends; the concurrence's outcome, or `SUSPENDED`."""
        frame: ConcurrentFrame = this_thread.stack[-1]
        return frame.run_states()

    def request_preempt(self) -> None:
        """Ask those that run to stop; under the machine's condition."""
        super().request_preempt()
        if self._frame is not None:
            self._frame.preempt_states()

    def fsm_suspend(self) -> None:
        """Ask those that run to make way; under the machine's condition."""
        if self._frame is not None:
            self._frame.suspend_states()

    def fsm_forget(self) -> None:
        """Drop how far they have come."""
        for state in self._concurrence.fsm_program.states.values():
            state.fsm_forget()


class ConcurrentFrame(Frame):
    """One execution of a concurrence: of one node that stands for all its states, and interrupts.

    Attributes:
        outcomes: What each state ended with; None for those that have not ended.
    """

    def __init__(self, program: ContainerProgram, thread: ExecutionThread, parent_ud: Any) -> None:
        super().__init__(program, thread, parent_ud)
        self.outcomes: Outcomes = dict.fromkeys(program.states)
        self._begin_anew()

    def successor(self) -> Self:
        """Return a copy for the thread that takes this execution over."""
        frame = super().successor()
        frame._begin_anew()
        return frame

    def _begin_anew(self) -> None:
        """Watch no thread yet."""
        self.watches_threads = False
        self._wakeup = Interrupt()
        # Of all states that were started, by label; most have ended.
        self._children: dict[str, ChildFrame] = {}
        # What an execution that was left behind, or broke off, was asked is not for this one.
        together = self.program.first.state
        if together.preempt_requested():
            together.recall_preempt()

    def go_on_from(self, history: History) -> None:
        """Begin where the container was put aside."""
        super().go_on_from(history)
        with self.control.condition:
            self.outcomes.update(history.outcomes)

    def history_before(self, target: StateNode | Exit) -> History:
        """Return where to go on when the container is put aside before `target`."""
        history = super().history_before(target)
        history.outcomes = {label: end for label, end in self.outcomes.items() if end is not None}
        return history

    def active_labels(self) -> list[str]:
        """Return the labels of the states that run, or of the interrupt's."""
        if self.current is not self.program.first:
            return super().active_labels()
        return [label for label, outcome in self.outcomes.items() if outcome is None]

    def abandon(self, *, for_good: bool) -> None:
        """Note that the machine went on without the thread; it goes on without the states, too."""
        super().abandon(for_good=for_good)
        for child in self._children.values():
            if child.thread.done:
                # Its end will not be noted.
                child.node.release()
            else:
                leave_behind(child.thread)
        self._wakeup.set()

    def run_states(self) -> Any:
        """Run all states that have not ended; the outcome, or `SUSPENDED` if one made way."""
        container, control = self.container, self.control
        running = self._children_to_run()
        error: BaseException | None = None
        if any(end is not None for end in self.outcomes.values()):
            # It goes on where it was put aside: who was to stop there begins with that.
            error = self._stop_others(running)
        container.call_transition_cbs()
        for child in running.values():
            child.thread.start(child.execute)
        error = self._await_states(running, error)
        callbacks = self.program.transition_cbs or self.program.termination_cbs
        if callbacks or control.trace is not None or control.chatty:
            # Its end is not told as that of one state: see `tell`.
            self.attention = True
        if error is not None:
            raise error
        if any(end is None for end in self.outcomes.values()):
            return SUSPENDED
        # Not under the condition: it calls the user's code.
        outcome = container.fsm_outcome_of(self.outcomes)
        with self.control.condition:
            self._check()
            return self._after_preempt(outcome)

    def _after_preempt(self, outcome: str) -> str:
        """Return the outcome, all states having ended: a preempt that one of them served has its
        own. Under the machine's condition.
        """
        container = self.container
        preempted = container.preempt_requested()
        served = self._served_preempt(preempted=preempted)
        if not (preempted and served):
            # A request that came too late for all of them stays, for what runs next.
            return outcome
        if 'preempted' in container.get_registered_outcomes():
            outcome = 'preempted'
        elif outcome == container.default_outcome:
            # Nothing says that the outcome stands for a preempt: what runs next is asked.
            return outcome
        self.program.first.state.service_preempt()
        return outcome

    def _served_preempt(self, *, preempted: bool) -> bool:
        """Take back the requests that were not acknowledged; whether a state acknowledged one."""
        ignored = []
        for label, child in self._children.items():
            state = child.node.state
            # A state that was left behind keeps the request, so that it ends some time.
            pending = state.preempt_requested() and child.left is None
            if pending:
                state.recall_preempt()
            asked = child.state & (ChildState.PREEMPTED | ChildState.SERVED)
            if pending or asked == ChildState.PREEMPTED:
                ignored.append(label)
        if preempted and ignored:
            log.logwarn(f"'{self.path}': {ignored} did not acknowledge the preempt")
        return any(child.state & ChildState.SERVED for child in self._children.values())

    # The states.

    def _children_to_run(self) -> dict[str, ChildFrame]:
        """Return the frames of those that have not ended, each for a thread of its own.

        Raises:
            LeftBehindError: The machine went on without the concurrence.
        """
        control, program = self.control, self.program
        with control.condition:
            self._check()
            children = {
                label: ChildFrame(self, node, ExecutionThread(control, node.path, self._wakeup))
                for label, node in program.table.items()
                if label in self.outcomes and self.outcomes[label] is None
            }
            for child in children.values():
                child.thread.stack.append(child)
            self._children |= children
            # What was asked before there was anybody to ask.
            if program.first.state.preempt_requested():
                self.preempt_states()
            elif self.making_way is not None:
                self.suspend_states()
        return children

    def _await_states(
        self, running: dict[str, ChildFrame], first_error: BaseException | None
    ) -> BaseException | None:
        """Watch threads until their states have ended or made way.

        Args:
            running: The states' frames by label; emptied.
            first_error: An error for which they were stopped already.

        Returns:
            The first error of one of them, which stopped the others.

        Raises:
            LeftBehindError: The machine went on without the concurrence.
        """
        self._check()
        while running:
            self.watches_threads = True
            try:
                supervise(self.control, [child.thread for child in running.values()], self._wakeup)
            except BaseException as interrupt:
                # From the keyboard, as a rule: passed on when all have ended.
                first_error = first_error or interrupt
                self._stop(running)
                continue
            with self.control.condition:
                self._check()
                # From here on it is the callbacks that a preempt waits for.
                self.watches_threads = False
                self.thread.asked_anew()
            for label in [label for label, child in running.items() if child.thread.done]:
                error = running.pop(label).thread.error
                if error is not None:
                    first_error = first_error or error
                    self._stop(running)
                    continue
                with self.control.condition:
                    ended = self._note_end(label)
                if ended is not None:
                    self._tell_end(label, ended)
                if first_error is None:
                    first_error = self._stop_others(running)
        return first_error

    def _check(self) -> None:
        """Raise `LeftBehindError` when the machine went on without the concurrence."""
        if self.abandoned:
            raise LeftBehindError

    def _stop_others(self, running: Iterable[str]) -> SmachError | None:
        """Ask the container which states stop now that one has ended, and stop them.

        Where the container's answer is an error, all stop; the error is returned.
        """
        error = None
        try:
            stop: Iterable[str] = self.container.fsm_states_to_stop(self.outcomes)
        except SmachError as raised:
            error, stop = raised, running
        if stop:
            self._stop([label for label in stop if label in running])
        return error

    def _stop(self, labels: Iterable[str]) -> None:
        with self.control.condition:
            for label in labels:
                self._children[label].stop()

    def _note_end(self, label: str) -> str | None:
        """Note what a state ended with; None when it only made way."""
        child = self._children[label]
        node, outcome = child.node, child.thread.outcome
        if child.forced is not None:
            # A preempt that it was asked for, too, is not served by that.
            outcome = child.forced[1]
            node.state.fsm_forget()
            if child.left is None:
                node.state.recall_preempt()
        elif (outcome is SUSPENDED or child.state) and child.note_answer():
            node.release()
            return None
        node.state.fsm_progress = None
        self.outcomes[label] = outcome
        node.release()
        return str(outcome)

    def _tell_end(self, label: str, outcome: str) -> None:
        self.note(label, outcome, '', 'ended')
        if self.control.chatty:
            log.loginfo(f"'{self.path}': '{label}' ended with '{outcome}'")
        self.container.call_transition_cbs()

    def tell(self, move: Move) -> None:
        """Tell of interrupts, the beginning and the end; the states' ends are told one by one."""
        if move.left is self.program.first and move.kind != 'interrupt':
            labels = list(self.program.states)
            self.container.call_termination_cbs(labels, move.target.label)
        else:
            super().tell(move)

    # What others want of the states; under the machine's condition.

    def replace_child(self, child: ChildFrame) -> None:
        """Take note of the frame that goes on with a state."""
        self._children[child.node.label] = child

    def preempt_states(self) -> None:
        """Ask those that run to stop."""
        for child in self._children.values():
            child.preempt()

    def suspend_states(self) -> None:
        """Ask those that run to make way."""
        for child in self._children.values():
            child.make_way()


class Concurrence(Container):
    """Executes all its states at the same time and ends when all have ended.

    Args:
        outcomes: What the concurrence may end with.
        default_outcome: The outcome when nothing else decides.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.
        outcome_map: From an outcome of the concurrence to the outcomes of states that bring it
            about. Of several that hold, the one that names most states wins, the last of equals.
        outcome_cb: Given the outcomes of all states by label; decides if it returns an outcome.
        child_termination_cb: Called whenever a state ends, with the outcomes by label (None for
            those that run). True stops all others; a list of labels stops those.

    Raises:
        InvalidStateError: It names outcomes that are not declared, or a callback cannot be called.
    """

    together = True
    fsm_frame_type = ConcurrentFrame
    fsm_arguments = ('remapping',)

    def __init__(
        self,
        outcomes: Iterable[str],
        default_outcome: str,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        outcome_map: Mapping[str, Mapping[str, str]] | None = None,
        outcome_cb: OutcomeCallback | None = None,
        child_termination_cb: ChildTerminationCallback | None = None,
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self.default_outcome = default_outcome
        self.outcome_map = {key: dict(value) for key, value in (outcome_map or {}).items()}
        self.outcome_cb = outcome_cb
        self.child_termination_cb = child_termination_cb
        faults = [
            f'{shown(outcome)} is not one of its outcomes {sorted(self._outcomes)}'
            for outcome in (default_outcome, *self.outcome_map)
            if outcome not in self._outcomes
        ]
        for name, callback in (
            ('outcome_cb', outcome_cb),
            ('child_termination_cb', child_termination_cb),
        ):
            if callback is not None and not callable(callback):
                faults.append(f'{name} {shown(callback)} cannot be called')
        if faults:
            raise InvalidStateError(
                f'The outcome policy of a Concurrence is wrong: {"; ".join(faults)}'
            )

    @staticmethod
    def add(
        label: str,
        state: State,
        remapping: Mapping[str, str] | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Add a state to the open concurrence.

        Args:
            label: The state's name in the concurrence.
            state: The state.
            remapping: From the state's userdata keys to the concurrence's.
            **limits: See `LimitOptions`.

        Raises:
            InvalidConstructionError: No concurrence is open.
            InvalidStateError: The label is taken, or the state is none.
        """
        return Concurrence._currently_opened_container().add_state(
            label, state, remapping, **limits
        )

    def add_state(
        self,
        label: str,
        state: State,
        remapping: Mapping[str, str] | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Add a state to a concurrence at hand, open or not; for the arguments see `add`."""
        self._register(label, state, (), remapping, None, **limits)
        return state

    def check_consistency(self) -> None:
        """Raise an error naming all that keeps the concurrence from running.

        Raises:
            InvalidStateError: It has no states.
            InvalidTransitionError: The outcome map or an interrupt does not fit the states.
        """
        if not self.fsm_program.states:
            raise InvalidStateError(f"Concurrence '{self.get_name()}' cannot run: it has no states")
        super().check_consistency()

    def fsm_faults(self) -> list[str]:
        """Return what the outcome map asks of states that they cannot do."""
        faults = []
        for outcome, wanted in self.outcome_map.items():
            for label, end in wanted.items():
                state = self.fsm_program.states.get(label)
                if state is None:
                    faults.append(f"outcome '{outcome}' asks for state '{label}', which it lacks")
                elif end not in state.get_registered_outcomes():
                    faults.append(
                        f"outcome '{outcome}' asks for '{end}' of state '{label}', whose outcomes "
                        f'are {sorted(state.get_registered_outcomes())}'
                    )
        return faults

    # What comes of the states' outcomes.

    def fsm_possible_outcomes(self) -> set[str]:
        """Return the outcomes that may come of it; all of them, if a callback decides."""
        if self.outcome_cb is not None:
            return set(self._outcomes)
        return {self.default_outcome, *self.outcome_map}

    def fsm_states_to_stop(self, ends: Outcomes) -> frozenset[str]:
        """Return the labels of the states to stop now that one has ended.

        Args:
            ends: The outcomes of all states; None for those that run.

        Raises:
            InvalidUserCodeError: The callback raised, or returned no labels of states.
        """
        if self.child_termination_cb is None:
            return frozenset()
        what = f"The child_termination_cb of '{self.get_name()}'"
        try:
            stop = self.child_termination_cb(dict(ends))
        except Exception as error:
            raise InvalidUserCodeError(f'{what} raised {describe(error)}') from error
        if isinstance(stop, str):
            stop = [stop]
        if not isinstance(stop, Iterable):
            # SMACH looks at the truth of what is returned.
            return frozenset(ends) if stop else frozenset()
        labels = list(stop)
        unknown = [label for label in labels if not isinstance(label, str) or label not in ends]
        if unknown:
            raise InvalidUserCodeError(
                f'{what} returned {shown(unknown)}: expected True, False or labels among '
                f'{sorted(ends)}'
            )
        return frozenset(labels)

    def fsm_outcome_of(self, ends: Outcomes) -> str:
        """Return the concurrence's outcome, all states having ended.

        Raises:
            InvalidUserCodeError: The callback raised.
            InvalidTransitionError: It returned an outcome that is not declared.
        """
        outcome, most = self.default_outcome, 0
        for name, wanted in self.outcome_map.items():
            if len(wanted) >= most and all(ends[label] == end for label, end in wanted.items()):
                outcome, most = name, len(wanted)
        if self.outcome_cb is None:
            return outcome
        what = f"The outcome_cb of '{self.get_name()}'"
        try:
            chosen = self.outcome_cb(dict(ends)) or outcome
        except Exception as error:
            raise InvalidUserCodeError(f'{what} raised {describe(error)}') from error
        if not isinstance(chosen, Hashable) or chosen not in self._outcomes:
            raise InvalidTransitionError(
                f'{what} returned {shown(chosen)}: the outcomes are {sorted(self._outcomes)}'
            )
        return chosen

    # Running.

    def fsm_make_table(self) -> dict[str, StateNode]:
        """Make the nodes of all states, and the one without a label that runs them together."""
        table, program = {}, self.fsm_program
        for label, state in program.states.items():
            node = table[label] = program.node(label, state)
            for outcome in state.get_registered_outcomes():
                node.targets[outcome] = ENDED
            if node.limits is not None and node.limits.late_outcome:
                node.targets.setdefault(node.limits.late_outcome, ENDED)
        node = table[''] = program.node('', _AllStates(self))
        node.targets = {outcome: Exit(outcome) for outcome in self.get_registered_outcomes()}
        return table

    def fsm_first_of(self, table: Mapping[str, StateNode]) -> StateNode:
        """Return the node that runs all states."""
        return table['']

    # The container's interface.

    def get_initial_states(self) -> list[str]:
        """Return the labels of all states."""
        return list(self.fsm_program.states)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Return the outcome map as (child outcome, label, outcome)."""
        return [
            (child_outcome, label, outcome)
            for outcome, wanted in self.outcome_map.items()
            for label, child_outcome in wanted.items()
        ]
