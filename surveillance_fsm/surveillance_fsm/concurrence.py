"""The concurrence: all children at the same time, one outcome made of theirs."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from collections.abc import Sequence as LabelSequence
from typing import Any

from surveillance_fsm import log
from surveillance_fsm.active import ActiveContainer, forget, stop_for_now
from surveillance_fsm.children import Children
from surveillance_fsm.engine import (
    LOWEST,
    NO_USERDATA,
    RESUME,
    SUSPENDED,
    Branch,
    Exit,
    Frame,
    History,
    Node,
    SpecialStep,
)
from surveillance_fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    SmachError,
)
from surveillance_fsm.limits import Limits, make_limits
from surveillance_fsm.nodes import make_node, user_fault, wrong_outcome
from surveillance_fsm.outcome_policy import (
    ChildTerminationCallback,
    OutcomeCallback,
    OutcomePolicy,
)
from surveillance_fsm.run import LeftBehind, Strand
from surveillance_fsm.state import State
from surveillance_fsm.user_data import UserData
from surveillance_fsm.waiting import Clock

_TOGETHER = Exit('')


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
        self._children = Children(self._states)
        self._remappings: dict[str, dict[str, str]] = {}
        self._limits: dict[str, Limits] = {}
        self._policy = OutcomePolicy(
            frozenset(self._outcomes),
            default_outcome,
            outcome_map,
            outcome_cb,
            child_termination_cb,
        )

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
        concurrence._check_new(label, state)
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
                self._children.begin(history.outcomes if history is not None else {})
            if log.chatty():
                log.loginfo(f"'{self._fsm_path}' starts {sorted(self._states)} together")
            if history is None:
                self.call_start_cbs()
            if frame.trace is not None:
                step = SpecialStep(self._fsm_path, '', '', 'start')
                frame.trace((step, '', frame.now(), NO_USERDATA))
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
        children = self._children
        while True:
            with frame.strand.run.condition:
                branch = self._next_branch(frame)
            if branch is None:
                self._start_children(frame)
                error = children.wait(
                    frame,
                    lambda: self._policy.to_stop(self._fsm_path, children.outcomes),
                    lambda label, outcome: self._tell_end(frame, label, outcome),
                )
                if error is not None:
                    raise error
                with frame.strand.run.condition:
                    if frame.suspending and not self._preempt_requested:
                        self._fsm_history = History(outcomes=children.ended())
                        return SUSPENDED
                    if children.all_ended():
                        break
                continue
            outcome = self._run_branch(frame, branch)
            if outcome is not None:
                return outcome
        if children.served_preempt(self._fsm_path, preempted=self._preempt_requested):
            self.service_preempt()
        return self._policy.decide(self._fsm_path, children.outcomes)

    def _start_children(self, frame: Frame) -> None:
        run = frame.strand.run
        with run.condition:
            nodes = self._children.make_strands(
                run, self._fsm_path, lambda label, state: self._node(label, state, run.clock)
            )
        self.call_transition_cbs()
        self._children.start(nodes, self._execute)
        with run.condition:
            # What was asked before there was anybody to ask.
            if self._preempt_requested:
                self._children.preempt()
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

    def _tell_end(self, frame: Frame, label: str, outcome: str) -> None:
        if frame.trace is not None:
            step = SpecialStep(frame.path, label, '', 'ended')
            frame.trace((step, outcome, frame.now(), self.userdata._data.copy()))
        if log.chatty():
            log.loginfo(f"'{frame.path}': '{label}' ended with '{outcome}'")
        self.call_transition_cbs()

    # Preempts and interrupts.

    def _fsm_woken(self) -> None:
        self._children.wakeup.set()

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
            self._children.preempt()
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
            self._children.make_way()

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
            forced, frame.forced = frame.forced, None
            if forced is not None:
                outcome = forced[1]
            branch.state.recall_preempt()
            if forced is None and (outcome is SUSPENDED or (frame.cut is node and served)):
                self._fsm_raised.append(branch)
                if frame.suspending:
                    self._fsm_history = History(outcomes=self._children.ended())
                    return SUSPENDED
                return None
            forget(branch.state)
            if forced is None and self._preempt_requested and not pending:
                self.service_preempt()
        target = branch.transitions.get(outcome, RESUME)
        if target == RESUME:
            return None
        for state in self._states.values():
            forget(state)
        return target

    # The container's interface.

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
        return [label for label, outcome in self._children.outcomes.items() if outcome is None]

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """The outcome map as (child outcome, label, outcome)."""
        return [
            (child_outcome, label, outcome)
            for outcome, wanted in self._policy.outcome_map.items()
            for label, child_outcome in wanted.items()
        ]
