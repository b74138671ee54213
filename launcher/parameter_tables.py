"""The tables of all nodes' parameters: written from the nodes' declarations, printed, documented.

`write` makes every node once, in each mode and behaviour, and notes what it declares. The result is
the schema that `surveillance_runtime.configuration` checks with, and docs/parameters.md.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from launcher import package_commands
from launcher.environment import CHECKOUT
from surveillance_runtime import node_table
from surveillance_runtime.configuration import (
    SCHEMA,
    Configuration,
    NodeSchema,
    read_schema,
)
from surveillance_runtime.parameters import ParameterError, ParameterSpec
from surveillance_runtime.place.rooms import GEOMETRY_KEYS, PLACE_KEYS
from surveillance_runtime.testing import claim_domain

_HEAD = """\
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


def collect() -> dict[str, Any]:
    """Return what each node declares, in the form of the schema file; needs a ROS environment."""
    import rclpy
    from rclpy.parameter import Parameter

    tables: dict[str, Any] = {}
    context = rclpy.Context()
    # The simulator tells its map, doors and a scan as it is made.
    rclpy.init(context=context, domain_id=claim_domain())
    here = os.getcwd()
    try:
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            for node in node_table.NODES:
                declared: dict[str, ParameterSpec] = {}
                prefixes: set[str] = set()
                for given in _variants(node):
                    overrides = [Parameter(name, value=value) for name, value in given.items()]
                    more, below = _declared(node, context, overrides)
                    declared = more | declared
                    prefixes |= below
                tables[node.name] = {
                    'prefixes': sorted(prefixes),
                    'parameters': {name: _row(declared[name]) for name in sorted(declared)},
                }
    finally:
        os.chdir(here)
        rclpy.shutdown(context=context)
    return tables


def _variants(node: node_table.Node) -> Iterator[dict[str, Any]]:
    config = CHECKOUT / 'config'
    from surveillance_runtime.configuration import file_layer

    schema = {node.name: NodeSchema(prefixes=(*PLACE_KEYS, *GEOMETRY_KEYS))}
    for behaviour, place in (('surveillance', 'seven_rooms.yaml'), ('patrol', 'patrol_world.yaml')):
        layers = (file_layer(config / place),)
        settings = Configuration(layers, schema).resolve(node.name)
        described = {name: setting.value for name, setting in settings.items()}
        for mode in node_table.MODES if node.has_modes else (node_table.DEFAULT_MODE,):
            yield {**described, 'execution_mode': mode, 'behaviour': behaviour, 'console': False}


def _declared(
    node: node_table.Node, context: Any, overrides: Sequence[Any]
) -> tuple[dict[str, ParameterSpec], set[str]]:
    """Make a node and return its parameters and prefixes; of one that cannot start the first."""

    kind = getattr(importlib.import_module(node.module), node.class_name)
    made = kind.__new__(kind)
    try:
        made.__init__(context=context, parameter_overrides=overrides, use_global_arguments=False)
    except ParameterError:
        pass
    else:
        made.stop()
        made.destroy_node()
    return made.declared, made.prefixes


def _portable(value: Any) -> Any:
    """Return a default without the folder that this checkout lies in."""
    return value.removeprefix(f'{CHECKOUT}/') if isinstance(value, str) else value


def _name_of(check: Any) -> str:
    """Return where a function can be imported from, empty where it cannot."""
    name = getattr(check, '__qualname__', '')
    return f'{check.__module__}:{name}' if name.isidentifier() else ''


def _row(spec: ParameterSpec) -> dict[str, Any]:
    """Return a parameter in the form of the schema file."""
    kind = spec.element or type(spec.default)
    row: dict[str, Any] = {
        'type': kind.__name__ + ('[]' if spec.element else ''),
        'default': _portable(list(spec.default) if spec.element else spec.default),
        'description': spec.description,
    }
    for name in ('minimum', 'maximum'):
        value = getattr(spec, name)
        if value is not None:
            row[name] = value
    if check := _name_of(spec.check):
        row['check'] = check
    if spec.choices:
        row['choices'] = list(spec.choices)
    if not spec.read_only:
        row['changeable'] = True
    return row


def as_json(tables: Mapping[str, Any]) -> str:
    """Return the schema file's content."""
    return json.dumps(tables, indent=1, ensure_ascii=False) + '\n'


def as_markdown(schema: Mapping[str, NodeSchema]) -> str:
    """Return the page docs/parameters.md."""
    parts = [_HEAD]
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
    """Write schema and page anew; returns the files."""
    SCHEMA.write_text(as_json(collect()), encoding='utf-8')
    read_schema.cache_clear()
    page = checkout / 'docs' / 'parameters.md'
    page.write_text(as_markdown(read_schema()), encoding='utf-8')
    package_commands.HELP.write_text(as_json(package_commands.all_helps()), encoding='utf-8')
    return [SCHEMA, page, package_commands.HELP]


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
