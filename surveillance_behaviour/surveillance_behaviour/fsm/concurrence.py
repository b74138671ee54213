"""The concurrence: all children at the same time, one outcome made of theirs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from collections.abc import Sequence as LabelSequence
from typing import Any

from surveillance_behaviour.fsm import log
from surveillance_behaviour.fsm.active import ActiveContainer, forget, stop_for_now
from surveillance_behaviour.fsm.engine import (
    LOWEST,
    RESUME,
    SUSPENDED,
    Branch,
    Exit,
    Frame,
    History,
    Node,
)
from surveillance_behaviour.fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    SmachError,
)
from surveillance_behaviour.fsm.interface import has_smach_interface
from surveillance_behaviour.fsm.limits import Limits, make_limits
from surveillance_behaviour.fsm.nodes import make_node, user_fault, wrong_outcome
from surveillance_behaviour.fsm.outcome_policy import (
    ChildTerminationCallback,
    OutcomeCallback,
    OutcomePolicy,
    Outcomes,
)
from surveillance_behaviour.fsm.run import LeftBehind, Strand, supervise
from surveillance_behaviour.fsm.state import State
from surveillance_behaviour.fsm.user_data import UserData
from surveillance_behaviour.fsm.waiting import Clock, Interrupt

_TOGETHER = Exit('')


def _preempt(state: State) -> None:
    state.request_preempt()


class Concurrence(ActiveContainer):
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
        InvalidStateError: The outcome policy names outcomes that are not declared.
    """

    _fsm_bounds_itself = True

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
        self._states: dict[str, State] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._limits: dict[str, Limits] = {}
        self._policy = OutcomePolicy(
            frozenset(self._outcomes),
            default_outcome,
            outcome_map,
            outcome_cb,
            child_termination_cb,
        )
        self._child_outcomes: Outcomes = {}
        self._wakeup = Interrupt()
        self._strands: dict[str, Strand] = {}
        self._nodes: dict[str, Node] = {}
        self._making_way: set[str] = set()
        self._preempted: set[str] = set()
        self._gone: set[str] = set()

    @staticmethod
    def add(
        label: str,
        state: State,
        remapping: Mapping[str, str] | None = None,
        *,
        timeout: float | None = None,
        deadline: float | None = None,
        retry: int = 0,
        retry_on: Iterable[str] = ('aborted',),
    ) -> State:
        """Add a state to the open concurrence.

        Args:
            label: The state's name in the concurrence.
            state: The state.
            remapping: From the state's userdata keys to the concurrence's.
            timeout: See `StateMachine.add`.
            deadline: See `StateMachine.add`.
            retry: See `StateMachine.add`.
            retry_on: See `StateMachine.add`.

        Raises:
            InvalidConstructionError: No concurrence is open.
            InvalidStateError: The label is taken, or the state is none.
        """
        concurrence = Concurrence._currently_opened_container()
        path = concurrence._path_of(label)
        if label in concurrence._states or label in concurrence._branches:
            raise InvalidStateError(f"State '{path}' is already there: a label names one state")
        if not has_smach_interface(state) or not callable(getattr(state, 'execute', None)):
            raise InvalidStateError(f"State '{path}' must be an instance of State, not {state!r}")
        limits = make_limits(path, state, {}, timeout, deadline, retry, retry_on)
        if limits is not None:
            concurrence._limits[label] = limits
        concurrence._states[label] = state
        concurrence._remappings[label] = dict(remapping or {})
        return state

    def check_consistency(self) -> None:
        """Raise `InvalidTransitionError` when the outcome map does not fit the states."""
        faults = [] if self._states else ['it has no states']
        faults += self._policy.faults(self._states)
        faults += self._branch_faults()
        if faults:
            raise InvalidTransitionError(
                f"Concurrence '{self._fsm_path}' cannot run: {'; '.join(faults)}"
            )

    def _has_limits(self) -> bool:
        return bool(self._limits) or any(
            isinstance(state, ActiveContainer) and state._has_limits()
            for state in self._states.values()
        )

    # Running.

    def _enter(self, strand: Strand, parent_ud: Any) -> Any:
        self._fsm_path = strand.path_inside()
        self.check_consistency()
        run = strand.run
        frame = Frame(self, strand, self._fsm_path, _TOGETHER, parent_ud)
        with run.condition:
            if self._frame is not None:
                raise InvalidStateError(f"'{self._fsm_path}' is running already")
            self._frame = frame
        strand.push(frame)
        history, self._fsm_history = self._fsm_history, None
        try:
            self._heed_suspension(frame)
            if history is None:
                self._copy_input_keys(parent_ud, self.userdata)
            with run.condition:
                self._child_outcomes = dict.fromkeys(self._states)
                if history is not None:
                    self._child_outcomes.update(history.outcomes)
            if log.chatty():
                log.loginfo(f"'{self._fsm_path}' starts {sorted(self._states)} together")
            if history is None:
                self.call_start_cbs()
            if frame.trace is not None:
                frame.trace((self._fsm_path, '', '', '', frame.now(), {}, 'start'))
            outcome = self._run_children(frame)
            if outcome is not SUSPENDED:
                self.call_termination_cbs(list(self._states), outcome)
                self._copy_output_keys(self.userdata, parent_ud)
            return outcome
        finally:
            with run.condition:
                strand.pop(frame)
                if self._frame is frame:
                    self._frame = None
                run.condition.notify_all()

    def _run_children(self, frame: Frame) -> Any:
        """Run children, and interrupts in between, until there is an outcome."""
        while True:
            with frame.strand.run.condition:
                branch = self._next_branch(frame)
            if branch is None:
                self._start_children(frame)
                error = self._await_children(frame)
                if error is not None:
                    raise error
                with frame.strand.run.condition:
                    if frame.suspending and not self._preempt_requested:
                        self._fsm_history = History(outcomes=self._ended())
                        return SUSPENDED
                    if len(self._ended()) == len(self._states):
                        break
                continue
            outcome = self._run_branch(frame, branch)
            if outcome is not None:
                return outcome
        self._service_children()
        return self._policy.decide(self._fsm_path, self._child_outcomes)

    def _ended(self) -> dict[str, str]:
        return {label: end for label, end in self._child_outcomes.items() if end is not None}

    def _start_children(self, frame: Frame) -> None:
        run = frame.strand.run
        strands = {}
        with run.condition:
            self._making_way.clear()
            self._preempted.clear()
            self._gone.clear()
            for label, state in self._states.items():
                if self._child_outcomes[label] is None:
                    node = self._nodes[label] = self._node(label, state, run.clock)
                    strand = strands[label] = Strand(run, self._path_of(label), self._wakeup)
                    strand.begin_with(state, node)
            self._strands = strands
        self.call_transition_cbs()
        for label, strand in strands.items():
            node = self._nodes[label]
            strand.start(lambda node=node: self._execute(node))  # type: ignore[misc]
        with run.condition:
            # What was asked before there was anybody to ask.
            if self._preempt_requested:
                self._preempt_children()
            elif frame.suspending or self._urgent(frame):
                self._cut(frame)

    def _node(self, label: str, state: State, clock: Clock, priority: float = LOWEST) -> Node:
        node = make_node(
            self._path_of(label),
            state,
            self.userdata,
            clock,
            remapping=self._remappings.get(label),
            limits=self._limits.get(label),
            priority=priority,
        )
        for outcome in state.get_registered_outcomes():
            node.targets[outcome] = _TOGETHER
        if node.limits is not None and node.limits.late_outcome:
            node.targets.setdefault(node.limits.late_outcome, _TOGETHER)
        return node

    def _execute(self, node: Node) -> Any:
        path = self._path_of(node.label)
        try:
            outcome = node.execute(node.view)
        except SmachError:
            raise
        except Exception as error:
            raise user_fault(path, node, error) from error
        if not isinstance(outcome, Hashable) or outcome not in node.targets:
            raise wrong_outcome(path, node, outcome)
        return outcome

    def _await_children(self, frame: Frame) -> BaseException | None:
        """Watch the children until all have ended; the first error of one stops the others."""
        run = frame.strand.run
        running = dict(self._strands)
        first_error: BaseException | None = None
        while running:
            supervise(run, list(running.values()), self._wakeup)
            if frame.stale:
                self._abandon(running)
            for label in [label for label, strand in running.items() if strand.done]:
                strand = running.pop(label)
                if strand.error is not None:
                    first_error = first_error or strand.error
                    self._stop(running, _preempt)
                    continue
                if strand.without_leaf:
                    self._gone.add(label)
                self._note_end(frame, label, strand.outcome)
                if first_error is None:
                    try:
                        stop = self._policy.to_stop(self._fsm_path, self._child_outcomes)
                    except SmachError as error:
                        first_error, stop = error, frozenset(running)
                    self._stop(
                        {other: running[other] for other in stop if other in running}, _preempt
                    )
        with run.condition:
            self._strands = {}
        return first_error

    def _note_end(self, frame: Frame, label: str, outcome: Any) -> None:
        state = self._states[label]
        with frame.strand.run.condition:
            if outcome is SUSPENDED:
                return
            if label in self._making_way:
                made_way = not state.preempt_requested() or outcome == 'preempted'
                if label not in self._gone:
                    state.recall_preempt()
                if made_way:
                    return
                # It ended by itself: a preempt that it was asked for, too, is not served by that.
                self._preempted.discard(label)
            if getattr(state, '_fsm_progress', None) is not None:
                state._fsm_progress = None
            self._child_outcomes[label] = outcome
        if frame.trace is not None:
            data = self.userdata._data.copy()
            frame.trace((frame.path, label, outcome, '', frame.now(), data, 'ended'))
        if log.chatty():
            log.loginfo(f"'{frame.path}': '{label}' ended with '{outcome}'")
        self.call_transition_cbs()

    def _stop(self, strands: Mapping[str, Strand], ask: Callable[[State], object]) -> None:
        for label, strand in strands.items():
            if not strand.done:
                strand.asked()
                ask(self._states[label])

    def _abandon(self, running: Mapping[str, Strand]) -> None:
        self._stop(running, _preempt)
        for strand in running.values():
            strand.disown()
        raise LeftBehind

    def _preempt_children(self) -> None:
        # Each is asked once: a second request could come after it has served the first.
        asked = {
            label: strand
            for label, strand in self._strands.items()
            if not strand.done and label not in self._preempted
        }
        self._preempted.update(asked)
        self._stop(asked, _preempt)

    def _service_children(self) -> None:
        """Acknowledge the preempt if one of those asked did; recall what the rest left pending."""
        # A state that was left behind keeps the request, so that it ends some time.
        ignored = [
            label
            for label, state in self._states.items()
            if state.preempt_requested() and label not in self._gone
        ]
        for label in ignored:
            self._states[label].recall_preempt()
        if self._preempt_requested:
            if ignored:
                log.logwarn(f"'{self._fsm_path}': {ignored} did not acknowledge the preempt")
            if self._preempted.difference(ignored):
                self.service_preempt()

    # Preempts and interrupts.

    def _fsm_woken(self) -> None:
        self._wakeup.set()

    def request_preempt(self) -> None:
        """Ask all children that run to stop."""
        super().request_preempt()
        frame = self._frame
        if frame is None:
            return
        with frame.strand.run.condition:
            current = frame.current
            if isinstance(current, Node):
                frame.strand.asked()
                current.state.request_preempt()
            self._preempt_children()
            frame.strand.run.condition.notify_all()

    def _urgent(self, frame: Frame) -> bool:
        return any(branch.priority > frame.current.priority for branch in self._fsm_raised)

    def _interrupted(self) -> None:
        frame = self._frame
        if frame is not None and self._urgent(frame):
            self._cut(frame)

    def _suspend(self) -> None:
        frame = self._frame
        if frame is None:
            self._fsm_aside = True
            return
        frame.suspending = True
        self._cut(frame)

    def _cut(self, frame: Frame) -> None:
        current = frame.current
        if isinstance(current, Node):
            frame.cut = current
            frame.strand.asked()
            stop_for_now(current.state)
        else:
            self._making_way.update(
                label for label, strand in self._strands.items() if not strand.done
            )
            self._stop(self._strands, stop_for_now)

    def _next_branch(self, frame: Frame) -> Branch | None:
        if self._preempt_requested or not self._fsm_raised:
            return None
        branch = max(self._fsm_raised, key=lambda raised: raised.priority)
        self._fsm_raised.remove(branch)
        return branch

    def _run_branch(self, frame: Frame, branch: Branch) -> Any:
        """Run an interrupt's state; None to go on with the children."""
        run = frame.strand.run
        self._remappings[branch.label] = branch.remapping
        node = self._node(branch.label, branch.state, run.clock, branch.priority)
        with run.condition:
            frame.cut = None
            frame.current = node
            if self._preempt_requested:
                branch.state.request_preempt()
            elif frame.suspending or self._urgent(frame):
                self._cut(frame)
        outcome = self._execute(node)
        with run.condition:
            if frame.stale:
                raise LeftBehind
            frame.strand.heeded()
            frame.current = _TOGETHER
            pending = branch.state.preempt_requested()
            served = not pending or outcome == 'preempted'
            branch.state.recall_preempt()
            if outcome is SUSPENDED or (frame.cut is node and served):
                self._fsm_raised.append(branch)
                if frame.suspending:
                    self._fsm_history = History(outcomes=self._ended())
                    return SUSPENDED
                return None
            forget(branch.state)
            if self._preempt_requested and not pending:
                self.service_preempt()
        target = branch.transitions.get(outcome, RESUME)
        if target == RESUME:
            return None
        for state in self._states.values():
            forget(state)
        return target

    # The container's interface.

    def __getitem__(self, key: str) -> State:
        try:
            return self._states[key]
        except KeyError:
            raise KeyError(
                f"'{self._fsm_path}' has no state '{key}': its states are {sorted(self._states)}"
            ) from None

    def get_children(self) -> dict[str, State]:
        """The states by label."""
        return dict(self._states)

    def get_initial_states(self) -> list[str]:
        """The labels of all states."""
        return list(self._states)

    def set_initial_state(
        self, initial_states: LabelSequence[str], userdata: UserData | None = None
    ) -> None:
        """Add to the concurrence's userdata; all states always begin."""
        for label in initial_states:
            self[label]
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> list[str]:
        """The labels of the states that run."""
        if self._frame is None:
            return []
        return [label for label, outcome in self._child_outcomes.items() if outcome is None]

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """The outcome map as (child outcome, label, outcome)."""
        return [
            (child_outcome, label, outcome)
            for outcome, wanted in self._policy.outcome_map.items()
            for label, child_outcome in wanted.items()
        ]
