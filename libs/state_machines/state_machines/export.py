"""A machine drawn: as Mermaid, Graphviz, and text for a log.

What is drawn of a container is an iterator over lines, among which the iterators of the containers
inside stand: so machines may be nested deeper than Python calls (`_lines`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from state_machines.container import Container
from state_machines.program import RESUME
from state_machines.structure import PossibleTransition, Structure

__all__ = ['to_ascii', 'to_graphviz', 'to_mermaid']

Drawn = Iterator[Any]
"""Lines, and iterators over what stands between them."""


def _lines(drawn: Drawn) -> Iterator[str]:
    """Yield all lines in order."""
    stack = [drawn]
    while stack:
        for each in stack[-1]:
            if not isinstance(each, str):
                stack.append(each)
                break
            yield each
        else:
            stack.pop()


def to_mermaid(container: Container) -> str:
    """Draw as a Mermaid ``stateDiagram-v2``; interrupts have dashed-looking notes of their own."""
    lines = ['stateDiagram-v2', *_lines(_mermaid(Structure(container), '    '))]
    return '\n'.join(lines) + '\n'


def _mermaid(structure: Structure, indent: str) -> Drawn:
    for label in structure.members:
        name = _id(f'{structure.path}/{label}')
        inner = structure.inner.get(label)
        if inner is None:
            yield f'{indent}state "{_spelled(label)}" as {name}'
        else:
            yield f'{indent}state "{_spelled(label)}" as {name} {{'
            yield _mermaid(inner, indent + '    ')
            yield f'{indent}}}'
    if structure.together:
        # Mermaid separates what runs side by side; only the ends of each state are known.
        for number, label in enumerate(structure.states):
            if number:
                yield f'{indent}--'
            name = _id(f'{structure.path}/{label}')
            yield f'{indent}[*] --> {name}'
            for outcome in sorted(structure.states[label].get_registered_outcomes()):
                yield f'{indent}{name} --> [*] : {outcome}'
        return
    for label in structure.initial:
        yield f'{indent}[*] --> {_id(f"{structure.path}/{label}")}'
    for source, target, leaving, outcomes in _bundles(structure.edges):
        name = _id(f'{structure.path}/{source}')
        text = ', '.join(outcomes)
        if target == RESUME and not leaving:
            yield f'{indent}{name} --> {name} : {text} (resume)'
        elif leaving:
            ending = text if outcomes == [target] else f'{text} → {target}'
            yield f'{indent}{name} --> [*] : {ending}'
        else:
            yield f'{indent}{name} --> {_id(f"{structure.path}/{target}")} : {text}'


def to_graphviz(container: Container) -> str:
    """Draw as a Graphviz digraph in which containers are clusters."""
    structure = Structure(container)
    lines = [
        f'digraph {_quoted(structure.path)} {{',
        '    compound=true; rankdir=TB; fontname="Helvetica";',
        '    node [shape=box, style=rounded, fontname="Helvetica"];',
        '    edge [fontname="Helvetica", fontsize=10];',
    ]
    lines += [*_lines(_graphviz(structure, '    ')), '}']
    return '\n'.join(lines) + '\n'


def _graphviz(structure: Structure, indent: str) -> Drawn:
    inside = indent + '    '
    yield f'{indent}subgraph {_quoted(f"cluster_{structure.path}")} {{'
    yield f'{inside}label={_quoted(f"{structure.label} ({structure.kind})")};'
    for outcome in structure.outcomes:
        name = _quoted(f'{structure.path}:{outcome}')
        look = 'shape=oval, style=filled, fillcolor=lightgrey'
        yield f'{inside}{name} [label={_quoted(outcome)}, {look}];'
    for label in structure.members:
        inner = structure.inner.get(label)
        if inner is not None:
            yield _graphviz(inner, inside)
            continue
        bold = ', penwidth=2' if label in structure.initial else ''
        dashed = ', style="rounded,dashed"' if label in structure.interrupts else ''
        name = _quoted(f'{structure.path}/{label}')
        yield f'{inside}{name} [label={_quoted(label)}{bold}{dashed}];'
    yield f'{indent}}}'
    for edge in structure.edges:
        if edge.target == RESUME and not edge.leaving:
            continue
        tail, tail_box = _entry(structure, edge.source)
        ltail = f', ltail={_quoted(tail_box)}' if tail_box else ''
        if edge.leaving:
            head, lhead = f'{structure.path}:{edge.target}', ''
        else:
            head, head_box = _entry(structure, edge.target)
            lhead = f', lhead={_quoted(head_box)}' if head_box else ''
        ends = f'{_quoted(tail)} -> {_quoted(head)}'
        yield f'{indent}{ends} [label={_quoted(edge.outcome)}{ltail}{lhead}];'


def _entry(structure: Structure, label: str) -> tuple[str, str]:
    """Return the node that stands for a state in Graphviz, and its cluster if it is a container."""
    path = f'{structure.path}/{label}'
    inner = structure.inner.get(label)
    cluster = '' if inner is None else f'cluster_{path}'
    while inner is not None:
        first = (inner.initial or sorted(inner.members) or [''])[0]
        if not first:
            break
        path = f'{inner.path}/{first}'
        inner = inner.inner.get(first)
    return path, cluster


def to_ascii(container: Container) -> str:
    """Draw as an indented list for a terminal or a log; ``>`` marks what runs now."""
    structure = Structure(container)
    marked = {
        f'{inner.path}/{label}'
        for inner in structure.walk()
        for label in inner.container.get_active_states()
    }
    lines = [f'{structure.path} ({structure.kind}) ends with {", ".join(structure.outcomes)}']
    lines += _lines(_ascii(structure, marked, ''))
    return '\n'.join(lines) + '\n'


def _ascii(structure: Structure, marked: set[str], indent: str) -> Drawn:
    labels = list(structure.members)
    for label in labels:
        path = f'{structure.path}/{label}'
        last = label == labels[-1]
        mark = '>' if path in marked else ('*' if label in structure.initial else ' ')
        inner = structure.inner.get(label)
        kind = f' ({inner.kind})' if inner is not None else ''
        flag = ' !' if label in structure.interrupts else ''
        edges = [edge for edge in structure.edges if edge.source == label]
        leads = '; '.join(
            f'{", ".join(outcomes)} -> {target if not leaving else f"[{target}]"}'
            for _, target, leaving, outcomes in _bundles(edges)
        )
        branch = '`-' if last else '|-'
        yield f'{indent}{branch}{mark} {label}{kind}{flag}{f"  {leads}" if leads else ""}'
        if inner is not None:
            yield _ascii(inner, marked, indent + ('     ' if last else '|    '))


def _bundles(edges: Iterable[PossibleTransition]) -> list[tuple[str, str, bool, list[str]]]:
    """Edges between the same two places as one: (source, target, leaving, outcomes)."""
    bundles: dict[tuple[str, str, bool], list[str]] = {}
    for edge in edges:
        bundles.setdefault((edge.source, edge.target, edge.leaving), []).append(edge.outcome)
    return [(*ends, sorted(outcomes)) for ends, outcomes in bundles.items()]


def _id(path: str) -> str:
    """Return an identifier that Mermaid accepts; different paths keep different ones."""
    return re.sub(r'[^A-Za-z0-9]', lambda match: f'_{ord(match.group()):x}_', path)


def _quoted(text: str) -> str:
    """Return a string as Graphviz has it."""
    escaped = text.replace('\\', '\\\\').replace('"', '\\"')
    return f'"{escaped}"'


def _spelled(text: str) -> str:
    """Text between double quotes in Mermaid, which has no escapes but entities."""
    return text.replace('"', '#quot;')
