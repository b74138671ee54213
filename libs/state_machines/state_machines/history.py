"""What a machine did, and where it is: transitions, records and their replay, checkpoints.

A `TransitionFeed` brings numbered transitions to a consumer, a `Recorder` writes them as JSON
Lines, `replay` holds a record against a machine. The machine's thread only appends to a queue;
numbering, counting and turning userdata into JSON happen where the queue is emptied.

A checkpoint holds, for every container, the state it is in, the interrupts under way, its userdata
and how far its states have come (`State.progress`). A machine built in the same way takes it over
and goes on with the state that was active, executed anew, in another process if need be.
"""

from __future__ import annotations

import base64
import json
import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any

from state_machines.clock import elapsed_of
from state_machines.container import Container
from state_machines.exceptions import MachineFileError, describe, shown
from state_machines.files import parse_json, read_file, replace_file
from state_machines.frame import History
from state_machines.log import logerr, logwarn
from state_machines.nodes import Noted, RawTransition, unfold
from state_machines.state import State
from state_machines.structure import Edge, Structure
from state_machines.userdata import raw

RECORD_FORMAT = 'surveillance-fsm-record'
RECORD_VERSION = 1
CHECKPOINT_FORMAT = 'surveillance-fsm-checkpoint'
CHECKPOINT_VERSION = 2
LARGEST_RECORD = 2_000_000_000
LARGEST_CHECKPOINT = 200_000_000
"""More bytes than this are not read."""
QUEUE_LENGTH = 100_000
"""Transitions that may wait to be written; the oldest are lost beyond that, as numbers show."""


# Transitions.


@dataclass(frozen=True)
class Transition:
    """One transition.

    Attributes:
        sequence: Counted from 1 over all containers of the root.
        time: Seconds on the machine's clock.
        path: Path of the container.
        from_state: Label of the state that ended; empty for all states of a concurrence, and for an
            interrupt that ran first of all.
        outcome: What it ended with.
        to_state: Label entered, or the container's outcome when `kind` is ``exit``; empty for all
            states of a concurrence.
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


def presentable(userdata: dict[str, Any]) -> dict[str, Any]:
    """Return the part of userdata that JSON can show."""
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
        changed: Told the path of each container that begins or goes on, and of the root when that
            has ended; in order with the transitions.
    """

    def __init__(
        self,
        machine: Container,
        consume: Callable[[Transition], object],
        changed: Callable[[str], object] = lambda _path: None,
    ) -> None:
        self._consume = consume
        self._changed = changed
        # An event among the transitions is set by whoever comes to it.
        self._queue: SimpleQueue[RawTransition | threading.Event] = SimpleQueue()
        self._lost: deque[None] = deque()
        self._visits: dict[tuple[str, str], int] = {}
        self._entered: dict[str, float] = {}
        self._sequence = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='fsm transitions', daemon=True)
        self._thread.start()
        self._end_reports = machine.control.add_trace(self._take)

    def _take(self, raw: RawTransition) -> None:
        # Several threads may come here at once: each of these is one step.
        queue = self._queue
        queue.put(raw)
        if queue.qsize() > QUEUE_LENGTH:
            with suppress(Empty):
                oldest = queue.get_nowait()
                if isinstance(oldest, threading.Event):
                    queue.put(oldest)
                elif unfold(oldest).is_transition:
                    self._lost.append(None)

    def flush(self, timeout: float | None = None) -> bool:
        """Wait until everything so far has been consumed; tells whether that was in time."""
        consumed = threading.Event()
        self._queue.put(consumed)
        return consumed.wait(timeout)

    def close(self, timeout: float = 5.0) -> None:
        """Stop reporting, consume what is left and end the thread."""
        self._end_reports()
        self._closing = True
        self._queue.put(threading.Event())
        self._thread.join(timeout)

    def _run(self) -> None:
        while True:
            raw = self._queue.get()
            if isinstance(raw, threading.Event):
                raw.set()
            else:
                try:
                    self._tell(unfold(raw))
                except Exception as error:
                    logerr(f'Reporting a transition raised {describe(error)}')
            if self._closing and self._queue.empty():
                return

    def _tell(self, noted: Noted) -> None:
        while self._lost:
            # What was lost leaves a gap.
            self._lost.pop()
            self._sequence += 1
        if noted.kind == 'entered':
            self._entered[noted.path] = noted.time
            return
        if noted.kind == 'end':
            self._changed(noted.path)
            return
        place = (noted.path, noted.target)
        visits = self._visits[place] = self._visits.get(place, 0) + 1
        since = self._entered.get(noted.path, noted.time)
        if noted.kind != 'ended':
            self._entered[noted.path] = noted.time
        if noted.kind == 'start':
            self._changed(noted.path)
            return
        self._sequence += 1
        self._consume(
            Transition(
                self._sequence,
                noted.time,
                noted.path,
                noted.source,
                noted.outcome,
                noted.target,
                noted.kind,
                noted.time - since,
                visits,
                presentable(noted.userdata),
            )
        )


class Recorder:
    """Writes a root's transitions to a file, one JSON object per line.

    Args:
        machine: The root.
        path: The file; it is overwritten.
    """

    def __init__(self, machine: Container, path: str | Path) -> None:
        self._file: IO[str] = open(path, 'w', encoding='utf-8', buffering=1)  # noqa: SIM115
        root = Structure(machine).path
        header = {'format': RECORD_FORMAT, 'version': RECORD_VERSION, 'root': root}
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
        MachineFileError: The file is not such a record; the message names file and line.
    """
    try:
        lines = read_file(path, LARGEST_RECORD).decode('utf-8').split('\n')
    except (OSError, UnicodeDecodeError) as error:
        raise MachineFileError(f'{path}: {getattr(error, "strerror", error)}') from error
    try:
        header = parse_json(lines[0])
        known = header['format'] == RECORD_FORMAT and header['version'] == RECORD_VERSION
    except (ValueError, KeyError, TypeError):
        known = False
    if not known:
        raise MachineFileError(f'{path}:1: not a {RECORD_FORMAT} of version {RECORD_VERSION}')
    transitions = []
    for number, line in enumerate(lines[1:], start=2):
        if not line:
            continue
        try:
            transitions.append(Transition(**parse_json(line)))
        except (ValueError, TypeError) as error:
            if number == len(lines):
                break
            raise MachineFileError(f'{path}:{number}: {error}') from error
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


def replay(machine: Container, transitions: Iterable[Transition]) -> Iterator[Step]:
    """Go through a record on a machine's structure, without executing a state.

    Every transition is held against the machine: a record of another version of it stops at the
    first difference.

    Args:
        machine: A machine built like the recorded one.
        transitions: The record.

    Raises:
        MachineFileError: A transition that the machine cannot make.
    """
    root = Structure(machine)
    containers = {inner.path: inner for inner in root.walk()}
    active: set[str] = set(_entered(root))
    # What was active in a container when an interrupt came, the last one last.
    aside: dict[str, list[set[str]]] = {path: [] for path in containers}
    for transition in transitions:
        container = containers.get(transition.path)
        if container is None:
            raise MachineFileError(
                f"Transition {transition.sequence}: no container '{transition.path}'"
            )
        _check_transition(container, transition)
        path, kind = transition.path, transition.kind
        # At an interrupt all that is in the container makes way.
        left = path if kind == 'interrupt' else f'{path}/{transition.from_state}'
        gone = {each for each in active if each.startswith(f'{left}/') or each == left != path}
        active = active - gone
        place = f'{path}/{transition.to_state}'
        before = aside[path].pop() if kind == 'resume' and aside[path] else set()
        if kind == 'interrupt':
            aside[path].append(gone)
        elif kind == 'exit' or (transition.from_state in container.interrupts and kind != 'resume'):
            aside[path].clear()
        if not transition.to_state or place in before:
            active |= before
        elif kind not in ('exit', 'ended'):
            active.add(place)
            if place in containers:
                active |= set(_entered(containers[place]))
        yield Step(transition, tuple(sorted(active)))


def _entered(container: Structure) -> list[str]:
    paths = []
    for label in container.initial:
        paths.append(f'{container.path}/{label}')
        if label in container.inner:
            paths += _entered(container.inner[label])
    return paths


def _check_transition(container: Structure, transition: Transition) -> None:
    what = f'Transition {transition.sequence} in {container.path!r}'
    states, kind = container.members, transition.kind
    left, outcome, target = transition.from_state, transition.outcome, transition.to_state
    if left not in states and not (kind == 'interrupt' and left == ''):
        raise MachineFileError(f'{what}: no state {left!r}')
    if kind in ('interrupt', 'resume'):
        if target not in states and not (container.together and target == ''):
            raise MachineFileError(f'{what}: no state {target!r}')
    elif kind == 'ended':
        if outcome not in states[left].get_registered_outcomes():
            raise MachineFileError(f'{what}: {left!r} has no outcome {outcome!r}')
    elif kind == 'exit' and target in container.outcomes:
        # By more than edges: an iterator that was preempted, or an interrupt's state that ended
        # where the container was about to end.
        return
    elif Edge(left, outcome, target, kind == 'exit') not in container.edges:
        raise MachineFileError(f'{what}: {left!r} does not lead to {target!r} by {outcome!r}')


# Checkpoints.


def capture(machine: Container, leave_out: Iterable[str] = ()) -> dict[str, Any]:
    """Describe where a machine is; from any thread, while it runs or between runs.

    Userdata and progress may hold None, truth values, numbers, strings, bytes, and lists, tuples,
    sets and dictionaries of these; all come back exactly as they were, but an object that is held
    twice comes back as two.

    Args:
        machine: The root.
        leave_out: Userdata keys that are not kept.

    Returns:
        A dictionary that JSON can hold.

    Raises:
        MachineFileError: A value cannot be kept; the message names its key.
    """
    with machine.control.condition:
        return {
            'format': CHECKPOINT_FORMAT,
            'version': CHECKPOINT_VERSION,
            'root': machine.get_name(),
            'machine': _capture(machine, machine.get_name(), frozenset(leave_out)),
        }


def _capture(state: State, path: str, leave_out: frozenset[str]) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    progress = dict(state.fsm_progress or {})
    waiting = state.fsm_waiting
    if waiting is not None:
        progress[waiting[0]] = elapsed_of(state.fsm_clock)() - waiting[1]
    if progress:
        entry['progress'] = _kept(progress, path, 'progress', frozenset())
    if not isinstance(state, Container):
        return entry
    userdata = _kept(dict(raw(state.userdata)), path, 'userdata', leave_out)
    if userdata:
        entry['userdata'] = userdata
    frame = state.fsm_frame
    history = state.fsm_history if frame is None else frame.where()
    if history is not None:
        entry['at'] = {name: getattr(history, name) for name in _PLACE}
    if state.fsm_raised:
        entry['raised'] = [branch.label for branch in state.fsm_raised]
    inside = {
        label: _capture(child, f'{path}/{label}', leave_out)
        for label, child in state.fsm_children().items()
    }
    inside = {label: child for label, child in inside.items() if child}
    if inside:
        entry['states'] = inside
    return entry


_PLACE = {
    'current': str,
    'leaving': bool,
    'saved': list,
    'index': int,
    'repeat': bool,
    'outcomes': dict,
}
"""What is kept of a `History`."""

_TAG = '!'
"""The key that tells a value JSON has no form for from a dictionary of the user's."""


def _kept(
    values: dict[str, Any], path: str, what: str, leave_out: frozenset[str]
) -> dict[str, Any]:
    kept = {}
    for key, value in values.items():
        if key in leave_out:
            continue
        try:
            kept[key] = _encoded(value)
        except ValueError as error:
            raise MachineFileError(
                f"{what} key '{key}' of '{path}' cannot be kept: {error}"
            ) from None
        except RecursionError:
            raise MachineFileError(
                f"{what} key '{key}' of '{path}' cannot be kept: it is nested too deep, or holds "
                'itself'
            ) from None
    return kept


def _encoded(value: Any) -> Any:
    """Return what JSON holds of a value, so that `_decoded` gives it back exactly."""
    kind = type(value)
    if value is None or kind in (bool, int, str):
        return value
    if kind is float:
        return value if math.isfinite(value) else {_TAG: 'float', 'is': repr(value)}
    if kind is list:
        return [_encoded(item) for item in value]
    if kind is dict:
        if all(type(key) is str for key in value) and _TAG not in value:
            return {key: _encoded(item) for key, item in value.items()}
        pairs = [[_encoded(key), _encoded(item)] for key, item in value.items()]
        return {_TAG: 'dict', 'is': pairs}
    if kind in (bytes, bytearray):
        return {_TAG: kind.__name__, 'is': base64.b64encode(value).decode('ascii')}
    if kind in (tuple, set, frozenset):
        return {_TAG: kind.__name__, 'is': [_encoded(item) for item in value]}
    if kind is complex:
        return {_TAG: 'complex', 'is': [_encoded(value.real), _encoded(value.imag)]}
    raise ValueError(
        f'{shown(value)[:80]} of type {kind.__module__}.{kind.__qualname__}; plain values can be '
        'kept, or the key left out'
    )


_DECODERS: dict[str, Callable[[Any], Any]] = {
    'float': float,
    'bytes': lambda text: base64.b64decode(text, validate=True),
    'bytearray': lambda text: bytearray(base64.b64decode(text, validate=True)),
    'tuple': lambda items: tuple(_decoded(item) for item in items),
    'set': lambda items: {_decoded(item) for item in items},
    'frozenset': lambda items: frozenset(_decoded(item) for item in items),
    'dict': lambda pairs: {_decoded(key): _decoded(item) for key, item in pairs},
    'complex': lambda parts: complex(*(_decoded(part) for part in parts)),
}


def _decoded(value: Any) -> Any:
    if isinstance(value, list):
        return [_decoded(item) for item in value]
    if not isinstance(value, dict):
        return value
    if _TAG not in value:
        return {key: _decoded(item) for key, item in value.items()}
    return _DECODERS[value[_TAG]](value['is'])


def restore(machine: Container, checkpoint: dict[str, Any]) -> None:
    """Have the machine's next execution go on where a checkpoint was taken.

    Args:
        machine: A machine built like the one the checkpoint is of, not running.
        checkpoint: What `capture` gave.

    Raises:
        MachineFileError: It is not a checkpoint, or not of this machine; nothing is changed then.
    """
    path = machine.get_name()
    if machine.is_running():
        raise MachineFileError(f"'{path}' is running: it cannot take a checkpoint over")
    if (
        not isinstance(checkpoint, dict)
        or checkpoint.get('format') != CHECKPOINT_FORMAT
        or checkpoint.get('version') != CHECKPOINT_VERSION
    ):
        raise MachineFileError(f'not a {CHECKPOINT_FORMAT} of version {CHECKPOINT_VERSION}')
    todo: list[Callable[[], None]] = []
    try:
        _plan(machine, path, checkpoint.get('machine'), todo)
    except RecursionError:
        raise MachineFileError('damaged: nested too deep') from None
    for step in todo:
        step()


def _expect(holds: bool, path: str, what: str, value: object) -> None:
    if not holds:
        raise MachineFileError(f"damaged at '{path}': expected {what}, not {shown(value)[:80]}")


def _plan(state: State, path: str, entry: Any, todo: list[Callable[[], None]]) -> None:
    """Check what a checkpoint says of a state, and add what is to be done to `todo`."""
    _expect(isinstance(entry, dict), path, 'an object', entry)
    progress = _read_values(path, 'progress', entry.get('progress', {}))
    todo.append(lambda: setattr(state, 'fsm_progress', progress or None))
    if not isinstance(state, Container):
        for key in ('at', 'states', 'raised', 'userdata'):
            if key in entry:
                raise MachineFileError(
                    f"'{path}' is not a container, but the checkpoint has '{key}'"
                )
        return
    userdata = _read_values(path, 'userdata', entry.get('userdata', {}))
    children = state.fsm_children()
    at = entry.get('at')
    history = None if at is None else _read_place(state, path, at)
    raised = entry.get('raised', [])
    _expect(isinstance(raised, list), path, 'a list of interrupts', raised)
    for label in raised:
        if not isinstance(label, str) or label not in state.fsm_branches:
            raise MachineFileError(f"'{path}' has no interrupt {shown(label)}")
    branches = tuple(state.fsm_branches[label] for label in raised)

    def resume() -> None:
        raw(state.userdata).update(userdata)
        state.fsm_history, state.fsm_raised = history, branches

    todo.append(resume)
    states = entry.get('states', {})
    _expect(isinstance(states, dict), path, 'an object of states', states)
    for label, inside in states.items():
        if label not in children:
            raise MachineFileError(
                f"'{path}' has no state '{label}': its states are {sorted(children)}"
            )
        _plan(children[label], f'{path}/{label}', inside, todo)


def _read_values(path: str, what: str, values: Any) -> dict[str, Any]:
    _expect(isinstance(values, dict), path, f'{what} as an object', values)
    read = {}
    for key, value in values.items():
        try:
            read[key] = _decoded(value)
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise MachineFileError(
                f"damaged at '{path}': {what} key '{key}': {describe(error)}"
            ) from None
    return read


def _read_place(state: Container, path: str, at: Any) -> History:
    """Return where a container goes on.

    Raises:
        MachineFileError: It is none of its states.
    """
    _expect(isinstance(at, dict), path, 'a place as an object', at)
    history = History(**{name: value for name, value in at.items() if name in _PLACE})
    for name, kind in _PLACE.items():
        value = getattr(history, name)
        _expect(type(value) is kind, path, f"'{name}' of type {kind.__name__}", value)
    _expect(history.index >= 0, path, 'a number of items', history.index)
    for place in history.saved:
        pair = isinstance(place, list | tuple) and [type(part) for part in place]
        _expect(pair == [str, bool], path, 'a place', place)
    labels = {'', *state.fsm_branches} if state.together else set(state.fsm_children())
    for label, leaving in ((history.current, history.leaving), *history.saved):
        if not (leaving or label in labels):
            raise MachineFileError(
                f"'{path}' has no state '{label}' to resume in: its states are {sorted(labels)}"
            )
    for label, outcome in history.outcomes.items():
        if label not in state.fsm_states:
            raise MachineFileError(f"'{path}' has no state '{label}'")
        _expect(isinstance(outcome, str), f'{path}/{label}', 'an outcome', outcome)
    return history


def save(machine: Container, path: str | Path, leave_out: Iterable[str] = ()) -> None:
    """Write a checkpoint; a reader finds the old one or the new one, never half of one.

    When it returns, the checkpoint is on the disk, and outlives a failure of power. A link to the
    file stays.

    Raises:
        MachineFileError: A value cannot be kept, see `capture`.
        OSError: The file cannot be written.
    """
    text = json.dumps(capture(machine, leave_out), ensure_ascii=False, allow_nan=False)
    # A lone surrogate is a string of Python, though none of UTF-8.
    replace_file(path, text.encode('utf-8', 'surrogatepass'), durable=True)


def load(machine: Container, path: str | Path) -> None:
    """Restore a machine from a file that `save` wrote.

    Raises:
        MachineFileError: The file cannot be read, or does not fit the machine.
    """
    try:
        text = read_file(path, LARGEST_CHECKPOINT).decode('utf-8', 'surrogatepass')
        restore(machine, parse_json(text))
    except (OSError, ValueError, MachineFileError) as error:
        raise MachineFileError(f'{path}: {getattr(error, "strerror", describe(error))}') from error


class Checkpointer:
    """Saves a machine's checkpoint at its start and after every transition.

    What cannot be kept is an error in the log, with its key, each time; the file then stays as it
    was.

    Args:
        machine: The root.
        path: The file.
        leave_out: Userdata keys that are not kept.
    """

    def __init__(self, machine: Container, path: str | Path, leave_out: Iterable[str] = ()) -> None:
        self._machine = machine
        self._path = Path(path)
        self._leave_out = frozenset(leave_out)
        # A concurrence's children change places in threads of their own: the last word is kept.
        self._turn = threading.Lock()
        for inner in Structure(machine).walk():
            inner.container.register_start_cb(self._changed)
            inner.container.register_transition_cb(self._changed)
        machine.register_termination_cb(self._ended)

    def _changed(self, *_: Any) -> None:
        try:
            with self._turn:
                save(self._machine, self._path, self._leave_out)
        except OSError as error:
            logwarn(f'Checkpoint {self._path} cannot be written: {error.strerror}')
        except MachineFileError as error:
            logerr(f'Checkpoint {self._path} cannot be written: {error}')

    def _ended(self, *_: Any) -> None:
        self._path.unlink(missing_ok=True)
