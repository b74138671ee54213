"""Time limits and retries of one state."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from surveillance_fsm.engine import SUSPENDED, Frame, Node
from surveillance_fsm.exceptions import InvalidTransitionError
from surveillance_fsm.log import logwarn
from surveillance_fsm.run import Strand, Watch
from surveillance_fsm.state import State
from surveillance_fsm.this_thread import this_thread

TIMEOUT = 'timeout'
"""The outcome of a state that ran out of time, where its transitions bind it."""


@dataclass(frozen=True)
class Limits:
    """What a container holds a state to.

    Attributes:
        timeout: Seconds of the machine's clock after which the state is asked to stop.
        deadline: Seconds after which the machine goes on without the state.
        retry: How often the state is executed again after a failure.
        failures: The outcomes that count as one.
        late_outcome: The outcome that running out of time has.
    """

    timeout: float | None
    deadline: float | None
    retry: int
    failures: frozenset[str]
    late_outcome: str


def make_limits(
    path: str,
    state: State,
    transitions: Mapping[str, Any],
    timeout: float | None,
    deadline: float | None,
    retry: int,
    retry_on: Iterable[str],
) -> Limits | None:
    """Check limits and settle which outcome running out of time has.

    Args:
        path: The state's path, for errors.
        state: The state.
        transitions: Its transitions; ``timeout`` may be among them without being declared.
        timeout: See `Limits`.
        deadline: See `Limits`; None with a timeout leaves it to the preempt's bound.
        retry: See `Limits`.
        retry_on: Outcomes that count as failures, beside running out of time.

    Raises:
        InvalidTransitionError: There is no outcome for running out of time, or a number is wrong.
    """
    if timeout is None and deadline is None and not retry:
        return None
    for name, value in (('timeout', timeout), ('deadline', deadline)):
        if value is not None and not value > 0:
            raise InvalidTransitionError(
                f"State '{path}' has {name} {value!r}: expected seconds above 0"
            )
    if retry < 0:
        raise InvalidTransitionError(f"State '{path}' has retry {retry}: expected 0 or more")
    outcomes = state.get_registered_outcomes()
    late = ''
    if timeout is not None or deadline is not None:
        for late in (TIMEOUT, 'aborted', 'preempted'):
            if late in transitions or late in outcomes:
                break
        else:
            raise InvalidTransitionError(
                f"State '{path}' has a time limit but no outcome for it: bind '{TIMEOUT}' in its "
                f'transitions (its outcomes are {sorted(outcomes)})'
            )
    failures = {outcome for outcome in retry_on if outcome in outcomes} | ({late} - {''})
    if retry and not failures:
        raise InvalidTransitionError(
            f"State '{path}' has retry {retry} but none of the outcomes {sorted(retry_on)} to "
            f'retry on (its outcomes are {sorted(outcomes)})'
        )
    return Limits(timeout, deadline, retry, frozenset(failures), late)


def limited(path: str, node: Node, limits: Limits) -> Callable[[Any], Any]:
    """Wrap what executes a state so that its limits are at work meanwhile."""
    timed = limits.timeout is not None or limits.deadline is not None

    def run(view: Any) -> Any:
        for attempt in range(limits.retry + 1):
            strand = this_thread.strand
            watch = strand.watch(node, limits) if strand is not None and timed else None
            try:
                outcome = node.enter(view)
            finally:
                if watch is not None and strand is not None:
                    strand.unwatch(watch)
            frame = strand.stack[-1] if strand is not None and strand.stack else None
            place = strand if frame is None else frame
            outcome = settle(path, node, place, watch, outcome)
            if outcome not in limits.failures or attempt == limits.retry:
                return outcome
            if node.state.preempt_requested() or (place is not None and place.wanted):
                return outcome
            logwarn(
                f"State '{path}' ended with '{outcome}': attempt {attempt + 2} of "
                f'{limits.retry + 1}'
            )
        return None

    return run


def settle(
    path: str, node: Node, place: Frame | Strand | None, watch: Watch | None, outcome: Any
) -> Any:
    """Turn what a state returned after running out of time into the outcome for that.

    Args:
        path: The state's path.
        node: Its node.
        place: The frame that it ran in; below a concurrence the strand.
        watch: Its limits at work.
        outcome: What it returned.
    """
    limits = node.limits
    if watch is None or not watch.asked or limits is None or outcome is SUSPENDED:
        return outcome
    if place is not None and place.wanted:
        return outcome  # Whoever wants it to end too sorts the request out.
    ignored = node.state.preempt_requested()
    if ignored:
        # It ended by itself; the request came too late or for nothing.
        node.state.recall_preempt()
        if outcome != 'preempted':
            return outcome
    logwarn(f"State '{path}' was stopped after its timeout of {limits.timeout:g} s")
    return limits.late_outcome
