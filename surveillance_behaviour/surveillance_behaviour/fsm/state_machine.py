"""The finite state machine: a container in which one state runs at a time."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from surveillance_behaviour.fsm import log
from surveillance_behaviour.fsm.container import Container, describe
from surveillance_behaviour.fsm.engine import Exit, Frame, Node
from surveillance_behaviour.fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
)
from surveillance_behaviour.fsm.interface import has_smach_interface
from surveillance_behaviour.fsm.shutdown import is_shutdown, shutdown_checked
from surveillance_behaviour.fsm.state import State
from surveillance_behaviour.fsm.user_data import Remapper, UserData, undeclared_write
from surveillance_behaviour.fsm.waiting import WALL_CLOCK, Clock


class StateMachine(Container):
    """A finite state machine.

    States are added inside ``with machine:`` by `add`. A transition leads from an outcome to the
    label of a state or to an outcome of the machine; an outcome that is not bound leads to the
    machine's outcome of the same name.

    Args:
        outcomes: What the machine may end with.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.

    Attributes:
        userdata: What the states inside share.
    """

    def __init__(
        self,
        outcomes: Iterable[str],
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self._states: dict[str, State] = {}
        self._transitions: dict[str, dict[str, str | None]] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._constants: dict[str, dict[str, Any]] = {}
        self._initial_state_label: str | None = None
        self._last_added_label: str | None = None
        self._connector_outcomes: list[str] = []
        self._frame: Frame | None = None
        self._condition = threading.Condition(threading.RLock())
        self._clock: Clock = WALL_CLOCK

    # Construction.

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
    ) -> State:
        """Add a state to the open machine.

        Args:
            label: The state's name in the machine.
            state: The state.
            transitions: From the state's outcomes to labels or to outcomes of the machine.
            remapping: From the state's userdata keys to the machine's.
            constants: Values for input keys of the state that come from no userdata.

        Returns:
            The state.

        Raises:
            InvalidConstructionError: No state machine is open.
            InvalidStateError: The label is taken, or the state is none.
            InvalidTransitionError: `transitions` binds an outcome the state does not have.
        """
        machine = StateMachine._currently_opened_container()
        return machine._add(label, state, transitions, remapping, constants)

    @staticmethod
    def add_auto(
        label: str,
        state: State,
        connector_outcomes: Iterable[str],
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
    ) -> State:
        """Add a state that goes on to the next state added, for each of `connector_outcomes`."""
        machine = StateMachine._currently_opened_container()
        connectors = list(connector_outcomes)
        unknown = [name for name in connectors if name not in state.get_registered_outcomes()]
        if unknown:
            raise InvalidStateError(
                f"State '{machine._path_of(label)}' cannot be connected by {unknown}: its outcomes "
                f'are {sorted(state.get_registered_outcomes())}'
            )
        machine._add(label, state, transitions, remapping, None)
        machine._last_added_label = label
        machine._connector_outcomes = connectors
        return state

    def _add(
        self,
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None,
        remapping: Mapping[str, str] | None,
        constants: Mapping[str, Any] | None,
    ) -> State:
        if label in self._states:
            raise InvalidStateError(
                f"State '{self._path_of(label)}' is already there: a label names one state"
            )
        if not has_smach_interface(state) or not callable(getattr(state, 'execute', None)):
            raise InvalidStateError(
                f"State '{self._path_of(label)}' must be an instance of State, not {state!r}"
            )
        bound = dict(transitions or {})
        self.check_state_spec(label, state, bound)
        group = self._group_transitions() if self.is_opened() else {}
        for outcome in state.get_registered_outcomes():
            bound.setdefault(outcome, group.get(outcome))
        self._states[label] = state
        self._transitions[label] = bound
        self._remappings[label] = dict(remapping or {})
        self._constants[label] = dict(constants or {})
        if self._initial_state_label is None:
            self._initial_state_label = label
        if self._last_added_label is not None:
            for outcome in self._connector_outcomes:
                if self._transitions[self._last_added_label][outcome] is None:
                    self._transitions[self._last_added_label][outcome] = label
            self._last_added_label = None
            self._connector_outcomes = []
        return state

    def check_state_spec(
        self, label: str, state: State, transitions: Mapping[str, str | None]
    ) -> None:
        """Raise `InvalidTransitionError` when `transitions` binds an outcome the state lacks."""
        outcomes = state.get_registered_outcomes()
        for outcome in transitions:
            if outcome not in outcomes:
                raise InvalidTransitionError(
                    f"State '{self._path_of(label)}' has no outcome '{outcome}' to bind: its "
                    f'outcomes are {sorted(outcomes)}'
                )

    def check_consistency(self) -> None:
        """Raise `InvalidTransitionError` naming all that keeps the machine from running."""
        faults = []
        outcomes = self.get_registered_outcomes()
        if self._initial_state_label is None:
            faults.append('it has no states')
        elif self._initial_state_label not in self._states:
            faults.append(f"its initial state '{self._initial_state_label}' does not exist")
        for label, transitions in self._transitions.items():
            for outcome, target in transitions.items():
                if not target:
                    if outcome not in outcomes:
                        faults.append(
                            f"outcome '{outcome}' of state '{label}' is bound to nothing and is "
                            'not an outcome of the machine'
                        )
                elif target not in self._states and target not in outcomes:
                    faults.append(
                        f"outcome '{outcome}' of state '{label}' leads to '{target}', which is "
                        'neither a state nor an outcome of the machine'
                    )
        if faults:
            raise InvalidTransitionError(
                f"State machine '{self._fsm_path}' cannot run: {'; '.join(faults)} (states: "
                f'{sorted(self._states)}, outcomes: {sorted(outcomes)})'
            )

    # Settings.

    def set_clock(self, clock: Clock) -> None:
        """Give the machine and everything inside the clock that `State.wait` waits on."""
        self._clock = clock
        self._fsm_clock = clock

    def set_name(self, name: str) -> None:
        """Name the machine as paths begin with it."""
        self._fsm_path = name

    # Running.

    def execute(self, parent_ud: Any = None) -> str | None:
        """Run from the initial state to an outcome.

        Args:
            parent_ud: Userdata that input keys come from and output keys go to.

        Returns:
            The outcome; None when the shutdown check ended the run.

        Raises:
            InvalidTransitionError: The machine cannot run, or a state returned an outcome that it
                does not have.
            InvalidUserCodeError: A state raised an exception.
            InvalidStateError: The machine is running already.
        """
        if self._frame is not None:
            raise InvalidStateError(f"State machine '{self._fsm_path}' is running already")
        self.check_consistency()
        nodes = self._compile()
        initial = nodes[str(self._initial_state_label)]
        self._copy_input_keys(parent_ud, self.userdata)
        frame = Frame(initial)
        self._frame = frame
        try:
            if log.chatty():
                log.loginfo(
                    f"State machine '{self._fsm_path}' starts in '{initial.label}' with userdata "
                    f'{sorted(self.userdata.keys())}'
                )
            self.call_start_cbs()
            outcome = self._drive(frame, initial)
        finally:
            with self._condition:
                self._frame = None
                self._condition.notify_all()
        self._copy_output_keys(self.userdata, parent_ud)
        return outcome

    def _compile(self) -> dict[str, Node]:
        nodes: dict[str, Node] = {}
        exits = {outcome: Exit(outcome) for outcome in self.get_registered_outcomes()}
        for label, state in self._states.items():
            view = Remapper(
                self.userdata,
                state.get_registered_input_keys(),
                state.get_registered_output_keys(),
                self._remappings[label],
                self._constants[label],
                self._path_of(label),
            )
            nodes[label] = Node(label, state, view)
            if isinstance(state, Container):
                state._fsm_path = self._path_of(label)
            if isinstance(state, StateMachine):
                state.set_clock(self._clock)
            elif isinstance(state, State):
                state._fsm_clock = self._clock
        for label, transitions in self._transitions.items():
            targets = nodes[label].targets
            for outcome, target in transitions.items():
                name = target or outcome
                targets[outcome] = nodes[name] if name in nodes else exits[name]
        return nodes

    def _drive(self, frame: Frame, node: Node) -> str | None:
        self._attend(frame, None, None, node)
        while True:
            if shutdown_checked() and is_shutdown():
                return None
            try:
                outcome = node.execute(node.view)
            except SmachError:
                raise
            except Exception as error:
                raise self._child_error(node, error) from error
            try:
                target = node.targets[outcome]
            except (KeyError, TypeError):
                raise self._undeclared_outcome(node, outcome) from None
            frame.current = target
            if frame.attention:
                self._attend(frame, node, outcome, target)
            if target.is_exit:
                return target.label
            node = target  # type: ignore[assignment]

    def _attend(
        self, frame: Frame, left: Node | None, outcome: str | None, target: Node | Exit
    ) -> None:
        """Do what a transition brings beside the next state: words, callbacks, preempts."""
        chatty = log.chatty()
        if left is not None and chatty:
            verb = 'ends' if target.is_exit else 'goes on'
            log.loginfo(
                f"State machine '{self._fsm_path}' {verb}: '{left.label}' : '{outcome}' --> "
                f"'{target.label}'"
            )
        with self._condition:
            frame.attention = False
            if self._preempt_requested:
                self._pass_preempt_on(frame, left, target)
            if chatty or self._transition_cbs or self._termination_cbs or self._preempt_requested:
                frame.attention = True
        if left is None:
            return
        if target.is_exit:
            self.call_termination_cbs([left.label], target.label)
        else:
            self.call_transition_cbs()

    def _pass_preempt_on(self, frame: Frame, left: Node | None, target: Node | Exit) -> None:
        """Carry a pending preempt over a transition, as SMACH does.

        A state that acknowledged the preempt has served it for the machine; otherwise the next
        state is asked, and at an exit the machine's own flag stays up for its parent to see.
        """
        asked = frame.preempted
        if asked is not None and asked is left:
            if not asked.state.preempt_requested():
                frame.preempted = None
                self.service_preempt()
                return
            asked.state.recall_preempt()
        frame.preempted = None
        if isinstance(target, Node):
            frame.preempted = target
            target.state.request_preempt()

    def request_preempt(self) -> None:
        """Ask the machine to stop: the request reaches the state that runs at once."""
        super().request_preempt()
        with self._condition:
            frame = self._frame
            if frame is None:
                return
            frame.attention = True
            current = frame.current
            if isinstance(current, Node) and frame.preempted is not current:
                frame.preempted = current
                current.state.request_preempt()

    # Errors.

    def _path_of(self, label: str) -> str:
        return f'{self._fsm_path}/{label}'

    def _child_error(self, node: Node, error: Exception) -> SmachError:
        path = self._path_of(node.label)
        undeclared = undeclared_write(node.view, error)
        if undeclared is not None:
            return undeclared
        return InvalidUserCodeError(
            f"State '{path}' of type {type(node.state).__name__} raised {describe(error)}"
        )

    def _undeclared_outcome(self, node: Node, outcome: object) -> InvalidTransitionError:
        returned = 'None instead of an outcome' if outcome is None else f"outcome '{outcome}'"
        return InvalidTransitionError(
            f"State '{self._path_of(node.label)}' of type {type(node.state).__name__} returned "
            f'{returned}: its outcomes are {sorted(node.state.get_registered_outcomes())}'
        )

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
        """The label of the state a run begins with."""
        return [str(self._initial_state_label)]

    def set_initial_state(
        self, initial_states: Sequence[str], userdata: UserData | None = None
    ) -> None:
        """Choose the state the next run begins with, and add to the machine's userdata.

        Raises:
            InvalidStateError: There is no such state, or more than one is named.
        """
        if len(initial_states) > 1:
            raise InvalidStateError(
                f"State machine '{self._fsm_path}' begins with one state, not {initial_states}"
            )
        for label in initial_states:
            if label not in self._states:
                raise InvalidStateError(
                    f"State machine '{self._fsm_path}' cannot begin with '{label}': its states are "
                    f'{sorted(self._states)}'
                )
            self._initial_state_label = label
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> list[str]:
        """The label of the state that runs; empty when none does."""
        frame = self._frame
        if frame is None or frame.current.is_exit:
            return []
        return [frame.current.label]

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """All transitions as (outcome, from label, to label or outcome)."""
        return [
            (outcome, label, target)
            for label, transitions in self._transitions.items()
            for outcome, target in transitions.items()
        ]

    def is_running(self) -> bool:
        """Whether the machine is executing."""
        return self._frame is not None
