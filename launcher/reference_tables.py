"""The tables of parameters and interfaces, written from the nodes themselves.

`survey` makes each node once, in each mode and behaviour, and notes what it declares and offers.
`write` makes of this the schema that `surveillance_runtime.configuration` checks with,
and the pages parameters, interfaces and alarms of docs/reference; `show` prints parameters for
`launch.py params`.
"""

from __future__ import annotations

import importlib
import io
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from floor_plans.parameters import GEOMETRY_KEYS, PATROL_KEYS, PLACE_KEYS
from launcher import package_commands
from launcher.environment import CHECKOUT, PROGRAM
from surveillance_runtime import alarms, node_table
from surveillance_runtime.configuration import (
    SCHEMA,
    Configuration,
    NodeSchema,
    file_layer,
    read_schema,
)
from surveillance_runtime.launch_protocol import NotNowError
from surveillance_runtime.parameters import ParameterError, ParameterSpec
from surveillance_runtime.testing import claim_domain

_NAMESPACE = '/robot'
_OF_EVERY_NODE = ('/rosout', '/parameter_events', '/clock')
_PARAMETERS = """\
# Parameters

Every parameter of every node, written by `python3 launch.py params --write` from the nodes' own
declarations; a test compares. `ros2 param describe NODE NAME` says the same of a running node.

A value is looked for in this order, and the first that is found counts: `-p NAME:=VALUE` on the
command line; what an option of the launcher sets; a file given with `--params` (or
`--params-file`), of several the last; the file of the place (`--map`); the robot's profile
(`--robot`); `config/parameters.yaml`; the default below. Within one file the section
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
[surveillance_interfaces](../../surveillance_interfaces), ARMOR's directives in
[Directives](directives.md).

- Names are relative, so `--namespace robot2` gives a second robot. A name that begins with a slash
  is the same for all robots.
- *Latched* topics are reliable and transient_local: a late subscriber gets the last message. Most
  are state topics: their owner repeats them and answers whoever else publishes them
  ([Architecture](../explanation/architecture.md#threads-and-time)). `state/battery_low` is
  published on change only; `battery_low` is the same, repeated.
- Each node publishes its health on `/diagnostics`
  ([Long runs](../how-to/long_runs.md#4-look-at-its-health)).
- A node that calls `ontology_map/reference_name` uses the ontology after that: it calls
  `armor_interface_srv` or `armor_interface_serialized_srv`, and some subscribe `fact_changes`. Only
  `initial_state` just waits for the map.
- What a caller may rely on when a service has answered:
  - `ontology_map/reference_name`: rooms, doors and `isIn` of the robot are in the ontology. Where
    nobody tells the place within 2 s of the map it answers all the same, and the log says so.
  - `ontology_map/built`: rooms and doors are there; `isIn` may come later.
  - `start`: as `reference_name`, for the map from markers.
  - `reason`: the decision is on the topic `decision` within a second.
  - `recharge`: charging has ended; `battery_level` says how.
  - `ontology_map/add_room`, `remove_room`, `set_door`: the ontology has the change.
  - `stop`: the base is held, or released, from the next command on.
  - `robot_behavior/fsm/pause`: `paused` is published, and no further state begins.
- The viewers are `mission_view`, `mission_markers`, `mission_page` and `mission_recorder`. The
  recorder subscribes all topics.
- `tf` and `tf_static` need tf2_msgs, which is built with the interfaces where no ROS is installed.
  `simulator` publishes `/clock` unless
  time runs at the machine's own rate.
"""
_VIEWERS = frozenset(('mission_view', 'mission_markers', 'mission_page', 'mission_recorder'))


@dataclass
class Interface:
    """A topic, service or action.

    Attributes:
        type: Its type, like ``std_msgs/Bool``.
        servers: The nodes that publish or offer it.
        clients: The nodes that subscribe or call it.
        latched: Of a topic: a late subscriber gets the last message.
    """

    type: str
    servers: set[str] = field(default_factory=set)
    clients: set[str] = field(default_factory=set)
    latched: bool = False


@dataclass
class NodeSurvey:
    """What the nodes declare and offer.

    Attributes:
        parameters: By node, in the form of the schema file.
        topics: By name; names that a namespace does not change begin with a slash.
        services: By name.
        actions: By name.
    """

    parameters: dict[str, Any] = field(default_factory=dict)
    topics: dict[str, Interface] = field(default_factory=dict)
    services: dict[str, Interface] = field(default_factory=dict)
    actions: dict[str, Interface] = field(default_factory=dict)


def survey() -> NodeSurvey:
    """Make each node and note what it declares and offers; needs a ROS environment."""
    import rclpy
    from rclpy.logging import LoggingSeverity
    from rclpy.parameter import Parameter

    from surveillance_runtime.logging import log_level

    found = NodeSurvey()
    context = rclpy.Context()
    # The simulator publishes its map, doors and a scan when it is made.
    rclpy.init(context=context, domain_id=claim_domain())
    here = os.getcwd()
    try:
        # What the nodes print is for whoever runs them.
        with (
            tempfile.TemporaryDirectory() as folder,
            redirect_stdout(io.StringIO()),
            log_level(LoggingSeverity.FATAL),
        ):
            os.chdir(folder)
            for node in node_table.NODES:
                declared: dict[str, ParameterSpec] = {}
                prefixes: set[str] = set()
                for given in _variants(node):
                    overrides = [Parameter(name, value=value) for name, value in given.items()]
                    made = _make(node, context, overrides)
                    declared = made.declared | declared
                    prefixes |= made.prefixes
                    _note_interfaces(made, node.name, found)
                    made.stop()
                    made.destroy_node()
                found.parameters[node.name] = {
                    'prefixes': sorted(prefixes),
                    'parameters': {name: _row(declared[name]) for name in sorted(declared)},
                }
    finally:
        os.chdir(here)
        rclpy.shutdown(context=context)
    return found


def _variants(node: node_table.Node) -> Iterator[dict[str, Any]]:
    config = CHECKOUT / 'config'
    schema = {node.name: NodeSchema(prefixes=(*PLACE_KEYS, *GEOMETRY_KEYS, *PATROL_KEYS))}
    for behaviour, place in (('surveillance', 'seven_rooms.yaml'), ('patrol', 'patrol_world.yaml')):
        layers = (file_layer(config / place),)
        settings = Configuration(layers, schema).resolve(node.name)
        described = {name: setting.value for name, setting in settings.items()}
        described |= {'behaviour': behaviour, 'console': False, 'use_sim_time': True}
        described['looks'] = True  # as with an observer
        if node.name == 'video_source':
            described['source'] = str(CHECKOUT / 'docs' / 'images' / 'camera.jpg')
        for mode in node_table.MODES if node.has_modes else (node_table.DEFAULT_MODE,):
            yield described | {'execution_mode': mode}


def _make(node: node_table.Node, context: Any, overrides: Sequence[Any]) -> Any:
    """Make a node; one whose parameters cannot work is as far as it came."""
    kind = getattr(importlib.import_module(node.module), node.class_name)
    made = kind.__new__(kind)
    with suppress(ParameterError, NotNowError):
        made.__init__(
            context=context,
            namespace=_NAMESPACE,
            parameter_overrides=overrides,
            use_global_arguments=False,
        )
    return made


def _note_interfaces(made: Any, name: str, found: NodeSurvey) -> None:
    """Note the topics, services and actions of a node in the graph."""
    from rclpy import action

    node = (made.get_name(), made.get_namespace())
    published = made.get_publisher_names_and_types_by_node(*node)
    for interface in _note(found.topics, published):
        interface.servers.add(name)
    for topic, _ in published:
        for end in made.get_publishers_info_by_topic(topic):
            if end.qos_profile.durability.name == 'TRANSIENT_LOCAL':
                for interface in _note(found.topics, [(topic, [end.topic_type])]):
                    interface.latched = True
    for kind, ask in (
        (found.topics, made.get_subscriber_names_and_types_by_node),
        (found.services, made.get_client_names_and_types_by_node),
        (found.actions, lambda *n: action.get_action_client_names_and_types_by_node(made, *n)),
    ):
        for interface in _note(kind, ask(*node)):
            interface.clients.add(name)
    for kind, ask in (
        (found.services, made.get_service_names_and_types_by_node),
        (found.actions, lambda *n: action.get_action_server_names_and_types_by_node(made, *n)),
    ):
        for interface in _note(kind, ask(*node)):
            interface.servers.add(name)


def _note(
    interfaces: dict[str, Interface], names_and_types: Iterable[tuple[str, Sequence[str]]]
) -> Iterator[Interface]:
    """Yield the entry of each name, without those that rclpy gives every node."""
    for full_name, types in names_and_types:
        kind = types[0]
        if '/_action/' in full_name or full_name in _OF_EVERY_NODE:
            continue
        if kind.startswith(('rcl_interfaces/', 'type_description_interfaces/')):
            continue
        package, _, type_name = kind.split('/')
        name = full_name.removeprefix(f'{_NAMESPACE}/')
        yield interfaces.setdefault(name, Interface(f'{package}/{type_name}'))


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


def interfaces_page(found: NodeSurvey) -> str:
    """Return the page docs/reference/interfaces.md."""
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
    # Who owns a state topic hears it as well, to answer whoever else publishes it.
    owners = interface.servers if interface.latched else set()
    servers, clients = _named(interface.servers), _named(interface.clients - owners)
    latched = ', latched' if interface.latched else ''
    return f'| `{name}` | {interface.type}{latched} | {servers} | {clients} |\n'


def _named(nodes: Iterable[str]) -> str:
    """Return the names of nodes, the viewers together."""
    names = set(nodes)
    viewers = names & _VIEWERS
    if len(viewers) > 1:
        return ', '.join((*(f'`{name}`' for name in sorted(names - _VIEWERS)), 'viewers'))
    return ', '.join(f'`{name}`' for name in sorted(names))


_CLI = """\
# Commands

What each command says to `--help`, written by `python3 launch.py params --write`; a test compares.
"""


_OWN_COMMANDS = ('explore', 'node', 'list', 'params', 'service', 'setup', 'lock', 'test', 'lint')


def cli_page(helps: Mapping[str, str]) -> str:
    """Return the page docs/reference/cli.md.

    Args:
        helps: What each command of a package says to `--help`, by name.
    """
    from launcher.cli import main

    texts = {'': package_commands.printed(main, ['--help'])}
    texts |= {name: package_commands.printed(main, [name, '--help']) for name in _OWN_COMMANDS}
    parts = [_CLI]
    for name, text in (texts | dict(helps)).items():
        parts.append(f'\n## {f"{PROGRAM} {name}".strip()}\n\n```text\n{text.strip()}\n```\n')
    return ''.join(parts)


def as_json(tables: Mapping[str, Any]) -> str:
    """Return the schema file's content."""
    return json.dumps(tables, indent=1, ensure_ascii=False) + '\n'


def parameters_page(schema: Mapping[str, NodeSchema]) -> str:
    """Return the page docs/reference/parameters.md."""
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
        'alarms.md': alarms.page(),
    }
    helps = package_commands.all_helps()
    pages['cli.md'] = cli_page(helps)
    for name, text in pages.items():
        (checkout / 'docs' / 'reference' / name).write_text(text, encoding='utf-8')
    package_commands.HELP.write_text(as_json(helps), encoding='utf-8')
    return [
        SCHEMA,
        *(checkout / 'docs' / 'reference' / name for name in pages),
        package_commands.HELP,
    ]


Printer = Callable[[str], None]


def settings_of(
    configuration: Configuration, nodes: Sequence[node_table.Node], namespace: str
) -> Iterator[tuple[str, list[tuple[str, object, str]]]]:
    """Yield what each node will get: its full name; name, value and origin of each parameter."""
    schema = read_schema()
    for node in nodes:
        full_name = f'{namespace}/{node.name}'
        settings = configuration.resolve(node.name, full_name)
        rows = [(name, setting.value, setting.origin) for name, setting in settings.items()]
        rows += [
            (name, spec.default, 'default')
            for name, spec in schema[node.name].parameters.items()
            if name not in settings
        ]
        yield full_name, sorted(rows, key=lambda row: row[0])


def show(
    configuration: Configuration, nodes: Sequence[node_table.Node], namespace: str, say: Printer
) -> None:
    """Print what each node will get, and where each value comes from."""
    for full_name, rows in settings_of(configuration, nodes, namespace):
        width = max((len(name) for name, _, _ in rows), default=0)
        say(f'{full_name}')
        for name, value, origin in rows:
            say(f'  {name:<{width}}  {json.dumps(value, ensure_ascii=False)}  ({origin})')


def show_json(
    configuration: Configuration, nodes: Sequence[node_table.Node], namespace: str, say: Printer
) -> None:
    """Print the same for programs."""
    told = {
        full_name: {name: {'value': value, 'origin': origin} for name, value, origin in rows}
        for full_name, rows in settings_of(configuration, nodes, namespace)
    }
    say(json.dumps(told, ensure_ascii=False))
