"""Records of what a machine did: numbered transitions, as JSON Lines, and their replay.

The machine's thread only appends to a queue; numbering, counting and turning userdata into JSON
happen where the queue is emptied.
"""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any

from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.engine import RawTransition, unfold
from surveillance_fsm.exceptions import SmachError
from surveillance_fsm.log import logerr
from surveillance_fsm.structure import Structure, structure_of
from surveillance_fsm.waiting import WALL_CLOCK, Clock, Interrupt

FORMAT = 'surveillance-fsm-record'
VERSION = 1
QUEUE_LENGTH = 100_000
"""Transitions that may wait to be written; the oldest are lost beyond that, as numbers show."""


class RecordError(SmachError):
    """A record cannot be read, or does not fit the machine."""


@dataclass(frozen=True)
class Transition:
    """One transition.

    Attributes:
        sequence: Counted from 1 over all containers of the root.
        time: Seconds on the machine's clock.
        path: Path of the container.
        from_state: Label of the state that ended.
        outcome: What it ended with.
        to_state: Label entered, or the container's outcome when `kind` is ``exit``.
        kind: ``transition``, ``exit``, ``interrupt``, ``resume``, ``forced``, or ``ended`` for a
            child of a concurrence.
        duration: Seconds that `from_state` took.
        visits: How often `to_state` has been entered, this time included.
        userdata: The container's userdata as far as JSON can show it.
    """

    sequence: int
    time: float
    path: str
    from_state: str
    outcome: str
    to_state: str
    kind: str
    duration: float
    visits: int
    userdata: dict[str, Any] = field(default_factory=dict)


def shown(userdata: dict[str, Any]) -> dict[str, Any]:
    """The part of userdata that JSON can show."""
    part = {}
    for key, value in userdata.items():
        try:
            json.dumps(value, allow_nan=False)
        except Exception:
            # Whatever it is that its class, or a thread that changes it meanwhile, raises.
            continue
        part[key] = value
    return part


class TransitionFeed:
    """Brings a root's transitions to a consumer on a thread of its own.

    Args:
        machine: The root.
        consume: Takes each `Transition`, in order, on the feed's thread.
        show_userdata: Whether transitions carry userdata.
    """

    def __init__(
        self,
        machine: ActiveContainer,
        consume: Callable[[Transition], object],
        show_userdata: bool = True,
    ) -> None:
        self._consume = consume
        self._show_userdata = show_userdata
        self._queue: deque[RawTransition] = deque()
        self._lost: deque[None] = deque()
        self._visits: dict[tuple[str, str], int] = {}
        self._entered: dict[str, float] = {}
        self._sequence = 0
        self._wakeup = threading.Event()
        self._drained = threading.Condition()
        self._asleep = False
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='fsm transitions', daemon=True)
        self._thread.start()
        self._end_reports = machine.control.add_trace(self._make_sink())

    def _make_sink(self) -> Callable[[RawTransition], None]:
        # Several threads may come here at once: each of these is one step.
        queue, append, wake = self._queue, self._queue.append, self._wakeup.set

        def sink(raw: RawTransition) -> None:
            append(raw)
            if self._asleep:
                wake()
            if len(queue) > QUEUE_LENGTH:
                with suppress(IndexError):
                    queue.popleft()
                    self._lost.append(None)

        return sink

    def flush(self, timeout: float | None = None) -> bool:
        """Wait until everything so far has been consumed; tells whether that was in time."""
        with self._drained:
            return self._drained.wait_for(lambda: self._asleep and not self._queue, timeout)

    def close(self, timeout: float = 5.0) -> None:
        """Stop reporting, consume what is left and end the thread."""
        self._end_reports()
        self._closing = True
        self._wakeup.set()
        self._thread.join(timeout)

    def _run(self) -> None:
        queue = self._queue
        while True:
            while queue:
                try:
                    transition = self._transition(queue.popleft())
                    if transition is not None:
                        self._consume(transition)
                except Exception as error:
                    logerr(f'Reporting a transition raised {type(error).__name__}: {error}')
            if self._closing:
                return
            self._wakeup.clear()
            with self._drained:
                self._asleep = True
                self._drained.notify_all()
            # Asleep first, then a last look: the machine does it the other way round.
            if not queue and not self._closing:
                self._wakeup.wait()
            self._asleep = False

    def _transition(self, raw: RawTransition) -> Transition | None:
        noted = unfold(raw)
        while self._lost:
            # What was lost leaves a gap.
            self._lost.pop()
            self._sequence += 1
        place = (noted.path, noted.target)
        visits = self._visits[place] = self._visits.get(place, 0) + 1
        since = self._entered.get(noted.path, noted.time)
        if noted.kind != 'ended':
            self._entered[noted.path] = noted.time
        if noted.kind == 'start':
            return None
        self._sequence += 1
        return Transition(
            self._sequence,
            noted.time,
            noted.path,
            noted.source,
            noted.outcome,
            noted.target,
            noted.kind,
            noted.time - since,
            visits,
            shown(noted.userdata) if self._show_userdata else {},
        )


class Recorder:
    """Writes a root's transitions to a file, one JSON object per line.

    Args:
        machine: The root.
        path: The file; it is overwritten.
    """

    def __init__(self, machine: ActiveContainer, path: str | Path) -> None:
        self._file: IO[str] = open(path, 'w', encoding='utf-8', buffering=1)  # noqa: SIM115
        root = structure_of(machine).path
        header = {'format': FORMAT, 'version': VERSION, 'root': root}
        self._file.write(json.dumps(header) + '\n')
        self._feed = TransitionFeed(machine, self._write)

    def _write(self, transition: Transition) -> None:
        self._file.write(json.dumps(asdict(transition), ensure_ascii=False) + '\n')

    def close(self) -> None:
        """Write what is left and close the file."""
        self._feed.close()
        self._file.close()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def read_record(path: str | Path) -> list[Transition]:
    """Read what a `Recorder` wrote; a last line that was cut off is left out.

    Raises:
        RecordError: The file is not such a record; the message names file and line.
    """
    try:
        lines = Path(path).read_text(encoding='utf-8').split('\n')
    except (OSError, UnicodeDecodeError) as error:
        raise RecordError(f'{path}: {error}') from error
    try:
        header = json.loads(lines[0])
        known = header['format'] == FORMAT and header['version'] == VERSION
    except (ValueError, KeyError, TypeError):
        known = False
    if not known:
        raise RecordError(f'{path}:1: not a {FORMAT} of version {VERSION}')
    transitions = []
    for number, line in enumerate(lines[1:], start=2):
        if not line:
            continue
        try:
            transitions.append(Transition(**json.loads(line)))
        except (ValueError, TypeError) as error:
            if number == len(lines):
                break
            raise RecordError(f'{path}:{number}: {error}') from error
    return transitions


@dataclass(frozen=True)
class Step:
    """A replayed transition.

    Attributes:
        transition: The transition.
        active: Paths of all states that are active after it.
    """

    transition: Transition
    active: tuple[str, ...]


def replay(machine: ActiveContainer, transitions: Iterable[Transition]) -> Iterator[Step]:
    """Go through a record on a machine's structure, without executing a state.

    Every transition is held against the machine: a record of another version of it stops at the
    first difference.

    Args:
        machine: A machine built like the recorded one.
        transitions: The record.

    Raises:
        RecordError: A transition that the machine cannot make.
    """
    root = structure_of(machine)
    containers = {inner.path: inner for inner in root.walk()}
    active: set[str] = set(_entered(root))
    for transition in transitions:
        container = containers.get(transition.path)
        if container is None:
            raise RecordError(f"Transition {transition.sequence}: no container '{transition.path}'")
        _check(container, transition)
        left = f'{transition.path}/{transition.from_state}'
        if transition.kind == 'exit' or transition.kind == 'ended':
            active = {path for path in active if not _within(path, left)}
        else:
            active = {path for path in active if not _within(path, left)}
            place = f'{transition.path}/{transition.to_state}'
            active.add(place)
            if place in containers:
                active |= set(_entered(containers[place]))
        yield Step(transition, tuple(sorted(active)))


def play(
    steps: Iterable[Step],
    show: Callable[[Step], object],
    speed: float = 1.0,
    clock: Clock = WALL_CLOCK,
    interrupt: Interrupt | None = None,
) -> bool:
    """Show steps at the pace they were recorded at.

    Args:
        steps: What `replay` gives.
        show: Takes each step when its time has come.
        speed: How many times faster.
        clock: Waits between steps.
        interrupt: Ends it early.

    Returns:
        Whether all steps were shown.
    """
    interrupt = interrupt or Interrupt()
    before: float | None = None
    for step in steps:
        time = step.transition.time
        pause = 0.0 if before is None else max(0.0, (time - before) / speed)
        before = time
        if not clock.sleep(pause, interrupt):
            return False
        show(step)
    return True


def _entered(container: Structure) -> list[str]:
    paths = []
    for label in container.initial:
        paths.append(f'{container.path}/{label}')
        if label in container.inner:
            paths += _entered(container.inner[label])
    return paths


def _within(path: str, place: str) -> bool:
    return path == place or path.startswith(place + '/')


def _check(container: Structure, transition: Transition) -> None:
    what = f'Transition {transition.sequence} in {container.path!r}'
    states = container.all_states()
    if transition.from_state not in states:
        raise RecordError(f'{what}: no state {transition.from_state!r}')
    if transition.kind in ('interrupt', 'resume'):
        if transition.to_state not in states:
            raise RecordError(f'{what}: no state {transition.to_state!r}')
        return
    if transition.kind == 'ended':
        if transition.outcome not in states[transition.from_state].get_registered_outcomes():
            raise RecordError(
                f'{what}: {transition.from_state!r} has no outcome {transition.outcome!r}'
            )
        return
    leaving = transition.kind == 'exit'
    for edge in container.edges:
        if (
            edge.source == transition.from_state
            and edge.leaving == leaving
            and edge.target == transition.to_state
        ):
            return
    if leaving and transition.to_state in container.outcomes:
        # An interrupt's state that ended where the container was about to end.
        return
    raise RecordError(
        f'{what}: {transition.from_state!r} does not lead to {transition.to_state!r} by '
        f'{transition.outcome!r}'
    )
