"""The tables of parameters and interfaces, written from the nodes themselves (`node_survey`).

`write` makes the schema that `surveillance_runtime.configuration` checks with, docs/parameters.md
and docs/interfaces.md; `show` prints parameters for `launch.py params`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from launcher import package_commands
from launcher.node_survey import Interface, Survey, survey
from surveillance_runtime import node_table
from surveillance_runtime.configuration import SCHEMA, Configuration, NodeSchema, read_schema

_PARAMETERS = """\
# Parameters

Every parameter of every node, written by `python3 launch.py params --write` from the nodes' own
declarations; a test compares. `ros2 param describe NODE NAME` says the same of a running node.

A value is looked for in this order, and the first that is found counts: `-p NAME:=VALUE` on the
command line; a file given with `--params` (or `--params-file`), of several the last; the file of
the place (`--map`); `config/parameters.yaml`; the default below. Within one file the section
`/**/node` counts before `/**`. A file with a `map` replaces the place before it as a whole. An
unknown name, a wrong type and a value out of range end the start with one line and status 2.
`python3 launch.py params [NODE]` prints the values and where each comes from.

Parameters marked *live* can be changed while the node runs: `param set NODE NAME VALUE` in
`python3 launch.py console`, or `ros2 param set`.
"""


_INTERFACES = """\
# Interfaces

All topics, services and actions, written by `python3 launch.py params --write` from the nodes
themselves; a test compares. The fields of the types, with units, stand in
[surveillance_interfaces](../surveillance_interfaces), ARMOR's directives in [armor.md](armor.md).

- Names are relative, so `--namespace robot2` gives a second robot. A name that begins with a slash
  is the same for all robots.
- *Latched* topics are reliable and transient_local: a late subscriber gets the last message.
- Each node publishes its health on `/diagnostics` ([long_runs.md](long_runs.md#health)).
- A node that calls `ontology_map/reference_name` uses the ontology after that: it calls
  `armor_interface_srv` or `armor_interface_serialized_srv`, and some subscribe `fact_changes`. Only
  `initial_state` just waits for the map.
- The viewers are `mission_view`, `mission_markers`, `mission_page` and `mission_recorder`. The
  recorder subscribes all topics.
- `tf` and `tf_static` need tf2_msgs, which is not on PyPI. `simulator` publishes `/clock` unless
  time runs at the machine's own rate.
"""
_VIEWERS = frozenset(('mission_view', 'mission_markers', 'mission_page', 'mission_recorder'))


def interfaces_page(found: Survey) -> str:
    """Return the page docs/interfaces.md."""
    parts = [_INTERFACES]
    for title, head, interfaces in (
        ('Topics', ('published by', 'subscribed by'), found.topics),
        ('Services', ('offered by', 'called by'), found.services),
        ('Actions', ('offered by', 'called by'), found.actions),
    ):
        parts.append(f'\n## {title}\n\n| name | type | {head[0]} | {head[1]} |\n')
        parts.append('|---|---|---|---|\n')
        parts += (_interface_row(name, interfaces[name]) for name in sorted(interfaces))
    return ''.join(parts)


def _interface_row(name: str, interface: Interface) -> str:
    servers, clients = _named(interface.servers), _named(interface.clients)
    latched = ', latched' if interface.latched else ''
    return f'| `{name}` | {interface.type}{latched} | {servers} | {clients} |\n'


def _named(nodes: Iterable[str]) -> str:
    """Return the names of nodes, the viewers together."""
    names = set(nodes)
    viewers = names & _VIEWERS
    if len(viewers) > 1:
        return ', '.join((*(f'`{name}`' for name in sorted(names - _VIEWERS)), 'viewers'))
    return ', '.join(f'`{name}`' for name in sorted(names))


def as_json(tables: Mapping[str, Any]) -> str:
    """Return the schema file's content."""
    return json.dumps(tables, indent=1, ensure_ascii=False) + '\n'


def parameters_page(schema: Mapping[str, NodeSchema]) -> str:
    """Return the page docs/parameters.md."""
    parts = [_PARAMETERS]
    for node in node_table.NODES:
        table = schema[node.name]
        parts.append(f'\n## {node.name}\n\n')
        if table.prefixes:
            tables = ', '.join(f'`{prefix}`' for prefix in table.prefixes)
            parts.append(f'Reads the place: {tables}.\n\n')
        if not table.parameters:
            parts.append('No parameters of its own.\n')
            continue
        parts.append('| parameter | default | allowed | |\n|---|---|---|---|\n')
        for name, spec in table.parameters.items():
            live = '' if spec.read_only else ' *live*'
            text = spec.description.replace('|', '\\|')
            default = _shown(spec.default)
            parts.append(f'| `{name}` | {default} | {spec.expected()} | {text}{live} |\n')
    return ''.join(parts)


def _shown(value: Any) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return 'infinite'
    if value == '':
        return 'empty'
    return f'`{json.dumps(value, ensure_ascii=False)}`'


def write(checkout: Path) -> list[Path]:
    """Write schema and pages anew; returns the files."""
    found = survey()
    SCHEMA.write_text(as_json(found.parameters), encoding='utf-8')
    read_schema.cache_clear()
    pages = {
        'parameters.md': parameters_page(read_schema()),
        'interfaces.md': interfaces_page(found),
    }
    for name, text in pages.items():
        (checkout / 'docs' / name).write_text(text, encoding='utf-8')
    package_commands.HELP.write_text(as_json(package_commands.all_helps()), encoding='utf-8')
    return [SCHEMA, *(checkout / 'docs' / name for name in pages), package_commands.HELP]


Printer = Callable[[str], None]


def show(
    configuration: Configuration, nodes: Sequence[node_table.Node], namespace: str, say: Printer
) -> None:
    """Print what each node will get, and where each value comes from."""
    schema = read_schema()
    for node in nodes:
        full_name = f'{namespace}/{node.name}'
        settings = configuration.resolve(node.name, full_name)
        table = schema[node.name]
        rows = [
            (name, json.dumps(setting.value, ensure_ascii=False), setting.origin)
            for name, setting in settings.items()
        ]
        rows += [
            (name, json.dumps(spec.default, ensure_ascii=False), 'default')
            for name, spec in table.parameters.items()
            if name not in settings
        ]
        width = max((len(name) for name, _, _ in rows), default=0)
        say(f'{full_name}')
        for name, value, origin in sorted(rows):
            say(f'  {name:<{width}}  {value}  ({origin})')
