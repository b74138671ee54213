"""Who runs a machine and who watches it: strands of execution, their limits, their takeover.

A machine executes on a thread of its own, the strand, while the thread that called ``execute``
watches it. When a state neither returns nor heeds a preempt within its bound, the watcher leaves
that thread behind, starts another one where the state would have ended, and names the culprit. A
concurrence has one strand per child and watches them itself.
"""

from __future__ import annotations

import contextvars
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from surveillance_behaviour.fsm.engine import Frame, Node, Trace
from surveillance_behaviour.fsm.exceptions import PreemptIgnoredError
from surveillance_behaviour.fsm.log import logerr, logwarn
from surveillance_behaviour.fsm.takeover import STOPPED, go_on, keep_out, stopped_outcome
from surveillance_behaviour.fsm.this_thread import this_thread
from surveillance_behaviour.fsm.waiting import WALL_CLOCK, Clock, Interrupt

if TYPE_CHECKING:
    from surveillance_behaviour.fsm.limits import Limits

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
        self._watches: list[Watch] = []
        self._asked_at: float | None = None
        self._token: object = None
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._leaf: Node | None = None
        self._root: object = None
        run.strands.append(self)

    # The side of the thread that executes.

    def begin_with(self, state: object, node: Node | None = None) -> None:
        """Say what the strand executes outside any frame: a root, or a concurrence's child."""
        self._root, self._leaf = state, node

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
        token = self._token = object()
        ended = self._ended = threading.Event()
        context = contextvars.copy_context()

        def thread() -> None:
            try:
                context.run(self._main, body, token)
            finally:
                ended.set()

        self._thread = threading.Thread(target=thread, name=self.path, daemon=True)
        self._thread.start()

    def run_here(self, body: Callable[[], Any]) -> Any:
        """Run `body` on the calling thread, unwatched."""
        outer = this_thread.strand, this_thread.token
        token = self._token = object()
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
            if token is not self._token:
                if error is not None:
                    logwarn(f"'{self.path}', left behind, ended with {type(error).__name__}")
                return
            self._end(outcome, error)

    def _end(self, outcome: Any, error: BaseException | None) -> None:
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
            self._token = object()
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
        if this_thread.strand is self and this_thread.token is not self._token:
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
            self._watches.append(watch)
        self._wakeup.set()
        return watch

    def unwatch(self, watch: Watch) -> None:
        """End the limits of a state that has returned."""
        with self.run.condition:
            self.check()
            self._watches.remove(watch)

    def watch_of(self, frame: Frame) -> Watch | None:
        """The limits at work on the state that `frame` executes."""
        for watch in self._watches:
            if self.stack[watch.depth] is frame:
                return watch
        return None

    # The side of whoever asks the strand to stop.

    def asked(self) -> None:
        """Note that the state that executes was asked to stop; its bound begins to count."""
        with self.run.condition:
            if self._asked_at is None:
                self._asked_at = time.monotonic()
        self._wakeup.set()

    def renew_request(self, node: Node) -> None:
        """Take the request of an earlier execution back from a state, but not a present one."""
        with self.run.condition:
            node.state.recall_preempt()
            if self._asked_at is not None:
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
        self._asked_at = None

    # The side of the thread that watches.

    def due(self) -> tuple[float | None, float | None]:
        """When something is due next: (on the machine's clock, in steady time)."""
        times = [t for watch in self._watches for t in (watch.soft, watch.hard) if t is not None]
        bound = self.run.preempt_timeout
        steady = None
        if self._asked_at is not None and bound is not None and not self._bounds_itself():
            steady = self._asked_at + bound
        return (min(times) if times else None), steady

    def _bounds_itself(self) -> bool:
        return bool(self.stack) and self.stack[-1].container._fsm_bounds_itself

    def enforce(self) -> None:
        """Do what is due: ask states to stop, or go on without them."""
        now = self.run.clock.now()
        with self.run.condition:
            if self.done:
                return
            for watch in tuple(self._watches):
                if watch.hard is not None and now >= watch.hard:
                    self._go_on_without(watch)
                    return
                if watch.soft is not None and now >= watch.soft:
                    watch.soft, watch.asked = None, True
                    watch.node.state.request_preempt()
            _, steady = self.due()
            if steady is not None and time.monotonic() >= steady:
                self._preempt_ignored()

    def _go_on_without(self, watch: Watch) -> None:
        limits = watch.node.limits
        assert limits is not None
        within = limits.deadline
        self._take_over(
            watch.depth,
            watch.node,
            limits.late_outcome,
            f'did not return within its deadline of {within:g} s',
        )

    def _preempt_ignored(self) -> None:
        """Go on without the innermost state: with its preempted outcome, or its container's."""
        bound = self.run.preempt_timeout
        reason = f'ignored a preempt for {bound:g} s'
        culprit = self.path_inside()
        for depth in range(len(self.stack) - 1, -1, -1):
            node = self.stack[depth].current
            if not isinstance(node, Node):
                return  # It is ending by itself.
            forced = self.stack[depth].forced
            outcome = forced[1] if forced is not None else stopped_outcome(node)
            if outcome is not None:
                self._take_over(depth, node, outcome, reason, culprit)
                return
        outcome = stopped_outcome(self._leaf) if self._leaf is not None else None
        if outcome is not None:
            assert self._leaf is not None
            self._take_over(-1, self._leaf, outcome, reason, culprit)
            return
        root = self.stack[0].container if self.stack else None
        outcomes = root.get_registered_outcomes() if root is not None else ()
        for ending in STOPPED:
            if ending in outcomes:
                self._take_over(-1, None, ending, reason, culprit)
                return
        error = PreemptIgnoredError(
            f"State '{culprit}' {reason}, and no container around it can "
            f"end with 'preempted' or 'aborted'"
        )
        self._take_over(-1, None, error, reason, culprit)

    def _take_over(
        self,
        depth: int,
        node: Node | None,
        outcome: str | BaseException,
        reason: str,
        culprit: str | None = None,
    ) -> None:
        """Leave the thread behind and go on as if the state in frame `depth` had ended.

        Args:
            depth: Index of the frame to go on in; -1 to end the strand.
            node: The state to go on without, whose userdata is taken away.
            outcome: What it is taken to have returned, or the error to end the strand with.
            reason: What it did wrong, for the log.
            culprit: Its path.
        """
        assert self._thread is not None
        culprit = culprit or self.path_inside()
        leaf = self.stack[-1].current if self.stack else self._leaf
        ended = f"with '{outcome}'" if isinstance(outcome, str) else 'with an error'
        logerr(f"State '{culprit}' {reason}: the machine goes on without it, {ended}")
        self.run.left_behind.append((culprit, self._thread))
        old = self.stack
        frames = [frame.successor() for frame in old[: depth + 1]]
        for frame in old:
            frame.stale = frame.attention = True
            frame.container._frame = None
        for frame in old[depth + 1 :]:
            frame.container.recall_preempt()
        for frame in frames:
            frame.container._frame = frame
        if frames:
            frames[-1].gone = node
        if isinstance(leaf, Node):
            # The request stays with the state, so that the thread left behind ends some time.
            leaf.state.request_preempt()
            leaf.revoke()
            keep_out(leaf, self._ended)
        if node is not None and node is not leaf:
            node.revoke()
        self.stack = list(frames)
        self._watches = [watch for watch in self._watches if watch.depth < depth]
        self._asked_at = None
        self.run.condition.notify_all()
        for frame in old:
            frame.container._fsm_woken()
        if not frames:
            self._token = object()
            self.without_leaf = leaf is self._leaf
            if isinstance(outcome, str):
                self._end(outcome, None)
            else:
                self._end(None, outcome)
            return
        self.start(lambda: go_on(self, frames, outcome))


def supervise(run: Run, strands: Sequence[Strand], wakeup: Interrupt) -> None:
    """Watch strands until one of them ends or `wakeup` is raised by somebody else.

    Args:
        run: The execution they belong to.
        strands: The strands; each raises `wakeup` when it ends or its limits change.
        wakeup: What the wait ends by.
    """
    with run.condition:
        wakeup.clear()
        if any(strand.done for strand in strands):
            return
        dues = [strand.due() for strand in strands]
    clocked = min((due for due, _ in dues if due is not None), default=None)
    steady = min((due for _, due in dues if due is not None), default=None)
    left = None if steady is None else max(0.0, steady - time.monotonic())
    if clocked is None:
        wakeup.wait(left)
    else:
        alarm = threading.Timer(left, wakeup.set) if left is not None else None
        if alarm is not None:
            alarm.start()
        run.clock.sleep(max(0.0, clocked - run.clock.now()), wakeup)
        if alarm is not None:
            alarm.cancel()
    for strand in strands:
        strand.enforce()
