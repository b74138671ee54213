"""The container: a state that runs other states, built under ``with``.

`Container` is the interface that its kinds have in common: construction, callbacks, execution,
interrupts. What it was given is in its `ContainerProgram`, and how that is run is the matter of the
loop (`frame`).
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Any, ClassVar, Self, Unpack

from state_machines.clock import Clock, Interrupt
from state_machines.exceptions import (
    InvalidConstructionError,
    InvalidStateError,
    InvalidTransitionError,
    describe,
    shown,
    unknown,
)
from state_machines.execution import Control, ExecutionThread
from state_machines.frame import Frame, execute_root
from state_machines.log import logerr
from state_machines.program import (
    RESUME,
    TIMEOUT,
    Branch,
    Callback,
    ContainerProgram,
    Exit,
    LimitOptions,
    StateNode,
    make_limits,
)
from state_machines.state import State, structure_version, this_thread
from state_machines.timeouts import supervise
from state_machines.userdata import UserData


class _Construction(threading.local):
    """The containers being built in this thread, innermost last, with `opened`'s arguments."""

    def __init__(self) -> None:
        self.stack: list[tuple[Container, Mapping[str, Any]]] = []


_construction = _Construction()
_control_lock = threading.Lock()


class Container(State):
    """Base of the states that run other states.

    A container that is executed by user code is a root. It runs on the thread that calls it, unless
    a state inside has a time limit or `preempt_timeout` is set: then it runs on another thread,
    while the caller watches over it. A container inside another one joins that one's run.

    Args:
        outcomes: What the container may end with.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.

    Attributes:
        userdata: What the states inside share.
        fsm_program: What the container was given, compiled, and where its execution is.
        fsm_frame_type: How the container is executed.
        fsm_arguments: What else may be said of a state that is added.
    """

    together = False
    """Whether all states run at the same time."""
    fsm_suspends = True
    fsm_frame_type: ClassVar[type[Frame]] = Frame
    fsm_arguments: ClassVar[tuple[str, ...]] = (
        'transitions',
        'remapping',
        'constants',
        'autonomy',
    )

    fsm_program: ContainerProgram
    _control: Control | None = None
    _preempt_timeout: float | None = None
    fsm_of_execution: ClassVar[frozenset[str]] = State.fsm_of_execution | {'_control'}

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self.userdata = UserData()
        self.fsm_program = ContainerProgram(self, type(self).__name__)

    # What each kind of container defines.

    def get_initial_states(self) -> list[str]:
        """Return the labels of the children a run begins with."""
        raise NotImplementedError

    def set_initial_state(
        self, initial_states: Sequence[str], userdata: UserData | None = None
    ) -> None:
        """Choose the children a run begins with, and add to the container's userdata.

        An iterator always begins with its only state, a concurrence with all.

        Raises:
            KeyError: There is no such state.
        """
        for label in initial_states:
            self[label]
        if userdata is not None:
            self.userdata.update(userdata)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Transitions inside, as (outcome, from label, to label)."""
        raise NotImplementedError

    def fsm_faults(self) -> list[str]:
        """Return what keeps the container from running, but for its interrupts."""
        raise NotImplementedError

    def fsm_make_table(self) -> dict[str, StateNode]:
        """Make the nodes of the states by label, and say where their outcomes lead."""
        raise NotImplementedError

    def fsm_first_of(self, table: Mapping[str, StateNode]) -> StateNode | Exit:
        """Return the node of a table that an execution begins with."""
        raise NotImplementedError

    # States by label.

    def __getitem__(self, key: str) -> State:
        try:
            return self.fsm_program.states[key]
        except KeyError:
            raise KeyError(
                f"'{self.get_name()}' has no state '{key}': its states are "
                f'{sorted(self.fsm_program.states)}'
            ) from None

    def get_children(self) -> dict[str, State]:
        """Return the children by label."""
        return dict(self.fsm_program.states)

    def get_active_states(self) -> list[str]:
        """Return the labels of the children that are running."""
        frame = self.fsm_program.frame
        return [] if frame is None or frame.ended else list(frame.active_labels())

    def is_running(self) -> bool:
        """Tell whether the container is executing."""
        frame = self.fsm_program.frame
        return frame is not None and not frame.ended

    # Settings.

    @property
    def control(self) -> Control:
        """Pausing, stepping, forcing outcomes and watching transitions, while this is the root."""
        control = self._control
        if control is None:
            with _control_lock:
                control = self._control = self._control or Control(self.get_name)
        return control

    @property
    def preempt_timeout(self) -> float | None:
        """Seconds (steady time) that a state may ignore a preempt while this is the root.

        After that the run goes on as if the state had ended with ``preempted`` (or ``aborted``, if
        it has only that), and the log names it. For that the root runs on a thread of its own. With
        None, as it is at first, a state is waited for as long as it takes, as SMACH does.
        """
        return self._preempt_timeout

    @preempt_timeout.setter
    def preempt_timeout(self, seconds: float | None) -> None:
        if seconds is not None and not seconds > 0:
            raise InvalidStateError(
                f"'{self.get_name()}': preempt_timeout is {seconds!r}, expected seconds above 0 or "
                'None'
            )
        self._preempt_timeout = seconds

    def set_clock(self, clock: Clock) -> None:
        """Give a root the clock that `State.wait` and the states' time limits go by."""
        self.fsm_clock = clock

    def set_name(self, name: str) -> None:
        """Name a root: paths begin with it.

        Raises:
            InvalidStateError: The name is no string, or empty.
        """
        if not isinstance(name, str) or not name:
            raise InvalidStateError(f'Name {shown(name)} must be a string that is not empty')
        self.fsm_program.path = name

    def get_name(self) -> str:
        """Return the path of the container: a root's name, or where a run found it."""
        return self.fsm_program.path

    # Callbacks.

    def register_start_cb(self, start_cb: Callable[..., Any], cb_args: Iterable[Any] = ()) -> None:
        """Call ``start_cb(userdata, initial_states, *cb_args)`` on entry."""
        self.fsm_program.start_cbs.append((start_cb, tuple(cb_args)))

    def register_transition_cb(
        self, transition_cb: Callable[..., Any], cb_args: Iterable[Any] = ()
    ) -> None:
        """Call ``transition_cb(userdata, active_states, *cb_args)`` on every transition inside."""
        self.fsm_program.transition_cbs.append((transition_cb, tuple(cb_args)))

    def register_termination_cb(
        self, termination_cb: Callable[..., Any], cb_args: Iterable[Any] = ()
    ) -> None:
        """Call ``termination_cb(userdata, terminal_states, outcome, *cb_args)`` on exit."""
        self.fsm_program.termination_cbs.append((termination_cb, tuple(cb_args)))

    def call_start_cbs(self) -> None:
        """Call the start callbacks; what they raise is logged."""
        self._call(self.fsm_program.start_cbs, 'start', self.get_initial_states)

    def call_transition_cbs(self) -> None:
        """Call the transition callbacks; what they raise is logged."""
        self._call(self.fsm_program.transition_cbs, 'transition', self.get_active_states)

    def call_termination_cbs(self, terminal_states: Sequence[str], outcome: str | None) -> None:
        """Call the termination callbacks; what they raise is logged."""
        self._call(
            self.fsm_program.termination_cbs, 'termination', lambda: list(terminal_states), outcome
        )

    def _call(
        self,
        callbacks: list[Callback],
        kind: str,
        states: Callable[[], list[str]],
        *further: Any,
    ) -> None:
        for callback, args in tuple(callbacks):
            try:
                callback(self.userdata, states(), *further, *args)
            except Exception as error:
                logerr(
                    f"{kind.capitalize()} callback {shown(callback)} of '{self.get_name()}' raised "
                    f'{describe(error)}'
                )

    # Construction.

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: TracebackType | None,
    ) -> None:
        if exc_type is None:
            self.close()
        else:
            self._leave_construction()

    @contextmanager
    def opened(self, **kwargs: Any) -> Iterator[Self]:
        """Open the container for construction.

        Args:
            **kwargs: ``transitions``: a mapping of outcomes to targets that every state added
                inside takes for those of its outcomes that it does not bind itself.
        """
        with self:
            _construction.stack[-1] = self, kwargs
            yield self

    def open(self, **kwargs: Any) -> None:
        """Make this the container that states are added to in this thread."""
        _construction.stack.append((self, kwargs))

    def close(self) -> None:
        """End construction and log what the container still lacks to be run."""
        if not self.is_opened():
            raise InvalidStateError(
                f"Cannot close '{self.get_name()}': it is not the open container"
            )
        self._leave_construction()
        try:
            self.check_consistency()
        except (InvalidStateError, InvalidTransitionError) as error:
            logerr(str(error))

    def is_opened(self) -> bool:
        """Tell whether states added now go to this container."""
        return bool(_construction.stack) and _construction.stack[-1][0] is self

    def assert_opened(self, msg: str = '') -> None:
        """Raise `InvalidConstructionError` unless the container is open."""
        if not self.is_opened():
            raise InvalidConstructionError(
                msg or f"'{self.get_name()}' is not open for construction"
            )

    def _leave_construction(self) -> None:
        # Everything opened inside and left open by an error goes with it.
        stack = _construction.stack
        for depth in range(len(stack) - 1, -1, -1):
            if stack[depth][0] is self:
                del stack[depth:]
                return

    @classmethod
    def _currently_opened_container(cls) -> Self:
        if not _construction.stack:
            raise InvalidConstructionError(
                f'{cls.__name__}: no container is open; add states inside "with container:"'
            )
        container = _construction.stack[-1][0]
        if not isinstance(container, cls):
            raise InvalidConstructionError(
                f"{cls.__name__}: the open container '{container.get_name()}' is a "
                f'{type(container).__name__}'
            )
        return container

    @staticmethod
    def _group_transitions() -> Mapping[str, str]:
        transitions: Mapping[str, str] = _construction.stack[-1][1].get('transitions', {})
        return transitions

    def _check_new(self, label: str, state: State) -> None:
        """Raise `InvalidStateError` when `state` cannot be added as `label`."""
        if not isinstance(label, str) or not label or '/' in label:
            raise InvalidStateError(
                f"Label {shown(label)} in '{self.get_name()}' must be a string that is not empty "
                'and has no slash: it is a part of paths'
            )
        path = self.fsm_program.path_of(label)
        if label in self.fsm_program.states or label in self.fsm_program.branches:
            raise InvalidStateError(f"State '{path}' is already there: a label names one state")
        if not isinstance(state, State):
            raise InvalidStateError(
                f"State '{path}' must be an instance of State, not {shown(state)}"
            )

    def check_state_spec(self, label: str, state: State, transitions: Iterable[str]) -> None:
        """Raise `InvalidTransitionError` when `transitions` binds an outcome the state lacks."""
        outcomes = state.get_registered_outcomes()
        path = self.fsm_program.path_of(label)
        for outcome in transitions:
            if outcome not in outcomes:
                raise InvalidTransitionError(
                    f"State '{path}' has no outcome '{outcome}' to bind: its "
                    f'outcomes are {sorted(outcomes)}'
                )

    def _register(
        self,
        label: str,
        state: State,
        bound: Iterable[str],
        remapping: Mapping[str, str] | None,
        constants: Mapping[str, Any] | None,
        **limits: Unpack[LimitOptions],
    ) -> None:
        """Check a state of any kind of container and put it under its label.

        Args:
            label: The state's name in the container.
            state: The state.
            bound: The outcomes that the container binds; ``timeout`` need not be declared.
            remapping: From the state's userdata keys to the container's.
            constants: Values for input keys of the state that come from no userdata.
            **limits: See `LimitOptions`.
        """
        for name in limits.keys() - LimitOptions.__annotations__.keys():
            known = {*self.fsm_arguments, *LimitOptions.__annotations__}
            raise TypeError(
                f"State '{self.fsm_program.path_of(label)}': argument {unknown(name, known)}"
            )
        self._check_new(label, state)
        checked = make_limits(self.fsm_program.path_of(label), state, bound, **limits)
        self.check_state_spec(
            label, state, [name for name in bound if checked is None or name != TIMEOUT]
        )
        self.fsm_program.put(label, state, remapping, constants, checked)

    # Running.

    def execute(self, parent_ud: Any = None) -> Any:
        """Run to an outcome.

        Args:
            parent_ud: Userdata that input keys come from and output keys go to.

        Returns:
            The outcome; None when the shutdown check ended the run.

        Raises:
            InvalidTransitionError: The container cannot run, or a state returned an outcome that
                it does not have.
            InvalidUserCodeError: A state raised an exception, or broke the userdata contract.
            InvalidStateError: The container is running already.
            InvalidTransitionError: A state ignored a preempt, and no outcome was there to end with.
        """
        here = this_thread
        thread: ExecutionThread | None = here.thread
        if thread is not None and here.stack:
            current = here.stack[-1].current
            if isinstance(current, StateNode) and current.state is self:
                # It is the engine that executes it, not the code of a state.
                return execute_root(here.stack, thread, self.fsm_program, parent_ud)
        return self._execute_as_root(parent_ud)

    def _execute_as_root(self, parent_ud: Any) -> Any:
        """Begin a run of its own, and watch it to its end where somebody asked for that."""
        program, control = self.fsm_program, self.control
        control.fsm_begin(self.fsm_clock, self._preempt_timeout)
        try:
            if self._preempt_timeout is None and not program.has_limits():
                thread = ExecutionThread(control, program.path, None)
                return thread.run_here(
                    lambda stack: execute_root(stack, thread, program, parent_ud)
                )
            return self._execute_watched(parent_ud)
        finally:
            program.frame = None
            control.fsm_end()

    def _execute_watched(self, parent_ud: Any) -> Any:
        """Run on another thread, which is left behind if a state hangs."""
        program, control, wakeup = self.fsm_program, self.control, Interrupt()
        thread = ExecutionThread(control, program.path, wakeup)
        thread.start(lambda: execute_root(this_thread.stack, thread, program, parent_ud))
        try:
            while not thread.done:
                supervise(control, [thread], wakeup)
        except BaseException:
            # An interrupt from the keyboard, as a rule: stop what runs before passing it on.
            self.request_preempt()
            while not thread.done:
                supervise(control, [thread], wakeup)
            raise
        if thread.error is not None:
            raise thread.error
        return thread.outcome

    def request_preempt(self) -> None:
        """Ask the container to stop: the request reaches what runs inside at once."""
        super().request_preempt()
        frame = self.fsm_program.frame
        if frame is None:
            return
        with frame.condition:
            frame = self.fsm_program.frame
            if frame is not None:
                frame.preempt()

    def fsm_passes_on(self, method: str) -> bool:
        """Tell whether a method is the engine's, and neither a subclass nor the object has one."""
        return method not in vars(self) and getattr(type(self), method) is vars(Container)[method]

    def fsm_is_entered(self) -> bool:
        """Tell whether the loop goes into it: always, unless a subclass executes it otherwise."""
        return self.fsm_passes_on('execute')

    # Interrupts.

    def add_interrupt(
        self,
        label: str,
        state: State,
        priority: float = 0,
        transitions: Mapping[str, str] | None = None,
        remapping: Mapping[str, str] | None = None,
    ) -> State:
        """Declare an interrupt: a state that `raise_interrupt` runs in place of all else inside.

        What runs is asked to stop and keeps its history: nested containers the state they were in,
        states their `State.progress`. After the interrupt's state the container goes on there,
        unless the outcome leads elsewhere.

        Args:
            label: The interrupt's name, among those of the states.
            state: What runs.
            priority: An interrupt cuts short states and interrupts of lower priority.
            transitions: From outcomes to `RESUME`, to labels of the container's states, or to its
                outcomes. Outcomes that are not bound lead to `RESUME`, but ``preempted`` to the
                container's outcome of that name if it has one.
            remapping: From the state's userdata keys to the container's.

        Raises:
            InvalidStateError: The label is taken.
            InvalidTransitionError: `transitions` binds an outcome the state does not have.
        """
        self._check_new(label, state)
        bound = dict(transitions or {})
        self.check_state_spec(label, state, bound)
        for outcome in state.get_registered_outcomes():
            ends = outcome == 'preempted' and outcome in self._outcomes
            bound.setdefault(outcome, outcome if ends else RESUME)
        program = self.fsm_program
        program.branches[label] = Branch(label, state, priority, bound)
        if remapping:
            program.remappings[label] = dict(remapping)
        structure_version.changed()
        return state

    def raise_interrupt(self, label: str) -> None:
        """Run an interrupt as soon as what runs makes way; from any thread.

        Raised while the container does not run, it is the first thing that runs. Raised again
        before it began, it runs once.

        Raises:
            InvalidStateError: There is no such interrupt.
        """
        program = self.fsm_program
        branch = program.branches.get(label)
        if branch is None:
            raise InvalidStateError(
                f"'{program.path}' has no interrupt '{label}': its interrupts are "
                f'{sorted(program.branches)}'
            )
        program.raise_branch(branch)
        # A run that begins from here on finds it by itself.
        frame = program.frame
        if frame is not None:
            with frame.condition:
                frame = program.frame
                if frame is not None:
                    frame.interrupted()

    def withdraw_interrupt(self, label: str) -> bool:
        """Take back an interrupt that has not begun; tells whether there was one."""
        return self.fsm_program.withdraw_branch(label)

    def fsm_suspend(self) -> None:
        """Have the container put aside with its history; under the machine's condition."""
        frame = self.fsm_program.frame
        if frame is not None:
            frame.suspend()

    def fsm_forget(self) -> None:
        """Drop the history of the container and of all inside: it will not be resumed."""
        self.fsm_progress = self.fsm_program.history = None
        for _, state in self.fsm_program.walk():
            state.fsm_progress = None
            if state.fsm_program is not None:
                state.fsm_program.history = None

    def check_consistency(self) -> None:
        """Raise `InvalidTransitionError` naming all that keeps the container from running."""
        program = self.fsm_program
        states = () if self.together else program.states
        names = {*states, *self.get_registered_outcomes(), RESUME}
        faults = self.fsm_faults() + [
            f"outcome '{outcome}' of interrupt '{branch.label}' leads to '{target}', which is "
            f"neither a state, nor an outcome, nor '{RESUME}'"
            for branch in program.branches.values()
            for outcome, target in branch.transitions.items()
            if target not in names
        ]
        if faults:
            raise InvalidTransitionError(
                f"{type(self).__name__} '{program.path}' cannot run: {'; '.join(faults)} (states: "
                f'{sorted(program.states)}, outcomes: {sorted(self._outcomes)})'
            )
