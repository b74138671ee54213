"""Checkpoints: where a machine is, as JSON, so that a killed process goes on there.

A checkpoint holds, for every container, the state it is in, the interrupts under way, its userdata
as far as JSON can hold it, and how far its states have come (`State.progress`). A machine built in
the same way takes it over and goes on with the state that was active, executed anew.
"""

from __future__ import annotations

import json
import os
import threading
from pathlib import Path
from typing import Any

from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.concurrence import Concurrence
from surveillance_fsm.container import Container
from surveillance_fsm.driven import DrivenContainer
from surveillance_fsm.engine import History
from surveillance_fsm.exceptions import SmachError
from surveillance_fsm.log import logwarn
from surveillance_fsm.record import shown
from surveillance_fsm.state import State

FORMAT = 'surveillance-fsm-checkpoint'
VERSION = 1


class CheckpointError(SmachError):
    """A checkpoint cannot be read, or does not fit the machine."""


def capture(machine: ActiveContainer) -> dict[str, Any]:
    """Describe where a machine is; from any thread, while it runs or between runs.

    Returns:
        A dictionary that JSON can hold.
    """
    with machine.control.condition:
        return {
            'format': FORMAT,
            'version': VERSION,
            'root': machine._fsm_path,
            'machine': _capture(machine),
        }


def _capture(state: State) -> dict[str, Any]:
    entry: dict[str, Any] = {}
    progress = dict(getattr(state, '_fsm_progress', None) or {})
    waiting = getattr(state, '_fsm_waiting', None)
    if waiting is not None:
        progress[waiting[0]] = state._fsm_clock.now() - waiting[1]
    if progress:
        entry['progress'] = progress
    if not isinstance(state, Container):
        return entry
    userdata = shown(state.userdata._data)
    if userdata:
        entry['userdata'] = userdata
    children = dict(state.get_children())
    if isinstance(state, ActiveContainer):
        history = _history(state)
        if history is not None:
            entry['at'] = {
                'current': history.current,
                'leaving': history.leaving,
                'saved': [list(saved) for saved in history.saved],
                'index': history.index,
                'outcomes': history.outcomes,
            }
        if state._fsm_raised:
            entry['raised'] = [branch.label for branch in state._fsm_raised]
        children |= {label: branch.state for label, branch in state._branches.items()}
    inside = {label: _capture(child) for label, child in children.items()}
    inside = {label: child for label, child in inside.items() if child}
    if inside:
        entry['states'] = inside
    return entry


def _history(container: ActiveContainer) -> History | None:
    frame = container._frame
    if frame is None:
        return container._fsm_history
    if isinstance(container, DrivenContainer):
        return frame.history(frame.current)
    if isinstance(container, Concurrence):
        return History(outcomes=container._children.ended())
    return None


def restore(machine: ActiveContainer, checkpoint: dict[str, Any]) -> None:
    """Have the machine's next execution go on where a checkpoint was taken.

    Args:
        machine: A machine built like the one the checkpoint is of, not running.
        checkpoint: What `capture` gave.

    Raises:
        CheckpointError: It is not a checkpoint, or not of this machine; nothing is changed then.
    """
    if machine.is_running():
        raise CheckpointError(f"'{machine._fsm_path}' is running: it cannot take a checkpoint over")
    if checkpoint.get('format') != FORMAT or checkpoint.get('version') != VERSION:
        raise CheckpointError(f'Not a {FORMAT} of version {VERSION}')
    entry: Any = checkpoint.get('machine')
    _check(machine, machine._fsm_path, entry)
    _restore(machine, entry)


def _check(state: State, path: str, entry: Any) -> None:
    if not isinstance(entry, dict):
        raise CheckpointError(f"Checkpoint of '{path}' must be an object, not {entry!r}")
    if not isinstance(state, Container):
        for key in ('at', 'states', 'raised'):
            if key in entry:
                raise CheckpointError(
                    f"'{path}' is not a container, but the checkpoint has '{key}'"
                )
        return
    children = dict(state.get_children())
    branches = state._branches if isinstance(state, ActiveContainer) else {}
    labels = {**children, **{label: branch.state for label, branch in branches.items()}}
    at = entry.get('at')
    if at is not None:
        places = [(at['current'], at['leaving']), *map(tuple, at['saved'])]
        for label, leaving in places:
            if isinstance(state, DrivenContainer) and not leaving and label not in labels:
                raise CheckpointError(
                    f"'{path}' has no state '{label}' to resume in: its states are {sorted(labels)}"
                )
        for label in at['outcomes']:
            if label not in children:
                raise CheckpointError(f"'{path}' has no state '{label}'")
    for label in entry.get('raised', ()):
        if label not in branches:
            raise CheckpointError(f"'{path}' has no interrupt '{label}'")
    for label, inside in entry.get('states', {}).items():
        if label not in labels:
            raise CheckpointError(
                f"'{path}' has no state '{label}': its states are {sorted(labels)}"
            )
        _check(labels[label], f'{path}/{label}', inside)


def _restore(state: State, entry: dict[str, Any]) -> None:
    state._fsm_progress = dict(entry['progress']) if 'progress' in entry else None
    if not isinstance(state, Container):
        return
    state.userdata._data.update(entry.get('userdata', {}))
    children = dict(state.get_children())
    if isinstance(state, ActiveContainer):
        at = entry.get('at')
        state._fsm_history = None
        if at is not None:
            state._fsm_history = History(
                at['current'],
                at['leaving'],
                [(label, leaving) for label, leaving in at['saved']],
                at['index'],
                dict(at['outcomes']),
            )
        state._fsm_raised = [state._branches[label] for label in entry.get('raised', ())]
        children |= {label: branch.state for label, branch in state._branches.items()}
    for label, child in children.items():
        if label in entry.get('states', {}):
            _restore(child, entry['states'][label])


def save(machine: ActiveContainer, path: str | Path) -> None:
    """Write a checkpoint; a reader finds the old one or the new one, never half of one."""
    target = Path(path)
    draft = target.with_name(f'.{target.name}.{os.getpid()}.{threading.get_ident()}')
    draft.write_text(json.dumps(capture(machine), ensure_ascii=False), encoding='utf-8')
    os.replace(draft, target)


def load(machine: ActiveContainer, path: str | Path) -> None:
    """Restore a machine from a file that `save` wrote.

    Raises:
        CheckpointError: The file cannot be read, or does not fit the machine.
    """
    try:
        checkpoint = json.loads(Path(path).read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise CheckpointError(f'{path}: {error}') from error
    if not isinstance(checkpoint, dict):
        raise CheckpointError(f'{path}: not a {FORMAT}')
    try:
        restore(machine, checkpoint)
    except CheckpointError as error:
        raise CheckpointError(f'{path}: {error}') from error
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(f'{path}: damaged: {error!r}') from error


class Checkpointer:
    """Saves a machine's checkpoint at its start and after every transition.

    Args:
        machine: The root.
        path: The file.
    """

    def __init__(self, machine: ActiveContainer, path: str | Path) -> None:
        self._machine = machine
        self._path = Path(path)
        # A concurrence's children change places in threads of their own: the last word is kept.
        self._turn = threading.Lock()
        for container in _containers(machine):
            container.register_start_cb(self._changed)
            container.register_transition_cb(self._changed)
        machine.register_termination_cb(self._ended)

    def _changed(self, *_: Any) -> None:
        try:
            with self._turn:
                save(self._machine, self._path)
        except OSError as error:
            logwarn(f'Checkpoint {self._path} cannot be written: {error.strerror}')

    def _ended(self, *_: Any) -> None:
        self._path.unlink(missing_ok=True)


def _containers(state: State) -> list[Container]:
    if not isinstance(state, Container):
        return []
    inside = list(state.get_children().values())
    if isinstance(state, ActiveContainer):
        inside += [branch.state for branch in state._branches.values()]
    return [state, *(found for child in inside for found in _containers(child))]
