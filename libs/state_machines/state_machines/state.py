"""The state: outcomes, userdata keys, an ``execute`` method, and a preempt it can wait on.

Attributes whose names begin with ``fsm_`` belong to the engine's own modules; a state's code has no
need of them.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

from state_machines.clock import WALL_CLOCK, Clock, Interrupt, elapsed_of
from state_machines.exceptions import InvalidStateError, shown

_shared_names: dict[frozenset[str], frozenset[str]] = {}


class StructureVersion:
    """Counts the changes to states and containers after which tables must be made anew."""

    def __init__(self) -> None:
        self.number = 0

    def changed(self) -> None:
        """Have every container make its table anew before its next execution."""
        self.number += 1


structure_version = StructureVersion()


class _ThisThread(threading.local):
    """What the current thread executes for a machine: the logical thread, and its frames.

    The list of frames says which of a logical thread's successive threads this one is: whoever
    takes an execution over gives it another list.
    """

    thread: Any = None
    stack: Any = None


this_thread = _ThisThread()


def names(what: str, given: Iterable[str]) -> frozenset[str]:
    """Check names of outcomes or keys; equal sets of names are one object.

    Raises:
        InvalidStateError: One string stands where a list of them is expected, or a name is none.
    """
    if isinstance(given, str):
        raise InvalidStateError(f'{what} is the string {given!r}: expected a list of strings')
    try:
        found = frozenset(given)
    except TypeError:
        raise InvalidStateError(f'{what} is {shown(given)}: expected a list of strings') from None
    for name in found:
        if not isinstance(name, str):
            raise InvalidStateError(f'{what} has {shown(name)}: expected strings')
    return _shared_names.setdefault(found, found)


def has_smach_interface(obj: object) -> bool:
    """Tell whether `obj` tells its outcomes and userdata keys the way a state does."""
    return (
        hasattr(obj, 'get_registered_input_keys')
        and hasattr(obj, 'get_registered_output_keys')
        and hasattr(obj, 'get_registered_outcomes')
    )


class CBInterface:
    """A callable together with the outcomes and userdata keys it adds to a state."""

    def __init__(
        self,
        cb: Callable[..., Any],
        outcomes: Iterable[str] | None = None,
        input_keys: Iterable[str] | None = None,
        output_keys: Iterable[str] | None = None,
        io_keys: Iterable[str] | None = None,
    ) -> None:
        both = names('io_keys', io_keys or ())
        self._cb = cb
        self._outcomes = names('outcomes', outcomes or ())
        self._input_keys = names('input_keys', input_keys or ()) | both
        self._output_keys = names('output_keys', output_keys or ()) | both

    @property
    def function(self) -> Callable[..., Any]:
        """The callable itself."""
        return self._cb

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self._cb(*args, **kwargs)

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """Return the userdata keys the callback reads."""
        return tuple(self._input_keys)

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """Return the userdata keys the callback writes."""
        return tuple(self._output_keys)

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """Return the outcomes the callback may return."""
        return tuple(self._outcomes)


def cb_interface(
    outcomes: Iterable[str] | None = None,
    input_keys: Iterable[str] | None = None,
    output_keys: Iterable[str] | None = None,
    io_keys: Iterable[str] | None = None,
) -> Callable[[Callable[..., Any]], CBInterface]:
    """Return a decorator that gives a function a `CBInterface`."""
    return lambda cb: CBInterface(cb, outcomes, input_keys, output_keys, io_keys)


class State:
    """Base of all states, with SMACH's interface.

    A state declares the outcomes it may return and the userdata keys it reads and writes; the
    container holds it to both. A state that takes its time looks at `preempt_requested` or, better,
    sleeps with `wait`, which a preempt ends at once.

    A state may be copied and pickled. The copy begins anew: it is on the wall clock, nothing is
    asked of it, and it has come nowhere yet.

    Args:
        outcomes: What `execute` may return.
        input_keys: Userdata keys that are read.
        output_keys: Userdata keys that are written.
        io_keys: Userdata keys that are both.

    Raises:
        InvalidStateError: Outcomes or keys are not lists of strings.
    """

    # Class attributes, so that a state costs no memory for what it does not use, and so that a
    # subclass works that never calls this constructor.
    _outcomes: frozenset[str] = frozenset()
    _input_keys: frozenset[str] = frozenset()
    _output_keys: frozenset[str] = frozenset()
    fsm_clock: Clock = WALL_CLOCK
    fsm_interrupt: Interrupt | None = None
    fsm_progress: dict[str, Any] | None = None
    fsm_waiting: tuple[str, float] | None = None
    fsm_left: Any = None
    fsm_source: Mapping[str, Any] | None = None
    # Whether it makes way for an interrupt with its history kept, as containers do.
    fsm_suspends = False
    # What a container is compiled into.
    fsm_program: Any = None
    fsm_of_execution: ClassVar[frozenset[str]] = frozenset(
        {
            'fsm_clock',
            'fsm_interrupt',
            'fsm_progress',
            'fsm_waiting',
            'fsm_left',
        }
    )

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        both = names('io_keys', io_keys)
        self._outcomes = names('outcomes', outcomes)
        self._input_keys = names('input_keys', both.union(names('input_keys', input_keys)))
        self._output_keys = names('output_keys', both.union(names('output_keys', output_keys)))

    def __getstate__(self) -> Any:
        """Return what a copy takes over: all but what belongs to an execution."""
        whole: Any = super().__getstate__()
        if isinstance(whole, tuple):
            attributes, slots = whole
            return self._without_execution(attributes or {}), slots
        return self._without_execution(whole or {})

    def _without_execution(self, attributes: dict[str, Any]) -> dict[str, Any]:
        dropped = self.fsm_of_execution
        return {name: value for name, value in attributes.items() if name not in dropped}

    def execute(self, ud: Any) -> str | None:
        """Do the state's work; called on entry.

        Args:
            ud: The state's view of userdata.

        Returns:
            One of the registered outcomes.
        """
        raise NotImplementedError(f'{type(self).__name__} does not define execute(self, ud)')

    def register_outcomes(self, new_outcomes: Iterable[str]) -> None:
        """Add outcomes."""
        self._outcomes = names('outcomes', self._outcomes.union(names('outcomes', new_outcomes)))
        structure_version.changed()

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """Return the outcomes the state may return."""
        return tuple(self._outcomes)

    def register_io_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are read and written."""
        keys = names('keys', keys)
        self.register_input_keys(keys)
        self.register_output_keys(keys)

    def register_input_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are read."""
        self._input_keys = names('keys', self._input_keys.union(names('keys', keys)))
        structure_version.changed()

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """Return the userdata keys the state reads."""
        return tuple(self._input_keys)

    def register_output_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are written."""
        self._output_keys = names('keys', self._output_keys.union(names('keys', keys)))
        structure_version.changed()

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """Return the userdata keys the state writes."""
        return tuple(self._output_keys)

    def fsm_take_over(self, callback: Any, *, outcomes: bool = True) -> bool:
        """Add what a callback declares by itself, see `cb_interface`; tell whether it does."""
        if not has_smach_interface(callback):
            return False
        self.register_input_keys(callback.get_registered_input_keys())
        self.register_output_keys(callback.get_registered_output_keys())
        if outcomes:
            self.register_outcomes(callback.get_registered_outcomes())
        return True

    def request_preempt(self) -> None:
        """Ask the state to stop; a `wait` under way, or the next one, ends at once."""
        self.interrupt.set()

    def service_preempt(self) -> None:
        """Acknowledge the request: the state stopped because of it."""
        State.recall_preempt(self)

    def recall_preempt(self) -> None:
        """Take the request back."""
        if self.fsm_interrupt is not None:
            self.fsm_interrupt.clear()

    def preempt_requested(self) -> bool:
        """Tell whether a request to stop is pending."""
        return self.fsm_interrupt is not None and self.fsm_interrupt.is_set()

    @property
    def _preempt_requested(self) -> bool:
        """The flag as states written for SMACH read it, and clear it by assignment."""
        return self.preempt_requested()

    @_preempt_requested.setter
    def _preempt_requested(self, requested: bool) -> None:
        change = State.request_preempt if requested else State.recall_preempt
        change(self)

    def request_shutdown(self) -> None:
        """Ask the state to stop because the program ends."""
        self.request_preempt()

    def wait(self, seconds: float, progress: str | None = None) -> bool:
        """Sleep on the machine's clock until the time is over or a preempt comes.

        Args:
            seconds: How long, in seconds of the machine's clock.
            progress: A name under which the time already waited is kept when an interrupt of a
                container cuts the state short: resumed, the state waits only for the rest.

        Returns:
            True when the full time passed, False when a preempt ended the wait.
        """
        clock = self.fsm_clock
        elapsed = elapsed_of(clock)
        before = self.progress.get(progress, 0.0) if progress is not None else 0.0
        start = elapsed() - before
        if progress is not None:
            self.fsm_waiting = (progress, start)
        while True:
            interrupt = self.interrupt
            finished = clock.sleep(max(0.0, start + seconds - elapsed()), interrupt)
            # A preempt that was serviced meanwhile may wake a wait it was not meant for.
            if finished or self.preempt_requested():
                break
        if progress is not None:
            self.fsm_waiting = None
            self.progress[progress] = seconds if finished else elapsed() - start
        return finished

    @property
    def progress(self) -> dict[str, Any]:
        """How far the state has come: kept while an interrupt cuts it short, and in checkpoints.

        A state that can go on where it was writes values here and looks at them when it is
        executed. Any other end of the state empties it.
        """
        if self.fsm_progress is None:
            self.fsm_progress = {}
            # The loop that executes the state looks at it when it ends.
            if this_thread.stack:
                this_thread.stack[-1].attention = True
        return self.fsm_progress

    @property
    def interrupt(self) -> Interrupt:
        """What a preempt raises: for waits and calls that take an interrupt of their own."""
        if self.fsm_interrupt is None:
            # In one step: two threads may come here at once.
            self.__dict__.setdefault('fsm_interrupt', Interrupt())
        assert self.fsm_interrupt is not None
        return self.fsm_interrupt

    # What a container overrides.

    def fsm_is_entered(self) -> bool:
        """Tell whether the loop goes into it, as into a container, and does not call it."""
        return False

    def fsm_suspend(self) -> None:
        """Ask the state to make way for an interrupt; under the machine's condition."""
        self.request_preempt()

    def fsm_forget(self) -> None:
        """Drop how far the state has come: it will not be resumed."""
        self.fsm_progress = None


class CBState(State):
    """A state made of one function.

    Args:
        cb: Called with the userdata, `cb_args` and `cb_kwargs`; its value is the outcome. What a
            `CBInterface` declares is taken over.
        cb_args: Further positional arguments.
        cb_kwargs: Further keyword arguments.
        outcomes: See `State`.
        input_keys: See `State`.
        output_keys: See `State`.
        io_keys: See `State`.
    """

    def __init__(
        self,
        cb: Callable[..., str | None],
        cb_args: Iterable[Any] = (),
        cb_kwargs: Mapping[str, Any] | None = None,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        self._cb = cb
        self._cb_args = tuple(cb_args)
        self._cb_kwargs = dict(cb_kwargs or {})
        self.fsm_take_over(cb)

    @property
    def function(self) -> Callable[..., Any]:
        """The function itself, out of its `CBInterface` if it has one."""
        return self._cb.function if isinstance(self._cb, CBInterface) else self._cb

    def execute(self, ud: Any) -> str | None:
        """Call the function."""
        return self._cb(ud, *self._cb_args, **self._cb_kwargs)
