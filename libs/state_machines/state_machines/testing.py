"""The test kit: a clock turned by hand, scripted outcomes, the path taken, transition coverage.

A machine is tested with its own structure and without its states' work::

    clock = FakeClock()
    machine.set_clock(clock)
    script(machine, {'PATROL/MOVE': ['moved', 'blocked'], 'PATROL/EXPLORE': ['explored']})
    with watching(machine) as watched:
        machine.execute()
    watched.assert_path('MOVE', 'EXPLORE', 'MOVE', 'RECOVER')
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from state_machines.clock import Interrupt
from state_machines.container import Container
from state_machines.exceptions import InvalidStateError, InvalidTransitionError
from state_machines.program import RawTransition, unfold
from state_machines.state import State
from state_machines.structure import Structure, state_at


class FakeClock:
    """A clock that stands still until it is advanced.

    Args:
        leaps: Let every sleep pass at once, advancing the clock by it, as long as nobody has
            raised its interrupt: for machines that run in one thread.
    """

    def __init__(self, leaps: bool = False) -> None:
        self._now = 0.0
        self._leaps = leaps
        self._changed = threading.Condition()
        self._sleepers: list[tuple[float, Interrupt]] = []

    def now(self) -> float:
        """Return the time in seconds."""
        return self._now

    def sleep(self, seconds: float, interrupt: Interrupt) -> bool:
        """Wait until the clock has been advanced by `seconds`, or for the interrupt."""
        with self._changed:
            deadline = self._now + seconds
            if interrupt.is_set():
                return False
            if self._leaps:
                self._now = deadline
                return True
            sleeper = (deadline, interrupt)
            self._sleepers.append(sleeper)
            self._changed.notify_all()
        remove = interrupt.subscribe(self._wake)
        try:
            with self._changed:
                self._changed.wait_for(lambda: interrupt.is_set() or self._now >= deadline)
                self._sleepers.remove(sleeper)
                return not interrupt.is_set()
        finally:
            remove()

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def advance(self, seconds: float) -> None:
        """Move the clock forward; every sleep that is over ends."""
        with self._changed:
            self._now += seconds
            self._changed.notify_all()

    def until_sleeping(self, sleepers: int = 1, timeout: float = 60.0) -> None:
        """Block (in real time) until so many threads sleep on the clock.

        Raises:
            AssertionError: They do not, within `timeout` seconds.
        """

        def asleep() -> int:
            # One whose time is over, or that was interrupted, has only not woken yet.
            return sum(
                deadline > self._now and not interrupt.is_set()
                for deadline, interrupt in self._sleepers
            )

        with self._changed:
            enough = self._changed.wait_for(lambda: asleep() >= sleepers, timeout)
            assert enough, f'{asleep()} threads sleep after {timeout} s, not {sleepers}'


Scripted = str | Callable[[Any], str]


def script(machine: Container, outcomes: Mapping[str, Iterable[Scripted]]) -> None:
    """Have states return given outcomes in place of doing their work.

    Args:
        machine: The root.
        outcomes: From paths of states to what each execution returns in turn; a function is given
            the userdata, may write to it, and returns the outcome. Running out of outcomes is an
            error of the test.

    Raises:
        KeyError: There is no such state.
        InvalidStateError: The path is a container's.
        InvalidTransitionError: The state has no such outcome.
    """
    for path, sequence in outcomes.items():
        state = state_at(machine, path)
        if isinstance(state, Container):
            raise InvalidStateError(f"'{path}' is a container: script the states inside it")
        turns = deque(sequence)
        for outcome in turns:
            if isinstance(outcome, str) and outcome not in state.get_registered_outcomes():
                raise InvalidTransitionError(
                    f"State '{path}' has no outcome '{outcome}' to be scripted: its outcomes are "
                    f'{sorted(state.get_registered_outcomes())}'
                )
        _play(path, state, turns)


def _play(path: str, state: State, turns: deque[Scripted]) -> None:
    def execute(ud: Any) -> str:
        assert turns, f"State '{path}' is executed more often than it has scripted outcomes"
        turn = turns.popleft()
        return turn if isinstance(turn, str) else turn(ud)

    state.execute = execute  # type: ignore[method-assign]
    # Tables made before hold the old method.
    state.register_outcomes(())


class Watched:
    """The transitions a machine made.

    Attributes:
        transitions: (path of the container, from, outcome, to), in order.
    """

    def __init__(self, machine: Container) -> None:
        self._structure = Structure(machine)
        self.transitions: list[tuple[str, str, str, str]] = []

    def saw(self, raw: RawTransition) -> None:
        """Take a transition as the machine notes it."""
        noted = unfold(raw)
        if noted.is_transition:
            self.transitions.append((noted.path, noted.source, noted.outcome, noted.target))

    def path(self, container: str | None = None) -> list[str]:
        """Return the labels of the states that were executed in a container, in order; default: the
        root.
        """
        path = container or self._structure.path
        return [left for where, left, _, _ in self.transitions if where == path]

    def assert_path(self, *labels: str, container: str | None = None) -> None:
        """Hold the states that were executed in a container against `labels`.

        Raises:
            AssertionError: They differ; the message shows where.
        """
        taken = self.path(container)
        if taken == list(labels):
            return
        common = 0
        while common < min(len(taken), len(labels)) and taken[common] == labels[common]:
            common += 1
        where = container or self._structure.path
        raise AssertionError(
            f"'{where}' took {' -> '.join(taken) or 'no state'}; expected "
            f'{" -> ".join(labels) or "no state"}; they agree in the first {common}'
        )

    def untaken(self) -> list[tuple[str, str, str]]:
        """Transitions never taken, as (path of the container, from, outcome)."""
        taken = {transition[:3] for transition in self.transitions}
        return [transition for transition in self._possible() if transition not in taken]

    def coverage(self) -> float:
        """Return the share of all transitions that were taken, 0 to 1."""
        possible = self._possible()
        return 1.0 - len(self.untaken()) / len(possible) if possible else 1.0

    def _possible(self) -> list[tuple[str, str, str]]:
        return [
            (inner.path, edge.source, edge.outcome)
            for inner in self._structure.walk()
            if not inner.together
            for edge in inner.edges
        ]

    def assert_covered(self, *, except_for: Iterable[tuple[str, str, str]] = ()) -> None:
        """Hold that every transition was taken, but for those named.

        Raises:
            AssertionError: Some were not; the message lists them.
        """
        missing = sorted(set(self.untaken()) - set(except_for))
        assert not missing, 'never taken: ' + ', '.join(
            f"{path}/{source} : '{outcome}'" for path, source, outcome in missing
        )


@contextmanager
def watching(machine: Container) -> Iterator[Watched]:
    """Note the transitions of a root while the block runs, over any number of executions."""
    watched = Watched(machine)
    remove = machine.control.add_trace(watched.saw)
    try:
        yield watched
    finally:
        remove()
