"""The state: outcomes, userdata keys, an ``execute`` method, and a preempt it can wait on."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

from surveillance_fsm.interface import has_smach_interface
from surveillance_fsm.this_thread import this_thread
from surveillance_fsm.waiting import WALL_CLOCK, Clock, Interrupt

# Guards the preempt flags of all states: it is held for a few instructions, on preempts and waits
# only, and never while user code runs.
_preempt_lock = threading.Lock()


class State:
    """Base of all states, with SMACH's interface.

    A state declares the outcomes it may return and the userdata keys it reads and writes; the
    container holds it to both. A state that takes its time looks at `preempt_requested` or, better,
    sleeps with `wait`, which a preempt ends at once.

    Args:
        outcomes: What `execute` may return.
        input_keys: Userdata keys that are read.
        output_keys: Userdata keys that are written.
        io_keys: Userdata keys that are both.
    """

    # Class attributes, so that a subclass that never calls this constructor again still works
    # after copying, and so that the names stay out of the subclass's way.
    _preempt_requested: bool = False
    _fsm_interrupt: Interrupt | None = None
    _fsm_clock: Clock = WALL_CLOCK
    _fsm_progress: dict[str, Any] | None = None
    _fsm_waiting: tuple[str, float] | None = None
    _fsm_left: threading.Event | None = None
    _fsm_registrations: ClassVar[list[int]] = [0]

    def __init__(
        self,
        outcomes: Iterable[str] = (),
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] = (),
    ) -> None:
        both = tuple(io_keys)
        self._outcomes: set[str] = set(outcomes)
        self._input_keys: set[str] = {*input_keys, *both}
        self._output_keys: set[str] = {*output_keys, *both}
        self._preempt_requested = False

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
        self._outcomes = self._outcomes.union(new_outcomes)
        self._fsm_registrations[0] += 1

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """The outcomes the state may return."""
        return tuple(self._outcomes)

    def register_io_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are read and written."""
        keys = tuple(keys)
        self._input_keys = self._input_keys.union(keys)
        self._output_keys = self._output_keys.union(keys)
        self._fsm_registrations[0] += 1

    def register_input_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are read."""
        self._input_keys = self._input_keys.union(keys)
        self._fsm_registrations[0] += 1

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """The userdata keys the state reads."""
        return tuple(self._input_keys)

    def register_output_keys(self, keys: Iterable[str]) -> None:
        """Add keys that are written."""
        self._output_keys = self._output_keys.union(keys)
        self._fsm_registrations[0] += 1

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """The userdata keys the state writes."""
        return tuple(self._output_keys)

    def request_preempt(self) -> None:
        """Ask the state to stop; a `wait` under way, or the next one, ends at once."""
        with _preempt_lock:
            self._preempt_requested = True
            interrupt = self._fsm_interrupt
        if interrupt is not None:
            interrupt.set()

    def service_preempt(self) -> None:
        """Acknowledge the request: the state stopped because of it."""
        self._drop_preempt()

    def recall_preempt(self) -> None:
        """Take the request back."""
        self._drop_preempt()

    def preempt_requested(self) -> bool:
        """Whether a request to stop is pending."""
        return self._preempt_requested

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
        clock = self._fsm_clock
        before = self.progress.get(progress, 0.0) if progress is not None else 0.0
        start = clock.now() - before
        if progress is not None:
            self._fsm_waiting = (progress, start)
        while True:
            interrupt = self._armed_interrupt()
            finished = clock.sleep(max(0.0, start + seconds - clock.now()), interrupt)
            # A preempt that was serviced meanwhile may wake a wait it was not meant for.
            if finished or self._preempt_requested:
                break
        if progress is not None:
            self._fsm_waiting = None
            self.progress[progress] = seconds if finished else clock.now() - start
        return finished

    @property
    def progress(self) -> dict[str, Any]:
        """How far the state has come: kept while an interrupt cuts it short, and in checkpoints.

        A state that can go on where it was writes JSON values here and looks at them when it is
        executed. Any other end of the state empties it.
        """
        if self._fsm_progress is None:
            self._fsm_progress = {}
            note_progress()
        return self._fsm_progress

    @property
    def interrupt(self) -> Interrupt:
        """What a preempt raises: for waits and calls that take an interrupt of their own."""
        return self._armed_interrupt()

    def _armed_interrupt(self) -> Interrupt:
        with _preempt_lock:
            interrupt = self._fsm_interrupt
            if interrupt is None:
                interrupt = self._fsm_interrupt = Interrupt()
            # The flag alone decides: code written for SMACH clears it by assignment.
            if not self._preempt_requested:
                interrupt.clear()
                return interrupt
        if not interrupt.is_set():
            interrupt.set()
        return interrupt

    def _drop_preempt(self) -> None:
        with _preempt_lock:
            self._preempt_requested = False
            if self._fsm_interrupt is not None:
                self._fsm_interrupt.clear()


def note_progress() -> None:
    """Have the loop look at the state that executes here when it ends: it has progress."""
    strand = this_thread.strand
    if strand is not None and strand.stack:
        strand.stack[-1].attention = True


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
        if has_smach_interface(cb):
            declared: Any = cb
            self.register_input_keys(declared.get_registered_input_keys())
            self.register_output_keys(declared.get_registered_output_keys())
            self.register_outcomes(declared.get_registered_outcomes())

    def execute(self, ud: Any) -> str | None:
        """Call the function."""
        return self._cb(ud, *self._cb_args, **self._cb_kwargs)
