"""Watching and steering a root from outside: transitions, pausing, stepping, forced outcomes.

And the shutdown check: a machine asks it between two states, and ends with None when it is true.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from surveillance_fsm.exceptions import InvalidStateError, InvalidTransitionError, describe
from surveillance_fsm.execution import (
    ExecutionThread,
    Node,
    Noted,
    RawTransition,
    Run,
    Trace,
)
from surveillance_fsm.log import logerr

if TYPE_CHECKING:
    from surveillance_fsm.frame import Frame

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

    Args:
        name: Tells the root's name.

    Attributes:
        condition: The one condition of the machine.
        paused: No further state is entered; see `pause`.
        steps: States that may be entered although paused.
        trace: Where transitions are reported, if anywhere.
    """

    def __init__(self, name: Callable[[], str]) -> None:
        self.condition = threading.Condition()
        self.paused = False
        self.steps = 0
        self.trace: Trace | None = None
        self._name = name
        self._traces: list[Trace] = []
        # The last one, which may have ended.
        self._run: Run | None = None

    def add_trace(self, trace: Trace) -> Callable[[], None]:
        """Report every transition to `trace`, in the thread that makes it.

        Args:
            trace: Takes each transition as the loop notes it; `execution.unfold` says it in full.
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

        self.trace = tell_all if traces else None
        self._call_attention()

    def pause(self) -> None:
        """Enter no further state; the one that runs is not disturbed. A preempt goes through."""
        self._set_paused(True)

    def resume(self) -> None:
        """Go on after a pause."""
        self._set_paused(False)

    def _set_paused(self, paused: bool) -> None:
        with self.condition:
            self.paused, self.steps = paused, 0
            self._call_attention()

    def step(self) -> None:
        """Enter one more state of a paused machine.

        Raises:
            InvalidStateError: The machine is not paused, or does not run.
        """
        with self.condition:
            running = self._run is not None and not self._run.ended
            if not running or not self.paused:
                raise InvalidStateError(
                    f"'{self._name()}' cannot step: it is not {'paused' if running else 'running'}"
                )
            self.steps += 1
            self._call_attention()

    def _call_attention(self) -> None:
        """Make every thread look up at its next transition, and wake those that pause."""
        for thread in self._threads():
            for frame in tuple(thread.stack):
                frame.attention = True
        self.condition.notify_all()

    def _threads(self) -> list[ExecutionThread]:
        return self._run.threads if self._run is not None else []

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
            # Attention first, then a look: what is current now is held until this is done.
            self._call_attention()
            active = self._active()
            if path not in active:
                raise InvalidStateError(
                    f"State '{path}' is not active; the active ones are {sorted(active)}"
                )
            frame, node = active[path]
            if outcome not in node.state.get_registered_outcomes():
                raise InvalidTransitionError(
                    f"State '{path}' cannot be forced to '{outcome}': its outcomes are "
                    f'{sorted(node.state.get_registered_outcomes())}'
                )
            if frame.forced is not None and frame.forced[0] is not node:
                raise InvalidStateError(
                    f"State '{path}' cannot be forced yet: '{frame.forced[0].label}' has not ended "
                    f"with '{frame.forced[1]}', as it was forced to"
                )
            frame.forced = (node, outcome)
            frame.thread.asked()
            node.state.request_preempt()

    def active_paths(self) -> list[str]:
        """Paths of all states that are active, containers included, outermost first."""
        with self.condition:
            return list(self._active())

    def _active(self) -> dict[str, tuple[Frame, Node]]:
        """Return the active states by path: the frames they run in, and their nodes."""
        active: dict[str, tuple[Frame, Node]] = {}
        for thread in self._threads():
            for frame in tuple(thread.stack):
                node = frame.current
                # All states of a concurrence together have no label.
                if isinstance(node, Node) and node.label:
                    active[f'{frame.path}/{node.label}'] = frame, node
        return active

    def left_behind(self) -> list[str]:
        """Paths of states that the last run went on without and that are still running."""
        with self.condition:
            left = self._run.left_behind if self._run is not None else []
            return [path for path, work in left if work.is_going_on()]

    def fsm_begin(self, run: Run) -> None:
        """Have `run` controlled until `fsm_end`.

        Raises:
            InvalidStateError: Another run has not ended.
        """
        with self.condition:
            if self._run is not None and not self._run.ended:
                raise InvalidStateError(f"'{self._name()}' is running already")
            self._run, self.steps = run, 0

    def fsm_end(self, run: Run) -> None:
        """Let go of a run that has ended."""
        with self.condition:
            run.ended = True
            self.condition.notify_all()
        # Others may end their reports in this moment.
        trace = self.trace
        if trace is not None:
            trace(Noted(self._name(), '', '', '', run.now(), {}, 'end'))
