"""An execution of a machine: its threads, and how it is watched and steered from outside.

Each root has a `Control`, which all its executions share. An execution consists of logical threads,
`ExecutionThread`: one for the root, and one for each child of a concurrence. A logical thread keeps
a stack of frames, one for each container that it is in.

A root that asks for nothing else runs on the thread that calls it. Where a time limit or a bound on
preempts is to be kept, it runs on another thread, and the caller watches: when a state hangs, that
thread is left behind and a further one goes on (`timeouts`). Such threads are kept for the next
execution, because starting one costs more than most machines need for all their states.

The shutdown check belongs to all machines: each asks it between two states, and ends with None when
it is true.
"""

from __future__ import annotations

import contextvars
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, Protocol

from state_machines import log
from state_machines.autonomy import Autonomy, Question, level_of
from state_machines.clock import WALL_CLOCK, Clock, Interrupt, elapsed_of
from state_machines.exceptions import InvalidStateError, InvalidTransitionError, describe
from state_machines.program import (
    Exit,
    Noted,
    RawTransition,
    StateEntry,
    StateLimits,
    StateNode,
    Trace,
)
from state_machines.state import this_thread

IDLE_SECONDS = 10.0
"""How long a thread waits for the next execution before it ends."""


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


class LeftBehindError(BaseException):
    """Unwinds a thread that the machine went on without."""


STOPPED = ('preempted', 'aborted')
"""Outcomes that a state may be taken to have ended with that was left behind."""


def stopped_outcome(node: StateNode) -> str | None:
    """Return the outcome that a state is taken to have ended with, if it has one for that."""
    return next((outcome for outcome in STOPPED if outcome in node.targets), None)


class Position(Protocol):
    """What a thread and the control know of a frame: where the thread is in one container.

    Attributes:
        path: The container's path.
        thread: The logical thread.
        current: The node that executes, or the exit that was taken.
        attention: Something beside the next state wants to be looked at.
        forced: A node, and the outcome to take in place of the one that its state returns.
        left: The node whose state was left behind.
        question: The transition that waits for a person.
    """

    thread: ExecutionThread
    current: StateNode | Exit
    attention: bool
    forced: tuple[StateNode, str] | None
    left: StateNode | None
    question: Question | None

    @property
    def path(self) -> str:
        """The container's path."""


# The machine from outside.


class Control:
    """What may be done to a root container from other threads, between runs too.

    Args:
        name: Tells the root's name.

    Attributes:
        lock: The one lock of the machine.
        condition: A condition with that lock; holding one is holding the other.
        paused: No further state is entered; see `pause`.
        steps: States that may be entered although paused.
        trace: Where transitions are reported, if anywhere.
        running: An execution has not ended.
        autonomy: Transitions that need a higher level wait for a person.
    """

    def __init__(self, name: Callable[[], str]) -> None:
        # Taking the lock itself costs a third of taking it as a condition.
        self.lock = threading.RLock()
        self.condition = threading.Condition(self.lock)
        self.paused = False
        self.steps = 0
        self.trace: Trace | None = None
        self.running = False
        self.autonomy = Autonomy.FULL
        self._questions: list[Question] = []
        self._name = name
        self._traces: list[Trace] = []
        self._set_up(WALL_CLOCK, None)

    def _set_up(self, clock: Clock, preempt_timeout: float | None) -> None:
        """Set what each execution begins with, for the engine's own modules.

        Attributes:
            clock: The machine's clock.
            preempt_timeout: See `Container.preempt_timeout`; None waits for ever.
            now: The time of reports and limits.
            chatty: Transitions are worth a line in the log.
            sleeps_on_clock: A thread watches time limits and waits on the machine's clock.
            hanging: Paths of the states the machine went on without, and the work that hangs.
            threads: The logical threads that are at work.
        """
        self.clock = clock
        self.preempt_timeout = preempt_timeout
        self.now: Callable[[], float] = time.monotonic if clock is WALL_CLOCK else elapsed_of(clock)
        self.chatty = log.chatty()
        self.sleeps_on_clock = False
        self.hanging: list[tuple[str, Work]] = []
        self.threads: list[ExecutionThread] = []

    def add_trace(self, trace: Trace) -> Callable[[], None]:
        """Report every transition to `trace`, in the thread that makes it.

        Args:
            trace: Takes each transition as the loop notes it; `nodes.unfold` says it in full.
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
                    log.logerr(f'Trace {trace!r} raised {describe(error)}')

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
            if not self.running or not self.paused:
                lacking = 'paused' if self.running else 'running'
                raise InvalidStateError(f"'{self._name()}' cannot step: it is not {lacking}")
            self.steps += 1
            self._call_attention()

    def _call_attention(self) -> None:
        """Make every thread look up at its next transition, and wake those that pause."""
        for thread in self.threads:
            for frame in tuple(thread.stack):
                frame.attention = True
        self.condition.notify_all()

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
            if frame.question is not None:
                frame.question.wake.set()

    # Transitions that wait for a person.

    def set_autonomy(self, level: int) -> None:
        """Set how much the machine does by itself; questions that are answered by that go on.

        Raises:
            InvalidTransitionError: There is no such level.
        """
        with self.condition:
            self.autonomy = level_of(level, f"The autonomy of '{self._name()}'")
            for question in self._questions:
                if question.approval.level <= self.autonomy:
                    question.wake.set()

    def questions(self) -> list[Question]:
        """Return the transitions that wait for a person."""
        with self.condition:
            return list(self._questions)

    def approve(self, path: str = '', outcome: str = '') -> None:
        """Have a transition that waits be made, or another one in its place.

        Args:
            path: Of the state that has ended; empty for the only one that waits.
            outcome: The outcome to go on with; empty for the one that it ended with.

        Raises:
            InvalidStateError: No such transition waits.
            InvalidTransitionError: The state has no such outcome.
        """
        with self.condition:
            waiting = {each.path: each for each in self._questions if each.answer is None}
            if not path and len(waiting) == 1:
                (path,) = waiting
            question = waiting.get(path)
            if question is None:
                raise InvalidStateError(
                    f"No transition of '{path}' waits for a person; those that do are of "
                    f'{sorted(waiting)}'
                )
            if outcome and outcome not in question.outcomes:
                raise InvalidTransitionError(
                    f"State '{path}' has no outcome '{outcome}' to go on with: its outcomes are "
                    f'{sorted(question.outcomes)}'
                )
            question.answer = outcome or question.outcome
            question.wake.set()

    def fsm_ask(self, question: Question) -> None:
        """Have a question be one of those that wait; under the condition."""
        self._questions.append(question)

    def fsm_settle(self, question: Question) -> None:
        """Take a question away; under the condition."""
        self._questions.remove(question)

    def active_paths(self) -> list[str]:
        """Paths of all states that are active, containers included, outermost first."""
        with self.condition:
            return list(self._active())

    def _active(self) -> dict[str, tuple[Position, StateNode]]:
        """Return the active states by path: the frames they run in, and their nodes."""
        active: dict[str, tuple[Position, StateNode]] = {}
        for thread in self.threads:
            for frame in tuple(thread.stack):
                node = frame.current
                # All states of a concurrence together have no label.
                if isinstance(node, StateNode) and node.label:
                    active[f'{frame.path}/{node.label}'] = frame, node
        return active

    def left_behind(self) -> list[str]:
        """Paths of states that the last run went on without and that are still running."""
        with self.condition:
            return [path for path, work in self.hanging if work.is_going_on()]

    def fsm_begin(self, clock: Clock, preempt_timeout: float | None) -> None:
        """Begin an execution.

        Raises:
            InvalidStateError: Another one has not ended.
        """
        with self.condition:
            if self.running:
                raise InvalidStateError(f"'{self._name()}' is running already")
            # First what may fail, as with a clock that is none.
            self._set_up(clock, preempt_timeout)
            self.running, self.steps = True, 0

    def fsm_end(self) -> None:
        """Note that the execution has ended."""
        with self.condition:
            # The next one may go by another clock.
            now, self.running = self.now, False
            self.threads.clear()
            self.condition.notify_all()
        # Others may end their reports in this moment.
        trace = self.trace
        if trace is not None:
            trace(Noted(self._name(), '', '', '', now(), {}, 'end'))


# Threads.


@dataclass(eq=False)
class Watch:
    """Limits at work on a state that executes.

    Attributes:
        node: The state's node.
        depth: Index in the thread's stack of the frame it runs in.
        soft: When the state is asked to stop, on the machine's clock; None when it was, or never.
        hard: When the machine goes on without it; None for never.
        asked: The state was asked to stop.
    """

    node: StateNode
    depth: int
    soft: float | None
    hard: float | None
    asked: bool = False


class ExecutionThread:
    """One logical thread of execution through nested containers.

    Attributes:
        control: The control of the machine it belongs to.
        path: Path of the state it was started for.
        stack: Frames of the containers it is in, outermost first. A thread of the interpreter is
            the present one as long as this is the list that it began with.
        done: It has ended.
        outcome: What it ended with.
        error: What it was ended by.
        wakeup: Raised when it has ended, or its limits have changed; None where nobody watches.
        watches: Limits at work, outermost first.
        asked_at: When the state that executes was asked to stop, steady time; None: it was not.
        work: What its present thread does.
    """

    def __init__(self, control: Control, path: str, wakeup: Interrupt | None) -> None:
        self.control = control
        self.path = path
        self.wakeup = wakeup
        self.stack: list[Any] = []
        self.watches: list[Watch] = []
        self.done = False
        self.outcome: Any = None
        self.error: BaseException | None = None
        self.asked_at: float | None = None
        self.work: Work | None = None
        control.threads.append(self)

    # The side of the thread that executes.

    def path_inside(self) -> str:
        """Return the path of the state that is being executed."""
        for frame in reversed(self.stack):
            if isinstance(frame.current, StateNode):
                return frame.current.path
            return f'{frame.path}/{frame.current.label}'
        return self.path

    def start(self, body: Callable[[], Any]) -> None:
        """Run `body` on another thread; its value is the logical thread's outcome."""
        self.work = Work(self, self.stack, body)
        self.work.begin()

    def run_here(self, body: Callable[[list[Any]], Any]) -> Any:
        """Run `body`, which is given the frames, on the calling thread, unwatched."""
        here = vars(this_thread)
        outer = here.get('thread'), here.get('stack')
        here['thread'], here['stack'] = self, self.stack
        try:
            return body(self.stack)
        finally:
            here['thread'], here['stack'] = outer

    def end(self, outcome: Any, error: BaseException | None) -> None:
        """Note what it ended with; under the condition. `wakeup` is to be raised after."""
        self.outcome, self.error, self.done = outcome, error, True
        # The two refer to each other, which is left to no garbage collector.
        self.work = None
        self.retire()

    def retire(self) -> None:
        """Take it from those that are at work."""
        with self.control.condition:
            if self in self.control.threads:
                self.control.threads.remove(self)

    def check(self) -> None:
        """Raise `LeftBehindError` in a thread that is not the present one any more."""
        if this_thread.thread is self and this_thread.stack is not self.stack:
            raise LeftBehindError

    def wake_watcher(self) -> None:
        """Have whoever watches look."""
        if self.wakeup is not None:
            self.wakeup.set()

    # The side of whoever asks it to stop.

    def asked(self) -> None:
        """Note that the state that executes was asked to stop; its bound begins to count.

        As a rule nobody is woken for that: whoever watches looks once in every bound
        (`timeouts.supervise`).
        """
        if self.asked_at is None:
            self.asked_at = time.monotonic()
            if self.control.sleeps_on_clock:
                self.wake_watcher()

    def asked_anew(self) -> None:
        """Begin to count again, if it was asked: something else is to stop now."""
        if self.asked_at is not None:
            self.asked_at = time.monotonic()

    def renew_request(self, node: StateNode) -> None:
        """Take the request of an earlier execution back from a state, but not a present one."""
        with self.control.condition:
            node.state.recall_preempt()
            if self.asked_at is not None:
                node.state.request_preempt()

    def still_running(self, node: StateNode) -> None:
        """Note that a state could not be entered: an earlier execution of it has not ended."""
        with self.control.condition:
            self.check()
            frame = self.stack[-1]
            frame.left, frame.attention = node, True

    # Limits at work.

    def begin_watch(self, node: StateNode, limits: StateLimits) -> Watch:
        """Put limits to work on the state that the innermost frame is about to execute."""
        now = self.control.now()
        with self.control.condition:
            self.check()
            watch = Watch(
                node,
                len(self.stack) - 1,
                None if limits.timeout is None else now + limits.timeout,
                None if limits.deadline is None else now + limits.deadline,
            )
            self.watches.append(watch)
        self.wake_watcher()
        return watch

    def end_watch(self, watch: Watch) -> None:
        """End the limits of a state that has returned."""
        with self.control.condition:
            self.check()
            if watch in self.watches:
                self.watches.remove(watch)

    def end_watches(self, depth: int) -> None:
        """End the limits of all states from a depth on, an error having ended them."""
        with self.control.condition:
            if this_thread.stack is self.stack:
                self.watches = [watch for watch in self.watches if watch.depth < depth]


class Work:
    """What a thread of the interpreter does for a logical thread.

    Attributes:
        stack: The logical thread's list of frames when it began.
    """

    def __init__(self, thread: ExecutionThread, stack: list[Any], body: Callable[[], Any]) -> None:
        self.stack = stack
        self._thread = thread
        self._body = body
        self._context = contextvars.copy_context()
        self._going_on = threading.Lock()
        self._going_on.acquire()

    @property
    def name(self) -> str:
        """The path of what the logical thread was started for."""
        return self._thread.path

    def begin(self) -> None:
        """Have an idle thread do it, or a new one."""
        try:
            worker = _idle.pop()
        except IndexError:
            worker = _WorkerThread()
        worker.given.put(self)

    def is_going_on(self) -> bool:
        """Tell whether it has not ended."""
        return self._going_on.locked()

    def block_reentry(self, node: StateNode) -> None:
        """Enter a state again only when this work, which was left behind in it, has ended."""
        entry, state = node.entry, node.state
        state.fsm_left = self

        def wait_and_execute(view: Any) -> Any:
            thread: ExecutionThread | None = this_thread.thread
            if not self.await_end(thread.control.preempt_timeout if thread is not None else None):
                log.logerr(f"State '{node.label}' is still running from an earlier execution")
                if thread is not None:
                    thread.still_running(node)
                return stopped_outcome(node)
            state.fsm_left = None
            node.execute, node.entry = state.execute, entry
            if thread is None:
                state.recall_preempt()
            else:
                thread.renew_request(node)
            return node.execute(view)

        node.execute = wait_and_execute
        if entry is not None:
            # It is called, and not gone into; its limits hold as before.
            node.entry = StateEntry(
                None, node.view, entry.limits, entry.approvals, draws=entry.draws
            )

    def await_end(self, seconds: float | None) -> bool:
        """Wait for the end, in seconds of steady time; whether it came."""
        limit = -1.0 if seconds is None else min(seconds, threading.TIMEOUT_MAX)
        if not self._going_on.acquire(timeout=limit):
            return False
        self._going_on.release()
        return True

    def do(self) -> None:
        """Do it, on the present thread; never raises."""
        here, thread = this_thread, self._thread
        here.thread, here.stack = thread, self.stack
        outcome, error = None, None
        try:
            outcome = self._context.run(self._body)
        except LeftBehindError:
            return
        except BaseException as raised:
            error = raised
        finally:
            here.thread = here.stack = None
            self._going_on.release()
        with thread.control.condition:
            if self.stack is not thread.stack:
                if error is not None:
                    log.logwarn(f"'{thread.path}', left behind, ended with {type(error).__name__}")
                return
            thread.end(outcome, error)
        # Who wakes takes the condition at once.
        thread.wake_watcher()


_idle: list[_WorkerThread] = []
os.register_at_fork(after_in_child=_idle.clear)


class _WorkerThread:
    """A thread of the interpreter that does one piece of work after another.

    Attributes:
        given: What it is to do; one that is idle is given one piece.
    """

    def __init__(self) -> None:
        self.given: SimpleQueue[Work] = SimpleQueue()
        self._thread = threading.Thread(target=self._serve, name='state machine', daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            try:
                work = self.given.get(timeout=IDLE_SECONDS)
            except Empty:
                try:
                    _idle.remove(self)
                except ValueError:
                    # Somebody is about to give it something.
                    work = self.given.get()
                else:
                    return
            self._thread.name = work.name
            work.do()
            del work
            _idle.append(self)
