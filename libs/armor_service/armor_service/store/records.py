"""Axioms and changes as JSON, and lines of it that tell a whole one from one that was cut off.

A line is ``<crc32> <length> <text>``; a ``+`` behind the length says that the next line belongs to
the same record of work.
"""

from __future__ import annotations

import json
import re
import zlib
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from typing import Any, get_args

from armor_service.changes import Change
from armor_service.quarantine import Submission
from owl_reasoner.owl import axioms, expressions
from owl_reasoner.owl.expressions import Literal

_RECORDS: dict[str, type] = {
    name: member
    for module in (axioms, expressions)
    for name, member in vars(module).items()
    if isinstance(member, type) and is_dataclass(member) and member is not Literal
} | {change.__name__: change for change in get_args(Change)}
_FIELDS = {name: tuple(f.name for f in fields(record)) for name, record in _RECORDS.items()}


def encode(value: Any) -> Any:
    """Turn an axiom or a change into lists, strings and numbers that JSON holds.

    A record becomes ``[class name, field, ...]``, a tuple ``["t", ...]``, a set ``["s", ...]``, a
    literal ``["l", lexical, datatype, language]``.
    """
    if isinstance(value, str | int):
        return value
    if isinstance(value, Literal):
        return ['l', value.lexical, value.datatype, value.language]
    if isinstance(value, tuple):
        return ['t', *map(encode, value)]
    if isinstance(value, frozenset):
        return ['s', *map(encode, sorted(value))]
    name = type(value).__name__
    return [name, *[encode(getattr(value, field)) for field in _FIELDS[name]]]


def decode(value: Any) -> Any:
    """Undo `encode`.

    Raises:
        ValueError: Not something `encode` wrote.
    """
    if not isinstance(value, list):
        return value
    if not value or not isinstance(value[0], str):
        raise ValueError(f'no record: {value!r:.80}')
    tag, *parts = value
    if tag == 'l':
        return Literal(*parts)
    decoded = [decode(part) for part in parts]
    if tag == 't':
        return tuple(decoded)
    if tag == 's':
        return frozenset(decoded)
    if tag not in _RECORDS:
        raise ValueError(f'unknown record {tag!r}')
    return _RECORDS[tag](*decoded)


def submission_as_json(told: Submission) -> list[Any]:
    """Turn what one client asked for into what JSON holds."""
    return [[encode(change) for change in told.changes], told.time, told.client]


def submission_of(changes: Iterable[Any], time: float = 0.0, client: str = '') -> Submission:
    """Undo `submission_as_json`.

    Raises:
        ValueError: Not something that it made.
    """
    return Submission(client, time, tuple(decode(change) for change in changes))


TO_JSON = json.JSONEncoder(separators=(',', ':'))
_HEAD = re.compile(rb'([0-9a-f]{8}) (\d{1,10})(\+?) ')


def line_of(record: Any) -> bytes:
    """Return the line of a record."""
    text = TO_JSON.encode(record).encode()
    body = b'%d %s' % (len(text), text)
    return b'%08x %s\n' % (zlib.crc32(body), body)


def entry_at(data: bytes, start: int) -> tuple[Any, bool, int] | None:
    """Return the record of a line, whether more belongs to it, and where the next line begins;
    None: it is damaged or cut off.
    """
    head = _HEAD.match(data, start)
    if head is not None:
        end = head.end() + int(head[2])
        if end <= len(data) and b'%08x' % zlib.crc32(data[start + 9 : end]) == head[1]:
            return json.loads(data[head.end() : end]), bool(head[3]), end + 1
    return None


def entries(data: bytes) -> tuple[list[Any], int]:
    """Return the whole records of a file, without work that was cut off, and how many lines are
    damaged.
    """
    found: list[Any] = []
    work: list[Any] = []
    damaged, start = 0, 0
    while start < len(data):
        entry = entry_at(data, start)
        if entry is None:
            newline = data.find(b'\n', start)
            # The last line of a file may have been cut off by a crash.
            damaged += newline >= 0
            start = newline + 1 if newline >= 0 else len(data)
            continue
        record, more, start = entry
        work.append(record)
        if not more:
            found += work
            work = []
    return found + (work if damaged else []), damaged
