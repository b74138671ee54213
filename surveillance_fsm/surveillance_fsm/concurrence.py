"""The concurrence: all states at the same time, one outcome made of theirs.

`ConcurrentFrame` runs each state on a logical thread of its own, which the concurrence's thread
watches; `Concurrence` is the container.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import partial
from operator import methodcaller
from typing import Any, Unpack

from surveillance_fsm import log
from surveillance_fsm.clock import Interrupt
from surveillance_fsm.container import Container
from surveillance_fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
    describe,
    shown,
)
from surveillance_fsm.execution import (
    NO_USERDATA,
    RESUMPTION,
    SUSPENDED,
    ExecutionThread,
    Exit,
    Frame,
    History,
    LeftBehindError,
    Node,
    SpecialStep,
)
from surveillance_fsm.state import State
from surveillance_fsm.timeouts import LimitOptions, supervise
from surveillance_fsm.userdata import raw

Outcomes = dict[str, str | None]
ChildTerminationCallback = Callable[[Outcomes], bool | Iterable[str] | None]
OutcomeCallback = Callable[[Outcomes], str | None]

TOGETHER = Exit('')
"""Where every outcome of a concurrence's state leads: it has ended."""


class _ChildThread(ExecutionThread):
    """The logical thread of one state of a concurrence.

    Attributes:
        preempted: The state was asked to stop by a preempt, and has not ended without regard to it.
        making_way: The state was asked to make way for an interrupt.
    """

    preempted = False
    making_way = False


class ConcurrentFrame(Frame):
    """One execution of a concurrence.

    Attributes:
        outcomes: What each state ended with; None for those that have not ended.
    """

    container: Concurrence
    carried_over = (*Frame.carried_over, 'outcomes')

    def __init__(
        self,
        container: Concurrence,
        thread: ExecutionThread,
        path: str,
        current: Node | Exit,
        parent_ud: Any,
    ) -> None:
        super().__init__(container, thread, path, current, parent_ud)
        self.outcomes: Outcomes = {}
        self._wakeup = Interrupt()
        # Those of all states that were started, by label; most have ended.
        self._threads: dict[str, _ChildThread] = {}

    # From the beginning to the end.

    def execute(self, history: History | None) -> Any:
        """Run all states to their ends, and interrupts in between; the outcome or `SUSPENDED`."""
        container, run = self.container, self.run
        if history is None:
            container.fsm_copy_input_keys(self.parent_ud)
        outcomes: Outcomes = dict.fromkeys(container.fsm_states)
        outcomes.update(history.outcomes if history is not None else {})
        with run.condition:
            self.outcomes = outcomes
        if run.chatty:
            log.loginfo(f"'{self.path}' starts {sorted(container.fsm_states)} together")
        if history is None:
            container.call_start_cbs()
        if run.control.trace is not None:
            self.note((SpecialStep(self.path, '', '', 'start'), '', run.now(), NO_USERDATA))
        return self._finish(self._run_states())

    def run_on(self, outcome: Any) -> Any:
        """Take `outcome` for that of the interrupt's state that hangs, and run to the end."""
        node = self.current
        assert isinstance(node, Node)
        ending = self._end_branch(node, outcome)
        return self._finish(self._run_states() if ending is None else ending)

    def _finish(self, outcome: Any) -> Any:
        if outcome is not SUSPENDED:
            self.container.call_termination_cbs(list(self.container.fsm_states), outcome)
            self.container.fsm_copy_output_keys(self.parent_ud)
        return outcome

    def _run_states(self) -> Any:
        container = self.container
        while True:
            with self.run.condition:
                node = self._next_branch()
            if node is not None:
                outcome = self._run_branch(node)
                if outcome is not None:
                    return outcome
                continue
            error = self._await_states(self._start_states())
            if error is not None:
                raise error
            with self.run.condition:
                if self.suspending and not container.preempt_requested():
                    container.fsm_history = self.where()
                    return SUSPENDED
                if all(end is not None for end in self.outcomes.values()):
                    return self._decide()

    def _decide(self) -> str:
        """Return the outcome, all states having ended; a preempt that one of them served has its
        own.
        """
        container = self.container
        preempted = container.preempt_requested()
        served = self._served_preempt(preempted=preempted)
        outcome = container.fsm_outcome_of(self.outcomes)
        if not (preempted and served):
            # A request that came too late for all of them stays, for what runs next.
            return outcome
        if 'preempted' in container.get_registered_outcomes():
            outcome = 'preempted'
        elif outcome == container.default_outcome:
            # Nothing says that the outcome stands for a preempt: what runs next is asked.
            return outcome
        container.service_preempt()
        return outcome

    def _served_preempt(self, *, preempted: bool) -> bool:
        """Take back the requests that were not acknowledged; whether a state acknowledged one."""
        ignored, served = [], False
        for label, state in self.container.fsm_states.items():
            thread = self._threads.get(label)
            # A state that was left behind keeps the request, so that it ends some time.
            if state.preempt_requested() and not (thread is not None and thread.without_leaf):
                state.recall_preempt()
                ignored.append(label)
            elif thread is not None and thread.preempted:
                served = True
        if preempted and ignored:
            log.logwarn(f"'{self.path}': {ignored} did not acknowledge the preempt")
        return served

    # The states.

    def _start_states(self) -> dict[str, _ChildThread]:
        """Start those that have not ended, each on a thread of its own; return those threads."""
        run, table = self.run, self.container.fsm_table
        with run.condition:
            started = {
                label: _ChildThread(run, table[label].path, self._wakeup, leaf=table[label])
                for label, end in self.outcomes.items()
                if end is None
            }
            self._threads |= started
        self.container.call_transition_cbs()
        for label, thread in started.items():
            thread.start(partial(_execute, table[label]))
        with run.condition:
            # What was asked before there was anybody to ask.
            if self.container.preempt_requested():
                self._preempt_states()
            elif self.suspending or self.container.fsm_urgent(self.current.priority):
                self._cut()
        return started

    def _await_states(self, running: dict[str, _ChildThread]) -> BaseException | None:
        """Watch threads until their states have ended or made way.

        Returns:
            The first error of one of them, which stopped the others.

        Raises:
            LeftBehindError: The machine went on without the concurrence.
        """
        first_error: BaseException | None = None
        while running:
            supervise(self.run, list(running.values()), self._wakeup)
            if self.stale:
                self._stop(running.values())
                for thread in running.values():
                    thread.disown()
                raise LeftBehindError
            for label in [label for label, thread in running.items() if thread.done]:
                thread = running.pop(label)
                if thread.error is not None:
                    first_error = first_error or thread.error
                    self._stop(running.values())
                    continue
                with self.run.condition:
                    ended = self._note_end(label, thread)
                if ended is not None:
                    self._tell_end(label, ended)
                if first_error is None:
                    first_error = self._stop_others(running)
        return first_error

    def _stop_others(self, running: Mapping[str, _ChildThread]) -> SmachError | None:
        """Stop the states that are to stop now that one has ended; the error of deciding that."""
        error = None
        try:
            stop: Iterable[str] = self.container.fsm_states_to_stop(self.outcomes)
        except SmachError as raised:
            error, stop = raised, list(running)
        self._stop([running[label] for label in stop if label in running])
        return error

    def _note_end(self, label: str, thread: _ChildThread) -> str | None:
        """Note what a state ended with; None when it only made way."""
        node, outcome = self.container.fsm_table[label], thread.outcome
        state = node.state
        if thread.forced is not None:
            # A preempt that it was asked for, too, is not served by that.
            outcome = thread.forced[1]
            thread.preempted = False
            state.fsm_forget()
            if not thread.without_leaf:
                state.recall_preempt()
        elif outcome is SUSPENDED:
            node.release()
            return None
        elif thread.making_way and isinstance(state, Container):
            # One that makes way is suspended; any other outcome is its own.
            state.fsm_aside = False
        elif thread.making_way:
            made_way = not state.preempt_requested() or outcome == 'preempted'
            if not thread.without_leaf:
                state.recall_preempt()
            if made_way:
                return None
            # Nor by ending by itself.
            thread.preempted = False
        state.fsm_progress = None
        self.outcomes[label] = outcome
        node.release()
        return str(outcome)

    def _tell_end(self, label: str, outcome: str) -> None:
        if self.run.control.trace is not None:
            step = SpecialStep(self.path, label, '', 'ended')
            self.note((step, outcome, self.run.now(), raw(self.container.userdata).copy()))
        if self.run.chatty:
            log.loginfo(f"'{self.path}': '{label}' ended with '{outcome}'")
        self.container.call_transition_cbs()

    def _stop(
        self,
        threads: Iterable[_ChildThread],
        ask: Callable[[State], object] = methodcaller('request_preempt'),
    ) -> None:
        for thread in threads:
            if not thread.done and thread.leaf is not None:
                thread.wanted = True
                thread.asked()
                ask(thread.leaf.state)

    # Interrupts.

    def _next_branch(self) -> Node | None:
        if self.container.preempt_requested():
            return None
        branch = self.container.fsm_take_raised()
        return None if branch is None else self.container.fsm_table[branch.label]

    def _run_branch(self, node: Node) -> Any:
        """Run an interrupt's state; None to go on with the states."""
        container, run = self.container, self.run
        branch = container.fsm_branches[node.label]
        with run.condition:
            self.cut = None
            self.current = node
            if container.preempt_requested():
                branch.state.request_preempt()
            elif self.suspending or container.fsm_urgent(node.priority):
                self._cut()
        return self._end_branch(node, _execute(node))

    def _end_branch(self, node: Node, outcome: Any) -> Any:
        """Settle what an interrupt's state ended with; None to go on with the states."""
        container = self.container
        branch = container.fsm_branches[node.label]
        with self.run.condition:
            if self.stale:
                raise LeftBehindError
            self.thread.heeded()
            self.current = TOGETHER
            node.release()
            gone, self.gone = self.gone is node, None
            pending = branch.state.preempt_requested() and not gone
            served = not pending or outcome == 'preempted'
            forced, self.forced = self.forced, None
            if forced is not None:
                outcome = forced[1]
            if not gone:
                branch.state.recall_preempt()
            if forced is None and (outcome is SUSPENDED or (self.cut is node and served)):
                container.fsm_raise(branch)
                if self.suspending:
                    container.fsm_history = self.where()
                    return SUSPENDED
                return None
            branch.state.fsm_forget()
            if forced is None and container.preempt_requested() and not pending:
                container.service_preempt()
        target = node.target(outcome)
        if target is RESUMPTION:
            return None
        for state in container.fsm_states.values():
            state.fsm_forget()
        return target.label

    # What others want; under the run's condition.

    def preempt(self) -> None:
        """Ask all states that run to stop."""
        current = self.current
        if isinstance(current, Node):
            self.thread.asked()
            current.state.request_preempt()
        self._preempt_states()
        self.run.condition.notify_all()

    def _preempt_states(self) -> None:
        """Ask those that run to stop, each once: again could come after it served the first."""
        asked = [thread for thread in self._threads.values() if not thread.preempted]
        self._stop(asked)
        for thread in asked:
            thread.preempted = not thread.done

    def interrupted(self) -> None:
        """Make way for the container's raised interrupts."""
        if self.container.fsm_urgent(self.current.priority):
            self._cut()

    def suspend(self) -> None:
        """Have the container put aside with its history."""
        self.suspending = True
        self._cut()

    def _cut(self) -> None:
        current = self.current
        if isinstance(current, Node):
            self.cut = current
            self.thread.asked()
            current.state.fsm_suspend()
            return
        for thread in self._threads.values():
            thread.making_way = thread.making_way or not thread.done
        self._stop(self._threads.values(), methodcaller('fsm_suspend'))

    def woken(self) -> None:
        """Wake the thread that waits for the states: it was left behind."""
        self._wakeup.set()

    def where(self) -> History | None:
        """Return where the container would go on if its process ended now."""
        return History(
            outcomes={label: end for label, end in self.outcomes.items() if end is not None}
        )

    def active_labels(self) -> list[str]:
        """Return the labels of the states that run."""
        return [label for label, outcome in self.outcomes.items() if outcome is None]


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
        if not self.fsm_states:
            raise InvalidStateError(f"Concurrence '{self.fsm_path}' cannot run: it has no states")
        super().check_consistency()

    def fsm_faults(self) -> list[str]:
        """Return what the outcome map asks of states that they cannot do."""
        faults = []
        for outcome, wanted in self.outcome_map.items():
            for label, end in wanted.items():
                state = self.fsm_states.get(label)
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
        what = f"The child_termination_cb of '{self.fsm_path}'"
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
        what = f"The outcome_cb of '{self.fsm_path}'"
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

    def fsm_make_table(self) -> dict[str, Node]:
        """Make the nodes of all states."""
        table = {}
        for label, state in self.fsm_states.items():
            node = table[label] = self.fsm_node(label, state)
            for outcome in state.get_registered_outcomes():
                node.targets[outcome] = TOGETHER
            if node.limits is not None and node.limits.late_outcome:
                node.targets.setdefault(node.limits.late_outcome, TOGETHER)
        return table

    def fsm_first(self) -> Node | Exit:
        """Return where all states run."""
        return TOGETHER

    # The container's interface.

    def get_initial_states(self) -> list[str]:
        """Return the labels of all states."""
        return list(self.fsm_states)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Return the outcome map as (child outcome, label, outcome)."""
        return [
            (child_outcome, label, outcome)
            for outcome, wanted in self.outcome_map.items()
            for label, child_outcome in wanted.items()
        ]


def _execute(node: Node) -> Any:
    """Execute a state on a thread of its own; its outcome."""
    try:
        outcome = node.execute(node.view)
    except SmachError:
        raise
    except Exception as error:
        raise node.user_fault(error) from error
    node.target(outcome)
    return outcome
