"""The clock that missions are tested by."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from state_machines.clock import Interrupt
from state_machines.ros import ClockWait
from surveillance_runtime.node import PatrolNode

from . import simulated_time as module
from .simulated_time import START, SimulatedTime, simulated_time


@pytest.fixture
def driver(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[SimulatedTime]:
    with simulated_time(graph, monkeypatch) as driver:
        yield driver


def test_a_sleep_that_begins_while_time_moves_ends_in_time(
    graph: Any, driver: SimulatedTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = graph.add(PatrolNode, {'use_sim_time': True}, name='sleeper')
    driver.follow(lambda: [node], lambda: True)
    wait = ClockWait(node)
    passed = ClockWait._passed

    def late(self: ClockWait) -> int:
        if threading.current_thread().name == 'late goal':
            # Time moves, for another sleeper, before this one has fixed when it ends.
            graph.until(lambda: driver.now >= START + 5.0)
            graph.until(lambda: wait.now() == driver.now)
        return passed(self)

    monkeypatch.setattr(ClockWait, '_passed', late)
    driver.start()
    threads = [
        threading.Thread(target=wait.sleep, args=(seconds,), name=name, daemon=True)
        for seconds, name in ((10.0, 'late goal'), (5.0, 'first goal'))
    ]
    for thread in threads:
        thread.start()
    graph.until(lambda: not any(thread.is_alive() for thread in threads))
    assert driver.error is None


def test_time_waits_for_a_sleeper_that_was_interrupted(graph: Any, driver: SimulatedTime) -> None:
    node = graph.add(PatrolNode, {'use_sim_time': True}, name='sleeper')
    wait = ClockWait(node)
    looks = itertools.count()
    driver.follow(lambda: [node], lambda: next(looks) >= 0)
    noticed: list[float] = []

    class Slow(Interrupt):
        def is_set(self) -> bool:
            raised = super().is_set()
            if raised and threading.current_thread().name == 'late goal':
                # The driver of time looks three times before this sleeper notices.
                until = next(looks) + 3
                graph.until(lambda: next(looks) > until or driver.now > START + 5.0)
                noticed.append(driver.now)
            return raised

    interrupt = Slow()
    driver.start()
    threads = [
        threading.Thread(target=wait.sleep, args=(10.0, interrupt), name='late goal', daemon=True),
        threading.Thread(target=wait.sleep, args=(50.0,), name='a goal', daemon=True),
    ]
    driver.at(5.0, interrupt.set)
    for thread in threads:
        thread.start()
    graph.until(lambda: noticed)
    assert noticed == [START + 5.0]


def test_a_node_that_does_not_follow_the_clock_is_the_error_of_the_test(
    graph: Any, driver: SimulatedTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = graph.add(PatrolNode, {'use_sim_time': True}, name='sleeper')
    stands = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=0))
    deaf = SimpleNamespace(get_clock=lambda: stands)
    driver.follow(lambda: [node], lambda: True)
    driver.start()
    monkeypatch.setattr(module, 'PATIENCE', 0.1)
    driver.follow(lambda: [node, deaf], lambda: True)
    wait = ClockWait(node)
    threading.Thread(target=wait.sleep, args=(5.0,), name='a goal', daemon=True).start()
    graph.until(lambda: driver.error)
    assert 'does not follow the clock' in str(driver.error)
