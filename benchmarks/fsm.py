#!/usr/bin/env python3
"""Measures the state machine engine beside its peers, in one run.

    python3 benchmarks/fsm.py [--quick] [--peers FOLDER ...]

Peers are SMACH's pure-Python core, YASMIN's C++ core with its Python bindings, transitions,
py_trees and python-statemachine. Each is imported from the environment or from the folders that
``--peers`` names: for SMACH and YASMIN the folder that holds the package ``smach`` or the built
package ``yasmin``. One that is not found has no rows. The peers' logs are silenced. Absolute times
depend on the computer: what counts is the ratio within one run.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import random
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT))
sys.path.insert(0, str(CHECKOUT / 'libs' / 'state_machines'))

import state_machines as fsm
from benchmarks.sizes import sized_parser
from state_machines.checkpoint import Checkpointer, load
from state_machines.transitions import TransitionFeed
from state_machines.verify import verify

RING = 3
LEVELS = 3


def states_of(library: Any) -> tuple[type, type]:
    """Return the states of the ring for a library with SMACH's interface: plain, and with
    userdata.
    """

    class Plain(library.State):  # type: ignore[misc,name-defined]
        """Goes on until the machine has made enough transitions."""

        def __init__(self, limit: list[int]) -> None:
            library.State.__init__(self, ['next', 'done'])
            self.left = limit

        def execute(self, ud: object) -> str:
            left = self.left
            left[0] -= 1
            return 'next' if left[0] else 'done'

    class Counting(library.State):  # type: ignore[misc,name-defined]
        """The same, with the count in userdata."""

        def __init__(self) -> None:
            library.State.__init__(self, ['next', 'done'], ['left'], ['left'])

        def execute(self, ud: Any) -> str:
            ud.left -= 1
            return 'next' if ud.left else 'done'

    return Plain, Counting


def ring(states: Sequence[Any], library: Any = fsm) -> Any:
    """Return a machine whose states follow one another in a ring."""
    machine = library.StateMachine(['done'])
    with machine:
        for number, state in enumerate(states):
            target = f'S{(number + 1) % len(states)}'
            library.StateMachine.add(f'S{number}', state, {'next': target, 'done': 'done'})
    return machine


def flat(count: int, library: Any = fsm) -> Any:
    """Return a ring without userdata."""
    left, plain = [count], states_of(library)[0]
    return ring([plain(left) for _ in range(RING)], library)


def counting(count: int, library: Any = fsm) -> Any:
    """Return a ring with userdata."""
    state = states_of(library)[1]
    machine = ring([state() for _ in range(RING)], library)
    machine.userdata.left = count
    return machine


def nested(count: int, library: Any = fsm) -> Any:
    """Return a ring of three machines of three machines of three states each, with userdata.

    Each inner machine ends after its states, so that one transition in three enters or leaves one.
    """
    state = states_of(library)[1]

    def level(depth: int) -> Any:
        machine = library.StateMachine(['next', 'done'], ['left'], ['left'])
        with machine:
            for number in range(RING):
                last = number == RING - 1
                inner = level(depth - 1) if depth > 1 else state()
                target = 'next' if last else f'S{number + 1}'
                library.StateMachine.add(f'S{number}', inner, {'next': target, 'done': 'done'})
        return machine

    root = library.StateMachine(['done'])
    with root:
        for number in range(RING):
            target = f'S{(number + 1) % RING}'
            library.StateMachine.add(
                f'S{number}', level(LEVELS - 1), {'next': target, 'done': 'done'}
            )
    root.userdata.left = count
    return root


def traced(machine: Any) -> Any:
    """Have transitions kept."""
    machine.control.add_trace(deque(maxlen=1_000).append)
    return machine


def with_callback(machine: Any) -> Any:
    """Have one callback called on each transition."""
    machine.register_transition_cb(lambda userdata, active: None)
    return machine


def with_shutdown_check(machine: Any, library: Any = fsm) -> Callable[[], object]:
    """Have the shutdown check asked between any two states."""

    def work() -> None:
        library.set_shutdown_check(lambda: False)
        try:
            machine.execute()
        finally:
            library.set_shutdown_check(None)

    return work


def with_feed(machine: Any, count: int) -> Callable[[], object]:
    """Have every transition numbered and brought to a consumer; the clock stops with the last."""

    def work() -> None:
        seen = deque[int](maxlen=1)
        feed = TransitionFeed(machine, lambda transition: seen.append(transition.sequence))
        machine.execute()
        feed.close(timeout=600.0)
        assert seen[0] == count, f'{seen[0]} of {count} transitions came'

    return work


def timed(work: Callable[[], object]) -> float:
    """Return the seconds of processor time that `work` takes in all its threads, without garbage
    collection.

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
    """Return the seconds that reading the clock and keeping what it says takes: the least a trace
    can cost.
    """
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
            model.next()  # type: ignore[attr-defined]

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


def run_python_statemachine(count: int) -> Callable[[], object]:
    """`python-statemachine`: a ring of three states with a counter on the machine."""
    from statemachine import State, StateMachine

    class Ring(StateMachine):  # type: ignore[misc]
        a = State(initial=True)
        b = State()
        c = State()
        next = a.to(b) | b.to(c) | c.to(a)

    machine = Ring()
    left = count

    def work() -> None:
        nonlocal left
        while left:
            left -= 1
            machine.send('next')

    return work


def yasmin_state(outcomes: Sequence[str] = ('next', 'done')) -> Any:
    """Return a state for YASMIN that counts on the blackboard."""
    import yasmin

    class Count(yasmin.State):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(list(outcomes))

        def execute(self, blackboard: Any) -> str:
            left = blackboard['left'] - 1
            blackboard['left'] = left
            return 'next' if left else 'done'

    return Count


def yasmin_ring(make: Callable[[], Any], outer: Sequence[str], last: str, width: int = RING) -> Any:
    """Return a machine for YASMIN whose states follow one another; `last` comes after the last."""
    import yasmin

    machine = yasmin.StateMachine(outcomes=list(outer))
    for number in range(width):
        target = f'S{number + 1}' if number < width - 1 else last
        machine.add_state(f'S{number}', make(), transitions={'next': target, 'done': 'done'})
    return machine


def run_yasmin(count: int, levels: int = 1) -> Callable[[], object]:
    """YASMIN: a ring of three states, or the nested machine of `nested`."""
    import yasmin

    def level(depth: int) -> Any:
        if depth == 0:
            return state()
        return yasmin_ring(lambda: level(depth - 1), ['next', 'done'], 'next')

    state = yasmin_state()
    machine = yasmin_ring(lambda: level(levels - 1), ['done'], 'S0')
    blackboard = yasmin.Blackboard()
    blackboard['left'] = count
    return lambda: machine(blackboard)


# One execution, preempts, sizes.


def one_state(library: Any = fsm) -> Any:
    """Return a machine of one state."""
    machine = library.StateMachine(['done'])
    with machine:
        library.StateMachine.add(
            'ONLY', library.CBState(lambda ud: 'done', outcomes=['done']), {'done': 'done'}
        )
    return machine


def three_together(library: Any = fsm) -> Any:
    """Return a concurrence of three states that end at once."""
    concurrence = library.Concurrence(['done'], 'done')
    with concurrence:
        for label in 'ABC':
            library.Concurrence.add(label, library.CBState(lambda ud: 'done', outcomes=['done']))
    return concurrence


def time_of(work: Callable[[], object], repeats: int = 300, rounds: int = 20) -> float:
    """Return the seconds that some work takes, the wall's: the best of several rounds."""
    work()
    best = float('inf')
    for _ in range(rounds):
        begin = time.perf_counter()
        for _ in range(repeats):
            work()
        best = min(best, (time.perf_counter() - begin) / repeats)
    return best


def handing_over() -> float:
    """Return the seconds to hand something to another thread and get it back: the least of two
    threads.
    """
    there, back = threading.Lock(), threading.Lock()
    there.acquire()
    back.acquire()
    going_on = True

    def serve() -> None:
        while True:
            there.acquire()
            if not going_on:
                return
            back.release()

    def hand_over() -> None:
        there.release()
        back.acquire()

    thread = threading.Thread(target=serve)
    thread.start()
    spent = time_of(hand_over)
    going_on = False
    there.release()
    thread.join()
    return spent


class Sleeping(NamedTuple):
    """A machine whose deepest state waits for the preempt.

    Attributes:
        state: That state; ``ready`` is a semaphore that it releases before it waits, ``left`` when
            it returned.
        run: Executes the machine.
        preempt: Asks it to stop.
    """

    state: Any
    run: Callable[[], object]
    preempt: Callable[[], object]


def sleeping_in(library: Any, *, bounded: bool = False, depth: int = 5) -> Sleeping:
    """Return such a machine for a library with SMACH's interface.

    Args:
        library: The library.
        bounded: A state that ignores a preempt is left behind; this engine only.
        depth: How many machines there are in one another.
    """

    class Sleeper(library.State):  # type: ignore[misc,name-defined]
        def __init__(self) -> None:
            library.State.__init__(self, ['done', 'preempted'])
            self.ready = threading.Semaphore(0)
            self.asked = threading.Event()
            self.left = 0.0

        def request_preempt(self) -> None:
            library.State.request_preempt(self)
            self.asked.set()

        def execute(self, ud: object) -> str:
            self.ready.release()
            preempted = not self.wait(60.0) if library is fsm else self.asked.wait(60.0)
            self.asked.clear()
            self.left = time.perf_counter()
            if not preempted:
                return 'done'
            self.service_preempt()
            return 'preempted'

    sleeper = Sleeper()
    machine: Any = sleeper
    for _ in range(depth):
        outer = library.StateMachine(['done', 'preempted'])
        with outer:
            bound = {'done': 'done', 'preempted': 'preempted'}
            library.StateMachine.add('INNER', machine, bound)
        machine = outer
    if bounded:
        machine.preempt_timeout = 60.0
    return Sleeping(sleeper, lambda: machine.execute(library.UserData()), machine.request_preempt)


def sleeping_in_yasmin(depth: int = 5) -> Sleeping:
    """Return such a machine for YASMIN."""
    import yasmin

    class Sleeper(yasmin.State):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__(['done', 'preempted'])
            self.ready = threading.Semaphore(0)
            self.asked = threading.Event()
            self.left = 0.0

        def cancel_state(self) -> None:
            super().cancel_state()
            self.asked.set()

        def execute(self, blackboard: object) -> str:
            self.ready.release()
            preempted = self.asked.wait(60.0)
            self.asked.clear()
            self.left = time.perf_counter()
            return 'preempted' if preempted else 'done'

    sleeper = Sleeper()
    machine: Any = sleeper
    for _ in range(depth):
        outer = yasmin.StateMachine(outcomes=['done', 'preempted'])
        bound = {'done': 'done', 'preempted': 'preempted'}
        outer.add_state('INNER', machine, transitions=bound)
        machine = outer
    blackboard = yasmin.Blackboard()
    return Sleeping(sleeper, lambda: machine(blackboard), machine.cancel_state)


def preempt_latencies(repeats: int, sleeping: Sleeping) -> tuple[list[float], list[float]]:
    """Return the seconds from the request to the deepest state's exit, and to the root's end."""
    exits, ends = [], []
    for _ in range(repeats):
        ended: list[float] = []

        def body(ended: list[float] = ended) -> None:
            sleeping.run()
            ended.append(time.perf_counter())

        thread = threading.Thread(target=body)
        thread.start()
        sleeping.state.ready.acquire()
        # Let it get from the announcement into the wait itself.
        time.sleep(0.001)
        asked = time.perf_counter()
        sleeping.preempt()
        thread.join()
        exits.append(sleeping.state.left - asked)
        ends.append(ended[0] - asked)
    return exits, ends


def event_latencies(repeats: int) -> list[float]:
    """Return the seconds from setting an event to its waiter's waking: what the computer takes by
    itself.
    """
    woke: list[float] = []
    for _ in range(repeats):
        event, ready = threading.Event(), threading.Semaphore(0)

        def wait(event: threading.Event = event, ready: threading.Semaphore = ready) -> None:
            ready.release()
            event.wait()
            woke.append(time.perf_counter())

        thread = threading.Thread(target=wait)
        thread.start()
        ready.acquire()
        time.sleep(0.001)
        begin = time.perf_counter()
        event.set()
        thread.join()
        woke[-1] -= begin
    return woke


DEEPEST = 5_000
"""More levels than this are not tried."""


def resident() -> int:
    """Return the bytes of memory that this process has."""
    pages = int(Path('/proc/self/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE')


def bytes_of_a_state(name: str, count: int = 20_000) -> float:
    """Return the resident bytes that a state of a large machine takes, once it has run."""
    if name == 'YASMIN':
        make = yasmin_state()
        gc.collect()
        before = resident()
        import yasmin

        machine = yasmin_ring(make, ['done'], 'done', count)
        blackboard = yasmin.Blackboard()
        blackboard['left'] = 3
        machine(blackboard)
        return (resident() - before) / count
    library = fsm if name == 'this engine' else find_smach()
    state = states_of(library)[1]
    gc.collect()
    before = resident()
    machine = ring([state() for _ in range(count)], library)
    machine.userdata.left = 3
    machine.execute()
    gc.collect()
    return (resident() - before) / count


def runs_nested(name: str, depth: int) -> bool:
    """Tell whether a machine of so many levels runs to its end."""
    machine: Any
    if name == 'YASMIN':
        import yasmin

        machine = yasmin_state(['next', 'done'])()
        for _ in range(depth):
            outer = yasmin.StateMachine(outcomes=['next', 'done'])
            outer.add_state('INNER', machine, transitions={'next': 'next', 'done': 'done'})
            machine = outer
        blackboard = yasmin.Blackboard()
        blackboard['left'] = 1
        return bool(machine(blackboard) == 'done')
    library = fsm if name == 'this engine' else find_smach()
    machine = library.CBState(lambda ud: 'done', outcomes=['done'])
    for _ in range(depth):
        outer = library.StateMachine(['done'])
        with outer:
            library.StateMachine.add('INNER', machine, {'done': 'done'})
        machine = outer
    return bool(machine.execute() == 'done')


def in_process(work: Callable[[], float]) -> float:
    """Return what some work returns in a process of its own; 0 where it fails or the process
    dies.
    """
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        answer = 0.0
        with contextlib.suppress(BaseException):
            answer = float(work())
        os.write(writing, repr(answer).encode())
        os._exit(0)
    os.close(writing)
    with open(reading, 'rb') as file:
        text = file.read()
    os.waitpid(child, 0)
    return float(text or b'0')


def in_processes_of_their_own() -> tuple[dict[str, float], dict[str, int]]:
    """Return bytes a state and the deepest nesting that runs, of all that are there."""
    names = ['this engine']
    names += ['SMACH'] if find_smach() is not None else []
    names += ['YASMIN'] if find_yasmin() is not None else []
    measured, deepest = {}, {}
    for name in names:
        measured[name] = in_process(lambda name=name: bytes_of_a_state(name))  # type: ignore[misc]
        low, high = 1, DEEPEST + 1
        while high - low > max(1, low // 100):
            # The largest first: what is bounded by memory only needs one try.
            depth = DEEPEST if high > DEEPEST else (low + high) // 2
            runs = in_process(lambda name=name, depth=depth: runs_nested(name, depth))  # type: ignore[misc]
            low, high = (depth, high) if runs else (low, depth)
        deepest[name] = low
    return measured, deepest


def large_machine(width: int) -> fsm.StateMachine:
    """Return a ring of states, each of which writes a key of its own and reads the one before."""

    class Link(fsm.State):
        def execute(self, ud: object) -> str:
            return 'next'

    machine = fsm.StateMachine(['done'])
    with machine:
        for number in range(width):
            link = Link(['next', 'done'], [f'k{number - 1}'] if number else [], [f'k{number}'])
            fsm.StateMachine.add(f'S{number}', link, {'next': f'S{(number + 1) % width}'})
    return machine


def deep_machine(depth: int, state: type) -> fsm.StateMachine:
    """Machines in one another, with a loop of states of a kind in each."""
    machine = fsm.StateMachine(['done'], ['left'], ['left'])
    with machine:
        if depth > 1:
            fsm.StateMachine.add('INNER', deep_machine(depth - 1, state), {'done': 'S0'})
        fsm.StateMachine.add('S0', state(), {'next': 'S1'})
        fsm.StateMachine.add('S1', state(), {'next': 'S0'})
    return machine


# Faults.


class Work(fsm.State):
    """Takes a random time and serves preempts."""

    def __init__(self, generator: random.Random) -> None:
        super().__init__(['done', 'preempted'])
        self.generator = generator

    def execute(self, ud: object) -> str:
        if self.wait(self.generator.choice([0.0, 1e-5, 1e-4, 5e-4])):
            return 'done'
        self.service_preempt()
        return 'preempted'


def lost_preempts(count: int, seed: int = 1) -> int:
    """Preempts at random moments after which a mission of all four containers went on."""
    generator = random.Random(seed)
    each = fsm.Iterator(['preempted'], [], [], it=[1, 2, 3], exhausted_outcome='done')
    with each:
        fsm.Iterator.set_contained_state('EACH', Work(generator), loop_outcomes=['done'])
    row = fsm.Sequence(['done', 'preempted'], 'done')
    with row:
        fsm.Sequence.add('ONE', Work(generator))
        fsm.Sequence.add('ITEMS', each)
    # Neither names preempted: the engine has to.
    both = fsm.Concurrence(['done', 'preempted'], 'done')
    with both:
        fsm.Concurrence.add('ROW', row)
        fsm.Concurrence.add('OTHER', Work(generator))
    root = fsm.StateMachine(['preempted'])
    with root:
        fsm.StateMachine.add('BOTH', both, {'done': 'AGAIN'})
        fsm.StateMachine.add('AGAIN', Work(generator), {'done': 'BOTH'})
    lost = 0
    for _ in range(count):
        ends: list[Any] = []
        thread = threading.Thread(target=lambda ends=ends: ends.append(root.execute()))  # type: ignore[misc]
        thread.start()
        begin = time.perf_counter()
        delay = generator.uniform(0.0, 0.002)
        while time.perf_counter() - begin < delay:
            time.sleep(0.0)
        root.request_preempt()
        thread.join(5.0)
        if ends != ['preempted'] or root.preempt_requested():
            lost += 1
            root.request_preempt()
            thread.join()
    return lost


def mission(log: Any, checkpoint: Path, items: int) -> fsm.StateMachine:
    """Return a mission over items that says in a log what it begins and what its checkpoint has
    done.
    """

    def deed(ud: Any) -> str:
        log.write(f'begun {ud.item}\n')
        log.flush()
        ud.done = [*ud.done, ud.item]
        return 'next'

    each = fsm.Iterator(
        [], ['done'], ['done'], it=range(items), it_label='item', exhausted_outcome='all'
    )
    with each:
        state = fsm.CBState(
            deed, outcomes=['next'], input_keys=['item', 'done'], output_keys=['done']
        )
        fsm.Iterator.set_contained_state('ITEM', state, loop_outcomes=['next'])
    root = fsm.StateMachine(['all'])
    root.preempt_timeout = None
    root.userdata.done = []
    with root:
        fsm.StateMachine.add('ITEMS', each)
    # Before the checkpointer, which removes the file at the end.
    root.register_termination_cb(lambda *_: log.write('end 0\n') and log.flush())
    Checkpointer(root, checkpoint)

    def saved(ud: Any, active: object) -> None:
        # Registered after the checkpointer: what is done here is on the disk.
        for item in ud.done[-1:]:
            log.write(f'done {item}\n')
            log.flush()

    each.register_transition_cb(saved)
    return root


def faults_of_killed_missions(kills: int, seed: int = 2, items: int = 40) -> tuple[int, int, int]:
    """SIGKILLs of missions that go on from their checkpoints.

    Returns:
        The kills; items that were begun again although they had been done; items that were lost.
    """
    generator, killed, repeated, lost = random.Random(seed), 0, 0, 0
    with tempfile.TemporaryDirectory() as folder:
        number = 0
        while killed < kills:
            number += 1
            checkpoint, log = Path(folder) / f'{number}.json', Path(folder) / f'{number}.log'
            while True:
                child = os.fork()
                if child == 0:
                    _run_mission(checkpoint, log, items)
                time.sleep(generator.uniform(0.0, 0.03))
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child, signal.SIGKILL)
                _, status = os.waitpid(child, 0)
                killed += os.WIFSIGNALED(status)
                if log.exists() and log.read_text().endswith('end 0\n'):
                    break
            done: set[str] = set()
            begun: set[str] = set()
            for line in log.read_text().splitlines():
                word, item = line.split()
                if word == 'done':
                    done.add(item)
                elif word == 'begun':
                    repeated += item in done
                    begun.add(item)
            lost += items - len(begun)
    return killed, repeated, lost


def _run_mission(checkpoint: Path, log: Path, items: int) -> None:
    """Run a mission in this process, from its checkpoint if there is one, and end the process."""
    try:
        with open(log, 'a', encoding='utf-8') as file:
            machine = mission(file, checkpoint, items)
            if checkpoint.exists():
                load(machine, checkpoint)
            machine.execute()
        os._exit(0)
    except BaseException as error:
        print(f'mission failed: {error!r}', file=sys.stderr)
        os._exit(1)


# The run.


def found(name: str) -> Any:
    """Return a peer's module; None where it is not there."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def find_smach() -> Any:
    """Return SMACH with its log switched off, if it is there."""
    smach = found('smach')
    if smach is not None:
        smach.set_loggers(*[lambda message: None] * 4)
    return smach


def find_yasmin() -> Any:
    """Return YASMIN with its log switched off, but for errors, if it is there."""
    yasmin = found('yasmin')
    if yasmin is not None:
        yasmin.set_log_level(yasmin.LogLevel.ERROR)
    return yasmin


def percentile(values: Sequence[float], share: float) -> float:
    """Return the value below which `share` of the values lie."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def throughput(count: int, slow: int, rounds: int) -> None:
    """Print transitions a second, best of several rounds."""
    smach, few = find_smach(), max(slow // 10, 1_000)
    yasmin = find_yasmin() is not None
    subjects: list[tuple[str, int, Callable[[], Callable[[], object]]]] = [
        ('this engine, flat', count, lambda: flat(count).execute),
        ('this engine, flat, traced', count, lambda: traced(flat(count)).execute),
        ('this engine, flat, userdata', count, lambda: counting(count).execute),
        ('this engine, flat, userdata, traced', count, lambda: traced(counting(count)).execute),
        ('this engine, 3 levels, userdata', count, lambda: nested(count).execute),
        ('this engine, 3 levels, userdata, traced', count, lambda: traced(nested(count)).execute),
        (
            'this engine, userdata, a callback',
            count,
            lambda: with_callback(counting(count)).execute,
        ),
        (
            'this engine, userdata, shutdown check',
            count,
            lambda: with_shutdown_check(counting(count)),
        ),
        ('this engine, userdata, feed to its end', slow, lambda: with_feed(counting(slow), slow)),
    ]
    if smach is not None:
        subjects += [
            ('SMACH, flat', few, lambda: flat(few, smach).execute),
            ('SMACH, flat, userdata', few, lambda: counting(few, smach).execute),
            ('SMACH, 3 levels, userdata', few, lambda: nested(few, smach).execute),
        ]
    if yasmin:
        subjects += [
            ('YASMIN, flat, blackboard', slow, lambda: run_yasmin(slow)),
            ('YASMIN, 3 levels, blackboard', slow, lambda: run_yasmin(slow, LEVELS)),
        ]
    if found('transitions') is not None:
        subjects.append(('transitions, flat, counter', slow, lambda: run_transitions_library(slow)))
    if found('py_trees') is not None:
        subjects.append(('py_trees, flat, blackboard', slow, lambda: run_py_trees(slow)))
    if found('statemachine') is not None:
        name = 'python-statemachine, flat, counter'
        subjects.append((name, few, lambda: run_python_statemachine(few)))
    # Round by round, so that a busy moment of the computer meets all alike.
    best: dict[str, float] = {}
    for _ in range(rounds):
        for name, number, make in subjects:
            best[name] = max(best.get(name, 0.0), number / timed(make()))
    unit = best['this engine, flat, userdata']
    print(f'Transitions a second of processor time, best of {rounds} rounds')
    print(f'{"":42}{"a second":>12}{"each":>10}{"share":>10}')
    for name, rate in best.items():
        print(f'{name:42}{rate:12,.0f}{1e6 / rate:7.2f} us{rate / unit:10.2f}')
    if yasmin:
        ratio = best['this engine, 3 levels, userdata'] / best['YASMIN, 3 levels, blackboard']
        print(f'{"3 levels, this engine / YASMIN":42}{"":12}{"":10}{ratio:10.2f}')
    reading = min(clock_reading(count) for _ in range(rounds))
    print(f'a trace reads the clock and keeps its value: {1e6 * reading:.2f} us at the least')


def preempts(repeats: int) -> None:
    """Print how long preempts take, of all that are there in turn."""
    smach = find_smach()
    subjects: list[tuple[str, Callable[[], Sleeping]]] = [
        ('this engine', lambda: sleeping_in(fsm)),
        ('this engine, bounded', lambda: sleeping_in(fsm, bounded=True)),
    ]
    if smach is not None:
        subjects.append(('SMACH', lambda: sleeping_in(smach)))
    if find_yasmin() is not None:
        subjects.append(('YASMIN', sleeping_in_yasmin))
    exits: dict[str, list[float]] = {name: [] for name, _ in subjects}
    ends: dict[str, list[float]] = {name: [] for name, _ in subjects}
    events: list[float] = []
    turns = 10
    for _ in range(turns):
        events += event_latencies(repeats // turns)
        for name, make in subjects:
            exited, ended = preempt_latencies(repeats // turns, make())
            exits[name] += exited
            ends[name] += ended
    print(f'\n{"From the request of a preempt on":54}{"median":>12}{"p99":>12}{"worst":>12}')
    rows = [('one thread sets an Event for another', events)]
    for name, _ in subjects:
        rows.append((f'{name}, 5 levels, deepest state exits', exits[name]))
        rows.append((f'{name}, 5 levels, root has ended', ends[name]))
    for what, values in rows:
        row = [statistics.median(values), percentile(values, 0.99), max(values)]
        print(f'{what:54}{"".join(f"{1e3 * value:9.3f} ms" for value in row)}')


def single_executions() -> None:
    """Print what one execution takes."""
    smach, yasmin = find_smach(), find_yasmin()
    bounded = one_state()
    bounded.preempt_timeout = 60.0
    alone: list[tuple[str, Callable[[], object]]] = [
        ('this engine, execute() of one state', one_state().execute),
        ('this engine, bounded: preempt_timeout is set', bounded.execute),
        ('this engine, a concurrence of 3 states', three_together().execute),
    ]
    if smach is not None:
        alone += [
            ('SMACH, execute() of one state', one_state(smach).execute),
            ('SMACH, a concurrence of 3 states', three_together(smach).execute),
        ]
    if yasmin is not None:
        blackboard = yasmin.Blackboard()
        blackboard['left'] = 1 << 60
        machine = yasmin_ring(yasmin_state(['done', 'next']), ['next', 'done'], 'next', 1)
        states = {label: yasmin_state(['next', 'done'])() for label in 'ABC'}
        together = yasmin.Concurrence(states, 'done', {})
        alone += [
            ('YASMIN, one state', lambda: machine(blackboard)),
            ('YASMIN, a concurrence of 3 states', lambda: together(blackboard)),
        ]
    best: dict[str, float] = {}
    for _ in range(5):
        for name, work in alone:
            best[name] = min(best.get(name, 1.0), time_of(work, rounds=4))
    print()
    for name, spent in best.items():
        print(f'{name:42}{1e6 * spent:9.1f} us{1 / spent:12,.0f} a second')
    print(f'{"two threads: there and back":42}{1e6 * handing_over():9.1f} us')


def sizes(measured: dict[str, float], deepest: dict[str, int]) -> None:
    """Print bytes, depths, and what checks of large machines take."""
    print()
    for name, size in measured.items():
        print(f'{f"{name}, resident bytes a state":42}{size:9,.0f}')
    for name, depth in deepest.items():
        more = '' if depth < DEEPEST else ' (no more were tried)'
        print(f'{f"{name}, levels that run":42}{depth:9,}{more}')
    for what, machine in (
        ('10,000 states', large_machine(10_000)),
        ('50 levels', deep_machine(50, states_of(fsm)[1])),
    ):
        begin = time.perf_counter()
        findings = len(verify(machine, ['left']))
        spent = time.perf_counter() - begin
        print(f'{f"verify, {what}":42}{spent:9.3f} s, {findings} findings')


def main() -> int:
    """Measure and print."""
    parser = sized_parser(__doc__, quick='a run below 60 s')
    parser.add_argument(
        '--peers', nargs='+', default=[], metavar='FOLDER', help='where peers are imported from'
    )
    parser.add_argument(
        '--only', choices=('kills', 'rates', 'preempts', 'single', 'sizes'), help='one part of it'
    )
    options = parser.parse_args()
    sys.path += options.peers
    size, only = options.size, options.only
    if only in (None, 'kills'):
        # Before anything else: the processes that are forked have one thread then.
        kills, repeated, lost = faults_of_killed_missions(size.of(1_000, 100, 2))
        print(
            f'SIGKILLs of a checkpointed mission, {kills:,}: {repeated} items repeated, {lost} lost'
        )
    if only in (None, 'sizes'):
        sizes(*in_processes_of_their_own())
    if only in (None, 'rates'):
        throughput(size.of(600_000, 60_000, 600), size.of(120_000, 20_000, 200), size.of(7, 3, 1))
    if only in (None, 'single'):
        single_executions()
    if only in (None, 'preempts'):
        preempts(size.of(3_000, 300, 10))
        count = size.of(10_000, 1_000, 10)
        print(f'\npreempts at random moments, {count:,}: {lost_preempts(count)} lost')
    return 0


if __name__ == '__main__':
    sys.exit(main())
