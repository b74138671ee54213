"""A file that holds one table of named entries: each mistake is one line that says where."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from strict_files.files import FileError
from strict_files.yaml_file import EntryError, read_table


def lamp(name: str, entry: Mapping[str, Any]) -> tuple[str, float]:
    if 'watt' not in entry:
        raise ValueError("expected 'watt'")
    if not isinstance(entry['watt'], int | float):
        raise EntryError('watt', 'expected a number')
    return name, float(entry['watt'])


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('lamps: {}', ":1: expected 'lamps:' with names, each with 'watt: 5'"),
        ('lamps: [1]', ":1: expected 'lamps:' with names"),
        ('lamp:\n  a: {watt: 5}', ":1: lamp: unknown key, expected 'lamps' alone"),
        ('lamps:\n  a: {watt: 5}\n  b: 7', ":3: lamps.b: expected a mapping such as 'watt: 5'"),
        ('lamps:\n  a: {watt: 5}\n  b: {}', ":3: lamps.b: expected 'watt'"),
        ('lamps:\n  a:\n    name: x\n    watt: y', ':4: lamps.a.watt: expected a number'),
    ],
)
def test_a_mistake_is_one_line_with_file_line_and_key(tmp_path: Path, text: str, line: str) -> None:
    path = tmp_path / 'lamps.yaml'
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_table(path, 'lamps', "'watt: 5'", lamp)
    assert str(caught.value).startswith(f'{path}{line}')


def test_entries_are_read_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / 'lamps.yaml'
    path.write_text('lamps:\n  b: {watt: 5}\n  a: {watt: 7}\n')
    assert read_table(path, 'lamps', "'watt: 5'", lamp) == [('b', 5.0), ('a', 7.0)]
