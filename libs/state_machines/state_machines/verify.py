"""Checks of a machine before it runs.

`verify` looks at what can be known without executing a state: what is reachable, whether every
outcome leads somewhere and is produced by something, whether every container and every loop has a
way out, whether userdata keys are written before they are read, across containers and remappings,
whether two states of a concurrence write the same key, and which states would not hear a preempt.

Every check looks at each state and each transition once, so that the time it takes grows with the
size of the machine, however deep it is nested.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import Any

from state_machines.concurrence import Concurrence
from state_machines.container import Container
from state_machines.exceptions import InvalidStateError, InvalidTransitionError
from state_machines.state import CBState, State
from state_machines.state_machine import Iterator as IteratorContainer
from state_machines.structure import PossibleTransition, Structure


@dataclass(frozen=True)
class Finding:
    """Something wrong with a machine.

    Attributes:
        severity: ``error`` for what cannot work, ``warning`` for what may not.
        check: ``unbound``, ``unreachable``, ``no-exit``, ``unproduced``, ``remapping``,
            ``unset-key``, ``two-writers`` or ``deaf``.
        path: Of the state or container.
        message: What is wrong, in one line.
    """

    severity: str
    check: str
    path: str
    message: str

    def __str__(self) -> str:
        return f'{self.severity}: {self.path}: {self.message} [{self.check}]'


def verify(machine: Container, userdata_keys: Iterable[str] = ()) -> list[Finding]:
    """Check a machine and everything inside it.

    Args:
        machine: The root.
        userdata_keys: Keys of the root's userdata that will be set before it runs, beside those
            that are set already.

    Returns:
        What is wrong; errors first, outermost containers first.
    """
    views = _views(Structure(machine))
    findings: list[Finding] = []
    for view in views:
        for check in (
            _unbound,
            _unreachable,
            _no_exit,
            _unproduced,
            _wrong_remappings,
            _two_writers,
            _deaf,
        ):
            findings += check(view)
    keys = frozenset(userdata_keys)
    findings += _unset_reads(views[0], keys, keys)
    return sorted(findings, key=lambda finding: finding.severity != 'error')


# The machine as the checks need it.


class _View:
    """A container as the checks need it.

    Attributes:
        structure: The container.
        inner: The containers inside by label.
        edges: The transitions that can be taken, by the label of the state they leave.
        reached: Labels of the states that can be reached.
        endings: What the container can end with.
        before: Keys that are written inside before each state, on all ways to it and on some.
        written: Keys that have been written inside when it ends, likewise.
    """

    def __init__(self, structure: Structure, inner: dict[str, _View]) -> None:
        self.structure = structure
        self.inner = inner
        self.edges: dict[str, list[PossibleTransition]] = {label: [] for label in structure.members}
        for edge in structure.edges:
            within = self.inner.get(edge.source)
            # Interrupts and unknown labels are held against the states by other checks.
            if edge.source in self.edges and (within is None or edge.outcome in within.endings):
                self.edges[edge.source].append(edge)
        self.reached = _reachable(self)
        self.endings: set[str] = _endings(self)
        self._numbers: dict[str, int] = {}
        self.before: dict[str, _Keys] = {}
        self.written = _Keys()
        _follow_keys(self)

    def bits(self, keys: Iterable[str]) -> int:
        """Return userdata keys as a set of bits, see `_Keys`."""
        numbers, bits = self._numbers, 0
        for key in keys:
            bits |= 1 << numbers.setdefault(key, len(numbers))
        return bits

    def remapping(self, label: str) -> Mapping[str, str]:
        """Return the remapping of a state or an interrupt."""
        return self.structure.container.fsm_program.remappings.get(label, {})

    def error(self, check: str, message: str, label: str = '') -> Finding:
        """Return an error of the container, or of the state with a label."""
        return Finding('error', check, self._path(label), message)

    def warning(self, check: str, message: str, label: str = '') -> Finding:
        """Return a warning, likewise."""
        return Finding('warning', check, self._path(label), message)

    def _path(self, label: str) -> str:
        return f'{self.structure.path}/{label}' if label else self.structure.path


def _views(root: Structure) -> list[_View]:
    """Return the containers of a machine as the checks need them, outermost first."""
    structures = list(root.walk())
    views: dict[str, _View] = {}
    # What an inner container can end with, and writes, is known before the outer one is looked at.
    for structure in reversed(structures):
        inner = {label: views[each.path] for label, each in structure.inner.items()}
        views[structure.path] = _View(structure, inner)
    return [views[structure.path] for structure in structures]


def _reachable(view: _View) -> set[str]:
    structure = view.structure
    if structure.together:
        return set(structure.members)
    reached: set[str] = set()
    # Interrupts come from outside, at any time.
    pending = [*structure.initial, *structure.interrupts]
    while pending:
        label = pending.pop()
        if label not in reached and label in structure.members:
            reached.add(label)
            pending += [edge.target for edge in view.edges[label] if not edge.leaving]
    return reached


def _endings(view: _View) -> set[str]:
    """Return what a container can end with."""
    structure, container = view.structure, view.structure.container
    endings = {edge.target for label in view.reached for edge in view.edges[label] if edge.leaving}
    if isinstance(container, Concurrence):
        endings = container.fsm_possible_outcomes()
    if isinstance(container, Concurrence | IteratorContainer):
        # Both end with it when they are preempted.
        endings |= {'preempted'} & set(structure.outcomes)
    return endings


# The checks.


def _unbound(view: _View) -> list[Finding]:
    structure = view.structure
    try:
        structure.container.check_consistency()
    except (InvalidTransitionError, InvalidStateError) as error:
        return [view.error('unbound', str(error))]
    return [
        view.error(
            'unbound',
            f"outcome '{edge.outcome}' leads to '{edge.target}', which is not an outcome of the "
            'container',
            edge.source,
        )
        for edge in structure.edges
        if edge.leaving and edge.target not in structure.outcomes
    ]


def _unreachable(view: _View) -> list[Finding]:
    start = ', '.join(view.structure.initial)
    return [
        view.error('unreachable', f"no transition leads here from '{start}'", label)
        for label in view.structure.states
        if label not in view.reached
    ]


def _no_exit(view: _View) -> list[Finding]:
    structure = view.structure
    if structure.together or not structure.states:
        return []
    sources: dict[str, list[str]] = {}
    leads_out: set[str] = set()
    for label, edges in view.edges.items():
        for edge in edges:
            if edge.leaving:
                leads_out.add(label)
            else:
                sources.setdefault(edge.target, []).append(label)
    pending = list(leads_out)
    while pending:
        for source in sources.get(pending.pop(), ()):
            if source not in leads_out:
                leads_out.add(source)
                pending.append(source)
    if not view.reached & leads_out:
        outcomes = ', '.join(structure.outcomes) or 'none'
        message = f'no outcome can be reached: it would run for ever (its outcomes: {outcomes})'
        return [view.error('no-exit', message)]
    return [
        view.error('no-exit', 'no way out leads from here', label)
        for label in structure.states
        if label in view.reached and label not in leads_out
    ]


def _unproduced(view: _View) -> list[Finding]:
    return [
        view.warning('unproduced', f"nothing inside produces its outcome '{outcome}'")
        for outcome in view.structure.outcomes
        if outcome not in view.endings and view.endings
    ]


def _wrong_remappings(view: _View) -> list[Finding]:
    findings = []
    for label, state in view.structure.members.items():
        inputs = sorted(state.get_registered_input_keys())
        declared = sorted({*inputs, *state.get_registered_output_keys()})
        findings += [
            view.error(
                'remapping',
                f"its remapping names the key '{key}', which it does not declare: its keys are "
                f'{declared}',
                label,
            )
            for key in view.remapping(label)
            if key not in declared
        ]
        findings += [
            view.error(
                'remapping', f"its constant '{key}' is not among its input keys {inputs}", label
            )
            for key in view.structure.container.fsm_program.constants.get(label, ())
            if key not in inputs
        ]
    return findings


def _two_writers(view: _View) -> list[Finding]:
    if not view.structure.together:
        return []
    writers: dict[str, list[str]] = {}
    for label, state in view.structure.states.items():
        renamed = view.remapping(label)
        for key in state.get_registered_output_keys():
            writers.setdefault(renamed.get(key, key), []).append(label)
    return [
        view.warning(
            'two-writers',
            f"userdata key '{key}' is written by {labels}, which run at the same time",
        )
        for key, labels in sorted(writers.items())
        if len(labels) > 1
    ]


# States that would not hear a preempt.

_HEEDS = {'preempt_requested', 'wait', 'interrupt', 'request_preempt', 'service_preempt'}
_BLOCKS = {'sleep', 'input', 'join', 'acquire', 'spin', 'spin_until_future_complete', 'result'}


def _deaf(view: _View) -> list[Finding]:
    """Return the states whose code waits or loops without ever looking at the preempt."""
    findings = []
    for label, state in view.structure.members.items():
        if isinstance(state, Container):
            continue
        code: Any = state.function if isinstance(state, CBState) else type(state)
        why = _cannot_be_preempted(code)
        if why is not None:
            message = f'{why} without looking at preempt_requested: it cannot be preempted'
            findings.append(view.warning('deaf', message, label))
    return findings


@lru_cache(maxsize=4096)
def _cannot_be_preempted(code: Any) -> str | None:
    """Return what a state's class or function does that a preempt does not end; None for
    nothing.
    """
    own = [code]
    if isinstance(code, type):
        own = [kind for kind in code.__mro__ if kind not in State.__mro__]
    waits: str | None = None
    for source in own:
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(source)))
        except (OSError, TypeError, SyntaxError):
            return None
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr in _HEEDS and _is_own(node):
                return None
            if isinstance(node, ast.FunctionDef) and node.name == 'request_preempt':
                return None
            if isinstance(node, ast.While):
                waits = waits or 'loops'
            if isinstance(node, ast.Call):
                name = getattr(node.func, 'attr', getattr(node.func, 'id', ''))
                if name in _BLOCKS:
                    waits = waits or f"calls '{name}'"
    return waits


def _is_own(node: ast.Attribute) -> bool:
    return isinstance(node.value, ast.Name) and node.value.id == 'self'


# Userdata keys that are read before anybody has written them.
#
# States only ever add keys, so what a container adds does not depend on what it was entered with:
# each is followed once from nothing (`_follow_keys`), and what its parent has is added when its
# reads are looked at (`_unset_reads`).


@dataclass(frozen=True)
class _Keys:
    """Keys written on all ways to a place, and on some: a bit each, numbered by the container."""

    always: int = 0
    sometimes: int = 0

    def joined(self, other: _Keys) -> _Keys:
        return _Keys(self.always & other.always, self.sometimes | other.sometimes)

    def plus(self, added: _Keys) -> _Keys:
        """After something that always adds `added.always`, and sometimes `added.sometimes`."""
        return _Keys(self.always | added.always, self.sometimes | added.sometimes)


def _follow_keys(view: _View) -> None:
    """Find which keys are written before each state of a container, and when it ends."""
    structure, container = view.structure, view.structure.container
    preset = view.bits(container.userdata.keys())
    if isinstance(container, IteratorContainer):
        preset |= view.bits([container.items_label])
    entry = _Keys(preset, preset)
    adds = {label: _added(view, label) for label in structure.members}
    if structure.together:
        # All states start with the same keys; what one writes, another may find.
        view.written = reduce(_Keys.plus, (adds[label] for label in structure.states), entry)
        view.before = dict.fromkeys(structure.members, _Keys(entry.always, view.written.sometimes))
        return
    before = _follow_transitions(view, entry, adds)
    everywhere = entry.sometimes
    for label, keys in before.items():
        everywhere |= keys.plus(adds[label]).sometimes
    for label in structure.interrupts:
        # It may come at any time.
        before[label] = _Keys(entry.always, everywhere)
        everywhere |= adds[label].sometimes
    ends = [
        keys.plus(adds[label])
        for label, keys in before.items()
        if any(edge.leaving for edge in view.edges[label])
    ]
    end = reduce(_Keys.joined, ends) if ends else _Keys(entry.always, everywhere)
    for label in structure.interrupts:
        end = end.plus(_Keys(0, adds[label].sometimes))
    view.before, view.written = before, end


def _follow_transitions(view: _View, entry: _Keys, adds: dict[str, _Keys]) -> dict[str, _Keys]:
    """Return the keys before each state that can be reached, when one runs at a time."""
    order = _order(view)
    before = {label: entry for label in view.structure.initial if label in order}
    changed = True
    while changed:
        # Twice, and once more for each loop inside a loop.
        changed = False
        for label in order:
            after = before[label].plus(adds[label])
            for edge in view.edges[label]:
                if edge.leaving or edge.target not in view.edges:
                    continue
                known = before.get(edge.target)
                joined = after if known is None else known.joined(after)
                if joined != known:
                    before[edge.target] = joined
                    changed = True
    return before


def _order(view: _View) -> list[str]:
    """Return the reachable states, each after those that lead to it, but for loops."""
    seen: set[str] = set()
    finished: list[str] = []
    for first in view.structure.initial:
        if first in seen or first not in view.edges:
            continue
        seen.add(first)
        stack = [(first, iter(view.edges[first]))]
        while stack:
            label, edges = stack[-1]
            for edge in edges:
                target = edge.target
                if not edge.leaving and target in view.edges and target not in seen:
                    seen.add(target)
                    stack.append((target, iter(view.edges[target])))
                    break
            else:
                stack.pop()
                finished.append(label)
    return finished[::-1]


def _added(view: _View, label: str) -> _Keys:
    """Return what a state adds, in the container's names."""
    renamed, inner = view.remapping(label), view.inner.get(label)
    always = sometimes = 0
    for key in view.structure.members[label].get_registered_output_keys():
        bit = view.bits([renamed.get(key, key)])
        if inner is None or inner.written.always & inner.bits([key]):
            always |= bit
        if inner is None or inner.written.sometimes & inner.bits([key]):
            sometimes |= bit
    return _Keys(always, sometimes)


def _unset_reads(root: _View, always: Iterable[str], sometimes: Iterable[str]) -> list[Finding]:
    """Return reads that find nothing, or may find nothing.

    Args:
        root: The root.
        always: Keys that it is always entered with, in its own names.
        sometimes: Keys that it is sometimes entered with.
    """
    findings: list[Finding] = []
    pending: list[tuple[_View, Iterable[str], Iterable[str]]] = [(root, always, sometimes)]
    while pending:
        view, always, sometimes = pending.pop()
        given = _Keys(view.bits(always), view.bits(sometimes))
        inside: list[tuple[_View, Iterable[str], Iterable[str]]] = []
        for label, local in view.before.items():
            there, at_times, missing = _reads(view, label, local.plus(given))
            if label in view.inner:
                inside.append((view.inner[label], there, [*there, *at_times]))
                continue
            for key in sorted([*at_times, *missing]):
                message = f"reads userdata key '{key}', which %s written"
                if key in at_times:
                    message %= 'on some ways to it nobody has'
                    findings.append(view.warning('unset-key', message, label))
                else:
                    message %= 'nobody has ever'
                    findings.append(view.error('unset-key', message, label))
        pending += reversed(inside)
    return findings


def _reads(view: _View, label: str, before: _Keys) -> tuple[list[str], list[str], list[str]]:
    """Return the keys that a state reads: those always written before, at times, and never."""
    renamed = view.remapping(label)
    constants = view.structure.container.fsm_program.constants.get(label, {})
    there: list[str] = []
    at_times: list[str] = []
    missing: list[str] = []
    for key in sorted(view.structure.members[label].get_registered_input_keys()):
        bit = view.bits([renamed.get(key, key)])
        if key in constants or before.always & bit:
            there.append(key)
        elif before.sometimes & bit:
            at_times.append(key)
        else:
            missing.append(key)
    return there, at_times, missing
