"""Strict reading of YAML that people write: every value keeps the line it came from.

YAML's own readers take the last of two equal keys in silence, expand aliases without bound, and
know no line once a value is read. Here the first two are errors, and every error names file and
line. `read_yaml_file` reads any mapping, `read_table` a table of named entries, `parameters_of` the
form of ROS parameter files.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml

from strict_files.files import FileError, read_file

MAX_BYTES = 4_000_000
MAX_DEPTH = 30
MAX_VALUES = 200_000
_SMALL = 30_000
_INT64 = 2**63
_INT, _FLOAT = 'tag:yaml.org,2002:int', 'tag:yaml.org,2002:float'
_NUMBERS = {
    _INT: r'[-+]?(0x[0-9a-fA-F]+|0[0-7]*|[1-9]\d*)\Z',
    _FLOAT: r'[-+]?(\d+\.\d*|\.\d+)([eE][-+]?\d+)?\Z|[-+]?\d+[eE][-+]?\d+\Z'
    r'|[-+]?0\d*[89]\d*\Z|[-+]?\.(inf|Inf|INF)\Z|\.(nan|NaN|NAN)\Z',
}
KeyPath = tuple[str, ...]
Entry = TypeVar('Entry')
UNREADABLE = (yaml.YAMLError, ValueError, LookupError, TypeError, AttributeError)
"""What PyYAML raises for a value; the last three for a tag like `!!int` before something else."""


def _as_ros(kind: Any) -> Any:
    """Return a loader that takes for a number what ROS takes for one (`rcl_yaml_param_parser`).

    `1e3` and `08` are numbers, `010` is 8 as in C; `1:30` and `1_000`, numbers of YAML 1.1, texts.
    """
    loader: Any = type(kind.__name__, (kind,), {})
    loader.yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag not in _NUMBERS]
        for first, resolvers in kind.yaml_implicit_resolvers.items()
    }
    for tag, pattern in _NUMBERS.items():
        loader.add_implicit_resolver(tag, re.compile(pattern, re.ASCII), list('-+.0123456789'))
    return loader


RosLoader = _as_ros(yaml.SafeLoader)
# libyaml's parser is ten times as fast; PyYAML may have been built without it.
_FastLoader = _as_ros(getattr(yaml, 'CSafeLoader', yaml.SafeLoader))


@dataclass(frozen=True)
class YamlFile:
    """What a file holds, with the line of each key.

    Attributes:
        path: The file as the caller named it.
        values: Nested dictionaries by the keys' text; what is no mapping as YAML reads it.
        lines: Line number (from 1) of each key path; of ``()`` the line where it all begins.
    """

    path: Path
    values: Mapping[str, Any]
    lines: Mapping[KeyPath, int]

    def error(self, where: KeyPath, problem: str) -> FileError:
        """Make the error that says ``problem`` at the line of ``where`` or its nearest parent."""
        prefix = '.'.join(where) + ': ' if where else ''
        return self.error_at(where, prefix + problem)

    def error_at(self, where: KeyPath, problem: str) -> FileError:
        """As `error`, without the key's name in the message."""
        line = 1
        for depth in range(len(where), -1, -1):
            if where[:depth] in self.lines:
                line = self.lines[where[:depth]]
                break
        return FileError(f'{self.path}:{line}: {problem}')


def read_yaml_file(path: str | Path) -> YamlFile:
    """Read a file whose document is a mapping.

    Raises:
        FileError: The file is missing, too large, not YAML, no mapping, holds a key twice, uses
            an alias, or has a mapping inside a list.
    """
    path = Path(path)
    root = _compose(path)
    reader = _Reader(path)
    if not isinstance(root, yaml.MappingNode):
        raise FileError(f'{path}:1: expected a mapping, got {_kind(root)}')
    reader.lines[()] = root.start_mark.line + 1
    return YamlFile(path, reader.mapping(root, ()), reader.lines)


class EntryError(ValueError):
    """One key of an entry is wrong; another `ValueError` means the entry as a whole.

    Attributes:
        key: Which one.
    """

    def __init__(self, key: str, problem: str) -> None:
        super().__init__(problem)
        self.key = key


def read_table(
    path: str | Path, table: str, example: str, read: Callable[[str, Mapping[str, Any]], Entry]
) -> list[Entry]:
    """Read a file that holds one table: a mapping from names that a person chose to entries.

    Args:
        path: The file.
        table: The one key at its top.
        example: How an entry may look, for messages.
        read: Makes something of a name and its entry; raises `ValueError` or `EntryError`.

    Raises:
        FileError: One line with file, line, what was wrong and what was expected.
    """
    file = read_yaml_file(path)
    for key in file.values:
        if key != table:
            raise file.error((key,), f"unknown key, expected '{table}' alone")
    entries = file.values.get(table)
    if not isinstance(entries, Mapping) or not entries:
        raise file.error_at((table,), f"expected '{table}:' with names, each with {example}")
    found = []
    for name, entry in entries.items():
        try:
            if not isinstance(entry, Mapping):
                raise ValueError(f'expected a mapping such as {example}')
            found.append(read(name, entry))
        except EntryError as error:
            raise file.error((table, name, error.key), str(error)) from None
        except ValueError as error:
            raise file.error((table, name), str(error)) from None
    return found


def _compose(path: Path) -> yaml.Node | None:
    try:
        text = read_file(path, MAX_BYTES).decode('utf-8')
    except UnicodeDecodeError as error:
        raise FileError(f'{path}: not UTF-8 text (byte {error.start})') from None
    try:
        try:
            return _composed(text, _FastLoader)
        except yaml.YAMLError:
            if len(text) >= _SMALL:
                raise
            # PyYAML says better than libyaml where a mistake is.
            return _composed(text, RosLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        raise FileError(f'{path}:{line}: not valid YAML: {error.problem}') from None
    except yaml.YAMLError as error:
        first_line = str(error).splitlines()[0]
        raise FileError(f'{path}: not valid YAML: {first_line}') from None


def _composed(text: str, kind: Any) -> yaml.Node | None:
    _look_over(text, kind)
    loader = kind(text)
    try:
        node: yaml.Node | None = loader.get_single_node()
        return node
    finally:
        loader.dispose()


def _look_over(text: str, kind: Any) -> None:
    """Refuse what would take the reader without bound, or what ROS does not know.

    Raises:
        yaml.MarkedYAMLError: An alias, deep nesting, or very many values.
    """
    depth = values = 0
    for event in yaml.parse(text, Loader=kind):
        if isinstance(event, yaml.AliasEvent):
            raise yaml.MarkedYAMLError(
                None,
                None,
                'an alias (*name) cannot be used here',
                event.start_mark,  # type: ignore[arg-type]
            )
        if isinstance(event, yaml.CollectionStartEvent):
            depth += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            depth -= 1
        elif isinstance(event, yaml.ScalarEvent):
            values += 1
        if depth > MAX_DEPTH or values > MAX_VALUES:
            problem = f'expected at most {MAX_DEPTH} levels and {MAX_VALUES} keys and values'
            raise yaml.MarkedYAMLError(None, None, problem, event.start_mark)  # type: ignore[arg-type]


class _Reader:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: dict[KeyPath, int] = {}
        self._scalars = yaml.SafeLoader('')

    def mapping(self, node: yaml.MappingNode, prefix: KeyPath) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise FileError(f'{self.path}:{line}: expected a name as key')
            where = (*prefix, key.value)
            if key.value in found:
                raise twice(self.path, (key.value,), line, self.lines[where])
            self.lines[where] = line
            if isinstance(value, yaml.MappingNode):
                found[key.value] = self.mapping(value, where)
            else:
                found[key.value] = self._value(value)
        return found

    def _value(self, node: yaml.Node) -> Any:
        if isinstance(node, yaml.SequenceNode):
            return [self._value(item) for item in node.value]
        if isinstance(node, yaml.MappingNode):
            line = node.start_mark.line + 1
            raise FileError(f'{self.path}:{line}: a list cannot hold a mapping')
        line = node.start_mark.line + 1
        try:
            value = self._scalars.construct_object(node)
        except UNREADABLE:
            raise FileError(
                f"{self.path}:{line}: '{node.value}' cannot be read as a value; quote it"
            ) from None
        if isinstance(value, int) and not -_INT64 <= value < _INT64:
            raise FileError(f'{self.path}:{line}: {node.value:.40}: expected a 64-bit number')
        return value


def twice(path: Path, where: KeyPath, line: int, first: int) -> FileError:
    """Make the error that a key is given again in ``line``, first in ``first``."""
    name = '.'.join(where)
    return FileError(f"{path}:{line}: duplicate key '{name}', first given in line {first}")


def _kind(node: yaml.Node | None) -> str:
    if node is None:
        return 'nothing'
    return 'a list' if isinstance(node, yaml.SequenceNode) else 'a value'


def parameters_of(file: YamlFile, section: str) -> Iterator[tuple[KeyPath, str, Any]]:
    """Yield the parameters below one of the top-level keys: key path, name, value.

    The names of nested keys are joined with dots.

    Raises:
        FileError: It is not of a parameter file's form, or gives a parameter twice.
    """
    below = file.values[section]
    if not isinstance(below, Mapping) or not isinstance(below.get('ros__parameters'), Mapping):
        raise file.error_at(
            (section,), f"expected 'ros__parameters:' with a mapping in '{section}'"
        )
    for key in below:
        if key != 'ros__parameters':
            raise file.error_at(
                (section, key), f"expected 'ros__parameters:' below '{section}', got '{key}'"
            )
    seen: dict[str, int] = {}
    start = (section, 'ros__parameters')
    for where, name, value in _flattened(below['ros__parameters'], start, ''):
        line = file.lines[where]
        if name in seen:
            raise twice(file.path, (name,), line, seen[name])
        seen[name] = line
        yield where, name, value


def _flattened(
    body: Mapping[str, Any], where: KeyPath, prefix: str
) -> Iterator[tuple[KeyPath, str, Any]]:
    for key, value in body.items():
        if isinstance(value, Mapping):
            yield from _flattened(value, (*where, key), f'{prefix}{key}.')
        else:
            yield (*where, key), prefix + key, value
