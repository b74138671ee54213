"""Adds a rule to a person's `watch.yaml`, whose text stays as it was written."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from indoor_watch import Kind, read_watch_file
from strict_files.files import FileError, replace_text
from strict_files.one_line import clean
from strict_files.suggestions import nearest

LONGEST_NAME = 60


def rule_entry(
    kind: str, wanted: str, subject: str, hours: str, severity: str, places: Sequence[str]
) -> dict[str, Any]:
    """Return what stands in the file for a rule.

    Raises:
        ValueError: There is no such kind.
    """
    if kind not in list(Kind):
        raise ValueError(f'{str(kind)[:40]!r}: expected {nearest(str(kind)[:40], Kind)}')
    # What has a name is asked by it; of the rest the kind says how it is to be.
    named = bool(Kind(kind).named)
    entry: dict[str, Any] = {kind: subject or 'all'} if named else {kind: wanted}
    if named and wanted:
        entry['is'] = wanted
    more = {'hours': hours, 'severity': severity, 'places': list(places)}
    return entry | {key: value for key, value in more.items() if value}


def add_rule(
    path: Path,
    name: str,
    entry: Mapping[str, Any],
    places: Sequence[str] = (),
    doors: Sequence[str] = (),
) -> str:
    """Add a rule at the end of a file, and return it in words.

    Args:
        path: The file.
        name: Of the rule, which none has yet.
        entry: As `rule_entry` gives it.
        places, doors: Those that there are; empty: any name is taken.

    Raises:
        ValueError: The rule is none, or the file cannot take it; the file is as it was.
    """
    name = clean(str(name)).strip()
    if not 0 < len(name) <= LONGEST_NAME:
        raise ValueError(f'name: expected one of up to {LONGEST_NAME} signs')
    part = path.with_name(f'{path.name}.part')
    try:
        text = path.read_text('utf-8')
        known = {each.name for each in read_watch_file(path)}
        if name in known:
            raise ValueError(f'there is a rule {name!r} already')
        inner = (line for line in text.splitlines() if line.startswith(' '))
        first = next(inner, '  ')
        indent = first[: len(first) - len(first.lstrip())] or '  '
        line = yaml.safe_dump(dict(entry), default_flow_style=True, width=10_000).strip()
        added = text.rstrip('\n') + f'\n{indent}{json.dumps(name, ensure_ascii=False)}: {line}\n'
        part.write_text(added, 'utf-8')
        try:
            rules = read_watch_file(part, places, doors)
        finally:
            part.unlink(missing_ok=True)
        replace_text(path, added)
    except FileError as error:
        raise ValueError(str(error).replace(part.name, path.name)) from None
    except OSError as error:
        raise ValueError(f'{path}: {os.strerror(error.errno or 0)}') from None
    return rules[-1].words()
