"""Which userdata keys are read before anybody has written them.

A forward analysis over each container: at every state it knows the keys that have been written on
all ways there and those that have been written on some. Containers are entered with what their
parent has, under the keys their states use, and give back what they wrote on the way out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from surveillance_fsm.active import ActiveContainer
from surveillance_fsm.container import Container
from surveillance_fsm.iterator import Iterator as IteratorContainer
from surveillance_fsm.structure import Structure


@dataclass(frozen=True)
class UnsetRead:
    """A read of a key that may not be there.

    Attributes:
        path: Of the state that reads.
        key: The state's own name of it.
        on_some_ways: On other ways to the state it has been written.
    """

    path: str
    key: str
    on_some_ways: bool


@dataclass(frozen=True)
class _Keys:
    """Keys written on all ways to a place, and on some."""

    always: frozenset[str]
    sometimes: frozenset[str]

    def joined(self, other: _Keys) -> _Keys:
        return _Keys(self.always & other.always, self.sometimes | other.sometimes)

    def plus(self, always: Iterable[str], sometimes: Iterable[str] = ()) -> _Keys:
        always = frozenset(always)
        return _Keys(self.always | always, self.sometimes | always | frozenset(sometimes))


def unset_reads(root: Structure, userdata_keys: Iterable[str]) -> list[UnsetRead]:
    """Find the reads of a machine that find nothing, or may find nothing.

    Args:
        root: The machine.
        userdata_keys: Keys that the root's userdata has before it runs.
    """
    found: dict[tuple[str, str], bool] = {}
    given = frozenset(userdata_keys)
    _container(root, _Keys(given, given), found)
    return [UnsetRead(path, key, some) for (path, key), some in found.items()]


def _container(structure: Structure, given: _Keys, found: dict[tuple[str, str], bool]) -> _Keys:
    """Analyse one container entered with `given`, in its own names; what it has at its exits."""
    container = structure.container
    preset = frozenset(container.userdata.keys())
    entry = given.plus(preset)
    if isinstance(container, IteratorContainer):
        entry = entry.plus([container._items_label])
    if structure.together:
        return _together(structure, entry, found)
    before: dict[str, _Keys] = dict.fromkeys(structure.initial, entry)
    exits: list[_Keys] = []
    pending = list(structure.initial)
    while pending:
        label = pending.pop()
        after = _state(structure, label, before[label], {})
        for edge in structure.edges:
            if edge.source != label or edge.leaving:
                continue
            known = before.get(edge.target)
            joined = after if known is None else known.joined(after)
            if joined != known:
                before[edge.target] = joined
                pending.append(edge.target)
    everywhere = entry
    for label, keys in before.items():
        after = _state(structure, label, keys, found)
        everywhere = everywhere.plus((), after.sometimes)
        if any(edge.source == label and edge.leaving for edge in structure.edges):
            exits.append(after)
    for label in structure.interrupts:
        # It may come at any time.
        after = _state(structure, label, _Keys(entry.always, everywhere.sometimes), found)
        if any(edge.source == label and edge.leaving for edge in structure.edges):
            exits.append(after)
        exits = [keys.plus((), after.sometimes) for keys in exits]
    if not exits:
        return everywhere
    end = exits[0]
    for keys in exits[1:]:
        end = end.joined(keys)
    return end


def _together(structure: Structure, entry: _Keys, found: dict[tuple[str, str], bool]) -> _Keys:
    """All states start with the same keys; what one writes, another may find."""
    ends = [_state(structure, label, entry, {}) for label in structure.states]
    written = frozenset().union(*(end.sometimes for end in ends)) if ends else frozenset()
    for label in structure.all_states():
        _state(structure, label, entry.plus((), written), found)
    always = frozenset().union(*(end.always for end in ends)) if ends else frozenset()
    return entry.plus(always, written)


def _state(
    structure: Structure, label: str, keys: _Keys, found: dict[tuple[str, str], bool]
) -> _Keys:
    """What there is after a state, in the container's names; its unset reads go to `found`."""
    container = structure.container
    state = structure.all_states()[label]
    remapping = getattr(container, '_remappings', {}).get(label, {})
    if isinstance(container, ActiveContainer) and label in container._branches:
        remapping = container._branches[label].remapping
    constants = getattr(container, '_constants', {}).get(label, {})
    outer = {
        key: remapping.get(key, key)
        for key in (*state.get_registered_input_keys(), *state.get_registered_output_keys())
    }
    inner = structure.inner.get(label)
    if inner is None or not isinstance(state, Container):
        for key in state.get_registered_input_keys():
            if key not in constants and outer[key] not in keys.always:
                found[(f'{structure.path}/{label}', key)] = outer[key] in keys.sometimes
        return keys.plus(outer[key] for key in state.get_registered_output_keys())
    inputs = state.get_registered_input_keys()
    given = _Keys(
        frozenset(key for key in inputs if key in constants or outer[key] in keys.always),
        frozenset(key for key in inputs if key in constants or outer[key] in keys.sometimes),
    )
    end = _container(inner, given, found)
    outputs = state.get_registered_output_keys()
    return keys.plus(
        (outer[key] for key in outputs if key in end.always),
        (outer[key] for key in outputs if key in end.sometimes),
    )
