"""A machine drawn: as Mermaid, Graphviz, and text for a log.

`to_yaml`, which writes it as a file that can be loaded, comes from `machine_file`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from state_machines.container import Container
from state_machines.machine_file import to_yaml
from state_machines.nodes import RESUME
from state_machines.structure import Edge, Structure

__all__ = ['to_ascii', 'to_graphviz', 'to_mermaid', 'to_yaml']


def to_mermaid(container: Container) -> str:
    """Draw as a Mermaid ``stateDiagram-v2``; interrupts have dashed-looking notes of their own."""
    structure = Structure(container)
    lines = ['stateDiagram-v2']
    _mermaid(structure, lines, '    ')
    return '\n'.join(lines) + '\n'


def _mermaid(structure: Structure, lines: list[str], indent: str) -> None:
    for label in structure.members:
        name = _id(f'{structure.path}/{label}')
        inner = structure.inner.get(label)
        if inner is None:
            lines.append(f'{indent}state "{_spelled(label)}" as {name}')
        else:
            lines.append(f'{indent}state "{_spelled(label)}" as {name} {{')
            _mermaid(inner, lines, indent + '    ')
            lines.append(f'{indent}}}')
    if structure.together:
        # Mermaid separates what runs side by side; only the ends of each state are known.
        for number, label in enumerate(structure.states):
            if number:
                lines.append(f'{indent}--')
            name = _id(f'{structure.path}/{label}')
            lines.append(f'{indent}[*] --> {name}')
            for outcome in sorted(structure.states[label].get_registered_outcomes()):
                lines.append(f'{indent}{name} --> [*] : {outcome}')
        return
    for label in structure.initial:
        lines.append(f'{indent}[*] --> {_id(f"{structure.path}/{label}")}')
    for source, target, leaving, outcomes in _bundles(structure.edges):
        name = _id(f'{structure.path}/{source}')
        text = ', '.join(outcomes)
        if target == RESUME and not leaving:
            lines.append(f'{indent}{name} --> {name} : {text} (resume)')
        elif leaving:
            ending = text if outcomes == [target] else f'{text} → {target}'
            lines.append(f'{indent}{name} --> [*] : {ending}')
        else:
            lines.append(f'{indent}{name} --> {_id(f"{structure.path}/{target}")} : {text}')


def to_graphviz(container: Container) -> str:
    """Draw as a Graphviz digraph in which containers are clusters."""
    structure = Structure(container)
    lines = [
        f'digraph {_quoted(structure.path)} {{',
        '    compound=true; rankdir=TB; fontname="Helvetica";',
        '    node [shape=box, style=rounded, fontname="Helvetica"];',
        '    edge [fontname="Helvetica", fontsize=10];',
    ]
    _graphviz(structure, lines, '    ')
    lines.append('}')
    return '\n'.join(lines) + '\n'


def _graphviz(structure: Structure, lines: list[str], indent: str) -> None:
    inside = indent + '    '
    lines.append(f'{indent}subgraph {_quoted(f"cluster_{structure.path}")} {{')
    lines.append(f'{inside}label={_quoted(f"{structure.label} ({structure.kind})")};')
    for outcome in structure.outcomes:
        name = _quoted(f'{structure.path}:{outcome}')
        look = 'shape=oval, style=filled, fillcolor=lightgrey'
        lines.append(f'{inside}{name} [label={_quoted(outcome)}, {look}];')
    for label in structure.members:
        inner = structure.inner.get(label)
        if inner is not None:
            _graphviz(inner, lines, inside)
            continue
        bold = ', penwidth=2' if label in structure.initial else ''
        dashed = ', style="rounded,dashed"' if label in structure.interrupts else ''
        name = _quoted(f'{structure.path}/{label}')
        lines.append(f'{inside}{name} [label={_quoted(label)}{bold}{dashed}];')
    lines.append(f'{indent}}}')
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
        lines.append(f'{indent}{ends} [label={_quoted(edge.outcome)}{ltail}{lhead}];')


def _entry(structure: Structure, label: str) -> tuple[str, str]:
    """Return the node that stands for a state in Graphviz, and its cluster if it is a container."""
    path = f'{structure.path}/{label}'
    inner = structure.inner.get(label)
    if inner is None:
        return path, ''
    first = (inner.initial or sorted(inner.members) or [''])[0]
    return (_entry(inner, first)[0] if first else path), f'cluster_{path}'


def to_ascii(container: Container) -> str:
    """Draw as an indented list for a terminal or a log; ``>`` marks what runs now."""
    structure = Structure(container)
    marked = {
        f'{inner.path}/{label}'
        for inner in structure.walk()
        for label in inner.container.get_active_states()
    }
    lines = [f'{structure.path} ({structure.kind}) ends with {", ".join(structure.outcomes)}']
    _ascii(structure, marked, lines, '')
    return '\n'.join(lines) + '\n'


def _ascii(structure: Structure, marked: set[str], lines: list[str], indent: str) -> None:
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
        lines.append(f'{indent}{branch}{mark} {label}{kind}{flag}{f"  {leads}" if leads else ""}')
        if inner is not None:
            _ascii(inner, marked, lines, indent + ('     ' if last else '|    '))


def _bundles(edges: Iterable[Edge]) -> list[tuple[str, str, bool, list[str]]]:
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
