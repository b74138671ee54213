"""Who runs a machine: an execution of it, and the strands that it consists of.

A machine executes on a thread of its own, the strand, while the thread that called ``execute``
watches it (`supervision`). A concurrence has one strand per child and watches them itself.
"""

from __future__ import annotations

import contextvars
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from surveillance_fsm.engine import Frame, Node, Trace
from surveillance_fsm.log import logwarn
from surveillance_fsm.this_thread import this_thread
from surveillance_fsm.waiting import WALL_CLOCK, Clock, Interrupt

if TYPE_CHECKING:
    from surveillance_fsm.limits import Limits

DEFAULT_PREEMPT_TIMEOUT = 60.0
"""Seconds (steady time) that a state may ignore a preempt before the machine goes on."""


class LeftBehind(BaseException):
    """Unwinds a thread that the machine went on without; nobody but its strand catches it."""


@dataclass
class Watch:
    """Limits at work on a state that executes.

    Attributes:
        node: The state's node.
        depth: Index in the strand's stack of the frame it runs in; -1 below a concurrence.
        soft: When the state is asked to stop, on the machine's clock; None when it was, or never.
        hard: When the machine goes on without it; None for never.
        asked: The state was asked to stop.
    """

    node: Node
    depth: int
    soft: float | None
    hard: float | None
    asked: bool = False


class Run:
    """One execution of a root container: what all its strands share.

    Attributes:
        condition: The one condition of the machine; its lock guards everything slow.
        clock: The machine's clock.
        preempt_timeout: See `DEFAULT_PREEMPT_TIMEOUT`; None waits for ever.
        trace: Where transitions are reported, if anywhere.
        now: The time of reports.
        paused: No further state is entered.
        steps: States that may be entered although paused.
        left_behind: Paths and threads of the states the machine went on without.
        strands: The strands that are at work.
    """

    def __init__(
        self,
        condition: threading.Condition,
        clock: Clock,
        preempt_timeout: float | None,
        trace: Trace | None,
    ) -> None:
        self.condition = condition
        self.clock = clock
        self.preempt_timeout = preempt_timeout
        self.trace = trace
        self.now: Callable[[], float] = time.monotonic if clock is WALL_CLOCK else clock.now
        self.paused = False
        self.steps = 0
        self.left_behind: list[tuple[str, threading.Thread]] = []
        self.strands: list[Strand] = []

    def frames(self) -> list[Frame]:
        """The frames of all strands, outermost first; under the condition."""
        return [frame for strand in self.strands for frame in strand.stack]

    def call_attention(self) -> None:
        """Make every strand look up at its next transition, and wake those that pause."""
        with self.condition:
            for frame in self.frames():
                frame.attention = True
            self.condition.notify_all()


class Strand:
    """One thread of execution through nested containers.

    Attributes:
        run: The execution it belongs to.
        path: Path of the state it was started for.
        stack: Frames of the containers it is in, outermost first.
        done: It has ended.
        without_leaf: It ended because its own state, outside any container, was left behind.
        outcome: What it ended with.
        error: What it was ended by.
        watches: Limits at work, outermost first.
        asked_at: When the state that executes was asked to stop, steady time; None: it was not.
        thread: Its present thread, the last of those that it had.
        thread_ended: Raised when that thread has ended.
        token: Which of its threads is the present one.
        leaf: The state that it executes outside any container, a concurrence's child.
        wanted: Somebody wants that to end.
        forced: That, and the outcome to take in place of the one that it returns.
    """

    def __init__(self, run: Run, path: str, wakeup: Interrupt) -> None:
        self.run = run
        self.path = path
        self.stack: list[Frame] = []
        self.done = False
        self.without_leaf = False
        self.outcome: Any = None
        self.error: BaseException | None = None
        self._wakeup = wakeup
        self.watches: list[Watch] = []
        self.asked_at: float | None = None
        self.token: object = None
        self.thread: threading.Thread | None = None
        self.thread_ended = threading.Event()
        self.leaf: Node | None = None
        self.wanted = False
        self.forced: tuple[Node, str] | None = None
        self._root: object = None
        run.strands.append(self)

    # The side of the thread that executes.

    def begin_with(self, state: object, node: Node | None = None) -> None:
        """Say what the strand executes outside any frame: a root, or a concurrence's child."""
        self._root, self.leaf = state, node

    def enters(self, container: object) -> bool:
        """Whether `container` is what the strand itself executes next, not some user code."""
        if not self.stack:
            return self._root is container
        current = self.stack[-1].current
        return isinstance(current, Node) and current.state is container

    def path_inside(self) -> str:
        """The path of the state that is being executed."""
        if not self.stack:
            return self.path
        return f'{self.stack[-1].path}/{self.stack[-1].current.label}'

    def start(self, body: Callable[[], Any]) -> None:
        """Run `body` on a new thread; its value is the strand's outcome."""
        token = self.token = object()
        ended = self.thread_ended = threading.Event()
        context = contextvars.copy_context()

        def thread() -> None:
            try:
                context.run(self._main, body, token)
            finally:
                ended.set()

        self.thread = threading.Thread(target=thread, name=self.path, daemon=True)
        self.thread.start()

    def run_here(self, body: Callable[[], Any]) -> Any:
        """Run `body` on the calling thread, unwatched."""
        outer = this_thread.strand, this_thread.token
        token = self.token = object()
        this_thread.strand, this_thread.token = self, token
        try:
            return body()
        finally:
            this_thread.strand, this_thread.token = outer
            self._retire()

    def _main(self, body: Callable[[], Any], token: object) -> None:
        this_thread.strand, this_thread.token = self, token
        outcome, error = None, None
        try:
            outcome = body()
        except LeftBehind:
            return
        except BaseException as raised:
            error = raised
        with self.run.condition:
            if token is not self.token:
                if error is not None:
                    logwarn(f"'{self.path}', left behind, ended with {type(error).__name__}")
                return
            self.end(outcome, error)

    def end(self, outcome: Any, error: BaseException | None) -> None:
        """Note what the strand ended with, and wake whoever watches it; under the condition."""
        self.outcome, self.error, self.done = outcome, error, True
        self._retire()
        self._wakeup.set()

    def _retire(self) -> None:
        with self.run.condition:
            if self in self.run.strands:
                self.run.strands.remove(self)

    def disown(self) -> None:
        """Leave the thread behind without a successor."""
        with self.run.condition:
            self.token = object()
            for frame in self.stack:
                frame.stale = frame.attention = True
                frame.container._frame = None
            self.stack = []
            self._retire()

    def push(self, frame: Frame) -> None:
        """Enter a container."""
        self.stack.append(frame)

    def pop(self, frame: Frame) -> None:
        """Leave a container; nothing when the strand has another thread by now."""
        if self.stack and self.stack[-1] is frame:
            self.stack.pop()

    def check(self) -> None:
        """Raise `LeftBehind` in a thread that is not the strand's any more."""
        if this_thread.strand is self and this_thread.token is not self.token:
            raise LeftBehind

    def watch(self, node: Node, limits: Limits) -> Watch:
        """Put limits to work on the state that the innermost frame is about to execute."""
        now = self.run.clock.now()
        with self.run.condition:
            self.check()
            watch = Watch(
                node,
                len(self.stack) - 1,
                None if limits.timeout is None else now + limits.timeout,
                None if limits.deadline is None else now + limits.deadline,
            )
            self.watches.append(watch)
        self._wakeup.set()
        return watch

    def unwatch(self, watch: Watch) -> None:
        """End the limits of a state that has returned."""
        with self.run.condition:
            self.check()
            self.watches.remove(watch)

    def watch_of(self, frame: Frame) -> Watch | None:
        """The limits at work on the state that `frame` executes."""
        for watch in self.watches:
            if self.stack[watch.depth] is frame:
                return watch
        return None

    # The side of whoever asks the strand to stop.

    def asked(self) -> None:
        """Note that the state that executes was asked to stop; its bound begins to count."""
        with self.run.condition:
            if self.asked_at is None:
                self.asked_at = time.monotonic()
        self._wakeup.set()

    def renew_request(self, node: Node) -> None:
        """Take the request of an earlier execution back from a state, but not a present one."""
        with self.run.condition:
            node.state.recall_preempt()
            if self.asked_at is not None:
                node.state.request_preempt()

    def still_gone(self, node: Node) -> None:
        """Note that a state could not be entered: an earlier execution of it has not ended."""
        with self.run.condition:
            if self.stack:
                self.stack[-1].gone, self.stack[-1].attention = node, True
            else:
                self.without_leaf = True

    def heeded(self) -> None:
        """Note that the state that was asked to stop has returned."""
        self.asked_at = None
