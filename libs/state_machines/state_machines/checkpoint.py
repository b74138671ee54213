"""Where a machine is, kept for another process.

A checkpoint holds, for every container, the state it is in, the interrupts under way, its userdata
and how far its states have come (`State.progress`). A machine built in the same way takes it over
and goes on with the state that was active, executed anew, in another process if need be.
"""

from __future__ import annotations

import base64
import json
import math
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from state_machines.clock import elapsed_of
from state_machines.container import Container
from state_machines.exceptions import CheckpointError, describe, shown
from state_machines.log import logerr, logwarn
from state_machines.program import History
from state_machines.state import State
from state_machines.structure import Structure
from state_machines.userdata import raw
from strict_files.regular_files import parse_json, read_file, replace_file

CHECKPOINT_FORMAT = 'surveillance-fsm-checkpoint'
CHECKPOINT_VERSION = 3
LARGEST_CHECKPOINT = 200_000_000
"""More bytes than this are not read."""


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
        CheckpointError: A value cannot be kept; the message names its key.
    """
    kept_out = frozenset(leave_out)
    with machine.control.condition:
        entries: list[dict[str, Any]] = []
        # A list, in which each state names the entry of its container by number: how deep machines
        # are nested is no matter of how deep JSON is.
        pending: list[tuple[State, str, str, int | None]] = [
            (machine, machine.get_name(), machine.get_name(), None)
        ]
        while pending:
            state, label, path, within = pending.pop()
            entry = _capture(state, path, kept_out)
            program = state.fsm_program
            if within is not None:
                entry = {'label': label, 'in': within, **entry}
            if entry.keys() - {'label', 'in'} or within is None or program is not None:
                entries.append(entry)
            if program is not None:
                number = len(entries) - 1
                children = reversed(program.children().items())
                pending += [(each, name, f'{path}/{name}', number) for name, each in children]
        return {
            'format': CHECKPOINT_FORMAT,
            'version': CHECKPOINT_VERSION,
            'root': machine.get_name(),
            'states': entries,
        }


def _capture(state: State, path: str, leave_out: frozenset[str]) -> dict[str, Any]:
    """Return what is to be kept of one state; empty if there is nothing."""
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
    program = state.fsm_program
    frame = program.frame
    history = program.history if frame is None else frame.where()
    if history is not None:
        entry['at'] = {name: getattr(history, name) for name in _PLACE}
    if program.raised:
        entry['raised'] = [branch.label for branch in program.raised]
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
            raise CheckpointError(
                f"{what} key '{key}' of '{path}' cannot be kept: {error}"
            ) from None
        except RecursionError:
            raise CheckpointError(
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
        CheckpointError: It is not a checkpoint, or not of this machine; nothing is changed then.
    """
    path = machine.get_name()
    if machine.is_running():
        raise CheckpointError(f"'{path}' is running: it cannot take a checkpoint over")
    if (
        not isinstance(checkpoint, dict)
        or checkpoint.get('format') != CHECKPOINT_FORMAT
        or checkpoint.get('version') != CHECKPOINT_VERSION
    ):
        raise CheckpointError(f'not a {CHECKPOINT_FORMAT} of version {CHECKPOINT_VERSION}')
    todo = _plan(machine, path, checkpoint.get('states'))
    machine.fsm_forget()
    for step in todo:
        step()


def _plan(machine: Container, root: str, entries: Any) -> list[Callable[[], None]]:
    """Check what a checkpoint says, and return what is to be done."""
    _expect(isinstance(entries, list) and bool(entries), root, 'a list of states', entries)
    todo: list[Callable[[], None]] = []
    # The states that the entries are of, and their paths.
    found: list[tuple[State, str]] = []
    for number, entry in enumerate(entries):
        _expect(isinstance(entry, dict), root, 'an object', entry)
        state, path = machine, root
        if number:
            within, label = entry.get('in'), entry.get('label')
            if type(within) is not int or not 0 <= within < number:
                raise CheckpointError(
                    f"damaged at '{root}': expected the number of a container, not {shown(within)}"
                )
            container, path = found[within]
            children = container.fsm_program.children() if container.fsm_program else {}
            if not isinstance(label, str) or label not in children:
                raise CheckpointError(
                    f"'{path}' has no state {shown(label)}: its states are {sorted(children)}"
                )
            state, path = children[label], f'{path}/{label}'
        found.append((state, path))
        _plan_state(state, path, entry, todo)
    return todo


def _expect(holds: bool, path: str, what: str, value: object) -> None:
    if not holds:
        raise CheckpointError(f"damaged at '{path}': expected {what}, not {shown(value)[:80]}")


def _plan_state(
    state: State, path: str, entry: dict[str, Any], todo: list[Callable[[], None]]
) -> None:
    """Check what a checkpoint says of a state, and add what is to be done to `todo`."""
    progress = _read_values(path, 'progress', entry.get('progress', {}))
    todo.append(lambda: setattr(state, 'fsm_progress', progress or None))
    if not isinstance(state, Container):
        for key in ('at', 'raised', 'userdata'):
            if key in entry:
                raise CheckpointError(
                    f"'{path}' is not a container, but the checkpoint has '{key}'"
                )
        return
    userdata = _read_values(path, 'userdata', entry.get('userdata', {}))
    program = state.fsm_program
    at = entry.get('at')
    history = None if at is None else _read_place(state, path, at)
    raised = entry.get('raised', [])
    _expect(isinstance(raised, list), path, 'a list of interrupts', raised)
    for label in raised:
        if not isinstance(label, str) or label not in program.branches:
            raise CheckpointError(f"'{path}' has no interrupt {shown(label)}")
    branches = tuple(program.branches[label] for label in raised)

    def resume() -> None:
        raw(state.userdata).update(userdata)
        program.history, program.raised = history, branches

    todo.append(resume)


def _read_values(path: str, what: str, values: Any) -> dict[str, Any]:
    _expect(isinstance(values, dict), path, f'{what} as an object', values)
    read = {}
    for key, value in values.items():
        try:
            read[key] = _decoded(value)
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            raise CheckpointError(
                f"damaged at '{path}': {what} key '{key}': {describe(error)}"
            ) from None
    return read


def _read_place(state: Container, path: str, at: Any) -> History:
    """Return where a container goes on.

    Raises:
        CheckpointError: It is none of its states.
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
    program = state.fsm_program
    labels = {'', *program.branches} if state.together else set(program.children())
    for label, leaving in ((history.current, history.leaving), *history.saved):
        if not (leaving or label in labels):
            raise CheckpointError(
                f"'{path}' has no state '{label}' to resume in: its states are {sorted(labels)}"
            )
    for label, outcome in history.outcomes.items():
        if label not in program.states:
            raise CheckpointError(f"'{path}' has no state '{label}'")
        _expect(isinstance(outcome, str), f'{path}/{label}', 'an outcome', outcome)
    return history


def save(machine: Container, path: str | Path, leave_out: Iterable[str] = ()) -> None:
    """Write a checkpoint; a reader finds the old one or the new one, never half of one.

    When it returns, the checkpoint is on the disk, and outlives a failure of power. A link to the
    file stays.

    Raises:
        CheckpointError: A value cannot be kept, see `capture`.
        OSError: The file cannot be written.
    """
    text = json.dumps(capture(machine, leave_out), ensure_ascii=False, allow_nan=False)
    # A lone surrogate is a string of Python, though none of UTF-8.
    replace_file(path, text.encode('utf-8', 'surrogatepass'), durable=True)


def load(machine: Container, path: str | Path) -> None:
    """Restore a machine from a file that `save` wrote.

    Raises:
        CheckpointError: The file cannot be read, or does not fit the machine.
    """
    try:
        text = read_file(path, LARGEST_CHECKPOINT).decode('utf-8', 'surrogatepass')
        restore(machine, parse_json(text))
    except (OSError, ValueError, CheckpointError) as error:
        raise CheckpointError(f'{path}: {getattr(error, "strerror", describe(error))}') from error


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
        except CheckpointError as error:
            logerr(f'Checkpoint {self._path} cannot be written: {error}')

    def _ended(self, *_: Any) -> None:
        self._path.unlink(missing_ok=True)
