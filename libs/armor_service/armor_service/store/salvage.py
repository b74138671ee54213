"""What can still be read of a damaged World's file."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import quote

_TABLES = (
    *('resources', 'objs', 'datas', 'ontologies', 'armor_state', 'armor_told', 'armor_declared'),
    *('armor_nodes', 'armor_changes'),
)


_COVERING = {'objs': 'index_objs_op', 'datas': 'index_datas_op'}
"""Indexes that hold whole rows."""


def salvage(damaged: Path, target: sqlite3.Connection) -> tuple[int, int]:
    """Copy the rows that can be read into a file that has the tables and nothing in them.

    Returns:
        How many quads were copied, and how many tables could not be read to their end.
    """
    quads = lost = 0
    with closing(sqlite3.connect(f'file:{quote(str(damaged))}?mode=ro', uri=True)) as source:
        for table in _TABLES:
            seen: set[tuple[object, ...]] = set()
            for row in _rows(source, table):
                if row is None:
                    lost += 1
                elif row not in seen:
                    seen.add(row)
                    marks = ', '.join('?' * len(row))
                    target.execute(f'INSERT OR IGNORE INTO {table} VALUES ({marks})', row)
                    quads += table in ('objs', 'datas')
        try:
            counters = source.execute('SELECT * FROM store').fetchone()
        except sqlite3.DatabaseError:
            counters = None
    top = target.execute('SELECT max(storid) FROM resources').fetchone()[0] or 300
    low = target.execute('SELECT min(min(s), min(o)) FROM objs').fetchone()[0] or 0
    blank, resource = (counters[1], counters[2]) if counters else (0, 0)
    target.execute(
        'UPDATE store SET current_blank=?, current_resource=?',
        (max(blank, -low, 0), max(resource, top, 300)),
    )
    return quads, lost


def _rows(source: sqlite3.Connection, table: str) -> Iterator[tuple[object, ...] | None]:
    """Yield the rows of a table: from both ends, and by the index that has all of them as well.

    It ends with None where the table could not be read to its end.
    """
    key = {'resources': 'storid'}.get(table, 'rowid')
    queries = [f'SELECT * FROM {table} NOT INDEXED ORDER BY {key} {way}' for way in ('ASC', 'DESC')]
    if index := _COVERING.get(table):
        columns = 'c, s, p, o' + (', d' if table == 'datas' else '')
        queries.append(f'SELECT {columns} FROM {table} INDEXED BY {index} ORDER BY o, p, c')
    for number, query in enumerate(queries):
        try:
            yield from source.execute(query)
        except sqlite3.DatabaseError:
            continue
        if number != 1:
            return
    yield None
