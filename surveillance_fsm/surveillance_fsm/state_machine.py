"""The finite state machine: a container in which one state runs at a time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from surveillance_fsm.driven import DrivenContainer
from surveillance_fsm.engine import Exit, Node
from surveillance_fsm.exceptions import InvalidStateError, InvalidTransitionError
from surveillance_fsm.limits import TIMEOUT, Limits, make_limits
from surveillance_fsm.state import State
from surveillance_fsm.user_data import UserData


class StateMachine(DrivenContainer):
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
        self._transitions: dict[str, dict[str, str | None]] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._constants: dict[str, dict[str, Any]] = {}
        self._initial_state_label: str | None = None
        self._last_added_label: str | None = None
        self._connector_outcomes: list[str] = []
        self._limits: dict[str, Limits] = {}

    # Construction.

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
        *,
        timeout: float | None = None,
        deadline: float | None = None,
        retry: int = 0,
        retry_on: Iterable[str] = ('aborted',),
    ) -> State:
        """Add a state to the open machine.

        Args:
            label: The state's name in the machine.
            state: The state.
            transitions: From the state's outcomes to labels or to outcomes of the machine.
            remapping: From the state's userdata keys to the machine's.
            constants: Values for input keys of the state that come from no userdata.
            timeout: Seconds of the machine's clock after which the state is asked to stop. Its
                outcome is then ``timeout`` if `transitions` binds that, else ``aborted``, else
                ``preempted``.
            deadline: Seconds after which the machine goes on without the state, with the same
                outcome.
            retry: How often the state is executed again when it ran out of time or ended with one
                of `retry_on`.
            retry_on: See `retry`.

        Returns:
            The state.

        Raises:
            InvalidConstructionError: No state machine is open.
            InvalidStateError: The label is taken, or the state is none.
            InvalidTransitionError: `transitions` binds an outcome the state does not have.
        """
        machine = StateMachine._currently_opened_container()
        limits = (timeout, deadline, retry, tuple(retry_on))
        return machine._add(label, state, transitions, remapping, constants, limits)

    @staticmethod
    def add_auto(
        label: str,
        state: State,
        connector_outcomes: Iterable[str],
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        **limits: Any,
    ) -> State:
        """Add a state that goes on to the next state added, for each of `connector_outcomes`.

        `transitions` that bind one of them have precedence. For the rest see `add`.
        """
        machine = StateMachine._currently_opened_container()
        connectors = list(connector_outcomes)
        unknown = [name for name in connectors if name not in state.get_registered_outcomes()]
        if unknown:
            raise InvalidStateError(
                f"State '{machine._path_of(label)}' cannot be connected by {unknown}: its outcomes "
                f'are {sorted(state.get_registered_outcomes())}'
            )
        StateMachine.add(label, state, transitions, remapping, **limits)
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
        limits: tuple[float | None, float | None, int, tuple[str, ...]],
    ) -> State:
        self._check_new(label, state)
        bound = dict(transitions or {})
        made = make_limits(self._path_of(label), state, bound, *limits)
        declared = {k: v for k, v in bound.items() if made is None or k != TIMEOUT}
        self.check_state_spec(label, state, declared)
        if made is not None:
            self._limits[label] = made
        group = self._group_transitions() if self.is_opened() else {}
        for outcome in sorted(state.get_registered_outcomes()):
            bound.setdefault(outcome, group.get(outcome))
        self._states[label] = state
        self._transitions[label] = bound
        self._remappings[label] = dict(remapping or {})
        self._constants[label] = dict(constants or {})
        self._table_version += 1
        if self._initial_state_label is None:
            self._initial_state_label = label
        if self._last_added_label is not None:
            for outcome in self._connector_outcomes:
                if not self._transitions[self._last_added_label][outcome]:
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
        faults += self._branch_faults()
        if faults:
            raise InvalidTransitionError(
                f"State machine '{self._fsm_path}' cannot run: {'; '.join(faults)} (states: "
                f'{sorted(self._states)}, outcomes: {sorted(outcomes)})'
            )

    # The table.

    def _initial_label(self) -> str:
        return str(self._initial_state_label)

    def _make_table(self) -> dict[str, Node]:
        table = {
            label: self._node(
                label,
                state,
                remapping=self._remappings[label],
                constants=self._constants[label],
                limits=self._limits.get(label),
            )
            for label, state in self._states.items()
        }
        exits = {outcome: Exit(outcome) for outcome in self.get_registered_outcomes()}
        for label, transitions in self._transitions.items():
            node = table[label]
            for outcome, target in transitions.items():
                name = target or outcome
                node.targets[outcome] = table.get(name) or exits[name]
        return table

    # The container's interface.

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

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """All transitions as (outcome, from label, to label or outcome)."""
        return [
            (outcome, label, target)
            for label, transitions in self._transitions.items()
            for outcome, target in transitions.items()
        ]
