"""The container: a state that runs other states, built under ``with``.

`Container` holds what its kinds have in common: construction, callbacks, userdata in and out, the
beginning of an execution, interrupts. How the states inside are run is the matter of the frame that
is made for each execution (`frame`).
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
from state_machines.execution import (
    DEFAULT_PREEMPT_TIMEOUT,
    Control,
    ExecutionThread,
    LeftBehindError,
)
from state_machines.frame import Frame, History
from state_machines.log import logerr, logwarn
from state_machines.nodes import (
    LOWEST,
    RESUME,
    RESUMPTION,
    TIMEOUT,
    Branch,
    Exit,
    LimitOptions,
    Limits,
    Node,
    make_limits,
)
from state_machines.state import State, structure_version, this_thread
from state_machines.timeouts import block_reentry, limited, supervise
from state_machines.userdata import Remapper, UserData, raw


class _Construction(threading.local):
    """The containers being built in this thread, innermost last, with `opened`'s arguments."""

    def __init__(self) -> None:
        self.stack: list[tuple[Container, Mapping[str, Any]]] = []


_construction = _Construction()
_entry_lock = threading.Lock()
_raise_lock = threading.Lock()

Callback = tuple[Callable[..., Any], tuple[Any, ...]]


class Container(State):
    """Base of the states that run other states.

    A container that is executed by user code is a root: it runs on a thread of its own while the
    caller watches over it. One that a container of the engine executes joins that run.

    Args:
        outcomes: What the container may end with.
        input_keys: Keys copied from the parent's userdata on entry.
        output_keys: Keys copied to the parent's userdata on exit.

    Attributes:
        userdata: What the states inside share.
        fsm_states: The states by label.
        fsm_branches: The interrupts by label.
        fsm_remappings: From the userdata keys of states and interrupts to the container's, by
            label.
        fsm_constants: Values of the states' input keys that come from no userdata, by label.
        fsm_limits: The states' time limits and retries, by label.
        fsm_transition_cbs: The registered callbacks, and likewise the others.
        fsm_frame: The execution of the container, while there is one.
        fsm_history: Where the next execution goes on, when the last one was put aside.
        fsm_raised: Interrupts that have been raised and have not begun.
        fsm_frame_type: How the container is executed.
        fsm_arguments: What else may be said of a state that is added.
        fsm_table: The nodes of states and interrupts by label, as they were last made.
        fsm_data: The dictionary behind the userdata, as it was then.
    """

    together = False
    """Whether all states run at the same time."""
    fsm_suspends = True
    fsm_frame_type: ClassVar[type[Frame]] = Frame
    fsm_arguments: ClassVar[tuple[str, ...]] = ('transitions', 'remapping', 'constants')

    fsm_frame: Frame | None = None
    fsm_history: History | None = None
    fsm_raised: tuple[Branch, ...] = ()
    fsm_table: Mapping[str, Node] = {}
    fsm_data: dict[str, Any]
    _table_made_for: tuple[int, int, int, str] | None = None
    _control: Control | None = None
    _preempt_timeout: float | None = DEFAULT_PREEMPT_TIMEOUT
    fsm_of_execution: ClassVar[frozenset[str]] = State.fsm_of_execution | {
        'fsm_frame',
        'fsm_history',
        'fsm_raised',
        'fsm_table',
        'fsm_data',
        '_table_made_for',
        '_control',
    }

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self.userdata = UserData()
        self.fsm_states: dict[str, State] = {}
        self.fsm_branches: dict[str, Branch] = {}
        self.fsm_remappings: dict[str, Mapping[str, str]] = {}
        self.fsm_constants: dict[str, Mapping[str, Any]] = {}
        self.fsm_limits: dict[str, Limits] = {}
        self.fsm_start_cbs: list[Callback] = []
        self.fsm_transition_cbs: list[Callback] = []
        self.fsm_termination_cbs: list[Callback] = []
        self.fsm_path = type(self).__name__

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

    def fsm_make_table(self) -> dict[str, Node]:
        """Make the nodes of the states by label, and say where their outcomes lead."""
        raise NotImplementedError

    def fsm_first(self) -> Node | Exit:
        """Return the node that an execution begins with."""
        raise NotImplementedError

    # States by label.

    def __getitem__(self, key: str) -> State:
        try:
            return self.fsm_states[key]
        except KeyError:
            raise KeyError(
                f"'{self.fsm_path}' has no state '{key}': its states are {sorted(self.fsm_states)}"
            ) from None

    def get_children(self) -> dict[str, State]:
        """Return the children by label."""
        return dict(self.fsm_states)

    def get_active_states(self) -> list[str]:
        """Return the labels of the children that are running."""
        frame = self.fsm_frame
        return [] if frame is None or frame.ended else frame.active_labels()

    def is_running(self) -> bool:
        """Tell whether the container is executing."""
        frame = self.fsm_frame
        return frame is not None and not frame.ended

    # Settings.

    @property
    def control(self) -> Control:
        """Pausing, stepping, forcing outcomes and watching transitions, while this is the root."""
        control = self._control
        if control is None:
            with _entry_lock:
                control = self._control = self._control or Control(self.get_name)
        return control

    @property
    def preempt_timeout(self) -> float | None:
        """Seconds (steady time) that a state may ignore a preempt while this is the root.

        After that the run goes on as if the state had ended with ``preempted`` (or ``aborted``, if
        it has only that), and the log names it. With None a state is waited for as long as it
        takes, as SMACH does, and a root without time limits runs in the thread that executes it.
        """
        return self._preempt_timeout

    @preempt_timeout.setter
    def preempt_timeout(self, seconds: float | None) -> None:
        if seconds is not None and not seconds > 0:
            raise InvalidStateError(
                f"'{self.fsm_path}': preempt_timeout is {seconds!r}, expected seconds above 0 or "
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
        self.fsm_path = name

    def get_name(self) -> str:
        """Return the path of the container: a root's name, or where a run found it."""
        return self.fsm_path

    # Callbacks.

    def register_start_cb(self, start_cb: Callable[..., Any], cb_args: Iterable[Any] = ()) -> None:
        """Call ``start_cb(userdata, initial_states, *cb_args)`` on entry."""
        self.fsm_start_cbs.append((start_cb, tuple(cb_args)))

    def register_transition_cb(
        self, transition_cb: Callable[..., Any], cb_args: Iterable[Any] = ()
    ) -> None:
        """Call ``transition_cb(userdata, active_states, *cb_args)`` on every transition inside."""
        self.fsm_transition_cbs.append((transition_cb, tuple(cb_args)))

    def register_termination_cb(
        self, termination_cb: Callable[..., Any], cb_args: Iterable[Any] = ()
    ) -> None:
        """Call ``termination_cb(userdata, terminal_states, outcome, *cb_args)`` on exit."""
        self.fsm_termination_cbs.append((termination_cb, tuple(cb_args)))

    def call_start_cbs(self) -> None:
        """Call the start callbacks; what they raise is logged."""
        self._call(self.fsm_start_cbs, 'start', self.get_initial_states)

    def call_transition_cbs(self) -> None:
        """Call the transition callbacks; what they raise is logged."""
        self._call(self.fsm_transition_cbs, 'transition', self.get_active_states)

    def call_termination_cbs(self, terminal_states: Sequence[str], outcome: str | None) -> None:
        """Call the termination callbacks; what they raise is logged."""
        self._call(self.fsm_termination_cbs, 'termination', lambda: list(terminal_states), outcome)

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
                    f"{kind.capitalize()} callback {shown(callback)} of '{self.fsm_path}' raised "
                    f'{describe(error)}'
                )

    # Userdata in and out.

    def fsm_copy_input_keys(self, parent_ud: Any) -> None:
        """Take the input keys over from the parent's userdata."""
        if parent_ud is None or not self._input_keys:
            return
        if not isinstance(parent_ud, Remapper):
            parent_ud = Remapper(parent_ud, self._input_keys)
        for key in parent_ud.fsm_copy_to(self.fsm_data, self._input_keys):
            logwarn(f"'{self.fsm_path}' starts without its input key '{key}': nobody set it")

    def fsm_copy_output_keys(self, parent_ud: Any) -> None:
        """Hand the output keys over to the parent's userdata."""
        if parent_ud is None or not self._output_keys:
            return
        if not isinstance(parent_ud, Remapper):
            parent_ud = Remapper(parent_ud, (), self._output_keys)
        for key in parent_ud.fsm_take_from(self.fsm_data, self._output_keys):
            logwarn(f"'{self.fsm_path}' ends without its output key '{key}': nobody set it")

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
            raise InvalidStateError(f"Cannot close '{self.fsm_path}': it is not the open container")
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
            raise InvalidConstructionError(msg or f"'{self.fsm_path}' is not open for construction")

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
                f"{cls.__name__}: the open container '{container.fsm_path}' is a "
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
                f"Label {shown(label)} in '{self.fsm_path}' must be a string that is not empty and "
                'has no slash: it is a part of paths'
            )
        path = self.fsm_path_of(label)
        if label in self.fsm_states or label in self.fsm_branches:
            raise InvalidStateError(f"State '{path}' is already there: a label names one state")
        if not isinstance(state, State):
            raise InvalidStateError(
                f"State '{path}' must be an instance of State, not {shown(state)}"
            )

    def check_state_spec(self, label: str, state: State, transitions: Iterable[str]) -> None:
        """Raise `InvalidTransitionError` when `transitions` binds an outcome the state lacks."""
        outcomes = state.get_registered_outcomes()
        for outcome in transitions:
            if outcome not in outcomes:
                raise InvalidTransitionError(
                    f"State '{self.fsm_path_of(label)}' has no outcome '{outcome}' to bind: its "
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
            raise TypeError(f"State '{self.fsm_path_of(label)}': argument {unknown(name, known)}")
        self._check_new(label, state)
        checked = make_limits(self.fsm_path_of(label), state, bound, **limits)
        self.check_state_spec(
            label, state, [name for name in bound if checked is None or name != TIMEOUT]
        )
        self.fsm_states[label] = state
        if checked is not None:
            self.fsm_limits[label] = checked
        if remapping:
            self.fsm_remappings[label] = dict(remapping)
        if constants:
            self.fsm_constants[label] = dict(constants)
        structure_version.changed()

    def fsm_path_of(self, label: str) -> str:
        """Return the path of the state with a label; without one, the container's own."""
        return f'{self.fsm_path}/{label}' if label else self.fsm_path

    # Nodes.

    def fsm_node(self, label: str, state: State, priority: float = LOWEST) -> Node:
        """Make the node of one state; its targets are left to the container's kind."""
        path = self.fsm_path_of(label)
        view = Remapper(
            self.userdata,
            state.get_registered_input_keys(),
            state.get_registered_output_keys(),
            self.fsm_remappings.get(label, ()),
            self.fsm_constants.get(label),
            path,
        )
        node = Node(self.fsm_path, label, path, state, view, priority)
        clock = self.fsm_clock
        if state.fsm_clock is not clock:
            state.fsm_clock = clock
        if state.fsm_left is not None:
            block_reentry(node, state.fsm_left)
        limits = node.limits = self.fsm_limits.get(label)
        if limits is not None:
            node.execute = limited(node, limits)
        return node

    def fsm_update_table(self, path: str, clock: Clock) -> None:
        """Make the nodes of states and interrupts anew if anything has changed.

        Args:
            path: The path at which the container is executed.
            clock: What waits go by.

        Raises:
            InvalidTransitionError: The container cannot run.
        """
        data = raw(self.userdata)
        # A registration that comes meanwhile must not be taken for one that came before.
        made_for = (structure_version.number, id(data), id(clock), path)
        if made_for != self._table_made_for:
            self.check_consistency()
            self.fsm_path, self.fsm_clock, self.fsm_data = path, clock, data
            self.fsm_table = self._with_branches(self.fsm_make_table())
            self._table_made_for = made_for

    def _with_branches(self, table: dict[str, Node]) -> dict[str, Node]:
        """Add the nodes of interrupts to those of states."""
        states = dict(table) if self.fsm_branches else table
        for branch in self.fsm_branches.values():
            node = table[branch.label] = self.fsm_node(branch.label, branch.state, branch.priority)
            for outcome in branch.state.get_registered_outcomes():
                name = branch.transitions.get(outcome, RESUME)
                if name == RESUME:
                    node.targets[outcome] = RESUMPTION
                else:
                    node.targets[outcome] = states.get(name) or Exit(name)
        return table

    def fsm_has_limits(self) -> bool:
        """Tell whether a state inside has limits that somebody must watch."""
        return bool(self.fsm_limits) or any(
            isinstance(state, Container) and state.fsm_has_limits()
            for state in self.fsm_children().values()
        )

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
        current = here.stack[-1].current if here.stack else None
        if thread is not None and isinstance(current, Node) and current.state is self:
            # It is the engine that executes it, not the code of a state.
            return self._enter(thread, here.stack, parent_ud)
        return self._execute_as_root(parent_ud)

    def _execute_as_root(self, parent_ud: Any) -> Any:
        """Begin a run of its own, and watch it to its end."""
        control, wakeup = self.control, Interrupt()

        def body() -> Any:
            return self._enter(thread, this_thread.stack, parent_ud)

        control.fsm_begin(self.fsm_clock, self._preempt_timeout)
        try:
            thread = ExecutionThread(control, self.fsm_path, wakeup)
            if self._preempt_timeout is None and not self.fsm_has_limits():
                return thread.run_here(body)
            thread.start(body)
            try:
                while not thread.done:
                    supervise(control, [thread], wakeup)
            except BaseException:
                # An interrupt from the keyboard, as a rule: stop what runs before passing it on.
                self.request_preempt()
                while not thread.done:
                    supervise(control, [thread], wakeup)
                raise
        finally:
            self.fsm_frame = None
            control.fsm_end()
        if thread.error is not None:
            raise thread.error
        return thread.outcome

    def _enter(self, thread: ExecutionThread, stack: list[Frame], parent_ud: Any) -> Any:
        """Run as part of a thread of execution."""
        if stack:
            path = stack[-1].current.path  # type: ignore[union-attr]
        else:
            path = thread.path
        before = self.fsm_frame
        if before is not None and not before.ended:
            raise InvalidStateError(f"'{self.fsm_path}' is running already")
        self.fsm_update_table(path, thread.control.clock)
        frame = self.fsm_frame_type(self, thread, path, self.fsm_first(), parent_ud)
        with _entry_lock:
            if self.fsm_frame is not before:
                raise InvalidStateError(f"'{self.fsm_path}' is running already")
            self.fsm_frame = frame
        if stack and stack[-1].cut is stack[-1].current:
            # It was asked to make way before it was visible that it had begun.
            frame.suspending = True
        # Whoever takes the thread over gives it another stack, and afterwards looks at this one.
        stack.append(frame)

        def run() -> Any:
            if stack is not thread.stack:
                raise LeftBehindError
            history, self.fsm_history = self.fsm_history, None
            return frame.execute(history)

        return frame.to_its_end(run)

    def request_preempt(self) -> None:
        """Ask the container to stop: the request reaches what runs inside at once."""
        super().request_preempt()
        frame = self.fsm_frame
        if frame is None:
            return
        with frame.control.condition:
            frame = self.fsm_frame
            if frame is not None:
                frame.preempt()

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
        self.fsm_branches[label] = Branch(label, state, priority, bound)
        if remapping:
            self.fsm_remappings[label] = dict(remapping)
        structure_version.changed()
        return state

    def raise_interrupt(self, label: str) -> None:
        """Run an interrupt as soon as what runs makes way; from any thread.

        Raised while the container does not run, it is the first thing that runs. Raised again
        before it began, it runs once.

        Raises:
            InvalidStateError: There is no such interrupt.
        """
        branch = self.fsm_branches.get(label)
        if branch is None:
            raise InvalidStateError(
                f"'{self.fsm_path}' has no interrupt '{label}': its interrupts are "
                f'{sorted(self.fsm_branches)}'
            )
        with _raise_lock:
            if branch not in self.fsm_raised:
                self.fsm_raised = (*self.fsm_raised, branch)
        # A run that begins from here on finds it by itself.
        frame = self.fsm_frame
        if frame is not None:
            with frame.control.condition:
                frame = self.fsm_frame
                if frame is not None:
                    frame.interrupted()

    def withdraw_interrupt(self, label: str) -> bool:
        """Take back an interrupt that has not begun; tells whether there was one."""
        with _raise_lock:
            left = tuple(branch for branch in self.fsm_raised if branch.label != label)
            there, self.fsm_raised = len(left) < len(self.fsm_raised), left
        return there

    def fsm_take_raised(self, above: float = LOWEST) -> Branch | None:
        """Take the most urgent raised interrupt, if it is more urgent than `above`."""
        with _raise_lock:
            if not self.fsm_raised:
                return None
            urgent = max(self.fsm_raised, key=lambda branch: branch.priority)
            if urgent.priority <= above:
                return None
            self.fsm_raised = tuple(each for each in self.fsm_raised if each is not urgent)
            return urgent

    def fsm_children(self) -> dict[str, State]:
        """Return the states and interrupts inside by label."""
        return self.fsm_states | {
            label: branch.state for label, branch in self.fsm_branches.items()
        }

    def fsm_suspend(self) -> None:
        """Have the container put aside with its history; under the machine's condition."""
        frame = self.fsm_frame
        if frame is not None:
            frame.suspend()

    def fsm_forget(self) -> None:
        """Drop the history of the container and of all inside: it will not be resumed."""
        super().fsm_forget()
        self.fsm_history = None
        for child in self.fsm_children().values():
            child.fsm_forget()

    def check_consistency(self) -> None:
        """Raise `InvalidTransitionError` naming all that keeps the container from running."""
        states = () if self.together else self.fsm_states
        names = {*states, *self.get_registered_outcomes(), RESUME}
        faults = self.fsm_faults() + [
            f"outcome '{outcome}' of interrupt '{branch.label}' leads to '{target}', which is "
            f"neither a state, nor an outcome, nor '{RESUME}'"
            for branch in self.fsm_branches.values()
            for outcome, target in branch.transitions.items()
            if target not in names
        ]
        if faults:
            raise InvalidTransitionError(
                f"{type(self).__name__} '{self.fsm_path}' cannot run: {'; '.join(faults)} (states: "
                f'{sorted(self.fsm_states)}, outcomes: {sorted(self._outcomes)})'
            )
