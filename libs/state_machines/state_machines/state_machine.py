"""The containers that run one state at a time: state machine, sequence, iterator.

They differ in how states lead to each other; how they run is the matter of `frame`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as Labels
from typing import Any, Unpack

from state_machines.autonomy import Approval, make_approvals
from state_machines.container import Container
from state_machines.exceptions import (
    InvalidStateError,
    InvalidUserCodeError,
    describe,
)
from state_machines.frame import AGAIN, Frame, Move
from state_machines.log import logwarn
from state_machines.program import SUSPENDED, Exit, History, LimitOptions, StateNode
from state_machines.state import State, structure_version
from state_machines.userdata import UserData, raw

Items = Iterable[Any] | Callable[[], Iterable[Any]]
Needs = Mapping[str, int | Approval]
"""From outcomes to the level of autonomy that their transitions need."""


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
        self._transitions: dict[str, Mapping[str, str | None]] = {}
        self._initial_state_label: str | None = None
        # The last state of `add_auto`, and its outcomes that lead to the next one.
        self._to_connect: tuple[str, list[str]] | None = None

    # Construction.

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
        autonomy: Needs | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Add a state to the open machine.

        Args:
            label: The state's name in the machine.
            state: The state.
            transitions: From the state's outcomes to labels or to outcomes of the machine.
            remapping: From the state's userdata keys to the machine's.
            constants: Values for input keys of the state that come from no userdata.
            autonomy: From outcomes to the level that their transitions need: at a lower level of
                the machine (`Control.set_autonomy`) they wait for a person. An `Approval` says how
                long.
            **limits: See `LimitOptions`.

        Returns:
            The state.

        Raises:
            InvalidConstructionError: No state machine is open.
            InvalidStateError: The label is taken, or the state is none.
            InvalidTransitionError: `transitions` binds an outcome the state does not have.
        """
        machine = StateMachine._currently_opened_container()
        return StateMachine.add_state(
            machine, label, state, transitions, remapping, constants, autonomy, **limits
        )

    @staticmethod
    def add_auto(
        label: str,
        state: State,
        connector_outcomes: Iterable[str],
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Add a state that goes on to the next state added, for each of `connector_outcomes`.

        `transitions` that bind one of them have precedence. For the rest see `add`.
        """
        machine = StateMachine._currently_opened_container()
        connectors = list(connector_outcomes)
        unknown = [name for name in connectors if name not in state.get_registered_outcomes()]
        if unknown:
            path = machine.fsm_program.path_of(label)
            raise InvalidStateError(
                f"State '{path}' cannot be connected by {unknown}: its "
                f'outcomes are {sorted(state.get_registered_outcomes())}'
            )
        StateMachine.add_state(machine, label, state, transitions, remapping, **limits)
        machine._to_connect = label, connectors
        return state

    def add_state(
        self,
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
        autonomy: Needs | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Add a state to a machine at hand, open or not; for the arguments see `add`."""
        bound = dict(transitions or {})
        needs = {}
        if autonomy and isinstance(state, State):
            known = {*state.get_registered_outcomes(), *bound}
            needs = make_approvals(self.fsm_program.path_of(label), known, autonomy)
        self._register(label, state, tuple(bound), remapping, constants, **limits)
        group = self._group_transitions() if self.is_opened() else {}
        for outcome in sorted(state.get_registered_outcomes()):
            bound.setdefault(outcome, group.get(outcome))
        self._transitions[label] = bound
        if needs:
            self.fsm_program.approvals[label] = needs
        if self._initial_state_label is None:
            self._initial_state_label = label
        if self._to_connect is not None:
            before, connectors = self._to_connect
            self._to_connect = None
            self._connect(before, connectors, label)
        return state

    def _connect(self, label: str, outcomes: Iterable[str], target: str) -> None:
        """Have outcomes of a state lead to `target`, but for those that are bound."""
        transitions = self._transitions[label]
        free = [outcome for outcome in outcomes if not transitions.get(outcome)]
        self._transitions[label] = {**transitions, **dict.fromkeys(free, target)}
        structure_version.changed()

    def fsm_faults(self) -> list[str]:
        """Return what keeps the machine from running."""
        faults = []
        outcomes = self.get_registered_outcomes()
        if self._initial_state_label is None:
            faults.append('it has no states')
        elif self._initial_state_label not in self.fsm_program.states:
            faults.append(f"its initial state '{self._initial_state_label}' does not exist")
        for label, transitions in self._transitions.items():
            for outcome, target in transitions.items():
                if not target:
                    if outcome not in outcomes:
                        faults.append(
                            f"outcome '{outcome}' of state '{label}' is bound to nothing and is "
                            'not an outcome of the machine'
                        )
                elif target not in self.fsm_program.states and target not in outcomes:
                    faults.append(
                        f"outcome '{outcome}' of state '{label}' leads to '{target}', which is "
                        'neither a state nor an outcome of the machine'
                    )
        return faults

    # Running.

    def fsm_make_table(self) -> dict[str, StateNode]:
        """Make the nodes of all states and interrupts."""
        program = self.fsm_program
        table = {label: program.node(label, state) for label, state in program.states.items()}
        exits = {outcome: Exit(outcome) for outcome in self.get_registered_outcomes()}
        for label, transitions in self._transitions.items():
            targets = table[label].targets
            for outcome, target in transitions.items():
                # What is not bound leads out, also where a state has the outcome's name.
                targets[outcome] = (table.get(target) if target else None) or exits[
                    target or outcome
                ]
        for label in program.approvals:
            # What a preempt ends that comes while a person is asked.
            if 'preempted' in exits:
                table[label].targets.setdefault('preempted', exits['preempted'])
        return table

    def fsm_first_of(self, table: Mapping[str, StateNode]) -> StateNode | Exit:
        """Return the node of the initial state."""
        return table[self._initial_state_label]  # type: ignore[index]

    # The container's interface.

    def get_initial_states(self) -> list[str]:
        """Return the label of the state a run begins with."""
        return [self._initial_state_label] if self._initial_state_label is not None else []

    def set_initial_state(
        self, initial_states: Labels[str], userdata: UserData | None = None
    ) -> None:
        """Choose the state the next run begins with, and add to the machine's userdata.

        Raises:
            InvalidStateError: There is no such state, or more than one is named.
        """
        if len(initial_states) > 1:
            raise InvalidStateError(
                f"State machine '{self.get_name()}' begins with one state, not {initial_states}"
            )
        for label in initial_states:
            # While it has no states, as in SMACH, they may be added later.
            if self.fsm_program.states and label not in self.fsm_program.states:
                raise InvalidStateError(
                    f"State machine '{self.get_name()}' cannot begin with '{label}': its states "
                    f'are {sorted(self.fsm_program.states)}'
                )
            self._initial_state_label = label
        super().set_initial_state((), userdata)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Return all transitions as (outcome, from label, to label or outcome)."""
        return [
            (outcome, label, target)
            for label, transitions in self._transitions.items()
            for outcome, target in transitions.items()
        ]


class Sequence(StateMachine):
    """A state machine in which one outcome leads from each state to the next.

    Args:
        outcomes: What the sequence may end with.
        connector_outcome: The outcome that leads on to the next state.
        input_keys: See `StateMachine`.
        output_keys: See `StateMachine`.
    """

    def __init__(
        self,
        outcomes: Iterable[str],
        connector_outcome: str,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self.connector_outcome = connector_outcome
        self._last_label: str | None = None

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
        autonomy: Needs | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Add a state after the last one; for the arguments see `StateMachine.add`.

        The last state's connector outcome leads here, unless its own transitions bind it.
        """
        sequence = Sequence._currently_opened_container()
        return sequence.add_state(
            label, state, transitions, remapping, constants, autonomy, **limits
        )

    def add_state(self, label: str, state: State, *args: Any, **kwargs: Any) -> State:
        """Add a state to a sequence at hand, open or not; for the arguments see `add`."""
        super().add_state(label, state, *args, **kwargs)
        if self._last_label is not None:
            self._connect(self._last_label, [self.connector_outcome], label)
        self._last_label = label
        return state


class _Exhausted:
    """What the loop is told when no item is left; shown as the outcome that this has."""

    def __init__(self, outcome: str) -> None:
        self._outcome = outcome

    def __str__(self) -> str:
        return self._outcome


class IteratorFrame(Frame):
    """One execution of an iterator.

    Attributes:
        items: The items that are left; None before they were asked for.
        index: How many items it has begun.
        repeat: The current item has not ended: it is not followed by the next one.
    """

    items: Any = None
    index = 0
    repeat = False

    def go_on_from(self, history: History) -> None:
        """Begin where the container was put aside."""
        super().go_on_from(history)
        self.index, self.items, self.repeat = history.index, history.items, history.repeat

    def history_before(self, target: StateNode | Exit) -> History:
        """Return where to go on when the container is put aside before `target`."""
        history = super().history_before(target)
        history.index, history.items, history.repeat = self.index, self.items, self.repeat
        return history

    def draw(self) -> bool:
        """Put the next item into userdata, or the current one again if it has not ended.

        Returns:
            Whether there is one.

        Raises:
            InvalidUserCodeError: The items raised.
        """
        if self.repeat and self.items is not None:
            return True
        iterator = self.container
        begun = self.index
        wanted = begun if self.repeat and begun else begun + 1
        try:
            if self.items is None:
                items = iterator.items
                self.items = iter(items() if callable(items) else items)
                # Resumed in another process: the items before were dealt with.
                skipped = wanted - 1
            else:
                skipped = 0
            for _ in range(skipped):
                next(self.items)
            item = next(self.items)
        except StopIteration:
            return False
        except Exception as error:
            raise InvalidUserCodeError(
                f"The items of iterator '{self.path}' raised {describe(error)} after {begun} items"
            ) from error
        self.index, self.repeat = wanted, True
        data = raw(iterator.userdata)
        if wanted > begun or iterator.items_label not in data:
            data[iterator.items_label] = item
        return True

    def before(self, node: StateNode) -> Any:
        """Draw an item, but for another attempt; the outcome for having none."""
        if node.entry is None or not node.entry.draws:
            # An interrupt's.
            return super().before(node)
        if self.attempt == 0 and not self.draw():
            return self.container.fsm_exhausted
        return super().before(node)

    def after(self, node: StateNode, outcome: Any) -> Any:
        """As of any container; an item whose state made way has not ended."""
        outcome = super().after(node, outcome)
        if outcome is not AGAIN and node.entry is not None and node.entry.draws:
            self.repeat = outcome is SUSPENDED
        return outcome

    def go_on_after(self, outcome: Any) -> None:
        """Take `outcome` for that of the current item, and go on."""
        self.repeat = outcome is SUSPENDED
        super().go_on_after(outcome)

    def _leave(self, node: StateNode, outcome: Any, target: StateNode | Exit) -> Move | None:
        """As of any container; an item whose state made way has not ended."""
        move = super()._leave(node, outcome, target)
        if move is None:
            self.repeat = True
        return move

    def _end_of_loop(self, outcome: Any, target: StateNode | Exit) -> StateNode | Exit:
        """End the loop when a preempt came while it would go on.

        The iterator ends with ``preempted``, or, if it has no such outcome, with what the state's
        outcome stands for. If it has not that either, the request is not served: the iterator ends
        as if no item were left, and the request goes to the next state of its container.
        """
        iterator = self.container
        outcomes = iterator.get_registered_outcomes()
        for ending in ('preempted', iterator.fsm_ending(outcome)):
            if ending in outcomes:
                iterator.service_preempt()
                return Exit(ending)
        return Exit(iterator.fsm_ending(iterator.exhausted_outcome))


class Iterator(Container):
    """Executes its state once per item, until an outcome breaks the loop or no item is left.

    Args:
        outcomes: What the iterator may end with; `exhausted_outcome` is added.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.
        it: The items, or a function that gives them when the iterator is entered.
        it_label: The userdata key that holds the current item.
        exhausted_outcome: What the iterator ends with when no item is left.
    """

    fsm_frame_type = IteratorFrame
    fsm_arguments = ('loop_outcomes', 'break_outcomes', 'final_outcome_map')

    def __init__(
        self,
        outcomes: Iterable[str],
        input_keys: Iterable[str],
        output_keys: Iterable[str],
        it: Items = (),
        it_label: str = 'it_data',
        exhausted_outcome: str = 'exhausted',
    ) -> None:
        super().__init__([*outcomes, exhausted_outcome], input_keys, output_keys)
        self.items: Items = it
        self.items_label = it_label
        self.exhausted_outcome = exhausted_outcome
        self.loop_outcomes: list[str] = []
        self.final_outcome_map: dict[str, str] = {}
        self._break_outcomes: list[str] = []
        self._state_label = ''

    @staticmethod
    def set_iteritems(it: Items, it_label: str = 'it_data') -> None:
        """Set the items of the open iterator, and the userdata key that holds the current one."""
        iterator = Iterator._currently_opened_container()
        iterator.items, iterator.items_label = it, it_label

    @staticmethod
    def set_contained_state(
        label: str,
        state: State,
        loop_outcomes: Iterable[str] = (),
        break_outcomes: Iterable[str] = (),
        final_outcome_map: Mapping[str, str] | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Set the state of the open iterator.

        Args:
            label: The state's name in the iterator.
            state: The state.
            loop_outcomes: Outcomes after which the next item follows; all others break the loop.
            break_outcomes: Outcomes that break the loop, all others leading to the next item; if
                given, they count and `loop_outcomes` do not.
            final_outcome_map: From outcomes that end the iterator to outcomes of the iterator.
            **limits: See `LimitOptions`.

        Raises:
            InvalidStateError: The iterator has a state already.
            InvalidTransitionError: An outcome is named that the state does not have.
        """
        return Iterator._currently_opened_container().set_state(
            label, state, loop_outcomes, break_outcomes, final_outcome_map, **limits
        )

    def set_state(
        self,
        label: str,
        state: State,
        loop_outcomes: Iterable[str] = (),
        break_outcomes: Iterable[str] = (),
        final_outcome_map: Mapping[str, str] | None = None,
        **limits: Unpack[LimitOptions],
    ) -> State:
        """Set the state of an iterator at hand, open or not; see `set_contained_state`."""
        if self.fsm_program.states:
            raise InvalidStateError(
                f"Iterator '{self.get_name()}' has the state '{self._state_label}' already"
            )
        loop, breaking = list(loop_outcomes), list(break_outcomes)
        bound = [*loop, *breaking]
        self._register(label, state, bound, None, None, **limits)
        if loop and breaking:
            logwarn(f"Iterator '{self.get_name()}' has loop and break outcomes: the latter count")
        # With ``timeout`` among them where it is bound without being declared.
        outcomes = dict.fromkeys([*state.get_registered_outcomes(), *bound])
        if breaking:
            loop = [outcome for outcome in outcomes if outcome not in breaking]
        else:
            breaking = [outcome for outcome in outcomes if outcome not in loop]
        self._state_label = label
        self.loop_outcomes, self._break_outcomes = loop, breaking
        self.final_outcome_map = dict(final_outcome_map or {})
        return state

    def fsm_faults(self) -> list[str]:
        """Return what keeps the iterator from running."""
        return [] if self.fsm_program.states else ['it has no state']

    # Running: the state leads back to itself until something breaks the loop.

    def fsm_make_table(self) -> dict[str, StateNode]:
        """Make the nodes of the state and of all interrupts."""
        program = self.fsm_program
        label = self._state_label
        node = program.node(label, program.states[label], draws=True)
        for outcome in self.loop_outcomes:
            node.targets[outcome] = node
        for outcome in self._break_outcomes:
            node.targets[outcome] = Exit(self.fsm_ending(outcome))
        self.fsm_exhausted = _Exhausted(self.exhausted_outcome)
        node.targets[self.fsm_exhausted] = Exit(self.fsm_ending(self.exhausted_outcome))
        return {label: node}

    def fsm_ending(self, outcome: str) -> str:
        """Return the iterator's outcome when its state's `outcome` ends the loop."""
        return self.final_outcome_map.get(outcome, outcome)

    def fsm_first_of(self, table: Mapping[str, StateNode]) -> StateNode | Exit:
        """Return the node of the state."""
        return table[self._state_label]

    # The container's interface.

    def get_initial_states(self) -> list[str]:
        """Return the state's label."""
        return [self._state_label]

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Loop and break outcomes as (outcome, label, label or outcome of the iterator)."""
        label, endings = self._state_label, self.final_outcome_map
        loops = [(outcome, label, label) for outcome in self.loop_outcomes]
        return [
            *loops,
            *((outcome, label, endings.get(outcome)) for outcome in self._break_outcomes),
        ]
