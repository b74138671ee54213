"""What every container that runs can do: begin a run of its own, be interrupted, be put aside."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any

from surveillance_fsm.container import Container
from surveillance_fsm.control import Control
from surveillance_fsm.engine import RESUME, Branch, Frame, History
from surveillance_fsm.exceptions import (
    InvalidStateError,
    InvalidTransitionError,
)
from surveillance_fsm.interface import has_smach_interface
from surveillance_fsm.run import DEFAULT_PREEMPT_TIMEOUT, Run, Strand
from surveillance_fsm.state import State
from surveillance_fsm.supervision import supervise
from surveillance_fsm.this_thread import this_thread
from surveillance_fsm.waiting import WALL_CLOCK, Clock, Interrupt


class ActiveContainer(Container):
    """Base of the engine's own containers.

    A container that is executed by user code is a root: it runs on a thread of its own while the
    caller watches over it. One that a container of the engine executes joins that run.
    """

    _fsm_bounds_itself = False
    """Whether the container itself sees to it that its children heed a preempt in time."""

    def __init__(
        self,
        outcomes: Iterable[str],
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys)
        self._frame: Frame | None = None
        self._fsm_clock = WALL_CLOCK
        self._fsm_preempt_timeout: float | None = DEFAULT_PREEMPT_TIMEOUT
        self._fsm_control = Control(self)
        self._fsm_history: History | None = None
        self._fsm_raised: list[Branch] = []
        # Asked to be put aside in the moment before it began.
        self._fsm_aside = False
        self._states: dict[str, State] = {}
        self._branches: dict[str, Branch] = {}
        self._table_version = 0

    # States by label.

    def __getitem__(self, key: str) -> State:
        try:
            return self._states[key]
        except KeyError:
            raise KeyError(
                f"'{self._fsm_path}' has no state '{key}': its states are {sorted(self._states)}"
            ) from None

    def get_children(self) -> dict[str, State]:
        """The states by label."""
        return dict(self._states)

    def _check_new(self, label: str, state: State) -> None:
        """Raise `InvalidStateError` when `state` cannot be added as `label`."""
        path = self._path_of(label)
        if label in self._states or label in self._branches:
            raise InvalidStateError(f"State '{path}' is already there: a label names one state")
        if not has_smach_interface(state) or not callable(getattr(state, 'execute', None)):
            raise InvalidStateError(f"State '{path}' must be an instance of State, not {state!r}")

    # Settings.

    @property
    def control(self) -> Control:
        """Pausing, stepping, forcing outcomes and watching transitions, while this is the root."""
        return self._fsm_control

    @property
    def preempt_timeout(self) -> float | None:
        """Seconds (steady time) that a state may ignore a preempt while this is the root.

        After that the run goes on as if the state had ended with ``preempted`` (or ``aborted``, if
        it has only that), and the log names it. With None a state is waited for as long as it
        takes, as SMACH does, and a root without time limits runs in the thread that executes it.
        """
        return self._fsm_preempt_timeout

    @preempt_timeout.setter
    def preempt_timeout(self, seconds: float | None) -> None:
        if seconds is not None and not seconds > 0:
            raise InvalidStateError(
                f"'{self._fsm_path}': preempt_timeout is {seconds!r}, expected seconds above 0 or "
                'None'
            )
        self._fsm_preempt_timeout = seconds

    def set_clock(self, clock: Clock) -> None:
        """Give a root the clock that `State.wait` and the states' time limits go by."""
        self._fsm_clock = clock

    def set_name(self, name: str) -> None:
        """Name a root: paths begin with it."""
        self._fsm_path = name

    def get_name(self) -> str:
        """The path of the container: a root's name, or where a run found it."""
        return self._fsm_path

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
            PreemptIgnoredError: A state ignored a preempt, and no outcome was there to end with.
        """
        strand = this_thread.strand
        if strand is not None and strand.enters(self):
            return self._enter(strand, parent_ud)
        control = self._fsm_control
        wakeup = Interrupt()
        run = Run(control.condition, self._fsm_clock, self._fsm_preempt_timeout, control.trace)
        strand = Strand(run, self._fsm_path, wakeup)
        strand.begin_with(self)
        with control.begun(run):
            if self._fsm_preempt_timeout is None and not self._has_limits():
                return strand.run_here(lambda: self._enter(strand, parent_ud))
            strand.start(lambda: self._enter(strand, parent_ud))
            try:
                while not strand.done:
                    supervise(run, [strand], wakeup)
            except BaseException:
                # An interrupt from the keyboard, as a rule: stop what runs before passing it on.
                self.request_preempt()
                while not strand.done:
                    supervise(run, [strand], wakeup)
                raise
        if strand.error is not None:
            raise strand.error
        return strand.outcome

    @abstractmethod
    def _enter(self, strand: Strand, parent_ud: Any) -> Any:
        """Run as part of a strand."""

    @abstractmethod
    def _has_limits(self) -> bool:
        """Whether a state inside has limits that somebody must watch."""

    def is_running(self) -> bool:
        """Whether the container is executing."""
        return self._frame is not None

    def _path_of(self, label: str) -> str:
        return f'{self._fsm_path}/{label}'

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
        path = self._path_of(label)
        if label in self._branches or label in self.get_children():
            raise InvalidStateError(f"Interrupt '{path}' is already there: a label names one state")
        bound = dict(transitions or {})
        for outcome in bound:
            if outcome not in state.get_registered_outcomes():
                raise InvalidTransitionError(
                    f"Interrupt '{path}' has no outcome '{outcome}' to bind: its outcomes are "
                    f'{sorted(state.get_registered_outcomes())}'
                )
        for outcome in state.get_registered_outcomes():
            ends = outcome == 'preempted' and outcome in self._outcomes
            bound.setdefault(outcome, outcome if ends else RESUME)
        self._branches[label] = Branch(label, state, priority, bound, dict(remapping or {}))
        self._table_version += 1
        return state

    def raise_interrupt(self, label: str) -> None:
        """Run an interrupt as soon as what runs makes way; from any thread.

        Raised while the container does not run, it is the first thing that runs. Raised again
        before it began, it runs once.

        Raises:
            InvalidStateError: There is no such interrupt.
        """
        branch = self._branches.get(label)
        if branch is None:
            raise InvalidStateError(
                f"'{self._fsm_path}' has no interrupt '{label}': its interrupts are "
                f'{sorted(self._branches)}'
            )
        if branch not in self._fsm_raised:
            self._fsm_raised.append(branch)
        # A run that begins from here on finds it by itself.
        frame = self._frame
        if frame is not None:
            with frame.strand.run.condition:
                if self._frame is not None:
                    self._interrupted()

    def withdraw_interrupt(self, label: str) -> bool:
        """Take back an interrupt that has not begun; tells whether there was one."""
        for branch in self._fsm_raised:
            if branch.label == label:
                self._fsm_raised.remove(branch)
                return True
        return False

    def _fsm_woken(self) -> None:
        """Wake the thread that runs the container, if it waits: it was left behind."""

    @abstractmethod
    def _interrupted(self) -> None:
        """Make way for what is in `_fsm_raised`; under the run's condition."""

    @abstractmethod
    def _suspend(self) -> None:
        """Have the container put aside with its history; under the run's condition."""

    def _heed_suspension(self, frame: Frame) -> None:
        """Have a run that has just begun put aside, if that was asked before it began."""
        with frame.strand.run.condition:
            frame.suspending = frame.suspending or self._fsm_aside
            self._fsm_aside = False

    def _branch_faults(self) -> list[str]:
        names = {*self.get_children(), *self.get_registered_outcomes(), RESUME}
        return [
            f"outcome '{outcome}' of interrupt '{branch.label}' leads to '{target}', which is "
            f"neither a state, nor an outcome, nor '{RESUME}'"
            for branch in self._branches.values()
            for outcome, target in branch.transitions.items()
            if target not in names
        ]


def stop_for_now(state: State) -> None:
    """Ask a state to make way: a container keeps its history, any other state is preempted."""
    if isinstance(state, ActiveContainer):
        state._suspend()
    else:
        state.request_preempt()


def let_go(state: State) -> None:
    """Take `stop_for_now` back from a state that had not begun."""
    if isinstance(state, ActiveContainer):
        state._fsm_aside = False
    else:
        state.recall_preempt()


def forget(state: State) -> None:
    """Drop the history of a state that will not be resumed."""
    if getattr(state, '_fsm_progress', None) is not None:
        state._fsm_progress = None
    if isinstance(state, ActiveContainer):
        state._fsm_history = None
        for child in state.get_children().values():
            forget(child)
        for branch in state._branches.values():
            forget(branch.state)
