"""What a container is compiled into: a node for each state, with its limits and its targets.

A `ContainerProgram` holds what a container was given by its builder (states, interrupts,
remappings, limits, callbacks), the table of nodes made of that, and where its execution is. The
loop (`frame`) executes programs; a container is the interface to one.

Also what is told of a transition from one node to the next.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypedDict

from state_machines.autonomy import Approval
from state_machines.clock import WALL_CLOCK, Clock
from state_machines.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
    describe,
    shown,
)
from state_machines.state import State, structure_version
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
class StateLimits:
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
) -> StateLimits | None:
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
    return StateLimits(timeout, deadline, retry, frozenset(failures), late)


class StateEntry:
    """How a state is executed for which calling its ``execute`` is not all.

    Attributes:
        program: Of the container that the loop goes into; None for other states.
        inputs: The keys to copy into that container's userdata: (its name, the name outside).
        outputs: The keys to copy out of it, likewise.
        plain_keys: The two lists are all that is to be done; False where constants are among the
            keys.
        relays: The container hands a preempt on as the engine does it, not in a way of its own.
        limits: Time limits and retries, if it has any.
        approvals: The autonomy that its outcomes need.
        draws: It is executed for one item of an iterator after another.
    """

    __slots__ = (
        'approvals',
        'draws',
        'hooked',
        'inputs',
        'limits',
        'outputs',
        'plain_keys',
        'program',
        'relays',
    )

    def __init__(
        self,
        program: ContainerProgram | None,
        view: Remapper,
        limits: StateLimits | None,
        approvals: Mapping[str, Approval] | None,
        *,
        draws: bool,
    ) -> None:
        self.program = program
        self.inputs, self.outputs, self.plain_keys = view.fsm_names()
        self.relays = program is not None and program.container.fsm_passes_on('request_preempt')
        self.limits = limits
        self.approvals = approvals
        self.draws = draws
        self.hooked = draws or limits is not None or approvals is not None
        """Whether the frame is asked before and after the state (`Frame.before`)."""


class StateNode:
    """One state of a container as the loop needs it.

    Attributes:
        label: The state's label in its container; empty for all states of a concurrence together.
        path: The state's path from the root.
        state: The state.
        execute: What the loop calls; the state's own `execute` as a rule.
        entry: What else there is to do; None for most states.
        view: The state's view of the container's userdata.
        targets: Where each outcome leads.
        priority: Of an interrupt's branch; `LOWEST` for ordinary states.
    """

    __slots__ = ('entry', 'execute', 'label', 'path', 'priority', 'state', 'targets', 'view')

    is_exit = False
    kind = 'transition'

    def __init__(
        self,
        label: str,
        path: str,
        state: State,
        view: Remapper,
        priority: float = LOWEST,
    ) -> None:
        self.label = label
        self.path = path
        self.state = state
        self.execute: Callable[[Any], Any] = state.execute
        self.entry: StateEntry | None = None
        self.view = view
        self.targets: dict[Any, StateNode | Exit] = {}
        self.priority = priority

    @property
    def within(self) -> str:
        """The container's path."""
        return self.path[: -len(self.label) - 1] if self.label else self.path

    @property
    def program(self) -> ContainerProgram | None:
        """The program of the container that the loop goes into here, if it does."""
        return None if self.entry is None else self.entry.program

    @property
    def limits(self) -> StateLimits | None:
        """Time limits and retries, if the state has any."""
        return None if self.entry is None else self.entry.limits

    def target(self, outcome: Any) -> StateNode | Exit:
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
        if self.state.fsm_program is not None:
            self.state.fsm_program.frame = None

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


# A container, compiled.


@dataclass
class History:
    """Where a container that was put aside goes on.

    Attributes:
        current: Label of the state, or of the outcome when `leaving`; empty for all states of a
            concurrence.
        leaving: `current` is an outcome of the container.
        saved: Of the interrupts under way, where each goes on: (label, leaving).
        index: How many items an iterator had begun, the current one included.
        repeat: The current item had not ended.
        outcomes: Of a concurrence's children that had ended.
    """

    current: str = ''
    leaving: bool = False
    saved: list[tuple[str, bool]] = field(default_factory=list)
    index: int = 0
    repeat: bool = True
    outcomes: dict[str, str] = field(default_factory=dict)
    # An iterator suspended in this process goes on with its own generator.
    items: Any = None


Callback = tuple[Callable[..., Any], tuple[Any, ...]]

_raise_lock = threading.Lock()


class ContainerProgram:
    """What a container holds, compiled for the loop.

    Args:
        container: The container; `container.Container` says what it is.
        path: Its path.

    Attributes:
        states: The states by label.
        branches: The interrupts by label.
        remappings: From the userdata keys of states and interrupts to the container's, by label.
        constants: Values of the states' input keys that come from no userdata, by label.
        limits: The states' time limits and retries, by label.
        approvals: The autonomy that outcomes of the states need, by label.
        start_cbs: The registered callbacks, and likewise the others.
        table: The nodes of states and interrupts by label, as they were last made.
        first: The node that an execution begins with.
        data: The dictionary behind the userdata, as it was when the table was made.
        frame: The execution of the container, while there is one.
        history: Where the next execution goes on, when the last one was put aside.
        raised: Interrupts that have been raised and have not begun.
    """

    # A `frame.Frame`.
    frame: Any = None
    history: History | None = None
    raised: tuple[Branch, ...] = ()
    table: Mapping[str, StateNode] = {}
    first: Any = None
    data: dict[str, Any]
    # What the table was made for; see `is_current`.
    _version = -1
    _clock: Clock = WALL_CLOCK
    _userdata: Any = None
    _made_at = ''
    _limits_version = -1
    _has_limits = False
    _of_execution = frozenset({'frame', 'history', 'raised', 'table', 'first', 'data'})

    def __init__(self, container: Any, path: str) -> None:
        self.container = container
        self.path = path
        self.states: dict[str, State] = {}
        self.branches: dict[str, Branch] = {}
        self.remappings: dict[str, Mapping[str, str]] = {}
        self.constants: dict[str, Mapping[str, Any]] = {}
        self.limits: dict[str, StateLimits] = {}
        self.approvals: dict[str, Mapping[str, Approval]] = {}
        self.start_cbs: list[Callback] = []
        self.transition_cbs: list[Callback] = []
        self.termination_cbs: list[Callback] = []

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy takes over: all but what belongs to an execution."""
        return {
            name: value
            for name, value in vars(self).items()
            if name not in self._of_execution
            and name not in ('_version', '_clock', '_userdata', '_made_at', '_limits_version')
        }

    def path_of(self, label: str) -> str:
        """Return the path of the state with a label; without one, the container's own."""
        return f'{self.path}/{label}' if label else self.path

    def children(self) -> dict[str, State]:
        """Return the states and interrupts inside by label."""
        if not self.branches:
            return self.states
        return self.states | {label: branch.state for label, branch in self.branches.items()}

    def put(
        self,
        label: str,
        state: State,
        remapping: Mapping[str, str] | None,
        constants: Mapping[str, Any] | None,
        limits: StateLimits | None,
    ) -> None:
        """Put a state under its label; what is said of it has been checked."""
        self.states[label] = state
        if limits is not None:
            self.limits[label] = limits
        if remapping:
            self.remappings[label] = dict(remapping)
        if constants:
            self.constants[label] = dict(constants)
        structure_version.changed()

    # The table.

    def is_current(self, path: str, clock: Clock) -> bool:
        """Tell whether the table is what would be made now."""
        return (
            self._version == structure_version.number
            and self._userdata is self.container.userdata._data
            and self._clock is clock
            and self._made_at == path
        )

    def make(self, path: str, clock: Clock) -> None:
        """Make the nodes of states and interrupts anew.

        Args:
            path: The path at which the container is executed.
            clock: What waits go by.

        Raises:
            InvalidTransitionError: The container cannot run.
        """
        # A registration that comes meanwhile must not be taken for one that came before.
        version = structure_version.number
        container = self.container
        container.check_consistency()
        self.path = path
        self.data = self._userdata = container.userdata._data
        self._clock = container.fsm_clock = clock
        table = container.fsm_make_table()
        self.first = container.fsm_first_of(table)
        self.table = self._with_branches(table)
        self._version, self._made_at = version, path

    def node(
        self, label: str, state: State, priority: float = LOWEST, *, draws: bool = False
    ) -> StateNode:
        """Make the node of one state; its targets are left to the container's kind."""
        path = self.path_of(label)
        view = Remapper(
            self.container.userdata,
            state.get_registered_input_keys(),
            state.get_registered_output_keys(),
            self.remappings.get(label, ()),
            self.constants.get(label),
            path,
        )
        node = StateNode(label, path, state, view, priority)
        if state.fsm_clock is not self._clock:
            state.fsm_clock = self._clock
        limits = self.limits.get(label)
        program = state.fsm_program if state.fsm_is_entered() else None
        approvals = self.approvals.get(label)
        if program is not None or limits is not None or approvals is not None or draws:
            node.entry = StateEntry(program, view, limits, approvals, draws=draws)
        if state.fsm_left is not None:
            state.fsm_left.block_reentry(node)
        return node

    def _with_branches(self, table: dict[str, StateNode]) -> dict[str, StateNode]:
        """Add the nodes of interrupts to those of states."""
        states = dict(table) if self.branches else table
        for branch in self.branches.values():
            node = table[branch.label] = self.node(branch.label, branch.state, branch.priority)
            for outcome in branch.state.get_registered_outcomes():
                name = branch.transitions.get(outcome, RESUME)
                if name == RESUME:
                    node.targets[outcome] = RESUMPTION
                else:
                    node.targets[outcome] = states.get(name) or Exit(name)
        return table

    def walk(self) -> Iterable[tuple[str, State]]:
        """Yield all states inside, however deep, with their labels; outer ones first."""
        pending = [self]
        while pending:
            for label, state in pending.pop().children().items():
                yield label, state
                if state.fsm_program is not None:
                    pending.append(state.fsm_program)

    def has_limits(self) -> bool:
        """Tell whether a state inside, however deep, has limits that somebody must watch."""
        if self._limits_version != structure_version.number:
            self._limits_version = structure_version.number
            self._has_limits = bool(self.limits) or any(
                state.fsm_program.limits
                for _, state in self.walk()
                if state.fsm_program is not None
            )
        return self._has_limits

    # Interrupts.

    def raise_branch(self, branch: Branch) -> None:
        """Have an interrupt wait for its turn, once."""
        with _raise_lock:
            if branch not in self.raised:
                self.raised = (*self.raised, branch)

    def withdraw_branch(self, label: str) -> bool:
        """Take back an interrupt that has not begun; tell whether there was one."""
        with _raise_lock:
            left = tuple(branch for branch in self.raised if branch.label != label)
            there, self.raised = len(left) < len(self.raised), left
        return there

    def take_raised(self, above: float = LOWEST) -> Branch | None:
        """Take the most urgent raised interrupt, if it is more urgent than `above`."""
        with _raise_lock:
            if not self.raised:
                return None
            urgent = max(self.raised, key=lambda branch: branch.priority)
            if urgent.priority <= above:
                return None
            self.raised = tuple(each for each in self.raised if each is not urgent)
            return urgent

    def place(self, label: str, leaving: bool) -> StateNode | Exit:
        """Return the node that a history names.

        Raises:
            InvalidStateError: There is no such state any more.
        """
        if leaving:
            return Exit(label)
        if label not in self.table:
            raise InvalidStateError(
                f"'{self.path}' cannot go on in '{label}': its states are {sorted(self.table)}"
            )
        return self.table[label]


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
        kind: See `transitions.Transition`; also ``start``, when a container begins or goes on,
            ``entered``, when a pause before `target` is over, ``question``, when a transition waits
            for a person or does so no more, and ``end``, when a root has ended.
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
        return self.kind not in ('start', 'entered', 'question', 'end')


RawTransition = Noted | tuple[StateNode, Any, float, dict[str, Any]]
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
