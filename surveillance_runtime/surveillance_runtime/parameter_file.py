"""Strict reading of ROS parameter files: every value keeps the line it came from.

The ROS parser takes the last of two equal keys in silence and reports a wrong type without a place.
A description of a place is written by hand, so here both are errors that name file and line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

MAX_BYTES = 4_000_000
KeyPath = tuple[str, ...]


class ParameterFileError(ValueError):
    """A parameter file that cannot be used; the message is one line ``file:line: what``."""


@dataclass(frozen=True)
class ParameterFile:
    """The parameters of one file, as nested dictionaries, with the line of each key.

    Attributes:
        path: The file as the caller named it.
        values: Parameters below ``ros__parameters``; dots in keys are resolved into nesting.
        lines: Line number (from 1) of each key path.
    """

    path: Path
    values: Mapping[str, Any]
    lines: Mapping[KeyPath, int]

    def error(self, where: KeyPath, problem: str) -> ParameterFileError:
        """Make the error that says ``problem`` at the line of ``where`` or its nearest parent."""
        line = 1
        for depth in range(len(where), -1, -1):
            if where[:depth] in self.lines:
                line = self.lines[where[:depth]]
                break
        prefix = '.'.join(where) + ': ' if where else ''
        return ParameterFileError(f'{self.path}:{line}: {prefix}{problem}')


def read_parameter_file(path: str | Path, node: str = '/**') -> ParameterFile:
    """Read the parameters that a file gives to ``node``.

    Args:
        path: A ROS 2 parameter file (YAML).
        node: The top-level key whose parameters are wanted; ``/**`` are those for every node.

    Raises:
        ParameterFileError: The file is missing, too large, not YAML, not of a parameter file's
            form, holds a key twice, or uses an alias.
    """
    path = Path(path)
    root = _compose(path)
    entries = _Entries(path)
    if not isinstance(root, yaml.MappingNode):
        raise ParameterFileError(
            f"{path}:1: expected '{node}: ros__parameters: ...', got no mapping"
        )
    top = entries.children(root)
    if node not in top:
        found = ', '.join(top) or 'nothing'
        raise ParameterFileError(f"{path}:1: expected the top-level key '{node}', got {found}")
    _, section = top[node]
    inner = entries.children(section) if isinstance(section, yaml.MappingNode) else {}
    if 'ros__parameters' not in inner:
        line = section.start_mark.line + 1
        raise ParameterFileError(f"{path}:{line}: expected 'ros__parameters:' below '{node}'")
    body = inner['ros__parameters'][1]
    if not isinstance(body, yaml.MappingNode):
        line = body.start_mark.line + 1
        raise ParameterFileError(f"{path}:{line}: expected parameters below 'ros__parameters'")
    values: dict[str, Any] = {}
    entries.lines[()] = body.start_mark.line + 1
    entries.collect(body, (), values)
    return ParameterFile(path, values, entries.lines)


def _compose(path: Path) -> yaml.Node | None:
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ParameterFileError(f'{path}: {size} bytes, at most {MAX_BYTES} are read')
        text = path.read_text(encoding='utf-8')
    except OSError as error:
        raise ParameterFileError(f'{path}: {error.strerror or error}') from None
    except UnicodeDecodeError as error:
        raise ParameterFileError(f'{path}: not UTF-8 text (byte {error.start})') from None
    try:
        loader = _NoAliasLoader(text)
        try:
            node: yaml.Node | None = loader.get_single_node()
        finally:
            loader.dispose()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        raise ParameterFileError(f'{path}:{line}: not valid YAML: {error.problem}') from None
    except yaml.YAMLError as error:
        first_line = str(error).splitlines()[0]
        raise ParameterFileError(f'{path}: not valid YAML: {first_line}') from None
    return node


class _NoAliasLoader(yaml.SafeLoader):
    """Refuses aliases: ROS does not know them, and they make small files expand without bound."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(None, None, 'an alias (*name) cannot be used here', mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        return node


class _Entries:
    def __init__(self, path: Path) -> None:
        self.path = path
        self.lines: dict[KeyPath, int] = {}
        self._scalars = yaml.SafeLoader('')

    def children(self, node: yaml.MappingNode) -> dict[str, tuple[int, yaml.Node]]:
        found: dict[str, tuple[int, yaml.Node]] = {}
        for key, value in node.value:
            line = key.start_mark.line + 1
            if not isinstance(key, yaml.ScalarNode):
                raise ParameterFileError(f'{self.path}:{line}: expected a name as key')
            if key.value in found:
                first = found[key.value][0]
                raise ParameterFileError(
                    f"{self.path}:{line}: duplicate key '{key.value}', first given in line {first}"
                )
            found[key.value] = (line, value)
        return found

    def collect(self, node: yaml.MappingNode, prefix: KeyPath, into: dict[str, Any]) -> None:
        for name, (line, value) in self.children(node).items():
            target, path = into, prefix
            *parents, last = name.split('.')
            for parent in parents:
                path = (*path, parent)
                self.lines.setdefault(path, line)
                inner = target.setdefault(parent, {})
                if not isinstance(inner, dict):
                    raise self._duplicate(path, line)
                target = inner
            path = (*path, last)
            if isinstance(value, yaml.MappingNode):
                self.lines.setdefault(path, line)
                inner = target.setdefault(last, {})
                if not isinstance(inner, dict):
                    raise self._duplicate(path, line)
                self.collect(value, path, inner)
            else:
                if last in target:
                    raise self._duplicate(path, line)
                self.lines[path] = line
                target[last] = self._value(value)

    def _duplicate(self, path: KeyPath, line: int) -> ParameterFileError:
        name = '.'.join(path)
        first = self.lines.get(path, line)
        return ParameterFileError(
            f"{self.path}:{line}: duplicate key '{name}', first given in line {first}"
        )

    def _value(self, node: yaml.Node) -> Any:
        if isinstance(node, yaml.SequenceNode):
            return [self._value(item) for item in node.value]
        if isinstance(node, yaml.MappingNode):
            line = node.start_mark.line + 1
            raise ParameterFileError(f'{self.path}:{line}: a list cannot hold a mapping')
        try:
            return self._scalars.construct_object(node)
        except (yaml.YAMLError, ValueError):
            line = node.start_mark.line + 1
            raise ParameterFileError(
                f"{self.path}:{line}: '{node.value}' cannot be read as a value; quote it"
            ) from None
