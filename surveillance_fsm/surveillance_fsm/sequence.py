"""The sequence: a state machine whose states lead to the next one added."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from surveillance_fsm.state import State
from surveillance_fsm.state_machine import StateMachine


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
        self._connector_outcome = connector_outcome
        self._last_added_seq_label: str | None = None

    @staticmethod
    def add(
        label: str,
        state: State,
        transitions: Mapping[str, str | None] | None = None,
        remapping: Mapping[str, str] | None = None,
        constants: Mapping[str, Any] | None = None,
        **limits: Any,
    ) -> State:
        """Add a state after the last one; for the arguments see `StateMachine.add`.

        The last state's connector outcome leads here, unless its own transitions bind it.
        """
        sequence = Sequence._currently_opened_container()
        last = sequence._last_added_seq_label
        StateMachine.add(label, state, transitions, remapping, constants, **limits)
        if last is not None and not sequence._transitions[last].get(sequence._connector_outcome):
            sequence._transitions[last][sequence._connector_outcome] = label
        sequence._last_added_seq_label = label
        return state
