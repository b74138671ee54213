#!/usr/bin/env python3
"""How fast the state machine engine is, beside `transitions` and `py_trees` in the same run.

Transitions per second: flat (a ring of three states), three levels nested, without and with a
userdata counter that each state reads and writes, with introspection off and on (every transition
noted with its time, duration and userdata). Preempt latency: from the request on the root to the
return of the wait in the state five levels below, and to the end of the root's execution.

    .venv/bin/python benchmarks/fsm.py --quick
"""

from __future__ import annotations

import argparse
import gc
import statistics
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / 'surveillance_behaviour'))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent / 'surveillance_runtime'))

import surveillance_fsm as fsm
from surveillance_fsm.history import TransitionFeed

RING = 3
LEVELS = 3


class Plain(fsm.State):
    """Goes on until the machine has made enough transitions."""

    def __init__(self, limit: list[int]) -> None:
        super().__init__(['next', 'done'])
        self._left = limit

    def execute(self, ud: object) -> str:
        left = self._left
        left[0] -= 1
        return 'next' if left[0] else 'done'


class Counting(fsm.State):
    """The same, with the count in userdata."""

    def __init__(self) -> None:
        super().__init__(['next', 'done'], input_keys=['left'], output_keys=['left'])

    def execute(self, ud: fsm.UserData) -> str:
        ud.left -= 1
        return 'next' if ud.left else 'done'


def ring(states: Sequence[fsm.State], keys: Sequence[str] = ()) -> fsm.StateMachine:
    """A machine whose states follow one another in a ring."""
    machine = fsm.StateMachine(['done'], keys, keys)
    with machine:
        for number, state in enumerate(states):
            target = f'S{(number + 1) % len(states)}'
            fsm.StateMachine.add(f'S{number}', state, {'next': target})
    return machine


def flat(count: int) -> fsm.StateMachine:
    """A ring without userdata."""
    left = [count]
    return ring([Plain(left) for _ in range(RING)])


def counting(count: int) -> fsm.StateMachine:
    """A ring with userdata."""
    machine = ring([Counting() for _ in range(RING)])
    machine.userdata.left = count
    return machine


def nested(count: int) -> fsm.StateMachine:
    """A ring of three machines of three machines of three states each, with userdata.

    Each inner machine ends after its states, so that one transition in three enters or leaves one.
    """

    def level(depth: int) -> fsm.StateMachine:
        machine = fsm.StateMachine(['next', 'done'], ['left'], ['left'])
        with machine:
            for number in range(RING):
                last = number == RING - 1
                state = level(depth - 1) if depth > 1 else Counting()
                target = 'next' if last else f'S{number + 1}'
                fsm.StateMachine.add(f'S{number}', state, {'next': target})
        return machine

    root = fsm.StateMachine(['done'])
    with root:
        for number in range(RING):
            target = f'S{(number + 1) % RING}'
            fsm.StateMachine.add(f'S{number}', level(LEVELS - 1), {'next': target})
    root.userdata.left = count
    return root


def timed(work: Callable[[], object]) -> float:
    """Seconds of processor time that `work` takes in all its threads, without garbage collection.

    Processor time and not the wall's, so that other programs on the computer count less.
    """
    gc.collect()
    gc.disable()
    try:
        begin = time.process_time()
        work()
        return time.process_time() - begin
    finally:
        gc.enable()


def clock_reading(count: int) -> float:
    """Seconds that reading the clock and keeping what it says takes: the least a trace can cost."""
    keep, now = deque[float](maxlen=1_000).append, time.monotonic

    def read() -> None:
        for _ in range(count):
            keep(now())

    def nothing() -> None:
        for _ in range(count):
            pass

    return (timed(read) - timed(nothing)) / count


def run_transitions_library(count: int) -> Callable[[], object]:
    """`transitions`: a ring of three states with a counter on the model."""
    from transitions import Machine

    class Model:
        left = count

    model = Model()
    names = [f'S{number}' for number in range(RING)]
    Machine(
        model,
        names,
        initial='S0',
        auto_transitions=False,
        transitions=[['next', names[n], names[(n + 1) % RING]] for n in range(RING)],
    )

    def work() -> None:
        while model.left:
            model.left -= 1
            model.next()

    return work


def run_py_trees(count: int) -> Callable[[], object]:
    """`py_trees`: a sequence of three behaviours with a counter on the blackboard."""
    import py_trees

    class Count(py_trees.behaviour.Behaviour):
        def setup(self) -> None:
            self.blackboard = self.attach_blackboard_client(name=self.name)
            self.blackboard.register_key('left', access=py_trees.common.Access.WRITE)

        def update(self) -> py_trees.common.Status:
            self.blackboard.left -= 1
            return py_trees.common.Status.SUCCESS

    root = py_trees.composites.Sequence('ring', memory=True)
    root.add_children([Count(f'S{number}') for number in range(RING)])
    root.setup_with_descendants()
    client = py_trees.blackboard.Client(name='benchmark')
    client.register_key('left', access=py_trees.common.Access.WRITE)
    client.left = count

    def work() -> None:
        while client.left > 0:
            root.tick_once()

    return work


class Sleeper(fsm.State):
    """Waits for the preempt and notes when it woke."""

    def __init__(self) -> None:
        super().__init__(['done', 'preempted'])
        self.ready = threading.Semaphore(0)
        self.woke = 0.0

    def execute(self, ud: object) -> str:
        self.ready.release()
        if self.wait(60.0):
            return 'done'
        self.woke = time.perf_counter()
        self.service_preempt()
        return 'preempted'


def preempt_latencies(repeats: int, depth: int = 5) -> tuple[list[float], list[float]]:
    """Seconds from the request to the deepest state's waking, and to the root's end."""
    sleeper = Sleeper()
    machine: fsm.State = sleeper
    for _ in range(depth):
        outer = fsm.StateMachine(['done', 'preempted'])
        with outer:
            fsm.StateMachine.add('INNER', machine)
        machine = outer
    root = machine
    woke, ended = [], []
    for _ in range(repeats):
        ends: list[float] = []

        def body(ends: list[float] = ends) -> None:
            root.execute(None)
            ends.append(time.perf_counter())

        thread = threading.Thread(target=body)
        thread.start()
        sleeper.ready.acquire()
        # Let it get from the announcement into the wait itself.
        time.sleep(0.001)
        asked = time.perf_counter()
        root.request_preempt()
        thread.join()
        woke.append(sleeper.woke - asked)
        ended.append(ends[0] - asked)
    return woke, ended


def percentile(values: Sequence[float], share: float) -> float:
    """The value below which `share` of the values lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--quick', action='store_true', help='a run below 50 s')
    options = parser.parse_args()
    count = 100_000 if options.quick else 600_000
    slow_count = 30_000 if options.quick else 120_000
    rounds = 5 if options.quick else 7

    def traced(machine: fsm.StateMachine) -> fsm.StateMachine:
        machine.control.add_trace(deque(maxlen=1_000).append)
        return machine

    def feed(machine: fsm.StateMachine) -> Callable[[], object]:
        TransitionFeed(machine, lambda transition: None)
        return machine.execute

    subjects: list[tuple[str, int, Callable[[], Callable[[], object]]]] = [
        ('this engine, flat', count, lambda: flat(count).execute),
        ('this engine, flat, traced', count, lambda: traced(flat(count)).execute),
        ('this engine, flat, userdata', count, lambda: counting(count).execute),
        ('this engine, flat, userdata, traced', count, lambda: traced(counting(count)).execute),
        ('this engine, 3 levels, userdata', count, lambda: nested(count).execute),
        ('this engine, 3 levels, userdata, traced', count, lambda: traced(nested(count)).execute),
        ('this engine, flat, userdata, feed', slow_count, lambda: feed(counting(slow_count))),
        ('transitions, flat, counter', slow_count, lambda: run_transitions_library(slow_count)),
        ('py_trees, flat, blackboard', slow_count, lambda: run_py_trees(slow_count)),
    ]
    # Round by round, so that a busy moment of the computer meets all alike.
    best: dict[str, float] = {}
    for _ in range(rounds):
        for name, number, make in subjects:
            rate = number / timed(make())
            best[name] = max(best.get(name, 0.0), rate)
    peer = best['transitions, flat, counter']
    print(f'Transitions per second, best of {rounds} rounds of {count:,} (peers {slow_count:,})')
    print(f'{"":42}{"per second":>12}{"each":>10}{"x transitions":>15}')
    for name, rate in best.items():
        print(f'{name:42}{rate:12,.0f}{1e6 / rate:7.2f} us{rate / peer:15.1f}')
    print()
    for kind in ('flat', 'flat, userdata', '3 levels, userdata'):
        off, on = best[f'this engine, {kind}'], best[f'this engine, {kind}, traced']
        print(f'introspection, {kind}: {100 * (1 - on / off):.0f} % fewer transitions per second')
    reading = min(clock_reading(count) for _ in range(rounds))
    least = reading * best['this engine, flat']
    print(
        f'reading the clock and keeping its value: {1e6 * reading:.2f} us, by itself '
        f'{100 * least / (1 + least):.0f} % fewer, flat'
    )
    repeats = 300 if options.quick else 3000
    woke, ended = preempt_latencies(repeats)
    print()
    print(f'Preempt latency through 5 levels, {repeats} requests')
    print(f'{"":42}{"median":>12}{"p99":>10}{"worst":>12}')
    for name, values in (('deepest state wakes', woke), ('root has ended', ended)):
        print(
            f'{name:42}{statistics.median(values) * 1e3:9.3f} ms'
            f'{percentile(values, 0.99) * 1e3:7.2f} ms{max(values) * 1e3:9.2f} ms'
        )
    return 0


if __name__ == '__main__':
    sys.exit(main())
