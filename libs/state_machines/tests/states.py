"""States that the engine's tests are made of."""

from __future__ import annotations

import itertools
import json
import threading
from collections.abc import Callable, Iterable
from typing import Any

import state_machines as fsm
from state_machines import checkpoint
from state_machines.testing import FakeClock


class Answer(fsm.State):
    """Returns what it is given, in turn; the last for ever."""

    def __init__(self, *answers: Any, outcomes: Iterable[str] = ()) -> None:
        super().__init__(outcomes or [answer for answer in answers if isinstance(answer, str)])
        self.answers = list(answers)
        self.runs = 0

    def execute(self, ud: Any) -> Any:
        self.runs += 1
        answer = self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]
        if isinstance(answer, BaseException):
            raise answer
        return answer


class Waiter(fsm.State):
    """Waits on the machine's clock and serves preempts; tells when it has begun."""

    def __init__(self, seconds: float = 10.0, progress: str | None = None) -> None:
        super().__init__(['done', 'preempted'])
        self.seconds = seconds
        self.name = progress
        self.begun = threading.Semaphore(0)
        self.runs = 0

    def execute(self, ud: Any) -> str:
        self.runs += 1
        self.begun.release()
        if self.wait(self.seconds, self.name):
            return 'done'
        self.service_preempt()
        return 'preempted'


class Deaf(fsm.State):
    """Ignores preempts until it is released."""

    def __init__(self, outcomes: Iterable[str] = ('done', 'preempted')) -> None:
        super().__init__(outcomes, ['key'], ['key'])
        self.begun = threading.Semaphore(0)
        self.release = threading.Event()
        self.ended = threading.Event()
        self.late_error: BaseException | None = None
        self.ending: Callable[[Any], None] = lambda ud: None

    def execute(self, ud: Any) -> str:
        self.begun.release()
        self.release.wait(60.0)
        try:
            self.ending(ud)
        except BaseException as error:
            self.late_error = error
            raise
        finally:
            self.ended.set()
        return 'done'


class Background:
    """Executes a container on a thread of its own and hands its end back."""

    def __init__(self, container: Any, ud: Any = None) -> None:
        self._outcome: Any = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, args=(container, ud), daemon=True)
        self._thread.start()

    def _run(self, container: Any, ud: Any) -> None:
        try:
            self._outcome = container.execute(ud)
        except BaseException as error:
            self._error = error

    def result(self, timeout: float = 240.0) -> Any:
        """Return the outcome; raises what the execution raised."""
        self._thread.join(timeout)
        assert not self._thread.is_alive(), 'still running'
        if self._error is not None:
            raise self._error
        return self._outcome


def began(state: Any, timeout: float = 240.0) -> None:
    """Wait until a `Waiter` or `Deaf` has begun to execute."""
    assert state.begun.acquire(timeout=timeout), 'it did not begin'


def chain(
    *states: fsm.State, outcomes: Iterable[str] = ('done', 'preempted')
) -> tuple[fsm.StateMachine, list[fsm.StateMachine]]:
    """Machines in one another, the states in the innermost."""
    machines = [fsm.StateMachine(outcomes) for _ in range(3)]
    for outer, inner in itertools.pairwise(machines):
        with outer:
            fsm.StateMachine.add('INNER', inner)
    with machines[-1]:
        for number, state in enumerate(states):
            target = {'done': f'S{number + 1}'} if number + 1 < len(states) else {}
            fsm.StateMachine.add(f'S{number}', state, target)
    return machines[0], machines


class CheckpointedWorld:
    """The same machine, built anew for each process."""

    def __init__(self):
        self.clock = FakeClock()
        self.before, self.charge = Answer('done'), Waiter(5.0, progress='charged')
        self.explore = Waiter(10.0, progress='explored')
        inner = fsm.StateMachine(['done', 'preempted'])
        self.root = fsm.StateMachine(['done', 'preempted'])
        self.root.set_clock(self.clock)
        with self.root:
            fsm.StateMachine.add('INNER', inner)
            with inner:
                fsm.StateMachine.add('BEFORE', self.before, {'done': 'EXPLORE'})
                fsm.StateMachine.add('EXPLORE', self.explore)
        self.inner = inner
        self.root.add_interrupt('CHARGE', self.charge, priority=5)


def through_json(machine):
    return json.loads(json.dumps(checkpoint.capture(machine)))
