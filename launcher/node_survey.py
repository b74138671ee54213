"""What all nodes declare and offer: each is made once, in each mode and behaviour, and looked at.

From this come the schema that `surveillance_runtime.configuration` checks with, docs/parameters.md
and docs/interfaces.md.
"""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from launcher.environment import CHECKOUT
from surveillance_runtime import node_table
from surveillance_runtime.configuration import Configuration, NodeSchema, file_layer
from surveillance_runtime.parameters import ParameterError, ParameterSpec
from surveillance_runtime.place.rooms import GEOMETRY_KEYS, PLACE_KEYS
from surveillance_runtime.testing import claim_domain

_NAMESPACE = '/robot'
_OF_EVERY_NODE = ('/rosout', '/parameter_events', '/clock')


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
class Survey:
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


def survey() -> Survey:
    """Make each node and note what it declares and offers; needs a ROS environment."""
    import rclpy
    from rclpy.parameter import Parameter

    found = Survey()
    context = rclpy.Context()
    # The simulator publishes its map, doors and a scan when it is made.
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
    schema = {node.name: NodeSchema(prefixes=(*PLACE_KEYS, *GEOMETRY_KEYS))}
    for behaviour, place in (('surveillance', 'seven_rooms.yaml'), ('patrol', 'patrol_world.yaml')):
        layers = (file_layer(config / place),)
        settings = Configuration(layers, schema).resolve(node.name)
        described = {name: setting.value for name, setting in settings.items()}
        described |= {'behaviour': behaviour, 'console': False, 'use_sim_time': True}
        if node.name == 'video_source':
            described['source'] = str(CHECKOUT / 'docs' / 'images' / 'camera.jpg')
        for mode in node_table.MODES if node.has_modes else (node_table.DEFAULT_MODE,):
            yield described | {'execution_mode': mode}


def _make(node: node_table.Node, context: Any, overrides: Sequence[Any]) -> Any:
    """Make a node; one whose parameters cannot work is as far as it came."""
    kind = getattr(importlib.import_module(node.module), node.class_name)
    made = kind.__new__(kind)
    with suppress(ParameterError):
        made.__init__(
            context=context,
            namespace=_NAMESPACE,
            parameter_overrides=overrides,
            use_global_arguments=False,
        )
    return made


def _note_interfaces(made: Any, name: str, found: Survey) -> None:
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
