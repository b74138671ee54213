"""A machine written down: as Mermaid, Graphviz, text for a log, and YAML that can be loaded."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from surveillance_fsm.concurrence import Concurrence
from surveillance_fsm.container import Container
from surveillance_fsm.exceptions import MachineFileError
from surveillance_fsm.nodes import RESUME
from surveillance_fsm.state import CBState, State
from surveillance_fsm.state_machine import Iterator as IteratorContainer
from surveillance_fsm.state_machine import Sequence, StateMachine
from surveillance_fsm.structure import Edge, Structure
from surveillance_fsm.userdata import raw


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


# As data.


def to_yaml(container: Container) -> str:
    """Write a machine as YAML that `machine_file.load_machine` reads; needs PyYAML.

    Raises:
        MachineFileError: A part of it has no form as data: a callback, a function without a name, a
            class with arguments that did not come from a file.
    """
    import yaml

    data = to_data(container)
    text: str = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, default_flow_style=None)
    return text


def to_data(container: Container) -> dict[str, Any]:
    """Describe a machine by plain data, as `machine_file.machine_from` takes it.

    Raises:
        MachineFileError: See `to_yaml`.
    """
    return {
        'machine': _kind_of(container),
        'name': container.get_name(),
        **_container_data(container, container.get_name()),
    }


def _kind_of(container: Container) -> str:
    for kind in (Sequence, StateMachine, Concurrence, IteratorContainer):
        if type(container) is kind:
            return kind.__name__
    raise MachineFileError(
        f"'{container.get_name()}' is a {type(container).__name__}: only the engine's own "
        'containers have a form as data'
    )


def _container_data(container: Container, path: str) -> dict[str, Any]:
    data = {'outcomes': [], **_declared(container)}
    if raw(container.userdata):
        data['userdata'] = {
            key: _plain(f'userdata key {key!r} of {path!r}', value)
            for key, value in raw(container.userdata).items()
        }
    data |= _kind_data(container, path)
    data['states'] = {
        label: _state_data(container, label, state, f'{path}/{label}')
        for label, state in container.fsm_states.items()
    }
    if container.fsm_branches:
        data['interrupts'] = {
            branch.label: {
                **_what(branch.state, f'{path}/{branch.label}'),
                'priority': branch.priority,
                'transitions': dict(branch.transitions),
                **_remapping(container, branch.label),
            }
            for branch in container.fsm_branches.values()
        }
    return data


def _kind_data(container: Container, path: str) -> dict[str, Any]:
    if isinstance(container, Concurrence):
        if container.outcome_cb is not None or container.child_termination_cb is not None:
            raise MachineFileError(f"'{path}' has callbacks, which have no form as data")
        data: dict[str, Any] = {'default_outcome': container.default_outcome}
        if container.outcome_map:
            data['outcome_map'] = container.outcome_map
        return data
    if isinstance(container, IteratorContainer):
        items = container.items
        if callable(items) or not isinstance(items, list | tuple | range | str):
            raise MachineFileError(f"'{path}' has items that are no list")
        return {
            'items': [_plain(f'an item of {path!r}', item) for item in items],
            'item_key': container.items_label,
            'exhausted_outcome': container.exhausted_outcome,
        }
    data = {'initial': container.get_initial_states()[0]} if container.fsm_states else {}
    if isinstance(container, Sequence):
        data['connector_outcome'] = container.connector_outcome
    return data


def _state_data(container: Container, label: str, state: State, path: str) -> dict[str, Any]:
    data = _what(state, path)
    if isinstance(container, StateMachine):
        bound = {
            outcome: target
            for outcome, source, target in container.get_internal_edges()
            if source == label and target
        }
        if bound:
            data['transitions'] = bound
    elif isinstance(container, IteratorContainer):
        data['loop_outcomes'] = sorted(container.loop_outcomes)
        if container.final_outcome_map:
            data['final_outcome_map'] = dict(container.final_outcome_map)
    data |= _remapping(container, label)
    if container.fsm_constants.get(label):
        data['constants'] = {
            key: _plain(f'constant {key!r} of {path!r}', value)
            for key, value in container.fsm_constants[label].items()
        }
    limits = container.fsm_limits.get(label)
    if limits is not None:
        for name in ('timeout', 'deadline', 'retry'):
            if getattr(limits, name):
                data[name] = getattr(limits, name)
        if limits.retry:
            data['retry_on'] = sorted(limits.failures - {limits.late_outcome}) or ['aborted']
    return data


def _remapping(container: Container, label: str) -> dict[str, Any]:
    remapping = container.fsm_remappings.get(label)
    return {'remapping': dict(remapping)} if remapping else {}


def _what(state: State, path: str) -> dict[str, Any]:
    """Return what a state is, as data."""
    if isinstance(state, Container):
        return {'machine': _kind_of(state), **_container_data(state, path)}
    if state.fsm_source is not None:
        source = {'state': state.fsm_source['state']}
        if state.fsm_source['arguments']:
            source['arguments'] = dict(state.fsm_source['arguments'])
        return source
    if type(state) is CBState:
        return {'function': _name_of(state.function, path), **_declared(state)}
    return {'state': _name_of(type(state), path)}


def _declared(state: State) -> dict[str, Any]:
    """Return outcomes and keys of a state, as far as it has any."""
    declared = {
        'outcomes': state.get_registered_outcomes(),
        'input_keys': state.get_registered_input_keys(),
        'output_keys': state.get_registered_output_keys(),
    }
    return {name: sorted(names) for name, names in declared.items() if names}


def _name_of(thing: Any, path: str) -> str:
    name = f'{thing.__module__}:{thing.__qualname__}'
    if '<' in name or thing.__module__ == '__main__':
        raise MachineFileError(f"'{path}': {name} cannot be imported by that name")
    return name


def _plain(what: str, value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_plain(what, item) for item in value]
    if isinstance(value, dict):
        return {str(key): _plain(what, item) for key, item in value.items()}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise MachineFileError(f'{what} is a {type(value).__name__}, which has no form as data')
