"""The iterator: one state, executed for every item."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Sequence as LabelSequence
from typing import Any

from surveillance_fsm.container import describe
from surveillance_fsm.driven import DrivenContainer
from surveillance_fsm.engine import SUSPENDED, Exit, Frame, Node
from surveillance_fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
)
from surveillance_fsm.limits import TIMEOUT, Limits, make_limits
from surveillance_fsm.log import logwarn
from surveillance_fsm.state import State
from surveillance_fsm.user_data import UserData

Items = Iterable[Any] | Callable[[], Iterable[Any]]


class _Exhausted:
    """What the loop is told when no item is left; shown as the outcome that this has."""

    def __init__(self, outcome: str) -> None:
        self._outcome = outcome

    def __str__(self) -> str:
        return self._outcome


class Iterator(DrivenContainer):
    """Executes its state once per item, until an outcome breaks the loop or no item is left.

    Args:
        outcomes: What the iterator may end with; `exhausted_outcome` is added.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.
        it: The items, or a function that gives them when the iterator is entered.
        it_label: The userdata key that holds the current item.
        exhausted_outcome: What the iterator ends with when no item is left.
    """

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
        self._items: Items = it
        self._items_label = it_label
        self._exhausted_outcome = exhausted_outcome
        self._exhausted = _Exhausted(exhausted_outcome)
        self._state_label = ''
        self._loop_outcomes: list[str] = []
        self._break_outcomes: list[str] = []
        self._final_outcome_map: dict[str, str] = {}
        self._limits: Limits | None = None

    @staticmethod
    def set_iteritems(it: Items, it_label: str = 'it_data') -> None:
        """Set the items of the open iterator, and the userdata key that holds the current one."""
        iterator = Iterator._currently_opened_container()
        iterator._items = it
        iterator._items_label = it_label

    @staticmethod
    def set_contained_state(
        label: str,
        state: State,
        loop_outcomes: Iterable[str] = (),
        break_outcomes: Iterable[str] = (),
        final_outcome_map: Mapping[str, str] | None = None,
        *,
        timeout: float | None = None,
        deadline: float | None = None,
        retry: int = 0,
        retry_on: Iterable[str] = ('aborted',),
    ) -> State:
        """Set the state of the open iterator.

        Args:
            label: The state's name in the iterator.
            state: The state.
            loop_outcomes: Outcomes after which the next item follows; all others break the loop.
            break_outcomes: Outcomes that break the loop, all others leading to the next item; if
                given, they count and `loop_outcomes` do not.
            final_outcome_map: From outcomes that end the iterator to outcomes of the iterator.
            timeout: See `StateMachine.add`.
            deadline: See `StateMachine.add`.
            retry: See `StateMachine.add`.
            retry_on: See `StateMachine.add`.

        Raises:
            InvalidStateError: The iterator has a state already.
            InvalidTransitionError: An outcome is named that the state does not have.
        """
        iterator = Iterator._currently_opened_container()
        path = iterator._path_of(label)
        if iterator._states:
            raise InvalidStateError(
                f"Iterator '{iterator._fsm_path}' has the state '{iterator._state_label}' already"
            )
        iterator._check_new(label, state)
        loop, breaking = list(loop_outcomes), list(break_outcomes)
        limits = make_limits(
            path, state, dict.fromkeys([*loop, *breaking]), timeout, deadline, retry, retry_on
        )
        outcomes = list(state.get_registered_outcomes())
        if limits is not None and limits.late_outcome == TIMEOUT and TIMEOUT not in outcomes:
            outcomes.append(TIMEOUT)
        for outcome in (*loop, *breaking):
            if outcome not in outcomes:
                raise InvalidTransitionError(
                    f"State '{path}' has no outcome '{outcome}' to loop or break on: its outcomes "
                    f'are {sorted(outcomes)}'
                )
        if loop and breaking:
            logwarn(
                f"Iterator '{iterator._fsm_path}' has loop and break outcomes: the latter count"
            )
        if breaking:
            loop = [outcome for outcome in outcomes if outcome not in breaking]
        else:
            breaking = [outcome for outcome in outcomes if outcome not in loop]
        iterator._state_label, iterator._states = label, {label: state}
        iterator._loop_outcomes, iterator._break_outcomes = loop, breaking
        iterator._final_outcome_map = dict(final_outcome_map or {})
        iterator._limits = limits
        iterator._table_version += 1
        return state

    def check_consistency(self) -> None:
        """Raise `InvalidTransitionError` when the iterator has no state or a wrong interrupt."""
        faults = [] if self._states else ['it has no state']
        faults += self._branch_faults()
        if faults:
            raise InvalidTransitionError(
                f"Iterator '{self._fsm_path}' cannot run: {'; '.join(faults)}"
            )

    # The table: the state leads back to itself until something breaks the loop.

    def _initial_label(self) -> str:
        return self._state_label

    def _make_table(self) -> dict[str, Node]:
        node = self._node(self._state_label, self._states[self._state_label], limits=self._limits)
        for outcome in self._loop_outcomes:
            node.targets[outcome] = node
        for outcome in self._break_outcomes:
            node.targets[outcome] = self._ending(outcome)
        node.targets[self._exhausted] = self._ending(self._exhausted_outcome)
        within_limits = node.execute if node.limits is not None else None

        def execute_for_item(view: Any) -> Any:
            frame = self._frame
            assert frame is not None
            if frame.repeat:
                frame.repeat = False
            elif not self._draw(frame):
                return self._exhausted
            return within_limits(view) if within_limits is not None else node.enter(view)

        node.execute = execute_for_item
        return {self._state_label: node}

    def _ending(self, outcome: str) -> Exit:
        return Exit(self._final_outcome_map.get(outcome, outcome))

    def _draw(self, frame: Frame) -> bool:
        """Put the next item into userdata, if there is one."""
        try:
            if frame.items is None:
                items = self._items() if callable(self._items) else self._items
                frame.items = iter(items)
                # Resumed from a checkpoint: the items before were dealt with.
                for _ in range(frame.index):
                    next(frame.items, None)
            item = next(frame.items)
        except StopIteration:
            return False
        except Exception as error:
            raise InvalidUserCodeError(
                f"The items of iterator '{frame.path}' raised {describe(error)} after "
                f'{frame.index} items'
            ) from error
        frame.index += 1
        self.userdata._data[self._items_label] = item
        return True

    def _sort_requests(
        self, frame: Frame, left: Node, outcome: Any, target: Node | Exit
    ) -> tuple[Node | Exit, bool]:
        preempted = self._preempt_requested
        target, moves = super()._sort_requests(frame, left, outcome, target)
        if preempted and target is left and outcome is not SUSPENDED:
            # A preempt ends the loop whatever the outcome, as in SMACH.
            self.service_preempt()
            return self._ending(outcome), True
        return target, moves

    # The container's interface.

    def get_initial_states(self) -> list[str]:
        """The state's label."""
        return [self._state_label]

    def set_initial_state(
        self, initial_states: LabelSequence[str], userdata: UserData | None = None
    ) -> None:
        """Add to the iterator's userdata; it always begins with its only state."""
        for label in initial_states:
            self[label]
        if userdata is not None:
            self.userdata.update(userdata)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Loop and break outcomes as (outcome, label, label or outcome of the iterator)."""
        edges: list[tuple[str, str, str | None]] = [
            (outcome, self._state_label, self._state_label) for outcome in self._loop_outcomes
        ]
        for outcome in self._break_outcomes:
            ending = self._final_outcome_map.get(outcome)
            edges.append((outcome, self._state_label, None if ending == outcome else ending))
        return edges
