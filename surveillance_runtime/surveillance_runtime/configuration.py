"""The parameters of a node, merged from files, a place and the command line before it starts.

A `Layer` is one source: a parameter file, or the arguments `-p NAME:=VALUE`. `Configuration` merges
layers, a later one wins, and checks every entry against the schema of all nodes: an unknown name, a
wrong type and a value out of range cost one line that names the source, what was found and what
was expected. Within one file `/**` yields to `/**/node` and that to `/namespace/node`, as in ROS.

The schema, `parameter_schema.json`, is written from the nodes' own declarations by
`python3 launch.py params --write`. No ROS in here.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from floor_plans import ROBOT_RADIUS, Place, PlaceError
from floor_plans.parameters import (
    GEOMETRY_KEYS,
    PATROL_KEYS,
    PLACE_KEYS,
    checked_plan,
    map_file_beside,
    tables_of,
)
from strict_files.files import FileError
from strict_files.suggestions import nearest
from strict_files.yaml_file import UNREADABLE, RosLoader, YamlFile, parameters_of, read_yaml_file
from surveillance_runtime.node_table import LOG_LEVELS
from surveillance_runtime.parameters import Check, ParameterError, ParameterSpec

SCHEMA = Path(__file__).with_name('parameter_schema.json')
_PLACE = frozenset((*PLACE_KEYS, *GEOMETRY_KEYS, *PATROL_KEYS))
_TYPES = {'bool': bool, 'int': int, 'float': float, 'str': str}
_OWN = {  # every rclpy node has these; a clock that changes makes all times that were taken wrong
    name: ParameterSpec(name, False, text, read_only=True)
    for name, text in (
        ('use_sim_time', 'Whether the time is that of the topic /clock.'),
        ('start_type_description_service', 'Whether ~/get_type_description is served.'),
    )
}
_ORIGIN = re.compile(r'#@ (.+)$')
_ASSIGNMENT = re.compile(r'(?:(?P<node>[^:=]+):)?(?P<name>[^:=]+):=(?P<value>.*)\Z', re.DOTALL)
_LONGEST_SHOWN = 200
_VALUED = (
    *('-r', '--remap', '--log-level', '--log-config-file'),
    *('--log-file-name', '-e', '--enclave'),
)
_LEVELS = '|'.join(LOG_LEVELS)
_FORMS = dict.fromkeys(
    ('-r', '--remap'), (re.compile(r'([^:=]+:)?[^:=]+:=[^:=]+'), 'FROM:=TO or NODE:FROM:=TO')
) | {'--log-level': (re.compile(f'([^:=]+:=)?({_LEVELS})', re.IGNORECASE), f'one of {_LEVELS}')}
"""What ROS would refuse in more than a line."""
_FLAGS = re.compile(r'--(enable|disable)-(rosout|stdout|external-lib)-logs\Z')
_RENAME = re.compile(r'(?:(?P<node>[^:=]+):)?__(?P<what>ns|node|name):=(?P<to>.+)\Z')


@dataclass(frozen=True)
class Entry:
    """One parameter as one source gives it.

    Attributes:
        pattern: Which nodes it is for: `/**`, `/**/node`, `node`, `/namespace/node`.
        name: The parameter's name, nested names joined with dots.
        value: As YAML reads it.
        origin: `file:line`, or the argument.
    """

    pattern: str
    name: str
    value: Any
    origin: str

    @property
    def table(self) -> str:
        """The part of a place that it belongs to, empty for other parameters."""
        head = self.name.partition('.')[0]
        return head if head in _PLACE else ''

    def addresses(self, node: str, full_name: str) -> bool:
        """Tell whether it is for a node, by its name in the table and its name in the graph."""
        pattern = self.pattern
        if pattern in ('/**', '**'):
            return True
        if pattern.rsplit('/', 1)[-1] not in (node, full_name.rsplit('/', 1)[-1], '*', '**'):
            return False
        if '/' not in pattern.strip('/') and not pattern.startswith('/'):
            return True
        form = pattern if pattern.startswith('/') else '/' + pattern
        # ROS: `/**` stands for any number of namespaces, `/*` for one.
        expression = re.escape(form).replace(r'/\*\*', r'(/[^/]+)*').replace(r'\*', '[^/]+')
        return re.fullmatch(expression, full_name) is not None

    @property
    def rank(self) -> int:
        """Of two entries of one file the one of the higher rank wins."""
        if self.pattern in ('/**', '**'):
            return 0
        return 1 if '*' in self.pattern else 2


@dataclass(frozen=True)
class Layer:
    """The entries of one source, in its order."""

    source: str
    entries: tuple[Entry, ...]


@dataclass(frozen=True)
class Setting:
    """A parameter's value for one node, of the declared type, and where it came from."""

    value: Any
    origin: str


@dataclass(frozen=True)
class NodeSchema:
    """What one node declares: parameters by name, and prefixes under which it takes any name."""

    parameters: Mapping[str, ParameterSpec] = field(default_factory=dict)
    prefixes: tuple[str, ...] = ()

    def spec(self, name: str) -> ParameterSpec | None:
        """Return what is known of a parameter, None where the node has none of this name."""
        return self.parameters.get(name) or _OWN.get(name)

    def takes(self, name: str) -> bool:
        """Tell whether the node has such a parameter."""
        return (
            self.spec(name) is not None
            or name.startswith('qos_overrides.')
            or name.partition('.')[0] in self.prefixes
        )


@cache
def read_schema() -> Mapping[str, NodeSchema]:
    """Return what each node declares, by the node's name."""
    stored = json.loads(SCHEMA.read_text(encoding='utf-8'))
    return {node: _node_schema(body) for node, body in stored.items()}


def declared(node: str, name: str) -> ParameterSpec:
    """Return what is known of a node's parameter.

    Raises:
        ParameterError: There is no such node, or it declares no such parameter.
    """
    nodes = read_schema()
    if node not in nodes:
        raise ParameterError(f'there is no node {_short(node)}: expected {nearest(node, nodes)}')
    if (spec := nodes[node].spec(name)) is None:
        near = nearest(name, nodes[node].parameters)
        raise ParameterError(f'{node} has no parameter {_short(name)}: expected {near}')
    return spec


def _node_schema(body: Mapping[str, Any]) -> NodeSchema:
    specs = {}
    for name, row in body['parameters'].items():
        kind = _TYPES[row['type'].removesuffix('[]')]
        specs[name] = ParameterSpec(
            name,
            row['default'],
            row['description'],
            row.get('minimum'),
            row.get('maximum'),
            tuple(row.get('choices', ())),
            kind if row['type'].endswith('[]') else None,
            partial(_checked_by, row['check']) if 'check' in row else None,
            read_only=not row.get('changeable'),
        )
    return NodeSchema(specs, tuple(body['prefixes']))


def _checked_by(name: str, value: Any) -> str | None:
    """Look at a value with the node's own function, imported when there is a value to look at."""
    module, _, function = name.partition(':')
    check: Check = getattr(import_module(module), function)
    return check(value)


def file_layer(path: str | Path) -> Layer:
    """Read a ROS parameter file.

    Raises:
        FileError: It cannot be read or is not of a parameter file's form.
    """
    file = read_yaml_file(path)
    origins = _noted_origins(file)
    entries = []
    for section in file.values:
        for where, name, value in parameters_of(file, section):
            line = file.lines[where]
            if name == 'map_file' and isinstance(value, str) and value:
                value = map_file_beside(file.path, value)
            entries.append(Entry(section, name, value, origins.get(line, f'{path}:{line}')))
    return Layer(str(path), tuple(entries))


def _noted_origins(file: YamlFile) -> dict[int, str]:
    """Return the sources that a resolved file notes behind its lines, by line."""
    try:
        lines = file.path.read_text(encoding='utf-8').splitlines()
    except OSError:
        return {}
    found = ((number, _ORIGIN.search(line)) for number, line in enumerate(lines, start=1))
    return {number: match[1] for number, match in found if match}


def argument_layer(assignments: Iterable[str]) -> Layer:
    """Read arguments `[NODE:]NAME:=VALUE`, as `-p` has them.

    Raises:
        ParameterError: One is not of this form, or its value is not YAML.
    """
    entries = []
    for text in assignments:
        match = _ASSIGNMENT.match(text)
        if match is None or not match['name'].strip():
            raise ParameterError(f'-p {_short(text)}: expected NAME:=VALUE or NODE:NAME:=VALUE')
        pattern = '/**' if match['node'] is None else match['node']
        try:
            value = argument_value(match['value'])
        except ParameterError as error:
            raise ParameterError(f'-p {_short(text)}: {error}') from None
        entries.append(Entry(pattern, match['name'], value, f'-p {_short(text)}'))
    return Layer('the command line', tuple(entries))


def argument_value(text: str) -> Any:
    """Return the value that a text is as YAML, with numbers as ROS has them.

    Raises:
        ParameterError: It cannot be read.
    """
    try:
        if len(text) > 1_000_000 or text.count('[') + text.count('{') > 1000:
            raise ValueError('too large')
        value = yaml.load(text, RosLoader)
        if isinstance(value, Mapping):
            raise ValueError('a mapping')
    except (*UNREADABLE, RecursionError):
        raise ParameterError('the value is not valid YAML; quote it') from None
    return text if value is None else value


@dataclass(frozen=True)
class Configuration:
    """Layers of parameters, merged.

    Attributes:
        layers: Sources by rising precedence.
        schema: What each node declares.
    """

    layers: tuple[Layer, ...]
    schema: Mapping[str, NodeSchema] = field(default_factory=read_schema)

    def check(self) -> None:
        """Make sure that every entry is one that some node takes.

        Raises:
            ParameterError: The first entry that is wrong.
        """
        for layer in self.layers:
            for entry in layer.entries:
                self._check_entry(entry)

    def _check_entry(self, entry: Entry) -> None:
        last = entry.pattern.rsplit('/', 1)[-1]
        everyone = last in ('*', '**')
        if not everyone and last not in self.schema:
            raise ParameterError(
                f"{entry.origin}: no node is called '{entry.pattern}', "
                f'expected /** or {nearest(last, self.schema)}'
            )
        addressed = list(self.schema) if everyone else [last]
        takers = [node for node in addressed if self._schema_of(node).takes(entry.name)]
        if not takers:
            known = {name for node in addressed for name in self._names(node)}
            whose = '' if everyone else f' of {last}'
            owners = [node for node in self.schema if self._schema_of(node).takes(entry.name)]
            hint = f' (one of {", ".join(owners)})' if owners and not everyone else ''
            raise ParameterError(
                f"{entry.origin}: unknown parameter '{_short(entry.name)}'{whose}{hint}, "
                f'expected {nearest(entry.name, sorted(known))}'
            )
        for node in takers:
            self._accepted(node, entry)

    def resolve(self, node: str, full_name: str = '') -> dict[str, Setting]:
        """Return what the layers give to one node; what they do not give keeps its default.

        Args:
            node: The node's name in the schema.
            full_name: Its name in the graph, with its namespace; default: `/node`.

        Raises:
            ParameterError: A value is of the wrong type or out of range.
        """
        schema = self._schema_of(node)
        full_name = full_name or f'/{node}'
        found: dict[str, Setting] = {}
        for layer in self.layers:
            mine = [each for each in layer.entries if each.addresses(node, full_name)]
            if any(entry.table == 'map' for entry in mine):  # another place, as a whole
                found = {name: found[name] for name in found if name.split('.')[0] not in _PLACE}
            for entry in sorted(mine, key=lambda each: each.rank):
                if node not in self.schema or schema.takes(entry.name):
                    found.pop(entry.name, None)
                    found[entry.name] = Setting(self._accepted(node, entry), entry.origin)
        return found

    def place(self, node: str = 'simulator', full_name: str = '') -> Place | None:
        """Return the place that is configured, with all its checks; None where there is none.

        Raises:
            ParameterError: What is described is no sound place.
        """
        if 'map' not in self._schema_of(node).prefixes:
            return None  # it knows no rooms
        settings = self.resolve(node, full_name)
        described = {
            name: setting.value
            for name, setting in settings.items()
            if name.partition('.')[0] in _PLACE
        }
        radius = settings.get('robot_radius', Setting(ROBOT_RADIUS, '')).value
        try:
            parameters = tables_of(described.items())
            if not parameters.keys() & {'map', 'room_positions'}:
                return None
            return checked_plan(parameters, float(radius)).place
        except PlaceError as error:
            raise ParameterError(f'{self._origin(settings, error)}: {error}') from None

    def _origin(self, settings: Mapping[str, Setting], error: PlaceError) -> str:
        for depth in range(len(error.where), 0, -1):
            name = '.'.join(error.where[:depth])
            below = (known for known in settings if known.startswith(name + '.'))
            if known := name if name in settings else next(below, ''):
                return settings[known].origin
        first = next((settings[name] for name in settings if name.startswith('map.')), None)
        return first.origin.rpartition(':')[0] if first else 'the place'

    def _schema_of(self, node: str) -> NodeSchema:
        return self.schema.get(node, NodeSchema())

    def _names(self, node: str) -> Iterator[str]:
        schema = self._schema_of(node)
        yield from schema.parameters
        yield from schema.prefixes
        yield from _OWN

    def _accepted(self, node: str, entry: Entry) -> Any:
        if entry.value is None:
            raise ParameterError(f'{entry.origin}: parameter {entry.name}: expected a value')
        _check_plain(entry)
        spec = self._schema_of(node).spec(entry.name)
        if spec is None:
            return entry.value
        try:
            return spec.accept(entry.value)
        except ParameterError as error:
            raise ParameterError(f'{entry.origin}: {error}') from None


def _check_plain(entry: Entry) -> None:
    """Refuse what a ROS parameter cannot hold: dates, lists in lists, values of several types."""
    value = entry.value
    kinds = {type(each) for each in value} if isinstance(value, list) else {type(value)}
    if kinds == {int, float}:
        kinds = {float}
    if len(kinds) > 1 or not kinds <= {bool, int, float, str}:
        expected = 'true, false, a number, a text, or a list of one of these'
    else:
        values = value if isinstance(value, list) else [value]
        expected = next(filter(None, map(_what_ros_holds, values)), '')
    if expected:
        shown = _short(str(value))
        raise ParameterError(
            f'{entry.origin}: parameter {entry.name}: got {shown}, expected {expected}'
        )


def _what_ros_holds(value: Any) -> str:
    """Return what is expected in place of a value that rcl cannot read; empty for any other."""
    if isinstance(value, str):
        fits = all(each != '\0' and not '\ud800' <= each <= '\udfff' for each in value)
        return '' if fits else 'a text of Unicode characters other than NUL'
    if isinstance(value, float):
        fits = not value or not abs(value) < sys.float_info.min
        return '' if fits else f'0 or a number of at least {sys.float_info.min:.2g}'
    return '' if -(2**63) <= value < 2**63 else 'an integer of 64 bits'


def _short(text: str) -> str:
    shown = ''.join(each if each.isprintable() else repr(each)[1:-1] for each in text)
    return shown if len(shown) <= _LONGEST_SHOWN else shown[: _LONGEST_SHOWN - 3] + '...'


def resolved_text(full_name: str, settings: Mapping[str, Setting]) -> str:
    """Return one node's parameters as a ROS parameter file that notes each value's source.

    Args:
        full_name: The node's name in the graph.
        settings: Its parameters.
    """
    lines = [f'{full_name}:', '  ros__parameters:']
    for name, setting in settings.items():
        lines.append(f'    {_quoted(name)}: {_yaml_value(setting.value)}  #@ {setting.origin}')
    if not settings:
        lines[-1] += ' {}'
    return '\n'.join(lines) + '\n'


def _yaml_value(value: Any) -> str:
    if isinstance(value, list):
        if float in map(type, value):  # rcl refuses a list of both kinds of numbers
            value = [float(each) for each in value]
        return '[' + ', '.join(map(_yaml_value, value)) + ']'
    if isinstance(value, float):
        # YAML reads 1e+20 as a text.
        return repr(value) if math.isfinite(value) and 'e' not in repr(value) else _exponent(value)
    return _quoted(value) if isinstance(value, str) else json.dumps(value)


def _quoted(text: str) -> str:
    # Not as JSON has it: rcl's YAML refuses the two halves that JSON writes for one character.
    plain = ''.join(
        each if each.isprintable() and each not in '"\\' else f'\\U{ord(each):08x}' for each in text
    )
    return f'"{plain}"'


def _exponent(value: float) -> str:
    if not math.isfinite(value):
        return '.nan' if math.isnan(value) else '.inf' if value > 0 else '-.inf'
    digits, _, power = repr(value).partition('e')
    return f'{digits if "." in digits else digits + ".0"}e{int(power):+d}'


@dataclass(frozen=True)
class RosArguments:
    """A command line of a node, taken apart.

    Attributes:
        rest: What ROS itself reads: remappings, log levels, ...
        files: Parameter files, in order.
        assignments: Values of `-p`, in order.
    """

    rest: tuple[str, ...]
    files: tuple[str, ...]
    assignments: tuple[str, ...]

    def configuration(self) -> Configuration:
        """Return the parameters that the arguments give: any `-p` wins over every file.

        Raises:
            ParameterError: One of them cannot be used.
        """
        try:
            layers = [file_layer(path) for path in self.files]
        except FileError as error:
            raise ParameterError(f'parameter file {error}') from None
        return Configuration((*layers, argument_layer(self.assignments)))

    def full_name(self, node: str) -> str:
        """Return a node's name in the graph, as the remappings `__ns` and `__node` say."""
        namespace, name = '', node
        for word in self.rest:
            match = _RENAME.match(word)
            if match is None or match['node'] not in (None, node):
                continue
            if match['what'] == 'ns':
                namespace = match['to'].strip('/')
            else:
                name = match['to']
        return f'/{namespace}/{name}' if namespace else f'/{name}'


def split_arguments(words: Sequence[str]) -> RosArguments:
    """Take parameters out of a command line with `--ros-args` sections.

    Raises:
        ParameterError: An option lacks its value, or a word is none that ROS knows.
    """
    rest: list[str] = []
    files: list[str] = []
    assignments: list[str] = []
    words, inside = list(words), False
    at = 0
    while at < len(words):
        word = words[at]
        at += 1
        if not inside or word == '--':
            if not inside and word not in ('--ros-args', '--'):
                raise ParameterError(f'unknown argument {_short(word)}: expected --ros-args first')
            inside = word == '--ros-args'
            rest.append(word)
            continue
        if word == '--ros-args':
            continue
        needs = word in ('-p', '--param', '--params-file') or word in _VALUED
        if needs and at >= len(words):
            raise ParameterError(f'{word}: expected a value after it')
        if word in ('-p', '--param'):
            assignments.append(words[at])
        elif word == '--params-file':
            files.append(words[at])
        elif word in _VALUED:
            if (form := _FORMS.get(word)) and not form[0].fullmatch(words[at]):
                raise ParameterError(f'{word} {_short(words[at])}: expected {form[1]}')
            rest += [word, words[at]]
        elif _FLAGS.match(word):
            rest.append(word)
        else:
            known = ('-p', '--params-file', '-r', '--log-level', '--ros-args')
            raise ParameterError(
                f'unknown argument {_short(word)} after --ros-args: expected {nearest(word, known)}'
            )
        at += needs
    return RosArguments(tuple(rest), tuple(files), tuple(assignments))
