"""Writing a place's file: anew, with some entries changed, or as a copy for the folder of a run.

A file that a person wrote keeps its comments, its order and its layout: `updated_text` changes what
is to be changed and nothing else.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from floor_plans.description import read_place
from floor_plans.occupancy_map import write_map
from strict_files.files import FileError, in_one_line

_MAP = 'map.yaml'
_MAP_KEYS = ('map_file', 'map_file_resolution', 'map_file_origin')
_MOST_DIGITS = 7


def format_place(parameters: Mapping[str, Any], title: str) -> str:
    """Return a place's parameters as the text of a ROS 2 parameter file."""
    lines = [f'# {line}' for line in title.splitlines()]
    lines += ['/**:', '  ros__parameters:']
    for name, value in parameters.items():
        if isinstance(value, Mapping):
            lines.append(f'    {name}:')
            lines += [f'      {key}: {_scalar(entry)}' for key, entry in value.items()]
        else:
            lines.append(f'    {name}: {_scalar(value)}')
    return '\n'.join(lines) + '\n'


def _scalar(value: object) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return '[' + ', '.join(_scalar(entry) for entry in value) + ']'
    if isinstance(value, float):
        return repr(round(value, 7))
    return str(value)


def updated_text(
    text: str,
    parameters: Mapping[str, Any],
    renamed: Mapping[tuple[str, str], str] | None = None,
) -> str:
    """Return the text of a place's file with other parameters; comments and order stay.

    What is as before is not touched. A table's entry that `parameters` does not have is taken out
    with the comment behind it, and so is a key; new ones come last.

    Args:
        text: A place's file; it has been read without an error.
        parameters: All that it is to say below `ros__parameters`.
        renamed: Entries that have another name now, by table and new name: the old one. They stay
            where they are, with their comments.
    """
    from ruamel.yaml import YAML  # only whoever edits a place pays for it

    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = 4096
    indent = re.search(r'^( +)ros__parameters:', text, re.MULTILINE)
    step = len(indent[1]) if indent else 2
    yaml.indent(mapping=step, sequence=step, offset=0)
    document = yaml.load(text)
    described = document['/**']['ros__parameters']
    for (table, new), old in (renamed or {}).items():
        if isinstance(described.get(table), Mapping):
            _rename(described[table], old, new)
    _merge(described, parameters)
    written = io.StringIO()
    yaml.dump(document, written)
    return written.getvalue()


def _rename(table: Any, old: str, new: str) -> None:
    if old not in table or new in table:
        return
    comment = table.ca.items.pop(old, None)
    table.insert(list(table).index(old), new, table[old])
    del table[old]
    if comment is not None:
        table.ca.items[new] = comment


def _merge(old: Any, new: Mapping[str, Any]) -> None:
    for name in [name for name in old if name not in new]:
        del old[name]
    for name, value in new.items():
        before = old.get(name)
        if isinstance(value, Mapping) and isinstance(before, Mapping):
            _merge(before, value)
        elif _plain(before) != _plain(value) or name not in old:
            old[name] = _made(value, before)


def _plain(value: Any) -> Any:
    """Return a value as it is compared: numbers that mean the same are the same."""
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [_plain(each) for each in value]
    if isinstance(value, int | float) and not isinstance(value, bool):
        return round(float(value), _MOST_DIGITS)
    return value


def _made(value: Any, before: Any) -> Any:
    """Return a new value in the style of the one before; lists are written in one line."""
    from ruamel.yaml.comments import CommentedMap, CommentedSeq

    if isinstance(value, Mapping):
        return CommentedMap((name, _made(each, None)) for name, each in value.items())
    if isinstance(value, Sequence) and not isinstance(value, str):
        made = CommentedSeq(_made(each, None) for each in value)
        if isinstance(before, CommentedSeq):
            for attribute in ('_yaml_format', '_yaml_comment'):
                if hasattr(before, attribute):
                    setattr(made, attribute, getattr(before, attribute))
        else:
            made.fa.set_flow_style()
        return made
    return round(value, _MOST_DIGITS) if isinstance(value, float) else value


def copy_place(source: Path, target: Path) -> None:
    """Copy a place's file, and the map that it refers to beside it, as `map.yaml` and `map.png`.

    Args:
        source: A place's file that has been read without an error.
        target: The copy; its folder is there.

    Raises:
        FileError: Something cannot be read or written.
    """
    try:
        text = source.read_text('utf-8')
        building = read_place(source).plan.map if 'map_file' in text else None
        if building is not None:
            copied = target.with_name(_MAP)
            write_map(copied, building.cells, building.resolution, building.origin)
            # Line by line: whoever looks at the copy finds all else as it was.
            lines = [
                line for line in text.splitlines(keepends=True) if not _names(line, _MAP_KEYS[1:])
            ]
            text = ''.join(
                re.sub(r'map_file:.*', f'map_file: {_MAP}', line)
                if _names(line, _MAP_KEYS[:1])
                else line
                for line in lines
            )
        target.write_text(text, 'utf-8')
    except OSError as error:
        raise FileError(in_one_line(error)) from None


def _names(line: str, keys: Sequence[str]) -> bool:
    return line.strip().partition(':')[0].strip('\'"') in keys
