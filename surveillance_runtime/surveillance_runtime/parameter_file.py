"""ROS parameter files, read strictly: what `yaml_file` refuses, ROS takes in silence.

A description of a place is written by hand, so a mistake in it has to be named with its line.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from surveillance_runtime.yaml_file import KeyPath, YamlFile, read_yaml_file, twice


def read_parameter_file(path: str | Path, node: str = '/**') -> YamlFile:
    """Read the parameters that a file gives to ``node``.

    Args:
        path: A ROS 2 parameter file (YAML).
        node: The top-level key whose parameters are wanted; ``/**`` are those for every node.

    Returns:
        The parameters below ``ros__parameters``; dots in keys are resolved into nesting.

    Raises:
        YamlFileError: The file cannot be read, is not of a parameter file's form, or gives a
            parameter twice.
    """
    file = read_yaml_file(path)
    if node not in file.values:
        found = ', '.join(file.values) or 'nothing'
        raise file.error((), f"expected the top-level key '{node}', got {found}")
    section = file.values[node]
    if not isinstance(section, Mapping) or 'ros__parameters' not in section:
        raise file.error_at((node,), f"expected 'ros__parameters:' below '{node}'")
    start = (node, 'ros__parameters')
    body = section['ros__parameters']
    if not isinstance(body, Mapping):
        raise file.error_at(start, "expected parameters below 'ros__parameters'")
    nesting = _Nesting(file, start)
    nesting.collect(body, start, nesting.values, ())
    return YamlFile(file.path, nesting.values, nesting.lines)


class _Nesting:
    """Puts ``map.R1`` where ``map: {R1: ...}`` would stand."""

    def __init__(self, file: YamlFile, start: KeyPath) -> None:
        self.values: dict[str, Any] = {}
        self.lines: dict[KeyPath, int] = {(): file.lines[start]}
        self._file = file

    def collect(
        self, body: Mapping[str, Any], source: KeyPath, into: dict[str, Any], prefix: KeyPath
    ) -> None:
        for name, value in body.items():
            line = self._file.lines[(*source, name)]
            target, path = into, prefix
            for part in name.split('.')[:-1]:
                path = (*path, part)
                target = self._below(target, path, line)
            path = (*path, name.rpartition('.')[2])
            if isinstance(value, Mapping):
                self.collect(value, (*source, name), self._below(target, path, line), path)
            elif path[-1] in target:
                raise self._twice(path, line)
            else:
                self.lines[path] = line
                target[path[-1]] = value

    def _below(self, target: dict[str, Any], path: KeyPath, line: int) -> dict[str, Any]:
        self.lines.setdefault(path, line)
        inner = target.setdefault(path[-1], {})
        if not isinstance(inner, dict):
            raise self._twice(path, line)
        return inner

    def _twice(self, path: KeyPath, line: int) -> Exception:
        return twice(self._file.path, path, line, self.lines[path])
