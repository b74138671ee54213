"""How a concurrence makes one outcome of those of its children."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from surveillance_fsm.container import describe
from surveillance_fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
)
from surveillance_fsm.state import State

Outcomes = dict[str, str | None]
ChildTerminationCallback = Callable[[Outcomes], bool | Iterable[str] | None]
OutcomeCallback = Callable[[Outcomes], str | None]


class OutcomePolicy:
    """The default outcome, the outcome map and the callbacks of a concurrence.

    Args:
        outcomes: The concurrence's outcomes.
        default: See `Concurrence`.
        outcome_map: See `Concurrence`.
        outcome_cb: See `Concurrence`.
        child_termination_cb: See `Concurrence`.

    Raises:
        InvalidStateError: It names outcomes that are not declared, or a callback cannot be called.
    """

    def __init__(
        self,
        outcomes: frozenset[str],
        default: str,
        outcome_map: Mapping[str, Mapping[str, str]] | None,
        outcome_cb: OutcomeCallback | None,
        child_termination_cb: ChildTerminationCallback | None,
    ) -> None:
        self._outcomes = outcomes
        self._default = default
        self._outcome_cb = outcome_cb
        self._child_termination_cb = child_termination_cb
        self.outcome_map = {key: dict(value) for key, value in (outcome_map or {}).items()}
        faults = [
            f'{outcome!r} is not one of its outcomes {sorted(outcomes)}'
            for outcome in (default, *self.outcome_map)
            if outcome not in outcomes
        ]
        for name, callback in (
            ('outcome_cb', outcome_cb),
            ('child_termination_cb', child_termination_cb),
        ):
            if callback is not None and not callable(callback):
                faults.append(f'{name} {callback!r} cannot be called')
        if faults:
            raise InvalidStateError(
                f'The outcome policy of a Concurrence is wrong: {"; ".join(faults)}'
            )

    def faults(self, states: Mapping[str, State]) -> list[str]:
        """What the outcome map asks of states that they cannot do."""
        faults = []
        for outcome, wanted in self.outcome_map.items():
            for label, end in wanted.items():
                state = states.get(label)
                if state is None:
                    faults.append(f"outcome '{outcome}' asks for state '{label}', which it lacks")
                elif end not in state.get_registered_outcomes():
                    faults.append(
                        f"outcome '{outcome}' asks for '{end}' of state '{label}', whose outcomes "
                        f'are {sorted(state.get_registered_outcomes())}'
                    )
        return faults

    def to_stop(self, path: str, ends: Outcomes) -> frozenset[str]:
        """Labels of the states to stop now that one has ended.

        Args:
            path: The concurrence's path, for errors.
            ends: The outcomes of all states; None for those that run.

        Raises:
            InvalidUserCodeError: The callback raised.
        """
        if self._child_termination_cb is None:
            return frozenset()
        try:
            stop = self._child_termination_cb(dict(ends))
        except Exception as error:
            raise InvalidUserCodeError(
                f"The child_termination_cb of '{path}' raised {describe(error)}"
            ) from error
        if not stop:
            return frozenset()
        if isinstance(stop, str):
            return frozenset([stop])
        return frozenset(ends) if isinstance(stop, bool) else frozenset(stop)

    def decide(self, path: str, ends: Outcomes) -> str:
        """The concurrence's outcome, all states having ended.

        Raises:
            InvalidUserCodeError: The callback raised.
            InvalidTransitionError: It returned an outcome that is not declared.
        """
        outcome, most = self._default, 0
        for name, wanted in self.outcome_map.items():
            if len(wanted) >= most and all(ends[label] == end for label, end in wanted.items()):
                outcome, most = name, len(wanted)
        if self._outcome_cb is None:
            return outcome
        try:
            chosen = self._outcome_cb(dict(ends))
        except Exception as error:
            raise InvalidUserCodeError(
                f"The outcome_cb of '{path}' raised {describe(error)}"
            ) from error
        if not chosen:
            return outcome
        if chosen not in self._outcomes:
            raise InvalidTransitionError(
                f"The outcome_cb of '{path}' returned {chosen!r}: the outcomes are "
                f'{sorted(self._outcomes)}'
            )
        return chosen
