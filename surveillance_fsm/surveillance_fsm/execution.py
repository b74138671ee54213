"""An execution of a machine: its threads, the nodes that stand for states, where outcomes lead.

A root's execution is a `Run`. It consists of logical threads, `ExecutionThread`: one for the root,
and one for each child of a concurrence. A logical thread keeps a stack of frames, one for each
container that it is in. It runs on one thread of the interpreter after another: when a state hangs,
that thread is left behind and another one goes on (`timeouts`).

Threads of the interpreter are kept for the next execution, because starting one costs more than
most machines need for all their states.
"""

from __future__ import annotations

import contextvars
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from surveillance_fsm import log
from surveillance_fsm.clock import WALL_CLOCK, Clock, Interrupt, elapsed_of
from surveillance_fsm.exceptions import (
    InvalidTransitionError,
    InvalidUserCodeError,
    SmachError,
    describe,
    shown,
)
from surveillance_fsm.state import State, this_thread
from surveillance_fsm.userdata import Remapper

if TYPE_CHECKING:
    from surveillance_fsm.control import Control
    from surveillance_fsm.frame import Frame

LOWEST = float('-inf')
"""The priority of ordinary work, below that of every interrupt."""

DEFAULT_PREEMPT_TIMEOUT = 60.0
"""Seconds (steady time) that a state may ignore a preempt before the machine goes on."""

IDLE_SECONDS = 10.0
"""How long a thread waits for the next execution before it ends."""


class LeftBehindError(BaseException):
    """Unwinds a thread that the machine went on without."""


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
        self, within: str, label: str, state: State, view: Remapper, priority: float = LOWEST
    ) -> None:
        self.within = within
        self.label = label
        self.path = f'{within}/{label}' if label else within
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


# Threads.


class Run:
    """One execution of a root container: what all its threads share.

    Attributes:
        control: What others want of the machine, over all executions.
        condition: The one condition of the machine; its lock guards everything slow.
        clock: The machine's clock.
        preempt_timeout: See `DEFAULT_PREEMPT_TIMEOUT`; None waits for ever.
        now: The time of reports and limits.
        chatty: Transitions are worth a line in the log.
        ended: It is over.
        sleeps_on_clock: A thread watches time limits and waits on the machine's clock.
        left_behind: Paths of the states the machine went on without, and the work that hangs.
        threads: The logical threads that are at work.
    """

    def __init__(self, control: Control, clock: Clock, preempt_timeout: float | None) -> None:
        self.control = control
        self.condition = control.condition
        self.clock = clock
        self.preempt_timeout = preempt_timeout
        self.now: Callable[[], float] = time.monotonic if clock is WALL_CLOCK else elapsed_of(clock)
        self.chatty = log.chatty()
        self.ended = False
        self.sleeps_on_clock = False
        self.left_behind: list[tuple[str, Work]] = []
        self.threads: list[ExecutionThread] = []


@dataclass
class Watch:
    """Limits at work on a state that executes.

    Attributes:
        node: The state's node.
        depth: Index in the thread's stack of the frame it runs in.
        soft: When the state is asked to stop, on the machine's clock; None when it was, or never.
        hard: When the machine goes on without it; None for never.
        asked: The state was asked to stop.
    """

    node: Node
    depth: int
    soft: float | None
    hard: float | None
    asked: bool = False


class ExecutionThread:
    """One logical thread of execution through nested containers.

    Attributes:
        run: The execution it belongs to.
        path: Path of the state it was started for.
        stack: Frames of the containers it is in, outermost first. A thread of the interpreter is
            the present one as long as this is the list that it began with.
        done: It has ended.
        outcome: What it ended with.
        error: What it was ended by.
        wakeup: Raised when it has ended, or its limits have changed.
        watches: Limits at work, outermost first.
        asked_at: When the state that executes was asked to stop, steady time; None: it was not.
        work: What its present thread does.
    """

    def __init__(self, run: Run, path: str, wakeup: Interrupt) -> None:
        self.run = run
        self.path = path
        self.wakeup = wakeup
        self.stack: list[Frame] = []
        self.watches: list[Watch] = []
        self.done = False
        self.outcome: Any = None
        self.error: BaseException | None = None
        self.asked_at: float | None = None
        self.work: Work | None = None
        run.threads.append(self)

    # The side of the thread that executes.

    def executes_next(self, container: State, stack: list[Frame]) -> bool:
        """Tell whether `container` is what the engine executes next, not some user code."""
        current = stack[-1].current if stack else None
        return isinstance(current, Node) and current.state is container

    def path_inside(self) -> str:
        """Return the path of the state that is being executed."""
        for frame in reversed(self.stack):
            if isinstance(frame.current, Node):
                return frame.current.path
            return f'{frame.path}/{frame.current.label}'
        return self.path

    def start(self, body: Callable[[], Any]) -> None:
        """Run `body` on another thread; its value is the logical thread's outcome."""
        self.work = Work(self, self.stack, body)
        self.work.begin()

    def run_here(self, body: Callable[[], Any]) -> Any:
        """Run `body` on the calling thread, unwatched."""
        here = this_thread
        outer = here.thread, here.stack
        here.thread, here.stack = self, self.stack
        try:
            return body()
        finally:
            here.thread, here.stack = outer
            self.retire()

    def end(self, outcome: Any, error: BaseException | None) -> None:
        """Note what it ended with; under the condition. `wakeup` is to be raised after."""
        self.outcome, self.error, self.done = outcome, error, True
        # The two refer to each other, which is left to no garbage collector.
        self.work = None
        self.retire()

    def retire(self) -> None:
        """Take it from those that are at work."""
        with self.run.condition:
            if self in self.run.threads:
                self.run.threads.remove(self)

    def check(self) -> None:
        """Raise `LeftBehindError` in a thread that is not the present one any more."""
        if this_thread.thread is self and this_thread.stack is not self.stack:
            raise LeftBehindError

    # The side of whoever asks it to stop.

    def asked(self) -> None:
        """Note that the state that executes was asked to stop; its bound begins to count.

        As a rule nobody is woken for that: whoever watches looks once in every bound
        (`timeouts.supervise`).
        """
        if self.asked_at is None:
            self.asked_at = time.monotonic()
            if self.run.sleeps_on_clock:
                self.wakeup.set()

    def asked_anew(self) -> None:
        """Begin to count again, if it was asked: something else is to stop now."""
        if self.asked_at is not None:
            self.asked_at = time.monotonic()

    def renew_request(self, node: Node) -> None:
        """Take the request of an earlier execution back from a state, but not a present one."""
        with self.run.condition:
            node.state.recall_preempt()
            if self.asked_at is not None:
                node.state.request_preempt()

    def still_gone(self, node: Node) -> None:
        """Note that a state could not be entered: an earlier execution of it has not ended."""
        with self.run.condition:
            self.check()
            frame = self.stack[-1]
            frame.gone, frame.attention = node, True

    def heeded(self) -> None:
        """Note that the state that was asked to stop has returned."""
        self.asked_at = None


class Work:
    """What a thread of the interpreter does for a logical thread.

    Attributes:
        stack: The logical thread's list of frames when it began.
    """

    def __init__(
        self, thread: ExecutionThread, stack: list[Frame], body: Callable[[], Any]
    ) -> None:
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
            worker = _Worker()
        worker.give(self)

    def is_going_on(self) -> bool:
        """Tell whether it has not ended."""
        return self._going_on.locked()

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
        with thread.run.condition:
            if self.stack is not thread.stack:
                if error is not None:
                    log.logwarn(f"'{thread.path}', left behind, ended with {type(error).__name__}")
                return
            thread.end(outcome, error)
        # Who wakes takes the condition at once.
        thread.wakeup.set()


_idle: list[_Worker] = []
os.register_at_fork(after_in_child=_idle.clear)


class _Worker:
    """A thread of the interpreter that does one piece of work after another."""

    def __init__(self) -> None:
        self._given = threading.Lock()
        self._given.acquire()
        self._work: Work | None = None
        self._thread = threading.Thread(target=self._serve, name='state machine', daemon=True)
        self._thread.start()

    def give(self, work: Work) -> None:
        """Have it do something; it is idle."""
        self._work = work
        self._given.release()

    def _serve(self) -> None:
        while True:
            if not self._given.acquire(timeout=IDLE_SECONDS):
                try:
                    _idle.remove(self)
                except ValueError:
                    # Somebody is about to give it something.
                    self._given.acquire()
                else:
                    return
            work, self._work = self._work, None
            assert work is not None
            self._thread.name = work.name
            work.do()
            del work
            _idle.append(self)
