"""A rule is added to a person's file, or the file stays as it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from indoor_watch import read_watch_file
from surveillance_operator.desk.rule_file import add_rule, rule_entry

pytestmark = pytest.mark.unit
TEXT = """# my rules
rules:
    front door: # the big one
        door: D1
        is: closed
"""


def test_a_rule_is_added_and_what_was_written_stays(tmp_path: Path) -> None:
    path = tmp_path / 'watch.yaml'
    path.write_text(TEXT)
    entry = rule_entry('person', 'nobody', 'all', 'daily 20:00-06:00', 'warning', ['R1'])
    assert add_rule(path, 'night: R1', entry, ('R1',)).startswith('night: R1: in the hours daily')
    assert path.read_text().startswith(TEXT)
    assert [each.name for each in read_watch_file(path)] == ['front door', 'night: R1']
    add_rule(path, 'D2', rule_entry('door', 'closed', 'D2', '', 'alert', ()), (), ('D1', 'D2'))
    assert len(read_watch_file(path)) == 3


@pytest.mark.parametrize(
    ('text', 'name', 'kind', 'wanted', 'expected'),
    [
        (TEXT, 'front door', 'door', 'closed', 'already'),
        (TEXT, '', 'door', 'closed', 'name: expected'),
        (TEXT, 'x', 'dor', 'closed', "expected 'door'"),
        (TEXT, 'x', 'door', 'shut', "expected 'closed'|got 'shut'"),
        ('rules: {a: {door: D1, is: closed}}\n', 'x', 'door', 'closed', 'watch.yaml'),
        ('rules:\n  a: [1]\n', 'x', 'door', 'closed', 'watch.yaml'),
    ],
)
def test_what_cannot_be_added_leaves_the_file_as_it_was(
    tmp_path: Path, text: str, name: str, kind: str, wanted: str, expected: str
) -> None:
    path = tmp_path / 'watch.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=expected):
        add_rule(path, name, rule_entry(kind, wanted, 'all', '', 'alert', ()))
    assert path.read_text() == text
    assert [each.name for each in tmp_path.iterdir()] == ['watch.yaml']
