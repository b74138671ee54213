"""Watching and steering a root from outside: transitions, pausing, stepping, forced outcomes.

And the shutdown check: a machine asks it between two states, and ends with None when it is true.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from surveillance_fsm.exceptions import InvalidStateError, InvalidTransitionError, describe
from surveillance_fsm.execution import (
    ExecutionThread,
    Frame,
    Node,
    RawTransition,
    Run,
    Trace,
    Work,
)
from surveillance_fsm.log import logerr

shutdown_check: Callable[[], bool] | None = None
"""What was set with `set_shutdown_check`."""


def is_shutdown() -> bool:
    """Tell whether the check set with `set_shutdown_check` says that the program is shutting
    down.
    """
    return shutdown_check is not None and bool(shutdown_check())


def set_shutdown_check(cb: Callable[[], bool] | None) -> None:
    """Set the function that tells of a shutdown, for example ``lambda: not rclpy.ok()``.

    Args:
        cb: Called between any two states; None takes the check away.
    """
    global shutdown_check
    shutdown_check = cb


class Control:
    """What may be done to a root container from other threads, between runs too.

    Attributes:
        condition: The one condition of the machine.
        lock: Its lock.
    """

    def __init__(self, container: Any) -> None:
        # The condition's lock by itself, too: it is taken sooner.
        self.lock = threading.RLock()
        self.condition = threading.Condition(self.lock)
        self._container = container
        self._run: Run | None = None
        self._paused = False
        self._traces: list[Trace] = []
        self._trace: Trace | None = None
        self._left: list[tuple[str, Work]] = []

    @property
    def trace(self) -> Trace | None:
        """Where transitions are reported, if anywhere."""
        return self._trace

    def add_trace(self, trace: Trace) -> Callable[[], None]:
        """Report every transition to `trace`, in the thread that makes it.

        Args:
            trace: Takes each transition as the loop notes it; `history.unfold` says it in full.
                What it raises is logged.

        Returns:
            A function that ends the reports.
        """
        with self.condition:
            self._traces.append(trace)
            self._set_trace()

        def remove() -> None:
            with self.condition:
                if trace in self._traces:
                    self._traces.remove(trace)
                    self._set_trace()

        return remove

    def _set_trace(self) -> None:
        traces = tuple(self._traces)

        def tell_all(raw: RawTransition) -> None:
            for trace in traces:
                try:
                    trace(raw)
                except Exception as error:
                    logerr(f'Trace {trace!r} raised {describe(error)}')

        self._trace = None if not traces else traces[0] if len(traces) == 1 else tell_all
        if self._run is not None:
            self._run.trace = self._trace
            self._run.call_attention()

    @property
    def paused(self) -> bool:
        """Whether no further state is entered."""
        return self._paused

    def pause(self) -> None:
        """Enter no further state; the one that runs is not disturbed. A preempt goes through."""
        self._set_paused(True)

    def resume(self) -> None:
        """Go on after a pause."""
        self._set_paused(False)

    def _set_paused(self, paused: bool) -> None:
        with self.condition:
            self._paused = paused
            if self._run is not None:
                self._run.paused = paused
                self._run.steps = 0
                self._run.call_attention()

    def step(self) -> None:
        """Enter one more state of a paused machine.

        Raises:
            InvalidStateError: The machine is not paused, or does not run.
        """
        with self.condition:
            run = self._run
            if run is None or not run.paused:
                raise InvalidStateError(
                    f"'{self._container.get_name()}' cannot step: it is not "
                    f'{"running" if run is None else "paused"}'
                )
            run.steps += 1
            run.call_attention()

    def force_outcome(self, path: str, outcome: str) -> None:
        """End the state at `path` with `outcome`, whatever it returns itself.

        Args:
            path: Of a state that runs, or before which the machine is paused.
            outcome: One of its outcomes.

        Raises:
            InvalidStateError: No such state is active.
            InvalidTransitionError: It has no such outcome.
        """
        with self.condition:
            frames = self._run.frames() if self._run is not None else []
            # Attention first, then a look: what is current now is held until this is done.
            for each in frames:
                each.attention = True
            active = self._active()
            if path not in active:
                raise InvalidStateError(
                    f"State '{path}' is not active; the active ones are {sorted(active)}"
                )
            place, node = active[path]
            if outcome not in node.state.get_registered_outcomes():
                raise InvalidTransitionError(
                    f"State '{path}' cannot be forced to '{outcome}': its outcomes are "
                    f'{sorted(node.state.get_registered_outcomes())}'
                )
            if place.forced is not None and place.forced[0] is not node:
                raise InvalidStateError(
                    f"State '{path}' cannot be forced yet: '{place.forced[0].label}' has not ended "
                    f"with '{place.forced[1]}', as it was forced to"
                )
            place.forced = (node, outcome)
            if isinstance(place, Frame):
                place.thread.asked()
            else:
                place.wanted = True
                place.asked()
            node.state.request_preempt()
            self.condition.notify_all()

    def active_paths(self) -> list[str]:
        """Paths of all states that are active, containers included, outermost first."""
        with self.condition:
            return list(self._active())

    def _active(self) -> dict[str, tuple[Frame | ExecutionThread, Node]]:
        """Return the active states by path: where an outcome is forced, and their nodes."""
        active: dict[str, tuple[Frame | ExecutionThread, Node]] = {}
        for thread in self._run.threads if self._run is not None else ():
            if thread.leaf is not None:
                active[thread.path] = thread, thread.leaf
            for frame in tuple(thread.stack):
                if isinstance(frame.current, Node):
                    active[f'{frame.path}/{frame.current.label}'] = frame, frame.current
        return active

    def left_behind(self) -> list[str]:
        """Paths of states that the last run went on without and that are still running."""
        with self.condition:
            run = self._run
            left = run.left_behind if run is not None else self._left
            return [path for path, work in left if work.is_going_on()]

    def begin(self, run: Run) -> None:
        """Have `run` controlled until `end`.

        Raises:
            InvalidStateError: Another run has not ended.
        """
        with self.lock:
            if self._run is not None:
                raise InvalidStateError(f"'{self._container.get_name()}' is running already")
            run.paused = self._paused
            run.trace = self._trace
            self._run = run

    def end(self, run: Run) -> None:
        """Let go of a run that has ended."""
        with self.lock:
            self._left = run.left_behind
            self._run = None
            self.condition.notify_all()
