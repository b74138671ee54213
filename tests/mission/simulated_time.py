"""Time that stands still while anybody works, and jumps when all there is to do is wait.

A mission under ``use_sim_time`` usually runs against a clock that ticks on its own: what happens
first then depends on how busy the machine is. Here the clock moves only while one of the threads
that carry the mission on (the state machine, a goal, a charge) sleeps on it and nobody else whom
time woke is still at work, and then to the moment at which the next of all sleepers is due. Hours
take seconds, and a run with the same seeds takes the same course.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import pytest
from rosgraph_msgs.msg import Clock

from state_machines.clock import Interrupt
from state_machines.ros import ClockWait

CARRIES_ON = ('surveillance', 'patrol', 'machine', ' goal', '_recharge')
"""Ends of the names of threads whose sleep means that nothing else is under way."""

STEP = 1.0
"""Time passes in steps of at least this many seconds; sleeps may last that much longer."""
PATIENCE = 60.0
"""How long a node may take to follow the clock, and a sleeper to wake up, seconds of real time."""
START = 1.0
"""The first moment, seconds; at 0 nothing has a time yet."""


class _Sleeper(NamedTuple):
    name: str
    deadline: float
    interrupt: Interrupt


class SimulatedTime:
    """Drives ``/clock`` for the nodes of a graph.

    Attributes:
        now: The present moment, seconds.
        error: What an action raised, or who does not follow the clock; time has ended then.
        unattended: Nobody carries a mission on at present; time passes all the same.
    """

    def __init__(self, graph: Any) -> None:
        self._nodes: Callable[[], list[Any]] = list
        self._topic = graph.node.create_publisher(Clock, '/clock', 10)
        self._condition = threading.Condition()
        self._sleepers: dict[int, _Sleeper] = {}
        self._at_work: set[threading.Thread] = set()
        self._all_heard: Callable[[], bool] = lambda: True
        self._ended = False
        self.unattended = False
        self.error: BaseException | None = None
        self.now = START
        self.alarms: list[tuple[float, Any]] = []
        self._thread = threading.Thread(target=self._run, name='simulated time')

    def follow(self, nodes: Callable[[], list[Any]], all_heard: Callable[[], bool]) -> None:
        """Name the nodes that must have seen each moment before the next one comes.

        ``all_heard``: whether no message is under way that the next moment must not overtake.
        """
        self._nodes, self._all_heard = nodes, all_heard

    def start(self) -> None:
        """Let time run."""
        self._publish()
        self._thread.start()

    def tell(self) -> None:
        """Tell a node that has just come what time it is."""
        self._publish()

    def stop(self) -> None:
        """End time; sleepers stay asleep."""
        with self._condition:
            self._ended = True
            self._condition.notify_all()
        self._thread.join(60.0)

    def at(self, seconds: float, action: Any) -> None:
        """Do something ``seconds`` after the start, while everybody sleeps."""
        with self._condition:
            self.alarms.append((START + seconds, action))
            self.alarms.sort(key=lambda alarm: alarm[0])

    def standing(self) -> str:
        """Say whom time waits for."""
        with self._condition:
            asleep = [f'{one.name} until {one.deadline:g}' for one in self._sleepers.values()]
            at_work = [thread.name for thread in self._at_work if thread.is_alive()]
        heard = 'all is heard' if self._all_heard() else 'not all is heard'
        return f'it is {self.now:g}; asleep: {asleep}; at work: {at_work}; {heard}'

    def fell_asleep(self, deadline: float, interrupt: Interrupt) -> None:
        """Have the calling thread sleep until ``deadline``, or until it is interrupted."""
        thread = threading.current_thread()
        with self._condition:
            self._sleepers[threading.get_ident()] = _Sleeper(thread.name, deadline, interrupt)
            self._at_work.discard(thread)
            self._condition.notify_all()

    def woke_up(self, *, in_time: bool) -> None:
        """Have the calling thread go on; ``in_time``: nobody has interrupted its sleep."""
        thread = threading.current_thread()
        with self._condition:
            self._sleepers.pop(threading.get_ident(), None)
            if in_time and not thread.name.endswith(CARRIES_ON):
                # It does what time has brought, and sleeps again: a battery that changes at random.
                self._at_work.add(thread)
            self._condition.notify_all()

    def _run(self) -> None:
        try:
            self._pass()
        except BaseException as error:
            self.error = error

    def _pass(self) -> None:
        while True:
            with self._condition:
                while not (self._ended or self._all_wait()):
                    self._condition.wait(0.01)  # no word of a thread's end, or of a message
                if self._ended:
                    return
                due = min(one.deadline for one in self._sleepers.values())
                due = max(due, self.now + STEP)
                action = None
                if self.alarms and self.alarms[0][0] <= due:
                    due, action = self.alarms.pop(0)
            self.now = max(self.now, due)
            self._publish()
            if action is not None:
                action()
            with self._condition:
                awake = self._condition.wait_for(
                    lambda: self._ended or not self._overdue(), PATIENCE
                )
            assert awake, f'a sleeper does not wake up: {self.standing()}'

    def _all_wait(self) -> bool:
        if any(thread.is_alive() for thread in self._at_work):
            return False
        if not self._all_heard():
            return False
        asleep = self._sleepers.values()
        if any(one.interrupt.is_set() for one in asleep):
            # It has only not noticed yet that it is to go on.
            return False
        return any(self.unattended or one.name.endswith(CARRIES_ON) for one in asleep)

    def _overdue(self) -> bool:
        return any(one.deadline <= self.now + 1e-9 for one in self._sleepers.values())

    def _publish(self) -> None:
        message = Clock()
        nanoseconds = round(self.now * 1e9)
        message.clock.sec, message.clock.nanosec = divmod(nanoseconds, 10**9)
        late = time.monotonic() + PATIENCE
        self._topic.publish(message)
        told = time.monotonic()
        while any(node.get_clock().now().nanoseconds < nanoseconds for node in self._nodes()):
            assert time.monotonic() < late, 'a node does not follow the clock'
            if time.monotonic() > told + 0.02:
                # A node that has just come had not met this topic yet.
                self._topic.publish(message)
                told = time.monotonic()
            threading.Event().wait(0.001)


class _ToldOf:
    """An interrupt by which a sleep tells that it has fixed when it ends.

    Time that moved between the telling and the fixing would let the sleep last longer than told.
    """

    def __init__(self, interrupt: Interrupt, asleep: Callable[[], None]) -> None:
        self._interrupt = interrupt
        self._asleep = asleep
        self.is_set = interrupt.is_set

    def subscribe(self, callback: Callable[[], None]) -> Callable[[], None]:
        self._asleep()
        return self._interrupt.subscribe(callback)


@contextmanager
def simulated_time(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatedTime]:
    """Put the graph's nodes on simulated time; call ``start`` once they are there."""
    driver = SimulatedTime(graph)
    sleep = ClockWait.sleep

    def watched(self: ClockWait, seconds: float, interrupt: Any = None) -> bool:
        ended_by = interrupt or Interrupt()
        told = _ToldOf(ended_by, lambda: driver.fell_asleep(self.now() + seconds, ended_by))
        in_time = False
        try:
            in_time = sleep(self, seconds, told)  # type: ignore[arg-type]
            return in_time
        finally:
            driver.woke_up(in_time=in_time)

    monkeypatch.setattr(ClockWait, 'sleep', watched)
    try:
        yield driver
    finally:
        driver.stop()
