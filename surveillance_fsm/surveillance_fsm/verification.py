"""Checks of a machine before it runs.

`verify` looks at what can be known without executing a state: what is reachable, whether every
outcome leads somewhere and every container has a way out, whether userdata keys are written before
they are read, across containers and remappings, and which states would not hear a preempt.
"""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from surveillance_fsm.container import Container
from surveillance_fsm.engine import RESUME
from surveillance_fsm.exceptions import InvalidStateError, InvalidTransitionError
from surveillance_fsm.interface import CBInterface
from surveillance_fsm.state import CBState, State
from surveillance_fsm.structure import Structure, structure_of
from surveillance_fsm.userdata_flow import unset_reads


@dataclass(frozen=True)
class Finding:
    """Something wrong with a machine.

    Attributes:
        severity: ``error`` for what cannot work, ``warning`` for what may not.
        check: ``unbound``, ``unreachable``, ``no-exit``, ``unset-key`` or ``deaf``.
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
    root = structure_of(machine)
    findings: list[Finding] = []
    for structure in root.walk():
        findings += _unbound(structure)
        findings += _unreachable(structure)
        findings += _no_exit(structure)
        findings += _deaf(structure)
    for read in unset_reads(root, userdata_keys):
        severity = 'warning' if read.on_some_ways else 'error'
        when = 'on some ways to it nobody has' if read.on_some_ways else 'nobody has ever'
        findings.append(
            Finding(
                severity,
                'unset-key',
                read.path,
                f"reads userdata key '{read.key}', which {when} written",
            )
        )
    return sorted(findings, key=lambda finding: finding.severity != 'error')


def _unbound(structure: Structure) -> list[Finding]:
    try:
        structure.container.check_consistency()
    except (InvalidTransitionError, InvalidStateError) as error:
        return [Finding('error', 'unbound', structure.path, str(error))]
    return [
        Finding(
            'error',
            'unbound',
            f'{structure.path}/{edge.source}',
            f"outcome '{edge.outcome}' leads to '{edge.target}', which is not an outcome of the "
            f'container',
        )
        for edge in structure.edges
        if edge.leaving and edge.target not in structure.outcomes
    ]


def _reachable(structure: Structure) -> set[str]:
    if structure.together:
        return set(structure.all_states())
    reached: set[str] = set()
    # Interrupts come from outside, at any time.
    pending = [*structure.initial, *structure.interrupts]
    while pending:
        label = pending.pop()
        if label in reached or label not in structure.all_states():
            continue
        reached.add(label)
        pending += [
            edge.target
            for edge in structure.edges
            if edge.source == label and not edge.leaving and edge.target != RESUME
        ]
    return reached


def _unreachable(structure: Structure) -> list[Finding]:
    reached = _reachable(structure)
    return [
        Finding(
            'error',
            'unreachable',
            f'{structure.path}/{label}',
            f"no transition leads here from '{', '.join(structure.initial)}'",
        )
        for label in structure.states
        if label not in reached
    ]


def _no_exit(structure: Structure) -> list[Finding]:
    if structure.together or not structure.states:
        return []
    leads_out = {edge.source for edge in structure.edges if edge.leaving}
    grown = True
    while grown:
        more = {
            edge.source
            for edge in structure.edges
            if not edge.leaving and edge.target in leads_out and edge.source not in leads_out
        }
        leads_out |= more
        grown = bool(more)
    reached = _reachable(structure)
    if not reached & leads_out:
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
        if label in reached and label not in leads_out
    ]


_HEEDS = {'preempt_requested', 'wait', 'interrupt', 'request_preempt', 'service_preempt'}
_BLOCKS = {'sleep', 'input', 'join', 'acquire', 'spin', 'spin_until_future_complete', 'result'}


def _deaf(structure: Structure) -> list[Finding]:
    """States whose code waits or loops without ever looking at the preempt."""
    findings = []
    for label, state in structure.all_states().items():
        if isinstance(state, Container):
            continue
        why = _cannot_be_preempted(state)
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


def _cannot_be_preempted(state: State) -> str | None:
    own: list[Any]
    if isinstance(state, CBState):
        callback: Any = state._cb
        own = [callback._cb if isinstance(callback, CBInterface) else callback]
    else:
        own = []
        for kind in type(state).__mro__:
            if kind is State:
                break
            own.append(kind)
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
