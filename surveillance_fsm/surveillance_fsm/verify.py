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
import heapq
import inspect
import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from surveillance_fsm.concurrence import Concurrence
from surveillance_fsm.container import Container
from surveillance_fsm.exceptions import InvalidStateError, InvalidTransitionError
from surveillance_fsm.execution import RESUME
from surveillance_fsm.state import CBState, State
from surveillance_fsm.state_machine import Iterator as IteratorContainer
from surveillance_fsm.structure import Edge, Structure, structure_of


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
    root = _look_at(structure_of(machine))
    findings: list[Finding] = []
    for view in root.walk():
        findings += _unbound(view.structure)
        findings += _unreachable(view)
        findings += _no_exit(view)
        findings += _unproduced(view)
        findings += _wrong_remappings(view.structure)
        findings += _two_writers(view)
        findings += _deaf(view.structure)
    keys = frozenset(userdata_keys)
    findings += _unset_reads(root, keys, keys)
    return sorted(findings, key=lambda finding: finding.severity != 'error')


# The machine as the checks need it.


@dataclass
class _View:
    """A container as the checks need it.

    Attributes:
        structure: The container.
        inner: The containers inside by label.
        edges: The transitions that can be taken, by the label of the state they leave.
        reached: Labels of the states that can be reached.
        endings: What the container can end with.
        numbers: The number of each userdata key, see `_Keys`.
        before: Keys that are written inside before each state, on all ways to it and on some.
        written: Keys that have been written inside when it ends, likewise.
    """

    structure: Structure
    inner: dict[str, _View]
    edges: dict[str, list[Edge]]
    reached: set[str] = field(default_factory=set)
    endings: set[str] = field(default_factory=set)
    numbers: dict[str, int] = field(default_factory=dict)
    before: dict[str, _Keys] = field(default_factory=dict)
    written: _Keys = field(default_factory=lambda: _Keys())

    def walk(self) -> Iterator[_View]:
        """Return this container and all inside, outermost first."""
        yield self
        for inner in self.inner.values():
            yield from inner.walk()


def _look_at(structure: Structure) -> _View:
    inner = {label: _look_at(each) for label, each in structure.inner.items()}
    edges: dict[str, list[Edge]] = {label: [] for label in structure.members}
    for edge in structure.edges:
        within = inner.get(edge.source)
        # Interrupts and unknown labels are held against the states by other checks.
        if edge.source in edges and (within is None or edge.outcome in within.endings):
            edges[edge.source].append(edge)
    view = _View(structure, inner, edges)
    view.reached = _reachable(view)
    view.endings = _endings(view)
    _follow_keys(view)
    return view


def _reachable(view: _View) -> set[str]:
    structure = view.structure
    if structure.together:
        return set(structure.members)
    reached: set[str] = set()
    # Interrupts come from outside, at any time.
    pending = [*structure.initial, *structure.interrupts]
    while pending:
        label = pending.pop()
        if label in reached or label not in structure.members:
            continue
        reached.add(label)
        pending += [
            edge.target for edge in view.edges[label] if not edge.leaving and edge.target != RESUME
        ]
    return reached


def _endings(view: _View) -> set[str]:
    """Return what a container can end with."""
    structure, container = view.structure, view.structure.container
    endings = {edge.target for label in view.reached for edge in view.edges[label] if edge.leaving}
    if isinstance(container, Concurrence):
        endings = container.policy.possible_outcomes()
    if isinstance(container, Concurrence | IteratorContainer):
        # Both end with it when they are preempted.
        endings |= {'preempted'} & set(structure.outcomes)
    return endings


# The checks.


def _unbound(structure: Structure) -> list[Finding]:
    try:
        structure.container.check_consistency()
    except (InvalidTransitionError, InvalidStateError) as error:
        return [Finding('error', 'unbound', structure.path, str(error))]
    outcomes = set(structure.outcomes)
    return [
        Finding(
            'error',
            'unbound',
            f'{structure.path}/{edge.source}',
            f"outcome '{edge.outcome}' leads to '{edge.target}', which is not an outcome of the "
            f'container',
        )
        for edge in structure.edges
        if edge.leaving and edge.target not in outcomes
    ]


def _unreachable(view: _View) -> list[Finding]:
    structure = view.structure
    return [
        Finding(
            'error',
            'unreachable',
            f'{structure.path}/{label}',
            f"no transition leads here from '{', '.join(structure.initial)}'",
        )
        for label in structure.states
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
        return [
            Finding(
                'error',
                'no-exit',
                structure.path,
                f'no outcome can be reached: it would run for ever (its outcomes: '
                f'{", ".join(structure.outcomes) or "none"})',
            )
        ]
    return [
        Finding('error', 'no-exit', f'{structure.path}/{label}', 'no way out leads from here')
        for label in structure.states
        if label in view.reached and label not in leads_out
    ]


def _unproduced(view: _View) -> list[Finding]:
    structure = view.structure
    return [
        Finding(
            'warning',
            'unproduced',
            structure.path,
            f"nothing inside produces its outcome '{outcome}'",
        )
        for outcome in structure.outcomes
        if outcome not in view.endings and view.endings
    ]


def _wrong_remappings(structure: Structure) -> list[Finding]:
    container = structure.container
    findings = []
    for label, state in structure.members.items():
        declared = {*state.get_registered_input_keys(), *state.get_registered_output_keys()}
        renamed = _remapping(container, label)
        for key in renamed:
            if key not in declared:
                findings.append(
                    Finding(
                        'error',
                        'remapping',
                        f'{structure.path}/{label}',
                        f"its remapping names the key '{key}', which it does not declare: its keys "
                        f'are {sorted(declared)}',
                    )
                )
        for key in container.fsm_constants.get(label, ()):
            if key not in state.get_registered_input_keys():
                findings.append(
                    Finding(
                        'error',
                        'remapping',
                        f'{structure.path}/{label}',
                        f"its constant '{key}' is not among its input keys "
                        f'{sorted(state.get_registered_input_keys())}',
                    )
                )
    return findings


def _two_writers(view: _View) -> list[Finding]:
    structure = view.structure
    if not structure.together:
        return []
    writers: dict[str, list[str]] = {}
    for label, state in structure.states.items():
        renamed = _remapping(structure.container, label)
        for key in state.get_registered_output_keys():
            writers.setdefault(renamed.get(key, key), []).append(label)
    return [
        Finding(
            'warning',
            'two-writers',
            structure.path,
            f"userdata key '{key}' is written by {labels}, which run at the same time",
        )
        for key, labels in sorted(writers.items())
        if len(labels) > 1
    ]


def _remapping(container: Container, label: str) -> dict[str, str]:
    branch = container.fsm_branches.get(label)
    return dict(container.fsm_remappings.get(label, {}) if branch is None else branch.remapping)


# States that would not hear a preempt.

_HEEDS = {'preempt_requested', 'wait', 'interrupt', 'request_preempt', 'service_preempt'}
_BLOCKS = {'sleep', 'input', 'join', 'acquire', 'spin', 'spin_until_future_complete', 'result'}


def _deaf(structure: Structure) -> list[Finding]:
    """Return the states whose code waits or loops without ever looking at the preempt."""
    findings = []
    for label, state in structure.members.items():
        if isinstance(state, Container):
            continue
        code: Any = state.function if isinstance(state, CBState) else type(state)
        why = _cannot_be_preempted(code)
        if why is not None:
            findings.append(
                Finding(
                    'warning',
                    'deaf',
                    f'{structure.path}/{label}',
                    f'{why} without looking at preempt_requested: it cannot be preempted',
                )
            )
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
        return _Keys(self.always | added.always, self.sometimes | added.always | added.sometimes)


def _bits(view: _View, keys: Iterable[str]) -> int:
    numbers, bits = view.numbers, 0
    for key in keys:
        bits |= 1 << numbers.setdefault(key, len(numbers))
    return bits


def _follow_keys(view: _View) -> None:
    """Find which keys are written before each state of a container, and when it ends."""
    structure, container = view.structure, view.structure.container
    preset = _bits(view, container.userdata.keys())
    if isinstance(container, IteratorContainer):
        preset |= _bits(view, [container.items_label])
    entry = _Keys(preset, preset)
    adds = {label: _added(view, label) for label in structure.members}
    if structure.together:
        _follow_together(view, entry, adds)
        return
    before = _follow_loop(view, entry, adds)
    everywhere = entry.sometimes
    for label, keys in before.items():
        everywhere |= keys.plus(adds[label]).sometimes
    for label in structure.interrupts:
        # It may come at any time.
        before[label] = _Keys(entry.always, everywhere)
        everywhere |= adds[label].always | adds[label].sometimes
    end: _Keys | None = None
    for label, keys in before.items():
        if any(edge.leaving for edge in view.edges[label]):
            after = keys.plus(adds[label])
            end = after if end is None else end.joined(after)
    end = _Keys(entry.always, everywhere) if end is None else end
    for label in structure.interrupts:
        end = end.plus(_Keys(0, adds[label].always | adds[label].sometimes))
    view.before, view.written = before, end


def _follow_loop(view: _View, entry: _Keys, adds: dict[str, _Keys]) -> dict[str, _Keys]:
    """Return the keys before each state that can be reached, when one runs at a time."""
    order = _order(view)
    before: dict[str, _Keys] = {label: entry for label in view.structure.initial if label in order}
    pending = [(order[label], label) for label in before]
    heapq.heapify(pending)
    waiting = set(before)
    while pending:
        _, label = heapq.heappop(pending)
        waiting.discard(label)
        after = before[label].plus(adds[label])
        for edge in view.edges[label]:
            target = edge.target
            if edge.leaving or target not in order:
                continue
            known = before.get(target)
            joined = after if known is None else known.joined(after)
            if joined != known:
                before[target] = joined
                if target not in waiting:
                    waiting.add(target)
                    heapq.heappush(pending, (order[target], target))
    return before


def _follow_together(view: _View, entry: _Keys, adds: dict[str, _Keys]) -> None:
    """All states start with the same keys; what one writes, another may find."""
    end = entry
    for label in view.structure.states:
        end = end.plus(adds[label])
    start = _Keys(entry.always, end.sometimes)
    view.before = dict.fromkeys(view.structure.members, start)
    view.written = end


def _order(view: _View) -> dict[str, int]:
    """Reachable states, numbered so that a state comes after those that lead to it, but loops."""
    number: dict[str, int] = {}
    finished: list[str] = []
    for first in view.structure.initial:
        if first in number or first not in view.edges:
            continue
        number[first] = 0
        stack = [(first, iter(view.edges[first]))]
        while stack:
            label, edges = stack[-1]
            for edge in edges:
                target = edge.target
                if not edge.leaving and target in view.edges and target not in number:
                    number[target] = 0
                    stack.append((target, iter(view.edges[target])))
                    break
            else:
                stack.pop()
                finished.append(label)
    return {label: place for place, label in enumerate(reversed(finished))}


def _added(view: _View, label: str) -> _Keys:
    """Return what a state adds, in the container's names."""
    state = view.structure.members[label]
    renamed = _remapping(view.structure.container, label)
    outputs = state.get_registered_output_keys()
    inner = view.inner.get(label)
    if inner is None:
        return _Keys(_bits(view, (renamed.get(key, key) for key in outputs)))
    always = [key for key in outputs if inner.written.always & _bits(inner, [key])]
    sometimes = [key for key in outputs if inner.written.sometimes & _bits(inner, [key])]
    return _Keys(
        _bits(view, (renamed.get(key, key) for key in always)),
        _bits(view, (renamed.get(key, key) for key in sometimes)),
    )


def _unset_reads(view: _View, always: Iterable[str], sometimes: Iterable[str]) -> list[Finding]:
    """Return reads that find nothing, or may find nothing.

    Args:
        view: A container.
        always: Keys that it is always entered with, in its own names.
        sometimes: Keys that it is sometimes entered with.
    """
    container, findings = view.structure.container, []
    given = _Keys(_bits(view, always), _bits(view, sometimes))
    for label, local in view.before.items():
        before = local.plus(given)
        state = view.structure.members[label]
        renamed = _remapping(container, label)
        constants = container.fsm_constants.get(label, {})
        there: list[str] = []
        at_times: list[str] = []
        for key in sorted(state.get_registered_input_keys()):
            bit = _bits(view, [renamed.get(key, key)])
            if key in constants or before.always & bit:
                there.append(key)
            elif before.sometimes & bit:
                at_times.append(key)
            if label not in view.inner and key not in there:
                findings.append(_unset(view, label, key, key in at_times))
        if label in view.inner:
            findings += _unset_reads(view.inner[label], there, [*there, *at_times])
    return findings


def _unset(view: _View, label: str, key: str, on_some_ways: bool) -> Finding:
    when = 'on some ways to it nobody has' if on_some_ways else 'nobody has ever'
    return Finding(
        'warning' if on_some_ways else 'error',
        'unset-key',
        f'{view.structure.path}/{label}',
        f"reads userdata key '{key}', which {when} written",
    )
