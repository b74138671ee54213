"""What a container is compiled into: a node for each state, with its limits and its targets.

Also what is told of a transition from one node to the next.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypedDict

from state_machines.exceptions import (
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
    describe,
    shown,
)
from state_machines.state import State
from state_machines.userdata import Remapper

LOWEST = float('-inf')
"""The priority of ordinary work, below that of every interrupt."""


class _Suspended:
    """What a container returns when its parent put it aside with its history kept."""

    def __repr__(self) -> str:
        return 'SUSPENDED'


SUSPENDED: Any = _Suspended()


# Where outcomes lead.


class Exit:
    """Where a transition leaves the container."""

    __slots__ = ('label',)

    is_exit = True
    priority = LOWEST
    kind = 'exit'

    def __init__(self, label: str) -> None:
        self.label = label


RESUME = 'RESUME'
"""Target of an interrupt's outcome: go on where the interrupt came."""

RESUMPTION = Exit(RESUME)


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


TIMEOUT = 'timeout'
"""The outcome of a state that ran out of time, where its transitions bind it."""


class LimitOptions(TypedDict, total=False):
    """What limits a state, as the ``add`` of every container takes it; each may be left out.

    Attributes:
        timeout: Seconds of the machine's clock after which the state is asked to stop. Its outcome
            is then ``timeout`` if the transitions bind that, else ``aborted``, else ``preempted``.
        deadline: Seconds after which the machine goes on without the state, with the same outcome;
            with a timeout alone it is left to the preempt's bound.
        retry: How often the state is executed again when it ran out of time or ended with one of
            `retry_on`.
        retry_on: Outcomes that count as failures, beside running out of time; ``aborted`` by
            itself.
    """

    timeout: float | None
    deadline: float | None
    retry: int
    retry_on: Iterable[str]


def make_limits(
    path: str,
    state: State,
    bound: Iterable[str],
    *,
    timeout: float | None = None,
    deadline: float | None = None,
    retry: int = 0,
    retry_on: Iterable[str] = ('aborted',),
) -> Limits | None:
    """Check limits and settle which outcome running out of time has.

    Args:
        path: The state's path, for errors.
        state: The state.
        bound: The outcomes that its container binds; ``timeout`` need not be declared.
        timeout: See `LimitOptions`, as the rest.
        deadline: Seconds.
        retry: How often.
        retry_on: Outcomes.

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
            if late in bound or late in outcomes:
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


class Node:
    """One state of a container as the loop needs it.

    Attributes:
        within: The container's path.
        label: The state's label in its container; empty for all states of a concurrence together.
        path: The state's path from the root.
        state: The state.
        is_container: The state is one of the engine's containers.
        enter: What runs it; the state's own `execute` as a rule.
        execute: What the loop calls: `enter`, within the state's limits if it has any.
        view: The state's view of the container's userdata.
        targets: Where each outcome leads.
        limits: Time limits and retries, if it has any.
        priority: Of an interrupt's branch; `LOWEST` for ordinary states.
    """

    __slots__ = (
        'enter',
        'execute',
        'is_container',
        'label',
        'limits',
        'path',
        'priority',
        'state',
        'targets',
        'view',
        'within',
    )

    is_exit = False
    kind = 'transition'

    def __init__(
        self,
        within: str,
        label: str,
        path: str,
        state: State,
        view: Remapper,
        priority: float = LOWEST,
    ) -> None:
        self.within = within
        self.label = label
        self.path = path
        self.state = state
        self.is_container = hasattr(state, 'fsm_frame')
        self.enter: Callable[[Any], Any] = state.execute
        self.execute: Callable[[Any], Any] = self.enter
        self.view = view
        self.targets: dict[Any, Node | Exit] = {}
        self.limits: Limits | None = None
        self.priority = priority

    def target(self, outcome: Any) -> Node | Exit:
        """Return where `outcome` leads.

        Raises:
            InvalidTransitionError: The state has no such outcome.
        """
        if outcome is SUSPENDED:
            return self
        try:
            return self.targets[outcome]
        except (KeyError, TypeError):
            returned = (
                'None instead of an outcome' if outcome is None else f'outcome {shown(outcome)}'
            )
            raise InvalidTransitionError(
                f"State '{self.path}' of type {type(self.state).__name__} returned {returned}: its "
                f'outcomes are {sorted(self.state.get_registered_outcomes())}'
            ) from None

    def release(self) -> None:
        """Drop the frame of a container that has ended, now that its parent has noted that."""
        if self.is_container:
            self.state.fsm_frame = None  # type: ignore[attr-defined]

    def revoke(self) -> None:
        """Cut the view in use off the userdata, and make a new one for the next execution."""
        self.view = self.view.fsm_revoke()

    def user_fault(self, error: Exception) -> SmachError:
        """Return the engine's error for what the state's code raised; to be raised from that."""
        return self.view.fsm_explain(error) or InvalidUserCodeError(
            f"State '{self.path}' of type {type(self.state).__name__} raised {describe(error)}"
        )


@dataclass(eq=False)
class Branch:
    """An interrupt declared on a container.

    Attributes:
        label: Its name.
        state: What runs when it is raised.
        priority: It cuts work of lower priority short.
        transitions: From the state's outcomes to `RESUME`, labels or outcomes of the container.
    """

    label: str
    state: State
    priority: float
    transitions: dict[str, str]


# What is told to a trace.


class Noted(NamedTuple):
    """A transition as it was noted.

    Attributes:
        path: Path of the container.
        source: Label of the state that was left; empty at the start.
        outcome: What that ended with.
        target: Label of the state entered, or the container's outcome.
        time: Seconds on the machine's clock.
        userdata: Shallow copy of the container's userdata.
        kind: See `history.Transition`; also ``start``, when a container begins or goes on,
            ``entered``, when a pause before `target` is over, and ``end``, when a root has ended.
    """

    path: str
    source: str
    outcome: str
    target: str
    time: float
    userdata: dict[str, Any]
    kind: str

    @property
    def is_transition(self) -> bool:
        """Whether a state was left, or a child of a concurrence ended."""
        return self.kind not in ('start', 'entered', 'end')


RawTransition = Noted | tuple[Node, Any, float, dict[str, Any]]
"""A transition; one that is as the table says may be told as what was left, its outcome, the time
and a shallow copy of the container's userdata, which costs the loop least."""


def unfold(raw: RawTransition) -> Noted:
    """Say in full what a trace was given."""
    if isinstance(raw, Noted):
        return raw
    left, outcome, time, userdata = raw
    target = left.targets[outcome]
    return Noted(left.within, left.label, str(outcome), target.label, time, userdata, target.kind)


Trace = Callable[[RawTransition], object]
"""Takes transitions as the loop notes them; see `unfold`."""
