"""Nodes that are named on a command line run in one process."""

from __future__ import annotations

import pytest

from surveillance_runtime import composition, process
from surveillance_runtime.node_table import find


def test_the_named_nodes_run_together_and_the_one_that_uses_the_others_ends_first(monkeypatch):
    ran = []
    monkeypatch.setattr(process, 'run_nodes', lambda classes, words: ran.append((classes, words)))
    composition.main(['robot_behavior', 'reasoner', '--ros-args', '-p', 'x:=1'])
    (classes, words) = ran[0]
    assert [each.__name__ for each in classes] == [
        find(name).class_name for name in ('reasoner', 'robot_behavior')
    ]
    assert words == ['--ros-args', '-p', 'x:=1']


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--ros-args'], 'expected NODE'),
        (['reasonr'], "unknown node 'reasonr': expected 'reasoner'"),
    ],
)
def test_a_wrong_name_is_said_in_one_line(words, said, capsys):
    assert composition.main(words) == 2
    assert capsys.readouterr().err.startswith(f'nodes: {said}')
